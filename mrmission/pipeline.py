"""The stages in order: a survey area and options in, a fleet plan out."""

from __future__ import annotations

import math
import platform
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from importlib import metadata
from typing import Any

import numpy as np
import shapely

import mrmission
from mrmission.area.berths import berths
from mrmission.area.frame import LocalFrame, project_polygons
from mrmission.area.region import (
    default_start,
    navigable_region,
    part_of,
    parts_by_size,
    snap_start,
)
from mrmission.errors import GeometryError, InfeasibleError, PlanningError
from mrmission.mission.build import (
    LAUNCH_RADIUS_M,
    BuiltMission,
    Route,
    build_mission,
    export_route,
)
from mrmission.mission.failsafe import (
    StraightWays,
    failsafe_notes,
    failsafe_report,
    straight_ways,
)
from mrmission.mission.wanted import vehicle_notes
from mrmission.model import (
    CoveragePath,
    FleetPlan,
    FleetReport,
    FloatArray,
    LegKind,
    Mission,
    RobotReport,
    SurveyArea,
)
from mrmission.options import PlanOptions
from mrmission.partition import PLANNERS, CoverageProblem
from mrmission.partition.bound import area_bound_s
from mrmission.partition.problem import Assignment, Visit
from mrmission.routing.harbour import Harbour
from mrmission.tour.coverage import Uncovered
from mrmission.tour.flight import time_model
from mrmission.tour.order import PieceBook
from mrmission.tour.path import assemble_paths
from mrmission.tour.repair import fleet_legs, number_lanes, pieces_to_repair, repair, total_area
from mrmission.tour.separation import delay_notes, timeline, worthwhile_delays_s
from mrmission.tour.starts import bottleneck_assignment
from mrmission.tour.sweep import Sweep, best_bearing_deg, lane_spacing_m, sweep_region
from mrmission.tour.timing import TimeModel
from mrmission.tour.turnaround import with_turnarounds

AUTO_METHODS = ("crc", "cac")
MAX_EXPORT_ROUNDS = 6
MAX_MINMAX_LANES = 4000


@dataclass(frozen=True, slots=True, kw_only=True)
class PartPlan:
    """One connected part of the water and the robots that sweep it."""

    region_m: shapely.Polygon
    robots: tuple[int, ...]
    homes_m: FloatArray
    paths: tuple[CoveragePath, ...]
    method: str
    sweep: Sweep
    harbour: Harbour
    uncovered: Uncovered


def leg_tolerance_m(swath_m: float) -> float:
    """Return how far a leg may depart between any two readings of a straight line, m."""
    return min(0.1, max(0.01, 0.002 * swath_m))


def plan(
    area: SurveyArea,
    options: PlanOptions,
    assumed: Mapping[str, Any] | None = None,
    *,
    on_stage: Callable[[str], None] = lambda _: None,
) -> FleetPlan:
    """Plan a fleet survey of an area.

    Parameters
    ----------
    area
        The water to sweep.
    options
        What the user asked for.
    assumed
        Options that the user did not give, by name, for the report.
    on_stage
        Called with a few words when a stage begins.

    Raises
    ------
    GeometryError
        When no water is left, or a start lies on land.
    PlanningError
        When no plan can be made.
    """
    on_stage("finding the water")
    frame = LocalFrame.of(area)
    water = project_polygons(area.water_lonlat, frame)
    region = navigable_region(water, options.clearance_m)
    notes = list(area.notes)
    too_large = frame.error_note(water)
    if too_large:
        notes.append(too_large)
    if options.clearance_m == 0:
        notes.append("clearance 0 m: lanes touch the shore and the islands")
    pieces = parts_by_size(region)
    if not pieces:
        raise GeometryError(
            f"{area.source}: no water is left at a clearance of {options.clearance_m:g} m: "
            "choose a smaller --clearance"
        )
    groups, unreached = _robots_by_part(pieces, water, frame, options, notes)
    time = time_model(options)
    on_stage("planning")
    parts = [
        _plan_part(part, water, starts, robots, frame, options, time, notes)
        for part, starts, robots in groups
    ]
    on_stage("fencing and checking")
    return _finish(area, frame, water, parts, unreached, options, time, notes, dict(assumed or {}))


Group = tuple[shapely.Polygon, FloatArray, tuple[int, ...]]


def _robots_by_part(
    pieces: list[shapely.Polygon],
    water: shapely.MultiPolygon,
    frame: LocalFrame,
    options: PlanOptions,
    notes: list[str],
) -> tuple[list[Group], list[shapely.Polygon]]:
    """Return the parts that have a start, with the starts and robots of each, and the others."""
    everyone = tuple(range(1, options.robots + 1))
    if not options.starts_lonlat:
        part = pieces[0]
        starts = default_start(part)[None]
        lon, lat = frame.to_lonlat(starts)[0]
        notes.append(f"start chosen at the shore of the largest part: {lon:.6f},{lat:.6f}")
        groups = [(part, starts, everyone)]
    else:
        by_part: dict[int, tuple[list[FloatArray], list[int]]] = {}
        for i, lonlat in enumerate(options.starts_lonlat):
            given = frame.to_metric(np.array([lonlat], dtype=np.float64))[0]
            start, note = snap_start(shapely.MultiPolygon(pieces), given, frame)
            index = part_of(pieces, start)
            if note:
                notes.append(note)
            mine = by_part.setdefault(index, ([], []))
            mine[0].append(start)
            mine[1].append(i + 1)
        if len(options.starts_lonlat) == 1:
            ((index, (starts_of, _)),) = by_part.items()
            groups = [(pieces[index], np.array(starts_of), everyone)]
        else:
            groups = [
                (pieces[index], np.array(s), tuple(r)) for index, (s, r) in sorted(by_part.items())
            ]
    reached = {id(part) for part, _, _ in groups}
    unreached = sorted((p for p in pieces if id(p) not in reached), key=lambda p: -p.area)
    for p in unreached[:5]:
        lon, lat = frame.to_lonlat(shapely.get_coordinates(p.representative_point()))[0]
        notes.append(
            f"not planned: {p.area:,.0f} m² of water near {lon:.5f},{lat:.5f}, "
            "no boat can reach it from a start"
        )
    if len(unreached) > 5:
        rest = total_area(unreached[5:])
        notes.append(f"not planned: {len(unreached) - 5} smaller parts, {rest:,.0f} m² in all")
    return groups, unreached


def _plan_part(
    part: shapely.Polygon,
    water: shapely.MultiPolygon,
    starts_m: FloatArray,
    robots: tuple[int, ...],
    frame: LocalFrame,
    options: PlanOptions,
    time: TimeModel,
    notes: list[str],
) -> PartPlan:
    spacing = lane_spacing_m(options.swath_m, options.overlap, leg_tolerance_m(options.swath_m))
    # A robot's own start is where it starts, also where it is the only one of its part.
    if len(starts_m) == 1 and len(options.starts_lonlat) != options.robots:
        found = berths(
            water, part, starts_m[0], len(robots),
            spacing_m=options.berth_spacing_m, launch_radius_m=LAUNCH_RADIUS_M,
        )  # fmt: skip
        homes = found.points_m
        notes.extend(found.notes)
    else:
        homes = starts_m
        gap = np.hypot(*(homes[:, None] - homes[None]).transpose(2, 0, 1))
        near = np.argwhere(np.triu(gap < options.berth_spacing_m, 1))
        if len(near):
            i, j = near[0]
            notes.append(
                f"the starts of robots {robots[i]} and {robots[j]} are {gap[i, j]:.1f} m apart, "
                f"less than {options.berth_spacing_m:g} m: launch one after the other"
            )
    bearing = options.angle_deg
    if bearing is None:
        bearing = best_bearing_deg(
            part, spacing, options.survey_speed_m_s, time.lane_turn_s(spacing)
        )
    sweep = sweep_region(part, bearing % 180.0, spacing)
    harbour = Harbour(part, homes)
    if options.method == "minmax":
        method, paths = "minmax", _lane_paths(sweep, harbour, homes, time, options)
    else:
        method, paths = _cell_paths(sweep, harbour, homes, time, options)
    radius = options.swath_m / 2
    uncovered = Uncovered(sweep.region, sweep.column_pitch_m, radius)
    return PartPlan(
        region_m=part,
        robots=robots,
        homes_m=homes,
        paths=paths,
        method=method,
        sweep=sweep,
        harbour=harbour,
        uncovered=uncovered,
    )


def _cell_paths(
    sweep: Sweep, harbour: Harbour, homes_m: FloatArray, time: TimeModel, options: PlanOptions
) -> tuple[str, tuple[CoveragePath, ...]]:
    """Return the method and the paths of a planner of the paper, or of the better of two."""
    book = PieceBook(sweep, harbour, time)
    problem = _problem(sweep, harbour, book, homes_m, time)
    methods = AUTO_METHODS if options.method == "auto" else (options.method,)
    found = []
    for method in methods:
        assignment = PLANNERS[method](problem, len(homes_m))
        paths = _paths_of(assignment, book, harbour, homes_m, time)
        makespan = max(time.duration_s(p.points_m, p.kind) for p in paths)
        found.append((makespan, method, paths))
    _, method, paths = min(found, key=lambda item: item[0])
    return method, paths


def _lane_paths(
    sweep: Sweep, harbour: Harbour, homes_m: FloatArray, time: TimeModel, options: PlanOptions
) -> tuple[CoveragePath, ...]:
    """Return the paths of the lane planner."""
    from mrmission.minmax.search import LaneProblem, minmax

    ends = sweep.frame.to_local(sweep.lane_ends_m())
    if len(ends) > MAX_MINMAX_LANES:
        raise InfeasibleError(
            f"{len(ends)} lanes: --method minmax plans up to {MAX_MINMAX_LANES}; "
            "choose a wider --swath, or --method auto"
        )
    flat = ends.reshape(-1, 2)
    tours = minmax(
        LaneProblem(
            lane_cost=np.hypot(*(ends[:, 1] - ends[:, 0]).T) / time.survey_speed_m_s,
            end_cost=harbour.distance_matrix(flat) / time.transit_speed_m_s,
            home_cost=harbour.distances(homes_m, flat) / time.transit_speed_m_s,
        ),
        options.time_budget_s,
        options.seed,
    )
    lanes = []
    for entries in tours.entries:
        way = ends[entries >> 1]
        lanes.append(np.where((entries & 1 == 1)[:, None, None], way[:, ::-1], way))
    return assemble_paths(harbour, lanes)


def _problem(
    sweep: Sweep, harbour: Harbour, book: PieceBook, homes_m: FloatArray, time: TimeModel
) -> CoverageProblem:
    cells = len(sweep.decomposition.cells)
    reeb = sweep.decomposition.reeb
    nodes = sweep.frame.to_local(reeb.node_m)
    # a critical point is the middle of a column border and may lie on a sliver of land
    nearest = shapely.shortest_line(harbour.region, shapely.points(nodes))
    inside = shapely.get_coordinates(nearest).reshape(-1, 2, 2)[:, 0]
    depot = harbour.distances(homes_m[:1], inside)[0]
    return CoverageProblem(
        reeb=reeb,
        dual_edges=sweep.decomposition.dual_edges,
        cell_cost=book.costs_s([Visit(c, 0) for c in range(cells)]),
        half_cost=np.column_stack(
            [book.costs_s([Visit(c, h) for c in range(cells)]) for h in (1, 2)]
        ),
        depot_cost=depot / time.transit_speed_m_s,
    )


def _paths_of(
    assignment: Assignment,
    book: PieceBook,
    harbour: Harbour,
    homes_m: FloatArray,
    time: TimeModel,
) -> tuple[CoveragePath, ...]:
    """Assign the tours to the homes, the longest as short as can be, and close them there."""
    loose = [book.order(visits, None) for visits in assignment]
    n = len(loose)
    cost = np.zeros((n, n))
    for i, lanes in enumerate(loose):
        if len(lanes) == 0:
            continue
        ends = np.array([lanes[0, 0], lanes[-1, 1]])
        trips = harbour.distances(homes_m, ends).sum(axis=1)
        inner = np.hypot(*(lanes[:, 1] - lanes[:, 0]).T).sum() / time.survey_speed_m_s
        gaps = harbour.pair_distances(lanes[:-1, 1], lanes[1:, 0]).sum()
        cost[i] = inner + (gaps + trips) / time.transit_speed_m_s
    home_of = bottleneck_assignment(cost)
    lanes_of: list[FloatArray] = [np.zeros((0, 2, 2))] * n
    for i, visits in enumerate(assignment):
        lanes_of[home_of[i]] = book.order(visits, homes_m[home_of[i]])
    return assemble_paths(harbour, lanes_of)


def _finish(
    area: SurveyArea,
    frame: LocalFrame,
    water: shapely.MultiPolygon,
    parts: Sequence[PartPlan],
    unreached: Sequence[shapely.Polygon],
    options: PlanOptions,
    time: TimeModel,
    notes: list[str],
    assumed: dict[str, Any],
) -> FleetPlan:
    missions: dict[int, Mission] = {}
    rows: dict[int, RobotReport] = {}
    paths: dict[int, CoveragePath] = {}
    ways: dict[int, StraightWays] = {}
    homes = np.zeros((options.robots, 2))
    covered = covered_by_survey = largest = bound = 0.0
    for part in parts:
        routes, coverage = _export(part, frame, options, time)
        for route, robot, home in zip(routes, part.robots, part.homes_m, strict=True):
            built = build_mission(route, robot, home, water, frame, options)
            notes.extend(built.notes)
            missions[robot] = built.mission
            paths[robot] = replace(route.path, robot=robot)
            homes[robot - 1] = home
            if options.vehicle != "copter":
                ways[robot] = straight_ways(built.path.points_m, home, water)
            rows[robot] = _robot_row(robot, built, frame.to_lonlat(home[None])[0], time)
        covered += coverage.covered_m2
        covered_by_survey += coverage.covered_by_survey_m2
        largest = max(largest, coverage.largest_missed_m2)
        bound = max(
            bound,
            area_bound_s(
                coverage.covered_m2, options.swath_m, len(part.robots), time.top_speed_m_s
            ),
        )
    failsafe = failsafe_report(ways, frame)
    notes.extend(failsafe_notes(failsafe))
    notes.extend(_start_one_after_the_other(rows, paths, time))
    robots = tuple(rows[r] for r in sorted(rows))
    notes.extend(_swing_notes(list(paths.values()), options, time))
    busy = next((m for _, m in sorted(missions.items()) if m.items), None)
    if busy is not None:
        notes.extend(vehicle_notes(busy, options, LAUNCH_RADIUS_M))
    largest_part = max(parts, key=lambda p: p.region_m.area)
    planned = total_area([p.region_m for p in parts])
    makespan = max(r.duration_s for r in robots)
    idle = [str(r.robot) for r in robots if r.lanes == 0]
    if idle:
        names = ", ".join(idle[:8]) + (" …" if len(idle) > 8 else "")
        notes.append(
            f"no work for {len(idle)} of {len(robots)} robots ({names}): "
            + (
                "too few lanes"
                if largest_part.method == "minmax"
                else "cells are not split further"
            )
            + "; their files are empty but valid"
        )
    most = max(robots, key=lambda r: r.items)
    if most.items > options.limits.mission_items:
        notes.append(
            f"robot {most.robot} needs {most.items} mission items, a vehicle holds "
            f"{options.limits.mission_items}: use a wider --swath or more robots"
        )
    report = FleetReport(
        robots=robots,
        method=largest_part.method,
        makespan_s=makespan,
        lower_bound_s=bound,
        lower_bound_name="area bound",
        gap=makespan / bound - 1 if bound > 0 else 0.0,
        utilization=sum(r.lanes > 0 for r in robots) / len(robots),
        coverage=covered / planned,
        coverage_survey_legs=covered_by_survey / planned,
        coverage_of_area=(covered + _covered_beyond(water, parts, list(paths.values()), options))
        / water.area,
        largest_missed_m2=largest,
        area_m2=water.area,
        navigable_m2=planned + total_area(unreached),
        unreached_m2=total_area(unreached),
        unreached_parts_m2=tuple(p.area for p in unreached),
        angle_deg=largest_part.sweep.frame.bearing_deg,
        lane_spacing_m=max(p.sweep.column_pitch_m for p in parts),
        frame=frame.proj,
        frame_error_m=frame.error_m(water),
        options=options.as_dict(),
        assumed=assumed,
        notes=tuple(notes),
        versions=versions(),
        seed=options.seed,
        failsafe=failsafe,
    )
    return FleetPlan(
        area=area,
        water_m=water,
        region_m=shapely.MultiPolygon([p.region_m for p in parts]),
        homes_m=homes,
        paths=tuple(paths[r] for r in sorted(paths)),
        missions=tuple(missions[r] for r in sorted(missions)),
        report=report,
    )


def _start_one_after_the_other(
    rows: dict[int, RobotReport], paths: Mapping[int, CoveragePath], time: TimeModel
) -> list[str]:
    """Enter the delays of the starts into the rows, and return what to say about them."""
    order = sorted(rows)
    delays, horizon_s = worthwhile_delays_s([timeline(paths[r], time) for r in order])
    for robot, delay_s in zip(order, delays.tolist(), strict=True):
        rows[robot] = replace(rows[robot], start_delay_s=delay_s)
    return delay_notes(rows, horizon_s)


@dataclass(frozen=True, slots=True, kw_only=True)
class _Coverage:
    covered_m2: float
    covered_by_survey_m2: float
    largest_missed_m2: float


def _export(
    part: PartPlan, frame: LocalFrame, options: PlanOptions, time: TimeModel
) -> tuple[list[Route], _Coverage]:
    """Return the routes in exported, rounded coordinates, complete as measured on these."""
    tolerance = leg_tolerance_m(options.swath_m)
    turn = part.sweep.frame
    paths = part.paths
    alone = options.lanes_alone_count
    # a copter may turn over the shore, a boat turns where there is water
    limits = None if options.vehicle == "copter" else part.region_m
    for _ in range(MAX_EXPORT_ROUNDS):
        paths = repair(paths, part.uncovered, turn, part.harbour, time, options.swath_m, alone)
        turned = [with_turnarounds(p, options.turnaround_m, limits) for p in paths]
        routes = [export_route(number_lanes(p), frame, tolerance) for p in turned]
        legs = fleet_legs([r.path for r in routes], turn, lanes_alone=alone)
        pieces = part.uncovered.remainder(legs)
        if not pieces_to_repair(pieces, options.swath_m, part.region_m.area, final=True):
            break
    else:
        worst = max(p.area for p in pieces)
        raise PlanningError(f"{worst:.2f} m² stay uncovered: choose another --angle or --swath")
    by_survey = part.uncovered.remainder(
        fleet_legs([r.path for r in routes], turn, lanes_alone=True)
    )
    return routes, _Coverage(
        covered_m2=part.region_m.area - total_area(pieces),
        covered_by_survey_m2=part.region_m.area - total_area(by_survey),
        largest_missed_m2=max((p.area for p in pieces), default=0.0),
    )


def _covered_beyond(
    water: shapely.MultiPolygon,
    parts: Sequence[PartPlan],
    paths: Sequence[CoveragePath],
    options: PlanOptions,
) -> float:
    """Return the area, m², that is covered outside the planned regions: the clearance strip."""
    rest = shapely.difference(water, shapely.union_all([p.region_m for p in parts]))
    if rest.area < 1e-6 * water.area:
        return 0.0
    sweep = parts[0].sweep
    uncovered = Uncovered(sweep.frame.turn(rest), sweep.column_pitch_m, options.swath_m / 2)
    legs = fleet_legs(paths, sweep.frame, lanes_alone=options.lanes_alone_count)
    return float(rest.area) - total_area(uncovered.remainder(legs))


def _swing_notes(paths: Sequence[CoveragePath], options: PlanOptions, time: TimeModel) -> list[str]:
    """Say how wide the vehicles swing at corners, where the clearance leaves less than that."""
    if options.vehicle == "copter":
        return []
    swing = max((time.swing_m(p.points_m, p.kind) for p in paths), default=0.0)
    if swing <= options.clearance_m:
        return []
    how = f"{options.steering} at {time.top_speed_m_s:g} m/s, WP_RADIUS {options.wp_radius_m:g}"
    note = (
        f"turns swing up to {swing:.1f} m off the planned way ({how}); --clearance is "
        f"{options.clearance_m:g} m: keep {math.ceil(swing)} m where the shore is hard"
    )
    return [note]


def _robot_row(
    robot: int, built: BuiltMission, home_lonlat: FloatArray, time: TimeModel
) -> RobotReport:
    path = built.path
    length = np.hypot(*np.diff(path.points_m, axis=0).T)
    survey = path.kind == LegKind.SURVEY
    return RobotReport(
        robot=robot,
        start_lonlat=(float(home_lonlat[0]), float(home_lonlat[1])),
        length_m=float(length.sum()),
        survey_m=float(length[survey].sum()),
        transit_m=float(length[~survey].sum()),
        duration_s=time.duration_s(path.points_m, path.kind),
        items=len(built.mission.items),
        lanes=int(path.lane.max(initial=0)),
        fence_points=sum(len(p.points_e7) for p in built.mission.fence),
        fence_land_m2=built.fence_land_m2,
    )


def versions() -> dict[str, str]:
    """Return the versions that a plan's numbers depend on."""
    out = {"mrmission": mrmission.__version__, "python": platform.python_version()}
    for name in ("numpy", "shapely", "pyproj", "numba", "rustworkx"):
        out[name] = metadata.version(name)
    out["geos"] = shapely.geos_version_string
    return out

"""Routes -> missions, start times, and the report of the whole fleet."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import shapely

from mrmission.area.frame import LocalFrame
from mrmission.fleet import swath_note
from mrmission.mission.build import LAUNCH_RADIUS_M, Route, build_mission
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
    Mission,
    RobotReport,
    SurveyArea,
)
from mrmission.options import PlanOptions
from mrmission.stages.bounds import Bound, any_plan_bound, chosen_lanes_bound
from mrmission.stages.export import Coverage, covered_beyond_m2
from mrmission.stages.launch import launch, launch_notes, waiting
from mrmission.stages.lines import lanes_of, tie_report, with_lines
from mrmission.stages.part import PLANNERS
from mrmission.stages.rows import idle_notes, robot_row, sortie_notes, swing_notes, versions
from mrmission.stages.sortie_routes import joined, parted
from mrmission.stages.sorties import export_in_sorties
from mrmission.tour.coverage import total_area
from mrmission.tour.timing import TimeModel
from mrmission.tour.work import PartPlan


@dataclass(frozen=True, slots=True, kw_only=True)
class Survey:
    """What is the same for all parts of one plan.

    Attributes
    ----------
    area, frame, water_m
        What the user gave, the local frame, and the area in it.
    unreached_m
        Parts of the navigable region that no robot can reach.
    options
        What the user asked for.
    times
        How long each robot takes, robot 1 first.
    assumed
        Options that the user did not give, by name.
    """

    area: SurveyArea
    frame: LocalFrame
    water_m: shapely.MultiPolygon
    unreached_m: tuple[shapely.Polygon, ...]
    options: PlanOptions
    times: tuple[TimeModel, ...]
    assumed: Mapping[str, Any]


@dataclass(frozen=True, slots=True, kw_only=True)
class _Work:
    """What every robot of the fleet does, by its number; trips by robot and sortie."""

    missions: dict[tuple[int, int], Mission]
    rows: dict[int, RobotReport]
    paths: dict[tuple[int, int], CoveragePath]
    straight_ways: dict[int, StraightWays]
    home_m: dict[int, np.ndarray]


def finish(survey: Survey, parts: Sequence[PartPlan], notes: list[str]) -> FleetPlan:
    """Return the fleet plan: missions, start times and the report; notes are added to `notes`.

    Raises
    ------
    PlanningError
        When something stays uncovered, or a fence cannot hold a route.
    """
    work = _Work(missions={}, rows={}, paths={}, straight_ways={}, home_m={})
    exported = [
        export_in_sorties(part, survey.frame, PLANNERS.get(part.tours.method)) for part in parts
    ]
    coverage = [covered for _, _, covered in exported]
    notes.extend(note for c in coverage for note in c.notes)
    trips: dict[int, list[Route]] = {}
    for in_trips, ways, _ in exported:
        for robot, route in zip(in_trips.work.robots, ways, strict=True):
            trips.setdefault(robot, []).append(route)
    routes = {robot: joined(mine) for robot, mine in trips.items()}
    for part in parts:
        work.home_m.update(zip(part.work.robots, part.work.homes_m, strict=True))
    routes, delays_s, separation = launch(
        routes, work.home_m, survey.times, survey.options, survey.frame
    )
    for robot in sorted(routes):
        turned = robot in separation.turned
        mine = parted(routes[robot], [len(trip.lonlat) - 1 for trip in trips[robot]], turned)
        _build(robot, mine, delays_s[robot], survey, work, notes)
        if survey.options.vehicle != "copter":
            whole, home = routes[robot].path.points_m, work.home_m[robot]
            work.straight_ways[robot] = straight_ways(whole, home, survey.water_m)
    if survey.options.wait_in_mission:
        for robot, delay_s in delays_s.items():
            work.missions[robot, 1] = waiting(work.missions[robot, 1], delay_s)
    _enter_lines(parts, survey, work)
    failsafe = failsafe_report(work.straight_ways, survey.frame)
    notes.extend(failsafe_notes(failsafe))
    notes.extend(launch_notes(work.rows, separation, survey.options.wait_in_mission))
    notes.extend(swing_notes({r: w.path for r, w in routes.items()}, survey.options, survey.times))
    busy = next((m for _, m in sorted(work.missions.items()) if m.items), None)
    if busy is not None:
        notes.extend(vehicle_notes(busy, survey.options, LAUNCH_RADIUS_M))
    rows = tuple(work.rows[r] for r in sorted(work.rows))
    largest = max(parts, key=lambda p: p.work.region_m.area)
    notes.extend(idle_notes(rows, largest.tours.method))
    notes.extend(sortie_notes(rows, survey.options))
    swaths = swath_note(survey.options.fleet)
    if swaths is not None:
        notes.append(swaths)
    return FleetPlan(
        area=survey.area,
        water_m=survey.water_m,
        region_m=shapely.MultiPolygon([p.work.region_m for p in parts]),
        homes_m=np.array([work.home_m[r] for r in sorted(work.home_m)]),
        paths=tuple(work.paths[r] for r in sorted(work.paths)),
        missions=tuple(work.missions[r] for r in sorted(work.missions)),
        report=_report(
            survey,
            parts,
            coverage,
            chosen_lanes_bound([in_trips for in_trips, _, _ in exported]),
            work,
            notes,
            failsafe=failsafe,
            separation=separation,
        ),
    )


def _build(
    robot: int,
    routes: Sequence[Route],
    delay_s: float,
    survey: Survey,
    work: _Work,
    notes: list[str],
) -> None:
    """Enter a robot's missions, one for each of its routes, and its row into `work`."""
    home, options = work.home_m[robot], survey.options.of_robot(robot)
    done = []
    for sortie, route in enumerate(routes, start=1):
        built = build_mission(route, robot, home, survey.water_m, survey.frame, options, sortie)
        notes.extend(built.notes)
        work.missions[robot, sortie] = built.mission
        work.paths[robot, sortie] = replace(route.path, robot=robot, sortie=sortie)
        done.append(built)
    home_lonlat = survey.frame.to_lonlat(home[None])[0]
    row = robot_row(robot, done, home_lonlat, survey.times[robot - 1], options)
    name = survey.options.fleet[robot - 1].name if survey.options.fleet else ""
    work.rows[robot] = replace(row, start_delay_s=delay_s, name=name)


def _enter_lines(parts: Sequence[PartPlan], survey: Survey, work: _Work) -> None:
    """Enter into missions and rows which lines they sweep."""
    missions = [work.missions[r] for r in sorted(work.missions)]
    for mission in with_lines(missions, parts, survey.frame):
        work.missions[mission.robot, mission.sortie] = mission
    for robot, row in work.rows.items():
        trips = [
            replace(trip, lanes=lanes_of(work.missions[robot, trip.sortie])) for trip in row.sorties
        ]
        lanes = sum(trip.lanes for trip in trips)
        work.rows[robot] = replace(row, lanes=lanes, sorties=tuple(trips))


def _report(
    survey: Survey,
    parts: Sequence[PartPlan],
    coverage: Sequence[Coverage],
    of_lanes: Bound | None,
    work: _Work,
    notes: Sequence[str],
    **more: Any,
) -> FleetReport:
    """Return every number of the plan; `more` are fields of the report that are made elsewhere."""
    options = survey.options
    robots = tuple(work.rows[r] for r in sorted(work.rows))
    makespan = max(r.duration_s + r.start_delay_s for r in robots)
    bound = any_plan_bound(parts, coverage)
    if of_lanes is not None:  # what holds for any plan holds for one of these lanes
        of_lanes = max(of_lanes, bound)
    planned = total_area([p.work.region_m for p in parts])
    covered = sum(c.covered_m2 for c in coverage)
    beyond = covered_beyond_m2(survey.water_m, parts, list(work.paths.values()), options)
    largest = max(parts, key=lambda p: p.work.region_m.area)
    unreached = total_area(survey.unreached_m)
    return FleetReport(
        robots=robots,
        method=largest.tours.method,
        makespan_s=makespan,
        lower_bound_s=bound.seconds,
        lower_bound_name=bound.name,
        gap=bound.gap(makespan),
        lanes_bound_s=of_lanes.seconds if of_lanes else None,
        lanes_bound_name=of_lanes.name if of_lanes else "",
        lanes_gap=of_lanes.gap(makespan) if of_lanes else None,
        # a robot may go out for a place that is swept in passing, and for no line
        utilization=sum(r.length_m > 0 for r in robots) / len(robots),
        coverage=covered / planned,
        coverage_survey_legs=sum(c.covered_by_survey_m2 for c in coverage) / planned,
        coverage_of_area=(covered + beyond) / survey.water_m.area,
        largest_missed_m2=max(c.largest_missed_m2 for c in coverage),
        area_m2=survey.water_m.area,
        navigable_m2=planned + unreached,
        unreached_m2=unreached,
        unreached_parts_m2=tuple(p.area for p in survey.unreached_m),
        angle_deg=largest.work.sweep.frame.bearing_deg,
        lane_spacing_m=max(p.work.sweep.column_pitch_m for p in parts),
        frame=survey.frame.proj,
        frame_error_m=survey.frame.error_m(survey.water_m),
        options=options.as_dict(),
        assumed=survey.assumed,
        notes=tuple(notes),
        versions=versions(),
        seed=options.seed,
        lines=tuple(line for r in sorted(work.missions) for line in work.missions[r].lines),
        tie_lines=tie_report(parts),
        **more,
    )

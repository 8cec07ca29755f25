"""Routes -> missions, start times, and the report of the whole fleet."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import shapely

from mrmission.area.frame import LocalFrame
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
from mrmission.partition.bound import area_bound_s
from mrmission.stages.export import Coverage, covered_beyond_m2, export_part
from mrmission.stages.launch import launch, launch_notes
from mrmission.stages.lines import lanes_of, tie_report, with_lines
from mrmission.stages.rows import capacity_notes, idle_notes, robot_row, swing_notes, versions
from mrmission.tour.repair import total_area
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
    """What every robot of the fleet does, by its number."""

    missions: dict[int, Mission]
    rows: dict[int, RobotReport]
    paths: dict[int, CoveragePath]
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
    exported = [export_part(part, survey.frame) for part in parts]
    coverage = [covered for _, covered in exported]
    notes.extend(note for c in coverage for note in c.notes)
    routes = {
        robot: route
        for part, (ways, _) in zip(parts, exported, strict=True)
        for robot, route in zip(part.work.robots, ways, strict=True)
    }
    for part in parts:
        work.home_m.update(zip(part.work.robots, part.work.homes_m, strict=True))
    routes, delays_s, separation = launch(
        routes, work.home_m, survey.times, survey.options, survey.frame
    )
    for robot in sorted(routes):
        _build(robot, routes[robot], delays_s[robot], survey, work, notes)
    _enter_lines(parts, survey, work)
    failsafe = failsafe_report(work.straight_ways, survey.frame)
    notes.extend(failsafe_notes(failsafe))
    notes.extend(launch_notes(work.rows, separation))
    notes.extend(swing_notes(work.paths, survey.options, survey.times))
    busy = next((m for _, m in sorted(work.missions.items()) if m.items), None)
    if busy is not None:
        notes.extend(vehicle_notes(busy, survey.options, LAUNCH_RADIUS_M))
    rows = tuple(work.rows[r] for r in sorted(work.rows))
    largest = max(parts, key=lambda p: p.work.region_m.area)
    notes.extend(idle_notes(rows, largest.tours.method))
    notes.extend(capacity_notes(rows, survey.options))
    return FleetPlan(
        area=survey.area,
        water_m=survey.water_m,
        region_m=shapely.MultiPolygon([p.work.region_m for p in parts]),
        homes_m=np.array([work.home_m[r] for r in sorted(work.home_m)]),
        paths=tuple(work.paths[r] for r in sorted(work.paths)),
        missions=tuple(work.missions[r] for r in sorted(work.missions)),
        report=_report(
            survey, parts, coverage, work, notes, failsafe=failsafe, separation=separation
        ),
    )


def _build(
    robot: int, route: Route, delay_s: float, survey: Survey, work: _Work, notes: list[str]
) -> None:
    """Enter a robot's mission and row into `work`."""
    home = work.home_m[robot]
    built = build_mission(route, robot, home, survey.water_m, survey.frame, survey.options)
    notes.extend(built.notes)
    work.missions[robot] = built.mission
    work.paths[robot] = replace(route.path, robot=robot)
    if survey.options.vehicle != "copter":
        ways = straight_ways(built.path.points_m, home, survey.water_m)
        work.straight_ways[robot] = ways
    home_lonlat = survey.frame.to_lonlat(home[None])[0]
    row = robot_row(robot, built, home_lonlat, survey.times[robot - 1])
    work.rows[robot] = replace(row, start_delay_s=delay_s)


def _enter_lines(parts: Sequence[PartPlan], survey: Survey, work: _Work) -> None:
    """Enter into missions and rows which lines they sweep."""
    missions = [work.missions[r] for r in sorted(work.missions)]
    for mission in with_lines(missions, parts, survey.frame):
        work.missions[mission.robot] = mission
        row = work.rows[mission.robot]
        work.rows[mission.robot] = replace(row, lanes=lanes_of(mission))


def _report(
    survey: Survey,
    parts: Sequence[PartPlan],
    coverage: Sequence[Coverage],
    work: _Work,
    notes: Sequence[str],
    **more: Any,
) -> FleetReport:
    """Return every number of the plan; `more` are fields of the report that are made elsewhere."""
    options = survey.options
    robots = tuple(work.rows[r] for r in sorted(work.rows))
    makespan = max(r.duration_s + r.start_delay_s for r in robots)
    bound = max(_area_bound_s(p, c) for p, c in zip(parts, coverage, strict=True))
    planned = total_area([p.work.region_m for p in parts])
    covered = sum(c.covered_m2 for c in coverage)
    beyond = covered_beyond_m2(survey.water_m, parts, list(work.paths.values()), options)
    largest = max(parts, key=lambda p: p.work.region_m.area)
    unreached = total_area(survey.unreached_m)
    return FleetReport(
        robots=robots,
        method=largest.tours.method,
        makespan_s=makespan,
        lower_bound_s=bound,
        lower_bound_name="area bound",
        gap=makespan / bound - 1 if bound > 0 else 0.0,
        utilization=sum(r.lanes > 0 for r in robots) / len(robots),
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


def _area_bound_s(part: PartPlan, coverage: Coverage) -> float:
    """Return the area bound of one part for what its robots cover."""
    fastest = max(t.top_speed_m_s for t in part.work.times)
    return area_bound_s(
        coverage.covered_m2, part.work.options.swath_m, len(part.work.robots), fastest
    )

"""One connected part of the water: berths, bearing, lines to sweep, and who plans its tours."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import replace

import numpy as np
import shapely

from mrmission.area.berths import berths
from mrmission.area.legs import leg_tolerance_m
from mrmission.minmax.angle import BearingChoice, WorkAt, choose_bearing
from mrmission.minmax.planner import lane_tours, prepare
from mrmission.minmax.starts import best_start
from mrmission.mission.build import LAUNCH_RADIUS_M
from mrmission.model import FloatArray
from mrmission.options import PlanOptions
from mrmission.routing.harbour import Harbour
from mrmission.stages.cells import cell_tours
from mrmission.stages.lines import lines_to_sweep, not_counted
from mrmission.tour.coverage import Uncovered
from mrmission.tour.fairway import Columns, fairway_of
from mrmission.tour.sweep import best_bearing_deg, hair_m, sweep_region, widest_spacing_m
from mrmission.tour.timing import TimeModel
from mrmission.tour.work import PartPlan, PartTours, PartWork

PLANNERS: Mapping[str, Callable[[PartWork], PartTours]] = {"minmax": lane_tours}
"""Planners that can plan anew for trips, by method."""


def plan_part(
    part: shapely.Polygon,
    water: shapely.MultiPolygon,
    starts_m: FloatArray,
    robots: tuple[int, ...],
    options: PlanOptions,
    times: tuple[TimeModel, ...],
    notes: list[str],
) -> PartPlan:
    """Plan one connected part of the water.

    Parameters
    ----------
    part
        The part of the navigable region.
    water
        The whole survey area, local frame.
    starts_m
        (n, 2) one start for all, or one for each.
    robots
        Numbers of the part's robots.
    options
        What the user asked for.
    times
        How long each robot of the whole fleet takes, robot 1 first.
    notes
        What there is to say is appended.
    """
    tolerance_m = leg_tolerance_m(options.swath_m)
    spacing = widest_spacing_m(options.swath_m, options.overlap, tolerance_m)
    homes = _homes(part, water, starts_m, robots, options, notes)
    own_times = tuple(times[r - 1] for r in robots)
    harbour = Harbour(part, homes)

    def work_at(bearing_deg: float, *, fairway: bool = False) -> PartWork:
        sweep = sweep_region(part, bearing_deg, spacing)
        way = fairway_of(Columns.of(sweep), homes.mean(axis=0), len(robots)) if fairway else None
        lines = lines_to_sweep(sweep, part, options, way)
        return PartWork(
            region_m=part,
            robots=robots,
            homes_m=homes,
            sweep=sweep,
            lines=lines,
            harbour=harbour,
            uncovered=Uncovered(
                sweep.region,
                sweep.column_pitch_m,
                options.swath_m / 2,
                not_counted(lines, sweep),
                hair_m(options.swath_m, sweep.column_pitch_m, tolerance_m),
            ),
            times=own_times,
            options=options,
        )

    choice = _lay_of_lanes(part, harbour, spacing, options, own_times[0], work_at)
    left = replace(options, time_budget_s=choice.budget_left_s)
    if options.method != "minmax":
        work = replace(work_at(choice.bearing_deg), options=left)
        return PartPlan(work=work, tours=cell_tours(work))
    lays = choice.prepared or (prepare(work_at(choice.bearing_deg, fairway=choice.fairway)),)
    best = best_start(lays, choice.budget_left_s, options.seed)
    return PartPlan(work=replace(best.ready.work, options=left), tours=best.planned)


def _lay_of_lanes(
    part: shapely.Polygon,
    harbour: Harbour,
    spacing_m: float,
    options: PlanOptions,
    time: TimeModel,
    work_at: WorkAt,
) -> BearingChoice:
    """Return the bearing of the lanes, and whether there is a fairway among them."""
    homes = harbour.berths_m
    apart_m = float(np.hypot(*(homes - homes.mean(axis=0)).T).max())
    # robots that start farther from each other than a fairway is wide have no use for one
    fairway = options.may_have_fairway and apart_m <= len(homes) * spacing_m
    if options.method != "minmax" or (options.bearing_deg is not None and not fairway):
        bearing_deg = options.bearing_deg
        if bearing_deg is None:
            turn_s = time.lane_turn_s(spacing_m)
            bearing_deg = best_bearing_deg(part, spacing_m, options.survey_speed_m_s, turn_s)
        return BearingChoice(bearing_deg=bearing_deg, budget_left_s=options.time_budget_s)
    return choose_bearing(
        part,
        harbour,
        harbour.berths_m,
        time,
        spacing_m,
        time_budget_s=options.time_budget_s,
        seed=options.seed,
        work_at=work_at,
        asked_deg=options.bearing_deg,
        fairway=fairway,
    )


def _homes(
    part: shapely.Polygon,
    water: shapely.MultiPolygon,
    starts_m: FloatArray,
    robots: tuple[int, ...],
    options: PlanOptions,
    notes: list[str],
) -> FloatArray:
    """Return (robots, 2) where each robot starts: at its own start, or side by side at one."""
    # A robot's own start is where it starts, also where it is the only one of its part.
    if len(starts_m) == 1 and len(options.starts_lonlat) != options.robots:
        found = berths(
            water, part, starts_m[0], len(robots),
            spacing_m=options.berth_spacing_m, launch_radius_m=LAUNCH_RADIUS_M,
        )  # fmt: skip
        notes.extend(found.notes)
        return found.points_m
    gap = np.hypot(*(starts_m[:, None] - starts_m[None]).transpose(2, 0, 1))
    near = np.argwhere(np.triu(gap < options.berth_spacing_m, 1))
    if len(near):
        i, j = near[0]
        notes.append(
            f"the starts of robots {robots[i]} and {robots[j]} are {gap[i, j]:.1f} m apart, "
            f"less than {options.berth_spacing_m:g} m: launch one after the other"
        )
    return starts_m

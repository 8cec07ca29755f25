"""The rows, notes and versions of a report."""

from __future__ import annotations

import math
import platform
from collections.abc import Mapping, Sequence
from importlib import metadata

import numpy as np
import shapely

import mrmission
from mrmission.mission.build import BuiltMission
from mrmission.model import CoveragePath, FloatArray, LegKind, RobotReport, SortieReport
from mrmission.options import PlanOptions
from mrmission.tour.timing import TimeModel


def robot_row(
    robot: int,
    built: Sequence[BuiltMission],
    home_lonlat: FloatArray,
    time: TimeModel,
    options: PlanOptions,
) -> RobotReport:
    """Return a robot's row of the table.

    Parameters
    ----------
    robot
        Its number.
    built
        Its missions, one for each trip.
    home_lonlat
        (2,) where it starts.
    time
        How long it takes.
    options
        As they are for this robot.
    """
    trips: list[SortieReport] = []
    start_s = 0.0
    for number, one in enumerate(built, start=1):
        trip = _sortie_row(number, one, time, options, start_s)
        start_s += trip.duration_s + options.swap_time_s
        trips.append(trip)
    return RobotReport(
        robot=robot,
        start_lonlat=(float(home_lonlat[0]), float(home_lonlat[1])),
        length_m=sum(trip.length_m for trip in trips),
        survey_m=sum(trip.survey_m for trip in trips),
        transit_m=sum(trip.transit_m for trip in trips),
        duration_s=trips[-1].start_s + trips[-1].duration_s,
        items=sum(trip.items for trip in trips),
        lanes=sum(trip.lanes for trip in trips),
        fence_points=max(trip.fence_points for trip in trips),
        fence_land_m2=max(trip.fence_land_m2 for trip in trips),
        sorties=tuple(trips),
    )


def _sortie_row(
    number: int, built: BuiltMission, time: TimeModel, options: PlanOptions, start_s: float
) -> SortieReport:
    path = built.path
    length = np.hypot(*np.diff(path.points_m, axis=0).T)
    survey = path.kind == LegKind.SURVEY
    duration_s = time.duration_s(path.points_m, path.kind)
    used: float | None = None
    if options.endurance_s is not None:
        used = duration_s / options.endurance_s
    elif options.endurance_m is not None:
        used = float(length.sum()) / options.endurance_m
    return SortieReport(
        sortie=number,
        length_m=float(length.sum()),
        survey_m=float(length[survey].sum()),
        transit_m=float(length[~survey].sum()),
        duration_s=duration_s,
        items=len(built.mission.items),
        lanes=int(path.lane.max(initial=0)),
        fence_points=sum(len(p.points_e7) for p in built.mission.fence),
        fence_land_m2=built.fence_land_m2,
        start_s=start_s,
        endurance_used=used,
    )


def sortie_notes(robots: Sequence[RobotReport], options: PlanOptions) -> list[str]:
    """Say who goes out more than once, and what is left when they come home."""
    several = [row for row in robots if len(row.sorties) > 1]
    if not several:
        return []
    trips = sum(len(row.sorties) for row in robots if row.lanes)
    most = max(len(row.sorties) for row in several)
    used = [t.endurance_used for r in robots for t in r.sorties if t.endurance_used is not None]
    kept = f", each home with {1 - max(used):.0%} of its endurance at the least" if used else ""
    who = f"{len(several)} of {len(robots)} robots go" if len(several) > 1 else "1 robot goes"
    note = f"{who} out more than once, up to {most} times: {trips} trips in all{kept}"
    swaps_s = {options.of_robot(row.robot).swap_time_s for row in several}
    if swaps_s == {0.0}:
        note += "; no time is counted between trips (--swap-time)"
    return [note]


def swing_notes(
    paths: Mapping[int, CoveragePath], options: PlanOptions, times: Sequence[TimeModel]
) -> list[str]:
    """Say how wide the vehicles swing at corners, where the clearance leaves less than that."""
    if options.vehicle == "copter":
        return []
    swings = {r: times[r - 1].swing_m(p.points_m, p.kind) for r, p in paths.items()}
    worst = max(swings, key=lambda r: swings[r])
    swing, speed = swings[worst], times[worst - 1].top_speed_m_s
    if swing <= options.clearance_m:
        return []
    how = f"{options.steering} at {speed:g} m/s, WP_RADIUS {options.wp_radius_m:g}"
    note = (
        f"turns swing up to {swing:.1f} m off the planned way ({how}); --clearance is "
        f"{options.clearance_m:g} m: keep {math.ceil(swing)} m where the shore is hard"
    )
    return [note]


def idle_notes(robots: Sequence[RobotReport], method: str) -> list[str]:
    """Say who has no work, and why."""
    idle = [str(r.robot) for r in robots if r.lanes == 0]
    if not idle:
        return []
    names = ", ".join(idle[:8]) + (" …" if len(idle) > 8 else "")
    why = "too few lanes" if method == "minmax" else "cells are not split further"
    return [
        (
            f"no work for {len(idle)} of {len(robots)} robots ({names}): {why}; "
            "their files are empty but valid"
        )
    ]


def versions() -> dict[str, str]:
    """Return the versions that a plan's numbers depend on."""
    out = {"mrmission": mrmission.__version__, "python": platform.python_version()}
    for name in ("numpy", "shapely", "pyproj", "numba", "rustworkx"):
        out[name] = metadata.version(name)
    out["geos"] = shapely.geos_version_string
    return out

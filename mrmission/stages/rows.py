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
from mrmission.model import CoveragePath, FloatArray, LegKind, RobotReport
from mrmission.options import PlanOptions
from mrmission.tour.timing import TimeModel


def robot_row(
    robot: int, built: BuiltMission, home_lonlat: FloatArray, time: TimeModel
) -> RobotReport:
    """Return a robot's row of the table."""
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


def capacity_notes(robots: Sequence[RobotReport], options: PlanOptions) -> list[str]:
    """Say which missions are longer than a vehicle holds."""
    most = max(robots, key=lambda r: r.items)
    if most.items <= options.limits.mission_items:
        return []
    return [
        (
            f"robot {most.robot} needs {most.items} mission items, a vehicle holds "
            f"{options.limits.mission_items}: use a wider --swath or more robots"
        )
    ]


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

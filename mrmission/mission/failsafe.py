"""What a vehicle does when something goes wrong is part of the plan: the straight way home.

Return to launch steers straight for home (or a rally point), over whatever lies between. A boat
breaches its fence, loses its radio or its battery anywhere on its way, so the question is: from
which share of the way does that line leave the water?
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
import shapely

from mrmission.mission.fence import Frame
from mrmission.mission.mavlink import wrap_lon_deg
from mrmission.model import FailsafeReport, FloatArray, StraightReturn

SAMPLES = 400
"""Places on a robot's way from which the way home is looked at."""
MEASURED = 12
"""Of those whose way home leaves the water, so many are measured for the longest stretch."""

SMART_RTL_BATCH_M = 100.0
POINTS_PER_CORNER = 1.75
"""Fitted to when SmartRTL ran out of points on short lanes, see docs/failsafes.md."""


@dataclass(frozen=True, slots=True, kw_only=True)
class StraightWays:
    """The straight ways home from places along a path.

    ``share`` of the path's length from which the way leaves the allowed polygon, the longest
    stretch outside, m, and the place on the path where it begins, ``[east_m, north_m]`` (None
    where every way stays inside). ``farthest_m`` is the place farthest from home.
    """

    share: float
    outside_m: float
    worst_m: tuple[float, float] | None
    farthest_m: float


def straight_ways(
    path_m: FloatArray, home_m: FloatArray, allowed: shapely.Geometry
) -> StraightWays:
    """Look along a path at the straight ways home.

    Parameters
    ----------
    path_m : (n, 2) array
        The way that is sailed, m.
    home_m : (2,) array
        Where the vehicle returns to, m.
    allowed
        What the way home must not leave: the water, or the fence. Touching its edge is allowed.

    Returns
    -------
    StraightWays
        From `SAMPLES` places, evenly spaced along the path: exact at each of them.

    Examples
    --------
    >>> lake = shapely.box(0, 0, 100, 100) - shapely.box(40, 0, 60, 20)
    >>> ways = straight_ways(np.array([[90.0, 10], [90, 90]]), np.array([10.0, 10]), lake)
    >>> round(ways.share, 2), round(ways.outside_m)
    (0.33, 20)
    """
    path = np.asarray(path_m, dtype=float)
    home = np.asarray(home_m, dtype=float)
    farthest = float(np.hypot(*(path - home).T).max(initial=0.0))
    steps = np.hypot(*np.diff(path, axis=0).T)
    at_m = np.concatenate(([0.0], np.cumsum(steps)))
    if len(path) < 2 or at_m[-1] == 0.0:
        return StraightWays(share=0.0, outside_m=0.0, worst_m=None, farthest_m=farthest)
    # the middles of equal pieces, so that each stands for as much of the way
    where_m = (np.arange(SAMPLES) + 0.5) * (at_m[-1] / SAMPLES)
    places = np.column_stack([np.interp(where_m, at_m, path[:, axis]) for axis in (0, 1)])
    ways = shapely.linestrings(np.stack([places, np.broadcast_to(home, places.shape)], axis=1))
    shapely.prepare(allowed)
    leaving = np.flatnonzero(~shapely.covers(allowed, ways))
    if len(leaving) == 0:
        return StraightWays(share=0.0, outside_m=0.0, worst_m=None, farthest_m=farthest)
    measured = leaving[np.linspace(0, len(leaving) - 1, min(MEASURED, len(leaving))).astype(int)]
    outside = shapely.length(shapely.difference(ways[measured], allowed))
    worst = int(np.argmax(outside))
    east, north = places[measured[worst]].tolist()
    return StraightWays(
        share=len(leaving) / SAMPLES,
        outside_m=float(outside[worst]),
        worst_m=(east, north),
        farthest_m=farthest,
    )


def recommended_action(share: float) -> int:
    """Return the FENCE_ACTION for a vehicle on water or ground, from the share of bad ways home.

    Where every straight way home stays in the water, the vehicle may come home (1). Elsewhere it
    follows its own track back, and stops where it cannot (4): never 3, which falls back on the
    straight way.

    Examples
    --------
    >>> recommended_action(0.0), recommended_action(0.02)
    (1, 4)
    """
    return 4 if share > 0 else 1


def smart_rtl_points(path_m: FloatArray) -> int:
    """Return about how many points SmartRTL takes to remember a way.

    It drops a point every 2 m (SRTL_ACCURACY) and thins them out, 50 at a time, to what lies more
    than half of that beside the straight line: so one stays in every 100 m at least, and a turn
    takes a few.

    Parameters
    ----------
    path_m : (n, 2) array
        The way that is sailed, m.
    """
    path = np.asarray(path_m, dtype=float)
    if len(path) < 2:
        return len(path)
    line = shapely.LineString(path)
    corners = len(shapely.get_coordinates(line.simplify(1.0))) - 2
    return 2 + round(POINTS_PER_CORNER * corners + line.length / SMART_RTL_BATCH_M)


def failsafe_report(ways: Mapping[int, StraightWays], frame: Frame) -> FailsafeReport:
    """Return the report's section on failsafes.

    Parameters
    ----------
    ways
        Robot to its ways home over the water.
    frame
        Of the ways.
    """

    def row(robot: int, way: StraightWays) -> StraightReturn:
        worst = None
        if way.worst_m is not None:
            lon, lat = frame.to_lonlat(np.array([way.worst_m]))[0].tolist()
            worst = (wrap_lon_deg(lon), lat)
        return StraightReturn(
            robot=robot,
            share_over_land=way.share,
            longest_over_land_m=way.outside_m,
            worst_lonlat=worst,
            farthest_m=way.farthest_m,
            fence_action=recommended_action(way.share),
        )

    return FailsafeReport(straight_returns=tuple(row(r, way) for r, way in sorted(ways.items())))


def failsafe_notes(report: FailsafeReport) -> tuple[str, ...]:
    """Return what a person must know about straight returns: one line, none where all is well."""
    bad = [row for row in report.straight_returns if row.share_over_land > 0]
    if not bad:
        return ()
    worst = max(bad, key=lambda row: (row.longest_over_land_m, -row.robot))
    names = _robots([row.robot for row in bad])
    low = min(row.share_over_land for row in bad)
    high = max(row.share_over_land for row in bad)
    share = f"{high:.0%}" if f"{low:.0%}" == f"{high:.0%}" else f"{low:.0%} to {high:.0%}"
    where = ""
    if worst.worst_lonlat is not None:
        lon, lat = worst.worst_lonlat
        where = (
            f", at worst {worst.longest_over_land_m:,.0f} m of it (robot {worst.robot}, from "
            f"{lat:.5f},{lon:.5f})"
        )
    note = (
        f"a straight return home crosses land from {share} of the way of {names}{where}: set "
        "FENCE_ACTION and the failsafe actions to 4 (SmartRTL or hold), not to 1 or 3; "
        "`mrmission preflight` checks it"
    )
    return (note,)


def _robots(numbers: Sequence[int]) -> str:
    if len(numbers) == 1:
        return f"robot {numbers[0]}"
    shown = ", ".join(str(n) for n in numbers[:6])
    return f"robots {shown}" + (f" and {len(numbers) - 6} more" if len(numbers) > 6 else "")

"""The reach bound: work far from the start costs the way there and back, for any plan whatever.

Proof. Let D(p) be the length of the shortest way from the nearest home to a point p, along which D
grows no faster than the way's length. A tour that begins and ends at a home and gets to D >= r
spends at least 2r below r, so at most L - 2r at or beyond it, L being its length. That part of it
consists of pieces that begin and end at D = r. The parallel body of a piece of length l at swath/2
has an area of at most l·swath + π·swath²/4, and the whole disc of π·swath²/4 about its first point
is in it. Let R(x) be the least D of all points from which x is covered, those within swath/2 of x
in the region. For every x of that disc R(x) <= r. So a piece covers at most l·swath of what has
R(x) > r, the tour at most (L - 2r)·swath, and k tours no longer than L, with A(r) the area where
R(x) > r, need k·(L - 2r)·swath >= A(r): the bound is the largest 2r + A(r)/(k·swath) over r. ∎

R is not computed but bounded from below: let D be taken in the region widened by swath/2 (and a
little). From x straight to any p that covers it is in there, so R(x) >= D(x) - swath/2; and ways in
a larger water are not longer. The same argument bounds D over a cell of a grid by D at its middle.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import shapely

from mrmission.model import FloatArray
from mrmission.routing.water import WaterRouter

CELLS = 2000
"""Cells of the grid, about; each loses half its diagonal."""
MAX_SOURCES = 6
_QUAD_SEGS = 4
_CIRCUMSCRIBED = 1.0 / math.cos(math.pi / (4 * _QUAD_SEGS))
"""By how much a buffer of chords must be wider to hold the round one."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Rover:
    """What bounds how far one robot of a mixed fleet gets.

    Attributes
    ----------
    swath_m, top_speed_m_s
        Its footprint and its fastest speed.
    trip_m
        It is home after so many metres at the latest, and goes out again; may be infinite.
    swap_s
        At least so long between two trips.
    """

    swath_m: float
    top_speed_m_s: float
    trip_m: float = math.inf
    swap_s: float = 0.0


def fleet_reach_bound_s(
    region_m: shapely.Polygon,
    homes_m: FloatArray,
    robots: Sequence[Rover],
    missed_m2: float = 0.0,
) -> float:
    """Return a time after which the last of robots that differ is home at the earliest, seconds.

    Proof. As in the module, with R the least D of all points within half the *widest* swath of x:
    then R(x) is no larger than for a narrower one, and a piece of a robot of swath w beyond r
    covers at most l·w of what has R(x) > r. A trip of length l of that robot covers at most
    max(0, l - 2r)·w of it. In a time T a robot of speed v makes trips of lengths l_1, l_2, … of at
    most `trip_m` each, with Σ l_j/v and the swaps between them at most T. The sum of
    max(0, l_j - 2r) is convex in the lengths, so it is largest where all of them but one are 0 or
    `trip_m`: as many full trips as T has room for, and one with what is left. Call that sum, times
    w, the robot's c(T, r): it grows with T. No T will do for which Σ c(T, r) < A(r) for some r. ∎

    Parameters
    ----------
    region_m
        What is swept, and where boats go.
    homes_m : (homes, 2) array
        Where tours begin and end, each at one of them, in the region.
    robots
        What bounds each robot.
    missed_m2
        Area of the region that may stay uncovered.

    Returns
    -------
    float
        Infinite where no number of trips gets far enough.
    """
    reach_m, area_m2 = _reach_of(region_m, homes_m, max(robot.swath_m for robot in robots))
    order = np.argsort(reach_m, kind="stable")[::-1]
    r = reach_m[order]
    beyond_m2 = np.cumsum(area_m2[order]) - missed_m2
    counts = (r > 0) & (beyond_m2 > 0)
    if not counts.any():
        return 0.0
    r, beyond_m2 = r[counts], beyond_m2[counts]
    if all(robot.trip_m <= 2 * r.max() for robot in robots):
        return math.inf

    def holds(time_s: float) -> bool:
        room_m2 = np.zeros(len(r))
        for robot in robots:
            room_m2 += robot.swath_m * _beyond_m(time_s, r, robot)
        return bool(np.all(room_m2 >= beyond_m2))

    high_s = 1.0
    while not holds(high_s):
        high_s *= 2.0
    low_s = 0.0
    for _ in range(60):
        middle_s = (low_s + high_s) / 2
        low_s, high_s = (low_s, middle_s) if holds(middle_s) else (middle_s, high_s)
    return low_s


def _beyond_m(time_s: float, r_m: FloatArray, robot: Rover) -> FloatArray:
    """Return the longest way beyond each of (n,) distances that a robot goes in a time."""
    if math.isinf(robot.trip_m):
        return np.maximum(0.0, time_s * robot.top_speed_m_s - 2 * r_m)
    each_s = robot.trip_m / robot.top_speed_m_s + robot.swap_s
    full = math.floor((time_s + robot.swap_s) / each_s)
    left_m = max(0.0, time_s - full * each_s) * robot.top_speed_m_s
    return full * np.maximum(0.0, robot.trip_m - 2 * r_m) + np.maximum(0.0, left_m - 2 * r_m)


def _reach_of(
    region_m: shapely.Polygon, homes_m: FloatArray, swath_m: float
) -> tuple[FloatArray, FloatArray]:
    """Return (n,) a lower bound of R in each of the region's cells, and their areas."""
    centre_m, area_m2, half_diagonal_m = _cells(region_m)
    slack_m = swath_m / 4
    # simplified within slack_m, so that widening by it holds the region again
    widened = shapely.buffer(
        shapely.simplify(region_m, slack_m),
        (swath_m / 2 + half_diagonal_m + slack_m) * _CIRCUMSCRIBED,
        quad_segs=_QUAD_SEGS,
    )
    source, radius_m = _sources(homes_m, max(half_diagonal_m, swath_m / 2))
    router = WaterRouter(widened)
    reach = router.distances(homes_m[source], centre_m).min(axis=0)
    reach -= half_diagonal_m + swath_m / 2 + radius_m
    return reach, area_m2


def _cells(region_m: shapely.Polygon) -> tuple[FloatArray, FloatArray, float]:
    """Return middles (n, 2) and areas (n,) of the region in square cells, and half a diagonal."""
    x0, y0, x1, y1 = region_m.bounds
    pitch = math.sqrt(region_m.area / CELLS)
    # a region much thinner than its box has few cells in it, and a long one many columns
    middles, areas = [], []
    for i in range(math.ceil((x1 - x0) / pitch)):
        left = x0 + i * pitch
        column = shapely.clip_by_rect(region_m, left, y0, left + pitch, y1)
        if column.is_empty:
            continue
        _, low, _, high = column.bounds
        for j in range(math.floor((low - y0) / pitch), math.ceil((high - y0) / pitch)):
            foot = y0 + j * pitch
            area = shapely.clip_by_rect(column, left, foot, left + pitch, foot + pitch).area
            if area > 0:
                middles.append((left + pitch / 2, foot + pitch / 2))
                areas.append(area)
    return np.array(middles), np.array(areas), pitch * math.sqrt(0.5)


def _sources(homes_m: FloatArray, radius_m: float) -> tuple[list[int], float]:
    """Return homes such that every other lies near one of them, and how near at worst."""
    chosen = [0]
    gap = np.hypot(*(homes_m - homes_m[0]).T)
    while gap.max() > radius_m and len(chosen) < MAX_SOURCES:
        chosen.append(int(np.argmax(gap)))
        gap = np.minimum(gap, np.hypot(*(homes_m - homes_m[chosen[-1]]).T))
    return chosen, float(gap.max())

"""The bound for chosen lines: what the longest tour takes at least if each is swept in one go.

Few lines are shared out in every way (:mod:`.few_lines`). Of more it is the greatest of what the
work, the farthest line, prices (:mod:`.prices`) and arms (:mod:`.arms`) say. The proofs are in
``docs/bounds.md``.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from mrmission.minmax.bounds.arms import arms_makespan
from mrmission.minmax.bounds.few_lines import few_lines_makespan
from mrmission.minmax.bounds.parts import NEAR, Task, near_ends, near_legs
from mrmission.minmax.bounds.prices import MANY, SHARES, prices_makespan
from mrmission.minmax.bounds.prices_kernels import depths
from mrmission.model import FloatArray, IntArray

MOST_LINES = 6000
"""More lines are bounded by the work and the farthest line alone: a proof over all pairs of their
ends takes longer than the plan."""
FEW_TOURS = 4
"""So few tours are bounded by arms alone: prices were the better bound for 13 of 286 plans of
random maps, by less than 0.7 %, and for none of 30 of lakes."""
MARGIN = 1e-9
"""Part by which a bound is lowered for the rounding of sums."""


@dataclass(frozen=True, slots=True, kw_only=True)
class LanesBound:
    """What the longest tour over chosen lines takes at least.

    Attributes
    ----------
    makespan_s
        Seconds.
    term
        What it comes from, in words: ``every order``, ``work shared out``, ``connection``,
        ``reach and connection``, ``arms and connection`` or ``farthest line``; of many lines some
        end with ``, as the crow flies``.
    """

    makespan_s: float
    term: str


def lanes_bound(
    *,
    line_s: FloatArray,
    end_s: FloatArray,
    home_s: FloatArray,
    sweep_scale: FloatArray | None = None,
    travel_scale: FloatArray | None = None,
    trip_s: FloatArray | None = None,
    swap_s: FloatArray | None = None,
) -> LanesBound:
    """Return a time that the longest tour takes at least if every line is swept in one go.

    Parameters
    ----------
    line_s : (n,) array
        The least seconds that sweeping each line takes.
    end_s : (2n, 2n) array
        The least seconds of going from one end to another; symmetric. Ends ``2 i`` and
        ``2 i + 1`` belong to line i. They need not be a metric.
    home_s : (robots, 2n) array
        The least seconds between each robot's home and the ends, its own.
    sweep_scale, travel_scale : (robots,) arrays
        What the seconds of lines, and between ends, are multiplied by for each robot; 1 when None.
    trip_s : (robots,) array
        How long each robot may be away from home, in its own seconds; as long as it likes when
        None.
    swap_s : (robots,) array
        What it spends between two trips; nothing when None.

    Returns
    -------
    LanesBound
        It holds for tours that leave robots without work, and for robots that come home in between,
        too.
    """
    ends = np.ascontiguousarray(end_s, dtype=np.float64)
    return _bound(
        line_s, ends, np.zeros((0, 2)), 0.0, home_s, (sweep_scale, travel_scale), None,
        (trip_s, swap_s),
    )  # fmt: skip


def many_lanes_bound(
    *,
    line_s: FloatArray,
    ends_m: FloatArray,
    near: IntArray,
    speed_m_s: float,
    slack_s: float,
    home_s: FloatArray,
    sweep_scale: FloatArray | None = None,
    travel_scale: FloatArray | None = None,
) -> LanesBound:
    """Return what :func:`lanes_bound` does for more lines than a matrix of all ways can hold.

    Ways are taken as the crow flies, over land as well, so the bound is weaker, and the term says
    so.

    Parameters
    ----------
    line_s, home_s, sweep_scale, travel_scale
        See there.
    ends_m : (2n, 2) array
        Where the ends are.
    near : (2n, any) array
        The nearest ends of other lines, or some that are near.
    speed_m_s
        The fastest speed between ends, of a robot whose scale is 1.
    slack_s
        What a way can take less than its length over the speed, because corners are cut.
    """
    return _bound(
        line_s,
        np.zeros((0, 0)),
        np.ascontiguousarray(ends_m, dtype=np.float64) / speed_m_s,
        slack_s,
        home_s,
        (sweep_scale, travel_scale),
        np.asarray(near, dtype=np.int64)[:, :NEAR],
    )


def _bound(
    line_s: FloatArray,
    end_s: FloatArray,
    places_s: FloatArray,
    slack_s: float,
    home_s: FloatArray,
    scales: tuple[FloatArray | None, FloatArray | None],
    near: IntArray | None,
    trips: tuple[FloatArray | None, FloatArray | None] = (None, None),
) -> LanesBound:
    robots = len(home_s)
    if len(line_s) == 0 or robots == 0:
        return LanesBound(makespan_s=0.0, term="work shared out")
    ones = np.ones(robots)
    sweep, travel = (ones if s is None else np.asarray(s, dtype=np.float64) for s in scales)
    if near is None:
        least = few_lines_makespan(line_s, end_s, home_s, (sweep, travel), trips)
        if 0.0 < least < math.inf:
            return LanesBound(makespan_s=least * (1.0 - MARGIN), term="every order")
    pace = np.minimum(sweep, travel)
    # robots slower than the fastest count for less than one of it
    fastest = float(pace.min())
    line = np.ascontiguousarray(line_s, dtype=np.float64)
    home = np.ascontiguousarray(np.min(home_s / pace[:, None], axis=0), dtype=np.float64)
    trip, swap = (None if s is None else np.asarray(s, dtype=np.float64) / pace for s in trips)
    task = Task(
        float((fastest / pace).sum()), robots, line, home, end_s, places_s, slack_s,
        trip_s=math.inf if trip is None else float(trip.max()),
        swap_s=0.0 if swap is None else float(swap.min()),
    )  # fmt: skip
    best, term = max(float(line.sum()) / task.robots, 0.0), "work shared out"
    # numbers that are no metric may make the way over other lines the shorter one
    away = depths(line, task.table, home, 1.0)
    far = float((away[::2] + line + away[1::2]).max())
    if far > best:
        best, term = far, "farthest line"
    if near is not None and len(line) > MOST_LINES:
        return LanesBound(makespan_s=fastest * best * (1.0 - MARGIN), term=term)
    legs = near_legs(near_ends(end_s) if near is None else near, task)
    if near is not None or (task.tours > FEW_TOURS and not task.many):
        priced_s, deep = prices_makespan(task, legs, SHARES if near is None else MANY, best)
        if priced_s > best:
            best, term = priced_s, "reach and connection" if deep else "connection"
            term += "" if near is None else ", as the crow flies"
    if near is None:
        in_arms_s = arms_makespan(task, legs, best)
        if in_arms_s > best:
            best, term = in_arms_s, "arms and connection"
    return LanesBound(makespan_s=fastest * best * (1.0 - MARGIN), term=term)


def divisible_bound(
    *,
    line_s: FloatArray,
    home_s: FloatArray,
    nearest_s: FloatArray,
    robots: int,
    levels: int = 64,
) -> LanesBound:
    """Return a time that the longest tour takes at least, wherever lines are cut.

    Parameters
    ----------
    line_s : (n,) array
        Seconds of sweeping each line, a straight one.
    home_s : (2n,) array
        Seconds from the nearest home to each end, by shortest ways.
    nearest_s : (2n,) array
        Seconds from each end to the nearest other end, the other of its own line included, by
        shortest ways, and by no more than the seconds of sweeping so far.
    robots
        Number of tours.
    levels
        How many distances from home are tried.
    """
    best, term = 2 * float(home_s.max()) if len(home_s) else 0.0, "farthest line"
    for r in np.linspace(0.0, 1.0, levels, endpoint=False) * best / 2:
        beyond = np.clip(home_s[::2] - r, 0.0, None) + np.clip(home_s[1::2] - r, 0.0, None)
        swept = line_s if r == 0 else np.minimum(line_s, beyond)
        zones = np.minimum(nearest_s / 2, np.clip(home_s - r, 0.0, None))
        found = 2 * r + float(swept.sum() + zones.sum()) / robots
        if found > best:
            best, term = found, "work shared out" if r == 0 else "reach"
    return LanesBound(makespan_s=best * (1.0 - MARGIN), term=term)

"""The bound for chosen lines: no plan that sweeps each of them in one go has a shorter longest tour.

The proof is in ``docs/bounds.md``. In short: every line has work, its seconds and what its ends are
charged for the legs that must reach them; a tour that goes to a depth d spends 2 d on the way there
and back, so it has room for T - 2 d of other work, and each second of it takes 1/(T - 2 d) of a
robot at least. What charges and depths leave of the legs must still connect all lines with home:
a least spanning tree. T is too short as long as all that takes more robots than there are. Which
charges and depths are best is searched for; that the answer is true does not depend on how.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from mrmission.minmax import bound_legs as kernels
from mrmission.model import FloatArray, IntArray

NEAR = 8
"""Legs to so many nearest ends of other lines are looked at first; others are added when needed."""
SHARES = ((0.0, 0.25), (0.0, 0.5), (0.0, 1.0), (1.0, 1.0))
"""Depths to begin with: which share of a line's seconds it goes deeper by, and a factor on all."""
TRIAL = ((60, 0.5, 0.3),)
POLISH = ((150, 0.3, 0.2), (120, 0.12, 0.2), (120, 0.05, 0.2))
"""Rounds of steps: how many, the first in parts of a typical leg, and the last against the first."""
FOLLOW = 5.0
"""Depths move so many times as far as charges do."""
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
        What it comes from, in words: ``work shared out``, ``connection``, ``reach and connection``
        or ``farthest line``.
    """

    makespan_s: float
    term: str


@dataclass(frozen=True, slots=True)
class _Legs:
    """A sparse set of legs between ends: those of end a are ``start[a]`` to ``start[a + 1]``."""

    start: IntArray
    other: IntArray
    length: FloatArray


def lanes_bound(
    *,
    line_s: FloatArray,
    end_s: FloatArray,
    home_s: FloatArray,
    sweep_scale: FloatArray | None = None,
    travel_scale: FloatArray | None = None,
    fixed_s: float = 0.0,
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
        The least seconds between each robot's home and the ends.
    sweep_scale, travel_scale : (robots,) arrays
        What these seconds are multiplied by for each robot; 1 when None.
    fixed_s
        What each robot that has work spends besides.

    Returns
    -------
    LanesBound
        It holds for tours that leave robots without work, too.
    """
    robots = len(home_s)
    if len(line_s) == 0 or robots == 0:
        return LanesBound(makespan_s=0.0, term="work shared out")
    ones = np.ones(robots)
    pace = np.minimum(
        ones if sweep_scale is None else sweep_scale, ones if travel_scale is None else travel_scale
    )
    # robots slower than the fastest count for less than one of it
    fastest = float(pace.min())
    count = float((fastest / pace).sum())
    line = np.ascontiguousarray(line_s, dtype=np.float64)
    ends = np.ascontiguousarray(end_s, dtype=np.float64)
    home = np.ascontiguousarray(np.min(home_s, axis=0), dtype=np.float64)
    best, term = max(line.sum() / count, 0.0), "work shared out"
    far = float((home[::2] + line + home[1::2]).max())
    if far > best:
        best, term = far, "farthest line"
    found, depth_s = _search(count, line, ends, home)
    if found > best:
        best, term = found, "reach and connection" if depth_s > 0 else "connection"
    return LanesBound(makespan_s=fixed_s + fastest * best * (1.0 - MARGIN), term=term)


def _search(
    robots: float, line_s: FloatArray, end_s: FloatArray, home_s: FloatArray
) -> tuple[float, float]:
    """Return the best makespan that charges and depths were found to prove, and the depth used."""
    legs = _near_legs(end_s)
    nearest = _nearest(legs)
    step_s = float(np.median(nearest)) if len(nearest) else float(home_s.max())
    starts = []
    for share, factor in SHARES:
        depth = factor * _depths(line_s, end_s, home_s, share)
        charge = np.full(len(home_s), step_s / 4)
        starts.append(_climb(robots, line_s, end_s, home_s, legs, charge, depth, step_s, TRIAL))
    best, charge, depth, legs = max(starts, key=lambda found: found[0])
    polished = _climb(robots, line_s, end_s, home_s, legs, charge, depth, step_s, POLISH)
    if polished[0] > best:
        best, _, depth, _ = polished
    return best, float(depth.max())


def _climb(
    robots: float,
    line_s: FloatArray,
    end_s: FloatArray,
    home_s: FloatArray,
    legs: _Legs,
    charge: FloatArray,
    depth: FloatArray,
    step_s: float,
    rounds: tuple[tuple[int, float, float], ...],
) -> tuple[float, FloatArray, FloatArray, _Legs]:
    """Return a proven makespan, and the charges, depths and legs it was found with."""
    charge, depth = charge.copy(), depth.copy()
    via = np.zeros((2 * len(home_s), 2), dtype=np.int64)
    found = 0.0
    for steps, first, last in rounds:
        found = kernels.ascend(
            robots, line_s, home_s, legs.start, legs.other, legs.length, charge, depth,
            steps, step_s * first, last, FOLLOW,
        )  # fmt: skip
        found = kernels.dense_makespan(robots, found, line_s, end_s, home_s, charge, depth, via)
        legs = _with_legs(legs, via, end_s)
    return found, charge, depth, legs


def _near_legs(end_s: FloatArray) -> _Legs:
    """Return the legs from each end to the nearest ends of other lines, both ways."""
    m = len(end_s)
    if m <= 2:
        return _Legs(np.zeros(m + 1, dtype=np.int64), np.zeros(0, dtype=np.int64), np.zeros(0))
    away = end_s.copy()
    here = np.arange(m)
    away[here, here] = np.inf
    away[here, here ^ 1] = np.inf
    count = min(NEAR, m - 2)
    near = np.argpartition(away, count - 1, axis=1)[:, :count]
    a, b = np.repeat(here, count), near.ravel()
    return _legs_of(np.concatenate([a * m + b, b * m + a]), end_s)


def _with_legs(legs: _Legs, pairs: IntArray, end_s: FloatArray) -> _Legs:
    """Return the legs and those between pairs of ends, -1 for no end."""
    m = len(end_s)
    a = np.repeat(np.arange(m), np.diff(legs.start))
    p, q = pairs[pairs[:, 0] >= 0].T
    return _legs_of(np.concatenate([a * m + legs.other, p * m + q, q * m + p]), end_s)


def _legs_of(key: npt.NDArray[np.int64], end_s: FloatArray) -> _Legs:
    m = len(end_s)
    a, b = np.divmod(np.unique(key), m)
    start = np.searchsorted(a, np.arange(m + 1)).astype(np.int64)
    return _Legs(start, b.astype(np.int64), end_s[a, b])


def _nearest(legs: _Legs) -> FloatArray:
    """Return the shortest leg of each end that has one."""
    has = np.diff(legs.start) > 0
    if not has.any():
        return np.zeros(0)
    return np.minimum.reduceat(legs.length, legs.start[:-1][has])


def _depths(line_s: FloatArray, end_s: FloatArray, home_s: FloatArray, share: float) -> FloatArray:
    """Return each end's distance from home when lines cost only a share of their seconds."""
    depth = np.maximum(home_s, 0.0)
    open_ = np.ones(len(depth), dtype=bool)
    for _ in range(len(depth)):
        a = int(np.argmin(np.where(open_, depth, np.inf)))
        open_[a] = False
        depth = np.minimum(depth, depth[a] + np.maximum(end_s[a], 0.0))
        depth[a ^ 1] = min(depth[a ^ 1], depth[a] + share * line_s[a >> 1])
    return depth

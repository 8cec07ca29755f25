"""The bound for chosen lines: what the longest tour takes at least if each is swept in one go.

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
"""Rounds of steps: how many, the first in parts of a typical leg, the last against the first."""
FOLLOW = 5.0
"""Depths move so many times as far as charges do."""
MOST_ENDS = 15
SELDOM = 0.05
OVERLAP = 2
"""Odd sets have up to so many ends, are crossed less than once by so much, and share ends with so
many others that are found at the same time."""
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
    owner: IntArray
    length: FloatArray


@dataclass(frozen=True, slots=True)
class _Covers:
    """Odd sets of ends one after the other, and what crossing their borders is charged."""

    start: IntArray
    end: IntArray
    toll: FloatArray


@dataclass(frozen=True, slots=True)
class _Proof:
    """What proves a makespan: charges and depths of ends, tolls of odd sets."""

    makespan: float
    charge: FloatArray
    depth: FloatArray
    covers: _Covers
    legs: _Legs


@dataclass(frozen=True, slots=True)
class _Task:
    """Robots, seconds of the lines, and least seconds between ends and to the nearest home."""

    robots: float
    line_s: FloatArray
    end_s: FloatArray
    home_s: FloatArray


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
    found, depth_s = _search(_Task(count, line, ends, home))
    if found > best:
        best, term = found, "reach and connection" if depth_s > 0 else "connection"
    return LanesBound(makespan_s=fixed_s + fastest * best * (1.0 - MARGIN), term=term)


def _search(task: _Task) -> tuple[float, float]:
    """Return the best makespan that was found to be proven, and the depth used."""
    legs = _near_legs(task.end_s)
    nearest = _nearest(legs)
    step_s = float(np.median(nearest)) if len(nearest) else float(task.home_s.max())
    nothing = _Covers(np.zeros(1, dtype=np.int64), np.zeros(0, dtype=np.int64), np.zeros(0))
    tried = []
    for share, factor in SHARES:
        depth = factor * _depths(task, share)
        charge = np.full(len(task.home_s), step_s / 4)
        tried.append(_climb(task, _Proof(0.0, charge, depth, nothing, legs), step_s, TRIAL))
    proof = max(tried, key=lambda found: found.makespan)
    proof = _climb(task, proof, step_s, POLISH)
    return proof.makespan, float(proof.depth.max())


def _climb(
    task: _Task, proof: _Proof, step_s: float, rounds: tuple[tuple[int, float, float], ...]
) -> _Proof:
    """Return the best proof that rounds of steps lead to, that given or one better."""
    best = proof
    charge, depth = proof.charge.copy(), proof.depth.copy()
    covers, legs = proof.covers, proof.legs
    via = np.zeros((2 * len(charge), 2), dtype=np.int64)
    for steps, first, last in rounds:
        toll = covers.toll.copy()
        mean, mean_home = np.zeros(len(legs.other)), np.zeros(len(charge))
        cross_start, cross = kernels.crossings(legs.start, legs.other, covers.start, covers.end)
        found = kernels.ascend(
            task.robots, task.line_s, task.home_s, legs.start, legs.other, legs.owner, legs.length,
            covers.start, covers.end, cross_start, cross, charge, depth, toll,
            steps, step_s * first, last, FOLLOW, mean, mean_home,
        )  # fmt: skip
        found = kernels.dense_makespan(
            task.robots, found, task.line_s, task.end_s, task.home_s, charge, depth,
            covers.start, covers.end, toll, via,
        )  # fmt: skip
        covers = _Covers(covers.start, covers.end, toll)
        if found > best.makespan:
            best = _Proof(found, charge.copy(), depth.copy(), covers, legs)
        covers = _more_covers(covers, legs, mean, mean_home)
        legs = _with_legs(legs, via, task.end_s)
    return best


def _more_covers(
    covers: _Covers, legs: _Legs, mean: FloatArray, mean_home: FloatArray
) -> _Covers:
    """Return the sets that charge anything and odd ones whose borders legs cross too seldom."""
    m = len(mean_home)
    key = np.minimum(legs.owner, legs.other) * m + np.maximum(legs.owner, legs.other)
    _, pair = np.unique(key, return_inverse=True)
    both = np.bincount(pair, weights=mean)[pair] if len(pair) else mean
    found = np.zeros((m, MOST_ENDS), dtype=np.int64)
    size = np.zeros(m, dtype=np.int64)
    cut = np.zeros(m)
    count = kernels.odd_sets(
        legs.start, legs.other, both, mean_home, MOST_ENDS, SELDOM, found, size, cut
    )
    sets = {
        tuple(covers.end[a:b].tolist()): toll
        for a, b, toll in zip(covers.start[:-1], covers.start[1:], covers.toll, strict=True)
        if toll > 0
    }
    taken = np.zeros(m, dtype=np.int64)
    for c in np.argsort(cut[:count], kind="stable"):
        ends = np.sort(found[c, : size[c]])
        if taken[ends].max() < OVERLAP and tuple(ends.tolist()) not in sets:
            taken[ends] += 1
            sets[tuple(ends.tolist())] = 0.0
    lengths = np.array([0, *(len(ends) for ends in sets)], dtype=np.int64)
    return _Covers(
        np.cumsum(lengths),
        np.array([a for ends in sets for a in ends], dtype=np.int64),
        np.array(list(sets.values()), dtype=np.float64),
    )


def _near_legs(end_s: FloatArray) -> _Legs:
    """Return the legs from each end to the nearest ends of other lines, both ways."""
    m = len(end_s)
    if m <= 2:
        none = np.zeros(0, dtype=np.int64)
        return _Legs(np.zeros(m + 1, dtype=np.int64), none, none, np.zeros(0))
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
    p, q = pairs[pairs[:, 0] >= 0].T
    return _legs_of(np.concatenate([legs.owner * m + legs.other, p * m + q, q * m + p]), end_s)


def _legs_of(key: npt.NDArray[np.int64], end_s: FloatArray) -> _Legs:
    m = len(end_s)
    a, b = np.divmod(np.unique(key), m)
    start = np.searchsorted(a, np.arange(m + 1)).astype(np.int64)
    return _Legs(start, b.astype(np.int64), a.astype(np.int64), end_s[a, b])


def _nearest(legs: _Legs) -> FloatArray:
    """Return the shortest leg of each end that has one."""
    has = np.diff(legs.start) > 0
    if not has.any():
        return np.zeros(0)
    return np.minimum.reduceat(legs.length, legs.start[:-1][has])


def _depths(task: _Task, share: float) -> FloatArray:
    """Return each end's distance from home when lines cost only a share of their seconds."""
    depth = np.maximum(task.home_s, 0.0)
    open_ = np.ones(len(depth), dtype=bool)
    for _ in range(len(depth)):
        a = int(np.argmin(np.where(open_, depth, np.inf)))
        open_[a] = False
        depth = np.minimum(depth, depth[a] + np.maximum(task.end_s[a], 0.0))
        depth[a ^ 1] = min(depth[a ^ 1], depth[a] + share * task.line_s[a >> 1])
    return depth

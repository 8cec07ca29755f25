"""What the bounds for chosen lines are made from: the task, legs between ends, odd sets of ends."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from mrmission.minmax.bounds.odd_sets import odd_sets
from mrmission.minmax.nearest import nearest_ends
from mrmission.model import FloatArray, IntArray

NEAR = 8
"""Legs to so many nearest ends of other lines are looked at first; others are added when needed."""
MANY_LINES = 1000
"""More lines with a matrix are bounded by arms alone, in fewer steps: of 7 problems of lakes with
1,300 to 1,900 lines prices were the better bound of one, by 0.1 %."""
MOST_ENDS = 15
SELDOM = 0.05
OVERLAP = 2
"""Odd sets have up to so many ends, are crossed less than once by so much, and share ends with so
many others that are found at the same time."""


@dataclass(frozen=True, slots=True)
class Legs:
    """A sparse set of legs between ends: those of end a are ``start[a]`` to ``start[a + 1]``."""

    start: IntArray
    other: IntArray
    owner: IntArray
    length: FloatArray


@dataclass(frozen=True, slots=True)
class Covers:
    """Odd sets of ends one after the other, and what crossing their borders is charged."""

    start: IntArray
    end: IntArray
    toll: FloatArray


@dataclass(frozen=True, slots=True)
class Task:
    """Robots, seconds of the lines, and least seconds between ends and to the nearest home.

    Attributes
    ----------
    robots
        In times the fastest; ``tours`` counts them.
    trip_s, swap_s
        What a trip may take at most, and what every trip beyond the first of each robot costs
        besides at least.
    """

    robots: float
    tours: int
    line_s: FloatArray
    home_s: FloatArray
    end_s: FloatArray
    places_s: FloatArray
    slack_s: float
    trip_s: float = math.inf
    swap_s: float = 0.0

    @property
    def fleet(self) -> tuple[float, float, float, float]:
        """Return ``robots, tours, trip_s, swap_s`` as the kernels take them."""
        return self.robots, float(self.tours), self.trip_s, self.swap_s

    @property
    def many(self) -> bool:
        """Return whether there are more than :data:`MANY_LINES`."""
        return len(self.line_s) > MANY_LINES

    @property
    def table(self) -> tuple[FloatArray, FloatArray, float]:
        """Return the ways between ends as the kernels take them."""
        return self.end_s, self.places_s, self.slack_s

    def ways(self, a: IntArray, b: IntArray) -> FloatArray:
        """Return the least seconds between ends; as the crow flies where there is no matrix."""
        if len(self.end_s):
            return np.asarray(self.end_s[a, b])
        step = self.places_s[a] - self.places_s[b]
        return np.maximum(0.0, np.hypot(step[:, 0], step[:, 1]) - self.slack_s)


def no_covers() -> Covers:
    """Return no sets."""
    return Covers(np.zeros(1, dtype=np.int64), np.zeros(0, dtype=np.int64), np.zeros(0))


def more_covers(covers: Covers, legs: Legs, mean: FloatArray, mean_home: FloatArray) -> Covers:
    """Return the sets that charge anything and odd ones whose borders legs cross too seldom."""
    m = len(mean_home)
    key = np.minimum(legs.owner, legs.other) * m + np.maximum(legs.owner, legs.other)
    _, pair = np.unique(key, return_inverse=True)
    both = np.bincount(pair, weights=mean)[pair] if len(pair) else mean
    found = np.zeros((m, MOST_ENDS), dtype=np.int64)
    size = np.zeros(m, dtype=np.int64)
    cut = np.zeros(m)
    count = odd_sets(legs.start, legs.other, both, mean_home, MOST_ENDS, SELDOM, found, size, cut)
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
    return Covers(
        np.cumsum(lengths),
        np.array([a for ends in sets for a in ends], dtype=np.int64),
        np.array(list(sets.values()), dtype=np.float64),
    )


def near_ends(end_s: FloatArray) -> IntArray:
    """Return (ends, at most NEAR) nearest ends of other lines."""
    return nearest_ends(end_s, NEAR)


def near_legs(near: IntArray, task: Task) -> Legs:
    """Return the legs between ends and those near them, in both directions."""
    m = len(task.home_s)
    a, b = np.repeat(np.arange(m), near.shape[1]), near.ravel()
    return legs_of(np.concatenate([a * m + b, b * m + a]), task)


def usual_leg_s(legs: Legs, task: Task) -> float:
    """Return the seconds of a usual shortest leg; of the farthest way home where there are none."""
    has = np.diff(legs.start) > 0
    if not has.any():
        return float(task.home_s.max())
    return float(np.median(np.minimum.reduceat(legs.length, legs.start[:-1][has])))


def with_legs(legs: Legs, pairs: IntArray, task: Task) -> Legs:
    """Return the legs and those between pairs of ends, -1 for no end."""
    m = len(task.home_s)
    p, q = pairs[pairs[:, 0] >= 0].T
    return legs_of(np.concatenate([legs.owner * m + legs.other, p * m + q, q * m + p]), task)


def legs_of(key: npt.NDArray[np.int64], task: Task) -> Legs:
    """Return the legs from end a to end b of keys a · ends + b."""
    m = len(task.home_s)
    a, b = np.divmod(np.unique(key), m)
    start = np.searchsorted(a, np.arange(m + 1)).astype(np.int64)
    return Legs(start, b.astype(np.int64), a.astype(np.int64), task.ways(a, b))

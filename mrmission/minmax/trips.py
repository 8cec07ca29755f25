"""Trips: a robot's work cut so that it is home before its battery, or its memory, is used up.

A trip begins and ends at the robot's home. What it uses, of time, of distance and of mission items,
is told as a share of what the robot has: 1 is all that it may use, the reserve taken off. A tour is
cut between two stretches of survey, where the way from one to the next is replaced by the ways home
and out again; a stretch that no trip can hold is cut itself.

For an order of work that is given, the least number of trips is found by filling one trip after the
other: a trip that is shortened at either end uses no more (lengths in the water keep the triangle
inequality), so the first trip may as well be as long as can be, and so on. The same, at a smaller
allowance, finds the trips whose longest is shortest.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np

from mrmission.errors import InfeasibleError
from mrmission.minmax.problem import LaneProblem
from mrmission.minmax.trip_items import ItemCounts, turning
from mrmission.mission.items import count_items
from mrmission.model import CoveragePath, FloatArray, LegKind
from mrmission.options import PlanOptions
from mrmission.tour.path import join_pieces
from mrmission.tour.timing import TimeModel

MOST_PIECES = 256
"""A stretch is cut into no more pieces than this."""
FINER = 3
"""A stretch that must be cut is cut into so many times the pieces that it needs."""
FEW_STRETCHES, GRAIN = 8, 0.1
"""With fewer stretches than this for each trip, pieces of this share of a trip are tried."""
BORDERS = 128
"""Where items alone bind and a tour has twice as many stretches as this, about so many of the
places between them are looked at for borders of trips: each needs the ways home from there."""
_BISECTIONS = 14


@dataclass(frozen=True, slots=True, kw_only=True)
class Allowance:
    """What one trip of a robot may use, the reserve taken off.

    Attributes
    ----------
    seconds, metres
        Of the way from home to home; infinite where it does not bind.
    items
        Mission items, home included.
    """

    seconds: float = math.inf
    metres: float = math.inf
    items: float = math.inf

    @classmethod
    def of(cls, options: PlanOptions) -> Allowance:
        """Return what a robot with these options may use: endurance less reserve, and items."""
        share = 1.0 - options.reserve
        return cls(
            seconds=math.inf if options.endurance_s is None else share * options.endurance_s,
            metres=math.inf if options.endurance_m is None else share * options.endurance_m,
            items=float(options.limits.mission_items),
        )

    @property
    def endless(self) -> bool:
        """Return whether no battery binds; items may."""
        return math.isinf(self.seconds) and math.isinf(self.metres)


def as_it_is(path: CoveragePath) -> CoveragePath:
    """Return the path itself: nothing becomes of it before it is exported."""
    return path


@dataclass(frozen=True, slots=True, kw_only=True)
class Gauge:
    """Measures what a path uses of a robot's allowance.

    Attributes
    ----------
    allowance
        Of one trip.
    time
        How long the robot takes.
    options
        The options as they are for this robot; items depend on them.
    shaped
        What becomes of a path before it is exported: turns, run-ins.
    exported
        Whether paths are as exported, every point an item; before, those on straight legs go.
    """

    allowance: Allowance
    time: TimeModel
    options: PlanOptions
    shaped: Callable[[CoveragePath], CoveragePath] = as_it_is
    exported: bool = False

    @property
    def counts_turns(self) -> bool:
        """Return whether a path uses nothing but items, one for each leg to where it turns."""
        plain = self.shaped is as_it_is and not self.exported
        return plain and self.allowance.endless and self.options.trigger_distance_m <= 0

    def used(self, path: CoveragePath) -> float:
        """Return the largest share of the allowance that a path uses; 1 is all."""
        path = self.shaped(path)
        out = 0.0
        if math.isfinite(self.allowance.seconds):
            out = self.time.duration_s(path.points_m, path.kind) / self.allowance.seconds
        if math.isfinite(self.allowance.metres):
            out = max(out, _length_m(path.points_m) / self.allowance.metres)
        if math.isfinite(self.allowance.items):
            kinds = path.kind if self.exported else turning(path)
            out = max(out, count_items(kinds, self.options) / self.allowance.items)
        return out


@dataclass(frozen=True, slots=True, kw_only=True)
class Stretches:
    """A path without its ends: what it sweeps, in order, and the ways between.

    Attributes
    ----------
    lines_m
        (m, 2) polylines that are swept without a transit in between.
    ways_m
        One fewer: the transits from each to the next; a single point where they meet.
    """

    lines_m: tuple[FloatArray, ...]
    ways_m: tuple[FloatArray, ...]

    def __len__(self) -> int:
        return len(self.lines_m)


def stretches_of(path: CoveragePath) -> Stretches:
    """Return the stretches of survey of a path, in order, and the ways between them."""
    survey = np.asarray(path.kind) == LegKind.SURVEY
    edges = np.flatnonzero(np.diff(np.concatenate([[False], survey, [False]]).astype(np.int8)))
    runs = edges.reshape(-1, 2).tolist()
    return Stretches(
        lines_m=tuple(path.points_m[a : b + 1] for a, b in runs),
        ways_m=tuple(path.points_m[b : c + 1] for (_, b), (c, _) in pairwise(runs)),
    )


def _joined(whole: Stretches, pieces: Sequence[Sequence[FloatArray]]) -> Stretches:
    """Return stretches with the pieces of each in its place; pieces meet where they were cut."""
    ways: list[FloatArray] = []
    for i, mine in enumerate(pieces):
        ways += whole.ways_m[i - 1 : i] if i else ()
        ways += [piece[:1] for piece in mine[1:]]
    return Stretches(lines_m=tuple(p for mine in pieces for p in mine), ways_m=tuple(ways))


def cut_line(line_m: FloatArray, pieces: int) -> list[FloatArray]:
    """Cut an (m, 2) polyline into pieces of equal length.

    Examples
    --------
    >>> [p.tolist() for p in cut_line(np.array([[0.0, 0.0], [4.0, 0.0]]), 2)]
    [[[0.0, 0.0], [2.0, 0.0]], [[2.0, 0.0], [4.0, 0.0]]]
    """
    at = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(line_m, axis=0).T))])
    borders = np.linspace(0.0, at[-1], pieces + 1)
    cuts = np.column_stack([np.interp(borders, at, line_m[:, axis]) for axis in (0, 1)])
    cuts[0], cuts[-1] = line_m[0], line_m[-1]
    out = []
    for i in range(pieces):
        inner = line_m[(at > borders[i] + 1e-6) & (at < borders[i + 1] - 1e-6)]
        out.append(np.vstack([cuts[i], inner, cuts[i + 1]]))
    return out


class TripCutter:
    """Cuts one robot's tour into trips.

    Parameters
    ----------
    path
        The tour, from home to home.
    home_ways
        Ways in the water from home to each of (n, 2) points.
    gauge
        What a trip may use.
    allowed
        Share of the allowance that a trip may fill.

    Raises
    ------
    InfeasibleError
        When even a piece of a stretch of :data:`MOST_PIECES` does not fit: names the place.
    """

    def __init__(
        self,
        path: CoveragePath,
        home_ways: Callable[[FloatArray], list[FloatArray]],
        gauge: Gauge,
        allowed: float = 1.0,
    ) -> None:
        self._path = path
        self._home_ways = home_ways
        self._gauge = gauge
        self.allowed = allowed
        self._used: dict[tuple[int, int], float] = {}
        self._items: ItemCounts | None = None
        whole = stretches_of(path)
        self._set(whole)
        if allowed < self.largest() and len(self):
            self._set(whole, sparsely=False)
            if allowed < self.largest():
                self._set(self._fitting(whole), sparsely=False)

    def _set(self, work: Stretches, *, sparsely: bool = True) -> None:
        """Take stretches for the work; `sparsely`: of very many not all may begin a trip."""
        self._used.clear()
        self._lines, self._ways = list(work.lines_m), list(work.ways_m)
        count = len(self._lines)
        many = sparsely and self._gauge.allowance.endless and count >= 2 * BORDERS
        self._borders = [*range(0, count, count // BORDERS if many else 1), count]
        self._items = None
        if not self._lines:
            self._out, self._back = {}, {}
            return
        first = self._borders[:-1]
        last = [end - 1 for end in self._borders[1:]]
        heads = np.array([self._lines[i][0] for i in first])
        tails = np.array([self._lines[i][-1] for i in last])
        found = self._home_ways(np.concatenate([heads, tails]))
        self._out = dict(zip(first, found, strict=False))
        back = (way[::-1] for way in found[len(heads) :])
        self._back = dict(zip(last, back, strict=True))
        moving = all(np.any(line[1:] != line[:-1]) for line in self._lines)
        if self._gauge.counts_turns and moving:
            self._items = ItemCounts(self._lines, self._ways, self._out, self._back)

    def __len__(self) -> int:
        return len(self._lines)

    @property
    def lines_m(self) -> tuple[FloatArray, ...]:
        """Return the stretches, (m, 2) each, those that no trip holds cut into pieces."""
        return tuple(self._lines)

    def trip(self, first: int, end: int) -> CoveragePath:
        """Return the trip over the stretches from `first` to before `end`."""
        pieces: list[tuple[FloatArray, LegKind, int]] = [(self._out[first], LegKind.TRANSIT, 0)]
        for i in range(first, end):
            if i > first:
                pieces.append((self._ways[i - 1], LegKind.TRANSIT, 0))
            pieces.append((self._lines[i], LegKind.SURVEY, i - first + 1))
        pieces.append((self._back[end - 1], LegKind.TRANSIT, 0))
        return join_pieces(self._path.robot, pieces)

    def used(self, first: int, end: int) -> float:
        """Return the share of the allowance that such a trip uses."""
        key = (first, end)
        if key not in self._used and self._items is not None:
            items = self._items.count(first, end, self._gauge.options)
            self._used[key] = items / self._gauge.allowance.items
        elif key not in self._used:
            self._used[key] = self._gauge.used(self.trip(first, end))
        return self._used[key]

    def largest(self) -> float:
        """Return what the largest stretch, or part between borders, uses on a trip of its own."""
        return max((self.used(a, b) for a, b in pairwise(self._borders)), default=0.0)

    def _ground(self, whole: Stretches) -> Stretches:
        """Cut all long stretches into pieces of about `GRAIN` of a trip."""
        alone = [self.used(i, i + 1) for i in range(len(whole))]
        pieces = [
            cut_line(line, max(1, math.ceil(share / (GRAIN * self.allowed))))
            for line, share in zip(whole.lines_m, alone, strict=True)
        ]
        return _joined(whole, pieces)

    def _fitting(self, whole: Stretches) -> Stretches:
        """Cut the stretches that no trip holds."""
        pieces = [
            [line] if self.used(i, i + 1) <= self.allowed else self._pieces(line)
            for i, line in enumerate(whole.lines_m)
        ]
        return _joined(whole, pieces)

    def _pieces(self, line_m: FloatArray) -> list[FloatArray]:
        count = 2
        while True:
            pieces = cut_line(line_m, count)
            alone = [self._gauge.used(self._alone(piece)) for piece in pieces]
            if max(alone) <= self.allowed:
                # finer still: trips are filled better, and pieces that follow on each other are one
                finer = cut_line(line_m, FINER * count)
                longest = max(self._gauge.used(self._alone(piece)) for piece in finer)
                return finer if longest <= self.allowed else pieces
            if count >= MOST_PIECES:
                worst = int(np.argmax(alone))
                raise TooFarError(pieces[worst].mean(axis=0), self._alone(pieces[worst]))
            count = min(MOST_PIECES, count + max(1, count // 3))

    def _alone(self, line_m: FloatArray) -> CoveragePath:
        out, back = self._home_ways(line_m[[0, -1]])
        pieces = [
            (out, LegKind.TRANSIT, 0), (line_m, LegKind.SURVEY, 1), (back[::-1], LegKind.TRANSIT, 0)
        ]  # fmt: skip
        return join_pieces(self._path.robot, pieces)

    def fewest(self, allowed: float | None = None) -> list[int] | None:
        """Return the borders of the fewest trips, each filled as far as it goes; None if none do.

        Parameters
        ----------
        allowed
            Share of the allowance that a trip may fill; as at the beginning if not given.

        Returns
        -------
        list of int
            ``[0, …, len(self)]``: trip ``i`` goes from border ``i`` to before ``i + 1``.
        """
        limit = self.allowed if allowed is None else allowed
        borders = [0]
        while borders[-1] < len(self._borders) - 1:
            end = self._reach(borders[-1], limit)
            if end is None:
                return None
            borders.append(end)
        return [self._borders[i] for i in borders]

    def _reach(self, first: int, limit: float) -> int | None:
        """Return the last border to which a trip from border `first` fits; None if none does."""
        top = len(self._borders) - 1

        def fits(end: int) -> bool:
            return self.used(self._borders[first], self._borders[end]) <= limit

        if not fits(first + 1):
            return None
        low, step = first + 1, 1  # `low` fits
        while low < top and fits(min(low + step, top)):
            low, step = min(low + step, top), 2 * step
        high = min(low + step, top + 1)  # does not fit, or there is no more
        while high - low > 1:
            middle = (low + high) // 2
            if middle <= top and fits(middle):
                low = middle
            else:
                high = middle
        return low

    def balanced(self, least: int = 1) -> list[int]:
        """Return the borders of the fewest trips, of these the ones whose longest is shortest.

        Parameters
        ----------
        least
            At least so many, where there is as much to share.
        """
        best = self.fewest()
        if best is None:  # `_fitting` has seen to it, but for a hair
            a, b = max(pairwise(self._borders), key=lambda ends: self.used(*ends))
            raise TooFarError(self._lines[a].mean(axis=0), self.trip(a, b))
        trips = max(len(best) - 1, least)
        if trips <= 1:
            return best
        low, high = self.largest(), min(self.allowed, self.used(0, len(self)))
        for _ in range(_BISECTIONS):
            middle = (low + high) / 2
            found = self.fewest(middle)
            if found is not None and len(found) <= trips + 1:
                best, high = found, middle
            else:
                low = middle
        return best

    def trips(self, least: int = 1) -> list[CoveragePath]:
        """Return the fewest trips, balanced; one without work is the path itself.

        Where stretches are so long that whole ones leave trips half empty, they are cut if that
        saves a trip.

        Parameters
        ----------
        least
            At least so many, where there is as much to share.
        """
        if not len(self):
            return [self._path]
        if len(self) < least:
            whole = Stretches(lines_m=self.lines_m, ways_m=tuple(self._ways))
            self._set(_joined(whole, [cut_line(line, FINER * least) for line in self._lines]))
        borders = self.balanced(least)
        if len(borders) > 2 and len(self) < FEW_STRETCHES * (len(borders) - 1):
            whole = Stretches(lines_m=tuple(self._lines), ways_m=tuple(self._ways))
            if len(self._borders) <= len(self):  # so few for each trip: all places between them
                self._set(whole, sparsely=False)
                borders = self.balanced(least)
            self._set(self._ground(whole))
            finer = self.fewest()
            if finer is not None and len(finer) < len(borders):
                borders = self.balanced(least)
            else:
                self._set(whole, sparsely=False)
        return [self.trip(a, b) for a, b in pairwise(borders)]


class TooFarError(InfeasibleError):
    """A place that a robot cannot reach and return from on one trip.

    Attributes
    ----------
    place_m
        ``[east_m, north_m]``.
    trip
        To that place and back, as short as it gets; its `robot` is whose it is.
    """

    def __init__(self, place_m: FloatArray, trip: CoveragePath) -> None:
        self.place_m = place_m
        self.trip = trip
        super().__init__(
            f"a place at east {place_m[0]:.0f} m, north {place_m[1]:.0f} m cannot be reached and "
            "returned from on one trip"
        )


def _length_m(points_m: FloatArray) -> float:
    return float(np.hypot(*np.diff(points_m, axis=0).T).sum()) if len(points_m) > 1 else 0.0


def weighted(problem: LaneProblem, weights: FloatArray | None) -> LaneProblem:
    """Return a problem in which the seconds of each robot count by a weight.

    Trips that may be of different lengths are compared so: by the share of each that is used.

    Parameters
    ----------
    problem
        With one robot for each trip.
    weights : (robots, 2) array
        Of sweeping and of travel; None where all count alike.
    """
    if weights is None:
        return problem
    ones = np.ones(len(weights))
    sweep = ones if problem.sweep_scale is None else problem.sweep_scale
    travel = ones if problem.travel_scale is None else problem.travel_scale
    return replace(
        problem,
        home_cost=problem.home_cost * weights[:, 1:],
        sweep_scale=sweep * weights[:, 0],
        travel_scale=travel * weights[:, 1],
    )


def may_hold(
    sweep_m: FloatArray, reach_m: FloatArray, allowed_m: Sequence[float] | FloatArray
) -> bool:
    """Return False where trips of these lengths surely cannot hold the work.

    To sweep what lies at least r from home in the water, a trip spends 2 r elsewhere. So for every
    r the lines at or beyond r are together no longer than the sum over trips of
    ``max(0, allowed - 2 r)``.

    Parameters
    ----------
    sweep_m : (lines,) array
        Length of each line.
    reach_m : (lines,) array
        Length of the way from home to the nearest place of each line, at least.
    allowed_m
        How long each trip may be.

    Examples
    --------
    >>> may_hold(np.array([10.0, 10.0]), np.array([0.0, 5.0]), [12.0, 12.0])
    False
    >>> may_hold(np.array([10.0, 10.0]), np.array([0.0, 5.0]), [12.0, 12.0, 12.0, 12.0, 12.0])
    True
    """
    order = np.argsort(reach_m, kind="stable")[::-1]
    beyond = np.cumsum(np.asarray(sweep_m)[order])
    r = np.asarray(reach_m)[order]
    room = np.maximum(0.0, np.asarray(allowed_m)[:, None] - 2 * r[None, :]).sum(axis=0)
    return bool(np.all(beyond <= room * (1 + 1e-9)))

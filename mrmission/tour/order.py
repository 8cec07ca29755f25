"""Visits -> oriented lanes: how each piece of work is entered, swept and left."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Protocol

import numpy as np

from mrmission.decomposition.cells import split_cell
from mrmission.model import FloatArray, IntArray
from mrmission.partition.problem import Visit
from mrmission.tour.sweep import Sweep
from mrmission.tour.timing import TimeModel

MIN_LANE_M = 1e-3
"""Shorter pieces of a lane cut in two are dropped; the coverage check sees what they leave."""


class Distances(Protocol):
    """Anything that knows in-water lengths."""

    def pair_distances(self, a_m: FloatArray, b_m: FloatArray) -> FloatArray:
        """Return (n,) lengths between the pairs of two (n, 2) arrays."""
        ...


@dataclass(frozen=True, slots=True, kw_only=True)
class PieceLanes:
    """The lanes of one visit, local frame, foot first, by rising column: (n, 2, 2)."""

    ends_m: FloatArray

    def sweep(self, backwards: bool, from_top: bool) -> FloatArray:
        """Return the lanes in boustrophedon order, each from where it is entered."""
        lanes = self.ends_m[::-1] if backwards else self.ends_m
        flip = (np.arange(len(lanes)) % 2 == 1) ^ from_top
        return np.where(flip[:, None, None], lanes[:, ::-1], lanes)


class PieceBook:
    """The lanes of every piece of work of a sweep, and what each costs to sweep."""

    def __init__(self, sweep: Sweep, distances: Distances, time: TimeModel) -> None:
        self._sweep = sweep
        self._starts = np.searchsorted(
            sweep.lane_cell, np.arange(len(sweep.decomposition.cells) + 1)
        )
        self._ends = sweep.frame.to_local(sweep.lane_ends_m())
        self._distances = distances
        self._time = time
        self._turn_s = time.lane_turn_s(sweep.column_pitch_m)
        self._halves: dict[Visit, FloatArray] = {}
        self._inner_m: dict[Visit, FloatArray] = {}

    def lanes(self, visit: Visit) -> PieceLanes:
        """Return the lanes of a piece."""
        a, b = self._starts[visit.cell], self._starts[visit.cell + 1]
        if visit.half == 0:
            return PieceLanes(ends_m=self._ends[a:b])
        if visit not in self._halves:
            middle = split_cell(self._sweep.decomposition, visit.cell)
            slices = self._sweep.decomposition.slices
            cells = self._sweep.decomposition.cells
            chain = cells.slice_index[cells.offsets[visit.cell] : cells.offsets[visit.cell + 1]]
            height = np.interp(self._sweep.lane_column[a:b], slices.column[chain], middle)
            for half in (1, 2):
                y = self._sweep.lane_y_m[a:b].copy()
                if half == 1:
                    y[:, 1] = np.minimum(y[:, 1], height)
                else:
                    y[:, 0] = np.maximum(y[:, 0], height)
                kept = y[:, 1] - y[:, 0] > MIN_LANE_M
                x = self._sweep.lane_x_m[a:b]
                ends = np.stack([np.repeat(x[:, None], 2, axis=1), y], axis=2)[kept]
                self._halves[Visit(visit.cell, half)] = self._sweep.frame.to_local(ends)
        return PieceLanes(ends_m=self._halves[visit])

    def costs_s(self, visits: Sequence[Visit]) -> FloatArray:
        """Return (n,) seconds of sweeping each piece by itself: lanes, turns between them."""
        return np.array([self._cost_s(self.lanes(v).ends_m) for v in visits])

    def _cost_s(self, ends_m: FloatArray) -> float:
        if len(ends_m) == 0:
            return 0.0
        length = float(np.hypot(*(ends_m[:, 1] - ends_m[:, 0]).T).sum())
        gaps = float(np.hypot(*np.diff(ends_m.mean(axis=1), axis=0).T).sum())
        return (
            length / self._time.survey_speed_m_s
            + gaps / self._time.transit_speed_m_s
            + (len(ends_m) - 1) * self._turn_s
        )

    def order(self, visits: Sequence[Visit], home_m: FloatArray | None) -> FloatArray:
        """Return (lanes, 2, 2) oriented lanes of a sequence of pieces with the least travel.

        Each piece can be swept forwards or backwards and from the foot or the top of its first
        lane; the best of the 4^n combinations under in-water distances is found by dynamic
        programming over the pieces.

        Parameters
        ----------
        visits
            Pieces in the order in which they are swept.
        home_m
            (2,) where the robot comes from and returns to; None leaves both ends free.
        """
        visits = [v for v in visits if len(self.lanes(v).ends_m)]
        if not visits:
            return np.zeros((0, 2, 2))
        ways = [self._ways(v) for v in visits]
        first = np.array([[w[0, 0] for w in way] for way in ways])
        last = np.array([[w[-1, 1] for w in way] for way in ways])
        inner = self._inner_lengths(visits)
        n = len(visits)
        between = self._distances.pair_distances(
            np.repeat(last[:-1], 4, axis=1).reshape(-1, 2),
            np.tile(first[1:], (1, 4, 1)).reshape(-1, 2),
        ).reshape(n - 1, 4, 4)
        cost = inner[0].copy()
        if home_m is not None:
            cost += self._distances.pair_distances(np.tile(home_m, (4, 1)), first[0])
        choice: IntArray = np.zeros((n, 4), dtype=np.int64)
        for i in range(1, n):
            total = cost[:, None] + between[i - 1]
            choice[i] = np.argmin(total, axis=0)
            cost = total[choice[i], np.arange(4)] + inner[i]
        if home_m is not None:
            cost = cost + self._distances.pair_distances(last[-1], np.tile(home_m, (4, 1)))
        way = int(np.argmin(cost))
        picked = [way]
        for i in range(n - 1, 0, -1):
            way = int(choice[i, way])
            picked.append(way)
        picked.reverse()
        return np.concatenate([ways[i][w] for i, w in enumerate(picked)])

    def _ways(self, visit: Visit) -> list[FloatArray]:
        """Return the four ways to sweep a piece: forwards and backwards, from foot and from top."""
        lanes = self.lanes(visit)
        return [lanes.sweep(back, top) for back in (False, True) for top in (False, True)]

    def _inner_lengths(self, visits: Sequence[Visit]) -> FloatArray:
        """Return (pieces, 4) in-water travel between the lanes of each piece, swept each way.

        The planners that are compared, and the two passes over each tour, ask for the same pieces.
        """
        new = [v for v in dict.fromkeys(visits) if v not in self._inner_m]
        if new:
            a, b, index = [], [], []
            for i, visit in enumerate(new):
                for j, lanes in enumerate(self._ways(visit)):
                    a.append(lanes[:-1, 1])
                    b.append(lanes[1:, 0])
                    index.append(np.full(len(lanes) - 1, 4 * i + j))
            lengths = self._distances.pair_distances(np.concatenate(a), np.concatenate(b))
            total: FloatArray = np.zeros(4 * len(new))
            np.add.at(total, np.concatenate(index), lengths)
            self._inner_m.update(zip(new, total.reshape(-1, 4), strict=True))
        return np.array([self._inner_m[v] for v in visits])

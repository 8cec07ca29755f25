"""Mission items of trips, counted without laying the trips.

A trip makes an item for each leg that ends in a turn, and, where speeds differ, one for each change
between survey and transit. Both are sums over the pairs of legs that follow on each other, so what
lies between two stretches of a tour is a difference of two running sums.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from mrmission.mission.items import KindArray, count_items
from mrmission.model import BoolArray, CoveragePath, FloatArray, LegKind
from mrmission.options import PlanOptions

ITEMS_PER_LINE = 2.0
"""Of its own and for the way to the next, about."""
STRAIGHT = 1e-6
"""Sine of the angle from which on the next leg does not go straight on."""


def turning(path: CoveragePath) -> KindArray:
    """Return the kinds of a path's legs, those that go straight on left out: they are one item."""
    kind = np.asarray(path.kind)
    if len(kind) < 2:
        return kind
    return kind[np.append(~_straight_on(np.diff(path.points_m, axis=0), kind), True)]


def _straight_on(leg: FloatArray, kind: KindArray) -> BoolArray:
    """Return (n - 1,) whether the leg after each of (n, 2) goes on straight, and of its kind."""
    length = np.hypot(leg[:, 0], leg[:, 1])
    cross = leg[:-1, 0] * leg[1:, 1] - leg[:-1, 1] * leg[1:, 0]
    straight: BoolArray = np.abs(cross) < STRAIGHT * length[:-1] * length[1:]
    straight &= (leg[:-1] * leg[1:]).sum(axis=1) > 0
    straight &= kind[:-1] == kind[1:]
    return straight


class ItemCounts:
    """Counts the items of trips over stretches of a tour.

    Parameters
    ----------
    lines_m
        The stretches, (m, 2) each.
    ways_m
        The ways from each to the next.
    out_m, back_m
        Ways from home by the stretch they lead to, and to home by the stretch they come from.
    """

    def __init__(
        self,
        lines_m: Sequence[FloatArray],
        ways_m: Sequence[FloatArray],
        out_m: Mapping[int, FloatArray],
        back_m: Mapping[int, FloatArray],
    ) -> None:
        pieces = [piece for pair in zip(lines_m, ways_m, strict=False) for piece in pair]
        pieces += lines_m[len(ways_m) :]
        legs = [_legs(piece) for piece in pieces]
        sizes = np.array([len(own) for own in legs], dtype=np.int64)
        survey = np.arange(len(legs)) % 2 == 0
        kind = np.repeat(np.where(survey, int(LegKind.SURVEY), int(LegKind.TRANSIT)), sizes)
        straight = _straight_on(np.concatenate(legs), kind.astype(np.int8))
        end = np.cumsum(sizes)
        self._first: list[int] = (end - sizes)[survey].tolist()
        self._end: list[int] = end[survey].tolist()
        self._straight: list[int] = np.concatenate([[0], np.cumsum(straight)]).tolist()
        changes = np.cumsum(kind[1:] != kind[:-1])
        self._changes: list[int] = np.concatenate([[0], changes]).tolist()
        self._out = {i: _items_of_way(way) for i, way in out_m.items()}
        self._back = {i: _items_of_way(way) for i, way in back_m.items()}

    def count(self, first: int, end: int, options: PlanOptions) -> int:
        """Return the items of the trip over stretches from `first` to before `end`.

        Parameters
        ----------
        first, end
            Of the stretches.
        options
            Vehicle and speeds; without a camera.
        """
        a, b = self._first[first], self._end[end - 1]
        out, back = self._out[first], self._back[end - 1]
        legs = b - a - (self._straight[b - 1] - self._straight[a]) + out + back
        changes = self._changes[b - 1] - self._changes[a] + (out > 0) + (back > 0)
        # of one leg: what a mission has beside its legs and its changes of speed
        rest = count_items(_ONE_LEG, options) - 1
        return (
            rest + legs + (changes if options.survey_speed_m_s != options.transit_speed_m_s else 0)
        )


_ONE_LEG: KindArray = np.array([int(LegKind.SURVEY)], dtype=np.int8)


def _legs(line_m: FloatArray) -> FloatArray:
    """Return (n, 2) the legs of a polyline that have a length."""
    leg = np.diff(line_m, axis=0)
    return leg[np.any(leg != 0, axis=1)]


def _items_of_way(way_m: FloatArray) -> int:
    """Return how many items a transit from or to home makes."""
    leg = _legs(way_m)
    if len(leg) < 2:
        return len(leg)
    same = np.zeros(len(leg), dtype=np.int8)
    return len(leg) - int(np.count_nonzero(_straight_on(leg, same)))

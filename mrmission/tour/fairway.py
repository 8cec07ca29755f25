"""The fairway: lanes across the others through the start, swept on the way out and home.

Where all lanes lie one way, a boat whose lanes are far aside of the start travels there and back
across them and sweeps nothing new. The fairway turns that travel into survey: a strip of lanes at
right angles to the others, which end at it. A robot goes out along one lane of the fairway, sweeps
lanes beside it, and comes home along another.

How wide it is worth being follows from who passes: with `k` robots that share the water evenly,
``k A(x) / A`` of them have their work farther aside than ``x``, where ``A(x)`` is the area beyond
and ``A`` all of it. Each passes twice, so ``2 k A(x) / A`` lanes are swept on the way, and no more.
The fairway is widest at the start and tapers off; it follows the water and ends where the water
does.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import shapely

from mrmission.decomposition.slices import lane_intervals
from mrmission.model import FloatArray, IntArray
from mrmission.tour.lines import LineKind, SurveyLine, lane_names, row_names
from mrmission.tour.sweep import ROWS_PER_COLUMN, Sweep, SweepFrame, columns_of

NARROWEST = 2
"""Fewer rows are no way out and home."""
SLIM = 4
"""What would be left between the fairway and the shore, this many rows or less, is its own."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Columns:
    """A region under one bearing: the columns in whose middles its lanes lie.

    Attributes
    ----------
    frame
        The sweep frame.
    region
        In the sweep frame.
    x_m
        (columns,) where lanes lie across.
    pitch_m
        How far they lie from each other.
    """

    frame: SweepFrame
    region: shapely.Polygon
    x_m: FloatArray
    pitch_m: float

    @classmethod
    def of(cls, sweep: Sweep) -> Columns:
        """Return those of a sweep."""
        return cls(
            frame=sweep.frame,
            region=sweep.region,
            x_m=sweep.column_x_m,
            pitch_m=sweep.column_pitch_m,
        )

    @property
    def shortest_m(self) -> float:
        """Return the length below which a piece of a lane is none."""
        return self.pitch_m / ROWS_PER_COLUMN


@dataclass(frozen=True, slots=True, kw_only=True)
class Fairway:
    """Which part of each column of a sweep is swept across.

    Attributes
    ----------
    border_m
        (rows + 1,) where rows begin and end along the lanes, sweep frame, rising.
    first, stop
        (columns,) the rows ``first[c]`` to ``stop[c]``, the latter not included, of column ``c``
        are the fairway's; none where both are the same.
    """

    border_m: FloatArray
    first: IntArray
    stop: IntArray


def fairway_of(columns: Columns, start_m: FloatArray, robots: int) -> Fairway | None:
    """Return the fairway of a region through a start; None where none is worth it.

    Parameters
    ----------
    columns
        The region under the bearing of its lanes.
    start_m
        (2,) where the robots start, local frame.
    robots
        How many share the region.
    """
    many, pitch_m = len(columns.x_m), columns.pitch_m
    start_x, start_y = columns.frame.to_sweep(start_m).tolist()
    row_y, height_m = columns_of(_across(columns.region), pitch_m)
    border = np.append(row_y - height_m / 2, row_y[-1] + height_m / 2)
    column, low, high = lane_intervals(columns.region, columns.x_m)
    own = int(np.clip(np.floor((start_x - columns.x_m[0]) / pitch_m + 0.5), 0, many - 1))
    length_m = np.zeros(many)
    np.add.at(length_m, column, high - low)
    worth = _worth(length_m, own, robots)
    water = np.split(np.column_stack([low, high]), np.searchsorted(column, np.arange(1, many)))
    first, stop = np.zeros(many, dtype=np.int64), np.zeros(many, dtype=np.int64)
    reach = (start_y - 1.5 * height_m, start_y + 1.5 * height_m)
    rows = _fitted(water[own], reach, int(worth[own]), border)
    if rows is None:
        return None
    first[own], stop[own] = rows
    for side in (range(own + 1, many), range(own - 1, -1, -1)):
        last = rows
        for c in side:
            found = _fitted(water[c], (border[last[0]], border[last[1]]), int(worth[c]), border)
            if found is None:
                break
            first[c], stop[c] = last = found
    return Fairway(border_m=border, first=first, stop=stop)


def _across(region: shapely.Polygon) -> shapely.Polygon:
    """Return a region of the sweep frame with its axes exchanged: rows stand upright."""
    return shapely.transform(region, lambda xy: xy[:, ::-1])


def _worth(length_m: FloatArray, own: int, robots: int) -> FloatArray:
    """Return (columns,) how many rows are swept in passing, by what lies beyond each column."""
    share = length_m / length_m.sum()
    beyond = np.cumsum(share[::-1])[::-1] - share
    beyond[:own] = (np.cumsum(share) - share)[:own]
    beyond[own] = beyond[max(own - 1, 0) : own + 2].max()
    return np.round(2 * robots * beyond)


def _fitted(
    water: FloatArray, near: tuple[float, float], rows: int, border: FloatArray
) -> tuple[int, int] | None:
    """Return about so many rows of one column's water that go on from `near`; None for none."""
    if rows < NARROWEST or len(water) == 0:
        return None
    shared = np.minimum(water[:, 1], near[1]) - np.maximum(water[:, 0], near[0])
    best = int(np.argmax(shared))
    if shared[best] <= 0:
        return None
    half = 0.5 * (border[1] - border[0])
    lowest = int(np.searchsorted(border, water[best, 0] + half, side="right")) - 1
    highest = int(np.searchsorted(border, water[best, 1] - half, side="left"))
    lowest, highest = max(lowest, 0), min(highest, len(border) - 1)
    middle = (0.5 * (near[0] + near[1]) - border[0]) / (2 * half)
    first = max(min(round(middle - rows / 2), highest - rows), lowest)
    stop = min(first + rows, highest)
    first = lowest if first - lowest <= SLIM else first
    stop = highest if highest - stop <= SLIM else stop
    return (first, stop) if stop - first >= NARROWEST else None


def beside_fairway(
    columns: Columns, fairway: Fairway, column: IntArray, low_m: FloatArray, high_m: FloatArray
) -> tuple[IntArray, FloatArray, FloatArray]:
    """Return what of lanes lies beside the fairway: which lane, from where, to where.

    Parameters
    ----------
    columns, fairway
        The fairway, and what it lies in.
    column, low_m, high_m
        (n,) column and ends of each lane, sweep frame.
    """
    below, above = fairway.border_m[fairway.first[column]], fairway.border_m[fairway.stop[column]]
    apart = (below == above) | (high_m <= below) | (low_m >= above)
    of_lane = np.repeat(np.arange(len(column)), 2)
    low = np.column_stack([low_m, np.where(apart, high_m, np.maximum(low_m, above))]).ravel()
    high = np.column_stack([np.where(apart, high_m, np.minimum(high_m, below)), high_m]).ravel()
    kept = high - low > columns.shortest_m
    return of_lane[kept], low[kept], high[kept]


def fairway_rows(columns: Columns, fairway: Fairway) -> tuple[IntArray, FloatArray]:
    """Return the lanes of the fairway: the row (n,) of each, and (n, 2, 2) ends, sweep frame."""
    used = fairway.stop > fairway.first
    numbers = np.arange(fairway.first[used].min(), fairway.stop[used].max())
    y = 0.5 * (fairway.border_m[numbers] + fairway.border_m[numbers + 1])
    row, low, high = lane_intervals(_across(columns.region), y)
    half = columns.pitch_m / 2
    out = []
    for i, number in enumerate(numbers.tolist()):
        inside = (fairway.first <= number) & (number < fairway.stop)
        turns = np.flatnonzero(np.diff(np.concatenate([[False], inside, [False]])))
        for c, d in zip(turns[::2].tolist(), turns[1::2].tolist(), strict=True):
            a = np.maximum(low[row == i], columns.x_m[c] - half)
            b = np.minimum(high[row == i], columns.x_m[d - 1] + half)
            out += [(i, x, z) for x, z in zip(a.tolist(), b.tolist(), strict=True)]
    found = sorted((i, a, b) for i, a, b in out if b - a > columns.shortest_m)
    rows = np.array([i for i, _, _ in found], dtype=np.int64)
    x = np.array([(a, b) for _, a, b in found], dtype=np.float64).reshape(-1, 2)
    return rows, np.stack([x, np.repeat(y[rows][:, None], 2, axis=1)], axis=2)


def lanes_with_fairway(sweep: Sweep, fairway: Fairway) -> tuple[SurveyLine, ...]:
    """Return the lanes of a sweep, which end at the fairway, and the lanes of the fairway.

    Lanes are numbered as :func:`~mrmission.tour.lines.lane_lines` does it; those of the fairway
    are F1, F2, … along the bearing, and F1a, F1b, … where land or the taper interrupts them.
    """
    columns = Columns.of(sweep)
    of_lane, low, high = beside_fairway(
        columns, fairway, sweep.lane_column, sweep.lane_y_m[:, 0], sweep.lane_y_m[:, 1]
    )
    column = sweep.lane_column[of_lane]
    names = lane_names(sweep.frame.bearing_deg, len(sweep.column_x_m), column, low)
    x = sweep.column_x_m[column]
    ends = np.stack([np.column_stack([x, low]), np.column_stack([x, high])], axis=1)
    rows, row_ends = fairway_rows(columns, fairway)
    ways = sweep.frame.to_local(np.concatenate([ends, row_ends]))
    kinds = [LineKind.LANE] * len(column) + [LineKind.FAIRWAY] * len(rows)
    return tuple(
        SurveyLine(points_m=way, kind=kind, name=name)
        for way, kind, name in zip(ways, kinds, [*names, *row_names("F", rows + 1)], strict=True)
    )

"""What lanes leave uncovered at the shore, estimated from where lanes and water end.

A quick look for ranking bearings: the shore is looked at where a lane lies and at both borders of
its column. Where water goes on beside the end of a lane, a sliver is left there that a boat has to
go out for, unless its next lane is the one on that side. What is to be covered is found exactly
later, once, by :mod:`mrmission.minmax.hooks`.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import shapely

from mrmission.decomposition.slices import lane_intervals
from mrmission.model import FloatArray, IntArray
from mrmission.tour.sweep import ROWS_PER_COLUMN

BORDER = 0.499
"""The water is looked at so many column widths to both sides of each lane."""
SMALLEST = 0.01
"""A sliver whose far corner lies so many half swaths beyond the footprint, or less, may be left."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Lanes:
    """Lanes of a bearing in the sweep frame, and how far from their ends slivers reach.

    Attributes
    ----------
    x_m
        (n,) where each lane lies across.
    y_m
        (n, 2) where it begins and ends.
    out_m
        (n, 2, 2) by lane, end and side (smaller x first): how far out of its way a boat goes to
        cover what is left beside the end; 0 where nothing is.
    alone_m
        Length of what no lane is beside, to be swept by lines of its own.
    """

    x_m: FloatArray
    y_m: FloatArray
    out_m: FloatArray
    alone_m: float


def look(region: shapely.Polygon, column_x_m: FloatArray, pitch_m: float) -> Lanes:
    """Return the lanes of a region (sweep frame) in columns, and the slivers they leave."""
    column, low, high = lane_intervals(region, column_x_m)
    kept = high - low > pitch_m / ROWS_PER_COLUMN
    column, low, high = column[kept], low[kept], high[kept]
    out_m = np.zeros((len(low), 2, 2))
    alone_m = 0.0
    for side, offset in enumerate((-BORDER * pitch_m, BORDER * pitch_m)):
        beside, foot, top = lane_intervals(region, column_x_m + offset)
        above = _beyond(column, low, high, beside, foot, top)
        below = _beyond(column, -high, -low, beside, -top, -foot)
        for end, gap_m in enumerate((below, above)):
            far_m = np.hypot(offset, gap_m) - 0.5 * pitch_m
            out_m[:, end, side] = np.where(far_m > 0.5 * SMALLEST * pitch_m, far_m, 0.0)
        alone_m += 0.5 * float((top - foot)[_alone(column, low, high, beside, foot, top)].sum())
    return Lanes(x_m=column_x_m[column], y_m=np.column_stack([low, high]), out_m=out_m,
                 alone_m=alone_m)  # fmt: skip


def _extent(
    low: FloatArray, high: FloatArray, foot: FloatArray, top: FloatArray
) -> tuple[float, float]:
    """Return the lowest height of lanes and water, and a little more than their span."""
    y_min = min(float(low.min()), float(foot.min(initial=np.inf)))
    return y_min, max(float(high.max()), float(top.max(initial=-np.inf))) - y_min + 1.0


def _keys(column: IntArray, y_m: FloatArray, low_m: float, span_m: float) -> FloatArray:
    """Return numbers that rise with the column first, then with the height."""
    return column * (2.0 * span_m) + (y_m - low_m)


def _beyond(
    column: IntArray,
    low: FloatArray,
    high: FloatArray,
    beside: IntArray,
    foot: FloatArray,
    top: FloatArray,
) -> FloatArray:
    """Return (lanes,) how far water goes on above each lane's upper end in the lines beside it.

    Half of what lies between two lanes of a column belongs to each of them.
    """
    if len(low) == 0 or len(foot) == 0:
        return np.zeros(len(low))
    y_min, span = _extent(low, high, foot, top)
    order = np.lexsort((foot, beside))
    index = np.searchsorted(
        _keys(beside[order], foot[order], y_min, span), _keys(column, high, y_min, span), "right"
    )
    at = order[np.maximum(index - 1, 0)]
    touches = (index > 0) & (beside[at] == column) & (top[at] > high)
    lanes = np.lexsort((low, column))
    room = np.full(len(low), np.inf)
    same = column[lanes[1:]] == column[lanes[:-1]]
    between = np.where(same, 0.5 * (low[lanes[1:]] - high[lanes[:-1]]), np.inf)
    room[lanes[:-1]] = between
    return np.where(touches, np.minimum(top[at] - high, room), 0.0)


def _alone(
    column: IntArray,
    low: FloatArray,
    high: FloatArray,
    beside: IntArray,
    foot: FloatArray,
    top: FloatArray,
) -> np.ndarray:
    """Return (intervals,) which pieces of water have no lane of their column beside them."""
    if len(low) == 0:
        return np.ones(len(foot), dtype=bool)
    y_min, span = _extent(low, high, foot, top)
    index = np.searchsorted(
        _keys(column, low, y_min, span), _keys(beside, top, y_min, span), "left"
    )
    at = np.maximum(index - 1, 0)
    meets = (index > 0) & (column[at] == beside) & (high[at] > foot)
    return ~meets

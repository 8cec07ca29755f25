"""Which tour leaves from which start: the longest trip as short as can be."""

from __future__ import annotations

import numpy as np

from mrmission.model import FloatArray, IntArray


def bottleneck_assignment(cost: FloatArray) -> IntArray:
    """Return the column of each row so that the largest chosen cost is least.

    Rows and columns are equally many. Among assignments with that bottleneck, each row takes the
    cheapest column still open to it, dearest rows first.

    Parameters
    ----------
    cost
        (n, n) finite costs.

    Returns
    -------
    (n,) the column of each row, a permutation.

    Examples
    --------
    >>> bottleneck_assignment(np.array([[1.0, 9.0], [2.0, 3.0]])).tolist()
    [0, 1]
    """
    levels = np.unique(cost)
    low, high = 0, len(levels) - 1
    while low < high:
        middle = (low + high) // 2
        if _match(cost, float(levels[middle])) is None:
            low = middle + 1
        else:
            high = middle
    matched = _match(cost, float(levels[low]))
    assert matched is not None  # the largest level admits every pair
    return matched


def _match(cost: FloatArray, level: float) -> IntArray | None:
    """Return a perfect matching over the pairs that cost at most `level` (augmenting paths)."""
    n = len(cost)
    order = [sorted(np.flatnonzero(row <= level).tolist(), key=row.__getitem__) for row in cost]
    row_of = [-1] * n

    def place(row: int, tried: set[int]) -> bool:
        for column in order[row]:
            if row_of[column] < 0:
                row_of[column] = row
                return True
        # none is open: another row must make room
        for column in order[row]:
            if column not in tried:
                tried.add(column)
                if place(row_of[column], tried):
                    row_of[column] = row
                    return True
        return False

    for row in np.argsort(-cost.min(axis=1), kind="stable").tolist():
        if not place(row, set()):
            return None
    out = np.empty(n, dtype=np.int64)
    out[np.array(row_of)] = np.arange(n)
    return out

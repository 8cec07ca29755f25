"""The nearest few ends of each end, ties broken by their numbers.

Among lanes of one pitch many ends are equally far. numpy's partition takes any of them, others on
another processor; here it is those of lower number.
"""

from __future__ import annotations

import numpy as np
from numba import njit

from mrmission.model import FloatArray, IntArray


def nearest_ends(away: FloatArray, count: int) -> IntArray:
    """Return (ends, count) nearest ends of other lines, nearest first.

    Parameters
    ----------
    away
        (ends, ends) how far ends are from each other; ends ``2i`` and ``2i + 1`` are of one line.
    count
        How many; no more than there are of other lines are returned.

    Examples
    --------
    >>> nearest_ends(np.array([[0, 9, 5, 5], [9, 0, 7, 6], [5, 7, 0, 9], [5, 6, 9, 0]]), 1).ravel()
    array([2, 3, 0, 0])
    """
    few = max(0, min(count, len(away) - 2))
    out: IntArray = _nearest(np.ascontiguousarray(away, dtype=np.float64), few)
    return out


@njit(cache=True)
def _nearest(away, count):  # type: ignore[no-untyped-def]
    """See :func:`nearest_ends`: the best so far are kept in order."""
    n = len(away)
    out = np.empty((n, count), np.int64)
    best = np.empty(count)
    for e in range(n if count else 0):
        filled = 0
        for f in range(n):
            value = away[e, f]
            if (f >> 1) == (e >> 1) or (filled == count and not value < best[count - 1]):
                continue
            place = min(filled, count - 1)
            filled = min(filled + 1, count)
            while place > 0 and best[place - 1] > value:
                best[place] = best[place - 1]
                out[e, place] = out[e, place - 1]
                place -= 1
            best[place] = value
            out[e, place] = f
    return out

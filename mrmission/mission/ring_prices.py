"""Compiled prices of fence edges: the land between an edge and the axis, less the water there.

The shore lies in upright strips, so that only its edges above and below a fence edge are looked at.
"""

from __future__ import annotations

import numpy as np
from numba import njit

from mrmission.model import FloatArray, IntArray


@njit(cache=True, error_model="numpy", no_cpython_wrapper=True)
def strips(shore: FloatArray, count: int) -> tuple[FloatArray, IntArray, FloatArray]:
    """Cut the shore's edges into `count` upright strips of equal width.

    Returns the pieces (x0, x1, y at x0, slope, +1 below water or -1 above it) strip by strip, where
    each strip starts, and [x of the first strip, width].
    """
    low, high = np.inf, -np.inf
    for i in range(len(shore)):
        low, high = min(low, shore[i, 0]), max(high, shore[i, 0])
    width = max((high - low) / count, 1e-9)
    start = np.zeros(count + 2, np.int64)
    piece = np.zeros((0, 5))
    for fill in range(2):
        for i in range(len(shore)):
            ax, ay, bx, by = shore[i, 0], shore[i, 1], shore[i, 2], shore[i, 3]
            if ax == bx:
                continue
            slope = (by - ay) / (bx - ax)
            x0, x1 = min(ax, bx), max(ax, bx)
            first = min(count - 1, max(0, int((x0 - low) / width)))
            last = min(count - 1, max(0, int((x1 - low) / width)))
            for s in range(first, last + 1):
                if fill == 0:
                    start[s + 2] += 1
                    continue
                k = start[s + 1]
                start[s + 1] += 1
                a = x0 if s == first else low + s * width
                b = x1 if s == last else low + (s + 1) * width
                piece[k, 0], piece[k, 1] = a, b
                piece[k, 2], piece[k, 3] = ay + slope * (a - ax), slope
                piece[k, 4] = 1.0 if bx > ax else -1.0
        if fill == 0:
            start = np.cumsum(start)
            piece = np.zeros((start[-1], 5))
    return piece, start, np.array([low, width])


@njit(cache=True, error_model="numpy", no_cpython_wrapper=True)
def price_of(
    ax: float, ay: float, bx: float, by: float,
    piece: FloatArray, start: IntArray, strip: FloatArray, water_weight: float,
) -> float:  # fmt: skip
    """Return an edge's share of the land on the left of its ring, less a trifle for the water."""
    area = 0.5 * (ax * by - bx * ay)
    if ax == bx:
        return area
    x0, x1 = min(ax, bx), max(ax, bx)
    slope = (by - ay) / (bx - ax)
    count = len(start) - 2
    first = min(count - 1.0, max(0.0, (x0 - strip[0]) / strip[1]))
    last = min(count - 1.0, max(0.0, (x1 - strip[0]) / strip[1]))
    water = 0.0
    for k in range(start[int(first)], start[int(last) + 1]):
        a, b = max(x0, piece[k, 0]), min(x1, piece[k, 1])
        if a >= b:
            continue
        d0 = ay + slope * (a - ax) - piece[k, 2] - piece[k, 3] * (a - piece[k, 0])
        d1 = d0 + (slope - piece[k, 3]) * (b - a)
        if d0 <= 0.0 and d1 <= 0.0:
            continue
        if d0 >= 0.0 and d1 >= 0.0:
            part = 0.5 * (d0 + d1) * (b - a)
        else:
            top = max(d0, d1)
            part = 0.5 * top * top / abs(d1 - d0) * (b - a)
        water += piece[k, 4] * part
    # the area under an edge to the axis: trapezoids and the shoelace differ by a closed sum
    return area + (1.0 + water_weight) * (water if bx > ax else -water)

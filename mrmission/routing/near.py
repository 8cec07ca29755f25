"""Compiled kernel for in-water lengths to all points within a distance, for many points.

The helpers are those of :mod:`mrmission.routing.visibility`. numba's cache of a kernel looks only
at the kernel's own file: after a change of a helper there, touch this file as well.
"""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt
from numba import njit

from mrmission.routing.shore_grid import Float, Grid, Int
from mrmission.routing.visibility import (
    Graph,
    _clear,
    _longer_float,
    _longer_int,
    _onward,
    _pop,
    _push,
    _tangent,
)

Long = npt.NDArray[np.int64]
Squares = tuple[Float, Long, Long, Long]
"""``(frame, shape, start, item)``: points sorted into squares; frame: west, south, side."""


def sort_into_squares(points: Float, each: float) -> Squares:
    """Return points sorted into equal squares that hold about `each` points."""
    low = points.min(axis=0) if len(points) else np.zeros(2)
    span = np.maximum(points.max(axis=0) - low, 1e-3) if len(points) else np.ones(2)
    # Points lie along shores: most squares of a grid are empty.
    side = max(
        float(np.sqrt(span[0] * span[1] * each / (len(points) + 1))), float(span.max()) / 4e3
    )
    shape = (span / side).astype(np.int64) + 1
    cell = ((points - low) / side).astype(np.int64)
    flat = cell[:, 0] * shape[1] + cell[:, 1]
    order = np.argsort(flat, kind="stable").astype(np.int64)
    start = np.searchsorted(flat[order], np.arange(shape[0] * shape[1] + 1)).astype(np.int64)
    return np.array([low[0], low[1], side]), shape, start, order


@njit(cache=True, error_model="numpy")
def _within(squares: Squares, points: Float, x: float, y: float, reach: float, out: Long) -> int:
    """Write the points no farther than `reach` from (x, y) into `out`; return how many."""
    frame, shape, start, item = squares
    count = 0
    c1 = max(0, int((x - reach - frame[0]) / frame[2]))
    c2 = min(shape[0] - 1, int((x + reach - frame[0]) / frame[2]))
    r1 = max(0, int((y - reach - frame[1]) / frame[2]))
    r2 = min(shape[1] - 1, int((y + reach - frame[1]) / frame[2]))
    for c in range(c1, c2 + 1):
        for k in range(start[c * shape[1] + r1], start[c * shape[1] + r2 + 1]):
            p = item[k]
            if math.hypot(points[p, 0] - x, points[p, 1] - y) <= reach:
                out[count] = p
                count += 1
    return count


@njit(cache=True, error_model="numpy")
def lengths_within(
    grid: Grid,
    graph: Graph,
    points: Float,
    squares: Squares,
    corner_squares: Squares,
    least: int,
    reach: Float,
    top: float,
) -> tuple[Long, Int, Float]:
    """Return, as CSR, the points within `reach` of each point in the water, and how far they are.

    A reach is made longer, in place, until it holds `least` other points or is `top`.
    """
    node, before, after, land, _, start, neighbour, hug, length, onward = graph
    n = len(node)
    bounds = np.zeros(len(points) + 1, np.int64)
    other = np.empty(64 * len(points) + 64, np.int32)
    away = np.empty(64 * len(points) + 64)
    filled = 0
    label = np.full(n, math.inf)
    via = np.empty(n, np.int32)
    touched = np.empty(n, np.int32)
    key = np.empty(len(neighbour) + n)
    what = np.empty(len(neighbour) + n, np.int32)
    key_t = np.empty(n + 1)
    what_t = np.empty(n + 1, np.int32)
    candidate = np.empty(max(n, len(points)) + 1, np.int64)
    for s in range(len(points)):
        sx, sy = points[s, 0], points[s, 1]
        while True:
            limit = reach[s]
            count = 0
            touches = 0
            many = _within(corner_squares, node, sx, sy, limit, candidate)
            for i in range(many):
                v = candidate[i]
                x, y = node[v, 0], node[v, 1]
                if _tangent(
                    x, y, before[v, 0], before[v, 1], after[v, 0], after[v, 1], sx, sy
                ) and _clear(grid, sx, sy, x, y):
                    label[v] = math.hypot(x - sx, y - sy)
                    via[v] = -1
                    touched[touches] = v
                    touches += 1
                    count = _push(key, what, count, label[v], v)
            while count > 0:
                v = what[0]
                now = key[0]
                count = _pop(key, what, count)
                if now > label[v]:
                    continue
                if via[v] < 0:
                    first, stop = _onward(start, hug, land, v, node[v, 0] - sx, node[v, 1] - sy)
                else:
                    first, stop = onward[via[v], 0], onward[via[v], 1]
                for k in range(first, stop):
                    w = neighbour[k]
                    reached = now + length[k]
                    if reached < label[w] and reached <= limit:
                        if label[w] == math.inf:
                            touched[touches] = w
                            touches += 1
                        label[w] = reached
                        via[w] = k
                        count = _push(key, what, count, reached, w)
            many = _within(squares, points, sx, sy, limit, candidate)
            found = filled
            if found + many > len(other):
                other = _longer_int(other, 2 * (found + many))
                away = _longer_float(away, 2 * (found + many))
            for i in range(many):
                t = candidate[i]
                if t == s:
                    continue
                tx, ty = points[t, 0], points[t, 1]
                best = math.inf
                straight = math.hypot(tx - sx, ty - sy)
                if straight == 0.0 or _clear(grid, sx, sy, tx, ty):
                    best = straight
                else:
                    heap = 0
                    for j in range(touches):
                        v = touched[j]
                        way = label[v] + math.hypot(node[v, 0] - tx, node[v, 1] - ty)
                        if way <= limit:
                            heap = _push(key_t, what_t, heap, way, v)
                    while heap > 0:
                        v = what_t[0]
                        x, y = node[v, 0], node[v, 1]
                        if _tangent(
                            x, y, before[v, 0], before[v, 1], after[v, 0], after[v, 1], tx, ty
                        ) and _clear(grid, x, y, tx, ty):
                            best = key_t[0]
                            break
                        heap = _pop(key_t, what_t, heap)
                if best <= limit:
                    other[found] = t
                    away[found] = best
                    found += 1
            for j in range(touches):
                label[touched[j]] = math.inf
            if found - filled >= least or limit >= top:
                filled = found
                break
            reach[s] = min(top, 1.6 * limit)
        bounds[s + 1] = filled
    return bounds, _longer_int(other, filled), _longer_float(away, filled)

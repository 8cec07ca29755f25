"""Compiled geometry of fence edges: whether they meet, come near, or pass what they must not.

What must not be passed is given as segments, looked up in a grid of squares: ``grid`` is
[x and y of its corner, size of a square, columns, rows], ``start`` and ``item`` say which segments
pass through each square.
"""

from __future__ import annotations

import math

import numpy as np
from numba import njit

from mrmission.model import FloatArray, IntArray

APART_M = 0.05
"""Fence edges that share no vertex keep this distance, so that rounding never makes them meet."""


@njit(cache=True, error_model="numpy", no_cpython_wrapper=True)
def cross(ax: float, ay: float, bx: float, by: float, cx: float, cy: float) -> float:
    """Return twice the area of the triangle abc, positive where it turns left."""
    return (bx - ax) * (cy - ay) - (by - ay) * (cx - ax)


@njit(cache=True, error_model="numpy", no_cpython_wrapper=True)
def meet(
    ax: float, ay: float, bx: float, by: float, cx: float, cy: float, dx: float, dy: float
) -> bool:
    """Whether the closed segments ab and cd have a point in common."""
    if max(ax, bx) < min(cx, dx) or max(cx, dx) < min(ax, bx):
        return False
    if max(ay, by) < min(cy, dy) or max(cy, dy) < min(ay, by):
        return False
    s, t = cross(ax, ay, bx, by, cx, cy), cross(ax, ay, bx, by, dx, dy)
    if (s > 0 and t > 0) or (s < 0 and t < 0):
        return False
    u, v = cross(cx, cy, dx, dy, ax, ay), cross(cx, cy, dx, dy, bx, by)
    return not ((u > 0 and v > 0) or (u < 0 and v < 0))


@njit(cache=True, error_model="numpy", no_cpython_wrapper=True)
def distance2(px: float, py: float, ax: float, ay: float, bx: float, by: float) -> float:
    """Return the square of the distance of a point from the segment ab."""
    dx, dy = bx - ax, by - ay
    length2 = dx * dx + dy * dy
    t = 0.0
    if length2 > 0.0:
        t = min(1.0, max(0.0, ((px - ax) * dx + (py - ay) * dy) / length2))
    ex, ey = ax + t * dx - px, ay + t * dy - py
    return ex * ex + ey * ey


@njit(cache=True, error_model="numpy", no_cpython_wrapper=True)
def near(
    ax: float, ay: float, bx: float, by: float, cx: float, cy: float, dx: float, dy: float
) -> bool:
    """Whether the segments ab and cd come nearer than APART_M."""
    r = APART_M
    if max(ax, bx) + r < min(cx, dx) or max(cx, dx) + r < min(ax, bx):
        return False
    if max(ay, by) + r < min(cy, dy) or max(cy, dy) + r < min(ay, by):
        return False
    return (
        meet(ax, ay, bx, by, cx, cy, dx, dy)
        or distance2(ax, ay, cx, cy, dx, dy) < r * r
        or distance2(bx, by, cx, cy, dx, dy) < r * r
        or distance2(cx, cy, ax, ay, bx, by) < r * r
        or distance2(dx, dy, ax, ay, bx, by) < r * r
    )


@njit(cache=True, error_model="numpy", no_cpython_wrapper=True)
def _columns(
    ax: float, ay: float, bx: float, by: float, grid: FloatArray, row: int
) -> tuple[int, int]:
    """Return the first and last column that a segment passes in a row of the grid, a hair more."""
    x0, y0, size, nx = grid[0], grid[1], grid[2], grid[3]
    low, high = y0 + (row - 1e-6) * size, y0 + (row + 1 + 1e-6) * size
    xa, xb = ax, bx
    if ay != by:
        t, u = (low - ay) / (by - ay), (high - ay) / (by - ay)
        if t > u:
            t, u = u, t
        t, u = max(0.0, t), min(1.0, u)
        xa, xb = ax + t * (bx - ax), ax + u * (bx - ax)
    if xa > xb:
        xa, xb = xb, xa
    first = math.floor((xa - x0) / size - 1e-6)
    last = math.floor((xb - x0) / size + 1e-6)
    return int(max(0.0, first)), int(min(nx - 1.0, last))


@njit(cache=True, error_model="numpy", no_cpython_wrapper=True)
def _rows(ay: float, by: float, grid: FloatArray) -> tuple[int, int]:
    """Return the first and last row of the grid that a segment passes, a hair more."""
    y0, size, ny = grid[1], grid[2], grid[4]
    first = math.floor((min(ay, by) - y0) / size - 1e-6)
    last = math.floor((max(ay, by) - y0) / size + 1e-6)
    return int(max(0.0, first)), int(min(ny - 1.0, last))


@njit(cache=True, error_model="numpy", no_cpython_wrapper=True)
def cells_of(walls: FloatArray, grid: FloatArray) -> tuple[IntArray, IntArray]:
    """Return, cell by cell, which segments pass through it."""
    columns = int(grid[3])
    start = np.zeros(columns * int(grid[4]) + 1, np.int64)
    item = np.zeros(0, np.int64)
    for fill in range(2):
        for i in range(len(walls)):
            ax, ay, bx, by = walls[i, 0], walls[i, 1], walls[i, 2], walls[i, 3]
            low, high = _rows(ay, by, grid)
            for row in range(low, high + 1):
                first, last = _columns(ax, ay, bx, by, grid, row)
                for cell in range(row * columns + first, row * columns + last + 1):
                    if fill == 0:
                        start[cell] += 1
                    else:
                        # filled from the back: in the end start[cell] is the cell's first
                        start[cell] -= 1
                        item[start[cell]] = i
        if fill == 0:
            start = np.cumsum(start)
            item = np.zeros(start[-1], np.int64)
    return start, item


@njit(cache=True, error_model="numpy", no_cpython_wrapper=True)
def free(
    ax: float, ay: float, bx: float, by: float,
    walls: FloatArray, start: IntArray, item: IntArray, grid: FloatArray,
) -> bool:  # fmt: skip
    """Whether the segment ab meets none of the walls."""
    columns = int(grid[3])
    low, high = _rows(ay, by, grid)
    for row in range(low, high + 1):
        first, last = _columns(ax, ay, bx, by, grid, row)
        for cell in range(row * columns + first, row * columns + last + 1):
            for k in range(start[cell], start[cell + 1]):
                i = item[k]
                if meet(ax, ay, bx, by, walls[i, 0], walls[i, 1], walls[i, 2], walls[i, 3]):
                    return False
    return True

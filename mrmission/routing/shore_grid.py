"""Compiled kernels on the shore's edges: sort them into a uniform grid, bring points to the shore.

Kernels that call each other live in one file, because numba's cache of a kernel looks only at the
kernel's own file to see whether it is out of date.
"""

from __future__ import annotations

import math
from typing import Any, TypeAlias

import numpy as np
import numpy.typing as npt
from numba import njit

Float: TypeAlias = npt.NDArray[np.float64]
Int: TypeAlias = npt.NDArray[np.int32]
Byte: TypeAlias = npt.NDArray[np.uint8]

Grid: TypeAlias = tuple[Float, Int, Int, Int, Int, Byte, Float, Float]
"""``(frame, shape, start, item, leap, inside, shrunk, shore)``.

frame: origin x, origin y, cell size; shape: columns, rows; ``item[start[c]:start[c + 1]]`` are the
edges near cell c (c = column * rows + row); leap: chessboard distance to the next cell with edges;
inside: is the cell's centre in the water; shrunk, shore: (n, 4) edges x1, y1, x2, y2.
"""


@njit(cache=True, error_model="numpy")
def _cell_range(low: float, high: float, origin: float, size: float, count: int) -> Any:
    """Return the first and last cell that [low, high] touches."""
    first = int((low - origin) / size)
    last = int((high - origin) / size)
    return max(0, min(count - 1, first)), max(0, min(count - 1, last))


@njit(cache=True, error_model="numpy")
def build_grid(shore: Float, shrunk: Float, cells: int) -> Grid:
    """Sort the shore's edges into a uniform grid of about `cells` cells."""
    n = len(shore)
    x_min = x_max = shore[0, 0]
    y_min = y_max = shore[0, 1]
    for e in range(n):
        x_min = min(x_min, shore[e, 0])
        x_max = max(x_max, shore[e, 0])
        y_min = min(y_min, shore[e, 1])
        y_max = max(y_max, shore[e, 1])
    # The odd margins keep cell borders and centres off the round coordinates of rasters.
    span = max(x_max - x_min, y_max - y_min) + 1e-3
    x_min -= 0.000731 * span
    y_min -= 0.000913 * span
    x_max += 0.000677 * span
    y_max += 0.000797 * span
    size = math.sqrt((x_max - x_min) * (y_max - y_min) / cells)
    size = max(size, span / 4000.0)
    columns = int((x_max - x_min) / size) + 1
    rows = int((y_max - y_min) / size) + 1
    # Edges count for every cell they come near, so that a ray that slips through a cell's corner
    # by a rounding error still meets them.
    pad = 1e-4 * size + 1e-5
    start = np.zeros(columns * rows + 1, np.int32)
    item = np.zeros(1, np.int32)
    for turn in range(2):
        if turn == 1:
            total = 0
            for c in range(columns * rows):
                here = start[c]
                start[c] = total
                total += here
            start[columns * rows] = total
            item = np.zeros(max(total, 1), np.int32)
        for e in range(n):
            x1, y1, x2, y2 = shore[e, 0], shore[e, 1], shore[e, 2], shore[e, 3]
            if x1 > x2:
                x1, y1, x2, y2 = x2, y2, x1, y1
            c1, c2 = _cell_range(x1 - pad, x2 + pad, x_min, size, columns)
            for c in range(c1, c2 + 1):
                ya, yb = y1, y2
                if x2 - x1 > pad:
                    slope = (y2 - y1) / (x2 - x1)
                    left = x_min + c * size - pad
                    right = x_min + (c + 1) * size + pad
                    if left > x1:
                        ya = y1 + slope * (left - x1)
                    if right < x2:
                        yb = y1 + slope * (right - x1)
                r1, r2 = _cell_range(min(ya, yb) - pad, max(ya, yb) + pad, y_min, size, rows)
                for r in range(r1, r2 + 1):
                    if turn == 1:
                        item[start[c * rows + r]] = e
                    start[c * rows + r] += 1
    for c in range(columns * rows, 0, -1):
        start[c] = start[c - 1]
    start[0] = 0

    leap = np.zeros(columns * rows, np.int32)
    for c in range(columns):
        for r in range(rows):
            i = c * rows + r
            if start[i + 1] == start[i]:
                # Beyond the grid there is nothing to hit.
                best = np.int32(1 << 20)
                if c > 0:
                    best = min(best, leap[i - rows])
                    if r > 0:
                        best = min(best, leap[i - rows - 1])
                    if r < rows - 1:
                        best = min(best, leap[i - rows + 1])
                if r > 0:
                    best = min(best, leap[i - 1])
                leap[i] = best + 1
    for c in range(columns - 1, -1, -1):
        for r in range(rows - 1, -1, -1):
            i = c * rows + r
            best = leap[i]
            if best > 0:
                if c < columns - 1:
                    best = min(best, leap[i + rows] + 1)
                    if r > 0:
                        best = min(best, leap[i + rows - 1] + 1)
                    if r < rows - 1:
                        best = min(best, leap[i + rows + 1] + 1)
                if r < rows - 1:
                    best = min(best, leap[i + 1] + 1)
                leap[i] = best

    # Is a cell's centre in the water: parity of the edges above it.
    inside = np.zeros(columns * rows, np.uint8)
    for e in range(n):
        x1, y1, x2, y2 = shore[e, 0], shore[e, 1], shore[e, 2], shore[e, 3]
        if x1 > x2:
            x1, y1, x2, y2 = x2, y2, x1, y1
        c1, c2 = _cell_range(x1, x2, x_min, size, columns)
        for c in range(c1, c2 + 1):
            x = x_min + (c + 0.5) * size
            if x1 <= x < x2:
                y = y1 + (y2 - y1) * ((x - x1) / (x2 - x1))
                r = math.floor((y - y_min) / size - 0.5)
                if r >= 0:
                    inside[c * rows + min(r, rows - 1)] ^= 1
    for c in range(columns):
        for r in range(rows - 2, -1, -1):
            inside[c * rows + r] ^= inside[c * rows + r + 1]

    frame = np.empty(3)
    frame[0], frame[1], frame[2] = x_min, y_min, size
    shape = np.empty(2, np.int32)
    shape[0], shape[1] = columns, rows
    return frame, shape, start, item, leap, inside, shrunk, shore


@njit(cache=True, error_model="numpy")
def settle_points(grid: Grid, points: Float, reach: float, hair: float) -> Byte:
    """Move points on land by at most `reach` to the nearest shore, in place.

    Returns 0 for points that stay, 1 for moved ones, 2 for points too far inland.
    """
    frame, shape, start, item, _, inside, _, shore = grid
    size = frame[2]
    columns, rows = shape[0], shape[1]
    out = np.zeros(len(points), np.uint8)
    for n in range(len(points)):
        x, y = points[n, 0], points[n, 1]
        best = math.inf
        best_x, best_y = x, y
        c1, c2 = _cell_range(x - reach, x + reach, frame[0], size, columns)
        r1, r2 = _cell_range(y - reach, y + reach, frame[1], size, rows)
        for c in range(c1, c2 + 1):
            for r in range(r1, r2 + 1):
                for k in range(start[c * rows + r], start[c * rows + r + 1]):
                    e = item[k]
                    px, py = shore[e, 0], shore[e, 1]
                    ex, ey = shore[e, 2] - px, shore[e, 3] - py
                    t = ((x - px) * ex + (y - py) * ey) / (ex * ex + ey * ey)
                    t = min(max(t, 0.0), 1.0)
                    qx, qy = px + t * ex, py + t * ey
                    d = (x - qx) ** 2 + (y - qy) ** 2
                    if d < best:
                        best, best_x, best_y = d, qx, qy
        best = math.sqrt(best)
        if best <= hair:
            continue
        wet = False
        column = math.floor((x - frame[0]) / size)
        row = math.floor((y - frame[1]) / size)
        if 0 <= column < columns and 0 <= row < rows:
            i = column * rows + row
            wet = inside[i] == 1
            mx = frame[0] + (column + 0.5) * size
            my = frame[1] + (row + 0.5) * size
            dx, dy = mx - x, my - y
            for k in range(start[i], start[i + 1]):
                e = item[k]
                px, py = shore[e, 0], shore[e, 1]
                qx, qy = shore[e, 2], shore[e, 3]
                side_p = dx * (py - y) - dy * (px - x)
                side_q = dx * (qy - y) - dy * (qx - x)
                if (side_p >= 0.0) != (side_q >= 0.0):
                    ex, ey = qx - px, qy - py
                    side_a = ex * (y - py) - ey * (x - px)
                    side_b = ex * (my - py) - ey * (mx - px)
                    if (side_a >= 0.0) != (side_b >= 0.0):
                        wet = not wet
        if wet:
            continue
        if best <= reach:
            points[n, 0], points[n, 1] = best_x, best_y
            out[n] = 1
        else:
            out[n] = 2
    return out

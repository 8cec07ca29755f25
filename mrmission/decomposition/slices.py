"""Slices: runs of free cells per column, from polygon edges or from a dense raster.

Both ways give the same slices. The polygon way costs time and memory by slices, not by pixels:
every edge is intersected with the columns it spans, the crossings of a column sorted and paired.
"""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt
import shapely
from numba import njit

from mrmission.errors import PlanningError
from mrmission.model import FloatArray, IntArray, OccupancyGrid, Slices, read_only

MAX_ROWS = 2**31 - 2
_BLOCK = 64
_TIE = 1e-6


def slices_of_polygon(
    polygon: shapely.Polygon | shapely.MultiPolygon,
    column_pitch_m: float,
    row_pitch_m: float,
    origin_m: tuple[float, float],
    columns: int,
    rows: int,
) -> Slices:
    """Return the slices of a region straight from its edges.

    A cell of the raster is free when its centre is inside by the even-odd rule. The rule is half
    open, so a centre exactly on the boundary is free on the region's left and lower sides (where
    the coordinates are exact in floating point) and occupied on the others.

    Parameters
    ----------
    polygon
        Region in the sweep frame, m.
    column_pitch_m, row_pitch_m
        Size of a raster cell across and along the sweep, m.
    origin_m
        Lower-left corner of raster cell (0, 0), sweep frame, m.
    columns, rows
        Size of the raster. What lies outside of it is cut off.

    Returns
    -------
    Slices
        Sorted by column, then by row.

    Raises
    ------
    PlanningError
        When the raster has no size or more rows than an int32 can number.

    Examples
    --------
    >>> s = slices_of_polygon(shapely.box(0, 0, 2, 3), 1.0, 1.0, (0.0, 0.0), 2, 4)
    >>> s.row_start.tolist(), s.row_stop.tolist()
    ([0, 0], [3, 3])
    """
    _check_raster(column_pitch_m, row_pitch_m, origin_m, columns, rows)
    column_x_m = np.asarray(origin_m[0] + (np.arange(columns) + 0.5) * column_pitch_m, np.float64)
    x_m, y_m, first, edge = _edges(polygon, column_x_m)
    column, start, stop, offsets = _scan_rows(
        x_m, y_m, first, edge, column_x_m, rows, float(row_pitch_m), float(origin_m[1])
    )
    return Slices(
        column=read_only(column),
        row_start=read_only(start),
        row_stop=read_only(stop),
        offsets=read_only(offsets),
        column_pitch_m=float(column_pitch_m),
        row_pitch_m=float(row_pitch_m),
        origin_m=(float(origin_m[0]), float(origin_m[1])),
    )


def slices_of_grid(grid: OccupancyGrid) -> Slices:
    """Return the slices of a dense raster, in one pass over it.

    Parameters
    ----------
    grid
        Raster; a column is contiguous in memory (otherwise it is copied first).

    Returns
    -------
    Slices
        Sorted by column, then by row.

    Examples
    --------
    >>> free = np.array([[True, True, False, True]])
    >>> s = slices_of_grid(
    ...     OccupancyGrid(free=free, column_pitch_m=1.0, row_pitch_m=1.0, origin_m=(0.0, 0.0))
    ... )
    >>> s.row_start.tolist(), s.row_stop.tolist()
    ([0, 3], [2, 4])
    """
    columns, rows = grid.free.shape
    _check_raster(grid.column_pitch_m, grid.row_pitch_m, grid.origin_m, columns, rows)
    # A read-only view: one type for the compiler, whether the caller's array is writeable or not.
    free = np.ascontiguousarray(grid.free, dtype=np.bool_).view(np.uint8).view()
    free.setflags(write=False)
    column, start, stop, offsets = _scan_grid(free)
    return Slices(
        column=read_only(column),
        row_start=read_only(start),
        row_stop=read_only(stop),
        offsets=read_only(offsets),
        column_pitch_m=float(grid.column_pitch_m),
        row_pitch_m=float(grid.row_pitch_m),
        origin_m=(float(grid.origin_m[0]), float(grid.origin_m[1])),
    )


def lane_intervals(
    polygon: shapely.Polygon | shapely.MultiPolygon, column_x_m: npt.ArrayLike
) -> tuple[IntArray, FloatArray, FloatArray]:
    """Return the exact pieces of vertical lines that lie inside a region.

    A line along a vertical edge gets what lies to its right (half open): the left edge of a box
    counts as inside, its right edge does not. Pieces of no length are left out, pieces that
    touch at a point are joined.

    Parameters
    ----------
    polygon
        Region in the sweep frame, m.
    column_x_m
        Shape (n,): position of each line across the sweep, m, in any order.

    Returns
    -------
    column_index : IntArray
        Shape (p,): which line, rising.
    y_start_m, y_stop_m : FloatArray
        Shape (p,): lower and upper end of each piece, m, rising within a line.

    Examples
    --------
    >>> column, start, stop = lane_intervals(shapely.box(0, 0, 2, 3), [1.0, 5.0])
    >>> column.tolist(), start.tolist(), stop.tolist()
    ([0], [0.0], [3.0])
    """
    lines_m = np.ascontiguousarray(column_x_m, dtype=np.float64).reshape(-1)
    order = np.argsort(lines_m, kind="stable")
    sorted_m = np.ascontiguousarray(lines_m[order])
    x_m, y_m, first, edge = _edges(polygon, sorted_m)
    column, start_m, stop_m = _scan_heights(x_m, y_m, first, edge, sorted_m)
    if np.any(order[1:] < order[:-1]):
        column = order[column]
        again = np.argsort(column, kind="stable")
        column, start_m, stop_m = column[again], start_m[again], stop_m[again]
    return column, start_m, stop_m


def _check_raster(
    column_pitch_m: float,
    row_pitch_m: float,
    origin_m: tuple[float, float],
    columns: int,
    rows: int,
) -> None:
    """Raise a PlanningError when the raster cannot be scanned."""
    if not (0 < column_pitch_m < math.inf and 0 < row_pitch_m < math.inf):
        raise PlanningError(
            f"raster pitch {column_pitch_m} x {row_pitch_m} m: must be finite and above 0"
        )
    if not (math.isfinite(origin_m[0]) and math.isfinite(origin_m[1])):
        raise PlanningError(f"raster origin {origin_m} m: must be finite")
    if columns < 0 or not 0 <= rows <= MAX_ROWS:
        raise PlanningError(
            f"raster of {columns} columns x {rows} rows: must be 0 or more, and at most"
            f" {MAX_ROWS} rows; use a coarser pitch"
        )


def _edges(
    polygon: shapely.Polygon | shapely.MultiPolygon, column_x_m: FloatArray
) -> tuple[FloatArray, FloatArray, IntArray, IntArray]:
    """Return ring coordinates x, y, the first column at or right of each, and the edges' starts.

    Edge ``e`` runs from coordinate ``e`` to ``e + 1``. Vertices of equal x get the same first
    column, which is what makes the crossings of every closed ring even in every column.
    """
    rings = shapely.get_rings(shapely.get_parts(polygon))
    xy_m, ring = shapely.get_coordinates(rings, return_index=True)
    x_m, y_m = np.ascontiguousarray(xy_m[:, 0]), np.ascontiguousarray(xy_m[:, 1])
    first = np.searchsorted(column_x_m, x_m, side="left").astype(np.int64, copy=False)
    # Edges that span no column are dropped here, with the seams between the rings.
    spans = (ring[1:] == ring[:-1]) & (first[1:] != first[:-1])
    return x_m, y_m, first, np.flatnonzero(spans)


@njit(cache=True)
def _column_offsets(first, edge, columns):  # type: ignore[no-untyped-def]
    """Return where each column's crossings begin: from +1/-1 at the ends of every edge's span."""
    offsets = np.zeros(columns + 1, np.int64)
    for e in edge:
        low = min(first[e], first[e + 1])
        high = max(first[e], first[e + 1])
        offsets[low] += 1
        offsets[high] -= 1
    active = 0
    total = 0
    for c in range(columns + 1):
        active += offsets[c]
        offsets[c] = total
        total += active
    return offsets


@njit(cache=True)
def _sort_range(a, low, high):  # type: ignore[no-untyped-def]
    """Sort a[low:high] in place. Shell sort: few crossings are the rule, thousands no disaster."""
    gap = 1
    while gap < (high - low) // 3:
        gap = 3 * gap + 1
    while gap > 0:
        for i in range(low + gap, high):
            value = a[i]
            j = i - gap
            while j >= low and a[j] > value:
                a[j + gap] = a[j]
                j -= gap
            a[j + gap] = value
        gap //= 3


@njit(cache=True)
def _scan_rows(x, y, first, edge, column_x, rows, row_pitch, origin_y):  # type: ignore[no-untyped-def]
    """Return column, row_start, row_stop, offsets of the slices of closed rings."""
    columns = column_x.size
    begin = _column_offsets(first, edge, columns)
    row = np.empty(begin[columns], np.int32)
    cursor = begin[:columns].copy()
    for e in edge:
        a, b = (e, e + 1) if first[e] < first[e + 1] else (e + 1, e)
        # From left to right, so that an edge shared by two rings crosses at the same row in both.
        xa, ya = x[a], y[a]
        dx, dy = x[b] - xa, y[b] - ya
        slope = dy / dx
        for c in range(first[a], first[b]):
            t = (ya + (column_x[c] - xa) * slope - origin_y) / row_pitch - 0.5
            if t <= 0.0 - _TIE:
                r = 0
            elif t > rows:
                r = rows
            else:
                r = int(np.ceil(t))
                near = np.floor(t + 0.5)
                if abs(t - near) < _TIE:
                    # Too near a centre for a division: decide without one.
                    center = origin_y + (near + 0.5) * row_pitch
                    r = int(near)
                    if (center - ya) * dx < (column_x[c] - xa) * dy:
                        r += 1
                r = min(r, rows)
            row[cursor[c]] = r
            cursor[c] += 1
    size = row.size // 2
    column = np.empty(size, np.int32)
    start = np.empty(size, np.int32)
    stop = np.empty(size, np.int32)
    offsets = np.zeros(columns + 1, np.int64)
    n = 0
    for c in range(columns):
        low, high = begin[c], begin[c + 1]
        _sort_range(row, low, high)
        for i in range(low, high - 1, 2):
            if row[i] == row[i + 1]:
                continue
            if n > offsets[c] and stop[n - 1] == row[i]:
                # What lies between is thinner than the raster sees.
                stop[n - 1] = row[i + 1]
            else:
                column[n] = c
                start[n] = row[i]
                stop[n] = row[i + 1]
                n += 1
        offsets[c + 1] = n
    return column[:n].copy(), start[:n].copy(), stop[:n].copy(), offsets


@njit(cache=True)
def _scan_heights(x, y, first, edge, column_x):  # type: ignore[no-untyped-def]
    """Return column, lower and upper end of the pieces of vertical lines inside closed rings."""
    columns = column_x.size
    begin = _column_offsets(first, edge, columns)
    height = np.empty(begin[columns], np.float64)
    cursor = begin[:columns].copy()
    for e in edge:
        a, b = (e, e + 1) if first[e] < first[e + 1] else (e + 1, e)
        xa, ya = x[a], y[a]
        dx, dy = x[b] - xa, y[b] - ya
        for c in range(first[a], first[b]):
            # Never outside of the edge by rounding.
            h = ya + dy * ((column_x[c] - xa) / dx)
            height[cursor[c]] = min(max(h, min(ya, y[b])), max(ya, y[b]))
            cursor[c] += 1
    size = height.size // 2
    column = np.empty(size, np.int64)
    start = np.empty(size, np.float64)
    stop = np.empty(size, np.float64)
    n = 0
    for c in range(columns):
        low, high = begin[c], begin[c + 1]
        _sort_range(height, low, high)
        n_first = n
        for i in range(low, high - 1, 2):
            if height[i] == height[i + 1]:
                continue
            if n > n_first and stop[n - 1] == height[i]:
                stop[n - 1] = height[i + 1]
            else:
                column[n] = c
                start[n] = height[i]
                stop[n] = height[i + 1]
                n += 1
    return column[:n].copy(), start[:n].copy(), stop[:n].copy()


@njit(cache=True)
def _scan_grid(free):  # type: ignore[no-untyped-def]
    """Return column, row_start, row_stop, offsets of the slices of a raster of 0 and 1 (uint8)."""
    columns, rows = free.shape
    size = max(2 * columns, 16)
    column = np.empty(size, np.int32)
    start = np.empty(size, np.int32)
    stop = np.empty(size, np.int32)
    offsets = np.zeros(columns + 1, np.int64)
    n = 0
    for c in range(columns):
        if n + rows // 2 + 1 > size:
            # Room for the worst column, doubled so that the copies stay linear.
            size = 2 * size + rows
            column = np.concatenate((column, np.empty(size - column.size, np.int32)))
            start = np.concatenate((start, np.empty(size - start.size, np.int32)))
            stop = np.concatenate((stop, np.empty(size - stop.size, np.int32)))
        state = 0
        for low in range(0, rows, _BLOCK):
            high = min(low + _BLOCK, rows)
            # The sum of a block is vectorised by the compiler; blocks of one kind need no look.
            total = np.uint32(0)
            for r in range(low, high):
                total += np.uint32(free[c, r])
            if total == state * (high - low):
                continue
            for r in range(low, high):
                if free[c, r] != state:
                    if state == 0:
                        column[n] = c
                        start[n] = r
                        state = 1
                    else:
                        stop[n] = r
                        n += 1
                        state = 0
        if state == 1:
            stop[n] = rows
            n += 1
        offsets[c + 1] = n
    return column[:n].copy(), start[:n].copy(), stop[:n].copy(), offsets

"""Slices to boustrophedon cells, the Reeb graph and the dual graph.

Two slices of neighbouring columns are linked when they share at least one row (4-connectivity). At
every border between two columns the linked slices form connected components: a component of one
slice on either side continues a cell, every other component is one critical point (a slice that
appears or vanishes, a split, a merge, or k slices that meet m). So several events in one column are
told apart by connectivity alone, and the graph's independent cycles are the region's islands.

References
----------
H. Choset, P. Pignon, "Coverage Path Planning: The Boustrophedon Cellular Decomposition", 1998.
N. Karapetyan et al., "Efficient Multi-Robot Coverage of a Known Environment", IROS 2017.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt
import shapely
from numba import njit

from mrmission.model import Cells, Decomposition, FloatArray, IntArray, ReebGraph, Slices, read_only


def decompose(slices: Slices) -> Decomposition:
    """Link slices into cells and build the Reeb graph and the dual graph.

    Cells are numbered by their first slice (column, then row), nodes by column border, then row.
    A node lies on the border between two columns, at the mean of the ends of the slices that meet
    there, moved to the nearest of these slices when that is on land.

    Parameters
    ----------
    slices
        Sorted by column, then by row; the slices of one column don't touch.

    Returns
    -------
    Decomposition
        Empty when there are no slices.

    Examples
    --------
    >>> from mrmission.decomposition.slices import slices_of_polygon
    >>> lake = shapely.box(0, 0, 9, 9) - shapely.box(3, 3, 6, 6)
    >>> d = decompose(slices_of_polygon(lake, 1.0, 1.0, (0.0, 0.0), 9, 9))
    >>> d.cells.area_m2.tolist()
    [27.0, 9.0, 9.0, 27.0]
    >>> d.reeb.tail.tolist(), d.reeb.head.tolist()
    ([0, 1, 1, 2], [1, 2, 2, 3])
    """
    offsets = _input(slices.offsets, np.int64)
    start = _input(slices.row_start, np.int32)
    stop = _input(slices.row_stop, np.int32)
    cell, tail, head, node_border, node_row = _link(offsets, start, stop)
    node_m = np.column_stack(
        (
            slices.origin_m[0] + node_border * slices.column_pitch_m,
            slices.origin_m[1] + node_row * slices.row_pitch_m,
        )
    )
    slice_index, cell_offsets, count, across, along, length_m = _measure(
        cell,
        _input(slices.column, np.int32),
        start,
        stop,
        tail,
        head,
        node_border,
        node_row,
        slices.column_pitch_m,
        slices.row_pitch_m,
    )
    area_m2 = count * (slices.column_pitch_m * slices.row_pitch_m)
    width_m = np.diff(cell_offsets) * slices.column_pitch_m
    centroid_m = np.column_stack(
        (
            slices.origin_m[0] + across / np.maximum(count, 1) * slices.column_pitch_m,
            slices.origin_m[1] + along / np.maximum(count, 1) * slices.row_pitch_m,
        )
    )
    return Decomposition(
        slices=slices,
        cells=Cells(
            slice_index=read_only(slice_index),
            offsets=read_only(cell_offsets),
            area_m2=read_only(area_m2),
            width_m=read_only(width_m),
            centroid_m=read_only(centroid_m),
        ),
        reeb=ReebGraph(
            node_m=read_only(node_m),
            tail=read_only(tail),
            head=read_only(head),
            w_c=read_only(area_m2.copy()),
            w_t=read_only(length_m),
            c_e=read_only(width_m**2 / area_m2),
        ),
        dual_edges=read_only(dual_edges_of(tail, head)),
    )


def split_cell(decomposition: Decomposition, cell: int) -> FloatArray:
    """Return the boundary that cuts a doubled cell into a lower and an upper half.

    The boundary goes in a straight line from the cell's critical point at its first column to the
    one at its last, taken at the column centres and clipped into the slice of each column: the
    lower half of column ``i`` is from the slice's start to the boundary, the upper half from
    there to its stop, so the halves partition the cell. Where the line leaves the cell (a bent
    cell) one of them is empty in that column.

    Parameters
    ----------
    decomposition
        Of the region.
    cell
        Which cell.

    Returns
    -------
    FloatArray
        Shape (n,): height of the boundary at each of the cell's columns, rising, sweep frame, m.

    References
    ----------
    A. Xu, C. Viriyasuthee, I. Rekleitis, "Efficient complete coverage of a known arbitrary
    environment with applications to aerial operations", Autonomous Robots 36, 2014.
    """
    slices, cells, reeb = decomposition.slices, decomposition.cells, decomposition.reeb
    index = cells.slice_index[cells.offsets[cell] : cells.offsets[cell + 1]]
    x0_m, y0_m = reeb.node_m[reeb.tail[cell]]
    x1_m, y1_m = reeb.node_m[reeb.head[cell]]
    x_m = slices.origin_m[0] + (slices.column[index] + 0.5) * slices.column_pitch_m
    y_m = y0_m + (x_m - x0_m) / (x1_m - x0_m) * (y1_m - y0_m)
    low_m = slices.origin_m[1] + slices.row_start[index] * slices.row_pitch_m
    high_m = slices.origin_m[1] + slices.row_stop[index] * slices.row_pitch_m
    return np.clip(y_m, low_m, high_m)


def cell_polygons(
    decomposition: Decomposition, *, stairs: bool = False, tolerance_m: float | None = None
) -> tuple[shapely.Polygon, ...]:
    """Return the outline of every cell in the sweep frame.

    Parameters
    ----------
    decomposition
        Of the region.
    stairs
        True: the exact union of the raster cells. False: a line through the ends of the slices at
        the column centres, simplified, for maps and figures.
    tolerance_m
        How far the simplified outline may be from that line, m; half the larger pitch when None.
        0 leaves every point. Not used with `stairs`.

    Returns
    -------
    tuple of shapely.Polygon
        One per cell, in order.
    """
    slices, cells = decomposition.slices, decomposition.cells
    if len(cells) == 0:
        return ()
    pitch_m = slices.column_pitch_m
    index, size = cells.slice_index, np.diff(cells.offsets)
    left_m = slices.origin_m[0] + slices.column[index] * pitch_m
    low_m = slices.origin_m[1] + slices.row_start[index] * slices.row_pitch_m
    high_m = slices.origin_m[1] + slices.row_stop[index] * slices.row_pitch_m
    # Along the bottom: two points per slice (its corners, or its centre and, at the cell's ends,
    # the corner), the same along the top; then the ring goes bottom forward and top backward.
    x_m = np.repeat(left_m, 2)
    low2_m, high2_m = np.repeat(low_m, 2), np.repeat(high_m, 2)
    if stairs:
        x_m[1::2] += pitch_m
        count = 2 * size
    else:
        x_m += 0.5 * pitch_m
        keep = np.zeros(len(x_m), np.bool_)
        keep[0::2] = True
        first, last = 2 * cells.offsets[:-1], 2 * cells.offsets[1:] - 1
        x_m[first] -= 0.5 * pitch_m
        x_m[last] += 0.5 * pitch_m
        keep[last] = True
        x_m, low2_m, high2_m = x_m[keep], low2_m[keep], high2_m[keep]
        count = size + 1
    end = np.cumsum(count)
    begin = end - count
    of_cell = np.repeat(np.arange(len(cells)), count)
    ring = np.concatenate((of_cell, of_cell))
    position = np.arange(len(x_m)) - begin[of_cell]
    place = np.concatenate((position, 2 * count[of_cell] - 1 - position)) + 2 * begin[ring]
    xy_m = np.empty((2 * len(x_m), 2))
    xy_m[place, 0] = np.concatenate((x_m, x_m))
    xy_m[place, 1] = np.concatenate((low2_m, high2_m))
    outline = shapely.polygons(
        shapely.linearrings(xy_m, indices=np.repeat(np.arange(len(cells)), 2 * count))
    )
    if stairs:
        return tuple(outline)
    if tolerance_m is None:
        tolerance_m = 0.5 * max(pitch_m, slices.row_pitch_m)
    if tolerance_m > 0:
        simple = shapely.simplify(outline, tolerance_m, preserve_topology=False)
        # Several times faster than preserving topology, which few outlines need.
        broken = ~shapely.is_valid(simple) | shapely.is_empty(simple)
        broken |= shapely.get_type_id(simple) != shapely.GeometryType.POLYGON
        simple[broken] = shapely.simplify(outline[broken], tolerance_m)
        outline = simple
    return tuple(outline)


def _input(array: npt.NDArray[np.generic], dtype: type[np.generic]) -> npt.NDArray[np.generic]:
    """Return a contiguous read-only view, so that every kernel is compiled for one type."""
    view = np.ascontiguousarray(array, dtype=dtype).view()
    view.setflags(write=False)
    return view


def dual_edges_of(tail: IntArray, head: IntArray) -> IntArray:
    """Return the pairs of cells that share a node, each once, smaller first, sorted."""
    cells = len(tail)
    node = np.concatenate((tail, head))
    cell = np.concatenate((np.arange(cells), np.arange(cells)))
    order = np.argsort(node, kind="stable")
    node, cell = node[order], cell[order]
    keys = []
    at = np.arange(max(len(node) - 1, 0))
    shift = 1
    # Cells of one node lie together: pair each with the next, the next but one, and so on.
    while len(at):
        at = at[at + shift < len(node)]
        at = at[node[at] == node[at + shift]]
        a, b = cell[at], cell[at + shift]
        keys.append(np.minimum(a, b) * cells + np.maximum(a, b))
        shift += 1
    key = np.unique(np.concatenate(keys)) if keys else np.zeros(0, np.int64)
    return np.column_stack((key // max(cells, 1), key % max(cells, 1)))


@njit(cache=True)
def _link(offsets, start, stop):  # type: ignore[no-untyped-def]
    """Return cell of every slice, tail and head of every cell, border and row of every node."""
    columns = offsets.size - 1
    slices = start.size
    cell = np.empty(slices, np.int64)
    tail = np.empty(slices, np.int64)
    head = np.empty(slices, np.int64)
    node_border = np.empty(2 * slices, np.float64)
    node_row = np.empty(2 * slices, np.float64)
    cells = 0
    nodes = 0
    for border in range(columns + 1):
        # The border lies left of column `border`: slices i of the column before, j of this one.
        i, i_end, j, j_end = 0, 0, 0, 0
        if border > 0:
            i, i_end = offsets[border - 1], offsets[border]
        if border < columns:
            j, j_end = offsets[border], offsets[border + 1]
        while i < i_end or j < j_end:
            i_low, j_low = i, j
            if j == j_end or (i < i_end and stop[i] <= start[j]):
                i += 1
            elif i == i_end or stop[j] <= start[i]:
                j += 1
            else:
                i += 1
                j += 1
                while True:
                    if i < i_end and start[i] < stop[j - 1]:
                        i += 1
                    elif j < j_end and start[j] < stop[i - 1]:
                        j += 1
                    else:
                        break
                if i - i_low == 1 and j - j_low == 1:
                    cell[j_low] = cell[i_low]
                    continue
            total = 0.0
            for s in range(i_low, i):
                head[cell[s]] = nodes
                total += start[s] + stop[s]
            for s in range(j_low, j):
                cell[s] = cells
                tail[cells] = nodes
                cells += 1
                total += start[s] + stop[s]
            mean = total / (2 * (i - i_low + j - j_low))
            nearest = 0.0
            distance = np.inf
            for side in range(2):
                low, high = (i_low, i) if side == 0 else (j_low, j)
                for s in range(low, high):
                    # Half a row from the ends, so that the node is in the water and not at it.
                    row = min(max(mean, start[s] + 0.5), stop[s] - 0.5)
                    if abs(row - mean) < distance:
                        distance = abs(row - mean)
                        nearest = row
            node_border[nodes] = border
            node_row[nodes] = nearest
            nodes += 1
    return (
        cell,
        tail[:cells].copy(),
        head[:cells].copy(),
        node_border[:nodes].copy(),
        node_row[:nodes].copy(),
    )


@njit(cache=True)
def _measure(  # type: ignore[no-untyped-def]
    cell, column, start, stop, tail, head, node_border, node_row, column_pitch, row_pitch
):
    """Return each cell's slices, their offsets, its raster cells, their moments, its length in m.

    The length goes from the tail node through the middles of the slices to the head node.
    """
    cells = tail.size
    slices = cell.size
    offsets = np.zeros(cells + 1, np.int64)
    for s in range(slices):
        offsets[cell[s] + 1] += 1
    for c in range(cells):
        offsets[c + 1] += offsets[c]
    slice_index = np.empty(slices, np.int64)
    cursor = offsets[:cells].copy()
    for s in range(slices):
        slice_index[cursor[cell[s]]] = s
        cursor[cell[s]] += 1
    count = np.zeros(cells, np.float64)
    across = np.zeros(cells, np.float64)
    along = np.zeros(cells, np.float64)
    length = np.zeros(cells, np.float64)
    for c in range(cells):
        x, y = node_border[tail[c]], node_row[tail[c]]
        for k in range(offsets[c], offsets[c + 1]):
            s = slice_index[k]
            rows = float(stop[s] - start[s])
            middle = 0.5 * (start[s] + stop[s])
            center = column[s] + 0.5
            count[c] += rows
            across[c] += rows * center
            along[c] += rows * middle
            length[c] += np.hypot((center - x) * column_pitch, (middle - y) * row_pitch)
            x, y = center, middle
        length[c] += np.hypot(
            (node_border[head[c]] - x) * column_pitch, (node_row[head[c]] - y) * row_pitch
        )
    return slice_index, offsets, count, across, along, length

"""Random binary maps with arbitrarily placed obstacles, alike the paper's in their Reeb graphs.

Obstacles are rectangles on a lattice of columns and flat rows, at any place of it that leaves a row
to the obstacles above and below; beside each other and at the border they may touch. The lattice is
there for one reason: obstacles that begin and end at the same column give critical points where
several cells meet at once. In general position every critical point has degree 1 or 3, so that at
least half as many cells as there are critical points are doubled, and tours come out longer than
the paper's.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import rustworkx as rx

from mrmission.decomposition.cells import decompose
from mrmission.decomposition.slices import slices_of_grid
from mrmission.model import BoolArray, OccupancyGrid


@dataclass(frozen=True, slots=True, kw_only=True)
class RandomMapOptions:
    """Ranges, ends included, from which a map is drawn; lengths in cells of the lattice.

    ``pitch_px`` are the sides of a cell of the lattice across and along the columns, pixels.
    """

    columns: tuple[int, int] = (9, 11)
    rows: tuple[int, int] = (37, 41)
    obstacles: tuple[int, int] = (7, 31)
    width: tuple[int, int] = (3, 3)
    height: tuple[int, int] = (1, 1)
    column_pitch_px: tuple[int, int] = (4, 8)
    row_pitch_px: tuple[int, int] = (2, 3)


TRIES = 20
"""Places tried for each obstacle before the map is left with fewer."""
LEAST_PART = 0.8
"""A map whose largest connected part is less of the free cells than this is drawn again."""


def random_map(seed: int, number: int, options: RandomMapOptions | None = None) -> BoolArray:
    """Return (columns, rows) pixels, True where free, 4-connected.

    Parameters
    ----------
    seed
        Of the whole set of maps.
    number
        Which map of the set; each has a generator of its own, so any can be made alone.
    options
        Ranges to draw from.

    Examples
    --------
    >>> bool((random_map(1, 7) == random_map(1, 7)).all())
    True
    """
    options = RandomMapOptions() if options is None else options
    rng = np.random.default_rng([seed, number])

    def draw(low_high: tuple[int, int]) -> int:
        return int(rng.integers(low_high[0], low_high[1] + 1))

    while True:
        columns, rows = draw(options.columns), draw(options.rows)
        obstacles = draw(options.obstacles)
        pitch = draw(options.column_pitch_px), draw(options.row_pitch_px)
        free = np.ones((columns, rows), dtype=np.bool_)
        placed = 0
        for _ in range(TRIES * obstacles):
            if placed == obstacles:
                break
            width, height = draw(options.width), draw(options.height)
            x, y = draw((0, columns - width)), draw((0, rows - height))
            if free[x : x + width, max(0, y - 1) : y + height + 1].all():
                free[x : x + width, y : y + height] = False
                placed += 1
        part = largest_part(free)
        if part.sum() >= LEAST_PART * free.sum():
            return np.ascontiguousarray(np.kron(part, np.ones(pitch, dtype=np.bool_)))


def largest_part(free: BoolArray) -> BoolArray:
    """Return the largest 4-connected part of the free cells, the first of equals.

    Examples
    --------
    >>> largest_part(np.array([[True, False], [True, True], [False, True]])).sum()
    np.int64(4)
    """
    grid = OccupancyGrid(free=free, column_pitch_m=1.0, row_pitch_m=1.0, origin_m=(0.0, 0.0))
    done = decompose(slices_of_grid(grid))
    graph = rx.PyGraph(multigraph=True)
    graph.add_nodes_from(range(len(done.reeb.node_m)))
    graph.add_edges_from_no_data(
        list(zip(done.reeb.tail.tolist(), done.reeb.head.tolist(), strict=True))
    )
    part_of = np.zeros(len(done.reeb.node_m), dtype=np.int64)
    for part, nodes in enumerate(sorted(rx.connected_components(graph), key=min)):
        part_of[list(nodes)] = part
    of_cell = part_of[done.reeb.tail]
    largest = int(np.argmax(np.bincount(of_cell, weights=done.cells.area_m2)))
    out = np.zeros_like(free)
    slices, cells = done.slices, done.cells
    for cell in np.flatnonzero(of_cell == largest):
        for s in cells.slice_index[cells.offsets[cell] : cells.offsets[cell + 1]]:
            out[slices.column[s], slices.row_start[s] : slices.row_stop[s]] = True
    return out

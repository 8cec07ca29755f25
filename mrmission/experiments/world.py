"""A binary map as the paper sees it: cells, Reeb graph, tour, and costs in pixels.

The paper's cost adds areas, px², and travel, px, in one number. Travel between critical points goes
along the cells, through the middles of their slices.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import rustworkx as rx

from mrmission.decomposition.cells import decompose, split_cell
from mrmission.decomposition.slices import slices_of_grid
from mrmission.model import BoolArray, Decomposition, FloatArray, OccupancyGrid, ReebGraph
from mrmission.partition.problem import CoverageProblem, EccTour


@dataclass(frozen=True, slots=True, kw_only=True)
class PaperWorld:
    """One map, ready for the planners.

    Attributes
    ----------
    decomposition
        Cells and graphs; a pixel is 1 x 1.
    half_area
        (cells, 2) px² of the lower and the upper half of each cell.
    travel
        (nodes, nodes) px along the cells' middles.
    covering
        (nodes, nodes) least area, px², of cells from node to node.
    problem
        The same in the planners' terms; its depot is the tour's first critical point, v1.
    tour
        The single-robot tour (ECC).
    """

    decomposition: Decomposition
    half_area: FloatArray
    travel: FloatArray
    covering: FloatArray
    problem: CoverageProblem
    tour: EccTour

    @property
    def free_px(self) -> float:
        """Number of free pixels."""
        return float(self.decomposition.cells.area_m2.sum())


def paper_world(free: BoolArray, start_node: int = 0) -> PaperWorld:
    """Decompose a map of one connected part and find its tour.

    Parameters
    ----------
    free
        (columns, rows) True where free.
    start_node
        The critical point that tours start from; they are numbered from left to right.
    """
    grid = OccupancyGrid(free=free, column_pitch_m=1.0, row_pitch_m=1.0, origin_m=(0.0, 0.0))
    done = decompose(slices_of_grid(grid))
    halves = np.array([_halves(done, cell) for cell in range(len(done.cells))]).reshape(-1, 2)
    travel = node_distances(done.reeb, done.reeb.w_t)
    depot = travel[start_node].copy()
    problem = CoverageProblem(
        reeb=done.reeb,
        dual_edges=done.dual_edges,
        cell_cost=done.cells.area_m2,
        half_cost=halves,
        depot_cost=depot,
    )
    return PaperWorld(
        decomposition=done,
        half_area=halves,
        travel=travel,
        covering=node_distances(done.reeb, done.cells.area_m2),
        problem=problem,
        tour=problem.ecc(),
    )


def node_distances(reeb: ReebGraph, weight: FloatArray) -> FloatArray:
    """Return (nodes, nodes) lengths of shortest paths; infinite where there is none."""
    graph = rx.PyGraph(multigraph=True)
    graph.add_nodes_from(range(len(reeb.node_m)))
    graph.add_edges_from(
        list(zip(reeb.tail.tolist(), reeb.head.tolist(), weight.tolist(), strict=True))
    )
    out = np.full((len(reeb.node_m),) * 2, np.inf)
    np.fill_diagonal(out, 0.0)
    for node, lengths in rx.all_pairs_dijkstra_path_lengths(graph, float).items():
        for other, length in lengths.items():
            out[node, other] = length
    return out


def _halves(done: Decomposition, cell: int) -> tuple[float, float]:
    """Return the areas of the lower and the upper half of a cell, px²."""
    slices, cells = done.slices, done.cells
    index = cells.slice_index[cells.offsets[cell] : cells.offsets[cell + 1]]
    lower = float((split_cell(done, cell) - slices.row_start[index]).sum())
    return lower, float(cells.area_m2[cell]) - lower

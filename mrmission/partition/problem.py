"""What a planner gets and gives: :class:`CoverageProblem` and :data:`Assignment`."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from mrmission.model import FloatArray, IntArray, ReebGraph
from mrmission.routing.postman import postman_tour


class Visit(NamedTuple):
    """One piece of work: a whole cell (`half` 0), or its lower (1) or upper (2) half."""

    cell: int
    half: int


@dataclass(frozen=True, slots=True, kw_only=True)
class EccTour:
    """Steps of the single-robot tour: step i sweeps `edge[i]` from node `tail[i]` to `head[i]`.

    ``copy`` is 0 for a cell walked once, 1 and 2 for the two walks through a doubled cell, which
    sweep its lower and its upper half.
    """

    edge: IntArray
    copy: IntArray
    tail: IntArray
    head: IntArray

    def distances(self, from_depot: FloatArray) -> FloatArray:
        """Return (steps + 1,) a node quantity before each step, and after the last."""
        if len(self.edge) == 0:
            return np.zeros(1)
        return np.append(from_depot[self.tail], from_depot[self.head[-1]])


Assignment = tuple[tuple[Visit, ...], ...]
"""The pieces of each robot in the order in which it sweeps them; in all, every cell once."""


@dataclass(frozen=True, slots=True, kw_only=True)
class CoverageProblem:
    """Cells to be swept by robots that leave from one depot and return to it.

    Attributes
    ----------
    reeb
        Reeb graph; edge ``i`` is cell ``i``.
    dual_edges
        (n, 2) pairs of cells that share a critical point.
    cell_cost
        (cells,) cost of sweeping a whole cell.
    half_cost
        (cells, 2) cost of sweeping its lower and its upper half.
    depot_cost
        (nodes,) cost of travel from the depot to each critical point.

    All costs have one unit: seconds, or the paper's pixels.
    """

    reeb: ReebGraph
    dual_edges: IntArray
    cell_cost: FloatArray
    half_cost: FloatArray
    depot_cost: FloatArray

    @property
    def start_node(self) -> int:
        """Return the critical point nearest to the depot (the paper's v1)."""
        return int(np.argmin(self.depot_cost))

    def ecc(self, cells: IntArray | None = None) -> EccTour:
        """Return the single-robot tour (ECC) of all cells, or of some.

        The graph of the cells may be in several components (a throat narrower than a lane joins
        two waters without joining their slices): each has its own closed tour from its critical
        point nearest to the depot, and they follow on each other, nearest first.
        """
        chosen = np.arange(len(self.cell_cost)) if cells is None else cells
        tours = []
        for part in self.components(chosen):
            nodes = np.unique(np.concatenate([self.reeb.tail[part], self.reeb.head[part]]))
            start = int(nodes[np.argmin(self.depot_cost[nodes])])
            tours.append(postman_tour(self.reeb, edges=part, start_node=start))
        none = np.zeros(0, dtype=np.int64)
        return EccTour(
            edge=np.concatenate([none, *(t.edge for t in tours)]),
            copy=np.concatenate([none, *(t.copy for t in tours)]),
            tail=np.concatenate([none, *(t.node[:-1] for t in tours)]),
            head=np.concatenate([none, *(t.node[1:] for t in tours)]),
        )

    def components(self, cells: IntArray) -> list[IntArray]:
        """Return the connected components of some edges, nearest to the depot first."""
        parent = np.arange(len(self.reeb.node_m))

        def find(node: int) -> int:
            while parent[node] != node:
                parent[node] = parent[parent[node]]
                node = int(parent[node])
            return node

        for cell in cells.tolist():
            parent[find(int(self.reeb.tail[cell]))] = find(int(self.reeb.head[cell]))
        roots = np.array([find(int(node)) for node in self.reeb.tail[cells]], dtype=np.int64)
        parts = [cells[roots == root] for root in np.unique(roots)]
        near = np.minimum(self.depot_cost[self.reeb.tail], self.depot_cost[self.reeb.head])
        return sorted(parts, key=lambda part: (float(near[part].min()), int(part[0])))

    def step_costs(self, tour: EccTour) -> FloatArray:
        """Return the coverage cost of each step: whole cells, or the half that the step sweeps."""
        whole = self.cell_cost[tour.edge]
        half = self.half_cost[tour.edge, np.maximum(tour.copy - 1, 0)]
        return np.where(tour.copy == 0, whole, half)


def visits_of(tour: EccTour, start: int, stop: int) -> tuple[Visit, ...]:
    """Return steps ``start:stop`` of a tour as visits."""
    return tuple(
        Visit(int(e), int(c))
        for e, c in zip(tour.edge[start:stop], tour.copy[start:stop], strict=True)
    )

"""FHK: the baseline split of Frederickson, Hecht and Kim, with one cost for everything."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import rustworkx as rx

from mrmission.model import FloatArray
from mrmission.partition.problem import Assignment, CoverageProblem, visits_of
from mrmission.partition.split import frederickson_split


def fhk(problem: CoverageProblem, robots: int) -> Assignment:
    """Cut the single-robot tour as CRC does, with coverage cost for distances too.

    Reading taken: the distance from the depot is the shortest path in the Reeb graph under the same
    coverage cost that weighs the tour, which is what sets the baseline apart from CRC (the
    alternative, travel cost for both, leaves no coverage in the balance at all).

    References
    ----------
    Frederickson, Hecht, Kim 1978; Karapetyan et al. 2017, section V.
    """
    tour = problem.ecc()
    distance = coverage_distance(problem)
    borders = frederickson_split(problem.step_costs(tour), tour.distances(distance), robots)
    return tuple(visits_of(tour, a, b) for a, b in pairwise(borders))


def coverage_distance(problem: CoverageProblem) -> FloatArray:
    """Return (nodes,) the least coverage cost between the start node and each critical point."""
    graph = rx.PyGraph(multigraph=True)
    graph.add_nodes_from(range(len(problem.reeb.node_m)))
    graph.add_edges_from(
        [
            (int(u), int(v), float(w))
            for u, v, w in zip(problem.reeb.tail, problem.reeb.head, problem.cell_cost, strict=True)
        ]
    )
    lengths = rx.dijkstra_shortest_path_lengths(graph, problem.start_node, float)
    distance = np.zeros(len(problem.reeb.node_m))
    for node, length in lengths.items():
        distance[node] = length
    return distance

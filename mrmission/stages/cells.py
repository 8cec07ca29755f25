"""Tours of whole cells: the planners of the paper, and the better of two of them."""

from __future__ import annotations

import numpy as np
import shapely

from mrmission.model import CoveragePath, FloatArray
from mrmission.partition import PLANNERS, CoverageProblem
from mrmission.partition.problem import Assignment, Visit
from mrmission.routing.harbour import Harbour
from mrmission.tour.order import PieceBook
from mrmission.tour.path import assemble_paths
from mrmission.tour.starts import bottleneck_assignment
from mrmission.tour.sweep import Sweep
from mrmission.tour.timing import TimeModel
from mrmission.tour.work import PartTours, PartWork

AUTO_METHODS = ("crc", "cac")


def cell_tours(work: PartWork) -> PartTours:
    """Return the tours of a planner of the paper, or of the better of two."""
    homes, time = work.homes_m, work.time
    book = PieceBook(work.sweep, work.harbour, time)
    problem = _problem(work.sweep, work.harbour, book, homes, time)
    asked = work.options.method
    found = []
    for method in AUTO_METHODS if asked == "auto" else (asked,):
        assignment = PLANNERS[method](problem, len(homes))
        paths = _paths_of(assignment, book, work.harbour, homes, time)
        makespan = max(time.duration_s(p.points_m, p.kind) for p in paths)
        found.append((makespan, method, paths))
    _, method, paths = min(found, key=lambda item: item[0])
    return PartTours(method=method, paths=paths)


def _problem(
    sweep: Sweep, harbour: Harbour, book: PieceBook, homes_m: FloatArray, time: TimeModel
) -> CoverageProblem:
    cells = len(sweep.decomposition.cells)
    reeb = sweep.decomposition.reeb
    nodes = sweep.frame.to_local(reeb.node_m)
    # a critical point is the middle of a column border and may lie on a sliver of land
    nearest = shapely.shortest_line(harbour.region, shapely.points(nodes))
    inside = shapely.get_coordinates(nearest).reshape(-1, 2, 2)[:, 0]
    depot = harbour.distances(homes_m[:1], inside)[0]
    return CoverageProblem(
        reeb=reeb,
        dual_edges=sweep.decomposition.dual_edges,
        cell_cost=book.costs_s([Visit(c, 0) for c in range(cells)]),
        half_cost=np.column_stack(
            [book.costs_s([Visit(c, h) for c in range(cells)]) for h in (1, 2)]
        ),
        depot_cost=depot / time.transit_speed_m_s,
    )


def _paths_of(
    assignment: Assignment,
    book: PieceBook,
    harbour: Harbour,
    homes_m: FloatArray,
    time: TimeModel,
) -> tuple[CoveragePath, ...]:
    """Assign the tours to the homes, the longest as short as can be, and close them there."""
    loose = [book.order(visits, None) for visits in assignment]
    n = len(loose)
    cost = np.zeros((n, n))
    for i, lanes in enumerate(loose):
        if len(lanes) == 0:
            continue
        ends = np.array([lanes[0, 0], lanes[-1, 1]])
        trips = harbour.distances(homes_m, ends).sum(axis=1)
        inner = np.hypot(*(lanes[:, 1] - lanes[:, 0]).T).sum() / time.survey_speed_m_s
        gaps = harbour.pair_distances(lanes[:-1, 1], lanes[1:, 0]).sum()
        cost[i] = inner + (gaps + trips) / time.transit_speed_m_s
    home_of = bottleneck_assignment(cost)
    lanes_of: list[FloatArray] = [np.zeros((0, 2, 2))] * n
    for i, visits in enumerate(assignment):
        lanes_of[home_of[i]] = book.order(visits, homes_m[home_of[i]])
    return assemble_paths(harbour, lanes_of)

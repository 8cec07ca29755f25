"""The four planners on Reeb graphs of random grids: nothing lost, nothing swept twice."""

from __future__ import annotations

from collections import Counter

import networkx as nx
import numpy as np
import pytest

from mrmission.decomposition.cells import decompose
from mrmission.decomposition.slices import slices_of_grid
from mrmission.model import OccupancyGrid
from mrmission.partition import PLANNERS, Assignment, CoverageProblem
from mrmission.partition.fhk import coverage_distance


def random_problem(
    seed: int, columns: int = 14, rows: int = 12, *, connected: bool = False
) -> CoverageProblem:
    """The cells of a random grid, connected or not, with costs of every size."""
    rng = np.random.default_rng(seed)
    free = rng.random((columns, rows)) < rng.uniform(0.55, 0.95)
    free[0, 0] = True
    if connected:
        free[:, ::4] = True
        free[0] = True
        free = largest_component(free)
    grid = OccupancyGrid(free=free, column_pitch_m=2.0, row_pitch_m=1.0, origin_m=(0.0, 0.0))
    d = decompose(slices_of_grid(grid))
    n = len(d.cells)
    half = rng.uniform(0.0, 1.0, (n, 2)) * d.reeb.w_c[:, None]
    return CoverageProblem(
        reeb=d.reeb,
        dual_edges=d.dual_edges,
        cell_cost=d.reeb.w_c * rng.uniform(0.5, 2.0, n),
        half_cost=half,
        depot_cost=np.hypot(*(d.reeb.node_m - d.reeb.node_m[0]).T),
    )


def largest_component(free: np.ndarray) -> np.ndarray:
    graph = nx.grid_2d_graph(*free.shape)
    graph.remove_nodes_from([(int(c), int(r)) for c, r in np.argwhere(~free)])
    out = np.zeros_like(free)
    for node in max(nx.connected_components(graph), key=len):
        out[node] = True
    return out


def swept(assignment: Assignment) -> dict[int, list[int]]:
    halves: dict[int, list[int]] = {}
    for visits in assignment:
        for visit in visits:
            halves.setdefault(visit.cell, []).append(visit.half)
    return halves


@pytest.mark.parametrize("method", PLANNERS)
@pytest.mark.parametrize("seed", range(7))
def test_every_cell_is_swept_once_for_any_k(method: str, seed: int) -> None:
    problem = random_problem(seed)
    cells = len(problem.cell_cost)
    for robots in (1, 2, 3, 4, 5, 7, 8, 11, 16, 23, 32, 40, cells + 3):
        assignment = PLANNERS[method](problem, robots)
        assert len(assignment) == robots
        halves = swept(assignment)
        assert sorted(halves) == list(range(cells))
        assert all(sorted(h) in ([0], [1, 2]) for h in halves.values())


def test_the_grids_include_several_components_and_doubled_cells() -> None:
    components, halves = set(), 0
    for seed in range(12):
        problem = random_problem(seed)
        graph = nx.MultiGraph(
            list(zip(problem.reeb.tail.tolist(), problem.reeb.head.tolist(), strict=True))
        )
        components.add(nx.number_connected_components(graph))
        halves += Counter(v.half for v in PLANNERS["crc"](problem, 1)[0])[1]
    assert max(components) > 2
    assert halves > 10


@pytest.mark.parametrize("method", PLANNERS)
def test_same_problem_same_assignment(method: str) -> None:
    for seed in range(4):
        for robots in (2, 5, 9):
            first = PLANNERS[method](random_problem(seed), robots)
            assert first == PLANNERS[method](random_problem(seed), robots)


@pytest.mark.parametrize("method", ["crc", "fhk", "nrc"])
def test_route_splits_are_stretches_of_the_one_tour(method: str) -> None:
    for seed in range(6):
        problem = random_problem(seed)
        whole = PLANNERS[method](problem, 1)[0]
        for robots in (2, 6, 17):
            split = PLANNERS[method](problem, robots)
            assert tuple(v for part in split for v in part) == whole


def test_nrc_gives_each_at_least_its_share_but_for_the_last() -> None:
    for seed in range(12):
        problem = random_problem(seed)
        tour = problem.ecc()
        cost = problem.step_costs(tour)
        for robots in (2, 3, 7):
            prefix = 0.0
            done = 0
            for j, visits in enumerate(PLANNERS["nrc"](problem, robots)[:-1], 1):
                done += len(visits)
                prefix = cost[:done].sum()
                share = cost.sum() * j / robots
                assert prefix >= share * (1 - 1e-9)
                # and without the last step it would be short of it
                if visits:
                    assert prefix - cost[done - 1] < share


def test_the_balance_of_cac_and_crc_beats_giving_all_to_one() -> None:
    for seed in range(8):
        problem = random_problem(seed, columns=40, rows=30, connected=True)
        total = problem.cell_cost.sum()
        for method in ("cac", "crc"):
            loads = []
            for visits in PLANNERS[method](problem, 4):
                cells = {v.cell for v in visits}
                loads.append(problem.cell_cost[sorted(cells)].sum())
            assert max(loads) < 0.75 * total, (seed, method)


def test_coverage_distance_is_floyd_warshall() -> None:
    for seed in range(8):
        problem = random_problem(seed)
        n = len(problem.reeb.node_m)
        d = np.full((n, n), np.inf)
        np.fill_diagonal(d, 0.0)
        for u, v, w in zip(problem.reeb.tail, problem.reeb.head, problem.cell_cost, strict=True):
            d[u, v] = d[v, u] = min(d[u, v], w)
        for k in range(n):
            d = np.minimum(d, d[:, k : k + 1] + d[k])
        expected = d[problem.start_node]
        got = coverage_distance(problem)
        reached = np.isfinite(expected)
        assert np.allclose(got[reached], expected[reached])

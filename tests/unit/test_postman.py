"""Postman tours against brute force and networkx."""

from __future__ import annotations

import itertools

import networkx as nx
import numpy as np
import pytest

from mrmission.errors import PlanningError
from mrmission.model import PostmanTour, ReebGraph
from mrmission.routing.postman import postman_tour


def reeb_of(nodes: int, pairs: list[tuple[int, int]], weight: list[float]) -> ReebGraph:
    cost = np.array(weight, dtype=np.float64)
    ends = np.array(pairs, dtype=np.int64).reshape(-1, 2)
    return ReebGraph(
        node_m=np.zeros((nodes, 2)),
        tail=ends[:, 0].copy(),
        head=ends[:, 1].copy(),
        w_c=np.ones_like(cost),
        w_t=np.ones_like(cost),
        c_e=cost,
    )


def check_tour(reeb: ReebGraph, tour: PostmanTour, edges: list[int], start: int) -> None:
    """Assert that the tour is a closed walk over exactly `edges`, copies numbered in order."""
    assert tour.node[0] == tour.node[-1] == start
    assert len(tour.node) == len(tour) + 1
    walked: dict[int, list[int]] = {}
    for i, e in enumerate(tour.edge.tolist()):
        a, b = int(reeb.tail[e]), int(reeb.head[e])
        ends = (a, b) if tour.direction[i] == 1 else (b, a)
        assert (tour.node[i], tour.node[i + 1]) == ends
        walked.setdefault(e, []).append(int(tour.copy[i]))
    assert sorted(walked) == sorted(edges)
    assert all(copies in ([0], [1, 2]) for copies in walked.values())
    assert sorted(e for e, c in walked.items() if c == [1, 2]) == tour.doubled.tolist()


def cheapest_by_brute_force(reeb: ReebGraph) -> float:
    """Least weight of a set of edges that makes every degree even, over all sets."""
    ends = list(zip(reeb.tail.tolist(), reeb.head.tolist(), strict=True))
    best = float("inf")
    for chosen in itertools.product((0, 1), repeat=len(ends)):
        degree = [0] * len(reeb.node_m)
        for (a, b), twice in zip(ends, chosen, strict=True):
            degree[a] += 1 + twice
            degree[b] += 1 + twice
        if all(d % 2 == 0 for d in degree):
            best = min(best, float(np.dot(chosen, reeb.c_e)))
    return best


def random_multigraph(rng: np.random.Generator, nodes: int, extra: int) -> list[tuple[int, int]]:
    """Return a connected multigraph: a random tree and any other edges, self-loops too."""
    pairs = [(int(rng.integers(i)), i) for i in range(1, nodes)]
    pairs += [(int(rng.integers(nodes)), int(rng.integers(nodes))) for _ in range(extra)]
    return [pairs[i] for i in rng.permutation(len(pairs))]


def test_least_weight_by_brute_force() -> None:
    rng = np.random.default_rng(1)
    for _ in range(400):
        nodes = int(rng.integers(1, 7))
        pairs = random_multigraph(rng, nodes, int(rng.integers(0 if nodes > 1 else 1, 6)))
        # Few values, so that ties and zeros come up, exact in binary.
        weight = rng.choice([0.0, 0.25, 0.5, 1.0, 3.0, 100.0], len(pairs)).tolist()
        reeb = reeb_of(nodes, pairs, weight)
        start = pairs[0][1]
        tour = postman_tour(reeb, start_node=start)
        check_tour(reeb, tour, list(range(len(pairs))), start)
        assert reeb.c_e[tour.doubled].sum() == cheapest_by_brute_force(reeb)


def test_high_degrees_by_brute_force() -> None:
    rng = np.random.default_rng(2)
    for nodes, extra in ((2, 9), (2, 10), (3, 9), (4, 8)):
        for _ in range(4):
            pairs = random_multigraph(rng, nodes, extra)
            pairs = [(a, b if a != b else (a + 1) % nodes) for a, b in pairs]
            reeb = reeb_of(nodes, pairs, rng.integers(1, 50, len(pairs)).astype(float).tolist())
            tour = postman_tour(reeb)
            check_tour(reeb, tour, list(range(len(pairs))), pairs[0][0])
            assert reeb.c_e[tour.doubled].sum() == cheapest_by_brute_force(reeb)


@pytest.mark.parametrize("seed", range(6))
def test_equals_the_matching_of_odd_nodes_by_networkx(seed: int) -> None:
    """The paper's formulation: match odd nodes under shortest-path distances."""
    rng = np.random.default_rng(seed)
    nodes = 60
    pairs = random_multigraph(rng, nodes, 25 + 10 * seed)
    weight = rng.uniform(0.01, 10, len(pairs)).tolist()
    reeb = reeb_of(nodes, pairs, weight)
    tour = postman_tour(reeb, start_node=0)
    check_tour(reeb, tour, list(range(len(pairs))), 0)
    graph = nx.MultiGraph()
    for (a, b), w in zip(pairs, weight, strict=True):
        graph.add_edge(a, b, weight=w)
    distance = dict(nx.all_pairs_dijkstra_path_length(graph))
    odd = [v for v, d in graph.degree() if d % 2]
    complete = nx.Graph()
    for a, b in itertools.combinations(odd, 2):
        complete.add_edge(a, b, weight=distance[a][b])
    matched = nx.min_weight_matching(complete)
    assert reeb.c_e[tour.doubled].sum() == pytest.approx(
        sum(distance[a][b] for a, b in matched), rel=1e-12
    )
    for e in tour.doubled.tolist():
        graph.add_edge(*pairs[e])
    assert nx.is_eulerian(graph)


def test_single_edge_is_walked_there_and_back() -> None:
    reeb = reeb_of(2, [(0, 1)], [2.0])
    tour = postman_tour(reeb, start_node=1)
    assert tour.edge.tolist() == [0, 0]
    assert tour.direction.tolist() == [-1, 1]
    assert tour.copy.tolist() == [1, 2]
    assert tour.node.tolist() == [1, 0, 1]


def test_single_island_doubles_nothing_but_the_ends() -> None:
    reeb = reeb_of(4, [(0, 1), (1, 2), (1, 2), (2, 3)], [1.0, 1.0, 1.0, 1.0])
    tour = postman_tour(reeb)
    assert tour.doubled.tolist() == [0, 3]
    assert len(tour) == 6


def test_self_loop_alone() -> None:
    tour = postman_tour(reeb_of(1, [(0, 0)], [5.0]))
    assert tour.edge.tolist() == [0]
    assert tour.copy.tolist() == [0]


def test_no_edges() -> None:
    assert len(postman_tour(reeb_of(0, [], []))) == 0
    tour = postman_tour(reeb_of(3, [(0, 1), (1, 2)], [1.0, 1.0]), edges=[], start_node=2)
    assert len(tour) == 0
    assert tour.node.tolist() == [2]


def test_subset_of_edges_as_indices_and_as_mask() -> None:
    reeb = reeb_of(6, [(0, 1), (1, 2), (1, 2), (2, 3), (4, 5)], [1.0, 9.0, 2.0, 1.0, 1.0])
    tour = postman_tour(reeb, edges=[3, 1, 2], start_node=3)
    check_tour(reeb, tour, [1, 2, 3], 3)
    mask = postman_tour(reeb, edges=np.array([False, True, True, True, False]), start_node=3)
    assert mask.edge.tolist() == tour.edge.tolist()
    alone = postman_tour(reeb, edges=[4])
    check_tour(reeb, alone, [4], 4)


def test_other_weights_than_the_matching_weight() -> None:
    # Degrees 3 and 3: one of three parallel edges is doubled, the cheapest by the given weight.
    reeb = reeb_of(2, [(0, 1), (0, 1), (0, 1)], [1.0, 2.0, 3.0])
    assert postman_tour(reeb).doubled.tolist() == [0]
    assert postman_tour(reeb, weight=np.array([3.0, 2.0, 1.0])).doubled.tolist() == [2]


def test_what_cannot_be_walked_is_refused() -> None:
    reeb = reeb_of(5, [(0, 1), (1, 2), (3, 4)], [1.0, 1.0, 1.0])
    with pytest.raises(PlanningError, match="not connected: 3 of 5"):
        postman_tour(reeb)
    with pytest.raises(PlanningError, match="start node 3"):
        postman_tour(reeb, edges=[0, 1], start_node=3)
    for bad in (-1.0, float("nan"), float("inf")):
        with pytest.raises(PlanningError, match="cell 1: weight"):
            postman_tour(reeb, edges=[0, 1], weight=np.array([1.0, bad, 1.0]))


def test_same_input_same_tour() -> None:
    pairs = random_multigraph(np.random.default_rng(5), 40, 30)
    reeb = reeb_of(40, pairs, [1.0] * len(pairs))
    first, second = postman_tour(reeb), postman_tour(reeb)
    assert first.edge.tobytes() == second.edge.tobytes()
    assert first.direction.tobytes() == second.direction.tobytes()


def test_ties_do_not_hang_on_the_numbers_of_the_nodes() -> None:
    rng = np.random.default_rng(6)
    pairs = random_multigraph(rng, 30, 30)
    expected = postman_tour(reeb_of(30, pairs, [1.0] * len(pairs))).doubled.tolist()
    for _ in range(10):
        number = rng.permutation(30).tolist()
        turned = [(number[b], number[a]) for a, b in pairs]
        tour = postman_tour(reeb_of(30, turned, [1.0] * len(pairs)))
        assert tour.doubled.tolist() == expected


def test_long_chain_needs_no_recursion() -> None:
    nodes = 5000
    reeb = reeb_of(nodes, [(i, i + 1) for i in range(nodes - 1)], [1.0] * (nodes - 1))
    tour = postman_tour(reeb, start_node=nodes // 2)
    assert len(tour) == 2 * (nodes - 1)

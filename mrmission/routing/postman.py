"""Chinese postman on the Reeb graph: which cells are covered twice, and in which order.

The cells walked twice are a minimum-weight set of edges that makes every degree even: the paper's
matching of the odd nodes under shortest-path distances, found exactly by another way that is much
faster on Reeb graphs. The set falls apart into the graph's blocks (biconnected components), because
a closed walk enters and leaves a block through one node: a bridge is doubled, in every other block
degrees are made even on their own. A block, with its chains of degree-2 nodes drawn together,
becomes one sparse matching: each edge has two half-edges, matched with each other when the edge is
doubled; the half-edges at a node that are not so used are matched among themselves at no cost.

References
----------
J. Edmonds, E. L. Johnson, "Matching, Euler tours and the Chinese postman", Mathematical Programming
5, 1973.
A. Xu, C. Viriyasuthee, I. Rekleitis, "Efficient complete coverage of a known arbitrary environment
with applications to aerial operations", Autonomous Robots 36, 2014 (ECC).
N. Karapetyan et al., "Efficient Multi-Robot Coverage of a Known Environment", IROS 2017.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt
import rustworkx

from mrmission.errors import PlanningError
from mrmission.model import FloatArray, IntArray, PostmanTour, ReebGraph, read_only

WEIGHT_BITS = 48
"""Weights are matched as integers, in units of 2**-48 of the largest."""
TIE_SHIFT = 48
"""Each unit counts 2**48 tie-breaking ones: more than all edges have, up to 2**18 of them."""


def postman_tour(
    reeb: ReebGraph,
    *,
    weight: FloatArray | None = None,
    edges: npt.ArrayLike | None = None,
    start_node: int | None = None,
) -> PostmanTour:
    """Return a closed walk over every edge with the least weight walked a second time.

    Parameters
    ----------
    reeb
        Multigraph of cells.
    weight
        Shape (cells,): what walking each edge a second time costs; ``reeb.c_e`` when None.
    edges
        Which edges to walk, as indices (each once) or a mask; all when None.
    start_node
        Where the walk starts and ends; the tail of the first edge when None.

    Returns
    -------
    PostmanTour
        Empty when there are no edges to walk.

    Raises
    ------
    PlanningError
        When the edges are not connected, don't touch the start, or a weight is negative or not
        finite.

    Examples
    --------
    >>> two = np.array([0.0, 0.0])
    >>> graph = ReebGraph(
    ...     node_m=np.zeros((3, 2)),
    ...     tail=np.array([0, 1]),
    ...     head=np.array([1, 2]),
    ...     w_c=two,
    ...     w_t=two,
    ...     c_e=np.array([1.0, 1.0]),
    ... )
    >>> tour = postman_tour(graph, start_node=1)
    >>> tour.edge.tolist(), tour.direction.tolist(), tour.copy.tolist()
    ([0, 0, 1, 1], [-1, 1, 1, -1], [1, 2, 1, 2])
    """
    chosen = _chosen_edges(reeb, edges)
    if len(chosen) == 0:
        return _as_tour([], [] if start_node is None else [int(start_node)], chosen, reeb)
    cost = np.asarray(reeb.c_e if weight is None else weight, dtype=np.float64)[chosen]
    bad = np.flatnonzero(~(np.isfinite(cost) & (cost >= 0)))
    if len(bad):
        raise PlanningError(
            f"cell {chosen[bad[0]]}: weight {cost[bad[0]]} of the postman tour must be finite and"
            " 0 or more"
        )
    # Small numbers for the nodes in use, in order of the node's number.
    node_of, ends = np.unique(
        np.concatenate((reeb.tail[chosen], reeb.head[chosen])), return_inverse=True
    )
    tail: list[int] = ends[: len(chosen)].tolist()
    head: list[int] = ends[len(chosen) :].tolist()
    if start_node is None:
        start = tail[0]
    else:
        start = int(np.searchsorted(node_of, start_node))
        if start == len(node_of) or node_of[start] != start_node:
            raise PlanningError(
                f"start node {start_node} of the postman tour touches none of the"
                f" {len(chosen)} cells to walk; start at one of their ends"
            )
    blocks, reached = _blocks(len(node_of), tail, head)
    if reached < len(node_of):
        raise PlanningError(
            f"the {len(chosen)} cells of the postman tour are not connected: {reached} of"
            f" {len(node_of)} nodes are reached; plan each connected part alone"
        )
    largest = float(cost.max())
    unit = 2.0**WEIGHT_BITS / largest if largest > 0 else 0.0
    integer = [
        (round(c * unit) << TIE_SHIFT) + _tie_break(e)
        for c, e in zip(cost.tolist(), chosen.tolist(), strict=True)
    ]
    doubled: list[int] = []
    for block in blocks:
        doubled.extend(_doubled_of_block(block, tail, head, integer))
    steps, nodes = _euler_tour(len(node_of), tail, head, sorted(doubled), start)
    return _as_tour(steps, node_of[nodes].tolist(), chosen, reeb)


def _tie_break(edge: int) -> int:
    """Return 30 mixed bits of an edge's number (splitmix64).

    Added to the weights they leave one cheapest set where several tie, so that the tour does not
    hang on the order in which the solver meets them.
    """
    mask = 2**64 - 1
    x = (edge + 1) * 0x9E3779B97F4A7C15 & mask
    x = (x ^ x >> 30) * 0xBF58476D1CE4E5B9 & mask
    x = (x ^ x >> 27) * 0x94D049BB133111EB & mask
    return (x ^ x >> 31) >> 34


def _chosen_edges(reeb: ReebGraph, edges: npt.ArrayLike | None) -> IntArray:
    """Return the indices of the edges to walk, rising."""
    if edges is None:
        return np.arange(len(reeb.tail), dtype=np.int64)
    given = np.asarray(edges)
    if given.dtype == np.bool_:
        return np.flatnonzero(given).astype(np.int64)
    return np.unique(given.astype(np.int64))


def _as_tour(
    steps: list[tuple[int, int]], nodes: list[int], chosen: IntArray, reeb: ReebGraph
) -> PostmanTour:
    """Return the tour of `steps` (edge in `chosen`, 1 where it is doubled) through `nodes`."""
    edge = chosen[np.array([e for e, _ in steps], dtype=np.int64)]
    node = np.array(nodes, dtype=np.int64)
    copy = np.zeros(len(steps), dtype=np.int8)
    seen: set[int] = set()
    for i, (e, twice) in enumerate(steps):
        if twice:
            copy[i] = 2 if e in seen else 1
            seen.add(e)
    direction = np.where(reeb.tail[edge] == node[:-1], 1, -1) if steps else np.zeros(0)
    return PostmanTour(
        edge=read_only(edge),
        direction=read_only(direction.astype(np.int8)),
        copy=read_only(copy),
        node=read_only(node),
        doubled=read_only(np.unique(edge[copy == 2])),
    )


def _blocks(nodes: int, tail: list[int], head: list[int]) -> tuple[list[list[int]], int]:
    """Return the biconnected components of node 0's part as lists of edges, and its node count.

    Self-loops are in no block: walking one once is a closed walk already.
    """
    incident = _incidence(nodes, tail, head)
    depth = [-1] * nodes
    low = [0] * nodes
    blocks: list[list[int]] = []
    stack: list[int] = []
    depth[0] = 0
    reached = 1
    # (node, edge it was entered by, where to go on in its incidence list)
    path: list[tuple[int, int, int]] = [(0, -1, 0)]
    while path:
        v, entered, i = path.pop()
        if i < len(incident[v]):
            path.append((v, entered, i + 1))
            e = incident[v][i]
            u = tail[e] + head[e] - v
            if e == entered:
                continue
            if depth[u] < 0:
                depth[u] = low[u] = depth[v] + 1
                reached += 1
                stack.append(e)
                path.append((u, e, 0))
            elif depth[u] < depth[v]:
                stack.append(e)
                low[v] = min(low[v], depth[u])
        elif path:
            parent = path[-1][0]
            low[parent] = min(low[parent], low[v])
            if low[v] >= depth[parent]:
                at = len(stack) - 1
                while stack[at] != entered:
                    at -= 1
                blocks.append(stack[at:])
                del stack[at:]
    return blocks, reached


def _incidence(nodes: int, tail: list[int], head: list[int]) -> list[list[int]]:
    """Return the edges at every node, rising, without self-loops."""
    incident: list[list[int]] = [[] for _ in range(nodes)]
    for e, (a, b) in enumerate(zip(tail, head, strict=True)):
        if a != b:
            incident[a].append(e)
            incident[b].append(e)
    return incident


def _doubled_of_block(
    block: list[int], tail: list[int], head: list[int], weight: list[int]
) -> list[int]:
    """Return the edges of one block to walk twice, so that its degrees are even."""
    if len(block) == 1:
        return block
    incident: dict[int, list[int]] = {}
    for e in sorted(block):
        incident.setdefault(tail[e], []).append(e)
        incident.setdefault(head[e], []).append(e)
    if all(len(at) % 2 == 0 for at in incident.values()):
        return []
    # A chain through nodes of degree 2 is walked twice as a whole or not at all.
    chains: list[list[int]] = []
    half_edges: dict[int, list[int]] = {}
    used: set[int] = set()
    for anchor, at in incident.items():
        if len(at) == 2:
            continue
        for first in at:
            if first in used:
                continue
            chain = [first]
            v = tail[first] + head[first] - anchor
            while len(incident[v]) == 2:
                a, b = incident[v]
                e = b if a == chain[-1] else a
                chain.append(e)
                v = tail[e] + head[e] - v
            used.update(chain)
            half_edges.setdefault(anchor, []).append(2 * len(chains))
            half_edges.setdefault(v, []).append(2 * len(chains) + 1)
            chains.append(chain)
    cost = [sum(weight[e] for e in chain) for chain in chains]
    return [e for c in _min_even(cost, list(half_edges.values())) for e in chains[c]]


def _min_even(cost: list[int], nodes: list[list[int]]) -> list[int]:
    """Return the cheapest set of edges that, added a second time, makes every degree even.

    Edge ``i`` has the half-edges ``2 i`` and ``2 i + 1``; `nodes` lists the half-edges per node.
    A perfect matching of the half-edges of least cost gives the set: as many half-edges of a node
    are matched outside as its degree is odd or even, because the others are matched in pairs.
    """
    edges = len(cost)
    cost = list(cost)
    groups: list[list[int]] = []
    for at in nodes:
        rest = at
        # A node of high degree becomes a path of nodes of degree 3, joined at no cost: the matching
        # stays as sparse as the graph.
        while len(rest) > 4:
            joint = 2 * len(cost)
            cost.append(0)
            groups.append([rest[0], rest[1], joint])
            rest = [joint + 1, *rest[2:]]
        groups.append(rest)
    highest = max(cost)
    # The solver maximises: with every half-edge matched, least cost is most of (highest - cost).
    links = [(2 * i, 2 * i + 1, highest - c) for i, c in enumerate(cost)]
    for at in groups:
        links.extend((a, b, highest) for k, a in enumerate(at) for b in at[k + 1 :])
    graph = rustworkx.PyGraph(multigraph=False)
    graph.add_nodes_from(range(2 * len(cost)))
    graph.add_edges_from(links)
    matching = rustworkx.max_weight_matching(
        graph, max_cardinality=True, weight_fn=lambda value: value
    )
    if len(matching) != len(cost):
        raise PlanningError(
            f"the matching of the postman tour holds {len(matching)} of {len(cost)} pairs;"
            " this is a bug, please report it with the area"
        )
    return sorted(min(a, b) // 2 for a, b in matching if a // 2 == b // 2 and a // 2 < edges)


def _euler_tour(
    nodes: int, tail: list[int], head: list[int], doubled: list[int], start: int
) -> tuple[list[tuple[int, int]], list[int]]:
    """Return the steps (edge, 1 where doubled) and nodes of an Euler tour (Hierholzer)."""
    twice = set(doubled)
    walk: list[tuple[int, int]] = []
    leaving: list[list[int]] = [[] for _ in range(nodes)]
    for e, (a, b) in enumerate(zip(tail, head, strict=True)):
        for _ in range(2 if e in twice else 1):
            leaving[a].append(len(walk))
            if a != b:
                leaving[b].append(len(walk))
            walk.append((e, int(e in twice)))
    for at in leaving:
        at.reverse()
    used = [False] * len(walk)
    path: list[tuple[int, int]] = [(start, -1)]
    steps: list[tuple[int, int]] = []
    order: list[int] = []
    while path:
        v, entered = path[-1]
        while leaving[v] and used[leaving[v][-1]]:
            leaving[v].pop()
        if leaving[v]:
            k = leaving[v].pop()
            used[k] = True
            e = walk[k][0]
            path.append((tail[e] + head[e] - v, k))
        else:
            path.pop()
            order.append(v)
            if entered >= 0:
                steps.append(walk[entered])
    steps.reverse()
    order.reverse()
    return steps, order

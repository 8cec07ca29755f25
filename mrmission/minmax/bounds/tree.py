"""The tree of arms: how the ways home of the ends of lines run together.

Water with arms makes whoever works in one of them come and go through its mouth. The tree keeps,
for every pair of ends, a length up to which their ways from home can be counted as one: no more
than makes the rest of both shorter than the way between them.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numba import njit

from mrmission.minmax.bounds import prices_kernels
from mrmission.minmax.bounds.parts import Task
from mrmission.model import FloatArray, IntArray

LEAST_ENDS = 4
"""Nodes beyond which fewer ends lie are left out: a charge or a toll does the same for them."""
FINEST = 1 / 200
"""Nodes nearer than that part of the greatest depth to the one above them are left out."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Arms:
    """A tree with home at its root, node 0; nodes come after the one above them.

    Every node but the root has an end of a line at it or beyond it.

    Attributes
    ----------
    above
        (nodes,) the next node on the way home; 0 for the root itself.
    length
        (nodes,) seconds of the edge to it; 0 for the root.
    node
        (ends,) the node at which each end of a line sits.
    meet
        (nodes, nodes) where the ways home from two nodes meet.
    crossed
        (nodes,) how many lines have their ends on different sides of the edge, made even.
    """

    above: IntArray
    length: FloatArray
    node: IntArray
    meet: IntArray
    crossed: IntArray


def arms_of(task: Task, share: float, factor: float) -> Arms:
    """Return the tree of the ways home.

    Two ends are joined where half of what their depths exceed the way between them by is reached,
    the deepest first, so that no two ends are farther apart in the tree than in the water (Gromov
    product and single linkage) but for what leaving out nodes changes, twice `FINEST` at most.

    Parameters
    ----------
    task
        With a matrix of ways.
    share
        Which share of its seconds a line goes deeper by.
    factor
        On all lengths.
    """
    depth = prices_kernels.depths(task.line_s, task.table, task.home_s, share)
    a, b, join = _joins(task.end_s, depth, share * task.line_s)
    order = np.argsort(-join, kind="stable")
    above, height, node = _tree(
        a[order], b[order], np.maximum(join[order], 0.0), depth, LEAST_ENDS, depth.max() * FINEST
    )
    meet = _meets(above)
    return Arms(
        above=above,
        length=factor * (height - height[above]),
        node=node,
        meet=meet,
        crossed=_crossed(above, node, meet),
    )


@njit(cache=True)
def _joins(end_s, depth, along_s):  # type: ignore[no-untyped-def]
    """Return the greatest spanning tree over (depth + depth - way) / 2: pairs of ends, and it."""
    m = len(depth)
    best = np.full(m, -np.inf)
    source = np.zeros(m, np.int64)
    done = np.zeros(m, np.bool_)
    first, second = np.zeros(m - 1, np.int64), np.zeros(m - 1, np.int64)
    join = np.zeros(m - 1)
    at = 0
    for turn in range(m - 1):
        done[at] = True
        nearest = -1
        for b in range(m):
            if done[b]:
                continue
            way = min(end_s[at, b], along_s[at >> 1]) if b == at ^ 1 else end_s[at, b]
            value = 0.5 * (depth[at] + depth[b] - way)
            if value > best[b]:
                best[b] = value
                source[b] = at
            if nearest < 0 or best[b] > best[nearest]:
                nearest = b
        first[turn], second[turn], join[turn] = source[nearest], nearest, best[nearest]
        at = nearest
    return first, second, join


@njit(cache=True)
def _tree(first, second, join, depth, least_ends, finest):  # type: ignore[no-untyped-def]
    """Return nodes, their heights and where ends sit, of ends joined in the order given."""
    m = len(depth)
    group = np.arange(2 * m)
    above = np.full(2 * m, 2 * m - 1)
    ends = np.ones(2 * m, np.int64)
    height = np.zeros(2 * m)
    for turn in range(m - 1):
        new = m + turn
        ends[new] = 0
        height[new] = join[turn]
        for end in (first[turn], second[turn]):
            x = end
            while group[x] != x:
                group[x] = group[group[x]]
                x = group[x]
            above[x] = new
            group[x] = new
            ends[new] += ends[x]
    # the last of all is home
    kept = np.zeros(2 * m, np.int64)
    kept_above = np.zeros(m + 1, np.int64)
    kept_height = np.zeros(m + 1)
    count = 1
    for x in range(2 * m - 2, -1, -1):
        up = kept[above[x]]
        kept[x] = up
        if x >= m and ends[x] >= least_ends and height[x] >= kept_height[up] + finest:
            kept_above[count] = up
            kept_height[count] = height[x]
            kept[x] = count
            count += 1
    return kept_above[:count].copy(), kept_height[:count].copy(), kept[:m].copy()


@njit(cache=True)
def _meets(above):  # type: ignore[no-untyped-def]
    """Return where the ways home from each two nodes meet."""
    nodes = len(above)
    meet = np.zeros((nodes, nodes), np.int64)
    for a in range(nodes):
        v = a
        while v > 0:
            meet[a, v] = v
            v = above[v]
        for v in range(1, nodes):
            if meet[a, v] == 0:
                meet[a, v] = meet[a, above[v]]
    return meet


@njit(cache=True)
def _crossed(above, node, meet):  # type: ignore[no-untyped-def]
    """Return how many lines cross each edge, made even."""
    count = np.zeros(len(above), np.int64)
    for i in range(len(node) // 2):
        a, b = node[2 * i], node[2 * i + 1]
        count[a] += 1
        count[b] += 1
        count[meet[a, b]] -= 2
    for v in range(len(above) - 1, 0, -1):
        count[above[v]] += count[v]
    return count + count % 2

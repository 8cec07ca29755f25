"""Compiled kernel for in-water lengths from some points to very many others.

The helpers are those of :mod:`mrmission.routing.visibility` and :mod:`mrmission.routing.matrix`.
numba's cache of a kernel looks only at the kernel's own file: after a change of a helper there,
touch this file as well.
"""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt
from numba import njit

from mrmission.routing.matrix import (
    _SLACK,
    GROUP,
    REGION,
    _block_regions,
    _least_of_blocks,
    _search_group,
    seen_corners,
)
from mrmission.routing.shore_grid import Float, Grid
from mrmission.routing.visibility import (
    BLOCK,
    Graph,
    _clear,
    _none_tangent,
    _pop,
    _push,
    _tangent,
)


@njit(cache=True, error_model="numpy")
def group_distances(
    grid: Grid,
    graph: Graph,
    sources: Float,
    order: npt.NDArray[np.int64],
    targets: Float,
    target_order: npt.NDArray[np.int64],
    top: float,
) -> Float:
    """Return the (s, t) lengths of `many_distances`, for far more targets than sources.

    Which corners a target sees is asked only of those by which a way may be no longer than the
    one by what is next to it, nearest to the sources first; `target_order` puts targets that lie
    together next to each other, `top` is longer than any way.
    """
    node, before, after, block = graph[0], graph[1], graph[2], graph[4]
    n = len(node)
    s_start, s_corner, s_away = seen_corners(grid, graph, sources)
    out = np.empty((len(sources), len(targets)))
    label = np.empty((n, GROUP))
    stop = np.empty(2 * n, np.int32)
    queued = np.empty(n)
    key = np.empty(4 * n + 16)
    what = np.empty(4 * n + 16, np.int32)
    near_key = np.empty(n + 1)
    near_what = np.empty(n + 1, np.int32)
    first_of = np.empty(n)
    least = np.empty(len(block))
    region, span = _block_regions(block)
    region_least = np.empty(len(region))
    best = np.empty(GROUP)
    for first in range(0, len(sources), GROUP):
        member = order[first : first + GROUP]
        many = len(member)
        _search_group(
            graph, sources, member, s_start, s_corner, s_away, label, stop, queued, key, what
        )
        for v in range(n):
            first_of[v] = math.inf
            for b in range(many):
                first_of[v] = min(first_of[v], label[v, b])
        _least_of_blocks(first_of, least, region_least)
        previous = -1
        for place in range(len(targets)):
            t = target_order[place]
            tx, ty = targets[t, 0], targets[t, 1]
            step = math.inf
            if previous >= 0:
                px, py = targets[previous, 0], targets[previous, 1]
                if _clear(grid, px, py, tx, ty):
                    step = math.hypot(px - tx, py - ty)
            apart = math.inf if previous < 0 else math.hypot(px - tx, py - ty)
            limit = 0.0
            for b in range(many):
                s = member[b]
                sx, sy = sources[s, 0], sources[s, 1]
                straight = math.hypot(tx - sx, ty - sy)
                best[b] = math.inf
                # Who is seen from s can't be farther than straight from what is next to it.
                if straight == 0.0 or (
                    (step == math.inf or out[s, previous] <= straight + step + _SLACK * straight)
                    and _clear(grid, sx, sy, tx, ty)
                ):
                    best[b] = straight
                # a guess, where land lies between the two; made larger until it is none
                guess = math.inf if previous < 0 else out[s, previous] + apart
                limit = max(limit, min(best[b], guess))
            limit += _SLACK * limit
            while True:
                count = 0
                for r in range(len(region)):
                    away = math.hypot(region[r, 0] - tx, region[r, 1] - ty) - span[r]
                    if not region_least[r] + max(0.0, away) <= limit:
                        continue
                    for u in range(r * REGION, min(len(block), (r + 1) * REGION)):
                        away = math.hypot(block[u, 0] - tx, block[u, 1] - ty) - block[u, 2]
                        if not least[u] + max(0.0, away) <= limit or _none_tangent(
                            block, u, tx, ty
                        ):
                            continue
                        for v in range(u * BLOCK, min(n, (u + 1) * BLOCK)):
                            x, y = node[v, 0], node[v, 1]
                            way = first_of[v] + math.hypot(tx - x, ty - y)
                            if way <= limit and _tangent(
                                x, y, before[v, 0], before[v, 1], after[v, 0], after[v, 1], tx, ty
                            ):
                                count = _push(near_key, near_what, count, way, v)
                while count > 0:
                    worst = 0.0
                    for b in range(many):
                        worst = max(worst, best[b])
                    v = near_what[0]
                    if near_key[0] > worst:
                        break
                    count = _pop(near_key, near_what, count)
                    x, y = node[v, 0], node[v, 1]
                    away = math.hypot(x - tx, y - ty)
                    gains = False
                    for b in range(many):
                        gains = gains or label[v, b] + away < best[b]
                    if gains and _clear(grid, tx, ty, x, y):
                        for b in range(many):
                            best[b] = min(best[b], label[v, b] + away)
                worst = 0.0
                for b in range(many):
                    worst = max(worst, best[b])
                if worst <= limit:
                    break
                if worst < math.inf or limit > top:
                    limit = worst + _SLACK * worst
                else:
                    limit = 2.0 * limit + 1.0
            for b in range(many):
                out[member[b], t] = best[b]
            previous = t
    return out

"""Compiled kernels for many in-water lengths at once: all of some points to all of others.

Sources that lie together have nearly the same tree of shortest ways, so the corner graph is walked
for :data:`GROUP` of them at a time, with their labels side by side in the cache. Which corners
a point sees is found once per point.

The helpers are those of :mod:`mrmission.routing.visibility`. numba's cache of a kernel looks only
at the kernel's own file: after a change of a helper there, touch this file as well.
"""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt
from numba import njit

from mrmission.routing.shore_grid import Float, Grid, Int
from mrmission.routing.visibility import (
    BLOCK,
    Graph,
    _clear,
    _longer_float,
    _longer_int,
    _none_tangent,
    _onward,
    _pop,
    _push,
    _tangent,
)

GROUP = 16
REGION = 16
FEW_SOURCES = 3
"""With so few sources the last corner of each way is looked for among those that make it short."""
_SLACK = 1e-9


@njit(cache=True, error_model="numpy")
def seen_corners(
    grid: Grid, graph: Graph, points: Float
) -> tuple[npt.NDArray[np.int64], Int, Float]:
    """Return, as CSR, the corners that each point sees at a tangent, and how far they are."""
    node, before, after, block = graph[0], graph[1], graph[2], graph[4]
    n = len(node)
    start = np.zeros(len(points) + 1, np.int64)
    corner = np.empty(16 * len(points) + 16, np.int32)
    away = np.empty(16 * len(points) + 16)
    count = 0
    for p in range(len(points)):
        px, py = points[p, 0], points[p, 1]
        for u in range(len(block)):
            if _none_tangent(block, u, px, py):
                continue
            for v in range(u * BLOCK, min(n, (u + 1) * BLOCK)):
                x, y = node[v, 0], node[v, 1]
                if not _tangent(
                    x, y, before[v, 0], before[v, 1], after[v, 0], after[v, 1], px, py
                ) or not _clear(grid, px, py, x, y):
                    continue
                if count == len(corner):
                    corner = _longer_int(corner, 2 * count)
                    away = _longer_float(away, 2 * count)
                corner[count] = v
                away[count] = math.hypot(x - px, y - py)
                count += 1
        start[p + 1] = count
    return start, corner, away


@njit(cache=True, error_model="numpy")
def _ask(start: Int, hug: Float, land: Float, stop: Int, v: int, x: float, y: float) -> None:
    """Mark the legs from corner v on which a way that came by the vector (x, y) goes on."""
    first, last = _onward(start, hug, land, v, x, y)
    for slot in range(2 * v, 2 * v + 2):
        if first <= start[slot] < last:
            stop[slot] = max(stop[slot], min(last, start[slot + 1]))


@njit(cache=True, error_model="numpy")
def _search_group(
    graph: Graph,
    sources: Float,
    member: npt.NDArray[np.int64],
    s_start: npt.NDArray[np.int64],
    s_corner: Int,
    s_away: Float,
    label: Float,
    stop: Int,
    queued: Float,
    key: Float,
    what: Int,
) -> None:
    """Label all corners with their distances from each source of a group.

    A corner is taken up again whenever its distance from one of the sources has become shorter, so
    the labels are exact whatever the order. `stop` holds for each side of a corner the end of the
    legs that are yet to be walked from it.
    """
    node, land, start, neighbour = graph[0], graph[3], graph[5], graph[6]
    hug, length, onward = graph[7], graph[8], graph[9]
    n = len(node)
    for v in range(n):
        queued[v] = math.inf
        stop[2 * v] = start[2 * v]
        stop[2 * v + 1] = start[2 * v + 1]
        for b in range(GROUP):
            label[v, b] = math.inf
    count = 0
    for b in range(len(member)):
        s = member[b]
        for k in range(s_start[s], s_start[s + 1]):
            v = s_corner[k]
            label[v, b] = s_away[k]
            _ask(start, hug, land, stop, v, node[v, 0] - sources[s, 0], node[v, 1] - sources[s, 1])
            if s_away[k] < queued[v]:
                if count == len(key):
                    key = _longer_float(key, 2 * count)
                    what = _longer_int(what, 2 * count)
                queued[v] = s_away[k]
                count = _push(key, what, count, s_away[k], v)
    while count > 0:
        v = what[0]
        now = key[0]
        count = _pop(key, what, count)
        if queued[v] != now:
            continue
        queued[v] = math.inf
        for slot in range(2 * v, 2 * v + 2):
            until = stop[slot]
            stop[slot] = start[slot]
            for first in range(start[slot], until):
                k = first
                u = v
                while True:
                    w = neighbour[k]
                    step = length[k]
                    nearest = math.inf
                    for b in range(GROUP):
                        reached = label[u, b] + step
                        if reached < label[w, b]:
                            label[w, b] = reached
                            nearest = min(nearest, reached)
                    if nearest == math.inf:
                        break
                    one, last = onward[k, 0], onward[k, 1]
                    if last - one == 1:
                        u, k = w, one  # only one way on: take it at once
                        continue
                    if one < last:
                        side = 2 * w if one < start[2 * w + 1] else 2 * w + 1
                        stop[side] = max(stop[side], last)
                        if nearest < queued[w]:
                            if count == len(key):
                                key = _longer_float(key, 2 * count)
                                what = _longer_int(what, 2 * count)
                            queued[w] = nearest
                            count = _push(key, what, count, nearest, w)
                    break


@njit(cache=True, error_model="numpy")
def many_distances(
    grid: Grid,
    graph: Graph,
    sources: Float,
    order: npt.NDArray[np.int64],
    targets: Float,
    symmetric: bool,
    last: Int,
) -> Float:
    """Return the (s, t) lengths of the shortest paths; `symmetric`: targets are the sources.

    `order` puts sources that lie together next to each other. Unless it is empty, `last`, (s, t),
    is given the last corner of each path, -1 where there is none.
    """
    n = len(graph[0])
    s_start, s_corner, s_away = seen_corners(grid, graph, sources)
    t_start, t_corner, t_away = s_start, s_corner, s_away
    if not symmetric:
        t_start, t_corner, t_away = seen_corners(grid, graph, targets)
    out = np.empty((len(sources), len(targets)))
    label = np.empty((n, GROUP))
    stop = np.empty(2 * n, np.int32)
    queued = np.empty(n)
    key = np.empty(4 * n + 16)
    what = np.empty(4 * n + 16, np.int32)
    best = np.empty(GROUP)
    for first in range(0, len(sources), GROUP):
        member = order[first : first + GROUP]
        many = len(member)
        _search_group(
            graph, sources, member, s_start, s_corner, s_away, label, stop, queued, key, what
        )
        previous = -1
        step = 0.0
        for place in range(first if symmetric else 0, len(targets)):
            t = order[place] if symmetric else place
            tx, ty = targets[t, 0], targets[t, 1]
            for b in range(GROUP):
                best[b] = math.inf
            for k in range(t_start[t], t_start[t + 1]):
                v, away = t_corner[k], t_away[k]
                for b in range(GROUP):
                    reached = label[v, b] + away
                    best[b] = reached if reached < best[b] else best[b]
            if previous >= 0:
                px, py = targets[previous, 0], targets[previous, 1]
                step = math.hypot(px - tx, py - ty)
                if not _clear(grid, px, py, tx, ty):
                    step = math.inf
            for b in range(many):
                s = member[b]
                sx, sy = sources[s, 0], sources[s, 1]
                straight = math.hypot(tx - sx, ty - sy)
                # Who is seen from s can't be farther than straight from what is next to it.
                if straight < best[b] and (
                    straight == 0.0
                    or (
                        (previous < 0 or out[s, previous] <= straight + step + _SLACK * straight)
                        and _clear(grid, sx, sy, tx, ty)
                    )
                ):
                    best[b] = straight
                out[s, t] = best[b]
                if len(last) > 0:
                    last[s, t] = -1
                    for k in range(t_start[t], t_start[t + 1]):
                        if label[t_corner[k], b] + t_away[k] <= best[b]:
                            last[s, t] = t_corner[k]
                            break
                if symmetric:
                    out[t, s] = best[b]
            previous = t
    return out


@njit(cache=True, error_model="numpy")
def few_distances(
    grid: Grid, graph: Graph, sources: Float, targets: Float, order: npt.NDArray[np.int64]
) -> Float:
    """Return the (s, t) lengths of the shortest paths from few sources.

    The last corner of each path is looked for among those that would make it no longer than the
    way by what is next to the target; `order` puts targets that lie together next to each other.
    """
    node, before, after, land, block, start, neighbour, hug, length, onward = graph
    n = len(node)
    s_start, s_corner, s_away = seen_corners(grid, graph, sources)
    out = np.empty((len(sources), len(targets)))
    label = np.empty(n)
    back = np.empty(n, np.int32)
    via = np.empty(n, np.int32)
    done = np.empty(n, np.uint8)
    # Every leg is pushed once at most, and every corner once from the start.
    key = np.empty(len(neighbour) + n)
    what = np.empty(len(neighbour) + n, np.int32)
    bend = np.empty(n)
    on_left = np.empty(n, np.bool_)
    least = np.empty(len(block))
    region, span = _block_regions(block)
    region_least = np.empty(len(region))
    for s in range(len(sources)):
        sx, sy = sources[s, 0], sources[s, 1]
        for v in range(n):
            label[v] = math.inf
            done[v] = 0
        count = 0
        for k in range(s_start[s], s_start[s + 1]):
            v = s_corner[k]
            label[v] = s_away[k]
            back[v] = via[v] = -1
            count = _push(key, what, count, label[v], v)
        while count > 0:
            v = what[0]
            count = _pop(key, what, count)
            if done[v] == 1:
                continue
            done[v] = 1
            x, y = node[v, 0], node[v, 1]
            if via[v] < 0:
                first, stop = _onward(start, hug, land, v, x - sx, y - sy)
            else:
                first, stop = onward[via[v], 0], onward[via[v], 1]
            for k in range(first, stop):
                w = neighbour[k]
                reached = label[v] + length[k]
                if reached < label[w]:
                    label[w] = reached
                    back[w] = v
                    via[w] = k
                    # Most corners are dead ends that way round: their label is all there is to it.
                    if onward[k, 0] < onward[k, 1]:
                        count = _push(key, what, count, reached, w)
        for v in range(n):
            # How the way to v hugs the land there: a taut path goes on hugging it more.
            bend[v] = -2.0
            on_left[v] = False
            if label[v] < math.inf:
                inx, iny = node[v, 0] - sx, node[v, 1] - sy
                if back[v] >= 0:
                    inx, iny = node[v, 0] - node[back[v], 0], node[v, 1] - node[back[v], 1]
                size = math.hypot(inx, iny)
                if size > 1e-6:
                    on_left[v] = land[v, 0] * iny - land[v, 1] * inx < 0.0
                    bend[v] = (inx * land[v, 0] + iny * land[v, 1]) / size - 1e-9
        _least_of_blocks(label, least, region_least)
        previous = last = -1
        for place in range(len(targets)):
            t = order[place]
            tx, ty = targets[t, 0], targets[t, 1]
            straight = math.hypot(tx - sx, ty - sy)
            if straight == 0.0 or _clear(grid, sx, sy, tx, ty):
                out[s, t] = straight
                previous, last = t, -1
                continue
            limit = math.inf
            if previous >= 0:
                px, py = targets[previous, 0], targets[previous, 1]
                if last >= 0 and _clear(grid, node[last, 0], node[last, 1], tx, ty):
                    limit = label[last] + math.hypot(node[last, 0] - tx, node[last, 1] - ty)
                elif _clear(grid, px, py, tx, ty):
                    limit = out[s, previous] + math.hypot(px - tx, py - ty)
            limit += _SLACK * limit
            best = math.inf
            while True:
                many = 0
                for r in range(len(region)):
                    away = math.hypot(region[r, 0] - tx, region[r, 1] - ty) - span[r]
                    if region_least[r] + max(0.0, away) > limit:
                        continue
                    for u in range(r * REGION, min(len(block), (r + 1) * REGION)):
                        away = math.hypot(block[u, 0] - tx, block[u, 1] - ty) - block[u, 2]
                        if least[u] + max(0.0, away) > limit or _none_tangent(block, u, tx, ty):
                            continue
                        for v in range(u * BLOCK, min(n, (u + 1) * BLOCK)):
                            x, y = node[v, 0], node[v, 1]
                            outx, outy = tx - x, ty - y
                            size = math.hypot(outx, outy)
                            if not label[v] + size <= limit or not _tangent(
                                x, y, before[v, 0], before[v, 1], after[v, 0], after[v, 1], tx, ty
                            ):
                                continue
                            if size > 1e-6 and bend[v] > -1.5:
                                left = land[v, 0] * outy - land[v, 1] * outx < 0.0
                                if (
                                    left != on_left[v]
                                    or outx * land[v, 0] + outy * land[v, 1] < bend[v] * size
                                ):
                                    continue
                            if label[v] < math.inf:
                                many = _push(key, what, many, label[v] + size, v)
                while many > 0:
                    if _clear(grid, node[what[0], 0], node[what[0], 1], tx, ty):
                        best = key[0]
                        last = what[0]
                        break
                    many = _pop(key, what, many)
                if best < math.inf or limit == math.inf:
                    break
                limit = math.inf
            out[s, t] = best
            previous = t
    return out


@njit(cache=True, error_model="numpy")
def _least_of_blocks(label: Float, least: Float, region_least: Float) -> None:
    """Set the least label of the corners of each block, and of the blocks of each region."""
    for u in range(len(least)):
        least[u] = math.inf
        for v in range(u * BLOCK, min(len(label), (u + 1) * BLOCK)):
            least[u] = min(least[u], label[v])
    for r in range(len(region_least)):
        region_least[r] = math.inf
        for u in range(r * REGION, min(len(least), (r + 1) * REGION)):
            region_least[r] = min(region_least[r], least[u])


@njit(cache=True, error_model="numpy")
def _block_regions(block: Float) -> tuple[Float, Float]:
    """Return centres (r, 2) and radii of the circles about every `REGION` blocks of corners."""
    count = (len(block) + REGION - 1) // REGION
    centre = np.empty((count, 2))
    span = np.zeros(count)
    for r in range(count):
        first, stop = r * REGION, min(len(block), (r + 1) * REGION)
        for axis in range(2):
            low, high = math.inf, -math.inf
            for u in range(first, stop):
                low, high = min(low, block[u, axis]), max(high, block[u, axis])
            centre[r, axis] = 0.5 * (low + high)
        for u in range(first, stop):
            off = math.hypot(block[u, 0] - centre[r, 0], block[u, 1] - centre[r, 1])
            span[r] = max(span[r], off + block[u, 2])
    return centre, span

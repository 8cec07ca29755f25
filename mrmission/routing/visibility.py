"""Compiled kernels for in-water paths: who sees whom, tangent visibility graph, shortest paths.

The land is shrunk by a hair (`tolerance`, about 1e-7 m) before anything is tested against it, and
paths bend at the corners of the land as given. So a leg along the shore, through a point where two
islands touch, or over a row of corners on one line is clear of the shrunk land by far more than a
rounding error: there is no degenerate case left for a floating-point predicate to get wrong.

Rays walk a uniform grid of the shore's edges and leap over open water by the cells' distance to the
next shore cell. The arrays travel in two tuples, so that few signatures are compiled.
"""

from __future__ import annotations

import math
from typing import TypeAlias

import numpy as np
import numpy.typing as npt
from numba import njit

from mrmission import libm
from mrmission.routing.shore_grid import Float, Grid, Int

Graph: TypeAlias = tuple[Float, Float, Float, Float, Float, Int, Int, Float, Float, Int]
"""``(node, before, after, land, block, start, neighbour, hug, length, onward)``.

node: (n, 2) land corners; before, after: their neighbours on the ring; land: unit vector into the
land; block: bounds of runs of corners. Slot ``2 v`` are the legs from corner v that have the land
on their right, ``2 v + 1`` on their left: ``neighbour[start[slot]:start[slot + 1]]``, sorted by
hug, minus the cosine between the leg and the land. A taut path that came by leg k goes on by the
legs ``onward[k, 0]`` to ``onward[k, 1]`` (exclusive).
"""

BLOCK = 6


@njit(cache=True, error_model="numpy")
def _clear(grid: Grid, ax: float, ay: float, bx: float, by: float) -> bool:
    """Return whether the segment stays off the shrunk land."""
    frame, shape, start, item, leap, _, shrunk, _ = grid
    size = frame[2]
    columns, rows = shape[0], shape[1]
    dx, dy = bx - ax, by - ay
    ux, uy = (ax - frame[0]) / size, (ay - frame[1]) / size
    vx, vy = dx / size, dy / size
    c = min(max(int(ux), 0), columns - 1)
    r = min(max(int(uy), 0), rows - 1)
    inverse_x = 1.0 / vx if vx != 0.0 else 0.0
    inverse_y = 1.0 / vy if vy != 0.0 else 0.0
    while True:
        i = c * rows + r
        reach = leap[i] - 1
        if reach < 0:
            reach = 0
            for k in range(start[i], start[i + 1]):
                e = item[k]
                px, py = shrunk[e, 0], shrunk[e, 1]
                qx, qy = shrunk[e, 2], shrunk[e, 3]
                side_p = dx * (py - ay) - dy * (px - ax)
                side_q = dx * (qy - ay) - dy * (qx - ax)
                if (side_p >= 0.0) != (side_q >= 0.0):
                    ex, ey = qx - px, qy - py
                    side_a = ex * (ay - py) - ey * (ax - px)
                    side_b = ex * (by - py) - ey * (bx - px)
                    if (side_a >= 0.0) != (side_b >= 0.0):
                        return False
        tx = ty = 2.0
        if vx > 0.0:
            tx = (c + reach + 1 - ux) * inverse_x
        elif vx < 0.0:
            tx = (c - reach - ux) * inverse_x
        if vy > 0.0:
            ty = (r + reach + 1 - uy) * inverse_y
        elif vy < 0.0:
            ty = (r - reach - uy) * inverse_y
        if tx < ty:
            if tx >= 1.0:
                return True
            c += reach + 1 if vx > 0.0 else -reach - 1
            r = min(max(int(uy + tx * vy), r - reach), r + reach)
        else:
            if ty >= 1.0:
                return True
            r += reach + 1 if vy > 0.0 else -reach - 1
            c = min(max(int(ux + ty * vx), c - reach), c + reach)
        if c < 0 or r < 0 or c >= columns or r >= rows:
            return True


@njit(cache=True, error_model="numpy")
def clear_pairs(grid: Grid, a: Float, b: Float) -> npt.NDArray[np.bool_]:
    """Return for every pair whether the segment from `a` to `b` stays in the water."""
    out = np.empty(len(a), np.bool_)
    for i in range(len(a)):
        out[i] = _clear(grid, a[i, 0], a[i, 1], b[i, 0], b[i, 1])
    return out


@njit(cache=True, error_model="numpy")
def _tangent(
    x: float, y: float, bx: float, by: float, ax: float, ay: float, px: float, py: float
) -> bool:
    """Return whether the line from p grazes the corner (x, y) with ring neighbours b and a."""
    dx, dy = x - px, y - py
    before = dx * (by - y) - dy * (bx - x)
    after = dx * (ay - y) - dy * (ax - x)
    slack = 1e-6 * (abs(dx) + abs(dy))
    return not ((before > slack and after < -slack) or (before < -slack and after > slack))


@njit(cache=True, error_model="numpy")
def _none_tangent(block: Float, k: int, px: float, py: float) -> bool:
    """Return True where no line from p grazes any corner of block k (never True by mistake).

    All edges at the block's corners point within an angle of the mean direction, and all corners
    lie in a disc. Where p lies on one side of every such edge, every corner is merely passed.
    """
    dx, dy = block[k, 0] - px, block[k, 1] - py
    radius, sine, cosine = block[k, 2], block[k, 5], block[k, 6]
    away = dx * dx + dy * dy
    if cosine <= 0.0 or away * cosine * cosine <= radius * radius:
        return False
    side = abs(dx * block[k, 4] - dy * block[k, 3])
    return side > sine * math.sqrt(away - radius * radius) + cosine * radius


def corner_blocks(node: Float, before: Float, after: Float) -> Float:
    """Return centre, radius, mean edge direction, sine and cosine of its spread, per block."""
    if len(node) == 0:
        return np.zeros((0, 7))
    first = np.arange(0, len(node), BLOCK)
    low, high = np.minimum.reduceat(node, first), np.maximum.reduceat(node, first)
    edges = np.stack([node - before, after - node])
    edges /= np.hypot(edges[..., 0], edges[..., 1])[..., None]
    mean = np.add.reduceat(edges.sum(axis=0), first)
    size = np.hypot(mean[:, 0], mean[:, 1])
    mean /= np.maximum(size, 1e-6)[:, None]
    cosine = (edges * np.repeat(mean, BLOCK, axis=0)[: len(node)]).sum(axis=2).min(axis=0)
    # Some slack, so that rounding never hides a corner.
    spread = libm.arccos(np.clip(np.minimum.reduceat(cosine, first), -1, 1)) + 1e-3
    spread[size < 1e-6] = np.pi
    out = np.empty((len(first), 7))
    out[:, :2] = (low + high) / 2
    out[:, 2] = np.hypot(*(high - low).T) * 0.5000005 + 1e-5
    out[:, 3:5] = mean
    out[:, 5], out[:, 6] = libm.sin(spread), libm.cos(spread)
    return out


@njit(cache=True, error_model="numpy")
def _longer_int(array: Int, size: int) -> Int:
    """Return a longer copy (slices would take a second each to compile)."""
    out = np.empty(size, np.int32)
    for i in range(min(size, len(array))):
        out[i] = array[i]
    return out


@njit(cache=True, error_model="numpy")
def _longer_float(array: Float, size: int) -> Float:
    """Return a longer copy."""
    out = np.empty(size)
    for i in range(min(size, len(array))):
        out[i] = array[i]
    return out


@njit(cache=True, error_model="numpy")
def _push(key: Float, what: Int, count: int, new_key: float, new_what: int) -> int:
    """Push onto a binary heap that has room; returns the new count."""
    i = count
    while i > 0:
        up = (i - 1) >> 1
        if key[up] <= new_key:
            break
        key[i], what[i] = key[up], what[up]
        i = up
    key[i], what[i] = new_key, new_what
    return count + 1


@njit(cache=True, error_model="numpy")
def _pop(key: Float, what: Int, count: int) -> int:
    """Remove the top of a binary heap; returns the new count."""
    count -= 1
    last_key, last_what = key[count], what[count]
    i = 0
    while True:
        down = 2 * i + 1
        if down >= count:
            break
        if down + 1 < count and key[down + 1] < key[down]:
            down += 1
        if key[down] >= last_key:
            break
        key[i], what[i] = key[down], what[down]
        i = down
    key[i], what[i] = last_key, last_what
    return count


@njit(cache=True, error_model="numpy")
def _onward(start: Int, hug: Float, land: Float, v: int, x: float, y: float) -> tuple[int, int]:
    """Return the legs from corner v on which a taut path that came by the vector (x, y) goes on.

    A taut path turns towards the land it hugs: it keeps the land on the same side, on a leg that
    hugs it at least as much as the straight continuation. One that starts at the corner itself may
    go anywhere.
    """
    size = math.hypot(x, y)
    if size < 1e-6:
        return start[2 * v], start[2 * v + 2]
    widest = 1e-9 - (x * land[v, 0] + y * land[v, 1]) / size
    slot = 2 * v + (land[v, 0] * y - land[v, 1] * x < 0.0)
    low, high = start[slot], start[slot + 1]
    while low < high:
        middle = (low + high) >> 1
        if hug[middle] <= widest:
            low = middle + 1
        else:
            high = middle
    return start[slot], low


@njit(cache=True, error_model="numpy")
def build_graph(
    grid: Grid, node: Float, before: Float, after: Float, land: Float, block: Float
) -> Graph:
    """Return the tangent visibility graph of the land corners."""
    n = len(node)
    room = 16 * n + 16
    tail = np.empty(room, np.int32)
    head = np.empty(room, np.int32)
    count = 0
    start = np.zeros(2 * n + 1, np.int32)
    for i in range(n):
        x, y = node[i, 0], node[i, 1]
        bx, by, ax, ay = before[i, 0] - x, before[i, 1] - y, after[i, 0] - x, after[i, 1] - y
        b_size, a_size = math.hypot(bx, by), math.hypot(ax, ay)
        for k in range(i // BLOCK, len(block)):
            cx, cy, radius = block[k, 0] - x, block[k, 1] - y, block[k, 2]
            s1 = cx * by - cy * bx
            s2 = cx * ay - cy * ax
            r1, r2 = radius * b_size, radius * a_size
            if (s1 > r1 and s2 < -r2) or (s1 < -r1 and s2 > r2):
                continue
            if _none_tangent(block, k, x, y):
                continue
            for j in range(max(i + 1, k * BLOCK), min(n, (k + 1) * BLOCK)):
                qx, qy = node[j, 0], node[j, 1]
                if (
                    (qx == x and qy == y)
                    or not _tangent(
                        qx, qy, before[j, 0], before[j, 1], after[j, 0], after[j, 1], x, y
                    )
                    or not _tangent(x, y, x + bx, y + by, x + ax, y + ay, qx, qy)
                    or not _clear(grid, x, y, qx, qy)
                ):
                    continue
                if count == room:
                    room *= 2
                    tail = _longer_int(tail, room)
                    head = _longer_int(head, room)
                tail[count] = i
                head[count] = j
                count += 1
                left = land[i, 0] * (qy - y) - land[i, 1] * (qx - x) < 0.0
                start[2 * i + left + 1] += 1
                left = land[j, 0] * (y - qy) - land[j, 1] * (x - qx) < 0.0
                start[2 * j + left + 1] += 1
    for i in range(2 * n):
        start[i + 1] += start[i]
    fill = _longer_int(start, 2 * n)
    neighbour = np.empty(2 * count, np.int32)
    hug = np.empty(2 * count)
    length = np.empty(2 * count)
    for k in range(2 * count):
        if k < count:
            i, j = tail[k], head[k]
        else:
            i, j = head[k - count], tail[k - count]
        dx, dy = node[j, 0] - node[i, 0], node[j, 1] - node[i, 1]
        slot = 2 * i + (land[i, 0] * dy - land[i, 1] * dx < 0.0)
        neighbour[fill[slot]] = j
        hug[fill[slot]] = -(dx * land[i, 0] + dy * land[i, 1]) / math.hypot(dx, dy)
        fill[slot] += 1
    # Each side's legs, those first that hug the land most.
    key = np.empty(n)
    what = np.empty(n, np.int32)
    for slot in range(2 * n):
        many = 0
        for k in range(start[slot], start[slot + 1]):
            many = _push(key, what, many, hug[k], neighbour[k])
        i = slot // 2
        for k in range(start[slot], start[slot + 1]):
            hug[k], j = key[0], what[0]
            many = _pop(key, what, many)
            neighbour[k] = j
            length[k] = math.hypot(node[j, 0] - node[i, 0], node[j, 1] - node[i, 1])
    onward = np.empty((2 * count, 2), np.int32)
    for i in range(n):
        for k in range(start[2 * i], start[2 * i + 2]):
            j = neighbour[k]
            first, stop = _onward(
                start, hug, land, j, node[j, 0] - node[i, 0], node[j, 1] - node[i, 1]
            )
            onward[k, 0], onward[k, 1] = first, stop
    return node, before, after, land, block, start, neighbour, hug, length, onward


@njit(cache=True, error_model="numpy")
def pair_paths(grid: Grid, graph: Graph, a: Float, b: Float, top: float) -> tuple[Float, Int, Int]:
    """Return the lengths and the corners of the shortest paths from ``a[i]`` to ``b[i]``.

    A* with the straight distance, inside an ellipse of foci a and b that grows until it holds the
    path. Whether a corner is seen from a or b is tested only when the search gets to it. `top` is
    longer than any path.
    """
    node, before, after, land, block, start, neighbour, hug, length, onward = graph
    n = len(node)
    out = np.empty(len(a))
    bends_start = np.zeros(len(a) + 1, np.int32)
    bends = np.empty(4 * len(a) + 16, np.int32)
    filled = 0
    label = np.empty(n)
    back = np.empty(n, np.int32)
    via = np.empty(n, np.int32)
    stamp = np.zeros(n, np.int32)
    done = np.zeros(n, np.int32)
    # Every leg is pushed once at most, and every corner once from the start.
    key = np.empty(len(neighbour) + n)
    what = np.empty(len(neighbour) + n, np.int32)
    now = 0
    for p in range(len(a)):
        ax, ay, bx, by = a[p, 0], a[p, 1], b[p, 0], b[p, 1]
        straight = math.hypot(bx - ax, by - ay)
        if straight == 0.0 or _clear(grid, ax, ay, bx, by):
            out[p] = straight
            bends_start[p + 1] = filled
            continue
        out[p] = math.inf
        limit = 1.25 * straight + 1e-6
        last = -1
        while True:
            now += 1
            count = 0
            half = 0.5 * limit
            mx, my = 0.5 * (ax + bx), 0.5 * (ay + by)
            for u in range(len(block)):
                if (
                    abs(block[u, 0] - mx) > half + block[u, 2]
                    or abs(block[u, 1] - my) > half + block[u, 2]
                    or _none_tangent(block, u, ax, ay)
                ):
                    continue
                for v in range(u * BLOCK, min(n, (u + 1) * BLOCK)):
                    x, y = node[v, 0], node[v, 1]
                    f = math.hypot(x - ax, y - ay) + math.hypot(x - bx, y - by)
                    if f <= limit and _tangent(
                        x, y, before[v, 0], before[v, 1], after[v, 0], after[v, 1], ax, ay
                    ):
                        count = _push(key, what, count, f, -1 - v)
            while count > 0:
                f = key[0]
                v = what[0]
                count = _pop(key, what, count)
                if f > limit:
                    break
                if v < 0:
                    # A corner that may be seen from a: the straight way there can't be beaten.
                    v = -1 - v
                    if done[v] == now or not _clear(grid, ax, ay, node[v, 0], node[v, 1]):
                        continue
                    label[v] = math.hypot(node[v, 0] - ax, node[v, 1] - ay)
                    back[v] = via[v] = -1
                    stamp[v] = now
                elif done[v] == now:
                    continue
                done[v] = now
                x, y = node[v, 0], node[v, 1]
                if _tangent(
                    x, y, before[v, 0], before[v, 1], after[v, 0], after[v, 1], bx, by
                ) and _clear(grid, x, y, bx, by):
                    out[p] = label[v] + math.hypot(bx - x, by - y)
                    last = v
                    break
                if via[v] < 0:
                    first, stop = _onward(start, hug, land, v, x - ax, y - ay)
                else:
                    first, stop = onward[via[v], 0], onward[via[v], 1]
                for k in range(first, stop):
                    w = neighbour[k]
                    if done[w] == now:
                        continue
                    reached = label[v] + length[k]
                    if stamp[w] == now and label[w] <= reached:
                        continue
                    f = reached + math.hypot(node[w, 0] - bx, node[w, 1] - by)
                    if f > limit:
                        continue
                    label[w] = reached
                    back[w] = v
                    via[w] = k
                    stamp[w] = now
                    count = _push(key, what, count, f, w)
            if last >= 0 or limit > top:
                break
            limit *= 2.0
        if last >= 0:
            many = 0
            v = last
            while v >= 0:
                many += 1
                v = back[v]
            if filled + many > len(bends):
                bends = _longer_int(bends, 2 * (filled + many))
            v = last
            for k in range(filled + many - 1, filled - 1, -1):
                bends[k] = v
                v = back[v]
            filled += many
        bends_start[p + 1] = filled
    return out, bends_start, _longer_int(bends, filled)

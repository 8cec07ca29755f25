"""Compiled local search of the fence fit: move, turn, swap vertices while land can be given back.

The rings of a fence have the water on their left (inclusion counter-clockwise, exclusions
clockwise), so the land inside the fence is a sum over edges: an edge's share is the signed area
between it and the axis, less the water in that area. With every edge's share in hand a move is
priced by the two or three edges that it changes. What must stay inside is given as segments that
no fence edge may cross.

The moves, in rounds until none gains: a vertex goes a step in eight directions; an edge turns
about the place where it touches what must stay inside (the least circumscribed polygon touches at
the middles of its edges); a vertex is taken out where that costs least and put in where it gains
most.

numba's cache of a kernel looks only at the kernel's own file: after a change of what an edge is
worth (:mod:`.ring_prices`) or may not pass (:mod:`.ring_walls`), touch this file as well.

References
----------
N. A. A. DePano, "Polygon approximation with optimized polygonal enclosures", 1987 (edges of a
least enclosing k-gon touch at their middles).
"""

from __future__ import annotations

import math

import numpy as np
from numba import njit

from mrmission.mission.ring_prices import price_of, strips
from mrmission.mission.ring_walls import APART_M, cells_of, free, near
from mrmission.model import BoolArray, FloatArray, IntArray

LEAST_STEP_M = 0.02
ROUNDS = 60
SWAPS_PER_ROUND = 12


@njit(cache=True, error_model="numpy", no_cpython_wrapper=True)
def _apart(
    ux: float, uy: float, vx: float, vy: float, iu: int, iv: int,
    skip0: int, skip1: int, skip2: int,
    x: FloatArray, y: FloatArray, after: IntArray, alive: BoolArray,
) -> bool:  # fmt: skip
    """Whether a new edge uv keeps away from all edges i -> after[i] but the skipped ones.

    ``iu`` and ``iv`` are the vertices at its ends, -1 for a new one: the edges that share a vertex
    may only not fold back onto it.
    """
    for i in range(len(alive)):
        if not alive[i] or i in (skip0, skip1, skip2):
            continue
        j = after[i]
        if j == iu or i == iv:
            # shares a vertex: hx, hy is its other end
            if j == iu and i == iv:
                return False
            k = i if j == iu else j
            ox, oy = (ux, uy) if j == iu else (vx, vy)
            ex, ey = (vx, vy) if j == iu else (ux, uy)
            ax, ay, bx, by = ex - ox, ey - oy, x[k] - ox, y[k] - oy
            turn = ax * by - ay * bx
            if ax * bx + ay * by > 0.0:
                # the shorter one's end keeps off the longer one
                longer = max(ax * ax + ay * ay, bx * bx + by * by)
                if turn * turn < APART_M * APART_M * longer:
                    return False
            continue
        if near(ux, uy, vx, vy, x[i], y[i], x[j], y[j]):
            return False
    return True


@njit(cache=True, error_model="numpy", no_cpython_wrapper=True)
def _gain(
    first: int, last: int, new: FloatArray, count: int, skip0: int, skip1: int, skip2: int,
    old: float, x: FloatArray, y: FloatArray, before: IntArray, after: IntArray, alive: BoolArray,
    wall: tuple[FloatArray, IntArray, IntArray, FloatArray],
    cover: tuple[FloatArray, IntArray, FloatArray], water_weight: float, out: FloatArray,
    of: IntArray, head: IntArray, inside: FloatArray,
) -> float:  # fmt: skip
    """Return what is gained by leading a ring from `first` over `count` new points to `last`.

    The edges that begin at the skipped vertices, of the price `old`, go; the prices of the new
    ones are put into `out`. Minus infinity where the new edges may not be.
    """
    ax, ay = x[first], y[first]
    total = 0.0
    for k in range(count + 1):
        bx, by = (new[k, 0], new[k, 1]) if k < count else (x[last], y[last])
        out[k] = price_of(ax, ay, bx, by, cover[0], cover[1], cover[2], water_weight)
        total += out[k]
        ax, ay = bx, by
    # only what takes a vertex out may be a loss
    goes = skip1 >= 0 and (count == 0 or (count == 1 and skip2 >= 0))
    if not goes and not old - total > 0.01:
        return -np.inf
    ax, ay = x[first], y[first]
    for k in range(count + 1):
        bx, by = (new[k, 0], new[k, 1]) if k < count else (x[last], y[last])
        if not free(ax, ay, bx, by, wall[0], wall[1], wall[2], wall[3]):
            return -np.inf
        if not _apart(
            ax, ay, bx, by, first if k == 0 else -1, last if k == count else -1,
            skip0, skip1, skip2, x, y, after, alive,
        ):  # fmt: skip
            return -np.inf
        ax, ay = bx, by
    if (
        count == 2
        and first != last
        and near(x[first], y[first], new[0, 0], new[0, 1], new[1, 0], new[1, 1], x[last], y[last])
    ):
        return -np.inf
    # neither another ring nor the path may change sides without having been crossed
    for r in range(-1, len(head)):
        if r == of[first]:
            continue
        px, py = (inside[0], inside[1]) if r < 0 else (x[head[r]], y[head[r]])
        odd = False
        ax, ay = x[first], y[first]
        for k in range(count + 1):
            bx, by = (new[k, 0], new[k, 1]) if k < count else (x[last], y[last])
            if (ay > py) != (by > py) and px < ax + (py - ay) / (by - ay) * (bx - ax):
                odd = not odd
            ax, ay = bx, by
        i = first
        while i != last:
            j = after[i]
            ax, ay, bx, by = x[i], y[i], x[j], y[j]
            if (ay > py) != (by > py) and px < ax + (py - ay) / (by - ay) * (bx - ax):
                odd = not odd
            i = j
        if odd:
            return -np.inf
    return old - total


@njit(cache=True, error_model="numpy", no_cpython_wrapper=True)
def _move(
    x: FloatArray, y: FloatArray, before: IntArray, after: IntArray, alive: BoolArray,
    of: IntArray, size: IntArray, fixed: BoolArray, price: FloatArray,
    wall: tuple[FloatArray, IntArray, IntArray, FloatArray],
    cover: tuple[FloatArray, IntArray, FloatArray], water_weight: float,
    step: FloatArray, swing: FloatArray, head: IntArray, inside: FloatArray, limit: int,
) -> tuple[float, int]:  # fmt: skip
    """Move every vertex and turn every edge once; return the gain, and the looks it took."""
    walls, start, item, grid = wall
    room = len(alive)
    used, round_gain = 0, 0.0
    new, out = np.zeros((2, 2)), np.zeros(3)
    # 1. vertices step (way 0-7), edges turn about what they touch (8 and 9)
    for v in range(room):
        moved = False
        for way in range(10):
            if not alive[v] or fixed[of[v]] or used > limit:
                break
            i0, i1, i2, i3 = before[v], v, -1, after[v]
            count = 1
            if way < 8:
                if step[v] < LEAST_STEP_M:
                    continue
                ux, uy = x[v] - x[i0], y[v] - y[i0]
                wx, wy = x[v] - x[i3], y[v] - y[i3]
                ul, wl = math.hypot(ux, uy) + 1e-9, math.hypot(wx, wy) + 1e-9
                ux, uy, wx, wy = ux / ul, uy / ul, wx / wl, wy / wl
                if way < 2:
                    dx, dy = ux, uy
                elif way < 4:
                    dx, dy = wx, wy
                elif way < 6:
                    dx, dy = ux + wx, uy + wy
                else:
                    dx, dy = ux - wx, uy - wy
                length = math.hypot(dx, dy)
                if length < 1e-6:
                    continue
                s = step[v] / length * (1.0 if way % 2 == 0 else -1.0)
                new[0, 0], new[0, 1] = x[v] + s * dx, y[v] + s * dy
                old = price[i0] + price[i1]
            else:
                # one end goes on along its neighbour, the other is drawn back as far as can be
                side = way - 8
                if size[of[v]] < 4 or swing[v, side] < LEAST_STEP_M:
                    continue
                i1, i2 = v, after[v]
                i3, count = after[i2], 2
                p, q, a, d = (i1, i2, i0, i3) if side == 0 else (i2, i1, i3, i0)
                s = swing[v, side] / (math.hypot(x[p] - x[a], y[p] - y[a]) + 1e-9)
                ex, ey = x[p] + s * (x[p] - x[a]), y[p] + s * (y[p] - y[a])
                low, high = -1.0, 0.98
                for turn in range(10):
                    t = 0.0 if turn == 0 else (high if turn == 1 else 0.5 * (low + high))
                    fx, fy = x[q] + t * (x[d] - x[q]), y[q] + t * (y[d] - y[q])
                    used += 1
                    if free(ex, ey, fx, fy, walls, start, item, grid):
                        low = t
                        if turn == 1:
                            break
                    else:
                        high = t
                        if turn == 0:
                            break
                if low < 0.0:
                    swing[v, side] *= 0.5
                    continue
                fx, fy = x[q] + low * (x[d] - x[q]), y[q] + low * (y[d] - y[q])
                new[side, 0], new[side, 1] = ex, ey
                new[1 - side, 0], new[1 - side, 1] = fx, fy
                old = price[i0] + price[i1] + price[i2]
            used += count + 1
            gain = _gain(
                i0, i3, new, count, i0, i1, i2, old, x, y, before, after, alive, wall, cover,
                water_weight, out, of, head, inside,
            )  # fmt: skip
            found = gain > 0.01
            if found:
                x[i1], y[i1] = new[0, 0], new[0, 1]
                price[i0], price[i1] = out[0], out[1]
                if count == 2:
                    x[i2], y[i2] = new[1, 0], new[1, 1]
                    price[i2] = out[2]
                round_gain += gain
            if way >= 8:
                swing[v, way - 8] *= 1.3 if found else 0.5
            elif found:
                moved = True
        step[v] *= 1.4 if moved else 0.5
    return round_gain, used


@njit(cache=True, error_model="numpy", no_cpython_wrapper=True)
def _weigh(
    x: FloatArray, y: FloatArray, before: IntArray, after: IntArray, alive: BoolArray,
    of: IntArray, size: IntArray, fixed: BoolArray, price: FloatArray,
    wall: tuple[FloatArray, IntArray, IntArray, FloatArray],
    cover: tuple[FloatArray, IntArray, FloatArray], water_weight: float,
    most: int, head: IntArray, inside: FloatArray,
    removal: FloatArray, joint: FloatArray, insertion: FloatArray, corner: FloatArray,
) -> int:  # fmt: skip
    """Find what each vertex is worth, and what one more on each edge would be; return the looks.

    ``removal`` is the loss without a vertex (``joint``: where the neighbouring edges then meet,
    infinity where they become one), ``insertion`` the gain of a new vertex at ``corner``.
    """
    walls, start, item, grid = wall
    room = len(alive)
    used = 0
    new, out = np.zeros((2, 2)), np.zeros(3)
    # 2. what each vertex is worth, and what another one on each edge would be
    for v in range(room):
        removal[v] = np.inf
        insertion[v] = 0.0
        if not alive[v] or fixed[of[v]]:
            continue
        a, c = before[v], after[v]
        d = after[c]
        if size[of[v]] > 3:
            used += 4
            for kind in range(2):
                count, last, skip, old = 0, c, -1, price[a] + price[v]
                if kind == 1:
                    if d == a:
                        continue
                    ux, uy = x[v] - x[a], y[v] - y[a]
                    wx, wy = x[c] - x[d], y[c] - y[d]
                    den = ux * wy - uy * wx
                    ex, ey = x[c] - x[v], y[c] - y[v]
                    if abs(den) < 1e-9 * math.hypot(ux, uy) * math.hypot(wx, wy):
                        continue
                    s, t = (ex * wy - ey * wx) / den, (ex * uy - ey * ux) / den
                    if not (s > 0 and t > 0 and s < 50 and t < 50):
                        continue
                    count, last, skip = 1, d, c
                    new[0, 0], new[0, 1] = x[v] + s * ux, y[v] + s * uy
                    old += price[c]
                gain = _gain(
                    a, last, new, count, a, v, skip, old, x, y, before, after, alive, wall,
                    cover, water_weight, out, of, head, inside,
                )  # fmt: skip
                if -gain < removal[v]:
                    removal[v] = -gain
                    joint[v, 0] = np.inf if kind == 0 else new[0, 0]
                    joint[v, 1] = new[0, 1]
        if size[of[v]] < most:
            # the deepest corner over each of a few places along the edge
            ex, ey = x[c] - x[v], y[c] - y[v]
            length = math.hypot(ex, ey) + 1e-9
            for place in range(14):
                t = (place // 2 + 1) / 8.0
                mx, my = x[v] + t * ex, y[v] + t * ey
                low, high = 0.0, (1.0 if place % 2 == 0 else 0.25) * length
                for _try in range(8):
                    s = 0.5 * (low + high)
                    qx, qy = mx - s * ey / length, my + s * ex / length
                    used += 1
                    ok = True
                    for k in range(2):
                        g = v if k == 0 else c
                        ok = ok and free(x[g], y[g], qx, qy, walls, start, item, grid)
                    if ok:
                        low = s
                    else:
                        high = s
                if low <= 2 * APART_M:
                    continue
                new[0, 0], new[0, 1] = mx - low * ey / length, my + low * ex / length
                used += 2
                gain = _gain(
                    v, c, new, 1, v, -1, -1, price[v], x, y, before, after, alive, wall, cover,
                    water_weight, out, of, head, inside,
                )  # fmt: skip
                if gain > insertion[v]:
                    insertion[v] = gain
                    corner[v, 0], corner[v, 1] = new[0, 0], new[0, 1]
    return used


@njit(cache=True, error_model="numpy", no_cpython_wrapper=True)
def _swap(
    x: FloatArray, y: FloatArray, before: IntArray, after: IntArray, alive: BoolArray,
    of: IntArray, size: IntArray, price: FloatArray,
    wall: tuple[FloatArray, IntArray, IntArray, FloatArray],
    cover: tuple[FloatArray, IntArray, FloatArray], water_weight: float,
    step: FloatArray, swing: FloatArray, head: IntArray, inside: FloatArray,
    removal: FloatArray, joint: FloatArray, insertion: FloatArray, corner: FloatArray,
) -> float:  # fmt: skip
    """Put in the worthiest new vertices, take out the least worthy; return what that gained."""
    room = len(alive)
    round_gain = 0.0
    new, out = np.zeros((2, 2)), np.zeros(3)
    # 3. the worthiest comes in; where there is no room, the least worthy goes out
    for _ in range(SWAPS_PER_ROUND):
        v = np.argmax(insertion)
        if not insertion[v] > 0.1:
            break
        slot = -1
        for i in range(room):
            if not alive[i]:
                slot = i
                break
        if slot < 0:
            least = -1
            for i in range(room):
                # neither end of the edge may be touched by what goes
                j = after[i]
                k = after[j]
                if i in (v, after[v], after[after[v]]) or v in (j, k):
                    continue
                if least < 0 or removal[i] < removal[least]:
                    least = i
            if least < 0 or not removal[least] < 0.98 * insertion[v] - 0.1:
                insertion[v] = 0.0
                continue
            # the rings may have changed since
            slot = least
            a = before[least]
            last, skip, count = after[least], -1, 0
            old = price[a] + price[least]
            if joint[least, 0] != np.inf:
                skip, count, last = last, 1, after[last]
                old += price[skip]
                new[0, 0], new[0, 1] = joint[least, 0], joint[least, 1]
            loss = -_gain(
                a, last, new, count, a, least, skip, old, x, y, before, after, alive, wall, cover,
                water_weight, out, of, head, inside,
            )  # fmt: skip
            if not loss < 0.98 * insertion[v] - 0.1 or size[of[least]] < 4:
                removal[least] = np.inf
                continue
            if joint[least, 0] != np.inf:
                slot = after[least]
                x[least], y[least] = joint[least, 0], joint[least, 1]
            after[before[slot]], before[after[slot]] = after[slot], before[slot]
            alive[slot] = False
            size[of[slot]] -= 1
            head[of[slot]] = a
            round_gain -= loss
            removal[slot] = np.inf
            insertion[slot] = 0.0
        else:
            a = -1
        for end in range(2):
            # what lies around a change is stale
            if end == 0:
                if a < 0:
                    continue
                i = before[before[a]]
            else:
                c = after[v]
                new[0, 0], new[0, 1] = corner[v, 0], corner[v, 1]
                gain = _gain(
                    v, c, new, 1, v, -1, -1, price[v], x, y, before, after, alive, wall, cover,
                    water_weight, out, of, head, inside,
                )  # fmt: skip
                if not gain > 0:
                    insertion[v] = 0.0
                    continue
                x[slot], y[slot], of[slot], alive[slot] = new[0, 0], new[0, 1], of[v], True
                after[v], before[slot], after[slot], before[c] = slot, v, c, slot
                size[of[v]] += 1
                round_gain += gain
                i = before[before[v]]
            for _k in range(6):
                j = after[i]
                removal[i] = np.inf
                insertion[i] = 0.0
                price[i] = price_of(
                    x[i], y[i], x[j], y[j], cover[0], cover[1], cover[2], water_weight
                )
                length = 0.2 * math.hypot(x[j] - x[i], y[j] - y[i])
                step[i] = max(step[i], length)
                swing[i, 0], swing[i, 1] = max(swing[i, 0], length), max(swing[i, 1], length)
                i = j
    return round_gain


@njit(cache=True, error_model="numpy")
def improve_rings(
    points: FloatArray, ring: IntArray, fixed: BoolArray, spare: int, most: int,
    walls: FloatArray, grid: FloatArray, shore: FloatArray, inside: FloatArray,
    water_weight: float, limit: int,
) -> tuple[FloatArray, IntArray]:  # fmt: skip
    """Give land back by local search; rings never grow less strict about what must stay inside.

    Parameters
    ----------
    points : (n, 2) array, m
        Vertices of all rings, ring by ring, water on the left.
    ring : (n,) array
        Number of the ring of each vertex, rising; ring 0 is the inclusion.
    fixed : (number of rings,) array
        Rings that stay as they are (one that crosses another has no price of its own).
    spare
        Vertices that may be added.
    most
        The most vertices of one ring.
    walls : (m, 4) array, m
        Segments that new edges must not touch.
    grid : (5,) array
        Of the index over the walls: x, y, size of a cell (m), columns, rows.
    shore : (s, 4) array, m
        Edges of the true water, water on the left.
    inside : (2,) array, m
        A point that stays inside ring 0 and outside of all others.
    water_weight
        Worth of a square metre of water inside the fence, against 1 for land.
    limit
        Edges that may be looked at: bounds the time.

    Returns
    -------
    points, ring
        As given, improved.
    """
    n = len(points)
    room = n + spare
    x, y = np.zeros(room), np.zeros(room)
    before, after = np.zeros(room, np.int64), np.zeros(room, np.int64)
    of = np.zeros(room, np.int64)
    alive = np.zeros(room, np.bool_)
    rings = ring[-1] + 1
    size = np.zeros(rings, np.int64)
    head = np.zeros(rings, np.int64)
    for i in range(n):
        x[i], y[i], of[i], alive[i] = points[i, 0], points[i, 1], ring[i], True
        size[ring[i]] += 1
    i = 0
    for r in range(rings):
        head[r] = i
        for k in range(size[r]):
            before[i + k] = i + (k - 1) % size[r]
            after[i + k] = i + (k + 1) % size[r]
        i += size[r]
    start, item = cells_of(walls, grid)
    wall = (walls, start, item, grid)
    cover = strips(shore, min(512, max(16, len(shore) // 4)))
    price, step, swing = np.zeros(room), np.zeros(room), np.zeros((room, 2))
    for i in range(n):
        j = after[i]
        price[i] = price_of(x[i], y[i], x[j], y[j], cover[0], cover[1], cover[2], water_weight)
        step[i] = swing[i, 0] = swing[i, 1] = 0.3 * math.hypot(x[j] - x[i], y[j] - y[i])
    used = 0
    removal, insertion = np.zeros(room), np.zeros(room)
    corner, joint = np.zeros((room, 2)), np.zeros((room, 2))
    for _ in range(ROUNDS):
        gain, looks = _move(
            x, y, before, after, alive, of, size, fixed, price, wall, cover, water_weight,
            step, swing, head, inside, limit - used,
        )  # fmt: skip
        used += looks + _weigh(
            x, y, before, after, alive, of, size, fixed, price, wall, cover, water_weight,
            most, head, inside, removal, joint, insertion, corner,
        )  # fmt: skip
        gain += _swap(
            x, y, before, after, alive, of, size, price, wall, cover, water_weight,
            step, swing, head, inside, removal, joint, insertion, corner,
        )  # fmt: skip
        if used > limit or gain < 0.3 + 2e-4 * abs(price[alive].sum()):
            break
    result, result_ring = np.zeros((room, 2)), np.zeros(room, np.int64)
    k = 0
    for r in range(rings):
        i = head[r]
        for _ in range(size[r]):
            result[k, 0], result[k, 1], result_ring[k] = x[i], y[i], r
            k += 1
            i = after[i]
    return result[:k].copy(), result_ring[:k].copy()

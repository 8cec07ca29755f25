"""Compiled core of the fence fit: take vertices out of one ring, cheapest first.

A ring has the water on its left (shells counter-clockwise, islands clockwise). Two moves make it
shorter by one vertex: *remove* a vertex, and *collapse* an edge onto the point where its two
neighbours, made longer, meet. Either adds or cuts a triangle. A triangle of water that is cut off
must keep its distance from the path; a triangle of land that is taken in costs its area.

numba's cache of a kernel looks only at the kernel's own file: after a change of what it calls in
:mod:`.ring_walls`, touch this file as well.

References
----------
M. Visvalingam, J. D. Whyatt, "Line generalisation by repeated elimination of points",
Cartographic Journal 30(1), 1993 (removal by area); B. J. Kronenfeld, L. V. Stanislawski,
B. P. Buttenfield, T. Brockmeyer, "Simplification of polylines by segment collapse", 2020.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt
from numba import njit

from mrmission.mission.ring_walls import cross, distance2, meet
from mrmission.model import FloatArray, IntArray

REMOVE = 0
COLLAPSE = 1
STRAIGHT_M = 0.01
"""A vertex this near to the line of its neighbours may go although the path is near."""


@njit(cache=True, error_model="numpy", no_cpython_wrapper=True)
def _segments2(
    ax: float, ay: float, bx: float, by: float, cx: float, cy: float, dx: float, dy: float
) -> float:
    if meet(ax, ay, bx, by, cx, cy, dx, dy):
        return 0.0
    return min(
        min(distance2(ax, ay, cx, cy, dx, dy), distance2(bx, by, cx, cy, dx, dy)),
        min(distance2(cx, cy, ax, ay, bx, by), distance2(dx, dy, ax, ay, bx, by)),
    )


@njit(cache=True, error_model="numpy", no_cpython_wrapper=True)
def _in_triangle(
    px: float, py: float, ax: float, ay: float, bx: float, by: float, cx: float, cy: float
) -> bool:
    """Whether p lies in the closed triangle abc, of either orientation."""
    s = cross(ax, ay, bx, by, px, py)
    t = cross(bx, by, cx, cy, px, py)
    u = cross(cx, cy, ax, ay, px, py)
    return (s >= 0 and t >= 0 and u >= 0) or (s <= 0 and t <= 0 and u <= 0)


@njit(cache=True, error_model="numpy")
def clear_of_path(
    ax: float, ay: float, bx: float, by: float, cx: float, cy: float,
    path: FloatArray, need: FloatArray,
) -> bool:  # fmt: skip
    """Whether every path segment i keeps the distance ``need[i]`` from the triangle abc."""
    low_x, high_x = min(ax, min(bx, cx)), max(ax, max(bx, cx))
    low_y, high_y = min(ay, min(by, cy)), max(ay, max(by, cy))
    for i in range(len(path)):
        px, py, qx, qy = path[i, 0], path[i, 1], path[i, 2], path[i, 3]
        d = need[i]
        if max(px, qx) <= low_x - d or min(px, qx) >= high_x + d:
            continue
        if max(py, qy) <= low_y - d or min(py, qy) >= high_y + d:
            continue
        if _in_triangle(px, py, ax, ay, bx, by, cx, cy):
            return False
        d2 = d * d
        if (
            _segments2(px, py, qx, qy, ax, ay, cx, cy) < d2
            or _segments2(px, py, qx, qy, ax, ay, bx, by) < d2
            or _segments2(px, py, qx, qy, bx, by, cx, cy) < d2
        ):
            return False
    return True


@njit(cache=True, error_model="numpy", no_cpython_wrapper=True)
def _push(
    cost: FloatArray, what: IntArray, size: int, new_cost: float, v: int, kind: int, stamp: int
) -> int:
    i = size
    while i > 0:
        up = (i - 1) >> 1
        if cost[up] <= new_cost:
            break
        cost[i] = cost[up]
        what[i, 0], what[i, 1], what[i, 2] = what[up, 0], what[up, 1], what[up, 2]
        i = up
    cost[i] = new_cost
    what[i, 0], what[i, 1], what[i, 2] = v, kind, stamp
    return size + 1


@njit(cache=True, error_model="numpy", no_cpython_wrapper=True)
def _pop(cost: FloatArray, what: IntArray, size: int) -> int:
    """Move the root out (the caller has read it) and return the new size."""
    size -= 1
    last = cost[size]
    v, kind, stamp = what[size, 0], what[size, 1], what[size, 2]
    i = 0
    while True:
        down = 2 * i + 1
        if down >= size:
            break
        if down + 1 < size and cost[down + 1] < cost[down]:
            down += 1
        if cost[down] >= last:
            break
        cost[i] = cost[down]
        what[i, 0], what[i, 1], what[i, 2] = what[down, 0], what[down, 1], what[down, 2]
        i = down
    cost[i] = last
    what[i, 0], what[i, 1], what[i, 2] = v, kind, stamp
    return size


@njit(cache=True, error_model="numpy", no_cpython_wrapper=True)
def _price(
    x: FloatArray, y: FloatArray, before: IntArray, after: IntArray, v: int, kind: int,
    water_weight: float, out: FloatArray,
) -> bool:  # fmt: skip
    """Price one move: out = [cost, land taken in, x, y, 1 where water is cut]. False: no move."""
    a, c = before[v], after[v]
    turn = cross(x[a], y[a], x[v], y[v], x[c], y[c])
    if kind == REMOVE:
        area = 0.5 * abs(turn)
        cuts = turn > 0
        if (x[a] - x[c]) ** 2 + (y[a] - y[c]) ** 2 < 1e-6:
            return False
    else:
        d = after[c]
        if d == a:
            return False
        turn2 = cross(x[v], y[v], x[c], y[c], x[d], y[d])
        if not ((turn > 0 and turn2 > 0) or (turn < 0 and turn2 < 0)):
            return False
        ux, uy = x[v] - x[a], y[v] - y[a]
        wx, wy = x[c] - x[d], y[c] - y[d]
        den = ux * wy - uy * wx
        if abs(den) < 1e-12 * (abs(ux) + abs(uy)) * (abs(wx) + abs(wy)):
            return False
        ex, ey = x[c] - x[v], y[c] - y[v]
        s, t = (ex * wy - ey * wx) / den, (ex * uy - ey * ux) / den
        if not (s > 0 and t > 0):
            return False
        out[2], out[3] = x[v] + s * ux, y[v] + s * uy
        if abs(out[2] - x[v]) + abs(out[3] - y[v]) > 1e6:
            return False
        area = 0.5 * abs(cross(x[v], y[v], out[2], out[3], x[c], y[c]))
        cuts = turn < 0
    out[0] = water_weight * area if cuts else area
    out[1] = 0.0 if cuts else area
    out[4] = 1.0 if cuts else 0.0
    return True


@njit(cache=True, error_model="numpy", no_cpython_wrapper=True)
def _allowed(
    x: FloatArray, y: FloatArray, before: IntArray, after: IntArray, v: int, kind: int,
    move: FloatArray, path: FloatArray, need: FloatArray, reach: FloatArray,
) -> int:  # fmt: skip
    """0: the move may be made; 1: the path forbids it; 2: the ring would cross itself."""
    a, c = before[v], after[v]
    vx, vy = x[v], y[v]
    if kind == REMOVE:
        px, py, qx, qy, rx, ry = x[a], y[a], vx, vy, x[c], y[c]
    else:
        px, py, qx, qy, rx, ry = vx, vy, move[2], move[3], x[c], y[c]
    if move[4] > 0 and not clear_of_path(px, py, qx, qy, rx, ry, path, need):
        base = np.hypot(rx - px, ry - py)
        if kind != REMOVE or abs(cross(px, py, qx, qy, rx, ry)) > STRAIGHT_M * base:
            return 1
        if not clear_of_path(px, py, px, py, rx, ry, path, reach):
            return 1
    low_x, high_x = min(px, min(qx, rx)), max(px, max(qx, rx))
    low_y, high_y = min(py, min(qy, ry)), max(py, max(qy, ry))
    # neither a vertex inside the triangle, nor (a collapse opens two sides) an edge across it
    i = after[c]
    stop = a if kind == REMOVE else v
    while i != stop:
        j = after[i]
        inside = low_x <= x[i] <= high_x and low_y <= y[i] <= high_y
        if inside and _in_triangle(x[i], y[i], px, py, qx, qy, rx, ry):
            return 2
        if (
            kind == COLLAPSE
            and j != stop
            and not (x[i] < low_x and x[j] < low_x)
            and not (x[i] > high_x and x[j] > high_x)
            and not (y[i] < low_y and y[j] < low_y)
            and not (y[i] > high_y and y[j] > high_y)
            and (
                meet(x[i], y[i], x[j], y[j], px, py, qx, qy)
                or meet(x[i], y[i], x[j], y[j], qx, qy, rx, ry)
            )
        ):
            return 2
        i = j
    return 0


@njit(cache=True, error_model="numpy")
def shorten_ring(
    ring: FloatArray, path: FloatArray, need: FloatArray, reach: FloatArray, water_weight: float
) -> tuple[IntArray, FloatArray]:
    """Make a ring shorter, one vertex at a time, as far as it goes.

    Parameters
    ----------
    ring : (n, 2) array, m
        Not closed, water on the left.
    path : (m, 4) array, m
        Segments to stay clear of, ``[x, y, x, y]``.
    need, reach : (m,) arrays, m
        Distance that a cut keeps from each segment, and that it keeps at least where it takes a
        vertex off a straight line.
    water_weight
        Cost of a square metre of water given up; a square metre of land taken in costs 1.

    Returns
    -------
    moves : (k, 2) array
        Vertex and kind of each move, in order.
    values : (k, 4) array
        Position of the new vertex (of a collapse), cost, and land taken in, m².
    """
    n = len(ring)
    x, y = ring[:, 0].copy(), ring[:, 1].copy()
    before, after = np.empty(n, np.int64), np.empty(n, np.int64)
    for i in range(n):
        before[i], after[i] = (i - 1) % n, (i + 1) % n
    stamp = np.zeros(n, np.int64)
    room = 10 * n + 16
    heap_cost, heap = np.empty(room), np.empty((room, 3), np.int64)
    blocked_cost, blocked = np.empty(room), np.empty((room, 3), np.int64)
    moves, values = np.empty((n, 2), np.int64), np.empty((n, 4))
    move = np.zeros(5)
    size = waiting = done = 0
    progress = False
    for v in range(n):
        for kind in range(2):
            if _price(x, y, before, after, v, kind, water_weight, move):
                size = _push(heap_cost, heap, size, move[0], v, kind, stamp[v])
    while n - done > 3:
        if size == 0:
            if not progress:
                break
            # what crossed the ring before may have become possible
            progress = False
            for i in range(waiting):
                v = blocked[i, 0]
                if blocked[i, 2] == stamp[v]:
                    size = _push(heap_cost, heap, size, blocked_cost[i], v, blocked[i, 1], stamp[v])
            waiting = 0
            continue
        cost = heap_cost[0]
        v, kind, when = heap[0, 0], heap[0, 1], heap[0, 2]
        size = _pop(heap_cost, heap, size)
        if when != stamp[v] or not _price(x, y, before, after, v, kind, water_weight, move):
            continue
        verdict = _allowed(x, y, before, after, v, kind, move, path, need, reach)
        if verdict == 2:
            blocked_cost[waiting] = cost
            blocked[waiting, 0], blocked[waiting, 1], blocked[waiting, 2] = v, kind, when
            waiting += 1
        if verdict != 0:
            continue
        a, c = before[v], after[v]
        moves[done, 0], moves[done, 1] = v, kind
        values[done, 0], values[done, 1] = move[2], move[3]
        values[done, 2], values[done, 3] = move[0], move[1]
        done += 1
        progress = True
        if kind == REMOVE:
            gone, first, count = v, before[a], 3
        else:
            x[v], y[v] = move[2], move[3]
            gone, first, count = c, before[a], 4
        after[before[gone]] = after[gone]
        before[after[gone]] = before[gone]
        stamp[gone] = -1
        i = first
        for _ in range(count):
            stamp[i] += 1
            for kind in range(2):
                if _price(x, y, before, after, i, kind, water_weight, move):
                    size = _push(heap_cost, heap, size, move[0], i, kind, stamp[i])
            i = after[i]
    return moves[:done].copy(), values[:done].copy()


def replay(ring: FloatArray, moves: IntArray, values: FloatArray, count: int) -> FloatArray:
    """Return the ring after its first `count` moves.

    Parameters
    ----------
    ring : (n, 2) array, m
    moves, values
        From :func:`shorten_ring`.
    count
        How many of them to make.
    """
    points = np.array(ring, dtype=float)
    n = len(points)
    after = np.roll(np.arange(n), -1)
    before = np.roll(np.arange(n), 1)
    alive: npt.NDArray[np.bool_] = np.ones(n, dtype=bool)
    for (v, kind), (px, py, _, _) in zip(
        moves[:count].tolist(), values[:count].tolist(), strict=True
    ):
        gone = v
        if kind == COLLAPSE:
            points[v] = px, py
            gone = after[v]
        alive[gone] = False
        after[before[gone]] = after[gone]
        before[after[gone]] = before[gone]
    return points[alive]

r"""Compiled core of the separation: two time lines against each other, leg by leg.

A robot's *progress* is the time :math:`\tau` after its own start at which the prediction has it at
a place of its way. With times predicted to a share :math:`u`, launches to :math:`s` seconds, and
the start of the second robot :math:`\Delta` seconds after that of the first, the two can be at
progress :math:`\tau_i` and :math:`\tau_j` at the same moment where

.. math::

    (1-u)\,\tau_i - (1+u)\,\tau_j - s \;\le\; \Delta \;\le\;
    (1+u)\,\tau_i - (1-u)\,\tau_j + s .

Both are linear, and on a pair of straight legs the vector between the robots is linear in the two
progresses too. So the nearest that two legs can come is a convex quadratic over a polygon of up to
six corners, and the differences :math:`\Delta` that bring them within a distance are an interval
whose ends are those of a linear function over an ellipse cut by a rectangle: both have closed
forms, and nothing is sampled.

Legs are found through trees of boxes over runs of consecutive legs, since what is near in a tour
is near on the water.
"""

from __future__ import annotations

import numpy as np
from numba import njit

LEAF = 4
"""Legs in a leaf of a tree."""
ROW = 9
"""Columns of :func:`near_legs`."""
HAIR_S = 1e-6
"""Two moments so near to each other are one: rounding must not keep equal times apart."""


@njit(cache=True, error_model="numpy")
def box_tree(points):  # type: ignore[no-untyped-def]
    """Return boxes (nodes, 4) over the legs of (n, 2) points: a heap, node 1 is the root.

    The leaves are the second half: leaf ``l`` holds legs ``LEAF * l`` to ``LEAF * (l + 1) - 1``.
    """
    legs = len(points) - 1
    leaves = 1
    while leaves * LEAF < legs:
        leaves *= 2
    box = np.empty((2 * leaves, 4))
    box[:, :2] = np.inf
    box[:, 2:] = -np.inf
    for k in range(leaves):
        node = box[leaves + k]
        for m in range(k * LEAF, min(legs, (k + 1) * LEAF) + 1):
            if k * LEAF >= legs:
                break
            for axis in range(2):
                node[axis] = min(node[axis], points[m, axis])
                node[2 + axis] = max(node[2 + axis], points[m, axis])
    for k in range(leaves - 1, 0, -1):
        for axis in range(2):
            box[k, axis] = min(box[2 * k, axis], box[2 * k + 1, axis])
            box[k, 2 + axis] = max(box[2 * k, 2 + axis], box[2 * k + 1, 2 + axis])
    return box


@njit(cache=True, error_model="numpy")
def _apart2(a, b):  # type: ignore[no-untyped-def]
    """Return the squared distance of two boxes; infinite where one is empty."""
    if a[0] > a[2] or b[0] > b[2]:
        return np.inf
    dx = max(0.0, max(a[0] - b[2], b[0] - a[2]))
    dy = max(0.0, max(a[1] - b[3], b[1] - a[3]))
    return dx * dx + dy * dy


@njit(cache=True, error_model="numpy")
def _span(node, leaves, legs):  # type: ignore[no-untyped-def]
    """Return the first leg of a node and the one after its last."""
    width = LEAF
    while node < leaves:
        node *= 2
        width *= 2
    first = (node - leaves) * LEAF
    return min(first, legs), min(first + width, legs)


@njit(cache=True, error_model="numpy")
def _edge2(ax, ay, bx, by):  # type: ignore[no-untyped-def]
    """Return the least squared length on the segment from a to b, and where on it, 0 to 1."""
    dx, dy = bx - ax, by - ay
    square = dx * dx + dy * dy
    t = 0.0
    if square > 0.0:
        t = min(1.0, max(0.0, -(ax * dx + ay * dy) / square))
    ex, ey = ax + t * dx, ay + t * dy
    return ex * ex + ey * ey, t


@njit(cache=True, error_model="numpy")
def _clip(poly, count, cx, cy, c0, out):  # type: ignore[no-untyped-def]
    """Keep of a convex polygon what has cx·x + cy·y + c0 <= 0; return its number of corners."""
    kept = 0
    for k in range(count):
        m = k + 1 if k + 1 < count else 0
        here = cx * poly[k, 0] + cy * poly[k, 1] + c0
        there = cx * poly[m, 0] + cy * poly[m, 1] + c0
        if here <= 0.0:
            out[kept, 0], out[kept, 1] = poly[k, 0], poly[k, 1]
            kept += 1
        if (here < 0.0 < there) or (there < 0.0 < here):
            t = here / (here - there)
            out[kept, 0] = poly[k, 0] + t * (poly[m, 0] - poly[k, 0])
            out[kept, 1] = poly[k, 1] + t * (poly[m, 1] - poly[k, 1])
            kept += 1
    return kept


@njit(cache=True, error_model="numpy")
def _legs2(ti, pi, i, tj, pj, j, lag, share, slack, work):  # type: ignore[no-untyped-def]
    """Return the least squared distance of two legs, and the two progresses (s) where it is.

    Infinite where no two moments of them can be the same.
    """
    la, lb = ti[i + 1] - ti[i], tj[j + 1] - tj[j]
    ax, ay = pi[i + 1, 0] - pi[i, 0], pi[i + 1, 1] - pi[i, 1]
    bx, by = pj[j + 1, 0] - pj[j, 0], pj[j + 1, 1] - pj[j, 1]
    cx, cy = pi[i, 0] - pj[j, 0], pi[i, 1] - pj[j, 1]
    slack += HAIR_S
    f0 = (1.0 - share) * ti[i] - (1.0 + share) * tj[j] - slack - lag
    fx, fy = (1.0 - share) * la, -(1.0 + share) * lb
    g0 = lag - (1.0 + share) * ti[i] + (1.0 - share) * tj[j] - slack
    gx, gy = -(1.0 + share) * la, (1.0 - share) * lb
    square, first, second = work[0], work[1], work[2]
    square[0, 0], square[0, 1] = 0.0, 0.0
    square[1, 0], square[1, 1] = 1.0, 0.0
    square[2, 0], square[2, 1] = 1.0, 1.0
    square[3, 0], square[3, 1] = 0.0, 1.0
    count = _clip(square, 4, fx, fy, f0, first)
    if count == 0:
        return np.inf, 0.0, 0.0
    count = _clip(first, count, gx, gy, g0, second)
    if count == 0:
        return np.inf, 0.0, 0.0
    turn = ay * bx - ax * by
    if abs(turn) > 1e-12 * (ax * ax + ay * ay + bx * bx + by * by):
        # where the two legs cross: c + x·a - y·b = 0
        x = (cx * by - cy * bx) / turn
        y = (cx * ay - cy * ax) / turn
        if (
            0.0 <= x <= 1.0
            and 0.0 <= y <= 1.0
            and fx * x + fy * y + f0 <= 0.0
            and gx * x + gy * y + g0 <= 0.0
        ):
            return 0.0, ti[i] + x * la, tj[j] + y * lb
    best, at_x, at_y = np.inf, 0.0, 0.0
    for k in range(count):
        m = k + 1 if k + 1 < count else 0
        x0, y0, x1, y1 = second[k, 0], second[k, 1], second[m, 0], second[m, 1]
        least, t = _edge2(
            cx + x0 * ax - y0 * bx, cy + x0 * ay - y0 * by,
            cx + x1 * ax - y1 * bx, cy + x1 * ay - y1 * by,
        )  # fmt: skip
        if least < best:
            best, at_x, at_y = least, x0 + t * (x1 - x0), y0 + t * (y1 - y0)
    return best, ti[i] + at_x * la, tj[j] + at_y * lb


@njit(cache=True, error_model="numpy")
def least_apart(ti, pi, box_i, tj, pj, box_j, lag, share, slack):  # type: ignore[no-untyped-def]
    """Return the least distance, m, of two robots under way, and both progresses (s) where it is.

    Parameters
    ----------
    ti, pi, box_i, tj, pj, box_j
        (n,) rising progresses, s; (n, 2) places; tree of :func:`box_tree`. n is 2 or more.
    lag
        How much later the second robot starts, s.
    share, slack
        What a time may be wrong by: a share of it, and the start by so many seconds.

    Returns
    -------
    (distance_m, progress_i_s, progress_j_s)
        Infinite where the two are never under way together.
    """
    ni, nj = len(ti) - 1, len(tj) - 1
    li, lj = len(box_i) // 2, len(box_j) // 2
    best, at_i, at_j = np.inf, 0.0, 0.0
    work = np.empty((3, 8, 2))
    stack = np.empty((256, 2), np.int64)
    stack[0, 0] = stack[0, 1] = 1
    top = 1
    while top > 0:
        top -= 1
        a, b = stack[top, 0], stack[top, 1]
        if _apart2(box_i[a], box_j[b]) >= best:
            continue
        a0, a1 = _span(a, li, ni)
        b0, b1 = _span(b, lj, nj)
        if a0 >= a1 or b0 >= b1:
            continue
        if (1.0 - share) * ti[a0] - (1.0 + share) * tj[b1] - slack > lag + HAIR_S:
            continue
        if (1.0 + share) * ti[a1] - (1.0 - share) * tj[b0] + slack < lag - HAIR_S:
            continue
        if a >= li and b >= lj:
            for i in range(a0, a1):
                for j in range(b0, b1):
                    found, x, y = _legs2(ti, pi, i, tj, pj, j, lag, share, slack, work)
                    if found < best:
                        best, at_i, at_j = found, x, y
            continue
        # the nearer half is looked at first: it lies on top of the stack
        if b >= lj or (a < li and a1 - a0 >= b1 - b0):
            near, far = 2 * a, 2 * a + 1
            if _apart2(box_i[near], box_j[b]) > _apart2(box_i[far], box_j[b]):
                near, far = far, near
            stack[top, 0], stack[top, 1] = far, b
            stack[top + 1, 0], stack[top + 1, 1] = near, b
        else:
            near, far = 2 * b, 2 * b + 1
            if _apart2(box_i[a], box_j[near]) > _apart2(box_i[a], box_j[far]):
                near, far = far, near
            stack[top, 0], stack[top, 1] = a, far
            stack[top + 1, 0], stack[top + 1, 1] = a, near
        top += 2
    return np.sqrt(best), at_i, at_j


@njit(cache=True, error_model="numpy")
def _extremes(ti, pi, i, tj, pj, j, reach, share, slack, out):  # type: ignore[no-untyped-def]
    """Enter what is known of two legs where they lie within `reach`; return whether they do.

    The columns of `out` are those of :func:`near_legs`.
    """
    la, lb = ti[i + 1] - ti[i], tj[j + 1] - tj[j]
    ax, ay = pi[i + 1, 0] - pi[i, 0], pi[i + 1, 1] - pi[i, 1]
    bx, by = pj[j + 1, 0] - pj[j, 0], pj[j + 1, 1] - pj[j, 1]
    cx, cy = pi[i, 0] - pj[j, 0], pi[i, 1] - pj[j, 1]
    # x, y: shares of the two legs. A row is a function wx·x + wy·y, low or high end wanted
    for k in range(0, 8, 2):
        out[k], out[k + 1] = np.inf, -np.inf
    least = np.inf
    met = False
    for side in range(4):  # the four sides of the unit square
        if side == 0:
            x0, y0, dx, dy = 0.0, 0.0, 1.0, 0.0
        elif side == 1:
            x0, y0, dx, dy = 0.0, 1.0, 1.0, 0.0
        elif side == 2:
            x0, y0, dx, dy = 0.0, 0.0, 0.0, 1.0
        else:
            x0, y0, dx, dy = 1.0, 0.0, 0.0, 1.0
        ex, ey = cx + x0 * ax - y0 * bx, cy + x0 * ay - y0 * by
        vx, vy = dx * ax - dy * bx, dx * ay - dy * by
        near, _ = _edge2(ex, ey, ex + vx, ey + vy)
        least = min(least, near)
        square, half = vx * vx + vy * vy, ex * vx + ey * vy
        rest = ex * ex + ey * ey - reach * reach
        if square == 0.0:
            if rest > 0.0:
                continue
            t0, t1 = 0.0, 1.0
        else:
            root = half * half - square * rest
            if root < 0.0:
                continue
            root = np.sqrt(root)
            t0 = max(0.0, (-half - root) / square)
            t1 = min(1.0, (-half + root) / square)
            if t0 > t1:
                continue
        met = True
        for end in range(2):
            t = t1 if end else t0
            _widen(out, ti[i] + (x0 + t * dx) * la, tj[j] + (y0 + t * dy) * lb, share)
    turn = ay * bx - ax * by
    if abs(turn) > 1e-12 * (ax * ax + ay * ay + bx * bx + by * by):
        x, y = (cx * by - cy * bx) / turn, (cx * ay - cy * ax) / turn
        if 0.0 <= x <= 1.0 and 0.0 <= y <= 1.0:
            least = 0.0
        for k in range(5):  # where the ellipse is extreme in each of the functions
            if k == 0:
                wx, wy = (1.0 - share) * la, -(1.0 + share) * lb
            elif k == 1:
                wx, wy = (1.0 + share) * la, -(1.0 - share) * lb
            elif k == 2:
                wx, wy = la, -lb
            elif k == 3:
                wx, wy = 1.0, 0.0
            else:
                wx, wy = 0.0, 1.0
            # (x, y) = M (v - c) with v the vector between the robots: w·M v is extreme along w·M
            px = (-by * wx - ay * wy) / turn
            py = (bx * wx + ax * wy) / turn
            size = np.sqrt(px * px + py * py)
            if size == 0.0:
                continue
            for sign in (-1.0, 1.0):
                vx, vy = sign * reach * px / size - cx, sign * reach * py / size - cy
                x, y = (-by * vx + bx * vy) / turn, (-ay * vx + ax * vy) / turn
                if 0.0 <= x <= 1.0 and 0.0 <= y <= 1.0:
                    met = True
                    _widen(out, ti[i] + x * la, tj[j] + y * lb, share)
    if met:
        out[0] -= slack
        out[1] += slack
        out[8] = np.sqrt(least)
    return met


@njit(cache=True, error_model="numpy")
def _widen(out, a, b, share):  # type: ignore[no-untyped-def]
    """Take the progresses a and b of a moment within reach into the ranges of a row."""
    out[0] = min(out[0], (1.0 - share) * a - (1.0 + share) * b)
    out[1] = max(out[1], (1.0 + share) * a - (1.0 - share) * b)
    out[2] = min(out[2], a - b)
    out[3] = max(out[3], a - b)
    out[4] = min(out[4], a)
    out[5] = max(out[5], a)
    out[6] = min(out[6], b)
    out[7] = max(out[7], b)


@njit(cache=True, error_model="numpy")
def near_legs(ti, pi, box_i, tj, pj, box_j, reach, share, slack, most_lag):  # type: ignore[no-untyped-def]
    """Return which legs of two robots can meet within `reach`, whatever the lag up to `most_lag`.

    Parameters
    ----------
    ti, pi, box_i, tj, pj, box_j, share, slack
        See :func:`least_apart`.
    reach
        Distance, m.
    most_lag
        Lags (of the second robot's start) beyond this either way are not wanted, s.

    Returns
    -------
    legs
        (m, 2) pairs of legs, in no particular order but always the same.
    rows
        (m, 9): lags from [0] to [1] bring the two within reach; without any uncertainty [2] to
        [3] would; where that is, the first robot's progress is [4] to [5], the second's [6] to [7].
        [8] is the least distance of the two legs, m, whatever the times.
    """
    ni, nj = len(ti) - 1, len(tj) - 1
    li, lj = len(box_i) // 2, len(box_j) // 2
    legs = np.empty((64, 2), np.int32)
    rows = np.empty((64, ROW))
    count = 0
    out = np.empty(ROW)
    stack = np.empty((256, 2), np.int64)
    stack[0, 0] = stack[0, 1] = 1
    top = 1
    while top > 0:
        top -= 1
        a, b = stack[top, 0], stack[top, 1]
        if _apart2(box_i[a], box_j[b]) > reach * reach:
            continue
        a0, a1 = _span(a, li, ni)
        b0, b1 = _span(b, lj, nj)
        if a0 >= a1 or b0 >= b1:
            continue
        if (1.0 - share) * ti[a0] - (1.0 + share) * tj[b1] - slack > most_lag:
            continue
        if (1.0 + share) * ti[a1] - (1.0 - share) * tj[b0] + slack < -most_lag:
            continue
        if a < li or b < lj:
            if b >= lj or (a < li and a1 - a0 >= b1 - b0):
                stack[top, 0], stack[top, 1] = 2 * a + 1, b
                stack[top + 1, 0], stack[top + 1, 1] = 2 * a, b
            else:
                stack[top, 0], stack[top, 1] = a, 2 * b + 1
                stack[top + 1, 0], stack[top + 1, 1] = a, 2 * b
            top += 2
            continue
        for i in range(a0, a1):
            for j in range(b0, b1):
                if not _extremes(ti, pi, i, tj, pj, j, reach, share, slack, out):
                    continue
                if out[0] > most_lag or out[1] < -most_lag:
                    continue
                if count == len(legs):
                    more = np.empty((2 * count, 2), np.int32)
                    more[:count] = legs
                    legs = more
                    wider = np.empty((2 * count, ROW))
                    wider[:count] = rows
                    rows = wider
                legs[count, 0], legs[count, 1] = i, j
                rows[count] = out
                count += 1
    return legs[:count].copy(), rows[:count].copy()


@njit(cache=True, error_model="numpy")
def pair_distance(ti, pi, tj, pj, legs, lag, share, slack):  # type: ignore[no-untyped-def]
    """Return (m, 3) the least distance, m, of each of (m, 2) pairs of legs, and where it is.

    Columns: distance, progress of the first and of the second robot, s. The others are as in
    :func:`least_apart`.
    """
    out = np.empty((len(legs), 3))
    work = np.empty((3, 8, 2))
    for r in range(len(legs)):
        square, x, y = _legs2(ti, pi, legs[r, 0], tj, pj, legs[r, 1], lag, share, slack, work)
        out[r, 0], out[r, 1], out[r, 2] = np.sqrt(square), x, y
    return out

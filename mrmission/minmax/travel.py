"""Travel between the ends of lanes, in the water: all pairs, or near ones and a close estimate.

Up to :data:`DENSE_ENDS` ends all lengths stand in a matrix. More ends have exact lengths to all
within a reach of some dozens, found without all pairs. Beyond it, ends that lie together share a
cluster, and of two clusters the corners of land are kept at which the way between their middles
begins and ceases to bend: the way from end to end by these corners is quickly priced.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TypeAlias

import numpy as np
import numpy.typing as npt
from numba import njit

from mrmission.minmax.nearest import nearest_ends
from mrmission.model import FloatArray
from mrmission.routing.harbour import Harbour
from mrmission.routing.water import Near

Int: TypeAlias = npt.NDArray[np.int32]
Long: TypeAlias = npt.NDArray[np.int64]
Float: TypeAlias = npt.NDArray[np.float32]

DENSE_ENDS = 6000
"""Up to so many ends (half as many lanes) all lengths are kept: 300 MB."""
NEAR = 16
"""Nearest ends of other lanes that are listed for each end."""
TABLE = 144
"""Each end knows the exact lengths to about so many ends, rather fewer where the shore is rough."""
CLUSTERS = 2000
"""At most so many clusters share the ends."""
ASKED_BITS = 18
"""Of so many bits is the number of a place where an answer is kept for the next time."""
_BENDS = 5
_SINGLE = 1e-6
"""Corners and lengths in tables are rounded, places by less than so much of the farthest one."""

Price: TypeAlias = tuple[FloatArray, FloatArray, FloatArray, FloatArray, Long, FloatArray]
"""``(out, hook_s, table, rest, asked, answer_s)``: what makes seconds of metres.

out: (2n, 2) unit vectors out of the lines, 0 where there is none; hook_s: (2n,) what the hooks of
an end add; table: seconds of a corner by the cosine of its turn, from -1 to 1; rest: seconds of a
mean corner, seconds per metre, and how many times the straight line a way counts as bent; asked,
answer_s: pairs that were asked for lately and their seconds, written by `travel_s`.
"""

Arrays: TypeAlias = tuple[FloatArray, Int, Long, Int, Float, Float]
"""``(end, cluster, start, other, length_m, bend)``.

end: (2n, 4) east, north, way to the cluster's middle, reach of the table, all m; cluster: (2n,);
``other[start[e]:start[e + 1]]``: ends within reach of end e, ascending, and their lengths; bend:
for clusters ``a > b``, row ``a (a - 1) / 2 + b`` holds the first corner of the way from the middle
of a to that of b (east, north), the last, and the length between, or -1 where it is straight.
"""


@dataclass(frozen=True, slots=True, kw_only=True)
class Travel:
    """In-water lengths between the ends of lanes; ends ``2 i`` and ``2 i + 1`` are those of lane i.

    Attributes
    ----------
    ends_m
        (2n, 2) the ends, local frame.
    dense_m
        (2n, 2n) all lengths, symmetric, exact; None where there are too many.
    near
        (2n, K) the nearest ends of other lanes, nearest first.
    near_m
        (2n, K) lengths to these, exact.
    arrays
        What :func:`travel_m` reads; None where `dense_m` stands.
    """

    ends_m: FloatArray
    dense_m: FloatArray | None
    near: Int
    near_m: FloatArray
    arrays: Arrays | None


def no_answers() -> tuple[Long, FloatArray]:
    """Return `asked` and `answer_s` of a price of which nothing was asked yet."""
    return np.full(1 << ASKED_BITS, -1, dtype=np.int64), np.zeros(1 << ASKED_BITS)


def travel_between(harbour: Harbour, ends_m: FloatArray, *, dense_ends: int = DENSE_ENDS) -> Travel:
    """Return the in-water lengths between the ends of lanes.

    Parameters
    ----------
    harbour
        In-water ways.
    ends_m
        (2n, 2) ends of the lanes, both of a lane next to each other, local frame.
    dense_ends
        Up to so many ends all lengths are found.

    Raises
    ------
    PlanningError
        When an end lies outside the region.
    """
    ends = np.ascontiguousarray(ends_m, dtype=np.float64).reshape(-1, 2)
    if len(ends) <= max(dense_ends, 2):
        dense = harbour.distance_matrix(ends)
        near = nearest_ends(dense, NEAR).astype(np.int32)
        near_m = np.take_along_axis(dense, near.astype(np.int64), axis=1)
        return Travel(ends_m=ends, dense_m=dense, near=near, near_m=near_m, arrays=None)
    _, straight = _straight_nearest(ends, np.arange(len(ends)), min(TABLE, len(ends) - 2))
    # one more than the nearest, for the other end of its own lane
    table, reach_m = harbour.lengths_within(ends, straight[:, -1], NEAR + 1)
    near, near_m = _nearest_in(table, len(ends))
    arrays = _clustered(harbour, ends, table, reach_m)
    return Travel(ends_m=ends, dense_m=None, near=near, near_m=near_m, arrays=arrays)


def _nearest_in(table: Near, lengths: int) -> tuple[Int, FloatArray]:
    """Return (2n, K) the nearest ends of other lanes and the lengths, by a table of near ends."""
    start, other, length_m = table
    row = np.repeat(np.arange(lengths), np.diff(start))
    foreign = other >> 1 != row >> 1
    row, other, length_m = row[foreign], other[foreign], length_m[foreign]
    order = np.lexsort((other, length_m, row))
    count = np.bincount(row, minlength=lengths)
    first = np.concatenate([[0], np.cumsum(count)[:-1]])
    pick = order[first[:, None] + np.arange(min(NEAR, int(count.min())))]
    return np.ascontiguousarray(other[pick]), np.ascontiguousarray(length_m[pick])


def _straight_nearest(ends_m: FloatArray, which: Long, count: int) -> tuple[Long, FloatArray]:
    """Return the `count` nearest ends of other lanes in a straight line, nearest first."""
    low = ends_m.min(axis=0)
    span = np.maximum(ends_m.max(axis=0) - low, 1e-3)
    size = float(np.sqrt(span[0] * span[1] * max(count, 4) / (4 * len(ends_m)))) + 1e-6
    shape = (span / size).astype(np.int64) + 1
    cell = ((ends_m - low) / size).astype(np.int64)
    flat = cell[:, 0] * shape[1] + cell[:, 1]
    order = np.argsort(flat, kind="stable")
    start = np.searchsorted(flat[order], np.arange(shape[0] * shape[1] + 1))
    return _grid_nearest(ends_m, which, count, order, start, low, size, shape)


@njit(cache=True, error_model="numpy")
def _grid_nearest(ends, which, count, order, start, low, size, shape):  # type: ignore[no-untyped-def]
    """Search rings of cells about each end until the next ring can't hold a nearer end."""
    out = np.zeros((len(which), count), np.int64)
    away = np.full((len(which), count), np.inf)
    for i in range(len(which)):
        e = which[i]
        x, y = ends[e, 0], ends[e, 1]
        c = int((x - low[0]) / size)
        r = int((y - low[1]) / size)
        have = 0
        ring = 0
        while ring <= max(shape[0], shape[1]):
            if have == count and away[i, count - 1] <= (ring - 1) * size:
                break
            for cc in range(max(0, c - ring), min(shape[0] - 1, c + ring) + 1):
                step = 1 if abs(cc - c) == ring else max(1, 2 * ring)
                for rr in range(r - ring, r + ring + 1, step):
                    if rr < 0 or rr >= shape[1]:
                        continue
                    for k in range(start[cc * shape[1] + rr], start[cc * shape[1] + rr + 1]):
                        f = order[k]
                        if f >> 1 == e >> 1:
                            continue
                        d = math.hypot(ends[f, 0] - x, ends[f, 1] - y)
                        if have == count and d >= away[i, count - 1]:
                            continue
                        j = have if have < count else count - 1
                        while j > 0 and away[i, j - 1] > d:
                            away[i, j] = away[i, j - 1]
                            out[i, j] = out[i, j - 1]
                            j -= 1
                        away[i, j] = d
                        out[i, j] = f
                        have = min(have + 1, count)
            ring += 1
    return out, away


def _clustered(harbour: Harbour, ends_m: FloatArray, table: Near, reach_m: FloatArray) -> Arrays:
    """Return what the estimate of far lengths needs."""
    cluster, count = _clusters(ends_m, table)
    order = np.argsort(cluster, kind="stable")
    size = np.bincount(cluster, minlength=count)
    first = np.concatenate([[0], np.cumsum(size)[:-1]])
    centre = np.column_stack([np.bincount(cluster, ends_m[:, axis]) for axis in (0, 1)])
    off = np.hypot(*(ends_m - (centre / size[:, None])[cluster]).T)
    middle = order[np.lexsort((off[order], cluster[order]))][first]
    to_middle = harbour.pair_distances(ends_m, ends_m[middle[cluster]])
    start, other, length_m = table
    return (
        np.column_stack([ends_m, to_middle, reach_m]),
        cluster.astype(np.int32),
        start,
        other,
        length_m.astype(np.float32),
        _bends_between(harbour, ends_m[middle]),
    )


def _bends_between(harbour: Harbour, middle_m: FloatArray) -> Float:
    """Return the first and last corner of the ways between clusters, and the length between."""
    length, last, corner_m = harbour.last_corners(middle_m)
    count = len(middle_m)
    out = np.empty((count * (count - 1) // 2, _BENDS), dtype=np.float32)
    for a in range(1, count):
        rows = out[a * (a - 1) // 2 : a * (a + 1) // 2]
        leave, reach = corner_m[last[:a, a]], corner_m[last[a, :a]]
        rows[:, :2], rows[:, 2:4] = leave, reach
        between = length[a, :a] - np.hypot(*(leave - middle_m[a]).T)
        between -= np.hypot(*(reach - middle_m[:a]).T)
        rows[:, 4] = np.maximum(between, 0.0)
        rows[(last[a, :a] < 0) | (last[:a, a] < 0)] = -1.0
    return out


def _clusters(ends_m: FloatArray, table: Near) -> tuple[Long, int]:
    """Return each end's cluster and their number: ends of one square that near ways link."""
    low = ends_m.min(axis=0)
    span = float(np.max(ends_m.max(axis=0) - low)) + 1e-3
    small, large = span / 4096.0, span
    found = np.zeros(len(ends_m), dtype=np.int64)
    count = 1
    for _ in range(14):
        side = math.sqrt(small * large)
        cell = ((ends_m - low) / side).astype(np.int64)
        trial, many = _linked(cell[:, 0] * (1 << 20) + cell[:, 1], *table, 2.0 * side)
        if many <= CLUSTERS:
            found, count, large = trial, many, side
        else:
            small = side
    return found, count


@njit(cache=True, error_model="numpy")
def _linked(cell, start, other, length, reach):  # type: ignore[no-untyped-def]
    """Return to which set of linked ends of one cell each end belongs, and how many there are."""
    n = len(cell)
    parent = np.arange(n)
    for e in range(n):
        for k in range(start[e], start[e + 1]):
            f = other[k]
            if length[k] > reach or cell[e] != cell[f]:
                continue
            a, b = e, f
            while parent[a] != a:
                parent[a] = parent[parent[a]]
                a = parent[a]
            while parent[b] != b:
                parent[b] = parent[parent[b]]
                b = parent[b]
            if a < b:
                parent[b] = a
            else:
                parent[a] = b
    out = np.empty(n, np.int64)
    count = 0
    for e in range(n):
        a = e
        while parent[a] != a:
            a = parent[a]
        if a == e:
            out[e] = count
            count += 1
        else:
            out[e] = out[a]
    return out, count


@njit(cache=True, error_model="numpy")
def _listed(start: Long, other: Int, e: int, f: int) -> int:
    """Return the place of end f among those within reach of end e; -1 if it is not there."""
    low, high = start[e], start[e + 1]
    while low < high:
        middle = (low + high) >> 1
        if other[middle] < f:
            low = middle + 1
        else:
            high = middle
    return low if low < start[e + 1] and other[low] == f else -1


@njit(cache=True, error_model="numpy")
def _by_common(start: Long, other: Int, length_m: Float, e: int, f: int) -> float:
    """Return the shortest way from e to f by an end that both have within reach."""
    best = math.inf
    i, j = start[e], start[f]
    while i < start[e + 1] and j < start[f + 1]:
        if other[i] < other[j]:
            i += 1
        elif other[j] < other[i]:
            j += 1
        else:
            best = min(best, float(length_m[i]) + float(length_m[j]))
            i += 1
            j += 1
    return best


@njit(cache=True, error_model="numpy")
def _by_bends(end: FloatArray, bend: Float, e: int, f: int) -> float:
    """Return the length of the way from end e to f by the first and last corner of a row."""
    return (
        math.hypot(bend[0] - end[e, 0], bend[1] - end[e, 1])
        + bend[4]
        + math.hypot(bend[2] - end[f, 0], bend[3] - end[f, 1])
    )


@njit(cache=True, error_model="numpy")
def find_way(arrays: Arrays, e: int, f: int) -> tuple[int, float]:
    """Return the place of the pair ``e < f`` in the table, or -1 and an estimate of its length."""
    end, cluster, start, other, length_m, bend = arrays
    straight = math.hypot(end[f, 0] - end[e, 0], end[f, 1] - end[e, 1])
    floor = straight
    if straight <= end[e, 3]:
        k = _listed(start, other, e, f)
        if k >= 0:
            return k, float(length_m[k])
        floor = end[e, 3]  # all within reach are listed
    if straight <= end[f, 3]:
        k = _listed(start, other, f, e)
        if k >= 0:
            return k, float(length_m[k])
        floor = max(floor, end[f, 3])
    by_common = math.inf
    if straight <= end[e, 3] + end[f, 3]:
        by_common = _by_common(start, other, length_m, e, f)
    a, b = cluster[e], cluster[f]
    if a == b:
        return -1, max(floor, min(by_common, end[e, 2] + end[f, 2]))
    if a < b:
        a, b = b, a
        e, f = f, e
    row = a * (a - 1) // 2 + b
    if bend[row, 4] < 0.0:
        # Their middles see each other; these two don't where the floor tells so.
        if floor > straight and by_common < math.inf:
            return -1, max(floor, by_common)
        return -1, floor
    return -1, max(floor, min(by_common, _by_bends(end, bend[row], e, f)))


@njit(cache=True, error_model="numpy")
def travel_m(arrays: Arrays, e: int, f: int) -> float:
    """Return the length of the way between two ends: exact when near, else a close estimate.

    Never below the straight line, and the same both ways.
    """
    return find_way(arrays, min(e, f), max(e, f))[1]


@njit(cache=True, error_model="numpy")
def floors_m(arrays: Arrays, which: Long) -> tuple[FloatArray, npt.NDArray[np.bool_]]:
    """Return (n, n) lengths that no way between n of the ends undercuts, and which are exact.

    A way is no shorter than the straight one, than the reach of an end that does not list the
    other, and than the way between the middles of their clusters less the ways there.
    """
    end, cluster, start, other, length_m, bend = arrays
    slack = _SINGLE * np.abs(end[:, :2]).max()
    middle = np.zeros(cluster.max() + 1, np.int64)
    for e in range(len(end)):
        if end[e, 2] == 0.0:
            middle[cluster[e]] = e
    place = np.full(len(end), -1)
    place[which] = np.arange(len(which))
    n = len(which)
    out = np.zeros((n, n))
    exact = np.zeros((n, n), np.bool_)
    for i in range(n):
        e = which[i]
        for j in range(i):
            f = which[j]
            floor = max(math.hypot(end[f, 0] - end[e, 0], end[f, 1] - end[e, 1]), end[e, 3])
            floor = max(floor, end[f, 3])
            a, b = max(cluster[e], cluster[f]), min(cluster[e], cluster[f])
            if a != b:
                u, v = middle[a], middle[b]
                row = a * (a - 1) // 2 + b
                if bend[row, 4] < 0.0:
                    between = math.hypot(end[u, 0] - end[v, 0], end[u, 1] - end[v, 1])
                else:
                    between = _by_bends(end, bend[row], u, v)
                floor = max(floor, between - slack - end[e, 2] - end[f, 2])
            out[i, j] = out[j, i] = floor
    for i in range(n):
        e = which[i]
        for k in range(start[e], start[e + 1]):
            j = place[other[k]]
            if j >= 0 and j != i:
                out[i, j] = out[j, i] = (1.0 - _SINGLE) * length_m[k]
                exact[i, j] = exact[j, i] = True
    return out, exact


@njit(cache=True, error_model="numpy")
def price_way(
    price: Price, metres: float, straight: float, e: int, f: int, x: float, y: float
) -> float:
    """Return the seconds of a way of known length from end e to f that lies off by (x, y)."""
    out, hook_s, table, rest, _, _ = price
    mean, s_per_m, bent = rest[0], rest[1], rest[2]
    corner = 2.0 * mean
    if straight > 0.0 and metres <= bent * straight:
        top = len(table) - 1
        corner = 0.0
        for turn in range(2):
            end, sign = (e, 1.0) if turn == 0 else (f, -1.0)
            if out[end, 0] != 0.0 or out[end, 1] != 0.0:
                ahead = sign * (out[end, 0] * x + out[end, 1] * y) / straight
                corner += table[round((ahead + 1.0) * 0.5 * top)]
            else:
                corner += mean
    return max(0.0, metres * s_per_m + corner + hook_s[e] + hook_s[f])


@njit(cache=True, error_model="numpy")
def travel_s(arrays: Arrays, second_s: Float, price: Price, e: int, f: int) -> float:
    """Return the seconds of the way between two ends, its corners and hooks, see `travel_m`."""
    if e > f:
        e, f = f, e
    end, asked, answer_s = arrays[0], price[4], price[5]
    pair = np.int64(e) * len(end) + f
    slot = (np.uint64(pair) * np.uint64(0x9E3779B97F4A7C15)) >> np.uint64(64 - ASKED_BITS)
    if asked[slot] == pair:
        return answer_s[slot]
    k, metres = find_way(arrays, e, f)
    if k >= 0:
        seconds = float(second_s[k])
    else:
        x, y = end[f, 0] - end[e, 0], end[f, 1] - end[e, 1]
        seconds = price_way(price, metres, math.hypot(x, y), e, f, x, y)
    asked[slot] = pair
    answer_s[slot] = seconds
    return seconds


@njit(cache=True, error_model="numpy")
def price_table(arrays: Arrays, price: Price) -> Float:
    """Return the seconds of all ways in the table, as `travel_s` takes them."""
    end, _, start, other, length_m, _ = arrays
    out = np.empty(len(other), np.float32)
    for i in range(len(end)):
        for k in range(start[i], start[i + 1]):
            e, f = min(i, other[k]), max(i, other[k])
            x, y = end[f, 0] - end[e, 0], end[f, 1] - end[e, 1]
            # The length of the pair as it stands in the row of the smaller end, if it does.
            j = _listed(start, other, e, f)
            metres = float(length_m[j if j >= 0 else k])
            out[k] = price_way(price, metres, math.hypot(x, y), e, f, x, y)
    return out

"""Ways between the ends of lines, by the hooks that they do not cover anyway."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
from numba import njit

from mrmission.minmax.hooks import Hooks
from mrmission.model import FloatArray, IntArray
from mrmission.routing.harbour import Harbour

MAX_PASSES = 3
"""A hook bends a way, which may then need another: so often is looked again."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Ways:
    """Polylines one after the other.

    Attributes
    ----------
    start, points_m
        (ways + 1,), (p, 2): way ``i`` is ``points_m[start[i]:start[i + 1]]``.
    hooked
        (p,) of each point: 0, or 1 where it belongs to a hook of the way's first end, 2 of its
        last end.
    """

    start: IntArray
    points_m: FloatArray
    hooked: npt.NDArray[np.int8]

    def __len__(self) -> int:
        return len(self.start) - 1

    def way(self, index: int) -> FloatArray:
        """Return the points of one way."""
        return self.points_m[self.start[index] : self.start[index + 1]]


def hooked_ways(
    first: IntArray,
    last: IntArray,
    start: IntArray,
    points_m: FloatArray,
    hooks: Hooks,
    *,
    always: bool = False,
) -> Ways:
    """Return ways with the points of all hooks of their two ends that they would not cover.

    Parameters
    ----------
    first, last
        (ways,) the ends that each way leads from and to; -1 for one that is no end of a line.
    start, points_m
        The ways as they would be without hooks, as in :class:`Ways`.
    hooks
        What hangs on the ends.
    always
        Whether ways cover nothing, so that every hook is visited.
    """
    out_start, points, hooked = _hooked(
        np.ascontiguousarray(first, dtype=np.int64),
        np.ascontiguousarray(last, dtype=np.int64),
        np.ascontiguousarray(start, dtype=np.int64),
        np.ascontiguousarray(points_m, dtype=np.float64),
        hooks.of_end,
        hooks.point_start,
        hooks.points_m,
        hooks.hull_start,
        hooks.hull_m,
        hooks.reach_m,
        always,
    )
    return Ways(start=out_start, points_m=points, hooked=hooked)


def ways_between(entries: Sequence[IntArray]) -> tuple[IntArray, IntArray]:
    """Return (ways, 2) the ends that tours go between, -1 for home, and (ways,) whose they are.

    Parameters
    ----------
    entries
        Per robot the ends at which its lines are entered, in order; its ways are one after the
        other, from home to home. One without lines has none.
    """
    home = np.array([-1])
    pairs = [
        np.column_stack([np.concatenate([home, mine ^ 1]), np.concatenate([mine, home])])
        for mine in entries
        if len(mine)
    ]
    many = [len(mine) + 1 if len(mine) else 0 for mine in entries]
    none = np.zeros((0, 2), dtype=np.int64)
    return np.concatenate([none, *pairs]), np.repeat(np.arange(len(many)), many)


def shortest_ways(
    harbour: Harbour, ends_m: FloatArray, pairs: IntArray, owner: IntArray
) -> list[FloatArray]:
    """Return the shortest ways in the water between pairs of ends, without hooks.

    Parameters
    ----------
    harbour
        Ways in the water; robot ``r`` lives at berth ``r``.
    ends_m
        (ends, 2) where the ends are.
    pairs, owner
        See :func:`ways_between`.
    """
    out: list[FloatArray] = [np.zeros((0, 2))] * len(pairs)
    for side in (1, 0):
        index = np.flatnonzero(pairs[:, 1 - side] < 0)
        found = harbour.home_paths(owner[index].tolist(), ends_m[pairs[index, side]])
        for i, way in zip(index.tolist(), found, strict=True):
            out[i] = way if side else way[::-1]
    index = np.flatnonzero((pairs >= 0).all(axis=1))
    found = harbour.paths(ends_m[pairs[index, 0]], ends_m[pairs[index, 1]])
    for i, way in zip(index.tolist(), found, strict=True):
        out[i] = way
    return out


def straight(a_m: FloatArray, b_m: FloatArray) -> tuple[IntArray, FloatArray]:
    """Return `start` and `points_m` of straight ways between the pairs of two (n, 2) arrays."""
    points = np.stack([a_m, b_m], axis=1).reshape(-1, 2)
    return np.arange(len(a_m) + 1, dtype=np.int64) * 2, points


@njit(cache=True)
def _covered(hull, lo, hi, way, count, reach):  # type: ignore[no-untyped-def]
    """Return whether one leg of the way has all hull corners within reach."""
    for leg in range(count - 1):
        ax, ay = way[leg, 0], way[leg, 1]
        dx, dy = way[leg + 1, 0] - ax, way[leg + 1, 1] - ay
        square = dx * dx + dy * dy
        inside = True
        for i in range(lo, hi):
            px, py = hull[i, 0] - ax, hull[i, 1] - ay
            t = 0.0
            if square > 0.0:
                t = min(1.0, max(0.0, (px * dx + py * dy) / square))
            px -= t * dx
            py -= t * dy
            if px * px + py * py > reach * reach:
                inside = False
                break
        if inside:
            return True
    return False


@njit(cache=True)
def _add_hooks(out, mark, count, x, y, lo, hi, needed, points, point_start, label, used):  # type: ignore[no-untyped-def]
    """Append the points of the needed hooks lo..hi, the nearest to where one is first."""
    for h in range(lo, hi):
        used[h - lo] = False
    for _ in range(lo, hi):
        best, best_square = -1, np.inf
        for h in range(lo, hi):
            if needed[h - lo] and not used[h - lo]:
                i = point_start[h]
                square = (points[i, 0] - x) ** 2 + (points[i, 1] - y) ** 2
                if square < best_square:
                    best, best_square = h, square
        if best < 0:
            break
        used[best - lo] = True
        for i in range(point_start[best], point_start[best + 1]):
            x, y = points[i, 0], points[i, 1]
            out[count, 0], out[count, 1] = x, y
            mark[count] = label
            count += 1
    return count


@njit(cache=True)
def _hooked(  # type: ignore[no-untyped-def]
    first, last, start, way, of_end, point_start, points, hull_start, hull, reach, always
):
    """Return start, points and marks of :class:`Ways`; see `hooked_ways`."""
    n = len(first)
    most, widest = 1, 0
    for e in range(len(of_end) - 1):
        most = max(most, of_end[e + 1] - of_end[e])
        widest = max(widest, point_start[of_end[e + 1]] - point_start[of_end[e]])
    longest = 0
    room = 0
    for p in range(n):
        size = start[p + 1] - start[p]
        longest = max(longest, size)
        room += size
        for e in (first[p], last[p]):
            if e >= 0:
                room += point_start[of_end[e + 1]] - point_start[of_end[e]]
    out = np.empty((room, 2))
    marks = np.zeros(room, np.int8)
    out_start = np.zeros(n + 1, np.int64)
    buffer = np.empty((longest + 2 * widest, 2))
    mark = np.zeros(longest + 2 * widest, np.int8)
    tail = np.empty((widest + 1, 2))
    tail_mark = np.zeros(widest + 1, np.int8)
    need_a = np.zeros(most, np.bool_)
    need_b = np.zeros(most, np.bool_)
    used = np.zeros(most, np.bool_)
    total = 0
    for p in range(n):
        lo, hi = start[p], start[p + 1]
        a_lo = a_hi = b_lo = b_hi = 0
        if first[p] >= 0:
            a_lo, a_hi = of_end[first[p]], of_end[first[p] + 1]
        if last[p] >= 0:
            b_lo, b_hi = of_end[last[p]], of_end[last[p] + 1]
        need_a[:] = always
        need_b[:] = always
        count = 0
        for turn in range(MAX_PASSES + 1):
            # a first point, hooks of the first end, what lies between, hooks of the last, the last
            buffer[0] = way[lo]
            mark[0] = 0
            count = _add_hooks(
                buffer, mark, 1, way[lo, 0], way[lo, 1], a_lo, a_hi, need_a, points, point_start,
                1, used,
            )  # fmt: skip
            for i in range(lo + 1, hi - 1):
                buffer[count] = way[i]
                mark[count] = 0
                count += 1
            back = _add_hooks(
                tail, tail_mark, 0, way[hi - 1, 0], way[hi - 1, 1], b_lo, b_hi, need_b, points,
                point_start, 2, used,
            )  # fmt: skip
            for i in range(back - 1, -1, -1):
                buffer[count] = tail[i]
                mark[count] = 2
                count += 1
            buffer[count] = way[hi - 1]
            mark[count] = 0
            count += 1
            if turn == MAX_PASSES:
                break
            changed = False
            for h in range(a_lo, a_hi):
                if need_a[h - a_lo]:
                    continue
                if not _covered(hull, hull_start[h], hull_start[h + 1], buffer, count, reach):
                    need_a[h - a_lo] = changed = True
            for h in range(b_lo, b_hi):
                if need_b[h - b_lo]:
                    continue
                if not _covered(hull, hull_start[h], hull_start[h + 1], buffer, count, reach):
                    need_b[h - b_lo] = changed = True
            if not changed:
                break
        out[total : total + count] = buffer[:count]
        marks[total : total + count] = mark[:count]
        total += count
        out_start[p + 1] = total
    return out_start, out[:total], marks[:total]

"""Fewer waypoints on the way around a shore: long arcs of small bends become single corners."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import cache

import numpy as np

from mrmission.model import BoolArray, FloatArray, IntArray

MAX_CHAIN = 24
"""At most this many bends are replaced by one corner."""
MAX_DETOUR_SHARE = 0.02
MAX_DETOUR_M = 1.0
"""A way may become longer by this share of its length, or by this much if that is more."""
AT_ONCE = 20_000
"""Points of ways that are looked at together: enough for long rows, little enough for memory."""
_MAX_TURN_COS = -0.5

Visible = Callable[[FloatArray, FloatArray], BoolArray]


def straighten(ways: Sequence[FloatArray], visible: Visible) -> list[FloatArray]:
    """Return the ways with fewer bends, a little longer, still in the water.

    A shortest way hugs the shore and bends at each of its corners. A run of bends of one sense is
    replaced by one corner where the legs before and after it, prolonged, meet: it lies on the
    water side of the run. Of all replacements that stay in the water (`visible`) and within
    the detour allowed, the fewest waypoints are chosen, the shortest way among equals.

    Parameters
    ----------
    ways
        (n, 2) polylines.
    visible
        Tells for the pairs of two (m, 2) arrays whether the segment between them is in the water.
    """
    out: list[FloatArray] = []
    first = 0
    for last in range(1, len(ways) + 1):
        if last == len(ways) or sum(map(len, ways[first:last])) >= AT_ONCE:
            out += _straightened(ways[first:last], visible)
            first = last
    return out


def _straightened(ways: Sequence[FloatArray], visible: Visible) -> list[FloatArray]:
    """Return ways as `straighten` does, all in one go."""
    start, runs, corner, extra, before, after = _corners(ways)
    if len(corner) == 0:
        return list(ways)
    free = visible(before, corner)
    free[free] = visible(corner[free], after[free])
    at = np.concatenate([[0], np.cumsum(free)])[start].tolist()
    runs, corner, extra = runs[free], corner[free], extra[free]
    return [
        _fewest(way, runs[a:b], corner[a:b], extra[a:b]) if b > a else way
        for way, a, b in zip(ways, at[:-1], at[1:], strict=True)
    ]


@cache
def _runs(points: int) -> IntArray:
    """Return (r, 2) runs of bends i..j of a way of so many points, those that are not too long."""
    i, j = np.triu_indices(points - 2, 1)
    kept = j - i < MAX_CHAIN
    return np.column_stack([i[kept], j[kept]]) + 1


def _corners(
    ways: Sequence[FloatArray],
) -> tuple[IntArray, IntArray, FloatArray, FloatArray, FloatArray, FloatArray]:
    """Return runs of bends i..j of ways that one corner can stand for.

    Returns
    -------
    start
        (ways + 1,) where the runs of each begin.
    runs, corner, extra
        (r, 2) bends, (r, 2) corners, (r,) what each adds to the length.
    before, after
        (r, 2) the ends of each run.
    """
    size = np.array([len(way) for way in ways], dtype=np.int64)
    offset = np.cumsum(size) - size
    points = np.concatenate([np.zeros((0, 2)), *ways])
    leg = np.diff(points, axis=0)
    length = np.hypot(leg[:, 0], leg[:, 1])
    unit = leg / np.maximum(length, 1e-12)[:, None]
    prefix = np.zeros(len(points))
    allowed = np.zeros(len(ways))
    for k, (at, n) in enumerate(zip(offset.tolist(), size.tolist(), strict=True)):
        if n >= 4:
            prefix[at + 1 : at + n] = np.cumsum(length[at : at + n - 1])
            allowed[k] = max(MAX_DETOUR_M, MAX_DETOUR_SHARE * prefix[at + n - 1])
    local = [_runs(n) if n >= 4 else np.zeros((0, 2), dtype=np.int64) for n in size.tolist()]
    of_way = np.repeat(np.arange(len(ways)), [len(own) for own in local])
    runs = np.concatenate([np.zeros((0, 2), dtype=np.int64), *local])
    i, j = (runs + offset[of_way][:, None]).T
    u, v = unit[i - 1], unit[j]
    cross = u[:, 0] * v[:, 1] - u[:, 1] * v[:, 0]
    gap = points[j] - points[i]  # = ahead * u + back * v, and the corner is points[i] + ahead * u
    safe = np.where(np.abs(cross) > 1e-9, cross, 1.0)
    ahead = (gap[:, 0] * v[:, 1] - gap[:, 1] * v[:, 0]) / safe
    back = (gap[:, 1] * u[:, 0] - gap[:, 0] * u[:, 1]) / safe
    extra = ahead + back - (prefix[j] - prefix[i])
    good = (
        (np.abs(cross) > 1e-9)
        & (ahead > 0)
        & (back > 0)
        & ((u * v).sum(axis=1) > _MAX_TURN_COS)
        & (extra <= allowed[of_way])
    )
    start = np.searchsorted(of_way[good], np.arange(len(ways) + 1))
    i, j = i[good], j[good]
    corner = points[i] + ahead[good, None] * u[good]
    return start, runs[good], corner, extra[good], points[i], points[j]


def _fewest(way: FloatArray, runs: IntArray, corners: FloatArray, extra: FloatArray) -> FloatArray:
    """Return the way with runs replaced so that the waypoints are fewest, then the way shortest."""
    n = len(way)
    allowed = max(MAX_DETOUR_M, MAX_DETOUR_SHARE * np.hypot(*np.diff(way, axis=0).T).sum())
    by_end: dict[int, list[int]] = {}
    for r, (_, j) in enumerate(runs.tolist()):
        by_end.setdefault(j, []).append(r)
    best: list[tuple[int, float, int]] = [(0, 0.0, -1)]  # waypoints up to bend j, added, by run
    for j in range(1, n):
        count, added, _ = best[j - 1]
        choice = (count + 1, added, -1)
        for r in by_end.get(j, ()):
            i = int(runs[r, 0])
            count_r, added_r = best[i - 1][0] + 1, best[i - 1][1] + float(extra[r])
            if added_r <= allowed and (count_r, added_r) < choice[:2]:
                choice = (count_r, added_r, r)
        best.append(choice)
    points: list[FloatArray] = []
    j = n - 1
    while j >= 0:
        r = best[j][2]
        if r < 0:
            points.append(way[j])
            j -= 1
        else:
            points.append(corners[r])
            j = int(runs[r, 0]) - 1
    return np.array(points[::-1])

"""Fewer waypoints on the way around a shore: long arcs of small bends become single corners."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from mrmission.model import BoolArray, FloatArray, IntArray

MAX_CHAIN = 24
"""At most this many bends are replaced by one corner."""
MAX_DETOUR_SHARE = 0.02
MAX_DETOUR_M = 1.0
"""A way may become longer by this share of its length, or by this much if that is more."""
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
    found = [_corners(way) for way in ways]
    corner = np.concatenate([np.zeros((0, 2)), *(f[1] for f in found)])
    ends = [way[runs] for way, (runs, _, _) in zip(ways, found, strict=True)]
    before, after = np.moveaxis(np.concatenate([np.zeros((0, 2, 2)), *ends]), 1, 0)
    if len(corner) == 0:
        return list(ways)
    free = visible(before, corner)
    free[free] = visible(corner[free], after[free])
    out, at = [], 0
    for way, (runs, corners, extra) in zip(ways, found, strict=True):
        mine = free[at : at + len(runs)]
        at += len(runs)
        out.append(_fewest(way, runs[mine], corners[mine], extra[mine]) if mine.any() else way)
    return out


def _corners(way: FloatArray) -> tuple[IntArray, FloatArray, FloatArray]:
    """Return runs (r, 2) of bends i..j, the corner of each, and what it adds to the length."""
    n = len(way)
    nothing = (np.zeros((0, 2), dtype=np.int64), np.zeros((0, 2)), np.zeros(0))
    if n < 4:
        return nothing
    i, j = np.triu_indices(n - 2, 1)
    i, j = i + 1, j + 1
    kept = j - i < MAX_CHAIN
    i, j = i[kept], j[kept]
    leg = np.diff(way, axis=0)
    length = np.hypot(leg[:, 0], leg[:, 1])
    unit = leg / np.maximum(length, 1e-12)[:, None]
    u, v = unit[i - 1], unit[j]
    cross = u[:, 0] * v[:, 1] - u[:, 1] * v[:, 0]
    gap = way[j] - way[i]  # = ahead * u + back * v, and the corner is way[i] + ahead * u
    safe = np.where(np.abs(cross) > 1e-9, cross, 1.0)
    ahead = (gap[:, 0] * v[:, 1] - gap[:, 1] * v[:, 0]) / safe
    back = (gap[:, 1] * u[:, 0] - gap[:, 0] * u[:, 1]) / safe
    prefix = np.concatenate([[0.0], np.cumsum(length)])
    extra = ahead + back - (prefix[j] - prefix[i])
    allowed = max(MAX_DETOUR_M, MAX_DETOUR_SHARE * prefix[-1])
    good = (
        (np.abs(cross) > 1e-9)
        & (ahead > 0)
        & (back > 0)
        & ((u * v).sum(axis=1) > _MAX_TURN_COS)
        & (extra <= allowed)
    )
    i, j = i[good], j[good]
    return np.column_stack([i, j]), way[i] + ahead[good, None] * u[good], extra[good]


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

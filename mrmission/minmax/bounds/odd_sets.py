"""Odd sets of line ends for the bounds: found, and the legs across their borders."""

from __future__ import annotations

import numpy as np
from numba import njit


@njit(cache=True)
def odd_sets(start, other, mean, mean_home, most, gap, found, size, cut):  # type: ignore[no-untyped-def]
    """Grow sets of ends that legs leave too seldom; return how many were found.

    From every end, the end that is joined to the set most strongly is added; of all odd sets on
    the way the one whose border is crossed least often is kept, if that is less than ``1 - gap``.
    ``mean`` has the use of each leg in either direction. Sets go to ``found`` (ends, most).
    """
    m = len(start) - 1
    weight = np.zeros(m)
    inside = np.zeros(m, np.bool_)
    touched = np.zeros(m * 4, np.int64)
    members = np.zeros(most, np.int64)
    count = 0
    for first in range(m):
        held = 0
        touches = 0
        border = 0.0
        best, best_size = 1.0 - gap, 0
        v = first
        while held < most:
            members[held] = v
            inside[v] = True
            held += 1
            degree = mean_home[v]
            for q in range(start[v], start[v + 1]):
                if mean[q] <= 0.0:
                    continue
                degree += mean[q]
                u = other[q]
                if not inside[u]:
                    if weight[u] == 0.0:
                        touched[touches] = u
                        touches += 1
                    weight[u] += mean[q]
            border += degree - 2.0 * weight[v]
            if held % 2 == 1 and held > 1 and border < best:
                best, best_size = border, held
            v = -1
            for t in range(touches):
                u = touched[t]
                if not inside[u] and (v < 0 or weight[u] > weight[v]):
                    v = u
            if v < 0:
                break
        if best_size > 0:
            found[count, :best_size] = members[:best_size]
            size[count] = best_size
            cut[count] = best
            count += 1
        for t in range(touches):
            weight[touched[t]] = 0.0
        for t in range(held):
            inside[members[t]] = False
            weight[members[t]] = 0.0
    return count


@njit(cache=True)
def crossings(start, other, cover_start, cover_end):  # type: ignore[no-untyped-def]
    """Return for each set the places of the legs with one end in it, in either direction."""
    m = len(start) - 1
    inside = np.zeros(m, np.bool_)
    out_start = np.zeros(len(cover_start), np.int64)
    room = 0
    for s in range(len(cover_start) - 1):
        for c in range(cover_start[s], cover_start[s + 1]):
            a = cover_end[c]
            room += 2 * (start[a + 1] - start[a])
    out = np.zeros(room, np.int64)
    back = np.zeros(len(other), np.int64)
    for a in range(m):
        for q in range(start[a], start[a + 1]):
            b = other[q]
            place = start[b] + np.searchsorted(other[start[b] : start[b + 1]], a)
            back[q] = place
    count = 0
    for s in range(len(cover_start) - 1):
        for c in range(cover_start[s], cover_start[s + 1]):
            inside[cover_end[c]] = True
        for c in range(cover_start[s], cover_start[s + 1]):
            a = cover_end[c]
            for q in range(start[a], start[a + 1]):
                if not inside[other[q]]:
                    out[count] = q
                    out[count + 1] = back[q]
                    count += 2
        for c in range(cover_start[s], cover_start[s + 1]):
            inside[cover_end[c]] = False
        out_start[s + 1] = count
    return out_start, out[:count]

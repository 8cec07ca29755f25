"""The best way to share out few lines, by looking at every one."""

from __future__ import annotations

import numpy as np
from numba import njit

from mrmission.model import FloatArray


def best_makespan(
    line_s: FloatArray,
    end_s: FloatArray,
    home_s: FloatArray,
    sweep: FloatArray | None = None,
    travel: FloatArray | None = None,
    trip: FloatArray | None = None,
    swap: FloatArray | None = None,
) -> float:
    """The optimum by looking at every set of lines for every robot, and for each of its trips.

    Infinite where no trips of at most `trip` seconds do; between two lie `swap` seconds. Up to 18
    lines are a matter of seconds.
    """
    robots = len(home_s)
    ones, none = np.ones(robots), np.zeros(robots)
    a, b = (ones if x is None else np.asarray(x, dtype=float) for x in (sweep, travel))
    best = np.full(1 << len(line_s), np.inf)
    best[0] = 0.0
    for r in range(robots):
        mine = _tours(a[r] * line_s, np.ascontiguousarray(b[r] * end_s), b[r] * home_s[r])
        if trip is not None:
            mine = _in_trips(mine, float(trip[r]), float((none if swap is None else swap)[r]))
        best = _shared(best, mine)
    return float(best[-1])


@njit(cache=True)
def _tours(line, end, home):  # type: ignore[no-untyped-def]
    """Return the least seconds from home over every set of lines and back."""
    n = len(line)
    # over a set of lines to the end where the last is left
    best = np.full((1 << n, 2 * n), np.inf)
    closed = np.full(1 << n, np.inf)
    closed[0] = 0.0
    for e in range(2 * n):
        best[1 << (e >> 1), e ^ 1] = home[e] + line[e >> 1]
    for swept in range(1, 1 << n):
        for x in range(2 * n):
            here = best[swept, x]
            if here == np.inf:
                continue
            closed[swept] = min(closed[swept], here + home[x])
            for e in range(2 * n):
                if not swept >> (e >> 1) & 1:
                    more = swept | 1 << (e >> 1)
                    best[more, e ^ 1] = min(best[more, e ^ 1], here + end[x, e] + line[e >> 1])
    return closed


@njit(cache=True)
def _shared(before, mine):  # type: ignore[no-untyped-def]
    """Return the least makespan over every set with one robot more."""
    out = np.full(len(mine), np.inf)
    for swept in range(len(mine)):
        part = swept
        while True:
            out[swept] = min(out[swept], max(mine[part], before[swept ^ part]))
            if part == 0:
                break
            part = (part - 1) & swept
    return out


@njit(cache=True)
def _in_trips(closed, trip, swap):  # type: ignore[no-untyped-def]
    """Return the least seconds over every set in any number of trips, from those of one each."""
    best = np.full(len(closed), np.inf)
    best[0] = 0.0
    for swept in range(1, len(closed)):
        one = swept
        while one:
            if closed[one] <= trip:
                rest = swept ^ one
                best[swept] = min(best[swept], closed[one] + (best[rest] + swap if rest else 0.0))
            one = (one - 1) & swept
    return best

"""The bound for few chosen lines: the best way to share them out, by looking at every one."""

from __future__ import annotations

import numpy as np
from numba import njit

from mrmission.model import FloatArray

MOST_LOOKED_AT = 1e9
"""No more parts of sets, and legs after sets, are looked at: 18 lines for two robots, 17 for up to
16 that are alike, in about a second."""


def few_lines_makespan(
    line_s: FloatArray,
    end_s: FloatArray,
    home_s: FloatArray,
    scales: tuple[FloatArray, FloatArray],
    trips: tuple[FloatArray | None, FloatArray | None] = (None, None),
) -> float:
    """Return the least makespan of all tours over the lines, each swept in one go.

    Tables over all sets of lines: what a tour over each takes at least (M. Held, R. M. Karp, "A
    dynamic programming approach to sequencing problems", J. SIAM 10, 1962, with two ends to each
    line), then what robots take that share it.

    Parameters
    ----------
    line_s : (n,) array
        Seconds of sweeping each line.
    end_s : (2n, 2n) array
        Seconds of going from one end to another.
    home_s : (robots, 2n) array
        Seconds between each robot's home and the ends, its own.
    scales
        (robots,) and (robots,): what the seconds of lines, and between ends, are multiplied by.
    trips
        (robots,) how long a robot may be away from home, and (robots,) what it spends between two
        trips; None where all go out once, or come home for nothing.

    Returns
    -------
    float
        Infinite where no trips reach all lines; 0 where that were more than
        :data:`MOST_LOOKED_AT` ways to look at.
    """
    away, swap = (None if t is None else np.asarray(t, dtype=np.float64) for t in trips)
    own = np.column_stack([*scales, home_s, *(t for t in (away, swap) if t is not None)])
    first, count = np.unique(own, axis=0, return_index=True, return_counts=True)[1:]
    n = min(len(line_s), 99)  # more are too many in any case
    shared = sum(c.bit_length() - 1 + c.bit_count() for c in count.tolist()) - 1
    parted = shared if away is None else shared + len(count)
    if parted * 3.0**n + len(count) * 2.0**n * 2 * n**2 > MOST_LOOKED_AT:
        return 0.0
    best = None
    for r, many in zip(first.tolist(), count.tolist(), strict=True):
        sweep, travel = (float(scale[r]) for scale in scales)
        alike = _tours(
            np.ascontiguousarray(sweep * line_s, dtype=np.float64),
            np.ascontiguousarray(travel * end_s, dtype=np.float64),
            np.ascontiguousarray(home_s[r], dtype=np.float64),
        )
        if away is not None:
            alike = _in_trips(alike, float(away[r]), 0.0 if swap is None else float(swap[r]))
        for bit in range(many.bit_length()):  # twice as many robots each time
            if bit:
                alike = _shared(alike, alike)
            if many >> bit & 1:
                best = alike if best is None else _shared(best, alike)
    return 0.0 if best is None else float(best[-1])


@njit(cache=True)
def _tours(line, end, home):  # type: ignore[no-untyped-def]
    """Return (sets,) the least seconds from home over every set of lines and back."""
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
def _shared(some, others):  # type: ignore[no-untyped-def]
    """Return (sets,) the least makespan over every set that two groups of robots share."""
    out = np.full(len(some), np.inf)
    for swept in range(len(some)):
        part = swept
        while True:
            out[swept] = min(out[swept], max(some[part], others[swept ^ part]))
            if part == 0:
                break
            part = (part - 1) & swept
    return out


@njit(cache=True)
def _in_trips(closed, away, swap):  # type: ignore[no-untyped-def]
    """Return (sets,) the least seconds over every set in any number of trips."""
    best = np.full(len(closed), np.inf)
    best[0] = 0.0
    for swept in range(1, len(closed)):
        trip = swept
        while trip:
            if closed[trip] <= away:
                rest = swept ^ trip
                best[swept] = min(best[swept], closed[trip] + (best[rest] + swap if rest else 0.0))
            trip = (trip - 1) & swept
    return best

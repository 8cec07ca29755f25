"""The best way to share out few lines, by looking at every one."""

from __future__ import annotations

import numpy as np

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

    Infinite where no trips of at most `trip` seconds do; between two lie `swap` seconds.
    """
    lines, robots = len(line_s), len(home_s)
    full = (1 << lines) - 1
    done = {0: 0.0}
    for r in range(robots):
        a = 1.0 if sweep is None else float(sweep[r])
        b = 1.0 if travel is None else float(travel[r])
        end, home, line = (b * end_s).tolist(), (b * home_s[r]).tolist(), (a * line_s).tolist()
        # least seconds from home over a set of lines to the end where the last is left
        best = [[np.inf] * (2 * lines) for _ in range(full + 1)]
        closed = [np.inf] * (full + 1)
        closed[0] = 0.0
        for e in range(2 * lines):
            best[1 << (e >> 1)][e ^ 1] = home[e] + line[e >> 1]
        for mask in range(1, full + 1):
            for x in range(2 * lines):
                here = best[mask][x]
                if here == np.inf:
                    continue
                closed[mask] = min(closed[mask], here + home[x])
                for e in range(2 * lines):
                    if not mask >> (e >> 1) & 1:
                        new = here + end[x][e] + line[e >> 1]
                        grown = best[mask | 1 << (e >> 1)]
                        grown[e ^ 1] = min(grown[e ^ 1], new)
        if trip is not None:
            closed = _in_trips(closed, float(trip[r]), 0.0 if swap is None else float(swap[r]))
        reach: dict[int, float] = {}
        for swept, cost in done.items():
            mask = full & ~swept
            while True:
                value = max(cost, closed[mask])
                reach[swept | mask] = min(reach.get(swept | mask, np.inf), value)
                if mask == 0:
                    break
                mask = (mask - 1) & (full & ~swept)
        done = reach
    return done[full]


def _in_trips(closed: list[float], trip: float, swap: float) -> list[float]:
    """Least seconds over every set of lines in any number of trips, from those of one trip each."""
    best = [np.inf] * len(closed)
    best[0] = 0.0
    for mask in range(1, len(closed)):
        one = mask
        while one:
            if closed[one] <= trip:
                rest = mask & ~one
                best[mask] = min(best[mask], closed[one] + (best[rest] + swap if rest else 0.0))
            one = (one - 1) & mask
    return best

"""The bound for chosen lines is never above the optimum, and each of its terms shows."""

from __future__ import annotations

import numpy as np
import pytest
import shapely

from mrmission.minmax.bound import lanes_bound
from mrmission.model import FloatArray
from mrmission.routing.water import WaterRouter


def best_makespan(
    line_s: FloatArray,
    end_s: FloatArray,
    home_s: FloatArray,
    sweep: FloatArray | None = None,
    travel: FloatArray | None = None,
) -> float:
    """The optimum by looking at every set of lines for every robot."""
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


def _open_water(rng: np.random.Generator, lines: int, robots: int) -> tuple[FloatArray, ...]:
    kind = rng.integers(3)
    foot = rng.uniform(0, 100, (lines, 2))
    if kind == 0:  # anyhow
        tip = foot + rng.uniform(-60, 60, (lines, 2))
    elif kind == 1:  # side by side
        foot[:, 0] = 10.0 * np.arange(lines)
        tip = foot + np.array([0.0, 1.0]) * rng.uniform(1, 80, (lines, 1))
    else:  # short and far apart
        tip = foot + rng.uniform(-2, 2, (lines, 2))
    ends = np.stack([foot, tip], axis=1).reshape(-1, 2)
    homes = np.tile(rng.uniform(-80, 180, 2), (robots, 1))
    if rng.integers(2):
        homes = rng.uniform(-80, 180, (robots, 2))
    line = np.hypot(*(ends[1::2] - ends[::2]).T)
    end = np.hypot(*(ends[:, None] - ends[None]).transpose(2, 0, 1))
    home = np.hypot(*(homes[:, None] - ends[None]).transpose(2, 0, 1))
    return line, end, home


def _with_walls(rng: np.random.Generator, lines: int, robots: int) -> tuple[FloatArray, ...]:
    """Lanes side by side in a pool with two walls from either side, so that ways are long."""
    a, b = np.sort(rng.uniform(15, 85, 2))
    pool = shapely.box(0, 0, 100, 60)
    pool = pool - shapely.box(a, 0, a + 2, rng.uniform(20, 55))
    pool = pool - shapely.box(b + 4, rng.uniform(5, 40), b + 6, 60)
    ends = []
    while len(ends) < lines:
        x = rng.uniform(1, 99)
        column = shapely.LineString([(x, 0), (x, 60)]) & pool
        part = rng.choice(shapely.get_parts(column))
        if part.length > 1:
            ends.append(shapely.get_coordinates(part))
    flat = np.concatenate(ends)
    home = shapely.get_coordinates(shapely.Point(1.0, 30.0))
    router = WaterRouter(pool)
    return (
        np.hypot(*(flat[1::2] - flat[::2]).T),
        router.distance_matrix(flat),
        np.repeat(router.distances(home, flat), robots, axis=0),
    )


def test_never_above_the_optimum() -> None:
    rng = np.random.default_rng(4)
    terms: dict[str, int] = {}
    tight = []
    for case in range(240):
        lines, robots = int(rng.integers(1, 7 if case % 4 == 0 else 6)), int(rng.integers(1, 4))
        make = _with_walls if case % 3 == 2 else _open_water
        line, end, home = make(rng, lines, robots)
        best = best_makespan(line, end, home)
        bound = lanes_bound(line_s=line, end_s=end, home_s=home)
        assert bound.makespan_s <= best * (1 + 1e-9), f"case {case}"
        terms[bound.term] = terms.get(bound.term, 0) + 1
        tight.append(bound.makespan_s / best)
    assert len(terms) >= 3, terms
    assert np.mean(tight) > 0.9

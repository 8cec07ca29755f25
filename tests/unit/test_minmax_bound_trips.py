"""The bound for robots that come home in between is never above the best trips, and knows them."""

from __future__ import annotations

import numpy as np
import pytest

from mrmission.minmax.bounds.few_lines import few_lines_makespan
from mrmission.minmax.bounds.lanes import lanes_bound
from mrmission.model import FloatArray
from tests.best_tours import best_makespan

pytestmark = pytest.mark.usefixtures("not_every_order")


def _lines(rng: np.random.Generator, lines: int, robots: int) -> tuple[FloatArray, ...]:
    """Lines anywhere, the robots side by side or, one time in two, anywhere as well."""
    ends = rng.uniform(0, 100, (lines, 1, 2)) + rng.uniform(-25, 25, (lines, 2, 2))
    flat = ends.reshape(-1, 2)
    homes = np.tile(rng.uniform(0, 100, 2), (robots, 1))
    if rng.integers(2):
        homes = rng.uniform(0, 100, (robots, 2))
    return (
        np.hypot(*(flat[1::2] - flat[::2]).T),
        np.hypot(*(flat[:, None] - flat[None]).transpose(2, 0, 1)),
        np.hypot(*(homes[:, None] - flat[None]).transpose(2, 0, 1)),
    )


@pytest.mark.parametrize("alike", [True, False])
def test_never_above_the_best_trips(alike: bool) -> None:
    rng = np.random.default_rng(30 + alike)
    more = 0
    for case in range(200):
        lines, robots = int(rng.integers(1, 9)), int(rng.integers(1, 4))
        line, end, home = _lines(rng, lines, robots)
        sweep, travel = np.ones((2, robots)) if alike else rng.uniform(0.5, 2, (2, robots))
        own = travel[:, None] * home
        plain = few_lines_makespan(line, end, own, (sweep, travel))
        trip = rng.uniform(0.4, 1.1, 1 if alike else robots) * np.full(robots, plain)
        swap = rng.uniform(0, 30, 1 if alike else robots) * np.ones(robots)
        best = few_lines_makespan(line, end, own, (sweep, travel), (trip, swap))
        if best == np.inf:  # some line is too far
            continue
        given = {"line_s": line, "end_s": end, "home_s": own}
        scales = {"sweep_scale": sweep, "travel_scale": travel}
        bound = lanes_bound(**given, **scales, trip_s=trip, swap_s=swap)
        assert bound.makespan_s <= best * (1 + 1e-9), f"case {case}"
        without = lanes_bound(**given, **scales)
        assert without.makespan_s <= best * (1 + 1e-9), f"case {case}"
        more += bound.makespan_s > 1.01 * without.makespan_s
    assert more > 10


def test_trips_to_the_end_of_an_arm_are_counted() -> None:
    # six lines of 10 s, 100 s away: one after the other in one trip of 265 s, or each alone
    line, home = np.full(6, 10.0), np.full((1, 12), 100.0)
    end = np.where(np.eye(12) > 0, 0.0, 1.0)
    alone = lanes_bound(
        line_s=line, end_s=end, home_s=home, trip_s=np.array([212.0]), swap_s=np.array([7.0])
    )
    best = best_makespan(line, end, home, trip=np.array([212.0]), swap=np.array([7.0]))
    assert best == pytest.approx(6 * 210 + 5 * 7)
    assert 0.98 * best < alone.makespan_s <= best
    once = lanes_bound(line_s=line, end_s=end, home_s=home, trip_s=np.array([266.0]))
    assert once.makespan_s == pytest.approx(265.0, rel=0.01)

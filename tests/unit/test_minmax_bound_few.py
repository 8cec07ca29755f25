"""The bound for few lines is the best way to share them out, whatever they cost."""

from __future__ import annotations

import itertools

import numpy as np
import pytest

from mrmission.minmax.bounds.few_lines import few_lines_makespan
from mrmission.minmax.bounds.lanes import lanes_bound
from mrmission.minmax.problem import LaneProblem, tour_cost
from mrmission.model import FloatArray
from tests.best_tours import best_makespan


def _any_numbers(rng: np.random.Generator, lines: int, robots: int) -> tuple[FloatArray, ...]:
    """Seconds of lines, between ends and to homes that need not be distances."""
    end = rng.uniform(0, 40, (2 * lines, 2 * lines))
    return (
        rng.uniform(0, 50, lines),
        np.minimum(end, end.T),
        rng.uniform(0, 60, (robots, 2 * lines)),
    )


def _one_by_one(line: FloatArray, end: FloatArray, home: FloatArray) -> float:
    """The least makespan over all orders, directions, and places to part them."""
    lines, robots = len(line), len(home)
    problem = LaneProblem(lane_cost=line, end_cost=end, home_cost=home)
    best = np.inf
    for order in itertools.permutations(range(lines)):
        for flips in itertools.product((0, 1), repeat=lines):
            entries = np.array([2 * i + f for i, f in zip(order, flips, strict=True)])
            for cuts in itertools.combinations_with_replacement(range(lines + 1), robots - 1):
                borders = [0, *cuts, lines]
                tours = [entries[a:b] for a, b in itertools.pairwise(borders)]
                cost = max(tour_cost(problem, r, tour) for r, tour in enumerate(tours))
                best = min(best, cost)
    return best


def test_every_order_is_looked_at() -> None:
    rng = np.random.default_rng(3)
    for _ in range(12):
        lines, robots = int(rng.integers(1, 5)), int(rng.integers(1, 4))
        line, end, home = _any_numbers(rng, lines, robots)
        ones = np.ones(robots)
        found = few_lines_makespan(line, end, home, (ones, ones))
        assert found == pytest.approx(_one_by_one(line, end, home), rel=1e-12)


@pytest.mark.parametrize("alike", [True, False])
def test_it_is_the_optimum(alike: bool) -> None:
    rng = np.random.default_rng(5 + alike)
    in_trips = 0
    for _ in range(60):
        lines, robots = int(rng.integers(2, 7)), int(rng.integers(1, 5))
        line, end, home = _any_numbers(rng, lines, robots)
        sweep, travel, share = rng.uniform(0.5, 1.5, (3, robots))
        swap = rng.uniform(0, 20, robots)
        for numbers in (home, sweep, travel, share, swap):
            if alike:
                numbers[:] = numbers[0]
            elif robots > 2:  # two of a kind among others
                numbers[2] = numbers[0]
        own, scales = travel[:, None] * home, (sweep, travel)
        once = few_lines_makespan(line, end, own, scales)
        assert once == pytest.approx(best_makespan(line, end, home, sweep, travel), rel=1e-12)
        trip = 0.8 * share * once
        often = few_lines_makespan(line, end, own, scales, (trip, swap))
        told = best_makespan(line, end, home, sweep, travel, trip, swap)
        assert often == pytest.approx(told, rel=1e-12)
        in_trips += once < often < np.inf
    assert in_trips >= 8


def test_the_bound_of_few_lines_is_the_optimum_and_of_more_it_is_not() -> None:
    rng = np.random.default_rng(7)
    line, end, home = _any_numbers(rng, 9, 2)
    given = {"line_s": line, "end_s": end, "home_s": home}
    ones = np.ones(2)
    best = few_lines_makespan(line, end, home, (ones, ones))
    bound = lanes_bound(**given)
    assert bound.term == "every order"
    assert 0 < best - bound.makespan_s <= 1e-8 * best
    for lines, robots in ((19, 2), (60, 1), (700, 3)):
        line, end, home = _any_numbers(rng, lines, robots)
        ones = np.ones(robots)
        assert few_lines_makespan(line, end, home, (ones, ones)) == 0.0
        assert lanes_bound(line_s=line, end_s=end, home_s=home).term != "every order"


def test_robots_that_differ_are_looked_at_as_long_as_it_is_soon_done() -> None:
    rng = np.random.default_rng(8)
    line, end, home = _any_numbers(rng, 14, 2)
    alike = np.repeat(home[:1], 24, axis=0)
    unlike = rng.uniform(0, 60, (90, 28))
    for homes, looked_at in ((alike, True), (unlike, False)):
        ones = np.ones(len(homes))
        assert (few_lines_makespan(line, end, homes, (ones, ones)) > 0) == looked_at


def test_other_terms_are_asked_where_no_trips_reach_all_lines() -> None:
    # at the least that ways cost; what is planned takes longer, so that cannot be
    line, home = np.full(3, 10.0), np.full((1, 6), 100.0)
    bound = lanes_bound(line_s=line, end_s=np.zeros((6, 6)), home_s=home, trip_s=np.array([150.0]))
    assert bound.term != "every order"
    assert np.isfinite(bound.makespan_s)

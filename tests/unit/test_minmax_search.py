"""The lane planner: every lane once, prices right, never worse than it began, reproducible."""

from __future__ import annotations

from dataclasses import replace
from itertools import permutations, product

import numpy as np
import pytest

from mrmission.minmax.annealing import LAST_POWER, least_growth
from mrmission.minmax.problem import LaneProblem, tour_cost
from mrmission.minmax.search import AGAIN_POWER, FIRST_POWER, minmax
from mrmission.minmax.split import giant_tour, split_tour


def _problem(lanes: int, robots: int, seed: int) -> LaneProblem:
    rng = np.random.default_rng(seed)
    foot = rng.uniform(0, 100, (lanes, 2))
    ends = np.stack([foot, foot + rng.uniform(-30, 30, (lanes, 2))], axis=1).reshape(-1, 2)
    homes = rng.uniform(0, 100, (robots, 2))
    travel = np.hypot(*(ends[:, None] - ends[None]).transpose(2, 0, 1))
    return LaneProblem(
        lane_cost=np.hypot(*(ends[::2] - ends[1::2]).T),
        end_cost=travel,
        home_cost=np.hypot(*(homes[:, None] - ends[None]).transpose(2, 0, 1)),
    )


@pytest.mark.parametrize("seed", range(20))
def test_every_lane_once_and_the_price_is_the_price(seed: int) -> None:
    rng = np.random.default_rng(100 + seed)
    lanes, robots = int(rng.integers(1, 60)), int(rng.integers(1, 9))
    problem = _problem(lanes, robots, seed)
    first = minmax(problem, 0.0)
    tours = minmax(problem, 0.02, seed)
    swept = np.sort(np.concatenate(tours.entries) >> 1)
    assert swept.tolist() == list(range(lanes))
    for robot, entries in enumerate(tours.entries):
        assert tours.cost[robot] == pytest.approx(tour_cost(problem, robot, entries), rel=1e-9)
    assert tours.cost.max() <= first.cost.max() + 1e-9


@pytest.mark.parametrize("seed", range(6))
def test_no_robot_idles_while_another_has_two_lanes(seed: int) -> None:
    for lanes, robots in ((3, 8), (8, 8), (20, 7)):
        tours = minmax(_problem(lanes, robots, seed), 0.02, seed)
        sizes = [len(entries) for entries in tours.entries]
        assert min(sizes) > 0 or max(sizes) <= 1


def test_same_seed_same_answer_and_other_seeds_differ() -> None:
    problem = _problem(60, 4, 1)
    one, two = minmax(problem, 0.05, 7), minmax(problem, 0.05, 7)
    assert all(np.array_equal(a, b) for a, b in zip(one.entries, two.entries, strict=True))
    other = minmax(problem, 0.05, 8)
    assert any(
        len(a) != len(b) or not np.array_equal(a, b)
        for a, b in zip(one.entries, other.entries, strict=True)
    )


def _optimum(problem: LaneProblem) -> float:
    """Return the least makespan over all assignments that leave no robot idle."""
    lanes, robots = len(problem.lane_cost), len(problem.home_cost)
    single = {}
    for robot in range(robots):
        for mask in range(1 << lanes):
            members = [i for i in range(lanes) if mask >> i & 1]
            best = 0.0 if not members else np.inf
            for order in permutations(members):
                for turned in product((0, 1), repeat=len(members)):
                    if members:
                        entries = 2 * np.array(order) + np.array(turned)
                        best = min(best, tour_cost(problem, robot, entries))
            single[robot, mask] = best
    full = (1 << lanes) - 1
    reach = {0: 0.0}
    for robot in range(robots):
        new: dict[int, float] = {}
        for done, cost in reach.items():
            rest = full & ~done
            mask = rest
            while mask:
                value = max(cost, single[robot, mask])
                if value < new.get(done | mask, np.inf):
                    new[done | mask] = value
                mask = (mask - 1) & rest
        reach = new
    return reach[full]


@pytest.mark.parametrize("seed", range(8))
def test_small_cases_are_solved_to_the_optimum(seed: int) -> None:
    problem = _problem(5, 2, seed)
    found = min(minmax(problem, 0.05, s).cost.max() for s in range(3))
    assert found == pytest.approx(_optimum(problem), rel=1e-9)


@pytest.mark.parametrize("seed", range(5))
def test_the_first_split_is_as_even_as_that_order_allows(seed: int) -> None:
    problem = _problem(7, 3, seed)
    order = giant_tour(problem)
    homes = np.tile(problem.home_cost.mean(axis=0), (3, 1))
    even = LaneProblem(lane_cost=problem.lane_cost, end_cost=problem.end_cost, home_cost=homes)
    routes, sizes = split_tour(even, order)
    got = max(tour_cost(even, r, routes[r, : sizes[r]]) for r in range(3))
    cuts = [
        max(tour_cost(even, r, part) for r, part in enumerate(np.split(order, [a, b])))
        for a in range(8)
        for b in range(a, 8)
    ]
    assert got == pytest.approx(min(cuts), rel=1e-9)


def _of_kinds(lanes: int, robots: int, seed: int) -> LaneProblem:
    """Return a problem in which robots of three kinds find other lines and ways dear."""
    rng = np.random.default_rng(1000 + seed)
    plain = _problem(lanes, robots, seed)
    assert plain.end_cost is not None
    others = []
    for _ in range(2):
        lane_cost = plain.lane_cost * rng.uniform(0.4, 2.5, lanes)
        ways = plain.end_cost * rng.uniform(0.2, 3.0, plain.end_cost.shape)
        others.append((lane_cost, np.maximum(ways, ways.T)))
    return replace(
        plain, kinds=rng.integers(0, 3, robots), others=tuple(others),
        sweep_scale=rng.uniform(0.7, 1.4, robots), travel_scale=rng.uniform(0.7, 1.4, robots),
    )  # fmt: skip


@pytest.mark.parametrize("seed", range(12))
def test_what_lines_and_ways_cost_each_kind_of_robot_is_its_own(seed: int) -> None:
    rng = np.random.default_rng(seed)
    lanes, robots = int(rng.integers(2, 50)), int(rng.integers(2, 7))
    problem = _of_kinds(lanes, robots, seed)
    tours = minmax(problem, 0.05, seed)
    swept = np.sort(np.concatenate(tours.entries) >> 1)
    assert swept.tolist() == list(range(lanes))
    assert problem.kinds is not None
    for robot, entries in enumerate(tours.entries):
        kind = int(problem.kinds[robot])
        lane, ways = ((problem.lane_cost, problem.end_cost), *problem.others)[kind]
        assert ways is not None
        sweep, travel = problem.scales()
        seconds = sweep[robot] * lane[entries >> 1].sum()
        seconds += travel[robot] * ways[entries[:-1] ^ 1, entries[1:]].sum()
        if len(entries):
            seconds += problem.home_cost[robot, [entries[0], entries[-1] ^ 1]].sum()
        assert tours.cost[robot] == pytest.approx(seconds, rel=1e-9)


@pytest.mark.parametrize("seed", range(6))
def test_small_cases_of_unlike_robots_are_solved_to_the_optimum(seed: int) -> None:
    problem = replace(_of_kinds(5, 2, seed), kinds=np.array([seed % 3, (seed + 1) % 3]))
    found = min(minmax(problem, 0.1, s).cost.max() for s in range(3))
    assert found == pytest.approx(_optimum(problem), rel=1e-9)


@pytest.mark.parametrize("seed", range(4))
def test_robots_of_different_speed_share_by_speed(seed: int) -> None:
    plain = _problem(40, 3, seed)
    sweep, travel = np.array([1.0, 2.0, 1.5]), np.array([1.0, 3.0, 0.8])
    mixed = replace(plain, sweep_scale=sweep, travel_scale=travel)
    tours = minmax(mixed, 0.1, seed)
    for robot, entries in enumerate(tours.entries):
        own = entries >> 1
        gone = plain.end_cost[entries[:-1] ^ 1, entries[1:]].sum()  # type: ignore[index]
        home = plain.home_cost[robot, entries[0]] + plain.home_cost[robot, entries[-1] ^ 1]
        seconds = sweep[robot] * plain.lane_cost[own].sum() + travel[robot] * gone + home
        assert tours.cost[robot] == pytest.approx(seconds, rel=1e-9)
    swept = [plain.lane_cost[entries >> 1].sum() for entries in tours.entries]
    assert swept[0] > swept[1]
    assert tours.cost.max() < 1.1 * tours.cost.mean()


def test_a_search_goes_on_from_tours_and_never_to_worse_ones() -> None:
    problem = _problem(40, 3, 5)
    first = minmax(problem, 0.05, 0)
    more = minmax(problem, 0.05, 1, first)
    assert more.cost.max() <= first.cost.max() + 1e-9
    assert sorted(int(e) >> 1 for mine in more.entries for e in mine) == list(range(40))
    same = minmax(problem, 0.0, 1, first)
    assert [e.tolist() for e in same.entries] == [e.tolist() for e in first.entries]
    assert same.cost == pytest.approx(first.cost)


@pytest.mark.parametrize("power", [FIRST_POWER, 7.5, AGAIN_POWER, LAST_POWER])
@pytest.mark.parametrize("scale", [0.9, "little"])
def test_no_move_is_turned_down_that_its_power_would_allow(
    power: float, scale: float | str
) -> None:
    rng = np.random.default_rng(int(power))
    little = scale == "little"
    widest = 0.1 / power if little else float(scale)
    share = rng.uniform(-widest, widest, 2000)
    for old, u in zip(rng.uniform(0.2, 1.0, 2000), share, strict=True):
        energy = old**power
        grown = (old * (1.0 + u)) ** power - energy
        least = least_growth(old * u, 1.0 / old, energy, power)
        assert least <= grown + 1e-12 * max(abs(grown), energy)
        if little:  # and it says something
            assert least == pytest.approx(grown, rel=0.06)


def test_a_table_of_ways_holds_for_one_kind_of_robot() -> None:
    problem = _of_kinds(4, 2, 0)
    with pytest.raises(ValueError, match="one kind"):
        replace(problem, end_cost=None, sparse=object())

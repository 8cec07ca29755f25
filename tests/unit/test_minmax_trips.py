"""Tours cut into trips, against every way to cut them."""

from __future__ import annotations

from functools import cache
from itertools import pairwise, permutations, product

import numpy as np
import pytest

from mrmission.minmax.problem import LaneProblem
from mrmission.minmax.trips import (
    Allowance,
    Gauge,
    TooFarError,
    TripCutter,
    cut_line,
    may_hold,
    stretches_of,
    weighted,
)
from mrmission.model import CoveragePath, FloatArray, LegKind
from mrmission.options import PlanOptions, VehicleLimits
from mrmission.tour.path import join_pieces
from mrmission.tour.timing import TimeModel

TIME = TimeModel(survey_speed_m_s=2.0, transit_speed_m_s=3.0)
HOME = np.array([0.0, 0.0])


def straight_home(points_m: FloatArray) -> list[FloatArray]:
    return [np.array([HOME, point]) for point in points_m]


def tour(lines: list[FloatArray]) -> CoveragePath:
    """From home over the lines, in order and straight, and back."""
    pieces = [(np.array([HOME, lines[0][0]]), LegKind.TRANSIT, 0)]
    for i, line in enumerate(lines):
        if i:
            pieces.append((np.array([lines[i - 1][-1], line[0]]), LegKind.TRANSIT, 0))
        pieces.append((line, LegKind.SURVEY, i + 1))
    pieces.append((np.array([lines[-1][-1], HOME]), LegKind.TRANSIT, 0))
    return join_pieces(1, pieces)


def random_lines(rng: np.random.Generator, count: int) -> list[FloatArray]:
    return [
        np.array([(x, y), (x + rng.uniform(-20, 20), y + rng.uniform(60, 200))])
        for x, y in rng.uniform(-400, 400, (count, 2))
    ]


def gauge(seconds: float = np.inf, metres: float = np.inf, items: float = np.inf) -> Gauge:
    return Gauge(
        allowance=Allowance(seconds=seconds, metres=metres, items=items),
        time=TIME,
        options=PlanOptions(survey_speed_m_s=2.0, transit_speed_m_s=3.0),
    )


def fewest_by_hand(lines: list[FloatArray], measure: Gauge) -> tuple[int, float]:
    """The least number of trips that cut the order of the lines, and their least longest one."""

    def used(i: int, j: int) -> float:
        return measure.used(tour(lines[i:j]))

    @cache
    def best(i: int) -> tuple[int, float]:
        if i == len(lines):
            return 0, 0.0
        options = []
        for j in range(i + 1, len(lines) + 1):
            share = used(i, j)
            if share <= 1.0:
                trips, worst = best(j)
                options.append((trips + 1, max(share, worst)))
        return min(options, default=(999, np.inf))

    return best(0)


@pytest.mark.parametrize("seed", range(12))
def test_the_fewest_trips_and_of_these_the_shortest_longest(seed: int) -> None:
    rng = np.random.default_rng(seed)
    lines = random_lines(rng, 9)
    alone = max(gauge(seconds=1.0).used(tour([line])) for line in lines)
    measure = gauge(seconds=alone * rng.uniform(1.02, 2.5))
    cutter = TripCutter(tour(lines), straight_home, measure)
    borders = cutter.balanced()
    trips, longest = fewest_by_hand(lines, measure)
    assert len(borders) - 1 == trips
    found = max(cutter.used(a, b) for a, b in pairwise(borders))
    assert found == pytest.approx(longest, rel=2e-3)
    # finer pieces may save a trip, never cost one
    paths = cutter.trips()
    assert len(paths) <= trips
    assert all(measure.used(path) <= 1.0 for path in paths)
    swept = sum(
        float(np.hypot(*np.diff(line, axis=0).T).sum())
        for path in paths
        for line in stretches_of(path).lines_m
    )
    assert swept == pytest.approx(sum(float(np.hypot(*(b - a))) for a, b in lines))


def test_all_three_measures_bind() -> None:
    lines = random_lines(np.random.default_rng(3), 8)
    whole = tour(lines)
    for limit in ("seconds", "metres", "items"):
        alone = max(gauge(**{limit: 1.0}).used(tour([line])) for line in lines)
        measure = gauge(**{limit: 1.5 * alone})
        paths = TripCutter(whole, straight_home, measure).trips()
        assert len(paths) > 1
        assert max(measure.used(path) for path in paths) <= 1.0
        assert measure.used(whole) > 1.0


@pytest.mark.parametrize("items", [9, 20, 55])
def test_of_many_lines_some_ways_home_do(monkeypatch: pytest.MonkeyPatch, items: int) -> None:
    lines = random_lines(np.random.default_rng(5), 60)
    measure = gauge(items=float(items))
    asked: list[int] = []

    def ways(points_m: FloatArray) -> list[FloatArray]:
        asked.append(len(points_m))
        return straight_home(points_m)

    exact = TripCutter(tour(lines), straight_home, measure).trips()
    monkeypatch.setattr("mrmission.minmax.trips.BORDERS", 15)
    paths = TripCutter(tour(lines), ways, measure).trips()
    assert asked[0] == 30  # of 120
    assert max(measure.used(path) for path in paths) <= 1.0
    swept = [line.tolist() for path in paths for line in stretches_of(path).lines_m]
    assert swept == [line.tolist() for line in lines]
    if items == 9:  # a trip holds fewer than lie between borders: all are looked at
        assert len(paths) == len(exact)
    assert len(exact) <= len(paths) <= 1.5 * len(exact) + 1


@pytest.mark.parametrize("transit_m_s", [2.0, 3.0])
def test_items_of_a_trip_are_those_of_its_path(transit_m_s: float) -> None:
    rng = np.random.default_rng(11)
    options = PlanOptions(survey_speed_m_s=2.0, transit_speed_m_s=transit_m_s)
    measure = Gauge(allowance=Allowance(items=7.0), time=TIME, options=options)
    grid = rng.integers(-3, 4, (40, 2)).astype(float)  # many legs go straight on, some meet
    lines = [grid[i : i + n] for i, n in zip(range(0, 36, 3), [2, 3, 4, 2] * 3, strict=True)]
    lines = [line for line in lines if np.any(line[1:] != line[:-1])]

    def ways(points_m: FloatArray) -> list[FloatArray]:
        return [np.array([HOME, 0.5 * p, [p[0], 0.0], p]) for p in points_m]

    cutter = TripCutter(tour(lines), ways, measure, 1e9)
    pairs = [(a, b) for a in range(len(cutter)) for b in range(a + 1, len(cutter) + 1)]
    assert measure.counts_turns
    assert [cutter.used(a, b) for a, b in pairs] == [
        measure.used(cutter.trip(a, b)) for a, b in pairs
    ]


def test_a_line_longer_than_a_trip_is_cut() -> None:
    line = np.array([[100.0, -2000.0], [100.0, 2000.0]])
    measure = gauge(metres=4800.0)
    paths = TripCutter(tour([line]), straight_home, measure).trips()
    assert max(measure.used(path) for path in paths) <= 1.0
    # 4,000 m of line beyond the ways; half of it at a time is 2,000 + 2,000 + a little: two trips
    assert len(paths) == 2
    ends = sorted(stretches_of(path).lines_m[0][:, 1].tolist() for path in paths)
    assert ends[0][0] == -2000.0
    assert ends[-1][-1] == 2000.0


def test_a_place_that_is_too_far_is_named() -> None:
    line = np.array([[0.0, 900.0], [0.0, 1100.0]])
    with pytest.raises(TooFarError) as caught:
        TripCutter(tour([line]), straight_home, gauge(metres=1900.0))
    assert caught.value.place_m[1] > 940.0
    assert caught.value.trip.robot == 1


def test_at_least_two() -> None:
    lines = random_lines(np.random.default_rng(5), 6)
    measure = gauge(seconds=1e6)
    assert len(TripCutter(tour(lines), straight_home, measure).trips()) == 1
    assert len(TripCutter(tour(lines), straight_home, measure).trips(2)) == 2
    assert len(TripCutter(tour(lines[:1]), straight_home, measure).trips(2)) == 2


def test_a_robot_without_work_keeps_its_path() -> None:
    idle = CoveragePath(
        robot=2,
        points_m=HOME[None],
        kind=np.zeros(0, dtype=np.int8),
        lane=np.zeros(0, dtype=np.int64),
    )
    assert TripCutter(idle, straight_home, gauge(seconds=1.0)).trips() == [idle]


def test_cutting_a_bent_line_keeps_its_corners() -> None:
    line = np.array([[0.0, 0.0], [30.0, 0.0], [30.0, 30.0], [0.0, 30.0]])
    for count in range(1, 12):
        pieces = cut_line(line, count)
        assert len(pieces) == count
        lengths = [np.hypot(*np.diff(piece, axis=0).T).sum() for piece in pieces]
        assert lengths == pytest.approx([90.0 / count] * count)
        joined = np.vstack([pieces[0], *(piece[1:] for piece in pieces[1:])])
        for corner in line:
            assert np.hypot(*(joined - corner).T).min() < 1e-9


def test_the_reserve_is_kept() -> None:
    options = PlanOptions(endurance_s=3600.0, limits=VehicleLimits(mission_items=99))
    assert Allowance.of(options) == Allowance(seconds=2880.0, items=99.0)
    assert not Allowance.of(options).endless
    by_way = PlanOptions(endurance_m=1000.0, reserve=0.1)
    assert Allowance.of(by_way).metres == pytest.approx(900.0)
    assert Allowance.of(PlanOptions()).endless


@pytest.mark.parametrize("seed", range(30))
def test_what_surely_is_too_little_is(seed: int) -> None:
    """Wherever lines do fit into trips of given lengths, the bound does not deny it."""
    rng = np.random.default_rng(seed)
    lines = random_lines(rng, 4)
    length = np.array([np.hypot(*(b - a)) for a, b in lines])
    # along a straight line from a convex home, the nearest place
    reach = np.array(
        [min(np.hypot(*(a + s * (b - a))) for s in np.linspace(0, 1, 201)) for a, b in lines]
    )
    trips: list[float] = []
    for group in (lines[:2], lines[2:]):
        best = np.inf
        for order in permutations(group):
            for turn in product((1, -1), repeat=len(order)):
                way = tour([line[::t] for line, t in zip(order, turn, strict=True)])
                best = min(best, float(np.hypot(*np.diff(way.points_m, axis=0).T).sum()))
        trips.append(best)
    assert may_hold(length, reach - 1.0, trips)
    assert not may_hold(length, reach, [0.2 * trip for trip in trips])


def test_weights_scale_what_a_robot_pays() -> None:
    problem = LaneProblem(
        lane_cost=np.ones(2),
        home_cost=np.ones((2, 4)),
        end_cost=np.zeros((4, 4)),
        sweep_scale=np.array([1.0, 2.0]),
    )
    assert weighted(problem, None) is problem
    heavy = weighted(problem, np.array([[1.0, 1.0], [3.0, 5.0]]))
    sweep, travel = heavy.scales()
    assert sweep.tolist() == [1.0, 6.0]
    assert travel.tolist() == [1.0, 5.0]
    assert heavy.home_cost[1].tolist() == [5.0] * 4

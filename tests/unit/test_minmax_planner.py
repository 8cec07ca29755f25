"""The lane planner of a part: its seconds are those of the paths, and what it leaves is little."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import shapely
from lakes import random_lake_m
from part_works import in_a_row, part_work

from mrmission.minmax import planner, travel
from mrmission.minmax.costs import line_costs
from mrmission.minmax.hooks import find_hooks, no_hooks
from mrmission.minmax.least import least_costs
from mrmission.minmax.runs import part_costs
from mrmission.minmax.search import minmax, tour_cost
from mrmission.model import FloatArray, IntArray
from mrmission.options import PlanOptions
from mrmission.tour.coverage import total_area
from mrmission.tour.flight import time_model
from mrmission.tour.lines import SurveyLine, ends_of
from mrmission.tour.repair import fleet_legs, pieces_to_repair
from mrmission.tour.timing import TimeModel
from mrmission.tour.work import PartWork


def _work(seed: int, robots: int = 3, **options: object) -> PartWork:
    rng = np.random.default_rng(seed)
    lake = random_lake_m(rng, 900.0, 2)
    asked = PlanOptions(
        robots=robots, swath_m=25.0, overlap=0.0, clearance_m=0.0, method="minmax",
        time_budget_s=0.1, seed=seed, **options,
    )  # fmt: skip
    bearing_deg = float(rng.uniform(0, 180))
    homes = in_a_row(lake, robots)
    return part_work(lake, homes, asked, spacing_m=24.9, bearing_deg=bearing_deg)


@pytest.mark.parametrize("seed", range(4))
@pytest.mark.parametrize("steering", ["steered", "pivoting"])
def test_the_search_predicts_the_seconds_of_the_paths(seed: int, steering: str) -> None:
    work = _work(seed, steering=steering)
    hooks, extra = find_hooks(work)
    lines = work.lines + extra
    costs = line_costs(lines, hooks, work.harbour, work.homes_m, work.times, lanes_alone=False)
    bounded = least_costs(
        lines, hooks, work.harbour, work.homes_m, work.times, costs.metres, lanes_alone=False
    )
    tours = minmax(costs.problem, 0.1, seed)
    paths = planner.tour_paths(work.harbour, lines, hooks, tours.entries, lanes_alone=False)
    for robot, path in enumerate(paths):
        told = tour_cost(costs.problem, robot, tours.entries[robot])
        assert told == pytest.approx(work.time.duration_s(path.points_m, path.kind), rel=0.01)
        least = tour_cost(bounded, robot, tours.entries[robot])
        assert least <= work.time.duration_s(path.points_m, path.kind) + 1e-6


@pytest.mark.parametrize("seed", range(4))
def test_costs_are_symmetric_and_none_is_negative(seed: int) -> None:
    work = _work(seed)
    hooks, extra = find_hooks(work)
    told = (work.lines + extra, hooks, work.harbour, work.homes_m, work.times)
    costs = line_costs(*told, lanes_alone=False)
    least = least_costs(*told, costs.metres, lanes_alone=False)
    for problem in (costs.problem, least):
        assert np.array_equal(problem.end_cost, problem.end_cost.T)
        assert problem.end_cost.min() >= 0
        assert problem.home_cost.min() >= 0
    assert (least.end_cost <= costs.problem.end_cost + 1e-9).all()
    assert (least.home_cost <= costs.problem.home_cost + 1e-9).all()
    assert costs.problem.home_cost.shape == (3, 2 * len(work.lines + extra))


@pytest.mark.parametrize("alone", [False, True])
@pytest.mark.parametrize("seed", range(3))
def test_little_is_left_for_repair_and_nobody_leaves_the_water(seed: int, alone: bool) -> None:
    work = _work(seed, **({"trigger_distance_m": 10.0} if alone else {}))
    assert work.options.lanes_alone_count is alone
    tours = planner.lane_tours(work)
    before = work.uncovered.remainder(
        work.sweep.frame.to_sweep(np.array([line.points_m for line in work.lines]))
    )
    legs = fleet_legs(tours.paths, work.sweep.frame, lanes_alone=alone)
    after = work.uncovered.remainder(legs)
    todo = pieces_to_repair(before, 25.0, work.region_m.area)
    left = pieces_to_repair(after, 25.0, work.region_m.area)
    assert total_area(left) < 0.05 * total_area(todo)
    wet = shapely.buffer(work.region_m, 0.01)
    for path, home in zip(tours.paths, work.homes_m, strict=True):
        assert wet.covers(shapely.LineString(path.points_m))
        assert np.array_equal(path.points_m[0], home)
        assert np.array_equal(path.points_m[-1], home)


def test_every_line_is_swept_once() -> None:
    work = _work(7, robots=2)
    paths = planner.lane_tours(work).paths
    swept = sum(
        float(np.hypot(*np.diff(p.points_m, axis=0).T)[np.asarray(p.lane) > 0].sum()) for p in paths
    )
    _, extra = find_hooks(work)
    wanted = sum(line.length_m for line in work.lines + extra)
    assert swept == pytest.approx(wanted, abs=0.01)


def test_more_lines_than_a_matrix_holds_are_planned_as_well(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    work = _work(3)
    dense = planner.lane_tours(work)
    monkeypatch.setattr(planner, "DENSE_ENDS", 10)
    tours = planner.lane_tours(work)
    bounds = [t.lanes_bound() for t in (dense, tours) if t.lanes_bound is not None]
    monkeypatch.setattr(planner, "LISTED_ENDS", 10)
    far = planner.lane_tours(work).lanes_bound
    bounds += [far()] if far is not None else []
    assert [bound.term.endswith("as the crow flies") for bound in bounds] == [False, False, True]
    longest, other = (
        max(work.time.duration_s(p.points_m, p.kind) for p in t.paths) for t in (tours, dense)
    )
    assert max(bound.makespan_s for bound in bounds) <= min(longest, other)
    assert bounds[1].makespan_s == pytest.approx(bounds[0].makespan_s, rel=0.01)
    assert bounds[1].makespan_s > 1.01 * bounds[2].makespan_s
    assert longest < 1.1 * other
    wanted = sum(line.length_m for line in work.lines + find_hooks(work)[1])
    swept = sum(
        float(np.hypot(*np.diff(p.points_m, axis=0).T)[np.asarray(p.lane) > 0].sum())
        for p in tours.paths
    )
    assert swept == pytest.approx(wanted, abs=0.01)


@pytest.mark.parametrize("seed", range(4))
def test_no_path_takes_less_than_what_is_known_of_its_ways(
    seed: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    work = _work(seed, robots=2)
    lines = work.lines
    ends = ends_of(lines).reshape(-1, 2)
    monkeypatch.setattr(travel, "TABLE", 6)
    arrays = travel.travel_between(work.harbour, ends, dense_ends=0).arrays
    assert arrays is not None
    metres, exact = travel.floors_m(arrays, np.arange(len(ends)))
    assert exact.mean() < 0.5
    least = least_costs(
        lines, no_hooks(len(ends)), work.harbour, work.homes_m, work.times, metres,
        lanes_alone=False, exact=exact,
    )  # fmt: skip
    told = []
    rng = np.random.default_rng(seed)
    for _ in range(100):
        order = 2 * rng.permutation(len(lines)) + rng.integers(0, 2, len(lines))
        entries = (order[:3], order[3:6])  # few lines, so that ways are most of the tour
        paths = planner.tour_paths(
            work.harbour, lines, no_hooks(len(ends)), entries, lanes_alone=False
        )
        for robot, path in enumerate(paths):
            took_s = work.time.duration_s(path.points_m, path.kind)
            told.append(tour_cost(least, robot, entries[robot]) / took_s)
    assert 0.95 < np.mean(told) < max(told) <= 1 + 1e-9


def test_ways_between_ends_that_were_slid_are_found_again(monkeypatch: pytest.MonkeyPatch) -> None:
    work = _work(3, robots=5)
    found: list[tuple[FloatArray, FloatArray | None]] = []
    metres_of = planner._metres_of

    def watched(
        swept: tuple[SurveyLine, ...], ends: IntArray, ready: planner.Prepared
    ) -> FloatArray | None:
        found.append((ends_of(swept).reshape(-1, 2), metres_of(swept, ends, ready)))
        return found[-1][1]

    monkeypatch.setattr(planner, "_metres_of", watched)
    whole = planner.lane_tours(work).lanes_bound
    monkeypatch.setattr(planner, "MANY_ENDS", 0)
    parts = planner.lane_tours(work).lanes_bound
    (_, none), (ends_m, metres) = found
    assert none is None
    assert metres is not None
    np.testing.assert_allclose(metres, work.harbour.distance_matrix(ends_m), atol=1e-9)
    np.testing.assert_array_equal(metres, metres.T)
    assert whole is not None
    assert parts is not None
    assert parts().makespan_s == pytest.approx(whole().makespan_s, rel=2e-3)


def test_a_slower_robot_gets_less() -> None:
    work = _work(5, robots=2)
    slow = time_model(replace(work.options, survey_speed_m_s=1.0, transit_speed_m_s=1.0))
    mixed = replace(work, times=(work.times[0], slow))
    paths = planner.lane_tours(mixed).paths
    seconds = [t.duration_s(p.points_m, p.kind) for t, p in zip(mixed.times, paths, strict=True)]
    metres = [float(np.hypot(*np.diff(p.points_m, axis=0).T).sum()) for p in paths]
    assert max(seconds) < 1.15 * min(seconds)
    assert metres[1] < 0.7 * metres[0]


def _unlike(work: PartWork) -> tuple[TimeModel, ...]:
    """Return how long a boat that pivots takes, one with a rudder, and a fast one with a rudder."""
    asked = work.options
    fast = replace(asked, survey_speed_m_s=3.0, transit_speed_m_s=3.0)
    return time_model(replace(asked, steering="pivoting")), time_model(asked), time_model(fast)


@pytest.mark.parametrize("seed", range(4))
def test_the_search_predicts_the_seconds_of_unlike_robots(seed: int) -> None:
    work = _work(seed)
    work = replace(work, times=_unlike(work))
    hooks, extra = find_hooks(work)
    lines = work.lines + extra
    costs = line_costs(lines, hooks, work.harbour, work.homes_m, work.times, lanes_alone=False)
    tours = minmax(costs.problem, 0.1, seed)
    paths = planner.tour_paths(work.harbour, lines, hooks, tours.entries, lanes_alone=False)
    for robot, (path, time) in enumerate(zip(paths, work.times, strict=True)):
        told = tour_cost(costs.problem, robot, tours.entries[robot])
        assert told == pytest.approx(time.duration_s(path.points_m, path.kind), rel=0.01)


@pytest.mark.parametrize("seed", [0, 6, 7])
def test_the_order_of_unlike_robots_matters_little(seed: int) -> None:
    # all priced as the first: 4 to 7 % apart
    work = _work(seed)
    pivoting, steered, _ = _unlike(work)
    makespan_s = []
    for place in range(3):
        times = tuple(pivoting if robot == place else steered for robot in range(3))
        paths = planner.lane_tours(replace(work, times=times)).paths
        took = [t.duration_s(p.points_m, p.kind) for t, p in zip(times, paths, strict=True)]
        assert max(took) < 1.03 * np.mean(took)
        makespan_s.append(max(took))
    assert max(makespan_s) < 1.02 * min(makespan_s)


def test_of_too_many_kinds_the_nearest_stands_for_those_left_out(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    work = _work(1, robots=4)
    pivoting, steered, fast = _unlike(work)
    work = replace(work, times=(pivoting, steered, fast, steered))
    monkeypatch.setattr("mrmission.minmax.costs.MOST_KINDS", 2)
    problem = planner.prepare(work).problem
    assert problem.kinds is not None
    assert problem.kinds.tolist() == [0, 1, 1, 1]  # a fast boat turns as a steered one does
    monkeypatch.setattr("mrmission.minmax.costs.MOST_NUMBERS", 1000)
    problem = planner.prepare(work).problem
    assert problem.kinds is None
    assert not problem.others
    swept = [len(entries) for entries in minmax(problem, 0.05, 1).entries]
    assert min(swept) > 0


def test_runs_cost_each_robot_its_own_seconds() -> None:
    work = _work(1, robots=2, vehicle="copter", run_in_m=20.0, run_out_m=10.0)
    asked = work.options
    slow = time_model(replace(asked, survey_speed_m_s=4.0, transit_speed_m_s=2.0))
    work = replace(work, times=(time_model(asked), slow))
    lines = work.lines
    problem = part_costs(lines, no_hooks(2 * len(lines)), work).problem
    sweep, _ = problem.scales()
    for robot, time in enumerate(work.times):
        own_s = sweep[robot] * problem.lanes_of(problem.kind_of(robot))
        alone = line_costs(
            lines, no_hooks(2 * len(lines)), work.harbour, work.homes_m[:1], (time,),
            lanes_alone=asked.lanes_alone_count,
        )  # fmt: skip
        runs_s = 30.0 / time.transit_speed_m_s
        assert own_s == pytest.approx(alone.problem.lane_cost + runs_s)


@pytest.mark.parametrize("wide", [(0,), (1,), (0, 1)])
def test_what_lanes_leave_is_looked_for_unless_nobody_turns_on_the_spot(
    wide: tuple[int, ...],
) -> None:
    work = _work(2, robots=2)
    arcs = time_model(replace(work.options, turn_radius_m=15.0))
    times = tuple(arcs if robot in wide else work.times[robot] for robot in range(2))
    ready = planner.prepare(replace(work, times=times))
    assert (len(ready.hooks) > 0) == (len(wide) < 2)


class _Late(TimeModel):
    """A robot whose paths take longer than anybody priced."""

    LATE_S = 200.0

    def duration_s(self, points_m: FloatArray, kind: np.ndarray) -> float:
        return super().duration_s(points_m, kind) + self.LATE_S


def test_what_a_path_takes_more_than_it_was_priced_at_is_shared_out() -> None:
    work = replace(_work(3), options=replace(_work(3).options, time_budget_s=1.0))
    time = work.times[0]
    late = _Late(
        survey_speed_m_s=time.survey_speed_m_s, transit_speed_m_s=time.transit_speed_m_s,
        steering=time.steering, radius_m=time.radius_m, swath_m=time.swath_m,
    )  # fmt: skip

    def took_s(times: tuple[TimeModel, ...]) -> list[float]:
        paths = planner.lane_tours(replace(work, times=times)).paths
        return [t.duration_s(p.points_m, p.kind) for p, t in zip(paths, times, strict=True)]

    plain, others = took_s(work.times), took_s((late, *work.times[1:]))
    assert max(others) - max(plain) < 0.75 * late.LATE_S  # all bear it, not the first alone
    assert max(others) - min(others) < 0.4 * late.LATE_S


def test_tours_that_a_short_search_began_with_are_kept_where_they_are_better() -> None:
    work = _work(5, robots=6)
    ready = planner.prepare(work)
    long_ago = minmax(ready.problem, 0.5, 3)

    def makespan_s(prepared: planner.Prepared) -> float:
        # without budget the search gives the tours that it starts with
        found = planner.one_start(prepared, 0.0, 3)
        longest_s = max(
            work.time.duration_s(path.points_m, path.kind) for path in found.planned.paths
        )
        assert found.longest_s == longest_s
        return longest_s

    without = makespan_s(ready)
    assert makespan_s(replace(ready, begun=long_ago)) < 0.99 * without
    worse = minmax(ready.problem, 0.0, 3)
    assert makespan_s(replace(ready, begun=worse)) == without

"""What lines and ways take at least is never more than what a path takes that is laid over them.

Every order and direction of few lines is laid, made gentle as an exported path is, and timed.
"""

from __future__ import annotations

from itertools import permutations, product
from typing import Any

import numpy as np
import pytest
import shapely

from mrmission.minmax import costs as costs_module
from mrmission.minmax.bounds.lanes import lanes_bound
from mrmission.minmax.hooks import Hooks, no_hooks
from mrmission.minmax.least import least_costs
from mrmission.minmax.problem import LaneProblem, tour_cost
from mrmission.model import FloatArray
from mrmission.routing.berth_water import BerthWater
from mrmission.routing.harbour import Harbour
from mrmission.tour.flight import FlightTimeModel
from mrmission.tour.lines import SurveyLine
from mrmission.tour.path import assemble_paths
from mrmission.tour.reversals import avoid_reversals
from mrmission.tour.timing import TimeModel
from mrmission.tour.turnaround import with_turnarounds

SIDE_M = 200.0


def _any_lines(rng: np.random.Generator, count: int) -> list[FloatArray]:
    foot = rng.uniform(20, 180, (count, 2))
    tip = np.clip(foot + rng.uniform(-60, 60, (count, 2)), 5, 195)
    return [np.array(ends) for ends in zip(foot, tip, strict=True)]


def _short_lines(rng: np.random.Generator, count: int) -> list[FloatArray]:
    x = 60 + rng.uniform(4, 22) * np.arange(count)
    length = rng.uniform(4, 30)
    return [np.array([[a, 80.0], [a, 80.0 + length]]) for a in x]


def _bent_lines(rng: np.random.Generator, count: int) -> list[FloatArray]:
    return [
        np.clip(rng.uniform(30, 170, 2) + rng.uniform(-30, 30, (4, 2)).cumsum(axis=0), 2, 198)
        for _ in range(count)
    ]


LINES = {"any": _any_lines, "short": _short_lines, "bent": _bent_lines}


def _boat(rng: np.random.Generator, swath_m: float, faster: tuple[float, ...]) -> TimeModel:
    speed = float(rng.choice([1.0, 2.0, 3.0, 5.0]))
    return TimeModel(
        survey_speed_m_s=speed,
        transit_speed_m_s=speed * float(rng.choice(faster)),
        steering=str(rng.choice(["steered", "pivoting"])),
        radius_m=float(rng.choice([1.0, 2.0])),
        swath_m=swath_m,
    )


def _copter(rng: np.random.Generator, swath_m: float, faster: tuple[float, ...]) -> TimeModel:
    speed = float(rng.choice([3.0, 5.0, 10.0]))
    return FlightTimeModel(
        survey_speed_m_s=speed, transit_speed_m_s=speed * float(rng.choice(faster)),
        swath_m=swath_m,
    )  # fmt: skip


def _orders(count: int) -> list[list[int]]:
    return [
        [2 * line + side for line, side in zip(order, sides, strict=True)]
        for order in permutations(range(count))
        for sides in product((0, 1), repeat=count)
    ]


@pytest.mark.parametrize("vehicle", [_boat, _copter])
@pytest.mark.parametrize("kind", list(LINES))
@pytest.mark.parametrize("faster", [(1.0,), (0.5, 2.0, 3.0)])
@pytest.mark.parametrize("runs_m", [0.0, 6.0])
def test_no_path_takes_less(
    vehicle: Any, kind: str, faster: tuple[float, ...], runs_m: float,
    monkeypatch: pytest.MonkeyPatch,
) -> None:  # fmt: skip
    rng = np.random.default_rng(5)
    tight = []
    for case in range(8):
        swath_m = float(rng.choice([5.0, 10.0, 20.0, 40.0]))
        times = tuple(vehicle(rng, swath_m, faster) for _ in range(2))
        homes = np.repeat(rng.uniform(60, 140, (1, 2)), 2, axis=0)
        lines = tuple(
            SurveyLine(points_m=points)
            for points in LINES[kind](rng, int(rng.integers(1, 4 if case % 8 else 5)))
        )
        water = shapely.box(0, 0, SIDE_M, SIDE_M)
        harbour = Harbour(water, homes[:1]).shared([0, 0])
        ends = np.array([line.ends_m for line in lines]).reshape(-1, 2)
        monkeypatch.setattr(costs_module, "NEAR", 2 if case % 3 == 0 else 12)
        least = least_costs(
            lines, no_hooks(len(ends)), harbour, homes, times, harbour.distance_matrix(ends),
            lanes_alone=False, runs=runs_m > 0,
        )  # fmt: skip
        berth = BerthWater(harbour, 0)
        best = [np.inf, np.inf]
        for entries in _orders(len(lines)):
            (laid, _) = assemble_paths(harbour, [[lines[e >> 1].way(e & 1) for e in entries], []])
            for robot, time in enumerate(times):
                path = laid
                if runs_m > 0:
                    path = with_turnarounds(path, 0.0, water, runs_m)
                takes = time.duration_s(path.points_m, path.kind)
                if time.steering == "steered" and vehicle is _boat:
                    gentle = avoid_reversals(path, berth, time, 0.0)
                    takes = min(takes, time.duration_s(gentle.points_m, gentle.kind))
                told = tour_cost(least, robot, np.array(entries))
                assert told <= takes + 1e-6, f"case {case}, robot {robot}, order {entries}"
                best[robot] = min(best[robot], takes)
        assert least.end_cost is not None
        assert least.sweep_scale is not None
        assert least.travel_scale is not None
        bound = lanes_bound(
            line_s=least.lane_cost, end_s=least.end_cost, home_s=least.home_cost[:1],
            sweep_scale=least.sweep_scale[:1], travel_scale=least.travel_scale[:1],
        )  # fmt: skip
        assert bound.makespan_s <= best[0] * (1 + 1e-9)
        tight.append(bound.makespan_s / best[0])
    assert np.mean(tight) > 0.5


def _least(lines: tuple[SurveyLine, ...], time: TimeModel, home: FloatArray) -> LaneProblem:
    harbour = Harbour(shapely.box(-300, -300, 1500, 1500), home)
    ends = np.array([line.ends_m for line in lines]).reshape(-1, 2)
    return least_costs(
        lines, no_hooks(len(ends)), harbour, home, (time,), harbour.distance_matrix(ends),
        lanes_alone=False,
    )  # fmt: skip


def test_a_way_counts_in_the_direction_in_which_it_takes_less() -> None:
    # speed is lost at the corner that can gain by it in one direction, gained there in the other
    a, b = np.array([0.0, 0.0]), np.array([7.0, 24.0])
    out, into = np.array([-0.48, 0.877]), np.array([0.69, -0.725])
    lines = (
        SurveyLine(points_m=np.array([a - 200 * out, a])),
        SurveyLine(points_m=np.array([b, b + 200 * into])),
    )
    time = TimeModel(survey_speed_m_s=2.0, transit_speed_m_s=4.0, radius_m=2.0, swath_m=20.0)
    least = _least(lines, time, np.array([[50.0, -50.0]])).end_cost
    turned = _least(lines[::-1], time, np.array([[50.0, -50.0]])).end_cost
    assert least is not None
    assert turned is not None
    points = np.array([lines[0].points_m[0], a, b, lines[1].points_m[1]])
    kind = np.array([1, 0, 1], dtype=np.int8)
    way_s = time.legs_s(points, kind)[1]
    there, back = (way_s + time.corners_s(p, kind).sum() for p in (points, points[::-1]))
    assert abs(there - back) > 1.0
    assert least[1, 2] == pytest.approx(min(there, back))
    assert turned[0, 3] == pytest.approx(min(there, back))


@pytest.mark.parametrize(("leg_m", "radius_m"), [(20.0, 1.0), (12.0, 2.0)])
def test_corners_inside_a_line_may_gain(leg_m: float, radius_m: float) -> None:
    steps = leg_m * np.array([(1.0, 0.0), (0.0, 1.0)] * 20)
    line = SurveyLine(points_m=np.vstack([[0.0, 0.0], steps.cumsum(axis=0)]))
    home = np.array([[-5.0, 0.0]])
    time = TimeModel(survey_speed_m_s=2.0, transit_speed_m_s=2.0, radius_m=radius_m, swath_m=20.0)
    harbour = Harbour(shapely.box(-300, -300, 1500, 1500), home)
    least = _least((line,), time, home)
    for entry in (0, 1):
        (path,) = assemble_paths(harbour, [[line.way(entry)]])
        takes = time.duration_s(path.points_m, path.kind)
        assert tour_cost(least, 0, np.array([entry])) <= takes + 1e-6


def test_robots_that_are_alike_lose_nothing_for_lanes_side_by_side() -> None:
    # three lanes with long legs between them: corners of 90 degrees are counted as they are
    lines = tuple(SurveyLine(points_m=np.array([[x, 0.0], [x, 150.0]])) for x in (0.0, 45.0, 90.0))
    time = TimeModel(survey_speed_m_s=2.0, transit_speed_m_s=2.0, steering="pivoting", swath_m=45.0)
    least = _least(lines, time, np.array([[-5.0, 0.0]])).end_cost
    assert least is not None
    corner = np.interp(90.0, time.survey.angle_deg, time.survey.corner_s)
    assert least[1, 3] == pytest.approx(45.0 / 2.0 + 2 * corner)


def test_hooks_of_some_ends() -> None:
    hooks = Hooks(
        of_end=np.array([0, 1, 1, 3, 4]),
        point_start=np.array([0, 1, 3, 4, 6]),
        points_m=np.arange(12.0).reshape(-1, 2),
        hull_start=np.array([0, 3, 6, 9, 12]),
        hull_m=np.arange(24.0).reshape(-1, 2),
        reach_m=3.0,
    )
    some = hooks.of_ends(np.array([3, 1, 2]))
    assert some.of_end.tolist() == [0, 1, 1, 3]
    assert some.point_start.tolist() == [0, 2, 4, 5]
    assert some.points_m[:, 0].tolist() == [8.0, 10.0, 2.0, 4.0, 6.0]
    assert some.hull_m[:3].tolist() == hooks.hull_m[9:12].tolist()
    assert len(hooks.of_ends(np.zeros(0, dtype=np.int64))) == 0

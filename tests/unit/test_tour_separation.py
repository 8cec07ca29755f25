"""Separation, against dense sampling of both time lines and against every launch there is."""

from __future__ import annotations

import math
from itertools import product

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from mrmission.model import CoveragePath, FloatArray, LegKind
from mrmission.tour.separation import (
    SeparationRules,
    Timeline,
    course_of,
    measure,
    reversed_path,
    separate,
    timeline,
)
from mrmission.tour.separation_kernel import box_tree, least_apart, near_legs, pair_distance
from mrmission.tour.separation_search import Course, _add_rows, best_launch, gravity
from mrmission.tour.timing import TimeModel

MODEL = TimeModel(survey_speed_m_s=2.0, transit_speed_m_s=2.0)
EXACT = SeparationRules(distance_m=20.0, time_share=0.0, start_slack_s=0.0)


def line(robot: int, points: list[tuple[float, float]], speed_m_s: float = 2.0) -> Timeline:
    place = np.array(points, dtype=float)
    step = np.hypot(*np.diff(place, axis=0).T)
    return Timeline(robot=robot, time_s=np.append(0.0, np.cumsum(step / speed_m_s)), points_m=place)


def wandering(rng: np.random.Generator, robot: int, corners: int, side_m: float) -> Timeline:
    """A random line that also stands still at times."""
    place = rng.uniform(0, side_m, (corners, 2))
    for k in range(1, corners):
        if rng.random() < 0.2:
            place[k] = place[k - 1]
    step = np.hypot(*np.diff(place, axis=0).T) / 2.0
    wait = np.where(step > 0, 0.0, rng.uniform(1, 10, corners - 1))
    return Timeline(
        robot=robot, time_s=np.append(0.0, np.cumsum(step + wait)), points_m=place
    )  # fmt: skip


def sampled(each: Timeline, gap_s: float) -> tuple[FloatArray, FloatArray]:
    count = max(2, math.ceil(each.duration_s / gap_s))
    times = np.union1d(np.linspace(0, each.duration_s, count), each.time_s)
    where = [np.interp(times, each.time_s, each.points_m[:, k]) for k in (0, 1)]
    return times, np.column_stack(where)


def oracle_m(
    a: Timeline, b: Timeline, lag_s: float, share: float, slack_s: float, gap_s: float
) -> float:
    """The least distance of all pairs of sampled moments that may be the same."""
    ta, pa = sampled(a, gap_s)
    tb, pb = sampled(b, gap_s)
    early_a, late_a = (1 - share) * ta[:, None], (1 + share) * ta[:, None]
    early_b, late_b = lag_s + (1 - share) * tb[None], lag_s + (1 + share) * tb[None]
    same = (early_a <= late_b + slack_s) & (early_b <= late_a + slack_s)
    apart = np.hypot(pa[:, None, 0] - pb[None, :, 0], pa[:, None, 1] - pb[None, :, 1])
    return float(np.where(same, apart, np.inf).min())


def kernels(each: Timeline) -> tuple[FloatArray, FloatArray, FloatArray]:
    course = course_of(each)
    assert course is not None
    return course.time_s, course.points_m, course.boxes


@settings(max_examples=40, deadline=None)
@given(
    st.integers(0, 2**32 - 1),
    st.sampled_from([0.0, 0.01, 0.05, 0.3]),
    st.sampled_from([0.0, 3.0]),
)
def test_least_distances_are_those_of_dense_sampling(
    seed: int, share: float, slack_s: float
) -> None:
    rng = np.random.default_rng(seed)
    a, b = (wandering(rng, r, int(rng.integers(2, 14)), 150.0) for r in (1, 2))
    lag_s = float(rng.uniform(-1, 1) * max(a.duration_s, b.duration_s))
    found, at_a, at_b = least_apart(*kernels(a), *kernels(b), lag_s, share, slack_s)
    gap_s = 0.5
    # moments of the samples that may just be the same, and those that may just not
    rough = oracle_m(a, b, lag_s, share, slack_s, gap_s)
    wide = oracle_m(a, b, lag_s, share, slack_s + 2 * gap_s, gap_s)
    assert found <= rough + 1e-6
    if math.isfinite(found):
        assert found >= wide - 4.0 * gap_s  # both sail 2 m/s
        here, there = (
            np.array([np.interp(at, e.time_s, e.points_m[:, k]) for k in (0, 1)])
            for at, e in ((at_a, a), (at_b, b))
        )
        assert float(np.hypot(*(here - there))) == pytest.approx(found, abs=1e-6)
        assert (1 - share) * at_a - (1 + share) * at_b - slack_s <= lag_s + 1e-5
        assert (1 + share) * at_a - (1 - share) * at_b + slack_s >= lag_s - 1e-5


@settings(max_examples=30, deadline=None)
@given(st.integers(0, 2**32 - 1), st.sampled_from([0.0, 0.05]))
def test_lags_that_bring_two_near_are_exactly_those_found(seed: int, share: float) -> None:
    rng = np.random.default_rng(seed)
    a, b = (wandering(rng, r, int(rng.integers(2, 20)), 150.0) for r in (1, 2))
    legs, rows = near_legs(*kernels(a), *kernels(b), 20.0, share, 1.0, 1e6)
    for lag_s in rng.uniform(-100, 100, 12):
        least, _, _ = least_apart(*kernels(a), *kernels(b), lag_s, share, 1.0)
        if abs(least - 20.0) > 1e-4:
            assert bool(((rows[:, 0] <= lag_s) & (lag_s <= rows[:, 1])).any()) == (least < 20.0)
    if len(legs):
        apart = pair_distance(*kernels(a)[:2], *kernels(b)[:2], legs, 0.0, 0.0, 1e9)
        assert np.allclose(apart[:, 0], rows[:, 8], atol=1e-6)  # whatever the times
        assert (rows[:, 0] <= rows[:, 2] - 1.0 + 1e-9).all()
        assert (rows[:, 1] >= rows[:, 3] + 1.0 - 1e-9).all()


def test_a_crossing_at_right_angles_has_a_closed_form() -> None:
    a, b = line(1, [(-50, 0), (50, 0)]), line(2, [(0, -50), (0, 50)])
    for lag_s in (0.0, 5.0, 12.5):
        least, _, _ = least_apart(*kernels(a), *kernels(b), lag_s, 0.0, 0.0)
        assert least == pytest.approx(2.0 * lag_s / math.sqrt(2), abs=1e-4)
    # both are at the crossing after 25 s, and 5 % of 25 s twice is 2.5 s, a little more later on
    least, _, _ = least_apart(*kernels(a), *kernels(b), 12.5, 0.05, 0.0)
    assert 2.0 * (12.5 - 3.2) / math.sqrt(2) < least < 2.0 * (12.5 - 2.5) / math.sqrt(2)


def test_the_wrong_of_a_time_grows_with_the_time() -> None:
    """Two pass one place at right angles after 1,000 s: 5 % of both is 100 s."""
    a, b = line(1, [(-2000, 0), (2000, 0)]), line(2, [(0, -2000), (0, 2000)])
    for lag_s, met in ((0.0, True), (95.0, True), (130.0, False)):
        found = measure([a, b], np.array([0.0, lag_s]), SeparationRules())
        assert (len(found.conflicts) > 0) == met, lag_s
    (conflict,) = measure([a, b], np.array([0.0, 40.0]), SeparationRules()).conflicts
    assert conflict.robots == (1, 2)
    assert conflict.least_m == pytest.approx(0.0, abs=1e-6)
    assert np.hypot(*conflict.place_m) < 30.0
    assert 980.0 < conflict.from_s < 1000.0 + 20.0 < conflict.to_s < 1065.0
    # at right angles two come within 20 m for lags of 28 s in all; the error allows 206 s
    assert conflict.chance == pytest.approx(28.3 / 206, rel=0.1)


def test_two_that_cross_are_kept_apart_by_the_least_delay() -> None:
    lines = [line(1, [(-50, 0), (50, 0)]), line(2, [(0, -50), (0, 50)])]
    launch = best_launch(
        [[c] for each in lines if (c := course_of(each)) is not None],
        distance_m=20.0, time_share=0.0, slack_s=0.0, max_delay_s=60.0, worth_s=1.0,
    )  # fmt: skip
    assert launch.pairs == 0
    assert measure(lines, launch.delay_s, EXACT).least_m[0, 1] >= 20.0
    assert min(launch.delay_s) == 0
    assert 14.2 <= max(launch.delay_s) <= 16.0


def test_nobody_waits_longer_than_allowed() -> None:
    """To and fro on one line: whatever the delay, they meet again and again."""
    to_and_fro = [(0.0, 0.0), *[(900.0, 0.0), (0.0, 0.0)] * 20]
    meeting = [line(1, to_and_fro), line(2, [(x, y + 5.0) for x, y in to_and_fro])]
    paths = [
        CoveragePath(
            robot=each.robot, points_m=each.points_m,
            kind=np.ones(len(each.points_m) - 1, dtype=np.int8),
            lane=np.arange(1, len(each.points_m)),
        )
        for each in meeting
    ]  # fmt: skip
    for most in (None, 0.0, 30.0):
        rules = SeparationRules(max_delay_s=most)
        found = separate(paths, [MODEL] * 2, rules)
        limit = 0.1 * timeline(paths[0], MODEL).duration_s if most is None else most
        assert 0.0 <= found.delay_s.max() <= limit
        assert found.conflicts
        assert found.rules.max_delay_s == pytest.approx(limit)


def path_of(robot: int, points: FloatArray) -> CoveragePath:
    legs = len(points) - 1
    kind = np.full(legs, int(LegKind.SURVEY), dtype=np.int8)
    return CoveragePath(robot=robot, points_m=points, kind=kind, lane=np.arange(1, legs + 1))


@settings(max_examples=8, deadline=None)
@given(st.integers(0, 2**32 - 1))
def test_the_launch_of_two_is_the_best_of_all(seed: int) -> None:
    rng = np.random.default_rng(seed)
    paths = [
        path_of(
            r, np.vstack([[15.0 * r, 0.0], rng.uniform((0, 25), (60, 85), (3, 2)), [15.0 * r, 0]])
        )
        for r in (1, 2)
    ]
    rules = SeparationRules(time_share=0.02, max_delay_s=40.0)
    found = separate(paths, [MODEL] * 2, rules)
    ways = [[timeline(p, MODEL), timeline(reversed_path(p), MODEL)] for p in paths]
    free = []
    for a, b in product((0, 1), repeat=2):
        for lag in range(-40, 41):
            delays = np.array([max(0, -lag), max(0, lag)], dtype=float)
            pair = [ways[0][a], ways[1][b]]
            course = [c for each in pair if (c := course_of(each)) is not None]
            apart, _, _ = least_apart(
                *(course[0].time_s, course[0].points_m, course[0].boxes),
                *(course[1].time_s, course[1].points_m, course[1].boxes), lag, 0.02, 3.0,
            )  # fmt: skip
            if apart > 20.0:
                free.append(max(d + w.duration_s for d, w in zip(delays, pair, strict=True)))
    chosen = [ways[r][int(found.turned[r])] for r in (0, 1)]
    home_s = max(d + w.duration_s for d, w in zip(found.delay_s, chosen, strict=True))
    assert bool(found.conflicts) == (not free)
    if free:
        assert found.least_m[0, 1] >= 20.0
        # the search counts from the longest tour as planned: what is below is all the same
        planned_s = max(w[0].duration_s for w in ways)
        assert home_s <= max(planned_s, min(free)) + 1e-6


def test_many_robots_without_conflicts_keep_their_distance() -> None:
    """Six cross one place in turn; there is time for all of them."""
    paths = []
    for k in range(6):
        angle = math.pi * k / 6
        ray = np.array([math.cos(angle), math.sin(angle)])
        paths.append(path_of(k + 1, np.array([-300.0 * ray, 300.0 * ray])))
    rules = SeparationRules(time_share=0.01, max_delay_s=600.0)
    found = separate(paths, [MODEL] * 6, rules)
    assert not found.conflicts
    assert found.least_m[np.triu_indices(6, 1)].min() >= 20.0
    again = separate(paths, [MODEL] * 6, rules)
    assert again.delay_s.tolist() == found.delay_s.tolist()


def test_those_that_never_come_near_start_together() -> None:
    paths = [path_of(r, np.array([[0.0, 50.0 * r], [100.0, 50.0 * r]])) for r in (1, 2, 3)]
    found = separate(paths, [MODEL] * 3, SeparationRules())
    assert found.delay_s.tolist() == [0.0] * 3
    assert found.turned == (False,) * 3
    assert found.least_m[0, 1] == pytest.approx(50.0)
    assert not found.conflicts


def test_a_robot_without_work_needs_no_delay() -> None:
    idle = CoveragePath(
        robot=2, points_m=np.zeros((1, 2)), kind=np.zeros(0, np.int8), lane=np.zeros(0, np.int64)
    )
    paths = [
        path_of(1, np.array([[0.0, 0.0], [100.0, 0.0], [0.0, 0.0]])),
        idle,
        path_of(3, np.array([[0.0, 5.0], [100.0, 5.0], [0.0, 5.0]])),
    ]
    found = separate(paths, [MODEL] * 3, SeparationRules(max_delay_s=300.0))
    assert found.delay_s[1] == 0
    assert not found.conflicts
    assert np.isinf(found.least_m[1]).all()
    alone = separate([idle, idle], [MODEL] * 2, SeparationRules())
    assert alone.delay_s.tolist() == [0.0, 0.0]


def test_a_separation_of_nothing_leaves_everything_as_it_is() -> None:
    paths = [path_of(r, np.array([[0.0, 0.0], [100.0, 0.0], [0.0, 0.0]])) for r in (1, 2)]
    found = separate(paths, [MODEL] * 2, SeparationRules(distance_m=0.0))
    assert found.delay_s.tolist() == [0.0, 0.0]
    assert found.turned == (False, False)
    assert found.conflicts == ()


def test_only_those_turn_that_may() -> None:
    """Head on on one line: turning one round makes them follow each other."""
    there = np.array([[0.0, 0.0], [1000.0, 0.0]])
    paths = [path_of(1, there), path_of(2, there[::-1] + np.array([0.0, 1.0]))]
    rules = SeparationRules(time_share=0.0, max_delay_s=60.0)
    found = separate(paths, [MODEL] * 2, rules)
    assert sorted(found.turned) == [False, True]
    assert not found.conflicts
    stiff = separate(paths, [MODEL] * 2, rules, may_turn=[False, False])
    assert stiff.turned == (False, False)
    assert stiff.conflicts


def test_a_path_the_other_way_round_is_the_same_work() -> None:
    path = CoveragePath(
        robot=3,
        points_m=np.array([(0, 0), (0, 40), (20, 40), (20, 0), (0, 0.0)]),
        kind=np.array([0, 1, 1, 0], dtype=np.int8),
        lane=np.array([0, 1, 2, 0]),
    )
    back = reversed_path(path)
    assert back.points_m.tolist() == path.points_m[::-1].tolist()
    assert back.kind.tolist() == [0, 1, 1, 0]
    assert back.lane.tolist() == [0, 1, 2, 0]
    assert back.robot == 3
    again = reversed_path(back)
    assert again.lane.tolist() == path.lane.tolist()


def naive_value(rows: FloatArray, lag_s: float, reach_m: float) -> float:
    """The meetings to be expected at a lag, trapezoid by trapezoid."""
    total = 0.0
    for low, high, sure_low, sure_high, *_, least in rows.tolist():
        certain = sure_high - sure_low
        wrong = high - low - certain
        ramp = min(certain, wrong)
        top = min(1.0, certain / wrong) * gravity(least, reach_m)
        if low <= lag_s <= high:
            total += top * min(1.0, (lag_s - low) / ramp, (high - lag_s) / ramp)
    return total


def test_tables_hold_what_every_leg_adds() -> None:
    rng = np.random.default_rng(5)
    for step_s, steps in ((1.0, 40), (7.0, 12)):
        low = rng.uniform(-120, 120, 30)
        certain, wrong = rng.uniform(1, 40, 30), rng.uniform(1, 60, 30)
        rows = np.zeros((30, 9))
        rows[:, 0], rows[:, 1] = low, low + certain + wrong
        rows[:, 2], rows[:, 3] = low + wrong / 2, low + wrong / 2 + certain
        rows[:, 8] = rng.uniform(0, 20, 30)
        hit = np.zeros(2 * steps + 1, dtype=np.float32)
        value = np.zeros_like(hit)
        _add_rows(rows, steps, step_s, 20.0, hit, value)
        lags = np.arange(-steps, steps + 1) * step_s
        expected = [naive_value(rows, lag, 20.0) for lag in lags]
        some = [bool(((rows[:, 0] <= lag) & (lag <= rows[:, 1])).any()) for lag in lags]
        assert (hit > 0).tolist() == some
        assert np.allclose(value, np.maximum(expected, np.where(some, 1e-6, 0.0)), atol=1e-4)


def test_boxes_hold_their_legs() -> None:
    rng = np.random.default_rng(2)
    for count in (2, 3, 5, 6, 33, 100):
        points = rng.uniform(0, 100, (count, 2))
        boxes = box_tree(points)
        assert boxes[1].tolist() == [*points.min(axis=0), *points.max(axis=0)]


def test_long_tours_are_looked_at_in_moments() -> None:
    """The answer for two tours of 20 h and 3,000 legs is that of every pair of legs."""
    lines = []
    for robot in (1, 2):
        turns = np.arange(750)
        x = np.repeat(turns * 18.0, 4) + 13_500.0 * (robot - 1) + np.tile([0, 0, 18, 18], 750)
        y = np.tile([0.0, 200.0, 200.0, 0.0], 750)
        lines.append(line(robot, list(zip(x.tolist(), y.tolist(), strict=True))))
    a, b = (course_of(each) for each in lines)
    assert isinstance(a, Course)
    assert isinstance(b, Course)
    least, _, _ = least_apart(
        a.time_s, a.points_m, a.boxes, b.time_s, b.points_m, b.boxes, 0.0, 0.05, 3.0
    )
    legs, _ = near_legs(
        a.time_s, a.points_m, a.boxes, b.time_s, b.points_m, b.boxes, 20.0, 0.05, 3.0, 1e6
    )
    # the last lane of the first lies 18 m (or less, at its end) from the first of the second
    assert 0 < len(legs) < 20
    # at the end of the first the second is long gone, or nearly: it came along 10 h before
    assert least > 1000.0


def test_a_timeline_takes_the_predicted_time_and_turns_at_its_corners() -> None:
    model = TimeModel(survey_speed_m_s=2.0, transit_speed_m_s=1.0)
    points = np.array([(0, 0), (0, 40), (20, 40), (20, 0), (0, 0.0)])
    kind = np.array([LegKind.TRANSIT, LegKind.SURVEY, LegKind.SURVEY, LegKind.TRANSIT])
    path = CoveragePath(
        robot=3, points_m=points, kind=kind.astype(np.int8), lane=np.array([0, 1, 1, 0])
    )
    found = timeline(path, model)
    assert found.robot == 3
    assert found.duration_s == pytest.approx(model.duration_s(points, path.kind))
    assert (np.diff(found.time_s) > 0).all()
    assert {tuple(p) for p in found.points_m.tolist()} == {tuple(p) for p in points.tolist()}
    twice = CoveragePath(
        robot=3,
        points_m=np.vstack([points, points[1:]]),
        kind=np.tile(path.kind, 2),
        lane=np.tile(path.lane, 2),
    )
    rested, restless = timeline(twice, model, 90.0), timeline(twice, model)
    assert rested.duration_s == pytest.approx(restless.duration_s + 90.0)
    home = np.flatnonzero((rested.points_m == points[0]).all(axis=1))
    assert len(home) == 4  # start, arrival and departure in between, end
    trip_s = model.duration_s(points, path.kind)  # of setting off and stopping each time, too
    assert rested.time_s[home[1:]] == pytest.approx([trip_s, trip_s + 90.0, 2 * trip_s + 90.0])
    still = CoveragePath(robot=1, points_m=points[:1], kind=kind[:0], lane=kind[:0])
    assert timeline(still, model).duration_s == 0
    assert course_of(timeline(still, model)) is None

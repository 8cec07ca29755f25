"""Start delays, against simulation second by second."""

from __future__ import annotations

from itertools import combinations, product

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from mrmission.model import CoveragePath, LegKind, RobotReport
from mrmission.tour.separation import (
    Timeline,
    delay_notes,
    earliest_s,
    forbidden_s,
    pieces_of,
    start_delays_s,
    timeline,
    union_of,
    worthwhile_delays_s,
)
from mrmission.tour.timing import TimeModel

MODEL = TimeModel(survey_speed_m_s=2.0, transit_speed_m_s=1.0)


def line(robot: int, points: list[tuple[float, float]], speed_m_s: float = 2.0) -> Timeline:
    place = np.array(points, dtype=float)
    step = np.hypot(*np.diff(place, axis=0).T)
    return Timeline(robot=robot, time_s=np.append(0.0, np.cumsum(step / speed_m_s)), points_m=place)


def least_m(lines: list[Timeline], delays: list[float], tick_s: float = 0.05) -> float:
    """The least distance of any two under way, by looking every `tick_s`."""
    least = np.inf
    for a, b in combinations(range(len(lines)), 2):
        start = max(delays[a], delays[b])
        end = min(delays[a] + lines[a].duration_s, delays[b] + lines[b].duration_s)
        if end < start:
            continue
        times = np.append(np.arange(start, end, tick_s), end)
        here, there = (
            np.column_stack(
                [np.interp(times - delays[i], lines[i].time_s, lines[i].points_m[:, k])
                 for k in (0, 1)]
            )
            for i in (a, b)
        )  # fmt: skip
        least = min(least, float(np.hypot(*(here - there).T).min()))
    return least


def test_two_that_cross_are_kept_apart_by_the_least_delay() -> None:
    lines = [line(1, [(-50, 0), (50, 0)]), line(2, [(0, -50), (0, 50)])]
    delays = start_delays_s(lines, distance_m=20.0, slack_s=0.0, slack_share=0.0)
    assert least_m(lines, [0.0, 0.0]) < 0.2
    assert least_m(lines, delays.tolist()) >= 20.0
    assert min(delays) == 0
    # at right angles and 2 m/s, a lag of t seconds passes at 2 t / sqrt(2) metres
    assert 14.2 <= max(delays) <= 19.0


def test_those_that_never_come_near_start_together() -> None:
    lines = [line(1, [(0, 0), (100, 0)]), line(2, [(0, 50), (100, 50)])]
    assert start_delays_s(lines).tolist() == [0.0, 0.0]


def test_a_robot_without_work_needs_no_delay() -> None:
    idle = Timeline(robot=2, time_s=np.zeros(1), points_m=np.zeros((1, 2)))
    lines = [line(1, [(0, 0), (100, 0), (0, 0)]), idle, line(3, [(0, 5), (100, 5), (0, 5)])]
    delays = start_delays_s(lines)
    assert delays[1] == 0
    assert least_m([lines[0], lines[2]], [delays[0], delays[2]]) >= 20.0
    assert start_delays_s([idle, idle]).tolist() == [0.0, 0.0]


@settings(max_examples=25, deadline=None)
@given(st.integers(0, 2**32 - 1), st.integers(2, 4))
def test_delays_keep_any_fleet_apart(seed: int, count: int) -> None:
    rng = np.random.default_rng(seed)
    lines = []
    for robot in range(count):
        home = np.array([15.0 * robot, 0.0])
        way = rng.uniform(0, 120, (4, 2)) + np.array([0.0, 25.0])
        lines.append(line(robot + 1, [tuple(p) for p in np.vstack([home, way, home])]))
    delays = start_delays_s(lines, distance_m=20.0)
    assert delays.min() == 0
    assert least_m(lines, delays.tolist()) >= 20.0 - 0.2
    # with the times predicted wrongly by a second, they still are apart
    late = delays + rng.uniform(0, 1.0, count)
    assert least_m(lines, late.tolist()) >= 20.0 - 0.2


def test_two_robots_get_the_best_delays_there_are() -> None:
    rng = np.random.default_rng(4)
    for _ in range(5):
        lines = [line(i, [tuple(p) for p in rng.uniform(0, 100, (4, 2))]) for i in (1, 2)]
        delays = start_delays_s(lines, slack_s=0.0, slack_share=0.0)
        end = max(d + each.duration_s for d, each in zip(delays, lines, strict=True))
        for a, b in product(range(120), repeat=2):
            if min(a, b) or max(a + lines[0].duration_s, b + lines[1].duration_s) >= end - 5:
                continue  # ends within 5 s are as good
            # pieces last 2 s, in which two boats come up to 8 m nearer
            assert least_m(lines, [a, b], tick_s=0.25) < 20.0 + 2.0 * 4.0


def test_forbidden_differences_of_a_known_crossing() -> None:
    a, b = line(1, [(0, 0), (100, 0)]), line(2, [(50, 30), (50, -30)])
    found = forbidden_s(*pieces_of(a, 0.5), *pieces_of(b, 0.5), 1.0, 0.0, 0.0)
    # a is at the crossing after 25 s, b after 15 s: b must not start 10 s after a
    assert len(found) == 1
    assert found[0, 0] < 10.0 < found[0, 1]
    assert found[0, 1] - found[0, 0] < 4.0
    none = np.zeros((0, 2)), np.zeros((0, 2, 2))
    assert forbidden_s(*none, *pieces_of(b, 0.5)).shape == (0, 2)


def test_pieces_are_the_line_cut() -> None:
    cut, ends = pieces_of(line(1, [(0, 0), (7, 0), (7, 3)]), 1.0)
    assert (np.diff(cut, axis=1) <= 1.0 + 1e-9).all()
    assert cut[0, 0] == 0
    assert cut[-1, 1] == pytest.approx(5.0)
    assert np.allclose(cut[1:, 0], cut[:-1, 1])
    assert np.allclose(ends[1:, 0], ends[:-1, 1])
    assert ends[-1, 1].tolist() == [7.0, 3.0]


def test_a_timeline_takes_the_predicted_time_and_turns_at_its_corners() -> None:
    points = np.array([(0, 0), (0, 40), (20, 40), (20, 0), (0, 0.0)])
    kind = np.array([LegKind.TRANSIT, LegKind.SURVEY, LegKind.SURVEY, LegKind.TRANSIT])
    path = CoveragePath(
        robot=3, points_m=points, kind=kind.astype(np.int8), lane=np.array([0, 1, 1, 0])
    )
    found = timeline(path, MODEL)
    assert found.robot == 3
    assert found.duration_s == pytest.approx(MODEL.duration_s(points, path.kind))
    assert (np.diff(found.time_s) > 0).all()
    assert {tuple(p) for p in found.points_m.tolist()} == {tuple(p) for p in points.tolist()}
    still = CoveragePath(robot=1, points_m=points[:1], kind=kind[:0], lane=kind[:0])
    assert timeline(still, MODEL).duration_s == 0


def test_unions_and_first_free_seconds() -> None:
    assert union_of(np.zeros((0, 2))).shape == (0, 2)
    merged = union_of(np.array([[5.0, 6.0], [1.0, 9.0], [2.0, 3.0], [10.0, 11.0]]))
    assert merged.tolist() == [[1.0, 9.0], [10.0, 11.0]]
    assert earliest_s(merged) == 0.0
    assert earliest_s(np.array([[-1.0, 4.0], [5.0, 9.2]])) == 10.0


def test_the_note_names_the_order() -> None:
    def row(robot: int, delay_s: float, duration_s: float) -> RobotReport:
        return RobotReport(
            robot=robot, start_lonlat=(0.0, 0.0), length_m=1.0, survey_m=1.0, transit_m=0.0,
            duration_s=duration_s, items=5, lanes=2, fence_points=0, fence_land_m2=0.0,
            start_delay_s=delay_s,
        )  # fmt: skip

    (note,) = delay_notes({1: row(1, 40.0, 100.0), 2: row(2, 0.0, 120.0)})
    assert note.startswith("launch robot 2 first, robot 1 after 40 s: then")
    assert "home 20 s later" in note
    assert delay_notes({1: row(1, 0.0, 100.0)}) == []
    (note,) = delay_notes({1: row(1, 5.0, 100.0), 2: row(2, 0.0, 120.0), 3: row(3, 0.0, 90.0)})
    assert note.startswith("launch robots 2, 3 first, robot 1 after 5 s: then")
    assert "home no later" in note
    (note,) = delay_notes({1: row(1, 40.0, 100.0), 2: row(2, 0.0, 120.0)}, 3600.0)
    assert "nearer than 20 m in their first 60 min (later ones may: look out), if" in note


def test_delays_that_cost_too_much_see_to_the_time_after_the_starts() -> None:
    """Two that leave side by side and share a long way home, an hour and a half later."""
    shared = [(9000.0, 0.0), (9000.0, 500.0)]
    first = line(1, [(0.0, 0.0), *shared, (0.0, 500.0)])
    second = line(2, [(0.0, 30.0), (9000.0, 30.0), (9000.0, 501.0), (0.0, 501.0)])
    whole = start_delays_s([first, second])
    assert whole.max() > 0.0
    delays, horizon_s = worthwhile_delays_s([first, second])
    assert horizon_s == np.inf
    assert delays.tolist() == whole.tolist()
    # to and fro on one line: whatever the delay, they meet again and again
    to_and_fro = [(0.0, 0.0), *[(900.0, 0.0), (0.0, 0.0)] * 20]
    meeting = [line(1, to_and_fro), line(2, [(x, y + 5.0) for x, y in to_and_fro])]
    assert start_delays_s(meeting).max() > 0.1 * meeting[0].duration_s
    delays, horizon_s = worthwhile_delays_s(meeting)
    assert horizon_s == 900.0
    assert 0.0 < delays.max() < start_delays_s(meeting).max()

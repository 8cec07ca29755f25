"""The calibration experiment without boats: courses, measuring on tracks made by hand, tables."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner

from mrmission.calibrate.courses import Course, corner_course, lane_m, speed_course
from mrmission.calibrate.measure import CourseResult, measure
from mrmission.calibrate.run import Experiment
from mrmission.calibrate.sailing import Setting, course_mission
from mrmission.calibrate.table import changes_of, make_table, markdown
from mrmission.cli.main import cli
from mrmission.errors import ConfigError, SimulatorError
from mrmission.mission import mavlink
from mrmission.model import FloatArray, LegKind
from mrmission.simulate.motion import offset_m
from mrmission.tour.time_table import parse_table, table_text
from mrmission.tour.timing import TimeModel

STEP_S = 0.1


def sailed(
    course: Course, wait_s: dict[int, float], overshoot_m: float = 0.0
) -> tuple[FloatArray, FloatArray]:
    """A boat that keeps the course exactly, and waits at some of its points.

    With an overshoot it goes so far beyond each corner, at once, and comes back as fast.
    """
    times, places = [0.0], [course.points_m[0]]
    for i, (a, b) in enumerate(zip(course.points_m[:-1], course.points_m[1:], strict=True)):
        length = float(np.hypot(*(b - a)))
        times.append(times[-1] + length / float(course.speed_m_s[i]))
        places.append(b)
        wait = wait_s.get(i + 1, 0.0)
        if wait or overshoot_m:
            beyond = b + overshoot_m * (b - a) / length
            times += [times[-1] + 0.5 * wait + 1e-6, times[-1] + wait + 2e-6]
            places += [beyond, b]
    at = np.arange(0.0, times[-1], STEP_S)
    x, y = np.array(places).T
    # the corners themselves too, so that nothing is rounded off between two samples
    at = np.unique(np.concatenate([at, times]))
    return at, np.column_stack([np.interp(at, times, x), np.interp(at, times, y)])


def result_of(course: Course, wait_s: dict[int, float], overshoot_m: float = 0.0) -> CourseResult:
    time, points = sailed(course, wait_s, overshoot_m)
    return measure(course, time + 100.0, points, 100.0, time[-1] + 100.0)


def test_a_boat_that_keeps_the_course_measures_zero() -> None:
    for course in (corner_course(2.0, repeats=1), speed_course(2.0, 4.0, repeats=1)):
        got = result_of(course, {})
        assert len(got.measured) == len(course.manoeuvres)
        assert max(abs(m.extra_s) for m in got.measured) < 1e-6
        assert max(m.swing_m for m in got.measured) < 1e-6
        assert got.start_s == pytest.approx(0.0, abs=1e-6)
        assert got.end_s == pytest.approx(0.0, abs=1e-6)
        assert got.speed_share == pytest.approx(1.0, abs=0.01)


def test_waits_at_corners_are_found_where_they_were() -> None:
    """Every point of the course is left out of breath by its number in hundredths of a second."""
    course = corner_course(2.0, repeats=2, angles_deg=(30, 90, 180), spacings_m=(4.0, 10.0))
    wait = {i: 0.01 * i for i in range(1, len(course.points_m) - 1)}
    for m in result_of(course, wait).measured:
        man = m.manoeuvre
        want = sum(wait[i] for i in range(man.first, man.last + 1))
        assert m.extra_s == pytest.approx(want, abs=1e-4), man


def test_the_swing_is_the_way_beyond_the_corner() -> None:
    course = corner_course(2.0, repeats=1, angles_deg=(90.0,), spacings_m=(10.0,))
    wait = dict.fromkeys(range(1, len(course.points_m)), 2.0)
    for m in result_of(course, wait, overshoot_m=3.0).measured:
        if m.manoeuvre.kind == "corner":
            assert m.beyond_m == pytest.approx(3.0, abs=1e-3)
            assert m.swing_m == pytest.approx(3.0, abs=1e-3)


def test_who_leaves_the_course_is_told_so() -> None:
    course = corner_course(2.0, repeats=1)
    time, points = sailed(course, {})
    half = len(time) // 2
    with pytest.raises(SimulatorError, match="did not follow the course at its"):
        measure(course, time[:half], points[:half], 0.0, float(time[half]))


def test_courses_hold_what_was_asked_for() -> None:
    course = corner_course(3.0, repeats=2, angles_deg=(45.0, 135.0), spacings_m=(6.0,))
    corners = [m for m in course.manoeuvres if m.kind == "corner"]
    assert sorted(m.angle_deg for m in corners) == [-135, -135, -45, -45, 45, 45, 135, 135]
    legs = np.diff(course.points_m, axis=0)
    heading = np.degrees(np.arctan2(legs[:, 1], legs[:, 0]))
    for m in corners:
        turned = (heading[m.first] - heading[m.first - 1] + 180) % 360 - 180
        assert turned == pytest.approx(m.angle_deg)
    lengths = np.hypot(*legs.T)
    for m in course.manoeuvres:
        assert lengths[m.first - 1] >= lane_m(3.0) - 1e-9
        assert lengths[m.last] >= lane_m(3.0) - 1e-9
        assert np.allclose(lengths[m.first : m.last], m.leg_m)
    for m in speed_course(2.0, 4.0).manoeuvres:
        assert m.first == m.last


def test_course_as_a_mission() -> None:
    """Speed after the first waypoint; positions where the course says, to a centimetre."""
    course = speed_course(2.0, 4.0, repeats=1)
    items = course_mission(course, (8.5, 47.3)).items
    assert [i.command for i in items[:4]] == [
        mavlink.NAV_WAYPOINT, mavlink.NAV_WAYPOINT, mavlink.DO_CHANGE_SPEED, mavlink.NAV_WAYPOINT,
    ]  # fmt: skip
    speeds = [i.param2 for i in items if i.command == mavlink.DO_CHANGE_SPEED]
    assert speeds == [2.0, 4.0, 2.0]
    places = [i for i in items[1:] if i.command == mavlink.NAV_WAYPOINT]
    got = np.array([offset_m(47.3, 8.5, i.x / 1e7, i.y / 1e7) for i in places])
    assert np.abs(got - course.points_m).max() < 0.02


def test_from_tracks_to_predictions() -> None:
    """What is measured on a course is what the time model predicts for that course."""
    results = {}
    experiment = Experiment(
        steerings=("steered",), speeds_m_s=(2.0, 3.0), radii_m=(1.0,), repeats=1
    )
    for speed in experiment.speeds_m_s:
        course = experiment.course(speed)
        legs = np.diff(course.points_m, axis=0)
        heading = np.arctan2(legs[:, 1], legs[:, 0])
        turn = np.abs((np.diff(heading) + np.pi) % (2 * np.pi) - np.pi)
        wait = {i + 1: float(angle) ** 2 for i, angle in enumerate(turn)}
        results[Setting(steering="steered", speed_m_s=speed, radius_m=1.0)] = result_of(
            course, wait
        )
    changes = changes_of("steered", *_speed_result())
    table = make_table(results, changes, vehicle="a test", command="-", repeats=1)
    assert parse_table(table_text(table), "again") == table
    assert [round(c.extra_s, 2) for c in table.speed_changes] == [1.0, 0.5]
    for speed in experiment.speeds_m_s:
        course = experiment.course(speed)
        time = TimeModel(survey_speed_m_s=speed, transit_speed_m_s=speed, table=table)
        kind = np.full(len(course.points_m) - 1, LegKind.SURVEY, dtype=np.int8)
        setting = Setting(steering="steered", speed_m_s=speed, radius_m=1.0)
        driven = course.shortest_s + sum(
            m.extra_s for m in results[setting].measured if m.manoeuvre.kind != "straight"
        )
        assert time.duration_s(course.points_m, kind) == pytest.approx(driven, rel=0.003)
    page = markdown(table)
    assert "| 2 | 1 | 0.3 | 0.6 |" in page
    assert "| steered | 2 | 4 | 1.0 |" in page


def _speed_result() -> tuple[Course, CourseResult]:
    course = speed_course(2.0, 4.0, repeats=1)
    first, second = (m.first for m in course.manoeuvres)
    return course, result_of(course, {first: 1.0, second: 0.5})


@pytest.mark.parametrize(
    ("flags", "word"),
    [
        (["--connect", "tcp:127.0.0.1:1", "--steering", "steered"], "--arm-vehicles"),
        (["--connect", "tcp:127.0.0.1:1"], "--steering"),
        (["--engine", "light", "--steering", "pivoting"], "light boats are steered"),
        (["--speed", "-1"], "--speed"),
        (["--wp-radius", "0"], "--wp-radius"),
        (["--angle", "200"], "--angle"),
        (["--spacing", "0"], "--spacing"),
        (["--repeats", "0"], "--repeats"),
        (["--boats", "0"], "--boats"),
    ],
)
def test_the_command_refuses_nonsense(tmp_path: Path, flags: list[str], word: str) -> None:
    args = ["calibrate", *flags, "--out", str(tmp_path / "table.json")]
    with pytest.raises(ConfigError, match=word):
        CliRunner().invoke(cli, args, catch_exceptions=False, standalone_mode=False)
    assert not list(tmp_path.iterdir())


def test_light_boats_are_calibrated_by_the_command(tmp_path: Path) -> None:
    out = tmp_path / "table.json"
    args = [
        "calibrate", "--engine", "light", "--speed", "2", "--wp-radius", "1", "--repeats", "1",
        "--angle", "90", "--angle", "180", "--spacing", "10", "--speedup", "60",
        "--boats", "2", "--out", str(out),
    ]  # fmt: skip
    result = CliRunner().invoke(cli, args)
    assert result.exit_code == 0, result.output
    row = json.loads(out.read_text())["rows"][0]
    by_angle = {c["angle_deg"]: c for c in row["corners"]}
    assert -1.5 < by_angle[90.0]["extra_s"] < 3.0
    assert 2.0 < by_angle[180.0]["extra_s"] < 10.0
    with pytest.raises(ConfigError, match="--overwrite or --add"):
        CliRunner().invoke(cli, args, catch_exceptions=False, standalone_mode=False)

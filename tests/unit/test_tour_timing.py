"""Seconds of a path: length over speed, corners, short legs, changes of speed, the bound."""

from __future__ import annotations

import itertools
from pathlib import Path

import numpy as np
import pytest
import shapely

from mrmission.calibrate.table import markdown
from mrmission.errors import InputError
from mrmission.model import FloatArray, LegKind
from mrmission.partition.bound import fleet_area_bound_s
from mrmission.tour.time_table import (
    ChainCost,
    CornerCost,
    SpeedChange,
    TimeRow,
    TimeTable,
    default_table,
    parse_table,
    table_text,
)
from mrmission.tour.timing import TimeModel, curves


def corner(angle: float, extra: float, swing: float = 0.0) -> CornerCost:
    return CornerCost(angle_deg=angle, extra_s=extra, spread_s=0.0, swing_m=swing, beyond_m=0.0)


def chain(kind: str, angle: float, leg: float, extra: float) -> ChainCost:
    return ChainCost(
        kind=kind, angle_deg=angle, leg_m=leg, corners=2 if kind == "turn" else 6,
        extra_s=extra, spread_s=0.0, swing_m=0.0, beyond_m=0.0,
    )  # fmt: skip


def row(speed: float, radius: float, scale: float = 1.0) -> TimeRow:
    """90° costs 1 s and 180° 6 s; a short leg of 5 m costs 3 s alone, 1 s more for each other."""
    return TimeRow(
        steering="steered", speed_m_s=speed, radius_m=radius, start_s=2.0, end_s=1.0,
        corners=(corner(90, 1.0 * scale, 0.5), corner(180, 6.0 * scale, 4.0)),
        chains=(
            chain("turn", 90, 5.0, (2 * 1.0 + 3.0) * scale),
            chain("stairs", 90, 5.0, (6 * 1.0 + 3.0 + 4 * 1.0) * scale),
            chain("stairs", 20, 5.0, (6 * 20 / 90 + 3.0 + 4 * 1.0) * scale),
        ),
    )  # fmt: skip


TABLE = TimeTable(rows=(row(2.0, 1.0), row(4.0, 1.0, 2.0)))
TIME = TimeModel(survey_speed_m_s=2.0, transit_speed_m_s=2.0, table=TABLE)
START_END_S = 3.0


def kinds(points: FloatArray) -> np.ndarray:
    return np.full(len(points) - 1, LegKind.SURVEY, dtype=np.int8)


def path(*turns_and_legs: float, first: float = 100.0) -> FloatArray:
    """A way of `first` metres, then by turns a change of course (degrees) and a leg (m)."""
    at, heading, out = np.zeros(2), 0.3, [np.zeros(2)]
    for turn, leg in zip((0.0, *turns_and_legs[::2]), (first, *turns_and_legs[1::2]), strict=True):
        heading += np.radians(turn)
        at = at + leg * np.array([np.cos(heading), np.sin(heading)])
        out.append(at)
    return np.array(out)


@pytest.mark.parametrize(
    ("angle", "extra"), [(45, 0.5), (90, 1.0), (-90, 1.0), (135, 3.5), (180, 6)]
)
def test_a_corner_costs_what_the_table_says(angle: float, extra: float) -> None:
    points = path(angle, 100.0)
    assert TIME.corners_s(points, kinds(points)) == pytest.approx([extra])
    assert TIME.duration_s(points, kinds(points)) == pytest.approx(100 + extra + START_END_S)


def test_chains_cost_what_the_table_says() -> None:
    """The model splits the chains into parts; together they must be what was measured."""
    turn = path(90, 5.0, 90, 100.0)
    assert TIME.corners_s(turn, kinds(turn)).sum() == pytest.approx(2 * 1.0 + 3.0)
    stairs = path(*itertools.chain(*((90.0 * (-1) ** i, 5.0) for i in range(5))), -90, 100.0)
    assert TIME.corners_s(stairs, kinds(stairs)).sum() == pytest.approx(6 * 1.0 + 3.0 + 4 * 1.0)
    bends = path(*itertools.chain(*((20.0 * (-1) ** i, 5.0) for i in range(5))), -20, 100.0)
    assert TIME.corners_s(bends, kinds(bends)).sum() == pytest.approx(6 * 20 / 90 + 3.0 + 4 * 1.0)


def test_a_long_leg_between_two_corners_costs_nothing_more() -> None:
    points = path(90, 10.0, 90, 100.0)  # twice the longest short leg of the table
    assert TIME.corners_s(points, kinds(points)).sum() == pytest.approx(2.0)
    points = path(90, 7.5, 90, 100.0)
    assert 2.0 < TIME.corners_s(points, kinds(points)).sum() < 5.0


def test_between_measured_speeds_and_outside() -> None:
    points = path(90, 100.0)
    for speed, extra in ((1.0, 1.0), (2.0, 1.0), (3.0, 1.5), (4.0, 2.0), (9.0, 2.0)):
        time = TimeModel(survey_speed_m_s=speed, transit_speed_m_s=speed, table=TABLE)
        assert time.corners_s(points, kinds(points)) == pytest.approx([extra])
    mixed = TimeModel(survey_speed_m_s=2.0, transit_speed_m_s=4.0, table=TABLE)
    kind = np.array([LegKind.SURVEY, LegKind.TRANSIT], dtype=np.int8)
    assert mixed.corners_s(points, kind) == pytest.approx([1.5])
    assert mixed.top_speed_m_s == 4.0


def test_changes_of_speed() -> None:
    """From 2 to 4 m/s at 0.5 m/s²: 4 s for 12 m instead of 3 s; back: 4 s instead of 6."""
    change = SpeedChange(steering="steered", from_m_s=2.0, to_m_s=4.0, extra_s=1.0)
    table = TimeTable(rows=TABLE.rows, speed_changes=(change,))
    time = TimeModel(survey_speed_m_s=2.0, transit_speed_m_s=4.0, table=table)
    points = np.array([[0.0, 0.0], [100.0, 0.0], [200.0, 0.0]])
    up = np.array([LegKind.SURVEY, LegKind.TRANSIT], dtype=np.int8)
    assert time.corners_s(points, up) == pytest.approx([1.0])
    assert time.corners_s(points, up[::-1]) == pytest.approx([0.0])  # never a gain without a swath
    free = TimeModel(survey_speed_m_s=2.0, transit_speed_m_s=4.0, table=TABLE)
    assert free.corners_s(points, up) == pytest.approx([0.0])


def test_a_point_given_twice_is_no_corner_and_no_time() -> None:
    points = np.array([[0.0, 0], [10, 0], [10, 0], [20, 0]])
    assert TIME.duration_s(points, kinds(points)) == pytest.approx(10.0 + START_END_S)
    assert TIME.duration_s(points[:1], kinds(points)[:0]) == 0.0
    assert TIME.duration_s(points[1:3], kinds(points)[:1]) == 0.0


def test_swing_is_that_of_the_worst_corner() -> None:
    points = path(90, 100.0, 135, 100.0, first=50.0)
    assert TIME.swing_m(points, kinds(points)) == pytest.approx(2.25)
    assert TIME.swing_m(points[:2], kinds(points)[:1]) == 0.0


CUTTING = TimeTable(
    rows=(
        TimeRow(
            steering="steered", speed_m_s=2.0, radius_m=1.0, start_s=-5.0, end_s=-5.0,
            corners=tuple(corner(a, -30.0) for a in (30, 60, 90, 120, 150, 180)),
            chains=(chain("turn", 90, 5.0, -60.0), chain("stairs", 90, 5.0, -180.0)),
        ),
    )
)  # fmt: skip
"""Corners that gain far more than any vehicle can."""


def test_a_cut_corner_gains_no_more_than_its_overlap() -> None:
    time = TimeModel(survey_speed_m_s=2.0, transit_speed_m_s=2.0, swath_m=20.0, table=CUTTING)
    points = path(90, 100.0)
    got = time.corners_s(points, kinds(points))[0]
    # both legs' strips overlap on a square of 10 m, less a quarter of the disc of 10 m radius
    assert got == pytest.approx(-(100.0 - np.pi * 100.0 / 4) / 20.0 / 2.0)
    short = path(90, 9.0, first=9.0)
    assert time.corners_s(short, kinds(short)) == pytest.approx([0.0])
    blind = TimeModel(survey_speed_m_s=2.0, transit_speed_m_s=2.0, table=CUTTING)
    assert blind.corners_s(points, kinds(points)) == pytest.approx([0.0])


@pytest.mark.parametrize("table", [CUTTING, None])
def test_no_path_beats_the_area_bound(table: TimeTable | None) -> None:
    """Whatever the corners gain: what a path covers takes at least the bound's time."""
    rng = np.random.default_rng(3)
    closest = np.inf
    for i in range(150):
        swath = float(rng.uniform(2.0, 40.0))
        transit = float(rng.choice([2.0, 3.0]))
        time = TimeModel(
            survey_speed_m_s=2.0, transit_speed_m_s=transit, swath_m=swath, radius_m=2.0,
            table=table,
        )  # fmt: skip
        if i % 3:
            legs = rng.uniform(1.0, 120.0, 6)
            turns = rng.uniform(-180.0, 180.0, 6)
        else:
            legs, turns = np.full(6, 200.0), rng.uniform(-100.0, 100.0, 6)
        points = path(*itertools.chain(*zip(turns, legs, strict=True)))
        kind = rng.integers(0, 2, len(points) - 1).astype(np.int8)
        covered = shapely.linestrings(points).buffer(swath / 2, quad_segs=64).area
        bound = fleet_area_bound_s(covered, [swath], [time.top_speed_m_s])
        taken = time.duration_s(points, kind)
        assert taken >= bound - 1e-9
        closest = min(closest, taken / bound)
    assert closest < 1.05  # the test looks at cases that come near


def test_the_packaged_table_is_read_and_its_text_is_its_own() -> None:
    table = default_table()
    assert parse_table(table_text(table), "again") == table
    for steering in ("steered", "pivoting"):
        time = TimeModel(survey_speed_m_s=2.0, transit_speed_m_s=2.0, steering=steering)
        assert time.lane_turn_s(18.0) >= 0.0
    steered = curves(table, "steered", 2.0, 1.0)
    pivoting = curves(table, "pivoting", 2.0, 1.0)
    at_90 = [float(np.interp(90.0, c.angle_deg, c.corner_s)) for c in (steered, pivoting)]
    assert at_90[1] > at_90[0] + 3.0  # who stops to turn takes longer than who does not


def test_bad_tables_are_refused() -> None:
    good = table_text(TABLE)
    for bad, word in (
        ("{", "Expecting"),
        ("[]", "no attribute"),
        ("{}", "fileType"),
        (good.replace('"version": 1', '"version": 7'), "version"),
        (good.replace('"extra_s": 6.0', '"extra_s": "six"'), "wanted a number"),
        (good.replace('"extra_s": 6.0', '"extra_s": NaN'), "wanted a number"),
        (good.replace('"radius_m": 1.0', '"radius_m": 2.0', 1), "every speed with every radius"),
        (good.replace('"swing_m"', '"sving_m"'), "swing_m"),
    ):
        with pytest.raises(InputError, match=word):
            parse_table(bad, "a test")
    with pytest.raises(InputError, match="nothing measured for --steering pivoting"):
        TABLE.of("pivoting")


def test_the_page_shows_the_packaged_table() -> None:
    page = Path(__file__).parents[2] / "docs" / "time-model.md"
    assert markdown(default_table()) in page.read_text(encoding="utf-8")

"""The terminal's table, report.json and the words for numbers."""

from __future__ import annotations

import dataclasses
import io
import json
import math

import numpy as np
import pytest
from factories import make_plan
from rich.console import Console

from mrmission.model import FleetReport, RobotReport
from mrmission.report import units
from mrmission.report.metrics import plain
from mrmission.report.table import fleet_table, report_json, report_text, summary_lines
from mrmission.report.units import human_chance


def rendered(plan, width=120):
    stream = io.StringIO()
    Console(file=stream, width=width, color_system=None).print(fleet_table(plan))
    return stream.getvalue()


def test_table_has_every_robot_and_figure():
    plan = make_plan(robots=3)
    text = rendered(plan)
    lines = text.splitlines()
    assert "Test lake" in lines[0]
    for row in plan.report.robots:
        (line,) = [entry for entry in lines if f"■ {row.robot} " in entry]
        assert units.human_length(row.length_m) in line
        assert units.human_duration(row.duration_s) in line
        assert f" {row.items} " in line
        assert units.human_lonlat(*row.start_lonlat) in line
    for word in ("area bound", "7.6 %", "Unreached", "overlap 10 %"):
        assert word in text


def test_table_takes_markup_as_text():
    plan = make_plan(name="Lake [bold]x[/bold] [/]", assumed={"start": "[red]x[/red]"})
    text = rendered(plan)
    assert "Lake [bold]x[/bold] [/]" in text
    assert "[red]x[/red]" in text


@pytest.mark.parametrize("width", [80, 105, 106, 200])
def test_table_fits_any_terminal(width):
    plan = make_plan(robots=12, swath_m=5.0)
    text = rendered(plan, width=width)
    assert max(map(len, text.splitlines())) <= width
    assert "…" not in text.replace("… survey legs", "").replace("… as a share", "")
    for row in plan.report.robots:
        assert units.human_lonlat(*row.start_lonlat) in " ".join(text.split())


@pytest.mark.parametrize("width", [80, 200])
def test_names_stand_beside_numbers_where_robots_have_them(width):
    plan = make_plan(robots=3)
    rows = plan.report.robots
    named = (rows[0], dataclasses.replace(rows[1], name="Otter 1"), rows[2])
    plan = dataclasses.replace(plan, report=dataclasses.replace(plan.report, robots=named))
    text = " ".join(rendered(plan, width=width).split())
    assert "2 Otter 1" in text
    if width == 80:
        own = units.human_lonlat(*rows[1].start_lonlat)
        assert f"2 Otter 1: {own}" in text
        assert f"3: {units.human_lonlat(*rows[2].start_lonlat)}" in text


@pytest.mark.parametrize("width", [80, 200])
def test_trips_and_fences_fit_beside_each_other(width):
    plan = make_plan(robots=2)
    rows = tuple(
        dataclasses.replace(
            row, sorties=2 * row.trips, fence_points=81, length_m=45_670.0, survey_m=30_000.0,
            transit_m=15_670.0, duration_s=40_000.0,
        )
        for row in plan.report.robots
    )  # fmt: skip
    plan = dataclasses.replace(plan, report=dataclasses.replace(plan.report, robots=rows))
    lines = rendered(plan, width=width).splitlines()
    (line,) = [entry for entry in lines if "■ 2 " in entry]
    for text in ("81 pts", units.human_length(45_670.0), units.human_duration(40_000.0)):
        assert text in line
    assert (units.human_length(15_670.0) in line) == (width > 80)


def test_longest_robot_is_marked():
    plan = make_plan(robots=3)
    stream = io.StringIO()
    Console(file=stream, width=120, force_terminal=True, color_system="truecolor").print(
        fleet_table(plan)
    )
    longest = max(plan.report.robots, key=lambda row: row.duration_s).robot
    bold = [line for line in stream.getvalue().splitlines() if "■" in line and "\x1b[1" in line]
    assert len(bold) == 1
    assert f"■ {longest}" in bold[0]


def test_json_has_every_field():
    plan = make_plan(robots=2)
    content = json.loads(report_text(plan))
    for field in dataclasses.fields(FleetReport):
        assert field.name in content
    for row in content["robots"]:
        assert set(row) == {field.name for field in dataclasses.fields(RobotReport)}
    assert content["makespan_s"] == plan.report.makespan_s
    assert content["area"]["name"] == "Test lake"
    assert list(content) == sorted(content)


def test_json_is_stable_and_knows_no_nan():
    changes = {"gap": math.nan, "lower_bound_s": math.inf, "coverage": np.float64(0.5)}
    plan = make_plan(options={"b": np.array([1, 2]), "a": (None, True)}, **changes)
    assert report_text(plan) == report_text(
        make_plan(options={"a": (None, True), "b": [1, 2]}, **changes)
    )
    content = report_json(plan)
    assert content["gap"] is None
    assert content["lower_bound_s"] is None
    assert content["coverage"] == 0.5
    assert content["options"] == {"a": [None, True], "b": [1, 2]}
    rendered(plan)


def test_plain_refuses_what_has_no_json():
    with pytest.raises(TypeError, match="no JSON form for object"):
        plain({"a": object()})


def test_summary():
    plan = make_plan(robots=4)
    text = "\n".join(summary_lines(plan))
    assert "4 robots" in text
    assert "not reached from the start" in text
    assert "without work" not in text
    assert "without work: robot 2" in "\n".join(
        summary_lines(make_plan(robots=2, swath_m=1200.0))
    ) or "without work: robot 1" in "\n".join(summary_lines(make_plan(robots=2, swath_m=1200.0)))


@pytest.mark.parametrize(
    ("share", "text"),
    [
        (0.0, "0.00 %"), (0.29, "29.00 %"), (0.999999, "99.99 %"), (1.0, "100 %"),
        (1 - 1e-12, "99.99 %"), (math.nan, "–"),
    ],
)  # fmt: skip
def test_share_never_flatters(share, text):
    assert units.human_share(share) == text


@pytest.mark.parametrize(
    ("seconds", "text"),
    [
        (0, "0 s"), (59.4, "59 s"), (59.6, "1 min 00 s"), (3599.4, "59 min 59 s"),
        (3599.6, "1 h 00 min"), (7199, "2 h 00 min"), (90061, "25 h 01 min"), (math.inf, "–"),
    ],
)  # fmt: skip
def test_durations(seconds, text):
    assert units.human_duration(seconds) == text


@pytest.mark.parametrize(
    ("metres", "text"),
    [
        (0.0, "0 m"), (3.25, "3.2 m"), (999.4, "999 m"), (999.6, "1.00 km"), (99_994, "99.99 km"),
        (123_456, "123 km"), (math.nan, "–"),
    ],
)  # fmt: skip
def test_lengths(metres, text):
    assert units.human_length(metres) == text


@pytest.mark.parametrize(
    ("name", "value", "expected"),
    [
        ("survey_speed_m_s", 2.0, ("survey speed", "2 m/s")),
        ("clearance_m", 10.0, ("clearance from shore", "10 m")),
        ("angle_deg", None, ("angle", "automatic")),
        ("fence", True, ("fence", "yes")),
        ("--swath", "20 m", ("swath", "20 m")),
        ("starts_lonlat", [[1.0, 2.0], [3.0, 4.0]],
         ("start", "1.000000,2.000000, 3.000000,4.000000")),
        ("starts_lonlat", (), ("start", "none")),
        ("method", "crc", ("method", "crc")),
        ("limits", {"rally_points": 50}, ("limits", "rally points 50")),
    ],
)  # fmt: skip
def test_options_as_people_read_them(name, value, expected):
    assert units.human_option(name, value) == expected


def test_the_bound_of_the_chosen_lanes_stands_beside_that_of_any_plan() -> None:
    plan = make_plan(lanes_bound_s=1000.0, lanes_bound_name="packing", lanes_gap=0.0123)
    names = dict(units.fleet_figures(plan.report))
    assert names["Bound for these lanes (packing)"] == units.human_duration(1000.0)
    assert names["Gap to these lanes' bound"] == units.human_gap(0.0123)
    assert names["Gap to any plan's bound"] == units.human_gap(plan.report.gap)
    assert "none with these lanes and cuts" in "\n".join(summary_lines(plan))
    assert "these lanes" not in str(units.fleet_figures(make_plan().report))


def test_a_small_chance_is_not_told_as_none() -> None:
    assert human_chance(0.001) == "below 1%"
    assert human_chance(0.006) == "1%"
    assert human_chance(0.36) == "36%"

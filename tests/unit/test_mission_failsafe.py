"""The straight way home, and what the report says of it."""

from __future__ import annotations

import dataclasses
import json

import numpy as np
import pytest
import shapely

from mrmission.mission.failsafe import (
    SAMPLES,
    failsafe_notes,
    failsafe_report,
    recommended_action,
    straight_ways,
)
from mrmission.model import SurveyArea
from mrmission.options import PlanOptions
from mrmission.pipeline import plan
from mrmission.report.metrics import report_json

HOME = np.array([10.0, 10.0])
OPEN = shapely.box(0, 0, 200, 100)
ISLAND = shapely.box(40, 0, 60, 20)
LAKE = OPEN - ISLAND


class Degrees:
    """A frame in which a metre is a degree."""

    def to_lonlat(self, points_m: np.ndarray) -> np.ndarray:
        return points_m


def test_open_water_has_no_bad_way_home() -> None:
    ways = straight_ways(np.array([[10.0, 10], [190, 90], [10, 90]]), HOME, OPEN)
    assert (ways.share, ways.outside_m, ways.worst_m) == (0.0, 0.0, None)
    assert ways.farthest_m == pytest.approx(np.hypot(180, 80))


def test_the_share_and_the_longest_stretch_are_those_of_the_geometry() -> None:
    # from x = 110 the ways cross the island until they pass above its near corner (40, 20)
    ways = straight_ways(np.array([[110.0, 10], [110, 95]]), HOME, LAKE)
    assert ways.share == pytest.approx(100 * 10 / 30 / 85, abs=1.5 / SAMPLES)
    # the longest stretch is the steepest that still crosses the whole width: to (60, 20)
    assert 20.0 < ways.outside_m <= 20 * np.hypot(50, 10) / 50
    assert ways.worst_m is not None
    assert ways.worst_m[0] == pytest.approx(110)


def test_a_way_along_the_edge_stays_inside() -> None:
    ways = straight_ways(np.array([[0.0, 0], [200, 0]]), np.array([0.0, 0.0]), OPEN)
    assert ways.share == 0.0


def test_a_robot_that_stays_home_has_no_way_home() -> None:
    for path in (np.zeros((0, 2)), HOME[None], np.array([HOME, HOME])):
        ways = straight_ways(path, HOME, LAKE)
        assert (ways.share, ways.farthest_m) == (0.0, 0.0)


def test_the_action_never_falls_back_on_the_straight_way_where_that_crosses_land() -> None:
    assert recommended_action(0.0) == 1
    assert {recommended_action(share) for share in (1 / SAMPLES, 0.5, 1.0)} == {4}


def test_the_note_names_shares_robots_and_the_worst_place() -> None:
    good = straight_ways(np.array([[10.0, 10], [10, 90]]), HOME, LAKE)
    some = straight_ways(np.array([[110.0, 10], [110, 95]]), HOME, LAKE)
    every = straight_ways(np.array([[110.0, 10], [110, 12]]), HOME, LAKE)
    assert failsafe_notes(failsafe_report({1: good}, Degrees())) == ()
    (note,) = failsafe_notes(failsafe_report({1: good, 2: some, 4: every}, Degrees()))
    assert "39% to 100% of the way of robots 2, 4" in note
    assert "robot 2" in note
    assert "110.00000" in note
    assert "4 (SmartRTL or hold)" in note


def test_the_report_of_a_plan_has_the_section_and_a_copter_none() -> None:
    shore = [(11.2, 47.8), (11.208, 47.8), (11.208, 47.804), (11.2, 47.804)]
    island = [(11.2025, 47.8005), (11.204, 47.8005), (11.204, 47.8035), (11.2025, 47.8035)]
    area = SurveyArea(
        name="ring", source="ring",
        water_lonlat=shapely.MultiPolygon([shapely.Polygon(shore, [island])]),
    )  # fmt: skip
    options = PlanOptions(robots=2, swath_m=40.0, clearance_m=6.0)
    found = plan(area, options)
    rows = json.loads(json.dumps(report_json(found)))["failsafe"]["straight_returns"]
    assert [row["robot"] for row in rows] == [1, 2]
    assert any(row["share_over_land"] > 0.1 and row["fence_action"] == 4 for row in rows)
    worst = max(rows, key=lambda row: row["longest_over_land_m"])
    assert 50 < worst["longest_over_land_m"] < 400
    assert 11.2 < worst["worst_lonlat"][0] < 11.208
    assert any("straight return home crosses land" in note for note in found.report.notes)
    flown = plan(area, dataclasses.replace(options, vehicle="copter"))
    assert flown.report.failsafe.straight_returns == ()

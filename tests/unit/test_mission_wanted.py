"""What a vehicle's parameters should be, and what the notes of a plan say of it."""

from __future__ import annotations

import math

import numpy as np
import pytest

from mrmission.mission.items import build_items
from mrmission.mission.wanted import mission_altitude_m, vehicle_notes, wanted_parameters
from mrmission.model import FencePolygon, Mission
from mrmission.options import PlanOptions

PATH = np.array([[8.0, 47.0], [8.001, 47.0], [8.001, 47.001], [8.0, 47.0]])
RING = np.array([[469990000, 79990000], [470020000, 79990000], [470020000, 80020000]])


def mission(fenced: bool = True, **options: object) -> Mission:
    chosen = PlanOptions(**options)  # type: ignore[arg-type]
    items, kind, lane = build_items(PATH, np.array([0, 1, 0]), np.array([0, 1, 0]), chosen)
    fence = (FencePolygon(inclusion=True, points_e7=RING),) if fenced else ()
    return Mission(
        robot=1, sortie=1, vehicle=chosen.vehicle, items=items, fence=fence, rally=(),
        kind=kind, lane=lane,
    )  # fmt: skip


def values(what: Mission) -> dict[str, float]:
    return {w.name: w.value for w in wanted_parameters(what)}


def test_a_copter_wants_a_ceiling_above_its_flight() -> None:
    wanted = {w.name: w for w in wanted_parameters(mission(vehicle="copter", altitude_m=30.5))}
    assert {n: w.value for n, w in wanted.items()} == {
        "FENCE_ENABLE": 1, "FENCE_TYPE": 5, "FENCE_ALT_MAX": 41, "RTL_ALT": 3100,
        "RTL_ALT_FINAL": 0,
    }  # fmt: skip
    assert not wanted["FENCE_ALT_MAX"].holds(31.0)
    assert wanted["FENCE_ALT_MAX"].holds(120.0)
    assert not wanted["RTL_ALT"].holds(1500.0)
    assert not wanted["RTL_ALT"].holds(4000.0)  # the fence would stop it at 39 m
    assert all(w.low <= w.value <= w.high and w.reason for w in wanted.values())


def test_above_terrain_the_ceiling_above_home_is_left_out() -> None:
    found = values(mission(vehicle="copter", altitude_above="terrain"))
    assert found["FENCE_TYPE"] == 4
    assert "FENCE_ALT_MAX" not in found
    assert found["TERRAIN_ENABLE"] == 1


def test_without_a_fence_nothing_is_said_of_it() -> None:
    found = values(mission(fenced=False, vehicle="copter"))
    assert not any(name.startswith("FENCE") for name in found)
    rtl = wanted_parameters(mission(fenced=False, vehicle="copter"))[0]
    assert (rtl.name, rtl.high) == ("RTL_ALT", math.inf)


@pytest.mark.parametrize(("vehicle", "behave"), [("boat", 1), ("rover", 0)])
def test_on_the_ground_the_end_of_the_mission_is_a_parameter(vehicle: str, behave: int) -> None:
    found = values(mission(vehicle=vehicle))
    assert found == {"FENCE_ENABLE": 1, "FENCE_TYPE": 4, "MIS_DONE_BEHAVE": behave}


def test_a_robot_without_work_wants_nothing() -> None:
    idle = Mission(robot=1, sortie=1, vehicle="copter", items=(), fence=(), rally=())
    assert wanted_parameters(idle) == ()
    assert vehicle_notes(idle, PlanOptions(vehicle="copter"), 15.0) == []


def test_the_highest_waypoint_counts_and_home_does_not() -> None:
    assert mission_altitude_m(mission(vehicle="copter", altitude_m=44)) == 44
    assert mission_altitude_m(mission(vehicle="boat")) == 0


def test_notes_name_the_settings_and_the_launch() -> None:
    options = PlanOptions(vehicle="copter", turnaround_m=25, altitude_above="terrain")
    notes = vehicle_notes(mission(vehicle="copter", altitude_above="terrain"), options, 15.0)
    assert notes[0].startswith("set on every copter: FENCE_ENABLE 1, FENCE_TYPE 4")
    assert any("launch from the shore" in n and "15 m" in n for n in notes)
    assert any("terrain data" in n for n in notes)
    assert any("15 m over the shore" in n for n in notes)
    assert vehicle_notes(mission(vehicle="boat"), PlanOptions(), 15.0) == []
    (note,) = vehicle_notes(mission(vehicle="rover"), PlanOptions(vehicle="rover"), 15.0)
    assert "MIS_DONE_BEHAVE 0" in note

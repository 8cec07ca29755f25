"""What docs/failsafes.md recommends, in ArduRover: each test is one claim of that page.

What both engines do at a breach is in test_behaviour_fence.py; here is what the light boat does
not imitate: SmartRTL's memory, path planning, current.
"""

from __future__ import annotations

import math
from collections.abc import Callable

import pytest
from seatrial import AUTO, FENCE, HOLD, RTL, SMART_RTL, Trial
from sim_client import waypoint

from mrmission.simulate.storage import EXCLUSION, INCLUSION, Item
from mrmission.simulate.wire import mavlink

pytestmark = [
    pytest.mark.ardupilot,
    pytest.mark.timeout(900),
    pytest.mark.parametrize("trial_of", ["ardupilot"], indirect=True),
]
TrialOf = Callable[..., Trial]
FENCED = {"FENCE_ENABLE": 1.0, "AVOID_ENABLE": 0.0}
CURRENT_FROM_EAST = {"SIM_TIDE_DIR": 90.0}
FAILED = mavlink.MAV_RESULT_FAILED


def box(south: float, north: float, west: float, east: float, command: int = INCLUSION) -> list:
    corners = ((south, west), (north, west), (north, east), (south, east))
    return [waypoint(n, e, command=command, frame=0, param1=4.0) for n, e in corners]


def short_lanes(count: int) -> list[Item]:
    """Lanes of 30 m, 10 m apart."""
    ends = [((20, 50), (50, 20))[n % 2] for n in range(count)]
    return [waypoint(north, 20 + 10 * n) for n, pair in enumerate(ends) for north in pair]


def distances(trial: Trial, seconds: float, north: float, east: float) -> list[float]:
    return [math.hypot(e - east, n - north) for _, e, n in trial.track(seconds)]


def breached(trial: Trial) -> int:
    """Wait until a breach takes the boat out of AUTO; return the mode that it goes to."""
    m = trial.first(lambda m: m.get_type() == "HEARTBEAT" and m.custom_mode != AUTO, 240.0)
    assert m is not None, "; ".join(trial.texts())
    return int(m.custom_mode)


# --- SmartRTL ---


def test_smart_rtl_comes_back_by_the_track_and_not_over_the_island(trial_of: TrialOf) -> None:
    trial = trial_of(WP_SPEED=3.0, FENCE_ACTION=4.0, **FENCED)
    fence = [*box(-60, 100, -60, 60), *box(30, 50, -30, 30, EXCLUSION)]
    assert trial.upload(fence, FENCE) == 0
    trial.wait(2.0)
    trial.sail([waypoint(0, 50), waypoint(90, 50), waypoint(90, 0), waypoint(200, 0)])
    assert breached(trial) == SMART_RTL
    back = trial.track(90.0)
    assert not any(abs(e) < 30.0 and 30.0 < n < 50.0 for _, e, n in back)
    # by way of the corners it went round
    assert min(math.hypot(e - 50, n - 90) for _, e, n in back) < 5.0
    assert min(math.hypot(e - 50, n) for _, e, n in back) < 5.0


def test_smart_rtl_gives_up_when_its_points_are_used_up_and_action_4_holds(
    trial_of: TrialOf,
) -> None:
    trial = trial_of(WP_SPEED=3.0, SRTL_POINTS=20.0, FENCE_ACTION=4.0, **FENCED)
    assert trial.upload(box(-60, 100, -60, 200), FENCE) == 0
    trial.wait(2.0)
    trial.sail([*short_lanes(8), waypoint(40, 400)])
    assert trial.until_said("SmartRTL deactivated: buffer full", 240.0), trial.texts()
    assert trial.said("SmartRTL Low on space!")
    assert trial.change_mode(SMART_RTL) == FAILED
    assert breached(trial) == HOLD


# --- path planning ---


@pytest.mark.parametrize(("path_planning", "over"), [(0.0, True), (2.0, False)])
def test_a_return_crosses_an_island_unless_path_planning_is_on(
    trial_of: TrialOf, path_planning: float, over: bool
) -> None:
    trial = trial_of(WP_SPEED=3.0, FENCE_ACTION=0.0, OA_TYPE=path_planning, **FENCED)
    fence = [*box(-60, 140, -80, 80), *box(30, 60, -30, 30, EXCLUSION)]
    assert trial.upload(fence, FENCE) == 0
    trial.wait(2.0)
    trial.sail([waypoint(0, 60), waypoint(100, 60), waypoint(100, 0)])
    trial.until_reached(3, 240.0)
    trial.change_mode(RTL)
    back = trial.track(80.0)
    assert any(abs(e) < 28.0 and 32.0 < n < 58.0 for _, e, n in back) is over
    assert trial.until_said("Reached destination", 120.0)


# --- current ---


def test_hold_drifts_and_loiter_of_a_boat_that_pivots_does_not(trial_of: TrialOf) -> None:
    trial = trial_of(
        model="motorboat-skid", SIM_TIDE_SPEED=0.3, MIS_DONE_BEHAVE=1.0, **CURRENT_FROM_EAST
    )
    trial.sail([waypoint(40, 0)])
    assert trial.until_said("Mission Complete", 240.0)
    assert max(distances(trial, 120.0, 40, 0)) < 5.0
    trial.change_mode(HOLD)
    trial.wait(60.0)
    east, _ = trial.place()
    assert -30.0 < east < -10.0


def test_a_steered_boat_holds_its_place_bow_first(trial_of: TrialOf) -> None:
    trial = trial_of(SIM_TIDE_SPEED=0.3, MIS_DONE_BEHAVE=1.0, LOIT_TYPE=1.0, **CURRENT_FROM_EAST)
    trial.sail([waypoint(100, 0), waypoint(100, 20), waypoint(60, 20)])
    assert trial.until_said("Mission Complete", 240.0)
    # bow or stern first, as by default, it was 21 m off after five minutes
    assert max(distances(trial, 300.0, 60, 20)) < 8.0


def test_path_planning_finds_no_way_back_from_outside_the_fence(trial_of: TrialOf) -> None:
    trial = trial_of(
        SIM_TIDE_SPEED=0.6, SIM_TIDE_DIR=270.0, OA_TYPE=2.0, FENCE_ACTION=1.0, **FENCED
    )
    assert trial.upload(box(-60, 140, -60, 60), FENCE) == 0
    trial.wait(2.0)
    trial.sail([waypoint(60, 0), waypoint(60, 50)])
    trial.until_reached(2, 240.0)
    trial.change_mode(HOLD)
    left = trial.first(lambda m: m.get_type() == "HEARTBEAT" and m.custom_mode == RTL, 120.0)
    assert left is not None
    assert trial.until_said("Dijkstra: could not find path", 30.0)
    trial.wait(60.0)
    assert trial.place()[0] > 85.0

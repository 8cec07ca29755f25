"""Modes, arming and what a mission's items do: the light boat and ArduRover alike."""

from __future__ import annotations

import math
from collections.abc import Callable

import pytest
from seatrial import (
    ACCEPTED,
    ARM,
    AUTO,
    GUIDED,
    HOLD,
    LOITER,
    MANUAL,
    RALLY,
    RTL,
    STATION,
    Trial,
    home,
)
from sim_client import HOME, waypoint

from mrmission.simulate.storage import Item
from mrmission.simulate.wire import mavlink

FAILED = mavlink.MAV_RESULT_FAILED
DENIED = mavlink.MAV_RESULT_DENIED
BRISK = {"WP_SPEED": 4.0, "WP_RADIUS": 2.0}
TrialOf = Callable[..., Trial]


def do(command: int, *params: float) -> Item:
    return Item(command, 2, *[*params, 0.0, 0.0, 0.0, 0.0][:4], 0, 0, 0.0)  # type: ignore[arg-type]


def speed_to(speed_m_s: float) -> Item:
    return do(178, 1, speed_m_s, -1)


def metres(place: tuple[float, float], other: tuple[float, float]) -> float:
    return math.hypot(place[0] - other[0], place[1] - other[1])


# --- getting ready ---


def test_it_starts_disarmed_in_its_initial_mode(trial_of: TrialOf) -> None:
    trial = trial_of(cold=True, INITIAL_MODE=0)
    # Its first heartbeats tell of a mode of their own, INITIALISING.
    trial.wait(6.0)
    assert (trial.armed(), trial.mode()) == (False, MANUAL)


def test_from_manual_a_station_gets_it_into_hold_only(trial_of: TrialOf) -> None:
    trial = trial_of(cold=True, INITIAL_MODE=0)
    trial.wait(6.0)
    assert trial.upload([HOME, waypoint(50, 0)]) == 0
    for mode in (AUTO, LOITER, GUIDED, RTL):
        assert trial.change_mode(mode) == FAILED
    assert trial.until_said("Mode change from MANUAL to AUTO denied", 2.0)
    assert trial.change_mode(HOLD) == ACCEPTED
    assert trial.mode() == HOLD


def test_armable_after_half_a_minute_and_startable_some_time_later(trial_of: TrialOf) -> None:
    trial = trial_of(cold=True, **BRISK)
    while trial.upload([HOME, waypoint(50, 0)]) != 0:
        assert trial.now_s < 10.0
        trial.wait(0.5)
    assert trial.command(ARM, 1) == FAILED
    trial.arm(40.0)
    armed_s = trial.now_s
    trial.start(40.0)
    assert 15.0 <= armed_s <= 35.0
    assert 33.0 <= trial.now_s <= 50.0
    assert trial.said("Flight mode change failed")


def test_for_its_first_seconds_it_has_no_room_for_a_mission(trial_of: TrialOf) -> None:
    trial = trial_of(cold=True, hasty=True)
    assert trial.upload([HOME, waypoint(50, 0)]) == mavlink.MAV_MISSION_NO_SPACE
    trial.greet()
    trial.wait(4.0)
    assert trial.upload([HOME, waypoint(50, 0)]) == 0


# --- modes ---


def test_auto_without_a_mission_is_refused(trial: Trial) -> None:
    assert trial.change_mode(AUTO) == FAILED
    assert trial.until_said("No Mission. Can't set AUTO.", 2.0)
    assert trial.change_mode(99) == FAILED
    assert trial.mode() == HOLD


def test_arming_and_disarming(trial: Trial) -> None:
    trial.arm()
    assert trial.until_said("Throttle armed", 2.0)
    assert trial.command(ARM, 1) == ACCEPTED
    assert trial.command(ARM, 0) == ACCEPTED
    assert not trial.armed()
    assert trial.until_said("Throttle disarmed", 2.0)


def test_an_armed_boat_is_not_rebooted(trial: Trial) -> None:
    trial.arm()
    assert trial.command(mavlink.MAV_CMD_PREFLIGHT_REBOOT_SHUTDOWN, 1) == FAILED


def test_a_mission_is_sailed_in_order_and_its_end_is_said(trial_of: TrialOf) -> None:
    trial = trial_of(**BRISK)
    square = [waypoint(30, 0), waypoint(30, 30), waypoint(0, 30)]
    trial.sail(square)
    trial.until_reached(3, 90.0)
    trial.wait(2.0)
    assert trial.reached() == [1, 2, 3]
    assert trial.said("Reached waypoint #2")
    assert trial.said("Mission Complete")
    assert trial.mode() == AUTO
    current = trial.last("MISSION_CURRENT")
    assert (current.seq, current.total) == (3, 3)
    assert current.mission_state == mavlink.MISSION_STATE_COMPLETE
    assert metres(trial.place(), (30, 0)) < 4.0


def test_hold_and_auto_again_resumes_at_the_same_item(trial_of: TrialOf) -> None:
    trial = trial_of(**BRISK)
    trial.sail([waypoint(30, 0), waypoint(30, 60), waypoint(0, 60)])
    trial.until_reached(1, 60.0)
    trial.wait(3.0)
    assert trial.current() == 2
    assert trial.change_mode(HOLD) == ACCEPTED
    trial.wait(5.0)
    assert trial.change_mode(AUTO) == ACCEPTED
    trial.wait(2.0)
    assert trial.current() == 2
    trial.until_reached(3, 90.0)
    assert trial.reached() == [1, 2, 3]


def test_the_item_to_go_on_with_can_be_chosen(trial_of: TrialOf) -> None:
    trial = trial_of(**BRISK)
    assert trial.upload([home(), *(waypoint(20.0 * i, 0) for i in range(1, 5))]) == 0
    choose = mavlink.MAV_CMD_DO_SET_MISSION_CURRENT
    assert trial.command(choose, 3) == ACCEPTED
    assert trial.command(choose, 5) == DENIED
    trial.arm()
    trial.start()
    trial.wait(2.0)
    assert trial.current() == 3
    trial.send(mavlink.MAVLink_mission_set_current_message(trial.system_id, 1, 2))
    trial.wait(2.0)
    assert trial.current() == 2


def test_disarming_outside_auto_resets_the_mission(trial_of: TrialOf) -> None:
    trial = trial_of(**BRISK)
    trial.sail([waypoint(20, 0), waypoint(60, 0), waypoint(100, 0)])
    trial.until_reached(1, 60.0)
    assert trial.change_mode(HOLD) == ACCEPTED
    trial.wait(2.0)
    assert trial.command(ARM, 0) == ACCEPTED
    trial.wait(1.0)
    assert trial.current() == 0


def test_a_moving_boat_can_be_disarmed(trial_of: TrialOf) -> None:
    trial = trial_of(**BRISK)
    trial.sail([waypoint(200, 0)])
    trial.wait(10.0)
    assert trial.speed_m_s() > 2.0
    assert trial.command(ARM, 0) == ACCEPTED


# --- items ---


def test_a_change_of_speed_as_first_item_is_ignored_and_later_obeyed(trial_of: TrialOf) -> None:
    trial = trial_of(WP_SPEED=3.0, WP_RADIUS=2.0)
    trial.sail([speed_to(1.5), waypoint(60, 0), speed_to(1.5), waypoint(160, 0)])
    trial.wait(14.0)
    assert trial.speed_m_s() == pytest.approx(3.0, abs=0.3)
    assert trial.said("Mission: 1 ChangeSpeed")
    assert not trial.said("speed: 1.5 m/s")
    trial.until_reached(3, 60.0)
    assert trial.until_said("speed: 1.5 m/s", 3.0)
    trial.wait(10.0)
    assert trial.speed_m_s() == pytest.approx(1.5, abs=0.2)


def test_an_item_reached_is_not_told_when_a_command_follows_that_is_done_at_once(
    trial_of: TrialOf,
) -> None:
    trial = trial_of(**BRISK)
    trial.sail([waypoint(20, 0), speed_to(3.0), speed_to(4.0), waypoint(40, 0), waypoint(60, 0)])
    trial.until_reached(5, 60.0)
    assert trial.said("Reached waypoint #1")
    assert trial.reached() == [2, 3, 4, 5]
    begun = [text for text in trial.texts() if text.startswith("Mission: ")]
    assert begun == [
        "Mission: 1 WP", "Mission: 2 ChangeSpeed", "Mission: 4 WP", "Mission: 3 ChangeSpeed",
        "Mission: 5 WP",
    ]  # fmt: skip


def test_commands_for_others_are_passed_over(trial_of: TrialOf) -> None:
    trial = trial_of(**BRISK)
    flying = [waypoint(50, 50, command=command) for command in (22, 82, 21)]
    trial.sail([*flying, waypoint(30, 0)])
    trial.until_reached(4, 60.0)
    for number, name in enumerate(("Takeoff", "SplineWP", "Land"), 1):
        assert trial.said(f"Mission: {number} {name}")
    assert trial.reached() == [4]
    assert abs(trial.place()[0]) < 4.0


def test_the_camera_is_triggered_by_distance(trial_of: TrialOf) -> None:
    trial = trial_of(CAM1_TYPE=1, **BRISK)
    trial.sail([waypoint(20, 0), do(206, 10.0), waypoint(100, 0), do(206, 0.0), waypoint(140, 0)])
    trial.until_reached(5, 90.0)
    shots = [m for m in trial.heard if m.get_type() == "CAMERA_FEEDBACK"]
    assert 7 <= len(shots) <= 9


def test_loiter_unlimited_stays_and_never_ends(trial_of: TrialOf) -> None:
    trial = trial_of(**BRISK)
    trial.sail([waypoint(40, 0, command=17), waypoint(200, 0)])
    assert trial.until_said("Reached waypoint #1", 60.0)
    trial.wait(15.0)
    track = trial.track(120.0)
    assert trial.reached() == []
    assert trial.current() == 1
    assert max(metres((e, n), (0, 40)) for _, e, n in track) < 4.5


def test_waiting_at_a_waypoint_and_nav_delay(trial_of: TrialOf) -> None:
    trial = trial_of(**BRISK)
    trial.sail([waypoint(20, 0, param1=10.0), waypoint(40, 0), do(93, 10.0), waypoint(60, 0)])
    assert trial.until_said("Reached waypoint #1. Loiter for 10 seconds", 30.0)
    there_s = trial.now_s
    assert trial.until_reached(1, 30.0) - there_s == pytest.approx(10.0, abs=1.5)
    trial.until_reached(2, 30.0)
    there_s = trial.now_s
    assert trial.until_said("Delaying 10 sec", 3.0)
    assert trial.until_reached(3, 30.0) - there_s == pytest.approx(10.0, abs=1.5)


def test_jumps_are_counted(trial_of: TrialOf) -> None:
    trial = trial_of(**BRISK)
    trial.sail([waypoint(20, 0), waypoint(40, 0), do(177, 1, 1), waypoint(60, 0)])
    trial.until_reached(4, 120.0)
    assert trial.reached() == [1, 2, 1, 2, 4]


def test_return_to_launch_goes_straight_back(trial_of: TrialOf) -> None:
    trial = trial_of(**BRISK)
    trial.sail([waypoint(0, 40), waypoint(40, 40), do(20), waypoint(100, 100)])
    trial.until_reached(2, 90.0)
    trial.wait(7.0)
    track = trial.track(12.0)
    # From (40, 40) to home: as far east as north, give or take where home was set.
    assert max(abs(east - north) for _, east, north in track) < 9.0
    trial.until_reached(3, 60.0)
    assert metres(trial.place(), (0, 0)) < 9.0


@pytest.mark.parametrize("behave", [0, 1])
def test_what_follows_the_end_of_a_mission(trial_of: TrialOf, behave: int) -> None:
    trial = trial_of(MIS_DONE_BEHAVE=behave, **BRISK)
    trial.sail([waypoint(40, 0)])
    trial.until_reached(1, 60.0)
    trial.wait(20.0)
    assert trial.mode() == AUTO
    track = trial.track(30.0)
    assert max(metres((e, n), (0, 40)) for _, e, n in track) < 6.0
    assert trial.speed_m_s() < 0.4


# --- a change on the water ---


def test_a_boat_in_auto_takes_a_new_mission_and_steers_for_the_same_number(
    trial_of: TrialOf,
) -> None:
    trial = trial_of(**BRISK)
    trial.sail([waypoint(200, 0), waypoint(200, 50)])
    trial.wait(10.0)
    east_0, _ = trial.place()
    assert trial.upload([home(), waypoint(40, -200), waypoint(40, -210)]) == 0
    assert trial.until_said("Auto mission changed, restarted command", 3.0)
    trial.wait(12.0)
    east, _ = trial.place()
    assert east < east_0 - 10.0
    assert trial.current() == 1
    assert trial.mode() == AUTO


def test_the_safe_order_loiter_upload_current_auto(trial_of: TrialOf) -> None:
    trial = trial_of(**BRISK)
    trial.sail([waypoint(200, 0), waypoint(200, 50)])
    trial.wait(10.0)
    assert trial.change_mode(LOITER) == ACCEPTED
    assert trial.upload([home(), waypoint(0, -50), waypoint(0, 80)]) == 0
    trial.wait(3.0)
    assert not trial.said("Auto mission changed")
    assert trial.command(mavlink.MAV_CMD_DO_SET_MISSION_CURRENT, 2) == ACCEPTED
    assert trial.change_mode(AUTO) == ACCEPTED
    trial.until_reached(2, 90.0)
    assert trial.reached() == [2]


def test_a_mission_that_runs_is_not_cleared(trial_of: TrialOf) -> None:
    trial = trial_of(**BRISK)
    trial.sail([waypoint(200, 0)])
    trial.wait(3.0)
    assert trial.clear() == mavlink.MAV_MISSION_ERROR
    assert trial.stored_count() == 2


# --- home and rally points ---


def test_rtl_goes_to_the_nearest_rally_point_within_its_limit(trial_of: TrialOf) -> None:
    trial = trial_of(RALLY_LIMIT_KM=0.1, **BRISK)
    rally = [waypoint(50, 40, command=5100), waypoint(190, 0, command=5100)]
    assert trial.upload(rally, RALLY) == 0
    trial.sail([waypoint(80, 0), waypoint(300, 0)])
    trial.until_reached(1, 60.0)
    assert trial.change_mode(RTL) == ACCEPTED
    assert trial.until_said("Reached destination", 60.0)
    assert metres(trial.place(), (40, 50)) < 4.5


def test_beyond_the_limit_home_is_taken(trial_of: TrialOf) -> None:
    trial = trial_of(RALLY_LIMIT_KM=0.1, RALLY_INCL_HOME=0, **BRISK)
    assert trial.upload([waypoint(300, 0, command=5100)], RALLY) == 0
    trial.sail([waypoint(60, 0), waypoint(90, 0)])
    trial.until_reached(1, 60.0)
    assert trial.change_mode(RTL) == ACCEPTED
    assert trial.until_said("Reached destination", 60.0)
    assert metres(trial.place(), (0, 0)) < 9.0


def test_home_can_be_moved_and_item_zero_follows(trial: Trial) -> None:
    trial.arm()
    assert trial.command(ARM, 0) == ACCEPTED
    there = waypoint(30, 30)
    assert trial.upload([HOME, waypoint(50, 0)]) == 0
    trial.send(
        mavlink.MAVLink_command_int_message(
            trial.system_id, 1, 0, mavlink.MAV_CMD_DO_SET_HOME, 0, 0, 0, 0, 0, 0,
            there.x, there.y, 0.0,
        ),
        who=STATION,
    )  # fmt: skip
    ack = trial.first("COMMAND_ACK", 2.0)
    assert ack is not None
    assert ack.result == ACCEPTED
    trial.wait(1.0)
    first = trial.stored()[0]
    assert (first.x, first.y) == (there.x, there.y)

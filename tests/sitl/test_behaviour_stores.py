"""What a boat keeps of a mission, fence and rally points: the light boat and ArduRover alike."""

from __future__ import annotations

import math
from collections.abc import Callable

import pytest
from seatrial import FENCE, MISSION, OTHER, RALLY, Trial
from sim_client import HOME, LAT, LON, polygon, waypoint

from mrmission.simulate.storage import EXCLUSION, Item
from mrmission.simulate.wire import mavlink

OK = mavlink.MAV_MISSION_ACCEPTED
ERROR = mavlink.MAV_MISSION_ERROR
DENIED = mavlink.MAV_MISSION_DENIED
NO_SPACE = mavlink.MAV_MISSION_NO_SPACE
INVALID_SEQUENCE = mavlink.MAV_MISSION_INVALID_SEQUENCE
CANCELLED = mavlink.MAV_MISSION_OPERATION_CANCELLED
UNSUPPORTED = mavlink.MAV_MISSION_UNSUPPORTED
NAN = math.nan
LANES = [waypoint(10.0 * i, 20.0 * (i % 2)) for i in range(1, 6)]
OTHER_LANES = [waypoint(-10.0 * i, 20.0 * (i % 2)) for i in range(1, 6)]


def places(items: list) -> list[tuple[int, int]]:
    return [(m.x, m.y) for m in items]


def rally_points(count: int) -> list[Item]:
    return [waypoint(5.0 * i, 0, command=5100, frame=3) for i in range(1, count + 1)]


# --- what comes back ---


def test_item_zero_is_the_boats_home_and_the_rest_comes_back_exactly(standing: Trial) -> None:
    assert standing.upload([waypoint(500.0, 500.0, frame=0), *LANES]) == OK
    stored = standing.stored()
    assert places(stored[1:]) == places(LANES)
    assert (stored[0].frame, stored[0].command) == (0, 16)
    assert stored[0].x == pytest.approx(LAT * 1e7, abs=200)
    assert stored[0].y == pytest.approx(LON * 1e7, abs=200)


def test_without_a_home_row_the_first_waypoint_vanishes_and_the_upload_says_ok(
    standing: Trial,
) -> None:
    assert standing.upload(LANES) == OK
    assert places(standing.stored()[1:]) == places(LANES[1:])


def test_the_flag_current_of_a_download_tells_nothing(standing: Trial) -> None:
    assert standing.upload([HOME, *LANES]) == OK
    assert {m.current for m in standing.stored()} == {0}


def test_frames_sent_and_stored(standing: Trial) -> None:
    sent = (0, 5, 3, 6, 10, 11)
    items = [waypoint(10, i, frame=frame, z=12.345) for i, frame in enumerate(sent)]
    assert standing.upload([HOME, *items]) == OK
    stored = standing.stored()[1:]
    assert [m.frame for m in stored] == [0, 0, 3, 3, 10, 10]
    assert [m.z for m in stored] == pytest.approx([12.34] * 6, abs=2e-5)


def test_what_a_waypoint_loses(standing: Trial) -> None:
    full = waypoint(10, 0, param1=3.7, param2=2.0, param3=3.0, param4=NAN)
    assert standing.upload([HOME, full]) == OK
    stored = standing.stored()[1]
    assert (stored.param1, stored.param2, stored.param3, stored.param4) == (3.0, 0.0, 0.0, 0.0)
    assert stored.autocontinue == 1


def test_commands_without_a_place_come_back_in_frame_0(standing: Trial) -> None:
    items = [
        Item(178, 2, 1.0, 3.5, -1.0, 0.0, 0, 0, 0.0),
        Item(206, 2, 7.25, 0.0, 1.0, 0.0, 0, 0, 0.0),
        Item(177, 2, 1.0, 2.0, 0.0, 0.0, 0, 0, 0.0),
    ]
    assert standing.upload([HOME, *items]) == OK
    stored = standing.stored()[1:]
    assert [(m.command, m.frame) for m in stored] == [(178, 0), (206, 0), (177, 0)]
    assert (stored[0].param1, stored[0].param2, stored[0].param3) == (1.0, 3.5, -1.0)
    assert (stored[1].param1, stored[1].param3) == (7.25, 1.0)
    assert (stored[2].param1, stored[2].param2) == (1.0, 2.0)


# --- what is refused ---


@pytest.mark.parametrize(
    ("changes", "result"),
    [
        ({"param1": NAN}, mavlink.MAV_MISSION_INVALID_PARAM1),
        ({"param2": NAN}, mavlink.MAV_MISSION_INVALID_PARAM2),
        ({"param3": NAN}, mavlink.MAV_MISSION_INVALID_PARAM3),
        ({"param4": NAN}, OK),
        ({"param4": math.inf}, mavlink.MAV_MISSION_INVALID_PARAM4),
        ({"z": NAN}, mavlink.MAV_MISSION_INVALID_PARAM7),
        ({"x": 900_000_100}, mavlink.MAV_MISSION_INVALID_PARAM5_X),
        ({"y": 1_800_000_200}, mavlink.MAV_MISSION_INVALID_PARAM6_Y),
        ({"frame": 2}, OK),
        ({"frame": 1}, mavlink.MAV_MISSION_UNSUPPORTED_FRAME),
        ({"frame": 7}, mavlink.MAV_MISSION_UNSUPPORTED_FRAME),
        ({"command": 195}, UNSUPPORTED),
        ({"command": 197}, UNSUPPORTED),
        ({"command": 201}, OK),
        ({"command": 22}, OK),
        ({"command": 21}, OK),
        ({"command": 82}, OK),
    ],
)
def test_items_taken_and_refused(standing: Trial, changes: dict[str, float], result: int) -> None:
    assert standing.upload([HOME, waypoint(10, 0, **changes), waypoint(20, 0)]) == result


def test_what_lies_beyond_a_refused_item_is_a_mixture(standing: Trial) -> None:
    assert standing.upload([HOME, *LANES]) == OK
    wrong = [HOME, *OTHER_LANES[:2], OTHER_LANES[2]._replace(param1=NAN), *OTHER_LANES[3:]]
    assert standing.upload(wrong) == mavlink.MAV_MISSION_INVALID_PARAM1
    assert places(standing.stored()[1:]) == places([*OTHER_LANES[:2], *LANES[2:]])


def test_a_shorter_mission_cuts_the_old_one_before_its_first_item(standing: Trial) -> None:
    assert standing.upload([HOME, *LANES]) == OK
    assert standing.upload([HOME, waypoint(5, 5, param1=NAN)]) != OK
    assert places(standing.stored()[1:]) == places(LANES[:1])


@pytest.mark.parametrize("kind", [MISSION, FENCE, RALLY])
def test_clear_leaves_home_alone(standing: Trial, kind: int) -> None:
    items = {MISSION: [HOME, *LANES], FENCE: polygon(5), RALLY: rally_points(3)}[kind]
    assert standing.upload(items, kind) == OK
    assert standing.stored_count(kind) == len(items)
    assert standing.clear(kind) == OK
    assert standing.stored_count(kind) == 0
    standing.send(mavlink.MAVLink_mission_request_int_message(standing.system_id, 1, 0, kind))
    first = standing.first(lambda m: m.get_type() == "MISSION_ITEM_INT", 1.0)
    assert (first is not None) == (kind == MISSION)


def test_clear_of_all_three_lists_at_once_is_unsupported(standing: Trial) -> None:
    assert standing.upload([HOME, *LANES]) == OK
    assert standing.clear(255) == UNSUPPORTED
    assert standing.stored_count() == 6


# --- limits ---


@pytest.mark.parametrize(("kind", "limit"), [(MISSION, 655), (FENCE, 84), (RALLY, 50)])
def test_the_announcement_of_too_many_items_is_refused_at_once(
    standing: Trial, kind: int, limit: int
) -> None:
    items = {MISSION: [HOME, *LANES], FENCE: polygon(5), RALLY: rally_points(3)}[kind]
    assert standing.upload(items, kind) == OK
    standing.forget()
    standing.send(standing.count_message(limit + 1, kind))
    assert standing.ack(kind) == NO_SPACE
    assert standing.until_said(f"Only {limit} items are supported", 2.0)
    assert standing.stored_count(kind) == len(items)


def test_655_items_fit(standing: Trial) -> None:
    items = [HOME, *(waypoint(i % 100, i // 100) for i in range(654))]
    assert standing.upload(items) == OK
    assert places(standing.stored()[1:]) == places(items[1:])


def test_50_rally_points_fit(standing: Trial) -> None:
    points = rally_points(50)
    assert standing.upload(points, RALLY) == OK
    assert places(standing.stored(RALLY)) == places(points)


def test_83_fence_points_fit_and_84_fail_only_after_the_last_and_leave_the_old_fence(
    standing: Trial,
) -> None:
    old = polygon(83)
    assert standing.upload(old, FENCE) == OK
    standing.forget()
    assert standing.upload(polygon(84), FENCE) == ERROR
    asked = {m.seq for m in standing.heard if m.get_type() == "MISSION_REQUEST"}
    assert max(asked) == 83
    assert standing.until_said("Fence exceeds storage size", 2.0)
    assert places(standing.stored(FENCE)) == places(old)


def test_one_inclusion_and_16_exclusions_of_four_points_fit(standing: Trial) -> None:
    rings = polygon(4)
    for i in range(16):
        rings += [p._replace(x=p.x // 100 * 100 + i) for p in polygon(4, EXCLUSION)]
    # 4 + 17 (2 + 8 * 4) = 582 bytes; with 18 more points in the first ring 4 more than there are.
    assert standing.upload(rings, FENCE) == OK
    assert places(standing.stored(FENCE)) == places(rings)


def test_a_fence_that_is_not_closed_is_refused_and_the_old_one_stays(standing: Trial) -> None:
    assert standing.upload(polygon(5), FENCE) == OK
    standing.forget()
    assert standing.upload(polygon(6)[:-1], FENCE) == ERROR
    assert standing.until_said("Incorrect item count", 2.0)
    assert standing.upload([p._replace(param1=2.0) for p in polygon(2)], FENCE) == ERROR
    assert standing.stored_count(FENCE) == 5


# --- transfers that go wrong ---


def test_a_broken_upload_holds_the_list_for_eight_seconds_and_leaves_a_mixture(
    standing: Trial,
) -> None:
    assert standing.upload([HOME, *LANES]) == OK
    standing.forget()
    assert standing.upload([HOME, *OTHER_LANES], stop_at=3) is None
    began_s = standing.now_s
    asked = standing.wait(3.5)
    again = [m.seq for m in asked if m.get_type() == "MISSION_REQUEST"]
    assert 2 <= len(again) <= 4
    assert set(again) == {3}
    assert standing.stored_count() == -DENIED
    ack = standing.first(lambda m: m.get_type() == "MISSION_ACK" and m.type == CANCELLED, 8.0)
    assert ack is not None
    assert 7.5 <= standing.now_s - began_s <= 9.5
    assert standing.until_said("Mission upload timeout", 1.0)
    assert places(standing.stored()[1:]) == places([*OTHER_LANES[:2], *LANES[2:]])


def test_nobody_else_may_upload_meanwhile_and_the_same_station_may_start_over(
    standing: Trial,
) -> None:
    assert standing.upload([HOME, *LANES], stop_at=2) is None
    standing.send(standing.count_message(3), who=OTHER)
    assert standing.ack(MISSION) == DENIED
    standing.send(
        mavlink.MAVLink_mission_clear_all_message(standing.system_id, 1, MISSION), who=OTHER
    )
    assert standing.ack(MISSION) == DENIED
    assert standing.ack(MISSION) == ERROR
    assert standing.upload([HOME, *OTHER_LANES]) == OK
    assert places(standing.stored()[1:]) == places(OTHER_LANES)


def test_an_item_that_was_not_asked_for_is_an_invalid_sequence_and_the_transfer_goes_on(
    standing: Trial,
) -> None:
    assert standing.upload([HOME, *LANES], stop_at=2) is None
    standing.send(standing.item_message(1, LANES[0]))
    assert standing.ack(MISSION) == INVALID_SEQUENCE
    asked = standing.first("MISSION_REQUEST", 3.0)
    assert asked is not None
    assert asked.seq == 2
    for seq in range(2, 6):
        standing.send(standing.item_message(seq, LANES[seq - 1]))
    assert standing.ack(MISSION) == OK
    assert places(standing.stored()[1:]) == places(LANES)


def test_an_item_without_a_transfer_is_an_error(standing: Trial) -> None:
    standing.send(standing.item_message(1, LANES[0]))
    assert standing.ack(MISSION) == ERROR


def test_a_fence_upload_that_breaks_off_leaves_the_old_fence(standing: Trial) -> None:
    old = polygon(7)
    assert standing.upload(old, FENCE) == OK
    assert standing.upload(polygon(9), FENCE, stop_at=4) is None
    assert standing.ack(FENCE, 12.0) == CANCELLED
    assert places(standing.stored(FENCE)) == places(old)


def test_the_three_lists_are_locked_one_by_one(standing: Trial) -> None:
    assert standing.upload([HOME, *LANES], stop_at=2) is None
    assert standing.upload(polygon(5), FENCE) == OK
    assert standing.upload(rally_points(2), RALLY) == OK
    assert standing.stored_count(FENCE) == 5


def test_a_part_of_a_mission_can_be_rewritten(standing: Trial) -> None:
    assert standing.upload([HOME, *LANES]) == OK
    standing.send(
        mavlink.MAVLink_mission_write_partial_list_message(standing.system_id, 1, 2, 3, MISSION)
    )
    for seq in (2, 3):
        asked = standing.first("MISSION_REQUEST", 3.0)
        assert asked is not None
        assert asked.seq == seq
        standing.send(standing.item_message(seq, OTHER_LANES[seq - 1]))
    assert standing.ack(MISSION) == OK
    wanted = [LANES[0], *OTHER_LANES[1:3], *LANES[3:]]
    assert places(standing.stored()[1:]) == places(wanted)


# --- parameters and reboot ---


def test_parameters_are_read_set_and_unknown_ones_are_met_with_silence(standing: Trial) -> None:
    assert standing.get("FENCE_RADIUS") == 10_000
    standing.set(WP_SPEED=3.25)
    assert standing.get("WP_SPEED") == 3.25
    assert standing.get("NO_SUCH_THING") is None


def test_defaults_of_a_boat(trial_of: Callable[..., Trial]) -> None:
    trial = trial_of(bare=True)
    wanted = {
        "AVOID_ENABLE": 3, "FENCE_TYPE": 6, "FENCE_RADIUS": 300, "FENCE_ACTION": 1,
        "FENCE_ENABLE": 0, "FENCE_OPTIONS": 0, "MIS_DONE_BEHAVE": 1, "MIS_RESTART": 0,
        "RALLY_INCL_HOME": 1, "RALLY_LIMIT_KM": 0.5, "FS_THR_ENABLE": 1, "FS_ACTION": 2,
        "FS_GCS_ENABLE": 0, "OA_TYPE": 0, "SRTL_POINTS": 300, "BRD_SD_MISSION": 0,
        "WP_SPEED": 2, "WP_RADIUS": 2,
        "BRD_SD_FENCE": 0, "LOIT_RADIUS": 2, "AVOID_MARGIN": 2, "FENCE_MARGIN": 2,
    }  # fmt: skip
    assert {name: trial.get(name) for name in wanted} == pytest.approx(wanted)


def test_a_reboot_keeps_the_three_lists_and_the_parameters(trial: Trial) -> None:
    lists = {MISSION: [HOME, *LANES], FENCE: polygon(5), RALLY: rally_points(3)}
    for kind, items in lists.items():
        assert trial.upload(items, kind) == OK
    trial.set(WP_SPEED=3.25)
    # What is written reaches the storage a moment later.
    trial.wait(3.0)
    trial.reboot()
    assert trial.get("WP_SPEED") == 3.25
    for kind, items in lists.items():
        skip = 1 if kind == MISSION else 0
        assert places(trial.stored(kind))[skip:] == places(items)[skip:]
    assert not trial.armed()

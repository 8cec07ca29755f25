"""The mission protocol, message by message, over the pure vehicle with a virtual clock."""

from __future__ import annotations

import pytest
from sim_client import FENCE, HOME, MISSION, RALLY, Station, content, polygon, waypoint

from mrmission.simulate.storage import EXCLUSION, Item
from mrmission.simulate.transport import Faults
from mrmission.simulate.wire import mavlink

ACCEPTED = mavlink.MAV_MISSION_ACCEPTED


def lanes(count: int, north_m: float = 10.0) -> list[Item]:
    return [HOME, *(waypoint(north_m * i, 5.0 * (i % 2)) for i in range(1, count))]


def rally(count: int) -> list[Item]:
    return [waypoint(i, -i, command=5100) for i in range(count)]


KINDS = [
    pytest.param(MISSION, lanes(12), id="mission"),
    pytest.param(FENCE, polygon(6) + polygon(4, EXCLUSION), id="fence"),
    pytest.param(RALLY, rally(5), id="rally"),
]


@pytest.mark.parametrize(("kind", "items"), KINDS)
def test_upload_and_download(kind: int, items: list[Item]) -> None:
    station = Station()
    assert station.upload(items, kind) == ACCEPTED
    stored = station.download(kind)
    assert isinstance(stored, list)
    assert [(s.command, s.x, s.y) for s in stored] == [(i.command, i.x, i.y) for i in items]
    assert [s.seq for s in stored] == list(range(len(items)))


@pytest.mark.parametrize(("kind", "items"), KINDS)
def test_clear(kind: int, items: list[Item]) -> None:
    station = Station()
    station.upload(items, kind)
    [ack] = station.send(mavlink.MAVLink_mission_clear_all_message(1, 1, kind))
    assert (ack.type, ack.mission_type) == (ACCEPTED, kind)
    assert station.download(kind) == []


def test_clear_of_all_types_at_once_is_unsupported_as_on_ardupilot() -> None:
    station = Station()
    station.upload(lanes(3))
    [ack] = station.send(mavlink.MAVLink_mission_clear_all_message(1, 1, 255))
    assert ack.type == mavlink.MAV_MISSION_UNSUPPORTED
    assert len(station.vehicle.mission.items) == 3


def test_clear_leaves_home_readable() -> None:
    station = Station()
    station.upload(lanes(3))
    station.send(mavlink.MAVLink_mission_clear_all_message(1, 1, MISSION))
    [home] = station.send(mavlink.MAVLink_mission_request_int_message(1, 1, 0, MISSION))
    assert content(home) == HOME


@pytest.mark.parametrize(("kind", "items"), KINDS)
def test_an_empty_upload_clears(kind: int, items: list[Item]) -> None:
    station = Station()
    station.upload(items, kind)
    assert station.upload([], kind) == ACCEPTED
    assert station.download(kind) == []


def test_item_zero_is_the_vehicles_home_whatever_was_sent() -> None:
    station = Station()
    sent = lanes(3)
    sent[0] = waypoint(500, 500)
    assert station.upload(sent) == ACCEPTED
    stored = station.download()
    assert isinstance(stored, list)
    assert content(stored[0]) == HOME
    station.command(mavlink.MAV_CMD_DO_SET_HOME, 0, 0, 0, 0, 47.31, 8.51)
    [home] = station.send(mavlink.MAVLink_mission_request_int_message(1, 1, 0, MISSION))
    # COMMAND_LONG carries single precision: a metre or so.
    assert (home.x, home.y) == pytest.approx((473_100_000, 85_100_000), abs=20)


@pytest.mark.parametrize(("kind", "items"), KINDS)
def test_write_partial_list(kind: int, items: list[Item]) -> None:
    station = Station()
    station.upload(items, kind)
    changed = [item._replace(x=item.x + 1000) for item in items[2:4]]
    assert station.upload_part(2, changed, kind) == ACCEPTED
    stored = station.download(kind)
    assert isinstance(stored, list)
    expected = [*items[:2], *changed, *items[4:]]
    assert [(s.x, s.y) for s in stored] == [(i.x, i.y) for i in expected]


def test_write_partial_list_beyond_the_end_is_an_error() -> None:
    station = Station()
    station.upload(lanes(5))
    got = station.send(mavlink.MAVLink_mission_write_partial_list_message(1, 1, 3, 6, MISSION))
    assert [m.type for m in got if m.get_type() == "MISSION_ACK"] == [mavlink.MAV_MISSION_ERROR]


@pytest.mark.parametrize(
    ("kind", "limit"), [(MISSION, 655), (FENCE, 84), (RALLY, 50)], ids=["mission", "fence", "rally"]
)
def test_too_many_items_are_refused_before_the_first(kind: int, limit: int) -> None:
    station = Station()
    got = station.send(station.count_message(limit + 1, kind))
    [ack] = [m for m in got if m.get_type() == "MISSION_ACK"]
    assert ack.type == mavlink.MAV_MISSION_NO_SPACE
    assert f"Only {limit} items are supported" in station.texts()
    got = station.send(station.count_message(limit, kind))
    assert [m.get_type() for m in got] == ["MISSION_REQUEST"]


def test_a_full_mission_fits() -> None:
    station = Station()
    assert station.upload(lanes(655)) == ACCEPTED
    assert len(station.vehicle.mission.items) == 655


def test_storage_grows_with_an_sd_card() -> None:
    station = Station(parameters={"BRD_SD_MISSION": 64, "BRD_SD_FENCE": 64})
    assert station.vehicle.mission.capacity == 4368
    assert station.upload(polygon(200), FENCE) == ACCEPTED


def test_fence_of_84_points_fails_only_after_the_last_and_leaves_the_old_one() -> None:
    station = Station()
    assert station.upload(polygon(83), FENCE) == ACCEPTED
    assert station.upload(polygon(84), FENCE) == mavlink.MAV_MISSION_ERROR
    assert "Fence exceeds storage size" in station.texts()
    stored = station.download(FENCE)
    assert isinstance(stored, list)
    assert len(stored) == 83


def test_a_fence_without_room_for_the_end_mark_is_refused() -> None:
    station = Station()
    # 2 polygons of 83 points together: 4 + 668 bytes, the whole store.
    assert station.upload(polygon(79) + polygon(4, EXCLUSION), FENCE) == mavlink.MAV_MISSION_ERROR
    assert station.upload(polygon(78) + polygon(4, EXCLUSION), FENCE) == ACCEPTED


def test_one_inclusion_and_16_exclusions_of_4_points_fit_and_a_broken_ring_does_not() -> None:
    station = Station()
    whole = polygon(4) + 16 * polygon(4, EXCLUSION)
    assert station.upload(whole, FENCE) == ACCEPTED
    assert station.upload(whole[:-1], FENCE) == mavlink.MAV_MISSION_ERROR
    assert "Fence validation failed" in station.texts()


def test_a_refused_item_leaves_a_mixture_of_old_and_new() -> None:
    station = Station()
    old = lanes(10)
    station.upload(old)
    new = [HOME, *(waypoint(-7.0 * i, 3.0) for i in range(1, 10))]
    new[6] = new[6]._replace(param1=float("nan"))
    assert station.upload(new) == mavlink.MAV_MISSION_INVALID_PARAM1
    stored = station.download()
    assert isinstance(stored, list)
    expected = [*new[:6], *old[6:]]
    assert [(s.x, s.y) for s in stored] == [(i.x, i.y) for i in expected]


def test_a_shorter_mission_that_fails_has_cut_the_old_one_already() -> None:
    station = Station()
    station.upload(lanes(10))
    station.send(station.count_message(4))
    station.send(station.item_message(0, HOME))
    station.send(station.item_message(1, waypoint(1, 1, command=195)))
    assert len(station.vehicle.mission.items) == 4


def test_rally_that_fails_leaves_a_mixture_too() -> None:
    station = Station()
    station.upload(rally(4), RALLY)
    new = [item._replace(x=item.x + 5) for item in rally(4)]
    new[2] = new[2]._replace(command=16)
    assert station.upload(new, RALLY) == mavlink.MAV_MISSION_UNSUPPORTED
    assert [i.x for i in station.vehicle.rally.items] == [
        new[0].x, new[1].x, rally(4)[2].x, rally(4)[3].x,
    ]  # fmt: skip


def test_the_vehicle_asks_again_after_a_second_and_gives_up_after_eight() -> None:
    station = Station()
    station.wait(0.1)
    [first] = station.send(station.count_message(5))
    assert (first.get_type(), first.seq) == ("MISSION_REQUEST", 0)
    station.heard.clear()
    station.wait(7.9)
    again = [m for m in station.heard if m.get_type() == "MISSION_REQUEST"]
    assert [m.seq for m in again] == [0] * 7
    station.heard.clear()
    station.wait(0.5)
    acks = [m for m in station.heard if m.get_type() == "MISSION_ACK"]
    assert [m.type for m in acks] == [mavlink.MAV_MISSION_OPERATION_CANCELLED]
    assert "Mission upload timeout" in station.texts()


def test_a_broken_transfer_is_held_for_eight_seconds() -> None:
    station = Station()
    station.upload(lanes(3))
    other = Station(station.vehicle, system_id=251, link=1)
    station.send(station.count_message(5))
    denied = mavlink.MAV_MISSION_DENIED
    assert [m.type for m in other.send(other.count_message(2))] == [denied]
    # The download is denied to everybody, the uploader included.
    assert other.download() == denied
    assert station.download() == denied
    assert [m.type for m in other.send(other.item_message(0, HOME))] == [denied]
    partial = mavlink.MAVLink_mission_write_partial_list_message(1, 1, 0, 1, MISSION)
    assert [m.type for m in station.send(partial)] == [denied]
    other.wait(8.5)
    assert isinstance(other.download(), list)


def test_the_same_station_may_start_over_at_once() -> None:
    station = Station()
    station.send(station.count_message(5))
    assert station.upload(lanes(4)) == ACCEPTED


def test_the_lists_are_locked_one_by_one() -> None:
    station = Station()
    station.send(station.count_message(5))
    assert station.upload(rally(2), RALLY) == ACCEPTED


def test_an_unexpected_number_is_answered_and_does_not_end_the_transfer() -> None:
    station = Station()
    station.send(station.count_message(3))
    for wrong in (1, 2, 7):
        [ack] = station.send(station.item_message(wrong, HOME))
        assert ack.type == mavlink.MAV_MISSION_INVALID_SEQUENCE
    [request] = station.send(station.item_message(0, HOME))
    assert request.seq == 1
    [duplicate] = station.send(station.item_message(0, HOME))
    assert duplicate.type == mavlink.MAV_MISSION_INVALID_SEQUENCE
    assert station.send(station.item_message(1, waypoint(1, 1)))[0].seq == 2
    got = station.send(station.item_message(2, waypoint(2, 2)))
    assert [m.type for m in got if m.get_type() == "MISSION_ACK"] == [ACCEPTED]


def test_an_item_nobody_asked_for_is_an_error() -> None:
    station = Station()
    [ack] = station.send(station.item_message(0, HOME))
    assert ack.type == mavlink.MAV_MISSION_ERROR


def test_another_component_cannot_slip_items_in() -> None:
    station = Station()
    other = Station(station.vehicle, component_id=1)
    station.send(station.count_message(3))
    [ack] = other.send(other.item_message(0, HOME))
    assert ack.type == mavlink.MAV_MISSION_DENIED


def test_downloads_beyond_the_end() -> None:
    station = Station()
    station.upload(lanes(3))
    got = station.send(mavlink.MAVLink_mission_request_int_message(1, 1, 3, MISSION))
    assert [m.get_type() for m in got] == ["MISSION_COUNT", "MISSION_ACK"]
    assert (got[0].count, got[1].type) == (3, mavlink.MAV_MISSION_ERROR)
    [ack] = station.send(mavlink.MAVLink_mission_request_int_message(1, 1, 0, RALLY))
    assert ack.type == mavlink.MAV_MISSION_INVALID_SEQUENCE


def test_float_items_are_understood_both_ways() -> None:
    station = Station()
    station.send(station.count_message(2))
    for seq, item in enumerate((HOME, waypoint(30, 40))):
        station.send(
            mavlink.MAVLink_mission_item_message(
                1, 1, seq, item.frame, 16, 0, 1, 0, 0, 0, 0, item.x * 1e-7, item.y * 1e-7, 0, 0
            )
        )
    assert any("MISSION_ITEM_INT" in text for text in station.texts())
    [item] = [
        m
        for m in station.send(mavlink.MAVLink_mission_request_message(1, 1, 1, MISSION))
        if m.get_type() == "MISSION_ITEM"
    ]
    # Single precision: half a metre of latitude at best.
    assert item.x == pytest.approx(waypoint(30, 40).x * 1e-7, abs=4e-6)


def test_unknown_mission_type_is_unsupported() -> None:
    station = Station()
    [ack] = station.send(station.count_message(2, 7))
    assert ack.type == mavlink.MAV_MISSION_UNSUPPORTED


def test_a_jump_to_nowhere_is_an_error() -> None:
    station = Station()
    jump = Item(177, 2, 9, 1, 0, 0, 0, 0, 0)
    assert station.upload([*lanes(3), jump]) == mavlink.MAV_MISSION_ERROR
    assert station.upload([*lanes(3), jump._replace(param1=1)]) == ACCEPTED


def test_messages_for_another_vehicle_are_ignored() -> None:
    station = Station(system_id=250)
    message = mavlink.MAVLink_mission_count_message(9, 1, 3, MISSION)
    assert station.send(message) == []


def test_mission_cannot_be_cleared_while_it_runs() -> None:
    station = Station()
    station.upload(lanes(5))
    assert station.command(mavlink.MAV_CMD_COMPONENT_ARM_DISARM, 1) == 0
    assert station.command(mavlink.MAV_CMD_MISSION_START) == 0
    station.wait(1.0)
    [ack] = station.send(mavlink.MAVLink_mission_clear_all_message(1, 1, MISSION))
    assert ack.type == mavlink.MAV_MISSION_ERROR
    assert len(station.vehicle.mission.items) == 5


@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize(
    "faults",
    [
        {"loss": 0.1},
        {"duplicate": 0.3},
        {"reorder": 0.2},
        {"loss": 0.05, "duplicate": 0.1, "reorder": 0.1},
    ],
    ids=["loss", "duplicates", "reordering", "all"],
)
def test_a_patient_station_gets_through_a_bad_link(faults: dict[str, float], seed: int) -> None:
    station = Station(faults=Faults(seed=seed, **faults))
    items = lanes(30)
    for _ in range(5):
        if station.upload(items) == ACCEPTED:
            break
        station.wait(9.0)
    clean = Station(station.vehicle)
    stored = clean.download()
    assert isinstance(stored, list)
    assert [(s.x, s.y) for s in stored] == [(i.x, i.y) for i in items]

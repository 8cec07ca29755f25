"""Everything that is not missions: streams, requests, parameters, commands."""

from __future__ import annotations

from collections import Counter

import pytest
from sim_client import HOME, Station, waypoint

from mrmission.simulate.parameters import IN_FORCE, Parameters
from mrmission.simulate.wire import mavlink

OK = mavlink.MAV_RESULT_ACCEPTED
FAILED = mavlink.MAV_RESULT_FAILED
REQUEST = mavlink.MAV_CMD_REQUEST_MESSAGE
INTERVAL = mavlink.MAV_CMD_SET_MESSAGE_INTERVAL


def kinds(messages) -> Counter[str]:
    return Counter(m.get_type() for m in messages)


def test_it_is_an_ardupilot_boat() -> None:
    station = Station()
    station.wait(1.5)
    heartbeat = next(m for m in station.heard if m.get_type() == "HEARTBEAT")
    assert heartbeat.autopilot == mavlink.MAV_AUTOPILOT_ARDUPILOTMEGA
    assert heartbeat.type == mavlink.MAV_TYPE_SURFACE_BOAT
    assert heartbeat.custom_mode == 4
    assert not heartbeat.base_mode & mavlink.MAV_MODE_FLAG_SAFETY_ARMED


def test_default_streams_are_modest() -> None:
    station = Station()
    counts = kinds(station.wait(10.0, 0.05))
    assert counts["HEARTBEAT"] in (10, 11)
    assert counts["GLOBAL_POSITION_INT"] in range(19, 22)
    for name in ("SYS_STATUS", "GPS_RAW_INT", "ATTITUDE", "VFR_HUD", "MISSION_CURRENT"):
        assert counts[name] in (10, 11), name
    assert sum(counts.values()) < 120


def test_nothing_is_built_when_nobody_listens() -> None:
    station = Station()
    station.wait(1.0)
    assert station.vehicle.step(station.now_s + 50.0, telemetry=False) == []


def test_missed_streams_are_not_made_up_for() -> None:
    station = Station()
    station.wait(1.0)
    assert kinds(station.wait(60.0, 60.0))["HEARTBEAT"] == 1


def test_message_intervals() -> None:
    station = Station()
    attitude = mavlink.MAVLINK_MSG_ID_ATTITUDE
    assert station.command(INTERVAL, attitude, 100_000) == OK
    assert kinds(station.wait(5.0, 0.02))["ATTITUDE"] in range(48, 53)
    got = station.send(
        mavlink.MAVLink_command_long_message(1, 1, 510, 0, attitude, 0, 0, 0, 0, 0, 0)
    )
    assert [m.interval_us for m in got if m.get_type() == "MESSAGE_INTERVAL"] == [100_000]
    assert station.command(INTERVAL, attitude, -1) == OK
    assert kinds(station.wait(5.0))["ATTITUDE"] == 0
    assert station.command(INTERVAL, attitude, 0) == OK
    assert kinds(station.wait(5.0))["ATTITUDE"] in (5, 6)
    assert station.command(INTERVAL, 11000, 100_000) == FAILED


@pytest.mark.parametrize(
    ("number", "name"),
    [(148, "AUTOPILOT_VERSION"), (242, "HOME_POSITION"), (245, "EXTENDED_SYS_STATE"),
     (49, "GPS_GLOBAL_ORIGIN"), (2, "SYSTEM_TIME"), (42, "MISSION_CURRENT")],
)  # fmt: skip
def test_messages_on_request(number: int, name: str) -> None:
    station = Station()
    assert station.command(REQUEST, number) == OK
    assert station.heard[-2].get_type() == name


def test_unknown_messages_on_request_fail_and_unknown_commands_are_unsupported() -> None:
    station = Station()
    assert station.command(REQUEST, 259) == FAILED
    assert station.command(2520) == mavlink.MAV_RESULT_UNSUPPORTED


def test_capabilities_tell_what_it_can() -> None:
    station = Station()
    assert station.command(mavlink.MAV_CMD_REQUEST_AUTOPILOT_CAPABILITIES, 1) == OK
    version = next(m for m in station.heard if m.get_type() == "AUTOPILOT_VERSION")
    for name in ("MISSION_INT", "MISSION_FENCE", "MISSION_RALLY", "MAVLINK2", "COMMAND_INT"):
        assert version.capabilities & getattr(mavlink, f"MAV_PROTOCOL_CAPABILITY_{name}"), name
    assert version.flight_sw_version >> 16 == 0x0407
    assert version.uid == 1


def test_command_int_carries_exact_positions() -> None:
    station = Station()
    target = waypoint(120, -40)
    station.send(
        mavlink.MAVLink_command_int_message(1, 1, 0, 179, 0, 0, 0, 0, 0, 0, target.x, target.y, 0)
    )
    assert station.command(mavlink.MAV_CMD_GET_HOME_POSITION) == OK
    home = [m for m in station.heard if m.get_type() == "HOME_POSITION"][-1]
    assert (home.latitude, home.longitude) == (target.x, target.y)


def test_position_is_reported() -> None:
    station = Station()
    station.wait(1.0)
    position = next(m for m in station.heard if m.get_type() == "GLOBAL_POSITION_INT")
    assert (position.lat, position.lon) == (HOME.x, HOME.y)


def test_timesync_and_ping() -> None:
    station = Station()
    station.wait(3.0)
    [reply] = station.send(mavlink.MAVLink_timesync_message(0, 1234))
    assert reply.ts1 == 1234
    assert reply.tc1 == pytest.approx(3e9, abs=1e3)
    assert station.send(mavlink.MAVLink_timesync_message(5, 6)) == []
    [pong] = station.send(mavlink.MAVLink_ping_message(77, 3, 0, 0))
    assert (pong.seq, pong.target_system) == (3, 250)


def test_replies_go_to_the_link_that_asked_and_broadcasts_to_all() -> None:
    station = Station()
    out = station.vehicle.handle(_parsed(mavlink.MAVLink_ping_message(1, 2, 0, 0)), "here")
    assert [item.link for item in out] == ["here"]
    out = station.vehicle.step(1.0)
    assert {item.link for item in out} == {None}


def _parsed(message):
    from mrmission.simulate.wire import Codec

    [parsed] = Codec(1).decode(Codec(250, 190).encode(message))
    return parsed


# --- parameters ---


def test_all_parameters_are_listed_once_in_order() -> None:
    station = Station()
    station.send(mavlink.MAVLink_param_request_list_message(1, 1))
    values = [m for m in station.wait(3.0) if m.get_type() == "PARAM_VALUE"]
    assert [m.param_index for m in values] == list(range(len(values)))
    assert {m.param_count for m in values} == {len(values)}
    names = [m.param_id for m in values]
    assert len(set(names)) == len(names)
    assert set(names) >= IN_FORCE


def test_defaults_are_ardupilots() -> None:
    defaults = Parameters()
    for name, value in {
        "AVOID_ENABLE": 3, "FENCE_ENABLE": 0, "FENCE_TYPE": 6, "FENCE_ACTION": 1,
        "FENCE_RADIUS": 300, "MIS_DONE_BEHAVE": 1, "WP_SPEED": 2, "WP_RADIUS": 2,
        "FRAME_CLASS": 2, "SRTL_POINTS": 300, "FS_THR_ENABLE": 1, "FS_ACTION": 2,
    }.items():  # fmt: skip
        assert defaults[name] == value, name


def test_reading_and_setting_one() -> None:
    station = Station()
    [value] = station.send(mavlink.MAVLink_param_request_read_message(1, 1, b"WP_SPEED", -1))
    assert (value.param_id, value.param_value, value.param_type) == ("WP_SPEED", 2.0, 9)
    [value] = station.send(mavlink.MAVLink_param_set_message(1, 1, b"WP_SPEED", 3.5, 9))
    assert value.param_value == 3.5
    [value] = station.send(mavlink.MAVLink_param_set_message(1, 1, b"AVOID_ENABLE", 0.0, 2))
    assert (value.param_value, value.param_type) == (0.0, 2)
    assert station.send(mavlink.MAVLink_param_request_read_message(1, 1, b"NO_SUCH", -1)) == []
    assert station.send(mavlink.MAVLink_param_set_message(1, 1, b"NO_SUCH", 1.0, 9)) == []


def test_integers_are_rounded_and_limited_and_nonsense_is_denied() -> None:
    parameters = Parameters()
    assert parameters.set("FENCE_TYPE", 4.6)
    assert parameters["FENCE_TYPE"] == 5
    assert parameters.set("FENCE_TYPE", 1000)
    assert parameters["FENCE_TYPE"] == 127
    assert not parameters.set("WP_SPEED", float("nan"))
    assert not parameters.set("MIS_TOTAL", 5)
    station = Station()
    [text, value] = station.send(mavlink.MAVLink_param_set_message(1, 1, b"MIS_TOTAL", 5.0, 4))
    assert text.text == "Param write denied (MIS_TOTAL)"
    assert value.param_value == 0


def test_mis_total_counts() -> None:
    station = Station()
    station.upload([HOME, waypoint(1, 1)])
    [value] = station.send(mavlink.MAVLink_param_request_read_message(1, 1, b"MIS_TOTAL", -1))
    assert value.param_value == 2

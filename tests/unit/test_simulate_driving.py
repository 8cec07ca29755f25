"""The simulated boat under way: modes, arming, mission execution, fence, motion."""

from __future__ import annotations

import math

import pytest
from sim_client import FENCE, HOME, LAT, LON, MISSION, RALLY, Station, polygon, waypoint

from mrmission.simulate.fence import polygon_breach_m
from mrmission.simulate.motion import Boat, Kinematics, Leg, moved, offset_m
from mrmission.simulate.storage import EXCLUSION, Item
from mrmission.simulate.wire import mavlink

ARM = mavlink.MAV_CMD_COMPONENT_ARM_DISARM
MODE = mavlink.MAV_CMD_DO_SET_MODE
OK = mavlink.MAV_RESULT_ACCEPTED
FAILED = mavlink.MAV_RESULT_FAILED
MANUAL, HOLD, LOITER, AUTO, RTL, GUIDED = 0, 4, 5, 10, 11, 15


def do(command: int, *params: float) -> Item:
    return Item(command, 2, *[*params, 0.0, 0.0, 0.0, 0.0][:4], 0, 0, 0.0)  # type: ignore[arg-type]


def speed_to(speed_m_s: float) -> Item:
    return do(178, 1, speed_m_s, -1)


def under_way(items: list[Item], **setup) -> Station:
    station = Station(**setup)
    assert station.upload([HOME, *items]) == 0
    assert station.command(ARM, 1) == OK
    assert station.command(mavlink.MAV_CMD_MISSION_START) == OK
    return station


def metres(station: Station, item: Item) -> float:
    boat = station.vehicle.boat
    return math.hypot(*offset_m(boat.lat, boat.lon, item.x * 1e-7, item.y * 1e-7))


def reached(station: Station) -> list[int]:
    return [m.seq for m in station.heard if m.get_type() == "MISSION_ITEM_REACHED"]


SQUARE = [waypoint(40, 0), waypoint(40, 40), waypoint(0, 40), waypoint(0, 0)]


def test_a_mission_is_sailed_to_its_end_in_order() -> None:
    station = under_way(SQUARE)
    station.wait(140.0)
    assert reached(station) == [1, 2, 3, 4]
    assert "Mission Complete" in station.texts()
    assert metres(station, SQUARE[-1]) <= 2.0
    assert station.vehicle.boat.speed_m_s == 0.0
    assert station.vehicle.autopilot.mode == AUTO
    last = [m for m in station.heard if m.get_type() == "MISSION_CURRENT"][-1]
    assert (last.total, last.mission_state) == (4, mavlink.MISSION_STATE_COMPLETE)


def test_the_whole_drive_is_reproducible_and_does_not_depend_on_the_tick() -> None:
    ends = []
    for tick_s in (0.05, 0.05, 0.2):
        station = under_way(SQUARE)
        station.wait(60.0, tick_s)
        ends.append((station.vehicle.boat.lat, station.vehicle.boat.lon))
    assert ends[0] == ends[1]
    assert math.hypot(*offset_m(*ends[0], *ends[2])) < 2.0


def test_speedup_hastens_the_water_and_not_the_link() -> None:
    station = under_way(SQUARE, speedup=20.0)
    station.heard.clear()
    station.wait(7.0)
    assert reached(station) == [1, 2, 3, 4]
    assert 7 <= sum(m.get_type() == "HEARTBEAT" for m in station.heard) <= 8


def test_a_boat_keeps_to_its_line_and_its_speed() -> None:
    station = under_way([waypoint(0, 10), waypoint(200, 10)])
    station.wait(25.0)
    worst = 0.0
    for _ in range(600):
        station.wait(0.1)
        boat = station.vehicle.boat
        east, _ = offset_m(LAT, LON, boat.lat, boat.lon)
        if station.vehicle.autopilot.current == 2 and boat.speed_m_s > 1.9:
            worst = max(worst, abs(east - 10.0))
        assert boat.speed_m_s <= 2.0 + 1e-9
    assert 0 < worst < 1.0


def test_a_change_of_speed_as_first_item_is_ignored_and_after_a_waypoint_works() -> None:
    first = under_way([speed_to(4.0), waypoint(200, 0)])
    first.wait(20.0)
    assert first.vehicle.boat.speed_m_s == pytest.approx(2.0)
    second = under_way([waypoint(10, 0), speed_to(4.0), waypoint(200, 0)])
    second.wait(30.0)
    assert second.vehicle.boat.speed_m_s == pytest.approx(4.0)
    assert "speed: 4.0 m/s" in second.texts()


def test_several_do_commands_between_waypoints_all_run_in_order() -> None:
    station = under_way(
        [waypoint(10, 0), do(206, 5.0), speed_to(3.0), speed_to(1.0), waypoint(100, 0)]
    )
    station.wait(25.0)
    # The waypoint's own number is overtaken by the command that is done at once.
    assert reached(station)[:3] == [2, 3, 4]
    assert station.vehicle.boat.speed_m_s == pytest.approx(1.0)


def test_commands_a_boat_does_not_execute_are_stored_and_skipped() -> None:
    takeoff = waypoint(20, 0, command=22)
    station = under_way([takeoff, waypoint(10, 0)])
    station.wait(20.0)
    assert "Mission: 1 Takeoff" in station.texts()
    assert reached(station) == [2]


def test_waiting_at_a_waypoint_and_loitering_for_a_time() -> None:
    station = under_way([waypoint(10, 0, param1=20.0), waypoint(20, 0, command=19, param1=10)])
    station.wait(20.0)
    assert station.vehicle.autopilot.current == 1
    station.wait(60.0)
    assert reached(station) == [1, 2]


def test_loiter_unlimited_never_ends_and_holds_its_place() -> None:
    place = waypoint(20, 0, command=17)
    station = under_way([place, waypoint(500, 0)])
    station.wait(300.0, 1.0)
    assert reached(station) == []
    assert metres(station, place) <= 2.0
    assert station.vehicle.boat.speed_m_s == 0.0


def test_loiter_turns_go_around() -> None:
    circle = waypoint(40, 0, command=18, param1=2.0, param3=10.0)
    station = under_way([circle, waypoint(0, 0)])
    away = []
    for _ in range(900):
        station.wait(0.1)
        if station.vehicle.autopilot.current == 1 and station.now_s > 35:
            away.append(metres(station, circle))
    station.wait(60)
    assert reached(station)[0] == 1
    assert away
    assert all(7.0 < metre < 13.0 for metre in away)


def test_jumps_are_counted() -> None:
    station = under_way([waypoint(10, 0), waypoint(20, 0), do(177, 1, 2), waypoint(30, 0)])
    station.wait(150.0)
    assert reached(station) == [1, 2, 1, 2, 1, 2, 4]


def test_an_endless_jump_to_nothing_but_jumps_ends() -> None:
    station = Station()
    station.upload([HOME, do(206, 1.0), do(177, 1, -1)])
    station.command(ARM, 1)
    assert station.command(mavlink.MAV_CMD_MISSION_START) == OK
    station.wait(1.0)
    assert "Mission Complete" in station.texts()


def test_nav_delay_and_return_to_launch() -> None:
    station = under_way([waypoint(30, 0), do(93, 15.0), do(20)])
    station.wait(30.0)
    assert station.vehicle.autopilot.current == 2
    station.wait(40.0)
    assert reached(station) == [1, 2, 3]
    assert metres(station, HOME) < 2.5


@pytest.mark.parametrize(("behave", "mode"), [(0, AUTO), (1, AUTO), (3, MANUAL)])
def test_end_of_mission(behave: int, mode: int) -> None:
    station = under_way([waypoint(10, 0)], parameters={"MIS_DONE_BEHAVE": behave})
    station.wait(20.0)
    assert station.vehicle.autopilot.mode == mode


# --- modes and arming ---


def test_it_starts_disarmed_in_hold_and_never_moves_by_itself() -> None:
    station = Station()
    station.upload([HOME, *SQUARE])
    station.wait(10.0)
    assert (station.vehicle.autopilot.armed, station.vehicle.autopilot.mode) == (False, HOLD)
    assert station.command(MODE, 1, AUTO) == OK
    station.wait(10.0)
    assert metres(station, HOME) == pytest.approx(0.0, abs=0.02)


def test_auto_without_a_mission_is_refused() -> None:
    station = Station()
    assert station.command(mavlink.MAV_CMD_MISSION_START) == FAILED
    assert "No Mission. Can't set AUTO." in station.texts()


def test_unknown_modes_are_refused() -> None:
    station = Station()
    assert station.command(MODE, 1, 9) == FAILED
    assert station.command(MODE, 1, 99) == FAILED
    assert station.command(MODE, 0, HOLD) == mavlink.MAV_RESULT_DENIED


def test_arming_waits_for_a_position() -> None:
    station = Station(ready_s=10.0)
    station.wait(2.0)
    assert station.command(ARM, 1) == FAILED
    assert "Arm: Gyros inconsistent" in station.texts()
    assert not [m for m in station.heard if m.get_type() == "GLOBAL_POSITION_INT"]
    station.wait(4.0)
    assert station.command(ARM, 1) == OK
    assert station.command(MODE, 1, LOITER) == FAILED
    assert station.command(ARM, 0) == OK
    assert not station.vehicle.autopilot.armed
    assert station.command(MODE, 1, LOITER) == OK
    assert station.command(ARM, 1) == FAILED
    assert "Arm: Need Position Estimate" in station.texts()
    station.wait(5.0)
    assert station.command(ARM, 1) == OK


def test_a_boat_that_starts_up_has_no_room_for_a_mission() -> None:
    station = Station(ready_s=40.0)
    assert station.upload([HOME, *SQUARE]) == mavlink.MAV_MISSION_NO_SPACE
    station.wait(4.5)
    assert station.upload([HOME, *SQUARE]) == 0


def test_from_manual_a_station_gets_into_hold_only() -> None:
    station = Station(parameters={"INITIAL_MODE": 0})
    assert station.command(MODE, 1, LOITER) == FAILED
    assert station.texts()[-3] == "Mode change from MANUAL to LOITER denied, only RC "
    assert station.command(MODE, 1, HOLD) == OK
    assert station.command(MODE, 1, LOITER) == OK


def test_arming_outside_an_enabled_fence_is_refused_unless_forced() -> None:
    station = Station(parameters={"FENCE_ENABLE": 1, "FENCE_TYPE": 4})
    far = [item._replace(x=item.x + 20_000) for item in polygon(8)]
    assert station.upload(far, FENCE) == 0
    assert station.command(ARM, 1) == FAILED
    assert "Arm: Vehicle breaching Polygon fence" in station.texts()
    assert station.upload(polygon(8), FENCE) == 0
    assert station.command(ARM, 1) == OK
    station.command(ARM, 0)
    assert station.upload(polygon(8) + polygon(4, EXCLUSION), FENCE) == 0
    assert station.command(ARM, 1) == FAILED
    assert station.command(ARM, 1, 21196) == OK


def test_arming_outside_a_fence_that_is_not_enabled_is_allowed() -> None:
    station = Station()
    far = [item._replace(x=item.x + 20_000) for item in polygon(8)]
    station.upload(far, FENCE)
    assert station.command(ARM, 1) == OK


def test_a_moving_boat_is_disarmed_and_coasts() -> None:
    station = under_way(SQUARE)
    station.wait(8.0)
    assert station.command(MODE, 1, HOLD) == OK
    speed = station.vehicle.boat.speed_m_s
    assert speed > 1.0
    assert station.command(ARM, 0) == OK
    assert station.vehicle.autopilot.current == 0
    here = station.vehicle.boat.lat, station.vehicle.boat.lon
    station.wait(30.0)
    way = math.hypot(*offset_m(*here, station.vehicle.boat.lat, station.vehicle.boat.lon))
    assert way == pytest.approx(4.0 * math.log(1.0 + 0.25 * speed * 30.0), rel=0.02)


def test_hold_stops_and_auto_resumes_at_the_same_item() -> None:
    station = under_way(SQUARE)
    station.wait(35.0)
    current = station.vehicle.autopilot.current
    assert current == 2
    assert station.command(MODE, 1, HOLD) == OK
    station.wait(10.0)
    assert station.vehicle.boat.speed_m_s < 0.5
    assert station.command(mavlink.MAV_CMD_MISSION_START) == OK
    station.wait(1.0)
    assert station.vehicle.autopilot.current == current
    station.wait(120.0)
    assert reached(station) == [1, 2, 3, 4]


def test_mis_restart_begins_again() -> None:
    station = under_way(SQUARE, parameters={"MIS_RESTART": 1})
    station.wait(35.0)
    station.command(MODE, 1, HOLD)
    station.wait(1.0)
    station.command(MODE, 1, AUTO)
    station.wait(1.0)
    assert station.vehicle.autopilot.current == 1


def test_set_current_before_and_during_a_mission() -> None:
    station = Station()
    station.upload([HOME, *SQUARE])
    set_current = mavlink.MAV_CMD_DO_SET_MISSION_CURRENT
    assert station.command(set_current, 3) == OK
    assert station.command(set_current, 5) == mavlink.MAV_RESULT_DENIED
    station.command(ARM, 1)
    station.command(mavlink.MAV_CMD_MISSION_START)
    station.wait(1.0)
    assert station.vehicle.autopilot.current == 3
    heard = station.send(mavlink.MAVLink_mission_set_current_message(1, 1, 2))
    assert [m.seq for m in heard if m.get_type() == "MISSION_CURRENT"] == [2]
    station.wait(0.5)
    assert station.vehicle.autopilot.current == 2


def test_an_upload_under_way_turns_the_boat_at_once_to_the_same_index() -> None:
    station = under_way([waypoint(300, 0), waypoint(300, 100)])
    station.wait(15.0)
    new = [HOME, waypoint(0, -300), waypoint(0, -310)]
    assert station.upload(new) == 0
    station.wait(30.0)
    assert "Auto mission changed, restarted command" in station.texts()
    east, _ = offset_m(LAT, LON, station.vehicle.boat.lat, station.vehicle.boat.lon)
    assert east < -5
    assert station.vehicle.autopilot.current == 1


def test_rtl_goes_to_the_nearest_rally_point_within_its_limit() -> None:
    station = under_way([waypoint(100, 0)])
    station.upload([waypoint(90, 30, command=5100)], RALLY)
    station.wait(60.0)
    assert station.command(MODE, 1, RTL) == OK
    station.wait(60.0)
    assert metres(station, waypoint(90, 30)) <= 2.0
    station.upload([waypoint(5000, 0, command=5100)], RALLY)
    station.command(MODE, 1, HOLD)
    station.command(MODE, 1, RTL)
    station.wait(90.0)
    assert metres(station, HOME) <= 2.0


def test_guided_goes_where_it_is_told() -> None:
    station = Station()
    station.command(ARM, 1)
    assert station.command(MODE, 1, GUIDED) == OK
    target = waypoint(30, 30)
    station.send(
        mavlink.MAVLink_set_position_target_global_int_message(
            0, 1, 1, 5, 0b110111111000, target.x, target.y, 0, 0, 0, 0, 0, 0, 0, 0, 0
        )
    )
    station.wait(60.0)
    assert metres(station, target) <= 2.0


@pytest.mark.parametrize(("action", "mode"), [(0, AUTO), (1, RTL), (2, HOLD)])
def test_leaving_the_fence(action: int, mode: int) -> None:
    parameters = {"FENCE_ENABLE": 1, "FENCE_TYPE": 4, "FENCE_ACTION": action}
    station = Station(parameters=parameters)
    station.upload(polygon(32), FENCE)
    station.upload([HOME, waypoint(300, 0)])
    station.command(ARM, 1)
    station.command(mavlink.MAV_CMD_MISSION_START)
    station.wait(70.0)
    [told] = [m for m in station.heard if m.get_type() == "FENCE_STATUS"]
    assert (told.breach_status, told.breach_count) == (1, 1)
    assert ("Manual recovery started" in station.texts()) == (action != 0)
    assert station.vehicle.autopilot.mode == mode


def test_the_circle_of_the_default_fence_type_counts() -> None:
    station = under_way([waypoint(400, 0)], parameters={"FENCE_ENABLE": 1, "WP_SPEED": 10.0})
    station.wait(60.0)
    assert station.vehicle.autopilot.mode == RTL


def test_reboot_keeps_what_is_stored() -> None:
    station = under_way(SQUARE)
    reboot = mavlink.MAV_CMD_PREFLIGHT_REBOOT_SHUTDOWN
    assert station.command(reboot, 1) == FAILED
    station.command(ARM, 0, 21196)
    assert station.command(reboot, 1) == OK
    pilot = station.vehicle.autopilot
    assert (pilot.armed, pilot.mode, len(station.vehicle.mission.items)) == (False, HOLD, 5)
    stored = station.download(MISSION)
    assert isinstance(stored, list)
    assert stored[0].x == round(station.vehicle.boat.lat * 1e7)


# --- geometry ---


def test_offset_and_moved_are_inverse_even_across_the_antimeridian() -> None:
    lat, lon = moved(47.3, 179.9999, 500.0, -300.0)
    assert -180 <= lon < -179.9
    assert offset_m(47.3, 179.9999, lat, lon) == pytest.approx((500.0, -300.0), abs=1e-6)


def test_a_leg_is_over_when_the_boat_has_passed_its_end() -> None:
    leg = Leg((47.3, 8.5), moved(47.3, 8.5, 0.0, 100.0), None)
    boat = Boat(*moved(47.3, 8.5, 10.0, 101.0), 0.0, Kinematics())
    assert leg.reached(boat, 2.0)
    distance, left, cross = leg.state(boat)
    assert (distance, left, abs(cross)) == pytest.approx((math.hypot(10, 1), -1, 10), abs=1e-3)


def test_breach_distance_and_union_of_inclusions() -> None:
    ring = polygon(64)
    other = [item._replace(x=item.x + 50_000) for item in polygon(64)]
    assert polygon_breach_m(ring, LAT, LON, union=False) is None
    outside = moved(LAT, LON, 130.0, 0.0)
    assert polygon_breach_m(ring, *outside, union=False) == pytest.approx(30.0, abs=0.3)
    assert polygon_breach_m(ring + other, LAT, LON, union=False) is not None
    assert polygon_breach_m(ring + other, LAT, LON, union=True) is None
    hole = polygon(16, EXCLUSION)
    assert polygon_breach_m(hole, LAT, LON, union=True) is not None

"""What a simulated vehicle does with COMMAND_LONG and COMMAND_INT: one function per command."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import TYPE_CHECKING

from mrmission.simulate import telemetry
from mrmission.simulate.copter import CopterPilot
from mrmission.simulate.transfer import Peer
from mrmission.simulate.wire import Message, mavlink

if TYPE_CHECKING:
    from mrmission.simulate.vehicle import SimVehicle

Place = tuple[float, float]
"""Latitude and longitude in degrees, from parameters 5 and 6."""


def _accepted(done: bool) -> int:
    return int(mavlink.MAV_RESULT_ACCEPTED if done else mavlink.MAV_RESULT_FAILED)


def _arm(vehicle: SimVehicle, message: Message, peer: Peer, place: Place) -> int:
    if message.param1 == 1:
        return _accepted(vehicle.autopilot.arm(force=message.param2 == 21196))
    if message.param1 == 0:
        return _accepted(vehicle.autopilot.ask_disarm(force=message.param2 == 21196))
    return int(mavlink.MAV_RESULT_UNSUPPORTED)


def _set_mode(vehicle: SimVehicle, message: Message, peer: Peer, place: Place) -> int:
    if not int(message.param1) & mavlink.MAV_MODE_FLAG_CUSTOM_MODE_ENABLED:
        return int(mavlink.MAV_RESULT_DENIED)
    return _accepted(vehicle.autopilot.set_mode(int(message.param2)))


def _mission_start(vehicle: SimVehicle, message: Message, peer: Peer, place: Place) -> int:
    if message.param1 or message.param2:
        return int(mavlink.MAV_RESULT_DENIED)
    return _accepted(vehicle.autopilot.start_mission())


def _set_current(vehicle: SimVehicle, message: Message, peer: Peer, place: Place) -> int:
    seq = int(message.param1)
    if not 0 <= seq < max(1, vehicle.mission.count()):
        return int(mavlink.MAV_RESULT_DENIED)
    if not vehicle.autopilot.set_current(seq, restart=message.param2 == 1):
        return int(mavlink.MAV_RESULT_FAILED)
    vehicle.send(telemetry.mission_current(vehicle))
    return int(mavlink.MAV_RESULT_ACCEPTED)


def _request_message(vehicle: SimVehicle, message: Message, peer: Peer, place: Place) -> int:
    built = vehicle.build(int(message.param1))
    if built is None:
        return int(mavlink.MAV_RESULT_FAILED)
    vehicle.send(built, peer.link)
    return int(mavlink.MAV_RESULT_ACCEPTED)


def _capabilities(vehicle: SimVehicle, message: Message, peer: Peer, place: Place) -> int:
    vehicle.send(telemetry.autopilot_version(vehicle), peer.link)
    return int(mavlink.MAV_RESULT_ACCEPTED)


def _set_interval(vehicle: SimVehicle, message: Message, peer: Peer, place: Place) -> int:
    return vehicle.streams.ask(int(message.param1), message.param2)


def _get_interval(vehicle: SimVehicle, message: Message, peer: Peer, place: Place) -> int:
    message_id = int(message.param1)
    interval_us = vehicle.streams.interval_us(message_id)
    vehicle.send(mavlink.MAVLink_message_interval_message(message_id, interval_us), peer.link)
    return int(mavlink.MAV_RESULT_ACCEPTED)


def _set_home(vehicle: SimVehicle, message: Message, peer: Peer, place: Place) -> int:
    if message.param1 == 1:
        place = (vehicle.boat.lat, vehicle.boat.lon)
    elif not (abs(place[0]) <= 90 and abs(place[1]) <= 180) or place == (0.0, 0.0):
        return int(mavlink.MAV_RESULT_DENIED)
    vehicle.autopilot.set_home(*place, lock=True)
    return int(mavlink.MAV_RESULT_ACCEPTED)


def _get_home(vehicle: SimVehicle, message: Message, peer: Peer, place: Place) -> int:
    built = telemetry.home_position(vehicle)
    if built is None:
        return int(mavlink.MAV_RESULT_FAILED)
    vehicle.send(built, peer.link)
    return int(mavlink.MAV_RESULT_ACCEPTED)


def _change_speed(vehicle: SimVehicle, message: Message, peer: Peer, place: Place) -> int:
    return _accepted(vehicle.autopilot.set_speed(message.param2))


def _return(vehicle: SimVehicle, message: Message, peer: Peer, place: Place) -> int:
    return _accepted(vehicle.autopilot.set_mode(vehicle.autopilot.modes["RTL"]))


def _loiter(vehicle: SimVehicle, message: Message, peer: Peer, place: Place) -> int:
    return _accepted(vehicle.autopilot.set_mode(vehicle.autopilot.modes["LOITER"]))


def _take_off(vehicle: SimVehicle, message: Message, peer: Peer, place: Place) -> int:
    pilot = vehicle.autopilot
    if not isinstance(pilot, CopterPilot):
        return int(mavlink.MAV_RESULT_UNSUPPORTED)
    return _accepted(pilot.ask_takeoff(message.z if hasattr(message, "z") else message.param7))


def _land(vehicle: SimVehicle, message: Message, peer: Peer, place: Place) -> int:
    if not isinstance(vehicle.autopilot, CopterPilot):
        return int(mavlink.MAV_RESULT_UNSUPPORTED)
    return _accepted(vehicle.autopilot.set_mode(vehicle.autopilot.modes["LAND"]))


def _reposition(vehicle: SimVehicle, message: Message, peer: Peer, place: Place) -> int:
    if not (math.isfinite(place[0]) and abs(place[0]) <= 90 and abs(place[1]) <= 180):
        return int(mavlink.MAV_RESULT_DENIED)
    guided = vehicle.autopilot.modes["GUIDED"]
    if not int(message.param2) & 1 and vehicle.autopilot.mode is not guided:
        return int(mavlink.MAV_RESULT_DENIED)
    if not vehicle.autopilot.set_mode(guided):
        return int(mavlink.MAV_RESULT_DENIED)
    return _accepted(vehicle.autopilot.go_to(*place))


def _fence_enable(vehicle: SimVehicle, message: Message, peer: Peer, place: Place) -> int:
    if message.param1 not in (0, 1):
        return int(mavlink.MAV_RESULT_FAILED)
    vehicle.parameters.put("FENCE_ENABLE", float(message.param1))
    return int(mavlink.MAV_RESULT_ACCEPTED)


def _reboot(vehicle: SimVehicle, message: Message, peer: Peer, place: Place) -> int:
    if message.param1 != 1 or vehicle.autopilot.armed:
        return int(mavlink.MAV_RESULT_FAILED)
    vehicle.reboot()
    return int(mavlink.MAV_RESULT_ACCEPTED)


Command = Callable[["SimVehicle", Message, Peer, Place], int]
COMMANDS: dict[int, Command] = {
    mavlink.MAV_CMD_COMPONENT_ARM_DISARM: _arm,
    mavlink.MAV_CMD_DO_SET_MODE: _set_mode,
    mavlink.MAV_CMD_MISSION_START: _mission_start,
    mavlink.MAV_CMD_DO_SET_MISSION_CURRENT: _set_current,
    mavlink.MAV_CMD_REQUEST_MESSAGE: _request_message,
    mavlink.MAV_CMD_REQUEST_AUTOPILOT_CAPABILITIES: _capabilities,
    mavlink.MAV_CMD_SET_MESSAGE_INTERVAL: _set_interval,
    mavlink.MAV_CMD_GET_MESSAGE_INTERVAL: _get_interval,
    mavlink.MAV_CMD_DO_SET_HOME: _set_home,
    mavlink.MAV_CMD_GET_HOME_POSITION: _get_home,
    mavlink.MAV_CMD_DO_CHANGE_SPEED: _change_speed,
    mavlink.MAV_CMD_NAV_RETURN_TO_LAUNCH: _return,
    mavlink.MAV_CMD_NAV_LOITER_UNLIM: _loiter,
    mavlink.MAV_CMD_NAV_TAKEOFF: _take_off,
    mavlink.MAV_CMD_NAV_LAND: _land,
    mavlink.MAV_CMD_DO_REPOSITION: _reposition,
    mavlink.MAV_CMD_DO_FENCE_ENABLE: _fence_enable,
    mavlink.MAV_CMD_PREFLIGHT_REBOOT_SHUTDOWN: _reboot,
}
"""What answers which command; any other is unsupported."""

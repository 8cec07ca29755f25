"""What an ArduPilot keeps of a mission, fence or rally item, and what it refuses.

An autopilot does not store MAVLink items but its own compact records: 15 bytes per mission
command, 8 per fence vertex. What a record has no room for is lost, and a read-back shows it. These
are the rules of ArduPilot Rover 4.7: which commands it stores, with which precision, which values
it refuses and with which result code.

References
----------
ArduPilot, ``libraries/AP_Mission/AP_Mission.cpp``, ``libraries/AC_Fence/AC_PolyFence_loader.cpp``,
``libraries/GCS_MAVLink/MissionItemProtocol_*.cpp`` (behaviour only).
"""

from __future__ import annotations

import math
import struct
from collections.abc import Callable, Sequence
from typing import NamedTuple

from mrmission.simulate.wire import mavlink

MISSION_ITEMS = 655
"""Mission items, home included, that fit into the storage of a board without an SD card."""
MISSION_RECORD_BYTES = 15
FENCE_BYTES = 672
FENCE_END_BYTES = 1
RALLY_POINTS = 50
COPTER_MISSION_ITEMS, COPTER_FENCE_BYTES, COPTER_RALLY_POINTS = 650, 560, 46
"""ArduCopter gives parameters more of the same memory."""
ALTITUDE_LIMIT_M = 83_000.0

ACCEPTED = mavlink.MAV_MISSION_ACCEPTED
_ANY_ALTITUDE_FRAME = {0: 0, 5: 0, 2: 0, 3: 3, 6: 3, 10: 10, 11: 10}
"""Frames of a mission item with a position: sent -> stored."""
_FENCE_FRAMES = frozenset((0, 5, 3, 6, 10, 11))
_RALLY_FRAMES = {0: 0, 5: 0, 3: 3, 6: 3, 10: 10, 11: 10}


class Item(NamedTuple):
    """The content of one MISSION_ITEM_INT; ``x``/``y`` are lat/lon in 1e-7 degrees."""

    command: int
    frame: int
    param1: float
    param2: float
    param3: float
    param4: float
    x: int
    y: int
    z: float


class Refusal(Exception):  # noqa: N818 - a protocol answer, not a program error
    """An item that is not stored; ``result`` is the MAV_MISSION_RESULT of the answer."""

    def __init__(self, result: int) -> None:
        super().__init__(result)
        self.result = result


# --- precision -----------------------------------------------------------------------------------


def _f32(value: float) -> float:
    result: float = struct.unpack("<f", struct.pack("<f", value))[0]
    return result


def _integer(bits: int, signed: bool) -> Callable[[float], float]:
    """Return a float -> C integer -> float conversion: towards zero, wrapping at the width."""
    span = 1 << bits

    def convert(value: float) -> float:
        whole = int(value) % span
        return float(whole - span if signed and whole >= span // 2 else whole)

    return convert


_U8, _I8 = _integer(8, False), _integer(8, True)
_U16, _I16 = _integer(16, False), _integer(16, True)


def _lost(_: float) -> float:
    return 0.0


def _exact(value: float) -> float:
    return value


def _flag(value: float) -> float:
    return 1.0 if value > 0 else 0.0


def _turning(value: float) -> float:
    return -1.0 if value < 0 else 1.0


def _radius_u16(value: float) -> float:
    return math.copysign(_U16(abs(value)), value) if _U16(abs(value)) else 0.0


def _centi_u16(value: float) -> float:
    return _f32(_U16(value * 100.0) * 0.01)


_Keep = Callable[[float], float]
_NONE: tuple[_Keep, _Keep, _Keep, _Keep] = (_lost, _lost, _lost, _lost)


def _keep(
    p1: _Keep = _lost, p2: _Keep = _lost, p3: _Keep = _lost, p4: _Keep = _lost
) -> tuple[_Keep, _Keep, _Keep, _Keep]:
    return (p1, p2, p3, p4)


_WITH_POSITION: dict[int, tuple[_Keep, _Keep, _Keep, _Keep]] = {
    16: _keep(_U16),  # NAV_WAYPOINT: delay
    17: _keep(p3=_radius_u16),  # NAV_LOITER_UNLIM
    18: _keep(_exact, p3=_exact, p4=_flag),  # NAV_LOITER_TURNS: see _loiter_turns
    19: _keep(_U16, p3=_turning, p4=_flag),  # NAV_LOITER_TIME
    21: _keep(_U16, p4=_turning),  # NAV_LAND
    22: _keep(_U16),  # NAV_TAKEOFF
    30: _keep(_U16),  # NAV_CONTINUE_AND_CHANGE_ALT
    31: _keep(p2=_radius_u16, p4=_flag),  # NAV_LOITER_TO_ALT
    82: _keep(_U16),  # NAV_SPLINE_WAYPOINT
    84: _NONE,  # NAV_VTOL_TAKEOFF
    85: _keep(_U16),  # NAV_VTOL_LAND
    92: _keep(_U16),  # NAV_GUIDED_ENABLE
    94: _keep(_centi_u16),  # NAV_PAYLOAD_PLACE
    179: _keep(_U16),  # DO_SET_HOME
    188: _NONE,  # DO_RETURN_PATH_START
    189: _NONE,  # DO_LAND_START
    191: _NONE,  # DO_GO_AROUND
    201: _keep(_U16),  # DO_SET_ROI
}
_WITHOUT_POSITION: dict[int, tuple[_Keep, _Keep, _Keep, _Keep]] = {
    20: _NONE,  # NAV_RETURN_TO_LAUNCH
    83: _keep(_exact, _exact, _U8),  # NAV_ALTITUDE_WAIT
    93: _keep(_exact, _I8, _I8, _I8),  # NAV_DELAY
    112: _keep(_exact),  # CONDITION_DELAY
    114: _keep(_exact),  # CONDITION_DISTANCE
    115: _keep(_exact, _exact, _I8, _U8),  # CONDITION_YAW
    177: _keep(_U16, _I16),  # DO_JUMP
    178: _keep(_U8, _exact, _exact),  # DO_CHANGE_SPEED
    181: _keep(_U8, _U8),  # DO_SET_RELAY
    182: _keep(_U8, _I16, _exact),  # DO_REPEAT_RELAY
    183: _keep(_U8, _U16),  # DO_SET_SERVO
    184: _keep(_U8, _U16, _I16, _exact),  # DO_REPEAT_SERVO
    194: _keep(_U16),  # DO_SET_REVERSE
    193: _keep(_U16),  # DO_PAUSE_CONTINUE
    205: _keep(_exact, _exact, _exact),  # DO_MOUNT_CONTROL
    206: _keep(_exact, p3=_U8),  # DO_SET_CAM_TRIGG_DIST
    207: _keep(_U16),  # DO_FENCE_ENABLE
    208: _keep(_U16),  # DO_PARACHUTE
    210: _keep(_U16),  # DO_INVERTED_FLIGHT
    211: _keep(_U8, _U8),  # DO_GRIPPER
    212: _keep(_U16),  # DO_AUTOTUNE_ENABLE
    213: _keep(_exact, _exact, _U8),  # NAV_SET_YAW_SPEED
    215: _keep(_U16),  # DO_SET_RESUME_REPEAT_DIST
    216: _keep(_U16),  # DO_SPRAYER
    217: _keep(_U16, _exact, _exact, _exact),  # DO_SEND_SCRIPT_MESSAGE
    218: _keep(_U16, _U8),  # DO_AUX_FUNCTION
    222: _keep(_U16, _exact, _exact, _exact),  # DO_GUIDED_LIMITS
    223: _keep(_flag, _flag, _centi_u16),  # DO_ENGINE_CONTROL
    531: _keep(_U8, _exact),  # SET_CAMERA_ZOOM
    532: _keep(_U8, _exact),  # SET_CAMERA_FOCUS
    534: _keep(_U8, _U8, _U8),  # SET_CAMERA_SOURCE
    600: _keep(_U16),  # JUMP_TAG
    601: _keep(_U16, _I16),  # DO_JUMP_TAG
    2000: _keep(_U8, _exact, _U16, _U16),  # IMAGE_START_CAPTURE
    2001: _keep(_U16),  # IMAGE_STOP_CAPTURE
    2500: _keep(_U8),  # VIDEO_START_CAPTURE
    2501: _keep(_U8),  # VIDEO_STOP_CAPTURE
    3000: _keep(_U8),  # DO_VTOL_TRANSITION
    42600: _keep(_U8, _U8, _exact, _exact),  # DO_WINCH
}
_WITH_XY: dict[int, tuple[_Keep, _Keep, _Keep, _Keep, _Keep, _Keep, _Keep]] = {
    202: (_U8, _U16, _U8, _U16, _U8, _U8, _exact),  # DO_DIGICAM_CONFIGURE
    203: (_U8, _U8, _I8, _U8, _U8, _U8, _lost),  # DO_DIGICAM_CONTROL
    1000: (_I8, _I16, _I8, _I8, _U8, _lost, _U8),  # DO_GIMBAL_MANAGER_PITCHYAW
    42703: (_U16, _I16, _I8, _I16, _I16, _lost, _lost),  # NAV_ATTITUDE_TIME
}
"""Commands whose x, y, z are parameters 5 to 7, not a position."""
_NAN_ALLOWED: dict[int, frozenset[int]] = {
    16: frozenset((4,)),
    17: frozenset((4,)),
    21: frozenset((4,)),
    22: frozenset((4,)),
    84: frozenset((4,)),
    85: frozenset((3, 4)),
}
_NOTHING: frozenset[int] = frozenset()


def _loiter_turns(turns: float, radius_m: float) -> tuple[float, float]:
    """Return (turns, radius) as two bytes keep them: part turns in 1/256, radius 10 m above 255."""
    kept_turns = _U8(turns * 256.0) / 256.0 if 0 < turns < 1 else _U8(min(255.0, turns))
    size = abs(radius_m)
    kept = _U8(size) if size <= 255 else 10.0 * _U8(min(255.0, size * 0.1))
    return kept_turns, math.copysign(kept, radius_m) if kept else 0.0


def has_position(command: int) -> bool:
    """Return whether a stored mission command carries a position."""
    return command in _WITH_POSITION


def is_navigation(command: int) -> bool:
    """Return whether a command takes the vehicle somewhere (others run beside it)."""
    return command <= 95 or command in (213, 42702, 42703)


def mission_item(item: Item) -> Item:
    """Return `item` as the autopilot stores it and reads it back.

    Parameters
    ----------
    item : Item
        As sent; parameters are single precision.

    Returns
    -------
    Item
        Normalised: frame, precision, fields that are not kept set to 0.

    Raises
    ------
    Refusal
        With the MAV_MISSION_RESULT that the autopilot answers.
    """
    may_be_nan = _NAN_ALLOWED.get(item.command, _NOTHING)
    params = (item.param1, item.param2, item.param3, item.param4)
    for number, value in enumerate(params, 1):
        if math.isinf(value) or (math.isnan(value) and number not in may_be_nan):
            raise Refusal(mavlink.MAV_MISSION_INVALID_PARAM1 + number - 1)
    if item.command in (0, 1):
        raise Refusal(mavlink.MAV_MISSION_INVALID)
    keep = _WITH_POSITION.get(item.command)
    if item.command in _WITH_XY:
        z = 0.0 if math.isnan(item.z) else item.z
        given = (*params, item.x, item.y, z)
        v1, v2, v3, v4, x, y, z = (k(v) for k, v in zip(_WITH_XY[item.command], given, strict=True))
        return Item(item.command, 0, v1, v2, v3, v4, int(x), int(y), z)
    if keep is None:
        keep = _WITHOUT_POSITION.get(item.command)
        if keep is None:
            raise Refusal(mavlink.MAV_MISSION_UNSUPPORTED)
        p1, p2, p3, p4 = (k(v) for k, v in zip(keep, params, strict=True))
        return Item(item.command, 0, p1, p2, p3, p4, 0, 0, 0.0)
    p1, p2, p3, p4 = (
        k(0.0 if math.isnan(v) else v) for k, v in zip(keep, params, strict=True)
    )  # fmt: skip
    if item.command == mavlink.MAV_CMD_NAV_LOITER_TURNS:
        p1, p3 = _loiter_turns(item.param1, item.param3)
    if abs(item.x) > 900_000_000:
        raise Refusal(mavlink.MAV_MISSION_INVALID_PARAM5_X)
    if abs(item.y) > 1_800_000_000:
        raise Refusal(mavlink.MAV_MISSION_INVALID_PARAM6_Y)
    if math.isnan(item.z) or abs(item.z) >= ALTITUDE_LIMIT_M:
        raise Refusal(mavlink.MAV_MISSION_INVALID_PARAM7)
    frame = _ANY_ALTITUDE_FRAME.get(item.frame)
    if frame is None:
        raise Refusal(mavlink.MAV_MISSION_UNSUPPORTED_FRAME)
    altitude_cm = int(_f32(_f32(item.z) * 100.0))
    return Item(item.command, frame, p1, p2, p3, p4, item.x, item.y, _f32(altitude_cm * _f32(0.01)))


# --- fence ---------------------------------------------------------------------------------------

INCLUSION = mavlink.MAV_CMD_NAV_FENCE_POLYGON_VERTEX_INCLUSION
EXCLUSION = mavlink.MAV_CMD_NAV_FENCE_POLYGON_VERTEX_EXCLUSION
CIRCLE_IN = mavlink.MAV_CMD_NAV_FENCE_CIRCLE_INCLUSION
CIRCLE_OUT = mavlink.MAV_CMD_NAV_FENCE_CIRCLE_EXCLUSION
RETURN_POINT = mavlink.MAV_CMD_NAV_FENCE_RETURN_POINT


def fence_item(item: Item) -> Item:
    """Return a fence item as stored (see :func:`mission_item`)."""
    if item.frame not in _FENCE_FRAMES:
        raise Refusal(mavlink.MAV_MISSION_UNSUPPORTED_FRAME)
    if item.command in (INCLUSION, EXCLUSION):
        if item.param1 > 255:
            raise Refusal(mavlink.MAV_MISSION_INVALID_PARAM1)
        kept = 0.0 if not math.isfinite(item.param1) else _U8(item.param1)
    elif item.command in (CIRCLE_IN, CIRCLE_OUT):
        kept = item.param1
    elif item.command == RETURN_POINT:
        kept = 0.0
    else:
        raise Refusal(mavlink.MAV_MISSION_UNSUPPORTED)
    return Item(item.command, 0, kept, 0.0, 0.0, 0.0, item.x, item.y, 0.0)


def fence_bytes(items: Sequence[Item]) -> int:
    """Return what a fence takes in the store: 8n + 2 per polygon of n points, and a header."""
    total, index = 4, 0
    while index < len(items):
        item = items[index]
        if item.command in (INCLUSION, EXCLUSION):
            total += 2 + 8 * int(item.param1)
            index += max(1, int(item.param1))
        else:
            total += 13 if item.command in (CIRCLE_IN, CIRCLE_OUT) else 9
            index += 1
    return total


def fence_fault(items: Sequence[Item]) -> str | None:
    """Return what an autopilot finds wrong with a complete fence, or None."""
    open_command, open_size, missing, returns = 0, 0, 0, 0
    for item in items:
        if item.command in (INCLUSION, EXCLUSION):
            size = int(item.param1)
            if size < 3:
                return f"Invalid vertex count ({size})"
            if missing == 0:
                open_command, open_size, missing = item.command, size, size
            elif item.command != open_command:
                return "Received incorrect vertex type"
            elif size != open_size:
                return f"Unexpected vertex count want={open_size} got={size}"
            missing -= 1
        else:
            if missing:
                return "Received incorrect type"
            if item.command == RETURN_POINT:
                returns += 1
                if returns > 1:
                    return "Multiple return points"
            elif not item.param1 > 0:
                return "Non-positive circle radius"
        if abs(item.x) > 900_000_000 or abs(item.y) > 1_800_000_000:
            return "Bad lat or lon"
    return "Incorrect item count" if missing else None


# --- rally ---------------------------------------------------------------------------------------


def rally_item(item: Item) -> Item:
    """Return a rally point as stored (see :func:`mission_item`); altitudes are whole metres."""
    if item.command != mavlink.MAV_CMD_NAV_RALLY_POINT:
        raise Refusal(mavlink.MAV_MISSION_UNSUPPORTED)
    if abs(item.x) > 900_000_000:
        raise Refusal(mavlink.MAV_MISSION_INVALID_PARAM5_X)
    if abs(item.y) > 1_800_000_000:
        raise Refusal(mavlink.MAV_MISSION_INVALID_PARAM6_Y)
    if item.z < -32768 or item.z > 32767:
        raise Refusal(mavlink.MAV_MISSION_INVALID_PARAM7)
    frame = _RALLY_FRAMES.get(item.frame)
    if frame is None:
        raise Refusal(mavlink.MAV_MISSION_UNSUPPORTED_FRAME)
    altitude = 0.0 if math.isnan(item.z) else float(int(item.z))
    return Item(item.command, frame, 0.0, 0.0, 0.0, 0.0, item.x, item.y, altitude)

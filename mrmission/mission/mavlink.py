"""The few numbers of MAVLink that a survey mission needs, and what they mean to a reader."""

from __future__ import annotations

import math
from typing import Final

FRAME_GLOBAL: Final = 0
FRAME_LOCAL_NED: Final = 1
FRAME_MISSION: Final = 2
FRAME_GLOBAL_RELATIVE_ALT: Final = 3
FRAME_GLOBAL_TERRAIN_ALT: Final = 10

NAV_WAYPOINT: Final = 16
NAV_LOITER_UNLIM: Final = 17
NAV_LOITER_TURNS: Final = 18
NAV_LOITER_TIME: Final = 19
NAV_RETURN_TO_LAUNCH: Final = 20
NAV_LAND: Final = 21
NAV_TAKEOFF: Final = 22
NAV_SPLINE_WAYPOINT: Final = 82
DO_JUMP: Final = 177
DO_CHANGE_SPEED: Final = 178
DO_SET_CAM_TRIGG_DIST: Final = 206
FENCE_RETURN_POINT: Final = 5000
FENCE_INCLUSION_VERTEX: Final = 5001
FENCE_EXCLUSION_VERTEX: Final = 5002
FENCE_INCLUSION_CIRCLE: Final = 5003
FENCE_EXCLUSION_CIRCLE: Final = 5004
RALLY_POINT: Final = 5100

SPEED_TYPE_GROUND: Final = 1.0
THROTTLE_UNCHANGED: Final = -1.0

NAVIGATION: Final = frozenset(
    {
        NAV_WAYPOINT,
        NAV_LOITER_UNLIM,
        NAV_LOITER_TURNS,
        NAV_LOITER_TIME,
        NAV_LAND,
        NAV_TAKEOFF,
        NAV_SPLINE_WAYPOINT,
    }
)
"""Commands that a vehicle travels to."""

DEGREE_FRAMES: Final = frozenset({0, 3, 5, 6, 10, 11})
"""Frames in which x and y are latitude and longitude in 1e-7 degrees; elsewhere they are plain."""

VEHICLE_TYPES: Final = {"boat": 11, "rover": 10, "copter": 2}
"""MAV_TYPE of each vehicle."""


def e7(degrees: float) -> int:
    """Return degrees as the nearest multiple of 1e-7 degrees (never truncated).

    >>> e7(34.0627131), e7(-81.29566269999999)
    (340627131, -812956627)
    """
    return round(degrees * 1e7)


def degrees(value_e7: int) -> float:
    """Return 1e-7 degrees as a float that gives the integer back, rounded or truncated.

    Readers that truncate exist (MAVSDK 4.1 does), so where ``value / 1e7 * 1e7`` falls short of
    the integer the next float away from zero is taken.

    >>> int(29749744 / 1e7 * 1e7), int(degrees(29749744) * 1e7)
    (29749743, 29749744)
    """
    value = value_e7 / 1e7
    while int(value * 1e7) != value_e7:
        value = math.nextafter(value, math.copysign(math.inf, value))
    return value


def degrees_text(value_e7: int) -> str:
    """Return 1e-7 degrees as decimal degrees, exactly.

    >>> degrees_text(-812956627)
    '-81.2956627'
    """
    sign = "-" if value_e7 < 0 else ""
    whole, part = divmod(abs(value_e7), 10_000_000)
    return f"{sign}{whole}.{part:07d}"


def wrap_lon_deg(lon_deg: float) -> float:
    """Return a longitude within -180..180 (areas across the antimeridian leave that range).

    >>> wrap_lon_deg(181.5), wrap_lon_deg(180.0), wrap_lon_deg(-180.25)
    (-178.5, 180.0, 179.75)
    """
    if -180.0 <= lon_deg <= 180.0:
        return lon_deg
    return math.remainder(lon_deg, 360.0)

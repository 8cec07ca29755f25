"""ArduCopter's modes that a simulated copter knows, and what it is doing in them."""

from __future__ import annotations

import enum


class CopterMode(enum.IntEnum):
    """ArduCopter's mode numbers that a simulated copter knows."""

    STABILIZE = 0
    ALT_HOLD = 2
    AUTO = 3
    GUIDED = 4
    LOITER = 5
    RTL = 6
    LAND = 9
    BRAKE = 17


ARMABLE = frozenset(
    {CopterMode.STABILIZE, CopterMode.ALT_HOLD, CopterMode.GUIDED, CopterMode.LOITER}
)
NAVIGATING = frozenset(
    {
        CopterMode.AUTO,
        CopterMode.GUIDED,
        CopterMode.LOITER,
        CopterMode.RTL,
        CopterMode.LAND,
        CopterMode.BRAKE,
    }
)


class Stage(enum.Enum):
    """What a copter is doing, whatever its mode."""

    LANDED = enum.auto()
    TAKEOFF = enum.auto()
    ROUTE = enum.auto()
    HOVER = enum.auto()
    LAND = enum.auto()


class Homeward(enum.Enum):
    """The steps of a return."""

    CLIMB = enum.auto()
    CROSS = enum.auto()
    WAIT = enum.auto()
    LAND = enum.auto()

"""The parameters of a simulated boat: names, types and defaults of ArduPilot Rover.

Only parameters that a ground station or mrmission asks for are there (a real Rover has about a
thousand). Those in :data:`IN_FORCE` change what the simulated boat does; the others are stored and
read back, nothing more.
"""

from __future__ import annotations

import math
import struct
from collections.abc import Mapping, Sequence

INT8, INT16, INT32, REAL32 = 2, 4, 6, 9
"""MAV_PARAM_TYPE values."""
_RANGE = {
    INT8: (-(2**7), 2**7 - 1),
    INT16: (-(2**15), 2**15 - 1),
    INT32: (-(2**31), 2**31 - 1),
}

_TABLE: tuple[tuple[str, int, float], ...] = (
    ("ARMING_CHECK", INT32, 1),
    ("ARMING_MIS_ITEMS", INT32, 0),
    ("ARMING_OPTIONS", INT32, 0),
    ("ARMING_REQUIRE", INT8, 1),
    ("ATC_ACCEL_MAX", REAL32, 1.0),
    ("ATC_DECEL_MAX", REAL32, 0.0),
    ("ATC_STOP_SPEED", REAL32, 0.1),
    ("ATC_STR_ACC_MAX", REAL32, 120.0),
    ("ATC_STR_ANG_P", REAL32, 2.0),
    ("ATC_STR_RAT_MAX", REAL32, 120.0),
    ("ATC_TURN_MAX_G", REAL32, 0.6),
    ("AUTO_KICKSTART", REAL32, 0.0),
    ("AUTO_TRIGGER_PIN", INT8, -1),
    ("AVOID_ACCEL_MAX", REAL32, 3.0),
    ("AVOID_BACKUP_DZ", REAL32, 0.1),
    ("AVOID_BACKUP_SPD", REAL32, 0.75),
    ("AVOID_BEHAVE", INT8, 0),
    ("AVOID_ENABLE", INT8, 3),
    ("AVOID_MARGIN", REAL32, 2.0),
    ("BATT_CRT_MAH", REAL32, 0.0),
    ("BATT_CRT_VOLT", REAL32, 0.0),
    ("BATT_FS_CRT_ACT", INT8, 0),
    ("BATT_FS_LOW_ACT", INT8, 0),
    ("BATT_LOW_MAH", REAL32, 0.0),
    ("BATT_LOW_VOLT", REAL32, 10.5),
    ("BATT_MONITOR", INT8, 4),
    ("BRD_SD_FENCE", INT16, 0),
    ("BRD_SD_MISSION", INT16, 0),
    ("CAM1_TYPE", INT8, 0),
    ("CIRC_RADIUS", REAL32, 20.0),
    ("CIRC_SPEED", REAL32, 0.0),
    ("CRUISE_SPEED", REAL32, 2.0),
    ("CRUISE_THROTTLE", INT8, 50),
    ("FENCE_ACTION", INT8, 1),
    ("FENCE_ENABLE", INT8, 0),
    ("FENCE_MARGIN", REAL32, 2.0),
    ("FENCE_OPTIONS", INT16, 0),
    ("FENCE_RADIUS", REAL32, 300.0),
    ("FENCE_TOTAL", INT8, 0),
    ("FENCE_TYPE", INT8, 6),
    ("FORMAT_VERSION", INT16, 16),
    ("FRAME_CLASS", INT8, 2),
    ("FRAME_TYPE", INT8, 0),
    ("FS_ACTION", INT8, 2),
    ("FS_CRASH_CHECK", INT8, 0),
    ("FS_EKF_ACTION", INT8, 1),
    ("FS_EKF_THRESH", REAL32, 0.8),
    ("FS_GCS_ENABLE", INT8, 0),
    ("FS_GCS_TIMEOUT", REAL32, 5.0),
    ("FS_OPTIONS", INT32, 0),
    ("FS_THR_ENABLE", INT8, 1),
    ("FS_THR_VALUE", INT16, 910),
    ("FS_TIMEOUT", REAL32, 1.5),
    ("GPS_TYPE", INT8, 1),
    ("INITIAL_MODE", INT8, 4),
    ("LOG_BITMASK", INT32, 65535),
    ("LOIT_RADIUS", REAL32, 2.0),
    ("LOIT_SPEED_GAIN", REAL32, 0.5),
    ("LOIT_TYPE", INT8, 0),
    ("MIS_DONE_BEHAVE", INT8, 1),
    ("MIS_OPTIONS", INT16, 0),
    ("MIS_RESTART", INT8, 0),
    ("MIS_TOTAL", INT16, 0),
    ("MODE1", INT8, 0),
    ("MODE2", INT8, 0),
    ("MODE3", INT8, 11),
    ("MODE4", INT8, 10),
    ("MODE5", INT8, 2),
    ("MODE6", INT8, 0),
    ("MODE_CH", INT8, 8),
    ("OA_TYPE", INT8, 0),
    ("PILOT_STEER_TYPE", INT8, 0),
    ("RALLY_INCL_HOME", INT8, 1),
    ("RALLY_LIMIT_KM", REAL32, 0.5),
    ("RALLY_TOTAL", INT8, 0),
    ("RTL_SPEED", REAL32, 0.0),
    ("SERVO1_FUNCTION", INT16, 26),
    ("SERVO3_FUNCTION", INT16, 70),
    ("SIM_TIDE_DIR", REAL32, 0.0),
    ("SIM_TIDE_SPEED", REAL32, 0.0),
    ("SPEED_MAX", REAL32, 0.0),
    ("SRTL_ACCURACY", REAL32, 2.0),
    ("SRTL_OPTIONS", INT32, 0),
    ("SRTL_POINTS", INT16, 300),
    ("STICK_MIXING", INT8, 0),
    ("SYSID_ENFORCE", INT8, 0),
    ("SYSID_MYGCS", INT16, 255),
    ("SYSID_THISMAV", INT16, 1),
    ("TELEM_DELAY", INT8, 0),
    ("TURN_RADIUS", REAL32, 0.9),
    ("WP_ACCEL", REAL32, 0.0),
    ("WP_JERK", REAL32, 0.0),
    ("WP_PIVOT_ANGLE", INT16, 60),
    ("WP_PIVOT_DELAY", INT8, 0),
    ("WP_PIVOT_RATE", INT16, 60),
    ("WP_RADIUS", REAL32, 2.0),
    ("WP_SPEED", REAL32, 2.0),
)

IN_FORCE = frozenset(
    {
        "BRD_SD_FENCE",
        "BRD_SD_MISSION",
        "CAM1_TYPE",
        "CIRC_RADIUS",
        "FENCE_ACTION",
        "FENCE_ENABLE",
        "FENCE_OPTIONS",
        "FENCE_RADIUS",
        "FENCE_TYPE",
        "INITIAL_MODE",
        "LOIT_RADIUS",
        "LOIT_SPEED_GAIN",
        "MIS_DONE_BEHAVE",
        "MIS_RESTART",
        "RALLY_INCL_HOME",
        "RALLY_LIMIT_KM",
        "RTL_SPEED",
        "SIM_TIDE_DIR",
        "SIM_TIDE_SPEED",
        "SPEED_MAX",
        "SRTL_ACCURACY",
        "SRTL_POINTS",
        "SYSID_THISMAV",
        "WP_RADIUS",
        "WP_SPEED",
    }
)
"""Parameters that change what a simulated boat does (BRD_SD_*, SYSID_* after a reboot)."""
READ_ONLY = frozenset({"MIS_TOTAL", "FORMAT_VERSION"})


class Parameters:
    """Parameter values of one vehicle, in a fixed order.

    Parameters
    ----------
    changed : mapping of str to float
        Values that differ from the defaults; a name that is not in the table is added (REAL32).
    table : sequence of (name, type, default)
        All parameters of the vehicle; a boat's where not given.
    """

    def __init__(
        self,
        changed: Mapping[str, float] | None = None,
        table: Sequence[tuple[str, int, float]] = _TABLE,
    ) -> None:
        self._type = {name: kind for name, kind, _ in table}
        self._value = {name: float(value) for name, _, value in table}
        for name, value in (changed or {}).items():
            self._type.setdefault(name, REAL32)
            self._value[name] = self._fitted(name, value)
        self.names = tuple(self._value)

    def __len__(self) -> int:
        return len(self.names)

    def __contains__(self, name: object) -> bool:
        return name in self._value

    def __getitem__(self, name: str) -> float:
        return self._value[name]

    def type_of(self, name: str) -> int:
        """Return the MAV_PARAM_TYPE of a parameter."""
        return self._type[name]

    def put(self, name: str, value: float) -> None:
        """Set a value without any check (for counters the vehicle itself keeps)."""
        self._value[name] = value

    def set(self, name: str, value: float) -> bool:
        """Set a value as PARAM_SET does; False where the parameter refuses it."""
        if name not in self._value or name in READ_ONLY or not math.isfinite(value):
            return False
        self._value[name] = self._fitted(name, value)
        return True

    def _fitted(self, name: str, value: float) -> float:
        kind = self._type[name]
        if kind == REAL32:
            single: float = struct.unpack("<f", struct.pack("<f", value))[0]
            return single
        low, high = _RANGE[kind]
        return float(min(high, max(low, math.floor(value + 0.5))))

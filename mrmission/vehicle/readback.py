"""Does a vehicle store what it was sent? Pure comparison, with the autopilot's rounding in mind.

ArduPilot does not store MISSION_ITEM_INT as it comes: it packs items into 15 bytes. What is read
back therefore differs from what was sent in known ways, and only these are forgiven:

* item 0 of a mission is the vehicle's own home, whatever was sent;
* frames are folded: GLOBAL_INT (5) to GLOBAL (0), GLOBAL_RELATIVE_ALT_INT (6) to 3,
  GLOBAL_TERRAIN_ALT_INT (11) to 10;
* ``x`` and ``y`` come back exactly; altitudes in whole centimetres (rally points: metres), cut;
* parameters come back as float32, some as whole numbers, and those that a command does not use
  as 0; NaN means 0;
* ``current`` and ``autocontinue`` are the vehicle's to set.
"""

from __future__ import annotations

import hashlib
import math
import struct
from collections.abc import Sequence
from dataclasses import dataclass

from mrmission.vehicle.items import MissionType, RawItem

STORED_FRAME = {5: 0, 6: 3, 11: 10}
"""MAV_FRAME that is read back for the one that was sent, where they differ."""

ALTITUDE_STEP_M = {MissionType.MISSION: 0.01, MissionType.FENCE: math.inf, MissionType.RALLY: 1.0}
"""Resolution of a stored altitude; a fence vertex has none."""

USED_PARAMS = {
    16: (1,),  # NAV_WAYPOINT: delay; radii and yaw are a plane's or another autopilot's
    17: (3,),  # NAV_LOITER_UNLIM: radius
    18: (1, 3),  # NAV_LOITER_TURNS
    19: (1,),  # NAV_LOITER_TIME
    20: (),  # NAV_RETURN_TO_LAUNCH
    21: (1,),  # NAV_LAND
    22: (1,),  # NAV_TAKEOFF
    178: (1, 2, 3),  # DO_CHANGE_SPEED
    206: (1, 3),  # DO_SET_CAM_TRIGG_DIST
    5001: (1,),
    5002: (1,),
    5100: (),
}
"""Parameters an ArduPilot vehicle stores for a command; for one not named here, all four count."""

WHOLE_PARAMS = {(16, 1), (17, 3), (18, 1), (18, 3), (19, 1), (21, 1), (22, 1), (178, 1)}
"""(command, parameter) pairs that are stored as whole numbers."""

FLAG_PARAMS = {(18, 4), (19, 3), (19, 4), (21, 4), (31, 4)}
"""(command, parameter) pairs that a vehicle reduces to a flag or a sign."""

NO_POSITION_COMMANDS = frozenset({20, 178, 206})
"""Commands whose x, y, z mean nothing and are not stored."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Mismatch:
    """One thing that a vehicle stores otherwise than it was sent."""

    mission_type: MissionType
    seq: int
    field: str
    sent: float
    stored: float

    def __str__(self) -> str:
        if self.field == "count":
            return f"{self.mission_type.label}: {self.sent:g} items sent, {self.stored:g} stored"
        return (
            f"{self.mission_type.label} item {self.seq}: {self.field} sent {_show(self.sent)}, "
            f"stored {_show(self.stored)}"
        )


def _show(value: float) -> str:
    return str(value) if isinstance(value, int) else f"{value:.7g}"


def _float32(value: float) -> float:
    """Return `value` as it looks after a trip through a MAVLink float field; NaN counts as 0."""
    if math.isnan(value):
        return 0.0
    result: float = struct.unpack("<f", struct.pack("<f", value))[0]
    return result


def _same_param(command: int, number: int, sent: float, stored: float) -> bool:
    sent, stored = _float32(sent), _float32(stored)
    if sent == stored:
        return True
    if (command, number) in FLAG_PARAMS and stored in (-1.0, 0.0, 1.0):
        return True
    if number not in USED_PARAMS.get(command, (1, 2, 3, 4)):
        return stored == 0.0
    # Cut towards zero or rounded: autopilots do either, depending on the field.
    if (command, number) in WHOLE_PARAMS and stored in (math.trunc(sent), round(sent)):
        return True
    # Distances and speeds are stored in hundredths by some commands.
    return math.isclose(sent, stored, rel_tol=1e-6, abs_tol=1e-6)


def _same_altitude(mission_type: MissionType, sent: float, stored: float) -> bool:
    # A cut loses almost one step; float32 adds a little at large heights.
    step_m = ALTITUDE_STEP_M[mission_type]
    if math.isinf(step_m):
        return True
    return abs(_float32(sent) - _float32(stored)) <= step_m * 1.001 + 1e-6 * abs(sent)


def stored_frame(frame: int) -> int:
    """Return the MAV_FRAME that ArduPilot reads back for `frame`."""
    return STORED_FRAME.get(frame, frame)


def compare_items(
    sent: Sequence[RawItem], stored: Sequence[RawItem], mission_type: MissionType
) -> list[Mismatch]:
    """Return every difference between what was sent and what a vehicle stores.

    Parameters
    ----------
    sent, stored
        Items of one store, in order. Of item 0 of a mission, the vehicle's home, only the
        existence is compared.
    mission_type
        Which store they belong to.

    Returns
    -------
    list of Mismatch
        Empty when the vehicle stores what was sent. A wrong count is the first entry.
    """
    out: list[Mismatch] = []

    def differ(seq: int, field: str, a: float, b: float) -> None:
        out.append(Mismatch(mission_type=mission_type, seq=seq, field=field, sent=a, stored=b))

    if len(sent) != len(stored):
        # A mission without work is stored as home alone, or as nothing.
        if mission_type is MissionType.MISSION and not sent and len(stored) <= 1:
            return []
        differ(0, "count", len(sent), len(stored))
    for index, (a, b) in enumerate(zip(sent, stored, strict=False)):
        if b.seq != index:
            differ(index, "seq", index, b.seq)
        if b.mission_type != mission_type:
            differ(index, "mission_type", mission_type, b.mission_type)
        if mission_type is MissionType.MISSION and index == 0:
            continue
        if a.command != b.command:
            differ(index, "command", a.command, b.command)
            continue
        placed = a.command not in NO_POSITION_COMMANDS
        if (
            placed
            and mission_type is MissionType.MISSION
            and stored_frame(a.frame) != stored_frame(b.frame)
        ):
            differ(index, "frame", stored_frame(a.frame), b.frame)
        for number in (1, 2, 3, 4):
            name = f"param{number}"
            p, q = getattr(a, name), getattr(b, name)
            if not _same_param(a.command, number, p, q):
                differ(index, name, p, q)
        if placed:
            if a.x != b.x:
                differ(index, "x", a.x, b.x)
            if a.y != b.y:
                differ(index, "y", a.y, b.y)
            if not _same_altitude(mission_type, a.z, b.z):
                differ(index, "z", a.z, b.z)
    return out


def normalised(item: RawItem, mission_type: MissionType) -> tuple[int | float, ...]:
    """Return the part of a stored item that says what it is, the same at every reading."""
    # Adding 0 makes one zero of the two that there are.
    params = tuple(_float32(getattr(item, f"param{n}")) + 0.0 for n in (1, 2, 3, 4))
    if item.command in NO_POSITION_COMMANDS:
        return (item.command, *params)
    frame = stored_frame(item.frame) if mission_type is MissionType.MISSION else 0
    return (item.command, *params, frame, item.x, item.y, _float32(item.z) + 0.0)


def stored_sha256(items: Sequence[RawItem], mission_type: MissionType) -> str:
    """Return the SHA-256 of a store as it was read back, home left out, in hex.

    What was read back and not what was sent: a vehicle rounds, and rounds the same way tomorrow.
    Home is left out because the vehicle sets it anew whenever it is armed.
    """
    digest = hashlib.sha256()
    skip = 1 if mission_type is MissionType.MISSION else 0
    for item in items[skip:]:
        digest.update(repr(normalised(item, mission_type)).encode())
        digest.update(b"\n")
    return digest.hexdigest()

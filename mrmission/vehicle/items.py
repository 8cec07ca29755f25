"""A mission as the three lists of MISSION_ITEM_INT that a vehicle stores."""

from __future__ import annotations

import enum
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from mrmission.errors import UploadError
from mrmission.model import FencePolygon, Mission, MissionItem, RallyPoint, read_only

FRAME_GLOBAL = 0
FRAME_GLOBAL_RELATIVE_ALT = 3
NAV_FENCE_POLYGON_VERTEX_INCLUSION = 5001
NAV_FENCE_POLYGON_VERTEX_EXCLUSION = 5002
NAV_RALLY_POINT = 5100


class MissionType(enum.IntEnum):
    """MAV_MISSION_TYPE: which of a vehicle's three stores is meant."""

    MISSION = 0
    FENCE = 1
    RALLY = 2

    @property
    def label(self) -> str:
        """What messages to people call it."""
        return ("mission", "fence", "rally points")[self]

    @property
    def empty_count(self) -> int:
        """The most items that an empty store counts: a mission may still count its home."""
        return 1 if self is MissionType.MISSION else 0


@dataclass(frozen=True, slots=True, kw_only=True)
class RawItem:
    """One MISSION_ITEM_INT of any of the three stores; ``x``/``y`` are lat/lon in 1e-7 degrees."""

    seq: int
    frame: int
    command: int
    current: int = 0
    autocontinue: int = 1
    param1: float = 0.0
    param2: float = 0.0
    param3: float = 0.0
    param4: float = 0.0
    x: int = 0
    y: int = 0
    z: float = 0.0
    mission_type: int = MissionType.MISSION


def mission_to_raw(items: Sequence[MissionItem]) -> tuple[RawItem, ...]:
    """Return mission items as they are sent: home first, item 0 the only current one.

    A mission of home alone carries no work; it is returned empty, because a vehicle is then to
    hold no mission at all.
    """
    if len(items) < 2:
        return ()
    return tuple(
        RawItem(
            seq=seq,
            frame=item.frame,
            command=item.command,
            # MAVSDK refuses a list with none or several current items.
            current=int(seq == 0),
            autocontinue=item.autocontinue,
            param1=item.param1,
            param2=item.param2,
            param3=item.param3,
            param4=item.param4,
            x=item.x,
            y=item.y,
            z=item.z,
        )
        for seq, item in enumerate(items)
    )


def fence_to_raw(polygons: Sequence[FencePolygon]) -> tuple[RawItem, ...]:
    """Return fence polygons as vertices, each carrying its polygon's vertex count in param1."""
    out: list[RawItem] = []
    for polygon in polygons:
        command = (
            NAV_FENCE_POLYGON_VERTEX_INCLUSION
            if polygon.inclusion
            else NAV_FENCE_POLYGON_VERTEX_EXCLUSION
        )
        count = len(polygon.points_e7)
        for lat_e7, lon_e7 in polygon.points_e7.tolist():
            out.append(
                RawItem(
                    seq=len(out),
                    frame=FRAME_GLOBAL,
                    command=command,
                    # MAVSDK's transfer checks `current` of every store by the same rule.
                    current=int(not out),
                    param1=float(count),
                    x=lat_e7,
                    y=lon_e7,
                    mission_type=MissionType.FENCE,
                )
            )
    return tuple(out)


def rally_to_raw(points: Sequence[RallyPoint]) -> tuple[RawItem, ...]:
    """Return rally points as items, altitude above home."""
    return tuple(
        RawItem(
            seq=seq,
            frame=FRAME_GLOBAL_RELATIVE_ALT,
            command=NAV_RALLY_POINT,
            current=int(seq == 0),
            x=point.lat_e7,
            y=point.lon_e7,
            z=point.altitude_m,
            mission_type=MissionType.RALLY,
        )
        for seq, point in enumerate(points)
    )


def to_raw(mission: Mission) -> dict[MissionType, tuple[RawItem, ...]]:
    """Return everything a vehicle gets for `mission`, one tuple per store."""
    return {
        MissionType.MISSION: mission_to_raw(mission.items),
        MissionType.FENCE: fence_to_raw(mission.fence),
        MissionType.RALLY: rally_to_raw(mission.rally),
    }


def mission_from_raw(items: Sequence[RawItem]) -> tuple[MissionItem, ...]:
    """Return downloaded items of the mission store as the model's items."""
    return tuple(
        MissionItem(
            seq=item.seq,
            frame=item.frame,
            command=item.command,
            current=item.current,
            autocontinue=item.autocontinue,
            param1=item.param1,
            param2=item.param2,
            param3=item.param3,
            param4=item.param4,
            x=item.x,
            y=item.y,
            z=item.z,
        )
        for item in items
    )


def fence_from_raw(items: Sequence[RawItem]) -> tuple[FencePolygon, ...]:
    """Return downloaded fence vertices as polygons.

    Raises
    ------
    UploadError
        When an item is no polygon vertex, or a polygon ends before its vertex count.
    """
    out: list[FencePolygon] = []
    index = 0
    while index < len(items):
        first = items[index]
        if first.command not in (
            NAV_FENCE_POLYGON_VERTEX_INCLUSION,
            NAV_FENCE_POLYGON_VERTEX_EXCLUSION,
        ):
            raise UploadError(f"fence item {index}: command {first.command} is no polygon vertex")
        count = int(first.param1)
        part = items[index : index + count]
        if count < 3 or len(part) < count or any(p.command != first.command for p in part):
            raise UploadError(
                f"fence item {index}: its polygon should have {count} vertices and does not"
            )
        out.append(
            FencePolygon(
                inclusion=first.command == NAV_FENCE_POLYGON_VERTEX_INCLUSION,
                points_e7=read_only(np.array([(p.x, p.y) for p in part], dtype=np.int64)),
            )
        )
        index += count
    return tuple(out)


def rally_from_raw(items: Sequence[RawItem]) -> tuple[RallyPoint, ...]:
    """Return downloaded rally items as rally points."""
    return tuple(RallyPoint(lat_e7=i.x, lon_e7=i.y, altitude_m=i.z) for i in items)

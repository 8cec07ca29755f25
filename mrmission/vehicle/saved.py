"""What a vehicle held before: read before the first byte, kept, written back after a failure."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from dataclasses import asdict, replace
from functools import partial
from pathlib import Path
from typing import Any

from mrmission.errors import MrMissionError, ReadbackMismatchError
from mrmission.mission import mavlink
from mrmission.mission.files import write_whole
from mrmission.mission.qgc_plan import plan_text
from mrmission.model import Mission
from mrmission.vehicle.items import (
    MissionType,
    RawItem,
    fence_from_raw,
    mission_from_raw,
    rally_from_raw,
)
from mrmission.vehicle.links import StoreVehicle, TransferError
from mrmission.vehicle.readback import compare_items
from mrmission.vehicle.retry import Tries

Contents = Mapping[MissionType, tuple[RawItem, ...]]
"""What the three stores of a vehicle hold; a mission of home alone counts as none."""

ORDER = (MissionType.FENCE, MissionType.RALLY, MissionType.MISSION)
"""The order of sending: the mission last."""
FOLDER = "saved"

_CIRCLES = {mavlink.FENCE_INCLUSION_CIRCLE: True, mavlink.FENCE_EXCLUSION_CIRCLE: False}
"""Fence circles: whether it is an inclusion."""
_POLYGONS = (mavlink.FENCE_INCLUSION_VERTEX, mavlink.FENCE_EXCLUSION_VERTEX)


def is_empty(contents: Contents) -> bool:
    """Return whether nothing is stored at all."""
    return not any(contents.values())


async def read_store(vehicle: StoreVehicle, kind: MissionType, tries: Tries) -> tuple[RawItem, ...]:
    """Return what one store holds, as a whole.

    Raises
    ------
    VehicleError
        When it cannot be read.
    """
    count = await tries.run(partial(vehicle.stored_count, kind))
    if count <= kind.empty_count:
        return ()
    return await tries.run(partial(_whole, vehicle, kind, count))


async def _whole(vehicle: StoreVehicle, kind: MissionType, count: int) -> tuple[RawItem, ...]:
    """Read a store once; a reading that a repeated packet has garbled is no reading."""
    items = await vehicle.download(kind)
    if len(items) != count or any(item.seq != seq for seq, item in enumerate(items)):
        raise TransferError(
            f"vehicle {vehicle.system_id} on {vehicle.connection.url}: its {kind.label} was read "
            f"as {len(items)} items in disorder, and it holds {count}",
            result="ERROR",
        )
    return items


async def write_store(
    vehicle: StoreVehicle, kind: MissionType, items: Sequence[RawItem], tries: Tries
) -> None:
    """Write items of an earlier reading back into a store, and compare what it holds then.

    Raises
    ------
    VehicleError
        When they cannot be written, or are not what is read back.
    """
    if not items:
        await tries.run(partial(vehicle.clear, kind))
    else:
        # MAVSDK refuses a list with none or several current items.
        sent = [replace(item, current=int(item.seq == 0), autocontinue=1) for item in items]
        await tries.run(partial(vehicle.upload, kind, sent), count=len(sent))
    wrong = compare_items(items, await read_store(vehicle, kind, tries), kind)
    if wrong:
        raise ReadbackMismatchError(f"{wrong[0]}")


async def restore(vehicle: StoreVehicle, contents: Contents, tries: Tries) -> None:
    """Put back what a vehicle held, and verify it; the old mission never meets the new fence.

    Raises
    ------
    VehicleError
        When that does not succeed; the stores then hold anything.
    """
    await tries.run(partial(vehicle.clear, MissionType.MISSION))
    for kind in ORDER:
        await write_store(vehicle, kind, contents[kind], tries)


# --- files ---------------------------------------------------------------------------------------


def save_contents(folder: Path, system_id: int, contents: Contents, vehicle: str) -> Path:
    """Write what a vehicle holds to ``saved/vehicle-<system id>-<n>.plan``, never over another.

    Parameters
    ----------
    folder
        Where the folder ``saved`` is made.
    system_id, contents
        Whose, and what.
    vehicle
        boat, rover or copter: what the file says of it.

    Returns
    -------
    Path
        The file; one that holds the same already is not written again. What no ``.plan`` can say
        is written as ``.json``, item by item.
    """
    name, text = f"vehicle-{system_id}", ""
    try:
        text, suffix = contents_plan_text(contents, vehicle), "plan"
    except (MrMissionError, KeyError, ValueError):
        items = {kind.name.lower(): [asdict(i) for i in contents[kind]] for kind in MissionType}
        text, suffix = json.dumps(items, indent=1) + "\n", "json"
    number = 1
    while True:
        path = folder / FOLDER / f"{name}-{number}.{suffix}"
        if not path.exists():
            write_whole(path, text)
            return path
        if path.read_text(encoding="utf-8") == text:
            return path
        number += 1


def contents_plan_text(contents: Contents, vehicle: str) -> str:
    """Return what a vehicle holds as a ``.plan`` file, circles and return point of its fence too.

    Raises
    ------
    UploadError
        When its fence is none.
    """
    fence = contents[MissionType.FENCE]
    polygons = [item for item in fence if item.command in _POLYGONS]
    mission = Mission(
        robot=1,
        sortie=1,
        vehicle=vehicle,
        items=mission_from_raw(contents[MissionType.MISSION]),
        fence=fence_from_raw(polygons),
        rally=rally_from_raw(contents[MissionType.RALLY]),
    )
    first = next((item for kind in MissionType for item in contents[kind]), None)
    home = (0.0, 0.0) if first is None else (first.y / 1e7, first.x / 1e7)
    document: dict[str, Any] = json.loads(plan_text(mission, home))
    geofence = document["geoFence"]
    for item in fence:
        place = [mavlink.degrees(item.x), mavlink.degrees(item.y)]
        if item.command in _CIRCLES:
            geofence["circles"].append(
                {
                    "circle": {"center": place, "radius": item.param1},
                    "inclusion": _CIRCLES[item.command],
                    "version": 1,
                }
            )
        elif item.command == mavlink.FENCE_RETURN_POINT:
            geofence["breachReturn"] = [*place, item.z]
        elif item.command not in _POLYGONS:
            raise ValueError(f"fence item {item.seq}: command {item.command}")
    return json.dumps(document, indent=1, sort_keys=True, allow_nan=False) + "\n"

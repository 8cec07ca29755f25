"""``fleet.json``: which vehicle got which tour, and the hash of what it stores."""

from __future__ import annotations

import json
from collections.abc import Collection, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path

from mrmission.errors import PlanFormatError
from mrmission.mission.files import write_whole
from mrmission.model import Mission
from mrmission.vehicle.items import MissionType, to_raw
from mrmission.vehicle.readback import items_sha256

FILE_NAME = "fleet.json"
_VERSION = 1


@dataclass(frozen=True, slots=True, kw_only=True)
class StoredRecord:
    """What one vehicle stores, as read back: item counts and hashes of its three stores."""

    robot: int
    system_id: int
    link: str
    mission_items: int
    fence_items: int
    rally_points: int
    mission_sha256: str
    fence_sha256: str
    rally_sha256: str


def record_of(mission: Mission, *, system_id: int, link: str) -> StoredRecord:
    """Return the record of a vehicle that was verified to store `mission`."""
    raw = to_raw(mission)
    sha = {kind: items_sha256(items, kind) for kind, items in raw.items()}
    return StoredRecord(
        robot=mission.robot,
        system_id=system_id,
        link=link,
        mission_items=len(raw[MissionType.MISSION]),
        fence_items=len(raw[MissionType.FENCE]),
        rally_points=len(raw[MissionType.RALLY]),
        mission_sha256=sha[MissionType.MISSION],
        fence_sha256=sha[MissionType.FENCE],
        rally_sha256=sha[MissionType.RALLY],
    )


def write_record(
    directory: Path, records: Sequence[StoredRecord], forget: Collection[int] = ()
) -> Path:
    """Write ``fleet.json`` into `directory`, whole or not at all; return its path.

    Robots that are not in `records` keep the entry of an earlier run: a second run completes the
    rest, and the record with it. Those in `forget`, whose vehicles may hold something else by now,
    lose it.
    """
    path = directory / FILE_NAME
    merged = {record.robot: record for record in read_record(directory)}
    taken = {record.system_id for record in records}
    merged = {
        robot: old
        for robot, old in merged.items()
        if old.system_id not in taken and robot not in forget
    }
    merged.update({record.robot: record for record in records})
    content = {
        "version": _VERSION,
        "vehicles": [asdict(merged[robot]) for robot in sorted(merged)],
    }
    write_whole(path, json.dumps(content, indent=2) + "\n", overwrite=True)
    return path


def read_record(directory: Path) -> tuple[StoredRecord, ...]:
    """Return the records in `directory`, none where there is no file.

    Raises
    ------
    PlanFormatError
        When the file is there and cannot be read.
    """
    path = directory / FILE_NAME
    if not path.exists():
        return ()
    try:
        content = json.loads(path.read_text(encoding="utf-8"))
        if content["version"] != _VERSION:
            raise PlanFormatError(
                f"{path}: version {content['version']}, expected {_VERSION}; delete the file"
            )
        return tuple(StoredRecord(**entry) for entry in content["vehicles"])
    except (OSError, ValueError, KeyError, TypeError) as error:
        if isinstance(error, PlanFormatError):
            raise
        raise PlanFormatError(f"{path}: not a fleet record ({error}); delete the file") from error

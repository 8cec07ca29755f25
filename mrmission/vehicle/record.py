"""``fleet.json``: which vehicle got which tour, and the hash of what it stores.

The file is a journal too. Before the first byte goes to a vehicle, its entry says ``unfinished``;
only a verified upload, or a vehicle that is known to hold its old mission or none, changes that.
So a run that died in the middle is known to the next one, which does not take the remains for an
old mission that is worth putting back.
"""

from __future__ import annotations

import enum
import json
from collections.abc import Mapping
from dataclasses import asdict, dataclass, replace
from pathlib import Path

from mrmission.errors import PlanFormatError
from mrmission.mission.files import write_whole
from mrmission.vehicle.items import MissionType, RawItem
from mrmission.vehicle.readback import stored_sha256

FILE_NAME = "fleet.json"
_VERSION = 2


class RecordState(enum.StrEnum):
    """What is known of a vehicle."""

    VERIFIED = "verified"
    """It was read back and stored the plan."""
    UNFINISHED = "unfinished"
    """An upload to it began, and nobody saw it end: it may hold anything."""
    FAILED = "failed"
    """An upload to it failed; it holds its old mission or none."""


@dataclass(frozen=True, slots=True, kw_only=True)
class StoredRecord:
    """One vehicle: whose tour it has, and item counts and hashes of its three stores, as read.

    `sortie` is the trip of that robot that it holds. Counts are 0 and hashes empty unless the
    state is verified.
    """

    robot: int
    system_id: int
    link: str
    state: RecordState
    mission_items: int = 0
    fence_items: int = 0
    rally_points: int = 0
    mission_sha256: str = ""
    fence_sha256: str = ""
    rally_sha256: str = ""
    sortie: int = 1

    def sha256(self, kind: MissionType) -> str:
        """Return the hash of one store."""
        return (self.mission_sha256, self.fence_sha256, self.rally_sha256)[kind]

    def items(self, kind: MissionType) -> int:
        """Return the item count of one store."""
        return (self.mission_items, self.fence_items, self.rally_points)[kind]


def record_of(
    robot: int,
    system_id: int,
    link: str,
    stored: Mapping[MissionType, tuple[RawItem, ...]],
    sortie: int = 1,
) -> StoredRecord:
    """Return the record of a vehicle that was verified, from what was read back of it."""
    sha = {kind: stored_sha256(stored[kind], kind) for kind in MissionType}
    return StoredRecord(
        robot=robot,
        system_id=system_id,
        link=link,
        state=RecordState.VERIFIED,
        mission_items=len(stored[MissionType.MISSION]),
        fence_items=len(stored[MissionType.FENCE]),
        rally_points=len(stored[MissionType.RALLY]),
        mission_sha256=sha[MissionType.MISSION],
        fence_sha256=sha[MissionType.FENCE],
        rally_sha256=sha[MissionType.RALLY],
        sortie=sortie,
    )


class FleetFile:
    """The record of a folder; every change is on the disk, whole, before it returns.

    Robots that are not touched keep the entry of an earlier run: a second run completes the rest,
    and the record with it.

    Parameters
    ----------
    directory
        Where ``fleet.json`` lies or is to lie.

    Raises
    ------
    PlanFormatError
        When the file is there and cannot be read.
    """

    def __init__(self, directory: Path) -> None:
        self.directory = directory
        self._records = {record.robot: record for record in read_record(directory)}

    @property
    def pairs(self) -> dict[int, int]:
        """Robot to system id, as the last runs had it."""
        return {record.robot: record.system_id for record in self._records.values()}

    def remains(self, system_id: int) -> bool:
        """Return whether a vehicle may hold the remains of an upload that nobody saw end."""
        return any(
            record.system_id == system_id and record.state is RecordState.UNFINISHED
            for record in self._records.values()
        )

    def begin(self, robot: int, system_id: int, link: str, sortie: int = 1) -> None:
        """Note that the first byte is about to go to a vehicle."""
        self.put(
            StoredRecord(
                robot=robot,
                system_id=system_id,
                link=link,
                state=RecordState.UNFINISHED,
                sortie=sortie,
            )
        )

    def fail(self, robot: int) -> None:
        """Note that a vehicle holds its old mission or none, and that this is certain."""
        self.put(replace(self._records[robot], state=RecordState.FAILED))

    def put(self, record: StoredRecord) -> None:
        """Write a record; a vehicle has one entry alone."""
        self._records = {
            robot: old for robot, old in self._records.items() if old.system_id != record.system_id
        }
        self._records[record.robot] = record
        content = {
            "version": _VERSION,
            "vehicles": [asdict(self._records[robot]) for robot in sorted(self._records)],
        }
        write_whole(
            self.directory / FILE_NAME, json.dumps(content, indent=2) + "\n", overwrite=True
        )


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
                f"{path}: version {content['version']}, expected {_VERSION}; delete the file and "
                "upload again"
            )
        return tuple(
            StoredRecord(**{**entry, "state": RecordState(entry["state"])})
            for entry in content["vehicles"]
        )
    except (OSError, ValueError, KeyError, TypeError) as error:
        if isinstance(error, PlanFormatError):
            raise
        raise PlanFormatError(f"{path}: not a fleet record ({error}); delete the file") from error

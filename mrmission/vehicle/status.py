"""Does every vehicle still carry the plan that it was verified to store? Read only."""

from __future__ import annotations

import asyncio
import enum
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

from mrmission.errors import InputError, VehicleError
from mrmission.model import Mission
from mrmission.vehicle.connection import parse_connections
from mrmission.vehicle.items import MissionType, RawItem, to_raw
from mrmission.vehicle.links import StoreVehicle, open_links
from mrmission.vehicle.readback import compare_items, stored_sha256
from mrmission.vehicle.record import RecordState, StoredRecord
from mrmission.vehicle.retry import Tries
from mrmission.vehicle.rows import UploadTimeouts
from mrmission.vehicle.saved import Contents, is_empty, read_store
from mrmission.vehicle.upload import tried_text

if TYPE_CHECKING:
    from mrmission.vehicle.framing import Signing

_NOUN = {
    MissionType.MISSION: "items",
    MissionType.FENCE: "points",
    MissionType.RALLY: "points",
}


class Carries(enum.StrEnum):
    """What a vehicle carries now."""

    PLAN = "carries this plan"
    OTHER = "carries something else"
    EMPTY = "empty"
    UNREAD = "does not answer"
    ABSENT = "absent"

    @property
    def asked(self) -> bool:
        """Whether the vehicle could be asked at all."""
        return self not in (Carries.UNREAD, Carries.ABSENT)


@dataclass(frozen=True, slots=True, kw_only=True)
class StatusRow:
    """What one vehicle of ``fleet.json`` carries; the counts are of what it stores now."""

    robot: int
    system_id: int
    link: str
    items: int | None
    fence_items: int | None
    rally_points: int | None
    carries: Carries
    detail: str
    armed: bool | None


async def fleet_status(
    records: Sequence[StoredRecord],
    connections: Sequence[str] = (),
    *,
    missions: Mapping[int, Mission] | None = None,
    timeouts: UploadTimeouts | None = None,
    client: str = "pymavlink",
    signing: Signing | None = None,
) -> list[StatusRow]:
    """Read every vehicle of a record back, and say whether it carries its part of the plan.

    Nothing is written to any vehicle.

    Parameters
    ----------
    records
        What ``fleet.json`` says.
    connections
        Links as after ``--connect``; none means the links of the record.
    missions
        The plans of the folder by robot, where there are any: to say what differs, and to notice
        a plan that was made anew since it was uploaded.
    timeouts, client, signing
        As for an upload.

    Returns
    -------
    list of StatusRow
        One per record, by robot number.

    Raises
    ------
    InputError
        When there is no record.
    VehicleError
        When two vehicles have one system id.
    """
    if not records:
        raise InputError("no vehicle in the record: nothing was uploaded from this folder yet")
    timeouts = timeouts or UploadTimeouts()
    links = parse_connections(connections or sorted({record.link for record in records}))
    async with open_links(
        links, expected=len(records), timeouts=timeouts.link, client=client, signing=signing
    ) as fleet:
        silent = tried_text(fleet.silent)
        rows = await asyncio.gather(
            *(
                _row(
                    record,
                    fleet.vehicles.get(record.system_id),
                    (missions or {}).get(record.robot),
                    silent,
                    timeouts,
                )
                for record in records
            )
        )
    return sorted(rows, key=lambda row: row.robot)


async def _row(
    record: StoredRecord,
    vehicle: StoreVehicle | None,
    mission: Mission | None,
    silent: str,
    timeouts: UploadTimeouts,
) -> StatusRow:
    now: dict[MissionType, tuple[RawItem, ...]] = {}
    armed: bool | None = None
    if vehicle is None:
        carries, detail = Carries.ABSENT, silent or "not among the vehicles that were heard"
    else:
        tries = Tries(vehicle, timeouts)
        try:
            await vehicle.wait_heartbeat()
            armed = vehicle.armed
            for kind in MissionType:
                now[kind] = await read_store(vehicle, kind, tries)
        except VehicleError as error:
            now = {}
            carries, detail = Carries.UNREAD, str(error)
        else:
            carries, detail = verdict(record, now, mission)
    return StatusRow(
        robot=record.robot,
        system_id=record.system_id,
        link=vehicle.connection.url if vehicle is not None else record.link,
        items=len(now[MissionType.MISSION]) if now else None,
        fence_items=len(now[MissionType.FENCE]) if now else None,
        rally_points=len(now[MissionType.RALLY]) if now else None,
        carries=carries,
        detail=detail,
        armed=armed,
    )


def verdict(record: StoredRecord, now: Contents, mission: Mission | None) -> tuple[Carries, str]:
    """Return what a vehicle carries, and what is to be said of it.

    Parameters
    ----------
    record
        What it was verified to store, or that it was not.
    now
        What it stores.
    mission
        What the folder's plan has for it, where it has any.
    """
    as_planned = mission is not None and not _differences(to_raw(mission), now)
    as_recorded = record.state is RecordState.VERIFIED and all(
        stored_sha256(now[kind], kind) == record.sha256(kind) for kind in MissionType
    )
    if as_planned or (mission is None and as_recorded):
        return Carries.PLAN, ""
    if is_empty(now):
        return Carries.EMPTY, _history(record)
    if as_recorded:
        return Carries.OTHER, (
            "it stores what was uploaded, but the folder's plan was made anew since: upload it"
        )
    if mission is not None:
        texts = _differences(to_raw(mission), now)
    else:
        texts = [
            f"{kind.label}: {len(now[kind])} {_NOUN[kind]}"
            + ("" if len(now[kind]) == record.items(kind) else f", {record.items(kind)} uploaded")
            for kind in MissionType
            if stored_sha256(now[kind], kind) != record.sha256(kind)
        ]
    return Carries.OTHER, "; ".join(text for text in (*texts, _history(record)) if text)


def _history(record: StoredRecord) -> str:
    if record.state is RecordState.UNFINISHED:
        return "an upload to it broke off: do not start it before another was verified"
    if record.state is RecordState.FAILED:
        return "the last upload to it failed"
    return ""


def _differences(wanted: Contents, now: Contents) -> list[str]:
    """Return what is different, store by store."""
    out = []
    for kind in MissionType:
        wrong = compare_items(wanted[kind], now[kind], kind)
        if not wrong:
            continue
        if not now[kind]:
            out.append(f"no {kind.label}")
        elif len(wanted[kind]) != len(now[kind]):
            out.append(
                f"{kind.label}: {len(now[kind])} {_NOUN[kind]} instead of {len(wanted[kind])}"
            )
        else:
            first = wrong[0]
            more = f" and {len(wrong) - 1} more" if len(wrong) > 1 else ""
            out.append(f"{kind.label} item {first.seq}: another {first.field}{more}")
    return out

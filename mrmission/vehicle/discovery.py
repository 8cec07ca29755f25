"""Who is on the links: opens them side by side, waits until everybody has spoken, refuses twins."""

from __future__ import annotations

import asyncio
import contextlib
from collections.abc import AsyncIterator, Callable, Sequence
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING

from mrmission.vehicle.connection import Connection
from mrmission.vehicle.framing import Signing
from mrmission.vehicle.links import FleetLinks, LinkTimeouts, distinct
from mrmission.vehicle.station import Link, LinkOpenError

if TYPE_CHECKING:
    from mrmission.vehicle.client import Vehicle

POLL_S = 0.02
RETRY_S = 0.25

MakeVehicle = Callable[[Link, int, Connection, LinkTimeouts], "Vehicle"]


@dataclass(slots=True)
class _Open:
    connection: Connection
    link: Link | None = None
    reason: str = ""
    found: dict[int, Vehicle] = field(default_factory=dict)


@contextlib.asynccontextmanager
async def discover(
    connections: Sequence[Connection],
    make: MakeVehicle,
    *,
    expected: int,
    timeouts: LinkTimeouts,
    patient: bool,
    signing: Signing | None,
) -> AsyncIterator[FleetLinks[Vehicle]]:
    """Open links and find vehicles; see `mrmission.vehicle.client.open_links`."""
    opened = [_Open(connection) for connection in connections]
    for number, one in enumerate(opened):
        key = None if signing is None else replace(signing, link_id=number % 256)
        one.link = Link(one.connection, _finder(one, make, timeouts), key)
    try:
        await _wait(opened, expected=expected, timeouts=timeouts, patient=patient)
        yield FleetLinks(
            vehicles=await distinct((one.connection, one.found) for one in opened),
            silent={one.connection.url: one.reason for one in opened if not one.found},
        )
    finally:
        await asyncio.gather(*(one.link.close() for one in opened if one.link is not None))


def _finder(one: _Open, make: MakeVehicle, timeouts: LinkTimeouts) -> Callable[[int], Vehicle]:
    def found(system_id: int) -> Vehicle:
        assert one.link is not None
        one.found[system_id] = make(one.link, system_id, one.connection, timeouts)
        return one.found[system_id]

    return found


async def _wait(
    opened: Sequence[_Open], *, expected: int, timeouts: LinkTimeouts, patient: bool
) -> None:
    loop = asyncio.get_running_loop()
    deadline_s = loop.time() + timeouts.discovery_s
    opening = [loop.create_task(_open(one, timeouts, patient=patient)) for one in opened]
    settled_s: float | None = None
    try:
        while loop.time() < deadline_s:
            still_opening = not all(task.done() for task in opening)
            usable = [one for one in opened if not one.reason]
            if not still_opening and not usable:
                return
            # With a link per robot, one vehicle each is all that can be asked for.
            enough = len(opened) >= expected or sum(len(one.found) for one in opened) >= expected
            if enough and not still_opening and all(one.found for one in usable):
                # A link that may carry several vehicles gets time for all of them to speak, or the
                # ones that happened to come first would be taken.
                several = len(usable) < expected or any(
                    one.connection.scheme != "tcpout" for one in usable
                )
                settled_s = settled_s or loop.time() + (timeouts.settle_s if several else 0.0)
                if loop.time() >= settled_s:
                    return
            await asyncio.sleep(POLL_S)
    finally:
        for task in opening:
            task.cancel()
        await asyncio.gather(*opening, return_exceptions=True)
    for one in opened:
        if not one.found and not one.reason:
            one.reason = _silence(one, timeouts)


async def _open(one: _Open, timeouts: LinkTimeouts, *, patient: bool) -> None:
    assert one.link is not None
    loop = asyncio.get_running_loop()
    tries = patient and one.connection.answers_probe
    deadline_s = loop.time() + (timeouts.retry_probe_s if tries else 0.0)
    while True:
        try:
            await one.link.open(timeouts.probe_s)
        except LinkOpenError as error:
            if loop.time() >= deadline_s:
                one.reason = str(error)
                return
        else:
            return
        await asyncio.sleep(RETRY_S)


def _silence(one: _Open, timeouts: LinkTimeouts) -> str:
    """Return why an open link has no vehicle."""
    link = one.link
    assert link is not None
    if link.down:
        return link.down
    if link.refused_signatures:
        return "open, but what the vehicle says is not signed with this key: check --sign-key-file"
    if link.frames:
        return f"open, but no autopilot's heartbeat in {timeouts.discovery_s:g} s"
    if one.connection.scheme == "tcpout":
        return (
            f"takes the connection and says nothing for {timeouts.discovery_s:g} s: another "
            "program may hold it (a SITL port serves one); close that one, or put a MAVLink router "
            "between"
        )
    return f"open, but no heartbeat in {timeouts.discovery_s:g} s"

"""Links to vehicles through MAVSDK, which is imported only when a link opens.

Why one MAVSDK object per link: in one object, two vehicles with one system id on two links melt
into one system, and nobody can tell them apart any more. With an object each, they are seen, and
refused. Why not more than `MAX_OBJECTS` of them: each takes one of the 16 MAVLink channels of the
process, and from about the twentieth on MAVSDK 4.1 writes past that table and the process dies on
a corrupted heap. Above that, links share objects, and who speaks on which link is heard
beforehand, on a plain socket.
"""

from __future__ import annotations

import asyncio
import contextlib
import logging
from collections.abc import AsyncIterator, Sequence
from dataclasses import dataclass, field
from typing import Any

from mrmission.vehicle.connection import Connection
from mrmission.vehicle.links import (
    AUTOPILOT_COMPONENT_ID,
    GCS_COMPONENT_ID,
    GCS_SYSTEM_ID,
    FleetLinks,
    LinkTimeouts,
    distinct,
    os_reason,
    same_id_error,
)
from mrmission.vehicle.mavsdk_vehicle import Vehicle

_log = logging.getLogger("mrmission.mavsdk")

MAX_OBJECTS = 12
"""MAVSDK objects at a time, see above."""

_POLL_S = 0.05


@dataclass(slots=True)
class _Group:
    """One MAVSDK object and the systems it has found."""

    mavsdk: Any = None
    found: dict[int, Vehicle] = field(default_factory=dict)


@dataclass(slots=True)
class _Open:
    connection: Connection
    group: _Group
    alone: bool
    reason: str = ""
    opened: bool = False
    heard: frozenset[int] = frozenset()
    found: dict[int, Vehicle] = field(default_factory=dict)


@contextlib.asynccontextmanager
async def open_links(
    connections: Sequence[Connection],
    *,
    expected: int,
    timeouts: LinkTimeouts,
    patient: bool = True,
) -> AsyncIterator[FleetLinks[Vehicle]]:
    """Open links, find the vehicles on them, close everything afterwards.

    Parameters
    ----------
    connections
        Links to open.
    expected
        How many vehicles are wanted; waiting ends early when every link has spoken and as many
        are there.
    timeouts
        How long to wait.
    patient
        Whether to keep trying a TCP port that refuses for a moment: yes for links that the user
        named, no for default ports, most of which may rightly be closed.

    Yields
    ------
    FleetLinks
        What was found; perhaps nothing.

    Raises
    ------
    VehicleError
        When two vehicles have one system id. Nothing has been sent then.
    """
    groups = [_Group() for _ in range(min(MAX_OBJECTS, len(connections)))]
    opened = [
        _Open(
            connection=connection,
            group=groups[index % len(groups)],
            alone=len(connections) <= len(groups),
        )
        for index, connection in enumerate(connections)
    ]
    try:
        await _discover(opened, expected=expected, timeouts=timeouts, patient=patient)
        _refuse_twins(opened)
        yield FleetLinks(
            vehicles=await distinct((link.connection, link.found) for link in opened),
            silent={link.connection.url: link.reason for link in opened if not link.found},
        )
    finally:
        loop = asyncio.get_running_loop()
        # Destroying joins MAVSDK's threads, which may be waiting to hand a message to this loop.
        objects = [group.mavsdk for group in groups if group.mavsdk is not None]
        await asyncio.gather(*(loop.run_in_executor(None, m.destroy) for m in objects))


async def _discover(
    opened: list[_Open], *, expected: int, timeouts: LinkTimeouts, patient: bool
) -> None:
    loop = asyncio.get_running_loop()
    deadline = loop.time() + timeouts.discovery_s
    opening = [asyncio.create_task(_open(link, timeouts, patient=patient)) for link in opened]
    settled_at: float | None = None
    try:
        while True:
            still_opening = not all(task.done() for task in opening)
            for link in opened:
                await _collect(link, opened, timeouts)
            usable = [link for link in opened if not link.reason]
            if not still_opening and not usable:
                return
            # With a link per robot, one vehicle each is all that can be asked for.
            enough = len(opened) >= expected or sum(len(link.found) for link in opened) >= expected
            spoken = not still_opening and all(link.found for link in usable)
            if spoken and enough:
                # A link that may carry several vehicles gets time for all of them to speak, or the
                # ones that happened to come first would be taken.
                several = len(usable) < expected or any(
                    link.connection.scheme != "tcpout" for link in usable
                )
                settled_at = settled_at or loop.time() + (timeouts.settle_s if several else 0.0)
                if loop.time() >= settled_at:
                    return
            if loop.time() >= deadline:
                break
            await asyncio.sleep(_POLL_S)
    finally:
        for task in opening:
            task.cancel()
        await asyncio.gather(*opening, return_exceptions=True)
    for link in opened:
        if not link.found and not link.reason:
            link.reason = f"open, but no heartbeat in {timeouts.discovery_s:g} s"


async def _open(link: _Open, timeouts: LinkTimeouts, *, patient: bool) -> None:
    connection = link.connection
    if connection.answers_probe:
        # To MAVSDK a closed TCP port is a connection that it retries for ever.
        link.reason, link.heard = await _probe(
            connection, timeouts, patient=patient, listen=not link.alone
        )
        if link.reason:
            return
    _quiet_mavsdk()
    from mavsdk.asyncio import Configuration, Mavsdk
    from mavsdk.exceptions import MavsdkError

    group = link.group
    if group.mavsdk is None:
        configuration = Configuration.create_manual(GCS_SYSTEM_ID, GCS_COMPONENT_ID, True)
        group.mavsdk = Mavsdk(configuration)
    try:
        await group.mavsdk.add_any_connection(connection.url)
    except MavsdkError as error:
        link.reason = f"cannot be opened: {error}"
    else:
        link.opened = True


async def _probe(
    connection: Connection, timeouts: LinkTimeouts, *, patient: bool, listen: bool
) -> tuple[str, frozenset[int]]:
    """Return why nothing listens at a TCP port, or an empty string, and which systems speak there.

    The systems are listened for only on demand: it takes a heartbeat's time.
    """
    loop = asyncio.get_running_loop()
    deadline = loop.time() + (timeouts.retry_probe_s if patient else 0.0)
    while True:
        try:
            reader, writer = await asyncio.wait_for(
                asyncio.open_connection(connection.host.strip("[]"), connection.port),
                timeouts.probe_s,
            )
        except (OSError, TimeoutError) as error:
            reason = "no answer" if isinstance(error, TimeoutError) else os_reason(error)
        else:
            data = b""
            with contextlib.suppress(OSError, TimeoutError):
                async with asyncio.timeout(timeouts.settle_s if listen else 0.0):
                    while listen and not heartbeat_ids(data):
                        chunk = await reader.read(4096)
                        if not chunk:
                            break
                        data += chunk
            writer.close()
            with contextlib.suppress(OSError):
                await writer.wait_closed()
            return "", heartbeat_ids(data)
        if loop.time() >= deadline:
            return reason, frozenset()
        await asyncio.sleep(0.25)


def heartbeat_ids(data: bytes) -> frozenset[int]:
    """Return the system ids of the autopilots whose heartbeats are in a piece of MAVLink stream.

    Parameters
    ----------
    data
        Bytes from the start of a packet on; MAVLink 1 or 2.

    Examples
    --------
    >>> sorted(heartbeat_ids(bytes([0xFE, 9, 0, 7, 1, 0]) + bytes(11)))
    [7]
    """
    out: set[int] = set()
    at = 0
    while at + 10 <= len(data):
        size = data[at + 1]
        if data[at] == 0xFE:
            system, component, message = data[at + 3], data[at + 4], data[at + 5]
            length = size + 8
        elif data[at] == 0xFD:
            system, component = data[at + 5], data[at + 6]
            message = int.from_bytes(data[at + 7 : at + 10], "little")
            length = size + 12 + (13 if data[at + 2] & 1 else 0)
        else:
            at += 1
            continue
        if at + length <= len(data) and message == 0 and component == AUTOPILOT_COMPONENT_ID:
            out.add(system)
        at += length
    return frozenset(out)


async def _collect(link: _Open, links: Sequence[_Open], timeouts: LinkTimeouts) -> None:
    """Add the autopilots that MAVSDK has discovered on `link` since the last look."""
    group = link.group
    if not link.opened or await group.mavsdk.system_count() <= len(group.found):
        return
    for system in await group.mavsdk.get_systems():
        system_id = int(await system.get_system_id())
        if system_id in group.found or not await system.has_autopilot():
            continue
        sharing = [other for other in links if other.group is group and other.opened]
        home = next(
            (other for other in sharing if system_id in other.heard),
            # Nobody was heard with this id: a link on which nobody was heard at all.
            next((other for other in sharing if not other.heard), link),
        )
        vehicle = Vehicle(system, system_id, home.connection, timeouts)
        group.found[system_id] = home.found[system_id] = vehicle


def _refuse_twins(opened: Sequence[_Open]) -> None:
    """Refuse two vehicles with one system id on two links, which one object takes for one vehicle.

    Raises
    ------
    VehicleError
        When two speak with the same.
    """
    speakers: dict[int, Connection] = {}
    for link in opened:
        for system_id in link.heard:
            if system_id in speakers:
                raise same_id_error(system_id, speakers[system_id], link.connection)
            speakers[system_id] = link.connection


_quieted = False


def _quiet_mavsdk() -> None:
    """Send MAVSDK's log lines, which it writes to stdout, to Python's logging."""
    global _quieted
    if _quieted:
        return
    from mavsdk import LogLevel, log_subscribe

    levels = {
        LogLevel.DEBUG: logging.DEBUG,
        LogLevel.INFO: logging.DEBUG,
        LogLevel.WARN: logging.INFO,
        LogLevel.ERROR: logging.INFO,
    }

    def handle(level: Any, message: str, _file: str | None, _line: int) -> bool:
        _log.log(levels.get(level, logging.INFO), "%s", message)
        return True

    log_subscribe(handle)
    _quieted = True

"""The ground station's end of one link: frames to vehicles, heartbeats, who else is there."""

from __future__ import annotations

import asyncio
from collections.abc import Callable, Hashable
from typing import Protocol

from mrmission.vehicle.connection import Connection
from mrmission.vehicle.framing import (
    AUTOPILOT_COMPONENT_ID,
    Codec,
    Frame,
    FrameReader,
    Message,
    Signing,
    mavlink,
)
from mrmission.vehicle.links import GCS_COMPONENT_ID, GCS_SYSTEM_ID
from mrmission.vehicle.transport import LinkOpenError, make_transport

HEARTBEAT_S = 1.0
ADDRESS_MEMORY_S = 2.5
"""A system id that spoke from two addresses within this time belongs to two vehicles."""
STATION_MEMORY_S = 10.0


class Listener(Protocol):
    """What a link hands one vehicle's frames to."""

    def handle(self, frame: Frame) -> None:
        """Take one frame of the vehicle's autopilot."""


class Link:
    """One open link and whoever is heard on it.

    Parameters
    ----------
    connection
        What to open.
    found
        Called with the system id of an autopilot that is heard for the first time; returns what
        gets its frames.
    signing
        Key of the link, where it is signed.
    """

    def __init__(
        self,
        connection: Connection,
        found: Callable[[int], Listener],
        signing: Signing | None = None,
    ) -> None:
        self.connection = connection
        self.codec = Codec(GCS_SYSTEM_ID, GCS_COMPONENT_ID, signing)
        self._found = found
        self._loop = asyncio.get_running_loop()
        self._transport = make_transport(connection, self._receive, self._greet)
        self._readers: dict[Hashable, FrameReader] = {}
        self._vehicles: dict[int, Listener] = {}
        self._routes: dict[int, Hashable] = {}
        self._spoke: dict[int, dict[Hashable, float]] = {}
        self._stations: dict[int, float] = {}
        self._beating: asyncio.Task[None] | None = None
        self._decoded: tuple[Frame, Message | None] | None = None
        self.frames = 0
        """Frames heard so far, of anybody."""
        self.signed_heartbeats = 0
        """Autopilot heartbeats that carried a signature."""
        self.refused_signatures = 0
        """Autopilot heartbeats that could not be taken for genuine."""

    async def open(self, timeout_s: float) -> None:
        """Open the link and start to send heartbeats.

        Raises
        ------
        LinkOpenError
            With the reason.
        """
        await self._transport.open(timeout_s)
        self._beating = self._loop.create_task(self._beat())

    async def close(self) -> None:
        """Close the link."""
        if self._beating is not None:
            self._beating.cancel()
            await asyncio.gather(self._beating, return_exceptions=True)
        await self._transport.close()

    def decode(self, frame: Frame) -> Message | None:
        """Return a frame's message, None where it cannot be read or its signature is refused.

        A signature counts once: the same frame is decoded once.
        """
        if self._decoded is None or self._decoded[0] is not frame:
            self._decoded = (frame, self.codec.decode(frame))
        return self._decoded[1]

    @property
    def down(self) -> str:
        """Why the link is down at present; empty while it is up."""
        return self._transport.down

    def send(self, message: Message, system_id: int) -> None:
        """Send a message to where a vehicle was last heard; to everybody before that."""
        self._transport.send(self.codec.encode(message), self._routes.get(system_id))

    def addresses(self, system_id: int) -> int:
        """Return from how many addresses a system id's autopilot has spoken lately."""
        now_s = self._loop.time()
        heard = self._spoke.get(system_id, {}).values()
        return sum(now_s - at_s < ADDRESS_MEMORY_S for at_s in heard)

    def stations(self) -> tuple[int, ...]:
        """Return the system ids of other ground stations heard lately."""
        now_s = self._loop.time()
        return tuple(
            sorted(n for n, at_s in self._stations.items() if now_s - at_s < STATION_MEMORY_S)
        )

    # --- inside ---

    async def _beat(self) -> None:
        while True:
            await asyncio.sleep(HEARTBEAT_S)
            self._transport.send(self.codec.encode(_heartbeat()))

    def _greet(self, peer: Hashable) -> None:
        # Half a packet from before a connection broke must not swallow the first one after it.
        self._readers[peer] = FrameReader()
        self._transport.send(self.codec.encode(_heartbeat()), peer)

    def _receive(self, peer: Hashable, data: bytes) -> None:
        reader = self._readers.get(peer)
        if reader is None:
            reader = self._readers[peer] = FrameReader()
        for frame in reader.feed(data):
            self.frames += 1
            if frame.message_id == mavlink.MAVLINK_MSG_ID_HEARTBEAT:
                self._heartbeat(frame, peer)
            if frame.component_id == AUTOPILOT_COMPONENT_ID:
                vehicle = self._vehicles.get(frame.system_id)
                if vehicle is not None:
                    vehicle.handle(frame)

    def _heartbeat(self, frame: Frame, peer: Hashable) -> None:
        """Learn from a heartbeat who is there; the vehicle itself gets its own afterwards."""
        system_id = frame.system_id
        if frame.component_id != AUTOPILOT_COMPONENT_ID:
            message = self.decode(frame)
            if message is not None and message.type == mavlink.MAV_TYPE_GCS:
                self._stations[system_id] = self._loop.time()
            return
        self.signed_heartbeats += frame.signed
        if system_id not in self._vehicles:
            message = self.decode(frame)
            if message is None:
                self.refused_signatures += 1
                return
            if message.autopilot == mavlink.MAV_AUTOPILOT_INVALID:
                return
            self._vehicles[system_id] = self._found(system_id)
        self._routes[system_id] = peer
        self._spoke.setdefault(system_id, {})[peer] = self._loop.time()


def _heartbeat() -> Message:
    return mavlink.MAVLink_heartbeat_message(
        mavlink.MAV_TYPE_GCS, mavlink.MAV_AUTOPILOT_INVALID, 0, 0, mavlink.MAV_STATE_ACTIVE, 3
    )


__all__ = ["Link", "LinkOpenError", "Listener"]

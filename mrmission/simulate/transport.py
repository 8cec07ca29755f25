"""Sockets for simulated vehicles: a TCP server each, as ArduPilot's SITL opens it, or UDP out.

Everything here is plumbing between asyncio and :class:`~mrmission.simulate.vehicle.SimVehicle`.
"""

from __future__ import annotations

import asyncio
import random
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from typing import Generic, TypeVar, cast

from mrmission.simulate.transfer import Outbound
from mrmission.simulate.vehicle import SimVehicle
from mrmission.simulate.wire import Codec, Message

T = TypeVar("T")

MOST_UNSENT_BYTES = 1 << 20
"""A client that does not read gets no more telemetry above this backlog."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Faults:
    """How a link misbehaves, message by message: shares between 0 and 1.

    Parameters
    ----------
    loss, duplicate, reorder : float
        Share of messages that vanish, arrive twice, arrive after the next one.
    seed : int
        The same seed gives the same faults for the same messages.
    """

    loss: float = 0.0
    duplicate: float = 0.0
    reorder: float = 0.0
    seed: int = 0

    def __bool__(self) -> bool:
        return bool(self.loss or self.duplicate or self.reorder)


class FaultyChannel(Generic[T]):
    """One direction of a link that loses, doubles and swaps what passes.

    Parameters
    ----------
    faults : Faults
        How often.
    direction : int
        Distinguishes the channels that share one seed.
    """

    def __init__(self, faults: Faults, direction: int = 0) -> None:
        self._faults = faults
        self._random = random.Random(faults.seed * 1_000_003 + direction)
        self._held: T | None = None

    def carry(self, item: T) -> list[T]:
        """Put one message in; return the messages that come out now."""
        faults = self._faults
        lost, doubled, late = (self._random.random() for _ in range(3))
        if lost < faults.loss:
            return []
        out = [item, item] if doubled < faults.duplicate else [item]
        if self._held is not None:
            out.append(self._held)
            self._held = None
        elif late < faults.reorder:
            self._held = out.pop(0)
        return out


class Link:
    """One peer's connection to one vehicle."""

    def __init__(self, server: VehicleServer, write: Callable[[list[bytes]], None]) -> None:
        self._server = server
        self._write = write
        self._codec = Codec(server.vehicle.system_id)
        self._in: FaultyChannel[Message] | None = None
        self._out: FaultyChannel[bytes] | None = None
        self.backlog: Callable[[], int] = lambda: 0
        self.abort: Callable[[], None] = lambda: None
        if server.faults:
            number = server.next_link_number()
            base = 2 * (server.vehicle.system_id * 1000 + number)
            self._in = FaultyChannel(server.faults, base)
            self._out = FaultyChannel(server.faults, base + 1)

    def receive(self, data: bytes) -> None:
        """Hand bytes from the peer to the vehicle."""
        vehicle = self._server.vehicle
        out: list[Outbound] = []
        for message in self._codec.decode(data):
            for arrived in (message,) if self._in is None else self._in.carry(message):
                out += vehicle.handle(arrived, self)
        if out:
            self._server.deliver(out)

    def send(self, messages: Iterable[Message]) -> None:
        """Pack messages and write them to the peer."""
        packets = [self._codec.encode(message) for message in messages]
        if self._out is not None:
            packets = [kept for packet in packets for kept in self._out.carry(packet)]
        if packets:
            self._write(packets)


class VehicleServer:
    """The links of one vehicle.

    Parameters
    ----------
    vehicle : SimVehicle
        Who talks.
    faults : Faults, optional
        Applied to every link, both ways.
    """

    def __init__(self, vehicle: SimVehicle, faults: Faults | None = None) -> None:
        self.vehicle = vehicle
        self.faults = faults
        self.links: dict[Link, None] = {}
        self._closers: list[Callable[[], None]] = []
        self._numbers = 0

    def next_link_number(self) -> int:
        """Return a number for a new link of this vehicle."""
        self._numbers += 1
        return self._numbers

    def deliver(self, out: list[Outbound]) -> None:
        """Send each message to the link it is meant for, or to all."""
        for link in list(self.links):
            full = link.backlog() > MOST_UNSENT_BYTES
            wanted = [
                item.message
                for item in out
                if item.link is link or (item.link is None and not full)
            ]
            if wanted:
                link.send(wanted)

    def tick(self, now_s: float) -> None:
        """Advance the vehicle and send what it has to say."""
        out = self.vehicle.step(now_s, telemetry=bool(self.links))
        if out and self.links:
            self.deliver(out)

    def add(self, link: Link) -> None:
        """Take a new link in, and greet it with a heartbeat."""
        self.links[link] = None
        self.deliver(self.vehicle.hello(link))

    def remove(self, link: Link) -> None:
        """Forget a link that was closed."""
        self.links.pop(link, None)

    async def listen(self, host: str, port: int) -> int:
        """Open a TCP server and return its port (a free one where `port` is 0)."""
        server = await asyncio.get_running_loop().create_server(lambda: _TcpPeer(self), host, port)
        self._closers.append(server.close)
        return int(server.sockets[0].getsockname()[1])

    async def send_to(self, host: str, port: int) -> None:
        """Talk to a ground station that listens on UDP."""
        transport, _ = await asyncio.get_running_loop().create_datagram_endpoint(
            lambda: _UdpPeer(self), remote_addr=(host, port)
        )
        self._closers.append(transport.close)

    def close(self) -> None:
        """Close server and links."""
        for close in self._closers:
            close()
        self._closers.clear()
        for link in self.links:
            link.abort()
        self.links.clear()


class _TcpPeer(asyncio.Protocol):
    def __init__(self, server: VehicleServer) -> None:
        self._server = server
        self._link: Link | None = None

    def connection_made(self, transport: asyncio.BaseTransport) -> None:
        tcp = cast(asyncio.Transport, transport)
        link = Link(self._server, lambda packets: tcp.write(b"".join(packets)))
        link.backlog = tcp.get_write_buffer_size
        self._link = link
        link.abort = tcp.abort
        self._server.add(link)

    def data_received(self, data: bytes) -> None:
        if self._link is not None:
            self._link.receive(data)

    def connection_lost(self, exc: Exception | None) -> None:
        if self._link is not None:
            self._server.remove(self._link)
            self._link = None


class _UdpPeer(asyncio.DatagramProtocol):
    def __init__(self, server: VehicleServer) -> None:
        self._server = server
        self._link: Link | None = None

    def connection_made(self, transport: asyncio.BaseTransport) -> None:
        udp = cast(asyncio.DatagramTransport, transport)

        def write(packets: list[bytes]) -> None:
            for packet in packets:
                udp.sendto(packet)

        self._link = Link(self._server, write)
        self._server.add(self._link)

    def datagram_received(self, data: bytes, addr: object) -> None:
        if self._link is not None:
            self._link.receive(data)

    def error_received(self, exc: Exception) -> None:
        """Nobody listens at the other end (yet); the next datagram may find somebody."""

    def connection_lost(self, exc: Exception | None) -> None:
        if self._link is not None:
            self._server.remove(self._link)
            self._link = None

"""A bad link between a vehicle and a ground station: packets vanish, double, and overtake.

Works on whole MAVLink packets, in both directions, over TCP (one vehicle that listens) and UDP
(vehicles that call). The link can also be cut and come back.
"""

from __future__ import annotations

import asyncio
import contextlib
import random
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from mrmission.vehicle.framing import FrameReader

HELD_S = 0.08
"""A packet that is to be overtaken waits for the next one, but not longer."""


@dataclass(frozen=True, kw_only=True)
class Badness:
    """Shares of packets, 0 to 1, each way, and a delay of all of them."""

    loss: float = 0.0
    duplicate: float = 0.0
    reorder: float = 0.0
    delay_s: float = 0.0
    seed: int = 0


class Direction:
    """One way of the link."""

    def __init__(self, badness: Badness, number: int, write: Callable[[bytes], None]) -> None:
        self._badness = badness
        self._random = random.Random(badness.seed * 1009 + number)
        self._write = write
        self._reader = FrameReader()
        self._held: list[tuple[bytes, asyncio.TimerHandle]] = []
        self._loop = asyncio.get_running_loop()
        self.passed = self.lost = 0

    def feed(self, data: bytes) -> None:
        for frame in self._reader.feed(data):
            self._carry(frame.data)

    def _carry(self, packet: bytes) -> None:
        bad = self._badness
        lost, doubled, late = (self._random.random() for _ in range(3))
        if lost < bad.loss:
            self.lost += 1
            return
        self.passed += 1
        if late < bad.reorder:
            timer = self._loop.call_later(HELD_S, self._release)
            self._held.append((packet, timer))
        else:
            self._out(packet)
            self._release()
        if doubled < bad.duplicate:
            self._out(packet)

    def _release(self) -> None:
        held, self._held = self._held, []
        for packet, timer in held:
            timer.cancel()
            self._out(packet)

    def _out(self, packet: bytes) -> None:
        if self._badness.delay_s > 0:
            self._loop.call_later(self._badness.delay_s, self._write, packet)
        else:
            self._write(packet)


class LossyTcp:
    """A TCP port before a vehicle's: ``async with LossyTcp(port, badness) as proxy: proxy.url``."""

    def __init__(self, vehicle_port: int, badness: Badness, host: str = "127.0.0.1") -> None:
        self._target = (host, vehicle_port)
        self.badness = badness
        self.port = 0
        self.connections = 0
        self.refusing = False
        self._server: asyncio.Server | None = None
        self._tasks: set[asyncio.Task[None]] = set()
        self._writers: set[asyncio.StreamWriter] = set()

    @property
    def url(self) -> str:
        return f"tcp:127.0.0.1:{self.port}"

    async def __aenter__(self) -> LossyTcp:
        self._server = await asyncio.start_server(self._serve, "127.0.0.1", self.port)
        self.port = int(self._server.sockets[0].getsockname()[1])
        return self

    async def __aexit__(self, *_: object) -> None:
        assert self._server is not None
        self._server.close()
        self.cut()
        await asyncio.gather(*self._tasks, return_exceptions=True)

    def cut(self) -> None:
        """Break every connection."""
        for writer in self._writers:
            writer.transport.abort()

    async def _serve(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        task = asyncio.current_task()
        assert task is not None
        self._tasks.add(task)
        self._writers.add(writer)
        try:
            if self.refusing:
                return
            self.connections += 1
            number = 2 * self.connections
            far_reader, far_writer = await asyncio.open_connection(*self._target)
            self._writers.add(far_writer)
            await asyncio.gather(
                _pump(reader, Direction(self.badness, number, far_writer.write), far_writer),
                _pump(far_reader, Direction(self.badness, number + 1, writer.write), writer),
            )
        except OSError:
            pass
        finally:
            writer.transport.abort()
            self._writers.discard(writer)
            self._tasks.discard(task)


async def _pump(
    reader: asyncio.StreamReader, direction: Direction, writer: asyncio.StreamWriter
) -> None:
    with contextlib.suppress(OSError):
        while data := await reader.read(65536):
            direction.feed(data)
    writer.transport.abort()


class LossyUdp(asyncio.DatagramProtocol):
    """A UDP port that vehicles call, and that passes them on to a ground station's port.

    Every vehicle gets a port of its own towards the ground station, as it would have without.
    """

    def __init__(self, station_port: int, badness: Badness) -> None:
        self._station = ("127.0.0.1", station_port)
        self.badness = badness
        self.port = 0
        self._transport: Any = None
        self._towards: dict[Any, Direction] = {}
        self._far: list[Any] = []

    async def __aenter__(self) -> LossyUdp:
        self._transport, _ = await asyncio.get_running_loop().create_datagram_endpoint(
            lambda: self, local_addr=("127.0.0.1", 0)
        )
        self.port = int(self._transport.get_extra_info("sockname")[1])
        return self

    async def __aexit__(self, *_: object) -> None:
        self._transport.close()
        for far in self._far:
            far.close()
        await asyncio.sleep(0)

    def datagram_received(self, data: bytes, addr: Any) -> None:
        if addr not in self._towards:
            self._towards[addr] = self._new(addr)
        self._towards[addr].feed(data)

    def _new(self, addr: Any) -> Direction:
        loop = asyncio.get_running_loop()
        number = 2 * len(self._towards)
        back = Direction(
            self.badness, number + 1, lambda packet: self._transport.sendto(packet, addr)
        )
        far: list[Any] = []
        waiting: list[bytes] = []

        class Far(asyncio.DatagramProtocol):
            def datagram_received(self, data: bytes, addr: Any) -> None:
                back.feed(data)

        async def connect() -> None:
            transport, _ = await loop.create_datagram_endpoint(Far, remote_addr=self._station)
            far.append(transport)
            self._far.append(transport)
            for packet in waiting:
                transport.sendto(packet)

        self._connecting = loop.create_task(connect())

        def write(packet: bytes) -> None:
            if far:
                far[0].sendto(packet)
            else:
                waiting.append(packet)

        return Direction(self.badness, number, write)

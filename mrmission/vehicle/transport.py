"""Bytes to and from vehicles: TCP, UDP and serial lines under asyncio, all with one face.

A transport knows peers, not vehicles: a UDP port or a TCP server hears several addresses, each with
a byte stream of its own, and whoever sends says to which. What is sent while a link is down is
lost, as on the air; a TCP connection or a serial device that goes away is opened again in the
background until the transport is closed.
"""

from __future__ import annotations

import asyncio
import contextlib
import errno
import queue
import threading
from abc import ABC, abstractmethod
from collections.abc import Callable, Hashable
from typing import Any, cast

from mrmission.errors import VehicleError
from mrmission.vehicle.connection import Connection
from mrmission.vehicle.links import os_reason

Receive = Callable[[Hashable, bytes], None]

REOPEN_FIRST_S = 0.1
REOPEN_MOST_S = 1.0
MOST_UNSENT_BYTES = 1 << 18
"""What is to be sent over this backlog of a stalled TCP link is dropped, as on the air."""
MOST_UNSENT_PACKETS = 500
SERIAL_POLL_S = 0.1


class LinkOpenError(VehicleError):
    """A link cannot be opened; the message is the reason alone."""


class Transport(ABC):
    """One link.

    Parameters
    ----------
    connection
        What to open.
    receive
        Called in the event loop with a peer and the bytes that came from it.
    on_up
        Called in the event loop whenever a peer is there (again); what was half received before is
        worthless then.
    """

    def __init__(
        self, connection: Connection, receive: Receive, on_up: Callable[[Hashable], None]
    ) -> None:
        self.connection = connection
        self.receive = receive
        self.on_up = on_up
        self.down = ""
        """Why the link is down at present; empty while it is up."""

    @abstractmethod
    async def open(self, timeout_s: float) -> None:
        """Open the link once.

        Raises
        ------
        LinkOpenError
            With the reason.
        """

    @abstractmethod
    def send(self, data: bytes, peer: Hashable | None = None) -> None:
        """Send one packet to `peer`, or to every peer there is."""

    @abstractmethod
    async def close(self) -> None:
        """Close the link for good."""


def make_transport(
    connection: Connection, receive: Receive, on_up: Callable[[Hashable], None]
) -> Transport:
    """Return the transport that a connection's scheme names."""
    kinds: dict[str, type[Transport]] = {
        "tcpout": _TcpClient,
        "tcpin": _TcpServer,
        "udpin": _UdpSocket,
        "udpout": _UdpSocket,
        "serial": _SerialLine,
    }
    return kinds[connection.scheme](connection, receive, on_up)


# --- TCP -----------------------------------------------------------------------------------------


class _TcpPeer(asyncio.Protocol):
    """One TCP connection, whichever side opened it."""

    def __init__(
        self, owner: Transport, gained: Callable[[_TcpPeer], None], lost: Callable[[_TcpPeer], None]
    ) -> None:
        self._owner = owner
        self._gained = gained
        self._lost = lost
        self._transport: asyncio.Transport | None = None
        self.silent = True

    def connection_made(self, transport: asyncio.BaseTransport) -> None:
        self._transport = cast(asyncio.Transport, transport)
        self._gained(self)

    def data_received(self, data: bytes) -> None:
        self.silent = False
        self._owner.receive(self, data)

    def connection_lost(self, exc: Exception | None) -> None:
        self._transport = None
        self._lost(self)

    def write(self, data: bytes) -> None:
        transport = self._transport
        if transport is not None and transport.get_write_buffer_size() < MOST_UNSENT_BYTES:
            transport.write(data)

    def abort(self) -> None:
        if self._transport is not None:
            self._transport.abort()


class _TcpClient(Transport):
    """A connection to a port where a vehicle, a router or SITL listens."""

    def __init__(
        self, connection: Connection, receive: Receive, on_up: Callable[[Hashable], None]
    ) -> None:
        super().__init__(connection, receive, on_up)
        self._peer: _TcpPeer | None = None
        self._reopening: asyncio.Task[None] | None = None
        self._closed = False

    async def open(self, timeout_s: float) -> None:
        loop = asyncio.get_running_loop()
        try:
            async with asyncio.timeout(timeout_s):
                await loop.create_connection(
                    lambda: _TcpPeer(self, self._gained, self._lost),
                    self.connection.host.strip("[]"),
                    self.connection.port,
                )
        except TimeoutError as error:
            raise LinkOpenError("no answer") from error
        except OSError as error:
            raise LinkOpenError(os_reason(error)) from error

    def _gained(self, peer: _TcpPeer) -> None:
        self._peer = peer
        self.down = ""
        self.on_up(peer)

    def _lost(self, peer: _TcpPeer) -> None:
        if peer is not self._peer:
            return
        self._peer = None
        self.down = "connection closed by the other end"
        if not self._closed:
            self._reopening = asyncio.get_running_loop().create_task(self._reopen())

    async def _reopen(self) -> None:
        pause_s = REOPEN_FIRST_S
        while not self._closed:
            await asyncio.sleep(pause_s)
            pause_s = min(2.0 * pause_s, REOPEN_MOST_S)
            try:
                await self.open(REOPEN_MOST_S)
            except LinkOpenError as error:
                self.down = str(error)
            else:
                return

    def send(self, data: bytes, peer: Hashable | None = None) -> None:
        if self._peer is not None:
            self._peer.write(data)

    async def close(self) -> None:
        self._closed = True
        if self._reopening is not None:
            self._reopening.cancel()
            await asyncio.gather(self._reopening, return_exceptions=True)
        if self._peer is not None:
            self._peer.abort()
            await asyncio.sleep(0)


class _TcpServer(Transport):
    """A port at which vehicles or routers call."""

    def __init__(
        self, connection: Connection, receive: Receive, on_up: Callable[[Hashable], None]
    ) -> None:
        super().__init__(connection, receive, on_up)
        self._server: asyncio.Server | None = None
        self._peers: set[_TcpPeer] = set()

    async def open(self, timeout_s: float) -> None:
        connection = self.connection
        try:
            self._server = await asyncio.get_running_loop().create_server(
                lambda: _TcpPeer(self, self._gained, self._peers.discard),
                connection.host.strip("[]"),
                connection.port,
            )
        except OSError as error:
            raise LinkOpenError(_taken(error, f"TCP port {connection.port}")) from error

    def _gained(self, peer: _TcpPeer) -> None:
        self._peers.add(peer)
        self.on_up(peer)

    def send(self, data: bytes, peer: Hashable | None = None) -> None:
        for one in self._peers:
            if peer is None or one is peer:
                one.write(data)

    async def close(self) -> None:
        if self._server is not None:
            self._server.close()
        for peer in list(self._peers):
            peer.abort()
        await asyncio.sleep(0)


# --- UDP -----------------------------------------------------------------------------------------


class _UdpSocket(Transport, asyncio.DatagramProtocol):
    """A UDP port: one that hears whoever sends to it (udpin), or one that calls (udpout)."""

    def __init__(
        self, connection: Connection, receive: Receive, on_up: Callable[[Hashable], None]
    ) -> None:
        super().__init__(connection, receive, on_up)
        self._transport: asyncio.DatagramTransport | None = None
        self._peers: dict[Hashable, None] = {}

    async def open(self, timeout_s: float) -> None:
        connection = self.connection
        address = (connection.host.strip("[]"), connection.port)
        calls = connection.scheme == "udpout"
        try:
            transport, _ = await asyncio.get_running_loop().create_datagram_endpoint(
                lambda: self,
                remote_addr=address if calls else None,
                local_addr=None if calls else address,
            )
        except OSError as error:
            raise LinkOpenError(_taken(error, f"UDP port {connection.port}")) from error
        self._transport = transport
        if calls:
            self.on_up(None)

    def datagram_received(self, data: bytes, addr: Any) -> None:
        # Vehicles that answer a call from another port than the called one don't get through to
        # a connected socket anyway, so there the one peer is None.
        peer = None if self.connection.scheme == "udpout" else tuple(addr)
        if peer not in self._peers:
            self._peers[peer] = None
            if peer is not None:
                self.on_up(peer)
        self.receive(peer, data)

    def error_received(self, exc: Exception) -> None:
        """Nobody listens at the other end (yet); the next datagram may find somebody."""

    def send(self, data: bytes, peer: Hashable | None = None) -> None:
        if self._transport is None:
            return
        if self.connection.scheme == "udpout":
            self._transport.sendto(data)
            return
        for one in self._peers if peer is None else (peer,):
            self._transport.sendto(data, cast(tuple[Any, ...], one))

    async def close(self) -> None:
        if self._transport is not None:
            self._transport.close()
            await asyncio.sleep(0)


def _taken(error: OSError, what: str) -> str:
    if error.errno == errno.EADDRINUSE:
        return (
            f"{what} is in use: another program, perhaps another ground station, listens there; "
            "close it or take another port"
        )
    if error.errno == errno.EADDRNOTAVAIL:
        return "this machine has no such address to listen at; use 0.0.0.0"
    return os_reason(error)


# --- serial --------------------------------------------------------------------------------------


class _SerialLine(Transport):
    """A serial device: a telemetry radio or a cable.

    pyserial blocks, so reading and writing have a thread each; both end when the device goes, and
    the reader opens it again when it is back.
    """

    def __init__(
        self, connection: Connection, receive: Receive, on_up: Callable[[Hashable], None]
    ) -> None:
        super().__init__(connection, receive, on_up)
        self._loop = asyncio.get_running_loop()
        self._port: Any = None
        self._closing = threading.Event()
        self._unsent: queue.Queue[bytes] = queue.Queue(MOST_UNSENT_PACKETS)
        self._threads: list[threading.Thread] = []

    async def open(self, timeout_s: float) -> None:
        self._port = await self._loop.run_in_executor(None, self._open)
        self.on_up(None)
        self._threads = [
            threading.Thread(target=self._read, name=f"read {self.connection.url}", daemon=True),
            threading.Thread(target=self._write, name=f"write {self.connection.url}", daemon=True),
        ]
        for thread in self._threads:
            thread.start()

    def _open(self) -> Any:
        import serial

        device = self.connection.device
        try:
            return serial.Serial(
                device,
                self.connection.baud,
                timeout=SERIAL_POLL_S,
                write_timeout=REOPEN_MOST_S,
                exclusive=True,
            )
        except (serial.SerialException, OSError, ValueError) as error:
            raise LinkOpenError(_serial_reason(device, error)) from error

    def _call(self, function: Callable[..., None], *arguments: Any) -> None:
        # The loop may be gone when a last byte arrives during tear-down.
        with contextlib.suppress(RuntimeError):
            self._loop.call_soon_threadsafe(function, *arguments)

    def _read(self) -> None:
        import serial

        while not self._closing.is_set():
            port = self._port
            try:
                data = port.read(max(1, port.in_waiting))
            except (serial.SerialException, OSError, TypeError):
                self._reopen()
                continue
            if data:
                self._call(self.receive, None, data)

    def _reopen(self) -> None:
        self.down = f"serial device {self.connection.device} is gone (unplugged?)"
        self._port.close()
        while not self._closing.wait(REOPEN_MOST_S):
            try:
                self._port = self._open()
            except LinkOpenError as error:
                self.down = str(error)
            else:
                self.down = ""
                self._call(self.on_up, None)
                return

    def _write(self) -> None:
        import serial

        while not self._closing.is_set():
            try:
                data = self._unsent.get(timeout=SERIAL_POLL_S)
            except queue.Empty:
                continue
            # The reader sees to a device that is gone; what can't be sent is lost.
            with contextlib.suppress(serial.SerialException, OSError, TypeError):
                self._port.write(data)

    def send(self, data: bytes, peer: Hashable | None = None) -> None:
        if not self.down:
            with contextlib.suppress(queue.Full):
                self._unsent.put_nowait(data)

    async def close(self) -> None:
        self._closing.set()
        for thread in self._threads:
            await self._loop.run_in_executor(None, thread.join, 2.0 * REOPEN_MOST_S)
        if self._port is not None:
            self._port.close()


def _serial_reason(device: str, error: Exception) -> str:
    number = getattr(error, "errno", None)
    if number == errno.ENOENT:
        return f"no serial device {device}: plug the radio in, or see what it is called now"
    if number in (errno.EBUSY, errno.EWOULDBLOCK) or "exclusively lock" in str(error):
        return f"serial device {device} is in use by another program: close it first"
    if number == errno.EACCES:
        return f"no permission for serial device {device}: join its group (often dialout)"
    return f"serial device {device} cannot be opened: {error}"

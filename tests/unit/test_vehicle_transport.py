"""Frames out of streams, signatures, and the transports under the own client."""

from __future__ import annotations

import asyncio
import random
import socket
import time
from collections.abc import Callable
from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from mrmission.errors import ConfigError, LinkTimeoutError, VehicleError
from mrmission.vehicle.client import Vehicle, open_links
from mrmission.vehicle.connection import parse_connection, parse_connections
from mrmission.vehicle.framing import Codec, Frame, FrameReader, Signing
from mrmission.vehicle.items import MissionType
from mrmission.vehicle.links import LinkTimeouts
from mrmission.vehicle.links import open_links as open_by_name
from mrmission.vehicle.transport import LinkOpenError, make_transport

QUICK = LinkTimeouts(retry_probe_s=0.0, discovery_s=2.0, reply_s=0.2, twin_window_s=0.05)


def position(number: int) -> Any:
    return mavlink.MAVLink_global_position_int_message(number, 1, 2, 3, 4, 5, 6, 7, 8)


def beat() -> Any:
    return mavlink.MAVLink_heartbeat_message(11, 3, 0, 10, 4, 3)


# --- frames --------------------------------------------------------------------------------------


def test_frames_come_whole_however_they_are_cut() -> None:
    codec = Codec(7, 1)
    packets = [codec.encode(position(n)) for n in range(50)]
    packets.append(bytes(beat().pack(mavlink.MAVLink(None, 9, 1), force_mavlink1=True)))
    stream = b"".join(packets)
    for step in (1, 7, 64, len(stream)):
        reader = FrameReader()
        frames = [
            f for at in range(0, len(stream), step) for f in reader.feed(stream[at : at + step])
        ]
        assert [f.data for f in frames] == packets
        assert {f.system_id for f in frames[:-1]} == {7}
        assert frames[-1][:3] == (9, 1, 0)


@settings(max_examples=100, deadline=None)
@given(st.binary(max_size=400), st.integers(0, 10**6))
def test_noise_never_hides_more_than_it_touches(noise: bytes, seed: int) -> None:
    codec = Codec(7, 1)
    packets = [codec.encode(position(n)) for n in range(12)]
    at = random.Random(seed).randrange(12)
    reader = FrameReader()
    frames = reader.feed(b"".join(packets[:at]) + noise + b"".join(packets[at:]))
    # Noise that looks like the start of a long packet waits for its end.
    frames += reader.feed(b"".join(codec.encode(position(n)) for n in range(12, 60)))
    stamps = [codec.decode(f).time_boot_ms for f in frames if f.message_id == 33]
    assert stamps[:at] == list(range(at))
    assert stamps[-30:] == list(range(30, 60))


def test_a_broken_check_sum_is_no_frame() -> None:
    codec = Codec(7, 1)
    packet = bytearray(codec.encode(position(3)))
    packet[15] ^= 1
    good = codec.encode(position(4))
    assert [f.data for f in FrameReader().feed(bytes(packet) + good)] == [good]


def test_a_message_that_the_dialect_does_not_know_is_passed_over() -> None:
    codec = Codec(7, 1)
    unknown = bytes([0xFD, 3, 0, 0, 0, 7, 1, 0x10, 0x20, 0x30, 1, 2, 3, 9, 9])
    frames = FrameReader().feed(unknown + codec.encode(beat()))
    assert [f.message_id for f in frames] == [0x302010, 0]
    assert codec.decode(frames[0]) is None


def test_an_unwanted_message_costs_little() -> None:
    """Frames of 32 vehicles with 50 messages a second each must leave the event loop time."""
    codec = Codec(7, 1)
    stream = b"".join(codec.encode(position(n)) for n in range(1600))
    reader = FrameReader()
    began_s = time.process_time()
    assert len(reader.feed(stream)) == 1600
    cut_s = time.process_time() - began_s
    assert cut_s < 0.2


# --- signatures ----------------------------------------------------------------------------------


def test_signatures() -> None:
    key = Signing.from_passphrase("open sesame")
    assert key.key.hex().startswith("41ef4bb0b23661e6")
    ours, theirs = Codec(245, 190, key), Codec(7, 1, key)
    packet = theirs.encode(beat())
    (frame,) = FrameReader().feed(packet)
    assert frame.signed
    assert frame.data[2] == 1
    assert ours.decode(frame) is not None
    # The same packet a second time is a replay; an unsigned one is nobody's.
    assert ours.decode(frame) is None
    plain = Codec(7, 1).encode(beat())
    assert ours.decode(Frame(7, 1, 0, plain)) is None
    other = Codec(7, 1, Signing.from_passphrase("something else")).encode(beat())
    assert ours.decode(Frame(7, 1, 0, other)) is None
    # Without a key everybody's word is taken.
    assert Codec(245, 190).decode(frame) is not None


class SignedBoat:
    """A vehicle of pymavlink alone: it answers parameter requests if they are signed with its key.

    With `twice` it answers everything twice, as two vehicles with one system id do.
    """

    def __init__(self, passphrase: str | None, twice: bool = False) -> None:
        self.mav = mavlink.MAVLink(None, srcSystem=5, srcComponent=1)
        self.mav.robust_parsing = True
        if passphrase is not None:
            self.mav.signing.secret_key = Signing.from_passphrase(passphrase).key
            self.mav.signing.sign_outgoing = True
            self.mav.signing.timestamp = int((time.time() - 1_420_070_400) * 1e5)
        self.twice = twice
        self.refused = 0

    async def __aenter__(self) -> str:
        self.server = await asyncio.start_server(self._serve, "127.0.0.1", 0)
        return f"tcp:127.0.0.1:{self.server.sockets[0].getsockname()[1]}"

    async def __aexit__(self, *_: object) -> None:
        self.server.close()
        await asyncio.sleep(0.05)

    def _send(self, writer: asyncio.StreamWriter, message: Any) -> None:
        for _ in range(1 + self.twice):
            writer.write(message.pack(self.mav))
            self.mav.seq = (self.mav.seq + 1) % 256

    async def _serve(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        self._send(writer, beat())
        while data := await reader.read(4096):
            for message in self.mav.parse_buffer(data) or ():
                kind = message.get_type()
                if kind == "BAD_DATA":
                    self.refused += 1
                elif kind == "HEARTBEAT":
                    self._send(writer, beat())
                elif kind == "PARAM_REQUEST_READ":
                    value = mavlink.MAVLink_param_value_message(b"WP_SPEED", 2.5, 9, 1, 0)
                    self._send(writer, value)
                elif kind == "MISSION_REQUEST_LIST":
                    self._send(writer, mavlink.MAVLink_mission_count_message(245, 190, 0, 0))
        writer.transport.abort()


async def test_a_signed_link() -> None:
    async with SignedBoat("open sesame") as link:
        connections = parse_connections([link])
        key = Signing.from_passphrase("open sesame")
        async with open_links(connections, expected=1, timeouts=QUICK, signing=key) as found:
            assert await found.vehicles[5].parameter("WP_SPEED") == 2.5
        async with open_links(connections, expected=1, timeouts=QUICK) as found:
            vehicle = found.vehicles[5]
            assert await vehicle.parameter("WP_SPEED") is None
            with pytest.raises(VehicleError, match="give --sign-key-file"):
                await vehicle.clear(MissionType.FENCE)


async def test_a_wrong_key_is_said() -> None:
    async with SignedBoat("open sesame") as link:
        key = Signing.from_passphrase("close sesame")
        async with open_links(
            parse_connections([link]), expected=1, timeouts=QUICK, signing=key
        ) as found:
            assert not found.vehicles
            assert "not signed with this key" in next(iter(found.silent.values()))


async def test_twins_behind_one_radio() -> None:
    async with SignedBoat(None, twice=True) as link:
        with pytest.raises(VehicleError, match="two vehicles have system id 5, both on tcpout"):
            async with open_links(parse_connections([link]), expected=1, timeouts=QUICK):
                pass


# --- the choice of a client ----------------------------------------------------------------------


async def test_clients_by_name() -> None:
    async with SignedBoat(None) as link:
        connections = parse_connections([link])
        async with open_by_name(connections, expected=1, timeouts=QUICK) as found:
            assert isinstance(found.vehicles[5], Vehicle)
    with pytest.raises(ConfigError, match="--client smoke: no such client"):
        async with open_by_name(connections, expected=1, timeouts=QUICK, client="smoke"):
            pass
    key = Signing.from_passphrase("x")
    with pytest.raises(ConfigError, match="MAVSDK cannot sign"):
        async with open_by_name(
            connections, expected=1, timeouts=QUICK, client="mavsdk", signing=key
        ):
            pass


# --- transports ----------------------------------------------------------------------------------


class Collected:
    def __init__(self) -> None:
        self.data: list[tuple[Any, bytes]] = []
        self.ups: list[Any] = []

    def receive(self, peer: Any, data: bytes) -> None:
        self.data.append((peer, data))

    async def until(self, ready: Callable[[], bool]) -> None:
        async with asyncio.timeout(5.0):
            while not ready():
                await asyncio.sleep(0.01)


async def test_tcp_reconnects() -> None:
    heard: list[bytes] = []
    writers: list[asyncio.StreamWriter] = []

    async def serve(reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        writers.append(writer)
        while data := await reader.read(100):
            heard.append(data)
        writer.transport.abort()

    server = await asyncio.start_server(serve, "127.0.0.1", 0)
    port = server.sockets[0].getsockname()[1]
    got = Collected()
    link = make_transport(parse_connection(f"tcp:127.0.0.1:{port}"), got.receive, got.ups.append)
    await link.open(1.0)
    link.send(b"one")
    await got.until(lambda: heard == [b"one"])
    writers[0].transport.abort()
    await got.until(lambda: len(got.ups) == 2)
    assert link.down == ""
    link.send(b"two")
    await got.until(lambda: heard == [b"one", b"two"])
    writers[1].write(b"back")
    await got.until(lambda: [data for _, data in got.data] == [b"back"])
    server.close()
    writers[1].transport.abort()
    await got.until(lambda: link.down == "connection refused")
    link.send(b"lost")
    await link.close()


async def test_udp_answers_where_it_was_called_from() -> None:
    with socket.socket(type=socket.SOCK_DGRAM) as probe:
        probe.bind(("127.0.0.1", 0))
        port = probe.getsockname()[1]
    got = Collected()
    link = make_transport(parse_connection(f"udp:127.0.0.1:{port}"), got.receive, got.ups.append)
    await link.open(1.0)
    callers = [socket.socket(type=socket.SOCK_DGRAM) for _ in range(2)]
    try:
        for number, caller in enumerate(callers):
            caller.settimeout(2.0)
            caller.sendto(bytes([number]), ("127.0.0.1", port))
        await got.until(lambda: len(got.data) == 2)
        assert sorted(data for _, data in got.data) == [b"\0", b"\1"]
        assert [peer for peer, _ in got.data] == got.ups
        second = next(peer for peer, data in got.data if data == b"\1")
        link.send(b"for the second", second)
        link.send(b"for all")
        await asyncio.sleep(0.05)
        assert callers[1].recv(99) == b"for the second"
        assert callers[1].recv(99) == b"for all"
        assert callers[0].recv(99) == b"for all"
    finally:
        for caller in callers:
            caller.close()
        await link.close()


@pytest.mark.parametrize(
    ("text", "reason"),
    [
        ("tcp:127.0.0.1:1", "connection refused"),
        ("udpin://192.0.2.1:14550", "no such address"),
        ("serial:///dev/no-such-radio", "no serial device /dev/no-such-radio"),
        ("serial:///dev/null", "serial device /dev/null cannot be opened"),
    ],
)
async def test_links_that_do_not_open(text: str, reason: str) -> None:
    got = Collected()
    link = make_transport(parse_connection(text), got.receive, got.ups.append)
    with pytest.raises(LinkOpenError, match=reason):
        await link.open(1.0)
    await link.close()


def test_serial_connections_are_read() -> None:
    connection = parse_connection("serial:///dev/ttyUSB0:115200")
    assert (connection.device, connection.baud) == ("/dev/ttyUSB0", 115200)
    assert parse_connection("serial:COM3").device == "COM3"


# --- commands and parameters ---------------------------------------------------------------------


async def test_a_vehicle_that_answers_nothing() -> None:
    async with (
        SignedBoat(None) as link,
        open_links(parse_connections([link]), expected=1, timeouts=QUICK) as found,
    ):
        vehicle = found.vehicles[5]
        await vehicle.wait_heartbeat()
        assert (vehicle.mode, vehicle.armed) == ("AUTO", False)
        with pytest.raises(LinkTimeoutError, match="no answer to command 400 in 2 tries"):
            await vehicle.command(400, 1, timeout_s=0.05, tries=2)
        with pytest.raises(LinkTimeoutError, match=r"no AUTOPILOT_VERSION in 0\.1 s"):
            await vehicle.message("AUTOPILOT_VERSION", 0.1)
        with pytest.raises(VehicleError, match="WP_RADIUS set to 3, and it does not confirm"):
            await vehicle.set_parameter("WP_RADIUS", 3.0)
        assert vehicle.position_lonlat() is None
        assert vehicle.gps_fix == 0


async def test_long_status_texts_are_put_together() -> None:
    async with (
        SignedBoat(None) as link,
        open_links(parse_connections([link]), expected=1, timeouts=QUICK) as found,
    ):
        vehicle = found.vehicles[5]
        boat = Codec(5, 1)
        for text, number, chunk in (
            (b"short", 0, 0), (b"a" * 50, 3, 0), (b"a" * 50, 3, 0), (b"bcd", 3, 1), (b"end", 0, 0),
        ):  # fmt: skip
            message = mavlink.MAVLink_statustext_message(4, text, number, chunk)
            for frame in FrameReader().feed(boat.encode(message)):
                vehicle.handle(frame)
        assert vehicle.status_texts() == ("short", "a" * 50 + "bcd", "end")
        vehicle.forget_status_texts()
        assert vehicle.status_texts() == ()

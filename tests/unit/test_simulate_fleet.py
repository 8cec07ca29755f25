"""Links, faults, the fleet on real loopback sockets, and the `sim` command."""

from __future__ import annotations

import asyncio
import json
import math
import signal
import socket
import subprocess
import sys
from typing import Any

import pytest
from click.testing import CliRunner
from sim_client import Station

from mrmission.cli.main import cli
from mrmission.cli.sim import parse_lonlat, parse_parameter
from mrmission.errors import ConfigError, SimulatorError
from mrmission.simulate import Faults, FleetThread, SimulatedFleet, berths_lonlat
from mrmission.simulate.motion import offset_m
from mrmission.simulate.transport import FaultyChannel
from mrmission.simulate.wire import Codec, mavlink


def test_a_codec_reads_what_it_wrote_through_garbage_and_in_pieces() -> None:
    sender, receiver = Codec(9), Codec(250)
    wire = b"noise" + b"".join(
        sender.encode(mavlink.MAVLink_mission_item_reached_message(i)) for i in range(300)
    )
    got = [m for i in range(0, len(wire), 7) for m in receiver.decode(wire[i : i + 7])]
    assert [m.seq for m in got] == list(range(300))
    assert {m.get_srcSystem() for m in got} == {9}
    assert [m.get_seq() for m in got] == [i % 256 for i in range(300)]


def carried(faults: Faults, count: int = 20_000) -> list[int]:
    channel = FaultyChannel[int](faults)
    return [out for i in range(count) for out in channel.carry(i)]


def test_a_faultless_channel_is_the_identity() -> None:
    assert carried(Faults()) == list(range(20_000))


def test_faults_come_at_their_rate_and_are_reproducible() -> None:
    lost = carried(Faults(loss=0.1))
    assert len(lost) / 20_000 == pytest.approx(0.9, abs=0.01)
    assert lost == sorted(set(lost))
    doubled = carried(Faults(duplicate=0.1))
    assert len(doubled) / 20_000 == pytest.approx(1.1, abs=0.01)
    swapped = carried(Faults(reorder=0.1))
    assert swapped != sorted(swapped)
    assert max(abs(value - place) for place, value in enumerate(swapped)) <= 2
    assert lost == carried(Faults(loss=0.1))
    assert lost != carried(Faults(loss=0.1, seed=1))


def test_berths_lie_15_m_apart_to_the_right_of_the_bow() -> None:
    for heading in (0.0, 90.0, 222.0):
        berths = berths_lonlat((8.5, 47.3), 4, heading_deg=heading)
        assert berths[0] == (8.5, 47.3)
        for i, (lon, lat) in enumerate(berths):
            east, north = offset_m(47.3, 8.5, lat, lon)
            assert math.hypot(east, north) == pytest.approx(15.0 * i, abs=0.02)
            if i:
                bearing = math.degrees(math.atan2(east, north)) % 360
                assert bearing == pytest.approx((heading + 90) % 360, abs=0.1)


@pytest.mark.parametrize(
    "wrong",
    [
        {"count": 0},
        {"count": 251},
        {"count": 2, "first_system_id": 255},
        {"count": 1, "first_system_id": 0},
        {"count": 1, "speedup": 0.0},
        {"count": 1, "speedup": float("nan")},
        {"count": 10, "base_port": 65500},
        {"count": 1, "home_lonlat": (8.5, 95.0)},
        {"count": 2, "starts_lonlat": [(8.5, 47.3)]},
    ],
)
def test_impossible_fleets_are_refused(wrong: dict[str, Any]) -> None:
    with pytest.raises(ConfigError):
        SimulatedFleet(**wrong)


async def read_kinds(port: int, send: bytes = b"", seconds: float = 2.0, until: str = "") -> list:
    reader, writer = await asyncio.open_connection("127.0.0.1", port)
    codec = Codec(250, 190)
    if send:
        writer.write(send)
    got: list = []
    try:
        async with asyncio.timeout(seconds):
            while not any(m.get_type() == until for m in got):
                data = await reader.read(4096)
                if not data:
                    break
                got += codec.decode(data)
    finally:
        writer.close()
    return got


async def test_every_boat_has_its_port_and_its_system_id() -> None:
    async with SimulatedFleet(count=3, base_port=0, first_system_id=11) as fleet:
        assert fleet.system_ids == (11, 12, 13)
        assert len(set(fleet.ports)) == 3
        assert fleet.links == [f"tcpout://127.0.0.1:{port}" for port in fleet.ports]
        for port, system_id in zip(fleet.ports, fleet.system_ids, strict=True):
            got = await read_kinds(port, until="HEARTBEAT")
            assert {m.get_srcSystem() for m in got} == {system_id}


async def test_two_stations_on_one_boat_get_their_own_answers() -> None:
    async with SimulatedFleet(count=1, base_port=0) as fleet:
        [port] = fleet.ports
        ask = Codec(250, 190).encode(mavlink.MAVLink_mission_request_list_message(1, 1, 2))
        asking = asyncio.create_task(read_kinds(port, ask, until="MISSION_COUNT"))
        watching = asyncio.create_task(read_kinds(port, until="GLOBAL_POSITION_INT"))
        asked, watched = await asyncio.gather(asking, watching)
    assert any(m.get_type() == "MISSION_COUNT" for m in asked)
    assert not any(m.get_type() == "MISSION_COUNT" for m in watched)


async def test_ports_as_ardupilots_sitl_opens_them_and_a_taken_port_is_an_error() -> None:
    with socket.socket() as taken:
        taken.bind(("127.0.0.1", 0))
        taken.listen()
        port = taken.getsockname()[1]
        fleet = SimulatedFleet(count=2, base_port=port - 10 if port > 60_000 else port)
        with pytest.raises(SimulatorError, match=str(port)):
            await fleet.start()
    base = port - 10 if port > 60_000 else port
    async with SimulatedFleet(count=2, base_port=base) as fleet:
        assert fleet.ports == (base, base + 10)


async def test_udp_out_finds_the_station() -> None:
    loop = asyncio.get_running_loop()
    heard: asyncio.Queue[bytes] = asyncio.Queue()

    class Ear(asyncio.DatagramProtocol):
        def datagram_received(self, data: bytes, addr: object) -> None:
            heard.put_nowait(data)

    transport, _ = await loop.create_datagram_endpoint(Ear, local_addr=("127.0.0.1", 0))
    port = transport.get_extra_info("sockname")[1]
    codec = Codec(250)
    async with SimulatedFleet(count=2, udp_out=("127.0.0.1", port)) as fleet:
        assert fleet.links == [f"udpin://0.0.0.0:{port}"]
        seen: set[int] = set()
        async with asyncio.timeout(3.0):
            while len(seen) < 2:
                seen |= {m.get_srcSystem() for m in codec.decode(await heard.get())}
    transport.close()
    assert seen == {1, 2}


def test_a_fleet_in_a_thread_serves_a_caller_without_a_loop() -> None:
    with FleetThread(SimulatedFleet(count=1, base_port=0)) as fleet:
        link = socket.create_connection(("127.0.0.1", fleet.ports[0]), timeout=3.0)
        assert Codec(250).decode(link.recv(512))[0].get_type() == "HEARTBEAT"
        link.close()
    with pytest.raises(OSError, match="refused"):
        socket.create_connection(("127.0.0.1", fleet.ports[0]), timeout=1.0)


def test_an_error_in_the_thread_reaches_the_caller() -> None:
    with socket.socket() as taken:
        taken.bind(("127.0.0.1", 0))
        taken.listen()
        port = taken.getsockname()[1]
        with pytest.raises(SimulatorError), FleetThread(SimulatedFleet(count=1, base_port=port)):
            pass


async def test_an_error_inside_a_boat_is_raised_by_run() -> None:
    async with SimulatedFleet(count=1, base_port=0) as fleet:

        def sink(*_: object, **__: object) -> None:
            raise ZeroDivisionError("sunk")

        fleet.vehicles[0].autopilot.advance = sink  # type: ignore[method-assign]
        with pytest.raises(ZeroDivisionError):
            await asyncio.wait_for(fleet.run(), 2.0)
        fleet._ticker = None


# --- the command ---


@pytest.mark.parametrize("text", ["", "8.5", "8.5,", "8.5,47.3,1", "200,47", "8,90", "x,y"])
def test_bad_positions(text: str) -> None:
    with pytest.raises(ConfigError, match="--home"):
        parse_lonlat(text)


def test_positions_and_parameters() -> None:
    assert parse_lonlat("-81.25,34.06") == (-81.25, 34.06)
    assert parse_parameter("wp_speed=3") == ("WP_SPEED", 3.0)
    for text in ("WP_SPEED", "=3", "WP_SPEED=fast", "A_NAME_THAT_IS_TOO_LONG=1"):
        with pytest.raises(ConfigError, match="--param"):
            parse_parameter(text)


@pytest.mark.parametrize(
    "arguments",
    [["--k", "0"], ["--loss", "1"], ["--udp-out", "host"], ["--ready-after", "nan"],
     ["--speedup", "0"], ["--home", "1;2"], ["--sysid", "300"]],
)  # fmt: skip
def test_bad_options_are_configuration_errors(arguments: list[str]) -> None:
    result = CliRunner().invoke(cli, ["sim", *arguments])
    assert isinstance(result.exception, ConfigError)


def test_the_command_runs_until_it_is_interrupted() -> None:
    code = "from mrmission.cli.sim import sim; sim()"
    process = subprocess.Popen(
        [
            sys.executable,
            "-c",
            code,
            "--k",
            "2",
            "--base-port",
            "0",
            "--json",
            "--home",
            "8.5,47.3",
        ],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    )
    assert process.stdout is not None
    assert process.stderr is not None
    try:
        boats = json.loads(process.stdout.readline())["boats"]
        assert [boat["system_id"] for boat in boats] == [1, 2]
        assert boats[0]["home_lonlat"] == [8.5, 47.3]
        port = int(boats[1]["link"].rpartition(":")[2])
        with socket.create_connection(("127.0.0.1", port), timeout=3.0) as link:
            assert Codec(250).decode(link.recv(512))[0].get_srcSystem() == 2
        process.send_signal(signal.SIGINT)
        _, errors = process.communicate(timeout=10)
    finally:
        process.kill()
        process.wait()
    assert process.returncode == 0
    assert "afloat" in errors
    assert "Traceback" not in errors


def test_the_station_of_the_tests_counts_its_losses() -> None:
    station = Station(faults=Faults(loss=1.0))
    assert station.send(mavlink.MAVLink_ping_message(1, 2, 0, 0)) == []

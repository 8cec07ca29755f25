"""Bad links, several kinds of links, and two programs on one: light boats, ArduRover where it is.

The long series (20 tries at a loss, with ArduRover) carries the mark `ardupilot`.
"""

from __future__ import annotations

import asyncio
import contextlib
import os
import socket
import time
from collections.abc import AsyncIterator, Sequence
from pathlib import Path
from typing import Any

import pytest
from fleets import Engine, ardupilot, program_path
from lossy_proxy import Badness, LossyTcp, LossyUdp
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from mrmission.errors import VehicleError
from mrmission.simulate import SimulatedFleet
from mrmission.vehicle import mission_protocol
from mrmission.vehicle.client import Vehicle, open_links
from mrmission.vehicle.connection import parse_connections
from mrmission.vehicle.framing import SIGNING_EPOCH_S, Codec, Signing
from mrmission.vehicle.items import MissionType, RawItem
from mrmission.vehicle.links import FleetLinks, LinkTimeouts, TransferError
from mrmission.vehicle.mavsdk_link import open_links as open_over_mavsdk
from mrmission.vehicle.readback import compare_items

HOME = (8.5, 47.3)
QUICK = LinkTimeouts(retry_probe_s=0.0, discovery_s=5.0)
PATIENT = LinkTimeouts(discovery_s=15.0, retry_probe_s=5.0)
STORES = (MissionType.FENCE, MissionType.RALLY, MissionType.MISSION)


def wanted(kind: MissionType, count: int) -> tuple[RawItem, ...]:
    lat, lon = 473_000_000, 85_000_000
    if kind is MissionType.MISSION:
        return tuple(
            RawItem(
                seq=seq, frame=3 if seq else 0, command=16, current=int(seq == 0),
                x=lat + 300 * seq, y=lon + 11 * seq,
            )
            for seq in range(count)
        )  # fmt: skip
    if kind is MissionType.FENCE:
        corners = ((0, 0), (9000, 0), (9000, 9000), (4000, 12000), (0, 9000))
        return tuple(
            RawItem(
                seq=seq, frame=0, command=5001, current=int(seq == 0), param1=float(len(corners)),
                x=lat + dx, y=lon + dy, mission_type=kind,
            )
            for seq, (dx, dy) in enumerate(corners)
        )  # fmt: skip
    return tuple(
        RawItem(
            seq=seq, frame=3, command=5100, current=int(seq == 0), x=lat + seq, y=lon,
            mission_type=kind,
        )
        for seq in range(2)
    )  # fmt: skip


@contextlib.asynccontextmanager
async def boats(count: int, **options: Any) -> AsyncIterator[SimulatedFleet]:
    async with SimulatedFleet(count=count, home_lonlat=HOME, base_port=0, **options) as fleet:
        yield fleet


def linked(
    links: Sequence[str], expected: int = 0, timeouts: LinkTimeouts = QUICK, **options: Any
) -> contextlib.AbstractAsyncContextManager[FleetLinks[Vehicle]]:
    return open_links(
        parse_connections(links), expected=expected or len(links), timeouts=timeouts, **options
    )


def free_port(kind: int = socket.SOCK_STREAM) -> int:
    with socket.socket(type=kind) as probe:
        probe.bind(("127.0.0.1", 0))
        return int(probe.getsockname()[1])


def port_of(link: str) -> int:
    return int(link.rpartition(":")[2])


async def filled(vehicle: Vehicle, count: int, tries: int = 3) -> bool:
    """Clear, upload and read back all three stores; whether all of that succeeded."""
    for kind in STORES:
        items = wanted(kind, count)
        for left in reversed(range(tries)):
            try:
                await vehicle.clear(kind)
                await vehicle.upload(kind, items)
                if not compare_items(items, await vehicle.download(kind), kind):
                    break
            except VehicleError:
                if not left:
                    return False
                await asyncio.sleep(0.5)
        else:
            return False
    return True


def holds(fleet: SimulatedFleet, index: int, count: int) -> bool:
    boat = fleet.vehicles[index]
    return (boat.mission.count(), boat.fence.count(), boat.rally.count()) == (count, 5, 2)


# --- losses --------------------------------------------------------------------------------------


@pytest.mark.parametrize(("loss", "count"), [(0.1, 3), (0.2, 1)])
async def test_a_hundred_items_through_a_bad_link(loss: float, count: int) -> None:
    async with boats(count) as fleet, contextlib.AsyncExitStack() as stack:
        proxies = [
            await stack.enter_async_context(
                LossyTcp(
                    port_of(link), Badness(loss=loss, duplicate=loss / 2, reorder=loss / 2, seed=n)
                )
            )
            for n, link in enumerate(fleet.links)
        ]
        async with linked([proxy.url for proxy in proxies], timeouts=PATIENT) as found:
            assert len(found.vehicles) == count
            done = await asyncio.gather(*(filled(v, 100) for v in found.vehicles.values()))
        assert done == [True] * count
        assert all(holds(fleet, index, 100) for index in range(count))


async def test_three_boats_behind_one_bad_udp_link() -> None:
    port = free_port(socket.SOCK_DGRAM)
    bad = Badness(loss=0.1, duplicate=0.05, reorder=0.05, seed=7)
    async with (
        LossyUdp(port, bad) as proxy,
        boats(3, first_system_id=11, udp_out=("127.0.0.1", proxy.port)) as fleet,
        linked([f"udp:127.0.0.1:{port}"], 3, PATIENT) as found,
    ):
        assert list(found.vehicles) == [11, 12, 13]
        done = await asyncio.gather(*(filled(v, 40) for v in found.vehicles.values()))
        assert done == [True] * 3
        assert all(holds(fleet, index, 40) for index in range(3))


async def test_a_cut_in_mid_transfer() -> None:
    async with (
        boats(1) as fleet,
        LossyTcp(port_of(fleet.links[0]), Badness(delay_s=0.01)) as proxy,
        linked([proxy.url]) as found,
    ):
        vehicle = found.vehicles[1]

        def cut(share: float) -> None:
            if share > 0.4 and proxy.connections == 1:
                proxy.cut()

        await vehicle.upload(MissionType.MISSION, wanted(MissionType.MISSION, 200), cut)
        stored = await vehicle.download(MissionType.MISSION)
        assert proxy.connections == 2
    assert not compare_items(wanted(MissionType.MISSION, 200), stored, MissionType.MISSION)


async def test_a_boat_that_reboots_in_mid_transfer() -> None:
    port = free_port()
    rebooted = asyncio.Event()

    def watch(share: float) -> None:
        if share > 0.3:
            rebooted.set()

    items = wanted(MissionType.MISSION, 300)
    async with LossyTcp(port, Badness(delay_s=0.01)) as proxy:
        first = SimulatedFleet(count=1, home_lonlat=HOME, base_port=port)
        await first.__aenter__()
        async with linked([proxy.url]) as found:
            vehicle = found.vehicles[1]
            task = asyncio.create_task(vehicle.upload(MissionType.MISSION, items, watch))
            await asyncio.wait_for(rebooted.wait(), 5.0)
            await first.__aexit__(None, None, None)
            await asyncio.sleep(0.3)
            async with SimulatedFleet(count=1, home_lonlat=HOME, base_port=port) as second:
                with pytest.raises(TransferError, match="restarted") as caught:
                    await task
                assert caught.value.result == "ERROR"
                await vehicle.upload(MissionType.MISSION, items)
                assert second.vehicles[0].mission.count() == 300


async def test_a_boat_that_is_gone_is_said_to_be(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(mission_protocol, "GIVE_UP_S", 1.5)
    async with contextlib.AsyncExitStack() as stack:
        fleet = await stack.enter_async_context(boats(1))
        proxy = LossyTcp(port_of(fleet.links[0]), Badness())
        await proxy.__aenter__()
        found = await stack.enter_async_context(linked([proxy.url]))
        vehicle = found.vehicles[1]
        await proxy.__aexit__()
        with pytest.raises(TransferError, match=r"TIMEOUT \((connection|other end)") as caught:
            await vehicle.upload(MissionType.MISSION, wanted(MissionType.MISSION, 5))
        assert caught.value.result == "TIMEOUT"


# --- another implementation ----------------------------------------------------------------------


def sent_part(kind: MissionType, items: tuple[RawItem, ...]) -> tuple[RawItem, ...]:
    """What was sent of a list: the first item of a mission is home, and an ArduRover's moves."""
    return items[1:] if kind is MissionType.MISSION else items


async def test_mavsdk_reads_what_we_write_and_the_reverse(engine: Engine) -> None:
    async with engine.fleet(count=1, fresh=False) as fleet:
        connections = parse_connections(fleet.links)

        # An ArduPilot port serves one client at a time.
        async with linked(fleet.links, timeouts=PATIENT) as found:
            (own,) = found.vehicles.values()
            read = {}
            for kind in STORES:
                await own.upload(kind, wanted(kind, 60))
                read[kind] = await own.download(kind)
                assert not compare_items(wanted(kind, 60), read[kind], kind)
        async with open_over_mavsdk(connections, expected=1, timeouts=PATIENT) as over:
            (other,) = over.vehicles.values()
            for kind in STORES:
                assert sent_part(kind, await other.download(kind)) == sent_part(kind, read[kind])
                await other.clear(kind)
            for kind in STORES:
                await other.upload(kind, wanted(kind, 60))
                assert await other.stored_count(kind) == len(read[kind])
        async with linked(fleet.links, timeouts=PATIENT) as found:
            (own,) = found.vehicles.values()
            for kind in STORES:
                assert sent_part(kind, await own.download(kind)) == sent_part(kind, read[kind])
                assert await own.stored_count(kind) == len(read[kind])


# --- serial --------------------------------------------------------------------------------------


@contextlib.asynccontextmanager
async def serial_boat(link: str) -> AsyncIterator[tuple[str, int]]:
    """A serial device that leads to a boat: its name, and the descriptor at its other end."""
    near, device = os.openpty()
    os.set_blocking(near, False)
    name = os.ttyname(device)
    reader, writer = await asyncio.open_connection("127.0.0.1", port_of(link))
    loop = asyncio.get_running_loop()

    def to_boat() -> None:
        with contextlib.suppress(OSError):
            writer.write(os.read(near, 4096))

    async def from_boat() -> None:
        while data := await reader.read(256):
            with contextlib.suppress(BlockingIOError):
                os.write(near, data)

    loop.add_reader(near, to_boat)
    pump = asyncio.create_task(from_boat())
    try:
        yield name, near
    finally:
        loop.remove_reader(near)
        pump.cancel()
        await asyncio.gather(pump, return_exceptions=True)
        writer.transport.abort()
        os.close(device)
        with contextlib.suppress(OSError):
            os.close(near)


async def test_a_serial_line() -> None:
    async with (
        boats(1) as fleet,
        serial_boat(fleet.links[0]) as (device, _),
        linked([f"serial://{device}:57600"]) as found,
    ):
        assert await filled(found.vehicles[1], 60)
        assert holds(fleet, 0, 60)
        # The device is ours alone: a second program is told so.
        async with linked([f"serial:{device}:57600"]) as second:
            assert not second.vehicles
            (reason,) = second.silent.values()
            assert "in use by another program" in reason


async def test_a_serial_device_that_is_pulled(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(mission_protocol, "GIVE_UP_S", 1.5)
    async with (
        boats(1) as fleet,
        serial_boat(fleet.links[0]) as (device, near),
        linked([f"serial://{device}:57600"]) as found,
    ):
        vehicle = found.vehicles[1]
        asyncio.get_running_loop().remove_reader(near)
        os.close(near)
        with pytest.raises(VehicleError, match=r"is gone \(unplugged|serial device"):
            await vehicle.upload(MissionType.MISSION, wanted(MissionType.MISSION, 5))


async def test_no_such_serial_device() -> None:
    async with linked(["serial:///dev/no-such-radio:57600"]) as found:
        assert not found.vehicles
        assert "no serial device /dev/no-such-radio" in next(iter(found.silent.values()))


# --- several vehicles, several links -------------------------------------------------------------


async def test_many_links() -> None:
    async with boats(24) as fleet, linked(fleet.links, timeouts=PATIENT) as found:
        assert list(found.vehicles) == list(range(1, 25))
        counts = await asyncio.gather(
            *(v.stored_count(MissionType.FENCE) for v in found.vehicles.values())
        )
        assert counts == [0] * 24


async def test_boats_call_at_a_udp_port_and_one_is_called_by_udp() -> None:
    listening = free_port(socket.SOCK_DGRAM)
    calling = free_port(socket.SOCK_DGRAM)
    async with (
        boats(2, udp_out=("127.0.0.1", listening)),
        linked([f"udpin://127.0.0.1:{listening}"], 2) as found,
    ):
        assert list(found.vehicles) == [1, 2]
    # The other way round: a router that answers whoever calls it.
    async with boats(1) as fleet:
        reader, writer = await asyncio.open_connection("127.0.0.1", port_of(fleet.links[0]))
        station: list[Any] = []

        class Router(asyncio.DatagramProtocol):
            def connection_made(self, transport: Any) -> None:
                self.transport = transport

            def datagram_received(self, data: bytes, addr: Any) -> None:
                station[:] = [addr]
                writer.write(data)

        router, _ = await asyncio.get_running_loop().create_datagram_endpoint(
            Router, local_addr=("127.0.0.1", calling)
        )

        async def back() -> None:
            while data := await reader.read(2048):
                if station:
                    router.sendto(data, station[0])

        pump = asyncio.create_task(back())
        async with linked([f"udpout://127.0.0.1:{calling}"]) as found:
            assert await filled(found.vehicles[1], 20)
        pump.cancel()
        await asyncio.gather(pump, return_exceptions=True)
        router.close()
        writer.transport.abort()


async def test_a_boat_calls_at_a_tcp_port() -> None:
    port = free_port()
    async with boats(1) as fleet:

        async def call() -> None:
            while True:
                try:
                    near = await asyncio.open_connection("127.0.0.1", port)
                    break
                except OSError:
                    await asyncio.sleep(0.05)
            far = await asyncio.open_connection("127.0.0.1", port_of(fleet.links[0]))

            async def pump(reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
                with contextlib.suppress(OSError):
                    while data := await reader.read(4096):
                        writer.write(data)
                writer.transport.abort()

            await asyncio.gather(pump(near[0], far[1]), pump(far[0], near[1]))

        calling = asyncio.create_task(call())
        async with linked([f"tcpin://127.0.0.1:{port}"]) as found:
            assert await filled(found.vehicles[1], 20)
        await asyncio.gather(calling, return_exceptions=True)


# --- two programs --------------------------------------------------------------------------------


class OtherStation:
    """Another ground station, on a connection of its own to the same vehicle."""

    def __init__(self, system_id: int) -> None:
        self.codec = Codec(system_id, 190)

    async def connect(self, link: str) -> None:
        self.reader, self.writer = await asyncio.open_connection("127.0.0.1", port_of(link))

    def send(self, message: Any) -> None:
        self.writer.write(self.codec.encode(message))

    def close(self) -> None:
        self.writer.transport.abort()


async def test_another_program_is_transferring() -> None:
    async with boats(1) as fleet, linked(fleet.links) as found:
        other = OtherStation(255)
        await other.connect(fleet.links[0])
        other.send(mavlink.MAVLink_mission_count_message(1, 1, 9, 0))
        await asyncio.sleep(0.2)
        with pytest.raises(TransferError, match="busy with another program") as caught:
            await found.vehicles[1].upload(MissionType.MISSION, wanted(MissionType.MISSION, 5))
        assert caught.value.result == "DENIED"
        other.close()


async def test_another_station_is_seen_and_named() -> None:
    port = free_port(socket.SOCK_DGRAM)
    async with (
        boats(1, udp_out=("127.0.0.1", port)),
        linked([f"udp:127.0.0.1:{port}"]) as found,
    ):
        vehicle = found.vehicles[1]
        assert vehicle.company() == ""
        codec = Codec(255, 190)
        with socket.socket(type=socket.SOCK_DGRAM) as radio:
            beat = mavlink.MAVLink_heartbeat_message(6, 8, 0, 0, 4, 3)
            radio.sendto(codec.encode(beat), ("127.0.0.1", port))
            await asyncio.sleep(0.1)
            assert vehicle.company() == "ground station 255 is on this link too"
            # A transfer to somebody else, overheard on a shared radio.
            boat = Codec(1, 1)
            ack = mavlink.MAVLink_mission_request_message(255, 190, 3, 0)
            with vehicle.listen("MISSION_REQUEST"):
                radio.sendto(boat.encode(ack), ("127.0.0.1", port))
                await asyncio.sleep(0.1)
        assert vehicle.rival == 255


async def test_a_port_that_takes_the_call_and_stays_silent() -> None:
    async def silent(_: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        try:
            await asyncio.sleep(1.0)
        finally:
            writer.transport.abort()

    server = await asyncio.start_server(silent, "127.0.0.1", 0)
    port = server.sockets[0].getsockname()[1]
    quick = LinkTimeouts(discovery_s=0.5, retry_probe_s=0.0)
    async with linked([f"tcp:127.0.0.1:{port}"], timeouts=quick) as found:
        assert "another program may hold it" in next(iter(found.silent.values()))
    server.close()
    await asyncio.sleep(0.6)


async def test_ports_that_others_listen_at() -> None:
    with socket.socket(type=socket.SOCK_DGRAM) as udp, socket.socket() as tcp:
        udp.bind(("127.0.0.1", 0))
        tcp.bind(("127.0.0.1", 0))
        tcp.listen()
        ports = udp.getsockname()[1], tcp.getsockname()[1]
        links = [f"udpin://127.0.0.1:{ports[0]}", f"tcpin://127.0.0.1:{ports[1]}"]
        async with linked(links) as found:
            assert found.vehicles == {}
            assert [f"port {p} is in use" in r for p, r in zip(
                ports, found.silent.values(), strict=True)] == [True, True]  # fmt: skip


async def test_two_vehicles_with_one_id() -> None:
    port = free_port(socket.SOCK_DGRAM)
    async with (
        boats(1, udp_out=("127.0.0.1", port)),
        boats(1, udp_out=("127.0.0.1", port)),
    ):
        with pytest.raises(VehicleError, match="system id 1, both on udpin"):
            async with linked([f"udpin://127.0.0.1:{port}"]):
                pass
    async with boats(2) as fleet, boats(1, first_system_id=2) as twin:
        with pytest.raises(VehicleError, match="two vehicles have system id 2, on tcpout"):
            async with linked([*fleet.links, *twin.links]):
                pass


# --- ArduRover -----------------------------------------------------------------------------------


@pytest.mark.ardupilot
@pytest.mark.parametrize("loss", [0.1, 0.2])
async def test_twenty_tries_with_ardurover(loss: float) -> None:
    async with ardupilot(4, speedup=1.0) as fleet, contextlib.AsyncExitStack() as stack:
        proxies = [
            await stack.enter_async_context(
                LossyTcp(port_of(link), Badness(loss=loss, duplicate=0.05, reorder=0.05, seed=n))
            )
            for n, link in enumerate(fleet.links)
        ]
        async with linked([p.url for p in proxies], timeouts=PATIENT) as found:
            for _ in range(5):
                done = await asyncio.gather(*(filled(v, 100) for v in found.vehicles.values()))
                assert done == [True] * 4


@pytest.mark.ardupilot
async def test_ardurover_on_a_signed_link(tmp_path: Path) -> None:
    program = program_path("ardurover")
    assert program is not None
    ports = free_port(), free_port()
    # ArduPilot takes its first port for a cable, and unsigned packets there in any case.
    process = await asyncio.create_subprocess_exec(
        program, "--model", "motorboat", "--sysid", "23", "-I", "107", "--home", "47.3,8.5,1,0",
        "--serial0", f"tcp:{ports[0]}", "--serial1", f"tcp:{ports[1]}", "--serial2", "none:",
        cwd=tmp_path, stdin=asyncio.subprocess.DEVNULL, stdout=asyncio.subprocess.DEVNULL,
        stderr=asyncio.subprocess.DEVNULL,
    )  # fmt: skip
    cable, radio = (f"tcp:127.0.0.1:{port}" for port in ports)
    key = Signing.from_passphrase("correct horse")
    try:
        async with linked([cable], timeouts=PATIENT) as found:
            vehicle = found.vehicles[23]
            now = int((time.time() - SIGNING_EPOCH_S) * 1e5)
            setup = mavlink.MAVLink_setup_signing_message(23, 1, list(key.key), now)
            vehicle.send(setup)
            vehicle.send(setup)
            await asyncio.sleep(1.0)
        async with linked([radio], timeouts=PATIENT, signing=key) as found:
            vehicle = found.vehicles[23]
            assert await filled(vehicle, 40)
            assert await vehicle.parameter("MAV_SYSID") in (23.0, None)
        async with linked([radio], timeouts=PATIENT) as found:
            with pytest.raises(VehicleError, match="takes signed ones only: give --sign-key-file"):
                await found.vehicles[23].stored_count(MissionType.MISSION)
        wrong = Signing.from_passphrase("battery staple")
        async with linked([radio], signing=wrong) as found:
            assert not found.vehicles
            assert "not signed with this key" in next(iter(found.silent.values()))
    finally:
        process.kill()
        await process.wait()

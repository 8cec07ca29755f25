"""MAVSDK's own importer as the judge of our .plan files: it must see exactly what we meant."""

from __future__ import annotations

import asyncio
import math
import socket
import threading
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from mrmission.mission.items import build_items
from mrmission.mission.qgc_plan import plan_text, read_plan
from mrmission.model import FencePolygon, Mission, RallyPoint
from mrmission.options import PlanOptions


def heartbeats(port: int, stop: threading.Event) -> None:
    """Pretend to be an ArduPilot boat: the importer wants a vehicle, a heartbeat will do."""
    from pymavlink.dialects.v20 import ardupilotmega as mavlink

    wire = mavlink.MAVLink(None, srcSystem=7, srcComponent=1)
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as link:
        while not stop.wait(0.1):
            beat = wire.heartbeat_encode(
                mavlink.MAV_TYPE_SURFACE_BOAT, mavlink.MAV_AUTOPILOT_ARDUPILOTMEGA, 1, 0, 4
            )
            link.sendto(beat.pack(wire), ("127.0.0.1", port))


@pytest.fixture(scope="module")
def boat_port() -> Iterator[int]:
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
        probe.bind(("127.0.0.1", 0))
        port = probe.getsockname()[1]
    stop = threading.Event()
    thread = threading.Thread(target=heartbeats, args=(port, stop))
    thread.start()
    yield port
    stop.set()
    thread.join()


def imported(port: int, texts: list[str]) -> list[Any]:
    from mavsdk.asyncio import ComponentType, Configuration, Mavsdk
    from mavsdk.asyncio.plugins.mission_raw.mission_raw import MissionRawAsync

    async def run() -> list[Any]:
        configuration = Configuration.create_with_component_type(ComponentType.GROUND_STATION)
        async with Mavsdk(configuration) as sdk:
            await sdk.add_any_connection(f"udpin://127.0.0.1:{port}")
            system = await sdk.first_autopilot(10.0)
            assert system is not None
            raw = MissionRawAsync(system)
            return [await raw.import_qgroundcontrol_mission_from_string(t) for t in texts]

    return asyncio.run(run())


def rows(items: list[Any]) -> list[tuple[Any, ...]]:
    def single(value: float) -> float | None:
        """MAVLink's floats have 32 bits."""
        return None if math.isnan(value) else float(np.float32(value))

    return [
        (i.seq, i.frame, i.command, i.autocontinue, single(i.param1), single(i.param2),
         single(i.param3), single(i.param4), i.x, i.y, single(i.z))
        for i in items
    ]  # fmt: skip


def expected(mission: Mission) -> list[tuple[Any, ...]]:
    out = rows(list(mission.items))
    if out:
        # the importer makes home of plannedHomePosition, in frame 5, which vehicles store as 0
        out[0] = (out[0][0], 5, *out[0][2:])
    return out


def sample(vehicle: str, **options: Any) -> Mission:
    # values where degrees * 1e7 falls below the integer, because the importer truncates
    lat, lon = 299769035, -813123457
    path = np.array([[lon, lat], [lon + 7, lat + 1001], [lon + 9001, lat - 33], [lon, lat]]) / 1e7
    items, kind, lane = build_items(
        path, np.array([0, 1, 0]), np.array([0, 1, 0]),
        PlanOptions(vehicle=vehicle, transit_speed_m_s=2.5, **options),
    )  # fmt: skip
    rng = np.random.default_rng(1)
    rings = [rng.integers([lat, lon], [lat + 99999, lon + 99999], (n, 2)) for n in (83, 3, 4)]
    return Mission(
        robot=1, sortie=1, vehicle=vehicle, items=items, kind=kind, lane=lane,
        fence=tuple(FencePolygon(inclusion=i == 0, points_e7=r) for i, r in enumerate(rings)),
        rally=(RallyPoint(lat_e7=lat, lon_e7=lon), RallyPoint(lat_e7=-lat, lon_e7=-lon)),
    )  # fmt: skip


def check(data: Any, mission: Mission) -> None:
    assert rows(data.mission_items) == expected(mission)
    assert sum(i.current for i in data.mission_items) == (1 if mission.items else 0)
    fence = [
        (5001 if p.inclusion else 5002, float(len(p.points_e7)), x, y)
        for p in mission.fence
        for x, y in p.points_e7.tolist()
    ]
    assert [(i.command, i.param1, i.x, i.y) for i in data.geofence_items] == fence
    assert {i.mission_type for i in data.geofence_items} <= {1}
    assert [(i.command, i.x, i.y, i.z) for i in data.rally_items] == [
        (5100, r.lat_e7, r.lon_e7, r.altitude_m) for r in mission.rally
    ]


def test_mavsdk_imports_our_items_fence_and_rally_points(boat_port: int) -> None:
    photos = {"trigger_distance_m": 7.3}
    missions = [sample(vehicle) for vehicle in ("boat", "rover", "copter")]
    missions += [sample(vehicle, **photos) for vehicle in ("boat", "rover", "copter")]
    missions += [
        sample("copter", altitude_above="terrain", altitude_m=42.25, trigger="continuous", **photos)
    ]
    assert {i.frame for i in missions[-1].items} == {0, 10}
    for data, mission in zip(
        imported(boat_port, [plan_text(m) for m in missions]), missions, strict=True
    ):
        check(data, mission)


def test_mavsdk_imports_rewritten_foreign_plans(boat_port: int, shared_data: Path) -> None:
    files = sorted((shared_data / "plans").glob("*.plan"))
    missions = [read_plan(path) for path in files]
    for data, mission in zip(
        imported(boat_port, [plan_text(m) for m in missions]), missions, strict=True
    ):
        if mission.items:
            check(data, mission)


def test_mavsdk_accepts_the_plan_of_a_robot_without_work(boat_port: int) -> None:
    idle = Mission(robot=1, sortie=1, vehicle="boat", items=(), fence=(), rally=())
    (data,) = imported(boat_port, [plan_text(idle, (10.0, 50.0))])
    assert [i.command for i in data.mission_items] in ([], [16])

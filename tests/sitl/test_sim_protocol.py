"""The simulated fleet against MAVSDK over TCP: the station that mrmission itself uses."""

from __future__ import annotations

import asyncio
from typing import Any

import pytest
from mavsdk.asyncio import ComponentType, Configuration, Mavsdk
from mavsdk.asyncio.plugins.action import ActionAsync
from mavsdk.asyncio.plugins.mission_raw import MissionRawAsync
from mavsdk.asyncio.plugins.param import ParamAsync
from mavsdk.asyncio.plugins.telemetry import TelemetryAsync
from mavsdk.plugins.mission_raw import MissionItem, MissionRawError

from mrmission.simulate import SimulatedFleet

LAT_E7, LON_E7 = 473_000_000, 85_000_000


def item(seq: int, north: int, east: int, **changes: Any) -> MissionItem:
    fields = {
        "seq": seq, "frame": 6 if seq else 0, "command": 16, "current": int(seq == 0),
        "autocontinue": 1, "param1": 0.0, "param2": 0.0, "param3": 0.0, "param4": float("nan"),
        "x": LAT_E7 + 90 * north, "y": LON_E7 + 132 * east, "z": 0.0, "mission_type": 0,
    }  # fmt: skip
    return MissionItem(**{**fields, **changes})


async def connect(sdk: Mavsdk, fleet: SimulatedFleet) -> dict[int, Any]:
    """Return MAVSDK's systems by system id."""
    for link in fleet.links:
        await sdk.add_any_connection(link)
    async with asyncio.timeout(5.0):
        while True:
            systems = {await s.get_system_id(): s for s in await sdk.get_systems()}
            if systems.keys() >= set(fleet.system_ids):
                return systems
            await asyncio.sleep(0.02)


def station() -> Mavsdk:
    return Mavsdk(Configuration.create_with_component_type(ComponentType.GROUND_STATION))


async def test_mission_fence_and_rally_of_two_boats_come_back() -> None:
    afloat = SimulatedFleet(count=2, home_lonlat=(8.5, 47.3), base_port=0)
    async with afloat as fleet, station() as sdk:
        systems = await connect(sdk, fleet)

        async def one(system_id: int) -> None:
            system = systems[system_id]
            mission = [item(i, 10 * i, system_id) for i in range(60)]
            fence = [
                item(i, n, e, command=5001, frame=0, param1=4.0, param4=0.0, current=0,
                     mission_type=1)
                for i, (n, e) in enumerate([(-50, -50), (-50, 900), (900, 900), (900, -50)])
            ]  # fmt: skip
            rally = [item(0, 5, 5, command=5100, frame=3, current=0, mission_type=2)]
            plugin = MissionRawAsync(system)
            await plugin.upload_geofence(fence)
            await plugin.upload_rally_points(rally)
            # MAVSDK keeps one progress total per object: the mission last, on its own.
            missions = MissionRawAsync(system)
            await missions.upload_mission(mission)
            got = await missions.download_mission()
            boat = fleet.vehicles[system_id - 1]
            assert [(g.x, g.y) for g in got[1:]] == [(m.x, m.y) for m in mission[1:]]
            assert (got[0].x, got[0].y) == (LAT_E7, boat.mission.home.y)
            assert {g.frame for g in got[1:]} == {3}
            assert {g.param4 for g in got} == {0.0}
            fences = await plugin.download_geofence()
            assert [(g.x, g.y, g.param1) for g in fences] == [(f.x, f.y, 4.0) for f in fence]
            rallies = await plugin.download_rallypoints()
            assert [(g.x, g.y, g.frame) for g in rallies] == [(rally[0].x, rally[0].y, 3)]

        await asyncio.gather(one(1), one(2))


async def test_refusals_reach_the_station_as_mavsdk_knows_them() -> None:
    async with SimulatedFleet(count=1, base_port=0) as fleet, station() as sdk:
        system = (await connect(sdk, fleet))[1]
        missions = MissionRawAsync(system)
        too_long = [item(i, i % 500, 0) for i in range(656)]
        with pytest.raises(MissionRawError, match="TOO_MANY_MISSION_ITEMS"):
            await missions.upload_mission(too_long)
        with pytest.raises(MissionRawError, match="INVALID_ARGUMENT"):
            await missions.upload_mission([item(0, 0, 0), item(1, 1, 1, param1=float("nan"))])
        with pytest.raises(MissionRawError, match="UNSUPPORTED"):
            await missions.upload_mission([item(0, 0, 0), item(1, 1, 1, command=195, param4=0.0)])
        fence = [
            item(i, i, i * i, command=5001, frame=0, param1=84.0, param4=0.0, current=0,
                 mission_type=1)
            for i in range(84)
        ]  # fmt: skip
        with pytest.raises(MissionRawError):
            await missions.upload_geofence(fence)


async def test_mavsdk_sees_position_home_and_parameters_and_sails_a_mission() -> None:
    async with SimulatedFleet(
        count=1, home_lonlat=(8.5, 47.3), base_port=0, speedup=40.0
    ) as fleet, station() as sdk:  # fmt: skip
        system = (await connect(sdk, fleet))[1]
        telemetry, missions = TelemetryAsync(system), MissionRawAsync(system)
        action, param = ActionAsync(system), ParamAsync(system)
        async with asyncio.timeout(20.0):
            home = await anext(aiter(telemetry.subscribe_home()))
            assert home.latitude_deg == pytest.approx(47.3, abs=1e-6)
            assert await param.get_param_int("AVOID_ENABLE") == 3
            await param.set_param_float("WP_SPEED", 3.0)
            assert await param.get_param_float("WP_SPEED") == 3.0
            await missions.upload_mission([item(0, 0, 0), item(1, 30, 0), item(2, 30, 30)])
            assert not await anext(aiter(telemetry.subscribe_armed()))
            await action.arm()
            await missions.start_mission()
            async for progress in missions.subscribe_mission_progress():
                if progress.current >= progress.total:
                    break
            async for position in telemetry.subscribe_position():
                if abs(position.latitude_deg - (LAT_E7 + 2700) * 1e-7) < 3e-5 and (
                    abs(position.longitude_deg - (LON_E7 + 3960) * 1e-7) < 4e-5
                ):
                    break

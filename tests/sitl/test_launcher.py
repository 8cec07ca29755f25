"""Fleets of both engines are what a test may rely on, and no ArduPilot outlives its launcher."""

from __future__ import annotations

import asyncio
import math
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest
from fleets import HOME, Engine, Fleet

from mrmission.simulate import ArdupilotFleet
from mrmission.simulate.ardupilot_models import MODELS, survey_parameters
from mrmission.simulate.motion import moved, offset_m
from mrmission.vehicle.client import Vehicle, open_links
from mrmission.vehicle.connection import parse_connections
from mrmission.vehicle.items import MissionType, RawItem
from mrmission.vehicle.links import LinkTimeouts

SPEEDUP = 5.0
BERTH_M = 3.0
"""A boat goes astern by a metre more or less before it is ready, and the EKF errs."""
FORCE = 21196


def leg(start_lonlat: tuple[float, float], north_m: float = 60.0) -> list[RawItem]:
    """Home and two waypoints straight ahead."""

    def item(seq: int, ahead_m: float) -> RawItem:
        lat, lon = moved(start_lonlat[1], start_lonlat[0], 0.0, ahead_m)
        return RawItem(
            seq=seq, frame=3 if seq else 0, command=16, current=int(seq == 0),
            x=round(lat * 1e7), y=round(lon * 1e7),
        )  # fmt: skip

    return [item(0, 0.0), item(1, north_m / 2), item(2, north_m)]


async def sails_ahead(engine: Engine, boat: Vehicle, start_lonlat: tuple[float, float]) -> float:
    """Arm, start a mission at the first try, and return how far ahead the boat gets, m."""
    await boat.wait_heartbeat()
    assert boat.mode == "HOLD"
    assert not boat.armed
    await boat.upload(MissionType.MISSION, leg(start_lonlat), None)
    assert await boat.command(boat.mav.MAV_CMD_COMPONENT_ARM_DISARM, 1, tries=1) == 0
    auto = boat.mav.MAV_MODE_FLAG_CUSTOM_MODE_ENABLED, 10
    assert await boat.command(boat.mav.MAV_CMD_DO_SET_MODE, *auto, tries=1) == 0
    await boat.stream("GLOBAL_POSITION_INT", 5.0)
    ahead_m = 0.0
    async with asyncio.timeout(60.0 / min(engine.speedup, 2.0) + 10.0):
        while ahead_m < 20.0:
            message = await boat.message("GLOBAL_POSITION_INT", 10.0)
            where = message.lat / 1e7, message.lon / 1e7
            right_m, ahead_m = offset_m(start_lonlat[1], start_lonlat[0], *where)
            assert abs(right_m) < 5.0
    assert await boat.command(boat.mav.MAV_CMD_COMPONENT_ARM_DISARM, 0, FORCE) == 0
    return ahead_m


async def positions(fleet: Fleet) -> list[tuple[float, float]]:
    """Where each boat is, m east and north of its berth."""
    connections = parse_connections(fleet.links)
    found = []
    async with open_links(connections, expected=len(fleet.links), timeouts=LinkTimeouts()) as links:
        for number, (lon, lat) in zip(fleet.system_ids, fleet.starts_lonlat, strict=True):
            message = await links.vehicles[number].message("GLOBAL_POSITION_INT", 10.0)
            found.append(offset_m(lat, lon, message.lat / 1e7, message.lon / 1e7))
    return found


async def test_four_boats_lie_side_by_side_and_start_at_the_first_try(engine: Engine) -> None:
    async with engine.fleet(count=4, speedup=SPEEDUP) as fleet:
        for east_m, north_m in await positions(fleet):
            assert math.hypot(east_m, north_m) < BERTH_M
        async with open_links(
            parse_connections(fleet.links), expected=4, timeouts=LinkTimeouts()
        ) as links:
            assert sorted(links.vehicles) == [1, 2, 3, 4]
            await asyncio.gather(
                *(
                    sails_ahead(engine, links.vehicles[number], start)
                    for number, start in zip(fleet.system_ids, fleet.starts_lonlat, strict=True)
                )
            )


async def test_a_boat_has_the_parameters_of_the_files_and_the_tests_own(engine: Engine) -> None:
    wanted = {**survey_parameters("motorboat"), "WP_SPEED": 3.0, "SIM_TIDE_SPEED": 0.3}
    async with engine.fleet(
        count=1, parameters={"WP_SPEED": 3.0, "SIM_TIDE_SPEED": 0.3}
    ) as fleet, open_links(
        parse_connections(fleet.links), expected=1, timeouts=LinkTimeouts()
    ) as links:  # fmt: skip
        got = await links.vehicles[1].parameters(sorted(wanted))
    assert {name: value for name, value in got.items() if value is None} == {}
    assert got == pytest.approx(wanted, rel=1e-6)


async def test_shared_boats_come_back_empty(engine: Engine) -> None:
    for _ in range(2):
        async with engine.fleet(count=1, fresh=False) as fleet, open_links(
            parse_connections(fleet.links), expected=1, timeouts=LinkTimeouts()
        ) as links:  # fmt: skip
            boat = links.vehicles[1]
            assert await boat.stored_count(MissionType.MISSION) <= 1
            await boat.upload(MissionType.MISSION, leg(HOME), None)
            assert await boat.stored_count(MissionType.MISSION) == 3


@pytest.mark.ardupilot
@pytest.mark.parametrize("model", [name for name in MODELS if name != "quad"])
async def test_every_model_of_rover_gets_ready_and_takes_its_parameters(model: str) -> None:
    async with ArdupilotFleet(
        count=1, home_lonlat=HOME, base_port=0, speedup=10.0, model=model, heading_deg=90.0
    ) as fleet, open_links(
        parse_connections(fleet.links), expected=1, timeouts=LinkTimeouts()
    ) as links:  # fmt: skip
        wanted = survey_parameters(model)
        assert await links.vehicles[1].parameters(sorted(wanted)) == pytest.approx(wanted, rel=1e-6)
        lon, lat = HOME
        message = await links.vehicles[1].message("GLOBAL_POSITION_INT", 10.0)
        assert math.hypot(*offset_m(lat, lon, message.lat / 1e7, message.lon / 1e7)) < BERTH_M


@pytest.mark.ardupilot(program="arducopter")
async def test_a_copter_gets_ready_and_takes_its_parameters() -> None:
    async with ArdupilotFleet(
        count=1, home_lonlat=HOME, base_port=0, speedup=5.0, model="quad"
    ) as fleet, open_links(
        parse_connections(fleet.links), expected=1, timeouts=LinkTimeouts()
    ) as links:  # fmt: skip
        wanted = survey_parameters("quad")
        assert await links.vehicles[1].parameters(sorted(wanted)) == pytest.approx(wanted, rel=1e-6)


@pytest.mark.ardupilot
async def test_two_programs_have_a_link_each() -> None:
    async with ArdupilotFleet(count=1, home_lonlat=HOME, base_port=0, speedup=10.0) as fleet:
        for links in (fleet.links, fleet.second_links, fleet.links):
            async with open_links(
                parse_connections(links), expected=1, timeouts=LinkTimeouts()
            ) as found:
                await found.vehicles[1].wait_heartbeat()


@pytest.mark.ardupilot
async def test_after_a_restart_a_boat_is_as_new() -> None:
    async with ArdupilotFleet(count=1, home_lonlat=HOME, base_port=0, speedup=10.0) as fleet:
        for count in (0, 3):
            async with open_links(
                parse_connections(fleet.links), expected=1, timeouts=LinkTimeouts()
            ) as links:
                boat = links.vehicles[1]
                assert await boat.stored_count(MissionType.MISSION) <= 1
                await boat.upload(MissionType.MISSION, leg(HOME), None)
                assert await boat.stored_count(MissionType.MISSION) == 3
            if count == 0:
                await fleet.restart()
                ((east_m, north_m),) = await positions(fleet)
                assert math.hypot(east_m, north_m) < BERTH_M


def running(folder: Path) -> list[int]:
    """Processes whose working directory is in a folder."""
    found = []
    for process in Path("/proc").glob("[0-9]*"):
        try:
            if (process / "cwd").readlink().is_relative_to(folder):
                found.append(int(process.name))
        except OSError:
            continue
    return found


@pytest.mark.ardupilot
@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM, signal.SIGKILL])
def test_no_process_is_left_however_the_command_ends(tmp_path: Path, number: int) -> None:
    process = subprocess.Popen(
        [sys.executable, "-m", "mrmission", "sim", "--engine", "ardupilot", "--k", "2",
         "--base-port", "0", "--home", "8.5,47.3", "--speedup", "10", "--json",
         "--keep", str(tmp_path)],
        stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True,
    )  # fmt: skip
    try:
        assert process.stdout is not None
        assert "second_link" in process.stdout.readline()
        assert len(running(tmp_path)) == 2
        process.send_signal(number)
        assert process.wait(15.0) == (-number if number == signal.SIGKILL else 0)
        deadline_s = time.monotonic() + 5.0
        while running(tmp_path) and time.monotonic() < deadline_s:
            time.sleep(0.1)
        assert running(tmp_path) == []
    finally:
        process.kill()
        process.communicate()

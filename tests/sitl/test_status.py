"""Does a fleet still carry its plan the day after? Read only, against simulated boats."""

from __future__ import annotations

import asyncio
import json
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from dataclasses import replace
from pathlib import Path

import pytest
from boat_faults import Trouble
from upload_missions import HOME, mission, missions

from mrmission.cli.status import run_status
from mrmission.cli.upload_plan import read_missions
from mrmission.cli.upload_run import LinkChoice, run_upload
from mrmission.errors import InputError
from mrmission.mission.qgc_plan import write_plan
from mrmission.simulate import SimulatedFleet
from mrmission.vehicle.items import MissionType
from mrmission.vehicle.links import LinkTimeouts
from mrmission.vehicle.record import FleetFile, read_record
from mrmission.vehicle.rows import UploadTimeouts
from mrmission.vehicle.status import Carries, StatusRow, fleet_status

QUICK = UploadTimeouts(
    link=LinkTimeouts(retry_probe_s=0.0, discovery_s=3.0), pauses_s=(0.1,), return_s=2.0
)


@asynccontextmanager
async def uploaded(
    folder: Path, count: int = 3
) -> AsyncIterator[tuple[SimulatedFleet, list[Trouble]]]:
    """Boats that carry the plan of a folder, its files and its record."""
    for one in missions(count):
        write_plan(one, folder / f"robot-{one.robot}.plan")
    async with SimulatedFleet(count=count, home_lonlat=HOME, base_port=0) as fleet:
        links = LinkChoice(connect=tuple(fleet.links), timeouts=QUICK)
        code = await asyncio.to_thread(
            run_upload, read_missions(folder), links=links, record_folder=folder
        )
        assert code == 0
        yield fleet, [Trouble(fleet, index) for index in range(count)]


async def status(folder: Path, **options: object) -> list[StatusRow]:
    plans = {one.robot: one for one in read_missions(folder)} if options.pop("plans", True) else {}
    return await fleet_status(
        read_record(folder),
        missions=plans,
        timeouts=QUICK,
        **options,  # type: ignore[arg-type]
    )


def code(folder: Path) -> int:
    return run_status(folder, links=LinkChoice(timeouts=QUICK))


@pytest.mark.parametrize("client", ["pymavlink", "mavsdk"])
async def test_all_carry_it_and_nothing_is_written(
    client: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    async with uploaded(tmp_path) as (fleet, troubles):
        revisions = [boat.mission.revision for boat in fleet.vehicles]
        before = (tmp_path / "fleet.json").read_bytes()
        for plans in (True, False):
            rows = await status(tmp_path, client=client, plans=plans)
            assert [row.carries for row in rows] == [Carries.PLAN] * 3
            assert [(r.items, r.fence_items, r.rally_points) for r in rows] == [(14, 6, 1)] * 3
        # A day of sailing: another home.
        fleet.vehicles[0].mission.home = fleet.vehicles[0].mission.home._replace(x=1, y=2)
        capsys.readouterr()
        assert await asyncio.to_thread(code, tmp_path) == 0
        out, err = capsys.readouterr()
        assert out.count("✓ carries this plan") == 3
        assert "3 of 3 vehicles carry this plan; nothing was written" in err
        assert [boat.mission.revision for boat in fleet.vehicles] == revisions
        assert (tmp_path / "fleet.json").read_bytes() == before
        assert not any(trouble.items_seen for trouble in troubles)


async def test_what_differs_is_said(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    async with uploaded(tmp_path, 4) as (fleet, troubles):
        one, two, three, _ = fleet.vehicles
        one.mission.items[5] = one.mission.items[5]._replace(x=one.mission.items[5].x + 1)
        two.fence.items = []
        del two.mission.items[9:]
        for store in (three.mission, three.fence, three.rally):
            store.items = []
        troubles[3].die()
        rows = await status(tmp_path)
        assert [row.carries for row in rows] == [
            Carries.OTHER, Carries.OTHER, Carries.EMPTY, Carries.ABSENT,
        ]  # fmt: skip
        assert rows[0].detail == "mission item 5: another x"
        assert rows[1].detail == "mission: 9 items instead of 14; no fence"
        assert "says nothing" in rows[3].detail
        assert rows[3].items is None
        # Without the plan's files, by the hashes alone.
        rows = await status(tmp_path, plans=False)
        assert rows[0].detail == "mission: 14 items"
        assert rows[1].detail == "mission: 9 items, 14 uploaded; fence: 0 points, 6 uploaded"
        links = LinkChoice(timeouts=QUICK)
        capsys.readouterr()
        assert await asyncio.to_thread(run_status, tmp_path, links=links, as_json=True) == 1
        document = json.loads(capsys.readouterr().out)
        assert document["all_carry_the_plan"] is False
        assert [r["carries"] for r in document["robots"]][2:] == ["empty", "absent"]


async def test_absent_alone_is_another_code(tmp_path: Path) -> None:
    async with uploaded(tmp_path, 2) as (_, troubles):
        troubles[1].die()
        assert await asyncio.to_thread(code, tmp_path) == 5


async def test_a_plan_that_was_made_anew_is_noticed(tmp_path: Path) -> None:
    async with uploaded(tmp_path, 2):
        write_plan(mission(2, 20), tmp_path / "robot-2.plan", overwrite=True)
        rows = await status(tmp_path)
        assert [row.carries for row in rows] == [Carries.PLAN, Carries.OTHER]
        assert "made anew since" in rows[1].detail


async def test_a_broken_upload_is_known_the_next_day(tmp_path: Path) -> None:
    async with uploaded(tmp_path, 1) as (fleet, _):
        FleetFile(tmp_path).begin(1, 1, fleet.links[0])
        fleet.vehicles[0].mission.items = fleet.vehicles[0].mission.items[:7]
        (row,) = await status(tmp_path)
        assert row.carries is Carries.OTHER
        assert "do not start it before another was verified" in row.detail


async def test_a_height_is_part_of_the_plan(tmp_path: Path) -> None:
    async with uploaded(tmp_path, 1) as (fleet, _):
        items = fleet.vehicles[0].mission.items
        items[4] = items[4]._replace(z=30.0)
        for plans in (True, False):
            (row,) = await status(tmp_path, plans=plans)
            assert row.carries is Carries.OTHER


async def test_a_robot_that_has_no_vehicle_yet(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    async with uploaded(tmp_path, 1):
        write_plan(mission(2), tmp_path / "robot-2.plan")
        assert await asyncio.to_thread(code, tmp_path) == 1
        assert "robots without a vehicle yet: 2" in capsys.readouterr().err


def test_folders_that_say_nothing(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="no such folder"):
        run_status(tmp_path / "none")
    with pytest.raises(InputError, match=r"holds no fleet\.json: nothing was uploaded"):
        run_status(tmp_path)
    with pytest.raises(InputError, match=r"--from .*no such folder"):
        read_missions(tmp_path / "none")
    with pytest.raises(InputError, match=r"--from .*holds no robot-1\.plan"):
        read_missions(tmp_path)


async def test_a_plan_of_no_work_is_carried_by_an_empty_boat(tmp_path: Path) -> None:
    idle = replace(mission(1), items=mission(1).items[:1])
    write_plan(idle, tmp_path / "robot-1.plan")
    async with SimulatedFleet(count=1, home_lonlat=HOME, base_port=0) as fleet:
        links = LinkChoice(connect=tuple(fleet.links), timeouts=QUICK)
        given = read_missions(tmp_path)
        assert await asyncio.to_thread(run_upload, given, links=links, record_folder=tmp_path) == 0
        assert read_record(tmp_path)[0].items(MissionType.FENCE) == 6
        assert await asyncio.to_thread(code, tmp_path) == 0

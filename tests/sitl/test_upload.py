"""Uploads to simulated boats, and to ArduRover where there is one: rows, states, exit codes."""

from __future__ import annotations

import asyncio
import json
import socket
from collections.abc import AsyncIterator, Sequence
from contextlib import asynccontextmanager
from dataclasses import replace
from pathlib import Path

import pytest
from fleets import Engine
from upload_missions import HOME, mission, missions

from mrmission.cli.upload_run import LinkChoice, run_upload
from mrmission.errors import UploadError, VehicleError
from mrmission.mission.qgc_plan import write_plan
from mrmission.simulate import Faults, SimulatedFleet
from mrmission.simulate.storage import Refusal
from mrmission.simulate.wire import mavlink
from mrmission.vehicle.capacity import KnownLimits
from mrmission.vehicle.job import FolderKeeper
from mrmission.vehicle.links import LinkTimeouts
from mrmission.vehicle.record import read_record
from mrmission.vehicle.status import Carries, fleet_status
from mrmission.vehicle.upload import (
    Holds,
    UploadProgress,
    UploadRow,
    UploadTimeouts,
    upload_fleet,
)

EMPTY = ((0, 0, 0), (1, 0, 0))
"""Items, fence points and rally points of an empty boat; it may store its home."""
QUICK = UploadTimeouts(
    link=LinkTimeouts(retry_probe_s=0.0, discovery_s=3.0),
    pauses_s=(0.1, 0.2),
    too_many_pause_s=0.1,
    return_s=6.0,
    restore_s=20.0,
    cleanup_s=6.0,
)
LINKS = LinkChoice(timeouts=QUICK)


@asynccontextmanager
async def boats(count: int, **options: object) -> AsyncIterator[SimulatedFleet]:
    async with SimulatedFleet(
        count=count,
        home_lonlat=HOME,
        base_port=0,
        **options,  # type: ignore[arg-type]
    ) as fleet:
        yield fleet


def statuses(rows: Sequence[UploadRow]) -> list[str]:
    return [str(row.status) for row in rows]


def free_port() -> int:
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        return int(probe.getsockname()[1])


def stored_counts(fleet: SimulatedFleet, index: int) -> tuple[int, int, int]:
    boat = fleet.vehicles[index]
    return boat.mission.count(), boat.fence.count(), boat.rally.count()


async def test_six_boats_then_again_nothing_is_sent() -> None:
    events: list[UploadProgress] = []
    async with boats(6, first_system_id=31) as fleet:
        # Links in another order than system ids: the ids decide.
        links = [fleet.links[i] for i in (3, 0, 5, 1, 4, 2)]
        rows = await upload_fleet(missions(6), links, timeouts=QUICK, progress=events.append)
        assert statuses(rows) == ["verified"] * 6
        assert [row.system_id for row in rows] == [31, 32, 33, 34, 35, 36]
        assert [row.link for row in rows] == fleet.links
        for index, row in enumerate(rows):
            assert stored_counts(fleet, index) == (14, 6, 1)
            assert fleet.vehicles[index].mission.items[1].y == 85_000_000 + 1000 * row.robot + 7
            assert (row.items, row.fence_items, row.rally_points, row.attempts) == (14, 6, 1, 1)
        assert not any(boat.autopilot.armed for boat in fleet.vehicles)
        assert {e.robot for e in events} == {1, 2, 3, 4, 5, 6}
        again = await upload_fleet(missions(6), fleet.links, timeouts=QUICK)
    assert statuses(again) == ["already stored"] * 6
    assert all(row.verified and row.attempts == 0 for row in again)


async def test_one_absent_and_the_second_run_completes_the_rest() -> None:
    port = free_port()
    async with boats(1) as first, boats(1, first_system_id=3) as third:
        links = [first.links[0], f"tcp:127.0.0.1:{port}", third.links[0]]
        rows = await upload_fleet(missions(3), links, timeouts=QUICK)
        assert statuses(rows) == ["verified", "absent", "verified"]
        assert [row.system_id for row in rows] == [1, None, 3]
        assert f"{port} connection refused" in rows[1].detail
        async with SimulatedFleet(
            count=1, home_lonlat=HOME, base_port=port, first_system_id=2
        ) as second:
            rows = await upload_fleet(missions(3), links, timeouts=QUICK)
            assert statuses(rows) == ["already stored", "verified", "already stored"]
            assert stored_counts(second, 0) == (14, 6, 1)


async def test_an_armed_boat_gets_no_byte() -> None:
    async with boats(3) as fleet:
        assert (
            statuses(await upload_fleet(missions(3), fleet.links, timeouts=QUICK))
            == ["verified"] * 3
        )
        before = list(fleet.vehicles[1].mission.items)
        fleet.vehicles[1].autopilot.armed = True
        changed = [mission(robot, shift=5) for robot in (1, 2, 3)]
        rows = await upload_fleet(changed, fleet.links, timeouts=QUICK)
        assert statuses(rows) == ["verified", "refused", "verified"]
        assert rows[1].detail.startswith("armed, in ")
        assert rows[1].detail.endswith("vehicle untouched")
        assert fleet.vehicles[1].mission.items == before
        assert fleet.vehicles[1].autopilot.armed


async def test_two_boats_with_one_id_stop_everything() -> None:
    async with boats(2) as fleet, boats(1, first_system_id=2) as twin:
        with pytest.raises(VehicleError, match="two vehicles have system id 2") as caught:
            await upload_fleet(missions(3), [*fleet.links, *twin.links], timeouts=QUICK)
        assert all(link in str(caught.value) for link in (fleet.links[1], twin.links[0]))
        assert all(stored_counts(fleet, i) in EMPTY for i in (0, 1))


async def test_two_boats_with_one_id_on_one_udp_link() -> None:
    port = free_port()
    async with boats(1, udp_out=("127.0.0.1", port)), boats(1, udp_out=("127.0.0.1", port)):
        with pytest.raises(VehicleError, match="system id 1, both on udpin"):
            await upload_fleet(missions(1), [f"udpin://127.0.0.1:{port}"], timeouts=QUICK)


async def test_one_udp_link_carries_all() -> None:
    port = free_port()
    async with boats(4, udp_out=("127.0.0.1", port), first_system_id=5) as fleet:
        rows = await upload_fleet(missions(4), [f"udp:127.0.0.1:{port}"], timeouts=QUICK)
        assert statuses(rows) == ["verified"] * 4
        assert [row.system_id for row in rows] == [5, 6, 7, 8]
        assert stored_counts(fleet, 2) == (14, 6, 1)


async def test_a_boat_that_holds_less_than_the_others_is_asked_first() -> None:
    async with boats(2) as fleet:
        fleet.vehicles[0].mission._capacity = 10
        with pytest.raises(UploadError, match=r"robot 1: .*14 items.*holds 10 \(vehicle 1\)"):
            await upload_fleet(missions(2), fleet.links, timeouts=QUICK)
        assert all(stored_counts(fleet, index) in EMPTY for index in (0, 1))


async def test_a_boat_that_takes_less_than_it_says_is_left_empty(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    async with boats(2) as fleet:
        store = fleet.vehicles[0].mission
        write = store.write

        def full(seq: int, item: object, last: int) -> None:
            if seq == 9:
                raise Refusal(mavlink.MAV_MISSION_NO_SPACE)
            write(seq, item, last)  # type: ignore[arg-type]

        monkeypatch.setattr(store, "write", full)
        rows = await upload_fleet(missions(2), fleet.links, timeouts=QUICK)
        assert statuses(rows) == ["refused", "verified"]
        assert "TOO_MANY_MISSION_ITEMS" in rows[0].detail
        assert "left empty" in rows[0].detail
        assert rows[0].holds is Holds.EMPTY
        assert stored_counts(fleet, 0) in EMPTY


async def test_too_many_items_stop_before_anything_is_sent() -> None:
    async with boats(2) as fleet:
        long = [mission(1), mission(2, 702)]
        with pytest.raises(
            UploadError, match=r"robot 2: .*702 items.*holds 655 \(vehicle 2\); nothing .* wider"
        ):
            await upload_fleet(long, fleet.links, timeouts=QUICK, hint=lambda n: "a wider one")
        assert stored_counts(fleet, 0) in EMPTY


async def test_a_card_holds_more() -> None:
    async with boats(1, parameters={"BRD_SD_MISSION": 64}) as fleet:
        rows = await upload_fleet([mission(1, 702)], fleet.links, timeouts=QUICK)
        assert statuses(rows) == ["verified"]
        assert stored_counts(fleet, 0)[0] == 702


async def test_what_is_stored_differently_is_named(monkeypatch: pytest.MonkeyPatch) -> None:
    async with boats(2) as fleet:
        store = fleet.vehicles[1].mission
        write = store.write

        def tampered(seq: int, item: object, last: int) -> None:
            write(seq, item._replace(x=item.x + 1) if seq == 4 else item, last)  # type: ignore[attr-defined,arg-type]

        monkeypatch.setattr(store, "write", tampered)
        rows = await upload_fleet(missions(2), fleet.links, timeouts=QUICK)
        assert statuses(rows) == ["verified", "stored differently"]
        assert "mission item 4: x sent 473002000, stored 473002001" in rows[1].detail
        assert "left empty" in rows[1].detail
        assert stored_counts(fleet, 1) in EMPTY


async def test_fence_and_rally_points_of_an_earlier_plan_go() -> None:
    async with boats(1) as fleet:
        await upload_fleet([mission(1)], fleet.links, timeouts=QUICK)
        bare = replace(mission(1), fence=(), rally=())
        rows = await upload_fleet([bare], fleet.links, timeouts=QUICK)
        assert statuses(rows) == ["verified"]
        assert stored_counts(fleet, 0) == (14, 0, 0)
        idle = replace(mission(1), items=mission(1).items[:1])
        rows = await upload_fleet([idle], fleet.links, timeouts=QUICK)
        assert (statuses(rows), rows[0].items) == (["verified"], 0)
        assert stored_counts(fleet, 0)[1:] == (6, 1)
        assert stored_counts(fleet, 0)[0] <= 1


async def test_a_lossy_link() -> None:
    async with boats(2, faults=Faults(loss=0.02, duplicate=0.02, reorder=0.02, seed=4)) as fleet:
        rows = await upload_fleet(
            missions(2), fleet.links, timeouts=replace(QUICK, pauses_s=(0.5, 8.5))
        )
        assert statuses(rows) == ["verified"] * 2


async def test_nothing_answers() -> None:
    port = free_port()
    with pytest.raises(VehicleError, match=rf"{port} connection refused.*--simulate"):
        await upload_fleet(missions(2), [f"tcp:127.0.0.1:{port}"], timeouts=QUICK)


async def test_more_links_than_mavsdk_objects() -> None:
    async with boats(14) as fleet:
        rows = await upload_fleet(missions(14), fleet.links, timeouts=QUICK)
        assert statuses(rows) == ["verified"] * 14
        assert [row.link for row in rows] == fleet.links
        async with boats(1, first_system_id=14) as twin:
            with pytest.raises(VehicleError, match="two vehicles have system id 14"):
                await upload_fleet(missions(14), [*fleet.links, *twin.links], timeouts=QUICK)


def test_the_command_simulated(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    assert run_upload(missions(2), simulate=True, as_json=True, links=LINKS) == 0
    document = json.loads(capsys.readouterr().out)
    assert document["verified"]
    assert document["simulated"]
    assert [r["status"] for r in document["robots"]] == ["verified"] * 2
    assert run_upload(missions(2), simulate=True, record_folder=tmp_path, links=LINKS) == 0
    out, err = capsys.readouterr()
    assert out.count("✓ verified") == 2
    assert "2 of 2 vehicles verified" in err
    assert list(tmp_path.iterdir()) == []


async def test_the_command_keeps_a_record(
    capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    for m in missions(2):
        write_plan(m, tmp_path / f"robot-{m.robot}.plan")

    def run(*links: str) -> int:
        from mrmission.cli.upload_plan import read_missions

        return run_upload(
            read_missions(tmp_path),
            links=LinkChoice(connect=links, timeouts=QUICK),
            record_folder=tmp_path,
        )

    gone = f"tcp:127.0.0.1:{free_port()}"
    async with boats(1, first_system_id=9) as nine, boats(1, first_system_id=4) as four:
        # Only 9 is there, and gets robot 1; when 4 comes, 9 keeps its tour.
        assert await asyncio.to_thread(run, nine.links[0], gone) == 5
        assert [(r.robot, r.system_id) for r in read_record(tmp_path)] == [(1, 9)]
        assert await asyncio.to_thread(run, nine.links[0], four.links[0]) == 0
        assert [(r.robot, r.system_id) for r in read_record(tmp_path)] == [(1, 9), (2, 4)]
    out = capsys.readouterr().out
    assert "✗ absent" in out
    assert "already stored" in out


# --- the same against light boats and ArduRover ------------------------------------------------


@pytest.mark.parametrize("client", ["pymavlink", "mavsdk"])
async def test_every_engine_stores_it_and_shows_it_again(
    engine: Engine, client: str, tmp_path: Path
) -> None:
    given = [mission(1, 60), mission(2, 60)]
    limits: dict[int, KnownLimits] = {}
    async with engine.fleet(count=2, fresh=False) as fleet:
        options = {"keeper": FolderKeeper(tmp_path), "client": client}
        rows = await upload_fleet(given, fleet.links, on_limits=limits.update, **options)  # type: ignore[arg-type]
        assert statuses(rows) == ["verified"] * 2, rows
        # A board without a card; asked, not assumed.
        assert str(limits[2]) == "655 mission items, 667 fence bytes, 50 rally points (vehicle 2)"
        rows = await upload_fleet(given, fleet.links, **options)  # type: ignore[arg-type]
        assert statuses(rows) == ["already stored"] * 2, rows
        assert all(row.attempts == 0 for row in rows)
        told = await fleet_status(read_record(tmp_path), client=client)
        assert [row.carries for row in told] == [Carries.PLAN] * 2, told


@pytest.mark.parametrize("client", ["pymavlink", "mavsdk"])
async def test_every_engine_gets_its_old_mission_back(
    engine: Engine, client: str, tmp_path: Path
) -> None:
    old, new = mission(1, 30, shift=-70), mission(1, 50)
    # Nobody knows this command, and a vehicle says so when it is there.
    items = list(new.items)
    items[20] = replace(items[20], command=31999)
    bad = replace(new, items=tuple(items))
    async with engine.fleet(count=1, fresh=False) as fleet:
        options = {"keeper": FolderKeeper(tmp_path), "client": client}
        rows = await upload_fleet([old], fleet.links, **options)  # type: ignore[arg-type]
        assert statuses(rows) == ["verified"], rows
        rows = await upload_fleet([bad], fleet.links, **options)  # type: ignore[arg-type]
        assert statuses(rows) == ["refused"], rows
        assert rows[0].holds is Holds.RESTORED
        rows = await upload_fleet([old], fleet.links, **options)  # type: ignore[arg-type]
        assert statuses(rows) == ["already stored"], rows


@pytest.mark.parametrize("client", ["pymavlink", "mavsdk"])
async def test_every_engine_is_left_empty_where_it_was_empty(engine: Engine, client: str) -> None:
    new = mission(1, 50)
    items = list(new.items)
    items[20] = replace(items[20], command=31999)
    async with engine.fleet(count=1, fresh=False) as fleet:
        rows = await upload_fleet([replace(new, items=tuple(items))], fleet.links, client=client)
        assert statuses(rows) == ["refused"], rows
        assert rows[0].holds is Holds.EMPTY
        rows = await upload_fleet([new], fleet.links, client=client)
        assert statuses(rows) == ["verified"], rows
        assert "remains" not in rows[0].detail

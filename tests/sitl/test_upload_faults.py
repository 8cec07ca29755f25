"""Uploads that go wrong: afterwards a boat holds the plan, its old mission, or nothing."""

from __future__ import annotations

import asyncio
import json
import os
import signal
from collections.abc import AsyncIterator, Callable, Sequence
from contextlib import asynccontextmanager
from dataclasses import replace
from pathlib import Path

import pytest
from boat_faults import Trouble
from fleets import Engine
from upload_missions import HOME, mission, missions

from mrmission.cli.upload_run import LinkChoice, run_upload
from mrmission.mission.qgc_plan import read_plan
from mrmission.simulate import Faults, SimulatedFleet, transfer
from mrmission.simulate.fleet import FleetThread
from mrmission.simulate.storage import Item
from mrmission.vehicle import mission_protocol
from mrmission.vehicle.client import Vehicle
from mrmission.vehicle.items import MissionType, RawItem, mission_to_raw
from mrmission.vehicle.job import FolderKeeper
from mrmission.vehicle.links import LinkTimeouts
from mrmission.vehicle.readback import compare_items
from mrmission.vehicle.record import RecordState, read_record
from mrmission.vehicle.upload import (
    Holds,
    UploadProgress,
    UploadRow,
    UploadStatus,
    UploadTimeouts,
    upload_fleet,
)

QUICK = UploadTimeouts(
    link=LinkTimeouts(retry_probe_s=0.0, discovery_s=4.0, silence_s=2.5),
    pauses_s=(0.1, 0.2, 0.4),
    hold_s=0.5,
    too_many_pause_s=0.1,
    return_s=4.0,
    restore_s=20.0,
    cleanup_s=5.0,
)
HASTY_S = 2.0


@pytest.fixture
def hasty(monkeypatch: pytest.MonkeyPatch) -> None:
    """Boats and client give a silent transfer up after 2 s instead of 8."""
    for module in (transfer, mission_protocol):
        monkeypatch.setattr(module, "GIVE_UP_S", HASTY_S)
    monkeypatch.setattr(mission_protocol, "HOLD_S", HASTY_S + 0.5)


OLD = mission(1, 20, shift=-70)
NEW = mission(1, 40)


@asynccontextmanager
async def boat(old: bool = True, **options: object) -> AsyncIterator[tuple[str, Trouble]]:
    """One boat, with an old mission unless told otherwise."""
    async with SimulatedFleet(
        count=1,
        home_lonlat=HOME,
        base_port=0,
        **options,  # type: ignore[arg-type]
    ) as fleet:
        trouble = Trouble(fleet)
        if old:
            row = await upload(fleet.links[0], None, mission=OLD)
            assert row.status is UploadStatus.VERIFIED
            assert trouble.holds(OLD)
        yield fleet.links[0], trouble


async def upload(
    link: str, folder: Path | None = None, *, mission: object = NEW, **options: object
) -> UploadRow:
    keeper = FolderKeeper(folder) if folder is not None else None
    (row,) = await upload_fleet(
        [mission],  # type: ignore[list-item]
        [link],
        keeper=keeper,
        **{"timeouts": QUICK, **options},  # type: ignore[arg-type]
    )
    return row


def of_the_new(seq: int, item: Item) -> bool:
    """Tell an item of NEW from one of OLD."""
    return seq == 9 and item.x == NEW.items[9].x


@pytest.mark.parametrize("client", ["pymavlink", "mavsdk"])
async def test_a_refused_mission_brings_the_old_one_back(client: str, tmp_path: Path) -> None:
    async with boat() as (link, trouble):
        trouble.refuse(of_the_new)
        row = await upload(link, tmp_path, client=client)
        assert (row.status, row.holds) == (UploadStatus.REFUSED, Holds.RESTORED)
        assert "old mission restored" in row.detail
        assert "what it held is in saved/vehicle-1-1.plan" in row.detail
        assert trouble.holds(OLD)
        (entry,) = read_record(tmp_path)
        assert entry.state is RecordState.FAILED
        saved = read_plan(tmp_path / "saved" / "vehicle-1-1.plan")
        assert not compare_items(
            mission_to_raw(OLD.items), mission_to_raw(saved.items), MissionType.MISSION
        )
        assert [p.points_e7.tolist() for p in saved.fence] == [
            p.points_e7.tolist() for p in OLD.fence
        ]
        # The same again: the same file, no second one.
        await upload(link, tmp_path, client=client)
        assert [p.name for p in (tmp_path / "saved").iterdir()] == ["vehicle-1-1.plan"]


async def test_an_old_mission_that_does_not_come_back_leaves_the_boat_empty() -> None:
    async with boat() as (link, trouble):
        trouble.refuse(lambda seq, item: seq == 9)
        row = await upload(link)
        assert (row.status, row.holds) == (UploadStatus.REFUSED, Holds.EMPTY)
        assert "left empty (mission, fence and rally points cleared)" in row.detail
        assert trouble.empty


async def test_what_is_stored_differently_brings_the_old_one_back() -> None:
    async with boat() as (link, trouble):
        store = trouble.boat.mission
        write = store.write

        def tampered(seq: int, item: Item, last: int) -> None:
            write(seq, item._replace(x=item.x + 1) if of_the_new(seq, item) else item, last)

        store.write = tampered  # type: ignore[method-assign]
        row = await upload(link)
        assert (row.status, row.holds) == (UploadStatus.MISMATCH, Holds.RESTORED)
        assert trouble.holds(OLD)


async def test_a_reboot_in_mid_transfer_is_waited_for() -> None:
    async with boat() as (link, trouble):
        trouble.at(MissionType.MISSION, 17, lambda: trouble.reboot(1.5))
        row = await upload(link)
        assert (row.status, row.holds) == (UploadStatus.VERIFIED, Holds.PLAN), row
        assert row.attempts >= 2
        assert trouble.holds(NEW)


@pytest.mark.usefixtures("hasty")
@pytest.mark.parametrize("kind", [MissionType.FENCE, MissionType.MISSION])
async def test_a_link_that_dies_for_good(kind: MissionType, tmp_path: Path) -> None:
    async with boat() as (link, trouble):
        trouble.at(kind, 3, trouble.die)
        quick = replace(QUICK, return_s=0.5, cleanup_s=1.0)
        row = await upload(link, tmp_path, timeouts=quick)
        assert (row.status, row.holds) == (UploadStatus.FAILED, Holds.UNKNOWN)
        assert "what it stores is unknown: it does not answer" in row.detail
        assert "do not start it before another upload was verified" in row.detail
        assert not trouble.holds(NEW)
        assert read_record(tmp_path)[0].state is RecordState.UNFINISHED
        # The old mission is in the file; what is in the boat now is not worth putting back.
        trouble.live()
        trouble.refuse(lambda seq, item: seq == 30)
        await asyncio.sleep(0.1)
        row = await upload(link, tmp_path)
        assert (row.status, row.holds) == (UploadStatus.REFUSED, Holds.EMPTY)
        assert "held the remains of a broken upload" in row.detail
        assert trouble.empty
        assert [p.name for p in (tmp_path / "saved").iterdir()] == ["vehicle-1-1.plan"]
        del trouble.boat.mission.write
        row = await upload(link, tmp_path)
        assert (row.status, row.holds) == (UploadStatus.VERIFIED, Holds.PLAN)
        assert read_record(tmp_path)[0].state is RecordState.VERIFIED


@pytest.mark.usefixtures("hasty")
async def test_remains_are_known_without_a_record() -> None:
    async with boat(old=False) as (link, trouble):
        trouble.at(MissionType.MISSION, 25, trouble.die)
        await upload(link, timeouts=replace(QUICK, return_s=0.1, cleanup_s=0.1))
        assert len(trouble.contents()[MissionType.MISSION]) == 25
        trouble.live()
        trouble.refuse(lambda seq, item: seq == 30)
        await asyncio.sleep(0.1)
        row = await upload(link)
        assert (row.holds, trouble.empty) == (Holds.EMPTY, True)


async def cancelled(link: str, times: int = 1) -> list[str]:
    """Cancel an upload in the middle of its mission, perhaps twice; return what was told."""
    began = asyncio.Event()
    told: list[str] = []

    def watch(event: UploadProgress) -> None:
        told.append(event.stage)
        if event.stage == "sending mission" and event.fraction > 0.2:
            began.set()
        if event.stage == "stopping" and times > 1:
            # A second Ctrl-C ends the event loop, and that cancels every task there is.
            for one in asyncio.all_tasks():
                if one.get_name() == "robot 1":
                    one.cancel()

    long = mission(1, 500)
    task = asyncio.create_task(upload_fleet([long], [link], timeouts=QUICK, progress=watch))
    await asyncio.wait_for(began.wait(), 20.0)
    task.cancel()
    with pytest.raises(asyncio.CancelledError):
        await task
    return told


async def test_cancelling_brings_the_old_mission_back() -> None:
    async with boat() as (link, trouble):
        told = await cancelled(link)
        assert told[-1] == "cancelled, old mission restored"
        assert "stopping" in told
        assert trouble.holds(OLD)


async def test_cancelling_empties_a_boat_that_was_empty() -> None:
    async with boat(old=False) as (link, trouble):
        told = await cancelled(link)
        assert told[-1] == "cancelled, left empty (mission, fence and rally points cleared)"
        assert trouble.empty


async def test_cancelling_twice_says_that_nothing_is_known() -> None:
    async with boat() as (link, _):
        told = await cancelled(link, times=2)
        assert told[-1].startswith("cancelled, what it stores is unknown: do not start it")


@pytest.mark.parametrize("times", [1, 2])
def test_ctrl_c(times: int, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    with FleetThread(SimulatedFleet(count=2, home_lonlat=HOME, base_port=0)) as fleet:
        troubles = [Trouble(fleet, index) for index in range(2)]
        links = LinkChoice(connect=tuple(fleet.links), timeouts=QUICK)
        old = missions(2, 300, shift=-70)
        assert run_upload(old, links=links, record_folder=tmp_path) == 0

        def interrupt() -> None:
            os.kill(os.getpid(), signal.SIGINT)
            if times > 1:
                troubles[0].at(MissionType.FENCE, 2, interrupt_again)

        def interrupt_again() -> None:
            os.kill(os.getpid(), signal.SIGINT)

        troubles[0].at(MissionType.MISSION, 100, interrupt)
        with pytest.raises(KeyboardInterrupt):
            run_upload(missions(2, 600), links=links, record_folder=tmp_path)
        err = capsys.readouterr().err
        assert err.count("interrupted: vehicles get back what they held") == 1
        states = [record.state for record in read_record(tmp_path)]
        if times == 1:
            assert err.count("cancelled, old mission restored") == 2
            assert all(t.holds(o) for t, o in zip(troubles, old, strict=True))
            assert states == [RecordState.FAILED] * 2
        else:
            assert "robot 1 (system id 1): cancelled, what it stores is unknown" in err
            assert states[0] is RecordState.UNFINISHED
            assert err.count("cancelled, ") == 2


@pytest.mark.parametrize("kind", [MissionType.FENCE, MissionType.MISSION])
async def test_a_boat_that_is_armed_on_the_way_gets_no_mission(kind: MissionType) -> None:
    async with boat() as (link, trouble):
        trouble.at(kind, 2, trouble.arm)
        trouble.at(MissionType.RALLY, 0, trouble.arm)
        if kind is MissionType.MISSION:
            trouble.refuse(of_the_new)
        row = await upload(link)
        assert row.status is UploadStatus.REFUSED
        assert row.holds is Holds.EMPTY
        assert trouble.empty


async def test_a_journal_that_cannot_be_written_stops_before_the_first_byte(
    tmp_path: Path,
) -> None:
    async with boat() as (link, trouble):
        (tmp_path / "saved").write_text("a file where a folder should be")
        seen = trouble.items_seen
        row = await upload(link, tmp_path)
        assert (row.status, row.holds) == (UploadStatus.FAILED, Holds.UNTOUCHED)
        assert "saved" in row.detail
        assert trouble.items_seen == seen
        assert trouble.holds(OLD)


async def test_twenty_percent_loss_ends_well_or_clean() -> None:
    faults = Faults(loss=0.2, duplicate=0.05, reorder=0.05, seed=11)
    old, new = missions(3, 8, shift=-70), missions(3, 10)
    async with SimulatedFleet(count=3, home_lonlat=HOME, base_port=0) as fleet:
        troubles = [Trouble(fleet, index) for index in range(3)]
        await upload_fleet(old, fleet.links, timeouts=QUICK)
        for server in fleet._servers:
            server.faults = faults
        patient = replace(QUICK, link=replace(QUICK.link, silence_s=10.0))
        rows = await upload_fleet(new, fleet.links, timeouts=patient)
        for row, trouble, before, after in zip(rows, troubles, old, new, strict=True):
            truth = {
                Holds.PLAN: trouble.holds(after),
                Holds.RESTORED: trouble.holds(before),
                Holds.UNTOUCHED: trouble.holds(before),
                Holds.EMPTY: trouble.empty,
                Holds.UNKNOWN: False,
                Holds.NOBODY: trouble.holds(before),
            }
            assert truth[row.holds], row
        assert sum(row.verified for row in rows) >= 2


# --- where it lies -------------------------------------------------------------------------------


async def test_a_boat_on_another_lake_gets_nothing() -> None:
    far = (HOME[0] + 0.03, HOME[1])
    async with boat(old=False, starts_lonlat=[far]) as (link, trouble):
        row = await upload(link)
        assert (row.status, row.holds) == (UploadStatus.REFUSED, Holds.UNTOUCHED)
        assert "lies 2.3 km from its mission's home, more than --max-distance 1000 m" in row.detail
        assert trouble.items_seen == 0
        row = await upload(link, max_distance_m=5000.0)
        assert row.status is UploadStatus.VERIFIED
        assert row.detail == "lies 2.3 km from its mission's home"


@pytest.mark.parametrize("client", ["pymavlink", "mavsdk"])
async def test_a_boat_off_its_berth_is_remarked_on(client: str) -> None:
    off = (HOME[0] + 0.001, HOME[1])
    async with boat(old=False, starts_lonlat=[off]) as (link, _):
        row = await upload(link, client=client)
        assert (row.status, row.detail) == (
            UploadStatus.VERIFIED,
            "lies 68 m from its mission's home",
        )


async def test_no_position_is_remarked_on(monkeypatch: pytest.MonkeyPatch) -> None:
    from mrmission.simulate import telemetry

    monkeypatch.delitem(telemetry.BUILDERS, 33)
    async with boat(old=False) as (link, _):
        row = await upload(link)
        assert row.verified
        assert row.detail == "no position, so not compared with its mission's home"


def test_saved_json_where_no_plan_can_say_it(tmp_path: Path) -> None:
    from mrmission.vehicle.items import RawItem, to_raw
    from mrmission.vehicle.saved import save_contents

    contents = to_raw(OLD)
    circle = RawItem(seq=6, frame=0, command=5004, param1=25.0, x=4, y=5, mission_type=1)
    kind = MissionType.FENCE
    with_circle = {**contents, kind: (*contents[kind], circle)}
    path = save_contents(tmp_path, 3, with_circle, "boat")
    document = json.loads(path.read_text())
    assert document["geoFence"]["circles"] == [
        {"circle": {"center": [4e-7, 5e-7], "radius": 25.0}, "inclusion": False, "version": 1}
    ]
    odd = {**contents, kind: (replace(circle, command=5999),)}
    path = save_contents(tmp_path, 3, odd, "boat")
    assert path.name == "vehicle-3-1.json"
    assert json.loads(path.read_text())["fence"][0]["command"] == 5999


# --- the same against light boats and ArduRover ------------------------------------------------


async def test_every_engine_may_reboot_in_mid_transfer(
    engine: Engine, monkeypatch: pytest.MonkeyPatch
) -> None:
    rebooted: list[int] = []
    send = Vehicle.upload

    async def upload_and_reboot(
        self: Vehicle,
        kind: MissionType,
        items: Sequence[RawItem],
        progress: Callable[[float], None] | None = None,
    ) -> None:
        def watch(fraction: float) -> None:
            if kind is MissionType.MISSION and fraction > 0.3 and not rebooted:
                rebooted.append(round(fraction * len(items)))
                self.send(
                    self.mav.MAVLink_command_long_message(
                        self.system_id, 1, self.mav.MAV_CMD_PREFLIGHT_REBOOT_SHUTDOWN, 0,
                        1, 0, 0, 0, 0, 0, 0,
                    )
                )  # fmt: skip
            if progress is not None:
                progress(fraction)

        await send(self, kind, items, watch)

    monkeypatch.setattr(Vehicle, "upload", upload_and_reboot)
    async with engine.fleet(count=1) as fleet:
        patient = UploadTimeouts(link=LinkTimeouts(discovery_s=10.0))
        (row,) = await upload_fleet([mission(1, 200)], fleet.links, timeouts=patient)
        assert rebooted
        assert row.verified, row
        again = await upload_fleet([mission(1, 200)], fleet.links, timeouts=patient)
        assert [r.status for r in again] == [UploadStatus.UNCHANGED]

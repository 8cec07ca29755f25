"""Rehearsals from arming to the report: light boats at once, ArduRover where it is installed."""

from __future__ import annotations

import asyncio
import json
from pathlib import Path

import pytest
import shapely
from lakes import area_of, geojson_of

from mrmission.cli.main import run
from mrmission.errors import SimulatorError
from mrmission.model import Mission
from mrmission.options import PlanOptions
from mrmission.pipeline import plan as plan_fleet
from mrmission.rehearse.judge import Limits, judge
from mrmission.rehearse.pilot import SailOrders, sail
from mrmission.rehearse.run import Waters, make_fleet, sail_missions, sailing_missions
from mrmission.simulate import SimulatedFleet
from mrmission.vehicle.client import open_links
from mrmission.vehicle.connection import parse_connections
from mrmission.vehicle.links import LinkTimeouts
from mrmission.vehicle.upload import upload_fleet

LAKE = shapely.Polygon(
    [(0, 0), (150, 0), (160, 90), (80, 120), (0, 100)], [[(70, 50), (95, 55), (85, 70)]]
)


@pytest.fixture(scope="module")
def plan():
    options = PlanOptions(
        robots=2, swath_m=15.0, clearance_m=8.0, method="minmax", time_budget_s=0.2
    )
    return plan_fleet(area_of(LAKE, lon_deg=8.5, lat_deg=47.3), options)


def rehearsed(plan, waters: Waters, orders: SailOrders | None = None, limits: Limits | None = None):
    """Sail a plan and judge it."""
    tracks = asyncio.run(sail_missions(sailing_missions(plan.missions), waters, orders))
    delays = {row.robot: row.start_delay_s for row in plan.report.robots}
    found = judge(plan, tracks, limits=limits or Limits(cross_track_m=1.5), delays_s=delays)
    return tracks, found


def check(plan, tracks, driven) -> None:
    """What every good voyage shows, whoever sailed it."""
    assert driven.violations == ()
    assert driven.fence_events == 0
    for track, row, report in zip(tracks, driven.robots, plan.report.robots, strict=True):
        assert track.end_text == "home"
        assert row.home_m < 4.0
        assert row.fence_room_m > 0
        assert row.driven_s == pytest.approx(report.duration_s, rel=0.2)
        assert row.driven_m == pytest.approx(report.length_m, rel=0.1)
        # every waypoint was reached, in order; the one at home as the mission starts
        seqs = track.reached[:, 1]
        assert (seqs[1:] > seqs[:-1]).all()
        wanted = {i.seq for i in plan.missions[track.robot - 1].items if i.command == 16}
        assert wanted - {0, 1} <= set(seqs.astype(int).tolist())
        # samples lie close enough for what is measured with them
        way = track.under_way()
        assert (track.time_s[way][1:] - track.time_s[way][:-1]).max() < 1.0


def test_light_boats_sail_a_plan(plan) -> None:
    tracks, driven = rehearsed(plan, Waters(speedup=80.0), SailOrders(watch_end_s=30.0))
    check(plan, tracks, driven)
    assert all(row.watched_s >= 30 for row in driven.robots)
    assert all(row.watched_m < 5 for row in driven.robots)


@pytest.mark.ardupilot
def test_ardurover_sails_a_plan_in_waves_and_current(plan) -> None:
    waters = Waters(engine="ardupilot", speedup=10.0, waves=True, current_m_s=0.3)
    tracks, driven = rehearsed(plan, waters, SailOrders(watch_end_s=60.0))
    check(plan, tracks, driven)
    # SITL tells the truth, and what the boat believes is close to it
    assert all(row.estimate_m < 0.2 for row in driven.robots)
    assert all(row.watched_s >= 60 for row in driven.robots)


def test_a_boat_without_its_mission_is_given_up(plan) -> None:
    """A vehicle that cannot start is said to be so, with what it says itself."""
    (mission, *_) = sailing_missions(plan.missions)

    async def attempt() -> None:
        async with make_fleet([mission], Waters(speedup=50.0)) as fleet, open_links(
            parse_connections(fleet.links), expected=1, timeouts=LinkTimeouts()
        ) as links:  # fmt: skip
            await sail(links.vehicles[1], mission, SailOrders(ready_s=60.0))

    with pytest.raises(SimulatorError, match=r"robot 1, vehicle 1: .* within 60 s of its clock"):
        asyncio.run(attempt())


def test_a_boat_that_leaves_auto_is_not_home(plan) -> None:
    """Somebody switches to HOLD in mid-mission: the track ends there, and says why."""
    (mission, *_) = sailing_missions(plan.missions)

    async def attempt():
        async with make_fleet([mission], Waters(speedup=20.0)) as fleet:
            rows = await upload_fleet([mission], fleet.links)
            assert rows[0].verified
            async with open_links(
                parse_connections(fleet.links), expected=1, timeouts=LinkTimeouts()
            ) as links:
                boat = links.vehicles[1]
                voyage = asyncio.create_task(sail(boat, mission, SailOrders()))
                while boat.mode != "AUTO":
                    await asyncio.sleep(0.05)
                await asyncio.sleep(0.5)
                await boat.command(176, 1, 4)
                return await voyage

    track = asyncio.run(attempt())
    assert not track.home
    assert track.end_text == "left AUTO for mode 4"


def test_the_command(plan, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """From the file to the files; outside a limit the exit code is 1."""
    area = tmp_path / "lake.geojson"
    area.write_text(geojson_of(area_of(LAKE, lon_deg=8.5, lat_deg=47.3)))
    out = tmp_path / "out"
    command = [
        "rehearse", str(area), "--k", "1", "--swath", "30", "--clearance", "15",
        "--method", "minmax", "--time-budget", "0.1", "--speedup", "80", "--out", str(out),
        "--min-coverage", "1.01", "--json",
    ]  # fmt: skip
    assert run(command) == 1
    said = capsys.readouterr()
    driven = json.loads(said.out)
    assert driven == json.loads((out / "rehearse.json").read_text())
    assert len(driven["violations"]) == 1
    assert "outside the limits: " in said.err
    assert driven["coverage"]["share"] > 0.99
    assert (out / "tracks.csv").read_text().startswith("robot,time_s,")
    assert run(command) == 2  # never over an earlier one
    assert "holds a rehearsal already" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("flags", "complaint"),
    [
        (["--vehicle", "copter"], "a rehearsal sails boats and rovers"),
        (["--waves"], "--engine light: has one model and no waves"),
        (["--watch-end", "long"], "--watch-end long: must be a duration"),
        (["--speedup", "0"], "--speedup 0: must be above 0"),
        (["--figure", "x.bmp"], "unknown format .bmp"),
    ],
)
def test_wrong_options(tmp_path: Path, capsys, flags: list[str], complaint: str) -> None:
    area = tmp_path / "lake.geojson"
    area.write_text(geojson_of(area_of(LAKE, lon_deg=8.5, lat_deg=47.3)))
    assert run(["rehearse", str(area), "--out", str(tmp_path / "o"), *flags]) == 2
    assert complaint in capsys.readouterr().err


def test_no_connection_from_outside_can_be_given() -> None:
    """What is armed has been started here: there is no way to name another vehicle."""
    from mrmission.cli.rehearse import rehearse

    assert not {"connect", "link"} & {parameter.name for parameter in rehearse.params}
    fleet = make_fleet(
        [Mission(robot=1, sortie=1, vehicle="boat", items=PLACE, fence=(), rally=())], Waters()
    )
    assert isinstance(fleet, SimulatedFleet)


def _place():
    from mrmission.model import MissionItem

    return (
        MissionItem(
            seq=0, frame=0, command=16, current=1, autocontinue=1, param1=0.0, param2=0.0,
            param3=0.0, param4=0.0, x=473000000, y=85000000, z=0.0,
        ),
    )  # fmt: skip


PLACE = _place()

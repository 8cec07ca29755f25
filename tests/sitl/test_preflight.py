"""`preflight` over real links: light boats, and ArduRover where there is one.

With the parameters of ``sitl/`` and the plan stored, a fleet is ready; a changed parameter turns
its row; with ArduPilot's own defaults it says what would go wrong.
"""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest
import shapely
from fleets import Engine, ardupilot

from mrmission.cli.main import run
from mrmission.cli.preflight import exit_code, read_report
from mrmission.cli.upload_plan import read_missions
from mrmission.model import Mission, SurveyArea
from mrmission.options import PlanOptions
from mrmission.pipeline import plan
from mrmission.results import write_results
from mrmission.simulate import FleetThread, SimulatedFleet
from mrmission.vehicle.client import open_links
from mrmission.vehicle.connection import parse_connections
from mrmission.vehicle.links import LinkTimeouts
from mrmission.vehicle.preflight import VehicleCheck, preflight_fleet
from mrmission.vehicle.rows import UploadTimeouts
from mrmission.vehicle.upload import upload_fleet

SHORE = [(8.5, 47.3), (8.508, 47.3), (8.508, 47.304), (8.5, 47.304)]
ISLAND = [(8.5025, 47.3005), (8.504, 47.3005), (8.504, 47.3035), (8.5025, 47.3035)]
STOCK = {
    # ArduPilot's own, where sitl/*.parm has other values
    "AVOID_ENABLE": 3, "FENCE_ACTION": 1, "FENCE_ENABLE": 0, "FENCE_RADIUS": 300, "FENCE_TYPE": 6,
    "FS_THR_ENABLE": 1, "FS_ACTION": 2, "MIS_DONE_BEHAVE": 1, "WP_RADIUS": 2, "OA_TYPE": 0,
}  # fmt: skip
"""Without INITIAL_MODE: from MANUAL, a boat of the test could not be made ready."""


@pytest.fixture(scope="module")
def survey(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with the plan of two boats round an island."""
    water = shapely.MultiPolygon([shapely.Polygon(SHORE, [ISLAND])])
    area = SurveyArea(name="ring", source="ring", water_lonlat=water)
    folder = tmp_path_factory.mktemp("survey")
    write_results(
        plan(area, PlanOptions(robots=2, swath_m=40.0, clearance_m=2.5)), folder, overwrite=False
    )
    return folder


def starts(missions: list[Mission]) -> list[tuple[float, float]]:
    return [(m.items[0].y / 1e7, m.items[0].x / 1e7) for m in missions]


async def checked(folder: Path, links: list[str]) -> list[VehicleCheck]:
    """Check as many robots as there are links."""
    missions = read_missions(folder, named="")[: len(links)]
    return await preflight_fleet(missions, links, report=read_report(folder))


def wrong(check: VehicleCheck) -> set[str]:
    return {row.subject for row in check.rows if row.severity == "wrong"}


def worst(folder: Path) -> int:
    """The index of the robot with the most straight returns over land."""
    report = read_report(folder) or {}
    shares = [row["share_over_land"] for row in report["failsafe"]["straight_returns"]]
    assert max(shares) > 0.1
    return shares.index(max(shares))


async def set_parameters(link: str, system_id: int, values: dict[str, float]) -> None:
    async with open_links(parse_connections([link]), expected=1, timeouts=LinkTimeouts()) as opened:
        for name, value in values.items():
            await opened.vehicles[system_id].set_parameter(name, value)


async def test_a_fleet_with_the_plan_is_ready_and_a_changed_parameter_is_found(
    engine: Engine, survey: Path
) -> None:
    missions = read_missions(survey, named="")
    async with engine.fleet(count=2, starts_lonlat=starts(missions)) as fleet:
        before = await checked(survey, fleet.links)
        stores = {"stored mission", "stored fence", "stored rally points"}
        assert [wrong(check) for check in before] == [stores, stores]

        rows = await upload_fleet(missions, fleet.links)
        assert all(row.verified for row in rows)
        ready = await checked(survey, fleet.links)
        assert [wrong(check) for check in ready] == [set(), set()]
        assert exit_code(ready) == 0

        changed = {"AVOID_ENABLE": 3.0, "FENCE_ACTION": 1.0, "WP_RADIUS": 15.0}
        one = worst(survey)
        await set_parameters(fleet.links[one], fleet.system_ids[one], changed)
        after = await checked(survey, fleet.links)
        assert wrong(after[one]) == set(changed)
        assert wrong(after[1 - one]) == set()
        assert exit_code(after) == 1
        # and it was looked at, not touched
        again = await upload_fleet(missions, fleet.links)
        assert {str(row.status) for row in again} == {"already stored"}


async def test_a_vehicle_that_is_missing_has_a_row_that_says_so(survey: Path) -> None:
    missions = read_missions(survey, named="")
    quick = UploadTimeouts(link=LinkTimeouts(discovery_s=1.0, retry_probe_s=0.0))
    boats = SimulatedFleet(count=1, starts_lonlat=starts(missions)[1:], base_port=0)
    async with boats as fleet:
        links = [*fleet.links, "tcpout://127.0.0.1:9"]
        checks = await preflight_fleet(missions, links, assignment={2: 1}, timeouts=quick)
    assert [check.system_id for check in checks] == [None, 1]
    (row,) = checks[0].rows
    assert (row.subject, row.severity) == ("link", "wrong")
    assert "127.0.0.1:9 connection refused" in row.reason
    assert len(checks[1].rows) > 20


async def test_a_boat_at_the_wrong_place_is_found(engine: Engine, survey: Path) -> None:
    missions = read_missions(survey, named="")
    lon, lat = starts(missions)[0]
    async with engine.fleet(count=1, starts_lonlat=[(lon + 0.02, lat)]) as fleet:
        (check,) = await checked(survey, fleet.links)
        assert {"position", "home"} <= wrong(check)
        found = {row.subject: row for row in check.rows}
        assert found["position"].found.endswith("outside the fence")


@pytest.mark.ardupilot
async def test_an_ardurover_with_stock_parameters_is_not_ready(survey: Path) -> None:
    mission = read_missions(survey, named="")[worst(survey)]
    stock = {name: float(value) for name, value in STOCK.items()}

    async def look(links: list[str]) -> VehicleCheck:
        (check,) = await preflight_fleet([mission], links, report=read_report(survey))
        return check

    async with ardupilot(starts_lonlat=starts([mission]), parameters=stock) as fleet:
        assert (await upload_fleet([mission], fleet.links))[0].verified
        check = await look(fleet.links)
        assert wrong(check) == {"AVOID_ENABLE", "FENCE_ACTION", "FENCE_ENABLE", "FS_THR_ENABLE"}
        # the circle counts once the fence is on
        await set_parameters(fleet.links[0], fleet.system_ids[0], {"FENCE_ENABLE": 1.0})
        check = await look(fleet.links)
        assert wrong(check) == {"AVOID_ENABLE", "FENCE_ACTION", "FENCE_RADIUS", "FS_THR_ENABLE"}
        unknown = {row.subject for row in check.rows if row.found == "not known to the vehicle"}
        assert unknown <= {"FENCE_OPTIONS"}


def test_the_command(survey: Path, capsys: pytest.CaptureFixture[str]) -> None:
    missions = read_missions(survey, named="")
    boats = SimulatedFleet(count=2, starts_lonlat=starts(missions), base_port=0)
    with FleetThread(boats) as fleet:
        flags = [part for link in fleet.links for part in ("--connect", link)]
        code, document = command(survey, flags, capsys)
        assert code == 1
        assert document["ready"] is False
        wrong_rows = {
            row["subject"]: row
            for row in document["robots"][0]["rows"]
            if row["severity"] == "wrong"
        }
        assert {"FENCE_ENABLE", "AVOID_ENABLE", "FS_THR_ENABLE"} <= set(wrong_rows)
        assert wrong_rows["AVOID_ENABLE"]["found"] == "3"
        assert wrong_rows["AVOID_ENABLE"]["wanted"] == "0"
        assert run(["preflight", "--from", str(survey), *flags]) == 1
        out, err = capsys.readouterr()
        assert "FS_THR_ENABLE" in out
        assert "nothing was written" in err
    assert run(["preflight", str(survey), *flags]) == 5
    assert "no vehicle" in capsys.readouterr().err


def command(
    folder: Path, flags: list[str], capsys: pytest.CaptureFixture[str]
) -> tuple[int, dict[str, Any]]:
    code = run(["preflight", str(folder), *flags, "--json"])
    document: dict[str, Any] = json.loads(capsys.readouterr().out)
    return code, document


@pytest.mark.parametrize(
    ("arguments", "says"),
    [
        ([], "DIR is missing"),
        (["no-such-folder"], "no-such-folder"),
        (["a", "--from", "b"], "choose one"),
        (["a", "--client", "mavsdk"], "MAVSDK"),
    ],
)
def test_wrong_arguments(
    arguments: list[str], says: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert run(["preflight", *arguments]) in (2, 3)
    assert says in capsys.readouterr().err

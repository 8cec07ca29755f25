"""``mrmission upload AREA`` with vehicles: asked first, planned for what they hold, kept."""

from __future__ import annotations

import json
import socket
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import numpy as np
import pytest
from boat_faults import Trouble
from lakes import area_of, geojson_of, random_lake_m

from mrmission.cli.main import run
from mrmission.options import VehicleLimits
from mrmission.simulate import SimulatedFleet
from mrmission.simulate.fleet import FleetThread

FLAGS = ("--k", "2", "--swath", "30", "--clearance", "5", "--start", "8.4,53.1")


@pytest.fixture
def lake(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> str:
    monkeypatch.chdir(tmp_path)
    water = random_lake_m(np.random.default_rng(4), 300.0, 2)
    (tmp_path / "pond.geojson").write_text(geojson_of(area_of(water)))
    return "pond.geojson"


@contextmanager
def boats(**options: object) -> Iterator[tuple[SimulatedFleet, list[str]]]:
    fleet = SimulatedFleet(count=2, home_lonlat=(8.4, 53.1), base_port=0, **options)  # type: ignore[arg-type]
    with FleetThread(fleet):
        yield fleet, [word for link in fleet.links for word in ("--connect", link)]


def limits(folder: str) -> dict[str, int]:
    limits: dict[str, int] = json.loads(Path(folder, "report.json").read_text())["options"][
        "limits"
    ]
    return limits


def test_the_plan_is_fitted_to_the_smallest_boat(
    lake: str, capsys: pytest.CaptureFixture[str]
) -> None:
    with boats() as (fleet, links):
        # An old board of 8 KB.
        fleet.vehicles[1].fence._size_bytes = 160
        assert run(["upload", lake, *FLAGS, *links, "--out", "out", "--json"]) == 0
        out, err = capsys.readouterr()
        for words in ("655 mission items", "155 fence bytes (vehicle 2)", "50 rally points"):
            assert words in err
        rows = json.loads(out)["robots"]
        assert [row["limits"]["fence_bytes"] for row in rows] == [
            {"value": 667, "source": "vehicle 1"},
            {"value": 155, "source": "vehicle 2"},
        ]
        assert all(row["fence_items"] * 8 + 2 <= 155 for row in rows)
        assert limits("out")["fence_bytes"] == 155
        notes = json.loads(Path("out/report.json").read_text())["notes"]
        assert any("155 fence bytes (vehicle 2)" in note for note in notes)
        # The same command later, with another boat in place of the small one: the same plan.
        fleet.vehicles[1].fence._size_bytes = 672
        assert run(["upload", lake, *FLAGS, *links, "--out", "out"]) == 0
        assert capsys.readouterr().out.count("already stored") == 2
        assert run(["status", "out"]) == 0


def test_a_user_may_ask_for_less_and_never_for_more(
    lake: str, capsys: pytest.CaptureFixture[str]
) -> None:
    with boats() as (_, links):
        less = ["--fence-bytes", "120", "--max-items", "9000", "--out", "less"]
        assert run(["upload", lake, *FLAGS, *links, *less]) == 0
        err = capsys.readouterr().err
        assert "120 fence bytes (--fence-bytes)" in err
        assert "655 mission items" in err
        assert limits("less")["mission_items"] == VehicleLimits().mission_items
        assert limits("less")["fence_bytes"] == 120


def test_what_a_boat_cannot_hold_at_once_is_cut_into_sorties(
    lake: str, capsys: pytest.CaptureFixture[str]
) -> None:
    with boats() as (fleet, links):
        fleet.vehicles[0].mission._capacity = 20
        assert run(["upload", lake, *FLAGS, *links, "--out", "out"]) == 0
        out, err = capsys.readouterr()
        assert "20 mission items (vehicle 1)" in err
        assert "sortie 1 of" in out
        report = json.loads(Path("out/report.json").read_text())["robots"]
        assert all(trip["items"] <= 20 for row in report for trip in row["sorties"])
        most = max(len(row["sorties"]) for row in report)
        assert most > 1
        assert run(["status", "out"]) == 0
        capsys.readouterr()
        # the next trip, for those that have one; the others keep what they have
        assert run(["upload", "--from", "out", *links, "--sortie", "2", "--json"]) == 0
        rows = json.loads(capsys.readouterr().out)["robots"]
        assert {row["sortie"] for row in rows} == {2}
        assert [row["robot"] for row in rows] == [
            row["robot"] for row in report if len(row["sorties"]) > 1
        ]
        record = json.loads(Path("out/fleet.json").read_text())["vehicles"]
        assert max(entry["sortie"] for entry in record) == 2
        assert run(["status", "out"]) == 0
        assert run(["upload", "--from", "out", *links, "--sortie", str(most + 1)]) == 2
        assert "no robot goes out so often" in capsys.readouterr().err


def test_too_little_room_is_refused_before_anything_is_sent(
    lake: str, capsys: pytest.CaptureFixture[str]
) -> None:
    with boats() as (fleet, links):
        troubles = [Trouble(fleet, index) for index in range(2)]
        fleet.vehicles[0].mission._capacity = 8
        assert run(["upload", lake, *FLAGS, *links]) == 4
        assert "mission items there and back, and all must fit into 8" in capsys.readouterr().err
        assert not any(trouble.items_seen for trouble in troubles)


def test_nobody_is_planned_for_when_nobody_answers(
    lake: str, capsys: pytest.CaptureFixture[str]
) -> None:
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        port = probe.getsockname()[1]
    assert run(["upload", lake, *FLAGS, "--connect", f"tcp:127.0.0.1:{port}", "--out", "out"]) == 5
    err = capsys.readouterr().err
    assert "no vehicle answers" in err
    assert "assumed" not in err
    assert not Path("out").exists()


def test_boats_on_another_lake_get_nothing(lake: str, capsys: pytest.CaptureFixture[str]) -> None:
    far = [(14.0, 60.0), (14.001, 60.0)]
    fleet = SimulatedFleet(count=2, starts_lonlat=far, base_port=0)
    with FleetThread(fleet):
        links = [word for link in fleet.links for word in ("--connect", link)]
        assert run(["upload", lake, *FLAGS, *links]) == 5
        out = " ".join(capsys.readouterr().out.split())
        assert out.count("more than --max-distance 1000 m: is another lake meant") == 2
        assert out.count("vehicle untouched") == 2


def test_simulated_boats_leave_no_record(lake: str) -> None:
    assert run(["upload", lake, *FLAGS, "--simulate", "--out", "out"]) == 0
    assert not Path("out/fleet.json").exists()
    assert not Path("out/saved").exists()
    assert Path("out/robot-2.plan").exists()


def test_keys(lake: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    key = tmp_path / "key"
    key.write_text("\n")
    command = ["upload", lake, *FLAGS, "--connect", "tcp:127.0.0.1:1", "--sign-key-file"]
    assert run([*command, str(key)]) == 3
    assert "is empty" in capsys.readouterr().err
    assert run([*command, str(tmp_path / "none")]) == 3
    key.write_text("open sesame\n")
    assert run([*command, str(key), "--client", "mavsdk"]) == 2
    assert "MAVSDK cannot sign" in capsys.readouterr().err

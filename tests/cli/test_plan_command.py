"""``mrmission plan`` as a script and a person meet it: files, streams, exit codes."""

from __future__ import annotations

import json
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import shapely
from lakes import area_of, geojson_of, random_lake_m

from mrmission.cli.main import COMMANDS, run

FILES = ["lines.csv", "map.html", "report.json", "tours.geojson", "tours.kml"]


@pytest.fixture
def lake(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    path = tmp_path / "pond.geojson"
    water = random_lake_m(np.random.default_rng(4), 300.0, 2)
    path.write_text(geojson_of(area_of(water)))
    return path


def plan(lake: Path, *flags: str) -> int:
    return run(["plan", str(lake), "--swath", "30", "--clearance", "5", *flags])


def names(folder: Path) -> list[str]:
    return sorted(p.name for p in folder.iterdir())


def mission_files(k: int) -> list[str]:
    return [f"robot-{r}.{kind}" for r in range(1, k + 1) for kind in ("plan", "waypoints")]


def test_files_are_those_of_the_contract(lake: Path, capsys) -> None:
    assert plan(lake, "--k", "3", "--out", "out") == 0
    assert names(Path("out")) == sorted(FILES + mission_files(3))
    report = json.loads(Path("out/report.json").read_text())
    for key in (
        "makespan_s", "lower_bound_s", "gap", "utilization", "coverage", "area_m2",
        "navigable_m2", "unreached_m2", "options", "versions", "seed",
    ):  # fmt: skip
        assert key in report
    assert [r["robot"] for r in report["robots"]] == [1, 2, 3]
    for row in report["robots"]:
        assert {"length_m", "survey_m", "transit_m", "duration_s", "items"} <= set(row)
        assert row["survey_m"] + row["transit_m"] == pytest.approx(row["length_m"])
    for number in (1, 2, 3):
        document = json.loads(Path(f"out/robot-{number}.plan").read_text())
        assert document["fileType"] == "Plan"
        text = Path(f"out/robot-{number}.waypoints").read_text()
        assert text.startswith("QGC WPL 110")
    out, err = capsys.readouterr()
    assert "robot" in out  # the table is data
    assert "note:" not in out
    assert "files in out" in err


def test_the_default_folder_is_named_after_the_area(lake: Path) -> None:
    assert plan(lake) == 0
    assert (lake.parent / "pond-plan" / "robot-1.plan").is_file()


def test_json_on_stdout_is_the_report(lake: Path, capsys) -> None:
    assert plan(lake, "--k", "2", "--out", "out", "--json") == 0
    out, _ = capsys.readouterr()
    assert out == Path("out/report.json").read_text()
    assert json.loads(out)["options"]["robots"] == 2


def test_a_plan_is_not_overwritten_and_stale_robots_go(lake: Path, capsys) -> None:
    assert plan(lake, "--k", "4", "--out", "out") == 0
    Path("out/my-notes.txt").write_text("keep me")
    Path("out/robot-4-sortie-2.plan").write_text("{}")
    before = {p.name: p.read_bytes() for p in Path("out").iterdir()}
    capsys.readouterr()
    assert plan(lake, "--k", "2", "--out", "out") == 2
    out, err = capsys.readouterr()
    assert out == ""
    assert "--overwrite" in err
    assert err.count("\n") == 1
    assert {p.name: p.read_bytes() for p in Path("out").iterdir()} == before
    assert plan(lake, "--k", "2", "--out", "out", "--overwrite") == 0
    assert names(Path("out")) == sorted([*FILES, *mission_files(2), "my-notes.txt"])


def test_an_image_leaves_the_area_it_was_understood_as(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    from PIL import Image

    monkeypatch.chdir(tmp_path)
    free = np.zeros((60, 80), dtype=np.uint8)
    free[5:55, 5:75] = 255
    free[20:30, 30:45] = 0
    Image.fromarray(free).save("room.png")
    flags = ["--swath", "12", "--clearance", "0", "--out", "out"]
    image = ["room.png", "--resolution", "1", "--origin", "8,53"]
    assert run(["plan", *image, *flags]) == 0
    exported = shapely.from_geojson(Path("out/area.geojson").read_text())
    assert shapely.get_parts(exported).size >= 1
    assert "area.geojson" in names(Path("out"))
    # what another plan leaves in the same folder must not speak of yesterday's image
    water = random_lake_m(np.random.default_rng(4), 200.0, 0)
    Path("pond.geojson").write_text(geojson_of(area_of(water)))
    assert run(["plan", "pond.geojson", *flags, "--overwrite"]) == 0
    assert "area.geojson" not in names(Path("out"))


def test_the_area_itself_is_never_removed(lake: Path) -> None:
    folder = lake.parent / "work"
    folder.mkdir()
    area = lake.rename(folder / "area.geojson")
    content = area.read_bytes()
    for _ in range(2):
        assert plan(area, "--out", str(folder), "--overwrite") == 0
        assert area.read_bytes() == content


@pytest.mark.parametrize(
    ("flags", "code", "word"),
    [
        (["--k", "0"], 2, "--k 0"),
        (["--k", "three"], 2, "three"),
        (["--swath", "nan"], 2, "--swath"),
        (["--swath", "-3"], 2, "--swath"),
        (["--overlap", "1"], 2, "--overlap"),
        (["--overlap", "100%"], 2, "--overlap"),
        (["--overlap", "much"], 2, "is not a share"),
        (["--clearance", "-1"], 2, "--clearance"),
        (["--angle", "inf"], 2, "--angle"),
        (["--start", "8.4"], 2, "--start"),
        (["--start", "nan,53"], 2, "--start"),
        (["--start", "8.4,53.1", "--start", "8.4,53.1", "--k", "3"], 2, "--start"),
        (["--method", "magic"], 2, "magic"),
        (["--vehicle", "train"], 2, "train"),
        (["--max-items", "1"], 2, "--max-items"),
        (["--resolution", "1"], 2, "--resolution"),
        (["--frobnicate"], 2, "--frobnicate"),
        (["--part", "7"], 3, "part"),
        (["--start", "9.4,53.1"], 3, "start"),
        (["--clearance", "500"], 3, "--clearance"),
        (["--fence-bytes", "26", "--k", "6"], 0, ""),
    ],
)
def test_exit_codes_and_one_line(lake: Path, capsys, flags, code, word) -> None:
    assert plan(lake, "--out", "out", *flags) == code
    out, err = capsys.readouterr()
    if code:
        assert out == ""
        assert word in err
        assert "Traceback" not in err
        assert "this is a bug" not in err
        assert not Path("out").exists()


def test_no_plan_is_exit_4(lake: Path, capsys) -> None:
    # 250 boats cannot lie in a pond of two metres
    water = shapely.box(0, 0, 0.02, 0.02)
    Path("puddle.geojson").write_text(geojson_of(area_of(water)))
    code = run(["plan", "puddle.geojson", "--k", "250", "--clearance", "0", "--out", "out"])
    _, err = capsys.readouterr()
    assert code in (3, 4)
    assert err.count("\n") == 1
    assert not Path("out").exists()


def test_missing_file_is_exit_3_and_missing_argument_2(lake: Path, capsys) -> None:
    assert run(["plan", "nowhere.geojson"]) == 3
    assert "nowhere.geojson" in capsys.readouterr().err
    assert run(["plan"]) == 2
    assert run(["nonsense"]) == 2
    assert run(["plan", str(lake.parent)]) == 3
    assert not (lake.parent / "nowhere-plan").exists()


def test_out_that_cannot_be_a_folder(lake: Path, capsys) -> None:
    Path("file").write_text("x")
    assert plan(lake, "--out", "file") == 2
    assert plan(lake, "--out", "file/inside") == 2
    err = capsys.readouterr().err
    assert "this is a bug" not in err
    assert Path("file").read_text() == "x"


def test_more_items_than_a_vehicle_holds_are_trips(lake: Path, capsys) -> None:
    assert plan(lake, "--max-items", "10", "--out", "out") == 0
    assert "trips in all" in capsys.readouterr().err
    trips = sorted(Path("out").glob("robot-*-sortie-*.plan"))
    assert len(trips) > 1
    for trip in trips:
        assert len(json.loads(trip.read_text())["mission"]["items"]) < 10  # and home


def test_what_was_not_given_is_in_the_report_as_assumed(lake: Path) -> None:
    assert run(["plan", str(lake), "--swath", "30", "--out", "out"]) == 0
    assumed = json.loads(Path("out/report.json").read_text())["assumed"]
    assert assumed["clearance_m"] == 10.0
    assert assumed["overlap"] == 0.1
    assert "starts_lonlat" in assumed
    assert "swath_m" not in assumed


@pytest.mark.parametrize("command", COMMANDS)
def test_help_of_each_command(command: str, capsys) -> None:
    assert run([command, "--help"]) == 0
    out, err = capsys.readouterr()
    assert out.startswith(f"Usage: mrmission {command}")
    assert err == ""


def test_help_imports_nothing_heavy() -> None:
    code = (
        "import sys\n"
        "from mrmission.cli.main import run\n"
        "assert run(['--help']) == 0\n"
        "heavy = {'numpy', 'shapely', 'numba', 'pyproj', 'rustworkx', 'mavsdk', 'pymavlink'}\n"
        "print(sorted(heavy & set(sys.modules)), file=sys.stderr)\n"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stderr.strip() == "[]"
    for command in COMMANDS:
        assert command in done.stdout


def test_upload_from_a_folder_refuses_what_it_would_ignore(lake: Path, capsys) -> None:
    assert plan(lake, "--out", "out") == 0
    capsys.readouterr()
    assert run(["upload", "--from", "out", "--simulate", "--k", "3", "--swath", "9"]) == 2
    assert "--from out and --k, --swath: the plans are made already" in capsys.readouterr().err


def test_figures_of_a_plan_that_reaches_not_all() -> None:
    from factories import make_plan

    from mrmission.report.units import fleet_figures

    partial = replace(make_plan().report, utilization=0.5)  # its pond is not reached
    whole = replace(partial, unreached_m2=0.0, unreached_parts_m2=())
    assert "Coverage of the navigable region, all legs" in dict(fleet_figures(whole))
    assert "Coverage of the reached part, all legs" in dict(fleet_figures(partial))
    assert " of " in dict(fleet_figures(partial))["Robots that survey"]


def test_a_start_of_its_own_is_where_a_robot_starts(lake: Path) -> None:
    # Close to the shore no launch circle fits; a berth would lie elsewhere.
    assert plan(lake, "--k", "1", "--clearance", "4", "--no-fence", "--out", "first") == 0
    mission = json.loads(Path("first/robot-1.plan").read_text())["mission"]
    shore = [item["params"][4:6] for item in mission["items"] if item["command"] == 16]
    for lat, lon in (shore[5], shore[-5]):
        start = ["--start", f"{lon},{lat}", "--overwrite"]
        assert plan(lake, "--k", "1", "--clearance", "4", "--no-fence", "--out", "own", *start) == 0
        row = json.loads(Path("own/report.json").read_text())["robots"][0]
        assert np.allclose(row["start_lonlat"], (lon, lat), rtol=0, atol=2e-6)

"""Plans with shore laps, tie lines and runs: complete, in the water, their lines as sailed."""

from __future__ import annotations

import json
import re
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pyproj
import pytest
import shapely
from lakes import area_of, geojson_of, measure, random_lake_m

from mrmission.cli.main import run
from mrmission.errors import ConfigError
from mrmission.model import FleetPlan, LineReport, SurveyArea
from mrmission.options import METHODS, PlanOptions
from mrmission.pipeline import plan
from mrmission.report.map_data import map_data
from mrmission.tour.tie_spec import parse_ties

BASE = PlanOptions(
    robots=3,
    swath_m=20.0,
    clearance_m=6.0,
    method="minmax",
    time_budget_s=0.02,
    angle_deg=25.0,
    separation_m=0.0,
)
KINDS = {
    "laps": replace(BASE, shore_laps=2),
    "ties": replace(BASE, tie_lines=parse_ties("6%")),
    "all": replace(BASE, shore_laps=1, tie_lines=parse_ties("90m"), run_in_m=12.0, run_out_m=4.0),
}


def lake(seed: int) -> SurveyArea:
    rng = np.random.default_rng(seed)
    return area_of(random_lake_m(rng, 330.0, 3, corners=int(rng.integers(9, 26))))


def lines_m(result: FleetPlan) -> list[tuple[LineReport, shapely.LineString]]:
    """Every line as its mission's integers have it, local frame."""
    project = pyproj.Proj(result.report.frame)
    out = []
    for mission in result.missions:
        for line in mission.lines:
            items = [
                item
                for item in mission.items[line.from_item : line.to_item + 1]
                if item.command == 16
            ]
            points = np.column_stack(
                project([i.y / 1e7 for i in items], [i.x / 1e7 for i in items])
            )
            out.append((line, shapely.LineString(points)))
    return out


@pytest.mark.parametrize(
    ("seed", "name"), [(1, "laps"), (2, "laps"), (1, "all"), (2, "all"), (1, "ties")]
)
def test_plans_are_complete_and_their_lines_are_true(seed: int, name: str) -> None:
    options = KINDS[name]
    result = plan(lake(seed), options)
    found = measure(result, result.missions, options.swath_m, options.clearance_m)
    assert found.coverage >= 0.9995
    assert found.outside_m == pytest.approx(0.0, abs=1e-6)
    assert found.closed_m == pytest.approx(0.0, abs=1e-6)
    kinds = {line.kind for line in result.report.lines}
    assert ("shore" in kinds) == (options.shore_laps > 0)
    assert ("tie" in kinds) == (options.tie_lines is not None)
    # the items of a line are where the line says it is, and as long
    rows = lines_m(result)
    assert [line for line, _ in rows] == list(result.report.lines)
    names = [line.name for line, _ in rows]
    assert len(set(names)) == len(names)
    project = pyproj.Proj(result.report.frame)
    extras = shapely.union_all([way for line, way in rows if line.kind == "extra"])
    for line, way in rows:
        ends = np.column_stack(project(*np.transpose([line.start_lonlat, line.end_lonlat])))
        assert way.distance(shapely.Point(ends[0])) < 0.02
        assert way.distance(shapely.Point(ends[1])) < 0.02
        if not way.intersects(extras):  # a detour is no part of its line
            assert line.length_m <= way.length + 0.1
        if line.kind == "lane":
            assert line.length_m == pytest.approx(np.hypot(*(ends[1] - ends[0])), abs=0.1)
    # the map shows the names
    shown = [x for r in map_data(result)["robots"] for trip in r["sorties"] for x in trip["label"]]
    assert [label.split()[-1] for label in shown] == names
    # all survey legs belong to a line
    total = sum(line.length_m for line, _ in rows)
    assert total == pytest.approx(sum(r.survey_m for r in result.report.robots), rel=2e-3)


def test_tie_lines_cross_what_the_report_says() -> None:
    result = plan(lake(3), KINDS["ties"])
    report = result.report.tie_lines
    assert report is not None
    rows = [(line, way) for line, way in lines_m(result) if line.kind != "extra"]
    # a line cut in pieces is one line; rounding moves ends by less than 5 cm
    whole: dict[str, list[shapely.LineString]] = {}
    for line, way in rows:
        whole.setdefault(re.sub(r"-\d+$", "", line.name), []).append(way)
    ties = {n: shapely.union_all(w).buffer(0.05) for n, w in whole.items() if n[0] == "T"}
    lanes = {n: shapely.union_all(w) for n, w in whole.items() if n[0] != "T"}
    hits = np.array([[t.intersects(x) for x in lanes.values()] for t in ties.values()])
    assert report.ties == len(ties)
    assert abs(report.crossings - hits.sum()) <= 2  # a lane may end on a tie line to a hair
    assert report.fewest == hits.sum(axis=1).min() >= 1
    assert report.lanes == len(lanes)
    assert abs(report.lanes_crossed - hits.any(axis=0).sum()) <= 1
    length = sum(line.length_m for line, _ in rows if line.kind == "tie")
    assert report.length_m == pytest.approx(length, rel=1e-3)
    assert report.length_m >= 0.06 * report.lanes_m


def test_coverage_does_not_count_tie_lines() -> None:
    # what the plan covers without its tie lines is as much as it says
    result = plan(lake(3), KINDS["ties"])
    rows = lines_m(result)
    ties = shapely.union_all([way for line, way in rows if line.kind == "tie"]).buffer(0.3)
    legs = []
    for path in result.paths:
        pairs = shapely.linestrings(np.stack([path.points_m[:-1], path.points_m[1:]], axis=1))
        legs.extend(leg for leg in pairs if not ties.covers(leg))
    covered = shapely.union_all(shapely.buffer(legs, BASE.swath_m / 2, quad_segs=16))
    missed = result.region_m.difference(covered).area / result.region_m.area
    assert missed <= 5e-4
    assert 1 - missed == pytest.approx(result.report.coverage, abs=2e-4)


def test_names_do_not_depend_on_robots_or_seed() -> None:
    area = lake(4)
    options = KINDS["all"]

    def places(k: int, seed: int) -> dict[str, shapely.Geometry]:
        result = plan(area, replace(options, robots=k, seed=seed))
        project = pyproj.Proj(result.report.frame)
        out: dict[str, list[tuple[float, float]]] = {}
        for line in result.report.lines:
            if line.kind == "extra":
                continue
            name = re.sub(r"-\d+$", "", line.name)
            ends = project(*np.transpose([line.start_lonlat, line.end_lonlat]))
            out.setdefault(name, []).extend(np.column_stack(ends).tolist())
        return {name: shapely.MultiPoint(points).envelope for name, points in out.items()}

    first, second = places(2, 0), places(5, 3)
    assert set(first) == set(second)
    for name, box in first.items():
        assert np.array(box.bounds) == pytest.approx(np.array(second[name].bounds), abs=0.05)


@pytest.mark.parametrize("name", ["topaz_ca"])
def test_the_score_script_finds_them_complete(
    name: str, shared_data: Path, score_script: Path, tmp_path: Path
) -> None:
    path = shared_data / "lakes" / f"{name}.geojson"
    arguments = ["plan", str(path), "--k", "3", "--swath", "40", "--method", "minmax", "--out",
                 str(tmp_path / "out"), "--time-budget", "0.02", "--shore-laps", "1", "--tie-lines",
                 "5%", "--clearance", "10"]  # fmt: skip
    assert run(arguments) == 0
    command = [sys.executable, str(score_script), str(path),
               *map(str, sorted((tmp_path / "out").glob("*.plan"))), "--swath", "40",
               "--clearance", "10", "--json"]  # fmt: skip
    score = json.loads(subprocess.run(command, check=True, capture_output=True).stdout)
    report = json.loads((tmp_path / "out" / "report.json").read_text())
    assert score["coverage"] >= 0.9995
    assert score["outside_m"] == 0
    assert score["longest_m"] == pytest.approx(
        max(r["length_m"] for r in report["robots"]), rel=1e-3
    )
    assert report["tie_lines"]["length_m"] >= 0.05 * report["tie_lines"]["lanes_m"]


@pytest.mark.parametrize(
    ("flags", "words"),
    [
        (["--shore-laps", "-1"], "--shore-laps -1"),
        (["--shore-laps", "51"], "between 0 and 50"),
        (["--tie-lines", "5"], "--tie-lines 5"),
        (["--tie-lines", "120%"], "at most 100 %"),
        (["--run-in", "-1"], "--run-in -1"),
        (["--run-out", "nan"], "--run-out nan"),
        (["--shore-laps", "1", "--method", "crc"], "give --method minmax"),
        (["--tie-lines", "100m", "--method", "fhk"], "give --method minmax"),
    ],
)
def test_bad_flags_are_refused_in_one_line(
    flags: list[str], words: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys
) -> None:
    area = tmp_path / "lake.geojson"
    area.write_text(geojson_of(lake(1)))
    monkeypatch.chdir(tmp_path)
    assert run(["plan", str(area), "--method", "minmax", *flags]) == 2
    assert words in capsys.readouterr().err
    assert not (tmp_path / "lake-plan").exists()


@pytest.mark.parametrize("method", [m for m in METHODS if m != "minmax"])
def test_planners_of_whole_cells_refuse_other_lines(method: str) -> None:
    with pytest.raises(ConfigError, match=f"--shore-laps 2 with --method {method}"):
        PlanOptions(method=method, shore_laps=2)
    with pytest.raises(ConfigError, match=f"--tie-lines 5% with --method {method}"):
        PlanOptions(method=method, tie_lines=parse_ties("5%"))
    assert PlanOptions(method=method, run_in_m=5.0).runs_m == (5.0, 0.0)
    assert PlanOptions(method=method, turnaround_m=7.0, run_out_m=0.0).runs_m == (7.0, 0.0)

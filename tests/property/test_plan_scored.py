"""Real lakes and a robot's map, planned and judged by the score script beside the checkout."""

from __future__ import annotations

import importlib.util
import json
import warnings
from pathlib import Path
from typing import Any

import pytest
import shapely

from mrmission.area.frame import LocalFrame
from mrmission.area.geojson import read_survey_area
from mrmission.area.image import read_image
from mrmission.model import SurveyArea
from mrmission.options import PlanOptions
from mrmission.pipeline import plan
from mrmission.results import write_results


@pytest.fixture(scope="module")
def scorer(score_script: Path) -> Any:
    spec = importlib.util.spec_from_file_location("score_missions", score_script)
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def scored(
    scorer: Any, survey: SurveyArea, area_path: Path, options: PlanOptions, folder: Path
) -> dict[str, float]:
    write_results(plan(survey, options), folder, overwrite=False)
    files = sorted(folder.glob("robot-*.plan"))
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        return scorer.score(
            area_path if area_path.exists() else folder / "area.geojson",
            files, options.swath_m, options.clearance_m, 50.0, 0.25,
        )  # fmt: skip


def assert_complete(score: dict[str, float], folder: Path, swath_m: float, robots: int) -> None:
    report = json.loads((folder / "report.json").read_text())
    assert score["robots"] == robots
    assert score["coverage"] >= 0.9995
    assert score["missed_m2"] <= 0.01 * swath_m**2
    assert score["outside_m"] == 0
    assert score["closed_m"] <= 1
    assert score["longest_m"] == pytest.approx(
        max(r["length_m"] for r in report["robots"]), rel=1e-4
    )
    assert report["unreached_m2"] == pytest.approx(score["unreached_m2"], rel=0.01, abs=1.0)
    assert report["coverage"] == pytest.approx(score["coverage"], abs=5e-4)


@pytest.mark.parametrize("method", ["crc", "cac"])
@pytest.mark.parametrize("name", ["topaz_ca", "lorraine_mn", "wales_ca"])
def test_lakes(name: str, method: str, shared_data: Path, scorer: Any, tmp_path: Path) -> None:
    path = shared_data / "lakes" / f"{name}.geojson"
    survey = read_survey_area(path)
    water = LocalFrame.of(survey).project(survey.water_lonlat)
    west, south, east, north = shapely.bounds(water)
    swath = float(max(east - west, north - south)) / 150
    # the clearance both ways, one with each method
    clearance = 0.0 if method == "crc" else swath / 4
    options = PlanOptions(robots=3, swath_m=swath, overlap=0, clearance_m=clearance, method=method)
    score = scored(scorer, survey, path, options, tmp_path / "out")
    assert_complete(score, tmp_path / "out", swath, 3)


@pytest.mark.parametrize("method", ["crc", "cac"])
def test_a_robot_map(method: str, shared_data: Path, scorer: Any, tmp_path: Path) -> None:
    image = shared_data / "maps" / "simple_rooms.png"
    survey = read_image(image, resolution_m=1.0, origin_lonlat=(8.0, 53.0), part=1)
    options = PlanOptions(robots=3, swath_m=5, overlap=0, clearance_m=0, method=method)
    score = scored(scorer, survey, tmp_path / "absent", options, tmp_path / "out")
    assert_complete(score, tmp_path / "out", 5.0, 3)

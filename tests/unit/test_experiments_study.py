"""The study from end to end in small: files, figures, regions, our row, driven plans."""

from __future__ import annotations

import csv
import json
from pathlib import Path

import numpy as np
import pytest
import shapely
from PIL import Image

from mrmission.experiments import figures
from mrmission.experiments import study as study_module
from mrmission.experiments.driven import drive_plan, save_map
from mrmission.experiments.lanes import lane_tours, strips_of
from mrmission.experiments.random_maps import random_map
from mrmission.experiments.readings import DEFAULTS, Planner, reading_of
from mrmission.experiments.regions import owners_of_lanes, owners_of_plan, regions_geojson
from mrmission.experiments.steps import least_costs
from mrmission.experiments.study import Effort, Study, StudyOptions
from mrmission.experiments.world import paper_world

FREE = random_map(1, 3)
WORLD = paper_world(FREE)
POND = np.ones((240, 200), dtype=bool)
POND[90:150, 80:120] = False


def test_regions_of_a_plan_hold_its_areas() -> None:
    planner = Planner(WORLD)
    readings = [*DEFAULTS, reading_of("CAC pieces=cells leftovers=neighbours")]
    for reading in readings:
        plan = planner.plan(reading, 4)
        owners = owners_of_plan(FREE, WORLD, reading, plan)
        assert ((owners == -1) == ~FREE).all()
        assert (owners[FREE] > 0).all()
        text = json.loads(regions_geojson(owners, "here"))
        assert text["type"] == "FeatureCollection"
        for feature in text["features"]:
            shape = shapely.from_geojson(json.dumps(feature["geometry"]))
            robot = feature["properties"]["robot"]
            assert shape.is_valid
            assert shape.area == feature["properties"]["area_px"] == (owners == robot).sum()


def test_a_robots_region_is_what_it_sweeps() -> None:
    """Whole cells are exact; the boundary between halves is rounded to pixels, per column."""
    planner = Planner(WORLD)
    reading = DEFAULTS[0]
    plan = planner.plan(reading, 4)
    owners = owners_of_plan(FREE, WORLD, reading, plan)
    step = WORLD.problem.step_costs(WORLD.tour)
    for robot, piece in enumerate(plan.pieces, start=1):
        halves = WORLD.tour.edge[piece][WORLD.tour.copy[piece] > 0]
        columns = sum(WORLD.decomposition.cells.width_m[cell] for cell in halves.tolist())
        assert abs((owners == robot).sum() - step[piece].sum()) <= 0.5 * columns + 1e-6


def test_strips_hold_every_pixel_once_and_lanes_cost_what_they_say() -> None:
    strips = strips_of(FREE, WORLD)
    assert strips.area.sum() == FREE.sum()
    assert len(np.unique(np.concatenate(strips.slices))) == len(WORLD.decomposition.slices)
    tours = lane_tours(strips, 3, 0.02, 0)
    assert sorted(np.concatenate(tours.entries) >> 1) == list(range(len(strips.area)))
    for entries, cost in zip(tours.entries, tours.cost, strict=True):
        exits = entries ^ 1
        expected = strips.area[entries >> 1].sum() + strips.home_cost[[entries[0], exits[-1]]].sum()
        expected += strips.end_cost[exits[:-1], entries[1:]].sum()
        assert cost == pytest.approx(expected)
    (bound,) = least_costs({"seed": 1, "number": 3, "robots": [3]})["bounds"]
    assert FREE.sum() / 3 <= bound <= tours.cost.max()
    owners = owners_of_lanes(FREE, WORLD, [e.tolist() for e in tours.entries])
    for robot, entries in enumerate(tours.entries, start=1):
        assert (owners == robot).sum() == strips.area[entries >> 1].sum()


def test_the_turn_into_the_strip_beside_is_free_as_within_a_cell() -> None:
    free = np.ones((6, 9), dtype=bool)
    strips = strips_of(free, paper_world(free))
    assert len(strips.area) == 6
    assert strips.end_cost[0, 2] == strips.end_cost[1, 3] == 0
    assert strips.end_cost[0, 4] == pytest.approx(1.0)
    assert strips.end_cost[0, 3] == pytest.approx(np.hypot(1, 8) - 1)


@pytest.fixture
def small(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> StudyOptions:
    effort = Effort(
        maps=2,
        fresh_maps=2,
        lane_maps=1,
        lane_budget_s=0.01,
        environment_budget_s=0.01,
        seconds_robots=(2,),
        driven=(),
        seconds_budget_s=0.01,
        metres_per_px=0.5,
        obstacles=(4,),
    )
    monkeypatch.setattr(study_module, "QUICK", effort)
    monkeypatch.setattr(study_module, "CELL_METHODS", ("crc",))
    monkeypatch.setattr(study_module, "READINGS", study_module.NAMES)
    monkeypatch.setattr(figures, "DPI", 50)
    monkeypatch.setattr(figures, "FORMATS", ("png",))
    maps = tmp_path / "maps"
    maps.mkdir()
    save_map(POND, maps / "small.png")
    row = {"k": [1, 2], "max_cost": [10.0, 90_000.0], "tours": [1, 2], "cells": 7}
    published = {"results": {"small.png": {"CRC": row}}}
    (maps / "published_results.json").write_text(json.dumps(published))
    return StudyOptions(out=tmp_path, maps=maps, quick=True, drive=False)


@pytest.mark.slow
def test_the_study_writes_everything_and_goes_on_where_it_stopped(
    small: StudyOptions, monkeypatch: pytest.MonkeyPatch
) -> None:
    pytest.importorskip("matplotlib")
    study = Study(small)
    study.run()
    folder = small.out / "experiments"
    names = ["table-1", "table-2", "table-2-fresh", "figure-4", "environment-small", "published"]
    for name in (*names, "balance", "seconds", "complexity"):
        assert (folder / f"{name}.md").read_text().startswith("## ")
        rows = list(csv.reader((folder / f"{name}.csv").read_text().splitlines()))
        assert len({len(row) for row in rows}) == 1
    for name in ("figure-4", "figure-5-small", "figure-6", "complexity"):
        with Image.open(folder / f"{name}.png") as picture:
            assert picture.width > 100
    regions = sorted(path.name for path in (folder / "regions").iterdir())
    assert regions == [f"small-{p}-4.geojson" for p in ("cac", "crc", "minmax")]
    record = json.loads((folder / "study.json").read_text())
    assert record["seed"] == 1
    assert record["versions"]["mrmission"]
    assert any("one tour of 10 is below the free area" in note for note in record["notes"])
    assert "90,000" in (folder / "environment-small.md").read_text()

    def never(job: object) -> dict[str, object]:
        raise AssertionError(job)

    # drawn once is enough: all that is left to do again is to write the tables
    monkeypatch.setattr(figures, "render", lambda _: {})
    before = {p.name: p.read_bytes() for p in folder.iterdir() if p.is_file()}
    for work in ("paper_plans", "lane_plans", "least_costs", "plan_in_seconds", "stage_times"):
        forbidden = type(never)(never.__code__, globals(), work)
        monkeypatch.setattr(study_module, work, forbidden)
    Study(small).run()
    assert {p.name: p.read_bytes() for p in folder.iterdir() if p.is_file()} == before


def test_figures_are_the_same_bytes_every_time() -> None:
    pytest.importorskip("matplotlib")
    rows = [("CRC", "1", "1.0", "1.0"), ("CRC", "8", "0.9", "0.2")]
    first, again = (figures.render(figures.figure_4(rows, {"CRC": (0.9, 0.3)})) for _ in range(2))
    assert first == again
    assert first["svg"].startswith(b"<?xml")
    assert first["png"].startswith(b"\x89PNG")


@pytest.mark.slow
def test_a_plan_is_driven(tmp_path: Path) -> None:
    save_map(POND, tmp_path / "small.png")
    found = drive_plan(
        {
            "source": str(tmp_path / "small.png"),
            "metres_per_px": 0.5,
            "swath_m": 20.0,
            "clearance_m": 6.0,
            "method": "crc",
            "robots": 2,
            "time_budget_s": 0.1,
            "speedup": 100.0,
        }
    )
    assert all(found["home"])
    assert found["driven_makespan_s"] == pytest.approx(found["planned_makespan_s"], rel=0.15)
    assert found["driven_coverage"] > 0.97

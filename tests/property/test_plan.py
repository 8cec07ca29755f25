"""What holds for every plan, measured on the exported integers by plain geometry."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import shapely
from lakes import area_of, measure, random_lake_m, to_lonlat

from mrmission.mission.check import check_mission
from mrmission.model import FleetPlan, SurveyArea
from mrmission.options import PlanOptions, VehicleLimits
from mrmission.pipeline import plan
from mrmission.results import write_results
from mrmission.tour.sweep import SAME_SHARE, TOUCHING_M


def draw(seed: int) -> tuple[SurveyArea, PlanOptions]:
    """A random lake and random wishes that go together."""
    rng = np.random.default_rng(seed)
    size = float(rng.uniform(60, 600))
    lake = random_lake_m(rng, size, int(rng.integers(0, 6)), int(rng.integers(5, 25)))
    swath = float(np.round(rng.uniform(size / 30, size / 8), 2))
    clearance = float(rng.choice([0.0, swath / 4, swath / 2, 3.0]))
    robots = int(rng.choice([1, 2, 3, 5, 9, 16]))
    lon, lat = float(rng.choice([8.4, 179.9995, -120.0])), float(rng.uniform(-60, 65))
    region = max(shapely.get_parts(lake.buffer(-clearance - 0.1)), key=lambda part: part.area)
    count = int(rng.choice([0, 1, robots]))
    west, south, east, north = region.bounds
    starts: list[tuple[float, float]] = []
    while len(starts) < count:
        point = shapely.Point(rng.uniform(west, east), rng.uniform(south, north))
        if region.contains(point):
            there = to_lonlat(point, lon, lat)
            starts.append((there.x, there.y))
    return area_of(lake, lon_deg=lon, lat_deg=lat), PlanOptions(
        robots=robots,
        swath_m=swath,
        clearance_m=clearance,
        overlap=float(rng.choice([0.0, 0.15])),
        method=str(rng.choice(["crc", "cac", "fhk", "nrc", "auto"])),
        angle_deg=None if rng.random() < 0.5 else float(rng.uniform(-180, 360)),
        starts_lonlat=tuple(starts),
        limits=VehicleLimits(mission_items=20_000),
    )


def assert_holds(result: FleetPlan, options: PlanOptions) -> None:
    swath_m = options.swath_m
    seen = measure(result, result.missions, swath_m, options.clearance_m, options.starts_lonlat)
    assert seen.coverage >= 0.9995
    assert seen.largest_missed_m2 <= 0.01 * swath_m**2
    assert seen.outside_m == 0
    assert seen.closed_m < 0.02
    for number, (mission, row) in enumerate(
        zip(result.missions, result.report.robots, strict=True)
    ):
        assert mission.robot == row.robot == number + 1
        assert row.items == len(mission.items)
        assert seen.length_m[number] == pytest.approx(row.length_m, abs=0.01, rel=1e-5)
        violations = check_mission(
            mission,
            result.area.water_lonlat,
            clearance_m=options.clearance_m,
            limits=options.limits,
        )
        # see `measure`: a throat as wide as twice the clearance is no matter of centimetres
        assert [v for v in violations if v.rule != "water" or v.value > 1] == []
    report = result.report
    assert report.coverage == pytest.approx(seen.coverage, abs=3e-4)
    assert report.coverage_survey_legs <= report.coverage + 1e-12
    assert report.makespan_s >= report.lower_bound_s
    ends_s = [row.duration_s + row.start_delay_s for row in report.robots if row.lanes]
    assert report.makespan_s == max(ends_s)
    assert report.lane_spacing_m <= swath_m * (1 - options.overlap) * (1 + SAME_SHARE)
    assert report.lane_spacing_m <= (swath_m - 0.02 if swath_m < TOUCHING_M else swath_m + 0.001)


@pytest.mark.parametrize("seed", range(1000, 1012))
def test_random_lakes_are_swept(seed: int) -> None:
    area, options = draw(seed)
    assert_holds(plan(area, options), options)


BOX = shapely.box(0, 0, 300, 300)
ZOO = {
    "pond of 3 m": shapely.box(0, 0, 3, 3),
    "canal": shapely.box(0, 0, 1000, 6),
    "diagonal needle": shapely.Polygon([(0, 0), (700, 699.6), (700, 700), (0, 0.4)]),
    "sliver": shapely.Polygon([(0, 0), (400, 0.5), (400, 0)]),
    "moat": BOX - shapely.box(10, 10, 290, 290),
    "two ponds": shapely.MultiPolygon([shapely.box(0, 0, 200, 200), shapely.box(300, 0, 420, 100)]),
    "comb": shapely.union_all(
        [shapely.box(0, 0, 360, 40), *(shapely.box(x, 30, x + 8, 150) for x in range(0, 360, 30))]
    ),
    "throat of 1 m": shapely.union_all(
        [shapely.box(0, 0, 120, 120), shapely.box(119, 60, 181, 61), shapely.box(180, 0, 300, 120)]
    ),
}


@pytest.mark.parametrize("shape", ZOO)
def test_odd_waters_are_swept(shape: str) -> None:
    area = area_of(ZOO[shape])
    for robots, method, angle in ((1, "crc", None), (7, "cac", 45.0)):
        options = PlanOptions(
            robots=robots, swath_m=20, overlap=0, clearance_m=0, method=method, angle_deg=angle
        )
        assert_holds(plan(area, options), options)


def test_same_input_same_bytes(tmp_path: Path) -> None:
    for seed in (1003, 1010):
        area, options = draw(seed)
        folders = [tmp_path / f"{seed}-{i}" for i in (1, 2)]
        for folder in folders:
            write_results(plan(area, options), folder, overwrite=False)
        first, second = ({p.name: p.read_bytes() for p in f.iterdir()} for f in folders)
        assert first == second
        assert len(first) == 5 + 2 * options.robots


def test_report_is_finite_json(tmp_path: Path) -> None:
    # more robots than work: idle ones, and a bound near zero
    options = PlanOptions(robots=30, swath_m=60, clearance_m=0)
    result = plan(area_of(shapely.box(0, 0, 50, 40)), options)
    write_results(result, tmp_path / "out", overwrite=False)

    def refuse(name: str) -> None:
        raise AssertionError(name)

    report = json.loads((tmp_path / "out" / "report.json").read_text(), parse_constant=refuse)
    assert len(report["robots"]) == 30
    assert report["utilization"] < 1


def test_parts_without_a_start_are_named() -> None:
    area = area_of(ZOO["two ponds"])
    result = plan(area, PlanOptions(robots=2, clearance_m=0))
    assert result.report.unreached_m2 == pytest.approx(12_000, rel=1e-3)
    assert any("12,000" in note or "11,99" in note for note in result.report.notes)
    # one start in each: nothing is left out
    starts = tuple(
        (p.x, p.y) for p in (to_lonlat(shapely.Point(x, 50), 8.4, 53.1) for x in (100, 350))
    )
    options = PlanOptions(robots=2, clearance_m=0, starts_lonlat=starts)
    both = plan(area, options)
    assert both.report.unreached_m2 == 0
    assert_holds(both, options)
    # the other way round: robot 1 stays robot 1
    swapped = replace(options, starts_lonlat=starts[::-1])
    other = plan(area, swapped)
    assert other.report.robots[0].length_m == pytest.approx(both.report.robots[1].length_m)

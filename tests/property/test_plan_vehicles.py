"""What holds for plans of copters and rovers, and of boats with cameras and run-ins."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pyproj
import pytest
import shapely
from lakes import area_of, random_lake_m

from mrmission.mission.check import check_mission
from mrmission.mission.wanted import wanted_parameters
from mrmission.model import FleetPlan, LegKind, Mission, SurveyArea
from mrmission.options import PlanOptions, VehicleLimits
from mrmission.pipeline import plan
from mrmission.tour.path import legs_of

LAKE = area_of(random_lake_m(np.random.default_rng(7), 420, 2, 17))
BASE = PlanOptions(
    robots=2, swath_m=24, overlap=0.1, clearance_m=8, survey_speed_m_s=4, method="crc",
    limits=VehicleLimits(mission_items=5000),
)  # fmt: skip


def photographed_m(mission: Mission, plane: pyproj.Proj) -> list[shapely.Geometry]:
    """The legs that are travelled with the camera on, as an autopilot reads the items."""
    on, here, legs = False, None, []
    for item in mission.items:
        if item.command == 206:
            on = item.param1 > 0
        elif item.command in (16, 17, 22):
            there = plane(item.y / 1e7, item.x / 1e7)
            if on and here is not None and here != there:
                legs.append(shapely.LineString([here, there]))
            here = there
    return legs


def swept_share(result: FleetPlan, swath_m: float) -> float:
    """The share of the navigable region within half a swath of photographed legs."""
    plane = pyproj.Proj(result.report.frame)
    legs = [leg for m in result.missions for leg in photographed_m(m, plane)]
    seen = shapely.union_all(shapely.buffer(np.array(legs), swath_m / 2, quad_segs=16))
    region = result.region_m
    return float(shapely.intersection(seen, region).area / region.area)


@pytest.mark.parametrize(
    ("vehicle", "turnaround_m", "trigger", "method"),
    [
        ("copter", 0.0, "lanes", "crc"),
        ("copter", 20.0, "lanes", "minmax"),
        ("copter", 30.0, "continuous", "cac"),
        ("boat", 10.0, "lanes", "crc"),
        ("rover", 0.0, "lanes", "minmax"),
    ],
)
def test_the_camera_sees_the_whole_region(
    vehicle: str, turnaround_m: float, trigger: str, method: str
) -> None:
    options = replace(
        BASE, vehicle=vehicle, turnaround_m=turnaround_m, trigger=trigger, method=method,
        trigger_distance_m=6.0, time_budget_s=0.2,
    )  # fmt: skip
    result = plan(LAKE, options)
    assert swept_share(result, options.swath_m) > 0.9995
    assert result.report.coverage == pytest.approx(swept_share(result, options.swath_m), abs=3e-4)
    for mission, row in zip(result.missions, result.report.robots, strict=True):
        assert row.items == len(mission.items)
        assert check_mission(
            mission, LAKE.water_lonlat, clearance_m=options.clearance_m,
            turnaround_m=options.turnaround_m, limits=options.limits,
        ) == ()  # fmt: skip
        assert bool(mission.rally) == (vehicle != "copter")


def test_without_run_ins_a_camera_costs_items_and_no_way_where_lanes_are_continuous() -> None:
    plain = plan(LAKE, replace(BASE, vehicle="copter"))
    photos = plan(
        LAKE, replace(BASE, vehicle="copter", trigger_distance_m=6.0, trigger="continuous")
    )
    for before, after in zip(plain.report.robots, photos.report.robots, strict=True):
        assert after.items == before.items + 2
        assert replace(after, items=before.items, sorties=()) == replace(before, sorties=())


def test_run_ins_lie_within_their_length_and_the_fence_holds_them() -> None:
    options = replace(BASE, vehicle="copter", turnaround_m=25.0)
    result = plan(LAKE, options)
    for path in result.paths:
        legs = shapely.linestrings(legs_of(path))
        lanes = legs[path.kind == LegKind.SURVEY]
        assert shapely.covers(result.region_m.buffer(0.1), lanes).all()
        out = shapely.distance(shapely.points(path.points_m), result.region_m)
        assert 17.0 < out.max() <= 25.1  # beyond the shore, 8 m off the region
        # every lane is entered and left along its own line: run-in, lane, run-out
        points, kind = path.points_m, path.kind
        for i in np.flatnonzero(kind[1:-1] == LegKind.SURVEY) + 1:
            for j in (i - 1, i + 1):
                if kind[j] == LegKind.SURVEY:
                    continue
                lane, run = points[i + 1] - points[i], points[j + 1] - points[j]
                if np.hypot(*lane) >= 1.0:
                    assert lane @ run > 0.99 * np.hypot(*lane) * np.hypot(*run)
    for mission in result.missions:
        assert mission.fence
        assert check_mission(
            mission, LAKE.water_lonlat, clearance_m=8, turnaround_m=25, limits=options.limits
        ) == ()  # fmt: skip


def test_a_boats_run_ins_stay_in_the_navigable_water() -> None:
    result = plan(LAKE, replace(BASE, turnaround_m=25.0))
    plain = plan(LAKE, BASE)
    wide = result.region_m.buffer(0.15)
    for path in result.paths:
        assert shapely.covers(wide, shapely.linestrings(legs_of(path))).all()
    assert result.report.coverage > 0.9995
    assert sum(r.survey_m for r in result.report.robots) >= 0.99 * sum(
        r.survey_m for r in plain.report.robots
    )


def test_photos_are_counted_against_what_a_vehicle_holds() -> None:
    options = replace(BASE, vehicle="copter", robots=1, limits=VehicleLimits(mission_items=60))
    result = plan(LAKE, replace(options, trigger_distance_m=6.0))
    assert len(result.missions) > 1  # in trips
    assert sum(len(mission.items) for mission in result.missions) > 60
    for mission in result.missions:
        assert len(mission.items) <= 60
        assert check_mission(mission, LAKE.water_lonlat, limits=options.limits) == ()


def test_the_notes_of_a_copter_say_what_to_set() -> None:
    result = plan(LAKE, replace(BASE, vehicle="copter", altitude_m=45))
    wanted = wanted_parameters(result.missions[0])
    (note,) = [n for n in result.report.notes if n.startswith("set on every copter")]
    for parameter in wanted:
        assert f"{parameter.name} {parameter.value:g}" in note
    assert result.report.options["limits"]["mission_items"] == 5000
    assert PlanOptions(vehicle="copter").limits.mission_items == 650


def test_a_rovers_mission_ends_with_a_waypoint_at_home() -> None:
    area: SurveyArea = LAKE
    result = plan(area, replace(BASE, vehicle="rover"))
    for mission in result.missions:
        first, last = mission.items[1], mission.items[-1]
        assert (first.command, last.command) == (16, 16)
        assert (last.x, last.y) == (mission.items[0].x, mission.items[0].y)
        assert {i.z for i in mission.items} == {0.0}

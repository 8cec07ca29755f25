"""Plans in several trips: all is covered, and each trip is what a battery and a memory hold."""

from __future__ import annotations

import importlib.util
import json
import re
from dataclasses import replace
from itertools import permutations, product
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import shapely
from lakes import area_of, geojson_of, measure, random_lake_m

from mrmission.errors import InfeasibleError
from mrmission.fleet import Robot
from mrmission.mission.check import check_mission
from mrmission.model import FleetPlan
from mrmission.options import PlanOptions, VehicleLimits
from mrmission.partition.bound import fleet_area_bound_s
from mrmission.pipeline import plan
from mrmission.report.metrics import report_json
from mrmission.results import write_results
from mrmission.tour.flight import time_model

START = ((8.4, 53.1),)


def lake(seed: int, size_m: float = 400.0, islands: int = 2) -> Any:
    return area_of(random_lake_m(np.random.default_rng(seed), size_m, islands))


def wishes(**changes: Any) -> PlanOptions:
    usual: dict[str, Any] = {
        "robots": 2,
        "swath_m": 30.0,
        "clearance_m": 4.0,
        "starts_lonlat": START,
        "method": "minmax",
        "time_budget_s": 0.1,
        "angle_deg": 20.0,
        "fence": False,
        "separation_m": 0.0,
    }
    return PlanOptions(**{**usual, **changes})


def assert_whole(result: FleetPlan, options: PlanOptions) -> None:
    """Everything is covered in the water, and every trip fits, measured on what is exported."""
    seen = measure(
        result, result.missions, options.swath_m, options.clearance_m, options.starts_lonlat
    )
    assert seen.coverage >= 0.9995
    assert seen.largest_missed_m2 <= 0.01 * options.swath_m**2
    assert seen.outside_m == 0
    assert seen.closed_m < 0.02
    assert [(m.robot, m.sortie) for m in result.missions] == [
        (row.robot, trip.sortie) for row in result.report.robots for trip in row.sorties
    ]
    assert [(p.robot, p.sortie) for p in result.paths] == [
        (m.robot, m.sortie) for m in result.missions
    ]
    trips = [(row, trip) for row in result.report.robots for trip in row.sorties]
    for mission, path, (row, trip) in zip(result.missions, result.paths, trips, strict=True):
        own = options.of_robot(row.robot)
        time = time_model(own)
        assert trip.items == len(mission.items) <= own.limits.mission_items
        assert trip.duration_s == pytest.approx(time.duration_s(path.points_m, path.kind))
        if own.endurance_s is not None:
            assert trip.duration_s <= (1 - own.reserve) * own.endurance_s + 1e-6
            assert trip.endurance_used == pytest.approx(trip.duration_s / own.endurance_s)
        if own.endurance_m is not None:
            assert trip.length_m <= (1 - own.reserve) * own.endurance_m + 1e-6
        assert (
            check_mission(
                mission,
                result.area.water_lonlat,
                clearance_m=options.clearance_m,
                limits=own.limits,
            )
            == ()
        )
    for row in result.report.robots:
        own = options.of_robot(row.robot)
        busy = sum(trip.duration_s for trip in row.sorties)
        busy += (len(row.sorties) - 1) * own.swap_time_s
        assert row.duration_s == pytest.approx(busy)
        assert row.length_m == pytest.approx(sum(trip.length_m for trip in row.sorties))
        starts = [trip.start_s for trip in row.sorties]
        assert starts == sorted(starts)
    assert result.report.makespan_s >= result.report.lower_bound_s
    if options.method == "minmax":
        assert result.report.makespan_s >= result.report.lanes_bound_s


@pytest.mark.parametrize(
    ("method", "limit"),
    [
        ("minmax", {"endurance_s": 500.0}),
        ("minmax", {"endurance_m": 1000.0}),
        ("crc", {"endurance_s": 500.0}),
    ],
)
def test_every_trip_is_home_with_its_reserve(method: str, limit: dict[str, float]) -> None:
    options = wishes(method=method, swap_time_s=60.0, **limit)
    result = plan(lake(4), options)
    assert_whole(result, options)
    assert max(len(row.sorties) for row in result.report.robots) > 1
    assert any("out more than once" in note for note in result.report.notes)
    if "endurance_s" in limit and method == "minmax":  # trips and swaps are in the bound
        once = plan(lake(4), wishes())
        assert result.report.lanes_bound_s > 1.1 * once.report.lanes_bound_s


def test_what_is_enough_changes_nothing() -> None:
    plain = plan(lake(4), wishes())
    generous = plan(lake(4), wishes(endurance_s=36_000.0))
    assert [m.items for m in generous.missions] == [m.items for m in plain.missions]
    assert all(len(row.sorties) == 1 for row in generous.report.robots)


@pytest.mark.parametrize("seed", range(3))
def test_no_mission_is_longer_than_a_vehicle_holds(seed: int) -> None:
    rng = np.random.default_rng(seed)
    options = wishes(
        robots=int(rng.integers(1, 4)),
        method=str(rng.choice(["minmax", "crc", "auto"])),
        limits=VehicleLimits(mission_items=int(rng.integers(16, 60))),
        starts_lonlat=(),
        turnaround_m=float(rng.choice([0.0, 5.0])),
        transit_speed_m_s=float(rng.choice([2.0, 3.0])),
    )
    result = plan(lake(seed, 350.0), options)
    assert_whole(result, options)


@pytest.mark.parametrize("seed", [1, 2, 7])
def test_a_robot_with_many_items_gives_some_away_before_it_goes_out_twice(seed: int) -> None:
    area = lake(seed, 550.0, 3)
    usual: dict[str, Any] = {"robots": 5, "swath_m": 20.0, "time_budget_s": 0.2}
    free = plan(area, wishes(**usual))
    most = max(row.items for row in free.report.robots)
    limits = VehicleLimits(mission_items=most - 2)
    options = wishes(**usual, limits=limits)
    result = plan(area, options)
    assert_whole(result, options)
    assert all(len(row.sorties) == 1 for row in result.report.robots)
    assert result.report.makespan_s < 1.1 * free.report.makespan_s


def test_lanes_in_pieces_are_as_many_items_as_they_are_exported() -> None:
    area = lake(2, 550.0, 3)
    usual: dict[str, Any] = {"robots": 4, "swath_m": 20.0, "time_budget_s": 0.2}
    free = plan(area, wishes(**usual))
    most = max(row.items for row in free.report.robots)
    enough = plan(area, wishes(**usual, limits=VehicleLimits(mission_items=most + 1)))
    assert [m.items for m in enough.missions] == [m.items for m in free.missions]


def test_the_points_that_long_legs_are_divided_by_are_items_too() -> None:
    # legs of 20 km in the north: exported in several straight pieces each
    long = area_of(shapely.box(0.0, 0.0, 20_000.0, 1_500.0))
    options = wishes(
        robots=1, swath_m=150.0, overlap=0.0, angle_deg=90.0, clearance_m=0.0,
        limits=VehicleLimits(mission_items=60),
    )  # fmt: skip
    result = plan(long, options)
    items = [len(mission.items) for mission in result.missions]
    whole = plan(long, replace(options, limits=VehicleLimits(mission_items=600)))
    assert len(whole.missions[0].items) > 60  # divided legs and all
    assert max(items) <= 60
    assert len(items) >= 2


def test_a_mixed_fleet_is_home_together() -> None:
    fleet = (
        Robot(name="slow", survey_speed_m_s=1.0, transit_speed_m_s=1.0, swath_m=24.0),
        Robot(
            name="fast", survey_speed_m_s=2.5, transit_speed_m_s=3.0, swath_m=30.0,
            endurance_s=400.0, swap_time_s=30.0, max_items=60,
        ),
    )  # fmt: skip
    options = wishes(fleet=fleet, swath_m=24.0, time_budget_s=0.3)
    result = plan(lake(4), options)
    assert_whole(result, options)
    slow, fast = result.report.robots
    assert (slow.name, fast.name) == ("slow", "fast")
    assert len(slow.sorties) == 1
    assert len(fast.sorties) > 1
    assert fast.survey_m > slow.survey_m
    assert slow.duration_s == pytest.approx(fast.duration_s, rel=0.25)
    speeds = [
        {item.param2 for item in mission.items if item.command == 178}
        for mission in result.missions
    ]
    assert speeds[0] == {1.0}
    assert all(speed == {2.5, 3.0} for speed in speeds[1:])
    assert any("narrowest swath, 24 m" in note for note in result.report.notes)
    row = report_json(result)["options"]["fleet"][1]
    assert (row["name"], row["endurance_s"]) == ("fast", 400.0)
    covered = result.report.coverage * result.region_m.area
    assert result.report.lower_bound_s >= fleet_area_bound_s(covered, [24.0, 30.0], [1.0, 3.0])


def test_a_place_too_far_away_is_named_with_what_would_do() -> None:
    area = lake(4)
    with pytest.raises(InfeasibleError) as caught:
        plan(area, wishes(endurance_s=60.0))
    found = re.search(r"water at ([\d.]+),([\d.]+) .* --endurance of (\d+)min", str(caught.value))
    assert found is not None
    place = shapely.Point(float(found[1]), float(found[2]))
    assert shapely.distance(area.water_lonlat, place) < 1e-6
    enough = wishes(endurance_s=60.0 * float(found[3]))
    assert_whole(plan(area, enough), enough)
    with pytest.raises(InfeasibleError, match=r"--endurance of \d+m,"):
        plan(area, wishes(endurance_m=50.0))
    with pytest.raises(InfeasibleError, match="all must fit into 8"):
        plan(area, wishes(limits=VehicleLimits(mission_items=8)))


def test_a_place_whose_turns_take_too_many_items_is_named_with_what_they_take() -> None:
    few = wishes(limits=VehicleLimits(mission_items=12), turn_radius_m=6.0)
    with pytest.raises(InfeasibleError) as caught:
        plan(lake(4), few)
    found = re.search(r"takes (\d+) mission items .* turns of --turn-radius", str(caught.value))
    assert found is not None
    assert int(found[1]) > 12
    fewer = wishes(limits=VehicleLimits(mission_items=11), turn_radius_m=6.0)
    with pytest.raises(InfeasibleError) as caught:
        plan(lake(4), fewer)
    found = re.search(r"takes (\d+) mission items [^,]*(, others to cover)?", str(caught.value))
    assert found is not None
    assert (int(found[1]) > 11) == (found[2] is None)


def test_the_least_number_of_trips_of_few_lanes() -> None:
    """No order and direction of whole lanes needs fewer trips than the planner finds."""
    width, height = 99.0, 150.0
    area = area_of(shapely.box(0, 0, width, height))
    options = wishes(
        robots=1, swath_m=25.0, overlap=0.0, clearance_m=0.0, angle_deg=0.0, starts_lonlat=(),
        time_budget_s=0.3,
    )  # fmt: skip
    whole = plan(area, options)
    home = whole.homes_m[0]
    path = whole.paths[0]
    time = time_model(options)
    # a lane may come in pieces; it is as long as the box is high
    legs = np.stack([path.points_m[:-1], path.points_m[1:]], axis=1)[path.kind == 1]
    upright = legs[np.abs(legs[:, 1, 1] - legs[:, 0, 1]) > 10.0]
    across = sorted({round(x) for x in upright.mean(axis=1)[:, 0].tolist()})
    assert len(across) == 4
    lanes = [np.array([(x, -height / 2), (x, height / 2)], dtype=np.float64) for x in across]

    def least_s(chosen: tuple[int, ...]) -> float:
        best = np.inf
        for order in permutations(chosen):
            for turn in product((1, -1), repeat=len(order)):
                ways = [lanes[i][::t] for i, t in zip(order, turn, strict=True)]
                points = np.vstack([home, *ways, home])
                kind = np.array([0, *([1, 0] * len(ways))])
                best = min(best, time.duration_s(points, kind))
        return best

    cost = {mask: least_s(tuple(i for i in range(4) if mask >> i & 1)) for mask in range(1, 16)}

    def trips_by_hand(limit_s: float) -> int:
        need = {0: 0}
        for mask in range(1, 16):
            parts = (s for s in range(1, mask + 1) if s & mask == s and cost[s] <= limit_s)
            need[mask] = min((need[mask ^ part] + 1 for part in parts), default=99)
        return need[15]

    for factor in (1.05, 2.2, 3.3):
        limit_s = factor * max(cost[1 << i] for i in range(4))
        result = plan(area, wishes(
            robots=1, swath_m=25.0, overlap=0.0, clearance_m=0.0, angle_deg=0.0,
            starts_lonlat=(), time_budget_s=0.3, endurance_s=limit_s / 0.8,
        ))  # fmt: skip
        # lanes may be cut, which can save a trip
        assert len(result.report.robots[0].sorties) <= trips_by_hand(limit_s)


@pytest.fixture(scope="module")
def scorer(score_script: Path) -> Any:
    spec = importlib.util.spec_from_file_location("score_missions", score_script)
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def test_the_judge_finds_all_trips(scorer: Any, tmp_path: Path) -> None:
    area = lake(7, 500.0)
    options = wishes(robots=3, endurance_s=600.0, fence=True)
    (tmp_path / "lake.geojson").write_text(geojson_of(area))
    write_results(plan(area, options), tmp_path / "out", overwrite=False)
    files = sorted((tmp_path / "out").glob("robot-*.plan"))
    assert any("-sortie-2" in file.name for file in files)
    score = scorer.score(
        tmp_path / "lake.geojson", files, options.swath_m, options.clearance_m, 50.0, 0.25, START[0]
    )
    report = json.loads((tmp_path / "out/report.json").read_text())
    assert score["robots"] == 3
    assert score["coverage"] >= 0.9995
    assert score["outside_m"] == 0
    assert score["longest_m"] == pytest.approx(
        max(row["length_m"] for row in report["robots"]), rel=1e-3
    )
    # a plan anew with less leaves no trip of the old one behind
    write_results(plan(area, wishes(robots=3)), tmp_path / "out", overwrite=True)
    names = sorted(file.name for file in (tmp_path / "out").glob("robot-*.plan"))
    assert names == ["robot-1.plan", "robot-2.plan", "robot-3.plan"]

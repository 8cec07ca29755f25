"""Whole plans with a turn radius, and what the planner's costs and bounds make of turns."""

from __future__ import annotations

import importlib.util
import json
import warnings
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import shapely

from mrmission.area.geojson import read_survey_area
from mrmission.cli.plan import plan as command
from mrmission.errors import ConfigError
from mrmission.minmax.costs import line_costs
from mrmission.minmax.hooks import no_hooks
from mrmission.minmax.least import least_costs
from mrmission.model import FleetPlan, LegKind, SurveyArea
from mrmission.options import PlanOptions
from mrmission.pipeline import plan
from mrmission.report.units import human_gap
from mrmission.results import write_results
from mrmission.routing.harbour import Harbour
from mrmission.tour.lines import SurveyLine
from mrmission.tour.manoeuvre import Waters
from mrmission.tour.path import assemble_paths
from mrmission.tour.reversals import reversals
from mrmission.tour.timing import TimeModel
from mrmission.tour.turnaround import with_turnarounds
from mrmission.tour.turning import round_transits

POND = shapely.Polygon([(11.2, 47.8), (11.203, 47.8), (11.203, 47.8015), (11.2, 47.8015)])
ISLAND = shapely.Polygon([(11.201, 47.8005), (11.2013, 47.8005), (11.2012, 47.8008)])
LAKE = shapely.MultiPolygon([shapely.Polygon(POND.exterior, [ISLAND.exterior])])
TINY = shapely.box(11.2, 47.8, 11.2012, 47.8006)
SMALL = SurveyArea(name="tiny", source="tiny", water_lonlat=shapely.MultiPolygon([TINY]))
AREA = SurveyArea(name="pond", source="pond", water_lonlat=LAKE)


def planned(**options: Any) -> FleetPlan:
    wanted = {"swath_m": 20.0, "clearance_m": 2.0, "time_budget_s": 0.2, **options}
    return plan(AREA, PlanOptions(**wanted))


def sharpest_deg(made: FleetPlan) -> float:
    out = 0.0
    for path in made.paths:
        leg = np.diff(path.points_m, axis=0)
        heading = np.arctan2(leg[:, 1], leg[:, 0])
        bend = np.abs((np.diff(heading) + np.pi) % (2 * np.pi) - np.pi)
        out = max(out, float(np.degrees(bend).max()))
    return out


def test_runs_that_have_no_room_are_told() -> None:
    notes = planned(run_in_m=10.0, run_out_m=3.0).report.notes
    assert any("have the whole run-in of 10 m" in n and "run-out of 3 m" in n for n in notes)
    copter = planned(run_in_m=10.0, run_out_m=3.0, vehicle="copter").report.notes
    assert not any("whole run-in" in note for note in copter)


def test_where_a_bound_says_nothing_no_gap_is_known() -> None:
    report = plan(SMALL, PlanOptions(swath_m=200.0, clearance_m=0.0, time_budget_s=0.0)).report
    assert report.lower_bound_s == 0.0 < report.makespan_s
    assert human_gap(report.gap) == "–"


def test_a_plan_with_a_turn_radius_bends_gently_and_covers_all() -> None:
    made = planned(turn_radius_m=7.0, robots=2)
    report = made.report
    assert not [n for n in report.notes if "tighter than" in n]
    assert sharpest_deg(made) <= 61.0
    assert report.coverage >= 0.9995
    assert report.options["turn_radius_m"] == 7.0
    for path in made.paths:
        assert made.region_m.buffer(0.02).covers(shapely.LineString(path.points_m))
    assert report.lanes_bound_s is not None
    assert report.lanes_bound_s <= report.makespan_s
    sharp = planned(turn_radius_m=0.0, robots=2)
    assert sharpest_deg(sharp) > 80.0
    assert sharp.report.makespan_s < report.makespan_s


def test_where_no_turn_fits_the_plan_says_so() -> None:
    made = plan(
        SMALL, PlanOptions(swath_m=30.0, clearance_m=0.0, turn_radius_m=60.0, time_budget_s=0.1)
    )
    (note,) = [n for n in made.report.notes if "tighter than" in n]
    count, rest = note.split(" ", 1)
    assert int(count) > 0
    assert "--turn-radius 60 m" in rest
    assert "near 11.20" in rest


def test_a_camera_is_on_where_a_turn_replaces_a_lane() -> None:
    made = plan(
        SMALL,
        PlanOptions(
            swath_m=20.0,
            clearance_m=0.0,
            turn_radius_m=7.0,
            trigger_distance_m=2.0,
            time_budget_s=0.1,
        ),
    )
    assert made.report.coverage >= 0.9995
    assert made.report.coverage_survey_legs >= 0.9995


def test_only_what_turns_on_the_spot_flies() -> None:
    with pytest.raises(ConfigError, match="--turn-radius 5"):
        PlanOptions(vehicle="copter", turn_radius_m=5.0)
    with pytest.raises(ConfigError, match="--turn-radius -1"):
        PlanOptions(turn_radius_m=-1.0)
    (option,) = [p for p in command.params if p.name == "turn_radius_m"]
    assert option.default == 0.0


def test_steered_boats_do_not_reverse_where_pivoting_ones_may() -> None:
    # a dead end, wide enough to turn in
    arm = shapely.box(11.2014, 47.8014, 11.2017, 47.803)
    area = SurveyArea(
        name="arm", source="arm", water_lonlat=shapely.MultiPolygon([shapely.union(POND, arm)])
    )
    counts = []
    for steering in ("steered", "pivoting"):
        options = PlanOptions(
            swath_m=15.0, clearance_m=0.0, time_budget_s=0.2, angle_deg=20.0, steering=steering
        )
        made = plan(area, options)
        assert made.report.coverage >= 0.9995
        counts.append(sum(len(reversals(p)) for p in made.paths))
    assert counts[0] < counts[1]


def lake_lines(seed: int) -> tuple[tuple[SurveyLine, ...], Harbour]:
    rng = np.random.default_rng(seed)
    lines = []
    for x in range(20, 300, 20):
        low, high = sorted(rng.uniform(5, 195, 2))
        lines.append(SurveyLine(points_m=np.array([[x, low], [x, high + 1]])))
    harbour = Harbour(shapely.box(0, 0, 320, 200), np.array([[10.0, 10.0]]))
    return tuple(lines), harbour


@pytest.mark.parametrize("radius_m", [0.0, 8.0])
def test_what_ways_cannot_be_less_than_is_never_more_than_they_cost(radius_m: float) -> None:
    lines, harbour = lake_lines(1)
    time = TimeModel(
        survey_speed_m_s=2.0, transit_speed_m_s=2.0, swath_m=20.0, turn_radius_m=radius_m
    )
    hooks = no_hooks(2 * len(lines))
    homes = np.array([[10.0, 10.0]])
    costs = line_costs(lines, hooks, harbour, homes, (time,), lanes_alone=False)
    least = least_costs(lines, hooks, harbour, homes, (time,), costs.metres, lanes_alone=False)
    own = np.arange(2 * len(lines))
    ways = own[:, None] // 2 != own[None] // 2
    assert (least.end_cost <= costs.problem.end_cost + 1e-9)[ways].all()
    assert (least.end_cost < costs.problem.end_cost - 0.5)[ways].any()
    assert (least.lane_cost <= costs.problem.lane_cost + 1e-9).all()


def test_a_reversal_may_cost_less_than_its_corner() -> None:
    time = TimeModel(survey_speed_m_s=2.0, transit_speed_m_s=2.0, swath_m=20.0)
    lanes = [[[0, 0], [0, 100]], [[20, -160], [20, -80]], [[20, 0], [20, 100]]]
    lines = tuple(SurveyLine(points_m=np.array(lane)) for lane in lanes)
    homes = np.array([[10.0, 10.0]])
    harbour = Harbour(shapely.box(-50, -200, 320, 200), homes)
    costs = line_costs(lines, no_hooks(6), harbour, homes, (time,), lanes_alone=False)
    least = least_costs(
        lines, no_hooks(6), harbour, homes, (time,), costs.metres, lanes_alone=False
    )
    # from the first lane's top back to the second's, by 174 degrees: a gentler way may do
    assert least.end_cost[1, 3] < costs.problem.end_cost[1, 3] - 3.0
    assert least.end_cost[1, 3] >= np.hypot(20, 180) / 2.0
    # over to the third by two corners of 90 degrees
    assert least.end_cost[1, 5] == costs.problem.end_cost[1, 5]


def test_a_real_lake_is_complete_with_a_turn_radius(
    shared_data: Path, score_script: Path, tmp_path: Path
) -> None:
    spec = importlib.util.spec_from_file_location("score_missions", score_script)
    assert spec is not None
    assert spec.loader is not None
    scorer = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(scorer)
    path = shared_data / "lakes" / "topaz_ca.geojson"
    options = PlanOptions(
        robots=2, swath_m=30.0, overlap=0.0, clearance_m=0.0, turn_radius_m=6.0, time_budget_s=0.1
    )
    made = plan(read_survey_area(path), options)
    write_results(made, tmp_path / "out", overwrite=False)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        files = sorted((tmp_path / "out").glob("robot-*.plan"))
        score = scorer.score(path, files, 30.0, 0.0, 50.0, 0.25)
    assert score["coverage"] >= 0.9995
    assert score["outside_m"] == 0
    assert score["missed_m2"] <= 0.01 * 30.0**2
    report = json.loads((tmp_path / "out" / "report.json").read_text())
    longest = max(row["length_m"] for row in report["robots"])
    assert score["longest_m"] == pytest.approx(longest, rel=1e-3)
    assert all((m.kind.count(int(LegKind.SURVEY)) > 0) for m in made.missions)


@pytest.mark.parametrize("radius_m", [3.0, 6.0])
def test_runs_before_and_after_lanes_stay_straight(radius_m: float) -> None:
    homes = np.array([[10.0, 10.0]])
    harbour = Harbour(shapely.box(-50, -60, 320, 260), homes)
    lanes = [np.array([[x, 0.0], [x, 200.0]]) for x in (40.0, 70.0, 100.0)]
    (path,) = assemble_paths(harbour, [[lanes[0], lanes[1][::-1], lanes[2]]])
    path = with_turnarounds(path, 15.0, harbour.region, 5.0)
    turned, sharp = round_transits(path, Waters(harbour, 0, radius_m, 1.0), 30.0, runs=True)
    assert len(sharp) == 0
    way = shapely.LineString(turned.points_m).buffer(0.01)
    for lane in (lanes[0], lanes[1][::-1], lanes[2]):
        ahead = (lane[1] - lane[0]) / 200.0
        run = shapely.LineString([lane[0] - 15.0 * ahead, lane[1] + 5.0 * ahead])
        assert way.covers(run)
    short, _ = round_transits(path, Waters(harbour, 0, radius_m, 1.0), 30.0)
    assert shapely.LineString(short.points_m).length < shapely.LineString(turned.points_m).length

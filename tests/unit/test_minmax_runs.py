"""Runs in the costs: as long as the water allows, and dearer than none; extras round land."""

from __future__ import annotations

import numpy as np
import pytest
import shapely
from part_works import part_work

from mrmission.minmax.hooks import around_land, find_hooks
from mrmission.minmax.runs import part_costs, with_runs
from mrmission.options import PlanOptions
from mrmission.tour.lines import SurveyLine, lengths_m
from mrmission.tour.work import PartWork

LAKE = shapely.box(0, 0, 200, 300)


def work_of(options: PlanOptions, lake: shapely.Polygon = LAKE) -> PartWork:
    lanes = tuple(
        SurveyLine(points_m=np.array([[x, 10.0], [x, 260.0]]), name=str(i))
        for i, x in enumerate((20.0, 60.0, 100.0, 140.0, 180.0), 1)
    )
    homes = np.array([[5.0, 5.0], [195.0, 5.0]])
    return part_work(lake, homes, options, spacing_m=40.0, lines=lanes)


def test_runs_end_where_the_water_ends() -> None:
    work = work_of(PlanOptions(robots=2, swath_m=40.0, run_in_m=30.0, run_out_m=10.0))
    longer = with_runs(work.lines, work)
    # 20 m on the mean, but only 10 m of water below
    for line in longer:
        assert line.points_m[[0, -1], 1].tolist() == [0.0, 280.0]
    assert lengths_m(longer).tolist() == pytest.approx([280.0] * 5)


@pytest.mark.parametrize("vehicle", ["boat", "copter"])
def test_runs_are_counted_at_transit_speed(vehicle: str) -> None:
    common = {"robots": 2, "swath_m": 40.0, "vehicle": vehicle, "transit_speed_m_s": 4.0}
    plain, runs = (
        work_of(PlanOptions(**common, run_in_m=m, run_out_m=m))  # type: ignore[arg-type]
        for m in (0.0, 8.0)
    )
    costs = []
    for work in (plain, runs):
        hooks, extra = find_hooks(work)
        costs.append(part_costs(work.lines + extra, hooks, work))
    own = slice(0, len(plain.lines))
    added = costs[1].problem.lane_cost[own] - costs[0].problem.lane_cost[own]
    assert added == pytest.approx([16.0 / 4.0] * 5, abs=1e-6)


def test_extra_lines_go_round_land_between_their_points() -> None:
    lake = LAKE - shapely.box(70, 100, 90, 140)
    work = work_of(PlanOptions(robots=2, swath_m=40.0), lake)
    way = np.array([[20.0, 120.0], [60.0, 120.0], [100.0, 120.0], [100.0, 125.0]])
    line = around_land(way, work)
    assert lake.buffer(1e-6).covers(shapely.LineString(line))
    kept = [tuple(p) for p in line.tolist()]
    assert [p for p in kept if p in set(map(tuple, way.tolist()))] == list(map(tuple, way.tolist()))
    assert len(line) > len(way)
    free = np.array([[20.0, 20.0], [60.0, 30.0]])
    assert around_land(free, work).tolist() == free.tolist()

"""Two boats that a plan keeps apart stay apart, and would have met: light boats, then ArduRover."""

from __future__ import annotations

import asyncio

import pytest
import shapely
from fleets import BUDGET
from lakes import area_of

from mrmission.model import FleetPlan
from mrmission.options import PlanOptions
from mrmission.pipeline import plan as plan_fleet
from mrmission.rehearse.judge import FleetDriven, Limits, judge
from mrmission.rehearse.run import Waters, sail_missions, sailing_missions

LAKE = shapely.Polygon(
    [(0, 0), (150, 0), (160, 90), (80, 120), (0, 100)], [[(70, 50), (95, 55), (85, 70)]]
)
LANDINGS = ((8.501967, 47.300634), (8.501729, 47.300822))
SEPARATION_M = 20.0
OFF_THE_WAY_M = 2.0
"""The plan promises a distance of planned ways; so far each boat may be off its own at a corner.

Corners up to 135 degrees, the sharpest of these tours, swing 1.6 m (docs/time-model.md).
"""
SPEEDUP = {"light": 80.0, "ardupilot": BUDGET / 2}


def fleet_plan(separation_m: float) -> FleetPlan:
    """Two boats from two landings 28 m apart; their missions wait by themselves."""
    options = PlanOptions(
        robots=2,
        swath_m=40.0,
        clearance_m=8.0,
        starts_lonlat=LANDINGS,
        separation_m=separation_m,
        wait_in_mission=True,
        time_budget_s=0.2,
    )
    return plan_fleet(area_of(LAKE, lon_deg=8.5, lat_deg=47.3), options)


def driven(plan: FleetPlan, engine: str) -> FleetDriven:
    """Sail a plan; everybody comes home."""
    waters = Waters(engine=engine, speedup=SPEEDUP[engine])
    tracks = asyncio.run(sail_missions(sailing_missions(plan.missions), waters))
    found = judge(plan, tracks, limits=Limits(cross_track_m=4.0, distance_m=0.0))
    assert found.violations == ()
    return found


engines = pytest.mark.parametrize(
    "engine", ["light", pytest.param("ardupilot", marks=pytest.mark.ardupilot)]
)


@engines
def test_boats_stay_as_far_apart_as_the_plan_says(engine: str) -> None:
    plan = fleet_plan(SEPARATION_M)
    assert plan.report.separation.conflicts == ()
    found = driven(plan, engine)
    (pair,) = found.pairs
    assert pair.planned_m is not None
    assert pair.planned_m >= SEPARATION_M
    assert pair.driven is not None
    assert pair.driven.distance_m >= pair.planned_m - 2 * OFF_THE_WAY_M
    # the missions waited by themselves, as long as they were told to
    waits = {row.robot: row.start_delay_s for row in plan.report.robots}
    assert max(waits.values()) > 5
    for row in found.robots:
        # whole seconds, and a few until the waypoint at home counts as reached
        assert waits[row.robot] - 0.5 <= row.start_delay_s <= waits[row.robot] + 5.0


@engines
def test_without_separation_the_same_boats_meet(engine: str) -> None:
    """What the first test could not find if boats came apart by luck."""
    plan = fleet_plan(0.0)
    assert all(row.start_delay_s == 0 for row in plan.report.robots)
    (pair,) = driven(plan, engine).pairs
    assert pair.planned_m is None
    assert pair.driven is not None
    assert pair.driven.distance_m < SEPARATION_M / 2

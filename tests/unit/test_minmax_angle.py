"""The bearing of the lanes: candidates, ranking, options."""

from __future__ import annotations

import numpy as np
import pytest
import shapely

from mrmission.errors import ConfigError
from mrmission.minmax.angle import BUDGET_SHARE, candidate_bearings, choose_bearing
from mrmission.options import PlanOptions
from mrmission.pipeline import plan
from mrmission.routing.harbour import Harbour
from mrmission.tour.flight import time_model
from tests.lakes import area_of

TIME = time_model(PlanOptions())


def turned_box(width_m: float, height_m: float, bearing_deg: float) -> shapely.Polygon:
    """A rectangle whose long side lies at a bearing."""
    box = shapely.box(-width_m / 2, -height_m / 2, width_m / 2, height_m / 2)
    return shapely.affinity.rotate(box, 90.0 - bearing_deg, origin=(0, 0))


def off_deg(a: float, b: float) -> float:
    """The angle between two directions of lines."""
    return abs((a - b + 90.0) % 180.0 - 90.0)


def test_candidates_hold_the_sides_of_a_rectangle() -> None:
    found = candidate_bearings(turned_box(400, 150, 37.0), 10.0)
    assert any(off_deg(b, 37.0) < 0.01 for b in found)
    assert any(off_deg(b, 127.0) < 0.01 for b in found)


def test_candidates_are_bearings_apart_and_all_around() -> None:
    rng = np.random.default_rng(0)
    lake = shapely.MultiPoint(rng.uniform(0, 500, (9, 2))).convex_hull
    found = candidate_bearings(lake, 10.0)
    assert all(0 <= b < 180 for b in found)
    assert all(off_deg(a, b) >= 1.99 for i, a in enumerate(found) for b in found[:i])
    assert all(min(off_deg(b, around) for b in found) <= 9.5 for around in range(180))


def test_candidates_hold_the_direction_across_which_a_triangle_is_narrowest() -> None:
    # 400 long, 100 high: narrowest across its longest side
    triangle = shapely.Polygon([(0, 0), (400, 0), (150, 100)])
    assert candidate_bearings(triangle, 10.0)[0] == pytest.approx(90.0)


def test_candidates_hold_the_shore_of_islands() -> None:
    lake = turned_box(1000, 900, 0.0)
    island = shapely.affinity.rotate(shapely.box(-200, -60, 200, 60), -23.0)
    lake = shapely.Polygon(lake.exterior, [island.exterior])
    assert any(off_deg(b, 113.0) < 0.01 for b in candidate_bearings(lake, 10.0))


@pytest.mark.parametrize("robots", [1, 2])
@pytest.mark.parametrize("budget_s", [0.0, 1.0])
def test_a_long_rectangle_is_swept_along(robots: int, budget_s: float) -> None:
    # eight lanes, shared evenly, that end where they begin; across, the turns take longer
    region = turned_box(900, 120, 64.0)
    along = np.array([np.sin(np.radians(64.0)), np.cos(np.radians(64.0))])
    homes = np.array([-440.0 * along, -420.0 * along])[:robots]
    choice = choose_bearing(
        region, Harbour(region, homes), homes, TIME, 15.0, time_budget_s=budget_s
    )
    assert off_deg(choice.bearing_deg, 64.0) < 0.01


def test_many_robots_at_one_end_of_a_channel_sweep_along_it() -> None:
    region = turned_box(1200, 80, 90.0)
    homes = np.column_stack([np.full(8, -595.0), np.linspace(-35, 35, 8)])
    choice = choose_bearing(region, Harbour(region, homes), homes, TIME, 10.0, time_budget_s=1.0)
    assert off_deg(choice.bearing_deg, 90.0) < 0.01


def test_same_seed_same_choice_and_the_budget_is_shared() -> None:
    rng = np.random.default_rng(4)
    lake = shapely.MultiPoint(rng.uniform(0, 500, (12, 2))).convex_hull
    homes = np.array([[250.0, 250.0], [260.0, 250.0], [250.0, 260.0]])
    harbour = Harbour(lake, homes)
    one, two = (
        choose_bearing(lake, harbour, homes, TIME, 20.0, time_budget_s=0.4, seed=5)
        for _ in range(2)
    )
    assert one == two
    assert max(t.round for t in one.tried) > 1
    best = max(one.tried, key=lambda t: (t.round, -t.makespan_s))
    assert one.bearing_deg == best.bearing_deg
    assert one.budget_left_s == pytest.approx((1 - BUDGET_SHARE) * 0.4)


def test_no_budget_is_spent_where_none_is_given() -> None:
    lake = turned_box(300, 200, 10.0)
    home = np.zeros((1, 2))
    choice = choose_bearing(lake, Harbour(lake, home), home, TIME, 20.0, time_budget_s=0.0)
    assert choice.budget_left_s == 0.0
    assert {t.round for t in choice.tried} == {0}


@pytest.mark.parametrize(("asked", "bearing"), [(-30.0, 150.0), (200.0, 20.0), (360.0, 0.0)])
def test_an_angle_is_the_bearing_of_a_line(asked: float, bearing: float) -> None:
    assert PlanOptions(angle_deg=asked).bearing_deg == bearing


@pytest.mark.parametrize(("wind", "bearing"), [(0.0, 90.0), (225.0, 135.0), (270.0, 0.0)])
def test_across_the_wind(wind: float, bearing: float) -> None:
    assert PlanOptions(across_wind_deg=wind).bearing_deg == bearing


@pytest.mark.parametrize(
    ("options", "said"),
    [
        ({"angle_deg": 400.0}, "--angle 400.0: must be a bearing between -180 and 360"),
        ({"angle_deg": float("nan")}, "--angle nan"),
        ({"angle_deg": float("inf")}, "--angle inf"),
        ({"across_wind_deg": -1.0}, "--across-wind -1.0"),
        ({"across_wind_deg": float("nan")}, "--across-wind nan"),
        ({"angle_deg": 5.0, "across_wind_deg": 5.0}, "give one of them"),
    ],
)
def test_angles_that_are_none(options: dict[str, float], said: str) -> None:
    with pytest.raises(ConfigError, match=said):
        PlanOptions(**options)


def test_the_plan_takes_the_bearing() -> None:
    area = area_of(turned_box(600, 100, 50.0))
    wanted = {"robots": 1, "swath_m": 30.0, "clearance_m": 0.0, "method": "minmax", "fence": False}
    found = plan(area, PlanOptions(**wanted, time_budget_s=0.1))
    # slantwise lanes near 50° are as good
    assert off_deg(found.report.angle_deg, 50.0) < 16.0
    across = plan(area, PlanOptions(**wanted, across_wind_deg=320.0, time_budget_s=0.0))
    assert across.report.angle_deg == 50.0

"""The bearing of the lanes: candidates, ranking, options."""

from __future__ import annotations

import numpy as np
import pytest
import shapely

from mrmission.errors import ConfigError
from mrmission.minmax import angle
from mrmission.minmax.angle import BUDGET_SHARE, candidate_bearings, choose_bearing
from mrmission.minmax.slivers import look
from mrmission.model import FleetPlan
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
    assert max(t.round for t in one.tried) == 1  # no last round without the part's work
    best = max(one.tried, key=lambda t: (t.round, -t.makespan_s))
    assert one.bearing_deg == best.bearing_deg
    assert (1 - BUDGET_SHARE) * 0.4 - 1e-9 <= one.budget_left_s < 0.4


def test_a_side_that_is_nearly_at_a_whole_degree_is_followed_exactly() -> None:
    # its sides lie at 90.03: lanes at 90 would meet them at a slant
    found = candidate_bearings(turned_box(400, 300, 90.03), 10.0)
    assert 90.03 in found
    assert 90.0 not in found
    assert 0.03 in found


@pytest.mark.parametrize("off", [0.002, -0.002])
def test_a_side_a_hair_from_a_whole_degree_is_taken_for_it(off: float) -> None:
    found = candidate_bearings(turned_box(400, 300, 90.0 + off), 10.0)
    assert {0.0, 90.0} <= set(found)
    found = candidate_bearings(turned_box(300, 400, off), 10.0)
    assert {0.0, 90.0} <= set(found)


def slivers_by_hand(region: shapely.Polygon, column_x: np.ndarray, pitch: float) -> list[float]:
    """How far the water goes on beside each lane end: bit by bit along both borders."""
    out = []
    for x in column_x:
        lane = shapely.intersection(region, shapely.LineString([(x, -1e4), (x, 1e4)])).bounds
        for end, step in ((lane[1], -0.01), (lane[3], 0.01)):
            for side in (-0.499 * pitch, 0.499 * pitch):
                count = 0
                while shapely.contains_xy(region, x + side, end + step * (count + 0.5)):
                    count += 1
                out.append(max(0.0, float(np.hypot(side, 0.01 * count)) - 0.5 * pitch))
    return out


def test_slivers_are_those_at_the_borders_of_columns() -> None:
    rng = np.random.default_rng(11)
    for _ in range(5):
        region = shapely.MultiPoint(rng.uniform(0, 100, (8, 2))).convex_hull
        x_min, _, x_max, _ = region.bounds
        pitch = (x_max - x_min) / 9
        column_x = x_min + (np.arange(9) + 0.5) * pitch
        seen = look(region, column_x, pitch)
        assert np.array_equal(seen.x_m, column_x)
        by_hand = np.array(slivers_by_hand(region, column_x, pitch)).reshape(-1, 2, 2)
        by_hand[by_hand <= 0.005 * pitch] = 0.0
        assert seen.out_m == pytest.approx(by_hand, abs=0.1)


def test_no_slivers_are_left_along_straight_ends() -> None:
    seen = look(shapely.box(0, 0, 100, 50), np.arange(5.0, 100.0, 10.0), 10.0)
    assert not seen.out_m.any()
    assert seen.alone_m == 0.0


def test_half_of_what_lies_between_two_lanes_belongs_to_each() -> None:
    # an island 4 m high across the middle of the column only: water goes round it at both sides
    region = shapely.Polygon(
        shapely.box(0, 0, 10, 60).exterior, [shapely.box(3, 20, 7, 40).exterior]
    )
    seen = look(region, np.array([5.0]), 10.0)
    out = float(np.hypot(4.99, 10.0)) - 5.0
    assert seen.y_m.tolist() == [[0.0, 20.0], [40.0, 60.0]]
    assert seen.out_m[0] == pytest.approx(np.array([[0.0, 0.0], [out, out]]))
    assert seen.out_m[1] == pytest.approx(np.array([[out, out], [0.0, 0.0]]))


def test_water_without_a_lane_beside_is_told() -> None:
    # a bay along the border between the first two columns, met by neither lane
    bay = shapely.box(7, 40, 13, 70)
    region = shapely.union(
        shapely.box(0, 0, 20, 20), shapely.union(bay, shapely.box(9, 20, 11, 40))
    )
    seen = look(region, np.array([5.0, 15.0]), 10.0)
    assert len(seen.x_m) == 2
    assert seen.alone_m == pytest.approx(0.0)  # it hangs together with the water of the lanes
    island = look(shapely.MultiPolygon([shapely.box(0, 0, 20, 20), bay]), seen.x_m, 10.0)
    assert island.alone_m == pytest.approx(30.0)


def test_stairs_are_swept_along_their_steps() -> None:
    # seen from afar the shore runs slantwise, where each lane would leave a sliver at both ends
    steps = [(20.0 * (i // 2 + i % 2), 20.0 * (i // 2)) for i in range(20)]
    lake = shapely.Polygon([*steps, (190.0, 330.0), (-150.0, 330.0), (-150.0, 0.0)])
    home = np.array([[0.0, 150.0]])
    choice = choose_bearing(lake, Harbour(lake, home), home, TIME, 20.0, time_budget_s=0.0)
    assert min(off_deg(choice.bearing_deg, 0.0), off_deg(choice.bearing_deg, 90.0)) < 0.01


@pytest.fixture
def choices(monkeypatch: pytest.MonkeyPatch) -> list[angle.BearingChoice]:
    """What plans choose, as they do it."""
    seen: list[angle.BearingChoice] = []

    def spied(*args: object, **kwargs: object) -> angle.BearingChoice:
        seen.append(choose_bearing(*args, **kwargs))  # type: ignore[arg-type]
        return seen[-1]

    monkeypatch.setattr("mrmission.stages.part.choose_bearing", spied)
    return seen


def _turned_plan(budget_s: float) -> FleetPlan:
    options = PlanOptions(
        robots=2, swath_m=30.0, clearance_m=0.0, method="minmax", fence=False,
        time_budget_s=budget_s, separation_m=0.0,
    )  # fmt: skip
    return plan(area_of(turned_box(400, 300, 75.0)), options)


def test_the_last_round_knows_all_that_the_plan_knows(
    choices: list[angle.BearingChoice],
) -> None:
    found = _turned_plan(1.0)
    (choice,) = choices
    last = [t for t in choice.tried if t.round == 2]
    assert 2 <= len(last) <= angle.MOST_REAL + angle.FAIRWAYS_REAL
    best = min(last, key=lambda t: t.makespan_s)
    assert (choice.bearing_deg, choice.fairway) == (best.bearing_deg, best.fairway)
    assert {t.fairway for t in last} == {False, True}
    assert ("fairway" in {line.kind for line in found.report.lines}) == choice.fairway
    assert found.report.angle_deg == pytest.approx(choice.bearing_deg)
    # what was expected is what the plan takes, up to what a longer search finds
    assert found.report.makespan_s == pytest.approx(min(t.makespan_s for t in last), rel=0.05)


@pytest.mark.parametrize(
    ("budget_s", "kept_lines", "several"), [(0.5, 1500, False), (4.0, 1500, True), (4.0, 10, False)]
)
def test_works_that_came_near_are_kept_where_they_can_be_searched(
    budget_s: float,
    kept_lines: int,
    several: bool,
    choices: list[angle.BearingChoice],
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(angle, "KEPT_LINES", kept_lines)
    _turned_plan(budget_s)
    (choice,) = choices
    assert (len(choice.prepared) > 1) == several
    assert choice.prepared[0].work.sweep.frame.bearing_deg == choice.bearing_deg
    took_s = [ready.begun.cost.max() for ready in choice.prepared if ready.begun is not None]
    assert len(took_s) == len(choice.prepared)
    assert took_s == sorted(took_s)
    assert took_s[-1] <= angle.NEAR_BEST * took_s[0]


def test_ten_thousand_lanes_are_not_planned_to_choose() -> None:
    can = angle._affordable(angle.BUDGET_SHARE * 5.0, 10_000, 20, last_round=True)
    assert (can.planned, can.real) == (0, 0)
    few, many = (
        angle._affordable(angle.BUDGET_SHARE * 5.0, lanes, 20, last_round=True)
        for lanes in (300, 700)
    )
    assert few.planned >= 4
    assert min(few.real, many.real) >= 2
    assert few.real_search_s >= angle.REAL_SEARCH_S * 300
    assert many.real_search_s < angle.REAL_SEARCH_S * 700


def test_what_ranking_is_counted_for_is_no_more_than_its_share() -> None:
    for lanes in (10, 100, 300, 700, 2000):
        for share in (0.01, 0.1, 1.5, 2.5, 30.0):
            can = angle._affordable(share, lanes, 20, last_round=True)
            spent = can.planned * (can.search_s + angle._made_s(1, lanes))
            spent += can.real * (can.real_search_s + angle._made_s(2, lanes))
            assert spent <= share * (1 + 1e-9)


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

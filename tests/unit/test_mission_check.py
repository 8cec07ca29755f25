from __future__ import annotations

import dataclasses
import itertools
from fractions import Fraction

import numpy as np
import pytest
import shapely
from hypothesis import given, settings
from hypothesis import strategies as st

from mrmission.mission.check import check_fence, check_mission, navigation_path
from mrmission.mission.items import build_items
from mrmission.model import FencePolygon, Mission
from mrmission.options import PlanOptions, VehicleLimits

DEG = 1 / 111_320
"""A metre in degrees, at the equator."""


def square(x0: float, y0: float, x1: float, y1: float) -> shapely.Polygon:
    return shapely.box(x0 * DEG, y0 * DEG, x1 * DEG, y1 * DEG)


WATER = shapely.difference(square(0, 0, 1000, 1000), square(400, 400, 600, 600))


def mission(points: list[tuple[float, float]], fence: tuple[FencePolygon, ...] = ()) -> Mission:
    path = np.array(points) * DEG
    legs = len(points) - 1
    items, kind, lane = build_items(path, np.ones(legs), np.arange(legs), PlanOptions())
    return Mission(
        robot=1, sortie=1, vehicle="boat", items=items, fence=fence, rally=(), kind=kind, lane=lane
    )


def ring(points: list[tuple[float, float]], inclusion: bool) -> FencePolygon:
    e7 = np.array([(round(y * DEG * 1e7), round(x * DEG * 1e7)) for x, y in points])
    return FencePolygon(inclusion=inclusion, points_e7=e7)


ROUND = [(100.0, 100.0), (100.0, 900.0), (900.0, 900.0), (900.0, 100.0), (100.0, 100.0)]


def rules(m: Mission, **options: object) -> list[str]:
    return [v.rule for v in check_mission(m, WATER, **options)]  # type: ignore[arg-type]


def test_a_good_mission_has_no_violations() -> None:
    outer = ring([(0, 0), (1000, 0), (1000, 1000), (0, 1000)], True)
    inner = ring([(400, 400), (600, 400), (600, 600), (400, 600)], False)
    assert rules(mission(ROUND, (outer, inner)), clearance_m=50) == []
    assert (
        check_mission(
            Mission(robot=1, sortie=1, vehicle="boat", items=(), fence=(), rally=()), WATER
        )
        == ()
    )


def test_a_leg_over_an_island_is_found_and_measured() -> None:
    (found,) = check_mission(
        mission([(100, 500), (900, 500), (900, 100), (100, 100), (100, 500)]), WATER
    )
    assert found.rule == "water"
    assert found.value == pytest.approx(200, abs=1)
    assert found.item == 3


def test_the_clearance_counts_except_near_home() -> None:
    near_shore = [(100.0, 5.0), (100.0, 100.0), (300.0, 100.0), (100.0, 100.0), (100.0, 5.0)]
    assert rules(mission(near_shore), clearance_m=10) == []
    assert rules(mission(near_shore), clearance_m=10, launch_m=0) == ["water", "water"]
    far = [(100.0, 100.0), (500.0, 5.0), (100.0, 100.0)]
    assert rules(mission(far)) == []
    assert rules(mission(far), clearance_m=10) == ["water", "water"]


def test_tolerance_is_a_decimetre() -> None:
    assert rules(mission([(100, 100), (100, -0.05), (100, 100)])) == []
    assert rules(mission([(100, 100), (100, -0.25), (100, 100)])) == ["water", "water"]


def test_limits_and_order() -> None:
    limits = VehicleLimits(mission_items=5, fence_bytes=40, fence_polygon_points=4, rally_points=0)
    outer = ring([(0, 0), (1000, 0), (1000, 1000), (500, 1000), (0, 1000)], True)
    found = check_mission(mission(ROUND, (outer,)), WATER, limits=limits)
    assert [v.rule for v in found] == ["limits"] * 3
    assert [v.value for v in found] == [8, 42, 5]
    m = mission(ROUND)
    two = dataclasses.replace(m.items[3], current=1)
    assert rules(dataclasses.replace(m, items=(*m.items[:3], two, *m.items[4:]))) == ["items"]
    assert "items" in rules(dataclasses.replace(m, items=m.items[1:]))


def test_a_mission_that_ends_elsewhere() -> None:
    m = mission(ROUND)
    found = check_mission(dataclasses.replace(m, items=m.items[:-2]), WATER)
    assert [v.rule for v in found] == ["home"]
    assert found[0].value == pytest.approx(800, rel=0.01)


def test_the_fence_is_checked_exactly() -> None:
    path = np.array([[100, 100], [100, 900], [100, 100]])
    box = np.array([[0, 0], [0, 1000], [1000, 1000], [1000, 0]])

    def bad(dy: int) -> int:
        return len(
            check_fence([FencePolygon(inclusion=True, points_e7=box + np.array([dy, 0]))], path)
        )

    assert [bad(dy) for dy in (0, 99, 100, 101)] == [0, 0, 2, 3]
    out = FencePolygon(inclusion=False, points_e7=box // 10 + np.array([150, 10]))
    assert check_fence([out], path) == ()
    out = FencePolygon(inclusion=False, points_e7=box // 10 + np.array([0, 10]))
    assert [v.item for v in check_fence([out], path, [5, 6, 7])] == [6, 7]


def test_the_fence_across_the_antimeridian() -> None:
    half = 1_800_000_000
    path = np.array([[0, half - 50], [0, -half + 50]])
    box = np.array([[-9, half - 90], [9, half - 90], [9, -half + 90], [-9, -half + 90]])
    assert check_fence([FencePolygon(inclusion=True, points_e7=box)], path) == ()
    assert len(check_fence([FencePolygon(inclusion=False, points_e7=box)], path)) == 2


@settings(max_examples=150, deadline=None)
@given(
    st.lists(st.tuples(st.integers(0, 12), st.integers(0, 12)), min_size=1, max_size=4),
    st.lists(
        st.tuples(st.integers(0, 12), st.integers(0, 12)), min_size=3, max_size=7, unique=True
    ),
    st.booleans(),
)
def test_check_fence_agrees_with_rational_arithmetic(
    path: list[tuple[int, int]], corners: list[tuple[int, int]], inclusion: bool
) -> None:
    polygon = FencePolygon(inclusion=inclusion, points_e7=np.array(corners))
    violated = bool(check_fence([polygon], np.array(path)))
    edges = [(corners[i - 1], corners[i]) for i in range(len(corners))]
    touches = any(meet(p, q, a, b) for p, q in itertools.pairwise(path) for a, b in edges)
    single = len(path) == 1 and any(meet(path[0], path[0], a, b) for a, b in edges)
    if single:
        return  # a lone point on the edge is either
    inside = odd_crossings(path[0], edges)
    assert violated == (touches or inside != inclusion)


def meet(p, q, a, b) -> bool:
    def turn(u, v, w) -> int:
        value = (v[0] - u[0]) * (w[1] - u[1]) - (v[1] - u[1]) * (w[0] - u[0])
        return (value > 0) - (value < 0)

    def on(u, v, w) -> bool:
        return (
            turn(u, v, w) == 0
            and min(u[0], v[0]) <= w[0] <= max(u[0], v[0])
            and min(u[1], v[1]) <= w[1] <= max(u[1], v[1])
        )

    if turn(p, q, a) * turn(p, q, b) < 0 and turn(a, b, p) * turn(a, b, q) < 0:
        return True
    return on(p, q, a) or on(p, q, b) or on(a, b, p) or on(a, b, q)


def odd_crossings(p, edges) -> bool:
    """Shoot a ray in an odd direction that meets no corner of the small grid."""
    count = 0
    for a, b in edges:
        # ray p + t * (1000, 1), t > 0
        det = Fraction((b[0] - a[0]) * 1 - (b[1] - a[1]) * 1000)
        if det == 0:
            continue
        s = Fraction((p[0] - a[0]) * 1 - (p[1] - a[1]) * 1000) / det
        t = Fraction((p[0] - a[0]) * (b[1] - a[1]) - (p[1] - a[1]) * (b[0] - a[0])) / det
        count += 0 < s < 1 and t > 0 if s not in (0, 1) else 0
    return count % 2 == 1


def test_navigation_path_skips_commands() -> None:
    points, items = navigation_path(mission(ROUND))
    assert items == (0, 1, 3, 4, 5, 6, 7)
    assert points.shape == (7, 2)


def flight(vehicle: str = "copter", **options: object) -> Mission:
    chosen = PlanOptions(vehicle=vehicle, **options)  # type: ignore[arg-type]
    path = np.array(ROUND) * DEG
    items, kind, lane = build_items(path, np.array([0, 1, 0, 1]), np.array([0, 1, 0, 2]), chosen)
    return Mission(
        robot=1, sortie=1, vehicle=vehicle, items=items, fence=(), rally=(), kind=kind, lane=lane
    )


def changed(m: Mission, index: int, **changes: object) -> Mission:
    items = list(m.items)
    items[index] = dataclasses.replace(items[index], **changes)  # type: ignore[arg-type]
    return dataclasses.replace(m, items=tuple(items))


def without(m: Mission, index: int) -> Mission:
    items = [i for i in m.items if i.seq != index]
    items = [dataclasses.replace(i, seq=k) for k, i in enumerate(items)]
    return dataclasses.replace(m, items=tuple(items), kind=(), lane=())


@pytest.mark.parametrize("vehicle", ["boat", "rover", "copter"])
@pytest.mark.parametrize("photo_m", [0.0, 5.0])
def test_good_missions_of_every_vehicle(vehicle: str, photo_m: float) -> None:
    assert rules(flight(vehicle, trigger_distance_m=photo_m)) == []
    if vehicle == "copter":
        assert rules(flight(altitude_above="terrain", trigger_distance_m=photo_m)) == []


def test_a_copter_takes_off_first_and_comes_down_last() -> None:
    good = flight()
    assert rules(without(good, 1)) == ["items"]
    assert rules(without(good, len(good.items) - 1)) == ["items"]
    landing = changed(
        good, len(good.items) - 1, command=21, x=good.items[0].x, y=good.items[0].y, z=0.0
    )
    assert rules(landing) == []


def test_a_waypoint_on_the_ground_is_no_height_for_a_copter() -> None:
    (found,) = check_mission(changed(flight(), 4, z=0.0), WATER)
    assert (found.rule, found.item, found.value) == ("altitude", 4, 0.0)
    # on the water, 0 is what there is; above sea level, what 0 means depends on the place
    assert rules(changed(flight("boat"), 4, z=0.0)) == []
    assert rules(changed(flight(), 4, z=0.0, frame=0)) == []


@pytest.mark.parametrize("command", [21, 22, 82])
def test_what_a_boat_stores_and_does_not_execute(command: int) -> None:
    assert rules(changed(flight("boat"), 4, command=command)) == ["items"]
    assert rules(changed(flight("rover"), 4, command=command)) == ["items"]


def test_a_camera_that_stays_on() -> None:
    good = flight("boat", trigger_distance_m=5.0)
    switches = [i.seq for i in good.items if i.command == 206]
    (found,) = check_mission(without(good, switches[-1]), WATER)
    assert (found.rule, found.item) == ("camera", switches[-2])
    assert rules(changed(good, switches[0], param1=-1.0)) == ["camera"]
    # the first lane's camera is off too late: the second one switches it on again, no harm
    assert rules(without(good, switches[1])) == []


def test_a_copter_has_less_room_than_a_boat() -> None:
    path = np.array([(100.0 + 0.5 * i, 100.0) for i in range(649)] + [(100.0, 100.0)]) * DEG
    path[1:-1:2, 1] += DEG
    legs = len(path) - 1
    for vehicle, expected in (("boat", []), ("copter", ["limits"])):
        items, kind, lane = build_items(
            path, np.ones(legs), np.arange(legs), PlanOptions(vehicle=vehicle)
        )
        m = Mission(
            robot=1, sortie=1, vehicle=vehicle, items=items, fence=(), rally=(), kind=kind,
            lane=lane,
        )  # fmt: skip
        assert 650 < len(items) <= 655
        assert rules(m) == expected


def test_turns_of_a_copter_may_reach_over_the_shore_as_far_as_was_said() -> None:
    points = [(100.0, 100.0), (100.0, -20.0), (200.0, -20.0), (200.0, 100.0), (100.0, 100.0)]
    path = np.array(points) * DEG
    for vehicle, turnaround_m, expected in (
        ("copter", 0.0, ["water"] * 3),
        ("copter", 19.0, ["water"] * 3),
        ("copter", 20.5, []),
        ("boat", 20.5, ["water"] * 3),
    ):
        items, kind, lane = build_items(
            path, np.zeros(4), np.zeros(4, dtype=int), PlanOptions(vehicle=vehicle)
        )
        m = Mission(
            robot=1, sortie=1, vehicle=vehicle, items=items, fence=(), rally=(), kind=kind,
            lane=lane,
        )  # fmt: skip
        assert rules(m, turnaround_m=turnaround_m) == expected

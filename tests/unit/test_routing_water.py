"""In-water paths on areas small enough to know the answer."""

from __future__ import annotations

import math

import numpy as np
import pytest
import shapely

from mrmission.errors import PlanningError
from mrmission.routing.water import SNAP_M, WaterRouter

BASIN = shapely.box(0, 0, 100, 60)
ISLAND = shapely.box(40, 20, 60, 40)


def points(*pairs: tuple[float, float]) -> np.ndarray:
    return np.array(pairs, dtype=float).reshape(-1, 2)


def length(line: np.ndarray) -> float:
    return float(np.hypot(*np.diff(line, axis=0).T).sum())


@pytest.fixture
def lake() -> WaterRouter:
    return WaterRouter(BASIN.difference(ISLAND))


def test_open_water_is_a_straight_line() -> None:
    router = WaterRouter(BASIN)
    assert router.corner_count == 0
    assert router.distances(points((0, 0)), points((100, 60)))[0, 0] == math.hypot(100, 60)
    np.testing.assert_array_equal(
        router.path(points((0, 0))[0], points((100, 60))[0]), points((0, 0), (100, 60))
    )


def test_around_the_island(lake: WaterRouter) -> None:
    a, b = points((30, 30)), points((70, 30))
    want = 2 * math.hypot(10, 10) + 20
    assert lake.distances(a, b)[0, 0] == pytest.approx(want, abs=1e-9)
    assert lake.pair_distances(a, b)[0] == pytest.approx(want, abs=1e-9)
    (line,) = lake.paths(a, b)
    assert len(line) == 4
    assert length(line) == pytest.approx(want, abs=1e-9)
    assert not lake.visible(a, b)[0]


def test_along_the_shore_is_in_the_water(lake: WaterRouter) -> None:
    a = points((40, 20), (40, 20), (0, 20), (0, 0), (40, 20), (40, 10))
    b = points((60, 20), (60, 40), (100, 20), (0, 60), (40, 40), (40, 50))
    np.testing.assert_array_equal(lake.visible(a, b), [True, False, True, True, True, True])


def test_a_path_may_touch_a_corner(lake: WaterRouter) -> None:
    assert lake.visible(points((30, 30)), points((50, 10)))[0]
    assert not lake.visible(points((30, 30)), points((50, 10.001)))[0]


def test_all_answers_agree(lake: WaterRouter) -> None:
    spots = points((1, 1), (99, 59), (30, 30), (70, 30), (40, 20), (50, 20), (50, 40), (1, 1))
    matrix = lake.distance_matrix(spots)
    np.testing.assert_allclose(matrix, lake.distances(spots, spots), rtol=1e-14)
    np.testing.assert_allclose(matrix[:3], lake.distances(spots[:3], spots), rtol=1e-14)
    i, j = (side.ravel() for side in np.indices(matrix.shape))
    np.testing.assert_allclose(matrix.ravel(), lake.pair_distances(spots[i], spots[j]), rtol=1e-14)
    assert matrix[0, -1] == 0


def test_few_and_many_sources_agree() -> None:
    """Few sources look for the last corner of a path one by one, many in lists."""
    posts = [shapely.box(x, y, x + 6, y + 6) for x in range(5, 95, 10) for y in range(5, 55, 10)]
    router = WaterRouter(BASIN.difference(shapely.union_all(posts)))
    rng = np.random.default_rng(0)
    spots = np.floor(rng.uniform((0, 0), (100, 60), (30, 2)) / 10) * 10 + [2, 3]
    many = router.distances(spots, spots)
    few = np.vstack([router.distances(spots[i : i + 1], spots) for i in range(len(spots))])
    np.testing.assert_allclose(many, few, rtol=1e-14)
    np.testing.assert_allclose(many, router.distance_matrix(spots), rtol=1e-14)


def test_many_looks_find_the_same_to_the_last_digit(monkeypatch: pytest.MonkeyPatch) -> None:
    rng = np.random.default_rng(2)
    for seed in range(4):
        land = [
            shapely.Point(*rng.uniform((5, 5), (95, 55))).buffer(
                rng.uniform(1, 5), quad_segs=seed + 2
            )
            for _ in range(25)
        ]
        basin = BASIN.difference(shapely.union_all(land))
        router = WaterRouter(max(shapely.get_parts(basin), key=lambda part: part.area))
        spots = rng.uniform((0, 0), (100, 60), (300, 2))
        spots = spots[router.visible(spots, spots)]
        homes = np.concatenate(
            [spots[:1] + np.column_stack([np.arange(5)] * 2) * 1e-3, spots[5:14]]
        )
        homes = homes[router.visible(homes, homes)]
        monkeypatch.setattr("mrmission.routing.water.MANY_LOOKS", 10**9)
        usual = router.distances(homes, spots)
        monkeypatch.setattr("mrmission.routing.water.MANY_LOOKS", 0)
        assert np.array_equal(router.distances(homes, spots), usual)
        assert len(homes) > 8
        assert len(spots) > 150


def test_through_the_point_where_an_island_touches_the_shore() -> None:
    """The passage has no width, but a point of it is in the water."""
    diamond = shapely.Polygon([(50, 0), (60, 30), (50, 50), (40, 30)])
    router = WaterRouter(BASIN.difference(diamond))
    a, b = points((30, 0)), points((70, 0))
    assert router.visible(a, b)[0]
    assert router.pair_distances(a, b)[0] == 40
    assert router.pair_distances(points((45, 1)), points((55, 1)))[0] == pytest.approx(
        2 * math.hypot(5, 1)
    )


def test_collinear_and_repeated_vertices_do_not_count() -> None:
    region = BASIN.difference(ISLAND)
    fine = shapely.segmentize(region, 0.01)
    shell = np.repeat(shapely.get_coordinates(fine.exterior), 2, axis=0)
    router = WaterRouter(shapely.Polygon(shell, fine.interiors))
    assert router.corner_count == 4
    assert router.pair_distances(points((30, 30)), points((70, 30)))[0] == pytest.approx(
        2 * math.hypot(10, 10) + 20, abs=1e-6
    )


def test_a_staircase_sees_along_itself() -> None:
    """Every step touches the line over the corners, and none is in its way."""
    count = 50
    steps = [(0.0, 0.0)]
    for i in range(count):
        steps += [(i + 1.0, float(i)), (i + 1.0, i + 1.0)]
    router = WaterRouter(shapely.Polygon([*steps, (0.0, float(count))]))
    top = points((count, count))
    assert router.visible(points((0, 0)), top)[0]
    assert router.distances(points((0, 0)), top)[0, 0] == pytest.approx(count * math.sqrt(2))
    below = points((7, 6))
    want = math.hypot(0, 1) + math.hypot(count - 7, count - 7)
    assert router.distances(below, top)[0, 0] == pytest.approx(want)


def test_points_on_land_are_taken_to_the_shore(lake: WaterRouter) -> None:
    outside = points((40.01, 30), (-0.01, 30))
    on_shore = points((40, 30), (0, 30))
    np.testing.assert_allclose(lake.distance_matrix(outside), lake.distance_matrix(on_shore))
    assert lake.visible(outside[:1], points((40, 20)))[0]
    line = lake.path(outside[0], points((70, 30))[0])
    np.testing.assert_array_equal(line[0], outside[0])


@pytest.mark.parametrize("spot", [(50, 30), (-1, 5), (100 + 1.1 * SNAP_M, 5), (1e9, 0)])
def test_points_far_on_land_are_refused(lake: WaterRouter, spot: tuple[float, float]) -> None:
    with pytest.raises(PlanningError, match=rf"east {spot[0]:.3f} m, north {spot[1]:.3f} m"):
        lake.distances(points((1, 1)), points((2, 2), spot))


def test_not_a_number_is_refused(lake: WaterRouter) -> None:
    with pytest.raises(PlanningError, match="not a number"):
        lake.paths(points((math.nan, 1)), points((1, 1)))


def test_as_many_starts_as_ends(lake: WaterRouter) -> None:
    with pytest.raises(ValueError, match="not 1 and 2"):
        lake.pair_distances(points((1, 1)), points((1, 1), (2, 2)))


@pytest.mark.parametrize(
    "region",
    [
        shapely.MultiPolygon([BASIN, shapely.box(200, 0, 210, 10)]),
        shapely.Polygon(),
        shapely.LineString([(0, 0), (1, 1)]),
    ],
)
def test_only_one_polygon(region: shapely.Geometry) -> None:
    with pytest.raises(PlanningError, match="one polygon"):
        WaterRouter(region)


def test_a_multipolygon_of_one_part_will_do() -> None:
    assert WaterRouter(shapely.MultiPolygon([BASIN])).corner_count == 0


def test_nothing_asked_nothing_answered(lake: WaterRouter) -> None:
    none = np.empty((0, 2))
    assert lake.distances(none, points((1, 1))).shape == (0, 1)
    assert lake.distance_matrix(none).shape == (0, 0)
    assert lake.pair_distances(none, none).shape == (0,)
    assert lake.paths(none, none) == []
    assert lake.visible(none, none).shape == (0,)


def test_inputs_stay_as_they_are(lake: WaterRouter) -> None:
    spots = points((40.01, 30), (70, 30))
    spots.setflags(write=False)
    lake.distance_matrix(spots)
    lake.paths(spots[:1], spots[1:])
    np.testing.assert_array_equal(spots, points((40.01, 30), (70, 30)))


def test_same_answer_twice() -> None:
    region = BASIN.difference(ISLAND)
    spots = np.random.default_rng(1).uniform(1, 19, (40, 2))
    first, second = WaterRouter(region), WaterRouter(region)
    assert first.distance_matrix(spots).tobytes() == second.distance_matrix(spots).tobytes()


def test_far_from_the_origin_and_wide() -> None:
    """A spiral corridor 10 cm wide, 300 km from the frame's origin."""
    turns = shapely.LineString(
        [(0, 0), (50, 0), (50, 50), (1, 50), (1, 1), (49, 1), (49, 49), (2, 49), (2, 2)]
    )
    wall = turns.buffer(0.45, join_style="mitre", cap_style="square")
    region = shapely.affinity.translate(shapely.box(-5, -5, 55, 55).difference(wall), 3e5, -3e5)
    router = WaterRouter(region)
    line = router.path(np.array([3e5 + 25, -3e5 + 25]), np.array([3e5 - 4, -3e5 + 25]))
    allowed = region.buffer(1e-6)
    assert allowed.covers(shapely.LineString(line))
    assert length(line) > 100

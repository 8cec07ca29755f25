"""Transits that keep off the berths of other boats."""

from __future__ import annotations

import numpy as np
import pytest
import shapely
from lakes import random_lake_m

from mrmission.routing.harbour import KEEP_OFF_M, Harbour
from mrmission.routing.water import WaterRouter

# twelve corners on the circle: the middle of an edge is this much nearer to the berth
INRADIUS = np.cos(np.pi / 12)


def random_points(rng: np.random.Generator, region: shapely.Polygon, count: int) -> np.ndarray:
    x_min, y_min, x_max, y_max = region.bounds
    points: list[tuple[float, float]] = []
    while len(points) < count:
        xy = rng.uniform([x_min, y_min], [x_max, y_max])
        if region.contains(shapely.Point(xy)):
            points.append(tuple(xy))
    return np.array(points)


def spread_berths(rng: np.random.Generator, region: shapely.Polygon, count: int) -> np.ndarray:
    """Berths 15 m apart in the middle of things, where they are most in the way."""
    centre = shapely.get_coordinates(region.representative_point())[0]
    lattice = centre + 15.0 * np.stack(np.meshgrid(range(-3, 4), range(-3, 4)), -1).reshape(-1, 2)
    inner = region.buffer(-8)
    lattice = lattice[shapely.contains_xy(inner, lattice[:, 0], lattice[:, 1])]
    return lattice[rng.permutation(len(lattice))[:count]]


def keeps_off(path: np.ndarray, berths: np.ndarray, radius: np.ndarray) -> np.ndarray:
    return shapely.LineString(path).distance(shapely.points(berths)) >= radius * INRADIUS - 0.02


@pytest.mark.parametrize("seed", range(10))
def test_transits_keep_off_every_berth(seed: int) -> None:
    rng = np.random.default_rng(seed)
    region = random_lake_m(rng, 250.0, int(rng.integers(0, 4)))
    berths = spread_berths(rng, region, 7)
    harbour = Harbour(region, berths)
    if len(berths) > 1:
        assert (harbour.radius_m == KEEP_OFF_M).all()
    clear = region.difference(shapely.union_all(shapely.buffer(shapely.points(berths), 5.5)))
    clear = max(shapely.get_parts(clear), key=lambda p: p.area)
    a, b = random_points(rng, clear, 25), random_points(rng, clear, 25)
    paths = harbour.paths(a, b)
    lengths = harbour.pair_distances(a, b)
    water = region.buffer(1e-3)
    for p, q, path, length in zip(a, b, paths, lengths, strict=True):
        assert (path[0] == p).all()
        assert (path[-1] == q).all()
        assert water.covers(shapely.LineString(path))
        # the shortest, but for small bends drawn together
        assert length - 1e-6 <= np.hypot(*np.diff(path, axis=0).T).sum() <= 1.05 * length + 1
        assert keeps_off(path, berths, harbour.radius_m).all()
    plain = WaterRouter(region).pair_distances(a, b)
    assert (lengths >= plain - 1e-6).all()


@pytest.mark.parametrize("seed", range(10))
def test_homes_are_reached_past_the_others(seed: int) -> None:
    rng = np.random.default_rng(100 + seed)
    region = random_lake_m(rng, 250.0, int(rng.integers(0, 4)))
    berths = spread_berths(rng, region, 6)
    harbour = Harbour(region, berths)
    clear = region.difference(shapely.union_all(shapely.buffer(shapely.points(berths), 5.5)))
    targets = random_points(rng, max(shapely.get_parts(clear), key=lambda p: p.area), len(berths))
    water = region.buffer(1e-3)
    ways = harbour.home_paths(range(len(berths)), targets)
    for robot, (way, target) in enumerate(zip(ways, targets, strict=True)):
        assert (way[0] == berths[robot]).all()
        assert (way[-1] == target).all()
        assert water.covers(shapely.LineString(way))
        others = np.arange(len(berths)) != robot
        assert keeps_off(way, berths[others], harbour.radius_m[others]).all()


def test_points_inside_a_disc_get_out_and_in() -> None:
    region = shapely.box(-100, -100, 100, 100)
    berths = np.array([[0.0, 0.0], [30.0, 0.0]])
    harbour = Harbour(region, berths)
    a = np.array([[1.0, 1.0], [0.0, 0.0], [50.0, 50.0], [29.0, 0.0]])
    b = np.array([[60.0, 60.0], [30.0, 0.0], [0.0, 2.0], [-1.0, -1.0]])
    for p, q, path in zip(a, b, harbour.paths(a, b), strict=True):
        assert (path[0] == p).all()
        assert (path[-1] == q).all()
        assert region.covers(shapely.LineString(path))
    # a target within the own disc is reached straight
    (way,) = harbour.home_paths([0], np.array([[2.0, 1.0]]))
    assert way.tolist() == [[0.0, 0.0], [2.0, 1.0]]


def test_discs_shrink_where_there_is_no_room_and_water_stays_whole() -> None:
    # a corridor 6 m wide: a disc of 5 m would shut it
    corridor = shapely.box(0, 0, 200, 6)
    berths = np.array([[x, 3.0] for x in (20.0, 60.0, 100.0)])
    harbour = Harbour(corridor, berths)
    assert (harbour.radius_m <= 2.5).all()
    ends = np.array([[1.0, 3.0]]), np.array([[199.0, 3.0]])
    assert harbour.pair_distances(*ends)[0] < 205
    # one so narrow that nothing fits: no discs, and still a way
    ditch = shapely.box(0, 0, 200, 2)
    narrow = Harbour(ditch, berths * [1, 1 / 3])
    assert (narrow.radius_m == 0).all()
    assert narrow.pair_distances(np.array([[1.0, 1.0]]), np.array([[199.0, 1.0]]))[0] < 199
    (way,) = narrow.home_paths([1], np.array([[150.0, 1.0]]))
    assert way[0].tolist() == [60.0, 1.0]


def test_close_and_equal_berths() -> None:
    region = shapely.box(-50, -50, 50, 50)
    for gap in (0.0, 0.5, 2.0, 6.0, 9.0):
        berths = np.array([[0.0, 0.0], [gap, 0.0]])
        harbour = Harbour(region, berths)
        assert (2 * harbour.radius_m <= gap).all()
        for way in harbour.home_paths([0, 1], np.array([[30.0, 20.0], [-30.0, 5.0]])):
            assert region.covers(shapely.LineString(way))


def test_one_boat_needs_no_disc_and_no_boat_needs_no_way() -> None:
    region = shapely.box(-50, -50, 50, 50)
    harbour = Harbour(region, np.array([[0.0, 0.0]]))
    assert harbour.radius_m.tolist() == [0.0]
    assert harbour.paths(np.zeros((0, 2)), np.zeros((0, 2))) == []
    assert harbour.pair_distances(np.zeros((0, 2)), np.zeros((0, 2))).shape == (0,)
    assert harbour.home_paths([], np.zeros((0, 2))) == []


def test_a_berth_on_the_shore() -> None:
    region = shapely.box(0, 0, 100, 100)
    harbour = Harbour(region, np.array([[0.0, 50.0], [15.0, 50.0], [0.0, 65.0]]))
    assert harbour.radius_m[0] == 0
    ways = harbour.home_paths([0, 1, 2], np.array([[90.0, 50.0], [90.0, 51.0], [90.0, 52.0]]))
    for way in ways:
        assert region.buffer(1e-6).covers(shapely.LineString(way))
    assert keeps_off(ways[0], np.array([[15.0, 50.0]]), harbour.radius_m[1:2]).all()


def test_a_place_in_a_disc_needs_no_way_to_itself() -> None:
    berths = np.array([[0.0, 0.0], [30.0, 0.0]])
    harbour = Harbour(shapely.box(-100, -100, 100, 100), berths)
    assert harbour.radius_m[1] > 1.0
    inside = berths[1:] + 0.5
    (way,) = harbour.paths(inside, inside)
    assert way.tolist() == np.concatenate([inside, inside]).tolist()

"""Travel between lane ends: against all pairs and brute force."""

from __future__ import annotations

import numpy as np
import pytest
import shapely

from mrmission.minmax.travel import NEAR, Travel, floors_m, travel_between, travel_m
from mrmission.routing.harbour import Harbour
from mrmission.routing.water import WaterRouter, curve_order
from mrmission.tour.sweep import sweep_region
from tests.lakes import random_lake_m


def lake_with_ends(seed: int, spacing_m: float) -> tuple[Harbour, np.ndarray]:
    """A drawn lake and the ends of its lanes."""
    lake = random_lake_m(np.random.default_rng(seed), 1000.0, 8, corners=24)
    sweep = sweep_region(lake, 20.0 * seed, spacing_m)
    home = shapely.get_coordinates(lake.representative_point())
    return Harbour(lake, home), sweep.frame.to_local(sweep.lane_ends_m()).reshape(-1, 2)


@pytest.fixture(scope="module")
def lake() -> tuple[Harbour, np.ndarray, Travel, np.ndarray]:
    harbour, ends = lake_with_ends(3, 8.0)
    return harbour, ends, travel_between(harbour, ends, dense_ends=0), harbour.distance_matrix(ends)


def test_few_ends_have_all_lengths() -> None:
    harbour, ends = lake_with_ends(1, 40.0)
    travel = travel_between(harbour, ends)
    assert travel.arrays is None
    assert travel.dense_m is not None
    np.testing.assert_array_equal(travel.dense_m, harbour.distance_matrix(ends))
    np.testing.assert_array_equal(travel.dense_m, travel.dense_m.T)


@pytest.mark.parametrize("dense_ends", [0, 100_000])
def test_nearest_ends_are_the_nearest_of_other_lanes(
    lake: tuple[Harbour, np.ndarray, Travel, np.ndarray], dense_ends: int
) -> None:
    harbour, ends, _, exact = lake
    travel = travel_between(harbour, ends, dense_ends=dense_ends)
    here = np.arange(len(ends))
    assert (travel.near >> 1 != here[:, None] >> 1).all()
    others = exact.copy()
    others[here, here] = others[here, here ^ 1] = np.inf
    nearest = np.sort(others, axis=1)[:, :NEAR]
    np.testing.assert_allclose(travel.near_m, nearest, atol=1e-9)
    np.testing.assert_allclose(exact[here[:, None], travel.near], nearest, atol=1e-9)


def test_all_within_reach_are_listed_and_exact(
    lake: tuple[Harbour, np.ndarray, Travel, np.ndarray],
) -> None:
    _, ends, travel, exact = lake
    assert travel.arrays is not None
    end, _, start, other, length_m, _ = travel.arrays
    row = np.repeat(np.arange(len(ends)), np.diff(start))
    np.testing.assert_allclose(length_m, exact[row, other], rtol=1e-6, atol=1e-6)
    listed = np.zeros(exact.shape, dtype=bool)
    listed[row, other] = True
    np.fill_diagonal(listed, True)
    assert (exact[~listed] > np.repeat(end[:, 3], len(ends)).reshape(exact.shape)[~listed]).all()
    assert not listed.all()  # there is something to estimate


def test_far_lengths_are_close_symmetric_and_never_below_the_straight_line(
    lake: tuple[Harbour, np.ndarray, Travel, np.ndarray],
) -> None:
    _, ends, travel, exact = lake
    assert travel.arrays is not None
    e, f = np.random.default_rng(0).integers(0, len(ends), (2, 20_000))
    e, f = e[e != f], f[e != f]
    pairs = list(zip(e.tolist(), f.tolist(), strict=True))
    found = np.array([travel_m(travel.arrays, a, b) for a, b in pairs])
    np.testing.assert_array_equal(found, [travel_m(travel.arrays, b, a) for a, b in pairs])
    straight = np.hypot(*(ends[e] - ends[f]).T)
    assert (found >= straight * (1 - 1e-6) - 1e-4).all()
    off = np.abs(found - exact[e, f])
    assert 0 < off.sum() < 0.01 * exact[e, f].sum()
    assert np.quantile(off, 0.99) < 0.05 * exact.mean()


@pytest.mark.parametrize("seed", [2, 3, 5])
def test_no_way_is_shorter_than_its_floor(seed: int) -> None:
    harbour, ends = lake_with_ends(seed, 8.0)
    travel = travel_between(harbour, ends, dense_ends=0)
    assert travel.arrays is not None
    which = np.random.default_rng(seed).permutation(len(ends))[: 3 * len(ends) // 4]
    exact_m = harbour.distance_matrix(ends[which])
    floor_m, exact = floors_m(travel.arrays, which)
    np.testing.assert_array_equal(floor_m, floor_m.T)
    np.testing.assert_array_equal(exact, exact.T)
    assert (floor_m <= exact_m + 1e-9).all()
    np.testing.assert_allclose(floor_m[exact], exact_m[exact], rtol=2e-6)
    straight_m = np.hypot(*(ends[which][:, None] - ends[which][None]).transpose(2, 0, 1))
    start, other = travel.arrays[2:4]
    for i in range(0, len(which), 9):
        listed = np.isin(which, other[start[which[i]] : start[which[i] + 1]])
        assert (listed <= exact[i]).all()
    far = ~exact
    np.fill_diagonal(far, False)
    assert (floor_m >= straight_m * (1 - 2e-6)).all()
    assert floor_m[far].sum() > 0.98 * exact_m[far].sum()
    # the ways between clusters tell of land on the way
    bent = far & (exact_m > 1.05 * straight_m)
    assert (floor_m - straight_m)[bent].sum() > 0.7 * (exact_m - straight_m)[bent].sum() > 0


def test_same_ends_same_arrays() -> None:
    harbour, ends = lake_with_ends(2, 12.0)
    first, again = (travel_between(harbour, ends, dense_ends=0) for _ in range(2))
    assert first.arrays is not None
    assert again.arrays is not None
    for a, b in zip(first.arrays, again.arrays, strict=True):
        np.testing.assert_array_equal(a, b)


def test_ends_within_reach_by_brute_force() -> None:
    lake = random_lake_m(np.random.default_rng(7), 600.0, 6, corners=14)
    rng = np.random.default_rng(8)
    points = rng.uniform(-300, 300, (400, 2))
    points = points[shapely.contains_xy(lake, points)][:80]
    router = WaterRouter(lake)
    reach = rng.uniform(5.0, 250.0, len(points))
    (start, other, length), used = router.lengths_within(points, reach, 3)
    assert (used >= reach).all()
    exact = np.array([[router.path(a, b) for b in points] for a in points[:12]], dtype=object)
    for i, ways in enumerate(exact):
        metres = np.array([np.hypot(*np.diff(way, axis=0).T).sum() for way in ways])
        mine = other[start[i] : start[i + 1]]
        wanted = np.flatnonzero(metres <= used[i])
        np.testing.assert_array_equal(mine, wanted[wanted != i])
        np.testing.assert_allclose(length[start[i] : start[i + 1]], metres[mine], atol=1e-9)
        assert len(mine) >= 3


def test_triangle_inequality_holds_exactly(
    lake: tuple[Harbour, np.ndarray, Travel, np.ndarray],
) -> None:
    exact = lake[3]
    rng = np.random.default_rng(1)
    a, b, c = rng.integers(0, len(exact), (3, 100_000))
    assert (exact[a, c] <= exact[a, b] + exact[b, c] + 1e-9).all()


def test_last_corners_lie_on_the_shortest_ways() -> None:
    harbour, ends = lake_with_ends(2, 60.0)
    length, last, corner_m = harbour.last_corners(ends)
    np.testing.assert_allclose(length, harbour.distance_matrix(ends), atol=1e-9)
    for i in range(0, len(ends), 7):
        for j in range(len(ends)):
            way = harbour.router.path(ends[i], ends[j])
            if last[i, j] < 0:
                assert np.hypot(*(ends[j] - ends[i])) == pytest.approx(length[i, j], abs=1e-6)
            else:
                np.testing.assert_allclose(corner_m[last[i, j]], way[-2], atol=1e-6)


def test_neighbours_on_the_curve_lie_together() -> None:
    points = np.random.default_rng(0).uniform(0, 1, (500, 2))
    order = curve_order(points)
    np.testing.assert_array_equal(np.sort(order), np.arange(500))
    along = np.hypot(*np.diff(points[order], axis=0).T).mean()
    assert along < 0.2 * np.hypot(*np.diff(points, axis=0).T).mean()
    assert len(curve_order(points[:0])) == 0

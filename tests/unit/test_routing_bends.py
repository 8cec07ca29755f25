"""Fewer waypoints, still in the water, hardly longer."""

from __future__ import annotations

import numpy as np
import pytest
import shapely

from mrmission.routing.bends import MAX_DETOUR_M, MAX_DETOUR_SHARE, straighten
from mrmission.routing.water import WaterRouter


def _length(way: np.ndarray) -> float:
    return float(np.hypot(*np.diff(way, axis=0).T).sum())


@pytest.mark.parametrize("seed", range(12))
def test_bends_go_and_the_way_stays_in_the_water(seed: int) -> None:
    rng = np.random.default_rng(seed)
    lake = shapely.box(0, 0, 1000, 1000)
    for _ in range(6):
        x, y = rng.uniform(150, 850, 2)
        lake = lake.difference(shapely.Point(x, y).buffer(rng.uniform(20, 120), quad_segs=16))
    lake = max(getattr(lake, "geoms", [lake]), key=lambda part: part.area)
    router = WaterRouter(lake)
    ends = rng.uniform(0, 1000, (60, 2))
    ends = ends[shapely.contains_xy(lake, *ends.T)]
    ends = ends[: len(ends) // 2 * 2].reshape(-1, 2, 2)
    ways = router.paths(ends[:, 0], ends[:, 1])
    fewer = straighten(ways, router.visible)
    water = lake.buffer(1e-6)
    for old, new in zip(ways, fewer, strict=True):
        assert np.array_equal(old[[0, -1]], new[[0, -1]])
        assert len(new) <= len(old)
        allowed = max(MAX_DETOUR_M, MAX_DETOUR_SHARE * _length(old))
        assert _length(old) - 1e-9 <= _length(new) <= _length(old) + allowed + 1e-9
        assert water.covers(shapely.LineString(new))
    bends = sum(len(way) - 2 for way in ways if len(way) > 3)
    assert sum(len(way) - 2 for way in fewer) < sum(len(way) - 2 for way in ways) - 0.4 * bends


def test_straight_ways_and_empty_lists_stay() -> None:
    way = np.array([[0.0, 0.0], [5.0, 0.0]])
    assert straighten([], lambda a, b: np.ones(len(a), dtype=bool)) == []
    assert straighten([way], lambda a, b: np.ones(len(a), dtype=bool))[0] is way


def test_land_outside_a_bend_keeps_it() -> None:
    way = np.array([[0.0, 0.0], [11.0, 0.0], [12.0, 1.0], [12.0, 12.0]])
    blocked = straighten([way], lambda a, b: np.zeros(len(a), dtype=bool))
    free = straighten([way], lambda a, b: np.ones(len(a), dtype=bool))
    assert len(blocked[0]) == 4
    assert free[0].tolist() == [[0.0, 0.0], [12.0, 0.0], [12.0, 12.0]]


def test_ways_looked_at_together_are_as_one_by_one() -> None:
    rng = np.random.default_rng(4)
    ways = [np.cumsum(rng.uniform(0, 5, (n, 2)), axis=0) for n in rng.integers(2, 40, 60)]

    def visible(a: np.ndarray, b: np.ndarray) -> np.ndarray:
        return np.hypot(*(b - a).T) % 1.0 < 0.7

    together = straighten(ways, visible)
    alone = [straighten([way], visible)[0] for way in ways]
    assert sum(len(way) for way in together) < sum(len(way) for way in ways)
    assert all(np.array_equal(a, b) for a, b in zip(together, alone, strict=True))

"""Ways by hooks: what a way does not cover it visits, and it visits nothing else."""

from __future__ import annotations

import numpy as np
import pytest
import shapely

from mrmission.minmax.hooks import Hooks
from mrmission.minmax.ways import hooked_ways, straight


def _hooks(rng: np.random.Generator, ends_m: np.ndarray, reach_m: float) -> Hooks:
    of_end, points, hulls = [0], [], []
    for end in ends_m:
        for _ in range(int(rng.integers(0, 3))):
            spot = end + rng.uniform(-1.2, 1.2, 2) * reach_m
            around = spot + rng.uniform(-0.4, 0.4, (5, 2)) * reach_m
            points.append(spot[None] if rng.random() < 0.7 else np.array([spot, spot + 1.0]))
            hulls.append(shapely.get_coordinates(shapely.MultiPoint(around).convex_hull)[:-1])
        of_end.append(len(points))
    none = np.zeros((0, 2))

    def starts(lists: list[np.ndarray]) -> np.ndarray:
        return np.concatenate([[0], np.cumsum([len(x) for x in lists])]).astype(np.int64)

    return Hooks(
        of_end=np.array(of_end),
        point_start=starts(points),
        points_m=np.concatenate([none, *points]),
        hull_start=starts(hulls),
        hull_m=np.concatenate([none, *hulls]),
        reach_m=reach_m,
    )


@pytest.mark.parametrize("seed", range(8))
def test_every_hook_is_visited_or_covered(seed: int) -> None:
    rng = np.random.default_rng(seed)
    ends = rng.uniform(0, 40, (30, 2))
    hooks = _hooks(rng, ends, 5.0)
    first = rng.integers(0, 30, 60)
    last = rng.integers(-1, 30, 60)
    target = np.where((last >= 0)[:, None], ends[last], [20.0, 60.0])
    start, points = straight(ends[first], target)
    ways = hooked_ways(first, last, start, points, hooks)
    spared = 0
    for i in range(len(ways)):
        way = ways.way(i)
        assert np.array_equal(way[0], ends[first[i]])
        assert np.array_equal(way[-1], target[i])
        rows = {tuple(p) for p in way.tolist()}
        asked = 0
        for end in (first[i], last[i]):
            for h in range(hooks.of_end[end], hooks.of_end[end + 1]) if end >= 0 else ():
                mine = hooks.points_m[hooks.point_start[h] : hooks.point_start[h + 1]]
                visited = all(tuple(p) in rows for p in mine.tolist())
                hull = shapely.MultiPoint(
                    hooks.hull_m[hooks.hull_start[h] : hooks.hull_start[h + 1]]
                )
                legs = [shapely.LineString(way[j : j + 2]) for j in range(len(way) - 1)]
                seen = any(max(leg.distance(p) for p in hull.geoms) <= 5.0 + 1e-9 for leg in legs)
                assert visited or seen
                asked += len(mine)
                spared += not visited
        assert len(way) <= 2 + asked
    assert spared > 0


def test_ways_that_cover_nothing_visit_every_hook() -> None:
    rng = np.random.default_rng(3)
    ends = rng.uniform(0, 40, (10, 2))
    hooks = _hooks(rng, ends, 5.0)
    first, last = np.arange(0, 10, 2), np.arange(1, 10, 2)
    start, points = straight(ends[first], ends[last])
    ways = hooked_ways(first, last, start, points, hooks, always=True)
    assert (ways.hooked > 0).sum() == len(hooks.points_m)
    assert np.array_equal(np.diff(ways.start).sum(), 10 + len(hooks.points_m))


def test_a_bent_way_keeps_its_bends() -> None:
    way = np.array([[0.0, 0.0], [3.0, 4.0], [10.0, 4.0]])
    hooks = Hooks(
        of_end=np.array([0, 1, 1]), point_start=np.array([0, 1]), points_m=np.array([[-2.0, 0.0]]),
        hull_start=np.array([0, 1]), hull_m=np.array([[-4.0, 0.0]]), reach_m=2.5,
    )  # fmt: skip
    got = hooked_ways(np.array([0]), np.array([1]), np.array([0, 3]), way, hooks)
    assert got.way(0).tolist() == [[0.0, 0.0], [-2.0, 0.0], [3.0, 4.0], [10.0, 4.0]]
    assert got.hooked.tolist() == [0, 1, 0, 0]
    back = hooked_ways(np.array([1]), np.array([0]), np.array([0, 3]), way[::-1], hooks)
    assert back.way(0).tolist() == [[10.0, 4.0], [3.0, 4.0], [-2.0, 0.0], [0.0, 0.0]]
    assert back.hooked.tolist() == [0, 0, 2, 0]

"""The area bound is below every plan, and meets the best one where that is known."""

from __future__ import annotations

import math

import numpy as np
import pytest
import shapely

from mrmission.partition.bound import fleet_area_bound_s


def area_bound_s(covered_m2: float, swath: float, robots: int, speed: float) -> float:
    """The bound of robots that are alike."""
    return fleet_area_bound_s(covered_m2, [swath] * robots, [speed] * robots)


def test_a_disc_is_covered_by_a_point() -> None:
    assert area_bound_s(math.pi * 10**2, 20.0, 1, 2.0) == pytest.approx(0.0, abs=1e-9)
    assert area_bound_s(1.0, 20.0, 1, 2.0) == 0.0


def test_a_stadium_is_covered_by_its_spine() -> None:
    # the parallel body of a segment of 300 m: the bound is exactly the segment
    stadium = 300.0 * 20.0 + math.pi * 10**2
    assert area_bound_s(stadium, 20.0, 1, 1.5) == pytest.approx(200.0)


def test_a_corridor_by_the_known_optimum() -> None:
    # 1000 x 20 m at swath 20: from end to end less what the footprint reaches ahead is needed;
    # the corners of the ends ask for the whole spine
    bound_m = area_bound_s(1000.0 * 20.0, 20.0, 1, 1.0)
    assert 980.0 < bound_m <= 1000.0
    for robots in (2, 4, 10):
        spine_m = 1000.0 / robots  # each has its own stretch
        assert area_bound_s(20_000.0, 20.0, robots, 1.0) <= spine_m


def test_never_above_any_walk() -> None:
    rng = np.random.default_rng(3)
    for _ in range(150):
        swath = float(rng.uniform(1, 30))
        robots = int(rng.integers(1, 5))
        walks = [
            shapely.LineString(rng.uniform(-50, 50, (int(rng.integers(2, 9)), 2)))
            for _ in range(robots)
        ]
        # a circle outside the true disc, so that the area is not too small
        covered = shapely.union_all([w.buffer(swath / 2, quad_segs=64) for w in walks])
        longest_s = max(w.length for w in walks) / 2.5
        assert area_bound_s(covered.area, swath, robots, 2.5) <= longest_s + 1e-9


def test_more_robots_need_less_time_and_more_area_more() -> None:
    bounds = [area_bound_s(1e5, 10.0, k, 2.0) for k in range(1, 12)]
    assert bounds == sorted(bounds, reverse=True)
    assert area_bound_s(2e5, 10.0, 3, 2.0) > area_bound_s(1e5, 10.0, 3, 2.0)

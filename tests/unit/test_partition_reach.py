"""The reach bound is below every tour, and meets the best one where that is known."""

from __future__ import annotations

import math

import numpy as np
import pytest
import shapely

from mrmission.area.region import default_start
from mrmission.model import FloatArray
from mrmission.partition.bound import fleet_area_bound_s
from mrmission.partition.reach import Rover, fleet_reach_bound_s


def reach_bound_m(
    region: shapely.Polygon, homes: FloatArray, swath: float, robots: int, missed_m2: float = 0.0
) -> float:
    """The bound of robots that are alike, at 1 m/s."""
    rover = Rover(swath_m=swath, top_speed_m_s=1.0, trip_m=math.inf, swap_s=0.0)
    return fleet_reach_bound_s(region, homes, [rover] * robots, missed_m2)


def test_a_bay_costs_the_way_to_its_end_and_back() -> None:
    # at swath 20 a bay of 1000 x 20 m is swept in 1980 m: to 10 m before the end, and back
    bay = shapely.box(0, 0, 1000, 20)
    bound = reach_bound_m(bay, np.array([[0.0, 10.0]]), 20.0, 1)
    assert 1970.0 < bound <= 1980.0
    # more robots do not shorten the way to the end
    assert reach_bound_m(bay, np.array([[0.0, 10.0]]), 20.0, 7) > 1960.0
    # from the middle, two robots each have half
    two = reach_bound_m(bay, np.array([[500.0, 10.0]]), 20.0, 2)
    assert 970.0 < two <= 980.0


def test_the_nearest_home_counts() -> None:
    bay = shapely.box(0, 0, 1000, 20)
    homes = np.array([[0.0, 10.0], [1000.0, 10.0]])
    bound = reach_bound_m(bay, homes, 20.0, 2)
    assert 950.0 < bound <= 980.0  # each sweeps its half: 490 m out, and back


def test_what_may_be_missed_counts() -> None:
    bay = shapely.box(0, 0, 1000, 20)
    home = np.array([[0.0, 10.0]])
    whole = reach_bound_m(bay, home, 20.0, 1)
    assert reach_bound_m(bay, home, 20.0, 1, missed_m2=4000.0) <= 2 * 780.0 + 20.0
    assert whole > 1900.0
    assert reach_bound_m(bay, home, 20.0, 1, missed_m2=1e6) == 0.0


def test_never_above_any_walk() -> None:
    """Walks from their homes and back sweep a region that is what they cover, islands included."""
    rng = np.random.default_rng(11)
    tight = []
    for _ in range(120):
        swath = float(rng.uniform(2, 30))
        robots = int(rng.integers(1, 5))
        homes = rng.uniform(-5, 5, (robots, 2))
        walks = []
        for home in homes:
            points = rng.uniform(-100, 100, (int(rng.integers(1, 8)), 2))
            points *= rng.uniform(0.1, 2.0, 2)
            walks.append(shapely.LineString(np.vstack([home, points, home])))
        covered = shapely.union_all([w.buffer(swath / 2) for w in walks])
        if covered.geom_type != "Polygon":
            continue
        longest = max(w.length for w in walks)
        bound = reach_bound_m(covered, homes, swath, robots)
        assert bound <= longest + 1e-6
        tight.append(bound / longest)
    assert len(tight) > 80
    assert max(tight) > 0.8  # the test would not notice a bound that says nothing


def test_never_above_any_walks_of_unlike_robots_in_trips() -> None:
    rng = np.random.default_rng(5)
    reach, area = [], []
    for _ in range(120):
        robots = int(rng.integers(1, 4))
        homes = rng.uniform(-5, 5, (robots, 2))
        swept, rovers, longest_s = [], [], 0.0
        for home in homes:
            swath, speed = float(rng.uniform(2, 30)), float(rng.uniform(0.5, 4))
            swap_s = float(rng.choice([0.0, 30.0, 200.0]))
            trips = []
            for _ in range(int(rng.integers(1, 4))):
                points = rng.uniform(-100, 100, (int(rng.integers(1, 6)), 2))
                points *= rng.uniform(0.05, 2.0, 2)
                trips.append(shapely.LineString(np.vstack([home, points, home])))
            # a circle outside the true disc, so that the area is not too small
            swept += [trip.buffer(swath / 2, quad_segs=64) for trip in trips]
            metres = [trip.length for trip in trips]
            longest_s = max(longest_s, sum(metres) / speed + swap_s * (len(trips) - 1))
            limited = rng.integers(2) or len(trips) > 1
            trip_m = max(metres) if limited else math.inf
            rovers.append(Rover(swath_m=swath, top_speed_m_s=speed, trip_m=trip_m, swap_s=swap_s))
        covered = shapely.union_all(swept)
        if covered.geom_type != "Polygon":
            continue
        reach.append(fleet_reach_bound_s(covered, homes, rovers) / longest_s)
        area.append(
            fleet_area_bound_s(
                covered.area, [r.swath_m for r in rovers], [r.top_speed_m_s for r in rovers]
            )
            / longest_s
        )
    assert len(reach) > 80
    # tests that would not notice bounds that say nothing
    assert 0.8 < max(reach) <= 1 + 1e-9
    assert 0.5 < max(area) <= 1 + 1e-9


def test_never_above_a_spiral_that_wastes_nothing() -> None:
    """Straight out and back on a line: every metre counts, and the bound comes near."""
    for length in (50.0, 300.0, 3000.0):
        spine = shapely.LineString([(0, 0), (length, 0)])
        region = spine.buffer(5.0, quad_segs=32)
        bound = reach_bound_m(region, np.array([[0.0, 0.0]]), 10.0, 1)
        assert 0.95 * 2 * length - 15.0 < bound <= 2 * length


@pytest.mark.parametrize("robots", [1, 3, 12])
def test_near_the_start_it_is_the_area_bound(robots: int) -> None:
    disc = shapely.Point(0, 0).buffer(500.0)
    home = default_start(disc)[None]
    reach = reach_bound_m(disc, home, 4.0, robots)
    area = fleet_area_bound_s(disc.area, [4.0] * robots, [1.0] * robots)
    assert reach > 0.99 * area
    assert reach < 2 * 1000.0 + math.pi * 500**2 / (4.0 * robots)

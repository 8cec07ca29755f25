"""Tours with more items than robots hold count for what further trips would take."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import shapely
from part_works import part_work

from mrmission.minmax.full import more_trips_s
from mrmission.minmax.planner import prepare
from mrmission.minmax.search import minmax
from mrmission.options import PlanOptions, VehicleLimits
from mrmission.tour.work import PartWork


def work_of(items: int) -> PartWork:
    """Twenty lanes of 300 m for two robots that start a kilometre away, and hold so many items."""
    water = shapely.union_all([shapely.box(0, 0, 400, 300), shapely.box(400, 140, 1400, 160)])
    asked = PlanOptions(
        robots=2, swath_m=20.0, overlap=0.0, clearance_m=0.0, time_budget_s=0.1,
        limits=VehicleLimits(mission_items=items),
    )  # fmt: skip
    homes = np.array([[1390.0, 145.0], [1390.0, 155.0]])
    return part_work(water, homes, asked, spacing_m=20.0)


def test_a_trip_more_for_each_memory_that_is_full() -> None:
    ready = prepare(work_of(655))
    tours = minmax(ready.problem, 0.1, 0)
    more_s = [
        more_trips_s(replace(ready, work=work_of(items)), tours).max()
        for items in (655, 400, 80, 40)
    ]
    assert more_s[:2] == [0.0, 0.0]
    assert 0.0 < more_s[2] < more_s[3]
    # each further trip is a way out and home
    longest_s, shortest_s = ready.problem.home_cost.max(), ready.problem.home_cost.min()
    assert 2 * shortest_s <= more_s[2] <= 10 * longest_s


def test_robots_without_work_need_no_trip() -> None:
    ready = prepare(work_of(10))
    tours = minmax(ready.problem, 0.0, 0)
    everything = np.concatenate(tours.entries)
    idle = replace(tours, entries=(everything, np.zeros(0, dtype=np.int64)))
    assert more_trips_s(ready, idle)[1] == 0.0
    assert more_trips_s(ready, idle)[0] > 0.0

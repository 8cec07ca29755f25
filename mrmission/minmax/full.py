"""What tours with more items than their robots hold may cost, for choosing among lays of lanes.

A robot whose tour has more mission items than its memory goes out once more for each memory full.
That is decided when tours are laid and exported (:mod:`mrmission.stages.sorties`); here it is only
foreseen, so that of two bearings the one with fewer and longer lanes is taken where items bind.
"""

from __future__ import annotations

import numpy as np

from mrmission.minmax.planner import Prepared, laid
from mrmission.minmax.problem import LaneTours
from mrmission.minmax.trip_items import ITEMS_PER_LINE, turning
from mrmission.mission.items import count_items
from mrmission.model import FloatArray

NEAR_FULL = 0.6
"""Below this share of the memories, at `ITEMS_PER_LINE`, items are not looked at."""
ROOM = 0.97
"""Share of a memory that tours may fill: what covers the rest comes on top."""


def more_trips_s(ready: Prepared, tours: LaneTours) -> FloatArray:
    """Return (robots,) about the seconds of further trips that each robot's items would need.

    Each further trip counts as one way out and home, to the middle one of the robot's line ends.
    """
    work, problem = ready.work, ready.problem
    own = [work.options.of_robot(robot) for robot in work.robots]
    held = np.array([options.limits.mission_items for options in own], dtype=np.float64)
    out = np.zeros(len(own))
    if ITEMS_PER_LINE * len(ready.lines) < NEAR_FULL * held.sum():
        return out
    paths, _ = laid(tours, ready.lines, ready.hooks, work)
    for r, (path, mine) in enumerate(zip(paths, tours.entries, strict=True)):
        if len(mine):
            trips = np.ceil(count_items(turning(path), own[r]) / (ROOM * held[r]))
            out[r] = (trips - 1) * 2.0 * float(np.median(problem.home_cost[r, mine]))
    return out

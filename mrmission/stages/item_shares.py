"""Items shared out: where one robot's memory is too small for its tour and another's has room.

The planner evens out time. A robot with many short lanes may then have more mission items than its
vehicle holds, while others have room. Before it is sent out twice, the lanes are shared out anew,
each counting some seconds more than it takes, so that robots with many give some away.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from mrmission.minmax.trip_items import ITEMS_PER_LINE
from mrmission.stages.trip_search import Planner
from mrmission.stages.trip_work import TripWork
from mrmission.tour.work import PartPlan

TOLLS = (0.12, 0.18, 0.25, 0.35, 0.5, 0.7, 1.0)
"""What the lanes of a full memory count, against the longest tour; the least that does is taken."""
BUDGET_SHARE = 0.4
"""Of the time budget, for each of them."""
MOST_FULL = 0.98
"""Where all memories together would be fuller than this, it is not tried."""


def items_shared_out(base: TripWork, planner: Planner, room: float = 1.0) -> PartPlan | None:
    """Return the part planned again so that every tour fits its robot's memory.

    Parameters
    ----------
    base
        The part, with tours of which one has too many items.
    planner
        What shares out lines.
    room
        How far memories should be filled, for what covers the rest to fit; plans that fill them
        more are taken where there is no other.

    Returns
    -------
    PartPlan or None
        None where a battery may bind, all memories together are too small, or none of the plans
        that are tried has every tour in its memory and the last robot home before trips would.
    """
    whole, work = base.whole, base.work
    if not base.endless or len(work.robots) < 2:
        return None
    held = np.array([gauge.allowance.items for gauge in base.gauges])
    items = np.array(base.planned(whole)) * held
    if items.sum() > MOST_FULL * room * held.sum():
        return None
    in_trips = base.plan_of(base.cut_tours([room] * len(items)))
    latest_s = base.makespan_s(in_trips)
    budget_s = BUDGET_SHARE * work.options.time_budget_s
    tight: PartPlan | None = None  # fits as planned, without room for what covers the rest
    for toll in TOLLS:
        line_s = toll * base.makespan_s(whole) * ITEMS_PER_LINE / float(held.min())
        again = replace(
            work,
            line_toll_s=line_s,
            options=replace(work.options, time_budget_s=budget_s),
        )
        found = PartPlan(work=work, tours=planner(again))
        full = max(base.planned(found))
        if full > 1.0 or base.makespan_s(found) > latest_s:
            continue
        if full <= room:
            return found
        tight = tight or found
    return tight

"""What no plan can beat: the bounds of the whole fleet, from those of its parts."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

from mrmission.minmax.bounds.lanes import LanesBound
from mrmission.minmax.line_bound import trips_bound
from mrmission.minmax.trips import Allowance
from mrmission.options import PlanOptions
from mrmission.partition.bound import fleet_area_bound_s
from mrmission.partition.reach import Rover, fleet_reach_bound_s
from mrmission.stages.export import Coverage
from mrmission.tour.coverage import total_area
from mrmission.tour.work import PartPlan

AREA_BOUND = "area bound"
REACH_BOUND = "reach bound"


@dataclass(frozen=True, slots=True, kw_only=True, order=True)
class Bound:
    """A time that nothing of some kind can beat, and the name of the term it comes from."""

    seconds: float
    name: str

    def gap(self, makespan_s: float) -> float:
        """Return makespan over bound, minus 1; infinite where the bound says nothing."""
        if self.seconds <= 0:
            return math.inf if makespan_s > 0 else 0.0
        return makespan_s / self.seconds - 1


def any_plan_bound(parts: Sequence[PartPlan], coverage: Sequence[Coverage]) -> Bound:
    """Return the bound that holds for any plan whatever that covers as much.

    The last part to be done decides, so it is the largest bound of any part.
    """
    found = []
    for part, covered in zip(parts, coverage, strict=True):
        found.append(Bound(seconds=_area_s(part, covered), name=AREA_BOUND))
        if part.work.options.vehicle != "copter":  # which may fly over land
            found.append(Bound(seconds=_reach_s(part, covered), name=REACH_BOUND))
    return max(found, key=lambda b: b.seconds)


def chosen_lanes_bound(parts: Sequence[PartPlan]) -> Bound | None:
    """Return the bound that holds for any plan of the chosen lines; None where none is known."""
    found = [_lanes_bound(part) for part in parts]
    known = [Bound(seconds=bound.makespan_s, name=bound.term) for bound in found if bound]
    return max(known, key=lambda b: b.seconds, default=None)


def _lanes_bound(part: PartPlan) -> LanesBound | None:
    """Return the bound for a part's lines; trips sweep others than the tours they were made of."""
    if part.tours.lanes_bound is None:
        return None
    if part.work.in_trips:
        return trips_bound(part.work, part.tours.paths)
    return part.tours.lanes_bound()


def _area_s(part: PartPlan, covered: Coverage) -> float:
    """Return the area bound; each robot counts with its own speed and its own swath."""
    return fleet_area_bound_s(
        covered.covered_m2,
        [own.swath_m for own in _own(part)],
        [time.top_speed_m_s for time in part.work.times],
    )


def _reach_s(part: PartPlan, covered: Coverage) -> float:
    """Return the reach bound, of trips where robots must come home in between."""
    work = part.work
    missed = max(0.0, total_area([work.region_m]) - covered.covered_m2)
    robots = []
    for own, time in zip(_own(part), work.times, strict=True):
        allowed = Allowance.of(own)
        robots.append(
            Rover(
                swath_m=own.swath_m,
                top_speed_m_s=time.top_speed_m_s,
                trip_m=min(allowed.metres, allowed.seconds * time.top_speed_m_s),
                swap_s=own.swap_time_s,
            )
        )
    bound_s = fleet_reach_bound_s(work.region_m, work.homes_m, robots, missed)
    # endless only by a hair: a plan exists, so its trips do reach
    return bound_s if math.isfinite(bound_s) else 0.0


def _own(part: PartPlan) -> list[PlanOptions]:
    return [part.work.options.of_robot(robot) for robot in part.work.robots]

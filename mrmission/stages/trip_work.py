"""The work of one part as trips: what each may use, and the part with a robot for each trip."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import replace

from mrmission.minmax.trips import Allowance, Gauge, TripCutter, as_it_is
from mrmission.mission.build import Route
from mrmission.model import CoveragePath, FloatArray
from mrmission.tour.turnaround import with_turnarounds
from mrmission.tour.turns import Turns
from mrmission.tour.work import PartPlan, PartWork


class TripWork:
    """Measures and cuts the trips of one part.

    Parameters
    ----------
    whole
        The part with one tour for each robot.

    Attributes
    ----------
    row
        Where each robot, by its number, stands among those of the part.
    own
        The options as they are for each of them.
    gauges
        What a trip of each of them uses.
    """

    def __init__(self, whole: PartPlan) -> None:
        self.whole = whole
        self.work = whole.work
        self.row = {robot: i for i, robot in enumerate(self.work.robots)}
        self.own = [self.work.options.of_robot(robot) for robot in self.work.robots]
        self.gauges = [
            Gauge(allowance=Allowance.of(own), time=time, options=own, shaped=_shape(self.work))
            for own, time in zip(self.own, self.work.times, strict=True)
        ]

    @property
    def endless(self) -> bool:
        """Return whether no battery binds any robot; memories may."""
        return all(gauge.allowance.endless for gauge in self.gauges)

    def planned(self, part: PartPlan) -> list[float]:
        """Return what each path uses of its robot's allowance, before the rest is covered."""
        return [
            self.gauges[self.row[robot]].used(path)
            for robot, path in zip(part.work.robots, part.tours.paths, strict=True)
        ]

    def measured(self, part: PartPlan, routes: Sequence[Route]) -> list[float]:
        """Return what each route uses of its robot's allowance, as it is exported."""
        return [
            replace(self.gauges[self.row[robot]], shaped=as_it_is, exported=True).used(route.path)
            for robot, route in zip(part.work.robots, routes, strict=True)
        ]

    def fit(self, part: PartPlan, routes: Sequence[Route]) -> bool:
        """Return whether no route uses more than its robot's allowance."""
        return max(self.measured(part, routes)) <= 1.0

    def used_as_sailed(self, row: int, path: CoveragePath) -> float:
        """Return what a path uses of the allowance of the robot of a row, its turns included."""
        return replace(self.gauges[row], shaped=as_it_is).used(self.as_sailed(row, path))

    def as_sailed(self, row: int, path: CoveragePath) -> CoveragePath:
        """Return a path of the robot of a row with its runs, and its arcs if it has a radius."""
        if self.work.times[row].turn_radius_m <= 0:
            return self.gauges[row].shaped(path)
        return Turns(self.work).turned(row, path)

    def full_s(self, row: int) -> float:
        """Return how long a full trip of a robot takes, s."""
        allowance, own = self.gauges[row].allowance, self.own[row]
        return min(allowance.seconds, allowance.metres / own.survey_speed_m_s)

    def busy_s(self, row: int, trips: int) -> float:
        """Return how long so many full trips of a robot take, s."""
        return trips * self.full_s(row) + (trips - 1) * self.own[row].swap_time_s

    def endurance_used(self, part: PartPlan) -> float:
        """Return the largest share of its endurance that a trip uses; items are not counted."""
        out = 0.0
        for robot, path in zip(part.work.robots, part.tours.paths, strict=True):
            gauge = self.gauges[self.row[robot]]
            battery = replace(gauge.allowance, items=math.inf)
            out = max(out, replace(gauge, allowance=battery).used(path))
        return out

    def makespan_s(self, part: PartPlan) -> float:
        """Return when the last robot is home from its last trip, swaps in between included."""
        busy = [-own.swap_time_s for own in self.own]
        for robot, path in zip(part.work.robots, part.tours.paths, strict=True):
            row = self.row[robot]
            time = self.work.times[row]
            busy[row] += time.duration_s(path.points_m, path.kind) + self.own[row].swap_time_s
        return max(busy)

    def cutter(self, row: int, path: CoveragePath, allowed: float) -> TripCutter:
        """Return what cuts a path of the robot of a row into trips that use `allowed` at most."""
        own = replace(path, robot=row + 1)
        return TripCutter(own, self.home_ways(row), self.gauges[row], allowed)

    def home_ways(self, row: int) -> Callable[[FloatArray], list[FloatArray]]:
        """Return what gives the ways from the home of the robot of a row to (n, 2) points."""
        return lambda points_m: self.work.harbour.home_paths([row] * len(points_m), points_m)

    def cut_tours(self, allowed: Sequence[float]) -> list[list[CoveragePath]]:
        """Return the trips of each robot that its tour is cut into."""
        paths = self.whole.tours.paths
        return [self.cutter(row, path, allowed[row]).trips() for row, path in enumerate(paths)]

    def plan_of(self, trips: Sequence[Sequence[CoveragePath]]) -> PartPlan:
        """Return the part with these trips of each robot."""
        owners = [row for row, mine in enumerate(trips) for _ in mine]
        paths = tuple(
            replace(path, robot=number)
            for number, path in enumerate((p for mine in trips for p in mine), start=1)
        )
        return PartPlan(
            work=self.work.of_rows(owners), tours=replace(self.whole.tours, paths=paths)
        )


def _shape(work: PartWork) -> Callable[[CoveragePath], CoveragePath]:
    """Return what becomes of a path before it is exported."""
    options = work.options
    run_in_m, run_out_m = options.runs_m
    if max(run_in_m, run_out_m) <= 0:
        return as_it_is
    limits = None if options.vehicle == "copter" else work.region_m
    return lambda path: with_turnarounds(path, run_in_m, limits, run_out_m)

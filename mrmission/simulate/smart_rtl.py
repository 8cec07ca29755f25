"""SmartRTL: the way that a vehicle has come, kept as crumbs, and gone back along them."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

from mrmission.simulate.motion import offset_m
from mrmission.simulate.wire import mavlink

if TYPE_CHECKING:
    from mrmission.simulate.autopilot import Autopilot

Crumb = tuple[float, float]
"""Latitude, longitude in degrees."""
SIMPLIFY_SHARE = 0.5
"""A crumb is left away where the way without it strays by less than this share of SRTL_ACCURACY."""
PRUNE_SHARE = 0.5
"""Two crumbs within this share of the accuracy close a loop, which is cut out."""


class Crumbs:
    """The crumbs of one vehicle: every SRTL_ACCURACY metres one, at most SRTL_POINTS.

    Parameters
    ----------
    pilot : Autopilot
        Whose way is kept.
    """

    def __init__(self, pilot: Autopilot) -> None:
        self.pilot = pilot
        self.points: list[Crumb] = []
        self.active = False

    def begin(self) -> None:
        """Begin anew from here: the vehicle has been armed."""
        self.points = [(self.pilot.boat.lat, self.pilot.boat.lon)]
        self.active = True

    def look(self) -> None:
        """Drop a crumb where the last one is far enough away."""
        if not self.active:
            return
        here = (self.pilot.boat.lat, self.pilot.boat.lon)
        accuracy_m = self.pilot.parameters["SRTL_ACCURACY"]
        if _metres(self.points[-1], here) < accuracy_m:
            return
        self.points.append(here)
        most = int(self.pilot.parameters["SRTL_POINTS"])
        if len(self.points) >= most:
            self.points = cleaned(self.points, accuracy_m)
            if len(self.points) >= most:
                self.active = False
                self.pilot.say(mavlink.MAV_SEVERITY_WARNING, "SmartRTL deactivated: buffer full")

    def way_home(self) -> list[Crumb]:
        """Return the points to go through, the last one first to be reached at the end."""
        here = (self.pilot.boat.lat, self.pilot.boat.lon)
        return cleaned([*self.points, here], self.pilot.parameters["SRTL_ACCURACY"])[:-1]


def cleaned(points: list[Crumb], accuracy_m: float) -> list[Crumb]:
    """Return a way without loops and without points that a straight line does not need.

    Parameters
    ----------
    points : list of (lat, lon)
        In the order in which they were passed.
    accuracy_m : float
        SRTL_ACCURACY.
    """
    return _simplified(_pruned(points, PRUNE_SHARE * accuracy_m), SIMPLIFY_SHARE * accuracy_m)


def _pruned(points: list[Crumb], near_m: float) -> list[Crumb]:
    kept: list[Crumb] = []
    index = 0
    while index < len(points):
        kept.append(points[index])
        # The last later crumb at the same place: what lies between is a loop.
        for later in range(len(points) - 1, index + 1, -1):
            if _metres(points[index], points[later]) <= near_m:
                index = later
                break
        index += 1
    if kept and kept[-1] != points[-1]:
        kept.append(points[-1])
    return kept


def _simplified(points: list[Crumb], tolerance_m: float) -> list[Crumb]:
    if len(points) < 3:
        return points
    keep = {0, len(points) - 1}
    open_ends = [(0, len(points) - 1)]
    while open_ends:
        first, last = open_ends.pop()
        worst_m, worst = 0.0, first
        for index in range(first + 1, last):
            away = _from_line_m(points[index], points[first], points[last])
            if away > worst_m:
                worst_m, worst = away, index
        if worst_m > tolerance_m:
            keep.add(worst)
            open_ends += [(first, worst), (worst, last)]
    return [points[index] for index in sorted(keep)]


def _metres(a: Crumb, b: Crumb) -> float:
    return math.hypot(*offset_m(*a, *b))


def _from_line_m(point: Crumb, start: Crumb, end: Crumb) -> float:
    e, n = offset_m(*start, *point)
    to_e, to_n = offset_m(*start, *end)
    square = to_e * to_e + to_n * to_n
    t = 0.0 if square == 0 else min(1.0, max(0.0, (e * to_e + n * to_n) / square))
    return math.hypot(e - t * to_e, n - t * to_n)

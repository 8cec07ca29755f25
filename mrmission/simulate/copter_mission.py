"""How a simulated copter executes a mission: take-off, waypoints in three dimensions, landing."""

from __future__ import annotations

from typing import TYPE_CHECKING

from mrmission.simulate.copter_motion import Vector
from mrmission.simulate.execution import MissionExecution, MissionState, SubMode
from mrmission.simulate.storage import Item, is_navigation
from mrmission.simulate.wire import mavlink

if TYPE_CHECKING:
    from mrmission.simulate.copter import CopterPilot

INFO = mavlink.MAV_SEVERITY_INFO
WAYPOINT, LOITER_UNLIM, LOITER_TIME = 16, 17, 19
RETURN, LAND, TAKEOFF, SPLINE, DELAY = 20, 21, 22, 82, 93
PASSED_ON_TO = frozenset({WAYPOINT, LOITER_UNLIM, LOITER_TIME})
"""A waypoint before one of these is passed without a stop."""


class CopterExecution(MissionExecution):
    """The mission that a copter flies in AUTO.

    Parameters
    ----------
    pilot : CopterPilot
        Whose copter is flown, and who speaks.

    Notes
    -----
    Splines are flown as straight legs; circles (NAV_LOITER_TURNS) are skipped.
    """

    def __init__(self, pilot: CopterPilot) -> None:
        super().__init__(pilot)
        self.copter = pilot

    def begins_with_takeoff(self) -> bool:
        """Return whether the next navigation command is a take-off."""
        seq = self._next_navigation(self.current or 1)
        return seq is not None and self.copter.mission.items[seq].command in (TAKEOFF, 84)

    def _start(self, seq: int) -> bool:
        """Start a navigation command; False where a copter does not execute it."""
        pilot = self.copter
        item = pilot.mission.items[seq]
        self._command = item
        pilot.arrived_s = None
        self._since_s = pilot.time_s
        self._announce(seq, item)
        if item.command in (WAYPOINT, LOITER_UNLIM, LOITER_TIME, SPLINE):
            end = self._place(item)
            pilot.fly_to(end, self._beyond(seq, item, end))
            pilot.submode = SubMode.WAYPOINT
        elif item.command in (TAKEOFF, 84):
            pilot.take_off(item.z)
            pilot.submode = SubMode.STOP
        elif item.command == RETURN:
            pilot.head_home()
        elif item.command == LAND:
            pilot.submode = SubMode.RETURN
            pilot.land(self._place(item) if item.x or item.y else None)
        elif item.command == DELAY:
            pilot.loiter()
            pilot.say(INFO, f"Delaying {int(item.param1)} sec")
        else:
            return False
        return True

    def _place(self, item: Item, before: Vector | None = None) -> Vector:
        """Return where an item lies; what it leaves out is as before it."""
        pilot = self.copter
        east, north, up = before or (
            pilot.route.end if pilot.route.reached and pilot.submode is SubMode.WAYPOINT
            else pilot.here
        )  # fmt: skip
        if item.x or item.y:
            east, north, _ = pilot.place(item.x * 1e-7, item.y * 1e-7, 0.0)
        return east, north, item.z if item.z else up

    def _beyond(self, seq: int, item: Item, end: Vector) -> Vector | None:
        """Return where the way goes on after a waypoint, None where the copter stops at it."""
        if item.command not in (WAYPOINT, SPLINE) or item.param1 > 0:
            return None
        following = self._next_navigation(seq + 1)
        if following is None:
            return None
        after = self.copter.mission.items[following]
        return self._place(after, end) if after.command in PASSED_ON_TO else None

    def _navigation_done(self, item: Item) -> bool:
        pilot = self.copter
        command = item.command
        if command in (WAYPOINT, LOITER_UNLIM, LOITER_TIME, SPLINE):
            if command == LOITER_UNLIM or not pilot.armed or not pilot.on_route_reached:
                return False
            if pilot.arrived_s is None:
                pilot.arrived_s = pilot.time_s
            if pilot.time_s - pilot.arrived_s < item.param1:
                return False
            pilot.say(INFO, f"Reached command #{self.current}")
            return True
        if command in (TAKEOFF, 84):
            return pilot.armed and pilot.took_off
        if command in (RETURN, LAND):
            return pilot.armed and pilot.has_landed
        if command == DELAY:
            return pilot.time_s - self._since_s > item.param1
        return not is_navigation(command)

    def _complete(self) -> None:
        self.state = MissionState.COMPLETE
        if self.copter.flying:
            self.copter.loiter()
        else:
            self.copter.disarm()

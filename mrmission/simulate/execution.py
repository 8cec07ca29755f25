"""How a mission is executed: which command runs, when it is done, what comes next.

A navigation command takes the boat somewhere; do and condition commands between two navigation
commands run beside it. The first of them runs before the navigation command starts, which is why a
change of speed as the first item is lost on a boat: it still loiters then.
"""

from __future__ import annotations

import enum
import math
from typing import TYPE_CHECKING

from mrmission.simulate.motion import Leg, moved, offset_m
from mrmission.simulate.storage import Item, has_position, is_navigation
from mrmission.simulate.wire import mavlink

if TYPE_CHECKING:
    from mrmission.simulate.autopilot import Autopilot

MANUAL = 0

CRITICAL = mavlink.MAV_SEVERITY_CRITICAL
NOTICE = mavlink.MAV_SEVERITY_NOTICE
INFO = mavlink.MAV_SEVERITY_INFO


NAMES: dict[int, str] = {
    16: "WP",
    17: "LoitUnlim",
    18: "LoitTurns",
    19: "LoitTime",
    20: "RTL",
    21: "Land",
    22: "Takeoff",
    30: "ContinueAndChangeAlt",
    31: "LoitAltitude",
    82: "SplineWP",
    83: "AltitudeWait",
    84: "VTOLTakeoff",
    85: "VTOLLand",
    92: "GuidedEnable",
    93: "Delay",
    94: "PayloadPlace",
    112: "CondDelay",
    114: "CondDist",
    115: "CondYaw",
    177: "Jump",
    178: "ChangeSpeed",
    179: "SetHome",
    181: "SetRelay",
    182: "RepeatRelay",
    183: "SetServo",
    184: "RepeatServo",
    188: "ReturnPathStart",
    189: "LandStart",
    193: "PauseContinue",
    194: "SetReverse",
    201: "SetROI",
    202: "DigiCamCfg",
    203: "DigiCamCtrl",
    205: "MountControl",
    206: "SetCamTrigDst",
    207: "FenceEnable",
    211: "Gripper",
    213: "SetYawSpd",
    215: "SetRepeatDist",
    216: "Sprayer",
    218: "AuxFunction",
    222: "GuidedLimits",
}
"""What ArduPilot calls the commands when it tells that one begins."""


class MissionState(enum.IntEnum):
    """States of a mission, with their MISSION_STATE numbers."""

    STOPPED = mavlink.MISSION_STATE_NOT_STARTED
    RUNNING = mavlink.MISSION_STATE_ACTIVE
    COMPLETE = mavlink.MISSION_STATE_COMPLETE


class SubMode(enum.Enum):
    """What AUTO is doing."""

    WAYPOINT = enum.auto()
    LOITER = enum.auto()
    STOP = enum.auto()
    CIRCLE = enum.auto()
    RETURN = enum.auto()


class MissionExecution:
    """The mission that a boat sails in AUTO.

    Parameters
    ----------
    pilot : Autopilot
        Whose boat is steered, and who speaks.
    """

    def __init__(self, pilot: Autopilot) -> None:
        self.pilot = pilot
        self.state = MissionState.STOPPED
        self.current = 0
        """Number of the navigation command that is executed or would be resumed; 0 is none."""
        self._command: Item | None = None
        self._do: tuple[int, Item] | None = None
        self._do_next = 0
        self._do_since_s = 0.0
        self._resume_from = 0
        self._jumps: dict[int, int] = {}
        self._starting = False
        self._since_s = 0.0
        self._circled_rad = 0.0
        self._revision = pilot.mission.revision
        self._watched: tuple[Item, ...] = ()

    def enter(self) -> None:
        """Begin with the next :meth:`update`: the boat has changed to AUTO."""
        self._starting = True

    def leave(self) -> None:
        """Stop: the boat has left AUTO."""
        if self.state is MissionState.RUNNING:
            self.state = MissionState.STOPPED

    def update(self) -> None:
        """Look at changed items and finished commands, and go on."""
        mission = self.pilot.mission
        if self._starting:
            self._starting = False
            self._revision = mission.revision
            self.start_or_resume()
        elif mission.revision != self._revision:
            self._revision = mission.revision
            self.notice_change()
        if self.state is MissionState.RUNNING and mission.count() > 0:
            self.verify()

    def set_current(self, seq: int, *, restart: bool = False) -> bool:
        """Make `seq` the item to execute next (or now, in a running mission)."""
        count = self.pilot.mission.count()
        if seq >= count or count <= 1:
            return False
        if restart:
            self._jumps.clear()
        if seq == 0 or self.state is MissionState.COMPLETE:
            self._jumps.clear()
            seq = max(seq, 1)
        if self.state is MissionState.RUNNING:
            return self._advance(seq)
        found = self._next_navigation(seq)
        if found is None:
            return False
        self.current = found
        # The do commands before it run when the mission goes on.
        self._resume_from = seq
        self.state = MissionState.STOPPED
        return True

    def start_or_resume(self) -> None:
        """Start the mission, or go on with the item that was left (``MIS_RESTART``)."""
        restart = self.pilot.parameters["MIS_RESTART"] == 1
        fresh = self.current == 0 or self.current >= self.pilot.mission.count()
        if restart or fresh or self.state is MissionState.COMPLETE:
            self._jumps.clear()
            self.current = self._resume_from = 0
        self.state = MissionState.RUNNING
        self._advance(self._resume_from or self.current or 1)

    def forget(self) -> None:
        """Drop what was executed: the mission has been cleared."""
        self.state = MissionState.STOPPED
        self.reset()
        self.pilot.loiter()

    def reset(self) -> None:
        """Go back to the beginning of the mission."""
        self.current = self._resume_from = 0
        self._command = None
        self._do, self._do_next = None, 0
        self._jumps.clear()

    def notice_change(self) -> None:
        """Restart the present item where it, or one of the two after it, has been rewritten."""
        if self.state is not MissionState.RUNNING or self.pilot.submode is not SubMode.WAYPOINT:
            return
        if self._ahead() == self._watched:
            return
        if 0 < self.current < self.pilot.mission.count() and self._start(self.current):
            self.pilot.say(CRITICAL, "Auto mission changed, restarted command")
        else:
            self.pilot.say(CRITICAL, "Auto mission changed but failed to restart command")
        self._watched = self._ahead()

    def _ahead(self) -> tuple[Item, ...]:
        return tuple(self.pilot.mission.items[self.current : self.current + 3])

    def _next_navigation(self, seq: int) -> int | None:
        """Return the number of the first navigation command at or after `seq`, through jumps."""
        for _ in range(2 * self.pilot.mission.count() + 64):
            if not 0 < seq < self.pilot.mission.count():
                return None
            item = self.pilot.mission.items[seq]
            if item.command == mavlink.MAV_CMD_DO_JUMP:
                seq = self._jumped(seq, item, count=False)
            elif is_navigation(item.command):
                return seq
            else:
                seq += 1
        return None

    def _jumped(self, seq: int, item: Item, *, count: bool) -> int:
        done, times = self._jumps.get(seq, 0), item.param2
        if times >= 0 and done >= times:
            return seq + 1
        if count:
            self._jumps[seq] = done + 1
        return int(item.param1)

    def _advance(self, seq: int) -> bool:
        """Run the first do command from `seq` on, then start the next navigation command."""
        self._do, self._do_next, self._resume_from = None, 0, 0
        for _ in range(255):
            if not 0 < seq < self.pilot.mission.count():
                self._complete()
                return False
            item = self.pilot.mission.items[seq]
            if item.command == mavlink.MAV_CMD_DO_JUMP:
                seq = self._jumped(seq, item, count=True)
            elif is_navigation(item.command):
                self.current = seq
                if self._start(seq):
                    self._watched = self._ahead()
                    return True
                seq += 1
            else:
                if self._do is None:
                    self._begin_do(seq, item)
                seq += 1
        self._complete()
        return False

    def _complete(self) -> None:
        self.state = MissionState.COMPLETE
        self.pilot.say(NOTICE, "Mission Complete")
        behave = int(self.pilot.parameters["MIS_DONE_BEHAVE"])
        if behave == 3:
            self.pilot.set_mode(MANUAL)
        elif behave == 1:
            self.pilot.loiter()
        else:
            self.pilot.loiter()
            self.pilot.submode = SubMode.STOP

    def _start(self, seq: int) -> bool:
        """Start a navigation command; False where this vehicle does not execute it."""
        item = self.pilot.mission.items[seq]
        self._command = item
        self.pilot.arrived_s = None
        self._since_s = self.pilot.time_s
        command = item.command
        self._announce(seq, item)
        here = (self.pilot.boat.lat, self.pilot.boat.lon)
        if command in (16, 17, 19):
            # An item without a position means: here.
            end = (item.x * 1e-7, item.y * 1e-7) if item.x or item.y else here
            stops = command != 16 or item.param1 > 0
            start = self.pilot.leg.end if self.pilot.leg is not None and self._near_end() else here
            self.pilot.leg = Leg(start, end, None if stops else self._after(seq, end))
            self.pilot.submode = SubMode.WAYPOINT
        elif command == mavlink.MAV_CMD_NAV_LOITER_TURNS:
            self.pilot.submode = SubMode.CIRCLE
            self._circled_rad = 0.0
            self.pilot.leg = None
        elif command == mavlink.MAV_CMD_NAV_RETURN_TO_LAUNCH:
            self.pilot.head_home()
        elif command == mavlink.MAV_CMD_NAV_DELAY:
            self.pilot.loiter()
            self.pilot.say(INFO, f"Delaying {int(item.param1)} sec")
        else:
            return False
        return True

    def _near_end(self) -> bool:
        assert self.pilot.leg is not None
        return (
            self.pilot.leg.state(self.pilot.boat)[0]
            <= 2.0 * self.pilot.parameters["WP_RADIUS"] + 1.0
        )

    def _after(self, seq: int, end: tuple[float, float]) -> tuple[float, float] | None:
        following = self._next_navigation(seq + 1)
        if following is None:
            return None
        item = self.pilot.mission.items[following]
        if not has_position(item.command):
            return None
        return (item.x * 1e-7, item.y * 1e-7) if item.x or item.y else end

    def verify(self) -> None:
        """Look whether the present commands are done, and go on.

        One number at most is told as reached: where a command that is done at once follows a
        waypoint, the waypoint's own number is never sent.
        """
        reached: int | None = None
        if self._command is not None and self._navigation_done(self._command):
            reached = self.current
            self._advance(self.current + 1)
        done = self._run_do()
        reached = reached if done is None else done
        if reached is not None:
            self.pilot.events.append(("reached", reached, ""))

    def _navigation_done(self, item: Item) -> bool:
        command = item.command
        if command in (16, 17, 19):
            leg = self.pilot.leg
            if self.pilot.arrived_s is None:
                if leg is None or not self.pilot.armed:
                    return False
                if not leg.reached(self.pilot.boat, self.pilot.parameters["WP_RADIUS"]):
                    return False
                self.pilot.arrived_s = self.pilot.time_s
                wait = f". Loiter for {int(item.param1)} seconds" if item.param1 > 0 else ""
                self.pilot.say(INFO, f"Reached waypoint #{self.current}{wait}")
            if command == mavlink.MAV_CMD_NAV_LOITER_UNLIM:
                return False
            return self.pilot.time_s - self.pilot.arrived_s >= item.param1
        if command == mavlink.MAV_CMD_NAV_RETURN_TO_LAUNCH:
            return self.pilot.arrived_s is not None
        if command == mavlink.MAV_CMD_NAV_DELAY:
            return self.pilot.time_s - self._since_s > item.param1
        if command == mavlink.MAV_CMD_NAV_LOITER_TURNS:
            return self._circled_rad >= 2.0 * math.pi * item.param1
        return True

    def circle(self, dt_s: float) -> None:
        """Drive to the circle of NAV_LOITER_TURNS, then around it."""
        item = self._command
        if item is None:
            return
        centre = (item.x * 1e-7, item.y * 1e-7)
        radius_m = abs(item.param3) or self.pilot.parameters["CIRC_RADIUS"]
        way = -1.0 if item.param3 < 0 else 1.0
        east, north = offset_m(*centre, self.pilot.boat.lat, self.pilot.boat.lon)
        away = math.hypot(east, north)
        bearing = math.atan2(east, north)
        aim = bearing + way * min(1.0, max(1.0, self.pilot.speed_m_s) / max(radius_m, 0.5))
        point = moved(*centre, radius_m * math.sin(aim), radius_m * math.cos(aim))
        to_e, to_n = offset_m(self.pilot.boat.lat, self.pilot.boat.lon, *point)
        self.pilot.boat.advance(dt_s, math.atan2(to_e, to_n), self.pilot.speed_m_s)
        if abs(away - radius_m) <= max(self.pilot.parameters["WP_RADIUS"], 0.3 * radius_m):
            east, north = offset_m(*centre, self.pilot.boat.lat, self.pilot.boat.lon)
            turned = math.remainder(math.atan2(east, north) - bearing, 2.0 * math.pi)
            self._circled_rad += max(0.0, way * turned)

    def _announce(self, seq: int, item: Item) -> None:
        self.pilot.say(INFO, f"Mission: {seq} {NAMES.get(item.command, '?')}")

    # --- do commands ---

    def _begin_do(self, seq: int, item: Item) -> None:
        self._do, self._do_next = (seq, item), seq + 1
        self._do_since_s = self.pilot.time_s
        command = item.command
        self._announce(seq, item)
        if command == mavlink.MAV_CMD_DO_CHANGE_SPEED:
            if self.pilot.set_speed(item.param2):
                self.pilot.say(INFO, f"speed: {item.param2:.1f} m/s")
        elif command == mavlink.MAV_CMD_DO_SET_HOME:
            if item.param1 == 1 or not (item.x or item.y):
                self.pilot.set_home_here()
            else:
                self.pilot.set_home(item.x * 1e-7, item.y * 1e-7)
        elif command == mavlink.MAV_CMD_DO_SET_CAM_TRIGG_DIST:
            self.pilot.camera.trigger_every(item.param1, now=item.param3 == 1)
        elif command == mavlink.MAV_CMD_DO_FENCE_ENABLE:
            self.pilot.parameters.put("FENCE_ENABLE", 1.0 if item.param1 == 1 else 0.0)

    def _run_do(self) -> int | None:
        """Go on with the do commands before the next waypoint; return the number of a done one."""
        if self._do is None:
            following, self._do_next = self._do_next, 0
            if 0 < following < self.pilot.mission.count():
                item = self.pilot.mission.items[following]
                if not is_navigation(item.command) and item.command != mavlink.MAV_CMD_DO_JUMP:
                    self._begin_do(following, item)
            return None
        seq, item = self._do
        if item.command == mavlink.MAV_CMD_CONDITION_DELAY:
            if self.pilot.time_s - self._do_since_s <= item.param1:
                return None
        elif item.command == mavlink.MAV_CMD_CONDITION_DISTANCE and (
            self.pilot.leg is None or self.pilot.wp_distance_m >= item.param1
        ):
            return None
        self._do = None
        return seq

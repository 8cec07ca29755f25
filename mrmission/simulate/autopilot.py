"""Modes, arming and mission execution of a simulated boat, as ArduPilot Rover goes about them.

Knows nothing of messages: it is asked to arm, to change mode, to advance; what it has to say it
leaves in ``events`` for the vehicle to send.
"""

from __future__ import annotations

import enum
import math

from mrmission.simulate.fence import polygon_breach_m
from mrmission.simulate.motion import Boat, Leg, moved, offset_m
from mrmission.simulate.parameters import Parameters
from mrmission.simulate.storage import Item, has_position, is_navigation
from mrmission.simulate.stores import FenceStore, MissionStore, RallyStore
from mrmission.simulate.wire import mavlink

MAX_STEP_S = 0.2
FENCE_CHECK_S = 0.5
FENCE_CIRCLE, FENCE_POLYGON = 2, 4
FENCE_UNION = 2
"""FENCE_OPTIONS bit: inclusion areas add up instead of intersecting."""
GIVE_UP_FENCE_M = 100.0

CRITICAL = mavlink.MAV_SEVERITY_CRITICAL
WARNING = mavlink.MAV_SEVERITY_WARNING
NOTICE = mavlink.MAV_SEVERITY_NOTICE
INFO = mavlink.MAV_SEVERITY_INFO


class Mode(enum.IntEnum):
    """ArduPilot Rover's mode numbers that a simulated boat knows."""

    MANUAL = 0
    HOLD = 4
    LOITER = 5
    AUTO = 10
    RTL = 11
    GUIDED = 15


NAVIGATING = frozenset({Mode.LOITER, Mode.AUTO, Mode.RTL, Mode.GUIDED})


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


Event = tuple[str, int, str]
"""(kind, number, text): ("text", severity, text), ("reached", seq, ""), ("mode"|"home", 0, "")."""


class Autopilot:
    """One boat's autopilot.

    Parameters
    ----------
    boat : Boat
        What is steered.
    parameters : Parameters
        Read at every use, so a PARAM_SET takes effect at once.
    mission, fence, rally
        The stores that uploads write.
    ready_s : float
        Time after start at which the position is good enough to arm.
    """

    def __init__(
        self,
        boat: Boat,
        parameters: Parameters,
        mission: MissionStore,
        fence: FenceStore,
        rally: RallyStore,
        ready_s: float = 0.0,
    ) -> None:
        self.boat = boat
        self.parameters = parameters
        self.mission = mission
        self.fence = fence
        self.rally = rally
        self.ready_s = ready_s
        self.time_s = 0.0
        self.armed = False
        self.events: list[Event] = []
        self.home: tuple[float, float] | None = None
        try:
            self.mode = Mode(int(parameters["INITIAL_MODE"]))
        except ValueError:
            self.mode = Mode.HOLD
        self.state = MissionState.STOPPED
        self.current = 0
        """Number of the navigation command that is executed or would be resumed; 0 is none."""
        self._command: Item | None = None
        self._do: tuple[int, Item] | None = None
        self._do_next = 0
        self._resume_from = 0
        self._do_since_s = 0.0
        self._jumps: dict[int, int] = {}
        self._starting = False
        self._submode = SubMode.STOP
        self._speed_m_s = parameters["WP_SPEED"]
        self._leg: Leg | None = None
        self._arrived_s: float | None = None
        self._since_s = 0.0
        self._circled_rad = 0.0
        self._revision = mission.revision
        self._watched: tuple[Item, ...] = ()
        self._fence_next_s = 0.0
        self._breached = False
        mission.may_clear = lambda: not (self.armed and self.state is MissionState.RUNNING)
        mission.on_clear = self._forget_mission
        if ready_s <= 0.0:
            self._set_home_here()

    # --- what others ask ---

    @property
    def has_position(self) -> bool:
        """Whether the position is good enough to arm."""
        return self.home is not None

    @property
    def wp_distance_m(self) -> float:
        """Distance to the present target."""
        return self._leg.state(self.boat)[0] if self._leg is not None else 0.0

    @property
    def cross_track_m(self) -> float:
        """Distance from the line between the waypoints."""
        return self._leg.state(self.boat)[2] if self._leg is not None else 0.0

    @property
    def target(self) -> tuple[float, float] | None:
        """Position ``(lat, lon)`` that is steered for."""
        return self._leg.end if self._leg is not None else None

    def set_home(self, lat: float, lon: float) -> None:
        """Move home (item 0 of the mission follows)."""
        self.home = (lat, lon)
        self.mission.home = Item(
            16, 0, 0.0, 0.0, 0.0, 0.0, round(lat * 1e7), round(lon * 1e7), 0.0
        )  # fmt: skip
        self.events.append(("home", 0, ""))

    def why_not_arm(self) -> str | None:
        """Return what an arming check would object to, or None."""
        if not self.has_position:
            return "Need Position Estimate"
        if self.parameters["FENCE_ENABLE"] and self.fence_breach_m() is not None:
            return "Vehicle breaching fence"
        return None

    def arm(self, *, force: bool = False) -> bool:
        """Arm unless a check objects; `force` skips the checks."""
        if self.armed:
            return True
        objection = None if force else self.why_not_arm()
        if objection is not None:
            self._say(CRITICAL, f"Arm: {objection}")
            return False
        self.armed = True
        self._say(INFO, "Throttle armed")
        self.events.append(("mode", 0, ""))
        return True

    def disarm(self, *, force: bool = False) -> bool:
        """Disarm; refused while the boat is moving, unless forced."""
        if self.armed and self.boat.speed_m_s > 0.5 and not force:
            self._say(CRITICAL, "Disarm: vehicle is moving")
            return False
        if self.armed:
            self.armed = False
            self._say(INFO, "Throttle disarmed")
            self.events.append(("mode", 0, ""))
        return True

    def set_mode(self, number: int) -> bool:
        """Change mode; False where the mode is unknown or can't be entered."""
        try:
            mode = Mode(number)
        except ValueError:
            self._say(WARNING, f"No such mode {number}")
            return False
        if mode is self.mode:
            return True
        if not self._may_enter(mode):
            self._say(WARNING, "Flight mode change failed")
            return False
        if self.mode is Mode.AUTO and self.state is MissionState.RUNNING:
            self.state = MissionState.STOPPED
        self.mode = mode
        self._leg = None
        if mode is Mode.AUTO:
            self._starting = True
            self._speed_m_s = self.parameters["WP_SPEED"]
            self._loiter()
        elif mode is Mode.RTL:
            self._head_home()
        elif mode in (Mode.LOITER, Mode.GUIDED):
            self._loiter()
        self.events.append(("mode", 0, ""))
        return True

    def go_to(self, lat: float, lon: float) -> bool:
        """Steer for a position; only in GUIDED."""
        if self.mode is not Mode.GUIDED or not self.has_position:
            return False
        self._speed_m_s = self.parameters["WP_SPEED"]
        self._leg = Leg((self.boat.lat, self.boat.lon), (lat, lon), None)
        self._arrived_s = None
        return True

    def set_speed(self, speed_m_s: float) -> bool:
        """Change the speed between waypoints; refused where the boat has no destination."""
        if self.mode is Mode.AUTO:
            if self._submode is SubMode.LOITER:
                return False
        elif self._leg is None:
            return False
        if not speed_m_s > 0.05:
            return False
        self._speed_m_s = speed_m_s
        return True

    def set_current(self, seq: int, *, restart: bool = False) -> bool:
        """Make `seq` the item to execute next (or now, in a running mission)."""
        count = self.mission.count()
        if seq >= count or count <= 1:
            return False
        if restart:
            self._jumps.clear()
        if seq == 0 or self.state is MissionState.COMPLETE:
            self._jumps.clear()
            seq = max(seq, 1)
        if self.state is MissionState.RUNNING:
            return self._advance(seq)
        found = self._next_navigation(seq, count_jumps=False)
        if found is None:
            return False
        self.current = found
        # The do commands before it run when the mission goes on.
        self._resume_from = seq
        self.state = MissionState.STOPPED
        return True

    def fence_breach_m(self) -> float | None:
        """Return how far outside its fence the boat is (0 inside an exclusion), None if inside."""
        kinds = int(self.parameters["FENCE_TYPE"])
        worst: float | None = None
        if kinds & FENCE_CIRCLE and self.home is not None:
            away = math.hypot(*offset_m(*self.home, self.boat.lat, self.boat.lon))
            if away > self.parameters["FENCE_RADIUS"]:
                worst = away - self.parameters["FENCE_RADIUS"]
        if kinds & FENCE_POLYGON and self.fence.items:
            union = bool(int(self.parameters["FENCE_OPTIONS"]) & FENCE_UNION)
            outside = polygon_breach_m(self.fence.items, self.boat.lat, self.boat.lon, union=union)
            if outside is not None:
                worst = max(worst or 0.0, outside)
        return worst

    # --- time ---

    def advance(self, dt_s: float) -> None:
        """Let `dt_s` seconds pass for the boat."""
        while dt_s > 1e-9:
            step = min(dt_s, MAX_STEP_S)
            self._step(step)
            dt_s -= step

    def _step(self, dt_s: float) -> None:
        self.time_s += dt_s
        if self.home is None:
            if self.time_s < self.ready_s:
                return
            self._set_home_here()
        if self.mode is Mode.AUTO:
            self._run_auto(dt_s)
        elif self.mode is Mode.RTL or self.mode is Mode.GUIDED:
            self._follow(dt_s)
        elif self.mode is Mode.LOITER:
            self._stay(dt_s)
        elif self.boat.speed_m_s:
            self.boat.stop(dt_s)
        if self.armed and self.parameters["FENCE_ENABLE"] and self.time_s >= self._fence_next_s:
            self._fence_next_s = self.time_s + FENCE_CHECK_S
            self._check_fence()

    def _check_fence(self) -> None:
        breach_m = self.fence_breach_m()
        if breach_m is None:
            self._breached = False
            return
        if self._breached:
            return
        self._breached = True
        self._say(CRITICAL, "Fence Breached")
        action = int(self.parameters["FENCE_ACTION"])
        if action == 0:
            return
        if action == 5:
            self.disarm(force=True)
        elif breach_m > GIVE_UP_FENCE_M or action in (2, 4) or not self.set_mode(Mode.RTL):
            self.set_mode(Mode.HOLD)

    # --- moving ---

    def _follow(self, dt_s: float) -> None:
        """Drive along the present leg and stay at its end."""
        if self._leg is None or not self.armed:
            self._stay(dt_s)
            return
        radius_m = self.parameters["WP_RADIUS"]
        if (
            self._arrived_s is None
            # In a mission the command itself decides when it has arrived.
            and not (self.mode is Mode.AUTO and self._submode is SubMode.WAYPOINT)
            and self._leg.reached(self.boat, radius_m)
        ):
            self._arrived_s = self.time_s
            if self.mode is Mode.RTL:
                self._say(INFO, "Reached destination")
        if self._arrived_s is not None and self._leg.stops:
            self._stay(dt_s)
        else:
            self._leg.drive(self.boat, dt_s, self._speed_m_s, radius_m)

    def _stay(self, dt_s: float) -> None:
        if self.boat.speed_m_s:
            self.boat.stop(dt_s)

    def _loiter(self) -> None:
        self._submode = SubMode.LOITER
        self._leg = None

    def _head_home(self) -> None:
        speed = self.parameters["RTL_SPEED"]
        self._speed_m_s = speed if speed > 0 else self.parameters["WP_SPEED"]
        self._leg = Leg((self.boat.lat, self.boat.lon), self._refuge(), None)
        self._arrived_s = None
        self._submode = SubMode.RETURN

    def _refuge(self) -> tuple[float, float]:
        """Return the nearest rally point within its limit, or home."""
        assert self.home is not None
        here = (self.boat.lat, self.boat.lon)
        best: tuple[float, tuple[float, float]] | None = None
        for item in self.rally.items:
            point = (item.x * 1e-7, item.y * 1e-7)
            away = math.hypot(*offset_m(*here, *point))
            if best is None or away < best[0]:
                best = (away, point)
        limit_m = self.parameters["RALLY_LIMIT_KM"] * 1000.0
        if best is None or (limit_m > 0 and best[0] > limit_m):
            return self.home
        home_m = math.hypot(*offset_m(*here, *self.home))
        if self.parameters["RALLY_INCL_HOME"] and home_m < best[0]:
            return self.home
        return best[1]

    # --- mission ---

    def _run_auto(self, dt_s: float) -> None:
        if self._starting:
            self._starting = False
            self._revision = self.mission.revision
            self._start_or_resume()
        elif self.mission.revision != self._revision:
            self._revision = self.mission.revision
            self._notice_change()
        if self.state is MissionState.RUNNING and self.mission.count() > 0:
            self._verify()
        if self.mode is not Mode.AUTO:
            return
        if self._submode in (SubMode.WAYPOINT, SubMode.RETURN):
            self._follow(dt_s)
            leg = self._leg
            if (
                self._submode is SubMode.WAYPOINT
                and leg is not None
                and leg.stops
                and self._arrived_s is not None
            ):
                # A boat loiters where it stops; a change of speed is lost on it from here on.
                self._submode = SubMode.LOITER
        elif self._submode is SubMode.CIRCLE and self.armed:
            self._circle(dt_s)
        else:
            self._stay(dt_s)

    def _start_or_resume(self) -> None:
        restart = self.parameters["MIS_RESTART"] == 1
        fresh = self.current == 0 or self.current >= self.mission.count()
        if restart or fresh or self.state is MissionState.COMPLETE:
            self._jumps.clear()
            self.current = self._resume_from = 0
        self.state = MissionState.RUNNING
        self._advance(self._resume_from or self.current or 1)

    def _forget_mission(self) -> None:
        self.state = MissionState.STOPPED
        self.current = self._resume_from = 0
        self._command = None
        self._do = None
        self._loiter()

    def _notice_change(self) -> None:
        """Restart the present item where it, or one of the two after it, has been rewritten."""
        if self.state is not MissionState.RUNNING or self._submode is not SubMode.WAYPOINT:
            return
        if self._ahead() == self._watched:
            return
        if 0 < self.current < self.mission.count() and self._start(self.current):
            self._say(CRITICAL, "Auto mission changed, restarted command")
        else:
            self._say(CRITICAL, "Auto mission changed but failed to restart command")
        self._watched = self._ahead()

    def _ahead(self) -> tuple[Item, ...]:
        return tuple(self.mission.items[self.current : self.current + 3])

    def _next_navigation(self, seq: int, *, count_jumps: bool) -> int | None:
        """Return the number of the first navigation command at or after `seq`, through jumps."""
        for _ in range(2 * self.mission.count() + 64):
            if not 0 < seq < self.mission.count():
                return None
            item = self.mission.items[seq]
            if item.command == mavlink.MAV_CMD_DO_JUMP:
                seq = self._jumped(seq, item, count=count_jumps)
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
            if not 0 < seq < self.mission.count():
                self._complete()
                return False
            item = self.mission.items[seq]
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
        self._say(NOTICE, "Mission Complete")
        behave = int(self.parameters["MIS_DONE_BEHAVE"])
        if behave == 3:
            self.set_mode(Mode.MANUAL)
        elif behave == 1:
            self._loiter()
        else:
            self._submode = SubMode.STOP
            self._leg = None

    def _start(self, seq: int) -> bool:
        """Start a navigation command; False where this vehicle does not execute it."""
        item = self.mission.items[seq]
        self._command = item
        self._arrived_s = None
        self._since_s = self.time_s
        command = item.command
        here = (self.boat.lat, self.boat.lon)
        if command in (16, 17, 19):
            # An item without a position means: here.
            end = (item.x * 1e-7, item.y * 1e-7) if item.x or item.y else here
            stops = command != 16 or item.param1 > 0
            start = self._leg.end if self._leg is not None and self._near_end() else here
            self._leg = Leg(start, end, None if stops else self._after(seq, end))
            self._submode = SubMode.WAYPOINT
        elif command == mavlink.MAV_CMD_NAV_LOITER_TURNS:
            self._submode = SubMode.CIRCLE
            self._circled_rad = 0.0
            self._leg = None
        elif command == mavlink.MAV_CMD_NAV_RETURN_TO_LAUNCH:
            self._head_home()
        elif command == mavlink.MAV_CMD_NAV_DELAY:
            self._loiter()
            self._say(INFO, f"Delaying {int(item.param1)} sec")
        else:
            self._say(WARNING, f"Skipping invalid cmd #{command}")
            return False
        return True

    def _near_end(self) -> bool:
        assert self._leg is not None
        return self._leg.state(self.boat)[0] <= 2.0 * self.parameters["WP_RADIUS"] + 1.0

    def _after(self, seq: int, end: tuple[float, float]) -> tuple[float, float] | None:
        following = self._next_navigation(seq + 1, count_jumps=False)
        if following is None:
            return None
        item = self.mission.items[following]
        if not has_position(item.command):
            return None
        return (item.x * 1e-7, item.y * 1e-7) if item.x or item.y else end

    def _verify(self) -> None:
        """Look whether the present commands are done, and go on."""
        self._run_do()
        if self._command is None or not self._navigation_done(self._command):
            return
        self.events.append(("reached", self.current, ""))
        self._advance(self.current + 1)

    def _navigation_done(self, item: Item) -> bool:
        command = item.command
        if command in (16, 17, 19):
            leg = self._leg
            if self._arrived_s is None:
                if leg is None or not self.armed:
                    return False
                if not leg.reached(self.boat, self.parameters["WP_RADIUS"]):
                    return False
                self._arrived_s = self.time_s
                wait = f". Loiter for {int(item.param1)} seconds" if item.param1 > 0 else ""
                self._say(INFO, f"Reached waypoint #{self.current}{wait}")
            if command == mavlink.MAV_CMD_NAV_LOITER_UNLIM:
                return False
            return self.time_s - self._arrived_s >= item.param1
        if command == mavlink.MAV_CMD_NAV_RETURN_TO_LAUNCH:
            return self._arrived_s is not None
        if command == mavlink.MAV_CMD_NAV_DELAY:
            return self.time_s - self._since_s > item.param1
        if command == mavlink.MAV_CMD_NAV_LOITER_TURNS:
            return self._circled_rad >= 2.0 * math.pi * item.param1
        return True

    def _circle(self, dt_s: float) -> None:
        """Drive to the circle of NAV_LOITER_TURNS, then around it."""
        item = self._command
        if item is None:
            return
        centre = (item.x * 1e-7, item.y * 1e-7)
        radius_m = abs(item.param3) or self.parameters["CIRC_RADIUS"]
        way = -1.0 if item.param3 < 0 else 1.0
        east, north = offset_m(*centre, self.boat.lat, self.boat.lon)
        away = math.hypot(east, north)
        bearing = math.atan2(east, north)
        aim = bearing + way * min(1.0, max(1.0, self._speed_m_s) / max(radius_m, 0.5))
        point = moved(*centre, radius_m * math.sin(aim), radius_m * math.cos(aim))
        to_e, to_n = offset_m(self.boat.lat, self.boat.lon, *point)
        self.boat.advance(dt_s, math.atan2(to_e, to_n), self._speed_m_s)
        if abs(away - radius_m) <= max(self.parameters["WP_RADIUS"], 0.3 * radius_m):
            east, north = offset_m(*centre, self.boat.lat, self.boat.lon)
            turned = math.remainder(math.atan2(east, north) - bearing, 2.0 * math.pi)
            self._circled_rad += max(0.0, way * turned)

    # --- do commands ---

    def _begin_do(self, seq: int, item: Item) -> None:
        self._do, self._do_next = (seq, item), seq + 1
        self._do_since_s = self.time_s
        command = item.command
        if command == mavlink.MAV_CMD_DO_CHANGE_SPEED:
            if self.set_speed(item.param2):
                self._say(INFO, f"speed: {item.param2:.1f} m/s")
        elif command == mavlink.MAV_CMD_DO_SET_HOME:
            if item.param1 == 1 or not (item.x or item.y):
                self._set_home_here()
            else:
                self.set_home(item.x * 1e-7, item.y * 1e-7)
        elif command == mavlink.MAV_CMD_DO_FENCE_ENABLE:
            self.parameters.put("FENCE_ENABLE", 1.0 if item.param1 == 1 else 0.0)

    def _run_do(self) -> None:
        """Go on with the do commands between the present and the next navigation command."""
        if self._do is None:
            return
        seq, item = self._do
        if item.command == mavlink.MAV_CMD_CONDITION_DELAY:
            if self.time_s - self._do_since_s <= item.param1:
                return
        elif item.command == mavlink.MAV_CMD_CONDITION_DISTANCE and (
            self._leg is None or self.wp_distance_m >= item.param1
        ):
            return
        self.events.append(("reached", seq, ""))
        self._do = None
        following = self._do_next
        if 0 < following < self.mission.count():
            item = self.mission.items[following]
            if not is_navigation(item.command) and item.command != mavlink.MAV_CMD_DO_JUMP:
                self._begin_do(following, item)

    # --- inside ---

    def _may_enter(self, mode: Mode) -> bool:
        if mode in NAVIGATING and self.armed and not self.has_position:
            return False
        if mode is Mode.AUTO and self.mission.count() <= 1:
            self._say(NOTICE, "No Mission. Can't set AUTO.")
            return False
        return mode is not Mode.RTL or self.home is not None

    def _set_home_here(self) -> None:
        self.set_home(self.boat.lat, self.boat.lon)

    def _say(self, severity: int, text: str) -> None:
        self.events.append(("text", severity, text))

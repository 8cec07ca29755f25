"""Modes, arming and mission execution of a simulated boat, as ArduPilot Rover goes about them.

Knows nothing of messages: it is asked to arm, to change mode, to advance; what it has to say it
leaves in ``events`` for the vehicle to send.
"""

from __future__ import annotations

import enum
import math

from mrmission.simulate.camera import Camera
from mrmission.simulate.execution import MissionExecution, MissionState, SubMode
from mrmission.simulate.guard import FenceGuard
from mrmission.simulate.loiter import Loiter
from mrmission.simulate.motion import Boat, Leg, offset_m
from mrmission.simulate.parameters import Parameters
from mrmission.simulate.smart_rtl import Crumbs
from mrmission.simulate.storage import Item
from mrmission.simulate.stores import FenceStore, MissionStore, RallyStore
from mrmission.simulate.wire import mavlink

MAX_STEP_S = 0.2
GIVE_UP_FENCE_M = 100.0
HOME_MOVES_M = 0.5
"""Home follows a boat that is not armed, in steps of this."""
FIXED_SHARE, ARMABLE_SHARE = 0.24, 0.55
"""When there is a position, and when a boat can be armed, as shares of the time until it can
navigate: ArduPilot in SITL has a fix after 10 s, arms after 24 and enters AUTO after 42."""
NO_ROOM_S = 4.0
"""A boat that starts up says for so long that it has no room for a mission."""

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
    SMART_RTL = 12
    GUIDED = 15


NAVIGATING = frozenset(set(Mode) - {Mode.MANUAL, Mode.HOLD})


Event = tuple[str, int, str]
"""(kind, number, text): ("text", severity, text), ("reached", seq, ""), ("shot", number, ""),
("mode"|"home"|"fence", 0, "")."""


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
        Time after start at which the position is good enough to navigate.
    """

    modes: type[enum.IntEnum] = Mode
    navigating_modes: frozenset[enum.IntEnum] = NAVIGATING
    fallback_mode: enum.IntEnum = Mode.HOLD

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
        self._home_locked = False
        self.camera = Camera(self)
        self.loiterer = Loiter(boat)
        self.mode: enum.IntEnum = self._first_mode()
        self.submode = SubMode.STOP
        self.speed_m_s = self._usual_speed_m_s()
        self.leg: Leg | None = None
        self.arrived_s: float | None = None
        self.guard = FenceGuard(self)
        self.crumbs = Crumbs(self)
        self._way_home: list[tuple[float, float]] = []
        self.execution = self._new_execution()
        mission.has_room = lambda: self.time_s >= min(NO_ROOM_S, self.ready_s)
        mission.may_clear = lambda: not (self.armed and self.state is MissionState.RUNNING)
        mission.on_clear = self.execution.forget
        if ready_s <= 0.0:
            self.set_home_here()

    def _first_mode(self) -> enum.IntEnum:
        try:
            return self.modes(int(self.parameters["INITIAL_MODE"]))
        except ValueError:
            return self.fallback_mode

    def _usual_speed_m_s(self) -> float:
        return self.parameters["WP_SPEED"]

    def _new_execution(self) -> MissionExecution:
        return MissionExecution(self)

    # --- what others ask ---

    @property
    def has_position(self) -> bool:
        """Whether there is a position."""
        return self.home is not None

    @property
    def can_navigate(self) -> bool:
        """Whether the position is good enough to navigate by."""
        return self.has_position and self.time_s >= self.ready_s

    @property
    def state(self) -> MissionState:
        """How far the mission is."""
        return self.execution.state

    @property
    def current(self) -> int:
        """Number of the mission item that is executed or would be resumed; 0 is none."""
        return self.execution.current

    def set_current(self, seq: int, *, restart: bool = False) -> bool:
        """Make `seq` the mission item to execute next (or now, in a running mission)."""
        return self.execution.set_current(seq, restart=restart)

    @property
    def wp_distance_m(self) -> float:
        """Distance to the present target."""
        return self.leg.state(self.boat)[0] if self.leg is not None else 0.0

    @property
    def cross_track_m(self) -> float:
        """Distance from the line between the waypoints."""
        return self.leg.state(self.boat)[2] if self.leg is not None else 0.0

    @property
    def target(self) -> tuple[float, float] | None:
        """Position ``(lat, lon)`` that is steered for."""
        return self.leg.end if self.leg is not None else None

    def set_home(self, lat: float, lon: float, *, lock: bool = False) -> None:
        """Move home (item 0 of the mission follows); a locked one stays where it is."""
        self._home_locked = self._home_locked or lock
        self.home = (lat, lon)
        self.mission.home = Item(
            16, 0, 0.0, 0.0, 0.0, 0.0, round(lat * 1e7), round(lon * 1e7), 0.0
        )  # fmt: skip
        self.events.append(("home", 0, ""))

    def why_not_arm(self) -> str | None:
        """Return what an arming check would object to, or None."""
        if self.time_s < ARMABLE_SHARE * self.ready_s:
            return "Gyros inconsistent"
        if self.mode in NAVIGATING and not self.can_navigate:
            return "Need Position Estimate"
        return self.guard.objection()

    def arm(self, *, force: bool = False) -> bool:
        """Arm unless a check objects; `force` skips the checks."""
        if self.armed:
            return True
        objection = None if force else self.why_not_arm()
        if objection is not None:
            self.say(CRITICAL, f"Arm: {objection}")
            return False
        self.armed = True
        self.crumbs.begin()
        self.say(INFO, "Throttle armed")
        self.events.append(("mode", 0, ""))
        return True

    def disarm(self) -> None:
        """Disarm, moving or not; outside AUTO the mission goes back to its beginning."""
        if self.armed:
            self.armed = False
            if self.mode is not Mode.AUTO:
                self.execution.reset()
            self.say(INFO, "Throttle disarmed")
            self.events.append(("mode", 0, ""))

    def ask_disarm(self, *, force: bool) -> bool:
        """Disarm as a ground station asks for it; False where that is refused."""
        self.disarm()
        return True

    def start_mission(self) -> bool:
        """Change to AUTO as MISSION_START does."""
        return self.set_mode(Mode.AUTO)

    def set_mode(self, number: int) -> bool:
        """Change mode; False where the mode is unknown or can't be entered."""
        try:
            mode = Mode(number)
        except ValueError:
            self.say(WARNING, f"No such mode {number}")
            return False
        if mode is self.mode:
            return True
        if self.mode is Mode.MANUAL and mode is not Mode.HOLD:
            self.say(
                WARNING,
                f"Mode change from MANUAL to {mode.name} denied, only RC commands "
                "(QGC, MP, hand controller) can force exit from MANUAL",
            )
            return False
        if not self._may_enter(mode):
            self.say(WARNING, "Flight mode change failed")
            return False
        if self.mode is Mode.AUTO:
            self.execution.leave()
        self.mode = mode
        self.leg = None
        if mode is Mode.AUTO:
            self.execution.enter()
            self.speed_m_s = self.parameters["WP_SPEED"]
            self.loiter()
        elif mode is Mode.RTL:
            self.head_home()
        elif mode is Mode.SMART_RTL:
            self._way_home = self.crumbs.way_home()
            self.head_home()
            self._next_crumb()
        elif mode in (Mode.LOITER, Mode.GUIDED):
            self.loiter()
        self.guard.mode_changed()
        self.events.append(("mode", 0, ""))
        return True

    def go_to(self, lat: float, lon: float) -> bool:
        """Steer for a position; only in GUIDED."""
        if self.mode is not Mode.GUIDED or not self.has_position:
            return False
        self.speed_m_s = self.parameters["WP_SPEED"]
        self.leg = Leg((self.boat.lat, self.boat.lon), (lat, lon), None)
        self.arrived_s = None
        return True

    def set_speed(self, speed_m_s: float) -> bool:
        """Change the speed between waypoints; refused where the boat has no destination."""
        if self.mode is Mode.AUTO:
            if self.submode is SubMode.LOITER:
                return False
        elif self.leg is None:
            return False
        if not speed_m_s > 0.05:
            return False
        self.speed_m_s = speed_m_s
        return True

    def fence_breaches_m(self) -> dict[int, float]:
        """Return how far outside its fences the boat is, by FENCE_TYPE's bits; empty inside."""
        return self.guard.breaches_m()

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
            if self.time_s < FIXED_SHARE * self.ready_s:
                return
            self.set_home_here()
        if not self.armed:
            self._home_follows()
        self.boat.current_m_s = self._current_m_s()
        if self.mode is Mode.AUTO:
            self._run_auto(dt_s)
        elif self.mode in (Mode.RTL, Mode.SMART_RTL, Mode.GUIDED):
            self._follow(dt_s)
        elif self.mode is Mode.LOITER:
            self._stay(dt_s)
        else:
            self.boat.coast(dt_s)
        if self.armed:
            self.camera.look()
            self.crumbs.look()
            self.guard.look()

    def act_on_breach(self, breach_m: float) -> None:
        """Do what FENCE_ACTION says about a new breach."""
        action = int(self.parameters["FENCE_ACTION"])
        if action == 0:
            return
        if action == 5:
            self.disarm()
            return
        wanted = {1: (Mode.RTL,), 3: (Mode.SMART_RTL, Mode.RTL), 4: (Mode.SMART_RTL,)}
        choices = () if breach_m > GIVE_UP_FENCE_M else wanted.get(action, ())
        for mode in choices:
            if self.set_mode(mode):
                return
        self.set_mode(Mode.HOLD)

    # --- moving ---

    def _follow(self, dt_s: float) -> None:
        """Drive along the present leg and stay at its end."""
        if self.leg is None or not self.armed:
            self._stay(dt_s)
            return
        radius_m = self.parameters["WP_RADIUS"]
        if (
            self.arrived_s is None
            # In a mission the command itself decides when it has arrived.
            and not (self.mode is Mode.AUTO and self.submode is SubMode.WAYPOINT)
            and self.leg.reached(self.boat, radius_m)
        ):
            if self.mode is Mode.SMART_RTL and self._way_home:
                self._next_crumb()
                return
            self.arrived_s = self.time_s
            if self.leg.stops:
                self.loiterer.begin()
            if self.mode in (Mode.RTL, Mode.SMART_RTL):
                self.say(INFO, "Reached destination")
        if self.arrived_s is not None and self.leg.stops:
            self._stay(dt_s)
        else:
            most_m_s = self.parameters["SPEED_MAX"] or math.inf
            self.leg.drive(self.boat, dt_s, min(self.speed_m_s, most_m_s), radius_m)

    def _stay(self, dt_s: float) -> None:
        """Loiter, or stop and then drift where a mission has ended with that."""
        if not self.armed:
            self.boat.coast(dt_s)
        elif self.mode is Mode.AUTO and self.submode is SubMode.STOP:
            self.loiterer.stop(dt_s)
        else:
            self.loiterer.stay(
                dt_s,
                self.parameters["LOIT_RADIUS"],
                self.parameters["LOIT_SPEED_GAIN"],
                self.parameters["WP_SPEED"],
            )

    def loiter(self) -> None:
        """Stay here: no leg, no destination."""
        self.submode = SubMode.LOITER
        self.leg = None
        self.loiterer.begin()

    def _current_m_s(self) -> tuple[float, float]:
        """Return where the water goes; as in SITL, it rests until the boat is armed."""
        speed = self.parameters["SIM_TIDE_SPEED"] if self.armed else 0.0
        if not speed:
            return (0.0, 0.0)
        comes_from = math.radians(self.parameters["SIM_TIDE_DIR"])
        return (-speed * math.sin(comes_from), -speed * math.cos(comes_from))

    def _home_follows(self) -> None:
        assert self.home is not None
        moved_m = math.hypot(*offset_m(*self.home, self.boat.lat, self.boat.lon))
        if moved_m >= HOME_MOVES_M and not self._home_locked:
            self.set_home_here()

    def head_home(self) -> None:
        """Steer straight for the nearest rally point, or home."""
        speed = self.parameters["RTL_SPEED"]
        self.speed_m_s = speed if speed > 0 else self.parameters["WP_SPEED"]
        self.leg = Leg((self.boat.lat, self.boat.lon), self._refuge(), None)
        self.arrived_s = None
        self.submode = SubMode.RETURN

    def _next_crumb(self) -> None:
        """Steer for the next point of the way back."""
        assert self.leg is not None
        if self._way_home:
            target = self._way_home.pop()
            after = self._way_home[-1] if self._way_home else None
            self.leg = Leg((self.boat.lat, self.boat.lon), target, after)

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

    def _run_auto(self, dt_s: float) -> None:
        self.execution.update()
        # The end of a mission may have changed the mode.
        if self.mode is not Mode.AUTO:
            return
        if self.submode in (SubMode.WAYPOINT, SubMode.RETURN):
            self._follow(dt_s)
            stops = self.leg is not None and self.leg.stops
            if self.submode is SubMode.WAYPOINT and stops and self.arrived_s is not None:
                # A boat loiters where it stops; a change of speed is lost on it from here on.
                self.submode = SubMode.LOITER
                self.loiterer.begin()
        elif self.submode is SubMode.CIRCLE and self.armed:
            self.execution.circle(dt_s)
        else:
            self._stay(dt_s)

    # --- inside ---

    def _may_enter(self, mode: Mode) -> bool:
        if mode in NAVIGATING and self.armed and not self.can_navigate:
            return False
        if mode is Mode.AUTO and self.mission.count() <= 1:
            self.say(NOTICE, "No Mission. Can't set AUTO.")
            return False
        if mode is Mode.SMART_RTL and self.armed:
            return self.crumbs.active
        return mode not in (Mode.RTL, Mode.SMART_RTL) or self.home is not None

    def set_home_here(self) -> None:
        """Make the present position home."""
        self.set_home(self.boat.lat, self.boat.lon)

    def say(self, severity: int, text: str) -> None:
        """Leave a status text to be sent."""
        self.events.append(("text", severity, text))

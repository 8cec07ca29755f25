"""Modes, arming, take-off, flight and landing of a simulated copter, as ArduCopter goes about them.

Heights are above home, which lies at sea level; the terrain is as flat.
"""

from __future__ import annotations

import math
from dataclasses import replace

from mrmission.simulate.autopilot import FIXED_SHARE, GIVE_UP_FENCE_M, Autopilot
from mrmission.simulate.copter_mission import CopterExecution
from mrmission.simulate.copter_modes import ARMABLE, NAVIGATING, CopterMode, Homeward, Stage
from mrmission.simulate.copter_motion import FlightLimits, Rotorcraft, Route, Vector
from mrmission.simulate.execution import SubMode
from mrmission.simulate.motion import moved, offset_m
from mrmission.simulate.parameters import Parameters
from mrmission.simulate.stores import FenceStore, MissionStore, RallyStore
from mrmission.simulate.wire import mavlink
from mrmission.tour.flight import SETTLE_S, SHORTEST_LEG_S, SPOOL_S, TAKEOFF_BRAKE_M_S2

STEP_S = 0.1
TOOK_OFF_SHARE = 0.1
"""Of the climbing speed: below it, close to the height asked for, a take-off is done."""
YAW_RATE_RAD_S = math.radians(60.0)
HEADED_LEG_M = 2.0
"""A copter turns its nose to legs at least as long."""
FENCE_ALT_MAX = 1
ALLOW_ARMING, NO_THROTTLE_STICK = 1, 2
"""Bits of AUTO_OPTIONS."""
LOWEST_RETURN_M = 0.3
GENTLEST_CONE = 0.5

CRITICAL = mavlink.MAV_SEVERITY_CRITICAL
WARNING = mavlink.MAV_SEVERITY_WARNING
INFO = mavlink.MAV_SEVERITY_INFO


class CopterPilot(Autopilot):
    """One copter's autopilot.

    Its parameters are those of :class:`~mrmission.simulate.autopilot.Autopilot`, whose boat flies.
    """

    modes = CopterMode
    navigating_modes = NAVIGATING
    fallback_mode = CopterMode.STABILIZE
    execution: CopterExecution

    def __init__(
        self,
        boat: Rotorcraft,
        parameters: Parameters,
        mission: MissionStore,
        fence: FenceStore,
        rally: RallyStore,
        ready_s: float = 0.0,
    ) -> None:
        self.copter = boat
        self.stage = Stage.LANDED
        self.took_off = False
        self._idle_since_s = 0.0
        self.limits = FlightLimits()
        self._datum = (boat.lat, boat.lon)
        self._auto_armed = False
        self._since_s = 0.0
        self._takeoff_m = 0.0
        self._homeward: Homeward | None = None
        self._return_to: Vector = (0.0, 0.0, 0.0)
        self._land_at: Vector | None = None
        super().__init__(boat, parameters, mission, fence, rally, ready_s)
        self.limits = self._usual_limits()
        self.route = Route(self.here, self.limits)

    def _new_execution(self) -> CopterExecution:
        return CopterExecution(self)

    def _usual_speed_m_s(self) -> float:
        return self.parameters["WPNAV_SPEED"] / 100.0

    def _usual_limits(self) -> FlightLimits:
        get = self.parameters.__getitem__
        accel = get("WPNAV_ACCEL") / 100.0
        corner = get("WPNAV_ACCEL_C") / 100.0
        return FlightLimits(
            speed_m_s=max(0.1, get("WPNAV_SPEED") / 100.0),
            up_m_s=get("WPNAV_SPEED_UP") / 100.0,
            down_m_s=get("WPNAV_SPEED_DN") / 100.0,
            accel_m_s2=accel,
            accel_z_m_s2=get("WPNAV_ACCEL_Z") / 100.0,
            corner_m_s2=corner if corner > 0 else 2.0 * accel,
            jerk_m_s3=get("WPNAV_JERK"),
            radius_m=get("WPNAV_RADIUS") / 100.0,
        )

    # --- what others ask ---

    @property
    def here(self) -> Vector:
        """Where the copter is: east, north of where it was switched on, and height, m."""
        east, north = offset_m(*self._datum, self.boat.lat, self.boat.lon)
        return east, north, self.copter.alt_m

    @property
    def flying(self) -> bool:
        """Whether it has left the ground."""
        return self.stage is not Stage.LANDED and not (
            self.stage is Stage.TAKEOFF and self.copter.alt_m <= 0.0
        )

    @property
    def on_route_reached(self) -> bool:
        """Whether the waypoint that was flown to has been reached."""
        return self.stage is Stage.ROUTE and self.route.reached

    @property
    def has_landed(self) -> bool:
        """Whether it stands on the ground."""
        return self.stage is Stage.LANDED

    @property
    def wp_distance_m(self) -> float:
        """Distance to the present target, on the map."""
        if self.stage is not Stage.ROUTE:
            return 0.0
        east, north, _ = self.here
        return math.hypot(self.route.end[0] - east, self.route.end[1] - north)

    @property
    def cross_track_m(self) -> float:
        """Distance from the line between the waypoints."""
        if self.stage is not Stage.ROUTE:
            return 0.0
        (ax, ay, _), (bx, by, _), (x, y, _) = self.route.start, self.route.end, self.here
        length_m = math.hypot(bx - ax, by - ay)
        if length_m < 0.01:
            return 0.0
        return ((x - ax) * (by - ay) - (y - ay) * (bx - ax)) / length_m

    @property
    def target(self) -> tuple[float, float] | None:
        """Position ``(lat, lon)`` that is flown to."""
        if self.stage is not Stage.ROUTE:
            return None
        return moved(*self._datum, self.route.end[0], self.route.end[1])

    def place(self, lat: float, lon: float, alt_m: float) -> Vector:
        """Return a position in the copter's own frame: east, north, up, m."""
        east, north = offset_m(*self._datum, lat, lon)
        return east, north, alt_m

    # --- arming and modes ---

    def why_not_arm(self) -> str | None:
        """Return what an arming check would object to, or None."""
        allowed = self.mode in ARMABLE or (
            self.mode is CopterMode.AUTO and int(self.parameters["AUTO_OPTIONS"]) & ALLOW_ARMING
        )
        return super().why_not_arm() if allowed else f"{self.mode.name} mode not armable"

    def arm(self, *, force: bool = False) -> bool:
        """Arm unless a check objects; home is where it was armed."""
        before = self.armed
        if not super().arm(force=force):
            return False
        if not before:
            if not self._home_locked:
                self.set_home_here()
            self._auto_armed = False
            self._since_s = self.time_s
        return True

    def ask_disarm(self, *, force: bool) -> bool:
        """Disarm as a ground station asks for it: refused in flight, unless forced."""
        if self.armed and self.flying and not force:
            return False
        self.disarm()
        return True

    def disarm(self) -> None:
        """Stop the motors; the mission goes back to its beginning. In the air, it falls."""
        if self.armed:
            self.execution.reset()
            self.execution.leave()
        # the base class resets the mission too, outside AUTO
        super().disarm()
        self.copter.alt_m = 0.0
        self.copter.fly((0.0, 0.0, 0.0))
        self.stage = Stage.LANDED
        self._homeward = None
        self._land_at = None

    def start_mission(self) -> bool:
        """Change to AUTO as MISSION_START does: without waiting for the throttle stick."""
        if not self.set_mode(CopterMode.AUTO):
            return False
        self._auto_armed = True
        return True

    def set_mode(self, number: int) -> bool:
        """Change mode; False where the mode is unknown or can't be entered."""
        try:
            mode = CopterMode(number)
        except ValueError:
            self.say(WARNING, f"No such mode {number}")
            return False
        if mode is self.mode:
            return True
        reason = self._why_not_enter(mode) if self.armed else None
        if reason is None and mode is CopterMode.RTL and self.home is None:
            reason = "init failed"
        if reason is not None:
            self.say(WARNING, f"Mode change to {mode.name} failed: {reason}")
            return False
        if self.mode is CopterMode.AUTO:
            self.execution.leave()
        self.mode = mode
        self._homeward = None
        self._land_at = None
        if mode is CopterMode.RTL:
            self.head_home()
        elif mode is CopterMode.LAND:
            self.land()
        else:
            self.limits = self._usual_limits()
            self.loiter()
        if mode is CopterMode.AUTO:
            self.execution.enter()
        self.events.append(("mode", 0, ""))
        return True

    def _why_not_enter(self, mode: CopterMode) -> str | None:
        if mode in NAVIGATING and not self.can_navigate:
            return "requires position"
        if mode is CopterMode.AUTO:
            if self.mission.count() <= 1:
                return "init failed"
            if not self.flying and not self.execution.begins_with_takeoff():
                self.say(CRITICAL, "Auto: Missing Takeoff Cmd")
                return "init failed"
        return None

    # --- what it is told to do ---

    def take_off(self, alt_m: float) -> None:
        """Climb to a height straight above this place."""
        self.took_off = False
        self._takeoff_m = max(alt_m, self.copter.alt_m + (0.0 if self.flying else 1.0))
        self.stage = Stage.TAKEOFF
        self._since_s = self.time_s

    def ask_takeoff(self, alt_m: float) -> bool:
        """Take off as a ground station asks for it, in GUIDED or LOITER."""
        if self.mode not in (CopterMode.GUIDED, CopterMode.LOITER) or not self.armed:
            return False
        if self.flying or alt_m <= self.copter.alt_m:
            return False
        self._auto_armed = True
        self.take_off(alt_m)
        return True

    def fly_to(self, end: Vector, after: Vector | None) -> None:
        """Fly to a place, and pass it without a stop where the way goes on."""
        if not self.flying:
            return
        if self.stage is not Stage.ROUTE:
            at = self.here
            if self.stage is Stage.TAKEOFF:
                at = (at[0], at[1], self._takeoff_m)
            self.route = Route(at, self.limits)
        self.stage = Stage.ROUTE
        self.route.go(end, after)

    def go_to(self, lat: float, lon: float) -> bool:
        """Fly to a position at the present height; only in GUIDED."""
        if self.mode is not CopterMode.GUIDED or not self.has_position:
            return False
        self.fly_to(self.place(lat, lon, self.copter.alt_m), None)
        return True

    def set_speed(self, speed_m_s: float) -> bool:
        """Change the speed between waypoints."""
        if self.mode not in (CopterMode.AUTO, CopterMode.GUIDED, CopterMode.RTL):
            return False
        if not speed_m_s >= 0.1:
            return False
        self.limits = replace(self.limits, speed_m_s=speed_m_s)
        if self.stage is Stage.ROUTE:
            self.route.set_limits(self.limits)
        return True

    def loiter(self) -> None:
        """Stay in the air here (the base class calls it so), or on the ground."""
        self.submode = SubMode.LOITER
        if self.stage is not Stage.LANDED:
            self.stage = Stage.HOVER if self.flying else Stage.LANDED

    def land(self, at: Vector | None = None) -> None:
        """Land here, or at a place."""
        if not self.flying:
            return
        self._land_at = at
        if at is None:
            self.stage = Stage.LAND
            self._since_s = math.inf
        else:
            self.fly_to((at[0], at[1], self.copter.alt_m), None)

    def head_home(self) -> None:
        """Climb, cross to the nearest rally point or home, wait a little, land."""
        self.submode = SubMode.RETURN
        if not self.flying:
            return
        get = self.parameters.__getitem__
        speed = get("RTL_SPEED") / 100.0
        usual = self._usual_limits()
        self.limits = replace(usual, speed_m_s=speed) if speed > 0 else usual
        lat, lon = self._refuge()
        east, north, up = self.place(lat, lon, self._refuge_alt_m(lat, lon))
        x, y, here_m = self.here
        lowest = max(LOWEST_RETURN_M, here_m + max(0.0, get("RTL_CLIMB_MIN") / 100.0))
        goal = max(0.0, up, get("RTL_ALT") / 100.0, lowest)
        if get("RTL_CONE_SLOPE") >= GENTLEST_CONE:
            away = math.hypot(east - x, north - y)
            goal = min(goal, max(away * get("RTL_CONE_SLOPE"), lowest))
        if get("FENCE_ENABLE") and int(get("FENCE_TYPE")) & FENCE_ALT_MAX:
            goal = min(goal, get("FENCE_ALT_MAX") - get("FENCE_MARGIN"))
        goal = max(goal, here_m)
        self._return_to = (east, north, goal)
        self._homeward = Homeward.CLIMB
        self._since_s = self.time_s
        self.route = Route(self.here, self.limits)
        self.stage = Stage.ROUTE
        self.route.go((x, y, goal), self._return_to)

    def _refuge_alt_m(self, lat: float, lon: float) -> float:
        for item in self.rally.items:
            if (item.x * 1e-7, item.y * 1e-7) == (lat, lon):
                return item.z
        return 0.0

    # --- time ---

    def _step(self, dt_s: float) -> None:
        if self.home is None:
            if self.time_s + dt_s < FIXED_SHARE * self.ready_s:
                self.time_s += dt_s
                return
            self.set_home_here()
        while dt_s > 1e-9:
            step = min(dt_s, STEP_S)
            self.time_s += step
            dt_s -= step
            if self.mode is CopterMode.AUTO:
                self.execution.update()
            if self.armed:
                self._fly(step)
                self.camera.look()
        if not self.armed:
            return
        self._disarm_idle()
        self.guard.look()

    def _fly(self, dt_s: float) -> None:
        if self.stage is Stage.TAKEOFF:
            self._climb(dt_s)
        elif self.stage is Stage.ROUTE:
            self.route.advance(dt_s)
            self._move(self.route.position, self.route.velocity)
            self._look_ahead(dt_s)
            if self.route.reached:
                self._arrived()
        elif self.stage is Stage.HOVER:
            self._brake(dt_s)
        elif self.stage is Stage.LAND:
            self._descend(dt_s)
        if self._homeward is Homeward.WAIT:
            wait_s = self.parameters["RTL_LOIT_TIME"] / 1000.0
            if self.time_s - self._since_s >= wait_s and self.parameters["RTL_ALT_FINAL"] <= 0:
                self._homeward = Homeward.LAND
                self.land()

    def _arrived(self) -> None:
        if (
            self._homeward in (Homeward.CLIMB, Homeward.CROSS)
            and self.time_s - self._since_s < SHORTEST_LEG_S
        ):
            return
        if self._homeward is Homeward.CLIMB:
            self._homeward = Homeward.CROSS
            self._since_s = self.time_s
            self.route.go(self._return_to, None)
        elif self._homeward is Homeward.CROSS:
            self._homeward = Homeward.WAIT
            self.stage = Stage.HOVER
            self._since_s = self.time_s
        elif self._land_at is not None:
            self.land()

    def _move(self, position: Vector, velocity: Vector) -> None:
        self.boat.lat, self.boat.lon = moved(*self._datum, position[0], position[1])
        self.copter.alt_m = max(0.0, position[2])
        self.copter.fly(velocity)

    def _look_ahead(self, dt_s: float) -> None:
        (ax, ay, _), (bx, by, _) = self.route.start, self.route.end
        if self._homeward is None and math.hypot(bx - ax, by - ay) > HEADED_LEG_M:
            self.copter.turn(math.atan2(bx - ax, by - ay), dt_s, YAW_RATE_RAD_S)
        else:
            self.copter.turn_rad_s = 0.0

    def _brake(self, dt_s: float) -> None:
        east, north, up = self.copter.east_m_s, self.copter.north_m_s, self.copter.climb_m_s
        speed = math.hypot(east, north)
        keep = max(0.0, 1.0 - self.limits.accel_m_s2 * dt_s / speed) if speed > 1e-6 else 0.0
        rise = math.copysign(max(0.0, abs(up) - self.limits.accel_z_m_s2 * dt_s), up)
        velocity = (east * keep, north * keep, rise)
        x, y, z = self.here
        self._move((x + velocity[0] * dt_s, y + velocity[1] * dt_s, z + rise * dt_s), velocity)
        self.copter.turn_rad_s = 0.0

    def _climb(self, dt_s: float) -> None:
        """Spool up, then climb to the height asked for."""
        if not self._auto_armed:
            if not int(self.parameters["AUTO_OPTIONS"]) & NO_THROTTLE_STICK:
                self._since_s = self.time_s
                return
            self._auto_armed = True
        if self.copter.alt_m <= 0.0 and self.time_s - self._since_s < SPOOL_S:
            return
        left = self._takeoff_m - self.copter.alt_m
        wanted = min(self.limits.up_m_s, math.sqrt(2.0 * TAKEOFF_BRAKE_M_S2 * max(0.0, left)))
        grown = self.copter.climb_m_s + self.limits.accel_z_m_s2 * dt_s
        rise = min(wanted, grown)
        x, y, z = self.here
        self._move((x, y, min(self._takeoff_m, z + rise * dt_s)), (0.0, 0.0, rise))
        if left <= 0.06 and rise < TOOK_OFF_SHARE * self.limits.up_m_s + 1e-9:
            self.took_off = True
            if self.mode is not CopterMode.AUTO:
                self.stage = Stage.HOVER

    def _descend(self, dt_s: float) -> None:
        """Sink, slowly near the ground, and stop the motors when it is reached."""
        if math.hypot(self.copter.east_m_s, self.copter.north_m_s) > 0.05:
            self._brake(dt_s)
        if self.copter.alt_m <= 0.0:
            self.copter.fly((0.0, 0.0, 0.0))
            self._since_s = min(self._since_s, self.time_s)
            if self.time_s - self._since_s >= SETTLE_S:
                self.stage = Stage.LANDED
                if self.mode is not CopterMode.AUTO:
                    self.disarm()
            return
        self._since_s = math.inf
        slow = self.parameters["LAND_SPEED"] / 100.0
        fast = self.parameters["LAND_SPEED_HIGH"] / 100.0 or self.limits.down_m_s
        above = self.copter.alt_m - max(1.0, self.parameters["LAND_ALT_LOW"] / 100.0)
        wanted = math.sqrt(2.0 * self.limits.accel_z_m_s2 * above) if above > 0 else 0.0
        wanted = max(slow, min(fast, wanted))
        sink = min(wanted, -self.copter.climb_m_s + self.limits.accel_z_m_s2 * dt_s)
        x, y, z = self.here
        self._move((x, y, z - sink * dt_s), (0.0, 0.0, -sink))

    def _disarm_idle(self) -> None:
        """Disarm on the ground after DISARM_DELAY, unless it is about to take off."""
        delay_s = self.parameters["DISARM_DELAY"]
        if self.stage is not Stage.LANDED or delay_s <= 0:
            waits = self.stage is Stage.TAKEOFF and not self._auto_armed
            if not (waits and delay_s > 0):
                self._idle_since_s = self.time_s
                return
        if self.time_s - self._idle_since_s >= delay_s:
            self.disarm()

    # --- fence ---

    def fence_breaches_m(self) -> dict[int, float]:
        """Return how far outside its fences the copter is, its height included."""
        found = super().fence_breaches_m()
        above = self.copter.alt_m - self.parameters["FENCE_ALT_MAX"]
        if int(self.parameters["FENCE_TYPE"]) & FENCE_ALT_MAX and above > 0:
            found[FENCE_ALT_MAX] = above
        return found

    def act_on_breach(self, breach_m: float) -> None:
        """Do what FENCE_ACTION says about a new breach."""
        action = int(self.parameters["FENCE_ACTION"])
        if action == 0:
            return
        if not self.flying:
            self.disarm()
        elif breach_m > GIVE_UP_FENCE_M or action in (2, 5):
            self.set_mode(CopterMode.LAND)
        elif action == 4:
            self.set_mode(CopterMode.BRAKE)
        elif not self.set_mode(CopterMode.RTL):
            self.set_mode(CopterMode.LAND)

"""How a simulated copter moves: straight legs flown with limited jerk, corners cut by blending.

ArduCopter plans every leg as a movement from rest to rest and starts the next one before the
last has ended, so that the two add up to a rounded corner. The same is done here: a :class:`Ramp`
says how far along its leg a copter is, and :class:`Route` adds the end of one leg, the whole of the
next and the beginning of the one after. There is no wind, tilt, battery or control error.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

from mrmission.simulate.motion import Boat, wrapped

Vector = tuple[float, float, float]
"""East, north, up, m (or m/s)."""
JERK_M_S3 = 0.8
"""Of a leg, for WPNAV_JERK 1. ArduCopter lets the jerk itself rise and fall smoothly; this constant
one takes as long (fitted to flights of an ArduCopter in SITL)."""


def plus(a: Vector, b: Vector, factor: float = 1.0) -> Vector:
    """Return ``a + factor * b``."""
    return (a[0] + factor * b[0], a[1] + factor * b[1], a[2] + factor * b[2])


def length(a: Vector) -> float:
    """Return the length of a vector."""
    return math.sqrt(a[0] * a[0] + a[1] * a[1] + a[2] * a[2])


@dataclass(frozen=True, slots=True, kw_only=True)
class FlightLimits:
    """What legs keep to: ``WPNAV_*``, in metres and seconds."""

    speed_m_s: float = 10.0
    up_m_s: float = 2.5
    down_m_s: float = 1.5
    accel_m_s2: float = 2.5
    accel_z_m_s2: float = 1.0
    corner_m_s2: float = 5.0
    jerk_m_s3: float = 1.0
    radius_m: float = 2.0


class Ramp:
    """A movement over a straight leg, from rest to rest: speed up, cruise, slow down.

    Parameters
    ----------
    start, end : tuple of float
        East, north, up, m.
    limits : FlightLimits
        Of these, what binds along the leg.
    """

    __slots__ = ("accel", "cruise_s", "jerk", "jerk_s", "length_m", "ramp_s", "speed", "unit")

    def __init__(self, start: Vector, end: Vector, limits: FlightLimits) -> None:
        step = plus(end, start, -1.0)
        self.length_m = length(step)
        far = self.length_m > 1e-3
        self.unit: Vector = (
            (step[0] / self.length_m, step[1] / self.length_m, step[2] / self.length_m)
            if far
            else (0.0, 0.0, 0.0)
        )
        level = math.hypot(self.unit[0], self.unit[1])
        rise = abs(self.unit[2])
        vertical = limits.up_m_s if self.unit[2] >= 0 else limits.down_m_s
        self.speed = min(
            limits.speed_m_s / level if level > 1e-6 else math.inf,
            vertical / rise if rise > 1e-6 else math.inf,
        )
        self.accel = min(
            limits.accel_m_s2 / level if level > 1e-6 else math.inf,
            limits.accel_z_m_s2 / rise if rise > 1e-6 else math.inf,
        )
        self.jerk = JERK_M_S3 * limits.jerk_m_s3
        self.jerk_s = self.ramp_s = self.cruise_s = 0.0
        if not far:
            return
        # The highest speed that still leaves room to stop; a ramp of speed v covers v * ramp_s / 2.
        low, high = 0.0, self.speed
        if high * self._ramp_of(high)[1] > self.length_m:
            for _ in range(40):
                middle = 0.5 * (low + high)
                if middle * self._ramp_of(middle)[1] > self.length_m:
                    high = middle
                else:
                    low = middle
            self.speed = max(low, 1e-6)
        self.jerk_s, self.ramp_s = self._ramp_of(self.speed)
        self.cruise_s = max(0.0, self.length_m / self.speed - self.ramp_s)

    def _ramp_of(self, speed: float) -> tuple[float, float]:
        """Return (time of growing acceleration, whole time) to reach a speed from rest, s."""
        if speed * self.jerk <= self.accel * self.accel:
            jerk_s = math.sqrt(speed / self.jerk)
            return jerk_s, 2.0 * jerk_s
        jerk_s = self.accel / self.jerk
        return jerk_s, speed / self.accel + jerk_s

    @property
    def whole_s(self) -> float:
        """Time from rest to rest."""
        return 2.0 * self.ramp_s + self.cruise_s

    def at(self, time_s: float) -> tuple[float, float, float]:
        """Return (way, speed, acceleration) along the leg after `time_s`; m, m/s, m/s²."""
        if time_s <= 0.0 or self.length_m <= 1e-3:
            return 0.0, 0.0, 0.0
        if time_s >= self.whole_s:
            return self.length_m, 0.0, 0.0
        if time_s <= self.ramp_s:
            return self._rise(time_s)
        if time_s <= self.ramp_s + self.cruise_s:
            way = 0.5 * self.speed * self.ramp_s + self.speed * (time_s - self.ramp_s)
            return way, self.speed, 0.0
        way, speed, accel = self._rise(self.whole_s - time_s)
        return self.length_m - way, speed, -accel

    def _rise(self, t: float) -> tuple[float, float, float]:
        j, tj = self.jerk, self.jerk_s
        if t <= tj:
            return j * t**3 / 6.0, 0.5 * j * t * t, j * t
        flat_s = self.ramp_s - 2.0 * tj
        peak = j * tj
        way, speed = j * tj**3 / 6.0, 0.5 * j * tj * tj
        s = min(t - tj, flat_s)
        way, speed = way + speed * s + 0.5 * peak * s * s, speed + peak * s
        if t <= tj + flat_s:
            return way, speed, peak
        s = t - tj - flat_s
        return (
            way + speed * s + 0.5 * peak * s * s - j * s**3 / 6.0,
            speed + peak * s - 0.5 * j * s * s,
            peak - j * s,
        )

    def time_at(self, way_m: float) -> float:
        """Return when the copter is `way_m` along the leg, s."""
        low, high = 0.0, self.whole_s
        for _ in range(40):
            middle = 0.5 * (low + high)
            if self.at(middle)[0] < way_m:
                low = middle
            else:
                high = middle
        return high


@dataclass(slots=True)
class _Leg:
    start: Vector
    end: Vector
    ramp: Ramp
    elapsed_s: float = 0.0

    @property
    def left_s(self) -> float:
        return self.ramp.whole_s - self.elapsed_s


class Route:
    """Waypoint after waypoint: where a copter should be, and whether it has arrived.

    Parameters
    ----------
    at : tuple of float
        Where it hovers, east, north, up, m.
    limits : FlightLimits
        Of all its legs.
    """

    def __init__(self, at: Vector, limits: FlightLimits) -> None:
        self.limits = limits
        self.position = at
        self.velocity: Vector = (0.0, 0.0, 0.0)
        self.reached = True
        self._before: _Leg | None = None
        self._leg = _Leg(at, at, Ramp(at, at, limits))
        self._after: _Leg | None = None

    @property
    def start(self) -> Vector:
        """Where the present leg begins."""
        return self._leg.start

    @property
    def end(self) -> Vector:
        """Where the present leg ends."""
        return self._leg.end

    def go(self, end: Vector, after: Vector | None) -> None:
        """Fly to `end`; pass it without a stop where the way goes on to `after`."""
        if not self.reached:
            # the leg is broken off: stop as fast as the limits allow, and start from there
            here = plus(self.position, self.velocity, 0.5)
            self._before = None
            self._leg = _Leg(here, here, Ramp(here, here, self.limits))
            self._after = None
        ready = self._after
        if ready is not None and ready.end == end and ready.elapsed_s > 0.0:
            self._before, self._leg = self._leg, ready
        else:
            self._before = self._leg
            self._leg = _Leg(self._leg.end, end, Ramp(self._leg.end, end, self.limits))
        self._after = None if after is None else _Leg(end, after, Ramp(end, after, self.limits))
        self.reached = False

    def set_limits(self, limits: FlightLimits) -> None:
        """Change the limits; legs under way go on from where they are."""
        self.limits = limits
        for leg in (self._leg, self._after):
            if leg is not None:
                way = leg.ramp.at(leg.elapsed_s)[0]
                leg.ramp = Ramp(leg.start, leg.end, limits)
                leg.elapsed_s = leg.ramp.time_at(way) if way > 0 else 0.0

    def advance(self, dt_s: float) -> None:
        """Let time pass."""
        leg, after = self._leg, self._after
        leg.elapsed_s += dt_s
        if self._before is not None:
            self._before.elapsed_s += dt_s
            if self._before.left_s <= 0:
                self._before = None
        done = leg.left_s <= 0.0
        if after is not None:
            if after.elapsed_s > 0.0:
                after.elapsed_s += dt_s
                done = done or after.elapsed_s >= leg.left_s
            elif self._may_turn(leg, after):
                after.elapsed_s = dt_s
        self.position, self.velocity = self._state()
        if done:
            self.reached = True

    def _may_turn(self, leg: _Leg, after: _Leg) -> bool:
        """Whether the next leg can begin now: its middle stays near the corner, and gently so."""
        turn_out_s = leg.ramp.ramp_s + leg.ramp.cruise_s
        if leg.elapsed_s < turn_out_s - after.ramp.ramp_s:
            return False
        way = leg.ramp.at(leg.elapsed_s)[0]
        if way < 0.5 * leg.ramp.length_m or leg.left_s >= 0.5 * after.ramp.whole_s:
            return False
        half_s = 0.5 * leg.left_s
        way_1, speed_1, accel_1 = leg.ramp.at(leg.elapsed_s + half_s)
        way_2, speed_2, accel_2 = after.ramp.at(half_s)
        u, w = leg.ramp.unit, after.ramp.unit
        none: Vector = (0.0, 0.0, 0.0)
        away = plus(plus(none, u, way_1 - leg.ramp.length_m), w, way_2)
        velocity = plus(plus(none, u, speed_1), w, speed_2)
        accel = plus(plus(none, u, accel_1), w, accel_2)
        return (
            length(away) < self.limits.radius_m
            and math.hypot(*velocity[:2]) < min(leg.ramp.speed, after.ramp.speed)
            and math.hypot(*accel[:2]) < self.limits.corner_m_s2
        )

    def _state(self) -> tuple[Vector, Vector]:
        way, speed, _ = self._leg.ramp.at(self._leg.elapsed_s)
        position = plus(self._leg.start, self._leg.ramp.unit, way)
        velocity = plus((0.0, 0.0, 0.0), self._leg.ramp.unit, speed)
        if self._before is not None:
            ramp = self._before.ramp
            way, speed, _ = ramp.at(self._before.elapsed_s)
            position = plus(position, ramp.unit, way - ramp.length_m)
            velocity = plus(velocity, ramp.unit, speed)
        if self._after is not None and self._after.elapsed_s > 0.0:
            ramp = self._after.ramp
            way, speed, _ = ramp.at(self._after.elapsed_s)
            position = plus(position, ramp.unit, way)
            velocity = plus(velocity, ramp.unit, speed)
        return position, velocity


class Rotorcraft(Boat):
    """Position, height, heading and velocity of one copter."""

    __slots__ = ("alt_m", "climb_m_s", "east_m_s", "north_m_s")
    alt_m: float
    climb_m_s: float
    east_m_s: float
    north_m_s: float

    def __init__(self, lat: float, lon: float, heading_rad: float) -> None:
        super().__init__(lat, lon, heading_rad)
        self.alt_m = 0.0
        self.climb_m_s = 0.0
        self.north_m_s = 0.0
        self.east_m_s = 0.0

    @property
    def velocity_m_s(self) -> tuple[float, float]:
        """Velocity over ground: east, north."""
        return self.east_m_s, self.north_m_s

    def fly(self, velocity: Vector) -> None:
        """Take over a velocity; the position is the route's business."""
        self.east_m_s, self.north_m_s, self.climb_m_s = velocity
        self.speed_m_s = math.hypot(self.east_m_s, self.north_m_s)

    def turn(self, heading_rad: float, dt_s: float, rate_rad_s: float) -> float:
        """Turn towards a heading; return the angle that is left."""
        error = wrapped(heading_rad - self.heading_rad)
        step = max(-rate_rad_s * dt_s, min(rate_rad_s * dt_s, error))
        self.turn_rad_s = step / dt_s if dt_s > 0 else 0.0
        self.heading_rad = (self.heading_rad + step) % (2.0 * math.pi)
        return error - step

"""How fast a copter flies a path: legs of limited jerk, corners cut by blending, up and down.

ArduCopter plans every leg as a movement from rest to rest and starts the next one before the
last has ended, so that the two add up to a rounded corner. A :class:`Ramp` says how far along its
leg a copter is; :func:`turns_after_s` when the next one may begin. Measured against an ArduCopter
4.7 in SITL, see ``docs/vehicles.md``.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from mrmission.model import FloatArray, LegKind
from mrmission.options import PlanOptions
from mrmission.tour.timing import TimeModel, turns_deg

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


GAIN_LEGS_M = (5.0, 10.0, 20.0, 40.0, 80.0, 160.0, 400.0)
GAIN_DEG = tuple(float(angle) for angle in range(0, 181, 10))
"""Lengths and angles among which the corner that gains most is looked for."""
SPOOL_S = 3.4
"""From the start of a take-off until the ground is left."""
TAKEOFF_BRAKE_M_S2 = 0.56
SHORTEST_LEG_S = 1.6
"""A return's climb and its way take no less each: nobody hovers to the centimetre."""
WAIT_ABOVE_HOME_S = 5.0
SETTLE_S = 2.5
"""From touching the ground until the landing is believed."""
SLOW_BELOW_M, SLOW_M_S = 10.0, 0.5


def may_turn(leg: Ramp, after: Ramp, elapsed_s: float, limits: FlightLimits) -> bool:
    """Return whether the next leg can begin: its middle stays near the corner, and gently so."""
    left_s = leg.whole_s - elapsed_s
    if elapsed_s < leg.ramp_s + leg.cruise_s - after.ramp_s:
        return False
    if leg.at(elapsed_s)[0] < 0.5 * leg.length_m or left_s >= 0.5 * after.whole_s:
        return False
    half_s = 0.5 * left_s
    way_1, speed_1, accel_1 = leg.at(elapsed_s + half_s)
    way_2, speed_2, accel_2 = after.at(half_s)
    u, w = leg.unit, after.unit
    none: Vector = (0.0, 0.0, 0.0)
    away = plus(plus(none, u, way_1 - leg.length_m), w, way_2)
    velocity = plus(plus(none, u, speed_1), w, speed_2)
    accel = plus(plus(none, u, accel_1), w, accel_2)
    return (
        length(away) < limits.radius_m
        and math.hypot(*velocity[:2]) < min(leg.speed, after.speed)
        and math.hypot(*accel[:2]) < limits.corner_m_s2
    )


def turns_after_s(leg: Ramp, after: Ramp, limits: FlightLimits) -> float:
    """Return when the next leg begins, counted from the beginning of this one, s."""
    low, high = 0.0, leg.whole_s
    for _ in range(12):
        middle = 0.5 * (low + high)
        if may_turn(leg, after, middle, limits):
            high = middle
        else:
            low = middle
    return high


@lru_cache(maxsize=1 << 16)
def corner_s(
    before_m: float, after_m: float, turn_deg: float, before_m_s: float, after_m_s: float
) -> float:
    """Return what a leg takes until the next one begins, over its length / speed, s.

    Parameters
    ----------
    before_m, after_m
        Lengths of the two legs.
    turn_deg
        Change of course between them.
    before_m_s, after_m_s
        Their speeds.
    """
    turn = math.radians(turn_deg)
    corner: Vector = (0.0, before_m, 0.0)
    end = plus(corner, (math.sin(turn), math.cos(turn), 0.0), after_m)
    leg = Ramp((0.0, 0.0, 0.0), corner, FlightLimits(speed_m_s=before_m_s))
    after = Ramp(corner, end, FlightLimits(speed_m_s=after_m_s))
    limits = FlightLimits(speed_m_s=max(before_m_s, after_m_s))
    return turns_after_s(leg, after, limits) - before_m / before_m_s


def up_and_down_s(altitude_m: float, limits: FlightLimits) -> float:
    """Return the seconds of the take-off to a height and of the return from above home, in all."""
    up, down = limits.up_m_s, limits.down_m_s
    climb_s = altitude_m / up + 0.5 * up / limits.accel_z_m_s2 + 0.45 * up / TAKEOFF_BRAKE_M_S2
    fast_m = max(0.0, altitude_m - SLOW_BELOW_M)
    sink_s = fast_m / down + (altitude_m - fast_m) / SLOW_M_S + 0.75 * down / limits.accel_z_m_s2
    return SPOOL_S + climb_s + 2 * SHORTEST_LEG_S + WAIT_ABOVE_HOME_S + sink_s + SETTLE_S


@dataclass(frozen=True, slots=True, kw_only=True)
class FlightTimeModel(TimeModel):
    """How long a copter takes for a path, take-off and landing included.

    Parameters
    ----------
    altitude_m
        Height of the flight.
    """

    altitude_m: float = 30.0

    def lane_turn_s(self, spacing_m: float) -> float:
        """Return the extra seconds of a turn between two long lanes."""
        points = np.array([[0, 0], [0, 200], [spacing_m, 200], [spacing_m, 0]], dtype=np.float64)
        kind = np.ones(3, dtype=np.int8)
        return max(0.0, float(self.corners_s(points, kind).sum()))

    def corners_s(self, points_m: FloatArray, kind: np.ndarray) -> FloatArray:
        """Return (n - 2,) extra seconds at the inner points of a path."""
        if len(points_m) < 3:
            return np.zeros(0)
        step = np.diff(points_m, axis=0)
        metres, turn_deg = np.hypot(step[:, 0], step[:, 1]), turns_deg(step)
        speeds = self._speeds(kind).tolist()
        # longer legs are as if so long, and rounding lets most corners be looked up
        known = np.round(np.minimum(metres, 400.0), 1).tolist()
        extra = [
            corner_s(known[i], known[i + 1], round(float(turn), 1), speeds[i], speeds[i + 1])
            for i, turn in enumerate(turn_deg)
        ]
        return np.maximum(np.array(extra), self.least_corner_s(metres, turn_deg))

    def duration_s(self, points_m: FloatArray, kind: np.ndarray) -> float:
        """Return the seconds from the start of the mission until the motors stop."""
        moved = np.any(np.diff(points_m, axis=0) != 0, axis=1)
        if not moved.any():
            return 0.0
        points, kinds = points_m[np.append(True, moved)], kind[moved]
        # the last leg ends at rest
        last_m = float(np.hypot(*(points[-1] - points[-2])))
        speed = float(self._speeds(kinds[-1:])[0])
        last = Ramp((0.0, 0.0, 0.0), (0.0, last_m, 0.0), FlightLimits(speed_m_s=speed))
        stop_s = last.whole_s - last_m / speed
        along = self.legs_s(points, kinds).sum() + self.corners_s(points, kinds).sum()
        return float(along + stop_s + up_and_down_s(self.altitude_m, FlightLimits()))

    @property
    def long_leg_m(self) -> float:
        """Return the length from which on a leg reaches its speed, whatever comes behind it."""
        far = (0.0, 1e6, 0.0)
        limits = FlightLimits(speed_m_s=self.top_speed_m_s)
        return 2.0 * self.top_speed_m_s * Ramp((0.0, 0.0, 0.0), far, limits).ramp_s

    def short_row_s(self, leg_m: FloatArray) -> FloatArray:
        """Return that nothing is known of what a way takes beside a leg that is short."""
        return np.full(len(leg_m), np.inf)

    def most_gain_s(self, before: LegKind, after: LegKind) -> float:
        """Return what a corner between legs of these kinds may gain at most, 0 or more.

        Legs of many lengths and angles were looked at, and half as much is added.
        """
        one, two = self._speeds(np.array([before, after])).tolist()
        least = min(
            corner_s(a, b, angle, one, two)
            for a in GAIN_LEGS_M
            for b in GAIN_LEGS_M
            for angle in GAIN_DEG
        )
        return max(0.0, -1.5 * least)

    def swing_m(self, points_m: FloatArray, kind: np.ndarray) -> float:
        """Return how far a copter leaves a path at its corners: it cuts them within the radius."""
        return FlightLimits().radius_m


def time_model(options: PlanOptions) -> TimeModel:
    """Return how long the vehicles of a plan take."""
    if options.vehicle == "copter":
        return FlightTimeModel(
            survey_speed_m_s=options.survey_speed_m_s,
            transit_speed_m_s=options.transit_speed_m_s,
            swath_m=options.swath_m,
            altitude_m=options.altitude_m,
        )
    return TimeModel(
        survey_speed_m_s=options.survey_speed_m_s,
        transit_speed_m_s=options.transit_speed_m_s,
        steering=options.steering,
        radius_m=options.wp_radius_m,
        swath_m=options.swath_m,
        table=options.time_table,
        turn_radius_m=options.turn_radius_m,
    )

"""How a simulated copter moves: straight legs flown with limited jerk, corners cut by blending.

The physics is that of the time model (:mod:`mrmission.tour.flight`): a :class:`Route` adds the end
of one leg, the whole of the next and the beginning of the one after. There is no wind, tilt,
battery or control error.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

from mrmission.simulate.motion import Boat, wrapped
from mrmission.tour.flight import FlightLimits, Ramp, Vector, may_turn, plus

__all__ = ["FlightLimits", "Ramp", "Rotorcraft", "Route", "Vector"]


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
            elif may_turn(leg.ramp, after.ramp, leg.elapsed_s, self.limits):
                after.elapsed_s = dt_s
        self.position, self.velocity = self._state()
        if done:
            self.reached = True

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

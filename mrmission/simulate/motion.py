"""How a simulated boat moves: a point with a heading, limited in speed, braking and turning.

The model is kinematic. The boat steers for a point some metres ahead on the line between two
waypoints, turns no faster than a given rate, brakes before a corner down to a share of its speed
that depends on the corner's angle, and takes the next leg once it is within the acceptance radius.
Speed and heading are those through the water; a current carries the boat along, and the boat points
up into it to stay on its leg. There is no wind, wave, inertia sideways or throttle curve.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

METRES_PER_DEGREE = 111_319.490793
"""ArduPilot's own figure: metres per degree of latitude."""
STILL_M_S = 0.005
"""A boat that coasts more slowly than this lies still."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Kinematics:
    """Limits of the boat's motion.

    The defaults are those of a grid search that came nearest to the corner times of an ArduPilot
    motorboat in SITL, see ``docs/simulated-fleet.md``.

    Parameters
    ----------
    accel_m_s2, decel_m_s2 : float
        How fast speed grows and falls.
    turn_rate_deg_s : float
        Largest turn rate.
    turn_gain : float
        Turn rate asked per heading error, 1/s.
    lookahead_s : float
        Distance to the aiming point on the leg, in seconds of travel.
    slowest_share : float
        Share of the cruising speed that is kept in the sharpest corner.
    blend_m_s2 : float
        Acceleration with which ArduPilot blends one leg into the next: ATC_ACCEL_MAX.
    drag_per_m : float
        Drag of the hull without thrust: speed falls by this times its square per second. 0.25 is
        ArduPilot's simulated motorboat (half the square of the speed, in newtons, on 2 kg).
    turn_radius_m : float
        Of the tightest turn: how fast a slow boat turns.
    """

    accel_m_s2: float = 0.7
    decel_m_s2: float = 0.7
    turn_rate_deg_s: float = 40.0
    turn_gain: float = 2.0
    lookahead_s: float = 1.0
    slowest_share: float = 0.12
    blend_m_s2: float = 1.0
    drag_per_m: float = 0.25
    turn_radius_m: float = 0.9


def offset_m(lat: float, lon: float, to_lat: float, to_lon: float) -> tuple[float, float]:
    """Return ``(east_m, north_m)`` from one position (degrees) to another, on a local plane."""
    d_lon = (to_lon - lon + 180.0) % 360.0 - 180.0
    scale = math.cos(math.radians(0.5 * (lat + to_lat)))
    return d_lon * METRES_PER_DEGREE * scale, (to_lat - lat) * METRES_PER_DEGREE


def moved(lat: float, lon: float, east_m: float, north_m: float) -> tuple[float, float]:
    """Return the position (degrees) that lies `east_m`, `north_m` from another."""
    new_lat = lat + north_m / METRES_PER_DEGREE
    scale = math.cos(math.radians(0.5 * (lat + new_lat)))
    new_lon = lon + east_m / (METRES_PER_DEGREE * max(scale, 1e-9))
    return new_lat, (new_lon + 180.0) % 360.0 - 180.0


def wrapped(angle_rad: float) -> float:
    """Return an angle in (-π, π]."""
    return math.remainder(angle_rad, 2.0 * math.pi)


def corner_share(turn_rad: float, slowest_share: float) -> float:
    """Return the share of the cruising speed kept through a corner of `turn_rad` (0 = straight)."""
    return max(slowest_share, math.sqrt(max(0.0, math.cos(0.5 * min(abs(turn_rad), math.pi)))))


def blended_share(turn_rad: float, speed_m_s: float, radius_m: float, limits: Kinematics) -> float:
    """Return the share of the speed that is kept into a corner that may be cut by `radius_m`.

    ArduPilot lets the end of one leg and the beginning of the next overlap in time, for as long as
    the corner is missed by no more than the radius: the sum of a speed that falls and one that
    rises. With an acceleration a the overlap is sqrt(4 radius / (a sin(turn / 2))) and at most
    speed / a, which then costs no time at all.
    """
    half = math.sin(0.5 * min(abs(turn_rad), math.pi))
    if half < 1e-3 or speed_m_s <= 0.0:
        return 1.0
    overlap_s = math.sqrt(4.0 * radius_m / (limits.blend_m_s2 * half))
    lost = max(0.0, 1.0 - overlap_s * limits.blend_m_s2 / speed_m_s)
    return max(limits.slowest_share, 1.0 - math.sqrt(lost))


class Boat:
    """Position, heading and speed of one boat.

    Parameters
    ----------
    lat, lon : float
        Degrees.
    heading_rad : float
        Clockwise from north.
    """

    __slots__ = ("current_m_s", "heading_rad", "lat", "limits", "lon", "speed_m_s", "turn_rad_s")

    def __init__(
        self, lat: float, lon: float, heading_rad: float, limits: Kinematics | None = None
    ) -> None:
        self.lat = lat
        self.lon = lon
        self.heading_rad = heading_rad
        self.speed_m_s = 0.0
        """Through the water; negative is astern."""
        self.turn_rad_s = 0.0
        self.current_m_s = (0.0, 0.0)
        """Where the water goes: east, north."""
        self.limits = limits or Kinematics()

    @property
    def velocity_m_s(self) -> tuple[float, float]:
        """Velocity over ground: east, north."""
        return (
            self.speed_m_s * math.sin(self.heading_rad) + self.current_m_s[0],
            self.speed_m_s * math.cos(self.heading_rad) + self.current_m_s[1],
        )

    @property
    def alt_m(self) -> float:
        """Height above home."""
        return 0.0

    @property
    def climb_m_s(self) -> float:
        """Upward speed."""
        return 0.0

    @property
    def ahead_m_s(self) -> float:
        """Speed over ground in the direction of the bow."""
        return self.speed_m_s + self.carried_m_s

    @property
    def carried_m_s(self) -> float:
        """What of the current goes in the direction of the bow."""
        east, north = self.current_m_s
        return east * math.sin(self.heading_rad) + north * math.cos(self.heading_rad)

    def advance(self, dt_s: float, heading_rad: float, speed_m_s: float) -> None:
        """Move for `dt_s`, turning to a heading and changing to a speed within the limits."""
        limits = self.limits
        error = wrapped(heading_rad - self.heading_rad)
        if speed_m_s == 0.0 and self.speed_m_s == 0.0:
            self.turn_rad_s = 0.0
            self._drift(dt_s, 0.0, self.heading_rad)
            return
        before = self.speed_m_s
        change = speed_m_s - before
        slower = abs(speed_m_s) < abs(before)
        rate_m_s2 = limits.decel_m_s2 if slower else limits.accel_m_s2
        self.speed_m_s += max(-rate_m_s2 * dt_s, min(rate_m_s2 * dt_s, change))
        way = 0.5 * (before + self.speed_m_s) * dt_s
        # A rudder needs water that flows past it.
        most = min(math.radians(limits.turn_rate_deg_s), abs(way) / dt_s / limits.turn_radius_m)
        rate = max(-most, min(most, limits.turn_gain * error))
        if abs(rate * dt_s) > abs(error):
            rate = error / dt_s
        self.turn_rad_s = rate
        middle = self.heading_rad + 0.5 * rate * dt_s
        self.heading_rad = (self.heading_rad + rate * dt_s) % (2.0 * math.pi)
        self._drift(dt_s, way, middle)

    def make_good(self, dt_s: float, east_m_s: float, north_m_s: float) -> None:
        """Move for `dt_s` towards a velocity over ground, pointing up into the current."""
        east, north = east_m_s - self.current_m_s[0], north_m_s - self.current_m_s[1]
        self.advance(dt_s, math.atan2(east, north), math.hypot(east, north))

    def stop(self, dt_s: float) -> None:
        """Brake on the present heading until nothing goes past the bow or the stern."""
        self.advance(dt_s, self.heading_rad, -self.carried_m_s)

    def coast(self, dt_s: float) -> None:
        """Let go: no thrust, rudder amidships; the hull's drag slows the boat."""
        fade = 1.0 + self.limits.drag_per_m * abs(self.speed_m_s) * dt_s
        way = math.copysign(math.log(fade) / self.limits.drag_per_m, self.speed_m_s)
        self.speed_m_s = 0.0 if abs(self.speed_m_s) < STILL_M_S else self.speed_m_s / fade
        self.turn_rad_s = 0.0
        self._drift(dt_s, way if self.speed_m_s else 0.0, self.heading_rad)

    def _drift(self, dt_s: float, way_m: float, heading_rad: float) -> None:
        east = way_m * math.sin(heading_rad) + self.current_m_s[0] * dt_s
        north = way_m * math.cos(heading_rad) + self.current_m_s[1] * dt_s
        if east or north:
            self.lat, self.lon = moved(self.lat, self.lon, east, north)


class Leg:
    """One straight piece of way from A to B and what happens at its end.

    Parameters
    ----------
    start, end : tuple of float
        ``(lat, lon)``, degrees.
    after : tuple of float, optional
        Where the leg after this one goes; None where the boat stops at the end.
    """

    __slots__ = ("after_turn_rad", "after_unit", "end", "length_m", "start", "stops", "unit")

    def __init__(
        self,
        start: tuple[float, float],
        end: tuple[float, float],
        after: tuple[float, float] | None,
    ) -> None:
        self.start, self.end = start, end
        east, north = offset_m(*start, *end)
        self.length_m = math.hypot(east, north)
        self.unit = (
            (east / self.length_m, north / self.length_m) if self.length_m > 0.01 else (0.0, 0.0)
        )
        self.stops = after is None
        self.after_turn_rad = 0.0
        self.after_unit: tuple[float, float] | None = None
        if after is not None and self.length_m > 0.01:
            e, n = offset_m(*end, *after)
            if math.hypot(e, n) > 0.01:
                self.after_unit = (e / math.hypot(e, n), n / math.hypot(e, n))
                self.after_turn_rad = wrapped(math.atan2(e, n) - math.atan2(east, north))

    def state(self, boat: Boat) -> tuple[float, float, float]:
        """Return distance to the end, way left along the leg and cross-track error, metres."""
        east, north = offset_m(boat.lat, boat.lon, *self.end)
        u_e, u_n = self.unit
        distance = math.hypot(east, north)
        if self.length_m <= 0.01:
            return distance, 0.0, 0.0
        return distance, east * u_e + north * u_n, east * u_n - north * u_e

    def reached(self, boat: Boat, radius_m: float) -> bool:
        """Return whether the boat is within `radius_m` of the end, or past it."""
        distance, left, _ = self.state(boat)
        return distance <= radius_m or left <= 0.0

    def drive(self, boat: Boat, dt_s: float, speed_m_s: float, radius_m: float) -> None:
        """Move the boat along the leg for `dt_s` at no more than `speed_m_s`."""
        limits = boat.limits
        distance, left, cross = self.state(boat)
        ahead = max(1.0, limits.lookahead_s * speed_m_s)
        reach = math.sqrt(ahead * ahead - cross * cross) if abs(cross) < ahead else 0.2
        forward = min(reach, left)
        u_e, u_n = self.unit
        # From the boat to the aiming point: back to the line, then forward along it, and around
        # the corner as far as the acceptance radius lets it be cut.
        east = u_n * cross + u_e * forward
        north = -u_e * cross + u_n * forward
        beyond = min(reach - forward, radius_m)
        if beyond > 0.0 and self.after_unit is not None:
            east += self.after_unit[0] * beyond
            north += self.after_unit[1] * beyond
        if distance <= 0.01 or self.length_m <= 0.01:
            east, north = offset_m(boat.lat, boat.lon, *self.end)
        heading = math.atan2(east, north)
        error = abs(wrapped(heading - boat.heading_rad))
        kept = (
            0.0 if self.stops else blended_share(self.after_turn_rad, speed_m_s, radius_m, limits)
        )
        room = max(0.0, distance - (0.0 if self.stops else radius_m))
        wanted = min(
            speed_m_s,
            math.sqrt((kept * speed_m_s) ** 2 + 2.0 * limits.decel_m_s2 * room),
            speed_m_s * corner_share(error, limits.slowest_share),
        )
        wanted = max(wanted, 0.05)
        boat.make_good(dt_s, wanted * math.sin(heading), wanted * math.cos(heading))

"""How a boat stays where it is: ArduPilot's loitering, and its stop."""

from __future__ import annotations

import math

from mrmission.simulate.motion import Boat, moved, offset_m, wrapped

STOPPING_M_S2 = 1.0
"""With which the stopping place is reckoned: ArduPilot's ATC_ACCEL_MAX."""
STOPPED_M_S = 0.1
"""ATC_STOP_SPEED: below this the motor is off."""


class Loiter:
    """Keeps a boat at a place, or brings it to a stop.

    Within a radius of the place the boat makes no way over ground; outside it goes back, the
    faster the farther it is, and astern where the place lies behind it.

    Parameters
    ----------
    boat : Boat
        What is steered.
    """

    def __init__(self, boat: Boat) -> None:
        self.boat = boat
        self.begin()

    def begin(self) -> None:
        """Stay where the boat comes to a stop from here."""
        boat = self.boat
        self._heading_rad = boat.heading_rad
        self._stopped = False
        east, north = boat.velocity_m_s
        speed = math.hypot(east, north)
        share = 0.5 * speed / STOPPING_M_S2
        self.place = moved(boat.lat, boat.lon, east * share, north * share)

    def stop(self, dt_s: float) -> None:
        """Come to a stop, then let the boat drift."""
        if not self._stopped:
            self.boat.stop(dt_s)
            self._stopped = abs(self.boat.ahead_m_s) <= STOPPED_M_S
        else:
            self.boat.coast(dt_s)

    def stay(self, dt_s: float, radius_m: float, gain: float, most_m_s: float) -> None:
        """Hold the place.

        Parameters
        ----------
        dt_s : float
            Time to pass.
        radius_m : float
            LOIT_RADIUS.
        gain : float
            LOIT_SPEED_GAIN, speed per metre beyond the radius, 1/s.
        most_m_s : float
            Largest speed.
        """
        boat = self.boat
        east, north = offset_m(boat.lat, boat.lon, *self.place)
        away = math.hypot(east, north)
        speed = 0.0
        if away > radius_m:
            speed = min(most_m_s, gain * (away - radius_m))
            heading = math.atan2(east, north)
            error = wrapped(heading - boat.heading_rad)
            if abs(error) > 0.5 * math.pi:
                heading, speed = heading + math.pi, -speed
                error = wrapped(heading - boat.heading_rad)
            speed *= 1.0 - 0.5 * min(1.0, abs(error) / (0.5 * math.pi))
            self._heading_rad = heading
        # It is the speed over ground that is controlled, along the bow; sideways nothing is.
        boat.advance(dt_s, self._heading_rad, speed - boat.carried_m_s)

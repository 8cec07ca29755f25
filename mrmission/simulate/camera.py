"""A camera that is triggered by distance, as DO_SET_CAM_TRIGG_DIST asks for."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

from mrmission.simulate.motion import offset_m

if TYPE_CHECKING:
    from mrmission.simulate.autopilot import Autopilot


class Camera:
    """The camera of one vehicle; there is one where ``CAM1_TYPE`` is not 0.

    Parameters
    ----------
    pilot : Autopilot
        Whose way is measured, and who tells of each shot.
    """

    def __init__(self, pilot: Autopilot) -> None:
        self.pilot = pilot
        self.every_m = 0.0
        self.shots = 0
        self._last: tuple[float, float] | None = None

    def trigger_every(self, distance_m: float, *, now: bool) -> None:
        """Take a picture every so many metres (0: none any more), and one at once if `now`."""
        self.every_m = max(0.0, distance_m)
        if now:
            self._shoot()

    def look(self) -> None:
        """Take a picture where the way since the last one is long enough."""
        if self.every_m <= 0.0:
            return
        boat = self.pilot.boat
        if self._last is None:
            self._last = (boat.lat, boat.lon)
        elif math.hypot(*offset_m(*self._last, boat.lat, boat.lon)) >= self.every_m:
            self._shoot()

    def _shoot(self) -> None:
        self._last = (self.pilot.boat.lat, self.pilot.boat.lon)
        if self.pilot.parameters["CAM1_TYPE"]:
            self.shots += 1
            self.pilot.events.append(("shot", self.shots, ""))

"""When a vehicle notices that it has left its fence, and what it makes of it."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

from mrmission.simulate.fence import polygon_breach_m
from mrmission.simulate.motion import offset_m
from mrmission.simulate.wire import mavlink

if TYPE_CHECKING:
    from mrmission.simulate.autopilot import Autopilot

ALTITUDE, CIRCLE, POLYGON = 1, 2, 4
"""Bits of FENCE_TYPE."""
UNION = 2
"""FENCE_OPTIONS bit: inclusion areas add up instead of intersecting."""
CHECK_S = 0.5
BACKUP_M = 20.0
"""So much farther out, the circle is breached once more."""
RECOVERY_S = 10.0
"""After a change of mode outside the fence, breaches have no consequence for so long."""
_NAMES = {ALTITUDE: "Max Alt", CIRCLE: "Circle", POLYGON: "Polygon"}

INFO = mavlink.MAV_SEVERITY_INFO


def fence_names(kinds: int) -> str:
    """Return what ArduPilot calls a set of fences: ``Circle and Polygon fences``."""
    names = [name for bit, name in _NAMES.items() if kinds & bit]
    joined = " and ".join(filter(None, [", ".join(names[:-1]), names[-1]]))
    return f"{joined} fence{'s' if len(names) > 1 else ''}"


class FenceGuard:
    """Watches one vehicle's fence.

    Parameters
    ----------
    pilot : Autopilot
        Whose position, parameters and fence are looked at, and who acts.
    """

    def __init__(self, pilot: Autopilot) -> None:
        self.pilot = pilot
        self.breached = 0
        """Bits of the fences that are breached."""
        self.count = 0
        self.breached_at_s = 0.0
        self._backup_m = math.inf
        self._next_s = 0.0
        self._recovers_until_s = -math.inf

    @property
    def enabled(self) -> bool:
        """Whether the fence is to be kept."""
        return bool(self.pilot.parameters["FENCE_ENABLE"])

    def breaches_m(self) -> dict[int, float]:
        """Return how far outside its circle and its polygons the vehicle is, where it is."""
        pilot = self.pilot
        kinds = int(pilot.parameters["FENCE_TYPE"])
        found: dict[int, float] = {}
        if kinds & CIRCLE and pilot.home is not None:
            away = math.hypot(*offset_m(*pilot.home, pilot.boat.lat, pilot.boat.lon))
            if away >= pilot.parameters["FENCE_RADIUS"]:
                found[CIRCLE] = away - pilot.parameters["FENCE_RADIUS"]
        if kinds & POLYGON and pilot.fence.items:
            union = bool(int(pilot.parameters["FENCE_OPTIONS"]) & UNION)
            outside = polygon_breach_m(
                pilot.fence.items, pilot.boat.lat, pilot.boat.lon, union=union
            )
            if outside is not None:
                found[POLYGON] = outside
        return found

    def objection(self) -> str | None:
        """Return what an arming check says about the fence, or None."""
        if not self.enabled:
            return None
        kinds = int(self.pilot.parameters["FENCE_TYPE"])
        if not kinds & (CIRCLE | ALTITUDE) and not (kinds & POLYGON and self.pilot.fence.items):
            return "Fences enabled, but none selected"
        breached = sum(self.pilot.fence_breaches_m())
        return f"Vehicle breaching {fence_names(breached)}" if breached else None

    def look(self) -> None:
        """Look twice a second, and let the pilot act on a new breach."""
        if not self.enabled or self.pilot.time_s < self._next_s:
            return
        self._next_s = self.pilot.time_s + CHECK_S
        found = self.pilot.fence_breaches_m()
        now = sum(found)
        new = now & ~self.breached
        if CIRCLE in found and found[CIRCLE] >= self._backup_m:
            new |= CIRCLE
        if CIRCLE not in found:
            self._backup_m = math.inf
        elif new & CIRCLE:
            self._backup_m = found[CIRCLE] + BACKUP_M
        if new and not self.breached:
            self.count += 1
            self.breached_at_s = self.pilot.time_s
            # FENCE_STATUS, and not a word: ArduPilot leaves the talking to the change of mode.
            self.pilot.events.append(("fence", 0, ""))
        self.breached = now
        if not new:
            return
        if self.pilot.time_s >= self._recovers_until_s:
            self.pilot.act_on_breach(max(found[kind] for kind in found if kind & new))

    def mode_changed(self) -> None:
        """Take a change of mode outside the fence for an attempt to recover."""
        if self.breached and self.enabled:
            self._recovers_until_s = self.pilot.time_s + RECOVERY_S
            self.pilot.say(INFO, "Manual recovery started")

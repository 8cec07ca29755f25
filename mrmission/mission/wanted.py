"""What a vehicle's parameters should be for a mission: its fence, its return, its end.

A mission carries items, polygons and points. How high a fence reaches, what a breach does, how a
copter comes home are parameters of the vehicle; this is what they should be. Numbers are those of
ArduPilot 4.7; see ``docs/vehicles.md``.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

from mrmission.mission import mavlink
from mrmission.model import Mission
from mrmission.options import PlanOptions

FENCE_ALT_MAX_TYPE, FENCE_POLYGON_TYPE = 1, 4
"""Bits of FENCE_TYPE. The circle (2) is left out: by default it ends 300 m from home."""
FENCE_HEADROOM_M = 10.0
"""FENCE_ALT_MAX above the mission: an autopilot keeps 2 m below it, gusts and climbs overshoot."""
GROUND_ALTITUDE_M = 10.0
"""A copter below this height is not sent home lower than it."""


@dataclass(frozen=True, slots=True, kw_only=True)
class WantedParameter:
    """A parameter, the value to set, the range that will do, and why.

    ``low`` and ``high`` may be infinite; ``value`` lies between them.
    """

    name: str
    value: float
    low: float
    high: float
    reason: str

    def holds(self, value: float) -> bool:
        """Return whether a value that a vehicle has will do."""
        return self.low <= value <= self.high


def mission_altitude_m(mission: Mission) -> float:
    """Return the height of the highest waypoint, m above home or terrain; 0 on the water."""
    return max((i.z for i in mission.items[1:] if i.command in mavlink.NAVIGATION), default=0.0)


def above_terrain(mission: Mission) -> bool:
    """Return whether the mission's heights are above terrain."""
    terrain = (mavlink.FRAME_GLOBAL_TERRAIN_ALT, mavlink.FRAME_GLOBAL_TERRAIN_ALT + 1)
    return any(i.frame in terrain for i in mission.items if i.command in mavlink.NAVIGATION)


def wanted_parameters(mission: Mission) -> tuple[WantedParameter, ...]:
    """Return what a vehicle's parameters should be before it starts on a mission.

    Parameters
    ----------
    mission
        As exported or uploaded; ``vehicle`` says whose parameters they are.

    Returns
    -------
    tuple of WantedParameter
        In the order in which a person would set them; none for a mission without items.
    """
    if not mission.items:
        return ()
    out: list[WantedParameter] = []

    def want(name: str, value: float, reason: str, low: float | None = None,
             high: float | None = None) -> None:  # fmt: skip
        out.append(
            WantedParameter(
                name=name,
                value=value,
                low=value if low is None else low,
                high=value if high is None else high,
                reason=reason,
            )
        )

    copter = mission.vehicle == "copter"
    altitude_m = mission_altitude_m(mission)
    if mission.fence:
        want("FENCE_ENABLE", 1, "a fence that is off does nothing")
        if copter and not above_terrain(mission):
            want(
                "FENCE_TYPE",
                FENCE_ALT_MAX_TYPE | FENCE_POLYGON_TYPE,
                "polygons and greatest height; the circle ends FENCE_RADIUS from home",
            )
            ceiling_m = math.ceil(altitude_m + FENCE_HEADROOM_M)
            want(
                "FENCE_ALT_MAX",
                ceiling_m,
                f"the mission flies at {altitude_m:g} m above home",
                low=altitude_m + 5.0,
                high=math.inf,
            )
        else:
            reason = "polygons alone; the circle ends FENCE_RADIUS from home"
            if copter:
                reason += ", and the greatest height counts from home, the mission's from terrain"
            want("FENCE_TYPE", FENCE_POLYGON_TYPE, reason)
    if copter:
        # RTL_ALT is in centimetres
        height = max(altitude_m, GROUND_ALTITUDE_M)
        ceiling = [100 * w.value - 200 for w in out if w.name == "FENCE_ALT_MAX"]
        want(
            "RTL_ALT",
            100 * math.ceil(height),
            "a return from anywhere climbs to the mission's height first, above what it clears",
            low=100 * height,
            high=max(100 * height, ceiling[0]) if ceiling else math.inf,
        )
        want("RTL_ALT_FINAL", 0, "at home it lands; above 0 it hovers there until empty")
        if above_terrain(mission):
            want("TERRAIN_ENABLE", 1, "heights are above terrain: the vehicle needs its data")
    elif mission.vehicle == "rover":
        want("MIS_DONE_BEHAVE", 0, "at the end it holds; loitering is for boats")
    else:
        want("MIS_DONE_BEHAVE", 1, "at the end it holds its place; hold would let it drift")
    return tuple(out)


def vehicle_notes(mission: Mission, options: PlanOptions, launch_radius_m: float) -> list[str]:
    """Return what the user of a copter or rover must know and no file says, one line each.

    Parameters
    ----------
    mission
        One of the fleet, with items.
    options
        What was planned.
    launch_radius_m
        Around home, inside the fence.
    """
    if mission.vehicle == "boat" or not mission.items:
        return []
    settings = ", ".join(f"{w.name} {w.value:g}" for w in wanted_parameters(mission))
    notes = [f"set on every {mission.vehicle}: {settings}"]
    if mission.vehicle == "copter":
        notes.append(
            "homes lie over the water: launch from the shore or a boat within "
            f"{launch_radius_m:g} m of them; the copters land where they were armed "
            "(no rally points: a return would land on the nearest, in the water)"
        )
        if options.altitude_above == "terrain":
            notes.append(
                "heights are above terrain: without terrain data or a rangefinder on board a "
                "copter breaks off at its first waypoint"
            )
        beyond_m = max(options.runs_m) - options.clearance_m
        if beyond_m > 0:
            notes.append(
                f"turns reach up to {beyond_m:g} m over the shore and the islands, and so do the "
                "fences"
            )
    return notes

"""What a user may ask for, validated once: :class:`PlanOptions` and :class:`VehicleLimits`."""

from __future__ import annotations

import math
from dataclasses import dataclass, fields, replace
from typing import Any

from mrmission.errors import ConfigError
from mrmission.fleet import DEFAULT_RESERVE, MAX_RESERVE, Robot, robots_as_dicts
from mrmission.tour.tie_spec import TieSpec
from mrmission.tour.time_table import STEERINGS, TimeTable

METHODS = ("crc", "cac", "fhk", "nrc", "minmax")
VEHICLES = ("boat", "rover", "copter")
ALTITUDES_ABOVE = ("home", "terrain")
TRIGGERS = ("lanes", "continuous")
MIN_ALTITUDE_M, MAX_ALTITUDE_M = 2.0, 1000.0
"""Lower, a copter's own errors of height are as large; an autopilot takes 0 as "as before"."""
MAX_TURNAROUND_M = 500.0
MAX_SHORE_LAPS = 50
MAX_TURN_RADIUS_M = 200.0
MIN_LANE_OVERLAP_M = 0.02
"""Lanes lie at least this much closer than the swath, so that rounding opens no gap."""


@dataclass(frozen=True, slots=True, kw_only=True)
class VehicleLimits:
    """What an autopilot can hold (defaults: ArduPilot Rover without an SD card).

    ``fence_bytes`` is for polygons: of the store's 672 bytes, 4 are a header and 1 ends it. A
    fence of 668 bytes was seen to bring ArduRover down instead of being refused. ArduCopter has the
    same memory and keeps more of it for parameters, see :meth:`of`.
    """

    mission_items: int = 655
    fence_bytes: int = 667
    fence_polygon_points: int = 83
    rally_points: int = 50

    @classmethod
    def of(cls, vehicle: str) -> VehicleLimits:
        """Return what a boat, rover or copter holds without an SD card."""
        if vehicle != "copter":
            return cls()
        return cls(mission_items=650, fence_bytes=555, fence_polygon_points=69, rally_points=46)

    def fence_bytes_of(self, points: int) -> int:
        """Bytes that one polygon of `points` points takes in the fence store."""
        return 8 * points + 2


def polygon_points(fence_bytes: int) -> int:
    """Return how many points one fence polygon may have in a store of so many bytes."""
    return min(255, (fence_bytes - 2) // 8)


BOARD = VehicleLimits()
"""The limits of a plan for which none were given: those of its kind of vehicle."""


MAX_TIME_UNCERTAINTY = 0.5
"""A robot that may take half as long again is where it likes; more says nothing."""
REVERSAL_M = 6.0
"""How far a steered boat swings at a reversal: 5.8 m at most in twelve, docs/time-model.md."""


@dataclass(frozen=True, slots=True, kw_only=True)
class PlanOptions:
    """Options of one plan. Units are in the names; see `docs/cli.md` for the flags.

    Raises
    ------
    ConfigError
        When a value is outside its range.
    """

    robots: int = 1
    swath_m: float = 20.0
    overlap: float = 0.1
    clearance_m: float = 10.0
    survey_speed_m_s: float = 2.0
    transit_speed_m_s: float = 2.0
    starts_lonlat: tuple[tuple[float, float], ...] = ()
    method: str = "minmax"
    angle_deg: float | None = None
    across_wind_deg: float | None = None
    fairway: bool | None = None
    vehicle: str = "boat"
    altitude_m: float = 30.0
    altitude_above: str = "home"
    trigger_distance_m: float = 0.0
    trigger: str = "lanes"
    turnaround_m: float = 0.0
    steering: str = "steered"
    wp_radius_m: float = 1.0
    turn_radius_m: float = 0.0
    time_table: TimeTable | None = None
    berth_spacing_m: float = 15.0
    fence: bool = True
    fence_margin_m: float = 2.0
    part: int | None = None
    limits: VehicleLimits = BOARD
    seed: int = 0
    time_budget_s: float = 5.0
    fleet: tuple[Robot, ...] = ()
    endurance_s: float | None = None
    endurance_m: float | None = None
    reserve: float = DEFAULT_RESERVE
    swap_time_s: float = 0.0
    shore_laps: int = 0
    tie_lines: TieSpec | None = None
    run_in_m: float | None = None
    run_out_m: float | None = None
    separation_m: float = 20.0
    time_uncertainty: float = 0.05
    max_delay_s: float | None = None
    wait_in_mission: bool = False

    def __post_init__(self) -> None:
        if self.limits is BOARD:
            object.__setattr__(self, "limits", VehicleLimits.of(self.vehicle))

        def check(ok: bool, flag: str, value: object, rule: str) -> None:
            if not ok:
                raise ConfigError(f"{flag} {value}: must be {rule}")

        check(1 <= self.robots <= 250, "--k", self.robots, "between 1 and 250")
        for flag, value in (
            ("--swath", self.swath_m),
            ("--survey-speed", self.survey_speed_m_s),
            ("--transit-speed", self.transit_speed_m_s),
        ):
            check(math.isfinite(value) and value > 0, flag, value, "a finite number above 0")
        check(self.swath_m >= 0.5, "--swath", self.swath_m, "at least 0.5 m")
        check(
            0 <= self.overlap < 0.95,
            "--overlap",
            self.overlap,
            "a share (0.1 is 10 %), at least 0 and below 0.95",
        )
        check(
            math.isfinite(self.clearance_m) and self.clearance_m >= 0,
            "--clearance", self.clearance_m, "a finite number, 0 or more",
        )  # fmt: skip
        check(
            self.method in (*METHODS, "auto"),
            "--method",
            self.method,
            "one of " + ", ".join((*METHODS, "auto")),
        )
        check(
            math.isfinite(self.time_budget_s) and self.time_budget_s >= 0,
            "--time-budget",
            self.time_budget_s,
            "a finite number, 0 or more",
        )
        check(self.vehicle in VEHICLES, "--vehicle", self.vehicle, "one of " + ", ".join(VEHICLES))
        check(
            math.isfinite(self.altitude_m) and MIN_ALTITUDE_M <= self.altitude_m <= MAX_ALTITUDE_M,
            "--altitude",
            self.altitude_m,
            f"between {MIN_ALTITUDE_M:g} and {MAX_ALTITUDE_M:g} m",
        )
        check(
            self.altitude_above in ALTITUDES_ABOVE,
            "--altitude-above",
            self.altitude_above,
            "one of " + ", ".join(ALTITUDES_ABOVE),
        )
        check(
            self.vehicle == "copter" or self.altitude_above == "home",
            "--altitude-above",
            self.altitude_above,
            "home, except for --vehicle copter",
        )
        check(
            self.steering in STEERINGS,
            "--steering",
            self.steering,
            "one of " + ", ".join(STEERINGS),
        )
        check(
            math.isfinite(self.wp_radius_m) and 0 < self.wp_radius_m <= 100,
            "--wp-radius", self.wp_radius_m, "above 0 and at most 100 m",
        )  # fmt: skip
        check(
            math.isfinite(self.turn_radius_m) and 0 <= self.turn_radius_m <= MAX_TURN_RADIUS_M,
            "--turn-radius",
            self.turn_radius_m,
            f"between 0 (turns on the spot) and {MAX_TURN_RADIUS_M:g} m",
        )
        check(
            self.turn_radius_m == 0 or self.vehicle != "copter",
            "--turn-radius",
            self.turn_radius_m,
            "0 with --vehicle copter: it turns on the spot",
        )
        check(self.trigger in TRIGGERS, "--trigger", self.trigger, "one of " + ", ".join(TRIGGERS))
        check(
            self.trigger_distance_m == 0
            or (math.isfinite(self.trigger_distance_m) and self.trigger_distance_m >= 0.1),
            "--trigger-distance",
            self.trigger_distance_m,
            "0 (no camera) or at least 0.1 m",
        )
        check(
            math.isfinite(self.turnaround_m) and 0 <= self.turnaround_m <= MAX_TURNAROUND_M,
            "--turnaround",
            self.turnaround_m,
            f"between 0 and {MAX_TURNAROUND_M:g} m",
        )
        for flag, run_m in (("--run-in", self.run_in_m), ("--run-out", self.run_out_m)):
            check(
                run_m is None or (math.isfinite(run_m) and 0 <= run_m <= MAX_TURNAROUND_M),
                flag,
                run_m,
                f"between 0 and {MAX_TURNAROUND_M:g} m",
            )
        check(
            0 <= self.shore_laps <= MAX_SHORE_LAPS,
            "--shore-laps",
            self.shore_laps,
            f"between 0 and {MAX_SHORE_LAPS}",
        )
        for flag, asked in (("--shore-laps", self.shore_laps), ("--tie-lines", self.tie_lines)):
            if asked and self.method != "minmax":
                raise ConfigError(
                    f"{flag} {asked} with --method {self.method}: that planner shares out whole "
                    "cells of lanes and no other lines; give --method minmax"
                )
        check(
            self.angle_deg is None or -180 <= self.angle_deg <= 360,
            "--angle",
            self.angle_deg,
            "a bearing between -180 and 360 degrees",
        )
        check(
            self.across_wind_deg is None or 0 <= self.across_wind_deg <= 360,
            "--across-wind",
            self.across_wind_deg,
            "where the wind or current comes from, between 0 and 360 degrees",
        )
        if self.angle_deg is not None and self.across_wind_deg is not None:
            raise ConfigError(
                f"--angle {self.angle_deg:g} and --across-wind {self.across_wind_deg:g}: "
                "both say how the lanes lie; give one of them"
            )
        for flag, other in (
            ("--shore-laps", self.shore_laps),
            ("--tie-lines", self.tie_lines),
            ("--method", "" if self.method == "minmax" else self.method),
        ):
            if self.fairway and other:
                raise ConfigError(
                    f"--fairway with {flag} {other}: a fairway goes with plain lanes of the lane "
                    f"planner alone; leave out --fairway or {flag}"
                )
        check(
            len(self.starts_lonlat) in (0, 1, self.robots),
            "--start",
            f"given {len(self.starts_lonlat)} times",
            f"given once, or once per robot ({self.robots})",
        )
        for lon, lat in self.starts_lonlat:
            check(
                math.isfinite(lon) and math.isfinite(lat) and abs(lon) <= 360 and abs(lat) <= 90,
                "--start", f"{lon},{lat}", "LON,LAT in degrees",
            )  # fmt: skip

        for flag, least in (("--endurance", self.endurance_s), ("--endurance", self.endurance_m)):
            check(least is None or (math.isfinite(least) and least > 0), flag, least, "above 0")
        check(0 <= self.reserve <= MAX_RESERVE, "--reserve", self.reserve, "from 0 to 90 %")
        check(
            math.isfinite(self.swap_time_s) and self.swap_time_s >= 0,
            "--swap-time", self.swap_time_s, "a finite number, 0 or more",
        )  # fmt: skip
        check(
            math.isfinite(self.separation_m) and self.separation_m >= 0,
            "--separation", self.separation_m, "0 (off) or a finite number of metres above 0",
        )  # fmt: skip
        check(
            0 <= self.time_uncertainty <= MAX_TIME_UNCERTAINTY,
            "--time-uncertainty", self.time_uncertainty, "a share from 0 to 0.5 (0.05 is 5 %)",
        )  # fmt: skip
        check(
            self.max_delay_s is None or (math.isfinite(self.max_delay_s) and self.max_delay_s >= 0),
            "--max-delay", self.max_delay_s, "0 s or more",
        )  # fmt: skip
        check(
            not self.wait_in_mission or self.vehicle != "copter",
            "--wait-in-mission with --vehicle", self.vehicle,
            "boat or rover: a copter does not hover at its start",
        )  # fmt: skip
        check(
            len(self.fleet) in (0, self.robots),
            "--k", self.robots, f"the number of robots of the fleet, {len(self.fleet)}",
        )  # fmt: skip

    def of_robot(self, robot: int) -> PlanOptions:
        """Return the options as they are for one robot alone: its speeds, its swath, its limits.

        Parameters
        ----------
        robot
            Its number, from 1.
        """
        if not self.fleet:
            return self
        own = self.fleet[robot - 1]
        shared = {f.name for f in fields(self)} & {f.name for f in fields(own)}
        limits = self.limits
        if own.max_items is not None:
            limits = replace(limits, mission_items=own.max_items)
        if own.fence_bytes is not None:
            limits = replace(
                limits,
                fence_bytes=own.fence_bytes,
                fence_polygon_points=polygon_points(own.fence_bytes),
            )
        return replace(self, fleet=(), limits=limits, **{n: getattr(own, n) for n in shared})

    @property
    def bearing_deg(self) -> float | None:
        """Return the bearing asked for, at least 0 and below 180; None where it is to be found."""
        asked = self.angle_deg
        if self.across_wind_deg is not None:
            asked = self.across_wind_deg + 90.0
        return None if asked is None else asked % 180.0

    @property
    def may_have_fairway(self) -> bool:
        """Return whether lanes across the others may be made, where a plan with them is shorter.

        Not where the user says how lanes are to lie, and not together with shore laps or tie lines:
        those belong to lanes of one bearing.
        """
        if self.fairway is not None:
            return self.fairway
        plain = self.bearing_deg is None and not self.shore_laps and self.tie_lines is None
        return plain and self.method == "minmax"

    @property
    def lanes_alone_count(self) -> bool:
        """Return whether only lanes sweep: a camera is off, or turns are flown outside, elsewhere.

        Otherwise transits sweep what they pass, and a plan counts on it.
        """
        camera = self.trigger_distance_m > 0 and self.trigger == "lanes"
        return camera or max(self.runs_m) > 0

    @property
    def runs_m(self) -> tuple[float, float]:
        """Return the lengths of the run-in before a line and of the run-out after it, m."""
        run_in_m = self.turnaround_m if self.run_in_m is None else self.run_in_m
        run_out_m = self.turnaround_m if self.run_out_m is None else self.run_out_m
        return run_in_m, run_out_m

    @property
    def fence_room_m(self) -> float:
        """Distance that a fence keeps from the way, m, where the water has room for it.

        At least ``fence_margin_m``. A boat with a rudder leaves its way by up to `REVERSAL_M` at a
        reversal, which must not be a breach while there is water; half of the clearance is left
        to the fence, whose points are few.
        """
        if self.vehicle == "copter" or self.steering != "steered":
            return self.fence_margin_m
        return max(self.fence_margin_m, min(self.clearance_m / 2, REVERSAL_M))

    def as_dict(self) -> dict[str, Any]:
        """Return the options as plain JSON values."""
        out: dict[str, Any] = {}
        for item in fields(self):
            value = getattr(self, item.name)
            if isinstance(value, VehicleLimits):
                value = {f.name: getattr(value, f.name) for f in fields(value)}
            elif item.name == "fleet":
                value = robots_as_dicts(self.fleet)
            elif isinstance(value, TieSpec):
                value = str(value)
            elif isinstance(value, TimeTable):
                value = {"vehicle": value.vehicle, "command": value.command}
            out[item.name] = value
        return out

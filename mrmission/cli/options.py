"""Flags that several commands share, and how they become :class:`PlanOptions`."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any, TypeVar

import click
from click.core import ParameterSource

from mrmission.errors import ConfigError
from mrmission.options import (
    ALTITUDES_ABOVE,
    METHODS,
    TRIGGERS,
    VEHICLES,
    PlanOptions,
    VehicleLimits,
)
from mrmission.tour.time_table import STEERINGS, read_table

F = TypeVar("F", bound=Callable[..., Any])
DEFAULT = PlanOptions()
COPTER = VehicleLimits.of("copter")


class LonLat(click.ParamType[tuple[float, float]]):
    """``LON,LAT`` in degrees."""

    name = "lon,lat"

    def convert(
        self, value: Any, param: click.Parameter | None, ctx: click.Context | None
    ) -> tuple[float, float]:
        """Parse two numbers separated by a comma."""
        if isinstance(value, tuple):
            return value
        try:
            lon, lat = (float(part) for part in str(value).split(","))
        except ValueError:
            self.fail(
                f"{value!r} is not LON,LAT: two numbers in degrees, longitude first", param, ctx
            )
        return lon, lat


_AREA = [
    click.argument("area", type=click.Path(path_type=Path)),
    click.option(
        "--resolution",
        type=float,
        help="Metres per pixel, when AREA is an image (white free, black obstacle).",
    ),
    click.option("--origin", type=LonLat(), help="LON,LAT of the image's lower left corner."),
    click.option("--part", type=int, help="Which lake of the file, by size (1 is the largest)."),
    click.option("--islands", is_flag=True, help="Polygons inside the lake are islands."),
]
_PLAN = [
    click.option(
        "--k",
        "robots",
        type=int,
        default=DEFAULT.robots,
        show_default=True,
        help="Number of robots.",
    ),
    click.option(
        "--swath",
        "swath_m",
        type=float,
        default=DEFAULT.swath_m,
        show_default=True,
        help="Width of the sensor's footprint, m.",
    ),
    click.option(
        "--overlap",
        type=float,
        default=DEFAULT.overlap,
        show_default=True,
        help="Share of the swath that neighbouring lanes share, 0 to 0.95.",
    ),
    click.option(
        "--clearance",
        "clearance_m",
        type=float,
        default=DEFAULT.clearance_m,
        show_default=True,
        help="Distance kept from shore and islands, m.",
    ),
    click.option(
        "--survey-speed",
        "survey_speed_m_s",
        type=float,
        default=DEFAULT.survey_speed_m_s,
        show_default=True,
        help="Speed on lanes, m/s.",
    ),
    click.option(
        "--transit-speed",
        "transit_speed_m_s",
        type=float,
        default=None,
        help="Speed between lanes, m/s.  [default: the survey speed]",
    ),
    click.option(
        "--start",
        "starts_lonlat",
        type=LonLat(),
        multiple=True,
        help="LON,LAT where the robots start and end: once for all, or once per robot.",
    ),
    click.option(
        "--method",
        type=click.Choice([*METHODS, "auto"]),
        default=DEFAULT.method,
        show_default=True,
        help="Planner; auto takes the better of crc and cac; minmax shares out single lanes.",
    ),
    click.option(
        "--angle",
        "angle_deg",
        type=float,
        default=None,
        help="Compass bearing of the lanes, degrees.  [default: auto]",
    ),
    click.option(
        "--vehicle",
        type=click.Choice(VEHICLES),
        default=DEFAULT.vehicle,
        show_default=True,
        help="What sails, drives or flies.",
    ),
    click.option(
        "--steering",
        type=click.Choice(STEERINGS),
        default=DEFAULT.steering,
        show_default=True,
        help="How a boat turns: with a rudder, or on the spot; for durations.",
    ),
    click.option(
        "--wp-radius",
        "wp_radius_m",
        type=float,
        default=DEFAULT.wp_radius_m,
        show_default=True,
        help="The vehicles' WP_RADIUS, m; for durations.",
    ),
    click.option(
        "--time-model",
        type=click.Path(path_type=Path),
        metavar="FILE",
        help="Table of `mrmission calibrate`.  [default: ArduRover in SITL]",
    ),
    click.option(
        "--altitude",
        "altitude_m",
        type=float,
        default=DEFAULT.altitude_m,
        show_default=True,
        help="Height of the flight, m (copter).",
    ),
    click.option(
        "--altitude-above",
        type=click.Choice(ALTITUDES_ABOVE),
        default=DEFAULT.altitude_above,
        show_default=True,
        help="What --altitude is measured from; terrain needs terrain data or a rangefinder.",
    ),
    click.option(
        "--trigger-distance",
        "trigger_distance_m",
        type=float,
        default=DEFAULT.trigger_distance_m,
        show_default=True,
        help="Metres between two photos on a lane; 0: no camera.",
    ),
    click.option(
        "--trigger",
        type=click.Choice(TRIGGERS),
        default=DEFAULT.trigger,
        show_default=True,
        help="Camera on along each lane alone, or from the first lane to the last.",
    ),
    click.option(
        "--turnaround",
        "turnaround_m",
        type=float,
        default=DEFAULT.turnaround_m,
        show_default=True,
        help="Metres of run-in and run-out at the ends of a lane; on water only where there is "
        "room.",
    ),
    click.option(
        "--no-fence",
        "fence",
        is_flag=True,
        flag_value=False,
        default=True,
        help="Plan without a fence.",
    ),
    click.option(
        "--max-items",
        type=int,
        default=None,
        help="Mission items that a vehicle holds, home included.  [default: "
        f"{DEFAULT.limits.mission_items}; copters {COPTER.mission_items}]",
    ),
    click.option(
        "--fence-bytes",
        type=int,
        default=None,
        help="Fence store of a vehicle: 8n + 2 bytes for a polygon of n points.  [default: "
        f"{DEFAULT.limits.fence_bytes}; copters {COPTER.fence_bytes}]",
    ),
    click.option(
        "--time-budget",
        "time_budget_s",
        type=float,
        default=DEFAULT.time_budget_s,
        show_default=True,
        help="Seconds to search (minmax), counted in steps: the same answer on any machine.",
    ),
    click.option(
        "--seed",
        type=int,
        default=DEFAULT.seed,
        show_default=True,
        help="Seed of every random choice.",
    ),
]
ASSUMPTIONS = ("swath_m", "overlap", "clearance_m", "survey_speed_m_s", "starts_lonlat", "vehicle")


def area_options(command: F) -> F:
    """Add the argument AREA and the flags that say how to read it."""
    for option in reversed(_AREA):
        command = option(command)
    return command


def plan_options(command: F) -> F:
    """Add the flags of a plan."""
    for option in reversed(_PLAN):
        command = option(command)
    return command


def build_options(**flags: Any) -> PlanOptions:
    """Return the options for the values of the flags of :func:`plan_options`.

    Raises
    ------
    ConfigError
        When a value is out of range.
    """
    if flags["transit_speed_m_s"] is None:
        flags["transit_speed_m_s"] = flags["survey_speed_m_s"]
    usual = VehicleLimits.of(flags["vehicle"])
    max_items, fence_bytes = flags.pop("max_items"), flags.pop("fence_bytes")
    max_items = usual.mission_items if max_items is None else max_items
    fence_bytes = usual.fence_bytes if fence_bytes is None else fence_bytes
    if max_items < 4:
        raise ConfigError(f"--max-items {max_items}: must be at least 4")
    if fence_bytes < 26:
        raise ConfigError(f"--fence-bytes {fence_bytes}: must be at least 26, one triangle")
    time_model = flags.pop("time_model", None)
    if time_model is not None:
        flags["time_table"] = read_table(time_model)
    flags["limits"] = VehicleLimits(
        mission_items=max_items,
        fence_bytes=fence_bytes,
        fence_polygon_points=min(255, (fence_bytes - 2) // 8),
        rally_points=usual.rally_points,
    )
    return PlanOptions(**flags)


def assumed_options(ctx: click.Context, options: PlanOptions) -> dict[str, Any]:
    """Return what the user did not give, by name of the option, of what changes a mission."""
    values = options.as_dict()
    out = {}
    for name in ASSUMPTIONS:
        if ctx.get_parameter_source(name) == ParameterSource.DEFAULT:
            out[name] = values[name]
    if "starts_lonlat" in out:
        out["starts_lonlat"] = "at the shore of the largest part"
    return out

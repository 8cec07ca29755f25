"""Flags that several commands share, and how they become :class:`PlanOptions`."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import fields, replace
from pathlib import Path
from typing import Any, TypeVar

import click
from click.core import ParameterSource

from mrmission import quantity
from mrmission.cli.separation_options import SEPARATION, read_separation_flags
from mrmission.cli.survey_options import SURVEY, read_survey_flags
from mrmission.errors import ConfigError
from mrmission.fleet import (
    FleetFile,
    Robot,
    read_endurance,
    read_fleet,
    read_reserve,
    read_swap_time_s,
)
from mrmission.options import (
    ALTITUDES_ABOVE,
    METHODS,
    TRIGGERS,
    VEHICLES,
    PlanOptions,
    VehicleLimits,
    polygon_points,
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


class Share(click.ParamType[float]):
    """A share of 1, ``0.1`` or ``10%``."""

    name = "share"

    def convert(
        self, value: Any, param: click.Parameter | None, ctx: click.Context | None
    ) -> float:
        """Parse a number, or per cent."""
        try:
            return quantity.share(value)
        except ValueError:
            self.fail(f"{value!r} is not a share: a number from 0 to 1, or per cent", param, ctx)


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
        type=Share(),
        default=DEFAULT.overlap,
        show_default=True,
        help="Share of the swath that neighbouring lanes share, from 0 to below 0.95.",
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
        help="Planner: minmax shares out single lanes; crc, cac, fhk and nrc whole cells; auto "
        "takes the better of crc and cac.",
    ),
    click.option(
        "--angle",
        "angle_deg",
        type=float,
        default=None,
        help="Compass bearing of the lanes, degrees, -180 to 360.  [default: auto, the bearing of "
        "which plans for this fleet promise most]",
    ),
    click.option(
        "--across-wind",
        "across_wind_deg",
        metavar="DEG",
        type=float,
        default=None,
        help="Lanes across a wind or current that comes from DEG, instead of --angle.",
    ),
    click.option(
        "--fairway/--no-fairway",
        "fairway",
        default=None,
        help="Lanes across the others, swept on the way out and home, where that brings the last "
        "robot home earlier.  [default: with a bearing that is found]",
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
        help="How a boat turns: with a rudder, spared reversals, or on the spot.",
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
        "--turn-radius",
        "turn_radius_m",
        type=float,
        default=DEFAULT.turn_radius_m,
        show_default=True,
        help="Least radius of a turn, m; 0: turns on the spot.",
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
        help="Seconds to search (minmax), counted in steps: the same answer on any machine; 0 "
        "takes the first good plan.",
    ),
    click.option(
        "--seed",
        type=int,
        default=DEFAULT.seed,
        show_default=True,
        help="Seed of every random choice: same seed, same plan.",
    ),
]
_FLEET = [
    click.option(
        "--fleet",
        "fleet_file",
        type=click.Path(path_type=Path),
        metavar="FILE",
        help="TOML file of robots that differ; their number is --k.",
    ),
    click.option(
        "--endurance",
        metavar="TIME|LENGTH",
        default=None,
        help="How long (45min) or how far (12km) a robot goes before it must be home: its work is "
        "cut into trips.",
    ),
    click.option(
        "--reserve",
        metavar="SHARE",
        default=f"{DEFAULT.reserve:.0%}",
        show_default=True,
        help="Share of the endurance that is left when a robot is home.",
    ),
    click.option(
        "--swap-time",
        metavar="TIME",
        default="0s",
        show_default=True,
        help="Time between two trips of a robot, 5min.",
    ),
]
_TOLD = "mrmission.fleet-file"
"""Where a command's context keeps which options the fleet file gave."""
ASSUMPTIONS = ("swath_m", "overlap", "clearance_m", "survey_speed_m_s", "starts_lonlat", "vehicle")


def area_options(command: F) -> F:
    """Add the argument AREA and the flags that say how to read it."""
    for option in reversed(_AREA):
        command = option(command)
    return command


def plan_options(command: F) -> F:
    """Add the flags of a plan."""
    for option in reversed([*_PLAN, *SURVEY, *SEPARATION, *_FLEET]):
        command = option(command)
    return command


def build_options(**flags: Any) -> PlanOptions:
    """Return the options for the values of the flags of :func:`plan_options`.

    Raises
    ------
    ConfigError
        When a value is out of range.
    """
    read_survey_flags(flags)
    read_separation_flags(flags)
    file = _with_trips(flags)
    if file is not None:
        return _of_fleet(file, flags)
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
        fence_polygon_points=polygon_points(fence_bytes),
        rally_points=usual.rally_points,
    )
    return PlanOptions(**flags)


def _with_trips(flags: dict[str, Any]) -> FleetFile | None:
    """Read the values of the flags of :data:`_FLEET`, in place; return the fleet's file."""

    def read(flag: str, value: Any, reader: Callable[[object], Any]) -> Any:
        try:
            return reader(value)
        except ValueError as error:
            raise ConfigError(f"{flag} {value}: {error}") from error

    endurance = flags.pop("endurance", None)
    seconds, metres = (None, None)
    if endurance is not None:
        seconds, metres = read("--endurance", endurance, read_endurance)
    flags["endurance_s"], flags["endurance_m"] = seconds, metres
    flags["reserve"] = read("--reserve", flags.get("reserve", DEFAULT.reserve), read_reserve)
    swap_time = flags.pop("swap_time", DEFAULT.swap_time_s)
    flags["swap_time_s"] = read("--swap-time", swap_time, read_swap_time_s)
    path = flags.pop("fleet_file", None)
    return None if path is None else read_fleet(path)


def _of_fleet(file: FleetFile, flags: dict[str, Any]) -> PlanOptions:
    """Return the options of a fleet file and of the flags given beside it."""
    given = {name for name in flags if _is_given(name)}
    of_robots = {f.name for f in fields(Robot)}
    if "vehicle" in given and file.vehicle not in (None, flags["vehicle"]):
        raise ConfigError(
            f"--vehicle {flags['vehicle']} and --fleet {file.path}: the file says {file.vehicle}; "
            "leave one of the two out"
        )
    flags["vehicle"] = file.vehicle or flags["vehicle"]
    usual = {n: v for n, v in flags.items() if n in of_robots and n not in given}
    beside = {n: v for n, v in flags.items() if n in of_robots and n in given}
    if "robots" in given:
        beside["robots"] = flags["robots"]
    starts = flags["starts_lonlat"]
    own_starts = any("start_lonlat" in table for table in file.tables)
    if starts and own_starts:
        raise ConfigError(
            f"--start and --fleet {file.path}: robots of the file have their own start; leave one "
            "of the two out"
        )
    top = dict(file.top)
    # where no robot has a start of its own, the one at the top is one that all berths lie around
    shared_start = None if own_starts else top.pop("start_lonlat", None)
    if _is_given("endurance"):
        beside.update({n: flags[n] for n in ("endurance_s", "endurance_m")})
    usual = {n: v for n, v in usual.items() if v is not None}
    robots = replace(file, top=top).robots(beside, usual)
    if not starts and all(robot.start_lonlat for robot in robots):
        starts = tuple(robot.start_lonlat for robot in robots if robot.start_lonlat)
    elif not starts and shared_start:
        starts = (shared_start,)
    ctx = click.get_current_context(silent=True)
    if ctx is not None:
        told = set(file.top) | {name for table in file.tables for name in table}
        ctx.meta[_TOLD] = {"starts_lonlat" if n == "start_lonlat" else n for n in told}
    first = robots[0]
    return build_options(
        **{
            **flags,
            **{n: getattr(first, n) for n in of_robots & flags.keys()},
            "max_items": flags["max_items"],
            "fence_bytes": flags["fence_bytes"],
            "robots": len(robots),
            "swath_m": min(robot.swath_m for robot in robots),
            "starts_lonlat": starts,
            "endurance": None,
            "swap_time": flags["swap_time_s"],
            "fleet": robots,
        }
    )


def _is_given(name: str) -> bool:
    """Return whether the user gave an option of the command that runs."""
    ctx = click.get_current_context(silent=True)
    name = {"swap_time_s": "swap_time"}.get(name, name)
    return ctx is not None and ctx.get_parameter_source(name) not in (
        None, ParameterSource.DEFAULT, ParameterSource.DEFAULT_MAP,
    )  # fmt: skip


def assumed_options(ctx: click.Context, options: PlanOptions) -> dict[str, Any]:
    """Return what the user did not give, by name of the option, of what changes a mission."""
    values = options.as_dict()
    out = {}
    told = ctx.meta.get(_TOLD, set())
    for name in ASSUMPTIONS:
        if ctx.get_parameter_source(name) == ParameterSource.DEFAULT and name not in told:
            out[name] = values[name]
    if "starts_lonlat" in out:
        out["starts_lonlat"] = "at the shore of the largest part"
    return out

"""A fleet of robots that differ: speeds, swaths, starts, endurance; from one TOML file.

The keys of the file are the names of the flags. Those at the top hold for all robots, those of a
``[[robot]]`` table for one; ``count = 3`` makes three robots of one table. Numbers are in metres,
m/s and seconds; texts carry their unit (:mod:`mrmission.quantity`). See
``docs/fleets-and-sorties.md``.
"""

from __future__ import annotations

import difflib
import math
import tomllib
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, fields
from pathlib import Path
from typing import Any

from mrmission import quantity
from mrmission.errors import ConfigError, InputError
from mrmission.tour.time_table import STEERINGS

MAX_ROBOTS = 250
DEFAULT_SPEED_M_S = 2.0
DEFAULT_RESERVE = 0.2
"""Share of the endurance that is left when a robot is home again."""
MAX_RESERVE = 0.9
MIN_ITEMS, MIN_FENCE_BYTES = 8, 26


@dataclass(frozen=True, slots=True, kw_only=True)
class Robot:
    """What one robot of a fleet is like.

    Attributes
    ----------
    name
        What people call it; may be empty.
    start_lonlat
        Where it starts and ends, degrees; None where one start for all is given or chosen.
    survey_speed_m_s, transit_speed_m_s
        On lanes and between them.
    swath_m
        Width of its footprint.
    steering, wp_radius_m
        How it turns; for durations.
    turn_radius_m
        Least radius of its turns; 0 turns as `steering` has it.
    endurance_s, endurance_m
        How long, or how far, it goes on one battery; None where that does not bind.
    reserve
        Share of the endurance that is left when it is home.
    swap_time_s
        Between the end of a trip and the start of its next.
    max_items, fence_bytes
        What its autopilot holds; None takes the kind of vehicle's.
    """

    name: str = ""
    start_lonlat: tuple[float, float] | None = None
    survey_speed_m_s: float = DEFAULT_SPEED_M_S
    transit_speed_m_s: float = DEFAULT_SPEED_M_S
    swath_m: float = 20.0
    steering: str = "steered"
    wp_radius_m: float = 1.0
    turn_radius_m: float = 0.0
    endurance_s: float | None = None
    endurance_m: float | None = None
    reserve: float = DEFAULT_RESERVE
    swap_time_s: float = 0.0
    max_items: int | None = None
    fence_bytes: int | None = None


@dataclass(frozen=True, slots=True, kw_only=True)
class FleetFile:
    """A fleet file as read: every value checked, nothing filled in.

    Attributes
    ----------
    path
        For messages.
    top
        Fields of :class:`Robot` that hold for all, by name.
    vehicle
        Kind of the vehicles, where the file says it.
    tables
        Fields of each robot by name, ``count`` already carried out.
    """

    path: str
    top: Mapping[str, Any]
    vehicle: str | None
    tables: tuple[Mapping[str, Any], ...]

    def robots(
        self, given: Mapping[str, Any] | None = None, usual: Mapping[str, Any] | None = None
    ) -> tuple[Robot, ...]:
        """Return the robots, everything filled in.

        A robot's own table comes first, then what was `given` beside the file, then the top of the
        file, then what is `usual`. A transit speed that nobody gives is the robot's survey speed.

        Parameters
        ----------
        given
            Fields of :class:`Robot` that flags give, and ``robots``, their number.
        usual
            Fields of :class:`Robot` where nobody says anything.

        Raises
        ------
        ConfigError
            When a flag contradicts the file, or some robots have a start and others have none.
        """
        given = dict(given or {})
        count = given.pop("robots", None)
        if count is not None and count != len(self.tables):
            raise ConfigError(
                f"--k {count} and --fleet {self.path}: the file has {len(self.tables)} robots; "
                "leave --k out"
            )
        for field in given:
            if all(field in table for table in self.tables):
                flag = "--" + _key_of(field)
                raise ConfigError(
                    f"{flag} and --fleet {self.path}: every robot of the file has its own "
                    f"{_key_of(field)}; leave one of the two out"
                )
        out = []
        for table in self.tables:
            values = {**(usual or {}), **self.top, **given, **table}
            for own in (table, given, self.top):
                if "endurance_s" in own or "endurance_m" in own:
                    # a time given at one place takes the place of a distance given at another
                    values["endurance_s"] = own.get("endurance_s")
                    values["endurance_m"] = own.get("endurance_m")
                    break
            if not any("transit_speed_m_s" in own for own in (table, given, self.top)):
                values["transit_speed_m_s"] = values.get("survey_speed_m_s", DEFAULT_SPEED_M_S)
            out.append(Robot(**values))
        without = [i for i, robot in enumerate(out, start=1) if robot.start_lonlat is None]
        if 0 < len(without) < len(out):
            raise ConfigError(
                f"{self.path}: robot {without[0]} has no start while others have one; give it a "
                "start, or one for all at the top"
            )
        return tuple(out)


def _key_of(field: str) -> str:
    """Return a field's key in the file, which is the name of its flag."""
    for key, (name, _) in _KEYS.items():
        if name == field or (key == "endurance" and field.startswith("endurance")):
            return key
    return field


def _above_zero(read: Callable[[object], float], least: float = 0.0) -> Callable[[object], float]:
    def checked(value: object) -> float:
        number = read(value)
        if not number > 0 or number < least:
            raise ValueError(f"must be at least {least:g}" if least else "must be above 0")
        return number

    return checked


def _not_below_zero(read: Callable[[object], float]) -> Callable[[object], float]:
    def checked(value: object) -> float:
        number = read(value)
        if not number >= 0:
            raise ValueError("must be 0 or more")
        return number

    return checked


def _whole(least: int) -> Callable[[object], int]:
    def checked(value: object) -> int:
        if isinstance(value, bool) or not isinstance(value, int):
            raise ValueError("must be a whole number")
        if value < least:
            raise ValueError(f"must be at least {least}")
        return value

    return checked


def _one_of(names: Sequence[str]) -> Callable[[object], str]:
    def checked(value: object) -> str:
        if value not in names:
            raise ValueError("must be one of " + ", ".join(names))
        return str(value)

    return checked


def read_endurance(value: object) -> tuple[float | None, float | None]:
    """Return an endurance above 0 as (seconds, metres), one of them None; ValueError if not."""
    seconds, metres = quantity.endurance(value)
    if not (seconds or metres or 0) > 0:
        raise ValueError("must be above 0")
    return seconds, metres


def read_reserve(value: object) -> float:
    """Return a reserve, a share from 0 to 0.9; ValueError if it is not one."""
    kept = quantity.share(value)
    if not 0 <= kept <= MAX_RESERVE:
        raise ValueError(f"must be a share from 0 to {MAX_RESERVE:.0%}")
    return kept


def read_swap_time_s(value: object) -> float:
    """Return a time between two trips, s, 0 or more; ValueError if it is not one."""
    return _not_below_zero(quantity.time_s)(value)


def _start(value: object) -> tuple[float, float]:
    parts: Sequence[Any] = value.split(",") if isinstance(value, str) else []
    if isinstance(value, list) and not any(isinstance(part, bool) for part in value):
        parts = value
    try:
        lon, lat = (float(part) for part in parts)
    except (ValueError, TypeError):
        raise ValueError("must be LON,LAT in degrees, longitude first") from None
    if not (math.isfinite(lon) and math.isfinite(lat) and abs(lon) <= 360 and abs(lat) <= 90):
        raise ValueError("must be LON,LAT in degrees, longitude first")
    return lon, lat


def _text(value: object) -> str:
    if not isinstance(value, str):
        raise ValueError("must be a text")
    return value


_KEYS: dict[str, tuple[str, Callable[[object], Any]]] = {
    "start": ("start_lonlat", _start),
    "survey-speed": ("survey_speed_m_s", _above_zero(quantity.speed_m_s)),
    "transit-speed": ("transit_speed_m_s", _above_zero(quantity.speed_m_s)),
    "swath": ("swath_m", _above_zero(quantity.length_m, 0.5)),
    "steering": ("steering", _one_of(STEERINGS)),
    "wp-radius": ("wp_radius_m", _above_zero(quantity.length_m)),
    "turn-radius": ("turn_radius_m", _not_below_zero(quantity.length_m)),
    "endurance": ("endurance", read_endurance),
    "reserve": ("reserve", read_reserve),
    "swap-time": ("swap_time_s", read_swap_time_s),
    "max-items": ("max_items", _whole(MIN_ITEMS)),
    "fence-bytes": ("fence_bytes", _whole(MIN_FENCE_BYTES)),
}
"""Keys of the file with the field each fills and what reads its value."""
_OF_ONE: dict[str, Callable[[object], Any]] = {"name": _text, "count": _whole(1)}
_OF_ALL: dict[str, Callable[[object], Any]] = {"vehicle": _one_of(("boat", "rover", "copter"))}


def read_fleet(path: Path) -> FleetFile:
    """Read a fleet file.

    Raises
    ------
    InputError
        When it cannot be read, or is no TOML.
    ConfigError
        When it has no robot, an unknown key, or a value that cannot be used: names file, table
        and key.
    """
    try:
        document = tomllib.loads(path.read_text(encoding="utf-8"))
    except FileNotFoundError:
        raise InputError(f"--fleet {path}: no such file") from None
    except (OSError, UnicodeDecodeError) as error:
        raise InputError(f"--fleet {path}: cannot be read: {error}") from error
    except tomllib.TOMLDecodeError as error:
        raise InputError(f"{path}: is no TOML: {error}") from error
    tables = document.pop("robot", [])
    if isinstance(tables, dict):
        raise ConfigError(f"{path}: [robot] must be [[robot]]: one such table for each robot")
    if not isinstance(tables, list) or not all(isinstance(table, dict) for table in tables):
        raise ConfigError(f"{path}: robot must be tables: [[robot]]")
    if not tables:
        raise ConfigError(f"{path}: has no [[robot]]; give one such table for each robot")
    vehicle = document.pop("vehicle", None)
    if vehicle is not None:
        vehicle = _read(_OF_ALL["vehicle"], vehicle, f"{path}: vehicle")
    top = _table(document, f"{path}: ", {**_OF_ALL})
    robots: list[Mapping[str, Any]] = []
    for number, table in enumerate(tables, start=1):
        name = table.get("name")
        where = f"{path}: [[robot]] {number}" + (f" ({name})" if isinstance(name, str) else "")
        values = _table(table, f"{where}: ", _OF_ONE)
        count = values.pop("count", 1)
        if count > 1 and values.get("name"):
            label = values.pop("name")
            robots += [{**values, "name": f"{label} {i}"} for i in range(1, count + 1)]
        else:
            robots += [values] * count
        if len(robots) > MAX_ROBOTS:
            raise ConfigError(f"{where}: makes {len(robots)} robots; at most {MAX_ROBOTS} may be")
    return FleetFile(path=str(path), top=top, vehicle=vehicle, tables=tuple(robots))


def _table(
    table: Mapping[str, Any], where: str, more: Mapping[str, Callable[[object], Any]]
) -> dict[str, Any]:
    """Return the fields of one table of the file."""
    out: dict[str, Any] = {}
    for given, value in table.items():
        key = given.replace("_", "-")
        if key not in _KEYS and key not in more:
            raise ConfigError(f"{where}unknown key {given!r}; {_suggestion(key, more)}")
        field, read = _KEYS[key] if key in _KEYS else (key, more[key])
        if field in out or (field == "endurance" and "endurance_s" in out):
            raise ConfigError(f"{where}{key} is given twice")
        found = _read(read, value, f"{where}{given}")
        if field == "endurance":
            out["endurance_s"], out["endurance_m"] = found
        else:
            out[field] = found
    return out


def _suggestion(key: str, more: Mapping[str, Any]) -> str:
    known = sorted({*_KEYS, *more})
    near = difflib.get_close_matches(key, known, n=1)
    if near:
        return f"did you mean {near[0]}?"
    elsewhere = [
        place for names, place in ((_OF_ONE, "in a [[robot]]"), (_OF_ALL, "at the top of the file"))
        if key in names
    ]  # fmt: skip
    if elsewhere:
        return f"it stands {elsewhere[0]}"
    return "known are " + ", ".join(known)


def _read(read: Callable[[object], Any], value: object, where: str) -> Any:
    try:
        return read(value)
    except ValueError as error:
        shown = f'"{value}"' if isinstance(value, str) else value
        raise ConfigError(f"{where} = {shown}: {error}") from error


def robots_as_dicts(robots: Sequence[Robot]) -> list[dict[str, Any]]:
    """Return robots as plain JSON values, for the report."""
    return [{f.name: getattr(robot, f.name) for f in fields(robot)} for robot in robots]


def swath_note(robots: Sequence[Robot]) -> str | None:
    """Return what to say about a fleet of several swaths; None where all have one.

    Lanes are shared among all robots, and which robot sweeps a lane is settled by the search: a
    lane beside the lane of a narrower robot must lie within that one's reach, so the narrowest
    swath spaces them all.
    """
    narrow = min((robot.swath_m for robot in robots), default=0.0)
    wider = [i for i, robot in enumerate(robots, start=1) if robot.swath_m > narrow]
    if not wider:
        return None
    names = ", ".join(str(i) for i in wider[:8]) + (" …" if len(wider) > 8 else "")
    return (
        f"lanes are spaced for the narrowest swath, {narrow:g} m, because any robot may get the "
        f"lane beside any other's; the wider footprint of robot{'s' * (len(wider) > 1)} {names} "
        "is not used (the lower bound for any plan counts it)"
    )

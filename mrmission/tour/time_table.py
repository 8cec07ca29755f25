"""What corners cost a vehicle, as measured: the table that `mrmission calibrate` writes.

A row is one steering type at one speed and one WP_RADIUS. The rows of a steering type fill a grid
of speeds and radii; the time model interpolates between them.
"""

from __future__ import annotations

import json
import math
from collections.abc import Mapping
from dataclasses import asdict, dataclass, fields
from functools import lru_cache
from pathlib import Path
from typing import Any

from mrmission.errors import InputError

STEERINGS = ("steered", "pivoting")
KIND = "mrmission time table"
VERSION = 1
PACKAGED = "time_table.json"


@dataclass(frozen=True, slots=True, kw_only=True)
class CornerCost:
    """A corner of one angle between long legs.

    Attributes
    ----------
    angle_deg
        Change of course, above 0 to 180.
    extra_s
        Seconds over length / speed, mean of the repeats; negative where the boat cuts it.
    spread_s
        Largest less smallest of the repeats.
    swing_m, beyond_m
        Largest distance from the planned way, and how far the boat went beyond the corner in the
        direction from which it came; the largest of the repeats.
    """

    angle_deg: float
    extra_s: float
    spread_s: float
    swing_m: float
    beyond_m: float


@dataclass(frozen=True, slots=True, kw_only=True)
class ChainCost:
    """Corners with short legs between, together.

    Attributes
    ----------
    kind
        ``turn``: two corners to the same side, from lane to lane; ``stairs``: to either side in
        turn.
    angle_deg
        Of the first corner; the second of a turn has the rest of 180.
    leg_m
        Length of each leg between two corners.
    corners
        How many.
    extra_s, spread_s, swing_m, beyond_m
        As of a corner; the distance beyond is that beyond the first corner (of a turn).
    """

    kind: str
    angle_deg: float
    leg_m: float
    corners: int
    extra_s: float
    spread_s: float
    swing_m: float
    beyond_m: float


@dataclass(frozen=True, slots=True, kw_only=True)
class TimeRow:
    """One steering type at one speed and WP_RADIUS.

    Attributes
    ----------
    steering
        ``steered`` or ``pivoting``.
    speed_m_s, radius_m
        WP_SPEED and WP_RADIUS.
    start_s, end_s
        Extra seconds from the order to start to the first leg's middle, and from the last leg's
        middle to the last waypoint, where the boat stops.
    corners, chains
        What was measured.
    """

    steering: str
    speed_m_s: float
    radius_m: float
    start_s: float
    end_s: float
    corners: tuple[CornerCost, ...]
    chains: tuple[ChainCost, ...]


@dataclass(frozen=True, slots=True, kw_only=True)
class SpeedChange:
    """A change of speed at a waypoint: seconds over length / speed, the leg after it being long."""

    steering: str
    from_m_s: float
    to_m_s: float
    extra_s: float


@dataclass(frozen=True, slots=True, kw_only=True)
class TimeTable:
    """All rows, and where they come from.

    Attributes
    ----------
    rows
        By steering, speed and radius; a grid of speeds and radii for each steering type.
    speed_changes
        May be empty.
    vehicle
        What was measured, for example ``ArduRover V4.7.0-dev motorboat in SITL``.
    command
        The command that measured it.
    repeats
        How often each manoeuvre was sailed to each side.
    """

    rows: tuple[TimeRow, ...]
    speed_changes: tuple[SpeedChange, ...] = ()
    vehicle: str = ""
    command: str = ""
    repeats: int = 1

    def of(self, steering: str) -> tuple[TimeRow, ...]:
        """Return the rows of a steering type, by speed and radius.

        Raises
        ------
        InputError
            When the table has none.
        """
        rows = [row for row in self.rows if row.steering == steering]
        if not rows:
            there = sorted({row.steering for row in self.rows})
            raise InputError(
                f"time table: nothing measured for --steering {steering}, only for "
                f"{', '.join(there) or 'nothing'}"
            )
        return tuple(sorted(rows, key=lambda row: (row.speed_m_s, row.radius_m)))


def table_text(table: TimeTable) -> str:
    """Return a table as JSON."""
    data = {"fileType": KIND, "version": VERSION, **asdict(table)}
    return json.dumps(data, indent=1) + "\n"


def read_table(path: Path, *, whole: bool = True) -> TimeTable:
    """Read the table that ``mrmission calibrate`` wrote; it must be complete if `whole`.

    Raises
    ------
    InputError
        When the file cannot be read, or is no such table.
    """
    try:
        text = path.read_text(encoding="utf-8")
    except (OSError, UnicodeDecodeError) as error:
        raise InputError(f"time table {path}: {error}") from error
    return parse_table(text, str(path), whole=whole)


@lru_cache(maxsize=1)
def default_table() -> TimeTable:
    """Return the packaged table, measured on ArduRover in SITL."""
    text = Path(__file__).with_name(PACKAGED).read_text(encoding="utf-8")
    return parse_table(text, PACKAGED)


def parse_table(text: str, source: str, *, whole: bool = True) -> TimeTable:
    """Return the table of a JSON text.

    Raises
    ------
    InputError
        When it is no table, or (if `whole`) its rows fill no grid of speeds and radii.
    """
    try:
        data = json.loads(text)
        if data.get("fileType") != KIND:
            raise ValueError(f'its fileType is {data.get("fileType")!r}, wanted "{KIND}"')
        if data.get("version") != VERSION:
            raise ValueError(f"its version is {data.get('version')!r}, wanted {VERSION}")
        table = TimeTable(
            rows=tuple(_row(row) for row in data["rows"]),
            speed_changes=tuple(
                SpeedChange(**_checked(SpeedChange, change)) for change in data["speed_changes"]
            ),
            vehicle=str(data["vehicle"]),
            command=str(data["command"]),
            repeats=int(data["repeats"]),
        )
    except KeyError as error:
        raise InputError(f"time table {source}: {error} is missing") from error
    except (ValueError, TypeError, AttributeError) as error:
        raise InputError(f"time table {source}: {error}") from error
    if whole:
        _check_grid(table, source)
    return table


def _checked(kind: type, data: Mapping[str, Any]) -> dict[str, Any]:
    """Return the fields of a dataclass from JSON; numbers must be finite."""
    out: dict[str, Any] = {}
    for item in fields(kind):
        value = data[item.name]
        if item.type in ("float", "int"):
            if not isinstance(value, (int, float)) or not math.isfinite(value):
                raise ValueError(f"{item.name} is {value!r}, wanted a number")
            value = int(value) if item.type == "int" else float(value)
        elif item.type == "str":
            value = str(value)
        out[item.name] = value
    return out


def _row(data: Mapping[str, Any]) -> TimeRow:
    values = _checked(TimeRow, data)
    values["corners"] = tuple(CornerCost(**_checked(CornerCost, c)) for c in data["corners"])
    values["chains"] = tuple(ChainCost(**_checked(ChainCost, c)) for c in data["chains"])
    return TimeRow(**values)


def _check_grid(table: TimeTable, source: str) -> None:
    for steering in sorted({row.steering for row in table.rows}):
        rows = [row for row in table.rows if row.steering == steering]
        there = [(row.speed_m_s, row.radius_m) for row in rows]
        speeds = sorted({speed for speed, _ in there})
        radii = sorted({radius for _, radius in there})
        missing = [(s, r) for s in speeds for r in radii if (s, r) not in there]
        if steering not in STEERINGS or missing or len(set(there)) != len(there):
            what = f"misses {missing[0]}" if missing else "has a row twice or an unknown steering"
            raise InputError(
                f"time table {source}: {steering}: every speed with every radius is wanted, once; "
                f"it {what}"
            )
        shapes = {tuple(c.angle_deg for c in row.corners) for row in rows}
        if len(shapes) != 1 or not next(iter(shapes)):
            raise InputError(f"time table {source}: {steering}: all rows must have the same angles")
        if any(row.speed_m_s <= 0 or row.radius_m < 0 for row in rows):
            raise InputError(f"time table {source}: {steering}: a speed or radius is not positive")

"""Waypoint files in the "QGC WPL 110" text format of Mission Planner, MAVProxy and QGroundControl.

References
----------
MAVLink developer guide, "Plain-text file format" (https://mavlink.io/en/file_formats/).
"""

from __future__ import annotations

import math
import os
from pathlib import Path

import numpy as np

from mrmission.errors import PlanFormatError
from mrmission.mission import mavlink
from mrmission.mission.files import write_whole
from mrmission.model import FencePolygon, Mission, MissionItem, RallyPoint, read_only

HEADER = "QGC WPL 110"
COLUMNS = (
    "index", "current", "frame", "command", "param1", "param2", "param3", "param4",
    "latitude", "longitude", "altitude", "autocontinue",
)  # fmt: skip


def waypoints_text(mission: Mission) -> str:
    """Return the items of a mission as the text of a ``.waypoints`` file; row 0 is home.

    The format has no place for fence and rally points in a mission file; they are in the ``.plan``.

    Parameters
    ----------
    mission
        What to write; without items only the header is left.
    """
    rows = [HEADER]
    for item in mission.items:
        in_degrees = item.frame in mavlink.DEGREE_FRAMES
        rows.append(
            "\t".join(
                (
                    str(item.seq),
                    str(item.current),
                    str(item.frame),
                    str(item.command),
                    *map(_number, (item.param1, item.param2, item.param3, item.param4)),
                    mavlink.degrees_text(item.x) if in_degrees else str(item.x),
                    mavlink.degrees_text(item.y) if in_degrees else str(item.y),
                    _number(item.z),
                    str(item.autocontinue),
                )
            )
        )
    return "\n".join(rows) + "\n"


def write_waypoints(
    mission: Mission, path: str | os.PathLike[str], *, overwrite: bool = False
) -> None:
    """Write the items of a mission as a ``.waypoints`` file, whole or not at all.

    Parameters
    ----------
    mission
        What to write.
    path
        The file.
    overwrite
        Whether a file that is already there may be replaced.
    """
    write_whole(path, waypoints_text(mission), overwrite)


def _number(value: float) -> str:
    """Return a number with six decimals where they hold it, with all of them otherwise."""
    short = f"{value:.6f}"
    return short if math.isnan(value) or float(short) == value else repr(float(value))


def read_waypoints(path: str | os.PathLike[str], *, vehicle: str | None = None) -> Mission:
    """Read a ``.waypoints`` file: a mission, or a fence or rally points in the same format.

    Parameters
    ----------
    path
        The file.
    vehicle
        What the mission is for. The file does not say: without this a mission with a take-off is
        a copter's, any other a boat's.

    Raises
    ------
    PlanFormatError
        When the file cannot be read: names file, line, column and value.
    """
    source = Path(path)
    try:
        text = source.read_text(encoding="utf-8-sig")
    except (OSError, UnicodeDecodeError) as error:
        reason = getattr(error, "strerror", None) or "not UTF-8 text"
        raise PlanFormatError(f"{source}: cannot be read: {reason}") from error
    return parse_waypoints(text, source=str(source), vehicle=vehicle)


def parse_waypoints(text: str, *, source: str = "waypoints", vehicle: str | None = None) -> Mission:
    """Read the text of a ``.waypoints`` file, see :func:`read_waypoints`.

    Parameters
    ----------
    text
        The file's content.
    source
        What to call it in messages.
    vehicle
        What the mission is for, see :func:`read_waypoints`.

    Raises
    ------
    PlanFormatError
        When it is no valid waypoint file.
    """
    lines = text.splitlines()
    if not lines or lines[0].split() != HEADER.split():
        first = lines[0][:40] if lines else ""
        raise PlanFormatError(f"{source}: line 1 is {first!r}: must be {HEADER!r}")
    items: list[MissionItem] = []
    for number, line in enumerate(lines[1:], start=2):
        if line.strip() and not line.startswith("#"):
            items.append(_row(source, number, line.split(), len(items)))
    if vehicle is None:
        flies = any(i.command == mavlink.NAV_TAKEOFF for i in items)
        vehicle = "copter" if flies else "boat"
    return Mission(
        robot=1,
        sortie=1,
        vehicle=vehicle,
        items=tuple(i for i in items if i.command < mavlink.FENCE_RETURN_POINT),
        fence=_fence(source, items),
        rally=tuple(
            RallyPoint(lat_e7=i.x, lon_e7=i.y, altitude_m=i.z)
            for i in items
            if i.command == mavlink.RALLY_POINT
        ),
    )


def _row(source: str, line: int, cells: list[str], seq: int) -> MissionItem:
    if len(cells) != len(COLUMNS):
        raise PlanFormatError(
            f"{source}: line {line} has {len(cells)} columns: must be {len(COLUMNS)}"
        )

    def fail(column: int, rule: str) -> PlanFormatError:
        return PlanFormatError(
            f"{source}: line {line}, {COLUMNS[column]} is {cells[column]!r}: must be {rule}"
        )

    def whole(column: int, high: int) -> int:
        try:
            value = int(cells[column])
        except ValueError:
            raise fail(column, "a whole number") from None
        if not 0 <= value <= high:
            raise fail(column, f"from 0 to {high}")
        return value

    def number(column: int, *, nan: bool = False) -> float:
        try:
            value = float(cells[column])
        except ValueError:
            raise fail(column, "a number") from None
        if math.isinf(value) or (math.isnan(value) and not nan):
            raise fail(column, "a finite number")
        return value

    if whole(0, 65535) != seq:
        raise fail(0, f"{seq}, rows in order without gaps")
    frame = whole(2, 21)
    x, y = number(8), number(9)
    in_degrees = frame in mavlink.DEGREE_FRAMES
    if in_degrees and abs(x) > 90:
        raise fail(8, "from -90 to 90 degrees")
    if in_degrees and abs(y) > 180:
        raise fail(9, "from -180 to 180 degrees")
    for column, value in ((8, x), (9, y)):
        if abs(value) >= 2**31:
            raise fail(column, "a number below 2147483648")
    return MissionItem(
        seq=seq,
        frame=frame,
        command=whole(3, 65535),
        current=whole(1, 1),
        autocontinue=whole(11, 1),
        param1=number(4, nan=True),
        param2=number(5, nan=True),
        param3=number(6, nan=True),
        param4=number(7, nan=True),
        x=mavlink.e7(x) if in_degrees else round(x),
        y=mavlink.e7(y) if in_degrees else round(y),
        z=number(10, nan=True),
    )


def _fence(source: str, items: list[MissionItem]) -> tuple[FencePolygon, ...]:
    """Gather fence corners: every corner carries the number of corners of its polygon."""
    out: list[FencePolygon] = []
    at = 0
    while at < len(items):
        item = items[at]
        if item.command in (mavlink.FENCE_INCLUSION_CIRCLE, mavlink.FENCE_EXCLUSION_CIRCLE):
            raise PlanFormatError(
                f"{source}: row {item.seq} is a fence circle: draw it as a polygon"
            )
        if item.command not in (mavlink.FENCE_INCLUSION_VERTEX, mavlink.FENCE_EXCLUSION_VERTEX):
            at += 1
            continue
        corners = items[at : at + int(item.param1)] if item.param1 >= 3 else []
        if len(corners) != item.param1 or any(
            (c.command, c.param1) != (item.command, item.param1) for c in corners
        ):
            raise PlanFormatError(
                f"{source}: row {item.seq} begins a fence polygon of {item.param1:g} corners, "
                "which do not follow"
            )
        points = np.array([(c.x, c.y) for c in corners], dtype=np.int64)
        out.append(
            FencePolygon(
                inclusion=item.command == mavlink.FENCE_INCLUSION_VERTEX,
                points_e7=read_only(points),
            )
        )
        at += len(corners)
    return tuple(out)

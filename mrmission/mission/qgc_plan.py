"""QGroundControl ``.plan`` files: mission, fence and rally points in one JSON document.

References
----------
QGroundControl developer guide, "Plan file format"
(https://docs.qgroundcontrol.com/master/en/qgc-dev-guide/file_formats/plan.html).
"""

from __future__ import annotations

import json
import math
import os
import re
from collections.abc import Sequence
from pathlib import Path
from typing import Any, NoReturn

import numpy as np

from mrmission.errors import PlanFormatError
from mrmission.mission import mavlink
from mrmission.mission.files import write_whole
from mrmission.mission.mavlink import degrees, wrap_lon_deg
from mrmission.model import FencePolygon, Mission, MissionItem, RallyPoint, read_only

FIRMWARE_ARDUPILOT = 3
ALTITUDE_MODE = {3: 1, 6: 1, 0: 2, 5: 2, 10: 4, 11: 4}
"""QGroundControl's altitude mode of each frame: 1 relative, 2 above sea, 4 above terrain."""

Position = tuple[float, float]


# --- writing -------------------------------------------------------------------------------------


def plan_text(mission: Mission, home_lonlat: Position | None = None) -> str:
    """Return a mission with its fence and rally points as the text of a ``.plan`` file.

    Home is the file's ``plannedHomePosition`` and no item of its own. Survey lines stand under
    ``lines`` with the ``doJumpId`` of the items from and to which they are swept: QGroundControl
    checks the keys that it knows and passes over others. Degrees are written so that
    ``round(degrees * 1e7)`` gives the integers back.

    Parameters
    ----------
    mission
        What to write; without items it becomes an empty but valid plan.
    home_lonlat : (lon, lat), degrees
        Home of a mission without items. Without it the first rally point serves, or the first
        corner of the fence.
    """
    lat, lon, altitude_m = _home(mission, home_lonlat)
    speed_m_s = next(
        (i.param2 for i in mission.items if i.command == mavlink.DO_CHANGE_SPEED and i.param2 > 0),
        2.0,
    )
    document = {
        "fileType": "Plan",
        "geoFence": {
            "circles": [],
            "polygons": [
                {
                    "inclusion": polygon.inclusion,
                    "polygon": [[degrees(p), degrees(q)] for p, q in polygon.points_e7.tolist()],
                    "version": 1,
                }
                for polygon in mission.fence
            ],
            "version": 2,
        },
        "groundStation": "QGroundControl",
        "mission": {
            "cruiseSpeed": _number(speed_m_s),
            "firmwareType": FIRMWARE_ARDUPILOT,
            "globalPlanAltitudeMode": 1,
            "hoverSpeed": _number(speed_m_s),
            "items": [_simple_item(item) for item in mission.items[1:]],
            "plannedHomePosition": [lat, lon, altitude_m],
            "vehicleType": mavlink.VEHICLE_TYPES[mission.vehicle],
            "version": 2,
        },
        "rallyPoints": {
            "points": [
                [degrees(point.lat_e7), degrees(point.lon_e7), _number(point.altitude_m)]
                for point in mission.rally
            ],
            "version": 2,
        },
        "version": 1,
    }
    if mission.lines:
        document["lines"] = [
            {"name": line.name, "kind": line.kind, "items": [line.from_item, line.to_item]}
            for line in mission.lines
        ]
    return json.dumps(document, indent=1, sort_keys=True, allow_nan=False) + "\n"


def write_plan(
    mission: Mission,
    path: str | os.PathLike[str],
    *,
    home_lonlat: Position | None = None,
    overwrite: bool = False,
) -> None:
    """Write a mission as a ``.plan`` file, whole or not at all.

    Parameters
    ----------
    mission
        What to write.
    path
        The file.
    home_lonlat : (lon, lat), degrees
        Home of a mission without items, see :func:`plan_text`.
    overwrite
        Whether a file that is already there may be replaced.
    """
    write_whole(path, plan_text(mission, home_lonlat), overwrite)


def _home(mission: Mission, home_lonlat: Position | None) -> tuple[float, float, float]:
    if mission.items:
        home = mission.items[0]
        return degrees(home.x), degrees(home.y), _number(home.z)
    if home_lonlat is not None:
        lon, lat = home_lonlat
        return degrees(mavlink.e7(lat)), degrees(mavlink.e7(wrap_lon_deg(lon))), 0
    if mission.rally:
        return degrees(mission.rally[0].lat_e7), degrees(mission.rally[0].lon_e7), 0
    if mission.fence:
        lat_e7, lon_e7 = mission.fence[0].points_e7[0].tolist()
        return degrees(lat_e7), degrees(lon_e7), 0
    return 0.0, 0.0, 0


def _number(value: float) -> Any:
    """Return a JSON number: null for NaN (as QGroundControl has it), 2 rather than 2.0."""
    if math.isnan(value):
        return None
    return int(value) if float(value).is_integer() else value


def _simple_item(item: MissionItem) -> dict[str, Any]:
    in_degrees = item.frame in mavlink.DEGREE_FRAMES
    out: dict[str, Any] = {
        "autoContinue": bool(item.autocontinue),
        "command": item.command,
        "doJumpId": item.seq,
        "frame": item.frame,
        "params": [
            _number(item.param1),
            _number(item.param2),
            _number(item.param3),
            _number(item.param4),
            degrees(item.x) if in_degrees else item.x,
            degrees(item.y) if in_degrees else item.y,
            _number(item.z),
        ],
        "type": "SimpleItem",
    }
    if item.command in mavlink.NAVIGATION and item.frame in ALTITUDE_MODE:
        # all three or none
        out["AMSLAltAboveTerrain"] = None
        out["Altitude"] = _number(item.z)
        out["AltitudeMode"] = ALTITUDE_MODE[item.frame]
    return out


# --- reading -------------------------------------------------------------------------------------


class _Reader:
    """Typed access to a JSON document; every complaint says file, place and value."""

    def __init__(self, source: str) -> None:
        self.source = source

    def fail(self, where: str, value: object, rule: str) -> NoReturn:
        shown = json.dumps(value, default=str)
        shown = shown if len(shown) <= 60 else shown[:57] + "..."
        raise PlanFormatError(f"{self.source}: {where} is {shown}: must be {rule}")

    def get(self, parent: dict[str, Any], key: str, where: str) -> Any:
        if key not in parent:
            raise PlanFormatError(f"{self.source}: {where or 'the document'} has no {key!r}")
        return parent[key]

    def table(self, parent: dict[str, Any], key: str, where: str) -> dict[str, Any]:
        value = self.get(parent, key, where)
        if not isinstance(value, dict):
            self.fail(_join(where, key), value, "an object")
        return value

    def rows(self, parent: dict[str, Any], key: str, where: str) -> list[Any]:
        value = self.get(parent, key, where)
        if not isinstance(value, list):
            self.fail(_join(where, key), value, "a list")
        return value

    def number(self, value: object, where: str, *, null: float | None = None) -> float:
        if value is None and null is not None:
            return null
        if isinstance(value, bool) or not isinstance(value, (int, float)):
            self.fail(where, value, "a number")
        try:
            number = float(value)
        except OverflowError:
            self.fail(where, value, "a number of ordinary size")
        if not math.isfinite(number):
            self.fail(where, str(value), "a finite number")
        return number

    def whole(self, value: object, where: str, low: int, high: int) -> int:
        if (
            isinstance(value, bool)
            or not isinstance(value, (int, float))
            or not math.isfinite(value)
            or value != int(value)
            or not low <= value <= high
        ):
            self.fail(where, value, f"a whole number from {low} to {high}")
        return int(value)

    def version(self, parent: dict[str, Any], where: str, allowed: Sequence[int]) -> None:
        value = self.get(parent, "version", where)
        if isinstance(value, bool) or value not in allowed:
            rule = " or ".join(map(str, allowed))
            self.fail(_join(where, "version"), value, rule)

    def latlon_e7(self, row: object, where: str, sizes: Sequence[int]) -> tuple[int, int]:
        if not isinstance(row, list) or len(row) not in sizes:
            self.fail(where, row, f"a list of {' or '.join(map(str, sizes))} numbers")
        return (
            self.degrees_e7(row[0], f"{where}[0]", 90.0, "latitude"),
            self.degrees_e7(row[1], f"{where}[1]", 180.0, "longitude"),
        )

    def degrees_e7(self, value: object, where: str, limit: float, name: str) -> int:
        number = self.number(value, where)
        if abs(number) > limit:
            self.fail(where, value, f"a {name} from -{limit:g} to {limit:g} degrees")
        return mavlink.e7(number)


def _join(where: str, key: str) -> str:
    return f"{where}.{key}" if where else key


def read_plan(path: str | os.PathLike[str]) -> Mission:
    """Read a ``.plan`` file, ours or another program's.

    Simple items and survey items that bring their expanded items along are read; fence circles and
    other complex items are refused, because leaving them out would change the mission. The numbers
    of robot and sortie come from a name like ``robot-2-sortie-1.plan``, otherwise they are 1.

    Parameters
    ----------
    path
        The file.

    Returns
    -------
    Mission
        With home as item 0 if the plan has any items, and without items otherwise.

    Raises
    ------
    PlanFormatError
        When the file cannot be read or is no valid plan: names file, place and value.
    """
    source = Path(path)
    try:
        text = source.read_text(encoding="utf-8-sig")
    except (OSError, UnicodeDecodeError) as error:
        reason = getattr(error, "strerror", None) or "not UTF-8 text"
        raise PlanFormatError(f"{source}: cannot be read: {reason}") from error
    match = re.fullmatch(r"robot-(\d+)(?:-sortie-(\d+))?", source.stem)
    robot = int(match.group(1)) if match else 1
    sortie = int(match.group(2)) if match and match.group(2) else 1
    return parse_plan(text, source=str(source), robot=robot, sortie=sortie)


def parse_plan(text: str, *, source: str = "plan", robot: int = 1, sortie: int = 1) -> Mission:
    """Read the text of a ``.plan`` file, see :func:`read_plan`.

    Parameters
    ----------
    text
        The JSON document.
    source
        What to call it in messages.
    robot, sortie
        Whose mission it is.

    Raises
    ------
    PlanFormatError
        When it is no valid plan.
    """
    try:
        document = json.loads(text)
    except (ValueError, RecursionError) as error:
        raise PlanFormatError(f"{source}: not JSON: {error}") from error
    read = _Reader(source)
    if not isinstance(document, dict):
        read.fail("the document", document, "an object")
    if document.get("fileType") != "Plan":
        read.fail("fileType", document.get("fileType"), '"Plan" (a QGroundControl plan)')
    read.version(document, "", (1,))
    mission = read.table(document, "mission", "")
    read.version(mission, "mission", (2,))
    vehicle_type = read.whole(mission.get("vehicleType", 0), "mission.vehicleType", 0, 255)
    names = {number: name for name, number in mavlink.VEHICLE_TYPES.items()}
    return Mission(
        robot=robot,
        sortie=sortie,
        # other vehicles (planes, submarines) are not planned for; a copter's rules are closest
        vehicle=names.get(vehicle_type, "copter"),
        items=_items(read, mission),
        fence=_fence(read, read.table(document, "geoFence", "")),
        rally=_rally(read, read.table(document, "rallyPoints", "")),
    )


def _items(read: _Reader, mission: dict[str, Any]) -> tuple[MissionItem, ...]:
    where = "mission.plannedHomePosition"
    home = read.get(mission, "plannedHomePosition", "mission")
    home_e7 = read.latlon_e7(home, where, (3,))
    home_z = read.number(home[2], f"{where}[2]", null=0.0)
    raw: list[tuple[dict[str, Any], str]] = []
    for index, row in enumerate(read.rows(mission, "items", "mission")):
        raw.extend(_expand(read, row, f"mission.items[{index}]"))
    if not raw:
        return ()
    jump_ids = {row.get("doJumpId"): seq for seq, (row, _) in enumerate(raw, start=1)}
    items = [
        MissionItem(
            seq=0, frame=mavlink.FRAME_GLOBAL, command=mavlink.NAV_WAYPOINT, current=1,
            autocontinue=1, param1=0.0, param2=0.0, param3=0.0, param4=0.0,
            x=home_e7[0], y=home_e7[1], z=home_z,
        )
    ]  # fmt: skip
    for seq, (row, where) in enumerate(raw, start=1):
        items.append(_read_item(read, row, where, seq, jump_ids))
    return tuple(items)


def _expand(read: _Reader, row: object, where: str) -> list[tuple[dict[str, Any], str]]:
    """Return the simple items of one row of the file, each with its place."""
    if not isinstance(row, dict):
        read.fail(where, row, "an object")
    kind = read.get(row, "type", where)
    if kind == "SimpleItem":
        return [(row, where)]
    if kind != "ComplexItem":
        read.fail(f"{where}.type", kind, '"SimpleItem" or "ComplexItem"')
    name = row.get("complexItemType", "?")
    transect = row.get("TransectStyleComplexItem")
    if not isinstance(transect, dict) or not isinstance(transect.get("Items"), list):
        read.fail(
            f"{where}.complexItemType", name,
            "a survey saved with its items; in QGroundControl turn it into waypoints first",
        )  # fmt: skip
    out: list[tuple[dict[str, Any], str]] = []
    for index, inner in enumerate(transect["Items"]):
        out.extend(_expand(read, inner, f"{where}.TransectStyleComplexItem.Items[{index}]"))
    return out


def _read_item(
    read: _Reader, row: dict[str, Any], where: str, seq: int, jump_ids: dict[Any, int]
) -> MissionItem:
    frame = read.whole(read.get(row, "frame", where), f"{where}.frame", 0, 21)
    command = read.whole(read.get(row, "command", where), f"{where}.command", 0, 65535)
    params = read.rows(row, "params", where)
    if len(params) != 7:
        read.fail(f"{where}.params", params, f"a list of 7 numbers, not {len(params)}")
    values = [
        read.number(value, f"{where}.params[{i}]", null=math.nan)
        for i, value in enumerate(params[:4])
    ]
    if frame in mavlink.DEGREE_FRAMES:
        x = read.degrees_e7(
            0 if params[4] is None else params[4], f"{where}.params[4]", 90.0, "latitude"
        )
        y = read.degrees_e7(
            0 if params[5] is None else params[5], f"{where}.params[5]", 180.0, "longitude"
        )
    else:
        low, high = -(2**31), 2**31 - 1
        x, y = (
            read.whole(round(read.number(params[i], at, null=0.0)), at, low, high)
            for i in (4, 5)
            for at in (f"{where}.params[{i}]",)
        )
    auto_continue = row.get("autoContinue", True)
    if not isinstance(auto_continue, bool):
        read.fail(f"{where}.autoContinue", auto_continue, "true or false")
    if command == mavlink.DO_JUMP:
        # jumps name the doJumpId of an item, vehicles want its place in the list
        values[0] = float(jump_ids.get(params[0], values[0]))
    return MissionItem(
        seq=seq, frame=frame, command=command, current=0, autocontinue=int(auto_continue),
        param1=values[0], param2=values[1], param3=values[2], param4=values[3],
        x=x, y=y, z=read.number(params[6], f"{where}.params[6]", null=math.nan),
    )  # fmt: skip


def _fence(read: _Reader, fence: dict[str, Any]) -> tuple[FencePolygon, ...]:
    read.version(fence, "geoFence", (2,))
    circles = read.rows(fence, "circles", "geoFence")
    if circles:
        read.fail("geoFence.circles", circles, "empty; draw the circles as polygons")
    out = []
    for index, row in enumerate(read.rows(fence, "polygons", "geoFence")):
        where = f"geoFence.polygons[{index}]"
        if not isinstance(row, dict):
            read.fail(where, row, "an object")
        inclusion = read.get(row, "inclusion", where)
        if not isinstance(inclusion, bool):
            read.fail(f"{where}.inclusion", inclusion, "true or false")
        corners = read.rows(row, "polygon", where)
        if len(corners) < 3:
            read.fail(f"{where}.polygon", corners, "a list of at least 3 positions")
        points = [read.latlon_e7(p, f"{where}.polygon[{i}]", (2, 3)) for i, p in enumerate(corners)]
        out.append(
            FencePolygon(inclusion=inclusion, points_e7=read_only(np.array(points, dtype=np.int64)))
        )
    return tuple(out)


def _rally(read: _Reader, rally: dict[str, Any]) -> tuple[RallyPoint, ...]:
    # version 1 is written by QGroundControl where there are no points
    read.version(rally, "rallyPoints", (1, 2))
    out = []
    for index, row in enumerate(read.rows(rally, "points", "rallyPoints")):
        where = f"rallyPoints.points[{index}]"
        lat_e7, lon_e7 = read.latlon_e7(row, where, (2, 3))
        altitude_m = read.number(row[2], f"{where}[2]", null=0.0) if len(row) == 3 else 0.0
        out.append(RallyPoint(lat_e7=lat_e7, lon_e7=lon_e7, altitude_m=altitude_m))
    return tuple(out)

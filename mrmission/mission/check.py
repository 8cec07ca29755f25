"""Check what is exported: the integers of items and fence, not the geometry they came from."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import shapely
from pyproj import Transformer

from mrmission.mission import mavlink
from mrmission.model import BoolArray, FencePolygon, FloatArray, IntArray, Mission
from mrmission.options import VehicleLimits

TURN_E7 = 3_600_000_000
TOLERANCE_M = 0.1
LAUNCH_STRIP_M = 50.0
HOME_M = 1.0
ABOVE_GROUND_FRAMES = frozenset({3, 6, 10, 11})
STEP_M = 200.0
"""Legs and shores are cut to this length before they are projected, so that they stay straight."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Violation:
    """One thing that is wrong with a mission.

    ``rule`` is a short name (``"water"``, ``"fence"``, ``"limits"``, ``"home"``, ``"items"``,
    ``"altitude"``, ``"camera"``), ``item`` the item concerned (-1: none), ``value`` and ``limit``
    the measured number and what it must not exceed, and ``message`` one line for a person.
    """

    rule: str
    item: int
    value: float
    limit: float
    message: str


def navigation_path(mission: Mission) -> tuple[IntArray, tuple[int, ...]]:
    """Return the positions that a mission visits, home first.

    Parameters
    ----------
    mission
        Item 0 is home.

    Returns
    -------
    points_e7 : (n, 2) array
        ``[lat, lon]`` in 1e-7 degrees.
    items : tuple of int
        The item of each position.
    """
    rows = [
        (i.x, i.y, i.seq)
        for i in mission.items
        if i.command in mavlink.NAVIGATION and (i.x != 0 or i.y != 0)
    ]
    points = np.array([row[:2] for row in rows], dtype=np.int64).reshape(-1, 2)
    return points, tuple(row[2] for row in rows)


def unwrap_e7(points_e7: IntArray, near_lon_e7: int) -> IntArray:
    """Return ``[lat, lon]`` with longitudes within half a turn of `near_lon_e7`."""
    out = np.array(points_e7, dtype=np.int64)
    half = TURN_E7 // 2
    out[:, 1] = (out[:, 1] - near_lon_e7 + half) % TURN_E7 - half + near_lon_e7
    return out


# --- fence ---------------------------------------------------------------------------------------


def check_fence(
    fence: Sequence[FencePolygon], path_e7: IntArray, items: Sequence[int] = ()
) -> tuple[Violation, ...]:
    """Check, in exact integer arithmetic, that a path stays inside a fence and never touches it.

    Parameters
    ----------
    fence
        Inclusion and exclusion polygons; edges are straight in longitude and latitude.
    path_e7 : (n, 2) array
        ``[lat, lon]`` in 1e-7 degrees.
    items
        The item of each position, for the messages; counted from 0 without.

    Returns
    -------
    tuple of Violation
        One for each leg and polygon that do not go together.
    """
    path = np.asarray(path_e7, dtype=np.int64)
    if len(path) == 0:
        return ()
    names = list(items) or list(range(len(path)))
    near = int(path[0, 1])
    path = unwrap_e7(path, near)
    origin = path[0]
    found = []
    for number, polygon in enumerate(fence, start=1):
        ring = unwrap_e7(polygon.points_e7, near) - origin
        points = path - origin
        touched = _legs_meet_ring(points, ring)
        inside = _inside(points, ring)
        wrong = ~inside if polygon.inclusion else inside
        legs = np.flatnonzero(touched)
        alone = [int(i) for i in np.flatnonzero(wrong) if i not in legs and i - 1 not in legs]
        what = "inclusion" if polygon.inclusion else "exclusion"
        side = "outside" if polygon.inclusion else "inside"
        wrongs = [(i + 1, f"the leg to item {names[i + 1]} meets") for i in legs.tolist()]
        wrongs += [(i, f"item {names[i]} lies {side}") for i in alone]
        found += [
            Violation(
                rule="fence",
                item=names[i],
                value=1.0,
                limit=0.0,
                message=f"{text} {what} polygon {number}",
            )
            for i, text in wrongs
        ]
    return tuple(found)


def _cross(a: IntArray, b: IntArray, c: IntArray) -> IntArray:
    """Sign of the turn abc; coordinates below 2**30 keep the products within 64 bits."""
    out: IntArray = np.sign(
        (b[..., 0] - a[..., 0]) * (c[..., 1] - a[..., 1])
        - (b[..., 1] - a[..., 1]) * (c[..., 0] - a[..., 0])
    )
    return out


def _legs_meet_ring(points: IntArray, ring: IntArray) -> BoolArray:
    """Which legs have a point in common with the ring's edges, (n - 1,)."""
    p, q = points[:-1, None, :], points[1:, None, :]
    a, b = ring[None, :, :], np.roll(ring, -1, axis=0)[None, :, :]
    apart = np.any(
        (np.maximum(p, q) < np.minimum(a, b)) | (np.maximum(a, b) < np.minimum(p, q)), axis=-1
    )
    one_side = _cross(p, q, a) * _cross(p, q, b) > 0
    other_side = _cross(a, b, p) * _cross(a, b, q) > 0
    meets: BoolArray = np.any(~(apart | one_side | other_side), axis=1)
    return meets


def _inside(points: IntArray, ring: IntArray) -> BoolArray:
    """Which points lie inside the ring, by crossings of a ray towards rising second coordinate."""
    p = points[:, None, :]
    a, b = ring[None, :, :], np.roll(ring, -1, axis=0)[None, :, :]
    spans = (a[..., 0] > p[..., 0]) != (b[..., 0] > p[..., 0])
    rising = b[..., 0] > a[..., 0]
    beyond = np.where(rising, _cross(a, b, p) < 0, _cross(a, b, p) > 0)
    crossings: BoolArray = np.sum(spans & beyond, axis=1) % 2 == 1
    return crossings


# --- mission -------------------------------------------------------------------------------------


def check_mission(
    mission: Mission,
    water_lonlat: shapely.MultiPolygon | shapely.Polygon,
    *,
    clearance_m: float = 0.0,
    limits: VehicleLimits | None = None,
    tolerance_m: float = TOLERANCE_M,
    launch_m: float = LAUNCH_STRIP_M,
    turnaround_m: float = 0.0,
) -> tuple[Violation, ...]:
    """Check a mission as it is exported against the water and the vehicle's limits.

    Every leg lies in the water eroded by the clearance (within `launch_m` of home, in the water),
    every leg lies inside the fence, items, fence and rally points fit into the vehicle, home comes
    first, exactly one item is current, and the last position is home. The vehicle executes every
    command; a copter takes off first, flies above the ground and returns; a camera that is switched
    on is switched off.

    Parameters
    ----------
    mission
        What to check; one without items has nothing to violate.
    water_lonlat
        The survey area, degrees.
    clearance_m
        Distance that the path keeps from the shore, m.
    limits
        What the vehicle holds; ArduPilot's defaults for its kind if not given.
    tolerance_m
        A leg may be this far outside, m.
    launch_m
        Around home the clearance does not count within this distance, m.
    turnaround_m
        A copter's turns may lie this far outside the water that is `clearance_m` from the shore.

    Returns
    -------
    tuple of Violation
        Empty where all is well.
    """
    limits = limits or VehicleLimits.of(mission.vehicle)
    if not mission.items:
        return ()
    path, items = navigation_path(mission)
    found = [*_check_list(mission, limits), *_check_vehicle(mission)]
    if len(path) < 2:
        return tuple(found)
    beyond_m = turnaround_m if mission.vehicle == "copter" else 0.0
    found += _check_water(path, items, water_lonlat, clearance_m, tolerance_m + beyond_m, launch_m)
    found += check_fence(mission.fence, path, items)
    return tuple(found)


def _check_list(mission: Mission, limits: VehicleLimits) -> list[Violation]:
    found = []

    def add(rule: str, item: int, value: float, limit: float, message: str) -> None:
        found.append(Violation(rule=rule, item=item, value=value, limit=limit, message=message))

    count = len(mission.items)
    if count > limits.mission_items:
        add("limits", -1, count, limits.mission_items,
            f"{count} items: the vehicle holds {limits.mission_items}")  # fmt: skip
    sizes = [len(p.points_e7) for p in mission.fence]
    used = sum(map(limits.fence_bytes_of, sizes))
    if used > limits.fence_bytes:
        add("limits", -1, used, limits.fence_bytes,
            f"the fence takes {used} bytes: the vehicle holds {limits.fence_bytes}")  # fmt: skip
    for number, size in enumerate(sizes, start=1):
        if size > limits.fence_polygon_points:
            add("limits", -1, size, limits.fence_polygon_points,
                f"fence polygon {number} has {size} points: "
                f"the vehicle holds {limits.fence_polygon_points}")  # fmt: skip
    if len(mission.rally) > limits.rally_points:
        add("limits", -1, len(mission.rally), limits.rally_points,
            f"{len(mission.rally)} rally points: the vehicle holds "
            f"{limits.rally_points}")  # fmt: skip
    current = sum(i.current for i in mission.items)
    if current > 1:
        add("items", -1, current, 1, f"{current} items are current: at most one may be")
    for index, item in enumerate(mission.items):
        if item.seq != index:
            add("items", index, item.seq, index, f"item {index} is numbered {item.seq}")
        if abs(item.x) > 900_000_000 and item.frame in mavlink.DEGREE_FRAMES:
            add("items", index, item.x / 1e7, 90, f"item {index} has latitude {item.x / 1e7}")
        if abs(item.y) > 1_800_000_000 and item.frame in mavlink.DEGREE_FRAMES:
            add("items", index, item.y / 1e7, 180, f"item {index} has longitude {item.y / 1e7}")
    if mission.items[0].command != mavlink.NAV_WAYPOINT:
        add("items", 0, mission.items[0].command, mavlink.NAV_WAYPOINT, "item 0 must be home")
    return found


NOT_ON_WATER = {
    mavlink.NAV_LAND: "land",
    mavlink.NAV_TAKEOFF: "take-off",
    mavlink.NAV_SPLINE_WAYPOINT: "spline waypoint",
}
"""Commands that ArduRover stores and skips: acceptance at upload proves nothing."""


def _check_vehicle(mission: Mission) -> list[Violation]:
    """Check that the vehicle does what the items say."""
    found = []

    def add(rule: str, item: int, value: float, limit: float, message: str) -> None:
        found.append(Violation(rule=rule, item=item, value=value, limit=limit, message=message))

    camera_m = 0.0
    camera_item = -1
    for item in mission.items[1:]:
        if mission.vehicle != "copter" and item.command in NOT_ON_WATER:
            add("items", item.seq, item.command, 0,
                f"item {item.seq} is a {NOT_ON_WATER[item.command]}: a {mission.vehicle} "
                "stores it and does not execute it")  # fmt: skip
        if item.command == mavlink.DO_SET_CAM_TRIGG_DIST:
            if not item.param1 >= 0:
                add("camera", item.seq, item.param1, 0,
                    f"item {item.seq} triggers a camera every {item.param1:g} m")  # fmt: skip
            camera_m, camera_item = item.param1, item.seq
    if camera_m > 0:
        add("camera", camera_item, camera_m, 0,
            f"the camera is switched on at item {camera_item} and never off")  # fmt: skip
    if mission.vehicle == "copter":
        found += _check_flight(mission)
    return found


def _check_flight(mission: Mission) -> list[Violation]:
    """Check that a copter takes off first, keeps above the ground and comes down at the end."""
    found = []
    moves = [
        i
        for i in mission.items[1:]
        if i.command in mavlink.NAVIGATION or i.command == mavlink.NAV_RETURN_TO_LAUNCH
    ]
    if not moves:
        return []
    first, last = moves[0], moves[-1]
    if first.command != mavlink.NAV_TAKEOFF:
        found.append(
            Violation(
                rule="items", item=first.seq, value=first.command, limit=mavlink.NAV_TAKEOFF,
                message=f"item {first.seq} must be a take-off: a copter on the ground refuses AUTO",
            )
        )  # fmt: skip
    if last.command not in (mavlink.NAV_RETURN_TO_LAUNCH, mavlink.NAV_LAND):
        found.append(
            Violation(
                rule="items", item=last.seq, value=last.command,
                limit=mavlink.NAV_RETURN_TO_LAUNCH,
                message=f"item {last.seq} is the last: a copter hovers there until its battery is "
                "empty; end with a return to launch or a landing",
            )
        )  # fmt: skip
    for item in moves:
        grounded = item.command in (mavlink.NAV_RETURN_TO_LAUNCH, mavlink.NAV_LAND)
        if item.frame in ABOVE_GROUND_FRAMES and not grounded and not item.z > 0:
            found.append(
                Violation(
                    rule="altitude", item=item.seq, value=item.z, limit=0.0,
                    message=f"item {item.seq} has altitude {item.z:g} m: it must be above 0 "
                    "(a copter takes 0 as the height it has)",
                )
            )  # fmt: skip
    return found


def _check_water(
    path_e7: IntArray,
    items: Sequence[int],
    water_lonlat: shapely.MultiPolygon | shapely.Polygon,
    clearance_m: float,
    tolerance_m: float,
    launch_m: float,
) -> list[Violation]:
    west, south, east, north = water_lonlat.bounds
    path = unwrap_e7(path_e7, round((west + east) / 2 * 1e7)) / 1e7
    # home comes twice, as item 0 and as the first waypoint; a leg needs two different ends
    moved = np.append(True, np.any(np.diff(path, axis=0) != 0, axis=1))
    items = [item for item, keep in zip(items, moved.tolist(), strict=True) if keep]
    lonlat = path[moved][:, ::-1]
    if len(lonlat) < 2:
        return []
    plane = Transformer.from_crs(
        "EPSG:4326",
        f"+proj=aeqd +lat_0={(south + north) / 2} +lon_0={(west + east) / 2} +datum=WGS84",
        always_xy=True,
    )

    def project(geometry: shapely.Geometry) -> shapely.Geometry:
        def to_metric(c: FloatArray) -> FloatArray:
            return np.column_stack(plane.transform(c[:, 0], c[:, 1]))

        return shapely.transform(shapely.segmentize(geometry, STEP_M / 111_320), to_metric)

    water = shapely.make_valid(project(water_lonlat))
    allowed = shapely.buffer(water, -clearance_m) if clearance_m > 0 else water
    allowed = shapely.buffer(allowed, tolerance_m)
    legs = project(shapely.linestrings(np.stack([lonlat[:-1], lonlat[1:]], axis=1)))
    home = project(shapely.Point(lonlat[0]))
    launch = shapely.buffer(shapely.intersection(water, home.buffer(launch_m)), tolerance_m)
    shapely.prepare(allowed)
    found = []
    for i in np.flatnonzero(~shapely.covers(allowed, legs)).tolist():
        outside = shapely.difference(shapely.difference(legs[i], allowed), launch)
        if outside.length > 1e-6:
            lon, lat = lonlat[i + 1]
            found.append(
                Violation(
                    rule="water", item=items[i + 1], value=float(outside.length), limit=0.0,
                    message=f"the leg to item {items[i + 1]} at {lon:.7f},{lat:.7f} runs "
                    f"{outside.length:.2f} m outside the water"
                    + (f" or within {clearance_m:g} m of its shore" if clearance_m else ""),
                )
            )  # fmt: skip
    gap = math.dist(*shapely.get_coordinates(project(shapely.MultiPoint(lonlat[[0, -1]]))))
    if gap > HOME_M:
        found.append(
            Violation(
                rule="home", item=items[-1], value=gap, limit=HOME_M,
                message=f"the last position, item {items[-1]}, lies {gap:.2f} m from home",
            )
        )  # fmt: skip
    return found

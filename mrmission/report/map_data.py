"""What the map page draws, as compact JSON: integer centimetres in the local frame."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from typing import Any

import numpy as np
import pyproj
import shapely

from mrmission.mission.tracks import line_label
from mrmission.model import FleetPlan, FloatArray, LegKind, Mission
from mrmission.report.colours import robot_colour
from mrmission.report.units import human_chance, human_duration, human_length

NAVIGATION_COMMANDS = frozenset({16, 17, 18, 19, 21, 22, 31, 82})
"""MAV_CMD_NAV_* with a position: WAYPOINT, LOITER_*, LAND, TAKEOFF, SPLINE_WAYPOINT."""

_LONLAT_DEGREE = 4


class LegTrack:
    """The legs that a robot's missions make, in order, one polyline for each sortie.

    Attributes
    ----------
    points_m
        One array (n, 2) for each sortie, local frame.
    kind, lane, item
        One integer array (n - 1) for each sortie: what leg ``i`` is for, its lane (0 on a
        transit), and the number of the mission item at its end.
    label
        For each sortie what its lanes are called, the first lane first; empty if not known.
    """

    __slots__ = ("item", "kind", "label", "lane", "points_m")

    def __init__(self) -> None:
        self.points_m: list[FloatArray] = []
        self.kind: list[list[int]] = []
        self.lane: list[list[int]] = []
        self.item: list[list[int]] = []
        self.label: list[list[str]] = []

    @property
    def length_m(self) -> float:
        """Length of all legs, m."""
        return float(sum(np.hypot(*np.diff(points, axis=0).T).sum() for points in self.points_m))


def tracks(plan: FleetPlan) -> dict[int, LegTrack]:
    """Return the legs of every robot, by robot number.

    The legs are those of the missions (what is sent); a robot without missions gets those of its
    path, numbered by point.

    Parameters
    ----------
    plan
        The plan.

    Returns
    -------
    dict of int to LegTrack
        Tracks by rising robot number.
    """
    projection = pyproj.Proj(plan.report.frame)
    found: dict[int, LegTrack] = {}
    numbers = {row.robot for row in plan.report.robots} | {path.robot for path in plan.paths}
    for robot in sorted(numbers | {mission.robot for mission in plan.missions}):
        track = found[robot] = LegTrack()
        missions = sorted((m for m in plan.missions if m.robot == robot), key=lambda m: m.sortie)
        for mission in missions:
            _add_mission(track, mission, projection)
        if not missions:
            for path in (path for path in plan.paths if path.robot == robot):
                track.points_m.append(np.asarray(path.points_m, dtype=float))
                track.kind.append([int(kind) for kind in path.kind])
                track.lane.append([int(lane) for lane in path.lane])
                track.item.append(list(range(1, len(path.points_m))))
                track.label.append([])
    return found


def _add_mission(track: LegTrack, mission: Mission, projection: pyproj.Proj) -> None:
    described = len(mission.kind) == len(mission.lane) == len(mission.items)
    rows = [
        (index, item)
        for index, item in enumerate(mission.items)
        if item.command in NAVIGATION_COMMANDS and (item.x, item.y) != (0, 0)
    ]
    if not rows:
        return
    latitude = np.array([item.x for _, item in rows]) * 1e-7
    longitude = np.array([item.y for _, item in rows]) * 1e-7
    track.points_m.append(np.column_stack(projection(longitude, latitude)))
    legs = rows[1:]
    transit = int(LegKind.TRANSIT)
    track.kind.append([mission.kind[index] if described else transit for index, _ in legs])
    track.lane.append([mission.lane[index] if described else 0 for index, _ in legs])
    track.item.append([item.seq for _, item in legs])
    track.label.append([line_label(mission, n) for n in range(1, len(mission.lines) + 1)])


def polygons(geometry: shapely.Geometry) -> list[shapely.Polygon]:
    """Return the polygons of a geometry.

    Parameters
    ----------
    geometry
        Any geometry.

    Returns
    -------
    list of shapely.Polygon
        Its polygonal parts that are not empty.
    """
    parts: list[Any] = shapely.get_parts(shapely.get_parts(geometry)).tolist()
    return [part for part in parts if part.geom_type == "Polygon" and not part.is_empty]


def unreached_polygons(plan: FleetPlan) -> list[shapely.Polygon]:
    """Return the parts of the water, eroded by the clearance, that were not planned.

    Parameters
    ----------
    plan
        The plan.

    Returns
    -------
    list of shapely.Polygon
        The parts; none when the report says that everything is reached.
    """
    if plan.report.unreached_m2 <= 0:
        return []
    clearance_m = float(plan.report.options.get("clearance_m") or 0.0)
    eroded = plan.water_m.buffer(-clearance_m) if clearance_m > 0 else plan.water_m
    return [
        part
        for part in polygons(eroded)
        if not plan.region_m.intersects(part.representative_point())
    ]


def _centimetres(points_m: FloatArray) -> list[int]:
    """Return points as a flat list: the first in cm, the others as differences."""
    whole = np.rint(np.asarray(points_m, dtype=float)[:, :2] * 100).astype(np.int64)
    return [int(value) for value in np.diff(whole, axis=0, prepend=0).ravel()]


def _rings(parts: Iterable[shapely.Polygon]) -> list[list[list[int]]]:
    return [
        [_centimetres(shapely.get_coordinates(ring)) for ring in (part.exterior, *part.interiors)]
        for part in parts
    ]


def _runs(values: Iterable[int]) -> list[int]:
    """Return a run-length code: value, count, value, count and so on."""
    code: list[int] = []
    for value in values:
        if code and code[-2] == value:
            code[-1] += 1
        else:
            code.extend((int(value), 1))
    return code


def lonlat_polynomial(plan: FleetPlan) -> dict[str, Any]:
    """Return polynomials that give longitude and latitude from local metres.

    The page needs no projection library for its cursor read-out: over the area's bounding box
    a polynomial of degree 4 in each of east and north is exact far below the pixel.

    Parameters
    ----------
    plan
        The plan.

    Returns
    -------
    dict
        ``centre_m``, ``scale_m``, and the coefficients ``lon`` and ``lat`` in the order
        u^0v^0, u^0v^1, …, u^0v^4, u^1v^0, …, u^4v^4, with u, v = (position - centre) / scale.
    """
    west, south, east, north = plan.water_m.bounds
    centre = np.array([(west + east) / 2, (south + north) / 2])
    scale = max(east - west, north - south, 1.0) / 2
    u, v = (axis.ravel() for axis in np.meshgrid(*[np.linspace(-1.2, 1.2, 13)] * 2, indexing="ij"))
    lon, lat = pyproj.Proj(plan.report.frame)(
        centre[0] + u * scale, centre[1] + v * scale, inverse=True
    )
    middle = lon[len(lon) // 2]
    lon = middle + (lon - middle + 180.0) % 360.0 - 180.0
    powers = range(_LONLAT_DEGREE + 1)
    basis = np.column_stack([u**i * v**j for i in powers for j in powers])
    found: FloatArray = np.linalg.lstsq(basis, np.column_stack([lon, lat]), rcond=None)[0]
    fit = np.round(found, 12) + 0.0  # degrees; no -0
    return {
        "centre_m": [round(float(value), 3) for value in centre],
        "scale_m": round(float(scale), 3),
        "degree": _LONLAT_DEGREE,
        # 12 digits: stable from one machine's linear algebra to the next, and enough
        "lon": [float(f"{value:.11e}") for value in fit[:, 0]],
        "lat": [float(f"{value:.11e}") for value in fit[:, 1]],
    }


def _fences(plan: FleetPlan) -> Iterator[dict[str, Any]]:
    """Yield every distinct fence polygon with the robots that carry it."""
    projection = pyproj.Proj(plan.report.frame)
    robots: dict[tuple[bool, bytes], set[int]] = {}
    shapes: dict[tuple[bool, bytes], FloatArray] = {}
    for mission in plan.missions:
        for polygon in mission.fence:
            points = np.asarray(polygon.points_e7, dtype=np.int64)
            key = (polygon.inclusion, points.tobytes())
            robots.setdefault(key, set()).add(mission.robot)
            if key not in shapes:
                lonlat = points[:, ::-1] * 1e-7
                shapes[key] = np.column_stack(projection(lonlat[:, 0], lonlat[:, 1]))
    for key, points_m in shapes.items():
        yield {
            "inclusion": key[0],
            "ring": _centimetres(points_m),
            "robots": sorted(robots[key]),
        }


def _conflicts(plan: FleetPlan) -> list[dict[str, Any]]:
    """Return where two robots may come too near each other, the gravest first."""
    found = plan.report.separation.conflicts
    if not found:
        return []
    projection = pyproj.Proj(plan.report.frame)
    places = [projection(*conflict.lonlat) for conflict in found]
    return [
        {
            "robots": list(conflict.robots),
            "place": _centimetres(np.array([place])),
            "text": (
                f"robots {conflict.robots[0]} and {conflict.robots[1]} may come within "
                f"{human_length(conflict.least_m)} of each other, "
                f"{human_duration(conflict.from_s)} to {human_duration(conflict.to_s)} "
                f"after the start; chance {human_chance(conflict.chance)}"
            ),
        }
        for conflict, place in zip(found, places, strict=True)
    ]


def _rally(plan: FleetPlan) -> dict[int, list[int]]:
    projection = pyproj.Proj(plan.report.frame)
    found: dict[int, list[int]] = {}
    for mission in plan.missions:
        points = [projection(p.lon_e7 * 1e-7, p.lat_e7 * 1e-7) for p in mission.rally]
        if points:
            found[mission.robot] = _centimetres(np.array(points))
    return found


def map_data(plan: FleetPlan) -> dict[str, Any]:
    """Return everything that the map page draws.

    Parameters
    ----------
    plan
        The plan.

    Returns
    -------
    dict
        Plain JSON; positions are integer centimetres in the local frame, the first point of
        a line absolute and the others as differences.
    """
    rally = _rally(plan)
    rows = {row.robot: row for row in plan.report.robots}
    homes = np.asarray(plan.homes_m, dtype=float).reshape(-1, 2)
    robots = []
    for index, (robot, track) in enumerate(tracks(plan).items()):
        row = rows.get(robot)
        home = homes[min(index, len(homes) - 1)] if len(homes) else None
        robots.append(
            {
                "robot": robot,
                "light": robot_colour(robot),
                "dark": robot_colour(robot, dark=True),
                "home": None if home is None else _centimetres(home[None, :]),
                "duration_s": None if row is None else round(float(row.duration_s), 1),
                "rally": rally.get(robot, []),
                "sorties": [
                    {
                        "points": _centimetres(points),
                        "kind": _runs(kind),
                        "lane": _runs(lane),
                        "item": _differences(item),
                        "label": label,
                    }
                    for points, kind, lane, item, label in zip(
                        track.points_m, track.kind, track.lane, track.item, track.label, strict=True
                    )
                ],
            }
        )
    return {
        "name": plan.area.name,
        "water": _rings(polygons(plan.water_m)),
        "region": _rings(polygons(plan.region_m)),
        "unreached": _rings(unreached_polygons(plan)),
        "cells": _rings(plan.cells_m),
        "fences": list(_fences(plan)),
        "conflicts": _conflicts(plan),
        "robots": robots,
        "lonlat": lonlat_polynomial(plan),
    }


def _differences(items: list[int]) -> list[int]:
    """Return item numbers as the run-length code of their differences (nearly all 1)."""
    return _runs(np.diff(np.array(items, dtype=np.int64), prepend=0).tolist())

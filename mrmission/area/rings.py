"""Rings of positions: read from JSON values, made continuous across the 180° meridian, sized."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
import shapely

from mrmission.area import formats
from mrmission.area.earth import area_text, degree_lengths_m, place_text
from mrmission.errors import GeometryError
from mrmission.model import FloatArray

MAX_LATITUDE_DEG = 85.0
"""Beyond it straight lines in lon/lat bend so sharply that a plan makes no sense."""

MAX_AREA_M2 = 5e11
"""500,000 km²: the Caspian Sea, the largest lake, has 371,000 km²."""

SPHERE_RADIUS_M = 6_371_007.0


@dataclass(frozen=True, slots=True, kw_only=True)
class Ring:
    """One closed ring as given: ``lonlat`` is (n, 2), first and last position equal."""

    lonlat: FloatArray
    was_closed: bool
    extra_numbers: bool

    @property
    def distinct(self) -> int:
        """Number of distinct positions."""
        return len(np.unique(self.lonlat, axis=0))


def parse_ring(value: Any, number: int) -> Ring | None:
    """Return the ring in a JSON value, or None where the value is an empty list.

    Parameters
    ----------
    value : Any
        What stands in the file.
    number : int
        Its number in the polygon, counted from 1 (the outer ring), for messages.

    Raises
    ------
    GeometryError
        When it is not a list of positions of finite numbers.
    """
    if not isinstance(value, list):
        raise GeometryError(
            "Polygon coordinates must be a list of rings, each a list of positions: "
            f"ring {number} is {formats.json_type(value)}"
        )
    if not value:
        return None
    lonlat = np.empty((len(value), 2))
    lengths = set()
    for i, position in enumerate(value):
        if not isinstance(position, list) or len(position) < 2:
            if isinstance(position, (int, float)) and not isinstance(position, bool):
                raise GeometryError(
                    "Polygon coordinates must be a list of rings, each a list of positions: "
                    f"ring {number} is a bare position; add one more pair of brackets"
                )
            raise GeometryError(
                f"a position must be a list of two numbers (ring {number}, position {i + 1}), "
                f"found {formats.json_type(position)}"
            )
        lengths.add(len(position))
        for axis in (0, 1):
            number_value = position[axis]
            # bool is an int to Python, not to anyone who draws a lake
            if type(number_value) not in (int, float):
                raise GeometryError(
                    f"a coordinate is not a number (ring {number}, position {i + 1}): "
                    f"{_json_text(number_value)}"
                )
            # integers beyond the range of a float compare without overflow
            if not -1e300 < number_value < 1e300:
                raise GeometryError(
                    "a coordinate is not a usable, finite number "
                    f"(ring {number}, position {i + 1}): {formats.printable(str(number_value), 20)}"
                )
            lonlat[i, axis] = number_value
    was_closed = bool((lonlat[0] == lonlat[-1]).all())
    if not was_closed:
        lonlat = np.vstack([lonlat, lonlat[:1]])
    keep = np.append(True, np.any(np.diff(lonlat, axis=0) != 0, axis=1))
    return Ring(
        lonlat=lonlat[keep],
        was_closed=was_closed,
        extra_numbers=len(lengths) > 1 or max(lengths) > 3,
    )


def _json_text(value: Any) -> str:
    if isinstance(value, str):
        return formats.quoted(value)
    return formats.json_type(value)


def check_range(lonlat: FloatArray, number: int) -> None:
    """Raise when a position is no longitude and latitude in degrees.

    Raises
    ------
    GeometryError
        With the first such position and what it looks like.
    """
    lon, lat = lonlat[:, 0], lonlat[:, 1]
    bad = np.flatnonzero((np.abs(lat) > 90) | (np.abs(lon) > 360))
    if not len(bad):
        return
    i = int(bad[0])
    where = f"(ring {number}, position {i + 1})"
    if np.abs(lonlat).max() > 360:
        raise GeometryError(
            f"coordinate {lon[i]:g},{lat[i]:g} is not in degrees {where}: looks like metres; "
            "reproject to WGS 84 lon/lat (ogr2ogr -t_srs EPSG:4326)"
        )
    if (np.abs(lon) <= 90).all():
        raise GeometryError(
            f"latitude {lat[i]:g} is out of range -90..90 {where}: "
            "longitude and latitude look swapped; GeoJSON has longitude first"
        )
    raise GeometryError(f"latitude {lat[i]:g} is out of range -90..90 {where}; correct it")


def continuous(lonlat: FloatArray) -> FloatArray:
    """Return the ring with longitudes that never jump by more than 180°.

    Parameters
    ----------
    lonlat : (n, 2) float array
        Closed ring, degrees.

    Raises
    ------
    GeometryError
        When the ring goes around a pole, or around the world.
    """
    if float(np.ptp(lonlat[:, 0])) <= 180:
        return lonlat
    out = lonlat.copy()
    out[:, 0] = np.unwrap(lonlat[:, 0], period=360.0)
    # np.unwrap computes with rounding: positions that need no shift keep their bits
    turns = np.round((out[:, 0] - lonlat[:, 0]) / 360.0)
    out[:, 0] = lonlat[:, 0] + 360.0 * turns
    if abs(out[-1, 0] - out[0, 0]) > 180 or _edges_around_pole(lonlat):
        raise GeometryError("the polygon contains a pole: not supported; cut the pole out")
    span_deg = float(np.ptp(lonlat[:, 0]))
    if span_deg >= 359.9 and np.ptp(out[:, 0]) < 1e-9:
        raise GeometryError(
            f"the lake would be {area_text(_sphere_area_m2(lonlat))}, "
            f"the limit is {area_text(MAX_AREA_M2)}; draw one lake"
        )
    return out


def _edges_around_pole(lonlat: FloatArray) -> bool:
    """Tell whether a ring drawn from -180 to 180 closes along the 180° meridian only.

    Such a ring is a cap around a pole whose closing edge is the meridian itself.
    """
    lon = lonlat[:, 0]
    if float(np.ptp(lon)) < 359.9:
        return False
    steps = np.abs(np.diff(lon))
    wraps = np.flatnonzero(steps > 180)
    return len(wraps) % 2 == 1


def _sphere_area_m2(lonlat: FloatArray) -> float:
    lon, sine = np.radians(lonlat[:, 0]), np.sin(np.radians(lonlat[:, 1]))
    return (
        abs(float(np.sum((lon[1:] - lon[:-1]) * (sine[1:] + sine[:-1])))) / 2 * (SPHERE_RADIUS_M**2)
    )


def check_size(lonlat: FloatArray) -> None:
    """Raise when the outer ring is too large or too near a pole for a survey.

    Raises
    ------
    GeometryError
        With the value and the limit.
    """
    area = _sphere_area_m2(lonlat)
    if area > MAX_AREA_M2:
        raise GeometryError(
            f"the lake would be {area_text(area)}, the limit is {area_text(MAX_AREA_M2)}; "
            "draw one lake"
        )
    lat = float(lonlat[np.argmax(np.abs(lonlat[:, 1])), 1])
    if abs(lat) > MAX_LATITUDE_DEG:
        raise GeometryError(
            f"latitude {lat:g} is outside the supported range "
            f"(-{MAX_LATITUDE_DEG:g}..{MAX_LATITUDE_DEG:g})"
        )


def near_longitude(lonlat: FloatArray, lon_deg: float) -> FloatArray:
    """Return the ring shifted by whole turns so that it lies nearest to a longitude."""
    middle = (lonlat[:, 0].min() + lonlat[:, 0].max()) / 2
    turns = round((lon_deg - middle) / 360.0)
    if turns == 0:
        return lonlat
    out = lonlat.copy()
    out[:, 0] += 360.0 * turns
    return out


@dataclass(frozen=True, slots=True, kw_only=True)
class Faces:
    """What a ring that touches or crosses itself encloses.

    ``polygons[i]`` is one bounded face, ``winding[i]`` how often the ring goes around it
    (anticlockwise positive). ``spikes`` are the stretches that enclose nothing.
    """

    polygons: list[shapely.Polygon]
    winding: list[int]
    spikes: shapely.Geometry


def faces_of(lonlat: FloatArray) -> Faces:
    """Return the bounded faces of a closed ring, with winding numbers, and its spikes.

    Parameters
    ----------
    lonlat : (n, 2) float array
        Closed ring.
    """
    noded = shapely.unary_union(shapely.LineString(lonlat))
    polygons, cuts, dangles, _ = shapely.polygonize_full([noded])
    spikes = shapely.union_all([cuts, dangles])
    faces = [face for face in polygons.geoms if face.area > 0]
    points = shapely.get_coordinates(shapely.point_on_surface(np.array(faces, dtype=object)))
    winding = [_winding(lonlat, x, y) for x, y in points]
    return Faces(polygons=faces, winding=winding, spikes=spikes)


def _winding(ring: FloatArray, x: float, y: float) -> int:
    """Return the winding number of a closed ring about a point not on it (Sunday's rule)."""
    x0, y0 = ring[:-1, 0] - x, ring[:-1, 1] - y
    x1, y1 = ring[1:, 0] - x, ring[1:, 1] - y
    side = x0 * y1 - x1 * y0
    up = (y0 <= 0) & (y1 > 0) & (side > 0)
    down = (y0 > 0) & (y1 <= 0) & (side < 0)
    return int(up.sum()) - int(down.sum())


def size_m(geometry_lonlat: shapely.Geometry) -> float:
    """Return the longer side of a geometry's bounding box, m."""
    west, south, east, north = geometry_lonlat.bounds
    lon_m, lat_m = degree_lengths_m((south + north) / 2)
    return max((east - west) * lon_m, (north - south) * lat_m)


def length_text(length_m: float) -> str:
    """Return a length for a message.

    Examples
    --------
    >>> length_text(0.25), length_text(12.4), length_text(2204.0), length_text(6.3e6)
    ('0.25 m', '12 m', '2.2 km', '6300 km')
    """
    if length_m < 10:
        return f"{length_m:.2g} m"
    if length_m < 1000:
        return f"{length_m:.0f} m"
    return f"{length_m / 1000:.2g} km" if length_m < 100_000 else f"{length_m / 1000:.0f} km"


def place_of(geometry_lonlat: shapely.Geometry) -> str:
    """Return a position on a geometry, for a message."""
    point = geometry_lonlat.representative_point()
    lon = point.x - 360.0 * math.floor((point.x + 180.0) / 360.0)
    return place_text(lon, point.y)

"""Walk a GeoJSON document: collect its polygons, count what else it holds."""

from __future__ import annotations

import re
from collections import Counter
from dataclasses import dataclass, field
from typing import Any

import numpy as np
import shapely

from mrmission.area import formats
from mrmission.area.repair import RawPolygon
from mrmission.area.rings import (
    Ring,
    check_range,
    check_size,
    continuous,
    length_text,
    near_longitude,
    parse_ring,
    size_m,
)
from mrmission.errors import GeometryError

MAX_COLLECTION_DEPTH = 8
_OTHERS = {
    "Point": "point",
    "MultiPoint": "point",
    "LineString": "line",
    "MultiLineString": "line",
}
_WGS84 = {"4326", "4979"}
_NEAR_WGS84 = {
    "4269": "NAD83", "4152": "NAD83(HARN)", "4617": "NAD83(CSRS)", "4258": "ETRS89",
    "4937": "ETRS89", "4283": "GDA94", "7844": "GDA2020", "4612": "JGD2000", "6668": "JGD2011",
    "4490": "CGCS2000", "4674": "SIRGAS 2000", "4167": "NZGD2000", "4148": "Hartebeesthoek94",
}  # fmt: skip
"""Geographic systems that lie within about two metres of WGS 84, by EPSG code."""

_NAME_KEYS = ("name", "Name", "NAME", "GNIS_NAME", "GNIS_Name", "title")


@dataclass(slots=True)
class Contents:
    """What was found in a document."""

    polygons: list[RawPolygon] = field(default_factory=list)
    others: Counter[str] = field(default_factory=Counter)
    kinds: Counter[str] = field(default_factory=Counter)
    closed_lines: int = 0
    empty: int = 0
    without_geometry: int = 0
    features: int | None = None
    name: str | None = None
    notes: list[str] = field(default_factory=list)

    def note(self, text: str) -> None:
        """Add a note once."""
        if text not in self.notes:
            self.notes.append(text)


def collect(document: dict[str, Any]) -> Contents:
    """Return the polygons of a GeoJSON object, and notes.

    Raises
    ------
    GeometryError
        When it is not GeoJSON, not in lon/lat, broken, or holds no polygon.
    """
    contents = Contents()
    _check_crs(document, contents)
    kind = document.get("type")
    if kind == "FeatureCollection":
        _collection(document, contents)
    elif kind == "Feature":
        _feature(document, "", contents)
    else:
        _geometry(document, "", 0, contents)
    if not contents.polygons:
        raise GeometryError(_nothing(contents))
    _note_ignored(contents)
    _near_first(contents)
    return contents


def _collection(document: dict[str, Any], contents: Contents) -> None:
    features = document.get("features")
    if not isinstance(features, list):
        raise GeometryError('the FeatureCollection has no list "features"')
    contents.features = len(features)
    if isinstance(document.get("name"), str):
        contents.name = formats.printable(document["name"]) or None
    collection_name = contents.name
    contents.name = None
    for number, feature in enumerate(features, start=1):
        label = f"feature {number}" if len(features) > 1 else ""
        if not isinstance(feature, dict):
            raise GeometryError(
                f"feature {number} must be an object, found {formats.json_type(feature)}"
            )
        if feature.get("type") == "Feature":
            _feature(feature, label, contents)
        else:
            _geometry(feature, label, 0, contents)
    contents.name = contents.name or collection_name


def _feature(feature: dict[str, Any], label: str, contents: Contents) -> None:
    if "crs" in feature:
        _check_crs(feature, contents)
    geometry = feature.get("geometry")
    if geometry is None:
        contents.without_geometry += 1
        return
    before = len(contents.polygons)
    _geometry(geometry, label, 0, contents)
    properties = feature.get("properties")
    if contents.name is None and len(contents.polygons) > before and isinstance(properties, dict):
        for key in _NAME_KEYS:
            if isinstance(properties.get(key), str) and formats.printable(properties[key]):
                contents.name = formats.printable(properties[key])
                break


def _prefix(label: str) -> str:
    return f"{label}: " if label else ""


def _geometry(geometry: Any, label: str, depth: int, contents: Contents) -> None:
    if not isinstance(geometry, dict):
        raise GeometryError(
            f"{_prefix(label)}a geometry must be an object, found {formats.json_type(geometry)}"
        )
    if depth > MAX_COLLECTION_DEPTH:
        raise GeometryError(
            f"{_prefix(label)}GeometryCollections are nested too deeply "
            f"(more than {MAX_COLLECTION_DEPTH} levels); put the polygon at the top"
        )
    if "crs" in geometry:
        _check_crs(geometry, contents)
    kind = geometry.get("type")
    if kind == "GeometryCollection":
        members = geometry.get("geometries")
        if not isinstance(members, list):
            raise GeometryError(f'{_prefix(label)}the GeometryCollection has no list "geometries"')
        for member in members:
            _geometry(member, label, depth + 1, contents)
        return
    if kind not in ("Polygon", "MultiPolygon", *_OTHERS):
        raise GeometryError(f"{_prefix(label)}{_unknown_type(geometry, kind)}")
    if "coordinates" not in geometry:
        raise GeometryError(f'{_prefix(label)}geometry has no "coordinates" ({kind})')
    coordinates = geometry["coordinates"]
    if kind in _OTHERS:
        contents.kinds[kind] += 1
        contents.others[_OTHERS[kind]] += (
            len(coordinates) if kind.startswith("Multi") and isinstance(coordinates, list) else 1
        )
        if kind == "LineString" and isinstance(coordinates, list) and len(coordinates) > 3:
            contents.closed_lines += coordinates[0] == coordinates[-1]
        return
    if not isinstance(coordinates, list):
        raise GeometryError(
            f"{_prefix(label)}{kind} coordinates must be a list of "
            f"{'rings' if kind == 'Polygon' else 'polygons'}, "
            f"found {formats.json_type(coordinates)}"
        )
    if kind == "Polygon":
        _polygon(coordinates, label, contents)
        return
    if not coordinates:
        contents.empty += 1
    for number, polygon in enumerate(coordinates, start=1):
        part = f"{label} part {number}".strip() if len(coordinates) > 1 else label
        if not isinstance(polygon, list):
            raise GeometryError(
                f"{_prefix(part)}MultiPolygon coordinates must be a list of polygons, "
                f"found {formats.json_type(polygon)}"
            )
        _polygon(polygon, part, contents)


def _unknown_type(geometry: dict[str, Any], kind: Any) -> str:
    if kind is None:
        keys = ", ".join(formats.quoted(key, 20) for key in list(geometry)[:4])
        return f'not GeoJSON: an object without "type" (it has {keys or "nothing"})'
    return (
        f'not GeoJSON: "type" is {formats.quoted(kind)}; '
        "expected Polygon, MultiPolygon, Feature or FeatureCollection"
    )


def _polygon(coordinates: list[Any], label: str, contents: Contents) -> None:
    """Read one polygon; an error names the feature and the part."""
    try:
        rings = [parse_ring(value, number) for number, value in enumerate(coordinates, start=1)]
        if not rings or rings[0] is None:
            if any(ring is not None for ring in rings):
                raise GeometryError("the outer ring is empty but there are islands; draw the shore")
            contents.empty += 1
            return
        shell = _placed(rings[0], 1, None, contents)
        check_size(shell.lonlat)
        middle = float(shell.lonlat[:, 0].min() + shell.lonlat[:, 0].max()) / 2
        holes: list[Ring] = []
        for number, ring in enumerate(rings[1:], start=2):
            if ring is None:
                contents.note(f"{_prefix(label)}island {number - 1} is an empty ring; ignored")
            else:
                holes.append(_placed(ring, number, middle, contents))
    except GeometryError as error:
        raise GeometryError(f"{_prefix(label)}{error}") from None
    if any(ring is not None and ring.extra_numbers for ring in rings):
        contents.note("extra numbers in positions ignored")
    contents.polygons.append(RawPolygon(label=label, shell=shell, holes=tuple(holes)))


def _placed(ring: Ring, number: int, near_lon_deg: float | None, contents: Contents) -> Ring:
    """Return the ring with continuous longitudes in -180..180, or across the 180° meridian."""
    check_range(ring.lonlat, number)
    given = ring.lonlat
    lonlat = continuous(given)
    if near_lon_deg is None:
        middle = float(lonlat[:, 0].min() + lonlat[:, 0].max()) / 2
        turns = -((middle + 180.0) // 360.0)
        if turns and middle != 180.0:
            lonlat = lonlat.copy()
            lonlat[:, 0] += 360.0 * turns
            contents.note("longitudes beyond ±180 taken as 0..360")
        if lonlat[:, 0].max() > 180 or lonlat[:, 0].min() < -180:
            wide = length_text(size_m(shapely.LineString(lonlat)))
            contents.note(f"crosses the 180 meridian; taken as one lake, {wide} wide")
    else:
        lonlat = near_longitude(lonlat, near_lon_deg)
    return Ring(lonlat=lonlat, was_closed=ring.was_closed, extra_numbers=ring.extra_numbers)


def _near_first(contents: Contents) -> None:
    """Shift polygons by whole turns to lie near the first (halves cut at the 180° meridian)."""
    first = contents.polygons[0].shell.lonlat
    middle = float(first[:, 0].min() + first[:, 0].max()) / 2
    for i, raw in enumerate(contents.polygons[1:], start=1):
        shell = near_longitude(raw.shell.lonlat, middle)
        if shell is raw.shell.lonlat:
            continue
        turn = shell[0, 0] - raw.shell.lonlat[0, 0]
        rings = [
            Ring(
                lonlat=ring.lonlat + np.array([turn, 0.0]),
                was_closed=ring.was_closed,
                extra_numbers=ring.extra_numbers,
            )
            for ring in (raw.shell, *raw.holes)
        ]
        contents.polygons[i] = RawPolygon(label=raw.label, shell=rings[0], holes=tuple(rings[1:]))
        contents.note("parts on both sides of the 180 meridian taken as neighbours")


def _nothing(contents: Contents) -> str:
    """Say why there is no polygon."""
    if contents.features == 0:
        return "the file holds no features; export the lake again"
    if contents.empty:
        return "the polygon is empty; draw the outline of the lake"
    if contents.closed_lines:
        return "no polygon in the file: found a closed LineString; save it as a Polygon"
    if contents.kinds:
        return f"no polygon in the file: found {', '.join(sorted(contents.kinds))}"
    if contents.without_geometry:
        return "the feature has no geometry; export the lake again"
    return "no polygon in the file: it is empty"


def _note_ignored(contents: Contents) -> None:
    parts = [
        f"{count} {word}{'s' if count > 1 else ''}"
        for word, count in sorted(contents.others.items(), reverse=True)
    ]
    if contents.without_geometry:
        plural = "s" if contents.without_geometry > 1 else ""
        parts.append(f"{contents.without_geometry} feature{plural} without geometry")
    if contents.empty:
        parts.append(f"{contents.empty} empty polygon{'s' if contents.empty > 1 else ''}")
    if parts:
        used = (
            "the only polygon"
            if len(contents.polygons) == 1
            else f"{len(contents.polygons)} polygons"
        )
        contents.note(f"used {used}; ignored {' and '.join(parts)}")


def _check_crs(item: dict[str, Any], contents: Contents) -> None:
    """Accept the legacy ``crs`` member where it means lon/lat on WGS 84 or nearly so.

    Raises
    ------
    GeometryError
        When it names another system.
    """
    crs = item.get("crs")
    if crs is None:
        return
    properties = crs.get("properties") if isinstance(crs, dict) else None
    name = properties.get("name") if isinstance(properties, dict) else None
    if not isinstance(name, str):
        contents.note('the "crs" member has no name; taken as WGS 84 longitude, latitude')
        return
    if re.search(r"CRS:?84$|WGS ?_?(19)?84$", name, re.I):
        return
    if re.search(r"CRS:?83$", name, re.I):
        contents.note("file says NAD83; used as WGS 84 (about 1 m off)")
        return
    match = re.search(r"EPSG\D+(?:[\d.]+:)?(\d+)$", name, re.I) or re.search(
        r"EPSG:+(\d+)$", name, re.I
    )
    code = match.group(1) if match else None
    if code in _WGS84:
        return
    if code in _NEAR_WGS84:
        contents.note(f"file says {_NEAR_WGS84[code]}; used as WGS 84 (about 1 m off)")
        return
    system = f"EPSG:{code}" if code else formats.quoted(name, 60)
    raise GeometryError(
        f"file says {system} (metres, or another datum); reproject to WGS 84 lon/lat "
        "(ogr2ogr -t_srs EPSG:4326 lake.geojson FILE)"
    )

"""Recognise files of other formats, to say what they are and what to export instead."""

from __future__ import annotations

import io
import re
from pathlib import Path
from typing import Any, NoReturn

from mrmission.errors import InputError

_IMAGES = {
    b"\x89PNG\r\n\x1a\n": "a PNG image",
    b"\xff\xd8\xff": "a JPEG image",
    b"GIF8": "a GIF image",
    b"BM": "a BMP image",
    b"P5\n": "a PGM image",
    b"P2\n": "a PGM image",
    b"P5 ": "a PGM image",
    b"P4\n": "a PBM image",
}
_BINARIES = {
    b"%PDF": "a PDF; export the outline as GeoJSON from the program that drew it",
    b"\x1f\x8b": "gzip-compressed; unpack it first (gunzip)",
    b"7z\xbc\xaf\x27\x1c": "a 7z archive; unpack it first",
    b"Rar!": "a RAR archive; unpack it first",
    b"PAR1": "a Parquet file; export GeoJSON (ogr2ogr lake.geojson lake.parquet)",
    b"fgb\x03": "a FlatGeobuf file; export GeoJSON (ogr2ogr lake.geojson lake.fgb)",
    b"II*\0": "a TIFF image; save it as PNG and give --resolution and --origin",
    b"MM\0*": "a TIFF image; save it as PNG and give --resolution and --origin",
    b"\0\0\x27\x0a": (
        "a shapefile; shapefiles are not read; export GeoJSON "
        "(ogr2ogr -t_srs EPSG:4326 lake.geojson lake.shp)"
    ),
}
_SHAPEFILE = (
    "shapefiles are not read; export GeoJSON (ogr2ogr -t_srs EPSG:4326 lake.geojson lake.shp)"
)
_KML_GEOMETRY = re.compile(r"<(?:\w+:)?(Polygon|LineString|Point|Track|LinearRing)\b")
_WKT = re.compile(
    r"(SRID=\d+;\s*)?(MULTI)?(POLYGON|POINT|LINESTRING|GEOMETRYCOLLECTION)\s*(Z|M|ZM)?\s*\(", re.I
)


def quoted(value: object, limit: int = 40) -> str:
    r"""Return `value` in quotes on one line, cut to `limit` characters, safe for a terminal.

    Examples
    --------
    >>> quoted("a\nb")
    '"a?b"'
    """
    return f'"{printable(str(value), limit)}"'


def printable(text: str, limit: int = 80) -> str:
    """Return `text` without control characters and surrogates, cut to `limit` characters."""
    clean = "".join(c if c.isprintable() else "?" for c in text[: limit + 1]).strip()
    return clean if len(clean) <= limit else clean[: limit - 1] + "…"


def json_type(value: object) -> str:
    """Return what JSON calls the type of `value`, with its article."""
    if value is None:
        return "null"
    if isinstance(value, bool):
        return "true" if value else "false"
    for kind, name in ((dict, "an object"), (list, "a list"), (str, "a string")):
        if isinstance(value, kind):
            return name
    return "a number"


def refuse_binary(data: bytes, path: Path) -> None:
    """Raise when `data` begins like a binary format.

    Raises
    ------
    InputError
        With what the file is and what to export instead.
    """
    for magic, name in _IMAGES.items():
        if data.startswith(magic):
            raise InputError(
                f"this is {name}; read as a map it needs --resolution METRES and --origin LON,LAT"
            )
    if data.startswith((b"PK\x03\x04", b"PK\x05\x06")):
        _refuse_zip(data)
    if data.startswith(b"SQLite format 3\0"):
        _refuse_sqlite(path)
    for magic, name in _BINARIES.items():
        if data.startswith(magic):
            raise InputError(f"this is {name}")


def _refuse_zip(data: bytes) -> NoReturn:
    import zipfile  # only here: costs start-up time

    try:
        with zipfile.ZipFile(io.BytesIO(data)) as archive:
            names = [name.lower() for name in archive.namelist()]
    except (zipfile.BadZipFile, ValueError, OSError, NotImplementedError):
        raise InputError("this is a damaged zip file; get it again, as GeoJSON") from None
    if any(name.endswith(".kml") for name in names):
        raise InputError("KMZ is not read; export GeoJSON (ogr2ogr lake.geojson lake.kmz)")
    shapes = [name for name in names if name.endswith(".shp")]
    if shapes:
        if not any(name.endswith(".prj") for name in names):
            raise InputError(
                f"a zipped shapefile; {_SHAPEFILE}; it has no .prj: unknown projection, so also "
                "give its own with -s_srs"
            )
        raise InputError(f"a zipped shapefile; {_SHAPEFILE}")
    if any(name.endswith((".geojson", ".json")) for name in names):
        raise InputError("this is a zip file with GeoJSON in it; unpack it first")
    raise InputError("this is a zip file without a lake outline; export GeoJSON")


def _refuse_sqlite(path: Path) -> NoReturn:
    import sqlite3  # only here: costs start-up time

    layers: list[str] = []
    try:
        uri = path.absolute().as_uri() + "?mode=ro&immutable=1"
        connection = sqlite3.connect(uri, uri=True)
        try:
            rows = connection.execute(
                "SELECT table_name FROM gpkg_contents WHERE data_type = 'features' "
                "ORDER BY table_name LIMIT 20"
            )
            layers = [printable(str(row[0]), 40) for row in rows]
        finally:
            connection.close()
    except (sqlite3.Error, ValueError, OSError):
        pass  # not a GeoPackage, or damaged: the general message below
    if len(layers) > 1:
        raise InputError(
            f"GeoPackage is not read, and this one has {len(layers)} layers ({', '.join(layers)}): "
            f"choose one and export GeoJSON (ogr2ogr lake.geojson lake.gpkg {layers[0]})"
        )
    if layers:
        raise InputError("GeoPackage is not read; export GeoJSON (ogr2ogr lake.geojson lake.gpkg)")
    raise InputError("this is a SQLite database, not a lake; export GeoJSON")


def refuse_text(text: str) -> None:
    """Raise when `text` is XML, HTML, WKT or a waypoint list instead of JSON.

    Raises
    ------
    InputError
        With what the file is and what to export instead.
    """
    head = text[:4096].lstrip()
    if not head:
        raise InputError("the file is blank; save it again")
    if head.startswith("<"):
        _refuse_markup(text)
    if head.startswith("QGC WPL"):
        raise InputError("this is a waypoint list (QGC WPL), not a lake; export GeoJSON")
    if _WKT.match(head):
        raise InputError("this is WKT; export GeoJSON (ogr2ogr lake.geojson lake.csv)")


def _refuse_markup(text: str) -> NoReturn:
    head = text[:4096].lower()
    if "<!entity" in head:
        raise InputError(
            "XML entities are not allowed, and KML is not read; export GeoJSON without them"
        )
    if "<html" in head or "<!doctype html" in head:
        raise InputError("not a JSON file (it looks like HTML, an error page?); download it again")
    if "<kml" in head:
        kinds = sorted(set(_KML_GEOMETRY.findall(text)) - {"LinearRing"})
        if "Polygon" not in kinds:
            found = ", ".join(kinds) or "nothing"
            raise InputError(
                f"KML is not read, and there is no polygon in the file: found {found}; "
                "draw the lake as a polygon and export GeoJSON"
            )
        raise InputError("KML is not read; export GeoJSON (ogr2ogr lake.geojson lake.kml)")
    for tag, name in (("<gpx", "GPX"), ("<osm", "OpenStreetMap XML"), ("<svg", "SVG"),
                      ("gml", "GML")):  # fmt: skip
        if tag in head:
            raise InputError(f"not a JSON file: this is {name}; export the lake as GeoJSON")
    raise InputError("not a JSON file (it looks like XML); export the lake as GeoJSON")


def refuse_document(document: dict[str, Any]) -> None:
    """Raise when a JSON object is of another format than GeoJSON.

    Raises
    ------
    InputError
        With what the file is and what to export instead.
    """
    if document.get("type") == "Topology":
        raise InputError(
            "this is TopoJSON; convert it to GeoJSON (ogr2ogr lake.geojson lake.topojson)"
        )
    if document.get("fileType") == "Plan":
        _refuse_plan(document)
    if "type" not in document:
        if {"rings", "geometryType", "spatialReference"} & document.keys():
            raise InputError("this is Esri JSON; export GeoJSON (ogr2ogr lake.geojson lake.json)")
        if isinstance(document.get("elements"), list):
            raise InputError("this is Overpass (OpenStreetMap) JSON; export GeoJSON")


def _refuse_plan(document: dict[str, Any]) -> NoReturn:
    fence = document.get("geoFence")
    fence = fence if isinstance(fence, dict) else {}
    shapes = [
        shape
        for key in ("polygons", "circles")
        if isinstance(fence.get(key), list)
        for shape in fence[key]
        if isinstance(shape, dict)
    ]
    if not shapes:
        raise InputError(
            "this is a QGroundControl plan, and the plan has no fence: no lake outline; "
            "export GeoJSON"
        )
    if not any(shape.get("inclusion") for shape in shapes):
        raise InputError(
            "this is a QGroundControl plan, and the plan has no inclusion fence: no lake outline; "
            "export GeoJSON"
        )
    raise InputError("QGC plans are not read as lakes; export GeoJSON")

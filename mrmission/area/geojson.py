"""Read a survey area from a GeoJSON file (RFC 7946), and write one.

References
----------
RFC 7946, The GeoJSON Format: polygons are rings of positions, longitude first, the outer ring and
then the holes (islands); edges are straight lines in longitude and latitude.
"""

from __future__ import annotations

import json
from pathlib import Path

import shapely

from mrmission.area import parts as parts_
from mrmission.area import reading, repair
from mrmission.area.features import collect
from mrmission.area.formats import printable
from mrmission.errors import GeometryError, InputError
from mrmission.model import SurveyArea

ANTARCTIC_LATITUDE_DEG = -60.0


def read_survey_area(path: Path, *, part: int | None = None, islands: bool = False) -> SurveyArea:
    """Read the survey area in a GeoJSON file.

    Polygon, MultiPolygon, Feature, FeatureCollection and GeometryCollection are read; islands are
    holes. What can be repaired without water growing over land is, with a note; the rest is
    refused.

    Parameters
    ----------
    path : Path
        The file; messages name it as it is given.
    part : int, optional
        Keep only this part of the water, 1 = largest. All parts are kept without it, with a note.
    islands : bool
        Take polygons that lie inside another polygon's water as its islands. They are refused
        without it.

    Returns
    -------
    SurveyArea
        Water in lon/lat with the largest part first, and one note per repair and assumption.

    Raises
    ------
    InputError
        When the file is unreadable or of another format.
    GeometryError
        When its geometry cannot be used safely.
    """
    try:
        return _read(path, part, islands)
    except InputError as error:
        raise type(error)(f"{path}: {error}") from None
    except RecursionError:
        raise GeometryError(f"{path}: nested too deeply; put the polygon at the top") from None
    except shapely.errors.GEOSException as error:
        reason = printable(str(error), 100)
        raise GeometryError(f"{path}: the geometry cannot be used ({reason}); redraw it") from None


def _read(path: Path, part: int | None, islands: bool) -> SurveyArea:
    document, notes = reading.read_document(path)
    contents = collect(document)
    notes += contents.notes
    waters = []
    for number, raw in enumerate(contents.polygons, start=1):
        try:
            pieces, more = repair.water_of(raw)
        except GeometryError as error:
            prefix = f"{raw.label}: " if raw.label else ""
            if len(contents.polygons) > 1 and "has no area" in str(error):
                notes.append(f"{prefix}ignored, it has no area")
                continue
            raise GeometryError(f"{prefix}{error}") from None
        notes += more
        waters.append(
            parts_.Water(number=number, label=raw.label, geometry=shapely.MultiPolygon(pieces))
        )
    if not waters:
        raise GeometryError("the polygons have no area; draw the outline of the lake")
    pieces, more = parts_.combine(waters, islands=islands)
    notes += more
    pieces, more = parts_.choose(pieces, part, polygons=len(waters))
    notes += more
    water = shapely.MultiPolygon(pieces)
    centre = water.centroid
    if centre.y < ANTARCTIC_LATITUDE_DEG:
        east = "E" if centre.x >= 0 else "W"
        notes.append(
            f"the lake lies at {-centre.y:.0f} S {abs(centre.x):.0f} {east} (Antarctica): "
            "check that longitude comes first"
        )
    return SurveyArea(
        name=contents.name or printable(path.stem) or "area",
        source=str(path),
        water_lonlat=water,
        notes=tuple(dict.fromkeys(notes)),
    )


def free_area_geojson(area: SurveyArea, *, decimals: int = 9) -> str:
    """Return the free area as it was understood, as GeoJSON text (a Feature, RFC 7946).

    Parameters
    ----------
    area : SurveyArea
        The area; its notes become a property.
    decimals : int
        Decimals of a degree; 9 is a tenth of a millimetre.

    Notes
    -----
    Outer rings run anticlockwise, islands clockwise. Longitudes stay continuous: they leave ±180
    where the water crosses that meridian, as :func:`read_survey_area` takes them.
    """
    oriented = shapely.orient_polygons(area.water_lonlat)
    coordinates = [
        [
            [
                [round(x, decimals), round(y, decimals)]
                for x, y in shapely.get_coordinates(ring).tolist()
            ]
            for ring in (polygon.exterior, *polygon.interiors)
        ]
        for polygon in shapely.get_parts(oriented).tolist()
    ]
    geometry = (
        {"type": "Polygon", "coordinates": coordinates[0]}
        if len(coordinates) == 1
        else {"type": "MultiPolygon", "coordinates": coordinates}
    )
    feature = {
        "type": "Feature",
        "properties": {"name": area.name, "notes": list(area.notes)},
        "geometry": geometry,
    }
    return json.dumps(feature, ensure_ascii=False, separators=(",", ":")) + "\n"

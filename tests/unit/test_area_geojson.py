"""Reading GeoJSON: what is accepted, repaired with a note, or refused in one line."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest
import shapely

from mrmission.area.geojson import free_area_geojson, read_survey_area
from mrmission.errors import GeometryError, InputError

# about 1 km x 0.8 km; 1e-4 degrees are 9.2 m by 11 m
LAKE = [[-81.30, 34.060], [-81.29, 34.060], [-81.29, 34.067], [-81.30, 34.067], [-81.30, 34.060]]


def box(west: float, south: float, east: float, north: float) -> list[list[float]]:
    return [[west, south], [east, south], [east, north], [west, north], [west, south]]


ISLAND = box(-81.297, 34.062, -81.296, 34.063)
SECOND = box(-81.294, 34.062, -81.293, 34.063)


def write(tmp_path: Path, document: Any, name: str = "lake.geojson") -> Path:
    path = tmp_path / name
    path.write_text(document if isinstance(document, str) else json.dumps(document))
    return path


def polygon(*rings: list[list[float]]) -> dict[str, Any]:
    return {"type": "Polygon", "coordinates": list(rings)}


def collection(*geometries: dict[str, Any] | None) -> dict[str, Any]:
    return {
        "type": "FeatureCollection",
        "features": [
            {"type": "Feature", "properties": {}, "geometry": geometry} for geometry in geometries
        ],
    }


def area_deg2(*rings: list[list[float]]) -> float:
    return float(shapely.Polygon(rings[0], rings[1:]).area)


# --- the files of the shared data -----------------------------------------------------------------

# words that the note or the refusal must hold, beside being accepted, repaired or refused
WORDS = {
    "self_intersect_bowtie.geojson": "crosses itself",
    "self_intersect_small_loop.geojson": "1 m loop",
    "self_intersect_hole.geojson": "island 1 crosses",
    "spike.geojson": "zero-width spike",
    "unclosed_ring.geojson": "not closed; closed it",
    "one_point_hole.geojson": "dropped island 1",
    "hole_crosses_shell.geojson": "island 1 crosses the shore; cut at the shore",
    "holes_overlap.geojson": "islands 1 and 2 overlap; merged",
    "holes_share_edge.geojson": "islands 1 and 2 share an edge; merged",
    "hole_in_hole.geojson": "island 2 lies inside island 1; ignored",
    "hole_outside_shell.geojson": "island 1 is outside the lake; ignored",
    "hole_equals_shell.geojson": "nothing is left to cover: island 1 fills the lake",
    "holes_cut_in_two.geojson": "water is in 2 parts that no boat can pass between",
    "islands_as_features.geojson": "features 2, 3 lie inside feature 1: are they islands?",
    "multipolygon_two.geojson": "2 separate water bodies",
    "featurecollection_mixed.geojson": "used the only polygon; ignored 2 points and 1 line",
    "linestring_only.geojson": "no polygon in the file: found LineString",
    "linestring_closed.geojson": "found a closed LineString; save it as a Polygon",
    "point_only.geojson": "no polygon in the file: found Point",
    "empty_featurecollection.geojson": "the file holds no features",
    "empty_polygon.geojson": "the polygon is empty",
    "empty_ring.geojson": "the polygon is empty",
    "null_geometry.geojson": "the feature has no geometry",
    "missing_coordinates.geojson": 'geometry has no "coordinates"',
    "wrong_nesting.geojson": "Polygon coordinates must be a list of rings",
    "topojson.json": "this is TopoJSON; convert it to GeoJSON",
    "esri.json": "this is Esri JSON; export GeoJSON",
    "nan_coordinate.geojson": "finite number (ring 1, position 2)",
    "infinity_coordinate.geojson": "finite number (ring 1, position 2)",
    "null_coordinate.geojson": "a coordinate is not a number (ring 1, position 2)",
    "string_coordinates.geojson": "a coordinate is not a number (ring 1, position 1)",
    "bool_coordinate.geojson": "a coordinate is not a number",
    "coords_4d_mixed.geojson": "extra numbers in positions ignored",
    "legacy_crs_nad83.geojson": "file says NAD83; used as WGS 84 (about 1 m off)",
    "latlon_swapped_obvious.geojson": "latitude 151.2 is out of range",
    "latlon_swapped_silent.geojson": "the lake lies at 81 S 34 E (Antarctica)",
    "lon_0_360.geojson": "taken as 0..360",
    "antimeridian_jump.geojson": "crosses the 180 meridian; taken as one lake, 2.1 km wide",
    "antimeridian_over180.geojson": "crosses the 180 meridian",
    "north_pole.geojson": "the polygon contains a pole",
    "near_pole.geojson": "outside the supported range",
    "lat_out_of_range.geojson": "out of range",
    "whole_world.geojson": "the lake would be 510 million km²",
    "sliver_zero_area.geojson": "the polygon has no area",
    "latin1_name.geojson": "the file is not UTF-8",
    "html_error_page.geojson": "it looks like HTML",
    "two_documents.geojsonl": "more than one JSON document",
    "trailing_comma.geojson": "trailing comma",
    "comment.geojson": "not valid JSON at line 1 column 1",
    "nul_bytes.geojson": "not a JSON file",
    "deep_nesting.geojson": "JSON is nested too deeply",
    "deep_geometrycollection.geojson": "GeometryCollections are nested too deeply",
    "duplicate_keys.geojson": 'duplicate key "geometry"; used the last one',
    "top_level_array.geojson": "not GeoJSON: the top level is a list",
    "top_level_null.geojson": "not GeoJSON: the top level is null",
    "big_integer.geojson": "a coordinate is not a usable",
    "lake.kmz": "KMZ is not read; export GeoJSON",
    "kml_entity_bomb.kml": "XML entities are not allowed",
    "kml_track_only.kml": "no polygon in the file: found LineString",
    "shapefile_wgs84.zip": "shapefiles are not read; export GeoJSON",
    "shapefile_utm17.zip": "shapefiles are not read; export GeoJSON",
    "shapefile_no_prj.zip": "no .prj: unknown projection",
    "lake.gpkg": "GeoPackage is not read; export GeoJSON",
    "two_layers.gpkg": "2 layers (forest, lake)",
    "fence_only.plan": "QGC plans are not read as lakes; export GeoJSON",
    "fence_with_circle.plan": "QGC plans are not read as lakes; export GeoJSON",
    "fence_exclusion_only.plan": "the plan has no inclusion fence: no lake outline",
    "plan_empty.plan": "the plan has no fence: no lake outline",
    "real_nhd_flagstaff_degenerate_holes.geojson": "dropped 169 islands",
    "real_osgb_metres_3d.geojson": "file says EPSG:27700",
}


def test_every_bad_file_is_accepted_repaired_or_refused_as_expected(shared_data: Path) -> None:
    failures = []
    index = json.loads((shared_data / "bad" / "index.json").read_text())
    assert len(index) == 81
    for entry in index:
        path = shared_data / "bad" / entry["file"]
        try:
            area = read_survey_area(path)
        except InputError as error:
            outcome, text = "refuse", str(error)
            assert text.startswith(f"{path}: ")
        else:
            outcome, text = (
                ("repair_with_warning" if area.notes else "accept"),
                "; ".join(area.notes),
            )
            assert area.water_lonlat.is_valid
            assert area.water_lonlat.area > 0
            assert all(note.isprintable() for note in area.notes)
        allowed = {entry["expect"], entry.get("also_acceptable")}
        if entry["file"] == "multipolygon_two.geojson":
            allowed.add(
                "repair_with_warning"
            )  # accepted, and the note tells that there is a choice
        if outcome not in allowed or WORDS.get(entry["file"], "") not in text or "\n" in text:
            failures.append((entry["file"], outcome, text))
    assert failures == []


def test_every_lake_is_accepted_as_it_is(shared_data: Path) -> None:
    for path in sorted((shared_data / "lakes").glob("*.geojson")):
        area = read_survey_area(path)
        raw = shapely.from_geojson(path.read_text())
        assert area.water_lonlat.area == pytest.approx(raw.area, rel=1e-12)
        if path.stem != "manicouagan_qc":  # a lake in its island
            assert area.notes == ()


# --- repairs keep land ----------------------------------------------------------------------------


def test_plain_lake_keeps_its_bits(tmp_path: Path) -> None:
    area = read_survey_area(write(tmp_path, polygon(LAKE, ISLAND)))
    assert area.notes == ()
    assert area.name == "lake"
    assert area.water_lonlat.equals_exact(shapely.MultiPolygon([(LAKE, [ISLAND])]), 0)


def test_point_and_line_islands_stay_obstacles(tmp_path: Path) -> None:
    point = [[-81.295, 34.065]] * 4
    line = [[-81.298, 34.061], [-81.297, 34.061], [-81.298, 34.061], [-81.298, 34.061]]
    area = read_survey_area(write(tmp_path, polygon(LAKE, ISLAND, point, line)))
    assert "dropped islands 2, 3: they have no area" in area.notes[0]
    (water,) = area.water_lonlat.geoms
    assert len(water.interiors) == 3
    for lonlat in [(-81.295, 34.065), (-81.2975, 34.061)]:
        rock = shapely.Point(lonlat)
        assert not water.contains(rock)
        # a metre on every side: 0.0000088 degrees of latitude
        assert water.distance(rock) >= 0.0000088


@pytest.mark.parametrize(
    ("island", "least_deg2"),
    [
        # a bow-tie: both lobes are land
        ([[-81.297, 34.062], [-81.295, 34.064], [-81.295, 34.062], [-81.297, 34.064],
          [-81.297, 34.062]], 2e-6),
        # wound twice: land once
        (ISLAND[:-1] + ISLAND, 1e-6),
        # clockwise ones and anticlockwise ones are the same
        (ISLAND[::-1], 1e-6),
    ],
)  # fmt: skip
def test_land_never_shrinks(tmp_path: Path, island: list[list[float]], least_deg2: float) -> None:
    area = read_survey_area(write(tmp_path, polygon(LAKE, island)))
    land = area_deg2(LAKE) - area.water_lonlat.area
    assert land >= least_deg2 * (1 - 1e-9)


def test_spike_into_the_water_stays_an_obstacle(tmp_path: Path) -> None:
    # a pier drawn as a line out and back
    shore = [*LAKE[:1], [-81.295, 34.060], [-81.295, 34.063], [-81.295, 34.060], *LAKE[1:]]
    area = read_survey_area(write(tmp_path, polygon(shore, ISLAND)))
    assert "removed zero-width spike" in area.notes[0]
    assert "kept an obstacle" in area.notes[0]
    assert not area.water_lonlat.intersects(
        shapely.LineString([(-81.295, 34.0601), (-81.295, 34.063)])
    )


def test_shore_that_touches_itself_is_two_parts(tmp_path: Path) -> None:
    # two squares that meet at a corner, drawn without crossing
    ring = [[0, 0], [0.01, 0], [0.01, 0.01], [0.02, 0.01], [0.02, 0.02], [0.01, 0.02],
            [0.01, 0.01], [0, 0.01], [0, 0]]  # fmt: skip
    area = read_survey_area(write(tmp_path, polygon(ring)))
    assert len(area.water_lonlat.geoms) == 2
    assert "touches itself" in area.notes[0]


def test_large_loop_is_refused(tmp_path: Path) -> None:
    ring = [[0, 0], [0.01, 0], [0.01, 0.01], [0.002, 0.01], [0.002, -0.003], [0, -0.003], [0, 0]]
    with pytest.raises(GeometryError, match="outer ring crosses itself near 0"):
        read_survey_area(write(tmp_path, polygon(ring)))


# --- several polygons -----------------------------------------------------------------------------


def test_islands_as_features_need_the_option(tmp_path: Path) -> None:
    path = write(tmp_path, collection(polygon(LAKE), polygon(ISLAND), polygon(SECOND)))
    with pytest.raises(GeometryError, match=r"features 2, 3 lie inside feature 1.*--islands"):
        read_survey_area(path)
    area = read_survey_area(path, islands=True)
    assert area.notes == ("features 2, 3 taken as islands",)
    assert area.water_lonlat.area == pytest.approx(area_deg2(LAKE, ISLAND, SECOND))


def test_island_given_as_hole_and_as_feature_is_refused(tmp_path: Path) -> None:
    path = write(tmp_path, collection(polygon(LAKE, ISLAND), polygon(ISLAND)))
    with pytest.raises(GeometryError, match="feature 2 fills an island of feature 1"):
        read_survey_area(path)


@pytest.mark.parametrize("shift", [1e-8, -1e-8])
def test_island_drawn_twice_with_other_digits_is_refused(tmp_path: Path, shift: float) -> None:
    again = [[x + shift, y + shift / 2] for x, y in ISLAND]
    with pytest.raises(GeometryError, match="feature 2 fills an island of feature 1"):
        read_survey_area(write(tmp_path, collection(polygon(LAKE, ISLAND), polygon(again))))


def test_half_an_island_drawn_again_is_refused(tmp_path: Path) -> None:
    half = box(-81.297, 34.062, -81.2965, 34.063)
    with pytest.raises(GeometryError, match="feature 2 lies on the shore of an island"):
        read_survey_area(write(tmp_path, collection(polygon(LAKE, ISLAND), polygon(half))))


def test_island_that_reaches_over_the_shore_is_refused(tmp_path: Path) -> None:
    spit = box(-81.292, 34.062, -81.288, 34.064)
    path = write(tmp_path, collection(polygon(LAKE), polygon(spit)))
    with pytest.raises(GeometryError, match="feature 2 and feature 1 overlap"):
        read_survey_area(path)
    area = read_survey_area(path, islands=True)
    assert not area.water_lonlat.intersects(shapely.Point(-81.291, 34.063))


def test_pond_inside_an_island_is_water(tmp_path: Path) -> None:
    pond = box(-81.2968, 34.0622, -81.2962, 34.0628)
    document = {"type": "MultiPolygon", "coordinates": [[LAKE, ISLAND], [pond]]}
    area = read_survey_area(write(tmp_path, document))
    assert len(area.water_lonlat.geoms) == 2
    assert area.notes[0] == "part 2 lies within an island of part 1; taken as a pond"


def test_tiles_that_share_an_edge_are_one_lake(tmp_path: Path) -> None:
    tiles = (box(0, 0, 0.01, 0.01), box(0.01, 0, 0.02, 0.01))
    area = read_survey_area(write(tmp_path, collection(*map(polygon, tiles))))
    assert len(area.water_lonlat.geoms) == 1
    assert area.notes == ("polygons that share an edge were joined",)


def test_repeated_feature_is_used_once(tmp_path: Path) -> None:
    area = read_survey_area(write(tmp_path, collection(polygon(LAKE), polygon(LAKE))))
    assert area.notes == ("feature 2 repeats feature 1; used once",)


def test_part_is_chosen_by_size(tmp_path: Path) -> None:
    small, large = box(0, 0, 0.01, 0.01), box(0.1, 0, 0.12, 0.02)
    path = write(tmp_path, {"type": "MultiPolygon", "coordinates": [[small], [large]]})
    assert read_survey_area(path).water_lonlat.geoms[0].bounds[0] == 0.1
    assert read_survey_area(path, part=2).water_lonlat.bounds == (0, 0, 0.01, 0.01)
    assert (
        read_survey_area(path, part=1).notes[0].startswith("used part 1 of 2 (1: 4.92 km², 2: 1.23")
    )
    for wrong in (0, 3, -1):
        with pytest.raises(GeometryError, match=rf"--part {wrong}: the water has 2 parts"):
            read_survey_area(path, part=wrong)


def test_halves_on_both_sides_of_the_180_meridian_are_joined(tmp_path: Path) -> None:
    east, west = box(179.99, 10, 180, 10.01), box(-180, 10, -179.99, 10.01)
    area = read_survey_area(
        write(tmp_path, {"type": "MultiPolygon", "coordinates": [[west], [east]]})
    )
    assert len(area.water_lonlat.geoms) == 1
    assert area.water_lonlat.bounds[2] - area.water_lonlat.bounds[0] == pytest.approx(0.02)


def test_geometry_collection_and_name(tmp_path: Path) -> None:
    document = {
        "type": "Feature",
        "properties": {"name": "Long\x1b[31m Lake\ud800"},
        "geometry": {
            "type": "GeometryCollection",
            "geometries": [polygon(LAKE), {"type": "Point", "coordinates": [0, 0]}],
        },
    }
    area = read_survey_area(write(tmp_path, document))
    assert area.name == "Long?[31m Lake?"
    assert area.notes == ("used the only polygon; ignored 1 point",)


# --- unreadable -----------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("content", "words"),
    [
        (b"", "the file is empty"),
        (b"  \n", "the file is blank"),
        (b"{", "the file ends in the middle"),
        (b"12", "the top level is a number"),
        (b"true", "the top level is true"),
        (b"{}", 'an object without "type"'),
        (b'{"type": {"a": 1}}', '"type" is'),
        (b'{"type": "polygon", "coordinates": []}', '"type" is "polygon"'),
        (b'{"type": "FeatureCollection"}', 'no list "features"'),
        (b'{"type": "FeatureCollection", "features": [3]}', "feature 1 must be an object"),
        (b'{"type": "Feature", "geometry": 3}', "a geometry must be an object"),
        (b'{"type": "Polygon", "coordinates": 7}', "found a number"),
        (b'{"type": "Polygon", "coordinates": [[[0]]]}', "position must be a list of two numbers"),
        (b'{"type": "Polygon", "coordinates": [[[0,0],[1e999,0]]]}', "finite number"),
        (b'{"type": "Polygon", "coordinates": [[[0,0],[500000,4e6]]]}', "looks like metres"),
        (b'{"type": "Polygon", "coordinates": [[[0,0],[1,1]]]}', "2 distinct position"),
        (b'{"type": "Polygon", "coordinates": [[], [[0,0],[1,0],[1,1]]]}', "outer ring is empty"),
        (b"\xff\xfe{\xd8\x00\xd8", "is not"),
        (b"\x89PNG\r\n\x1a\n", "--resolution"),
        (b"PK\x03\x04 broken", "damaged zip"),
        (b"SQLite format 3\0 broken", "SQLite database"),
        (b"POLYGON ((0 0, 1 0, 1 1, 0 0))", "this is WKT"),
        (b"QGC WPL 110\n", "waypoint list"),
        (b"<gpx></gpx>", "this is GPX"),
        (b"hello", "not valid JSON at line 1 column 1"),
        (b"\x1e{}\n", "text sequence"),
    ],
)  # fmt: skip
def test_refused_in_one_line(tmp_path: Path, content: bytes, words: str) -> None:
    path = tmp_path / "lake.geojson"
    path.write_bytes(content)
    with pytest.raises(InputError) as caught:
        read_survey_area(path)
    text = str(caught.value)
    assert words in text
    assert text.startswith(f"{path}: ")
    assert text.isprintable()


def test_missing_file_and_directory(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="no such file"):
        read_survey_area(tmp_path / "none.geojson")
    with pytest.raises(InputError, match="is a directory"):
        read_survey_area(tmp_path)
    with pytest.raises(InputError, match="cannot be read"):
        read_survey_area(Path("a\0b"))


# --- writing --------------------------------------------------------------------------------------


def test_written_area_reads_back(tmp_path: Path) -> None:
    other = box(-81.28, 34.06, -81.27, 34.07)
    document = {"type": "MultiPolygon", "coordinates": [[LAKE, ISLAND[::-1]], [other[::-1]]]}
    area = read_survey_area(write(tmp_path, document))
    text = free_area_geojson(area)
    assert text == free_area_geojson(area)
    again = read_survey_area(write(tmp_path, text, "again.geojson"))
    assert again.name == area.name
    assert again.water_lonlat.symmetric_difference(area.water_lonlat).area < 1e-15
    for part in again.water_lonlat.geoms:
        assert part.exterior.is_ccw
        assert not any(ring.is_ccw for ring in part.interiors)

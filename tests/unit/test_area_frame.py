"""The local frame against the geodesics of pyproj."""

from __future__ import annotations

import numpy as np
import pytest
import shapely
from pyproj import Geod, Transformer

from mrmission.area.frame import LocalFrame, error_within_m, project_polygons, reach_m
from mrmission.model import SurveyArea

GEOD = Geod(ellps="WGS84")


def area(polygon: shapely.Geometry) -> SurveyArea:
    return SurveyArea(name="a", source="a", water_lonlat=shapely.MultiPolygon([polygon]))


def excess(frame: LocalFrame, a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """Length in the frame less the length of the geodesic."""
    p, q = frame.to_lonlat(a), frame.to_lonlat(b)
    true = GEOD.inv(p[:, 0], p[:, 1], q[:, 0], q[:, 1])[2]
    return np.hypot(*(b - a).T) - np.asarray(true)


@pytest.mark.parametrize("lat", [0.0, 34.0, -46.0, 69.0, 84.0])
def test_error_stays_below_a_centimetre_over_twenty_kilometres(lat: float) -> None:
    frame = LocalFrame(lon_deg=10.0, lat_deg=lat)
    rng = np.random.default_rng(1)
    angle = rng.uniform(0, 2 * np.pi, (2, 20_000))
    radius = 10_000 * np.sqrt(rng.uniform(0, 1, (2, 20_000)))
    a, b = (
        np.column_stack([r * np.cos(t), r * np.sin(t)]) for r, t in zip(radius, angle, strict=True)
    )
    found = excess(frame, a, b)
    assert found.min() > -1e-6
    assert found.max() < error_within_m(10_000) < 0.01


@pytest.mark.parametrize("radius", [10_000.0, 14_500.0, 50_000.0, 500_000.0])
@pytest.mark.parametrize("lat", [0.0, 45.0, 80.0])
def test_worst_chord_nearly_reaches_the_bound(radius: float, lat: float) -> None:
    frame = LocalFrame(lon_deg=0.0, lat_deg=lat)
    h = radius * np.sqrt(2 / 3)
    half = np.sqrt(radius**2 - h**2)
    turn = np.linspace(0, 2 * np.pi, 73)
    along = np.column_stack([np.cos(turn), np.sin(turn)])
    across = np.column_stack([-np.sin(turn), np.cos(turn)])
    found = excess(frame, h * across - half * along, h * across + half * along)
    bound = error_within_m(radius)
    assert found.max() <= bound
    # a bound that is far too large would be of no use
    assert found.max() > 0.9 * bound
    if radius <= 14_500:
        assert bound < 0.01


def test_distances_from_the_centre_are_exact_and_round_trips_too() -> None:
    frame = LocalFrame(lon_deg=-81.3, lat_deg=34.06)
    points = np.array([[0.0, 0.0], [12_000.0, -5_000.0], [-30_000.0, 44_000.0]])
    lonlat = frame.to_lonlat(points)
    n = len(points)
    true = GEOD.inv([-81.3] * n, [34.06] * n, lonlat[:, 0], lonlat[:, 1])[2]
    assert np.hypot(*points.T) == pytest.approx(true, abs=1e-6)
    assert frame.to_metric(lonlat) == pytest.approx(points, abs=1e-6)
    assert frame.to_metric(lonlat[1]).shape == (2,)


def test_longitudes_stay_continuous_across_the_180_meridian() -> None:
    water = shapely.box(179.99, -16.9, 180.01, -16.89)
    frame = LocalFrame.of(area(water))
    metric = project_polygons(shapely.MultiPolygon([water]), frame)
    assert metric.bounds[2] - metric.bounds[0] == pytest.approx(2131, abs=5)
    lon = frame.to_lonlat(shapely.get_coordinates(metric))[:, 0]
    assert lon.min() == pytest.approx(179.99)
    assert lon.max() == pytest.approx(180.01)


def test_same_coordinates_as_the_authority_string() -> None:
    frame = LocalFrame(lon_deg=25.0, lat_deg=61.0)
    other = Transformer.from_crs("EPSG:4326", frame.proj, always_xy=True)
    lonlat = np.array([[25.1, 61.05], [24.7, 60.8]])
    east, north = other.transform(lonlat[:, 0], lonlat[:, 1])
    assert frame.to_metric(lonlat) == pytest.approx(np.column_stack([east, north]), abs=1e-9)


def test_long_edges_stay_straight_in_lonlat() -> None:
    water = shapely.box(25.0, 61.0, 25.3, 61.1)  # 16 km wide
    frame = LocalFrame.of(area(water))
    metric = project_polygons(shapely.MultiPolygon([water]), frame)
    lon = np.linspace(25.0, 25.3, 1001)
    south = frame.to_metric(np.column_stack([lon, np.full_like(lon, 61.0)]))
    assert shapely.distance(metric.boundary, shapely.points(south)).max() < 0.002
    # without subdivision the edge would cut a metre off
    chord = shapely.LineString(south[[0, -1]])
    assert shapely.distance(chord, shapely.points(south)).max() > 1


def test_a_large_area_says_so() -> None:
    small = project_polygons(
        shapely.MultiPolygon([shapely.box(0, 0, 0.1, 0.1)]), LocalFrame(lon_deg=0.05, lat_deg=0.05)
    )
    frame = LocalFrame(lon_deg=0.5, lat_deg=0.5)
    large = project_polygons(shapely.MultiPolygon([shapely.box(0, 0, 1, 1)]), frame)
    assert frame.error_note(small) is None
    assert "from its centre" in (frame.error_note(large) or "")
    assert reach_m(large) == pytest.approx(78_600, rel=0.01)
    assert error_within_m(2e7) == np.inf


def test_frame_of_a_real_lake_is_that_of_the_score_script(shared_data) -> None:
    from pathlib import Path

    from mrmission.area.geojson import read_survey_area

    path: Path = shared_data / "lakes" / "chiemsee_de.geojson"
    lake = read_survey_area(path)
    raw = shapely.from_geojson(path.read_text())
    raw = raw.geoms[0] if raw.geom_type == "GeometryCollection" else raw
    frame = LocalFrame.of(lake)
    assert frame.lon_deg == pytest.approx(raw.centroid.x, abs=1e-12)
    assert frame.lat_deg == pytest.approx(raw.centroid.y, abs=1e-12)


def test_water_is_that_of_the_score_script(shared_data, score_script) -> None:
    import importlib.util

    from mrmission.area.geojson import read_survey_area

    spec = importlib.util.spec_from_file_location("score_missions", score_script)
    assert spec is not None
    assert spec.loader is not None
    script = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(script)
    for name in ("lake_murray_sc", "chukotka_178w", "somino_ru"):
        path = shared_data / "lakes" / f"{name}.geojson"
        area = read_survey_area(path)
        frame = LocalFrame.of(area)
        ours = project_polygons(area.water_lonlat, frame)
        raw = script.load_area(path)
        to_metres = Transformer.from_crs(
            "EPSG:4326",
            f"+proj=aeqd +lat_0={raw.centroid.y} +lon_0={raw.centroid.x} +datum=WGS84",
            always_xy=True,
        )
        theirs = shapely.transform(
            shapely.segmentize(raw, 200 / 111_320),
            lambda c, t=to_metres: np.column_stack(t.transform(c[:, 0], c[:, 1])),
        )
        points, expected = shapely.get_coordinates(ours), shapely.get_coordinates(theirs)
        assert np.abs(points - expected).max() < 1e-6
        assert ours.area == pytest.approx(theirs.area, rel=1e-12)

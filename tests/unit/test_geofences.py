"""Every area in geofences/ is what its properties and the README say."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path

import numpy as np
import pyproj
import pytest
import shapely
from PIL import Image

FOLDER = Path(__file__).resolve().parents[2] / "geofences"
AREAS = sorted(FOLDER.glob("*.geojson"))
TEXTS = {
    "CC0-1.0": "CC0 1.0 Universal",
    "ODbL-1.0": "Open Database License (ODbL)",
    "LGPL-3.0-or-later": "GNU LESSER GENERAL PUBLIC LICENSE",
}


def test_there_are_enough_areas():
    assert len(AREAS) >= 5
    assert FOLDER.joinpath("lake_murray.geojson") in AREAS


@pytest.mark.parametrize("path", AREAS, ids=lambda path: path.stem)
def test_feature_is_rfc_7946(path):
    feature = json.loads(path.read_text(encoding="utf-8"))
    assert feature["type"] == "Feature"
    assert "crs" not in feature
    geometry = feature["geometry"]
    assert geometry["type"] == "Polygon"
    for number, ring in enumerate(geometry["coordinates"]):
        assert len(ring) >= 4
        assert ring[0] == ring[-1]
        assert all(len(position) == 2 for position in ring)
        assert all(abs(lon) <= 180 and abs(lat) <= 90 for lon, lat in ring)
        assert np.all(np.any(np.diff(np.array(ring), axis=0) != 0, axis=1)), "doubled vertex"
        # Right-hand rule: exterior counter-clockwise, islands clockwise.
        assert shapely.is_ccw(shapely.linearrings(ring)) == (number == 0)
    polygon = shapely.geometry.shape(geometry)
    assert polygon.is_valid


@pytest.mark.parametrize("path", AREAS, ids=lambda path: path.stem)
def test_properties_are_true(path):
    feature = json.loads(path.read_text(encoding="utf-8"))
    properties = feature["properties"]
    polygon = shapely.geometry.shape(feature["geometry"])
    assert properties["name"]
    assert properties["source"]
    area_m2, _ = pyproj.Geod(ellps="WGS84").geometry_area_perimeter(polygon)
    assert properties["area_km2"] == pytest.approx(abs(area_m2) / 1e6, rel=1e-3)
    assert properties["islands"] == len(polygon.interiors)
    text = FOLDER.joinpath(properties["licence_file"]).read_text(encoding="utf-8")
    assert TEXTS[properties["licence"]] in text
    readme = FOLDER.joinpath("README.md").read_text(encoding="utf-8")
    assert f"`{path.name}`" in readme


def test_gpl_lies_beside_the_lgpl():
    text = FOLDER.joinpath("LICENSE.GPL-3.txt").read_text(encoding="utf-8")
    assert "GNU GENERAL PUBLIC LICENSE" in text


def test_small_lake_with_islands_is_there():
    small = [json.loads(path.read_text(encoding="utf-8"))["properties"] for path in AREAS]
    assert any(0.1 <= p["area_km2"] <= 2 and p["islands"] >= 3 for p in small)


def test_image_is_binary_with_obstacles():
    image = grey(FOLDER / "quarry.png")
    assert image.shape == (300, 400)
    assert set(np.unique(image)) == {0, 255}
    free_m2 = int((image == 255).sum())
    assert free_m2 == pytest.approx(0.07e6, rel=0.1)
    # Islands, counted without the program: black components that do not touch the rim.
    assert _components(image == 0) - 1 == 6
    assert _components(image == 255) == 1


def grey(path):
    with Image.open(path) as image:
        return np.asarray(image.convert("L"))


def _components(mask):
    left = {(int(r), int(c)) for r, c in np.argwhere(mask)}
    found = 0
    while left:
        found += 1
        stack = [left.pop()]
        while stack:
            row, column = stack.pop()
            for step in ((0, 1), (1, 0), (0, -1), (-1, 0)):
                place = (row + step[0], column + step[1])
                if place in left:
                    left.remove(place)
                    stack.append(place)
    return found


def test_drawings_are_reproducible(tmp_path):
    sources = tmp_path / "sources"
    sources.mkdir()
    sources.joinpath("draw.py").write_bytes(FOLDER.joinpath("sources/draw.py").read_bytes())
    subprocess.run([sys.executable, sources / "draw.py"], check=True)
    for name in ("demo_lake.geojson", "harbour.geojson"):
        drawn = json.loads((tmp_path / name).read_text(encoding="utf-8"))
        kept = json.loads((FOLDER / name).read_text(encoding="utf-8"))
        # Another platform's libm may differ in the last of seven decimals.
        for ring, other in zip(
            drawn["geometry"]["coordinates"], kept["geometry"]["coordinates"], strict=True
        ):
            assert np.allclose(ring, other, atol=2e-7, rtol=0)
    assert np.mean(grey(tmp_path / "quarry.png") != grey(FOLDER / "quarry.png")) < 1e-3

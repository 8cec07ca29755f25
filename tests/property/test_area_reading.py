"""Whatever stands in a file: an area with valid water, or one clear line; land never shrinks."""

from __future__ import annotations

import json
import tempfile
from pathlib import Path
from typing import Any

import numpy as np
import shapely
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from mrmission.area.geojson import read_survey_area
from mrmission.area.repair import OBSTACLE_RADIUS_M
from mrmission.errors import InputError

QUICK = settings(max_examples=60, deadline=None, derandomize=True,
                 suppress_health_check=[HealthCheck.too_slow])  # fmt: skip

SHELL = [[0, 0], [0.01, 0], [0.01, 0.01], [0, 0.01], [0, 0]]

scalars = st.one_of(
    st.none(), st.booleans(), st.integers(), st.floats(), st.text(max_size=5),
    st.sampled_from(["Polygon", "Feature", "FeatureCollection", "MultiPolygon", "Point"]),
)  # fmt: skip
keys = st.sampled_from(["type", "coordinates", "geometry", "features", "geometries", "crs",
                        "properties", "name", "fileType", "geoFence"])  # fmt: skip
anything = st.recursive(
    scalars,
    lambda inner: st.lists(inner, max_size=4) | st.dictionaries(keys, inner, max_size=4),
    max_leaves=12,
)


def read(data: bytes) -> Any:
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "lake.geojson"
        path.write_bytes(data)
        try:
            area = read_survey_area(path)
        except InputError as error:
            message = str(error)
        else:
            message = ""
    if message:
        assert "\n" not in message
        assert message.startswith(str(path))
        return None
    assert isinstance(area.water_lonlat, shapely.MultiPolygon)
    assert area.water_lonlat.is_valid
    assert area.water_lonlat.area > 0
    return area


@QUICK
@given(st.binary(max_size=60))
def test_any_bytes(data: bytes) -> None:
    read(data)


@QUICK
@given(anything)
def test_any_json(document: Any) -> None:
    read(json.dumps(document).encode())


@QUICK
@given(st.data())
def test_any_damage_to_a_good_file(data: st.DataObject) -> None:
    hole = [[0.004, 0.004], [0.006, 0.004], [0.006, 0.006], [0.004, 0.004]]
    document: dict[str, Any] = {
        "type": "FeatureCollection",
        "features": [
            {"type": "Feature", "properties": {"name": "x"},
             "geometry": {"type": "Polygon", "coordinates": [[*SHELL], hole]}},
            {"type": "Feature", "properties": None,
             "geometry": {"type": "MultiPolygon", "coordinates": [[[[1, 1], [2, 1], [2, 2]]]]}},
        ],
    }  # fmt: skip
    place: Any = document
    while True:
        options = list(place) if isinstance(place, dict) else list(range(len(place)))
        key = data.draw(st.sampled_from(options))
        if isinstance(place[key], (dict, list)) and place[key] and data.draw(st.integers(0, 4)):
            place = place[key]
            continue
        place[key] = data.draw(anything)
        break
    read(json.dumps(document).encode())


grid = st.integers(0, 12)
rings = st.lists(st.tuples(grid, grid), min_size=1, max_size=8)


@QUICK
@given(st.lists(rings, min_size=1, max_size=4))
def test_no_island_is_lost(islands: list[list[tuple[int, int]]]) -> None:
    """What any reading of an island ring encloses is no water, nor what its line covers."""
    holes = [[[x * 1e-3 - 1e-3, y * 1e-3 - 1e-3] for x, y in ring] for ring in islands]
    document = {"type": "Polygon", "coordinates": [SHELL, *[[*ring, ring[0]] for ring in holes]]}
    area = read(json.dumps(document).encode())
    if area is None:
        return
    for ring in holes:
        if len(ring) > 2:
            land = shapely.make_valid(shapely.Polygon(ring))
            assert area.water_lonlat.intersection(land).area < 1e-15
        distinct = np.unique(ring, axis=0)
        inner = distinct[((distinct > 0) & (distinct < 0.01)).all(axis=1)]
        distance = shapely.distance(area.water_lonlat, shapely.points(inner))
        interior = shapely.contains_properly(area.water_lonlat, shapely.points(inner))
        assert not interior.any()
        if len(distinct) < 3 and len(inner):
            assert distance.min() * 111_320 >= OBSTACLE_RADIUS_M * 0.99


@QUICK
@given(rings)
def test_repaired_shore_encloses_no_more_than_drawn(ring: list[tuple[int, int]]) -> None:
    shore = [[x * 1e-3, y * 1e-3] for x, y in [*ring, ring[0]]]
    area = read(json.dumps({"type": "Polygon", "coordinates": [shore]}).encode())
    if area is None or len(set(ring)) < 3:
        return
    # samples off every lattice line; a ray to the east crosses the ring an odd number of times
    steps = np.arange(48) / 4 + 0.1237
    x, y = (c.ravel() * 1e-3 for c in np.meshgrid(steps, steps + 0.0151))
    (x0, y0), (x1, y1) = np.array(shore[:-1]).T[:, :, None], np.array(shore[1:]).T[:, :, None]
    with np.errstate(divide="ignore", invalid="ignore"):
        hits = ((y0 > y) != (y1 > y)) & (x < x0 + (y - y0) / (y1 - y0) * (x1 - x0))
    odd = hits.sum(axis=0) % 2 == 1
    wet = shapely.contains_xy(area.water_lonlat, x, y)
    assert not (wet & ~odd).any()
    # what is enclosed once is water, but for the slips that were removed
    assert (odd & ~wet).sum() <= 0.02 * odd.sum() + 1 or "removed" in " ".join(area.notes)

"""The navigable region, its parts, and starts."""

from __future__ import annotations

import numpy as np
import pytest
import shapely

from mrmission.area.frame import LocalFrame
from mrmission.area.region import (
    default_start,
    navigable_region,
    part_of,
    parts_by_size,
    snap_start,
)
from mrmission.errors import GeometryError

FRAME = LocalFrame(lon_deg=-81.3, lat_deg=34.06)
LAKE = shapely.box(0, 0, 400, 300).difference(shapely.box(150, 100, 200, 180))


def multi(*parts: shapely.Polygon) -> shapely.MultiPolygon:
    return shapely.MultiPolygon(list(parts))


@pytest.mark.parametrize("clearance", [0.0, 2.0, 10.0])
def test_region_is_the_eroded_water(clearance: float) -> None:
    region = navigable_region(multi(LAKE), clearance)
    exact = LAKE.buffer(-clearance) if clearance else LAKE
    assert shapely.hausdorff_distance(region.boundary, exact.boundary) <= 0.0101
    assert region.difference(exact.buffer(0.0101)).area == 0
    # the distance that is kept to the shore is the clearance, less a centimetre and the arcs
    if clearance:
        assert region.distance(LAKE.boundary) >= clearance * (1 - 0.0013) - 0.01


def test_parts_without_area_are_dropped_and_the_largest_is_first() -> None:
    neck = shapely.union_all(
        [shapely.box(0, 0, 50, 50), shapely.box(50, 20, 80, 24), shapely.box(80, 0, 200, 100)]
    )
    region = navigable_region(multi(neck), 5.0)
    # the mouths of the neck add a sliver each
    assert [part.area for part in region.geoms] == pytest.approx([110 * 90, 40 * 40], rel=2e-3)
    assert navigable_region(multi(neck), 80.0).is_empty
    assert navigable_region(multi(neck), 25.0).geoms[0].area == pytest.approx(70 * 50, rel=1e-3)


def test_collinear_points_of_long_edges_are_left_out() -> None:
    fine = shapely.segmentize(LAKE, 10.0)
    assert len(shapely.get_coordinates(navigable_region(multi(fine), 0.0))) == 10


def test_part_of() -> None:
    parts = parts_by_size(multi(shapely.box(0, 0, 1, 1), shapely.box(5, 0, 9, 4)))
    assert [part.area for part in parts] == [16, 1]
    assert part_of(parts, np.array([0.5, 0.5])) == 1
    assert part_of(parts, np.array([4.0, 0.5])) == 0


def test_start_on_land_is_moved_or_refused() -> None:
    region = navigable_region(multi(LAKE), 10.0)
    point, note = snap_start(region, np.array([100.0, 50.0]), FRAME)
    assert (point == [100, 50]).all()
    assert note is None
    point, note = snap_start(region, np.array([100.0, -30.0]), FRAME)
    assert point == pytest.approx([100, 10])
    assert "moved 40 m to -81.2989" in (note or "")
    with pytest.raises(GeometryError, match=r"is 60 m from the navigable water.* at -81\.2989"):
        snap_start(region, np.array([100.0, -50.0]), FRAME)


def test_a_start_with_latitude_first_is_told_so() -> None:
    region = navigable_region(multi(LAKE), 10.0)
    lon, lat = FRAME.to_lonlat(np.array([[100.0, 50.0]]))[0]
    swapped = FRAME.to_metric(np.array([[lat, lon]]))[0]
    with pytest.raises(GeometryError, match=r"longitude comes first: is it -81\.29.*,34\."):
        snap_start(region, swapped, FRAME)


def test_default_start_is_at_the_shore_and_depends_on_the_water_alone() -> None:
    start = default_start(LAKE)
    assert LAKE.exterior.distance(shapely.Point(start)) < 1e-9
    # on the island's side of the lake there is no outer border: the nearest shore to the centroid
    assert start[1] in (0.0, 300.0)
    assert 150 < start[0] < 250
    ring = shapely.get_coordinates(LAKE.exterior)[:-1]
    for turned in (np.roll(ring, 2, axis=0), ring[::-1]):
        again = shapely.Polygon(turned, [hole.coords for hole in LAKE.interiors])
        assert (default_start(again) == start).all()


def test_default_start_avoids_a_narrow_creek() -> None:
    creek = shapely.union_all([shapely.box(0, 0, 300, 300), shapely.box(148, -800, 152, 0)])
    start = default_start(creek)
    assert start[1] > -5


@pytest.mark.parametrize("size", [0.5, 4.0, 30.0])
def test_default_start_on_small_waters(size: float) -> None:
    part = shapely.box(0, 0, size, size)
    assert part.distance(shapely.Point(default_start(part))) < 1e-9

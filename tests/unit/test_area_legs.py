"""Subdivided legs against dense geodesics."""

from __future__ import annotations

import itertools

import numpy as np
import pytest
import shapely
from pyproj import Geod

from mrmission.area.frame import LocalFrame
from mrmission.area.legs import subdivide_legs
from mrmission.errors import GeometryError

GEOD = Geod(ellps="WGS84")


def worst_departure_m(points: np.ndarray, frame: LocalFrame) -> float:
    """Largest distance between the three readings of each leg, by brute force."""
    worst = 0.0
    lonlat = frame.to_lonlat(points)
    for (a, b), (p, q) in zip(
        itertools.pairwise(points),
        itertools.pairwise(lonlat),
        strict=True,
    ):
        t = np.linspace(0, 1, 65)[:, None]
        in_frame = frame.to_lonlat(a + t * (b - a))
        in_lonlat = p + t * (q - p)
        inner = np.array(GEOD.npts(p[0], p[1], q[0], q[1], 63))
        inner[:, 0] += 360 * np.round((p[0] - inner[:, 0]) / 360)
        geodesic = np.vstack([p, inner, q])
        here = LocalFrame(lon_deg=float((p + q)[0] / 2), lat_deg=float((p + q)[1] / 2))
        curves = [shapely.LineString(here.to_metric(c)) for c in (in_frame, in_lonlat, geodesic)]
        for i in range(3):
            for j in range(i):
                worst = max(worst, shapely.hausdorff_distance(curves[i], curves[j]))
    return worst


@pytest.mark.parametrize("lat", [0.0, 1.0, 20.0, 45.0, 60.0, 70.0, 80.0])
@pytest.mark.parametrize("tolerance", [0.1, 1.0])
def test_all_readings_agree(lat: float, tolerance: float) -> None:
    frame = LocalFrame(lon_deg=179.9, lat_deg=lat)
    rng = np.random.default_rng(int(lat))
    points = rng.uniform(-15_000, 15_000, (7, 2))
    points[3] = points[2] + (20_000, 0.0)
    cut, source = subdivide_legs(points, frame, tolerance)
    assert worst_departure_m(cut, frame) <= tolerance
    assert len(source) == len(cut) - 1
    # given points keep their bits, in their order
    first = np.searchsorted(source, np.arange(len(points) - 1))
    assert (cut[np.append(first, len(cut) - 1)] == points).all()
    # inserted points lie on the leg
    for i, leg in enumerate(source):
        line = shapely.LineString(points[leg : leg + 2])
        assert line.distance(shapely.Point(cut[i])) < 1e-6


@pytest.mark.parametrize("lat", [30.0, 60.0, 80.0])
def test_not_cut_finer_than_needed(lat: float) -> None:
    frame = LocalFrame(lon_deg=0.0, lat_deg=lat)
    points = np.array([[-10_000.0, 0.0], [10_000.0, 0.0]])
    _, source = subdivide_legs(points, frame)
    halves = max(1, len(source) // 2)
    coarse = np.linspace(points[0], points[1], halves + 1)
    assert worst_departure_m(coarse, frame) > 0.1


def test_far_from_the_centre() -> None:
    frame = LocalFrame(lon_deg=0.0, lat_deg=0.0)
    points = np.array([[300_000.0, -50_000.0], [300_000.0, 50_000.0], [250_000.0, 300_000.0]])
    cut, _ = subdivide_legs(points, frame)
    assert worst_departure_m(cut, frame) <= 0.1


def test_short_legs_stay() -> None:
    frame = LocalFrame(lon_deg=0.0, lat_deg=60.0)
    points = np.array([[0.0, 0.0], [500.0, 0.0], [500.0, 0.0], [500.0, 500.0]])
    cut, source = subdivide_legs(points, frame)
    assert (cut == points).all()
    assert source.tolist() == [0, 1, 2]
    assert subdivide_legs(points[:1], frame)[1].shape == (0,)


def test_pole_is_refused() -> None:
    frame = LocalFrame(lon_deg=0.0, lat_deg=84.0)
    with pytest.raises(GeometryError, match="latitude"):
        subdivide_legs(np.array([[0.0, 0.0], [0.0, 700_000.0]]), frame)

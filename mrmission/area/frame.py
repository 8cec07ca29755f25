r"""The local metric frame: azimuthal equidistant on WGS 84, centred on the survey area.

Error
-----
Distances from the centre are exact. Across the radius, at a distance :math:`c` from the centre,
the projection stretches by :math:`k(c) = c / (R \sin(c/R))`, never more than with the smallest
Gaussian radius of the ellipsoid, its semi-minor axis (Rauch's comparison theorem). A straight
segment of length :math:`L` whose line passes the centre at a distance :math:`h` lies across the
radius by the angle :math:`\varphi` with :math:`\sin\varphi = h/\rho` at radius :math:`\rho`, so
it is too long by :math:`(k-1)\sin^2\varphi \approx h^2/6R^2` per metre, the same all along:
:math:`L h^2 / 6 R^2`. In a disc of radius :math:`c` the worst segment is the chord at
:math:`h^2 = 2c^2/3`, so the error is at most :math:`2c^3 / (9\sqrt{3} R^2)`: 3.2 mm for a lake 20
km wide about its centre, below 1 cm up to 14.6 km from the centre.

References
----------
J. P. Snyder, Map Projections: A Working Manual, USGS Professional Paper 1395, 1987, chapter 25.
"""

from __future__ import annotations

import functools
import math
from dataclasses import dataclass
from typing import Any

import numpy as np
import shapely

from mrmission.area.earth import SEMI_MINOR_M
from mrmission.area.rings import length_text
from mrmission.model import FloatArray, SurveyArea

STRAIGHT_EDGE_DEG = 200 / 111_320
"""Longer edges are subdivided before projection, so that lines straight in lon/lat stay so."""

TARGET_ERROR_M = 0.01


@functools.lru_cache(maxsize=8)
def _transformer(lon_deg: float, lat_deg: float) -> Any:
    # importing pyproj costs 0.1 s, and only planning needs it
    from pyproj import Transformer

    # spelled as a pipeline: the database of coordinate systems need not be opened
    return Transformer.from_pipeline(
        "+proj=pipeline +step +proj=unitconvert +xy_in=deg +xy_out=rad "
        f"+step +proj=aeqd +lat_0={lat_deg!r} +lon_0={lon_deg!r} +datum=WGS84"
    )


@dataclass(frozen=True, slots=True, kw_only=True)
class LocalFrame:
    """Azimuthal equidistant projection about a centre, WGS 84: metres east and north.

    Parameters
    ----------
    lon_deg, lat_deg : float
        The centre, degrees. The longitude may leave ±180 as those of the area may.
    """

    lon_deg: float
    lat_deg: float

    @classmethod
    def of(cls, area: SurveyArea) -> LocalFrame:
        """Return the frame of a survey area: centred on the centroid of its lon/lat polygons."""
        return cls.of_lonlat(area.water_lonlat)

    @classmethod
    def of_lonlat(cls, geometry_lonlat: shapely.Geometry) -> LocalFrame:
        """Return the frame centred on the centroid of a lon/lat geometry."""
        centre = geometry_lonlat.centroid
        return cls(lon_deg=float(centre.x), lat_deg=float(centre.y))

    @property
    def proj(self) -> str:
        """The PROJ string of the frame."""
        return f"+proj=aeqd +lat_0={self.lat_deg!r} +lon_0={self.lon_deg!r} +datum=WGS84 +units=m"

    def to_metric(self, lonlat: FloatArray) -> FloatArray:
        """Project positions.

        Parameters
        ----------
        lonlat : (n, 2) float array
            Longitude, latitude, degrees; also one position of shape (2,).

        Returns
        -------
        (n, 2) float array
            East, north, m.
        """
        given = np.asarray(lonlat, dtype=np.float64)
        flat = given.reshape(-1, 2)
        east, north = _transformer(self.lon_deg, self.lat_deg).transform(flat[:, 0], flat[:, 1])
        return np.column_stack([east, north]).reshape(given.shape)

    def to_lonlat(self, points_m: FloatArray) -> FloatArray:
        """Return the longitudes and latitudes of points, continuous about the centre.

        Parameters
        ----------
        points_m : (n, 2) float array
            East, north, m; also one point of shape (2,).

        Returns
        -------
        (n, 2) float array
            Longitude, latitude, degrees.
        """
        given = np.asarray(points_m, dtype=np.float64)
        flat = given.reshape(-1, 2)
        lon, lat = _transformer(self.lon_deg, self.lat_deg).transform(
            flat[:, 0], flat[:, 1], direction="INVERSE"
        )
        lon = lon + 360.0 * np.round((self.lon_deg - lon) / 360.0)
        return np.column_stack([lon, lat]).reshape(given.shape)

    def project(self, geometry_lonlat: shapely.Geometry) -> shapely.Geometry:
        """Project a lon/lat geometry whose edges are straight in lon/lat.

        Edges longer than 200 m are subdivided first: a chord of that length departs from the
        straight lon/lat line by millimetres.
        """
        return shapely.transform(
            shapely.segmentize(geometry_lonlat, STRAIGHT_EDGE_DEG), self.to_metric
        )

    def error_m(self, geometry_m: shapely.Geometry) -> float:
        """Return a bound on the error of any distance within a geometry of this frame, m.

        Distances in the frame are never too short, and too long by no more than this. See the
        module's docstring for the derivation.
        """
        return error_within_m(reach_m(geometry_m))

    def error_note(self, geometry_m: shapely.Geometry) -> str | None:
        """Return a note where the area is too large for an error below 1 cm, else None."""
        error = self.error_m(geometry_m)
        if error <= TARGET_ERROR_M:
            return None
        return (
            f"the area reaches {length_text(reach_m(geometry_m))} from its centre: distances in "
            f"the local frame are up to {error:.2g} m too long (1 cm is kept up to 14.5 km)"
        )


def reach_m(geometry_m: shapely.Geometry) -> float:
    """Return the distance of the farthest vertex from the origin, m."""
    points = shapely.get_coordinates(geometry_m)
    return float(np.hypot(points[:, 0], points[:, 1]).max()) if len(points) else 0.0


def error_within_m(radius_m: float) -> float:
    """Return a bound on the error of any distance between points within a radius of the centre.

    Parameters
    ----------
    radius_m : float
        Distance from the centre, m; the bound is meant for up to 1,000 km.

    Returns
    -------
    float
        Metres. Infinite beyond a quarter of the globe.
    """
    angle = radius_m / SEMI_MINOR_M
    if angle >= math.pi / 2:
        return math.inf
    first = 2 * radius_m * angle**2 / (9 * math.sqrt(3))
    # terms of the next order in c/R; 1e-6 m for the numerics of the projection
    return first * (1 + 2 * angle**2) + 1e-6


def project_polygons(water_lonlat: shapely.MultiPolygon, frame: LocalFrame) -> shapely.MultiPolygon:
    """Project the water of a survey area into the frame, valid.

    Parameters
    ----------
    water_lonlat : MultiPolygon
        Degrees; edges straight in lon/lat.
    frame : LocalFrame
        The frame.

    Returns
    -------
    MultiPolygon
        Metres, parts in the order given.
    """
    projected = frame.project(water_lonlat)
    if not projected.is_valid:
        projected = shapely.make_valid(projected)
    return shapely.MultiPolygon(
        [
            part
            for group in shapely.get_parts(projected)
            for part in shapely.get_parts(group)
            if isinstance(part, shapely.Polygon) and part.area > 0
        ]
    )

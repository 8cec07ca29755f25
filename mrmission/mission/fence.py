"""Fence polygons of one vehicle: fitted where fence edges are straight, rounded, then checked."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Protocol

import numpy as np
import shapely

from mrmission.errors import InfeasibleError
from mrmission.mission import mavlink
from mrmission.mission.check import check_fence
from mrmission.mission.fence_rings import PLACE_M2, RingFit, fit_hull, fit_rings
from mrmission.mission.mavlink import wrap_lon_deg
from mrmission.model import FencePolygon, FloatArray, IntArray, read_only
from mrmission.options import VehicleLimits

WGS84_A_M = 6_378_137.0
WGS84_E2 = 6.694379990141316e-3
PLACES_NAMED = 3


class Frame(Protocol):
    """What the fence needs of a local frame."""

    def to_lonlat(self, points_m: FloatArray) -> FloatArray:
        """Return (n, 2) degrees [lon, lat] of (n, 2) metres [east, north]."""


@dataclass(frozen=True, slots=True, kw_only=True)
class FenceFit:
    """A vehicle's fence and what it cost.

    ``land_m2`` is the land inside the fence, left-out islands included. ``land_places`` and
    ``islands_left_out`` are (area in m², lon, lat), largest and nearest to the path first.
    ``notes`` say the same to a person, and nothing where nothing was lost.
    """

    polygons: tuple[FencePolygon, ...]
    land_m2: float
    land_places: tuple[tuple[float, float, float], ...]
    islands_left_out: tuple[tuple[float, float, float], ...]
    points: int
    bytes_used: int
    notes: tuple[str, ...]


def fit_fence(
    water_m: shapely.Polygon,
    path_m: Sequence[FloatArray | shapely.Geometry],
    margin_m: float,
    limits: VehicleLimits,
    *,
    keep: Sequence[shapely.Geometry] = (),
    frame: Frame,
) -> FenceFit:
    """Fit fence polygons around a path: shore outside, islands out, within the vehicle's budget.

    The fit takes place in longitude and latitude times constants, because that is where fence edges
    and legs are straight lines; the polygons are then rounded to 1e-7 degrees and checked exactly.
    What is guaranteed is said at :func:`mrmission.mission.fence_rings.fit_rings`.

    Parameters
    ----------
    water_m
        The part of the survey area that the vehicle is in, with islands as holes.
    path_m
        (n, 2) arrays, lines or points that stay inside by the margin.
    margin_m
        Distance that the path keeps from the fence where the shore leaves room, m.
    limits
        The vehicle's fence store.
    keep
        Polygons (the launch circle, clipped to the water) that stay inside without a margin.
    frame
        Of all the geometry.

    Returns
    -------
    FenceFit

    Raises
    ------
    InfeasibleError
        When not even the simplest fence around the path fits.
    """
    lines = [
        g if isinstance(g, shapely.Geometry) else _line(np.asarray(g, dtype=float)) for g in path_m
    ]
    given = [g for g in (*lines, *keep) if not shapely.is_empty(g)]
    if not given:
        raise InfeasibleError("a fence needs a path or a launch place to go around; found none")
    middle = shapely.box(*shapely.total_bounds(np.array(given))).centroid
    lon0, lat0 = frame.to_lonlat(np.array([[middle.x, middle.y]]))[0].tolist()
    scale = np.array(metres_per_degree(lat0))
    origin = np.array([lon0, lat0])

    def to_plane(points: FloatArray) -> FloatArray:
        out: FloatArray = (frame.to_lonlat(points) - origin) * scale
        return out

    def to_e7(points: FloatArray) -> IntArray:
        lonlat: IntArray = np.round((points / scale + origin) * 1e7).astype(np.int64)
        lonlat[:, 0] = [mavlink.e7(wrap_lon_deg(v / 1e7)) for v in lonlat[:, 0].tolist()]
        return np.ascontiguousarray(lonlat[:, ::-1])

    def ring_e7(points: FloatArray) -> IntArray:
        ring = to_e7(points)
        return ring[np.any(ring != np.roll(ring, 1, axis=0), axis=1)]

    water = shapely.transform(water_m, to_plane)
    if not water.is_valid:
        parts = [
            p for p in shapely.get_parts(shapely.make_valid(water)) if p.geom_type == "Polygon"
        ]
        water = max(parts, key=lambda p: p.area)
    plane = [shapely.transform(g, to_plane) for g in given]

    def rounded(fit: RingFit) -> tuple[tuple[FencePolygon, ...], str]:
        """Return the polygons of a fit in 1e-7 degrees, and what is wrong with them."""
        polygons = tuple(
            FencePolygon(inclusion=i == 0, points_e7=read_only(ring_e7(ring)))
            for i, ring in enumerate((fit.inclusion, *fit.exclusions))
        )
        for geometry in plane[: len(lines)]:
            for part in shapely.get_parts(geometry):
                wrong = check_fence(polygons, to_e7(shapely.get_coordinates(part)))
                if wrong:
                    return polygons, wrong[0].message
        return polygons, ""

    fit = fit_rings(water, plane, margin_m, limits)
    polygons, wrong = rounded(fit)
    if wrong:  # water so narrow that rounding is as wide: a plain hull holds it
        fit = fit_hull(water, plane, margin_m, limits)
        polygons, wrong = rounded(fit)
    if wrong:
        raise InfeasibleError(
            f"the fence does not hold the path ({wrong}): use --no-fence or a larger --clearance"
        )

    def lonlat_of(row: tuple[float, float, float]) -> tuple[float, float, float]:
        lon, lat = (np.array(row[1:]) / scale + origin).tolist()
        return row[0], wrap_lon_deg(lon), lat

    places = tuple(map(lonlat_of, fit.land_places_m))
    left_out = tuple(map(lonlat_of, fit.islands_left_out_m))
    return FenceFit(
        polygons=polygons,
        land_m2=fit.land_m2,
        land_places=places,
        islands_left_out=left_out,
        points=fit.points,
        bytes_used=fit.bytes_used,
        notes=_notes(fit, places, left_out, limits),
    )


def metres_per_degree(lat_deg: float) -> tuple[float, float]:
    """Return the lengths of a degree of longitude and of latitude on WGS 84, m.

    Parameters
    ----------
    lat_deg
        Where, degrees.
    """
    phi = math.radians(lat_deg)
    w2 = 1 - WGS84_E2 * math.sin(phi) ** 2
    prime_vertical_m = WGS84_A_M / math.sqrt(w2)
    meridian_m = WGS84_A_M * (1 - WGS84_E2) / w2**1.5
    return math.radians(prime_vertical_m * math.cos(phi)), math.radians(meridian_m)


def _line(points_m: FloatArray) -> shapely.Geometry:
    if len(points_m) == 0:
        return shapely.LineString()
    return shapely.Point(points_m[0]) if len(points_m) == 1 else shapely.LineString(points_m)


def _notes(
    fit: RingFit,
    places: Sequence[tuple[float, float, float]],
    left_out: Sequence[tuple[float, float, float]],
    limits: VehicleLimits,
) -> tuple[str, ...]:
    notes = []
    budget = f"{limits.fence_bytes} bytes"
    if fit.land_m2 >= PLACE_M2 and places:
        where = ", ".join(f"{a:,.0f} m² at {lon:.5f},{lat:.5f}" for a, lon, lat in places[:3])
        more = f" and {len(places) - 3} more" if len(places) > PLACES_NAMED else ""
        notes.append(
            f"the fence takes in {fit.land_m2:,.0f} m² of land to fit into {budget}: {where}{more}"
        )
    if left_out:
        where = ", ".join(f"{lon:.5f},{lat:.5f}" for _, lon, lat in left_out[:3])
        more = f" and {len(left_out) - 3} more" if len(left_out) > PLACES_NAMED else ""
        notes.append(
            f"{len(left_out)} islands inside the fence have no exclusion, the budget of {budget} "
            f"is used up: at {where}{more}"
        )
    return tuple(notes)

"""Drawn lakes, and an independent look at a plan: plain shapely on the exported integers."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import pyproj
import shapely

from mrmission.model import FleetPlan, Mission, SurveyArea

NAVIGATION = {16, 17, 18, 19, 21, 22, 82}
STEP_DEG = 200 / 111_320


def star(
    rng: np.random.Generator, centre: tuple[float, float], radius_m: float, corners: int
) -> shapely.Polygon:
    """A star-shaped blob: a simple polygon whatever the radii."""
    angle = np.sort(rng.uniform(0, 2 * np.pi, corners))
    # three spread corners keep the centre inside and the polygon simple
    angle[:3] = np.array([0.1, 2.2, 4.3])
    angle = np.unique(np.round(angle, 6))
    radius = radius_m * rng.uniform(0.45, 1.0, len(angle))
    ring = np.column_stack([radius * np.cos(angle), radius * np.sin(angle)]) + centre
    return shapely.Polygon(ring)


def random_lake_m(
    rng: np.random.Generator, size_m: float, islands: int, corners: int = 11
) -> shapely.Polygon:
    """A lake in metres about the origin, with islands wholly inside and apart."""
    lake = star(rng, (0.0, 0.0), size_m / 2, corners)
    for _ in range(20 * islands):
        if len(lake.interiors) == islands:
            break
        x, y = rng.uniform(-size_m / 2, size_m / 2, 2)
        island = star(rng, (x, y), rng.uniform(0.03, 0.12) * size_m, int(rng.integers(4, 9)))
        if lake.contains(island.buffer(0.02 * size_m)):
            lake = shapely.Polygon(lake.exterior, [*lake.interiors, island.exterior])
    return lake


def area_of(
    water_m: shapely.Polygon | shapely.MultiPolygon,
    *,
    lon_deg: float = 8.4,
    lat_deg: float = 53.1,
    name: str = "drawn",
) -> SurveyArea:
    """The survey area of a lake drawn in metres."""
    return SurveyArea(
        name=name,
        source=f"{name}.geojson",
        water_lonlat=shapely.MultiPolygon(
            shapely.get_parts(to_lonlat(water_m, lon_deg, lat_deg)).tolist()
        ),
    )


def to_lonlat(geometry: shapely.Geometry, lon_deg: float, lat_deg: float) -> shapely.Geometry:
    """A geometry in metres about a point, in degrees."""
    plane = pyproj.Proj(f"+proj=aeqd +lat_0={lat_deg} +lon_0={lon_deg} +datum=WGS84")

    def unproject(xy: np.ndarray) -> np.ndarray:
        lon, lat = plane(xy[:, 0], xy[:, 1], inverse=True)
        # continuous across the antimeridian
        return np.column_stack([lon_deg + (lon - lon_deg + 180) % 360 - 180, lat])

    return shapely.transform(geometry, unproject)


def geojson_of(area: SurveyArea) -> str:
    """A survey area as a GeoJSON document."""
    return shapely.to_geojson(area.water_lonlat)


@dataclass(frozen=True, slots=True, kw_only=True)
class Measured:
    """What the missions do, by plain geometry."""

    coverage: float
    largest_missed_m2: float
    outside_m: float
    closed_m: float
    length_m: tuple[float, ...]


def waypoints_lonlat(mission: Mission, near_lon_deg: float) -> np.ndarray:
    """(n, 2) longitude, latitude of every position a mission visits, home first."""
    rows = [(i.y / 1e7, i.x / 1e7) for i in mission.items if i.command in NAVIGATION and i.x]
    points = np.array(rows, dtype=float).reshape(-1, 2)
    # items know -180..180 only; the area is continuous across the antimeridian
    points[:, 0] = near_lon_deg + (points[:, 0] - near_lon_deg + 180) % 360 - 180
    return points


def measure(
    plan: FleetPlan,
    missions: Sequence[Mission],
    swath_m: float,
    clearance_m: float,
    starts_lonlat: Sequence[tuple[float, float]] = (),
    tolerance_m: float = 0.1,
) -> Measured:
    """Measure missions against the area: independent of every stage, from the integers only."""
    water = plan.area.water_lonlat
    centre = water.centroid
    plane = pyproj.Proj(f"+proj=aeqd +lat_0={centre.y} +lon_0={centre.x} +datum=WGS84")

    def project(geometry):
        return shapely.transform(
            shapely.segmentize(geometry, STEP_DEG),
            lambda xy: np.column_stack(plane(xy[:, 0], xy[:, 1])),
        )

    metric = shapely.make_valid(project(water))
    navigable = metric.buffer(-clearance_m, quad_segs=32) if clearance_m else metric
    pieces = [p for p in shapely.get_parts(navigable) if p.area > 0]
    tracks, lengths, homes, closed = [], [], [], 0.0
    for mission in missions:
        points = waypoints_lonlat(mission, centre.x)
        if len(points) < 2:
            lengths.append(0.0)
            continue
        moved = np.append(True, np.any(np.diff(points, axis=0) != 0, axis=1))
        points = points[moved]
        homes.append(project(shapely.Point(points[0])))
        closed = max(closed, homes[-1].distance(project(shapely.Point(points[-1]))))
        legs = project(shapely.linestrings(np.stack([points[:-1], points[1:]], axis=1)))
        tracks.extend(legs)
        lengths.append(float(shapely.length(legs).sum()))
    anchors = [project(shapely.Point(s)) for s in starts_lonlat] or homes
    wanted = {int(np.argmin([p.distance(a) for p in pieces])) for a in anchors}
    target = shapely.union_all([pieces[i] for i in sorted(wanted)])
    # leg by leg: the buffer of a long line that runs back over itself loses some of it (GEOS)
    covered = shapely.union_all(shapely.buffer(tracks, swath_m / 2, quad_segs=16))
    missed = shapely.get_parts(target.difference(covered))
    # measured across: a throat of the clearance's own width is open or shut by a millimetre
    keep_off = clearance_m - tolerance_m
    allowed = metric.buffer(-keep_off, quad_segs=32)
    outside = shapely.length(shapely.difference(tracks, allowed)).sum()
    return Measured(
        coverage=1 - float(shapely.area(missed).sum()) / target.area,
        largest_missed_m2=float(shapely.area(missed).max(initial=0.0)),
        outside_m=float(outside),
        closed_m=float(closed),
        length_m=tuple(lengths),
    )

"""The navigable region: water eroded by the clearance, its parts, and where to start in it."""

from __future__ import annotations

import math

import numpy as np
import shapely

from mrmission.area.berths import Berths, berths
from mrmission.area.frame import LocalFrame
from mrmission.area.rings import length_text
from mrmission.errors import GeometryError
from mrmission.model import FloatArray

__all__ = [
    "Berths",
    "berths",
    "default_start",
    "navigable_region",
    "part_of",
    "parts_by_size",
    "snap_start",
]

SIMPLIFY_M = 0.01
"""Vertices that lie this close to the line between their neighbours are left out of the region."""

MIN_PART_M2 = 1e-4
MAX_SNAP_M = 50.0
START_STEP_M = 15.0
MAX_START_CANDIDATES = 400


def navigable_region(water_m: shapely.MultiPolygon, clearance_m: float) -> shapely.MultiPolygon:
    """Return the water eroded by the clearance, without parts that have no area.

    Parameters
    ----------
    water_m : MultiPolygon
        Survey area, local frame.
    clearance_m : float
        Distance kept from shore and islands, m; 0 keeps the whole water.

    Returns
    -------
    MultiPolygon
        Largest part first. It is empty where the clearance leaves nothing.

    Notes
    -----
    Arcs around corners of land have 16 segments per quarter circle, so up to 0.12 % of the
    clearance is lost there. Nearly collinear vertices are left out, which moves the border by no
    more than :data:`SIMPLIFY_M`, 1 cm.
    """
    eroded = water_m.buffer(-clearance_m) if clearance_m > 0 else water_m
    slim = shapely.simplify(eroded, SIMPLIFY_M, preserve_topology=True)
    if not slim.is_valid:
        slim = eroded
    pieces = [
        part
        for part in shapely.get_parts(slim)
        if isinstance(part, shapely.Polygon) and part.area > MIN_PART_M2
    ]
    return shapely.MultiPolygon(parts_by_size(shapely.MultiPolygon(pieces)))


def parts_by_size(region_m: shapely.MultiPolygon) -> list[shapely.Polygon]:
    """Return the parts, largest first; equal ones by their bounds."""
    return sorted(region_m.geoms, key=lambda part: (-part.area, part.bounds))


def part_of(parts_m: list[shapely.Polygon], point_m: FloatArray) -> int:
    """Return the index of the part that holds a point, or is nearest to it.

    Parameters
    ----------
    parts_m : list of Polygon
        Parts of the region, not empty.
    point_m : (2,) float array
        East, north, m.
    """
    distance = shapely.distance(np.array(parts_m, dtype=object), shapely.Point(point_m))
    return int(np.argmin(distance))


def snap_start(
    region_m: shapely.MultiPolygon,
    start_m: FloatArray,
    frame: LocalFrame,
    limit_m: float = MAX_SNAP_M,
) -> tuple[FloatArray, str | None]:
    """Return the point of the navigable region nearest to a start that the user gave.

    Parameters
    ----------
    region_m : MultiPolygon
        Navigable region, not empty.
    start_m : (2,) float array
        The start given, local frame, m.
    frame : LocalFrame
        For the positions in messages.
    limit_m : float
        How far a start may be moved, m.

    Returns
    -------
    point_m : (2,) float array
        In the region; `start_m` itself where it lies there.
    note : str or None
        What was moved how far, where it was.

    Raises
    ------
    GeometryError
        When the region is farther away than `limit_m`.
    """
    start = np.asarray(start_m, dtype=np.float64)
    point = shapely.Point(start)
    distance = float(region_m.distance(point))
    if distance == 0:
        return start, None
    nearest = shapely.get_coordinates(shapely.shortest_line(point, region_m))[1]
    lon, lat = frame.to_lonlat(start)
    water_lon, water_lat = frame.to_lonlat(nearest)
    if distance > limit_m:
        # Whoever has latitude first, as ground stations do, is told so.
        swapped = math.hypot(lat - water_lon, lon - water_lat)
        if swapped < 1 and swapped < math.hypot(lon - water_lon, lat - water_lat):
            advice = f"longitude comes first: is it {lat:.7f},{lon:.7f}?"
        else:
            advice = f"the nearest water is at {water_lon:.7f},{water_lat:.7f}"
        raise GeometryError(
            f"start {lon:.7f},{lat:.7f} is {length_text(distance)} from the navigable water, the "
            f"limit is {length_text(limit_m)}; {advice}"
        )
    return nearest, (
        f"start {lon:.7f},{lat:.7f} is not in the navigable water; moved "
        f"{length_text(distance)} to {water_lon:.7f},{water_lat:.7f}"
    )


def default_start(part_m: shapely.Polygon) -> FloatArray:
    """Return a start at the shore of a part of the navigable region.

    The rule: of points every 15 m along the outer border (at most 400), those with room enough are
    kept (at least half of the disc around them is water, or nine tenths of the most there is);
    of these the one nearest to the part's centroid is the start, so that no end of the lake is
    farther than need be. The disc has 60 m radius, less on small waters.

    Parameters
    ----------
    part_m : Polygon
        One part of the navigable region.

    Returns
    -------
    (2,) float array
        A point on the outer border of the part, east, north, m.
    """
    # the ring may begin anywhere and run either way: the same water gives the same start
    shore = shapely.normalize(shapely.Polygon(part_m.exterior)).exterior
    count = int(np.clip(math.ceil(shore.length / START_STEP_M), 8, MAX_START_CANDIDATES))
    along = np.arange(count) * (shore.length / count)
    candidates = shapely.get_coordinates(shapely.line_interpolate_point(shore, along))
    disc = _disc_pattern(float(np.clip(math.sqrt(part_m.area) / 4, 0.5, 60.0)))
    shapely.prepare(part_m)
    probes = (candidates[:, None, :] + disc[None, :, :]).reshape(-1, 2)
    wet = shapely.contains_xy(part_m, probes[:, 0], probes[:, 1]).reshape(count, -1).mean(axis=1)
    room = wet >= min(0.5, 0.9 * float(wet.max()))
    centre = shapely.get_coordinates(part_m.centroid)[0]
    # millimetres: equal distances must not be told apart by rounding
    distance = np.round(np.hypot(*(candidates - centre).T), 3)
    return np.asarray(candidates[np.flatnonzero(room)[np.argmin(distance[room])]])


def _disc_pattern(radius_m: float) -> FloatArray:
    """Return points spread evenly over a disc: a sunflower (Vogel's spiral) of 64."""
    i = np.arange(64) + 0.5
    r = radius_m * np.sqrt(i / 64)
    turn = i * math.pi * (3 - math.sqrt(5))
    return np.column_stack([r * np.cos(turn), r * np.sin(turn)])

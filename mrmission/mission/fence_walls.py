"""What a fence must hold: the path with its margin, cut at the shore, as segments not to cross."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import numpy as np
import shapely

from mrmission.model import FloatArray

CHUNK = 12
"""Legs merged at a time: noding a whole path with itself takes seconds."""
BLOCK = 8
"""Chunks that share a piece of the water."""
PEEL_M = 0.01
"""The walls stand this far inside of what must be held: the first fence runs along its edge."""
KEEP_PEEL_M = 2e-7
MOST_CELLS = 160


def walls_of(
    water: shapely.Polygon, path_m: Sequence[shapely.Geometry], margin_m: float
) -> FloatArray:
    """Return segments that a fence around the path must not cross.

    They bound everything within the margin of the path, less the land: where the shore is nearer
    than the margin, the fence may run along the shore, not between the shore and the path.

    Parameters
    ----------
    water
        The water, widened onto land where the path comes too near to the shore.
    path_m
        Lines and points with the margin, polygons without.
    margin_m
        Distance kept from the fence, m.

    Returns
    -------
    array of shape (n, 4), m
    """
    found: list[Any] = []
    for geometry in path_m:
        for part in shapely.get_parts(geometry):
            if part.is_empty:
                continue
            if part.geom_type == "Polygon":
                found.append(shapely.buffer(part, -KEEP_PEEL_M, join_style="mitre"))
                continue
            points = shapely.get_coordinates(part)
            if len(points) == 1:
                points = np.vstack([points, points])
            found.extend(_around(water, points, margin_m))
    return _segments_of(np.array(found, dtype=object))


def _around(water: shapely.Polygon, points: FloatArray, margin_m: float) -> list[Any]:
    rings = water.boundary
    shapely.prepare(rings)
    lines = np.array(
        [shapely.LineString(points[i : i + CHUNK + 1]) for i in range(0, len(points) - 1, CHUNK)]
    )
    touched = shapely.dwithin(rings, lines, margin_m)
    # arcs half inside, half outside of the true circle
    chunks = shapely.buffer(lines, 1.004 * margin_m, quad_segs=6)
    out: list[Any] = chunks[~touched].tolist()
    todo = np.flatnonzero(touched)
    for first in range(0, len(todo), BLOCK):
        block = todo[first : first + BLOCK]
        bounds = shapely.total_bounds(chunks[block]) + np.array([-1.0, -1.0, 1.0, 1.0])
        local = shapely.intersection(water, shapely.box(*bounds))
        parts, index = shapely.get_parts(
            shapely.intersection(chunks[block], local), return_index=True
        )
        # water beyond a spit is no part of what the path needs
        out.extend(parts[shapely.intersects(parts, lines[block][index])].tolist())
    held: list[Any] = shapely.buffer(np.array(out), -PEEL_M, join_style="mitre").tolist()
    return held


def _segments_of(areas: Any) -> FloatArray:
    rings = shapely.get_rings(shapely.get_parts(areas))
    points, ring = shapely.get_coordinates(rings, return_index=True)
    same = ring[1:] == ring[:-1]
    return np.ascontiguousarray(np.hstack([points[:-1], points[1:]])[same])


def grid_over(walls: FloatArray) -> FloatArray:
    """Return [x, y, cell size, columns, rows] of a grid over some segments."""
    points = walls.reshape(-1, 2)
    low, high = points.min(axis=0), points.max(axis=0)
    side = float((high - low).max()) + 1e-3
    cells = min(MOST_CELLS, max(8, math.isqrt(len(walls))))
    size = side / cells
    shape = np.floor((high - low) / size).astype(int) + 1
    return np.array([low[0], low[1], size, shape[0], shape[1]], dtype=float)


def ring_edges(polygon: shapely.Polygon) -> FloatArray:
    """Return the edges of a polygon's rings, (n, 4)."""
    return _segments_of(np.array([polygon]))

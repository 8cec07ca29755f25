"""What a fence is fitted to: the path's segments, and the water around them.

Where the path runs too near to the shore, the water is widened onto the land; where the whole shore
does not fit into a vehicle's store, only what lies around the path counts.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import numpy as np
import shapely

from mrmission.errors import InfeasibleError
from mrmission.model import FloatArray

KEEP_INSET_M = 1e-6
"""Launch circles are held to this: their edge may lie on the shore, where the fence begins."""
RUN = 12
"""Legs widened at a time: a long line's buffer is noded with itself."""
MOST_SQUARES = 150
"""Squares along the longer side of what surrounds a path."""


def path_segments(
    path_m: Sequence[shapely.Geometry], margin_m: float, touch_m: float
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return the path's segments, the distance each needs, and the least distance of each.

    Parameters
    ----------
    path_m
        Lines and points with the margin; polygons, held a hair inside their edge.
    margin_m, touch_m
        Distance that lines and points want, and what must be left where the shore is nearer, m.

    Returns
    -------
    tuple of (n, 4) array, (n,) array, (n,) array
        The ends x, y, x, y; m.

    Raises
    ------
    InfeasibleError
        When there is nothing to go around.
    """
    rows: list[FloatArray] = []
    need: list[FloatArray] = []
    reach: list[FloatArray] = []

    def add(points: FloatArray, wanted_m: float, least_m: float) -> None:
        if len(points) == 1:
            points = np.vstack([points, points])
        rows.append(np.hstack([points[:-1], points[1:]]))
        need.append(np.full(len(points) - 1, wanted_m))
        reach.append(np.full(len(points) - 1, least_m))

    inset_m = KEEP_INSET_M
    for geometry in path_m:
        for part in shapely.get_parts(geometry):
            if part.is_empty:
                continue
            if part.geom_type == "Polygon":
                # just inside the edge, which may lie on the shore
                inner = shapely.buffer(part, -inset_m)
                for piece in shapely.get_parts(inner):
                    for ring in (piece.exterior, *piece.interiors):
                        if not piece.is_empty:
                            add(shapely.get_coordinates(ring), 0.9 * inset_m, 0.5 * inset_m)
            else:
                add(shapely.get_coordinates(part), margin_m, 0.8 * touch_m)
    if not rows:
        raise InfeasibleError("a fence needs a path or a launch place to go around; found none")
    return np.ascontiguousarray(np.vstack(rows)), np.concatenate(need), np.concatenate(reach)


def water_with_path(water: shapely.Polygon, lines: Any, touch_m: float) -> shapely.Polygon:
    """Return the water, widened onto land where the path runs closer than `touch_m` to it."""
    legs = shapely.get_parts(lines)
    outside = ~shapely.covers(water, legs) if len(legs) else np.zeros(0, dtype=bool)
    rings = water.boundary
    shapely.prepare(rings)
    close = legs[outside | shapely.dwithin(rings, legs, touch_m)] if len(legs) else legs
    if len(close) == 0:
        return water
    # one line of those that follow each other: their buffers need not be united afterwards
    ends = shapely.get_coordinates(close).reshape(-1, 4)
    breaks = np.flatnonzero(np.any(ends[1:, :2] != ends[:-1, 2:], axis=1)) + 1
    runs = []
    for run in np.split(ends, breaks):
        points = np.vstack([run[:, :2], run[-1:, 2:]])
        runs += [
            shapely.LineString(points[i : i + RUN + 1]) for i in range(0, len(points) - 1, RUN)
        ]
    # a buffer's arcs lie inside the true circle: 5 % more keeps the distance everywhere
    wide = shapely.union_all(
        [water, *shapely.buffer(runs, 1.05 * touch_m, quad_segs=4, join_style="round")]
    )
    return part_with_path(wide, lines)


def surroundings(path: FloatArray, reach_m: float) -> Any:
    """Return a region that covers everything within `reach_m` of an (n, 4) path, and little more.

    A buffer would node the path with itself, which takes seconds on lanes that transits cross.
    """
    low, high = path.reshape(-1, 2).min(axis=0), path.reshape(-1, 2).max(axis=0)
    size_m = max(reach_m / 2, float((high - low).max()) / MOST_SQUARES)
    spread = math.ceil(reach_m / size_m) + 1
    shape = tuple((np.ceil((high - low) / size_m).astype(int) + 2 * spread + 1).tolist())
    free = np.zeros(shape, dtype=bool)
    for a, b in path.reshape(-1, 2, 2):
        steps = math.ceil(2 * float(np.hypot(*(b - a))) / size_m) + 1
        along = a + np.linspace(0, 1, steps)[:, None] * (b - a)
        column, row = (np.floor((along - low) / size_m).astype(int) + spread).T
        free[column, row] = True
    for axis in (0, 1):
        free = np.logical_or.reduce([np.roll(free, k, axis) for k in range(-spread, spread + 1)])
    boxes = []
    corner = low - spread * size_m
    for column, cells in enumerate(free):
        edges = np.flatnonzero(np.diff(np.concatenate([[False], cells, [False]]).astype(np.int8)))
        x = corner[0] + column * size_m
        for start, stop in edges.reshape(-1, 2).tolist():
            y0, y1 = corner[1] + start * size_m, corner[1] + stop * size_m
            boxes.append(shapely.box(x, y0, x + size_m, y1))
    # stairs would cost the shortening many moves: go out by a square, then cut corners by as much
    return shapely.simplify(shapely.buffer(shapely.union_all(boxes), size_m, quad_segs=2), size_m)


def part_with_path(region: Any, path: Any) -> shapely.Polygon:
    """Return the part of a region that holds the path.

    Raises
    ------
    InfeasibleError
        When the region is empty.
    """
    parts = [p for p in shapely.get_parts(region) if p.geom_type == "Polygon" and p.area > 0]
    if not parts:
        raise InfeasibleError("the path lies outside the water: no fence can hold both")
    if len(parts) == 1:
        return parts[0]
    x, y = shapely.get_coordinates(path).T
    held = []
    for part in parts:
        shapely.prepare(part)
        held.append((int(np.count_nonzero(shapely.intersects_xy(part, x, y))), part.area))
    return parts[max(range(len(parts)), key=held.__getitem__)]

"""Shortest paths in the water: :class:`WaterRouter`.

The shortest path between two points of a polygon with islands is a chain of straight legs that
bends only at convex corners of the land, and each leg grazes the corners it bends at. So the graph
of such legs between corners (the tangent visibility graph), plus the legs from either end, holds
every shortest path.

References
----------
M. de Berg, O. Cheong, M. van Kreveld, M. Overmars, *Computational Geometry*, chapter 15.
M. Pocchiola, G. Vegter, "The visibility complex", IJCGA 6(3), 1996 (tangent legs suffice).
"""

from __future__ import annotations

from typing import TypeAlias

import numpy as np
import numpy.typing as npt
import shapely

from mrmission.errors import PlanningError
from mrmission.model import BoolArray, FloatArray
from mrmission.routing import visibility as kernels
from mrmission.routing.groups import group_distances
from mrmission.routing.matrix import FEW_SOURCES, few_distances, many_distances
from mrmission.routing.near import lengths_within, sort_into_squares
from mrmission.routing.shore_grid import Int, build_grid, settle_points

SNAP_M = 0.05
"""Points up to this far outside the region are taken as points of its boundary."""

_TOLERANCE_M = 1e-7  # the land is shrunk by this much
MANY_LOOKS = 50_000_000
"""From so many pairs of target and corner on, targets look only at corners that may matter."""
_MERGE_M = 2e-6  # corners closer than this are one
_CELLS_PER_EDGE = 6
Near: TypeAlias = tuple[npt.NDArray[np.int64], Int, FloatArray]
_NONE: Int = np.zeros((0, 0), dtype=np.int32)


class WaterRouter:
    """Shortest in-water paths inside one polygon with islands.

    A path may touch the shore, run along it, and pass a point where two islands or an island and
    the shore touch. Points up to `snap_m` outside the region (rounded, snapped) are treated as the
    nearest point of its boundary. Lengths satisfy the triangle inequality.

    Parameters
    ----------
    region
        The navigable region, local frame, metres: one valid polygon, holes are land.
    snap_m
        How far outside the region a point may lie.

    Raises
    ------
    PlanningError
        When the region is not one polygon with an area.
    """

    def __init__(self, region: shapely.Polygon, *, snap_m: float = SNAP_M) -> None:
        polygon = _one_polygon(region)
        rings = [polygon.exterior, *polygon.interiors]
        self._snap_m = snap_m
        bounds = np.array(polygon.bounds)
        self._centre = (bounds[:2] + bounds[2:]) / 2
        extent = float(np.max(bounds[2:] - bounds[:2]))
        # Coordinates of more than 1,000 km leave less than 1e-9 m for the predicates.
        self._tolerance_m = max(_TOLERANCE_M, extent * 1e-13)
        xy, before, after = _corners(
            [shapely.get_coordinates(r)[:-1] - self._centre for r in rings], self._tolerance_m / 2
        )
        moved, into_land, reflex = _shrink(xy, before, after, self._tolerance_m)
        shore = np.hstack([xy, xy[after]])
        shrunk = np.hstack([moved, moved[after]])
        cells = int(np.clip(_CELLS_PER_EDGE * len(xy), 256, 2_000_000))
        self._grid = build_grid(shore, shrunk, cells)
        node = np.ascontiguousarray(xy[reflex])
        ring_before = np.ascontiguousarray(xy[before[reflex]])
        ring_after = np.ascontiguousarray(xy[after[reflex]])
        land = np.ascontiguousarray(into_land[reflex])
        block = kernels.corner_blocks(node, ring_before, ring_after)
        self._graph = kernels.build_graph(self._grid, node, ring_before, ring_after, land, block)
        # No shortest path uses a corner twice, and every leg is shorter than the diagonal.
        self._top_m = 2.0 * extent * (len(node) + 2)

    @property
    def corner_count(self) -> int:
        """Number of land corners in the graph."""
        return len(self._graph[0])

    @property
    def edge_count(self) -> int:
        """Number of tangent legs between land corners."""
        return len(self._graph[6]) // 2

    def visible(self, a_m: FloatArray, b_m: FloatArray) -> BoolArray:
        """Return whether the straight legs from `a_m` to `b_m` stay in the water.

        Parameters
        ----------
        a_m, b_m
            Shape (n, 2), metres.

        Returns
        -------
        BoolArray
            Shape (n,). Touching the shore, and running along it, is staying in the water; a leg
            with an end farther than `snap_m` outside is not.
        """
        (a, a_out), (b, b_out) = self._moved(a_m), self._moved(b_m)
        _same_length(a, b)
        seen: BoolArray = np.zeros(len(a), dtype=np.bool_)
        wet = ~(a_out | b_out)
        seen[wet] = kernels.clear_pairs(self._grid, a[wet], b[wet])
        return seen

    def distances(self, sources_m: FloatArray, targets_m: FloatArray) -> FloatArray:
        """Return the in-water lengths from every source to every target.

        Parameters
        ----------
        sources_m, targets_m
            Shapes (s, 2) and (t, 2), metres.

        Returns
        -------
        FloatArray
            Shape (s, t), metres.

        Raises
        ------
        PlanningError
            When a point lies outside the region, or no path joins two of them.
        """
        sources, targets = self._settle(sources_m), self._settle(targets_m)
        # Every point costs a look at all corners, every source a search as well.
        if len(sources) <= len(targets):
            out = self._many(sources, targets)
        else:
            out = self._many(targets, sources).T
        self._check_reached(out, sources, targets)
        return np.ascontiguousarray(out)

    def distance_matrix(self, points_m: FloatArray) -> FloatArray:
        """Return the in-water lengths between all `points_m`, (n, 2), as (n, n), symmetric."""
        points = self._settle(points_m)
        out = many_distances(
            self._grid, self._graph, points, curve_order(points), points, True, _NONE
        )
        self._check_reached(out, points, points)
        return out

    def lengths_within(
        self, points_m: FloatArray, reach_m: FloatArray, least: int
    ) -> tuple[Near, FloatArray]:
        """Return the points within reach of each point in the water, without all pairs.

        Parameters
        ----------
        points_m
            Shape (n, 2), metres.
        reach_m
            Shape (n,), how far to look from each point.
        least
            Where fewer others are within reach, look farther until there are so many.

        Returns
        -------
        near : tuple of arrays
            ``(start, other, length_m)``: from point i the points ``other[start[i]:start[i + 1]]``,
            in ascending order, and their exact lengths.
        reach_m : FloatArray
            Shape (n,), how far was looked: all points within are listed.

        Raises
        ------
        PlanningError
            When a point lies outside the region.
        """
        points = self._settle(points_m)
        reach = np.array(reach_m, dtype=np.float64)
        if len(points) == 0:
            return (np.zeros(1, dtype=np.int64), np.zeros(0, dtype=np.int32), reach), reach
        node = self._graph[0]
        np.maximum(reach, 1e-3, out=reach)
        start, other, length = lengths_within(
            self._grid, self._graph, points,
            sort_into_squares(points, 4.0), sort_into_squares(node, 4.0),
            min(least, len(points) - 1), reach, self._top_m,
        )  # fmt: skip
        row = np.repeat(np.arange(len(points)), np.diff(start))
        order = np.argsort(row * len(points) + other, kind="stable")
        return (start, other[order], length[order]), reach

    def last_corners(self, points_m: FloatArray) -> tuple[FloatArray, Int, FloatArray]:
        """Return the lengths between all points, and where each way bends for the last time.

        Parameters
        ----------
        points_m
            Shape (n, 2), metres.

        Returns
        -------
        length_m : FloatArray
            Shape (n, n), symmetric but for rounding.
        last : Int
            Shape (n, n), the last corner of the way from the first to the second; -1 where the
            way is straight.
        corner_m : FloatArray
            Shape (c + 1, 2), the corners of land, and a row that is not a number for -1.

        Raises
        ------
        PlanningError
            When a point lies outside the region, or no path joins two of them.
        """
        points = self._settle(points_m)
        last = np.full((len(points), len(points)), -1, dtype=np.int32)
        order = curve_order(points)
        out = many_distances(self._grid, self._graph, points, order, points, False, last)
        self._check_reached(out, points, points)
        corners = np.vstack([self._graph[0] + self._centre, np.full((1, 2), np.nan)])
        return out, last, corners

    def pair_distances(self, a_m: FloatArray, b_m: FloatArray) -> FloatArray:
        """Return the in-water lengths from ``a_m[i]`` to ``b_m[i]``.

        Parameters
        ----------
        a_m, b_m
            Shape (n, 2), metres. Quick where the two see each other or are near.

        Returns
        -------
        FloatArray
            Shape (n,), metres.

        Raises
        ------
        PlanningError
            When a point lies outside the region, or no path joins two of them.
        """
        return self._pairs(self._settle(a_m), self._settle(b_m))[0]

    def paths(self, a_m: FloatArray, b_m: FloatArray) -> list[FloatArray]:
        """Return the shortest paths from ``a_m[i]`` to ``b_m[i]``.

        Parameters
        ----------
        a_m, b_m
            Shape (n, 2), metres.

        Returns
        -------
        list of FloatArray
            Polylines of shape (m, 2), both ends as given included.

        Raises
        ------
        PlanningError
            When a point lies outside the region, or no path joins two of them.
        """
        first, last = _points(a_m), _points(b_m)
        _, start, bends = self._pairs(self._settle(first), self._settle(last))
        corners = self._graph[0][bends] + self._centre
        return [
            np.vstack([first[i : i + 1], corners[start[i] : start[i + 1]], last[i : i + 1]])
            for i in range(len(first))
        ]

    def path(self, a_m: FloatArray, b_m: FloatArray) -> FloatArray:
        """Return the shortest path between two points, shape (m, 2), both ends included."""
        return self.paths(np.reshape(a_m, (1, 2)), np.reshape(b_m, (1, 2)))[0]

    def _many(self, sources: FloatArray, targets: FloatArray) -> FloatArray:
        if len(sources) <= FEW_SOURCES:
            order = curve_order(targets)
            return few_distances(self._grid, self._graph, sources, targets, order)
        order = curve_order(sources)
        if len(targets) * self.corner_count >= MANY_LOOKS:
            near = curve_order(targets)
            return group_distances(
                self._grid, self._graph, sources, order, targets, near, self._top_m
            )
        return many_distances(self._grid, self._graph, sources, order, targets, False, _NONE)

    def _pairs(self, a: FloatArray, b: FloatArray) -> tuple[FloatArray, Int, Int]:
        _same_length(a, b)
        out, start, bends = kernels.pair_paths(self._grid, self._graph, a, b, self._top_m)
        if not np.isfinite(out).all():
            i = int(np.argmin(np.isfinite(out)))
            self._fail_unreached(a[i], b[i])
        return out, start, bends

    def _settle(self, points_m: FloatArray) -> FloatArray:
        """Return the points about the region's centre, those just outside moved to the shore."""
        points, outside = self._moved(points_m)
        if outside.any():
            i = int(np.argmax(outside))
            x, y = points[i] + self._centre
            raise PlanningError(
                f"point {i} at east {x:.3f} m, north {y:.3f} m is more than {self._snap_m} m "
                "outside the navigable region: move it into the water or reduce the clearance"
            )
        return points

    def _moved(self, points_m: FloatArray) -> tuple[FloatArray, BoolArray]:
        """Return what `_settle` does, and which points are too far outside for it."""
        points = _points(points_m) - self._centre
        if not np.isfinite(points).all():
            raise PlanningError("a point to route from or to is not a number")
        return points, settle_points(self._grid, points, self._snap_m, self._tolerance_m / 2) == 2

    def _check_reached(self, out: FloatArray, sources: FloatArray, targets: FloatArray) -> None:
        if out.size and not np.isfinite(out).all():
            i, j = np.unravel_index(int(np.argmin(np.isfinite(out))), out.shape)
            self._fail_unreached(sources[i], targets[j])

    def _fail_unreached(self, a: FloatArray, b: FloatArray) -> None:
        (ax, ay), (bx, by) = a + self._centre, b + self._centre
        raise PlanningError(
            f"no way in the water from east {ax:.3f} m, north {ay:.3f} m to east {bx:.3f} m, "
            f"north {by:.3f} m: check that the region is valid and in one piece"
        )


def _one_polygon(region: shapely.Geometry) -> shapely.Polygon:
    """Return the region as one polygon, shell counterclockwise and holes clockwise."""
    parts = [p for p in shapely.get_parts(region) if not p.is_empty]
    if len(parts) != 1 or parts[0].geom_type != "Polygon" or not parts[0].area > 0:
        raise PlanningError(
            f"in-water paths need one polygon with an area, not a {region.geom_type} of "
            f"{len(parts)} parts: route each part by itself"
        )
    return shapely.orient_polygons(shapely.force_2d(parts[0]))


def _points(points_m: FloatArray) -> FloatArray:
    return np.array(points_m, dtype=np.float64, order="C").reshape(-1, 2)


def curve_order(points_m: FloatArray) -> npt.NDArray[np.int64]:
    """Return an order in which points that follow on each other lie near each other (Morton)."""
    if len(points_m) == 0:
        return np.zeros(0, dtype=np.int64)
    low = points_m.min(axis=0)
    span = float(np.max(points_m.max(axis=0) - low)) or 1.0
    cell = ((points_m - low) * (65_535.0 / span)).astype(np.int64)
    for shift, mask in ((8, 0x00FF00FF), (4, 0x0F0F0F0F), (2, 0x33333333), (1, 0x55555555)):
        cell = (cell | cell << shift) & mask
    return np.argsort(cell[:, 0] | cell[:, 1] << 1, kind="stable").astype(np.int64)


def _same_length(a: FloatArray, b: FloatArray) -> None:
    if len(a) != len(b):
        raise ValueError(f"as many starts as ends are needed, not {len(a)} and {len(b)}")


def _corners(rings: list[FloatArray], tolerance_m: float) -> tuple[FloatArray, Int, Int]:
    """Return the rings' vertices without repeated and collinear ones, and their neighbours."""
    kept: list[FloatArray] = []
    before: list[Int] = []
    after: list[Int] = []
    count = 0
    for ring in rings:
        clean = _thin_ring(ring, tolerance_m)
        if len(clean) < 3:
            continue
        index = np.arange(count, count + len(clean), dtype=np.int32)
        kept.append(clean)
        before.append(np.roll(index, 1))
        after.append(np.roll(index, -1))
        count += len(clean)
    if not kept:
        raise PlanningError("the navigable region is smaller than a millimetre")
    return np.concatenate(kept), np.concatenate(before), np.concatenate(after)


def _thin_ring(ring: FloatArray, tolerance_m: float) -> FloatArray:
    """Drop repeated vertices, and every other one of neighbours on a straight run, until none."""
    while len(ring) >= 3:
        step = np.roll(ring, -1, axis=0) - ring
        length = np.hypot(step[:, 0], step[:, 1])
        if (length < _MERGE_M).any():
            keep = length >= _MERGE_M
            if keep.sum() < 3:
                return ring[:0]
            ring = ring[keep]
            continue
        previous = np.roll(step, 1, axis=0)
        chord = step + previous
        span = np.hypot(chord[:, 0], chord[:, 1])
        off = np.abs(previous[:, 0] * step[:, 1] - previous[:, 1] * step[:, 0])
        ahead = (previous * step).sum(axis=1) > 0
        # A 64th of the tolerance per halving: a run of any length stays within it.
        straight = ahead & (off <= span * tolerance_m / 64)
        if not straight.any():
            break
        # Two neighbours never go together, or both would lean on a vertex that is gone.
        drop = straight & ~np.roll(straight, 1)
        if drop.any():
            odd = np.zeros(len(ring), dtype=np.bool_)
            run = np.cumsum(drop)
            first = np.flatnonzero(drop)
            position = np.arange(len(ring)) - first[np.maximum(run - 1, 0)]
            position[: first[0]] += len(ring) - first[-1] + first[0]
            odd = straight & (position % 2 == 0)
            # The run that wraps around the seam may put two next to each other there.
            if odd[0] and odd[-1]:
                odd[0] = False
            drop = odd
        else:
            drop = straight.copy()
            drop[1::2] = False
        ring = ring[~drop]
    return ring


def _shrink(
    xy: FloatArray, before: Int, after: Int, tolerance_m: float
) -> tuple[FloatArray, FloatArray, BoolArray]:
    """Return the vertices moved into the land, unit vectors into it, and who is a land corner."""
    into, out = xy - xy[before], xy[after] - xy
    into_length = np.hypot(into[:, 0], into[:, 1])
    out_length = np.hypot(out[:, 0], out[:, 1])
    into /= into_length[:, None]
    out /= out_length[:, None]
    # Water lies on the left of every ring, so land is on the right.
    right_in = np.stack([into[:, 1], -into[:, 0]], axis=1)
    right_out = np.stack([out[:, 1], -out[:, 0]], axis=1)
    turn = into[:, 0] * out[:, 1] - into[:, 1] * out[:, 0]
    reflex = turn < 0
    # The bisector into the land from the normals or, at needles, from the edges.
    bisector = right_in + right_out
    along = np.where(reflex[:, None], out - into, into - out)
    sharp = (into * out).sum(axis=1) < 0
    bisector = np.where(sharp[:, None], along, bisector)
    bisector /= np.hypot(bisector[:, 0], bisector[:, 1])[:, None]
    depth = np.maximum((bisector * right_in).sum(axis=1), 1e-4)
    reach = np.minimum(tolerance_m / depth, 0.25 * np.minimum(into_length, out_length))
    return xy + bisector * reach[:, None], bisector, reflex

"""What a set of legs leaves uncovered, by exact geometry, strip by strip."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import numpy.typing as npt
import shapely

from mrmission.model import BoolArray, FloatArray, IntArray

QUAD_SEGS = 16
"""Segments per quarter circle of a leg's round ends: inscribed, so never too generous."""
ROUNDED_HAIR_M = 0.016
"""Coordinates of a mission are whole 1e-7 degrees, 11.1 mm of latitude and no more of longitude, so
each of two lanes that touch is off by up to half of that in both: 11.1 mm times the root of 2."""
BESIDE_M = 0.25
"""A leg that stays this near to a line that is not counted is a leg of that line: rounding and
merging of waypoints move legs by less."""
MANY_PIECES = 5000
"""Of more pieces of strips than this only those that touch another are united: a union of all
grows faster than their number, and most are whole as they are."""

PAIRS = 50_000
"""Pieces and legs that are looked at together."""
WITHIN = 0.9985
"""Share of its radius within which a leg's buffer is sure to hold a point: its arcs are chords."""


def strips_of(region: shapely.Polygon, borders_m: FloatArray) -> list[shapely.Geometry]:
    """Cut a region (sweep frame) into vertical strips between consecutive borders.

    Cuts by halves, so that the work is n log(strips) and not n times strips.
    """
    out: list[shapely.Geometry] = [shapely.Polygon()] * (len(borders_m) - 1)
    _, y_min, _, y_max = region.bounds
    todo: list[tuple[shapely.Geometry, int, int]] = [(region, 0, len(borders_m) - 1)]
    while todo:
        part, a, b = todo.pop()
        if part.is_empty:
            continue
        if b - a == 1:
            out[a] = part
            continue
        middle = (a + b) // 2
        for c, d in ((a, middle), (middle, b)):
            box = (borders_m[c], y_min - 1, borders_m[d], y_max + 1)
            clipped = shapely.clip_by_rect(part, *box)
            if not clipped.is_valid:  # a touching hole can confuse the fast clipper
                clipped = shapely.intersection(shapely.make_valid(part), shapely.box(*box))
            todo.append((clipped, c, d))
    return out


def leg_quads(legs_m: FloatArray, radius_m: float) -> npt.NDArray[np.object_]:
    """Return the rectangles within `radius_m` beside each leg of (n, 2, 2), without round ends."""
    along = legs_m[:, 1] - legs_m[:, 0]
    length = np.hypot(along[:, 0], along[:, 1])
    unit = along / np.where(length > 0, length, 1.0)[:, None]
    side = np.column_stack([-unit[:, 1], unit[:, 0]]) * radius_m
    ring = np.stack(
        [
            legs_m[:, 0] + side,
            legs_m[:, 1] + side,
            legs_m[:, 1] - side,
            legs_m[:, 0] - side,
            legs_m[:, 0] + side,
        ],
        axis=1,
    )
    return shapely.polygons(ring)


def leg_lines(legs_m: FloatArray) -> npt.NDArray[np.object_]:
    """Return each leg of (n, 2, 2) as a line, or as a point when it has no length."""
    moving = np.any(legs_m[:, 0] != legs_m[:, 1], axis=1)
    lines = np.empty(len(legs_m), dtype=object)
    lines[moving] = shapely.linestrings(legs_m[moving])
    lines[~moving] = shapely.points(legs_m[~moving, 0])
    return lines


def leg_buffers(legs_m: FloatArray, radius_m: float) -> npt.NDArray[np.object_]:
    """Return everything within `radius_m` of each leg of (n, 2, 2)."""
    return shapely.buffer(leg_lines(legs_m), radius_m, quad_segs=QUAD_SEGS)


def _polygons(geometry: shapely.Geometry | npt.NDArray[np.object_]) -> list[shapely.Polygon]:
    """Return the polygons in one or many geometries, without slivers of no area."""
    parts = shapely.get_parts(geometry)
    while np.any(shapely.get_type_id(parts) > 3):
        parts = shapely.get_parts(parts)
    return list(parts[(shapely.get_type_id(parts) == 3) & (shapely.area(parts) > 0)])


def by_size(pieces: Sequence[shapely.Polygon]) -> list[shapely.Polygon]:
    """Return polygons, the largest first; by their bounds where that is the same."""
    rows = np.array(pieces, dtype=object)
    x_min, y_min, x_max, y_max = shapely.bounds(rows).reshape(-1, 4).T
    return list(rows[np.lexsort((y_max, x_max, y_min, x_min, -shapely.area(rows)))])


def total_area(pieces: Sequence[shapely.Polygon]) -> float:
    """Return the summed area, one after the other: the same on every processor."""
    return float(sum(shapely.area(np.array(pieces, dtype=object)).tolist()))


def merged(pieces: Sequence[shapely.Polygon]) -> list[shapely.Polygon]:
    """Return the union of polygons, those that touch drawn together."""
    rows = np.array(pieces, dtype=object)
    if len(rows) <= MANY_PIECES:
        return _polygons(shapely.union_all(rows))
    first, other = shapely.STRtree(rows).query(rows, predicate="intersects")
    touching = np.zeros(len(rows), dtype=bool)
    touching[first[first != other]] = True
    return _polygons(rows[~touching]) + _polygons(shapely.union_all(rows[touching]))


class Uncovered:
    """Finds what legs leave uncovered of one region; prepared once, asked many times.

    Parameters
    ----------
    region
        The region in the sweep frame, connected or not.
    column_pitch_m
        Width of the strips in which the work is cut: about the swath.
    radius_m
        Half the swath.
    beside
        Lines (sweep frame) that are swept without being counted: legs along them cover nothing.
    hair_m
        So wide a gap is no more than rounding leaves between two lanes, and is not looked for.
    """

    def __init__(
        self,
        region: shapely.Geometry,
        column_pitch_m: float,
        radius_m: float,
        beside: shapely.Geometry | None = None,
        hair_m: float = 0.0,
    ) -> None:
        self.region = region
        self.radius_m = radius_m
        self.hair_m = hair_m
        self._beside = None
        if beside is not None and not beside.is_empty:
            self._beside = shapely.buffer(beside, BESIDE_M)
            shapely.prepare(self._beside)
        x_min, _, x_max, _ = region.bounds
        count = max(1, int(np.ceil((x_max - x_min) / column_pitch_m - 1e-9)))
        self._borders = np.linspace(x_min, x_max, count + 1)
        self._strips = np.array(strips_of(region, self._borders), dtype=object)

    @property
    def reach_m(self) -> float:
        """Return how far from a leg nothing is looked for: half the swath and half a hair."""
        return self.radius_m + 0.5 * self.hair_m

    def clip(self, geometry: shapely.Geometry) -> shapely.Geometry:
        """Return a small geometry (sweep frame) clipped to the region."""
        x_min, _, x_max, _ = geometry.bounds
        first = int(np.searchsorted(self._borders, x_min, side="right")) - 1
        last = int(np.searchsorted(self._borders, x_max, side="left"))
        strips = self._strips[max(first, 0) : max(last, first + 1)]
        return shapely.union_all(shapely.intersection(strips, geometry))

    def remainder(
        self,
        legs_m: FloatArray,
        floor_m2: float = 0.0,
        *,
        rounded: bool = False,
    ) -> list[shapely.Polygon]:
        """Return the polygons (sweep frame) of the region beyond `radius_m` of every leg.

        Parameters
        ----------
        legs_m
            (n, 2, 2) legs, sweep frame; points are legs of no length.
        floor_m2
            Pieces of a strip up to this area are not looked for further (they still are bounded
            by it); 0 finds everything.
        rounded
            Whether the legs are those of rounded coordinates, between which gaps are wider.
        """
        legs_m = legs_m[self.counts(legs_m)]
        reach_m = self.reach_m
        if rounded and self.hair_m > 0:
            reach_m = self.radius_m + 0.5 * max(self.hair_m, ROUNDED_HAIR_M)
        pieces = self._after_quads(legs_m, reach_m)
        pieces = pieces[shapely.area(pieces) > floor_m2]
        left = subtract_legs(pieces, legs_m, reach_m)
        return by_size(merged(left)) if left else []

    def left_m2(self, lanes_m: FloatArray, ways_m: FloatArray) -> tuple[float, float]:
        """Return how many m² of the region lanes leave, and lanes and other legs, to a hair.

        Parameters
        ----------
        lanes_m, ways_m
            (n, 2, 2) lanes, and the other legs, sweep frame.
        """
        lanes_m, ways_m = lanes_m[self.counts(lanes_m)], ways_m[self.counts(ways_m)]
        pieces = self._after_quads(lanes_m, self.radius_m)
        by_lanes = subtract_legs(pieces, lanes_m, self.radius_m)
        by_all = subtract_legs(np.array(by_lanes, dtype=object), ways_m, self.radius_m)
        return total_area(by_lanes), total_area(by_all)

    def counts(self, legs_m: FloatArray) -> BoolArray:
        """Return (n,) which legs of (n, 2, 2), sweep frame, count as coverage."""
        if self._beside is None or len(legs_m) == 0:
            return np.ones(len(legs_m), dtype=bool)
        return ~shapely.covers(self._beside, leg_lines(legs_m))

    def _after_quads(self, legs_m: FloatArray, reach_m: float) -> npt.NDArray[np.object_]:
        """Subtract the rectangles beside the lanes: ends, corners and slivers remain."""
        along = legs_m[:, 1] - legs_m[:, 0]
        # a long leg along the strips; its strip is the one that holds its middle
        lane = np.abs(along[:, 1]) > np.maximum(2 * self.radius_m, 10 * np.abs(along[:, 0]))
        quads = leg_quads(legs_m[lane], reach_m)
        middle_x = legs_m[lane].mean(axis=1)[:, 0]
        strip_of = np.searchsorted(self._borders, middle_x, side="right") - 1
        strip_of = np.clip(strip_of, 0, len(self._strips) - 1)
        # each part of a strip with the rectangles that touch it alone: strips grow long with lanes
        parts, part_strip = shapely.get_parts(self._strips, return_index=True)
        part_index, quad_index = shapely.STRtree(quads).query(parts)
        own = part_strip[part_index] == strip_of[quad_index]
        part_index, quad_index = part_index[own], quad_index[own]
        order = np.lexsort((quad_index, part_index))
        part_index, quad_index = part_index[order], quad_index[order]
        first = np.searchsorted(part_index, np.arange(len(parts) + 1))
        rest = parts.copy()
        turn = 0
        alive = np.flatnonzero(np.diff(first) > 0)
        while len(alive):
            rest[alive] = shapely.difference(rest[alive], quads[quad_index[first[alive] + turn]])
            turn += 1
            alive = alive[first[alive] + turn < first[alive + 1]]
        return np.array(_polygons(rest), dtype=object)


def subtract_legs(
    pieces: npt.NDArray[np.object_], legs_m: FloatArray, radius_m: float
) -> list[shapely.Polygon]:
    """Return what is left of each piece beyond `radius_m` of every leg of (n, 2, 2)."""
    if len(pieces) == 0 or len(legs_m) == 0:
        return list(pieces)
    lines = leg_lines(legs_m)  # a line of no length is near nothing
    tree = shapely.STRtree(lines)
    piece_index, leg_index = tree.query(pieces, predicate="dwithin", distance=radius_m)
    left = ~_covered_by_one(pieces, legs_m, radius_m, piece_index, leg_index)
    if not left.any():
        return []
    of_left = left[piece_index]
    piece_index = (np.cumsum(left) - 1)[piece_index[of_left]]
    leg_index, pieces = leg_index[of_left], pieces[left]
    used = np.unique(leg_index)
    buffers = np.empty(len(legs_m), dtype=object)
    buffers[used] = leg_buffers(legs_m[used], radius_m)
    # the nearest leg covers most of a piece, and often all: nearest first, all pieces at once
    centre = shapely.centroid(pieces)
    far = shapely.distance(lines[leg_index], centre[piece_index])
    order: IntArray = np.lexsort((leg_index, far, piece_index))
    piece_index, leg_index = piece_index[order], leg_index[order]
    first = np.searchsorted(piece_index, np.arange(len(pieces) + 1))
    rest = pieces.copy()
    alive = np.flatnonzero(np.diff(first) > 0)
    turn = 0
    while len(alive):
        rest[alive] = shapely.difference(rest[alive], buffers[leg_index[first[alive] + turn]])
        turn += 1
        more = first[alive] + turn < first[alive + 1]
        alive = alive[more & ~shapely.is_empty(rest[alive])]
    return _polygons(rest)


def _covered_by_one(
    pieces: npt.NDArray[np.object_],
    legs_m: FloatArray,
    radius_m: float,
    piece_index: IntArray,
    leg_index: IntArray,
) -> BoolArray:
    """Return (n,) which pieces lie within `radius_m` of a single leg, of those that touch them.

    What is within a radius of a leg is convex: a piece lies in it where its corners do.
    """
    count = shapely.get_num_coordinates(pieces)
    corner = shapely.get_coordinates(pieces)
    first = np.cumsum(count) - count
    out = np.zeros(len(pieces), dtype=bool)
    for pairs in np.array_split(np.arange(len(piece_index)), 1 + len(piece_index) // PAIRS):
        piece, leg = piece_index[pairs], leg_index[pairs]
        size = count[piece]
        start = np.cumsum(size) - size
        pair = np.repeat(np.arange(len(piece)), size)
        at = corner[np.arange(len(pair)) + (first[piece] - start)[pair]] - legs_m[leg, 0][pair]
        step = (legs_m[leg, 1] - legs_m[leg, 0])[pair]
        square = np.maximum((step * step).sum(axis=1), 1e-300)
        share = np.clip((at * step).sum(axis=1) / square, 0.0, 1.0)
        away = np.hypot(*(at - share[:, None] * step).T)
        out[piece[np.maximum.reduceat(away, start) <= WITHIN * radius_m]] = True
    return out

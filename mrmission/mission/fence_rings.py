"""Fence rings in the plane, within a budget: the path inside, the land outside, if it can be.

The shore and the islands are shortened ring by ring, cheapest move first, under a hard constraint:
no move cuts off water within the margin of the path (see :mod:`mrmission.mission.ring_kernel`).
A shorter ring either gives up water away from the path, which is nearly free, or takes land in,
which costs its area. Every ring's cost at every length is then known, and the budget's bytes go
where they save most.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import shapely
from shapely.geometry.polygon import orient

from mrmission.errors import InfeasibleError
from mrmission.mission.fence_walls import grid_over, ring_edges, walls_of
from mrmission.mission.fence_water import (
    part_with_path,
    path_segments,
    surroundings,
    water_with_path,
)
from mrmission.mission.ring_kernel import replay, shorten_ring
from mrmission.mission.ring_search import improve_rings
from mrmission.model import FloatArray, IntArray
from mrmission.options import VehicleLimits

WATER_WEIGHT = 1e-3
"""Cost of a square metre of water given up, against 1 for a square metre of land taken in."""
TOUCH_M = 0.3
"""The fence keeps at least this distance from the path, onto land where the shore is nearer."""
MIN_MARGIN_M = 0.05
HAZARD_M2 = 1000.0
"""What leaving out an island beside a lane costs on top of its area; falls with its distance."""
HAZARD_REACH_M = 10.0
SURROUND_M = 60.0
"""Where the whole shore does not fit, the fence of a robot reaches this far beyond its path."""
SEARCH_LOOKS = 60_000
"""Edges that the local search may look at, which bounds its time."""
CLEAR_M = 0.03
"""What rounding to 1e-7 degrees may take from the distance, and more."""
ISLANDS_TRIED = 2
"""Islands that get a second chance after the search, nearest to the path first."""
MIN_TRIED_SHARE = 0.01
"""... if they are at least this share of all the land inside."""
MOST_NEW_POINTS = 4
"""Points of such a late exclusion; the search shares them out anew."""
PLACE_M2 = 1.0
"""Pieces of land smaller than this are counted, but not listed."""


@dataclass(frozen=True, slots=True, kw_only=True)
class RingFit:
    """A fence and what it cost.

    ``inclusion`` and each of ``exclusions`` are (n, 2) arrays in the frame of the input, not
    closed. ``land_m2`` is the land inside the fence, left-out islands included;
    ``land_places_m`` lists its pieces as (area in m², x, y), largest first.
    ``islands_left_out_m`` lists islands inside the fence without an exclusion of their own as
    (area in m², x, y), nearest to the path first.
    """

    inclusion: FloatArray
    exclusions: tuple[FloatArray, ...]
    land_m2: float
    land_places_m: tuple[tuple[float, float, float], ...]
    islands_left_out_m: tuple[tuple[float, float, float], ...]
    points: int
    bytes_used: int


def fit_hull(
    water_m: shapely.Polygon,
    given_m: Sequence[shapely.Geometry],
    margin_m: float,
    limits: VehicleLimits,
) -> RingFit:
    """Return the plainest fence: the hull of everything given, by the margin, no exclusions."""
    hull = shapely.union_all([shapely.convex_hull(g) for g in given_m]).convex_hull
    shell = shapely.buffer(hull, max(margin_m, 1.0), quad_segs=2)
    points = shapely.get_coordinates(shell)[:-1]
    most = min(limits.fence_polygon_points, (limits.fence_bytes - 2) // 8)
    if len(points) > most:
        points = shapely.get_coordinates(shapely.minimum_rotated_rectangle(shell))[:-1]
    shell = shapely.Polygon(points)
    land = shapely.difference(shell, water_m)
    pieces = sorted((p for p in shapely.get_parts(land) if p.area > 0), key=lambda p: -p.area)
    inner = [(p, p.representative_point()) for p in pieces]
    islands = [shapely.Polygon(ring) for ring in water_m.interiors]
    held = [p for p in islands if shell.intersection(p).area > p.area / 2]
    return RingFit(
        inclusion=points,
        exclusions=(),
        land_m2=float(land.area),
        land_places_m=tuple((p.area, at.x, at.y) for p, at in inner),
        islands_left_out_m=tuple((p.area, p.centroid.x, p.centroid.y) for p in held),
        points=len(points),
        bytes_used=limits.fence_bytes_of(len(points)),
    )


@dataclass(frozen=True, slots=True)
class _Ring:
    """One ring with its moves. ``steps`` are (points dropped, cost) on the lower convex hull."""

    ring: FloatArray
    moves: IntArray
    values: FloatArray
    cost: FloatArray
    """Cumulative cost after k moves, k = 0..len(moves)."""
    first: int
    """Moves that must be made to stay within the largest polygon."""
    hull: tuple[int, ...]
    """Rising numbers of moves between which the cost per point rises."""


def fit_rings(
    water_m: shapely.Polygon,
    path_m: Sequence[shapely.Geometry],
    margin_m: float,
    limits: VehicleLimits,
) -> RingFit:
    """Fit an inclusion polygon and island exclusions around a path, within the vehicle's budget.

    The path never leaves the fence nor touches it: it keeps `margin_m` from the fence where the
    shore leaves room, and where the shore is nearer, the shore's distance, but at least 0.3 m.
    Land is taken in only where the budget leaves no choice. Where not all islands fit, those that
    the path passes nearest come first.

    Parameters
    ----------
    water_m
        The survey area, one polygon with islands as holes. Any plane will do: fence edges and legs
        are straight in it.
    path_m
        What must stay inside: lines and points with the margin, polygons (launch circles, clipped
        to the water) without.
    margin_m
        Distance kept from the fence, m.
    limits
        The vehicle's fence store.

    Returns
    -------
    RingFit

    Raises
    ------
    InfeasibleError
        When not even the simplest fence around the path fits.
    """
    margin_m = max(margin_m, MIN_MARGIN_M)
    touch_m = min(TOUCH_M, margin_m)
    path, need, reach = path_segments(path_m, margin_m, touch_m)
    # a collection, not a union: noding a path that crosses itself often takes seconds
    shown = shapely.geometrycollections([shapely.force_2d(g) for g in path_m])
    lines = shapely.multilinestrings(
        [s for s, d in zip(path.reshape(-1, 2, 2), need, strict=True) if d == margin_m]
    )
    water = water_with_path(water_m, lines, touch_m)
    best = _fit(water_m, water, shown, path, need, reach, limits)
    whole = best is not None and best[0] < PLACE_M2
    if not whole:
        reach_m = max(SURROUND_M, 10 * margin_m)
        near = shapely.intersection(water, surroundings(path, reach_m))
        part = part_with_path(near, shown)
        # gaps between the legs are open water; only the islands in them count
        shell = shapely.Polygon(part.exterior)
        shapely.prepare(shell)
        holes = [r for r in water.interiors if shapely.intersects(shell, shapely.Polygon(r))]
        other = _fit(
            water_m, shapely.Polygon(part.exterior, holes), shown, path, need, reach, limits
        )
        if best is None or (other is not None and other[0] < best[0]):
            best = other
    if best is not None and best[1].land_m2 >= PLACE_M2:
        search = _Search.of(water_m, water, shown, path_m, margin_m, limits)
        best = _improved(best, search, path, need, reach)
    if best is None:
        raise InfeasibleError(
            f"no fence around the path fits into {limits.fence_bytes} bytes with "
            f"{limits.fence_polygon_points} points in a polygon: use --no-fence, a vehicle with "
            "larger fence storage, or a larger --clearance"
        )
    return best[1]


@dataclass(frozen=True, slots=True)
class _Search:
    """What the local search of one fence needs, again and again."""

    water_m: shapely.Polygon
    water: shapely.Polygon
    shown: Any
    lines: tuple[shapely.Geometry, ...]
    middle: FloatArray
    walls: FloatArray
    grid: FloatArray
    shore: FloatArray
    limits: VehicleLimits

    @classmethod
    def of(
        cls,
        water_m: shapely.Polygon,
        water: shapely.Polygon,
        shown: Any,
        path_m: Sequence[shapely.Geometry],
        margin_m: float,
        limits: VehicleLimits,
    ) -> _Search:
        walls = walls_of(water, path_m, margin_m)
        # near the origin numbers are small and their products exact enough
        middle = shapely.get_coordinates(shown)[0]
        four = np.concatenate([middle, middle])
        return cls(
            water_m,
            water,
            shown,
            tuple(g for g in path_m if g.geom_type not in ("Polygon", "MultiPolygon")),
            middle,
            walls - four,
            grid_over(walls - four),
            ring_edges(orient(water_m)) - four,
            limits,
        )

    def improved(self, rings: Sequence[FloatArray]) -> tuple[float, RingFit] | None:
        """Return the fence that a local search makes of an inclusion and exclusions."""
        rings = [_turned(r, 1.0 if i == 0 else -1.0) for i, r in enumerate(rings)]
        shells = [shapely.Polygon(r) for r in rings]
        # an exclusion that sticks out of the inclusion would gain land that is not inside
        fixed = [False, *(not shells[0].contains_properly(e) for e in shells[1:])]
        limits = self.limits
        used = sum(limits.fence_bytes_of(len(r)) for r in rings)
        per_point = limits.fence_bytes_of(1) - limits.fence_bytes_of(0)
        points, number = improve_rings(
            np.ascontiguousarray(np.vstack(rings) - self.middle),
            np.repeat(np.arange(len(rings)), [len(r) for r in rings]),
            np.array(fixed),
            (limits.fence_bytes - used) // per_point,
            limits.fence_polygon_points,
            self.walls,
            self.grid,
            self.shore,
            np.zeros(2),
            WATER_WEIGHT,
            SEARCH_LOOKS,
        )
        rings = [points[number == i] + self.middle for i in range(len(rings))]
        shells = [shapely.Polygon(r) for r in rings]
        if not all(e.is_valid for e in shells):
            return None
        shapely.prepare(shells)
        if not all(shells[0].contains_properly(g) for g in self.lines):
            return None
        room = shapely.buffer(shells[0], 1e-6)
        kept = [g for g in shapely.get_parts(shapely.get_parts(self.shown)) if g.area > 0]
        if not all(room.covers(g) for g in kept):
            return None
        if any(e.intersection(g).area > 1e-6 for e in shells[1:] for g in kept):
            return None
        for exclusion, still in zip(shells[1:], fixed[1:], strict=True):
            if any(shapely.dwithin(exclusion, g, CLEAR_M) for g in self.lines):
                return None
            if not (still or shells[0].contains_properly(exclusion)):
                return None
        fit = _report(self.water_m, self.shown, rings[0], rings[1:], limits)
        return _cost(fit, self.shown), fit


def _improved(
    best: tuple[float, RingFit],
    search: _Search,
    path: FloatArray,
    need: FloatArray,
    reach: FloatArray,
) -> tuple[float, RingFit]:
    """Return the fence after a local search, with islands let in that turn out worth their points.

    An exclusion takes 26 bytes, three points of the shore and a bit: after the search the shore may
    do without them.
    """
    found = search.improved([best[1].inclusion, *best[1].exclusions])
    if found is not None and found[0] < best[0]:
        best = found
    islands = list(search.water.interiors)
    tree = shapely.STRtree([shapely.Polygon(r) for r in islands])
    limits = search.limits
    for area, x, y in best[1].islands_left_out_m[:ISLANDS_TRIED]:
        fit = best[1]
        if area < MIN_TRIED_SHARE * fit.land_m2:
            break
        (index,) = tree.query(shapely.Point(x, y), "within")[:1].tolist() or [-1]
        if index < 0:
            break
        hole = _shorten(
            _turned(shapely.get_coordinates(islands[index])[:-1], -1.0), path, need, reach, limits
        )
        least = len(hole.ring) - len(hole.moves)
        if least > MOST_NEW_POINTS:
            break
        new = _made(hole, len(hole.moves) - max(0, MOST_NEW_POINTS - least))
        shell = _shorten(_turned(fit.inclusion, 1.0), path, need, reach, limits)
        short = fit.bytes_used + limits.fence_bytes_of(len(new)) - limits.fence_bytes
        gone = max(0, -(-short // (limits.fence_bytes_of(1) - limits.fence_bytes_of(0))))
        if gone > len(shell.moves):
            break
        found = search.improved([_made(shell, gone), *fit.exclusions, new])
        # a farther one never comes before a nearer one
        if found is None or found[0] >= best[0]:
            break
        best = found
    return best


def _turned(ring: FloatArray, sign: float) -> FloatArray:
    """Return a ring in counter-clockwise (1) or clockwise (-1) order."""
    x, y = (ring - ring[0]).T
    area = float(np.dot(x, np.roll(y, -1)) - np.dot(np.roll(x, -1), y))
    return ring if area * sign > 0 else ring[::-1]


def _cost(fit: RingFit, shown: Any) -> float:
    """Return the land of a fence and the hazard of the islands that it leaves out, m²."""
    hazard = sum(
        HAZARD_M2 * HAZARD_REACH_M / (HAZARD_REACH_M + shapely.distance(shown, shapely.Point(x, y)))
        for _, x, y in fit.islands_left_out_m
    )
    return float(fit.land_m2 + hazard)


def _fit(
    water_m: shapely.Polygon,
    water: shapely.Polygon,
    shown: Any,
    path: FloatArray,
    need: FloatArray,
    reach: FloatArray,
    limits: VehicleLimits,
) -> tuple[float, RingFit] | None:
    """Fit a fence to `water`; return its cost and itself, or None where it does not fit."""
    water = orient(water)
    if not limits.fence_polygon_points >= 3:
        return None
    overhead = limits.fence_bytes_of(0)
    per_point = limits.fence_bytes_of(1) - overhead
    holes = list(water.interiors)
    filled = shapely.polygons(holes) if holes else np.array([])
    distance = shapely.distance(shown, filled) if holes else np.array([])
    order = np.argsort(distance, kind="stable")
    most = max(0, (limits.fence_bytes - 2 * overhead - 3 * per_point) // (overhead + 3 * per_point))

    def shorten(ring: Any) -> _Ring:
        return _shorten(shapely.get_coordinates(ring)[:-1], path, need, reach, limits)

    shell = shorten(water.exterior)
    islands = [shorten(holes[i]) for i in order[:most]]
    left_out_cost = filled_area = shapely.area(filled) if holes else np.zeros(0)
    if holes:
        left_out_cost = filled_area + HAZARD_M2 * HAZARD_REACH_M / (HAZARD_REACH_M + distance)

    # how many islands, nearest first: every number is tried, each with its best shares
    best: tuple[float, int, list[int]] | None = None
    for count in range(len(islands) + 1):
        shares = _share([shell, *islands[:count]], limits)
        if shares is None:
            break
        cost = shares[0] + float(left_out_cost[order[count:]].sum())
        if best is None or cost < best[0]:
            best = (cost, count, shares[1])
    if best is None:
        return None
    _, count, made = best
    inclusion = _made(shell, made[0])
    # an island that lies beyond the inclusion needs no exclusion: give its points to the others
    inside = shapely.Polygon(inclusion)
    shapely.prepare(inside)
    wanted = [
        i for i in range(count) if shapely.intersects(inside, shapely.Polygon(islands[i].ring))
    ]
    if len(wanted) < count:
        shares = _share([shell, *(islands[i] for i in wanted)], limits)
        if shares is not None:
            made = shares[1]
            inclusion = _made(shell, made[0])
    exclusions = [_made(islands[i], k) for i, k in zip(wanted, made[1:], strict=True)]
    fit = _report(water_m, shown, inclusion, exclusions, limits)
    return _cost(fit, shown), fit


def _shorten(
    ring: FloatArray, path: FloatArray, need: FloatArray, reach: FloatArray, limits: VehicleLimits
) -> _Ring:
    points = np.ascontiguousarray(ring, dtype=float)
    moves, values = shorten_ring(points, path, need, reach, WATER_WEIGHT)
    cost = np.concatenate([[0.0], np.cumsum(values[:, 2])])
    first = max(0, len(points) - limits.fence_polygon_points)
    hull: list[int] = []
    for k in range(first, len(cost)):
        while len(hull) > 1 and (cost[k] - cost[hull[-1]]) * (hull[-1] - hull[-2]) <= (
            cost[hull[-1]] - cost[hull[-2]]
        ) * (k - hull[-1]):
            hull.pop()
        hull.append(k)
    return _Ring(points, moves, values, cost, first, tuple(hull))


def _share(rings: Sequence[_Ring], limits: VehicleLimits) -> tuple[float, list[int]] | None:
    """Share the budget: return the cost and the number of moves of each ring, None if too small."""
    if any(not r.hull for r in rings):
        return None
    overhead = limits.fence_bytes_of(0)
    per_point = limits.fence_bytes_of(1) - overhead
    room = (limits.fence_bytes - overhead * len(rings)) // per_point
    excess = sum(len(r.ring) - r.first for r in rings) - room
    made = [r.first for r in rings]
    # steps of all rings, cheapest per point first; within a ring they are in order by the hull
    steps = sorted(
        ((r.cost[j] - r.cost[i]) / (j - i), index, i, j)
        for index, r in enumerate(rings)
        for i, j in zip(r.hull[:-1], r.hull[1:], strict=True)
    )
    for _, index, i, j in steps:
        if excess <= 0:
            break
        made[index] = min(j, i + excess)
        excess -= made[index] - i
    if excess > 0:
        return None
    return float(sum(r.cost[k] for r, k in zip(rings, made, strict=True))), made


def _made(ring: _Ring, count: int) -> FloatArray:
    return replay(ring.ring, ring.moves, ring.values, count)


def _report(
    water_m: shapely.Polygon,
    shown: Any,
    inclusion: FloatArray,
    exclusions: Sequence[FloatArray],
    limits: VehicleLimits,
) -> RingFit:
    """Measure a fence against the true water."""
    inside = shapely.Polygon(inclusion)
    kept_out = [shapely.Polygon(e) for e in exclusions]
    allowed = shapely.difference(inside, shapely.union_all(kept_out)) if kept_out else inside
    land = shapely.difference(allowed, water_m)
    places = []
    for piece in shapely.get_parts(land):
        if piece.area >= PLACE_M2:
            at = shapely.point_on_surface(piece)
            places.append((float(piece.area), float(at.x), float(at.y)))
    islands = shapely.polygons(list(water_m.interiors)) if water_m.interiors else np.array([])
    left_out = []
    for i in np.sort(shapely.STRtree(islands).query(inside, "intersects")).tolist():
        fenced = shapely.intersection(islands[i], inside).area
        # an exclusion may cover a neighbour too, and an island may lie half beyond the inclusion
        if (
            fenced > 0.5 * islands[i].area
            and shapely.intersection(islands[i], allowed).area > 0.5 * fenced
        ):
            at = shapely.point_on_surface(islands[i])
            away = float(shapely.distance(shown, islands[i]))
            left_out.append((away, (float(islands[i].area), float(at.x), float(at.y))))
    sizes = [len(inclusion), *map(len, exclusions)]
    return RingFit(
        inclusion=inclusion,
        exclusions=tuple(exclusions),
        land_m2=float(land.area),
        land_places_m=tuple(sorted(places, reverse=True)),
        islands_left_out_m=tuple(row for _, row in sorted(left_out)),
        points=sum(sizes),
        bytes_used=sum(map(limits.fence_bytes_of, sizes)),
    )

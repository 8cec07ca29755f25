"""Ways in the water that keep off the berths where other boats wait."""

from __future__ import annotations

import copy
from collections.abc import Sequence

import numpy as np
import shapely

from mrmission import libm
from mrmission.model import FloatArray
from mrmission.routing.bends import straighten
from mrmission.routing.shore_grid import Int
from mrmission.routing.water import Near, WaterRouter

KEEP_OFF_M = 5.0
"""Radius around a berth that transits of other robots stay out of, where the water allows it."""
_CORNERS = 12


class Harbour:
    """In-water paths of a fleet: around the land and around each other's berths.

    A disc around each berth is land to every transit, and the robot whose berth it is leaves and
    enters its disc in a straight line. A disc that would touch the shore, or cut the region
    in two, is made smaller, and left out when even a fifth of it does not fit.

    Parameters
    ----------
    region
        The navigable region, connected, local frame.
    berths_m
        (k, 2) homes of the robots, inside the region.
    """

    def __init__(self, region: shapely.Polygon, berths_m: FloatArray) -> None:
        self.region = region
        self.berths_m = berths_m
        self.radius_m = self._fitting_radii(region, berths_m)
        discs = [self.disc(i) for i in range(len(berths_m)) if self.radius_m[i] > 0]
        free = shapely.difference(region, shapely.union_all(discs)) if discs else region
        if free.geom_type != "Polygon" or free.area < 0.5 * region.area:
            self.radius_m = np.zeros(len(berths_m))
            free = region
        self.router = WaterRouter(free)
        self._rimmed: dict[float, shapely.Geometry] = {}

    def shared(self, berths: Sequence[int]) -> Harbour:
        """Return the same water for robots that share berths: robot ``i`` lives at ``berths[i]``.

        That is what the trips of one robot are, each a robot of its own.
        """
        other = copy.copy(self)
        other.berths_m = self.berths_m[list(berths)]
        other.radius_m = self.radius_m[list(berths)]
        return other

    @staticmethod
    def _fitting_radii(region: shapely.Polygon, berths_m: FloatArray) -> FloatArray:
        shore = shapely.distance(region.boundary, shapely.points(berths_m))
        gap = np.full(len(berths_m), np.inf)
        if len(berths_m) > 1:
            offset = np.hypot(*(berths_m[:, None] - berths_m[None]).transpose(2, 0, 1))
            np.fill_diagonal(offset, np.inf)
            gap = offset.min(axis=1)
        radius = np.minimum(np.minimum(KEEP_OFF_M, gap / 3), shore - 0.5)
        # one berth alone needs no disc: nobody else can pass it
        return np.where((radius >= KEEP_OFF_M / 5) & (len(berths_m) > 1), radius, 0.0)

    def _disc_corners(self, robot: int) -> FloatArray:
        angle = 2 * np.pi * np.arange(_CORNERS) / _CORNERS
        circle = np.column_stack([libm.cos(angle), libm.sin(angle)])
        return self.berths_m[robot] + self.radius_m[robot] * circle

    def rimmed(self, margin_m: float) -> shapely.Geometry:
        """Return the region with a rim around it, prepared; made once for all robots."""
        if margin_m not in self._rimmed:
            wider = shapely.buffer(self.region, margin_m, join_style="mitre")
            shapely.prepare(wider)
            self._rimmed[margin_m] = wider
        return self._rimmed[margin_m]

    def disc(self, robot: int) -> shapely.Polygon:
        """Return the disc about the berth of robot `robot` (from 0) that others keep out of."""
        return shapely.Polygon(self._disc_corners(robot))

    def _outside(self, points_m: FloatArray) -> FloatArray:
        """Move points that lie inside a disc out to its rim; the others stay."""
        out = np.array(points_m, dtype=np.float64)
        for i in np.flatnonzero(self.radius_m):
            near = np.hypot(*(out - self.berths_m[i]).T) < self.radius_m[i]
            if not near.any():
                continue
            disc = self.disc(int(i))
            inside = near & shapely.contains_xy(disc, out[:, 0], out[:, 1])
            rim = shapely.shortest_line(disc.exterior, shapely.points(out[inside]))
            out[inside] = shapely.get_coordinates(rim).reshape(-1, 2, 2)[:, 0]
        return out

    def distances(self, sources_m: FloatArray, targets_m: FloatArray) -> FloatArray:
        """Return (s, t) in-water lengths between all of (s, 2) and all of (t, 2)."""
        return self.router.distances(self._outside(sources_m), self._outside(targets_m))

    def distance_matrix(self, points_m: FloatArray) -> FloatArray:
        """Return (n, n) symmetric in-water lengths between all of (n, 2)."""
        return self.router.distance_matrix(self._outside(points_m))

    def lengths_within(
        self, points_m: FloatArray, reach_m: FloatArray, least: int
    ) -> tuple[Near, FloatArray]:
        """Return the points within reach of each, see :meth:`WaterRouter.lengths_within`."""
        return self.router.lengths_within(self._outside(points_m), reach_m, least)

    def last_corners(self, points_m: FloatArray) -> tuple[FloatArray, Int, FloatArray]:
        """Return lengths between all of (n, 2) and last bends, see `WaterRouter.last_corners`."""
        return self.router.last_corners(self._outside(points_m))

    def pair_distances(self, a_m: FloatArray, b_m: FloatArray) -> FloatArray:
        """Return (n,) in-water lengths between the pairs of two (n, 2) arrays."""
        if len(a_m) == 0:
            return np.zeros(0)
        return self.router.pair_distances(self._outside(a_m), self._outside(b_m))

    def shortest_paths(self, a_m: FloatArray, b_m: FloatArray) -> list[FloatArray]:
        """Return the shortest ways between the pairs of two (n, 2) arrays, with all their bends."""
        if len(a_m) == 0:
            return []
        return self.router.paths(self._outside(a_m), self._outside(b_m))

    def paths(self, a_m: FloatArray, b_m: FloatArray) -> list[FloatArray]:
        """Return ways between the pairs of two (n, 2) arrays, ends as given.

        They are the shortest ways, with runs of small bends drawn together into single corners.
        """
        if len(a_m) == 0:
            return []
        # from a place to itself there is no way to the rim of a disc and back
        out = [np.array([a, b]) for a, b in zip(a_m, b_m, strict=True)]
        apart = np.flatnonzero(np.any(a_m != b_m, axis=1))
        ways = self.router.paths(self._outside(a_m[apart]), self._outside(b_m[apart]))
        ways = straighten(ways, self.router.visible)
        for i, path in zip(apart.tolist(), ways, strict=True):
            out[i] = _with_ends(a_m[i], path, b_m[i])
        return out

    def home_paths(self, robots: Sequence[int], targets_m: FloatArray) -> list[FloatArray]:
        """Return the path from each robot's berth to its target of (n, 2)."""
        plain = [i for i, robot in enumerate(robots) if self.radius_m[robot] == 0]
        out: dict[int, FloatArray] = {}
        if plain:
            homes = self.berths_m[[robots[i] for i in plain]]
            out.update(zip(plain, self.paths(homes, targets_m[plain]), strict=True))
        for robot in sorted(set(robots)):
            home = self.berths_m[robot]
            mine = [i for i, r in enumerate(robots) if r == robot and i not in out]
            within = np.hypot(*(targets_m[mine] - home).T) <= self.radius_m[robot]
            out.update(
                (mine[j], np.array([home, targets_m[mine[j]]])) for j in np.flatnonzero(within)
            )
            beyond = [mine[j] for j in np.flatnonzero(~within)]
            if not beyond:
                continue
            exits = self._disc_corners(robot)
            way = self.distances(exits, targets_m[beyond]) + np.hypot(*(exits - home).T)[:, None]
            paths = self.paths(exits[np.argmin(way, axis=0)], targets_m[beyond])
            out.update(zip(beyond, self._leave_straight(robot, home, paths), strict=True))
        return [out[i] for i in range(len(robots))]

    def _leave_straight(
        self, robot: int, home: FloatArray, paths: Sequence[FloatArray]
    ) -> list[FloatArray]:
        """Drop the points of paths that the berth sees over the rim of its own disc."""
        start = np.concatenate([[0], np.cumsum([len(path) for path in paths])])
        points = np.concatenate(paths)
        step = points - home
        reach = np.hypot(step[:, 0], step[:, 1])
        seen = reach > self.radius_m[robot]
        seen[start[:-1]] = False  # where the path leaves the disc
        rim = home + step[seen] * (self.radius_m[robot] * 1.001 / reach[seen])[:, None]
        seen[seen] = self.router.visible(rim, points[seen])
        out = []
        for path, a, b in zip(paths, start[:-1], start[1:], strict=True):
            last = np.flatnonzero(seen[a:b])[-1:]
            out.append(np.vstack([home, path[last[0] :] if len(last) else path]))
        return out


def _with_ends(a: FloatArray, path: FloatArray, b: FloatArray) -> FloatArray:
    """Return a path that starts and ends at the very points asked for."""
    inner = path[1:-1]
    head = path[:1] if np.hypot(*(path[0] - a)) > 0.05 else path[:0]
    tail = path[-1:] if np.hypot(*(path[-1] - b)) > 0.05 else path[:0]
    return np.vstack([a, head, inner, tail, b])

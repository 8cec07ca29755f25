"""The water of one robot: all of it but the berths of the others."""

from __future__ import annotations

import numpy as np
import shapely

from mrmission.model import BoolArray, FloatArray
from mrmission.routing.harbour import Harbour

TOUCH_M = 1e-5
"""A point may lie this far outside: rounding, not travel."""


class BerthWater:
    """Tells which ways of a robot stay in the water and out of the berths of others.

    Parameters
    ----------
    harbour
        Ways in the water, with the berths that others keep off.
    berth
        Index of the robot's own berth, whose disc it may cross.
    """

    def __init__(self, harbour: Harbour, berth: int) -> None:
        self.harbour = harbour
        self.berth = berth
        self._others: shapely.Geometry | None = None
        self._region = harbour.rimmed(TOUCH_M)

    def clear(self, lines_m: FloatArray) -> BoolArray:
        """Return (n,) whether polylines (n, m, 2) stay in the water; repeated points are none."""
        a, b = lines_m[:, :-1], lines_m[:, 1:]
        moving = np.any(a != b, axis=2)
        seen: BoolArray = np.ones(moving.shape, dtype=np.bool_)
        seen[moving] = self.harbour.router.visible(a[moving], b[moving])
        radius = float(self.harbour.radius_m[self.berth])
        if radius > 0 and not seen.all():
            blocked = np.argwhere(~seen)
            legs = shapely.linestrings(np.stack([a[~seen], b[~seen]], axis=1))
            home = shapely.Point(self.harbour.berths_m[self.berth])
            near = shapely.dwithin(legs, home, radius + TOUCH_M)
            free = np.zeros(len(legs), dtype=np.bool_)
            free[near] = shapely.covers(self._region, legs[near])
            free[near] &= ~shapely.intersects(self._other_berths(), legs[near])
            seen[tuple(blocked[free].T)] = True
        # the router takes points within its snap for points of the shore
        inside = shapely.contains_xy(self._region, lines_m[..., 0], lines_m[..., 1])
        return np.asarray(seen.all(axis=1) & inside.all(axis=1))

    def _other_berths(self) -> shapely.Geometry:
        """Return the discs around the berths of the others, less what touching takes."""
        if self._others is None:
            berths = self.harbour.berths_m
            away = np.any(berths != berths[self.berth], axis=1)  # trips of one robot share one
            others = np.flatnonzero((self.harbour.radius_m > 0) & away)
            discs = [self.harbour.disc(int(i)) for i in others]
            self._others = shapely.buffer(shapely.union_all(discs), -TOUCH_M)
            shapely.prepare(self._others)
        return self._others

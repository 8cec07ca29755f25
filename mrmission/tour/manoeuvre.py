"""Ways in the water between poses, for a vehicle that turns no tighter than a radius.

A manoeuvre is a chain of Dubins ways, drawn as polylines; a polyline counts only when every leg of
it stays in the water. Between two ends the cheapest single way is looked for first, for many pairs
of ends at once; where none is in the water, or a way must bend around land or pass given places,
the cheapest chain over layers of poses.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from mrmission.model import FloatArray, IntArray
from mrmission.routing.berth_water import BerthWater
from mrmission.routing.harbour import Harbour
from mrmission.tour.dubins import bend_limit_rad, dubins_polylines, dubins_words

TOLERANCE_M = 1.0
"""Corners of the polyline about an arc lie this far outside it at most, or a WP_RADIUS."""
MAX_SKIP = 4
"""A way may leave out this many bends of the shortest way less one."""
MOST_WORDS = 4
"""Of the six ways between two poses in a chain the longest are not looked at."""
FAR_RADII = 8.0
"""Poses farther apart than this are joined only where they see each other."""
_AT_ONCE = 8
_MOST_TRIED = 160
_CHUNK = 512
_SAME_M = 1e-6


@dataclass(frozen=True, slots=True, kw_only=True)
class Choices:
    """Poses from which one is to be taken, and what each costs beside the ways to and from it.

    Attributes
    ----------
    poses
        (n, 3) east, north, m, heading, radians.
    cost_m
        (n,) metres.
    required
        Whether a way must pass here; else the layer may be left out.
    """

    poses: FloatArray
    cost_m: FloatArray
    required: bool = True


class Waters(BerthWater):
    """The water of one robot that turns at a radius.

    Parameters
    ----------
    harbour
        Ways in the water, with the berths that others keep off.
    berth
        Index of the robot's own berth, whose disc it may cross.
    radius_m
        Least radius of a turn.
    wp_radius_m
        The vehicle's WP_RADIUS: legs along arcs are at least twice as long where they can be.
    """

    def __init__(self, harbour: Harbour, berth: int, radius_m: float, wp_radius_m: float) -> None:
        super().__init__(harbour, berth)
        self.hopeless: set[bytes] = set()  # gaps that were found to have no way through
        self.radius_m = radius_m
        self.max_bend_rad = bend_limit_rad(
            radius_m, max(TOLERANCE_M, wp_radius_m), 2.0 * wp_radius_m
        )

    def ways(self, start: FloatArray, goal: FloatArray) -> tuple[FloatArray, IntArray, FloatArray]:
        """Return length (infinite: none), word and pieces of the shortest ways in the water.

        Parameters
        ----------
        start, goal
            (n, 3) poses.
        """
        pieces = dubins_words(start, goal, self.radius_m)
        length = self.radius_m * pieces.sum(axis=2)
        order = np.argsort(length, axis=1, kind="stable")
        n = len(start)
        cost, word = np.full(n, np.inf), np.zeros(n, dtype=np.int64)
        todo = np.arange(n)
        for rank in range(MOST_WORDS):
            w = order[todo, rank]
            there = np.isfinite(length[todo, w])
            todo, w = todo[there], w[there]
            if not len(todo):
                break
            good = self.clear(self.lines(start[todo], goal[todo], w, pieces[todo, w]))
            cost[todo[good]] = length[todo[good], w[good]]
            word[todo[good]] = w[good]
            todo = todo[~good]
        return cost, word, pieces[np.arange(n), word]

    def lines(
        self, start: FloatArray, goal: FloatArray, word: IntArray, pieces: FloatArray
    ) -> FloatArray:
        """Return ways as polylines, (n, m, 2)."""
        return dubins_polylines(start, goal, word, pieces, self.radius_m, self.max_bend_rad)


def single_ways(
    waters: Waters, starts: Sequence[Choices], goals: Sequence[Choices]
) -> list[FloatArray | None]:
    """Return for each pair of ends the cheapest single way in the water, or None.

    Parameters
    ----------
    waters
        Where the vehicle may go.
    starts, goals
        The poses from which and to which each way may lead.

    Returns
    -------
    list
        Polylines (m, 2) from the pose that is left to the pose that is reached.
    """
    out: list[FloatArray | None] = []
    for first in range(0, len(starts), _CHUNK):
        out.extend(_singles(waters, starts[first : first + _CHUNK], goals[first : first + _CHUNK]))
    return out


def _singles(
    waters: Waters, starts: Sequence[Choices], goals: Sequence[Choices]
) -> list[FloatArray | None]:
    # all pairs of choices of all ends, one after the other
    pair, left, right = [], [], []
    for i, (start, goal) in enumerate(zip(starts, goals, strict=True)):
        a, b = np.divmod(np.arange(len(start.poses) * len(goal.poses)), len(goal.poses))
        pair.append(np.full(len(a), i))
        left.append(np.column_stack([start.poses[a], start.cost_m[a]]))
        right.append(np.column_stack([goal.poses[b], goal.cost_m[b]]))
    found: list[FloatArray | None] = [None] * len(starts)
    if not starts:
        return found
    of = np.concatenate(pair)
    a_poses, b_poses = np.concatenate(left), np.concatenate(right)
    pieces = dubins_words(a_poses[:, :3], b_poses[:, :3], waters.radius_m)
    cost = waters.radius_m * pieces.sum(axis=2) + (a_poses[:, 3] + b_poses[:, 3])[:, None]
    row, word = np.nonzero(np.isfinite(cost))
    order = np.lexsort((cost[row, word], of[row]))
    row, word = row[order], word[order]
    begin = np.searchsorted(of[row], np.arange(len(starts) + 1))
    todo = np.arange(len(starts))
    for step in range(0, _MOST_TRIED, _AT_ONCE):
        tries = begin[todo, None] + step + np.arange(_AT_ONCE)[None]
        there = tries < begin[todo + 1][:, None]
        if not there.any():
            break
        at = tries[there]
        r, w = row[at], word[at]
        lines = waters.lines(a_poses[r, :3], b_poses[r, :3], w, pieces[r, w])
        good = np.zeros(there.shape, dtype=np.bool_)
        good[there] = waters.clear(lines)
        place = np.cumsum(there.ravel()).reshape(there.shape) - 1
        hit = good.any(axis=1)
        best = good.argmax(axis=1)
        for j in np.flatnonzero(hit):
            found[todo[j]] = _apart(lines[place[j, best[j]]])
        todo = todo[~hit]
        if not len(todo):
            break
    return found


def chain(waters: Waters, layers: Sequence[Choices]) -> FloatArray | None:
    """Return the cheapest chain of ways in the water over layers of poses, or None.

    Parameters
    ----------
    waters
        Where the vehicle may go.
    layers
        From the first to the last one pose of each; layers that are not required may be left out,
        :data:`MAX_SKIP` - 1 in a row.
    """
    cost: list[FloatArray] = [layers[0].cost_m]
    back: list[list[tuple[int, int, FloatArray]]] = [[]]
    for j in range(1, len(layers)):
        here = layers[j]
        best = np.full(len(here.poses), np.inf)
        came: list[tuple[int, int, FloatArray]] = [(-1, -1, np.zeros((0, 2)))] * len(here.poses)
        for i in range(j - 1, max(-1, j - 1 - MAX_SKIP), -1):
            open_ = np.flatnonzero(np.isfinite(cost[i]))
            if len(open_) and len(here.poses):
                _extend(waters, layers[i], open_, cost[i], here, i, best, came)
            if layers[i].required:
                break
        cost.append(best)
        back.append(came)
    if not len(cost[-1]) or not np.isfinite(cost[-1]).any():
        return None
    j, at = len(layers) - 1, int(np.argmin(cost[-1]))
    parts: list[FloatArray] = []
    while j > 0:
        i, before, line = back[j][at]
        parts.append(line[1:] if i > 0 else line)
        j, at = i, before
    return np.concatenate(parts[::-1])


def _extend(
    waters: Waters,
    layer: Choices,
    open_: IntArray,
    cost: FloatArray,
    here: Choices,
    index: int,
    best: FloatArray,
    came: list[tuple[int, int, FloatArray]],
) -> None:
    """Enter into `best` and `came` what ways from an earlier layer better."""
    a = np.repeat(open_, len(here.poses))
    b = np.tile(np.arange(len(here.poses)), len(open_))
    start, goal = layer.poses[a], here.poses[b]
    # a straight line is the least: what cannot better anything need not be looked for
    apart = np.hypot(*(goal - start)[:, :2].T)
    worth = cost[a] + apart + here.cost_m[b] < best[b]
    # a long way is straight for the most part
    far = worth & (apart > FAR_RADII * waters.radius_m)
    worth[far] = waters.harbour.router.visible(start[far, :2], goal[far, :2])
    a, b, start, goal = a[worth], b[worth], start[worth], goal[worth]
    if not len(a):
        return
    length, word, pieces = waters.ways(start, goal)
    total = cost[a] + length + here.cost_m[b]
    order = np.lexsort((a, total, b))
    first = order[np.append(True, np.diff(b[order]) != 0)]
    first = first[total[first] < best[b[first]]]
    lines = waters.lines(start[first], goal[first], word[first], pieces[first])
    for k, line in zip(first.tolist(), lines, strict=True):
        best[b[k]] = total[k]
        came[b[k]] = (index, int(a[k]), _apart(line))


def _apart(line: FloatArray) -> FloatArray:
    """Return a polyline without points that rounding alone keeps apart; its ends stay exact."""
    step = np.hypot(*np.diff(line, axis=0).T)
    inner = line[1:-1][(step[:-1] > _SAME_M) & (np.hypot(*(line[1:-1] - line[-1]).T) > _SAME_M)]
    return np.vstack([line[:1], inner, line[-1:]])

"""Shortest ways of a vehicle that only goes forward and turns no tighter than a radius.

Such a way between two poses is made of three pieces, arcs of the radius and straight lines, in one
of six orders ("words"): LSL, RSR, LSR, RSL, RLR, LRL. All six are priced in closed form for many
pairs of poses at once; a way becomes a polyline of few points that is drawn about its arcs.

References
----------
L. E. Dubins, "On curves of minimal length with a constraint on average curvature", American
Journal of Mathematics 79(3), 1957.
A. M. Shkel, V. Lumelsky, "Classification of the Dubins set", Robotics and Autonomous Systems
34(4), 2001 (the closed forms).
"""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt

from mrmission import libm
from mrmission.model import FloatArray, IntArray

WORDS = ("LSL", "RSR", "LSR", "RSL", "RLR", "LRL")
MAX_BEND_DEG = 60.0
"""No corner of a polyline about an arc is sharper."""
_TURN = 2.0 * math.pi
_NONE_RAD = 1e-7
"""Shorter arcs are none; an arc that lacks so little of a whole turn is rounding, and none too."""
_SIDES: npt.NDArray[np.int8] = np.array(
    [[{"L": 1, "S": 0, "R": -1}[c] for c in word] for word in WORDS], dtype=np.int8
)


def pose(points_m: FloatArray, heading_rad: FloatArray | float) -> FloatArray:
    """Return (n, 3) poses of (n, 2) points and headings, radians from east towards north."""
    points = np.reshape(np.asarray(points_m, dtype=np.float64), (-1, 2))
    heading = np.broadcast_to(np.asarray(heading_rad, dtype=np.float64), len(points))
    return np.column_stack([points, heading])


def dubins_words(start: FloatArray, goal: FloatArray, radius_m: float) -> FloatArray:
    """Return the three pieces of each of the six words between pairs of poses.

    Parameters
    ----------
    start, goal
        (n, 3) east, north, m, and heading, radians from east towards north.
    radius_m
        Least radius of a turn, above 0.

    Returns
    -------
    FloatArray
        (n, 6, 3) lengths of the pieces in units of the radius, in the order of :data:`WORDS`;
        infinite where a word does not join the two. A piece of an arc is its angle, radians.
    """
    start, goal = np.reshape(start, (-1, 3)), np.reshape(goal, (-1, 3))
    step = (goal[:, :2] - start[:, :2]) / radius_m
    d = np.hypot(step[:, 0], step[:, 1])
    theta = libm.arctan2(step[:, 1], step[:, 0])
    a, b = start[:, 2] - theta, goal[:, 2] - theta
    sa, ca, sb, cb = libm.sin(a), libm.cos(a), libm.sin(b), libm.cos(b)
    cab = libm.cos(a - b)
    out = np.full((len(d), len(WORDS), 3), np.inf)

    def enter(word: int, first: FloatArray, middle: FloatArray, last: FloatArray) -> None:
        fits = np.isfinite(middle)
        out[fits, word, 0] = _angle(first[fits])
        out[fits, word, 1] = middle[fits]
        out[fits, word, 2] = _angle(last[fits])

    def root(square: FloatArray) -> FloatArray:
        # rounding may take a straight piece of no length below nothing
        return np.sqrt(np.where(square > -1e-12, np.maximum(square, 0.0), np.nan))

    tangent = libm.arctan2(cb - ca, d + sa - sb)
    enter(0, tangent - a, root(2 + d * d - 2 * cab + 2 * d * (sa - sb)), b - tangent)
    tangent = libm.arctan2(ca - cb, d - sa + sb)
    enter(1, a - tangent, root(2 + d * d - 2 * cab + 2 * d * (sb - sa)), tangent - b)
    p = root(d * d - 2 + 2 * cab + 2 * d * (sa + sb))
    tangent = libm.arctan2(-ca - cb, d + sa + sb) - libm.arctan2(-2.0, p)
    enter(2, tangent - a, p, tangent - b)
    p = root(d * d - 2 + 2 * cab - 2 * d * (sa + sb))
    tangent = libm.arctan2(ca + cb, d - sa - sb) - libm.arctan2(2.0, p)
    enter(3, a - tangent, p, b - tangent)
    for word, side in ((4, 1.0), (5, -1.0)):
        cosine = (6 - d * d + 2 * cab + side * 2 * d * (sa - sb)) / 8
        p = _TURN - libm.arccos(np.where(np.abs(cosine) <= 1, cosine, np.nan))
        t = side * a - libm.arctan2(ca - cb, d - side * (sa - sb)) + p / 2
        enter(word, t, p, side * (a - b) - t + p)
    return out


def _angle(angle_rad: FloatArray) -> FloatArray:
    """Return angles from 0 to a whole turn, which itself is 0."""
    out = np.mod(angle_rad, _TURN)
    return np.where(out > _TURN - _NONE_RAD, 0.0, out)


def dubins_lengths(start: FloatArray, goal: FloatArray, radius_m: float) -> FloatArray:
    """Return (n,) lengths, m, of the shortest ways between pairs of (n, 3) poses.

    >>> dubins_lengths(np.array([[0.0, 0.0, 0.0]]), np.array([[0.0, 20.0, np.pi]]), 10.0).round(3)
    array([31.416])
    """
    pieces = dubins_words(start, goal, radius_m)
    return radius_m * pieces.sum(axis=2).min(axis=1)


def bend_limit_rad(radius_m: float, tolerance_m: float, shortest_m: float = 0.0) -> float:
    """Return the largest corner of a polyline drawn about an arc.

    The corners lie up to `tolerance_m` outside the arc, and the legs between them are
    `shortest_m` long at least where both can be had; :data:`MAX_BEND_DEG` holds before either.
    """
    by_tolerance = 2.0 * math.acos(radius_m / (radius_m + tolerance_m))
    by_length = 2.0 * math.atan(shortest_m / (2.0 * radius_m))
    return min(max(by_tolerance, by_length), math.radians(MAX_BEND_DEG))


def dubins_polylines(
    start: FloatArray,
    goal: FloatArray,
    word: IntArray,
    pieces: FloatArray,
    radius_m: float,
    max_bend_rad: float,
) -> FloatArray:
    """Return the ways as polylines drawn about their arcs: every leg touches the way.

    So a polyline leaves its first point and reaches its last in the very headings of the poses,
    has corners of one angle along an arc, and the arc fits into them with its own radius.

    Parameters
    ----------
    start, goal
        (n, 3) poses.
    word
        (n,) index into :data:`WORDS`.
    pieces
        (n, 3) of that word, as :func:`dubins_words` returns them.
    radius_m
        Of the arcs.
    max_bend_rad
        Largest corner, see :func:`bend_limit_rad`.

    Returns
    -------
    FloatArray
        (n, m, 2) points; polylines with fewer repeat points.
    """
    start, goal = np.reshape(start, (-1, 3)), np.reshape(goal, (-1, 3))
    n = len(start)
    pieces = _arcs_joined(word, pieces)
    at, heading = start[:, :2].copy(), start[:, 2].copy()
    out = [at[:, None]]
    for k in range(3):
        side = _SIDES[word, k].astype(np.float64)
        size = pieces[:, k]
        turn = side * size
        count = np.where(np.abs(turn) > _NONE_RAD, np.ceil(np.abs(turn) / max_bend_rad), 0)
        most = int(count.max(initial=0))
        normal = np.column_stack([-libm.sin(heading), libm.cos(heading)])
        centre = at + side[:, None] * radius_m * normal
        if most:
            bend = turn / np.maximum(count, 1)
            # corners stand over the middles of equal shares of the arc; the last one is repeated
            share = np.minimum(np.arange(most)[None], np.maximum(count - 1, 0)[:, None]) + 0.5
            angle = heading[:, None] - side[:, None] * (math.pi / 2) + share * bend[:, None]
            reach = radius_m / libm.cos(bend / 2)
            ring = reach[:, None, None] * np.stack([libm.cos(angle), libm.sin(angle)], axis=2)
            corner = centre[:, None] + ring
            straight = count == 0
            corner[straight] = at[straight, None]  # on the line, as if it were not there
            out.append(corner)
        ahead = np.column_stack([libm.cos(heading), libm.sin(heading)])
        on_line = side == 0
        heading = heading + turn
        after = np.column_stack([-libm.sin(heading), libm.cos(heading)])
        on_arc = centre - side[:, None] * radius_m * after
        moved = at + (radius_m * size)[:, None] * ahead
        at = np.where(on_line[:, None], moved, on_arc)
    out.append(np.broadcast_to(goal[:, None, :2], (n, 1, 2)))
    return np.concatenate(out, axis=1)


def _arcs_joined(word: IntArray, pieces: FloatArray) -> FloatArray:
    """Return the pieces with two arcs to one side and nothing between them as one arc."""
    same = (_SIDES[word, 0] == _SIDES[word, 2]) & (_SIDES[word, 1] == 0) & (pieces[:, 1] < 1e-9)
    out = pieces.copy()
    out[same, 0] += out[same, 2]
    out[same, 2] = 0.0
    return out

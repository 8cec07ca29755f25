"""Reversals made gentle: a boat with a rudder swings widest where it turns back on its way.

At a corner near 180 degrees such a boat leaves its way by several metres, at two corners of 90 by
one or so (docs/time-model.md). So a corner beyond :data:`REVERSAL_DEG` gets one or two more points
beside it, where the water has room for them: out to the side, and from there on to where the way
went. All lanes stay as they are; a leg that sweeps goes another way only where the leg before it
has swept the same.
"""

from __future__ import annotations

import numpy as np

from mrmission import libm
from mrmission.model import CoveragePath, FloatArray, LegKind
from mrmission.routing.berth_water import BerthWater
from mrmission.tour.path import make_path
from mrmission.tour.timing import TimeModel, turns_deg

REVERSAL_DEG = 150.0
"""From here on a corner counts as a reversal."""
GENTLE_DEG = 136.0
"""What it is replaced by has no sharper corner; up to 135 degrees the swing is small."""
ASIDE_M = (5.0, 7.0, 10.0, 14.0)
"""How far to the side; shorter legs than 5 m cost more time than they save."""
ASIDE_DEG = (60.0, 75.0, 90.0, 105.0, 120.0, 135.0)
_ROUNDS = 3
_ON_LEG_M = 1e-6


def reversals(path: CoveragePath) -> list[int]:
    """Return the points of a path at which it turns by :data:`REVERSAL_DEG` or more."""
    if len(path.points_m) < 3:
        return []
    turn = turns_deg(np.diff(path.points_m, axis=0))
    return (np.flatnonzero(turn >= REVERSAL_DEG) + 1).tolist()


def avoid_reversals(
    path: CoveragePath, water: BerthWater, time: TimeModel, clearance_m: float
) -> CoveragePath:
    """Return the path with reversals replaced by gentler corners where the water has room.

    Parameters
    ----------
    path
        From home to home.
    water
        Of the path's robot.
    time
        What corners cost, and how wide the robot swings at them.
    clearance_m
        A reversal with a swing up to this is replaced only where that costs no time.
    """
    for _ in range(_ROUNDS):
        found = _detours(path, water, time, clearance_m)
        if not found:
            break
        path = _with_detours(path, found)
    return path


def _detours(
    path: CoveragePath, water: BerthWater, time: TimeModel, clearance_m: float
) -> dict[int, FloatArray]:
    """Return for legs of a path the points that are put into them."""
    points, survey = path.points_m, np.asarray(path.kind) == LegKind.SURVEY
    out: dict[int, FloatArray] = {}
    busy = -1
    for i in reversals(path):
        if i <= busy:  # its corner has changed already
            continue
        before, after = points[max(0, i - 2) : i][::-1], points[i + 1 : i + 3]
        best: tuple[float, int, FloatArray] | None = None
        both = bool(survey[i - 1] and survey[i])
        if not survey[i] or (both and _on_leg(points[i + 1], points[i], points[i - 1])):
            best = _best(points[i], before, after, water, time, i)
        if not survey[i - 1] or (both and _on_leg(points[i - 1], points[i], points[i + 1])):
            other = _best(points[i], after, before, water, time, i - 1)
            if other is not None and (best is None or other[0] < best[0]):
                best = (other[0], other[1], other[2][::-1])
        if best is None:
            continue
        extra_s, leg, added = best
        turn = turns_deg(np.diff(points[i - 1 : i + 2], axis=0))
        swing = float(np.interp(turn[0], time.survey.angle_deg, time.survey.swing_m))
        if extra_s <= 0 or swing > clearance_m:
            out[leg] = added
            busy = i + 1
    return out


def _on_leg(at: FloatArray, a: FloatArray, b: FloatArray) -> bool:
    """Return whether a point lies on the leg from a to b."""
    step = b - a
    size = float(np.hypot(*step))
    along = float((at - a) @ step) / size
    off = abs(float(step[0] * (at - a)[1] - step[1] * (at - a)[0])) / size
    return off <= _ON_LEG_M and -_ON_LEG_M <= along <= size + _ON_LEG_M


def _best(
    at: FloatArray,
    before: FloatArray,
    after: FloatArray,
    water: BerthWater,
    time: TimeModel,
    leg: int,
) -> tuple[float, int, FloatArray] | None:
    """Return the extra seconds, the leg and the points of the quickest detour behind a corner.

    Parameters
    ----------
    at
        The corner.
    before, after
        Up to two points before it, backwards, and up to two behind it.
    water, time
        As above.
    leg
        The leg from the corner on.
    """
    come = at - before[0]
    heading = libm.arctan2(come[1], come[0])
    side, angle, far = (
        x.ravel() for x in np.meshgrid((1.0, -1.0), np.radians(ASIDE_DEG), ASIDE_M, indexing="ij")
    )
    out = at + far[:, None] * _unit(heading + side * angle)
    # one point beside the corner, or from there on back beside the way on which it came
    side, square, along = (
        x.ravel() for x in np.meshgrid((1.0, -1.0), ASIDE_M, ASIDE_M, indexing="ij")
    )
    first = at + square[:, None] * _unit(heading + side * np.pi / 2)
    second = first - along[:, None] * _unit(np.full(len(first), heading))
    inner = np.concatenate([np.stack([out, out], axis=1), np.stack([first, second], axis=1)])

    def lay(points: FloatArray) -> FloatArray:
        return np.broadcast_to(points, (len(inner), *points.shape))

    ways = np.concatenate([lay(before[::-1]), lay(at[None]), inner, lay(after)], axis=1)
    turn = _turns(ways)
    gentle = (turn <= GENTLE_DEG).all(axis=1)
    # corners beyond the detour may be sharp already, if they were
    was = np.concatenate([before[::-1], at[None], after])
    old = turns_deg(np.diff(was, axis=0))
    if len(after) > 1 and old[-1] > GENTLE_DEG:
        gentle = (turn[:, :-1] <= GENTLE_DEG).all(axis=1) & (turn[:, -1] <= old[-1])
    if len(before) > 1 and old[0] > GENTLE_DEG:
        gentle = (turn[:, 1:] <= GENTLE_DEG).all(axis=1)
    ways, inner, turn = ways[gentle], inner[gentle], turn[gentle]
    if not len(ways):
        return None
    start = len(before)
    free = water.clear(ways[:, start : start + 4])
    ways, inner, turn = ways[free], inner[free], turn[free]
    if not len(ways):
        return None
    seconds = _seconds(ways, turn, time)
    k = int(np.argmin(seconds))
    extra = float(seconds[k] - _seconds(was[None], old[None], time)[0])
    added = inner[k, :1] if (inner[k, 0] == inner[k, 1]).all() else inner[k]
    return extra, leg, added


def _unit(heading_rad: FloatArray) -> FloatArray:
    return np.stack([libm.cos(heading_rad), libm.sin(heading_rad)], axis=-1)


def _turns(ways: FloatArray) -> FloatArray:
    """Return (n, m - 2) changes of course, degrees, of (n, m, 2); 0 at a repeated point."""
    leg = np.diff(ways, axis=1)
    still = (leg == 0).all(axis=2)
    heading = libm.arctan2(leg[..., 1], leg[..., 0])
    for j in range(1, heading.shape[1]):  # a leg of no length goes on as the one before
        heading[:, j] = np.where(still[:, j], heading[:, j - 1], heading[:, j])
    return np.degrees(np.abs((np.diff(heading, axis=1) + np.pi) % (2 * np.pi) - np.pi))


def _seconds(ways: FloatArray, turn: FloatArray, time: TimeModel) -> FloatArray:
    """Return (n,) seconds of ways: lengths, corners, and short legs between them."""
    length = np.hypot(*np.moveaxis(np.diff(ways, axis=1), 2, 0))
    curves = time.transit
    corner = np.interp(turn, curves.angle_deg, curves.corner_s)
    inner = length[:, 1:-1]
    # of a row of short legs the first costs most: the shortest stands for it
    short = np.where(inner > 0, np.interp(inner, curves.leg_m, curves.first_s), 0.0)
    total = length.sum(axis=1) / time.transit_speed_m_s + corner.sum(axis=1)
    return np.asarray(total + (short.max(axis=1) if short.shape[1] else 0.0))


def _with_detours(path: CoveragePath, found: dict[int, FloatArray]) -> CoveragePath:
    """Return the path with points put into legs; they are of the leg's kind."""
    points: list[FloatArray] = [path.points_m[:1]]
    kinds: list[int] = []
    lanes: list[int] = []
    for i in range(len(path.kind)):
        added = found.get(i, np.zeros((0, 2)))
        points.extend([added, path.points_m[i + 1 : i + 2]])
        kinds.extend([int(path.kind[i])] * (len(added) + 1))
        lanes.extend([int(path.lane[i])] * (len(added) + 1))
    return make_path(path.robot, np.concatenate(points), kinds, lanes)

"""Run-ins and run-outs: lanes lengthened at both ends, so that the turns lie outside them."""

from __future__ import annotations

import numpy as np
import shapely

from mrmission.model import BoolArray, CoveragePath, FloatArray, IntArray, LegKind
from mrmission.tour.path import make_path

SHORTEST_M = 0.5
"""Shorter run-ins are left out: they are less than a vehicle's acceptance radius."""
AIM_M = 1.0
"""A shorter leg, a remainder that will be merged with the next, does not say where a run goes."""
TOUCH_M = 1e-6
"""A leg may lie this far outside the region: rounding, not travel."""


def with_turnarounds(
    path: CoveragePath,
    run_in_m: float,
    region: shapely.Geometry | None,
    run_out_m: float | None = None,
) -> CoveragePath:
    """Return the path with a straight run-in before and a run-out after every stretch of lanes.

    The transit to a lane then ends, and the one from it begins, at the outer end of its run. What
    lies between is as it was, so the new path stays within the longer run of the old one. Lanes
    that follow on each other without a transit are one stretch; a lane that begins or ends at home
    has no run there.

    Parameters
    ----------
    path : CoveragePath
        From home to home.
    run_in_m : float
        Length of a run before a lane.
    region : Polygon or MultiPolygon, optional
        What must not be left, local frame: runs are then cut to what lies inside, and left out
        where they are too short or where the transit could not follow. None lets all through: a
        copter flies over the shore.
    run_out_m : float, optional
        Length of a run after a lane; as long as one before it if not given.

    Returns
    -------
    CoveragePath
        Runs are transits (lane 0).
    """
    kind = np.asarray(path.kind)
    survey = kind == LegKind.SURVEY
    run_out_m = run_in_m if run_out_m is None else run_out_m
    if max(run_in_m, run_out_m) <= 0 or not survey.any():
        return path
    points = path.points_m
    last = len(kind) - 1
    # first and last leg of each stretch; (m,) indices of legs
    heads, tails = _stretches(survey)
    heads, tails = heads[heads > 0], tails[tails < last]
    # the point at which each run touches its lane, and the one where it meets the transit
    at = np.concatenate([heads, tails + 1])
    inner = points[at]
    leg = np.diff(points, axis=0)
    first = [_straight(leg, survey, i, 1) for i in heads.tolist()]
    final = [_straight(leg, survey, i, -1) for i in tails.tolist()]
    along = np.concatenate([-leg[first], leg[final]]) if first or final else np.zeros((0, 2))
    along = along / np.hypot(along[:, 0], along[:, 1])[:, None]
    run_m = np.repeat([run_in_m, run_out_m], [len(heads), len(tails)])
    outer = inner + run_m[:, None] * along
    if region is not None:
        outer = _inside(inner, outer, region)
    keep = np.hypot(*(outer - inner).T) >= SHORTEST_M
    moved = dict(zip(at[keep].tolist(), outer[keep], strict=True))
    if region is not None:
        moved = _passable(points, survey, moved, region)

    out: list[FloatArray] = [points[:1]]
    kinds: list[int] = []
    lanes: list[int] = []

    def go(point: FloatArray, leg_kind: int, lane: int) -> None:
        out.append(point[None])
        kinds.append(leg_kind)
        lanes.append(lane)

    for i in range(len(kind)):
        end = i + 1
        if survey[i]:
            go(points[end], int(kind[i]), int(path.lane[i]))
            # a run-out follows the last lane of its stretch
            if end in moved and not survey[end]:
                go(moved[end], LegKind.TRANSIT, 0)
        elif end in moved:
            go(moved[end], LegKind.TRANSIT, 0)
            go(points[end], LegKind.TRANSIT, 0)
        else:
            go(points[end], int(kind[i]), int(path.lane[i]))
    return make_path(path.robot, np.concatenate(out), kinds, lanes)


def whole_runs(path: CoveragePath, run_in_m: float, run_out_m: float) -> tuple[int, int, int]:
    """Return how many stretches of lanes have a whole run-in, a whole run-out, and how many are.

    Parameters
    ----------
    path
        From home to home, with runs.
    run_in_m, run_out_m
        What is asked for; none of 0 m is ever short.
    """
    leg = np.diff(path.points_m, axis=0)
    length = np.hypot(leg[:, 0], leg[:, 1])
    survey = np.asarray(path.kind) == LegKind.SURVEY
    heads, tails = _stretches(survey)

    def straight_m(lane: int, run: int) -> float:
        """Return the length of a leg beside a stretch if it goes straight on, else 0."""
        if not 0 <= run < len(leg):
            return 0.0
        on = float(leg[lane] @ leg[run])
        return float(length[run]) if on > (1 - 1e-9) * length[lane] * length[run] else 0.0

    enough_in, enough_out = 0.99 * run_in_m, 0.99 * run_out_m
    return (
        sum(straight_m(i, i - 1) >= enough_in for i in heads.tolist()),
        sum(straight_m(i, i + 1) >= enough_out for i in tails.tolist()),
        len(heads),
    )


def outer_ends(
    ends_m: FloatArray, away: FloatArray, run_m: float, region: shapely.Geometry | None
) -> FloatArray:
    """Return the (n, 2) outer ends of runs from the ends of lines, for the planner's costs.

    Parameters
    ----------
    ends_m : (n, 2) array, m
    away : (n, 2) array
        Unit vectors that point out of the lines at these ends.
    run_m : float
        Length of a run.
    region : Polygon or MultiPolygon, optional
        What must not be left; a run that is too short there is none.
    """
    outer = ends_m + run_m * away
    if region is not None and len(ends_m):
        outer = _inside(ends_m, outer, region)
    short = np.hypot(*(outer - ends_m).T) < SHORTEST_M
    return np.where(short[:, None], ends_m, outer)


def _stretches(survey: BoolArray) -> tuple[IntArray, IntArray]:
    """Return the first and the last leg of each stretch of lanes."""
    return (
        np.flatnonzero(survey & ~np.append(False, survey[:-1])),
        np.flatnonzero(survey & ~np.append(survey[1:], False)),
    )


def _straight(leg: FloatArray, survey: BoolArray, index: int, step: int) -> int:
    """Return the first leg from the end of a stretch inwards that is long enough to aim by."""
    at = index
    while 0 <= at < len(leg) and survey[at]:
        if np.hypot(*leg[at]) >= AIM_M:
            return at
        at += step
    return index


def _inside(inner: FloatArray, outer: FloatArray, region: shapely.Geometry) -> FloatArray:
    """Return how far each run can go from its lane before it leaves the region, (m, 2)."""
    runs = shapely.linestrings(np.stack([inner, outer], axis=1))
    out = inner.copy()
    for i, part in enumerate(shapely.intersection(runs, region)):
        for line in shapely.get_parts(part):
            ends = shapely.get_coordinates(line)
            away = np.hypot(*(ends - inner[i]).T)
            if len(ends) > 1 and away.min() <= 1e-3:
                out[i] = ends[int(np.argmax(away))]
    return out


def _passable(
    points: FloatArray, survey: BoolArray, moved: dict[int, FloatArray], region: shapely.Geometry
) -> dict[int, FloatArray]:
    """Drop the runs whose transit would leave the region on its way to or from their outer end."""
    wide = shapely.buffer(region, TOUCH_M)
    shapely.prepare(wide)
    legs = [i for i in range(len(survey)) if not survey[i] and (i in moved or i + 1 in moved)]
    while True:
        ends = np.array([[moved.get(i, points[i]), moved.get(i + 1, points[i + 1])] for i in legs])
        if not legs:
            return moved
        bad = np.flatnonzero(~shapely.covers(wide, shapely.linestrings(ends)))
        dropped = {j for i in bad.tolist() for j in (legs[i], legs[i] + 1) if j in moved}
        if not dropped:
            return moved
        moved = {j: point for j, point in moved.items() if j not in dropped}
        legs = [i for i in legs if i in moved or i + 1 in moved]

"""What lines leave uncovered beside their ends, and the short hooks that cover it.

A lane ends where it meets the shore at its own place across. Where the shore runs slantwise, a
sliver beside the lane's end lies beyond the footprints of both neighbours: at every other lane end,
about. A turn that follows the shore covers such a sliver for nothing, so whether it has to be
visited depends on where the vehicle goes from there. A hook is the point, or the few points, by
which a turn must go to cover what it would not cover by itself. Hooks are part of the ways between
lines, see :mod:`mrmission.minmax.ways`: the search weighs them as it weighs any other way.

What lies farther from all ends, a bay between two lanes, becomes a line of its own.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import shapely

from mrmission.model import FloatArray, IntArray
from mrmission.tour.lines import LineKind, SurveyLine, ends_of
from mrmission.tour.repair import REACH, pieces_to_repair, spine, viewpoints
from mrmission.tour.work import PartWork

HOOK_SWATHS = 1.0
"""A piece this many swaths from an end, and no longer than that, hangs on the end."""
SHORTEST_LINE_SWATHS = 0.1
"""A line of its own for a piece that is seen from one point is so long, where there is room."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Hooks:
    """Hooks by the ends they hang on, as lists one after the other.

    Attributes
    ----------
    of_end
        (ends + 1,) hooks ``of_end[e]`` to ``of_end[e + 1]`` hang on end ``e``.
    point_start, points_m
        (hooks + 1,), (p, 2): the points of each, the nearest to its end first.
    hull_start, hull_m
        (hooks + 1,), (q, 2): corners of the convex hull of what each is to cover. A leg that has
        all of them within `reach_m` covers it too.
    reach_m
        Half the swath, less what rounding may take.
    """

    of_end: IntArray
    point_start: IntArray
    points_m: FloatArray
    hull_start: IntArray
    hull_m: FloatArray
    reach_m: float

    def __len__(self) -> int:
        return len(self.point_start) - 1

    def of_ends(self, ends: IntArray) -> Hooks:
        """Return the hooks of some ends, which are then counted from 0 in this order."""
        chosen = _ranges(self.of_end, ends)
        return Hooks(
            of_end=_starts(np.diff(self.of_end)[ends]),
            point_start=_starts(np.diff(self.point_start)[chosen]),
            points_m=self.points_m[_ranges(self.point_start, chosen)],
            hull_start=_starts(np.diff(self.hull_start)[chosen]),
            hull_m=self.hull_m[_ranges(self.hull_start, chosen)],
            reach_m=self.reach_m,
        )


def find_hooks(work: PartWork) -> tuple[Hooks, tuple[SurveyLine, ...]]:
    """Return the hooks of a part's line ends, and the lines that cover what lies elsewhere.

    Returns
    -------
    hooks
        Of the ends of ``work.lines``, in their order.
    extra
        Lines to be swept as well.
    """
    frame, swath_m = work.sweep.frame, work.options.swath_m
    covering = [line for line in work.lines if line.counts_as_coverage]
    legs = np.concatenate(
        [np.stack([c.points_m[:-1], c.points_m[1:]], axis=1) for c in covering]
        or [np.zeros((0, 2, 2))]
    )
    pieces = work.uncovered.remainder(frame.to_sweep(legs))
    todo = pieces_to_repair(pieces, swath_m, work.region_m.area)
    ends = frame.to_sweep(ends_of(work.lines).reshape(-1, 2))
    # cross lines are no place to hang coverage on: they may be left out
    counted = np.repeat([line.counts_as_coverage for line in work.lines], 2)
    at = np.flatnonzero(counted)
    tree = shapely.STRtree(shapely.points(ends[at]))
    found: list[tuple[int, FloatArray, FloatArray]] = []
    lonely: list[FloatArray] = []
    for piece in todo:
        view = viewpoints(piece, work.uncovered)
        goal = piece if view.is_empty else view
        end = int(at[tree.query_nearest(goal, all_matches=False)[0]]) if len(at) else -1
        way = _way_from(ends[end] if end >= 0 else None, piece, view, work.uncovered.radius_m)
        if end >= 0 and _length_m(np.vstack([ends[end], way])) <= HOOK_SWATHS * swath_m:
            hull = shapely.get_coordinates(shapely.convex_hull(piece))[:-1]
            found.append((end, frame.to_local(way), frame.to_local(hull)))
        else:
            lonely.append(frame.to_local(_as_line(way, view, swath_m)))
    found, hidden = _in_sight(found, frame.to_local(ends), work)
    lonely.extend(frame.to_local(_as_line(frame.to_sweep(w), None, swath_m)) for w in hidden)
    extra = tuple(
        SurveyLine(points_m=around_land(points, work), kind=LineKind.EXTRA, name=f"X{i}")
        for i, points in enumerate(lonely, start=1)
    )
    return _listed(found, len(ends) + 2 * len(extra), work.uncovered.radius_m * REACH), extra


def no_hooks(ends: int) -> Hooks:
    """Return no hooks on any of so many ends."""
    return _listed([], ends, 0.0)


def _way_from(
    end: FloatArray | None,
    piece: shapely.Polygon,
    view: shapely.Geometry,
    radius_m: float,
) -> FloatArray:
    """Return the points (n, 2) to go by to see a whole piece, the nearest to `end` first."""
    if view.is_empty:
        points = spine(piece, radius_m)
        if end is not None and np.hypot(*(points[-1] - end)) < np.hypot(*(points[0] - end)):
            points = points[::-1]
        return points
    if end is None:
        return shapely.get_coordinates(view.representative_point())
    return shapely.get_coordinates(shapely.shortest_line(shapely.Point(end), view))[1:]


def _as_line(way: FloatArray, view: shapely.Geometry | None, swath_m: float) -> FloatArray:
    """Return a line of two points or more by a way that may be a single point."""
    if len(way) > 1:
        return way
    step = np.array([0.0, SHORTEST_LINE_SWATHS * swath_m])
    if view is not None and not view.is_empty:
        inner = shapely.get_coordinates(view.representative_point())[0]
        for end in (inner, way[0] + step, way[0] - step):
            line = np.array([way[0], end])
            if _length_m(line) > 0 and shapely.covers(view, shapely.LineString(line)):
                return line
    return np.array([way[0], way[0]])


def around_land(way: FloatArray, work: PartWork) -> FloatArray:
    """Return a line's corners with more where a leg between two of them would leave the region."""
    hidden = np.flatnonzero(~work.harbour.router.visible(way[:-1], way[1:]))
    around = work.harbour.paths(way[hidden], way[hidden + 1])
    out = [way[:1]]
    detour = dict(zip(hidden.tolist(), around, strict=True))
    out += [detour[i][1:] if i in detour else way[i + 1 : i + 2] for i in range(len(way) - 1)]
    return np.concatenate(out)


def _length_m(way: FloatArray) -> float:
    return float(np.hypot(*np.diff(way, axis=0).T).sum())


def _in_sight(
    found: Sequence[tuple[int, FloatArray, FloatArray]], ends_m: FloatArray, work: PartWork
) -> tuple[list[tuple[int, FloatArray, FloatArray]], list[FloatArray]]:
    """Return the hooks whose first point their end sees, and the ways of the others."""
    if not found:
        return [], []
    a = np.array([ends_m[end] for end, _, _ in found])
    b = np.array([way[0] for _, way, _ in found])
    sees = work.harbour.router.visible(a, b)
    kept = [hook for hook, ok in zip(found, sees, strict=True) if ok]
    return kept, [way for (_, way, _), ok in zip(found, sees, strict=True) if not ok]


def _listed(
    found: Sequence[tuple[int, FloatArray, FloatArray]], ends: int, reach_m: float
) -> Hooks:
    """Return hooks sorted by their end, nearest first, as lists one after the other."""
    ordered = sorted(found, key=lambda hook: (hook[0], hook[1].tolist()))
    none = np.zeros((0, 2))
    count = np.bincount(np.array([h[0] for h in ordered], dtype=np.int64), minlength=ends)
    return Hooks(
        of_end=_starts(count),
        point_start=_starts([len(h[1]) for h in ordered]),
        points_m=np.ascontiguousarray(np.concatenate([none, *(h[1] for h in ordered)])),
        hull_start=_starts([len(h[2]) for h in ordered]),
        hull_m=np.ascontiguousarray(np.concatenate([none, *(h[2] for h in ordered)])),
        reach_m=reach_m,
    )


def _starts(sizes: Sequence[int] | IntArray) -> IntArray:
    """Return where lists of these sizes begin, one after the other, and where the last ends."""
    return np.concatenate([[0], np.cumsum(sizes, dtype=np.int64)]).astype(np.int64)


def _ranges(start: IntArray, which: IntArray) -> IntArray:
    """Return what lies in some of the lists that begin at `start`, one after the other."""
    none = [np.zeros(0, dtype=np.int64)]
    return np.concatenate([*none, *(np.arange(start[i], start[i + 1]) for i in which.tolist())])

"""Complete means complete: extra survey legs for whatever the tours leave uncovered."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
import shapely

from mrmission.errors import PlanningError
from mrmission.model import CoveragePath, FloatArray, LegKind
from mrmission.routing.harbour import Harbour
from mrmission.tour.coverage import Uncovered, by_size, subtract_legs, total_area
from mrmission.tour.path import legs_of, make_path
from mrmission.tour.sweep import SweepFrame
from mrmission.tour.timing import TimeModel

PIECE_SHARE = 0.004
"""Pieces above this share of swath² are repaired; the promise is 0.01, rounding needs room."""
REMAINDER_SHARE = 1e-4
"""Above this share of the region in all, smaller pieces are repaired too."""
REACH = 0.995
"""Share of half the swath that an extra leg counts on."""
MAX_ROUNDS = 25
_CANDIDATES = 8
_DETOUR_S = 6.0


@dataclass(frozen=True, slots=True, kw_only=True)
class _Extra:
    """A way to cover one piece: a polyline (local frame) put into leg `leg` of the fleet."""

    leg: int
    enter_m: FloatArray
    line_m: FloatArray


def pieces_to_repair(
    pieces: Sequence[shapely.Polygon], swath_m: float, region_m2: float, *, final: bool = False
) -> list[shapely.Polygon]:
    """Return the pieces that must be covered for the sweep to count as complete.

    `final` allows twice as much, for the last look after rounding.
    """
    slack = 2.0 if final else 1.0
    big = slack * PIECE_SHARE * swath_m**2
    allowed = slack * REMAINDER_SHARE * region_m2
    chosen, rest = [], total_area(pieces)
    ordered = by_size(pieces)
    areas = shapely.area(np.array(ordered, dtype=object)).tolist()
    for piece, area in zip(ordered, areas, strict=True):
        if area <= big and rest <= allowed:
            break
        chosen.append(piece)
        rest -= area
    return chosen


def repair(
    paths: Sequence[CoveragePath],
    uncovered: Uncovered,
    frame: SweepFrame,
    harbour: Harbour,
    times: TimeModel | Sequence[TimeModel],
    swath_m: float,
    lanes_alone: bool = False,
) -> tuple[CoveragePath, ...]:
    """Return the paths with extra legs so that no piece above the limits stays uncovered.

    Each uncovered piece gets a point that sees all of it within the footprint, or a line along
    it, and goes to the leg of the robot where the detour costs least, robots that would become the
    longest counted dearer. A survey leg is left and met again at the same point, so nothing
    that it covers is lost. A transit is bent, which may uncover what it covered by the way:
    the caller looks again at the whole. With `lanes_alone` transits cover nothing, and one that
    is bent becomes a lane.

    Raises
    ------
    PlanningError
        When the rounds do not converge; names the largest piece.
    """
    paths = list(paths)
    times = [times] * len(paths) if isinstance(times, TimeModel) else times
    area = uncovered.region.area
    pieces = uncovered.remainder(fleet_legs(paths, frame, lanes_alone=lanes_alone))
    for _ in range(MAX_ROUNDS):
        todo = pieces_to_repair(pieces, swath_m, area)
        if not todo:
            return tuple(paths)
        extras = _choose(todo, paths, uncovered, frame, harbour, times, swath_m)
        paths, new_legs = _insert(paths, extras, harbour, lanes_alone)
        pieces = subtract_legs(
            np.array(pieces, dtype=object), frame.to_sweep(new_legs), uncovered.reach_m
        )
    worst = max(todo, key=lambda p: p.area)
    point = frame.to_local(shapely.get_coordinates(worst.representative_point()))[0]
    raise PlanningError(
        f"{len(todo)} pieces stay uncovered, the largest {worst.area:.1f} m² near "
        f"east {point[0]:.1f} m, north {point[1]:.1f} m: choose another --angle or --swath"
    )


def fleet_legs(
    paths: Sequence[CoveragePath], frame: SweepFrame, *, lanes_alone: bool = False
) -> FloatArray:
    """Return (n, 2, 2) legs of all paths, or of their lanes alone, sweep frame."""
    legs = np.concatenate([legs_of(p) for p in paths])
    if lanes_alone:
        legs = legs[np.concatenate([p.kind for p in paths]) == LegKind.SURVEY]
    return frame.to_sweep(legs)


def viewpoints(piece: shapely.Polygon, uncovered: Uncovered) -> shapely.Geometry:
    """Return where in the region a single point sees the whole piece; may be empty."""
    radius = uncovered.radius_m * REACH
    hull = shapely.get_coordinates(shapely.convex_hull(piece))[:-1]
    x_min, y_min, x_max, y_max = piece.bounds
    if max(x_max - x_min, y_max - y_min) > 2 * radius:
        return shapely.Polygon()
    seen = shapely.intersection_all(shapely.buffer(shapely.points(hull), radius, quad_segs=8))
    return seen if seen.is_empty else uncovered.clip(seen)


def spine(piece: shapely.Polygon, radius: float) -> FloatArray:
    """Return points through the middle of a long piece, no more than `radius` apart."""
    box = shapely.get_coordinates(shapely.minimum_rotated_rectangle(piece))
    if len(box) < 5:
        return shapely.get_coordinates(piece.representative_point())
    sides = np.diff(box[:3], axis=0)
    lengths = np.hypot(sides[:, 0], sides[:, 1])
    long = int(np.argmax(lengths))
    origin = box[long]
    along, across = sides[long], sides[1 - long] * (1 if long == 0 else -1)
    count = max(2, int(np.ceil(lengths[long] / radius)))
    at = (np.arange(count) + 0.5) / count
    foot = origin + at[:, None] * along - 0.01 * across
    cuts = shapely.linestrings(np.stack([foot, foot + 1.02 * across], axis=1))
    crossing = shapely.intersection(cuts, piece)
    out = []
    for cut in crossing:
        parts = [p for p in shapely.get_parts(cut) if p.geom_type == "LineString"]
        if parts:
            widest = max(parts, key=lambda p: p.length)
            out.append(shapely.get_coordinates(widest).mean(axis=0))
    if not out:
        return shapely.get_coordinates(piece.representative_point())
    return np.array(out)


def _choose(
    todo: Sequence[shapely.Polygon],
    paths: Sequence[CoveragePath],
    uncovered: Uncovered,
    frame: SweepFrame,
    harbour: Harbour,
    times: Sequence[TimeModel],
    swath_m: float,
) -> list[_Extra]:
    """Return for each piece the cheapest leg to leave for it, and the way to cover it."""
    legs = np.concatenate([legs_of(p) for p in paths])
    sweep_legs = frame.to_sweep(legs)
    kinds = np.concatenate([p.kind for p in paths])
    owner = np.concatenate([np.full(len(p.kind), i) for i, p in enumerate(paths)])
    # what is swept on the way along a line that is not counted stays uncovered: no leg to leave
    lines = np.where(uncovered.counts(sweep_legs), shapely.linestrings(sweep_legs), None)
    tree = shapely.STRtree(lines)
    loads = np.array(
        [time.duration_s(p.points_m, p.kind) for p, time in zip(paths, times, strict=True)]
    )

    options: list[tuple[int, int, FloatArray, FloatArray]] = []  # piece, leg, enter, line (sweep)
    for i, piece in enumerate(todo):
        view = viewpoints(piece, uncovered)
        goal = piece if view.is_empty else view
        way = spine(piece, uncovered.radius_m) if view.is_empty else None
        near = tree.query_nearest(goal, all_matches=False)
        reach = float(lines[near[0]].distance(goal)) + swath_m
        candidates = tree.query(goal, predicate="dwithin", distance=reach)
        gaps = shapely.distance(lines[candidates], goal)
        candidates = candidates[np.lexsort((candidates, gaps))][:_CANDIDATES]
        if way is None:
            joins = shapely.get_coordinates(shapely.shortest_line(lines[candidates], view))
            joins = joins.reshape(-1, 2, 2)
            inner = shapely.get_coordinates(piece.representative_point())
            sees_all = shapely.intersects(shapely.points(inner), view)[0]
            for leg, (enter, spot) in zip(candidates, joins, strict=True):
                options.append((i, int(leg), enter, spot[None]))
                if sees_all:
                    options.append((i, int(leg), enter, inner))
        else:
            for leg in candidates:
                head = shapely.points(way[0])
                enter = shapely.get_coordinates(shapely.shortest_line(lines[leg], head))[0]
                options.append((i, int(leg), enter, way))
                if len(way) > 1:
                    options.append((i, int(leg), enter, way[::-1]))

    leg_index = np.array([o[1] for o in options])
    enter = frame.to_local(np.array([o[2] for o in options]))
    head = frame.to_local(np.array([o[3][0] for o in options]))
    tail = frame.to_local(np.array([o[3][-1] for o in options]))
    survey = kinds[leg_index] == LegKind.SURVEY
    leave = np.where(survey[:, None], enter, legs[leg_index, 0])
    resume = np.where(survey[:, None], enter, legs[leg_index, 1])
    there = harbour.pair_distances(leave, head)
    back = harbour.pair_distances(tail, resume)
    spared = np.where(survey, 0.0, np.hypot(*(resume - leave).T))
    inside = np.array([np.hypot(*np.diff(o[3], axis=0).T).sum() for o in options])
    speed_m_s = np.array([time.survey_speed_m_s for time in times])[owner[leg_index]]
    extra_s = (there + back + inside - spared) / speed_m_s + _DETOUR_S

    out: list[_Extra] = []
    piece_of = np.array([o[0] for o in options])
    for i in range(len(todo)):
        mine = np.flatnonzero(piece_of == i)
        robot = owner[leg_index[mine]]
        over = np.maximum(0.0, loads[robot] + extra_s[mine] - loads.max())
        best = mine[int(np.argmin(extra_s[mine] + len(paths) * over))]
        loads[owner[leg_index[best]]] += extra_s[best]
        out.append(
            _Extra(
                leg=int(leg_index[best]),
                enter_m=enter[best],
                line_m=frame.to_local(options[best][3]),
            )
        )
    return out


def _insert(
    paths: Sequence[CoveragePath],
    extras: Sequence[_Extra],
    harbour: Harbour,
    lanes_alone: bool = False,
) -> tuple[list[CoveragePath], FloatArray]:
    """Put the extras into their legs, several in one leg in the order in which it passes them.

    Returns the paths, and the legs (n, 2, 2) that are new in them.
    """
    by_leg: dict[int, list[_Extra]] = {}
    for extra in extras:
        by_leg.setdefault(extra.leg, []).append(extra)
    # all ways that are needed, asked for at once
    asks: list[tuple[FloatArray, FloatArray]] = []
    plans: dict[int, list[tuple[FloatArray | int, LegKind]]] = {}
    first_leg = 0
    for path in paths:
        for j in range(len(path.kind)):
            mine = by_leg.get(first_leg + j)
            if mine is None:
                continue
            a, b = path.points_m[j], path.points_m[j + 1]
            kind = LegKind(int(path.kind[j]))
            way_kind = LegKind.SURVEY if lanes_alone else kind
            step = b - a
            mine.sort(key=lambda e: float((e.enter_m - a) @ step))
            plan: list[tuple[FloatArray | int, LegKind]] = []

            def ask(
                start: FloatArray,
                stop: FloatArray,
                what: LegKind,
                plan: list[tuple[FloatArray | int, LegKind]] = plan,
            ) -> None:
                plan.append((len(asks), what))
                asks.append((start, stop))

            here = a
            for extra in mine:
                if kind == LegKind.SURVEY:
                    plan.append((np.array([here, extra.enter_m]), kind))
                    here = extra.enter_m
                ask(here, extra.line_m[0], way_kind)  # a bent transit is a transit still
                for p, q in pairwise(extra.line_m):
                    ask(p, q, LegKind.SURVEY)
                here = extra.line_m[-1]
                if kind == LegKind.SURVEY:
                    ask(here, extra.enter_m, kind)
                    here = extra.enter_m
            if kind == LegKind.SURVEY:
                plan.append((np.array([here, b]), kind))
            else:
                ask(here, b, way_kind)
            plans[first_leg + j] = plan
        first_leg += len(path.kind)
    ways = harbour.paths(np.array([a for a, _ in asks]), np.array([b for _, b in asks]))

    out: list[CoveragePath] = []
    first_leg = 0
    for path in paths:
        points = [path.points_m[:1]]
        kinds: list[int] = []
        for j in range(len(path.kind)):
            plan_j = plans.get(first_leg + j)
            if plan_j is None:
                points.append(path.points_m[j + 1 : j + 2])
                kinds.append(int(path.kind[j]))
                continue
            for step_of_plan, kind_of_line in plan_j:
                line = ways[step_of_plan] if isinstance(step_of_plan, int) else step_of_plan
                points.append(line[1:])
                kinds.extend([int(kind_of_line)] * (len(line) - 1))
        first_leg += len(path.kind)
        out.append(make_path(path.robot, np.concatenate(points), kinds, [0] * len(kinds)))
    new_legs = np.concatenate([np.stack([w[:-1], w[1:]], axis=1) for w in ways])
    return out, new_legs


def number_lanes(path: CoveragePath) -> CoveragePath:
    """Return the path with its survey legs numbered by straight runs from 1, transits 0."""
    lane = np.zeros(len(path.kind), dtype=np.int64)
    number = 0
    legs = np.diff(path.points_m, axis=0)
    for j, kind in enumerate(path.kind):
        if kind != LegKind.SURVEY:
            continue
        straight = False
        if j and path.kind[j - 1] == LegKind.SURVEY:
            cross = legs[j - 1, 0] * legs[j, 1] - legs[j - 1, 1] * legs[j, 0]
            straight = abs(cross) < 1e-6 * np.hypot(*legs[j - 1]) * np.hypot(*legs[j]) and (
                float(legs[j - 1] @ legs[j]) > 0
            )
        number += 0 if straight else 1
        lane[j] = number
    return make_path(path.robot, path.points_m, path.kind.tolist(), lane.tolist())

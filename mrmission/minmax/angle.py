"""The bearing of the lanes: candidates, ranked by what a plan for this fleet would take.

How long all lanes are together says little of how long the last robot takes: with many robots it
counts how the lanes lie to the way home, and what they leave uncovered along the shore may cost
more than the turns. So candidates are ranked in rounds. The first looks at lanes, turns and slivers
alone (:mod:`mrmission.minmax.slivers`). The best of it are planned, shortly, with lanes, in-water
ways and the slivers that turns leave; the best by either round with all that the plan itself will
know: cut lanes, hooks, corners.

The rounds take a share of the time budget, counted in steps of the search and in lanes and not by a
clock: the same options give the same bearing on any machine.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from itertools import zip_longest
from typing import Protocol

import numpy as np
import shapely

from mrmission import libm
from mrmission.errors import PlanningError
from mrmission.minmax.full import more_trips_s
from mrmission.minmax.planner import BUDGET_PER_LINE_S, Prepared, prepare
from mrmission.minmax.problem import LaneProblem
from mrmission.minmax.slivers import Lanes, look
from mrmission.minmax.starts import starts_within
from mrmission.minmax.travel import DENSE_ENDS
from mrmission.model import FloatArray
from mrmission.routing.harbour import Harbour
from mrmission.tour.fairway import Columns, Fairway, beside_fairway, fairway_of, fairway_rows
from mrmission.tour.sweep import SweepFrame, columns_of
from mrmission.tour.timing import TimeModel
from mrmission.tour.work import PartWork

FAN_DEG = 15.0
"""Angle between the candidates of the regular fan."""
SHORE_EDGES = 6
"""Longest edges of the shore, islands too, whose directions are candidates."""
SAME_DEG = 2.0
"""Candidates nearer to one before them than this are left out."""
SNAP_DEG = 0.05
"""A candidate so near to a direction of the shore, or else to a whole degree, is moved there."""
WHOLE_DEG = 0.005
"""So near to a whole degree a direction of the shore is taken for it: 3 cm in 400 m."""
MOST_PLANNED, MOST_REAL = 8, 3
"""At most so many candidates are planned, and so many with all that the plan will know."""
FAIRWAYS_PLANNED, FAIRWAYS_REAL = 4, 1
"""So many more where each may be planned with a fairway."""
NEAR_BEST = 1.03
"""Candidates that take more than this many times the least in the last round are not searched
further."""
KEPT_LINES = 1500
"""Of more lines, cut, only the best candidate's work is kept: what is known of all ways of one
takes 150 MB."""
WORSE = 1.1
"""Candidates whose lanes, turns and slivers cost more than this many times the least are not
planned."""
BUDGET_SHARE = 0.5
"""Share of the time budget that ranking takes at most."""
REAL_SHARE = 0.8
"""Share of that for the last round."""
MATRIX_S, PIECES_S = 2e-7, 5e-4
"""Seconds of budget that stand for each pair of ends, and for hooks and corners of each lane, so
that large areas try few candidates."""
SEARCH_S, REAL_SEARCH_S, SHORT_SEARCH_S = 1e-4, 1e-3, 1.5e-4
"""Seconds of search for each lane in the second round; in the last; in the last where budget is
short."""
LEAST_SEARCH_S, LEAST_REAL_SEARCH_S = 0.02, 0.08
"""Seconds of search in either round at least: few lanes are cut into many pieces."""
FEW_LANES = 80
"""Fewer lanes than so many get as much of the budget."""
MOST_EFFORT = 4.0
"""Where there is budget for it, searches are up to so many times as long."""
MISSED = 0.5
"""Share of the slivers that no turn covers, where the turns are not known."""
HOOK_DEG = 150.0
"""About how far a boat turns at a hook."""
TURN_COLUMNS = 3.0
"""Ways shorter than so many columns follow the shore."""


class WorkAt(Protocol):
    """Makes the work of a part under a bearing, with or without a fairway."""

    def __call__(self, bearing_deg: float, *, fairway: bool = False) -> PartWork:
        """Return the work."""


Candidate = tuple[int, bool]
"""The number of a bearing, and whether with a fairway."""
Solve = Callable[[Candidate, float], float]
"""Returns the makespan of a candidate after so many seconds of search."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Tried:
    """A candidate and the seconds that were expected of it, by the last round it was in."""

    bearing_deg: float
    round: int
    makespan_s: float
    fairway: bool = False


@dataclass(frozen=True, slots=True, kw_only=True)
class BearingChoice:
    """The bearing that is taken, what is left of the time budget, and what was tried.

    Attributes
    ----------
    bearing_deg
        Compass bearing of the lanes, at least 0 and below 180.
    budget_left_s
        Of the time budget, for the plan itself.
    fairway
        Whether the plan is to have a fairway, see :mod:`mrmission.tour.fairway`.
    prepared
        The work under this bearing, where the last round was held; after it, where the budget is
        enough to search more than one, the work of the candidates that came near to it.
    tried
        All candidates in the order they were thought of; those with a fairway come last.
    """

    bearing_deg: float
    budget_left_s: float
    fairway: bool = False
    prepared: tuple[Prepared, ...] = ()
    tried: tuple[Tried, ...] = ()


def candidate_bearings(region_m: shapely.Polygon, spacing_m: float) -> tuple[float, ...]:
    """Return bearings worth a look, at least 0 and below 180, no two nearly the same.

    They are the direction across which the region is narrowest, those of the least rotated
    rectangle, those in which the shore runs longest, and a regular fan.
    """
    shore = _shore_directions(region_m, spacing_m)
    exact = [_whole(_bearing_of(*edge), WHOLE_DEG) for edge in shore]
    found: list[float] = []

    def add(east: float, north: float) -> None:
        bearing = _bearing_of(east, north)
        near = [side for side in exact if _apart_deg(side, bearing) <= SNAP_DEG]
        bearing = near[0] if near else _whole(bearing, SNAP_DEG)
        if all(_apart_deg(bearing, other) >= SAME_DEG for other in found):
            found.append(bearing)

    add(*_narrowest(shapely.get_coordinates(region_m.convex_hull)))
    rectangle = shapely.get_coordinates(shapely.minimum_rotated_rectangle(region_m))
    for edge in np.diff(rectangle, axis=0)[:2]:
        add(*edge)
    for edge in shore:
        add(*edge)
    for bearing in np.radians(np.arange(0.0, 180.0, FAN_DEG)):
        add(libm.sin(bearing), libm.cos(bearing))
    return tuple(found)


def _bearing_of(east: float, north: float) -> float:
    """Return the bearing of a line, to a thousandth of a degree, at least 0 and below 180."""
    return round(float(np.degrees(libm.arctan2(east, north))) % 180.0, 3) % 180.0


def _apart_deg(a: float, b: float) -> float:
    """Return the angle between two lines."""
    return min(abs(a - b), 180.0 - abs(a - b))


def _whole(bearing_deg: float, within_deg: float) -> float:
    """Return the whole degree that a bearing is next to; the bearing itself where none is near."""
    whole = float(round(bearing_deg))
    return whole % 180.0 if abs(whole - bearing_deg) <= within_deg else bearing_deg


def _narrowest(hull: FloatArray) -> FloatArray:
    """Return the edge (2,) of a convex ring across which the ring is narrowest."""
    edges = np.diff(hull, axis=0)
    length = np.hypot(edges[:, 0], edges[:, 1])
    edges = edges[length > 0] / length[length > 0][:, None]
    across = np.column_stack([-edges[:, 1], edges[:, 0]])
    reach = libm.times(hull, across.T)
    width = reach.max(axis=0) - reach.min(axis=0)
    return edges[int(np.argmin(np.round(width, 6)))]


def _shore_directions(region_m: shapely.Polygon, spacing_m: float) -> FloatArray:
    """Return (n, 2) edges in whose directions, to the degree, the shore runs longest."""
    edges = []
    for ring in (region_m.exterior, *region_m.interiors):
        slim = shapely.get_coordinates(shapely.simplify(ring, spacing_m))
        edges.append(np.diff(slim, axis=0))
    edge = np.concatenate(edges)
    length = np.hypot(edge[:, 0], edge[:, 1])
    longest = np.argsort(-np.round(length, 6), kind="stable")[:SHORE_EDGES]
    return edge[longest]


def choose_bearing(
    region_m: shapely.Polygon,
    harbour: Harbour,
    homes_m: FloatArray,
    time: TimeModel,
    spacing_m: float,
    *,
    time_budget_s: float,
    seed: int = 0,
    work_at: WorkAt | None = None,
    asked_deg: float | None = None,
    fairway: bool = False,
) -> BearingChoice:
    """Choose the bearing of the lanes by cheap plans for this fleet.

    Parameters
    ----------
    region_m
        The part of the navigable region, local frame.
    harbour
        Ways in the water.
    homes_m
        (robots, 2) where the robots start and end.
    time
        How long a robot takes.
    spacing_m
        Widest distance between lanes.
    time_budget_s
        Of the whole plan; 0 ranks by lanes, turns and slivers alone.
    seed
        Of the search.
    work_at
        The work of the part under a bearing; without it there is no last round.
    asked_deg
        The bearing, where only the fairway is to be decided.
    fairway
        Whether candidates of the last round are planned with a fairway too.
    """
    from mrmission.minmax.search import minmax

    bearings = (asked_deg,) if asked_deg is not None else candidate_bearings(region_m, spacing_m)
    views = [_View.of(region_m, bearing, spacing_m) for bearing in bearings]
    rough = np.array([view.rough_s(time) for view in views]) / len(homes_m)
    tried = {
        (i, False): Tried(bearing_deg=b, round=0, makespan_s=float(s))
        for i, (b, s) in enumerate(zip(bearings, rough, strict=True))
    }
    by_rough = [int(i) for i in np.argsort(rough, kind="stable")]
    ranked = [(i, False) for i in by_rough if rough[i] <= WORSE * rough.min()]
    lanes = max(len(views[by_rough[0]].lanes.x_m), 1)
    share_s = BUDGET_SHARE * min(time_budget_s, BUDGET_PER_LINE_S * max(lanes, FEW_LANES))
    can = _affordable(share_s, lanes, len(ranked), last_round=work_at is not None, either=fairway)
    left_s = time_budget_s

    def planned_s(number: int, candidate: Candidate, solve: Solve) -> float:
        nonlocal left_s
        search_s = can.search_s if number == 1 else can.real_search_s
        left_s -= search_s + _made_s(number, lanes)
        try:
            makespan_s = solve(candidate, search_s)
        except PlanningError:  # no lane at this bearing, maybe at another
            makespan_s = float("inf")
        i, way = candidate
        tried[candidate] = Tried(
            bearing_deg=bearings[i], round=number, makespan_s=makespan_s, fairway=way
        )
        return makespan_s

    ways: dict[int, Fairway | None] = {}
    if fairway and can.planned + can.real > 0:
        ways.update({i: views[i].fairway(homes_m) for i, _ in ranked})
        ranked = [(i, w) for i, way in ways.items() for w in (True, False) if way or not w]
    if can.planned:

        def cheap(candidate: Candidate, search_s: float) -> float:
            i, with_way = candidate
            way = ways[i] if with_way else None
            problem = views[i].problem(harbour, homes_m, time, spacing_m, way)
            return float(minmax(problem, search_s, seed).cost.max())

        took_s = [planned_s(1, candidate, cheap) for candidate in ranked[: can.planned]]
        ranked = [ranked[i] for i in np.argsort(took_s, kind="stable")]
    near: list[tuple[float, Prepared]] = []
    if work_at is not None and can.real:
        make = work_at

        def dear(candidate: Candidate, search_s: float) -> float:
            ready = prepare(make(bearings[candidate[0]], fairway=candidate[1]))
            tours = minmax(ready.problem, search_s, seed)
            makespan_s = float((tours.cost + more_trips_s(ready, tours)).max())
            near.append((makespan_s, replace(ready, begun=tours)))
            near.sort(key=lambda one: one[0])
            lines = len(near[0][1].lines)
            del near[starts_within(left_s, lines) if lines <= KEPT_LINES else 1 :]
            return makespan_s

        last = _last_round(ranked, by_rough)[: can.real]
        took_s = [planned_s(2, candidate, dear) for candidate in last]
        ranked = [last[int(np.argmin(took_s))]]
    number, with_fairway = ranked[0]
    return BearingChoice(
        bearing_deg=bearings[number],
        budget_left_s=max(left_s, 0.0),
        fairway=with_fairway,
        prepared=tuple(ready for took, ready in near if took <= NEAR_BEST * near[0][0]),
        tried=tuple(tried.values()),
    )


def _last_round(ranked: list[Candidate], by_rough: list[int]) -> list[Candidate]:
    """Return the candidates of the last round, the most promising first.

    The best is planned with a fairway and without one. Lanes and slivers alone are often right
    where short searches mislead: the others are the best by either.
    """
    best, way = ranked[0]
    order = [ranked[0]]
    if (best, not way) in ranked:
        order.append((best, not way))
    for candidate, rough in zip_longest(ranked, by_rough):
        order += [] if candidate is None else [candidate]
        order += [] if rough is None or (rough, way) not in ranked else [(rough, way)]
    return list(dict.fromkeys(order))


def _made_s(number: int, lanes: int) -> float:
    """Return the seconds of budget that making a candidate's problem stands for in a round."""
    return MATRIX_S * (2 * lanes) ** 2 + (PIECES_S * lanes if number == 2 else 0.0)


@dataclass(frozen=True, slots=True, kw_only=True)
class _Affordable:
    """How many candidates are planned, how many to the last, and how long each is searched."""

    planned: int = 0
    real: int = 0
    search_s: float = 0.0
    real_search_s: float = 0.0


def _affordable(
    share_s: float, lanes: int, candidates: int, *, last_round: bool, either: bool = False
) -> _Affordable:
    """Return what can be done with a share of the budget.

    The last round is the dearer one: it is held with two candidates or more, or not at all, with
    short searches where long ones leave no room for two. With `either` each bearing is two
    candidates, with a fairway and without.
    """
    if 2 * lanes > DENSE_ENDS:  # no matrix can be kept
        return _Affordable()
    candidates *= 1 + either
    search_s = max(LEAST_SEARCH_S, SEARCH_S * lanes)
    one_s = _made_s(1, lanes) + search_s
    real, real_s, real_search_s = 0, 0.0, 0.0
    for each_s in (REAL_SEARCH_S, SHORT_SEARCH_S) if last_round else ():
        searched_s = max(LEAST_REAL_SEARCH_S, each_s * lanes)
        whole_s = _made_s(2, lanes) + searched_s
        many = int(REAL_SHARE * share_s / whole_s)
        many = min(MOST_REAL + FAIRWAYS_REAL * either, candidates, many)
        if many >= 2:
            real, real_s, real_search_s = many, whole_s, searched_s
            break
    planned = int((share_s - real * real_s) / one_s)
    planned = min(MOST_PLANNED + FAIRWAYS_PLANNED * either, candidates, planned)
    planned = planned if planned >= 2 else 0
    searched_s = planned * search_s + real * real_search_s
    spare_s = share_s - planned * one_s - real * real_s
    effort = min(MOST_EFFORT, 1.0 + max(spare_s, 0.0) / searched_s) if searched_s > 0 else 1.0
    return _Affordable(
        planned=planned, real=real, search_s=effort * search_s, real_search_s=effort * real_search_s
    )


@dataclass(frozen=True, slots=True, kw_only=True)
class _View:
    """A region under one bearing: its lanes, what they leave, and how wide columns are."""

    columns: Columns
    lanes: Lanes

    @classmethod
    def of(cls, region_m: shapely.Polygon, bearing_deg: float, spacing_m: float) -> _View:
        frame = SweepFrame(bearing_deg=bearing_deg)
        region = frame.turn(region_m)
        column_x, pitch = columns_of(region, spacing_m)
        columns = Columns(frame=frame, region=region, x_m=column_x, pitch_m=pitch)
        return cls(columns=columns, lanes=look(region, column_x, pitch))

    def fairway(self, homes_m: FloatArray) -> Fairway | None:
        """Return the fairway through the middle of where the robots start."""
        return fairway_of(self.columns, homes_m.mean(axis=0), len(homes_m))

    def rough_s(self, time: TimeModel) -> float:
        """Return about the seconds of sweeping the region: lanes, turns, slivers."""
        length_m = float(np.diff(self.lanes.y_m, axis=1).sum()) + self.lanes.alone_m
        turns_m = len(self.lanes.x_m) * self.columns.pitch_m
        turns_s = len(self.lanes.x_m) * time.lane_turn_s(self.columns.pitch_m)
        slivers_s = MISSED * float(self._hooks_s(time).sum())
        return (length_m + turns_m) / time.survey_speed_m_s + turns_s + slivers_s

    def _hooks_s(self, time: TimeModel) -> FloatArray:
        """Return (lanes, 2, 2) seconds of going out for each sliver, by lane, end and side."""
        out_m, curves = self.lanes.out_m, time.transit
        corner_s = float(np.interp(HOOK_DEG, curves.angle_deg, curves.corner_s))
        short_s = np.interp(out_m.ravel(), curves.leg_m, curves.first_s + curves.bend_s)
        hook_s = 2 * out_m / time.transit_speed_m_s + corner_s + short_s.reshape(out_m.shape)
        return np.where(out_m > 0, hook_s, 0.0)

    def problem(
        self,
        harbour: Harbour,
        homes_m: FloatArray,
        time: TimeModel,
        spacing_m: float,
        fairway: Fairway | None,
    ) -> LaneProblem:
        """Return the lanes with in-water ways, all turns taken for alike but for what they cover.

        A short way from one lane to another covers the slivers on its side of either.
        """
        ends_m, hooks_s = self._lines(time, fairway)
        pitch_m = self.columns.pitch_m
        x = ends_m[:, :, 0].ravel()
        ends = self.columns.frame.to_local(ends_m.reshape(-1, 2))
        way_m = harbour.distance_matrix(ends)
        left_s, right_s = np.moveaxis(hooks_s.reshape(-1, 2), 1, 0)
        aside_m = np.where(way_m < TURN_COLUMNS * pitch_m, x[None] - x[:, None], 0.0)
        left_out_s = np.where(aside_m < -0.5 * pitch_m, 0.0, left_s[:, None])
        left_out_s += np.where(aside_m > 0.5 * pitch_m, 0.0, right_s[:, None])
        lane_m = np.hypot(*(ends_m[:, 1] - ends_m[:, 0]).T)
        lane_m += self.lanes.alone_m / max(len(ends_m), 1)
        way_s = way_m / time.transit_speed_m_s + time.lane_turn_s(spacing_m)
        home_s = harbour.distances(homes_m, ends) / time.transit_speed_m_s
        return LaneProblem(
            lane_cost=lane_m / time.survey_speed_m_s,
            end_cost=way_s + left_out_s + left_out_s.T,
            home_cost=home_s + left_s + right_s,
        )

    def _lines(self, time: TimeModel, fairway: Fairway | None) -> tuple[FloatArray, FloatArray]:
        """Return (n, 2, 2) ends in the sweep frame, and the (n, 2, 2) seconds of their hooks.

        Where a lane ends at the fairway nothing is left beside it.
        """
        x_m, y_m, hooks_s = self.lanes.x_m, self.lanes.y_m, self._hooks_s(time)
        if fairway is None:
            return np.stack([np.repeat(x_m[:, None], 2, axis=1), y_m], axis=2), hooks_s
        columns = self.columns
        column = np.rint((x_m - columns.x_m[0]) / columns.pitch_m).astype(np.int64)
        of_lane, low, high = beside_fairway(columns, fairway, column, y_m[:, 0], y_m[:, 1])
        _, rows = fairway_rows(columns, fairway)
        x, y = np.repeat(x_m[of_lane][:, None], 2, axis=1), np.column_stack([low, high])
        at_shore = y == y_m[of_lane]
        hooks_s = np.where(at_shore[:, :, None], hooks_s[of_lane], 0.0)
        ends = np.concatenate([np.stack([x, y], axis=2), rows])
        return ends, np.concatenate([hooks_s, np.zeros((len(rows), 2, 2))])

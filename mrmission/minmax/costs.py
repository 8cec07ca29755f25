"""What the search is told: lines, the ways between their ends and to the homes, in seconds.

A way costs its length over the transit speed, the corners at both of its ends, and what it goes out
of its way for hooks (:mod:`mrmission.minmax.hooks`). Between near ends, where nearly all ways of a
good plan lie, this is computed leg by leg as the time model does it; between all others, and to the
homes, from the angles at the ends alone, and from a mean corner where the way is bent.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numba import njit

from mrmission import libm
from mrmission.minmax.hooks import Hooks
from mrmission.minmax.nearest import nearest_ends
from mrmission.minmax.problem import LaneProblem
from mrmission.minmax.ways import Ways, hooked_ways, straight
from mrmission.model import FloatArray, IntArray, LegKind
from mrmission.routing.harbour import Harbour
from mrmission.tour.lines import SurveyLine, ends_of, lengths_m
from mrmission.tour.timing import TimeModel
from mrmission.tour.turning import turn_cost_m

NEAR = 12
"""So many nearest ends of each end are priced leg by leg."""
STUB_M = 1000.0
"""Lanes are so long where only their corner with a way is asked for: no short legs."""
FAR_M = 1e5
"""Distance between chains of legs that are priced in one go."""
ANGLES = 181
BENT = 1.02
"""A way this many times as long as the straight one does not begin in its direction."""
MOST_KINDS, MOST_NUMBERS = 4, 2e7
"""No more kinds of vehicles, and no more numbers for all their ways, are told apart."""


Kind = tuple[TimeModel, float, float]
"""A kind of vehicle, and its seconds of sweeping and of travel over the first one's."""


@dataclass(frozen=True, slots=True, kw_only=True)
class LineCosts:
    """Lines, homes and vehicles as the search sees them.

    Attributes
    ----------
    problem
        In seconds.
    metres
        (2 · lines, 2 · lines) lengths of the ways between the ends.
    kinds
        The kinds of vehicles that are told apart, see :func:`kinds_of`.
    """

    problem: LaneProblem
    metres: FloatArray
    kinds: tuple[Kind, ...]


def line_costs(
    lines: tuple[SurveyLine, ...],
    hooks: Hooks,
    harbour: Harbour,
    homes_m: FloatArray,
    times: tuple[TimeModel, ...],
    *,
    lanes_alone: bool,
) -> LineCosts:
    """Return what sweeping lines and going between them costs.

    Parameters
    ----------
    lines, hooks
        The work; hooks hang on the lines' ends.
    harbour
        Ways in the water.
    homes_m
        (robots, 2) where each robot starts and ends.
    times
        How long each robot takes.
    lanes_alone
        Whether ways cover nothing.
    """
    ends = ends_of(lines).reshape(-1, 2)
    out = outward(lines)
    metres = harbour.distance_matrix(ends)
    first, last = chosen_pairs(metres)
    near = near_ways(ends, first, last, metres[first, last], harbour)
    kinds = kinds_of(times)[: max(1, min(MOST_KINDS, int(MOST_NUMBERS / max(metres.size, 1))))]
    costs = []
    for time, sweep, travel in kinds:
        hook_s = _mean_hook_s(ends, out, hooks, time, lanes_alone)
        table, mean = _corner_table(time)
        cost = metres.copy()
        _price_all(cost, ends, out, table, mean, hook_s, 1.0 / time.transit_speed_m_s)
        near_s = near_seconds(near, ends, out, hooks, time, lanes_alone)
        cost[first, last] = cost[last, first] = near_s
        lane_s = lengths_m(lines) / time.survey_speed_m_s + _short_lanes_s(lines, time)
        costs.append((lane_s / sweep, cost if travel == 1.0 else cost / travel))
    sweep_scale, travel_scale = speed_scales(times)
    problem = LaneProblem(
        lane_cost=costs[0][0],
        end_cost=costs[0][1],
        home_cost=_home_seconds(ends, out, homes_m, hooks, harbour, times, lanes_alone),
        sweep_scale=sweep_scale,
        travel_scale=travel_scale,
        kinds=nearest_kinds(times, kinds, times[0].swath_m) if len(kinds) > 1 else None,
        others=tuple(costs[1:]),
    )
    return LineCosts(problem=problem, metres=metres, kinds=kinds)


def kinds_of(times: tuple[TimeModel, ...]) -> tuple[Kind, ...]:
    """Return each kind of vehicle once, with how many times the first's seconds it takes.

    That is for sweeping and for travel, as :func:`speed_scales` has them.
    """
    out: list[Kind] = []
    for time, sweep, travel in zip(times, *speed_scales(times), strict=True):
        if all(time != other for other, _, _ in out):
            out.append((time, float(sweep), float(travel)))
    return tuple(out)


def nearest_kinds(
    times: tuple[TimeModel, ...], kinds: tuple[Kind, ...], spacing_m: float
) -> IntArray:
    """Return (robots,) numbers of their kinds, or of those whose turns take about as long.

    Parameters
    ----------
    times
        How long each robot takes.
    kinds
        The kinds that are told apart, not all perhaps.
    spacing_m
        From lane to lane.
    """
    models = [time for time, _, _ in kinds]
    turn_s = np.array([time.lane_turn_s(spacing_m) for time in models])
    return np.array(
        [
            models.index(time)
            if time in models
            else int(np.argmin(np.abs(turn_s - time.lane_turn_s(spacing_m))))
            for time in times
        ],
        dtype=np.int64,
    )


def speed_scales(times: tuple[TimeModel, ...]) -> tuple[FloatArray, FloatArray]:
    """Return (robots,) how many times as long as the first each robot sweeps, and travels."""
    sweep = [times[0].survey_speed_m_s / time.survey_speed_m_s for time in times]
    travel = [times[0].transit_speed_m_s / time.transit_speed_m_s for time in times]
    return np.array(sweep), np.array(travel)


def outward(lines: tuple[SurveyLine, ...]) -> FloatArray:
    """Return (2 · lines, 2) unit vectors out of the lines at their ends; 0 for a mere point."""
    legs = end_legs_m(lines)
    length = np.hypot(legs[:, 0], legs[:, 1])
    return legs / np.where(length > 0, length, 1.0)[:, None]


def end_legs_m(lines: tuple[SurveyLine, ...]) -> FloatArray:
    """Return (2 · lines, 2) the last legs of the lines at their ends, as vectors out of them."""
    if not lines:
        return np.zeros((0, 2))
    return np.array(
        [
            (line.points_m[0] - line.points_m[1], line.points_m[-1] - line.points_m[-2])
            for line in lines
        ]
    ).reshape(-1, 2)


def chosen_pairs(metres: FloatArray) -> tuple[IntArray, IntArray]:
    """Return pairs of ends, smaller first, of which one is among the nearest of the other.

    Parameters
    ----------
    metres
        (ends, ends) lengths of the ways between them.
    """
    n = len(metres)
    nearest = nearest_ends(metres, NEAR)
    here = np.repeat(np.arange(n), nearest.shape[1])
    there = nearest.ravel()
    low, high = np.minimum(here, there), np.maximum(here, there)
    key = np.unique(low * n + high)
    return key // n, key % n


@dataclass(frozen=True, slots=True, kw_only=True)
class NearWays:
    """Ways between pairs of near ends, the shortest in the water, without hooks.

    ``metres`` are their lengths; way ``i`` from ``first[i]`` to ``last[i]`` goes by
    ``points_m[start[i]:start[i + 1]]``.
    """

    first: IntArray
    last: IntArray
    metres: FloatArray
    start: IntArray
    points_m: FloatArray


def near_ways(
    ends: FloatArray, first: IntArray, last: IntArray, metres: FloatArray, harbour: Harbour
) -> NearWays:
    """Return the ways between pairs of near ends."""
    start, points = straight(ends[first], ends[last])
    bent = np.flatnonzero(metres > np.hypot(*(ends[last] - ends[first]).T) * (1 + 1e-6) + 1e-3)
    if len(bent):
        ways = harbour.shortest_paths(ends[first[bent]], ends[last[bent]])
        start, points = _with_ways(start, points, bent, ways)
    return NearWays(first=first, last=last, metres=metres, start=start, points_m=points)


def near_seconds(
    near: NearWays,
    ends: FloatArray,
    out: FloatArray,
    hooks: Hooks,
    time: TimeModel,
    lanes_alone: bool,
) -> FloatArray:
    """Return the seconds of the ways between pairs of near ends, corners and hooks included."""
    first, last = near.first, near.last
    if time.turn_radius_m > 0:
        leave, enter = (libm.arctan2(side[:, 1], side[:, 0]) for side in (out[first], -out[last]))
        turn_m = turn_cost_m(ends[first], leave, ends[last], enter, time.turn_radius_m)
        return np.maximum(turn_m, near.metres) / time.transit_speed_m_s
    ways = hooked_ways(first, last, near.start, near.points_m, hooks, always=lanes_alone)
    return ways_s(ways, out[first], -out[last], time, lanes_alone=lanes_alone)


def _with_ways(
    start: IntArray, points: FloatArray, index: IntArray, ways: list[FloatArray]
) -> tuple[IntArray, FloatArray]:
    """Return the polylines with those at `index` replaced."""
    lists = [points[a:b] for a, b in pairwise(start.tolist())]
    for i, way in zip(index.tolist(), ways, strict=True):
        lists[i] = way
    sizes = np.array([len(way) for way in lists], dtype=np.int64)
    return np.concatenate([[0], np.cumsum(sizes)]), np.concatenate(lists)


def ways_s(
    ways: Ways,
    out: FloatArray,
    into: FloatArray,
    time: TimeModel,
    *,
    lanes_alone: bool = False,
) -> FloatArray:
    """Return (ways,) seconds of ways from lane to lane: length, corners, the two outer ones too.

    Parameters
    ----------
    ways
        The ways.
    out, into
        (ways, 2) unit vectors in which the lane before is left, and the lane after entered; 0 where
        there is none.
    time
        How long the vehicle takes.
    lanes_alone
        Whether hooks are swept, and not merely passed.
    """
    n = len(ways)
    if n == 0:
        return np.zeros(0)
    # all ways in one chain, each between two stubs of lanes, and a long leg on to the next
    size = np.diff(ways.start) + 2
    begin = np.concatenate([[0], np.cumsum(size)])
    chain = np.empty((begin[-1], 2))
    kind = np.full(begin[-1], int(LegKind.TRANSIT), dtype=np.int8)
    hooked = np.zeros(begin[-1], dtype=np.int8)
    at = np.arange(len(ways.points_m)) + np.repeat(2 * np.arange(n) + 1, size - 2)
    # apart from each other, so that no leg between two ways is short
    aside = np.column_stack([np.zeros(n), FAR_M * (np.arange(n) % 2)])
    chain[at] = ways.points_m + np.repeat(aside, size - 2, axis=0)
    hooked[at] = ways.hooked
    head, tail = begin[:-1], begin[1:] - 1
    chain[head] = chain[head + 1] - STUB_M * out
    chain[tail] = chain[tail - 1] + STUB_M * into
    # a stub of no length would be no leg: it is made one, and its corner not counted
    no_out, no_into = ~out.any(axis=1), ~into.any(axis=1)
    chain[head[no_out]] -= [0.0, STUB_M]
    chain[tail[no_into]] += [0.0, STUB_M]
    kind[head] = kind[tail - 1] = int(LegKind.SURVEY)
    if lanes_alone:
        kind[at[hooked[at] == 1] - 1] = int(LegKind.SURVEY)
        kind[at[hooked[at] == 2]] = int(LegKind.SURVEY)
    kind = kind[:-1]
    leg = np.hypot(*np.diff(chain, axis=0).T)
    moved = leg > 0
    seconds = np.zeros(len(chain))
    own = np.ones(len(leg), dtype=np.bool_)
    own[head] = own[tail - 1] = False
    own[tail[:-1]] = False
    speed = np.where(kind == LegKind.SURVEY, time.survey_speed_m_s, time.transit_speed_m_s)
    seconds[:-1] = np.where(own, leg / speed, 0.0)
    kept = np.append(True, moved)
    corner = np.zeros(len(chain))
    inner = np.flatnonzero(kept)[1:-1]
    corner[inner] = time.corners_s(chain[kept], kind[moved])
    corner[head] = corner[tail] = 0.0
    corner[head[no_out] + 1] = 0.0
    corner[tail[no_into] - 1] = 0.0
    total = np.add.reduceat(seconds + corner, head)
    return np.maximum(total, 0.0)


def _mean_hook_s(
    ends: FloatArray, out: FloatArray, hooks: Hooks, time: TimeModel, lanes_alone: bool
) -> FloatArray:
    """Return (ends,) what the hooks of each end add to a long way from it, as a mean."""
    hooked = np.flatnonzero(np.diff(hooks.of_end) > 0)
    seconds = np.zeros(len(ends))
    if len(hooked) == 0:
        return seconds
    bearings = np.arange(8) * (np.pi / 4)
    step = STUB_M * np.column_stack([libm.cos(bearings), libm.sin(bearings)])
    first = np.repeat(hooked, len(step))
    start, points = straight(ends[first], ends[first] + np.tile(step, (len(hooked), 1)))
    nowhere = np.full(len(first), -1, dtype=np.int64)
    none = np.zeros((len(first), 2))
    plain = Ways(start=start, points_m=points, hooked=np.zeros(len(points), dtype=np.int8))
    by_hooks = hooked_ways(first, nowhere, start, points, hooks, always=lanes_alone)
    added = ways_s(by_hooks, out[first], none, time, lanes_alone=lanes_alone)
    added -= ways_s(plain, out[first], none, time)
    seconds[hooked] = np.maximum(added.reshape(-1, len(step)).mean(axis=1), 0.0)
    return seconds


def _corner_table(time: TimeModel) -> tuple[FloatArray, float]:
    """Return extra seconds of a corner between a lane and a long way by the cosine of its turn."""
    cosine = np.linspace(-1.0, 1.0, ANGLES)
    turn = np.column_stack([cosine, np.sqrt(1.0 - cosine**2)])
    n = len(cosine)
    start, points = straight(np.zeros((n, 2)), STUB_M * turn)
    plain = Ways(start=start, points_m=points, hooked=np.zeros(2 * n, dtype=np.int8))
    ahead = np.tile([1.0, 0.0], (n, 1))
    seconds = ways_s(plain, ahead, np.zeros((n, 2)), time) - STUB_M / time.transit_speed_m_s
    angle = libm.arccos(cosine)
    mean = float(np.trapezoid(seconds[::-1], angle[::-1]) / np.pi)
    return seconds, mean


@njit(cache=True)
def _price_all(cost, ends, out, table, mean, hook_s, s_per_m):  # type: ignore[no-untyped-def]
    """Turn metres between all ends into seconds, in place; see the module."""
    n = len(cost)
    top = len(table) - 1
    for i in range(n):
        for j in range(i + 1, n):
            metres = cost[i, j]
            x, y = ends[j, 0] - ends[i, 0], ends[j, 1] - ends[i, 1]
            direct = np.sqrt(x * x + y * y)
            corner = 2.0 * mean
            if direct > 0.0 and metres <= BENT * direct:
                x /= direct
                y /= direct
                corner = 0.0
                if out[i, 0] != 0.0 or out[i, 1] != 0.0:
                    ahead = out[i, 0] * x + out[i, 1] * y
                    corner += table[round((ahead + 1.0) * 0.5 * top)]
                else:
                    corner += mean
                if out[j, 0] != 0.0 or out[j, 1] != 0.0:
                    ahead = -out[j, 0] * x - out[j, 1] * y
                    corner += table[round((ahead + 1.0) * 0.5 * top)]
                else:
                    corner += mean
            seconds = max(0.0, metres * s_per_m + corner + hook_s[i] + hook_s[j])
            cost[i, j] = seconds
            cost[j, i] = seconds


def _home_seconds(
    ends: FloatArray,
    out: FloatArray,
    homes_m: FloatArray,
    hooks: Hooks,
    harbour: Harbour,
    times: tuple[TimeModel, ...],
    lanes_alone: bool,
) -> FloatArray:
    """Return (robots, ends) seconds between homes and ends.

    Half of setting off and stopping is in each. A way around land is priced as a straight one, by
    the corner at the line, that is as much longer.
    """
    metres = harbour.distances(homes_m, ends)
    cost = np.empty_like(metres)
    last = np.arange(len(ends))
    nowhere = np.full(len(ends), -1, dtype=np.int64)
    none = np.zeros((len(ends), 2))
    for robot, time in enumerate(times):
        home = np.tile(homes_m[robot], (len(ends), 1))
        start, points = straight(home, ends)
        ways = hooked_ways(nowhere, last, start, points, hooks, always=lanes_alone)
        seconds = ways_s(ways, none, -out, time, lanes_alone=lanes_alone)
        around_m = metres[robot] - np.hypot(*(ends - homes_m[robot]).T)
        seconds += np.maximum(around_m, 0.0) / time.transit_speed_m_s
        cost[robot] = np.maximum(seconds, 0.0) + 0.5 * ends_s(time)
    return cost


def ends_s(time: TimeModel) -> float:
    """Return the seconds of setting off and of stopping, taking off and landing included."""
    kind = np.array([int(LegKind.TRANSIT)], dtype=np.int8)
    line = np.array([[0.0, 0.0], [0.0, STUB_M]])
    return time.duration_s(line, kind) - STUB_M / time.transit_speed_m_s


def _short_lanes_s(lines: tuple[SurveyLine, ...], time: TimeModel) -> FloatArray:
    """Return (lines,) extra seconds inside the lines: their corners, and what short ones cost.

    A short lane lies between two ways that are priced as if it were long; in the zigzag that it
    mostly belongs to, each leg costs its own.
    """
    curves = time.survey
    seconds = np.interp(lengths_m(lines), curves.leg_m, curves.zigzag_s)
    for i, line in enumerate(lines):
        if len(line.points_m) > 2:
            kind = np.full(len(line.points_m) - 1, int(LegKind.SURVEY), dtype=np.int8)
            seconds[i] = float(time.corners_s(line.points_m, kind).sum())
    return np.asarray(seconds, dtype=np.float64)

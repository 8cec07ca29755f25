"""What lines, and ways between them, take at least: what the bound for chosen lines stands on.

The ways are those that the planner lays: the shortest in the water, by hooks where the lines leave
something, with reversals made gentle, run-ins and arcs. What no such way undercuts is, of the
greatest, either

- *any way*: its length in the water over the speed, less what corners can gain. Rounding the
  corners between its ends by an eighth of a swath makes a way in open water shorter by as much as
  they may gain at most (:meth:`~mrmission.tour.timing.TimeModel.least_corner_s`), and it still is
  no shorter than the distance; so only the corners at the two lines count. A way around land is
  taken to gain at :data:`BENDS` more;
- *this way*, between near ends: as it is laid, leg by leg, in the direction in which it takes less.

Vehicles that are not alike are each counted with their own corners and speeds.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numba import njit

from mrmission.minmax.costs import (
    NearWays,
    chosen_pairs,
    end_legs_m,
    ends_s,
    kinds_of,
    near_ways,
    outward,
    speed_scales,
    ways_s,
)
from mrmission.minmax.gentle import gentlest_s
from mrmission.minmax.hooks import Hooks
from mrmission.minmax.problem import LaneProblem
from mrmission.minmax.ways import hooked_ways
from mrmission.model import BoolArray, FloatArray, LegKind
from mrmission.routing.harbour import Harbour
from mrmission.tour.lines import SurveyLine, ends_of, lengths_m
from mrmission.tour.reversals import REVERSAL_DEG
from mrmission.tour.timing import TimeModel, turns_deg
from mrmission.tour.turning import MOST_TRIM

BENDS = 2
"""Sharp bends of a way around land that may gain; more than two are not looked for."""
MARK_S = 1000.0
"""Seconds that mark a reversal."""
AROUND, AROUND_M = 1.0 + 1e-6, 1e-3
"""A way so many times as long as the straight one, and by so much more, goes around land."""


def least_costs(
    lines: tuple[SurveyLine, ...],
    hooks: Hooks,
    harbour: Harbour,
    homes_m: FloatArray,
    times: tuple[TimeModel, ...],
    metres: FloatArray,
    *,
    lanes_alone: bool,
    runs: bool = False,
    exact: BoolArray | None = None,
) -> LaneProblem:
    """Return lines, ways and homes in seconds that no plan undercuts.

    Parameters
    ----------
    lines, hooks
        The lines, each swept in one go, and the hooks of their ends.
    harbour
        Ways in the water.
    homes_m
        (robots, 2) where each robot starts and ends.
    times
        How long each robot takes.
    metres
        (2 · lines, 2 · lines) lengths of the ways between the ends.
    lanes_alone
        Whether ways cover nothing.
    runs
        Whether lines have run-ins or run-outs: ways then go by other corners than those laid here.
    exact
        (2 · lines, 2 · lines) which lengths are those of the ways: others are no more than that.
        All when None.

    Returns
    -------
    LaneProblem
        With a matrix of ways, in seconds of the first robot, which the scales turn into those of
        each; ways home in each robot's own. A tour has one way home and one out, and each of the
        two counts half of what corners gain at both, and of setting off and stopping.
    """
    ends = ends_of(lines).reshape(-1, 2)
    sweep_scale, travel_scale = speed_scales(times)
    way_s: FloatArray | None = None
    first, last = chosen_pairs(metres)
    if exact is not None:
        first, last = first[exact[first, last]], last[exact[first, last]]
    near = near_ways(ends, first, last, metres[first, last], harbour)
    for time, _, travel in kinds_of(times):
        speed_m_s = way_speed_m_s(time, lanes_alone=lanes_alone)
        own_s = _any_way_s(metres, ends, 1.0 / speed_m_s, gain_s(time), bends_s(time))
        if time.turn_radius_m <= 0 and not runs:
            laid_s = _laid_s(near, lines, hooks, time, lanes_alone)
            laid_s = np.maximum(laid_s, own_s[first, last])
            own_s[first, last] = own_s[last, first] = laid_s
        own_s /= travel
        way_s = own_s if way_s is None else np.minimum(way_s, own_s, out=way_s)
    return LaneProblem(
        lane_cost=least_lanes_s(lines, times),
        end_cost=way_s,
        home_cost=least_home_s(
            harbour.distances(homes_m, ends), ends, homes_m, times, lanes_alone=lanes_alone
        ),
        sweep_scale=sweep_scale,
        travel_scale=travel_scale,
    )


def least_lanes_s(lines: tuple[SurveyLine, ...], times: tuple[TimeModel, ...]) -> FloatArray:
    """Return (lines,) what sweeping each line takes any robot at least, in the first's seconds."""
    return np.min([_own_lanes_s(lines, time) / sweep for time, sweep, _ in kinds_of(times)], axis=0)


def _own_lanes_s(lines: tuple[SurveyLine, ...], time: TimeModel) -> FloatArray:
    """Return (lines,) what sweeping each line takes at least, what its corners gain taken off.

    With a turn radius that is without what turns may leave out at its ends, and nothing for a line
    shorter than the radius.
    """
    length = lengths_m(lines)
    radius_m = time.turn_radius_m
    if radius_m > 0:
        length = np.where(length < radius_m, 0.0, length - 2 * MOST_TRIM * radius_m)
    seconds = length / time.survey_speed_m_s
    for i, line in enumerate(lines):
        if len(line.points_m) > 2:
            seconds[i] -= _gained_inside_s(line, time)
    return np.maximum(seconds, 0.0)


def _gained_inside_s(line: SurveyLine, time: TimeModel) -> float:
    """Return what the corners inside a line may gain at most."""
    step = np.diff(line.points_m, axis=0)
    most = -time.least_corner_s(np.hypot(step[:, 0], step[:, 1]), turns_deg(step))
    return float(np.minimum(most, time.most_gain_s(LegKind.SURVEY, LegKind.SURVEY)).sum())


def least_home_s(
    metres: FloatArray,
    ends: FloatArray,
    homes_m: FloatArray,
    times: tuple[TimeModel, ...],
    *,
    lanes_alone: bool,
) -> FloatArray:
    """Return (robots, ends) what ways home take at least, each robot's in its own seconds.

    Parameters
    ----------
    metres
        (robots, ends) their lengths.
    ends, homes_m
        (ends, 2), (robots, 2) from where to where they lead.
    times
        How long each robot takes.
    lanes_alone
        Whether ways cover nothing.
    """
    out = np.empty_like(metres)
    for robot, time in enumerate(times):
        direct = np.hypot(*(ends - homes_m[robot]).T)
        around = metres[robot] > AROUND * direct + AROUND_M
        seconds = metres[robot] / way_speed_m_s(time, lanes_alone=lanes_alone)
        seconds -= 0.5 * gain_s(time)
        seconds -= np.where(around, bends_s(time), 0.0)
        out[robot] = np.maximum(seconds, 0.0) + 0.5 * ends_s(time)
    return out


def gain_s(time: TimeModel) -> float:
    """Return what the corners at the lines on both sides of a way gain at most.

    With a turn radius also what turns leave out of the two lines, which they go beyond by a
    diameter at most.
    """
    sweep, way = LegKind.SURVEY, LegKind.TRANSIT
    swept = time.most_gain_s(sweep, sweep)  # where a way begins with a hook that is swept
    left = max(time.most_gain_s(sweep, way), swept)
    entered = max(time.most_gain_s(way, sweep), swept)
    return left + entered + 2 * MOST_TRIM * time.turn_radius_m / time.top_speed_m_s


def bends_s(time: TimeModel) -> float:
    """Return what the bends of a way around land are taken to gain."""
    kinds = (LegKind.TRANSIT, LegKind.SURVEY)
    return BENDS * max(time.most_gain_s(kind, kind) for kind in kinds)


def way_speed_m_s(time: TimeModel, *, lanes_alone: bool) -> float:
    """Return the speed that no way between lanes goes beyond.

    Hooks are swept where ways cover nothing, and with a turn radius a lane goes on to the first
    corner of the turn: both at survey speed.
    """
    swept = lanes_alone or time.turn_radius_m > 0
    return time.top_speed_m_s if swept else time.transit_speed_m_s


def _laid_s(
    near: NearWays,
    lines: tuple[SurveyLine, ...],
    hooks: Hooks,
    time: TimeModel,
    lanes_alone: bool,
) -> FloatArray:
    """Return what near ways take at least as they are laid, in either direction."""
    out = outward(lines)
    short = np.hypot(*end_legs_m(lines).T) < time.long_leg_m
    return np.minimum(
        _gentle_s(near, out, short, hooks, time, lanes_alone),
        _gentle_s(_backwards(near), out, short, hooks, time, lanes_alone),
    )


def _backwards(near: NearWays) -> NearWays:
    """Return the same ways in the other direction."""
    size = np.diff(near.start)
    both = np.repeat(near.start[:-1] + near.start[1:] - 1, size)
    return replace(
        near,
        first=near.last,
        last=near.first,
        points_m=near.points_m[both - np.arange(len(both))],
    )


def _gentle_s(
    near: NearWays,
    out: FloatArray,
    short: BoolArray,
    hooks: Hooks,
    time: TimeModel,
    lanes_alone: bool,
) -> FloatArray:
    """Return what near ways take in their direction, reversals at the least that replaces them.

    `short` are the ends at which the last leg of a line is short: a way from or to it is one of a
    row of short legs, where it costs less than alone. A steered boat's reversal may be replaced by
    up to three gentler corners, which also changes the one behind it
    (:mod:`mrmission.minmax.gentle`).
    """
    ways = hooked_ways(near.first, near.last, near.start, near.points_m, hooks, always=lanes_alone)
    leave, enter = out[near.first], -out[near.last]
    near_s = ways_s(ways, leave, enter, time, lanes_alone=lanes_alone)
    if not len(near_s):
        return near_s
    begin = ways.start[:-1]
    leg_m = np.hypot(*(ways.points_m[begin + 1] - ways.points_m[begin]).T)
    beside = short[near.first] | short[near.last]
    row_s = np.where(beside, time.short_row_s(leg_m), 0.0)
    if time.steering != "steered":
        return near_s - row_s
    marked = time.with_reversals_marked(REVERSAL_DEG, MARK_S)
    seconds = ways_s(ways, leave, enter, marked, lanes_alone=lanes_alone)
    count = np.round(np.maximum(seconds - near_s, 0.0) / MARK_S)
    # a reversal, the corner behind it and the short leg between the two: all that can become less
    curves = (time.survey, time.transit)
    corner_s = max(float(c.corner_s.max()) for c in curves) + bends_s(time)
    short_s = max(float((c.first_s + np.maximum(c.bend_s, c.zigzag_s)).max()) for c in curves)
    least = near_s - count * (2 * corner_s + short_s)
    if not lanes_alone:
        one = np.flatnonzero(count == 1)
        least[one] = gentlest_s(ways, one, leave, enter, time)
        least -= np.where(beside, time.short_row_s(np.zeros(len(near_s))), 0.0)
    return np.where(count > 0, np.minimum(least, near_s - row_s), near_s - row_s)


@njit(cache=True)
def _any_way_s(metres, ends, s_per_m, gain_s, bends_s):  # type: ignore[no-untyped-def]
    """Return what any way between two ends takes at least, in seconds."""
    n = len(ends)
    out = np.zeros((n, n))
    for i in range(n):
        for j in range(i + 1, n):
            dx, dy = ends[i, 0] - ends[j, 0], ends[i, 1] - ends[j, 1]
            seconds = metres[i, j] * s_per_m - gain_s
            if metres[i, j] > AROUND * np.sqrt(dx * dx + dy * dy) + AROUND_M:
                seconds -= bends_s
            out[i, j] = out[j, i] = max(0.0, seconds)
    return out

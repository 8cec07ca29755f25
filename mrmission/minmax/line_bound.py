"""The bound for the lines of a plan, and for those that trips sweep."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise

import numpy as np

from mrmission.minmax.bounds.lanes import LanesBound, lanes_bound, many_lanes_bound
from mrmission.minmax.bounds.parts import NEAR
from mrmission.minmax.costs import kinds_of, speed_scales
from mrmission.minmax.hooks import Hooks, no_hooks
from mrmission.minmax.least import (
    gain_s,
    least_costs,
    least_home_s,
    least_lanes_s,
    way_speed_m_s,
)
from mrmission.minmax.travel import DENSE_ENDS, Arrays, floors_m, travel_between
from mrmission.minmax.trips import Allowance, stretches_of
from mrmission.model import BoolArray, CoveragePath, FloatArray, IntArray
from mrmission.tour.lines import SurveyLine, ends_of
from mrmission.tour.work import PartWork

STRAIGHT = 1e-3
"""Tangent of the bend up to which two legs are one line: long legs have places in between, each
rounded."""
ROOM = 1.001
"""Trips are taken to last so much longer than they may: exported places are rounded."""
Trips = tuple[FloatArray, FloatArray]
"""(robots,) how long a trip of each robot may last, and what lies between two of them, s."""


def bound_of_lines(
    lines: tuple[SurveyLine, ...],
    hooks: Hooks,
    work: PartWork,
    metres: FloatArray | None = None,
    trips: Trips | None = None,
    exact: BoolArray | None = None,
) -> LanesBound:
    """Return a time that no plan beats that sweeps these lines, each in one go.

    Parameters
    ----------
    lines, hooks
        The lines, and the hooks of their ends.
    work
        The part, with every robot once.
    metres
        (2 · lines, 2 · lines) lengths of the ways between the ends; None where they are not known.
    trips
        What is known of trips; None where all robots go out once.
    exact
        (2 · lines, 2 · lines) which of the lengths are exact: others are no more than that. All
        when None.
    """
    if metres is None:
        metres = work.harbour.distance_matrix(ends_of(lines).reshape(-1, 2))
    least = least_costs(
        lines, hooks, work.harbour, work.homes_m, work.times, metres,
        lanes_alone=work.options.lanes_alone_count, runs=max(work.options.runs_m) > 0, exact=exact,
    )  # fmt: skip
    assert least.end_cost is not None  # as it says
    return lanes_bound(
        line_s=least.lane_cost,
        end_s=least.end_cost,
        home_s=least.home_cost,
        sweep_scale=least.sweep_scale,
        travel_scale=least.travel_scale,
        trip_s=None if trips is None else trips[0],
        swap_s=None if trips is None else trips[1],
    )


def bound_of_listed_lines(
    lines: tuple[SurveyLine, ...], hooks: Hooks, work: PartWork, arrays: Arrays, which: IntArray
) -> LanesBound:
    """Return what :func:`bound_of_lines` does, where not all ways are known.

    Parameters
    ----------
    lines, hooks, work
        See there.
    arrays, which
        What is known of ways between more ends, see :class:`~mrmission.minmax.travel.Travel`, and
        (2 · lines,) which of them are those of the lines.
    """
    metres, exact = floors_m(arrays, which)
    return bound_of_lines(lines, hooks, work, metres, exact=exact)


def bound_of_many_lines(
    lines: tuple[SurveyLine, ...], near: IntArray, work: PartWork
) -> LanesBound:
    """Return what :func:`bound_of_lines` does, where a matrix of all ways would be too large.

    Parameters
    ----------
    lines, work
        See there; trips are not counted.
    near : (2 · lines, any) array
        The nearest ends of other lines, or some that are near.
    """
    ends = ends_of(lines).reshape(-1, 2)
    alone = work.options.lanes_alone_count
    sweep_scale, travel_scale = speed_scales(work.times)
    kinds = kinds_of(work.times)
    metres = work.harbour.distances(work.homes_m, ends)
    return many_lanes_bound(
        line_s=least_lanes_s(lines, work.times),
        ends_m=ends,
        near=near,
        speed_m_s=max(way_speed_m_s(t, lanes_alone=alone) * travel for t, _, travel in kinds),
        slack_s=max(gain_s(time) / travel for time, _, travel in kinds),
        home_s=least_home_s(metres, ends, work.homes_m, work.times, lanes_alone=alone),
        sweep_scale=sweep_scale,
        travel_scale=travel_scale,
    )


def trips_bound(work: PartWork, paths: Sequence[CoveragePath]) -> LanesBound | None:
    """Return a time that no plan beats that sweeps the lines of these trips, each in one go.

    Parameters
    ----------
    work
        With a robot for each trip; those of one robot have its number.
    paths
        The trips.

    Returns
    -------
    LanesBound or None
        For robots that come home in time, as their endurance asks for, with the time that they
        spend there; an endurance in metres is not counted. None where nothing is swept.
    """
    once = work.of_rows([work.robots.index(robot) for robot in dict.fromkeys(work.robots)])
    lines = lines_swept(paths, work.lines)
    if not lines:
        return None
    ends = ends_of(lines).reshape(-1, 2)
    if len(ends) > DENSE_ENDS:
        near = travel_between(work.harbour, ends, dense_ends=0).near[:, :NEAR]
        return bound_of_many_lines(lines, near.astype(np.int64), once)
    own = [work.options.of_robot(robot) for robot in once.robots]
    trip_s = ROOM * np.array([Allowance.of(options).seconds for options in own])
    swap_s = np.array([options.swap_time_s for options in own])
    return bound_of_lines(lines, no_hooks(len(ends)), once, trips=(trip_s, swap_s))


def lines_swept(
    paths: Sequence[CoveragePath], chosen: Sequence[SurveyLine]
) -> tuple[SurveyLine, ...]:
    """Return the lines that paths sweep, each as far as it is swept in one go.

    What is swept ends where a transit begins, and at every corner that is not one of a chosen line.

    Parameters
    ----------
    paths
        The paths.
    chosen
        The lines before they were cut.
    """
    corners = {tuple(point) for line in chosen for point in line.points_m[1:-1].tolist()}
    out = []
    for path in paths:
        for run_m in stretches_of(path).lines_m:
            before, after = np.diff(run_m, axis=0)[:-1], np.diff(run_m, axis=0)[1:]
            ahead = (before * after).sum(axis=1)
            across = np.abs(before[:, 0] * after[:, 1] - before[:, 1] * after[:, 0])
            bends = (np.flatnonzero((ahead <= 0) | (across > STRAIGHT * ahead)) + 1).tolist()
            borders = [i for i in bends if tuple(run_m[i].tolist()) not in corners]
            out += [
                SurveyLine(points_m=run_m[a : b + 1])
                for a, b in pairwise([0, *borders, len(run_m) - 1])
            ]
    return tuple(out)

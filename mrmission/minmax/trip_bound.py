"""The bound for chosen lines where robots come home in between: of lines as trips sweep them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from itertools import pairwise

import numpy as np

from mrmission.minmax.bounds.lanes import LanesBound
from mrmission.minmax.hooks import no_hooks
from mrmission.minmax.planner import bound_of, problems_of
from mrmission.minmax.trips import Allowance, stretches_of
from mrmission.model import CoveragePath
from mrmission.tour.lines import SurveyLine
from mrmission.tour.work import PartWork

STRAIGHT = 1e-3
"""Tangent of the bend up to which two legs are one line: long legs have places in between, each
rounded."""
ROOM = 1.001
"""Trips are taken to last so much longer than they may: exported places are rounded."""


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
        spend there; an endurance in metres is not counted. None where it is not known.
    """
    first = [work.robots.index(robot) for robot in dict.fromkeys(work.robots)]
    once = replace(
        work,
        robots=tuple(work.robots[i] for i in first),
        homes_m=work.homes_m[first],
        harbour=work.harbour.shared(first),
        times=tuple(work.times[i] for i in first),
    )
    lines = lines_swept(paths, work.lines)
    own = [work.options.of_robot(robot) for robot in once.robots]
    trip_s = ROOM * np.array([Allowance.of(options).seconds for options in own])
    swap_s = np.array([options.swap_time_s for options in own])
    _, least, beyond = problems_of(lines, no_hooks(2 * len(lines)), once)
    return bound_of(least, beyond, once, (trip_s, swap_s))


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

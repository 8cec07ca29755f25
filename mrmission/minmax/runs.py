"""Lines as the search prices them with run-ins and run-outs: from outer end to outer end.

The runs themselves are laid when a path is finished (:mod:`mrmission.tour.turnaround`), because
which end of a line is entered is not known before, and a run is left out where the way on would
leave the water. Before that a run at either end is taken for the mean of a run-in and a run-out. A
copter's runs, which may lie over land, cost their time and leave the ends where they are.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from mrmission.minmax.costs import LineCosts, line_costs, outward
from mrmission.minmax.hooks import Hooks
from mrmission.model import FloatArray
from mrmission.tour.lines import SurveyLine, ends_of, lengths_m
from mrmission.tour.timing import TimeModel
from mrmission.tour.turnaround import outer_ends
from mrmission.tour.work import PartWork


def part_costs(lines: tuple[SurveyLine, ...], hooks: Hooks, work: PartWork) -> LineCosts:
    """Return what a part's lines cost the search, runs included.

    Parameters
    ----------
    lines, hooks
        The work: the lines of the part and those made for what they leave.
    work
        The part.
    """
    alone = work.options.lanes_alone_count
    longer = with_runs(lines, work)
    costs = line_costs(longer, hooks, work.harbour, work.homes_m, work.times, lanes_alone=alone)
    if longer is not lines:  # bounds are those of the lines without their runs
        costs = replace(costs, metres=work.harbour.distance_matrix(ends_of(lines).reshape(-1, 2)))
    kinds = costs.kinds
    extra_s = [runs_s(lines, longer, work, time) / sweep for time, sweep, _ in kinds]
    return replace(costs, problem=costs.problem.dearer(extra_s))


def runs_s(
    lines: tuple[SurveyLine, ...], longer: tuple[SurveyLine, ...], work: PartWork, time: TimeModel
) -> FloatArray:
    """Return (lines,) seconds to be added to the price of each line with its runs.

    Runs are transits: where they are part of a line to be priced, what is added makes up for it.

    Parameters
    ----------
    lines, longer
        The lines, and what :func:`with_runs` makes of them.
    work, time
        The part, and how long the vehicle takes.
    """
    if max(work.options.runs_m) <= 0:
        return np.zeros(len(lines))
    if work.options.vehicle == "copter":
        return np.full(len(lines), sum(work.options.runs_m) / time.transit_speed_m_s)
    run_m = lengths_m(longer) - lengths_m(lines)
    return run_m * (1.0 / time.transit_speed_m_s - 1.0 / time.survey_speed_m_s)


def with_runs(lines: tuple[SurveyLine, ...], work: PartWork) -> tuple[SurveyLine, ...]:
    """Return the lines as they are to be priced.

    A boat's have a mean run at both ends, as long as there is water for it.
    """
    if max(work.options.runs_m) <= 0 or work.options.vehicle == "copter":
        return lines
    ends = ends_of(lines).reshape(-1, 2)
    outer = outer_ends(ends, outward(lines), float(np.mean(work.options.runs_m)), work.region_m)
    outer = outer.reshape(-1, 2, 2)
    moved = np.any(outer != ends.reshape(-1, 2, 2), axis=2)
    out = []
    for line, ((a, b), (before, after)) in zip(lines, zip(outer, moved, strict=True), strict=True):
        if before or after:
            head = a[None] if before else a[:0].reshape(0, 2)
            tail = b[None] if after else b[:0].reshape(0, 2)
            line = replace(line, points_m=np.concatenate([head, line.points_m, tail]))
        out.append(line)
    return tuple(out)

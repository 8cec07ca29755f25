"""Trips searched for: those of the whole fleet together, as few as fit, the longest shortest.

A trip is a robot of its own to the planner of lanes: one that lives at the berth of the robot that
makes it. So the trips of the whole fleet are searched for together, the longest as short as can be,
and robots of different endurance weigh their seconds differently. How many trips each robot makes
grows until they fit: next comes the robot whose trips would be over first.
"""

from __future__ import annotations

import contextlib
import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace

import numpy as np

from mrmission.errors import PlanningError
from mrmission.minmax.trips import TooFarError, TripCutter, may_hold
from mrmission.model import CoveragePath, FloatArray, LegKind
from mrmission.stages.trip_work import TripWork
from mrmission.tour.lines import SurveyLine, lengths_m
from mrmission.tour.path import join_pieces
from mrmission.tour.work import PartPlan, PartTours, PartWork

Planner = Callable[[PartWork], PartTours]
MOST_TRIPS = 400
QUICK_SHARE = 0.15
"""Of the time budget, to find out whether a number of trips may do."""
HOPE = 1.04
"""A quick search that misses by no more than this factor is worth a thorough one."""
LEAST_SHARE = 0.25
"""Trips of a robot are planned for no less of its endurance than this."""


class TripSearch:
    """Searches for the trips of one part.

    Parameters
    ----------
    base
        The part.
    planner
        What shares out lines among trips.
    """

    def __init__(self, base: TripWork, planner: Planner) -> None:
        self._base = base
        self._planner = planner

    def search(self, allowed_of: Sequence[float]) -> PartPlan:
        """Return the part with as few trips as the search finds to fit."""
        allowed = min(allowed_of)
        lines = self._fitting_lines(allowed)
        cut: PartPlan | None = None
        # what is too far for the robot that has it now, another may reach
        with contextlib.suppress(TooFarError):
            cut = self._base.plan_of(self._base.cut_tours(allowed_of))
        most = MOST_TRIPS if cut is None else len(cut.work.robots)
        for counts in self._growing(most):
            if not self._may_hold(counts, allowed, lines):
                continue
            found = self._searched(counts, lines, QUICK_SHARE)
            if self._base.endurance_used(found) > HOPE * allowed:
                continue
            if QUICK_SHARE * self._base.work.options.time_budget_s > 0:
                found = self._searched(counts, lines, 1.0)
            if self._base.endurance_used(found) <= allowed:
                if cut is None or sum(counts) < len(cut.work.robots):
                    return found
                return min((found, cut), key=self._base.makespan_s)
        if cut is None:
            raise PlanningError(
                f"{MOST_TRIPS} trips do not hold the work: choose a larger --endurance"
            )
        return cut

    def _growing(self, most: int) -> Iterator[list[int]]:
        """Yield how many trips each robot makes, few first, until they are `most` in all."""
        counts = [1] * len(self._base.work.robots)
        while True:
            yield list(counts)
            if sum(counts) >= most:
                return
            after = [self._base.busy_s(row, counts[row] + 1) for row in range(len(counts))]
            first = min(after)
            if not math.isfinite(first):
                return
            for row, end in enumerate(after):
                if end <= first * (1 + 1e-9):
                    counts[row] += 1

    def _weights(self, counts: Sequence[int]) -> FloatArray:
        """Return (robots, 2) how much a second of sweeping, and of travel, counts for each robot.

        Trips are weighed so that one that counts as much as the others is over in time for all its
        robot's trips to end when those of the others do.
        """
        rows = range(len(counts))
        end_s = min(self._base.busy_s(row, counts[row]) for row in rows)
        out = np.ones((len(counts), 2))
        for row in rows:
            own, count = self._base.own[row], counts[row]
            share_s = (end_s - (count - 1) * own.swap_time_s) / count
            full_s = self._base.full_s(row)
            if math.isfinite(full_s):
                share_s = max(share_s, LEAST_SHARE * full_s)
            by_way = math.isfinite(self._base.gauges[row].allowance.metres)
            out[row] = 1.0 / share_s
            out[row, 1] *= own.transit_speed_m_s / own.survey_speed_m_s if by_way else 1.0
        return out / out[0, 0]

    def _searched(
        self, counts: Sequence[int], lines: tuple[SurveyLine, ...], budget_share: float
    ) -> PartPlan:
        """Return the part with the trips of one search; trips without work are left out."""
        owners = [row for row, count in enumerate(counts) for _ in range(count)]
        options = self._base.work.options
        weights = self._weights(counts)[owners]
        work = replace(
            self._base.work.of_rows(owners),
            lines=lines,
            weights=None if np.all(weights == 1.0) else weights,
            options=replace(options, time_budget_s=budget_share * options.time_budget_s),
        )
        trips: list[list[CoveragePath]] = [[] for _ in counts]
        for row, path in zip(owners, self._planner(work).paths, strict=True):
            if len(path.kind) or not trips[row]:
                trips[row] = [p for p in trips[row] if len(p.kind)] + [path]
        return self._base.plan_of(trips)

    def _may_hold(self, counts: Sequence[int], allowed: float, lines: Sequence[SurveyLine]) -> bool:
        """Return False where so many trips surely are too few."""
        room_m: list[float] = []
        for row, count in enumerate(counts):
            allowance = self._base.gauges[row].allowance
            longest = min(
                allowance.metres, allowance.seconds * self._base.work.times[row].top_speed_m_s
            )
            if math.isinf(longest):
                return True
            room_m += [allowed * longest] * count
        length, reach = lengths_m(lines), self._reach_m(lines)
        return may_hold(length, reach, room_m)

    def _reach_m(self, lines: Sequence[SurveyLine]) -> FloatArray:
        """Return (lines,) how far each line is from the nearest home in the water, at least."""
        ends = np.array([line.ends_m for line in lines]).reshape(-1, 2)
        away = (
            self._base.work.harbour.distances(self._base.work.homes_m, ends)
            .min(axis=0)
            .reshape(-1, 2)
        )
        # along a line the way home grows no faster than the line
        return np.maximum(0.0, 0.5 * (away.sum(axis=1) - lengths_m(lines)))

    def _fitting_lines(self, allowed: float) -> tuple[SurveyLine, ...]:
        """Return the lines, those that no robot holds on a trip cut into pieces."""
        row = max(range(len(self._base.gauges)), key=self._base.full_s)
        if self._base.gauges[row].allowance.endless:
            return self._base.work.lines
        out: list[SurveyLine] = []
        ways = self._base.home_ways(row)
        ends = np.array([line.ends_m for line in self._base.work.lines]).reshape(-1, 2)
        away = self._base.work.harbour.distances(self._base.work.homes_m[row : row + 1], ends)[0]
        reach = away.reshape(-1, 2).sum(axis=1)
        gauge = self._base.gauges[row]
        slowest = min(self._base.own[row].survey_speed_m_s, self._base.own[row].transit_speed_m_s)
        most = min(gauge.allowance.metres, gauge.allowance.seconds * slowest)
        for line, far_m in zip(self._base.work.lines, reach.tolist(), strict=True):
            if 1.5 * (far_m + line.length_m) < allowed * most:
                out.append(line)  # surely fits, corners and all
                continue
            there, back = ways(line.ends_m)
            alone = join_pieces(
                row + 1,
                [
                    (there, LegKind.TRANSIT, 0),
                    (line.points_m, LegKind.SURVEY, 1),
                    (back[::-1], LegKind.TRANSIT, 0),
                ],
            )
            cutter = TripCutter(alone, ways, gauge, allowed)
            if len(cutter) < 2:
                out.append(line)
            else:
                out += [replace(line, points_m=piece) for piece in cutter.lines_m]
        return tuple(out)

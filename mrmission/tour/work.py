"""What the planner of one connected part of the water is given, and what it gives back."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import shapely

from mrmission.model import CoveragePath, FloatArray
from mrmission.options import PlanOptions
from mrmission.routing.harbour import Harbour
from mrmission.tour.coverage import Uncovered
from mrmission.tour.lines import SurveyLine, ends_of
from mrmission.tour.sweep import Sweep
from mrmission.tour.timing import TimeModel

if TYPE_CHECKING:
    from mrmission.minmax.bounds.lanes import LanesBound


@dataclass(frozen=True, slots=True, kw_only=True)
class PartWork:
    """One connected part of the water, and who sweeps it.

    Attributes
    ----------
    region_m
        The part of the navigable region, local frame.
    robots
        Numbers of its robots, from 1.
    homes_m
        (robots, 2) where each starts and ends.
    sweep
        The part cut into lanes and cells under one bearing.
    lines
        The lines to sweep, local frame: polylines, swept from either end. The lanes of the sweep
        come first, in their order; a fairway leaves out pieces of them.
    harbour
        Ways in the water; berth ``i`` is that of ``robots[i]``.
    uncovered
        What finds the rest that a set of legs leaves.
    times
        How long each of the robots takes.
    options
        What the user asked for.
    weights
        (robots, 2) how much a second of sweeping, and one of travel, counts for each robot; None
        where all count alike. Robots of different endurance are compared so.
    line_toll_s
        What each line counts beside its seconds, so that no robot has too many of them.
    """

    region_m: shapely.Polygon
    robots: tuple[int, ...]
    homes_m: FloatArray
    sweep: Sweep
    lines: tuple[SurveyLine, ...]
    harbour: Harbour
    uncovered: Uncovered
    times: tuple[TimeModel, ...]
    options: PlanOptions
    weights: FloatArray | None = None
    line_toll_s: float = 0.0

    @property
    def in_trips(self) -> bool:
        """Return whether some robot stands here more than once: for each of its trips."""
        return len(set(self.robots)) < len(self.robots)

    def of_rows(self, rows: Sequence[int]) -> PartWork:
        """Return the work of the robots of these rows, which may come more than once."""
        return replace(
            self,
            robots=tuple(self.robots[row] for row in rows),
            homes_m=self.homes_m[list(rows)],
            harbour=self.harbour.shared(rows),
            times=tuple(self.times[row] for row in rows),
        )

    @property
    def lines_m(self) -> FloatArray:
        """Return (n, 2, 2) ends of the lines; what lies between them may be bent."""
        return ends_of(self.lines)

    @property
    def time(self) -> TimeModel:
        """Return how long the first robot takes, for stages that take all for alike."""
        return self.times[0]


@dataclass(frozen=True, slots=True, kw_only=True)
class PartTours:
    """What a planner makes of a part.

    Attributes
    ----------
    method
        Name of the method that made it.
    paths
        Per robot its way from home to home; numbered from 1 within the part.
    lanes_bound
        Finds what no plan of the same lines can beat; it may take seconds, so only the tours that
        are chosen at last are asked. None where the planner knows of no bound.
    """

    method: str
    paths: tuple[CoveragePath, ...]
    lanes_bound: Callable[[], LanesBound] | None = None


@dataclass(frozen=True, slots=True, kw_only=True)
class PartPlan:
    """A part and its tours."""

    work: PartWork
    tours: PartTours

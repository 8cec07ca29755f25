"""All lines of a part: laps along the shore, the lanes inside, tie lines across."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import shapely

from mrmission.area.frame import LocalFrame
from mrmission.area.legs import leg_tolerance_m
from mrmission.errors import PlanningError
from mrmission.mission.survey_lines import name_lines
from mrmission.model import Mission, TieReport
from mrmission.options import PlanOptions
from mrmission.tour.coverage import BESIDE_M
from mrmission.tour.fairway import Fairway, lanes_with_fairway
from mrmission.tour.lines import (
    LineKind,
    SurveyLine,
    geometry_of,
    lane_lines,
    lengths_m,
    letters,
)
from mrmission.tour.sweep import Sweep
from mrmission.tour.work import PartPlan

ALONG_M = 10.0
"""A tie line this long within a hair of a lap runs along it; one that crosses it does not."""


def lines_to_sweep(
    sweep: Sweep,
    region_m: shapely.Polygon,
    options: PlanOptions,
    fairway: Fairway | None = None,
) -> tuple[SurveyLine, ...]:
    """Return all lines that a part is to be swept along, local frame: lanes, laps, tie lines.

    With a fairway the lanes end at it, and its own lanes come after them.

    Raises
    ------
    PlanningError
        When tie lines are asked for and none crosses a lane.
    """
    lanes = lane_lines(sweep) if fairway is None else lanes_with_fairway(sweep, fairway)
    shore: tuple[SurveyLine, ...] = ()
    if options.shore_laps:
        from mrmission.tour.shore import lanes_inside, shore_laps

        laps = shore_laps(
            region_m,
            options.shore_laps,
            options.swath_m,
            options.overlap,
            leg_tolerance_m(options.swath_m),
            float(lengths_m(lanes).mean()),
        )
        if laps.lines:
            shore, lanes = laps.lines, lanes_inside(sweep, laps.inner_m)
    ties: tuple[SurveyLine, ...] = ()
    if options.tie_lines is not None:
        from mrmission.tour.ties import tie_lines

        covering = (*lanes, *shore)
        ties = tie_lines(region_m, sweep.frame.bearing_deg, covering, options.tie_lines)
    lines = (*lanes, *shore, *ties)
    if not lines:
        raise PlanningError("no line fits the region: choose a smaller --swath")
    return lines


def not_counted(lines: tuple[SurveyLine, ...], sweep: Sweep) -> shapely.Geometry | None:
    """Return the lines (sweep frame) that cover nothing, None if there are none.

    A tie line that runs along a lap for a while is not among them: legs there are the lap's.
    """
    ties = geometry_of([line for line in lines if line.kind is LineKind.TIE])
    if not ties:
        return None
    laps = geometry_of([line for line in lines if line.kind is LineKind.SHORE])
    near_laps = shapely.buffer(shapely.MultiLineString(laps), 2 * BESIDE_M)
    along = shapely.length(shapely.intersection(ties, near_laps))
    alone = [tie for tie, m in zip(ties, along, strict=True) if m < ALONG_M]
    return sweep.frame.turn(shapely.MultiLineString(alone)) if alone else None


def fleet_lines(parts: Sequence[PartPlan]) -> tuple[SurveyLine, ...]:
    """Return the lines of all parts, local frame; of several parts each name bears its letter."""
    if len(parts) == 1:
        return parts[0].work.lines
    return tuple(
        replace(line, name=f"{letters(i).upper()}.{line.name}")
        for i, part in enumerate(parts)
        for line in part.work.lines
    )


def with_lines(
    missions: Sequence[Mission], parts: Sequence[PartPlan], frame: LocalFrame
) -> tuple[Mission, ...]:
    """Return the missions with their lines, see :func:`~mrmission.mission.survey_lines.name_lines`.

    The hooks and extras of planners and repair have no name of their own.
    """
    named = [line for line in fleet_lines(parts) if line.kind is not LineKind.EXTRA]
    return name_lines(missions, named, frame)


def lanes_of(mission: Mission) -> int:
    """Return how many lines a mission sweeps; extras count where there is nothing else."""
    lines = sum(line.kind != LineKind.EXTRA for line in mission.lines)
    return lines or len(mission.lines)


def tie_report(parts: Sequence[PartPlan]) -> TieReport | None:
    """Return how the tie lines meet the other lines; None without tie lines."""
    lines = fleet_lines(parts)
    if not any(line.kind is LineKind.TIE for line in lines):
        return None
    from mrmission.tour.ties import crossings

    return crossings(lines)

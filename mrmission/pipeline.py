"""The stages in order: a survey area and options in, a fleet plan out.

==================================  ============================================================
:mod:`mrmission.stages.groups`      which robots sweep which connected part of the water
:mod:`mrmission.stages.part`        a part: berths, bearing, lines to sweep, its planner
:mod:`mrmission.stages.cells`       a planner: whole cells, the paper's methods
:mod:`mrmission.minmax.planner`     a planner: lanes, the longest tour as short as can be
:mod:`mrmission.stages.export`      paths to routes: complete, turned, rounded as exported
:mod:`mrmission.stages.finish`      routes to missions, start times and the report
==================================  ============================================================
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

from mrmission.area.frame import LocalFrame, project_polygons
from mrmission.area.region import navigable_region, parts_by_size
from mrmission.errors import GeometryError
from mrmission.model import FleetPlan, SurveyArea
from mrmission.options import PlanOptions
from mrmission.stages.finish import Survey, finish
from mrmission.stages.groups import robots_by_part
from mrmission.stages.part import plan_part
from mrmission.tour.flight import time_model


def plan(
    area: SurveyArea,
    options: PlanOptions,
    assumed: Mapping[str, Any] | None = None,
    *,
    on_stage: Callable[[str], None] = lambda _: None,
) -> FleetPlan:
    """Plan a fleet survey of an area.

    Parameters
    ----------
    area
        The water to sweep.
    options
        What the user asked for.
    assumed
        Options that the user did not give, by name, for the report.
    on_stage
        Called with a few words when a stage begins.

    Raises
    ------
    GeometryError
        When no water is left, or a start lies on land.
    PlanningError
        When no plan can be made.
    """
    on_stage("finding the water")
    frame = LocalFrame.of(area)
    water = project_polygons(area.water_lonlat, frame)
    region = navigable_region(water, options.clearance_m)
    notes = list(area.notes)
    too_large = frame.error_note(water)
    if too_large:
        notes.append(too_large)
    if options.clearance_m == 0:
        notes.append("clearance 0 m: lanes touch the shore and the islands")
    pieces = parts_by_size(region)
    if not pieces:
        raise GeometryError(
            f"{area.source}: no water is left at a clearance of {options.clearance_m:g} m: "
            "choose a smaller --clearance"
        )
    groups, unreached = robots_by_part(pieces, water, frame, options, notes)
    survey = Survey(
        area=area,
        frame=frame,
        water_m=water,
        unreached_m=tuple(unreached),
        options=options,
        times=tuple(time_model(options.of_robot(r)) for r in range(1, options.robots + 1)),
        assumed=dict(assumed or {}),
    )
    on_stage("planning")
    parts = [
        plan_part(part, water, starts, robots, options, survey.times, notes)
        for part, starts, robots in groups
    ]
    on_stage("fencing and checking")
    return finish(survey, parts, notes)

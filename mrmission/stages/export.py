"""Paths -> routes: complete, turned as the vehicle turns, in exported and rounded coordinates."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
import shapely

from mrmission.area.frame import LocalFrame
from mrmission.area.legs import leg_tolerance_m
from mrmission.errors import PlanningError
from mrmission.mission.build import Route, export_route
from mrmission.model import CoveragePath, LegKind
from mrmission.options import PlanOptions
from mrmission.tour.coverage import Uncovered, total_area
from mrmission.tour.repair import fleet_legs, number_lanes, pieces_to_repair, repair
from mrmission.tour.turns import Turns
from mrmission.tour.work import PartPlan

MAX_EXPORT_ROUNDS = 6


@dataclass(frozen=True, slots=True, kw_only=True)
class Coverage:
    """What the routes of a part cover, m², on exported coordinates; what to say of their turns."""

    covered_m2: float
    covered_by_survey_m2: float
    largest_missed_m2: float
    notes: tuple[str, ...] = ()


def export_part(
    part: PartPlan, frame: LocalFrame, *, fits: Callable[[list[Route]], bool] = lambda _: True
) -> tuple[list[Route], Coverage | None]:
    """Return the routes in exported, rounded coordinates, complete as measured on these.

    Parameters
    ----------
    part
        With its tours.
    frame
        Local frame of the plan.
    fits
        Whether routes will do. What those that do not cover is not measured: None.

    Raises
    ------
    PlanningError
        When something stays uncovered.
    """
    work, options = part.work, part.work.options
    tolerance = leg_tolerance_m(options.swath_m)
    turn = work.sweep.frame
    alone = options.lanes_alone_count
    turns = Turns(work)
    paths = turns.before_covering(part.tours.paths)
    for _ in range(MAX_EXPORT_ROUNDS):
        whole = repair(
            paths, work.uncovered, turn, work.harbour, work.times, options.swath_m, alone
        )
        paths = turns.after_covering(whole, paths)
        turned = turns.for_export(paths)
        routes = [export_route(number_lanes(p), frame, tolerance) for p in turned]
        legs = fleet_legs([r.path for r in routes], turn, lanes_alone=alone)
        pieces = work.uncovered.remainder(legs, rounded=True)
        if not pieces_to_repair(pieces, options.swath_m, work.region_m.area, final=True):
            break
    else:
        worst = max(p.area for p in pieces)
        raise PlanningError(f"{worst:.2f} m² stay uncovered: choose another --angle or --swath")
    if not fits(routes):
        return routes, None
    lane = np.concatenate([r.path.kind for r in routes]) == LegKind.SURVEY
    if alone:  # no other legs were taken
        lane = lane[lane]
    by_survey_m2, left_m2 = work.uncovered.left_m2(legs[lane], legs[~lane])
    return routes, Coverage(
        covered_m2=work.region_m.area - left_m2,
        covered_by_survey_m2=work.region_m.area - by_survey_m2,
        largest_missed_m2=max((p.area for p in pieces), default=0.0),
        notes=turns.notes(frame),
    )


def covered_beyond_m2(
    water: shapely.MultiPolygon,
    parts: Sequence[PartPlan],
    paths: Sequence[CoveragePath],
    options: PlanOptions,
) -> float:
    """Return the area, m², that is covered outside the planned regions: the clearance strip."""
    rest = shapely.difference(water, shapely.union_all([p.work.region_m for p in parts]))
    if rest.area < 1e-6 * water.area:
        return 0.0
    sweep = parts[0].work.sweep
    uncovered = Uncovered(sweep.frame.turn(rest), sweep.column_pitch_m, options.swath_m / 2)
    legs = fleet_legs(paths, sweep.frame, lanes_alone=options.lanes_alone_count)
    return float(rest.area) - total_area(uncovered.remainder(legs))

"""The work of one part of a drawn lake, as the planner of a part is given it."""

from __future__ import annotations

import numpy as np
import shapely

from mrmission.model import FloatArray
from mrmission.options import PlanOptions
from mrmission.routing.harbour import Harbour
from mrmission.tour.coverage import Uncovered
from mrmission.tour.flight import time_model
from mrmission.tour.lines import SurveyLine, lane_lines
from mrmission.tour.sweep import sweep_region
from mrmission.tour.work import PartWork


def part_work(
    region_m: shapely.Polygon,
    homes_m: FloatArray,
    options: PlanOptions,
    *,
    spacing_m: float,
    bearing_deg: float = 0.0,
    lines: tuple[SurveyLine, ...] | None = None,
) -> PartWork:
    """The work of robots that are alike; the lines are the sweep's lanes where none are given."""
    robots = len(homes_m)
    sweep = sweep_region(region_m, bearing_deg, spacing_m)
    return PartWork(
        region_m=region_m,
        robots=tuple(range(1, robots + 1)),
        homes_m=homes_m,
        sweep=sweep,
        lines=lane_lines(sweep) if lines is None else lines,
        harbour=Harbour(region_m, homes_m),
        uncovered=Uncovered(sweep.region, sweep.column_pitch_m, options.swath_m / 2),
        times=(time_model(options),) * robots,
        options=options,
    )


def in_a_row(lake_m: shapely.Polygon, robots: int) -> FloatArray:
    """(robots, 2) homes 6 m from each other, the first somewhere inside."""
    inner = shapely.get_coordinates(lake_m.representative_point())[0]
    return inner + 6.0 * np.arange(robots)[:, None] * [1.0, 0.0]

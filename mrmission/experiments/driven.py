"""The environments as water: plans in seconds, and what simulated boats drive of them."""

from __future__ import annotations

import asyncio
import tempfile
from pathlib import Path

import numpy as np

from mrmission.area.image import read_image
from mrmission.experiments.environments import free_pixels
from mrmission.experiments.jobs import Job, Result
from mrmission.model import BoolArray, FleetPlan, SurveyArea
from mrmission.options import PlanOptions

ORIGIN_LONLAT = (10.0, 50.0)
"""Where the lower left corner of every map is laid."""
ALONG_COLUMNS_DEG = 0.0
"""Lanes run along the columns of the map, as the paper's do."""


def save_map(free: BoolArray, path: Path) -> None:
    """Write a map as an image, white free and black an obstacle."""
    from PIL import Image

    pixels = (np.ascontiguousarray(free.T[::-1]) * 255).astype(np.uint8)
    Image.fromarray(pixels).save(path)


def water_of(source: str, metres_per_px: float) -> SurveyArea:
    """Return an environment as a survey area: its free pixels, `metres_per_px` each way."""
    with tempfile.TemporaryDirectory() as folder:
        name = source.removeprefix("own:") if source.startswith("own:") else Path(source).stem
        path = Path(folder) / f"{name}.png"
        save_map(free_pixels(source), path)
        return read_image(path, metres_per_px, ORIGIN_LONLAT, part=1)


def plan_in_seconds(job: Job) -> Result:
    """Plan an environment as `mrmission plan` does; the result is in seconds and metres.

    ``source``, ``metres_per_px``, ``swath_m``, ``clearance_m``, ``method``, ``robots``,
    ``time_budget_s``.
    """
    report = _plan(job).report
    return {
        "makespan_s": report.makespan_s,
        "lower_bound_s": report.lower_bound_s,
        "lanes_bound_s": report.lanes_bound_s,
        "utilization": report.utilization,
        "total_s": sum(robot.duration_s for robot in report.robots),
    }


def drive_plan(job: Job) -> Result:
    """Plan as :func:`plan_in_seconds`, sail the plan with simulated boats, and compare.

    ``speedup`` is how fast the boats' clocks run; nothing in the result hangs on it.
    """
    from mrmission.rehearse.judge import Limits, judge
    from mrmission.rehearse.run import Waters, sail_missions, sailing_rounds

    plan = _plan(job)
    waters = Waters(speedup=job["speedup"])
    tracks = [
        track
        for missions in sailing_rounds(plan.missions)
        for track in asyncio.run(sail_missions(missions, waters))
    ]
    driven = judge(
        plan,
        tracks,
        limits=Limits(coverage=0.0, cross_track_m=np.inf, distance_m=0.0, home_m=np.inf),
        delays_s={row.robot: row.start_delay_s for row in plan.report.robots},
        waters=waters.as_dict(),
    )
    return {
        "planned_s": [robot.planned_s for robot in driven.robots],
        "driven_s": [robot.driven_s for robot in driven.robots],
        "planned_makespan_s": driven.planned_makespan_s,
        "driven_makespan_s": driven.driven_makespan_s,
        "planned_coverage": driven.planned_coverage,
        "driven_coverage": driven.coverage.share,
        "cross_track_p95_m": driven.cross_track.p95_m,
        "home": [robot.home for robot in driven.robots],
    }


def _plan(job: Job) -> FleetPlan:
    from mrmission.pipeline import plan

    options = PlanOptions(
        robots=job["robots"],
        method=job["method"],
        swath_m=job["swath_m"],
        clearance_m=job["clearance_m"],
        time_budget_s=job["time_budget_s"],
        angle_deg=ALONG_COLUMNS_DEG,
    )
    return plan(water_of(job["source"], job["metres_per_px"]), options)

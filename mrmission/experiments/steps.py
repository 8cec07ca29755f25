"""The jobs of the study: functions of plain values, each of one map."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from functools import partial
from typing import Any

import numpy as np

from mrmission.experiments.environments import free_pixels
from mrmission.experiments.jobs import Job, Result
from mrmission.experiments.lanes import lane_tours, strips_of
from mrmission.experiments.random_maps import RandomMapOptions, random_map
from mrmission.experiments.readings import Planner, Reading, all_readings, name_of, reading_of
from mrmission.experiments.world import PaperWorld, paper_world
from mrmission.model import BoolArray

LANES_BUDGET_S = 0.15
"""Search for the random maps: some hundred strips each, 200 maps, six fleets."""


def map_of(job: Job) -> BoolArray:
    """Return the pixels that a job is about: ``source``, or ``seed`` and ``number``."""
    if "source" in job:
        return free_pixels(job["source"])
    return random_map(job["seed"], job["number"])


def graph_figures(world: PaperWorld) -> dict[str, float]:
    """Return what Table 1 counts, and the free area."""
    reeb = world.decomposition.reeb
    degree = np.bincount(np.concatenate([reeb.tail, reeb.head]))
    return {
        "vertices": len(reeb.node_m),
        "odd_vertices": int((degree % 2).sum()),
        "edges": len(reeb.tail),
        "tour_length": len(world.tour.edge),
        "tour_cost": float(world.problem.step_costs(world.tour).sum()),
        "free_px": world.free_px,
    }


def paper_plans(job: Job) -> Result:
    """Plan one map with the paper's planners.

    ``readings`` are their names, or "all"; ``robots`` the sizes of the fleet. The result has per
    reading one row per k: the maximum cost, the robots with work, the robots that sweep anything
    for the first time, and the area that nobody sweeps.
    """
    world = paper_world(map_of(job))
    planner = Planner(world)
    given: Sequence[str] | str = job["readings"]
    readings = (
        list(all_readings()) if isinstance(given, str) else [reading_of(name) for name in given]
    )
    plans: dict[str, Any] = {}
    for reading in readings:
        rows = []
        for robots in job["robots"]:
            plan = planner.plan(reading, robots)
            rows.append(
                [
                    float(plan.cost.max()),
                    plan.tours,
                    int(sum(plan.sweeps)),
                    planner.missed_px(reading, plan),
                ]
            )
        plans[name_of(reading)] = rows
    costs = {doubled: planner.tour_cost(doubled) for doubled in ("halves", "full", "travel")}
    return {"graph": graph_figures(world), "tour_costs": costs, "plans": plans}


def lane_plans(job: Job) -> Result:
    """Plan one map with the lane planner: per k the maximum cost and the robots with work.

    With ``drawn``, also the tours for that many robots: the ends at which strips are entered.
    """
    free = map_of(job)
    world = paper_world(free)
    strips = strips_of(free, world)
    rows = []
    drawn: list[list[int]] = []
    for robots in job["robots"]:
        tours = lane_tours(strips, robots, job["time_budget_s"], job["search_seed"])
        rows.append([float(tours.cost.max()), sum(len(entries) > 0 for entries in tours.entries)])
        if robots == job.get("drawn"):
            drawn = [entries.tolist() for entries in tours.entries]
    return {"strips": len(strips.area), "rows": rows, "free_px": world.free_px, "drawn": drawn}


def least_costs(job: Job) -> Result:
    """Return what no sharing of a map's strips can be below: per k a bound on the maximum cost.

    All strips are swept by somebody, and each by a tour that goes there and back.
    """
    free = map_of(job)
    strips = strips_of(free, paper_world(free))
    trips = strips.home_cost.reshape(-1, 2).sum(axis=1) + strips.area
    total = float(strips.area.sum())
    return {"bounds": [max(total / robots, float(trips.max())) for robots in job["robots"]]}


def stage_times(job: Job) -> Result:
    """Measure the run time of each stage on a random map with about ``obstacles`` obstacles.

    ``n`` is the number of pixels, ``edges`` that of cells. Times are processor seconds, the best of
    ``repeats``: other work on the machine does not count.
    """
    side = max(9, round((job["obstacles"] * 20) ** 0.5))
    options = RandomMapOptions(
        columns=(side, side),
        rows=(3 * side, 3 * side),
        obstacles=(job["obstacles"], job["obstacles"]),
        column_pitch_px=(6, 6),
        row_pitch_px=(3, 3),
    )
    free = random_map(job["seed"], job["number"], options)
    world = paper_world(free)
    planner = Planner(world)
    repeats, robots = job["repeats"], job["robots"]
    defaults = {name.split()[0]: reading_of(name) for name in job["readings"]}
    stages: dict[str, Callable[[], Any]] = {
        "decomposition": partial(_decompose, free),
        "ECC": world.problem.ecc,
        **{name: partial(_plan_anew, planner, r, robots) for name, r in defaults.items()},
    }
    times = {}
    for name, stage in stages.items():
        best = np.inf
        for _ in range(repeats):
            begin = time.process_time()
            stage()
            best = min(best, time.process_time() - begin)
        times[name] = best
    begin = time.process_time()
    strips = strips_of(free, world)
    times["strips and ways"] = time.process_time() - begin
    begin = time.process_time()
    lane_tours(strips, robots, job["time_budget_s"], 0)
    times["minmax"] = time.process_time() - begin
    return {
        "graph": graph_figures(world),
        "pixels": int(free.size),
        "slices": len(world.decomposition.slices),
        "strips": len(strips.area),
        "seconds": times,
    }


def _plan_anew(planner: Planner, reading: Reading, robots: int) -> None:
    planner.forget()
    planner.plan(reading, robots)


def _decompose(free: BoolArray) -> None:
    from mrmission.decomposition.cells import decompose
    from mrmission.decomposition.slices import slices_of_grid
    from mrmission.model import OccupancyGrid

    grid = OccupancyGrid(free=free, column_pitch_m=1.0, row_pitch_m=1.0, origin_m=(0.0, 0.0))
    decompose(slices_of_grid(grid))

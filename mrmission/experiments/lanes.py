"""Our row of the paper's tables: strips of pixels shared out by the lane planner, in its cost."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from mrmission.area.image import pixel_polygons
from mrmission.experiments.world import PaperWorld
from mrmission.minmax.search import LaneProblem, LaneTours, minmax
from mrmission.model import BoolArray, FloatArray, IntArray
from mrmission.routing.water import WaterRouter

MOST_STRIPS = 1200
"""Strips are one pixel wide, or as many as it takes to have no more of them than this."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Strips:
    """The cells cut into strips along the columns.

    Attributes
    ----------
    area
        (strips,) px².
    cell
        (strips,) the cell of each.
    slices
        Per strip the slices that it is made of.
    end_cost
        (2·strips, 2·strips) px, in free space, between the ends; 2i is the lower end of strip i.
    home_cost
        (2·strips,) px from v1.
    """

    area: FloatArray
    cell: IntArray
    slices: tuple[IntArray, ...]
    end_cost: FloatArray
    home_cost: FloatArray


def strip_slices(world: PaperWorld) -> tuple[tuple[IntArray, ...], IntArray]:
    """Return the slices of each strip that a map's cells are cut into, and the cell of each."""
    done = world.decomposition
    width = max(1, -(-len(done.slices) // MOST_STRIPS))
    groups: list[IntArray] = []
    cell: list[int] = []
    for i, (a, b) in enumerate(zip(done.cells.offsets[:-1], done.cells.offsets[1:], strict=True)):
        index = done.cells.slice_index[a:b]
        groups.extend(index[at : at + width] for at in range(0, len(index), width))
        cell.extend([i] * (len(groups) - len(cell)))
    return tuple(groups), np.array(cell, dtype=np.int64)


def strips_of(free: BoolArray, world: PaperWorld, start_node: int = 0) -> Strips:
    """Cut a map's cells into strips and measure the ways between them.

    A strip is swept from one end to the other at the cost of its area, as the paper's cells are. A
    way between two ends is measured from edge to edge: from the middle of one to the middle of the
    other, round obstacles, less half the width of both, so that the turn into the strip beside
    costs no more than it does within the paper's cells, which is nothing.
    """
    done = world.decomposition
    low, high = done.slices.row_start, done.slices.row_stop
    groups, cell = strip_slices(world)
    middle = np.array([group[len(group) // 2] for group in groups])
    x = done.slices.column[middle] + 0.5
    ends = np.stack(
        [np.column_stack([x, low[middle] + 0.5]), np.column_stack([x, high[middle] - 0.5])], axis=1
    ).reshape(-1, 2)
    router = WaterRouter(max(pixel_polygons(free), key=lambda polygon: float(polygon.area)))
    home = done.reeb.node_m[start_node][None]
    half = np.repeat([len(group) / 2 for group in groups], 2)
    ways = np.maximum(0.0, router.distance_matrix(ends) - half[:, None] - half[None, :])
    return Strips(
        area=np.array([float((high[g] - low[g]).sum()) for g in groups]),
        cell=cell,
        slices=groups,
        end_cost=ways,
        home_cost=router.distances(home, ends)[0],
    )


def lane_tours(strips: Strips, robots: int, time_budget_s: float, seed: int) -> LaneTours:
    """Return the tours of `robots` robots that share the strips."""
    problem = LaneProblem(
        lane_cost=strips.area,
        end_cost=strips.end_cost,
        home_cost=np.repeat(strips.home_cost[None], robots, axis=0),
    )
    return minmax(problem, time_budget_s, seed)

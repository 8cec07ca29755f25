"""Which robot sweeps which pixels, as a raster and as polygons."""

from __future__ import annotations

import json
from collections.abc import Sequence

import numpy as np
import numpy.typing as npt
import shapely

from mrmission.area.image import pixel_polygons
from mrmission.decomposition.cells import split_cell
from mrmission.experiments.lanes import strip_slices
from mrmission.experiments.readings import ClusterReading, PaperPlan, Reading
from mrmission.experiments.world import PaperWorld
from mrmission.model import BoolArray

OBSTACLE, NOBODY = -1, 0
Owners = npt.NDArray[np.int16]
"""(columns, rows): the robot that sweeps a pixel, from 1; 0 nobody, -1 an obstacle."""


def owners_of_plan(free: BoolArray, world: PaperWorld, reading: Reading, plan: PaperPlan) -> Owners:
    """Return who sweeps what under one of the paper's planners.

    Of a doubled cell that is walked twice in halves each half goes to who walks it; a pixel that
    the boundary between the halves cuts goes to the lower one when its middle lies below.
    """
    out = _empty(free)
    by_step = not (isinstance(reading, ClusterReading) and reading.pieces == "cells")
    tour = world.tour
    for robot, pieces in enumerate(plan.pieces, start=1):
        for piece in pieces.tolist():
            cell = int(tour.edge[piece]) if by_step else piece
            half = int(tour.copy[piece]) if by_step else 0
            _paint_cell(out, world, cell, half, robot)
    return out


def owners_of_lanes(
    free: BoolArray, world: PaperWorld, entries_of: Sequence[Sequence[int]]
) -> Owners:
    """Return who sweeps what under the lane planner, given where each robot enters its strips."""
    out = _empty(free)
    slices, (groups, _) = world.decomposition.slices, strip_slices(world)
    for robot, entries in enumerate(entries_of, start=1):
        for entry in entries:
            for s in groups[entry >> 1].tolist():
                out[slices.column[s], slices.row_start[s] : slices.row_stop[s]] = robot
    return out


def _empty(free: BoolArray) -> Owners:
    return np.where(free, NOBODY, OBSTACLE).astype(np.int16)


def _paint_cell(out: Owners, world: PaperWorld, cell: int, half: int, robot: int) -> None:
    slices, cells = world.decomposition.slices, world.decomposition.cells
    index = cells.slice_index[cells.offsets[cell] : cells.offsets[cell + 1]]
    low, high = slices.row_start[index], slices.row_stop[index]
    if half:
        middle = np.floor(split_cell(world.decomposition, cell) + 0.5).astype(np.int32)
        low, high = (low, middle) if half == 1 else (middle, high)
    for column, a, b in zip(
        slices.column[index].tolist(), low.tolist(), high.tolist(), strict=True
    ):
        out[column, a:b] = robot


def regions_geojson(owners: Owners, name: str) -> str:
    """Return each robot's region as a GeoJSON text of MultiPolygons, in pixels.

    The lower left corner of the map is (0, 0); x goes right, y up.
    """
    features = []
    for robot in range(1, int(owners.max(initial=0)) + 1):
        mine = owners == robot
        if not mine.any():
            continue
        shape = shapely.MultiPolygon(pixel_polygons(np.ascontiguousarray(mine)))
        features.append(
            {
                "type": "Feature",
                "properties": {"robot": robot, "area_px": int(mine.sum())},
                "geometry": json.loads(shapely.to_geojson(shape)),
            }
        )
    return json.dumps({"type": "FeatureCollection", "name": name, "features": features}) + "\n"

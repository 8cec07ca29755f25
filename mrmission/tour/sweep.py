"""Cells -> lanes: the sweep frame, the lane columns, the lanes of each cell and of its halves."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
import shapely

from mrmission import libm
from mrmission.decomposition.cells import decompose
from mrmission.decomposition.slices import lane_intervals, slices_of_polygon
from mrmission.errors import PlanningError
from mrmission.model import Decomposition, FloatArray, IntArray
from mrmission.options import MIN_LANE_OVERLAP_M

ROWS_PER_COLUMN = 16
"""Rows of the decomposition per lane spacing: a slice's end is known to a sixteenth of a lane."""
MAX_ROWS = 1_000_000


TOUCHING_M = 8.0
"""From this swath on lanes may lie a whole swath apart: of wider footprints the hair's breadths
that rounding leaves between two lanes are below 0.05 %."""
HAIR_M = 0.012
"""A coordinate of a mission is rounded to 1e-7 degrees, so two lanes that touch may end up so far
from each other, on slanting courses a little farther: see ``coverage.ROUNDED_HAIR_M``."""
SAME_SHARE = 5e-5
"""Columns may be wider than asked for by this share, rather than one more."""


def lane_spacing_m(swath_m: float, overlap: float, leg_tolerance_m: float) -> float:
    """Return the widest spacing at which neighbouring lanes leave no gap after rounding."""
    margin = MIN_LANE_OVERLAP_M + leg_tolerance_m
    return min(swath_m * (1 - overlap), max(swath_m - margin, 0.8 * swath_m))


def widest_spacing_m(swath_m: float, overlap: float, leg_tolerance_m: float) -> float:
    """Return the widest spacing of lanes: a swath less the overlap, and less what rounding needs.

    Where the swath is wide that is left out: lanes without overlap may be a hair's breadth apart.
    """
    if swath_m >= TOUCHING_M:
        return swath_m * (1 - overlap)
    return lane_spacing_m(swath_m, overlap, leg_tolerance_m)


def hair_m(swath_m: float, pitch_m: float, leg_tolerance_m: float) -> float:
    """Return how wide a gap between lanes at a pitch is no more than rounding."""
    touching = pitch_m > lane_spacing_m(swath_m, 0.0, leg_tolerance_m) * (1 + SAME_SHARE)
    return HAIR_M if touching else 0.0


@dataclass(frozen=True, slots=True, kw_only=True)
class SweepFrame:
    """The local frame turned so that lanes of a compass bearing run along its second axis."""

    bearing_deg: float

    @property
    def _axes(self) -> FloatArray:
        """Return rows ``[across, along]`` as unit vectors in the local frame."""
        b = math.radians(self.bearing_deg)
        return np.array([[math.cos(b), -math.sin(b)], [math.sin(b), math.cos(b)]])

    def to_sweep(self, points_m: FloatArray) -> FloatArray:
        """Turn (..., 2) local points into sweep coordinates."""
        return libm.times(points_m, self._axes.T)

    def to_local(self, sweep_m: FloatArray) -> FloatArray:
        """Turn (..., 2) sweep coordinates into local points."""
        return libm.times(sweep_m, self._axes)

    def turn(self, geometry: shapely.Geometry) -> shapely.Geometry:
        """Return a geometry of the local frame in the sweep frame."""
        return shapely.transform(geometry, self.to_sweep)


@dataclass(frozen=True, slots=True, kw_only=True)
class Sweep:
    """One region cut into columns, lanes and cells under one bearing.

    Lanes are vertical lines of the sweep frame: lane ``i`` lies at ``lane_x_m[i]`` from
    ``lane_y_m[i, 0]`` up to ``lane_y_m[i, 1]``, in column ``lane_column[i]``, and belongs to
    cell ``lane_cell[i]``. Lanes are sorted by cell, column and height.
    """

    frame: SweepFrame
    region: shapely.Polygon
    column_x_m: FloatArray
    column_pitch_m: float
    decomposition: Decomposition
    lane_x_m: FloatArray
    lane_y_m: FloatArray
    lane_column: IntArray
    lane_cell: IntArray

    def lane_ends_m(self) -> FloatArray:
        """Return (lanes, 2, 2) ends of the lanes, sweep frame."""
        x = np.repeat(self.lane_x_m[:, None], 2, axis=1)
        return np.stack([x, self.lane_y_m], axis=2)


def columns_of(region: shapely.Polygon, spacing_m: float) -> tuple[FloatArray, float]:
    """Return the centres of the fewest equal columns no wider than `spacing_m`, and their width.

    A few millimetres more are no reason for one column more.
    """
    x_min, _, x_max, _ = region.bounds
    count = max(1, int(np.ceil((x_max - x_min) / (spacing_m * (1 + SAME_SHARE)))))
    pitch = (x_max - x_min) / count
    return x_min + (np.arange(count) + 0.5) * pitch, pitch


def sweep_region(region_m: shapely.Polygon, bearing_deg: float, spacing_m: float) -> Sweep:
    """Decompose a region (local frame) into cells and lanes at a bearing.

    Raises
    ------
    PlanningError
        When no lane falls into the region.
    """
    frame = SweepFrame(bearing_deg=bearing_deg)
    region = frame.turn(region_m)
    column_x, pitch = columns_of(region, spacing_m)
    _, y_min, _, y_max = region.bounds
    rows = int(np.ceil((y_max - y_min) / (pitch / ROWS_PER_COLUMN)))
    rows = int(np.clip(rows, 64, MAX_ROWS))
    row_pitch = (y_max - y_min) / rows
    slices = slices_of_polygon(
        region,
        column_pitch_m=pitch,
        row_pitch_m=row_pitch,
        origin_m=(float(column_x[0] - pitch / 2), float(y_min)),
        columns=len(column_x),
        rows=rows,
    )
    if len(slices) == 0:
        raise PlanningError(
            f"no lane fits the region at a spacing of {spacing_m:g} m: choose a smaller --swath"
        )
    decomposition = decompose(slices)
    column, low, high = lane_intervals(region, column_x)
    cell = _cell_of_intervals(decomposition, column, low, high)
    kept = np.flatnonzero(cell >= 0)
    kept = kept[np.lexsort((low[kept], column[kept], cell[kept]))]
    return Sweep(
        frame=frame,
        region=region,
        column_x_m=column_x,
        column_pitch_m=pitch,
        decomposition=decomposition,
        lane_x_m=column_x[column[kept]],
        lane_y_m=np.column_stack([low[kept], high[kept]]),
        lane_column=column[kept].astype(np.int64),
        lane_cell=cell[kept],
    )


def _cell_of_intervals(
    decomposition: Decomposition, column: IntArray, low: FloatArray, high: FloatArray
) -> IntArray:
    """Return the cell that holds each exact interval; -1 for one too short to hold a row centre."""
    slices = decomposition.slices
    cell_of_slice = np.full(len(slices), -1, dtype=np.int64)
    counts = np.diff(decomposition.cells.offsets)
    cell_of_slice[decomposition.cells.slice_index] = np.repeat(
        np.arange(len(decomposition.cells)), counts
    )
    y0 = slices.origin_m[1]
    # the first row centre at or above the interval's foot is free, so it lies in the slice
    row = np.ceil((low - y0) / slices.row_pitch_m - 0.5)
    row = np.where((row + 0.5) * slices.row_pitch_m + y0 <= low, row + 1, row)
    key = column.astype(np.float64) * (2.0**32) + row
    slice_key = slices.column.astype(np.float64) * (2.0**32) + slices.row_start
    index = np.searchsorted(slice_key, key, side="right") - 1
    safe = np.maximum(index, 0)
    inside = (
        (index >= 0)
        & (slices.column[safe] == column)
        & (row < slices.row_stop[safe])
        & ((row + 0.5) * slices.row_pitch_m + y0 < high)
    )
    return np.where(inside, cell_of_slice[safe], -1)


def sweep_cost_s(
    region_m: shapely.Polygon, bearing_deg: float, spacing_m: float, speed_m_s: float, turn_s: float
) -> float:
    """Return a cheap estimate of the seconds of sweeping a region at a bearing: lanes and turns."""
    region = SweepFrame(bearing_deg=bearing_deg).turn(region_m)
    column_x, pitch = columns_of(region, spacing_m)
    _, low, high = lane_intervals(region, column_x)
    return float((high - low).sum() / speed_m_s + len(low) * (turn_s + pitch / speed_m_s))


def best_bearing_deg(
    region_m: shapely.Polygon, spacing_m: float, speed_m_s: float, turn_s: float
) -> float:
    """Return the bearing with the least estimated cost among shoreline directions and a fan.

    Candidates are a fan of 12 bearings, the sides of the least rotated rectangle, and the longest
    shore edges; ties go to the first.
    """
    candidates = [float(b) for b in np.arange(0.0, 180.0, 15.0)]
    rectangle = shapely.get_coordinates(shapely.minimum_rotated_rectangle(region_m))
    shore = shapely.get_coordinates(shapely.simplify(region_m.exterior, spacing_m / 2))
    for ring, most in ((rectangle, 2), (shore, 4)):
        edge = np.diff(ring, axis=0)
        longest = np.argsort(-np.hypot(*edge.T), kind="stable")[:most]
        for east, north in edge[longest]:
            bearing = float(np.degrees(libm.arctan2(east, north)) % 180.0)
            candidates.append(round(bearing, 3) % 180.0)
    costs = [sweep_cost_s(region_m, b, spacing_m, speed_m_s, turn_s) for b in candidates]
    return candidates[int(np.argmin(costs))]

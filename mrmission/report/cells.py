"""The figures of a decomposition: what the paper's Table 1 counts."""

from __future__ import annotations

import numpy as np

from mrmission.area.frame import LocalFrame, project_polygons
from mrmission.area.region import navigable_region
from mrmission.decomposition.cells import decompose
from mrmission.decomposition.slices import slices_of_grid, slices_of_polygon
from mrmission.errors import ConfigError, GeometryError
from mrmission.model import Decomposition, SurveyArea
from mrmission.tour.sweep import ROWS_PER_COLUMN, SweepFrame, columns_of


def decompose_area(
    area: SurveyArea, pitch_m: float, clearance_m: float = 0.0, angle_deg: float = 0.0
) -> Decomposition:
    """Decompose a whole area: an image by its own pixels, polygons by scanlines at a pitch.

    Raises
    ------
    ConfigError
        When the pitch is not above 0, or an image is asked for a clearance or an angle.
    GeometryError
        When no water is left.
    """
    if area.image is not None:
        if clearance_m or angle_deg:
            raise ConfigError("--clearance and --angle go with polygons: an image is cut as it is")
        return decompose(slices_of_grid(area.image))
    if not pitch_m > 0:
        raise ConfigError(f"--pitch {pitch_m:g}: must be above 0")
    frame = LocalFrame.of(area)
    region = navigable_region(project_polygons(area.water_lonlat, frame), clearance_m)
    if region.is_empty:
        raise GeometryError(f"{area.source}: no water is left at a clearance of {clearance_m:g} m")
    turned = SweepFrame(bearing_deg=angle_deg).turn(region)
    column_x, pitch = columns_of(turned, pitch_m)
    _, y_min, _, y_max = turned.bounds
    rows = max(1, int(np.ceil((y_max - y_min) * ROWS_PER_COLUMN / pitch)))
    return decompose(
        slices_of_polygon(
            turned,
            column_pitch_m=pitch,
            row_pitch_m=(y_max - y_min) / rows,
            origin_m=(float(column_x[0] - pitch / 2), float(y_min)),
            columns=len(column_x),
            rows=rows,
        )
    )


def decomposition_figures(
    area: SurveyArea, pitch_m: float, clearance_m: float, angle_deg: float
) -> dict[str, int | float]:
    """Return counts and sums of the decomposition of an area, ready to print."""
    done = decompose_area(area, pitch_m, clearance_m, angle_deg)
    reeb = done.reeb
    degree = np.bincount(np.concatenate([reeb.tail, reeb.head]), minlength=len(reeb.node_m))
    return {
        "columns": int(len(done.slices.offsets) - 1),
        "slices": len(done.slices),
        "cells": len(done.cells),
        "critical_points": len(reeb.node_m),
        "odd_critical_points": int((degree % 2 == 1).sum()),
        "dual_edges": len(done.dual_edges),
        "free_area_m2": float(reeb.w_c.sum()),
        "smallest_cell_m2": float(reeb.w_c.min()),
        "largest_cell_m2": float(reeb.w_c.max()),
    }

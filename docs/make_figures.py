"""Make the figures of these pages with the program itself.

    python docs/make_figures.py [FIGURE ...]

Writes docs/figures/*.svg (and plan.png): area, cells, paths, plan. The same program gives the
same bytes.
"""

from __future__ import annotations

import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import matplotlib as mpl
import numpy as np
import shapely
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.patches import PathPatch
from matplotlib.path import Path as Outline

from mrmission.area.frame import LocalFrame, project_polygons
from mrmission.area.region import default_start, navigable_region, parts_by_size
from mrmission.cli.areas import read_area
from mrmission.decomposition.cells import cell_polygons
from mrmission.options import PlanOptions
from mrmission.pipeline import plan
from mrmission.report.colours import robot_colour
from mrmission.report.figure import save_figure
from mrmission.routing.harbour import Harbour
from mrmission.tour.sweep import Sweep, sweep_region

ROOT = Path(__file__).resolve().parents[1]
OUT = ROOT / "docs" / "figures"
LAKE = ROOT / "geofences" / "demo_lake.geojson"
CLEARANCE_M = 10.0
BEARING_DEG = 75.0
STYLE = {"font.family": "DejaVu Sans", "font.size": 8, "svg.hashsalt": "mrmission"}


def water_and_region() -> tuple[shapely.MultiPolygon, shapely.Polygon]:
    """Return the demo lake and the largest part of its navigable region, local frame."""
    area = read_area(LAKE, None, None, None)
    water = project_polygons(area.water_lonlat, LocalFrame.of(area))
    return water, parts_by_size(navigable_region(water, CLEARANCE_M))[0]


def fill(axes: Any, geometry: shapely.Geometry, **style: Any) -> None:
    """Fill polygons, holes left open."""
    for part in shapely.get_parts(geometry):
        rings = [
            Outline(shapely.get_coordinates(r), closed=True)
            for r in (part.exterior, *part.interiors)
        ]
        axes.add_patch(PathPatch(Outline.make_compound_path(*rings), **style))


def draw(name: str, paint: Callable[[Any], None]) -> None:
    """Make one map-like figure: equal aspect, no axes."""
    with mpl.rc_context(STYLE):
        figure = Figure(figsize=(7.2, 4.6), facecolor="white")
        FigureCanvasAgg(figure)
        axes = figure.add_axes((0.01, 0.01, 0.98, 0.98))
        paint(axes)
        axes.autoscale_view()
        axes.set_aspect("equal")
        axes.set_axis_off()
        handles, labels = axes.get_legend_handles_labels()
        if handles:
            axes.legend(handles, labels, loc="lower right", frameon=False, fontsize=7)
        metadata = {"Date": None, "Creator": "mrmission"}
        figure.savefig(OUT / f"{name}.svg", metadata=metadata)


def area_figure() -> None:
    """Draw the survey area and its navigable region."""
    water, region = water_and_region()

    def paint(axes: Any) -> None:
        fill(
            axes,
            water,
            facecolor="#d3e4ee",
            edgecolor="#57666c",
            linewidth=0.8,
            label="survey area",
        )
        fill(
            axes,
            region,
            facecolor="#f3f9fc",
            edgecolor="#7fa3b5",
            linewidth=0.5,
            label="navigable region",
        )

    draw("area", paint)


def sweep_of(region: shapely.Polygon, spacing_m: float) -> Sweep:
    """Return the sweep of the figures."""
    return sweep_region(region, BEARING_DEG, spacing_m)


def cells_figure() -> None:
    """Draw slices, cells and the Reeb graph on them."""
    water, region = water_and_region()
    sweep = sweep_of(region, 18.0)
    cells = cell_polygons(sweep.decomposition)
    reeb = sweep.decomposition.reeb

    def local(geometry: shapely.Geometry) -> shapely.Geometry:
        return shapely.transform(geometry, sweep.frame.to_local)

    def paint(axes: Any) -> None:
        fill(axes, water, facecolor="#e8eef1", edgecolor="#57666c", linewidth=0.6)
        for index, cell in enumerate(cells):
            fill(
                axes,
                local(cell),
                facecolor=robot_colour(index % 32 + 1),
                alpha=0.35,
                edgecolor="white",
                linewidth=0.3,
            )
        nodes = sweep.frame.to_local(reeb.node_m)
        middles = sweep.frame.to_local(sweep.decomposition.cells.centroid_m)
        for tail, head, middle in zip(reeb.tail, reeb.head, middles, strict=True):
            axes.plot(*np.array([nodes[tail], middle, nodes[head]]).T, color="0.15", linewidth=0.8)
        axes.plot(*nodes.T, "o", color="black", markersize=3.5, label="critical point")
        axes.plot([], [], color="0.15", linewidth=0.8, label="edge of the Reeb graph: a cell")

    draw("cells", paint)


def paths_figure() -> None:
    """Draw shortest paths in the water from one berth."""
    water, region = water_and_region()
    home = default_start(region)
    harbour = Harbour(region, home[None])
    west, south, east, north = region.bounds
    grid = np.stack(np.meshgrid(np.linspace(west, east, 9), np.linspace(south, north, 7)), axis=-1)
    targets = grid.reshape(-1, 2)
    targets = targets[shapely.contains_xy(region, *targets.T)]
    paths = harbour.paths(np.tile(home, (len(targets), 1)), targets)

    def paint(axes: Any) -> None:
        fill(axes, water, facecolor="#d3e4ee", edgecolor="#57666c", linewidth=0.6)
        fill(axes, region, facecolor="#f3f9fc", edgecolor="#7fa3b5", linewidth=0.4)
        for path in paths:
            axes.plot(*path.T, color="#005ab4", linewidth=0.8)
        axes.plot(*targets.T, "o", color="#f05a0f", markersize=3, label="target")
        axes.plot(*home, "s", color="black", markersize=5, label="start")

    draw("paths", paint)


def plan_figure() -> None:
    """Draw the plan of six boats."""
    area = read_area(LAKE, None, None, None)
    result = plan(area, PlanOptions(robots=6))
    save_figure(result, OUT / "plan.png", dpi=150, overwrite=True)


FIGURES = {
    "area": area_figure,
    "cells": cells_figure,
    "paths": paths_figure,
    "plan": plan_figure,
}


def main() -> None:
    """Make all figures, or those that are named."""
    OUT.mkdir(parents=True, exist_ok=True)
    for name in sys.argv[1:] or FIGURES:
        FIGURES[name]()


if __name__ == "__main__":
    main()

"""Make the figures of these pages with the program itself.

    python docs/make_figures.py [FIGURE ...]

Writes docs/figures/*.svg and demo-plan.png. The same program gives the same bytes.
"""

from __future__ import annotations

import functools
import io
import re
import sys
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import matplotlib as mpl
import numpy as np
import shapely
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.collections import LineCollection
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch, PathPatch
from matplotlib.path import Path as Outline
from PIL import Image

from mrmission.area.berths import berths
from mrmission.area.frame import LocalFrame, project_polygons
from mrmission.area.legs import leg_tolerance_m
from mrmission.area.region import default_start, navigable_region, parts_by_size
from mrmission.cli.areas import read_area
from mrmission.decomposition.cells import cell_polygons
from mrmission.mission.build import LAUNCH_RADIUS_M
from mrmission.mission.check import navigation_path
from mrmission.model import FleetPlan, FloatArray, LegKind
from mrmission.options import METHODS, PlanOptions
from mrmission.partition.problem import Visit
from mrmission.pipeline import plan
from mrmission.report.colours import robot_colour
from mrmission.report.figure import save_figure
from mrmission.report.units import human_duration
from mrmission.routing.harbour import Harbour
from mrmission.tour.coverage import Uncovered
from mrmission.tour.order import PieceBook
from mrmission.tour.path import assemble_paths, legs_of
from mrmission.tour.repair import fleet_legs, repair
from mrmission.tour.sweep import Sweep, lane_spacing_m, sweep_region
from mrmission.tour.timing import TimeModel

ROOT = Path(__file__).resolve().parents[1]
OUT = ROOT / "docs" / "figures"
LAKE = ROOT / "geofences" / "demo_lake.geojson"
OPTIONS = PlanOptions(robots=6)
BEARING_DEG = 75.0
STYLE = {"font.family": "DejaVu Sans", "font.size": 8, "svg.hashsalt": "mrmission"}

WATER = {"facecolor": "#d3e4ee", "edgecolor": "#57666c", "linewidth": 0.7}
REGION = {"facecolor": "#f3f9fc", "edgecolor": "#7fa3b5", "linewidth": 0.4}
DARK, RED, BLUE = "#263238", "#c4161c", "#005ab4"
PASTEL = ("#a6cee3", "#fdd49e", "#b8dfa0", "#d5c3e4", "#f6b9b3", "#f4eda0", "#c9ced2", "#a7dcd1")


@functools.cache
def survey() -> tuple[LocalFrame, shapely.MultiPolygon, shapely.Polygon]:
    """Return the demo lake's frame, its water and the largest part of its navigable region."""
    area = read_area(LAKE, None, None, None)
    frame = LocalFrame.of(area)
    water = project_polygons(area.water_lonlat, frame)
    return frame, water, parts_by_size(navigable_region(water, OPTIONS.clearance_m))[0]


@functools.cache
def planned(method: str) -> FleetPlan:
    """Return the plan of the demo lake for six boats by one method."""
    area = read_area(LAKE, None, None, None)
    return plan(area, PlanOptions(robots=OPTIONS.robots, method=method))


@functools.cache
def spacing_m() -> float:
    """Return the lane spacing of the defaults."""
    swath_m = OPTIONS.swath_m
    return lane_spacing_m(swath_m, OPTIONS.overlap, leg_tolerance_m(swath_m))


# --- drawing -------------------------------------------------------------------------------------


def fill(axes: Any, geometry: shapely.Geometry, **style: Any) -> None:
    """Fill polygons, holes left open."""
    for part in shapely.get_parts(geometry):
        rings = [
            Outline(shapely.get_coordinates(r), closed=True)
            for r in (part.exterior, *part.interiors)
        ]
        axes.add_patch(PathPatch(Outline.make_compound_path(*rings), **style))


def lines(axes: Any, legs_m: Sequence[FloatArray] | FloatArray, **style: Any) -> None:
    """Draw many lines with one style."""
    if len(legs_m):
        axes.add_collection(LineCollection(list(legs_m), **style))


def frame_axes(axes: Any, window: Sequence[float] | None = None) -> None:
    """Equal aspect, no ticks; a window (west, south, east, north) gets a thin frame."""
    axes.autoscale_view()
    axes.set_aspect("equal")
    if window is None:
        axes.set_axis_off()
        return
    axes.set_xlim(window[0], window[2])
    axes.set_ylim(window[1], window[3])
    axes.set_xticks([])
    axes.set_yticks([])
    for spine in axes.spines.values():
        spine.set_linewidth(0.5)
        spine.set_color("0.6")


def scale_bar(axes: Any, length_m: float) -> None:
    """Draw a scale bar in the lower left corner."""
    (west, east), (south, north) = axes.get_xlim(), axes.get_ylim()
    x, y = west + 0.03 * (east - west), south + 0.035 * (north - south)
    bar = {"color": "black", "linewidth": 1.6, "solid_capstyle": "butt", "zorder": 9}
    axes.plot([x, x + length_m], [y, y], **bar)
    axes.annotate(
        f"{length_m:g} m", (x + length_m / 2, y), (0, 2), textcoords="offset points",
        ha="center", fontsize=7, zorder=9,
    )  # fmt: skip


def sheet(rows: int, columns: int, height_in: float, foot_in: float = 0.35) -> tuple[Any, Any]:
    """Return a figure and its axes, with room for one line of legend below."""
    figure = Figure(figsize=(7.2, height_in), facecolor="white")
    FigureCanvasAgg(figure)
    grid = figure.subplots(rows, columns, squeeze=False)
    figure.subplots_adjust(0.01, foot_in / height_in, 0.99, 0.985, wspace=0.03, hspace=0.1)
    return figure, grid


def legend(figure: Any, handles: Sequence[Any]) -> None:
    """Put one line of legend at the foot."""
    figure.legend(
        handles=list(handles), loc="lower center", ncols=len(handles), frameon=False, fontsize=7.5,
        columnspacing=1.4, handlelength=1.8, borderaxespad=0.3,
    )  # fmt: skip


def line_key(label: str, **style: Any) -> Line2D:
    """Return a legend entry for a line or a marker."""
    return Line2D([], [], label=label, **style)


def save(figure: Any, name: str) -> None:
    """Write docs/figures/NAME.svg with outlines to a hundredth of a point."""
    text = io.StringIO()
    figure.savefig(text, format="svg", metadata={"Date": None, "Creator": "mrmission"})

    def shorten(path: re.Match[str]) -> str:
        return re.sub(r"-?\d+\.\d{3,}", lambda m: f"{float(m[0]):.2f}", path[0])

    short = re.sub(r'<path d="[^"]*"', shorten, text.getvalue())
    (OUT / f"{name}.svg").write_text(short, encoding="utf-8")


def shrink(target: Path) -> None:
    """Rewrite a PNG with a palette: a third of the bytes."""
    with Image.open(target) as picture:
        small = picture.convert("RGB").quantize(255, dither=Image.Dither.NONE)
    small.save(target, optimize=True)


# --- figures -------------------------------------------------------------------------------------


def area_figure() -> None:
    """Draw survey area, clearance, navigable region, and the berths close up."""
    _, water, region = survey()
    start = default_start(region)
    found = berths(
        water, region, start, OPTIONS.robots, spacing_m=OPTIONS.berth_spacing_m,
        launch_radius_m=LAUNCH_RADIUS_M,
    )  # fmt: skip
    figure, grid = sheet(1, 1, 4.9)
    axes = grid[0, 0]
    fill(axes, water, **WATER)
    fill(axes, region, **REGION)
    half = np.array([74.0, 38.0])
    middle = found.points_m.mean(axis=0)
    window = (*(middle - half), *(middle + half))
    axes.add_patch(PathPatch(Outline(_box(window), closed=True), fill=False, linewidth=0.6))
    frame_axes(axes)
    scale_bar(axes, 200)
    near = figure.add_axes((0.01, 0.795, 0.255, 0.19))
    fill(near, water, **WATER)
    fill(near, region, **REGION)
    for number, home in enumerate(found.points_m, start=1):
        circle = shapely.Point(home).buffer(LAUNCH_RADIUS_M)
        fill(near, circle, fill=False, edgecolor="0.55", linewidth=0.5, linestyle=(0, (3, 2)))
        near.plot(*home, "o", color=robot_colour(number), markersize=8)
        near.text(
            *home, str(number), color="white", size=5.5, weight="bold", ha="center",
            va="center_baseline",
        )  # fmt: skip
    near.plot(*start, "+", color="black", markersize=7, markeredgewidth=1.2)
    frame_axes(near, window)
    legend(
        figure,
        [
            Patch(label="clearance, 10 m", **WATER),
            Patch(label="navigable region", **REGION),
            line_key("start", marker="+", color="black", linestyle=""),
            line_key("berth and its robot", marker="o", color=robot_colour(1), linestyle=""),
            line_key("launch circle", color="0.55", linewidth=0.7, linestyle=(0, (3, 2))),
        ],
    )
    save(figure, "area")


def _box(window: Sequence[float]) -> FloatArray:
    return shapely.get_coordinates(shapely.box(*window))


def cell_colours(cells: Sequence[shapely.Polygon], near_m: float) -> list[str]:
    """Return a pastel colour per cell; cells within `near_m` of each other differ."""
    shapes = np.array(cells, dtype=object)
    pairs = shapely.STRtree(shapes).query(shapes, predicate="dwithin", distance=near_m)
    chosen: list[int] = []
    for i in range(len(cells)):
        taken = {chosen[j] for j in pairs[1][pairs[0] == i] if j < i}
        free = [c for c in range(len(PASTEL)) if c not in taken] or [i % len(PASTEL)]
        chosen.append(min(free, key=lambda c: (chosen.count(c), c)))
    return [PASTEL[c] for c in chosen]


def _middles(sweep: Sweep, cell: int) -> FloatArray:
    """Return the way of an edge of the Reeb graph: node, slice middles, node (local frame)."""
    slices, cells = sweep.decomposition.slices, sweep.decomposition.cells
    reeb = sweep.decomposition.reeb
    index = cells.slice_index[cells.offsets[cell] : cells.offsets[cell + 1]]
    x = slices.origin_m[0] + (slices.column[index] + 0.5) * slices.column_pitch_m
    rows = (slices.row_start[index] + slices.row_stop[index]) / 2
    y = slices.origin_m[1] + rows * slices.row_pitch_m
    tail, head = reeb.node_m[reeb.tail[cell]], reeb.node_m[reeb.head[cell]]
    return sweep.frame.to_local(np.vstack([tail, np.column_stack([x, y]), head]))


def cells_figure() -> None:
    """Draw the cells and the Reeb graph on them."""
    _, water, region = survey()
    sweep = sweep_region(region, BEARING_DEG, spacing_m())
    cells = [
        shapely.transform(c, sweep.frame.to_local)
        for c in cell_polygons(sweep.decomposition, stairs=True)
    ]
    figure, grid = sheet(1, 1, 4.9)
    axes = grid[0, 0]
    fill(axes, water, facecolor="#eef2f4", edgecolor="#57666c", linewidth=0.6)
    for cell, colour in zip(cells, cell_colours(cells, 8.0), strict=True):
        fill(axes, cell.intersection(region), facecolor=colour, edgecolor="white", linewidth=0.4)
    for cell in range(len(cells)):
        way = _middles(sweep, cell)
        axes.plot(*way.T, color=DARK, linewidth=0.9, solid_joinstyle="round")
    nodes = sweep.frame.to_local(sweep.decomposition.reeb.node_m)
    axes.plot(*nodes.T, "o", color="black", markersize=3.8)
    frame_axes(axes)
    scale_bar(axes, 200)
    legend(
        figure,
        [
            Patch(facecolor=PASTEL[0], label="cell"),
            line_key("critical point", marker="o", color="black", linestyle="", markersize=4),
            line_key("edge of the Reeb graph, along its cell", color=DARK, linewidth=0.9),
        ],
    )
    save(figure, "cells")


def slices_figure() -> None:
    """Draw the slices around one island, and where their connectivity changes."""
    _, water, region = survey()
    sweep = sweep_region(region, BEARING_DEG, spacing_m())
    made, parts = sweep.decomposition.slices, sweep.decomposition.cells
    cells = [
        shapely.transform(c, sweep.frame.to_local)
        for c in cell_polygons(sweep.decomposition, stairs=True)
    ]
    colours = cell_colours(cells, 8.0)
    small = min(water.geoms[0].interiors, key=lambda r: shapely.Polygon(r).area)
    cx, cy = shapely.get_coordinates(shapely.Polygon(small).centroid)[0]
    window = (cx - 330, cy - 130, cx + 330, cy + 130)
    view = shapely.box(*window)
    figure, grid = sheet(1, 1, 3.3)
    axes = grid[0, 0]
    fill(axes, water, facecolor="#e1e8ec", edgecolor="#57666c", linewidth=0.8)
    x = made.origin_m[0] + made.column * made.column_pitch_m
    low = made.origin_m[1] + made.row_start * made.row_pitch_m
    high = made.origin_m[1] + made.row_stop * made.row_pitch_m
    for cell in range(len(cells)):
        for s in parts.slice_index[parts.offsets[cell] : parts.offsets[cell + 1]]:
            box = shapely.box(x[s] + 0.8, low[s], x[s] + made.column_pitch_m - 0.8, high[s])
            bar = shapely.transform(box, sweep.frame.to_local)
            if bar.intersects(view):
                fill(axes, bar, facecolor=colours[cell], edgecolor="0.45", linewidth=0.3)
    nodes = sweep.frame.to_local(sweep.decomposition.reeb.node_m)
    axes.plot(*nodes.T, "o", color="black", markersize=5)
    frame_axes(axes, window)
    scale_bar(axes, 50)
    legend(
        figure,
        [
            Patch(facecolor=PASTEL[0], edgecolor="0.45", label="slice, coloured by its cell"),
            line_key("critical point", marker="o", color="black", linestyle="", markersize=5),
            Patch(facecolor="#e1e8ec", edgecolor="#57666c", label="clearance"),
        ],
    )
    save(figure, "slices")


def paths_figure() -> None:
    """Draw shortest paths in the water from one berth."""
    _, water, region = survey()
    home = default_start(region)
    harbour = Harbour(region, home[None])
    west, south, east, north = region.bounds
    grid = np.stack(np.meshgrid(np.linspace(west, east, 9), np.linspace(south, north, 7)), axis=-1)
    targets = grid.reshape(-1, 2)
    targets = targets[shapely.contains_xy(region, *targets.T)]
    paths = harbour.paths(np.tile(home, (len(targets), 1)), targets)
    figure, axes_grid = sheet(1, 1, 4.9)
    axes = axes_grid[0, 0]
    fill(axes, water, **WATER)
    fill(axes, region, **REGION)
    lines(axes, paths, colors=BLUE, linewidths=0.8)
    axes.plot(*targets.T, "o", color="#f05a0f", markersize=3.5)
    axes.plot(*home, "s", color="black", markersize=5)
    frame_axes(axes)
    scale_bar(axes, 200)
    legend(
        figure,
        [
            line_key("start", marker="s", color="black", linestyle="", markersize=5),
            line_key("target", marker="o", color="#f05a0f", linestyle="", markersize=4),
            line_key("shortest path in the navigable region", color=BLUE, linewidth=0.9),
        ],
    )
    save(figure, "paths")


def planners_figure() -> None:
    """Draw the paper's four planners and the lane planner."""
    _, water, _ = survey()
    figure, grid = sheet(3, 2, 8.2)
    grid.flat[len(METHODS)].axis("off")
    for axes, method in zip(grid.flat, METHODS, strict=False):
        result = planned(method)
        fill(axes, water, facecolor="#eef2f4", edgecolor="#57666c", linewidth=0.5)
        for path in result.paths:
            legs = np.round(legs_of(path), 1)
            survey_leg = path.kind == LegKind.SURVEY
            colour = robot_colour(path.robot)
            long = np.hypot(*(legs[:, 1] - legs[:, 0]).T) > 8.0
            lines(axes, legs[survey_leg & long], colors=colour, linewidths=0.9)
            lines(
                axes, legs[~survey_leg & long], colors=colour, linewidths=0.5,
                linestyles=[(0, (2, 1.5))],
            )  # fmt: skip
        frame_axes(axes)
        report = result.report
        busy = sum(r.lanes > 0 for r in report.robots)
        axes.set_title(
            f"{method.upper()}   home after {human_duration(report.makespan_s)}, "
            f"{busy} of {len(report.robots)} robots at work",
            fontsize=8, pad=2,
        )  # fmt: skip
    figure.subplots_adjust(top=0.97)
    keys = [
        line_key(f"robot {r}", color=robot_colour(r), linewidth=1.6)
        for r in range(1, OPTIONS.robots + 1)
    ]
    legend(figure, [*keys, line_key("transit", color="0.3", linewidth=0.7, linestyle=(0, (2, 1)))])
    target = OUT / "planners.png"
    figure.savefig(target, dpi=140, metadata={"Software": None})
    shrink(target)


def sweep_figure() -> None:
    """Draw lanes close up, what they leave uncovered, and the extra legs that cover it."""
    _, water, region = survey()
    swath_m = OPTIONS.swath_m
    sweep = sweep_region(region, BEARING_DEG, spacing_m())
    time = TimeModel(survey_speed_m_s=2.0, transit_speed_m_s=2.0)
    home = default_start(region)
    harbour = Harbour(region, home[None])
    book = PieceBook(sweep, harbour, time)
    visits = [Visit(c, 0) for c in range(len(sweep.decomposition.cells))]
    before = assemble_paths(harbour, [book.order(visits, home)])
    uncovered = Uncovered(sweep.region, sweep.column_pitch_m, swath_m / 2)
    missed = uncovered.remainder(fleet_legs(before, sweep.frame))
    after = repair(before, uncovered, sweep.frame, harbour, time, swath_m)
    old = {tuple(np.round(leg, 2).ravel()) for leg in legs_of(before[0])}
    # the densest window of missed area shows most
    centres = sweep.frame.to_local(
        np.array([shapely.get_coordinates(p.centroid)[0] for p in missed])
    )
    size = np.array([p.area for p in missed])
    half = np.array([105.0, 80.0])
    score = [size[np.all(np.abs(centres - c) < half * 0.8, axis=1)].sum() for c in centres]
    middle = centres[int(np.argmax(score))]
    window = (*(middle - half), *(middle + half))
    figure, grid = sheet(1, 2, 3.35)
    box = shapely.box(*window).buffer(30)
    for axes, paths, title in (
        (grid[0, 0], before, "lanes and transits"),
        (grid[0, 1], after, "with the extra legs"),
    ):
        legs = legs_of(paths[0])
        keep = shapely.intersects(shapely.linestrings(legs), box)
        kinds, legs = paths[0].kind[keep], legs[keep]
        fill(axes, water.intersection(box), **WATER)
        fill(axes, region.intersection(box), **REGION)
        survey_legs = legs[kinds == LegKind.SURVEY]
        swept = shapely.buffer(shapely.linestrings(legs), swath_m / 2, quad_segs=6)
        near = shapely.intersection(shapely.union_all(swept), region.intersection(box))
        fill(axes, near, facecolor="#dbe8d3", edgecolor="none")
        new = np.array([tuple(np.round(leg, 2).ravel()) not in old for leg in survey_legs])
        cut = np.array([_parallel(leg, BEARING_DEG) for leg in survey_legs])
        extra = new & ~cut if paths is after else np.zeros(len(survey_legs), dtype=bool)
        lines(axes, survey_legs[~extra], colors=DARK, linewidths=0.9)
        lines(axes, survey_legs[extra], colors="#e0560a", linewidths=1.5, zorder=5)
        lines(
            axes, legs[kinds != LegKind.SURVEY], colors=DARK, linewidths=0.7,
            linestyles=[(0, (3, 2))],
        )  # fmt: skip
        if paths is before:
            for piece in missed:
                shape = shapely.transform(piece, sweep.frame.to_local)
                if not shape.intersects(box):
                    continue
                fill(axes, shape, facecolor=RED, edgecolor=RED, linewidth=0.6, zorder=6)
        frame_axes(axes, window)
        axes.set_title(title, fontsize=8, pad=3)
        scale_bar(axes, 20)
    figure.subplots_adjust(top=0.93)
    legend(
        figure,
        [
            line_key("lane", color=DARK, linewidth=0.9),
            line_key("transit", color=DARK, linewidth=0.7, linestyle=(0, (3, 2))),
            Patch(facecolor="#dbe8d3", label="within swath/2 of a leg"),
            Patch(facecolor=RED, label="uncovered"),
            line_key("extra leg", color="#e0560a", linewidth=1.5),
        ],
    )
    save(figure, "sweep")


def _parallel(leg: FloatArray, bearing_deg: float) -> bool:
    """Return whether a leg runs along the lanes."""
    east, north = leg[1] - leg[0]
    off = (np.degrees(np.arctan2(east, north)) - bearing_deg + 90) % 180 - 90
    return bool(abs(off) < 0.2)


def fence_figure() -> None:
    """Draw one robot's mission and the fence that fits its vehicle's memory."""
    frame, water, _ = survey()
    result = planned("auto")
    mission = result.missions[0]
    points_e7, _ = navigation_path(mission)
    track = frame.to_metric(points_e7[:, ::-1] / 1e7)
    figure, grid = sheet(1, 1, 4.9)
    axes = grid[0, 0]
    fill(axes, water, **WATER)
    for polygon in mission.fence:
        ring = shapely.Polygon(frame.to_metric(polygon.points_e7[:, ::-1] / 1e7))
        colour = BLUE if polygon.inclusion else RED
        fill(axes, ring, fill=False, edgecolor=colour, linewidth=1.0, zorder=4)
        corners = shapely.get_coordinates(ring)[:-1]
        axes.plot(*corners.T, "o", color=colour, markersize=2.2, zorder=5)
    axes.plot(*track.T, color="#5b6b73", linewidth=0.6, zorder=3)
    home = shapely.Point(result.homes_m[0]).buffer(LAUNCH_RADIUS_M)
    fill(axes, home, fill=False, edgecolor="black", linewidth=0.7, zorder=6)
    frame_axes(axes)
    scale_bar(axes, 200)
    corners = sum(len(p.points_e7) for p in mission.fence)
    legend(
        figure,
        [
            line_key("mission of robot 1", color="#5b6b73", linewidth=0.8),
            line_key(
                f"fence: stay in ({corners} points in all)", color=BLUE, marker="o", markersize=2.5
            ),
            line_key("keep out", color=RED, marker="o", markersize=2.5),
            line_key("launch circle", color="black", linewidth=0.7),
        ],
    )
    save(figure, "fence")


def demo_plan_figure() -> None:
    """Draw the plan of six boats, as `mrmission plan --figure` does."""
    target = OUT / "demo-plan.png"
    save_figure(planned("minmax"), target, dpi=140, overwrite=True)
    shrink(target)


def survey_lines_figure() -> None:
    """Draw laps, lanes and tie lines with their names."""
    from make_survey_figure import draw

    draw()


def fairway_figure() -> None:
    """Draw lanes and a fairway, and tours that use it."""
    from make_fairway_figure import draw

    draw()


FIGURES: dict[str, Callable[[], None]] = {
    "area": area_figure,
    "slices": slices_figure,
    "cells": cells_figure,
    "paths": paths_figure,
    "planners": planners_figure,
    "sweep": sweep_figure,
    "fence": fence_figure,
    "demo-plan": demo_plan_figure,
    "survey-lines": survey_lines_figure,
    "fairway": fairway_figure,
}


def main() -> None:
    """Make all figures, or those that are named."""
    OUT.mkdir(parents=True, exist_ok=True)
    with mpl.rc_context(STYLE):
        for name in sys.argv[1:] or FIGURES:
            FIGURES[name]()


if __name__ == "__main__":
    main()

"""``--figure``: the plan as a picture for a paper."""

from __future__ import annotations

import contextlib
import io
import math
from collections.abc import Iterator
from importlib.util import find_spec
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import shapely

from mrmission.errors import ConfigError
from mrmission.mission.files import write_whole
from mrmission.model import FleetPlan, FloatArray, LegKind
from mrmission.report.colours import robot_colour
from mrmission.report.map_data import LegTrack, polygons, tracks, unreached_polygons
from mrmission.report.units import human_duration, human_gap, human_length

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

FORMATS = ("png", "svg", "pdf")
_METADATA: dict[str, dict[str, Any]] = {
    "png": {"Software": None},
    "svg": {"Date": None, "Creator": "mrmission"},
    "pdf": {"CreationDate": None, "Creator": "mrmission", "Producer": None},
}
_LEGEND_ROBOTS = 32
_STYLE = {
    "font.family": "DejaVu Sans",
    "font.size": 7,
    "axes.linewidth": 0.6,
    "svg.hashsalt": "mrmission",
    "svg.fonttype": "none",
    "pdf.fonttype": 42,
    "path.simplify": False,
}


def save_figure(
    plan: FleetPlan,
    path: Path | str,
    *,
    width_mm: float = 180.0,
    dpi: float = 300.0,
    title: bool = True,
    overwrite: bool = False,
) -> Path:
    """Draw a plan as a picture: the same bytes for the same plan and the same matplotlib.

    Parameters
    ----------
    plan
        The plan.
    path
        File to write; its suffix, png, svg or pdf, is the format.
    width_mm
        Width of the picture, mm; its height follows from the area.
    dpi
        Pixels per inch of a PNG.
    title
        Whether the area's name and the fleet's figures stand above the map.
    overwrite
        Whether a file that exists is replaced.

    Returns
    -------
    pathlib.Path
        The file written.

    Raises
    ------
    ConfigError
        When the suffix names no known format, the file exists already, its folder does not, or
        matplotlib is not installed.
    """
    path = check_figure(path, overwrite=overwrite)
    report, robots = plan.report, len(plan.report.robots)
    legend_rows = math.ceil((min(robots, _LEGEND_ROBOTS) + 5) / 8)
    gap, name = report.gap, report.lower_bound_name
    if report.lanes_gap is not None:
        gap, name = report.lanes_gap, "bound for these lanes"
    line = (
        f"{robots} robot{'' if robots == 1 else 's'}, home after "
        f"{human_duration(report.makespan_s)}, gap to the {name} {human_gap(gap)}"
    )
    with picture(
        path, plan, width_mm=width_mm, dpi=dpi, foot_in=0.1 + 0.17 * legend_rows,
        title=(plan.area.name, line) if title else None, overwrite=overwrite,
    ) as (figure, axes):  # fmt: skip
        draw_plan(axes, plan)
        _legend(figure, plan)
    return path


@contextlib.contextmanager
def picture(
    path: Path,
    plan: FleetPlan,
    *,
    width_mm: float,
    dpi: float,
    foot_in: float,
    title: tuple[str, str] | None,
    overwrite: bool,
) -> Iterator[tuple[Figure, Axes]]:
    """Yield a figure with axes of a plan's proportions, and write it when all is drawn.

    Parameters
    ----------
    path
        File to write, as :func:`check_figure` returned it.
    plan
        Whose water is shown.
    width_mm, dpi, overwrite
        As for :func:`save_figure`.
    foot_in
        Room for a legend below the map, inches.
    title
        What stands above the map, in large and in small; None for nothing.
    """
    import matplotlib as mpl
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    kind = path.suffix.lower().lstrip(".")
    west, south, east, north = plan.water_m.bounds
    width_in = width_mm / 25.4
    map_in = width_in * min(max((north - south) / max(east - west, 1e-9), 0.25), 1.25)
    height_in = map_in + foot_in + (0.06 if title is None else 0.36)
    with mpl.rc_context(_STYLE):
        figure = Figure(figsize=(width_in, height_in), dpi=dpi, facecolor="white")
        FigureCanvasAgg(figure)
        axes = figure.add_axes((0.01, foot_in / height_in, 0.98, map_in / height_in))
        if title is not None:
            top = 1 - 0.05 / height_in
            plain: dict[str, Any] = {"va": "top", "parse_math": False}
            figure.text(0.01, top, title[0], size=9, weight="bold", **plain)
            figure.text(0.01, top - 0.17 / height_in, title[1], size=7, color="0.35", **plain)
        yield figure, axes
        stream = io.BytesIO()
        figure.savefig(stream, format=kind, dpi=dpi, metadata=_METADATA[kind])
    write_whole(path, stream.getvalue(), overwrite=overwrite)


def check_figure(path: Path | str, overwrite: bool = False) -> Path:
    """Check, before any planning, that a picture can be written.

    Parameters
    ----------
    path
        File to write.
    overwrite
        Whether a file that exists is replaced.

    Returns
    -------
    pathlib.Path
        The path.

    Raises
    ------
    ConfigError
        When the suffix names no known format, the file exists already, its folder does not, or
        matplotlib is not installed.
    """
    path = Path(path)
    if path.suffix.lower().lstrip(".") not in FORMATS:
        raise ConfigError(
            f"--figure {path}: unknown format {path.suffix or '(no suffix)'}; "
            "name the file .png, .svg or .pdf"
        )
    if path.exists() and not overwrite:
        raise ConfigError(f"--figure {path}: the file exists; give --overwrite to replace it")
    if not path.absolute().parent.is_dir():
        raise ConfigError(f"--figure {path}: there is no folder {path.parent}; make it first")
    if find_spec("matplotlib") is None:
        raise ConfigError(
            "--figure: matplotlib is not installed; install it with pip install 'mrmission[figure]'"
        )
    return path


def draw_plan(axes: Axes, plan: FleetPlan) -> None:
    """Draw a plan into matplotlib axes: equal aspect, no ticks, scale bar, north arrow.

    Parameters
    ----------
    axes
        The axes.
    plan
        The plan.
    """
    draw_water(axes, plan)
    for shape in unreached_polygons(plan):
        _patch(
            axes, shape, facecolor="none", edgecolor="#b06a6a", hatch="//////", linewidth=0.3,
            zorder=2,
        )  # fmt: skip
    found = tracks(plan)
    pitch_m = _arrow_pitch_m(plan)
    taken: set[tuple[int, int]] = set()
    for robot, track in found.items():
        _draw_track(axes, robot, track, pitch_m, taken)
    _draw_starts(axes, plan, list(found))
    fit_axes(axes, plan)
    axes.annotate(
        "N", (0.985, 0.985), (0.985, 0.92), xycoords="axes fraction", ha="center", va="top",
        size=7, weight="bold", zorder=9,
        arrowprops={"arrowstyle": "-|>", "color": "black", "linewidth": 0.8, "shrinkA": 0},
    )  # fmt: skip


def draw_water(axes: Axes, plan: FleetPlan) -> None:
    """Draw the water and, over it, what of it is navigable."""
    for shape in polygons(plan.water_m):
        _patch(axes, shape, facecolor="#d3e4ee", edgecolor="#57666c", linewidth=0.6, zorder=1)
    for shape in polygons(plan.region_m):
        _patch(axes, shape, facecolor="#f3f9fc", edgecolor="#7fa3b5", linewidth=0.3, zorder=2)


def _patch(axes: Axes, shape: shapely.Polygon, **style: Any) -> None:
    from matplotlib.patches import PathPatch
    from matplotlib.path import Path as Outline

    rings = [shapely.get_coordinates(ring) for ring in (shape.exterior, *shape.interiors)]
    outline = Outline.make_compound_path(*[Outline(ring, closed=True) for ring in rings])
    axes.add_patch(PathPatch(outline, **style))


def fit_axes(axes: Axes, plan: FleetPlan) -> None:
    """Show the water as a whole, in equal aspect, without ticks, with a scale bar."""
    west, south, east, north = plan.water_m.bounds
    margin = 0.02 * max(east - west, north - south)
    axes.set_xlim(west - margin, east + margin)
    # Room for the scale bar below the water.
    axes.set_ylim(south - margin - 0.05 * max(north - south, 0.4 * (east - west)), north + margin)
    axes.set_aspect("equal", adjustable="box")
    axes.set_axis_off()
    _scale_bar(axes)


def _arrow_pitch_m(plan: FleetPlan) -> float:
    west, south, east, north = plan.water_m.bounds
    return float(max(east - west, north - south)) / 28


def _draw_track(
    axes: Axes, robot: int, track: LegTrack, pitch_m: float, taken: set[tuple[int, int]]
) -> None:
    from matplotlib.collections import LineCollection, PolyCollection

    colour = robot_colour(robot)
    for points, kind in zip(track.points_m, track.kind, strict=True):
        legs = np.stack([points[:-1], points[1:]], axis=1)
        survey = np.array(kind, dtype=int) == LegKind.SURVEY
        for mask, style, width in ((survey, "-", 0.55), (~survey, (0, (3, 2)), 0.45)):
            if mask.any():
                axes.add_collection(
                    LineCollection(
                        list(legs[mask]), colors=colour, linestyles=[style], linewidths=width,
                        zorder=4,
                    )
                )  # fmt: skip
        heads = _arrow_heads(legs, pitch_m, taken)
        if len(heads):
            axes.add_collection(
                PolyCollection(list(heads), facecolors=colour, edgecolors="none", zorder=5)
            )


def _arrow_heads(legs: FloatArray, pitch_m: float, taken: set[tuple[int, int]]) -> FloatArray:
    """Return arrow heads along the longer legs, (n, 4, 2), no two in one square of the map."""
    size_m = pitch_m / 7
    shape = np.array([(1.2, 0.0), (-1.0, 0.75), (-0.45, 0.0), (-1.0, -0.75)]) * size_m
    heads = []
    for start, end in legs:
        length_m = math.hypot(*(end - start))
        if length_m < pitch_m / 2:
            continue
        along = (end - start) / length_m
        turn = np.array([[along[0], along[1]], [-along[1], along[0]]])
        count = max(round(length_m / (4 * pitch_m)), 1)
        for share in (np.arange(count) + 0.5) / count:
            middle = start + (end - start) * share
            square = (int(middle[0] // pitch_m), int(middle[1] // pitch_m))
            if square not in taken:
                taken.add(square)
                heads.append(middle + shape @ turn)
    return np.array(heads).reshape(-1, 4, 2)


def _draw_starts(axes: Axes, plan: FleetPlan, robots: list[int]) -> None:
    homes = np.asarray(plan.homes_m, dtype=float).reshape(-1, 2)
    if not len(homes):
        return
    west, south, east, north = plan.water_m.bounds
    apart = 0.027 * max(east - west, north - south)
    placed: list[FloatArray] = []
    for index, robot in enumerate(robots):
        home = homes[min(index, len(homes) - 1)]
        label = home
        # Berths lie metres apart: fan the numbers out along a sunflower spiral.
        for step in range(400):
            radius = apart * (1.1 + 0.07 * step) if step else 0.0
            angle = step * 2.399963 - math.pi / 2
            label = home + radius * np.array([math.cos(angle), math.sin(angle)])
            if all(math.hypot(*(label - other)) > apart for other in placed):
                break
        placed.append(label)
        colour = robot_colour(robot)
        axes.plot(*np.array([home, label]).T, color=colour, linewidth=0.5, zorder=6)
        axes.plot(*home, marker=".", markersize=3, color=colour, zorder=6)
        axes.plot(
            *label, marker="o", markersize=7, color=colour, markeredgecolor="white",
            markeredgewidth=0.5, zorder=7,
        )  # fmt: skip
        axes.text(
            label[0], label[1], str(robot), color="white", size=4.6, weight="bold", ha="center",
            va="center_baseline", zorder=8,
        )  # fmt: skip


def _scale_bar(axes: Axes) -> None:
    west, east = axes.get_xlim()
    south, north = axes.get_ylim()
    target = 0.22 * (east - west)
    power = 10.0 ** math.floor(math.log10(target))
    length_m = next(step * power for step in (5, 2, 1) if step * power <= target)
    x, y = west + 0.012 * (east - west), south + 0.02 * (north - south)
    axes.plot([x, x + length_m], [y, y], color="black", linewidth=1.6, solid_capstyle="butt")
    text = f"{length_m / 1000:g} km" if length_m >= 1000 else f"{length_m:g} m"
    axes.annotate(text, (x + length_m / 2, y), (0, 2), textcoords="offset points", ha="center")


def _legend(figure: Any, plan: FleetPlan) -> None:
    from matplotlib.lines import Line2D
    from matplotlib.patches import Patch

    handles: list[Any] = [
        Line2D([], [], color="0.25", linewidth=1.0, label="lane"),
        Line2D([], [], color="0.25", linewidth=0.8, linestyle=(0, (3, 2)), label="transit"),
        Patch(facecolor="#d3e4ee", edgecolor="#57666c", linewidth=0.5, label="clearance"),
    ]
    if plan.report.unreached_m2 > 0:
        handles.append(
            Patch(facecolor="none", edgecolor="#b06a6a", hatch="//////", label="unreached")
        )
    shown = plan.report.robots[:_LEGEND_ROBOTS]
    handles += [
        Line2D(
            [], [], color=robot_colour(row.robot), linewidth=2.0,
            label=f"{row.robot}: {human_length(row.length_m)}",
        )
        for row in shown
    ]  # fmt: skip
    more = len(plan.report.robots) - len(shown)
    if more:
        handles.append(Line2D([], [], linewidth=0, label=f"and {more} more"))
    figure.legend(
        handles=handles, loc="lower left", bbox_to_anchor=(0.004, 0.0), ncols=8, frameon=False,
        fontsize=5.8, handlelength=1.8, columnspacing=1.1, borderaxespad=0.2, labelspacing=0.45,
    )  # fmt: skip

"""The figure of a rehearsal: planned lanes, driven tracks, what was missed."""

from __future__ import annotations

import io
import math
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import shapely

from mrmission.mission.files import write_whole
from mrmission.model import FleetPlan
from mrmission.rehearse.judge import FleetDriven, frame_of
from mrmission.rehearse.measures import THIN_M
from mrmission.rehearse.track import Track
from mrmission.report.colours import robot_colour
from mrmission.report.figure import (
    _METADATA,
    _STYLE,
    _scale_bar,
    check_figure,
)
from mrmission.report.map_data import polygons
from mrmission.report.units import human_duration, human_share

if TYPE_CHECKING:
    from matplotlib.axes import Axes


def save_tracks(
    plan: FleetPlan,
    tracks: Sequence[Track],
    driven: FleetDriven,
    path: Path | str,
    *,
    width_mm: float = 180.0,
    dpi: float = 200.0,
    end: bool = True,
    overwrite: bool = False,
) -> Path:
    """Draw the planned legs and, over them, the tracks driven.

    Parameters
    ----------
    plan, tracks, driven
        The plan, what was driven, and its figures.
    path
        File to write; its suffix, png, svg or pdf, is the format.
    width_mm, dpi
        Size, and pixels per inch of a PNG.
    end
        Whether what was driven after the last waypoint is drawn too, dotted.
    overwrite
        Whether a file that exists is replaced.

    Raises
    ------
    ConfigError
        As :func:`mrmission.report.figure.check_figure`.
    """
    path = check_figure(path, overwrite=overwrite)
    import matplotlib as mpl
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    kind = path.suffix.lower().lstrip(".")
    west, south, east, north = plan.water_m.bounds
    width_in = width_mm / 25.4
    map_in = width_in * min(max((north - south) / max(east - west, 1e-9), 0.25), 1.25)
    foot_in, head_in = 0.28, 0.36
    height_in = map_in + foot_in + head_in
    with mpl.rc_context(_STYLE):
        figure = Figure(figsize=(width_in, height_in), dpi=dpi, facecolor="white")
        FigureCanvasAgg(figure)
        axes = figure.add_axes((0.01, foot_in / height_in, 0.98, map_in / height_in))
        draw_tracks(axes, plan, tracks, end=end)
        met = driven.nearest
        line = (
            f"{human_share(driven.coverage.share)} swept, 95 % of the lanes kept to "
            f"{driven.cross_track.p95_m:.2f} m, home after "
            f"{human_duration(driven.driven_makespan_s)} (planned "
            f"{human_duration(driven.planned_makespan_s)})"
            + ("" if met is None else f", no two nearer than {met.distance_m:.1f} m")
        )
        top = 1 - 0.05 / height_in
        style: dict[str, Any] = {"va": "top", "parse_math": False}
        figure.text(0.01, top, f"{plan.area.name}: driven", size=9, weight="bold", **style)
        figure.text(0.01, top - 0.17 / height_in, line, size=7, color="0.35", **style)
        _legend(figure, driven, end)
        stream = io.BytesIO()
        figure.savefig(stream, format=kind, dpi=dpi, metadata=_METADATA[kind])
    write_whole(path, stream.getvalue(), overwrite=overwrite)
    return path


def draw_tracks(axes: Axes, plan: FleetPlan, tracks: Sequence[Track], *, end: bool = True) -> None:
    """Draw water, planned legs in grey, tracks in the robots' colours, homes."""
    from matplotlib.collections import LineCollection
    from matplotlib.patches import PathPatch
    from matplotlib.path import Path as Outline

    for geometry, face, edge, width in (
        (plan.water_m, "#d3e4ee", "#57666c", 0.6),
        (plan.region_m, "#f3f9fc", "#7fa3b5", 0.3),
    ):
        for shape in polygons(geometry):
            rings = [shapely.get_coordinates(ring) for ring in (shape.exterior, *shape.interiors)]
            outline = Outline.make_compound_path(*[Outline(ring, closed=True) for ring in rings])
            axes.add_patch(PathPatch(outline, facecolor=face, edgecolor=edge, linewidth=width))
    planned = [path.points_m for path in plan.paths if len(path.points_m) > 1]
    axes.add_collection(
        LineCollection(planned, colors="0.55", linewidths=1.6, alpha=0.45, zorder=3)
    )
    frame = frame_of(plan)
    for track in tracks:
        points = track.points_m(frame)
        for mask, style, width in (
            (track.under_way(), "-", 0.5),
            (track.afterwards(), (0, (1, 1)), 0.9),
        ):
            if np.count_nonzero(mask) < 2 or (style != "-" and not end):
                continue
            thin = shapely.simplify(shapely.LineString(points[mask]), THIN_M)
            axes.add_collection(
                LineCollection(
                    [shapely.get_coordinates(thin)], colors=robot_colour(track.robot),
                    linestyles=[style], linewidths=width, zorder=4,
                )
            )  # fmt: skip
    for path in plan.paths:
        axes.plot(
            *path.points_m[0], marker="o", markersize=3.5, color=robot_colour(path.robot),
            markeredgecolor="white", markeredgewidth=0.4, zorder=6,
        )  # fmt: skip
    west, south, east, north = plan.water_m.bounds
    margin = 0.02 * max(east - west, north - south)
    axes.set_xlim(west - margin, east + margin)
    axes.set_ylim(south - margin - 0.05 * max(north - south, 0.4 * (east - west)), north + margin)
    axes.set_aspect("equal", adjustable="box")
    axes.set_axis_off()
    _scale_bar(axes)


def _legend(figure: Any, driven: FleetDriven, end: bool) -> None:
    from matplotlib.lines import Line2D

    handles: list[Any] = [
        Line2D([], [], color="0.55", linewidth=2.0, alpha=0.6, label="planned"),
        Line2D([], [], color="0.25", linewidth=0.8, label="driven"),
    ]
    if end and any(row.watched_s > 0 for row in driven.robots):
        dots = (0, (1, 1))
        handles.append(Line2D([], [], color="0.25", linewidth=1.0, linestyle=dots, label="at end"))
    for row in driven.robots[:12]:
        text = human_duration(row.driven_s) if math.isfinite(row.driven_s) else row.end
        handles.append(
            Line2D(
                [], [], color=robot_colour(row.robot), linewidth=2.0, label=f"{row.robot}: {text}"
            )
        )
    figure.legend(
        handles=handles, loc="lower left", bbox_to_anchor=(0.004, 0.0), ncols=8, frameon=False,
        fontsize=5.8, handlelength=1.8, columnspacing=1.1, borderaxespad=0.2, labelspacing=0.45,
    )  # fmt: skip

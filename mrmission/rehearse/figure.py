"""The figure of a rehearsal: planned lanes, driven tracks, what was missed."""

from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import shapely

from mrmission.model import FleetPlan
from mrmission.rehearse.judge import FleetDriven, frame_of
from mrmission.rehearse.measures import THIN_M
from mrmission.rehearse.track import Track
from mrmission.report.colours import robot_colour
from mrmission.report.figure import check_figure, draw_water, fit_axes, picture
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
    met = driven.nearest
    line = (
        f"{human_share(driven.coverage.share)} swept, 95 % of the lanes kept to "
        f"{driven.cross_track.p95_m:.2f} m, home after "
        f"{human_duration(driven.driven_makespan_s)} (planned "
        f"{human_duration(driven.planned_makespan_s)})"
        + ("" if met is None else f", no two nearer than {met.distance_m:.1f} m")
    )
    with picture(
        path, plan, width_mm=width_mm, dpi=dpi, foot_in=0.28,
        title=(f"{plan.area.name}: driven", line), overwrite=overwrite,
    ) as (figure, axes):  # fmt: skip
        draw_tracks(axes, plan, tracks, end=end)
        _legend(figure, driven, end)
    return path


def draw_tracks(axes: Axes, plan: FleetPlan, tracks: Sequence[Track], *, end: bool = True) -> None:
    """Draw water, planned legs in grey, tracks in the robots' colours, homes."""
    from matplotlib.collections import LineCollection

    draw_water(axes, plan)
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
    fit_axes(axes, plan)


def _legend(figure: Any, driven: FleetDriven, end: bool) -> None:
    from matplotlib.lines import Line2D

    handles: list[Any] = [
        Line2D([], [], color="0.55", linewidth=2.0, alpha=0.6, label="planned"),
        Line2D([], [], color="0.25", linewidth=0.8, label="driven"),
    ]
    if end and any(row.watched_s > 0 for row in driven.robots):
        dots = (0, (1, 1))
        handles.append(Line2D([], [], color="0.25", linewidth=1.0, linestyle=dots, label="at end"))
    several = any(row.sortie > 1 for row in driven.robots)
    for row in driven.robots[:12]:
        text = human_duration(row.driven_s) if math.isfinite(row.driven_s) else row.end
        name = f"{row.robot}.{row.sortie}" if several else f"{row.robot}"
        handles.append(
            Line2D([], [], color=robot_colour(row.robot), linewidth=2.0, label=f"{name}: {text}")
        )
    figure.legend(
        handles=handles, loc="lower left", bbox_to_anchor=(0.004, 0.0), ncols=8, frameon=False,
        fontsize=5.8, handlelength=1.8, columnspacing=1.1, borderaxespad=0.2, labelspacing=0.45,
    )  # fmt: skip

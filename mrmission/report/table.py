"""The table on the terminal."""

from __future__ import annotations

from typing import TYPE_CHECKING

from mrmission.model import FleetPlan
from mrmission.report.colours import robot_colour
from mrmission.report.metrics import report_json, report_text, summary_lines
from mrmission.report.units import (
    assumed_lines,
    fleet_figures,
    human_area,
    human_duration,
    human_length,
    human_lonlat,
)

if TYPE_CHECKING:
    from rich.console import Group

__all__ = ["fleet_table", "report_json", "report_text", "summary_lines"]


def fleet_table(plan: FleetPlan) -> Group:
    """Return the plan as a table for a rich console.

    Parameters
    ----------
    plan
        The plan.

    Returns
    -------
    rich.console.Group
        One row per robot, then the fleet's figures, what was assumed, and the notes.
    """
    # rich is imported here because `mrmission --help` does without it.
    from rich import box
    from rich.console import Group, RenderableType
    from rich.markup import escape
    from rich.table import Table
    from rich.text import Text

    report = plan.report
    robots = Table(
        title=Text(plan.area.name), title_justify="left", box=box.SIMPLE_HEAD, pad_edge=False
    )
    robots.add_column("robot", justify="right")
    robots.add_column("start (lon,lat)")
    for name in ("lanes", "items", "survey", "transit", "length", "time"):
        robots.add_column(name, justify="right", no_wrap=True)
    fenced = any(row.fence_points for row in report.robots)
    if fenced:
        robots.add_column("fence", justify="right", no_wrap=True)
    longest_s = max((row.duration_s for row in report.robots), default=0.0)
    for row in report.robots:
        style = "bold" if row.duration_s >= longest_s > 0 else None
        cells = [
            Text(f"■ {row.robot}", style=robot_colour(row.robot, dark=True)),
            Text(human_lonlat(*row.start_lonlat)),
            Text(str(row.lanes) if row.lanes else "no work"),
            Text(str(row.items)),
            Text(human_length(row.survey_m)),
            Text(human_length(row.transit_m)),
            Text(human_length(row.length_m)),
            Text(human_duration(row.duration_s)),
        ]
        if fenced:
            land = f" +{human_area(row.fence_land_m2)} land" if row.fence_land_m2 >= 1 else ""
            cells.append(Text(f"{row.fence_points} pts{land}"))
        robots.add_row(*cells, style=style)

    figures = Table(box=None, show_header=False, pad_edge=False)
    figures.add_column(style="dim")
    figures.add_column()
    for name, value in fleet_figures(report):
        figures.add_row(Text(name), Text(value))

    parts: list[RenderableType] = [robots, figures]
    assumed = assumed_lines(report)
    if assumed:
        text = ", ".join(f"{name} {value}" for name, value in assumed)
        parts.append(Text.from_markup(f"\n[bold]assumed[/bold] (not given): {escape(text)}"))
    notes = dict.fromkeys((*plan.area.notes, *report.notes))
    parts.extend(Text.from_markup(f"[bold]note[/bold]: {escape(note)}") for note in notes)
    return Group(*parts)

"""The table on the terminal."""

from __future__ import annotations

from typing import TYPE_CHECKING

from mrmission.model import FleetPlan, RobotReport
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
    from rich.console import Console, ConsoleOptions, RenderResult
    from rich.table import Table

__all__ = ["FleetTable", "fleet_table", "report_json", "report_text", "summary_lines"]

WIDE = 106
"""Columns of a terminal from which the starts have room in the table."""


class FleetTable:
    """A plan as a rich renderable that fits the width it is given."""

    def __init__(self, plan: FleetPlan) -> None:
        self.plan = plan

    def __rich_console__(self, console: Console, options: ConsoleOptions) -> RenderResult:
        # rich is imported here because `mrmission --help` does without it.
        from rich.markup import escape
        from rich.table import Table
        from rich.text import Text

        report = self.plan.report
        wide = options.max_width >= WIDE
        yield self._robots(wide)
        if not wide:
            starts = "  ".join(
                f"{_called(row)}: {human_lonlat(*row.start_lonlat)}" for row in report.robots
            )
            yield Text.from_markup(f"[dim]start (lon,lat)[/dim] {escape(starts)}\n")
        figures = Table(box=None, show_header=False, pad_edge=False)
        figures.add_column(style="dim")
        figures.add_column()
        for name, value in fleet_figures(report):
            figures.add_row(Text(name), Text(value))
        yield figures
        assumed = assumed_lines(report)
        if assumed:
            text = ", ".join(f"{name} {value}" for name, value in assumed)
            yield Text.from_markup(f"\n[bold]assumed[/bold] (not given): {escape(text)}")

    def _robots(self, wide: bool) -> Table:
        from rich import box
        from rich.table import Table
        from rich.text import Text

        report = self.plan.report
        robots = Table(
            title=Text(self.plan.area.name),
            title_justify="left",
            box=box.SIMPLE_HEAD,
            pad_edge=False,
        )
        robots.add_column("robot", justify="right", no_wrap=True)
        if wide:
            robots.add_column("start (lon,lat)", no_wrap=True)
        several = any(len(row.sorties) > 1 for row in report.robots)
        if several:
            robots.add_column("trips", justify="right", no_wrap=True)
        fenced = any(row.fence_points for row in report.robots)
        parts = wide or not (several and fenced)  # trips and fences leave no room for them
        lengths = ("survey", "transit", "length") if parts else ("length",)
        for name in ("lanes", "items", *lengths, "time"):
            robots.add_column(name, justify="right", no_wrap=True)
        if fenced:
            robots.add_column("fence", justify="right")
        longest_s = max((row.duration_s for row in report.robots), default=0.0)
        for row in report.robots:
            label = f"■ {_called(row) if wide else row.robot}"
            cells = [Text(label, style=robot_colour(row.robot, dark=True))]
            if wide:
                cells.append(Text(human_lonlat(*row.start_lonlat)))
            if several:
                cells.append(Text(str(len(row.trips)) if row.lanes else "–"))
            cells += [
                Text(str(row.lanes) if row.lanes else "no work"),
                Text(str(row.items)),
                *(Text(human_length(getattr(row, f"{name}_m"))) for name in lengths),
                Text(human_duration(row.duration_s)),
            ]
            if fenced:
                land = f" +{human_area(row.fence_land_m2)} land" if row.fence_land_m2 >= 1 else ""
                cells.append(Text(f"{row.fence_points} pts{land}"))
            robots.add_row(*cells, style="bold" if row.duration_s >= longest_s > 0 else None)
        return robots


def _called(row: RobotReport) -> str:
    """Return a robot's number, and its name if it has one."""
    return f"{row.robot} {row.name}".rstrip()


def fleet_table(plan: FleetPlan) -> FleetTable:
    """Return the plan as a table for a rich console.

    Parameters
    ----------
    plan
        The plan.

    Returns
    -------
    FleetTable
        One row per robot, then the fleet's figures and what was assumed. The notes are not in
        it: they go to stderr.
    """
    return FleetTable(plan)

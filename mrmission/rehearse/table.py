"""A rehearsal as a table on the terminal."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING

from mrmission.rehearse.judge import FleetDriven, PairDriven, RobotDriven
from mrmission.report.colours import robot_colour
from mrmission.report.units import (
    UNKNOWN,
    human_area,
    human_duration,
    human_lonlat,
    human_share,
)

if TYPE_CHECKING:
    from rich.console import Console, ConsoleOptions, RenderResult
    from rich.table import Table


def metres(value_m: float, digits: int = 2) -> str:
    """Return metres as text; a dash for what is not known.

    >>> metres(1.234), metres(float("nan"))
    ('1.23 m', '–')
    """
    return f"{value_m:.{digits}f} m" if math.isfinite(value_m) else UNKNOWN


def deviation(planned_s: float, driven_s: float) -> str:
    """Return by how much a driven time departs from the planned one.

    >>> deviation(100.0, 103.0), deviation(100.0, float("nan"))
    ('+3.0 %', '–')
    """
    if not (math.isfinite(driven_s) and planned_s > 0):
        return UNKNOWN
    return f"{100 * (driven_s / planned_s - 1):+.1f} %"


def fleet_lines(driven: FleetDriven) -> list[tuple[str, str]]:
    """Return the fleet's figures in reading order."""
    swept, survey = driven.coverage, driven.coverage_survey_legs
    lines = [
        (
            "Swept of the coverable area, all legs",
            f"{human_share(swept.share)} (planned {human_share(driven.planned_coverage)})",
        ),
        (
            "… survey legs alone",
            (
                f"{human_share(survey.share)} "
                f"(planned {human_share(driven.planned_coverage_survey_legs)})"
            ),
        ),
        (
            "Largest missed piece",
            human_area(swept.largest_missed_m2)
            + (f" at {human_lonlat(*swept.missed_lonlat)}" if swept.missed_lonlat else ""),
        ),
        (
            "Distance from the lanes",
            (
                f"mean {metres(driven.cross_track.mean_m)}, "
                f"p95 {metres(driven.cross_track.p95_m)}, "
                f"largest {metres(driven.cross_track.max_m)}"
            ),
        ),
        (
            "… from 10 m after a lane's start",
            (
                f"mean {metres(driven.cross_track.settled_mean_m)}, "
                f"p95 {metres(driven.cross_track.settled_p95_m)}, "
                f"largest {metres(driven.cross_track.settled_max_m)}"
            ),
        ),
        (
            "Everybody home after",
            (
                f"{human_duration(driven.driven_makespan_s)} "
                f"(planned {human_duration(driven.planned_makespan_s)})"
            ),
        ),
        ("Fence events", str(driven.fence_events)),
    ]
    met = driven.nearest
    if met is not None:
        place = f" at {human_lonlat(*driven.nearest_lonlat)}" if driven.nearest_lonlat else ""
        lines.append(
            (
                "Nearest two under way",
                (
                    f"{metres(met.distance_m, 1)}, robots {met.robots[0]} and {met.robots[1]}, "
                    f"after {human_duration(met.time_s)}{place}"
                ),
            )
        )
    promised = [pair for pair in driven.pairs if pair.planned_m is not None]
    if promised:
        lines.append(("Pairs nearer than the plan allows for", _broken(promised)))
    return lines


def _broken(pairs: Sequence[PairDriven]) -> str:
    """Return how many of some pairs came nearer than planned, and the worst of them."""
    worst = max(pairs, key=lambda pair: pair.short_m)
    count = sum(pair.short_m > 0 for pair in pairs)
    if not count or worst.planned_m is None or worst.driven is None:
        return f"none of {len(pairs)}"
    return (
        f"{count} of {len(pairs)}, the worst robots {worst.robots[0]} and {worst.robots[1]}: "
        f"{metres(worst.driven.distance_m, 1)} instead of {metres(worst.planned_m, 1)}"
    )


class RehearsalTable:
    """A rehearsal as a rich renderable."""

    def __init__(self, driven: FleetDriven) -> None:
        self.driven = driven

    def __rich_console__(self, console: Console, options: ConsoleOptions) -> RenderResult:
        # rich is imported here because `mrmission --help` does without it.
        from rich.table import Table
        from rich.text import Text

        yield self._robots()
        figures = Table(box=None, show_header=False, pad_edge=False)
        figures.add_column(style="dim")
        figures.add_column()
        for name, value in fleet_lines(self.driven):
            figures.add_row(Text(name), Text(value))
        yield figures

    def _robots(self) -> Table:
        from rich import box
        from rich.table import Table
        from rich.text import Text

        table = Table(
            title=Text(f"{self.driven.area}: rehearsed"),
            title_justify="left",
            box=box.SIMPLE_HEAD,
            pad_edge=False,
        )
        several = any(row.sortie > 1 for row in self.driven.robots)
        watched = any(row.watched_s > 0 for row in self.driven.robots)
        names = ["robot", "lanes", "start", "planned", "driven", "off by", "swept", "p95", "fence"]
        names += ["home", "drift"] if watched else ["home"]
        for name in names:
            table.add_column(name, justify="right", overflow="fold")
        for row in self.driven.robots:
            name = f"■ {row.robot}" + (f".{row.sortie}" if several else "")
            cells = [Text(name, style=robot_colour(row.robot, dark=True))]
            cells += [Text(text) for text in self._cells(row)]
            if watched:
                cells.append(Text(metres(row.watched_m, 1)))
            table.add_row(*cells)
        return table

    def _cells(self, row: RobotDriven) -> list[str]:
        return [
            str(row.lanes),
            f"+{row.start_delay_s:.0f} s",
            human_duration(row.planned_s),
            human_duration(row.driven_s),
            deviation(row.planned_s, row.driven_s),
            human_share(row.coverage),
            metres(row.cross_track.p95_m),
            str(row.fence_events) if row.fence_events else "kept",
            metres(row.home_m, 1) if row.home else f"no: {row.end}",
        ]

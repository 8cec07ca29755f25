"""The one table of an upload, and the same as JSON."""

from __future__ import annotations

import json
import sys
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import asdict
from typing import TYPE_CHECKING, Any

from mrmission.report.colours import robot_colour
from mrmission.report.units import human_duration, human_length
from mrmission.vehicle.rows import ProgressCallback, UploadProgress, UploadRow

if TYPE_CHECKING:
    from rich.table import Table

    from mrmission.vehicle.capacity import KnownLimits


def upload_table(rows: Sequence[UploadRow], title: str = "Upload") -> Table:
    """Return the rows of an upload as a table for a rich console.

    Parameters
    ----------
    rows
        One per robot.
    title
        What stands above it.
    """
    from rich import box
    from rich.table import Table
    from rich.text import Text

    table = Table(title=Text(title), title_justify="left", box=box.SIMPLE_HEAD, pad_edge=False)
    for name in ("robot", "system id"):
        table.add_column(name, justify="right", no_wrap=True)
    table.add_column("link", no_wrap=True)
    for name in ("items", "fence", "rally", "length", "time", "tries"):
        table.add_column(name, justify="right", no_wrap=True)
    table.add_column("result", overflow="fold")
    for row in rows:
        result = Text(f"✓ {row.status}" if row.verified else f"✗ {row.status}")
        result.stylize("green" if row.verified else "bold red")
        if row.detail:
            result.append(f": {row.detail}", style="dim" if row.verified else "")
        table.add_row(
            Text(f"■ {row.robot}", style=robot_colour(row.robot, dark=True)),
            Text("–" if row.system_id is None else str(row.system_id)),
            Text(row.link or "–"),
            Text(str(row.items) if row.items else "no work"),
            Text(str(row.fence_items)),
            Text(str(row.rally_points)),
            Text(human_length(row.length_m)),
            Text("–" if row.duration_s is None else human_duration(row.duration_s)),
            Text(str(row.attempts)),
            result,
        )
    return table


def upload_json(
    rows: Sequence[UploadRow], limits: Mapping[int, KnownLimits], simulated: bool
) -> str:
    """Return the rows of an upload as a JSON document.

    Parameters
    ----------
    rows
        One per robot.
    limits
        What each robot's vehicle holds, and who says so.
    simulated
        Whether they went to simulated boats.
    """
    entries: list[dict[str, Any]] = []
    for row in rows:
        entry = asdict(row)
        entry["status"] = str(row.status)
        entry["holds"] = str(row.holds)
        entry["elapsed_s"] = round(row.elapsed_s, 3)
        entry["limits"] = asdict(limits[row.robot]) if row.robot in limits else None
        entries.append(entry)
    document = {
        "simulated": simulated,
        "verified": all(row.verified for row in rows),
        "robots": entries,
    }
    return json.dumps(document, indent=2, allow_nan=False, ensure_ascii=False) + "\n"


@contextmanager
def upload_progress(robots: Sequence[int]) -> Iterator[ProgressCallback]:
    """Show one bar per robot on a terminal; elsewhere say only what a cancelled vehicle holds."""
    import click

    told: set[str] = set()

    def cancelled(event: UploadProgress) -> None:
        if event.stage == "stopping" and not told:
            told.add(event.stage)
            click.echo(
                "interrupted: vehicles get back what they held, or are emptied; Ctrl-C again "
                "leaves them as they are",
                err=True,
            )
        elif event.stage.startswith("cancelled"):
            click.echo(
                f"robot {event.robot} (system id {event.system_id}): {event.stage}", err=True
            )

    if not sys.stderr.isatty():
        yield cancelled
        return
    from rich.console import Console
    from rich.progress import BarColumn, Progress, TextColumn, TimeElapsedColumn

    columns = (
        TextColumn("robot {task.fields[robot]}"),
        BarColumn(),
        TextColumn("{task.description}"),
        TimeElapsedColumn(),
    )
    with Progress(*columns, console=Console(stderr=True), transient=True) as progress:
        tasks = {
            robot: progress.add_task("waiting for the vehicle", total=1.0, robot=robot)
            for robot in robots
        }

        def show(event: UploadProgress) -> None:
            progress.update(tasks[event.robot], description=event.stage, completed=event.fraction)
            cancelled(event)

        yield show

"""``mrmission status``: whether every vehicle still carries the plan it was verified to store."""

from __future__ import annotations

import asyncio
import json
import sys
from collections.abc import Sequence
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING

import click

from mrmission.cli.link_options import link_options, read_signing
from mrmission.cli.upload_run import LinkChoice
from mrmission.errors import InputError, VehicleError

if TYPE_CHECKING:
    from rich.table import Table

    from mrmission.vehicle.status import StatusRow

EXIT_DIFFERENT = 1


@click.command()
@click.argument("folder", metavar="DIR", type=click.Path(path_type=Path))
@link_options("the links of fleet.json")
@click.option("--json", "as_json", is_flag=True, help="Print the rows as JSON instead of a table.")
def status(
    folder: Path, connect: tuple[str, ...], client: str, sign_key_file: Path | None, as_json: bool
) -> int:
    """Ask every vehicle of DIR's fleet.json whether it still carries its part of the plan.

    Mission, fence and rally points are read back and compared with what was verified at the
    upload, and with the folder's plan. Nothing is written. The exit code is 0 when all carry it,
    1 when one carries something else or nothing, 5 when one does not answer.
    """
    from mrmission.vehicle.connection import parse_connections

    parse_connections(connect)
    links = LinkChoice(connect=connect, client=client, signing=read_signing(sign_key_file, client))
    return run_status(folder, links=links, as_json=as_json)


def run_status(folder: Path, *, links: LinkChoice | None = None, as_json: bool = False) -> int:
    """Read the fleet of a folder back, print what it carries, return the exit code.

    Parameters
    ----------
    folder
        With ``fleet.json`` and, where they are still there, the ``.plan`` files.
    links
        How vehicles are reached; the links of the record where none is given.
    as_json
        Print JSON instead of the table.

    Raises
    ------
    InputError
        When nothing was uploaded from the folder.
    """
    from mrmission.cli.upload_plan import read_missions
    from mrmission.vehicle.assign import carried_sorties
    from mrmission.vehicle.record import FILE_NAME, read_record
    from mrmission.vehicle.status import fleet_status

    links = links or LinkChoice()
    if not folder.is_dir():
        raise InputError(
            f"{folder}: no such folder; name one that was uploaded with --out or --from"
        )
    records = read_record(folder)
    if not records:
        raise InputError(
            f"{folder}: holds no {FILE_NAME}: nothing was uploaded from it yet; run `mrmission "
            f"upload --from {folder}`"
        )
    planned = any(folder.glob("robot-*.plan"))
    sorties = {record.robot: record.sortie for record in records}
    missions = carried_sorties(read_missions(folder, named=""), sorties) if planned else []
    rows = asyncio.run(
        fleet_status(
            records,
            links.connect,
            missions={mission.robot: mission for mission in missions},
            timeouts=links.timeouts,
            client=links.client,
            signing=links.signing,
        )
    )
    left_out = sorted({m.robot for m in missions} - {record.robot for record in records})
    if as_json:
        sys.stdout.write(status_json(rows, left_out))
    else:
        _show(rows, left_out, f"{folder}: status")
    return exit_code(rows, left_out)


def exit_code(rows: Sequence[StatusRow], left_out: Sequence[int] = ()) -> int:
    """Return 0 when all carry the plan, 1 when one does not, 5 when one could not be asked."""
    from mrmission.vehicle.status import Carries

    if left_out or any(row.carries.asked and row.carries is not Carries.PLAN for row in rows):
        return EXIT_DIFFERENT
    return 0 if all(row.carries.asked for row in rows) else VehicleError.exit_code


def status_table(rows: Sequence[StatusRow], title: str = "Status") -> Table:
    """Return the rows as a table for a rich console."""
    from rich import box
    from rich.table import Table
    from rich.text import Text

    from mrmission.report.colours import robot_colour
    from mrmission.vehicle.status import Carries

    table = Table(title=Text(title), title_justify="left", box=box.SIMPLE_HEAD, pad_edge=False)
    for name in ("robot", "system id"):
        table.add_column(name, justify="right", no_wrap=True)
    table.add_column("link", no_wrap=True)
    for name in ("items", "fence", "rally"):
        table.add_column(name, justify="right", no_wrap=True)
    table.add_column("carries", overflow="fold")
    for row in rows:
        right = row.carries is Carries.PLAN
        result = Text(f"{'✓' if right else '✗'} {row.carries}")
        result.stylize("green" if right else "bold red")
        if row.detail:
            result.append(f": {row.detail}", style="dim" if right else "")
        counts = (row.items, row.fence_items, row.rally_points)
        table.add_row(
            Text(f"■ {row.robot}", style=robot_colour(row.robot, dark=True)),
            Text(str(row.system_id)),
            Text(row.link),
            *(Text("–" if count is None else str(count)) for count in counts),
            result,
        )
    return table


def status_json(rows: Sequence[StatusRow], left_out: Sequence[int] = ()) -> str:
    """Return the rows as a JSON document."""
    document = {
        "all_carry_the_plan": exit_code(rows, left_out) == 0,
        "robots_without_vehicle": list(left_out),
        "robots": [{**asdict(row), "carries": str(row.carries)} for row in rows],
    }
    return json.dumps(document, indent=2, allow_nan=False, ensure_ascii=False) + "\n"


def _show(rows: Sequence[StatusRow], left_out: Sequence[int], title: str) -> None:
    from rich.console import Console

    from mrmission.vehicle.status import Carries

    console = Console() if sys.stdout.isatty() else Console(width=200)
    console.print(status_table(rows, title))
    if left_out:
        names = ", ".join(map(str, left_out))
        click.echo(f"robots without a vehicle yet: {names}; upload completes them", err=True)
    carrying = sum(row.carries is Carries.PLAN for row in rows)
    click.echo(f"{carrying} of {len(rows)} vehicles carry this plan; nothing was written", err=True)

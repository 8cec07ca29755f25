"""``mrmission preflight``: every vehicle's parameters and state against its plan."""

from __future__ import annotations

import asyncio
import json
import sys
from collections.abc import Sequence
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from mrmission.cli.link_options import link_options, read_signing
from mrmission.errors import ConfigError, PlanFormatError, VehicleError

if TYPE_CHECKING:
    from rich.table import Table

    from mrmission.vehicle.preflight import VehicleCheck

EXIT_WRONG = 1
_MARKS = {"wrong": ("✗", "bold red"), "doubtful": ("?", "yellow"), "fine": ("✓", "green")}


@click.command()
@click.argument("folder", metavar="[DIR]", required=False, type=click.Path(path_type=Path))
@click.option(
    "--from",
    "from_folder",
    type=click.Path(path_type=Path),
    help="The same as DIR.",
)
@link_options("the links of fleet.json, else the K ports of SITL, 5760 + 10 i")
@click.option("--all", "everything", is_flag=True, help="Show also what is fine.")
@click.option("--json", "as_json", is_flag=True, help="Print every row as JSON.")
def preflight(
    folder: Path | None,
    from_folder: Path | None,
    connect: tuple[str, ...],
    client: str,
    sign_key_file: Path | None,
    everything: bool,
    as_json: bool,
) -> int:
    """Compare every vehicle's parameters and state with the plan in DIR. Nothing is written.

    DIR holds the robot-*.plan files and report.json of `mrmission plan` or `upload --out`. Each
    row says what was found, what is wanted, and why. The exit code is 0 when all is well or only
    doubtful, 1 when something would go wrong, 5 when no vehicle answers.
    """
    from mrmission.vehicle.connection import parse_connections

    if folder is not None and from_folder is not None and folder != from_folder:
        raise ConfigError(f"DIR {folder} and --from {from_folder}: choose one")
    chosen = folder or from_folder
    if chosen is None:
        raise ConfigError("DIR is missing: name a folder that `mrmission plan` left")
    if client != "pymavlink":
        raise ConfigError("--client mavsdk: preflight needs messages that MAVSDK does not pass on")
    parse_connections(connect)
    return run_preflight(
        chosen,
        connect=connect,
        sign_key_file=sign_key_file,
        everything=everything,
        as_json=as_json,
    )


def run_preflight(
    folder: Path,
    *,
    connect: Sequence[str] = (),
    sign_key_file: Path | None = None,
    everything: bool = False,
    as_json: bool = False,
) -> int:
    """Check the fleet of a folder, print the table, return the exit code.

    Parameters
    ----------
    folder
        With the ``.plan`` files and, best, ``report.json`` and ``fleet.json``.
    connect
        Links; the record's where there are none, else the ports of SITL.
    sign_key_file
        Passphrase of signed links.
    everything
        Show also what is fine.
    as_json
        Print JSON instead of the table.
    """
    from mrmission.cli.upload_plan import read_missions
    from mrmission.vehicle.assign import carried_sorties
    from mrmission.vehicle.preflight import preflight_fleet
    from mrmission.vehicle.record import read_record

    missions = read_missions(folder, named="")
    report = read_report(folder)
    records = read_record(folder)
    missions = carried_sorties(missions, {record.robot: record.sortie for record in records})
    robots = {mission.robot for mission in missions}
    recorded = [record for record in records if record.robot in robots]
    links = list(connect)
    if not links and {record.robot for record in recorded} == robots:
        links = sorted({record.link for record in recorded})
    checks = asyncio.run(
        preflight_fleet(
            missions,
            links,
            report=report,
            assignment={record.robot: record.system_id for record in recorded},
            signing=read_signing(sign_key_file, "pymavlink"),
        )
    )
    if all(check.system_id is None for check in checks):
        raise VehicleError(
            f"preflight of {folder}: {checks[0].rows[0].reason}; start the vehicles, or name them "
            "with --connect"
        )
    if as_json:
        sys.stdout.write(preflight_json(checks))
    else:
        _show(checks, f"{folder}: preflight", everything=everything, with_report=bool(report))
    return exit_code(checks)


def read_report(folder: Path) -> dict[str, Any] | None:
    """Return the content of a folder's ``report.json``, None where there is none.

    Raises
    ------
    PlanFormatError
        When it cannot be read.
    """
    path = folder / "report.json"
    if not path.is_file():
        return None
    try:
        content = json.loads(path.read_text(encoding="utf-8"))
    except (OSError, ValueError) as error:
        raise PlanFormatError(f"{path}: not a report ({error}); plan again") from error
    if not isinstance(content, dict):
        raise PlanFormatError(f"{path}: not a report; plan again")
    return content


def exit_code(checks: Sequence[VehicleCheck]) -> int:
    """Return 1 when something would go wrong, else 0."""
    return EXIT_WRONG if any(check.severity == "wrong" for check in checks) else 0


def preflight_table(
    checks: Sequence[VehicleCheck], title: str = "Preflight", *, everything: bool = False
) -> Table:
    """Return the checks as one table for a rich console.

    Parameters
    ----------
    checks
        One per robot.
    title
        What stands above it.
    everything
        Whether to show what is fine; without, a robot with nothing else has one row.
    """
    from rich import box
    from rich.table import Table
    from rich.text import Text

    from mrmission.report.colours import robot_colour

    table = Table(title=Text(title), title_justify="left", box=box.SIMPLE_HEAD, pad_edge=False)
    table.add_column("robot", justify="right", no_wrap=True)
    table.add_column("", no_wrap=True)
    for name in ("what", "found", "wanted"):
        table.add_column(name, overflow="fold")
    table.add_column("why", overflow="fold", ratio=1)
    for check in checks:
        shown = [row for row in check.rows if everything or row.severity != "fine"]
        who = Text(f"■ {check.robot}", style=robot_colour(check.robot, dark=True))
        if not shown:
            mark, style = _MARKS["fine"]
            table.add_row(who, Text(mark, style=style), f"all {len(check.rows)} checks", "", "", "")
        for row in shown:
            mark, style = _MARKS[row.severity]
            table.add_row(
                who,
                Text(mark, style=style),
                Text(row.subject),
                Text(row.found),
                Text(row.wanted),
                Text(row.reason, style="dim" if row.severity == "fine" else ""),
            )
    return table


def preflight_json(checks: Sequence[VehicleCheck]) -> str:
    """Return the checks as a JSON document."""
    document = {
        "ready": exit_code(checks) == 0,
        "robots": [{**asdict(check), "severity": str(check.severity)} for check in checks],
    }
    return json.dumps(document, indent=2, allow_nan=False, ensure_ascii=False) + "\n"


def _show(
    checks: Sequence[VehicleCheck], title: str, *, everything: bool, with_report: bool
) -> None:
    from rich.console import Console

    console = Console() if sys.stdout.isatty() else Console(width=200)
    console.print(preflight_table(checks, title, everything=everything))
    if not with_report:
        click.echo("no report.json: swath, speeds and the shore are not known", err=True)
    counts = {
        mark: sum(row.severity == mark for check in checks for row in check.rows)
        for mark in ("wrong", "doubtful", "fine")
    }
    text = ", ".join(f"{count} {mark}" for mark, count in counts.items())
    click.echo(f"{len(checks)} vehicles: {text}; nothing was written", err=True)

"""``mrmission check``: exported missions against the survey area."""

from __future__ import annotations

import json
import sys
from pathlib import Path

import click

from mrmission.cli.areas import read_area
from mrmission.cli.options import area_options


@click.command()
@area_options
@click.argument("plans", nargs=-1, required=True, type=click.Path(path_type=Path))
@click.option(
    "--clearance",
    "clearance_m",
    type=float,
    default=0.0,
    show_default=True,
    help="Distance from shore and islands that the missions should keep, m.",
)
@click.option(
    "--turnaround",
    "turnaround_m",
    type=float,
    default=0.0,
    show_default=True,
    help="How far beyond that a copter's turns may reach, m.",
)
@click.option("--json", "as_json", is_flag=True, help="Print the violations as JSON.")
def check(
    area: Path,
    resolution: float | None,
    origin: tuple[float, float] | None,
    part: int | None,
    islands: bool,
    plans: tuple[Path, ...],
    clearance_m: float,
    turnaround_m: float,
    as_json: bool,
) -> int:
    """Check PLANS (.plan or .waypoints files) against AREA; exit 1 when something is wrong.

    Every leg must keep in the water, by the clearance; inside its fence; the mission must end
    where it began, fit a vehicle, and hold nothing that the vehicle does not execute. A copter
    takes off first, flies above the ground and returns; a camera that is on goes off.
    """
    from dataclasses import asdict

    from mrmission.mission.check import check_mission
    from mrmission.mission.qgc_plan import read_plan
    from mrmission.mission.wpl import read_waypoints

    survey = read_area(area, resolution, origin, part, islands)
    found = []
    for path in plans:
        mission = read_waypoints(path) if path.suffix == ".waypoints" else read_plan(path)
        wrong = check_mission(
            mission, survey.water_lonlat, clearance_m=clearance_m, turnaround_m=turnaround_m
        )
        found += [(path, violation) for violation in wrong]
    if as_json:
        rows = [{"file": str(path), **asdict(violation)} for path, violation in found]
        sys.stdout.write(json.dumps(rows, indent=2) + "\n")
    else:
        for path, violation in found:
            click.echo(f"{path}: {violation.message}")
    missions = "1 mission" if len(plans) == 1 else f"{len(plans)} missions"
    violations = "1 violation" if len(found) == 1 else f"{len(found)} violations"
    click.echo(f"{missions}, {violations}", err=True)
    return 1 if found else 0

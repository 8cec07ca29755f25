"""``mrmission rehearse``: sail a plan with simulated vehicles and measure what was driven."""

from __future__ import annotations

import asyncio
import re
import sys
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from mrmission.cli.areas import read_area
from mrmission.cli.collector import paused_collector
from mrmission.cli.options import area_options, assumed_options, build_options, plan_options
from mrmission.cli.sim import parse_parameter
from mrmission.errors import ConfigError

if TYPE_CHECKING:
    from mrmission.model import FleetPlan, SurveyArea
    from mrmission.options import PlanOptions

_DURATION = re.compile(r"(\d+(?:\.\d*)?)\s*(s|min|h|)")
_SECONDS = {"": 1.0, "s": 1.0, "min": 60.0, "h": 3600.0}
MODEL_OF = {"boat": "motorboat", "rover": "rover"}
VIOLATIONS = 1
WIDTH = 110
"""Columns of the table where stdout is no terminal."""


def parse_duration(text: str, flag: str) -> float:
    """Return ``90``, ``90s``, ``10min`` or ``1.5h`` as seconds.

    Raises
    ------
    ConfigError
        When `text` is something else.
    """
    found = _DURATION.fullmatch(text.strip())
    if found is None:
        raise ConfigError(f"{flag} {text}: must be a duration such as 90s, 10min or 1h")
    return float(found[1]) * _SECONDS[found[2]]


@click.command()
@area_options
@plan_options
@click.option(
    "--engine",
    type=click.Choice(["light", "ardupilot"]),
    default="light",
    show_default=True,
    help="Who sails: the light boats of mrmission, or ArduPilot in SITL.",
)
@click.option(
    "--model",
    help="Model of ArduPilot's: motorboat steers, pivoting turns on the spot (and wants --steering "
    "pivoting).  [default: motorboat or rover, after --vehicle]",
)
@click.option(
    "--speedup",
    type=float,
    default=10.0,
    show_default=True,
    help="Seconds on the water per second; a busy machine is slower, the figures are the same.",
)
@click.option(
    "--current",
    "current_m_s",
    type=float,
    default=0.0,
    show_default=True,
    help="Speed of the current, m/s.",
)
@click.option(
    "--current-from",
    "current_from_deg",
    type=float,
    help="Bearing that the current comes from, degrees.  [default: across the lanes]",
)
@click.option("--waves", is_flag=True, help="With waves (ArduPilot's engine).")
@click.option(
    "--param",
    "params",
    multiple=True,
    metavar="NAME=VALUE",
    help="Set a parameter on every vehicle.",
)
@click.option(
    "--watch-end",
    default="0s",
    show_default=True,
    metavar="DURATION",
    help="Go on watching when a vehicle is home: does it hold its place? As in 10min.",
)
@click.option(
    "--min-coverage",
    type=float,
    default=0.995,
    show_default=True,
    help="Share of the coverable area that must be swept.",
)
@click.option(
    "--max-cross-track",
    type=float,
    help="Largest 95th percentile of the distance from the lanes, m.  [default: swath/10]",
)
@click.option(
    "--min-distance",
    type=float,
    default=10.0,
    show_default=True,
    help="Least distance between two vehicles under way, m.",
)
@click.option(
    "--max-home",
    type=float,
    default=10.0,
    show_default=True,
    help="Farthest that a vehicle may be from home in the end, m.",
)
@click.option(
    "--out",
    type=click.Path(path_type=Path, file_okay=False),
    default=None,
    help="Folder for the results.  [default: AREA's name, with -rehearsal]",
)
@click.option("--overwrite", is_flag=True, help="Replace an earlier rehearsal in --out.")
@click.option("--figure", type=click.Path(path_type=Path), help="Draw the tracks (png, svg, pdf).")
@click.option("--json", "as_json", is_flag=True, help="Print rehearse.json instead of the table.")
@click.pass_context
def rehearse(
    ctx: click.Context,
    /,
    area: Path,
    resolution: float | None,
    origin: tuple[float, float] | None,
    part: int | None,
    islands: bool,
    engine: str,
    model: str | None,
    speedup: float,
    current_m_s: float,
    current_from_deg: float | None,
    waves: bool,
    params: tuple[str, ...],
    watch_end: str,
    min_coverage: float,
    max_cross_track: float | None,
    min_distance: float,
    max_home: float,
    out: Path | None,
    overwrite: bool,
    figure: Path | None,
    as_json: bool,
    **flags: Any,
) -> int:
    """Plan AREA, sail the plan with simulated vehicles, and measure what was driven.

    Starts its own vehicles at the plan's homes, uploads and verifies the missions, arms, sails
    and watches them, and compares the tracks with the plan: the area swept, the distance from the
    lanes, times, fence events, the nearest two vehicles came to each other. Robots that go out
    several times sail all first trips, then all second ones, and so on. Exit code 1 when
    something is outside the limits. No vehicle but its own is ever armed.
    """
    from mrmission.rehearse.files import check_folder, rehearse_text, write_rehearsal
    from mrmission.rehearse.judge import Limits, judge
    from mrmission.rehearse.pilot import SailOrders
    from mrmission.rehearse.run import Waters, sail_missions, sailing_rounds

    options = build_options(**flags)
    if options.vehicle not in MODEL_OF:
        raise ConfigError(f"--vehicle {options.vehicle}: a rehearsal sails boats and rovers")
    if engine == "light" and (model is not None or waves):
        raise ConfigError(
            "--engine light: has one model and no waves; leave --model and --waves out, or take "
            "--engine ardupilot"
        )
    waters = Waters(
        engine=engine,
        model=model or MODEL_OF[options.vehicle],
        speedup=speedup,
        current_m_s=current_m_s,
        current_from_deg=current_from_deg or 0.0,
        waves=waves,
        parameters=dict(parse_parameter(text) for text in params),
    )
    orders = SailOrders(watch_end_s=parse_duration(watch_end, "--watch-end"))
    limits = Limits(
        coverage=min_coverage,
        cross_track_m=options.swath_m / 10 if max_cross_track is None else max_cross_track,
        distance_m=min_distance,
        home_m=max_home,
    )
    folder = out if out is not None else Path(f"{area.stem}-rehearsal")
    check_folder(folder, overwrite)
    if figure is not None:
        from mrmission.report.figure import check_figure

        check_figure(figure, overwrite)
    survey = read_area(area, resolution, origin, part, islands)
    plan = _plan(ctx, survey, options)
    if current_from_deg is None:
        waters = waters.across(plan.report.angle_deg)
    rounds = sailing_rounds(plan.missions)
    if not rounds:
        raise ConfigError(f"{area}: no robot has anywhere to sail to")

    from mrmission.cli.progress import stages

    with stages() as say:
        tracks = [
            track
            for missions in rounds
            for track in asyncio.run(sail_missions(missions, waters, orders, stage=say))
        ]
        say("measuring")
        driven = judge(
            plan,
            tracks,
            limits=limits,
            delays_s={row.robot: row.start_delay_s for row in plan.report.robots},
            waters=waters.as_dict(),
        )
        written = write_rehearsal(driven, tracks, folder, overwrite)
        if figure is not None:
            from mrmission.rehearse.figure import save_tracks

            written.append(save_tracks(plan, tracks, driven, figure, overwrite=overwrite))
    if as_json:
        sys.stdout.write(rehearse_text(driven))
    else:
        _show(driven)
    for line in driven.violations:
        click.echo(f"outside the limits: {line}", err=True)
    click.echo(f"{len(written)} files in {folder}", err=True)
    return VIOLATIONS if driven.violations else 0


@paused_collector()
def _plan(ctx: click.Context, survey: SurveyArea, options: PlanOptions) -> FleetPlan:
    """Plan, and print what was assumed and noted."""
    from mrmission.cli.progress import stages
    from mrmission.pipeline import plan
    from mrmission.report.units import assumed_lines

    with stages() as say:
        result = plan(survey, options, assumed_options(ctx, options), on_stage=say)
    assumed = ", ".join(f"{name} {value}" for name, value in assumed_lines(result.report))
    if assumed:
        click.echo(f"assumed (not given): {assumed}", err=True)
    for note in result.report.notes:
        click.echo(f"note: {note}", err=True)
    return result


def _show(driven: Any) -> None:
    from rich.console import Console

    from mrmission.rehearse.table import RehearsalTable

    console = Console() if sys.stdout.isatty() else Console(width=WIDTH)
    console.print(RehearsalTable(driven))

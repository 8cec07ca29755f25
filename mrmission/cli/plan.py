"""``mrmission plan``: plan an area and write what each robot needs."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Any

import click

from mrmission.cli.areas import read_area
from mrmission.cli.collector import paused_collector
from mrmission.cli.options import area_options, assumed_options, build_options, plan_options


@click.command()
@area_options
@plan_options
@click.option(
    "--out",
    type=click.Path(path_type=Path, file_okay=False),
    default=None,
    help="Folder for the results.  [default: AREA's name, with -plan]",
)
@click.option("--overwrite", is_flag=True, help="Replace the results of an earlier plan in --out.")
@click.option(
    "--figure", type=click.Path(path_type=Path), help="Also draw the plan (png, svg, pdf)."
)
@click.option("--json", "as_json", is_flag=True, help="Print report.json instead of the table.")
@click.pass_context
@paused_collector()
def plan(
    ctx: click.Context,
    /,
    area: Path,
    resolution: float | None,
    origin: tuple[float, float] | None,
    part: int | None,
    islands: bool,
    out: Path | None,
    overwrite: bool,
    figure: Path | None,
    as_json: bool,
    **flags: Any,
) -> int:
    """Plan AREA for a fleet; leave .plan files, a map and a report in --out.

    AREA is a GeoJSON file (a lake with islands as holes, lon/lat), or a binary image with
    --resolution and --origin.
    """
    options = build_options(**flags)
    from mrmission.report.metrics import report_text
    from mrmission.results import check_folder, write_results

    folder = out if out is not None else Path(f"{area.stem}-plan")
    check_folder(folder, overwrite)
    if figure is not None:
        from mrmission.report.figure import check_figure

        check_figure(figure, overwrite)
    survey = read_area(area, resolution, origin, part, islands)

    from mrmission.cli.progress import stages
    from mrmission.pipeline import plan as plan_fleet

    with stages() as say:
        result = plan_fleet(survey, options, assumed_options(ctx, options), on_stage=say)
        say("writing")
        written = write_results(result, folder, overwrite)
        if figure is not None:
            from mrmission.report.figure import save_figure

            save_figure(result, figure, overwrite=overwrite)
    if as_json:
        sys.stdout.write(report_text(result))
    else:
        show_plan(result)
        click.echo(f"{len(written)} files in {folder}", err=True)
        if figure is not None:
            click.echo(f"figure in {figure}", err=True)
    return 0


def show_plan(result: Any) -> None:
    """Print the table of a plan on stdout, and its notes on stderr."""
    from rich.console import Console

    from mrmission.report.table import fleet_table

    console = Console(soft_wrap=True) if not sys.stdout.isatty() else Console()
    console.print(fleet_table(result))
    for note in result.report.notes:
        click.echo(f"note: {note}", err=True)

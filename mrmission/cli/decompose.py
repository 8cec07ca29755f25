"""``mrmission decompose``: the cells and the Reeb graph of an area."""

from __future__ import annotations

import json
import sys
from pathlib import Path

import click

from mrmission.cli.areas import read_area
from mrmission.cli.options import area_options


@click.command()
@area_options
@click.option(
    "--pitch",
    "pitch_m",
    type=float,
    default=10.0,
    show_default=True,
    help="Width of a column, m (images: one pixel).",
)
@click.option(
    "--clearance",
    "clearance_m",
    type=float,
    default=0.0,
    show_default=True,
    help="Distance kept from shore and islands, m (not for images).",
)
@click.option(
    "--angle",
    "angle_deg",
    type=float,
    default=0.0,
    show_default=True,
    help="Compass bearing of the columns, degrees (not for images).",
)
@click.option("--json", "as_json", is_flag=True, help="Print JSON.")
def decompose(
    area: Path,
    resolution: float | None,
    origin: tuple[float, float] | None,
    part: int | None,
    islands: bool,
    pitch_m: float,
    clearance_m: float,
    angle_deg: float,
    as_json: bool,
) -> int:
    """Decompose AREA into boustrophedon cells and print the figures of its Reeb graph.

    A polygon is cut by scanlines at the pitch; an image pixel column by pixel column, as in the
    paper. All parts of the water count.
    """
    from mrmission.report.cells import decomposition_figures

    survey = read_area(area, resolution, origin, part, islands)
    figures = decomposition_figures(survey, pitch_m, clearance_m, angle_deg)
    if as_json:
        sys.stdout.write(json.dumps(figures, indent=2) + "\n")
    else:
        for name, value in figures.items():
            text = f"{value:,.3f}".rstrip("0").rstrip(".") if isinstance(value, float) else value
            click.echo(f"{name:24s} {text}")
    return 0

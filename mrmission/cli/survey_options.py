"""Flags for what a survey has beside its lanes: laps, tie lines, runs at the lanes' ends."""

from __future__ import annotations

from typing import Any

import click

from mrmission.tour.tie_spec import parse_ties

SURVEY = [
    click.option(
        "--shore-laps",
        type=int,
        default=0,
        show_default=True,
        metavar="N",
        help="Laps along the shore and about every island; lanes sweep what is left inside.",
    ),
    click.option(
        "--tie-lines",
        metavar="SHARE|SPACING",
        default=None,
        help="Lines across the lanes to check them: 5% of the lanes' length, or every 200m; swept "
        "in addition.",
    ),
    click.option(
        "--run-in",
        "run_in_m",
        type=float,
        default=None,
        help="Metres of run-in before a lane.  [default: --turnaround]",
    ),
    click.option(
        "--run-out",
        "run_out_m",
        type=float,
        default=None,
        help="Metres of run-out after a lane.  [default: --turnaround]",
    ),
]


def read_survey_flags(flags: dict[str, Any]) -> None:
    """Read the values of the flags of :data:`SURVEY`, in place.

    Raises
    ------
    ConfigError
        When a value can't be read.
    """
    ties = flags.get("tie_lines")
    if isinstance(ties, str):
        flags["tie_lines"] = parse_ties(ties)

"""Flags for how far apart the robots of a fleet stay."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import click

from mrmission import quantity
from mrmission.errors import ConfigError

SEPARATION = [
    click.option(
        "--separation",
        "separation_m",
        metavar="LENGTH",
        default="20m",
        show_default=True,
        help="Least distance of two robots under way; 0: do not look. Robots turn their tours "
        "round and wait at the start for it.",
    ),
    click.option(
        "--time-uncertainty",
        metavar="SHARE",
        default="5%",
        show_default=True,
        help="What predicted times may be wrong by, either way, when robots are kept apart.",
    ),
    click.option(
        "--max-delay",
        "max_delay_s",
        metavar="TIME",
        default=None,
        help="No robot starts later than this, 5min.  [default: a tenth of the longest tour]",
    ),
    click.option(
        "--wait-in-mission",
        is_flag=True,
        help="Write start delays into the missions (boats and rovers): start all at once, each "
        "waits at its berth.",
    ),
]


def read_separation_flags(flags: dict[str, Any]) -> None:
    """Read the values of the flags of :data:`SEPARATION`, in place.

    Raises
    ------
    ConfigError
        When a value can't be read.
    """
    readers: tuple[tuple[str, str, Callable[[object], float]], ...] = (
        ("--separation", "separation_m", quantity.length_m),
        ("--time-uncertainty", "time_uncertainty", quantity.share),
        ("--max-delay", "max_delay_s", quantity.time_s),
    )
    for flag, name, read in readers:
        value = flags.get(name)
        if isinstance(value, str):
            try:
                flags[name] = read(value)
            except ValueError as error:
                raise ConfigError(f"{flag} {value}: {error}") from error

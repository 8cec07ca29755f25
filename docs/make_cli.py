"""Make docs/cli.md from the help of every command.

    python docs/make_cli.py

`tests/unit/test_docs.py` compares the page with what this makes, so the page cannot go stale.
"""

from __future__ import annotations

import os
from pathlib import Path

import click
from click.testing import CliRunner

from mrmission.cli.main import COMMANDS, cli

OUT = Path(__file__).resolve().parent / "cli.md"
WIDTH = 88

HEAD = """\
# Command line

This page is made by `docs/make_cli.py` from the help of each command; change the help, not the
page.

Results go to stdout, everything else (what was assumed, notes, progress) to stderr, so that
`--json` can be piped. Files are written whole or not at all, and never over others without
`--overwrite`. `LON,LAT` is degrees, longitude first; a negative longitude needs no quoting:
`--start -81.25,34.06`.

## Exit codes

| code | meaning |
| --- | --- |
| 0 | done |
| 1 | `check`, `preflight` or `rehearse` found violations, `status` a vehicle without this plan |
| 2 | usage or configuration: an option is unknown, out of range, or contradicts another |
| 3 | input: a file cannot be read, or holds no area that can be used |
| 4 | no plan could be made for a valid input |
| 5 | vehicle: one is absent, armed, refuses, or stores something else than it was sent |
| 70 | a bug; `mrmission --debug ...` shows the traceback |
| 130 | interrupted |

Where something is wrong, one line on stderr says what, where, the value, the limit and what to do.
"""


def help_of(path: list[str]) -> str:
    """Return the help of a command, as `mrmission PATH --help` prints it."""
    result = CliRunner().invoke(
        cli, [*path, "--help"], prog_name="mrmission", terminal_width=WIDTH, max_content_width=WIDTH
    )
    if result.exit_code:
        raise click.ClickException(f"{path}: {result.output}")
    return "\n".join(line.rstrip() for line in result.output.rstrip().splitlines())


def commands_of(name: str) -> list[list[str]]:
    """Return a command, and the commands in it when it is a group, as words."""
    command = cli.get_command(click.Context(cli), name)
    inside = command.commands if isinstance(command, click.Group) else {}
    return [[name], *([name, sub] for sub in inside)]


def page() -> str:
    """Return the whole page."""
    os.environ.pop("COLUMNS", None)
    parts = [HEAD, "## mrmission\n", f"```text\n{help_of([])}\n```\n"]
    for name in COMMANDS:
        for path in commands_of(name):
            parts += [f"## mrmission {' '.join(path)}\n", f"```text\n{help_of(path)}\n```\n"]
    return "\n".join(parts)


if __name__ == "__main__":
    OUT.write_text(page(), encoding="utf-8")

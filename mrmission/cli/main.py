"""The command line: one file per command, loaded when it is called; errors -> exit codes here."""

from __future__ import annotations

import importlib
import os
import sys
from collections.abc import Sequence
from typing import Any

import click

from mrmission import __version__
from mrmission.errors import MrMissionError

COMMANDS = {
    "plan": "Plan an area and write .plan files, a map and a report.",
    "upload": "Plan an area, upload the missions to the fleet and verify them.",
    "status": "Ask the fleet whether it still carries the plan that was uploaded.",
    "preflight": "Compare every vehicle's parameters and state with the plan.",
    "rehearse": "Sail a plan with simulated vehicles and measure what was driven.",
    "calibrate": "Sail courses of corners and measure what they cost, for the time model.",
    "sim": "Run simulated boats that speak MAVLink on loopback.",
    "check": "Check exported .plan files against an area.",
    "decompose": "Show the cells and the Reeb graph of an area.",
    "experiments": "Run the paper's study again, beside its printed numbers.",
    "warm": "Compile and cache the inner loops once.",
}
EXIT_BUG = 70
EXIT_INTERRUPTED = 130


class LazyGroup(click.Group):
    """A group that imports a command's module only when the command is used or asked for help."""

    def list_commands(self, ctx: click.Context) -> list[str]:
        """Return the commands in the order of use."""
        return list(COMMANDS)

    def get_command(self, ctx: click.Context, cmd_name: str) -> click.Command | None:
        """Import and return one command."""
        if cmd_name not in COMMANDS:
            return None
        command: click.Command = getattr(
            importlib.import_module(f"mrmission.cli.{cmd_name}"), cmd_name
        )
        return command

    def format_commands(self, ctx: click.Context, formatter: click.HelpFormatter) -> None:
        """List the commands without importing them."""
        with formatter.section("Commands"):
            formatter.write_dl(list(COMMANDS.items()))


@click.group(cls=LazyGroup, context_settings={"help_option_names": ["-h", "--help"]})
@click.version_option(__version__, prog_name="mrmission")
@click.option("--debug", is_flag=True, help="Show a traceback when something goes wrong.")
def cli(debug: bool) -> None:
    """MAVLink survey missions for fleets of boats and drones.

    Reads a lake with islands, plans one mission per robot so that every square metre is swept
    and everybody is home early, and uploads and verifies the missions.
    """


def main(argv: Sequence[str] | None = None) -> None:
    """Run the command line and exit with the code of `docs/cli.md`."""
    sys.exit(run(list(sys.argv[1:] if argv is None else argv)))


def run(argv: list[str]) -> int:
    """Run the command line and return its exit code."""
    debug = "--debug" in argv
    try:
        result: Any = cli.main(args=argv, prog_name="mrmission", standalone_mode=False)
        return int(result) if isinstance(result, int) else 0
    except click.exceptions.Exit as error:
        return error.exit_code
    except click.ClickException as error:
        error.show()
        return 2
    except (click.Abort, KeyboardInterrupt):
        click.echo("interrupted", err=True)
        return EXIT_INTERRUPTED
    except MrMissionError as error:
        if debug:
            raise
        click.echo(f"mrmission: {' '.join(str(error).split())}", err=True)
        return error.exit_code
    except BrokenPipeError:
        # whoever read our output has gone: end quietly, as other tools do
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return 0
    except Exception as error:  # the one place where a bug becomes an exit code
        if debug:
            raise
        click.echo(
            f"mrmission: this is a bug ({type(error).__name__}: {error}); "
            "run again as mrmission --debug ... for the traceback and report it",
            err=True,
        )
        return EXIT_BUG


if __name__ == "__main__":
    main()

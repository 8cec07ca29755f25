"""``mrmission experiments``: studies that can be run again."""

from __future__ import annotations

import os
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING

import click

if TYPE_CHECKING:
    from mrmission.experiments.study import Progress


@click.group()
def experiments() -> None:
    """Run a study again: tables, figures and the numbers behind them."""


@experiments.command()
@click.option(
    "--out",
    type=click.Path(path_type=Path, file_okay=False),
    default=Path(),
    show_default="here",
    help="Where to make the folder experiments.",
)
@click.option(
    "--maps",
    type=click.Path(path_type=Path, file_okay=False, exists=True),
    help="Folder of the four environments (PNG, white free), with published_results.json beside "
    "them.  [default: maps of our own making]",
)
@click.option("--quick", is_flag=True, help="A small run of some two minutes.")
@click.option(
    "--seed", type=int, default=1, show_default=True, help="Of the random maps and the search."
)
@click.option(
    "--processes",
    type=int,
    default=None,
    help="How many processes work at once.  [default: one per core]",
)
@click.option(
    "--scheduler",
    metavar="ADDRESS",
    help="Let the workers of a Dask scheduler do it (mrmission[dask]), such as tcp://host:8786.",
)
@click.option("--no-drive", is_flag=True, help="Leave the simulated boats out.")
def paper(
    out: Path,
    maps: Path | None,
    quick: bool,
    seed: int,
    processes: int | None,
    scheduler: str | None,
    no_drive: bool,
) -> int:
    """Do the study of "Efficient Multi-Robot Coverage of a Known Environment" again.

    Every table and figure beside the paper's printed numbers, every reading of what the paper
    leaves open, and our planner as a further row. What was found is remembered in
    experiments/cache: a run that was interrupted goes on where it stopped. The numbers are the
    same whatever the number of processes.
    """
    from mrmission.experiments.study import Study, StudyOptions

    options = StudyOptions(
        out=out,
        maps=maps,
        seed=seed,
        quick=quick,
        processes=(os.cpu_count() or 1) if processes is None else processes,
        scheduler=scheduler,
        drive=not no_drive,
    )
    with _bar() as progress:
        study = Study(options, progress)
        study.run()
    for table in study.tables:
        if table.title.startswith(("Table", "How")):
            click.echo(table.markdown())
    for note in study.notes:
        click.echo(f"note: {note}", err=True)
    click.echo(f"tables and figures in {study.folder}", err=True)
    return 0


@contextmanager
def _bar() -> Iterator[Progress]:
    """Show a progress bar when stderr is a terminal."""
    from mrmission.experiments.study import Progress

    if not sys.stderr.isatty():
        yield Progress()
        return
    from rich.console import Console
    from rich.progress import BarColumn, MofNCompleteColumn, TextColumn, TimeRemainingColumn
    from rich.progress import Progress as Bar

    columns = (
        TextColumn("{task.description}"),
        BarColumn(),
        MofNCompleteColumn(),
        TimeRemainingColumn(),
    )
    with Bar(*columns, console=Console(stderr=True), transient=True) as bar:
        task = bar.add_task("reading", total=None)

        class Shown(Progress):
            def begin(self, step: str, jobs: int) -> None:
                bar.reset(task, description=step, total=jobs)

            def advance(self) -> None:
                bar.advance(task)

        yield Shown()

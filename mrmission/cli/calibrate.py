"""``mrmission calibrate``: sail courses of corners and write what they cost."""

from __future__ import annotations

import asyncio
from pathlib import Path

import click

from mrmission.errors import ConfigError, SimulatorError

ENGINES = ("ardupilot", "light")


@click.command()
@click.option(
    "--steering",
    "steerings",
    type=click.Choice(["steered", "pivoting"]),
    multiple=True,
    help="How the boat turns; repeatable.  [default: both; the light boats steer]",
)
@click.option(
    "--speed", "speeds", type=float, multiple=True,
    help="WP_SPEED, m/s; repeatable.  [default: 1 2 3 5]",
)  # fmt: skip
@click.option(
    "--wp-radius", "radii", type=float, multiple=True,
    help="WP_RADIUS, m; repeatable.  [default: 1 2 3]",
)  # fmt: skip
@click.option(
    "--angle", "angles", type=float, multiple=True,
    help="Change of course at the corners, degrees; repeatable.  [default: 30 to 180]",
)  # fmt: skip
@click.option(
    "--spacing", "spacings", type=float, multiple=True,
    help="Length of the short legs, m; repeatable.  [default: 3 5 7 10 20]",
)  # fmt: skip
@click.option(
    "--repeats", type=int, default=2, show_default=True,
    help="How often every manoeuvre is sailed to each side.",
)  # fmt: skip
@click.option(
    "--engine", type=click.Choice(ENGINES), default="ardupilot", show_default=True,
    help="Which simulated boats are started for it.",
)  # fmt: skip
@click.option(
    "--boats", type=int, default=2, show_default=True,
    help="Boats that share the courses out among them.",
)  # fmt: skip
@click.option(
    "--speedup", type=float, default=10.0, show_default=True,
    help="Seconds on the water per second.",
)  # fmt: skip
@click.option(
    "--connect", "connections", multiple=True, metavar="LINK",
    help="A boat that is there already, instead of boats that are started; repeatable.",
)  # fmt: skip
@click.option(
    "--arm-vehicles", is_flag=True,
    help="With --connect: yes, arm these boats and let them sail off at once.",
)  # fmt: skip
@click.option(
    "--out", type=click.Path(path_type=Path, dir_okay=False), default=Path("time-table.json"),
    show_default=True, help="The table, for `mrmission plan --time-model`.",
)  # fmt: skip
@click.option("--overwrite", is_flag=True, help="Replace --out.")
@click.option("--add", is_flag=True, help="Keep what --out holds, and sail what it lacks.")
def calibrate(
    *,
    steerings: tuple[str, ...],
    speeds: tuple[float, ...],
    radii: tuple[float, ...],
    angles: tuple[float, ...],
    spacings: tuple[float, ...],
    repeats: int,
    engine: str,
    boats: int,
    speedup: float,
    connections: tuple[str, ...],
    arm_vehicles: bool,
    out: Path,
    overwrite: bool,
    add: bool,
) -> None:
    """Measure what corners and short legs cost a boat, and how wide it swings.

    Boats sail courses of corners between long legs, of turns from lane to lane, and of stairs of
    short legs, at every --speed with every --wp-radius. What each costs over length / speed goes
    into the table --out, from which `mrmission plan --time-model` predicts durations, and onto
    stdout as Markdown.

    Boats are started for it and stopped afterwards. With --connect, boats that are there sail: they
    need the free water that is named first, ahead of their present position, and --arm-vehicles.
    """
    from mrmission.calibrate.courses import ANGLES_DEG, SPACINGS_M
    from mrmission.calibrate.run import Engine, Experiment, run_experiment
    from mrmission.calibrate.table import markdown
    from mrmission.mission.files import write_whole
    from mrmission.tour.time_table import read_table, table_text

    if out.exists() and not (overwrite or add):
        raise ConfigError(
            f"--out {out}: exists already; name another file, or give --overwrite or --add"
        )
    before = read_table(out, whole=False) if add and out.exists() else None
    light = engine == "light" and not connections
    if light and "pivoting" in steerings:
        raise ConfigError(
            "--steering pivoting: the light boats are steered; use --engine ardupilot"
        )
    if connections and len(steerings) != 1:
        raise ConfigError("--connect: say how these boats turn, --steering steered or pivoting")
    if not 1 <= boats <= 20:
        raise ConfigError(f"--boats {boats}: must be between 1 and 20")
    experiment = Experiment(
        steerings=steerings or (("steered",) if light else ("steered", "pivoting")),
        speeds_m_s=tuple(sorted(set(speeds))) or (1.0, 2.0, 3.0, 5.0),
        radii_m=tuple(sorted(set(radii))) or (1.0, 2.0, 3.0),
        repeats=repeats,
        angles_deg=tuple(sorted(set(angles))) or ANGLES_DEG,
        spacings_m=tuple(sorted(set(spacings))) or SPACINGS_M,
    )
    if connections:
        east_m, north_m = experiment.extent_m()
        click.echo(f"the courses need {east_m:.0f} m by {north_m:.0f} m of free water", err=True)
        if not arm_vehicles:
            raise ConfigError(
                "--connect: these boats would be armed and sail off at once, without a fence; "
                "give --arm-vehicles as well if that is what you want"
            )
    table, failed = asyncio.run(
        run_experiment(
            experiment,
            Engine(
                name="connect" if connections else engine,
                boats=boats,
                speedup=speedup,
                connections=connections,
            ),
            command=experiment.command(engine if not connections else "connect"),
            have=before,
            say=lambda line: click.echo(line, err=True),
        )
    )
    write_whole(out, table_text(table), overwrite or add)
    click.echo(markdown(table))
    click.echo(f"table in {out}", err=True)
    if failed:
        raise SimulatorError(
            f"{len(failed)} courses not measured, the first: {failed[0]}; "
            f"run it again with --out {out} --add"
        )

"""``mrmission sim``: a fleet of simulated vehicles, until it is interrupted."""

from __future__ import annotations

import asyncio
import contextlib
import json
import signal
import time
from pathlib import Path
from typing import TYPE_CHECKING

import click
from click.core import ParameterSource

from mrmission.errors import ConfigError
from mrmission.options import VEHICLES

if TYPE_CHECKING:
    from mrmission.simulate import ArdupilotFleet, SimulatedFleet

DEFAULT_HOME_LONLAT = (-81.2500, 34.0600)
"""On Lake Murray, South Carolina: the fleet floats somewhere even if nobody says where."""
USUAL_MODEL = {"boat": "motorboat", "rover": "rover", "copter": "quad"}
"""The model of each vehicle; the light engine has no other."""
LIGHT_ONLY = ("ready_after", "udp_out", "loss", "seed")
ARDUPILOT_ONLY = ("keep", "binary")
REMIND_S = 10.0
"""Seconds after which a vehicle that is not ready yet is said to be waited for, again and again."""


def parse_lonlat(text: str, flag: str = "--home") -> tuple[float, float]:
    """Return ``LON,LAT`` as two numbers, degrees.

    Raises
    ------
    ConfigError
        When `text` is something else.
    """
    try:
        lon, lat = (float(part) for part in text.split(","))
    except ValueError:
        raise ConfigError(f"{flag} {text}: must be LON,LAT in degrees, as in 8.5,47.3") from None
    if not (abs(lon) <= 180 and abs(lat) < 90):
        raise ConfigError(f"{flag} {text}: longitude is -180 to 180, latitude -90 to 90")
    return lon, lat


def parse_parameter(text: str) -> tuple[str, float]:
    """Return ``NAME=VALUE`` as a name and a number.

    Raises
    ------
    ConfigError
        When `text` is something else.
    """
    name, _, value = text.partition("=")
    name = name.strip().upper()
    try:
        number = float(value)
    except ValueError:
        number = float("nan")
    if not name or len(name) > 16 or number != number:
        raise ConfigError(f"--param {text}: must be NAME=VALUE, as in WP_SPEED=3")
    return name, number


@click.command()
@click.option(
    "--engine",
    type=click.Choice(["light", "ardupilot"]),
    default="light",
    show_default=True,
    help="Light boats of our own, or ArduPilot's SITL, one process each.",
)
@click.option(
    "--k", "count", type=int, help="Number of vehicles.  [default: 1, or the robots of --for]"
)
@click.option(
    "--home", metavar="LON,LAT", help="Berth of the first vehicle; the others lie beside it."
)
@click.option(
    "--for",
    "plans",
    type=click.Path(path_type=Path),
    metavar="DIR",
    help="Lie at the homes of the robot-*.plan files that `mrmission plan` left there.",
)
@click.option(
    "--speedup",
    type=float,
    default=1.0,
    show_default=True,
    help="Seconds on the water per second.",
)
@click.option(
    "--base-port",
    type=int,
    default=5760,
    show_default=True,
    help="TCP port of the first vehicle; the next ones are 10 apart; 0 takes free ports.",
)
@click.option(
    "--sysid",
    type=int,
    default=1,
    show_default=True,
    help="MAVLink system id of the first vehicle.",
)
@click.option(
    "--heading", type=float, default=0.0, show_default=True, help="Where the bows point, degrees."
)
@click.option(
    "--vehicle",
    type=click.Choice(VEHICLES),
    help="What sails, drives or flies.  [default: boat, or what --model is]",
)
@click.option(
    "--model",
    help="ardupilot: motorboat, motorboat-skid or pivoting (turn on the spot), rover, quad.  "
    "[default: by --vehicle]",
)
@click.option(
    "--param",
    "params",
    multiple=True,
    metavar="NAME=VALUE",
    help="Set a parameter on every vehicle.",
)
@click.option(
    "--param-file",
    "param_files",
    multiple=True,
    type=click.Path(path_type=Path),
    help="Set the parameters of a .parm file on every vehicle; --param wins over it.",
)
@click.option(
    "--keep",
    type=click.Path(path_type=Path, file_okay=False),
    metavar="DIR",
    help="ardupilot: keep every vehicle's folder there: output, logs, storage.",
)
@click.option(
    "--binary",
    type=click.Path(path_type=Path),
    help="ardupilot: the program.  [default: $ARDUROVER, or ardurover on PATH; copters alike]",
)
@click.option(
    "--ready-after",
    type=float,
    default=0.0,
    show_default=True,
    help="light: seconds on the water until a boat can be armed (real boats: 20 to 45).",
)
@click.option(
    "--udp-out", metavar="HOST:PORT", help="light: send to a ground station there; no TCP servers."
)
@click.option(
    "--loss",
    type=float,
    default=0.0,
    show_default=True,
    help="light: share of messages lost, each way.",
)
@click.option("--seed", type=int, default=0, show_default=True, help="light: seed of the losses.")
@click.option("--json", "as_json", is_flag=True, help="Print the links as JSON on stdout.")
@click.pass_context
def sim(
    ctx: click.Context,
    /,
    engine: str,
    count: int | None,
    home: str | None,
    plans: Path | None,
    speedup: float,
    base_port: int,
    sysid: int,
    heading: float,
    vehicle: str | None,
    model: str | None,
    params: tuple[str, ...],
    param_files: tuple[Path, ...],
    keep: Path | None,
    binary: Path | None,
    ready_after: float,
    udp_out: str | None,
    loss: float,
    seed: int,
    as_json: bool,
) -> None:
    """Run simulated vehicles that take missions and carry them out, until Ctrl-C."""
    from mrmission.simulate import ArdupilotFleet, Faults, SimulatedFleet
    from mrmission.simulate.ardupilot_models import MODELS, read_parameters

    _check_engine(ctx, engine)
    known = MODELS.get(model or "")
    if vehicle is not None and known is not None and known.vehicle != vehicle:
        raise ConfigError(f"--vehicle {vehicle} and --model {model}: that is a {known.vehicle}")
    vehicle = vehicle or (known.vehicle if known is not None else "boat")
    if count is not None and not 1 <= count <= 250:
        raise ConfigError(f"--k {count}: a simulated fleet has 1 to 250 vehicles")
    if not 0 <= loss < 1:
        raise ConfigError(f"--loss {loss}: must be at least 0 and below 1")
    if not 0 <= ready_after < 1e6:
        raise ConfigError(f"--ready-after {ready_after}: must be a number of seconds, 0 or more")
    if plans is not None and home is not None:
        raise ConfigError("--for and --home: choose one")
    starts_lonlat = None if plans is None else _starts(plans, count)
    home_lonlat = DEFAULT_HOME_LONLAT if home is None else parse_lonlat(home)
    parameters: dict[str, float] = {}
    for path in param_files:
        parameters.update(read_parameters(path))
    parameters.update(parse_parameter(text) for text in params)
    if starts_lonlat is not None:
        count = len(starts_lonlat)
    clock = _Berthing()
    fleet: ArdupilotFleet | SimulatedFleet
    if engine == "ardupilot":
        fleet = ArdupilotFleet(
            count=count or 1,
            home_lonlat=home_lonlat,
            starts_lonlat=starts_lonlat,
            model=model or USUAL_MODEL[vehicle],
            binary=binary,
            base_port=base_port,
            first_system_id=sysid,
            speedup=speedup,
            parameters=parameters,
            heading_deg=heading,
            folder=keep,
            progress=clock.step,
        )
    else:
        if model not in (None, USUAL_MODEL[vehicle]):
            raise ConfigError(
                f"--model {model}: the light engine has one {vehicle} alone; --engine ardupilot "
                "has more"
            )
        fleet = SimulatedFleet(
            kind=vehicle,
            count=count or 1,
            home_lonlat=home_lonlat,
            starts_lonlat=starts_lonlat,
            base_port=base_port,
            first_system_id=sysid,
            speedup=speedup,
            parameters=parameters,
            ready_s=ready_after,
            heading_deg=heading,
            faults=Faults(loss=loss, seed=seed) if loss else None,
            udp_out=None if udp_out is None else _parse_address(udp_out),
        )
    if home is None and plans is None:
        click.echo(f"assumed: --home {home_lonlat[0]},{home_lonlat[1]}", err=True)
    asyncio.run(_serve(fleet, clock, as_json=as_json))


def _check_engine(ctx: click.Context, engine: str) -> None:
    """Refuse options that the chosen engine would silently ignore."""
    foreign = LIGHT_ONLY if engine == "ardupilot" else ARDUPILOT_ONLY
    for parameter in ctx.command.params:
        if (
            parameter.name in foreign
            and ctx.get_parameter_source(parameter.name) is not ParameterSource.DEFAULT
        ):
            raise ConfigError(f"{parameter.opts[0]}: --engine {engine} has no such option")


def _starts(folder: Path, count: int | None) -> tuple[tuple[float, float], ...]:
    from mrmission.cli.homes import plan_homes

    homes = plan_homes(folder)
    if count is not None and count != len(homes):
        raise ConfigError(
            f"--k {count}: {folder} has plans for {len(homes)} robots; leave --k out with --for"
        )
    return homes


def _parse_address(text: str) -> tuple[str, int]:
    host, _, port = text.rpartition(":")
    if not host or not port.isdigit() or not 1 <= int(port) <= 65535:
        raise ConfigError(f"--udp-out {text}: must be HOST:PORT, as in 127.0.0.1:14550")
    return host, int(port)


class _Berthing:
    """Says once when a vehicle is ready, and every ten seconds what the others still wait for."""

    def __init__(self) -> None:
        self._since_s = time.monotonic()
        self._steps: dict[int, str] = {}

    def step(self, system_id: int, step: str) -> None:
        self._steps[system_id] = step
        if step == "ready":
            waited_s = time.monotonic() - self._since_s
            click.echo(f"vehicle {system_id:3d}  ready after {waited_s:.0f} s", err=True)

    async def remind(self) -> None:
        while True:
            await asyncio.sleep(REMIND_S)
            for system_id, step in sorted(self._steps.items()):
                if step != "ready":
                    click.echo(f"vehicle {system_id:3d}  waiting: {step}", err=True)


async def _serve(
    fleet: ArdupilotFleet | SimulatedFleet, clock: _Berthing, *, as_json: bool
) -> None:
    stopping = asyncio.Event()
    loop = asyncio.get_running_loop()
    for number in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP):
        loop.add_signal_handler(number, stopping.set)
    life = asyncio.create_task(_live(fleet, clock, as_json=as_json))
    waiting = asyncio.create_task(stopping.wait())
    await asyncio.wait({life, waiting}, return_when=asyncio.FIRST_COMPLETED)
    waiting.cancel()
    life.cancel()
    with contextlib.suppress(asyncio.CancelledError):
        await life
    click.echo("simulated vehicles ended", err=True)


async def _live(fleet: ArdupilotFleet | SimulatedFleet, clock: _Berthing, *, as_json: bool) -> None:
    reminding = asyncio.create_task(clock.remind())
    try:
        async with fleet:
            reminding.cancel()
            links = fleet.links
            vehicles = [
                (system_id, links[min(index, len(links) - 1)], lonlat)
                for index, (system_id, lonlat) in enumerate(
                    zip(fleet.system_ids, fleet.starts_lonlat, strict=True)
                )
            ]
            seconds = getattr(fleet, "second_links", None)
            if as_json:
                rows = [
                    {"system_id": system_id, "link": link, "home_lonlat": list(lonlat)}
                    | ({"second_link": seconds[index]} if seconds else {})
                    for index, (system_id, link, lonlat) in enumerate(vehicles)
                ]
                click.echo(json.dumps({"boats": rows}))
            for index, (system_id, link, (lon, lat)) in enumerate(vehicles):
                second = f"  (second program: {seconds[index]})" if seconds else ""
                click.echo(
                    f"vehicle {system_id:3d}  {link}  at {lon:.7f},{lat:.7f}{second}", err=True
                )
            click.echo("simulated vehicles are afloat; Ctrl-C ends them", err=True)
            await fleet.run()
    finally:
        reminding.cancel()

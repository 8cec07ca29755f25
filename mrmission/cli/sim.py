"""``mrmission sim``: a fleet of simulated boats, until it is interrupted."""

from __future__ import annotations

import asyncio
import json
import signal

import click

from mrmission.errors import ConfigError

DEFAULT_HOME_LONLAT = (-81.2500, 34.0600)
"""On Lake Murray, South Carolina: the fleet floats somewhere even if nobody says where."""


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
@click.option("--k", "count", type=int, default=1, show_default=True, help="Number of boats.")
@click.option(
    "--home", metavar="LON,LAT", help="Berth of the first boat; the others lie beside it."
)
@click.option(
    "--speedup", type=float, default=1.0, show_default=True, help="Seconds on the water per second."
)
@click.option(
    "--base-port",
    type=int,
    default=5760,
    show_default=True,
    help="TCP port of the first boat; the next ones are 10 apart; 0 takes free ports.",
)
@click.option(
    "--sysid", type=int, default=1, show_default=True, help="MAVLink system id of the first boat."
)
@click.option(
    "--heading", type=float, default=0.0, show_default=True, help="Where the bows point, degrees."
)
@click.option(
    "--param", "params", multiple=True, metavar="NAME=VALUE", help="Set a parameter on every boat."
)
@click.option(
    "--ready-after",
    type=float,
    default=0.0,
    show_default=True,
    help="Seconds on the water until a boat can be armed (real boats: 20 to 45).",
)
@click.option(
    "--udp-out", metavar="HOST:PORT", help="Send to a ground station there; no TCP servers."
)
@click.option(
    "--loss", type=float, default=0.0, show_default=True, help="Share of messages lost, each way."
)
@click.option("--seed", type=int, default=0, show_default=True, help="Seed of the losses.")
@click.option("--json", "as_json", is_flag=True, help="Print the links as JSON on stdout.")
def sim(
    count: int,
    home: str | None,
    speedup: float,
    base_port: int,
    sysid: int,
    heading: float,
    params: tuple[str, ...],
    ready_after: float,
    udp_out: str | None,
    loss: float,
    seed: int,
    as_json: bool,
) -> None:
    """Run simulated boats that take missions and sail them, until Ctrl-C."""
    from mrmission.simulate import Faults, SimulatedFleet

    if not 0 <= loss < 1:
        raise ConfigError(f"--loss {loss}: must be at least 0 and below 1")
    if not 0 <= ready_after < 1e6:
        raise ConfigError(f"--ready-after {ready_after}: must be a number of seconds, 0 or more")
    home_lonlat = DEFAULT_HOME_LONLAT if home is None else parse_lonlat(home)
    if home is None:
        click.echo(f"assumed: --home {home_lonlat[0]},{home_lonlat[1]}", err=True)
    fleet = SimulatedFleet(
        count=count,
        home_lonlat=home_lonlat,
        base_port=base_port,
        first_system_id=sysid,
        speedup=speedup,
        parameters=dict(parse_parameter(text) for text in params),
        ready_s=ready_after,
        heading_deg=heading,
        faults=Faults(loss=loss, seed=seed) if loss else None,
        udp_out=None if udp_out is None else _parse_address(udp_out),
    )
    asyncio.run(_serve(fleet, as_json=as_json))


def _parse_address(text: str) -> tuple[str, int]:
    host, _, port = text.rpartition(":")
    if not host or not port.isdigit() or not 1 <= int(port) <= 65535:
        raise ConfigError(f"--udp-out {text}: must be HOST:PORT, as in 127.0.0.1:14550")
    return host, int(port)


async def _serve(fleet: object, *, as_json: bool) -> None:
    from mrmission.simulate import SimulatedFleet

    assert isinstance(fleet, SimulatedFleet)
    stopping = asyncio.Event()
    loop = asyncio.get_running_loop()
    for number in (signal.SIGINT, signal.SIGTERM):
        loop.add_signal_handler(number, stopping.set)
    async with fleet:
        links = fleet.links
        if as_json:
            boats = [
                {
                    "system_id": system_id,
                    "link": links[min(index, len(links) - 1)],
                    "home_lonlat": list(lonlat),
                }
                for index, (system_id, lonlat) in enumerate(
                    zip(fleet.system_ids, fleet.starts_lonlat, strict=True)
                )
            ]
            click.echo(json.dumps({"boats": boats}))
        for index, (system_id, (lon, lat)) in enumerate(
            zip(fleet.system_ids, fleet.starts_lonlat, strict=True)
        ):
            link = links[min(index, len(links) - 1)]
            click.echo(f"boat {system_id:3d}  {link}  at {lon:.7f},{lat:.7f}", err=True)
        click.echo("simulated boats are afloat; Ctrl-C ends them", err=True)
        running = asyncio.ensure_future(fleet.run())
        waiting = asyncio.ensure_future(stopping.wait())
        done, _ = await asyncio.wait({running, waiting}, return_when=asyncio.FIRST_COMPLETED)
        for task in (running, waiting):
            task.cancel()
        if running in done:
            running.result()
    click.echo("simulated boats ended", err=True)

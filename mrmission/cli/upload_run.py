"""An upload from the command line: the table, the record, the exit code."""

from __future__ import annotations

import asyncio
import contextlib
import math
import signal
import sys
from collections.abc import Callable, Coroutine, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeVar

import click

from mrmission.errors import VehicleError
from mrmission.model import Mission
from mrmission.options import VehicleLimits

if TYPE_CHECKING:
    from mrmission.vehicle.capacity import Caps, KnownLimits
    from mrmission.vehicle.framing import Signing
    from mrmission.vehicle.rows import UploadRow, UploadTimeouts

T = TypeVar("T")

TASK_NAME = "robot "
"""How the names of the tasks begin that talk to one vehicle each."""


@dataclass(frozen=True, slots=True, kw_only=True)
class LinkChoice:
    """How vehicles are reached.

    Parameters
    ----------
    connect
        Links; none means the ports of as many SITL instances.
    client, signing
        See `mrmission.vehicle.links.open_links`.
    timeouts
        How long to wait, how often to try; None for the usual.
    """

    connect: tuple[str, ...] = ()
    client: str = "pymavlink"
    signing: Signing | None = None
    timeouts: UploadTimeouts | None = None


def ask_limits(count: int, links: LinkChoice) -> dict[int, KnownLimits]:
    """Return what every vehicle of the fleet holds, by system id.

    Raises
    ------
    VehicleError
        When nobody answers.
    """
    from mrmission.vehicle.upload import ask_limits_of_fleet

    return asyncio.run(
        ask_limits_of_fleet(
            count,
            links.connect,
            timeouts=links.timeouts,
            client=links.client,
            signing=links.signing,
        )
    )


def run_interruptibly(main: Coroutine[Any, Any, T]) -> T:
    """Run a coroutine; Ctrl-C cancels it, a second Ctrl-C its vehicles' tasks once more.

    A cancelled upload puts its vehicles in order, which takes a while; asyncio's own answer to a
    second Ctrl-C is an exception in the middle of whatever runs, and vehicles of which nothing is
    said.

    Raises
    ------
    KeyboardInterrupt
        When it was interrupted.
    """

    async def guarded() -> T:
        loop = asyncio.get_running_loop()
        task = asyncio.ensure_future(main)

        def interrupt() -> None:
            if not task.cancelling():
                task.cancel()
                return
            for one in asyncio.all_tasks():
                if one.get_name().startswith(TASK_NAME):
                    one.cancel()

        # Signals are the main thread's; elsewhere nobody presses Ctrl-C.
        with contextlib.suppress(NotImplementedError, RuntimeError, ValueError):
            loop.add_signal_handler(signal.SIGINT, interrupt)
        return await task

    try:
        return asyncio.run(guarded())
    except asyncio.CancelledError:
        raise KeyboardInterrupt from None


def run_upload(
    missions: Sequence[Mission],
    *,
    links: LinkChoice | None = None,
    simulate: bool = False,
    as_json: bool = False,
    record_folder: Path | None = None,
    caps: Caps | None = None,
    hint: Callable[[int], str] | None = None,
    estimates: Mapping[int, tuple[float, float]] | None = None,
    starts_lonlat: Sequence[tuple[float, float]] | None = None,
    max_distance_m: float | None = None,
    title: str = "Upload",
    sortie: int = 1,
) -> int:
    """Upload missions, print the table, keep the record; return the exit code.

    Parameters
    ----------
    missions
        One or more per robot.
    links
        How vehicles are reached.
    simulate
        Upload to simulated boats that are started for it and stopped afterwards.
    as_json
        Print JSON instead of the table.
    record_folder
        Where ``fleet.json`` and what vehicles held before are kept, if anywhere.
    caps, hint, estimates, max_distance_m
        See :func:`mrmission.vehicle.upload.upload_fleet`.
    starts_lonlat
        Where simulated boats lie; each mission's home where not given.
    title
        Title of the table.
    sortie
        Which sortie is uploaded; robots that do not go out so often get nothing.

    Returns
    -------
    int
        0 when every vehicle was verified, 5 otherwise.
    """
    from mrmission.cli.upload_table import upload_json, upload_progress, upload_table
    from mrmission.vehicle.assign import sorties_numbered
    from mrmission.vehicle.capacity import Caps
    from mrmission.vehicle.job import FolderKeeper
    from mrmission.vehicle.place import DEFAULT_MAX_DISTANCE_M

    links = links or LinkChoice()
    caps = caps or Caps()
    first = sorties_numbered(missions, sortie)
    # Simulated boats are gone when this ends; a record of them would mislead the real upload.
    keeper = None
    if record_folder is not None and not simulate:
        keeper = FolderKeeper(record_folder, {m.robot: m.sortie for m in first})
    left_out = sorted({m.robot for m in missions} - {m.robot for m in first})
    if left_out:
        names = ", ".join(map(str, left_out))
        click.echo(f"no sortie {sortie} for robot {names}: left as they are", err=True)
    limits: dict[int, KnownLimits] = {}
    with upload_progress([mission.robot for mission in first]) as progress:
        rows = run_interruptibly(
            _upload(
                missions,
                connect=links.connect,
                simulated=_fleet(first, starts_lonlat, caps) if simulate else None,
                progress=progress,
                caps=caps,
                hint=hint,
                assignment=keeper.pairs if keeper is not None else {},
                estimates=estimates,
                timeouts=links.timeouts,
                keeper=keeper,
                max_distance_m=(
                    DEFAULT_MAX_DISTANCE_M if max_distance_m is None else max_distance_m
                ),
                client=links.client,
                signing=links.signing,
                on_limits=limits.update,
                sortie=sortie,
            )
        )
    if as_json:
        sys.stdout.write(upload_json(rows, limits, simulated=simulate))
    else:
        _show(rows, limits, upload_table(rows, title + (" to simulated boats" * simulate)))
    return 0 if all(row.verified for row in rows) else VehicleError.exit_code


def _show(rows: Sequence[UploadRow], limits: Mapping[int, KnownLimits], table: Any) -> None:
    from rich.console import Console

    from mrmission.vehicle.capacity import smallest

    console = Console() if sys.stdout.isatty() else Console(width=200)
    console.print(table)
    click.echo(f"each vehicle holds at least {smallest(list(limits.values()))}", err=True)
    verified = sum(row.verified for row in rows)
    text = f"{verified} of {len(rows)} vehicles verified; nothing was armed"
    if verified < len(rows):
        text += "; the same command completes the rest"
    click.echo(text, err=True)


async def _upload(
    missions: Sequence[Mission], *, connect: Sequence[str], simulated: Any, **options: Any
) -> list[UploadRow]:
    from mrmission.vehicle.upload import upload_fleet

    if simulated is None:
        return await upload_fleet(missions, connect, **options)
    async with simulated as fleet:
        return await upload_fleet(missions, fleet.links, **options)


def _fleet(
    missions: Sequence[Mission], starts_lonlat: Sequence[tuple[float, float]] | None, caps: Caps
) -> Any:
    """Return a simulated fleet at the missions' homes, with the memory that was planned for."""
    from mrmission.simulate import SimulatedFleet
    from mrmission.vehicle.place import home_lonlat

    starts = list(starts_lonlat or ())
    if len(starts) != len(missions):
        starts = [home_lonlat(mission) or (0.0, 0.0) for mission in missions]
    kind = missions[0].vehicle if missions else "boat"
    standard = VehicleLimits.of(kind)
    parameters: dict[str, float] = {}
    if (caps.mission_items or 0) > standard.mission_items:
        parameters["BRD_SD_MISSION"] = math.ceil(((caps.mission_items or 0) * 15 + 4) / 1024)
    if (caps.fence_bytes or 0) > standard.fence_bytes:
        parameters["BRD_SD_FENCE"] = math.ceil(((caps.fence_bytes or 0) + 5) / 1024)
    return SimulatedFleet(
        count=len(missions),
        starts_lonlat=starts,
        base_port=0,
        parameters=parameters,
        kind=kind,
    )

"""Missions, fences and rally points into a fleet, in parallel, read back and compared.

What is promised for every vehicle, whatever happens to it or to the others:

* An armed vehicle is not touched: one in AUTO would steer for the new mission at once. Nor is one
  that lies far from where its mission starts.
* What it holds is read first, and kept. Then the old mission is cleared; then go the fence, the
  rally points, and the mission last. So at no time does a vehicle hold an old mission with a new
  fence, or a mixture of two missions.
* When anything fails after the first byte, the old content is put back and verified; where that
  does not succeed, all three stores are cleared; and the row says which, or that the vehicle does
  not answer and what it stores is unknown.
* What is stored is read back and compared item by item before a row says verified.
* What a vehicle already stores is not sent again, so a second run completes the rest.
* Nothing is armed and no mode is changed.

The parts: `assign` (who gets what), `capacity` (does it fit), `job` (one vehicle), `retry`,
`saved` (what it held before), `record` (``fleet.json``), `place` (is it where it should be).
"""

from __future__ import annotations

import asyncio
import contextlib
from collections.abc import AsyncIterator, Callable, Mapping, Sequence
from typing import TYPE_CHECKING

from mrmission.errors import VehicleError
from mrmission.model import Mission
from mrmission.vehicle.assign import assign, sorties_numbered
from mrmission.vehicle.capacity import (
    Caps,
    KnownLimits,
    ask_fleet,
    capped,
    check_capacity,
    default_limits,
)
from mrmission.vehicle.connection import Connection, default_connections, parse_connections
from mrmission.vehicle.job import Job, JobOptions, Keeper
from mrmission.vehicle.links import FleetLinks, StoreVehicle, open_links
from mrmission.vehicle.place import DEFAULT_MAX_DISTANCE_M
from mrmission.vehicle.rows import (
    Holds,
    ProgressCallback,
    UploadProgress,
    UploadRow,
    UploadStatus,
    UploadTimeouts,
)

if TYPE_CHECKING:
    from mrmission.vehicle.framing import Signing

__all__ = [
    "Holds",
    "ProgressCallback",
    "UploadProgress",
    "UploadRow",
    "UploadStatus",
    "UploadTimeouts",
    "ask_limits_of_fleet",
    "upload_fleet",
]


async def upload_fleet(
    missions: Sequence[Mission],
    connections: Sequence[str] = (),
    *,
    progress: ProgressCallback | None = None,
    timeouts: UploadTimeouts | None = None,
    caps: Caps | None = None,
    hint: Callable[[int], str] | None = None,
    assignment: Mapping[int, int] | None = None,
    estimates: Mapping[int, tuple[float, float]] | None = None,
    keeper: Keeper | None = None,
    max_distance_m: float = DEFAULT_MAX_DISTANCE_M,
    client: str = "pymavlink",
    signing: Signing | None = None,
    on_limits: Callable[[Mapping[int, KnownLimits]], None] | None = None,
    sortie: int = 1,
) -> list[UploadRow]:
    """Upload every robot's mission to its vehicle, all in parallel, and verify it.

    Parameters
    ----------
    missions
        One per robot and sortie.
    connections
        Links as after ``--connect``; none means the loopback ports of as many SITL instances.
    progress
        Called in the event loop at every step of every vehicle.
    timeouts
        How long to wait, how often to try.
    caps
        Limits of the user's own, which count where they are smaller than a vehicle's.
    hint
        Given the number of items that a vehicle holds, returns what to do when a mission needs
        more (which swath, which k).
    assignment
        Robot to system id, as an earlier run had it (see :func:`assign`).
    estimates
        Robot to (length_m, duration_s) for the rows; without, they are taken from the items.
    keeper
        Who keeps the record, and what vehicles held before; without, that is kept in memory.
    max_distance_m
        A vehicle farther than this from its mission's home gets nothing.
    client, signing
        See `mrmission.vehicle.links.open_links`.
    on_limits
        Called with what each robot's vehicle holds, once it is known.
    sortie
        Which sortie is uploaded; robots that do not go out so often get nothing.

    Returns
    -------
    list of UploadRow
        One per robot, by robot number. No vehicle's trouble is raised; it is in its row.

    Raises
    ------
    ConfigError
        When a connection cannot be read, or no robot has such a sortie.
    VehicleError
        When nothing answers at all, or two vehicles have one system id. Nothing was sent.
    UploadError
        When a mission does not fit its vehicle. Nothing was sent.
    """
    timeouts = timeouts or UploadTimeouts()
    first = sorties_numbered(missions, sortie)
    async with _answering(len(first), connections, timeouts, client, signing) as fleet:
        given = assign([m.robot for m in first], list(fleet.vehicles), assignment)
        known = await _limits_by_robot(first, given, fleet.vehicles, caps or Caps())
        if on_limits is not None:
            on_limits(known)
        check_capacity(first, known, hint)
        options = JobOptions(
            timeouts=timeouts, progress=progress, keeper=keeper, max_distance_m=max_distance_m
        )
        jobs = [
            Job(
                mission=mission,
                vehicle=fleet.vehicles.get(given.get(mission.robot, -1)),
                sorties=sum(m.robot == mission.robot for m in missions),
                options=options,
                estimate=(estimates or {}).get(mission.robot),
            )
            for mission in first
        ]
        silent = tried_text(fleet.silent)
        async with asyncio.TaskGroup() as group:
            tasks = [
                group.create_task(job.run(silent), name=f"robot {job.mission.robot}")
                for job in jobs
            ]
        return [task.result() for task in tasks]


async def ask_limits_of_fleet(
    count: int,
    connections: Sequence[str] = (),
    *,
    timeouts: UploadTimeouts | None = None,
    client: str = "pymavlink",
    signing: Signing | None = None,
) -> dict[int, KnownLimits]:
    """Ask every vehicle of a fleet what it holds, before anything is planned for it.

    Parameters
    ----------
    count
        How many robots are to be planned for.
    connections, timeouts, client, signing
        As for :func:`upload_fleet`.

    Returns
    -------
    dict
        System id to limits.

    Raises
    ------
    ConfigError
        When a connection cannot be read.
    VehicleError
        When nothing answers at all, or two vehicles have one system id.
    """
    timeouts = timeouts or UploadTimeouts()
    async with _answering(count, connections, timeouts, client, signing) as fleet:
        return await ask_fleet(list(fleet.vehicles.values()))


@contextlib.asynccontextmanager
async def _answering(
    count: int,
    connections: Sequence[str],
    timeouts: UploadTimeouts,
    client: str,
    signing: Signing | None,
) -> AsyncIterator[FleetLinks[StoreVehicle]]:
    """Open the links to `count` vehicles; refuse to go on with nobody."""
    links = parse_connections(connections) or default_connections(count)
    async with open_links(
        links,
        expected=count,
        timeouts=timeouts.link,
        patient=bool(connections),
        client=client,
        signing=signing,
    ) as fleet:
        _somebody(links, fleet, named=bool(connections))
        yield fleet


async def _limits_by_robot(
    missions: Sequence[Mission],
    given: Mapping[int, int],
    vehicles: Mapping[int, StoreVehicle],
    caps: Caps,
) -> dict[int, KnownLimits]:
    """Return what each robot's vehicle holds, as far as anybody says."""
    told = await ask_fleet([vehicles[system_id] for system_id in given.values()])
    # A vehicle that is not there yet will have to hold its mission too, one day: as much, at best,
    # as the largest of the others.
    largest = max(told.values(), key=lambda k: k.mission_items.value, default=default_limits())
    return {m.robot: capped(told.get(given.get(m.robot, -1), largest), caps) for m in missions}


def _somebody(links: Sequence[Connection], fleet: FleetLinks[StoreVehicle], *, named: bool) -> None:
    """Refuse to go on with nobody."""
    if fleet.vehicles:
        return
    tried = tried_text({link.url: fleet.silent.get(link.url, "silent") for link in links})
    advice = (
        "start the vehicles, or rehearse with --simulate"
        if named
        else "start ArduPilot SITL there, name your vehicles with --connect, or rehearse with "
        "--simulate"
    )
    raise VehicleError(f"no vehicle answers ({tried}): {advice}")


def tried_text(silent: Mapping[str, str]) -> str:
    """Return links that stay silent, those of one reason together."""
    reasons: dict[str, list[str]] = {}
    for url, why in silent.items():
        reasons.setdefault(why, []).append(url)
    return "; ".join(
        f"{', '.join(urls[:8])}{f' and {len(urls) - 8} more' if len(urls) > 8 else ''} {why}"
        for why, urls in reasons.items()
    )

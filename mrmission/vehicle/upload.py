"""Missions, fences and rally points into a fleet, in parallel, read back and compared.

What is promised for every vehicle, whatever happens to it or to the others:

* An armed vehicle is not touched: one in AUTO would steer for the new mission at once.
* The old mission is cleared first; then go the fence, the rally points, and the mission last. So
  at no time does a vehicle hold an old mission with a new fence, or a mixture of two missions.
* When anything fails after the first byte, all three stores are cleared, and the row says whether
  the vehicle confirmed that it is empty.
* What is stored is read back and compared item by item before a row says verified.
* What a vehicle already stores is not sent again, so a second run completes the rest.
* Nothing is armed and no mode is changed.
"""

from __future__ import annotations

import asyncio
import enum
import math
from collections.abc import Awaitable, Callable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import partial
from typing import TypeVar

from mrmission.errors import (
    LinkTimeoutError,
    ReadbackMismatchError,
    UploadError,
    VehicleError,
)
from mrmission.model import Mission
from mrmission.options import VehicleLimits
from mrmission.vehicle.connection import (
    Connection,
    default_connections,
    parse_connections,
)
from mrmission.vehicle.items import MissionType, RawItem, to_raw
from mrmission.vehicle.link import LinkTimeouts, TransferError, Vehicle, open_links
from mrmission.vehicle.readback import compare_items

ORDER = (MissionType.FENCE, MissionType.RALLY, MissionType.MISSION)
"""The order of sending: the mission last."""

_T = TypeVar("_T")
_NAV_WAYPOINT = 16
_DO_CHANGE_SPEED = 178
_PASSING = {"TIMEOUT", "BUSY", "ERROR", "TRANSFER_CANCELLED", "DENIED", "INVALID_SEQUENCE"}
"""MAVSDK results that a later try may turn: loss on the link, or a transfer still held open."""
_LINK_TROUBLE = {"TIMEOUT", "BUSY", "TRANSFER_CANCELLED"}
"""MAVSDK results that are nobody's refusal."""


class UploadStatus(enum.StrEnum):
    """How an upload to one vehicle ended."""

    VERIFIED = "verified"
    UNCHANGED = "already stored"
    ABSENT = "absent"
    REFUSED = "refused"
    FAILED = "failed"
    MISMATCH = "stored differently"
    CANCELLED = "cancelled"


@dataclass(frozen=True, slots=True, kw_only=True)
class UploadRow:
    """What became of one robot's mission."""

    robot: int
    system_id: int | None
    link: str
    items: int
    fence_items: int
    rally_points: int
    length_m: float
    duration_s: float | None
    status: UploadStatus
    detail: str
    verified: bool
    attempts: int
    elapsed_s: float


@dataclass(frozen=True, slots=True, kw_only=True)
class UploadProgress:
    """A step of one vehicle; ``fraction`` runs from 0 to 1 over all that it gets."""

    robot: int
    system_id: int
    stage: str
    fraction: float


@dataclass(frozen=True, slots=True, kw_only=True)
class UploadTimeouts:
    """Waiting and trying again, on top of MAVSDK's own five repetitions per packet.

    After an aborted transfer a vehicle holds it open for 8 s, and straight after discovery it may
    refuse with TOO_MANY_MISSION_ITEMS what it accepts 4 s later; the pauses span both.
    """

    link: LinkTimeouts = field(default_factory=LinkTimeouts)
    pauses_s: tuple[float, ...] = (0.5, 4.0, 8.5)
    too_many_pause_s: float = 4.0
    cleanup_s: float = 15.0


READINGS = 3
"""How often a vehicle is read before a difference counts as what it stores."""

ProgressCallback = Callable[[UploadProgress], None]


async def upload_fleet(
    missions: Sequence[Mission],
    connections: Sequence[str] = (),
    *,
    progress: ProgressCallback | None = None,
    timeouts: UploadTimeouts | None = None,
    limits: VehicleLimits | None = None,
    hint: Callable[[int], str] | None = None,
    assignment: Mapping[int, int] | None = None,
    estimates: Mapping[int, tuple[float, float]] | None = None,
) -> list[UploadRow]:
    """Upload every robot's mission to its vehicle, all in parallel, and verify it.

    Parameters
    ----------
    missions
        One per robot; of a robot with several sorties, the first is uploaded.
    connections
        Links as after ``--connect``; none means the loopback ports of as many SITL instances.
    progress
        Called in the event loop at every step of every vehicle.
    timeouts
        How long to wait, how often to try.
    limits
        What a vehicle without an SD card holds; one that reports a card holds more.
    hint
        Given the number of items that a vehicle holds, returns what to do when a mission needs
        more (which swath, which k).
    assignment
        Robot to system id, as an earlier run had it (see :func:`assign`).
    estimates
        Robot to (length_m, duration_s) for the rows; without, they are taken from the items.

    Returns
    -------
    list of UploadRow
        One per robot, by robot number. No vehicle's trouble is raised; it is in its row.

    Raises
    ------
    ConfigError
        When a connection cannot be read.
    VehicleError
        When nothing answers at all, or two vehicles have one system id. Nothing was sent.
    UploadError
        When a mission does not fit its vehicle. Nothing was sent.
    """
    timeouts = timeouts or UploadTimeouts()
    limits = limits or VehicleLimits()
    first = first_sorties(missions)
    links = parse_connections(connections) or default_connections(len(first))
    async with open_links(
        links, expected=len(first), timeouts=timeouts.link, patient=bool(connections)
    ) as fleet:
        if not fleet.vehicles:
            raise _nobody(links, fleet.silent, named=bool(connections))
        given = assign([m.robot for m in first], list(fleet.vehicles), assignment)
        await _check_all_capacities(first, given, fleet.vehicles, limits, hint)
        jobs = [
            _Job(
                mission=mission,
                vehicle=fleet.vehicles.get(given.get(mission.robot, -1)),
                sorties=sum(m.robot == mission.robot for m in missions),
                timeouts=timeouts,
                progress=progress,
                estimate=(estimates or {}).get(mission.robot),
            )
            for mission in first
        ]
        async with asyncio.TaskGroup() as group:
            tasks = [
                group.create_task(job.run(fleet.silent), name=f"robot {job.mission.robot}")
                for job in jobs
            ]
        return [task.result() for task in tasks]


def first_sorties(missions: Sequence[Mission]) -> list[Mission]:
    """Return each robot's first sortie, by robot number."""
    out: dict[int, Mission] = {}
    for mission in missions:
        if mission.robot not in out or mission.sortie < out[mission.robot].sortie:
            out[mission.robot] = mission
    return [out[robot] for robot in sorted(out)]


def assign(
    robots: Sequence[int], system_ids: Sequence[int], previous: Mapping[int, int] | None = None
) -> dict[int, int]:
    """Say which vehicle gets which robot's tour; never depends on the order of discovery.

    A pair of an earlier run stays together while its vehicle is there, so that a second run
    completes the first. Where every system id is a robot's number, robot r is vehicle r, and the
    one that is missing is missed under its own number. Otherwise the robots, ascending, get the
    vehicles, ascending.

    Parameters
    ----------
    robots, system_ids
        Who is to be paired; in any order.
    previous
        Robot to system id of an earlier run.

    Returns
    -------
    dict
        Robot to system id; a robot without a vehicle is left out.

    Examples
    --------
    >>> assign([1, 2, 3], [23, 21, 22])
    {1: 21, 2: 22, 3: 23}
    >>> assign([1, 2, 3], [1, 3])
    {1: 1, 3: 3}
    >>> assign([1, 2, 3], [21, 22, 23], {1: 21, 2: 23})
    {1: 21, 2: 23, 3: 22}
    """
    out = {
        robot: system_id
        for robot, system_id in sorted((previous or {}).items())
        if robot in robots and system_id in system_ids
    }
    free_robots = sorted(set(robots) - set(out))
    free_ids = sorted(set(system_ids) - set(out.values()))
    if set(free_ids) <= set(free_robots):
        out.update({system_id: system_id for system_id in free_ids})
    else:
        out.update(zip(free_robots, free_ids, strict=False))
    return dict(sorted(out.items()))


def check_capacity(
    missions: Sequence[Mission],
    limits: VehicleLimits | Mapping[int, VehicleLimits],
    hint: Callable[[int], str] | str | None = None,
) -> None:
    """Refuse missions, fences and rally points that a vehicle cannot hold.

    Parameters
    ----------
    missions
        What is to be uploaded.
    limits
        The same for all, or by robot.
    hint
        What to do about it: text, or a function from the number of items that fit to text.

    Raises
    ------
    UploadError
        Naming the robot, the number and the limit.
    """
    tightest: tuple[int, str, VehicleLimits] | None = None
    for mission in missions:
        limit = limits if isinstance(limits, VehicleLimits) else limits.get(mission.robot)
        if limit is None:
            continue
        raw = to_raw(mission)
        over = len(raw[MissionType.MISSION]) - limit.mission_items
        if over > 0 and (tightest is None or over > tightest[0]):
            text = (
                f"robot {mission.robot}: its mission has {len(raw[MissionType.MISSION])} items, "
                f"and the vehicle holds {limit.mission_items}"
            )
            tightest = (over, text, limit)
        fence_bytes = sum(limit.fence_bytes_of(len(p.points_e7)) for p in mission.fence)
        largest = max((len(p.points_e7) for p in mission.fence), default=0)
        if fence_bytes > limit.fence_bytes:
            raise UploadError(
                f"robot {mission.robot}: its fence takes {fence_bytes} bytes, and the vehicle "
                f"holds {limit.fence_bytes}; nothing was sent; plan with --no-fence or a larger "
                "fence storage"
            )
        if largest > limit.fence_polygon_points:
            raise UploadError(
                f"robot {mission.robot}: a fence polygon has {largest} points, and the vehicle "
                f"holds {limit.fence_polygon_points} in one; nothing was sent"
            )
        if len(mission.rally) > limit.rally_points:
            raise UploadError(
                f"robot {mission.robot}: {len(mission.rally)} rally points, and the vehicle holds "
                f"{limit.rally_points}; nothing was sent"
            )
    if tightest is not None:
        _, text, limit = tightest
        advice = hint(limit.mission_items) if callable(hint) else hint
        raise UploadError(
            f"{text}; nothing was sent; {advice or 'take a wider --swath or a larger --k'}"
        )


async def _check_all_capacities(
    missions: Sequence[Mission],
    given: Mapping[int, int],
    vehicles: Mapping[int, Vehicle],
    default: VehicleLimits,
    hint: Callable[[int], str] | None,
) -> None:
    """Compare every mission with its own vehicle's memory before anybody gets a byte.

    Vehicles are asked for their storage only where a mission would not fit the default.
    """
    try:
        check_capacity(missions, default)
    except UploadError:
        pairs = [(m.robot, vehicles[given[m.robot]]) for m in missions if m.robot in given]
        told = await asyncio.gather(*(vehicle.limits(default) for _, vehicle in pairs))
        limits = {robot: limit for (robot, _), limit in zip(pairs, told, strict=True)}
        # A vehicle that is not there yet will have to hold its mission too, one day.
        largest = max(told, key=lambda limit: limit.mission_items, default=default)
        limits.update({m.robot: largest for m in missions if m.robot not in limits})
        check_capacity(missions, limits, hint)


def _nobody(links: Sequence[Connection], silent: Mapping[str, str], *, named: bool) -> VehicleError:
    tried = _tried({link.url: silent.get(link.url, "silent") for link in links})
    advice = (
        "start the vehicles, or rehearse with --simulate"
        if named
        else "start ArduPilot SITL there, name your vehicles with --connect, or rehearse with "
        "--simulate"
    )
    return VehicleError(f"no vehicle answers ({tried}): {advice}")


def _tried(silent: Mapping[str, str]) -> str:
    """Return links that stay silent, those of one reason together."""
    reasons: dict[str, list[str]] = {}
    for url, why in silent.items():
        reasons.setdefault(why, []).append(url)
    return "; ".join(
        f"{', '.join(urls[:8])}{f' and {len(urls) - 8} more' if len(urls) > 8 else ''} {why}"
        for why, urls in reasons.items()
    )


def path_length_m(mission: Mission) -> float:
    """Return the length of a mission's way from home through its waypoints, metres."""
    import pyproj

    points = [i for n, i in enumerate(mission.items) if n == 0 or i.command == _NAV_WAYPOINT]
    if len(points) < 2:
        return 0.0
    geod = pyproj.Geod(ellps="WGS84")
    return float(geod.line_length([p.y / 1e7 for p in points], [p.x / 1e7 for p in points]))


def _own_estimate(mission: Mission) -> tuple[float, float | None]:
    length_m = path_length_m(mission)
    speeds = [i.param2 for i in mission.items if i.command == _DO_CHANGE_SPEED and i.param2 > 0]
    return length_m, (length_m / speeds[0] if speeds else None)


@dataclass(slots=True)
class _Job:
    """One robot's upload, from first look to verdict."""

    mission: Mission
    vehicle: Vehicle | None
    sorties: int
    timeouts: UploadTimeouts
    progress: ProgressCallback | None
    estimate: tuple[float, float] | None
    attempts: int = 0
    touched: bool = False
    raw: dict[MissionType, tuple[RawItem, ...]] = field(default_factory=dict)

    async def run(self, silent: Mapping[str, str]) -> UploadRow:
        """Return the row; raise nothing but a cancellation."""
        loop = asyncio.get_running_loop()
        began_s = loop.time()
        self.raw = to_raw(self.mission)
        status, detail = await self._outcome(silent)
        if self.sorties > 1:
            note = f"sortie {self.mission.sortie} of {self.sorties}"
            detail = f"{note}; {detail}" if detail else note
        length_m, duration_s = self.estimate or _own_estimate(self.mission)
        if duration_s is not None and not math.isfinite(duration_s):
            duration_s = None
        return UploadRow(
            robot=self.mission.robot,
            system_id=self.vehicle.system_id if self.vehicle else None,
            link=self.vehicle.connection.url if self.vehicle else "",
            items=len(self.raw[MissionType.MISSION]),
            fence_items=len(self.raw[MissionType.FENCE]),
            rally_points=len(self.raw[MissionType.RALLY]),
            length_m=length_m,
            duration_s=duration_s,
            status=status,
            detail=detail,
            verified=status in (UploadStatus.VERIFIED, UploadStatus.UNCHANGED),
            attempts=self.attempts,
            elapsed_s=loop.time() - began_s,
        )

    async def _outcome(self, silent: Mapping[str, str]) -> tuple[UploadStatus, str]:
        vehicle = self.vehicle
        if vehicle is None:
            where = _tried(silent)
            return UploadStatus.ABSENT, (
                "no vehicle for it" + (f": {where}" if where else "") + "; start it and run again"
            )
        try:
            await vehicle.wait_heartbeat()
            self._refuse_armed(vehicle)
            missing = await self._missing(vehicle)
            if not missing:
                self._tell(vehicle, "verified", 1.0)
                return UploadStatus.UNCHANGED, "nothing sent"
            await self._send_and_verify(vehicle, missing)
        except asyncio.CancelledError:
            left = await self._leave_clean(vehicle)
            self._tell(vehicle, f"cancelled, {left}", 1.0)
            raise
        except _ArmedError as error:
            left = await self._leave_clean(vehicle)
            return UploadStatus.REFUSED, f"{error}; {left}"
        except ReadbackMismatchError as error:
            left = await self._leave_clean(vehicle)
            return UploadStatus.MISMATCH, f"{error}; {left}"
        except VehicleError as error:
            left = await self._leave_clean(vehicle)
            refused = isinstance(error, TransferError) and error.result not in _LINK_TROUBLE
            status = UploadStatus.REFUSED if refused else UploadStatus.FAILED
            return status, f"{error}; {left}"
        self._tell(vehicle, "verified", 1.0)
        return UploadStatus.VERIFIED, ""

    # --- steps -----------------------------------------------------------------------------------

    def _refuse_armed(self, vehicle: Vehicle) -> None:
        if vehicle.armed:
            raise _ArmedError(f"armed, in {vehicle.mode}: disarm it and run again")

    async def _missing(self, vehicle: Vehicle) -> list[MissionType]:
        """Return the stores that do not hold yet what they are to hold."""
        missing: list[MissionType] = []
        for kind in ORDER:
            self._tell(vehicle, "looking", 0.0)
            wanted = self.raw[kind]
            stored = await vehicle.stored_count(kind)
            home_only = kind is MissionType.MISSION and not wanted and stored <= 1
            if home_only or (stored == 0 and not wanted):
                continue
            # The count is one packet; only where it agrees are the items worth reading.
            if stored != len(wanted) or compare_items(
                wanted, await self._trying(vehicle, partial(vehicle.download, kind)), kind
            ):
                missing.append(kind)
        return missing

    async def _send_and_verify(self, vehicle: Vehicle, missing: Sequence[MissionType]) -> None:
        kinds = [k for k in ORDER if k in missing or k is MissionType.MISSION]
        total = 2 * sum(len(self.raw[kind]) for kind in kinds) or 1
        done = 0
        self._refuse_armed(vehicle)
        self.touched = True
        self.attempts += 1
        # Whatever breaks from here on, no vehicle is left with an old mission in a new fence.
        await self._trying(vehicle, partial(vehicle.clear, MissionType.MISSION))
        for kind in kinds:
            items = self.raw[kind]
            step = partial(self._sending, vehicle, kind, done / total, len(items) / total)
            step(0.0)
            self._refuse_armed(vehicle)
            if items:
                await self._trying(
                    vehicle, partial(vehicle.upload, kind, items, step), count=len(items)
                )
            elif kind is not MissionType.MISSION:
                await self._trying(vehicle, partial(vehicle.clear, kind))
            done += len(items)
        for kind in kinds:
            items = self.raw[kind]
            self._tell(vehicle, f"reading {kind.label}", done / total)
            await self._verify(vehicle, kind, items)
            done += len(items)

    async def _verify(self, vehicle: Vehicle, kind: MissionType, items: Sequence[RawItem]) -> None:
        if items:
            # A link that repeats packets can garble a reading; what a vehicle does store wrongly
            # it shows again. Only a whole reading that matches counts as verified.
            for _ in range(READINGS):
                stored = await self._trying(vehicle, partial(vehicle.download, kind))
                wrong = compare_items(items, stored, kind)
                if not wrong:
                    break
            if wrong:
                more = f" and {len(wrong) - 1} more" if len(wrong) > 1 else ""
                raise ReadbackMismatchError(f"{wrong[0]}{more}")
            return
        count = await vehicle.stored_count(kind)
        if count > (1 if kind is MissionType.MISSION else 0):
            raise ReadbackMismatchError(f"{kind.label}: 0 items sent, {count} stored")

    def _sending(
        self, vehicle: Vehicle, kind: MissionType, start: float, share: float, part: float
    ) -> None:
        self._tell(vehicle, f"sending {kind.label}", start + share * part)

    async def _trying(
        self, vehicle: Vehicle, operation: Callable[[], Awaitable[_T]], *, count: int = 0
    ) -> _T:
        """Run an operation, again after a pause where that may help, a bounded number of times."""
        pauses = list(self.timeouts.pauses_s)
        excused = False
        while True:
            vehicle.forget_status_texts()
            try:
                return await operation()
            except TransferError as error:
                if error.result == "TOO_MANY_MISSION_ITEMS":
                    holds = items_supported(vehicle.status_texts())
                    # Without its number, a vehicle that has only just woken up may say this of
                    # any mission, and takes the same one a little later.
                    if excused or (holds is not None and holds < count):
                        raise _too_many(vehicle, count, holds) from error
                    excused = True
                    self.attempts += 1
                    await asyncio.sleep(self.timeouts.too_many_pause_s)
                    continue
                if error.result not in _PASSING or not pauses or vehicle.silent:
                    raise _with_texts(error, vehicle) from error
            except LinkTimeoutError:
                if not pauses or vehicle.silent:
                    raise
            self.attempts += 1
            await asyncio.sleep(pauses.pop(0))
            self._refuse_armed(vehicle)

    async def _leave_clean(self, vehicle: Vehicle) -> str:
        """Empty a vehicle that was written to, and say what it holds now."""
        if not self.touched:
            return "vehicle untouched"
        self._tell(vehicle, "clearing", 1.0)
        try:
            async with asyncio.timeout(self.timeouts.cleanup_s):
                while not await self._emptied(vehicle):
                    await asyncio.sleep(1.0)
        except (TimeoutError, VehicleError):
            return (
                "and it did not confirm that it is empty: do not start it before another upload "
                "was verified"
            )
        return "vehicle left empty (mission, fence and rally points cleared)"

    async def _emptied(self, vehicle: Vehicle) -> bool:
        try:
            for kind in (MissionType.MISSION, MissionType.FENCE, MissionType.RALLY):
                await vehicle.clear(kind)
                if await vehicle.stored_count(kind) > (1 if kind is MissionType.MISSION else 0):
                    return False
        except VehicleError:
            # A transfer that broke off is held open for a while, and clearing refused as long.
            if vehicle.silent:
                raise
            return False
        return True

    def _tell(self, vehicle: Vehicle, stage: str, fraction: float) -> None:
        if self.progress is not None:
            self.progress(
                UploadProgress(
                    robot=self.mission.robot,
                    system_id=vehicle.system_id,
                    stage=stage,
                    fraction=fraction,
                )
            )


class _ArmedError(VehicleError):
    """The vehicle is armed, or became armed on the way."""


def items_supported(texts: Sequence[str]) -> int | None:
    """Return N of an autopilot's status text "Only N items are supported", if it said that.

    Examples
    --------
    >>> items_supported(["EKF3 active", "Only 655 items are supported"])
    655
    """
    for text in reversed(texts):
        words = text.split()
        if words[:1] == ["Only"] and words[2:4] == ["items", "are"] and words[1].isdigit():
            return int(words[1])
    return None


def _too_many(vehicle: Vehicle, count: int, holds: int | None) -> TransferError:
    says = f"holds {holds}" if holds is not None else "refuses that many"
    return TransferError(
        f"vehicle {vehicle.system_id} on {vehicle.connection.url}: {count} items sent, and it "
        f"{says} (TOO_MANY_MISSION_ITEMS); take a wider --swath or a larger --k",
        result="TOO_MANY_MISSION_ITEMS",
    )


def _with_texts(error: TransferError, vehicle: Vehicle) -> TransferError:
    texts = vehicle.status_texts()
    if not texts:
        return error
    return TransferError(f'{error} (it says: "{texts[-1]}")', result=error.result)

"""One vehicle's upload, from the first look to the verdict, whatever happens on the way."""

from __future__ import annotations

import asyncio
import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path
from typing import Protocol

from mrmission.errors import MrMissionError, ReadbackMismatchError, VehicleError
from mrmission.mission import mavlink
from mrmission.model import Mission
from mrmission.options import PlanOptions
from mrmission.vehicle.items import MissionType, RawItem, to_raw
from mrmission.vehicle.links import StoreVehicle, TransferError
from mrmission.vehicle.place import DEFAULT_MAX_DISTANCE_M, distance_from_home_m
from mrmission.vehicle.readback import compare_items
from mrmission.vehicle.record import FleetFile, record_of
from mrmission.vehicle.retry import LINK_TROUBLE, Tries, returned
from mrmission.vehicle.rows import (
    Holds,
    ProgressCallback,
    UploadProgress,
    UploadRow,
    UploadStatus,
    UploadTimeouts,
)
from mrmission.vehicle.saved import (
    ORDER,
    Contents,
    is_empty,
    read_store,
    restore,
    save_contents,
)

READINGS = 3
"""How often a vehicle is read before a difference counts as what it stores."""

_DO_NOT_START = "do not start it before another upload was verified"


class Keeper(Protocol):
    """Who keeps what must outlive the program: the record, and what vehicles held before."""

    def remains(self, system_id: int) -> bool:
        """Return whether a vehicle may hold the remains of a broken upload."""

    def save(self, system_id: int, contents: Contents, vehicle: str) -> str:
        """Keep what a vehicle held; return where."""

    def begin(self, robot: int, system_id: int, link: str) -> None:
        """Take note before the first byte goes to a vehicle."""

    def fail(self, robot: int) -> None:
        """Take note that a vehicle holds its old mission or none."""

    def store(self, robot: int, system_id: int, link: str, contents: Contents) -> None:
        """Take note that a vehicle was verified to hold `contents`."""


class FolderKeeper:
    """Keeps the record, and what vehicles held, in a folder.

    Parameters
    ----------
    folder
        Where they lie.
    sorties
        Robot to the sortie that is uploaded; 1 where not given.
    """

    def __init__(self, folder: Path, sorties: Mapping[int, int] | None = None) -> None:
        self._folder = folder
        self._file = FleetFile(folder)
        self._sorties = dict(sorties or {})

    @property
    def pairs(self) -> dict[int, int]:
        """Robot to system id, as the last runs had it."""
        return self._file.pairs

    def remains(self, system_id: int) -> bool:
        """Return whether a vehicle may hold the remains of a broken upload."""
        return self._file.remains(system_id)

    def save(self, system_id: int, contents: Contents, vehicle: str) -> str:
        """Write what a vehicle held into a file of the folder; return its name there."""
        path = save_contents(self._folder, system_id, contents, vehicle)
        return path.relative_to(self._folder).as_posix()

    def begin(self, robot: int, system_id: int, link: str) -> None:
        """Write down that the first byte is about to go to a vehicle."""
        self._file.begin(robot, system_id, link, self._sorties.get(robot, 1))

    def fail(self, robot: int) -> None:
        """Write down that a vehicle holds its old mission or none."""
        self._file.fail(robot)

    def store(self, robot: int, system_id: int, link: str, contents: Contents) -> None:
        """Write down what a vehicle was verified to hold."""
        sortie = self._sorties.get(robot, 1)
        self._file.put(record_of(robot, system_id, link, contents, sortie))


class ArmedError(VehicleError):
    """The vehicle is armed, or became armed on the way."""


class FarAwayError(VehicleError):
    """The vehicle lies too far from its mission's home."""


@dataclass(frozen=True, slots=True, kw_only=True)
class JobOptions:
    """What all jobs of an upload share.

    Parameters
    ----------
    max_distance_m
        A vehicle farther than this from its mission's home gets nothing.
    near_m
        Nearer than this, the distance is not worth a word.
    """

    timeouts: UploadTimeouts
    progress: ProgressCallback | None = None
    keeper: Keeper | None = None
    max_distance_m: float = DEFAULT_MAX_DISTANCE_M
    near_m: float = PlanOptions().berth_spacing_m


@dataclass(slots=True)
class Job:
    """One robot's upload."""

    mission: Mission
    vehicle: StoreVehicle | None
    sorties: int
    options: JobOptions
    estimate: tuple[float, float] | None = None
    _touched: bool = False
    _raw: dict[MissionType, tuple[RawItem, ...]] = field(default_factory=dict)
    _old: dict[MissionType, tuple[RawItem, ...]] = field(default_factory=dict)
    _stored: dict[MissionType, tuple[RawItem, ...]] = field(default_factory=dict)
    _tries: Tries | None = None
    _remarks: list[str] = field(default_factory=list)

    async def run(self, silent: str) -> UploadRow:
        """Do it and return the row; raise nothing but a cancellation.

        Parameters
        ----------
        silent
            What is known of links on which nobody answers, for a robot without a vehicle.
        """
        loop = asyncio.get_running_loop()
        began_s = loop.time()
        self._raw = to_raw(self.mission)
        status, holds, detail = await self._outcome(silent)
        if self.sorties > 1:
            self._remarks.insert(0, f"sortie {self.mission.sortie} of {self.sorties}")
        length_m, duration_s = self.estimate or _own_estimate(self.mission)
        if duration_s is not None and not math.isfinite(duration_s):
            duration_s = None
        tries = self._tries
        return UploadRow(
            robot=self.mission.robot,
            sortie=self.mission.sortie,
            system_id=self.vehicle.system_id if self.vehicle else None,
            link=self.vehicle.connection.url if self.vehicle else "",
            items=len(self._raw[MissionType.MISSION]),
            fence_items=len(self._raw[MissionType.FENCE]),
            rally_points=len(self._raw[MissionType.RALLY]),
            length_m=length_m,
            duration_s=duration_s,
            status=status,
            detail="; ".join(text for text in (*self._remarks, detail) if text),
            verified=status in (UploadStatus.VERIFIED, UploadStatus.UNCHANGED),
            holds=holds,
            attempts=int(self._touched) + (tries.repeated if tries is not None else 0),
            elapsed_s=loop.time() - began_s,
        )

    async def _outcome(self, silent: str) -> tuple[UploadStatus, Holds, str]:
        vehicle = self.vehicle
        if vehicle is None:
            detail = "no vehicle for it" + (f": {silent}" if silent else "")
            return UploadStatus.ABSENT, Holds.NOBODY, f"{detail}; start it and run again"
        self._tries = tries = Tries(
            vehicle, self.options.timeouts, guard=lambda: self._refuse_armed(vehicle)
        )
        why: MrMissionError
        try:
            try:
                await vehicle.wait_heartbeat()
                self._refuse_armed(vehicle)
                await self._refuse_far(vehicle)
                missing = await self._look(vehicle, tries)
                if missing:
                    await self._send_and_verify(vehicle, missing, tries)
                self._note_stored(vehicle)
            except asyncio.CancelledError:
                self._tell(vehicle, "stopping", 1.0)
                _, left = await self._put_back(vehicle, tries)
                self._tell(vehicle, f"cancelled, {left}", 1.0)
                raise
        except asyncio.CancelledError:
            # Cancelled again while its stores were put in order, or just now: it has been told.
            raise
        except (ArmedError, FarAwayError) as error:
            status, why = UploadStatus.REFUSED, error
        except ReadbackMismatchError as error:
            status, why = UploadStatus.MISMATCH, error
        except MrMissionError as error:
            refused = isinstance(error, TransferError) and error.result not in LINK_TROUBLE
            status, why = UploadStatus.REFUSED if refused else UploadStatus.FAILED, error
        else:
            self._tell(vehicle, "verified", 1.0)
            if not self._touched:
                return UploadStatus.UNCHANGED, Holds.PLAN, "nothing sent"
            return UploadStatus.VERIFIED, Holds.PLAN, ""
        holds, left = await self._put_back(vehicle, tries)
        return status, holds, f"{why}; {left}"

    # --- before the first byte -------------------------------------------------------------------

    def _refuse_armed(self, vehicle: StoreVehicle) -> None:
        if vehicle.armed:
            raise ArmedError(f"armed, in {vehicle.mode}: disarm it and run again")

    async def _refuse_far(self, vehicle: StoreVehicle) -> None:
        distance_m = await distance_from_home_m(vehicle, self.mission)
        limit_m = self.options.max_distance_m
        if distance_m is None:
            self._remarks.append("no position, so not compared with its mission's home")
        elif distance_m > limit_m:
            raise FarAwayError(
                f"lies {_far(distance_m)} from its mission's home, more than --max-distance "
                f"{limit_m:g} m: is another lake meant, or another vehicle?"
            )
        elif distance_m > self.options.near_m:
            self._remarks.append(f"lies {_far(distance_m)} from its mission's home")

    async def _look(self, vehicle: StoreVehicle, tries: Tries) -> list[MissionType]:
        """Read what the vehicle holds; return the stores that are not yet as they are to be."""
        self._tell(vehicle, "looking", 0.0)
        missing: list[MissionType] = []
        unread: list[str] = []
        for kind in ORDER:
            try:
                stored = await read_store(vehicle, kind, tries)
            except TransferError as error:
                if error.result in LINK_TROUBLE or vehicle.silent:
                    raise
                # It refuses to show it, as with a damaged store: there is nothing to put back.
                unread.append(kind.label)
                missing.append(kind)
                continue
            self._old[kind] = self._stored[kind] = stored
            if compare_items(self._raw[kind], stored, kind):
                missing.append(kind)
        if not missing:
            return missing
        keeper, system_id = self.options.keeper, vehicle.system_id
        if unread:
            self._old.clear()
            self._remarks.append(f"its old {' and '.join(unread)} could not be read")
        elif self._is_remains() or (keeper is not None and keeper.remains(system_id)):
            # Half a mission is not worth putting back.
            self._old.clear()
            self._remarks.append("held the remains of a broken upload")
        elif keeper is not None and not is_empty(self._old):
            path = keeper.save(system_id, self._old, self.mission.vehicle)
            self._remarks.append(f"what it held is in {path}")
        return missing

    def _is_remains(self) -> bool:
        """Return whether the old mission is the beginning of the new one: a broken upload."""
        old, new = self._old[MissionType.MISSION], self._raw[MissionType.MISSION]
        return 0 < len(old) < len(new) and not compare_items(
            new[: len(old)], old, MissionType.MISSION
        )

    # --- sending ---------------------------------------------------------------------------------

    async def _send_and_verify(
        self, vehicle: StoreVehicle, missing: Sequence[MissionType], tries: Tries
    ) -> None:
        kinds = [k for k in ORDER if k in missing or k is MissionType.MISSION]
        total = 2 * sum(len(self._raw[kind]) for kind in kinds) or 1
        done = 0
        self._refuse_armed(vehicle)
        if self.options.keeper is not None:
            self.options.keeper.begin(self.mission.robot, vehicle.system_id, vehicle.connection.url)
        self._touched = True
        # Whatever breaks from here on, no vehicle is left with an old mission in a new fence.
        await tries.run(partial(vehicle.clear, MissionType.MISSION))
        for kind in kinds:
            items = self._raw[kind]
            step = partial(self._sending, vehicle, kind, done / total, len(items) / total)
            step(0.0)
            self._refuse_armed(vehicle)
            if items:
                await tries.run(partial(vehicle.upload, kind, items, step), count=len(items))
            elif kind is not MissionType.MISSION:
                await tries.run(partial(vehicle.clear, kind))
            done += len(items)
        for kind in kinds:
            self._tell(vehicle, f"reading {kind.label}", done / total)
            self._stored[kind] = await self._verified(vehicle, kind, tries)
            done += len(self._raw[kind])

    async def _verified(
        self, vehicle: StoreVehicle, kind: MissionType, tries: Tries
    ) -> tuple[RawItem, ...]:
        """Return what a store holds, when that is what it is to hold."""
        # A link that repeats packets can garble a reading; what a vehicle does store wrongly it
        # shows again. Only a whole reading that matches counts as verified.
        for _ in range(READINGS):
            stored = await read_store(vehicle, kind, tries)
            wrong = compare_items(self._raw[kind], stored, kind)
            if not wrong:
                return stored
        more = f" and {len(wrong) - 1} more" if len(wrong) > 1 else ""
        raise ReadbackMismatchError(f"{wrong[0]}{more}")

    def _sending(
        self, vehicle: StoreVehicle, kind: MissionType, start: float, share: float, part: float
    ) -> None:
        self._tell(vehicle, f"sending {kind.label}", start + share * part)

    def _note_stored(self, vehicle: StoreVehicle) -> None:
        keeper = self.options.keeper
        if keeper is not None:
            self._note(
                lambda: keeper.store(
                    self.mission.robot, vehicle.system_id, vehicle.connection.url, self._stored
                )
            )

    def _note(self, write: Callable[[], None]) -> None:
        """Write to the record; that this fails must not change what happens to the vehicle."""
        try:
            write()
        except MrMissionError as error:
            self._remarks.append(str(error))

    # --- after a failure -------------------------------------------------------------------------

    async def _put_back(self, vehicle: StoreVehicle, tries: Tries) -> tuple[Holds, str]:
        """Put back what a vehicle held, or empty it; return which, and the words for it."""
        if not self._touched:
            return Holds.UNTOUCHED, str(Holds.UNTOUCHED)
        try:
            holds = await self._restored_or_emptied(vehicle, tries)
        except asyncio.CancelledError:
            self._tell(vehicle, f"cancelled, what it stores is unknown: {_DO_NOT_START}", 1.0)
            raise
        if holds is Holds.UNKNOWN:
            why = "it does not answer" if vehicle.silent else "it did not confirm that it is empty"
            return holds, f"what it stores is unknown: {why}; {_DO_NOT_START}"
        keeper = self.options.keeper
        if keeper is not None:
            self._note(lambda: keeper.fail(self.mission.robot))
        if holds is Holds.RESTORED:
            return holds, str(holds)
        return holds, f"{holds} (mission, fence and rally points cleared)"

    async def _restored_or_emptied(self, vehicle: StoreVehicle, tries: Tries) -> Holds:
        timeouts = self.options.timeouts
        # Whoever was waited for in vain gets a last glance only.
        if not await returned(vehicle, 0.0 if tries.lost else timeouts.return_s):
            return Holds.UNKNOWN
        # An armed vehicle in AUTO would steer for a mission at once, so it gets none.
        if self._old and not is_empty(self._old) and not vehicle.armed:
            self._tell(vehicle, "putting the old mission back", 1.0)
            guarded = Tries(vehicle, timeouts, guard=lambda: self._refuse_armed(vehicle))
            try:
                async with asyncio.timeout(timeouts.restore_s):
                    await restore(vehicle, self._old, guarded)
            except (TimeoutError, VehicleError):
                if guarded.lost:
                    return Holds.UNKNOWN
            else:
                return Holds.RESTORED
        self._tell(vehicle, "clearing", 1.0)
        try:
            async with asyncio.timeout(timeouts.cleanup_s):
                while not await self._emptied(vehicle):
                    await asyncio.sleep(1.0)
        except (TimeoutError, VehicleError):
            return Holds.UNKNOWN
        return Holds.EMPTY

    async def _emptied(self, vehicle: StoreVehicle) -> bool:
        try:
            for kind in MissionType:
                await vehicle.clear(kind)
                if await vehicle.stored_count(kind) > kind.empty_count:
                    return False
        except VehicleError:
            # A transfer that broke off is held open for a while, and clearing refused as long.
            if vehicle.silent:
                raise
            return False
        return True

    def _tell(self, vehicle: StoreVehicle, stage: str, fraction: float) -> None:
        if self.options.progress is not None:
            self.options.progress(
                UploadProgress(
                    robot=self.mission.robot,
                    system_id=vehicle.system_id,
                    stage=stage,
                    fraction=fraction,
                )
            )


def _far(distance_m: float) -> str:
    return f"{distance_m:.0f} m" if distance_m < 1000 else f"{distance_m / 1000:.1f} km"


def path_length_m(mission: Mission) -> float:
    """Return the length of a mission's way from home through its waypoints, metres."""
    import pyproj

    points = [i for n, i in enumerate(mission.items) if n == 0 or i.command == mavlink.NAV_WAYPOINT]
    if len(points) < 2:
        return 0.0
    geod = pyproj.Geod(ellps="WGS84")
    return float(geod.line_length([p.y / 1e7 for p in points], [p.x / 1e7 for p in points]))


def _own_estimate(mission: Mission) -> tuple[float, float | None]:
    length_m = path_length_m(mission)
    speeds = [
        i.param2 for i in mission.items if i.command == mavlink.DO_CHANGE_SPEED and i.param2 > 0
    ]
    return length_m, (length_m / speeds[0] if speeds else None)

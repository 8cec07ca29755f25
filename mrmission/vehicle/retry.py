"""Operations on a vehicle, repeated where that may help: bounded, with pauses, and counted."""

from __future__ import annotations

import asyncio
from collections.abc import Awaitable, Callable
from typing import TypeVar

from mrmission.errors import LinkTimeoutError
from mrmission.vehicle.links import StoreVehicle, TransferError, items_supported
from mrmission.vehicle.rows import UploadTimeouts

_T = TypeVar("_T")

LINK_TROUBLE = frozenset({"TIMEOUT", "BUSY", "TRANSFER_CANCELLED"})
"""Results of a transfer that are nobody's refusal."""
HELD = frozenset({"DENIED", "BUSY"})
"""Results of a vehicle that holds another transfer open, perhaps one of ours that broke off."""
PASSING = LINK_TROUBLE | HELD | {"ERROR", "INVALID_SEQUENCE"}
"""Results that a later try may turn."""

_POLL_S = 0.2


class Tries:
    """Runs a vehicle's operations, and counts how often it had to try again.

    Parameters
    ----------
    vehicle
        Whom the operations are about.
    timeouts
        How long to pause, how often to try.
    guard
        Called before every repetition; what it raises ends the matter.
    """

    def __init__(
        self,
        vehicle: StoreVehicle,
        timeouts: UploadTimeouts,
        guard: Callable[[], None] = lambda: None,
    ) -> None:
        self._vehicle = vehicle
        self._timeouts = timeouts
        self._guard = guard
        self.repeated = 0
        """How often something was tried again."""
        self.lost = False
        """Whether the vehicle fell silent and was waited for in vain."""

    async def run(self, operation: Callable[[], Awaitable[_T]], *, count: int = 0) -> _T:
        """Run an operation, again after a pause where that may help.

        Parameters
        ----------
        operation
            What to do; called anew for every try.
        count
            How many items it sends, to tell a refusal of so many from one in passing.

        Raises
        ------
        VehicleError
            What the last try raised.
        """
        vehicle, timeouts = self._vehicle, self._timeouts
        pauses = list(timeouts.pauses_s)
        excused = False
        while True:
            vehicle.forget_status_texts()
            held = False
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
                    self.repeated += 1
                    await asyncio.sleep(timeouts.too_many_pause_s)
                    continue
                held = error.result in HELD
                if error.result not in PASSING or not pauses or not await self._back():
                    raise _with_texts(error, vehicle) from error
            except LinkTimeoutError:
                if not pauses or not await self._back():
                    raise
            pause_s = pauses.pop(0)
            await asyncio.sleep(max(pause_s, timeouts.hold_s) if held else pause_s)
            self.repeated += 1
            self._guard()

    async def _back(self) -> bool:
        """Return whether the vehicle is heard, if need be after a wait for its return."""
        if not self._vehicle.silent:
            return True
        self.lost = self.lost or not await returned(self._vehicle, self._timeouts.return_s)
        return not self.lost


async def returned(vehicle: StoreVehicle, patience_s: float) -> bool:
    """Return whether a vehicle is heard within `patience_s`."""
    loop = asyncio.get_running_loop()
    deadline = loop.time() + patience_s
    while vehicle.silent:
        if loop.time() >= deadline:
            return False
        await asyncio.sleep(_POLL_S)
    return True


def _too_many(vehicle: StoreVehicle, count: int, holds: int | None) -> TransferError:
    says = f"holds {holds}" if holds is not None else "refuses that many"
    return TransferError(
        f"vehicle {vehicle.system_id} on {vehicle.connection.url}: {count} items sent, and it "
        f"{says} (TOO_MANY_MISSION_ITEMS); take a wider --swath or a larger --k",
        result="TOO_MANY_MISSION_ITEMS",
    )


def _with_texts(error: TransferError, vehicle: StoreVehicle) -> TransferError:
    texts = vehicle.status_texts()
    if not texts:
        return error
    return TransferError(f'{error} (it says: "{texts[-1]}")', result=error.result)

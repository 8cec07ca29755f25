"""What a vehicle's heartbeats and status texts said last, whichever client took them in."""

from __future__ import annotations

import asyncio
from collections import deque

from mrmission.errors import LinkTimeoutError
from mrmission.vehicle.connection import Connection
from mrmission.vehicle.links import ARMED_FLAG, LinkTimeouts, mode_name

POLL_S = 0.02
TEXTS_KEPT = 20


class Heard:
    """The state of one autopilot, as it was told; written by the event loop only.

    Parameters
    ----------
    system_id
        Its MAVLink system id.
    connection
        The link on which it is heard.
    timeouts
        How long to wait for what.
    """

    def __init__(self, system_id: int, connection: Connection, timeouts: LinkTimeouts) -> None:
        self.system_id = system_id
        self.connection = connection
        self._timeouts = timeouts
        self._loop = asyncio.get_running_loop()
        self._heard_s = self._loop.time()
        self._texts: deque[str] = deque(maxlen=TEXTS_KEPT)
        self._armed: bool | None = None
        self._mode = ""
        self._type = 0
        self.autopilot = 0
        """MAV_AUTOPILOT of the last heartbeat."""

    def __repr__(self) -> str:
        return f"Vehicle(system_id={self.system_id}, link={self.connection.url!r})"

    def where(self) -> str:
        """Return what messages call this vehicle."""
        return f"vehicle {self.system_id} on {self.connection.url}"

    def _take_heartbeat(
        self, base_mode: int, custom_mode: int, vehicle_type: int, autopilot: int
    ) -> None:
        self._armed = bool(base_mode & ARMED_FLAG)
        self._type = vehicle_type
        self.autopilot = autopilot
        self._mode = mode_name(vehicle_type, custom_mode)

    @property
    def armed(self) -> bool:
        """Whether the last heartbeat said armed; a vehicle not heard yet counts as armed."""
        return self._armed is not False

    @property
    def mode(self) -> str:
        """Name of the mode in the last heartbeat."""
        return self._mode or "unknown mode"

    @property
    def vehicle_type(self) -> int:
        """MAV_TYPE of the last heartbeat."""
        return self._type

    @property
    def silent(self) -> bool:
        """Whether nothing was heard for longer than a link may drop heartbeats."""
        return self._loop.time() - self._heard_s > self._timeouts.silence_s

    def status_texts(self) -> tuple[str, ...]:
        """Return the last status texts, oldest first."""
        return tuple(self._texts)

    def forget_status_texts(self) -> None:
        """Drop the status texts seen so far, before an operation whose texts are wanted."""
        self._texts.clear()

    async def wait_heartbeat(self) -> None:
        """Wait until the vehicle has said whether it is armed.

        Raises
        ------
        LinkTimeoutError
            When no heartbeat comes.
        """
        deadline_s = self._loop.time() + self._timeouts.discovery_s
        while self._armed is None:
            if self._loop.time() > deadline_s:
                raise LinkTimeoutError(
                    f"{self.where()}: no heartbeat in {self._timeouts.discovery_s:g} s"
                )
            await asyncio.sleep(POLL_S)

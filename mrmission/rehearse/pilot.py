"""Arm a vehicle, start its mission, watch it to the end.

This arms. It is for vehicles that the caller has started itself, a simulator's, and nothing else;
`mrmission rehearse` and `mrmission calibrate` take no connection from outside.
"""

from __future__ import annotations

import asyncio
import contextlib
import math
import re
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

from mrmission.errors import LinkTimeoutError, SimulatorError
from mrmission.mission import mavlink
from mrmission.model import Mission
from mrmission.rehearse.track import Recorder, Track

if TYPE_CHECKING:
    from mrmission.vehicle.client import Vehicle

MODE_HOLD = 4
MODE_AUTO = 10
_DO_SET_MODE = 176
_COMPONENT_ARM_DISARM = 400
_SET_MESSAGE_INTERVAL = 511
_DO_SET_MISSION_CURRENT = 224
_ACCEPTED = 0
_CUSTOM_MODE_ENABLED = 1
_MISSION_COMPLETE = 5
_ARMED_FLAG = 128
_FORCE_DISARM = 21196

_GLOBAL_POSITION_INT = 33
_MISSION_CURRENT = 42
_FENCE_STATUS = 162
_SIMSTATE = 164
_DROPPED_STREAMS = (24, 27, 29, 30, 32, 35, 36, 62, 65, 74, 116, 129, 136, 152, 163, 178, 193, 241)
"""Streams that ArduPilot sends unasked and nobody here reads (raw sensors, attitude, servos …)."""
_LISTENED = (
    "HEARTBEAT", "GLOBAL_POSITION_INT", "MISSION_CURRENT", "MISSION_ITEM_REACHED", "STATUSTEXT",
    "FENCE_STATUS", "SIMSTATE",
)  # fmt: skip
_BREACHED = re.compile(r"fence.*breached", re.IGNORECASE)
_POLL_S = 0.05
_UNKNOWN_HEADING = 65535


@dataclass(frozen=True, slots=True, kw_only=True)
class SailOrders:
    """How a mission is sailed. Seconds are of the vehicle's clock unless the name says wall.

    Attributes
    ----------
    sample_s
        Time between two positions of the track.
    ready_s
        How long the vehicle may take until it can be armed and started.
    give_up_s
        How long the mission may take in all; NaN means four times its length at its slowest speed,
        and ten minutes.
    stall_s
        A vehicle that reaches no item for so long, and stays within `stall_m` all the while, has
        given up.
    stall_m
        See `stall_s`.
    watch_end_s
        How long to go on watching when the last waypoint has been reached.
    at_start
        Parameters that are set when the mission has started: a simulator's current, for example,
        must not carry off a vehicle that lies at its berth and waits.
    silent_wall_s
        A vehicle that says nothing for so long on the wall's clock is lost.
    stop
        Whether the vehicle is stopped (HOLD) and disarmed in the end.
    """

    sample_s: float = 0.25
    ready_s: float = 240.0
    give_up_s: float = math.nan
    stall_s: float = 240.0
    stall_m: float = 3.0
    watch_end_s: float = 0.0
    at_start: Mapping[str, float] = field(default_factory=dict)
    silent_wall_s: float = 20.0
    stop: bool = True


SailProgress = Callable[[int, int, int], None]
"""Called with robot, item steered for, number of items."""


async def sail(
    vehicle: Vehicle,
    mission: Mission,
    orders: SailOrders | None = None,
    *,
    progress: SailProgress | None = None,
) -> Track:
    """Sail the mission that a vehicle stores, from arming to the last waypoint, and track it.

    Parameters
    ----------
    vehicle
        A vehicle that the caller has started itself; the mission has been uploaded and verified.
    mission
        What it stores: the items tell which one is the last waypoint.
    orders
        Time-outs, rate, what to do at the start and at the end.
    progress
        Called when the item changes.

    Returns
    -------
    Track
        What was driven. A voyage that did not end at home says why in ``end_text``.

    Raises
    ------
    SimulatorError
        When the vehicle cannot be armed, or does not start.
    LinkTimeoutError
        When it says nothing.

    Notes
    -----
    The vehicle is brought to HOLD before it is armed, and from there to AUTO: ArduRover refuses
    the step from MANUAL to AUTO. Samples carry the vehicle's own time stamps.
    """
    return await _Voyage(vehicle, mission, orders or SailOrders(), progress).run()


def last_waypoint(mission: Mission) -> int:
    """Return the number of the last waypoint; what follows it is how the vehicle waits there.

    Raises
    ------
    SimulatorError
        When the mission has no waypoint.
    """
    found = [
        item.seq
        for item in mission.items
        if item.command in (mavlink.NAV_WAYPOINT, mavlink.NAV_SPLINE_WAYPOINT) and item.seq > 0
    ]
    if not found:
        raise SimulatorError(f"robot {mission.robot}: its mission has no waypoint to sail to")
    return found[-1]


def longest_s(mission: Mission) -> float:
    """Return the seconds after which a mission has surely failed: see :class:`SailOrders`."""
    radius_m = 6_371_000.0
    length_m, slowest_m_s = 0.0, math.inf
    before: tuple[float, float] | None = None
    for item in mission.items:
        if item.command == mavlink.DO_CHANGE_SPEED and item.param2 > 0:
            slowest_m_s = min(slowest_m_s, item.param2)
        if item.command in mavlink.NAVIGATION and (item.x or item.y):
            here = math.radians(item.x / 1e7), math.radians(item.y / 1e7)
            if before is not None:
                east = math.remainder(here[1] - before[1], math.tau) * math.cos(here[0])
                length_m += radius_m * math.hypot(here[0] - before[0], east)
            before = here
    speed_m_s = slowest_m_s if math.isfinite(slowest_m_s) else 1.0
    waits_s = sum(hold_s(mission, item.seq) for item in mission.items)
    return 600.0 + 4.0 * length_m / speed_m_s + waits_s


def hold_s(mission: Mission, seq: int) -> float:
    """Return how long a vehicle holds at an item's waypoint before it goes on, s."""
    if not 0 < seq < len(mission.items):
        return 0.0
    item = mission.items[seq]
    return item.param1 if item.command == mavlink.NAV_WAYPOINT else 0.0


class _Voyage:
    """One vehicle on its way: a task takes in the messages, another gives the orders."""

    def __init__(
        self, vehicle: Vehicle, mission: Mission, orders: SailOrders, progress: SailProgress | None
    ) -> None:
        self.vehicle = vehicle
        self.mission = mission
        self.orders = orders
        self.progress = progress
        self.log = Recorder(mission.robot, vehicle.system_id)
        self.last = last_waypoint(mission)
        self._navigation = {i.seq for i in mission.items if i.command in mavlink.NAVIGATION}
        self._count = len(mission.items)
        self._armed = False
        self._mode: int | None = None
        self._was_auto = False
        self._heard = asyncio.get_running_loop().time()
        self._breach_count: int | None = None
        self._current = 0
        self._moved: tuple[float, float, float] | None = None

    def _where(self) -> str:
        return f"robot {self.mission.robot}, vehicle {self.vehicle.system_id}"

    async def run(self) -> Track:
        """Arm, start, watch, stop."""
        with self.vehicle.listen(*_LISTENED) as queue:
            pump = asyncio.create_task(self._pump(queue))
            try:
                await self._streams()
                await self._start()
                await self._watch()
                if self.orders.stop:
                    await self._stop()
            finally:
                pump.cancel()
                with contextlib.suppress(asyncio.CancelledError):
                    await pump
        return self.log.track()

    # --- what is heard ---------------------------------------------------------------------------

    async def _pump(self, queue: asyncio.Queue[Any]) -> None:
        loop = asyncio.get_running_loop()
        while True:
            message = await queue.get()
            self._heard = loop.time()
            getattr(self, "_on_" + message.get_type().lower())(message)

    def _on_heartbeat(self, message: Any) -> None:
        self._armed = bool(message.base_mode & _ARMED_FLAG)
        self._mode = int(message.custom_mode)
        self._was_auto = self._was_auto or self._mode == MODE_AUTO

    def _on_global_position_int(self, message: Any) -> None:
        heading = math.nan if message.hdg == _UNKNOWN_HEADING else message.hdg / 100.0
        self.log.position(
            message.time_boot_ms / 1000.0, message.lon / 1e7, message.lat / 1e7, heading
        )

    def _on_simstate(self, message: Any) -> None:
        self.log.truth(message.lng / 1e7, message.lat / 1e7)

    def _on_mission_current(self, message: Any) -> None:
        self._current = int(message.seq)
        self._steer_for(self._current)
        if getattr(message, "mission_state", 0) == _MISSION_COMPLETE:
            self._ended()

    def _on_mission_item_reached(self, message: Any) -> None:
        seq = int(message.seq)
        if seq not in self._navigation or not math.isfinite(self.log.started_s):
            return
        self.log.reach(seq)
        following = [n for n in self._navigation if n > seq]
        if following:
            self._steer_for(min(following))
        if seq >= self.last:
            self._ended()

    def _on_statustext(self, message: Any) -> None:
        text = message.text
        text = text.decode(errors="replace") if isinstance(text, bytes) else str(text)
        text = text.rstrip("\0")
        self.log.say(int(message.severity), text)
        if _BREACHED.search(text) and self._breach_count is None:
            self.log.breach(0)

    def _on_fence_status(self, message: Any) -> None:
        count = int(message.breach_count)
        if self._breach_count is not None and count > self._breach_count:
            self.log.breach(int(message.breach_type))
        self._breach_count = count

    def _steer_for(self, seq: int) -> None:
        """Note the item steered for; it only grows, so a late message changes nothing."""
        if not math.isfinite(self.log.started_s) or seq <= self.log.item or seq >= self._count:
            return
        self.log.item = seq
        if seq > self.last:
            self._ended()
        if self.progress is not None:
            self.progress(self.mission.robot, seq, self._count)

    def _ended(self) -> None:
        if math.isfinite(self.log.started_s) and not math.isfinite(self.log.ended_s):
            self.log.ended_s = self.log.now_s
            self.log.end_text = "home"

    # --- what is ordered -------------------------------------------------------------------------

    async def _streams(self) -> None:
        every_us = self.orders.sample_s * 1e6
        for message_id, interval_us in (
            *((number, -1.0) for number in _DROPPED_STREAMS),
            (_FENCE_STATUS, 1e6),
            (_SIMSTATE, 1e6),
            (_MISSION_CURRENT, 1e6),
            (_GLOBAL_POSITION_INT, every_us),
        ):
            wanted = message_id in (_MISSION_CURRENT, _GLOBAL_POSITION_INT)
            result = await self._command(
                _SET_MESSAGE_INTERVAL, message_id, interval_us, tries=3 if wanted else 1
            )
            if wanted and result != _ACCEPTED:
                raise SimulatorError(
                    f"{self._where()}: does not stream message {message_id} (result {result})"
                )

    async def _command(self, command: int, *params: float, tries: int = 3) -> int | None:
        """Send a command; None where no answer came."""
        try:
            return int(await self.vehicle.command(command, *params, timeout_s=1.0, tries=tries))
        except LinkTimeoutError:
            return None

    async def _start(self) -> None:
        first = await self._wait(lambda: self.log.position_lonlat is not None, "has no position")
        deadline_s = first + self.orders.ready_s
        await self._until(
            lambda: self._mode == MODE_HOLD, _DO_SET_MODE, (_CUSTOM_MODE_ENABLED, MODE_HOLD),
            deadline_s, "does not change to HOLD",
        )  # fmt: skip
        if self._current > 1:
            await self._command(_DO_SET_MISSION_CURRENT, 1.0, 1.0)
        while True:
            await self._until(
                lambda: self._armed, _COMPONENT_ARM_DISARM, (1.0,), deadline_s, "cannot be armed"
            )
            result = await self._command(_DO_SET_MODE, _CUSTOM_MODE_ENABLED, MODE_AUTO)
            if result == _ACCEPTED:
                break
            if self.log.now_s > deadline_s:
                raise self._refusal("does not change to AUTO")
            await asyncio.sleep(_POLL_S)
        self.log.started_s = self.log.now_s
        self._steer_for(min(self._navigation - {0}))
        for name, value in self.orders.at_start.items():
            await self.vehicle.set_parameter(name, value)

    async def _until(
        self,
        done: Callable[[], bool],
        command: int,
        params: tuple[float, ...],
        deadline_s: float,
        complaint: str,
    ) -> None:
        """Repeat a command until the vehicle is seen to have followed it."""
        while not done():
            if self.log.now_s > deadline_s:
                raise self._refusal(complaint)
            await self._command(command, *params)
            for _ in range(20):
                if done():
                    break
                await asyncio.sleep(_POLL_S)
            self._check_silence()

    def _refusal(self, complaint: str) -> SimulatorError:
        texts = [said.text for said in self.log.track().texts][-3:]
        said = f"; it says: {'; '.join(texts)}" if texts else ""
        return SimulatorError(
            f"{self._where()}: {complaint} within {self.orders.ready_s:g} s of its clock{said}"
        )

    async def _wait(self, done: Callable[[], bool], complaint: str) -> float:
        loop = asyncio.get_running_loop()
        start = loop.time()
        while not done():
            # a vehicle without a position tells no time: the wall's clock must do
            if loop.time() - start > self.orders.ready_s:
                raise self._refusal(complaint)
            self._check_silence()
            await asyncio.sleep(_POLL_S)
        return self.log.now_s

    def _check_silence(self) -> None:
        silent_s = asyncio.get_running_loop().time() - self._heard
        if silent_s > self.orders.silent_wall_s:
            raise LinkTimeoutError(f"{self._where()}: has said nothing for {silent_s:.0f} s")

    async def _watch(self) -> None:
        """Wait for the end of the mission, and some time more."""
        log, orders = self.log, self.orders
        give_up_s = orders.give_up_s
        if not math.isfinite(give_up_s):
            give_up_s = longest_s(self.mission)
        stop_s = log.started_s + give_up_s
        item, since_s, anchor = log.item, log.now_s, log.position_lonlat
        while not math.isfinite(log.ended_s):
            await asyncio.sleep(_POLL_S)
            self._check_silence()
            if self._was_auto and self._mode != MODE_AUTO:
                log.end_text = f"left AUTO for mode {self._mode}"
                return
            if not self._armed:
                log.end_text = "disarmed on its way"
                return
            if log.now_s > stop_s:
                log.end_text = f"not home after {give_up_s:.0f} s"
                return
            here = log.position_lonlat
            if log.item != item or _apart_m(here, anchor) > orders.stall_m:
                item, since_s, anchor = log.item, log.now_s, here
            elif log.now_s - since_s > orders.stall_s + hold_s(self.mission, log.item):
                log.end_text = f"stands still on the way to item {item}"
                return
        end_s = log.ended_s + orders.watch_end_s
        while log.now_s < end_s:
            await asyncio.sleep(_POLL_S)
            self._check_silence()

    async def _stop(self) -> None:
        await self._command(_DO_SET_MODE, _CUSTOM_MODE_ENABLED, MODE_HOLD)
        await self._command(_COMPONENT_ARM_DISARM, 0.0, _FORCE_DISARM)


def _apart_m(a: tuple[float, float] | None, b: tuple[float, float] | None) -> float:
    """Return the distance of two nearby positions, good to a per cent."""
    if a is None or b is None:
        return math.inf
    north_m = (a[1] - b[1]) * 111_195.0
    east_m = math.remainder(a[0] - b[0], 360.0) * 111_195.0 * math.cos(math.radians(a[1]))
    return math.hypot(north_m, east_m)

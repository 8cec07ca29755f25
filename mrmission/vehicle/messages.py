"""One autopilot's messages: who listens gets them decoded, commands and parameters on top of that.

Messages that nobody listens for are kept as they came, the last one of each kind, and decoded only
when somebody looks at them.
"""

from __future__ import annotations

import asyncio
import contextlib
from collections.abc import Callable, Iterator, Sequence
from types import ModuleType
from typing import Any

from mrmission.errors import LinkTimeoutError, VehicleError
from mrmission.vehicle.connection import Connection
from mrmission.vehicle.framing import (
    AUTOPILOT_COMPONENT_ID,
    Frame,
    Message,
    mavlink,
    message_number,
)
from mrmission.vehicle.heard import Heard
from mrmission.vehicle.links import GCS_COMPONENT_ID, GCS_SYSTEM_ID, LinkTimeouts
from mrmission.vehicle.station import Link

PARAMETERS_AT_ONCE = 8
PARAMETER_TRIES = 4
PARAMETER_REPLY_S = 0.4
QUEUE_MOST = 10_000

_HEARTBEAT = mavlink.MAVLINK_MSG_ID_HEARTBEAT
_STATUSTEXT = mavlink.MAVLINK_MSG_ID_STATUSTEXT

MessageQueue = asyncio.Queue[Message]


class Autopilot(Heard):
    """One autopilot behind a link: what it says, what it is told, its parameters.

    Parameters
    ----------
    link
        Where it is heard.
    system_id
        Its MAVLink system id.
    connection
        The link's name and form.
    timeouts
        How long to wait for what.
    """

    mav: ModuleType = mavlink
    """pymavlink's dialect: constants, and the message classes that `send` takes."""

    def __init__(
        self, link: Link, system_id: int, connection: Connection, timeouts: LinkTimeouts
    ) -> None:
        super().__init__(system_id, connection, timeouts)
        self.link = link
        self._queues: dict[int, set[MessageQueue]] = {}
        self._latest: dict[int, tuple[float, Frame | Message]] = {}
        self._long_text: tuple[int, int, str] = (0, 0, "")
        self.rival: int | None = None
        """System id of another ground station to which this vehicle last spoke of a transfer."""

    # --- messages --------------------------------------------------------------------------------

    def handle(self, frame: Frame) -> None:
        """Take a frame of this vehicle's autopilot from the link."""
        self._heard_s = self._loop.time()
        number = frame.message_id
        queues = self._queues.get(number)
        if not queues and number not in (_HEARTBEAT, _STATUSTEXT) and not self.link.codec.signed:
            self._latest[number] = (self._heard_s, frame)
            return
        # Signatures must be checked in the order of arrival, so signed links decode everything.
        message = self.link.decode(frame)
        if message is None:
            return
        if number == _HEARTBEAT:
            self._take_heartbeat(
                message.base_mode, message.custom_mode, message.type, message.autopilot
            )
        elif number == _STATUSTEXT:
            self._take_text(message)
        if not self._for_us(message):
            return
        self._latest[number] = (self._heard_s, message)
        for queue in queues or ():
            with contextlib.suppress(asyncio.QueueFull):
                queue.put_nowait(message)

    def _for_us(self, message: Message) -> bool:
        """Return whether a message is for this ground station, not for one beside it."""
        target = getattr(message, "target_system", 0)
        if target not in (0, GCS_SYSTEM_ID):
            if message.get_type().startswith("MISSION_"):
                self.rival = int(target)
            return False
        return getattr(message, "target_component", 0) in (0, GCS_COMPONENT_ID)

    def _take_text(self, message: Message) -> None:
        """Keep a status text; one of several chunks is put together first."""
        text, number, chunk = str(message.text), int(message.id), int(message.chunk_seq)
        if number:
            last, last_chunk, before = self._long_text
            if (last, last_chunk) == (number, chunk):
                return
            if last == number and chunk:
                text = before + text
                if self._texts and self._texts[-1] == before:
                    self._texts.pop()
            self._long_text = (number, chunk, text)
        self._texts.append(text)

    @contextlib.contextmanager
    def listen(self, *names: str) -> Iterator[MessageQueue]:
        """Yield a queue of this vehicle's messages of the given names, decoded, as they come.

        Parameters
        ----------
        names
            MAVLink names, such as ``"GLOBAL_POSITION_INT"``.
        """
        queue: MessageQueue = asyncio.Queue(QUEUE_MOST)
        numbers = {message_number(name) for name in names}
        for number in numbers:
            self._queues.setdefault(number, set()).add(queue)
        try:
            yield queue
        finally:
            for number in numbers:
                self._queues[number].discard(queue)

    def send(self, message: Message) -> None:
        """Send a message, made of one of `mav`'s classes, to this vehicle."""
        self.link.send(message, self.system_id)

    def latest(self, name: str, max_age_s: float | None = None) -> Message | None:
        """Return the last message of a kind, None where none came or it is too old."""
        number = message_number(name)
        found = self._latest.get(number)
        if found is None:
            return None
        at_s, message = found
        if max_age_s is not None and self._loop.time() - at_s > max_age_s:
            return None
        if isinstance(message, Frame):
            message = self.link.codec.decode(message)
            if message is None:
                return None
            self._latest[number] = (at_s, message)
        return message

    async def message(self, name: str, timeout_s: float = 3.0) -> Message:
        """Ask for a message and return the next one of its kind.

        Raises
        ------
        LinkTimeoutError
            When none comes.
        """
        number = message_number(name)

        def ask() -> None:
            self.send(self._command_long(mavlink.MAV_CMD_REQUEST_MESSAGE, (number,), 0))

        reply = await self.ask(ask, name, any_message, timeout_s=timeout_s)
        if reply is None:
            raise LinkTimeoutError(f"{self.where()}: no {name} in {timeout_s:g} s")
        return reply

    async def stream(self, name: str, rate_hz: float) -> int:
        """Have a message sent regularly; 0 stops it. Return the MAV_RESULT."""
        interval_us = 1e6 / rate_hz if rate_hz > 0 else -1.0
        return await self.command(
            mavlink.MAV_CMD_SET_MESSAGE_INTERVAL, message_number(name), interval_us
        )

    async def command(
        self, command_id: int, *parameters: float, timeout_s: float = 1.0, tries: int = 5
    ) -> int:
        """Send a COMMAND_LONG until it is answered, and return its MAV_RESULT (0: accepted).

        Parameters
        ----------
        command_id
            MAV_CMD.
        parameters
            Its parameters 1 to 7; what is left out is 0.
        timeout_s
            Wait for an answer before the command is sent again; a vehicle that says "in progress"
            gets ten times as long.
        tries
            How often it is sent.

        Raises
        ------
        LinkTimeoutError
            When the vehicle never answers.
        """
        with self.listen("COMMAND_ACK") as queue:
            for number in range(tries):
                self.send(self._command_long(command_id, parameters, number))
                left_s = timeout_s
                while True:
                    reply = await self.next_of(queue, lambda m: m.command == command_id, left_s)
                    if reply is None:
                        break
                    if reply.result != mavlink.MAV_RESULT_IN_PROGRESS:
                        return int(reply.result)
                    left_s = 10.0 * timeout_s
        raise LinkTimeoutError(
            f"{self.where()}: no answer to command {command_id} in {tries} tries of {timeout_s:g} s"
        )

    def _command_long(self, command_id: int, parameters: Sequence[float], number: int) -> Message:
        padded = [*map(float, parameters), *[0.0] * (7 - len(parameters))]
        return mavlink.MAVLink_command_long_message(
            self.system_id, AUTOPILOT_COMPONENT_ID, command_id, number, *padded
        )

    async def next_of(
        self, queue: MessageQueue, accept: Callable[[Message], bool], timeout_s: float
    ) -> Message | None:
        """Return the next message that `accept` takes, None after `timeout_s`."""
        try:
            async with asyncio.timeout(timeout_s):
                while True:
                    message = await queue.get()
                    if accept(message):
                        return message
        except TimeoutError:
            return None

    async def ask(
        self,
        ask: Callable[[], None],
        name: str,
        accept: Callable[[Message], bool],
        *,
        timeout_s: float,
        again_s: float | None = None,
    ) -> Message | None:
        """Ask, again and again until `timeout_s` is over, and return the first answer."""
        again_s = again_s or self._timeouts.reply_s
        deadline_s = self._loop.time() + timeout_s
        with self.listen(name) as queue:
            while (left_s := deadline_s - self._loop.time()) > 0:
                ask()
                reply = await self.next_of(queue, accept, min(again_s, left_s))
                if reply is not None:
                    return reply
        return None

    # --- state -----------------------------------------------------------------------------------

    @property
    def gps_fix(self) -> int:
        """GPS_FIX_TYPE of the last GPS_RAW_INT: 3 and more is a position; 0 before one came."""
        message = self.latest("GPS_RAW_INT")
        return int(message.fix_type) if message is not None else 0

    def position_lonlat(self) -> tuple[float, float] | None:
        """Return the vehicle's last position in degrees, None before it has one."""
        message = self.latest("GLOBAL_POSITION_INT")
        if message is None or (message.lat == 0 and message.lon == 0):
            return None
        return message.lon * 1e-7, message.lat * 1e-7

    async def autopilot_version(self) -> Message:
        """Return AUTOPILOT_VERSION.

        Raises
        ------
        LinkTimeoutError
            When the vehicle does not send it.
        """
        return await self.message("AUTOPILOT_VERSION")

    # --- parameters ------------------------------------------------------------------------------

    async def parameter(self, name: str) -> float | None:
        """Return a parameter's value, or None when the vehicle does not have or tell it."""
        return (await self.parameters([name]))[name]

    async def parameters(self, names: Sequence[str]) -> dict[str, float | None]:
        """Return parameters by name, None for what the vehicle does not have or tell.

        ArduPilot says nothing of a name that it does not know, so that one costs a few tries.
        """
        out: dict[str, float | None] = dict.fromkeys(names)
        with self.listen("PARAM_VALUE") as queue:
            for _ in range(PARAMETER_TRIES):
                missing = [name for name, value in out.items() if value is None]
                for start in range(0, len(missing), PARAMETERS_AT_ONCE):
                    wanted = set(missing[start : start + PARAMETERS_AT_ONCE])
                    for name in sorted(wanted):
                        self._request_parameter(name)
                    while wanted:
                        reply = await self.next_of(
                            queue, lambda m: m.param_id in out, PARAMETER_REPLY_S
                        )
                        if reply is None:
                            break
                        out[reply.param_id] = _tidy(reply.param_value)
                        wanted.discard(reply.param_id)
                if not missing:
                    break
        return out

    def _request_parameter(self, name: str) -> None:
        self.send(
            mavlink.MAVLink_param_request_read_message(
                self.system_id, AUTOPILOT_COMPONENT_ID, name.encode(), -1
            )
        )

    async def set_parameter(self, name: str, value: float) -> float:
        """Set a parameter and return the value that the vehicle now says it has.

        Raises
        ------
        VehicleError
            When the vehicle does not confirm it: it has no such parameter, or refuses the value.
        """

        def ask() -> None:
            self.send(
                mavlink.MAVLink_param_set_message(
                    self.system_id,
                    AUTOPILOT_COMPONENT_ID,
                    name.encode(),
                    float(value),
                    mavlink.MAV_PARAM_TYPE_REAL32,
                )
            )

        told: list[float] = []

        def confirms(message: Message) -> bool:
            if message.param_id != name:
                return False
            told.append(_tidy(message.param_value))
            return abs(told[-1] - value) <= 1e-6 * max(1.0, abs(value))

        reply = await self.ask(
            ask,
            "PARAM_VALUE",
            confirms,
            timeout_s=PARAMETER_TRIES * self._timeouts.reply_s,
        )
        if reply is None:
            says = f"says {told[-1]:g}" if told else "does not confirm it (no such parameter?)"
            raise VehicleError(f"{self.where()}: {name} set to {value:g}, and it {says}")
        return _tidy(reply.param_value)


def any_message(_message: Message) -> bool:
    """Accept every message."""
    return True


def _tidy(value: Any) -> float:
    """Return a parameter as its decimal digits say, not as the single precision nearest to them."""
    return float(f"{value:.7g}")

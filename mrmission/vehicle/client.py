"""The project's own MAVLink client: one autopilot behind a link, packed and parsed by pymavlink.

Everything runs in one asyncio loop; nothing blocks it. Messages that nobody listens for are kept
as they came, the last one of each kind, and decoded only when somebody looks at them.
"""

from __future__ import annotations

import asyncio
import contextlib
from collections import deque
from collections.abc import AsyncIterator, Callable, Iterator, Sequence
from types import ModuleType
from typing import Any

from mrmission.errors import LinkTimeoutError, VehicleError
from mrmission.options import VehicleLimits
from mrmission.vehicle.connection import Connection
from mrmission.vehicle.framing import (
    AUTOPILOT_COMPONENT_ID,
    Frame,
    Message,
    Signing,
    mavlink,
    message_number,
)
from mrmission.vehicle.items import MissionType
from mrmission.vehicle.links import (
    ARMED_FLAG,
    GCS_COMPONENT_ID,
    GCS_SYSTEM_ID,
    MOST_ITEMS,
    NO_SPACE,
    ROOM_TEXT_S,
    ROOM_TRIES,
    FleetLinks,
    LinkTimeouts,
    items_supported,
    mode_name,
    sd_limits,
)
from mrmission.vehicle.station import Link

POLL_S = 0.02
PARAMETERS_AT_ONCE = 8
PARAMETER_TRIES = 4
PARAMETER_REPLY_S = 0.4
COUNT_TRIES = 8
TWIN_ROUNDS = 5
POSITION_S = 3.0
QUEUE_MOST = 10_000
_TEXT_BYTES = 50

_HEARTBEAT = mavlink.MAVLINK_MSG_ID_HEARTBEAT
_STATUSTEXT = mavlink.MAVLINK_MSG_ID_STATUSTEXT

MessageQueue = asyncio.Queue[Message]


class Vehicle:
    """One autopilot: its messages, parameters, commands, and its three stores.

    Made by `open_links`. Nothing here arms, disarms, or changes a mode by itself.

    Examples
    --------
    ::

        async with open_links(parse_connections(["tcp:127.0.0.1:5760"]), expected=1,
                              timeouts=LinkTimeouts()) as fleet:
            boat = fleet.vehicles[1]
            await boat.wait_heartbeat()
            print(boat.mode, boat.armed, boat.position_lonlat(), boat.gps_fix)
            values = await boat.parameters(["WP_SPEED", "WP_RADIUS"])   # None where it has none
            await boat.set_parameter("WP_SPEED", 2.0)
            await boat.stream("GLOBAL_POSITION_INT", 5.0)
            await boat.command(boat.mav.MAV_CMD_DO_SET_MODE, 1, 4)       # 0: MAV_RESULT_ACCEPTED
            with boat.listen("GLOBAL_POSITION_INT", "MISSION_ITEM_REACHED") as queue:
                message = await asyncio.wait_for(queue.get(), 5.0)
                print(message.get_type(), message.to_dict())
            boat.send(boat.mav.MAVLink_mission_set_current_message(boat.system_id, 1, 3))
    """

    mav: ModuleType = mavlink
    """pymavlink's dialect: constants, and the message classes that `send` takes."""

    def __init__(
        self, link: Link, system_id: int, connection: Connection, timeouts: LinkTimeouts
    ) -> None:
        self.link = link
        self.system_id = system_id
        self.connection = connection
        self._timeouts = timeouts
        self._loop = asyncio.get_running_loop()
        self._queues: dict[int, set[MessageQueue]] = {}
        self._latest: dict[int, tuple[float, Frame | Message]] = {}
        self._texts: deque[str] = deque(maxlen=20)
        self._long_text: tuple[int, str] = (0, "")
        self._armed: bool | None = None
        self._mode = ""
        self._type = 0
        self.autopilot = 0
        """MAV_AUTOPILOT of the last heartbeat."""
        self._heard_s = self._loop.time()
        self.rival: int | None = None
        """System id of another ground station to which this vehicle last spoke of a transfer."""

    def __repr__(self) -> str:
        return f"Vehicle(system_id={self.system_id}, link={self.connection.url!r})"

    def where(self) -> str:
        """Return what messages call this vehicle."""
        return f"vehicle {self.system_id} on {self.connection.url}"

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
        message = self.link.codec.decode(frame)
        if message is None:
            return
        if number == _HEARTBEAT:
            self._armed = bool(message.base_mode & ARMED_FLAG)
            self._type = int(message.type)
            self.autopilot = int(message.autopilot)
            self._mode = mode_name(self._type, int(message.custom_mode))
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
        text = str(message.text)
        number = int(getattr(message, "id", 0))
        if number:
            before = self._long_text[1] if self._long_text[0] == number else ""
            joined = before + text
            if before and self._texts and self._texts[-1] == before:
                self._texts.pop()
            self._long_text = (number, joined)
            text = joined
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

        reply = await self._request(ask, name, _any_message, timeout_s=timeout_s)
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
                    reply = await self._next(queue, lambda m: m.command == command_id, left_s)
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

    async def _next(
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

    async def _request(
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
                reply = await self._next(queue, accept, min(again_s, left_s))
                if reply is not None:
                    return reply
        return None

    # --- state -----------------------------------------------------------------------------------

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

    async def autopilot_version(self) -> Message:
        """Return AUTOPILOT_VERSION.

        Raises
        ------
        LinkTimeoutError
            When the vehicle does not send it.
        """
        return await self.message("AUTOPILOT_VERSION")

    async def stored_count(self, mission_type: MissionType) -> int:
        """Return how many items a store holds, home included.

        Raises
        ------
        LinkTimeoutError
            When the vehicle does not answer.
        """
        reply = await self._request(
            lambda: self._request_list(mission_type),
            "MISSION_COUNT",
            lambda m: m.mission_type == mission_type,
            timeout_s=COUNT_TRIES * self._timeouts.reply_s,
        )
        if reply is None:
            raise LinkTimeoutError(
                f"{self.where()}: does not say what its {mission_type.label} holds"
            )
        return int(reply.count)

    def _request_list(self, mission_type: MissionType) -> None:
        self.send(
            mavlink.MAVLink_mission_request_list_message(
                self.system_id, AUTOPILOT_COMPONENT_ID, int(mission_type)
            )
        )

    async def twins(self) -> bool:
        """Return whether two vehicles answer to this system id on this one link.

        They do when its heartbeats come from two addresses; or when a request is answered twice,
        round after round: a packet that was doubled on the way is doubled now and then only.
        """
        if self.link.addresses(self.system_id) > 1:
            return True
        with self.listen("MISSION_COUNT") as queue:
            for _ in range(TWIN_ROUNDS):
                self._request_list(MissionType.MISSION)
                first = await self._next(queue, _any_message, self._timeouts.reply_s)
                if first is None:
                    return False
                other = _other_than(first)
                if await self._next(queue, other, self._timeouts.twin_window_s) is None:
                    return False
        return True

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
                        reply = await self._next(
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

        reply = await self._request(
            ask,
            "PARAM_VALUE",
            confirms,
            timeout_s=PARAMETER_TRIES * self._timeouts.reply_s,
        )
        if reply is None:
            says = f"says {told[-1]:g}" if told else "does not confirm it (no such parameter?)"
            raise VehicleError(f"{self.where()}: {name} set to {value:g}, and it {says}")
        return _tidy(reply.param_value)

    async def room(self, mission_type: MissionType) -> int | None:
        """Return how many items a store takes at most, None where the vehicle does not tell.

        ArduPilot refuses a list that is longer than the store before it touches what is there, and
        says how long a list may be. So it is asked with a list that no store holds. Others are not
        asked.
        """
        if self.autopilot != mavlink.MAV_AUTOPILOT_ARDUPILOTMEGA:
            return None
        with self.listen("MISSION_ACK", "STATUSTEXT") as queue:
            for _ in range(ROOM_TRIES):
                self.forget_status_texts()
                self.send(
                    mavlink.MAVLink_mission_count_message(
                        self.system_id, AUTOPILOT_COMPONENT_ID, MOST_ITEMS, int(mission_type)
                    )
                )
                reply = await self._next(
                    queue,
                    lambda m: m.get_type() == "MISSION_ACK" and m.mission_type == mission_type,
                    self._timeouts.reply_s,
                )
                if reply is not None and reply.type != NO_SPACE:
                    return None
                if reply is not None and items_supported(self._texts) is None:
                    await self._next(
                        queue, lambda m: items_supported(self._texts) is not None, ROOM_TEXT_S
                    )
                found = items_supported(self._texts)
                if found is not None:
                    return found
        return None

    async def position(self) -> tuple[float, float] | None:
        """Return where the vehicle is, lon and lat in degrees; None without a position."""
        with contextlib.suppress(LinkTimeoutError):
            await self.message("GLOBAL_POSITION_INT", POSITION_S)
        return self.position_lonlat()

    async def limits(self, default: VehicleLimits) -> VehicleLimits:
        """Return what the vehicle can hold: `default`, or more where it stores on an SD card."""
        told = await self.parameters(["BRD_SD_MISSION", "BRD_SD_FENCE"])
        return sd_limits(
            default,
            mission_kib=told["BRD_SD_MISSION"] or 0.0,
            fence_kib=told["BRD_SD_FENCE"] or 0.0,
        )


def _any_message(_message: Message) -> bool:
    return True


def _other_than(first: Message) -> Callable[[Message], bool]:
    """Return what tells another packet from one that the link has doubled."""
    data = bytes(first.get_msgbuf())
    return lambda message: bytes(message.get_msgbuf()) != data


def _tidy(value: Any) -> float:
    """Return a parameter as its decimal digits say, not as the single precision nearest to them."""
    return float(f"{value:.7g}")


@contextlib.asynccontextmanager
async def open_links(
    connections: Sequence[Connection],
    *,
    expected: int,
    timeouts: LinkTimeouts,
    patient: bool = True,
    signing: Signing | None = None,
) -> AsyncIterator[FleetLinks[Vehicle]]:
    """Open links, find the vehicles on them, close everything afterwards.

    Parameters
    ----------
    connections
        Links to open; any number.
    expected
        How many vehicles are wanted; waiting ends early when every link has spoken and as many
        are there.
    timeouts
        How long to wait.
    patient
        Whether to keep trying a TCP port that refuses for a moment: yes for links that the user
        named, no for default ports, most of which may rightly be closed.
    signing
        Key of the links, where they are signed; links get numbers of their own.

    Yields
    ------
    FleetLinks
        What was found; perhaps nothing.

    Raises
    ------
    VehicleError
        When two vehicles have one system id. Nothing has been sent then but heartbeats.
    """
    from mrmission.vehicle.discovery import discover

    async with discover(
        connections, Vehicle, expected=expected, timeouts=timeouts, patient=patient, signing=signing
    ) as found:
        yield found

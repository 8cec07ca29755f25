"""One way to try a boat, whatever it is: the light one in this process, or an ArduRover on TCP.

A :class:`Trial` is a ground station with a clock that runs on the water: the light boat is driven
message by message on a virtual clock, ArduRover's SITL by the time stamps of its own messages, so
a test reads the same for both and does not depend on how fast the machine is.
"""

from __future__ import annotations

import math
import socket
import time
from collections import deque
from collections.abc import Callable, Iterator, Sequence
from typing import Any

from sim_client import LAT, LON

from mrmission.simulate.motion import offset_m
from mrmission.simulate.storage import Item
from mrmission.simulate.vehicle import SimVehicle, VehicleSetup
from mrmission.simulate.wire import Codec, mavlink

MISSION, FENCE, RALLY = 0, 1, 2
MANUAL, HOLD, LOITER, AUTO, RTL, SMART_RTL, GUIDED = 0, 4, 5, 10, 11, 12, 15
ACCEPTED = mavlink.MAV_RESULT_ACCEPTED
ARM = mavlink.MAV_CMD_COMPONENT_ARM_DISARM
STATION, OTHER = 250, 251
"""System ids of the two ground stations of a trial."""

Message = Any
Predicate = Callable[[Message], bool]


class Trial:
    """A boat on trial; subclasses carry bytes to it and its clock.

    Attributes
    ----------
    engine : str
        ``"light"`` or ``"ardupilot"``.
    heard : list
        Everything received, in order.
    """

    engine = ""

    def __init__(self, system_id: int = 1) -> None:
        self.system_id = system_id
        self.heard: list[Message] = []
        self._codecs = {who: Codec(who, 190) for who in (STATION, OTHER)}

    # --- what subclasses do ---

    @property
    def now_s(self) -> float:
        """Seconds on the water since the boat was started."""
        raise NotImplementedError

    def send(self, message: Message, *, who: int = STATION) -> None:
        """Send one message as station `who`."""
        raise NotImplementedError

    def listen(self, seconds: float) -> Iterator[Message]:
        """Yield what is heard within `seconds` on the water."""
        raise NotImplementedError

    # --- listening ---

    def wait(self, seconds: float) -> list[Message]:
        """Let time pass; return what was heard."""
        return list(self.listen(seconds))

    def first(self, wanted: str | Predicate, seconds: float) -> Message | None:
        """Return the first message of a type (or that fulfils a predicate), None if none comes."""
        for message in self.listen(seconds):
            if message.get_type() == wanted if isinstance(wanted, str) else wanted(message):
                return message
        return None

    def texts(self) -> list[str]:
        """Return all status texts heard, the pieces of long ones joined."""
        texts: list[str] = []
        for m in self.heard:
            if m.get_type() == "STATUSTEXT":
                if getattr(m, "id", 0) and getattr(m, "chunk_seq", 0) and texts:
                    texts[-1] += m.text
                else:
                    texts.append(m.text)
        return texts

    def said(self, part: str) -> bool:
        """Return whether a status text contained `part`."""
        return any(part in text for text in self.texts())

    def until_said(self, part: str, seconds: float) -> bool:
        """Wait for a status text that contains `part`."""
        return self.first(
            lambda m: m.get_type() == "STATUSTEXT" and self.said(part), seconds
        ) is not None or self.said(part)  # fmt: skip

    def forget(self) -> None:
        """Forget what was heard."""
        self.heard.clear()

    # --- parameters and commands ---

    def get(self, name: str) -> float | None:
        """Return a parameter's value, None where the boat has no such parameter."""
        for _ in range(4):
            self.send(mavlink.MAVLink_param_request_read_message(
                self.system_id, 1, name.encode(), -1))  # fmt: skip
            m = self.first(lambda m: _is_parameter(m, name), 1.0)
            if m is not None:
                return float(m.param_value)
        return None

    def set(self, **values: float) -> None:
        """Set parameters and make sure of each."""
        for name, value in values.items():
            for _ in range(4):
                self.send(mavlink.MAVLink_param_set_message(
                    self.system_id, 1, name.encode(), value, 9))  # fmt: skip
                m = self.first(lambda m, name=name: _is_parameter(m, name), 1.0)  # type: ignore[misc]
                if m is not None and math.isclose(m.param_value, value, rel_tol=1e-5, abs_tol=1e-6):
                    break
            else:
                raise AssertionError(f"{name} could not be set to {value}")

    def command(self, number: int, *params: float, who: int = STATION) -> int:
        """Send COMMAND_LONG until answered; return the result."""
        filled = [*params, *[0.0] * (7 - len(params))]
        for attempt in range(4):
            self.send(mavlink.MAVLink_command_long_message(
                self.system_id, 1, number, attempt, *filled), who=who)  # fmt: skip
            ack = self.first(lambda m: m.get_type() == "COMMAND_ACK" and m.command == number, 2.0)
            if ack is not None:
                return int(ack.result)
        raise AssertionError(f"no answer to command {number}")

    def change_mode(self, mode: int) -> int:
        """Ask for a mode; return the result."""
        return self.command(mavlink.MAV_CMD_DO_SET_MODE, 1, mode)

    def greet(self) -> None:
        """Wait until the boat answers."""

    def reboot(self) -> None:
        """Restart the autopilot, and wait until it talks again."""
        raise NotImplementedError

    # --- the mission protocol ---

    def count_message(self, count: int, kind: int = MISSION) -> Message:
        return mavlink.MAVLink_mission_count_message(self.system_id, 1, count, kind)

    def item_message(self, seq: int, item: Item, kind: int = MISSION, current: int = 0) -> Message:
        return mavlink.MAVLink_mission_item_int_message(
            self.system_id, 1, seq, item.frame, item.command, current, 1,
            item.param1, item.param2, item.param3, item.param4, item.x, item.y, item.z, kind,
        )  # fmt: skip

    def ack(self, kind: int, seconds: float = 2.0) -> int | None:
        """Return the next MISSION_ACK's result."""
        m = self.first(lambda m: m.get_type() == "MISSION_ACK" and m.mission_type == kind, seconds)
        return None if m is None else int(m.type)

    def upload(
        self, items: Sequence[Item], kind: int = MISSION, *, stop_at: int | None = None,
        who: int = STATION,
    ) -> int | None:  # fmt: skip
        """Upload and return the result; None after falling silent when `stop_at` is asked for.

        Starts over where a busy machine has made the boat or the station miss a turn.
        """
        for _ in range(3):
            result = self._upload(items, kind, stop_at, who)
            if result is None and stop_at is not None:
                return None
            if result not in (None, mavlink.MAV_MISSION_OPERATION_CANCELLED):
                return result
        raise AssertionError("the boat fell silent in an upload")

    def _upload(
        self, items: Sequence[Item], kind: int, stop_at: int | None, who: int
    ) -> int | None:
        self.send(self.count_message(len(items), kind), who=who)
        for _ in range(3 * len(items) + 30):
            m = self.first(
                lambda m: (
                    getattr(m, "mission_type", None) == kind
                    and m.get_type() in ("MISSION_REQUEST", "MISSION_REQUEST_INT", "MISSION_ACK")
                ),
                3.0,
            )
            if m is None:
                return None
            if m.get_type() == "MISSION_ACK":
                # A busy machine makes duplicates, which do not end a transfer.
                if m.type == mavlink.MAV_MISSION_INVALID_SEQUENCE:
                    continue
                return int(m.type)
            if m.seq == stop_at:
                return None
            self.send(self.item_message(m.seq, items[m.seq], kind), who=who)
        raise AssertionError("an upload does not end")

    def stored_count(self, kind: int = MISSION) -> int:
        """Return how many items the boat says it has; -result where it refuses."""
        self.send(mavlink.MAVLink_mission_request_list_message(self.system_id, 1, kind))
        m = self.first(
            lambda m: (
                getattr(m, "mission_type", None) == kind
                and m.get_type() in ("MISSION_COUNT", "MISSION_ACK")
            ),
            3.0,
        )
        if m is None:
            raise AssertionError("no MISSION_COUNT")
        return int(m.count) if m.get_type() == "MISSION_COUNT" else -int(m.type)

    def stored(self, kind: int = MISSION) -> list[Message]:
        """Download and return the MISSION_ITEM_INT messages."""
        items = []
        for seq in range(self.stored_count(kind)):
            for _ in range(4):
                self.send(mavlink.MAVLink_mission_request_int_message(
                    self.system_id, 1, seq, kind))  # fmt: skip
                m = self.first(
                    lambda m, seq=seq: m.get_type() == "MISSION_ITEM_INT"  # type: ignore[misc]
                    and m.mission_type == kind and m.seq == seq,
                    1.0,
                )  # fmt: skip
                if m is not None:
                    items.append(m)
                    break
            else:
                raise AssertionError(f"item {seq} does not come")
        return items

    def clear(self, kind: int = MISSION) -> int | None:
        """Clear a list; return the result."""
        self.send(mavlink.MAVLink_mission_clear_all_message(self.system_id, 1, kind))
        return self.ack(kind)

    # --- on the water ---

    def last(self, kind: str, seconds: float = 2.0) -> Message:
        """Return the next message of a streamed type."""
        m = self.first(kind, seconds)
        assert m is not None, f"no {kind}"
        return m

    def place(self) -> tuple[float, float]:
        """Return metres east and north of the test home, now."""
        m = self.last("GLOBAL_POSITION_INT")
        return offset_m(LAT, LON, m.lat * 1e-7, m.lon * 1e-7)

    def speed_m_s(self) -> float:
        """Return the speed over ground, now."""
        m = self.last("GLOBAL_POSITION_INT")
        return math.hypot(m.vx, m.vy) * 0.01

    def mode(self) -> int:
        """Return the mode, now."""
        return int(self.last("HEARTBEAT").custom_mode)

    def armed(self) -> bool:
        """Return whether the boat is armed, now."""
        return bool(self.last("HEARTBEAT").base_mode & mavlink.MAV_MODE_FLAG_SAFETY_ARMED)

    def current(self) -> int:
        """Return the number of the mission item under way, now."""
        return int(self.last("MISSION_CURRENT").seq)

    def track(self, seconds: float) -> list[tuple[float, float, float]]:
        """Return (time, east, north) for so long."""
        return [
            (m.time_boot_ms * 1e-3, *offset_m(LAT, LON, m.lat * 1e-7, m.lon * 1e-7))
            for m in self.listen(seconds)
            if m.get_type() == "GLOBAL_POSITION_INT"
        ]

    def reached(self) -> list[int]:
        """Return the numbers of the items that the boat reported as reached."""
        return [m.seq for m in self.heard if m.get_type() == "MISSION_ITEM_REACHED"]

    def until_reached(self, seq: int, seconds: float) -> float:
        """Wait until item `seq` is reported as reached, or was; return the time on the water."""
        if seq in self.reached():
            return self.now_s
        m = self.first(lambda m: m.get_type() == "MISSION_ITEM_REACHED" and m.seq == seq, seconds)
        assert m is not None, f"item {seq} not reached in {seconds} s; said {self.texts()}"
        return self.now_s

    def arm(self, seconds: float = 90.0) -> None:
        """Arm, again and again until the boat is ready."""
        self._patiently(lambda: self.command(ARM, 1), "arm", seconds)

    def start(self, seconds: float = 60.0) -> None:
        """Change from HOLD to AUTO, again and again until the boat is ready."""
        assert self.change_mode(HOLD) == ACCEPTED
        self._patiently(lambda: self.change_mode(AUTO), "start", seconds)

    def sail(self, items: Sequence[Item]) -> None:
        """Upload items behind a home row, arm and start."""
        assert self.upload([home(), *items]) == 0
        self.arm()
        self.start()
        self.forget()

    def _patiently(self, attempt: Callable[[], int], what: str, seconds: float) -> None:
        end_s = self.now_s + seconds
        while True:
            if attempt() == ACCEPTED:
                return
            if self.now_s > end_s:
                raise AssertionError(f"boat does not {what}: {self.texts()[-5:]}")
            self.wait(1.0)


def home() -> Item:
    """Return a home row."""
    return Item(16, 0, 0, 0, 0, 0, round(LAT * 1e7), round(LON * 1e7), 0.0)


def _is_parameter(m: Message, name: str) -> bool:
    return m.get_type() == "PARAM_VALUE" and m.param_id == name


WATCHED = {
    mavlink.MAVLINK_MSG_ID_GLOBAL_POSITION_INT: 0.2,
    mavlink.MAVLINK_MSG_ID_SYSTEM_TIME: 0.1,
    mavlink.MAVLINK_MSG_ID_MISSION_CURRENT: 0.5,
    mavlink.MAVLINK_MSG_ID_NAV_CONTROLLER_OUTPUT: 0.5,
    mavlink.MAVLINK_MSG_ID_SYS_STATUS: 1.0,
}
"""Message ids and intervals (seconds) that a trial asks for."""


class LightTrial(Trial):
    """A trial of the light boat on a virtual clock."""

    engine = "light"

    def __init__(self, **setup: Any) -> None:
        super().__init__(setup.get("system_id", 1))
        self.vehicle = SimVehicle(VehicleSetup(**{"lat": LAT, "lon": LON, **setup}))
        self._codec = Codec(self.system_id)
        self._inbox: deque[Message] = deque()
        self._now_s = 0.0
        self._arrive(self.vehicle.step(0.0))
        for number, interval_s in WATCHED.items():
            self.command(mavlink.MAV_CMD_SET_MESSAGE_INTERVAL, number, interval_s * 1e6)
        self.heard.clear()

    @property
    def now_s(self) -> float:
        return self._now_s

    def send(self, message: Message, *, who: int = STATION) -> None:
        for parsed in self._codec.decode(self._codecs[who].encode(message)):
            self._arrive(self.vehicle.handle(parsed))

    def listen(self, seconds: float) -> Iterator[Message]:
        end_s = self._now_s + seconds
        while True:
            while self._inbox:
                message = self._inbox.popleft()
                self.heard.append(message)
                yield message
            if self._now_s >= end_s - 1e-9:
                return
            self._now_s = min(end_s, self._now_s + 0.1)
            self._arrive(self.vehicle.step(self._now_s))

    def reboot(self) -> None:
        assert self.command(mavlink.MAV_CMD_PREFLIGHT_REBOOT_SHUTDOWN, 1) == ACCEPTED
        self.wait(1.0)

    def _arrive(self, out: Sequence[Any]) -> None:
        for item in out:
            self._inbox += self._codecs[STATION].decode(self._codec.encode(item.message))


class LinkTrial(Trial):
    """A trial over TCP of a boat that runs elsewhere.

    Parameters
    ----------
    port : int
        Where it listens on loopback.
    system_id : int
        Its system id.
    hasty : bool
        Do not wait until it has begun to answer: :meth:`greet` does.
    """

    engine = "ardupilot"

    def __init__(self, port: int, system_id: int = 1, *, hasty: bool = False) -> None:
        super().__init__(system_id)
        self._port = port
        self._boot_ms = 0
        self._greeted_s = -math.inf
        self._inbox: deque[Message] = deque()
        self._socket = _connected(port)
        if hasty:
            self.first("HEARTBEAT", 10.0)
        else:
            self.greet()
        self.heard.clear()

    def greet(self) -> None:
        """Ask for the streams that are watched, and wait until the time is known."""
        self.first("HEARTBEAT", 10.0)
        # Ten seconds' worth of every stream in one second keep a test from doing anything else.
        self.send(mavlink.MAVLink_request_data_stream_message(self.system_id, 1, 0, 0, 0))
        for number, interval_s in WATCHED.items():
            self.command(mavlink.MAV_CMD_SET_MESSAGE_INTERVAL, number, interval_s * 1e6)
        # Until a message with a stamp has come, no time is known.
        for _ in self.listen(0.0):
            pass

    @property
    def now_s(self) -> float:
        return self._boot_ms * 1e-3

    def close(self) -> None:
        """Close the connection."""
        self._socket.close()

    def reboot(self) -> None:
        assert self.command(mavlink.MAV_CMD_PREFLIGHT_REBOOT_SHUTDOWN, 1) == ACCEPTED
        self._socket.close()
        time.sleep(1.0)
        self._boot_ms = 0
        self._greeted_s = -math.inf
        self._socket = _connected(self._port)
        self.greet()

    def send(self, message: Message, *, who: int = STATION) -> None:
        self._socket.sendall(self._codecs[who].encode(message))

    def listen(self, seconds: float) -> Iterator[Message]:
        end_s = self.now_s + seconds
        stalled_s = time.monotonic() + 30.0
        while True:
            while self._inbox:
                message = self._inbox.popleft()
                if message.get_srcSystem() != self.system_id:
                    continue
                stamp = getattr(message, "time_boot_ms", None)
                if stamp and stamp > self._boot_ms:
                    # The first stamp sets the clock, it does not let time pass.
                    end_s += 0.0 if self._boot_ms else stamp * 1e-3
                    self._boot_ms = stamp
                    stalled_s = time.monotonic() + 30.0
                self.heard.append(message)
                yield message
            if self._boot_ms and self.now_s >= end_s:
                return
            if time.monotonic() > stalled_s:
                raise AssertionError("the boat's clock stands still")
            if self.now_s - self._greeted_s > 1.0:
                self._greeted_s = self.now_s
                self.send(mavlink.MAVLink_heartbeat_message(6, 8, 0, 0, 0, 3))
            try:
                data = self._socket.recv(65536)
            except TimeoutError:
                continue
            if not data:
                raise AssertionError("the boat closed the connection")
            self._inbox += self._codecs[STATION].decode(data)


def _connected(port: int) -> socket.socket:
    end_s = time.monotonic() + 20.0
    while True:
        try:
            connection = socket.create_connection(("127.0.0.1", port), timeout=5.0)
        except OSError:
            if time.monotonic() > end_s:
                raise
            time.sleep(0.2)
        else:
            connection.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
            return connection

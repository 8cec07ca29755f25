"""Waiting until an ArduPilot in SITL can be armed and started, over its second link.

A vehicle says that it is ready in two places: the pre-arm bit of SYS_STATUS (all checks passed)
and the flags of EKF_STATUS_REPORT (an absolute position). Rover passes its checks some twenty
simulated seconds before it has the position that AUTO needs, so both count.
"""

from __future__ import annotations

import asyncio
import contextlib
from collections.abc import AsyncIterator, Callable, Mapping
from contextlib import asynccontextmanager
from dataclasses import dataclass

from mrmission.errors import ConfigError, SimulatorError
from mrmission.simulate.wire import Codec, Message, mavlink

HOST = "127.0.0.1"
STATION_ID, STATION_COMPONENT = 250, 190
HEARTBEAT_S = 1.0
ASK_S = 0.5
PREARM_BIT = mavlink.MAV_SYS_STATUS_PREARM_CHECK
POSITION_BIT = mavlink.EKF_POS_HORIZ_ABS
INTERVAL_US = 200_000
WATCHED = (
    mavlink.MAVLINK_MSG_ID_SYS_STATUS,
    mavlink.MAVLINK_MSG_ID_GPS_RAW_INT,
    mavlink.MAVLINK_MSG_ID_EKF_STATUS_REPORT,
)
ROVER_HOLD = 4
FIX_3D = 3


@dataclass(slots=True)
class Readiness:
    """What a vehicle has shown so far; each step is reported once."""

    mode: int | None = None
    fix: bool = False
    checks: bool = False
    position: bool = False
    reason: str = ""

    def step(self, wanted_mode: int | None) -> str:
        """Return the first thing that is still missing, or "ready"."""
        if self.mode is None:
            return "no heartbeat"
        if not self.fix:
            return "no GPS position"
        if not self.checks:
            return "checks before arming not passed"
        if not self.position:
            return "position estimate not settled"
        if wanted_mode is not None and self.mode != wanted_mode:
            return "not in HOLD"
        return "ready"


class Station:
    """A ground station with one vehicle: just enough to see it ready and read parameters."""

    def __init__(
        self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter, system_id: int
    ) -> None:
        self._reader = reader
        self._writer = writer
        self._codec = Codec(STATION_ID, STATION_COMPONENT)
        self.system_id = system_id

    def send(self, message: Message) -> None:
        """Send one message."""
        self._writer.write(self._codec.encode(message))

    def heartbeat(self) -> None:
        """Send a ground station's heartbeat."""
        self.send(
            mavlink.MAVLink_heartbeat_message(
                mavlink.MAV_TYPE_GCS, mavlink.MAV_AUTOPILOT_INVALID, 0, 0, 0, 3
            )
        )

    def command(self, number: int, *params: float) -> None:
        """Send a command to the autopilot."""
        values = (*params, *(0.0,) * (7 - len(params)))
        self.send(
            mavlink.MAVLink_command_long_message(
                self.system_id, mavlink.MAV_COMP_ID_AUTOPILOT1, number, 0, *values
            )
        )

    async def messages(self, within_s: float) -> list[Message]:
        """Return what arrives next from the vehicle, or nothing when `within_s` passes first.

        Raises
        ------
        ConnectionError
            When the vehicle closed the link.
        """
        try:
            data = await asyncio.wait_for(self._reader.read(4096), within_s)
        except TimeoutError:
            return []
        if not data:
            raise ConnectionResetError("the vehicle closed its link")
        return [m for m in self._codec.decode(data) if m.get_srcSystem() == self.system_id]


@asynccontextmanager
async def station(port: int, system_id: int) -> AsyncIterator[Station]:
    """Connect to a vehicle's TCP port, trying until it listens; close the link at the end."""
    while True:
        try:
            reader, writer = await asyncio.open_connection(HOST, port)
            break
        except OSError:
            await asyncio.sleep(0.05)
    try:
        yield Station(reader, writer, system_id)
    finally:
        writer.transport.abort()
        with contextlib.suppress(OSError):
            await writer.wait_closed()


async def wait_ready(
    port: int,
    system_id: int,
    *,
    hold: bool,
    state: Readiness,
    progress: Callable[[str], None] | None = None,
) -> None:
    """Wait until the vehicle behind a TCP port can be armed and can start a mission.

    Parameters
    ----------
    port : int
        Its TCP port; free again afterwards.
    system_id : int
        Its MAVLink system id.
    hold : bool
        Put it in HOLD: from MANUAL, Rover lets a ground station go nowhere else.
    state : Readiness
        Filled as the vehicle comes up, so that a caller who gives up can say what was missing.
    progress : callable, optional
        Called with the state whenever it changes.
    """
    wanted = ROVER_HOLD if hold else None
    loop = asyncio.get_running_loop()
    async with station(port, system_id) as link:
        heartbeat_s = asked_s = -1e9
        told = ""
        while True:
            now_s = loop.time()
            if now_s - heartbeat_s >= HEARTBEAT_S:
                link.heartbeat()
                heartbeat_s = now_s
            if state.mode is not None and now_s - asked_s >= ASK_S:
                for message_id in WATCHED:
                    link.command(mavlink.MAV_CMD_SET_MESSAGE_INTERVAL, message_id, INTERVAL_US)
                if wanted is not None and state.mode != wanted:
                    link.command(
                        mavlink.MAV_CMD_DO_SET_MODE,
                        mavlink.MAV_MODE_FLAG_CUSTOM_MODE_ENABLED,
                        wanted,
                    )
                asked_s = now_s
            for message in await link.messages(0.2):
                _take(message, state)
            step = state.step(wanted)
            if step != told and progress is not None:
                progress(step)
            told = step
            if step == "ready":
                return


def _take(message: Message, state: Readiness) -> None:
    kind = message.get_type()
    if kind == "HEARTBEAT" and message.get_srcComponent() == mavlink.MAV_COMP_ID_AUTOPILOT1:
        state.mode = int(message.custom_mode)
    elif kind == "GPS_RAW_INT":
        state.fix = message.fix_type >= FIX_3D
    elif kind == "SYS_STATUS":
        state.checks = bool(message.onboard_control_sensors_health & PREARM_BIT)
    elif kind == "EKF_STATUS_REPORT":
        state.position = bool(message.flags & POSITION_BIT)
    elif kind == "STATUSTEXT" and str(message.text).startswith("PreArm: "):
        state.reason = str(message.text).rstrip("\0").strip()


async def check_parameters(
    port: int, system_id: int, wanted: Mapping[str, float], within_s: float = 5.0
) -> None:
    """Read parameters back from a vehicle and refuse names it lacks and values it did not take.

    ArduPilot passes over a misspelt name in a parameter file without a word.

    Raises
    ------
    ConfigError
        When a name is unknown to the vehicle, or its value is another one.
    SimulatorError
        When the vehicle stops answering.
    """
    if not wanted:
        return
    missing = dict(wanted)
    loop = asyncio.get_running_loop()
    deadline_s = loop.time() + within_s
    answered = False
    async with station(port, system_id) as link:
        asked_s = -1e9
        while missing and loop.time() < deadline_s:
            if loop.time() - asked_s >= ASK_S:
                asked_s = loop.time()
                for name in missing:
                    link.send(
                        mavlink.MAVLink_param_request_read_message(
                            system_id, mavlink.MAV_COMP_ID_AUTOPILOT1, name.encode(), -1
                        )
                    )
            for message in await link.messages(0.2):
                kind = message.get_type()
                answered = answered or kind == "HEARTBEAT"
                if kind == "PARAM_ERROR" and _text(message.param_id) in missing:
                    raise ConfigError(
                        f"--param {_text(message.param_id)}: the vehicle has no such parameter"
                    )
                if kind != "PARAM_VALUE" or (name := _text(message.param_id)) not in missing:
                    continue
                value = missing.pop(name)
                if abs(message.param_value - value) > 1e-6 * max(1.0, abs(value)):
                    raise ConfigError(
                        f"--param {name}={value:g}: the vehicle has {message.param_value:g} instead"
                    )
    if missing and not answered:
        raise SimulatorError(f"vehicle {system_id}: no answer while its parameters were read")
    if missing:
        raise ConfigError(f"--param {', '.join(missing)}: the vehicle has no such parameter")


async def empty_stores(port: int, system_id: int, *, hold: bool, within_s: float = 15.0) -> None:
    """Disarm a vehicle, put it in HOLD if `hold`, and clear its mission, fence and rally points.

    Raises
    ------
    SimulatorError
        When it has not done so after `within_s`.
    """
    full = {
        mavlink.MAV_MISSION_TYPE_MISSION,
        mavlink.MAV_MISSION_TYPE_FENCE,
        mavlink.MAV_MISSION_TYPE_RALLY,
    }
    ready = False
    loop = asyncio.get_running_loop()
    deadline_s = loop.time() + within_s
    async with station(port, system_id) as link:
        asked_s = -1e9
        while (full or not ready) and loop.time() < deadline_s:
            if loop.time() - asked_s >= ASK_S:
                asked_s = loop.time()
                link.heartbeat()
                # 21196 disarms whatever the vehicle is doing.
                link.command(mavlink.MAV_CMD_COMPONENT_ARM_DISARM, 0, 21196)
                if hold:
                    link.command(
                        mavlink.MAV_CMD_DO_SET_MODE,
                        mavlink.MAV_MODE_FLAG_CUSTOM_MODE_ENABLED,
                        ROVER_HOLD,
                    )
                for kind in full:
                    link.send(
                        mavlink.MAVLink_mission_clear_all_message(
                            system_id, mavlink.MAV_COMP_ID_AUTOPILOT1, kind
                        )
                    )
            for message in await link.messages(0.2):
                if message.get_type() == "MISSION_ACK" and message.type == 0:
                    full.discard(message.mission_type)
                elif message.get_type() == "HEARTBEAT":
                    armed = message.base_mode & mavlink.MAV_MODE_FLAG_SAFETY_ARMED
                    ready = not armed and (not hold or message.custom_mode == ROVER_HOLD)
    if full or not ready:
        raise SimulatorError(f"vehicle {system_id}: not disarmed and empty after {within_s:g} s")


def _text(value: str | bytes) -> str:
    text = value.decode("ascii", "replace") if isinstance(value, bytes) else value
    return text.rstrip("\0")

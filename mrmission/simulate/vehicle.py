"""One simulated vehicle: MAVLink messages in, MAVLink messages out, and a clock that is told.

:class:`SimVehicle` opens no socket and reads no clock. The link's clock (`now_s`) drives what the
protocol times: streams, retries, time-outs. The boat's clock runs `speedup` times as fast and
drives what happens on the water, so a rehearsal at ten times the speed still talks to a ground
station in real time.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Hashable, Mapping
from dataclasses import dataclass, field

from mrmission.simulate import copter_parameters, telemetry
from mrmission.simulate.autopilot import Autopilot
from mrmission.simulate.commands import COMMANDS
from mrmission.simulate.copter import CopterPilot
from mrmission.simulate.copter_motion import Rotorcraft
from mrmission.simulate.motion import Boat, Kinematics
from mrmission.simulate.parameters import Parameters
from mrmission.simulate.storage import (
    COPTER_FENCE_BYTES,
    COPTER_MISSION_ITEMS,
    COPTER_RALLY_POINTS,
    Item,
)
from mrmission.simulate.stores import FenceStore, MissionStore, RallyStore
from mrmission.simulate.streams import Streams
from mrmission.simulate.transfer import Outbound, Peer, Transfer
from mrmission.simulate.wire import AUTOPILOT_COMPONENT, Message, mavlink

PARAMETERS_PER_STEP = 20
ROVER_PARAMETERS: Mapping[str, float] = {"FRAME_CLASS": 1, "MIS_DONE_BEHAVE": 0}
"""What a car differs in from a boat."""
TEXT_BYTES = 50
"""Length of a status text; longer ones are sent in pieces."""


@dataclass(frozen=True, slots=True, kw_only=True)
class VehicleSetup:
    """What one simulated vehicle starts with.

    Parameters
    ----------
    kind : str
        "boat", "rover" or "copter".
    system_id : int
        MAVLink system id, 1 to 255.
    lon, lat : float
        Where it floats at the start, degrees.
    heading_deg : float
        Clockwise from north.
    speedup : float
        Seconds that pass on the water per second of the link's clock.
    parameters : mapping of str to float
        Parameter values that differ from ArduPilot's defaults.
    ready_s : float
        Time on the water until the boat can navigate (ArduPilot in SITL: 42 s). It has a position
        after a quarter of it, can be armed in HOLD after half of it, and has no room for a mission
        in its first four seconds.
    kinematics : Kinematics
        How it moves.
    """

    kind: str = "boat"
    system_id: int = 1
    lon: float = 0.0
    lat: float = 0.0
    heading_deg: float = 0.0
    speedup: float = 1.0
    parameters: Mapping[str, float] = field(default_factory=dict)
    ready_s: float = 0.0
    kinematics: Kinematics = field(default_factory=Kinematics)


class SimVehicle:
    """A simulated ArduPilot boat.

    Parameters
    ----------
    setup : VehicleSetup
        What it starts with.

    Notes
    -----
    :meth:`handle` and :meth:`step` return :class:`~mrmission.simulate.transfer.Outbound` messages:
    replies carry the link that asked, broadcasts carry None.
    """

    def __init__(self, setup: VehicleSetup) -> None:
        self.setup = setup
        self.now_s: float | None = None
        self._out: list[Outbound] = []
        self._listing: dict[Hashable, int] = {}
        self._long_texts = 0
        changed = {**setup.parameters, "SYSID_THISMAV": setup.system_id}
        sd_kb = changed.get("BRD_SD_MISSION", 0), changed.get("BRD_SD_FENCE", 0)
        heading_rad = math.radians(setup.heading_deg)
        self.boat: Boat
        if setup.kind == "copter":
            self.parameters = Parameters(changed, copter_parameters.TABLE)
            self.mission = MissionStore(self._say, int(sd_kb[0]), COPTER_MISSION_ITEMS)
            self.fence = FenceStore(self._say, int(sd_kb[1]), COPTER_FENCE_BYTES)
            self.rally = RallyStore(COPTER_RALLY_POINTS)
            self.boat = Rotorcraft(setup.lat, setup.lon, heading_rad)
        else:
            usual = ROVER_PARAMETERS if setup.kind == "rover" else {}
            self.parameters = Parameters({**usual, **changed})
            self.mission = MissionStore(self._say, int(sd_kb[0]))
            self.fence = FenceStore(self._say, int(sd_kb[1]))
            self.rally = RallyStore()
            self.boat = Boat(setup.lat, setup.lon, heading_rad, setup.kinematics)
        self.autopilot = self._boot()
        self.origin = (setup.lat, setup.lon)
        self.transfers = {
            store.mission_type: Transfer(store, self._say, lambda: self.autopilot.current)
            for store in (self.mission, self.fence, self.rally)
        }
        self.streams = Streams(self.build, setup.speedup)

    @property
    def system_id(self) -> int:
        """The vehicle's MAVLink system id."""
        return self.setup.system_id

    # --- the two entrances ---

    def handle(self, message: Message, link: Hashable = 0) -> list[Outbound]:
        """Take one message from `link` and return what is sent because of it."""
        target = getattr(message, "target_system", 0)
        component = getattr(message, "target_component", 0)
        if target in (0, self.system_id) and component in (0, AUTOPILOT_COMPONENT):
            handler = _HANDLERS.get(message.get_msgId())
            if handler is not None:
                handler(
                    self, message, Peer(message.get_srcSystem(), message.get_srcComponent(), link)
                )
                self._collect()
        return self._flush()

    def step(self, now_s: float, *, telemetry: bool = True) -> list[Outbound]:
        """Let the link's clock advance to `now_s` and return what is sent meanwhile.

        Parameters
        ----------
        now_s : float
            The link's clock; must not go back.
        telemetry : bool
            False where nobody listens: streams are then not built.
        """
        if telemetry and self.now_s is not None and now_s > self.now_s:
            # A stream asked for keeps the boat's time, which may run many times faster.
            start_s, pieces = self.now_s, self.streams.pieces(now_s - self.now_s)
            for piece in range(1, pieces):
                self._advance(start_s + (now_s - start_s) * piece / pieces)
                self._stream()
        self._advance(now_s)
        for transfer in self.transfers.values():
            if transfer.receiving:
                transfer.tick(now_s)
                self._out += transfer.take()
        if self._listing:
            self._send_parameter_pages()
        if telemetry:
            self._stream()
        return self._flush()

    def _advance(self, now_s: float) -> None:
        if self.now_s is not None and now_s > self.now_s:
            self.autopilot.advance((now_s - self.now_s) * self.setup.speedup)
        self.now_s = now_s
        self._collect()

    def _stream(self) -> None:
        for message in self.streams.take(self.now_s or 0.0):
            self.send(message)

    def hello(self, link: Hashable) -> list[Outbound]:
        """Return what a newly connected `link` gets at once: a heartbeat."""
        return [Outbound(link, telemetry.heartbeat(self))]

    def reboot(self) -> None:
        """Restart the autopilot: disarmed, initial mode; mission, fence, parameters are kept."""
        self.boat.speed_m_s = 0.0
        self.autopilot = self._boot()

    def _boot(self) -> Autopilot:
        held = (self.parameters, self.mission, self.fence, self.rally, self.setup.ready_s)
        if isinstance(self.boat, Rotorcraft):
            return CopterPilot(self.boat, *held)
        return Autopilot(self.boat, *held)

    # --- sending ---

    def _flush(self) -> list[Outbound]:
        out, self._out = self._out, []
        return out

    def send(self, message: Message, link: Hashable | None = None) -> None:
        """Leave a message to be sent, on one link or (None) on all."""
        self._out.append(Outbound(link, message))

    def _say(self, severity: int, text: str) -> None:
        """Send a status text, a long one in numbered pieces."""
        data = text.encode("ascii")
        pieces = [data[i : i + TEXT_BYTES] for i in range(0, len(data), TEXT_BYTES)]
        if len(pieces) > 1:
            self._long_texts = self._long_texts % 0xFFFF + 1
        number = self._long_texts if len(pieces) > 1 else 0
        for index, piece in enumerate(pieces):
            self.send(mavlink.MAVLink_statustext_message(severity, piece, number, index))

    def _collect(self) -> None:
        """Turn the autopilot's events into messages."""
        events = self.autopilot.events
        if not events:
            return
        self.autopilot.events = []
        for kind, number, text in events:
            if kind == "text":
                self._say(number, text)
            elif kind == "reached":
                self.send(mavlink.MAVLink_mission_item_reached_message(number))
            elif kind == "shot":
                self.send(telemetry.camera_feedback(self, number))
            elif kind == "fence" and (status := telemetry.fence_status(self)) is not None:
                self.send(status)
            elif kind == "mode":
                self.send(telemetry.heartbeat(self))
            elif kind == "home" and self.now_s is not None:
                self.send(telemetry.home_position(self))

    def build(self, message_id: int) -> Message | None:
        """Build the message of a number, None where there is nothing to send."""
        builder = telemetry.BUILDERS.get(message_id)
        return None if builder is None else builder(self)

    # --- messages in ---

    def _on_ping(self, message: Message, peer: Peer) -> None:
        if message.target_system == 0 and message.target_component == 0:
            self.send(
                mavlink.MAVLink_ping_message(
                    message.time_usec, message.seq, peer.system_id, peer.component_id
                ),
                peer.link,
            )

    def _on_timesync(self, message: Message, peer: Peer) -> None:
        if message.tc1 == 0:
            now_ns = int((self.now_s or 0.0) * 1e9) + 1
            self.send(mavlink.MAVLink_timesync_message(now_ns, message.ts1), peer.link)

    def _on_set_mode(self, message: Message, peer: Peer) -> None:
        if message.base_mode & mavlink.MAV_MODE_FLAG_CUSTOM_MODE_ENABLED:
            self.autopilot.set_mode(message.custom_mode)

    def _on_set_position_target(self, message: Message, peer: Peer) -> None:
        if not message.type_mask & 0b11:
            self.autopilot.go_to(message.lat_int * 1e-7, message.lon_int * 1e-7)

    # --- mission protocol ---

    def _transfer(self, message: Message, peer: Peer) -> Transfer | None:
        transfer = self.transfers.get(message.mission_type)
        if transfer is None:
            self.send(
                mavlink.MAVLink_mission_ack_message(
                    peer.system_id,
                    peer.component_id,
                    mavlink.MAV_MISSION_UNSUPPORTED,
                    message.mission_type,
                ),
                peer.link,
            )
        return transfer

    def _on_mission(self, message: Message, peer: Peer) -> None:
        transfer = self._transfer(message, peer)
        if transfer is None:
            return
        now_s = self.now_s or 0.0
        kind = message.get_msgId()
        if kind == mavlink.MAVLINK_MSG_ID_MISSION_COUNT:
            transfer.on_count(message.count, peer, now_s)
        elif kind == mavlink.MAVLINK_MSG_ID_MISSION_WRITE_PARTIAL_LIST:
            transfer.on_write_partial(message.start_index, message.end_index, peer, now_s)
        elif kind == mavlink.MAVLINK_MSG_ID_MISSION_CLEAR_ALL:
            transfer.on_clear(peer)
        elif kind == mavlink.MAVLINK_MSG_ID_MISSION_REQUEST_LIST:
            transfer.on_request_list(peer)
        elif kind == mavlink.MAVLINK_MSG_ID_MISSION_REQUEST_INT:
            transfer.on_request(message.seq, peer, integer=True)
        else:
            transfer.on_request(message.seq, peer, integer=False)
        self._out += transfer.take()

    def _on_mission_item(self, message: Message, peer: Peer) -> None:
        integer = message.get_msgId() == mavlink.MAVLINK_MSG_ID_MISSION_ITEM_INT
        x, y = message.x, message.y
        if not integer:
            if not (math.isfinite(x) and math.isfinite(y)):
                x = y = 999.0
            x, y = round(x * 1e7), round(y * 1e7)
        if message.mission_type == mavlink.MAV_MISSION_TYPE_MISSION and message.current == 2:
            accepted = self.autopilot.go_to(x * 1e-7, y * 1e-7)
            result = mavlink.MAV_MISSION_ACCEPTED if accepted else mavlink.MAV_MISSION_ERROR
            self.send(
                mavlink.MAVLink_mission_ack_message(peer.system_id, peer.component_id, result),
                peer.link,
            )
            return
        transfer = self._transfer(message, peer)
        if transfer is None:
            return
        item = Item(
            message.command,
            message.frame,
            message.param1,
            message.param2,
            message.param3,
            message.param4,
            x,
            y,
            message.z,
        )
        transfer.on_item(message.seq, item, peer, self.now_s or 0.0, integer=integer)
        self._out += transfer.take()

    def _on_mission_set_current(self, message: Message, peer: Peer) -> None:
        if self.autopilot.set_current(message.seq):
            self.send(telemetry.mission_current(self, message.seq))

    # --- parameters ---

    def _param_value(self, name: str, index: int) -> Message:
        if name == "MIS_TOTAL":
            self.parameters.put(name, float(self.mission.count()))
        elif name == "RALLY_TOTAL":
            self.parameters.put(name, float(self.rally.count()))
        return mavlink.MAVLink_param_value_message(
            name.encode("ascii"),
            self.parameters[name],
            self.parameters.type_of(name),
            len(self.parameters),
            index,
        )

    def _on_param_request_list(self, message: Message, peer: Peer) -> None:
        self._listing[peer.link] = 0

    def _send_parameter_pages(self) -> None:
        names = self.parameters.names
        for link, start in list(self._listing.items()):
            for index in range(start, min(start + PARAMETERS_PER_STEP, len(names))):
                self.send(self._param_value(names[index], index), link)
            if start + PARAMETERS_PER_STEP >= len(names):
                del self._listing[link]
            else:
                self._listing[link] = start + PARAMETERS_PER_STEP

    def _on_param_request_read(self, message: Message, peer: Peer) -> None:
        index = message.param_index
        if index >= 0:
            if index < len(self.parameters):
                self.send(self._param_value(self.parameters.names[index], index), peer.link)
            return
        name = _text(message.param_id)
        if name in self.parameters:
            self.send(self._param_value(name, 65535), peer.link)

    def _on_param_set(self, message: Message, peer: Peer) -> None:
        name = _text(message.param_id)
        if name not in self.parameters:
            return
        if not self.parameters.set(name, message.param_value):
            self._say(mavlink.MAV_SEVERITY_WARNING, f"Param write denied ({name})")
        self.send(self._param_value(name, 65535))

    # --- commands ---

    def _on_command(self, message: Message, peer: Peer) -> None:
        integer = message.get_msgId() == mavlink.MAVLINK_MSG_ID_COMMAND_INT
        command = message.command
        if integer:
            place = (message.x * 1e-7, message.y * 1e-7)
        else:
            place = (message.param5, message.param6)
        handler = COMMANDS.get(command)
        result = (
            mavlink.MAV_RESULT_UNSUPPORTED
            if handler is None
            else handler(self, message, peer, place)
        )
        self.send(
            mavlink.MAVLink_command_ack_message(
                command, result, 0, 0, peer.system_id, peer.component_id
            ),
            peer.link,
        )


def _text(value: str | bytes) -> str:
    text = value.decode("ascii", "replace") if isinstance(value, bytes) else value
    return text.split("\0", 1)[0]


_Handler = Callable[[SimVehicle, Message, Peer], None]
_HANDLERS: dict[int, _Handler] = {
    mavlink.MAVLINK_MSG_ID_PING: SimVehicle._on_ping,
    mavlink.MAVLINK_MSG_ID_TIMESYNC: SimVehicle._on_timesync,
    mavlink.MAVLINK_MSG_ID_SET_MODE: SimVehicle._on_set_mode,
    mavlink.MAVLINK_MSG_ID_SET_POSITION_TARGET_GLOBAL_INT: SimVehicle._on_set_position_target,
    mavlink.MAVLINK_MSG_ID_PARAM_REQUEST_LIST: SimVehicle._on_param_request_list,
    mavlink.MAVLINK_MSG_ID_PARAM_REQUEST_READ: SimVehicle._on_param_request_read,
    mavlink.MAVLINK_MSG_ID_PARAM_SET: SimVehicle._on_param_set,
    mavlink.MAVLINK_MSG_ID_MISSION_COUNT: SimVehicle._on_mission,
    mavlink.MAVLINK_MSG_ID_MISSION_WRITE_PARTIAL_LIST: SimVehicle._on_mission,
    mavlink.MAVLINK_MSG_ID_MISSION_CLEAR_ALL: SimVehicle._on_mission,
    mavlink.MAVLINK_MSG_ID_MISSION_REQUEST_LIST: SimVehicle._on_mission,
    mavlink.MAVLINK_MSG_ID_MISSION_REQUEST_INT: SimVehicle._on_mission,
    mavlink.MAVLINK_MSG_ID_MISSION_REQUEST: SimVehicle._on_mission,
    mavlink.MAVLINK_MSG_ID_MISSION_ITEM_INT: SimVehicle._on_mission_item,
    mavlink.MAVLINK_MSG_ID_MISSION_ITEM: SimVehicle._on_mission_item,
    mavlink.MAVLINK_MSG_ID_MISSION_SET_CURRENT: SimVehicle._on_mission_set_current,
    mavlink.MAVLINK_MSG_ID_COMMAND_LONG: SimVehicle._on_command,
    mavlink.MAVLINK_MSG_ID_COMMAND_INT: SimVehicle._on_command,
}

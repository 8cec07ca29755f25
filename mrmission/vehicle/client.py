"""The project's own MAVLink client: vehicles with their three stores, and how to find them.

Everything runs in one asyncio loop; nothing blocks it.
"""

from __future__ import annotations

import contextlib
from collections.abc import AsyncIterator, Callable, Sequence

from mrmission.errors import LinkTimeoutError
from mrmission.vehicle.connection import Connection
from mrmission.vehicle.framing import AUTOPILOT_COMPONENT_ID, Message, Signing, mavlink
from mrmission.vehicle.items import MissionType, RawItem
from mrmission.vehicle.links import (
    MOST_ITEMS,
    NO_SPACE,
    ROOM_TEXT_S,
    ROOM_TRIES,
    FleetLinks,
    LinkTimeouts,
    TransferError,
    items_supported,
)
from mrmission.vehicle.messages import Autopilot, any_message
from mrmission.vehicle.mission_protocol import Clear, Download, Upload
from mrmission.vehicle.mission_words import (
    CANCELLED,
    DENIED,
    ERROR,
    MOST_AHEAD,
    SUCCESS,
    TIMEOUT,
    UNCONFIRMED,
    RoundTrip,
)
from mrmission.vehicle.readback import compare_items
from mrmission.vehicle.station import Link
from mrmission.vehicle.transfer import run_machine

COUNT_TRIES = 8
TWIN_ROUNDS = 5
POSITION_S = 3.0


class Vehicle(Autopilot):
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

    def __init__(
        self, link: Link, system_id: int, connection: Connection, timeouts: LinkTimeouts
    ) -> None:
        super().__init__(link, system_id, connection, timeouts)
        self._round_trip = RoundTrip()

    async def stored_count(self, mission_type: MissionType) -> int:
        """Return how many items a store holds, home included.

        Raises
        ------
        LinkTimeoutError
            When the vehicle does not answer.
        """
        reply = await self.ask(
            lambda: self._request_list(mission_type),
            "MISSION_COUNT",
            lambda m: m.mission_type == mission_type,
            timeout_s=COUNT_TRIES * self._timeouts.reply_s,
        )
        if reply is None:
            raise LinkTimeoutError(
                f"{self.where()}: does not say what its {mission_type.label} holds{self._aside()}"
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
                first = await self.next_of(queue, any_message, self._timeouts.reply_s)
                if first is None:
                    return False
                other = _other_than(first)
                if await self.next_of(queue, other, self._timeouts.twin_window_s) is None:
                    return False
        return True

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
                reply = await self.next_of(
                    queue,
                    lambda m: m.get_type() == "MISSION_ACK" and m.mission_type == mission_type,
                    self._timeouts.reply_s,
                )
                if reply is not None and reply.type != NO_SPACE:
                    return None
                if reply is not None and items_supported(self._texts) is None:
                    await self.next_of(
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

    # --- stores ----------------------------------------------------------------------------------

    async def upload(
        self,
        mission_type: MissionType,
        items: Sequence[RawItem],
        progress: Callable[[float], None] | None = None,
    ) -> None:
        """Write `items` into a store: one try, in which lost packets are sent again.

        Parameters
        ----------
        mission_type
            Which store.
        items
            At least one; what is to be empty is cleared.
        progress
            Called with the share of the items that the vehicle has taken.

        Raises
        ------
        TransferError
            When the vehicle refuses or the transfer breaks off. The store then holds anything.
        """
        ardupilot = self.autopilot == mavlink.MAV_AUTOPILOT_ARDUPILOTMEGA
        machine = Upload(len(items), self._round_trip, MOST_AHEAD if ardupilot else 1)
        await run_machine(self, machine, mission_type, items, progress)
        if machine.result == UNCONFIRMED:
            stored = await self.download(mission_type)
            if not compare_items(items, stored, mission_type):
                return
            raise self._failed(f"upload of {mission_type.label}", TIMEOUT)
        if machine.result != SUCCESS:
            raise self._failed(f"upload of {mission_type.label}", str(machine.result))

    async def download(self, mission_type: MissionType) -> tuple[RawItem, ...]:
        """Read a store back.

        Raises
        ------
        TransferError
            When the vehicle refuses or the transfer breaks off.
        """
        machine = Download(self._round_trip)
        await run_machine(self, machine, mission_type)
        if machine.result != SUCCESS:
            raise self._failed(f"read-back of {mission_type.label}", str(machine.result))
        return machine.items

    async def clear(self, mission_type: MissionType) -> None:
        """Empty a store (a mission keeps its home), and see that it is empty.

        Raises
        ------
        TransferError
            When the vehicle refuses.
        LinkTimeoutError
            When it does not answer.
        """
        machine = Clear(mission_type, self._round_trip)
        await run_machine(self, machine, mission_type)
        if machine.result == TIMEOUT:
            raise LinkTimeoutError(
                f"{self.where()}: no answer to clearing its {mission_type.label}{self._aside()}"
            )
        if machine.result != SUCCESS:
            raise self._failed(f"clearing of {mission_type.label}", str(machine.result))

    def _failed(self, what: str, result: str) -> TransferError:
        aside = self._aside(_MEANING.get(result, ""))
        return TransferError(f"{self.where()}: {what} failed: {result}{aside}", result=result)

    def _aside(self, meaning: str = "") -> str:
        text = self._disturbance() or "; ".join(filter(None, (meaning, self.company())))
        return f" ({text})" if text else ""

    def _disturbance(self) -> str:
        """Return why nothing can go well on this link at present."""
        if self.rival is not None:
            return (
                f"ground station {self.rival} is transferring to this vehicle at the same time: "
                "let one program finish first"
            )
        if self.link.signed_heartbeats and not self.link.codec.signed:
            return "it signs its packets, and takes signed ones only: give --sign-key-file"
        return self.link.down

    def company(self) -> str:
        """Return in a line which other ground stations are on the link; nothing where none is."""
        others = ", ".join(map(str, self.link.stations()))
        return f"ground station {others} is on this link too" if others else ""


_MEANING = {
    DENIED: "it is busy with another program's transfer, or holds a broken one open for 8 s",
    ERROR: "it does not expect these items: it has restarted, or another program has taken over",
    CANCELLED: "it gave up waiting: too much is lost on the link",
    TIMEOUT: "no answer",
}


def _other_than(first: Message) -> Callable[[Message], bool]:
    """Return what tells another packet from one that the link has doubled."""
    data = bytes(first.get_msgbuf())
    return lambda message: bytes(message.get_msgbuf()) != data


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

"""A ground station without sockets, for tests of the simulated vehicle: pure, virtual clock."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

from mrmission.simulate.storage import INCLUSION, Item, fence_item
from mrmission.simulate.transport import Faults, FaultyChannel
from mrmission.simulate.vehicle import SimVehicle, VehicleSetup
from mrmission.simulate.wire import Codec, mavlink

MISSION, FENCE, RALLY = 0, 1, 2
LAT, LON = 47.3, 8.5


def waypoint(north_m: float, east_m: float, **changes: Any) -> Item:
    """A waypoint at so many metres from the test home."""
    lat = LAT + north_m / 111_319.5
    lon = LON + east_m / (111_319.5 * 0.678160)
    return Item(16, 3, 0, 0, 0, 0, round(lat * 1e7), round(lon * 1e7), 0.0)._replace(**changes)


HOME = Item(16, 0, 0, 0, 0, 0, round(LAT * 1e7), round(LON * 1e7), 0.0)


def polygon(points: int, command: int = INCLUSION) -> list[Item]:
    """A regular fence polygon of 100 m radius around the test home, as stored."""
    ring = [
        waypoint(100 * math.cos(2 * math.pi * i / points), 100 * math.sin(2 * math.pi * i / points))
        for i in range(points)
    ]
    return [fence_item(p._replace(command=command, param1=points)) for p in ring]


class Station:
    """Talks to one SimVehicle through bytes, with optional faults both ways."""

    def __init__(self, vehicle: SimVehicle | None = None, *, faults: Faults | None = None,
                 system_id: int = 250, component_id: int = 190, link: int = 0,
                 **setup: Any) -> None:  # fmt: skip
        if vehicle is None:
            vehicle = SimVehicle(VehicleSetup(**{"lat": LAT, "lon": LON, **setup}))
        self.vehicle = vehicle
        self.link = link
        self.now_s = vehicle.now_s or 0.0
        self._codec = Codec(system_id, component_id)
        self._vehicle_codec = Codec(vehicle.system_id)
        self._up = FaultyChannel[Any](faults or Faults(), 1)
        self._down = FaultyChannel[Any](faults or Faults(), 2)
        self.heard: list[Any] = []

    def send(self, message: Any) -> list[Any]:
        """Send one message and return (and keep) what comes back at once."""
        got = []
        for arrived in self._up.carry(self._codec.encode(message)):
            for parsed in self._vehicle_codec.decode(arrived):
                got += self._arrive(self.vehicle.handle(parsed, self.link))
        return got

    def wait(self, seconds: float, tick_s: float = 0.1) -> list[Any]:
        """Let time pass; return what was heard."""
        got = []
        end = self.now_s + seconds
        while self.now_s < end - 1e-9:
            self.now_s = min(end, self.now_s + tick_s)
            got += self._arrive(self.vehicle.step(self.now_s))
        return got

    def _arrive(self, out: list[Any]) -> list[Any]:
        got = []
        for item in out:
            if item.link is None or item.link == self.link:
                for data in self._down.carry(self._vehicle_codec.encode(item.message)):
                    got += self._codec.decode(data)
        self.heard += got
        return got

    # --- commands ---

    def command(self, number: int, *params: float) -> int:
        """Send COMMAND_LONG and return the result."""
        filled = [*params, *[0.0] * (7 - len(params))]
        got = self.send(mavlink.MAVLink_command_long_message(
            self.vehicle.system_id, 1, number, 0, *filled))  # fmt: skip
        acks = [m for m in got if m.get_type() == "COMMAND_ACK" and m.command == number]
        assert len(acks) == 1
        return int(acks[0].result)

    def texts(self) -> list[str]:
        return [m.text for m in self.heard if m.get_type() == "STATUSTEXT"]

    # --- mission protocol ---

    def item_message(self, seq: int, item: Item, kind: int = MISSION, current: int = 0) -> Any:
        return mavlink.MAVLink_mission_item_int_message(
            self.vehicle.system_id, 1, seq, item.frame, item.command, current, 1,
            item.param1, item.param2, item.param3, item.param4, item.x, item.y, item.z, kind,
        )  # fmt: skip

    def count_message(self, count: int, kind: int = MISSION) -> Any:
        return mavlink.MAVLink_mission_count_message(self.vehicle.system_id, 1, count, kind)

    def upload(self, items: Sequence[Item], kind: int = MISSION, *, retries: int = 12) -> int:
        """Upload with retries, as a patient station does; return the result (-1: gave up)."""
        return self._transfer_up(self.count_message(len(items), kind), items, kind, retries)

    def upload_part(self, first: int, items: Sequence[Item], kind: int = MISSION) -> int:
        last = first + len(items) - 1
        padded = [*[HOME] * first, *items]
        message = mavlink.MAVLink_mission_write_partial_list_message(
            self.vehicle.system_id, 1, first, last, kind)  # fmt: skip
        return self._transfer_up(message, padded, kind, 12)

    def _transfer_up(self, first: Any, items: Sequence[Item], kind: int, retries: int) -> int:
        last_sent = first
        inbox = self.send(first)
        silent = 0
        while silent <= retries:
            wanted = None
            for m in inbox:
                if getattr(m, "mission_type", None) != kind:
                    continue
                if m.get_type() == "MISSION_ACK":
                    # A duplicate that was answered so does not end the transfer.
                    if m.type != mavlink.MAV_MISSION_INVALID_SEQUENCE:
                        return int(m.type)
                elif m.get_type() in ("MISSION_REQUEST", "MISSION_REQUEST_INT"):
                    wanted = m.seq
            if wanted is not None:
                silent = 0
                last_sent = self.item_message(wanted, items[wanted], kind)
                inbox = self.send(last_sent)
            else:
                silent += 1
                inbox = self.wait(0.5)
                if not inbox or last_sent is first:
                    inbox += self.send(last_sent)
        return -1

    def download(self, kind: int = MISSION) -> list[Any] | int:
        """Download with retries; return the items, or the result of a refusal."""
        list_request = mavlink.MAVLink_mission_request_list_message(
            self.vehicle.system_id, 1, kind)  # fmt: skip
        count = self._ask(list_request, "MISSION_COUNT", kind, None)
        if isinstance(count, int):
            return count
        items: list[Any] = []
        for seq in range(count.count):
            request = mavlink.MAVLink_mission_request_int_message(
                self.vehicle.system_id, 1, seq, kind)  # fmt: skip
            item = self._ask(request, "MISSION_ITEM_INT", kind, seq)
            if isinstance(item, int):
                return item
            items.append(item)
        return items

    def _ask(self, message: Any, answer: str, kind: int, seq: int | None) -> Any:
        for _ in range(30):
            for m in [*self.send(message), *self.wait(0.1)]:
                if getattr(m, "mission_type", None) != kind:
                    continue
                if m.get_type() == answer and (seq is None or m.seq == seq):
                    return m
                if m.get_type() == "MISSION_ACK" and m.type != 0:
                    return int(m.type)
        return -1


def content(message: Any) -> Item:
    """The Item in a MISSION_ITEM_INT."""
    return Item(
        message.command, message.frame, message.param1, message.param2, message.param3,
        message.param4, message.x, message.y, message.z,
    )  # fmt: skip

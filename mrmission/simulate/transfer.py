"""The vehicle's side of the mission micro-protocol, once for mission, fence and rally points.

The machine is ArduPilot's: it asks for one item at a time, asks again after a second of silence and
gives up after eight, keeps the list locked meanwhile, answers an unexpected sequence number with
INVALID_SEQUENCE without ending the transfer, and writes mission and rally items as they come, so
that a transfer that breaks off leaves a mixture of old and new.
"""

from __future__ import annotations

from collections.abc import Callable, Hashable
from typing import NamedTuple

from mrmission.simulate.storage import Item, Refusal
from mrmission.simulate.stores import ItemStore, Say
from mrmission.simulate.wire import Message, mavlink

REQUEST_AGAIN_S = 1.0
GIVE_UP_S = 8.0

ACCEPTED = mavlink.MAV_MISSION_ACCEPTED
DENIED = mavlink.MAV_MISSION_DENIED
ERROR = mavlink.MAV_MISSION_ERROR
INVALID_SEQUENCE = mavlink.MAV_MISSION_INVALID_SEQUENCE

WARNING = mavlink.MAV_SEVERITY_WARNING


class Peer(NamedTuple):
    """Who talks: system and component id, and the link on which it was heard."""

    system_id: int
    component_id: int
    link: Hashable


class Outbound(NamedTuple):
    """A message to send; ``link`` is None where every link gets it."""

    link: Hashable | None
    message: Message


class Transfer:
    """The protocol machine of one mission type.

    Parameters
    ----------
    store : ItemStore
        The list that is read and written.
    say : callable
        Sends a status text: (severity, text).
    current : callable
        Number of the item that is being executed, for the ``current`` flag of a download.
    """

    def __init__(self, store: ItemStore, say: Say, current: Callable[[], int]) -> None:
        self.store = store
        self._say = say
        self._current = current
        self.peer: Peer | None = None
        """Who is uploading; the list is locked while somebody is."""
        self._next = 0
        self._last = 0
        self._heard_s = 0.0
        self._asked_s = 0.0
        self._warned_item = False
        self._warned_request = False
        self._out: list[Outbound] = []

    @property
    def receiving(self) -> bool:
        """Whether an upload is under way (or was broken off less than 8 s ago)."""
        return self.peer is not None

    def take(self) -> list[Outbound]:
        """Return and forget the messages to send."""
        out, self._out = self._out, []
        return out

    # --- upload ---

    def on_count(self, count: int, peer: Peer, now_s: float) -> None:
        """Handle MISSION_COUNT: the start of an upload."""
        if not self._release(peer):
            return
        if count > self.store.capacity:
            self._ack(peer, mavlink.MAV_MISSION_NO_SPACE)
            self._say(WARNING, f"Only {self.store.capacity} items are supported")
            return
        self.store.begin(count)
        if count == 0:
            self._finish(peer)
            return
        self._start(peer, 0, count - 1, now_s)

    def on_write_partial(self, first: int, last: int, peer: Peer, now_s: float) -> None:
        """Handle MISSION_WRITE_PARTIAL_LIST: the start of an update of some items."""
        if self.peer is not None:
            self._ack(peer, DENIED)
            return
        count = self.store.count()
        if not (0 <= first <= count and 0 <= last <= count and first <= last):
            self._say(WARNING, "Flight plan update rejected")
            self._ack(peer, ERROR)
            return
        self.store.begin_partial()
        self._start(peer, first, last, now_s)

    def on_item(self, seq: int, item: Item, peer: Peer, now_s: float, *, integer: bool) -> None:
        """Handle MISSION_ITEM_INT (or MISSION_ITEM, where `integer` is False)."""
        if not integer and not self._warned_item:
            self._warned_item = True
            self._say(WARNING, "got MISSION_ITEM; GCS should send MISSION_ITEM_INT")
        owner = self.peer
        if owner is None:
            self._ack(peer, ERROR)
            return
        if seq != self._next:
            self._ack(peer, INVALID_SEQUENCE)
            return
        if not _same(owner, peer):
            self._ack(peer, DENIED)
            return
        try:
            self.store.write(seq, item, self._last)
        except Refusal as refusal:
            self._ack(peer, refusal.result)
            self.peer = None
            self.store.abandon()
            return
        self._heard_s = now_s
        self._next += 1
        if self._next > self._last:
            self._finish(peer)
        else:
            self._ask(now_s)

    def on_clear(self, peer: Peer) -> None:
        """Handle MISSION_CLEAR_ALL."""
        if self._release(peer):
            self._ack(peer, ACCEPTED if self.store.clear() else ERROR)
        else:
            self._ack(peer, ERROR)

    def tick(self, now_s: float) -> None:
        """Ask again for an item that did not come, or give up."""
        if self.peer is None:
            return
        if now_s - self._heard_s > GIVE_UP_S:
            peer, self.peer = self.peer, None
            self._say(WARNING, self.store.timeout_text)
            self._ack(peer, mavlink.MAV_MISSION_OPERATION_CANCELLED)
            self.store.abandon()
        elif now_s - self._asked_s > REQUEST_AGAIN_S:
            self._ask(now_s)

    # --- download ---

    def on_request_list(self, peer: Peer) -> None:
        """Handle MISSION_REQUEST_LIST: the start of a download."""
        if self.peer is not None:
            self._ack(peer, DENIED)
            return
        self._send_count(peer)

    def on_request(self, seq: int, peer: Peer, *, integer: bool) -> None:
        """Handle MISSION_REQUEST_INT (or MISSION_REQUEST, where `integer` is False)."""
        if self.peer is not None:
            self._ack(peer, DENIED)
            return
        try:
            item = self.store.read(seq)
        except Refusal as refusal:
            if self.store.mission_type == mavlink.MAV_MISSION_TYPE_MISSION:
                self._send_count(peer)
            self._ack(peer, refusal.result)
            return
        is_mission = self.store.mission_type == mavlink.MAV_MISSION_TYPE_MISSION
        # ArduPilot compares the item's command (not its number) with the current number; kept,
        # because a read-back that trusts this flag works here and fails on the water.
        current = 1 if is_mission and item.command == self._current() else 0
        fields = (
            peer.system_id,
            peer.component_id,
            seq,
            item.frame,
            item.command,
            current,
            1 if is_mission else 0,
            item.param1,
            item.param2,
            item.param3,
            item.param4,
        )
        kind = self.store.mission_type
        if integer:
            message = mavlink.MAVLink_mission_item_int_message(
                *fields, item.x, item.y, item.z, kind
            )
        else:
            if not self._warned_request:
                self._warned_request = True
                self._say(WARNING, "got MISSION_REQUEST; use MISSION_REQUEST_INT!")
            message = mavlink.MAVLink_mission_item_message(
                *fields, item.x * 1e-7, item.y * 1e-7, item.z, kind
            )
        self._out.append(Outbound(peer.link, message))

    # --- inside ---

    def _release(self, peer: Peer) -> bool:
        """Let the same peer start over; deny everybody else while an upload is under way."""
        if self.peer is None:
            return True
        if not _same(self.peer, peer):
            self._ack(peer, DENIED)
            return False
        self.peer = None
        self.store.abandon()
        return True

    def _start(self, peer: Peer, first: int, last: int, now_s: float) -> None:
        self.peer = peer
        self._next, self._last = first, last
        self._heard_s = now_s
        self._warned_item = self._warned_request = False
        self._ask(now_s)

    def _ask(self, now_s: float) -> None:
        peer = self.peer
        assert peer is not None
        self._asked_s = now_s
        # ArduPilot asks with MISSION_REQUEST and takes MISSION_ITEM_INT.
        message = mavlink.MAVLink_mission_request_message(
            peer.system_id, peer.component_id, self._next, self.store.mission_type
        )
        self._out.append(Outbound(peer.link, message))

    def _finish(self, peer: Peer) -> None:
        result = self.store.complete()
        self._ack(peer, result)
        self.store.abandon()
        self.peer = None

    def _send_count(self, peer: Peer) -> None:
        message = mavlink.MAVLink_mission_count_message(
            peer.system_id, peer.component_id, self.store.count(), self.store.mission_type
        )
        self._out.append(Outbound(peer.link, message))

    def _ack(self, peer: Peer, result: int) -> None:
        message = mavlink.MAVLink_mission_ack_message(
            peer.system_id, peer.component_id, result, self.store.mission_type
        )
        self._out.append(Outbound(peer.link, message))


def _same(a: Peer, b: Peer) -> bool:
    return a.system_id == b.system_id and a.component_id == b.component_id

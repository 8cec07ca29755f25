"""Where a simulated vehicle keeps its mission, fence and rally points, and how much fits."""

from __future__ import annotations

from collections.abc import Callable
from typing import Protocol

from mrmission.simulate.storage import (
    FENCE_BYTES,
    FENCE_END_BYTES,
    MISSION_ITEMS,
    MISSION_RECORD_BYTES,
    RALLY_POINTS,
    Item,
    Refusal,
    fence_bytes,
    fence_fault,
    fence_item,
    mission_item,
    rally_item,
)
from mrmission.simulate.wire import mavlink

ACCEPTED = mavlink.MAV_MISSION_ACCEPTED
ERROR = mavlink.MAV_MISSION_ERROR
INVALID_SEQUENCE = mavlink.MAV_MISSION_INVALID_SEQUENCE
WARNING = mavlink.MAV_SEVERITY_WARNING
INFO = mavlink.MAV_SEVERITY_INFO

Say = Callable[[int, str], None]
"""Sends a status text: (severity, text)."""


class ItemStore(Protocol):
    """What a transfer writes into and reads from."""

    mission_type: int
    timeout_text: str

    @property
    def capacity(self) -> int:
        """Items that an upload may announce."""

    def count(self) -> int:
        """Return the items stored (of a fence under way: announced)."""

    def begin(self, count: int) -> None:
        """Prepare for an upload of `count` items."""

    def begin_partial(self) -> None:
        """Prepare for an update of some items."""

    def write(self, seq: int, item: Item, last: int) -> None:
        """Store one item, or raise :class:`Refusal`; `last` is the last expected number."""

    def complete(self) -> int:
        """Finish the upload and return the result."""

    def abandon(self) -> None:
        """Drop what an unfinished upload holds."""

    def read(self, seq: int) -> Item:
        """Return one item, or raise :class:`Refusal`."""

    def clear(self) -> bool:
        """Remove all items, unless that is not allowed now."""


class MissionStore:
    """Mission items; number 0 is always the vehicle's home, whatever was written there.

    ``revision`` rises with every write, so that an autopilot can notice a change under way.
    """

    mission_type = mavlink.MAV_MISSION_TYPE_MISSION
    timeout_text = "Mission upload timeout"

    def __init__(self, say: Say, sd_card_kb: int = 0, room: int = MISSION_ITEMS) -> None:
        self._say = say
        self._capacity = (sd_card_kb * 1024 - 4) // MISSION_RECORD_BYTES if sd_card_kb > 0 else room
        self.items: list[Item] = []
        self.home = Item(16, 0, 0.0, 0.0, 0.0, 0.0, 0, 0, 0.0)
        self.revision = 0
        self.has_room: Callable[[], bool] = lambda: True
        self.may_clear: Callable[[], bool] = lambda: True
        self.on_clear: Callable[[], None] = lambda: None

    @property
    def capacity(self) -> int:
        """Items that an upload may announce."""
        return self._capacity if self.has_room() else 0

    def count(self) -> int:
        """Return the number of items (of a fence under way: as announced)."""
        return len(self.items)

    def begin(self, count: int) -> None:
        """Prepare for an upload of `count` items."""
        if count < len(self.items):
            del self.items[count:]
            self.revision += 1

    def begin_partial(self) -> None:
        """Prepare for an update of some items."""

    def write(self, seq: int, item: Item, last: int) -> None:
        """Store one item, or raise :class:`Refusal`."""
        stored = mission_item(item)
        if stored.command == mavlink.MAV_CMD_DO_JUMP and (
            stored.param1 == 0 or (stored.param1 >= len(self.items) and stored.param1 > last)
        ):
            raise Refusal(ERROR)
        if seq > len(self.items) or seq >= self._capacity:
            raise Refusal(ERROR)
        if seq == len(self.items):
            self.items.append(stored)
        else:
            self.items[seq] = stored
        self.revision += 1

    def complete(self) -> int:
        """Finish the upload and return its MAV_MISSION_RESULT."""
        self._say(INFO, "Flight plan received")
        return ACCEPTED

    def abandon(self) -> None:
        """Drop what an unfinished upload holds."""

    def read(self, seq: int) -> Item:
        """Return one item, or raise :class:`Refusal`."""
        if seq == 0:
            return self.home
        if seq >= len(self.items):
            raise Refusal(ERROR)
        return self.items[seq]

    def clear(self) -> bool:
        """Remove all items; False where that is not allowed now."""
        if not self.may_clear():
            return False
        self.begin(0)
        self.on_clear()
        return True


class FenceStore:
    """Fence items; an upload is checked and stored as a whole, after its last item."""

    mission_type = mavlink.MAV_MISSION_TYPE_FENCE
    timeout_text = "Fence upload timeout"

    def __init__(self, say: Say, sd_card_kb: int = 0, room_bytes: int = FENCE_BYTES) -> None:
        self._say = say
        self._size_bytes = sd_card_kb * 1024 if sd_card_kb > 0 else room_bytes
        self.items: list[Item] = []
        self._new: list[Item | None] | None = None
        self.revision = 0

    @property
    def capacity(self) -> int:
        """Items that an upload may announce."""
        return self._size_bytes // 8

    def count(self) -> int:
        """Return the number of items (of a fence under way: as announced)."""
        return len(self.items) if self._new is None else len(self._new)

    def begin(self, count: int) -> None:
        """Prepare for an upload of `count` items."""
        self._new = [None] * count

    def begin_partial(self) -> None:
        """Prepare for an update of some items."""
        self._new = list(self.items)

    def write(self, seq: int, item: Item, last: int) -> None:
        """Store one item, or raise :class:`Refusal`."""
        if self._new is None or seq >= len(self._new):
            raise Refusal(INVALID_SEQUENCE)
        self._new[seq] = fence_item(item)

    def complete(self) -> int:
        """Finish the upload and return its MAV_MISSION_RESULT."""
        items = [item for item in self._new or () if item is not None]
        fault = fence_fault(items)
        if fault is not None:
            self._say(WARNING, fault)
            self._say(WARNING, "Fence validation failed")
            return ERROR
        # ArduPilot forgets the end mark here: where only that lacks room, it accepts the fence and
        # then dies of it. A rehearsal is better served by a refusal.
        if fence_bytes(items) + FENCE_END_BYTES > self._size_bytes:
            self._say(WARNING, "Fence exceeds storage size")
            return ERROR
        self.items = items
        self.revision += 1
        return ACCEPTED

    def abandon(self) -> None:
        """Drop what an unfinished upload holds."""
        self._new = None

    def read(self, seq: int) -> Item:
        """Return one item, or raise :class:`Refusal`."""
        if seq >= len(self.items):
            raise Refusal(INVALID_SEQUENCE if seq > len(self.items) else ERROR)
        return self.items[seq]

    def clear(self) -> bool:
        """Remove all items; False where that is not allowed now."""
        self.items = []
        self.revision += 1
        return True


class RallyStore:
    """Rally points."""

    mission_type = mavlink.MAV_MISSION_TYPE_RALLY
    timeout_text = "Rally upload timeout"

    def __init__(self, room: int = RALLY_POINTS) -> None:
        self.items: list[Item] = []
        self.capacity = room

    def count(self) -> int:
        """Return the number of items (of a fence under way: as announced)."""
        return len(self.items)

    def begin(self, count: int) -> None:
        """Prepare for an upload of `count` items."""
        del self.items[count:]

    def begin_partial(self) -> None:
        """Prepare for an update of some items."""

    def write(self, seq: int, item: Item, last: int) -> None:
        """Store one item, or raise :class:`Refusal`."""
        stored = rally_item(item)
        if seq == len(self.items):
            if seq >= self.capacity:
                raise Refusal(ERROR)
            self.items.append(stored)
        elif seq < len(self.items):
            self.items[seq] = stored
        else:
            raise Refusal(ERROR)

    def complete(self) -> int:
        """Finish the upload and return its MAV_MISSION_RESULT."""
        return ACCEPTED

    def abandon(self) -> None:
        """Drop what an unfinished upload holds."""

    def read(self, seq: int) -> Item:
        """Return one item, or raise :class:`Refusal`."""
        if seq >= len(self.items):
            raise Refusal(INVALID_SEQUENCE)
        return self.items[seq]

    def clear(self) -> bool:
        """Remove all items; False where that is not allowed now."""
        self.items = []
        return True

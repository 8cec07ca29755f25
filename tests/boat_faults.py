"""What goes wrong with one simulated boat while it is being talked to."""

from __future__ import annotations

import asyncio
from collections.abc import Callable, Hashable, Sequence

from mrmission.model import Mission
from mrmission.simulate import SimulatedFleet
from mrmission.simulate.storage import Item, Refusal
from mrmission.simulate.transfer import Outbound
from mrmission.simulate.wire import Message, mavlink
from mrmission.vehicle.items import MissionType, RawItem, to_raw
from mrmission.vehicle.readback import compare_items


class Trouble:
    """Sits between a simulated boat and its links; lets everything pass until told otherwise."""

    def __init__(self, fleet: SimulatedFleet, index: int = 0) -> None:
        self.boat = fleet.vehicles[index]
        self.dead = False
        self.items_seen = 0
        self._server = fleet._servers[index]
        self._triggers: list[tuple[MissionType, int, Callable[[], None]]] = []
        self._handle, self._deliver = self.boat.handle, self._server.deliver
        self.boat.handle = self._take  # type: ignore[method-assign]
        self._server.deliver = self._give  # type: ignore[method-assign]

    def at(self, kind: MissionType, seq: int, action: Callable[[], None]) -> None:
        """Do `action` once, when item `seq` of a store is about to arrive."""
        self._triggers.append((kind, seq, action))

    def die(self) -> None:
        """Neither hear nor speak from now on."""
        self.dead = True

    def live(self) -> None:
        """Hear and speak again."""
        self.dead = False

    def reboot(self, silence_s: float) -> None:
        """Restart: transfers under way are forgotten, links break, nothing is heard for a while."""
        self.die()
        for transfer in self.boat.transfers.values():
            transfer.peer = None
            transfer.store.abandon()
        self.boat.reboot()
        for link in list(self._server.links):
            link.abort()
        asyncio.get_running_loop().call_later(silence_s, self.live)

    def arm(self) -> None:
        """Be armed, and say so at once."""
        from mrmission.simulate import telemetry

        self.boat.autopilot.armed = True
        self.boat._send(telemetry.heartbeat(self.boat))

    def refuse(self, when: Callable[[int, Item], bool]) -> None:
        """Refuse mission items for which `when` holds, as a full or worn store does."""
        store = self.boat.mission
        write = store.write

        def picky(seq: int, item: Item, last: int) -> None:
            if when(seq, item):
                raise Refusal(mavlink.MAV_MISSION_NO_SPACE)
            write(seq, item, last)

        store.write = picky  # type: ignore[method-assign]

    def contents(self) -> dict[MissionType, tuple[RawItem, ...]]:
        """Return what the boat stores, read from its memory and not over the link."""
        boat = self.boat
        out = {}
        for kind, store in (
            (MissionType.MISSION, boat.mission),
            (MissionType.FENCE, boat.fence),
            (MissionType.RALLY, boat.rally),
        ):
            items = [store.read(seq) for seq in range(len(store.items))]
            if kind is MissionType.MISSION and len(items) < 2:
                items = []
            out[kind] = tuple(
                RawItem(
                    seq=seq, frame=i.frame, command=i.command, param1=i.param1, param2=i.param2,
                    param3=i.param3, param4=i.param4, x=i.x, y=i.y, z=i.z, mission_type=int(kind),
                )
                for seq, i in enumerate(items)
            )  # fmt: skip
        return out

    def holds(self, mission: Mission) -> bool:
        """Return whether the boat stores exactly `mission`, its fence, its rally points."""
        now = self.contents()
        return not any(
            compare_items(items, now[kind], kind) for kind, items in to_raw(mission).items()
        )

    @property
    def empty(self) -> bool:
        """Whether the boat stores nothing at all."""
        return not any(self.contents().values())

    # --- inside ---

    def _take(self, message: Message, link: Hashable = 0) -> list[Outbound]:
        if message.get_type() == "MISSION_ITEM_INT":
            self.items_seen += 1
            for trigger in list(self._triggers):
                kind, seq, action = trigger
                if message.mission_type == kind and message.seq == seq:
                    self._triggers.remove(trigger)
                    action()
        return [] if self.dead else self._handle(message, link)

    def _give(self, out: Sequence[Outbound]) -> None:
        if not self.dead:
            self._deliver(list(out))

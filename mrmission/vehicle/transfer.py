"""Runs a machine of the mission protocol on a link: messages in, messages out, a clock."""

from __future__ import annotations

import asyncio
from collections.abc import Callable, Sequence

from mrmission.vehicle.framing import AUTOPILOT_COMPONENT_ID, Message, mavlink
from mrmission.vehicle.items import MissionType, RawItem
from mrmission.vehicle.messages import Autopilot
from mrmission.vehicle.mission_words import (
    Ack,
    AskItem,
    AskList,
    Count,
    Heard,
    Item,
    Machine,
    Request,
    SendAck,
    SendClear,
    SendItem,
    Sent,
)

HEARD = (
    "MISSION_REQUEST",
    "MISSION_REQUEST_INT",
    "MISSION_ACK",
    "MISSION_COUNT",
    "MISSION_ITEM_INT",
)


async def run_machine(
    vehicle: Autopilot,
    machine: Machine,
    mission_type: MissionType,
    items: Sequence[RawItem] = (),
    progress: Callable[[float], None] | None = None,
) -> None:
    """Run `machine` to its end; its result says how that was.

    Parameters
    ----------
    vehicle
        Whom to talk to.
    machine
        What to run.
    mission_type
        Which store it is about.
    items
        What an upload sends, by number.
    progress
        Called with the machine's fraction whenever that grows.
    """
    loop = asyncio.get_running_loop()
    vehicle.rival = None
    told = 0.0

    def send(out: Sequence[Sent]) -> None:
        for one in out:
            vehicle.send(_packed(one, vehicle.system_id, mission_type, items))

    with vehicle.listen(*HEARD) as queue:
        send(machine.start(loop.time()))
        while machine.result is None:
            try:
                async with asyncio.timeout_at(machine.deadline_s):
                    message = await queue.get()
            except TimeoutError:
                send(machine.on_time(loop.time()))
                continue
            heard = _unpacked(message, mission_type)
            if heard is not None:
                send(machine.hear(heard, loop.time()))
                if progress is not None and machine.fraction > told:
                    told = machine.fraction
                    progress(told)


def _packed(
    sent: Sent, system_id: int, mission_type: MissionType, items: Sequence[RawItem]
) -> Message:
    """Return the message that a machine wants to be sent."""
    to = (system_id, AUTOPILOT_COMPONENT_ID)
    kind = int(mission_type)
    match sent:
        case Count(total=total):
            return mavlink.MAVLink_mission_count_message(*to, total, kind)
        case SendItem(seq=seq):
            item = items[seq]
            return mavlink.MAVLink_mission_item_int_message(
                *to, seq, item.frame, item.command, item.current, item.autocontinue,
                item.param1, item.param2, item.param3, item.param4, item.x, item.y, item.z, kind,
            )  # fmt: skip
        case AskList():
            return mavlink.MAVLink_mission_request_list_message(*to, kind)
        case AskItem(seq=seq):
            return mavlink.MAVLink_mission_request_int_message(*to, seq, kind)
        case SendAck():
            return mavlink.MAVLink_mission_ack_message(*to, mavlink.MAV_MISSION_ACCEPTED, kind)
        case SendClear():
            return mavlink.MAVLink_mission_clear_all_message(*to, kind)


def _unpacked(message: Message, mission_type: MissionType) -> Heard | None:
    """Return what a machine is told of a message, None where it is about another store."""
    if message.mission_type != mission_type:
        return None
    kind = message.get_type()
    if kind.startswith("MISSION_REQUEST"):
        return Request(int(message.seq))
    if kind == "MISSION_ACK":
        return Ack(int(message.type))
    if kind == "MISSION_COUNT":
        return Count(int(message.count))
    return Item(
        RawItem(
            seq=int(message.seq),
            frame=int(message.frame),
            command=int(message.command),
            current=int(message.current),
            autocontinue=int(message.autocontinue),
            param1=float(message.param1),
            param2=float(message.param2),
            param3=float(message.param3),
            param4=float(message.param4),
            x=int(message.x),
            y=int(message.y),
            z=float(message.z),
            mission_type=int(mission_type),
        )
    )

"""MAVLink 2 on the wire: one :class:`Codec` per link end, over pymavlink's generated dialect."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

from pymavlink.dialects.v20 import ardupilotmega as mavlink

Message = Any
"""A pymavlink message object (the generated classes carry no types)."""

AUTOPILOT_COMPONENT = 1

__all__ = ["AUTOPILOT_COMPONENT", "Codec", "Message", "mavlink"]


class Codec:
    """Packs and parses the messages of one end of one link.

    Sequence numbers and parser state belong to a link, so every link has its own codec.

    Parameters
    ----------
    system_id, component_id : int
        Who signs outgoing messages.
    """

    def __init__(self, system_id: int, component_id: int = AUTOPILOT_COMPONENT) -> None:
        self._mav = mavlink.MAVLink(None, srcSystem=system_id, srcComponent=component_id)
        self._mav.robust_parsing = True

    def encode(self, message: Message) -> bytes:
        """Return `message` packed with this link's next sequence number."""
        data = bytes(message.pack(self._mav))
        self._mav.seq = (self._mav.seq + 1) % 256
        return data

    def decode(self, data: bytes) -> list[Message]:
        """Return the complete messages in `data` and what was left from before; garbage is lost."""
        parsed: Iterable[Message] = self._mav.parse_buffer(data) or ()
        return [message for message in parsed if message.get_msgId() >= 0]

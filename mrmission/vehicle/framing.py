"""MAVLink frames out of a byte stream, without decoding those that nobody wants.

A fleet of 32 vehicles with full telemetry sends thousands of messages a second, nearly all of which
no one listens for. So a stream is cut into frames by their headers and check sums first, and only
a frame whose message id somebody has asked for is decoded, by pymavlink.
"""

from __future__ import annotations

import hashlib
import time
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, NamedTuple

from pymavlink.dialects.v20 import ardupilotmega as mavlink

__all__ = [
    "AUTOPILOT_COMPONENT_ID",
    "Codec",
    "Frame",
    "FrameReader",
    "Message",
    "Signing",
    "mavlink",
    "message_number",
]

Message = Any
"""A pymavlink message object (the generated classes carry no types)."""

V1_MAGIC, V2_MAGIC = 0xFE, 0xFD
V1_OVERHEAD, V2_OVERHEAD = 8, 12
SIGNATURE_BYTES = 13
SIGNED_FLAG = 1
AUTOPILOT_COMPONENT_ID = 1
SIGNING_EPOCH_S = 1_420_070_400
"""Signatures count time from 2015-01-01, in steps of 10 µs."""

_CRC_EXTRA: dict[int, int] = {
    number: kind.crc_extra for number, kind in mavlink.mavlink_map.items()
}


class Frame(NamedTuple):
    """One packet as it came, and the part of its header that decides who gets it."""

    system_id: int
    component_id: int
    message_id: int
    data: bytes

    @property
    def signed(self) -> bool:
        """Whether the packet carries a signature, genuine or not."""
        return self.data[0] == V2_MAGIC and bool(self.data[2] & SIGNED_FLAG)


class FrameReader:
    """Cuts one peer's stream of bytes into frames; noise between them is dropped.

    A frame of a message that the dialect does not know cannot be checked; it is taken for one where
    another frame or nothing follows it.
    """

    def __init__(self) -> None:
        self._buffer = bytearray()

    def feed(self, data: bytes) -> list[Frame]:
        """Return the frames that are complete with `data`."""
        buffer = self._buffer
        buffer += data
        size = len(buffer)
        out: list[Frame] = []
        at = 0
        while at < size:
            magic = buffer[at]
            if magic == V2_MAGIC:
                if at + 10 > size:
                    break
                length = buffer[at + 1] + V2_OVERHEAD
                end = at + length
                if buffer[at + 2] & SIGNED_FLAG:
                    length += SIGNATURE_BYTES
                message = buffer[at + 7] | buffer[at + 8] << 8 | buffer[at + 9] << 16
                system, component = buffer[at + 5], buffer[at + 6]
            elif magic == V1_MAGIC:
                if at + 6 > size:
                    break
                length = buffer[at + 1] + V1_OVERHEAD
                end = at + length
                message = buffer[at + 5]
                system, component = buffer[at + 3], buffer[at + 4]
            else:
                at = _next_magic(buffer, at + 1)
                continue
            if at + length > size:
                break
            if _is_frame(buffer, at, end, at + length, message):
                out.append(Frame(system, component, message, bytes(buffer[at : at + length])))
                at += length
            else:
                at = _next_magic(buffer, at + 1)
        del buffer[:at]
        return out


def _next_magic(buffer: bytearray, start: int) -> int:
    found = [i for i in (buffer.find(V1_MAGIC, start), buffer.find(V2_MAGIC, start)) if i >= 0]
    return min(found, default=len(buffer))


def _is_frame(buffer: bytearray, start: int, end: int, after: int, message: int) -> bool:
    extra = _CRC_EXTRA.get(message)
    if extra is None:
        return after == len(buffer) or buffer[after] in (V1_MAGIC, V2_MAGIC)
    crc = mavlink.x25crc(bytes(buffer[start + 1 : end - 2]))
    crc.accumulate(bytes((extra,)))
    return bool(crc.crc == buffer[end - 2] | buffer[end - 1] << 8)


@dataclass(frozen=True, slots=True, kw_only=True)
class Signing:
    """What signs packets and tells whose are genuine (MAVLink 2).

    Parameters
    ----------
    key
        32 bytes that ground station and vehicle share.
    link_id
        Number of this link in the signatures; each link of a station has its own.

    Examples
    --------
    >>> len(Signing.from_passphrase("open sesame").key)
    32
    """

    key: bytes
    link_id: int = 0

    @classmethod
    def from_passphrase(cls, text: str) -> Signing:
        """Return the key that Mission Planner and MAVProxy make of a passphrase: its SHA-256."""
        return cls(key=hashlib.sha256(text.encode()).digest())


class Codec:
    """Packs what a ground station sends over one link, and decodes what it wants of what it hears.

    Parameters
    ----------
    system_id, component_id
        Who signs outgoing messages.
    signing
        Key of the link; without one nothing is signed and every signature is accepted.
    clock
        Time since 1970, seconds.
    """

    def __init__(
        self,
        system_id: int,
        component_id: int,
        signing: Signing | None = None,
        clock: Callable[[], float] = time.time,
    ) -> None:
        self.signed = signing is not None
        self._mav = mavlink.MAVLink(None, srcSystem=system_id, srcComponent=component_id)
        if signing is not None:
            state = self._mav.signing
            state.secret_key = signing.key
            state.link_id = signing.link_id
            state.sign_outgoing = True
            state.timestamp = int(max(0.0, clock() - SIGNING_EPOCH_S) * 1e5)

    def encode(self, message: Message) -> bytes:
        """Return `message` packed with this link's next sequence number, signed where wanted."""
        data = bytes(message.pack(self._mav))
        self._mav.seq = (self._mav.seq + 1) % 256
        return data

    def decode(self, frame: Frame) -> Message | None:
        """Return a frame's message; None where it cannot be read or its signature is refused."""
        try:
            message = self._mav.decode(bytearray(frame.data))
        except mavlink.MAVError:
            return None
        return message if message.get_msgId() >= 0 else None


def message_number(name: str) -> int:
    """Return the id of a message by its name.

    Examples
    --------
    >>> message_number("HEARTBEAT")
    0
    """
    return int(getattr(mavlink, f"MAVLINK_MSG_ID_{name}"))

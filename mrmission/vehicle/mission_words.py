"""What the machines of the mission protocol hear, send and measure; see `mission_protocol`."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple, Protocol

from mrmission.vehicle.items import RawItem

SUCCESS = "SUCCESS"
UNCONFIRMED = "UNCONFIRMED"
TIMEOUT = "TIMEOUT"
ERROR = "ERROR"
DENIED = "DENIED"
CANCELLED = "TRANSFER_CANCELLED"
TOO_MANY = "TOO_MANY_MISSION_ITEMS"
ACK_ACCEPTED, ACK_ERROR, ACK_INVALID_SEQUENCE, ACK_DENIED, ACK_CANCELLED = 0, 1, 13, 14, 15
"""MAV_MISSION_RESULT."""

FIRST_TIMEOUT_S = 0.5
LEAST_TIMEOUT_S = 0.12
MOST_TIMEOUT_S = 2.0
BACKOFF = 1.5
GIVE_UP_S = 8.0
HOLD_S = 9.5
"""A vehicle that holds a broken transfer open lets go of it after 8 s."""
MOST_AHEAD = 8
"""Items under way: what the receive buffer of a telemetry port (512 bytes) holds."""
FIRST_WINDOW, LEAST_WINDOW, MOST_WINDOW = 6.0, 3.0, 16.0
MOST_RESTARTS = 3
UNHEARD_S = 2.5
"""A vehicle asks again each second; one that was not heard for longer does not know where to."""


class Request(NamedTuple):
    """MISSION_REQUEST or MISSION_REQUEST_INT came."""

    seq: int


class Ack(NamedTuple):
    """MISSION_ACK came; `result` is a MAV_MISSION_RESULT."""

    result: int


class Count(NamedTuple):
    """MISSION_COUNT came, or is to be sent."""

    total: int


class Item(NamedTuple):
    """MISSION_ITEM_INT came."""

    item: RawItem


class SendItem(NamedTuple):
    """Item `seq` is to be sent."""

    seq: int


class AskList(NamedTuple):
    """MISSION_REQUEST_LIST is to be sent."""


class AskItem(NamedTuple):
    """MISSION_REQUEST_INT is to be sent."""

    seq: int


class SendAck(NamedTuple):
    """MISSION_ACK, accepted, is to be sent."""


class SendClear(NamedTuple):
    """MISSION_CLEAR_ALL is to be sent."""


Heard = Request | Ack | Count | Item
Sent = Count | SendItem | AskList | AskItem | SendAck | SendClear


@dataclass(slots=True)
class RoundTrip:
    """How long an answer takes, from those that came; after RFC 6298, with shorter bounds."""

    mean_s: float = 0.0
    deviation_s: float = 0.0

    def sample(self, seconds: float) -> None:
        """Take in the time of one answer to something that was sent once."""
        if self.mean_s == 0.0:
            self.mean_s, self.deviation_s = seconds, 0.5 * seconds
            return
        self.deviation_s += 0.25 * (abs(seconds - self.mean_s) - self.deviation_s)
        self.mean_s += 0.125 * (seconds - self.mean_s)

    @property
    def timeout_s(self) -> float:
        """How long to wait before something counts as lost."""
        if self.mean_s == 0.0:
            return FIRST_TIMEOUT_S
        wanted = self.mean_s + 4.0 * self.deviation_s
        return min(max(wanted, LEAST_TIMEOUT_S), MOST_TIMEOUT_S)


class Machine(Protocol):
    """What runs a transfer: fed with what comes and with the time, says what to send."""

    @property
    def result(self) -> str | None:
        """How it ended; None while it runs."""

    @property
    def deadline_s(self) -> float:
        """When `on_time` wants to be called, unless something comes before."""

    @property
    def fraction(self) -> float:
        """How far it is, 0 to 1."""

    def start(self, now_s: float) -> list[Sent]:
        """Begin."""

    def hear(self, heard: Heard, now_s: float) -> list[Sent]:
        """Take in what came."""

    def on_time(self, now_s: float) -> list[Sent]:
        """See to what did not come."""


@dataclass(slots=True)
class Waiting:
    """What all machines share: when to wake, when to give up, what was said and is not believed."""

    round_trip: RoundTrip
    result: str | None = None
    wake_s: float = 0.0
    progress_s: float = 0.0
    silences: int = 0
    doubt: str = ""
    doubt_tested: bool = False

    def wait(self, now_s: float) -> None:
        """Set the next time-out, longer after every one that passed in vain."""
        wait_s = self.round_trip.timeout_s * BACKOFF ** min(self.silences, 6)
        self.wake_s = now_s + min(wait_s, MOST_TIMEOUT_S)

    def progress(self, now_s: float) -> None:
        """Note that the transfer goes on: it is neither silent nor in doubt."""
        self.progress_s = now_s
        self.silences = 0
        self.doubt = ""
        self.wait(now_s)

    def confirmed_doubt(self, name: str) -> bool:
        """Note a refusal; return whether it was said again of something sent since the first."""
        if not self.doubt:
            self.doubt, self.doubt_tested = name, False
            return False
        return self.doubt_tested


def result_name(number: int) -> str:
    """Return the name of a MAV_MISSION_RESULT that refuses.

    Examples
    --------
    >>> result_name(4), result_name(9)
    ('TOO_MANY_MISSION_ITEMS', 'INVALID_ARGUMENT')
    """
    names = {
        1: ERROR, 2: "UNSUPPORTED_FRAME", 3: "UNSUPPORTED", 4: TOO_MANY, 13: "INVALID_SEQUENCE",
        14: DENIED, 15: CANCELLED,
    }  # fmt: skip
    return names.get(number, "INVALID_ARGUMENT")

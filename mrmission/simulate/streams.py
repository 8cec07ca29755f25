"""Which messages a simulated vehicle streams, and when the next one is due."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator

from mrmission.simulate import telemetry
from mrmission.simulate.wire import Message, mavlink

SHORTEST_INTERVAL_S = 0.05
MOST_PIECES = 100


class Streams:
    """The streams of one vehicle.

    Parameters
    ----------
    build : callable
        Returns the message of a number, or None where there is nothing to send.
    speedup : float
        Seconds of the vehicle's clock per second of the link's. What a ground station asks for is
        counted on the vehicle's clock, as ArduPilot does; the default streams keep the link's, so
        that nobody is flooded who did not ask.
    """

    def __init__(self, build: Callable[[int], Message | None], speedup: float = 1.0) -> None:
        self._build = build
        self._speedup = speedup
        self._asked: set[int] = set()
        self._intervals = dict(telemetry.STREAMS)
        self._due: dict[int, float] = {}
        self._next_due_s = 0.0

    def take(self, now_s: float) -> Iterator[Message]:
        """Yield the messages that are due at `now_s` on the link's clock."""
        if now_s < self._next_due_s:
            return
        soonest = math.inf
        for message_id, interval_s in self._intervals.items():
            due = self._due.get(message_id, now_s)
            if now_s >= due:
                message = self._build(message_id)
                if message is not None:
                    yield message
                # Keep the rhythm, but never make up for what was missed.
                due = max(due + interval_s, now_s + 0.5 * interval_s)
                self._due[message_id] = due
            soonest = min(soonest, due)
        self._next_due_s = soonest

    def ask(self, message_id: int, interval_us: float) -> int:
        """Change an interval as SET_MESSAGE_INTERVAL does; return the MAV_RESULT."""
        if message_id not in telemetry.BUILDERS:
            return int(mavlink.MAV_RESULT_FAILED)
        self._asked.discard(message_id)
        if interval_us < 0:
            if message_id == mavlink.MAVLINK_MSG_ID_HEARTBEAT:
                return int(mavlink.MAV_RESULT_DENIED)
            self._intervals.pop(message_id, None)
        elif interval_us == 0:
            if message_id in telemetry.STREAMS:
                self._intervals[message_id] = telemetry.STREAMS[message_id]
            else:
                self._intervals.pop(message_id, None)
        else:
            interval_s = max(SHORTEST_INTERVAL_S, interval_us * 1e-6)
            self._intervals[message_id] = interval_s / self._speedup
            self._asked.add(message_id)
        self._due.pop(message_id, None)
        self._next_due_s = 0.0
        return int(mavlink.MAV_RESULT_ACCEPTED)

    def interval_us(self, message_id: int) -> int:
        """Return an interval as MESSAGE_INTERVAL tells it: -1 is off, 0 unknown."""
        interval_s = self._intervals.get(message_id)
        known = message_id in telemetry.BUILDERS
        if interval_s and message_id in self._asked:
            interval_s *= self._speedup
        return round(interval_s * 1e6) if interval_s else (-1 if known else 0)

    def pieces(self, step_s: float) -> int:
        """Return in how many pieces a step of the link's clock is taken, so that none is missed."""
        finest = min((self._intervals[number] for number in self._asked), default=math.inf)
        return max(1, min(MOST_PIECES, round(step_s / finest)))

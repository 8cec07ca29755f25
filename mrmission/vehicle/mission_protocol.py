"""The ground station's side of the mission protocol, for links that lose, double and swap packets.

Three machines, `Upload`, `Download` and `Clear`, without sockets or clock: they are told what came
and what time it is, and say what to send. What they know of ArduPilot's side:

* It asks for one item at a time, again each second, and takes the item it waits for, asked or not;
  between two it needs a turn of its main loop (20 ms on a Rover). So several items are sent ahead,
  and taken in one turn; and after a silence the item that was asked for goes out once more with
  the next ones: whether it was lost, or the next request, that goes on at once.
* Any other item it answers with INVALID_SEQUENCE, and goes on waiting: this ends nothing.
* A second MISSION_COUNT of the same station starts over from item 0, so requests are answered
  whatever their number.
* Without a transfer it answers an item with ERROR. So ERROR means that it never began, that it
  restarted, or that the last item had arrived and only its acceptance was lost.
* A refusal may be late, and of something else. So none is believed before something that was sent
  after it is refused as well.
* Eight seconds after the last item it took, it cancels. Until then it denies every reading, and
  every transfer of another station.

Whether a lost acceptance was one is for the caller to find out, by reading back: an upload then
ends as `UNCONFIRMED`.
"""

from __future__ import annotations

from dataclasses import dataclass

from mrmission.vehicle.items import MissionType, RawItem
from mrmission.vehicle.mission_words import (
    ACK_ACCEPTED,
    ACK_CANCELLED,
    ACK_DENIED,
    ACK_ERROR,
    ACK_INVALID_SEQUENCE,
    BACKOFF,
    CANCELLED,
    DENIED,
    ERROR,
    FIRST_WINDOW,
    GIVE_UP_S,
    HOLD_S,
    LEAST_WINDOW,
    MOST_AHEAD,
    MOST_RESTARTS,
    MOST_TIMEOUT_S,
    MOST_WINDOW,
    SUCCESS,
    TIMEOUT,
    UNCONFIRMED,
    UNHEARD_S,
    Ack,
    AskItem,
    AskList,
    Count,
    Heard,
    Item,
    Request,
    RoundTrip,
    SendAck,
    SendClear,
    SendItem,
    Sent,
    Waiting,
    result_name,
)


class Upload:
    """Sends a list of items.

    Parameters
    ----------
    count
        How many items; at least one.
    round_trip
        What is known of the link, kept from transfer to transfer.
    ahead
        How many items may be under way, asked for or not: 1 for a vehicle that wants to be asked
        first. The number grows with every item that is taken and is halved by a silence.
    """

    def __init__(self, count: int, round_trip: RoundTrip, ahead: int = MOST_AHEAD) -> None:
        if count < 1:
            raise ValueError("an empty list is cleared, not uploaded")
        self.count = count
        self._w = Waiting(round_trip)
        self._most_ahead = ahead
        self._window = 1
        self._position = -1
        """Item that the vehicle waits for, as far as is known."""
        self._last_asked = -1
        self._sent_to = -1
        """Last item under way."""
        self._sent_s: dict[int, float] = {}
        self._often: set[int] = set()
        self._heard_s = 0.0
        self._restarts = 0

    @property
    def result(self) -> str | None:
        """How it ended; None while it runs."""
        return self._w.result

    @property
    def deadline_s(self) -> float:
        """When `on_time` wants to be called."""
        return self._w.wake_s

    @property
    def fraction(self) -> float:
        """Share of the items that the vehicle has taken."""
        return 1.0 if self.result == SUCCESS else max(self._position, 0) / self.count

    def start(self, now_s: float) -> list[Sent]:
        """Announce the items."""
        self._w.progress(now_s)
        return [Count(self.count)]

    def hear(self, heard: Heard, now_s: float) -> list[Sent]:
        """Answer a request, or take the vehicle's word on the transfer."""
        if self.result is not None:
            return []
        if isinstance(heard, Request) and 0 <= heard.seq < self.count:
            return self._requested(heard.seq, now_s)
        if isinstance(heard, Ack):
            self._acknowledged(heard.result)
        return []

    def on_time(self, now_s: float) -> list[Sent]:
        """Send again what may have been lost; give up after a while."""
        w = self._w
        if self.result is not None or now_s < w.wake_s:
            return []
        if now_s - w.progress_s > GIVE_UP_S:
            w.result = UNCONFIRMED if self._all_sent else TIMEOUT
            return []
        w.silences += 1
        w.doubt_tested = True
        w.wait(now_s)
        if self._position < 0:
            return [Count(self.count)]
        if now_s - self._heard_s > UNHEARD_S and not w.doubt and self._restarts < MOST_RESTARTS:
            # The link broke and came back, and the vehicle answers to the old one: start over.
            self._restarts += 1
            self._position = self._last_asked = self._sent_to = -1
            self._sent_s.clear()
            return [Count(self.count)]
        # With the item the next ones, more and more: its own loss may be made good already, and
        # only the request that followed be lost.
        self._window = max(1, self._window // 2)
        width = min(max(self._window, 1 + w.silences), self._most_ahead)
        self._sent_to = self._position - 1
        return self._send_up_to(self._position + width, now_s)

    @property
    def _all_sent(self) -> bool:
        return self.count - 1 in self._sent_s

    def _send_up_to(self, end: int, now_s: float) -> list[Sent]:
        """Send what is not under way yet, from the item that is waited for to before `end`."""
        first = max(self._position, self._sent_to + 1)
        out: list[Sent] = [self._send(seq, now_s) for seq in range(first, min(end, self.count))]
        self._sent_to = max(self._sent_to, first + len(out) - 1)
        return out

    def _send(self, seq: int, now_s: float) -> Sent:
        if seq in self._sent_s:
            self._often.add(seq)
        self._sent_s[seq] = now_s
        return SendItem(seq)

    def _requested(self, seq: int, now_s: float) -> list[Sent]:
        w = self._w
        self._heard_s = now_s
        onwards = seq > self._position
        # A vehicle that was made to start over counts up again from a lower number; a request that
        # is late stands alone.
        restarted = not onwards and seq in (0, self._last_asked + 1)
        if onwards and seq - 1 in self._sent_s and seq - 1 not in self._often:
            w.round_trip.sample(now_s - self._sent_s[seq - 1])
        self._last_asked = seq
        out: list[Sent] = []
        if now_s - self._sent_s.get(seq, -1e9) > w.round_trip.timeout_s:
            # Never sent, or so long ago that it must be lost.
            out.append(self._send(seq, now_s))
            self._sent_to = max(self._sent_to, seq)
        if onwards or restarted:
            self._position = seq
            if restarted:
                self._sent_to = seq
            self._window = min(self._window + 1, self._most_ahead)
            w.progress(now_s)
            out += self._send_up_to(seq + self._window, now_s)
        else:
            w.doubt = ""
        return out

    def _acknowledged(self, result: int) -> None:
        w = self._w
        if result == ACK_ACCEPTED:
            # Before the last item was sent this can only be a late word on something else; before
            # that was asked for it may be one.
            if self._all_sent:
                w.result = SUCCESS if self._position == self.count - 1 else UNCONFIRMED
        elif result != ACK_INVALID_SEQUENCE and w.confirmed_doubt(result_name(result)):
            lost = w.doubt in (ERROR, DENIED, CANCELLED)
            w.result = UNCONFIRMED if lost and self._all_sent else w.doubt


@dataclass(slots=True)
class _Asked:
    at_s: float
    due_s: float
    tries: int = 1


class Download:
    """Reads a list of items, several requests at a time.

    Parameters
    ----------
    round_trip
        What is known of the link, kept from transfer to transfer.
    """

    def __init__(self, round_trip: RoundTrip) -> None:
        self._w = Waiting(round_trip)
        self._total: int | None = None
        self._items: dict[int, RawItem] = {}
        self._asked: dict[int, _Asked] = {}
        self._next = 0
        self._window = FIRST_WINDOW
        self._denied_s: float | None = None
        self._restarts = 0
        self._listed_s: float | None = None

    @property
    def result(self) -> str | None:
        """How it ended; None while it runs."""
        return self._w.result

    @property
    def items(self) -> tuple[RawItem, ...]:
        """What was read, in order."""
        return tuple(self._items[seq] for seq in sorted(self._items))

    @property
    def deadline_s(self) -> float:
        """When `on_time` wants to be called."""
        if self._asked:
            return min(asked.due_s for asked in self._asked.values())
        return self._w.wake_s

    @property
    def fraction(self) -> float:
        """Share of the items that have come."""
        return len(self._items) / self._total if self._total else 0.0

    def start(self, now_s: float) -> list[Sent]:
        """Ask how many items there are."""
        self._w.progress(now_s)
        self._listed_s = now_s
        return [AskList()]

    def hear(self, heard: Heard, now_s: float) -> list[Sent]:
        """Take in a count, an item, or a refusal."""
        if self.result is not None:
            return []
        if isinstance(heard, Count) and self._total is None:
            return self._counted(heard.total, now_s)
        if isinstance(heard, Item) and self._total is not None:
            return self._received(heard.item, now_s)
        if isinstance(heard, Ack):
            return self._refused(heard.result, now_s)
        return []

    def on_time(self, now_s: float) -> list[Sent]:
        """Ask again for what did not come; give up after a while."""
        w = self._w
        if self.result is not None or now_s < self.deadline_s:
            return []
        patience_s = HOLD_S if self._denied_s is not None else GIVE_UP_S
        if now_s - w.progress_s > patience_s:
            w.result = DENIED if self._denied_s is not None else TIMEOUT
            return []
        w.doubt_tested = True
        if self._total is None:
            w.silences += 1
            w.wait(now_s)
            self._listed_s = None
            return [AskList()]
        late = [seq for seq, asked in self._asked.items() if asked.due_s <= now_s]
        self._window = max(LEAST_WINDOW, self._window * 0.7 ** min(len(late), 2))
        out: list[Sent] = []
        for seq in late:
            asked = self._asked[seq]
            asked.tries += 1
            self._set_due(asked, now_s)
            out.append(AskItem(seq))
        return out

    def _counted(self, count: int, now_s: float) -> list[Sent]:
        if self._listed_s is not None:
            self._w.round_trip.sample(now_s - self._listed_s)
            self._listed_s = None
        self._total = count
        self._denied_s = None
        self._w.progress(now_s)
        if count == 0:
            self._w.result = SUCCESS
            return [SendAck()]
        return self._fill(now_s)

    def _received(self, item: RawItem, now_s: float) -> list[Sent]:
        asked = self._asked.pop(item.seq, None)
        if asked is None:
            return []
        if asked.tries == 1:
            self._w.round_trip.sample(now_s - asked.at_s)
        self._window = min(MOST_WINDOW, self._window + 0.5)
        self._denied_s = None
        self._w.progress(now_s)
        self._items[item.seq] = item
        if len(self._items) == self._total:
            self._w.result = SUCCESS
            return [SendAck()]
        return self._fill(now_s)

    def _refused(self, result: int, now_s: float) -> list[Sent]:
        w = self._w
        if result == ACK_DENIED:
            # The vehicle holds a transfer open, perhaps a broken one of ours: it will let go.
            if self._denied_s is None:
                self._denied_s = now_s
            return []
        # An acceptance, or a word on an upload before this reading.
        if result in (ACK_ACCEPTED, ACK_CANCELLED) or not w.confirmed_doubt(result_name(result)):
            return []
        if self._restarts == MOST_RESTARTS:
            w.result = w.doubt
            return []
        # The list has changed under the reading: begin again.
        self._restarts += 1
        self._total = None
        self._items.clear()
        self._asked.clear()
        self._next = 0
        w.doubt = ""
        w.wait(now_s)
        return [AskList()]

    def _fill(self, now_s: float) -> list[Sent]:
        assert self._total is not None
        out: list[Sent] = []
        while self._next < self._total and len(self._asked) < int(self._window):
            asked = self._asked[self._next] = _Asked(now_s, now_s)
            self._set_due(asked, now_s)
            out.append(AskItem(self._next))
            self._next += 1
        return out

    def _set_due(self, asked: _Asked, now_s: float) -> None:
        wait_s = self._w.round_trip.timeout_s * BACKOFF ** min(asked.tries - 1, 6)
        if self._denied_s is not None:
            wait_s = max(wait_s, 1.0)
        asked.due_s = now_s + min(wait_s, MOST_TIMEOUT_S)


class Clear:
    """Empties a list, and sees that it is empty.

    Parameters
    ----------
    mission_type
        Which; a mission that is empty may still count its home.
    round_trip
        What is known of the link, kept from transfer to transfer.
    """

    def __init__(self, mission_type: MissionType, round_trip: RoundTrip) -> None:
        self._w = Waiting(round_trip)
        self._most = mission_type.empty_count
        self._acknowledged = False
        self._denied = False

    @property
    def result(self) -> str | None:
        """How it ended; None while it runs."""
        return self._w.result

    @property
    def deadline_s(self) -> float:
        """When `on_time` wants to be called."""
        return self._w.wake_s

    @property
    def fraction(self) -> float:
        """How far it is."""
        return float(self.result == SUCCESS)

    def start(self, now_s: float) -> list[Sent]:
        """Ask for it."""
        self._w.progress(now_s)
        return [SendClear()]

    def hear(self, heard: Heard, now_s: float) -> list[Sent]:
        """Take in the acceptance, the count that proves it, or a refusal."""
        w = self._w
        if self.result is not None:
            return []
        if isinstance(heard, Count):
            # Before the vehicle's word on this clearing, a count may be of the list before it; and
            # where items are left after it, the word was a late one on something else.
            if self._acknowledged and heard.total <= self._most:
                w.result = SUCCESS
            self._acknowledged = False
            return []
        if not isinstance(heard, Ack):
            return []
        if heard.result == ACK_ACCEPTED:
            self._acknowledged = True
            w.silences = 0
            w.wait(now_s)
            return [AskList()]
        if heard.result in (ACK_DENIED, ACK_ERROR):
            # DENIED is said while another transfer is held open; ERROR follows it.
            self._denied = self._denied or heard.result == ACK_DENIED
            w.doubt = w.doubt or result_name(heard.result)
        return []

    def on_time(self, now_s: float) -> list[Sent]:
        """Ask again; give up after a while."""
        w = self._w
        if self.result is not None or now_s < w.wake_s:
            return []
        patience_s = HOLD_S if self._denied else GIVE_UP_S
        refused = w.doubt == ERROR and not self._denied and w.silences >= 3
        if refused or now_s - w.progress_s > patience_s:
            w.result = DENIED if self._denied else w.doubt or TIMEOUT
            return []
        w.silences += 1
        w.doubt_tested = True
        w.wait(now_s)
        return [AskList()] if self._acknowledged else [SendClear()]

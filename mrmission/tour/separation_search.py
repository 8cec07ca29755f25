"""Which way round each robot goes, and when it starts, so that few can meet.

For every pair of robots and every choice of their ways, a table over the difference of their
starts tells whether any two of their legs can come within the distance, and how many such meetings
are to be expected: a meeting that needs a difference within an interval of :math:`m` seconds, when
the times may be wrong by :math:`e` either way, is met with a chance of at most :math:`m / 2e`.
Robot by robot the best way and start is taken, again and again until nothing changes, from several
orders; each answer costs one look at the tables of the robot.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import combinations, permutations, product

import numpy as np
import numpy.typing as npt
from numba import njit

from mrmission.model import FloatArray, IntArray
from mrmission.tour.separation_kernel import near_legs

MOST_STEPS = 360
"""Steps of the longest start delay; a step is a whole number of seconds."""
MOST_TABLE = 16_000_000
"""Entries of all tables together; with very many robots the steps become longer."""
ALL_STARTS = 4
"""Up to so many robots every order and every choice of ways is tried first, else
:data:`SOME_STARTS`."""
SOME_STARTS = 12
MOST_ROUNDS = 40
LEAST_GRAVITY = 0.05
"""What a meeting weighs at the very distance to be kept."""
CONFLICT = 1000.0
"""What a pair that can meet weighs, in expected meetings, while no meeting at all is sought."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Course:
    """A time line ready for the kernels: progress (n,), places (n, 2), boxes; n is 2 or more."""

    time_s: FloatArray
    points_m: FloatArray
    boxes: FloatArray

    @property
    def duration_s(self) -> float:
        """Seconds from start to end."""
        return float(self.time_s[-1])


@dataclass(frozen=True, slots=True, kw_only=True)
class Launch:
    """Which of its ways each robot takes and when it starts.

    Attributes
    ----------
    way
        (k,) index into the robot's ways.
    delay_s
        (k,) seconds after the fleet's start; the smallest is 0.
    meetings
        Meetings to be expected, see the module.
    pairs
        Pairs of robots that can meet at all; 0: every pair keeps its distance.
    """

    way: IntArray
    delay_s: FloatArray
    meetings: float
    pairs: int


def best_launch(
    ways: Sequence[Sequence[Course]],
    *,
    distance_m: float,
    time_share: float,
    slack_s: float,
    max_delay_s: float,
    worth_s: float,
) -> Launch:
    """Choose a way and a start for each robot.

    A launch in which no two can meet is taken if there is one (the soonest home); else the one
    with the least of expected meetings plus seconds lost over `worth_s`.

    Parameters
    ----------
    ways
        The ways of each robot, of which one is taken; none for a robot without work.
    distance_m
        Two robots under way that are no farther apart than this meet.
    time_share, slack_s
        What times may be wrong by: a share, and each pair's starts by so many seconds.
    max_delay_s
        No robot starts later than this.
    worth_s
        How much later the last robot may be home for one expected meeting less.
    """
    count = len(ways)
    busy = [r for r in range(count) if len(ways[r])]
    if len(busy) < 2:
        return Launch(
            way=np.zeros(count, dtype=np.int64), delay_s=np.zeros(count), meetings=0.0, pairs=0
        )
    # the way given first counts as the plan; another may take a little longer
    longest_s = max(ways[r][0].duration_s for r in busy)
    width = max(len(w) for w in ways)
    pairs = len(busy) * (len(busy) - 1) // 2
    steps = max(4, min(MOST_STEPS, MOST_TABLE // (pairs * width * width * 2)))
    step_s = max(1.0, math.ceil(max_delay_s / steps))
    steps = int(max_delay_s // step_s)
    pair_of, hit, meetings = _tables(
        ways, busy, steps, step_s,
        distance_m=distance_m, time_share=time_share, slack_s=slack_s,
    )  # fmt: skip
    duration = np.zeros((count, width))
    some = np.zeros(count, dtype=np.int64)
    for r in busy:
        some[r] = len(ways[r])
        duration[r, : some[r]] = [c.duration_s for c in ways[r]]
    strict = meetings + np.float32(CONFLICT) * hit
    for table in (strict, meetings):
        best: tuple[float, IntArray, IntArray] | None = None
        for order, given in _starts(busy, some, duration[:, 0]):
            way = np.zeros(count, dtype=np.int64)
            delay = np.zeros(count, dtype=np.int64)
            value = _settle(
                order, given, pair_of, table, some, duration, way, delay,
                step_s, longest_s, max(worth_s, 1e-3), MOST_ROUNDS,
            )  # fmt: skip
            if best is None or value < best[0] - 1e-9:
                best = (value, way, delay)
        assert best is not None  # there is at least one order
        _, way, delay = best
        expected, pairs = _sum(busy, pair_of, meetings, hit, way, delay)
        if pairs == 0:
            break
    delay[busy] -= delay[busy].min()
    return Launch(
        way=way, delay_s=delay.astype(np.float64) * step_s, meetings=expected, pairs=pairs
    )


def _starts(
    busy: Sequence[int], some: IntArray, duration_s: FloatArray
) -> Iterator[tuple[IntArray, IntArray]]:
    """Yield orders in which robots choose, and the ways (k,) they first take; -1: their choice."""
    first = sorted(busy, key=lambda r: (-duration_s[r], r))
    if len(first) <= ALL_STARTS:
        for ways in product(*(range(some[r]) for r in first)):
            given = np.full(len(some), -1, dtype=np.int64)
            given[first] = ways
            for order in permutations(first):
                yield np.array(order, dtype=np.int64), given
        return
    own_choice = np.full(len(some), -1, dtype=np.int64)
    yield np.array(first, dtype=np.int64), own_choice
    rng = np.random.default_rng(len(first))
    for number in range(1, SOME_STARTS):
        mixed = rng.permutation(np.array(first, dtype=np.int64))
        given = rng.integers(0, np.maximum(some, 1))
        yield mixed, given if number % 2 else own_choice


def _tables(
    ways: Sequence[Sequence[Course]],
    busy: Sequence[int],
    steps: int,
    step_s: float,
    *,
    distance_m: float,
    time_share: float,
    slack_s: float,
) -> tuple[IntArray, npt.NDArray[np.float32], npt.NDArray[np.float32]]:
    """Return the number of each pair's table, -1 for pairs that never meet, and the tables.

    The tables are (pairs, ways, ways, 2·steps + 1) over the difference of the starts, from
    -steps to steps: 1 where the two can meet, and the meetings to be expected.
    """
    count, width = len(ways), max(len(w) for w in ways)
    pair_of = np.full((count, count), -1, dtype=np.int64)
    hits: list[npt.NDArray[np.float32]] = []
    values: list[npt.NDArray[np.float32]] = []
    for i, j in combinations(busy, 2):
        hit = np.zeros((width, width, 2 * steps + 1), dtype=np.float32)
        value = np.zeros_like(hit)
        found = False
        for v, mine in enumerate(ways[i]):
            for w, other in enumerate(ways[j]):
                _, rows = near_legs(
                    mine.time_s, mine.points_m, mine.boxes,
                    other.time_s, other.points_m, other.boxes,
                    distance_m, time_share, slack_s, steps * step_s,
                )  # fmt: skip
                if len(rows):
                    found = True
                    _add_rows(rows, steps, step_s, distance_m, hit[v, w], value[v, w])
        if found:
            pair_of[i, j] = pair_of[j, i] = len(hits)
            hits.append(hit)
            values.append(value)
    if not hits:
        none = np.zeros((0, width, width, 2 * steps + 1), dtype=np.float32)
        return pair_of, none, none
    return pair_of, np.stack(hits), np.stack(values)


@njit(cache=True, error_model="numpy")
def gravity(least, reach):  # type: ignore[no-untyped-def]
    """Return what a meeting weighs by how near the ways lie: 1 where they cross, else less.

    Lanes side by side, a little nearer than the distance, are no collision.
    """
    return max(LEAST_GRAVITY, 1.0 - (least / reach) ** 2)


@njit(cache=True, error_model="numpy")
def _add_rows(rows, steps, step_s, reach, hit, value):  # type: ignore[no-untyped-def]
    """Enter rows of :func:`near_legs` into the tables of one pair of ways, in O(rows + steps).

    The chance over the lag is a trapezoid, entered by the changes of its slope at four corners.
    """
    size = 2 * steps + 1
    change = np.zeros(size + 1)
    bend = np.zeros(size + 3)
    for r in range(len(rows)):
        low, high = rows[r, 0], rows[r, 1]
        first = max(0, math.ceil(low / step_s) + steps)
        last = min(size - 1, math.floor(high / step_s) + steps)
        if first > last:
            continue
        change[first] += 1.0
        change[last + 1] -= 1.0
        certain = rows[r, 3] - rows[r, 2]
        wrong = max(high - low - certain, 1e-3)
        ramp = max(min(certain, wrong), 1e-3)
        slope = min(1.0, certain / wrong) / ramp * gravity(rows[r, 8], reach)
        for k in range(4):
            at = low if k == 0 else low + ramp if k == 1 else high - ramp if k == 2 else high
            up = slope if k == 0 or k == 3 else -slope
            at = min(max(at / step_s + steps, -1e9), 1e9)
            if at < 0.0:
                # a bend before the table: its slope and its height at the first two entries
                bend[0] += up * (0.0 - at) * step_s
                bend[1] += up * step_s - up * (0.0 - at) * step_s
                continue
            g = math.floor(at)
            if g + 1 < size + 2:
                bend[g + 1] += up * (g + 1 - at) * step_s
                bend[g + 2] += up * (at - g) * step_s
    on, slope, height = 0.0, 0.0, 0.0
    for g in range(size):
        on += change[g]
        slope += bend[g]
        height += slope
        if on > 0.5:
            hit[g] = 1.0
            value[g] = max(height, 1e-6)


@njit(cache=True, error_model="numpy")
def _respond(  # type: ignore[no-untyped-def]
    r, given, placed, pair_of, table, some, duration, way, delay, step_s, longest, worth, cost
):
    """Give robot `r` its best way and delay against those placed; return whether that changed.

    ``given[r]`` is the way it must take, -1: any.
    """
    steps = table.shape[3] // 2
    end = longest
    for j in range(len(placed)):
        if placed[j] and j != r:
            end = max(end, delay[j] * step_s + duration[j, way[j]])
    for v in range(some[r]):
        for d in range(steps + 1):
            done = d * step_s + duration[r, v]
            # among equals the earlier start, then the way as planned
            cost[v, d] = (max(end, done) - longest) / worth + 1e-7 * d + 1e-8 * v
    for j in range(len(placed)):
        p = pair_of[r, j]
        if p < 0 or j == r or not placed[j]:
            continue
        for v in range(some[r]):
            if r < j:
                row = table[p, v, way[j]]
                for d in range(steps + 1):
                    cost[v, d] += row[delay[j] - d + steps]
            else:
                row = table[p, way[j], v]
                for d in range(steps + 1):
                    cost[v, d] += row[d - delay[j] + steps]
    best_v, best_d = way[r], delay[r]
    best = cost[best_v, best_d] - 1e-12 if placed[r] else np.inf
    for v in range(some[r]):
        if given[r] >= 0 and v != given[r]:
            continue
        for d in range(steps + 1):
            if cost[v, d] < best:
                best, best_v, best_d = cost[v, d], v, d
    changed = best_v != way[r] or best_d != delay[r]
    way[r], delay[r] = best_v, best_d
    return changed


@njit(cache=True, error_model="numpy")
def _settle(  # type: ignore[no-untyped-def]
    order, given, pair_of, table, some, duration, way, delay, step_s, longest, worth, rounds
):
    """Choose ways and delays in place, in an order, until nobody gains; return their cost."""
    count, steps = len(some), table.shape[3] // 2
    placed = np.zeros(count, np.bool_)
    cost = np.zeros((duration.shape[1], steps + 1))
    none = np.full(count, -1)
    for r in order:
        _respond(
            r, given, placed, pair_of, table, some, duration, way, delay, step_s, longest, worth,
            cost,
        )  # fmt: skip
        placed[r] = True
    for _ in range(rounds):
        changed = False
        for r in order:
            if _respond(
                r, none, placed, pair_of, table, some, duration, way, delay, step_s, longest,
                worth, cost,
            ):  # fmt: skip
                changed = True
        if not changed:
            break
    least = delay[order].min()
    total, end = 0.0, longest
    for a in range(len(order)):
        r = order[a]
        end = max(end, (delay[r] - least) * step_s + duration[r, way[r]])
        total += 1e-7 * (delay[r] - least) + 1e-8 * way[r]
        for b in range(a):
            j = order[b]
            i, k = min(r, j), max(r, j)
            if pair_of[i, k] >= 0:
                total += table[pair_of[i, k], way[i], way[k], delay[k] - delay[i] + steps]
    return total + (end - longest) / worth


def _sum(
    busy: Sequence[int],
    pair_of: IntArray,
    meetings: npt.NDArray[np.float32],
    hit: npt.NDArray[np.float32],
    way: IntArray,
    delay: IntArray,
) -> tuple[float, int]:
    """Return the expected meetings of a launch and the number of pairs that can meet."""
    steps = meetings.shape[3] // 2
    expected, pairs = 0.0, 0
    for i, j in combinations(busy, 2):
        p = pair_of[i, j]
        if p >= 0:
            at = p, way[i], way[j], delay[j] - delay[i] + steps
            expected += float(meetings[at])
            pairs += int(hit[at] > 0)
    return expected, pairs

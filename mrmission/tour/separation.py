r"""When each robot starts, so that no two come near each other while both are under way.

The robots do not talk to each other, so all that keeps them apart is when they start. With
:math:`p_i(t)` the place of robot :math:`i` a time :math:`t` after its own start, and :math:`d_i`
its delay, robots :math:`i` and :math:`j` are within a distance :math:`D` where
:math:`|p_i(t_i) - p_j(t_j)| < D` for times with :math:`t_i + d_i = t_j + d_j`: only the difference
:math:`d_j - d_i = t_i - t_j` counts. Every pair of pieces of the two paths that lie within
:math:`D` of each other forbids an interval of that difference, widened by what the prediction may
be wrong by at those times. The union of the intervals says which differences are free.

The delays are chosen robot by robot, each the smallest that its predecessors leave free, the
longest tour first; for few robots every order is tried, and the one with the earliest end is taken.

A robot that waits at its berth, before its start or after its end, does not count: it may be lifted
out, and berths may lie nearer together than `D`.

Hours later a time is predicted to minutes only, and keeping apart whatever might meet then would
cost more hours than it is worth. Where it costs too much, delays see to the time after the starts
alone, and the note says so.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import combinations, permutations

import numpy as np
import shapely

from mrmission.model import CoveragePath, FloatArray, RobotReport
from mrmission.tour.timing import TimeModel

DISTANCE_M = 20.0
"""Least distance that two robots under way are to keep."""
SLACK_S = 3.0
SLACK_SHARE = 0.01
"""What a predicted time may be wrong by, against that of another robot: so much, and a share."""
STEP_S = 2.0
"""Length in time of the pieces that paths are cut into, where that gives not too many."""
MOST_PIECES = 20_000
"""Pieces of all paths together; longer ones forbid more than they must, never less."""
HORIZONS_S = (math.inf, 3600.0, 900.0)
"""How long after their starts robots are kept apart: the first that is worth its delay, else the
last."""
WORTH_SHARE = 0.1
"""What the last robot may come home later for it, as a share of the longest tour."""
ALL_ORDERS = 5
"""Up to so many robots every order of choosing delays is tried."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Timeline:
    """When a robot is where: ``time_s`` (n,) from its start, ``points_m`` (n, 2)."""

    robot: int
    time_s: FloatArray
    points_m: FloatArray

    @property
    def duration_s(self) -> float:
        """Seconds from start to end."""
        return float(self.time_s[-1]) if len(self.time_s) else 0.0


def timeline(path: CoveragePath, time: TimeModel) -> Timeline:
    """Return when a robot passes the points of its path.

    What the whole path takes beyond length over speed is spent at its corners, more at a sharper
    one: the robot leaves its point later than it came, so the point is there twice.
    """
    points = path.points_m
    if len(points) < 2:
        return Timeline(robot=path.robot, time_s=np.zeros(len(points)), points_m=points)
    legs = time.legs_s(points, path.kind)
    total_s = time.duration_s(points, path.kind)
    way = np.diff(points, axis=0)
    course = np.arctan2(way[:, 1], way[:, 0])
    turn = np.append(np.abs((np.diff(course) + np.pi) % (2 * np.pi) - np.pi), 0.0)
    extra_s = total_s - float(legs.sum())
    if extra_s < 0 or turn.sum() == 0:
        legs, extra_s = legs * (total_s / legs.sum()), 0.0
    corners = extra_s * turn / turn.sum() if extra_s > 0 else np.zeros(len(legs))
    arrive = np.cumsum(legs) + np.append(0.0, np.cumsum(corners)[:-1])
    when = np.concatenate([[0.0], np.column_stack([arrive, arrive + corners]).ravel()])
    where = np.concatenate([points[:1], np.repeat(points[1:], 2, axis=0)])
    keep = np.append(True, np.diff(when) > 0)
    return Timeline(robot=path.robot, time_s=when[keep], points_m=where[keep])


def pieces_of(line: Timeline, step_s: float) -> tuple[FloatArray, FloatArray]:
    """Cut a timeline into pieces no longer than `step_s`: (n, 2) times, (n, 2, 2) ends."""
    if len(line.time_s) < 2:
        return np.zeros((0, 2)), np.zeros((0, 2, 2))
    count = np.maximum(1, np.ceil(np.diff(line.time_s) / step_s - 1e-9)).astype(np.int64)
    leg = np.repeat(np.arange(len(count)), count)
    first = np.repeat(np.cumsum(count) - count, count)
    number = np.arange(len(leg)) - first
    share = np.stack([number, number + 1], axis=1) / count[leg][:, None]
    times = line.time_s[leg][:, None] + share * np.diff(line.time_s)[leg][:, None]
    way = np.diff(line.points_m, axis=0)
    ends = line.points_m[leg][:, None, :] + share[:, :, None] * way[leg][:, None, :]
    return times, ends


def forbidden_s(
    times_i: FloatArray,
    ends_i: FloatArray,
    times_j: FloatArray,
    ends_j: FloatArray,
    distance_m: float = DISTANCE_M,
    slack_s: float = SLACK_S,
    slack_share: float = SLACK_SHARE,
) -> FloatArray:
    """Return the (n, 2) disjoint, rising intervals of ``delay_j - delay_i`` that bring i near j.

    Parameters
    ----------
    times_i, ends_i, times_j, ends_j
        Pieces as :func:`pieces_of` gives them.
    distance_m
        Which distance is too near.
    slack_s, slack_share
        What the difference of two predicted times may be wrong by: so much, and a share of the
        later one.
    """
    if not len(times_i) or not len(times_j):
        return np.zeros((0, 2))
    tree = shapely.STRtree(shapely.linestrings(ends_j))
    mine, other = tree.query(shapely.linestrings(ends_i), predicate="dwithin", distance=distance_m)
    slack = slack_s + slack_share * np.maximum(times_i[mine, 1], times_j[other, 1])
    low = times_i[mine, 0] - times_j[other, 1] - slack
    high = times_i[mine, 1] - times_j[other, 0] + slack
    return union_of(np.column_stack([low, high]))


def union_of(intervals: FloatArray) -> FloatArray:
    """Return the union of (n, 2) intervals as disjoint, rising ones.

    >>> union_of(np.array([[3.0, 4.0], [0.0, 1.0], [0.5, 2.0]])).tolist()
    [[0.0, 2.0], [3.0, 4.0]]
    """
    if not len(intervals):
        return np.zeros((0, 2))
    rising = intervals[np.argsort(intervals[:, 0], kind="stable")]
    reach = np.maximum.accumulate(rising[:, 1])
    first = np.append(True, rising[1:, 0] > reach[:-1])
    last = np.append(first[1:], True)
    return np.column_stack([rising[first, 0], reach[last]])


def earliest_s(intervals: FloatArray) -> float:
    """Return the least whole second, 0 or more, outside disjoint, rising closed intervals.

    >>> earliest_s(np.array([[-5.0, 2.5], [3.0, 7.0], [8.5, 9.0]]))
    8.0
    """
    delay_s = 0.0
    for low, high in intervals.tolist():
        if low <= delay_s <= high:
            delay_s = math.floor(high) + 1.0
    return delay_s


def start_delays_s(
    lines: Sequence[Timeline],
    *,
    distance_m: float = DISTANCE_M,
    slack_s: float = SLACK_S,
    slack_share: float = SLACK_SHARE,
    horizon_s: float = math.inf,
) -> FloatArray:
    """Return the delay of each robot's start, whole seconds, so that no two come near.

    Parameters
    ----------
    lines
        When each robot is where, from its own start. A robot without a way needs no delay.
    distance_m
        Least distance between two robots that are both under way.
    slack_s, slack_share
        See :func:`forbidden_s`.
    horizon_s
        Only places that both reach within so much time of their own starts count.

    Returns
    -------
    (k,) array
        The smallest is 0.
    """
    count = len(lines)
    total_s = sum(line.duration_s for line in lines)
    step_s = max(STEP_S, total_s / MOST_PIECES)
    pieces = []
    for line in lines:
        times, ends = pieces_of(line, step_s)
        soon = times[:, 0] <= horizon_s
        pieces.append((times[soon], ends[soon]))
    bad: dict[tuple[int, int], FloatArray] = {}
    for i, j in combinations(range(count), 2):
        found = forbidden_s(
            *pieces[i], *pieces[j],
            distance_m=distance_m, slack_s=slack_s, slack_share=slack_share,
        )  # fmt: skip
        bad[i, j] = found
        bad[j, i] = -found[::-1, ::-1]
    busy = [i for i in range(count) if len(lines[i].time_s) > 1]
    longest_first = sorted(busy, key=lambda i: (-lines[i].duration_s, i))
    orders = permutations(longest_first) if len(busy) <= ALL_ORDERS else [tuple(longest_first)]
    best: tuple[float, float, tuple[float, ...]] | None = None
    for order in orders:
        delays = _greedy(order, bad, count)
        end_s = max((delays[i] + lines[i].duration_s for i in busy), default=0.0)
        key = (end_s, sum(delays), tuple(delays))
        if best is None or key < best:
            best = key
    return np.array(best[2] if best is not None else [0.0] * count)


def _greedy(
    order: Sequence[int], bad: dict[tuple[int, int], FloatArray], count: int
) -> list[float]:
    """Return the delays when each robot of an order takes the smallest that is still free."""
    delays = [0.0] * count
    for place, j in enumerate(order):
        taken = [bad[i, j] + delays[i] for i in order[:place]]
        delays[j] = earliest_s(union_of(np.concatenate([np.zeros((0, 2)), *taken])))
    return delays


def worthwhile_delays_s(lines: Sequence[Timeline]) -> tuple[FloatArray, float]:
    """Return the delays (k,) of the longest horizon that is worth them, and that horizon, s."""
    longest_s = max((line.duration_s for line in lines), default=0.0)
    for horizon_s in HORIZONS_S:
        delays = start_delays_s(lines, horizon_s=horizon_s)
        end_s = max((d + line.duration_s for d, line in zip(delays, lines, strict=True)), default=0)
        if end_s - longest_s <= WORTH_SHARE * longest_s:
            break
    return delays, horizon_s


def delay_notes(rows: Mapping[int, RobotReport], horizon_s: float = math.inf) -> list[str]:
    """Return a note that says in which order, and when, the robots start; empty without delays.

    Parameters
    ----------
    rows
        The report's rows, by robot.
    horizon_s
        How long after their starts the delays keep them apart.
    """
    late = [row for row in rows.values() if row.start_delay_s > 0]
    if not late:
        return []
    ends = [row.duration_s + row.start_delay_s for row in rows.values()]
    later_s = max(ends) - max(row.duration_s for row in rows.values())
    queue = sorted((r for r in rows.values() if r.lanes), key=lambda r: (r.start_delay_s, r.robot))
    first = [str(r.robot) for r in queue if r.start_delay_s == 0]
    then = [f"robot {r.robot} after {r.start_delay_s:.0f} s" for r in queue if r.start_delay_s > 0]
    at_once = f"robot{'s' * (len(first) > 1)} {_some(first)} first"
    order = f"{at_once}, {_some(then)}"
    promise = f"no two under way come nearer than {DISTANCE_M:g} m"
    if math.isfinite(horizon_s):
        promise += f" in their first {horizon_s / 60:.0f} min (later ones may: look out)"
    later = f"{later_s:.0f} s later" if later_s else "no later"
    return [
        (
            f"launch {order}: then {promise}, if times are predicted to {SLACK_SHARE:.0%}; "
            f"the last one is home {later} for it"
        )
    ]


def _some(names: Sequence[str]) -> str:
    return ", ".join(names[:8]) + " …" * (len(names) > 8)

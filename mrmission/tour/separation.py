r"""Which robots of a fleet can come near each other, and what is done so that they do not.

The robots do not talk to each other, so all that keeps them apart is where they go and when. Times
are predicted, and predictions are wrong: a robot that started at :math:`d_i` is at the place of its
progress :math:`\tau` (seconds after its start) some time from :math:`d_i + (1-u)\,\tau` to
:math:`d_i + (1+u)\,\tau`, give or take what its launch is late or early. Two robots keep their
distance if no two places of their ways that are nearer can be taken at the same moment. That is
decided and measured exactly, leg by leg, in :mod:`mrmission.tour.separation_kernel`.

Only the difference of two starts counts, so the differences that let two robots meet are a union of
intervals. Each robot may sail its tour either way round, and wait before it starts:
:mod:`mrmission.tour.separation_search` chooses. What remains is told with its place and its time.

A robot that waits at its berth, before its start or after its end, does not count: it may be lifted
out, and berths may lie nearer together than the distance.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import combinations, pairwise

import numpy as np
from numba import njit

from mrmission import libm
from mrmission.model import CoveragePath, FloatArray, read_only
from mrmission.tour.path import make_path
from mrmission.tour.separation_kernel import box_tree, least_apart, near_legs, pair_distance
from mrmission.tour.separation_search import Course, best_launch, gravity
from mrmission.tour.timing import TimeModel

START_SLACK_S = 3.0
"""By how much the starts of two robots may miss the difference that they are to have."""
MAX_DELAY_SHARE = 0.1
"""The longest start delay, as a share of the longest tour, where none is given."""
WORTH_SHARE = 0.02
"""How much later the last robot may be home, as a share of the longest tour, for one expected
meeting less, where no launch is free of conflicts."""
ONE_PLACE_LEGS = 3
"""Conflicts on legs that follow on each other within so many are one."""


@dataclass(frozen=True, slots=True, kw_only=True)
class SeparationRules:
    """What is to be kept.

    Attributes
    ----------
    distance_m
        Least distance between two robots that are both under way; 0 switches all of it off.
    time_share
        What a predicted time may be wrong by, as a share of it.
    start_slack_s
        What the difference of two starts may be wrong by.
    max_delay_s
        No robot starts later than this; None takes :data:`MAX_DELAY_SHARE` of the longest tour.
    """

    distance_m: float = 20.0
    time_share: float = 0.05
    start_slack_s: float = START_SLACK_S
    max_delay_s: float | None = None


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


@dataclass(frozen=True, slots=True, kw_only=True)
class Conflict:
    """A place where two robots can come too near each other.

    Attributes
    ----------
    robots
        The two.
    least_m
        How near they can come.
    place_m
        Half-way between them when they are so near, local frame.
    from_s, to_s
        From when to when it can be, seconds after the fleet's start.
    chance
        Of the differences of time that the uncertainty allows, the share that brings the two
        within the distance: 1 is certain.
    """

    robots: tuple[int, int]
    least_m: float
    place_m: tuple[float, float]
    from_s: float
    to_s: float
    chance: float


@dataclass(frozen=True, slots=True, kw_only=True)
class Separation:
    """How a fleet is launched, and what may meet nevertheless.

    Attributes
    ----------
    rules
        What was asked for, ``max_delay_s`` filled in.
    delay_s
        (k,) seconds after the fleet's start.
    turned
        (k,) whether the robot sails its tour the other way round.
    least_m
        (k, k) how near each pair can come, symmetric; infinite where two are never under way
        together.
    conflicts
        Every place where two can come nearer than the distance, the gravest and likeliest first.
    """

    rules: SeparationRules
    delay_s: FloatArray
    turned: tuple[bool, ...]
    least_m: FloatArray
    conflicts: tuple[Conflict, ...]


def timeline(path: CoveragePath, time: TimeModel, pause_s: float = 0.0) -> Timeline:
    """Return when a robot passes the points of its path.

    Parameters
    ----------
    path
        From home to home; where it is home in between, another trip begins.
    time
        How long the robot takes for a trip, setting off and stopping included.
    pause_s
        How long it stays at home between two trips.
    """
    points = path.points_m
    if len(points) < 2:
        return Timeline(robot=path.robot, time_s=np.zeros(len(points)), points_m=points)
    at_home = np.flatnonzero((points[1:-1] == points[0]).all(axis=1)) + 1
    borders = [0, *at_home.tolist(), len(points) - 1]
    when, where = [], []
    start_s = 0.0
    for first, last in pairwise(borders):
        legs = slice(first, last)
        time_s, places = _trip_times(points[first : last + 1], path.kind[legs], time)
        when.append(start_s + time_s)
        where.append(places)
        start_s += float(time_s[-1]) + pause_s
    time_s = np.concatenate(when)
    keep = np.append(True, np.diff(time_s) > 0)
    return Timeline(robot=path.robot, time_s=time_s[keep], points_m=np.concatenate(where)[keep])


def _trip_times(
    points: FloatArray, kind: np.ndarray, time: TimeModel
) -> tuple[FloatArray, FloatArray]:
    """Return when a robot is where on a trip: (m,) seconds, (m, 2) places.

    What the whole trip takes beyond length over speed is spent at its corners, more at a sharper
    one: the robot leaves its point later than it came, so the point is there twice.
    """
    legs = time.legs_s(points, kind)
    total_s = time.duration_s(points, kind)
    way = np.diff(points, axis=0)
    course = libm.arctan2(way[:, 1], way[:, 0])
    turn = np.append(np.abs((np.diff(course) + np.pi) % (2 * np.pi) - np.pi), 0.0)
    extra_s = total_s - float(legs.sum())
    if extra_s < 0 or turn.sum() == 0:
        legs, extra_s = legs * (total_s / legs.sum()), 0.0
    corners = extra_s * turn / turn.sum() if extra_s > 0 else np.zeros(len(legs))
    arrive = np.cumsum(legs) + np.append(0.0, np.cumsum(corners)[:-1])
    when = np.concatenate([[0.0], np.column_stack([arrive, arrive + corners]).ravel()])
    where = np.concatenate([points[:1], np.repeat(points[1:], 2, axis=0)])
    keep = np.append(True, np.diff(when) > 0)
    return when[keep], where[keep]


def reversed_path(path: CoveragePath) -> CoveragePath:
    """Return a path sailed the other way round, its lanes numbered anew from 1."""
    lane = path.lane[::-1]
    lane = np.where(lane > 0, lane.max(initial=0) + 1 - lane, 0)
    return make_path(path.robot, path.points_m[::-1], path.kind[::-1].tolist(), lane.tolist())


def course_of(line: Timeline) -> Course | None:
    """Return a time line ready for the kernels; None for a robot that does not move."""
    if len(line.time_s) < 2:
        return None
    points = np.ascontiguousarray(line.points_m, dtype=np.float64)
    return Course(
        time_s=np.ascontiguousarray(line.time_s, dtype=np.float64),
        points_m=points,
        boxes=box_tree(points),
    )


def separate(
    paths: Sequence[CoveragePath],
    times: Sequence[TimeModel],
    rules: SeparationRules,
    *,
    may_turn: Sequence[bool] | None = None,
    pauses_s: Sequence[float] | None = None,
) -> Separation:
    """Choose which way round each robot sails and when it starts; tell what may meet nevertheless.

    Parameters
    ----------
    paths
        One per robot, local frame.
    times
        How long each robot takes.
    rules
        What is to be kept; a distance of 0 leaves everything as it is and looks for nothing.
    may_turn
        Which robots may sail their tour the other way round; None: all.
    pauses_s
        How long each robot stays when it comes home between two trips; None: not at all.
    """
    count = len(paths)
    if rules.distance_m <= 0:
        none = np.full((count, count), np.inf)
        return Separation(
            rules=rules, delay_s=np.zeros(count), turned=(False,) * count, least_m=none,
            conflicts=(),
        )  # fmt: skip
    stay_s = [0.0] * count if pauses_s is None else list(pauses_s)
    lines = [timeline(p, t, s) for p, t, s in zip(paths, times, stay_s, strict=True)]
    back = [timeline(reversed_path(p), t, s) for p, t, s in zip(paths, times, stay_s, strict=True)]
    turns = [True] * count if may_turn is None else list(may_turn)
    longest_s = max((line.duration_s for line in lines), default=0.0)
    max_delay_s = rules.max_delay_s
    if max_delay_s is None:
        max_delay_s = MAX_DELAY_SHARE * longest_s
    ways: list[list[Course]] = []
    for there, other, turn in zip(lines, back, turns, strict=True):
        both = (course_of(there), course_of(other) if turn else None)
        ways.append([c for c in both if c is not None])
    launch = best_launch(
        ways,
        distance_m=rules.distance_m,
        time_share=rules.time_share,
        slack_s=rules.start_slack_s,
        max_delay_s=max_delay_s,
        worth_s=WORTH_SHARE * longest_s,
    )
    chosen = [back[r] if launch.way[r] else lines[r] for r in range(count)]
    return replace(
        measure(chosen, launch.delay_s, replace(rules, max_delay_s=max_delay_s)),
        turned=tuple(bool(w) for w in launch.way),
    )


def measure(lines: Sequence[Timeline], delay_s: FloatArray, rules: SeparationRules) -> Separation:
    """Return how near each pair can come, and where, if robots start with these delays.

    Parameters
    ----------
    lines
        When each robot is where, from its own start.
    delay_s
        (k,) when each starts, seconds after the fleet's start.
    rules
        What is to be kept, and what times may be wrong by.
    """
    count = len(lines)
    courses = [course_of(line) for line in lines]
    least_m = np.full((count, count), np.inf)
    found: list[Conflict] = []
    for i, j in combinations(range(count), 2):
        a, b = courses[i], courses[j]
        if a is None or b is None:
            continue
        lag = float(delay_s[j] - delay_s[i])
        apart, _, _ = least_apart(
            a.time_s, a.points_m, a.boxes, b.time_s, b.points_m, b.boxes,
            lag, rules.time_share, rules.start_slack_s,
        )  # fmt: skip
        least_m[i, j] = least_m[j, i] = apart
        if apart < rules.distance_m:
            found.extend(
                _conflicts((a, b), (lines[i].robot, lines[j].robot), delay_s[[i, j]], rules)
            )
    found.sort(key=lambda c: (-round(_risk(c, rules.distance_m), 6), c.from_s, c.robots))
    return Separation(
        rules=rules,
        delay_s=np.asarray(delay_s, dtype=np.float64),
        turned=(False,) * count,
        least_m=read_only(least_m),
        conflicts=tuple(found),
    )


def _risk(conflict: Conflict, distance_m: float) -> float:
    return conflict.chance * float(gravity(conflict.least_m, distance_m))


def _conflicts(
    pair: tuple[Course, Course],
    robots: tuple[int, int],
    delay_s: FloatArray,
    rules: SeparationRules,
) -> list[Conflict]:
    """Return the conflicts of two robots, one for each place."""
    a, b = pair
    share, slack = rules.time_share, rules.start_slack_s
    lag = float(delay_s[1] - delay_s[0])
    legs, rows = near_legs(
        a.time_s, a.points_m, a.boxes, b.time_s, b.points_m, b.boxes,
        rules.distance_m, share, slack, abs(lag),
    )  # fmt: skip
    hit = (rows[:, 0] <= lag) & (lag <= rows[:, 1])
    legs, rows = legs[hit], rows[hit]
    order = np.lexsort((legs[:, 1], legs[:, 0]))
    legs, rows = legs[order], rows[order]
    group = _groups(legs, ONE_PLACE_LEGS)
    apart = pair_distance(a.time_s, a.points_m, b.time_s, b.points_m, legs, lag, share, slack)
    certain = rows[:, 3] - rows[:, 2]
    wrong = np.maximum(rows[:, 1] - rows[:, 0] - certain, 1e-9)
    # how much of the lags that the error makes of this one lie where the two meet
    over = np.minimum(lag + wrong / 2, rows[:, 3]) - np.maximum(lag - wrong / 2, rows[:, 2])
    chance = np.clip(over / wrong, 0.0, 1.0)
    starts = np.maximum(
        delay_s[0] + (1 - share) * rows[:, 4], delay_s[1] + (1 - share) * rows[:, 6]
    )
    ends = np.minimum(delay_s[0] + (1 + share) * rows[:, 5], delay_s[1] + (1 + share) * rows[:, 7])
    out = []
    for g in range(int(group.max(initial=-1)) + 1):
        mine = np.flatnonzero(group == g)
        best = mine[int(np.argmin(apart[mine, 0]))]
        middle = (_place(a, apart[best, 1]) + _place(b, apart[best, 2])) / 2
        out.append(
            Conflict(
                robots=robots,
                least_m=float(apart[best, 0]),
                place_m=(float(middle[0]), float(middle[1])),
                from_s=float(starts[mine].min()),
                to_s=float(max(ends[mine].max(), starts[mine].min())),
                chance=float(chance[mine].max()),
            )
        )
    return out


def _place(course: Course, time_s: float) -> FloatArray:
    """Return where a robot is at a progress, (2,)."""
    return np.array([np.interp(time_s, course.time_s, course.points_m[:, k]) for k in (0, 1)])


@njit(cache=True, error_model="numpy")
def _groups(legs, apart):  # type: ignore[no-untyped-def]
    """Return the number of the group of each pair of legs, (m,), groups in order of their first.

    Pairs (m, 2), sorted, are of one group where both legs are within `apart` of each other's.
    """
    count = len(legs)
    parent = np.arange(count)
    for a in range(count):
        for b in range(a + 1, count):
            if legs[b, 0] - legs[a, 0] > apart:
                break
            if abs(legs[b, 1] - legs[a, 1]) <= apart:
                x, y = a, b
                while parent[x] != x:
                    parent[x] = parent[parent[x]]
                    x = parent[x]
                while parent[y] != y:
                    parent[y] = parent[parent[y]]
                    y = parent[y]
                if x != y:
                    parent[max(x, y)] = min(x, y)
    group = np.empty(count, np.int64)
    groups = 0
    for a in range(count):
        x = a
        while parent[x] != x:
            x = parent[x]
        if x == a:
            group[a] = groups
            groups += 1
        else:
            group[a] = group[x]
    return group

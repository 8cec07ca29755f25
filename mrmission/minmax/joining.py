"""Lanes exchanged between robots until each robot's lanes hang together, at no cost to the longest.

A search for the shortest longest tour does not mind whose lane lies where: a robot takes a lane on
its way through another's water. Such lanes bring robots near each other. Here segments of tours go
to the robot that has the lanes beside them: annealing over the number of neighbouring lanes that
belong to different robots, with tours that grow beyond the longest one punished, and the best fleet
without such tours kept.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import shapely
from numba import njit

from mrmission.minmax.problem import LaneProblem, LaneTours
from mrmission.minmax.regions import BESIDE
from mrmission.model import IntArray

STEPS_PER_LANE = 2000
MOST_STEPS = 600_000
LONGEST_SEGMENT = 8
FIRST_HEAT, LAST_HEAT = 1.0, 0.1
"""In borders between neighbouring lanes."""
PENALTY = 1_000.0
"""Borders that a tour twice as long as the longest allowed counts."""
NOTHING = 1_000_000
COST_WEIGHT = 60.0
"""Borders that one more tour's worth of travel counts."""


def beside(lines_m: Sequence[np.ndarray], spacing_m: float) -> IntArray:
    """Return (m, 2) pairs of lines that lie beside each other, smaller first, sorted."""
    lines = np.array([shapely.LineString(line) for line in lines_m], dtype=object)
    tree = shapely.STRtree(lines)
    a, b = tree.query(lines, predicate="dwithin", distance=BESIDE * spacing_m)
    pairs = np.column_stack([a, b])[a < b].astype(np.int64)
    return pairs[np.lexsort((pairs[:, 1], pairs[:, 0]))]


def borders(entries: Sequence[IntArray], pairs: IntArray) -> int:
    """Return how many pairs of neighbouring lines belong to different robots."""
    owner = np.zeros(1 + max((int(e.max()) >> 1 for e in entries if len(e)), default=0), int)
    for robot, mine in enumerate(entries):
        owner[mine >> 1] = robot
    return int((owner[pairs[:, 0]] != owner[pairs[:, 1]]).sum()) if len(pairs) else 0


def join_regions(problem: LaneProblem, tours: LaneTours, pairs: IntArray) -> LaneTours:
    """Return tours none of which is longer than the longest given, with fewer borders.

    Parameters
    ----------
    problem, tours
        What was searched, and what was found.
    pairs
        (m, 2) pairs of lines that lie beside each other.
    """
    robots, lanes = len(tours.entries), len(problem.lane_cost)
    if robots < 2 or len(pairs) == 0 or problem.end_cost is None:
        return tours  # without a matrix there are so many lanes that the search alone is enough
    routes = np.zeros((robots, lanes), dtype=np.int32)
    sizes = np.array([len(e) for e in tours.entries], dtype=np.int32)
    for robot, mine in enumerate(tours.entries):
        routes[robot, : len(mine)] = mine
    both = np.concatenate([pairs, pairs[:, ::-1]])
    both = both[np.lexsort((both[:, 1], both[:, 0]))]
    start = np.searchsorted(both[:, 0], np.arange(lanes + 1)).astype(np.int64)
    sweep, travel = problem.scales()
    steps = min(MOST_STEPS, STEPS_PER_LANE * lanes)
    cost = _join(
        routes, sizes,
        np.ascontiguousarray(problem.lane_cost), np.ascontiguousarray(problem.end_cost),
        np.ascontiguousarray(problem.home_cost), sweep, travel,
        np.ascontiguousarray(pairs), start, np.ascontiguousarray(both[:, 1]), steps,
    )  # fmt: skip
    return LaneTours(
        entries=tuple(routes[r, : sizes[r]].astype(np.int64) for r in range(robots)), cost=cost
    )


@njit(cache=True)
def _random(state):  # type: ignore[no-untyped-def]
    x = state[0]
    x ^= x << np.uint64(13)
    x ^= x >> np.uint64(7)
    x ^= x << np.uint64(17)
    state[0] = x
    return np.int64(x >> np.uint64(2))


@njit(cache=True)
def _cost(r, route, size, lane, ends, home, sweep, travel):  # type: ignore[no-untyped-def]
    """Return the cost of a tour."""
    if size == 0:
        return 0.0
    total = home[r, route[0]] + home[r, route[size - 1] ^ 1]
    for i in range(size):
        total += sweep[r] * lane[route[i] >> 1]
        if i:
            total += travel[r] * ends[route[i - 1] ^ 1, route[i]]
    return total


@njit(cache=True)
def _step(r, before, after, home, ends, travel):  # type: ignore[no-untyped-def]
    """Return the cost of going from an exit to an entry; -1 is home."""
    if before < 0 and after < 0:
        return 0.0
    if before < 0:
        return home[r, after]
    if after < 0:
        return home[r, before]
    return travel[r] * ends[before, after]


@njit(cache=True)
def _place(p, of, sizes, routes):  # type: ignore[no-untyped-def]
    """Return where line `p` is in the tour `of`."""
    at = 0
    while routes[of, at] >> 1 != p:
        at += 1
    return at


@njit(cache=True)
def _move(  # type: ignore[no-untyped-def]
    a, b, p, q, draw, routes, sizes, cost, owner, lane, ends, home, sweep, travel, start, near,
    piece, inside,
):  # fmt: skip
    """Move a segment with line `p` from tour `a` to beside line `q` of tour `b`, in place.

    Return the change in borders; where the segment would be the whole tour, nothing is done and a
    very large number returned.
    """
    na, nb = sizes[a], sizes[b]
    at = _place(p, a, sizes, routes)
    m = 1 + (draw >> 4) % LONGEST_SEGMENT
    first = max(0, at - (draw >> 16) % m)
    last = min(na - 1, first + m - 1)
    count = last - first + 1
    if count == na:
        return NOTHING
    inner, ways = 0.0, 0.0
    for i in range(count):
        piece[i] = routes[a, first + i]
        inside[piece[i] >> 1] = True
        inner += lane[piece[i] >> 1]
        if i:
            ways += ends[piece[i - 1] ^ 1, piece[i]]
    change = 0
    for i in range(count):
        mine = piece[i] >> 1
        for e in range(start[mine], start[mine + 1]):
            if not inside[near[e]]:
                change += (owner[near[e]] == a) - (owner[near[e]] == b)
    for i in range(count):
        inside[piece[i] >> 1] = False
    head, tail = piece[0], piece[count - 1] ^ 1
    before = routes[a, first - 1] ^ 1 if first else -1
    after = routes[a, last + 1] if last + 1 < na else -1
    cost[a] -= (
        sweep[a] * inner
        + travel[a] * ways
        + _step(a, before, head, home, ends, travel)
        + _step(a, tail, after, home, ends, travel)
        - _step(a, before, after, home, ends, travel)
    )
    for i in range(first, na - count):
        routes[a, i] = routes[a, i + count]
    sizes[a] = na - count
    # before or after q, as it is or turned round
    where = _place(q, b, sizes, routes)
    more, place, turned = np.inf, 0, False
    for side in range(2):
        spot = where + side
        pre = routes[b, spot - 1] ^ 1 if spot else -1
        post = routes[b, spot] if spot < nb else -1
        gap = _step(b, pre, post, home, ends, travel)
        for turn in range(2):
            enter, leave = (tail, head) if turn else (head, tail)
            added = (
                _step(b, pre, enter, home, ends, travel)
                + _step(b, leave, post, home, ends, travel)
                - gap
            )
            if added < more:
                more, place, turned = added, spot, turn == 1
    cost[b] += more + sweep[b] * inner + travel[b] * ways
    for i in range(nb - 1, place - 1, -1):
        routes[b, i + count] = routes[b, i]
    for j in range(count):
        routes[b, place + j] = piece[count - 1 - j] ^ 1 if turned else piece[j]
        owner[piece[j] >> 1] = b
    sizes[b] = nb + count
    return change


@njit(cache=True)
def _over(cost, limit):  # type: ignore[no-untyped-def]
    return max(0.0, cost / limit - 1.0)


@njit(cache=True)
def _join(routes, sizes, lane, ends, home, sweep, travel, pairs, start, near, steps):  # type: ignore[no-untyped-def]
    """Improve the routes in place; return their costs."""
    robots, lanes = routes.shape
    owner = np.zeros(lanes, np.int32)
    cost = np.zeros(robots)
    for r in range(robots):
        cost[r] = _cost(r, routes[r], sizes[r], lane, ends, home, sweep, travel)
        for i in range(sizes[r]):
            owner[routes[r, i] >> 1] = r
    limit = cost.max() * (1.0 + 1e-9)
    border = 0
    for p in range(len(pairs)):
        border += owner[pairs[p, 0]] != owner[pairs[p, 1]]
    best, best_sizes = routes.copy(), sizes.copy()
    best_value = border + COST_WEIGHT * cost.sum() / limit
    kept_a, kept_b = np.zeros(lanes, np.int32), np.zeros(lanes, np.int32)
    piece = np.zeros(LONGEST_SEGMENT, np.int32)
    inside = np.zeros(lanes, np.bool_)
    state = np.array([88172645463325252], dtype=np.uint64)
    heat = FIRST_HEAT
    for step in range(steps):
        if step % 128 == 0:
            heat = FIRST_HEAT * (LAST_HEAT / FIRST_HEAT) ** (step / steps)
        which, draw = _random(state), _random(state)
        p, q = pairs[which % len(pairs), 0], pairs[which % len(pairs), 1]
        if draw & 1:
            p, q = q, p
        a, b = owner[p], owner[q]
        if a == b:
            continue
        na, nb, cost_a, cost_b = sizes[a], sizes[b], cost[a], cost[b]
        kept_a[:na], kept_b[:nb] = routes[a, :na], routes[b, :nb]
        change = _move(
            a, b, p, q, draw, routes, sizes, cost, owner, lane, ends, home, sweep, travel,
            start, near, piece, inside,
        )  # fmt: skip
        if change == NOTHING:
            continue
        if cost[b] > limit or draw & 2:
            # something back, from where the two tours are neighbours
            draw = _random(state)
            offset = (draw >> 24) % sizes[b]
            for i in range(sizes[b]):
                back = routes[b, (i + offset) % sizes[b]] >> 1
                to = -1
                for e in range(start[back], start[back + 1]):
                    if owner[near[e]] == a:
                        to = near[e]
                if to >= 0:
                    more = _move(
                        b, a, back, to, draw, routes, sizes, cost, owner, lane, ends, home, sweep,
                        travel, start, near, piece, inside,
                    )  # fmt: skip
                    change += 0 if more == NOTHING else more
                    break
        energy = (
            change
            + COST_WEIGHT * (cost[a] + cost[b] - cost_a - cost_b) / limit
            + PENALTY * (_over(cost[a], limit) + _over(cost[b], limit))
            - PENALTY * (_over(cost_a, limit) + _over(cost_b, limit))
        )
        chance = (np.float64(_random(state) & 0xFFFFFFFFFFFF) + 0.5) / 281474976710656.0
        if energy > -np.log(chance) * heat:
            routes[a, :na], routes[b, :nb] = kept_a[:na], kept_b[:nb]
            sizes[a], sizes[b], cost[a], cost[b] = na, nb, cost_a, cost_b
            for i in range(na):
                owner[kept_a[i] >> 1] = a
            for i in range(nb):
                owner[kept_b[i] >> 1] = b
            continue
        border += change
        value = border + COST_WEIGHT * cost.sum() / limit
        if value < best_value - 1e-9 and cost.max() <= limit:
            best_value = value
            best[:] = routes
            best_sizes[:] = sizes
    routes[:] = best
    sizes[:] = best_sizes
    for r in range(robots):
        cost[r] = _cost(r, routes[r], sizes[r], lane, ends, home, sweep, travel)
    return cost

"""The lane planner: whole lanes shared among robots so that the longest tour is short.

Lanes are visited in either direction. A nearest-neighbour tour over all lanes is split where the
longest piece is shortest, then improved by annealing over the whole fleet with moves that are
priced in constant time: segments moved within and between tours, turned round where that helps,
parts of a tour reversed, tails exchanged.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
import numpy.typing as npt
from numba import njit

from mrmission.model import FloatArray, IntArray

STEPS_PER_SECOND = 3_000_000
"""Search steps that stand for one second of `time_budget`: the answer depends on the budget and
the seed, never on the machine's speed."""
NEIGHBOURS = 10
MAX_SEGMENT = 6
FIRST_POWER, LAST_POWER = 6.0, 160.0
FIRST_HEAT, LAST_HEAT = 0.1, 0.001


@dataclass(frozen=True, slots=True, kw_only=True)
class LaneProblem:
    """Lanes with two ends each; end ``2i`` and ``2i + 1`` are the ends of lane ``i``.

    Attributes
    ----------
    lane_cost
        (lanes,) cost of sweeping each lane.
    end_cost
        (2·lanes, 2·lanes) symmetric cost of travel between ends, a metric.
    home_cost
        (robots, 2·lanes) cost of travel between each robot's home and the ends.
    """

    lane_cost: FloatArray
    end_cost: FloatArray
    home_cost: FloatArray


@dataclass(frozen=True, slots=True, kw_only=True)
class LaneTours:
    """Per robot the ends at which lanes are entered, in order, and the cost of each tour."""

    entries: tuple[IntArray, ...]
    cost: FloatArray


def minmax(problem: LaneProblem, time_budget_s: float = 5.0, seed: int = 0) -> LaneTours:
    """Share lanes among the robots so that the costliest tour costs little.

    Parameters
    ----------
    problem
        Lanes, travel and homes; the number of robots is the number of homes.
    time_budget_s
        How long to search, in units of :data:`STEPS_PER_SECOND` steps; 0 gives the split tour.
    seed
        Of the search's own generator: same problem, budget and seed, same tours.
    """
    lanes, robots = len(problem.lane_cost), len(problem.home_cost)
    order = _nearest_neighbour(problem)
    routes, sizes = _split(problem, order, robots)
    cost = np.array(
        [tour_cost(problem, r, routes[r, : sizes[r]]) for r in range(robots)], dtype=np.float64
    )
    steps = int(time_budget_s * STEPS_PER_SECOND)
    if steps > 0 and lanes > 1:
        near = _neighbours(problem)
        state = np.array([(seed * 2654435761 + 88172645463325252) % 2**63], dtype=np.uint64)
        cost = _anneal(
            routes,
            sizes,
            cost,
            np.ascontiguousarray(problem.lane_cost),
            np.ascontiguousarray(problem.end_cost),
            np.ascontiguousarray(problem.home_cost),
            near,
            steps,
            state,
        )
    return LaneTours(
        entries=tuple(routes[r, : sizes[r]].astype(np.int64) for r in range(robots)), cost=cost
    )


def tour_cost(problem: LaneProblem, robot: int, entries: npt.NDArray[np.integer]) -> float:
    """Return the cost of one tour from the robot's home over the lanes and back."""
    if len(entries) == 0:
        return 0.0
    exits = entries ^ 1
    return float(
        problem.home_cost[robot, entries[0]]
        + problem.lane_cost[entries >> 1].sum()
        + problem.end_cost[exits[:-1], entries[1:]].sum()
        + problem.home_cost[robot, exits[-1]]
    )


def _nearest_neighbour(problem: LaneProblem) -> IntArray:
    """Return entry ends of all lanes, each lane the nearest to where the one before ends."""
    ends = problem.end_cost.copy()
    left = np.ones(len(ends), dtype=bool)
    at = int(np.argmin(problem.home_cost[0]))
    out = []
    while True:
        out.append(at)
        left[at] = left[at ^ 1] = False
        if not left.any():
            return np.array(out, dtype=np.int64)
        away = np.where(left, ends[at ^ 1], np.inf)
        at = int(np.argmin(away))


def _split(
    problem: LaneProblem, order: IntArray, robots: int
) -> tuple[npt.NDArray[np.int32], npt.NDArray[np.int32]]:
    """Cut a tour over all lanes into at most `robots` pieces, the costliest as cheap as can be."""
    lanes = len(order)
    to_home = problem.home_cost.mean(axis=0)
    exits = order ^ 1
    through = np.concatenate(
        [
            [0.0],
            np.cumsum(problem.lane_cost[order[1:] >> 1] + problem.end_cost[exits[:-1], order[1:]]),
        ]
    )

    def pieces(limit: float) -> list[int] | None:
        borders = [0]
        while borders[-1] < lanes:
            a = borders[-1]
            fixed = to_home[order[a]] + problem.lane_cost[order[a] >> 1] - through[a]
            fits = through[a:] + fixed + to_home[exits[a:]] <= limit
            if not fits[0] or len(borders) > robots:
                return None
            borders.append(a + (len(fits) if fits.all() else int(np.argmin(fits))))
        return borders

    low, high = 0.0, float(through[-1] + problem.lane_cost.max() + 2 * to_home.max())
    for _ in range(60):
        middle = (low + high) / 2
        low, high = (low, middle) if pieces(middle) else (middle, high)
    borders = pieces(high) or [0, lanes]
    while len(borders) <= robots:  # no robot idles while another has more than one lane
        width = np.diff(borders)
        widest = np.argmax(width).item()
        if width[widest] < 2:
            break
        borders.insert(widest + 1, borders[widest] + int(width[widest]) // 2)
    routes = np.zeros((robots, lanes), dtype=np.int32)
    sizes = np.zeros(robots, dtype=np.int32)
    for r, (a, b) in enumerate(pairwise(borders)):
        routes[r, : b - a] = order[a:b]
        sizes[r] = b - a
    return routes, sizes


def _neighbours(problem: LaneProblem) -> npt.NDArray[np.int32]:
    """Return for each end the nearest ends of other lanes, nearest first."""
    ends = problem.end_cost.copy()
    n = len(ends)
    here = np.arange(n)
    ends[here, here] = np.inf
    ends[here, here ^ 1] = np.inf
    count = min(NEIGHBOURS, n - 2)
    part = np.argpartition(ends, count - 1, axis=1)[:, :count]
    rank = np.argsort(np.take_along_axis(ends, part, axis=1), axis=1, kind="stable")
    return np.ascontiguousarray(np.take_along_axis(part, rank, axis=1).astype(np.int32))


@njit(cache=True)
def _next_random(x):  # type: ignore[no-untyped-def]
    """Return the next state of a xorshift generator of 64 bits."""
    x ^= x << np.uint64(13)
    x ^= x >> np.uint64(7)
    return x ^ (x << np.uint64(17))


@njit(cache=True)
def _book(r, routes, sizes, lane, ends, home, route_of, place_of, pre):  # type: ignore[no-untyped-def]
    """Write down where the lanes of tour `r` are, and the cost from home to the exit of each."""
    for i in range(sizes[r]):
        e = routes[r, i]
        route_of[e >> 1] = r
        place_of[e >> 1] = i
        before = home[r, e] if i == 0 else pre[r, i - 1] + ends[routes[r, i - 1] ^ 1, e]
        pre[r, i] = before + lane[e >> 1]


@njit(cache=True)
def _anneal(routes, sizes, cost, lane, ends, home, near, steps, state):  # type: ignore[no-untyped-def]
    """Improve the routes in place; return their costs. See the module for the moves."""
    robots, lanes = routes.shape
    route_of = np.zeros(lanes, np.int32)
    place_of = np.zeros(lanes, np.int32)
    pre = np.zeros((robots, lanes))  # cost from home to the exit of each place
    for r in range(robots):
        _book(r, routes, sizes, lane, ends, home, route_of, place_of, pre)
    best = routes.copy()
    best_sizes = sizes.copy()
    best_cost = cost.copy()
    best_max = cost.max()
    best_sum = cost.sum()
    scratch = np.zeros(lanes, np.int32)
    scratch_b = np.zeros(lanes, np.int32)
    top = np.argmax(cost)
    x = state[0]
    power = FIRST_POWER
    heat = FIRST_HEAT
    reference = cost.max()
    for step in range(steps):
        if step % 256 == 0:
            done = step / steps
            power = FIRST_POWER * (LAST_POWER / FIRST_POWER) ** done
            heat = FIRST_HEAT * (LAST_HEAT / FIRST_HEAT) ** done
            reference = cost.max()
            top = np.argmax(cost)
        x = _next_random(x)
        random = np.int64(x >> np.uint64(2))
        # the end e of a lane is to be joined to a near end f of another
        if random & 1 and sizes[top] > 0:
            i = (random >> 8) % sizes[top]
            own = routes[top, i] >> 1
        else:
            own = (random >> 8) % lanes
        e = 2 * own + ((random >> 1) & 1)
        f = near[e, (random >> 40) % near.shape[1]]
        a, s = route_of[own], place_of[own]
        b, p = route_of[f >> 1], place_of[f >> 1]
        e_is_exit = routes[a, s] != e
        f_is_exit = routes[b, p] != f
        kind = (random >> 3) & 3
        x = _next_random(x)
        luck = -math.log((np.float64(x >> np.uint64(11)) + 0.5) / 9007199254740992.0) * heat
        na, nb = sizes[a], sizes[b]
        if kind < 2:  # move a segment that begins (or ends) with e next to f
            m = 1 + (random >> 50) % MAX_SEGMENT
            if e_is_exit:
                first, last = max(0, s - m + 1), s
            else:
                first, last = s, min(na - 1, s + m - 1)
            if a == b and first <= p <= last:
                continue
            head, tail = routes[a, first], routes[a, last] ^ 1  # the segment's outer ends
            inner = pre[a, last] - pre[a, first] + lane[head >> 1]
            into = home[a, head] if first == 0 else ends[routes[a, first - 1] ^ 1, head]
            out = home[a, tail] if last == na - 1 else ends[tail, routes[a, last + 1]]
            if first == 0 and last == na - 1:
                join = 0.0
            elif first == 0:
                join = home[a, routes[a, last + 1]]
            elif last == na - 1:
                join = home[a, routes[a, first - 1] ^ 1]
            else:
                join = ends[routes[a, first - 1] ^ 1, routes[a, last + 1]]
            # the segment goes after place p when f is p's exit, before it otherwise
            at = p + 1 if f_is_exit else p
            if a == b and (at == first or at == last + 1):
                continue
            forward = e_is_exit != f_is_exit
            enter = head if forward else tail
            leave = tail if forward else head
            left = home[b, enter] if at == 0 else ends[routes[b, at - 1] ^ 1, enter]
            right = home[b, leave] if at == nb else ends[leave, routes[b, at]]
            if at == 0:
                gap = home[b, routes[b, 0]]
            elif at == nb:
                gap = home[b, routes[b, nb - 1] ^ 1]
            else:
                gap = ends[routes[b, at - 1] ^ 1, routes[b, at]]
            if a == b:
                new_a = cost[a] - into - out + join + left + right - gap
                gain = (new_a / reference) ** power - (cost[a] / reference) ** power
                if gain > luck:
                    continue
                k = 0
                for i in range(na + 1):
                    if i == at:
                        for j in range(last - first + 1):
                            if forward:
                                scratch[k] = routes[a, first + j]
                            else:
                                scratch[k] = routes[a, last - j] ^ 1
                            k += 1
                    if i < na and not first <= i <= last:
                        scratch[k] = routes[a, i]
                        k += 1
                for i in range(na):
                    routes[a, i] = scratch[i]
            else:
                new_a = cost[a] - into - out - inner + join
                if na == last - first + 1:
                    new_a = 0.0
                new_b = cost[b] + left + right - gap + inner
                gain = (
                    (new_a / reference) ** power
                    + (new_b / reference) ** power
                    - (cost[a] / reference) ** power
                    - (cost[b] / reference) ** power
                )
                if gain > luck or na == last - first + 1:
                    continue
                count = last - first + 1
                for i in range(count):
                    scratch[i] = routes[a, first + i] if forward else routes[a, last - i] ^ 1
                for i in range(first, na - count):
                    routes[a, i] = routes[a, i + count]
                for i in range(nb - 1, at - 1, -1):
                    routes[b, i + count] = routes[b, i]
                for i in range(count):
                    routes[b, at + i] = scratch[i]
                sizes[a] -= count
                sizes[b] += count
        elif a == b:  # reverse what lies between e and f
            if e_is_exit != f_is_exit:
                continue
            if e_is_exit:
                first, last = min(s, p) + 1, max(s, p)
            else:
                first, last = min(s, p), max(s, p) - 1
            if last < first:
                continue
            head, tail = routes[a, first], routes[a, last] ^ 1
            if first == 0:
                old_in, new_in = home[a, head], home[a, tail]
            else:
                old_in, new_in = (
                    ends[routes[a, first - 1] ^ 1, head],
                    ends[routes[a, first - 1] ^ 1, tail],
                )
            if last == na - 1:
                old_out, new_out = home[a, tail], home[a, head]
            else:
                old_out, new_out = ends[tail, routes[a, last + 1]], ends[head, routes[a, last + 1]]
            new_a = cost[a] - old_in - old_out + new_in + new_out
            gain = (new_a / reference) ** power - (cost[a] / reference) ** power
            if gain > luck:
                continue
            while first <= last:
                left_end, right_end = routes[a, first] ^ 1, routes[a, last] ^ 1
                routes[a, first], routes[a, last] = right_end, left_end
                first += 1
                last -= 1
        else:  # exchange tails so that e and f meet
            # turn both tours so that e is an exit and f an entry: costs are symmetric
            cut_a = s + 1 if e_is_exit else s  # places of a before the cut
            cut_b = p + 1 if f_is_exit else p
            ahead_a = pre[a, cut_a - 1] if cut_a > 0 else 0.0  # home .. exit before the cut
            behind_a = cost[a] - pre[a, cut_a] + lane[routes[a, cut_a] >> 1] if cut_a < na else 0.0
            ahead_b = pre[b, cut_b - 1] if cut_b > 0 else 0.0
            behind_b = cost[b] - pre[b, cut_b] + lane[routes[b, cut_b] >> 1] if cut_b < nb else 0.0
            # behind: from the entry after the cut to home
            if e_is_exit != f_is_exit:
                # a's head with b's tail, b's head with a's tail
                if cut_a + nb - cut_b == 0 or cut_b + na - cut_a == 0:
                    continue
                new_a = ahead_a
                new_b = ahead_b
                if cut_b < nb:
                    last_b = routes[b, nb - 1] ^ 1
                    new_a += behind_b - home[b, last_b] + home[a, last_b]
                    new_a += (
                        home[a, routes[b, cut_b]]
                        if cut_a == 0
                        else ends[routes[a, cut_a - 1] ^ 1, routes[b, cut_b]]
                    )
                else:
                    new_a += home[a, routes[a, cut_a - 1] ^ 1]
                if cut_a < na:
                    last_a = routes[a, na - 1] ^ 1
                    new_b += behind_a - home[a, last_a] + home[b, last_a]
                    new_b += (
                        home[b, routes[a, cut_a]]
                        if cut_b == 0
                        else ends[routes[b, cut_b - 1] ^ 1, routes[a, cut_a]]
                    )
                else:
                    new_b += home[b, routes[b, cut_b - 1] ^ 1]
            else:
                # a's head with b's head turned, a's tail turned with b's tail
                if cut_a + cut_b == 0 or (na - cut_a) + (nb - cut_b) == 0:
                    continue
                new_a = ahead_a
                if cut_b > 0:
                    first_b = routes[b, 0]
                    new_a += ahead_b - home[b, first_b] + home[a, first_b]
                    new_a += (
                        home[a, routes[b, cut_b - 1] ^ 1]
                        if cut_a == 0
                        else ends[routes[a, cut_a - 1] ^ 1, routes[b, cut_b - 1] ^ 1]
                    )
                else:
                    new_a += home[a, routes[a, cut_a - 1] ^ 1]
                new_b = behind_b
                if cut_a < na:
                    last_a = routes[a, na - 1] ^ 1
                    new_b += behind_a - home[a, last_a] + home[b, last_a]
                    new_b += (
                        home[b, routes[a, cut_a]]
                        if cut_b == nb
                        else ends[routes[a, cut_a], routes[b, cut_b]]
                    )
                else:
                    new_b += home[b, routes[b, cut_b]]
            gain = (
                (new_a / reference) ** power
                + (new_b / reference) ** power
                - (cost[a] / reference) ** power
                - (cost[b] / reference) ** power
            )
            if gain > luck:
                continue
            ka, kb = 0, 0
            for i in range(cut_a):
                scratch[ka] = routes[a, i]
                ka += 1
            if e_is_exit != f_is_exit:
                for i in range(cut_b, nb):
                    scratch[ka] = routes[b, i]
                    ka += 1
                for i in range(cut_b):
                    scratch_b[kb] = routes[b, i]
                    kb += 1
                for i in range(cut_a, na):
                    scratch_b[kb] = routes[a, i]
                    kb += 1
            else:
                for i in range(cut_b - 1, -1, -1):
                    scratch[ka] = routes[b, i] ^ 1
                    ka += 1
                for i in range(na - 1, cut_a - 1, -1):
                    scratch_b[kb] = routes[a, i] ^ 1
                    kb += 1
                for i in range(cut_b, nb):
                    scratch_b[kb] = routes[b, i]
                    kb += 1
            for i in range(ka):
                routes[a, i] = scratch[i]
            for i in range(kb):
                routes[b, i] = scratch_b[i]
            sizes[a], sizes[b] = ka, kb
        # accepted: bring the books of the two tours up to date
        for turn in range(2):
            r = a if turn == 0 else b
            if turn == 1 and a == b:
                break
            _book(r, routes, sizes, lane, ends, home, route_of, place_of, pre)
            n = sizes[r]
            cost[r] = pre[r, n - 1] + home[r, routes[r, n - 1] ^ 1] if n > 0 else 0.0
        top_cost = cost.max()
        if top_cost < best_max - 1e-9 or (top_cost <= best_max and cost.sum() < best_sum - 1e-9):
            best_max = top_cost
            best_sum = cost.sum()
            best[:] = routes
            best_sizes[:] = sizes
            best_cost[:] = cost
    routes[:] = best
    sizes[:] = best_sizes
    cost[:] = best_cost
    return cost

"""The search of the lane planner: lines shared among robots so that the longest tour is short.

Lines are swept in either direction. One tour over all of them is split where the longest piece is
shortest, then improved by annealing over the whole fleet with moves that are priced in constant
time: segments moved within and between tours, turned round where that helps, segments of two tours
exchanged, parts of a tour reversed, tails exchanged.
"""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt
from numba import njit

from mrmission.minmax.problem import LaneProblem, LaneTours, tour_cost
from mrmission.minmax.split import giant_tour, split_tour
from mrmission.minmax.travel import travel_s

__all__ = ["STEPS_PER_SECOND", "LaneProblem", "LaneTours", "minmax", "tour_cost"]

STEPS_PER_SECOND = 1_500_000
"""Search steps that stand for one second of `time_budget`: the answer depends on the budget and
the seed, never on the machine's speed."""
NEIGHBOURS = 12
MAX_SEGMENT = 8
FIRST_POWER, LAST_POWER = 6.0, 160.0
FIRST_HEAT = 5.0
LAST_HEAT = 0.02
"""At first, and at last, a tour grows by so many ways to a nearest end in one move of three."""
AGAIN_POWER, AGAIN_HEAT = 40.0, 0.1
"""What a search begins with that goes on from tours of an earlier one."""
LOOK_STEPS, FEW_LINES = 1024, 200
"""So many steps at least lie between looks at whether the tours are the best so far; few lines are
looked at whenever they change."""


def minmax(
    problem: LaneProblem,
    time_budget_s: float = 5.0,
    seed: int = 0,
    start: LaneTours | None = None,
) -> LaneTours:
    """Share lines among the robots so that the costliest tour costs little.

    Parameters
    ----------
    problem
        Lines, travel and homes; the number of robots is the number of homes.
    time_budget_s
        How long to search, in units of :data:`STEPS_PER_SECOND` steps; 0 gives the split tour.
    seed
        Of the search's own generator: same problem, budget and seed, same tours.
    start
        Tours to go on from, with small steps; None begins anew.
    """
    lanes, robots = len(problem.lane_cost), problem.robots
    if start is None:
        routes, sizes = split_tour(problem, giant_tour(problem))
    else:
        routes, sizes = _filled_up(start, lanes)
    cost = np.array(
        [tour_cost(problem, r, routes[r, : sizes[r]]) for r in range(robots)], dtype=np.float64
    )
    steps = int(time_budget_s * STEPS_PER_SECOND)
    if steps > 0 and lanes > 1:
        first = (FIRST_POWER, FIRST_HEAT) if start is None else (AGAIN_POWER, AGAIN_HEAT)
        cost = _search(problem, routes, sizes, cost, steps, seed, first)
    return LaneTours(
        entries=tuple(routes[r, : sizes[r]].astype(np.int64) for r in range(robots)), cost=cost
    )


def _filled_up(tours: LaneTours, lanes: int) -> tuple[npt.NDArray[np.int32], npt.NDArray[np.int32]]:
    """Return tours as the search keeps them: see :func:`~mrmission.minmax.split.split_tour`."""
    routes = np.zeros((len(tours.entries), lanes), dtype=np.int32)
    for r, mine in enumerate(tours.entries):
        routes[r, : len(mine)] = mine
    return routes, np.array([len(mine) for mine in tours.entries], dtype=np.int32)


def _search(
    problem: LaneProblem,
    routes: npt.NDArray[np.int32],
    sizes: npt.NDArray[np.int32],
    cost: npt.NDArray[np.float64],
    steps: int,
    seed: int,
    first: tuple[float, float],
) -> npt.NDArray[np.float64]:
    """Improve the routes in place; return their costs."""
    sweep, travel = problem.scales()
    if problem.end_cost is not None:
        ends, near = np.ascontiguousarray(problem.end_cost), _neighbours(problem.end_cost)
        arrays, second_s, price = _NO_ARRAYS, _NO_SECONDS, _NO_PRICE
    else:
        assert problem.sparse is not None  # one of both is given
        ends, near = np.zeros((0, 0)), problem.sparse.near
        arrays, second_s = problem.sparse.arrays, problem.sparse.second_s
        price = problem.sparse.price
    state = np.array([(seed * 2654435761 + 88172645463325252) % 2**63], dtype=np.uint64)
    out: npt.NDArray[np.float64] = _anneal(
        routes,
        sizes,
        cost,
        np.ascontiguousarray(problem.lane_cost),
        ends,
        arrays,
        second_s,
        price,
        np.ascontiguousarray(problem.home_cost),
        sweep,
        travel,
        near,
        steps,
        state,
        *first,
    )
    return out


_NO_ARRAYS = (
    np.zeros((0, 4)),
    np.zeros(0, np.int32),
    np.zeros(1, np.int64),
    np.zeros(0, np.int32),
    np.zeros(0, np.float32),
    np.zeros((0, 5), np.float32),
)
_NO_SECONDS = np.zeros(0, np.float32)
_NO_PRICE = (
    np.zeros((0, 2)),
    np.zeros(0),
    np.zeros(1),
    np.zeros(3),
    np.zeros(0, np.int64),
    np.zeros(0),
)


def _neighbours(end_cost: npt.NDArray[np.float64]) -> npt.NDArray[np.int32]:
    """Return for each end the nearest ends of other lines, nearest first."""
    ends = end_cost.copy()
    n = len(ends)
    here = np.arange(n)
    ends[here, here] = np.inf
    ends[here, here ^ 1] = np.inf
    count = min(NEIGHBOURS, n - 2)
    part = np.argpartition(ends, count - 1, axis=1)[:, :count]
    rank = np.argsort(np.take_along_axis(ends, part, axis=1), axis=1, kind="stable")
    return np.ascontiguousarray(np.take_along_axis(part, rank, axis=1).astype(np.int32))


@njit(cache=True, inline="always")
def _next_random(x):  # type: ignore[no-untyped-def]
    """Return the next state of a xorshift generator of 64 bits."""
    x ^= x << np.uint64(13)
    x ^= x >> np.uint64(7)
    return x ^ (x << np.uint64(17))


@njit(cache=True, error_model="numpy")
def _way(ends, arrays, second_s, price, e, f):  # type: ignore[no-untyped-def]
    """Return the cost of travel between two ends, from the matrix or from the table."""
    if len(ends):
        return ends[e, f]
    return travel_s(arrays, second_s, price, e, f)


@njit(cache=True, error_model="numpy")
def _book(  # type: ignore[no-untyped-def]
    r,
    start,
    routes,
    sizes,
    lane,
    ends,
    arrays,
    second_s,
    price,
    route_of,
    place_of,
    swept,
    gone,
    was,
    was_size,
    hop,
):
    """Write down, from place `start` of tour `r` on, where its lines are, and the sums so far.

    `was` and `hop` hold the tour as it was booked last and the ways between its lines: what follows
    the last change keeps its ways, which are dear to find where no matrix is kept.
    """
    n, shift = sizes[r], was_size[r] - sizes[r]
    tail = n
    while (
        tail > start
        and tail - 1 + shift >= start
        and routes[r, tail - 1] == was[r, tail - 1 + shift]
    ):
        tail -= 1
    if shift > 0:
        for i in range(tail + 1, n):
            hop[r, i] = hop[r, i + shift]
    elif shift < 0:
        for i in range(n - 1, tail, -1):
            hop[r, i] = hop[r, i + shift]
    for i in range(max(1, start), min(tail + 1, n)):
        hop[r, i] = _way(ends, arrays, second_s, price, routes[r, i - 1] ^ 1, routes[r, i])
    for i in range(start, n):
        e = routes[r, i]
        was[r, i] = e
        route_of[e >> 1] = r
        place_of[e >> 1] = i
        if i == 0:
            swept[r, 0] = lane[e >> 1]
            gone[r, 0] = 0.0
        else:
            swept[r, i] = swept[r, i - 1] + lane[e >> 1]
            gone[r, i] = gone[r, i - 1] + hop[r, i]
    was_size[r] = n


@njit(cache=True, error_model="numpy")
def _anneal(  # type: ignore[no-untyped-def]
    routes,
    sizes,
    cost,
    lane,
    ends,
    arrays,
    second_s,
    price,
    home,
    sweep,
    travel,
    near,
    steps,
    state,
    first_power,
    first_heat,
):
    """Improve the routes in place; return their costs. See the module for the moves."""
    robots, lanes = routes.shape
    route_of = np.zeros(lanes, np.int32)
    place_of = np.zeros(lanes, np.int32)
    swept = np.zeros((robots, lanes))  # cost of sweeping from the first line to each, unscaled
    gone = np.zeros((robots, lanes))  # cost of the ways between them, without the way from home
    was = np.zeros((robots, lanes), np.int32)
    was_size = np.zeros(robots, np.int64)
    hop = np.zeros((robots, lanes))
    for r in range(robots):
        _book(
            r,
            0,
            routes,
            sizes,
            lane,
            ends,
            arrays,
            second_s,
            price,
            route_of,
            place_of,
            swept,
            gone,
            was,
            was_size,
            hop,
        )
    best = routes.copy()
    best_sizes = sizes.copy()
    best_cost = cost.copy()
    best_max = cost.max()
    best_sum = cost.sum()
    scratch = np.zeros(lanes, np.int32)
    scratch_b = np.zeros(lanes, np.int32)
    top = np.argmax(cost)
    x = state[0]
    power = first_power
    heat = 0.0
    reference = cost.max()
    unit, ways = 0.0, 0  # a usual way to a near end; the pieces of a cut line have none
    for i in range(len(near)):
        for f in near[i]:
            seconds = _way(ends, arrays, second_s, price, i, f)
            if seconds > 1e-6 * reference:
                unit += seconds
                ways += 1
                break
    unit = max(unit / max(ways, 1), 1e-6 * reference)
    look = 0
    for step in range(steps):
        if step % 256 == 0:
            done = step / steps
            top = np.argmax(cost)
            reference = cost[top]
            power = first_power * (LAST_POWER / first_power) ** done
            heat = first_heat * (LAST_HEAT / first_heat) ** done * unit * power / reference
        x = _next_random(x)
        random = np.int64(x >> np.uint64(2))
        # the end e of a line is to be joined to a near end f of another
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
        kind = (random >> 3) & 7
        x = _next_random(x)
        luck = -math.log((np.float64(x >> np.uint64(11)) + 0.5) / 9007199254740992.0) * heat
        na, nb = sizes[a], sizes[b]
        from_a, from_b = 0, 0  # the first places that a move changes
        if kind < 4 or (kind < 6 and a != b):
            # a segment that begins (or ends) with e goes next to f
            m = 1 + (random >> 50) % MAX_SEGMENT
            if e_is_exit:
                first, last = max(0, s - m + 1), s
            else:
                first, last = s, min(na - 1, s + m - 1)
            if a == b and first <= p <= last:
                continue
            count = last - first + 1
            head, tail = routes[a, first], routes[a, last] ^ 1  # the segment's outer ends
            inner_swept = swept[a, last] - swept[a, first] + lane[head >> 1]
            inner_gone = gone[a, last] - gone[a, first]
            # the segment goes after place p when f is p's exit, before it otherwise
            at = p + 1 if f_is_exit else p
            if a == b and (at == first or at == last + 1):
                continue
            forward = e_is_exit != f_is_exit
            if a == b:
                before = -1 if first == 0 else routes[a, first - 1] ^ 1
                after = -1 if last == na - 1 else routes[a, last + 1]
                new_a = cost[a]
                if before < 0:
                    new_a += home[a, after] - home[a, head]
                    new_a -= travel[a] * _way(ends, arrays, second_s, price, tail, after)
                elif after < 0:
                    new_a += home[a, before] - home[a, tail]
                    new_a -= travel[a] * _way(ends, arrays, second_s, price, before, head)
                else:
                    new_a += travel[a] * (
                        _way(ends, arrays, second_s, price, before, after)
                        - _way(ends, arrays, second_s, price, before, head)
                        - _way(ends, arrays, second_s, price, tail, after)
                    )
                enter = head if forward else tail
                leave = tail if forward else head
                if at == 0:
                    new_a += home[a, enter] - home[a, routes[a, 0]]
                    new_a += travel[a] * _way(ends, arrays, second_s, price, leave, routes[a, 0])
                elif at == na:
                    new_a += home[a, leave] - home[a, routes[a, na - 1] ^ 1]
                    new_a += travel[a] * _way(
                        ends, arrays, second_s, price, routes[a, na - 1] ^ 1, enter
                    )
                else:
                    new_a += travel[a] * (
                        _way(ends, arrays, second_s, price, routes[a, at - 1] ^ 1, enter)
                        + _way(ends, arrays, second_s, price, leave, routes[a, at])
                        - _way(ends, arrays, second_s, price, routes[a, at - 1] ^ 1, routes[a, at])
                    )
                gain = (new_a / reference) ** power - (cost[a] / reference) ** power
                if gain > luck:
                    continue
                from_a = min(first, at)
                k = 0
                for i in range(na + 1):
                    if i == at:
                        for j in range(count):
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
                # what comes back from b: nothing, or the lines beyond f, up to `back` of them
                back = 0
                if kind >= 4:
                    x = _next_random(x)
                    back = int(1 + np.int64(x >> np.uint64(5)) % MAX_SEGMENT)
                if f_is_exit:
                    first_b, last_b = at, min(nb - 1, at + back - 1)
                else:
                    first_b, last_b = max(0, at - back), at - 1
                back = last_b - first_b + 1
                if back == 0 and count == na:
                    continue  # a would idle
                before_a = -1 if first == 0 else routes[a, first - 1] ^ 1
                after_a = -1 if last == na - 1 else routes[a, last + 1]
                before_b = -1 if first_b == 0 else routes[b, first_b - 1] ^ 1
                after_b = -1 if last_b == nb - 1 else routes[b, last_b + 1]
                # cost of a's and b's rests as they are, without what joins them
                new_a = cost[a] - sweep[a] * inner_swept - travel[a] * inner_gone
                if before_a < 0:
                    new_a -= home[a, head]
                else:
                    new_a -= travel[a] * _way(ends, arrays, second_s, price, before_a, head)
                if after_a < 0:
                    new_a -= home[a, tail]
                else:
                    new_a -= travel[a] * _way(ends, arrays, second_s, price, tail, after_a)
                enter = head if forward else tail
                leave = tail if forward else head
                new_b = cost[b] + sweep[b] * inner_swept + travel[b] * inner_gone
                if before_b < 0:
                    new_b += home[b, enter]
                else:
                    new_b += travel[b] * _way(ends, arrays, second_s, price, before_b, enter)
                if after_b < 0:
                    new_b += home[b, leave]
                else:
                    new_b += travel[b] * _way(ends, arrays, second_s, price, leave, after_b)
                back_forward = True
                if back == 0:
                    if before_b < 0:
                        new_b -= home[b, after_b]
                    elif after_b < 0:
                        new_b -= home[b, before_b]
                    else:
                        new_b -= travel[b] * _way(ends, arrays, second_s, price, before_b, after_b)
                    if before_a < 0 and after_a < 0:
                        continue
                    if before_a < 0:
                        new_a += home[a, after_a]
                    elif after_a < 0:
                        new_a += home[a, before_a]
                    else:
                        new_a += travel[a] * _way(ends, arrays, second_s, price, before_a, after_a)
                else:
                    head_b, tail_b = routes[b, first_b], routes[b, last_b] ^ 1
                    back_swept = swept[b, last_b] - swept[b, first_b] + lane[head_b >> 1]
                    back_gone = gone[b, last_b] - gone[b, first_b]
                    new_b -= sweep[b] * back_swept + travel[b] * back_gone
                    if before_b < 0:
                        new_b -= home[b, head_b]
                    else:
                        new_b -= travel[b] * _way(ends, arrays, second_s, price, before_b, head_b)
                    if after_b < 0:
                        new_b -= home[b, tail_b]
                    else:
                        new_b -= travel[b] * _way(ends, arrays, second_s, price, tail_b, after_b)
                    new_a += sweep[a] * back_swept + travel[a] * back_gone
                    straight, turned = 0.0, 0.0
                    if before_a < 0:
                        straight += home[a, head_b]
                        turned += home[a, tail_b]
                    else:
                        straight += travel[a] * _way(
                            ends, arrays, second_s, price, before_a, head_b
                        )
                        turned += travel[a] * _way(ends, arrays, second_s, price, before_a, tail_b)
                    if after_a < 0:
                        straight += home[a, tail_b]
                        turned += home[a, head_b]
                    else:
                        straight += travel[a] * _way(ends, arrays, second_s, price, tail_b, after_a)
                        turned += travel[a] * _way(ends, arrays, second_s, price, head_b, after_a)
                    back_forward = straight <= turned
                    new_a += min(straight, turned)
                gain = (
                    (new_a / reference) ** power
                    + (new_b / reference) ** power
                    - (cost[a] / reference) ** power
                    - (cost[b] / reference) ** power
                )
                if gain > luck:
                    continue
                for i in range(count):
                    scratch[i] = routes[a, first + i] if forward else routes[a, last - i] ^ 1
                for i in range(back):
                    if back_forward:
                        scratch_b[i] = routes[b, first_b + i]
                    else:
                        scratch_b[i] = routes[b, last_b - i] ^ 1
                from_a, from_b = first, first_b
                _replace(routes, a, na, first, count, scratch_b, back)
                _replace(routes, b, nb, first_b, back, scratch, count)
                sizes[a] += back - count
                sizes[b] += count - back
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
            new_a = cost[a]
            if first == 0:
                new_a += home[a, tail] - home[a, head]
            else:
                before = routes[a, first - 1] ^ 1
                new_a += travel[a] * (
                    _way(ends, arrays, second_s, price, before, tail)
                    - _way(ends, arrays, second_s, price, before, head)
                )
            if last == na - 1:
                new_a += home[a, head] - home[a, tail]
            else:
                after = routes[a, last + 1]
                new_a += travel[a] * (
                    _way(ends, arrays, second_s, price, head, after)
                    - _way(ends, arrays, second_s, price, tail, after)
                )
            gain = (new_a / reference) ** power - (cost[a] / reference) ** power
            if gain > luck:
                continue
            from_a = first
            while first <= last:
                left_end, right_end = routes[a, first] ^ 1, routes[a, last] ^ 1
                routes[a, first], routes[a, last] = right_end, left_end
                first += 1
                last -= 1
        else:  # exchange tails so that e and f meet
            cut_a = s + 1 if e_is_exit else s  # lines of a before the cut
            cut_b = p + 1 if f_is_exit else p
            crossed = e_is_exit != f_is_exit  # heads keep their direction
            # unscaled: what each of the four parts sweeps, and the ways within it
            hs_a = swept[a, cut_a - 1] if cut_a > 0 else 0.0
            hg_a = gone[a, cut_a - 1] if cut_a > 0 else 0.0
            ts_a = swept[a, na - 1] - hs_a
            tg_a = gone[a, na - 1] - gone[a, cut_a] if cut_a < na else 0.0
            hs_b = swept[b, cut_b - 1] if cut_b > 0 else 0.0
            hg_b = gone[b, cut_b - 1] if cut_b > 0 else 0.0
            ts_b = swept[b, nb - 1] - hs_b
            tg_b = gone[b, nb - 1] - gone[b, cut_b] if cut_b < nb else 0.0
            # the ends at both sides of the cuts, and the outer ones; -1: nothing on that side
            in_a = routes[a, cut_a - 1] ^ 1 if cut_a > 0 else -1
            out_a = routes[a, cut_a] if cut_a < na else -1
            in_b = routes[b, cut_b - 1] ^ 1 if cut_b > 0 else -1
            out_b = routes[b, cut_b] if cut_b < nb else -1
            first_a, last_a = routes[a, 0], routes[a, na - 1] ^ 1
            first_b, last_b = routes[b, 0], routes[b, nb - 1] ^ 1
            if crossed:
                if (in_a < 0 and out_b < 0) or (in_b < 0 and out_a < 0):
                    continue
                new_a = sweep[a] * (hs_a + ts_b) + travel[a] * (hg_a + tg_b)
                new_a += home[a, first_a] if in_a >= 0 else home[a, out_b]
                new_a += home[a, last_b] if out_b >= 0 else home[a, in_a]
                if in_a >= 0 and out_b >= 0:
                    new_a += travel[a] * _way(ends, arrays, second_s, price, in_a, out_b)
                new_b = sweep[b] * (hs_b + ts_a) + travel[b] * (hg_b + tg_a)
                new_b += home[b, first_b] if in_b >= 0 else home[b, out_a]
                new_b += home[b, last_a] if out_a >= 0 else home[b, in_b]
                if in_b >= 0 and out_a >= 0:
                    new_b += travel[b] * _way(ends, arrays, second_s, price, in_b, out_a)
            else:
                if (in_a < 0 and in_b < 0) or (out_a < 0 and out_b < 0):
                    continue
                new_a = sweep[a] * (hs_a + hs_b) + travel[a] * (hg_a + hg_b)
                new_a += home[a, first_a] if in_a >= 0 else home[a, in_b]
                new_a += home[a, first_b] if in_b >= 0 else home[a, in_a]
                if in_a >= 0 and in_b >= 0:
                    new_a += travel[a] * _way(ends, arrays, second_s, price, in_a, in_b)
                new_b = sweep[b] * (ts_a + ts_b) + travel[b] * (tg_a + tg_b)
                new_b += home[b, last_a] if out_a >= 0 else home[b, out_b]
                new_b += home[b, last_b] if out_b >= 0 else home[b, out_a]
                if out_a >= 0 and out_b >= 0:
                    new_b += travel[b] * _way(ends, arrays, second_s, price, out_a, out_b)
            gain = (
                (new_a / reference) ** power
                + (new_b / reference) ** power
                - (cost[a] / reference) ** power
                - (cost[b] / reference) ** power
            )
            if gain > luck:
                continue
            from_a, from_b = cut_a, cut_b if crossed else 0
            ka, kb = 0, 0
            for i in range(cut_a):
                scratch[ka] = routes[a, i]
                ka += 1
            if crossed:
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
            _book(
                r,
                from_a if turn == 0 else from_b,
                routes,
                sizes,
                lane,
                ends,
                arrays,
                second_s,
                price,
                route_of,
                place_of,
                swept,
                gone,
                was,
                was_size,
                hop,
            )
            n = sizes[r]
            cost[r] = (
                home[r, routes[r, 0]]
                + sweep[r] * swept[r, n - 1]
                + travel[r] * gone[r, n - 1]
                + home[r, routes[r, n - 1] ^ 1]
            )
        if lanes <= FEW_LINES or step >= look:
            look = step + LOOK_STEPS
            top_cost = cost.max()
            if top_cost < best_max - 1e-9 or (
                top_cost <= best_max and cost.sum() < best_sum - 1e-9
            ):
                best_max, best_sum = top_cost, cost.sum()
                for r in range(robots):
                    best[r, : sizes[r]] = routes[r, : sizes[r]]
                best_sizes[:] = sizes
                best_cost[:] = cost
    if cost.max() < best_max:
        return cost
    for r in range(robots):
        routes[r, : best_sizes[r]] = best[r, : best_sizes[r]]
    sizes[:] = best_sizes
    cost[:] = best_cost
    return cost


@njit(cache=True, error_model="numpy")
def _replace(routes, r, size, first, count, other, many):  # type: ignore[no-untyped-def]
    """Put `many` entries in the place of `count` entries of tour `r` from `first` on."""
    shift = many - count
    if shift < 0:
        for i in range(first + count, size):
            routes[r, i + shift] = routes[r, i]
    elif shift > 0:
        for i in range(size - 1, first + count - 1, -1):
            routes[r, i + shift] = routes[r, i]
    for i in range(many):
        routes[r, first + i] = other[i]

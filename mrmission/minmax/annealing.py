"""The annealing of tours: the compiled inner loop of :mod:`mrmission.minmax.search`.

A tour is a row of ends at which lines are entered; end ``e ^ 1`` is where the line of entry e is
left. A move is drawn, priced in constant time by the sums that are kept along each tour, and made
or not. The same names mean the same everywhere:

``kinds``
    (robots,) the kind of each robot, which says what lines and ways cost it. ``qa`` and ``qb`` are
    those of robots ``a`` and ``b``.
``ends``, ``table``
    (kinds, ends, ends) travel between ends; an empty array where the table tells, which is the
    first three arguments of :func:`mrmission.minmax.travel.travel_s`, for all kinds alike.
``home``, ``sweep``, ``travel``
    (robots, ends) travel to and from each robot's home; (robots,) what lines, and travel between
    ends, of its kind are multiplied by.
``swept``, ``gone``
    (kinds, robots, lines) sums of lines up to a place in a tour, and of travel between them,
    unscaled: as each kind would have them.
``books``
    What is known of tours as they are: route and place of each line, ``swept``, ``gone``, and the
    tours when they were booked, their sizes and the travel between their lines.
"""

from __future__ import annotations

import math

import numpy as np
from numba import njit

from mrmission.minmax.travel import travel_s

MAX_SEGMENT = 8
"""A move takes up to so many lines that follow on each other."""
LAST_POWER = 160.0
LAST_HEAT = 0.02
"""At last, a tour grows by so many ways to a nearest end in one move of three."""
MOST_LUCK = 38.0
"""No move is made that is so many heats worse: no random number is as small as that takes."""
LOOK_STEPS, FEW_LINES = 1024, 200
"""So many steps at least lie between looks at whether the tours are the best so far; few lines are
looked at whenever they change."""


@njit(cache=True, inline="always")
def _next_random(x):  # type: ignore[no-untyped-def]
    """Return the next state of a xorshift generator of 64 bits."""
    x ^= x << np.uint64(13)
    x ^= x >> np.uint64(7)
    return x ^ (x << np.uint64(17))


@njit(cache=True, error_model="numpy")
def _way(ends, table, q, e, f):  # type: ignore[no-untyped-def]
    """Return the cost of travel between two ends for kind q, from its matrix or from the table."""
    if len(ends):
        return ends[q, e, f]
    arrays, second_s, price = table
    return travel_s(arrays, second_s, price, e, f)


@njit(cache=True, error_model="numpy")
def _new_books(routes, many):  # type: ignore[no-untyped-def]
    """Return books for so many kinds in which nothing is written."""
    robots, lanes = routes.shape
    return (
        np.zeros(lanes, np.int32),
        np.zeros(lanes, np.int32),
        np.zeros((many, robots, lanes)),
        np.zeros((many, robots, lanes)),
        np.zeros((robots, lanes), np.int32),
        np.zeros(robots, np.int64),
        np.zeros((many, robots, lanes)),
    )


@njit(cache=True, error_model="numpy")
def _book(r, start, routes, sizes, lane, ends, table, books):  # type: ignore[no-untyped-def]
    """Write down, from place `start` of tour `r` on, where its lines are, and the sums so far.

    What follows the last change keeps its ways, which are dear to find where no matrix is kept.
    """
    route_of, place_of, swept, gone, was, was_size, hop = books
    n, shift = sizes[r], was_size[r] - sizes[r]
    tail = n
    while (
        tail > start
        and tail - 1 + shift >= start
        and routes[r, tail - 1] == was[r, tail - 1 + shift]
    ):
        tail -= 1
    many = len(hop)
    for q in range(many):
        if shift > 0:
            for i in range(tail + 1, n):
                hop[q, r, i] = hop[q, r, i + shift]
        elif shift < 0:
            for i in range(n - 1, tail, -1):
                hop[q, r, i] = hop[q, r, i + shift]
        for i in range(max(1, start), min(tail + 1, n)):
            hop[q, r, i] = _way(ends, table, q, routes[r, i - 1] ^ 1, routes[r, i])
        for i in range(start, n):
            if i == 0:
                swept[q, r, 0] = lane[q, routes[r, 0] >> 1]
                gone[q, r, 0] = 0.0
            else:
                swept[q, r, i] = swept[q, r, i - 1] + lane[q, routes[r, i] >> 1]
                gone[q, r, i] = gone[q, r, i - 1] + hop[q, r, i]
    for i in range(start, n):
        e = routes[r, i]
        was[r, i] = e
        route_of[e >> 1] = r
        place_of[e >> 1] = i
    was_size[r] = n


@njit(cache=True, error_model="numpy")
def _move_within(r, first, last, at, forward, routes, size, scratch):  # type: ignore[no-untyped-def]
    """Put the lines of tour r from place `first` to `last` before place `at`."""
    k = 0
    for i in range(size + 1):
        if i == at:
            for j in range(last - first + 1):
                scratch[k] = routes[r, first + j] if forward else routes[r, last - j] ^ 1
                k += 1
        if i < size and not first <= i <= last:
            scratch[k] = routes[r, i]
            k += 1
    for i in range(size):
        routes[r, i] = scratch[i]


@njit(cache=True, error_model="numpy")
def _exchange(  # type: ignore[no-untyped-def]
    a, first, last, forward, b, first_b, last_b, back_forward, routes, sizes, scratch, scratch_b
):
    """Put a segment of each of two tours in the place of the other's, turned round or not.

    That of b may be empty: `last_b` is then one less than `first_b`.
    """
    count, back = last - first + 1, last_b - first_b + 1
    for i in range(count):
        scratch[i] = routes[a, first + i] if forward else routes[a, last - i] ^ 1
    for i in range(back):
        scratch_b[i] = routes[b, first_b + i] if back_forward else routes[b, last_b - i] ^ 1
    _replace(routes, a, sizes[a], first, count, scratch_b, back)
    _replace(routes, b, sizes[b], first_b, back, scratch, count)
    sizes[a] += back - count
    sizes[b] += count - back


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


@njit(cache=True, error_model="numpy")
def _reverse(r, first, last, routes):  # type: ignore[no-untyped-def]
    """Turn round the lines of tour r from place `first` to `last`."""
    while first <= last:
        left_end, right_end = routes[r, first] ^ 1, routes[r, last] ^ 1
        routes[r, first], routes[r, last] = right_end, left_end
        first += 1
        last -= 1


@njit(cache=True, error_model="numpy")
def _exchange_tails(  # type: ignore[no-untyped-def]
    a, cut_a, b, cut_b, crossed, routes, sizes, scratch, scratch_b
):
    """Cut two tours before a place each and join them otherwise.

    `crossed`: each head goes on with the other's tail. Else the heads are joined to each other, the
    second turned round, and so are the tails.
    """
    na, nb = sizes[a], sizes[b]
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


@njit(cache=True, error_model="numpy")
def _usual_way(near, ends, table, least):  # type: ignore[no-untyped-def]
    """Return the mean cost of travel from an end to the nearest one; no less than `least`."""
    total, count = 0.0, 0  # the pieces of a cut line have no way between them
    for i in range(len(near)):
        for f in near[i]:
            seconds = _way(ends, table, 0, i, f)
            if seconds > least:
                total += seconds
                count += 1
                break
    return max(total / max(count, 1), least)


@njit(cache=True, error_model="numpy")
def _weigh(r, cost, weights, scale):  # type: ignore[no-untyped-def]
    """Write down the power of a tour's cost, and one over the cost."""
    energy, inverse = weights
    reference, power, _ = scale
    energy[r] = (cost[r] / reference) ** power
    inverse[r] = 1.0 / cost[r]


@njit(cache=True, inline="always")
def least_growth(more, inverse, energy, power):  # type: ignore[no-untyped-def]
    """Return what the power of a tour's cost grows by at least.

    (1 + u)^p is at least its first terms where u > 0 and p >= 3, else at least 1 + p u, and 0. That
    is enough to turn down most moves; powers are dear.
    """
    u = more * inverse
    if u < 0.0:
        return energy * max(power * u, -1.0)
    return energy * power * u * (1.0 + 0.5 * (power - 1.0) * u * (1.0 + (power - 2.0) / 3.0 * u))


@njit(cache=True, error_model="numpy")
def _refused(r, new, cost, weights, scale, chance):  # type: ignore[no-untyped-def]
    """Return whether a tour does not become so costly, by a random number of 64 bits."""
    energy, inverse = weights
    reference, power, heat = scale
    if least_growth(new - cost[r], inverse[r], energy[r], power) > MOST_LUCK * heat:
        return True
    return (new / reference) ** power - energy[r] > _luck(chance, heat)


@njit(cache=True, error_model="numpy")
def _both_refused(  # type: ignore[no-untyped-def]
    a, new_a, b, new_b, cost, weights, scale, chance
):
    """Return whether two tours do not become so costly, by a random number of 64 bits."""
    energy, inverse = weights
    reference, power, heat = scale
    least = least_growth(new_a - cost[a], inverse[a], energy[a], power)
    least += least_growth(new_b - cost[b], inverse[b], energy[b], power)
    if least > MOST_LUCK * heat:
        return True
    grown = (new_a / reference) ** power + (new_b / reference) ** power
    return grown - energy[a] - energy[b] > _luck(chance, heat)


@njit(cache=True, inline="always")
def _luck(x, heat):  # type: ignore[no-untyped-def]
    """Return how much worse a move may be, by a random number of 64 bits."""
    return -math.log((np.float64(x >> np.uint64(11)) + 0.5) / 9007199254740992.0) * heat


@njit(cache=True, error_model="numpy")
def anneal(  # type: ignore[no-untyped-def]
    routes,
    sizes,
    cost,
    lane,
    ends,
    table,
    kinds,
    home,
    sweep,
    travel,
    near,
    steps,
    state,
    first_power,
    first_heat,
):
    """Improve the routes in place; return their costs.

    Parameters
    ----------
    routes, sizes, cost
        (robots, lines) entries of each robot's lines, (robots,) how many, and what they cost.
    lane
        (kinds, lines) cost of sweeping each.
    ends, table, kinds, home, sweep, travel
        See the module.
    near
        (ends, any) nearest ends of other lines.
    steps
        How many moves are drawn.
    state
        (1,) of the random generator.
    first_power, first_heat
        What is made small is the sum of costs to a power that grows from this one to
        :data:`LAST_POWER`; heat falls to :data:`LAST_HEAT`.
    """
    # moves are priced here, not in functions of their own: those took a third more time
    robots, lanes = routes.shape
    many = len(lane)
    books = _new_books(routes, many)
    route_of, place_of, swept, gone, _, _, hop = books
    for r in range(robots):
        _book(r, 0, routes, sizes, lane, ends, table, books)
    best = routes.copy()
    best_sizes = sizes.copy()
    best_cost = cost.copy()
    best_max = cost.max()
    best_sum = cost.sum()
    scratch = np.zeros(lanes, np.int32)
    scratch_b = np.zeros(lanes, np.int32)
    top = np.argmax(cost)
    x = state[0]
    unit = _usual_way(near, ends, table, 1e-6 * cost.max())
    look = 0
    weights = np.zeros(robots), np.zeros(robots)
    scale = cost.max(), first_power, 0.0
    near_s = np.zeros((many, *near.shape))
    for q in range(many):
        for i in range(near.shape[0]):
            for j in range(near.shape[1]):
                near_s[q, i, j] = _way(ends, table, q, i, near[i, j])
    for step in range(steps):
        if step % 256 == 0:
            done = step / steps
            top = np.argmax(cost)
            reference = cost[top]
            power = first_power * (LAST_POWER / first_power) ** done
            heat = first_heat * (LAST_HEAT / first_heat) ** done * unit * power / reference
            scale = reference, power, heat
            for r in range(robots):
                _weigh(r, cost, weights, scale)
        x = _next_random(x)
        random = np.int64(x >> np.uint64(2))
        # the end e of a line is to be joined to a near end f of another
        if random & 1 and sizes[top] > 0:
            i = (random >> 8) % sizes[top]
            own = routes[top, i] >> 1
        else:
            own = (random >> 8) % lanes
        e = 2 * own + ((random >> 1) & 1)
        j = (random >> 40) % near.shape[1]
        f = near[e, j]
        a, s = route_of[own], place_of[own]
        b, p = route_of[f >> 1], place_of[f >> 1]
        qa, qb = kinds[a], kinds[b]
        joined_a, joined_b = near_s[qa, e, j], near_s[qb, e, j]
        e_is_exit = routes[a, s] != e
        f_is_exit = routes[b, p] != f
        kind = (random >> 3) & 7
        x = _next_random(x)
        chance = x
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
                    new_a += home[a, after] - home[a, head] - travel[a] * hop[qa, a, last + 1]
                elif after < 0:
                    new_a += home[a, before] - home[a, tail] - travel[a] * hop[qa, a, first]
                else:
                    new_a += travel[a] * (
                        _way(ends, table, qa, before, after)
                        - hop[qa, a, first]
                        - hop[qa, a, last + 1]
                    )
                # e and f are joined; the segment's other end meets what was beside f
                other = head if e == tail else tail
                new_a += travel[a] * joined_a
                if at == 0 or at == na:
                    new_a += home[a, other] - home[a, f]
                else:
                    beside = routes[a, at] if f_is_exit else routes[a, at - 1] ^ 1
                    new_a += travel[a] * (_way(ends, table, qa, other, beside) - hop[qa, a, at])
                if _refused(a, new_a, cost, weights, scale, chance):
                    continue
                from_a = min(first, at)
                _move_within(a, first, last, at, forward, routes, na, scratch)
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
                inner_swept = swept[qa, a, last] - swept[qa, a, first] + lane[qa, head >> 1]
                inner_gone = gone[qa, a, last] - gone[qa, a, first]
                # cost of a's and b's rests as they are, without what joins them
                new_a = cost[a] - sweep[a] * inner_swept - travel[a] * inner_gone
                if before_a < 0:
                    new_a -= home[a, head]
                else:
                    new_a -= travel[a] * hop[qa, a, first]
                if after_a < 0:
                    new_a -= home[a, tail]
                else:
                    new_a -= travel[a] * hop[qa, a, last + 1]
                # e and f are joined; the segment's other end meets what lies beyond what goes back
                other = head if e == tail else tail
                beyond = after_b if f_is_exit else before_b
                if qa != qb:
                    inner_swept = swept[qb, a, last] - swept[qb, a, first] + lane[qb, head >> 1]
                    inner_gone = gone[qb, a, last] - gone[qb, a, first]
                new_b = cost[b] + sweep[b] * inner_swept + travel[b] * (inner_gone + joined_b)
                if beyond < 0:
                    new_b += home[b, other]
                else:
                    new_b += travel[b] * _way(ends, table, qb, other, beyond)
                back_forward = True
                if back == 0:
                    if before_b < 0:
                        new_b -= home[b, after_b]
                    elif after_b < 0:
                        new_b -= home[b, before_b]
                    else:
                        new_b -= travel[b] * hop[qb, b, at]
                    if before_a < 0:
                        new_a += home[a, after_a]
                    elif after_a < 0:
                        new_a += home[a, before_a]
                    else:
                        new_a += travel[a] * _way(ends, table, qa, before_a, after_a)
                else:
                    head_b, tail_b = routes[b, first_b], routes[b, last_b] ^ 1
                    back_swept = (
                        swept[qb, b, last_b] - swept[qb, b, first_b] + lane[qb, head_b >> 1]
                    )
                    back_gone = gone[qb, b, last_b] - gone[qb, b, first_b]
                    new_b -= sweep[b] * back_swept + travel[b] * back_gone
                    if before_b < 0:
                        new_b -= home[b, head_b]
                    else:
                        new_b -= travel[b] * hop[qb, b, first_b]
                    if after_b < 0:
                        new_b -= home[b, tail_b]
                    else:
                        new_b -= travel[b] * hop[qb, b, last_b + 1]
                    if qa != qb:
                        back_swept = swept[qa, b, last_b] - swept[qa, b, first_b]
                        back_swept += lane[qa, head_b >> 1]
                        back_gone = gone[qa, b, last_b] - gone[qa, b, first_b]
                    new_a += sweep[a] * back_swept + travel[a] * back_gone
                    straight, turned = 0.0, 0.0
                    if before_a < 0:
                        straight += home[a, head_b]
                        turned += home[a, tail_b]
                    else:
                        straight += travel[a] * _way(ends, table, qa, before_a, head_b)
                        turned += travel[a] * _way(ends, table, qa, before_a, tail_b)
                    if after_a < 0:
                        straight += home[a, tail_b]
                        turned += home[a, head_b]
                    else:
                        straight += travel[a] * _way(ends, table, qa, tail_b, after_a)
                        turned += travel[a] * _way(ends, table, qa, head_b, after_a)
                    back_forward = straight <= turned
                    new_a += min(straight, turned)
                if _both_refused(a, new_a, b, new_b, cost, weights, scale, chance):
                    continue
                from_a, from_b = first, first_b
                _exchange(
                    a, first, last, forward, b, first_b, last_b, back_forward, routes, sizes,
                    scratch, scratch_b,
                )  # fmt: skip
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
                way_s = joined_a if e_is_exit else _way(ends, table, qa, before, tail)
                new_a += travel[a] * (way_s - hop[qa, a, first])
            if last == na - 1:
                new_a += home[a, head] - home[a, tail]
            else:
                after = routes[a, last + 1]
                way_s = _way(ends, table, qa, head, after) if e_is_exit else joined_a
                new_a += travel[a] * (way_s - hop[qa, a, last + 1])
            if _refused(a, new_a, cost, weights, scale, chance):
                continue
            from_a = first
            _reverse(a, first, last, routes)
        else:  # exchange tails so that e and f meet
            cut_a = s + 1 if e_is_exit else s  # lines of a before the cut
            cut_b = p + 1 if f_is_exit else p
            crossed = e_is_exit != f_is_exit  # heads keep their direction
            # unscaled: what each of the four parts sweeps, and the ways within it, for the robot
            # that is to have it: heads joined to heads are a's, tails to tails b's
            q_head, q_tail = (qb, qa) if crossed else (qa, qb)  # of b's; a's tail is for b
            hs_a = swept[qa, a, cut_a - 1] if cut_a > 0 else 0.0
            hg_a = gone[qa, a, cut_a - 1] if cut_a > 0 else 0.0
            ts_a = swept[qb, a, na - 1]
            ts_a -= swept[qb, a, cut_a - 1] if cut_a > 0 else 0.0
            tg_a = gone[qb, a, na - 1] - gone[qb, a, cut_a] if cut_a < na else 0.0
            hs_b = swept[q_head, b, cut_b - 1] if cut_b > 0 else 0.0
            hg_b = gone[q_head, b, cut_b - 1] if cut_b > 0 else 0.0
            ts_b = swept[q_tail, b, nb - 1]
            ts_b -= swept[q_tail, b, cut_b - 1] if cut_b > 0 else 0.0
            tg_b = gone[q_tail, b, nb - 1] - gone[q_tail, b, cut_b] if cut_b < nb else 0.0
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
                    way_s = joined_a if e_is_exit else _way(ends, table, qa, in_a, out_b)
                    new_a += travel[a] * way_s
                new_b = sweep[b] * (hs_b + ts_a) + travel[b] * (hg_b + tg_a)
                new_b += home[b, first_b] if in_b >= 0 else home[b, out_a]
                new_b += home[b, last_a] if out_a >= 0 else home[b, in_b]
                if in_b >= 0 and out_a >= 0:
                    way_s = _way(ends, table, qb, in_b, out_a) if e_is_exit else joined_b
                    new_b += travel[b] * way_s
            else:
                if (in_a < 0 and in_b < 0) or (out_a < 0 and out_b < 0):
                    continue
                new_a = sweep[a] * (hs_a + hs_b) + travel[a] * (hg_a + hg_b)
                new_a += home[a, first_a] if in_a >= 0 else home[a, in_b]
                new_a += home[a, first_b] if in_b >= 0 else home[a, in_a]
                if in_a >= 0 and in_b >= 0:
                    way_s = joined_a if e_is_exit else _way(ends, table, qa, in_a, in_b)
                    new_a += travel[a] * way_s
                new_b = sweep[b] * (ts_a + ts_b) + travel[b] * (tg_a + tg_b)
                new_b += home[b, last_a] if out_a >= 0 else home[b, out_b]
                new_b += home[b, last_b] if out_b >= 0 else home[b, out_a]
                if out_a >= 0 and out_b >= 0:
                    way_s = _way(ends, table, qb, out_a, out_b) if e_is_exit else joined_b
                    new_b += travel[b] * way_s
            if _both_refused(a, new_a, b, new_b, cost, weights, scale, chance):
                continue
            from_a, from_b = cut_a, cut_b if crossed else 0
            _exchange_tails(a, cut_a, b, cut_b, crossed, routes, sizes, scratch, scratch_b)
        # accepted: bring the books of the two tours up to date
        for turn in range(2):
            r = a if turn == 0 else b
            if turn == 1 and a == b:
                break
            _book(r, from_a if turn == 0 else from_b, routes, sizes, lane, ends, table, books)
            n = sizes[r]
            cost[r] = (
                home[r, routes[r, 0]]
                + sweep[r] * swept[kinds[r], r, n - 1]
                + travel[r] * gone[kinds[r], r, n - 1]
                + home[r, routes[r, n - 1] ^ 1]
            )
            _weigh(r, cost, weights, scale)
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

"""Compiled kernels of the bound for lines that are each swept in one go.

Every end of a line has a charge and a depth, and some odd sets of ends have a charge for their
border; what is proven about them is in ``docs/bounds.md``. ``covers`` are those sets, one after
the other: set s has the ends ``ends[start[s]:start[s + 1]]``.
"""

from __future__ import annotations

import numpy as np
from numba import njit


@njit(cache=True)
def line_prices(makespan, depth, price):  # type: ignore[no-untyped-def]
    """Write 1 / (T - 2 depth) of the deeper end of each line; return whether T leaves room."""
    for i in range(len(price)):
        room = makespan - 2.0 * max(depth[2 * i], depth[2 * i + 1])
        if room <= 0.0:
            return False
        price[i] = 1.0 / room
    return True


@njit(cache=True)
def _leg_value(rest, price_a, price_b):  # type: ignore[no-untyped-def]
    """Return what a leg is worth: at the larger price when it costs, at the lower when it pays."""
    return rest * max(price_a, price_b) if rest >= 0.0 else rest * min(price_a, price_b)


@njit(cache=True)
def push(key, line, size, new_key, new_line):  # type: ignore[no-untyped-def]
    """Add to a heap, smallest first; return its size."""
    at = size
    while at > 0:
        above = (at - 1) >> 1
        if key[above] <= new_key:
            break
        key[at] = key[above]
        line[at] = line[above]
        at = above
    key[at] = new_key
    line[at] = new_line
    return size + 1


@njit(cache=True)
def pop(key, line, size):  # type: ignore[no-untyped-def]
    """Drop the first of a heap; return its size."""
    size -= 1
    last_key, last_line = key[size], line[size]
    at = 0
    while True:
        below = 2 * at + 1
        if below >= size:
            break
        if below + 1 < size and key[below + 1] < key[below]:
            below += 1
        if key[below] >= last_key:
            break
        key[at] = key[below]
        line[at] = line[below]
        at = below
    key[at] = last_key
    line[at] = last_line
    return size


@njit(cache=True)
def _tree(  # type: ignore[no-untyped-def]
    legs, length, home_s, charge, depth, price, value, via, via_home
):
    """Write a least tree on a sparse set of legs: per line the value and the place of its leg.

    ``via`` is the place in ``other``, -1 for a leg to home, which begins at ``via_home``.
    """
    start, other, _ = legs
    n = len(price)
    done = np.zeros(n, np.bool_)
    for i in range(n):
        value[i] = np.inf
        for b in range(2 * i, 2 * i + 2):
            worth = max(0.0, home_s[b] - charge[b] - depth[b]) * price[i]
            if worth < value[i]:
                value[i] = worth
                via[i] = -1
                via_home[i] = b
    heap_key = np.empty(len(other) + n)
    heap_line = np.empty(len(other) + n, np.int32)
    size = 0
    for i in range(n):
        size = push(heap_key, heap_line, size, value[i], i)
    while size > 0:
        at = heap_line[0]
        size = pop(heap_key, heap_line, size)
        if done[at]:
            continue
        done[at] = True
        for a in range(2 * at, 2 * at + 2):
            for q in range(start[a], start[a + 1]):
                b = other[q]
                i = b >> 1
                if done[i]:
                    continue
                rest = length[q] - charge[a] - charge[b] - abs(depth[a] - depth[b])
                worth = _leg_value(rest, price[at], price[i])
                if worth < value[i]:
                    value[i] = worth
                    via[i] = q
                    size = push(heap_key, heap_line, size, worth, i)


@njit(cache=True)
def _lowest_price(s, covers, price):  # type: ignore[no-untyped-def]
    """Return the least price of the lines with an end in set s."""
    cover_start, cover_end = covers
    least = np.inf
    for c in range(cover_start[s], cover_start[s + 1]):
        least = min(least, price[cover_end[c] >> 1])
    return least


@njit(cache=True)
def _work_value(  # type: ignore[no-untyped-def]
    line_s, charge, depth, price, covers, toll
):
    """Return the priced work: sweeping that does not go deeper, charges of ends and of sets."""
    total = 0.0
    for i in range(len(line_s)):
        a, b = 2 * i, 2 * i + 1
        total += (line_s[i] - abs(depth[a] - depth[b]) + charge[a] + charge[b]) * price[i]
    for s in range(len(toll)):
        if toll[s] > 0.0:
            total += toll[s] * _lowest_price(s, covers, price)
    return total


@njit(cache=True)
def _settle(home_s, charge, depth):  # type: ignore[no-untyped-def]
    """Keep depths and charges, in place, to what the way home allows."""
    for a in range(len(charge)):
        depth[a] = max(min(depth[a], home_s[a]), 0.0)
        charge[a] = min(charge[a], home_s[a] - depth[a])


@njit(cache=True)
def take_tolls(  # type: ignore[no-untyped-def]
    length, home_s, crossed, covers, toll, left, left_home
):
    """Write what the tolls of the sets leave of the legs, sparse ones and those to home."""
    cross_start, cross = crossed
    cover_start, cover_end = covers
    left[:] = length
    left_home[:] = home_s
    for s in range(len(toll)):
        if toll[s] <= 0.0:
            continue
        for c in range(cross_start[s], cross_start[s + 1]):
            left[cross[c]] -= toll[s]
        for c in range(cover_start[s], cover_start[s + 1]):
            left_home[cover_end[c]] -= toll[s]


@njit(cache=True)
def toll_slope(s, worth, crossed, covers, used, used_home):  # type: ignore[no-untyped-def]
    """Return by how much more toll of set s helps: what it is worth, less what crosses pays."""
    cross_start, cross = crossed
    cover_start, cover_end = covers
    slope = worth
    for c in range(cross_start[s], cross_start[s + 1]):
        slope -= used[cross[c]]
    for c in range(cover_start[s], cover_start[s + 1]):
        slope -= used_home[cover_end[c]]
    return slope


@njit(cache=True)
def with_tolls(end_s, ends, covers, toll):  # type: ignore[no-untyped-def]
    """Return the matrix with twice the toll added between ends of a set, and what each end pays.

    Less what both of its ends pay, a leg has lost the tolls of the sets whose borders it crosses.
    """
    cover_start, cover_end = covers
    extra = np.zeros(ends)
    widened = end_s
    if len(toll) > 0:
        widened = end_s.copy()
    for s in range(len(toll)):
        for c in range(cover_start[s], cover_start[s + 1]):
            extra[cover_end[c]] += toll[s]
            for d in range(cover_start[s], cover_start[s + 1]):
                widened[cover_end[c], cover_end[d]] += 2.0 * toll[s]
    return widened, extra


@njit(cache=True)
def _sparse_makespan(  # type: ignore[no-untyped-def]
    robots, line_s, legs, left, left_home, charge, depth, covers, toll
):
    """Return the makespan that charges, depths and tolls prove when there are no other legs."""
    n = len(line_s)
    price = np.zeros(n)
    value = np.zeros(n)
    via = np.zeros(n, np.int64)
    via_home = np.zeros(n, np.int64)
    low = 2.0 * depth.max() * (1.0 + 1e-9)
    high = max(low, line_s.sum() / robots) + 1e-9
    upper = False
    for _ in range(40):
        middle = 0.5 * (low + high) if upper else high
        line_prices(middle, depth, price)
        _tree(legs, left, left_home, charge, depth, price, value, via, via_home)
        found = _work_value(line_s, charge, depth, price, covers, toll)
        if found + value.sum() > robots:
            low = middle
            if not upper:
                high *= 1.5
        else:
            high = middle
            upper = True
        if upper and high - low <= 1e-5 * high:
            break
    return low


@njit(cache=True)
def _slopes(  # type: ignore[no-untyped-def]
    line_s, legs, charge, depth, price, tree, used, used_home, g_charge, g_depth
):
    """Write by how much the value rises with charges and depths, and the prices of legs used."""
    _, other, owner = legs
    value, via, via_home = tree
    n = len(line_s)
    used[:] = 0.0
    used_home[:] = 0.0
    for i in range(n):
        a, b = 2 * i, 2 * i + 1
        p = price[i]
        work = line_s[i] - abs(depth[a] - depth[b]) + charge[a] + charge[b]
        g_charge[a] = p
        g_charge[b] = p
        if depth[a] == depth[b]:
            g_depth[a] = work * p * p
            g_depth[b] = work * p * p
        else:
            deep, flat = (a, b) if depth[a] > depth[b] else (b, a)
            g_depth[deep] = 2.0 * work * p * p - p
            g_depth[flat] = p
    for i in range(n):
        p = price[i]
        if via[i] < 0:
            b = via_home[i]
            g_charge[b] -= p
            g_depth[b] -= p
            used_home[b] = p
            continue
        q = via[i]
        a, b = owner[q], other[q]
        p = max(p, price[a >> 1]) if value[i] >= 0.0 else min(p, price[a >> 1])
        used[q] = p
        g_charge[a] -= p
        g_charge[b] -= p
        if depth[a] > depth[b]:
            g_depth[a] -= p
            g_depth[b] += p
        elif depth[b] > depth[a]:
            g_depth[b] -= p
            g_depth[a] += p


@njit(cache=True)
def ascend(  # type: ignore[no-untyped-def]
    robots, line_s, home_s, legs, length, covers, crossed, charge, depth, toll, pace, means
):
    """Improve charges, depths and tolls in place; return the makespan proven on the sparse legs.

    Steps along the slope of the value at a makespan that is raised whenever the value exceeds
    the number of robots. ``pace`` is how many, the seconds of the first, the last in parts of the
    first, and how many times as far as charges depths move. ``means`` are two arrays for how often
    the later trees used each leg, and each leg to home.
    """
    rounds, step_s, last, follow = pace
    mean, mean_home = means
    n = len(line_s)
    m = 2 * n
    price = np.zeros(n)
    value = np.zeros(n)
    via = np.zeros(n, np.int64)
    via_home = np.zeros(n, np.int64)
    g_charge = np.zeros(m)
    g_depth = np.zeros(m)
    d_charge = np.zeros(m)
    d_depth = np.zeros(m)
    d_toll = np.zeros(len(toll))
    left = length.copy()
    left_home = home_s.copy()
    used = np.zeros(len(length))
    used_home = np.zeros(m)
    mean[:] = 0.0
    mean_home[:] = 0.0
    take_tolls(length, home_s, crossed, covers, toll, left, left_home)
    _settle(left_home, charge, depth)
    best = _sparse_makespan(robots, line_s, legs, left, left_home, charge, depth, covers, toll)
    best_charge = charge.copy()
    best_depth = depth.copy()
    best_toll = toll.copy()
    makespan = best
    trees = 0
    for turn in range(rounds):
        take_tolls(length, home_s, crossed, covers, toll, left, left_home)
        _settle(left_home, charge, depth)
        if not line_prices(makespan, depth, price):
            charge[:] = best_charge
            depth[:] = best_depth
            toll[:] = best_toll
            d_depth[:] = 0.0
            d_charge[:] = 0.0
            step_s *= 0.5
            makespan = best
            continue
        _tree(legs, left, left_home, charge, depth, price, value, via, via_home)
        found = value.sum() + _work_value(line_s, charge, depth, price, covers, toll)
        if found > robots:
            best = makespan
            best_charge[:] = charge
            best_depth[:] = depth
            best_toll[:] = toll
            makespan *= 1.0 + min(0.05, 0.5 * (found / robots - 1.0))
        _slopes(
            line_s, legs, charge, depth, price, (value, via, via_home), used, used_home,
            g_charge, g_depth,
        )  # fmt: skip
        if 2 * turn >= rounds:
            trees += 1
            for i in range(n):
                if via[i] >= 0:
                    mean[via[i]] += 1.0
                else:
                    mean_home[via_home[i]] += 1.0
        step = step_s * last ** (turn / rounds) * makespan
        for a in range(m):
            d_charge[a] = 0.7 * d_charge[a] + 0.3 * g_charge[a]
            charge[a] += step * d_charge[a]
            d_depth[a] = 0.7 * d_depth[a] + 0.3 * g_depth[a]
            depth[a] += follow * step * d_depth[a]
        for s in range(len(toll)):
            worth = _lowest_price(s, covers, price)
            slope = toll_slope(s, worth, crossed, covers, used, used_home)
            d_toll[s] = 0.7 * d_toll[s] + 0.3 * slope
            toll[s] = max(0.0, toll[s] + step * d_toll[s])
    charge[:] = best_charge
    depth[:] = best_depth
    toll[:] = best_toll
    if trees > 0:
        mean /= trees
        mean_home /= trees
    return best


@njit(cache=True, inline="always")
def _way(ways, a, b):  # type: ignore[no-untyped-def]
    """Return the least seconds from end to end: of a matrix, or as the crow flies without one."""
    end_s, places, slack = ways
    if len(end_s) > 0:
        return end_s[a, b]
    x = places[a, 0] - places[b, 0]
    y = places[a, 1] - places[b, 1]
    return max(0.0, np.sqrt(x * x + y * y) - slack)


@njit(cache=True)
def _dense_value(  # type: ignore[no-untyped-def]
    makespan, line_s, ways, home_s, charge, extra, depth, covers, toll, via
):
    """Return the value proven with all legs, minus infinity when depths leave no room.

    ``ways`` are a matrix, to which twice the toll has been added between ends of one set;
    ``extra`` is the sum of the tolls of the sets that an end is in, so that only what borders take
    is taken. Without a matrix, ways are those between places, in seconds, less a slack; there are
    no sets then. Legs that matter are written to ``via`` of shape (4·lines, 2): those of the tree,
    and for each end the one that owes most; -1 where there is none.
    """
    n = len(line_s)
    price = np.zeros(n)
    via[:] = -1
    if not line_prices(makespan, depth, price):
        return -np.inf
    work = np.zeros(n)
    value = np.full(n, np.inf)
    done = np.zeros(n, np.bool_)
    owed = np.zeros(2 * n)
    take = charge + extra
    for i in range(n):
        a = 2 * i
        work[i] = line_s[i] - abs(depth[a] - depth[a + 1]) + charge[a] + charge[a + 1]
        for b in range(a, a + 2):
            value[i] = min(value[i], max(0.0, home_s[b] - take[b] - depth[b]) * price[i])
    total = _work_value(line_s, charge, depth, price, covers, toll)
    for _ in range(n):
        at = -1
        for i in range(n):
            if not done[i] and (at < 0 or value[i] < value[at]):
                at = i
        done[at] = True
        total += value[at]
        for a in range(2 * at, 2 * at + 2):
            for b in range(2 * n):
                i = b >> 1
                if i == at:
                    continue
                rest = _way(ways, a, b) - take[a] - take[b]
                rest -= abs(depth[a] - depth[b])
                # a leg that pays is paid for by the line at the lower price, or with more work
                if rest < -owed[a] and (
                    price[at] < price[i]
                    or (price[at] == price[i] and (work[at], at) > (work[i], i))
                ):
                    owed[a] = -rest
                    via[2 * n + a, 0] = a
                    via[2 * n + a, 1] = b
                if not done[i]:
                    worth = _leg_value(rest, price[at], price[i])
                    if worth < value[i]:
                        value[i] = worth
                        via[i, 0] = a
                        via[i, 1] = b
    top = price.max()
    for i in range(n):
        total -= (top - price[i]) * max(0.0, owed[2 * i] + owed[2 * i + 1] - work[i])
    return total


@njit(cache=True)
def dense_makespan(  # type: ignore[no-untyped-def]
    robots, hoped, line_s, ways, home_s, charge, depth, covers, toll, via, tries
):
    """Return a makespan no more than the hoped one that all legs prove, 0 if none in some tries.

    The legs that matter at the hoped one are written to ``via``.
    """
    widened, extra = with_tolls(ways[0], len(charge), covers, toll)
    _settle(home_s - extra, charge, depth)
    wide = (widened, ways[1], ways[2])
    value = _dense_value(hoped, line_s, wide, home_s, charge, extra, depth, covers, toll, via)
    if value > robots:
        return hoped
    scrap = via.copy()
    least = 2.0 * depth.max()
    makespan = hoped
    for _ in range(tries):
        # the value is about work over room, so this comes close from either side
        makespan = least + (makespan - least) * min(max(value / robots * 0.9999, 0.5), 0.9999)
        value = _dense_value(
            makespan, line_s, wide, home_s, charge, extra, depth, covers, toll, scrap
        )
        if value > robots:
            return makespan
    return 0.0


@njit(cache=True)
def depths(line_s, ways, home_s, share):  # type: ignore[no-untyped-def]
    """Return each end's distance from home when a line takes but a share of its seconds."""
    m = len(home_s)
    depth = np.maximum(home_s, 0.0)
    done = np.zeros(m, np.bool_)
    for _ in range(m):
        a = -1
        for b in range(m):
            if not done[b] and (a < 0 or depth[b] < depth[a]):
                a = b
        done[a] = True
        for b in range(m):
            if not done[b]:
                depth[b] = min(depth[b], depth[a] + max(0.0, _way(ways, a, b)))
        depth[a ^ 1] = min(depth[a ^ 1], depth[a] + share * line_s[a >> 1])
    return depth

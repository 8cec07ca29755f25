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
def _tree(start, other, length, home_s, charge, depth, price, value, via, via_home):  # type: ignore[no-untyped-def]  # fmt: skip
    """Write a least tree on a sparse set of legs: per line the value and the place of its leg.

    ``via`` is the place in ``other``, -1 for a leg to home, which begins at ``via_home``.
    """
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
    for _ in range(n):
        at = -1
        for i in range(n):
            if not done[i] and (at < 0 or value[i] < value[at]):
                at = i
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


@njit(cache=True)
def _lowest_price(s, cover_start, cover_end, price):  # type: ignore[no-untyped-def]
    """Return the least price of the lines with an end in set s."""
    least = np.inf
    for c in range(cover_start[s], cover_start[s + 1]):
        least = min(least, price[cover_end[c] >> 1])
    return least


@njit(cache=True)
def _work_value(line_s, charge, depth, price, cover_start, cover_end, toll):  # type: ignore[no-untyped-def]  # fmt: skip
    """Return the priced work: sweeping that does not go deeper, charges of ends and of sets."""
    total = 0.0
    for i in range(len(line_s)):
        a, b = 2 * i, 2 * i + 1
        total += (line_s[i] - abs(depth[a] - depth[b]) + charge[a] + charge[b]) * price[i]
    for s in range(len(toll)):
        if toll[s] > 0.0:
            total += toll[s] * _lowest_price(s, cover_start, cover_end, price)
    return total


@njit(cache=True)
def _settle(home_s, charge, depth):  # type: ignore[no-untyped-def]
    """Keep depths and charges, in place, to what the way home allows."""
    for a in range(len(charge)):
        depth[a] = max(min(depth[a], home_s[a]), 0.0)
        charge[a] = min(charge[a], home_s[a] - depth[a])


@njit(cache=True)
def _take_tolls(length, home_s, cross_start, cross, cover_start, cover_end, toll, left, left_home):  # type: ignore[no-untyped-def]  # fmt: skip
    """Write what the tolls of the sets leave of the legs, sparse ones and those to home."""
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
def _sparse_makespan(robots, line_s, start, other, left, left_home, charge, depth, cover_start, cover_end, toll):  # type: ignore[no-untyped-def]  # fmt: skip
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
        _tree(start, other, left, left_home, charge, depth, price, value, via, via_home)
        found = _work_value(line_s, charge, depth, price, cover_start, cover_end, toll)
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
def _slopes(line_s, start, other, charge, depth, price, value, via, via_home, owner, used, used_home, g_charge, g_depth):  # type: ignore[no-untyped-def]  # fmt: skip
    """Write by how much the value rises with every charge and depth, and the prices of legs used."""
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
def ascend(robots, line_s, home_s, start, other, owner, length, cover_start, cover_end, cross_start, cross, charge, depth, toll, rounds, step_s, last, follow, mean, mean_home):  # type: ignore[no-untyped-def]  # fmt: skip
    """Improve charges, depths and tolls in place; return the makespan proven on the sparse legs.

    Steps along the slope of the value at a makespan that is raised whenever the value exceeds
    the number of robots; they shrink from ``step_s`` seconds to its ``last`` part. Depths move
    ``follow`` times as far as charges. ``mean`` and ``mean_home`` get how often the later trees
    used each leg.
    """
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
    _take_tolls(length, home_s, cross_start, cross, cover_start, cover_end, toll, left, left_home)
    _settle(left_home, charge, depth)
    best = _sparse_makespan(
        robots, line_s, start, other, left, left_home, charge, depth, cover_start, cover_end, toll
    )
    best_charge = charge.copy()
    best_depth = depth.copy()
    best_toll = toll.copy()
    makespan = best
    trees = 0
    for turn in range(rounds):
        _take_tolls(
            length, home_s, cross_start, cross, cover_start, cover_end, toll, left, left_home
        )
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
        _tree(start, other, left, left_home, charge, depth, price, value, via, via_home)
        found = value.sum() + _work_value(
            line_s, charge, depth, price, cover_start, cover_end, toll
        )
        if found > robots:
            best = makespan
            best_charge[:] = charge
            best_depth[:] = depth
            best_toll[:] = toll
            makespan *= 1.0 + min(0.05, 0.5 * (found / robots - 1.0))
        _slopes(
            line_s, start, other, charge, depth, price, value, via, via_home, owner,
            used, used_home, g_charge, g_depth,
        )  # fmt: skip
        if 2 * turn >= rounds:
            trees += 1
            for i in range(n):
                if via[i] >= 0:
                    mean[via[i]] += 1.0
                else:
                    mean_home[via_home[i]] += 1.0
        pace = step_s * last ** (turn / rounds) * makespan
        for a in range(m):
            d_charge[a] = 0.7 * d_charge[a] + 0.3 * g_charge[a]
            charge[a] += pace * d_charge[a]
            d_depth[a] = 0.7 * d_depth[a] + 0.3 * g_depth[a]
            depth[a] += follow * pace * d_depth[a]
        for s in range(len(toll)):
            slope = _lowest_price(s, cover_start, cover_end, price)
            for c in range(cross_start[s], cross_start[s + 1]):
                slope -= used[cross[c]]
            for c in range(cover_start[s], cover_start[s + 1]):
                slope -= used_home[cover_end[c]]
            d_toll[s] = 0.7 * d_toll[s] + 0.3 * slope
            toll[s] = max(0.0, toll[s] + pace * d_toll[s])
    charge[:] = best_charge
    depth[:] = best_depth
    toll[:] = best_toll
    if trees > 0:
        mean /= trees
        mean_home /= trees
    return best


@njit(cache=True)
def dense_value(makespan, line_s, end_s, home_s, charge, extra, depth, cover_start, cover_end, toll, via):  # type: ignore[no-untyped-def]  # fmt: skip
    """Return the value proven with all legs, minus infinity when depths leave no room.

    ``end_s`` has twice the toll added between ends of one set, and ``extra`` is the sum of the
    tolls of the sets that an end is in, so that only what borders take is taken. Legs that matter
    are written to ``via`` of shape (4·lines, 2): those of the tree, and for each end the one that
    owes most; -1 where there is none.
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
    total = _work_value(line_s, charge, depth, price, cover_start, cover_end, toll)
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
                rest = end_s[a, b] - take[a] - take[b] - abs(depth[a] - depth[b])
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
def dense_makespan(robots, hoped, line_s, end_s, home_s, charge, depth, cover_start, cover_end, toll, via):  # type: ignore[no-untyped-def]  # fmt: skip
    """Return a makespan no more than the hoped one that all legs prove, 0 when none was found.

    The legs that matter at the hoped one are written to ``via``.
    """
    extra = np.zeros(len(charge))
    widened = end_s
    if len(toll) > 0:
        widened = end_s.copy()
    for s in range(len(toll)):
        for c in range(cover_start[s], cover_start[s + 1]):
            extra[cover_end[c]] += toll[s]
            for d in range(cover_start[s], cover_start[s + 1]):
                widened[cover_end[c], cover_end[d]] += 2.0 * toll[s]
    _settle(home_s - extra, charge, depth)
    value = dense_value(
        hoped, line_s, widened, home_s, charge, extra, depth, cover_start, cover_end, toll, via
    )
    if value > robots:
        return hoped
    scrap = via.copy()
    least = 2.0 * depth.max()
    low, high = 0.0, hoped
    step = 1e-4
    while step < 1.0:
        # down from what was hoped for in growing steps, then halved
        middle = hoped - step * (hoped - least)
        value = dense_value(
            middle, line_s, widened, home_s, charge, extra, depth, cover_start, cover_end, toll,
            scrap,
        )  # fmt: skip
        if value > robots:
            low = middle
            break
        high = middle
        step *= 3.0
    if low == 0.0:
        return 0.0
    for _ in range(6):
        middle = 0.5 * (low + high)
        value = dense_value(
            middle, line_s, widened, home_s, charge, extra, depth, cover_start, cover_end, toll,
            scrap,
        )  # fmt: skip
        if value > robots:
            low = middle
        else:
            high = middle
    return low


@njit(cache=True)
def odd_sets(start, other, mean, mean_home, most, gap, found, size, cut):  # type: ignore[no-untyped-def]
    """Grow sets of ends that legs leave too seldom; return how many were found.

    From every end, the end that is joined to the set most strongly is added; of all odd sets on
    the way the one whose border is crossed least often is kept, if that is less than ``1 - gap``.
    ``mean`` has the use of each leg in either direction. Sets go to ``found`` (ends, most).
    """
    m = len(start) - 1
    weight = np.zeros(m)
    inside = np.zeros(m, np.bool_)
    touched = np.zeros(m * 4, np.int64)
    members = np.zeros(most, np.int64)
    count = 0
    for first in range(m):
        held = 0
        touches = 0
        border = 0.0
        best, best_size = 1.0 - gap, 0
        v = first
        while held < most:
            members[held] = v
            inside[v] = True
            held += 1
            degree = mean_home[v]
            for q in range(start[v], start[v + 1]):
                if mean[q] <= 0.0:
                    continue
                degree += mean[q]
                u = other[q]
                if not inside[u]:
                    if weight[u] == 0.0:
                        touched[touches] = u
                        touches += 1
                    weight[u] += mean[q]
            border += degree - 2.0 * weight[v]
            if held % 2 == 1 and held > 1 and border < best:
                best, best_size = border, held
            v = -1
            for t in range(touches):
                u = touched[t]
                if not inside[u] and (v < 0 or weight[u] > weight[v]):
                    v = u
            if v < 0:
                break
        if best_size > 0:
            found[count, :best_size] = members[:best_size]
            size[count] = best_size
            cut[count] = best
            count += 1
        for t in range(touches):
            weight[touched[t]] = 0.0
        for t in range(held):
            inside[members[t]] = False
            weight[members[t]] = 0.0
    return count


@njit(cache=True)
def crossings(start, other, cover_start, cover_end):  # type: ignore[no-untyped-def]
    """Return for each set the places of the legs with one end in it, in either direction."""
    m = len(start) - 1
    inside = np.zeros(m, np.bool_)
    out_start = np.zeros(len(cover_start), np.int64)
    room = 0
    for s in range(len(cover_start) - 1):
        for c in range(cover_start[s], cover_start[s + 1]):
            a = cover_end[c]
            room += 2 * (start[a + 1] - start[a])
    out = np.zeros(room, np.int64)
    back = np.zeros(len(other), np.int64)
    for a in range(m):
        for q in range(start[a], start[a + 1]):
            b = other[q]
            place = start[b] + np.searchsorted(other[start[b] : start[b + 1]], a)
            back[q] = place
    count = 0
    for s in range(len(cover_start) - 1):
        for c in range(cover_start[s], cover_start[s + 1]):
            inside[cover_end[c]] = True
        for c in range(cover_start[s], cover_start[s + 1]):
            a = cover_end[c]
            for q in range(start[a], start[a + 1]):
                if not inside[other[q]]:
                    out[count] = q
                    out[count + 1] = back[q]
                    count += 2
        for c in range(cover_start[s], cover_start[s + 1]):
            inside[cover_end[c]] = False
        out_start[s + 1] = count
    return out_start, out[:count]

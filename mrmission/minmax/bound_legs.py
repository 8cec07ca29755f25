"""Compiled kernels of the bound for lines that are each swept in one go.

Every end of a line has a charge and a depth; what is proven about them is in ``docs/bounds.md``.
Nodes are lines, the last node is home.
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
def leg_value(rest, price_a, price_b):  # type: ignore[no-untyped-def]
    """Return what a leg is worth: at the larger price when it costs, at the lower when it pays."""
    return rest * max(price_a, price_b) if rest >= 0.0 else rest * min(price_a, price_b)


@njit(cache=True)
def sparse_tree(start, other, length, home_s, charge, depth, price, value, via_a, via_b):  # type: ignore[no-untyped-def]  # fmt: skip
    """Write a least tree on a sparse set of legs: per line the value and the ends of its leg.

    ``via_a`` is the end already in the tree, -1 for home.
    """
    n = len(price)
    done = np.zeros(n, np.bool_)
    for i in range(n):
        value[i] = np.inf
        for side in range(2):
            b = 2 * i + side
            worth = max(0.0, home_s[b] - charge[b] - depth[b]) * price[i]
            if worth < value[i]:
                value[i] = worth
                via_a[i] = -1
                via_b[i] = b
    for _ in range(n):
        at = -1
        for i in range(n):
            if not done[i] and (at < 0 or value[i] < value[at]):
                at = i
        done[at] = True
        for side in range(2):
            a = 2 * at + side
            for q in range(start[a], start[a + 1]):
                b = other[q]
                i = b >> 1
                if done[i]:
                    continue
                rest = length[q] - charge[a] - charge[b] - abs(depth[a] - depth[b])
                worth = leg_value(rest, price[at], price[i])
                if worth < value[i]:
                    value[i] = worth
                    via_a[i] = a
                    via_b[i] = b


@njit(cache=True)
def work_value(line_s, charge, depth, price):  # type: ignore[no-untyped-def]
    """Return the priced work of the lines: sweeping that does not go deeper, and charges."""
    total = 0.0
    for i in range(len(line_s)):
        a, b = 2 * i, 2 * i + 1
        total += (line_s[i] - abs(depth[a] - depth[b]) + charge[a] + charge[b]) * price[i]
    return total


@njit(cache=True)
def _settle(home_s, charge, depth):  # type: ignore[no-untyped-def]
    """Keep depths and charges, in place, to what the way home allows."""
    for a in range(len(charge)):
        depth[a] = min(max(depth[a], 0.0), home_s[a])
        charge[a] = min(charge[a], home_s[a] - depth[a])


@njit(cache=True)
def sparse_makespan(robots, line_s, home_s, start, other, length, charge, depth):  # type: ignore[no-untyped-def]  # fmt: skip
    """Return the makespan that charges and depths prove when there are no other legs."""
    n = len(line_s)
    price = np.zeros(n)
    value = np.zeros(n)
    via_a = np.zeros(n, np.int64)
    via_b = np.zeros(n, np.int64)
    low = 2.0 * depth.max() * (1.0 + 1e-9)
    high = max(low, line_s.sum() / robots) + 1e-9
    upper = False
    for _ in range(40):
        middle = 0.5 * (low + high) if upper else high
        line_prices(middle, depth, price)
        sparse_tree(start, other, length, home_s, charge, depth, price, value, via_a, via_b)
        if work_value(line_s, charge, depth, price) + value.sum() >= robots:
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
def _slopes(line_s, charge, depth, price, value, via_a, via_b, g_charge, g_depth):  # type: ignore[no-untyped-def]  # fmt: skip
    """Write by how much the value rises with every charge and depth."""
    n = len(line_s)
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
        a, b = via_a[i], via_b[i]
        p = price[i]
        if a < 0:
            g_charge[b] -= p
            g_depth[b] -= p
            continue
        q = price[a >> 1]
        p = max(p, q) if value[i] >= 0.0 else min(p, q)
        g_charge[a] -= p
        g_charge[b] -= p
        if depth[a] > depth[b]:
            g_depth[a] -= p
            g_depth[b] += p
        elif depth[b] > depth[a]:
            g_depth[b] -= p
            g_depth[a] += p


@njit(cache=True)
def ascend(robots, line_s, home_s, start, other, length, charge, depth, rounds, step_s, last, follow):  # type: ignore[no-untyped-def]  # fmt: skip
    """Improve charges and depths in place; return the makespan they prove on the sparse legs.

    Steps along the slope of the value at a makespan that is raised whenever the value exceeds
    the number of robots; they shrink from ``step_s`` seconds to its ``last`` part. Depths move
    ``follow`` times as far as charges.
    """
    n = len(line_s)
    m = 2 * n
    price = np.zeros(n)
    value = np.zeros(n)
    via_a = np.zeros(n, np.int64)
    via_b = np.zeros(n, np.int64)
    g_charge = np.zeros(m)
    g_depth = np.zeros(m)
    d_charge = np.zeros(m)
    d_depth = np.zeros(m)
    _settle(home_s, charge, depth)
    best = sparse_makespan(robots, line_s, home_s, start, other, length, charge, depth)
    best_charge = charge.copy()
    best_depth = depth.copy()
    makespan = best
    for turn in range(rounds):
        _settle(home_s, charge, depth)
        if not line_prices(makespan, depth, price):
            charge[:] = best_charge
            depth[:] = best_depth
            d_depth[:] = 0.0
            d_charge[:] = 0.0
            step_s *= 0.5
            makespan = best
            continue
        sparse_tree(start, other, length, home_s, charge, depth, price, value, via_a, via_b)
        found = work_value(line_s, charge, depth, price) + value.sum()
        if found > robots:
            best = makespan
            best_charge[:] = charge
            best_depth[:] = depth
            makespan *= 1.0 + min(0.05, 0.5 * (found / robots - 1.0))
        _slopes(line_s, charge, depth, price, value, via_a, via_b, g_charge, g_depth)
        pace = step_s * last ** (turn / rounds) * makespan
        for a in range(m):
            d_charge[a] = 0.7 * d_charge[a] + 0.3 * g_charge[a]
            charge[a] += pace * d_charge[a]
            d_depth[a] = 0.7 * d_depth[a] + 0.3 * g_depth[a]
            depth[a] += follow * pace * d_depth[a]
    charge[:] = best_charge
    depth[:] = best_depth
    return best


@njit(cache=True)
def dense_value(makespan, line_s, end_s, home_s, charge, depth, via):  # type: ignore[no-untyped-def]
    """Return the value proven with all legs, minus infinity when depths leave no room.

    See ``docs/bounds.md``: priced work, a least tree over all legs, less what lines might owe.
    Legs that matter are written to ``via`` of shape (4·lines, 2): those of the tree, and for each
    end the one that owes most; -1 where there is none.
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
    for i in range(n):
        a, b = 2 * i, 2 * i + 1
        work[i] = line_s[i] - abs(depth[a] - depth[b]) + charge[a] + charge[b]
        for side in range(2):
            b = 2 * i + side
            # the second leg of a tour to home is not in the tree, so none may pay
            value[i] = min(value[i], (home_s[b] - charge[b] - depth[b]) * price[i])
    total = 0.0
    for _ in range(n):
        at = -1
        for i in range(n):
            if not done[i] and (at < 0 or value[i] < value[at]):
                at = i
        done[at] = True
        total += value[at]
        for side in range(2):
            a = 2 * at + side
            for b in range(2 * n):
                i = b >> 1
                if i == at:
                    continue
                rest = end_s[a, b] - charge[a] - charge[b] - abs(depth[a] - depth[b])
                # a leg that pays is paid for by the line at the lower price, of two by the larger
                if rest < 0.0 and (
                    price[at] < price[i]
                    or (price[at] == price[i] and (work[at], at) > (work[i], i))
                ):
                    if -rest > owed[a]:
                        owed[a] = -rest
                        via[2 * n + a, 0] = a
                        via[2 * n + a, 1] = b
                if not done[i]:
                    worth = leg_value(rest, price[at], price[i])
                    if worth < value[i]:
                        value[i] = worth
                        via[i, 0] = a
                        via[i, 1] = b
    top = price.max()
    for i in range(n):
        total += work[i] * price[i]
        total -= (top - price[i]) * max(0.0, owed[2 * i] + owed[2 * i + 1] - work[i])
    return total


@njit(cache=True)
def dense_makespan(robots, hoped, line_s, end_s, home_s, charge, depth, via):  # type: ignore[no-untyped-def]  # fmt: skip
    """Return a makespan no more than the hoped one that all legs prove, 0 when none was found.

    The legs that matter at the hoped one are written to ``via``.
    """
    _settle(home_s, charge, depth)
    value = dense_value(hoped, line_s, end_s, home_s, charge, depth, via)
    if value > robots:
        return hoped
    scrap = via.copy()
    least = 2.0 * depth.max()
    low, high = 0.0, hoped
    step = 1e-4
    while step < 1.0:
        # down from what was hoped for in growing steps, then halved
        middle = hoped - step * (hoped - least)
        if dense_value(middle, line_s, end_s, home_s, charge, depth, scrap) > robots:
            low = middle
            break
        high = middle
        step *= 3.0
    if low == 0.0:
        return 0.0
    for _ in range(6):
        middle = 0.5 * (low + high)
        if dense_value(middle, line_s, end_s, home_s, charge, depth, scrap) > robots:
            low = middle
        else:
            high = middle
    return low

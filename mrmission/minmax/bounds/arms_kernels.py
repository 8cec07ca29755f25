"""Compiled kernels of the bound that counts how many tours go into each arm of the water.

Ends of lines sit at the nodes of a tree, see :mod:`mrmission.minmax.bounds.tree`; ends have charges
and odd sets of ends tolls. What is proven about them is in ``docs/bounds.md``. ``arms`` are the
arrays ``above, node, meet, crossed`` of the tree, ``covers`` the sets: set s has the ends
``ends[start[s]:start[s + 1]]``, and the ways home of all of them run together at ``inside[s]``.
``fleet`` is what :attr:`mrmission.minmax.bounds.parts.Task.fleet` says.
"""

from __future__ import annotations

import numpy as np
from numba import njit

from mrmission.minmax.bounds.prices_kernels import pop, push, take_tolls, toll_slope, with_tolls

ROUNDED = 1e-9
"""Part of a tour by which a number of tours may be off from rounding."""
TRIED = 40


@njit(cache=True)
def heights(above, length):  # type: ignore[no-untyped-def]
    """Return how far each node is from home along the tree."""
    height = np.zeros(len(above))
    for v in range(1, len(above)):
        height[v] = height[above[v]] + length[v]
    return height


@njit(cache=True)
def _works(line_s, charge, arms, height):  # type: ignore[no-untyped-def]
    """Return the work of each line: what its seconds exceed its way in the tree by, and charges."""
    _, node, meet, _ = arms
    work = np.zeros(len(line_s))
    for i in range(len(line_s)):
        a, b = node[2 * i], node[2 * i + 1]
        work[i] = line_s[i] - (height[a] + height[b] - 2.0 * height[meet[a, b]])
        work[i] += charge[2 * i] + charge[2 * i + 1]
    return work


@njit(cache=True)
def tours_of_arms(  # type: ignore[no-untyped-def]
    makespan, fleet, sure, lacking, inside, toll, arms, length, height, need, passed
):
    """Write how often at least each edge is passed in a plan of that makespan; False if none is.

    ``sure`` is what each line needs whatever legs its ends have, ``lacking`` what those that need
    less than nothing lack together. ``need`` becomes what has to be done beyond each node.
    """
    above, node, meet, crossed = arms
    _, tours, trip, _ = fleet
    need[:] = 0.0
    for i in range(len(sure)):
        a, b = node[2 * i], node[2 * i + 1]
        need[a] += sure[i]
        need[b] += sure[i]
        need[meet[a, b]] -= sure[i]
    for s in range(len(toll)):
        need[inside[s]] += toll[s]
    possible = True
    for v in range(len(above) - 1, 0, -1):
        room = makespan - 2.0 * height[v]
        wanted = need[v] - lacking
        count = 1.0
        if room > 0.0:
            count = max(1.0, np.ceil(wanted / room - ROUNDED))
        elif wanted > room:
            return False
        if count > tours:
            possible = False
        if trip < makespan and trip > 2.0 * height[v]:  # each robot may come more than once
            count = max(count, np.ceil(wanted / (trip - 2.0 * height[v]) - ROUNDED))
        passed[v] = max(2.0 * count, crossed[v])
        need[above[v]] += need[v] + length[v] * passed[v]
    return possible


@njit(cache=True)
def _proves(  # type: ignore[no-untyped-def]
    makespan, fleet, base, sure, lacking, inside, toll, arms, length, height, need, passed
):
    """Return whether no plan has that makespan."""
    robots, tours, trip, swap = fleet
    if not tours_of_arms(
        makespan, fleet, sure, lacking, inside, toll, arms, length, height, need, passed
    ):
        return True
    total = base
    for v in range(1, len(length)):
        total += length[v] * passed[v]
    total += swap * max(0.0, np.ceil(total / trip - ROUNDED) - tours)
    return total > robots * makespan


@njit(cache=True)
def highest(  # type: ignore[no-untyped-def]
    fleet, base, sure, lacking, inside, toll, arms, length, height, need, passed
):
    """Return the highest makespan found that no plan has."""
    low = 0.0
    high = max(2.0 * height.max(), base / fleet[0]) + 1e-9
    bounded = False
    for _ in range(TRIED):
        middle = 0.5 * (low + high) if bounded else high
        if _proves(
            middle, fleet, base, sure, lacking, inside, toll, arms, length, height,
            need, passed,
        ):  # fmt: skip
            low = middle
            high *= 1.0 if bounded else 1.3
        else:
            high = middle
            bounded = True
        if bounded and high - low <= 1e-5 * high:
            break
    return low


@njit(cache=True)
def _tree(legs, rest, rest_home, value, via, via_home):  # type: ignore[no-untyped-def]
    """Write a least tree over lines and home: per line the value and the place of its leg."""
    start, other, _ = legs
    n = len(value)
    done = np.zeros(n, np.bool_)
    for i in range(n):
        value[i] = np.inf
        via[i] = -1
        for b in range(2 * i, 2 * i + 2):
            worth = max(0.0, rest_home[b])
            if worth < value[i]:
                value[i] = worth
                via_home[i] = b
    key = np.empty(len(other) + n)
    line = np.empty(len(other) + n, np.int32)
    size = 0
    for i in range(n):
        size = push(key, line, size, value[i], i)
    while size > 0:
        at = line[0]
        size = pop(key, line, size)
        if done[at]:
            continue
        done[at] = True
        for a in range(2 * at, 2 * at + 2):
            for q in range(start[a], start[a + 1]):
                i = other[q] >> 1
                if not done[i] and rest[q] < value[i]:
                    value[i] = rest[q]
                    via[i] = q
                    size = push(key, line, size, rest[q], i)


@njit(cache=True)
def _settle(home_s, charge, node, height):  # type: ignore[no-untyped-def]
    """Keep charges, in place, to what the way home allows."""
    for a in range(len(charge)):
        charge[a] = min(charge[a], home_s[a] - height[node[a]])


@njit(cache=True)
def _sure(work, owed):  # type: ignore[no-untyped-def]
    """Return what lines need whatever legs their ends have, and what some of them lack together.

    ``owed`` is the most that a leg may pay, by end; each end of a leg pays half of it.
    """
    sure = work.copy()
    lacking = 0.0
    for i in range(len(work)):
        sure[i] -= 0.5 * (owed[2 * i] + owed[2 * i + 1])
        lacking += max(0.0, -sure[i])
    return sure, lacking


@njit(cache=True)
def climb(  # type: ignore[no-untyped-def]
    fleet, line_s, home_s, legs, length_s, covers, inside, crossings, arms,
    charge, length, toll, pace, means,
):  # fmt: skip
    """Improve charges, lengths of edges and tolls in place; return what they prove on these legs.

    Steps along the slope of what a plan takes at least at a makespan a little above the one that
    is proven. ``pace`` is how many, the seconds of the first, the last in parts of the first, how
    far edges move in parts of how far charges do, and that makespan's excess. ``means`` are as in
    :func:`mrmission.minmax.bounds.prices_kernels.ascend`.
    """
    rounds, step_s, last, follow, ahead = pace
    start, other, owner = legs
    above, node, meet, _ = arms
    mean, mean_home = means
    n, m, nodes = len(line_s), len(home_s), len(above)
    value = np.zeros(n)
    via, via_home = np.zeros(n, np.int64), np.zeros(n, np.int64)
    need, passed, used_edge = np.zeros(nodes), np.zeros(nodes), np.zeros(nodes)
    g_charge, d_charge, d_edge = np.zeros(m), np.zeros(m), np.zeros(nodes)
    d_toll = np.zeros(len(toll))
    left, left_home = length_s.copy(), home_s.copy()
    rest, rest_home = np.zeros(len(other)), np.zeros(m)
    used, used_home = np.zeros(len(other)), np.zeros(m)
    owed = np.zeros(m)
    best_charge, best_length, best_toll = charge.copy(), length.copy(), toll.copy()
    best = 0.0
    mean[:] = 0.0
    mean_home[:] = 0.0
    trees = 0.0
    for turn in range(rounds):
        take_tolls(length_s, home_s, crossings, covers, toll, left, left_home)
        height = heights(above, length)
        _settle(left_home, charge, node, height)
        owed[:] = 0.0
        for a in range(m):
            rest_home[a] = left_home[a] - charge[a] - height[node[a]]
            for q in range(start[a], start[a + 1]):
                b = other[q]
                v, w = node[a], node[b]
                rest[q] = left[q] - charge[a] - charge[b]
                rest[q] -= height[v] + height[w] - 2.0 * height[meet[v, w]]
                owed[a] = max(owed[a], -rest[q])
        work = _works(line_s, charge, arms, height)
        sure, lacking = _sure(work, owed)
        _tree(legs, rest, rest_home, value, via, via_home)
        base = toll.sum() + max(work.sum() + value.sum(), sure.sum())
        if _proves(
            best * (1.0 + 1e-4), fleet, base, sure, lacking, inside, toll, arms, length,
            height, need, passed,
        ):  # fmt: skip
            found = highest(
                fleet, base, sure, lacking, inside, toll, arms, length, height, need, passed
            )
            if found > best:
                best = found
                best_charge[:] = charge
                best_length[:] = length
                best_toll[:] = toll
        tours_of_arms(
            max(best, 2.0 * height.max()) * (1.0 + ahead), fleet, sure, lacking, inside, toll, arms,
            length, height, need, passed,
        )  # fmt: skip
        # what lines and the legs of the tree use of each end, leg and edge
        g_charge[:] = 1.0
        used[:] = 0.0
        used_home[:] = 0.0
        used_edge[:] = 0.0
        late = 1.0 if 2 * turn >= rounds else 0.0
        trees += late
        for i in range(n):
            v, w = node[2 * i], node[2 * i + 1]
            used_edge[v] += 1.0
            used_edge[w] += 1.0
            used_edge[meet[v, w]] -= 2.0
            if via[i] < 0:
                b = via_home[i]
                g_charge[b] -= 1.0
                used_home[b] = 1.0
                used_edge[node[b]] += 1.0
                mean_home[b] += late
                continue
            q = via[i]
            a, b = owner[q], other[q]
            g_charge[a] -= 1.0
            g_charge[b] -= 1.0
            used[q] = 1.0
            v, w = node[a], node[b]
            used_edge[v] += 1.0
            used_edge[w] += 1.0
            used_edge[meet[v, w]] -= 2.0
            mean[q] += late
        for v in range(nodes - 1, 0, -1):
            used_edge[above[v]] += used_edge[v]
        step = step_s * last ** (turn / rounds)
        for a in range(m):
            d_charge[a] = 0.7 * d_charge[a] + 0.3 * g_charge[a]
            charge[a] += step * d_charge[a]
        for s in range(len(toll)):
            slope = toll_slope(s, 1.0, crossings, covers, used, used_home)
            d_toll[s] = 0.7 * d_toll[s] + 0.3 * slope
            toll[s] = max(0.0, toll[s] + step * d_toll[s])
        for v in range(1, nodes):
            d_edge[v] = 0.7 * d_edge[v] + 0.3 * (passed[v] - used_edge[v])
            length[v] = max(0.0, length[v] + follow * step * d_edge[v])
    charge[:] = best_charge
    length[:] = best_length
    toll[:] = best_toll
    if trees > 0:
        mean /= trees
        mean_home /= trees
    return best


@njit(cache=True)
def proven(  # type: ignore[no-untyped-def]
    fleet, line_s, end_s, home_s, covers, inside, arms, charge, length, toll, via
):
    """Return the makespan that charges, lengths of edges and tolls prove with all legs.

    Legs that matter are written to ``via`` of shape (4·lines, 2): those of the least tree, and
    for each end the one that may pay most; -1 where there is none.
    """
    above, node, meet, _ = arms
    n, nodes = len(line_s), len(above)
    ways, take = with_tolls(end_s, 2 * n, covers, toll)
    height = heights(above, length)
    _settle(home_s - take, charge, node, height)
    work = _works(line_s, charge, arms, height)
    take += charge
    for a in range(2 * n):
        take[a] += height[node[a]]
    value = np.full(n, np.inf)
    done = np.zeros(n, np.bool_)
    least = np.full(2 * n, np.inf)
    via[:] = -1
    for i in range(n):
        for b in range(2 * i, 2 * i + 2):
            value[i] = min(value[i], max(0.0, home_s[b] - take[b]))
    total = 0.0
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
                rest = ways[a, b] - take[a] - take[b] + 2.0 * height[meet[node[a], node[b]]]
                if rest < least[a]:
                    least[a] = rest
                    via[2 * n + a, 0] = a
                    via[2 * n + a, 1] = b
                if not done[i] and rest < value[i]:
                    value[i] = rest
                    via[i, 0] = a
                    via[i, 1] = b
    sure, lacking = _sure(work, np.maximum(0.0, -least))
    base = toll.sum() + max(work.sum() + total, sure.sum())
    need, passed = np.zeros(nodes), np.zeros(nodes)
    return highest(fleet, base, sure, lacking, inside, toll, arms, length, height, need, passed)

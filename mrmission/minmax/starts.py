"""Several starts of the search where there is budget for them, and the best of what they come to.

One search of few lines is soon as good as it gets, and where it ends is a matter of luck. So what
is left of the budget goes into further starts: first with the other lays of lanes that looked
nearly as good when the bearing was chosen, which short searches mislead about by some percent, then
with other seeds. How many there are follows from the budget and the lines, not from a clock.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from mrmission.minmax.full import more_trips_s
from mrmission.minmax.planner import BUDGET_PER_LINE_S, Prepared, Start, one_start

START_SHARE = 0.4
"""A start gets at least so much of what its lines can use: where there is budget for two, several
short searches come to more than one long one (see docs/planner.md)."""
MOST_STARTS = 8
NEAR_BEST = 1.03
"""Lays of lanes whose makespan after a short search is more than this many times the least are not
searched further."""
NEXT_SEED = 1_000_003
"""From the seed of one start to that of the next with the same lanes: no seeds that users take for
plans to compare."""


def starts_within(budget_s: float, lines: int) -> int:
    """Return how many starts there are with so many lines: one while one can use the budget."""
    usable_s = BUDGET_PER_LINE_S * max(lines, 1)
    if budget_s < usable_s:
        return 1
    return min(int(budget_s / (START_SHARE * usable_s)), MOST_STARTS)


def best_start(lays: Sequence[Prepared], budget_s: float, seed: int) -> Start:
    """Return the start whose last robot is home first.

    Parameters
    ----------
    lays
        The same water under one lay of lanes or more, the most promising first.
    budget_s
        For all starts together.
    seed
        Of the first search with each lay.
    """
    starts = starts_within(budget_s, len(lays[0].lines))

    def start(ready: Prepared, seed: int) -> tuple[Start, float]:
        found = one_start(ready, budget_s / starts, seed)
        # tours with more items than their robots hold are cut later
        return found, found.longest_s + float(more_trips_s(ready, found.tours).max())

    best, least_s = start(lays[0], seed)
    for number in range(1, starts):
        again = number + 1 - len(lays)
        if again <= 0:
            found, took_s = start(lays[number], seed)
        else:
            found, took_s = start(replace(best.ready, begun=None), seed + again * NEXT_SEED)
        if took_s < least_s:
            best, least_s = found, took_s
    return best

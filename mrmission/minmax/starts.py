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

START_SHARE = 0.25
"""A further start gets at least so much of what its lines can use."""
MOST_STARTS = 8
NEXT_SEED = 1_000_003
"""From the seed of one start to that of the next with the same lanes: no seeds that users take for
plans to compare."""


def starts_within(budget_s: float, lines: int) -> int:
    """Return how many starts there are with so many lines: one, and more by what it cannot use."""
    usable_s = BUDGET_PER_LINE_S * max(lines, 1)
    further = int((budget_s / usable_s - 1.0) / START_SHARE)
    return 1 + min(max(further, 0), MOST_STARTS - 1)


def best_start(lays: Sequence[Prepared], budget_s: float, seed: int) -> Start:
    """Return the start whose last robot is home first.

    The first start, with the most promising lay, has what it would have alone, so that there is no
    harm in the others.

    Parameters
    ----------
    lays
        The same water under one lay of lanes or more, the most promising first.
    budget_s
        For all starts together.
    seed
        Of the first search with each lay.
    """
    lines = len(lays[0].lines)
    starts = starts_within(budget_s, lines)
    best = one_start(lays[0], budget_s, seed)
    if starts == 1:
        return best
    least_s = _home_s(best)
    each_s = (budget_s - BUDGET_PER_LINE_S * lines) / (starts - 1)
    for number in range(1, starts):
        again = max(number + 1 - len(lays), 0)
        ready = replace(best.ready, begun=None) if again else lays[number]
        found = one_start(ready, each_s, seed + again * NEXT_SEED)
        took_s = _home_s(found)
        if took_s < least_s:
            best, least_s = found, took_s
    return best


def _home_s(start: Start) -> float:
    """Return when the last robot is home; tours of too many items are cut into trips later."""
    return start.longest_s + float(more_trips_s(start.ready, start.tours).max())

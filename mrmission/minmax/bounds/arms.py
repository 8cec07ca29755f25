"""The bound that counts how many tours must go into each arm of the water, for chosen lines.

The proof is in ``docs/bounds.md``. In short: whoever works beyond the mouth of an arm comes and
goes through it, so the mouth is passed twice by as many tours as the work beyond it needs, a whole
number; what that takes, the work and what connects it must fit into all tours together.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TypeAlias

import numpy as np

from mrmission.minmax.bounds import arms_kernels as kernels
from mrmission.minmax.bounds.odd_sets import crossings
from mrmission.minmax.bounds.parts import (
    Covers,
    Legs,
    Task,
    more_covers,
    no_covers,
    usual_leg_s,
    with_legs,
)
from mrmission.minmax.bounds.tree import Arms, arms_of
from mrmission.model import FloatArray, IntArray

TREES = ((0.0, 0.5), (0.0, 1.0), (0.25, 1.0), (0.5, 0.7), (0.5, 1.0), (1.0, 0.7), (1.0, 1.0))
"""Trees to begin with: which share of a line's seconds it goes deeper by, a factor on lengths."""
Rounds: TypeAlias = tuple[tuple[int, float], ...]
"""Rounds of steps: how many, and the first in parts of a usual leg."""
FULL: tuple[Rounds, Rounds] = (
    ((60, 0.2),),
    tuple((800, 0.05 * 0.65**turn) for turn in range(6)),
)
MANY: tuple[Rounds, Rounds] = (
    ((30, 0.2),),
    tuple((800, 0.05 * 0.5**turn) for turn in range(4)),
)
"""Rounds for each tree, then for the best of them; those of many lines take two thirds of the time,
for 0.1 % of the bound on 7 problems of lakes with 1,300 to 1,900 lines."""
MOST_STEPS = 200_000
"""Rounds of more lines have fewer steps: so many lines times steps."""
MOST_GAIN = 1.05
"""What later rounds prove of what the first promise: at most 1.03 times as much, on 84 problems of
lakes."""
LAST = 0.3
"""The last step of a round, in parts of the first."""
FOLLOW = 0.03
"""Lengths of edges move by so much of what charges do."""
AHEAD = 0.005
"""Slopes are those at a makespan so much longer than the one that is proven."""


@dataclass(frozen=True, slots=True)
class _Proof:
    """What proves a makespan: the tree with its lengths, charges of ends, tolls of odd sets."""

    makespan: float
    charge: FloatArray
    arms: Arms
    covers: Covers
    legs: Legs


def arms_makespan(task: Task, legs: Legs, known: float = 0.0) -> float:
    """Return a makespan, in the task's seconds, below which no plan is.

    Parameters
    ----------
    task
        With a matrix of ways.
    legs
        Those to be looked at first.
    known
        A makespan that is proven already: where no more is to be expected, 0 is returned.
    """
    trial, polish = MANY if task.many else FULL
    step_s = usual_leg_s(legs, task)
    charge = np.full(len(task.home_s), step_s / 4)
    tried = []
    for share, factor in TREES:
        arms = arms_of(task, share, factor)
        begun = _Proof(0.0, charge, arms, no_covers(), legs)
        tried.append(_climb(task, begun, step_s, trial, proven=False))
    first = max(tried, key=lambda proof: proof.makespan)
    if MOST_GAIN * first.makespan <= known:
        return 0.0
    return _climb(task, first, step_s, polish).makespan


def _climb(
    task: Task,
    begun: _Proof,
    step_s: float,
    rounds: Rounds,
    *,
    proven: bool = True,
) -> _Proof:
    """Return the best proof that rounds of steps lead to; on its legs alone where not `proven`."""
    charge, length = begun.charge.copy(), begun.arms.length.copy()
    arms, covers, legs = begun.arms, begun.covers, begun.legs
    tree = (arms.above, arms.node, arms.meet, arms.crossed)
    via = np.zeros((2 * len(charge), 2), dtype=np.int64)
    most = MOST_STEPS // len(task.line_s) + 30
    best = 0.0
    for steps, first in rounds:
        toll = covers.toll.copy()
        means = np.zeros(len(legs.other)), np.zeros(len(charge))
        sets = covers.start, covers.end
        inside = _inside(covers, arms)
        found = kernels.climb(
            task.fleet, task.line_s, task.home_s,
            (legs.start, legs.other, legs.owner), legs.length, sets, inside,
            crossings(legs.start, legs.other, *sets), tree, charge, length, toll,
            (min(steps, most), step_s * first, LAST, FOLLOW, AHEAD), means,
        )  # fmt: skip
        covers = more_covers(Covers(*sets, toll), legs, *means)
        if proven:
            found = kernels.proven(
                task.fleet, task.line_s, task.end_s, task.home_s, sets, inside, tree,
                charge, length, toll, via,
            )  # fmt: skip
            legs = with_legs(legs, via, task)
        best = max(best, found)
    return _Proof(best, charge, replace(arms, length=length), covers, legs)


def _inside(covers: Covers, arms: Arms) -> IntArray:
    """Return for each set the node where the ways home of its ends run together."""
    out = np.zeros(len(covers.toll), dtype=np.int64)
    for s, (a, b) in enumerate(zip(covers.start[:-1], covers.start[1:], strict=True)):
        nodes = arms.node[covers.end[a:b]]
        out[s] = nodes[0]
        for v in nodes[1:]:
            out[s] = arms.meet[out[s], v]
    return out

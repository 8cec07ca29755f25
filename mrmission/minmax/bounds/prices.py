"""The bound by prices: far work in parts of a robot, odd cuts and connection, for chosen lines.

The proof is in ``docs/bounds.md``. In short: every line has work, its seconds and what its ends are
charged for the legs that must reach them; a tour that goes to a depth d spends 2 d on the way there
and back, so it has room for T - 2 d of other work, and each second of it takes 1/(T - 2 d) of a
robot at least. What charges and depths leave of the legs must still connect all lines with home:
a least spanning tree. T is too short as long as all that takes more robots than there are. Which
charges and depths are best is searched for; that the answer is true does not depend on how.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from mrmission.minmax.bounds import prices_kernels as kernels
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
from mrmission.model import FloatArray

SHARES = ((0.0, 0.25), (0.0, 0.5), (0.0, 1.0), (1.0, 1.0))
MANY = ((0.0, 0.5),)
"""Depths to begin with: which share of a line's seconds it goes deeper by, and a factor on all."""
TRIAL = ((60, 0.5, 0.3),)
POLISH = tuple((250, 0.3 * 0.55**turn, 0.3) for turn in range(5))
"""Rounds of steps: how many, the first in parts of a typical leg, the last against the first."""
MOST_STEPS = 150_000
"""Rounds of more lines have fewer steps: so many lines times steps."""
TRIES = (2, 6)
"""How often a makespan is lowered until all legs prove it: between rounds, after the last."""
MOST_GAIN = 1.25
"""What later rounds make of the first: at most 1.22 times as much, on 84 problems of lakes."""
FOLLOW = 3.0
"""Depths move so many times as far as charges do."""


@dataclass(frozen=True, slots=True)
class _Proof:
    """What proves a makespan: charges and depths of ends, tolls of odd sets."""

    makespan: float
    charge: FloatArray
    depth: FloatArray
    covers: Covers
    legs: Legs


def prices_makespan(
    task: Task, legs: Legs, shares: tuple[tuple[float, float], ...], known: float = 0.0
) -> tuple[float, bool]:
    """Return a makespan, in the task's seconds, below which no plan is, and whether depths matter.

    Parameters
    ----------
    task
        Lines, ways and homes.
    legs
        Those to be looked at first.
    shares
        Depths to begin with: which share of a line's seconds it goes deeper by, a factor on all.
    known
        A makespan that is proven already: what will hardly be more is not looked for further.
    """
    step_s = usual_leg_s(legs, task)
    charge = np.full(len(task.home_s), step_s / 4)
    tried = []
    for share, factor in shares:
        depth = factor * kernels.depths(task.line_s, task.table, task.home_s, share)
        tried.append(_climb(task, _Proof(0.0, charge, depth, no_covers(), legs), step_s, TRIAL))
    proof = max(tried, key=lambda found: found.makespan)
    if MOST_GAIN * proof.makespan > known:
        proof = _climb(task, proof, step_s, POLISH if len(task.end_s) else POLISH[::2])
    return proof.makespan, bool(proof.depth.max() > 0)


def _climb(
    task: Task, proof: _Proof, step_s: float, rounds: tuple[tuple[int, float, float], ...]
) -> _Proof:
    """Return the best proof that rounds of steps lead to, that given or one better."""
    best = proof
    charge, depth = proof.charge.copy(), proof.depth.copy()
    covers, legs = proof.covers, proof.legs
    via = np.zeros((2 * len(charge), 2), dtype=np.int64)
    most = MOST_STEPS // len(task.line_s) + 30
    for steps, first, last in rounds:
        toll = covers.toll.copy()
        means = np.zeros(len(legs.other)), np.zeros(len(charge))
        sets = covers.start, covers.end
        found = kernels.ascend(
            task.robots, task.line_s, task.home_s, (legs.start, legs.other, legs.owner),
            legs.length, sets, crossings(legs.start, legs.other, *sets),
            charge, depth, toll, (min(steps, most), step_s * first, last, FOLLOW), means,
        )  # fmt: skip
        found = kernels.dense_makespan(
            task.robots, found, task.line_s, task.table,
            task.home_s, charge, depth, sets, toll, via, TRIES[(steps, first, last) == rounds[-1]],
        )  # fmt: skip
        covers = Covers(covers.start, covers.end, toll)
        if found > best.makespan:
            best = _Proof(found, charge.copy(), depth.copy(), covers, legs)
        if len(task.end_s):
            covers = more_covers(covers, legs, *means)
        legs = with_legs(legs, via, task)
    return best

"""Cuts slid along their lanes, so that the last robot is home earlier.

A lane that two robots share, or that one sweeps at two times, may be cut anywhere. The search knows
few such places. When it is done, each cut is moved to where it serves best: one part of the lane
becomes shorter and the other longer, and the ways that lead to the cut change with them. The tours
keep their order.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numba import njit

from mrmission.minmax.costs import kinds_of, outward, ways_s
from mrmission.minmax.cut import swept_in_one_go
from mrmission.minmax.hooks import Hooks
from mrmission.minmax.problem import LaneTours
from mrmission.minmax.ways import hooked_ways, shortest_ways, ways_between
from mrmission.model import BoolArray, FloatArray, IntArray
from mrmission.tour.lines import SurveyLine, ends_of, lengths_m
from mrmission.tour.work import PartWork

STEPS = 2000
FIRST_STEP, LAST_STEP = 0.5, 0.005
"""How far the cut that matters most moves in one step, lane spacings."""
FIRST_POWER, LAST_POWER = 5, 11
"""What is made small is the sum of tours to a power: 2 to the power of these."""
PLACE, PLACES = 0.5, 33
"""Ways to a cut are priced at so many places, so many lane spacings apart; no cut moves farther."""
SHORTEST = 1.0
"""No part of a lane becomes shorter than so many lane spacings, nor than it was if that is less."""


@dataclass(frozen=True, slots=True, kw_only=True)
class _Runs:
    """What tours sweep in one go, each from the end at which it is entered.

    Attributes
    ----------
    lines, hooks
        What is swept, with the hooks of its ends.
    ends
        (2 · lines,) which ends of pieces theirs are.
    entries
        Per robot the ends at which they are entered, in order.
    """

    lines: tuple[SurveyLine, ...]
    hooks: Hooks
    ends: IntArray
    entries: tuple[IntArray, ...]


@dataclass(frozen=True, slots=True, kw_only=True)
class _Cuts:
    """Places at which two runs of one straight lane meet.

    Attributes
    ----------
    before, after
        (cuts,) ends of runs.
    along
        (cuts, 2) unit vectors out of the first run.
    """

    before: IntArray
    after: IntArray
    along: FloatArray


def slid(
    lines: tuple[SurveyLine, ...],
    hooks: Hooks,
    tours: LaneTours,
    line_of: IntArray,
    work: PartWork,
    took_s: FloatArray,
) -> tuple[SurveyLine, ...]:
    """Return the pieces of lanes with the cuts between what is swept in one go moved.

    Parameters
    ----------
    lines, hooks, tours
        The pieces, the hooks of their ends, and who sweeps them in which order.
    line_of
        (pieces,) which line each is of, see :class:`~mrmission.minmax.cut.Pieces`.
    work
        The part.
    took_s
        (robots,) seconds that each robot takes before.

    Returns
    -------
    tuple of SurveyLine
        As many; the same where no cut can be moved for the better.
    """
    runs = _runs_of(lines, hooks, tours, line_of)
    cuts = _cuts_of(runs, line_of)
    if not len(cuts.before):
        return lines
    robot = np.zeros(len(runs.lines), dtype=np.int64)
    for r, entries in enumerate(runs.entries):
        robot[entries >> 1] = r
    moved_m = _slide(
        lengths_m(runs.lines), cuts.before >> 1, cuts.after >> 1, robot,
        _ways_to(cuts, runs, work),
        np.array([1.0 / time.survey_speed_m_s for time in work.times]),
        np.asarray(took_s, dtype=np.float64), work.sweep.column_pitch_m,
    )  # fmt: skip
    if not moved_m.any():
        return lines
    ends = ends_of(runs.lines).reshape(-1, 2)
    for mine in (cuts.before, cuts.after):
        ends[mine] += moved_m[:, None] * cuts.along
    touched = np.unique(np.concatenate([cuts.before, cuts.after])[np.tile(moved_m != 0.0, 2)] >> 1)
    return _with_runs(lines, runs, touched, ends)


def _runs_of(
    lines: tuple[SurveyLine, ...], hooks: Hooks, tours: LaneTours, line_of: IntArray
) -> _Runs:
    """Return what is swept in one go; a hook between two pieces keeps them apart."""
    whole, ends = swept_in_one_go(lines, tours, line_of, np.diff(hooks.of_end) > 0)
    first = {end: 2 * i for i, end in enumerate(ends[::2].tolist())}
    entries = tuple(
        np.array([first[e] for e in mine.tolist() if e in first], dtype=np.int64)
        for mine in tours.entries
    )
    return _Runs(lines=whole, hooks=hooks.of_ends(ends), ends=ends, entries=entries)


def _cuts_of(runs: _Runs, line_of: IntArray) -> _Cuts:
    """Return the cuts that may be moved: those at which no hook hangs."""
    place = np.full(2 * len(line_of), -1, dtype=np.int64)
    place[runs.ends] = np.arange(len(runs.ends))
    # end 1 of a piece lies where end 0 of the next one of its line does
    piece = np.flatnonzero(line_of[:-1] == line_of[1:])
    before, after = place[2 * piece + 1], place[2 * piece + 2]
    free = np.diff(runs.hooks.of_end) == 0
    free &= np.repeat([_is_straight(line.points_m) for line in runs.lines], 2)
    good = (before >= 0) & (after >= 0) & free[before] & free[after]
    before, after = before[good], after[good]
    ends = ends_of(runs.lines).reshape(-1, 2)
    along = ends[before] - ends[before ^ 1]
    along /= np.sqrt((along * along).sum(axis=1))[:, None]
    return _Cuts(before=before, after=after, along=along)


def _is_straight(points_m: FloatArray) -> bool:
    """Return whether a polyline is a straight leg, of some length."""
    leg, whole = np.diff(points_m, axis=0), points_m[-1] - points_m[0]
    cross = leg[:, 0] * whole[1] - leg[:, 1] * whole[0]
    return bool(whole.any() and (np.abs(cross) <= 1e-9 * (whole * whole).sum()).all())


def _ways_to(
    cuts: _Cuts, runs: _Runs, work: PartWork
) -> tuple[IntArray, FloatArray, IntArray, FloatArray]:
    """Return the ways that lead to cuts, and what they take by how far the cuts are moved.

    Returns
    -------
    cut, sign
        (ways, 2): the cuts at both ends, -1 for none, and what one metre that each is moved is for
        the way's shift.
    owner
        (ways,) whose they are.
    seconds
        (ways, PLACES) what each takes at shifts of :data:`PLACE` lane spacings from one to the
        next, none in the middle.
    """
    pairs, owner = ways_between(runs.entries)
    cut_of = np.full(len(runs.ends) + 1, -1, dtype=np.int64)  # the last for home, -1
    cut_of[cuts.before] = cut_of[cuts.after] = np.arange(len(cuts.before))
    used = (cut_of[pairs] >= 0).any(axis=1)
    pairs, owner = pairs[used], owner[used]
    ways = shortest_ways(work.harbour, ends_of(runs.lines).reshape(-1, 2), pairs, owner)
    cut = cut_of[pairs]
    # a straight way changes by how both of its ends move, a bent one by each of them alone
    bent = np.array([len(way) > 2 for way in ways], dtype=np.bool_)
    both = np.flatnonzero(bent & (cut >= 0).all(axis=1))
    row = np.concatenate([np.arange(len(ways)), both])
    pairs, owner, cut = pairs[row], owner[row], cut[row]
    cut[both, 1] = cut[len(ways) :, 0] = -1
    # what is shifted is one end that is a cut, the first where both are
    turned = cut[:, 0] < 0
    lead = np.where(turned, cut[:, 1], cut[:, 0])
    axis = cuts.along[lead]
    sign = np.where(cut >= 0, (cuts.along[cut] * axis[:, None]).sum(axis=2), 0.0)
    sign *= np.where(turned[:, None], [-1.0, 1.0], [1.0, -1.0])
    shift = work.sweep.column_pitch_m * PLACE * (np.arange(PLACES) - PLACES // 2)
    length = lengths_m(runs.lines)
    low, high = -length[cuts.before >> 1][lead], length[cuts.after >> 1][lead]
    by = np.clip(shift, low[:, None], high[:, None])[:, :, None] * axis[:, None]
    shifted = _shifted([ways[i] for i in row.tolist()], turned, by, work)
    seconds = _seconds(shifted, np.repeat(pairs, PLACES, axis=0), owner, runs, work)
    return cut, sign, owner, seconds


def _shifted(
    ways: Sequence[FloatArray], turned: BoolArray, by: FloatArray, work: PartWork
) -> list[FloatArray]:
    """Return each way with one end, the last where `turned`, moved `by` (ways, PLACES, 2)."""
    forth = [way[::-1] if last else way for way, last in zip(ways, turned, strict=True)]
    ends = (np.array([way[0] for way in forth])[:, None] + by).reshape(-1, 2)
    nexts = np.repeat([way[1] for way in forth], PLACES, axis=0)
    hidden = np.flatnonzero(~work.harbour.router.visible(ends, nexts))
    around = work.harbour.paths(ends[hidden], nexts[hidden])
    heads = dict(zip(hidden.tolist(), around, strict=True))
    out = []
    for i, end in enumerate(ends):
        rest = forth[i // PLACES][1:]
        head = heads[i][:-1] if i in heads else end[None]
        whole = np.concatenate([head, rest])
        out.append(whole[::-1] if turned[i // PLACES] else whole)
    return out


def _seconds(
    ways: Sequence[FloatArray], pairs: IntArray, owner: IntArray, runs: _Runs, work: PartWork
) -> FloatArray:
    """Return (ways, PLACES) what ways between pairs of ends take, by the hooks of these."""
    alone = work.options.lanes_alone_count
    start = np.append(0, np.cumsum([len(way) for way in ways]))
    first, last = pairs.T
    hooked = hooked_ways(first, last, start, np.concatenate(ways), runs.hooks, always=alone)
    out = np.vstack([outward(runs.lines), np.zeros((1, 2))])  # the last for home
    seconds = np.zeros(len(ways))
    for time, _, _ in kinds_of(work.times):
        mine = np.array([own == time for own in work.times])[np.repeat(owner, PLACES)]
        seconds[mine] = ways_s(hooked, out[first], -out[last], time, lanes_alone=alone)[mine]
    return seconds.reshape(-1, PLACES)


def _with_runs(
    lines: tuple[SurveyLine, ...], runs: _Runs, touched: IntArray, ends: FloatArray
) -> tuple[SurveyLine, ...]:
    """Return the pieces with those of some runs laid anew between the (2 · runs, 2) ends."""
    out = list(lines)
    for run in touched.tolist():
        entry, leave = runs.ends[2 * run : 2 * run + 2].tolist()
        pieces = range(entry >> 1, (leave >> 1) + 1) or range(entry >> 1, (leave >> 1) - 1, -1)
        # pieces within a run may meet anywhere
        share = np.linspace(0.0, 1.0, len(pieces) + 1)[:, None]
        places = ends[2 * run] * (1.0 - share) + ends[2 * run + 1] * share
        places[0], places[-1] = ends[2 * run], ends[2 * run + 1]
        for i, piece in enumerate(pieces):
            points = places[i : i + 2]
            out[piece] = replace(out[piece], points_m=points[::-1] if entry & 1 else points)
    return tuple(out)


@njit(cache=True)
def _slide(length, before, after, robot, ways, sweep, took, pitch):  # type: ignore[no-untyped-def]
    """Return by how much each cut is moved, metres, out of the run before it.

    Steps down the slope of the sum of tours to a power that grows, steps that become smaller;
    ``sweep`` is what a metre of lane takes each robot.
    """
    cut, sign, owner, seconds = ways
    n, places = len(before), seconds.shape[1]
    ways_of = np.full((n, 4), -1, np.int64)  # two at either side of a cut at most
    for w in range(len(cut)):
        for side in range(2):
            if cut[w, side] >= 0:
                free = 0
                while ways_of[cut[w, side], free] >= 0:
                    free += 1
                ways_of[cut[w, side], free] = w
    length = length.copy()
    shortest = np.minimum(length, SHORTEST * pitch)
    far = PLACE * pitch * (places // 2)
    moved, best_moved = np.zeros(n), np.zeros(n)
    cost, weight, slope = took.copy(), np.zeros(len(took)), np.zeros(n)
    shift, steep = np.zeros(len(cut)), np.zeros(len(cut))  # of each way: metres, seconds per metre
    best = took.max()
    step = FIRST_STEP * pitch
    shrink = (LAST_STEP / FIRST_STEP) ** (1.0 / STEPS)
    for turn in range(STEPS):
        cost[:] = took
        for i in range(n):
            a, b = robot[before[i]], robot[after[i]]
            cost[a] += moved[i] * sweep[a]
            cost[b] -= moved[i] * sweep[b]
        for w in range(len(cut)):
            at = shift[w] / (PLACE * pitch) + places // 2
            low = min(max(int(np.floor(at)), 0), places - 2)
            rise = seconds[w, low + 1] - seconds[w, low]
            cost[owner[w]] += seconds[w, low] + (at - low) * rise - seconds[w, places // 2]
            steep[w] = rise / (PLACE * pitch)
        top = cost.max()
        if top < best:
            best = top
            best_moved[:] = moved
        power = FIRST_POWER + ((LAST_POWER - FIRST_POWER + 1) * turn) // STEPS
        for r in range(len(took)):
            weight[r] = cost[r] / top
            for _ in range(power):
                weight[r] *= weight[r]
        for i in range(n):
            a, b = robot[before[i]], robot[after[i]]
            slope[i] = weight[a] * sweep[a] - weight[b] * sweep[b]
        for w in range(len(cut)):
            for side in range(2):
                if cut[w, side] >= 0:
                    slope[cut[w, side]] += weight[owner[w]] * steep[w] * sign[w, side]
        steepest = np.abs(slope).max()
        if steepest <= 0.0:
            break
        for i in range(n):
            a, b = before[i], after[i]
            by = -step * slope[i] / steepest
            by = min(max(by, shortest[a] - length[a]), length[b] - shortest[b])
            by = min(max(by, -far - moved[i]), far - moved[i])
            moved[i] += by
            length[a] += by
            length[b] -= by
            for w in ways_of[i]:
                if w >= 0:
                    shift[w] += by * (sign[w, 0] if cut[w, 0] == i else sign[w, 1])
        step *= shrink
    return best_moved

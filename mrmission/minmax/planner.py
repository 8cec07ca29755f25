"""The lane planner of one part: lines shared among robots so that the last is home early."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from mrmission.minmax.bounds.lanes import LanesBound
from mrmission.minmax.costs import speed_scales
from mrmission.minmax.cut import cut_lines, swept_in_one_go
from mrmission.minmax.hooks import Hooks, find_hooks, no_hooks
from mrmission.minmax.line_bound import (
    bound_of_lines,
    bound_of_listed_lines,
    bound_of_many_lines,
)
from mrmission.minmax.problem import LaneProblem, LaneTours, SparseWays, tour_cost
from mrmission.minmax.runs import part_costs, runs_s, with_runs
from mrmission.minmax.slide import slid
from mrmission.minmax.sparse_costs import SparseCosts, sparse_line_costs
from mrmission.minmax.travel import DENSE_ENDS
from mrmission.minmax.trips import weighted
from mrmission.minmax.ways import hooked_ways, shortest_ways, ways_between
from mrmission.model import CoveragePath, FloatArray, IntArray, LegKind
from mrmission.routing.harbour import Harbour
from mrmission.tour.lines import SurveyLine, ends_of
from mrmission.tour.path import make_path
from mrmission.tour.turns import Turns
from mrmission.tour.work import PartTours, PartWork

BUDGET_PER_LINE_S = 0.03
"""Of the time budget at most so much is spent for each line: few lines are soon as good as can
be."""
ROUNDS = 2
ROUND_SHARE = 0.15
"""So often, and with that share of the budget each time, tours are made even as their paths are
laid."""
MANY_ENDS = 2000
"""Of so many ends the ways between those that were not slid are not looked for again."""
LISTED_ENDS = 6000
"""Up to so many ends the bound takes all ways between them at what is known of each: 900 MB."""
SLIDES = 4
"""So often cuts are slid: each time from the seconds of the paths as they were laid last."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Prepared:
    """A part's work as the search sees it.

    Attributes
    ----------
    work
        What it was made of.
    lines, line_of, hooks
        Lines cut, which line each is of, and their hooks.
    problem
        What the search is told.
    metres, beyond
        Of all ways between ends, with a matrix or without one where it would be too large; None
        for the other, and where they are not known.
    begun
        Tours of a short search.
    """

    work: PartWork
    lines: tuple[SurveyLine, ...]
    line_of: IntArray
    hooks: Hooks
    problem: LaneProblem
    metres: FloatArray | None
    beyond: SparseCosts | None
    begun: LaneTours | None = None


def prepare(work: PartWork) -> Prepared:
    """Return a part's work as the search sees it."""
    lines, line_of, hooks = lines_and_hooks(work)
    problem, metres, beyond = _problems(lines, hooks, work)
    return Prepared(
        work=work, lines=lines, line_of=line_of, hooks=hooks,
        problem=problem, metres=metres, beyond=beyond,
    )  # fmt: skip


@dataclass(frozen=True, slots=True, kw_only=True)
class Start:
    """What one start of the search came to.

    Attributes
    ----------
    ready, tours
        The work, and who sweeps what in which order.
    planned
        What the planner gives back.
    longest_s
        Seconds of the longest path as it was laid.
    """

    ready: Prepared
    tours: LaneTours
    planned: PartTours
    longest_s: float


def lane_tours(work: PartWork) -> PartTours:
    """Return the tours of the lane planner after one start of its search."""
    return one_start(prepare(work), work.options.time_budget_s, work.options.seed).planned


def one_start(ready: Prepared, budget_s: float, seed: int) -> Start:
    """Return what one start of the search comes to.

    Parameters
    ----------
    ready
        The work.
    budget_s
        How long to search; no more than :data:`BUDGET_PER_LINE_S` for each line is used.
    seed
        Of the search.
    """
    from mrmission.minmax.search import minmax

    work, lines = ready.work, ready.lines
    problem = weighted(ready.problem, work.weights)
    if work.line_toll_s > 0:
        problem = problem.dearer([work.line_toll_s] * (1 + len(problem.others)))
    budget_s = min(budget_s, BUDGET_PER_LINE_S * len(lines))
    # thousands of lanes are even already, and to lay them all is dear
    for_trips = work.weights is not None or work.line_toll_s > 0
    rounds = 0 if ready.beyond is not None or for_trips or budget_s <= 0 else ROUNDS
    searched_s = (1.0 - rounds * ROUND_SHARE) * budget_s
    tours = minmax(problem, searched_s, seed)
    if ready.begun is not None and ready.begun.cost.max() < tours.cost.max():
        tours = ready.begun  # a long search is better as a rule, not always
    tours, paths, took_s = _evened_out(
        problem, tours, ready, [ROUND_SHARE * budget_s] * rounds, seed
    )
    longest_s = float(took_s.max())
    if rounds > 0:
        lines, paths, longest_s = _slid(ready, tours, paths, took_s)
    bound = _bound_of(ready, lines, tours)
    planned = PartTours(method="minmax", paths=paths, lanes_bound=bound)
    return Start(ready=ready, tours=tours, planned=planned, longest_s=longest_s)


def _slid(
    ready: Prepared, tours: LaneTours, paths: tuple[CoveragePath, ...], took_s: FloatArray
) -> tuple[tuple[SurveyLine, ...], tuple[CoveragePath, ...], float]:
    """Return lines, cut elsewhere where that is better, paths, and when the last robot is home.

    `took_s` are the seconds of the paths before.
    """
    lines, hooks, work = ready.lines, ready.hooks, ready.work
    best, best_paths, best_s = lines, paths, float(took_s.max())
    for _ in range(SLIDES):
        before = lines
        lines = slid(lines, hooks, tours, ready.line_of, work, took_s)
        if lines is before:
            break
        paths, took_s = laid(tours, lines, hooks, work)
        if took_s.max() < best_s:
            best, best_paths, best_s = lines, paths, float(took_s.max())
    return best, best_paths, best_s


def _bound_of(
    ready: Prepared, lines: tuple[SurveyLine, ...], tours: LaneTours
) -> Callable[[], LanesBound] | None:
    """Return what finds the bound for the lines, slid, that tours sweep; None for trips.

    It keeps what it needs of all ways, and no more.
    """
    work = ready.work
    if work.in_trips:  # planned as robots of their own
        return None
    swept, ends = swept_in_one_go(lines, tours, ready.line_of)
    hooks = ready.hooks.of_ends(ends)
    if ready.beyond is None:
        return partial(bound_of_lines, swept, hooks, work, _metres_of(swept, ends, ready))
    # ways between lines with runs are those between the runs' ends
    if len(ends) <= LISTED_ENDS and max(work.options.runs_m) <= 0:
        return partial(bound_of_listed_lines, swept, hooks, work, ready.beyond.arrays, ends)
    near = ready.beyond.near.astype(np.int64)
    return partial(bound_of_many_lines, lines, near, work)


def _metres_of(swept: tuple[SurveyLine, ...], ends: IntArray, ready: Prepared) -> FloatArray | None:
    """Return the lengths of all ways between the ends of lines, some of which were slid.

    `ends` says which ends of pieces they were. None where to find all lengths takes no longer.
    """
    if ready.metres is None:
        return None
    ends_m = ends_of(swept).reshape(-1, 2)
    moved = np.flatnonzero(np.any(ends_m != ends_of(ready.lines).reshape(-1, 2)[ends], axis=1))
    if len(moved) and len(ends) < MANY_ENDS:
        return None
    metres = ready.metres[np.ix_(ends, ends)]
    if len(moved):
        rows = ready.work.harbour.distances(ends_m[moved], ends_m)
        rows[:, moved] = np.minimum(rows[:, moved], rows[:, moved].T)
        metres[moved] = rows
        metres[:, moved] = rows.T
    return metres


def lines_and_hooks(work: PartWork) -> tuple[tuple[SurveyLine, ...], IntArray, Hooks]:
    """Return what the search shares out: lines cut, which line each is of, and their hooks.

    Lines made for what all others leave come last, each of its own.
    """
    pieces = cut_lines(work)
    hooks, extra = find_hooks(replace(work, lines=pieces.lines))
    lines = pieces.lines + extra
    # arcs go other ways: what they leave is looked for later
    if all(time.turn_radius_m > 0 for time in work.times):
        hooks = no_hooks(2 * len(lines))
    own = np.arange(len(pieces.lines), len(lines))
    line_of = np.concatenate([pieces.line_of, len(pieces.lines) + own])
    return lines, line_of, hooks


def _evened_out(
    problem: LaneProblem,
    tours: LaneTours,
    ready: Prepared,
    rounds_s: Sequence[float],
    seed: int,
) -> tuple[LaneTours, tuple[CoveragePath, ...], FloatArray]:
    """Return tours whose paths, as they are laid, end at nearly the same time, the paths, seconds.

    A path takes longer than its tour was priced at where short legs follow on each other, and where
    ways are far or bent. What a robot's path took more, the next search adds to its tour.
    """
    from mrmission.minmax.search import minmax

    lines, hooks, work = ready.lines, ready.hooks, ready.work
    paths, took_s = laid(tours, lines, hooks, work)
    best = tours, paths, took_s
    if len(paths) < 2:  # nobody to share with
        return best
    for budget_s in rounds_s:
        more_s = took_s - np.array([tour_cost(problem, r, e) for r, e in enumerate(tours.entries)])
        handicap = replace(
            problem, home_cost=np.maximum(problem.home_cost + 0.5 * more_s[:, None], 0.0)
        )
        tours = minmax(handicap, budget_s, seed, tours)
        paths, took_s = laid(tours, lines, hooks, work)
        if took_s.max() < best[2].max():
            best = tours, paths, took_s
    return best


def laid(
    tours: LaneTours, lines: tuple[SurveyLine, ...], hooks: Hooks, work: PartWork
) -> tuple[tuple[CoveragePath, ...], FloatArray]:
    """Return the paths of tours, and the seconds that each robot takes for its own.

    Robots that are alike have about as many runs and arcs each, and their paths are timed without;
    those that differ are timed as they will sail.
    """
    paths = tour_paths(
        work.harbour, lines, hooks, tours.entries, lanes_alone=work.options.lanes_alone_count
    )
    shaped = max(work.options.runs_m) > 0 or any(t.turn_radius_m > 0 for t in work.times)
    sailed: Sequence[CoveragePath] = paths
    if shaped and any(time != work.time for time in work.times):
        turns = Turns(work)
        sailed = turns.for_export(turns.before_covering(paths))
    seconds = [
        time.duration_s(path.points_m, path.kind)
        for path, time in zip(sailed, work.times, strict=True)
    ]
    return paths, np.array(seconds)


def _problems(
    lines: tuple[SurveyLine, ...], hooks: Hooks, work: PartWork
) -> tuple[LaneProblem, FloatArray | None, SparseCosts | None]:
    """Return what the search is told, and what is known of all ways: either of two kinds."""
    if 2 * len(lines) <= DENSE_ENDS:
        costs = part_costs(lines, hooks, work)
        return costs.problem, costs.metres, None
    longer = with_runs(lines, work)
    sparse = sparse_line_costs(
        longer, hooks, work.harbour, work.homes_m, work.times,
        lanes_alone=work.options.lanes_alone_count,
    )  # fmt: skip
    sweep, travel = speed_scales(work.times)
    ways = SparseWays(
        near=sparse.near, arrays=sparse.arrays, second_s=sparse.second_s, price=sparse.price
    )
    problem = LaneProblem(
        lane_cost=sparse.lane_s + runs_s(lines, longer, work, work.time),
        home_cost=sparse.home_s, sparse=ways,
        sweep_scale=sweep, travel_scale=travel,
    )  # fmt: skip
    return problem, None, sparse


def tour_paths(
    harbour: Harbour,
    lines: tuple[SurveyLine, ...],
    hooks: Hooks,
    entries: tuple[IntArray, ...],
    *,
    lanes_alone: bool,
) -> tuple[CoveragePath, ...]:
    """Return each robot's path over its lines, by the hooks that its turns do not cover.

    Parameters
    ----------
    harbour
        Ways in the water; robot ``r`` lives at berth ``r``.
    lines, hooks
        The work.
    entries
        Per robot the ends at which its lines are entered, in order.
    lanes_alone
        Whether ways cover nothing; hooks are then swept, else they are part of a transit.
    """
    ends = ends_of(lines).reshape(-1, 2)
    pairs, owner = ways_between(entries)
    plain = shortest_ways(harbour, ends, pairs, owner)
    sizes = np.array([len(way) for way in plain], dtype=np.int64)
    first, last = pairs.T
    ways = hooked_ways(
        first,
        last,
        np.concatenate([[0], np.cumsum(sizes)]),
        np.concatenate([np.zeros((0, 2)), *plain]),
        hooks,
        always=lanes_alone,
    )
    bits = iter(_in_water(harbour, ways.points_m, ways.start, ways.hooked))
    sweep_kind = LegKind.SURVEY if lanes_alone else LegKind.TRANSIT
    paths: list[CoveragePath] = []
    for robot, mine in enumerate(entries):
        points, kinds, lanes = [harbour.berths_m[robot][None]], [], []
        for number in range(len(mine) + 1 if len(mine) else 0):
            for bit, label in next(bits):
                points.append(bit[1:])
                swept = sweep_kind if label else LegKind.TRANSIT
                kinds.extend([int(swept)] * (len(bit) - 1))
                lanes.extend([0] * (len(bit) - 1))
            if number < len(mine):
                line = lines[mine[number] >> 1].way(int(mine[number]))
                points.append(line[1:])
                kinds.extend([int(LegKind.SURVEY)] * (len(line) - 1))
                lanes.extend([number + 1] * (len(line) - 1))
        paths.append(make_path(robot + 1, np.concatenate(points), kinds, lanes))
    return tuple(paths)


def _in_water(
    harbour: Harbour, points_m: FloatArray, start: IntArray, hooked: np.ndarray
) -> list[list[tuple[FloatArray, bool]]]:
    """Return each way as polylines that stay in the water, and whether each leads to a hook.

    The legs to and from a hook are straight; where land lies on them they go around it.
    """
    swept = (hooked[1:] == 1) | (hooked[:-1] == 2)
    touched = np.flatnonzero((hooked[1:] > 0) | (hooked[:-1] > 0))
    blocked = touched[~harbour.router.visible(points_m[touched], points_m[touched + 1])]
    around = dict(
        zip(
            blocked.tolist(),
            harbour.paths(points_m[blocked], points_m[blocked + 1]),
            strict=True,
        )
    )
    out = []
    for a, b in zip(start[:-1].tolist(), start[1:].tolist(), strict=True):
        legs = [(around.get(i, points_m[i : i + 2]), bool(swept[i])) for i in range(a, b - 1)]
        out.append(legs)
    return out

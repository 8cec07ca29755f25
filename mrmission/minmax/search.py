"""The search of the lane planner: lines shared among robots so that the longest tour is short.

Lines are swept in either direction. One tour over all of them is split where the longest piece is
shortest, then improved by annealing over the whole fleet with moves that are priced in constant
time: segments moved within and between tours, turned round where that helps, segments of two tours
exchanged, parts of a tour reversed, tails exchanged.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from mrmission.minmax.annealing import anneal
from mrmission.minmax.nearest import nearest_ends
from mrmission.minmax.problem import LaneProblem, LaneTours, tour_cost
from mrmission.minmax.split import giant_tour, split_tour

__all__ = ["STEPS_PER_SECOND", "LaneProblem", "LaneTours", "minmax", "tour_cost"]

STEPS_PER_SECOND = 1_500_000
"""Search steps that stand for one second of `time_budget`: the answer depends on the budget and
the seed, never on the machine's speed."""
NEIGHBOURS = 12
FIRST_POWER, FIRST_HEAT = 6.0, 5.0
"""At first, a tour grows by so many ways to a nearest end in one move of three."""
AGAIN_POWER, AGAIN_HEAT = 40.0, 0.1
"""What a search begins with that goes on from tours of an earlier one."""


def minmax(
    problem: LaneProblem,
    time_budget_s: float = 5.0,
    seed: int = 0,
    start: LaneTours | None = None,
) -> LaneTours:
    """Share lines among the robots so that the costliest tour costs little.

    Parameters
    ----------
    problem
        Lines, travel and homes; the number of robots is the number of homes.
    time_budget_s
        How long to search, in units of :data:`STEPS_PER_SECOND` steps; 0 gives the split tour.
    seed
        Of the search's own generator: same problem, budget and seed, same tours.
    start
        Tours to go on from, with small steps; None begins anew.
    """
    lanes, robots = len(problem.lane_cost), problem.robots
    if start is None:
        routes, sizes = split_tour(problem, giant_tour(problem))
    else:
        routes, sizes = _filled_up(start, lanes)
    cost = np.array(
        [tour_cost(problem, r, routes[r, : sizes[r]]) for r in range(robots)], dtype=np.float64
    )
    steps = int(time_budget_s * STEPS_PER_SECOND)
    if steps > 0 and lanes > 1:
        first = (FIRST_POWER, FIRST_HEAT) if start is None else (AGAIN_POWER, AGAIN_HEAT)
        cost = _search(problem, routes, sizes, cost, steps, seed, first)
    return LaneTours(
        entries=tuple(routes[r, : sizes[r]].astype(np.int64) for r in range(robots)), cost=cost
    )


def _filled_up(tours: LaneTours, lanes: int) -> tuple[npt.NDArray[np.int32], npt.NDArray[np.int32]]:
    """Return tours as the search keeps them: see :func:`~mrmission.minmax.split.split_tour`."""
    routes = np.zeros((len(tours.entries), lanes), dtype=np.int32)
    for r, mine in enumerate(tours.entries):
        routes[r, : len(mine)] = mine
    return routes, np.array([len(mine) for mine in tours.entries], dtype=np.int32)


def _search(
    problem: LaneProblem,
    routes: npt.NDArray[np.int32],
    sizes: npt.NDArray[np.int32],
    cost: npt.NDArray[np.float64],
    steps: int,
    seed: int,
    first: tuple[float, float],
) -> npt.NDArray[np.float64]:
    """Improve the routes in place; return their costs."""
    kinds = np.zeros(problem.robots, dtype=np.int64)
    lane = problem.lane_cost[None]
    if problem.end_cost is not None:
        table, ends, least = _NO_TABLE, problem.end_cost[None], problem.end_cost
        if problem.kinds is not None:
            kinds = problem.kinds
            lane = np.stack([problem.lane_cost, *(lanes for lanes, _ in problem.others)])
            ends = np.stack([problem.end_cost, *(ways for _, ways in problem.others)])
            least = ends.min(axis=0)
        near = nearest_ends(least, NEIGHBOURS).astype(np.int32)
    else:
        assert problem.sparse is not None  # one of both is given
        sparse = problem.sparse
        near = sparse.near
        ends, table = np.zeros((0, 0, 0)), (sparse.arrays, sparse.second_s, sparse.price)
    home = np.ascontiguousarray(problem.home_cost)
    state = np.array([(seed * 2654435761 + 88172645463325252) % 2**63], dtype=np.uint64)
    out: npt.NDArray[np.float64] = anneal(
        routes, sizes, cost, np.ascontiguousarray(lane), np.ascontiguousarray(ends), table, kinds,
        home, *problem.scales(), near, steps, state, *first,
    )  # fmt: skip
    return out


_NO_TABLE = (
    (
        np.zeros((0, 4)),
        np.zeros(0, np.int32),
        np.zeros(1, np.int64),
        np.zeros(0, np.int32),
        np.zeros(0, np.float32),
        np.zeros((0, 5), np.float32),
    ),
    np.zeros(0, np.float32),
    (
        np.zeros((0, 2)),
        np.zeros(0),
        np.zeros(1),
        np.zeros(3),
        np.zeros(0, np.int64),
        np.zeros(0),
    ),
)

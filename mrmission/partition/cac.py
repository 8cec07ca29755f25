"""CAC: coverage with area clustering (the paper's second planner)."""

from __future__ import annotations

from collections import deque

import numpy as np

from mrmission.model import FloatArray, IntArray
from mrmission.partition.problem import Assignment, CoverageProblem, visits_of


def cac(problem: CoverageProblem, robots: int) -> Assignment:
    """Grow clusters of adjacent cells of like cost, the farthest first, and tour each by ECC.

    Readings taken, where the paper leaves several:

    * a cluster's seed is the cell farthest from the depot among those nobody has;
    * its budget S is an equal share of what is left (sweeping, plus each remaining robot's way
      there and back), taken anew for each robot, so that S shrinks as cells are given away; the
      alternative keeps the first S for all;
    * the way to the seed counts within the budget (the paper's L);
    * the cluster grows breadth first over the dual graph; a cell that does not fit is passed over
      and the search goes on (the alternative stops there); a cell fits while the cluster stays
      nearer to S with it than without it;
    * what is left after the last cluster, which the paper as printed leaves to nobody, goes cell by
      cell to the robot whose cost it raises least among its neighbours, so the plan is complete;
    * a cluster whose Reeb subgraph is not connected is toured component by component, nearest
      first.

    References
    ----------
    Karapetyan et al. 2017, section IV.B.
    """
    owner = _clusters(problem, robots)
    tours = [problem.ecc(np.flatnonzero(owner == robot)) for robot in range(robots)]
    return tuple(visits_of(tour, 0, len(tour.edge)) for tour in tours)


def _reach(problem: CoverageProblem) -> FloatArray:
    """Return (cells,) travel from the depot to the nearer critical point of each cell."""
    return np.minimum(problem.depot_cost[problem.reeb.tail], problem.depot_cost[problem.reeb.head])


def _clusters(problem: CoverageProblem, robots: int) -> IntArray:
    cells = len(problem.cell_cost)
    neighbours: list[list[int]] = [[] for _ in range(cells)]
    for a, b in problem.dual_edges.tolist():
        neighbours[a].append(b)
        neighbours[b].append(a)
    reach = _reach(problem)
    cost = problem.cell_cost
    owner = np.full(cells, robots, dtype=np.int64)  # `robots` means: nobody yet
    far_first = np.lexsort((np.arange(cells), -reach))
    load = np.zeros(robots)
    for robot in range(robots):
        free = far_first[owner[far_first] == robots]
        if len(free) == 0:
            break
        seed = int(free[0])
        left = robots - robot
        budget = (float(cost[free].sum()) + 2 * left * float(reach[free].mean())) / left
        load[robot] = 2 * reach[seed] + cost[seed]
        owner[seed] = robot
        queue = deque([seed])
        seen = {seed}
        while queue:
            for cell in neighbours[queue.popleft()]:
                if cell in seen or owner[cell] != robots:
                    continue
                seen.add(cell)
                with_it = load[robot] + cost[cell]
                if left > 1 and abs(with_it - budget) > abs(load[robot] - budget):
                    continue
                owner[cell] = robot
                load[robot] = with_it
                queue.append(cell)
    _give_leftovers(owner, load, cost, reach, neighbours, robots)
    return owner


def _give_leftovers(
    owner: IntArray,
    load: FloatArray,
    cost: FloatArray,
    reach: FloatArray,
    neighbours: list[list[int]],
    robots: int,
) -> None:
    """Give each cell that nobody has to the adjacent cluster that ends up least loaded."""
    while True:
        best: tuple[float, int, int] | None = None
        for cell in np.flatnonzero(owner == robots).tolist():
            for other in neighbours[cell]:
                robot = int(owner[other])
                if robot < robots:
                    offer = (float(load[robot] + cost[cell]), cell, robot)
                    best = offer if best is None or offer < best else best
        if best is None:
            break
        _, cell, robot = best
        owner[cell] = robot
        load[robot] += cost[cell]
    for cell in np.flatnonzero(owner == robots).tolist():  # no neighbour anywhere: an own component
        robot = int(np.argmin(load))
        owner[cell] = robot
        load[robot] += 2 * reach[cell] + cost[cell]

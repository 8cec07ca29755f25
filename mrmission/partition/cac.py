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
    * the cluster grows breadth first over the dual graph; a cell fits while the cluster comes
      nearer to S with it than without it, so it overshoots by half a cell at most; one that does
      not fit is passed over and the search goes on (the alternatives: a strict limit, under which
      a seed beside large cells stays alone; overshooting by a whole cell; stopping at a misfit);
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
    for a, b in [*problem.dual_edges.tolist(), *_throats(problem)]:
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
                if load[robot] + cost[cell] - budget > budget - load[robot]:
                    continue
                owner[cell] = robot
                load[robot] += cost[cell]
                queue.append(cell)
    _give_leftovers(owner, load, cost, neighbours, robots)
    return owner


def _throats(problem: CoverageProblem) -> list[tuple[int, int]]:
    """Return pairs of cells that join the components of the graph, by their nearest nodes.

    A throat narrower than a lane joins two waters without joining their slices; without these
    pairs a bay behind one would be a cluster of its own, however small.
    """
    parts = problem.components(np.arange(len(problem.cell_cost)))
    pairs = []
    joined = parts[0]
    for part in parts[1:]:
        a = np.repeat(joined, 2)
        b = np.repeat(part, 2)
        ends_a = problem.reeb.node_m[_ends(problem, joined)]
        ends_b = problem.reeb.node_m[_ends(problem, part)]
        gap = np.hypot(*(ends_a[:, None] - ends_b[None]).transpose(2, 0, 1))
        i, j = np.unravel_index(int(np.argmin(gap)), gap.shape)
        pairs.append((int(a[i]), int(b[j])))
        joined = np.concatenate([joined, part])
    return pairs


def _ends(problem: CoverageProblem, cells: IntArray) -> IntArray:
    """Return (2n,) nodes at both ends of each cell, cell by cell."""
    return np.column_stack([problem.reeb.tail[cells], problem.reeb.head[cells]]).ravel()


def _give_leftovers(
    owner: IntArray,
    load: FloatArray,
    cost: FloatArray,
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

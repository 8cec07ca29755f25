"""CAC: coverage with area clustering (the paper's second planner)."""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass
from typing import Literal

import numpy as np

from mrmission.model import FloatArray, IntArray
from mrmission.partition.problem import Assignment, CoverageProblem, visits_of


@dataclass(frozen=True, slots=True, kw_only=True)
class CacReading:
    """What the paper leaves open about CAC; the defaults are what plans are made with.

    Attributes
    ----------
    seed
        A cluster's seed is the ``farthest`` cell from the depot among those nobody has, or the h-th
        of the ``listed`` cells for robot h, which stays idle when another has it.
    budget
        An equal share S of what is left, taken ``anew`` for each robot, so that S shrinks as cells
        are given away, or the ``fixed`` share of all.
    way
        The way to the seed and back (the paper's L) ``counts`` within the budget, or is ``free``.
    fit
        A cell fits while the cluster comes ``nearest`` to S with it, so that it overshoots by half
        a cell at most; or while S holds it (``strict``: a seed beside large cells stays alone); or
        while S is not reached without it (``overshoot`` by a whole cell).
    misfit
        A cell that does not fit is passed over (``skip``), or ends the cluster (``stop``).
    leftovers
        What is left after the last cluster, which the paper as printed leaves to nobody, goes cell
        by cell to the robot among its ``neighbours`` that it costs least; or all to the ``last``
        robot; or is ``dropped``, so that the plan is not complete.
    floor
        S may be of any size (``none``), or is no less than the ``costliest`` cell.
    """

    seed: Literal["farthest", "listed"] = "farthest"
    budget: Literal["anew", "fixed"] = "anew"
    way: Literal["counts", "free"] = "counts"
    fit: Literal["nearest", "strict", "overshoot"] = "nearest"
    misfit: Literal["skip", "stop"] = "skip"
    leftovers: Literal["neighbours", "last", "dropped"] = "neighbours"
    floor: Literal["none", "costliest"] = "none"


def cac(problem: CoverageProblem, robots: int, reading: CacReading | None = None) -> Assignment:
    """Grow clusters of adjacent cells of like cost, the farthest first, and tour each by ECC.

    Where the paper leaves several readings, :class:`CacReading` has them all. A cluster whose Reeb
    subgraph is not connected is toured component by component, nearest first.

    References
    ----------
    Karapetyan et al. 2017, section IV.B.
    """
    owner = clusters(problem, robots, CacReading() if reading is None else reading)
    tours = [problem.ecc(np.flatnonzero(owner == robot)) for robot in range(robots)]
    return tuple(visits_of(tour, 0, len(tour.edge)) for tour in tours)


def _reach(problem: CoverageProblem) -> FloatArray:
    """Return (cells,) travel from the depot to the nearer critical point of each cell."""
    return np.minimum(problem.depot_cost[problem.reeb.tail], problem.depot_cost[problem.reeb.head])


def neighbours_of(problem: CoverageProblem) -> list[list[int]]:
    """Return the cells that share a critical point, or a throat, with each cell."""
    neighbours: list[list[int]] = [[] for _ in range(len(problem.cell_cost))]
    for a, b in [*problem.dual_edges.tolist(), *_throats(problem)]:
        neighbours[a].append(b)
        neighbours[b].append(a)
    return neighbours


def clusters(
    problem: CoverageProblem,
    robots: int,
    reading: CacReading,
    neighbours: list[list[int]] | None = None,
) -> IntArray:
    """Return (cells,) the robot that has each cell; `robots` for those dropped.

    `neighbours` may be given by who asks often: :func:`neighbours_of` the problem.
    """
    neighbours = neighbours_of(problem) if neighbours is None else neighbours
    owner, load = grow_clusters(problem, robots, reading, neighbours)
    return with_leftovers(problem, owner, load, reading, neighbours)


def with_leftovers(
    problem: CoverageProblem,
    owner: IntArray,
    load: FloatArray,
    reading: CacReading,
    neighbours: list[list[int]],
) -> IntArray:
    """Return the owners of :func:`grow_clusters` with what was left given away."""
    robots = len(load)
    if reading.leftovers == "last":
        owner = np.where(owner == robots, robots - 1, owner)
    elif reading.leftovers == "neighbours":
        owner = owner.copy()
        _give_leftovers(owner, load.copy(), problem.cell_cost, neighbours, robots)
    return owner


def grow_clusters(
    problem: CoverageProblem, robots: int, reading: CacReading, neighbours: list[list[int]]
) -> tuple[IntArray, FloatArray]:
    """Return (cells,) owners, `robots` for what is left, and (robots,) what each has to do."""
    cells = len(problem.cell_cost)
    reach = _reach(problem)
    cost = problem.cell_cost
    owner = np.full(cells, robots, dtype=np.int64)  # `robots` means: nobody yet
    far_first = np.lexsort((np.arange(cells), -reach))
    load = np.zeros(robots)
    way = 2.0 if reading.way == "counts" else 0.0
    budget = 0.0
    for robot in range(robots):
        free = far_first[owner[far_first] == robots]
        if len(free) == 0:
            break
        seed = int(free[0])
        left = robots - robot
        if robot == 0 or reading.budget == "anew":
            budget = (float(cost[free].sum()) + way * left * float(reach[free].mean())) / left
            if reading.floor == "costliest":
                budget = max(budget, float((way * reach + cost).max()))
        if reading.seed == "listed":
            if robot >= cells or owner[far_first[robot]] != robots:
                continue
            seed = int(far_first[robot])
        load[robot] = way * reach[seed] + cost[seed]
        _grow(robot, seed, owner, load, cost, neighbours, budget, reading)
    return owner, load


def _grow(
    robot: int,
    seed: int,
    owner: IntArray,
    load: FloatArray,
    cost: FloatArray,
    neighbours: list[list[int]],
    budget: float,
    reading: CacReading,
) -> None:
    """Give a robot cells around its seed, breadth first, while they fit."""
    nobody = len(load)
    owner[seed] = robot
    queue = deque([seed])
    seen = {seed}
    while queue:
        for cell in neighbours[queue.popleft()]:
            if cell in seen or owner[cell] != nobody:
                continue
            seen.add(cell)
            if reading.fit == "nearest":
                misfit = load[robot] + cost[cell] - budget > budget - load[robot]
            elif reading.fit == "strict":
                misfit = load[robot] + cost[cell] > budget
            else:
                misfit = load[robot] >= budget
            if misfit:
                if reading.misfit == "stop":
                    return
                continue
            owner[cell] = robot
            load[robot] += cost[cell]
            queue.append(cell)


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

"""The paper's planners in every reading that its text leaves open, and what each plan costs.

Names are those of the paper's section IV and V; the GUIDE to each choice is in the docstrings and
in `docs/paper-study.md`. Costs are the paper's: areas, px², plus travel, px.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, fields, replace
from itertools import pairwise, product
from typing import Any, Literal

import numpy as np

from mrmission.decomposition.cells import dual_edges_of
from mrmission.experiments.world import PaperWorld, node_distances
from mrmission.model import FloatArray, IntArray, ReebGraph
from mrmission.partition.cac import CacReading, grow_clusters, neighbours_of, with_leftovers
from mrmission.partition.problem import CoverageProblem
from mrmission.partition.split import frederickson_split, longest_round_trip

Doubled = Literal["halves", "full", "travel"]


@dataclass(frozen=True, slots=True, kw_only=True)
class SplitReading:
    """CRC and FHK: the tour cut after Frederickson, Hecht and Kim.

    Attributes
    ----------
    planner
        ``CRC`` or ``FHK``.
    s_max
        The longest round trip with the ``half`` of Frederickson et al., or ``whole`` as the paper
        prints it.
    doubled
        A doubled cell pays for its lower ``halves`` at one walk and its upper at the other, or in
        ``full`` at both, or in full at the first and ``travel`` at the second.
    distance
        The way to the depot that sets the cuts: ``travel``; least ``covering`` area of cells from
        node to node; or the same where doubled cells count by their smaller half
        (``covering-halves``). Tours are closed by travel in all of them.
    """

    planner: Literal["CRC", "FHK"]
    s_max: Literal["half", "whole"] = "half"
    doubled: Doubled = "halves"
    distance: Literal["travel", "covering", "covering-halves"] = "travel"


@dataclass(frozen=True, slots=True, kw_only=True)
class NrcReading:
    """NRC: the tour cut naively.

    Attributes
    ----------
    closes
        A robot's piece ends with the step that brings the cost from the tour's start to its j/k of
        the whole (``reached``), or before it (``short``); or with the step that brings its own cost
        to 1/k of the whole (``own``), so that what robots overshoot is missing at the end; or to
        j/k of the whole (``growing``: the target grows, the counter starts again at zero).
    remainder
        The ``last`` robot gets what is left; or shares are taken ``anew`` from what is left for
        each robot (no difference for ``reached`` and ``short``, whose shares add up).
    doubled
        As for the split.
    """

    planner: Literal["NRC"] = "NRC"
    closes: Literal["reached", "short", "own", "growing"] = "reached"
    remainder: Literal["last", "anew"] = "last"
    doubled: Doubled = "halves"


@dataclass(frozen=True, slots=True, kw_only=True)
class ClusterReading:
    """CAC: see :class:`mrmission.partition.cac.CacReading` for all but `pieces`.

    ``pieces``: clusters are made of ``cells``, or of the edges of the Euler tour, where doubled
    cells are two ``halves``.
    """

    planner: Literal["CAC"] = "CAC"
    pieces: Literal["cells", "halves"] = "cells"
    seed: Literal["farthest", "listed"] = "farthest"
    budget: Literal["anew", "fixed"] = "anew"
    way: Literal["counts", "free"] = "counts"
    fit: Literal["nearest", "strict", "overshoot"] = "nearest"
    misfit: Literal["skip", "stop"] = "skip"
    leftovers: Literal["neighbours", "last", "dropped"] = "neighbours"
    floor: Literal["none", "costliest"] = "none"

    @property
    def clustering(self) -> CacReading:
        """Return the same as the planner takes it."""
        return CacReading(
            seed=self.seed,
            budget=self.budget,
            way=self.way,
            fit=self.fit,
            misfit=self.misfit,
            leftovers=self.leftovers,
            floor=self.floor,
        )


Reading = SplitReading | NrcReading | ClusterReading

DEFAULTS: tuple[Reading, ...] = (
    SplitReading(planner="CRC"),
    ClusterReading(pieces="halves", way="free", fit="strict", leftovers="last", floor="costliest"),
    NrcReading(closes="growing"),
    SplitReading(planner="FHK", distance="covering-halves"),
)
"""One reading per planner, in the order of the paper's table: those that come nearest to the
authors' published maxima on the four environments, made complete where those are not."""


def name_of(reading: Reading) -> str:
    """Return the planner and what it reads, such as ``CRC s_max=half doubled=halves ...``."""
    named = [f"{f.name}={getattr(reading, f.name)}" for f in fields(reading) if f.name != "planner"]
    return " ".join([reading.planner, *named])


def reading_of(name: str) -> Reading:
    """Return the reading that :func:`name_of` names."""
    planner, *parts = name.split()
    values: dict[str, Any] = dict(part.split("=", 1) for part in parts)
    if planner == "NRC":
        return NrcReading(**values)
    if planner == "CAC":
        return ClusterReading(**values)
    return SplitReading(planner="CRC" if planner == "CRC" else "FHK", **values)


def all_readings() -> Iterator[Reading]:
    """Yield every reading of every planner, but for those that cannot differ from another."""
    doubled: tuple[Doubled, ...] = ("halves", "full", "travel")
    for s_max, twice in product(("half", "whole"), doubled):
        yield reading_of(f"CRC s_max={s_max} doubled={twice} distance=travel")
    clustering = product(
        ("cells", "halves"), ("farthest", "listed"), ("anew", "fixed"), ("counts", "free"),
        (("nearest", "skip"), ("nearest", "stop"), ("strict", "skip"), ("strict", "stop"),
         ("overshoot", "skip")),
        ("neighbours", "last", "dropped"), ("none", "costliest"),
    )  # fmt: skip
    for pieces, seed, budget, way, (fit, misfit), leftovers, floor in clustering:
        yield reading_of(
            f"CAC pieces={pieces} seed={seed} budget={budget} way={way} fit={fit} misfit={misfit}"
            f" leftovers={leftovers} floor={floor}"
        )
    for closes, twice in product(("reached", "short", "own", "growing"), doubled):
        yield reading_of(f"NRC closes={closes} remainder=last doubled={twice}")
        if closes in ("own", "growing"):
            yield reading_of(f"NRC closes={closes} remainder=anew doubled={twice}")
    distances = ("travel", "covering", "covering-halves")
    for s_max, twice, distance in product(("half", "whole"), doubled, distances):
        yield reading_of(f"FHK s_max={s_max} doubled={twice} distance={distance}")


@dataclass(frozen=True, slots=True, kw_only=True)
class PaperPlan:
    """A plan's tours as pieces of work, and its costs.

    Attributes
    ----------
    pieces
        Per robot the steps of the Euler tour that it sweeps, in order; for CAC on whole cells, the
        cells.
    cost
        (robots,) px² + px.
    sweeps
        (robots,) whether the robot sweeps anything for the first time: not where all it has are
        second walks of doubled cells.
    """

    pieces: tuple[IntArray, ...]
    cost: FloatArray
    sweeps: tuple[bool, ...]

    @property
    def tours(self) -> int:
        """Number of robots with work."""
        return sum(len(piece) > 0 for piece in self.pieces)


class Planner:
    """The paper's planners on one map; what they share is made once."""

    def __init__(self, world: PaperWorld) -> None:
        self.world = world
        tour, reeb = world.tour, world.decomposition.reeb
        self._nodes = np.append(tour.tail, tour.head[-1])
        self._home = world.travel[int(np.argmin(world.problem.depot_cost))]
        self._way: list[float] = self._home.tolist()
        area = world.problem.cell_cost
        twice = tour.copy == 2
        self._steps: dict[str, FloatArray] = {
            "halves": world.problem.step_costs(tour),
            "full": area[tour.edge],
            "travel": np.where(twice, reeb.w_t[tour.edge], area[tour.edge]),
        }
        doubled = np.zeros(len(area), dtype=np.bool_)
        doubled[tour.edge[twice]] = True
        smaller = np.where(doubled, world.half_area.min(axis=1), area)
        start = int(self._nodes[0])
        self._distance: dict[str, FloatArray] = {
            "travel": self._home,
            "covering": world.covering[start],
            "covering-halves": node_distances(reeb, smaller)[start],
        }
        halves = halved_problem(world)
        self._problems = {"cells": world.problem, "halves": halves}
        self._grown: dict[tuple[ClusterReading, int], tuple[IntArray, FloatArray]] = {}
        self._cluster_costs: dict[tuple[str, bytes], float] = {}
        self._neighbours = {name: neighbours_of(p) for name, p in self._problems.items()}

    def forget(self) -> None:
        """Forget the clusters found so far, so that the next plan takes its full time."""
        self._grown.clear()
        self._cluster_costs.clear()

    def tour_cost(self, doubled: Doubled = "halves") -> float:
        """Return c(R), the cost of the single-robot tour."""
        return float(self._steps[doubled].sum())

    def plan(self, reading: Reading, robots: int) -> PaperPlan:
        """Return the plan of one planner in one reading."""
        if isinstance(reading, ClusterReading):
            return self._clusters(reading, robots)
        step = self._steps[reading.doubled]
        if isinstance(reading, NrcReading):
            return self._pieces(naive_borders(step, robots, reading), step)
        distance = self._distance[reading.distance][self._nodes]
        trip = longest_round_trip(step, distance) * (2.0 if reading.s_max == "whole" else 1.0)
        return self._pieces(frederickson_split(step, distance, robots, s_max=trip), step)

    def missed_px(self, reading: Reading, plan: PaperPlan) -> float:
        """Return the free area that no tour of a plan sweeps, px²."""
        if isinstance(reading, ClusterReading):
            area = self._problems[reading.pieces].cell_cost
            swept = sum(float(area[piece].sum()) for piece in plan.pieces)
            return max(0.0, float(area.sum()) - swept)
        return 0.0

    def _pieces(self, borders: Sequence[int], step: FloatArray) -> PaperPlan:
        tour = self.world.tour
        way = self._home[self._nodes]
        cost = [
            float(step[a:b].sum() + way[a] + way[b]) if b > a else 0.0 for a, b in pairwise(borders)
        ]
        return PaperPlan(
            pieces=tuple(np.arange(a, b) for a, b in pairwise(borders)),
            cost=np.array(cost),
            sweeps=tuple(bool((tour.copy[a:b] != 2).any()) for a, b in pairwise(borders)),
        )

    def _clusters(self, reading: ClusterReading, robots: int) -> PaperPlan:
        problem = self._problems[reading.pieces]
        neighbours = self._neighbours[reading.pieces]
        # readings that differ in the leftovers alone share their clusters, and many their costs
        key = (replace(reading, leftovers="dropped"), robots)
        if key not in self._grown:
            self._grown[key] = grow_clusters(problem, robots, reading.clustering, neighbours)
        owner, load = self._grown[key]
        owner = with_leftovers(problem, owner, load, reading.clustering, neighbours)
        order = np.argsort(owner, kind="stable")
        first = np.searchsorted(owner[order], np.arange(robots + 1))
        pieces = tuple(order[a:b] for a, b in pairwise(first.tolist()))
        cost = []
        for cells in pieces:
            cluster = (reading.pieces, cells.tobytes())
            if cluster not in self._cluster_costs:
                self._cluster_costs[cluster] = self._cluster_cost(problem, cells)
            cost.append(self._cluster_costs[cluster])
        if reading.pieces == "halves":
            sweeps = tuple(bool((self.world.tour.copy[c] != 2).any()) for c in pieces)
        else:
            sweeps = tuple(len(c) > 0 for c in pieces)
        return PaperPlan(pieces=pieces, cost=np.array(cost), sweeps=sweeps)

    def _cluster_cost(self, problem: CoverageProblem, cells: IntArray) -> float:
        """Return what the tours (ECC) of a cluster's components cost, one after the other.

        A component's tour starts and ends at its critical point nearest to the depot; in halves,
        its steps add up to its cells' areas, so that the tour itself need not be found.
        """
        if len(cells) == 0:
            return 0.0
        tail, head = problem.reeb.tail, problem.reeb.head
        # plain numbers: clusters are small, and there are millions of them in the study
        root: dict[int, int] = {}

        def find(node: int) -> int:
            while root.setdefault(node, node) != node:
                node = root[node]
            return node

        for u, v in zip(tail[cells].tolist(), head[cells].tolist(), strict=True):
            root[find(u)] = find(v)
        nearest: dict[int, tuple[float, int]] = {}
        for node in list(root):
            top = find(node)
            offer = (self._way[node], node)
            nearest[top] = min(offer, nearest.get(top, offer))
        stops = sorted(nearest.values())
        total = float(problem.cell_cost[cells].sum()) + stops[0][0] + stops[-1][0]
        for (_, a), (_, b) in pairwise(stops):
            total += float(self.world.travel[a, b])
        return total


def naive_borders(step: FloatArray, robots: int, reading: NrcReading) -> list[int]:
    """Return where NRC cuts a tour: piece j is steps ``border[j]:border[j + 1]``.

    Examples
    --------
    >>> naive_borders(np.ones(10), 4, NrcReading(closes="growing"))
    [0, 3, 8, 10, 10]
    >>> naive_borders(np.ones(10), 4, NrcReading(closes="short"))
    [0, 2, 5, 7, 10]
    """
    n = len(step)
    prefix = np.concatenate([[0.0], np.cumsum(step)])
    whole = float(prefix[-1])
    hair = 1e-12 * whole  # rounding in the sum shall not cost a robot one whole cell
    borders = [0]
    for j in range(1, robots):
        at = borders[-1]
        if reading.closes == "reached":
            goal = whole * j / robots
        elif reading.closes == "short":
            goal = whole * j / robots
            borders.append(max(at, int(np.searchsorted(prefix, goal + hair, side="right")) - 1))
            continue
        elif reading.remainder == "anew":
            left = whole - float(prefix[at])
            part = 1 if reading.closes == "own" else j
            goal = float(prefix[at]) + left * part / (robots - j + 1)
        else:
            goal = float(prefix[at]) + whole * (1 if reading.closes == "own" else j) / robots
        borders.append(min(n, max(at, int(np.searchsorted(prefix, goal - hair, side="left")))))
    borders.append(n)
    return borders


def halved_problem(world: PaperWorld) -> CoverageProblem:
    """Return the problem whose cells are the steps of the Euler tour: halves where doubled."""
    reeb, edge = world.decomposition.reeb, world.tour.edge
    area = world.problem.step_costs(world.tour)
    width = world.decomposition.cells.width_m[edge]
    steps = ReebGraph(
        node_m=reeb.node_m,
        tail=reeb.tail[edge],
        head=reeb.head[edge],
        w_c=area,
        w_t=reeb.w_t[edge],
        c_e=width**2 / np.maximum(area, 1e-9),
    )
    return CoverageProblem(
        reeb=steps,
        dual_edges=dual_edges_of(steps.tail, steps.head),
        cell_cost=area,
        half_cost=np.column_stack([area / 2, area / 2]),
        depot_cost=world.problem.depot_cost,
    )

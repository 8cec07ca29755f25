"""The paper's planners in every reading: costs by brute force, and readings that differ."""

from __future__ import annotations

from itertools import pairwise

import networkx as nx
import numpy as np
import pytest

from mrmission.experiments.random_maps import random_map
from mrmission.experiments.readings import (
    DEFAULTS,
    ClusterReading,
    NrcReading,
    Planner,
    SplitReading,
    all_readings,
    halved_problem,
    naive_borders,
    name_of,
    reading_of,
)
from mrmission.experiments.tables import (
    PAPER_TABLE_2,
    Score,
    ScoreReading,
    by_distance,
    score,
    table_1,
)
from mrmission.experiments.world import paper_world

FREE = random_map(1, 3)
WORLD = paper_world(FREE)
PLANNER = Planner(WORLD)


def travel_graph() -> nx.MultiGraph:
    reeb = WORLD.decomposition.reeb
    graph = nx.MultiGraph()
    for u, v, w in zip(reeb.tail.tolist(), reeb.head.tolist(), reeb.w_t.tolist(), strict=True):
        graph.add_edge(u, v, weight=w)
    return graph


def way(a: int, b: int) -> float:
    return float(nx.dijkstra_path_length(travel_graph(), a, b))


def test_names_are_read_back_and_all_differ() -> None:
    readings = list(all_readings())
    names = [name_of(reading) for reading in readings]
    assert len(set(names)) == len(names)
    assert [reading_of(name) for name in names] == readings
    assert set(map(name_of, DEFAULTS)) <= set(names)


def test_travel_and_covering_are_shortest_ways() -> None:
    reeb = WORLD.decomposition.reeb
    area = nx.MultiGraph()
    for u, v, w in zip(reeb.tail.tolist(), reeb.head.tolist(), reeb.w_c.tolist(), strict=True):
        area.add_edge(u, v, weight=w)
    for node in range(0, len(reeb.node_m), 3):
        assert WORLD.travel[0, node] == pytest.approx(way(0, node))
        expected = nx.dijkstra_path_length(area, 0, node)
        assert WORLD.covering[0, node] == pytest.approx(expected)


def test_halves_add_up_to_cells_and_the_tour_to_the_free_area() -> None:
    assert WORLD.half_area.sum(axis=1) == pytest.approx(WORLD.problem.cell_cost)
    assert PLANNER.tour_cost("halves") == pytest.approx(FREE.sum())
    doubled = WORLD.problem.cell_cost[WORLD.tour.edge[WORLD.tour.copy == 2]].sum()
    assert PLANNER.tour_cost("full") == pytest.approx(FREE.sum() + doubled)


@pytest.mark.parametrize("doubled", ["halves", "full", "travel"])
@pytest.mark.parametrize("robots", [1, 3, 8])
def test_costs_of_split_tours_by_walking_them(doubled: str, robots: int) -> None:
    plan = PLANNER.plan(reading_of(f"CRC s_max=half doubled={doubled} distance=travel"), robots)
    tour, reeb = WORLD.tour, WORLD.decomposition.reeb
    assert np.concatenate(plan.pieces).tolist() == list(range(len(tour.edge)))
    for piece, cost in zip(plan.pieces, plan.cost, strict=True):
        if len(piece) == 0:
            assert cost == 0
            continue
        expected = way(0, int(tour.tail[piece[0]])) + way(int(tour.head[piece[-1]]), 0)
        for step in piece.tolist():
            cell, copy = int(tour.edge[step]), int(tour.copy[step])
            if doubled == "halves" and copy:
                expected += WORLD.half_area[cell, copy - 1]
            elif doubled == "travel" and copy == 2:
                expected += reeb.w_t[cell]
            else:
                expected += reeb.w_c[cell]
        assert cost == pytest.approx(expected)


@pytest.mark.parametrize("pieces", ["cells", "halves"])
@pytest.mark.parametrize("robots", [2, 8])
def test_costs_of_clusters_by_touring_them(pieces: str, robots: int) -> None:
    reading = reading_of(f"CAC pieces={pieces} fit=strict leftovers=neighbours")
    plan = PLANNER.plan(reading, robots)
    problem = WORLD.problem if pieces == "cells" else halved_problem(WORLD)
    for cells, cost in zip(plan.pieces, plan.cost, strict=True):
        tour = problem.ecc(cells)
        at, expected = 0, 0.0
        for i, step_cost in enumerate(problem.step_costs(tour).tolist()):
            expected += step_cost + way(at, int(tour.tail[i])) * (at != tour.tail[i])
            at = int(tour.head[i])
        assert cost == pytest.approx(expected + (way(at, 0) if len(cells) else 0.0))


def slow_borders(step: list[float], robots: int, closes: str, remainder: str) -> list[int]:
    """NRC as one would say it: walk on, and stop where the rule says."""
    whole, borders, at = sum(step), [0], 0
    for j in range(1, robots):
        own, left = 0.0, sum(step[at:])
        factor = j if closes == "growing" else 1
        goal = left * factor / (robots - j + 1) if remainder == "anew" else whole * factor / robots
        while at < len(step):
            here = sum(step[:at]) if closes in ("reached", "short") else own
            target = whole * j / robots if closes in ("reached", "short") else goal
            if closes == "short" and here + step[at] > target + 1e-9:
                break
            if closes != "short" and here >= target - 1e-9:
                break
            own += step[at]
            at += 1
        borders.append(at)
    return [*borders, len(step)]


@pytest.mark.parametrize("closes", ["reached", "short", "own", "growing"])
@pytest.mark.parametrize("remainder", ["last", "anew"])
def test_naive_borders_against_walking(closes: str, remainder: str) -> None:
    rng = np.random.default_rng(4)
    reading = NrcReading(closes=closes, remainder=remainder)  # type: ignore[arg-type]
    for _ in range(40):
        step = rng.integers(1, 9, rng.integers(1, 14)).astype(float)
        robots = int(rng.integers(1, 9))
        found = naive_borders(step, robots, reading)
        if closes in ("reached", "short"):
            assert found == slow_borders(step.tolist(), robots, closes, "last")
        else:
            assert found == slow_borders(step.tolist(), robots, closes, remainder)
        assert found[0] == 0
        assert found[-1] == len(step)
        assert all(a <= b for a, b in pairwise(found))


def results() -> list[dict[str, object]]:
    from mrmission.experiments.steps import paper_plans

    names = [
        *map(name_of, DEFAULTS),
        "FHK s_max=whole doubled=halves distance=covering",
        "NRC closes=own remainder=last doubled=full",
        "CAC pieces=cells leftovers=dropped fit=strict",
    ]
    names = [name_of(reading_of(name)) for name in names]
    robots = [1, 2, 4, 8, 16, 20, 32]
    return [
        paper_plans({"seed": 1, "number": n, "readings": names, "robots": robots}) for n in range(3)
    ]


def test_readings_differ_where_they_must() -> None:
    def costs(reading: SplitReading | NrcReading | ClusterReading) -> list[list[float]]:
        plans = [PLANNER.plan(reading, k) for k in (2, 4, 8, 16)]
        return [sorted(plan.cost.tolist()) for plan in plans]

    crc = SplitReading(planner="CRC")
    assert costs(crc) != costs(SplitReading(planner="CRC", s_max="whole"))
    assert costs(crc) != costs(SplitReading(planner="CRC", doubled="travel"))
    fhk = SplitReading(planner="FHK", distance="covering-halves")
    assert costs(fhk) != costs(SplitReading(planner="FHK", distance="covering"))
    assert costs(fhk) != costs(crc)
    nrc = {closes: costs(NrcReading(closes=closes)) for closes in ("reached", "short", "own")}
    growing = costs(NrcReading(closes="growing"))
    assert nrc["reached"] != nrc["short"] != nrc["own"] != growing
    cac = ClusterReading()
    for change in (
        {"pieces": "halves"},
        {"seed": "listed"},
        {"budget": "fixed"},
        {"way": "free"},
        {"fit": "strict"},
        {"fit": "overshoot"},
        {"misfit": "stop"},
        {"floor": "costliest"},
    ):
        assert costs(ClusterReading(**change)) != costs(cac), change  # type: ignore[arg-type]


def test_the_three_ways_with_leftovers() -> None:
    """Dropped leaves area to nobody; the others leave none and cost as much or more."""
    plans = {}
    for leftovers in ("dropped", "last", "neighbours"):
        reading = ClusterReading(fit="strict", leftovers=leftovers)  # type: ignore[arg-type]
        plan = PLANNER.plan(reading, 2)
        plans[leftovers] = plan
        missed = PLANNER.missed_px(reading, plan)
        swept = sum(WORLD.problem.cell_cost[cells].sum() for cells in plan.pieces)
        assert missed == pytest.approx(WORLD.free_px - swept)
        assert (missed > 0) == (leftovers == "dropped")
    assert plans["last"].cost.max() >= plans["dropped"].cost.max()
    assert plans["neighbours"].cost.max() >= plans["dropped"].cost.max()


def test_growing_closes_after_few_robots_as_the_authors_nrc_does() -> None:
    """Pieces of 1/k, 2/k, ...: m of them with m(m + 1)/2 >= k, or fewer for what they overshoot."""
    step = np.ones(10_000)
    used = []
    for k in (1, 2, 4, 8, 16, 20, 32):
        borders = naive_borders(step, k, NrcReading(closes="growing"))
        used.append(sum(b > a for a, b in pairwise(borders)))
    assert used == [1, 2, 3, 4, 6, 6, 8]


def test_a_score_by_hand() -> None:
    name = "NRC closes=growing remainder=last doubled=full"
    maps = [
        {
            "graph": {"free_px": 100.0},
            "tour_costs": {"full": 200.0},
            "plans": {name: [[200.0, 1, 1, 0.0], [120.0, 2, 1, 10.0]]},
        }
    ]
    found = score(maps, name, ScoreReading(), robots=(1, 2))
    assert found == Score(utilization=0.5, ratio=0.6, missed=0.1)
    found = score(maps, name, ScoreReading(denominator="free", used="any"), robots=(1, 2))
    assert found == Score(utilization=1.0, ratio=1.2, missed=0.1)
    found = score(maps, name, ScoreReading(robots="both"), robots=(1, 2))
    assert found == Score(utilization=0.75, ratio=0.8, missed=0.05)
    assert Score(utilization=0.45, ratio=0.2, missed=0).distance((0.5, 0.25)) == pytest.approx(0.3)


def test_tables_from_results() -> None:
    maps = results()
    table = table_1(maps)
    vertices = [m["graph"]["vertices"] for m in maps]  # type: ignore[index]
    assert table.rows[0][1:4] == (
        f"{min(vertices)}", f"{np.mean(vertices):,.1f}", f"{max(vertices)}",
    )  # fmt: skip
    assert table.markdown().startswith("## Table 1: 3 random maps\n")
    assert table.csv().count("\n") == 5
    for planner in PAPER_TABLE_2:
        ranked = by_distance(maps, planner)
        assert {n.name.split()[0] for n in ranked} == {planner}
        distances = [n.distance for n in ranked]
        assert distances == pytest.approx(sorted(distances))

"""Regions that hang together: pieces and crossings counted, lanes exchanged at no cost."""

from __future__ import annotations

import numpy as np
import pytest
import shapely
from hypothesis import given, settings
from hypothesis import strategies as st

from mrmission.minmax.joining import beside, borders, join_regions
from mrmission.minmax.problem import LaneProblem, LaneTours, tour_cost
from mrmission.minmax.regions import (
    connected,
    crossings_m,
    region_pieces,
    survey_lines,
    swept_regions,
)
from mrmission.model import CoveragePath, FloatArray, LegKind
from mrmission.tour.path import join_pieces

SURVEY, TRANSIT = LegKind.SURVEY, LegKind.TRANSIT


def lanes_at(columns: list[float], length_m: float = 100.0) -> list[FloatArray]:
    return [np.array([[x, 0.0], [x, length_m]]) for x in columns]


def path_over(robot: int, columns: list[float], home: tuple[float, float]) -> CoveragePath:
    """A robot that sweeps lanes of 100 m at some columns, up and down, from a home and back."""
    here = np.array(home)
    pieces = []
    for number, lane in enumerate(lanes_at(columns), start=1):
        way = lane if number % 2 else lane[::-1]
        pieces.append((np.array([here, way[0]]), TRANSIT, 0))
        pieces.append((way, SURVEY, number))
        here = way[1]
    pieces.append((np.array([here, home]), TRANSIT, 0))
    return join_pieces(robot, pieces)


def test_lanes_side_by_side_are_one_piece() -> None:
    near = path_over(1, [0.0, 20.0, 40.0], (0.0, -30.0))
    apart = path_over(2, [60.0, 80.0, 140.0, 160.0, 220.0], (0.0, -40.0))
    idle = CoveragePath(
        robot=3, points_m=np.zeros((1, 2)), kind=np.zeros(0, np.int8), lane=np.zeros(0, np.int64)
    )
    assert region_pieces([near, apart, idle], 20.0) == (1, 3, 0)
    assert [line.length for line in survey_lines(near)] == [100.0] * 3
    assert survey_lines(idle) == []


def test_transits_through_others_lanes_are_measured() -> None:
    # robot 2 goes to its lanes at 200 and 220 and back, at 50 m and at 0 m, past those of robot 1
    first = path_over(1, [40.0, 60.0], (50.0, -30.0))
    second = join_pieces(
        2,
        [
            (np.array([[0.0, 50.0], [200.0, 50.0], [200.0, 0.0]]), TRANSIT, 0),
            (np.array([[200.0, 0.0], [200.0, 100.0]]), SURVEY, 1),
            (np.array([[200.0, 100.0], [200.0, 150.0], [0.0, 150.0], [0.0, 50.0]]), TRANSIT, 0),
        ],
    )
    regions = swept_regions([first, second], 20.0)
    assert regions[0].area == pytest.approx(40.0 * 100.0)
    found = crossings_m([first, second], 20.0)
    assert found[0] == 0.0
    assert found[1] == pytest.approx(40.0)  # from 30 to 70 m east


@settings(max_examples=20, deadline=None)
@given(st.integers(0, 2**32 - 1), st.integers(1, 25))
def test_pieces_are_those_of_a_walk(seed: int, count: int) -> None:
    rng = np.random.default_rng(seed)
    ends = rng.uniform(0, 100, (count, 1, 2)) + rng.uniform(-15, 15, (count, 2, 2))
    lines = [shapely.LineString(e) for e in ends]
    found = connected(lines, 8.0)
    near = np.array([[a.distance(b) <= 8.0 for b in lines] for a in lines])
    label = np.full(count, -1)
    pieces = 0
    for seed_line in range(count):
        if label[seed_line] >= 0:
            continue
        todo = [seed_line]
        while todo:
            line = todo.pop()
            if label[line] < 0:
                label[line] = pieces
                todo.extend(np.flatnonzero(near[line] & (label < 0)).tolist())
        pieces += 1
    assert found.tolist() == label.tolist()


def problem_of(lanes: list[FloatArray], homes: FloatArray) -> LaneProblem:
    ends = np.concatenate(lanes)
    return LaneProblem(
        lane_cost=np.array([np.hypot(*(lane[1] - lane[0])) for lane in lanes]),
        end_cost=np.hypot(*(ends[:, None] - ends[None]).transpose(2, 0, 1)),
        home_cost=np.hypot(*(homes[:, None] - ends[None]).transpose(2, 0, 1)),
    )


def tours_of(problem: LaneProblem, entries: list[list[int]]) -> LaneTours:
    mine = tuple(np.array(e, dtype=np.int64) for e in entries)
    cost = np.array([tour_cost(problem, r, e) for r, e in enumerate(mine)])
    return LaneTours(entries=mine, cost=cost)


def test_lanes_taken_by_turns_are_sorted_out() -> None:
    """Two robots that take every other lane end up with one half each, and earlier home."""
    lanes = lanes_at([20.0 * i for i in range(12)])
    problem = problem_of(lanes, np.array([[0.0, -20.0], [220.0, -20.0]]))
    tours = tours_of(problem, [[2 * i + (i // 2) % 2 for i in range(r, 12, 2)] for r in (0, 1)])
    pairs = beside(lanes, 20.0)
    assert len(pairs) == 11
    assert borders(tours.entries, pairs) == 11
    found = join_regions(problem, tours, pairs)
    assert borders(found.entries, pairs) == 1
    assert found.cost.max() <= tours.cost.max()


@settings(max_examples=15, deadline=None)
@given(st.integers(0, 2**32 - 1), st.integers(2, 4), st.integers(4, 24))
def test_joining_never_costs_the_longest(seed: int, robots: int, count: int) -> None:
    rng = np.random.default_rng(seed)
    lanes = [
        np.array([[x, low], [x, low + rng.uniform(5, 90)]])
        for x, low in zip(20.0 * rng.integers(0, 8, count), rng.uniform(0, 90, count), strict=True)
    ]
    problem = problem_of(lanes, rng.uniform(0, 150, (robots, 2)))
    order = 2 * rng.permutation(count) + rng.integers(0, 2, count)
    tours = tours_of(problem, [order[r::robots].tolist() for r in range(robots)])
    pairs = beside(lanes, 20.0)
    found = join_regions(problem, tours, pairs)
    assert sorted(np.concatenate(found.entries) >> 1) == list(range(count))
    assert found.cost.max() <= tours.cost.max() * (1 + 2e-9)
    assert [len(e) > 0 for e in found.entries] == [len(e) > 0 for e in tours.entries]
    for robot, entries in enumerate(found.entries):
        assert found.cost[robot] == pytest.approx(tour_cost(problem, robot, entries))
    # fewer borders, or as many and less travel
    weight = 60.0 / tours.cost.max()
    before = borders(tours.entries, pairs) + weight * tours.cost.sum()
    assert borders(found.entries, pairs) + weight * found.cost.sum() <= before + 1e-6
    again = join_regions(problem, tours, pairs)
    assert all((a == b).all() for a, b in zip(found.entries, again.entries, strict=True))

"""Regions: the pieces of each robot's lanes, and transits through others' lanes, counted."""

from __future__ import annotations

import numpy as np
import pytest
import shapely
from hypothesis import given, settings
from hypothesis import strategies as st

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

"""Run-ins and run-outs: where they lie, and that they change nothing else."""

from __future__ import annotations

import numpy as np
import pytest
import shapely
from hypothesis import given, settings
from hypothesis import strategies as st

from mrmission.model import CoveragePath, LegKind
from mrmission.tour.path import make_path
from mrmission.tour.turnaround import whole_runs, with_turnarounds

T, S = int(LegKind.TRANSIT), int(LegKind.SURVEY)
BOX = shapely.box(0, 0, 100, 100)


def two_lanes() -> CoveragePath:
    """Home, a lane upwards, over to the next, downwards, home."""
    points = np.array([[0, 0], [10, 20], [10, 80], [20, 80], [20, 20], [0, 0]], dtype=float)
    return make_path(1, points, [T, S, T, S, T], [0, 1, 0, 2, 0])


def test_lanes_are_lengthened_at_both_ends() -> None:
    path = with_turnarounds(two_lanes(), 15.0, None)
    assert path.points_m.tolist() == [
        [0, 0],
        [10, 5], [10, 20], [10, 80], [10, 95],
        [20, 95], [20, 80], [20, 20], [20, 5],
        [0, 0],
    ]  # fmt: skip
    assert path.kind.tolist() == [T, T, S, T, T, T, S, T, T]
    assert path.lane.tolist() == [0, 0, 1, 0, 0, 0, 2, 0, 0]


def test_nothing_happens_without_a_turnaround_or_a_lane() -> None:
    path = two_lanes()
    assert with_turnarounds(path, 0.0, None) is path
    idle = make_path(1, np.zeros((1, 2)), [], [])
    assert with_turnarounds(idle, 15.0, None) is idle


def test_on_water_a_run_ends_at_the_shore() -> None:
    path = with_turnarounds(two_lanes(), 50.0, BOX)
    assert path.points_m[[1, 4]].tolist() == [[10, 0], [10, 100]]
    assert BOX.buffer(1e-6).covers(shapely.LineString(path.points_m))


def test_whole_runs_are_counted() -> None:
    assert whole_runs(with_turnarounds(two_lanes(), 15.0, BOX), 15.0, 15.0) == (2, 2, 2)
    # 20 m of water beyond both ends of both lanes
    assert whole_runs(with_turnarounds(two_lanes(), 20.0, BOX, 30.0), 20.0, 30.0) == (2, 0, 2)
    assert whole_runs(two_lanes(), 5.0, 0.0) == (0, 2, 2)
    assert whole_runs(make_path(1, np.zeros((1, 2)), [], []), 5.0, 5.0) == (0, 0, 0)


def test_on_water_a_run_is_left_out_where_the_way_on_would_cross_land() -> None:
    # a headland stands between the run-outs of the two lanes, from above
    water = BOX - shapely.box(14, 85, 16, 101)
    path = with_turnarounds(two_lanes(), 15.0, water)
    assert path.points_m.tolist()[:4] == [[0, 0], [10, 5], [10, 20], [10, 80]]
    assert [10.0, 95.0] not in path.points_m.tolist()
    assert water.buffer(1e-6).covers(shapely.LineString(path.points_m))


def test_a_run_through_an_island_stops_before_it() -> None:
    water = BOX - shapely.box(5, 88, 25, 90)
    path = with_turnarounds(two_lanes(), 15.0, water)
    assert path.points_m[3:6].tolist() == [[10, 80], [10, 88], [20, 88]]


def test_lanes_without_a_transit_between_them_are_one_stretch() -> None:
    points = np.array([[0, 0], [10, 20], [10, 80], [20, 80], [0, 0]], dtype=float)
    path = with_turnarounds(make_path(1, points, [T, S, S, T], [0, 1, 2, 0]), 10.0, None)
    assert path.points_m.tolist() == [
        [0, 0],
        [10, 10],
        [10, 20],
        [10, 80],
        [20, 80],
        [30, 80],
        [0, 0],
    ]


def test_a_lane_that_begins_at_home_has_no_run_in_there() -> None:
    points = np.array([[0, 0], [0, 50], [30, 0], [0, 0]], dtype=float)
    path = with_turnarounds(make_path(1, points, [S, T, T], [1, 0, 0]), 10.0, None)
    assert path.points_m.tolist() == [[0, 0], [0, 50], [0, 60], [30, 0], [0, 0]]


@settings(max_examples=100, deadline=None)
@given(
    st.lists(
        st.tuples(st.integers(2, 98), st.integers(2, 98), st.sampled_from([T, S])),
        min_size=2, max_size=12, unique_by=lambda row: row[:2],
    ),
    st.sampled_from([3.0, 15.0, 60.0]),
    st.booleans(),
)  # fmt: skip
def test_what_holds_for_every_path(
    rows: list[tuple[int, int, int]], turnaround_m: float, limited: bool
) -> None:
    points = np.array([[1, 1], *[row[:2] for row in rows], [1, 1]], dtype=float)
    kind = [*[row[2] for row in rows], T]
    before = make_path(1, points, kind, [0] * len(kind))
    after = with_turnarounds(before, turnaround_m, BOX if limited else None)
    assert after.points_m[0].tolist() == after.points_m[-1].tolist() == [1, 1]

    def lanes(path: CoveragePath) -> list[list[list[float]]]:
        legs = np.stack([path.points_m[:-1], path.points_m[1:]], axis=1)
        return legs[path.kind == S].tolist()

    assert lanes(after) == lanes(before)
    way = shapely.LineString(before.points_m)
    # no farther from the old way than a run is long, at any place
    dense = shapely.get_coordinates(shapely.segmentize(shapely.LineString(after.points_m), 0.5))
    assert shapely.distance(shapely.points(dense), way).max() <= turnaround_m + 1e-9
    if limited:
        assert BOX.buffer(1e-5).covers(shapely.LineString(after.points_m))


@pytest.mark.parametrize("turnaround_m", [0.3, 0.49])
def test_tiny_runs_are_left_out(turnaround_m: float) -> None:
    assert with_turnarounds(two_lanes(), turnaround_m, None).points_m.tolist() == (
        two_lanes().points_m.tolist()
    )

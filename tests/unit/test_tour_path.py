"""Lanes joined by transits: kinds, numbers, and both ends at the berth."""

from __future__ import annotations

import numpy as np
import pytest
import shapely
from lakes import random_lake_m

from mrmission.model import LegKind
from mrmission.routing.harbour import Harbour
from mrmission.tour.path import assemble_paths, join_pieces, legs_of, make_path
from mrmission.tour.sweep import sweep_region


@pytest.mark.parametrize("seed", range(6))
def test_paths_hold_their_lanes_and_end_at_home(seed: int) -> None:
    rng = np.random.default_rng(seed)
    lake = random_lake_m(rng, 300.0, 3)
    sweep = sweep_region(lake, float(rng.uniform(0, 180)), 20.0)
    lanes = sweep.frame.to_local(sweep.lane_ends_m())
    flip = rng.random(len(lanes)) < 0.5
    lanes[flip] = lanes[flip, ::-1]
    centre = shapely.get_coordinates(lake.representative_point())[0]
    homes = centre + np.array([[0.0, 0], [4, 0], [0, 4]])
    harbour = Harbour(lake, homes)
    half = len(lanes) // 2
    shares = [lanes[:half], np.zeros((0, 2, 2)), lanes[half:]]
    paths = assemble_paths(harbour, shares)
    water = lake.buffer(1e-3)
    for robot, (path, share) in enumerate(zip(paths, shares, strict=True), 1):
        assert path.robot == robot
        home = homes[robot - 1]
        assert (path.points_m[0] == home).all()
        assert (path.points_m[-1] == home).all()
        if len(share) == 0:
            assert path.points_m.shape == (1, 2)
            assert len(path.kind) == len(path.lane) == 0
            continue
        legs = legs_of(path)
        assert len(legs) == len(path.kind) == len(path.lane)
        assert (legs[:, 0] != legs[:, 1]).any(axis=1).all()
        survey = path.kind == LegKind.SURVEY
        assert (path.lane[~survey] == 0).all()
        assert (path.lane[survey] > 0).all()
        # every lane is sailed from end to end, in order
        for number, lane in enumerate(share, 1):
            mine = legs[path.lane == number]
            assert mine[0, 0] == pytest.approx(lane[0])
            assert mine[-1, 1] == pytest.approx(lane[1])
            length = np.hypot(*(mine[:, 1] - mine[:, 0]).T).sum()
            assert length == pytest.approx(np.hypot(*(lane[1] - lane[0])))
        assert (np.diff(path.lane[survey]) >= 0).all()
        assert water.covers(shapely.LineString(path.points_m))
        assert not path.points_m.flags.writeable


def test_points_given_twice_are_dropped_with_their_legs() -> None:
    points = np.array([[0.0, 0], [0, 0], [1, 0], [1, 0], [2, 0]])
    path = make_path(3, points, [0, 1, 0, 1], [0, 1, 0, 2])
    assert path.points_m.tolist() == [[0, 0], [1, 0], [2, 0]]
    assert path.kind.tolist() == [1, 1]
    assert path.lane.tolist() == [1, 2]


def test_pieces_join_where_they_meet() -> None:
    a = np.array([[0.0, 0], [1, 0]])
    b = np.array([[1.0, 0], [1, 5], [2, 5]])
    path = join_pieces(1, [(a, LegKind.TRANSIT, 0), (b, LegKind.SURVEY, 1)])
    assert path.points_m.tolist() == [[0, 0], [1, 0], [1, 5], [2, 5]]
    assert path.kind.tolist() == [0, 1, 1]
    assert path.lane.tolist() == [0, 1, 1]


def test_polylines_are_swept_corner_by_corner_like_lanes() -> None:
    lake = shapely.box(0, 0, 200, 200)
    harbour = Harbour(lake, np.array([[5.0, 5.0]]))
    hook = np.array([[20.0, 20], [20, 100], [60, 120]])
    lane = np.array([[100.0, 20], [100, 180]])
    (path,) = assemble_paths(harbour, [[hook, lane]])
    legs = legs_of(path)
    assert legs[path.lane == 1].tolist() == np.stack([hook[:-1], hook[1:]], axis=1).tolist()
    assert legs[path.lane == 2].tolist() == [lane.tolist()]
    assert (path.points_m[[0, -1]] == [5.0, 5.0]).all()
    # straight lanes given as polylines make the same path as an array of lanes
    lanes = np.array([lane, lane + np.array([20.0, 0.0])])
    (a,) = assemble_paths(harbour, [lanes])
    (b,) = assemble_paths(harbour, [[lanes[0], lanes[1]]])
    assert a.points_m.tolist() == b.points_m.tolist()
    assert a.lane.tolist() == b.lane.tolist()

"""After the repair nothing large stays uncovered, and nothing that was swept is lost."""

from __future__ import annotations

import numpy as np
import pytest
import shapely
from lakes import random_lake_m

from mrmission.model import CoveragePath, LegKind
from mrmission.routing.harbour import Harbour
from mrmission.tour.coverage import Uncovered
from mrmission.tour.path import assemble_paths, legs_of, make_path
from mrmission.tour.repair import number_lanes, pieces_to_repair, repair
from mrmission.tour.sweep import Sweep, sweep_region
from mrmission.tour.timing import TimeModel

TIME = TimeModel(survey_speed_m_s=2.0, transit_speed_m_s=2.0)


def holey_sweep(
    seed: int, keep: float
) -> tuple[shapely.Polygon, Sweep, Harbour, tuple[CoveragePath, ...], float]:
    """Two robots that sweep only a share of the lanes of a lake."""
    rng = np.random.default_rng(seed)
    lake = random_lake_m(rng, float(rng.uniform(80, 250)), int(rng.integers(0, 4)))
    swath = float(rng.uniform(8, 25))
    sweep = sweep_region(lake, float(rng.uniform(0, 180)), 0.98 * swath)
    lanes = sweep.frame.to_local(sweep.lane_ends_m())
    lanes = lanes[rng.random(len(lanes)) < keep]
    if len(lanes) == 0:
        lanes = sweep.frame.to_local(sweep.lane_ends_m())[:1]
    homes = shapely.get_coordinates(lake.representative_point()) + np.array([[0.0, 0], [3, 0]])
    harbour = Harbour(lake, homes if lake.contains(shapely.Point(homes[1])) else homes[[0, 0]])
    half = len(lanes) // 2
    return lake, sweep, harbour, assemble_paths(harbour, [lanes[:half], lanes[half:]]), swath


def covered(paths, radius: float, *, survey_only: bool = False) -> shapely.Geometry:
    legs = np.concatenate(
        [legs_of(p)[p.kind == LegKind.SURVEY] if survey_only else legs_of(p) for p in paths]
    )
    lines = shapely.linestrings(legs)
    return shapely.union_all(shapely.buffer(lines, radius, quad_segs=16))


@pytest.mark.parametrize("seed", range(14))
def test_nothing_above_the_limits_stays(seed: int) -> None:
    keep = (1.0, 0.8, 0.5)[seed % 3]
    lake, sweep, harbour, paths, swath = holey_sweep(seed, keep)
    uncovered = Uncovered(sweep.region, sweep.column_pitch_m, swath / 2)
    done = paths
    for _ in range(4):  # a bent transit may uncover something: look again at the whole
        done = repair(done, uncovered, sweep.frame, harbour, TIME, swath)
        missed = lake.difference(covered(done, swath / 2))
        pieces = [p for p in shapely.get_parts(missed) if p.area > 0]
        if not pieces_to_repair(pieces, swath, lake.area):
            break
    assert max((p.area for p in pieces), default=0.0) <= 0.004 * swath**2 + 1e-6
    assert sum(p.area for p in pieces) <= 1e-4 * lake.area + 1e-6

    water = lake.buffer(1e-3)
    for before, after in zip(paths, done, strict=True):
        assert after.robot == before.robot
        assert (after.points_m[0] == before.points_m[0]).all()
        assert (after.points_m[-1] == before.points_m[-1]).all()
        assert len(after.kind) == len(after.points_m) - 1
        assert len(after.points_m) == 1 or water.covers(shapely.LineString(after.points_m))
        assert TIME.duration_s(after.points_m, after.kind) > 0 or len(after.points_m) == 1
    # what was surveyed is surveyed still, to the width of a hair
    was = [legs_of(p)[p.kind == LegKind.SURVEY] for p in paths]
    now = covered(done, 1e-4, survey_only=True)
    for legs in was:
        assert shapely.covers(now.buffer(1e-4), shapely.linestrings(legs)).all()


def test_a_complete_sweep_is_left_alone() -> None:
    lake, sweep, harbour, paths, swath = holey_sweep(3, 1.0)
    uncovered = Uncovered(sweep.region, sweep.column_pitch_m, swath / 2)
    done = repair(paths, uncovered, sweep.frame, harbour, TIME, swath)
    again = repair(done, uncovered, sweep.frame, harbour, TIME, swath)
    if not pieces_to_repair(
        list(shapely.get_parts(lake.difference(covered(done, swath / 2)))), swath, lake.area
    ):
        for a, b in zip(done, again, strict=True):
            assert np.array_equal(a.points_m, b.points_m)


def test_which_pieces_must_be_covered() -> None:
    squares = [shapely.box(0, 0, s, s) for s in (0.1, 2.0, 0.5, 0.2)]
    # 0.4 % of swath² = 0.4 m² at 10 m: the 4 m² one goes, and the rest fits 1e-4 of the region
    assert pieces_to_repair(squares, 10.0, 1e4) == [squares[1]]
    # in a small region the small ones count in all
    assert pieces_to_repair(squares, 10.0, 100.0) == [squares[1], squares[2], squares[3]]
    # twice as much is allowed at the last look
    assert pieces_to_repair([squares[2]], 6.0, 1e9, final=True) == []
    assert pieces_to_repair([squares[2]], 6.0, 1e9) == [squares[2]]
    assert pieces_to_repair([], 6.0, 1e9) == []


def test_lanes_are_numbered_by_straight_runs() -> None:
    points = np.array([[0.0, 0], [0, 5], [0, 9], [3, 9], [3, 2], [3, 5], [4, 5]])
    kind = [1, 1, 0, 1, 1, 1]
    path = number_lanes(make_path(1, points, kind, [0] * 6))
    # straight on is one lane, a reversal and a corner are new ones
    assert path.lane.tolist() == [1, 1, 0, 2, 3, 4]

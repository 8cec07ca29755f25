"""Reversals made gentle: where there is water, and never at the cost of a lane."""

from __future__ import annotations

import numpy as np
import pytest
import shapely

from mrmission.model import CoveragePath, LegKind
from mrmission.routing.berth_water import BerthWater
from mrmission.routing.harbour import Harbour
from mrmission.tour.path import make_path
from mrmission.tour.reversals import GENTLE_DEG, REVERSAL_DEG, avoid_reversals, reversals
from mrmission.tour.timing import TimeModel, turns_deg

T, S = int(LegKind.TRANSIT), int(LegKind.SURVEY)
TIME = TimeModel(survey_speed_m_s=2.0, transit_speed_m_s=2.0, swath_m=20.0)
HOME = [50.0, 5.0]


def water(region: shapely.Polygon) -> BerthWater:
    return BerthWater(Harbour(region, np.array([HOME])), 0)


def path_of(points: list[list[float]], kinds: list[int]) -> CoveragePath:
    return make_path(1, np.array(points, dtype=float), kinds, [0] * len(kinds))


def swept(path: CoveragePath) -> shapely.Geometry:
    """What the survey legs of a path go over."""
    legs = np.stack([path.points_m[:-1], path.points_m[1:]], axis=1)
    return shapely.union_all(shapely.linestrings(legs[path.kind == S]))


def there_and_back() -> CoveragePath:
    """A lane upwards, and back beside it to the next lane, far below."""
    points = [HOME, [60, 10], [60, 180], [75, 60], [75, 20], HOME]
    return path_of(points, [T, S, T, S, T])


def is_part(some: np.ndarray, path: CoveragePath) -> bool:
    """Whether a path goes by these points in this order."""
    rows = iter(path.points_m.tolist())
    return all(point in rows for point in some.tolist())


def test_a_reversal_in_open_water_becomes_two_gentle_corners() -> None:
    before = there_and_back()
    assert reversals(before) == [2]
    basin = water(shapely.box(0, 0, 150, 200))
    after = avoid_reversals(before, basin, TIME, 0.0)
    turn = turns_deg(np.diff(after.points_m, axis=0))
    assert turn.max() <= GENTLE_DEG < REVERSAL_DEG
    assert len(after.points_m) == len(before.points_m) + 1
    assert is_part(before.points_m, after)
    assert TIME.swing_m(after.points_m, after.kind) < 3.0
    assert TIME.swing_m(before.points_m, before.kind) > 4.0
    # the lanes are swept as they were
    lanes = [after.points_m[i : i + 2].tolist() for i in np.flatnonzero(after.kind == S)]
    assert lanes == [[[60, 10], [60, 180]], [[75, 60], [75, 20]]]


def test_every_leg_stays_in_the_water() -> None:
    # no water to the right of the first lane's end, but to the left
    region = shapely.box(0, 0, 150, 200) - shapely.box(61, 100, 150, 201)
    points = [HOME, [60, 10], [60, 180], [60, 120], [40, 60], [40, 20], HOME]
    after = avoid_reversals(path_of(points, [T, S, T, T, S, T]), water(region), TIME, 0.0)
    assert reversals(after) == []
    assert region.buffer(1e-5).covers(shapely.LineString(after.points_m))


def test_in_a_narrow_dead_end_a_reversal_stays() -> None:
    region = shapely.union(shapely.box(0, 0, 150, 60), shapely.box(58, 60, 62, 190))
    before = path_of([HOME, [60, 10], [60, 180], [60, 50], [100, 50], HOME], [T, S, T, T, T])
    after = avoid_reversals(before, water(region), TIME, 0.0)
    np.testing.assert_array_equal(after.points_m, before.points_m)


def test_an_extra_leg_is_swept_as_before_and_returned_from_another_way() -> None:
    # out to a piece beside the lane, and back to the very point
    points = [HOME, [60, 10], [60, 90], [68, 90], [60, 90], [60, 180], [80, 180], HOME]
    before = path_of(points, [T, S, S, S, S, T, T])
    after = avoid_reversals(before, water(shapely.box(0, 0, 150, 200)), TIME, 0.0)
    assert reversals(before) == [3]
    assert reversals(after) == []
    rows = after.points_m.tolist()
    at = rows.index([68.0, 90.0])
    assert rows[at - 1] == [60.0, 90.0]
    assert rows.count([60.0, 90.0]) == 2
    assert (after.kind[1:at] == S).all()


def test_a_swept_leg_goes_no_other_way() -> None:
    # two lanes that meet at a point: neither of them can be bent
    points = [HOME, [60, 10], [60, 180], [70, 20], HOME]
    before = path_of(points, [T, S, S, T])
    after = avoid_reversals(before, water(shapely.box(0, 0, 150, 200)), TIME, 0.0)
    np.testing.assert_array_equal(after.points_m, before.points_m)


def test_where_there_is_clearance_a_reversal_goes_only_when_that_costs_no_time() -> None:
    before = there_and_back()
    basin = water(shapely.box(0, 0, 150, 200))
    near, far = (avoid_reversals(before, basin, TIME, clearance) for clearance in (0.0, 50.0))
    assert len(near.points_m) > len(before.points_m)
    if len(far.points_m) > len(before.points_m):
        assert TIME.duration_s(far.points_m, far.kind) <= TIME.duration_s(
            before.points_m, before.kind
        )


@pytest.mark.parametrize("seed", range(6))
def test_any_path_keeps_its_points_and_gains_no_reversal(seed: int) -> None:
    rng = np.random.default_rng(seed)
    island = shapely.Point(80, 100).buffer(25)
    region = shapely.box(0, 0, 150, 200) - island
    basin = water(region)
    stops = rng.uniform([2, 2], [148, 198], (30, 2))
    stops = stops[~shapely.contains_xy(island.buffer(1), stops[:, 0], stops[:, 1])]
    ways = basin.harbour.paths(stops[:-1], stops[1:])
    points = np.concatenate([[HOME], [stops[0]], *(w[1:] for w in ways), [HOME]])
    points = points[1:-1]  # from the first stop to the last one
    kinds = rng.integers(0, 2, len(points) - 1).tolist()
    before = make_path(1, points, kinds, [0] * len(kinds))
    after = avoid_reversals(before, basin, TIME, 0.0)
    assert is_part(before.points_m, after)
    assert len(reversals(after)) <= len(reversals(before))
    assert region.buffer(1e-4).covers(shapely.LineString(after.points_m))
    assert swept(after).buffer(1e-5).covers(swept(before))

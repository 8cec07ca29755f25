"""Berths: apart, in the region, with room to launch, near the start."""

from __future__ import annotations

import numpy as np
import pytest
import shapely

from mrmission.area.berths import Berths, berths
from mrmission.area.region import default_start, navigable_region
from mrmission.errors import InfeasibleError

LAKE = shapely.box(0, 0, 1000, 600).difference(shapely.box(480, 40, 520, 80))


def check(found: Berths, water: shapely.Geometry, region: shapely.Geometry, count: int) -> None:
    points = found.points_m
    assert points.shape == (count, 2)
    assert shapely.distance(region, shapely.points(points)).max() < 1e-6
    if count > 1:
        apart = np.hypot(*(points[:, None] - points[None]).transpose(2, 0, 1))
        assert apart[np.triu_indices(count, 1)].min() >= found.spacing_m * (1 - 1e-6)
    room = shapely.distance(water.boundary, shapely.points(points))
    assert (found.launch_in_water == (room >= 15 - 0.011)).all()
    # those with room come first, each kind by distance
    assert (np.diff(found.launch_in_water.astype(int)) <= 0).all()


@pytest.mark.parametrize("clearance", [0.0, 10.0, 30.0])
@pytest.mark.parametrize("count", [1, 6, 32])
def test_open_shore(clearance: float, count: int) -> None:
    region = navigable_region(shapely.MultiPolygon([LAKE]), clearance).geoms[0]
    start = default_start(region)
    found = berths(LAKE, region, start, count)
    check(found, LAKE, region, count)
    assert found.spacing_m == 15
    assert found.launch_in_water.all()
    assert found.notes == ()
    distance = np.hypot(*(found.points_m - start).T)
    assert (np.diff(distance) >= -1e-6).all()
    assert distance[0] == pytest.approx(max(15 - clearance, 0), abs=0.2)
    # a half disc full of them: no farther than a lattice of that density needs, with slack
    assert distance.max() <= 15 + 15 * (1.5 + np.sqrt(count))


@pytest.mark.parametrize("turn_deg", [0, 33, 90])
@pytest.mark.parametrize("width", [4.0, 5.0, 0.3])
@pytest.mark.parametrize("count", [6, 32])
def test_narrow_corridor(turn_deg: float, width: float, count: int) -> None:
    water = shapely.affinity.rotate(shapely.box(0, 0, 900, width), turn_deg, origin=(0, 0))
    start = default_start(water)
    found = berths(water, water, start, count)
    check(found, water, water, count)
    assert found.spacing_m == 15
    assert not found.launch_in_water.any()
    assert "reaches onto land" in found.notes[-1]


@pytest.mark.parametrize("count", [6, 32])
def test_small_pond_takes_a_smaller_spacing_and_says_so(count: int) -> None:
    water = shapely.Point(0, 0).buffer(12)
    found = berths(water, water, np.array([0.0, -11.0]), count)
    check(found, water, water, count)
    assert found.spacing_m < 15
    assert found.notes[0].startswith(f"berths are {found.spacing_m:.3g} m apart, not 15 m")


def test_not_across_a_spit() -> None:
    # two basins joined far away: the nearer points across the spit are a long way by water
    spit = shapely.box(0, -1, 900, 1)
    water = shapely.box(0, -200, 1000, 200).difference(spit)
    found = berths(water, water, np.array([100.0, 20.0]), 6)
    check(found, water, water, 6)
    assert (found.points_m[:, 1] > 0).all()


def test_other_part_of_the_region_is_not_used() -> None:
    water = shapely.union_all([shapely.box(0, 0, 60, 60), shapely.box(60, 28, 70, 32),
                               shapely.box(70, 0, 400, 60)])  # fmt: skip
    region = navigable_region(shapely.MultiPolygon([water]), 5.0)
    small = region.geoms[1]
    found = berths(water, small, np.array([54.0, 30.0]), 8)
    check(found, water, small, 8)


def test_same_input_same_bytes() -> None:
    a = berths(LAKE, LAKE, np.array([300.0, 0.0]), 20)
    b = berths(LAKE, LAKE, np.array([300.0, 0.0]), 20)
    assert a.points_m.tobytes() == b.points_m.tobytes()
    assert not a.points_m.flags.writeable


def test_start_outside_means_the_nearest_point() -> None:
    found = berths(LAKE, LAKE, np.array([300.0, -40.0]), 1)
    assert found.points_m[0] == pytest.approx([300, 15], abs=0.2)


def test_no_room() -> None:
    water = shapely.box(0, 0, 0.01, 0.01)
    with pytest.raises(InfeasibleError, match="no room for 200 berths"):
        berths(water, water, np.array([0.0, 0.0]), 200)

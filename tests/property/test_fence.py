"""Try to break the fence: whatever the lake, the path stays inside, by the margin, in budget."""

from __future__ import annotations

import math
import re
from dataclasses import dataclass

import numpy as np
import pytest
import shapely
from hypothesis import example, given, settings
from hypothesis import strategies as st

from mrmission.errors import InfeasibleError
from mrmission.mission import fence_rings
from mrmission.mission.check import check_fence
from mrmission.mission.fence import fit_fence
from mrmission.mission.fence_rings import TOUCH_M, fit_rings
from mrmission.mission.ring_kernel import replay, shorten_ring
from mrmission.options import VehicleLimits

MARGIN_M = 2.0


@dataclass(frozen=True)
class FlatFrame:
    """Metres at 60° north; the fence's own plane differs from it by a shear of the meridians."""

    lon: float = 25.0
    lat: float = 60.0

    def to_lonlat(self, points_m: np.ndarray) -> np.ndarray:
        lat = self.lat + points_m[:, 1] / 111_412
        return np.column_stack(
            [self.lon + points_m[:, 0] / (111_320 * np.cos(np.radians(lat))), lat]
        )


def star(
    rng: np.random.Generator, centre: tuple[float, float], size: float, n: int
) -> shapely.Polygon:
    """A ragged star-shaped polygon."""
    angle = (np.arange(n) + rng.uniform(0, 0.9, n)) * 2 * math.pi / n
    radius = size * rng.uniform(0.5, 1.0, n)
    ring = np.column_stack([radius * np.cos(angle), radius * np.sin(angle)]) + centre
    return shapely.Polygon(ring)


def lake(seed: int, vertices: int, islands: int) -> shapely.Polygon:
    rng = np.random.default_rng(seed)
    water = star(rng, (0, 0), 500, vertices)
    for _ in range(islands):
        at = rng.uniform(-300, 300, 2)
        water = shapely.difference(water, star(rng, tuple(at), rng.uniform(5, 60), 9))
    parts = [p for p in shapely.get_parts(shapely.make_valid(water)) if p.geom_type == "Polygon"]
    return max(parts, key=lambda p: p.area)


def tour(water: shapely.Polygon, clearance: float, seed: int, legs: int) -> shapely.LineString:
    """A walk along the shores and across the open water of the eroded lake."""
    rng = np.random.default_rng(seed)
    region = max(shapely.get_parts(water.buffer(-clearance)), key=lambda p: p.area)
    shapely.prepare(region)
    ring = np.vstack([shapely.get_coordinates(r) for r in (region.exterior, *region.interiors)])
    if clearance == 0:
        ring = shapely.get_coordinates(region.exterior)
    here = ring[0]
    points = [here]
    for _ in range(60 * legs):
        there = ring[rng.integers(len(ring))]
        if shapely.covers(region, shapely.LineString([here, there])) and np.any(here != there):
            points.append(there)
            here = there
        if len(points) > legs:
            break
    if len(points) == 1:
        points.append(np.array(shapely.get_coordinates(shapely.point_on_surface(region))[0]))
        line = shapely.intersection(shapely.LineString(points), region)
        line = max(shapely.get_parts(line), key=lambda g: g.length)
        return line if line.length > 0 else shapely.LineString([points[1], points[1] + 0.1])
    return shapely.LineString(points)


def judge(fit, water, path, keep, limits, margin) -> None:
    """What is promised, measured with shapely alone."""
    inclusion = shapely.Polygon(fit.inclusion)
    exclusions = [shapely.Polygon(e) for e in fit.exclusions]
    assert inclusion.is_valid
    assert all(e.is_valid for e in exclusions)
    assert fit.bytes_used == sum(
        limits.fence_bytes_of(len(r)) for r in (fit.inclusion, *fit.exclusions)
    )
    assert fit.bytes_used <= limits.fence_bytes
    assert max(map(len, (fit.inclusion, *fit.exclusions))) <= limits.fence_polygon_points
    assert inclusion.contains(path)
    assert inclusion.buffer(1e-6).contains(keep)
    assert not any(e.intersects(path) for e in exclusions)
    assert not any(e.buffer(-0.1).intersects(keep) for e in exclusions)
    # by the margin where the shore leaves room, else by the shore's distance, else by 0.3 m
    allowed = inclusion.difference(shapely.union_all(exclusions)) if exclusions else inclusion
    for fraction in np.linspace(0, 1, 40):
        point = path.interpolate(fraction, normalized=True)
        room = water.boundary.distance(point) if water.contains(point) else 0.0
        wanted = min(margin, max(room, 0.8 * min(TOUCH_M, margin)))
        assert allowed.boundary.distance(point) >= wanted - 0.02
    # the land reported is the land there is
    land = allowed.difference(water).area
    assert fit.land_m2 == pytest.approx(land, abs=1e-6 + 1e-6 * land)
    assert sum(a for a, _, _ in fit.land_places_m) <= land + 1e-6
    for area, x, y in fit.land_places_m:
        assert area >= 1
        assert water.boundary.distance(shapely.Point(x, y)) < 1e-6 or not water.contains(
            shapely.Point(x, y)
        )


@settings(max_examples=40, deadline=None)
@given(
    seed=st.integers(0, 10_000),
    vertices=st.integers(5, 120),
    islands=st.integers(0, 12),
    clearance=st.sampled_from([0.0, 0.1, 1.0, 6.0, 15.0]),
    points=st.integers(4, 90),
    legs=st.integers(1, 40),
)
@example(seed=20, vertices=102, islands=6, clearance=1.0, points=5, legs=2)
def test_the_path_stays_inside(
    seed: int, vertices: int, islands: int, clearance: float, points: int, legs: int
) -> None:
    water = lake(seed, vertices, islands)
    if water.buffer(-clearance).is_empty:
        return
    path = tour(water, clearance, seed, legs)
    home = shapely.Point(path.coords[0])
    keep = shapely.intersection(water, home.buffer(15))
    limits = VehicleLimits(fence_bytes=8 * points + 2, fence_polygon_points=min(points, 83))
    try:
        fit = fit_rings(water, [path, keep], MARGIN_M, limits)
    except InfeasibleError:
        # a budget of a handful of points may not hold a launch circle and a ragged path
        assert points < 8
        return
    judge(fit, water, path, keep, limits, MARGIN_M)


@settings(max_examples=25, deadline=None)
@given(
    seed=st.integers(0, 10_000), points=st.integers(10, 60), clearance=st.sampled_from([0.0, 5.0])
)
def test_the_rounded_fence_holds_the_rounded_path(seed: int, points: int, clearance: float) -> None:
    water = lake(seed, 80, 5)
    path = tour(water, clearance, seed, 20)
    frame = FlatFrame()
    limits = VehicleLimits(fence_bytes=8 * points + 2, fence_polygon_points=points)
    keep = shapely.intersection(water, shapely.Point(path.coords[0]).buffer(15))
    coordinates = shapely.get_coordinates(path)
    fit = fit_fence(water, [coordinates], MARGIN_M, limits, keep=[keep], frame=frame)
    e7 = np.round(frame.to_lonlat(coordinates) * 1e7).astype(np.int64)[:, ::-1]
    assert check_fence(fit.polygons, e7) == ()
    assert [p.inclusion for p in fit.polygons] == [True] + [False] * (len(fit.polygons) - 1)
    assert sum(8 * len(p.points_e7) + 2 for p in fit.polygons) <= limits.fence_bytes
    assert bool(fit.notes) == (fit.land_m2 >= 1 and bool(fit.land_places))


def test_a_fence_that_fits_whole_takes_in_no_land() -> None:
    for seed in range(5):
        water = lake(seed, 40, 2)
        path = tour(water, 6.0, seed, 30)
        fit = fit_rings(water, [path], MARGIN_M, VehicleLimits())
        assert fit.land_m2 < 0.5
        assert fit.islands_left_out_m == ()


def test_islands_that_lanes_pass_nearest_come_first() -> None:
    islands = [shapely.box(x, 40 + x / 20, x + 20, 50 + x / 20) for x in range(20, 580, 40)]
    water = shapely.difference(shapely.box(0, 0, 600, 110), shapely.union_all(islands))
    path = shapely.LineString([(5, 30), (595, 30), (595, 105), (5, 105)])
    distance = [path.distance(i) for i in islands]
    for points in (10, 14, 20, 30):
        limits = VehicleLimits(fence_bytes=8 * points + 2 * (points // 4), fence_polygon_points=83)
        fit = fit_rings(water, [path], MARGIN_M, limits)
        left = [shapely.Point(x, y) for _, x, y in fit.islands_left_out_m]
        far = [d for d, i in zip(distance, islands, strict=True) if any(map(i.contains, left))]
        near = [d for d, i in zip(distance, islands, strict=True) if not any(map(i.contains, left))]
        assert far
        assert near
        # a farther island is only kept out by an exclusion that a nearer one has anyway
        for away, island in zip(distance, islands, strict=True):
            if away in near and away > min(far):
                (own,) = [e for e in map(shapely.Polygon, fit.exclusions) if e.intersects(island)]
                assert any(
                    d < min(far) and own.intersects(i)
                    for d, i in zip(distance, islands, strict=True)
                )
        assert fit.land_m2 > 100 * len(far)


def test_a_budget_below_a_triangle_is_refused() -> None:
    water = shapely.box(0, 0, 100, 100)
    path = shapely.LineString([(10, 10), (90, 90)])
    for limits in (VehicleLimits(fence_bytes=20), VehicleLimits(fence_polygon_points=2)):
        with pytest.raises(InfeasibleError, match="--no-fence"):
            fit_rings(water, [path], MARGIN_M, limits)
    with pytest.raises(InfeasibleError, match="found none"):
        fit_rings(water, [], MARGIN_M, VehicleLimits())


def test_replay_takes_away_one_vertex_a_move_and_its_cost_is_true() -> None:
    water = lake(3, 60, 0)
    ring = shapely.get_coordinates(shapely.geometry.polygon.orient(water).exterior)[:-1]
    path = np.array([[0.0, 0.0, 1.0, 1.0]])
    one = np.ones(1)
    moves, values = shorten_ring(np.ascontiguousarray(ring), path, one, one, 1e-3)
    assert len(moves) >= len(ring) - 5
    for count in range(len(moves)):
        before = shapely.Polygon(replay(ring, moves, values, count))
        after = shapely.Polygon(replay(ring, moves, values, count + 1))
        assert len(after.exterior.coords) == len(before.exterior.coords) - 1
        assert after.is_valid
        # each move adds or cuts one triangle; its price is its area
        change = after.area - before.area
        price = values[count, 3] if change > 0 else values[count, 2] / 1e-3
        assert abs(change) == pytest.approx(price, rel=1e-6, abs=1e-6)
        assert after.symmetric_difference(before).area == pytest.approx(abs(change), abs=1e-5)


def test_same_input_same_fence() -> None:
    water = lake(11, 100, 8)
    path = tour(water, 1.0, 11, 30)
    limits = VehicleLimits(fence_bytes=300)
    first, second = (fit_rings(water, [path], MARGIN_M, limits) for _ in range(2))
    assert first.inclusion.tobytes() == second.inclusion.tobytes()
    assert [e.tobytes() for e in first.exclusions] == [e.tobytes() for e in second.exclusions]


def test_the_search_gives_land_back_and_breaks_nothing(monkeypatch: pytest.MonkeyPatch) -> None:
    limits = VehicleLimits(fence_bytes=8 * 40 + 2 * 4)
    for seed, clearance in ((1, 0.0), (2, 6.0), (4, 0.0), (5, 15.0)):
        water = lake(seed, 150, 6)
        path = tour(water, clearance, seed, 40)
        keep = shapely.intersection(water, shapely.Point(path.coords[0]).buffer(15))
        after = fit_rings(water, [path, keep], MARGIN_M, limits)
        judge(after, water, path, keep, limits, MARGIN_M)
        with monkeypatch.context() as patched:
            patched.setattr(fence_rings, "_improved", lambda best, *_: best)
            before = fit_rings(water, [path, keep], MARGIN_M, limits)
        assert before.land_m2 > 100
        assert after.land_m2 < 0.95 * before.land_m2


def test_the_search_finds_the_least_enclosing_polygon() -> None:
    # the least k-gon around a circle is the regular one that touches it at its edges' middles
    angle = np.arange(400) * 2 * math.pi / 400
    ring = 100 * np.column_stack([np.cos(angle), np.sin(angle)])
    path = shapely.LineString([(-90, 0), *(0.95 * np.vstack([ring, ring[:1]]))])
    for corners in (5, 6, 9):
        limits = VehicleLimits(fence_bytes=8 * corners + 2)
        fit = fit_rings(shapely.Polygon(ring), [path], 4.9, limits)
        radius = 95 + 4.9
        least = corners * radius**2 * math.tan(math.pi / corners)
        assert shapely.Polygon(fit.inclusion).area < 1.02 * least


def test_notes_say_lon_lat() -> None:
    water = lake(1, 120, 4)
    path = tour(water, 0.0, 1, 30)
    limits = VehicleLimits(fence_bytes=8 * 14 + 2)
    fit = fit_fence(
        water, [shapely.get_coordinates(path)], MARGIN_M, limits, frame=FlatFrame(lon=25, lat=60)
    )
    places = re.findall(r"(-?\d+\.\d{5}),(-?\d+\.\d{5})", " ".join(fit.notes))
    assert places
    assert all(24 < float(lon) < 26 and 59 < float(lat) < 61 for lon, lat in places)

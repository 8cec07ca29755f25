"""In-water paths against a brute-force visibility graph of all vertices, judged by GEOS."""

from __future__ import annotations

import math

import networkx as nx
import numpy as np
import pytest
import shapely
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from mrmission.routing.water import WaterRouter

TOLERANCE_M = 1e-3
quick = settings(
    max_examples=60, deadline=None, derandomize=True, suppress_health_check=list(HealthCheck)
)


def brute_force(region: shapely.Polygon, points: np.ndarray, *, grow_m: float) -> np.ndarray:
    """Return the (n, n) lengths over all vertices and points, visibility by `covers`."""
    judge = region.buffer(grow_m, join_style="mitre") if grow_m else region
    nodes = np.vstack([points, shapely.get_coordinates(region)])
    i, j = np.triu_indices(len(nodes), 1)
    legs = shapely.linestrings(np.stack([nodes[i], nodes[j]], axis=1))
    shapely.prepare(judge)
    clear = shapely.covers(judge, legs)
    clear |= np.hypot(*(nodes[i] - nodes[j]).T) == 0
    graph = nx.Graph()
    graph.add_nodes_from(range(len(nodes)))
    for a, b in zip(i[clear], j[clear], strict=True):
        graph.add_edge(int(a), int(b), weight=math.dist(nodes[a], nodes[b]))
    out = np.full((len(points), len(points)), np.inf)
    for a in range(len(points)):
        far = nx.single_source_dijkstra_path_length(graph, a, weight="weight")
        for b in range(len(points)):
            out[a, b] = far.get(b, np.inf)
    return out


def check(region: shapely.Polygon, points: np.ndarray, *, grow_m: float) -> None:
    router = WaterRouter(region)
    want = brute_force(region, points, grow_m=grow_m)
    n = len(points)
    matrix = router.distance_matrix(points)
    np.testing.assert_allclose(matrix, want, atol=TOLERANCE_M, rtol=0)
    assert (matrix == matrix.T).all()
    half = n // 2
    across = router.distances(points[:half], points)
    np.testing.assert_allclose(across, matrix[:half], rtol=1e-12, atol=1e-9)
    i, j = (side.ravel() for side in np.indices((n, n)))
    pairs = router.pair_distances(points[i], points[j]).reshape(n, n)
    np.testing.assert_allclose(pairs, matrix, rtol=1e-12, atol=1e-9)
    # d(a, c) <= d(a, b) + d(b, c)
    detour = (matrix[:, :, None] + matrix[None, :, :]).min(axis=1)
    assert (matrix <= detour * (1 + 1e-9)).all()
    # The paths are as long as told, and lie in the water.
    allowed = region.buffer(1e-6)
    shapely.prepare(allowed)
    lines = router.paths(points[i], points[j])
    length = np.array([np.hypot(*np.diff(line, axis=0).T).sum() for line in lines])
    np.testing.assert_allclose(length.reshape(n, n), matrix, rtol=1e-9, atol=1e-6)
    assert shapely.covers(allowed, [shapely.LineString(line) for line in lines]).all()
    # What is visible is as far as the crow flies, and the rest has a bend.
    straight = np.hypot(*(points[i] - points[j]).T)
    seen = router.visible(points[i], points[j])
    np.testing.assert_allclose(pairs.ravel()[seen], straight[seen], rtol=1e-12, atol=1e-9)
    np.testing.assert_array_equal(seen, [len(line) == 2 for line in lines])


def largest(region: shapely.Geometry) -> shapely.Polygon:
    return max(shapely.get_parts(region), key=lambda part: part.area)


def sample(region: shapely.Polygon, rng: np.random.Generator, count: int) -> np.ndarray:
    """Return points inside, on the boundary, on vertices and near them."""
    x0, y0, x1, y1 = region.bounds
    inside = rng.uniform((x0, y0), (x1, y1), (40 * count, 2))
    inside = inside[shapely.contains_xy(region, inside)][:count]
    where = rng.uniform(0, region.boundary.length, count)
    shore = shapely.get_coordinates(shapely.line_interpolate_point(region.boundary, where))
    vertices = shapely.get_coordinates(region)
    vertices = vertices[rng.integers(0, len(vertices), count)]
    return np.vstack([inside, shore, vertices])


def random_lake(rng: np.random.Generator) -> shapely.Polygon:
    """Return a rough star with rough islands, some of which cut the shore or touch another."""

    def blob(x: float, y: float, size: float, count: int) -> shapely.Polygon:
        angle = np.sort(rng.uniform(0, 2 * np.pi, count))
        radius = size * rng.uniform(0.4, 1, count)
        return shapely.Polygon(
            np.stack([x + radius * np.cos(angle), y + radius * np.sin(angle)], axis=1)
        ).buffer(0)

    lake = blob(0, 0, 100, int(rng.integers(6, 16)))
    for _ in range(int(rng.integers(0, 5))):
        x, y = rng.uniform(-60, 60, 2)
        lake = lake.difference(blob(x, y, rng.uniform(5, 35), int(rng.integers(3, 9))))
    return largest(lake)


@quick
@given(seed=st.integers(0, 10**6))
def test_lakes_with_islands(seed: int) -> None:
    rng = np.random.default_rng(seed)
    region = random_lake(rng)
    check(region, sample(region, rng, 5), grow_m=1e-7)


@quick
@given(seed=st.integers(0, 10**6), columns=st.integers(3, 9), rows=st.integers(3, 9))
def test_unit_squares_judged_exactly(seed: int, columns: int, rows: int) -> None:
    """Integer coordinates: GEOS judges exactly, and nearly every corner is on a common line."""
    rng = np.random.default_rng(seed)
    free = rng.uniform(size=(columns, rows)) < rng.uniform(0.55, 0.95)
    free[0, 0] = True
    squares = [shapely.box(c, r, c + 1, r + 1) for c, r in np.argwhere(free)]
    region = largest(shapely.union_all(squares))
    # Every lattice point of the boundary is a vertex, collinear ones too.
    region = shapely.segmentize(region, 1.0)
    lattice = np.argwhere(np.ones((columns + 1, rows + 1), dtype=bool)).astype(float)
    lattice = lattice[shapely.intersects_xy(region, lattice)]
    points = lattice[rng.permutation(len(lattice))[:12]]
    check(region, points, grow_m=0)


@quick
@given(seed=st.integers(0, 10**6), angle=st.floats(0, 90), east=st.sampled_from([0.0, 3e5]))
def test_turned_staircases(seed: int, angle: float, east: float) -> None:
    """The same, turned and shifted, so that lines are straight only up to rounding."""
    rng = np.random.default_rng(seed)
    free = rng.uniform(size=(6, 6)) < 0.75
    free[2, 2] = True
    squares = [shapely.box(c, r, c + 1, r + 1) for c, r in np.argwhere(free)]
    region = shapely.segmentize(largest(shapely.union_all(squares)), 1.0)
    region = shapely.affinity.translate(
        shapely.affinity.scale(shapely.affinity.rotate(region, angle, (0, 0)), 9.7, 9.7, 1, (0, 0)),
        east,
    )
    check(region, sample(region, rng, 4), grow_m=1e-6)


@quick
@given(seed=st.integers(0, 10**6))
def test_islands_that_touch(seed: int) -> None:
    """Diamonds on a lattice touch corner to corner, and the shore at points."""
    rng = np.random.default_rng(seed)
    land = [
        shapely.Polygon([(x - 1, y), (x, y - 1), (x + 1, y), (x, y + 1)])
        for x in range(1, 9, 2)
        for y in range(1, 7, 2)
        if rng.uniform() < 0.5
    ]
    region = largest(shapely.box(0, 0, 8, 6).difference(shapely.union_all(land)))
    lattice = np.argwhere(np.ones((9, 7), dtype=bool)).astype(float)
    lattice = lattice[shapely.intersects_xy(region, lattice)]
    points = np.vstack([lattice[rng.permutation(len(lattice))[:8]], sample(region, rng, 2)])
    check(region, points, grow_m=1e-7)


@quick
@given(seed=st.integers(0, 10**6))
def test_points_just_outside_see_along_the_shore(seed: int) -> None:
    """A point rounded to land by a centimetre is as good as the nearest point of the shore."""
    rng = np.random.default_rng(seed)
    region = random_lake(rng)
    where = rng.uniform(0, region.boundary.length, 12)
    shore = shapely.get_coordinates(shapely.line_interpolate_point(region.boundary, where))
    rounded = shore + rng.uniform(-0.007, 0.007, shore.shape)
    router = WaterRouter(region)
    np.testing.assert_allclose(
        router.distance_matrix(rounded), router.distance_matrix(shore), atol=0.03
    )


def test_oracle_can_fail() -> None:
    """The oracle tells a router without the rings' own edges from one with them."""
    region = shapely.Polygon([(0, 0), (10, 0), (10, 10), (6, 10), (6, 2), (4, 2), (4, 10), (0, 10)])
    points = np.array([[1.0, 9.0], [9.0, 9.0]])
    want = brute_force(region, points, grow_m=0)[0, 1]
    assert want == pytest.approx(2 * math.hypot(3, 7) + 2)
    assert WaterRouter(region).distances(points[:1], points[1:])[0, 0] == pytest.approx(want)

"""In-water paths: CPU time on synthetic lakes, beside one numpy pass over the same data.

Nothing here asserts an absolute time: the figures are printed (``pytest -s``), and only ratios with
a generous bound can fail.
"""

# ruff: noqa: T201
from __future__ import annotations

import time
from collections.abc import Callable

import numpy as np
import pytest
import shapely

from mrmission.routing.water import WaterRouter


def cpu_s(work: Callable[[], object], repeats: int = 3) -> float:
    """Return the least CPU time of a few runs."""
    best = np.inf
    for _ in range(repeats):
        start = time.process_time()
        work()
        best = min(best, time.process_time() - start)
    return float(best)


def synthetic_lake(vertices: int, islands: int) -> shapely.Polygon:
    """Return a lake of 2 km radius with rough islands, the vertices shared out in halves."""
    rng = np.random.default_rng(0)
    per_island = vertices // 2 // islands
    angle = 2 * np.pi * np.arange(per_island) / per_island

    def blob(x: float, y: float, radius: float, turn: np.ndarray, rough: float) -> shapely.Polygon:
        shape = np.ones(len(turn))
        for k in range(2, 12):
            shape += rough / k * rng.normal() * np.cos(k * turn + rng.uniform(0, 2 * np.pi))
        shape = np.maximum(shape + 0.1 * rough * rng.uniform(-1, 1, len(turn)), 0.2)
        ring = np.stack([x + radius * shape * np.cos(turn), y + radius * shape * np.sin(turn)], 1)
        return shapely.Polygon(ring)

    count = vertices - islands * per_island
    shell = blob(0, 0, 2000, 2 * np.pi * np.arange(count) / count, 0.3)
    holes: list[shapely.Polygon] = []
    while len(holes) < islands:
        x, y = rng.uniform(-2000, 2000, 2)
        island = blob(x, y, rng.uniform(40, 120), angle, 0.5)
        if (
            island.is_valid
            and shell.contains(island.buffer(5))
            and all(island.distance(other) > 5 for other in holes)
        ):
            holes.append(island)
    return shapely.Polygon(shell.exterior, [hole.exterior for hole in holes])


@pytest.fixture(scope="module")
def lake() -> shapely.Polygon:
    return synthetic_lake(5000, 100)


@pytest.fixture(scope="module")
def spots(lake: shapely.Polygon) -> np.ndarray:
    drawn = np.random.default_rng(1).uniform(-2000, 2000, (10_000, 2))
    return drawn[shapely.contains_xy(lake, drawn)][:1000]


@pytest.fixture(scope="module")
def router(lake: shapely.Polygon, spots: np.ndarray) -> WaterRouter:
    made = WaterRouter(lake)
    made.distances(spots[:2], spots[:2])  # compiled, or loaded from the cache, before the clock
    made.paths(spots[:2], spots[2:4])
    made.visible(spots[:2], spots[2:4])
    return made


def test_prepare(lake: shapely.Polygon, router: WaterRouter) -> None:
    """Beside one numpy pass over all pairs of vertices."""
    x, y = shapely.get_coordinates(lake).T
    one_pass = cpu_s(lambda: np.subtract.outer(x, x) * np.subtract.outer(y, y) > 0)
    took = cpu_s(lambda: WaterRouter(lake))
    print(
        f"\nprepare {len(x)} vertices, {len(lake.interiors)} islands: {took:.3f} s CPU, "
        f"{router.corner_count} corners, {router.edge_count} legs, {took / one_pass:.1f} passes"
    )
    assert took < 40 * one_pass + 0.1


def test_one_source_to_a_hundred_targets(router: WaterRouter, spots: np.ndarray) -> None:
    """Beside one numpy pass over the pairs of targets and corners."""
    targets = spots[100:200]
    corners = np.random.default_rng(2).uniform(-2000, 2000, (router.corner_count, 2))
    one_pass = cpu_s(lambda: np.hypot(*(targets[:, None] - corners[None]).transpose(2, 0, 1)))
    alone = cpu_s(lambda: [router.distances(spots[i : i + 1], targets) for i in range(20)]) / 20
    batch = cpu_s(lambda: router.distances(spots[:100], targets)) / 100
    print(
        f"\none source to 100 targets: {1e3 * alone:.2f} ms CPU alone, {1e3 * batch:.2f} ms in a "
        f"batch of 100, {alone / one_pass:.1f} and {batch / one_pass:.1f} passes"
    )
    assert batch < 30 * one_pass


def test_ten_thousand_near_pairs(
    lake: shapely.Polygon, router: WaterRouter, spots: np.ndarray
) -> None:
    """Consecutive lane ends: beside one numpy pass over the pairs."""
    rng = np.random.default_rng(3)
    a = np.repeat(spots, 11, axis=0)
    b = a + rng.normal(scale=10, size=a.shape)
    keep = shapely.contains_xy(lake, b)
    a, b = a[keep][:10_000], b[keep][:10_000]
    one_pass = cpu_s(lambda: np.hypot(*(a - b).T))
    took = cpu_s(lambda: router.pair_distances(a, b))
    hidden = int((~router.visible(a, b)).sum())
    print(
        f"\n{len(a)} near pairs, {hidden} out of sight: {1e3 * took:.1f} ms CPU, "
        f"{took / one_pass:.0f} passes"
    )
    assert took < 5000 * one_pass


def test_distance_matrix(router: WaterRouter, spots: np.ndarray) -> None:
    """Beside one numpy pass over the matrix."""
    one_pass = cpu_s(lambda: np.hypot(*(spots[:, None] - spots[None]).transpose(2, 0, 1)))
    took = cpu_s(lambda: router.distance_matrix(spots), repeats=1)
    print(
        f"\nmatrix of {len(spots)} points: {took:.2f} s CPU, {took / one_pass:.0f} passes, "
        f"{1e6 * took / len(spots) ** 2 * 2:.2f} µs a pair"
    )
    assert took < 500 * one_pass


def test_large_hall_of_pixels() -> None:
    """A disc of pixels: thousands of land corners that nearly all see each other."""
    radius = 400
    row = np.arange(-radius, radius)
    half = np.floor(np.sqrt(radius**2 - (row + 0.5) ** 2))
    hall = shapely.union_all(shapely.box(-half, row, half, row + 1))
    router = WaterRouter(hall)
    took = cpu_s(lambda: WaterRouter(hall), repeats=1)
    n = router.corner_count
    grid = np.random.default_rng(4).uniform(size=(n, n))
    one_pass = cpu_s(lambda: grid * grid.T > 0.5)
    print(
        f"\nprepare a hall of {n} corners, {router.edge_count} legs: {took:.3f} s CPU, "
        f"{took / one_pass:.0f} passes over the pairs of corners"
    )
    assert took < 500 * one_pass + 0.1


def test_ends_within_reach(lake: shapely.Polygon, router: WaterRouter) -> None:
    """Near ones of thousands of points: beside the matrix of a few hundred."""
    drawn = np.random.default_rng(5).uniform(-2000, 2000, (20_000, 2))
    points = drawn[shapely.contains_xy(lake, drawn)][:6000]
    reach = np.full(len(points), 150.0)
    router.lengths_within(points[:4], reach[:4], 2)
    whole = cpu_s(lambda: router.distance_matrix(points[:600]), repeats=1)
    took = cpu_s(lambda: router.lengths_within(points, reach, 17), repeats=1)
    (start, _, _), _ = router.lengths_within(points, reach, 17)
    print(
        f"\nwithin 150 m of {len(points)} points: {took:.2f} s CPU, {start[-1] / len(points):.0f} "
        f"each; all pairs of 600: {whole:.2f} s"
    )
    assert took < 20 * whole

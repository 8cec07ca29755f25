"""The fence fit: CPU time on synthetic lakes, beside numpy passes over the same data.

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

from mrmission.mission.fence_rings import RingFit, fit_rings
from mrmission.options import VehicleLimits

SWATH_M = 40.0


def cpu_s(work: Callable[[], object], repeats: int = 3) -> float:
    """Return the least CPU time of a few runs."""
    best = np.inf
    for _ in range(repeats):
        start = time.process_time()
        work()
        best = min(best, time.process_time() - start)
    return float(best)


def ragged_lake(vertices: int, islands: int) -> shapely.Polygon:
    """Return a lake of 1 km radius, islands on a lattice, rough at every scale."""
    rng = np.random.default_rng(0)

    def blob(x: float, y: float, radius: float, count: int) -> shapely.Polygon:
        turn = 2 * np.pi * np.arange(count) / count
        shape = 1 + 0.05 * rng.uniform(-1, 1, count)
        for k in range(2, 12):
            shape += 0.25 / k * rng.normal() * np.cos(k * turn + rng.uniform(0, 2 * np.pi))
        shape = np.clip(shape, 0.4, 1.6)
        ring = np.stack([x + radius * shape * np.cos(turn), y + radius * shape * np.sin(turn)], 1)
        return shapely.Polygon(ring)

    side = int(np.ceil(np.sqrt(islands)))
    pitch = 520 / max(side - 1, 1)
    at = [(pitch * i - 260, pitch * j - 260) for i in range(side) for j in range(side)][:islands]
    holes = [blob(x, y, min(40.0, 0.25 * pitch), vertices // 4 // islands) for x, y in at]
    shell = blob(0, 0, 1000, vertices - vertices // 4)
    return shapely.Polygon(shell.exterior, [hole.exterior for hole in holes])


def one_robots_path(water: shapely.Polygon, share: float) -> shapely.LineString:
    """Return lanes over the western share of a lake, there and back, ends on the shore."""
    west, south, east, north = water.bounds
    points: list[tuple[float, float]] = []
    for column, x in enumerate(
        np.arange(west + SWATH_M / 2, west + share * (east - west), SWATH_M)
    ):
        lane = shapely.intersection(water, shapely.LineString([(x, south), (x, north)]))
        ends = [c for part in shapely.get_parts(lane) for c in part.coords]
        # the legs past an island or a bay are not in the water: stay on the first piece
        points += sorted(ends[:2], reverse=column % 2 == 1)
    return shapely.LineString(points)


@pytest.mark.parametrize(
    ("name", "vertices", "islands", "share"),
    [("a sixth", 500, 4, 0.2), ("all of it", 500, 4, 1.0), ("a large one", 10_000, 300, 0.2)],
)
def test_fit_speed(name: str, vertices: int, islands: int, share: float) -> None:
    water = ragged_lake(vertices, islands)
    path = one_robots_path(water, share)
    shore, way = shapely.get_coordinates(water), shapely.get_coordinates(path)
    limits = VehicleLimits()

    def fit() -> RingFit:
        return fit_rings(water, [path], 2.0, limits)

    def one_pass() -> float:
        return float(np.hypot(*(shore[:, None] - way[None]).transpose(2, 0, 1)).min())

    found = fit()
    took_s, pass_s = cpu_s(fit), cpu_s(one_pass)
    print(
        f"\nfence of {name}: {len(shore)} shore vertices, {islands} islands, {len(way)} path "
        f"points: {took_s * 1e3:.1f} ms, {took_s / pass_s:.1f} x one pass of all distances"
        f" ({pass_s * 1e3:.2f} ms); {found.points} points, {found.land_m2:,.0f} m² of land"
    )
    assert took_s < 3_000 * pass_s

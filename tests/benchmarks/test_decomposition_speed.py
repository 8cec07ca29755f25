"""Speed of polygon to linked cells and of the postman tour, beside one numpy pass.

The region has about 5,000 vertices and 100 islands, the resolution is that of a raster of 1e8
pixels. The pass is numpy's sum over that raster, the least that any way through pixels would cost.
"""

from __future__ import annotations

import time
from collections.abc import Callable

import numpy as np
import pytest
import shapely

from mrmission.decomposition.cells import cell_polygons, decompose
from mrmission.decomposition.slices import lane_intervals, slices_of_grid, slices_of_polygon
from mrmission.model import OccupancyGrid, ReebGraph, Slices
from mrmission.routing.postman import postman_tour

SIZE = 10_000


def best_of(runs: int, work: Callable[[], object]) -> float:
    """Return the least CPU time of `work`, s, after one run that compiles."""
    work()
    times_s = []
    for _ in range(runs):
        begin_s = time.process_time()
        work()
        times_s.append(time.process_time() - begin_s)
    return min(times_s)


def big_lake(*, roughness: float) -> shapely.Polygon:
    """Return a lake of 5,000 vertices with 100 islands in a square of 10 km."""
    rng = np.random.default_rng(5)
    angle = np.arange(3000) / 3000 * 2 * np.pi
    wave = 0.38 + 0.06 * np.sin(5 * angle + 1) + 0.03 * np.sin(13 * angle)
    radius_m = SIZE * (wave + roughness * rng.standard_normal(3000))
    shell_m = SIZE / 2 + np.column_stack((radius_m * np.cos(angle), radius_m * np.sin(angle)))
    islands_m = []
    turn = np.arange(20) / 20 * 2 * np.pi
    for k in range(100):
        across, along = k % 10, k // 10
        center_m = SIZE / 2 + 380.0 * (np.array([across, along]) - 4.5) + rng.uniform(-60, 60, 2)
        radius_m = 110 * rng.uniform(0.6, 1.0, 20)
        islands_m.append(
            center_m + np.column_stack((radius_m * np.cos(turn), radius_m * np.sin(turn)))
        )
    return shapely.Polygon(shell_m, islands_m)


def slices_of(lake: shapely.Polygon) -> Slices:
    return slices_of_polygon(lake, 1.0, 1.0, (0.0, 0.0), SIZE, SIZE)


@pytest.mark.parametrize("roughness", [0.0, 0.004])
def test_polygon_to_linked_cells(roughness: float) -> None:
    lake = big_lake(roughness=roughness)
    slices = slices_of(lake)
    free = np.zeros((SIZE, SIZE), np.bool_)
    for c, a, b in zip(slices.column, slices.row_start, slices.row_stop, strict=True):
        free[c, a:b] = True
    grid = OccupancyGrid(free=free, column_pitch_m=1.0, row_pitch_m=1.0, origin_m=(0.0, 0.0))
    decomposition = decompose(slices)
    lines_m = np.arange(SIZE) + 0.5
    pass_s = best_of(2, free.sum)
    polygon_s = best_of(5, lambda: decompose(slices_of(lake)))
    slices_s = best_of(5, lambda: slices_of(lake))
    grid_s = best_of(2, lambda: slices_of_grid(grid))
    lanes_s = best_of(5, lambda: lane_intervals(lake, lines_m))
    outlines_s = best_of(2, lambda: cell_polygons(decomposition))
    print(  # noqa: T201
        f"\n{shapely.get_num_coordinates(lake)} vertices, {len(slices)} slices,"
        f" {len(decomposition.cells)} cells; one numpy pass {pass_s * 1e3:.1f} ms;"
        f" polygon to linked cells {polygon_s * 1e3:.1f} ms (ratio {polygon_s / pass_s:.3f}),"
        f" of it slices {slices_s * 1e3:.1f} ms;"
        f" raster to slices {grid_s * 1e3:.1f} ms (ratio {grid_s / pass_s:.2f});"
        f" lane intervals {lanes_s * 1e3:.1f} ms; outlines {outlines_s * 1e3:.1f} ms"
    )
    assert polygon_s < 1.5 * pass_s
    assert grid_s < 6 * pass_s


def cubic_graph(nodes: int) -> ReebGraph:
    """Return one large block of odd nodes: a ring with chords to near nodes."""
    rng = np.random.default_rng(8)
    free = list(range(nodes))
    pairs = [(i, (i + 1) % nodes) for i in range(nodes)]
    while free:
        a = free.pop(0)
        pairs.append((a, free.pop(int(rng.integers(min(12, len(free)))))))
    ends = np.array(pairs)
    weight = rng.uniform(0.01, 1.0, len(pairs))
    return ReebGraph(
        node_m=np.zeros((nodes, 2)),
        tail=ends[:, 0].copy(),
        head=ends[:, 1].copy(),
        w_c=weight,
        w_t=weight,
        c_e=weight,
    )


def test_postman() -> None:
    rows = np.ones((SIZE // 4, SIZE), np.bool_)
    pass_s = 4 * best_of(2, rows.sum)
    reeb = decompose(slices_of(big_lake(roughness=0.0))).reeb
    lake_s = best_of(3, lambda: postman_tour(reeb))
    block = cubic_graph(600)
    block_s = best_of(1, lambda: postman_tour(block))
    print(  # noqa: T201
        f"\npostman: lake of {len(reeb.tail)} cells {lake_s * 1e3:.1f} ms"
        f" (ratio to one numpy pass {lake_s / pass_s:.2f});"
        f" one block of 600 odd nodes {block_s * 1e3:.0f} ms (ratio {block_s / pass_s:.1f})"
    )
    assert lake_s < 10 * pass_s
    assert block_s < 150 * pass_s

"""Slices from polygon edges, slices from rasters, exact lane intervals."""

from __future__ import annotations

import numpy as np
import pytest
import shapely

from mrmission.decomposition.slices import lane_intervals, slices_of_grid, slices_of_polygon
from mrmission.errors import PlanningError
from mrmission.model import OccupancyGrid, Slices


def rows_of(slices: Slices) -> list[tuple[int, int, int]]:
    return list(
        zip(
            slices.column.tolist(),
            slices.row_start.tolist(),
            slices.row_stop.tolist(),
            strict=True,
        )
    )


def grid_of(free: np.ndarray) -> OccupancyGrid:
    return OccupancyGrid(free=free, column_pitch_m=1.0, row_pitch_m=1.0, origin_m=(0.0, 0.0))


def runs_by_hand(free: np.ndarray) -> list[tuple[int, int, int]]:
    out = []
    for c, column in enumerate(free.tolist()):
        start = None
        for r, value in enumerate([*column, False]):
            if value and start is None:
                start = r
            elif not value and start is not None:
                out.append((c, start, r))
                start = None
    return out


def test_box_with_island_by_hand() -> None:
    lake = shapely.box(0, 0, 4, 4) - shapely.box(1, 1, 3, 2)
    slices = slices_of_polygon(lake, 1.0, 1.0, (0.0, 0.0), 4, 4)
    assert rows_of(slices) == [(0, 0, 4), (1, 0, 1), (1, 2, 4), (2, 0, 1), (2, 2, 4), (3, 0, 4)]
    assert slices.offsets.tolist() == [0, 1, 3, 5, 6]
    assert not slices.row_start.flags.writeable


def test_raster_cuts_off_what_lies_outside() -> None:
    slices = slices_of_polygon(shapely.box(-9, -9, 9, 9), 2.0, 0.5, (-1.0, 3.0), 3, 5)
    assert rows_of(slices) == [(0, 0, 5), (1, 0, 5), (2, 0, 5)]
    above = slices_of_polygon(shapely.box(0, 0, 9, 9), 1.0, 1.0, (0.0, 20.0), 9, 5)
    below = slices_of_polygon(shapely.box(0, 0, 9, 9), 1.0, 1.0, (0.0, -20.0), 9, 5)
    beside = slices_of_polygon(shapely.box(0, 0, 9, 9), 1.0, 1.0, (50.0, 0.0), 9, 5)
    assert len(above) == len(below) == len(beside) == 0


def test_vertices_and_edges_on_the_lines_are_half_open() -> None:
    # Every vertex at a raster centre: left and lower sides are in, right and upper out.
    slices = slices_of_polygon(shapely.box(0.5, 0.5, 3.5, 2.5), 1.0, 1.0, (0.0, 0.0), 5, 5)
    assert rows_of(slices) == [(0, 0, 2), (1, 0, 2), (2, 0, 2)]
    # A spike that touches a column centre with its tip leaves nothing there.
    spike = shapely.Polygon([(0.5, 0), (2.5, 1), (0.5, 2)])
    assert rows_of(slices_of_polygon(spike, 1.0, 1.0, (0.0, 0.0), 4, 3)) == [(0, 0, 2), (1, 0, 1)]


def test_slopes_without_finite_binary_meet_centres_exactly() -> None:
    # The edge rises 2 k in 2 n columns, so it meets the centre of cell (n, k); k / n is rounded.
    for n in range(3, 60):
        for k in (1, 5, 7, 11):
            low, high, far = 0.5, 2 * k + 0.5, 2 * n + 0.5
            above = shapely.Polygon([(low, low), (far, high), (low, high)])
            below = shapely.Polygon([(low, low), (far, low), (far, high)])
            size = (1.0, 1.0, (0.0, 0.0), 2 * n + 1, 2 * k + 1)
            assert rows_of(slices_of_polygon(above, *size))[n] == (n, k, 2 * k)
            under = [r for r in rows_of(slices_of_polygon(below, *size)) if r[0] == n]
            assert under == [(n, 0, k)]


def test_crack_between_centres_is_not_seen() -> None:
    lake = shapely.box(0, 0, 3, 10) - shapely.box(-1, 4.6, 4, 5.4)
    assert rows_of(slices_of_polygon(lake, 1.0, 1.0, (0.0, 0.0), 3, 10)) == [
        (0, 0, 10),
        (1, 0, 10),
        (2, 0, 10),
    ]


def test_empty_inputs() -> None:
    for polygon in (shapely.Polygon(), shapely.MultiPolygon()):
        slices = slices_of_polygon(polygon, 1.0, 1.0, (0.0, 0.0), 3, 3)
        assert len(slices) == 0
        assert slices.offsets.tolist() == [0, 0, 0, 0]
        assert len(lane_intervals(polygon, [0.0, 1.0])[0]) == 0
    assert len(slices_of_polygon(shapely.box(0, 0, 1, 1), 1.0, 1.0, (0.0, 0.0), 0, 0)) == 0
    assert len(slices_of_grid(grid_of(np.zeros((0, 0), np.bool_)))) == 0
    assert len(slices_of_grid(grid_of(np.zeros((3, 0), np.bool_)))) == 0
    assert len(lane_intervals(shapely.box(0, 0, 1, 1), [])[0]) == 0


@pytest.mark.parametrize(
    ("pitch_m", "origin_m", "columns", "rows", "word"),
    [
        ((0.0, 1.0), (0.0, 0.0), 3, 3, "pitch"),
        ((1.0, float("nan")), (0.0, 0.0), 3, 3, "pitch"),
        ((1.0, 1.0), (float("inf"), 0.0), 3, 3, "origin"),
        ((1.0, 1.0), (0.0, 0.0), -1, 3, "columns"),
        ((1.0, 1.0), (0.0, 0.0), 3, 2**31, "coarser"),
    ],
)
def test_bad_raster_is_refused(
    pitch_m: tuple[float, float],
    origin_m: tuple[float, float],
    columns: int,
    rows: int,
    word: str,
) -> None:
    with pytest.raises(PlanningError, match=word):
        slices_of_polygon(shapely.box(0, 0, 1, 1), *pitch_m, origin_m, columns, rows)


@pytest.mark.parametrize("density", [0.02, 0.5, 0.98])
def test_grid_equals_runs_by_hand(density: float) -> None:
    rng = np.random.default_rng(7)
    for columns, rows in ((1, 1), (1, 500), (9, 1), (17, 63), (5, 64), (6, 65), (4, 193)):
        free = rng.random((columns, rows)) < density
        assert rows_of(slices_of_grid(grid_of(free))) == runs_by_hand(free)
        # Any memory layout, writeable or not.
        turned = np.asfortranarray(free)
        turned.setflags(write=False)
        assert rows_of(slices_of_grid(grid_of(turned))) == runs_by_hand(free)


def test_grid_with_many_runs_grows_its_room() -> None:
    free = np.zeros((50, 1000), np.bool_)
    free[:, ::2] = True
    slices = slices_of_grid(grid_of(free))
    assert len(slices) == 50 * 500
    assert rows_of(slices) == runs_by_hand(free)


def test_lane_intervals_are_exact() -> None:
    lake = shapely.Polygon(
        [(0, 0), (10, 0), (10, 10), (5, 4), (0, 10)], [[(2, 1), (3, 2), (4, 1), (3, 0.5)]]
    )
    column, start_m, stop_m = lane_intervals(lake, [3.0, 0.0, 5.0, 10.0, 12.0, 2.5])
    assert column.tolist() == [0, 0, 1, 2, 5, 5]
    assert np.allclose(start_m, [0, 2, 0, 0, 0, 1.5])
    assert np.allclose(stop_m, [0.5, 6.4, 10, 4, 0.75, 7])


def test_lane_intervals_equal_shapely_on_random_polygons() -> None:
    rng = np.random.default_rng(3)
    for _ in range(40):
        angle = np.sort(rng.uniform(0, 2 * np.pi, 40))
        radius_m = rng.uniform(20, 60, 40)
        shell = shapely.Polygon(
            np.column_stack((radius_m * np.cos(angle), radius_m * np.sin(angle)))
        ).buffer(0)
        lake = shapely.difference(shell, shapely.MultiPoint(rng.uniform(-30, 30, (5, 2))).buffer(4))
        lines_m = rng.uniform(-70, 70, 30)
        column, start_m, stop_m = lane_intervals(lake, lines_m)
        for i, x_m in enumerate(lines_m.tolist()):
            inside = shapely.intersection(lake, shapely.LineString([(x_m, -99), (x_m, 99)]))
            parts = [p for p in shapely.get_parts(inside) if p.geom_type == "LineString"]
            bounds = sorted((p.bounds[1], p.bounds[3]) for p in parts)
            mine = list(zip(start_m[column == i], stop_m[column == i], strict=True))
            assert np.allclose(np.array(mine).reshape(-1, 2), np.array(bounds).reshape(-1, 2))


def test_thousands_of_crossings_in_one_column() -> None:
    comb = [(0.0, 0.0)]
    for k in range(3000):
        comb += [(1.0, 2 * k + 0.25), (9.0, 2 * k + 0.5), (9.0, 2 * k + 1.5), (1.0, 2 * k + 1.75)]
    comb += [(0.0, 6000.0)]
    slices = slices_of_polygon(shapely.Polygon(comb), 1.0, 0.5, (0.0, 0.0), 10, 12000)
    assert np.diff(slices.offsets).tolist() == [1] + [3000] * 8 + [0]
    middle = slices.row_start[slices.offsets[5] : slices.offsets[6]]
    assert np.all(np.diff(middle) > 0)

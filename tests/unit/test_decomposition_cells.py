"""Cells, Reeb graph, dual graph, cell outlines and halves, by hand."""

from __future__ import annotations

import numpy as np
import pytest
import shapely

from mrmission.decomposition.cells import cell_polygons, decompose, split_cell
from mrmission.decomposition.slices import slices_of_grid, slices_of_polygon
from mrmission.model import Decomposition, OccupancyGrid


def decompose_picture(*lines: str, pitch_m: tuple[float, float] = (1.0, 1.0)) -> Decomposition:
    """Return the decomposition of a picture: '.' free, columns to the right, rows upward."""
    free = np.array([[c == "." for c in line] for line in reversed(lines)]).T
    return decompose(
        slices_of_grid(
            OccupancyGrid(
                free=free, column_pitch_m=pitch_m[0], row_pitch_m=pitch_m[1], origin_m=(10.0, 20.0)
            )
        )
    )


def edges_of(d: Decomposition) -> list[tuple[int, int]]:
    return list(zip(d.reeb.tail.tolist(), d.reeb.head.tolist(), strict=True))


def test_one_island() -> None:
    d = decompose_picture(
        "......",
        "..##..",
        "......",
    )
    assert edges_of(d) == [(0, 1), (1, 2), (1, 2), (2, 3)]
    assert d.cells.area_m2.tolist() == [6, 2, 2, 6]
    assert d.cells.width_m.tolist() == [2, 2, 2, 2]
    assert d.reeb.node_m.tolist() == [[10, 21.5], [12, 21.5], [14, 21.5], [16, 21.5]]
    assert d.cells.centroid_m.tolist() == [[11, 21.5], [13, 20.5], [13, 22.5], [15, 21.5]]
    assert d.dual_edges.tolist() == [[0, 1], [0, 2], [1, 2], [1, 3], [2, 3]]
    assert d.reeb.c_e.tolist() == [4 / 6, 2, 2, 4 / 6]
    assert d.reeb.w_c.tolist() == d.cells.area_m2.tolist()
    around = 1 + 2 * np.hypot(0.5, 1)
    assert np.allclose(d.reeb.w_t, [2, around, around, 2])


def test_pitches_scale_areas_and_lengths() -> None:
    d = decompose_picture("...", "...", pitch_m=(4.0, 0.5))
    assert d.cells.area_m2.tolist() == [12]
    assert d.cells.width_m.tolist() == [12]
    assert d.reeb.w_t.tolist() == [12]
    assert d.reeb.c_e.tolist() == [12]
    assert d.reeb.node_m.tolist() == [[10, 20.5], [22, 20.5]]


def test_many_slices_meeting_many_are_one_critical_point_where_connected() -> None:
    # Left slices rows 0-1, 3-4, 6-7, right slices rows 1-3, 7: {2 left, 1 right}, {1, 1}.
    d = decompose_picture(
        "..",
        ".#",
        "##",
        ".#",
        "..",
        "#.",
        "..",
        ".#",
    )
    assert edges_of(d) == [(0, 3), (1, 3), (2, 5), (3, 4)]
    # Two left slices with two right ones in one component: an S lying on its side.
    d = decompose_picture(
        "#.",
        "..",
        ".#",
        "..",
        "#.",
        "#.",
    )
    assert edges_of(d) == [(0, 1), (1, 2), (1, 3)]
    d = decompose_picture(
        "#.",
        "..",
        ".#",
        "..",
        "#.",
        "..",
        ".#",
    )
    assert edges_of(d) == [(0, 2), (1, 2), (2, 3), (2, 4)]
    assert d.dual_edges.tolist() == [[0, 1], [0, 2], [0, 3], [1, 2], [1, 3], [2, 3]]


def test_corners_do_not_connect() -> None:
    d = decompose_picture(
        ".#",
        "#.",
    )
    assert edges_of(d) == [(0, 2), (1, 3)]
    assert len(d.dual_edges) == 0


def test_checkerboard_is_all_single_cells() -> None:
    free = np.indices((8, 9)).sum(axis=0) % 2 == 0
    d = decompose(
        slices_of_grid(
            OccupancyGrid(free=free, column_pitch_m=1.0, row_pitch_m=1.0, origin_m=(0.0, 0.0))
        )
    )
    assert len(d.cells) == 36
    assert len(d.reeb.node_m) == 72
    assert len(d.dual_edges) == 0


@pytest.mark.parametrize("shape", [(0, 0), (4, 0), (3, 3)])
def test_nothing_free(shape: tuple[int, int]) -> None:
    d = decompose(
        slices_of_grid(
            OccupancyGrid(
                free=np.zeros(shape, np.bool_),
                column_pitch_m=1.0,
                row_pitch_m=1.0,
                origin_m=(0.0, 0.0),
            )
        )
    )
    assert len(d.cells) == len(d.reeb.node_m) == len(d.dual_edges) == 0
    assert d.dual_edges.shape == (0, 2)
    assert d.cells.centroid_m.shape == (0, 2)
    assert cell_polygons(d) == ()


def test_single_column_and_all_free() -> None:
    d = decompose_picture(".", "#", ".")
    assert edges_of(d) == [(0, 2), (1, 3)]
    d = decompose_picture("....", "....")
    assert edges_of(d) == [(0, 1)]


def test_arrays_are_read_only() -> None:
    d = decompose_picture("..", "#.")
    for array in (
        d.cells.slice_index,
        d.cells.offsets,
        d.cells.area_m2,
        d.cells.width_m,
        d.cells.centroid_m,
        d.reeb.node_m,
        d.reeb.tail,
        d.reeb.head,
        d.reeb.w_c,
        d.reeb.w_t,
        d.reeb.c_e,
        d.dual_edges,
    ):
        assert not array.flags.writeable


def test_node_is_moved_into_the_water() -> None:
    # Two slices with thin links to one: the mean of all ends lies on land on both sides.
    d = decompose_picture(
        "..",
        ".#",
        ".#",
        ".#",
        "##",
        "..",
    )
    for x_m, y_m in d.reeb.node_m.tolist():
        touched = False
        for i in range(len(d.slices)):
            left_m = 10 + d.slices.column[i]
            if left_m <= x_m <= left_m + 1:
                touched |= bool(20 + d.slices.row_start[i] < y_m < 20 + d.slices.row_stop[i])
        assert touched
    comb = decompose_picture(
        "..",
        ".#",
        ".#",
        ".#",
        ".#",
        "..",
    )
    # One slice on the left reaches both right ones: its middle is in the water.
    assert comb.reeb.node_m[comb.reeb.head[0]].tolist() == [11, 23]


def test_split_goes_straight_from_critical_point_to_critical_point() -> None:
    d = decompose_picture("....", "....", "....", "....")
    assert split_cell(d, 0).tolist() == [22, 22, 22, 22]
    lake = shapely.Polygon([(0, 0), (100, 0), (100, 60), (0, 20)])
    d = decompose(slices_of_polygon(lake, 1.0, 0.01, (0.0, 0.0), 100, 6000))
    assert len(d.cells) == 1
    height_m = split_cell(d, 0)
    # The nodes are the middles of the first and the last slice, half a column further out.
    first_m, last_m = (20 + 0.2) / 2, (60 - 0.2) / 2
    expected = first_m + (np.arange(100) + 0.5) / 100 * (last_m - first_m)
    assert np.allclose(height_m, expected, atol=0.02)


def test_split_is_clipped_into_the_cell() -> None:
    # A valley: the straight line between the ends would leave the water in the middle.
    d = decompose_picture(
        "..##..",
        "..##..",
        "......",
        "##..##",
        "##..##",
    )
    assert len(d.cells) == 1
    height_m = split_cell(d, 0)
    start_m = 20.0 + d.slices.row_start
    stop_m = 20.0 + d.slices.row_stop
    assert np.all((start_m <= height_m) & (height_m <= stop_m))
    assert height_m[2] == stop_m[2] == 23


def test_outlines() -> None:
    lake = shapely.box(0, 0, 40, 30) - shapely.Point(20, 15).buffer(7)
    d = decompose(slices_of_polygon(lake, 1.0, 0.25, (0.0, 0.0), 40, 120))
    exact = cell_polygons(d, stairs=True)
    assert all(p.is_valid for p in exact)
    assert np.allclose([p.area for p in exact], d.cells.area_m2)
    assert shapely.union_all(exact).area == pytest.approx(d.cells.area_m2.sum())
    for tolerance_m in (None, 0.0):
        smooth = cell_polygons(d, tolerance_m=tolerance_m)
        assert len(smooth) == len(d.cells) == 4
        assert all(p.is_valid and p.geom_type == "Polygon" for p in smooth)
        assert np.allclose([p.area for p in smooth], d.cells.area_m2, rtol=0.02)
        assert shapely.union_all(smooth).symmetric_difference(lake).area < 0.03 * lake.area
    assert shapely.get_num_coordinates(cell_polygons(d)[0]) <= 6


def test_outline_of_a_cell_of_one_raster_cell() -> None:
    d = decompose_picture(".")
    for outline in (cell_polygons(d)[0], cell_polygons(d, stairs=True)[0]):
        assert outline.equals(shapely.box(10, 20, 11, 21))

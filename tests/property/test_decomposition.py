"""What holds for every region: slices by brute force, cells and Reeb graph by flood fill."""

from __future__ import annotations

import numpy as np
import pytest
import shapely
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp

from mrmission.decomposition.cells import cell_polygons, decompose, split_cell
from mrmission.decomposition.slices import slices_of_grid, slices_of_polygon
from mrmission.model import Decomposition, OccupancyGrid, Slices

FINE = 8
"""Random vertices lie on a lattice of 1/8 m, where the oracle is exact in integers."""


def grid_of(free: np.ndarray) -> OccupancyGrid:
    return OccupancyGrid(free=free, column_pitch_m=1.0, row_pitch_m=1.0, origin_m=(0.0, 0.0))


def raster_of(slices: Slices, shape: tuple[int, int]) -> np.ndarray:
    free = np.zeros(shape, np.bool_)
    for c, a, b in zip(slices.column, slices.row_start, slices.row_stop, strict=True):
        assert a < b
        assert not free[c, max(a - 1, 0) : b + 1].any(), "slices touch or overlap"
        free[c, a:b] = True
    return free


def same_slices(a: Slices, b: Slices) -> bool:
    return all(
        np.array_equal(getattr(a, name), getattr(b, name))
        for name in ("column", "row_start", "row_stop", "offsets")
    )


def random_region(rng: np.random.Generator, size: int) -> shapely.Polygon | shapely.MultiPolygon:
    """Return a star-shaped lake with islands and bays, vertices on the 1/8 m lattice."""
    corners = int(rng.integers(3, 24))
    angle = np.sort(rng.uniform(0, 2 * np.pi, corners))
    radius_m = rng.uniform(0.15, 0.6, corners) * size
    xy_m = size / 2 + np.column_stack((radius_m * np.cos(angle), radius_m * np.sin(angle)))
    region = shapely.make_valid(shapely.Polygon(np.round(xy_m * FINE) / FINE))
    for _ in range(int(rng.integers(0, 5))):
        at, extent = rng.uniform(0, size, 2), rng.uniform(0.3, 0.25 * size, 2)
        hole = np.round((at + np.array([[0, 0], [1, 0.2], [0.7, 1], [0, 0.6]]) * extent) * 2) / 2
        if rng.random() < 0.5:
            hole = np.array([hole[0], [hole[2, 0], hole[0, 1]], hole[2], [hole[0, 0], hole[2, 1]]])
        region = region - shapely.make_valid(shapely.Polygon(hole))
    parts = [p for p in shapely.get_parts(region) if p.geom_type == "Polygon"]
    return shapely.set_precision(shapely.MultiPolygon(parts), 1 / FINE)


def inside_by_integers(region: shapely.Geometry, columns: int, rows: int, shift: int) -> np.ndarray:
    """Even-odd at the cell centres in exact integers (1/8 m), half open, without any division."""
    x = np.arange(columns)[:, None] * FINE + FINE // 2 + shift
    y = np.arange(rows)[None, :] * FINE + FINE // 2 + shift
    inside = np.zeros((columns, rows), np.bool_)
    for ring in shapely.get_rings(shapely.get_parts(region)):
        points = np.round(shapely.get_coordinates(ring) * FINE).astype(np.int64)
        for (xa, ya), (xb, yb) in zip(points[:-1].tolist(), points[1:].tolist(), strict=True):
            spans = (xa <= x) != (xb <= x)
            cross = (xb - xa) * (y - ya) - (yb - ya) * (x - xa)
            inside ^= spans & (cross >= 0 if xb > xa else cross <= 0)
    return inside


@pytest.mark.parametrize("seed", range(4))
def test_slices_of_polygons_are_the_raster(seed: int) -> None:
    rng = np.random.default_rng(seed)
    for _ in range(400):
        size = int(rng.integers(4, 20))
        region = random_region(rng, size)
        # Centres on the lattice of the vertices (ties everywhere), and the raster cut short.
        shift = int(rng.integers(-4, 5))
        columns, rows = int(rng.integers(1, size + 4)), int(rng.integers(1, size + 4))
        expected = inside_by_integers(region, columns, rows, shift)
        slices = slices_of_polygon(region, 1.0, 1.0, (shift / FINE, shift / FINE), columns, rows)
        assert np.array_equal(raster_of(slices, (columns, rows)), expected)
        assert same_slices(slices, slices_of_grid(grid_of(expected)))


def test_slices_of_real_polygons_agree_with_shapely() -> None:
    """Coordinates that no raster fits: far from the origin, turned, odd pitches."""
    rng = np.random.default_rng(11)
    for _ in range(60):
        turn = rng.uniform(0, np.pi)
        matrix = np.array([[np.cos(turn), -np.sin(turn)], [np.sin(turn), np.cos(turn)]])
        region = shapely.transform(random_region(rng, 16), lambda xy, m=matrix: 4e3 + xy @ m.T)
        if region.is_empty:
            continue
        x0_m, y0_m, x1_m, y1_m = region.bounds
        pitch_m = (float(rng.uniform(0.1, 0.9)), float(rng.uniform(0.05, 0.7)))
        columns, rows = int((x1_m - x0_m) / pitch_m[0]) + 2, int((y1_m - y0_m) / pitch_m[1]) + 2
        x_m = x0_m + (np.arange(columns) + 0.5) * pitch_m[0]
        y_m = y0_m + (np.arange(rows) + 0.5) * pitch_m[1]
        expected = shapely.contains_xy(region, x_m[:, None], y_m[None, :])
        slices = slices_of_polygon(region, *pitch_m, (x0_m, y0_m), columns, rows)
        assert np.array_equal(raster_of(slices, (columns, rows)), expected)


def flood(mask: np.ndarray, corners: bool) -> tuple[np.ndarray, int]:
    """Label the components of a mask, through edges or through corners too."""
    label = np.full(mask.shape, -1)
    steps = [(-1, 0), (1, 0), (0, -1), (0, 1)]
    if corners:
        steps += [(-1, -1), (-1, 1), (1, -1), (1, 1)]
    columns, rows = mask.shape
    todo_all = mask.tolist()
    count = 0
    for c in range(columns):
        for r in range(rows):
            if not todo_all[c][r]:
                continue
            todo_all[c][r] = False
            stack = [(c, r)]
            while stack:
                x, y = stack.pop()
                label[x, y] = count
                for dx, dy in steps:
                    u, v = x + dx, y + dy
                    if 0 <= u < columns and 0 <= v < rows and todo_all[u][v]:
                        todo_all[u][v] = False
                        stack.append((u, v))
            count += 1
    return label, count


def critical_points(free: np.ndarray) -> list[tuple[int, frozenset[int], frozenset[int]]]:
    """Return (border, left runs, right runs) of every critical point, runs by their first row."""
    columns, rows = free.shape
    points = []
    for border in range(columns + 1):
        # The two columns at the border as a picture of their own: runs, then shared rows.
        pair = np.zeros((2, rows), np.bool_)
        if border > 0:
            pair[0] = free[border - 1]
        if border < columns:
            pair[1] = free[border]
        label, count = flood(pair, corners=False)
        for k in range(count):
            sides = []
            for side in range(2):
                at = np.flatnonzero(label[side] == k)
                sides.append(frozenset(at[np.diff(at, prepend=-2) > 1].tolist()))
            if (len(sides[0]), len(sides[1])) != (1, 1):
                points.append((border, sides[0], sides[1]))
    return points


def check(free: np.ndarray) -> Decomposition:
    """Assert everything that must hold for the decomposition of a raster."""
    slices = slices_of_grid(grid_of(free))
    assert np.array_equal(raster_of(slices, free.shape), free)
    d = decompose(slices)
    cells, reeb = d.cells, d.reeb
    # Cells are disjoint, together they are the free space, and each is one slice per column.
    assert sorted(cells.slice_index.tolist()) == list(range(len(slices)))
    assert round(cells.area_m2.sum()) == int(free.sum())
    for i in range(len(cells)):
        index = cells.slice_index[cells.offsets[i] : cells.offsets[i + 1]]
        assert len(index) == cells.width_m[i] >= 1
        assert np.all(np.diff(slices.column[index]) == 1)
        start, stop = slices.row_start[index], slices.row_stop[index]
        assert np.all(np.maximum(start[1:], start[:-1]) < np.minimum(stop[1:], stop[:-1]))
        assert cells.area_m2[i] == (stop - start).sum()
        middle = (start + stop) / 2
        assert np.allclose(cells.centroid_m[i, 1], np.average(middle, weights=stop - start))
        x = np.concatenate(
            ([reeb.node_m[reeb.tail[i], 0]], slices.column[index] + 0.5,
             [reeb.node_m[reeb.head[i], 0]])
        )  # fmt: skip
        y = np.concatenate(([reeb.node_m[reeb.tail[i], 1]], middle, [reeb.node_m[reeb.head[i], 1]]))
        assert np.isclose(reeb.w_t[i], np.hypot(np.diff(x), np.diff(y)).sum())
        height = split_cell(d, i)
        assert np.all((start <= height) & (height <= stop))
    # Independent cycles = islands, parts = parts.
    _, parts = flood(free, corners=False)
    _, holes = flood(~np.pad(free, 1), corners=True)
    group = list(range(len(reeb.node_m)))

    def root(v: int) -> int:
        while group[v] != v:
            v = group[v]
        return v

    for a, b in zip(reeb.tail.tolist(), reeb.head.tolist(), strict=True):
        group[root(a)] = root(b)
    components = sum(root(v) == v for v in range(len(group)))
    assert components == parts
    assert len(cells) - len(group) + components == holes - 1
    # Critical points, with the cells that begin and end there.
    cell_of = np.zeros(len(slices), np.int64)
    cell_of[cells.slice_index] = np.repeat(np.arange(len(cells)), np.diff(cells.offsets))
    cell_at = {
        (int(c), int(r)): int(cell_of[s])
        for s, (c, r) in enumerate(zip(slices.column, slices.row_start, strict=True))
    }
    expected = sorted(
        (
            border,
            sorted(cell_at[border - 1, r] for r in left),
            sorted(cell_at[border, r] for r in right),
        )
        for border, left, right in critical_points(free)
    )
    mine = sorted(
        (
            int(reeb.node_m[v, 0]),
            np.flatnonzero(reeb.head == v).tolist(),
            np.flatnonzero(reeb.tail == v).tolist(),
        )
        for v in range(len(reeb.node_m))
    )
    assert mine == expected
    # A node is in the water of one of the slices that meet there.
    for x, y in reeb.node_m.tolist():
        touching = np.flatnonzero((slices.column == x) | (slices.column == x - 1))
        assert any(slices.row_start[s] < y < slices.row_stop[s] for s in touching)
    pairs = {
        (min(a, b), max(a, b))
        for _, left, right in expected
        for a in [*left, *right]
        for b in [*left, *right]
        if a != b
    }
    assert list(map(tuple, d.dual_edges.tolist())) == sorted(pairs)
    return d


@pytest.mark.parametrize("seed", range(4))
def test_random_maps(seed: int) -> None:
    rng = np.random.default_rng(seed)
    for _ in range(400):
        shape = tuple(rng.integers(1, 11, 2))
        check(rng.random(shape) < rng.choice([0.3, 0.5, 0.7, 0.9]))


def test_random_lakes() -> None:
    rng = np.random.default_rng(9)
    for _ in range(40):
        check(inside_by_integers(random_region(rng, 24), 24, 24, 0))


@settings(max_examples=150, deadline=None, derandomize=True)
@given(
    hnp.arrays(np.bool_, st.tuples(st.integers(1, 8), st.integers(1, 8)), elements=st.booleans())
)
def test_any_map(free: np.ndarray) -> None:
    d = check(free)
    exact = cell_polygons(d, stairs=True)
    assert np.allclose([p.area for p in exact], d.cells.area_m2)
    assert all(p.is_valid for p in exact)


def test_upside_down_is_the_same_graph() -> None:
    rng = np.random.default_rng(4)
    for _ in range(50):
        free = rng.random((9, 9)) < 0.7
        a, b = check(free), check(np.ascontiguousarray(free[:, ::-1]))
        assert sorted(a.cells.area_m2.tolist()) == sorted(b.cells.area_m2.tolist())
        assert np.isclose(a.reeb.w_t.sum(), b.reeb.w_t.sum())
        assert len(a.dual_edges) == len(b.dual_edges)

"""The sweep frame, its lanes, and the bearing that is chosen."""

from __future__ import annotations

import numpy as np
import pytest
import shapely
from lakes import random_lake_m

from mrmission.decomposition.slices import lane_intervals
from mrmission.tour.sweep import (
    HAIR_M,
    SweepFrame,
    best_bearing_deg,
    columns_of,
    hair_m,
    lane_spacing_m,
    sweep_cost_s,
    sweep_region,
    widest_spacing_m,
)

TURN_S = 6.0


def lakes(count: int):
    for seed in range(count):
        rng = np.random.default_rng(seed)
        yield rng, random_lake_m(rng, float(rng.uniform(80, 400)), int(rng.integers(0, 5)))


def test_frames_are_inverse_and_lanes_run_along_the_bearing() -> None:
    rng = np.random.default_rng(0)
    for bearing in (0.0, 30.0, 90.0, 123.4, 179.9):
        frame = SweepFrame(bearing_deg=bearing)
        points = rng.uniform(-500, 500, (40, 2))
        assert np.allclose(frame.to_local(frame.to_sweep(points)), points, atol=1e-9)
        assert np.allclose(frame.to_sweep(frame.to_local(points)), points, atol=1e-9)
        # compass: 0 is north, 90 east
        along = frame.to_local(np.array([[0.0, 0.0], [0.0, 1.0]]))
        east, north = along[1] - along[0]
        assert np.degrees(np.arctan2(east, north)) % 360 == pytest.approx(bearing)
        # no mirror: areas keep their sign
        ring = shapely.LinearRing([(0, 0), (1, 0), (1, 1)])
        assert frame.turn(ring).is_ccw == ring.is_ccw


@pytest.mark.parametrize("swath_m", [0.5, 1.0, 5.0, 20.0, 200.0])
@pytest.mark.parametrize("overlap", [0.0, 0.1, 0.5])
def test_spacing_is_never_above_what_was_asked(swath_m: float, overlap: float) -> None:
    spacing = lane_spacing_m(swath_m, overlap, 0.01)
    assert 0 < spacing <= swath_m * (1 - overlap)
    assert spacing <= swath_m - 0.02


def test_columns_fill_the_region_and_are_no_wider() -> None:
    for _, lake in lakes(12):
        for spacing in (3.0, 17.0, 1000.0):
            x, pitch = columns_of(lake, spacing)
            assert pitch <= spacing * (1 + 1e-9)
            assert (len(x) - 1) * spacing < lake.bounds[2] - lake.bounds[0]  # the fewest
            assert x[0] - pitch / 2 == pytest.approx(lake.bounds[0])
            assert x[-1] + pitch / 2 == pytest.approx(lake.bounds[2])


def test_lanes_are_the_chords_of_the_region() -> None:
    for rng, lake in lakes(20):
        bearing, spacing = float(rng.uniform(0, 180)), float(rng.uniform(4, 30))
        sweep = sweep_region(lake, bearing, spacing)
        ends = sweep.lane_ends_m()
        lines = shapely.linestrings(ends)
        assert shapely.covers(sweep.region.buffer(1e-6), lines).all()
        # sorted by cell, column, height
        key = np.lexsort((sweep.lane_y_m[:, 0], sweep.lane_column, sweep.lane_cell))
        assert (key == np.arange(len(key))).all()
        assert set(sweep.lane_cell.tolist()) <= set(range(len(sweep.decomposition.cells)))
        # nothing but chords too short to hold a row's centre is left out
        column, low, high = lane_intervals(sweep.region, sweep.column_x_m)
        whole = {(int(c), round(float(a), 6), round(float(b), 6)) for c, a, b in
                 zip(column, low, high, strict=True)}  # fmt: skip
        got = {(int(c), round(float(y[0]), 6), round(float(y[1]), 6)) for c, y in
               zip(sweep.lane_column, sweep.lane_y_m, strict=True)}  # fmt: skip
        assert got <= whole
        row = sweep.decomposition.slices.row_pitch_m
        assert all(b - a <= row * (1 + 1e-6) for _, a, b in whole - got)
        # and by shapely's own clipping
        y_min, y_max = sweep.region.bounds[1] - 1, sweep.region.bounds[3] + 1
        total = sum(
            sweep.region.intersection(shapely.LineString([(x, y_min), (x, y_max)])).length
            for x in sweep.column_x_m
        )
        assert (high - low).sum() == pytest.approx(total)


def test_cells_have_one_lane_per_column_at_most() -> None:
    for rng, lake in lakes(12):
        sweep = sweep_region(lake, float(rng.uniform(0, 180)), 9.0)
        pairs = list(zip(sweep.lane_cell.tolist(), sweep.lane_column.tolist(), strict=True))
        # two chords in one slice happen only where land between them holds no row's centre
        doubled = len(pairs) - len(set(pairs))
        assert doubled <= 0.05 * len(pairs)


@pytest.mark.parametrize("turned_deg", [0.0, 33.0, 90.0, 141.5])
def test_the_long_side_of_a_rectangle_is_the_bearing(turned_deg: float) -> None:
    rectangle = shapely.affinity.rotate(shapely.box(-20, -200, 20, 200), -turned_deg, origin=(0, 0))
    best = best_bearing_deg(rectangle, 10.0, 2.0, TURN_S)
    off = abs((best - turned_deg + 90) % 180 - 90)
    assert off < 0.01


def test_the_best_bearing_is_no_worse_than_a_fan() -> None:
    for _, lake in lakes(6):
        best = best_bearing_deg(lake, 12.0, 2.0, TURN_S)
        cost = sweep_cost_s(lake, best, 12.0, 2.0, TURN_S)
        for bearing in range(0, 180, 15):
            assert cost <= sweep_cost_s(lake, float(bearing), 12.0, 2.0, TURN_S) + 1e-9


def test_wide_lanes_may_touch_and_narrow_ones_keep_a_margin() -> None:
    assert widest_spacing_m(10.0, 0.0, 0.02) == 10.0
    assert widest_spacing_m(10.0, 0.1, 0.02) == pytest.approx(9.0)
    assert widest_spacing_m(5.0, 0.0, 0.02) == lane_spacing_m(5.0, 0.0, 0.02) < 5.0
    assert hair_m(10.0, 10.0, 0.02) == HAIR_M
    assert hair_m(10.0, 9.9, 0.02) == 0.0


def test_a_millimetre_more_is_no_reason_for_a_column_more() -> None:
    assert len(columns_of(shapely.box(0, 0, 300.008, 50), 10.0)[0]) == 30
    assert len(columns_of(shapely.box(0, 0, 300.1, 50), 10.0)[0]) == 31

"""What legs leave uncovered, against plain shapely."""

from __future__ import annotations

import numpy as np
import pytest
import shapely
from lakes import random_lake_m

from mrmission.tour import coverage
from mrmission.tour.coverage import (
    Uncovered,
    by_size,
    leg_buffers,
    leg_quads,
    merged,
    strips_of,
    subtract_legs,
)


def random_legs(rng: np.random.Generator, region: shapely.Geometry, count: int) -> np.ndarray:
    """Lanes, slanting legs and points, inside and outside."""
    x_min, y_min, x_max, y_max = region.bounds
    legs = rng.uniform([x_min - 5, y_min - 5], [x_max + 5, y_max + 5], (count, 2, 2))
    kind = rng.integers(0, 4, count)
    legs[kind == 0, 1, 0] = legs[kind == 0, 0, 0]  # along the strips
    legs[kind == 1, 1] = legs[kind == 1, 0]  # points
    near = legs[kind == 2]
    legs[kind == 2, 1] = near[:, 0] + rng.uniform(-4, 4, (len(near), 2))  # short
    return legs


def plain_remainder(region: shapely.Geometry, legs: np.ndarray, radius: float, segments: int):
    shapes = [
        shapely.Point(a).buffer(radius, quad_segs=segments)
        if (a == b).all()
        else shapely.LineString([a, b]).buffer(radius, quad_segs=segments)
        for a, b in legs
    ]
    return region.difference(shapely.union_all(shapes))


@pytest.mark.parametrize("seed", range(25))
def test_remainder_is_region_minus_buffers(seed: int) -> None:
    rng = np.random.default_rng(seed)
    region = random_lake_m(rng, float(rng.uniform(50, 300)), int(rng.integers(0, 5)))
    if seed % 3 == 0:
        region = shapely.MultiPolygon(
            [region, shapely.affinity.translate(random_lake_m(rng, 80.0, 1), 400, 30)]
        )
    radius = float(rng.uniform(2, 20))
    legs = random_legs(rng, region, int(rng.integers(1, 60)))
    uncovered = Uncovered(region, 2 * radius, radius)
    got = shapely.union_all(uncovered.remainder(legs))
    expected = plain_remainder(region, legs, radius, 16)
    assert got.symmetric_difference(expected).area < 1e-6 * region.area
    lane = legs[:, 0, 0] == legs[:, 1, 0]
    by_lanes_m2, by_all_m2 = uncovered.left_m2(legs[lane], legs[~lane])
    assert by_all_m2 == pytest.approx(expected.area, abs=1e-6 * region.area)
    lanes_leave_m2 = plain_remainder(region, legs[lane], radius, 16).area
    assert by_lanes_m2 == pytest.approx(lanes_leave_m2, abs=1e-6 * region.area)
    # never too generous: beyond the true discs nothing is called covered
    truth = plain_remainder(region, legs, radius, 200)
    assert truth.difference(got).area < 1e-6 * region.area


def test_pieces_are_sorted_whole_and_above_the_floor() -> None:
    rng = np.random.default_rng(5)
    for _ in range(10):
        region = random_lake_m(rng, 200.0, 3)
        legs = random_legs(rng, region, 30)
        uncovered = Uncovered(region, 10.0, 5.0)
        pieces = uncovered.remainder(legs)
        areas = [p.area for p in pieces]
        assert areas == sorted(areas, reverse=True)
        assert all(isinstance(p, shapely.Polygon) and p.area > 0 for p in pieces)
        # connected across strips: no two of them share more than points
        for i, p in enumerate(pieces):
            assert all(p.intersection(q).length < 1e-6 for q in pieces[:i])
        floored = uncovered.remainder(legs, floor_m2=5.0)
        lost = sum(areas) - sum(p.area for p in floored)
        assert -1e-9 <= lost <= 5.0 * sum(a > 0 for a in areas) + 5.0 * 20


def test_many_pieces_are_united_as_few_are(monkeypatch: pytest.MonkeyPatch) -> None:
    rng = np.random.default_rng(8)
    corner = rng.uniform(0, 300, (150, 2))
    boxes = [shapely.box(x, y, x + 12, y + 12) for x, y in corner]
    few = by_size(merged(boxes))
    monkeypatch.setattr(coverage, "MANY_PIECES", 10)
    many = by_size(merged(boxes))
    assert len({p.wkt for p in boxes} & {p.wkt for p in many}) > 5  # some touch nothing
    assert 5 < len(few) < len(boxes) - 5
    assert len(few) == len(many)
    assert all(a.equals(b) for a, b in zip(few, many, strict=True))
    assert [p.area for p in few] == sorted((p.area for p in few), reverse=True)


def test_pieces_that_one_leg_covers_go_at_once(monkeypatch: pytest.MonkeyPatch) -> None:
    rng = np.random.default_rng(9)
    at = rng.uniform(0, 300, (400, 2))
    size = rng.uniform(0.5, 6, 400)
    pieces = np.array(
        [shapely.box(x, y, x + a, y + a / 2) for (x, y), a in zip(at, size, strict=True)]
    )
    start = rng.uniform(0, 300, (150, 2))
    legs = np.stack([start, start + rng.uniform(-30, 30, (150, 2))], axis=1)
    legs[:20, 1] = legs[:20, 0]
    calls: list[int] = []

    def counted(*args: object) -> np.ndarray:
        found = covered_by_one(*args)
        calls.append(int(found.sum()))
        return found

    covered_by_one = coverage._covered_by_one
    monkeypatch.setattr(coverage, "_covered_by_one", lambda pieces, *_: np.zeros(len(pieces), bool))
    usual = [p.wkb for p in subtract_legs(pieces, legs, 5.0)]
    monkeypatch.setattr(coverage, "_covered_by_one", counted)
    assert [p.wkb for p in subtract_legs(pieces, legs, 5.0)] == usual
    assert calls[0] > 50
    assert len(usual) > 50
    buffers = leg_buffers(legs, 5.0)
    held = [bool(shapely.covers(buffers, piece).any()) for piece in pieces]
    assert calls[0] <= sum(held) <= 1.2 * calls[0]


def test_no_legs_leave_everything() -> None:
    region = random_lake_m(np.random.default_rng(2), 100.0, 2)
    got = Uncovered(region, 10.0, 5.0).remainder(np.zeros((0, 2, 2)))
    assert sum(p.area for p in got) == pytest.approx(region.area)


def test_one_leg_over_all_leaves_nothing() -> None:
    region = shapely.box(0, 0, 100, 10)
    uncovered = Uncovered(region, 10.0, 6.0)
    assert uncovered.remainder(np.array([[[-5.0, 5.0], [105.0, 5.0]]])) == []


@pytest.mark.parametrize("seed", range(8))
def test_strips_partition_the_region(seed: int) -> None:
    rng = np.random.default_rng(seed)
    region = random_lake_m(rng, 200.0, 4)
    x_min, _, x_max, _ = region.bounds
    borders = np.linspace(x_min, x_max, int(rng.integers(2, 40)))
    strips = strips_of(region, borders)
    assert len(strips) == len(borders) - 1
    for strip, a, b in zip(strips, borders[:-1], borders[1:], strict=True):
        assert strip.is_empty or (strip.bounds[0] >= a - 1e-9 and strip.bounds[2] <= b + 1e-9)
        assert strip.is_valid
    assert shapely.area(np.array(strips)).sum() == pytest.approx(region.area, rel=1e-9)
    assert shapely.union_all(strips).symmetric_difference(region).area < 1e-6 * region.area


@pytest.mark.parametrize("seed", range(8))
def test_clip_is_the_intersection(seed: int) -> None:
    rng = np.random.default_rng(seed)
    region = random_lake_m(rng, 200.0, 4)
    uncovered = Uncovered(region, 9.0, 4.5)
    for _ in range(20):
        disc = shapely.Point(rng.uniform(-110, 110, 2)).buffer(float(rng.uniform(0.5, 30)))
        expected = region.intersection(disc)
        assert uncovered.clip(disc).symmetric_difference(expected).area < 1e-6


def test_quads_and_buffers() -> None:
    legs = np.array([[[0.0, 0], [0, 10]], [[3, 4], [3, 4]], [[0, 0], [6, 8]]])
    quads = leg_quads(legs, 2.0)
    assert shapely.area(quads) == pytest.approx([40, 0, 40])
    buffers = leg_buffers(legs, 2.0)
    disc = shapely.Point(0, 0).buffer(2.0, quad_segs=16).area
    assert shapely.area(buffers) == pytest.approx([40 + disc, disc, 40 + disc])
    assert subtract_legs(np.zeros(0, dtype=object), legs, 2.0) == []


def test_a_hair_between_lanes_is_found_only_where_asked_for() -> None:
    region = shapely.box(0, 0, 20, 100)
    legs = np.array([[[4.996, 0], [4.996, 100]], [[15.004, 0], [15.004, 100]]])
    careful = Uncovered(region, 10.0, 5.0)
    easy = Uncovered(region, 10.0, 5.0, hair_m=0.012)
    assert sum(p.area for p in careful.remainder(legs)) == pytest.approx(0.8)
    assert easy.remainder(legs) == []
    exact = easy.left_m2(legs, legs[:0])[0]
    assert exact == pytest.approx(sum(p.area for p in careful.remainder(legs)))
    wider = legs + np.array([[[0.0, 0.0]], [[0.01, 0.0]]])
    assert easy.remainder(wider) != []


def test_rounding_may_leave_wider_hairs_than_lanes_that_touch() -> None:
    # 700 m long and 15 mm wide: large enough to be swept again, were it not for rounding alone
    region = shapely.box(0, 0, 20, 700)
    easy = Uncovered(region, 10.0, 5.0, hair_m=0.012)
    careful = Uncovered(region, 10.0, 5.0)
    legs = np.array([[[4.9925, 0], [4.9925, 700]], [[15.0075, 0], [15.0075, 700]]])
    assert sum(p.area for p in easy.remainder(legs)) > 1.0
    assert easy.remainder(legs, rounded=True) == []
    assert easy.left_m2(legs, legs[:0])[0] == pytest.approx(10.5)
    assert sum(p.area for p in careful.remainder(legs, rounded=True)) == pytest.approx(10.5)
    wider = legs + np.array([[[-0.0015, 0.0]], [[0.0015, 0.0]]])
    assert sum(p.area for p in easy.remainder(wider, rounded=True)) > 1.0

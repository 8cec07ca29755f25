"""How pieces are swept one after another: the best of all ways, by brute force."""

from __future__ import annotations

from itertools import product

import numpy as np
import pytest
import shapely
from lakes import random_lake_m

from mrmission.partition.problem import Visit
from mrmission.routing.water import WaterRouter
from mrmission.tour.order import PieceBook
from mrmission.tour.sweep import Sweep, sweep_region
from mrmission.tour.timing import TimeModel

TIME = TimeModel(survey_speed_m_s=2.0, transit_speed_m_s=2.0)


def book_of(seed: int, spacing_m: float = 30.0) -> tuple[PieceBook, Sweep, WaterRouter]:
    rng = np.random.default_rng(seed)
    lake = random_lake_m(rng, 300.0, 3)
    sweep = sweep_region(lake, float(rng.uniform(0, 180)), spacing_m)
    router = WaterRouter(lake)
    return PieceBook(sweep, router, TIME), sweep, router


def travel(lanes: np.ndarray, home: np.ndarray | None, router: WaterRouter) -> float:
    stops = lanes.reshape(-1, 2)
    a, b = stops[1:-1:2], stops[2::2]
    total = float(router.pair_distances(a, b).sum()) if len(a) else 0.0
    if home is not None:
        ends = np.array([stops[0], stops[-1]])
        total += float(router.pair_distances(np.array([home, home]), ends).sum())
    return total


@pytest.mark.parametrize("seed", range(6))
@pytest.mark.parametrize("with_home", [True, False])
def test_the_order_is_the_best_of_all_ways(seed: int, with_home: bool) -> None:
    book, sweep, router = book_of(seed)
    rng = np.random.default_rng(seed)
    cells = rng.permutation(len(sweep.decomposition.cells))[:3]
    visits = [Visit(int(c), int(rng.integers(0, 3))) for c in cells]
    inside = shapely.get_coordinates(sweep.region.representative_point())[0]
    home = sweep.frame.to_local(inside) if with_home else None
    got = book.order(visits, home)
    pieces = [p for p in (book.lanes(v) for v in visits) if len(p.ends_m)]
    assert len(got) == sum(len(p.ends_m) for p in pieces)
    best = min(
        travel(np.concatenate([p.sweep(*way) for p, way in zip(pieces, ways, strict=True)]),
               home, router)
        for ways in product(product((False, True), repeat=2), repeat=len(pieces))
    )  # fmt: skip
    assert travel(got, home, router) == pytest.approx(best, abs=1e-6)


def test_halves_make_the_whole() -> None:
    for seed in range(5):
        book, sweep, _ = book_of(seed, 15.0)
        for cell in range(len(sweep.decomposition.cells)):
            whole = book.lanes(Visit(cell, 0)).ends_m
            parts = [book.lanes(Visit(cell, h)).ends_m for h in (1, 2)]
            length = [np.hypot(*(e[:, 1] - e[:, 0]).T).sum() for e in (whole, *parts)]
            assert length[1] + length[2] == pytest.approx(length[0], abs=2e-3 * len(whole))
            lines = shapely.union_all(shapely.linestrings(whole)).buffer(1e-6)
            for part in parts:
                assert shapely.covers(lines, shapely.linestrings(part)).all()


def test_all_cells_have_all_lanes() -> None:
    book, sweep, _ = book_of(2, 12.0)
    cells = range(len(sweep.decomposition.cells))
    count = sum(len(book.lanes(Visit(c, 0)).ends_m) for c in cells)
    assert count == len(sweep.lane_cell)


def test_lanes_alternate_and_keep_their_ends() -> None:
    book, sweep, _ = book_of(1, 12.0)
    cell = int(np.argmax(np.diff(sweep.decomposition.cells.offsets)))
    piece = book.lanes(Visit(cell, 0))
    for backwards, from_top in product((False, True), repeat=2):
        lanes = sweep.frame.to_sweep(piece.sweep(backwards, from_top))
        rises = lanes[:, 1, 1] > lanes[:, 0, 1]
        assert (rises[1:] != rises[:-1]).all()
        assert rises[0] == (not from_top)
        step = np.diff(lanes[:, 0, 0])
        assert (step < 0).all() if backwards else (step > 0).all()


def test_costs_are_seconds_of_lanes_and_turns() -> None:
    book, sweep, _ = book_of(3, 12.0)
    cells = range(len(sweep.decomposition.cells))
    costs = book.costs_s([Visit(c, 0) for c in cells])
    for cell, cost in zip(cells, costs, strict=True):
        ends = book.lanes(Visit(cell, 0)).ends_m
        survey = np.hypot(*(ends[:, 1] - ends[:, 0]).T).sum() / TIME.survey_speed_m_s
        assert cost >= survey - 1e-9
    assert book.order([], None).shape == (0, 2, 2)

"""Slid cuts: pieces still make up their lanes, and the last robot is home earlier."""

from __future__ import annotations

import itertools
from dataclasses import replace

import numpy as np
import pytest
import shapely
from lakes import random_lake_m
from part_works import in_a_row, part_work

from mrmission.minmax import planner, slide
from mrmission.minmax.hooks import no_hooks
from mrmission.minmax.problem import LaneTours
from mrmission.minmax.search import minmax
from mrmission.minmax.slide import slid
from mrmission.model import FloatArray
from mrmission.options import PlanOptions
from mrmission.tour.flight import time_model
from mrmission.tour.lines import SurveyLine, lengths_m
from mrmission.tour.work import PartWork


def _work(region: shapely.Polygon, homes: FloatArray, swath_m: float) -> PartWork:
    asked = PlanOptions(
        robots=len(homes), swath_m=swath_m, overlap=0.0, clearance_m=0.0, method="minmax",
        time_budget_s=0.2,
    )  # fmt: skip
    return part_work(region, homes, asked, spacing_m=swath_m - 0.1)


def _lake(seed: int, robots: int) -> PartWork:
    lake = random_lake_m(np.random.default_rng(seed), 900.0, 2)
    return _work(lake, in_a_row(lake, robots), 25.0)


@pytest.mark.parametrize("seed", range(6))
def test_pieces_still_make_up_their_lines(seed: int) -> None:
    work = _lake(seed, robots=5)
    ready = planner.prepare(work)
    tours = minmax(ready.problem, 0.1, seed)
    _, took_s = planner.laid(tours, ready.lines, ready.hooks, work)
    lines = slid(ready.lines, ready.hooks, tours, ready.line_of, work, took_s)
    assert len(lines) == len(ready.lines)
    pairs = zip(lines, ready.lines, strict=True)
    assert any(not np.array_equal(a.points_m, b.points_m) for a, b in pairs)
    for i in np.unique(ready.line_of):
        index = np.flatnonzero(ready.line_of == i)
        before, after = [ready.lines[j] for j in index], [lines[j] for j in index]
        assert [(p.name, p.kind) for p in after] == [(p.name, p.kind) for p in before]
        assert np.array_equal(after[0].points_m[0], before[0].points_m[0])
        assert np.array_equal(after[-1].points_m[-1], before[-1].points_m[-1])
        for a, b in itertools.pairwise(after):
            assert np.array_equal(a.points_m[-1], b.points_m[0])
        assert lengths_m(after).sum() == pytest.approx(lengths_m(before).sum(), rel=1e-9)
        # within a run pieces may meet anywhere
        assert lengths_m(after).min() > 0.0 or lengths_m(before).min() == 0.0
    # what hangs on an end stays where it is
    for end in np.flatnonzero(np.diff(ready.hooks.of_end) > 0):
        at = [of[end >> 1].points_m[-(end & 1)] for of in (lines, ready.lines)]
        assert np.array_equal(*at)


def test_the_last_robot_is_home_earlier() -> None:
    shorter = []
    for seed in range(8):
        work = _lake(seed, robots=6)
        ready = planner.prepare(work)
        tours = minmax(ready.problem, 0.2, seed)
        paths, took_s = planner.laid(tours, ready.lines, ready.hooks, work)
        lines, paths, longest_s = planner._slid(ready, tours, paths, took_s)
        # the paths are those of the lines
        again, seconds = planner.laid(tours, lines, ready.hooks, work)
        assert seconds.max() == longest_s <= took_s.max()
        for one, other in zip(paths, again, strict=True):
            assert np.array_equal(one.points_m, other.points_m)
        shorter.append(1 - seconds.max() / took_s.max())
    assert np.mean(shorter) > 0.004
    assert max(shorter) > 0.01


CANAL = shapely.box(0, 0, 20, 1000)


@pytest.mark.parametrize(("cut_m", "speeds"), [(400.0, (2.0, 2.0)), (700.0, (2.0, 1.0))])
def test_a_lane_between_two_homes_is_cut_where_both_are_home_at_once(
    cut_m: float, speeds: tuple[float, float]
) -> None:
    """Out over its part and back: both take as long where the parts are as the speeds."""
    work = _work(CANAL, np.array([[10.0, 0.0], [10.0, 1000.0]]), 20.0)
    times = [
        time_model(replace(work.options, survey_speed_m_s=v, transit_speed_m_s=v)) for v in speeds
    ]
    work = replace(work, times=tuple(times))
    lane = np.array([[10.0, 0.0], [10.0, cut_m], [10.0, 1000.0]])
    lines = tuple(SurveyLine(points_m=lane[i : i + 2], name="1") for i in range(2))
    tours = LaneTours(entries=(np.array([0]), np.array([3])), cost=np.zeros(2))
    hooks, line_of = no_hooks(4), np.zeros(2, dtype=np.int64)
    _, took_s = planner.laid(tours, lines, hooks, work)
    for _ in range(3):
        lines = slid(lines, hooks, tours, line_of, work, took_s)
        _, took_s = planner.laid(tours, lines, hooks, work)
    assert took_s[0] == pytest.approx(took_s[1], rel=2e-3)
    share = speeds[0] / sum(speeds)
    # turning round takes the slower one less for its speed, not for its length
    assert lines[0].length_m == pytest.approx(1000.0 * share, abs=15.0)
    assert np.array_equal(lines[0].points_m[1], lines[1].points_m[0])


def test_no_cut_goes_farther_than_ways_are_priced_nor_to_the_end_of_its_lane() -> None:
    work = _work(CANAL, np.array([[10.0, 0.0], [10.0, 1000.0]]), 20.0)
    pitch_m = work.sweep.column_pitch_m
    reach_m = slide.PLACE * (slide.PLACES // 2) * pitch_m
    for cut_m, to_m in ((500.0, 500.0 - reach_m), (60.0, pitch_m)):
        lane = np.array([[10.0, 0.0], [10.0, cut_m], [10.0, 1000.0]])
        lines = tuple(SurveyLine(points_m=lane[i : i + 2], name="1") for i in range(2))
        tours = LaneTours(entries=(np.array([0]), np.array([2])), cost=np.zeros(2))
        # the first robot is late whatever is done
        after = slid(
            lines, no_hooks(4), tours, np.zeros(2, dtype=np.int64), work, np.array([9e5, 1e3])
        )
        assert after[0].length_m == pytest.approx(to_m, abs=0.02 * pitch_m)


def test_where_nothing_is_cut_nothing_is_moved() -> None:
    work = _work(CANAL, np.array([[10.0, 0.0]]), 20.0)
    lines = (SurveyLine(points_m=np.array([[10.0, 0.0], [10.0, 900.0]])),)
    tours = LaneTours(entries=(np.array([0]),), cost=np.zeros(1))
    hooks, line_of = no_hooks(2), np.zeros(1, dtype=np.int64)
    assert slid(lines, hooks, tours, line_of, work, np.array([900.0])) is lines

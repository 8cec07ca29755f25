"""Several starts of the search: how many there are, and that the best of them is taken."""

from __future__ import annotations

import numpy as np
import pytest
import shapely
from lakes import area_of, random_lake_m
from part_works import in_a_row, part_work

from mrmission.minmax import starts
from mrmission.minmax.angle import NEAR_BEST
from mrmission.minmax.planner import BUDGET_PER_LINE_S, Prepared, Start, one_start, prepare
from mrmission.minmax.problem import LaneTours
from mrmission.minmax.starts import MOST_STARTS, best_start, starts_within
from mrmission.model import FloatArray
from mrmission.options import PlanOptions
from mrmission.pipeline import plan


def _lay(lake: shapely.Polygon, bearing_deg: float, robots: int = 4) -> Prepared:
    options = PlanOptions(
        robots=robots, swath_m=25.0, overlap=0.0, clearance_m=0.0, method="minmax"
    )
    homes = in_a_row(lake, robots)
    return prepare(part_work(lake, homes, options, spacing_m=24.9, bearing_deg=bearing_deg))


def _lake(seed: int) -> shapely.Polygon:
    return random_lake_m(np.random.default_rng(seed), 900.0, 2)


class _Spy:
    """Keeps what each start was given and came to."""

    def __init__(self, monkeypatch: pytest.MonkeyPatch) -> None:
        self.calls: list[tuple[Prepared, float, int]] = []
        self.found: list[Start] = []
        monkeypatch.setattr(starts, "one_start", self)

    def __call__(self, ready: Prepared, budget_s: float, seed: int) -> Start:
        self.calls.append((ready, budget_s, seed))
        self.found.append(one_start(ready, budget_s, seed))
        return self.found[-1]


def test_starts_follow_from_the_budget_and_the_lines() -> None:
    assert starts_within(0.0, 100) == 1
    assert starts_within(1.24 * BUDGET_PER_LINE_S * 100, 100) == 1  # one search can use it
    assert starts_within(1.26 * BUDGET_PER_LINE_S * 100, 100) == 2
    assert starts_within(2.01 * BUDGET_PER_LINE_S * 100, 100) == 5
    assert starts_within(1e6, 100) == starts_within(1.0, 0) == MOST_STARTS
    most = [starts_within(20.0, lines) for lines in range(10, 2000)]
    assert most == sorted(most, reverse=True)
    assert most[-1] == 1


@pytest.mark.parametrize("seed", range(3))
def test_the_best_of_all_starts_is_taken(seed: int, monkeypatch: pytest.MonkeyPatch) -> None:
    lays = [_lay(_lake(seed), bearing) for bearing in (20.0, 110.0)]
    budget_s = 2.01 * BUDGET_PER_LINE_S * len(lays[0].lines)
    spy = _Spy(monkeypatch)
    best = best_start(lays, budget_s, seed)
    assert len(spy.calls) == 5
    assert best.longest_s == min(found.longest_s for found in spy.found)
    assert len({found.longest_s for found in spy.found}) > 2  # they do differ
    # the first start has all that it can use, as if it were alone
    alone = one_start(lays[0], budget_s, seed)
    assert spy.found[0].longest_s == alone.longest_s
    # every lay once, then the better of both with other seeds
    assert [call[0] for call in spy.calls[:2]] == lays
    better = min(spy.found[:2], key=lambda found: found.longest_s).ready.lines
    assert spy.calls[2][0].lines is better
    assert len({(id(ready.lines), seed) for ready, _, seed in spy.calls}) == 5
    used_s = [min(given, BUDGET_PER_LINE_S * len(ready.lines)) for ready, given, _ in spy.calls]
    assert sum(used_s) == pytest.approx(budget_s)
    assert used_s[0] == pytest.approx(budget_s / 2.01)
    # the seconds are those of the paths
    work = best.ready.work
    took_s = [work.time.duration_s(path.points_m, path.kind) for path in best.planned.paths]
    assert max(took_s) == best.longest_s
    again = best_start(lays, budget_s, seed)
    for one, other in zip(best.planned.paths, again.planned.paths, strict=True):
        assert np.array_equal(one.points_m, other.points_m)


def test_a_lay_that_only_looked_better_is_left(monkeypatch: pytest.MonkeyPatch) -> None:
    channel = shapely.box(0.0, 0.0, 1500.0, 150.0)
    across, along = (_lay(channel, bearing, robots=2) for bearing in (0.0, 90.0))
    spy = _Spy(monkeypatch)
    best = best_start([across, along], 1.51 * BUDGET_PER_LINE_S * len(across.lines), 0)
    assert best.ready.lines is along.lines
    assert [ready.lines is along.lines for ready, _, _ in spy.calls] == [False, True, True]


def test_a_small_budget_is_left_to_one_search(monkeypatch: pytest.MonkeyPatch) -> None:
    lays = [_lay(_lake(1), bearing) for bearing in (20.0, 110.0)]
    spy = _Spy(monkeypatch)
    best_start(lays, 0.5, 7)
    ((ready, budget_s, seed),) = spy.calls
    assert (ready is lays[0], budget_s, seed) == (True, 0.5, 7)


def test_trips_for_full_memories_count(monkeypatch: pytest.MonkeyPatch) -> None:
    lay = _lay(_lake(2), 20.0)
    budget_s = 1.6 * BUDGET_PER_LINE_S * len(lay.lines)
    spy = _Spy(monkeypatch)
    free = best_start([lay], budget_s, 0)

    def trips_s(ready: Prepared, tours: LaneTours) -> FloatArray:
        full = all(
            np.array_equal(one, other)
            for one, other in zip(tours.entries, free.tours.entries, strict=True)
        )
        return np.array([1e4 if full else 0.0])

    monkeypatch.setattr(starts, "more_trips_s", trips_s)
    second_s = sorted(found.longest_s for found in spy.found)[1]
    assert best_start([lay], budget_s, 0).longest_s == second_s > free.longest_s


@pytest.mark.parametrize(("budget_s", "several"), [(0.2, False), (5.0, True)])
def test_a_plan_is_searched_as_often_as_its_budget_allows(
    budget_s: float, several: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    spy = _Spy(monkeypatch)
    options = PlanOptions(
        robots=3, swath_m=25.0, clearance_m=0.0, overlap=0.0, method="minmax", fence=False,
        separation_m=0.0, time_budget_s=budget_s,
    )  # fmt: skip
    found = plan(area_of(_lake(4)), options)
    assert (len(spy.calls) > 1) == several
    best = min(spy.found, key=lambda start: start.longest_s)
    assert found.report.angle_deg == pytest.approx(best.ready.work.sweep.frame.bearing_deg)
    assert found.report.makespan_s == pytest.approx(best.longest_s, rel=0.01)
    # others were tried only where they came near, after a short search
    begun = [ready.begun.cost.max() for ready, _, _ in spy.calls if ready.begun is not None]
    assert max(begun, default=0.0) <= NEAR_BEST * min(begun, default=0.0)

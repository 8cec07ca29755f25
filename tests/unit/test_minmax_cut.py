"""Cut lanes: pieces make up their lane, and join again where one robot sweeps them in a row."""

from __future__ import annotations

import itertools
from dataclasses import replace

import numpy as np
import pytest
import shapely
from part_works import part_work

from mrmission.minmax.cut import MARGIN, MOST_LINES, cut_lines, swept_in_one_go
from mrmission.minmax.problem import LaneProblem, LaneTours, tour_cost
from mrmission.minmax.search import minmax
from mrmission.options import PlanOptions
from mrmission.tour.lines import SurveyLine
from mrmission.tour.work import PartWork

# a hall with an arm that opens in the middle of its long side
HALL = shapely.union(shapely.box(0, 0, 100, 600), shapely.box(100, 280, 300, 340))


def _work(robots: int, **options: object) -> PartWork:
    given = PlanOptions(robots=robots, swath_m=20.0, overlap=0.0, **options)  # type: ignore[arg-type]
    homes = np.array([[5.0 + 5.0 * r, 5.0] for r in range(robots)])
    return part_work(HALL, homes, given, spacing_m=19.9)


@pytest.mark.parametrize("robots", [1, 4, 12])
def test_pieces_make_up_their_lane(robots: int) -> None:
    work = _work(robots)
    pieces = cut_lines(work)
    assert len(pieces.lines) > len(work.lines)
    for i, line in enumerate(work.lines):
        mine = [pieces.lines[j] for j in np.flatnonzero(pieces.line_of == i)]
        assert all(piece.name == line.name and piece.kind is line.kind for piece in mine)
        assert sum(piece.length_m for piece in mine) == pytest.approx(line.length_m, rel=1e-12)
        assert np.array_equal(mine[0].points_m[0], line.points_m[0])
        assert np.array_equal(mine[-1].points_m[-1], line.points_m[-1])
        for a, b in itertools.pairwise(mine):
            assert np.allclose(a.points_m[-1], b.points_m[0], atol=1e-9)


def test_a_lane_is_cut_where_an_arm_opens_beside_it() -> None:
    work = _work(1)
    pieces = cut_lines(work)
    beside = [
        y
        for line in pieces.lines
        for x, y in line.points_m.tolist()
        if 80 < x < 100 and MARGIN * 20 < y < 600 - MARGIN * 20
    ]
    assert any(abs(y - 280) < 1 for y in beside)
    assert any(abs(y - 340) < 1 for y in beside)


def test_no_piece_is_too_long_a_share_with_many_robots_and_run_ins_keep_lanes_whole() -> None:
    work = _work(12)
    longest = max(line.length_m for line in cut_lines(work).lines)
    assert longest <= max(3 * work.sweep.column_pitch_m, 1200 / 16) + 1e-6
    whole = _work(12, run_in_m=5.0)
    assert cut_lines(whole).lines == whole.lines


def test_as_many_lines_as_can_be_kept(monkeypatch: pytest.MonkeyPatch) -> None:
    assert MOST_LINES >= 1000
    work = _work(4)
    monkeypatch.setattr("mrmission.minmax.cut.MOST_LINES", len(work.lines))
    assert cut_lines(work).lines == work.lines


def _pieces_problem(
    robots: int, seed: int
) -> tuple[LaneProblem, np.ndarray, tuple[SurveyLine, ...]]:
    """Parallel lanes, each cut into three pieces."""
    rng = np.random.default_rng(seed)
    lanes = 5
    foot = np.column_stack([np.arange(lanes) * 10.0, rng.uniform(-30, 30, lanes)])
    top = foot + np.column_stack([np.zeros(lanes), rng.uniform(60, 120, lanes)])
    at = np.linspace(0.0, 1.0, 4)
    ends = np.array(
        [
            (foot[i] + s * (top[i] - foot[i]), foot[i] + t * (top[i] - foot[i]))
            for i in range(lanes)
            for s, t in itertools.pairwise(at)
        ]
    ).reshape(-1, 2)
    homes = rng.uniform(-20, 60, (robots, 2))
    problem = LaneProblem(
        lane_cost=np.hypot(*(ends[::2] - ends[1::2]).T),
        end_cost=np.hypot(*(ends[:, None] - ends[None]).transpose(2, 0, 1)),
        home_cost=np.hypot(*(homes[:, None] - ends[None]).transpose(2, 0, 1)),
    )
    lines = tuple(SurveyLine(points_m=piece) for piece in ends.reshape(-1, 2, 2))
    return problem, np.repeat(np.arange(lanes), 3), lines


@pytest.mark.parametrize("seed", range(6))
def test_pieces_in_a_row_are_one_line_again_and_tours_cost_the_same(seed: int) -> None:
    problem, line_of, pieces = _pieces_problem(2, seed)
    tours = minmax(problem, 0.02, seed)
    lines, ends = swept_in_one_go(pieces, tours, line_of)
    assert problem.end_cost is not None
    joined = replace(
        problem,
        lane_cost=np.array([line.length_m for line in lines]),
        home_cost=problem.home_cost[:, ends],
        end_cost=problem.end_cost[np.ix_(ends, ends)],
    )
    whole = np.array([piece.ends_m for piece in pieces]).reshape(-1, 2)
    assert np.array_equal(whole[ends], np.array([li.ends_m for li in lines]).reshape(-1, 2))
    assert joined.lane_cost.sum() == pytest.approx(problem.lane_cost.sum(), rel=1e-12)
    first = 0
    for robot, entries in enumerate(tours.entries):
        # the joined lines of a robot follow on each other, each from its end 0
        breaks = sum(
            not (line_of[b >> 1] == line_of[a >> 1] and problem.end_cost[a ^ 1, b] < 1e-9)
            for a, b in itertools.pairwise(entries)
        )
        count = breaks + 1
        own = 2 * np.arange(first, first + count)
        assert tour_cost(joined, robot, own) == pytest.approx(tours.cost[robot], rel=1e-9)
        first += count
    assert first == len(joined.lane_cost)


def test_a_lane_swept_whole_backwards_is_one_line() -> None:
    _, line_of, pieces = _pieces_problem(1, 0)
    back = np.array([2 * i + 1 for i in (2, 1, 0)])  # the first lane from its far end
    rest = np.array([2 * i for i in range(3, 15)])
    tours = LaneTours(entries=(np.concatenate([back, rest]),), cost=np.zeros(1))
    lines, _ = swept_in_one_go(pieces, tours, line_of)
    assert len(lines) == 5


@pytest.mark.parametrize("seed", range(3))
def test_cutting_saves_the_way_back_from_an_arm(seed: int) -> None:
    problem, *_ = _pieces_problem(2, seed)
    whole_of = np.arange(0, 30, 6)
    ends = np.stack([whole_of, whole_of + 5], axis=1).ravel()
    assert problem.end_cost is not None
    whole = LaneProblem(
        lane_cost=problem.lane_cost.reshape(-1, 3).sum(axis=1),
        end_cost=problem.end_cost[np.ix_(ends, ends)],
        home_cost=problem.home_cost[:, ends],
    )
    cut = min(minmax(problem, 0.2, s).cost.max() for s in range(3))
    uncut = min(minmax(whole, 0.1, s).cost.max() for s in range(3))
    assert cut <= uncut * 1.001

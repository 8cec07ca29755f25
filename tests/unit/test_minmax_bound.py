"""The bound for chosen lines is never above the optimum, and each of its terms shows."""

from __future__ import annotations

import numpy as np
import pytest
import shapely

from mrmission.minmax.bounds import lanes as bounds
from mrmission.minmax.bounds import parts
from mrmission.minmax.bounds.few_lines import few_lines_makespan
from mrmission.minmax.bounds.lanes import divisible_bound, lanes_bound, many_lanes_bound
from mrmission.minmax.search import LaneProblem, minmax
from mrmission.model import FloatArray
from mrmission.routing.water import WaterRouter
from tests.best_tours import best_makespan

pytestmark = pytest.mark.usefixtures("not_every_order")


def _open_water(rng: np.random.Generator, lines: int, robots: int) -> tuple[FloatArray, ...]:
    kind = rng.integers(3)
    foot = rng.uniform(0, 100, (lines, 2))
    if kind == 0:  # anyhow
        tip = foot + rng.uniform(-60, 60, (lines, 2))
    elif kind == 1:  # side by side
        foot[:, 0] = 10.0 * np.arange(lines)
        tip = foot + np.array([0.0, 1.0]) * rng.uniform(1, 80, (lines, 1))
    else:  # short and far apart
        tip = foot + rng.uniform(-2, 2, (lines, 2))
    ends = np.stack([foot, tip], axis=1).reshape(-1, 2)
    homes = np.tile(rng.uniform(-80, 180, 2), (robots, 1))
    if rng.integers(2):
        homes = rng.uniform(-80, 180, (robots, 2))
    line = np.hypot(*(ends[1::2] - ends[::2]).T)
    end = np.hypot(*(ends[:, None] - ends[None]).transpose(2, 0, 1))
    home = np.hypot(*(homes[:, None] - ends[None]).transpose(2, 0, 1))
    return line, end, home


def _with_walls(rng: np.random.Generator, lines: int, robots: int) -> tuple[FloatArray, ...]:
    """Lanes side by side in a pool with two walls from either side, so that ways are long."""
    a, b = np.sort(rng.uniform(15, 85, 2))
    pool = shapely.box(0, 0, 100, 60)
    pool = pool - shapely.box(a, 0, a + 2, rng.uniform(20, 55))
    pool = pool - shapely.box(b + 4, rng.uniform(5, 40), b + 6, 60)
    ends: list[FloatArray] = []
    while len(ends) < lines:
        x = rng.uniform(1, 99)
        column = shapely.LineString([(x, 0), (x, 60)]) & pool
        part = rng.choice(shapely.get_parts(column))
        if part.length > 1:
            ends.append(shapely.get_coordinates(part))
    flat = np.concatenate(ends)
    home = shapely.get_coordinates(shapely.Point(1.0, 30.0))
    router = WaterRouter(pool)
    return (
        np.hypot(*(flat[1::2] - flat[::2]).T),
        router.distance_matrix(flat),
        np.repeat(router.distances(home, flat), robots, axis=0),
    )


@pytest.fixture
def _with_prices(monkeypatch: pytest.MonkeyPatch) -> None:
    """Let few tours be bounded by prices as well: what is brute-forced has few."""
    monkeypatch.setattr(bounds, "FEW_TOURS", 0)


@pytest.mark.usefixtures("_with_prices")
def test_never_above_the_optimum() -> None:
    rng = np.random.default_rng(4)
    terms: dict[str, int] = {}
    tight = []
    for case in range(240):
        lines, robots = int(rng.integers(1, 12 if case % 4 == 0 else 7)), int(rng.integers(1, 5))
        make = _with_walls if case % 3 == 2 else _open_water
        line, end, home = make(rng, lines, robots)
        best = few_lines_makespan(line, end, home, (np.ones(robots), np.ones(robots)))
        bound = lanes_bound(line_s=line, end_s=end, home_s=home)
        assert bound.makespan_s <= best * (1 + 1e-9), f"case {case}"
        terms[bound.term] = terms.get(bound.term, 0) + 1
        tight.append(bound.makespan_s / best)
    assert len(terms) >= 3, terms
    assert np.mean(tight) > 0.9


def test_few_tours_are_bounded_by_arms_alone(monkeypatch: pytest.MonkeyPatch) -> None:
    rng = np.random.default_rng(6)
    line, end, home = _open_water(rng, 9, 5)
    asked = []
    monkeypatch.setattr(bounds, "prices_makespan", lambda *args: asked.append(args) or (0.0, True))
    for robots in (2, bounds.FEW_TOURS, bounds.FEW_TOURS + 1):
        lanes_bound(line_s=line, end_s=end, home_s=home[:robots])
    assert len(asked) == 1


def test_many_lines_are_bounded_by_arms_alone(monkeypatch: pytest.MonkeyPatch) -> None:
    rng = np.random.default_rng(11)
    asked = []
    monkeypatch.setattr(bounds, "prices_makespan", lambda *args: asked.append(args) or (0.0, True))
    monkeypatch.setattr(parts, "MANY_LINES", 8)
    for case in range(40):
        line, end, home = (_with_walls, _open_water)[case % 2](rng, 9, 5 + case % 3)
        robots = len(home)
        best = few_lines_makespan(line, end, home, (np.ones(robots), np.ones(robots)))
        bound = lanes_bound(line_s=line, end_s=end, home_s=home)
        assert 0.6 * best < bound.makespan_s <= best * (1 + 1e-9), f"case {case}"
    assert not asked


@pytest.mark.usefixtures("_with_prices")
def test_never_above_the_optimum_of_unlike_robots_and_any_numbers() -> None:
    rng = np.random.default_rng(8)
    for case in range(60):
        lines, robots = int(rng.integers(1, 9)), int(rng.integers(1, 5))
        line, end, home = _open_water(rng, lines, robots)
        if case % 2:  # the numbers need not be distances
            end = rng.uniform(0, 60, (2 * lines, 2 * lines))
            end = np.minimum(end, end.T)
            home = rng.uniform(0, 60, (robots, 2 * lines))
        sweep, travel = rng.uniform(0.5, 3, (2, robots))
        own = travel[:, None] * home
        best = few_lines_makespan(line, end, own, (sweep, travel))
        bound = lanes_bound(
            line_s=line, end_s=end, home_s=own, sweep_scale=sweep, travel_scale=travel
        )
        assert bound.makespan_s <= best * (1 + 1e-9), f"case {case}"


@pytest.mark.usefixtures("_with_prices")
@pytest.mark.parametrize("seed", range(3))
def test_below_what_the_search_finds(seed: int) -> None:
    rng = np.random.default_rng(50 + seed)
    lines = 60
    foot = np.stack([7.0 * rng.integers(0, 30, lines), rng.uniform(0, 300, lines)], axis=1)
    ends = np.stack([foot, foot + [[0.0, 1.0]] * rng.uniform(5, 120, (lines, 1))], axis=1)
    flat = ends.reshape(-1, 2)
    end = np.hypot(*(flat[:, None] - flat[None]).transpose(2, 0, 1))
    home = np.hypot(*(flat - rng.uniform(0, 200, 2)).T)
    line = np.hypot(*(flat[1::2] - flat[::2]).T)
    for robots in (2, 6):
        homes = np.tile(home, (robots, 1))
        problem = LaneProblem(lane_cost=line, end_cost=end, home_cost=homes)
        found = minmax(problem, 0.3, seed).cost.max()
        bound = lanes_bound(line_s=line, end_s=end, home_s=homes)
        assert 0.85 * found < bound.makespan_s <= found * (1 + 1e-9)
        apart = end.copy()
        np.fill_diagonal(apart, np.inf)
        near = np.argsort(apart, axis=1, kind="stable")[:, 1:9]
        far = many_lanes_bound(
            line_s=line, ends_m=2 * flat, near=near, speed_m_s=2.0, slack_s=0.0, home_s=homes
        )
        assert 0.85 * found < far.makespan_s <= found * (1 + 1e-9)
        assert far.term.endswith("as the crow flies")
        cut = divisible_bound(line_s=line, home_s=home, nearest_s=apart.min(axis=1), robots=robots)
        assert cut.makespan_s <= found


def _parallel(lines: int, robots: int, length: float, off: float) -> tuple[FloatArray, ...]:
    """Lines of one length at unit spacing, home at the foot of the first or some way off it."""
    x = np.arange(lines, dtype=np.float64)
    flat = np.stack([np.repeat(x, 2), np.tile([0.0, length], lines)], axis=1)
    end = np.hypot(*(flat[:, None] - flat[None]).transpose(2, 0, 1))
    home = np.hypot(*(flat - [-off, 0.0]).T)
    return np.full(lines, length), end, np.tile(home, (robots, 1))


@pytest.mark.parametrize(
    ("lines", "robots", "length", "off", "term"),
    [
        (1, 1, 10.0, 0.0, "farthest line"),
        (3, 3, 1.0, 50.0, "farthest line"),
        (12, 1, 10.0, 0.0, "connection"),
        (24, 4, 10.0, 30.0, "arms and connection"),
    ],
)
def test_each_term_where_it_counts(
    lines: int, robots: int, length: float, off: float, term: str
) -> None:
    line, end, home = _parallel(lines, robots, length, off)
    bound = lanes_bound(line_s=line, end_s=end, home_s=home)
    assert bound.term.endswith(term)


def test_lines_on_top_of_each_other_are_work_shared_out() -> None:
    bound = lanes_bound(line_s=np.full(6, 5.0), end_s=np.zeros((12, 12)), home_s=np.zeros((3, 12)))
    assert bound.term == "work shared out"
    assert bound.makespan_s == pytest.approx(10.0)


def test_a_row_of_lines_is_known_nearly_exactly() -> None:
    # out on every other line and back on the others, or to and fro and home: 2 · 11 either way
    line, end, home = _parallel(12, 1, 10.0, 0.0)
    bound = lanes_bound(line_s=line, end_s=end, home_s=home)
    assert bound.makespan_s == pytest.approx(120 + 22, rel=0.015)


def test_nothing_to_do_takes_no_time() -> None:
    empty = lanes_bound(line_s=np.zeros(0), end_s=np.zeros((0, 0)), home_s=np.zeros((2, 0)))
    assert empty.makespan_s == 0.0


def test_lines_cut_anywhere() -> None:
    rng = np.random.default_rng(2)
    for case in range(40):
        lines, robots = int(rng.integers(1, 4)), int(rng.integers(1, 4))
        line, end, home = _open_water(rng, lines, 1)
        homes = np.repeat(home, robots, axis=0)
        apart = end.copy()
        np.fill_diagonal(apart, np.inf)
        bound = divisible_bound(
            line_s=line, home_s=home[0], nearest_s=apart.min(axis=1), robots=robots
        )
        assert bound.makespan_s <= best_makespan(line, end, homes) * (1 + 1e-9), f"case {case}"

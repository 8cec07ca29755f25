"""With a turn radius the bound for chosen lines is never above what any order of them takes.

Every order and direction of few lanes is turned as an exported path is, and timed.
"""

from __future__ import annotations

from itertools import combinations, pairwise, permutations, product

import numpy as np
import pytest
import shapely

from mrmission.minmax import costs as costs_module
from mrmission.minmax.bounds.lanes import lanes_bound
from mrmission.minmax.hooks import no_hooks
from mrmission.minmax.least import least_costs
from mrmission.minmax.problem import LaneProblem
from mrmission.minmax.search import tour_cost
from mrmission.model import CoveragePath, FloatArray
from mrmission.routing.harbour import Harbour
from mrmission.tour.lines import SurveyLine
from mrmission.tour.manoeuvre import Waters
from mrmission.tour.path import assemble_paths, make_path
from mrmission.tour.timing import TimeModel
from mrmission.tour.turning import round_transits

SWATH_M = 20.0


class Pool:
    """A few lanes in a rectangle of water, and what every way over them takes."""

    def __init__(self, rng: np.random.Generator, lanes: int, robots: int) -> None:
        side = float(rng.uniform(80, 200))
        radius_m = float(rng.choice([rng.uniform(0.3, 2), rng.uniform(2, 9)]))
        longest = float(rng.choice([4.0, 9.0])) * radius_m  # of lanes that hardly hold two turns
        kind = rng.integers(4)
        foot = rng.uniform(5, side - 5, (lanes, 2))
        if kind == 0:  # anyhow
            tip = foot + rng.uniform(-60, 60, (lanes, 2))
        elif kind == 1:  # side by side from shore to shore, or nearly
            foot[:, 0] = side * (0.5 + np.arange(lanes)) / lanes
            foot[:, 1] = rng.uniform(0, 0.2 * side, lanes)
            tip = np.column_stack([foot[:, 0], rng.uniform(0.6 * side, side, lanes)])
        elif kind == 2:  # one begins before the other ends: turns may leave out all that is double
            up = lanes - 1
            long = rng.uniform(9, 20) * radius_m
            foot = np.full((lanes, 2), 15.0)
            foot[1:up, 0] += rng.uniform(0.01, 0.3, up - 1).cumsum() * radius_m
            foot[1:up, 1] += (long - rng.uniform(3.5, 4.1, up - 1) * radius_m).cumsum()
            tip = foot + np.array([0.0, long])
            foot[up, 0] += rng.uniform(1.8, 2.5) * radius_m
            tip[up] = foot[up]
            foot[up, 1] = tip[up - 1, 1]
        else:  # beside and beyond each other, a step apart that is less than a turn
            foot = np.array([side / 3, 5.0]) + rng.uniform(0, longest, (lanes, 2))
            tip = foot + [0.0, 1.0] * rng.uniform(1.1 * radius_m, longest, (lanes, 1))
        if kind != 2:
            tip = np.clip(tip, 0.5, side - 0.5)
        step = tip - foot
        length = np.hypot(*step.T)[:, None]
        short = length < 1.05 * radius_m  # not lined up with: see the last test
        tip = np.where(short, foot + 1.05 * radius_m * step / length, tip)
        self.lines = tuple(SurveyLine(points_m=np.array(ab)) for ab in zip(foot, tip, strict=True))
        # home beside a lane, where a turn that begins early comes by
        home = foot[0] + rng.uniform(0, 1) * (tip[0] - foot[0]) + rng.uniform(-4, 4, 2)
        if kind == 2:
            home = foot[0] + [0.0, rng.uniform(1.5, 2.0) * radius_m]
        home = np.maximum(home, 1)
        speed = float(rng.choice([1.5, 2.0, 3.0]))
        self.time = TimeModel(
            survey_speed_m_s=speed,
            transit_speed_m_s=speed * float(rng.choice([1.0, 1.0, 1.5, 0.8])),
            steering=str(rng.choice(["steered", "pivoting"])),
            swath_m=SWATH_M,
            turn_radius_m=radius_m,
        )
        self.homes_m = np.repeat(home[None], robots, axis=0)
        ends = np.concatenate([foot, tip, home[None]])
        low, high = (
            np.minimum(ends.min(axis=0) - 0.5, 0.0),
            np.maximum(ends.max(axis=0) + 0.5, side),
        )
        self.harbour = Harbour(shapely.box(*low, *high), self.homes_m)
        self.waters = Waters(self.harbour, 0, radius_m, self.time.radius_m)

    def least(self) -> LaneProblem:
        """What the bound is told."""
        ends = np.array([line.ends_m for line in self.lines]).reshape(-1, 2)
        return least_costs(
            self.lines, no_hooks(len(ends)), self.harbour, self.homes_m,
            (self.time,) * len(self.homes_m), self.harbour.distance_matrix(ends),
            lanes_alone=False,
        )  # fmt: skip

    def turned(self, entries: list[int]) -> CoveragePath:
        """The path over lanes entered at these ends, as it is exported."""
        (path, *_) = assemble_paths(
            self.harbour, [[self.lines[e >> 1].way(e & 1) for e in entries]]
        )
        return round_transits(path, self.waters, SWATH_M)[0]

    def seconds(self, path: CoveragePath) -> float:
        return self.time.duration_s(path.points_m, path.kind)


def orders(lanes: tuple[int, ...]) -> list[list[int]]:
    """Every order and direction of lanes, as the ends at which they are entered."""
    return [
        [2 * lane + side for lane, side in zip(order, sides, strict=True)]
        for order in permutations(lanes)
        for sides in product((0, 1), repeat=len(lanes))
    ]


def ways_of(pool: Pool) -> dict[tuple[int, int], FloatArray]:
    """Every way as it is turned, from the middle of a lane to that of the next; -1 is home.

    A gap between two long lanes is filled whatever comes before and after it. So one path over all
    pairs of directed lanes has all the ways, and the tours of all orders are made of them.
    """
    ends = range(2 * len(pool.lines))
    after = {e: [f for f in ends if f >> 1 != e >> 1] for e in ends}
    # an Euler circuit over all pairs
    stack, circuit = [0], []
    while stack:
        if after[stack[-1]]:
            stack.append(after[stack[-1]].pop())
        else:
            circuit.append(stack.pop())
    circuit.reverse()
    found: dict[tuple[int, int], FloatArray] = {}
    for entries in [circuit, *([e] for e in ends)]:
        halves = _cut_in_middles(pool, pool.turned(entries))
        pairs = list(pairwise([-1, *entries, -1]))
        if entries is circuit:  # homeward ways come from the short ones
            halves, pairs = halves[1:-1], pairs[1:-1]
        found.update(zip(pairs, halves, strict=True))
    return found


def _cut_in_middles(pool: Pool, path: CoveragePath) -> list[FloatArray]:
    """The path in rows of (east, north, kind of the leg behind it), cut where lanes are half."""
    rows = np.column_stack([path.points_m, [*path.kind.tolist(), 0]])
    out, begin = [], 0
    rows_out: list[list[float]] = []
    for i in range(len(path.kind)):
        rows_out.append(rows[i].tolist())
        if path.lane[i] == 0 or (i + 1 < len(path.lane) and path.lane[i + 1] == path.lane[i]):
            continue
        middle = (path.points_m[i] + path.points_m[i + 1]) / 2
        row = [*middle.tolist(), float(path.kind[i])]
        out.append(np.array([*rows_out[begin:], row]))
        rows_out, begin = [row], 0
    out.append(np.array([*rows_out, rows[-1].tolist()]))
    return out


def joined_seconds(
    pool: Pool, ways: dict[tuple[int, int], FloatArray], entries: list[int]
) -> float:
    """What a tour takes that is made of these ways; the middles of lanes are no points of it."""
    pieces = [ways[pair] for pair in pairwise([-1, *entries, -1])]
    rows = np.concatenate([pieces[0][:-1], *(piece[1:-1] for piece in pieces[1:])])
    last = pieces[-1][-1:]
    path = make_path(1, np.concatenate([rows, last])[:, :2], rows[:, 2].astype(int).tolist(),
                     [0] * len(rows))  # fmt: skip
    return pool.seconds(path)


def best_makespan(
    pool: Pool, ways: dict[tuple[int, int], FloatArray], least: LaneProblem
) -> tuple[float, float]:
    """The shortest longest tour of all, and how far its ways are from it as it is turned whole.

    No tour takes less than the least of its parts.
    """
    lanes, robots = len(pool.lines), len(pool.homes_m)
    tours: dict[tuple[int, ...], tuple[float, list[int]]] = {(): (0.0, [])}
    for size in range(lanes if robots == 1 else 1, lanes + 1):
        for some in combinations(range(lanes), size):
            for entries in orders(some):
                takes = joined_seconds(pool, ways, entries)
                assert tour_cost(least, 0, np.array(entries)) <= takes + 1e-6
                tours[some] = min((takes, entries), tours.get(some, (np.inf, [])))
    everything = tuple(range(lanes))
    shares = [((), everything)]
    if robots == 2:
        shares = [(a, tuple(x for x in everything if x not in a)) for a in tours]
    longest = {pair: max(tours[mine][0] for mine in pair) for pair in shares}
    pair = min(shares, key=lambda pair: longest[pair])
    whole = max(pool.seconds(pool.turned(tours[mine][1])) for mine in pair if mine)
    return min(longest[pair], whole), abs(longest[pair] / whole - 1)


def assert_below(least: LaneProblem, best: float) -> float:
    assert least.end_cost is not None
    bound = lanes_bound(line_s=least.lane_cost, end_s=least.end_cost, home_s=least.home_cost)
    assert bound.makespan_s <= best * (1 + 1e-9)
    return bound.makespan_s / best


def test_never_above_the_best_of_all_turned_tours(monkeypatch: pytest.MonkeyPatch) -> None:
    rng = np.random.default_rng(12)
    tight, apart = [], []
    for case in range(40):
        lanes, robots = (4, 1) if case % 10 == 0 else (3, 1 + case % 2)
        pool = Pool(rng, lanes, robots)
        # ways between ends that are not near each other, too
        monkeypatch.setattr(costs_module, "NEAR", 2 if case % 3 == 0 else 12)
        least = pool.least()
        best, off = best_makespan(pool, ways_of(pool), least)
        tight.append(assert_below(least, best))
        apart.append(off)
    assert np.mean(tight) > 0.5
    # but where a lane holds no two corners, and a turn hangs on the one before
    assert np.mean(np.array(apart) < 1e-3) > 0.8


def test_never_above_the_best_of_lanes_too_short_to_line_up_with() -> None:
    rng = np.random.default_rng(3)
    for _ in range(4):
        pool = Pool(rng, 2, 1)
        short = pool.lines[1].points_m
        unit = (short[1] - short[0]) / np.hypot(*(short[1] - short[0]))
        end = short[0] + 0.8 * pool.time.turn_radius_m * unit
        pool.lines = (pool.lines[0], SurveyLine(points_m=np.array([short[0], end])))
        assert_below(pool.least(), min(pool.seconds(pool.turned(e)) for e in orders((0, 1))))

"""The bound that counts tours into arms: true whatever proves it, sharp where there are arms."""

from __future__ import annotations

import numpy as np
import pytest

from mrmission.minmax.bounds import arms_kernels as kernels
from mrmission.minmax.bounds import prices
from mrmission.minmax.bounds.arms import _inside, arms_makespan
from mrmission.minmax.bounds.lanes import lanes_bound
from mrmission.minmax.bounds.parts import Covers, Task, near_ends, near_legs
from mrmission.minmax.bounds.tree import FINEST, Arms, arms_of
from mrmission.model import FloatArray, IntArray
from tests.best_tours import best_makespan

pytestmark = pytest.mark.usefixtures("not_every_order")


def _task(line: FloatArray, end: FloatArray, home: FloatArray) -> Task:
    robots = len(home)
    return Task(float(robots), robots, line, home.min(axis=0), end, np.zeros((0, 2)), 0.0)


def _anyhow(rng: np.random.Generator, lines: int, robots: int) -> tuple[FloatArray, ...]:
    """Numbers that need be no distances."""
    end = rng.uniform(0, 60, (2 * lines, 2 * lines))
    return (
        rng.uniform(0, 40, lines),
        np.minimum(end, end.T),
        np.tile(rng.uniform(0, 90, 2 * lines), (robots, 1)),
    )


def _star(
    arms: int, lines: int, robots: int, deep: float, line: float = 12.0
) -> tuple[FloatArray, ...]:
    """Arms of equal length from home, at the end of each as many lines, a second apart."""
    arm = np.repeat(np.arange(arms), 2 * lines)
    end = np.where(arm[:, None] == arm[None], 1.0, 2 * deep)
    return (
        np.full(arms * lines, line),
        end,
        np.full((robots, 2 * arms * lines), deep),
    )


def _any_tree(rng: np.random.Generator, ends: int) -> tuple[IntArray, IntArray]:
    """A random tree, and where the ends sit."""
    nodes = int(rng.integers(2, 9))
    above = np.array([0, *(rng.integers(0, v) for v in range(1, nodes))], dtype=np.int64)
    return above, rng.integers(0, nodes, ends).astype(np.int64)


def _beyond(above: IntArray, v: int, edge: int) -> bool:
    while v > edge:
        v = int(above[v])
    return v == edge


def _meet(above: IntArray) -> IntArray:
    def way(v: int) -> list[int]:
        return [v] if v == 0 else [v, *way(int(above[v]))]

    nodes = len(above)
    return np.array(
        [[next(u for u in way(a) if u in way(b)) for b in range(nodes)] for a in range(nodes)],
        dtype=np.int64,
    )


def _crossed(above: IntArray, node: IntArray) -> IntArray:
    count = [
        sum(_beyond(above, a, e) != _beyond(above, b, e) for a, b in node.reshape(-1, 2).tolist())
        for e in range(len(above))
    ]
    count[0] = 0
    return np.array([c + c % 2 for c in count], dtype=np.int64)


def test_a_toll_counts_where_all_ends_of_its_set_are_beyond() -> None:
    rng = np.random.default_rng(3)
    apart = 0
    for _ in range(100):
        above, node = _any_tree(rng, 12)
        meet = _meet(above)
        arms = Arms(
            above=above, length=np.ones(len(above)), node=node, meet=meet,
            crossed=_crossed(above, node),
        )  # fmt: skip
        sets = [np.sort(rng.permutation(12)[:size]) for size in (1, 3, 5, 3)]
        covers = Covers(
            np.cumsum([0, *map(len, sets)]).astype(np.int64),
            np.concatenate(sets),
            np.ones(len(sets)),
        )
        for mine, found in zip(sets, _inside(covers, arms).tolist(), strict=True):
            with_all = [
                v for v in range(len(above)) if all(_beyond(above, int(node[a]), v) for a in mine)
            ]
            assert found == max(with_all, default=0)
            apart += found not in node[mine]
    assert apart > 20


def test_true_for_any_tree_charges_and_tolls() -> None:
    """What is not found by climbing but made up proves nothing false, with trips neither."""
    rng = np.random.default_rng(12)
    told = told_of_trips = 0
    for case in range(600):
        lines, robots = int(rng.integers(1, 5)), int(rng.integers(1, 4))
        if case % 2:
            line, end, home = _anyhow(rng, lines, robots)
        else:
            line, end, home = _star(2, max(1, lines // 2), robots, float(rng.uniform(0, 60)))
        ends = end.shape[0]
        above, node = _any_tree(rng, ends)
        length = rng.uniform(0, 30, len(above))
        for v in range(len(above)):  # nobody goes where nothing is
            if v == 0 or not any(_beyond(above, int(a), v) for a in node):
                length[v] = 0.0
        meet = _meet(above)
        sets = [
            np.sort(rng.permutation(ends)[: rng.choice([s for s in (1, 3, 5) if s <= ends])])
            for _ in range(int(rng.integers(0, 4)))
        ]
        inside = []
        for mine in sets:
            at = int(node[mine[0]])
            for a in mine:
                at = int(meet[at, node[a]])
            inside.append(at)
        charge = rng.uniform(-20, 30, ends)
        toll = rng.uniform(0, 15, len(sets))
        best = best_makespan(line, end, home)
        trip, swap = best * float(rng.uniform(0.4, 1.1)), float(rng.uniform(0, 20))
        each = np.ones(robots)
        best_of_trips = best_makespan(line, end, home, trip=trip * each, swap=swap * each)
        for limits, least in (((np.inf, 0.0), best), ((trip, swap), best_of_trips)):
            found = kernels.proven(
                (float(robots), float(robots), *limits),
                line,
                end,
                home.min(axis=0),
                (
                    np.cumsum([0, *map(len, sets)]).astype(np.int64),
                    np.array([a for mine in sets for a in mine], dtype=np.int64),
                ),
                np.array(inside, dtype=np.int64),
                (above, node, meet, _crossed(above, node)),
                charge.copy(),
                length,
                toll,
                np.zeros((2 * ends, 2), dtype=np.int64),
            )
            assert found <= least * (1 + 1e-9), f"case {case}, {limits}"
            told += least == best and found > 0.5 * best
            told_of_trips += least > best and found > 0.5 * least
    # most made up proofs are weak, not all
    assert told > 40
    assert told_of_trips > 5


@pytest.mark.parametrize(("arms", "lines", "robots"), [(2, 3, 3), (3, 2, 3), (2, 2, 3), (3, 2, 5)])
def test_whole_tours_go_into_arms(arms: int, lines: int, robots: int) -> None:
    """A tour and a fifth for each of two arms are more than three tours."""
    line, end, home = _star(arms, lines, robots, 50.0)
    best = best_makespan(line, end, home)
    whole = arms_makespan(_task(line, end, home), near_legs(near_ends(end), _task(line, end, home)))
    assert 0.96 * best < whole <= best * (1 + 1e-9)
    found = lanes_bound(line_s=line, end_s=end, home_s=home)
    assert found.makespan_s >= whole * (1 - 1e-8)


def test_parts_of_tours_do_not_know_that() -> None:
    line, end, home = _star(2, 3, 3, 50.0)
    task = _task(line, end, home)
    legs = near_legs(near_ends(end), task)
    in_parts = prices.prices_makespan(task, legs, prices.SHARES)[0]
    assert arms_makespan(task, legs) > 1.05 * in_parts


def test_the_tree_keeps_no_ends_farther_apart_than_the_water_does() -> None:
    rng = np.random.default_rng(5)
    for lines in (1, 2, 9, 40):
        ends = rng.uniform(0, 100, (2 * lines, 2))
        end = np.hypot(*(ends[:, None] - ends[None]).transpose(2, 0, 1))
        home = np.hypot(*(ends - [50.0, -20.0]).T)[None]
        line = np.hypot(*(ends[1::2] - ends[::2]).T)
        for share in (0.0, 0.5, 1.0):
            tree = arms_of(_task(line, end, home), share, 1.0)
            height = kernels.heights(tree.above, tree.length)
            at = tree.node
            apart = height[at][:, None] + height[at][None] - 2 * height[tree.meet[at][:, at]]
            # nodes that are left out may move a meeting a little
            assert (apart <= end + 2 * FINEST * home.max()).all()
            assert (height[at] <= home[0] + 1e-9).all()
            assert lines < 40 or apart.max() > 10
            assert (tree.above[1:] < np.arange(1, len(tree.above))).all()
            assert (tree.meet == _meet(tree.above)).all()
            assert (tree.crossed == _crossed(tree.above, at)).all()

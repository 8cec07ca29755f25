"""The tours that the search begins with: one tour over all lines, cut where that is best."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import numpy.typing as npt
from numba import njit

from mrmission.minmax.problem import LaneProblem
from mrmission.model import FloatArray, IntArray

BISECTIONS = 60


def giant_tour(problem: LaneProblem) -> IntArray:
    """Return entry ends of all lines, each line the nearest to where the one before ends.

    Without a matrix only listed near ends are looked at; where none of them is left, the next line
    by number follows.
    """
    if problem.end_cost is not None:
        return _nearest_of_all(problem.end_cost, int(np.argmin(problem.home_cost[0])))
    assert problem.sparse is not None  # one of both is given
    return _nearest_of_listed(problem.sparse.near, int(np.argmin(problem.home_cost[0])))


def _nearest_of_all(end_cost: FloatArray, at: int) -> IntArray:
    left = np.ones(len(end_cost), dtype=bool)
    out = []
    while True:
        out.append(at)
        left[at] = left[at ^ 1] = False
        if not left.any():
            return np.array(out, dtype=np.int64)
        away = np.where(left, end_cost[at ^ 1], np.inf)
        at = int(np.argmin(away))


def _nearest_of_listed(near: npt.NDArray[np.int32], at: int) -> IntArray:
    lines = len(near) // 2
    left = [True] * lines
    listed = near.tolist()
    out, lowest = [at], 0
    left[at >> 1] = False
    while len(out) < lines:
        following = next((f for f in listed[at ^ 1] if left[f >> 1]), None)
        if following is None:
            while not left[lowest]:
                lowest += 1
            following = 2 * lowest
        at = following
        left[at >> 1] = False
        out.append(at)
    return np.array(out, dtype=np.int64)


def split_tour(
    problem: LaneProblem, order: IntArray
) -> tuple[npt.NDArray[np.int32], npt.NDArray[np.int32]]:
    """Cut a tour over all lines into a piece for each robot, the costliest as cheap as can be.

    Returns
    -------
    routes : (robots, lines) array
        Entry ends of each robot's lines, filled up with zeros.
    sizes : (robots,) array
        How many there are.
    """
    lines, robots = len(order), problem.robots
    sweep, travel = problem.scales()
    exits = order ^ 1
    swept = np.append(0.0, np.cumsum(problem.lane_cost[order >> 1]))
    gone = np.append(0.0, np.cumsum(problem.ways(exits[:-1], order[1:])))
    out_s, back_s = problem.home_cost[:, order], problem.home_cost[:, exits]
    most = sweep.max() * swept[-1] + travel.max() * gone[-1] + 2 * problem.home_cost.max()
    borders = _even_borders(swept, gone, out_s, back_s, sweep, travel, float(most))
    routes = np.zeros((robots, lines), dtype=np.int32)
    sizes = np.zeros(robots, dtype=np.int32)
    for r, (a, b) in enumerate(pairwise(borders.tolist())):
        routes[r, : b - a] = order[a:b]
        sizes[r] = b - a
    _put_idle_to_work(routes, sizes)
    return routes, sizes


@njit(cache=True, error_model="numpy")
def _even_borders(  # type: ignore[no-untyped-def]
    swept, gone, out_s, back_s, sweep, travel, most
):
    """Return where pieces begin and the last one ends; the costliest costs little above the least.

    ``swept`` and ``gone`` are the costs of the lines before each line, and of the ways before it,
    unscaled.
    """
    robots, lines = out_s.shape
    borders, tried = np.array([0, lines]), np.zeros(robots + 1, np.int64)
    low, high = 0.0, most
    for turn in range(BISECTIONS + 1):
        limit = (low + high) / 2 if turn < BISECTIONS else high
        count, a = 0, 0
        while a < lines and count < robots:
            r, first = count, a
            while a < lines and (
                sweep[r] * (swept[a + 1] - swept[first]) + travel[r] * (gone[a] - gone[first])
                + out_s[r, first] + back_s[r, a] <= limit
            ):  # fmt: skip
                a += 1
            count += 1
            tried[count] = a
        if a < lines:
            low = limit
        else:
            high = limit
            borders = tried[: count + 1].copy()
    return borders


def _put_idle_to_work(routes: npt.NDArray[np.int32], sizes: npt.NDArray[np.int32]) -> None:
    """Give every robot without lines half of those of the robot with most, in place."""
    for idle in np.flatnonzero(sizes == 0).tolist():
        rich = int(np.argmax(sizes))
        keep = int(sizes[rich]) - int(sizes[rich]) // 2
        given = int(sizes[rich]) - keep
        if given == 0:
            return
        routes[idle, :given] = routes[rich, keep : sizes[rich]]
        sizes[idle], sizes[rich] = given, keep

"""Splitting one closed tour into k pieces (Frederickson, Hecht, Kim 1978)."""

from __future__ import annotations

import numpy as np

from mrmission.model import FloatArray


def longest_round_trip(step_cost: FloatArray, distance: FloatArray) -> float:
    """Return s_max: half of the costliest trip to one step of the tour, along it and back.

    ``s_max = ½ · max(d(u) + w(e) + d(v))`` over the steps e = (u, v). The paper prints it without
    the ½; with it, as here, the proof of Frederickson et al. holds.

    Parameters
    ----------
    step_cost
        (n,) cost of each step.
    distance
        (n + 1,) travel cost from the depot to the vertex before each step, and after the last.
    """
    if len(step_cost) == 0:
        return 0.0
    return 0.5 * float(np.max(distance[:-1] + step_cost + distance[1:]))


def frederickson_split(
    step_cost: FloatArray, distance: FloatArray, pieces: int, *, s_max: float | None = None
) -> list[int]:
    """Return the ``pieces + 1`` borders of the split: piece j is steps ``border[j]:border[j+1]``.

    The j-th border is at ``L_j = (j/k)(c(R) − 2·s_max) + s_max`` along the tour. With v' the last
    vertex whose prefix cost is at most L_j and r what is left, the tour is cut at v' when
    ``r + d(v') <= w(v', v'+1) − r + d(v'+1)``, otherwise at v'+1. `s_max` is the
    :func:`longest_round_trip` unless another reading of it is given.

    References
    ----------
    G. N. Frederickson, M. S. Hecht, C. E. Kim, "Approximation algorithms for some routing
    problems", SIAM J. Comput. 7(2), 1978.
    """
    n = len(step_cost)
    prefix = np.concatenate([[0.0], np.cumsum(step_cost)])
    if s_max is None:
        s_max = longest_round_trip(step_cost, distance)
    borders = [0]
    for j in range(1, pieces):
        goal = max(0.0, j / pieces * (prefix[-1] - 2 * s_max) + s_max)
        v = min(int(np.searchsorted(prefix, goal, side="right")) - 1, n)
        if v < n:
            rest = goal - prefix[v]
            if rest + distance[v] > step_cost[v] - rest + distance[v + 1]:
                v += 1
        borders.append(max(v, borders[-1]))
    borders.append(n)
    return borders

"""NRC: the naive baseline, the tour cut into equal parts."""

from __future__ import annotations

from itertools import pairwise

import numpy as np

from mrmission.partition.problem import Assignment, CoverageProblem, visits_of


def nrc(problem: CoverageProblem, robots: int) -> Assignment:
    """Cut the single-robot tour at the vertices where each robot first has its equal share.

    Reading taken: a robot's piece ends with the step that brings the prefix cost to ``j/k`` of the
    whole or beyond (the alternative stops short of it), and the last robot gets the remainder.

    References
    ----------
    Karapetyan et al. 2017, section V.
    """
    tour = problem.ecc()
    prefix = np.concatenate([[0.0], np.cumsum(problem.step_costs(tour))])
    n = len(tour.edge)
    borders = [0]
    for j in range(1, robots):
        # a hair below, so that rounding in the sum does not cost a robot one whole cell
        share = prefix[-1] * j / robots * (1 - 1e-12)
        borders.append(min(n, max(borders[-1], int(np.searchsorted(prefix, share, side="left")))))
    borders.append(n)
    return tuple(visits_of(tour, a, b) for a, b in pairwise(borders))

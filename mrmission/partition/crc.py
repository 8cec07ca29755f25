"""CRC: coverage with route clustering (the paper's first planner)."""

from __future__ import annotations

from itertools import pairwise

from mrmission.partition.problem import Assignment, CoverageProblem, visits_of
from mrmission.partition.split import frederickson_split


def crc(problem: CoverageProblem, robots: int) -> Assignment:
    """Cut the single-robot tour (ECC) into `robots` pieces of like coverage cost.

    Readings taken: the cost along the tour is the coverage cost of what each step sweeps (a doubled
    cell pays for one half at each of its two steps; the alternatives are the full cost twice, or
    travel only the second time); the distance d to the depot is travel, not coverage; s_max has
    the ½ of Frederickson et al. (the paper prints it without).

    Parameters
    ----------
    problem
        Cells and costs.
    robots
        How many tours to make; some may be empty when there are fewer cells than robots.

    References
    ----------
    Karapetyan et al. 2017, section IV.A; Frederickson, Hecht, Kim 1978.
    """
    tour = problem.ecc()
    distance = tour.distances(problem.depot_cost)
    borders = frederickson_split(problem.step_costs(tour), distance, robots)
    return tuple(visits_of(tour, a, b) for a, b in pairwise(borders))

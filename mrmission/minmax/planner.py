"""The lane planner of one part: lines shared among robots so that the last is home early."""

from __future__ import annotations

from mrmission.errors import InfeasibleError
from mrmission.tour.lines import lengths_m
from mrmission.tour.path import assemble_paths
from mrmission.tour.work import PartTours, PartWork

MAX_MINMAX_LANES = 4000


def lane_tours(work: PartWork) -> PartTours:
    """Return the tours of the lane planner."""
    from mrmission.minmax.search import LaneProblem, minmax

    ends, time = work.lines_m, work.time
    if len(ends) > MAX_MINMAX_LANES:
        raise InfeasibleError(
            f"{len(ends)} lanes: --method minmax plans up to {MAX_MINMAX_LANES}; "
            "choose a wider --swath, or --method auto"
        )
    flat = ends.reshape(-1, 2)
    tours = minmax(
        LaneProblem(
            lane_cost=lengths_m(work.lines) / time.survey_speed_m_s,
            end_cost=work.harbour.distance_matrix(flat) / time.transit_speed_m_s,
            home_cost=work.harbour.distances(work.homes_m, flat) / time.transit_speed_m_s,
        ),
        work.options.time_budget_s,
        work.options.seed,
    )
    ways = [[work.lines[e >> 1].way(e) for e in entries.tolist()] for entries in tours.entries]
    return PartTours(method="minmax", paths=assemble_paths(work.harbour, ways))

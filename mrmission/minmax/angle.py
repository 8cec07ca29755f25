"""The bearing of the lanes: candidates, ranked by what a plan for this fleet would take.

How long all lanes are together says little of how long the last robot takes: with many robots it
counts how the lanes lie to the way home. So candidates are ranked in rounds. The first looks at
lanes and turns alone. The candidates that are left are planned with lanes and in-water ways, first
shortly, then the better half of them longer, until one is left. Bends, hooks and corners are left
to the plan that follows.

The rounds take a share of the time budget, counted in steps of the search and not by a clock: the
same options give the same bearing on any machine.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import shapely

from mrmission.decomposition.slices import lane_intervals
from mrmission.minmax.problem import LaneProblem
from mrmission.model import FloatArray
from mrmission.routing.harbour import Harbour
from mrmission.tour.sweep import ROWS_PER_COLUMN, SweepFrame, columns_of, sweep_cost_s
from mrmission.tour.timing import TimeModel

FAN_DEG = 15.0
"""Angle between the candidates of the regular fan."""
SHORE_EDGES = 6
"""Longest edges of the shore, islands too, whose directions are candidates."""
SAME_DEG = 2.0
"""Candidates nearer to one before them than this are left out."""
MOST_PLANNED = 8
"""At most so many candidates are planned."""
WORSE = 1.15
"""Candidates whose lanes and turns cost more than this many times the least are not planned."""
BUDGET_SHARE = 0.4
"""Share of the time budget that ranking takes, where it takes any."""
_FIRST_ROUND = 0.4
_MATRIX_S = 5e-7
"""Seconds of budget that stand for each pair of ends, so that large areas try few candidates."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Tried:
    """A candidate and the seconds that were expected of it, by the last round it was in."""

    bearing_deg: float
    round: int
    makespan_s: float


@dataclass(frozen=True, slots=True, kw_only=True)
class BearingChoice:
    """The bearing that is taken, what is left of the time budget, and what was tried.

    Attributes
    ----------
    bearing_deg
        Compass bearing of the lanes, at least 0 and below 180.
    budget_left_s
        Of the time budget, for the plan itself.
    tried
        All candidates in the order they were thought of.
    """

    bearing_deg: float
    budget_left_s: float
    tried: tuple[Tried, ...]


def candidate_bearings(region_m: shapely.Polygon, spacing_m: float) -> tuple[float, ...]:
    """Return bearings worth a look, at least 0 and below 180, no two nearly the same.

    They are the direction across which the region is narrowest, those of the least rotated
    rectangle, those in which the shore runs longest, and a regular fan.
    """
    found: list[float] = []

    def add(east: float, north: float) -> None:
        bearing = round(float(np.degrees(np.arctan2(east, north))) % 180.0, 3) % 180.0
        apart = [abs(bearing - b) for b in found]
        if all(min(a, 180.0 - a) >= SAME_DEG for a in apart):
            found.append(bearing)

    add(*_narrowest(shapely.get_coordinates(region_m.convex_hull)))
    rectangle = shapely.get_coordinates(shapely.minimum_rotated_rectangle(region_m))
    for edge in np.diff(rectangle, axis=0)[:2]:
        add(*edge)
    for edge in _shore_directions(region_m, spacing_m):
        add(*edge)
    for bearing in np.radians(np.arange(0.0, 180.0, FAN_DEG)):
        add(np.sin(bearing), np.cos(bearing))
    return tuple(found)


def _narrowest(hull: FloatArray) -> FloatArray:
    """Return the edge (2,) of a convex ring across which the ring is narrowest."""
    edges = np.diff(hull, axis=0)
    length = np.hypot(edges[:, 0], edges[:, 1])
    edges = edges[length > 0] / length[length > 0][:, None]
    across = np.column_stack([-edges[:, 1], edges[:, 0]])
    reach = hull @ across.T
    width = reach.max(axis=0) - reach.min(axis=0)
    return edges[int(np.argmin(np.round(width, 6)))]


def _shore_directions(region_m: shapely.Polygon, spacing_m: float) -> FloatArray:
    """Return (n, 2) edges in whose directions, to the degree, the shore runs longest."""
    edges = []
    for ring in (region_m.exterior, *region_m.interiors):
        slim = shapely.get_coordinates(shapely.simplify(ring, spacing_m))
        edges.append(np.diff(slim, axis=0))
    edge = np.concatenate(edges)
    length = np.hypot(edge[:, 0], edge[:, 1])
    longest = np.argsort(-np.round(length, 6), kind="stable")[:SHORE_EDGES]
    return edge[longest]


def choose_bearing(
    region_m: shapely.Polygon,
    harbour: Harbour,
    homes_m: FloatArray,
    time: TimeModel,
    spacing_m: float,
    *,
    time_budget_s: float,
    seed: int = 0,
) -> BearingChoice:
    """Choose the bearing of the lanes by cheap plans for this fleet.

    Parameters
    ----------
    region_m
        The part of the navigable region, local frame.
    harbour
        Ways in the water.
    homes_m
        (robots, 2) where the robots start and end.
    time
        How long a robot takes.
    spacing_m
        Widest distance between lanes.
    time_budget_s
        Of the whole plan; 0 ranks by lanes, turns and ways home alone.
    seed
        Of the search.
    """
    from mrmission.minmax.planner import BUDGET_PER_LINE_S

    bearings = candidate_bearings(region_m, spacing_m)
    turn_s = time.lane_turn_s(spacing_m)
    rough = np.array(
        [sweep_cost_s(region_m, b, spacing_m, time.survey_speed_m_s, turn_s) for b in bearings]
    ) / len(homes_m)
    tried = [
        Tried(bearing_deg=b, round=0, makespan_s=float(s))
        for b, s in zip(bearings, rough, strict=True)
    ]
    ranked = [int(i) for i in np.argsort(rough, kind="stable") if rough[i] <= WORSE * rough.min()]
    ends = max(len(_lanes_m(region_m, bearings[ranked[0]], spacing_m)) * 2, 2)
    time_budget_s = min(time_budget_s, BUDGET_PER_LINE_S * ends / 2)
    afford = int(BUDGET_SHARE * time_budget_s / (_MATRIX_S * ends**2))
    ranked = ranked[: min(MOST_PLANNED, afford)]
    if len(ranked) < 2:
        best = int(np.argmin(rough))
        return BearingChoice(
            bearing_deg=bearings[best], budget_left_s=time_budget_s, tried=tuple(tried)
        )
    problems = {
        i: lane_problem(region_m, bearings[i], harbour, homes_m, time, spacing_m) for i in ranked
    }
    left_s = BUDGET_SHARE * time_budget_s
    rounds = int(np.ceil(np.log2(len(ranked))))
    for number in range(1, rounds + 1):
        share_s = left_s if number == rounds else _FIRST_ROUND * left_s
        left_s -= share_s
        cost = _searched(problems, ranked, share_s / len(ranked), seed)
        for i, makespan_s in zip(ranked, cost, strict=True):
            tried[i] = Tried(bearing_deg=bearings[i], round=number, makespan_s=makespan_s)
        order = np.argsort(cost, kind="stable")
        ranked = [ranked[j] for j in order[: max(1, (len(ranked) + 1) // 2)]]
    return BearingChoice(
        bearing_deg=bearings[ranked[0]],
        budget_left_s=(1.0 - BUDGET_SHARE) * time_budget_s,
        tried=tuple(tried),
    )


def _searched(
    problems: dict[int, LaneProblem], which: Sequence[int], budget_s: float, seed: int
) -> list[float]:
    """Return the seconds of the last robot when each of some problems is searched."""
    from mrmission.minmax.search import minmax

    return [float(minmax(problems[i], budget_s, seed).cost.max()) for i in which]


def lane_problem(
    region_m: shapely.Polygon,
    bearing_deg: float,
    harbour: Harbour,
    homes_m: FloatArray,
    time: TimeModel,
    spacing_m: float,
) -> LaneProblem:
    """Return the lanes of a bearing with in-water ways, all turns taken for alike."""
    lanes = _lanes_m(region_m, bearing_deg, spacing_m)
    ends = lanes.reshape(-1, 2)
    turn_s = time.lane_turn_s(spacing_m)
    return LaneProblem(
        lane_cost=np.hypot(*(lanes[:, 1] - lanes[:, 0]).T) / time.survey_speed_m_s,
        end_cost=harbour.distance_matrix(ends) / time.transit_speed_m_s + turn_s,
        home_cost=harbour.distances(homes_m, ends) / time.transit_speed_m_s,
    )


def _lanes_m(region_m: shapely.Polygon, bearing_deg: float, spacing_m: float) -> FloatArray:
    """Return (n, 2, 2) lanes of a bearing, local frame, without the shortest."""
    frame = SweepFrame(bearing_deg=bearing_deg)
    region = frame.turn(region_m)
    column_x, pitch = columns_of(region, spacing_m)
    column, low, high = lane_intervals(region, column_x)
    kept = high - low > pitch / ROWS_PER_COLUMN
    x = np.repeat(column_x[column[kept]][:, None], 2, axis=1)
    y = np.column_stack([low[kept], high[kept]])
    return frame.to_local(np.stack([x, y], axis=2))

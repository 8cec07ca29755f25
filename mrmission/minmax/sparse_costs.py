"""What the search is told of more lines than a matrix of all ways between their ends can hold.

Prices are those of :mod:`mrmission.minmax.costs`: leg by leg between near ends, by the angles at
both ends between others. Lengths come from :mod:`mrmission.minmax.travel`.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from mrmission.minmax.costs import (
    BENT,
    NEAR,
    _corner_table,
    _home_seconds,
    _mean_hook_s,
    _short_lanes_s,
    least_lane_s,
    least_near_s,
    near_seconds,
    near_ways,
    outward,
    trim_s,
    way_speed_m_s,
    widest_turning,
)
from mrmission.minmax.hooks import Hooks
from mrmission.minmax.travel import (
    Arrays,
    Float,
    Int,
    Price,
    Travel,
    no_answers,
    price_table,
    travel_between,
)
from mrmission.model import FloatArray
from mrmission.routing.harbour import Harbour
from mrmission.tour.lines import SurveyLine, ends_of, lengths_m
from mrmission.tour.timing import TimeModel
from mrmission.tour.turning import MOST_TRIM


@dataclass(frozen=True, slots=True, kw_only=True)
class SparseCosts:
    """Lines, homes and vehicles as the search sees them, without a matrix of all ways.

    Attributes
    ----------
    lane_s
        (lines,) seconds of each line.
    home_s
        (robots, 2 · lines) seconds between homes and ends.
    near
        (2 · lines, K) the nearest ends of other lines, nearest first.
    arrays, second_s, price
        ``travel_s(arrays, second_s, price, e, f)`` are the seconds between two ends.
    least_lane_s, least_home_s, least_s
        What lines, ways home, and the ways of the table (``arrays[2]``, ``arrays[3]``, in its
        order) can't be less than, for lower bounds.
    beyond_s
        (2 · lines,) what no way from an end is below that is not in its row of the table.
    ends_m, slack_s
        (2 · lines, 2) where the ends are, and what a way may take less than its length at transit
        speed: no more than the corners that it cuts, gentle reversals and trimmed turns included.
    """

    lane_s: FloatArray
    home_s: FloatArray
    near: Int
    arrays: Arrays
    second_s: Float
    price: Price
    least_lane_s: FloatArray
    least_home_s: FloatArray
    least_s: Float
    beyond_s: FloatArray
    ends_m: FloatArray
    slack_s: float


def sparse_line_costs(
    lines: tuple[SurveyLine, ...],
    hooks: Hooks,
    harbour: Harbour,
    homes_m: FloatArray,
    times: tuple[TimeModel, ...],
    *,
    lanes_alone: bool,
) -> SparseCosts:
    """Return what sweeping lines and going between them costs, see `costs.line_costs`."""
    ends = ends_of(lines).reshape(-1, 2)
    out = outward(lines)
    time = times[0]
    travel = travel_between(harbour, ends, dense_ends=0)
    arrays = _arrays_of(travel)
    _, _, start, other, length_m, _ = arrays
    hook_s = _mean_hook_s(ends, out, hooks, time, lanes_alone)
    table, mean = _corner_table(time)
    rest = np.array([mean, 1.0 / time.transit_speed_m_s, BENT])
    price: Price = (out, hook_s, table, rest, *no_answers())
    second_s = price_table(arrays, price)
    floor = min(0.0, float(table.min()))
    widest = widest_turning(times)
    corner_s = floor - trim_s(widest)
    # a lane goes on by a diameter at most at either end
    ahead_s = widest.turn_radius_m * (rest[1] - 1.0 / way_speed_m_s(widest))
    least_s = np.maximum(length_m / way_speed_m_s(widest) + 2 * corner_s, 0.0)
    row = np.repeat(np.arange(len(ends)), np.diff(start))
    low, high = np.minimum(row, other), np.maximum(row, other)
    key = low * len(ends) + high
    count = min(NEAR, travel.near.shape[1])
    here = np.repeat(np.arange(len(ends)), count)
    there = travel.near[:, :count].astype(np.int64).ravel()
    pair = np.minimum(here, there) * len(ends) + np.maximum(here, there)
    wanted, place = np.unique(pair, return_index=True)
    first, last = wanted // len(ends), wanted % len(ends)
    metres = travel.near_m[:, :count].ravel()[place]
    near = near_ways(ends, first, last, metres, harbour)
    near_s = near_seconds(near, ends, out, hooks, time, lanes_alone)
    place = np.minimum(np.searchsorted(wanted, key), len(wanted) - 1)
    priced = wanted[place] == key
    second_s[priced] = near_s[place[priced]]
    near_least_s = least_near_s(near_s, near, out, hooks, widest, lanes_alone)
    least_s[priced] = near_least_s[place[priced]]
    home_s, home_least_s = _home_seconds(ends, out, homes_m, hooks, harbour, times, lanes_alone)
    lane_s = lengths_m(lines) / time.survey_speed_m_s
    return SparseCosts(
        lane_s=lane_s + _short_lanes_s(lines, time),
        home_s=home_s,
        near=travel.near,
        arrays=arrays,
        second_s=second_s,
        price=price,
        least_lane_s=least_lane_s(lines, widest),
        least_home_s=home_least_s,
        least_s=least_s.astype(np.float32),
        beyond_s=np.maximum(arrays[0][:, 3] / way_speed_m_s(widest) + 2 * corner_s, 0.0),
        ends_m=ends,
        slack_s=-4 * floor + 2 * MOST_TRIM * widest.turn_radius_m * rest[1] + 4 * ahead_s,
    )


def _arrays_of(travel: Travel) -> Arrays:
    if travel.arrays is None:
        raise ValueError("fewer than two lines have no far ends: use costs.line_costs")
    return travel.arrays

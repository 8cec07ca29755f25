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
    near_seconds,
    near_ways,
    outward,
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
    """

    lane_s: FloatArray
    home_s: FloatArray
    near: Int
    arrays: Arrays
    second_s: Float
    price: Price


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
    start, other = arrays[2:4]
    hook_s = _mean_hook_s(ends, out, hooks, time, lanes_alone)
    table, mean = _corner_table(time)
    rest = np.array([mean, 1.0 / time.transit_speed_m_s, BENT])
    price: Price = (out, hook_s, table, rest, *no_answers())
    second_s = price_table(arrays, price)
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
    lane_s = lengths_m(lines) / time.survey_speed_m_s
    return SparseCosts(
        lane_s=lane_s + _short_lanes_s(lines, time),
        home_s=_home_seconds(ends, out, homes_m, hooks, harbour, times, lanes_alone),
        near=travel.near,
        arrays=arrays,
        second_s=second_s,
        price=price,
    )


def _arrays_of(travel: Travel) -> Arrays:
    if travel.arrays is None:
        raise ValueError("fewer than two lines have no far ends: use costs.line_costs")
    return travel.arrays

"""What a reversal made gentle takes is never less than the bound on it."""

from __future__ import annotations

from typing import Any, cast

import numpy as np
import pytest

from mrmission.minmax.costs import ways_s
from mrmission.minmax.gentle import gentlest_s
from mrmission.minmax.ways import Ways
from mrmission.model import BoolArray, FloatArray, LegKind
from mrmission.routing.berth_water import BerthWater
from mrmission.tour.path import make_path
from mrmission.tour.reversals import REVERSAL_DEG, avoid_reversals
from mrmission.tour.timing import TimeModel, turns_deg

LANE_M = 400.0
WAYS = 400


class _OpenWater:
    """Water without a shore."""

    def clear(self, lines_m: FloatArray) -> BoolArray:
        return np.ones(len(lines_m), dtype=np.bool_)


def _unit(angle: float) -> FloatArray:
    return np.array([np.cos(angle), np.sin(angle)])


def _way(points_m: FloatArray) -> Ways:
    hooked = np.zeros(len(points_m), np.int8)
    return Ways(start=np.array([0, len(points_m)]), points_m=points_m, hooked=hooked)


def _random_way(rng: np.random.Generator) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return a way of two to five points, its first lane's direction and its last lane's."""
    out = _unit(rng.uniform(0, 2 * np.pi))
    points = [rng.uniform(-5, 5, 2)]
    heading = rng.uniform(0, 2 * np.pi)
    for _ in range(rng.integers(1, 5)):
        points.append(points[-1] + rng.choice([3.0, 8.0, 20.0, 60.0]) * _unit(heading))
        heading += rng.choice([np.pi, rng.uniform(-2.0, 2.0)])
    return np.array(points), out, _unit(heading)


@pytest.mark.parametrize(("survey", "transit"), [(2.0, 2.0), (1.5, 2.5), (2.5, 1.5)])
def test_no_replacement_is_quicker_than_the_bound(survey: float, transit: float) -> None:
    rng = np.random.default_rng(3)
    time = TimeModel(survey_speed_m_s=survey, transit_speed_m_s=transit, swath_m=20.0)
    water = cast(BerthWater, _OpenWater())
    looked, replaced, slack = 0, 0, []
    for _ in range(WAYS):
        points, out, into = _random_way(rng)
        chain = np.concatenate([[points[0] - LANE_M * out], points, [points[-1] + LANE_M * into]])
        if (turns_deg(np.diff(chain, axis=0)) >= REVERSAL_DEG).sum() != 1:
            continue
        looked += 1
        bound = gentlest_s(_way(points), np.array([0]), out[None], into[None], time)[0]
        kinds: list[Any] = [LegKind.TRANSIT] * (len(chain) - 1)
        kinds[0] = kinds[-1] = LegKind.SURVEY
        path = make_path(1, chain, kinds, [0] * len(kinds))
        gentle = avoid_reversals(path, water, time, 0.0)
        if len(gentle.points_m) == len(chain):
            continue
        replaced += 1
        laid = gentle.points_m[1:-1]
        took = ways_s(_way(laid), out[None], into[None], time)[0]
        assert took >= bound - 1e-6
        slack.append(took - bound)
    assert looked > 50
    assert replaced > 30
    assert min(slack) < 2.0  # it is near what is laid
    assert np.median(slack) < 15.0  # a bound of nothing would hold as well


def test_a_way_without_room_in_the_angles_has_no_replacement() -> None:
    time = TimeModel(survey_speed_m_s=2.0, transit_speed_m_s=2.0)
    straight = _way(np.array([[0.0, 0.0], [9.0, 0.0]]))
    east = np.array([[1.0, 0.0]])
    assert np.isinf(gentlest_s(straight, np.array([0]), east, east, time)[0])

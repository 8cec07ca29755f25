"""The copter's time model: ramps, corners, and the simulated copter as its judge."""

from __future__ import annotations

import itertools
import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from mrmission.options import PlanOptions
from mrmission.simulate.copter_motion import Route
from mrmission.tour.flight import (
    FlightLimits,
    FlightTimeModel,
    Ramp,
    corner_s,
    time_model,
    up_and_down_s,
)
from mrmission.tour.timing import TimeModel

COURSE = np.array(
    [(0, 0), (0, 40), (40, 40), (40, 0), (80, 0), (80, 40), (100, 40), (100, 100), (110, 100),
     (110, 40), (120, 40), (120, 100), (130, 100), (130, 40), (130, 0), (130, 60), (130, 0),
     (90, 0), (61.7, -28.3), (21.7, -28.3), (21.7, -60), (0, 0)], dtype=float,
)  # fmt: skip
"""Corners of 45 to 180 degrees and lanes 10 m apart."""
FLOWN_S = {2.0: 478.7, 5.0: 249.4, 10.0: 207.8}
"""What an ArduCopter 4.7 in SITL took for it at 20 m, from the start to the motors' stop."""


def model(speed_m_s: float, altitude_m: float = 20.0) -> FlightTimeModel:
    return FlightTimeModel(
        survey_speed_m_s=speed_m_s, transit_speed_m_s=speed_m_s, swath_m=10, altitude_m=altitude_m
    )


@pytest.mark.parametrize("speed", FLOWN_S)
def test_the_course_takes_as_long_as_arducopter_took(speed: float) -> None:
    kind = np.ones(len(COURSE) - 1, dtype=np.int8)
    assert model(speed).duration_s(COURSE, kind) == pytest.approx(FLOWN_S[speed], rel=0.015)


@pytest.mark.parametrize("speed", [1.5, 4.0, 8.0])
def test_the_model_is_what_the_simulated_copter_does(speed: float) -> None:
    route = Route((0.0, 0.0, 20.0), FlightLimits(speed_m_s=speed))
    time_s = 0.0
    places = [(float(x), float(y), 20.0) for x, y in COURSE]
    for here, after in itertools.zip_longest(places[1:], places[2:]):
        route.go(here, after)
        while not route.reached:
            route.advance(0.05)
            time_s += 0.05
    kind = np.ones(len(COURSE) - 1, dtype=np.int8)
    along_s = model(speed).duration_s(COURSE, kind) - up_and_down_s(20.0, FlightLimits())
    # cut corners gain nothing in the model beyond what the bound allows
    assert time_s * 0.99 <= along_s <= time_s * 1.03


@settings(max_examples=100, deadline=None)
@given(st.floats(0.05, 500.0), st.floats(0.3, 15.0))
def test_a_ramp_goes_from_rest_to_rest_over_its_length(length_m: float, speed: float) -> None:
    ramp = Ramp((0.0, 0.0, 0.0), (length_m, 0.0, 0.0), FlightLimits(speed_m_s=speed))
    times = np.linspace(0, ramp.whole_s, 2000)
    ways, speeds, accels = np.array([ramp.at(t) for t in times]).T
    assert ways[0] == 0
    assert ways[-1] == pytest.approx(length_m)
    assert np.all(np.diff(ways) >= -1e-9)
    assert speeds.max() <= speed + 1e-6
    assert np.abs(accels).max() <= 2.5 + 1e-6
    # speed is the slope of the way
    slope = np.diff(ways) / np.diff(times)
    step_s = times[1]
    assert np.abs(slope - 0.5 * (speeds[1:] + speeds[:-1])).max() < 0.3 * step_s + 1e-6
    assert ramp.whole_s >= length_m / speed
    assert ramp.time_at(0.5 * length_m) == pytest.approx(ramp.whole_s / 2, rel=1e-6)


def test_climbing_is_slower_than_crossing_and_sinking_slower_still() -> None:
    limits = FlightLimits()
    level, up, down = (
        Ramp((0.0, 0.0, 50.0), (x, 0.0, z), limits).whole_s
        for x, z in ((40.0, 50.0), (0.0, 90.0), (0.0, 10.0))
    )
    assert level < up < down


def test_straight_on_costs_nothing_and_turning_back_the_most() -> None:
    costs = [corner_s(200.0, 200.0, angle, 5.0, 5.0) for angle in (0.0, 45.0, 90.0, 180.0)]
    assert costs[0] == pytest.approx(0.0, abs=0.2)
    # a gentle corner is cut, and that gains a little
    assert -0.3 < costs[1] < 0.1
    assert costs[1:] == sorted(costs[1:])
    assert 0.8 < costs[-1] < 4.0


def test_height_costs_time() -> None:
    kind = np.ones(len(COURSE) - 1, dtype=np.int8)
    low, high = (model(5.0, z).duration_s(COURSE, kind) for z in (20.0, 80.0))
    assert high - low == pytest.approx(60.0 / 2.5 + 60.0 / 1.5)
    assert model(5.0).duration_s(np.zeros((1, 2)), kind[:0]) == 0.0


def test_a_time_is_never_below_what_the_bound_counts() -> None:
    kind = np.ones(len(COURSE) - 1, dtype=np.int8)
    length_m = float(np.hypot(*np.diff(COURSE, axis=0).T).sum())
    for speed in (0.5, 2.0, 12.0):
        swath_m = 10.0
        covered_m2 = model(speed).duration_s(COURSE, kind) * speed * swath_m
        covered_m2 += math.pi / 4 * swath_m**2
        assert covered_m2 >= length_m * swath_m * 0.9
        assert model(speed).lane_turn_s(9.0) >= 0.0


def test_copters_alone_have_it() -> None:
    assert isinstance(time_model(PlanOptions(vehicle="copter")), FlightTimeModel)
    for vehicle in ("boat", "rover"):
        assert type(time_model(PlanOptions(vehicle=vehicle))) is TimeModel

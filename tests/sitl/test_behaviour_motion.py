"""How a boat moves: the light boat and ArduRover alike, within stated tolerances."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence

import pytest
from seatrial import ACCEPTED, HOLD, LOITER, Trial
from sim_client import waypoint

TrialOf = Callable[..., Trial]
CALM = {"AVOID_ENABLE": 0.0, "WP_SPEED": 2.0, "WP_RADIUS": 1.0}
Point = tuple[float, float]


def metres(a: Sequence[float], b: Sequence[float]) -> float:
    return math.hypot(a[0] - b[0], a[1] - b[1])


def zigzag(lanes: int, length_m: float, spacing_m: float) -> list[Point]:
    """Ends of lanes (north, east), and a point beyond the last."""
    points: list[Point] = []
    for lane in range(lanes):
        south, north = (20.0, lane * spacing_m), (20.0 + length_m, lane * spacing_m)
        points += [south, north] if lane % 2 == 0 else [north, south]
    return [*points, (points[-1][0], points[-1][1] + 40.0)]


@pytest.mark.parametrize(
    ("spacing_m", "speed_m_s", "radius_m", "measured_s"),
    # Seconds that ArduRover took in SITL, one run each; both engines must come near them.
    [(10.0, 2.0, 1.0, 122.0), (10.0, 3.0, 2.0, 87.0), (20.0, 2.0, 1.0, 147.0)],
)
def test_the_time_of_a_zigzag(
    trial_of: TrialOf, spacing_m: float, speed_m_s: float, radius_m: float, measured_s: float
) -> None:
    trial = trial_of(**{**CALM, "WP_SPEED": speed_m_s, "WP_RADIUS": radius_m})
    course = zigzag(6, 40.0, spacing_m)
    trial.sail([waypoint(*point) for point in course])
    # From the end of the first lane to that of the last: five lanes and ten corners.
    began_s = trial.until_reached(2, 90.0)
    took_s = trial.until_reached(len(course) - 1, 400.0) - began_s
    assert took_s == pytest.approx(measured_s, rel=0.06)


def test_lanes_are_kept(trial_of: TrialOf) -> None:
    trial = trial_of(**CALM)
    course = zigzag(4, 60.0, 10.0)
    trial.sail([waypoint(*point) for point in course])
    trial.until_reached(1, 60.0)
    off = []
    while trial.current() < len(course):
        off += [abs(e - 10.0 * round(e / 10.0)) for _, e, n in trial.track(5.0) if 28.0 < n < 72.0]
    off.sort()
    assert len(off) > 100
    assert off[int(0.95 * len(off))] < 0.6
    assert off[-1] < 2.0


def test_it_reaches_its_speed_and_keeps_it(trial_of: TrialOf) -> None:
    trial = trial_of(**{**CALM, "WP_SPEED": 3.0})
    trial.sail([waypoint(150, 0)])
    trial.wait(20.0)
    speeds = [
        math.hypot(m.vx, m.vy) * 0.01
        for m in trial.listen(10.0)
        if m.get_type() == "GLOBAL_POSITION_INT"
    ]
    assert sum(speeds) / len(speeds) == pytest.approx(3.0, abs=0.1)


def underway(trial: Trial) -> None:
    trial.sail([waypoint(400, 0)])
    trial.wait(20.0)


def test_hold_coasts_for_a_long_way(trial_of: TrialOf) -> None:
    trial = trial_of(**{**CALM, "WP_SPEED": 3.0})
    underway(trial)
    assert trial.change_mode(HOLD) == ACCEPTED
    speed_m_s, here = trial.speed_m_s(), trial.place()
    trial.wait(30.0)
    coasted_m = metres(trial.place(), here)
    # The hull's drag grows with the square of its speed: v / (1 + v t / 4).
    assert coasted_m == pytest.approx(4.0 * math.log(1.0 + 0.25 * speed_m_s * 30.0), rel=0.1)
    assert 9.0 < coasted_m < 16.0


def test_loiter_stops_and_stays(trial_of: TrialOf) -> None:
    trial = trial_of(**{**CALM, "WP_SPEED": 3.0})
    underway(trial)
    assert trial.change_mode(LOITER) == ACCEPTED
    here = trial.place()
    track = trial.track(90.0)
    assert max(metres((e, n), here) for _, e, n in track) < 8.0
    tail = [(e, n) for t, e, n in track if t > track[-1][0] - 60.0]
    assert max(metres(a, tail[0]) for a in tail) < 3.0


# --- in a current ---


def test_lanes_are_kept_across_a_current(trial_of: TrialOf) -> None:
    trial = trial_of(SIM_TIDE_SPEED=0.5, SIM_TIDE_DIR=90.0, **CALM)
    trial.sail([waypoint(20, 0), waypoint(140, 0)])
    trial.until_reached(1, 60.0)
    trial.wait(10.0)
    track = trial.track(30.0)
    assert max(abs(e) for _, e, _ in track) < 1.0
    # Two metres per second over ground, whatever the water does.
    assert metres(track[0][1:], track[-1][1:]) / (track[-1][0] - track[0][0]) == pytest.approx(
        2.0, abs=0.15
    )


def test_hold_drifts_with_the_current(trial_of: TrialOf) -> None:
    trial = trial_of(SIM_TIDE_SPEED=0.5, SIM_TIDE_DIR=90.0, **CALM)
    underway(trial)
    assert trial.change_mode(HOLD) == ACCEPTED
    trial.wait(10.0)
    east, _ = trial.place()
    trial.wait(60.0)
    assert trial.place()[0] - east == pytest.approx(-30.0, abs=2.0)


def test_a_mission_that_ends_in_hold_drifts_off(trial_of: TrialOf) -> None:
    trial = trial_of(SIM_TIDE_SPEED=0.5, SIM_TIDE_DIR=0.0, MIS_DONE_BEHAVE=0, **CALM)
    trial.sail([waypoint(60, 0)])
    trial.until_reached(1, 90.0)
    trial.wait(30.0)
    _, north = trial.place()
    trial.wait(120.0)
    assert trial.place()[1] - north == pytest.approx(-55.0, abs=5.0)


def test_bow_to_the_current_a_boat_loiters_on_the_spot(trial_of: TrialOf) -> None:
    trial = trial_of(SIM_TIDE_SPEED=0.5, SIM_TIDE_DIR=0.0, **CALM)
    trial.sail([waypoint(60, 0)])
    trial.until_reached(1, 90.0)
    trial.wait(10.0)
    track = trial.track(120.0)
    assert max(metres((e, n), (0.0, 60.0)) for _, e, n in track) < 3.5


def test_beam_to_the_current_a_steered_boat_loiters_for_two_minutes(trial_of: TrialOf) -> None:
    trial = trial_of(SIM_TIDE_SPEED=0.5, SIM_TIDE_DIR=90.0, **CALM)
    trial.sail([waypoint(60, 0)])
    trial.until_reached(1, 90.0)
    track = trial.track(100.0)
    assert max(metres((e, n), (0.0, 60.0)) for _, e, n in track) < 9.0

"""A copter: what it keeps, when it flies, how it comes home; the light one and ArduCopter alike."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import pytest
from seatrial import ACCEPTED, ARM, FENCE, MISSION, RALLY, LightTrial, Trial, home
from sim_client import LAT, LON, content, polygon, waypoint

from mrmission.simulate.ardupilot_models import survey_parameters
from mrmission.simulate.motion import offset_m
from mrmission.simulate.storage import EXCLUSION, Item
from mrmission.simulate.wire import mavlink

STABILIZE, AUTO, GUIDED, LOITER, RTL, LAND = 0, 3, 4, 5, 6, 9
FAILED = mavlink.MAV_RESULT_FAILED
NAN = math.nan
CopterOf = Callable[..., Trial]


def do(command: int, *params: float) -> Item:
    return Item(command, 0, *[*params, 0.0, 0.0, 0.0, 0.0][:4], 0, 0, 0.0)  # type: ignore[arg-type]


def at(north_m: float, east_m: float, z: float = 20.0, **changes: Any) -> Item:
    return waypoint(north_m, east_m, z=z, **changes)


def take_off(z: float = 20.0) -> Item:
    return at(0, 0, z, command=22)


RETURN = do(20)
SPEED = do(178, 1.0, 5.0, -1.0)
SURVEY = [
    take_off(), SPEED,
    at(20, 10), do(206, 5.0, 0.0, 1.0), at(80, 10), do(206, 0.0),
    at(80, 25), do(206, 5.0, 0.0, 1.0), at(20, 25), do(206, 0.0),
    at(20, 40), do(206, 5.0, 0.0, 1.0), at(80, 40), do(206, 0.0),
    at(0, 0), RETURN,
]  # fmt: skip
"""Three lanes 60 m long and 15 m apart, photos every 5 m."""


def start(trial: Trial, items: list[Item], seconds: float = 90.0) -> None:
    """Upload items behind a home row, arm, start the mission."""
    assert trial.upload([home(), *items]) == 0
    trial.arm(seconds)
    trial.forget()
    assert trial.command(mavlink.MAV_CMD_MISSION_START) == ACCEPTED


def height_m(trial: Trial) -> float:
    return float(trial.last("GLOBAL_POSITION_INT").relative_alt) / 1000.0


def until_disarmed(trial: Trial, seconds: float) -> float:
    """Wait for the motors to stop; return the time."""
    off = trial.first(
        lambda m: m.get_type() == "HEARTBEAT"
        and not m.base_mode & mavlink.MAV_MODE_FLAG_SAFETY_ARMED,
        seconds,
    )  # fmt: skip
    assert off is not None, trial.texts()
    return trial.now_s


# --- what it keeps ---

ODD = [
    take_off(12.345),
    at(10, 10, 12.3456, param1=3.7, param2=2.0, param3=3.0, param4=NAN),
    at(20, 10, 33.333, frame=6),
    at(30, 10, 33.339, frame=11),
    at(40, 10, 33.331, frame=10),
    at(40, 20, 433.335, frame=0),
    at(40, 20, 433.335, frame=5),
    do(206, 7.25, 3.0, 1.0, 9.0),
    do(206, 0.1),
    do(178, 1.0, 3.55, -1.0),
    at(50, 10, 20.0, command=82, param1=2.0),
    at(50, 20, 20.0, command=19, param1=12.5, param3=-3.0),
    at(60, 20, 20.0, command=17, param3=25.4),
    at(70, 20, 20.0, command=18, param1=2.5, param3=-15.0),
    at(0, 0, 0.0, command=21),
    RETURN,
]


def test_a_store_of_the_light_copter_and_of_arducopter_are_the_same(copter_of: CopterOf) -> None:
    trial = copter_of()
    light = LightTrial(kind="copter", parameters=survey_parameters("quad"))
    fence = [*polygon(40), *polygon(20, EXCLUSION)]
    rally = [at(5.0 * i, 0, 10.6 + i, command=5100) for i in range(3)]
    for kind, items in ((MISSION, [home(), *ODD]), (FENCE, fence), (RALLY, rally)):
        assert trial.upload(items, kind) == 0
        assert light.upload(items, kind) == 0
        stored, expected = ([content(m) for m in t.stored(kind)] for t in (trial, light))
        skip = 1 if kind == MISSION else 0
        assert stored[skip:] == expected[skip:]


def test_what_it_does_not_take(copter_of: CopterOf) -> None:
    trial = copter_of()
    for item, result in (
        (at(10, 10, NAN), mavlink.MAV_MISSION_INVALID_PARAM7),
        (at(10, 10, param1=NAN), mavlink.MAV_MISSION_INVALID_PARAM1),
        (do(206, NAN), mavlink.MAV_MISSION_INVALID_PARAM1),
        (at(10, 10, frame=8), mavlink.MAV_MISSION_UNSUPPORTED_FRAME),
    ):
        assert trial.upload([home(), take_off(), item]) == result
        trial.wait(0.5)


def test_it_holds_650_items_69_fence_points_and_46_rally_points(copter_of: CopterOf) -> None:
    trial = copter_of()
    for kind, item, room in (
        (MISSION, at(0, 0), 650),
        (RALLY, at(0, 0, command=5100), 46),
    ):
        assert trial.upload([item] * (room + 1), kind) == mavlink.MAV_MISSION_NO_SPACE
        trial.wait(0.5)
    assert trial.upload(polygon(69), FENCE) == 0
    trial.wait(0.5)
    assert trial.upload(polygon(70), FENCE) != 0


# --- when it flies ---


def test_auto_on_the_ground_wants_a_takeoff_first(copter_of: CopterOf) -> None:
    trial = copter_of(AUTO_OPTIONS=0)
    assert trial.upload([home(), at(20, 0), RETURN]) == 0
    assert trial.change_mode(STABILIZE) == ACCEPTED
    trial.arm()
    trial.forget()
    assert trial.change_mode(AUTO) == FAILED
    assert trial.until_said("Missing Takeoff Cmd", 3.0)
    # it stands there idle, and disarms by itself
    since_s = trial.now_s
    assert until_disarmed(trial, 20.0) - since_s < 14.0


def test_auto_cannot_be_armed_unless_allowed(copter_of: CopterOf) -> None:
    trial = copter_of(AUTO_OPTIONS=0)
    assert trial.upload([home(), take_off(), RETURN]) == 0
    trial.arm()
    assert trial.command(ARM, 0) == ACCEPTED
    assert trial.change_mode(AUTO) == ACCEPTED
    assert trial.command(ARM, 1) == FAILED
    assert trial.until_said("AUTO mode not armable", 3.0)


def test_guided_takes_off_and_lands(copter_of: CopterOf) -> None:
    trial = copter_of()
    assert trial.change_mode(GUIDED) == ACCEPTED
    trial.arm()
    assert trial.command(22, 0, 0, 0, 0, 0, 0, 10.0) == ACCEPTED
    trial.wait(18.0)
    assert height_m(trial) == pytest.approx(10.0, abs=0.4)
    assert trial.command(ARM, 0) == FAILED  # nobody disarms a copter in the air
    assert trial.change_mode(LAND) == ACCEPTED
    until_disarmed(trial, 60.0)
    assert height_m(trial) == pytest.approx(0.0, abs=0.3)


def test_a_return_from_below_climbs_first_and_stays_below_the_fence(copter_of: CopterOf) -> None:
    trial = copter_of(RTL_ALT=3000, FENCE_TYPE=1, FENCE_ALT_MAX=25)
    start(trial, [take_off(8), SPEED, at(60, 0, 8), at(60, 1, 8, command=17)])
    trial.set(FENCE_ENABLE=1)
    trial.until_reached(3, 60.0)
    assert trial.change_mode(RTL) == ACCEPTED
    trial.wait(14.0)
    # 30 m asked for; the fence lets it to 25 less its margin of 2
    assert height_m(trial) == pytest.approx(23.0, abs=0.6)
    until_disarmed(trial, 120.0)
    assert math.hypot(*trial.place()) < 1.5


# --- a survey ---


def flown(trial: Trial) -> dict[str, Any]:
    """Fly the survey to its end; return times and places, seconds since the start."""
    start(trial, SURVEY)
    begin_s = trial.now_s
    took_off = trial.until_reached(2, 60.0) - begin_s
    last = len(SURVEY) - 1
    lanes_done = trial.until_reached(last, 200.0) - begin_s
    off = until_disarmed(trial, 120.0) - begin_s
    track = [m for m in trial.heard if m.get_type() == "GLOBAL_POSITION_INT"]
    return {
        "times": (took_off, lanes_done, off),
        "home_m": math.hypot(*trial.place()),
        "mode": trial.mode(),
        "heights": [m.relative_alt / 1000.0 for m in track],
        "track": [offset_m(LAT, LON, m.lat * 1e-7, m.lon * 1e-7) for m in track],
        "shots": [
            offset_m(LAT, LON, m.lat * 1e-7, m.lng * 1e-7)
            for m in trial.heard
            if m.get_type() == "CAMERA_FEEDBACK"
        ],
    }


def test_a_survey_is_flown_photographed_and_ends_on_the_ground(copter_of: CopterOf) -> None:
    trial = copter_of(CAM1_TYPE=1)
    real = flown(trial)
    light = flown(
        LightTrial(kind="copter", parameters={**survey_parameters("quad"), "CAM1_TYPE": 1})
    )
    assert real["home_m"] < 1.0
    assert real["mode"] == AUTO
    assert max(real["heights"]) == pytest.approx(20.0, abs=0.5)
    # the light copter takes as long as ArduCopter, at every stage
    for ours, theirs in zip(light["times"], real["times"], strict=True):
        assert ours == pytest.approx(theirs, rel=0.03, abs=1.0)
    # photos along the lanes, none in the turns and on the way home
    for shots in (real["shots"], light["shots"]):
        assert 33 <= len(shots) <= 42
        assert all(17 < north < 83 for _, north in shots)
        assert {min((10, 25, 40), key=lambda x: abs(x - east)) for east, _ in shots} == {10, 25, 40}
        assert all(min(abs(east - x) for x in (10, 25, 40)) < 2.5 for east, _ in shots)

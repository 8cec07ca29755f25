"""What an ArduPilot keeps of an item: limits, precision, refusals."""

from __future__ import annotations

import pytest
from sim_client import HOME, polygon, waypoint

from mrmission.simulate.storage import (
    CIRCLE_IN,
    EXCLUSION,
    INCLUSION,
    RETURN_POINT,
    Item,
    Refusal,
    fence_bytes,
    fence_fault,
    fence_item,
    mission_item,
    rally_item,
)
from mrmission.simulate.wire import mavlink

NAN = float("nan")
INF = float("inf")


def refused(function, item: Item) -> int:
    with pytest.raises(Refusal) as info:
        function(item)
    return info.value.result


@pytest.mark.parametrize(
    ("sent", "stored"), [(0, 0), (5, 0), (2, 0), (3, 3), (6, 3), (10, 10), (11, 10)]
)
def test_frames_are_normalised(sent: int, stored: int) -> None:
    assert mission_item(waypoint(1, 2, frame=sent)).frame == stored


@pytest.mark.parametrize("frame", [1, 4, 7, 8, 9, 12, 20, 21])
def test_other_frames_are_refused(frame: int) -> None:
    assert refused(mission_item, waypoint(1, 2, frame=frame)) == (
        mavlink.MAV_MISSION_UNSUPPORTED_FRAME
    )


def test_frame_of_a_command_without_position_is_lost_and_not_checked() -> None:
    item = Item(178, 9, 1, 2.5, -1, 0, 5, 6, 7.0)
    assert mission_item(item) == Item(178, 0, 1, 2.5, -1, 0, 0, 0, 0.0)


@pytest.mark.parametrize(
    ("changes", "result"),
    [
        ({"param1": NAN}, mavlink.MAV_MISSION_INVALID_PARAM1),
        ({"param2": NAN}, mavlink.MAV_MISSION_INVALID_PARAM2),
        ({"param3": NAN}, mavlink.MAV_MISSION_INVALID_PARAM3),
        ({"param4": INF}, mavlink.MAV_MISSION_INVALID_PARAM4),
        ({"z": NAN}, mavlink.MAV_MISSION_INVALID_PARAM7),
        ({"z": 83_000.0}, mavlink.MAV_MISSION_INVALID_PARAM7),
        ({"x": 900_000_001}, mavlink.MAV_MISSION_INVALID_PARAM5_X),
        ({"y": -1_800_000_001}, mavlink.MAV_MISSION_INVALID_PARAM6_Y),
        ({"command": 0}, mavlink.MAV_MISSION_INVALID),
        ({"command": 195}, mavlink.MAV_MISSION_UNSUPPORTED),
        ({"command": 197}, mavlink.MAV_MISSION_UNSUPPORTED),
        ({"command": 5001}, mavlink.MAV_MISSION_UNSUPPORTED),
    ],
)
def test_refusals(changes: dict[str, float], result: int) -> None:
    assert refused(mission_item, waypoint(1, 2)._replace(**changes)) == result


def test_nan_in_param4_of_a_waypoint_is_fine_and_becomes_zero() -> None:
    stored = mission_item(waypoint(1, 2, param4=NAN))
    assert stored.param4 == 0.0


def test_waypoint_keeps_whole_seconds_of_delay_and_loses_the_rest() -> None:
    stored = mission_item(waypoint(1, 2, param1=7.9, param2=3.0, param3=4.0, param4=90.0))
    assert (stored.param1, stored.param2, stored.param3, stored.param4) == (7, 0, 0, 0)


def test_positions_are_exact_and_altitudes_whole_centimetres_towards_zero() -> None:
    stored = mission_item(waypoint(1, 2, x=473_123_457, y=-851_234_567, z=-1.239))
    assert (stored.x, stored.y) == (473_123_457, -851_234_567)
    assert stored.z == pytest.approx(-1.23, abs=1e-6)


@pytest.mark.parametrize(
    ("command", "params", "kept"),
    [
        (17, (0, 0, -12.7, 0), (0, 0, -12, 0)),
        (18, (2, 0, 30, 1), (2, 0, 30, 1)),
        (18, (0.5, 0, -300, 0), (0.5, 0, -300, 0)),
        (18, (300, 0, 9999, 0), (255, 0, 2550, 0)),
        (19, (10, 0, 5, 0), (10, 0, 1, 0)),
        (177, (3, -1, 9, 9), (3, -1, 0, 0)),
        (178, (1, 3.25, 50, 0), (1, 3.25, 50, 0)),
        (206, (12.5, 4, 1, 0), (12.5, 0, 1, 0)),
        (20, (1, 2, 3, 4), (0, 0, 0, 0)),
    ],
)
def test_parameters_that_are_kept(
    command: int, params: tuple[float, ...], kept: tuple[float, ...]
) -> None:
    stored = mission_item(Item(command, 3, *params, 10, 20, 0.0))  # type: ignore[arg-type]
    assert (stored.param1, stored.param2, stored.param3, stored.param4) == kept


def test_what_is_stored_is_stored_again_unchanged() -> None:
    for command in (16, 17, 18, 19, 20, 93, 112, 114, 177, 178, 183, 201, 203, 206, 218, 2000):
        once = mission_item(Item(command, 6, 1.5, 2.5, 3.5, 0.25, 100, 200, 1.5))
        assert mission_item(once) == once


# --- fence ---


def test_fence_bytes_are_8n_plus_2_per_polygon_and_a_header_of_4() -> None:
    assert fence_bytes(polygon(83)) == 4 + 8 * 83 + 2 == 670
    assert fence_bytes(polygon(84)) == 678
    one_and_sixteen = polygon(4) + 16 * polygon(4, EXCLUSION)
    assert fence_bytes(one_and_sixteen) == 4 + 17 * 34
    circle = fence_item(HOME._replace(command=CIRCLE_IN, param1=12.5))
    assert fence_bytes([circle]) == 4 + 13


def test_a_complete_fence_has_no_fault() -> None:
    assert fence_fault(polygon(3) + polygon(5, EXCLUSION)) is None
    assert fence_fault([]) is None


@pytest.mark.parametrize(
    ("items", "fault"),
    [
        (polygon(4)[:3], "Incorrect item count"),
        (polygon(2), "Invalid vertex count (2)"),
        (polygon(4)[:2] + polygon(4, EXCLUSION), "Received incorrect vertex type"),
        (polygon(4)[:2] + polygon(5), "Unexpected vertex count want=4 got=5"),
        (
            [*polygon(3)[:2], fence_item(HOME._replace(command=CIRCLE_IN, param1=5.0))],
            "Received incorrect type",
        ),
        ([fence_item(HOME._replace(command=CIRCLE_IN, param1=0.0))], "Non-positive circle radius"),
        (2 * [fence_item(HOME._replace(command=RETURN_POINT))], "Multiple return points"),
    ],
)
def test_fence_faults(items: list[Item], fault: str) -> None:
    assert fence_fault(items) == fault


def test_fence_refusals() -> None:
    vertex = HOME._replace(command=INCLUSION, param1=4)
    assert refused(fence_item, vertex._replace(param1=256)) == mavlink.MAV_MISSION_INVALID_PARAM1
    assert refused(fence_item, vertex._replace(frame=1)) == mavlink.MAV_MISSION_UNSUPPORTED_FRAME
    assert refused(fence_item, vertex._replace(command=16)) == mavlink.MAV_MISSION_UNSUPPORTED


# --- rally ---


def test_rally_altitude_is_whole_metres_and_frames_are_normalised() -> None:
    stored = rally_item(HOME._replace(command=5100, frame=6, z=12.9))
    assert (stored.frame, stored.z) == (3, 12.0)


@pytest.mark.parametrize(
    ("changes", "result"),
    [
        ({"command": 16}, mavlink.MAV_MISSION_UNSUPPORTED),
        ({"x": 900_000_001}, mavlink.MAV_MISSION_INVALID_PARAM5_X),
        ({"y": 1_800_000_001}, mavlink.MAV_MISSION_INVALID_PARAM6_Y),
        ({"z": 40_000.0}, mavlink.MAV_MISSION_INVALID_PARAM7),
        ({"frame": 2}, mavlink.MAV_MISSION_UNSUPPORTED_FRAME),
    ],
)
def test_rally_refusals(changes: dict[str, float], result: int) -> None:
    item = HOME._replace(command=5100, frame=3)._replace(**changes)
    assert refused(rally_item, item) == result

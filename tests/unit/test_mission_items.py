from __future__ import annotations

import itertools
import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from mrmission.errors import PlanningError
from mrmission.mission import mavlink
from mrmission.mission.items import build_items, count_items, merge_collinear
from mrmission.model import LegKind, MissionItem
from mrmission.options import PlanOptions

T, S = int(LegKind.TRANSIT), int(LegKind.SURVEY)
PATH = np.array(
    [
        [-81.3, 34.06],
        [-81.2999999, 34.0700001],
        [-81.31234567, 34.08],
        [-81.31, 34.07],
        [-81.3, 34.06],
    ]
)
KIND = np.array([T, S, T, T], dtype=np.int8)
LANE = np.array([0, 1, 0, 0])


def commands(vehicle: str, **options: float) -> list[int]:
    items, _, _ = build_items(PATH, KIND, LANE, PlanOptions(vehicle=vehicle, **options))
    return [i.command for i in items]


def test_boat_has_home_a_waypoint_then_its_speed_and_loiters_at_home() -> None:
    items, kind, lane = build_items(PATH, KIND, LANE, PlanOptions(survey_speed_m_s=2.0))
    assert [i.command for i in items] == [16, 16, 178, 16, 16, 16, 16, 17]
    assert [i.seq for i in items] == list(range(8))
    assert [i.current for i in items] == [1, 0, 0, 0, 0, 0, 0, 0]
    assert (items[2].param1, items[2].param2) == (1.0, 2.0)
    home = (340600000, -813000000)
    assert [(i.x, i.y) for i in items if i.seq in (0, 1, 6, 7)] == [home] * 4
    assert kind == (T, T, T, T, S, T, T, T)
    assert lane == (0, 0, 0, 0, 1, 0, 0, 0)


def test_copter_takes_off_and_returns() -> None:
    items, _, _ = build_items(PATH, KIND, LANE, PlanOptions(vehicle="copter", altitude_m=25))
    assert [i.command for i in items] == [16, 22, 178, 16, 16, 16, 16, 20]
    assert {i.z for i in items if i.command in (16, 22)} == {0.0, 25.0}
    assert items[0].z == 0.0
    assert items[1].z == 25.0


def test_rover_ends_at_its_home_waypoint() -> None:
    assert commands("rover") == [16, 16, 178, 16, 16, 16, 16]


def test_speed_changes_only_where_the_speed_does() -> None:
    items, _, _ = build_items(
        PATH, KIND, LANE, PlanOptions(survey_speed_m_s=1.5, transit_speed_m_s=3.0)
    )
    assert [i.command for i in items] == [16, 16, 178, 16, 178, 16, 178, 16, 16, 17]
    assert [i.param2 for i in items if i.command == 178] == [3.0, 1.5, 3.0]


def test_heights_above_terrain_are_in_frame_10_and_above_home_in_frame_3() -> None:
    for above, frame in (("home", 3), ("terrain", 10)):
        options = PlanOptions(vehicle="copter", altitude_m=25, altitude_above=above)
        items, _, _ = build_items(PATH, KIND, LANE, options)
        assert {i.frame for i in items if i.command in (16, 22)} == {0, frame}
        assert (items[0].frame, items[-1].frame) == (0, 0)


def test_a_camera_is_on_along_the_lane_and_off_elsewhere() -> None:
    options = PlanOptions(vehicle="copter", trigger_distance_m=7.5, transit_speed_m_s=3.0)
    items, kind, lane = build_items(PATH, KIND, LANE, options)
    assert [i.command for i in items] == [16, 22, 178, 16, 178, 206, 16, 206, 178, 16, 16, 20]
    on, off = (i for i in items if i.command == 206)
    assert (on.param1, on.param2, on.param3, on.frame) == (7.5, 0.0, 1.0, 0)
    assert (off.param1, off.param2, off.param3) == (0.0, 0.0, 0.0)
    assert (kind[5], lane[5], kind[6], lane[6]) == (T, 0, S, 1)


def test_a_lane_that_ends_at_home_switches_off_before_the_end() -> None:
    kind = np.array([T, S, T, S], dtype=np.int8)
    for vehicle, finish in (("boat", [17]), ("rover", []), ("copter", [20])):
        options = PlanOptions(vehicle=vehicle, trigger_distance_m=5.0)
        items, _, _ = build_items(PATH, kind, LANE, options)
        assert [i.command for i in items][-2 - len(finish) :] == [16, 206, *finish]
        assert items[-1 - len(finish)].param1 == 0.0


def photographed_legs(items: Sequence[MissionItem]) -> list[tuple[int, bool]]:
    """Replay: (item, camera on) of each leg, with ArduPilot's meaning of a distance."""
    on, legs = False, []
    for item in items[1:]:
        if item.command == 206:
            on = item.param1 > 0
        elif item.command in (16, 17):
            legs.append((item.seq, on))
    return legs


ROUTES = st.lists(st.sampled_from([T, S]), min_size=2, max_size=40)


@settings(max_examples=150, deadline=None)
@given(
    ROUTES,
    st.sampled_from(["boat", "rover", "copter"]),
    st.sampled_from([2.0, 3.0]),
    st.sampled_from(["lanes", "continuous"]),
)
def test_every_lane_has_the_camera_on_and_every_transit_off(
    kind: list[int], vehicle: str, transit: float, trigger: str
) -> None:
    out = np.array([[8.0 + 1e-4 * i, 47.0 + 1e-4 * (i % 3)] for i in range(len(kind))])
    path = np.vstack([out, out[:1]])
    lane = np.cumsum(np.array(kind) == S) * (np.array(kind) == S)
    options = PlanOptions(
        vehicle=vehicle, transit_speed_m_s=transit, trigger_distance_m=4.0, trigger=trigger
    )
    items, item_kind, item_lane = build_items(path, np.array(kind), lane, options)
    assert count_items(np.array(kind), options) == len(items)
    plain, plain_kind, plain_lane = build_items(
        path, np.array(kind), lane, replace(options, trigger_distance_m=0.0)
    )
    # nothing else changes: without the camera's items it is the mission it was
    kept = [k for k, i in enumerate(items) if i.command != 206]
    assert [replace(items[k], seq=0) for k in kept] == [replace(i, seq=0) for i in plain]
    assert [(item_kind[k], item_lane[k]) for k in kept] == [
        *zip(plain_kind, plain_lane, strict=True)
    ]
    lanes = [k for k in range(len(items)) if item_kind[k] == S]
    for seq, on in photographed_legs(items):
        if trigger == "lanes":
            assert on == (item_kind[seq] == S)
        else:
            assert on == (bool(lanes) and lanes[0] <= seq <= lanes[-1])
    switches = [i.param1 for i in items if i.command == 206]
    assert switches == [4.0, 0.0] * (len(switches) // 2)
    if trigger == "continuous":
        assert len(switches) == (2 if lanes else 0)


@pytest.mark.parametrize("vehicle", ["boat", "rover", "copter"])
@pytest.mark.parametrize("transit", [2.0, 3.0])
@pytest.mark.parametrize("photo_m", [0.0, 5.0])
def test_count_items(vehicle: str, transit: float, photo_m: float) -> None:
    options = PlanOptions(vehicle=vehicle, transit_speed_m_s=transit, trigger_distance_m=photo_m)
    items, _, _ = build_items(PATH, KIND, LANE, options)
    assert count_items(KIND, options) == len(items)
    assert count_items(KIND[:0], options) == 0


def test_degrees_are_rounded_not_truncated() -> None:
    items, _, _ = build_items(
        np.array([[10.0, 50.0], [10.00000009, -50.00000006], [10.0, 50.0]]),
        np.array([S, T]), np.array([1, 0]), PlanOptions(),
    )  # fmt: skip
    assert (items[3].x, items[3].y) == (-500000001, 100000001)


def test_longitude_beyond_the_antimeridian_is_wrapped() -> None:
    items, _, _ = build_items(
        np.array([[179.9, -16.0], [180.1, -16.0], [179.9, -16.0]]),
        np.array([S, T]), np.array([1, 0]), PlanOptions(),
    )  # fmt: skip
    assert items[3].y == -1799000000


def test_no_work_no_items() -> None:
    none = np.zeros(0, dtype=np.int8)
    assert build_items(PATH[:1], none, none, PlanOptions()) == ((), (), ())
    assert build_items(PATH[[0, 0]], np.array([T]), np.array([0]), PlanOptions()) == ((), (), ())


def test_a_path_that_does_not_come_home_is_refused() -> None:
    with pytest.raises(PlanningError, match="end at home"):
        build_items(PATH[:-1], KIND[:-1], LANE[:-1], PlanOptions())
    with pytest.raises(PlanningError, match="point 1"):
        build_items(np.array([[1, 2], [np.nan, 2], [1, 2.0]]), KIND[:2], LANE[:2], PlanOptions())


@given(st.integers(-1_800_000_000, 1_800_000_000))
def test_degrees_give_the_integer_back(value: int) -> None:
    degrees = mavlink.degrees(value)
    assert round(degrees * 1e7) == value
    assert int(degrees * 1e7) == value
    assert mavlink.e7(float(mavlink.degrees_text(value))) == value


def merged(points: list[tuple[float, float]], kind: list[int]) -> list[list[float]]:
    out, k, lane = merge_collinear(
        np.array(points, dtype=float), np.array(kind, dtype=np.int8), np.arange(1, len(kind) + 1)
    )
    assert len(k) == len(lane) == len(out) - 1
    return out.tolist()


def test_merge_drops_points_on_a_line_of_one_kind() -> None:
    assert merged([(0, 0), (1, 0), (3, 0.005), (4, 0)], [S, S, S]) == [[0, 0], [4, 0]]
    assert merged([(0, 0), (1, 0), (2, 0)], [S, T]) == [[0, 0], [1, 0], [2, 0]]


def test_merge_keeps_corners_reversals_and_ends() -> None:
    assert merged([(0, 0), (5, 0), (2, 0), (0, 0)], [S, S, S]) == [[0, 0], [5, 0], [0, 0]]
    assert merged([(0, 0), (1, 0), (2, 0.1)], [S, S]) == [[0, 0], [1, 0], [2, 0.1]]
    assert merged([(0, 0), (0, 0.001), (3, 0), (3, 0.004)], [T, S, S]) == [[0, 0], [3, 0.004]]


def test_merge_gives_the_lane_of_the_longest_piece() -> None:
    _, _, lane = merge_collinear(
        np.array([[0, 0], [1, 0], [9, 0], [10.0, 0]]), np.array([S, S, S]), np.array([4, 5, 6])
    )
    assert lane.tolist() == [5]


@settings(max_examples=100, deadline=None)
@given(
    st.lists(
        st.tuples(st.integers(0, 6), st.integers(0, 3), st.integers(0, 1)), min_size=1, max_size=25
    )
)
def test_merged_path_runs_within_tolerance_of_the_whole_one(
    rows: list[tuple[int, int, int]],
) -> None:
    points = np.array([[x, y] for x, y, _ in rows], dtype=float)
    points[:, 1] *= 0.007
    kind = np.array([k for _, _, k in rows[1:]], dtype=np.int8)
    out, out_kind, _ = merge_collinear(points, kind, np.ones(len(kind), dtype=int))
    assert len(out) >= 1
    assert math.dist(out[0], points[0]) == 0
    assert math.dist(out[-1], points[-1]) == 0
    # every point of the whole path lies near the merged one
    for p in points:
        near = min(
            (distance(p, a, b) for a, b in itertools.pairwise(out)),
            default=math.dist(p, out[0]),
        )
        assert near <= 0.02 + 1e-9
    if set(kind.tolist()) == {S}:
        assert set(out_kind.tolist()) <= {S}


def distance(p: np.ndarray, a: np.ndarray, b: np.ndarray) -> float:
    d = b - a
    t = np.clip(np.dot(p - a, d) / max(np.dot(d, d), 1e-30), 0, 1)
    return float(np.hypot(*(a + t * d - p)))

"""What was driven, against brute force on small tracks."""

from __future__ import annotations

import math

import numpy as np
import pytest
import shapely
from lakes import area_of

from mrmission.model import LegKind
from mrmission.options import PlanOptions
from mrmission.pipeline import plan as plan_fleet
from mrmission.rehearse.judge import Limits, frame_of, judge
from mrmission.rehearse.measures import (
    THIN_M,
    Legs,
    Movement,
    cross_track,
    cross_track_of,
    fence_polygon,
    fence_room_m,
    legs_of_mission,
    nearest_of,
    nearest_of_pairs,
    position_at,
    runs,
    step_weights,
    survey_pieces,
    swept_area,
    swept_of,
    weighted_quantile,
)
from mrmission.rehearse.track import Recorder, Track

LAKE = shapely.Polygon(
    [(0, 0), (300, 0), (320, 160), (150, 220), (0, 200)], [[(120, 90), (160, 95), (140, 130)]]
)


@pytest.fixture(scope="module")
def plan():
    options = PlanOptions(robots=2, swath_m=20.0, method="minmax", time_budget_s=0.2)
    return plan_fleet(area_of(LAKE, lon_deg=8.5, lat_deg=47.3), options)


def sailed(plan, shift_m=(0.0, 0.0), speed_m_s=2.0, step_m=0.5, until=1.0) -> list[Track]:
    """Perfect voyages along the plan, moved aside by `shift_m`, cut off after a share `until`."""
    frame, tracks = frame_of(plan), []
    for mission in plan.missions:
        legs = legs_of_mission(mission, frame)
        seq_of = {leg: seq for seq, leg in enumerate(legs.index) if leg >= 0}
        log = Recorder(mission.robot, mission.robot)
        log.started_s, now_s = 100.0, 100.0
        rows = []
        for leg in range(len(legs.kind)):
            way = legs.end_m[leg] - legs.start_m[leg]
            count = max(1, math.ceil(math.hypot(*way) / step_m))
            for i in range(count):
                rows.append((legs.start_m[leg] + way * i / count, seq_of[leg], now_s))
                now_s += math.hypot(*way) / count / speed_m_s
        rows.append((legs.end_m[-1], seq_of[len(legs.kind) - 1], now_s + 1e-3))
        rows = rows[: max(2, int(until * len(rows)))]
        for (_place, seq, at_s), (lon, lat) in zip(
            rows, frame.to_lonlat(np.array([r[0] for r in rows]) + shift_m).tolist(), strict=True
        ):
            log.item = seq
            log.position(at_s, lon, lat, math.nan)
        if until == 1.0:
            log.ended_s, log.end_text = log.now_s, "home"
        tracks.append(log.track())
    return tracks


def test_a_perfect_voyage_sweeps_what_was_planned_without_any_offset(plan) -> None:
    driven = judge(plan, sailed(plan), limits=Limits())
    # the track is thinned by THIN_M and the radius made as much smaller
    assert driven.coverage.share == pytest.approx(plan.report.coverage, abs=4e-4)
    assert driven.coverage.share <= plan.report.coverage + 1e-9
    assert driven.coverage_survey_legs.share == pytest.approx(
        plan.report.coverage_survey_legs, abs=4e-4
    )
    assert driven.cross_track.max_m < 1e-2  # positions are rounded by projection alone
    lanes_m = sum(row.survey_m for row in plan.report.robots)
    assert driven.cross_track.length_m == pytest.approx(lanes_m, rel=0.02)
    for row, report in zip(driven.robots, plan.report.robots, strict=True):
        assert row.home
        assert row.home_m < 0.01
        assert row.driven_m == pytest.approx(report.length_m, rel=1e-3)
        assert row.coverage == pytest.approx(1.0, abs=2e-3)
        assert row.fence_room_m > 0
        assert row.lanes >= report.lanes  # a lane that was cut is swept in several runs


def test_a_voyage_beside_its_lanes_has_the_offset_it_was_given(plan) -> None:
    bearing = math.radians(plan.report.angle_deg)
    aside = 3.0 * np.array([math.cos(bearing), -math.sin(bearing)])  # across the lanes
    driven = judge(plan, sailed(plan, shift_m=aside), limits=Limits())
    assert driven.cross_track.p95_m == pytest.approx(3.0, abs=0.05)
    assert driven.cross_track.settled_mean_m == pytest.approx(3.0, abs=0.3)
    assert driven.coverage.share < plan.report.coverage - 5e-4
    assert any("lanes were kept to 3.0" in line for line in driven.violations)
    assert all(row.home_m == pytest.approx(3.0, abs=0.05) for row in driven.robots)


def test_half_a_voyage_is_not_home_and_sweeps_less(plan) -> None:
    driven = judge(plan, sailed(plan, until=0.5), limits=Limits())
    assert 0.2 < driven.coverage.share < 0.8
    assert sum("is not home" in line for line in driven.violations) == 2
    assert math.isnan(driven.robots[0].driven_s)


def test_delays_shift_the_common_clock(plan) -> None:
    tracks = sailed(plan)
    together = judge(plan, tracks, limits=Limits())
    apart = judge(plan, tracks, limits=Limits(), delays_s={1: 10_000.0})
    assert together.nearest is not None
    assert apart.nearest is None
    assert apart.driven_makespan_s > 10_000


def test_the_plans_own_delays_keep_a_punctual_fleet_apart(plan) -> None:
    delays = {row.robot: row.start_delay_s for row in plan.report.robots}
    assert min(delays.values()) == 0
    assert max(delays.values()) > 0
    assert any(note.startswith("launch robot") for note in plan.report.notes)
    together = judge(plan, sailed(plan), limits=Limits()).nearest
    apart = judge(plan, sailed(plan), limits=Limits(), delays_s=delays).nearest
    assert together is not None
    assert together.distance_m < 16  # berths are 15 m apart
    assert apart is None or apart.distance_m >= 20.0 - 1e-6


# --- swept area ----------------------------------------------------------------------------------


def test_swept_area_against_distances_of_points() -> None:
    rng = np.random.default_rng(5)
    track = np.cumsum(rng.normal(0, 3, (200, 2)), axis=0)
    swath = 4.0
    area = swept_area([track[:120], track[120:121], track[130:]], swath)
    shapely.prepare(area)
    probes = rng.uniform(track.min(axis=0) - 5, track.max(axis=0) + 5, (4000, 2))
    lines = shapely.MultiLineString([track[:120], track[130:]]).union(shapely.Point(track[120]))
    distance = shapely.distance(shapely.points(probes), lines)
    inside = shapely.contains(area, shapely.points(probes))
    # never too generous, and short by no more than the thinning and the arcs' chords
    assert not inside[distance > swath / 2 + 1e-9].any()
    assert inside[distance < swath / 2 - 2 * THIN_M - 0.005 * swath].all()


def test_swept_share_and_the_largest_missed_piece() -> None:
    target = shapely.box(0, 0, 100, 10)
    swept = shapely.union(shapely.box(0, 0, 40, 10), shapely.box(45, 0, 98, 10))
    found = swept_of(target, swept)
    assert found.share == pytest.approx(0.93)
    assert found.missed_m2 == pytest.approx(70.0)
    assert found.largest_missed_m2 == pytest.approx(50.0)
    assert swept_of(target, target).missed_lonlat is None


def test_nothing_sailed_sweeps_nothing() -> None:
    assert swept_area([], 10.0).is_empty
    assert swept_area([np.zeros((0, 2))], 10.0).is_empty


# --- cross-track ---------------------------------------------------------------------------------


def two_lanes() -> Legs:
    """Home, a transit north, a lane east in two pieces, a transit, a lane back west."""
    points = np.array([(0, 0), (0, 10), (50, 10), (100, 10), (100, 30), (0, 30.0)])
    kind = [LegKind.TRANSIT, LegKind.SURVEY, LegKind.SURVEY, LegKind.TRANSIT, LegKind.SURVEY]
    return Legs(
        start_m=points[:-1],
        end_m=points[1:],
        kind=np.array(kind, dtype=np.int64),
        lane=np.array([0, 1, 1, 0, 2]),
        index=np.array([-1, 0, 1, -1, 2, 3, 4, -1]),  # item 3 is a command without a place
    )


def test_cross_track_of_known_points() -> None:
    legs = two_lanes()
    points = np.array(
        [(0, 5), (-1, 10), (10, 12), (60, 9), (120, 11), (100, 20), (50, 31.5), (-3, 30)]
    )
    item = np.array([1, 2, 2, 4, 4, 5, 6, 6])
    offset, along = cross_track(points.astype(float), item, legs)
    # transit, before the lane, 2 m to port, 1 m to starboard on its second piece, beyond its
    # end, transit, 1.5 m to starboard going west, beyond
    want = [math.nan, math.nan, -2.0, 1.0, math.nan, math.nan, 1.5, math.nan]
    assert offset == pytest.approx(want, nan_ok=True)
    assert along == pytest.approx(
        [math.nan, math.nan, 10.0, 60.0, math.nan, math.nan, 50.0, math.nan], nan_ok=True
    )


def test_figures_are_weighted_by_distance_sailed() -> None:
    offset = np.array([5.0] * 90 + [1.0] * 10)
    along = np.array([2.0] * 90 + [50.0] * 10)
    weight = np.array([0.01] * 90 + [10.0] * 10)  # ninety positions of a boat that stood still
    found = cross_track_of(offset, along, weight)
    assert found.p95_m == 1.0
    assert found.max_m == 5.0
    assert found.mean_m == pytest.approx((5 * 0.9 + 1 * 100) / 100.9)
    assert found.settled_max_m == 1.0
    empty = cross_track_of(np.full(3, np.nan), np.full(3, np.nan), np.ones(3))
    assert math.isnan(empty.p95_m)


def test_weighted_quantile_is_the_plain_one_for_equal_weights() -> None:
    rng = np.random.default_rng(2)
    values = rng.uniform(0, 1, 1000)
    assert weighted_quantile(values, np.ones(1000), 0.95) == np.sort(values)[949]
    assert step_weights(np.array([(0, 0), (1, 0), (4, 0.0)])).tolist() == [0.5, 2.0, 1.5]


def test_survey_stretches_begin_where_their_lane_begins() -> None:
    legs = two_lanes()
    item = np.array([1, 1, 2, 2, 4, 5, 5, 6])
    points = np.column_stack([np.arange(8.0), np.zeros(8)])
    pieces = survey_pieces(points, item, legs)
    assert [p[:, 0].tolist() for p in pieces] == [[1, 2, 3, 4], [6, 7]]
    assert runs(np.array([True, False, True, True])) == [(0, 1), (2, 4)]


# --- separation ----------------------------------------------------------------------------------


def movement(robot: int, rng: np.random.Generator, start_s: float) -> Movement:
    time_s = start_s + np.cumsum(rng.uniform(0.5, 3.0, 40))
    points = np.cumsum(rng.normal(0, 4, (40, 2)), axis=0) + rng.normal(0, 15, 2)
    return Movement(robot=robot, time_s=time_s, points_m=points)


@pytest.mark.parametrize("seed", range(8))
def test_least_distance_against_fine_sampling(seed: int) -> None:
    rng = np.random.default_rng(seed)
    a, b = movement(1, rng, 0.0), movement(2, rng, rng.uniform(-20, 20))
    found = nearest_of(a, b)
    times = np.arange(max(a.time_s[0], b.time_s[0]), min(a.time_s[-1], b.time_s[-1]), 0.001)
    sampled = np.hypot(*(position_at(a, times) - position_at(b, times)).T)
    assert found is not None
    assert found.distance_m == pytest.approx(sampled.min(), abs=0.02)
    assert found.distance_m <= sampled.min() + 1e-9
    at = np.array([found.time_s])
    here, there = position_at(a, at)[0], position_at(b, at)[0]
    assert math.hypot(*(here - there)) == pytest.approx(found.distance_m, abs=1e-9)
    assert found.place_m == pytest.approx(((here + there) / 2).tolist())


def test_vehicles_that_are_never_out_together_do_not_meet() -> None:
    still = np.zeros((2, 2))
    a = Movement(robot=1, time_s=np.array([0.0, 10.0]), points_m=still)
    b = Movement(robot=2, time_s=np.array([11.0, 20.0]), points_m=still)
    c = Movement(robot=3, time_s=np.array([10.0, 12.0]), points_m=still + 3.0)
    assert nearest_of(a, b) is None
    touching = nearest_of(a, c)
    assert touching is not None
    assert touching.time_s == 10.0
    again = Movement(robot=1, time_s=np.array([11.0, 12.0]), points_m=still + 2.0)
    # of the trips of a vehicle, the one that came nearest; nothing of those never out together
    met = {m.robots: m.distance_m for m in nearest_of_pairs([again, c, a])}
    assert met == {(1, 3): pytest.approx(math.hypot(1, 1))}
    assert {m.robots for m in nearest_of_pairs([again, c, a, b])} == {(1, 2), (1, 3), (2, 3)}


# --- fence ---------------------------------------------------------------------------------------


def test_room_to_the_fence_is_negative_outside(plan) -> None:
    fence = shapely.box(0, 0, 10, 10).difference(shapely.box(4, 4, 6, 6))
    assert fence_room_m(np.array([(2.0, 5.0), (8.0, 8.0)]), fence) == pytest.approx(2.0)
    assert fence_room_m(np.array([(2.0, 5.0), (5.0, 5.5)]), fence) == pytest.approx(-0.5)
    allowed = fence_polygon(plan.missions[0], frame_of(plan))
    assert allowed is not None
    margin = plan.report.options["fence_margin_m"]
    track = shapely.LineString(plan.paths[0].points_m)
    assert allowed.buffer(-margin + 0.01).covers(track)

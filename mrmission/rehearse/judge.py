"""A plan and the tracks of its voyage become figures, and what is outside the limits."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
import shapely

from mrmission.area.frame import LocalFrame
from mrmission.model import CoveragePath, FleetPlan, FloatArray, LegKind, Mission, SortieReport
from mrmission.rehearse.measures import (
    CrossTrack,
    Legs,
    Meeting,
    Movement,
    Swept,
    cross_track,
    cross_track_of,
    fence_polygon,
    fence_room_m,
    legs_of_mission,
    nearest_of_pairs,
    step_weights,
    survey_pieces,
    swept_area,
    swept_of,
    weighted_quantile,
)
from mrmission.rehearse.pilot import hold_s
from mrmission.rehearse.track import Track
from mrmission.tour.coverage import leg_buffers
from mrmission.tour.path import legs_of

TRUTH_WINDOW = 12
"""Positions before and after a true one among which its place on the track is looked for."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Limits:
    """What a rehearsal must keep to.

    Attributes
    ----------
    coverage
        Least share of the coverable area that is swept, all legs.
    cross_track_m
        Largest 95th percentile of the distance from the lanes.
    distance_m
        Least distance between two vehicles that are both under way.
    home_m
        Farthest from home that a vehicle may be at its end, and while its end is watched.
    """

    coverage: float = 0.995
    cross_track_m: float = 2.0
    distance_m: float = 10.0
    home_m: float = 10.0


@dataclass(frozen=True, slots=True, kw_only=True)
class RobotDriven:
    """One row of the table: what one robot did on one trip against what it was to do.

    ``start_delay_s`` is when the trip begins, after the fleet's start. ``coverage`` is the share of
    what its plan sweeps that it swept. ``home_m`` is the distance from home when the last waypoint
    was reached, ``watched_m`` the largest one afterwards and ``left_m`` the one at the end of the
    watch. ``fence_room_m`` is the least distance from its
    fence, negative outside. ``estimate_m`` is the 95th percentile of the distance between where
    a simulator says that it was and the track that it told, NaN where it does not say.
    ``fence_events`` counts the breaches told while under way, ``fence_events_at_end`` those of a
    vehicle that drifted off while its end was watched.
    """

    robot: int
    sortie: int
    system_id: int
    end: str
    home: bool
    lanes: int
    start_delay_s: float
    planned_s: float
    driven_s: float
    planned_m: float
    driven_m: float
    coverage: float
    cross_track: CrossTrack
    fence_events: int
    fence_events_at_end: int
    fence_room_m: float
    home_m: float
    watched_s: float
    watched_m: float
    left_m: float
    estimate_m: float
    warnings: tuple[str, ...]


@dataclass(frozen=True, slots=True, kw_only=True)
class PairDriven:
    """How near two robots came, against what the plan promised.

    ``planned_m`` is the least distance that the plan allows for with its times wrong by as much as
    it assumes (:mod:`mrmission.tour.separation`); None where it did not look, or where the two
    were never to be under way together. ``driven`` is None where they never were.
    """

    robots: tuple[int, int]
    planned_m: float | None
    driven: Meeting | None

    @property
    def short_m(self) -> float:
        """By how much they came nearer than planned; negative where they stayed farther apart."""
        if self.planned_m is None or self.driven is None:
            return -math.inf
        return self.planned_m - self.driven.distance_m


@dataclass(frozen=True, slots=True, kw_only=True)
class FleetDriven:
    """What a rehearsal brought; ``rehearse.json`` is this, field by field."""

    area: str
    robots: tuple[RobotDriven, ...]
    planned_coverage: float
    planned_coverage_survey_legs: float
    coverage: Swept
    coverage_survey_legs: Swept
    cross_track: CrossTrack
    pairs: tuple[PairDriven, ...]
    nearest: Meeting | None
    nearest_lonlat: tuple[float, float] | None
    planned_makespan_s: float
    driven_makespan_s: float
    fence_events: int
    limits: Limits
    violations: tuple[str, ...]
    waters: Mapping[str, object]
    options: Mapping[str, object]
    versions: Mapping[str, str]


def frame_of(plan: FleetPlan) -> LocalFrame:
    """Return the frame of a plan."""
    return LocalFrame.of(plan.area)


def judge(
    plan: FleetPlan,
    tracks: Sequence[Track],
    *,
    limits: Limits,
    delays_s: Mapping[int, float] | None = None,
    waters: Mapping[str, object] | None = None,
) -> FleetDriven:
    """Measure what was driven against the plan.

    Parameters
    ----------
    plan
        What was to be sailed.
    tracks
        One per robot that sailed, and sortie.
    limits
        What counts as a violation.
    delays_s
        Seconds after the fleet's start at which each robot's first trip started; 0 where not
        given. Its others follow as planned. The
        vehicles' clocks run by themselves in a simulator, so the fleet's time of a vehicle is
        its own time since its start, and its delay.
    waters
        How it was sailed, for the record.
    """
    frame = frame_of(plan)
    swath_m = float(plan.report.options["swath_m"])
    delays = dict(delays_s or {})
    missions = {(m.robot, m.sortie): m for m in plan.missions}
    paths = {(p.robot, p.sortie): p for p in plan.paths}
    trips = {(r.robot, t.sortie): t for r in plan.report.robots for t in r.trips}
    rows: list[RobotDriven] = []
    swept, swept_survey, movements = [], [], []
    offsets, alongs, weights = [], [], []
    for track in sorted(tracks, key=lambda t: (t.robot, t.sortie)):
        which = track.robot, track.sortie
        mission, path, trip = missions[which], paths[which], trips[which]
        delay_s = delays.get(track.robot, 0.0) + trip.start_s
        if hold_s(mission, 1) > 0:  # it has waited by itself: that is its delay
            waited, track = track, track.set_off()
            delay_s = track.started_s - waited.started_s
        legs = legs_of_mission(mission, frame)
        points = track.points_m(frame)
        way = track.under_way()
        mine = swept_area([points[way]], swath_m)
        swept.append(mine)
        swept_survey.append(swept_area(survey_pieces(points[way], track.item[way], legs), swath_m))
        offset, along = cross_track(points[way], track.item[way], legs)
        weight = step_weights(points[way])
        offsets.append(offset)
        alongs.append(along)
        weights.append(weight)
        if way.any():
            movements.append(
                Movement(
                    robot=track.robot,
                    time_s=track.time_s[way] - track.started_s + delay_s,
                    points_m=points[way],
                )
            )
        rows.append(
            _row(
                plan, track, mission, path, trip, legs, points, frame,
                swept_m=mine,
                cross=cross_track_of(offset, along, weight),
                delay_s=delay_s,
            )
        )  # fmt: skip
    none = np.zeros(0)
    pairs = _pairs(plan, nearest_of_pairs(movements))
    met = min((p.driven for p in pairs if p.driven), key=lambda m: m.distance_m, default=None)
    driven = FleetDriven(
        area=plan.area.name,
        robots=tuple(rows),
        planned_coverage=plan.report.coverage,
        planned_coverage_survey_legs=plan.report.coverage_survey_legs,
        coverage=swept_of(plan.region_m, shapely.union_all(swept), frame),
        coverage_survey_legs=swept_of(plan.region_m, shapely.union_all(swept_survey), frame),
        cross_track=cross_track_of(
            np.concatenate([none, *offsets]),
            np.concatenate([none, *alongs]),
            np.concatenate([none, *weights]),
        ),
        pairs=pairs,
        nearest=met,
        nearest_lonlat=_lonlat(frame, met),
        planned_makespan_s=max((r.planned_s + r.start_delay_s for r in rows), default=0.0),
        driven_makespan_s=max((r.driven_s + r.start_delay_s for r in rows), default=0.0),
        fence_events=sum(r.fence_events for r in rows),
        limits=limits,
        violations=(),
        waters=dict(waters or {}),
        options=plan.report.options,
        versions=plan.report.versions,
    )
    return _with_violations(driven)


def _pairs(plan: FleetPlan, met: Sequence[Meeting]) -> tuple[PairDriven, ...]:
    """Return how near each two robots came, and were to come."""
    planned = {p.robots: p.least_m for p in plan.report.separation.pairs}
    driven = {m.robots: m for m in met}
    return tuple(
        PairDriven(robots=pair, planned_m=planned.get(pair), driven=driven.get(pair))
        for pair in sorted({*planned, *driven})
    )


def _lonlat(frame: LocalFrame, met: Meeting | None) -> tuple[float, float] | None:
    if met is None:
        return None
    lon, lat = frame.to_lonlat(np.array(met.place_m))
    return float(lon), float(lat)


def _row(
    plan: FleetPlan,
    track: Track,
    mission: Mission,
    path: CoveragePath,
    trip: SortieReport,
    legs: Legs,
    points_m: FloatArray,
    frame: LocalFrame,
    *,
    swept_m: shapely.Geometry,
    cross: CrossTrack,
    delay_s: float,
) -> RobotDriven:
    swath_m = float(plan.report.options["swath_m"])
    way, after = track.under_way(), track.afterwards()
    own = shapely.intersection(
        plan.region_m, shapely.union_all(leg_buffers(legs_of(path), swath_m / 2))
    )
    allowed = fence_polygon(mission, frame)
    from_home = np.hypot(*(points_m - path.points_m[-1]).T) if len(points_m) else np.zeros(0)
    at_end = from_home[way][-1] if way.any() else math.nan
    breaches = np.array([b.time_s for b in track.breaches], dtype=np.float64)
    late = breaches > (track.ended_s if track.home else math.inf)
    return RobotDriven(
        robot=track.robot,
        sortie=track.sortie,
        system_id=track.system_id,
        end=track.end_text,
        home=track.home,
        lanes=len(np.unique(legs.lane[legs.kind == LegKind.SURVEY])),
        start_delay_s=delay_s,
        planned_s=trip.duration_s,
        driven_s=track.duration_s,
        planned_m=trip.length_m,
        driven_m=float(np.hypot(*np.diff(points_m[way], axis=0).T).sum()) if way.any() else 0.0,
        coverage=swept_of(own, swept_m).share if own.area > 0 else 1.0,
        cross_track=cross,
        fence_events=int((~late).sum()),
        fence_events_at_end=int(late.sum()),
        fence_room_m=math.nan if allowed is None else fence_room_m(points_m[way], allowed),
        home_m=float(at_end),
        watched_s=float(track.time_s[-1] - track.ended_s) if track.home and after.any() else 0.0,
        watched_m=float(from_home[after].max()) if after.any() else math.nan,
        left_m=float(from_home[after][-1]) if after.any() else math.nan,
        estimate_m=estimate_error_m(track, points_m, frame),
        warnings=tuple(f"{s.time_s - track.started_s:.0f} s: {s.text}" for s in track.texts
                       if s.severity <= 4 and s.time_s >= track.started_s),
    )  # fmt: skip


def estimate_error_m(track: Track, points_m: FloatArray, frame: LocalFrame) -> float:
    """Return the 95th percentile of the distance between true positions and the track told, m.

    A true position comes without a time of its own, so it is compared with the polyline of the
    positions about it, not with one of them.
    """
    truth = track.truth[(track.truth[:, 0] >= track.started_s)] if len(track.truth) else track.truth
    if not len(truth) or len(points_m) < 2:
        return math.nan
    lonlat = truth[:, 1:].copy()
    lonlat[:, 0] = frame.lon_deg + (lonlat[:, 0] - frame.lon_deg + 180.0) % 360.0 - 180.0
    at = np.searchsorted(track.time_s, truth[:, 0])
    ends = np.clip(
        at[:, None] + np.arange(-TRUTH_WINDOW, TRUTH_WINDOW + 1)[None], 0, len(points_m) - 1
    )
    lines = shapely.linestrings(points_m[ends])
    distance = shapely.distance(lines, shapely.points(frame.to_metric(lonlat)))
    return weighted_quantile(distance, np.ones(len(distance)), 0.95)


def _with_violations(driven: FleetDriven) -> FleetDriven:
    from dataclasses import replace

    limits, found = driven.limits, []
    several = any(row.sortie > 1 for row in driven.robots)
    for row in driven.robots:
        who = f"robot {row.robot}" + (f", sortie {row.sortie}," if several else "")
        if not row.home:
            found.append(f"{who} is not home: {row.end}")
        elif not row.home_m <= limits.home_m:
            found.append(
                f"{who} ends {row.home_m:.1f} m from home, the limit is {limits.home_m:g} m"
            )
        if row.watched_s and not row.watched_m <= limits.home_m:
            found.append(
                f"{who} drifts: up to {row.watched_m:.1f} m from home while its end "
                f"was watched for {row.watched_s:.0f} s, the limit is {limits.home_m:g} m"
            )
        if row.fence_events:
            found.append(f"{who} breached its fence on its way, {row.fence_events} times")
    if driven.coverage.share < limits.coverage:
        found.append(
            f"{driven.coverage.share:.2%} of the coverable area was swept, the limit is "
            f"{limits.coverage:.2%}; the largest piece missed has "
            f"{driven.coverage.largest_missed_m2:.1f} m²"
        )
    if driven.cross_track.p95_m > limits.cross_track_m:
        found.append(
            f"95 % of the lanes were kept to {driven.cross_track.p95_m:.2f} m, the limit is "
            f"{limits.cross_track_m:g} m"
        )
    if driven.nearest is not None and driven.nearest.distance_m < limits.distance_m:
        met = driven.nearest
        found.append(
            f"robots {met.robots[0]} and {met.robots[1]} came within {met.distance_m:.1f} m of "
            f"each other after {met.time_s:.0f} s, the limit is {limits.distance_m:g} m"
        )
    return replace(driven, violations=tuple(found))

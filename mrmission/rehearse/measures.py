r"""What was driven against what was planned: swept area, cross-track, separation, time, fence.

Which legs count
----------------
The plan's own coverage counts every leg, as the sensor of a boat stays on from its start to its
end; so does the driven coverage. Beside it stands the coverage of the *survey legs alone*: the
positions at which the vehicle steered for the end of a lane or of an extra leg. The target is the
same for the plan and for what was driven: the parts of the navigable region that were planned.

Swept area
----------
The track is the polyline of the positions between the start of the mission and its last waypoint.
It is thinned to :data:`THIN_M` first, and the radius is half the swath less that much: a point
counted as swept is within half a swath of the track itself.

Separation
----------
Between two positions a vehicle is taken to move straight on at constant speed. The distance of two
such movements, :math:`|r + v t|`, is smallest at :math:`t = -r \cdot v / |v|^2`, cut to the
interval: the least distance is exact for the polylines, not sampled.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import combinations

import numpy as np
import numpy.typing as npt
import shapely

from mrmission.area.frame import LocalFrame
from mrmission.mission import mavlink
from mrmission.model import BoolArray, FloatArray, IntArray, LegKind, Mission
from mrmission.tour.coverage import leg_buffers

THIN_M = 0.02
"""How far a track may be moved when it is thinned, m."""

SETTLED_M = 10.0
"""Run-in after which a vehicle counts as settled on its lane, m."""

_CHUNK = 64
"""Legs whose buffers are united at a time; a union of all at once keeps every vertex alive."""


# --- legs ----------------------------------------------------------------------------------------


@dataclass(frozen=True, slots=True, kw_only=True)
class Legs:
    """The legs of a mission in the local frame, by the item at their end.

    ``start_m``/``end_m`` are (n, 2), ``kind`` and ``lane`` (n,) as in the mission, ``index[seq]``
    is the leg that ends at item `seq`, -1 where none does.
    """

    start_m: FloatArray
    end_m: FloatArray
    kind: IntArray
    lane: IntArray
    index: IntArray


def legs_of_mission(mission: Mission, frame: LocalFrame) -> Legs:
    """Return the legs between the positions of a mission, home first."""
    rows = [
        (seq, item)
        for seq, item in enumerate(mission.items)
        if item.command in mavlink.NAVIGATION and (item.x or item.y)
    ]
    lonlat = np.array([(i.y / 1e7, i.x / 1e7) for _, i in rows], dtype=np.float64).reshape(-1, 2)
    lonlat[:, 0] = frame.lon_deg + (lonlat[:, 0] - frame.lon_deg + 180.0) % 360.0 - 180.0
    points = frame.to_metric(lonlat) if len(lonlat) else np.zeros((0, 2))
    index = np.full(len(mission.items) + 1, -1, dtype=np.int64)
    for leg, (seq, _) in enumerate(rows[1:]):
        index[seq] = leg
    ends = [seq for seq, _ in rows[1:]]
    described = len(mission.kind) == len(mission.items)
    return Legs(
        start_m=points[:-1],
        end_m=points[1:],
        kind=np.array([mission.kind[s] if described else 0 for s in ends], dtype=np.int64),
        lane=np.array([mission.lane[s] if described else 0 for s in ends], dtype=np.int64),
        index=index,
    )


# --- swept area ----------------------------------------------------------------------------------


@dataclass(frozen=True, slots=True, kw_only=True)
class Swept:
    """Share of a target that was swept, and the largest piece that was not.

    ``missed_lonlat`` is a point of the largest missed piece, None where nothing is missed.
    """

    share: float
    missed_m2: float
    largest_missed_m2: float
    missed_lonlat: tuple[float, float] | None


def runs(mask: BoolArray) -> list[tuple[int, int]]:
    """Return the half-open index ranges in which a mask is true."""
    edges = np.flatnonzero(np.diff(np.concatenate([[0], mask.astype(np.int8), [0]])))
    return [(int(a), int(b)) for a, b in zip(edges[::2], edges[1::2], strict=True)]


def swept_area(pieces_m: Sequence[FloatArray], swath_m: float) -> shapely.Geometry:
    """Return everything within half a swath of some polylines.

    Parameters
    ----------
    pieces_m
        Polylines of shape (n, 2), m; one of a single point is that point.
    swath_m
        Width of the footprint.
    """
    legs: list[FloatArray] = []
    for points in pieces_m:
        if len(points) == 0:
            continue
        if len(points) == 1:
            legs.append(np.stack([points, points], axis=1))
            continue
        thin = shapely.get_coordinates(shapely.simplify(shapely.LineString(points), THIN_M))
        legs.append(np.stack([thin[:-1], thin[1:]], axis=1))
    if not legs:
        return shapely.Polygon()
    # leg by leg: the buffer of a long line that runs back over itself loses some of it
    buffers = leg_buffers(np.concatenate(legs), swath_m / 2 - THIN_M)
    parts = [shapely.union_all(buffers[i : i + _CHUNK]) for i in range(0, len(buffers), _CHUNK)]
    return shapely.union_all(np.array(parts, dtype=object))


def swept_of(
    target_m: shapely.Geometry, swept_m: shapely.Geometry, frame: LocalFrame | None = None
) -> Swept:
    """Return which share of a target lies in a swept area."""
    missed = shapely.difference(target_m, swept_m)
    pieces = shapely.get_parts(missed)
    pieces = pieces[shapely.area(pieces) > 0]
    place = None
    if len(pieces) and frame is not None:
        worst = pieces[int(np.argmax(shapely.area(pieces)))]
        lon, lat = frame.to_lonlat(shapely.get_coordinates(worst.representative_point()))[0]
        place = (float(lon), float(lat))
    return Swept(
        share=1.0 - float(missed.area) / float(target_m.area),
        missed_m2=float(missed.area),
        largest_missed_m2=float(shapely.area(pieces).max(initial=0.0)),
        missed_lonlat=place,
    )


def survey_pieces(points_m: FloatArray, item: IntArray, legs: Legs) -> list[FloatArray]:
    """Return the stretches of a track on which the vehicle steered for the end of a survey leg."""
    active = leg_kinds(item, legs) == LegKind.SURVEY
    # the position before a stretch is where it begins: the item had just been reached
    return [points_m[max(a - 1, 0) : b] for a, b in runs(active)]


def leg_kinds(item: IntArray, legs: Legs) -> IntArray:
    """Return (n,) the kind of the leg steered along at each position, -1 where there is none."""
    leg = legs.index[np.minimum(item, len(legs.index) - 1)]
    if not len(legs.kind):
        return np.full(len(item), -1, dtype=np.int64)
    return np.where(leg >= 0, legs.kind[np.maximum(leg, 0)], -1)


# --- cross-track ---------------------------------------------------------------------------------


@dataclass(frozen=True, slots=True, kw_only=True)
class CrossTrack:
    """Distance from the lanes, weighted by distance sailed.

    ``mean_m``, ``p95_m`` and ``max_m`` count every position whose foot lies on its leg: from the
    lane's first point to its last, turns included. The ``settled`` ones leave out the first
    :data:`SETTLED_M` of each lane. ``share`` is the part of the survey length that was counted.
    """

    mean_m: float
    p95_m: float
    max_m: float
    settled_mean_m: float
    settled_p95_m: float
    settled_max_m: float
    length_m: float


def cross_track(points_m: FloatArray, item: IntArray, legs: Legs) -> tuple[FloatArray, FloatArray]:
    """Return the offsets from the lanes and how far along its lane each was measured.

    Parameters
    ----------
    points_m
        (n, 2) positions, local frame.
    item
        (n,) the item steered for.
    legs
        Of the mission.

    Returns
    -------
    offset_m : (n,) array
        Distance from the leg's line, to starboard positive; NaN on transits and where the foot
        of the position lies outside its leg.
    along_m : (n,) array
        From the first point of the lane that the leg belongs to; NaN likewise.
    """
    offset = np.full(len(points_m), np.nan)
    along = np.full(len(points_m), np.nan)
    if not len(legs.kind):
        return offset, along
    leg = legs.index[np.minimum(item, len(legs.index) - 1)]
    used = np.flatnonzero((leg >= 0) & (leg_kinds(item, legs) == LegKind.SURVEY))
    mine = leg[used]
    way = legs.end_m - legs.start_m
    length = np.hypot(way[:, 0], way[:, 1])
    unit = way / np.where(length > 0, length, 1.0)[:, None]
    before = np.where(
        np.concatenate([[False], (np.diff(legs.lane) == 0) & (legs.kind[1:] == LegKind.SURVEY)]),
        1,
        0,
    )
    from_lane = np.zeros(len(length))
    for i in np.flatnonzero(before):
        from_lane[i] = from_lane[i - 1] + length[i - 1]
    away = points_m[used] - legs.start_m[mine]
    foot = (away * unit[mine]).sum(axis=1)
    on = (foot >= 0) & (foot <= length[mine]) & (length[mine] > 0)
    across = away[:, 0] * unit[mine, 1] - away[:, 1] * unit[mine, 0]
    offset[used[on]] = across[on]
    along[used[on]] = (from_lane[mine] + foot)[on]
    return offset, along


def step_weights(points_m: FloatArray) -> FloatArray:
    """Return (n,) metres of track that each position stands for: half the way to each neighbour."""
    if len(points_m) < 2:
        return np.zeros(len(points_m))
    step = np.hypot(*np.diff(points_m, axis=0).T)
    return np.asarray((np.append(0.0, step) + np.append(step, 0.0)) / 2)


def weighted_quantile(values: FloatArray, weights: FloatArray, share: float) -> float:
    """Return the least value below or at which `share` of the weight lies; NaN of nothing."""
    if not len(values) or weights.sum() <= 0:
        return math.nan
    order = np.argsort(values, kind="stable")
    total = np.cumsum(weights[order])
    at = int(np.searchsorted(total, share * total[-1] * (1 - 1e-12)))
    return float(values[order][min(at, len(values) - 1)])


def cross_track_of(offset_m: FloatArray, along_m: FloatArray, weight_m: FloatArray) -> CrossTrack:
    """Return the figures of offsets from the lanes (of one vehicle, or of all joined)."""
    some = np.isfinite(offset_m)
    settled = some & (np.nan_to_num(along_m) >= SETTLED_M)

    def figures(mask: BoolArray) -> tuple[float, float, float]:
        values, weights = np.abs(offset_m[mask]), weight_m[mask]
        if not len(values) or weights.sum() <= 0:
            return math.nan, math.nan, math.nan
        mean = float((values * weights).sum() / weights.sum())
        return mean, weighted_quantile(values, weights, 0.95), float(values.max())

    every, after = figures(some), figures(settled)
    return CrossTrack(
        mean_m=every[0],
        p95_m=every[1],
        max_m=every[2],
        settled_mean_m=after[0],
        settled_p95_m=after[1],
        settled_max_m=after[2],
        length_m=float(weight_m[some].sum()),
    )


# --- separation ----------------------------------------------------------------------------------


@dataclass(frozen=True, slots=True, kw_only=True)
class Movement:
    """Where a vehicle was when: ``time_s`` (n,) rising, ``points_m`` (n, 2), from start to end."""

    robot: int
    time_s: FloatArray
    points_m: FloatArray


@dataclass(frozen=True, slots=True, kw_only=True)
class Meeting:
    """The least distance of two vehicles, when it was, and half-way between them."""

    robots: tuple[int, int]
    distance_m: float
    time_s: float
    place_m: tuple[float, float]


def position_at(movement: Movement, time_s: FloatArray) -> FloatArray:
    """Return (n, 2) positions at some times, straight between the known ones."""
    return np.column_stack(
        [np.interp(time_s, movement.time_s, movement.points_m[:, axis]) for axis in (0, 1)]
    )


def nearest_of(a: Movement, b: Movement) -> Meeting | None:
    """Return the least distance of two movements while both go on; None when they never do."""
    start = max(a.time_s[0], b.time_s[0])
    end = min(a.time_s[-1], b.time_s[-1])
    if end < start:
        return None
    knots = np.union1d(a.time_s, b.time_s)
    knots = np.unique(np.concatenate([[start], knots[(knots > start) & (knots < end)], [end]]))
    here, there = position_at(a, knots), position_at(b, knots)
    apart = there - here
    if len(knots) == 1:
        apart, rate, share = apart, np.zeros((1, 2)), np.zeros(1)
    else:
        rate = np.diff(apart, axis=0)
        apart = apart[:-1]
        square = (rate**2).sum(axis=1)
        share = np.where(
            square > 0, -(apart * rate).sum(axis=1) / np.where(square > 0, square, 1.0), 0.0
        )
        share = np.clip(share, 0.0, 1.0)
    distance = np.hypot(*(apart + rate * share[:, None]).T)
    best = int(np.argmin(distance))
    step = float(knots[best + 1] - knots[best]) if len(knots) > 1 else 0.0
    when = float(knots[best]) + float(share[best]) * step
    middle = (position_at(a, np.array([when])) + position_at(b, np.array([when])))[0] / 2
    return Meeting(
        robots=(a.robot, b.robot),
        distance_m=float(distance[best]),
        time_s=when,
        place_m=(float(middle[0]), float(middle[1])),
    )


def nearest_of_pairs(movements: Sequence[Movement]) -> tuple[Meeting, ...]:
    """Return the least distance of each two vehicles while both are under way, in their order.

    A vehicle may have several movements, its trips; pairs never under way together are left out.
    """
    met: dict[tuple[int, int], Meeting] = {}
    for a, b in combinations(sorted(movements, key=lambda m: m.robot), 2):
        if a.robot == b.robot or (found := nearest_of(a, b)) is None:
            continue
        known = met.get(found.robots)
        if known is None or found.distance_m < known.distance_m:
            met[found.robots] = found
    return tuple(met[pair] for pair in sorted(met))


# --- fence ---------------------------------------------------------------------------------------


def fence_polygon(mission: Mission, frame: LocalFrame) -> shapely.Geometry | None:
    """Return where a mission's fence lets its vehicle be, local frame; None without a fence."""

    def ring(points_e7: npt.NDArray[np.int64]) -> shapely.Polygon:
        lonlat = points_e7[:, ::-1] / 1e7
        lonlat[:, 0] = frame.lon_deg + (lonlat[:, 0] - frame.lon_deg + 180.0) % 360.0 - 180.0
        return shapely.Polygon(frame.to_metric(lonlat))

    inside = [ring(p.points_e7) for p in mission.fence if p.inclusion]
    outside = [ring(p.points_e7) for p in mission.fence if not p.inclusion]
    if not inside:
        return None
    return shapely.difference(shapely.intersection_all(inside), shapely.union_all(outside))


def fence_room_m(points_m: FloatArray, allowed_m: shapely.Geometry) -> float:
    """Return the least distance of some positions from the fence, negative outside; NaN of none."""
    if not len(points_m):
        return math.nan
    points = shapely.points(points_m)
    shapely.prepare(allowed_m)
    distance = shapely.distance(points, allowed_m.boundary)
    return float(np.where(shapely.covers(allowed_m, points), distance, -distance).min())

"""Paths for vehicles that cannot turn on the spot: corners become turns of a radius in the water.

A path is cut into stretches that are sailed as they are (lanes, and what already bends gently) and
gaps between them that hold a corner sharper than the vehicle can turn. Each gap is filled anew:
Dubins ways from the end of one stretch to the beginning of the next, through every place that the
gap must pass. Where a lane runs up to the shore there is no water to turn in beyond its end, so a
turn may begin before the end and end after the beginning of a lane: what it leaves uncovered there
is looked for and repaired like anything else.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
import shapely

from mrmission import libm
from mrmission.model import BoolArray, CoveragePath, FloatArray, LegKind
from mrmission.tour.dubins import dubins_lengths, pose
from mrmission.tour.manoeuvre import Choices, Waters, chain, single_ways
from mrmission.tour.path import make_path

FIT_SHARE, FIT_M = 1.03, 0.05
"""Arcs may need this much more of their legs than there is: rounded coordinates."""
_STRAIGHT_M = 1e-4
_ALONG = 1e-6
_LEAST_BEND_RAD = math.radians(2.0)
MOST_TRIM = 2.0
"""A turn begins this many radii before the end of a lane at most."""
_OFFSETS = (0.0, -0.25, -0.5, -0.75, -1.0, -1.25, -1.5, -MOST_TRIM, 0.5, 1.0, 2.0)
"""Where a turn begins, radii beyond the end of a lane; below 0 before it."""
_TRIM_SHARE = 0.45
"""At most this share of a lane's last leg is left out at either end."""
_HEADINGS = 12
_REACH_SWATHS = 3.0
_LOOP = 40


def turn_cost_m(
    leave_m: FloatArray,
    leave_rad: FloatArray,
    enter_m: FloatArray,
    enter_rad: FloatArray,
    radius_m: float,
) -> FloatArray:
    """Return the lengths of turns from leaving lanes to entering lanes, without regard to land.

    Parameters
    ----------
    leave_m, leave_rad
        (n, 2) ends of lanes and (n,) headings in which they are left, radians from east.
    enter_m, enter_rad
        The same of the lanes that are entered.
    radius_m
        Least radius of a turn; 0: turns on the spot.

    Returns
    -------
    FloatArray
        (n,) metres, at least the straight distance.
    """
    if radius_m <= 0:
        return np.hypot(*(np.asarray(enter_m) - leave_m).T)
    return dubins_lengths(pose(leave_m, leave_rad), pose(enter_m, enter_rad), radius_m)


def sharp_corners(points_m: FloatArray, waters: Waters) -> BoolArray:
    """Return (n,) which points of a path are corners that an arc of the radius does not fit into.

    An arc fits where the corner is no sharper than those along a drawn arc, and where its tangents
    and those of the neighbours' arcs share the legs between them.
    """
    n = len(points_m)
    out = np.zeros(n, dtype=np.bool_)
    if n < 3:
        return out
    leg = np.diff(points_m, axis=0)
    length = np.hypot(leg[:, 0], leg[:, 1])
    heading = libm.arctan2(leg[:, 1], leg[:, 0])
    turn = np.zeros(n)
    turn[1:-1] = np.abs((np.diff(heading) + np.pi) % (2 * np.pi) - np.pi)
    tangent = waters.radius_m * libm.tan(0.5 * np.minimum(turn, 3.0))
    tight = tangent[:-1] + tangent[1:] > FIT_SHARE * length + FIT_M
    out |= turn > waters.max_bend_rad + 0.02
    bent = turn > _LEAST_BEND_RAD
    out[:-1] |= tight & bent[:-1]
    out[1:] |= tight & bent[1:]
    return out


@dataclass(frozen=True, slots=True, kw_only=True)
class _Gap:
    """What is filled anew: points `first` to `last` of a path, and those that must be passed."""

    first: int
    last: int
    must: tuple[int, ...]


def round_transits(
    path: CoveragePath,
    waters: Waters,
    swath_m: float,
    *,
    keep_m: FloatArray | None = None,
    lanes_alone: bool = False,
    runs: bool = False,
) -> tuple[CoveragePath, FloatArray]:
    """Return the path with its sharp corners turned at the radius, and where that was impossible.

    Parameters
    ----------
    path
        From home to home.
    waters
        Of the path's robot.
    swath_m
        Width of the footprint: how far from a lane an extra leg may lead.
    keep_m
        (m, 2) points of the path, exact, that it must pass though they lie on transits.
    lanes_alone
        Whether only survey legs cover; a turn that leaves out a part of a lane then is survey.
    runs
        Whether the transits that go straight on from lanes are run-ins and run-outs: turns leave
        them as they are.

    Returns
    -------
    path
        What was gentle is as it was.
    sharp_m
        (j, 2) corners that stay sharper than the radius: no turn fits the water.
    """
    points = path.points_m
    if len(points) < 3 or not sharp_corners(points, waters).any():
        return path, np.zeros((0, 2))
    gaps = _gaps(path, waters, swath_m, keep_m, runs)
    lines = _fill(path, gaps, waters)
    out = _without_straight_points(_assemble(path, gaps, lines, waters, lanes_alone), keep_m)
    return out, out.points_m[sharp_corners(out.points_m, waters)]


def _gaps(
    path: CoveragePath, waters: Waters, swath_m: float, keep_m: FloatArray | None, runs: bool
) -> list[_Gap]:
    """Return the gaps of a path that hold a sharp corner."""
    points = path.points_m
    survey = np.asarray(path.kind) == LegKind.SURVEY
    sharp = sharp_corners(points, waters)
    fixed = survey | _straight_on(points, survey) if runs else survey.copy()
    must = np.zeros(len(points), dtype=np.bool_)
    for first, last in _loops(points, survey, sharp, _REACH_SWATHS * swath_m):
        fixed[first:last] = False
        must[first + 1 : last] = True
    length = np.hypot(*np.diff(points, axis=0).T)
    for first, last in _stretches(fixed, sharp):
        if length[first:last].sum() < waters.radius_m:  # too short to line up with: passed
            fixed[first:last] = False
            must[first : last + 1] = True
    must |= _among(points, keep_m)
    ends = [(0, 0), *_stretches(fixed, sharp), (len(points) - 1, len(points) - 1)]
    out = []
    for (_, a), (b, _) in pairwise(ends):
        if sharp[a : b + 1].any():
            inner = tuple((np.flatnonzero(must[a + 1 : b]) + a + 1).tolist())
            out.append(_Gap(first=a, last=b, must=inner))
    return out


def _straight_on(points: FloatArray, survey: BoolArray) -> BoolArray:
    """Return (n - 1,) which legs are transits that go straight on from a lane, or to one."""
    leg = np.diff(points, axis=0)
    unit = leg / np.hypot(leg[:, 0], leg[:, 1])[:, None]
    on = (unit[:-1] * unit[1:]).sum(axis=1) > 1.0 - _ALONG
    on &= np.abs(unit[:-1, 0] * unit[1:, 1] - unit[:-1, 1] * unit[1:, 0]) < _ALONG
    out = np.append(False, on & survey[:-1]) | np.append(on & survey[1:], False)
    return out & ~survey


def _among(points: FloatArray, keep_m: FloatArray | None) -> BoolArray:
    """Return (n,) which points are, exactly, among those to keep."""
    if keep_m is None or not len(keep_m):
        return np.zeros(len(points), dtype=np.bool_)
    wanted = {(x, y) for x, y in keep_m.tolist()}
    return np.array([(x, y) in wanted for x, y in points.tolist()], dtype=np.bool_)


def _loops(
    points: FloatArray, survey: BoolArray, sharp: BoolArray, reach_m: float
) -> list[tuple[int, int]]:
    """Return (first, last) points of extra legs that leave a lane and meet it at the same point."""
    out = []
    at = 0
    where: dict[tuple[float, float], int] = {}
    rows = points.tolist()
    while at < len(rows):
        key = (rows[at][0], rows[at][1])
        first = where.get(key)
        if (
            first is not None
            and at - first <= _LOOP
            and survey[first:at].all()
            and sharp[first : at + 1].any()
            and np.hypot(*(points[first:at] - points[at]).T).max() <= reach_m
        ):
            out.append((first, at))
            where = {}
        where[key] = at
        at += 1
    return out


def _stretches(fixed: BoolArray, sharp: BoolArray) -> list[tuple[int, int]]:
    """Return (first, last) points of runs of fixed legs without a sharp corner inside."""
    out = []
    start: int | None = None
    for i, is_fixed in enumerate(fixed.tolist()):
        if start is not None and (not is_fixed or sharp[i]):
            out.append((start, i))
            start = None
        if is_fixed and start is None:
            start = i
    if start is not None:
        out.append((start, len(fixed)))
    return out


def _fill(path: CoveragePath, gaps: Sequence[_Gap], waters: Waters) -> list[FloatArray | None]:
    """Return a way for each gap, from the pose that is left to the one that is reached, or None."""
    points = path.points_m
    starts = [_end_choices(path, gap.first, -1, waters) for gap in gaps]
    goals = [_end_choices(path, gap.last, 1, waters) for gap in gaps]
    ways = _shortest(path, gaps, waters)
    lines: list[FloatArray | None] = [None] * len(gaps)
    plain = [i for i, gap in enumerate(gaps) if not gap.must and len(ways[i][0]) == 2]
    found = single_ways(waters, [starts[i] for i in plain], [goals[i] for i in plain])
    for i, line in zip(plain, found, strict=True):
        lines[i] = line
    for i, gap in enumerate(gaps):
        farthest = (choices.poses[choices.cost_m.argmin()] for choices in (starts[i], goals[i]))
        key = np.concatenate([*farthest, points[list(gap.must)].ravel()]).round(6).tobytes()
        if lines[i] is not None or key in waters.hopeless:
            continue
        stops = [points[k] for k in gap.must]
        if i not in plain:
            lines[i] = chain(waters, _layers(starts[i], goals[i], ways[i], stops, waters))
        if lines[i] is None:  # once more, with room to turn at either end and at every stop
            ends = points[gap.first], points[gap.last]
            layers = _layers(starts[i], goals[i], ways[i], stops, waters, ends)
            lines[i] = chain(waters, layers)
        if lines[i] is None:
            waters.hopeless.add(key)
    return lines


def _layers(
    start: Choices,
    goal: Choices,
    ways: Sequence[FloatArray],
    stops: Sequence[FloatArray],
    waters: Waters,
    roomy: tuple[FloatArray, FloatArray] | None = None,
) -> list[Choices]:
    """Return the poses to choose from along the ways through a gap from stop to stop.

    `roomy` are its ends, where room to turn in is to be looked for about them and about the stops.
    """
    layers = [start]
    if roomy is not None:
        layers.append(_room(roomy[0], waters))
    for j, way in enumerate(ways):
        layers.extend(_bends(way, waters))
        if j < len(stops):
            room = [] if roomy is None else [_room(stops[j], waters)]
            layers.extend([*room, _passing(stops[j], waters.harbour.region), *room])
    if roomy is not None:
        layers.append(_room(roomy[1], waters))
    return [*layers, goal]


def _shortest(path: CoveragePath, gaps: Sequence[_Gap], waters: Waters) -> list[list[FloatArray]]:
    """Return the shortest ways through each gap, from one point that must be passed to the next."""
    points, harbour = path.points_m, waters.harbour
    last = len(points) - 1
    stops = [(gap.first, *gap.must, gap.last) for gap in gaps]
    pairs = [(a, b) for s in stops for a, b in pairwise(s)]
    ends = points[np.array(pairs, dtype=np.int64).reshape(-1, 2)]
    found = harbour.paths(ends[:, 0], ends[:, 1])
    berth = waters.berth
    for k, (a, b) in enumerate(pairs):
        if a == 0:
            found[k] = harbour.home_paths([berth], points[b][None])[0]
        elif b == last:
            found[k] = harbour.home_paths([berth], points[a][None])[0][::-1]
    ways = iter(found)
    return [[next(ways) for _ in s[1:]] for s in stops]


def _end_choices(path: CoveragePath, index: int, side: int, waters: Waters) -> Choices:
    """Return where and in which heading a gap may begin (`side` -1) or end (1).

    At home the heading is free. Else it is that of the lane before or behind, at its end, some way
    beyond it, or before it; a run of its own is not cut short.
    """
    points = path.points_m
    at = points[index]
    if index in (0, len(points) - 1):
        return _passing(at, waters.harbour.region)
    leg = points[index] - points[index - 1] if side < 0 else points[index + 1] - points[index]
    length = float(np.hypot(*leg))
    unit = leg / length
    offset = waters.radius_m * np.array(_OFFSETS)
    run = path.kind[index - 1 if side < 0 else index] == LegKind.TRANSIT
    offset = offset[offset >= (0.0 if run else -_TRIM_SHARE * length)]
    # beyond the end of a lane: ahead of it where it is left, behind where it is entered
    place = at - side * offset[:, None] * unit
    free = waters.clear(np.stack([np.broadcast_to(at, place.shape), place], axis=1))
    free |= offset <= 0.0  # on the lane itself, whose end may lie a hair outside
    heading = math.atan2(unit[1], unit[0])
    return Choices(poses=pose(place[free], heading), cost_m=np.abs(offset[free]))


def _passing(at: FloatArray, region: shapely.Geometry) -> Choices:
    """Return a point in all headings, and in those along the shore next to it."""
    heading = 2 * np.pi * np.arange(_HEADINGS) / _HEADINGS
    shore, way_there = shapely.get_coordinates(
        shapely.shortest_line(region.boundary, shapely.Point(at))
    )
    out = way_there - shore
    if np.hypot(*out) > 1e-6:
        along = math.atan2(out[1], out[0]) + math.pi / 2
        heading = np.append(heading, [along, along + math.pi])
    poses = pose(np.broadcast_to(at, (len(heading), 2)), heading)
    return Choices(poses=poses, cost_m=np.zeros(len(heading)))


def _bends(way: FloatArray, waters: Waters) -> list[Choices]:
    """Return for each bend of a way around land poses at it and outside it; none is required."""
    out = []
    for before, at, after in zip(way[:-2], way[1:-1], way[2:], strict=True):
        come, go = at - before, after - at
        first = math.atan2(come[1], come[0])
        turn = (math.atan2(go[1], go[0]) - first + math.pi) % (2 * math.pi) - math.pi
        middle = first + turn / 2
        # land lies on the inner side of the bend
        outward = -math.copysign(1.0, turn) * np.array([-math.sin(middle), math.cos(middle)])
        places = at + waters.radius_m * np.array([0.0, 0.4, 1.0])[:, None] * outward
        free = waters.clear(np.stack([np.broadcast_to(at, places.shape), places], axis=1))
        places = places[free]
        heading = middle + turn * np.array([-0.3, 0.0, 0.3])
        poses = pose(np.repeat(places, 3, axis=0), np.tile(heading, len(places)))
        out.append(Choices(poses=poses, cost_m=np.zeros(len(poses)), required=False))
    return out


def _room(at: FloatArray, waters: Waters) -> Choices:
    """Return poses about a point, to turn in where there is no room at the point itself."""
    angle = np.pi / 4 * np.arange(8)
    ring = np.column_stack([libm.cos(angle), libm.sin(angle)])
    places = np.concatenate([at + waters.radius_m * r * ring for r in (1.5, 3.5)])
    region = waters.harbour.region
    places = places[shapely.contains_xy(region, places[:, 0], places[:, 1])]
    poses = pose(np.repeat(places, 8, axis=0), np.tile(angle, len(places)))
    return Choices(poses=poses, cost_m=np.zeros(len(poses)), required=False)


def _assemble(
    path: CoveragePath,
    gaps: Sequence[_Gap],
    lines: Sequence[FloatArray | None],
    waters: Waters,
    lanes_alone: bool,
) -> CoveragePath:
    """Return the path with the gaps filled; a gap without a way stays as it is."""
    points, kind, lane = path.points_m, path.kind, path.lane
    out: list[FloatArray] = []
    kinds: list[int] = []
    lanes: list[int] = []

    def copy(first: int, last: int) -> None:
        """Go on over the path's own legs to point `last`."""
        for i in range(first, last):
            out.append(points[i + 1])
            kinds.append(int(kind[i]))
            lanes.append(int(lane[i]))

    out.append(points[0])
    at = 0
    for gap, line in zip(gaps, lines, strict=True):
        copy(at, gap.first)
        at = gap.last
        if line is None:
            copy(gap.first, gap.last)
            continue
        legs_kind = kind[gap.first : gap.last]
        first_cut = gap.first > 0 and _cuts(points, gap.first, -1, line[0])
        last_cut = gap.last < len(points) - 1 and _cuts(points, gap.last, 1, line[-1])
        survey = bool((legs_kind == LegKind.SURVEY).all()) or (
            lanes_alone and (first_cut or last_cut)
        )
        what = int(LegKind.SURVEY if survey else LegKind.TRANSIT)
        if first_cut:
            out[-1] = line[0]
        way = [*line[0 if not first_cut else 1 :]]
        if not last_cut:
            way.append(points[gap.last])
        start = len(kinds)
        for point in way:
            out.append(point)
            kinds.append(what)
            lanes.append(0)
        _lengthen(kinds, lanes, out, start, gap, path, waters.radius_m)
    copy(at, len(points) - 1)
    return make_path(path.robot, np.array(out), kinds, lanes)


def _without_straight_points(path: CoveragePath, keep_m: FloatArray | None) -> CoveragePath:
    """Drop points at which neither course nor kind changes: a vehicle slows on short legs."""
    leg = np.diff(path.points_m, axis=0)
    length = np.hypot(leg[:, 0], leg[:, 1])
    unit = leg / length[:, None]
    cross = unit[:-1, 0] * unit[1:, 1] - unit[:-1, 1] * unit[1:, 0]
    off = np.abs(cross) * np.minimum(length[:-1], length[1:])
    ahead = (unit[:-1] * unit[1:]).sum(axis=1) > 0
    drop = np.append(False, (off < _STRAIGHT_M) & ahead & (path.kind[:-1] == path.kind[1:]))
    drop &= ~_among(path.points_m[:-1], keep_m)
    return make_path(
        path.robot,
        path.points_m[np.append(~drop, True)],
        path.kind[~drop].tolist(),
        path.lane[~drop].tolist(),
    )


def _cuts(points: FloatArray, index: int, side: int, at: FloatArray) -> bool:
    """Return whether a turn begins before the end (`side` -1), or ends behind the start, of a leg.

    `index` is the point where the leg ends (or starts).
    """
    leg = points[index] - points[index - 1] if side < 0 else points[index + 1] - points[index]
    return bool(side * ((at - points[index]) @ leg) > 1e-6 * np.hypot(*leg))


def _lengthen(
    kinds: list[int],
    lanes: list[int],
    out: Sequence[FloatArray],
    start: int,
    gap: _Gap,
    path: CoveragePath,
    radius_m: float,
) -> None:
    """Let lanes go on straight to the first corner of the turn: there is no waypoint between.

    `start` is the first leg of the gap; a leg of more than a diameter is a transit.
    """
    last = len(path.points_m) - 1
    legs = list(range(start, len(kinds)))
    for index, legs_of_end, leg_of_lane in (
        (gap.first, legs, gap.first - 1),
        (gap.last, legs[::-1], gap.last),
    ):
        if index in (0, last):
            continue
        lane_leg = path.points_m[leg_of_lane + 1] - path.points_m[leg_of_lane]
        unit = lane_leg / np.hypot(*lane_leg)
        gone = 0.0
        for i in legs_of_end:
            leg = out[i + 1] - out[i]
            size = float(np.hypot(*leg))
            gone += size
            if gone > 2 * radius_m or float(leg @ unit) < (1 - 1e-9) * size:
                break
            kinds[i], lanes[i] = int(path.kind[leg_of_lane]), int(path.lane[leg_of_lane])

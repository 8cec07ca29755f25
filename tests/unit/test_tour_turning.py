"""Turns of a radius: in the water, no tighter than the radius, and past all that must be passed."""

from __future__ import annotations

import itertools
import math

import numpy as np
import pytest
import shapely

from mrmission.model import CoveragePath, FloatArray, LegKind
from mrmission.routing.harbour import Harbour
from mrmission.tour.dubins import WORDS, dubins_lengths, dubins_words, pose
from mrmission.tour.manoeuvre import Choices, Waters, chain, single_ways
from mrmission.tour.path import make_path
from mrmission.tour.turning import round_transits, sharp_corners, turn_cost_m

T, S = int(LegKind.TRANSIT), int(LegKind.SURVEY)
BASIN = shapely.box(0, 0, 200, 200)
HOME = [100.0, 50.0]
SWATH_M = 20.0


def waters(region: shapely.Polygon, radius_m: float) -> Waters:
    return Waters(Harbour(region, np.array([HOME])), 0, radius_m, 1.0)


def path_of(points: list[list[float]], kinds: list[int]) -> CoveragePath:
    return make_path(1, np.array(points, dtype=float), kinds, [0] * len(kinds))


def assert_turns(path: CoveragePath, radius_m: float, region: shapely.Polygon) -> None:
    """An arc of the radius fits into every corner, and every leg lies in the water."""
    leg = np.diff(path.points_m, axis=0)
    length, heading = np.hypot(*leg.T), np.arctan2(leg[:, 1], leg[:, 0])
    bend = np.abs((np.diff(heading) + np.pi) % (2 * np.pi) - np.pi)
    assert np.degrees(bend).max() <= 61.0
    tangent = np.concatenate([[0.0], radius_m * np.tan(bend / 2), [0.0]])
    assert (tangent[:-1] + tangent[1:] <= 1.03 * length + 0.05).all()
    assert region.buffer(1e-4).covers(shapely.LineString(path.points_m))


def lanes(x: list[float], low: float = 60.0, high: float = 140.0) -> CoveragePath:
    """From home over lanes up and down in turn, and home."""
    points, kinds = [HOME], []
    for i, at in enumerate(x):
        points += [[at, low], [at, high]] if i % 2 == 0 else [[at, high], [at, low]]
        kinds += [T, S]
    return path_of([*points, HOME], [*kinds, T])


@pytest.mark.parametrize("radius_m", [3.0, 8.0, 14.0])
def test_in_open_water_every_corner_becomes_a_turn(radius_m: float) -> None:
    before = lanes([60, 80, 120, 130])
    after, left = round_transits(before, waters(BASIN, radius_m), SWATH_M)
    assert len(left) == 0
    assert_turns(after, radius_m, BASIN)
    np.testing.assert_array_equal(after.points_m[[0, -1]], [HOME, HOME])
    # what is gentle is left as it is
    again, _ = round_transits(after, waters(BASIN, radius_m), SWATH_M)
    np.testing.assert_array_equal(again.points_m, after.points_m)
    # lanes are swept, less what a turn may leave out at their ends
    swept = shapely.union_all(
        [shapely.LineString(after.points_m[i : i + 2]) for i in np.flatnonzero(after.kind == S)]
    )
    for x in (60, 80, 120, 130):
        assert swept.buffer(1e-6).covers(shapely.LineString([(x, 90), (x, 110)]))


def test_at_the_shore_a_turn_begins_before_the_end_of_the_lane() -> None:
    before = lanes([60, 80, 100, 120], low=0.0, high=200.0)
    after, left = round_transits(before, waters(BASIN, 9.0), SWATH_M)
    assert len(left) == 0
    assert_turns(after, 9.0, BASIN)
    turn = after.points_m[:, 1] > 180
    assert turn.sum() >= 4
    # no more than needed: the turns still touch the shore, less the drawn arc
    assert after.points_m[:, 1].max() > 195


def test_a_lane_that_ends_a_hair_outside_is_turned_at_too() -> None:
    before = lanes([60, 80, 100, 120], low=-0.002, high=200.0)
    after, left = round_transits(before, waters(BASIN, 9.0), SWATH_M)
    assert len(left) == 0
    assert_turns(after, 9.0, BASIN)


def test_a_way_around_an_island_bends_by_arcs() -> None:
    island = shapely.Polygon([(60, 90), (140, 90), (140, 110), (60, 110)])
    region = BASIN - island
    harbour = Harbour(region, np.array([HOME]))
    way = harbour.paths(np.array([[30.0, 70.0]]), np.array([[170.0, 130.0]]))[0]
    back = harbour.paths(np.array([[170.0, 160.0]]), np.array([HOME]))[0]
    points = np.vstack([HOME, [30, 40], way, back])
    kinds = [T, S, *[T] * (len(way) - 1), S, *[T] * (len(back) - 1)]
    before = make_path(1, points, kinds, [0] * len(kinds))
    after, left = round_transits(before, waters(region, 12.0), SWATH_M)
    assert len(left) == 0
    assert_turns(after, 12.0, region)


def test_places_to_pass_are_passed() -> None:
    before = path_of(
        [HOME, [60, 60], [60, 140], [70, 165], [80, 140], [80, 60], HOME], [T, S, T, T, S, T]
    )
    keep = np.array([[70.0, 165.0]])
    after, left = round_transits(before, waters(BASIN, 8.0), SWATH_M, keep_m=keep)
    assert len(left) == 0
    assert [70.0, 165.0] in after.points_m.tolist()
    assert_turns(after, 8.0, BASIN)
    free, _ = round_transits(before, waters(BASIN, 8.0), SWATH_M)
    assert [70.0, 165.0] not in free.points_m.tolist()


def test_an_extra_leg_from_a_lane_becomes_a_loop_and_the_lane_goes_on() -> None:
    points = [HOME, [60, 20], [60, 100], [72, 100], [60, 100], [60, 180], [60, 190], HOME]
    before = path_of(points, [T, S, S, S, S, T, T])
    after, left = round_transits(before, waters(BASIN, 8.0), SWATH_M)
    assert len(left) == 0
    assert_turns(after, 8.0, BASIN)
    track = shapely.LineString(after.points_m)
    assert track.distance(shapely.Point(72, 100)) < 1e-6
    assert track.buffer(1e-6).covers(shapely.LineString([(60, 30), (60, 95)]))
    assert track.buffer(1e-6).covers(shapely.LineString([(60, 105), (60, 170)]))


def test_what_does_not_fit_is_left_and_told() -> None:
    region = shapely.union(shapely.box(0, 0, 200, 100), shapely.box(58, 100, 62, 190))
    before = path_of([HOME, [60, 90], [60, 189], [60, 95], [150, 95], HOME], [T, S, T, T, T])
    after, left = round_transits(before, waters(region, 8.0), SWATH_M)
    assert [60.0, 189.0] in left.tolist()
    assert region.buffer(1e-4).covers(shapely.LineString(after.points_m))


def test_where_lanes_alone_cover_a_turn_that_cuts_one_sweeps() -> None:
    before = lanes([60, 80], low=0.0, high=200.0)
    after, _ = round_transits(before, waters(BASIN, 9.0), SWATH_M, lanes_alone=True)
    top = after.points_m[:-1, 1] > 185
    assert (after.kind[top] == S).all()


def test_costs_of_turns() -> None:
    rng = np.random.default_rng(1)
    a, b = rng.uniform(0, 50, (40, 2)), rng.uniform(0, 50, (40, 2))
    out, into = rng.uniform(-3, 3, 40), rng.uniform(-3, 3, 40)
    straight = np.hypot(*(b - a).T)
    np.testing.assert_allclose(turn_cost_m(a, out, b, into, 0.0), straight)
    cost = turn_cost_m(a, out, b, into, 5.0)
    assert (cost >= straight - 1e-9).all()
    # the same way back
    np.testing.assert_allclose(turn_cost_m(b, into + np.pi, a, out + np.pi, 5.0), cost)
    half = turn_cost_m(
        np.zeros((1, 2)), np.zeros(1), np.array([[0.0, 30.0]]), np.array([np.pi]), 15
    )
    assert half[0] == pytest.approx(15 * math.pi)


def choices(rng: np.random.Generator, count: int, required: bool = True) -> Choices:
    return Choices(
        poses=np.column_stack([rng.uniform(60, 140, (count, 2)), rng.uniform(-3, 3, count)]),
        cost_m=rng.uniform(0, 10, count),
        required=required,
    )


def drawn_m(line: FloatArray) -> float:
    return float(np.hypot(*np.diff(line, axis=0).T).sum())


def test_the_cheapest_single_way_is_found_first() -> None:
    rng = np.random.default_rng(2)
    water = waters(shapely.box(-500, -500, 700, 700), 6.0)
    starts = [choices(rng, 5) for _ in range(20)]
    goals = [choices(rng, 4) for _ in range(20)]
    found = single_ways(water, starts, goals)
    for start, goal, line in zip(starts, goals, found, strict=True):
        best = min(
            (
                float(dubins_lengths(a[None], b[None], 6.0)[0]) + start.cost_m[i] + goal.cost_m[j],
                i,
                j,
            )
            for (i, a), (j, b) in itertools.product(enumerate(start.poses), enumerate(goal.poses))
        )
        assert line is not None
        np.testing.assert_array_equal(line[0], start.poses[best[1], :2])
        np.testing.assert_array_equal(line[-1], goal.poses[best[2], :2])


def test_a_single_way_is_the_cheapest_that_is_in_the_water() -> None:
    rng = np.random.default_rng(3)
    region = BASIN - shapely.Point(100, 100).buffer(30)
    water = waters(region, 6.0)
    shore = region.buffer(1e-5)
    blocked = 0
    for _ in range(15):
        start, goal = choices(rng, 1), choices(rng, 1)
        pieces = dubins_words(start.poses, goal.poses, 6.0)[0]
        options = []
        for word in range(len(WORDS)):
            if not np.isfinite(pieces[word]).all():
                continue
            line = water.lines(start.poses, goal.poses, np.array([word]), pieces[[word]])[0]
            if shore.covers(shapely.LineString(line)):
                options.append((float(pieces[word].sum()), word))
        line = single_ways(water, [start], [goal])[0]
        assert (line is None) == (not options)
        if line is None:
            blocked += 1
            continue
        word = min(options)[1]
        wanted = water.lines(start.poses, goal.poses, np.array([word]), pieces[[word]])[0]
        assert drawn_m(line) == pytest.approx(drawn_m(wanted))
    assert 0 < blocked < 15


def test_a_chain_is_as_cheap_as_the_cheapest_of_all() -> None:
    rng = np.random.default_rng(4)
    water = waters(shapely.box(-500, -500, 700, 700), 6.0)
    for required in (True, False):
        layers = [choices(rng, 3), choices(rng, 4, required), choices(rng, 3)]
        line = chain(water, layers)
        assert line is not None
        best = math.inf
        for i, j, k in itertools.product(range(3), range(-1, 4), range(3)):
            if j < 0 and required:
                continue
            stops = [
                layers[0].poses[i],
                *([layers[1].poses[j]] if j >= 0 else []),
                layers[2].poses[k],
            ]
            ways = np.array(stops)
            cost = dubins_lengths(ways[:-1], ways[1:], 6.0).sum()
            cost += layers[0].cost_m[i] + layers[2].cost_m[k]
            cost += layers[1].cost_m[j] if j >= 0 else 0.0
            if cost < best:
                best, ends = cost, (i, k)
        np.testing.assert_array_equal(line[0], layers[0].poses[ends[0], :2])
        np.testing.assert_array_equal(line[-1], layers[2].poses[ends[1], :2])


def test_what_is_sharp() -> None:
    water = waters(BASIN, 8.0)
    corner = np.array([[0.0, 0.0], [50.0, 0.0], [50.0, 50.0]])
    assert sharp_corners(corner, water).tolist() == [False, True, False]
    gentle = np.array([[0.0, 0.0], [50.0, 0.0], [100.0, 20.0]])
    assert not sharp_corners(gentle, water).any()
    # the same bend, but no room for the arc
    short = np.array([[0.0, 0.0], [50.0, 0.0], [51.0, 0.8], [51.5, 2.0]])
    assert sharp_corners(short, water).any()
    assert not sharp_corners(pose(corner, 0.0)[:2, :2], water).any()

"""Dubins ways: against circles and tangents drawn by hand, and by following them."""

from __future__ import annotations

import math

import numpy as np
import pytest

from mrmission.model import FloatArray
from mrmission.tour.dubins import (
    WORDS,
    bend_limit_rad,
    dubins_lengths,
    dubins_polylines,
    dubins_words,
    pose,
)


def poses(count: int, reach_m: float, seed: int) -> FloatArray:
    rng = np.random.default_rng(seed)
    return np.column_stack(
        [rng.uniform(-reach_m, reach_m, (count, 2)), rng.uniform(-np.pi, np.pi, count)]
    )


def follow(start: FloatArray, word: str, pieces: FloatArray, radius: float) -> FloatArray:
    """Where a vehicle is that drives the pieces, by complex numbers."""
    z, heading = complex(start[0], start[1]), float(start[2])
    for letter, size in zip(word, pieces, strict=True):
        if letter == "S":
            z += radius * size * np.exp(1j * heading)
            continue
        side = 1 if letter == "L" else -1
        centre = z + side * 1j * radius * np.exp(1j * heading)
        heading += side * size
        z = centre - side * 1j * radius * np.exp(1j * heading)
    return np.array([z.real, z.imag, heading])


def by_circles(start: FloatArray, goal: FloatArray, radius: float) -> float:
    """The shortest way by circles and their common tangents, another way to the same number."""

    def centre(pose: FloatArray, side: int) -> complex:
        return complex(pose[0], pose[1]) + side * 1j * radius * np.exp(1j * pose[2])

    def arc(side: int, turn: float) -> float:
        turn = (side * turn) % (2 * np.pi)
        return 0.0 if turn > 2 * np.pi - 1e-7 else turn * radius

    best = math.inf
    for s in (1, -1):
        for g in (1, -1):
            a, b = centre(start, s), centre(goal, g)
            gap = abs(b - a)
            line = math.atan2((b - a).imag, (b - a).real)
            if s == g:  # the outer tangent is parallel to the line of the centres
                best = min(best, gap + arc(s, line - start[2]) + arc(s, goal[2] - line))
                if gap <= 4 * radius:  # a third circle that touches both, to either side
                    for third in (1, -1):
                        c = (a + b) / 2 + third * 1j * np.exp(1j * line) * math.sqrt(
                            4 * radius**2 - gap**2 / 4
                        )
                        # the headings where the circles touch
                        at_a = np.angle(c - a) + s * np.pi / 2
                        at_b = np.angle(c - b) + s * np.pi / 2
                        middle = arc(-s, at_b - at_a)
                        if middle > np.pi * radius:
                            whole = arc(s, at_a - start[2]) + middle + arc(s, goal[2] - at_b)
                            best = min(best, whole)
            elif gap >= 2 * radius:  # the inner tangent
                tilt = math.asin(min(1.0, 2 * radius / gap))
                heading = line + s * tilt
                straight = math.sqrt(max(0.0, gap**2 - 4 * radius**2))
                best = min(best, straight + arc(s, heading - start[2]) + arc(g, goal[2] - heading))
    return best


@pytest.mark.parametrize(
    ("goal", "length"),
    [
        ((30.0, 0.0, 0.0), 30.0),
        ((0.0, 20.0, math.pi), 10 * math.pi),
        ((0.0, -40.0, math.pi), 10 * math.pi + 20),
        ((10.0, 10.0, math.pi / 2), 5 * math.pi),
        ((0.0, 0.0, 0.0), 0.0),
        # on the spot, the other way round: three arcs of 60, 300 and 60 degrees
        ((0.0, 0.0, math.pi), 10 * math.pi * (60 + 300 + 60) / 180),
    ],
)
def test_known_ways(goal: tuple[float, float, float], length: float) -> None:
    start = np.array([[0.0, 0.0, 0.0]])
    assert dubins_lengths(start, np.array([goal]), 10.0)[0] == pytest.approx(length, abs=1e-6)


@pytest.mark.parametrize("reach_m", [5.0, 20.0, 100.0])
def test_the_shortest_of_all_words_is_the_shortest_by_circles(reach_m: float) -> None:
    start, goal = poses(400, reach_m, 1), poses(400, reach_m, 2)
    lengths = dubins_lengths(start, goal, 8.0)
    wanted = [by_circles(a, b, 8.0) for a, b in zip(start, goal, strict=True)]
    np.testing.assert_allclose(lengths, wanted, rtol=1e-9, atol=1e-6)


def test_every_word_leads_to_the_goal() -> None:
    start, goal = poses(300, 30.0, 3), poses(300, 30.0, 4)
    pieces = dubins_words(start, goal, 7.0)
    assert (np.isfinite(pieces).all(axis=2) == np.isfinite(pieces).any(axis=2)).all()
    assert np.isfinite(pieces[:, :2]).all()  # LSL and RSR always join two poses
    seen = set()
    for i, w in np.argwhere(np.isfinite(pieces[:, :, 0])):
        end = follow(start[i], WORDS[w], pieces[i, w], 7.0)
        np.testing.assert_allclose(end[:2], goal[i, :2], atol=1e-6)
        assert math.cos(end[2] - goal[i, 2]) == pytest.approx(1.0, abs=1e-9)
        seen.add(WORDS[w])
    assert seen == set(WORDS)


def test_there_and_back_is_as_long_and_never_shorter_than_straight() -> None:
    start, goal = poses(500, 40.0, 5), poses(500, 40.0, 6)
    lengths = dubins_lengths(start, goal, 9.0)
    turned = np.array([0.0, 0.0, np.pi])
    np.testing.assert_allclose(dubins_lengths(goal + turned, start + turned, 9.0), lengths)
    mirror = np.array([1.0, -1.0, -1.0])
    np.testing.assert_allclose(dubins_lengths(start * mirror, goal * mirror, 9.0), lengths)
    straight = np.hypot(*(goal - start)[:, :2].T)
    assert (lengths >= straight - 1e-9).all()
    # a smaller radius never takes longer
    assert (dubins_lengths(start, goal, 4.0) <= lengths + 1e-9).all()


def test_polylines_have_headings_corners_and_legs_as_promised() -> None:
    start, goal = poses(300, 30.0, 7), poses(300, 30.0, 8)
    radius, limit = 6.0, bend_limit_rad(6.0, 0.5)
    pieces = dubins_words(start, goal, radius)
    word = pieces.sum(axis=2).argmin(axis=1)
    chosen = pieces[np.arange(len(word)), word]
    lines = dubins_polylines(start, goal, word, chosen, radius, limit)
    for i, line in enumerate(lines):
        np.testing.assert_array_equal(line[0], start[i, :2])
        np.testing.assert_array_equal(line[-1], goal[i, :2])
        points = line[np.append(True, np.hypot(*np.diff(line, axis=0).T) > 1e-6)]
        leg = np.diff(points, axis=0)
        length, heading = np.hypot(*leg.T), np.arctan2(leg[:, 1], leg[:, 0])
        assert math.cos(heading[0] - start[i, 2]) == pytest.approx(1.0, abs=1e-9)
        assert math.cos(heading[-1] - goal[i, 2]) == pytest.approx(1.0, abs=1e-9)
        bend = np.abs((np.diff(heading) + np.pi) % (2 * np.pi) - np.pi)
        assert bend.max(initial=0) <= limit + 1e-6
        # arcs of the radius fit into the corners: their tangents share the legs
        tangent = np.concatenate([[0.0], radius * np.tan(bend / 2), [0.0]])
        assert (tangent[:-1] + tangent[1:] <= length + 1e-5).all()
        # about the arc: never shorter, and by no more than the corners allow
        way = radius * chosen[i].sum()
        assert way - 1e-6 <= length.sum() <= way * (math.tan(limit / 2) / (limit / 2)) + 1e-6


def test_a_half_circle_has_few_corners() -> None:
    start, goal = pose(np.zeros((1, 2)), 0.0), pose(np.array([[0.0, 16.0]]), math.pi)
    pieces = dubins_words(start, goal, 8.0)
    word = pieces.sum(axis=2).argmin(axis=1)
    line = dubins_polylines(start, goal, word, pieces[[0], word], 8.0, bend_limit_rad(8.0, 1.0))[0]
    corners = np.unique(line[1:-1], axis=0)
    assert len(corners) == 4  # of 45 degrees, on the circle of the radius over cos 22.5
    np.testing.assert_allclose(
        np.hypot(*(corners - [0.0, 8.0]).T), 8.0 / math.cos(math.radians(22.5))
    )


def test_how_sharp_the_corners_of_an_arc_are() -> None:
    radius, tolerance = 20.0, 0.5
    limit = bend_limit_rad(radius, tolerance)
    assert radius / math.cos(limit / 2) - radius == pytest.approx(tolerance)
    # legs of a minimal length where the tolerance would make them shorter
    longer = bend_limit_rad(radius, 0.01, shortest_m=4.0)
    assert 2 * radius * math.tan(longer / 2) == pytest.approx(4.0)
    assert bend_limit_rad(1.0, 5.0) == pytest.approx(math.radians(60))


def test_poses_of_points() -> None:
    made = pose(np.array([[1.0, 2.0], [3.0, 4.0]]), 0.5)
    np.testing.assert_array_equal(made, [[1, 2, 0.5], [3, 4, 0.5]])

"""Seconds of a path: length over speed, and the corner table."""

from __future__ import annotations

import numpy as np
import pytest

from mrmission.model import LegKind
from mrmission.tour.timing import TimeModel

TIME = TimeModel(survey_speed_m_s=2.0, transit_speed_m_s=4.0)


@pytest.mark.parametrize(
    ("angle_deg", "extra_s"), [(0, 0), (45, 0), (90, 0), (135, 0.7), (157.5, 3.45), (180, 6.2)]
)
def test_corner_table(angle_deg: float, extra_s: float) -> None:
    for first_deg in (0.0, 77.0, 179.0, 200.0, 359.0):
        for side in (-1, 1):
            a, b = np.radians([first_deg, first_deg + side * angle_deg])
            points = np.cumsum([[0, 0], [np.cos(a), np.sin(a)], [np.cos(b), np.sin(b)]], axis=0)
            assert TIME.corners_s(points) == pytest.approx([extra_s], abs=1e-9)


def test_speeds_by_kind() -> None:
    points = np.array([[0.0, 0], [100, 0], [100, 40]])
    kind = np.array([LegKind.SURVEY, LegKind.TRANSIT], dtype=np.int8)
    assert TIME.duration_s(points, kind) == pytest.approx(100 / 2 + 40 / 4)
    assert TIME.duration_s(points, kind[::-1]) == pytest.approx(100 / 4 + 40 / 2)
    assert TIME.top_speed_m_s == 4.0


def test_a_point_given_twice_is_no_corner_and_no_time() -> None:
    points = np.array([[0.0, 0], [10, 0], [10, 0], [20, 0]])
    kind = np.ones(3, dtype=np.int8)
    assert TIME.duration_s(points, kind) == pytest.approx(10.0)
    assert TIME.duration_s(points[:1], kind[:0]) == 0.0


def test_never_faster_than_length_over_top_speed() -> None:
    rng = np.random.default_rng(0)
    for _ in range(50):
        points = rng.uniform(-50, 50, (12, 2))
        kind = rng.integers(0, 2, 11)
        length = np.hypot(*np.diff(points, axis=0).T).sum()
        assert TIME.duration_s(points, kind) >= length / TIME.top_speed_m_s

"""The bound of a plan is for its lines, as they are swept, and for all of its vehicles."""

from __future__ import annotations

import numpy as np
import pytest
import shapely
from lakes import area_of

from mrmission.fleet import Robot
from mrmission.minmax.line_bound import lines_swept
from mrmission.model import FloatArray, LegKind
from mrmission.options import PlanOptions
from mrmission.pipeline import plan
from mrmission.tour.lines import SurveyLine
from mrmission.tour.path import join_pieces


def test_lines_are_as_long_as_they_are_swept_in_one_go() -> None:
    def swept(*points: tuple[float, float]) -> tuple[FloatArray, LegKind, int]:
        return np.array(points, dtype=np.float64), LegKind.SURVEY, 1

    def way(*points: tuple[float, float]) -> tuple[FloatArray, LegKind, int]:
        return np.array(points, dtype=np.float64), LegKind.TRANSIT, 0

    shore = SurveyLine(points_m=np.array([(0.0, 900.0), (0.0, 950.0), (50.0, 950.0)]))
    path = join_pieces(
        1,
        [
            way((0, 0), (0, 100)),
            # a lane in two legs, a little off, then another about a corner that is no line's
            swept((0, 100), (0.01, 400), (0, 800), (20, 800)),
            way((20, 800), (0, 900)),
            swept((0, 900), (0, 950), (50, 950)),
            way((50, 950), (0, 0)),
        ],
    )
    idle = join_pieces(2, [way((0, 0), (0, 0))])
    lines = lines_swept([path, idle], [shore])
    ends = [line.ends_m.tolist() for line in lines]
    assert ends == [
        [[0, 100], [0, 800]],
        [[0, 800], [20, 800]],
        [[0, 900], [50, 950]],
    ]
    assert lines[2].length_m == 100
    assert len(lines_swept([path], [])) == 4


PIVOTING, STEERED = ("pivoting", 2.0), ("steered", 2.0)
QUICK, SLOW = ("steered", 5.0), ("steered", 1.0)


@pytest.mark.parametrize(("first", "others"), [(PIVOTING, STEERED), (QUICK, SLOW)])
def test_no_fleet_is_quicker_than_its_bound(
    first: tuple[str, float], others: tuple[str, float]
) -> None:
    fleet = tuple(
        Robot(steering=steering, survey_speed_m_s=speed, transit_speed_m_s=speed)
        for steering, speed in (first, others, others, others)
    )
    options = PlanOptions(
        robots=4, fleet=fleet, swath_m=20.0, overlap=0.0, clearance_m=0.0, angle_deg=0.0,
        starts_lonlat=((8.40298, 53.1),), separation_m=0.0, time_budget_s=0.3, fence=False,
    )  # fmt: skip
    report = plan(area_of(shapely.box(0.0, 0.0, 400.0, 40.0)), options).report
    assert report.lanes_bound_s is not None
    assert 0.5 * report.makespan_s < report.lanes_bound_s <= report.makespan_s

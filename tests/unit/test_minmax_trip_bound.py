"""The lines of trips, which their bound is for."""

from __future__ import annotations

import numpy as np

from mrmission.minmax.trip_bound import lines_swept
from mrmission.model import FloatArray, LegKind
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

"""Lines of work: polylines, their pieces and their names."""

from __future__ import annotations

import itertools

import numpy as np
import pytest
import shapely
from lakes import random_lake_m

from mrmission.errors import PlanningError
from mrmission.tour.lines import (
    LineKind,
    SurveyLine,
    between,
    ends_of,
    lane_lines,
    lane_names,
    lengths_m,
    letters,
)
from mrmission.tour.sweep import sweep_region


def test_a_line_is_swept_from_either_end() -> None:
    line = SurveyLine(points_m=np.array([[0.0, 0], [0, 3], [4, 3]]), kind=LineKind.SHORE, name="S1")
    assert line.length_m == 7
    assert line.ends_m.tolist() == [[0, 0], [4, 3]]
    assert line.way(0).tolist() == line.points_m.tolist()
    assert line.way(7).tolist() == line.points_m[::-1].tolist()
    assert line.counts_as_coverage
    assert not SurveyLine(points_m=line.points_m, kind=LineKind.TIE).counts_as_coverage
    assert ends_of([line, line]).shape == (2, 2, 2)
    assert ends_of([]).shape == (0, 2, 2)
    assert lengths_m([line]).tolist() == [7]
    with pytest.raises(ValueError, match="read-only"):
        line.points_m[0, 0] = 1.0


@pytest.mark.parametrize("points", [np.zeros((1, 2)), np.zeros((2, 3)), np.full((2, 2), np.nan)])
def test_what_is_no_line_is_refused(points: np.ndarray) -> None:
    with pytest.raises(PlanningError, match="T1"):
        SurveyLine(points_m=points, kind=LineKind.TIE, name="T1")


def test_pieces_of_a_line_make_the_line() -> None:
    rng = np.random.default_rng(5)
    for _ in range(50):
        line = SurveyLine(points_m=rng.uniform(-50, 50, (int(rng.integers(2, 7)), 2)), name="9")
        cuts = np.sort(rng.uniform(0, line.length_m, 3))
        marks = [0.0, *cuts.tolist(), line.length_m]
        pieces = [between(line, a, b) for a, b in itertools.pairwise(marks)]
        assert (pieces[0].points_m[0] == line.points_m[0]).all()
        assert (pieces[-1].points_m[-1] == line.points_m[-1]).all()
        for i, piece in enumerate(pieces):
            assert piece.length_m == pytest.approx(marks[i + 1] - marks[i])
            assert (
                shapely.LineString(line.points_m)
                .buffer(1e-9)
                .covers(shapely.LineString(piece.points_m))
            )
        assert all((a.points_m[-1] == b.points_m[0]).all() for a, b in itertools.pairwise(pieces))


def test_letters_count_on() -> None:
    names = [letters(i) for i in range(26 * 27 + 1)]
    assert names[0] == "a"
    assert names[25:28] == ["z", "aa", "ab"]
    assert names[-1] == "aaa"
    assert len(set(names)) == len(names)


def test_lanes_have_their_columns_number_and_a_letter_where_an_island_cuts_them() -> None:
    lake = shapely.Polygon(
        [(0, 0), (100, 0), (100, 100), (0, 100)], [[(31, 40), (69, 40), (69, 60), (31, 60)]]
    )
    lines = lane_lines(sweep_region(lake, 0.0, 10.0))
    by_name = {line.name: line for line in lines}
    assert len(by_name) == len(lines)
    assert sorted(by_name, key=lambda n: (int(n.rstrip("ab")), n)) == [
        "1", "2", "3", "4a", "4b", "5a", "5b", "6a", "6b", "7a", "7b", "8", "9", "10",
    ]  # fmt: skip
    assert by_name["1"].points_m[:, 0].tolist() == pytest.approx([5, 5])
    assert by_name["10"].points_m[:, 0].tolist() == pytest.approx([95, 95])
    assert by_name["4a"].points_m[:, 1].max() == pytest.approx(40)
    assert by_name["4b"].points_m[:, 1].min() == pytest.approx(60)


@pytest.mark.parametrize("bearing", [0.0, 20.0, 89.0, 91.0, 135.0, 179.0])
def test_numbers_rise_from_west_to_east(bearing: float) -> None:
    lake = random_lake_m(np.random.default_rng(3), 400.0, 2)
    lines = lane_lines(sweep_region(lake, bearing, 15.0))
    # where a lane's line meets the axis through the origin that points east
    b = np.radians(bearing)
    across = np.array([np.cos(b), -np.sin(b)]) * (1 if bearing <= 90 else -1)
    place = [float(line.points_m[0] @ across) for line in lines]
    number = [int(line.name.rstrip("abcdefgh")) for line in lines]
    order = np.argsort(number, kind="stable")
    assert (np.diff(np.array(place)[order]) > -1e-6).all()
    assert across[0] >= 0


def test_names_do_not_depend_on_the_order_of_lanes() -> None:
    rng = np.random.default_rng(1)
    column = np.array([0, 1, 1, 1, 2, 4, 4])
    along = np.array([0.0, 5, -3, 9, 1, 2, 1])
    names = lane_names(30.0, 5, column, along)
    assert names == ["1", "2b", "2a", "2c", "3", "5b", "5a"]
    order = rng.permutation(len(column))
    assert lane_names(30.0, 5, column[order], along[order]) == [names[i] for i in order]
    assert lane_names(120.0, 5, column, along)[0] == "5"

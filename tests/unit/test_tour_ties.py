"""Tie lines: where they lie, how long they are in all, and what they cross."""

from __future__ import annotations

import numpy as np
import pytest
import shapely
from lakes import random_lake_m

from mrmission.errors import ConfigError, InfeasibleError
from mrmission.tour.lines import LineKind, SurveyLine, lane_lines, lengths_m
from mrmission.tour.sweep import sweep_region
from mrmission.tour.tie_spec import TieSpec, parse_ties
from mrmission.tour.ties import crossings, tie_lines


def scene(seed: int) -> tuple[shapely.Polygon, float, tuple[SurveyLine, ...]]:
    rng = np.random.default_rng(seed)
    lake = random_lake_m(rng, 600.0, 4, corners=int(rng.integers(8, 24)))
    bearing = float(rng.uniform(0, 180))
    return lake, bearing, lane_lines(sweep_region(lake, bearing, 18.0))


def along(bearing_deg: float) -> np.ndarray:
    b = np.radians(bearing_deg)
    return np.array([np.sin(b), np.cos(b)])


@pytest.mark.parametrize("seed", range(6))
def test_rows_are_evenly_spaced_across_the_lanes_and_cut_at_land(seed: int) -> None:
    lake, bearing, lanes = scene(seed)
    ties = tie_lines(lake, bearing, lanes, parse_ties("70m"))
    axis = along(bearing)
    extent = shapely.get_coordinates(lake) @ axis
    rows = np.unique(np.round([float(t.points_m[0] @ axis) for t in ties], 3))
    count = int(np.ceil((extent.max() - extent.min()) / 70.0))
    pitch = (extent.max() - extent.min()) / count
    assert pitch <= 70.0
    expected = extent.min() + (np.arange(count) + 0.5) * pitch
    assert all(np.abs(expected - row).min() < 0.01 for row in rows)
    # what the rows have in the water is what the tie lines are, but for pieces that cross nothing
    across = np.array([axis[1], -axis[0]])
    for place in expected:
        foot = place * axis
        line = shapely.LineString([foot - 1000 * across, foot + 1000 * across])
        inside = shapely.get_parts(shapely.intersection(line, lake))
        wanted = sorted(
            round(piece.length, 3)
            for piece in inside
            if any(piece.intersects(shapely.LineString(x.points_m)) for x in lanes)
        )
        mine = [t for t in ties if abs(float(t.points_m[0] @ axis) - place) < 0.01]
        assert sorted(round(t.length_m, 3) for t in mine) == pytest.approx(wanted, abs=0.01)
    for tie in ties:
        assert tie.kind is LineKind.TIE
        assert (tie.points_m[1] - tie.points_m[0]) @ axis == pytest.approx(0.0, abs=1e-6)
        assert lake.buffer(1e-6).covers(shapely.LineString(tie.points_m))
    numbers = [int(t.name[1:].rstrip("abcdefgh")) for t in ties]
    places = [float(t.points_m[0] @ axis) for t in ties]
    assert (np.diff(np.array(places)[np.argsort(numbers, kind="stable")]) > -1e-6).all()
    assert len({t.name for t in ties}) == len(ties)


@pytest.mark.parametrize("seed", range(6))
@pytest.mark.parametrize("share", [0.04, 0.08, 0.2])
def test_a_share_is_reached_with_no_row_to_spare(seed: int, share: float) -> None:
    lake, bearing, lanes = scene(seed)
    goal = share * lengths_m(lanes).sum()
    ties = tie_lines(lake, bearing, lanes, TieSpec(share=share))
    assert lengths_m(ties).sum() >= goal
    rows = len({t.name.rstrip("abcdefgh") for t in ties})
    extent = shapely.get_coordinates(lake) @ along(bearing)
    if rows > 1:
        wider = (extent.max() - extent.min()) / (rows - 1)
        fewer = tie_lines(lake, bearing, lanes, TieSpec(spacing_m=wider))
        assert len({t.name.rstrip("abcdefgh") for t in fewer}) < rows
        assert lengths_m(fewer).sum() < goal


@pytest.mark.parametrize("seed", range(6))
def test_crossings_are_those_of_brute_force(seed: int) -> None:
    lake, bearing, lanes = scene(seed)
    ties = tie_lines(lake, bearing, lanes, parse_ties("8%"))
    lap = SurveyLine(points_m=shapely.get_coordinates(lake.exterior)[:5], kind=LineKind.SHORE)
    got = crossings((*lanes, lap, *ties))
    hits = np.array(
        [
            [
                shapely.LineString(t.points_m).intersects(shapely.LineString(x.points_m))
                for x in (*lanes, lap)
            ]
            for t in ties
        ]
    )
    assert got.ties == len(ties)
    assert got.crossings == hits.sum()
    assert got.fewest == hits.sum(axis=1).min() >= 1
    assert got.lanes == len(lanes)
    assert got.lanes_crossed == hits[:, :-1].any(axis=0).sum()
    assert got.length_m == pytest.approx(lengths_m(ties).sum())


def test_what_can_not_be_is_said() -> None:
    lake = shapely.box(0, 0, 100, 100)
    lanes = lane_lines(sweep_region(lake, 0.0, 10.0))
    with pytest.raises(InfeasibleError, match="more than"):
        tie_lines(shapely.box(0, 0, 100, 1e6), 0.0, lanes, parse_ties("1m"))
    far = tuple(SurveyLine(points_m=x.points_m + 1e4, name=x.name) for x in lanes)
    with pytest.raises(InfeasibleError, match="crosses a lane"):
        tie_lines(lake, 0.0, far, parse_ties("50m"))


@pytest.mark.parametrize(
    "text", ["", "5", "%", "x%", "0%", "101%", "-3%", "0m", "0.5m", "nanm", "infm"]
)
def test_bad_words_are_refused_by_name(text: str) -> None:
    with pytest.raises(ConfigError, match="--tie-lines"):
        parse_ties(text)


def test_good_words_are_read_and_written() -> None:
    for text in ("5%", "0.5%", "100%", "200m", "12.5m"):
        assert str(parse_ties(text)) == text
    assert parse_ties(" 200 M ").spacing_m == 200.0

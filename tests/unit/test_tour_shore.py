"""Shore laps: in the water, at their depth, shared in pieces; lanes for what they leave."""

from __future__ import annotations

import numpy as np
import pytest
import shapely
from lakes import random_lake_m

from mrmission.area.legs import leg_tolerance_m
from mrmission.model import FloatArray
from mrmission.tour.coverage import Uncovered
from mrmission.tour.lines import LineKind, SurveyLine, lane_lines, lengths_m
from mrmission.tour.shore import MITRE_LIMIT, MOST_SMOOTH, ShoreLaps, lanes_inside, shore_laps
from mrmission.tour.sweep import Sweep, lane_spacing_m, sweep_region

SWATH_M = 20.0
TOLERANCE_M = leg_tolerance_m(SWATH_M)


def laps_of(
    lake: shapely.Polygon, laps: int, overlap: float, bearing_deg: float = 0.0
) -> tuple[Sweep, ShoreLaps, tuple[SurveyLine, ...]]:
    spacing = lane_spacing_m(SWATH_M, overlap, TOLERANCE_M)
    sweep = sweep_region(lake, bearing_deg, spacing)
    mean = float(lengths_m(lane_lines(sweep)).mean())
    found = shore_laps(lake, laps, SWATH_M, overlap, TOLERANCE_M, mean)
    return sweep, found, lanes_inside(sweep, found.inner_m)


def legs_of(lines: tuple[SurveyLine, ...]) -> FloatArray:
    pairs = [np.stack([x.points_m[:-1], x.points_m[1:]], axis=1) for x in lines]
    return np.concatenate([np.zeros((0, 2, 2)), *pairs])


def ragged(seed: int) -> shapely.Polygon:
    rng = np.random.default_rng(seed)
    return random_lake_m(rng, 500.0, 4, corners=int(rng.integers(8, 30)))


@pytest.mark.parametrize("seed", range(6))
@pytest.mark.parametrize("laps", [1, 3])
def test_laps_stay_in_the_water_at_their_depth(seed: int, laps: int) -> None:
    lake = ragged(seed)
    _, found, lanes = laps_of(lake, laps, 0.1, 30.0 * seed)
    assert found.lines
    water = lake.buffer(1e-6)
    shore = lake.boundary
    spacing = lane_spacing_m(SWATH_M, 0.1, TOLERANCE_M)
    at_depth: dict[int, list[bool]] = {}
    for line, lap in zip(found.lines, found.lap, strict=True):
        way = shapely.LineString(line.points_m)
        assert line.kind is LineKind.SHORE
        assert water.covers(way)
        # nowhere nearer than its depth, and at its depth but for the corners about headlands
        depth = (lap - 0.5) * spacing
        dense = shapely.get_coordinates(shapely.segmentize(way, 2.0))
        away = shapely.distance(shore, shapely.points(dense))
        assert away.min() > depth * 0.9 - 2 * MOST_SMOOTH * SWATH_M
        assert away.max() < 1.1 * MITRE_LIMIT * depth + MOST_SMOOTH * SWATH_M
        at_depth.setdefault(lap, []).extend((away < depth + MOST_SMOOTH * SWATH_M).tolist())
    assert all(np.mean(near) > 0.3 for near in at_depth.values())
    for lane in lanes:
        assert lane.kind is LineKind.LANE
        assert water.covers(shapely.LineString(lane.points_m))


@pytest.mark.parametrize("overlap", [0.0, 0.1, 0.4])
@pytest.mark.parametrize("seed", range(4))
def test_laps_and_lanes_leave_no_more_than_lanes_alone(seed: int, overlap: float) -> None:
    lake = ragged(seed)
    sweep, found, lanes = laps_of(lake, 1, overlap, 17.0 * seed)
    uncovered = Uncovered(sweep.region, sweep.column_pitch_m, SWATH_M / 2)

    def left_m2(lines: tuple[SurveyLine, ...]) -> float:
        pieces = uncovered.remainder(sweep.frame.to_sweep(legs_of(lines)))
        return float(sum(p.area for p in pieces))

    alone = lane_lines(sweep)
    assert left_m2((*found.lines, *lanes)) <= left_m2(alone) + 0.002 * lake.area
    # lanes are shorter by about what the laps take over
    assert lengths_m(lanes).sum() < lengths_m(alone).sum() - 0.5 * lengths_m(found.lines).sum()


def test_in_a_rectangle_laps_and_lanes_are_where_they_belong() -> None:
    lake = shapely.box(0, 0, 400, 300)
    spacing = lane_spacing_m(SWATH_M, 0.1, TOLERANCE_M)
    _, found, lanes = laps_of(lake, 2, 0.1)
    for lap in (1, 2):
        ring = [x for x, n in zip(found.lines, found.lap, strict=True) if n == lap]
        inset = lake.buffer(-(lap - 0.5) * (spacing - 0.05), join_style="mitre")
        whole = shapely.unary_union([shapely.LineString(x.points_m) for x in ring])
        assert whole.length == pytest.approx(inset.exterior.length, rel=0.01)
        assert shapely.hausdorff_distance(whole, inset.exterior) < 1.0
    # two spacings are swept by the laps; what is left begins there, less a hair of smoothing
    feet = np.array([line.points_m[:, 1].min() for line in lanes])
    assert feet == pytest.approx(2 * spacing, abs=1.0)
    places = np.array([line.points_m[0, 0] for line in lanes])
    assert places.min() > 1.5 * spacing
    # names: a ring's pieces have its number and letters
    assert {x.name[:2] for x in found.lines} == {"S1", "S2"}
    assert len({x.name for x in found.lines}) == len(found.lines)


def test_pieces_of_a_ring_make_the_ring_and_are_as_long_as_lanes() -> None:
    islands = [shapely.box(x, 120, x + 30, 160) for x in (80, 200, 320)]
    lake = shapely.box(0, 0, 430, 280) - shapely.union_all(islands)
    _, found, _ = laps_of(lake, 1, 0.1)
    mean = float(lengths_m(lane_lines(sweep_region(lake, 0.0, 17.9))).mean())
    rings: dict[str, list[SurveyLine]] = {}
    for line in found.lines:
        rings.setdefault(line.name.rstrip("abcdefghijklmnopqrstuvwxyz"), []).append(line)
    assert len(rings) == 1 + len(lake.interiors) == 4
    for pieces in rings.values():
        for a, b in zip(pieces, [*pieces[1:], pieces[0]], strict=True):
            assert a.points_m[-1] == pytest.approx(b.points_m[0])
        if len(pieces) > 1:
            assert lengths_m(pieces).max() < 2 * mean


def test_a_canal_has_no_room_for_a_second_lap() -> None:
    canal = shapely.box(0, 0, 600, 30)
    _, found, _ = laps_of(canal, 4, 0.1)
    assert set(found.lap) == {1}
    sweep, none, lanes = laps_of(shapely.box(0, 0, 600, 15), 1, 0.1)
    assert none.lines == ()
    assert len(lanes) == len(lane_lines(sweep))


def test_names_of_lanes_inside_are_those_of_their_columns() -> None:
    lake = shapely.box(0, 0, 400, 300)
    sweep, _, lanes = laps_of(lake, 1, 0.1)
    column = {line.name: line.points_m[0, 0] for line in lane_lines(sweep)}
    for lane in lanes:
        assert lane.points_m[0, 0] == pytest.approx(column[lane.name.rstrip("ab")])

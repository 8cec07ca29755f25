"""The fairway: how wide, where, and that lanes and fairway together sweep all that lanes did."""

from __future__ import annotations

import re

import numpy as np
import pytest
import shapely
from lakes import area_of, random_lake_m

from mrmission.errors import ConfigError
from mrmission.options import PlanOptions
from mrmission.pipeline import plan
from mrmission.report.units import lanes_text
from mrmission.tour.fairway import Columns, Fairway, fairway_of, lanes_with_fairway
from mrmission.tour.lines import LineKind, geometry_of, lane_lines
from mrmission.tour.sweep import sweep_region
from mrmission.tour.tie_spec import TieSpec

SPACING_M = 10.0


def lines_of(
    region: shapely.Polygon, bearing_deg: float, start: tuple[float, float], robots: int
) -> tuple[list[shapely.LineString], list[shapely.LineString], Fairway | None]:
    """The lanes beside the fairway, the fairway's lanes, and the fairway."""
    sweep = sweep_region(region, bearing_deg, SPACING_M)
    fairway = fairway_of(Columns.of(sweep), np.array(start), robots)
    lines = lane_lines(sweep) if fairway is None else lanes_with_fairway(sweep, fairway)
    across = [line for line in lines if line.kind is LineKind.FAIRWAY]
    lanes = [line for line in lines if line.kind is LineKind.LANE]
    assert len(across) + len(lanes) == len(lines)
    assert len({line.name for line in lines}) == len(lines)
    return geometry_of(lanes), geometry_of(across), fairway


def test_a_rectangle_is_as_wide_as_robots_pass() -> None:
    # lanes run north; all start in the south-west corner, so the fairway runs east from there
    box = shapely.box(0, 0, 600, 400)
    lanes, across, fairway = lines_of(box, 0.0, (1.0, 1.0), 8)
    assert fairway is not None
    rows = fairway.stop - fairway.first
    beyond = 1 - (np.arange(60) + 1) / 60
    wanted = np.round(16 * beyond)
    assert (rows[1:][wanted[1:] >= 2] == wanted[1:][wanted[1:] >= 2]).all()
    assert (rows[wanted < 2] == 0).all()
    assert (fairway.first[rows > 0] == 0).all()
    # lanes and fairway meet, nothing is swept twice: their length is that of lanes alone
    assert sum(line.length for line in lanes + across) == pytest.approx(600 * 400 / 10)
    for line in across:
        assert line.coords[0][1] == pytest.approx(line.coords[1][1])
    for line in lanes:
        assert line.coords[0][0] == pytest.approx(line.coords[1][0])


def test_from_the_middle_it_goes_both_ways() -> None:
    box = shapely.box(-300, -200, 300, 200)
    _, _, fairway = lines_of(box, 0.0, (0.0, 0.0), 8)
    assert fairway is not None
    rows = fairway.stop - fairway.first
    assert np.abs(rows - rows[::-1]).max() <= 1
    assert 6 <= rows.max() <= 8  # half of the robots go to either side, and come back
    middle = 0.5 * (fairway.border_m[fairway.first[30]] + fairway.border_m[fairway.stop[30]])
    assert abs(middle) <= 10


@pytest.mark.parametrize("seed", range(12))
def test_what_lanes_cover_lanes_and_fairway_cover(seed: int) -> None:
    """All but slivers beside the ends of lanes, of which a fairway has no more than lanes have."""
    rng = np.random.default_rng(seed)
    lake = random_lake_m(rng, 700.0, 3)
    bearing = float(rng.uniform(0, 180))
    start = shapely.get_coordinates(lake.representative_point())[0]
    lanes, across, fairway = lines_of(lake, bearing, (start[0], start[1]), 6)
    assert fairway is not None
    assert across
    plain = geometry_of(lane_lines(sweep_region(lake, bearing, SPACING_M)))
    pitch = sweep_region(lake, bearing, SPACING_M).column_pitch_m

    def missed(lines: list[shapely.LineString]) -> float:
        swept = shapely.union_all(shapely.buffer(lines, pitch / 2 + 1e-6, quad_segs=32))
        return float(shapely.difference(lake, swept).area)

    assert missed(lanes + across) <= missed(plain) + 0.5 * pitch * pitch * len(across)
    half = 0.5 * (fairway.border_m[1] - fairway.border_m[0])
    strip = shapely.union_all(shapely.buffer(across, half - 1e-3, cap_style="flat"))
    assert shapely.intersection(strip, shapely.union_all(lanes)).length < 0.01
    outside = shapely.difference(shapely.union_all(lanes + across), lake.buffer(1e-6))
    assert outside.length == 0


def test_it_follows_the_water_and_ends_where_the_water_does() -> None:
    # a channel east, and a second lake beyond land at the same height
    channel = shapely.box(0, 0, 300, 100)
    north = shapely.box(280, 0, 300, 400)
    back = shapely.box(280, 300, 600, 400)
    down = shapely.box(580, 0, 600, 400)
    region = shapely.union_all([channel, north, back, down])
    _, across, fairway = lines_of(region, 0.0, (5.0, 50.0), 8)
    assert fairway is not None
    assert max(x for line in across for x, _ in line.coords) <= 301


def test_one_robot_in_a_narrow_water_needs_none() -> None:
    lanes, across, fairway = lines_of(shapely.box(0, 0, 600, 12), 90.0, (1.0, 6.0), 1)
    assert fairway is None
    assert not across
    assert lanes


def planned(water: shapely.Polygon, **more: object) -> PlanOptions:
    """Options of a small plan."""
    options = {
        "swath_m": 10.0, "overlap": 0.0, "clearance_m": 0.0, "separation_m": 0.0, "fence": False,
        "time_budget_s": 1.5, "robots": 6,
    }  # fmt: skip
    return PlanOptions(**{**options, **more})  # type: ignore[arg-type]


def test_a_plan_with_a_fairway_is_shorter_and_as_complete() -> None:
    water = shapely.box(-200, -150, 200, 150)
    area = area_of(water)
    start = (
        (float(area.water_lonlat.bounds[0]) + 1e-5, float(area.water_lonlat.bounds[1]) + 1e-5),
    )
    without, with_it, found = (
        plan(area, planned(water, fairway=asked, angle_deg=angle, starts_lonlat=start)).report
        for asked, angle in ((False, 0.0), (True, 0.0), (None, None))
    )
    kinds = [{line.kind for line in report.lines} for report in (without, with_it, found)]
    assert "fairway" not in kinds[0]
    assert "fairway" in kinds[1]
    assert with_it.makespan_s < 0.98 * without.makespan_s
    assert found.makespan_s < 0.98 * without.makespan_s
    assert min(r.coverage for r in (without, with_it, found)) > 0.9995


def test_lanes_that_are_asked_for_lie_as_asked() -> None:
    area = area_of(shapely.box(-200, -150, 200, 150))
    for more in (
        {"angle_deg": 0.0},
        {"across_wind_deg": 270.0},
        {"fairway": False},
        {"tie_lines": TieSpec(share=0.05)},
        {"shore_laps": 1},
    ):
        report = plan(area, planned(area.water_lonlat, **more)).report
        assert "fairway" not in {line.kind for line in report.lines}, more


@pytest.mark.parametrize(
    ("more", "flag"),
    [
        ({"tie_lines": TieSpec(share=0.05)}, "--tie-lines"),
        ({"shore_laps": 1}, "--shore-laps"),
        ({"method": "crc"}, "--method crc"),
    ],
)
def test_what_does_not_go_with_a_fairway_is_refused(more: dict[str, object], flag: str) -> None:
    with pytest.raises(ConfigError, match=flag):
        PlanOptions(fairway=True, **more)  # type: ignore[arg-type]


def test_robots_that_start_far_apart_have_none() -> None:
    area = area_of(shapely.box(-200, -150, 200, 150))
    west, south, east, north = area.water_lonlat.bounds
    starts = ((west + 1e-5, south + 1e-5), (east - 1e-5, north - 1e-5))
    report = plan(
        area, planned(area.water_lonlat, robots=2, starts_lonlat=starts, fairway=True)
    ).report
    assert "fairway" not in {line.kind for line in report.lines}


def test_the_report_counts_the_rows_of_the_fairway() -> None:
    area = area_of(shapely.box(-200, -150, 200, 150))
    report = plan(area, planned(area.water_lonlat, fairway=True, angle_deg=0.0)).report
    rows = {re.match(r"F\d+", line.name)[0] for line in report.lines if line.kind == "fairway"}  # type: ignore[index]
    assert len(rows) > 2
    assert lanes_text(report) == f"10 m apart, 0°; {len(rows)} across, in the fairway"
    assert "fairway" not in lanes_text(plan(area, planned(area.water_lonlat, fairway=False)).report)

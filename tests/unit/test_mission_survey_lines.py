"""Lines found again in missions: items, ends, lengths, pieces, extras."""

from __future__ import annotations

import csv
import io
import json

import numpy as np
import pytest

from mrmission.area.frame import LocalFrame
from mrmission.mission.geojson import tours_geojson
from mrmission.mission.items import build_items
from mrmission.mission.kml import tours_kml
from mrmission.mission.lines_csv import COLUMNS, lines_csv
from mrmission.mission.qgc_plan import parse_plan, plan_text
from mrmission.mission.survey_lines import name_lines
from mrmission.mission.tracks import line_label, tracks
from mrmission.model import LegKind, LineReport, Mission
from mrmission.options import PlanOptions
from mrmission.tour.lines import LineKind, SurveyLine, between

FRAME = LocalFrame(lon_deg=8.4, lat_deg=53.1)
T, S = int(LegKind.TRANSIT), int(LegKind.SURVEY)
LANE = SurveyLine(points_m=np.array([[0.0, 0], [0, 200]]), name="1")
OTHER = SurveyLine(points_m=np.array([[20.0, 0], [20, 200]]), name="2a")
LAP = SurveyLine(
    points_m=np.array([[-50.0, 0], [-50, 80], [-30, 120]]), kind=LineKind.SHORE, name="S1"
)
TIE = SurveyLine(points_m=np.array([[-20.0, 100], [60, 100]]), kind=LineKind.TIE, name="T1")


def mission(
    points: list[tuple[float, float]], kind: list[int], robot: int = 1, **options: float
) -> Mission:
    lonlat = FRAME.to_lonlat(np.array(points, dtype=float))
    items, kinds, lanes = build_items(
        lonlat, np.array(kind), np.zeros(len(kind), dtype=int),
        PlanOptions(transit_speed_m_s=3.0, **options),  # type: ignore[arg-type]
    )  # fmt: skip
    return Mission(
        robot=robot, sortie=1, vehicle="boat", items=items, kind=kinds, lane=lanes,
        fence=(), rally=(),
    )  # fmt: skip


def place_m(m: Mission, seq: int) -> np.ndarray:
    item = m.items[seq]
    return FRAME.to_metric(np.array([[item.y, item.x]]) / 1e7)[0]


def test_each_line_is_found_with_its_items() -> None:
    way = [(5, -9), (0, 0), (0, 200), (20, 200), (20, 0), (-50, 0), (-50, 80), (-30, 120),
           (-20, 100), (60, 100), (5, -9)]  # fmt: skip
    (m,) = name_lines(
        [mission(way, [T, S, T, S, T, S, S, T, S, T])], [LANE, OTHER, LAP, TIE], FRAME
    )
    assert [(x.name, x.kind) for x in m.lines] == [
        ("1", "lane"), ("2a", "lane"), ("S1", "shore"), ("T1", "tie"),
    ]  # fmt: skip
    for line, wanted in zip(m.lines, (LANE, OTHER, LAP, TIE), strict=True):
        assert line.length_m == pytest.approx(wanted.length_m, abs=0.05)
        ends = [place_m(m, line.from_item), place_m(m, line.to_item)]
        # swept from either end
        ends.sort(key=lambda p: np.hypot(*(p - wanted.points_m[0])))
        assert np.array(ends) == pytest.approx(wanted.ends_m, abs=0.02)
        start = FRAME.to_metric(np.array([line.start_lonlat]))[0]
        assert start == pytest.approx(place_m(m, line.from_item), abs=0.02)
    assert m.lines[0].bearing_deg == pytest.approx(0.0, abs=0.01)
    assert m.lines[1].bearing_deg == pytest.approx(180.0, abs=0.01)
    assert m.lines[3].bearing_deg == pytest.approx(90.0, abs=0.01)
    # the lanes of the legs are the lines, in order
    assert sorted(set(m.lane)) == [0, 1, 2, 3, 4]
    assert [t.lane for t in tracks(m) if t.kind == LegKind.SURVEY] == [1, 2, 3, 4]
    assert line_label(m, 3) == "lap S1"
    assert line_label(m, 4) == "tie line T1"


def test_a_line_shared_by_robots_is_numbered_along_itself() -> None:
    a, b = between(LANE, 0, 80), between(LANE, 80, 200)
    first = mission([(5, -9), (0, 200), (0, 80), (5, -9)], [T, S, T], robot=1)
    second = mission([(5, -9), (0, 0), (0, 80), (5, -9)], [T, S, T], robot=2)
    one, two = name_lines([first, second], [LANE], FRAME)
    assert [x.name for x in (*one.lines, *two.lines)] == ["1-2", "1-1"]
    assert one.lines[0].length_m == pytest.approx(b.length_m, abs=0.05)
    assert two.lines[0].length_m == pytest.approx(a.length_m, abs=0.05)


def test_pieces_swept_away_from_each_other_are_numbered_along_the_line() -> None:
    up = mission([(5, -9), (0, 80), (0, 200), (5, -9)], [T, S, T], robot=1)
    down = mission([(5, -9), (0, 80), (0, 0), (5, -9)], [T, S, T], robot=2)
    one, two = name_lines([up, down], [LANE], FRAME)
    assert [x.name for x in (*one.lines, *two.lines)] == ["1-2", "1-1"]


def test_a_detour_is_an_extra_and_the_line_goes_on() -> None:
    way = [(5, -9), (0, 0), (0, 90), (-12, 90), (0, 90), (0, 200), (5, -9)]
    (m,) = name_lines([mission(way, [T, S, S, S, S, T])], [LANE], FRAME)
    assert [(x.name, x.kind) for x in m.lines] == [("1", "lane"), ("E1", "extra")]
    assert m.lines[0].length_m == pytest.approx(200, abs=0.05)
    assert m.lines[1].length_m == pytest.approx(24, abs=0.05)
    assert (m.lines[0].from_item, m.lines[0].to_item) == (3, 8)
    assert [t.lane for t in tracks(m) if t.lane] == [1, 2, 1]


def test_lines_that_follow_on_each_other_in_one_leg_are_both_found() -> None:
    low, high = between(LANE, 0, 70), between(LANE, 70, 200)
    pieces = [
        SurveyLine(points_m=low.points_m, kind=LineKind.SHORE, name="S1a"),
        SurveyLine(points_m=high.points_m, kind=LineKind.SHORE, name="S1b"),
    ]
    (m,) = name_lines([mission([(5, -9), (0, 0), (0, 200), (5, -9)], [T, S, T])], pieces, FRAME)
    assert [x.name for x in m.lines] == ["S1a", "S1b"]
    assert [x.length_m for x in m.lines] == pytest.approx([70, 130], abs=0.05)
    middle = FRAME.to_metric(np.array([m.lines[0].end_lonlat, m.lines[1].start_lonlat]))
    assert middle == pytest.approx(np.array([[0, 70], [0, 70]]), abs=0.02)
    assert m.lines[0].from_item == m.lines[1].from_item


def test_crossing_and_near_lines_are_not_mixed_up() -> None:
    near = SurveyLine(points_m=LANE.points_m + np.array([1.0, 0.0]), name="9")
    way = [(5, -9), (0, 0), (0, 200), (5, -9)]
    (m,) = name_lines([mission(way, [T, S, T])], [near, TIE, LANE], FRAME)
    assert [x.name for x in m.lines] == ["1"]
    (none,) = name_lines([mission(way, [T, T, T])], [LANE], FRAME)
    assert none.lines == ()
    assert set(none.lane) == {0}
    idle = Mission(robot=2, sortie=1, vehicle="boat", items=(), fence=(), rally=())
    assert name_lines([idle], [LANE], FRAME)[0].lines == ()
    (extra,) = name_lines([mission(way, [T, S, T])], [], FRAME)
    assert [x.name for x in extra.lines] == ["E1"]


def test_files_name_the_lines() -> None:
    way = [(5, -9), (0, 0), (0, 200), (20, 200), (20, 0), (5, -9)]
    (m,) = name_lines([mission(way, [T, S, T, S, T])], [LANE, OTHER], FRAME)
    document = json.loads(plan_text(m))
    assert document["lines"] == [
        {"name": x.name, "kind": x.kind, "items": [x.from_item, x.to_item]} for x in m.lines
    ]
    # the numbers are those of the items in the file
    by_id = {item["doJumpId"]: item for item in document["mission"]["items"]}
    for line in document["lines"]:
        for item in line["items"]:
            assert by_id[item]["command"] == 16
    # our reader, like QGroundControl, passes over the key
    assert parse_plan(json.dumps(document)).items == m.items
    survey = [f for f in json.loads(tours_geojson([m]))["features"] if f["properties"]["lane"]]
    assert [f["properties"]["line"] for f in survey] == ["1", "2a"]
    assert [f["properties"]["line_kind"] for f in survey] == ["lane", "lane"]
    assert "<name>lane 2a</name>" in tours_kml([m])


def test_the_table_of_lines() -> None:
    ring = LineReport(
        name="S5", kind="shore", robot=2, sortie=3, from_item=4, to_item=9,
        start_lonlat=(8.4, 53.1), end_lonlat=(8.4, 53.1), length_m=607.24, bearing_deg=None,
    )  # fmt: skip
    rows = list(csv.reader(io.StringIO(lines_csv([ring]))))
    assert rows[0] == list(COLUMNS)
    assert rows[1] == [
        "S5", "shore", "2", "3", "4", "9", "8.4000000", "53.1000000", "8.4000000", "53.1000000",
        "607.2", "",
    ]  # fmt: skip
    assert lines_csv([]).count("\n") == 1

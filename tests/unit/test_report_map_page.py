"""The map page: one safe, self-contained file that holds the whole plan."""

from __future__ import annotations

import dataclasses
import html.parser
import json
import re

import numpy as np
import pyproj
import pytest
import shapely
from factories import make_plan

from mrmission.model import SurveyArea
from mrmission.report.map_data import map_data, tracks
from mrmission.report.map_page import map_html, script_json


class Page(html.parser.HTMLParser):
    """Elements, scripts and text of a page, as a browser's parser would split them."""

    def __init__(self, text):
        super().__init__()
        self.tags = []
        self.scripts = []
        self.words = []
        self.inside = None
        self.feed(text)

    def handle_starttag(self, tag, attrs):
        self.tags.append((tag, dict(attrs)))
        self.inside = tag if tag in ("script", "style") else None
        if tag == "script":
            self.scripts.append("")

    def handle_endtag(self, tag):
        self.inside = None

    def handle_data(self, data):
        if self.inside == "script":
            self.scripts[-1] += data
        elif self.inside != "style":
            self.words.append(data)

    @property
    def data(self):
        return json.loads(self.scripts[0])


def points(code):
    return np.cumsum(np.array(code).reshape(-1, 2), axis=0) / 100


def expand(code):
    return [value for value, count in zip(code[::2], code[1::2], strict=True) for _ in range(count)]


def test_same_plan_same_bytes():
    assert map_html(make_plan()) == map_html(make_plan())


def test_nothing_from_outside():
    text = map_html(make_plan(name="Lake", notes=("see https://example.org",)))
    page = Page(text)
    for tag, attributes in page.tags:
        assert tag not in ("img", "iframe", "object", "embed", "base", "form")
        for name in ("src", "href", "action"):
            assert (attributes.get(name) or "data:,") == "data:,"
    assert not re.search(r"fetch\(|XMLHttpRequest|WebSocket|@import|url\(|importScripts", text)
    policy = [a["content"] for t, a in page.tags if a.get("http-equiv")]
    assert policy
    assert policy[0].startswith("default-src 'none'")


@pytest.mark.parametrize(
    "name",
    [
        "</script><script>alert(1)</script>",
        "<!-- <script>",
        'Lac & "L\'Île" <b>',
        "{{data}} {{robots}}",
        "湖 \u2028 \U0001f6a4",
        "\\u003c/script\\u003e",
    ],
)
def test_any_name_is_only_text(name):
    plan = make_plan(robots=2)
    area = SurveyArea(
        name=name, source=name, water_lonlat=plan.area.water_lonlat, notes=(f"note {name}",)
    )
    plain, page = Page(map_html(plan)), Page(map_html(dataclasses.replace(plan, area=area)))
    assert page.data["name"] == name
    assert [tag for tag, _ in page.tags if tag != "li"] == [
        tag for tag, _ in plain.tags if tag != "li"
    ]
    assert len(page.scripts) == 2
    assert name in "".join(page.words)
    assert ("canvas", f"Map of {name}") in [(t, a.get("aria-label")) for t, a in page.tags]


def test_script_json_round_trip():
    value = {"a": "</script><!--&\u2028é", "b": [1, 2.5, None]}
    text = script_json(value)
    assert json.loads(text) == value
    assert not set("<>&") & set(text)
    assert text.isascii()


def test_tracks_are_the_missions():
    plan = make_plan(robots=3)
    for robot in Page(map_html(plan)).data["robots"]:
        number = robot["robot"]
        mission, path = plan.missions[number - 1], plan.paths[number - 1]
        (sortie,) = robot["sorties"]
        assert np.allclose(points(sortie["points"]), path.points_m, atol=0.021)
        assert expand(sortie["kind"]) == path.kind.tolist()
        assert expand(sortie["lane"]) == path.lane.tolist()
        numbers = np.cumsum(expand(sortie["item"])).tolist()
        assert numbers == [item.seq for item in mission.items if item.command == 16][1:]


def test_tracks_without_missions_are_the_paths():
    plan = dataclasses.replace(make_plan(robots=2), missions=())
    found = tracks(plan)
    assert sorted(found) == [1, 2]
    for robot, track in found.items():
        path = plan.paths[robot - 1]
        assert np.array_equal(track.points_m[0], path.points_m)
        legs = np.hypot(*np.diff(path.points_m, axis=0).T)
        assert track.length_m == pytest.approx(legs.sum())


def test_several_sorties_stay_apart():
    plan = make_plan(robots=1)
    second = dataclasses.replace(plan.missions[0], sortie=2)
    data = map_data(dataclasses.replace(plan, missions=(second, plan.missions[0])))
    assert len(data["robots"][0]["sorties"]) == 2


def test_shapes_to_the_centimetre():
    plan = make_plan()
    data = map_data(plan)
    for name, shape in (("water", plan.water_m), ("region", plan.region_m)):
        rings = [ring for part in shape.geoms for ring in (part.exterior, *part.interiors)]
        codes = [ring for part in data[name] for ring in part]
        assert len(rings) == len(codes)
        for ring, code in zip(rings, codes, strict=True):
            assert np.allclose(points(code), shapely.get_coordinates(ring), atol=0.00501)


def test_unreached_part_is_drawn():
    plan = make_plan()
    (part,) = map_data(plan)["unreached"]
    area = shapely.Polygon(points(part[0])).area
    assert area == pytest.approx(plan.report.unreached_m2, rel=1e-3)
    assert map_data(make_plan(pond=False))["unreached"] == []


def test_fences_shared_by_robots_come_once():
    plan = make_plan(robots=5)
    fences = map_data(plan)["fences"]
    assert len(fences) == len(plan.missions[0].fence)
    assert all(fence["robots"] == [1, 2, 3, 4, 5] for fence in fences)
    assert [fence["inclusion"] for fence in fences].count(True) == 1


def test_cursor_polynomial_is_the_projection():
    plan = make_plan()
    fit = map_data(plan)["lonlat"]
    projection = pyproj.Proj(plan.report.frame)
    west, south, east, north = plan.water_m.bounds
    for x, y in ((west, south), (east, north), (0.0, 0.0), (east, south)):
        u = (x - fit["centre_m"][0]) / fit["scale_m"]
        v = (y - fit["centre_m"][1]) / fit["scale_m"]
        terms = [u**i * v**j for i in range(fit["degree"] + 1) for j in range(fit["degree"] + 1)]
        lon, lat = projection(x, y, inverse=True)
        assert np.dot(terms, fit["lon"]) == pytest.approx(lon, abs=1e-8)
        assert np.dot(terms, fit["lat"]) == pytest.approx(lat, abs=1e-8)


def test_cursor_polynomial_at_the_antimeridian():
    frame = "+proj=tmerc +lat_0=-17 +lon_0=180 +datum=WGS84"
    plan = make_plan(frame=frame)
    fit = map_data(plan)["lonlat"]
    assert abs(fit["lon"][0]) == pytest.approx(180, abs=0.1)
    assert max(abs(value) for value in fit["lon"][1:]) < 0.1


def test_tables_say_what_the_report_says():
    plan = make_plan(robots=3)
    words = " ".join(" ".join(Page(map_html(plan)).words).split())
    for expected in (
        "area bound", "7.6 %", "99.99 %", "99.81 %", "96.32 %", "Assumed", "overlap 10 %",
        "swath 20 m", "The pond in the north-east is not reached.", "in 1 part",
    ):  # fmt: skip
        assert expected in words
    boxes = [a for t, a in Page(map_html(plan)).tags if a.get("class") == "robot"]
    assert [box["value"] for box in boxes] == ["1", "2", "3"]
    assert all(box["aria-label"] == f"Show robot {box['value']}" for box in boxes)


def test_robot_without_work():
    plan = make_plan(robots=2, swath_m=1200.0)
    assert any(row.lanes == 0 for row in plan.report.robots)
    page = Page(map_html(plan))
    assert "no work" in " ".join(page.words)
    assert len(page.data["robots"]) == 2


def test_size_stays_small():
    plan = make_plan(robots=6, swath_m=3.0, lane_points=50)
    items = sum(len(mission.items) for mission in plan.missions)
    assert items > 25_000
    assert len(map_html(plan)) < 12 * items

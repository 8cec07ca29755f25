from __future__ import annotations

import itertools
import json
import xml.etree.ElementTree as ET

import numpy as np

from mrmission.mission.geojson import tours_geojson
from mrmission.mission.items import build_items
from mrmission.mission.kml import tours_kml
from mrmission.mission.tracks import tracks
from mrmission.model import LegKind, Mission
from mrmission.options import PlanOptions

PATH = np.array([[10, 50], [10.01, 50], [10.01, 50.01], [10.02, 50.01], [10.02, 50], [10, 50.0]])


def sample(robot: int) -> Mission:
    items, kind, lane = build_items(
        PATH, np.array([0, 1, 0, 1, 0]), np.array([0, 1, 0, 2, 0]),
        PlanOptions(transit_speed_m_s=1.0),
    )  # fmt: skip
    return Mission(
        robot=robot, sortie=1, vehicle="boat", items=items, kind=kind, lane=lane, fence=(), rally=()
    )


EMPTY = Mission(robot=3, sortie=1, vehicle="boat", items=(), fence=(), rally=())


def test_tracks_follow_the_items() -> None:
    mission = sample(1)
    rows = list(tracks(mission))
    assert [t.kind for t in rows] == [0, 1, 0, 1, 0]
    assert [t.lane for t in rows] == [0, 1, 0, 2, 0]
    # every leg between two different positions is in exactly one track
    points = [p for t in rows for p in t.points_e7[1:]]
    assert points == [(round(lat * 1e7), round(lon * 1e7)) for lon, lat in PATH[1:]]
    for a, b in itertools.pairwise(rows):
        assert a.to_item == b.from_item
        assert a.points_e7[-1] == b.points_e7[0]
    for t in rows:
        assert (mission.items[t.to_item].x, mission.items[t.to_item].y) == t.points_e7[-1]
    assert list(tracks(EMPTY)) == []


def test_geojson() -> None:
    document = json.loads(tours_geojson([sample(1), sample(2), EMPTY]))
    assert document["type"] == "FeatureCollection"
    assert len(document["features"]) == 10
    first = document["features"][1]
    assert first["geometry"] == {
        "type": "LineString",
        "coordinates": [[10.01, 50.0], [10.01, 50.01]],
    }
    assert first["properties"] == {
        "robot": 1, "sortie": 1, "kind": "survey", "lane": 1, "from_item": 3, "to_item": 5,
        "line": None, "line_kind": None,
    }  # fmt: skip
    assert json.loads(tours_geojson([])) == {"type": "FeatureCollection", "features": []}


def test_kml() -> None:
    root = ET.fromstring(tours_kml([sample(1), sample(2), EMPTY], "a & b"))
    ns = {"k": "http://www.opengis.net/kml/2.2"}
    assert root.findtext("k:Document/k:name", namespaces=ns) == "a & b"
    folders = root.findall("k:Document/k:Folder", ns)
    assert [len(f.findall("k:Placemark", ns)) for f in folders] == [6, 6, 0]
    styles = {"#" + s.attrib["id"] for s in root.iter("{http://www.opengis.net/kml/2.2}Style")}
    used = {s.text for s in root.iter("{http://www.opengis.net/kml/2.2}styleUrl")}
    assert used <= styles
    line = (
        folders[0]
        .findall("k:Placemark", ns)[2]
        .findtext("k:LineString/k:coordinates", namespaces=ns)
    )
    assert line == "10.0100000,50.0000000 10.0100000,50.0100000"
    assert LegKind.SURVEY == 1

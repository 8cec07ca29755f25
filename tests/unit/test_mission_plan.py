from __future__ import annotations

import json
import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from mrmission.errors import PlanFormatError
from mrmission.mission.items import build_items
from mrmission.mission.qgc_plan import parse_plan, plan_text, read_plan, write_plan
from mrmission.model import FencePolygon, Mission, MissionItem, RallyPoint
from mrmission.options import PlanOptions


def same(a: Mission, b: Mission) -> bool:
    """Equal in all that a file holds; NaN equals NaN."""

    def shown(m: Mission) -> str:
        fence = [(p.inclusion, p.points_e7.tolist()) for p in m.fence]
        return repr((m.vehicle, m.items, fence, m.rally))

    return shown(a) == shown(b)


def sample(vehicle: str = "boat") -> Mission:
    path = np.array(
        [[-81.3, 34.06], [-81.2999999, 34.0700001], [-81.31234567, 34.08], [-81.3, 34.06]]
    )
    items, kind, lane = build_items(
        path, np.array([0, 1, 0]), np.array([0, 1, 0]),
        PlanOptions(vehicle=vehicle, transit_speed_m_s=2.5),
    )  # fmt: skip
    ring = np.array([[340000001, -814000003], [341000007, -814000003], [341000007, -812000009]])
    return Mission(
        robot=2, sortie=1, vehicle=vehicle, items=items, kind=kind, lane=lane,
        fence=(
            FencePolygon(inclusion=True, points_e7=ring),
            FencePolygon(inclusion=False, points_e7=ring[::-1] + 7),
        ),
        rally=(RallyPoint(lat_e7=340600000, lon_e7=-813000000),),
    )  # fmt: skip


@pytest.mark.parametrize("vehicle", ["boat", "rover", "copter"])
def test_written_plans_read_back_the_same(vehicle: str, tmp_path: Path) -> None:
    mission = sample(vehicle)
    path = tmp_path / "robot-2.plan"
    write_plan(mission, path)
    back = read_plan(path)
    assert same(mission, back)
    assert (back.robot, back.sortie) == (2, 1)
    write_plan(back, tmp_path / "robot-2-sortie-3.plan")
    assert (tmp_path / "robot-2-sortie-3.plan").read_bytes() == path.read_bytes()
    assert read_plan(tmp_path / "robot-2-sortie-3.plan").sortie == 3


def test_the_document_is_what_qgroundcontrol_wants() -> None:
    document = json.loads(plan_text(sample()))
    assert (document["fileType"], document["version"]) == ("Plan", 1)
    mission = document["mission"]
    assert (mission["version"], mission["firmwareType"], mission["vehicleType"]) == (2, 3, 11)
    assert mission["plannedHomePosition"] == [34.06, -81.3, 0]
    assert [len(i["params"]) for i in mission["items"]] == [7] * len(mission["items"])
    assert [i["doJumpId"] for i in mission["items"]] == list(range(1, len(mission["items"]) + 1))
    for item in mission["items"]:
        assert len({"Altitude", "AltitudeMode", "AMSLAltAboveTerrain"} & set(item)) in (0, 3)
    assert document["geoFence"]["version"] == document["rallyPoints"]["version"] == 2
    assert [p["inclusion"] for p in document["geoFence"]["polygons"]] == [True, False]
    assert len(document["geoFence"]["polygons"][0]["polygon"]) == 3


def test_a_robot_without_work_has_an_empty_valid_plan() -> None:
    mission = Mission(robot=1, sortie=1, vehicle="boat", items=(), fence=(), rally=())
    document = json.loads(plan_text(mission, (-81.3, 34.06)))
    assert document["mission"]["items"] == []
    assert document["mission"]["plannedHomePosition"] == [34.06, -81.3, 0]
    assert same(parse_plan(plan_text(mission)), mission)


def test_nan_is_null() -> None:
    item = MissionItem(
        seq=1, frame=3, command=16, current=0, autocontinue=1, param1=0.0, param2=0.0, param3=0.0,
        param4=math.nan, x=1, y=-1, z=2.5,
    )  # fmt: skip
    mission = Mission(
        robot=1, sortie=1, vehicle="boat", items=(sample().items[0], item), fence=(), rally=()
    )
    text = plan_text(mission)
    assert json.loads(text)["mission"]["items"][0]["params"] == [0, 0, 0, None, 1e-7, -1e-7, 2.5]
    assert same(parse_plan(text), mission)


def edit(path: str, value: Any) -> str:
    """The sample's document with one place changed; `del` removes it."""
    document = json.loads(plan_text(sample()))
    at: Any = document
    *keys, last = [int(k) if k.isdigit() else k for k in path.split(".")]
    for key in keys:
        at = at[key]
    if value == "del":
        del at[last]
    else:
        at[last] = value
    return json.dumps(document)


BROKEN = [
    ("fileType", "Fence", "fileType is"),
    ("version", 2, "version is 2: must be 1"),
    ("mission", "del", "no 'mission'"),
    ("geoFence", "del", "no 'geoFence'"),
    ("rallyPoints", "del", "no 'rallyPoints'"),
    ("geoFence.version", 1, "geoFence.version is 1: must be 2"),
    ("mission.plannedHomePosition", [1, 2], "3 numbers"),
    ("mission.items.1.params", [0] * 6, "7 numbers, not 6"),
    ("mission.items.0.params.4", 95, r"mission.items\[0\].params\[4\] is 95: must be a latitude"),
    ("mission.items.0.params.5", 181, "longitude"),
    ("mission.items.0.params.0", "x", 'is "x": must be a number'),
    ("mission.items.0.params.0", True, "must be a number"),
    ("mission.items.0.frame", 99, "frame is 99"),
    ("mission.items.0.command", None, "command is null"),
    ("mission.items.0.type", "Thing", "SimpleItem"),
    ("mission.items.0.type", "ComplexItem", "saved with its items"),
    ("mission.items.0", [], "an object"),
    ("geoFence.circles", [{}], "circles"),
    ("geoFence.polygons.0.inclusion", "del", "no 'inclusion'"),
    ("geoFence.polygons.0.polygon", [[1, 2], [3, 4]], "at least 3"),
    ("geoFence.polygons.0.polygon.0", [1], "2 or 3 numbers"),
    ("rallyPoints.points.0", [1, "a", 3], "must be a number"),
]


@pytest.mark.parametrize(("path", "value", "message"), BROKEN)
def test_broken_plans_are_refused_with_place_and_value(path: str, value: Any, message: str) -> None:
    with pytest.raises(PlanFormatError, match=message) as caught:
        parse_plan(edit(path, value), source="lake.plan")
    assert str(caught.value).startswith("lake.plan: ")
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize("text", ["", "[1]", "null", "{", "[" * 100_000, '{"version": 1e999}'])
def test_no_plan_at_all(text: str) -> None:
    with pytest.raises(PlanFormatError):
        parse_plan(text)


def test_a_missing_file_is_refused(tmp_path: Path) -> None:
    with pytest.raises(PlanFormatError, match="cannot be read"):
        read_plan(tmp_path / "none.plan")
    (tmp_path / "bytes.plan").write_bytes(b"\xff\xfe\x00")
    with pytest.raises(PlanFormatError, match="UTF-8"):
        read_plan(tmp_path / "bytes.plan")


def test_surveys_are_expanded_and_jumps_follow() -> None:
    document = json.loads(plan_text(sample()))
    items = document["mission"]["items"]
    jump = {**items[1], "command": 177, "frame": 2, "params": [30, -1, 0, 0, 0, 0, 0]}
    survey = {
        "type": "ComplexItem",
        "complexItemType": "survey",
        "TransectStyleComplexItem": {"Items": [{**items[0], "doJumpId": 30}, items[1]]},
    }
    document["mission"]["items"] = [items[0], survey, {**jump, "doJumpId": 40}]
    mission = parse_plan(json.dumps(document))
    assert [i.command for i in mission.items] == [16, 16, 16, 178, 177]
    assert mission.items[4].param1 == 2.0


def test_real_plans_survive(shared_data: Path) -> None:
    files = sorted((shared_data / "plans").glob("*.plan"))
    assert len(files) == 6
    for path in files:
        mission = read_plan(path)
        text = plan_text(mission)
        assert same(parse_plan(text), mission), path.name
        assert plan_text(parse_plan(text)) == text
        document = json.loads(path.read_text())
        assert len(mission.items) in (0, len(document["mission"]["items"]) + 1)
        for item, row in zip(mission.items[1:], document["mission"]["items"], strict=True):
            if row["params"][4]:
                assert abs(item.x - row["params"][4] * 1e7) <= 0.5001, path.name
            assert item.command == row["command"]


@settings(max_examples=60, deadline=None)
@given(
    st.lists(
        st.tuples(
            st.integers(-900_000_000, 900_000_000),
            st.integers(-1_800_000_000, 1_800_000_000),
            st.sampled_from([0, 2, 3, 6, 10]),
            st.floats(allow_infinity=False, width=32),
        ),
        max_size=8,
    )
)
def test_any_items_survive(rows: list[tuple[int, int, int, float]]) -> None:
    items = sample().items[:1] + tuple(
        MissionItem(
            seq=seq, frame=frame, command=16, current=0, autocontinue=1, param1=p, param2=0.0,
            param3=-1.0, param4=math.nan, x=x, y=y, z=3.0,
        )
        for seq, (x, y, frame, p) in enumerate(rows, start=1)
    )  # fmt: skip
    if len(items) == 1:
        items = ()
    mission = Mission(robot=1, sortie=1, vehicle="rover", items=items, fence=(), rally=())
    back = parse_plan(plan_text(mission))
    assert [(i.x, i.y, i.frame) for i in back.items] == [(i.x, i.y, i.frame) for i in items]
    assert repr([i.param1 + 0.0 for i in back.items]) == repr([i.param1 + 0.0 for i in items])

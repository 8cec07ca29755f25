"""The comparison of what was sent with what is stored: rounding is forgiven, nothing else."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from mrmission.errors import UploadError
from mrmission.model import FencePolygon, Mission, MissionItem, RallyPoint
from mrmission.simulate import storage
from mrmission.vehicle.items import (
    MissionType,
    RawItem,
    fence_from_raw,
    fence_to_raw,
    mission_from_raw,
    mission_to_raw,
    rally_from_raw,
    rally_to_raw,
    to_raw,
)
from mrmission.vehicle.readback import compare_items, stored_frame, stored_sha256

NAN = math.nan


def waypoint(seq: int, **changes: float) -> MissionItem:
    fields = {
        "seq": seq, "frame": 6 if seq else 0, "command": 16, "current": int(seq == 0),
        "autocontinue": 1, "param1": 0.0, "param2": 0.0, "param3": 0.0, "param4": NAN,
        "x": 473_000_000 + 137 * seq, "y": -1_799_999_990 + seq, "z": 0.0,
    }  # fmt: skip
    return MissionItem(**{**fields, **changes})  # type: ignore[arg-type]


MISSION = (
    waypoint(0),
    waypoint(1),
    waypoint(2, command=178, param1=1.0, param2=1.7, param3=-1.0, param4=0.0, x=0, y=0),
    waypoint(3, param1=3.0, z=12.34),
    waypoint(4, command=17),
)
FENCE = (
    FencePolygon(inclusion=True, points_e7=np.array([[1, 2], [3, 4], [5, 6], [7, 8]])),
    FencePolygon(inclusion=False, points_e7=np.array([[11, 12], [13, 14], [15, 16]])),
    FencePolygon(inclusion=False, points_e7=np.array([[21, 22], [23, 24], [25, 26]])),
)
RALLY = (RallyPoint(lat_e7=5, lon_e7=-6), RallyPoint(lat_e7=7, lon_e7=8, altitude_m=30.0))
WHOLE = Mission(robot=1, sortie=1, vehicle="boat", items=MISSION, fence=FENCE, rally=RALLY)


def stored(items: tuple[RawItem, ...], kind: MissionType) -> list[RawItem]:
    """What an autopilot gives back, by the independent model of the simulated boats."""
    keep = (storage.mission_item, storage.fence_item, storage.rally_item)[kind]
    out = []
    for item in items:
        if kind is MissionType.MISSION and item.seq == 0:
            out.append(replace(item, x=1, y=2, z=500.0, frame=0, param4=0.0))
            continue
        f32 = [float(np.float32(v)) for v in (item.param1, item.param2, item.param3, item.param4)]
        kept = keep(
            storage.Item(item.command, item.frame, *f32, item.x, item.y, float(np.float32(item.z)))
        )
        out.append(
            replace(
                item, frame=kept.frame, param1=kept.param1, param2=kept.param2,
                param3=kept.param3, param4=kept.param4, x=kept.x, y=kept.y, z=kept.z, current=0,
            )
        )  # fmt: skip
    return out


@pytest.mark.parametrize("kind", list(MissionType))
def test_what_an_autopilot_rounds_is_forgiven(kind: MissionType) -> None:
    sent = to_raw(WHOLE)[kind]
    back = stored(sent, kind)
    assert compare_items(sent, back, kind) == []
    # Which item is current changes while a vehicle is under way.
    later = [replace(item, current=1) for item in back]
    assert stored_sha256(later, kind) == stored_sha256(back, kind)


@pytest.mark.parametrize(
    ("kind", "seq", "field", "value"),
    [
        (MissionType.MISSION, 1, "x", 473_000_138),
        (MissionType.MISSION, 1, "y", -1_799_999_990),
        (MissionType.MISSION, 3, "z", 12.30),
        (MissionType.MISSION, 3, "param1", 2.0),
        (MissionType.MISSION, 3, "param2", 1.0),
        (MissionType.MISSION, 3, "frame", 10),
        (MissionType.MISSION, 3, "command", 82),
        (MissionType.MISSION, 2, "param2", 1.6),
        (MissionType.MISSION, 4, "seq", 5),
        (MissionType.FENCE, 0, "x", 2),
        (MissionType.FENCE, 4, "command", 5001),
        (MissionType.FENCE, 4, "param1", 4.0),
        (MissionType.RALLY, 1, "y", 9),
        (MissionType.RALLY, 1, "z", 28.0),
    ],
)
def test_anything_else_is_named(kind: MissionType, seq: int, field: str, value: float) -> None:
    sent = to_raw(WHOLE)[kind]
    back = stored(sent, kind)
    back[seq] = replace(back[seq], **{field: value})
    wrong = compare_items(sent, back, kind)
    assert [(w.seq, w.field) for w in wrong] == [(seq, field)]
    assert str(wrong[0]).startswith(f"{kind.label} item {seq}: {field} sent ")
    # Order numbers are where an item is, not what it is.
    same = stored_sha256(stored(sent, kind), kind) == stored_sha256(back, kind)
    assert same == (field == "seq")


def test_home_is_the_vehicles_own_but_must_be_there() -> None:
    sent = mission_to_raw(MISSION)
    back = stored(sent, MissionType.MISSION)
    assert compare_items(sent, back, MissionType.MISSION) == []
    wrong = compare_items(sent, back[1:], MissionType.MISSION)
    assert wrong[0].field == "count"
    assert str(wrong[0]) == "mission: 5 items sent, 4 stored"


def test_no_work_is_stored_as_home_or_as_nothing() -> None:
    assert mission_to_raw(MISSION[:1]) == ()
    home = mission_to_raw(MISSION)[:1]
    assert compare_items((), home, MissionType.MISSION) == []
    assert compare_items((), (), MissionType.MISSION) == []
    assert compare_items((), home * 2, MissionType.MISSION) != []
    assert compare_items((), home, MissionType.FENCE) != []


@pytest.mark.parametrize(
    ("sent", "kept"), [(0, 0), (5, 0), (3, 3), (6, 3), (10, 10), (11, 10), (2, 2)]
)
def test_frames_fold(sent: int, kept: int) -> None:
    assert stored_frame(sent) == kept


def test_there_and_back() -> None:
    raw = to_raw(WHOLE)
    items = mission_from_raw(raw[MissionType.MISSION])
    assert [(i.command, i.x, i.y, i.z) for i in items] == [
        (i.command, i.x, i.y, i.z) for i in MISSION
    ]
    fence = fence_from_raw(raw[MissionType.FENCE])
    assert [p.inclusion for p in fence] == [True, False, False]
    assert all(np.array_equal(a.points_e7, b.points_e7) for a, b in zip(fence, FENCE, strict=True))
    assert rally_from_raw(raw[MissionType.RALLY]) == RALLY
    for items_of in raw.values():
        assert [i.current for i in items_of] == [1] + [0] * (len(items_of) - 1)
    assert fence_to_raw(()) == rally_to_raw(()) == ()


def test_a_broken_fence_is_refused() -> None:
    raw = fence_to_raw(FENCE)
    for broken in (raw[:-1], raw[1:], (replace(raw[0], command=16), *raw[1:])):
        with pytest.raises(UploadError, match="fence item"):
            fence_from_raw(broken)

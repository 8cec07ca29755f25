"""Who gets which tour, what fits, and the record that is kept."""

from __future__ import annotations

import itertools
import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pymavlink.dialects.v20.ardupilotmega as dialect
import pytest
from upload_missions import mission as upload_mission

from mrmission.cli.upload_plan import reported_estimates
from mrmission.errors import PlanFormatError, UploadError
from mrmission.model import FencePolygon, Mission, MissionItem, RallyPoint
from mrmission.options import VehicleLimits
from mrmission.vehicle.assign import assign, first_sorties
from mrmission.vehicle.capacity import (
    Caps,
    KnownLimits,
    Limit,
    capped,
    check_capacity,
    default_limits,
    smallest,
)
from mrmission.vehicle.items import MissionType, to_raw
from mrmission.vehicle.job import path_length_m
from mrmission.vehicle.links import items_supported, sd_limits
from mrmission.vehicle.mavsdk_link import heartbeat_ids
from mrmission.vehicle.record import FleetFile, RecordState, StoredRecord, read_record, record_of


def mission(robot: int, items: int = 4, sortie: int = 1) -> Mission:
    return Mission(
        robot=robot,
        sortie=sortie,
        vehicle="boat",
        items=tuple(
            MissionItem(
                seq=i, frame=3, command=16, current=int(i == 0), autocontinue=1, param1=0.0,
                param2=0.0, param3=0.0, param4=0.0, x=i * 1000, y=0, z=0.0,
            )
            for i in range(items)
        ),
        fence=(FencePolygon(inclusion=True, points_e7=np.array([[0, 0], [9, 0], [9, 9]])),),
        rally=(RallyPoint(lat_e7=1, lon_e7=2),),
    )  # fmt: skip


def test_assignment_does_not_depend_on_the_order_of_discovery() -> None:
    for ids in itertools.permutations([40, 7, 12]):
        assert assign([1, 2, 3], ids) == {1: 7, 2: 12, 3: 40}


def test_a_missing_vehicle_is_missed_under_its_own_number() -> None:
    assert assign([1, 2, 3, 4], [4, 1, 3]) == {1: 1, 3: 3, 4: 4}
    assert assign([1, 2, 3, 4], [5, 1, 3]) == {1: 1, 2: 3, 3: 5}
    assert assign([1, 2], [2, 1, 3]) == {1: 1, 2: 2}


def test_pairs_of_an_earlier_run_stay_together() -> None:
    earlier = assign([1, 2, 3, 4], [11, 12, 14])
    assert earlier == {1: 11, 2: 12, 3: 14}
    assert assign([1, 2, 3, 4], [11, 12, 13, 14], earlier) == {1: 11, 2: 12, 3: 14, 4: 13}
    assert assign([1, 2], [12, 13], {1: 11, 2: 12}) == {1: 13, 2: 12}
    assert assign([1], [12], {1: 11, 2: 12}) == {1: 12}


def test_first_sorties() -> None:
    given = [mission(2, sortie=2), mission(1), mission(2, sortie=1)]
    assert [(m.robot, m.sortie) for m in first_sorties(given)] == [(1, 1), (2, 1)]


def holding(items: int = 655, fence_bytes: int = 667, rally: int = 50) -> KnownLimits:
    return KnownLimits(
        mission_items=Limit(value=items, source="vehicle 4"),
        fence_bytes=Limit(value=fence_bytes, source="BRD_SD_FENCE of vehicle 4"),
        rally_points=Limit(value=rally, source="default"),
    )


def test_capacity() -> None:
    limits = holding(10)
    check_capacity([mission(1, 10)], limits)
    with pytest.raises(
        UploadError, match=r"robot 2: .* 12 items.* holds 10 \(vehicle 4\); .* --swath 33"
    ):
        check_capacity([mission(1, 11), mission(2, 12)], limits, lambda n: f"--swath {n + 23}")
    with pytest.raises(UploadError, match=r"26 bytes.*holds 25 \(BRD_SD_FENCE of vehicle 4\)"):
        check_capacity([mission(1)], holding(fence_bytes=25))
    with pytest.raises(UploadError, match="rally"):
        check_capacity([mission(1)], holding(rally=0))
    check_capacity([mission(1, 11), mission(2, 3)], {2: limits})
    big = replace(
        mission(1), fence=(FencePolygon(inclusion=True, points_e7=np.ones((256, 2), dtype=int)),)
    )
    with pytest.raises(UploadError, match="256 points"):
        check_capacity([big], holding(fence_bytes=65531))


def test_the_smallest_of_a_fleet_and_what_the_user_gave() -> None:
    least = smallest(
        [
            holding(),
            holding(fence_bytes=411),
            replace(holding(304), rally_points=Limit(value=9, source="vehicle 7")),
        ]
    )
    assert least.limits == VehicleLimits(
        mission_items=304, fence_bytes=411, fence_polygon_points=51, rally_points=9
    )
    assert str(least) == (
        "304 mission items (vehicle 4); 411 fence bytes (BRD_SD_FENCE of vehicle 4); "
        "9 rally points (vehicle 7)"
    )
    assert smallest([]) == default_limits()
    assert default_limits().limits == VehicleLimits()
    # Smaller than the vehicle says: the user's word; larger: the vehicle's; a guess: the user's.
    assert capped(least, Caps(mission_items=100)).mission_items == Limit(
        value=100, source="--max-items"
    )
    assert capped(least, Caps(mission_items=4000, fence_bytes=4000)) == least
    assert capped(default_limits(), Caps(mission_items=4000)).mission_items.value == 4000


def test_a_card_widens_the_limits() -> None:
    assert sd_limits(VehicleLimits(), mission_kib=0, fence_kib=0) == VehicleLimits()
    wide = sd_limits(VehicleLimits(), mission_kib=64, fence_kib=64)
    assert wide.mission_items == 4368
    assert wide.fence_polygon_points == 255
    assert wide.fence_bytes == 65536 - 5


def test_only_n_items() -> None:
    assert items_supported(["Only 655 items are supported"]) == 655
    assert items_supported(["Only a test", "EKF3 active", ""]) is None


def test_length_is_geodesic() -> None:
    # 1e-7 degrees of latitude at the equator are 11.0574 mm.
    assert path_length_m(mission(1, 4)) == pytest.approx(3000 * 0.0110574, rel=1e-4)
    assert path_length_m(mission(1, 1)) == 0.0


def test_heartbeats_are_found_in_a_stream() -> None:
    data = b""
    for system, component in ((7, 1), (8, 154), (9, 1)):
        link = dialect.MAVLink(None, srcSystem=system, srcComponent=component)
        data += dialect.MAVLink_attitude_message(1, 0, 0, 0, 0, 0, 0).pack(link)
        data += dialect.MAVLink_heartbeat_message(11, 3, 0, 0, 3, 3).pack(link)
    assert heartbeat_ids(data) == {7, 9}
    assert heartbeat_ids(b"noise" + data[:-1]) == {7}
    assert heartbeat_ids(b"") == frozenset()


def verified(robot: int, system_id: int | None = None, items: int = 4) -> StoredRecord:
    return record_of(robot, system_id or 10 + robot, "tcp", to_raw(mission(robot, items)))


def test_record_is_merged(tmp_path: Path) -> None:
    one, two, three = (verified(robot) for robot in (1, 2, 3))
    for record in (one, two):
        FleetFile(tmp_path).put(record)
    FleetFile(tmp_path).put(three)
    assert read_record(tmp_path) == (one, two, three)
    assert FleetFile(tmp_path).pairs == {1: 11, 2: 12, 3: 13}
    moved = verified(2, 11)
    FleetFile(tmp_path).put(moved)
    assert read_record(tmp_path) == (moved, three)
    assert one.mission_sha256 != verified(1, items=5).mission_sha256
    assert one.fence_sha256 == two.fence_sha256
    assert one.items(MissionType.FENCE) == 3
    assert [p.name for p in tmp_path.iterdir()] == ["fleet.json"]


def test_record_is_a_journal(tmp_path: Path) -> None:
    file = FleetFile(tmp_path)
    file.put(verified(1))
    assert not FleetFile(tmp_path).remains(11)
    file.begin(1, 11, "tcp")
    # As after a power cut: what the next run reads.
    assert FleetFile(tmp_path).remains(11)
    assert FleetFile(tmp_path).pairs == {1: 11}
    file.fail(1)
    assert not FleetFile(tmp_path).remains(11)
    (entry,) = read_record(tmp_path)
    assert (entry.state, entry.mission_sha256) == (RecordState.FAILED, "")


def test_heights_count_in_the_hash() -> None:
    low, high = to_raw(mission(1)), to_raw(mission(1))
    kind = MissionType.MISSION
    high[kind] = (high[kind][0], *(replace(item, z=30.0) for item in high[kind][1:]))
    assert record_of(1, 1, "", low).mission_sha256 != record_of(1, 1, "", high).mission_sha256
    # Home is the vehicle's own, and moves with it.
    moved = {**low, kind: (replace(low[kind][0], x=77), *low[kind][1:])}
    assert record_of(1, 1, "", low) == record_of(1, 1, "", moved)


@pytest.mark.parametrize("text", ["", "[]", '{"version": 1}', '{"version": 2, "vehicles": [{}]}'])
def test_a_bad_record_is_named(tmp_path: Path, text: str) -> None:
    (tmp_path / "fleet.json").write_text(text)
    with pytest.raises(PlanFormatError, match=r"fleet\.json"):
        read_record(tmp_path)


def test_times_of_a_folder_are_its_report_s_where_the_mission_is_the_report_s(
    tmp_path: Path,
) -> None:
    whole = upload_mission(1)
    other = upload_mission(2)
    assert reported_estimates(tmp_path, [whole]) == {}
    rows = [
        {"robot": m.robot, "length_m": path_length_m(m), "duration_s": 100.0 * m.robot}
        for m in (whole, other)
    ]
    (tmp_path / "report.json").write_text(json.dumps({"robots": rows}), encoding="utf-8")
    shorter = replace(other, items=other.items[:5])
    told = reported_estimates(tmp_path, [whole, shorter])
    assert told == {1: (path_length_m(whole), 100.0)}
    (tmp_path / "report.json").write_text("[]", encoding="utf-8")
    assert reported_estimates(tmp_path, [whole]) == {}

"""Who gets which tour, what fits, and the record that is kept."""

from __future__ import annotations

import itertools
from dataclasses import replace
from pathlib import Path

import numpy as np
import pymavlink.dialects.v20.ardupilotmega as dialect
import pytest

from mrmission.errors import PlanFormatError, UploadError
from mrmission.model import FencePolygon, Mission, MissionItem, RallyPoint
from mrmission.options import VehicleLimits
from mrmission.vehicle.link import heartbeat_ids, sd_limits
from mrmission.vehicle.record import read_record, record_of, write_record
from mrmission.vehicle.upload import (
    assign,
    check_capacity,
    first_sorties,
    items_supported,
    path_length_m,
)


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


def test_capacity() -> None:
    limits = VehicleLimits(mission_items=10)
    check_capacity([mission(1, 10)], limits)
    with pytest.raises(UploadError, match=r"robot 2: .* 12 items.* holds 10; .* --swath 33"):
        check_capacity([mission(1, 11), mission(2, 12)], limits, lambda n: f"--swath {n + 23}")
    with pytest.raises(UploadError, match="26 bytes"):
        check_capacity([mission(1)], VehicleLimits(fence_bytes=25))
    with pytest.raises(UploadError, match="3 points"):
        check_capacity([mission(1)], VehicleLimits(fence_polygon_points=2))
    with pytest.raises(UploadError, match="rally"):
        check_capacity([mission(1)], VehicleLimits(rally_points=0))
    check_capacity([mission(1, 11), mission(2, 3)], {2: limits})


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


def test_record_is_merged_and_forgets(tmp_path: Path) -> None:
    one, two, three = (record_of(mission(r), system_id=10 + r, link="tcp") for r in (1, 2, 3))
    write_record(tmp_path, [one, two])
    write_record(tmp_path, [three], forget=[2])
    assert read_record(tmp_path) == (one, three)
    moved = replace(one, robot=2)
    write_record(tmp_path, [moved])
    assert read_record(tmp_path) == (moved, three)
    assert one.mission_sha256 != record_of(mission(1, 5), system_id=11, link="").mission_sha256
    assert one.fence_sha256 == two.fence_sha256
    assert [p.name for p in tmp_path.iterdir()] == ["fleet.json"]


@pytest.mark.parametrize("text", ["", "[]", '{"version": 2}', '{"version": 1, "vehicles": [{}]}'])
def test_a_bad_record_is_named(tmp_path: Path, text: str) -> None:
    (tmp_path / "fleet.json").write_text(text)
    with pytest.raises(PlanFormatError, match=r"fleet\.json"):
        read_record(tmp_path)

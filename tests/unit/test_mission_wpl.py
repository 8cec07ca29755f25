from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from pymavlink import mavwp

from mrmission.errors import PlanFormatError
from mrmission.mission.items import build_items
from mrmission.mission.wpl import (
    parse_waypoints,
    read_waypoints,
    waypoints_text,
    write_waypoints,
)
from mrmission.model import Mission
from mrmission.options import PlanOptions


def sample(vehicle: str = "boat") -> Mission:
    path = np.array(
        [[-81.3, 34.06], [-81.2999999, 34.0700001], [-0.0000003, -34.08], [-81.3, 34.06]]
    )
    items, kind, lane = build_items(
        path, np.array([0, 1, 0]), np.array([0, 1, 0]),
        PlanOptions(vehicle=vehicle, transit_speed_m_s=1 / 3),
    )  # fmt: skip
    return Mission(
        robot=1, sortie=1, vehicle=vehicle, items=items, kind=kind, lane=lane, fence=(), rally=()
    )


@pytest.mark.parametrize("vehicle", ["boat", "copter"])
def test_written_waypoints_read_back_the_same(vehicle: str, tmp_path: Path) -> None:
    mission = sample(vehicle)
    write_waypoints(mission, tmp_path / "a.waypoints")
    assert read_waypoints(tmp_path / "a.waypoints").items == mission.items
    lines = (tmp_path / "a.waypoints").read_text().splitlines()
    assert lines[0] == "QGC WPL 110"
    assert lines[1] == (
        "0\t1\t0\t16\t0.000000\t0.000000\t0.000000\t0.000000\t34.0600000\t-81.3000000\t0.000000\t1"
    )
    assert {len(line.split("\t")) for line in lines[1:]} == {12}


def loaded(path: Path) -> list[tuple[float, ...]]:
    loader = mavwp.MAVWPLoader()
    loader.load(str(path))
    return [
        (w.seq, w.current, w.frame, w.command, w.autocontinue, w.param1, w.param2, w.param3,
         w.param4, w.x, w.y, w.z)
        for w in map(loader.wp, range(loader.count()))
    ]  # fmt: skip


def ours(mission: Mission) -> list[tuple[float, ...]]:
    return [
        (i.seq, i.current, i.frame, i.command, i.autocontinue, i.param1, i.param2, i.param3,
         i.param4, i.x / 1e7, i.y / 1e7, i.z)
        for i in mission.items
    ]  # fmt: skip


@pytest.mark.parametrize("vehicle", ["boat", "rover", "copter"])
def test_pymavlink_reads_the_same_items(vehicle: str, tmp_path: Path) -> None:
    mission = sample(vehicle)
    write_waypoints(mission, tmp_path / "a.waypoints")
    assert loaded(tmp_path / "a.waypoints") == ours(mission)


def test_real_files_survive_and_pymavlink_agrees(shared_data: Path, tmp_path: Path) -> None:
    files = sorted(
        p for p in (shared_data / "plans").iterdir() if p.suffix in (".txt", ".waypoints")
    )
    refused = []
    for path in files:
        try:
            mission = read_waypoints(path)
        except PlanFormatError:
            refused.append(path.name.split("__")[-1])
            continue
        assert parse_waypoints(waypoints_text(mission)) == mission
        write_waypoints(mission, tmp_path / path.name)
        for mine, theirs in zip(loaded(tmp_path / path.name), loaded(path), strict=True):
            assert mine == pytest.approx(theirs, abs=6e-8), path.name
    # old formats without a header, and fence circles
    assert refused == [
        "rover-fence-ac-avoid.txt",
        "rover-path-planning-fence.txt",
        "rover-path-bendyruler-fence.txt",
        "rover-test-rally.txt",
    ]


def test_fence_and_rally_in_the_same_format() -> None:
    row = "{}\t0\t0\t{}\t{}\t0\t0\t0\t{}\t{}\t0\t1"
    rows = ["QGC WPL 110"]
    corners = [(1, 1), (1, 2), (2, 2)]
    rows += [row.format(i, 5001, 3, *c) for i, c in enumerate(corners)]
    rows += [row.format(i + 3, 5002, 3, *c) for i, c in enumerate(corners)]
    rows.append(row.format(6, 5100, 0, 1.5, 1.7))
    mission = parse_waypoints("\n".join(rows))
    assert [p.inclusion for p in mission.fence] == [True, False]
    assert mission.fence[0].points_e7.tolist() == [
        [10**7, 10**7],
        [10**7, 2 * 10**7],
        [2 * 10**7] * 2,
    ]
    assert mission.rally[0].lat_e7 == 15000000
    with pytest.raises(PlanFormatError, match="do not follow"):
        parse_waypoints("\n".join(rows[:3]))


GOOD = "0\t1\t0\t16\t0\t0\t0\t0\t50.0\t10.0\t0\t1"


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("", "line 1 is ''"),
        ("QGC WPL 120\n" + GOOD, "QGC WPL 110"),
        ("QGC WPL 110\n" + GOOD + "\t7", "13 columns"),
        ("QGC WPL 110\n" + GOOD.replace("50.0", "95"), "line 2, latitude is '95'"),
        ("QGC WPL 110\n" + GOOD.replace("10.0", "inf"), "finite"),
        ("QGC WPL 110\n" + GOOD.replace("16", "x"), "command is 'x': must be a whole number"),
        ("QGC WPL 110\n" + GOOD + "\n" + GOOD, "line 3, index is '0': must be 1"),
        ("QGC WPL 110\n" + GOOD.replace("0\t1\t0", "0\t2\t0"), "current is '2'"),
    ],
)
def test_broken_files_are_refused(text: str, message: str) -> None:
    with pytest.raises(PlanFormatError, match=message):
        parse_waypoints(text)

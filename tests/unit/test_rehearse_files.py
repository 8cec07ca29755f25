"""What a rehearsal leaves behind: JSON, CSV, GeoJSON, figure, table; tracks while they are made."""

from __future__ import annotations

import io
import json
import math
from dataclasses import replace

import numpy as np
import pytest
from lakes import area_of
from rich.console import Console
from shapely import box

from mrmission.area.frame import LocalFrame
from mrmission.cli.rehearse import parse_duration
from mrmission.errors import ConfigError, SimulatorError
from mrmission.model import Mission, MissionItem
from mrmission.options import PlanOptions
from mrmission.pipeline import plan as plan_fleet
from mrmission.rehearse.figure import save_tracks
from mrmission.rehearse.files import (
    check_folder,
    rehearse_text,
    tracks_csv,
    tracks_geojson,
    write_rehearsal,
)
from mrmission.rehearse.judge import Limits, PairDriven, estimate_error_m, judge
from mrmission.rehearse.measures import Meeting
from mrmission.rehearse.pilot import last_waypoint, longest_s
from mrmission.rehearse.run import Waters, home_of, sailing_missions
from mrmission.rehearse.table import RehearsalTable, fleet_lines
from mrmission.rehearse.track import Recorder, Track


def short_track(robot: int = 1, home: bool = True) -> Track:
    log = Recorder(robot, robot + 10)
    log.position(99.0, 8.5, 47.3, 12.0)
    log.started_s = 100.0
    for i in range(60):
        log.item = 1 + i // 30
        log.position(100.0 + i, 8.5003 + 1e-5 * i, 47.3003, math.nan if i == 3 else 90.0)
    log.reach(2)
    log.say(4, "a warning")
    if home:
        log.ended_s, log.end_text = 140.0, "home"
    else:
        log.end_text = "stands still on the way to item 2"
    return log.track()


@pytest.fixture(scope="module")
def plan():
    area = area_of(box(0, 0, 120, 90), lon_deg=8.5, lat_deg=47.3)
    return plan_fleet(area, PlanOptions(robots=1, swath_m=20.0))


def test_tracks_as_csv_and_geojson(plan) -> None:
    tracks = [short_track(1), short_track(2, home=False)]
    rows = tracks_csv(tracks).splitlines()
    assert rows[0] == "robot,time_s,longitude,latitude,heading_deg,item,sortie"
    assert len(rows) == 1 + 2 * 61
    assert rows[1] == "1,-1.000,8.5000000,47.3000000,12.00,0,1"
    assert rows[5] == "1,3.000,8.5003300,47.3003000,,1,1"
    lines = json.loads(tracks_geojson(tracks))["features"]
    phases = [(f["properties"]["robot"], f["properties"]["phase"]) for f in lines]
    assert phases == [(1, "under way"), (1, "end"), (2, "under way")]
    first = lines[0]
    assert first["properties"]["seconds"] == 40.0
    # a straight line needs its ends alone
    assert first["geometry"]["coordinates"] == [[8.5003, 47.3003], [8.5007, 47.3003]]


def test_the_recorder_keeps_time_rising_and_each_item_once() -> None:
    log = Recorder(1, 1)
    assert log.position_lonlat is None
    for time_s in (1.0, 2.0, 2.0, 1.5, 3.0):
        log.position(time_s, time_s, 0.0, 0.0)
    log.reach(4)
    log.reach(4)
    track = log.track()
    assert track.time_s.tolist() == [1.0, 2.0, 3.0]
    assert track.reached.tolist() == [[3.0, 4.0]]
    assert log.position_lonlat == (3.0, 0.0)
    assert not track.home
    assert not track.under_way().any()
    assert track.points_m(LocalFrame(lon_deg=0.0, lat_deg=0.0)).shape == (3, 2)
    with pytest.raises(ValueError, match="read-only"):
        track.time_s[0] = 5.0


def test_positions_join_a_frame_across_the_antimeridian() -> None:
    log = Recorder(1, 1)
    log.position(1.0, -179.9999, 10.0, 0.0)
    (east, north), = log.track().points_m(LocalFrame(lon_deg=180.0, lat_deg=10.0))  # fmt: skip
    assert 0 < east < 20
    assert abs(north) < 0.01


def test_report_and_files(plan, tmp_path) -> None:
    tracks = [short_track()]
    driven = judge(plan, tracks, limits=Limits(), waters=Waters(current_m_s=0.3).as_dict())
    text = rehearse_text(driven)
    assert text == rehearse_text(judge(plan, tracks, limits=Limits(), waters=driven.waters))
    content = json.loads(text)
    assert content["robots"][0]["warnings"] == ["59 s: a warning"]
    assert content["waters"]["current_m_s"] == 0.3
    assert content["robots"][0]["watched_s"] == 19.0
    assert content["robots"][0]["estimate_m"] is None
    assert content["nearest"] is None
    written = write_rehearsal(driven, tracks, tmp_path / "out", overwrite=False)
    assert {p.name for p in written} == {"rehearse.json", "tracks.geojson", "tracks.csv"}
    with pytest.raises(ConfigError, match="holds a rehearsal already"):
        check_folder(tmp_path / "out", overwrite=False)
    check_folder(tmp_path / "out", overwrite=True)
    with pytest.raises(ConfigError, match="is a file"):
        check_folder(tmp_path / "out" / "tracks.csv", overwrite=True)


def test_figure_and_table(plan, tmp_path) -> None:
    pytest.importorskip("matplotlib")
    tracks = [short_track()]
    driven = judge(plan, tracks, limits=Limits())
    first = save_tracks(plan, tracks, driven, tmp_path / "a.svg").read_bytes()
    assert first == save_tracks(plan, tracks, driven, tmp_path / "b.svg").read_bytes()
    assert b"driven" in first
    assert b"at end" in first
    out = io.StringIO()
    Console(file=out, width=110).print(RehearsalTable(driven))
    shown = out.getvalue()
    for word in ("robot", "planned", "swept", "Distance from the lanes", "Fence events", "drift"):
        assert word in shown
    lost = judge(plan, [short_track(home=False)], limits=Limits())
    out = io.StringIO()
    Console(file=out, width=160).print(RehearsalTable(lost))
    assert "no: stands still" in out.getvalue()
    assert any("robot 1 is not home: stands still" in line for line in lost.violations)


def test_pairs_stand_beside_what_the_plan_promised(plan) -> None:
    """The table tells of those that came nearer, and of none where the plan did not look."""
    tracks = [short_track(1)]
    alone = judge(plan, tracks, limits=Limits())
    assert alone.pairs == ()
    assert not any("plan allows for" in name for name, _ in fleet_lines(alone))

    def driven(robots: tuple[int, int], distance_m: float, planned_m: float | None) -> PairDriven:
        met = Meeting(robots=robots, distance_m=distance_m, time_s=1.0, place_m=(0.0, 0.0))
        return PairDriven(robots=robots, planned_m=planned_m, driven=met)

    never = PairDriven(robots=(1, 4), planned_m=3.0, driven=None)
    kept = replace(alone, pairs=(driven((1, 2), 21.0, 20.0), driven((1, 3), 2.0, None), never))
    line = dict(fleet_lines(kept))["Pairs nearer than the plan allows for"]
    assert line == "none of 2"
    broken = replace(alone, pairs=(*kept.pairs, driven((2, 3), 12.3, 20.0)))
    line = dict(fleet_lines(broken))["Pairs nearer than the plan allows for"]
    assert line == "1 of 3, the worst robots 2 and 3: 12.3 m instead of 20.0 m"


def test_true_positions_are_compared_with_the_track_not_with_a_position() -> None:
    frame = LocalFrame(lon_deg=8.5, lat_deg=47.3)
    log = Recorder(1, 1)
    log.started_s = 0.0
    for i in range(100):
        lon, lat = frame.to_lonlat(np.array([2.0 * i, 0.0]))
        log.position(float(i), lon, lat, 0.0)
        if i % 4 == 2:  # between two positions, 0.3 m to port
            log.truth(*frame.to_lonlat(np.array([2.0 * i + 0.7, 0.3])))
    track = log.track()
    assert estimate_error_m(track, track.points_m(frame), frame) == pytest.approx(0.3, abs=1e-3)


def item(seq: int, command: int, lat: float = 47.3, lon: float = 8.5, param2: float = 0.0):
    return MissionItem(
        seq=seq, frame=3, command=command, current=0, autocontinue=1, param1=0.0, param2=param2,
        param3=0.0, param4=0.0, x=round(lat * 1e7), y=round(lon * 1e7), z=0.0,
    )  # fmt: skip


def mission(*items: MissionItem, robot: int = 1, sortie: int = 1) -> Mission:
    return Mission(robot=robot, sortie=sortie, vehicle="boat", items=items, fence=(), rally=())


def test_last_waypoint_and_when_to_give_up() -> None:
    whole = mission(
        item(0, 16), item(1, 16), item(2, 178, param2=2.0), item(3, 16, lat=47.301),
        item(4, 16), item(5, 17),
    )  # fmt: skip
    assert last_waypoint(whole) == 4
    # 111 m out and back at 2 m/s is 111 s
    assert longest_s(whole) == pytest.approx(600 + 4 * 111.2, rel=0.01)
    with pytest.raises(SimulatorError, match="robot 3: its mission has no waypoint"):
        last_waypoint(mission(item(0, 16), item(1, 17), robot=3))


def test_only_robots_with_a_way_sail_and_only_their_first_sortie() -> None:
    way = (item(0, 16), item(1, 16), item(2, 16, lat=47.301))
    found = sailing_missions(
        [mission(*way, robot=2, sortie=2), mission(*way, robot=2), mission(robot=1)]
    )
    assert [(m.robot, m.sortie) for m in found] == [(2, 1)]
    assert home_of(found[0]) == (8.5, 47.3)


def test_waters_say_what_they_cannot_be() -> None:
    assert Waters(current_m_s=0.3, current_from_deg=400).at_start() == {
        "SIM_TIDE_DIR": 40.0,
        "SIM_TIDE_SPEED": 0.3,
    }
    assert Waters().at_start() == {}
    assert Waters(waves=True, parameters={"A": 1.0}).from_boot() == {
        "SIM_WAVE_ENABLE": 1.0,
        "A": 1.0,
    }
    assert Waters().across(300.0).current_from_deg == 30.0
    for wrong in ({"engine": "steam"}, {"speedup": 0.0}, {"current_m_s": -1.0}):
        with pytest.raises(ConfigError):
            Waters(**wrong)


def test_durations() -> None:
    assert parse_duration("90", "--watch-end") == 90
    assert parse_duration("10min", "--watch-end") == 600
    assert parse_duration("1.5 h", "--watch-end") == 5400
    with pytest.raises(ConfigError, match="--watch-end soon: must be a duration"):
        parse_duration("soon", "--watch-end")

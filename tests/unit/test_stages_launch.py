"""The launch of a fleet: routes turned round, missions that wait, what is said about it."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import shapely

from mrmission.area.frame import LocalFrame
from mrmission.errors import ConfigError, InfeasibleError
from mrmission.mission.check import navigation_path
from mrmission.model import (
    FleetPlan,
    MissionItem,
    PairDistance,
    RobotReport,
    SeparationConflict,
    SeparationReport,
    SurveyArea,
)
from mrmission.options import PlanOptions
from mrmission.pipeline import plan
from mrmission.report.map_data import map_data
from mrmission.report.metrics import report_text
from mrmission.report.units import fleet_figures
from mrmission.stages.launch import conflict_text, launch_notes, waiting
from mrmission.tour import separation
from mrmission.tour.flight import time_model
from mrmission.tour.separation import Separation, SeparationRules, Timeline, measure, timeline

WATER = shapely.Polygon([(11.2, 47.8), (11.205, 47.8), (11.205, 47.8025), (11.2, 47.8025)])
AREA = SurveyArea(name="pond", source="pond", water_lonlat=shapely.MultiPolygon([WATER]))


def options(**more: object) -> PlanOptions:
    wanted = {"robots": 3, "swath_m": 20.0, "clearance_m": 5.0, "method": "minmax", **more}
    return PlanOptions(**wanted, time_budget_s=0.05, fence=False, angle_deg=0.0)  # type: ignore[arg-type]


@pytest.fixture(scope="module")
def planned() -> FleetPlan:
    return plan(AREA, options(wait_in_mission=True))


def row(robot: int, delay_s: float, duration_s: float) -> RobotReport:
    return RobotReport(
        robot=robot, start_lonlat=(0.0, 0.0), length_m=1.0, survey_m=1.0, transit_m=0.0,
        duration_s=duration_s, items=5, lanes=2, fence_points=0, fence_land_m2=0.0,
        start_delay_s=delay_s,
    )  # fmt: skip


KEPT = SeparationReport(
    distance_m=20.0, time_share=0.05, max_delay_s=60.0,
    pairs=(PairDistance(robots=(1, 2), least_m=23.4),),
)  # fmt: skip


def test_the_makespan_counts_the_delays(planned: FleetPlan) -> None:
    rows = planned.report.robots
    assert planned.report.makespan_s == max(r.duration_s + r.start_delay_s for r in rows)
    assert min(r.start_delay_s for r in rows) == 0
    kept = planned.report.separation
    assert kept.distance_m == 20.0
    assert [p.robots for p in kept.pairs] == [(1, 2), (1, 3), (2, 3)]
    assert all(r.start_delay_s <= kept.max_delay_s for r in rows)
    assert len(kept.regions) == len(kept.crossings_m) == 3
    assert min(kept.regions) >= 1


def test_what_is_reported_is_what_the_final_paths_do(planned: FleetPlan) -> None:
    kept = planned.report.separation
    time = time_model(options())
    lines = [timeline(p, time) for p in planned.paths]
    delays = np.array([r.start_delay_s for r in planned.report.robots])
    found = measure(lines, delays, SeparationRules(max_delay_s=kept.max_delay_s))
    for pair in kept.pairs:
        a, b = pair.robots
        assert pair.least_m == pytest.approx(found.least_m[a - 1, b - 1], abs=1e-6)
    assert len(found.conflicts) == len(kept.conflicts)
    frame = LocalFrame.of(planned.area)
    for conflict, other in zip(kept.conflicts, found.conflicts, strict=True):
        assert conflict.robots == other.robots
        place = frame.to_metric(np.array([conflict.lonlat]))[0]
        assert np.allclose(place, other.place_m, atol=1e-3)
        assert 0 <= conflict.from_s <= conflict.to_s <= 1.1 * planned.report.makespan_s


def test_later_trips_begin_when_the_swap_is_done(monkeypatch: pytest.MonkeyPatch) -> None:
    """The times by which robots are kept apart are those that the report tells of each trip."""
    looked_at: list[Timeline] = []

    def seen(lines: list[Timeline], *rest: object) -> Separation:
        looked_at.extend(lines)
        return measure(lines, *rest)  # type: ignore[arg-type]

    monkeypatch.setattr(separation, "measure", seen)
    wanted = options(robots=2, endurance_s=420.0, swap_time_s=600.0)
    made = plan(AREA, wanted)
    assert [line.robot for line in looked_at] == [1, 2]
    for line, row in zip(looked_at, made.report.robots, strict=True):
        assert len(row.sorties) > 1
        home = (line.points_m == line.points_m[0]).all(axis=1)
        leaves_s = line.time_s[:-1][home[:-1] & ~home[1:]]
        assert leaves_s == pytest.approx([trip.start_s for trip in row.sorties])
        assert line.duration_s == pytest.approx(row.duration_s)


def test_missions_wait_at_home_as_long_as_was_said(planned: FleetPlan) -> None:
    for mission, told in zip(planned.missions, planned.report.robots, strict=True):
        assert mission.items[1].param1 == told.start_delay_s
        assert mission.items[1].x == mission.items[0].x
        assert all(item.param1 == 0 for item in mission.items[2:] if item.command == 16)
    again = plan(AREA, options())
    for mission, silent in zip(planned.missions, again.missions, strict=True):
        assert silent.items[1].param1 == 0
        assert (navigation_path(mission)[0] == navigation_path(silent)[0]).all()


def test_nothing_is_done_without_a_separation() -> None:
    found = plan(AREA, options(separation_m=0.0))
    assert found.report.separation == SeparationReport()
    assert {r.start_delay_s for r in found.report.robots} == {0.0}
    assert not any("m of each other" in note for note in found.report.notes)
    assert map_data(found)["conflicts"] == []


def test_conflicts_are_in_the_report_and_on_the_map(planned: FleetPlan) -> None:
    one = SeparationConflict(
        robots=(1, 3), least_m=4.2, lonlat=planned.report.robots[0].start_lonlat,
        from_s=100.0, to_s=200.0, chance=0.25, at_berths=True,
    )  # fmt: skip
    kept = replace(planned.report.separation, conflicts=(one,))
    marked = replace(planned, report=replace(planned.report, separation=kept))
    written = json.loads(report_text(marked))["separation"]["conflicts"]
    assert written[0]["robots"] == [1, 3]
    assert written[0]["chance"] == 0.25
    drawn = map_data(marked)["conflicts"]
    assert drawn[0]["robots"] == [1, 3]
    home = np.array(map_data(marked)["robots"][0]["home"])
    assert np.abs(np.array(drawn[0]["place"]) - home).max() <= 2  # cm
    assert "4.2 m" in drawn[0]["text"]
    assert any("20 m" in name for name, _ in fleet_figures(marked.report))


def test_the_notes_name_the_order_and_what_is_kept() -> None:
    rows = {1: row(1, 40.0, 100.0), 2: row(2, 0.0, 120.0)}
    first, second = launch_notes(rows, KEPT)
    assert (
        first == "launch robot 2 first, robot 1 after 40 s; the last one is home 20 s later for it"
    )
    assert "no two robots under way come nearer than 20 m" in second
    assert "23 m at the least" in second
    (first, _) = launch_notes(rows, KEPT, waits=True)
    assert first.startswith("start all missions at once: they wait at their berths, robot 2 not")
    (only,) = launch_notes({1: row(1, 0.0, 100.0)}, KEPT)
    assert only == second
    assert launch_notes(rows, SeparationReport()) == []
    later = {1: row(1, 5.0, 100.0), 2: row(2, 0.0, 120.0), 3: row(3, 0.0, 90.0)}
    assert launch_notes(later, KEPT)[0].endswith("home no later for it")


def test_the_notes_tell_the_gravest_conflicts() -> None:
    conflicts = tuple(
        SeparationConflict(
            robots=(1, 2), least_m=float(i), lonlat=(181.5, 3.25), from_s=90.0 + i,
            to_s=600.0 + i, chance=0.5, at_berths=i == 0,
        )
        for i in range(9)
    )  # fmt: skip
    near = replace(KEPT, pairs=(PairDistance(robots=(1, 2), least_m=0.0),), conflicts=conflicts)
    notes = launch_notes({1: row(1, 0.0, 100.0), 2: row(2, 0.0, 120.0)}, near)
    assert notes[0].startswith("1 of 1 pairs of robots can come nearer than 20 m")
    assert "at 9 places, 1 of them at the berths" in notes[0]
    assert len(notes) == 1 + 5 + 1 + 1
    assert notes[-2] == "… and 3 less likely places on the water"
    assert notes[-1].startswith("at the berths: robots 1 and 2 may come within 0 m")
    assert conflict_text(conflicts[3]) == (
        "robots 1 and 2 may come within 3 m of each other near -178.500000,3.250000 between 93 s "
        "and 10 min after the start (chance 50%)"
    )


def test_a_wait_that_no_vehicle_holds_is_refused(planned: FleetPlan) -> None:
    mission = planned.missions[0]
    assert waiting(mission, 0.0) is mission
    assert waiting(mission, 12.2).items[1].param1 == 13.0
    with pytest.raises(InfeasibleError, match="32767 s"):
        waiting(mission, 40_000.0)
    empty = replace(mission, items=())
    assert waiting(empty, 50.0) is empty
    assert isinstance(mission.items[1], MissionItem)


@pytest.mark.parametrize(
    ("values", "flag"),
    [
        ({"separation_m": -1.0}, "--separation"),
        ({"separation_m": float("nan")}, "--separation"),
        ({"time_uncertainty": 0.6}, "--time-uncertainty"),
        ({"max_delay_s": -1.0}, "--max-delay"),
        ({"wait_in_mission": True, "vehicle": "copter"}, "--wait-in-mission"),
    ],
)
def test_wrong_options_are_named(values: dict[str, object], flag: str) -> None:
    with pytest.raises(ConfigError, match=flag):
        PlanOptions(**values)


def test_the_flags_are_read_with_their_units(tmp_path: Path) -> None:
    from mrmission.cli.separation_options import read_separation_flags

    flags: dict[str, object] = {
        "separation_m": "35 m", "time_uncertainty": "8%", "max_delay_s": "5min"
    }  # fmt: skip
    read_separation_flags(flags)
    assert flags == {"separation_m": 35.0, "time_uncertainty": 0.08, "max_delay_s": 300.0}
    read_separation_flags(flags)  # what is read stays as it is
    assert flags["max_delay_s"] == 300.0
    with pytest.raises(ConfigError, match="--max-delay soon"):
        read_separation_flags({"max_delay_s": "soon"})

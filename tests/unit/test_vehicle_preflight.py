"""Preflight: every rule turns its own row and no other; the plan's numbers; the table; the docs."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from mrmission.cli.preflight import exit_code, preflight_json, preflight_table, read_report
from mrmission.errors import PlanFormatError
from mrmission.mission.wanted import WantedParameter
from mrmission.model import FencePolygon, Mission, MissionItem, RallyPoint
from mrmission.options import VehicleLimits
from mrmission.vehicle.preflight import CheckRow, VehicleCheck, judged
from mrmission.vehicle.preflight_checks import Severity
from mrmission.vehicle.preflight_facts import PlanFacts, PlanGeometry, VehicleState, plan_facts
from mrmission.vehicle.preflight_rules import (
    CONTEXT,
    RULES,
    parameter_names,
    rules_for,
    rules_table,
)

DOCS = Path(__file__).resolve().parents[2] / "docs"
WRONG, DOUBTFUL, FINE = Severity.WRONG, Severity.DOUBTFUL, Severity.FINE

PLAN = PlanFacts(
    robot=1,
    vehicle="boat",
    items=120,
    fence_polygons=3,
    fence_inclusions=1,
    fence_bytes=600,
    fence_largest=60,
    rally_points=1,
    length_m=4000.0,
    farthest_m=450.0,
    nearest_fence_m=2.5,
    start_lonlat=(11.2, 47.8),
    bad_return_share=0.25,
    bad_return_m=80.0,
    return_over="land",
    smart_rtl_points=220,
    speeds_m_s=(),
    swath_m=20.0,
    survey_speed_m_s=2.0,
    transit_speed_m_s=2.0,
    wanted=(),
)
STATE = VehicleState(
    system_id=7,
    armed=False,
    mode="HOLD",
    limits=VehicleLimits(),
    gps_fix=6,
    satellites=12,
    hdop=0.8,
    prearm_ok=True,
    ahrs_ok=True,
    start_distance_m=2.0,
    position_inside=True,
    home_distance_m=2.0,
    home_inside=True,
    stored={"mission": "", "fence": "", "rally": ""},
)
GOOD: dict[str, float | None] = {
    "ARMING_CHECK": 1, "AVOID_ENABLE": 0, "BATT_FS_CRT_ACT": 2, "BATT_FS_LOW_ACT": 4,
    "BATT_LOW_VOLT": 10.5, "BATT_CRT_VOLT": 10.0, "BATT_MONITOR": 4, "CRUISE_SPEED": 5.0,
    "FENCE_ACTION": 4, "FENCE_ENABLE": 1, "FENCE_OPTIONS": 0, "FENCE_RADIUS": 600.0,
    "FENCE_TYPE": 6, "FRAME_CLASS": 2, "FS_ACTION": 4, "FS_CRASH_CHECK": 0, "FS_EKF_ACTION": 1,
    "FS_GCS_ENABLE": 2, "FS_THR_ENABLE": 2, "INITIAL_MODE": 4, "MIS_DONE_BEHAVE": 1,
    "LOIT_TYPE": 1, "OA_TYPE": 0, "RALLY_LIMIT_KM": 0.5, "SPEED_MAX": 0.0,
    "SRTL_POINTS": 300, "SYSID_THISMAV": 7, "WP_RADIUS": 1.0, "WP_SPEED": 2.0,
}  # fmt: skip

PARAMETER_CASES = [
    ("ARMING_CHECK", 0, DOUBTFUL),
    ("ARMING_CHECK", 72, DOUBTFUL),
    ("AVOID_ENABLE", 3, WRONG),
    ("AVOID_ENABLE", 1, WRONG),
    ("BATT_FS_CRT_ACT", 1, WRONG),
    ("BATT_FS_LOW_ACT", 0, DOUBTFUL),
    ("BATT_FS_LOW_ACT", 3, WRONG),
    ("CRUISE_SPEED", 0, WRONG),
    ("FENCE_ACTION", 0, DOUBTFUL),
    ("FENCE_ACTION", 1, WRONG),
    ("FENCE_ACTION", 3, WRONG),
    ("FENCE_ACTION", 5, DOUBTFUL),
    ("FENCE_ENABLE", 0, WRONG),
    ("FENCE_RADIUS", 300, WRONG),
    ("FENCE_RADIUS", 455, DOUBTFUL),
    ("FENCE_TYPE", 2, WRONG),
    ("FRAME_CLASS", 1, WRONG),
    ("FS_ACTION", 1, WRONG),
    ("FS_CRASH_CHECK", 1, DOUBTFUL),
    ("FS_EKF_ACTION", 0, DOUBTFUL),
    ("FS_GCS_ENABLE", 1, WRONG),
    ("FS_THR_ENABLE", 1, WRONG),
    ("INITIAL_MODE", 0, DOUBTFUL),
    ("INITIAL_MODE", 10, WRONG),
    ("MIS_DONE_BEHAVE", 0, WRONG),
    ("MIS_DONE_BEHAVE", 3, WRONG),
    ("LOIT_TYPE", 0, DOUBTFUL),
    ("OA_TYPE", 1, DOUBTFUL),
    ("OA_TYPE", 2, WRONG),
    ("SPEED_MAX", 1.5, WRONG),
    ("SRTL_POINTS", 0, WRONG),
    ("SRTL_POINTS", 100, DOUBTFUL),
    ("SYSID_THISMAV", 1, DOUBTFUL),
    ("WP_RADIUS", 3, DOUBTFUL),
    ("WP_RADIUS", 6, WRONG),
    ("WP_RADIUS", 0.1, DOUBTFUL),
    ("WP_SPEED", 5, WRONG),
    ("WP_SPEED", 0, WRONG),
]

STATE_CASES: list[tuple[str, dict[str, Any], Severity]] = [
    ("armed", {"armed": True, "mode": "AUTO"}, DOUBTFUL),
    ("position fix", {"gps_fix": None}, WRONG),
    ("position fix", {"gps_fix": 2}, WRONG),
    ("position fix", {"satellites": 5}, DOUBTFUL),
    ("position fix", {"hdop": 2.5}, DOUBTFUL),
    ("arming checks", {"prearm_ok": False}, WRONG),
    ("arming checks", {"prearm_ok": None}, DOUBTFUL),
    ("EKF", {"ahrs_ok": False}, WRONG),
    ("EKF", {"ahrs_ok": None}, DOUBTFUL),
    ("position", {"start_distance_m": None}, DOUBTFUL),
    ("position", {"start_distance_m": 40.0}, DOUBTFUL),
    ("position", {"start_distance_m": 400.0}, WRONG),
    ("position", {"position_inside": False}, WRONG),
    ("home", {"home_distance_m": 70.0}, DOUBTFUL),
    ("home", {"home_distance_m": None}, DOUBTFUL),
    ("home", {"home_inside": False}, WRONG),
    ("stored mission", {"stored": {"mission": "x", "fence": "", "rally": ""}}, WRONG),
    ("stored fence", {"stored": {"mission": "", "fence": "x", "rally": ""}}, WRONG),
    ("stored rally points", {"stored": {"mission": "", "fence": "", "rally": "x"}}, WRONG),
    ("mission memory", {"limits": VehicleLimits(mission_items=100)}, WRONG),
    ("fence memory", {"limits": VehicleLimits(fence_bytes=500)}, WRONG),
    ("fence memory", {"limits": VehicleLimits(fence_polygon_points=50)}, WRONG),
]

PLAN_CASES: list[tuple[str, dict[str, Any], dict[str, float], Severity]] = [
    ("FENCE_OPTIONS", {"fence_inclusions": 2}, {}, WRONG),
    ("RALLY_LIMIT_KM", {"farthest_m": 550.0}, {}, FINE),
    ("WP_SPEED", {"speeds_m_s": (2.0,)}, {"WP_SPEED": 5}, DOUBTFUL),
    ("AVOID_ENABLE", {"nearest_fence_m": 6.0}, {"AVOID_ENABLE": 3}, DOUBTFUL),
    ("AVOID_ENABLE", {"nearest_fence_m": 30.0}, {"AVOID_ENABLE": 3}, FINE),
    ("OA_TYPE", {}, {"OA_TYPE": 2, "FENCE_ACTION": 2}, DOUBTFUL),
    ("OA_TYPE", {}, {"OA_TYPE": 2, "FENCE_ACTION": 2, "FS_ACTION": 1}, DOUBTFUL),
    ("FENCE_ACTION", {"bad_return_share": 0.0}, {"FENCE_ACTION": 1}, FINE),
    ("FS_THR_ENABLE", {"farthest_m": 90.0}, {"FS_THR_ENABLE": 1}, DOUBTFUL),
    ("SRTL_POINTS", {"smart_rtl_points": 700}, {}, DOUBTFUL),
    ("FRAME_CLASS", {"vehicle": "rover"}, {"MIS_DONE_BEHAVE": 0}, WRONG),
    ("MIS_DONE_BEHAVE", {"vehicle": "rover"}, {"FRAME_CLASS": 1}, DOUBTFUL),
]


def bad_rows(
    plan: PlanFacts = PLAN, state: VehicleState = STATE, **changed: float | None
) -> dict[str, Severity]:
    rows = judged(plan, state, {**GOOD, **changed})
    return {row.subject: row.severity for row in rows if row.severity is not FINE}


def test_a_vehicle_that_is_right_has_no_bad_row() -> None:
    assert bad_rows() == {}
    rows = judged(PLAN, STATE, GOOD)
    assert len(rows) == len(rules_for("boat"))
    assert all(row.wanted and row.reason and row.found for row in rows)


@pytest.mark.parametrize(("name", "value", "severity"), PARAMETER_CASES)
def test_one_parameter_turns_its_own_row_alone(name: str, value: float, severity: Severity) -> None:
    assert bad_rows(**{name: value}) == {name: severity}


@pytest.mark.parametrize(("subject", "changed", "severity"), STATE_CASES)
def test_one_thing_of_the_state_turns_its_own_row_alone(
    subject: str, changed: dict[str, Any], severity: Severity
) -> None:
    assert bad_rows(state=replace(STATE, **changed)) == {subject: severity}


@pytest.mark.parametrize(("subject", "plan", "changed", "severity"), PLAN_CASES)
def test_the_same_value_is_judged_by_the_plan(
    subject: str, plan: dict[str, Any], changed: dict[str, float], severity: Severity
) -> None:
    found = bad_rows(replace(PLAN, **plan), STATE, **changed)
    assert found == ({} if severity is FINE else {subject: severity})


def test_every_rule_is_turned_by_a_case() -> None:
    turned = {case[0] for case in PARAMETER_CASES} | {case[0] for case in STATE_CASES}
    turned |= {case[0] for case in PLAN_CASES}
    on_boats = {rule.subject for rule in RULES if "boat" in rule.vehicles}
    assert on_boats == turned


def test_a_rally_limit_matters_where_home_lies_elsewhere() -> None:
    away = replace(STATE, home_distance_m=30.0)
    assert bad_rows(replace(PLAN, farthest_m=550.0), away) == {"RALLY_LIMIT_KM": DOUBTFUL}


def test_smart_rtl_is_wrong_where_it_falls_back_on_a_straight_return() -> None:
    found = bad_rows(SRTL_POINTS=100, FENCE_ACTION=3)
    assert found["SRTL_POINTS"] is WRONG
    nobody = {"FENCE_ACTION": 2.0, "FS_ACTION": 2.0, "BATT_FS_LOW_ACT": 2.0}
    assert bad_rows(SRTL_POINTS=0, **nobody) == {}


def test_actions_that_nothing_calls_are_no_matter() -> None:
    assert bad_rows(FS_ACTION=1, FS_THR_ENABLE=0, FS_GCS_ENABLE=0) == {}
    assert bad_rows(BATT_FS_LOW_ACT=1, BATT_FS_CRT_ACT=1, BATT_MONITOR=0) == {}
    assert bad_rows(FS_THR_ENABLE=1, FS_GCS_ENABLE=1, FS_ACTION=0) == {}
    assert bad_rows(FENCE_RADIUS=300, FENCE_TYPE=4) == {}
    assert bad_rows(BATT_LOW_VOLT=0) == {"BATT_FS_LOW_ACT": DOUBTFUL}


def test_the_reason_names_the_share_of_the_way() -> None:
    rows = {row.subject: row for row in judged(PLAN, STATE, {**GOOD, "FENCE_ACTION": 1})}
    row = rows["FENCE_ACTION"]
    assert row.reason == "a straight return crosses land from 25% of the way (up to 80 m)"
    assert row.found == "1"
    assert "4" in row.wanted


def test_the_vehicles_own_reason_not_to_arm_is_told() -> None:
    state = replace(STATE, prearm_ok=False, texts=("EKF3 active", "PreArm: Compass not healthy"))
    rows = {row.subject: row for row in judged(PLAN, state, GOOD)}
    assert "PreArm: Compass not healthy" in rows["arming checks"].reason


# --- names ---------------------------------------------------------------------------------------


def test_other_spellings_are_asked_for_and_said() -> None:
    values = {**GOOD, "SYSID_THISMAV": None, "MAV_SYSID": 7.0}
    rows = {row.subject for row in judged(PLAN, STATE, values)}
    assert "MAV_SYSID" in rows
    assert "SYSID_THISMAV" not in rows
    names = parameter_names("boat")
    assert {"MAV_SYSID", "SYSID_THISMAV", "ARMING_SKIPCHK", *CONTEXT} <= set(names)
    assert len(set(names)) == len(names)
    skipped = {**GOOD, "ARMING_CHECK": None, "ARMING_SKIPCHK": 8.0}
    turned = {r.subject: r.severity for r in judged(PLAN, STATE, skipped) if r.severity is not FINE}
    assert turned == {"ARMING_SKIPCHK": DOUBTFUL}


def test_a_parameter_that_the_vehicle_lacks_is_said() -> None:
    assert bad_rows(WP_RADIUS=None) == {"WP_RADIUS": DOUBTFUL}
    assert bad_rows(FRAME_CLASS=None) == {"FRAME_CLASS": WRONG}
    assert bad_rows(FENCE_OPTIONS=None) == {}
    rows = {row.subject: row for row in judged(PLAN, STATE, {**GOOD, "WP_RADIUS": None})}
    assert rows["WP_RADIUS"].found == "not known to the vehicle"
    assert "no parameter WP_RADIUS" in rows["WP_RADIUS"].reason


def test_a_mission_brings_wishes_of_its_own() -> None:
    wish = WantedParameter(name="RTL_ALT", value=3000, low=3000, high=5000, reason="climbs first")
    plan = replace(PLAN, vehicle="copter", wanted=(wish,), survey_speed_m_s=5.0)
    values: dict[str, float | None] = {**GOOD, "WPNAV_SPEED": 500.0, "RTL_ALT": 3500.0}
    assert {r.subject for r in judged(plan, STATE, values) if r.severity is not FINE} == set()
    values["RTL_ALT"] = 1500.0
    turned = {r.subject: r.severity for r in judged(plan, STATE, values) if r.severity is not FINE}
    assert turned == {"RTL_ALT": WRONG}
    assert {"FRAME_CLASS", "MIS_DONE_BEHAVE"}.isdisjoint(parameter_names("copter"))


# --- the plan's numbers --------------------------------------------------------------------------


def item(seq: int, lat: float, lon: float, command: int = 16, param2: float = 0.0) -> MissionItem:
    return MissionItem(
        seq=seq, frame=3, command=command, current=0, autocontinue=1, param1=0.0, param2=param2,
        param3=0.0, param4=0.0, x=round(lat * 1e7), y=round(lon * 1e7), z=0.0,
    )  # fmt: skip


def ring(*corners: tuple[float, float]) -> np.ndarray:
    return np.array([[round(lat * 1e7), round(lon * 1e7)] for lat, lon in corners], dtype=np.int64)


def island_mission(lon0: float = 11.2) -> Mission:
    """About 1,110 m along the north shore of a box with an island in its middle."""
    a, b = lon0, lon0 + 0.01
    box = ring((0.0, a), (0.0, b), (0.01, b), (0.01, a))
    island = ring((0.004, a + 0.004), (0.004, a + 0.006), (0.006, a + 0.006), (0.006, a + 0.004))
    return Mission(
        robot=2,
        sortie=1,
        vehicle="boat",
        items=(
            item(0, 0.005, a + 0.001),
            item(1, 0.0, 0.0, 178, 1.5),
            item(2, 0.009, a + 0.001),
            item(3, 0.009, a + 0.009),
            item(4, 0.001, a + 0.009),
        ),
        fence=(
            FencePolygon(inclusion=True, points_e7=box),
            FencePolygon(inclusion=False, points_e7=island),
        ),
        rally=(RallyPoint(lat_e7=50_000, lon_e7=round((a + 0.001) * 1e7)),),
    )


@pytest.mark.parametrize("lon0", [11.2, 179.995])
def test_the_plans_numbers(lon0: float) -> None:
    mission = island_mission(lon0)
    geometry = PlanGeometry(mission)
    facts = plan_facts(mission, geometry, None)
    degree = 110_574.0
    assert facts.length_m == pytest.approx(0.004 * degree + 0.008 * 111_320 + 0.008 * degree, 1e-3)
    assert facts.nearest_fence_m == pytest.approx(0.001 * degree, rel=0.01)
    assert facts.farthest_m == pytest.approx(np.hypot(0.008 * 111_320, 0.004 * degree), rel=1e-3)
    # ways home from the east shore cross the island between the corners' shadows
    assert 0.15 < facts.bad_return_share < 0.35
    assert facts.return_over == "the fence"
    assert (facts.fence_polygons, facts.fence_inclusions, facts.fence_bytes) == (2, 1, 68)
    assert facts.speeds_m_s == (1.5,)
    assert facts.swath_m is None
    # three corners, 12 pieces of 100 m
    assert 10 < facts.smart_rtl_points < 30


def test_the_report_knows_the_shore_better_than_the_fence() -> None:
    mission = island_mission()
    row = {"robot": 2, "share_over_land": 0.5, "longest_over_land_m": 333.0}
    report = {
        "options": {"swath_m": 20, "survey_speed_m_s": 1.5, "transit_speed_m_s": 2.0},
        "failsafe": {"straight_returns": [row]},
    }
    facts = plan_facts(mission, PlanGeometry(mission), report)
    assert (facts.bad_return_share, facts.bad_return_m, facts.return_over) == (0.5, 333.0, "land")
    assert (facts.swath_m, facts.survey_speed_m_s) == (20.0, 1.5)


def test_inside_and_distance() -> None:
    geometry = PlanGeometry(island_mission())
    assert geometry.inside((11.201, 0.005))
    assert not geometry.inside((11.205, 0.005))
    assert not geometry.inside((11.3, 0.005))
    assert geometry.home_distance_m((11.201, 0.006)) == pytest.approx(110.6, abs=0.1)
    empty = replace(island_mission(), items=(), fence=())
    assert PlanGeometry(empty).inside((0.0, 0.0)) is None
    assert plan_facts(empty, PlanGeometry(empty), None).items == 0


# --- output --------------------------------------------------------------------------------------


def check(*severities: Severity, robot: int = 1) -> VehicleCheck:
    rows = tuple(
        CheckRow(subject=f"P{n}", found="1", wanted="2", severity=s, reason="because")
        for n, s in enumerate(severities)
    )
    return VehicleCheck(robot=robot, system_id=robot, link="tcpout://h:1", rows=rows)


def test_only_what_is_wrong_makes_exit_1() -> None:
    assert exit_code([check(FINE), check(DOUBTFUL, FINE)]) == 0
    assert exit_code([check(FINE), check(DOUBTFUL, WRONG)]) == 1
    document = json.loads(preflight_json([check(FINE, WRONG)]))
    assert document["ready"] is False
    assert document["robots"][0]["severity"] == "wrong"
    assert document["robots"][0]["rows"][1] == {
        "subject": "P1", "found": "1", "wanted": "2", "severity": "wrong", "reason": "because",
    }  # fmt: skip


def test_the_table_shows_what_is_not_fine() -> None:
    checks = [check(FINE, WRONG, DOUBTFUL), check(FINE, FINE, robot=2)]
    assert preflight_table(checks).row_count == 3
    assert preflight_table(checks, everything=True).row_count == 5


def test_a_report_that_is_none_is_refused(tmp_path: Path) -> None:
    assert read_report(tmp_path) is None
    (tmp_path / "report.json").write_text("[1]")
    with pytest.raises(PlanFormatError, match=r"report\.json"):
        read_report(tmp_path)


def test_the_rules_in_the_docs_are_these() -> None:
    page = (DOCS / "preflight.md").read_text(encoding="utf-8")
    assert rules_table() in page, 'paste `python -c "...preflight_rules import rules_table..."`'

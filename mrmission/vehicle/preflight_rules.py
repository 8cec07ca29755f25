"""The rules of a preflight as data: which parameter or state, what is wanted, and why."""

from __future__ import annotations

from dataclasses import dataclass

from mrmission.vehicle.preflight_checks import (
    Judge,
    Severity,
    judge_ahrs,
    judge_arming,
    judge_avoid,
    judge_battery,
    judge_crash,
    judge_cruise,
    judge_done,
    judge_ekf,
    judge_fence_action,
    judge_fence_enable,
    judge_fence_options,
    judge_fence_radius,
    judge_fence_room,
    judge_fence_type,
    judge_fix,
    judge_frame,
    judge_fs_action,
    judge_ground_station,
    judge_home,
    judge_initial_mode,
    judge_link_state,
    judge_loiter,
    judge_path_planning,
    judge_position,
    judge_prearm,
    judge_radio,
    judge_radius,
    judge_rally_limit,
    judge_room,
    judge_smart_points,
    judge_speed,
    judge_store,
    judge_system_id,
    judge_top_speed,
)

ON_GROUND = ("boat", "rover")
ALL = ("boat", "rover", "copter")


@dataclass(frozen=True, slots=True, kw_only=True)
class Rule:
    """One row of the table.

    ``names`` are the spellings of the parameter, the present one first; none for a rule about
    state. ``absent`` is the verdict on a vehicle that has it under no name.
    """

    subject: str
    wanted: str
    why: str
    judge: Judge
    names: tuple[str, ...] = ()
    vehicles: tuple[str, ...] = ALL
    absent: Severity = Severity.DOUBTFUL


RULES: tuple[Rule, ...] = (
    # the vehicle's state
    Rule(
        subject="armed",
        wanted="disarmed",
        why="an armed vehicle takes no new plan, and may be sailing",
        judge=judge_link_state,
    ),
    Rule(
        subject="position fix",
        wanted="3D, 6 satellites, HDOP 2.0",
        why="no mission without a position; a poor one sails poor lanes",
        judge=judge_fix,
    ),
    Rule(
        subject="arming checks",
        wanted="passed",
        why="otherwise it refuses to arm",
        judge=judge_prearm,
    ),
    Rule(
        subject="EKF",
        wanted="healthy",
        why="its estimate of attitude and position steers it",
        judge=judge_ahrs,
    ),
    Rule(
        subject="position",
        wanted="inside the fence, within 15 m of the plan's start",
        why="arming outside the fence is refused; the way to the first waypoint is straight",
        judge=judge_position,
    ),
    Rule(
        subject="home",
        wanted="inside the fence, within 50 m of the plan's start",
        why="a return goes there; it is set anew at arming",
        judge=judge_home,
    ),
    Rule(
        subject="stored mission",
        wanted="the plan's",
        why="it does what it stores",
        judge=judge_store("mission"),
    ),
    Rule(
        subject="stored fence",
        wanted="the plan's",
        why="another fence stops it at the wrong place",
        judge=judge_store("fence"),
    ),
    Rule(
        subject="stored rally points",
        wanted="the plan's",
        why="a return goes to the nearest rally point",
        judge=judge_store("rally"),
    ),
    Rule(
        subject="mission memory",
        wanted="all items",
        why="BRD_SD_MISSION on an SD card holds more",
        judge=judge_room,
    ),
    Rule(
        subject="fence memory",
        wanted="the whole fence",
        why="BRD_SD_FENCE on an SD card holds more",
        judge=judge_fence_room,
    ),
    # how it sails
    Rule(
        subject="FRAME_CLASS",
        names=("FRAME_CLASS",),
        vehicles=ON_GROUND,
        wanted="boat 2, rover 1",
        why="only a boat holds its place at the end and between commands",
        judge=judge_frame,
        absent=Severity.WRONG,
    ),
    Rule(
        subject="WP_RADIUS",
        names=("WP_RADIUS",),
        vehicles=ON_GROUND,
        wanted="up to a tenth of the swath",
        why="it turns that far before the corner",
        judge=judge_radius,
    ),
    Rule(
        subject="WP_SPEED",
        names=("WP_SPEED",),
        vehicles=ON_GROUND,
        wanted="the survey speed",
        why="in force until the mission sets a speed",
        judge=judge_speed,
    ),
    Rule(
        subject="WPNAV_SPEED",
        names=("WP_SPD", "WPNAV_SPEED"),
        vehicles=("copter",),
        wanted="the survey speed",
        why="in force until the mission sets a speed",
        judge=judge_speed,
    ),
    Rule(
        subject="SPEED_MAX",
        names=("SPEED_MAX",),
        vehicles=ON_GROUND,
        wanted="0, or the planned speeds and more",
        why="it limits every other speed",
        judge=judge_top_speed,
        absent=Severity.FINE,
    ),
    Rule(
        subject="CRUISE_SPEED",
        names=("CRUISE_SPEED",),
        vehicles=ON_GROUND,
        wanted="the speed at CRUISE_THROTTLE",
        why="throttle is reckoned from it",
        judge=judge_cruise,
    ),
    Rule(
        subject="MIS_DONE_BEHAVE",
        names=("MIS_DONE_BEHAVE",),
        vehicles=ON_GROUND,
        wanted="boat 1 (loiter), rover 0 (hold)",
        why="in hold a boat drifts with the current",
        judge=judge_done,
    ),
    Rule(
        subject="LOIT_TYPE",
        names=("LOIT_TYPE",),
        vehicles=("boat",),
        wanted="1 (bow first)",
        why="going astern, as with 0, a steered boat loses its place in a current",
        judge=judge_loiter,
        absent=Severity.FINE,
    ),
    # fence
    Rule(
        subject="FENCE_ENABLE",
        names=("FENCE_ENABLE",),
        wanted="1 where the plan has a fence",
        why="a stored fence that is off does nothing",
        judge=judge_fence_enable,
    ),
    Rule(
        subject="FENCE_TYPE",
        names=("FENCE_TYPE",),
        wanted="4 (polygons)",
        why="6 and 7 add a circle around home",
        judge=judge_fence_type,
    ),
    Rule(
        subject="FENCE_RADIUS",
        names=("FENCE_RADIUS",),
        wanted="beyond the farthest waypoint where FENCE_TYPE has a circle",
        why="300 m by default: the boat breaches it in the middle of its mission",
        judge=judge_fence_radius,
    ),
    Rule(
        subject="FENCE_ACTION",
        names=("FENCE_ACTION",),
        vehicles=ON_GROUND,
        wanted="4 where a straight return crosses land, else 1 or 4",
        why="1 and 3 return straight, over islands; 2 holds and drifts; 0 sails on",
        judge=judge_fence_action,
    ),
    Rule(
        subject="FENCE_OPTIONS",
        names=("FENCE_OPTIONS",),
        wanted="union where the plan has several inclusion polygons",
        why="without it the vehicle must be inside all of them",
        judge=judge_fence_options,
        absent=Severity.FINE,
    ),
    Rule(
        subject="AVOID_ENABLE",
        names=("AVOID_ENABLE",),
        wanted="0 where the way comes near a fence",
        why="near a fence it pushes the vehicle off its lane",
        judge=judge_avoid,
    ),
    Rule(
        subject="OA_TYPE",
        names=("OA_TYPE",),
        wanted="0",
        why="2 takes returns round islands, but outside the fence it finds no path and drifts",
        judge=judge_path_planning,
        absent=Severity.FINE,
    ),
    Rule(
        subject="RALLY_LIMIT_KM",
        names=("RALLY_LIMIT_KM",),
        wanted="0, or beyond the farthest waypoint",
        why="beyond it a return goes to home",
        judge=judge_rally_limit,
        absent=Severity.FINE,
    ),
    Rule(
        subject="SRTL_POINTS",
        names=("SRTL_POINTS",),
        vehicles=ON_GROUND,
        wanted="enough for the mission where an action uses SmartRTL",
        why="when its points are used up SmartRTL switches itself off",
        judge=judge_smart_points,
    ),
    # failsafes
    Rule(
        subject="FS_THR_ENABLE",
        names=("FS_THR_ENABLE",),
        vehicles=ON_GROUND,
        wanted="2 (continue in AUTO), or 0",
        why="1, the default, stops a boat that leaves the transmitter's range",
        judge=judge_radio,
    ),
    Rule(
        subject="FS_GCS_ENABLE",
        names=("FS_GCS_ENABLE",),
        vehicles=ON_GROUND,
        wanted="2 (continue in AUTO), or 0",
        why="1 stops a boat that is out of the ground station's range",
        judge=judge_ground_station,
    ),
    Rule(
        subject="FS_ACTION",
        names=("FS_ACTION",),
        vehicles=ON_GROUND,
        wanted="as FENCE_ACTION",
        why="what a lost transmitter or ground station does",
        judge=judge_fs_action,
    ),
    Rule(
        subject="BATT_FS_LOW_ACT",
        names=("BATT_FS_LOW_ACT",),
        vehicles=ON_GROUND,
        wanted="as FENCE_ACTION, with a limit",
        why="what a low battery does",
        judge=judge_battery,
        absent=Severity.FINE,
    ),
    Rule(
        subject="BATT_FS_CRT_ACT",
        names=("BATT_FS_CRT_ACT",),
        vehicles=ON_GROUND,
        wanted="as FENCE_ACTION, with a limit",
        why="what an empty battery does",
        judge=judge_battery,
        absent=Severity.FINE,
    ),
    Rule(
        subject="FS_CRASH_CHECK",
        names=("FS_CRASH_CHECK",),
        vehicles=ON_GROUND,
        wanted="0",
        why="no headway with the motors on, against a current say, counts as a crash",
        judge=judge_crash,
    ),
    Rule(
        subject="FS_EKF_ACTION",
        names=("FS_EKF_ACTION",),
        vehicles=ON_GROUND,
        wanted="1 (hold)",
        why="without a position it must stop",
        judge=judge_ekf,
    ),
    # starting
    Rule(
        subject="INITIAL_MODE",
        names=("INITIAL_MODE",),
        vehicles=ON_GROUND,
        wanted="4 (hold)",
        why="from MANUAL a switch to AUTO may be refused",
        judge=judge_initial_mode,
    ),
    Rule(
        subject="ARMING_CHECK",
        names=("ARMING_CHECK", "ARMING_SKIPCHK"),
        wanted="all checks",
        why="they find what a person forgets",
        judge=judge_arming,
    ),
    Rule(
        subject="SYSID_THISMAV",
        names=("MAV_SYSID", "SYSID_THISMAV"),
        wanted="the id it speaks with",
        why="a changed id is in force after the next start",
        judge=judge_system_id,
    ),
)

CONTEXT = (
    "BATT_CRT_MAH", "BATT_CRT_VOLT", "BATT_LOW_MAH", "BATT_LOW_VOLT", "BATT_MONITOR",
)  # fmt: skip
"""Parameters that no rule is about and some rules look at."""


def rules_for(vehicle: str) -> tuple[Rule, ...]:
    """Return the rules for boat, rover or copter, in the order of the table."""
    return tuple(rule for rule in RULES if vehicle in rule.vehicles)


def parameter_names(vehicle: str) -> tuple[str, ...]:
    """Return every name that the rules for a vehicle ask for, all spellings."""
    names = {name for rule in rules_for(vehicle) for name in rule.names}
    return tuple(sorted(names | set(CONTEXT)))


def rules_table() -> str:
    """Return the rules as the Markdown table of ``docs/preflight.md``."""
    lines = ["| what | for | wanted | why |", "| --- | --- | --- | --- |"]
    for rule in RULES:
        others = [name for name in rule.names if name != rule.subject]
        what = f"`{rule.subject}`" if rule.names else rule.subject
        if others:
            what += " (" + ", ".join(f"`{name}`" for name in others) + ")"
        who = "all" if rule.vehicles == ALL else ", ".join(rule.vehicles)
        lines.append(f"| {what} | {who} | {rule.wanted} | {rule.why} |")
    return "\n".join(lines) + "\n"

"""The judgements of a preflight: one small function for each thing that is looked at.

Each gets one parameter's value or the vehicle's state, together with the plan, and says fine,
doubtful or wrong. Wrong means: with this setting the mission goes wrong. The table that says which
function judges what is :data:`mrmission.vehicle.preflight_rules.RULES`.
"""

from __future__ import annotations

import enum
from collections.abc import Callable, Mapping
from dataclasses import dataclass

from mrmission.vehicle.preflight_facts import PlanFacts, VehicleState


class Severity(enum.StrEnum):
    """How a check came out."""

    FINE = "fine"
    DOUBTFUL = "doubtful"
    WRONG = "wrong"


@dataclass(frozen=True, slots=True, kw_only=True)
class Verdict:
    """The outcome of one rule; ``reason`` empty: the rule's own."""

    severity: Severity
    wanted: str = ""
    reason: str = ""


@dataclass(frozen=True, slots=True, kw_only=True)
class Look:
    """What a rule may look at: its value, the other parameters, the plan, the vehicle.

    ``value`` is the parameter's (0 for a rule about state), ``name`` the name it was found under.
    """

    value: float
    name: str
    parameters: Mapping[str, float | None]
    plan: PlanFacts
    state: VehicleState

    def other(self, *names: str) -> float | None:
        """Return another parameter under the first of its names that the vehicle has."""
        return next((v for n in names if (v := self.parameters.get(n)) is not None), None)


Judge = Callable[[Look], Verdict]
# --- small functions -----------------------------------------------------------------------------

FINE = Verdict(severity=Severity.FINE)
NEAR_FENCE_M = 3.0
AVOIDED_FENCE_M = 10.0
RC_RANGE_M = 200.0
"""A hand-held transmitter's range over water that one may count on."""
POLYGON_FENCE, CIRCLE_FENCE = 4, 2
UNION_OPTION = 2
AROUND_FENCES = 2
"""OA_TYPE: Dijkstra's paths around fences."""
USES_STRAIGHT_RETURN = (1, 3)
USES_SMART_RETURN = (3, 4)


def wrong(wanted: str, reason: str = "") -> Verdict:
    """Return a verdict that stops a mission."""
    return Verdict(severity=Severity.WRONG, wanted=wanted, reason=reason)


def doubtful(wanted: str, reason: str = "") -> Verdict:
    """Return a verdict to think about."""
    return Verdict(severity=Severity.DOUBTFUL, wanted=wanted, reason=reason)


def fine(wanted: str = "", reason: str = "") -> Verdict:
    """Return a verdict that all is well."""
    return Verdict(severity=Severity.FINE, wanted=wanted, reason=reason)


def _share(plan: PlanFacts) -> str:
    # A share below half a percent is still a place where it happens.
    share = "1%" if 0 < plan.bad_return_share < 0.01 else f"{plan.bad_return_share:.0%}"
    return (
        f"a straight return crosses {plan.return_over} from {share} of the way (up to "
        f"{plan.bad_return_m:,.0f} m)"
    )


def _action(look: Look, *, none: Verdict) -> Verdict:
    """Judge FENCE_ACTION, FS_ACTION or BATT_FS_*_ACT of a boat or rover: they mean the same."""
    value = int(look.value)
    bad = look.plan.bad_return_share > 0
    best = "4 (SmartRTL or hold)" if bad else "1 (return), or 4 (SmartRTL or hold)"
    if value == 0:
        return none
    if value == 2:
        return fine(best, "holds: a boat coasts on and then drifts with the current")
    if value in USES_STRAIGHT_RETURN and bad:
        inside = look.name != "FENCE_ACTION" and look.plan.fence_polygons > 0
        if inside and look.other("OA_TYPE") == AROUND_FENCES:
            return fine(best, "OA_TYPE 2 takes the return round the islands of the fence")
        return wrong(best, _share(look.plan))
    if value in USES_SMART_RETURN:
        return fine(best, "comes back by its own track")
    if value == 1:
        return fine(best, "no land or fence between the way and home")
    if value == 5:
        return doubtful(best, "disarms: the boat drifts")
    return doubtful(best, f"{value} means nothing to this vehicle")


# --- state ---------------------------------------------------------------------------------------


def judge_link_state(look: Look) -> Verdict:
    """Judge: an armed vehicle takes no new plan."""
    if look.state.armed:
        return doubtful("disarmed", f"it is armed, in {look.state.mode}")
    return FINE


def judge_fix(look: Look) -> Verdict:
    """Judge: position fix, satellites and HDOP."""
    fix = look.state.gps_fix
    if fix is None:
        return wrong("3D fix", "it tells no position")
    if fix < 3:
        return wrong("3D fix", "without a position it cannot be armed for a mission")
    few = look.state.satellites is not None and look.state.satellites < 6
    poor = look.state.hdop is not None and look.state.hdop > 2.0
    if few or poor:
        return doubtful("6 satellites, HDOP 2.0", "a poor position sails poor lanes")
    return FINE


def judge_prearm(look: Look) -> Verdict:
    """Judge: what the vehicle says of arming, with its reason."""
    ok = look.state.prearm_ok
    if ok is None:
        return doubtful("passed", "it does not tell")
    if ok or look.state.armed:
        return FINE
    texts = [t for t in look.state.texts if t.startswith(("PreArm", "Arm:"))]
    return wrong("passed", f'it says "{texts[-1]}"' if texts else "it would refuse to arm")


def judge_ahrs(look: Look) -> Verdict:
    """Judge: the estimate of attitude and position."""
    ok = look.state.ahrs_ok
    if ok is None:
        return doubtful("healthy", "it does not tell")
    return FINE if ok else wrong("healthy", "its estimate of attitude and position is unhealthy")


def judge_position(look: Look) -> Verdict:
    """Judge: where the vehicle lies, against the plan's start and fence."""
    far = look.state.start_distance_m
    if far is None:
        return doubtful("at the plan's start", "its position is not known")
    if look.state.position_inside is False:
        return wrong("inside its fence", "outside the fence it cannot be armed")
    if far > 100.0:
        return wrong("within 100 m of the start", "the way there was not planned: it goes straight")
    if far > 15.0:
        return doubtful("within 15 m of the start", "the way there was not planned")
    return FINE


def judge_home(look: Look) -> Verdict:
    """Judge: where a return leads."""
    far = look.state.home_distance_m
    if far is None:
        return doubtful("at the plan's start", "it has no home yet, or does not tell")
    if look.state.home_inside is False:
        return wrong("inside its fence", "a return would lead out of the fence")
    if far > 50.0:
        return doubtful("within 50 m of the start", "a return goes there, not to the plan's start")
    return FINE


def judge_store(kind: str) -> Judge:
    """Return the judge of one store: mission, fence or rally."""

    def judge(look: Look) -> Verdict:
        if look.state.stored is None:
            return doubtful("the plan's", "it could not be read")
        what = look.state.stored[kind]
        if not what:
            return FINE
        return wrong("the plan's", f"{what}; run `mrmission upload --from`")

    return judge


def judge_room(look: Look) -> Verdict:
    """Judge: room for the mission."""
    room = look.state.limits.mission_items
    if look.plan.items > room:
        return wrong(f"{look.plan.items} items", f"it holds {room} (BRD_SD_MISSION gives more)")
    return fine(f"{look.plan.items} items")


def judge_fence_room(look: Look) -> Verdict:
    """Judge: room for the fence."""
    limits, plan = look.state.limits, look.plan
    wanted = f"{plan.fence_bytes} bytes"
    if plan.fence_bytes > limits.fence_bytes or plan.fence_largest > limits.fence_polygon_points:
        return wrong(wanted, f"it holds {limits.fence_bytes} (BRD_SD_FENCE gives more)")
    return fine(wanted)


# --- fence ---------------------------------------------------------------------------------------


def judge_fence_enable(look: Look) -> Verdict:
    """Judge: a stored fence must be on."""
    if look.plan.fence_polygons == 0:
        return fine("any", "the plan has no fence")
    return FINE if look.value >= 1 else wrong("1", "the plan's fence is stored but not kept")


def judge_fence_type(look: Look) -> Verdict:
    """Judge: polygons must be on."""
    value = int(look.value)
    if look.plan.fence_polygons and not value & POLYGON_FENCE:
        return wrong("4", "polygons are off: the plan's fence is not kept")
    return FINE


def judge_fence_radius(look: Look) -> Verdict:
    """Judge: the circle around home, where it is on, must hold the mission."""
    kind, on = look.other("FENCE_TYPE"), look.other("FENCE_ENABLE")
    if not on or kind is None or not int(kind) & CIRCLE_FENCE:
        return fine("any", "the circle is off")
    need = look.plan.farthest_m
    if look.value < need:
        return wrong(f"above {need:,.0f} m", "a waypoint lies beyond the circle around home")
    if look.value < need + 20.0:
        return doubtful(f"above {need + 20:,.0f} m", "the circle is close to the farthest waypoint")
    return FINE


def judge_fence_action(look: Look) -> Verdict:
    """Judge: what a breach does."""
    if look.plan.fence_polygons == 0:
        return fine("any", "the plan has no fence")
    best = 4 if look.plan.bad_return_share > 0 else 1
    return _action(look, none=doubtful(str(best), "at a breach it sails on, also onto land"))


def judge_fence_options(look: Look) -> Verdict:
    """Judge: several inclusion polygons need the union."""
    if look.plan.fence_inclusions > 1 and not int(look.value) & UNION_OPTION:
        return wrong("bit 1 set (union)", "several inclusion polygons: it must be in all at once")
    return FINE


def judge_avoid(look: Look) -> Verdict:
    """Judge: avoidance pushes a vehicle off lanes near a fence."""
    if look.plan.fence_polygons == 0 or not int(look.value) & 1:
        return FINE
    near = look.plan.nearest_fence_m
    why = f"the way comes within {near:.1f} m of the fence, and it is pushed off there"
    if near < NEAR_FENCE_M:
        return wrong("0", why)
    return doubtful("0", why) if near < AVOIDED_FENCE_M else FINE


def judge_path_planning(look: Look) -> Verdict:
    """Judge: path planning takes returns round islands, and is lost outside the fence."""
    value = int(look.value)
    if value == 0:
        return FINE
    if value != AROUND_FENCES:
        return doubtful("0", "bendy ruler leaves lanes for what it takes for obstacles")
    why = "once outside the fence it finds no path and drifts on"
    returns = (*USES_STRAIGHT_RETURN, *USES_SMART_RETURN)
    if look.plan.fence_polygons and look.other("FENCE_ACTION") in returns:
        return wrong("0", f"{why}, whatever FENCE_ACTION asks for")
    return doubtful("0", f"it takes returns round islands, but {why}")


# --- sailing -------------------------------------------------------------------------------------


def judge_radius(look: Look) -> Verdict:
    """Judge: waypoint radius against the swath."""
    swath = look.plan.swath_m
    if look.value < 0.3:
        return doubtful("0.5 m or more", "it may circle around a waypoint")
    if swath is None:
        return FINE if look.value <= 3.0 else doubtful("3 m or less", "the swath is not known")
    wanted = f"up to {swath / 10:.3g} m"
    if look.value > swath / 4:
        return wrong(wanted, f"it cuts corners by more than the overlap of a {swath:g} m swath")
    if look.value > swath / 10 + 1e-6:
        return doubtful(wanted, f"a tenth of the {swath:g} m swath keeps the lanes complete")
    return fine(wanted)


def judge_speed(look: Look) -> Verdict:
    """Judge: default speed against the plan's."""
    plan = look.plan
    wanted = plan.survey_speed_m_s or (plan.speeds_m_s[0] if plan.speeds_m_s else None)
    if wanted is None:
        return fine("any", "the plan's speed is not known")
    # A copter's is in cm/s under its old name.
    value = look.value / 100.0 if look.name == "WPNAV_SPEED" else look.value
    if value == 0.0:
        value = look.other("CRUISE_SPEED") or 0.0
    if abs(value - wanted) <= 0.1 * wanted:
        return fine(f"{wanted:g} m/s")
    if plan.speeds_m_s:
        return doubtful(f"{wanted:g} m/s", "in force until the mission sets its own speed")
    return wrong(f"{wanted:g} m/s", "the plan's lanes and times are for another speed")


def judge_loiter(look: Look) -> Verdict:
    """Judge: how a boat goes back to the place that it is to hold."""
    if int(look.value) == 1:
        return FINE
    return doubtful("1 (bow first)", "a steered boat lost its place in 0.3 m/s of current")


def judge_top_speed(look: Look) -> Verdict:
    """Judge: the limit of every other speed."""
    speeds = (look.plan.survey_speed_m_s, look.plan.transit_speed_m_s, *look.plan.speeds_m_s)
    need = max((s for s in speeds if s is not None), default=0.0)
    if look.value == 0 or look.value >= need:
        return fine(f"0, or {need:g} m/s and more")
    return wrong(f"0, or {need:g} m/s and more", "it will not reach the planned speed")


def judge_cruise(look: Look) -> Verdict:
    """Judge: the speed that belongs to CRUISE_THROTTLE."""
    if look.value <= 0:
        return wrong("above 0", "its throttle has no reference")
    return fine("measured at CRUISE_THROTTLE")


def judge_frame(look: Look) -> Verdict:
    """Judge: boat or rover."""
    value, boat = int(look.value), look.plan.vehicle == "boat"
    if boat and value != 2:
        return wrong("2 (boat)", "a rover stops where a boat would hold its place")
    if not boat and value not in (1, 3):
        return wrong("1 (rover)", "the plan is for a rover")
    return FINE


def judge_done(look: Look) -> Verdict:
    """Judge: what happens at the mission's end."""
    value, boat = int(look.value), look.plan.vehicle == "boat"
    best = "1 (loiter)" if boat else "0 (hold)"
    if value in (2, 3):
        return wrong(best, "at the end it is left without steering")
    if boat and value == 0:
        return wrong(best, "at the end it drifts with the current")
    if not boat and value == 1:
        return doubtful(best, "loitering is for boats")
    return FINE


def judge_rally_limit(look: Look) -> Verdict:
    """Judge: beyond which distance a return ignores rally points."""
    far_m = look.plan.farthest_m
    if look.plan.rally_points == 0 or look.value == 0 or look.value * 1000 >= far_m:
        return FINE
    elsewhere = look.state.home_distance_m is not None and look.state.home_distance_m > 15.0
    if elsewhere:
        return doubtful(
            f"0, or above {far_m / 1000:.2g} km", "beyond it a return goes to home, not the rally"
        )
    return fine("any", "home and rally point are one place")


def judge_smart_points(look: Look) -> Verdict:
    """Judge: whether SmartRTL can remember the whole way."""
    actions = ("FENCE_ACTION", "FS_ACTION", "BATT_FS_LOW_ACT", "BATT_FS_CRT_ACT")
    used = [n for n in actions if look.parameters.get(n) in USES_SMART_RETURN]
    if not used:
        return fine("any", "no action uses SmartRTL")
    need = look.plan.smart_rtl_points
    if look.value == 0:
        return wrong("300 or more", f"0 switches SmartRTL off, and {used[0]} relies on it")
    if look.value < need:
        holds = all(look.parameters.get(n) == 4 for n in used)
        verdict = doubtful if holds or look.plan.bad_return_share == 0 else wrong
        return verdict(
            f"{min(need, 500)} or more",
            f"the way takes about {need} points: SmartRTL gives up on the way, and then it "
            + ("holds" if holds else "returns straight"),
        )
    return fine(f"about {need} or more")


# --- failsafes -----------------------------------------------------------------------------------


def judge_radio(look: Look) -> Verdict:
    """Judge: what a lost transmitter does."""
    value, action = int(look.value), look.other("FS_ACTION")
    far = look.plan.farthest_m
    if value in (0, 2):
        return FINE
    if action == 0:
        return fine("0 or 2", "FS_ACTION 0: nothing happens")
    why = f"it breaks off where the transmitter's range ends, and the way goes {far:,.0f} m out"
    if far > RC_RANGE_M:
        return wrong("2 (continue in AUTO), or 0", why)
    return doubtful("2 (continue in AUTO), or 0", why)


def judge_ground_station(look: Look) -> Verdict:
    """Judge: what a lost ground station does."""
    value = int(look.value)
    if value in (0, 2):
        return FINE
    if look.other("FS_ACTION") == 0:
        return fine("0 or 2", "FS_ACTION 0: nothing happens")
    return wrong("2 (continue in AUTO), or 0", "it breaks off when the ground station is not heard")


def judge_fs_action(look: Look) -> Verdict:
    """Judge: what a failsafe of the links does."""
    if not look.other("FS_THR_ENABLE") and not look.other("FS_GCS_ENABLE"):
        return fine("any", "no failsafe uses it")
    return _action(look, none=fine("any", "nothing happens at a failsafe"))


def judge_battery(look: Look) -> Verdict:
    """Judge: what a low battery does."""
    if not look.other("BATT_MONITOR"):
        return fine("any", "BATT_MONITOR 0: no battery is watched")
    none = doubtful("4 (SmartRTL or hold)", "an empty battery leaves it where it is")
    verdict = _action(look, none=none)
    if look.value and verdict.severity is Severity.FINE:
        low = "LOW" if "LOW" in look.name else "CRT"
        if not look.other(f"BATT_{low}_VOLT") and not look.other(f"BATT_{low}_MAH"):
            return doubtful("BATT_*_VOLT or _MAH set", "without a limit it never fires")
    return verdict


def judge_crash(look: Look) -> Verdict:
    """Judge: standing still counts as a crash."""
    if look.value == 0:
        return FINE
    return doubtful(
        "0", "no headway for 2 s with the motors on counts as a crash: it holds, and drifts"
    )


def judge_ekf(look: Look) -> Verdict:
    """Judge: what a lost position does."""
    if look.value == 0:
        return doubtful("1 (hold)", "without a position it sails on blindly")
    return FINE


def judge_initial_mode(look: Look) -> Verdict:
    """Judge: the mode after power-up."""
    value = int(look.value)
    if value == 10:
        return wrong("4 (hold)", "it sails off as soon as it is armed")
    if value == 0:
        return doubtful("4 (hold)", "from MANUAL a ground station cannot always switch to AUTO")
    return FINE


def judge_arming(look: Look) -> Verdict:
    """Judge: the checks before arming."""
    if look.name == "ARMING_SKIPCHK":
        off = look.value != 0
        return doubtful("0 (none skipped)", "some checks before arming are off") if off else FINE
    if look.value == 1:
        return FINE
    if look.value == 0:
        return doubtful("1 (all)", "the checks before arming are off")
    return doubtful("1 (all)", "some checks before arming are off")


def judge_system_id(look: Look) -> Verdict:
    """Judge: the number that is in force after the next start."""
    if int(look.value) == look.state.system_id:
        return FINE
    return doubtful(str(look.state.system_id), "it takes the new number at its next start")

"""Before the start: every vehicle's parameters and state against the plan. Nothing is written."""

from __future__ import annotations

import asyncio
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, cast

from mrmission.errors import LinkTimeoutError, VehicleError
from mrmission.model import Mission
from mrmission.vehicle.assign import assign, first_sorties
from mrmission.vehicle.capacity import ask_limits
from mrmission.vehicle.connection import default_connections, parse_connections
from mrmission.vehicle.items import MissionType, to_raw
from mrmission.vehicle.preflight_checks import Look, Severity
from mrmission.vehicle.preflight_facts import PlanFacts, PlanGeometry, VehicleState, plan_facts
from mrmission.vehicle.preflight_rules import Rule, parameter_names, rules_for
from mrmission.vehicle.readback import compare_items
from mrmission.vehicle.retry import Tries
from mrmission.vehicle.rows import UploadTimeouts
from mrmission.vehicle.saved import read_store
from mrmission.vehicle.upload import tried_text

if TYPE_CHECKING:
    from mrmission.vehicle.client import Vehicle
    from mrmission.vehicle.framing import Signing

MESSAGE_S = 3.0
PREARM_FLAG = 0x10000000
AHRS_FLAG = 0x200000
UNKNOWN_HDOP = 65535
UNKNOWN_SATELLITES = 255
HIGHEST_E7 = 900_000_000


@dataclass(frozen=True, slots=True, kw_only=True)
class CheckRow:
    """One thing that was looked at, on one vehicle."""

    subject: str
    found: str
    wanted: str
    severity: Severity
    reason: str


@dataclass(frozen=True, slots=True, kw_only=True)
class VehicleCheck:
    """All that was looked at on one robot's vehicle; ``system_id`` is None where it is absent."""

    robot: int
    system_id: int | None
    link: str
    rows: tuple[CheckRow, ...]

    @property
    def severity(self) -> Severity:
        """The worst of the rows."""
        found = {row.severity for row in self.rows}
        return next((s for s in (Severity.WRONG, Severity.DOUBTFUL) if s in found), Severity.FINE)


async def preflight_fleet(
    missions: Sequence[Mission],
    connections: Sequence[str] = (),
    *,
    report: Mapping[str, Any] | None = None,
    assignment: Mapping[int, int] | None = None,
    timeouts: UploadTimeouts | None = None,
    signing: Signing | None = None,
) -> list[VehicleCheck]:
    """Compare every vehicle's parameters and state with its robot's plan. Read only.

    Parameters
    ----------
    missions
        One or more per robot; the first sortie of each is looked at.
    connections
        Links as after ``--connect``; none means the loopback ports of as many SITL instances.
    report
        Content of the plan's ``report.json``, where there is one.
    assignment
        Robot to system id, as the upload had it.
    timeouts, signing
        As for an upload.

    Returns
    -------
    list of VehicleCheck
        One per robot, by number. A vehicle that is absent or falls silent has one row that says so.

    Raises
    ------
    VehicleError
        When two vehicles have one system id.
    """
    from mrmission.vehicle.client import open_links

    timeouts = timeouts or UploadTimeouts()
    first = first_sorties(missions)
    links = parse_connections(connections) or default_connections(len(first))
    async with open_links(
        links,
        expected=len(first),
        timeouts=timeouts.link,
        patient=bool(connections),
        signing=signing,
    ) as fleet:
        given = assign([m.robot for m in first], list(fleet.vehicles), assignment)
        silent = tried_text(fleet.silent)
        return list(
            await asyncio.gather(
                *(
                    _check(m, fleet.vehicles.get(given.get(m.robot, -1)), report, timeouts, silent)
                    for m in first
                )
            )
        )


async def _check(
    mission: Mission,
    vehicle: Vehicle | None,
    report: Mapping[str, Any] | None,
    timeouts: UploadTimeouts,
    silent: str,
) -> VehicleCheck:
    if vehicle is None:
        rows = (_lost("no vehicle for this robot" + (f": {silent}" if silent else "")),)
        return VehicleCheck(robot=mission.robot, system_id=None, link="", rows=rows)
    geometry = PlanGeometry(mission)
    facts = plan_facts(mission, geometry, report)
    checked: tuple[CheckRow, ...]
    try:
        await vehicle.wait_heartbeat()
        parameters = await vehicle.parameters(
            [*parameter_names(facts.vehicle), *(w.name for w in facts.wanted)]
        )
        state = await vehicle_state(vehicle, mission, geometry, timeouts)
        checked = judged(facts, state, parameters)
    except VehicleError as error:
        checked = (_lost(str(error)),)
    return VehicleCheck(
        robot=mission.robot,
        system_id=vehicle.system_id,
        link=vehicle.connection.url,
        rows=checked,
    )


def _lost(reason: str) -> CheckRow:
    return CheckRow(
        subject="link", found="nothing", wanted="a vehicle", severity=Severity.WRONG, reason=reason
    )


# --- the vehicle ---------------------------------------------------------------------------------


async def vehicle_state(
    vehicle: Vehicle, mission: Mission, geometry: PlanGeometry, timeouts: UploadTimeouts
) -> VehicleState:
    """Ask a vehicle for its state.

    Raises
    ------
    VehicleError
        When it falls silent.
    """
    # SYS_STATUS last: by then a vehicle that was just found has said why it would not arm.
    gps, position, home = await asyncio.gather(
        *(
            _message(vehicle, name)
            for name in ("GPS_RAW_INT", "GLOBAL_POSITION_INT", "HOME_POSITION")
        )
    )
    stored = await _stored(vehicle, mission, timeouts)
    limits = (await ask_limits(vehicle)).limits
    status = await _message(vehicle, "SYS_STATUS")
    here = _lonlat(position.lat, position.lon) if position is not None else None
    there = _lonlat(home.latitude, home.longitude) if home is not None else None
    known = bool(mission.items)
    return VehicleState(
        system_id=vehicle.system_id,
        armed=vehicle.armed,
        mode=vehicle.mode,
        limits=limits,
        gps_fix=gps.fix_type if gps is not None else None,
        satellites=_unless(gps and gps.satellites_visible, UNKNOWN_SATELLITES),
        hdop=None if gps is None or gps.eph == UNKNOWN_HDOP else gps.eph / 100.0,
        prearm_ok=_flag(status, PREARM_FLAG),
        ahrs_ok=_flag(status, AHRS_FLAG),
        texts=vehicle.status_texts(),
        start_distance_m=geometry.home_distance_m(here) if here and known else None,
        position_inside=geometry.inside(here) if here else None,
        home_distance_m=geometry.home_distance_m(there) if there and known else None,
        home_inside=geometry.inside(there) if there else None,
        stored=stored,
    )


async def _message(vehicle: Vehicle, name: str) -> Any:
    try:
        return await vehicle.message(name, MESSAGE_S)
    except LinkTimeoutError:
        if vehicle.silent:
            raise
        return None


def _unless(value: Any, unknown: int) -> int | None:
    return None if value is None or value == unknown else int(value)


def _lonlat(lat_e7: int, lon_e7: int) -> tuple[float, float] | None:
    """Return longitude and latitude, None for the zeros of a vehicle that has no position."""
    if (lat_e7 == 0 and lon_e7 == 0) or abs(lat_e7) > HIGHEST_E7:
        return None
    return lon_e7 / 1e7, lat_e7 / 1e7


def _flag(status: Any, flag: int) -> bool | None:
    """Return whether a sensor is healthy, None where the vehicle does not have or tell it."""
    if status is None or not status.onboard_control_sensors_present & flag:
        return None
    return bool(status.onboard_control_sensors_health & flag)


async def _stored(
    vehicle: Vehicle, mission: Mission, timeouts: UploadTimeouts
) -> dict[str, str] | None:
    """Return what each store holds otherwise than the plan, empty texts where it holds the plan."""
    wanted = to_raw(mission)
    tries = Tries(vehicle, timeouts)
    out = {}
    try:
        for kind in MissionType:
            stored = await read_store(vehicle, kind, tries)
            wrong = compare_items(wanted[kind], stored, kind)
            more = f" and {len(wrong) - 1} more" if len(wrong) > 1 else ""
            out[kind.name.lower()] = f"{wrong[0]}{more}" if wrong else ""
    except VehicleError:
        if vehicle.silent:
            raise
        return None
    return out


# --- judging -------------------------------------------------------------------------------------


def judged(
    plan: PlanFacts, state: VehicleState, parameters: Mapping[str, float | None]
) -> tuple[CheckRow, ...]:
    """Apply the rules of the plan's vehicle, and the parameters that its mission wants.

    Parameters
    ----------
    plan, state
        What is known of both.
    parameters
        By name; None where the vehicle does not have one.

    Returns
    -------
    tuple of CheckRow
        In the order of the rules.
    """
    rules = rules_for(plan.vehicle)
    rows = [_row(rule, plan, state, parameters) for rule in rules]
    ruled = {name for rule in rules for name in rule.names}
    rows += [
        _wanted_row(wanted.name, wanted.value, wanted.holds, wanted.reason, parameters)
        for wanted in plan.wanted
        if wanted.name not in ruled
    ]
    return tuple(rows)


def _row(
    rule: Rule, plan: PlanFacts, state: VehicleState, parameters: Mapping[str, float | None]
) -> CheckRow:
    name = next((n for n in rule.names if parameters.get(n) is not None), "")
    if rule.names and not name:
        return CheckRow(
            subject=rule.subject,
            found="not known to the vehicle",
            wanted=rule.wanted,
            severity=rule.absent,
            reason="this autopilot has no parameter " + " or ".join(rule.names),
        )
    value = cast(float, parameters[name]) if name else 0.0
    verdict = rule.judge(
        Look(value=value, name=name, parameters=parameters, plan=plan, state=state)
    )
    return CheckRow(
        subject=name or rule.subject,
        found=f"{value:g}" if name else _found(rule.subject, state),
        wanted=verdict.wanted or rule.wanted,
        severity=verdict.severity,
        reason=verdict.reason or rule.why,
    )


def _wanted_row(
    name: str, value: float, holds: Any, reason: str, parameters: Mapping[str, float | None]
) -> CheckRow:
    found = parameters.get(name)
    if found is None:
        severity, shown = Severity.DOUBTFUL, "not known to the vehicle"
    else:
        severity, shown = Severity.FINE if holds(found) else Severity.WRONG, f"{found:g}"
    return CheckRow(
        subject=name, found=shown, wanted=f"{value:g}", severity=severity, reason=reason
    )


def _found(subject: str, state: VehicleState) -> str:
    """Return what stands under "found" for a rule about the vehicle's state."""
    match subject:
        case "armed":
            return "armed" if state.armed else f"disarmed, in {state.mode}"
        case "position fix":
            if state.gps_fix is None:
                return "nothing"
            kind = f"{min(state.gps_fix, 3)}D" if state.gps_fix >= 2 else "no fix"
            more = [] if state.satellites is None else [f"{state.satellites} satellites"]
            more += [] if state.hdop is None else [f"HDOP {state.hdop:.1f}"]
            return ", ".join([kind, *more])
        case "arming checks":
            return _told(state.prearm_ok, "passed", "failed")
        case "EKF":
            return _told(state.ahrs_ok, "healthy", "unhealthy")
        case "position":
            return _place(state.start_distance_m, state.position_inside)
        case "home":
            return _place(state.home_distance_m, state.home_inside)
        case "mission memory":
            return f"{state.limits.mission_items} items"
        case "fence memory":
            return f"{state.limits.fence_bytes} bytes"
        case "stored mission" | "stored fence" | "stored rally points":
            if state.stored is None:
                return "not read"
            return "something else" if state.stored[subject.split()[1]] else "the plan's"
    raise KeyError(subject)


def _told(value: bool | None, yes: str, no: str) -> str:
    return "not told" if value is None else yes if value else no


def _place(far_m: float | None, inside: bool | None) -> str:
    if far_m is None:
        return "not known"
    where = {True: ", inside the fence", False: ", outside the fence", None: ""}[inside]
    return f"{far_m:,.0f} m from the start{where}"

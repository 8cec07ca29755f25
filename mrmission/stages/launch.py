"""Routes -> which way round each is sailed, when each robot starts, and what may meet."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from mrmission.area.frame import LocalFrame
from mrmission.area.legs import leg_tolerance_m
from mrmission.errors import InfeasibleError
from mrmission.minmax.regions import crossings_m, region_pieces
from mrmission.mission.build import Route
from mrmission.model import (
    CoveragePath,
    FloatArray,
    Mission,
    PairDistance,
    RobotReport,
    SeparationConflict,
    SeparationReport,
)
from mrmission.options import PlanOptions
from mrmission.report.units import human_chance
from mrmission.tour.separation import (
    Separation,
    SeparationRules,
    reversed_path,
    separate,
)
from mrmission.tour.sweep import widest_spacing_m
from mrmission.tour.timing import TimeModel

BERTH_REACH = 3.0
"""A conflict within so many separations of both homes is one at the berths."""
MOST_HOLD_S = 32767
"""What ArduRover keeps of a waypoint's time to hold; from 32,768 on it holds not at all."""
TOLD = 5
"""Conflicts that the notes tell one by one; all are in the report."""


def launch(
    routes: Mapping[int, Route],
    homes_m: Mapping[int, FloatArray],
    times: Sequence[TimeModel],
    options: PlanOptions,
    frame: LocalFrame,
) -> tuple[dict[int, Route], dict[int, float], SeparationReport]:
    """Choose each robot's way round and its start.

    Parameters
    ----------
    routes, homes_m
        By robot.
    times
        How long each robot takes, robot 1 first.
    options
        What the user asked for.
    frame
        The local frame.

    Returns
    -------
    routes, delay_s, report
        The routes as they are sailed, seconds after the fleet's start by robot, and what there is
        to report.
    """
    order = sorted(routes)
    rules = SeparationRules(
        distance_m=options.separation_m,
        time_share=options.time_uncertainty,
        max_delay_s=options.max_delay_s,
    )
    # a run-in longer than the run-out would be at the wrong end of every lane
    run_in_m, run_out_m = (
        options.turnaround_m if own is None else own
        for own in (options.run_in_m, options.run_out_m)
    )
    found = separate(
        [replace(routes[r].path, robot=r) for r in order],
        [times[r - 1] for r in order],
        rules,
        may_turn=[run_in_m == run_out_m] * len(order),
        pauses_s=[options.of_robot(r).swap_time_s for r in order],
    )
    sailed = {
        r: _reversed(routes[r]) if turned else routes[r]
        for r, turned in zip(order, found.turned, strict=True)
    }
    delays = dict(zip(order, found.delay_s.tolist(), strict=True))
    report = _report(found, order, homes_m, frame)
    if report.distance_m > 0:
        spacing_m = widest_spacing_m(
            options.swath_m, options.overlap, leg_tolerance_m(options.swath_m)
        )
        paths = [sailed[r].path for r in order]
        report = replace(
            report,
            regions=region_pieces(paths, spacing_m),
            crossings_m=crossings_m(paths, spacing_m),
        )
    return sailed, delays, report


def _reversed(route: Route) -> Route:
    path: CoveragePath = reversed_path(route.path)
    return Route(lonlat=np.ascontiguousarray(route.lonlat[::-1]), path=path)


def waiting(mission: Mission, delay_s: float) -> Mission:
    """Return a mission that holds at its first waypoint, at home, before it sets off.

    The waypoint's first parameter is a time to hold, in whole seconds; a boat loiters meanwhile.
    """
    wait_s = math.ceil(delay_s)
    if wait_s <= 0 or len(mission.items) < 2:
        return mission
    if wait_s > MOST_HOLD_S:
        raise InfeasibleError(
            f"robot {mission.robot} is to wait {wait_s} s, a waypoint holds {MOST_HOLD_S} s at "
            "most: give a shorter --max-delay, or leave --wait-in-mission out"
        )
    items = list(mission.items)
    items[1] = replace(items[1], param1=float(wait_s))
    return replace(mission, items=tuple(items))


def _report(
    found: Separation, order: Sequence[int], homes_m: Mapping[int, FloatArray], frame: LocalFrame
) -> SeparationReport:
    if found.rules.distance_m <= 0:
        return SeparationReport()
    reach_m = BERTH_REACH * found.rules.distance_m
    conflicts = []
    for c in found.conflicts:
        lon, lat = frame.to_lonlat(np.array(c.place_m))
        away = max(np.hypot(*(np.array(c.place_m) - homes_m[r])) for r in c.robots)
        conflicts.append(
            SeparationConflict(
                robots=c.robots,
                least_m=c.least_m,
                lonlat=(float(lon), float(lat)),
                from_s=c.from_s,
                to_s=c.to_s,
                chance=c.chance,
                at_berths=bool(away <= reach_m),
            )
        )
    pairs = []
    for i, a in enumerate(order):
        for j in range(i + 1, len(order)):
            least = float(found.least_m[i, j])
            pairs.append(
                PairDistance(robots=(a, order[j]), least_m=least if np.isfinite(least) else None)
            )
    return SeparationReport(
        distance_m=found.rules.distance_m,
        time_share=found.rules.time_share,
        start_slack_s=found.rules.start_slack_s,
        max_delay_s=float(found.rules.max_delay_s or 0.0),
        turned=tuple(r for r, t in zip(order, found.turned, strict=True) if t),
        pairs=tuple(pairs),
        conflicts=tuple(conflicts),
    )


def launch_notes(
    rows: Mapping[int, RobotReport], report: SeparationReport, waits: bool = False
) -> list[str]:
    """Return what to say: the order of the starts, what is kept, and what may meet.

    Parameters
    ----------
    rows
        The report's rows, by robot.
    report
        What was found.
    waits
        Whether the missions themselves wait.
    """
    if report.distance_m <= 0:
        return []
    notes = _order_notes(rows, waits)
    error = f"times wrong by up to {report.time_share:.0%}"
    near = [p for p in report.pairs if p.least_m is not None and p.least_m < report.distance_m]
    if not near:
        met = [p.least_m for p in report.pairs if p.least_m is not None]
        if met:
            notes.append(
                f"no two robots under way come nearer than {report.distance_m:g} m with {error}: "
                f"{min(met):.0f} m at the least"
            )
        return notes
    told = [c for c in report.conflicts if not c.at_berths]
    home = [c for c in report.conflicts if c.at_berths]
    notes.append(
        f"{len(near)} of {len(report.pairs)} pairs of robots can come nearer than "
        f"{report.distance_m:g} m with {error}: at {len(report.conflicts)} places, {len(home)} of "
        f"them at the berths; delays up to {_clock(report.max_delay_s)} (--max-delay) do "
        "not keep them apart, so keep a lookout; all are in report.json"
    )
    notes.extend(conflict_text(c) for c in told[:TOLD])
    if len(told) > TOLD:
        notes.append(f"… and {len(told) - TOLD} less likely places on the water")
    if home:
        notes.append(
            "at the berths: "
            + conflict_text(home[0])
            + (f"; {len(home) - 1} more there" if len(home) > 1 else "")
        )
    return notes


def conflict_text(conflict: SeparationConflict) -> str:
    """Return a conflict as one line."""
    a, b = conflict.robots
    first, last = _clock(conflict.from_s), _clock(conflict.to_s)
    when = f"between {first} and {last}" if first != last else f"about {first}"
    return (
        f"robots {a} and {b} may come within {conflict.least_m:.0f} m of each other near "
        f"{_lonlat(conflict.lonlat)} {when} after the start "
        f"(chance {human_chance(conflict.chance)})"
    )


def _order_notes(rows: Mapping[int, RobotReport], waits: bool) -> list[str]:
    """Say in which order, and when, the robots start; nothing without delays."""
    if not any(row.start_delay_s > 0 for row in rows.values()):
        return []
    ends = [row.duration_s + row.start_delay_s for row in rows.values()]
    later_s = max(ends) - max(row.duration_s for row in rows.values())
    queue = sorted((r for r in rows.values() if r.lanes), key=lambda r: (r.start_delay_s, r.robot))
    first = [str(r.robot) for r in queue if r.start_delay_s == 0]
    late = [r for r in queue if r.start_delay_s > 0]
    then = [f"robot {r.robot} after {r.start_delay_s:.0f} s" for r in late]
    later = f"{later_s:.0f} s later" if later_s >= 0.5 else "no later"
    if waits:
        wait = [f"robot {r.robot} for {r.start_delay_s:.0f} s" for r in late]
        return [
            (
                f"start all missions at once: they wait at their berths, robot"
                f"{'s' * (len(first) > 1)} {_some(first)} not at all, {_some(wait)}; "
                f"the last one is home {later} for it"
            )
        ]
    return [
        (
            f"launch robot{'s' * (len(first) > 1)} {_some(first)} first, {_some(then)}; "
            f"the last one is home {later} for it"
        )
    ]


def _clock(time_s: float) -> str:
    """Return a time as people say it, to the minute from five minutes on."""
    seconds = round(time_s)
    if seconds < 300:
        return f"{seconds} s"
    minutes = round(time_s / 60)
    return f"{minutes} min" if minutes < 120 else f"{minutes // 60} h {minutes % 60:02d} min"


def _lonlat(lonlat: tuple[float, float]) -> str:
    return f"{(lonlat[0] + 180.0) % 360.0 - 180.0:.6f},{lonlat[1]:.6f}"


def _some(names: Sequence[str]) -> str:
    return ", ".join(names[:8]) + " …" * (len(names) > 8)

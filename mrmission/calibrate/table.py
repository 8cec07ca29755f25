"""What was measured becomes a time table, and the table becomes a page of Markdown."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from mrmission.calibrate.courses import Course
from mrmission.calibrate.measure import CourseResult, Measured
from mrmission.calibrate.sailing import Setting
from mrmission.tour.time_table import ChainCost, CornerCost, SpeedChange, TimeRow, TimeTable

SHOWN_LEGS_M = (5.0, 10.0, 20.0)


def row_of(setting: Setting, result: CourseResult) -> TimeRow:
    """Return the table's row of one course: means of the repeats, the widest swing of them."""
    corners: dict[float, list[Measured]] = {}
    chains: dict[tuple[str, float, float, int], list[Measured]] = {}
    for m in result.measured:
        man = m.manoeuvre
        if man.kind == "corner":
            corners.setdefault(abs(man.angle_deg), []).append(m)
        elif man.kind in ("turn", "stairs"):
            count = man.last - man.first + 1
            chains.setdefault((man.kind, abs(man.angle_deg), man.leg_m, count), []).append(m)
    return TimeRow(
        steering=setting.steering,
        speed_m_s=setting.speed_m_s,
        radius_m=setting.radius_m,
        start_s=round(result.start_s, 2),
        end_s=round(result.end_s, 2),
        corners=tuple(
            CornerCost(angle_deg=angle, **_cost(found)) for angle, found in sorted(corners.items())
        ),
        chains=tuple(
            ChainCost(kind=kind, angle_deg=angle, leg_m=leg, corners=count, **_cost(found))
            for (kind, angle, leg, count), found in sorted(chains.items())
        ),
    )


def _cost(found: Sequence[Measured]) -> dict[str, float]:
    extra = np.array([m.extra_s for m in found])
    return {
        "extra_s": round(float(extra.mean()), 2),
        "spread_s": round(float(np.ptp(extra)), 2),
        "swing_m": round(max(m.swing_m for m in found), 2),
        "beyond_m": round(max(m.beyond_m for m in found), 2),
    }


def changes_of(steering: str, course: Course, result: CourseResult) -> tuple[SpeedChange, ...]:
    """Return the changes of speed of a course: means of the repeats."""
    sums: dict[tuple[float, float], list[float]] = {}
    for m in result.measured:
        if m.manoeuvre.kind == "speed":
            before, after = course.speed_m_s[m.manoeuvre.first - 1 : m.manoeuvre.first + 1].tolist()
            sums.setdefault((before, after), []).append(m.extra_s)
    return tuple(
        SpeedChange(
            steering=steering, from_m_s=a, to_m_s=b, extra_s=round(float(np.mean(extra)), 2)
        )
        for (a, b), extra in sorted(sums.items())
    )


def make_table(
    results: Mapping[Setting, CourseResult],
    changes: Sequence[SpeedChange],
    *,
    vehicle: str,
    command: str,
    repeats: int,
) -> TimeTable:
    """Return the time table of all courses."""
    order = sorted(results, key=lambda s: (s.steering != "steered", s.speed_m_s, s.radius_m))
    return TimeTable(
        rows=tuple(row_of(setting, results[setting]) for setting in order),
        speed_changes=tuple(changes),
        vehicle=vehicle,
        command=command,
        repeats=repeats,
    )


def merged(old: TimeTable, new: TimeTable) -> TimeTable:
    """Return a table with the rows of both; of one setting, the new row."""

    def key(row: TimeRow) -> tuple[bool, float, float]:
        return row.steering != "steered", row.speed_m_s, row.radius_m

    if not new.rows and not new.speed_changes:
        return old
    rows = {key(row): row for row in (*old.rows, *new.rows)}
    changes = {(c.steering, c.from_m_s, c.to_m_s): c for c in old.speed_changes}
    changes |= {(c.steering, c.from_m_s, c.to_m_s): c for c in new.speed_changes}
    return TimeTable(
        rows=tuple(rows[k] for k in sorted(rows)),
        speed_changes=tuple(
            sorted(changes.values(), key=lambda c: (c.steering != "steered", c.from_m_s, c.to_m_s))
        ),
        vehicle="; ".join(dict.fromkeys([*old.vehicle.split("; "), *new.vehicle.split("; ")])),
        command="\n".join(dict.fromkeys([*old.command.split("\n"), new.command])),
        repeats=min(old.repeats, new.repeats),
    )


def markdown(table: TimeTable) -> str:
    """Return a table as Markdown: seconds per corner and per lane turn, metres of swing."""
    commands = [f"    {line}" for line in table.command.split("\n")]
    lines = [f"Measured on {table.vehicle} by", "", *commands, ""]
    for steering in dict.fromkeys(row.steering for row in table.rows):
        rows = table.of(steering)
        angles = [c.angle_deg for c in rows[0].corners]
        legs = [
            leg
            for leg in SHOWN_LEGS_M
            if all(any(c.kind == "turn" and c.leg_m == leg for c in row.chains) for row in rows)
        ]
        lines += [
            f"Extra seconds over length / speed, {steering}: single corners between long legs,",
            "and turns from lane to lane (two corners of 90°) at a spacing:",
            "",
            _line(["m/s", "WP_RADIUS", *(f"{a:g}°" for a in angles), *(f"{g:g} m" for g in legs)]),
            _line(["---"] * (2 + len(angles) + len(legs))),
        ]
        for row in rows:
            turns = [_turn(row, leg).extra_s for leg in legs]
            lines.append(
                _line(
                    [
                        f"{row.speed_m_s:g}",
                        f"{row.radius_m:g}",
                        *(_signed(c.extra_s) for c in row.corners),
                        *(_signed(extra) for extra in turns),
                    ]
                )
            )
        lines += [
            "",
            f"Metres off the planned way, {steering}, the widest of the repeats:",
            "",
            _line(["m/s", "WP_RADIUS", *(f"{a:g}°" for a in angles), *(f"{g:g} m" for g in legs)]),
            _line(["---"] * (2 + len(angles) + len(legs))),
        ]
        for row in rows:
            swings = [c.swing_m for c in row.corners] + [_turn(row, leg).swing_m for leg in legs]
            lines.append(
                _line(
                    [
                        f"{row.speed_m_s:g}",
                        f"{row.radius_m:g}",
                        *(f"{swing:.1f}" for swing in swings),
                    ]
                )
            )
        lines.append("")
    if table.speed_changes:
        lines += ["Changes of speed at a waypoint on a straight line, extra seconds:", ""]
        lines += [_line(["steering", "from m/s", "to m/s", "s"]), _line(["---"] * 4)]
        lines += [
            _line([c.steering, f"{c.from_m_s:g}", f"{c.to_m_s:g}", _signed(c.extra_s)])
            for c in table.speed_changes
        ]
        lines.append("")
    return "\n".join(lines)


def _turn(row: TimeRow, leg_m: float) -> ChainCost:
    return next(
        c for c in row.chains if c.kind == "turn" and c.leg_m == leg_m and c.angle_deg == 90.0
    )


def _signed(value: float) -> str:
    return f"{value:.1f}".replace("-", "−") if abs(value) >= 0.05 else "0.0"


def _line(cells: Sequence[str]) -> str:
    return "| " + " | ".join(cells) + " |"

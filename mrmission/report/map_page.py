"""``map.html``: one self-contained page that opens offline."""

from __future__ import annotations

import json
import re
from collections.abc import Iterable
from html import escape
from importlib.resources import files
from typing import Any

from mrmission.model import FleetPlan
from mrmission.report.colours import robot_colour
from mrmission.report.map_data import map_data
from mrmission.report.units import (
    assumed_lines,
    fleet_figures,
    human_duration,
    human_length,
    human_share,
)

_PLACEHOLDER = re.compile(r"\{\{(\w+)\}\}")


def map_html(plan: FleetPlan) -> str:
    """Return the map of a plan as one HTML file without any outside resource.

    Parameters
    ----------
    plan
        The plan.

    Returns
    -------
    str
        The page; the same bytes for the same plan.
    """
    report = plan.report
    values = {
        "title": escape(plan.area.name),
        "summary": _summary(plan),
        "style": _resource("map.css"),
        "script": _resource("map.js"),
        "data": script_json(map_data(plan)),
        "figures": _definitions(fleet_figures(report)),
        "robots": _robot_rows(plan),
        "assumed": _definitions(assumed_lines(report)),
        "assumed_hidden": "" if report.assumed else "hidden",
        "notes": _items(dict.fromkeys((*plan.area.notes, *report.notes))),
        "notes_hidden": "" if plan.area.notes or report.notes else "hidden",
        "source": escape(plan.area.source),
        "versions": escape(
            ", ".join(f"{name} {report.versions[name]}" for name in sorted(report.versions))
        ),
    }
    # One pass, so that a placeholder inside a value stays what it is: text.
    return _PLACEHOLDER.sub(lambda match: values[match[1]], _resource("map.html"))


def script_json(value: Any) -> str:
    r"""Return JSON that is safe inside a ``<script>`` element.

    Parameters
    ----------
    value
        Plain JSON.

    Returns
    -------
    str
        Compact ASCII JSON in which ``<``, ``>`` and ``&`` are escaped.

    Examples
    --------
    >>> script_json("</script>")
    '"\\u003c/script\\u003e"'
    """
    text = json.dumps(value, separators=(",", ":"), allow_nan=False)
    for character in "<>&":
        text = text.replace(character, f"\\u{ord(character):04x}")
    return text


def _resource(name: str) -> str:
    return (files("mrmission.report") / name).read_text(encoding="utf-8")


def _summary(plan: FleetPlan) -> str:
    report = plan.report
    count = len(report.robots)
    return escape(
        f"{count} robot{'' if count == 1 else 's'}, everybody home after "
        f"{human_duration(report.makespan_s)}, {human_share(report.coverage)} covered"
    )


def _definitions(rows: Iterable[tuple[str, str]]) -> str:
    return "".join(f"<dt>{escape(name)}</dt><dd>{escape(value)}</dd>" for name, value in rows)


def _items(lines: Iterable[str]) -> str:
    return "".join(f"<li>{escape(line)}</li>" for line in lines)


def _robot_rows(plan: FleetPlan) -> str:
    rows = []
    longest_s = max((row.duration_s for row in plan.report.robots), default=0.0)
    for row in plan.report.robots:
        robot = row.robot
        colours = f"--light:{robot_colour(robot)};--dark:{robot_colour(robot, dark=True)}"
        kind = ' class="longest"' if row.duration_s >= longest_s > 0 else ""
        rows.append(
            f'<tr{kind} data-robot="{robot}">'
            f'<th scope="row"><label><input type="checkbox" class="robot" value="{robot}" checked '
            f'aria-label="Show robot {robot}"><span class="swatch" style="{colours}"></span>'
            f"{robot}</label></th>"
            f"<td>{human_duration(row.duration_s)}</td><td>{human_length(row.length_m)}</td>"
            f"<td>{row.lanes or 'no work'}</td><td>{row.items}</td></tr>"
        )
    return "\n".join(rows)

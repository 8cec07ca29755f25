"""``report.json``: every number of a :class:`~mrmission.model.FleetReport` as plain JSON."""

from __future__ import annotations

import json
import math
from collections.abc import Mapping
from dataclasses import fields, is_dataclass
from typing import Any

import numpy as np

from mrmission.model import FleetPlan
from mrmission.report.units import (
    human_area,
    human_duration,
    human_gap,
    human_length,
    human_share,
    unreached_text,
)


def plain(value: Any) -> Any:
    """Return a value as plain JSON: dataclasses to dicts, arrays to lists, NaN to None.

    Parameters
    ----------
    value
        Anything made of dataclasses, mappings, sequences, numpy values and scalars.

    Returns
    -------
    Any
        The same made of dict (sorted by key), list, str, int, float, bool and None.

    Raises
    ------
    TypeError
        When a value has no JSON form.

    Examples
    --------
    >>> plain({"b": float("nan"), "a": (1, 2)})
    {'a': [1, 2], 'b': None}
    """
    if value is None or isinstance(value, bool | str):
        return value
    if isinstance(value, np.generic | np.ndarray):
        return plain(value.tolist())
    if isinstance(value, int):
        return int(value)
    if isinstance(value, float):
        return value if math.isfinite(value) else None
    if is_dataclass(value) and not isinstance(value, type):
        names = sorted(item.name for item in fields(value))
        return {name: plain(getattr(value, name)) for name in names}
    if isinstance(value, Mapping):
        return {str(key): plain(value[key]) for key in sorted(value, key=str)}
    if isinstance(value, set | frozenset):
        return sorted((plain(item) for item in value), key=repr)
    if isinstance(value, list | tuple):
        return [plain(item) for item in value]
    raise TypeError(f"no JSON form for {type(value).__name__}: {value!r}")


def report_json(plan: FleetPlan) -> dict[str, Any]:
    """Return the content of ``report.json``.

    Parameters
    ----------
    plan
        The plan.

    Returns
    -------
    dict
        Every field of the report, and the area's ``name``, ``source`` and ``notes`` under
        ``area``. Keys are sorted; a number that is not known (NaN, infinite) is None.
    """
    content = dict(plain(plan.report))
    content["area"] = {
        "name": plan.area.name,
        "notes": list(plan.area.notes),
        "source": plan.area.source,
    }
    return dict(sorted(content.items()))


def report_text(plan: FleetPlan) -> str:
    """Return ``report.json`` as text, the same bytes for the same plan.

    Parameters
    ----------
    plan
        The plan.

    Returns
    -------
    str
        Indented JSON with sorted keys, one line feed at the end.
    """
    content = report_json(plan)
    return json.dumps(content, indent=2, sort_keys=True, allow_nan=False, ensure_ascii=False) + "\n"


def summary_lines(plan: FleetPlan) -> tuple[str, ...]:
    """Return the plan in a few lines of plain text, for logs and small terminals.

    Parameters
    ----------
    plan
        The plan.

    Returns
    -------
    tuple of str
        One fact a line.
    """
    report = plan.report
    total_m = sum(row.length_m for row in report.robots)
    items = sum(row.items for row in report.robots)
    idle = [str(row.robot) for row in report.robots if row.lanes == 0]
    covered = (
        f"covered: {human_share(report.coverage)} of the navigable region "
        f"({human_share(report.coverage_survey_legs)} by survey legs alone), "
        f"{human_share(report.coverage_of_area)} of the whole area"
    )
    size = (
        f"{plan.area.name}: {human_area(report.area_m2)} of water, "
        f"{human_area(report.navigable_m2)} navigable, {len(report.robots)} robots, "
        f"{human_length(total_m)} and {items} mission items in all"
    )
    time = (
        f"home after {human_duration(report.makespan_s)} ({report.method}); no plan is faster than "
        f"{human_duration(report.lower_bound_s)} ({report.lower_bound_name}), "
        f"gap {human_gap(report.gap)}"
    )
    if report.lanes_bound_s is not None and report.lanes_gap is not None:
        time += (
            f"; none with these lanes and cuts than {human_duration(report.lanes_bound_s)} "
            f"({report.lanes_bound_name}), gap {human_gap(report.lanes_gap)}"
        )
    lines = [size, time, covered]
    if report.unreached_parts_m2 or report.unreached_m2 > 0:
        lines.append(f"not reached from the start: {unreached_text(report)}")
    if idle:
        lines.append(f"without work: robot {', '.join(idle)}")
    return tuple(lines)

"""Numbers as people read them: lengths, durations, areas, shares; and the lines made of them."""

from __future__ import annotations

import math
import re
from collections.abc import Mapping
from typing import Any

from mrmission.model import FleetReport, TieReport

UNKNOWN = "–"
"""Shown where a number is not known (NaN or infinite)."""


def human_length(length_m: float) -> str:
    """Return a length as text: metres below 1 km, else kilometres.

    Parameters
    ----------
    length_m
        Length, m.

    Returns
    -------
    str
        The text.

    Examples
    --------
    >>> human_length(12.3), human_length(999.6), human_length(12345.0)
    ('12 m', '1.00 km', '12.35 km')
    """
    if not math.isfinite(length_m):
        return UNKNOWN
    if round(length_m) < 1000:
        return f"{length_m:.0f} m" if length_m >= 10 or length_m == 0 else f"{length_m:.1f} m"
    return f"{length_m / 1000:.2f} km" if length_m < 99_995 else f"{length_m / 1000:.0f} km"


def human_duration(duration_s: float) -> str:
    """Return a duration as text: hours and minutes from an hour on, then minutes and seconds.

    Parameters
    ----------
    duration_s
        Duration, s.

    Returns
    -------
    str
        The text.

    Examples
    --------
    >>> human_duration(20), human_duration(59.7), human_duration(754), human_duration(7261)
    ('20 s', '1 min 00 s', '12 min 34 s', '2 h 01 min')
    """
    if not math.isfinite(duration_s):
        return UNKNOWN
    seconds = round(duration_s)
    if seconds < 60:
        return f"{seconds} s"
    if seconds < 3600:
        return f"{seconds // 60} min {seconds % 60:02d} s"
    minutes = round(duration_s / 60)
    return f"{minutes // 60} h {minutes % 60:02d} min"


def human_area(area_m2: float) -> str:
    """Return an area as text: m² below 0.1 km², else km².

    Parameters
    ----------
    area_m2
        Area, m².

    Returns
    -------
    str
        The text.

    Examples
    --------
    >>> human_area(0.04), human_area(15000.0), human_area(1_234_567.0)
    ('0.04 m²', '15,000 m²', '1.235 km²')
    """
    if not math.isfinite(area_m2):
        return UNKNOWN
    if area_m2 >= 100_000:
        return f"{area_m2 / 1e6:.3f} km²" if area_m2 < 1e8 else f"{area_m2 / 1e6:.1f} km²"
    return f"{area_m2:,.0f} m²" if area_m2 >= 10 or area_m2 == 0 else f"{area_m2:.2g} m²"


def human_share(share: float) -> str:
    """Return a share as per cent, cut and never rounded up: 100 % means all of it.

    Parameters
    ----------
    share
        Share, 1 is all.

    Returns
    -------
    str
        The text.

    Examples
    --------
    >>> human_share(1.0), human_share(0.999996), human_share(0.5)
    ('100 %', '99.99 %', '50.00 %')
    """
    if not math.isfinite(share):
        return UNKNOWN
    if share >= 1:
        return "100 %"
    # The tiny addend keeps 0.29 * 100 = 28.999999999999996 from being cut to 28.99.
    return f"{math.floor(share * 10_000 + 1e-9) / 100:.2f} %"


def human_chance(chance: float) -> str:
    """Return a probability in whole percent, and never a small one as none."""
    return "below 1%" if chance < 0.005 else f"{chance:.0%}"


def human_gap(gap: float) -> str:
    """Return an optimality gap as per cent, rounded up to a tenth so that it never flatters.

    Parameters
    ----------
    gap
        Makespan over lower bound, minus 1.

    Returns
    -------
    str
        The text.

    Examples
    --------
    >>> human_gap(0.0), human_gap(0.10001)
    ('0.0 %', '10.1 %')
    """
    if not math.isfinite(gap):
        return UNKNOWN
    return f"{math.ceil(gap * 1000 - 1e-9) / 10:.1f} %"


def human_lonlat(lon_deg: float, lat_deg: float) -> str:
    """Return a position as text, longitude first, six decimals (0.1 m).

    Parameters
    ----------
    lon_deg
        Longitude, degrees; brought into -180..180.
    lat_deg
        Latitude, degrees.

    Returns
    -------
    str
        The text, as ``--start`` takes it.

    Examples
    --------
    >>> human_lonlat(181.5, -3.25)
    '-178.500000,-3.250000'
    """
    lon_deg = (lon_deg + 180.0) % 360.0 - 180.0
    return f"{lon_deg:.6f},{lat_deg:.6f}"


_UNITS = (
    ("_m_s", " m/s"),
    ("_m2", " m²"),
    ("_m", " m"),
    ("_s", " s"),
    ("_deg", "°"),
)
_NAMES = {"starts_lonlat": "start", "robots": "robots (k)", "clearance_m": "clearance from shore"}


def human_option(name: str, value: Any) -> tuple[str, str]:
    """Return an option's name and value as a person reads them.

    Parameters
    ----------
    name
        Field of :class:`mrmission.options.PlanOptions`, or a flag.
    value
        Its value.

    Returns
    -------
    tuple of str
        Name without unit, value with unit.

    Examples
    --------
    >>> human_option("swath_m", 20.0), human_option("overlap", 0.1)
    (('swath', '20 m'), ('overlap', '10 %'))
    """
    label, unit = name, ""
    for suffix, text in _UNITS:
        if name.endswith(suffix):
            label, unit = name.removesuffix(suffix), text
            break
    label = _NAMES.get(name, label.removeprefix("--").replace("_", " ").replace("-", " "))
    if value is None:
        return label, "automatic"
    if isinstance(value, bool):
        return label, "yes" if value else "no"
    if isinstance(value, int | float):
        if name.endswith("overlap"):
            return label, f"{value * 100:g} %"
        return label, f"{value:g}{unit}"
    if isinstance(value, Mapping):
        inner = (" ".join(human_option(str(key), item)) for key, item in sorted(value.items()))
        return label, ", ".join(inner)
    if isinstance(value, list | tuple):
        pair = len(value) == 2 and all(isinstance(item, int | float) for item in value)
        if pair:
            return label, human_lonlat(float(value[0]), float(value[1]))
        return label, ", ".join(human_option("", item)[1] for item in value) or "none"
    return label, str(value)


def assumed_lines(report: FleetReport) -> tuple[tuple[str, str], ...]:
    """Return what the user did not give and the program assumed, sorted by name.

    Parameters
    ----------
    report
        The report.

    Returns
    -------
    tuple of (str, str)
        Name and value of each assumption.
    """
    return tuple(human_option(name, report.assumed[name]) for name in sorted(report.assumed))


def fleet_figures(report: FleetReport) -> tuple[tuple[str, str], ...]:
    """Return the fleet's figures in reading order, the same in the table and on the map.

    Parameters
    ----------
    report
        The report.

    Returns
    -------
    tuple of (str, str)
        Name and value of each figure.
    """
    at_work = round(report.utilization * len(report.robots))
    # Coverage is counted over what the starts reach; where that is not all, the name says so.
    counted = "navigable region" if report.unreached_m2 <= 0 else "reached part"
    rows = [
        ("Makespan (longest robot)", human_duration(report.makespan_s)),
        *_delays(report),
        *_bounds(report),
        ("Method", report.method),
        (
            "Robots that survey",
            human_share(report.utilization)
            if report.utilization >= 1
            else f"{at_work} of {len(report.robots)}",
        ),
        (f"Coverage of the {counted}, all legs", human_share(report.coverage)),
        ("… survey legs alone", human_share(report.coverage_survey_legs)),
        ("… as a share of the whole survey area", human_share(report.coverage_of_area)),
        ("Largest missed piece", human_area(report.largest_missed_m2)),
        ("Survey area", human_area(report.area_m2)),
        ("Navigable region", human_area(report.navigable_m2)),
        ("Unreached", unreached_text(report)),
        ("Lanes", lanes_text(report)),
    ]
    if report.tie_lines is not None:
        rows.append(("Tie lines", tie_text(report.tie_lines)))
    return tuple(rows)


def lanes_text(report: FleetReport) -> str:
    """Return how the lanes lie, and how many lie across them."""
    text = f"{human_length_fine(report.lane_spacing_m)} apart, {report.angle_deg:g}°"
    # F3, F3b and F3-2 are pieces of one lane
    rows = {re.split("[a-z-]", line.name)[0] for line in report.lines if line.kind == "fairway"}
    across = len(rows)
    return f"{text}; {across} across, in the fairway" if across else text


def tie_text(ties: TieReport) -> str:
    """Return how many tie lines there are, and how many lanes they check.

    Parameters
    ----------
    ties
        The tie lines of a plan.

    Returns
    -------
    str
        The text.
    """
    share = ties.length_m / ties.lanes_m if ties.lanes_m > 0 else 0.0
    return (
        f"{ties.ties}, {human_length(ties.length_m)} ({share:.1%} of the other lines), "
        f"{ties.crossings} crossings; {ties.lanes_crossed} of {ties.lanes} lanes are crossed"
    )


def _bounds(report: FleetReport) -> tuple[tuple[str, str], ...]:
    """Return what nothing can beat and how far the plan is from it, for these lanes and for any."""
    any_plan = (
        (f"Bound for any plan ({report.lower_bound_name})", human_duration(report.lower_bound_s)),
        ("Gap to any plan's bound", human_gap(report.gap)),
    )
    if report.lanes_bound_s is None or report.lanes_gap is None:
        return any_plan
    return (
        (
            f"Bound for these lanes ({report.lanes_bound_name})",
            human_duration(report.lanes_bound_s),
        ),
        ("Gap to these lanes' bound", human_gap(report.lanes_gap)),
        *any_plan,
    )


def _delays(report: FleetReport) -> list[tuple[str, str]]:
    """Return how much of the makespan is waiting, and how near robots may come."""
    out = []
    tour_s = max((row.duration_s for row in report.robots), default=0.0)
    if round(report.makespan_s - tour_s) > 0:
        waiting = human_duration(report.makespan_s - tour_s)
        out.append(("… of it for start delays", waiting))
    kept = report.separation
    least = [pair.least_m for pair in kept.pairs if pair.least_m is not None]
    if kept.distance_m <= 0 or not least:
        return out
    error = f"times ± {kept.time_share:.0%}"
    if not kept.conflicts:
        out.append((f"Least distance of two robots, {error}", human_length(min(least))))
    else:
        near = sum(1 for value in least if value < kept.distance_m)
        text = f"{len(kept.conflicts)} places, {near} of {len(kept.pairs)} pairs"
        out.append((f"May come within {kept.distance_m:g} m, {error}", text))
    return out


def human_length_fine(length_m: float) -> str:
    """Return a short length with up to two decimals.

    Parameters
    ----------
    length_m
        Length, m.

    Returns
    -------
    str
        The text.

    Examples
    --------
    >>> human_length_fine(17.982), human_length_fine(18.0)
    ('17.98 m', '18 m')
    """
    if not math.isfinite(length_m):
        return UNKNOWN
    return f"{round(length_m, 2):g} m"


def unreached_text(report: FleetReport) -> str:
    """Return the unreached area and its parts, largest first.

    Parameters
    ----------
    report
        The report.

    Returns
    -------
    str
        ``none``, or the area with the number and sizes of the parts.
    """
    parts = sorted(report.unreached_parts_m2, reverse=True)
    if not parts and report.unreached_m2 <= 0:
        return "none"
    sizes = ", ".join(human_area(part) for part in parts[:3]) + (", …" if len(parts) > 3 else "")
    noun = "part" if len(parts) == 1 else "parts"
    return f"{human_area(report.unreached_m2)} in {len(parts)} {noun} ({sizes})"

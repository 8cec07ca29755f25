"""Quantities as people write them, with units: ``45min``, ``2 h``, ``12km``, ``3 kn``, ``20%``.

A number without a unit has the unit of the thing asked for (metres, m/s, seconds, a share), except
where it could be two things: an endurance is a time or a distance, and must say which.
"""

from __future__ import annotations

import math
import re
from collections.abc import Mapping

LENGTHS_M: Mapping[str, float] = {
    "mm": 0.001, "cm": 0.01, "m": 1.0, "km": 1000.0, "nmi": 1852.0, "ft": 0.3048, "mi": 1609.344,
}  # fmt: skip
SPEEDS_M_S: Mapping[str, float] = {
    "m/s": 1.0, "km/h": 1.0 / 3.6, "kn": 1852.0 / 3600.0, "mph": 0.44704,
}  # fmt: skip
TIMES_S: Mapping[str, float] = {
    "s": 1.0, "sec": 1.0, "min": 60.0, "h": 3600.0, "hours": 3600.0, "minutes": 60.0,
    "hour": 3600.0, "minute": 60.0, "seconds": 1.0,
}  # fmt: skip
_ONE = re.compile(r"\s*([+-]?(?:\d+\.?\d*|\.\d+)(?:e[+-]?\d+)?)\s*([a-z%/]*)", re.IGNORECASE)


def _parts(value: object) -> list[tuple[float, str]]:
    """Return the numbers and units of a value: ``1 h 30 min`` has two."""
    if isinstance(value, bool):
        raise ValueError("is neither a number nor a text")
    if isinstance(value, int | float):
        return [(float(value), "")]
    if not isinstance(value, str) or not value.strip():
        raise ValueError("is neither a number nor a text like '12 m'")
    text, at, out = value.rstrip(), 0, []
    while at < len(text):
        found = _ONE.match(text, at)
        if found is None:
            raise ValueError("is not a number with a unit")
        out.append((float(found[1]), found[2].lower()))
        at = found.end()
    return out


def _sum(value: object, units: Mapping[str, float], bare: bool) -> float:
    parts = _parts(value)
    known = ", ".join(units)
    total = 0.0
    for number, unit in parts:
        if not unit and (not bare or len(parts) > 1):
            raise ValueError(f"needs a unit: one of {known}")
        if unit and unit not in units:
            raise ValueError(f"has an unknown unit {unit!r}: one of {known}")
        total += number * units.get(unit, 1.0)
    if not math.isfinite(total):
        raise ValueError("is not finite")
    return total


def length_m(value: object) -> float:
    """Return a length, m.

    Parameters
    ----------
    value
        A number of metres, or a text with a unit of :data:`LENGTHS_M`.

    Raises
    ------
    ValueError
        When it is neither; the text says what is wrong, without the value.

    Examples
    --------
    >>> length_m("12km"), length_m(3), length_m("30 ft")
    (12000.0, 3.0, 9.144)
    """
    return _sum(value, LENGTHS_M, bare=True)


def speed_m_s(value: object) -> float:
    """Return a speed, m/s, of a number of m/s or a text with a unit of :data:`SPEEDS_M_S`.

    Examples
    --------
    >>> speed_m_s("1.5 m/s"), speed_m_s("3.6km/h"), round(speed_m_s("3 kn"), 3)
    (1.5, 1.0, 1.543)
    """
    return _sum(value, SPEEDS_M_S, bare=True)


def time_s(value: object) -> float:
    """Return a time, s, of a number of seconds or a text with units of :data:`TIMES_S`.

    Examples
    --------
    >>> time_s("45min"), time_s("1h30min"), time_s("2 h"), time_s(90)
    (2700.0, 5400.0, 7200.0, 90.0)
    """
    return _sum(value, TIMES_S, bare=True)


def share(value: object) -> float:
    """Return a share, 1 being all, of a number or a text in per cent.

    Examples
    --------
    >>> share("20%"), share(0.2), share("5 %")
    (0.2, 0.2, 0.05)
    """
    return _sum(value, {"%": 0.01}, bare=True)


def endurance(value: object) -> tuple[float | None, float | None]:
    """Return an endurance as (seconds, metres), one of them None.

    Examples
    --------
    >>> endurance("45min"), endurance("12 km")
    ((2700.0, None), (None, 12000.0))
    """
    units = {unit for _, unit in _parts(value)}
    if units <= LENGTHS_M.keys():
        return None, _sum(value, LENGTHS_M, bare=False)
    if units <= TIMES_S.keys():
        return _sum(value, TIMES_S, bare=False), None
    raise ValueError("must be a time (45min, 2 h) or a distance (12km, 800 m)")

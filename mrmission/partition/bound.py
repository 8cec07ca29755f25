"""Lower bounds on the makespan: no plan can beat them."""

from __future__ import annotations

import math


def area_bound_s(covered_m2: float, swath_m: float, robots: int, top_speed_m_s: float) -> float:
    """Return the area bound: the longest of `robots` tours takes at least this many seconds.

    Everything within swath/2 of a path of length L measures at most ``L·swath + π·swath²/4``
    (the area of its parallel body; overlaps only make it smaller). k paths of length at most L
    that cover the area A between them therefore have ``k·(L·swath + π·swath²/4) >= A``, and no
    vehicle is faster than its top speed.

    Parameters
    ----------
    covered_m2
        Area that the tours cover, m².
    swath_m
        Width of the footprint, m.
    robots
        Number of robots.
    top_speed_m_s
        Fastest speed at which any of them moves.

    Examples
    --------
    >>> round(area_bound_s(1000.0 * 20.0, 20.0, 1, 2.0), 1)
    492.1
    """
    length_m = covered_m2 / (swath_m * robots) - math.pi * swath_m / 4
    return max(0.0, length_m / top_speed_m_s)

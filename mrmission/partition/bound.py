"""Lower bounds on the makespan: no plan can beat them."""

from __future__ import annotations

import math
from collections.abc import Sequence


def fleet_area_bound_s(
    covered_m2: float, swaths_m: Sequence[float], top_speeds_m_s: Sequence[float]
) -> float:
    """Return the area bound of robots that differ.

    Proof. Let all be home after T seconds. Robot i, with swath w_i and top speed v_i, has then gone
    a way of at most v_i·T, all its trips one after the other: they begin and end at its home, so
    together they are one path, and waiting there adds nothing. What lies within w_i/2 of it
    measures at most v_i·T·w_i + π·w_i²/4. The robots cover the area A between them, so
    T·Σ v_i·w_i + Σ π·w_i²/4 >= A: no T below (A − Σ π·w_i²/4) / Σ v_i·w_i will do. ∎

    It does not matter that lanes are spaced for the narrowest swath: each robot is granted its own.

    Parameters
    ----------
    covered_m2
        Area that the robots cover together, m².
    swaths_m, top_speeds_m_s
        Of each robot.

    Examples
    --------
    >>> round(fleet_area_bound_s(5e4, [20.0, 30.0], [2.0, 1.0]), 1)
    699.7
    """
    ends_m2 = math.fsum(math.pi * w * w / 4 for w in swaths_m)
    rate_m2_s = math.fsum(w * v for w, v in zip(swaths_m, top_speeds_m_s, strict=True))
    return max(0.0, (covered_m2 - ends_m2) / rate_m2_s)

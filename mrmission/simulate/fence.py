"""Whether a position is inside a vehicle's fence, and how far outside."""

from __future__ import annotations

import math
from collections.abc import Sequence

from mrmission.simulate.motion import offset_m
from mrmission.simulate.storage import CIRCLE_IN, CIRCLE_OUT, EXCLUSION, INCLUSION, Item


def polygon_breach_m(items: Sequence[Item], lat: float, lon: float, *, union: bool) -> float | None:
    """Return how far a position is outside the areas of a fence, None where it is inside.

    Parameters
    ----------
    items : sequence of Item
        A complete, valid fence.
    lat, lon : float
        Degrees.
    union : bool
        Whether one inclusion area is enough (otherwise all count).

    Returns
    -------
    float or None
        Metres to the nearest edge of a breached area.
    """
    breaches: list[float] = []
    inclusions = breached_inclusions = 0
    index = 0
    while index < len(items):
        item = items[index]
        if item.command in (INCLUSION, EXCLUSION):
            size = int(item.param1)
            ring = [offset_m(lat, lon, i.x * 1e-7, i.y * 1e-7) for i in items[index : index + size]]
            inside, away = _point_in_ring(ring)
            include = item.command == INCLUSION
            index += size
        elif item.command in (CIRCLE_IN, CIRCLE_OUT):
            gap = math.hypot(*offset_m(lat, lon, item.x * 1e-7, item.y * 1e-7)) - item.param1
            inside, away, include = gap <= 0, abs(gap), item.command == CIRCLE_IN
            index += 1
        else:
            index += 1
            continue
        if include:
            inclusions += 1
            if not inside:
                breached_inclusions += 1
                breaches.append(away)
        elif inside:
            return max([away, *breaches])
    if breached_inclusions == 0 or (union and breached_inclusions < inclusions):
        return None
    return min(breaches) if union else max(breaches)


def _point_in_ring(ring: Sequence[tuple[float, float]]) -> tuple[bool, float]:
    """Return whether the origin lies inside a ring, and its distance to the ring."""
    inside, nearest = False, math.inf
    x1, y1 = ring[-1]
    for x2, y2 in ring:
        if (y1 > 0) != (y2 > 0) and x1 - y1 * (x2 - x1) / (y2 - y1) > 0:
            inside = not inside
        dx, dy = x2 - x1, y2 - y1
        square = dx * dx + dy * dy
        t = 0.0 if square == 0 else min(1.0, max(0.0, -(x1 * dx + y1 * dy) / square))
        nearest = min(nearest, math.hypot(x1 + t * dx, y1 + t * dy))
        x1, y1 = x2, y2
    return inside, nearest

"""The least that a way with a reversal can take once the reversal has been made gentle.

When a path is finished, a steered boat's reversals may be replaced
(:mod:`mrmission.tour.reversals`): one or two points are put into a leg beside them. For a lower
bound every such replacement is looked at here, as if the water had room for all of them, at no more
than the time model counts for it.
"""

from __future__ import annotations

import math

import numpy as np
from numba import njit

from mrmission.minmax.ways import Ways
from mrmission.model import FloatArray, IntArray
from mrmission.tour.reversals import ASIDE_DEG, ASIDE_M, GENTLE_DEG, REVERSAL_DEG
from mrmission.tour.timing import TimeModel

CELLS_PER_DEG = 4
CELLS_PER_M = 8
"""Curves are looked up in cells, each at its least."""
STUB_M = 1000.0
"""Lines are so long: they stay where they are, only their direction matters."""
ROUNDING_DEG = 1e-6


def gentlest_s(
    ways: Ways, which: IntArray, out: FloatArray, into: FloatArray, time: TimeModel
) -> FloatArray:
    """Return what ways with one reversal take at least when it is replaced.

    Parameters
    ----------
    ways
        Ways that are not swept.
    which
        (n,) those with one reversal, at their points, first and last included.
    out, into
        (ways, 2) unit vectors in which the lane before is left, and the lane after entered.
    time
        What corners and short legs take.

    Returns
    -------
    (n,) array
        Seconds, the corners at both ends included; infinite where no replacement is gentle.
    """
    corner = _least_per_cell(
        [(c.angle_deg, c.corner_s) for c in (time.survey, time.transit)], 180.0, CELLS_PER_DEG
    )
    longest = float(max(c.leg_m[-1] for c in (time.survey, time.transit)))
    curves = (time.survey, time.transit)
    first = _least_per_cell([(c.leg_m, c.first_s) for c in curves], longest, CELLS_PER_M)
    each = _least_per_cell(
        [(c.leg_m, np.minimum(c.bend_s, c.zigzag_s)) for c in curves], longest, CELLS_PER_M
    )
    seconds: FloatArray = _gentlest(
        ways.start,
        ways.points_m,
        which,
        out,
        into,
        1.0 / time.transit_speed_m_s,
        corner,
        first,
        each,
        np.radians(np.array(ASIDE_DEG)),
        np.array(ASIDE_M),
        math.radians(GENTLE_DEG + ROUNDING_DEG),
    )
    change = 0.0
    if time.accel_m_s2 is not None:  # once from the lane's speed to the way's, once back
        for u, v in (
            (time.survey_speed_m_s, time.transit_speed_m_s),
            (time.transit_speed_m_s, time.survey_speed_m_s),
        ):
            change += math.copysign((v - u) ** 2 / (2.0 * time.accel_m_s2 * v), v - u)
    return seconds + min(0.0, change)


def _least_per_cell(
    curves: list[tuple[FloatArray, FloatArray]], most: float, per_unit: int
) -> FloatArray:
    """Return the least of piecewise linear curves in each cell of 1 / per_unit from 0 to `most`.

    One more cell stands for all beyond.
    """
    cells = math.ceil(most * per_unit)
    edge = np.arange(cells + 1) / per_unit
    out = np.full(cells + 1, np.inf)
    for at, value in curves:
        height = np.interp(edge, at, value)
        inner = np.minimum(height[:-1], height[1:])
        node = np.clip((at * per_unit).astype(np.int64), 0, cells - 1)
        np.minimum.at(inner, node, value)
        out[:-1] = np.minimum(out[:-1], inner)
        out[-1] = min(out[-1], float(value[-1]))
    return out


@njit(cache=True, inline="always")
def _cell(values, at):  # type: ignore[no-untyped-def]
    return values[min(int(at), len(values) - 1)]


@njit(cache=True, inline="always")
def _turn(a, b):  # type: ignore[no-untyped-def]
    """Return the change of course between two headings, radians, 0 to pi."""
    d = abs(a - b)
    while d > 2 * math.pi:
        d -= 2 * math.pi
    return min(d, 2 * math.pi - d)


@njit(cache=True, error_model="numpy")
def _gentlest(  # type: ignore[no-untyped-def]
    start, points, which, out, into, pace, corner, first, each, aside, far, gentle
):
    """Return for each way the least seconds over all replacements of its reversal."""
    result = np.full(len(which), np.inf)
    per_rad = 180.0 / math.pi * CELLS_PER_DEG
    most = 0
    for w in which:
        most = max(most, start[w + 1] - start[w])
    chain = np.empty((most + 2, 2))
    heading = np.empty(most + 1)
    length = np.empty(most + 1)
    for row in range(len(which)):
        w = which[row]
        for turned in range(2):  # a detour before a reversal is one behind it, backwards
            n = start[w + 1] - start[w] + 2
            for i in range(n - 2):
                at = start[w] + i if turned == 0 else start[w + 1] - 1 - i
                chain[i + 1] = points[at]
            head = out[w] if turned == 0 else -into[w]
            tail = into[w] if turned == 0 else -out[w]
            chain[0] = chain[1] - STUB_M * head
            chain[n - 1] = chain[n - 2] + STUB_M * tail
            for i in range(n - 1):
                dx, dy = chain[i + 1, 0] - chain[i, 0], chain[i + 1, 1] - chain[i, 1]
                length[i] = math.hypot(dx, dy)
                # a leg of no length goes on as the one before
                heading[i] = math.atan2(dy, dx) if length[i] > 0 or i == 0 else heading[i - 1]
            for at in range(1, n - 2):  # the reversal, and the leg behind it that is replaced
                if (
                    _turn(heading[at - 1], heading[at]) * 180.0 / math.pi
                    < REVERSAL_DEG - ROUNDING_DEG
                ):
                    continue
                rest, dearest = 0.0, 0.0
                for i in range(1, n - 1):
                    if i != at and i != at + 1:
                        rest += _cell(corner, _turn(heading[i - 1], heading[i]) * per_rad)
                    if i < n - 2 and i != at and length[i] > 0:
                        rest += length[i] * pace + _cell(each, length[i] * CELLS_PER_M)
                        dearest = max(dearest, _cell(first, length[i] * CELLS_PER_M))
                behind = _turn(heading[at], heading[at + 1])
                allowed = max(gentle, behind + 1e-9)
                for side in (1.0, -1.0):
                    for shape in range(len(aside) + len(far)):
                        angle = aside[shape] if shape < len(aside) else math.pi / 2
                        for j in range(len(far)):
                            h = heading[at - 1] + side * angle
                            x = chain[at, 0] + far[j] * math.cos(h)
                            y = chain[at, 1] + far[j] * math.sin(h)
                            seconds = far[j] * pace + _cell(each, far[j] * CELLS_PER_M)
                            dear = max(dearest, _cell(first, far[j] * CELLS_PER_M))
                            seconds += _cell(corner, angle * per_rad)
                            if shape >= len(aside):  # and back beside the way on which it came
                                along = far[shape - len(aside)]
                                x -= along * math.cos(heading[at - 1])
                                y -= along * math.sin(heading[at - 1])
                                seconds += along * pace + _cell(each, along * CELLS_PER_M)
                                dear = max(dear, _cell(first, along * CELLS_PER_M))
                                seconds += _cell(corner, math.pi / 2 * per_rad)
                                h = heading[at - 1] + math.pi
                            dx, dy = chain[at + 1, 0] - x, chain[at + 1, 1] - y
                            last = math.hypot(dx, dy)
                            if last > 0:
                                g = math.atan2(dy, dx)
                                seconds += last * pace + _cell(each, last * CELLS_PER_M)
                                dear = max(dear, _cell(first, last * CELLS_PER_M))
                            else:
                                g = h
                            one, two = _turn(h, g), _turn(g, heading[at + 1])
                            if one > gentle or two > allowed:
                                continue
                            seconds += _cell(corner, one * per_rad) + _cell(corner, two * per_rad)
                            result[row] = min(result[row], seconds + dear + rest)
    return result

"""What manoeuvres cost: a track is cut at the middles of the long legs around each."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
import shapely

from mrmission.calibrate.courses import Course, Manoeuvre
from mrmission.errors import SimulatorError
from mrmission.model import FloatArray

GATE_SHARE = 0.25
"""A leg's middle is passed within this share of the leg's length to its side."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Measured:
    """One manoeuvre as it was sailed.

    Attributes
    ----------
    manoeuvre
        Which.
    extra_s
        Seconds over length / speed between the middles of the legs around it.
    swing_m
        Largest distance of the boat from the course.
    beyond_m
        How far the boat went beyond the first corner, in the direction of the leg that leads to it.
    """

    manoeuvre: Manoeuvre
    extra_s: float
    swing_m: float
    beyond_m: float


@dataclass(frozen=True, slots=True, kw_only=True)
class CourseResult:
    """All manoeuvres of one course, and its start.

    Attributes
    ----------
    measured
        By manoeuvre, in order.
    start_s
        Seconds over length / speed from the start order to the middle of the first leg.
    end_s
        The same from the middle of the last leg to the last waypoint.
    speed_share
        Speed on the second half of the straight run-in over the speed ordered.
    """

    measured: tuple[Measured, ...]
    start_s: float
    end_s: float
    speed_share: float


def middle_times(course: Course, time_s: FloatArray, points_m: FloatArray) -> FloatArray:
    """Return when a track passes the middle of each leg of a course, NaN for short legs passed by.

    Parameters
    ----------
    course
        What was to be sailed.
    time_s, points_m
        (n,) rising times and (n, 2) positions of the track, in the course's frame.
    """
    return np.fromiter(_middles(course, time_s, points_m), dtype=np.float64)


def _middles(course: Course, time_s: FloatArray, points_m: FloatArray) -> Iterator[float]:
    start = 0
    for a, b in zip(course.points_m[:-1], course.points_m[1:], strict=True):
        length = math.hypot(*(b - a))
        unit = (b - a) / length
        off = points_m[start:] - 0.5 * (a + b)
        along = off @ unit
        aside = np.abs(off @ np.array([-unit[1], unit[0]]))
        passes = np.flatnonzero(
            (along[:-1] < 0) & (along[1:] >= 0) & (aside[1:] <= GATE_SHARE * length)
        )
        if len(passes) == 0:
            yield math.nan
            continue
        i = int(passes[0])
        share = -along[i] / (along[i + 1] - along[i])
        yield float(time_s[start + i] + share * (time_s[start + i + 1] - time_s[start + i]))
        start += i + 1


def measure(
    course: Course,
    time_s: FloatArray,
    points_m: FloatArray,
    started_s: float,
    ended_s: float,
) -> CourseResult:
    """Return what each manoeuvre of a course cost on a track.

    Parameters
    ----------
    course
        What was to be sailed.
    time_s, points_m
        (n,) rising times and (n, 2) positions of the track, in the course's frame.
    started_s, ended_s
        When the mission was started, and when its last waypoint was reached.

    Raises
    ------
    SimulatorError
        When the track does not follow the course.
    """
    middles = middle_times(course, time_s, points_m)
    lengths = np.hypot(*np.diff(course.points_m, axis=0).T)
    ideal = lengths / course.speed_m_s
    out = []
    for m in course.manoeuvres:
        enter, leave = m.first - 1, m.last
        begin, end = middles[enter], middles[leave]
        if not (math.isfinite(begin) and math.isfinite(end)):
            raise SimulatorError(
                f"the boat did not follow the course at its {m.kind} of {m.angle_deg:g} degrees "
                f"(point {m.first} of {len(course.points_m)})"
            )
        least = 0.5 * (ideal[enter] + ideal[leave]) + ideal[enter + 1 : leave].sum()
        inside = (time_s >= begin) & (time_s <= end)
        way = shapely.linestrings(course.points_m[m.first - 1 : m.last + 2])
        gone = points_m[inside]
        unit = (course.points_m[m.first] - course.points_m[m.first - 1]) / lengths[enter]
        out.append(
            Measured(
                manoeuvre=m,
                extra_s=float(end - begin - least),
                swing_m=float(shapely.distance(shapely.points(gone), way).max()),
                beyond_m=float(((gone - course.points_m[m.first]) @ unit).max()),
            )
        )
    first = int(np.searchsorted(time_s, started_s))
    first = min(first, len(time_s) - 1)
    to_middle = math.hypot(*(points_m[first] - 0.5 * (course.points_m[0] + course.points_m[1])))
    return CourseResult(
        measured=tuple(out),
        start_s=float(middles[0] - started_s - to_middle / course.speed_m_s[0]),
        end_s=float(ended_s - middles[-1] - 0.5 * ideal[-1]),
        speed_share=_steady_share(course, time_s, points_m, float(middles[0])),
    )


def _steady_share(
    course: Course, time_s: FloatArray, points_m: FloatArray, middle_s: float
) -> float:
    """Return the speed from the middle to nine tenths of the first leg, over the one ordered."""
    a, b = course.points_m[0], course.points_m[1]
    length = math.hypot(*(b - a))
    along = (points_m - a) @ ((b - a) / length)
    after = time_s >= middle_s
    reached = np.flatnonzero(after & (along >= 0.9 * length))
    if len(reached) == 0:
        return math.nan
    end = int(reached[0])
    way = along[end] - 0.5 * length
    return float(way / (time_s[end] - middle_s) / course.speed_m_s[0])

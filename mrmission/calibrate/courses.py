"""Courses to sail: corners, lane turns, stairs of short legs, changes of speed.

A course is one polyline. Its manoeuvres are numbered by the corner points that they consist of, and
each is sailed in from a long leg and out into a long leg, so that what it costs can be read off a
track between the middles of the two.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from mrmission.errors import ConfigError
from mrmission.model import FloatArray, read_only

ANGLES_DEG = (30.0, 45.0, 58.0, 65.0, 90.0, 115.0, 135.0, 160.0, 180.0)
"""58 and 65 lie on both sides of the angle (60°) from which ArduRover pivots where it can."""
SPACINGS_M = (3.0, 5.0, 7.0, 10.0, 20.0)
SLANT_DEG = 60.0
"""A lane turn along a slanted shore is a corner of this and one of the rest of 180."""
BEND_DEG = 20.0
"""Corners of a transit that follows a shore."""
STAIR_CORNERS = 6
RUN_IN_M = 60.0
LANE_M = 40.0
LEAST_LANE_S = 14.0
MOST_LANE_S = 20.0
"""Legs between manoeuvres are `LANE_M`, but no less and no more than these seconds of sailing."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Manoeuvre:
    """Corners that are measured together.

    Attributes
    ----------
    kind
        ``straight`` (a waypoint on a straight line), ``corner``, ``turn`` (two corners to the same
        side, from lane to lane), ``stairs`` (corners to the left and right in turn) or ``speed``
        (a change of speed at a waypoint on a straight line).
    angle_deg
        Of the first corner, positive to the left.
    leg_m
        Length of the legs between its corners; 0 where it is one corner.
    first, last
        Numbers of its first and last point in the course.
    """

    kind: str
    angle_deg: float
    leg_m: float
    first: int
    last: int


@dataclass(frozen=True, slots=True, kw_only=True)
class Course:
    """A polyline with manoeuvres: ``points_m`` is (n, 2), ``speed_m_s`` (n - 1,) by leg."""

    points_m: FloatArray
    speed_m_s: FloatArray
    manoeuvres: tuple[Manoeuvre, ...]

    @property
    def length_m(self) -> float:
        """Return the length of all legs."""
        return float(np.hypot(*np.diff(self.points_m, axis=0).T).sum())

    @property
    def shortest_s(self) -> float:
        """Return length over speed of all legs."""
        return float((np.hypot(*np.diff(self.points_m, axis=0).T) / self.speed_m_s).sum())


class _Turtle:
    """Draws a course: forward and turn."""

    def __init__(self, speed_m_s: float) -> None:
        self.points = [(0.0, 0.0)]
        self.speeds: list[float] = []
        self.heading_deg = 90.0
        self.speed_m_s = speed_m_s
        self.manoeuvres: list[Manoeuvre] = []

    def forward(self, length_m: float) -> None:
        at = math.radians(self.heading_deg)
        east, north = self.points[-1]
        self.points.append((east + length_m * math.cos(at), north + length_m * math.sin(at)))
        self.speeds.append(self.speed_m_s)

    def manoeuvre(self, kind: str, turns_deg: Sequence[float], leg_m: float, out_m: float) -> None:
        """Turn by each angle in turn, with legs between, and sail out."""
        first = len(self.points) - 1
        for i, angle_deg in enumerate(turns_deg):
            if i:
                self.forward(leg_m)
            self.heading_deg += angle_deg
        self.manoeuvres.append(
            Manoeuvre(
                kind=kind, angle_deg=turns_deg[0] if turns_deg else 0.0,
                leg_m=leg_m if len(turns_deg) > 1 else 0.0,
                first=first, last=len(self.points) - 1,
            )
        )  # fmt: skip
        self.forward(out_m)

    def course(self) -> Course:
        return Course(
            points_m=read_only(np.array(self.points)),
            speed_m_s=read_only(np.array(self.speeds)),
            manoeuvres=tuple(self.manoeuvres),
        )


def lane_m(speed_m_s: float) -> float:
    """Return how long the legs between manoeuvres are at a speed."""
    return min(max(LANE_M, LEAST_LANE_S * speed_m_s), MOST_LANE_S * speed_m_s)


def corner_course(
    speed_m_s: float,
    *,
    repeats: int = 2,
    angles_deg: Sequence[float] = ANGLES_DEG,
    spacings_m: Sequence[float] = SPACINGS_M,
) -> Course:
    """Return the course of corners, lane turns and stairs at one speed.

    Every manoeuvre is sailed `repeats` times to the left and as often to the right.

    Parameters
    ----------
    speed_m_s
        WP_SPEED; the long legs grow with it.
    repeats
        How often.
    angles_deg
        Changes of course of the single corners, 0 to 180.
    spacings_m
        Lengths of the short legs of lane turns and stairs.

    Raises
    ------
    ConfigError
        When an angle, a spacing or the number of repeats is out of range.
    """
    if repeats < 1:
        raise ConfigError(f"--repeats {repeats}: must be at least 1")
    for angle in angles_deg:
        if not 0 < angle <= 180:
            raise ConfigError(f"--angle {angle:g}: a corner is above 0 and at most 180 degrees")
    for spacing in spacings_m:
        if not 0 < spacing <= 200:
            raise ConfigError(f"--spacing {spacing:g}: must be above 0 and at most 200 m")
    out = lane_m(speed_m_s)
    pen = _Turtle(speed_m_s)
    pen.forward(max(RUN_IN_M, out))
    pen.manoeuvre("straight", (0.0,), 0.0, max(RUN_IN_M, out))
    for _ in range(repeats):
        for angle in angles_deg:
            for side in (1, -1):
                pen.manoeuvre("corner", (side * angle,), 0.0, out)
        for spacing in spacings_m:
            for first in (90.0, SLANT_DEG, 180.0 - SLANT_DEG):
                for side in (1, -1):
                    pen.manoeuvre("turn", (side * first, side * (180.0 - first)), spacing, out)
            for angle in (90.0, BEND_DEG):
                stairs = [angle * (-1) ** i for i in range(STAIR_CORNERS)]
                pen.manoeuvre("stairs", stairs, spacing, out)
    return pen.course()


def speed_course(slow_m_s: float, fast_m_s: float, *, repeats: int = 3) -> Course:
    """Return a course on which the speed changes to and fro at waypoints of a straight line."""
    pen = _Turtle(slow_m_s)
    out = 2.0 * lane_m(fast_m_s)
    pen.forward(out)
    for i in range(2 * repeats):
        pen.speed_m_s = (fast_m_s, slow_m_s)[i % 2]
        pen.manoeuvre("speed", (0.0,), 0.0, out)
    return pen.course()

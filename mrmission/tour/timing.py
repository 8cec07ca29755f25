"""How many seconds a path takes: length over speed, and what a corner costs."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from mrmission.model import FloatArray, LegKind

CORNER_ANGLE_DEG = np.array([0.0, 45.0, 90.0, 135.0, 180.0])
CORNER_EXTRA_S = np.array([0.0, 0.0, 0.0, 0.7, 6.2])
"""Extra seconds of a steered boat at 2 m/s and WP_RADIUS 2 per corner of that angle.

A simulated ArduRover motorboat cuts corners of up to 90 degrees and gains a fraction of a second;
a plan does not count on it (0 instead), so that a bound from length over speed stays a bound.
"""


@dataclass(frozen=True, slots=True, kw_only=True)
class TimeModel:
    """Speeds of one vehicle and the corner table above."""

    survey_speed_m_s: float
    transit_speed_m_s: float

    @property
    def top_speed_m_s(self) -> float:
        """Return the faster of the two speeds."""
        return max(self.survey_speed_m_s, self.transit_speed_m_s)

    def corners_s(self, points_m: FloatArray) -> FloatArray:
        """Return (n - 2,) extra seconds at the inner points of a polyline of shape (n, 2)."""
        if len(points_m) < 3:
            return np.zeros(0)
        leg = np.diff(points_m, axis=0)
        heading = np.arctan2(leg[:, 1], leg[:, 0])
        turn = np.abs((np.diff(heading) + np.pi) % (2 * np.pi) - np.pi)
        return np.interp(np.degrees(turn), CORNER_ANGLE_DEG, CORNER_EXTRA_S)

    def legs_s(self, points_m: FloatArray, kind: np.ndarray) -> FloatArray:
        """Return (n - 1,) seconds of each leg without its corners."""
        length = np.hypot(*np.diff(points_m, axis=0).T)
        speed = np.where(kind == LegKind.SURVEY, self.survey_speed_m_s, self.transit_speed_m_s)
        return length / speed

    def duration_s(self, points_m: FloatArray, kind: np.ndarray) -> float:
        """Return the seconds of a whole path: points of shape (n, 2), legs of kind (n - 1,)."""
        if len(points_m) < 2:
            return 0.0
        moved = np.append(True, np.any(np.diff(points_m, axis=0) != 0, axis=1))
        return float(self.legs_s(points_m, kind).sum() + self.corners_s(points_m[moved]).sum())

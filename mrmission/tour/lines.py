"""Survey lines: what is swept from one end to the other, in either direction."""

from __future__ import annotations

import enum
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import shapely

from mrmission.errors import PlanningError
from mrmission.model import FloatArray, read_only


class LineKind(enum.StrEnum):
    """What a line is for."""

    LANE = "lane"
    """One of the parallel lines that cover the region: the mainscheme."""
    SHORE = "shore"
    """A piece of a lap along the shore or about an island; it covers like a lane."""
    TIE = "tie"
    """A cross line: it checks the lanes and is not counted as coverage."""
    EXTRA = "extra"
    """A short line for what the others leave uncovered."""


@dataclass(frozen=True, slots=True, kw_only=True)
class SurveyLine:
    """A unit of survey work: a polyline that is swept whole, from either end.

    Attributes
    ----------
    points_m
        (m, 2) corners from one end to the other, m >= 2, local frame.
    kind
        What it is for.
    name
        What people call it: ``17``, ``17b``, ``T3``, ``S1c``.

    Raises
    ------
    PlanningError
        When it has fewer than two corners, or a corner is not a position.
    """

    points_m: FloatArray
    kind: LineKind = LineKind.LANE
    name: str = ""

    def __post_init__(self) -> None:
        points = np.array(self.points_m, dtype=np.float64)
        if points.ndim != 2 or points.shape[1:] != (2,) or len(points) < 2:
            raise PlanningError(
                f"line {self.name or '?'}: corners of shape {points.shape}; "
                "must be (m, 2) with m at least 2"
            )
        if not np.isfinite(points).all():
            raise PlanningError(f"line {self.name or '?'}: a corner is not a position")
        object.__setattr__(self, "points_m", read_only(points))

    @property
    def ends_m(self) -> FloatArray:
        """Return its (2, 2) ends."""
        return self.points_m[[0, -1]]

    @property
    def length_m(self) -> float:
        """Return its length along all corners."""
        return float(np.hypot(*np.diff(self.points_m, axis=0).T).sum())

    @property
    def counts_as_coverage(self) -> bool:
        """Return whether what it sweeps counts as covered; cross lines are swept in addition."""
        return self.kind is not LineKind.TIE

    def way(self, entry: int) -> FloatArray:
        """Return the corners in the order in which they are swept from end `entry` (0 or 1)."""
        return self.points_m[::-1] if entry & 1 else self.points_m


def ends_of(lines: Sequence[SurveyLine]) -> FloatArray:
    """Return (lines, 2, 2) ends; ends ``2i`` and ``2i + 1`` of the flat list are those of `i`."""
    if not lines:
        return np.zeros((0, 2, 2))
    return np.stack([line.ends_m for line in lines])


def lengths_m(lines: Sequence[SurveyLine]) -> FloatArray:
    """Return (lines,) lengths."""
    return np.array([line.length_m for line in lines], dtype=np.float64)


def geometry_of(lines: Sequence[SurveyLine]) -> list[shapely.LineString]:
    """Return the lines as geometries."""
    return [shapely.LineString(line.points_m) for line in lines]

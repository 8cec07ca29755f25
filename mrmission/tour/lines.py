"""Survey lines: what is swept from one end to the other, in either direction."""

from __future__ import annotations

import enum
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import shapely

from mrmission.errors import PlanningError
from mrmission.model import FloatArray, IntArray, read_only
from mrmission.tour.sweep import Sweep


class LineKind(enum.StrEnum):
    """What a line is for."""

    LANE = "lane"
    """One of the parallel lines that cover the region: the mainscheme."""
    FAIRWAY = "fairway"
    """A lane across the others, swept on the way out and home; it covers like a lane."""
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


def between(line: SurveyLine, from_m: float, to_m: float) -> SurveyLine:
    """Return the piece of a line between two distances along it, of the same kind and name.

    Parameters
    ----------
    line
        The line.
    from_m, to_m
        Distances from its first end, 0 <= from_m < to_m <= its length; the ends stay exact.
    """
    points = line.points_m
    at = np.append(0.0, np.cumsum(np.hypot(*np.diff(points, axis=0).T)))

    def place(distance_m: float) -> FloatArray:
        if distance_m <= 0.0:
            return points[0]
        if distance_m >= at[-1]:
            return points[-1]
        return np.array([np.interp(distance_m, at, points[:, axis]) for axis in (0, 1)])

    inner = points[(at > from_m) & (at < to_m)]
    way = np.vstack([place(from_m), inner, place(to_m)])
    return SurveyLine(points_m=way, kind=line.kind, name=line.name)


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


def lane_lines(sweep: Sweep) -> tuple[SurveyLine, ...]:
    """Return the lanes of a sweep as named lines, in the sweep's order.

    Notes
    -----
    Lanes of one column are one line that islands interrupt, and share its number: 17, or 17a,
    17b, … along the bearing. Columns are numbered from 1 from west to east, and from north to
    south where lanes run exactly east and west. So names follow from place alone: they are the
    same for any number of robots, any seed and any planner.
    """
    ends = sweep.frame.to_local(sweep.lane_ends_m())
    names = lane_names(
        sweep.frame.bearing_deg, len(sweep.column_x_m), sweep.lane_column, sweep.lane_y_m[:, 0]
    )
    return tuple(
        SurveyLine(points_m=way, kind=LineKind.LANE, name=name)
        for way, name in zip(ends, names, strict=True)
    )


def lane_names(
    bearing_deg: float, columns: int, column: IntArray, along_m: FloatArray
) -> list[str]:
    """Return the names of lanes from their columns and the positions of their feet.

    Parameters
    ----------
    bearing_deg
        Compass bearing of the lanes, 0 to 180.
    columns
        How many columns there are.
    column
        (n,) column of each lane, from 0, rising across the sweep frame.
    along_m
        (n,) where each lane begins along the bearing.
    """
    # the frame's first axis points east up to a bearing of 90, west beyond it
    number = column + 1 if bearing_deg <= 90.0 else columns - column
    many = np.bincount(column, minlength=columns) > 1
    names = [""] * len(column)
    seen: dict[int, int] = {}
    for i in np.lexsort((along_m, column)).tolist():
        own = int(column[i])
        names[i] = str(int(number[i]))
        if many[own]:
            names[i] += letters(seen.get(own, 0))
            seen[own] = seen.get(own, 0) + 1
    return names


def row_names(prefix: str, row: IntArray) -> list[str]:
    """Return the names of pieces of rows, by the number of each one's row, which never falls.

    Examples
    --------
    >>> row_names("T", np.array([1, 2, 2]))
    ['T1', 'T2a', 'T2b']
    """
    first, stop = (np.searchsorted(row, row, side).tolist() for side in ("left", "right"))
    return [
        f"{prefix}{number}" + (letters(i - a) if b - a > 1 else "")
        for i, (number, a, b) in enumerate(zip(row.tolist(), first, stop, strict=True))
    ]


def letters(index: int) -> str:
    """Return a, b, … z, aa, ab, … for 0, 1, ….

    Examples
    --------
    >>> letters(0), letters(25), letters(26), letters(27)
    ('a', 'z', 'aa', 'ab')
    """
    out = ""
    index += 1
    while index:
        index, rest = divmod(index - 1, 26)
        out = chr(ord("a") + rest) + out
    return out

"""How many seconds a path takes: length over speed, and what corners and short legs cost.

The costs come from a table that was measured (:mod:`mrmission.tour.time_table`); what is made of it
and how well it predicts is told in ``docs/time-model.md``.
"""

from __future__ import annotations

import copy
from dataclasses import dataclass, field, replace
from functools import lru_cache

import numpy as np

from mrmission import libm
from mrmission.model import FloatArray, LegKind
from mrmission.tour.time_table import TimeRow, TimeTable, default_table

BEND_DEG = 20.0
ZIGZAG_DEG = 90.0
"""The angles of the stairs in the table: chains of short legs are interpolated between the two."""
GAIN_CELLS = 720
"""Between so many angles a corner's gain is taken at its most."""
TAIL = 2.0
"""Beyond this many times the longest short leg of the table, a leg is long."""


@dataclass(frozen=True, slots=True)
class Curves:
    """What corners and short legs cost at one speed and WP_RADIUS.

    Attributes
    ----------
    angle_deg
        (n,) changes of course, rising from 0 to 180.
    corner_s
        (n,) extra seconds of a corner between long legs; negative where it is cut.
    swing_m
        (n,) largest distance from the planned way.
    leg_m
        (m,) lengths of short legs, rising.
    first_s
        (m,) extra seconds that the first of several short legs costs, on top of
    bend_s, zigzag_s
        (m,) those of each, between corners of `BEND_DEG` and of `ZIGZAG_DEG`.
    start_s, end_s
        Extra seconds of setting off and of stopping.
    """

    angle_deg: FloatArray
    corner_s: FloatArray
    swing_m: FloatArray
    leg_m: FloatArray
    first_s: FloatArray
    bend_s: FloatArray
    zigzag_s: FloatArray
    start_s: float
    end_s: float


@dataclass(frozen=True, slots=True, kw_only=True)
class TimeModel:
    """How long one vehicle takes for a path.

    Parameters
    ----------
    survey_speed_m_s, transit_speed_m_s
        On lanes and between them.
    steering
        ``steered`` or ``pivoting``: the rows of the table.
    radius_m
        The vehicle's WP_RADIUS.
    swath_m
        Width of the footprint. A corner that is cut counts for less than nothing only as far as
        the lower bound on the makespan allows: see :meth:`least_corner_s`. 0 lets no corner gain.
    table
        What was measured; None takes the packaged table.
    turn_radius_m
        Least radius of a turn, 0: turns on the spot. Paths are drawn so; no duration depends on it.
    """

    survey_speed_m_s: float
    transit_speed_m_s: float
    steering: str = "steered"
    radius_m: float = 1.0
    swath_m: float = 0.0
    table: TimeTable | None = None
    turn_radius_m: float = 0.0
    survey: Curves = field(init=False, repr=False, compare=False)
    transit: Curves = field(init=False, repr=False, compare=False)
    accel_m_s2: float | None = field(init=False, repr=False, compare=False)

    def __post_init__(self) -> None:
        table = self.table or default_table()
        object.__setattr__(self, "accel_m_s2", acceleration_m_s2(table, self.steering))
        for name, speed in (("survey", self.survey_speed_m_s), ("transit", self.transit_speed_m_s)):
            object.__setattr__(self, name, curves(table, self.steering, speed, self.radius_m))

    def with_reversals_marked(self, angle_deg: float, mark_s: float) -> TimeModel:
        """Return the same with corners from an angle on dearer by so many seconds."""
        out = copy.copy(self)
        for name in ("survey", "transit"):
            was: Curves = getattr(self, name)
            just_below = np.nextafter(angle_deg, 0.0)
            angles = np.unique(np.append(was.angle_deg, [just_below, angle_deg]))
            corner_s, swing_m = (
                np.interp(angles, was.angle_deg, values) for values in (was.corner_s, was.swing_m)
            )
            corner_s = corner_s + np.where(angles >= angle_deg, mark_s, 0.0)
            now = replace(was, angle_deg=angles, corner_s=corner_s, swing_m=swing_m)
            object.__setattr__(out, name, now)
        return out

    @property
    def top_speed_m_s(self) -> float:
        """Return the faster of the two speeds."""
        return max(self.survey_speed_m_s, self.transit_speed_m_s)

    def lane_turn_s(self, spacing_m: float) -> float:
        """Return the extra seconds of a turn between two lanes, as a mean for planning.

        Half of the turns are taken to be two corners of 90 degrees, half corners of 60 and 120.
        """
        c = self.survey
        corner = np.interp([90.0, 60.0, 120.0], c.angle_deg, c.corner_s)
        short = np.interp(spacing_m, c.leg_m, c.first_s + c.bend_s)
        return max(0.0, float(corner[0] + 0.5 * (corner[1] + corner[2]) + short))

    def legs_s(self, points_m: FloatArray, kind: np.ndarray) -> FloatArray:
        """Return (n - 1,) seconds of each leg of (n, 2) points by its length and speed alone."""
        return np.hypot(*np.diff(points_m, axis=0).T) / self._speeds(kind)

    def _speeds(self, kind: np.ndarray) -> FloatArray:
        return np.where(kind == LegKind.SURVEY, self.survey_speed_m_s, self.transit_speed_m_s)

    def _by_kind(self, name: str, at: FloatArray, axis: str, kind: np.ndarray) -> FloatArray:
        """Return a curve's values, each from the curves of its leg's speed."""
        s, t = self.survey, self.transit
        out = np.interp(at, getattr(s, axis), getattr(s, name))
        if s is t:
            return out
        other = np.interp(at, getattr(t, axis), getattr(t, name))
        return np.where(kind == LegKind.SURVEY, out, other)

    def corners_s(self, points_m: FloatArray, kind: np.ndarray) -> FloatArray:
        """Return (n - 2,) extra seconds at the inner points of a path.

        That is the corner itself, half of what the short legs on its two sides cost, and a change
        of speed.

        Parameters
        ----------
        points_m
            (n, 2) points, none twice in a row.
        kind
            (n - 1,) kind of each leg.
        """
        if len(points_m) < 3:
            return np.zeros(0)
        leg = np.diff(points_m, axis=0)
        length = np.hypot(leg[:, 0], leg[:, 1])
        turn_deg = turns_deg(leg)
        before, after = kind[:-1], kind[1:]
        corner = 0.5 * (
            self._by_kind("corner_s", turn_deg, "angle_deg", before)
            + self._by_kind("corner_s", turn_deg, "angle_deg", after)
        )
        short = self._short_s(length, turn_deg, kind)
        extra = corner + 0.5 * (short[:-1] + short[1:]) + self._speed_changes_s(length, kind)
        return np.maximum(extra, self.least_corner_s(length, turn_deg))

    def _short_s(self, length: FloatArray, turn_deg: FloatArray, kind: np.ndarray) -> FloatArray:
        """Return (n - 1,) extra seconds of the legs that lie between two corners.

        A vehicle does not reach its speed on a leg that is shorter than it takes to gain and lose
        it. The first such leg of several costs more than those that follow, because only there it
        must lose its speed.
        """
        out = np.zeros(len(length))
        if len(length) < 3:
            return out
        inner, kinds = length[1:-1], kind[1:-1]
        first = self._by_kind("first_s", inner, "leg_m", kinds)
        bend = self._by_kind("bend_s", inner, "leg_m", kinds)
        zigzag = self._by_kind("zigzag_s", inner, "leg_m", kinds)
        mean_deg = 0.5 * (turn_deg[:-1] + turn_deg[1:])
        share = np.clip((mean_deg - BEND_DEG) / (ZIGZAG_DEG - BEND_DEG), 0.0, 1.0)
        anew = np.maximum(0.0, np.diff(first, prepend=0.0))
        # a lone turn between lanes is what `first_s` was measured on, without the zigzag
        lone = anew >= first
        lone[:-1] &= first[1:] <= 0.0
        each = np.where(lone, bend, bend + share * (zigzag - bend))
        out[1:-1] = anew + each
        return out

    def _speed_changes_s(self, length: FloatArray, kind: np.ndarray) -> FloatArray:
        """Return (n - 2,) extra seconds for gaining or losing speed where the leg's kind changes.

        From u to v at acceleration a on a leg at v: ± (v − u)² / (2 a v) over length / v.
        """
        speed = self._speeds(kind)
        change = np.diff(speed)
        if self.accel_m_s2 is None or not np.any(change):
            return np.zeros(len(change))
        after = speed[1:]
        extra = np.sign(change) * change**2 / (2.0 * self.accel_m_s2 * after)
        # slowing down gains no more than sailing the whole leg at the old speed would
        gain = length[1:] * (1.0 / after - 1.0 / np.maximum(speed[:-1], after))
        return np.maximum(extra, -gain)

    @property
    def long_leg_m(self) -> float:
        """Return the length from which on a leg costs nothing but its length over its speed."""
        return float(max(self.survey.leg_m[-1], self.transit.leg_m[-1]))

    def short_row_s(self, leg_m: FloatArray) -> FloatArray:
        """Return what a way may take less, at most, where the legs before or behind it are short.

        Only the first of a row of short legs loses the vehicle's speed, and a lone short leg is no
        zigzag.

        Parameters
        ----------
        leg_m
            (ways,) lengths of the first leg of each.
        """
        first = [np.interp(leg_m, c.leg_m, c.first_s) for c in (self.survey, self.transit)]
        alone = max(float((c.bend_s - c.zigzag_s).max()) for c in (self.survey, self.transit))
        return np.maximum(*first) + 2.0 * max(0.0, alone)

    def most_gain_s(self, before: LegKind, after: LegKind) -> float:
        """Return what a corner between legs of these kinds may gain at most, 0 or more."""
        edge = np.linspace(0.0, 180.0, GAIN_CELLS + 1)
        sides = [self.survey if k == LegKind.SURVEY else self.transit for k in (before, after)]
        # the curves are straight between their angles, so each is least at one of these
        angles = np.unique(np.concatenate([edge, *(c.angle_deg for c in sides)]))
        corner = 0.5 * sum(np.interp(angles, c.angle_deg, c.corner_s) for c in sides)
        speed = self._speeds(np.array([before, after]))
        change = 0.0
        if self.accel_m_s2 is not None and speed[1] < speed[0]:
            change = -((speed[1] - speed[0]) ** 2) / (2.0 * self.accel_m_s2 * speed[1])
        low = np.minimum(corner[:-1], corner[1:]) + change
        # what may be gained grows with the angle
        most = -self.least_corner_s(np.full(len(angles), np.inf), angles[1:])
        return max(0.0, float(np.minimum(-low, most).max()))

    def least_corner_s(self, length: FloatArray, turn_deg: FloatArray) -> FloatArray:
        """Return (n - 2,) the least extra seconds that a corner may count, 0 or below.

        The bound on the makespan says: a path of length L covers L·w + π·w²/4 at most, w being
        the swath. At a corner by the angle θ between legs that are long enough, the footprints of
        both legs overlap outside the disc about the corner, on w²/4·(tan(θ/2) − θ/2), so the path
        covers so much less. A corner that is cut may gain the time of as much area and no more:
        then time · top speed · w + π·w²/4 still is no less than what the path covers.
        """
        radius_m = 0.5 * self.swath_m
        half = 0.5 * np.radians(np.minimum(turn_deg, 179.0))
        tangent = libm.tan(half)
        enough = np.minimum(length[:-1], length[1:]) >= radius_m * tangent
        if radius_m == 0:
            return np.zeros(len(turn_deg))
        credit_m = 0.5 * radius_m * (tangent - half)
        return np.where(enough, -credit_m / self.top_speed_m_s, 0.0)

    def duration_s(self, points_m: FloatArray, kind: np.ndarray) -> float:
        """Return the seconds of a whole path: points of shape (n, 2), legs of kind (n - 1,)."""
        if len(points_m) < 2:
            return 0.0
        moved = np.any(np.diff(points_m, axis=0) != 0, axis=1)
        if not moved.any():
            return 0.0
        points, kinds = points_m[np.append(True, moved)], kind[moved]
        ends = max(0.0, self.survey.start_s) + max(0.0, self.survey.end_s)
        legs = self.legs_s(points, kinds).sum()
        return float(legs + self.corners_s(points, kinds).sum() + ends)

    def swing_m(self, points_m: FloatArray, kind: np.ndarray) -> float:
        """Return how far a vehicle leaves a path at its corners, at the worst of them."""
        moved = np.any(np.diff(points_m, axis=0) != 0, axis=1)
        points, kinds = points_m[np.append(True, moved)], kind[moved]
        if len(points) < 3:
            return 0.0
        turn_deg = turns_deg(np.diff(points, axis=0))
        before = self._by_kind("swing_m", turn_deg, "angle_deg", kinds[:-1])
        after = self._by_kind("swing_m", turn_deg, "angle_deg", kinds[1:])
        return float(np.maximum(before, after).max())


def turns_deg(leg_m: FloatArray) -> FloatArray:
    """Return (n - 1,) changes of course, 0 to 180 degrees, between (n, 2) legs."""
    heading = libm.arctan2(leg_m[:, 1], leg_m[:, 0])
    return np.degrees(np.abs((np.diff(heading) + np.pi) % (2 * np.pi) - np.pi))


@lru_cache(maxsize=64)
def curves(table: TimeTable, steering: str, speed_m_s: float, radius_m: float) -> Curves:
    """Return the curves at a speed and a WP_RADIUS: linear between the rows of the table.

    Outside the measured speeds and radii the nearest ones hold.

    Raises
    ------
    InputError
        When the table has no rows for the steering type.
    """
    rows = table.of(steering)
    speeds = sorted({row.speed_m_s for row in rows})
    radii = sorted({row.radius_m for row in rows})
    leg_m = np.array(sorted({c.leg_m for row in rows for c in row.chains}), dtype=np.float64)
    leg_m = np.append(leg_m, TAIL * leg_m[-1:])
    sets = {(r.speed_m_s, r.radius_m): _row_curves(r, leg_m) for r in rows}
    total: FloatArray | None = None
    for speed, speed_share in _between(speeds, speed_m_s):
        for radius, radius_share in _between(radii, radius_m):
            part = speed_share * radius_share * sets[(speed, radius)]
            total = part if total is None else total + part
    assert total is not None  # `_between` yields at least one
    n, m = len(rows[0].corners) + 1, len(leg_m)
    cuts = np.cumsum([n, n, m, m, m])
    corner, swing, first, bend, zigzag, ends = np.split(total, cuts)
    return Curves(
        angle_deg=np.array([0.0, *(c.angle_deg for c in rows[0].corners)]),
        corner_s=corner,
        swing_m=swing,
        leg_m=leg_m,
        first_s=first,
        bend_s=bend,
        zigzag_s=zigzag,
        start_s=float(np.median([r.start_s for r in rows])),
        end_s=float(ends[0]),
    )


def _between(nodes: list[float], at: float) -> list[tuple[float, float]]:
    """Return the nodes around a value with their shares."""
    i = int(np.searchsorted(nodes, at))
    if i == 0:
        return [(nodes[0], 1.0)]
    if i == len(nodes):
        return [(nodes[-1], 1.0)]
    share = (at - nodes[i - 1]) / (nodes[i] - nodes[i - 1])
    return [(nodes[i - 1], 1.0 - share), (nodes[i], share)]


def _row_curves(row: TimeRow, leg_m: FloatArray) -> FloatArray:
    """Return a row's curves one after the other: corner, swing, first, bend, zigzag, end."""
    angle = np.array([0.0, *(c.angle_deg for c in row.corners)])
    corner = np.array([0.0, *(c.extra_s for c in row.corners)])
    swing = np.array([0.0, *(c.swing_m for c in row.corners)])

    def alone_s(angle_deg: float) -> float:
        return float(np.interp(angle_deg, angle, corner))

    def per_leg(kind: str, angles: tuple[float, ...]) -> FloatArray:
        """Return seconds per chain over its corners' own, by leg length, 0 at the last."""
        sums: dict[float, list[float]] = {}
        for c in row.chains:
            if c.kind == kind and c.angle_deg in angles:
                own = (
                    alone_s(c.angle_deg) + alone_s(180.0 - c.angle_deg)
                    if kind == "turn"
                    else c.corners * alone_s(c.angle_deg)
                )
                sums.setdefault(c.leg_m, []).append(max(0.0, c.extra_s - own))
        at = sorted(sums)
        if not at:
            return np.zeros(len(leg_m))
        values = [float(np.mean(sums[x])) for x in at]
        return np.interp(leg_m, [*at, TAIL * at[-1]], [*values, 0.0])

    square = per_leg("turn", (ZIGZAG_DEG,))
    slanted = sorted({c.angle_deg for c in row.chains if c.kind == "turn"} - {ZIGZAG_DEG})
    turn = 0.5 * (square + per_leg("turn", tuple(slanted))) if slanted else square
    legs = max((c.corners - 1 for c in row.chains if c.kind == "stairs"), default=1)
    each = max(1, legs - 1)
    bend = np.clip((per_leg("stairs", (BEND_DEG,)) - turn) / each, 0.0, turn)
    zigzag = np.maximum(0.0, per_leg("stairs", (ZIGZAG_DEG,)) - turn) / each
    return np.concatenate([corner, swing, turn - bend, bend, zigzag, [row.end_s]])


def acceleration_m_s2(table: TimeTable, steering: str) -> float | None:
    """Return the acceleration that explains the changes of speed of a table; None without any."""
    found = [
        (c.to_m_s - c.from_m_s) ** 2 / (2.0 * c.to_m_s * abs(c.extra_s))
        for c in table.speed_changes
        if c.steering == steering and c.extra_s * (c.to_m_s - c.from_m_s) > 0
    ]
    return float(np.median(found)) if found else None

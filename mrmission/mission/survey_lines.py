"""Which items of the finished missions sweep which line: names for the table, the map, the files.

Lines are found again in the missions by their place, after all that a path goes through on its
way to items: cutting, bending, repairing, merging, rounding. What is found is what is sailed.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cache

import numpy as np
import pyproj
import shapely

from mrmission.area.frame import LocalFrame
from mrmission.mission import mavlink
from mrmission.model import FloatArray, IntArray, LegKind, LineReport, Mission
from mrmission.tour.lines import LineKind, SurveyLine

NEAR_M = 0.3
"""A leg lies on a line within this: subdivision, merging and rounding move it by less."""
EXACT_M = 0.5
"""A line that begins this near to an item begins at the item."""


@dataclass(frozen=True, slots=True, kw_only=True)
class _Legs:
    """The legs of one mission: where, and between which items."""

    ends_m: FloatArray
    ends_e7: IntArray
    items: IntArray
    index: IntArray
    survey: np.ndarray


@dataclass(slots=True, kw_only=True)
class _Run:
    """A stretch of one mission along one line (-1: none), as it grows leg by leg."""

    line: int
    mission: int
    first: tuple[int, float]
    last: tuple[int, float]
    length_m: float
    along_m: float


def name_lines(
    missions: Sequence[Mission], lines: Sequence[SurveyLine], frame: LocalFrame
) -> tuple[Mission, ...]:
    """Return the missions with their lines, and their lanes numbered by lines.

    Parameters
    ----------
    missions
        What is sent, with the kind of each leg.
    lines
        The lines of work, local frame, with distinct names.
    frame
        The local frame.

    Returns
    -------
    tuple of Mission
        ``lines`` are the stretches in the order in which they are swept, ``lane`` counts them
        from 1. A line that is swept in several pieces has -1, -2, … behind its name, in the order
        in which they lie along it; what lies on no line is an extra, E1, E2, ….
    """
    runs: list[_Run] = []
    legs_of = [_legs(mission, frame) for mission in missions]
    lane_of: list[dict[int, int]] = []
    finder = _Finder(lines)
    for number, legs in enumerate(legs_of):
        own, lanes = _runs(number, legs, finder)
        runs.extend(own)
        lane_of.append(lanes)
    names = _names(runs, lines)
    rows: list[list[LineReport]] = [[] for _ in missions]
    for run, name in zip(runs, names, strict=True):
        legs, mission = legs_of[run.mission], missions[run.mission]
        kind = lines[run.line].kind if run.line >= 0 else LineKind.EXTRA
        rows[run.mission].append(_row(run, name, str(kind), legs, mission, frame))
    return tuple(
        replace(
            mission,
            lines=tuple(own),
            lane=tuple(lanes.get(i, 0) for i in range(len(mission.items))),
        )
        for mission, own, lanes in zip(missions, rows, lane_of, strict=True)
    )


def _legs(mission: Mission, frame: LocalFrame) -> _Legs:
    """Return the legs between consecutive places of a mission."""
    index = [
        i
        for i, item in enumerate(mission.items)
        if item.command in mavlink.NAVIGATION and (item.x, item.y) != (0, 0)
    ]
    place = np.array([[mission.items[i].x, mission.items[i].y] for i in index], dtype=np.int64)
    place = place.reshape(-1, 2)
    at = np.array(index, dtype=np.int64)
    moved = np.flatnonzero(np.any(np.diff(place, axis=0) != 0, axis=1))
    ends = np.stack([place[moved], place[moved + 1]], axis=1) if len(moved) else None
    if ends is None:
        none = np.zeros(0, dtype=np.int64)
        return _Legs(
            ends_m=np.zeros((0, 2, 2)),
            ends_e7=np.zeros((0, 2, 2), dtype=np.int64),
            items=np.zeros((0, 2), dtype=np.int64),
            index=none,
            survey=none.astype(bool),
        )
    seq = np.array([mission.items[i].seq for i in index], dtype=np.int64)
    lonlat = ends[:, :, ::-1].astype(np.float64) * 1e-7
    kind = np.array([mission.kind[i] for i in at[moved + 1]] if mission.kind else 0)
    return _Legs(
        ends_m=frame.to_metric(lonlat.reshape(-1, 2)).reshape(-1, 2, 2),
        ends_e7=ends,
        items=np.column_stack([seq[moved], seq[moved + 1]]),
        index=at[moved + 1],
        survey=np.broadcast_to(kind == LegKind.SURVEY, len(moved)),
    )


class _Finder:
    """Finds the lines that legs lie on."""

    def __init__(self, lines: Sequence[SurveyLine]) -> None:
        points = [line.points_m for line in lines]
        none = np.zeros((0, 2))
        self.a = np.concatenate([none, *(p[:-1] for p in points)])
        self.b = np.concatenate([none, *(p[1:] for p in points)])
        count = np.array([len(p) - 1 for p in points], dtype=np.int64)
        self.owner = np.repeat(np.arange(len(points)), count)
        step = np.hypot(*(self.b - self.a).T)
        before = np.cumsum(step) - step
        first = np.cumsum(count) - count
        self.along = before - np.repeat(before[first] if len(first) else before, count)
        self.tree = shapely.STRtree(shapely.linestrings(np.stack([self.a, self.b], axis=1)))

    def find(self, ends_m: FloatArray) -> dict[int, list[tuple[int, float, float, float]]]:
        """Return for each leg its lines: (line, from, to along the leg, place along the line)."""
        if len(ends_m) == 0 or len(self.a) == 0:
            return {}
        leg, part = self.tree.query(
            shapely.linestrings(ends_m), predicate="dwithin", distance=NEAR_M
        )
        start, stop = ends_m[leg, 0], ends_m[leg, 1]
        length = np.hypot(*(stop - start).T)
        unit = (stop - start) / length[:, None]
        u = np.einsum("ij,ij->i", self.a[part] - start, unit)
        v = np.einsum("ij,ij->i", self.b[part] - start, unit)
        low, high = np.clip(np.minimum(u, v), 0, length), np.clip(np.maximum(u, v), 0, length)
        side = self.b[part] - self.a[part]
        size = np.hypot(*side.T)
        normal = np.column_stack([-side[:, 1], side[:, 0]]) / np.where(size > 0, size, 1)[:, None]
        off = [
            np.abs(np.einsum("ij,ij->i", start + t[:, None] * unit - self.a[part], normal))
            for t in (low, high)
        ]
        on = (size > 0) & (high > low) & (off[0] <= NEAR_M) & (off[1] <= NEAR_M)
        found: dict[tuple[int, int], list[float]] = {}
        # where on the line, from its first end, the nearer end of what lies on it is
        ends = (start + t[:, None] * unit - self.a[part] for t in (low, high))
        place = np.minimum(*(np.einsum("ij,ij->i", end, side) for end in ends))
        place /= np.where(size > 0, size, 1)
        for i in np.flatnonzero(on).tolist():
            key = (int(leg[i]), int(self.owner[part[i]]))
            at = float(self.along[part[i]] + max(0.0, place[i]))
            row = found.setdefault(key, [0.0, np.inf, -np.inf, at])
            row[0] += float(high[i] - low[i])
            row[1], row[2] = min(row[1], float(low[i])), max(row[2], float(high[i]))
            row[3] = min(row[3], at)
        by_leg: dict[int, list[tuple[float, int, float, float, float]]] = {}
        for (i, line), (total, t0, t1, at) in found.items():
            by_leg.setdefault(i, []).append((total, line, t0, t1, at))
        sizes = np.hypot(*(ends_m[:, 1] - ends_m[:, 0]).T)
        return {i: _apart(rows, float(sizes[i])) for i, rows in by_leg.items()}


def _apart(
    rows: list[tuple[float, int, float, float, float]], length_m: float
) -> list[tuple[int, float, float, float]]:
    """Return the lines that share a leg between them, the longest first chosen; none if few."""
    chosen: list[tuple[int, float, float, float]] = []
    covered = 0.0
    for total, line, t0, t1, at in sorted(rows, key=lambda row: (-row[0], row[1])):
        if chosen and total < EXACT_M:
            continue
        if any(min(t1, b) - max(t0, a) > EXACT_M for _, a, b, _ in chosen):
            continue
        chosen.append((line, t0, t1, at))
        covered += total
    return sorted(chosen, key=lambda row: row[1]) if covered >= length_m / 2 else []


def _runs(number: int, legs: _Legs, finder: _Finder) -> tuple[list[_Run], dict[int, int]]:
    """Return the stretches of a mission, and the number of the one that ends at each item."""
    runs: list[_Run] = []
    lanes: dict[int, int] = {}
    survey = np.flatnonzero(legs.survey)
    found = finder.find(legs.ends_m[survey])
    lengths = np.hypot(*(legs.ends_m[:, 1] - legs.ends_m[:, 0]).T)
    on_line: int | None = None
    extra: int | None = None
    last = -2
    for k, leg in enumerate(survey.tolist()):
        if leg != last + 1:
            on_line = extra = None
        last = leg
        here = found.get(k, [])
        if not here:
            if extra is None:
                runs.append(
                    _Run(line=-1, mission=number, first=(leg, 0.0), last=(leg, 0.0), length_m=0.0,
                         along_m=0.0)
                )  # fmt: skip
                extra = len(runs) - 1
            runs[extra].last = (leg, float(lengths[leg]))
            runs[extra].length_m += float(lengths[leg])
            lanes[int(legs.index[leg])] = extra + 1
            continue
        extra = None
        longest = 0.0
        for line, t0, t1, at in here:
            if on_line is None or runs[on_line].line != line:
                runs.append(
                    _Run(line=line, mission=number, first=(leg, t0), last=(leg, t1), length_m=0.0,
                         along_m=at)
                )  # fmt: skip
                on_line = len(runs) - 1
            run = runs[on_line]
            run.last = (leg, t1)
            run.length_m += t1 - t0
            run.along_m = min(run.along_m, at)
            if t1 - t0 > longest:
                longest = t1 - t0
                lanes[int(legs.index[leg])] = on_line + 1
    return runs, lanes


def _names(runs: Sequence[_Run], lines: Sequence[SurveyLine]) -> list[str]:
    of_line: dict[int, list[int]] = {}
    for i, run in enumerate(runs):
        of_line.setdefault(run.line, []).append(i)
    names = [""] * len(runs)
    for line, mine in of_line.items():
        if line < 0:
            for count, i in enumerate(mine, 1):
                names[i] = f"E{count}"
            continue
        ordered = sorted(mine, key=lambda i: (runs[i].along_m, i))
        for count, i in enumerate(ordered, 1):
            names[i] = lines[line].name + (f"-{count}" if len(mine) > 1 else "")
    return names


@cache
def _earth() -> pyproj.Geod:
    """Return the ellipsoid; to make one takes longer than to measure on it."""
    return pyproj.Geod(ellps="WGS84")


def _row(
    run: _Run, name: str, kind: str, legs: _Legs, mission: Mission, frame: LocalFrame
) -> LineReport:
    def place(leg: int, along_m: float) -> tuple[float, float]:
        a, b = legs.ends_m[leg]
        length = float(np.hypot(*(b - a)))
        for which, gap in ((0, along_m), (1, length - along_m)):
            if gap <= min(EXACT_M, length / 2):
                lat, lon = (legs.ends_e7[leg, which] / 1e7).tolist()
                return lon, lat
        lon, lat = np.round(frame.to_lonlat(a + (b - a) * (along_m / length)), 7).tolist()
        return lon, lat

    start, end = place(*run.first), place(*run.last)
    bearing: float | None = None
    if start != end:
        bearing = float(_earth().inv(*start, *end)[0]) % 360.0
    return LineReport(
        name=name,
        kind=kind,
        robot=mission.robot,
        sortie=mission.sortie,
        from_item=int(legs.items[run.first[0], 0]),
        to_item=int(legs.items[run.last[0], 1]),
        start_lonlat=start,
        end_lonlat=end,
        length_m=run.length_m,
        bearing_deg=bearing,
    )

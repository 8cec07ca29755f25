"""Lanes cut into pieces that the search may give to different robots, or sweep at other times.

A lane is divisible work. Pieces of one lane that a robot sweeps one after the other cost nothing
more than the lane, so cutting only adds to what the search may choose from. Two kinds of places are
worth it: beside the ends of neighbouring lanes, where a bay or an arm opens and a boat would
otherwise pass the same lane twice to get there; and wherever a piece would be too long a share of
one robot's work for tours to be even.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np

from mrmission.minmax.problem import LaneTours
from mrmission.model import BoolArray, FloatArray, IntArray
from mrmission.tour.lines import LineKind, SurveyLine, between, lengths_m
from mrmission.tour.work import PartWork

SHARE = 1 / 16
"""No piece is longer than this share of what the longest tour has at least."""
SHORTEST = 3.0
"""No lane is cut for its length into pieces shorter than so many lane spacings."""
MARGIN = 2.0
"""A cut beside a neighbour's end lies so many lane spacings from the next cut, or end, at least."""
MOST_LINES = 2400
"""No more lines are made: all ways between their ends must be kept."""


@dataclass(frozen=True, slots=True, kw_only=True)
class _Lane:
    """A straight lane as the sweep sees it: where it lies across, and from where to where along."""

    across_m: float
    along_m: tuple[float, float]


@dataclass(frozen=True, slots=True, kw_only=True)
class Pieces:
    """Lines after cutting.

    Attributes
    ----------
    lines
        The pieces, those of a line one after the other, each beginning where the last one ended.
    line_of
        (pieces,) which line each is of.
    """

    lines: tuple[SurveyLine, ...]
    line_of: IntArray


def cut_lines(work: PartWork) -> Pieces:
    """Return the lines of a part, lanes cut where that may help; pieces keep their lane's name.

    Lines with run-ins are left whole: a run-in belongs to the end of a lane.

    Parameters
    ----------
    work
        The part. Nothing is cut where more than `MOST_LINES` lines would come of it.
    """
    lines = work.lines
    whole = Pieces(lines=lines, line_of=np.arange(len(lines)))
    if not 0 < len(lines) <= MOST_LINES or max(work.options.runs_m) > 0:
        return whole
    pitch_m = work.sweep.column_pitch_m
    longest_m = max(SHORTEST * pitch_m, SHARE * _least_tour_m(work))
    for events in (True, False):
        cuts = _beside_ends(lines, work, pitch_m) if events else [np.zeros(0) for _ in lines]
        pieces = [_pieces(line, at, longest_m) for line, at in zip(lines, cuts, strict=True)]
        counts = [len(mine) for mine in pieces]
        if sum(counts) <= MOST_LINES:
            out = tuple(piece for mine in pieces for piece in mine)
            return Pieces(lines=out, line_of=np.repeat(np.arange(len(lines)), counts))
    return whole


def swept_in_one_go(
    lines: tuple[SurveyLine, ...],
    tours: LaneTours,
    line_of: IntArray,
    apart: BoolArray | None = None,
) -> tuple[tuple[SurveyLine, ...], IntArray]:
    """Return the lines as tours sweep them: pieces that follow on each other are one again.

    Parameters
    ----------
    lines
        The pieces.
    tours
        What sweeps them.
    line_of
        (pieces,) which line each piece is of, see :class:`Pieces`.
    apart
        (2 · pieces,) ends at which pieces are not made one; None where there are none.

    Returns
    -------
    lines
        Each from the end at which it is entered.
    ends
        (2 · lines,) which ends of pieces theirs are.
    """
    ends: list[int] = []
    rows: list[list[int]] = []
    for entries in tours.entries:
        for i, entry in enumerate(entries.tolist()):
            before = entries[i - 1] ^ 1 if i else -1
            # end 1 of a piece lies where end 0 of the next one does
            goes_on = (
                i > 0
                and line_of[entry >> 1] == line_of[before >> 1]
                and abs((entry >> 1) - (before >> 1)) == 1
                and (entry & 1) == int(entry < before)
                and (before & 1) == int(entry > before)
                and (apart is None or not (apart[entry] or apart[before]))
            )
            if goes_on:
                ends[-1] = entry ^ 1
                rows[-1].append(entry)
            else:
                ends += [entry, entry ^ 1]
                rows.append([entry])
    return tuple(_joined(lines, row) for row in rows), np.array(ends, dtype=np.int64)


def _joined(lines: tuple[SurveyLine, ...], entries: list[int]) -> SurveyLine:
    """Return pieces that follow on each other, entered at these ends, as one line."""
    ways = [lines[entry >> 1].way(entry) for entry in entries]
    points_m = np.concatenate([ways[0], *(way[1:] for way in ways[1:])])
    return replace(lines[entries[0] >> 1], points_m=points_m)


def _least_tour_m(work: PartWork) -> float:
    """Return a length that the longest tour has about at least: its share, or the way out."""
    ends = np.concatenate([line.ends_m for line in work.lines])
    away_m = work.harbour.distances(work.homes_m[:1], ends).max()
    return max(float(lengths_m(work.lines).sum()) / len(work.robots), 2.0 * float(away_m))


def _beside_ends(lines: tuple[SurveyLine, ...], work: PartWork, pitch_m: float) -> list[FloatArray]:
    """Return for each line the distances from its first end at which a neighbour ends beside it."""
    frame = work.sweep.frame
    lanes: dict[int, list[tuple[int, _Lane]]] = {}
    own: list[tuple[int, float, float] | None] = []
    for i, line in enumerate(lines):
        if line.kind is not LineKind.LANE or len(line.points_m) != 2:
            own.append(None)
            continue
        (x, a), (_, b) = frame.to_sweep(line.points_m).tolist()
        column = math.floor((x - work.sweep.column_x_m[0]) / pitch_m + 0.5)
        lanes.setdefault(column, []).append((i, _Lane(across_m=x, along_m=(min(a, b), max(a, b)))))
        own.append((column, a, b))
    out = []
    for i, place in enumerate(own):
        if place is None:
            out.append(np.zeros(0))
            continue
        column, a, b = place
        low, high = min(a, b) + MARGIN * pitch_m, max(a, b) - MARGIN * pitch_m
        found = [
            y
            for beside in (column - 1, column + 1)
            for j, lane in lanes.get(beside, ())
            if j != i
            for y in lane.along_m
            if low < y < high
        ]
        at = np.sort(np.abs(np.array(found, dtype=np.float64) - a))
        out.append(_apart(at, MARGIN * pitch_m))
    return out


def _apart(at_m: FloatArray, least_m: float) -> FloatArray:
    """Return rising places without those that lie too near the one before."""
    kept: list[float] = []
    for place in at_m.tolist():
        if not kept or place - kept[-1] >= least_m:
            kept.append(place)
    return np.array(kept, dtype=np.float64)


def _pieces(line: SurveyLine, at_m: FloatArray, longest_m: float) -> list[SurveyLine]:
    """Return a line cut at some places, and evenly between them where it is too long."""
    if line.kind is LineKind.TIE or line.kind is LineKind.EXTRA:
        return [line]
    whole = line.length_m
    borders = [0.0]
    for stop in [*at_m.tolist(), whole]:
        start = borders[-1]
        many = max(1, math.ceil((stop - start) / longest_m - 1e-9))
        borders.extend(start + (stop - start) * i / many for i in range(1, many + 1))
    borders[-1] = whole
    if len(borders) == 2:
        return [line]
    return [between(line, from_m, to_m) for from_m, to_m in pairwise(borders)]

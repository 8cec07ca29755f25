"""Oriented lines -> coverage paths: lines joined by transits in the water."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

import numpy as np

from mrmission.model import CoveragePath, FloatArray, LegKind, read_only
from mrmission.routing.harbour import Harbour


def assemble_paths(
    harbour: Harbour, lanes_m: Sequence[FloatArray | Sequence[FloatArray]]
) -> tuple[CoveragePath, ...]:
    """Return each robot's path from its berth over its lines, in order, and back.

    Parameters
    ----------
    harbour
        In-water paths; robot ``r`` (counted from 1) lives at berth ``r - 1``.
    lanes_m
        Per robot its lines in the direction in which they are swept: (n, 2, 2) lanes, or a
        sequence of (m, 2) polylines; there may be none.
    """
    lines_of: list[list[FloatArray]] = [list(lines) for lines in lanes_m]
    busy = [r for r, lines in enumerate(lines_of) if lines]

    def ends(lines: Iterable[FloatArray], which: int) -> FloatArray:
        return np.array([line[which] for line in lines], dtype=np.float64).reshape(-1, 2)

    out_ways = harbour.home_paths(busy, ends((lines_of[r][0] for r in busy), 0))
    back_ways = harbour.home_paths(busy, ends((lines_of[r][-1] for r in busy), -1))
    starts = ends((line for r in busy for line in lines_of[r][:-1]), -1)
    stops = ends((line for r in busy for line in lines_of[r][1:]), 0)
    ways = iter(harbour.paths(starts, stops))
    paths: list[CoveragePath] = []
    trips = dict(zip(busy, zip(out_ways, back_ways, strict=True), strict=True))
    for robot, lines in enumerate(lines_of):
        home = harbour.berths_m[robot]
        if robot not in trips:
            paths.append(make_path(robot + 1, home[None], [], []))
            continue
        out_way, back_way = trips[robot]
        pieces: list[tuple[FloatArray, LegKind, int]] = [(out_way, LegKind.TRANSIT, 0)]
        for i, line in enumerate(lines):
            if i:
                pieces.append((next(ways), LegKind.TRANSIT, 0))
            pieces.append((line, LegKind.SURVEY, i + 1))
        pieces.append((back_way[::-1], LegKind.TRANSIT, 0))
        paths.append(join_pieces(robot + 1, pieces))
    return tuple(paths)


def join_pieces(robot: int, pieces: Sequence[tuple[FloatArray, LegKind, int]]) -> CoveragePath:
    """Return the path of polylines that follow on each other, each of one kind and lane."""
    points: list[FloatArray] = [pieces[0][0][:1]]
    kind: list[int] = []
    lane: list[int] = []
    for line, what, number in pieces:
        points.append(line[1:])
        kind.extend([int(what)] * (len(line) - 1))
        lane.extend([number] * (len(line) - 1))
    return make_path(robot, np.concatenate(points), kind, lane)


def make_path(
    robot: int, points_m: FloatArray, kind: Sequence[int], lane: Sequence[int]
) -> CoveragePath:
    """Return a :class:`CoveragePath` without legs of no length."""
    kinds = np.array(kind, dtype=np.int8)
    lanes = np.array(lane, dtype=np.int64)
    if len(points_m) > 1:
        moved = np.any(np.diff(points_m, axis=0) != 0, axis=1)
        points_m = points_m[np.append(True, moved)]
        kinds, lanes = kinds[moved], lanes[moved]
    return CoveragePath(
        robot=robot,
        points_m=read_only(np.ascontiguousarray(points_m, dtype=np.float64)),
        kind=read_only(kinds),
        lane=read_only(lanes),
    )


def legs_of(path: CoveragePath) -> FloatArray:
    """Return (n, 2, 2) legs of a path."""
    return np.stack([path.points_m[:-1], path.points_m[1:]], axis=1)

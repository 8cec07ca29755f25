"""Whether each robot's lanes hang together, and how far transits run through others' lanes."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import numpy.typing as npt
import shapely

from mrmission.model import CoveragePath, IntArray, LegKind

MOST_CORNERS = 40
"""Pieces of a region have no more corners, where halving helps."""
BESIDE = 1.25
"""Lanes no farther apart than so many spacings lie beside each other."""


def survey_lines(path: CoveragePath) -> list[shapely.LineString]:
    """Return the lanes of a path, one line for each lane number; legs without a number alone."""
    out: list[shapely.LineString] = []
    survey = np.flatnonzero(path.kind == LegKind.SURVEY)
    if not len(survey):
        return out
    lane = path.lane[survey]
    first = np.append(True, (np.diff(survey) > 1) | (np.diff(lane) != 0) | (lane[1:] == 0))
    starts = np.flatnonzero(first)
    for a, b in zip(starts, np.append(starts[1:], len(survey)), strict=True):
        out.append(shapely.LineString(path.points_m[survey[a] : survey[b - 1] + 2]))
    return out


def connected(lines: Sequence[shapely.LineString], apart_m: float) -> IntArray:
    """Return the number of the piece that each line belongs to, (n,), from 0 in their order.

    Lines that come within `apart_m` of each other are of one piece.
    """
    count = len(lines)
    label = np.arange(count)
    if count < 2:
        return label
    tree = shapely.STRtree(lines)
    a, b = tree.query(np.array(lines, dtype=object), predicate="dwithin", distance=apart_m)
    a, b = a[a < b], b[a < b]
    while True:  # the smallest label of a piece spreads to all of it
        least = label.copy()
        np.minimum.at(least, a, label[b])
        np.minimum.at(least, b, label[a])
        least = least[least]
        if np.array_equal(least, label):
            break
        label = least
    return np.unique(label, return_inverse=True)[1].astype(np.int64)


def region_pieces(paths: Sequence[CoveragePath], spacing_m: float) -> tuple[int, ...]:
    """Return of how many connected pieces each robot's lanes are; 0 for a robot without work."""
    out = []
    for path in paths:
        label = connected(survey_lines(path), BESIDE * spacing_m)
        out.append(int(label.max(initial=-1)) + 1)
    return tuple(out)


def swept_regions(paths: Sequence[CoveragePath], spacing_m: float) -> list[shapely.Geometry]:
    """Return where each robot's lanes lie, half a spacing to either side of them."""
    return [
        shapely.union_all(
            shapely.buffer(
                np.array(survey_lines(path), dtype=object),
                spacing_m / 2,
                cap_style="flat",
                join_style="mitre",
            )
        )
        for path in paths
    ]


def crossings_m(paths: Sequence[CoveragePath], spacing_m: float) -> tuple[float, ...]:
    """Return how much of each robot's transits lies in regions of others and not in its own, m."""
    # bits of few corners each: a region of a thousand lanes is slow to cut a leg with
    bits_of = [_bits(region) for region in swept_regions(paths, spacing_m)]
    owner = np.repeat(np.arange(len(paths)), [len(bits) for bits in bits_of])
    bits = np.concatenate([np.zeros(0, dtype=object), *bits_of])
    tree = shapely.STRtree(bits)
    out = []
    for own, path in enumerate(paths):
        legs = shapely.linestrings(transit_legs(path))
        leg, other = tree.query(legs, predicate="intersects")
        foreign = owner[other] != own
        inside = shapely.intersection(legs[leg[foreign]], bits[other[foreign]])
        inside = inside[shapely.length(inside) > 0]
        # what its own lanes cover too is its own
        part, mine = tree.query(inside, predicate="intersects")
        kept = owner[mine] == own
        shared = shapely.intersection(inside[part[kept]], bits[mine[kept]])
        out.append(max(0.0, float(shapely.length(inside).sum() - shapely.length(shared).sum())))
    return tuple(out)


def _bits(region: shapely.Geometry) -> npt.NDArray[np.object_]:
    """Return a region in pieces of few corners, halved across their longer side as need be."""
    out: list[shapely.Geometry] = []
    todo = [p for p in shapely.get_parts(region) if p.geom_type == "Polygon"]
    while todo:
        piece = todo.pop()
        if shapely.get_num_coordinates(piece) <= MOST_CORNERS:
            out.append(piece)
            continue
        x1, y1, x2, y2 = piece.bounds
        if x2 - x1 >= y2 - y1:
            middle = (x1 + x2) / 2
            halves = (x1, y1, middle, y2), (middle, y1, x2, y2)
        else:
            middle = (y1 + y2) / 2
            halves = (x1, y1, x2, middle), (x1, middle, x2, y2)
        for half in halves:
            cut = shapely.intersection(piece, shapely.box(*half))
            parts = shapely.get_parts(cut)
            if any(
                shapely.get_num_coordinates(p) >= shapely.get_num_coordinates(piece) for p in parts
            ):
                out.append(cut)
                continue
            todo.extend(p for p in parts if p.geom_type == "Polygon")
    return np.array(out, dtype=object)


def transit_legs(path: CoveragePath) -> np.ndarray:
    """Return (n, 2, 2) the legs of a path that are transits."""
    legs = np.stack([path.points_m[:-1], path.points_m[1:]], axis=1)
    return legs[path.kind == LegKind.TRANSIT]

"""Whether each robot's lanes hang together, and how far transits run through others' lanes."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import shapely

from mrmission.model import BoolArray, CoveragePath, IntArray, LegKind

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
    regions = swept_regions(paths, spacing_m)
    tree = shapely.STRtree(regions)
    out = []
    for own, path in enumerate(paths):
        legs = shapely.linestrings(transit_legs(path))
        leg, other = tree.query(legs, predicate="intersects")
        mine: BoolArray = other == own
        leg, other = leg[~mine], other[~mine]
        # what its own lanes cover too is its own
        outside = shapely.difference(legs[leg], regions[own])
        inside = shapely.intersection(outside, np.array(regions, dtype=object)[other])
        out.append(float(shapely.length(inside).sum()))
    return tuple(out)


def transit_legs(path: CoveragePath) -> np.ndarray:
    """Return (n, 2, 2) the legs of a path that are transits."""
    legs = np.stack([path.points_m[:-1], path.points_m[1:]], axis=1)
    return legs[path.kind == LegKind.TRANSIT]

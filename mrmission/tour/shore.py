"""Shore laps: rings along the shore and about the islands, and the lanes that are left inside.

A lap keeps the lanes' ends off the shore: the sensor passes the bank alongside, and boats turn in
water that is swept already. Lap ``i`` lies ``(i - 1/2)`` spacings inside the navigable region, so
that laps and lanes lie side by side like lanes among themselves.
"""

from __future__ import annotations

import itertools
from dataclasses import dataclass

import numpy as np
import shapely

from mrmission.decomposition.slices import lane_intervals
from mrmission.model import FloatArray
from mrmission.tour.coverage import strips_of
from mrmission.tour.lines import LineKind, SurveyLine, lane_names, letters
from mrmission.tour.sweep import Sweep, lane_spacing_m

LEAST_SMOOTH, MOST_SMOOTH = 0.02, 0.06
"""Laps depart from the exact offset of the shore by up to a quarter of the overlap, within these
shares of the swath, to save waypoints; laps lie closer together where the overlap does not make
up for it."""
MITRE_LIMIT = 2.0
"""A lap goes round a headland at most twice as far off as along a straight shore."""
SHORTEST_SPACINGS = 3.0
"""A ring shorter than this many spacings circles a spot: lanes sweep it in less time."""
SNAP_SHARE = 0.2
"""A ring is cut at a corner, where one lies within this share of a piece from the even cut."""
_LANE_WORTH = 0.5
_SLIVER_SHARE = 0.05


@dataclass(frozen=True, slots=True, kw_only=True)
class ShoreLaps:
    """Laps and what they leave to the lanes.

    Attributes
    ----------
    lines
        Pieces of rings, each a line; S1a, S1b, … are the pieces of ring 1. Rings are numbered
        from the shore inwards, in each lap from the longest to the shortest.
    lap
        (lines,) which lap each piece belongs to, from 1.
    inner_m
        What the laps leave to the lanes, local frame.
    """

    lines: tuple[SurveyLine, ...]
    lap: tuple[int, ...]
    inner_m: shapely.Geometry


def shore_laps(
    region_m: shapely.Polygon,
    laps: int,
    swath_m: float,
    overlap: float,
    leg_tolerance_m: float,
    piece_m: float,
) -> ShoreLaps:
    """Return laps along all shores of a region.

    Parameters
    ----------
    region_m
        Navigable region, connected, local frame; the laps stay inside.
    laps
        How many; where the region is too narrow there are fewer.
    swath_m, overlap
        Width of the footprint, and the share of it that neighbours share.
    leg_tolerance_m
        How far a leg may depart between two readings of a straight line, see
        :func:`~mrmission.tour.sweep.lane_spacing_m`.
    piece_m
        About how long the pieces of a ring shall be: the length of a lane, so that robots can
        share a ring as they share lanes. It does not depend on the number of robots, so that
        the names don't either.
    """
    smooth = min(max(overlap / 4, LEAST_SMOOTH), MOST_SMOOTH) * swath_m
    # both neighbours may be smoothed towards each other's far side
    spacing = lane_spacing_m(swath_m, overlap, leg_tolerance_m + 2 * smooth)
    lines: list[SurveyLine] = []
    lap_of: list[int] = []
    number = 0
    for lap in range(1, laps + 1):
        core = shapely.buffer(
            region_m, -(lap - 0.5) * spacing, join_style="mitre", mitre_limit=MITRE_LIMIT
        )
        rings = [_smoothed(ring, smooth, region_m) for ring in _rings(core)]
        rings = [ring for ring in rings if _length_m(ring) >= SHORTEST_SPACINGS * spacing]
        for ring in sorted(rings, key=lambda r: (-round(_length_m(r), 3), *r.min(axis=0).tolist())):
            number += 1
            pieces = _cut(ring, piece_m)
            for i, piece in enumerate(pieces):
                name = f"S{number}" + (letters(i) if len(pieces) > 1 else "")
                lines.append(SurveyLine(points_m=piece, kind=LineKind.SHORE, name=name))
                lap_of.append(lap)
    inner = region_m
    if lines:
        # What lies within half a spacing is the laps' own; the overlap comes on top, as it does
        # between lanes. Slivers that smoothing and corners leave are no work for a lane.
        ways = shapely.MultiLineString([line.points_m for line in lines])
        band = shapely.buffer(ways, spacing / 2 + smooth, quad_segs=8)
        sliver = _SLIVER_SHARE * spacing
        inner = shapely.difference(region_m, band)
        inner = shapely.buffer(shapely.buffer(inner, -sliver), sliver, join_style="mitre")
        inner = shapely.intersection(inner, region_m)
    return ShoreLaps(lines=tuple(lines), lap=tuple(lap_of), inner_m=inner)


def _rings(core: shapely.Geometry) -> list[FloatArray]:
    """Return the closed rings of all boundaries, each (n, 2)."""
    return [
        shapely.get_coordinates(ring)
        for part in shapely.get_parts(core)
        if part.geom_type == "Polygon" and not part.is_empty
        for ring in (part.exterior, *part.interiors)
    ]


def _length_m(ring: FloatArray) -> float:
    return float(np.hypot(*np.diff(ring, axis=0).T).sum())


def _smoothed(ring: FloatArray, tolerance_m: float, region_m: shapely.Polygon) -> FloatArray:
    """Return a closed ring with few corners, from its most western corner, inside the region."""
    open_ring = ring[:-1]
    first = int(np.lexsort((open_ring[:, 1], open_ring[:, 0]))[0])
    turned = np.vstack([open_ring[first:], open_ring[: first + 1]])
    short = _long_chords(turned, tolerance_m)
    # the ring lies much farther inside than it was moved; but a narrow spit might be cut
    if len(short) >= 4 and region_m.covers(shapely.LineString(short)):
        return short
    return turned


def _long_chords(ring: FloatArray, tolerance_m: float) -> FloatArray:
    """Return corners of a closed ring so that the ring is within the tolerance of their chords.

    From each corner the chord goes as far as it can: on a round shore that makes about half as
    many as halving does (Douglas and Peucker), as each chord uses up the tolerance.
    """
    last = len(ring) - 1
    kept = [0]
    while kept[-1] < last:
        i = kept[-1]
        j = i + 1
        while j < last:
            chord = ring[j + 1] - ring[i]
            length = float(np.hypot(*chord))
            inner = ring[i + 1 : j + 1] - ring[i]
            if length == 0.0:
                break
            off = np.abs(inner[:, 0] * chord[1] - inner[:, 1] * chord[0]) / length
            along = inner @ chord / length
            # forward only: a chord that cuts off a spike is no way along it
            steps = np.diff(along, prepend=0.0, append=length)
            if off.max() > tolerance_m or steps.min() < -tolerance_m:
                break
            j += 1
        kept.append(j)
    return ring[kept]


def _cut(ring: FloatArray, piece_m: float) -> list[FloatArray]:
    """Cut a closed ring into about equal pieces, at corners where these are near."""
    at = np.append(0.0, np.cumsum(np.hypot(*np.diff(ring, axis=0).T)))
    count = max(1, round(at[-1] / piece_m))
    marks = [0.0]
    for i in range(1, count):
        even = i * at[-1] / count
        near = at[np.argmin(np.abs(at - even))]
        marks.append(float(near) if abs(near - even) <= SNAP_SHARE * at[-1] / count else even)
    marks.append(float(at[-1]))
    out = []
    for a, b in itertools.pairwise(marks):
        inner = (at > a + 1e-6) & (at < b - 1e-6)
        ends = [[np.interp(d, at, ring[:, axis]) for axis in (0, 1)] for d in (a, b)]
        out.append(np.vstack([ends[0], ring[inner], ends[1]]))
    return out


def lanes_inside(sweep: Sweep, inner_m: shapely.Geometry) -> tuple[SurveyLine, ...]:
    """Return the pieces of a sweep's lanes that are needed for what the laps leave.

    A lane is needed from the first to the last height at which its column holds anything of
    `inner_m`; gaps longer than two columns are left out. What is too small for a lane, a tip of
    a bay, is left to the repair of the finished tours, which bends a passing leg.

    Parameters
    ----------
    sweep
        Lanes of the whole region.
    inner_m
        What is to be swept, local frame.
    """
    inner = sweep.frame.turn(inner_m)
    pitch = sweep.column_pitch_m
    borders = np.append(sweep.column_x_m - pitch / 2, sweep.column_x_m[-1] + pitch / 2)
    column, low, high = [], [], []
    if not inner.is_empty:
        strips = strips_of(inner, borders)
        lane_col, lane_low, lane_high = lane_intervals(sweep.region, sweep.column_x_m)
        for c, strip in enumerate(strips):
            mine = np.flatnonzero(lane_col == c)
            if len(mine):
                for a, b in _needed(strip, lane_low[mine], lane_high[mine], pitch):
                    column.append(c)
                    low.append(a)
                    high.append(b)
    columns = np.array(column, dtype=np.int64)
    names = lane_names(
        sweep.frame.bearing_deg, len(sweep.column_x_m), columns, np.array(low, dtype=np.float64)
    )
    x = sweep.column_x_m[columns] if len(columns) else np.zeros(0)
    ends = np.stack([np.column_stack([x, low]), np.column_stack([x, high])], axis=1)
    return tuple(
        SurveyLine(points_m=way, kind=LineKind.LANE, name=name)
        for way, name in zip(sweep.frame.to_local(ends), names, strict=True)
    )


def _needed(
    strip: shapely.Geometry, low: FloatArray, high: FloatArray, pitch_m: float
) -> list[tuple[float, float]]:
    """Return the spans of one column's lanes (feet `low`, heads `high`) that its strip needs."""
    spans: list[list[list[float]]] = [[] for _ in low]
    for piece in shapely.get_parts(shapely.get_parts(strip)):
        if piece.geom_type != "Polygon" or piece.is_empty:
            continue
        _, bottom, _, top = piece.bounds
        small = piece.area < _LANE_WORTH * pitch_m**2 and top - bottom < pitch_m
        overlap = np.minimum(high, top) - np.maximum(low, bottom)
        if small or overlap.max() <= 0:
            continue
        for lane in np.flatnonzero(overlap > 0).tolist():
            spans[lane].append([max(float(low[lane]), bottom), min(float(high[lane]), top)])
    out: list[tuple[float, float]] = []
    for own in spans:
        merged: list[list[float]] = []
        for a, b in sorted(own):
            if merged and a - merged[-1][1] <= 2 * pitch_m:
                merged[-1][1] = max(merged[-1][1], b)
            else:
                merged.append([a, b])
        out.extend((a, b) for a, b in merged if b > a)
    return out

"""One polygon as given (an outer ring and islands) to valid water, and what was repaired.

The rule of every repair here: land never shrinks silently, and no island is dropped silently. An
island without area stays an obstacle, :data:`OBSTACLE_RADIUS_M` around it; where a ring crosses
itself, what it encloses ambiguously is land.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import shapely

from mrmission.area.earth import area_m2, area_text, degree_lengths_m
from mrmission.area.rings import Ring, faces_of, length_text, place_of, size_m
from mrmission.errors import GeometryError

OBSTACLE_RADIUS_M = 1.0
"""What is kept around an island or a spike into the water that has no area."""

NO_AREA_M2 = 0.01
"""Rings and pieces of water smaller than this have no area."""

MAX_LOOP_SHARE = 0.01
MAX_LOOP_M2 = 10_000.0
"""A loop of the shore that is larger (share of the lake, m²) is no slip of the pen: refused."""


@dataclass(frozen=True, slots=True, kw_only=True)
class RawPolygon:
    """A polygon as given: rings with continuous longitudes, its label for messages."""

    label: str
    shell: Ring
    holes: tuple[Ring, ...]


def several(numbers: Sequence[int | str], noun: str = "island", limit: int = 4) -> str:
    """Return a list of numbers for a message.

    Examples
    --------
    >>> several([3]), several([1, 2]), several([1, 2, 3, 4, 5, 6])
    ('island 3', 'islands 1, 2', '6 islands (1, 2, 3, 4, …)')
    """
    shown = ", ".join(map(str, numbers[:limit]))
    if len(numbers) == 1:
        return f"{noun} {shown}"
    if len(numbers) <= limit:
        return f"{noun}s {shown}"
    return f"{len(numbers)} {noun}s ({shown}, …)"


def widened(geometry_lonlat: shapely.Geometry, radius_m: float) -> shapely.Geometry:
    """Return a point or line in lon/lat widened to at least `radius_m` on all sides."""
    point = geometry_lonlat.centroid
    scale = np.array(degree_lengths_m(point.y))
    origin = np.array([point.x, point.y])
    flat = shapely.transform(geometry_lonlat, lambda c: (c - origin) * scale)
    # an octagon around the circle, not in it
    wide = flat.buffer(radius_m / math.cos(math.pi / 8), quad_segs=2)
    return shapely.transform(wide, lambda c: c / scale + origin)


def water_of(raw: RawPolygon) -> tuple[list[shapely.Polygon], list[str]]:
    """Return the water of one polygon as disjoint valid polygons, and a note per repair.

    Raises
    ------
    GeometryError
        When the polygon has no area, its shore crosses itself, or islands fill it.
    """
    notes: list[str] = []
    open_rings = [i for i, r in enumerate((raw.shell, *raw.holes)) if not r.was_closed]
    if open_rings:
        names = ["outer ring" if i == 0 else f"island {i}" for i in open_rings[:4]]
        more = ", …" if len(open_rings) > 4 else ""
        notes.append(f"{', '.join(names)}{more}: ring was not closed; closed it")
    drawn = _as_drawn(raw)
    if drawn is not None:
        return [drawn], _labelled(raw.label, notes)
    before = len(notes)
    shell = _shell(raw.shell, notes)
    islands = _islands(raw.holes, notes)
    _note_relations(shell, islands, notes)
    water = shell.difference(shapely.union_all([land for _, land in islands]))
    parts = [
        part
        for part in shapely.get_parts(shapely.make_valid(water))
        if isinstance(part, shapely.Polygon) and area_m2(part) >= NO_AREA_M2
    ]
    if not parts:
        which = several([number for number, _ in islands])
        verb = "fills" if len(islands) == 1 else "fill"
        raise GeometryError(f"nothing is left to cover: {which} {verb} the lake")
    if len(notes) == before and len(parts) == 1:
        notes.append("islands touch the shore along edges; taken as shore")
    return parts, _labelled(raw.label, notes)


def _labelled(label: str, notes: list[str]) -> list[str]:
    return [f"{label}: {note}" if label else note for note in notes]


def _as_drawn(raw: RawPolygon) -> shapely.Polygon | None:
    """Return the polygon exactly as drawn where nothing has to be repaired."""
    rings = [ring.lonlat for ring in (raw.shell, *raw.holes)]
    if min(map(len, rings)) < 4:
        return None
    drawn = shapely.Polygon(rings[0], rings[1:])
    if not drawn.is_valid:
        return None
    lon_m, lat_m = degree_lengths_m(float(rings[0][0, 1]))
    areas = shapely.area(shapely.polygons([shapely.linearrings(ring) for ring in rings]))
    return drawn if areas.min() * lon_m * lat_m >= NO_AREA_M2 else None


def _shell(ring: Ring, notes: list[str]) -> shapely.Geometry:
    """Return the area inside the shore, and note what was removed."""
    if ring.distinct < 3:
        raise GeometryError(
            f"the polygon has no area: its outer ring has {ring.distinct} distinct position(s), "
            "at least 3 are needed"
        )
    plain = shapely.Polygon(ring.lonlat)
    if plain.is_valid:
        if area_m2(plain) < NO_AREA_M2:
            raise GeometryError("the polygon has no area; draw the outline of the lake")
        return plain
    faces = faces_of(ring.lonlat)
    sizes = [area_m2(face) for face in faces.polygons]
    if not sizes or max(sizes) < NO_AREA_M2:
        raise GeometryError("the polygon has no area: all positions lie on one line")
    largest = int(np.argmax(sizes))
    sign = faces.winding[largest]
    water = [f for f, w in zip(faces.polygons, faces.winding, strict=True) if w == sign]
    loops = [
        (size, face)
        for face, w, size in zip(faces.polygons, faces.winding, sizes, strict=True)
        if w not in (sign, 0) and size >= NO_AREA_M2
    ]
    lost = sum(size for size, _ in loops)
    total = sum(area_m2(face) for face in water)
    if abs(sign) != 1 or lost > min(MAX_LOOP_SHARE * total, MAX_LOOP_M2):
        # the largest loop beside the lake touches it where the ring crosses itself
        other = max(loops, key=lambda loop: loop[0], default=(0.0, faces.polygons[largest]))[1]
        crossing = other.intersection(shapely.union_all(water)) if loops else other
        crossing = crossing if not crossing.is_empty else other
        raise GeometryError(
            f"outer ring crosses itself near {place_of(crossing)} (a loop of "
            f"{area_text(lost)} beside {area_text(total)}); fix the polygon"
        )
    for _, loop in sorted(loops, key=lambda item: -item[0])[:4]:
        notes.append(f"removed a {length_text(size_m(loop))} loop at {place_of(loop)}")
    if len(loops) > 4:
        notes.append(f"removed {len(loops) - 4} more loops of the outer ring, all smaller")
    shell = shapely.union_all(water)
    parts = shapely.get_parts(shell)
    if len(parts) > 1:
        notes.append(f"the outer ring touches itself; its water is in {len(parts)} parts")
    shell = _without_spikes(shell, faces.spikes, "", notes)
    if not notes:
        notes.append(f"the outer ring touches itself ({shapely.is_valid_reason(plain)})")
    return shell


def _without_spikes(
    shell: shapely.Geometry, spikes: shapely.Geometry, of: str, notes: list[str]
) -> shapely.Geometry:
    """Note the spikes; one that reaches into the water stays an obstacle."""
    spikes = shapely.line_merge(spikes)
    lines = [line for line in shapely.get_parts(spikes) if size_m(line) > 0.001]
    for line in sorted(lines, key=lambda line: -line.length)[:4]:
        wet = line.intersection(shell)
        inside = wet.length > 1e-9 and not shell.boundary.covers(wet)
        kept = f"; kept an obstacle {OBSTACLE_RADIUS_M:g} m around it" if inside else ""
        notes.append(
            f"removed zero-width spike{of}, {length_text(size_m(line))} long, at "
            f"{place_of(line)}{kept}"
        )
    if len(lines) > 4:
        notes.append(f"removed {len(lines) - 4} more zero-width spikes{of}")
    wet = shapely.intersection(shapely.MultiLineString(lines), shell) if lines else None
    if wet is not None and wet.length > 1e-9 and not shell.boundary.covers(wet):
        return shell.difference(widened(wet, OBSTACLE_RADIUS_M))
    return shell


def _islands(holes: Sequence[Ring], notes: list[str]) -> list[tuple[int, shapely.Geometry]]:
    """Return every island as land, with its number counted from 1."""
    islands: list[tuple[int, shapely.Geometry]] = []
    flat: list[int] = []
    for number, ring in enumerate(holes, start=1):
        land: shapely.Geometry
        plain = shapely.Polygon(ring.lonlat) if ring.distinct >= 3 else None
        if plain is None or (plain.is_valid and area_m2(plain) < NO_AREA_M2):
            flat.append(number)
            land = widened(_line_or_point(ring), OBSTACLE_RADIUS_M)
        elif plain.is_valid:
            land = plain
        else:
            land = _twisted_island(ring)
            if area_m2(land) < NO_AREA_M2:
                flat.append(number)
                land = widened(_line_or_point(ring), OBSTACLE_RADIUS_M)
            else:
                notes.append(
                    f"island {number} crosses or touches itself near {place_of(land)}; treated as "
                    "the union of its lobes"
                )
        islands.append((number, land))
    if flat:
        first = place_of(shapely.Point(holes[flat[0] - 1].lonlat[0]))
        if len(flat) == 1:
            text = (
                f"dropped island {flat[0]} at {first}: it has no area; kept an obstacle "
                "{} around it"
            )
        else:
            text = (
                f"dropped {several(flat)}: they have no area (the first at {first}); kept an "
                "obstacle {} around each"
            )
        notes.append(text.format(f"{OBSTACLE_RADIUS_M:g} m"))
    return islands


def _line_or_point(ring: Ring) -> shapely.Geometry:
    if ring.distinct == 1:
        return shapely.Point(ring.lonlat[0])
    return shapely.unary_union(shapely.LineString(ring.lonlat))


def _twisted_island(ring: Ring) -> shapely.Geometry:
    """Return all that an invalid island ring encloses, however often; spikes widened."""
    faces = faces_of(ring.lonlat)
    filled = [shapely.Polygon(face.exterior) for face in faces.polygons]
    spikes = faces.spikes
    if not spikes.is_empty and spikes.length > 0:
        filled.append(widened(spikes, OBSTACLE_RADIUS_M))
    return shapely.union_all(filled)


def _note_relations(
    shell: shapely.Geometry, islands: list[tuple[int, shapely.Geometry]], notes: list[str]
) -> None:
    """Note islands that lie outside, cross the shore, overlap or contain each other."""
    if not islands:
        return
    numbers = [number for number, _ in islands]
    lands = np.array([land for _, land in islands], dtype=object)
    shapely.prepare(shell)
    covered = shapely.covers(shell, lands)
    outside, crossing = [], []
    for i in np.flatnonzero(~covered):
        wet = shapely.intersection(lands[i], shell).area
        if wet <= 1e-9 * lands[i].area:
            outside.append(numbers[i])
        elif wet < lands[i].area * (1 - 1e-9):
            crossing.append(numbers[i])
    if outside:
        verb = "is" if len(outside) == 1 else "are"
        notes.append(f"{several(outside)} {verb} outside the lake; ignored")
    if crossing:
        verb = "crosses" if len(crossing) == 1 else "cross"
        notes.append(f"{several(crossing)} {verb} the shore; cut at the shore")
    tree = shapely.STRtree(lands)
    pairs = tree.query(lands, predicate="intersects")
    nested: dict[int, int] = {}
    overlap: list[str] = []
    edge: list[str] = []
    for a, b in sorted((int(a), int(b)) for a, b in pairs.T if a < b):
        inner, outer = (a, b) if lands[a].area < lands[b].area else (b, a)
        common = lands[a].intersection(lands[b])
        if common.area >= lands[inner].area * (1 - 1e-9):
            nested.setdefault(numbers[inner], numbers[outer])
        elif common.area > 0:
            overlap.append(f"{numbers[a]} and {numbers[b]}")
        elif common.length > 0:
            edge.append(f"{numbers[a]} and {numbers[b]}")
    for inner, outer in list(nested.items())[:4]:
        notes.append(
            f"island {inner} lies inside island {outer}; ignored (draw a pond as its own polygon)"
        )
    if len(nested) > 4:
        notes.append(f"{len(nested) - 4} more islands lie inside others; ignored")
    for found, what in ((overlap, "overlap"), (edge, "share an edge")):
        if found:
            more = f", … ({len(found)} pairs)" if len(found) > 4 else ""
            notes.append(f"islands {', '.join(found[:4])}{more} {what}; merged")

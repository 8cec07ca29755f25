"""Several polygons to disjoint water: parts, ponds, tiles, and islands drawn as features."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import shapely

from mrmission.area.earth import area_m2, area_text
from mrmission.area.repair import NO_AREA_M2, several
from mrmission.errors import GeometryError

SLIVER_SHARE = 1e-3
"""Polygons that overlap by less than this share of the smaller are neighbours, drawn by hand."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Water:
    """The water of one polygon of the file; ``number`` counts the polygons from 1."""

    number: int
    label: str
    geometry: shapely.MultiPolygon

    @property
    def title(self) -> str:
        """How messages call it."""
        return self.label or f"polygon {self.number}"


def combine(
    waters: list[Water], *, islands: bool = False
) -> tuple[list[shapely.Polygon], list[str]]:
    """Return disjoint polygons, largest first, that together are the water, and notes.

    Parameters
    ----------
    waters : list of Water
        Valid water of every polygon in the file.
    islands : bool
        Take a polygon that lies inside another's water as an island of it.

    Raises
    ------
    GeometryError
        When a polygon lies inside another's water, fills an island of it, or overlaps it: it may
        be an island, and nobody plans over an island.
    """
    notes: list[str] = []
    pieces = [piece for water in waters for piece in water.geometry.geoms]
    if len(waters) > 1:
        _note_ponds(waters, notes)
        if not shapely.is_valid(shapely.MultiPolygon(pieces)):
            pieces = _disjoint(waters, islands, notes)
    sizes = [area_m2(piece) for piece in pieces]
    order = sorted(range(len(pieces)), key=lambda i: (-sizes[i], pieces[i].bounds))
    return [pieces[i] for i in order], notes


def _disjoint(waters: list[Water], islands: bool, notes: list[str]) -> list[shapely.Polygon]:
    geometries = np.array([water.geometry for water in waters], dtype=object)
    pairs = shapely.STRtree(geometries).query(geometries, predicate="intersects")
    inside: dict[int, list[int]] = {}
    overlapping: list[tuple[int, int]] = []
    dropped: set[int] = set()
    for a, b in sorted((int(a), int(b)) for a, b in pairs.T if a < b):
        if a in dropped or b in dropped:
            continue
        small, large = (a, b) if geometries[a].area < geometries[b].area else (b, a)
        common = geometries[a].intersection(geometries[b]).area
        if common <= SLIVER_SHARE * geometries[small].area:
            continue
        if common >= (1 - 1e-9) * geometries[large].area:
            dropped.add(b)
            notes.append(f"{waters[b].title} repeats {waters[a].title}; used once")
        elif common >= 0.99 * geometries[small].area:
            inside.setdefault(large, []).append(small)
        else:
            overlapping.append((small, large))
    if not islands:
        _refuse_inside(waters, inside)
        for small, large in overlapping:
            raise GeometryError(
                f"{waters[small].title} and {waters[large].title} overlap: merge them if both are "
                "water, or cut the island out as a hole"
            )
    lands = {small for found in inside.values() for small in found}
    lands |= {small for small, _ in overlapping}
    if lands:
        names = [waters[i].title for i in sorted(lands)]
        notes.append(f"{_listed(names)} taken as {'an island' if len(names) == 1 else 'islands'}")
    kept = [i for i in range(len(waters)) if i not in lands and i not in dropped]
    joined = shapely.union_all(geometries[kept])
    if lands:
        filled = [shapely.Polygon(p.exterior) for i in sorted(lands) for p in geometries[i].geoms]
        joined = joined.difference(shapely.union_all(filled))
    pieces = [
        part
        for part in shapely.get_parts(joined)
        if isinstance(part, shapely.Polygon) and area_m2(part) >= NO_AREA_M2
    ]
    if not pieces:
        raise GeometryError("nothing is left to cover: islands fill the lake")
    if len(pieces) < sum(len(geometries[i].geoms) for i in kept):
        notes.append("polygons that share an edge were joined")
    return pieces


def _refuse_inside(waters: list[Water], inside: dict[int, list[int]]) -> None:
    for large, found in inside.items():
        names = _listed([waters[i].title for i in found])
        verb, ask = ("lies", "is it an island") if len(found) == 1 else ("lie", "are they islands")
        raise GeometryError(
            f"{names} {verb} inside {waters[large].title}: {ask}? "
            "use holes, or the option --islands to take them as islands"
        )


def _note_ponds(waters: list[Water], notes: list[str]) -> None:
    """Note water inside an island of other water; refuse where it fills the island.

    Raises
    ------
    GeometryError
        When a polygon fills an island or shares its shore: it is the island, drawn once more.
    """
    holes: list[shapely.Polygon] = []
    owner: list[int] = []
    for i, water in enumerate(waters):
        for piece in water.geometry.geoms:
            for ring in piece.interiors:
                holes.append(shapely.Polygon(ring))
                owner.append(i)
    if not holes:
        return
    geometries = np.array([water.geometry for water in waters], dtype=object)
    pairs = shapely.STRtree(holes).query(geometries, predicate="intersects")
    ponds: dict[int, int] = {}
    for i, hole in sorted((int(i), int(h)) for i, h in pairs.T):
        pond, island = geometries[i], holes[hole]
        common = 0.0 if owner[hole] == i else pond.intersection(island).area
        if common < 0.5 * pond.area:
            continue  # elsewhere, or around the island: then it overlaps the water about it
        shared = pond.boundary.intersection(island.exterior)
        if common >= 0.95 * island.area or shared.length > 0 or not pond.covered_by(island):
            verb = "fills" if common >= 0.95 * island.area else "lies on the shore of"
            raise GeometryError(
                f"{waters[i].title} {verb} an island of {waters[owner[hole]].title}: is it the "
                "island? remove it, or remove the hole if it is water"
            )
        ponds.setdefault(i, owner[hole])
    for i, other in list(ponds.items())[:3]:
        notes.append(
            f"{waters[i].title} lies within an island of {waters[other].title}; taken as a pond"
        )
    if len(ponds) > 3:
        notes.append(f"{len(ponds) - 3} more polygons lie within islands; taken as ponds")


def _listed(titles: list[str]) -> str:
    """Return titles for a message; features and polygons by their numbers alone."""
    words = [title.rsplit(" ", 1) for title in titles]
    nouns = {word[0] for word in words}
    if len(nouns) == 1 and all(len(word) == 2 and word[1].isdigit() for word in words):
        return several([word[1] for word in words], noun=nouns.pop())
    return ", ".join(titles[:4]) + (", …" if len(titles) > 4 else "")


def choose(
    pieces: list[shapely.Polygon],
    part: int | None,
    *,
    polygons: int,
    sizes_m2: list[float] | None = None,
) -> tuple[list[shapely.Polygon], list[str]]:
    """Return the chosen part, or all of them, and a note where there is a choice.

    Parameters
    ----------
    pieces : list of Polygon
        Disjoint parts, largest first.
    part : int or None
        Number of the part to keep, 1 = largest; None keeps all.
    polygons : int
        How many polygons the file holds, for the note.
    sizes_m2 : list of float, optional
        Areas of the parts, m², where they are not in lon/lat.

    Raises
    ------
    GeometryError
        When there is no such part.
    """
    sizes = [area_text(size) for size in sizes_m2 or map(area_m2, pieces)]
    listed = ", ".join(f"{i}: {size}" for i, size in enumerate(sizes[:5], start=1))
    listed += ", …" if len(sizes) > 5 else ""
    if part is not None:
        if not 1 <= part <= len(pieces):
            parts = (
                f"1 part ({sizes[0]})" if len(pieces) == 1 else f"{len(pieces)} parts ({listed})"
            )
            raise GeometryError(f"--part {part}: the water has {parts}; choose 1 to {len(pieces)}")
        if len(pieces) == 1:
            return pieces, []
        return [pieces[part - 1]], [
            f"used part {part} of {len(pieces)} ({listed}); 1 is the largest"
        ]
    if len(pieces) == 1:
        return pieces, []
    what = (
        f"{len(pieces)} separate water bodies"
        if polygons > 1
        else f"water is in {len(pieces)} parts that no boat can pass between"
    )
    note = (
        f"{what} ({listed}): only what a start reaches is planned; choose one with --part, or give "
        "each a --start of its own"
    )
    return pieces, [note]

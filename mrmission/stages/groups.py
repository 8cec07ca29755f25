"""The parts of the water that a robot can reach, and which robots sweep which part."""

from __future__ import annotations

import numpy as np
import shapely

from mrmission.area.frame import LocalFrame
from mrmission.area.region import default_start, part_of, snap_start
from mrmission.model import FloatArray
from mrmission.options import PlanOptions
from mrmission.tour.coverage import total_area

Group = tuple[shapely.Polygon, FloatArray, tuple[int, ...]]


def robots_by_part(
    pieces: list[shapely.Polygon],
    water: shapely.MultiPolygon,
    frame: LocalFrame,
    options: PlanOptions,
    notes: list[str],
) -> tuple[list[Group], list[shapely.Polygon]]:
    """Return the parts that have a start, with the starts and robots of each, and the others."""
    everyone = tuple(range(1, options.robots + 1))
    if not options.starts_lonlat:
        part = pieces[0]
        starts = default_start(part)[None]
        lon, lat = frame.to_lonlat(starts)[0]
        notes.append(f"start chosen at the shore of the largest part: {lon:.6f},{lat:.6f}")
        groups = [(part, starts, everyone)]
    else:
        by_part: dict[int, tuple[list[FloatArray], list[int]]] = {}
        for i, lonlat in enumerate(options.starts_lonlat):
            given = frame.to_metric(np.array([lonlat], dtype=np.float64))[0]
            start, note = snap_start(shapely.MultiPolygon(pieces), given, frame)
            index = part_of(pieces, start)
            if note:
                notes.append(note)
            mine = by_part.setdefault(index, ([], []))
            mine[0].append(start)
            mine[1].append(i + 1)
        if len(options.starts_lonlat) == 1:
            ((index, (starts_of, _)),) = by_part.items()
            groups = [(pieces[index], np.array(starts_of), everyone)]
        else:
            groups = [
                (pieces[index], np.array(s), tuple(r)) for index, (s, r) in sorted(by_part.items())
            ]
    reached = {id(part) for part, _, _ in groups}
    unreached = sorted((p for p in pieces if id(p) not in reached), key=lambda p: -p.area)
    for p in unreached[:5]:
        lon, lat = frame.to_lonlat(shapely.get_coordinates(p.representative_point()))[0]
        notes.append(
            f"not planned: {p.area:,.0f} m² of water near {lon:.5f},{lat:.5f}, "
            "no boat can reach it from a start"
        )
    if len(unreached) > 5:
        rest = total_area(unreached[5:])
        notes.append(f"not planned: {len(unreached) - 5} smaller parts, {rest:,.0f} m² in all")
    return groups, unreached

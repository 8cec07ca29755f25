"""Draw the fictional areas of this folder: the same bytes every time.

    python geofences/sources/draw.py

Writes demo_lake.geojson, harbour.geojson and quarry.png beside this folder. Shorelines go through
the control points below by a closed Catmull-Rom spline and are roughened by midpoint
displacement. Places on the globe are arbitrary.
"""

from __future__ import annotations

import json
import math
from pathlib import Path

import numpy as np
import pyproj
import shapely
from PIL import Image, ImageDraw

OUT = Path(__file__).resolve().parents[1]
GEOD = pyproj.Geod(ellps="WGS84")

# Control points in metres, [east, north].
DEMO_SHORE = [
    (-640, -60), (-590, 150), (-440, 260), (-250, 250), (-120, 340), (40, 430), (210, 400),
    (300, 280), (470, 300), (640, 220), (690, 60), (560, -40), (600, -190), (500, -330),
    (300, -360), (170, -270), (20, -320), (-120, -430), (-300, -440), (-380, -320), (-330, -200),
    (-480, -210),
]  # fmt: skip
DEMO_ISLANDS = [
    [(-330, 60), (-290, 120), (-220, 130), (-180, 70), (-210, 10), (-290, 0)],
    [(60, 210), (110, 270), (180, 260), (190, 190), (130, 150), (80, 160)],
    [(300, 60), (350, 130), (450, 140), (480, 70), (410, 30), (340, 10)],
    [(20, -100), (60, -50), (130, -40), (150, -110), (90, -160), (40, -150)],
    [(-190, -280), (-150, -240), (-100, -260), (-110, -320), (-170, -330)],
    [(330, -170), (370, -140), (420, -160), (410, -220), (350, -220)],
    [(-80, 60), (-60, 82), (-34, 76), (-32, 48), (-62, 40)],
]
HARBOUR_WATER = [
    # Outer basin, entrance channel (18 m wide), inner basin, canal (12 m), pond.
    (0, 0), (310, 0), (310, 96), (360, 96), (360, 30), (560, 30), (560, 170), (590, 170),
    (590, 60), (690, 40), (760, 90), (770, 190), (700, 240), (602, 230), (602, 182), (560, 182),
    (560, 260), (420, 300), (360, 280), (360, 114), (310, 114), (310, 210), (240, 250), (90, 250),
    (0, 190),
]  # fmt: skip
HARBOUR_PIERS = [
    # Piers and pontoons that stand free in the water, and a dolphin of three piles.
    [(40, 60), (200, 60), (200, 68), (40, 68)],
    [(40, 110), (200, 110), (200, 118), (40, 118)],
    [(40, 160), (200, 160), (200, 168), (40, 168)],
    [(250, 40), (258, 40), (258, 170), (250, 170)],
    [(400, 70), (520, 70), (520, 76), (463, 76), (463, 200), (457, 200), (457, 76), (400, 76)],
    [(500, 130), (506, 130), (506, 136), (500, 136)],
    [(660, 120), (690, 105), (715, 125), (705, 160), (670, 165)],
]
QUARRY_SHORE = [
    (30, 60), (80, 28), (150, 22), (210, 40), (262, 26), (330, 30), (372, 70), (380, 130),
    (352, 178), (368, 236), (320, 276), (250, 262), (200, 280), (130, 272), (70, 250), (40, 200),
    (58, 150), (24, 110),
]  # fmt: skip
QUARRY_OBSTACLES = [
    [(118, 92), (140, 84), (152, 100), (146, 122), (124, 124)],
    [(236, 130), (268, 118), (288, 140), (280, 172), (250, 180), (230, 158)],
    [(176, 196), (196, 190), (204, 208), (190, 222), (174, 214)],
    [(310, 84), (326, 80), (332, 96), (318, 102)],
]


def spline(points: list[tuple[float, float]], steps: int) -> np.ndarray:
    """Return the closed Catmull-Rom spline, `steps` points between two control points."""
    p1 = np.array(points, dtype=float)
    p0, p2, p3 = np.roll(p1, 1, axis=0), np.roll(p1, -1, axis=0), np.roll(p1, -2, axis=0)
    out = [
        0.5 * (2 * p1 + (p2 - p0) * t + (2 * p0 - 5 * p1 + 4 * p2 - p3) * t**2
               + (3 * p1 - p0 - 3 * p2 + p3) * t**3)
        for t in np.arange(steps) / steps
    ]  # fmt: skip
    return np.stack(out, axis=1).reshape(-1, 2)


def roughen(ring: np.ndarray, levels: int, roughness: float, seed: int) -> np.ndarray:
    """Midpoint displacement of a closed ring, by a share of each edge's length."""
    random = np.random.default_rng(seed)
    for _ in range(levels):
        edge = np.roll(ring, -1, axis=0) - ring
        normal = np.column_stack([-edge[:, 1], edge[:, 0]])
        shift = random.normal(0.0, roughness, len(ring))[:, None]
        ring = np.stack([ring, ring + edge / 2 + normal * shift], axis=1).reshape(-1, 2)
    return ring


def lonlat_polygon(shape: shapely.Polygon, lon_deg: float, lat_deg: float) -> shapely.Polygon:
    """Put a polygon in metres on the globe, seven decimals, exterior counter-clockwise."""
    projection = pyproj.Proj(f"+proj=tmerc +lat_0={lat_deg} +lon_0={lon_deg} +datum=WGS84")
    placed = shapely.transform(
        shape, lambda xy: np.round(np.column_stack(projection(*xy.T, inverse=True)), 7)
    )
    return shapely.orient_polygons(placed, exterior_cw=False)


def write(name: str, polygon: shapely.Polygon, properties: dict[str, object]) -> None:
    """Write one RFC 7946 Feature."""
    area_km2 = abs(GEOD.geometry_area_perimeter(polygon)[0]) / 1e6
    rings = [polygon.exterior, *polygon.interiors]
    feature = {
        "type": "Feature",
        "properties": {
            **properties,
            "area_km2": round(area_km2, 4),
            "islands": len(polygon.interiors),
        },
        "geometry": {
            "type": "Polygon",
            "coordinates": [shapely.get_coordinates(ring).tolist() for ring in rings],
        },
    }
    text = json.dumps(feature, separators=(",", ":"), ensure_ascii=False)
    (OUT / name).write_text(text + "\n", encoding="utf-8")


def main() -> None:
    """Draw all."""
    shore = 1.19 * roughen(spline(DEMO_SHORE, 3), 2, 0.11, seed=1)
    islands = [
        1.19 * roughen(spline(ring, 3), 1, 0.12, seed=2 + i) for i, ring in enumerate(DEMO_ISLANDS)
    ]
    write(
        "demo_lake.geojson",
        lonlat_polygon(shapely.Polygon(shore, islands), 14.0, 60.0),
        {
            "name": "Demo lake (fictional)",
            "source": "drawn for mrmission by geofences/sources/draw.py; no real lake",
            "licence": "CC0-1.0",
            "licence_file": "LICENSE.CC0-1.0.txt",
        },
    )
    cosine, sine = math.cos(0.2), math.sin(0.2)  # turned a little: no edge runs due north
    harbour = [
        [(x * cosine - y * sine, x * sine + y * cosine) for x, y in ring]
        for ring in (HARBOUR_WATER, *HARBOUR_PIERS)
    ]
    write(
        "harbour.geojson",
        lonlat_polygon(shapely.Polygon(harbour[0], harbour[1:]), 11.0, 58.0),
        {
            "name": "Harbour with pond (fictional)",
            "source": "drawn for mrmission by geofences/sources/draw.py; no real harbour",
            "licence": "CC0-1.0",
            "licence_file": "LICENSE.CC0-1.0.txt",
        },
    )
    image = Image.new("L", (400, 300), 0)
    pen = ImageDraw.Draw(image)
    pen.polygon([tuple(p) for p in roughen(spline(QUARRY_SHORE, 5), 1, 0.07, seed=20)], fill=255)
    for i, ring in enumerate(QUARRY_OBSTACLES):
        pen.polygon([tuple(p) for p in roughen(spline(ring, 4), 1, 0.05, seed=21 + i)], fill=0)
    pen.rectangle((84, 170, 118, 176), fill=0)  # a floating pump station
    pen.line([(330, 200), (300, 226)], fill=0, width=5)  # the old conveyor
    image.convert("1").save(OUT / "quarry.png", optimize=True)


if __name__ == "__main__":
    main()

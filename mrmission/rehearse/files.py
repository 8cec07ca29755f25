"""What a rehearsal leaves: ``rehearse.json``, the tracks as GeoJSON and CSV, and their folder."""

from __future__ import annotations

import io
import json
import math
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import shapely

from mrmission.errors import ConfigError
from mrmission.mission.files import write_whole
from mrmission.rehearse.judge import FleetDriven
from mrmission.rehearse.track import Track
from mrmission.report.metrics import plain

NAMES = ("rehearse.json", "tracks.geojson", "tracks.csv", "tracks.png", "tracks.svg")
GEOJSON_THIN_DEG = 2e-7
"""Positions that lie this close to the line between their neighbours are left out (2 cm)."""


def check_folder(folder: Path, overwrite: bool) -> None:
    """Refuse a folder that holds a rehearsal already, before any work is done.

    Raises
    ------
    ConfigError
        When it is a file, or holds a rehearsal and `overwrite` is false.
    """
    if folder.exists() and not folder.is_dir():
        raise ConfigError(f"--out {folder}: is a file; name a folder")
    if not overwrite and folder.is_dir():
        there = [name for name in NAMES if (folder / name).exists()]
        if there:
            raise ConfigError(
                f"--out {folder}: holds a rehearsal already ({there[0]}); name another folder, "
                "or give --overwrite"
            )


def rehearse_text(driven: FleetDriven) -> str:
    """Return ``rehearse.json``: every figure, keys sorted, what is not known as null."""
    return json.dumps(plain(driven), indent=2, sort_keys=True, allow_nan=False) + "\n"


def tracks_csv(tracks: Sequence[Track]) -> str:
    """Return the tracks as CSV: one row per position, seconds since the trip's own start."""
    out = io.StringIO()
    out.write("robot,time_s,longitude,latitude,heading_deg,item,sortie\n")
    for track in tracks:
        rows = zip(
            (track.time_s - track.started_s).tolist(),
            track.lonlat.tolist(),
            track.heading_deg.tolist(),
            track.item.tolist(),
            strict=True,
        )
        for time_s, (lon, lat), heading, item in rows:
            bow = f"{heading:.2f}" if math.isfinite(heading) else ""
            out.write(
                f"{track.robot},{time_s:.3f},{lon:.7f},{lat:.7f},{bow},{item},{track.sortie}\n"
            )
    return out.getvalue()


def tracks_geojson(tracks: Sequence[Track]) -> str:
    """Return the tracks as GeoJSON: one line per robot while under way, one while watched."""
    features: list[dict[str, Any]] = []
    for track in tracks:
        for phase, mask in (("under way", track.under_way()), ("end", track.afterwards())):
            if np.count_nonzero(mask) < 2:
                continue
            line = shapely.simplify(shapely.LineString(track.lonlat[mask]), GEOJSON_THIN_DEG)
            points = [[round(x, 7), round(y, 7)] for x, y in shapely.get_coordinates(line).tolist()]
            features.append(
                {
                    "type": "Feature",
                    "properties": {
                        "robot": track.robot,
                        "sortie": track.sortie,
                        "phase": phase,
                        "seconds": round(float(np.ptp(track.time_s[mask])), 3),
                    },
                    "geometry": {"type": "LineString", "coordinates": points},
                }
            )
    return json.dumps({"type": "FeatureCollection", "features": features}) + "\n"


def write_rehearsal(
    driven: FleetDriven, tracks: Sequence[Track], folder: Path, overwrite: bool
) -> list[Path]:
    """Write the report and the tracks, whole or not at all; return the files."""
    files = {
        "rehearse.json": rehearse_text(driven),
        "tracks.geojson": tracks_geojson(tracks),
        "tracks.csv": tracks_csv(tracks),
    }
    for name, text in files.items():
        write_whole(folder / name, text, overwrite)
    return [folder / name for name in files]

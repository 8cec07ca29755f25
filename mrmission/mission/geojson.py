"""The tours of a fleet as GeoJSON (RFC 7946)."""

from __future__ import annotations

import json
from collections.abc import Sequence
from typing import Any

from mrmission.mission.tracks import tracks
from mrmission.model import LegKind, Mission


def tours_geojson(missions: Sequence[Mission]) -> str:
    """Return lanes and transits of all missions as a FeatureCollection of LineStrings.

    Each feature's properties are robot, sortie, kind (``"survey"`` or ``"transit"``), lane (0 on a
    transit), the mission items at which it begins and ends, and the name and kind of the survey
    line (null on a transit).

    Parameters
    ----------
    missions
        One for each robot and sortie.
    """
    rows = []
    for mission in missions:
        for track in tracks(mission):
            named = 0 < track.lane <= len(mission.lines)
            line = mission.lines[track.lane - 1] if named else None
            feature: dict[str, Any] = {
                "type": "Feature",
                "properties": {
                    "robot": mission.robot,
                    "sortie": mission.sortie,
                    "kind": "survey" if track.kind == LegKind.SURVEY else "transit",
                    "lane": track.lane,
                    "from_item": track.from_item,
                    "to_item": track.to_item,
                    "line": line.name if line else None,
                    "line_kind": line.kind if line else None,
                },
                "geometry": {
                    "type": "LineString",
                    "coordinates": [[lon / 1e7, lat / 1e7] for lat, lon in track.points_e7],
                },
            }
            rows.append(json.dumps(feature, separators=(",", ":")))
    return '{"type":"FeatureCollection","features":[\n' + ",\n".join(rows) + "\n]}\n"

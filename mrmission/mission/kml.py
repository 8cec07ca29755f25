"""The tours of a fleet as KML, for Google Earth and phones.

References
----------
OGC KML 2.3, OGC 12-007r2.
"""

from __future__ import annotations

import colorsys
from collections import Counter
from collections.abc import Sequence
from xml.sax.saxutils import escape

from mrmission.mission.mavlink import degrees_text
from mrmission.mission.tracks import Track, line_label, tracks
from mrmission.model import LegKind, Mission


def tours_kml(missions: Sequence[Mission], name: str = "mrmission") -> str:
    """Return the tours as a KML document: a folder for each robot, lanes thick, transits thin.

    Parameters
    ----------
    missions
        One for each robot and sortie.
    name
        Title of the document.
    """
    out = [
        '<?xml version="1.0" encoding="UTF-8"?>',
        '<kml xmlns="http://www.opengis.net/kml/2.2">',
        "<Document>",
        f"<name>{escape(name)}</name>",
    ]
    for index in range(len(missions)):
        colour = _colour(index, len(missions))
        for kind, width in (("survey", 3), ("transit", 1)):
            out.append(
                f'<Style id="{kind}-{index + 1}"><LineStyle><color>{colour}</color>'
                f"<width>{width}</width></LineStyle></Style>"
            )
    trips = Counter(mission.robot for mission in missions)
    for index, mission in enumerate(missions):
        title = f"robot {mission.robot}"
        if trips[mission.robot] > 1:
            title += f", sortie {mission.sortie}"
        out.append(f"<Folder><name>{title}</name>")
        if mission.items:
            home = mission.items[0]
            out.append(
                f"<Placemark><name>home {mission.robot}</name><Point><coordinates>"
                f"{degrees_text(home.y)},{degrees_text(home.x)}</coordinates></Point></Placemark>"
            )
        out.extend(
            _placemark(track, index + 1, line_label(mission, track.lane))
            for track in tracks(mission)
        )
        out.append("</Folder>")
    out += ["</Document>", "</kml>"]
    return "\n".join(out) + "\n"


def _placemark(track: Track, style: int, label: str) -> str:
    survey = track.kind == LegKind.SURVEY
    name = escape(label) if survey else "transit"
    points = " ".join(f"{degrees_text(lon)},{degrees_text(lat)}" for lat, lon in track.points_e7)
    return (
        f"<Placemark><name>{name}</name>"
        f"<description>items {track.from_item} to {track.to_item}</description>"
        f"<styleUrl>#{'survey' if survey else 'transit'}-{style}</styleUrl>"
        f"<LineString><tessellate>1</tessellate><coordinates>{points}</coordinates></LineString>"
        "</Placemark>"
    )


def _colour(index: int, count: int) -> str:
    """Return a colour as KML has it, aabbggrr; hues are spread evenly over the robots."""
    red, green, blue = (
        round(255 * v) for v in colorsys.hsv_to_rgb(index / max(count, 1), 0.9, 0.9)
    )
    return f"ff{blue:02x}{green:02x}{red:02x}"

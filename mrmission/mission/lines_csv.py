"""``lines.csv``: every survey line of a fleet, where and by whom it is swept."""

from __future__ import annotations

import csv
import io
from collections.abc import Sequence

from mrmission.model import LineReport

COLUMNS = (
    "line",
    "kind",
    "robot",
    "sortie",
    "from_item",
    "to_item",
    "start_lon_deg",
    "start_lat_deg",
    "end_lon_deg",
    "end_lat_deg",
    "length_m",
    "bearing_deg",
)


def lines_csv(lines: Sequence[LineReport]) -> str:
    """Return survey lines as CSV (RFC 4180, lines end in a line feed), in the order given.

    Parameters
    ----------
    lines
        Of all missions. The bearing is empty where a line ends where it starts.
    """
    out = io.StringIO()
    rows = csv.writer(out, lineterminator="\n")
    rows.writerow(COLUMNS)
    for line in lines:
        places = [f"{degrees:.7f}" for degrees in (*line.start_lonlat, *line.end_lonlat)]
        bearing = "" if line.bearing_deg is None else f"{line.bearing_deg:.1f}"
        rows.writerow(
            [
                line.name,
                line.kind,
                line.robot,
                line.sortie,
                line.from_item,
                line.to_item,
                *places,
                f"{line.length_m:.1f}",
                bearing,
            ]
        )
    return out.getvalue()

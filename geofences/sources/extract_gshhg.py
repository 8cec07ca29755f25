"""Rebuild lakes from GSHHG's binned netCDF file, as Debian packages it (gmt-gshhg-full).

    python geofences/sources/extract_gshhg.py /usr/share/gmt-gshhg/binned_GSHHS_f.nc

Needs netCDF4. A shoreline is stored as segments, one set for each bin of 1 degree: those of
a polygon are joined end to end where they cross from bin to bin. Islands are the polygons whose
parent is the lake.
"""

from __future__ import annotations

import sys
from pathlib import Path

import netCDF4
import numpy as np
import shapely
from draw import write

LAKES = {
    181510: ("lake_murray.geojson", "Lake Murray, South Carolina"),
    185275: ("klawock_lake.geojson", "Klawock Lake, Alaska"),
    182164: ("chiemsee.geojson", "Chiemsee, Bavaria"),
}
JOIN_DEG = 2e-5


class Shorelines:
    """The full-resolution shorelines of one binned file."""

    def __init__(self, path: Path) -> None:
        with netCDF4.Dataset(path) as data:
            data.set_auto_mask(False)
            read = data.variables.__getitem__
            self.parent = read("Id_of_parent_polygons")[:]
            self.polygon = read("Id_of_GSHHS_ID")[:]
            self.first = read("Id_of_first_point_in_a_segment")[:]
            # The lower nine bits hold level, entry and exit side.
            self.count = read("Embedded_npts_levels_exit_entry_for_a_segment")[:] >> 9
            self.bin_deg = int(read("Bin_size_in_minutes")[0]) / 60
            self.columns = int(read("N_bins_in_360_longitude_range")[0])
            start = read("Id_of_first_segment_in_a_bin")[:]
            segments = read("N_segments_in_a_bin")[:]
            self.bin = np.empty(len(self.polygon), dtype=np.int64)
            for index, (first, number) in enumerate(zip(start, segments, strict=True)):
                self.bin[first : first + number] = index
            # Stored as signed, meant as unsigned 16 bits.
            self.east = read("Relative_longitude_from_SW_corner_of_bin")[:].astype(int) & 0xFFFF
            self.north = read("Relative_latitude_from_SW_corner_of_bin")[:].astype(int) & 0xFFFF

    def segment(self, index: int) -> np.ndarray:
        """Return longitude and latitude of one segment, degrees."""
        row, column = divmod(int(self.bin[index]), self.columns)
        points = slice(self.first[index], self.first[index] + self.count[index])
        return np.column_stack(
            [
                (column + self.east[points] / 65535) * self.bin_deg,
                90 - (row + 1) * self.bin_deg + self.north[points] / 65535 * self.bin_deg,
            ]
        )

    def ring(self, polygon: int) -> np.ndarray:
        """Return the outline of one polygon, closed."""
        pieces = [self.segment(i) for i in np.flatnonzero(self.polygon == polygon)]
        ring = pieces.pop(0)
        while pieces:
            gaps = [np.abs(ring[-1] - piece[0]).max() for piece in pieces]
            best = int(np.argmin(gaps))
            if gaps[best] > JOIN_DEG:
                raise SystemExit(f"polygon {polygon}: a gap of {gaps[best]} degrees")
            ring = np.vstack([ring, pieces.pop(best)[1:]])
        if np.abs(ring[0] - ring[-1]).max() > JOIN_DEG:
            raise SystemExit(f"polygon {polygon}: not closed")
        ring[-1] = ring[0]
        keep = np.r_[True, np.any(np.diff(ring, axis=0) != 0, axis=1)]
        ring = ring[keep]
        ring[:, 0] = (ring[:, 0] + 180) % 360 - 180
        return np.round(ring, 7)

    def lake(self, polygon: int) -> shapely.Polygon:
        """Return a lake with its islands, exterior counter-clockwise."""
        islands = [self.ring(int(i)) for i in np.flatnonzero(self.parent == polygon)]
        return shapely.orient_polygons(
            shapely.Polygon(self.ring(polygon), islands), exterior_cw=False
        )


def main() -> None:
    """Write the lakes."""
    shorelines = Shorelines(Path(sys.argv[1]))
    for polygon, (file, name) in LAKES.items():
        write(
            file,
            shorelines.lake(polygon),
            {
                "name": name,
                "source": f"GSHHG 2.3.7, full resolution, polygon {polygon}; "
                "Debian package gmt-gshhg-full 2.3.7-6; by P. Wessel and W. H. F. Smith",
                "licence": "LGPL-3.0-or-later",
                "licence_file": "LICENSE.LGPL-3.txt",
            },
        )


if __name__ == "__main__":
    main()

"""Lengths of a degree on WGS 84: sizes in messages and tolerances, not for plans."""

from __future__ import annotations

import math

import shapely

SEMI_MAJOR_M = 6_378_137.0
FLATTENING = 1 / 298.257223563
SEMI_MINOR_M = SEMI_MAJOR_M * (1 - FLATTENING)
_E2 = FLATTENING * (2 - FLATTENING)


def degree_lengths_m(lat_deg: float) -> tuple[float, float]:
    """Return the length of a degree of longitude and of latitude at a latitude, m.

    Parameters
    ----------
    lat_deg : float
        Latitude, degrees.

    Returns
    -------
    tuple of float
        Metres per degree of longitude, metres per degree of latitude.
    """
    lat = math.radians(lat_deg)
    w2 = 1 - _E2 * math.sin(lat) ** 2
    lon_m = math.cos(lat) * SEMI_MAJOR_M / math.sqrt(w2)
    lat_m = SEMI_MAJOR_M * (1 - _E2) / w2**1.5
    return math.radians(lon_m), math.radians(lat_m)


def area_m2(geometry_lonlat: shapely.Geometry) -> float:
    """Return the area of a lon/lat geometry, m² (to about 1 % for up to 2° of latitude)."""
    if geometry_lonlat.is_empty:
        return 0.0
    lon_m, lat_m = degree_lengths_m(geometry_lonlat.centroid.y)
    return float(geometry_lonlat.area * lon_m * lat_m)


def area_text(area_m2: float) -> str:
    """Return an area for a message: m² below 10,000 m², else km².

    Examples
    --------
    >>> area_text(812.3), area_text(1_234_567), area_text(5.1e14)
    ('812 m²', '1.23 km²', '510 million km²')
    """
    if area_m2 < 10:
        return f"{area_m2:.2g} m²"
    if area_m2 < 1e4:
        return f"{area_m2:.0f} m²"
    if area_m2 < 1e8:
        return f"{area_m2 / 1e6:.3g} km²"
    if area_m2 < 1e12:
        return f"{area_m2 / 1e6:,.0f} km²"
    return f"{area_m2 / 1e12:.3g} million km²"


def place_text(lon_deg: float, lat_deg: float) -> str:
    """Return a position for a message: lon,lat with six decimals (a decimetre).

    Examples
    --------
    >>> place_text(-81.3, 34.06)
    '-81.300000,34.060000'
    """
    return f"{lon_deg:.6f},{lat_deg:.6f}"

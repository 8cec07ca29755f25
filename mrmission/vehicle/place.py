"""Where a vehicle is, against where its mission starts."""

from __future__ import annotations

from mrmission.model import Mission
from mrmission.vehicle.links import StoreVehicle

DEFAULT_MAX_DISTANCE_M = 1000.0


def home_lonlat(mission: Mission) -> tuple[float, float] | None:
    """Return where a mission starts: its home, else a rally point, else a corner of its fence.

    None where it says nothing of a place.
    """
    if mission.items:
        return mission.items[0].y / 1e7, mission.items[0].x / 1e7
    if mission.rally:
        return mission.rally[0].lon_e7 / 1e7, mission.rally[0].lat_e7 / 1e7
    for polygon in mission.fence:
        lat_e7, lon_e7 = polygon.points_e7[0].tolist()
        return lon_e7 / 1e7, lat_e7 / 1e7
    return None


def distance_m(a_lonlat: tuple[float, float], b_lonlat: tuple[float, float]) -> float:
    """Return the distance of two places on the ellipsoid, metres."""
    import pyproj

    geod = pyproj.Geod(ellps="WGS84")
    _, _, metres = geod.inv(*a_lonlat, *b_lonlat)
    return float(metres)


async def distance_from_home_m(vehicle: StoreVehicle, mission: Mission) -> float | None:
    """Return how far a vehicle lies from its mission's home, None where that is not known."""
    home = home_lonlat(mission)
    if home is None:
        return None
    place = await vehicle.position()
    return None if place is None else distance_m(place, home)

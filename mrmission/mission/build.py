"""A coverage path -> what one vehicle gets: items, fence and rally point, in 1e-7 degrees."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import shapely

from mrmission.area.frame import LocalFrame
from mrmission.area.legs import subdivide_legs
from mrmission.errors import InfeasibleError
from mrmission.mission.fence import fit_fence
from mrmission.mission.items import build_items, merge_collinear, wrap_lon_deg
from mrmission.mission.mavlink import e7
from mrmission.model import CoveragePath, FencePolygon, FloatArray, Mission, RallyPoint, read_only
from mrmission.options import PlanOptions

LAUNCH_RADIUS_M = 15.0
"""Water within this radius of a home is inside the fence: a boat drifts before it is armed."""
MERGE_TOLERANCE_M = 0.01


@dataclass(frozen=True, slots=True, kw_only=True)
class Route:
    """A path as exported: ``lonlat`` (n, 2) degrees rounded to 1e-7, and the path they make."""

    lonlat: FloatArray
    path: CoveragePath


@dataclass(frozen=True, slots=True, kw_only=True)
class BuiltMission:
    """A mission, the path it sails (exported coordinates) and what its fence had to take in."""

    mission: Mission
    path: CoveragePath
    fence_land_m2: float
    notes: tuple[str, ...]


def export_route(path: CoveragePath, frame: LocalFrame, tolerance_m: float) -> Route:
    """Merge collinear points, subdivide long legs, round to 1e-7 degrees.

    A coordinate of exactly 0, on the equator or at Greenwich, becomes 1e-7 degrees (1 cm): in
    mission items 0 also stands for "not given", and programs that read them take it so.
    """
    points, kind, lane = merge_collinear(path.points_m, path.kind, path.lane, MERGE_TOLERANCE_M)
    if len(points) > 1:
        points, source = subdivide_legs(points, frame, tolerance_m)
        kind, lane = kind[source], lane[source]
    lonlat = np.round(frame.to_lonlat(points) * 1e7) / 1e7
    lonlat[lonlat == 0.0] = 1e-7
    return Route(
        lonlat=lonlat,
        path=CoveragePath(
            robot=path.robot,
            points_m=read_only(frame.to_metric(lonlat)),
            kind=read_only(kind),
            lane=read_only(lane),
        ),
    )


def _airspace(
    water_m: shapely.Polygon, launch: shapely.Polygon, options: PlanOptions
) -> shapely.Polygon:
    """Return where a copter flies: the water, its launch place, and what its turns need."""
    beyond_m = max(options.runs_m) - options.clearance_m
    if beyond_m > -options.fence_margin_m:
        # half a metre for the roundness of the buffer and for rounding
        water_m = water_m.buffer(beyond_m + options.fence_margin_m + 0.5)
    return shapely.union(water_m, launch)


def _who(robot: int, sortie: int) -> str:
    return f"robot {robot}" + (f", sortie {sortie}" if sortie > 1 else "")


def build_mission(
    route: Route,
    robot: int,
    home_m: FloatArray,
    water_m: shapely.MultiPolygon,
    frame: LocalFrame,
    options: PlanOptions,
    sortie: int = 1,
) -> BuiltMission:
    """Return what robot `robot` gets for its route, the trip number `sortie` of it.

    Raises
    ------
    InfeasibleError
        When the fence cannot hold the route within the vehicle's budget.
    """
    items, kind, lane = build_items(route.lonlat, route.path.kind, route.path.lane, options)
    home = shapely.Point(home_m)
    copter = options.vehicle == "copter"
    # A return goes to the nearest of home and rally points. A copter's home is where it was armed,
    # on dry land; the planned one lies over the water, and a rally point there would be nearer.
    rally: tuple[RallyPoint, ...] = ()
    if not copter:
        lat_e7, lon_e7 = e7(route.lonlat[0, 1]), e7(wrap_lon_deg(route.lonlat[0, 0]))
        rally = (RallyPoint(lat_e7=lat_e7, lon_e7=lon_e7),)
    fence: tuple[FencePolygon, ...] = ()
    land_m2, notes = 0.0, []
    if options.fence and len(route.lonlat) > 1:
        part = min(water_m.geoms, key=home.distance)
        launch = home.buffer(LAUNCH_RADIUS_M)
        if copter:
            part = _airspace(part, launch, options)
        else:
            launch = part.intersection(launch)
        try:
            fit = fit_fence(
                part, [route.path.points_m], options.fence_room_m, options.limits, keep=[launch],
                frame=frame,
            )  # fmt: skip
        except InfeasibleError as error:
            raise InfeasibleError(f"{_who(robot, sortie)}: {error}") from error
        fence = fit.polygons
        land_m2 = fit.land_m2
        notes = [f"{_who(robot, sortie)}: {note}" for note in fit.notes]
    return BuiltMission(
        mission=Mission(
            robot=robot,
            sortie=sortie,
            vehicle=options.vehicle,
            items=items,
            fence=fence,
            rally=rally,
            kind=kind,
            lane=lane,
        ),
        path=route.path,
        fence_land_m2=land_m2,
        notes=tuple(notes),
    )

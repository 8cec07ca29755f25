"""What a preflight compares: the numbers of a plan, and the state of the vehicle that has it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import shapely

from mrmission.mission import mavlink
from mrmission.mission.check import navigation_path, unwrap_e7
from mrmission.mission.failsafe import smart_rtl_points, straight_ways
from mrmission.mission.fence import metres_per_degree
from mrmission.mission.wanted import WantedParameter, wanted_parameters
from mrmission.model import FloatArray, IntArray, Mission
from mrmission.options import VehicleLimits


@dataclass(frozen=True, slots=True, kw_only=True)
class PlanFacts:
    """What the checks need to know of one robot's plan; None where the files do not say.

    ``nearest_fence_m`` is the smallest distance of the way from a fence edge, ``bad_return_share``
    the share of the way from which a straight return leaves ``return_over`` (land or the fence),
    ``bad_return_m`` the longest such stretch, ``smart_rtl_points`` what SmartRTL needs to keep the
    whole way. ``lap_m`` is the length from the first waypoint on.
    """

    robot: int
    vehicle: str
    items: int
    fence_polygons: int
    fence_inclusions: int
    fence_bytes: int
    fence_largest: int
    rally_points: int
    length_m: float
    farthest_m: float
    nearest_fence_m: float
    start_lonlat: tuple[float, float] | None
    bad_return_share: float
    bad_return_m: float
    return_over: str
    smart_rtl_points: int
    speeds_m_s: tuple[float, ...]
    swath_m: float | None
    survey_speed_m_s: float | None
    transit_speed_m_s: float | None
    wanted: tuple[WantedParameter, ...]


@dataclass(frozen=True, slots=True, kw_only=True)
class VehicleState:
    """What a vehicle said of itself; None where it said nothing.

    ``stored`` says of each store what is different from the plan, empty where it is the plan's.
    ``home_inside`` and ``position_inside`` compare with the plan's fence.
    """

    system_id: int
    armed: bool
    mode: str
    limits: VehicleLimits
    gps_fix: int | None = None
    satellites: int | None = None
    hdop: float | None = None
    prearm_ok: bool | None = None
    ahrs_ok: bool | None = None
    texts: tuple[str, ...] = ()
    start_distance_m: float | None = None
    position_inside: bool | None = None
    home_distance_m: float | None = None
    home_inside: bool | None = None
    stored: Mapping[str, str] | None = None


class PlanGeometry:
    """A mission in metres around its home: its way, its fence.

    Parameters
    ----------
    mission
        With home as item 0; one without items has a fence and no way.
    """

    def __init__(self, mission: Mission) -> None:
        points, _ = navigation_path(mission)
        first = points[0] if len(points) else _anchor(mission)
        self._origin = np.array(first, dtype=np.int64)
        lon_m, lat_m = metres_per_degree(float(self._origin[0]) / 1e7)
        self._scale = np.array([lat_m, lon_m]) / 1e7
        self.way_m = self._metres(points)
        rings = [(p.inclusion, shapely.Polygon(self._metres(p.points_e7))) for p in mission.fence]
        inside = [ring for inclusion, ring in rings if inclusion]
        outside = [ring for inclusion, ring in rings if not inclusion]
        self.allowed: shapely.Geometry | None = None
        if inside:
            self.allowed = shapely.difference(
                shapely.intersection_all(inside), shapely.union_all(outside)
            )
        self.edges = shapely.union_all([ring.exterior for _, ring in rings])

    def _metres(self, points_e7: IntArray) -> FloatArray:
        near = unwrap_e7(points_e7.reshape(-1, 2), int(self._origin[1]))
        out: FloatArray = ((near - self._origin) * self._scale)[:, ::-1]
        return out

    def point_m(self, lonlat: tuple[float, float]) -> FloatArray:
        """Return ``[east_m, north_m]`` of a position, from the mission's home."""
        e7 = np.array([[round(lonlat[1] * 1e7), round(lonlat[0] * 1e7)]], dtype=np.int64)
        return self._metres(e7)[0]

    def inside(self, lonlat: tuple[float, float]) -> bool | None:
        """Return whether a position is inside the fence, None without a fence."""
        if self.allowed is None:
            return None
        return bool(shapely.intersects_xy(self.allowed, *self.point_m(lonlat)))

    def home_distance_m(self, lonlat: tuple[float, float]) -> float:
        """Return how far a position is from the mission's home."""
        return float(np.hypot(*self.point_m(lonlat)))


def _anchor(mission: Mission) -> tuple[int, int]:
    """Return a position of a mission without a way, ``(lat, lon)`` in 1e-7 degrees."""
    if mission.rally:
        return mission.rally[0].lat_e7, mission.rally[0].lon_e7
    for polygon in mission.fence:
        lat, lon = polygon.points_e7[0].tolist()
        return lat, lon
    return 0, 0


def plan_facts(
    mission: Mission, geometry: PlanGeometry, report: Mapping[str, Any] | None
) -> PlanFacts:
    """Return what the checks need of one mission.

    Parameters
    ----------
    mission
        As read from its ``.plan`` file.
    geometry
        Of the same mission.
    report
        Content of the plan's ``report.json``; without it, swath and speeds are not known.
    """
    way = geometry.way_m
    home = way[0] if len(way) else np.zeros(2)
    limits = VehicleLimits()
    sizes = [len(p.points_e7) for p in mission.fence]
    nearest = np.inf
    if len(way) > 1 and len(sizes):
        nearest = float(shapely.distance(geometry.edges, shapely.LineString(way)))
    ways = straight_ways(way, home, geometry.allowed) if geometry.allowed is not None else None
    share, longest, over = (ways.share, ways.outside_m, "the fence") if ways else (0.0, 0.0, "")
    known = _return_over_land(report, mission.robot)
    if known is not None:
        share, longest, over = *known, "land"
    options = _own_options((report or {}).get("options", {}), mission.robot)
    return PlanFacts(
        robot=mission.robot,
        vehicle=mission.vehicle,
        items=len(mission.items),
        fence_polygons=len(sizes),
        fence_inclusions=sum(p.inclusion for p in mission.fence),
        fence_bytes=sum(limits.fence_bytes_of(size) for size in sizes),
        fence_largest=max(sizes, default=0),
        rally_points=len(mission.rally),
        length_m=float(np.hypot(*np.diff(way, axis=0).T).sum()),
        farthest_m=float(np.hypot(*(way - home).T).max(initial=0.0)),
        nearest_fence_m=nearest,
        start_lonlat=_start(mission),
        bad_return_share=share,
        bad_return_m=longest,
        return_over=over,
        smart_rtl_points=smart_rtl_points(way),
        speeds_m_s=tuple(
            sorted({i.param2 for i in mission.items if i.command == mavlink.DO_CHANGE_SPEED})
        ),
        swath_m=_number(options, "swath_m"),
        survey_speed_m_s=_number(options, "survey_speed_m_s"),
        transit_speed_m_s=_number(options, "transit_speed_m_s"),
        wanted=wanted_parameters(mission),
    )


def _start(mission: Mission) -> tuple[float, float] | None:
    if mission.items:
        return mission.items[0].y / 1e7, mission.items[0].x / 1e7
    if mission.rally:
        return mission.rally[0].lon_e7 / 1e7, mission.rally[0].lat_e7 / 1e7
    return None


def _own_options(options: Mapping[str, Any], robot: int) -> Mapping[str, Any]:
    """Return a report's options as they are for one robot: in a mixed fleet it has its own."""
    fleet = options.get("fleet") or ()
    if not isinstance(fleet, Sequence) or not 1 <= robot <= len(fleet):
        return options
    return {**options, **fleet[robot - 1]}


def _number(options: Mapping[str, Any], name: str) -> float | None:
    value = options.get(name)
    return float(value) if isinstance(value, int | float) and value > 0 else None


def _return_over_land(report: Mapping[str, Any] | None, robot: int) -> tuple[float, float] | None:
    """Return share and longest stretch of the straight returns over land, where the report has it.

    The plan knows the shore; the fence is what the vehicle's memory could hold of it.
    """
    rows: Sequence[Mapping[str, Any]] = ((report or {}).get("failsafe") or {}).get(
        "straight_returns", ()
    )
    for row in rows:
        if row.get("robot") == robot:
            return float(row["share_over_land"]), float(row["longest_over_land_m"])
    return None

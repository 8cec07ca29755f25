"""Small synthetic plans, made without any stage of the program."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pyproj
import shapely
from shapely import affinity

from mrmission.model import (
    CoveragePath,
    FencePolygon,
    FleetPlan,
    FleetReport,
    LegKind,
    Mission,
    MissionItem,
    RallyPoint,
    RobotReport,
    SurveyArea,
    read_only,
)

FRAME = "+proj=tmerc +lat_0=47.5 +lon_0=11.2 +k=1 +x_0=0 +y_0=0 +datum=WGS84 +units=m +no_defs"


def blob(east_m: float, north_m: float, radius_m: float, *, seed: int = 0, n: int = 90) -> Any:
    """A wavy round outline."""
    phase = np.random.default_rng(seed).uniform(0, 2 * math.pi, 4)
    angle = np.linspace(0, 2 * math.pi, n, endpoint=False)
    radius = radius_m * (
        1 + sum(0.18 / (i + 1) * np.sin((i + 2) * angle + phase[i]) for i in range(4))
    )
    return shapely.Polygon(
        np.column_stack([east_m + radius * np.cos(angle), north_m + radius * np.sin(angle)])
    )


def make_plan(
    *,
    robots: int = 4,
    swath_m: float = 20.0,
    name: str = "Test lake",
    clearance_m: float = 10.0,
    pond: bool = True,
    lane_points: int = 2,
    **report_changes: Any,
) -> FleetPlan:
    """A lake of 0.6 km² with islands, swept by vertical lanes dealt out in blocks."""
    islands = [blob(-220, 60, 60, seed=5), blob(150, -90, 80, seed=6), blob(240, 190, 35, seed=7)]
    water = affinity.scale(blob(0, 0, 430, seed=3, n=240), 1.25, 1.0).difference(
        shapely.union_all(islands)
    )
    if pond:
        water = water.union(blob(640, 420, 50, seed=9))
    water = _multi(water)
    eroded = _multi(water.buffer(-clearance_m))
    region = shapely.MultiPolygon([max(eroded.geoms, key=lambda part: part.area)])
    unreached = eroded.area - region.area
    projection = pyproj.Proj(FRAME)

    lanes = []
    west, south, east, north = region.bounds
    for number, x in enumerate(np.arange(west + swath_m / 2, east, swath_m)):
        cut = region.intersection(shapely.LineString([(x, south - 1), (x, north + 1)]))
        for part in sorted(shapely.get_parts(cut), key=lambda g: g.bounds[1]):
            ends = shapely.get_coordinates(part)
            if len(ends) == 2:
                lanes.append(ends if number % 2 == 0 else ends[::-1])
    homes = np.array([[west + 60 + 12 * r, -80.0 + 9 * (r % 3)] for r in range(robots)])
    paths, missions, rows = [], [], []
    for robot in range(1, robots + 1):
        share = lanes[(robot - 1) * len(lanes) // robots : robot * len(lanes) // robots]
        points, kind, lane = [homes[robot - 1]], [], []
        for number, ends in enumerate(share, 1):
            steps = np.linspace(ends[0], ends[1], lane_points)
            points += list(steps)
            kind += [LegKind.TRANSIT] + [LegKind.SURVEY] * (lane_points - 1)
            lane += [0] + [number] * (lane_points - 1)
        if share:
            points.append(homes[robot - 1])
            kind.append(LegKind.TRANSIT)
            lane.append(0)
        paths.append(
            CoveragePath(
                robot=robot,
                points_m=read_only(np.array(points)),
                kind=read_only(np.array(kind, dtype=np.int8)),
                lane=read_only(np.array(lane, dtype=np.int64)),
            )
        )
        lon, lat = projection(*np.array(points).T, inverse=True)
        e7 = np.rint(np.column_stack([lat, lon]) * 1e7).astype(int)
        items, item_kind, item_lane = [], [], []
        for index, (x, y) in enumerate(e7.tolist()):
            if index == 2:  # the speed change comes after the first waypoint
                items.append(_item(len(items), 178, 0, 0))
                item_kind.append(0)
                item_lane.append(0)
            items.append(_item(len(items), 16, x, y))
            item_kind.append(int(kind[index - 1]) if index else 0)
            item_lane.append(lane[index - 1] if index else 0)
        fence = []
        for ring, inclusion in (
            (water.geoms[0].exterior, True),
            *((ring, False) for ring in water.geoms[0].interiors),
        ):
            points_m = shapely.get_coordinates(ring.simplify(4))[:-1]
            fence.append(
                FencePolygon(
                    inclusion=inclusion,
                    points_e7=np.rint(
                        np.column_stack(projection(*points_m.T, inverse=True))[:, ::-1] * 1e7
                    ).astype(np.int64),
                )
            )
        missions.append(
            Mission(
                robot=robot,
                sortie=1,
                vehicle="boat",
                items=tuple(items),
                fence=tuple(fence),
                rally=(RallyPoint(lat_e7=int(e7[0, 0]), lon_e7=int(e7[0, 1])),),
                kind=tuple(item_kind),
                lane=tuple(item_lane),
            )
        )
        legs = np.hypot(*np.diff(np.array(points), axis=0).T) if len(points) > 1 else np.zeros(0)
        survey = float(legs[np.array(kind, dtype=int) == 1].sum()) if len(legs) else 0.0
        rows.append(
            RobotReport(
                robot=robot,
                start_lonlat=(float(lon[0]), float(lat[0])),
                length_m=float(legs.sum()),
                survey_m=survey,
                transit_m=float(legs.sum()) - survey,
                duration_s=float(legs.sum()) / 2.0,
                items=len(items),
                lanes=len(share),
                fence_points=sum(len(polygon.points_e7) for polygon in fence),
                fence_land_m2=12.5,
            )
        )
    makespan = max(row.duration_s for row in rows)
    report: dict[str, Any] = {
        "robots": tuple(rows),
        "method": "crc",
        "makespan_s": makespan,
        "lower_bound_s": makespan * 0.93,
        "lower_bound_name": "area bound",
        "gap": 1 / 0.93 - 1,
        "utilization": sum(row.lanes > 0 for row in rows) / robots,
        "coverage": 0.99997,
        "coverage_survey_legs": 0.9981,
        "coverage_of_area": 0.9632,
        "largest_missed_m2": 1.7,
        "area_m2": water.area,
        "navigable_m2": region.area,
        "unreached_m2": unreached,
        "unreached_parts_m2": (unreached,) if unreached > 0 else (),
        "angle_deg": 0.0,
        "lane_spacing_m": swath_m,
        "frame": FRAME,
        "frame_error_m": 0.001,
        "options": {"clearance_m": clearance_m, "swath_m": swath_m, "robots": robots},
        "assumed": {"overlap": 0.1, "swath_m": swath_m, "clearance_m": clearance_m},
        "notes": ("The pond in the north-east is not reached.",),
        "versions": {"mrmission": "0.0", "shapely": "2"},
        "seed": 0,
    }
    report.update(report_changes)
    lonlat = shapely.transform(
        water, lambda xy: np.column_stack(projection(xy[:, 0], xy[:, 1], inverse=True))
    )
    return FleetPlan(
        area=SurveyArea(name=name, source="tests/factories.py", water_lonlat=_multi(lonlat)),
        water_m=water,
        region_m=region,
        homes_m=read_only(homes),
        paths=tuple(paths),
        missions=tuple(missions),
        report=FleetReport(**report),
    )


def _item(seq: int, command: int, x: int, y: int) -> MissionItem:
    return MissionItem(
        seq=seq, frame=3, command=command, current=0, autocontinue=1,
        param1=0.0, param2=0.0, param3=0.0, param4=0.0, x=x, y=y, z=0.0,
    )  # fmt: skip


def _multi(geometry: Any) -> shapely.MultiPolygon:
    return shapely.MultiPolygon(
        [part for part in shapely.get_parts(geometry) if part.geom_type == "Polygon"]
    )

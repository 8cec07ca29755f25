"""Courses become missions, vehicles sail them, tracks come back into the course's frame."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from mrmission.calibrate.courses import Course
from mrmission.calibrate.measure import CourseResult, measure
from mrmission.errors import SimulatorError
from mrmission.mission import mavlink
from mrmission.model import FloatArray, Mission, MissionItem
from mrmission.rehearse.pilot import SailOrders, sail
from mrmission.rehearse.track import Track
from mrmission.simulate.motion import moved, offset_m

if TYPE_CHECKING:
    from mrmission.vehicle.client import Vehicle

SAMPLE_S = 0.1


@dataclass(frozen=True, slots=True, kw_only=True)
class Setting:
    """What a course is sailed with; the table has a row for each."""

    steering: str
    speed_m_s: float
    radius_m: float


def course_mission(course: Course, origin_lonlat: tuple[float, float]) -> Mission:
    """Return the mission of a course whose frame's origin lies at a position.

    The speed is set after the first waypoint, and at every point where it changes.
    """
    places = []
    for east, north in course.points_m.tolist():
        lat, lon = moved(origin_lonlat[1], origin_lonlat[0], east, north)
        places.append((mavlink.e7(lat), mavlink.e7(mavlink.wrap_lon_deg(lon))))
    items: list[MissionItem] = []

    def add(command: int, frame: int, at: tuple[int, int] = (0, 0), speed: float = 0.0) -> None:
        change = command == mavlink.DO_CHANGE_SPEED
        items.append(
            MissionItem(
                seq=len(items), frame=frame, command=command, current=int(not items),
                autocontinue=1, param1=float(mavlink.SPEED_TYPE_GROUND if change else 0.0),
                param2=speed, param3=float(mavlink.THROTTLE_UNCHANGED if change else 0.0),
                param4=0.0, x=at[0], y=at[1], z=0.0,
            )
        )  # fmt: skip

    add(mavlink.NAV_WAYPOINT, mavlink.FRAME_GLOBAL, places[0])
    add(mavlink.NAV_WAYPOINT, mavlink.FRAME_GLOBAL_RELATIVE_ALT, places[0])
    set_speed = float("nan")
    for place, speed in zip(places[1:], course.speed_m_s.tolist(), strict=True):
        if speed != set_speed:
            add(mavlink.DO_CHANGE_SPEED, mavlink.FRAME_GLOBAL, speed=float(speed))
            set_speed = speed
        add(mavlink.NAV_WAYPOINT, mavlink.FRAME_GLOBAL_RELATIVE_ALT, place)
    return Mission(
        robot=1, sortie=1, vehicle="boat", items=tuple(items), fence=(), rally=(),
    )  # fmt: skip


def track_in_course(track: Track, origin_lonlat: tuple[float, float]) -> FloatArray:
    """Return the (n, 2) positions of a track in the frame of a course."""
    lon0, lat0 = origin_lonlat
    return np.array([offset_m(lat0, lon0, lat, lon) for lon, lat in track.lonlat.tolist()]).reshape(
        -1, 2
    )


async def sail_course(
    vehicle: Vehicle,
    course: Course,
    origin_lonlat: tuple[float, float],
    parameters: Mapping[str, float],
    progress: Callable[[int, int], None] | None = None,
) -> tuple[CourseResult, Track]:
    """Set parameters, upload a course, sail it, and measure the track.

    Raises
    ------
    VehicleError
        When the vehicle refuses a parameter or the mission, or does not sail it to its end.
    """
    from mrmission.vehicle.items import MissionType, mission_to_raw

    for name, value in parameters.items():
        await vehicle.set_parameter(name, value)
    mission = course_mission(course, origin_lonlat)
    await vehicle.upload(MissionType.MISSION, mission_to_raw(mission.items))
    track = await sail(
        vehicle,
        mission,
        SailOrders(sample_s=SAMPLE_S),
        progress=None if progress is None else lambda _robot, item, n: progress(item, n),
    )
    if not track.home:
        raise SimulatorError(f"{vehicle.where()}: the course was not finished: {track.end_text}")
    points = track_in_course(track, origin_lonlat)
    on_way = track.under_way()
    result = measure(course, track.time_s[on_way], points[on_way], track.started_s, track.ended_s)
    return result, track

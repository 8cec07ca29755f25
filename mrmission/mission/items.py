"""A coverage path becomes mission items: home, speed, waypoints, an end that suits the vehicle."""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt

from mrmission.errors import PlanningError
from mrmission.mission import mavlink
from mrmission.mission.mavlink import wrap_lon_deg as wrap_lon_deg
from mrmission.model import BoolArray, FloatArray, IntArray, LegKind, MissionItem
from mrmission.options import PlanOptions

KindArray = npt.NDArray[np.int8]


def _item(
    seq: int,
    command: int,
    *,
    frame: int = mavlink.FRAME_GLOBAL_RELATIVE_ALT,
    params: tuple[float, float, float, float] = (0.0, 0.0, 0.0, 0.0),
    position_e7: tuple[int, int] = (0, 0),
    z: float = 0.0,
) -> MissionItem:
    return MissionItem(
        seq=seq,
        frame=frame,
        command=command,
        # exactly one item of a mission is current: the first, which is home
        current=1 if seq == 0 else 0,
        autocontinue=1,
        param1=params[0],
        param2=params[1],
        param3=params[2],
        param4=params[3],
        x=position_e7[0],
        y=position_e7[1],
        z=z,
    )


def merge_collinear(
    points_m: FloatArray, kind: KindArray, lane: IntArray, tolerance_m: float = 0.01
) -> tuple[FloatArray, KindArray, IntArray]:
    """Drop waypoints that change nothing: duplicates, and points on the line of their legs.

    A point goes only when the legs on both sides are of one kind, when every point dropped from a
    leg lies within `tolerance_m` of it, and when the leg runs forward over them: a turn by 180°
    stays. A point nearer than `tolerance_m` to the point kept before it is a duplicate. The first
    and the last point stay.

    Parameters
    ----------
    points_m : (n, 2) array, m
    kind : (n - 1,) array of LegKind
    lane : (n - 1,) array
        Lane number of each leg; a merged leg takes the number of its longest piece.
    tolerance_m
        Largest distance of a dropped point from the leg that replaces it.

    Returns
    -------
    points_m, kind, lane
        The same, shorter.
    """
    points = [(float(x), float(y)) for x, y in points_m]
    last = len(points) - 1
    if last < 1:
        return np.array(points_m, dtype=float), np.array(kind), np.array(lane)

    # Duplicates first, so that every leg has a direction. A leg is (index of its end, its pieces).
    kept = [0]
    for j in range(1, last + 1):
        if math.dist(points[kept[-1]], points[j]) > tolerance_m:
            kept.append(j)
        elif j == last and len(kept) > 1:
            kept[-1] = last
        elif j == last:
            # nothing but the start is left; a closed path that goes nowhere
            kept.append(last)
    leg_kind = [int(kind[j - 1]) for j in kept[1:]]
    leg_lane = [int(lane[j - 1]) for j in kept[1:]]

    out = [kept[0]]
    out_kind: list[int] = []
    out_lane: list[int] = []
    i = 0
    while i < len(kept) - 1:
        j = i + 1
        while (
            j + 1 < len(kept)
            and leg_kind[j] == leg_kind[i]
            and _straight([points[k] for k in kept[i : j + 2]], tolerance_m)
        ):
            j += 1
        longest = max(range(i, j), key=lambda k: math.dist(points[kept[k]], points[kept[k + 1]]))
        out.append(kept[j])
        out_kind.append(leg_kind[i])
        out_lane.append(leg_lane[longest])
        i = j
    return (
        np.array([points[k] for k in out], dtype=float),
        np.array(out_kind, dtype=np.asarray(kind).dtype),
        np.array(out_lane, dtype=np.asarray(lane).dtype),
    )


def _straight(points: list[tuple[float, float]], tolerance_m: float) -> bool:
    """Whether the chord from first to last point passes all others, forward, within tolerance."""
    (x0, y0), (x1, y1) = points[0], points[-1]
    length = math.hypot(x1 - x0, y1 - y0)
    if length <= tolerance_m:
        return False
    ux, uy = (x1 - x0) / length, (y1 - y0) / length
    before = 0.0
    for x, y in points[1:-1]:
        along = (x - x0) * ux + (y - y0) * uy
        if abs((y - y0) * ux - (x - x0) * uy) > tolerance_m or along < before or along > length:
            return False
        before = along
    return True


def build_items(
    path_lonlat: FloatArray, kind: KindArray, lane: IntArray, options: PlanOptions
) -> tuple[tuple[MissionItem, ...], tuple[int, ...], tuple[int, ...]]:
    """Turn one robot's way from home to home into MISSION_ITEM_INT items.

    Item 0 is home, as ArduPilot wants it. A boat or rover then gets a waypoint at home, so that it
    enters its planned way there wherever it was launched, and after it the speed (ArduRover ignores
    a speed change as first item); a copter takes off at home. Then come the waypoints, with a
    change of speed where survey and transit differ and the kind of leg changes. The way back is
    made of waypoints that end exactly at home, because a return command sails straight over
    islands. At the end a boat loiters at home (hold would let it drift), a copter returns to launch
    (from above it, to land), and a rover stays where its mission ends: it stops there whatever
    the last item is (ArduRover makes boats alone hold a place), and a mission that ends leaves
    the choice to MIS_DONE_BEHAVE.

    With a trigger distance, a camera is switched on where a lane begins and off where it ends
    (lanes that follow on each other without a transit are one stretch), or on at the first lane
    and off after the last.

    Parameters
    ----------
    path_lonlat : (n, 2) array, degrees [lon, lat]
        From home to home.
    kind : (n - 1,) array of LegKind
    lane : (n - 1,) array
        Lane number of each leg, 0 on a transit.
    options
        Vehicle, speeds, altitude and camera.

    Returns
    -------
    items : tuple of MissionItem
        Empty where the path has no leg.
    kind, lane : tuple of int
        Of the leg that ends at each item; transit and 0 for home and commands.

    Raises
    ------
    PlanningError
        When the path does not end where it starts, or a coordinate is not a number.
    """
    path = np.asarray(path_lonlat, dtype=float).reshape(-1, 2)
    if not np.isfinite(path).all():
        bad = int(np.flatnonzero(~np.isfinite(path).all(axis=1))[0])
        raise PlanningError(f"point {bad} of the path is {path[bad].tolist()}: not a position")
    positions = [(mavlink.e7(lat), mavlink.e7(wrap_lon_deg(lon))) for lon, lat in path.tolist()]
    if len(positions) < 2 or len(set(positions)) < 2:
        return (), (), ()
    if positions[0] != positions[-1]:
        raise PlanningError(
            f"the path starts at {path[0].tolist()} and ends at {path[-1].tolist()}: "
            "it must end at home"
        )
    copter = options.vehicle == "copter"
    height_m = float(options.altitude_m) if copter else 0.0
    above_terrain = copter and options.altitude_above == "terrain"
    frame = mavlink.FRAME_GLOBAL_TERRAIN_ALT if above_terrain else mavlink.FRAME_GLOBAL_RELATIVE_ALT
    home = positions[0]
    items: list[MissionItem] = []
    kinds: list[int] = []
    lanes: list[int] = []

    def add(item: MissionItem, leg_kind: int = LegKind.TRANSIT, leg_lane: int = 0) -> None:
        items.append(item)
        kinds.append(int(leg_kind))
        lanes.append(int(leg_lane))

    def add_speed(leg_kind: int) -> None:
        survey = leg_kind == LegKind.SURVEY
        speed_m_s = options.survey_speed_m_s if survey else options.transit_speed_m_s
        add(
            _item(
                len(items),
                mavlink.DO_CHANGE_SPEED,
                frame=mavlink.FRAME_GLOBAL,
                params=(
                    mavlink.SPEED_TYPE_GROUND,
                    float(speed_m_s),
                    mavlink.THROTTLE_UNCHANGED,
                    0.0,
                ),
            )
        )

    def add_camera(distance_m: float) -> None:
        # the third parameter asks for a photo at once: at the lane's very start
        params = (distance_m, 0.0, 1.0 if distance_m > 0 else 0.0, 0.0)
        command = mavlink.DO_SET_CAM_TRIGG_DIST
        add(_item(len(items), command, frame=mavlink.FRAME_GLOBAL, params=params))

    add(_item(0, mavlink.NAV_WAYPOINT, frame=mavlink.FRAME_GLOBAL, position_e7=home))
    start = mavlink.NAV_TAKEOFF if copter else mavlink.NAV_WAYPOINT
    add(_item(1, start, frame=frame, position_e7=home, z=height_m))

    one_speed = options.survey_speed_m_s == options.transit_speed_m_s
    at = home
    speed_of: int | None = None
    camera_on = False
    photos = photographed(np.asarray(kind), options)
    for position, leg_kind, leg_lane, photo in zip(positions[1:], kind, lane, photos, strict=True):
        if position == at:
            continue
        if camera_on and not photo:
            add_camera(0.0)
        if speed_of is None or (not one_speed and leg_kind != speed_of):
            add_speed(int(leg_kind))
            speed_of = int(leg_kind)
        if photo and not camera_on:
            add_camera(float(options.trigger_distance_m))
        camera_on = bool(photo)
        add(
            _item(len(items), mavlink.NAV_WAYPOINT, frame=frame, position_e7=position, z=height_m),
            int(leg_kind),
            int(leg_lane),
        )
        at = position
    if camera_on:
        add_camera(0.0)
    if options.vehicle == "boat":
        add(_item(len(items), mavlink.NAV_LOITER_UNLIM, position_e7=home))
    elif copter:
        add(_item(len(items), mavlink.NAV_RETURN_TO_LAUNCH, frame=mavlink.FRAME_GLOBAL))
    return tuple(items), tuple(kinds), tuple(lanes)


def photographed(kind: KindArray, options: PlanOptions) -> BoolArray:
    """Return (n - 1,) which legs are travelled with the camera on; none without one.

    Parameters
    ----------
    kind : (n - 1,) array of LegKind
    options
        Trigger distance and mode.
    """
    survey: BoolArray = np.asarray(kind) == LegKind.SURVEY
    if options.trigger_distance_m <= 0 or not survey.any():
        return np.zeros(len(survey), dtype=bool)
    if options.trigger == "continuous":
        lanes = np.flatnonzero(survey)
        survey = np.zeros(len(survey), dtype=bool)
        survey[lanes[0] : lanes[-1] + 1] = True
    return survey


def count_items(kind: KindArray, options: PlanOptions) -> int:
    """Return how many items :func:`build_items` makes of a path with these legs, home included.

    Parameters
    ----------
    kind : (n - 1,) array of LegKind
        Legs between distinct positions.
    options
        Vehicle, speeds and camera.
    """
    legs = np.asarray(kind)
    if len(legs) == 0:
        return 0
    changes = 1
    if options.survey_speed_m_s != options.transit_speed_m_s:
        changes += int(np.count_nonzero(legs[1:] != legs[:-1]))
    photos = photographed(legs, options)
    # on where a stretch of photos begins, off where it ends
    changes += 2 * int(np.count_nonzero(np.diff(photos, prepend=False) & photos))
    return 2 + changes + len(legs) + (1 if options.vehicle in ("boat", "copter") else 0)

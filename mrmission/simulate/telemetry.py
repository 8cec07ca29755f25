"""The messages a simulated vehicle streams or sends on request, each built from its state."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import TYPE_CHECKING

from mrmission.simulate.autopilot import Mode
from mrmission.simulate.copter import CopterPilot
from mrmission.simulate.copter_modes import Stage
from mrmission.simulate.guard import ALTITUDE
from mrmission.simulate.motion import offset_m
from mrmission.simulate.wire import Message, mavlink

if TYPE_CHECKING:
    from mrmission.simulate.vehicle import SimVehicle

FIRMWARE = (4, 7, 0)
"""ArduPilot version whose behaviour is imitated; it is what AUTOPILOT_VERSION tells."""
CAPABILITIES = (
    mavlink.MAV_PROTOCOL_CAPABILITY_MISSION_FLOAT
    | mavlink.MAV_PROTOCOL_CAPABILITY_PARAM_FLOAT
    | mavlink.MAV_PROTOCOL_CAPABILITY_MISSION_INT
    | mavlink.MAV_PROTOCOL_CAPABILITY_COMMAND_INT
    | mavlink.MAV_PROTOCOL_CAPABILITY_MAVLINK2
    | mavlink.MAV_PROTOCOL_CAPABILITY_MISSION_FENCE
    | mavlink.MAV_PROTOCOL_CAPABILITY_MISSION_RALLY
    | mavlink.MAV_PROTOCOL_CAPABILITY_SET_POSITION_TARGET_GLOBAL_INT
)
LANDED_STATES = {
    Stage.LANDED: mavlink.MAV_LANDED_STATE_ON_GROUND,
    Stage.TAKEOFF: mavlink.MAV_LANDED_STATE_TAKEOFF,
    Stage.ROUTE: mavlink.MAV_LANDED_STATE_IN_AIR,
    Stage.HOVER: mavlink.MAV_LANDED_STATE_IN_AIR,
    Stage.LAND: mavlink.MAV_LANDED_STATE_LANDING,
}
STREAMS: dict[int, float] = {
    mavlink.MAVLINK_MSG_ID_HEARTBEAT: 1.0,
    mavlink.MAVLINK_MSG_ID_SYS_STATUS: 1.0,
    mavlink.MAVLINK_MSG_ID_GPS_RAW_INT: 1.0,
    mavlink.MAVLINK_MSG_ID_GLOBAL_POSITION_INT: 0.5,
    mavlink.MAVLINK_MSG_ID_LOCAL_POSITION_NED: 1.0,
    mavlink.MAVLINK_MSG_ID_ATTITUDE: 1.0,
    mavlink.MAVLINK_MSG_ID_VFR_HUD: 1.0,
    mavlink.MAVLINK_MSG_ID_MISSION_CURRENT: 1.0,
    mavlink.MAVLINK_MSG_ID_NAV_CONTROLLER_OUTPUT: 1.0,
    mavlink.MAVLINK_MSG_ID_BATTERY_STATUS: 2.0,
}
"""Default stream intervals, seconds of the link's clock."""

_SENSORS = (
    mavlink.MAV_SYS_STATUS_SENSOR_3D_GYRO
    | mavlink.MAV_SYS_STATUS_SENSOR_3D_ACCEL
    | mavlink.MAV_SYS_STATUS_SENSOR_3D_MAG
    | mavlink.MAV_SYS_STATUS_SENSOR_GPS
    | mavlink.MAV_SYS_STATUS_SENSOR_XY_POSITION_CONTROL
    | mavlink.MAV_SYS_STATUS_SENSOR_MOTOR_OUTPUTS
    | mavlink.MAV_SYS_STATUS_AHRS
    | mavlink.MAV_SYS_STATUS_SENSOR_BATTERY
)


def boot_ms(vehicle: SimVehicle) -> int:
    """Return the boat's clock in milliseconds, as MAVLink time stamps carry it."""
    return int(vehicle.autopilot.time_s * 1000.0) & 0xFFFFFFFF


def heartbeat(vehicle: SimVehicle) -> Message:
    """Build HEARTBEAT."""
    pilot = vehicle.autopilot
    base = mavlink.MAV_MODE_FLAG_CUSTOM_MODE_ENABLED
    if pilot.mode is Mode.MANUAL:
        base |= mavlink.MAV_MODE_FLAG_MANUAL_INPUT_ENABLED
    if pilot.mode in pilot.navigating_modes:
        base |= mavlink.MAV_MODE_FLAG_GUIDED_ENABLED
    if pilot.armed:
        base |= mavlink.MAV_MODE_FLAG_SAFETY_ARMED
    standby = pilot.mode is Mode.HOLD
    kind = (
        mavlink.MAV_TYPE_SURFACE_BOAT
        if vehicle.parameters["FRAME_CLASS"] == 2
        else mavlink.MAV_TYPE_GROUND_ROVER
    )
    if isinstance(pilot, CopterPilot):
        standby, kind = not pilot.flying, mavlink.MAV_TYPE_QUADROTOR
        base |= mavlink.MAV_MODE_FLAG_STABILIZE_ENABLED | mavlink.MAV_MODE_FLAG_MANUAL_INPUT_ENABLED
    return mavlink.MAVLink_heartbeat_message(
        kind,
        mavlink.MAV_AUTOPILOT_ARDUPILOTMEGA,
        base,
        int(pilot.mode),
        mavlink.MAV_STATE_STANDBY if standby else mavlink.MAV_STATE_ACTIVE,
        3,
    )


def sys_status(vehicle: SimVehicle) -> Message:
    """Build SYS_STATUS."""
    present = _SENSORS | mavlink.MAV_SYS_STATUS_PREARM_CHECK
    enabled = present
    health = _SENSORS
    if vehicle.autopilot.armed or vehicle.autopilot.why_not_arm() is None:
        health |= mavlink.MAV_SYS_STATUS_PREARM_CHECK
    if vehicle.fence.items:
        present |= mavlink.MAV_SYS_STATUS_GEOFENCE
        if vehicle.parameters["FENCE_ENABLE"]:
            enabled |= mavlink.MAV_SYS_STATUS_GEOFENCE
            if not vehicle.autopilot.fence_breaches_m():
                health |= mavlink.MAV_SYS_STATUS_GEOFENCE
    return mavlink.MAVLink_sys_status_message(
        present, enabled, health, 100, 12600, 0, 100, 0, 0, 0, 0, 0, 0
    )


def velocity(vehicle: SimVehicle) -> tuple[float, float]:
    """Return ``(north_m_s, east_m_s)`` over ground."""
    east, north = vehicle.boat.velocity_m_s
    return north, east


def ground_speed_m_s(vehicle: SimVehicle) -> float:
    """Return the speed over ground."""
    return math.hypot(*vehicle.boat.velocity_m_s)


def camera_feedback(vehicle: SimVehicle, number: int) -> Message:
    """Build CAMERA_FEEDBACK for picture `number`."""
    boat = vehicle.boat
    heading = math.degrees(math.remainder(boat.heading_rad, 2.0 * math.pi))
    return mavlink.MAVLink_camera_feedback_message(
        boot_ms(vehicle) * 1000, 0, 1, number, round(boat.lat * 1e7), round(boat.lon * 1e7),
        0.0, 0.0, 0.0, 0.0, heading, 0.0, mavlink.CAMERA_FEEDBACK_PHOTO, number,
    )  # fmt: skip


def gps_raw_int(vehicle: SimVehicle) -> Message:
    """Build GPS_RAW_INT."""
    boat = vehicle.boat
    fixed = vehicle.autopilot.has_position
    return mavlink.MAVLink_gps_raw_int_message(
        boot_ms(vehicle) * 1000,
        6 if fixed else 1,
        round(boat.lat * 1e7) if fixed else 0,
        round(boat.lon * 1e7) if fixed else 0,
        0,
        80 if fixed else 65535,
        120 if fixed else 65535,
        round(ground_speed_m_s(vehicle) * 100),
        round(math.degrees(boat.heading_rad) * 100) % 36000,
        14 if fixed else 0,
    )


def global_position_int(vehicle: SimVehicle) -> Message | None:
    """Build GLOBAL_POSITION_INT, None before there is a position."""
    if not vehicle.autopilot.has_position:
        return None
    boat = vehicle.boat
    north, east = velocity(vehicle)
    return mavlink.MAVLink_global_position_int_message(
        boot_ms(vehicle),
        round(boat.lat * 1e7),
        round(boat.lon * 1e7),
        round(boat.alt_m * 1000),
        round(boat.alt_m * 1000),
        round(north * 100),
        round(east * 100),
        round(-boat.climb_m_s * 100),
        round(math.degrees(boat.heading_rad) * 100) % 36000,
    )


def local_position_ned(vehicle: SimVehicle) -> Message | None:
    """Build LOCAL_POSITION_NED, None before there is a position."""
    if not vehicle.autopilot.has_position:
        return None
    east, north = offset_m(*vehicle.origin, vehicle.boat.lat, vehicle.boat.lon)
    v_north, v_east = velocity(vehicle)
    return mavlink.MAVLink_local_position_ned_message(
        boot_ms(vehicle), north, east, -vehicle.boat.alt_m,
        v_north, v_east, -vehicle.boat.climb_m_s,
    )  # fmt: skip


def attitude(vehicle: SimVehicle) -> Message:
    """Build ATTITUDE."""
    yaw = math.remainder(vehicle.boat.heading_rad, 2.0 * math.pi)
    return mavlink.MAVLink_attitude_message(
        boot_ms(vehicle), 0.0, 0.0, yaw, 0.0, 0.0, vehicle.boat.turn_rad_s
    )


def vfr_hud(vehicle: SimVehicle) -> Message:
    """Build VFR_HUD."""
    boat = vehicle.boat
    cruise = max(vehicle.autopilot.speed_m_s, 0.1)
    share = abs(boat.speed_m_s) / cruise
    throttle = min(100, round(50 * share)) if vehicle.autopilot.armed else 0
    return mavlink.MAVLink_vfr_hud_message(
        0.0,
        ground_speed_m_s(vehicle),
        round(math.degrees(boat.heading_rad)) % 360,
        throttle,
        boat.alt_m,
        boat.climb_m_s,
    )


def mission_current(vehicle: SimVehicle, seq: int | None = None) -> Message:
    """Build MISSION_CURRENT; `seq` overrides the number for the echo that some stations expect."""
    count = vehicle.mission.count()
    pilot = vehicle.autopilot
    return mavlink.MAVLink_mission_current_message(
        pilot.current if seq is None else seq,
        max(0, count - 1),
        mavlink.MISSION_STATE_NO_MISSION if count < 2 else int(pilot.state),
        1 if pilot.mode is pilot.modes["AUTO"] else 0,
    )


def nav_controller_output(vehicle: SimVehicle) -> Message | None:
    """Build NAV_CONTROLLER_OUTPUT, None in modes that steer for nothing."""
    pilot = vehicle.autopilot
    if pilot.mode not in pilot.navigating_modes:
        return None
    heading = round(math.degrees(vehicle.boat.heading_rad))
    target = pilot.target
    bearing = heading
    if target is not None:
        bearing = round(
            math.degrees(math.atan2(*offset_m(vehicle.boat.lat, vehicle.boat.lon, *target)))
        )
    return mavlink.MAVLink_nav_controller_output_message(
        0.0,
        0.0,
        (heading + 180) % 360 - 180,
        bearing,
        min(65535, round(pilot.wp_distance_m)),
        0.0,
        0.0,
        pilot.cross_track_m,
    )


def battery_status(vehicle: SimVehicle) -> Message:
    """Build BATTERY_STATUS."""
    cells = [12600] + [65535] * 9
    return mavlink.MAVLink_battery_status_message(0, 0, 0, 32767, cells, 0, 0, -1, 100)


def system_time(vehicle: SimVehicle) -> Message:
    """Build SYSTEM_TIME."""
    return mavlink.MAVLink_system_time_message(0, boot_ms(vehicle))


def extended_sys_state(vehicle: SimVehicle) -> Message:
    """Build EXTENDED_SYS_STATE."""
    pilot = vehicle.autopilot
    landed = mavlink.MAV_LANDED_STATE_ON_GROUND
    if isinstance(pilot, CopterPilot):
        landed = LANDED_STATES[pilot.stage] if pilot.flying else landed
    return mavlink.MAVLink_extended_sys_state_message(mavlink.MAV_VTOL_STATE_UNDEFINED, landed)


def home_position(vehicle: SimVehicle) -> Message | None:
    """Build HOME_POSITION, None before there is a home."""
    home = vehicle.autopilot.home
    if home is None:
        return None
    east, north = offset_m(*vehicle.origin, *home)
    return mavlink.MAVLink_home_position_message(
        round(home[0] * 1e7),
        round(home[1] * 1e7),
        0,
        north,
        east,
        0.0,
        [1.0, 0.0, 0.0, 0.0],
        0.0,
        0.0,
        0.0,
        boot_ms(vehicle) * 1000,
    )


def gps_global_origin(vehicle: SimVehicle) -> Message:
    """Build GPS_GLOBAL_ORIGIN."""
    return mavlink.MAVLink_gps_global_origin_message(
        round(vehicle.origin[0] * 1e7), round(vehicle.origin[1] * 1e7), 0, boot_ms(vehicle) * 1000
    )


def autopilot_version(vehicle: SimVehicle) -> Message:
    """Build AUTOPILOT_VERSION."""
    major, minor, patch = FIRMWARE
    return mavlink.MAVLink_autopilot_version_message(
        CAPABILITIES,
        major << 24 | minor << 16 | patch << 8 | mavlink.FIRMWARE_VERSION_TYPE_DEV,
        0,
        0,
        0,
        list(b"mrmsim\0\0"),
        [0] * 8,
        [0] * 8,
        0,
        0,
        vehicle.system_id,
    )


def fence_status(vehicle: SimVehicle) -> Message | None:
    """Build FENCE_STATUS, None where the fence is not enabled."""
    guard = vehicle.autopilot.guard
    if not guard.enabled:
        return None
    kind = mavlink.FENCE_BREACH_NONE
    if guard.breached:
        high = guard.breached == ALTITUDE
        kind = mavlink.FENCE_BREACH_MAXALT if high else mavlink.FENCE_BREACH_BOUNDARY
    return mavlink.MAVLink_fence_status_message(
        1 if guard.breached else 0, guard.count, kind, int(guard.breached_at_s * 1000.0)
    )


Builder = Callable[["SimVehicle"], Message | None]
BUILDERS: dict[int, Builder] = {
    mavlink.MAVLINK_MSG_ID_HEARTBEAT: heartbeat,
    mavlink.MAVLINK_MSG_ID_SYS_STATUS: sys_status,
    mavlink.MAVLINK_MSG_ID_SYSTEM_TIME: system_time,
    mavlink.MAVLINK_MSG_ID_GPS_RAW_INT: gps_raw_int,
    mavlink.MAVLINK_MSG_ID_ATTITUDE: attitude,
    mavlink.MAVLINK_MSG_ID_LOCAL_POSITION_NED: local_position_ned,
    mavlink.MAVLINK_MSG_ID_GLOBAL_POSITION_INT: global_position_int,
    mavlink.MAVLINK_MSG_ID_MISSION_CURRENT: mission_current,
    mavlink.MAVLINK_MSG_ID_NAV_CONTROLLER_OUTPUT: nav_controller_output,
    mavlink.MAVLINK_MSG_ID_VFR_HUD: vfr_hud,
    mavlink.MAVLINK_MSG_ID_BATTERY_STATUS: battery_status,
    mavlink.MAVLINK_MSG_ID_AUTOPILOT_VERSION: autopilot_version,
    mavlink.MAVLINK_MSG_ID_HOME_POSITION: home_position,
    mavlink.MAVLINK_MSG_ID_GPS_GLOBAL_ORIGIN: gps_global_origin,
    mavlink.MAVLINK_MSG_ID_EXTENDED_SYS_STATE: extended_sys_state,
    mavlink.MAVLINK_MSG_ID_FENCE_STATUS: fence_status,
}

"""Which messages PX4 sends on which link, how often, and who builds them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import partial

from volery.base.time import Ns, S
from volery.simulation.autopilots.mavlink.firmware import Builder
from volery.simulation.autopilots.px4 import motion, status


def _every(rates: Mapping[float, Sequence[str]]) -> dict[str, Ns]:
    return {name: round(S / rate) for rate, names in rates.items() for name in names}


ONBOARD, STATION = "onboard", "station"

USES: Mapping[str, Mapping[str, Ns]] = {
    ONBOARD: _every(
        {
            100.0: ("ATTITUDE",),
            50.0: ("ATTITUDE_QUATERNION", "GLOBAL_POSITION_INT", "HIGHRES_IMU"),
            30.0: ("LOCAL_POSITION_NED", "ODOMETRY"),
            10.0: (
                "ALTITUDE",
                "ATTITUDE_TARGET",
                "DISTANCE_SENSOR",
                "MISSION_CURRENT",
                "POSITION_TARGET_GLOBAL_INT",
                "POSITION_TARGET_LOCAL_NED",
                "SERVO_OUTPUT_RAW",
                "TIMESYNC",
                "VFR_HUD",
            ),
            8.0: ("GPS_RAW_INT",),
            5.0: ("EXTENDED_SYS_STATE", "SYS_STATUS"),
            2.0: ("ORBIT_EXECUTION_STATUS",),
            1.0: ("ESTIMATOR_STATUS", "PING", "SCALED_PRESSURE", "SYSTEM_TIME"),
            0.5: ("BATTERY_STATUS", "HOME_POSITION", "VIBRATION"),
            0.333: ("CURRENT_EVENT_SEQUENCE",),
        }
    ),
    STATION: _every(
        {
            50.0: (
                "ATTITUDE",
                "ATTITUDE_QUATERNION",
                "ATTITUDE_TARGET",
                "GLOBAL_POSITION_INT",
                "LOCAL_POSITION_NED",
                "POSITION_TARGET_LOCAL_NED",
                "SERVO_OUTPUT_RAW",
            ),
            10.0: ("MISSION_CURRENT",),
            4.0: ("VFR_HUD",),
            2.0: ("ORBIT_EXECUTION_STATUS",),
            1.0: (
                "ALTITUDE",
                "EXTENDED_SYS_STATE",
                "GPS_RAW_INT",
                "POSITION_TARGET_GLOBAL_INT",
                "SCALED_PRESSURE",
                "SYS_STATUS",
            ),
            0.5: ("BATTERY_STATUS", "DISTANCE_SENSOR", "ESTIMATOR_STATUS", "HOME_POSITION"),
            0.333: ("CURRENT_EVENT_SEQUENCE",),
            0.1: ("PING", "VIBRATION"),
        }
    ),
}
"""What a link is for, to the period of each message on it, as recorded."""

BUILDERS: Mapping[str, Builder] = {
    "ALTITUDE": motion.altitude,
    "ATTITUDE": motion.attitude,
    "ATTITUDE_QUATERNION": motion.attitude_quaternion,
    "ATTITUDE_TARGET": motion.attitude_target,
    "AUTOPILOT_VERSION": status.autopilot_version,
    "BATTERY_STATUS": status.battery_status,
    "CURRENT_EVENT_SEQUENCE": status.event_sequence,
    "DISTANCE_SENSOR": motion.distance_sensor,
    "ESTIMATOR_STATUS": status.estimator_status,
    "EXTENDED_SYS_STATE": status.extended_sys_state,
    "GLOBAL_POSITION_INT": motion.global_position,
    "GPS_GLOBAL_ORIGIN": motion.origin,
    "GPS_RAW_INT": motion.gps_raw,
    "HIGHRES_IMU": motion.highres_imu,
    "HOME_POSITION": motion.home_position,
    "LOCAL_POSITION_NED": motion.local_position,
    "MISSION_CURRENT": status.mission_current,
    "ODOMETRY": motion.odometry,
    "ORBIT_EXECUTION_STATUS": motion.orbit_status,
    "PING": status.ping,
    "POSITION_TARGET_GLOBAL_INT": motion.global_target,
    "POSITION_TARGET_LOCAL_NED": motion.position_target,
    "SCALED_PRESSURE": motion.pressure,
    "SERVO_OUTPUT_RAW": status.servo_output,
    "SYSTEM_TIME": motion.system_time,
    "SYS_STATUS": status.sys_status,
    "TIMESYNC": status.timesync,
    "VFR_HUD": motion.vfr_hud,
    "VIBRATION": status.vibration,
}

ORDER: Sequence[str] = tuple(sorted(BUILDERS))
"""Of the messages within one burst."""


def builders(kind: int) -> Mapping[str, Builder]:
    """All of them; *kind* is the MAV_TYPE of the heartbeat."""
    return {**BUILDERS, "HEARTBEAT": partial(status.heartbeat, kind=kind)}

"""Tables that copter and rover share: messages and their builders, streams, and the order within a burst."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from volery.simulation.autopilots.ardupilot import motion, status
from volery.simulation.autopilots.mavlink import message_fields
from volery.simulation.autopilots.mavlink.firmware import Builder
from volery.simulation.autopilots.vehicle_state import Vehicle

RAW_SENSORS, EXTENDED_STATUS, RC_CHANNELS, RAW_CONTROLLER, POSITION = 1, 2, 3, 4, 6
EXTRA1, EXTRA2, EXTRA3, ALL = 10, 11, 12, 0
"""MAV_DATA_STREAM."""


def nothing(_vehicle: Vehicle) -> None:
    """A message that the firmware knows and has no reason to send."""
    return


BUILDERS: Mapping[str, Builder] = {
    "AHRS": motion.ahrs,
    "AHRS2": motion.ahrs2,
    "ATTITUDE": message_fields.attitude,
    "ATTITUDE_QUATERNION": message_fields.attitude_quaternion,
    "BATTERY_STATUS": status.battery_status,
    "DISTANCE_SENSOR": motion.distance_sensor,
    "EKF_STATUS_REPORT": status.ekf_status,
    "EXTENDED_SYS_STATE": status.extended_sys_state,
    "GLOBAL_POSITION_INT": motion.global_position,
    "GPS_GLOBAL_ORIGIN": motion.origin,
    "GPS_RAW_INT": motion.gps_raw,
    "HOME_POSITION": motion.home_position,
    "LOCAL_POSITION_NED": motion.local_position,
    "MEMINFO": status.meminfo,
    "MISSION_CURRENT": status.mission_current,
    "NAV_CONTROLLER_OUTPUT": motion.nav_controller,
    "POSITION_TARGET_GLOBAL_INT": motion.position_target,
    "POSITION_TARGET_LOCAL_NED": motion.local_target,
    "POWER_STATUS": status.power_status,
    "RANGEFINDER": motion.rangefinder,
    "RAW_IMU": motion.raw_imu,
    "RC_CHANNELS": status.rc_channels,
    "RC_CHANNELS_RAW": status.rc_channels_raw,
    "SCALED_IMU2": motion.scaled_imu2,
    "SCALED_IMU3": motion.scaled_imu3,
    "SCALED_PRESSURE": motion.pressure,
    "SCALED_PRESSURE2": motion.pressure,
    "SERVO_OUTPUT_RAW": status.servo_output,
    "SIMSTATE": motion.simstate,
    "SYSTEM_TIME": motion.system_time,
    "VFR_HUD": motion.vfr_hud,
    "VIBRATION": status.vibration,
    **dict.fromkeys(
        (
            "ADSB_VEHICLE",
            "AOA_SSA",
            "CAMERA_FEEDBACK",
            "EFI_STATUS",
            "FENCE_STATUS",
            "GENERATOR_STATUS",
            "GIMBAL_DEVICE_ATTITUDE_STATUS",
            "GPS2_RAW",
            "GPS2_RTK",
            "GPS_RTK",
            "HIGH_LATENCY2",
            "HYGROMETER_SENSOR",
            "MAG_CAL_PROGRESS",
            "MAG_CAL_REPORT",
            "MCU_STATUS",
            "OPTICAL_FLOW",
            "PID_TUNING",
            "RPM",
            "SCALED_PRESSURE3",
            "WINCH_STATUS",
        ),
        nothing,
    ),
}

ORDER: Sequence[str] = (
    "ATTITUDE",
    "ATTITUDE_QUATERNION",
    "GLOBAL_POSITION_INT",
    "HOME_POSITION",
    "GPS_GLOBAL_ORIGIN",
    "SYS_STATUS",
    "POWER_STATUS",
    "MEMINFO",
    "NAV_CONTROLLER_OUTPUT",
    "MISSION_CURRENT",
    "VFR_HUD",
    "SERVO_OUTPUT_RAW",
    "RC_CHANNELS",
    "RC_CHANNELS_RAW",
    "RAW_IMU",
    "SCALED_IMU2",
    "SCALED_IMU3",
    "SCALED_PRESSURE",
    "SCALED_PRESSURE2",
    "GPS_RAW_INT",
    "SYSTEM_TIME",
    "RC_CHANNELS_SCALED",
    "AHRS",
    "SIMSTATE",
    "AHRS2",
    "WIND",
    "RANGEFINDER",
    "DISTANCE_SENSOR",
    "TERRAIN_REPORT",
    "EKF_STATUS_REPORT",
    "LOCAL_POSITION_NED",
    "VIBRATION",
    "POSITION_TARGET_GLOBAL_INT",
    "POSITION_TARGET_LOCAL_NED",
    "BATTERY_STATUS",
    "ESC_TELEMETRY_1_TO_4",
    "EXTENDED_SYS_STATE",
)
"""Of the messages within one burst, as recorded."""


def streams(controller: Sequence[str], extra: Sequence[str]) -> dict[int, tuple[str, ...]]:
    """MAV_DATA_STREAM to messages.

    *controller* and *extra* are what one kind of vehicle adds to the common ones.
    """
    groups: dict[int, tuple[str, ...]] = {
        RAW_SENSORS: ("RAW_IMU", "SCALED_IMU2", "SCALED_IMU3", "SCALED_PRESSURE", "SCALED_PRESSURE2"),
        EXTENDED_STATUS: (
            "SYS_STATUS",
            "POWER_STATUS",
            "MEMINFO",
            "NAV_CONTROLLER_OUTPUT",
            "MISSION_CURRENT",
            "GPS_RAW_INT",
            "POSITION_TARGET_GLOBAL_INT",
        ),
        RC_CHANNELS: ("SERVO_OUTPUT_RAW", "RC_CHANNELS"),
        RAW_CONTROLLER: tuple(controller),
        POSITION: ("GLOBAL_POSITION_INT", "LOCAL_POSITION_NED"),
        EXTRA1: ("ATTITUDE", "SIMSTATE", "AHRS2"),
        EXTRA2: ("VFR_HUD",),
        EXTRA3: (
            "SYSTEM_TIME",
            "AHRS",
            "RANGEFINDER",
            "DISTANCE_SENSOR",
            "EKF_STATUS_REPORT",
            "VIBRATION",
            "BATTERY_STATUS",
            *extra,
        ),
    }
    return {**groups, ALL: tuple(name for names in groups.values() for name in names)}

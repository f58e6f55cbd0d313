"""Numbered events of PX4: their names, the arming checks among them, and the vehicle's own texts.

PX4 reports arming checks and state changes as numbered events. The number consists of the component (1, the
autopilot) in the high byte and the 24 low bits of the FNV-1a hash of the event's name. The names below are
all those in the sources of v1.14.0 to v1.17.0 and of release/1.18 (8 July 2026); what is shown for them is
made of the name. A vehicle that keeps a file of its events on board (COMPONENT_METADATA, MAVLink FTP) gives
texts for others, too.
"""

from __future__ import annotations

import gzip
import json
import lzma
import re
import struct
import zlib
from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

from volery.trace.events import ERROR, WARNING
from volery.vehicles.drivers.px4.modes import MANUAL_MODES, MODES

ALL_MODES = 0xFFFFFFFF

_BASIS, _PRIME = 0x811C9DC5, 0x01000193
_AUTOPILOT = 1 << 24


def event_id(name: str) -> int:
    """Return the number of the autopilot's event *name*."""
    value = _BASIS
    for octet in name.encode():
        value = (value ^ octet) * _PRIME & 0xFFFFFFFF
    return value & 0xFFFFFF | _AUTOPILOT


REPORT_BEGINS = event_id("commander_arming_check_summary")
REPORT_ENDS = event_id("commander_health_summary")
"""Between these two events PX4 sends all failing arming checks, each time one of them changes."""
_CAN_ARM = struct.Struct("<17xI")
"""Of the first: the modes in which it can arm."""

NO_MANUAL_CONTROL = event_id("check_modes_manual_control")


# -- built-in texts

_LISTED = """
ackermann_rate_control_conf_invalid_max_str_ang ackermann_rate_control_conf_invalid_max_thr_speed
ackermann_rate_control_conf_invalid_wheel_base ackermann_rate_control_conf_invalid_yaw_rate_lim
ackermann_speed_control_conf_invalid_speed_lim ackermann_vel_control_conf_invalid_speed_lim
airspeed_selector_estimation_invalid airspeed_selector_estimation_regain
airspeed_selector_estimation_valid airspeed_selector_prim_too_high airspeed_selector_sensor_failure
airspeed_selector_sensor_failure_disarmed airspeed_selector_switch buffer_full
camera_capture_trigger_rate_exceeded check_above_wind_limits_warning check_accel_missing
check_accel_no_data check_accel_not_calibrated check_airspeed_invalid check_airspeed_no_data
check_airspeed_too_high check_armable_configuration check_avionics_power_high check_avionics_power_low
check_avionics_power_missing check_avionics_power_redundancy check_baro_missing check_baro_no_data
check_battery_critical check_battery_disconnected check_battery_emergency check_battery_fault
check_battery_low check_battery_missing check_battery_mode check_battery_preflight_low
check_battery_rem_flight_time_low check_battery_unhealthy check_companion_computer_temperature_high
check_cpuload_too_high check_distance_sensor_invalid check_distance_sensor_missing
check_esc_over_temperature check_escs_fault check_escs_not_all_armed check_escs_offline
check_escs_telem_missing check_estimator_gnss_fault check_estimator_gnss_fusion_started
check_estimator_gnss_fusion_stopped check_estimator_gnss_warning_jamming
check_estimator_gnss_warning_spoofing check_estimator_gps_fix_too_low check_estimator_gps_generic
check_estimator_gps_hor_pos_drift_too_high check_estimator_gps_hor_pos_err_too_high
check_estimator_gps_hor_speed_drift_too_high check_estimator_gps_jammed
check_estimator_gps_jamming_critical check_estimator_gps_multiple_spoofing_indicated
check_estimator_gps_not_fusing check_estimator_gps_num_sats_too_low check_estimator_gps_pdop_too_high
check_estimator_gps_speed_acc_too_low check_estimator_gps_spoofed check_estimator_gps_spoofing_indicated
check_estimator_gps_vert_pos_drift_too_high check_estimator_gps_vert_pos_err_too_high
check_estimator_gps_vert_speed_drift_too_high check_estimator_heading_no_source
check_estimator_heading_not_stable check_estimator_hgt_est_err check_estimator_hgt_not_stable
check_estimator_high_accel_bias check_estimator_high_gyro_bias check_estimator_hor_pos_not_stable
check_estimator_hor_vel_not_stable check_estimator_low_position_accuracy check_estimator_mag_fault
check_estimator_mag_interference check_estimator_missing_data check_estimator_nav_failure
check_estimator_pos_est_err check_estimator_position_failure_imminent check_estimator_vel_est_err
check_estimator_vert_vel_not_stable check_estimator_yaw_est_err check_external_modes_unavailable
check_external_modes_unresponsive check_failure_detector_alt check_failure_detector_arm_esc
check_failure_detector_ext check_failure_detector_imbalanced_prop check_failure_detector_motor
check_failure_detector_pitch check_failure_detector_roll check_flight_time_limit check_gf_no_home
check_gf_violation check_gf_violation_custom_gf check_gf_violation_max_alt check_gf_violation_max_hor_dist
check_gnss_receiver_no_fix check_gnss_receiver_offline check_gps_position_divergence check_gyro_missing
check_gyro_no_data check_gyro_not_calibrated check_hardfault_present check_high_wind_warning
check_imu_accel_inconsistent check_imu_gyro_inconsistent check_mag_consistency check_mag_fault
check_mag_missing check_mag_no_data check_mag_not_calibrated check_mag_sys_has_mag_missing
check_man_control_kill_engaged check_man_control_landing_gear_up check_man_control_rtl_engaged
check_missing_cpuload check_missing_fmu_sdcard check_missing_system_power check_mission_failure
check_modes_angular_velocity check_modes_attitude check_modes_cannot_takeoff check_modes_global_pos
check_modes_home_position check_modes_local_alt check_modes_local_pos check_modes_manual_control
check_modes_mission check_modes_offboard_no_attitude check_modes_offboard_no_local_position
check_modes_offboard_no_local_velocity check_modes_offboard_signal check_modes_offboard_signal_lost
check_motor_overcurrent check_motor_undercurrent check_navigator_failure_hagl check_open_drone_id_missing
check_open_drone_id_unhealthy check_optical_flow_sensor_invalid check_optical_sensor_missing
check_parachute_missing check_parachute_unhealthy check_power_oc_hipower check_power_oc_periph
check_power_oc_report check_rally_point_missing check_ram_usage_too_high check_rc_dl_no_dllink
check_rc_dz_too_high check_rc_max_too_high check_rc_min_too_small check_rc_trim_too_high
check_rc_trim_too_small check_system_arm_auth_failed check_system_avoidance_not_ready
check_system_flight_term_active check_system_no_global_pos check_system_no_home_pos
check_system_safety_button check_system_usb_connected check_system_vtol_in_fw_mode
check_system_vtol_in_transition check_task_watchdog_present check_traffic_avoidance_missing
check_vtol_fixed_wing_system_failure check_wind_too_high col_prev_unsup_frame
commander_airmode_requires_no_arm_gesture commander_arm_denied_calibrating commander_arm_denied_not_manual
commander_arm_denied_resolve_failures commander_arm_denied_throttle_center
commander_arm_denied_throttle_high commander_arm_denied_throttle_unsafe commander_armed_by
commander_arming_check_summary commander_cal_cmd_denied commander_cal_no_inputs commander_cal_trim_done
commander_cal_trim_param_set_failed commander_calib_denied_sih commander_calib_rc_off
commander_calib_rc_on commander_ctrl_high_latency_failed commander_disarm_denied_not_landed
commander_disarmed_by commander_disarming_denied_not_landed commander_dl_regained
commander_esc_calibration_denied commander_failsafe_enter commander_failsafe_enter_autopilot_disengaged
commander_failsafe_enter_crit_bat_warn commander_failsafe_enter_crit_low_bat_warn
commander_failsafe_enter_generic commander_failsafe_enter_generic_hold
commander_failsafe_enter_generic_warn commander_failsafe_enter_hold commander_failsafe_enter_low_bat
commander_failsafe_enter_low_flight_time_warn commander_failsafe_enter_warn commander_gcs_lost
commander_health_summary commander_high_latency_lost commander_kill_sw_disengaged
commander_kill_sw_engaged commander_landing_current_pos commander_landing_detected
commander_landing_prec_land commander_load_param_blank commander_load_param_failed
commander_low_bat_shutdown commander_low_bat_shutdown_failed commander_mag_yaw_calib_denied_sih
commander_max_flight_time_warning_minutes commander_max_flight_time_warning_seconds
commander_mission_comp_lost commander_mission_start_denied_no_mission commander_mode_fallback_internal
commander_modeswitch_not_avail commander_onboard_ctrl_regained commander_open_drone_id_lost
commander_open_drone_id_regained commander_parachute_regained commander_rc_loss_hold_no_failsafe
commander_rc_lost commander_rc_override commander_rc_regained commander_remote_id_lost commander_rtl
commander_save_param_failed commander_takeoff_detected commander_traffic_avoidance_lost
commander_traffic_avoidance_regained commander_transition_denied commander_unsupported_arm_disarm_param
commander_unsupported_auto_mode commander_unsupported_base_mode commander_unsupported_main_mode
control_surfaces_reset_trim differential_att_control_conf_invalid_yaw_p
differential_posVel_control_conf_invalid_speed_control differential_posVel_control_conf_invalid_speed_lim
differential_rate_control_conf_invalid_rate_control differential_rate_control_conf_invalid_yaw_rate_lim
differential_speed_control_conf_invalid_speed_control differential_speed_control_conf_invalid_speed_lim
ekf2_aid_mask_drag ekf2_aid_mask_ev ekf2_aid_mask_gps ekf2_aid_mask_imu ekf2_aid_mask_opt_flow
ekf2_gps_ctrl_alt ekf2_hgt_ref_baro ekf2_hgt_ref_ev ekf2_hgt_ref_gps ekf2_hgt_ref_rng
ekf2_mag_type_invalid failsafe_rc_override feasibility_mis_in_air_landing_req
fixedwing_position_control_conf_invalid_airspeed fixedwing_position_control_conf_invalid_airspeed_bounds
fixedwing_position_control_conf_invalid_maxbank_infeasible fixedwing_position_control_conf_invalid_stall
fixedwing_position_control_conf_invalid_trim_bounds fixedwing_position_control_descend
fixedwing_position_control_fb_loiter fixedwing_position_control_landing_abort_status_operator_abort
fixedwing_position_control_landing_abort_status_terrain_not_found
fixedwing_position_control_landing_abort_status_terrain_timeout
fixedwing_position_control_landing_abort_status_unknown_criterion
fixedwing_position_control_landing_circle_flaring fixedwing_position_control_landing_flaring
fixedwing_position_control_takeoff internal_combustion_engine_control_fault
internal_combustion_engine_running_fault launch_detection_enable_motors launch_detection_no_motor_delay
launch_detection_running_info launch_detection_wait_for_throttle logger_open_file_sess
logger_open_file_time logger_storage_full mavlink_iridium_disable mavlink_iridium_disable_cmd
mavlink_iridium_enable mavlink_iridium_enable_cmd mavlink_log_not_enough_bw mavlink_mission_err_id
mavlink_mission_getlist_busy mavlink_mission_ignore_clear mavlink_mission_ignore_mis_count
mavlink_mission_item_partner_id_mismatch mavlink_mission_mis_item_busy mavlink_mission_mis_item_invalid
mavlink_mission_mis_req_ignored_busy mavlink_mission_no_transfer mavlink_mission_op_timeout
mavlink_mission_partner_id_mismatch mavlink_mission_partner_id_mismatch2
mavlink_mission_recv_unknown_mis_type mavlink_mission_req_ignored mavlink_mission_seq_out_of_bounds
mavlink_mission_state_busy mavlink_mission_storage_failure mavlink_mission_storage_read_failure
mavlink_mission_storage_write_failure mavlink_mission_storage_write_failure2
mavlink_mission_storage_write_failure3 mavlink_mission_sync_timeout mavlink_mission_unknown_mis_type
mavlink_mission_wp_index_exceeds_list mavlink_mission_wp_index_out_of_bounds mavlink_mission_wp_unexpected
mavlink_mission_wp_unexpected2 mavlink_param_rc_chan_out_of_bounds mavlink_rcv_lnd_target_unsup_coord
mavlink_rcv_odom_unsup_estimator_type mavlink_rcv_sp_target_gl_invalid_coord
mavlink_rcv_sp_target_gl_unsup_force mavlink_rcv_sp_target_invalid mavlink_rcv_sp_target_unsup_coord
mavlink_rcv_sp_target_unsup_force mavlink_rcv_target_rel_q_sensor_not_filled
mavlink_rcv_target_rel_unsup_coord_frame mavlink_rcv_target_rel_unsup_type mc_pos_ctrl_cruise_set
mc_pos_ctrl_down_vel_set mc_pos_ctrl_hover_thrust_set mc_pos_ctrl_land_tilt_set
mc_pos_ctrl_man_vel_back_set mc_pos_ctrl_man_vel_set mc_pos_ctrl_man_vel_side_set mc_pos_ctrl_tilt_set
mc_pos_ctrl_up_vel_set mc_throw_launch_not_ready mc_throw_launch_ready
mecanum_att_control_conf_invalid_yaw_p mecanum_posVel_control_conf_invalid_speed_control
mecanum_posVel_control_conf_invalid_speed_lim mecanum_rate_control_conf_invalid_rate_control
mecanum_rate_control_conf_invalid_yaw_rate_lim mecanum_vel_control_conf_invalid_speed_control
mecanum_vel_control_conf_invalid_speed_lim mission_cannot_read_mission mission_climb_before_start
mission_do_jump_cycle mission_do_jump_rep_completed mission_execute mission_execute_rev
mission_failed_set_closest mission_failed_set_jump_count mission_failed_to_read_wp
mission_failed_to_write_do_jump mission_finished mission_finished_loiter mission_finished_rev
mission_finished_rev_loiter mission_holding_above_landing mission_ignore_non_position_item
mission_index_out_of_bound mission_invalid_mission_state mission_item_set_failed mission_not_valid_loiter
mission_not_valid_refuse mission_takeoff_to mxs_system_fail mxs_xpdr_fail
navigator_autotune_unsupported_ax navigator_autotune_unsupported_input
navigator_change_altitude_outside_geofence navigator_course_change_altitude_outside_geofence
navigator_fail_max_hagl navigator_geofence_import_failed navigator_geofence_imported
navigator_geofence_invalid_against_cur_pos navigator_geofence_invalid_against_home
navigator_geofence_max_alt_from_home navigator_geofence_max_dist_from_home navigator_mis_add_land_or_rm_to
navigator_mis_add_to_or_rm_land navigator_mis_approach_wp_below_land navigator_mis_correct_glide_slope
navigator_mis_dm_read_fail navigator_mis_first_wp_far navigator_mis_first_wp_too_far
navigator_mis_geofence_no_home navigator_mis_geofence_no_home2 navigator_mis_geofence_violation
navigator_mis_glide_slope_too_steep navigator_mis_invalid_land navigator_mis_land_before_rtl
navigator_mis_land_missing navigator_mis_land_wp_inside_orbit_radius navigator_mis_multiple_land
navigator_mis_no_home_rel_alt navigator_mis_no_pos_lock navigator_mis_starts_w_landing
navigator_mis_starts_w_landing2 navigator_mis_takeoff_missing navigator_mis_takeoff_not_first
navigator_mis_takeoff_or_land_missing navigator_mis_takeoff_too_low navigator_mis_unsup_cmd
navigator_mis_unsupported_landing_approach_wp navigator_mis_vtol_items navigator_mis_wp_below_home
navigator_mis_wp_gate_too_close navigator_mission_failure_heading navigator_reposition_outside_geofence
navigator_rtl_home_activated navigator_rtl_mission_activated navigator_rtl_mission_activated_home
navigator_rtl_mission_activated_rev navigator_takeoff_already_higher navigator_takeoff_default_alt
navigator_takeoff_min_alt navigator_terrain_collision_risk navigator_traffic navigator_traffic_expired
navigator_traffic_hold navigator_traffic_land navigator_traffic_resolved navigator_traffic_rtl
navigator_transition_descend nf_delay_max_too_small npfg_roll_command_uncertain orbit_radius_exceeded
pps_capture_pps_rate_exceeded px4io_comm_failed px4io_config_read_failed px4io_io_rc_config_upload_failed
px4io_proto_fw_mismatch rc_update_arm_stick_gesture_disabled_with_switch rtl_climb_to rtl_completed_loiter
rtl_descend_to rtl_failed_to_read_land_item rtl_land_at_destination rtl_land_at_home rtl_land_at_mission
rtl_land_at_mission_continue_landing rtl_land_at_safe_point rtl_loiter rtl_mission_land_climb
rtl_return_at rtl_unsupported_mav_frame runway_takeoff_reached_airspeed
runway_takeoff_reached_clearance_altitude sc_pos_ctrl_cruise_set sc_pos_ctrl_man_vel_set sensor_failover
sensor_failover_baro sensor_failover_mag stick_gesture_disabled_by_arm_switch
uavionix_adsb_out_cfg_unsupported_callsign_format vehicle_imu_accel_clipping vehicle_imu_gyro_clipping
vrtl_return_at vtol_att_ctrl_quadchute_alt_loss vtol_att_ctrl_quadchute_ext_cmd
vtol_att_ctrl_quadchute_max_pitch vtol_att_ctrl_quadchute_max_roll vtol_att_ctrl_quadchute_min_alt
vtol_att_ctrl_quadchute_tout vtol_att_ctrl_quadchute_trans_alt_err
"""
_NAMES = _LISTED.split()

_OLDER = ("check_modes_not_supported", "check_missing_gps")
"""Of PX4 before 1.14."""

_WORDS: Mapping[str, str] = {
    "check_modes_cannot_takeoff": "mode not suitable for arming",
    "check_modes_angular_velocity": "angular velocity not valid",
    "check_modes_attitude": "no valid attitude estimate",
    "check_modes_local_pos": "no valid local position estimate",
    "check_modes_global_pos": "no valid global position estimate",
    "check_modes_local_alt": "no valid altitude estimate",
    "check_modes_mission": "no valid mission available",
    "check_modes_home_position": "home position not set",
    "check_modes_manual_control": "no manual control input",
    "check_modes_offboard_signal": "no offboard signal",
    "check_modes_offboard_signal_lost": "no offboard signal",
    "check_modes_not_supported": "mode not supported by this vehicle",
    "check_rc_dl_no_dllink": "no connection to the ground station: heartbeats of this program are lost",
    "check_estimator_missing_data": "waiting for the estimator",
    "check_missing_gps": "no GPS",
    "check_estimator_gps_fix_too_low": "GPS fix too low",
    "check_estimator_gps_num_sats_too_low": "too few GPS satellites",
    "check_battery_low": "low battery",
    "check_battery_critical": "critically low battery",
    "check_battery_emergency": "battery almost empty",
    "check_system_usb_connected": "USB connected",
    "check_gyro_missing": "no gyroscope",
    "check_accel_missing": "no accelerometer",
    "check_mag_missing": "no compass",
    "check_baro_missing": "no barometer",
    "check_gf_violation": "outside its own geofence",
    "check_man_control_kill_engaged": "the kill switch is engaged",
    "check_system_safety_button": "the safety button is not pressed",
    "commander_armed_by": "armed",
    "commander_disarmed_by": "disarmed",
    "commander_takeoff_detected": "take-off detected",
    "commander_landing_detected": "landing detected",
    "commander_landing_current_pos": "landing at current position",
    "commander_rtl": "returning to launch",
    "commander_modeswitch_not_avail": "this mode is not available now",
    "commander_rc_lost": "manual control lost",
    "commander_rc_regained": "manual control regained",
    "commander_rc_override": "pilot took over using sticks",
    "failsafe_rc_override": "pilot took over using sticks",
    "commander_arm_denied_throttle_center": "arming denied: throttle above center",
    "commander_disarming_denied_not_landed": "disarming denied: not landed",
    "commander_disarm_denied_not_landed": "disarming denied: not landed",
    "commander_failsafe_enter": "failsafe activated",
    "commander_failsafe_enter_generic": "failsafe activated",
    "commander_failsafe_enter_hold": "failsafe activated, holding first",
    "mission_takeoff_to": "taking off",
    "navigator_takeoff_min_alt": "using the minimum take-off altitude",
    "navigator_takeoff_already_higher": "already higher than the take-off altitude",
    "navigator_rtl_home_activated": "RTL: activated",
    "rtl_land_at_home": "RTL: landing at home",
    "rtl_climb_to": "RTL: climbing",
    "rtl_return_at": "RTL: returning",
    "rtl_descend_to": "RTL: descending",
    "rtl_land_at_destination": "RTL: landing",
    "mavlink_rcv_sp_target_unsup_coord": "set-point in a frame that PX4 does not take",
    "mavlink_rcv_sp_target_invalid": "set-point that sets nothing",
}
"""Texts where the name alone says little, and of older versions."""

_ABBREVIATIONS: Mapping[str, str] = {
    "accel": "accelerometer",
    "baro": "barometer",
    "mag": "compass",
    "gf": "geofence",
    "gps": "GPS",
    "gnss": "GNSS",
    "imu": "IMU",
    "esc": "ESC",
    "escs": "ESCs",
    "rc": "RC",
    "rtl": "RTL",
    "usb": "USB",
    "vtol": "VTOL",
    "hor": "horizontal",
    "vert": "vertical",
    "pos": "position",
    "vel": "velocity",
    "hgt": "height",
    "alt": "altitude",
    "acc": "accuracy",
    "err": "error",
    "est": "estimate",
    "num": "number",
    "sats": "satellites",
    "man": "manual",
    "dz": "dead zone",
    "conf": "configuration",
    "lim": "limit",
    "bat": "battery",
    "crit": "critical",
    "oc": "overcurrent",
    "hipower": "high power",
    "rem": "remaining",
    "telem": "telemetry",
    "prop": "propeller",
    "dist": "distance",
    "ram": "RAM",
    "hagl": "height above ground",
    "custom": "custom",
    "avail": "available",
}


def words_of(name: str) -> str:
    """Return an event's name as words."""
    stated = _WORDS.get(name)
    if stated is not None:
        return stated
    words = re.sub(r"^(check|commander)_", "", name).split("_")
    return " ".join(_ABBREVIATIONS.get(word, word) for word in words)


CHECKS: Mapping[int, str] = {
    event_id(name): words_of(name) for name in (*_NAMES, *_OLDER) if name.startswith("check_")
}
"""Arming checks."""

KNOWN_EVENTS: Mapping[int, str] = {
    event_id(name): words_of(name)
    for name in {*_NAMES, *_WORDS}
    if not name.startswith("check_") and not name.endswith("_summary")
}
"""Other events. Most of those that were recorded are also sent as texts."""

_PASSING = (
    *("estimator", "gps", "gnss", "_pos", "home", "attitude", "angular", "local_alt", "heading", "offboard"),
    *("_mag_", "mag_no", "inconsistent", "divergence", "no_data", "cpuload", "wind", "external_modes"),
    *("traffic", "avoidance", "dllink", "not_stable"),
)
"""Parts of names of arming checks that pass by themselves."""
_STAYING = ("missing", "not_calibrated", "sys_has_mag")

LASTING_CHECKS = frozenset(
    event_id(name)
    for name in (*_NAMES, *_OLDER)
    if name.startswith("check_")
    and (any(word in name for word in _STAYING) or not any(word in name for word in _PASSING))
    and name not in ("check_estimator_missing_data", "check_missing_gps", "check_missing_cpuload")
)
"""Arming checks that stay until they are mended: batteries, missions, sticks, missing hardware."""

WITHOUT_TEXT = frozenset(
    event_id(name)
    for name in (
        "commander_rc_lost",
        "commander_rc_regained",
        "failsafe_rc_override",
        "navigator_takeoff_already_higher",
        "commander_mode_fallback_internal",
        "navigator_autotune_unsupported_ax",
        "navigator_autotune_unsupported_input",
        "sensor_failover",
        "sensor_failover_baro",
        "sensor_failover_mag",
        "mc_throw_launch_ready",
        "mc_throw_launch_not_ready",
        *(name for name in _NAMES if "_conf_invalid_" in name),
    )
)
"""Events that PX4 does not send as a text as well."""


# -- one event


class ReportedEvent(NamedTuple):
    """An event. Of an arming check, ``modes`` has a bit for the ``state`` of each mode that it forbids."""

    id: int
    severity: int
    modes: int
    arguments: bytes = b""


def event_of(fields: Mapping[str, Any]) -> ReportedEvent:
    """Return the event of an EVENT message; the low four bits of ``log_levels`` are its external severity."""
    arguments = bytes(fields["arguments"])
    modes = int.from_bytes(arguments[:4], "little")
    return ReportedEvent(fields["id"], fields["log_levels"] & 0x0F, modes, arguments)


# -- texts of the vehicle

LARGEST_FILE, LARGEST_DOCUMENT = 1_000_000, 20_000_000
"""Bytes of a file of metadata, compressed and not: PX4 1.17's have 16 kB and 150 kB."""
EVENTS_METADATA = 4
"""COMP_METADATA_TYPE."""
_FILE_SCHEME = "mftp:"

_NUMBERS: Mapping[str, struct.Struct] = {
    "uint8_t": struct.Struct("<B"),
    "int8_t": struct.Struct("<b"),
    "uint16_t": struct.Struct("<H"),
    "int16_t": struct.Struct("<h"),
    "uint32_t": struct.Struct("<I"),
    "int32_t": struct.Struct("<i"),
    "uint64_t": struct.Struct("<Q"),
    "int64_t": struct.Struct("<q"),
    "float": struct.Struct("<f"),
}
_PLACE = re.compile(r"(?<!\\)\{(\d+)(?::\.(\d+))?:?([^}]*)\}")
_TAG = re.compile(r"(?<!\\)</?[a-z][^>]*>")


class _EventArgument(NamedTuple):
    number: struct.Struct
    entries: Mapping[str, str]
    """Words by value, of an enumeration."""


class EventTexts:
    """Texts of events as the vehicle states them, from its file of events.

    Args:
        document: the file, uncompressed.

    Raises:
        ValueError: it is no file of events.
    """

    def __init__(self, document: bytes) -> None:
        self._messages: dict[int, tuple[str, Sequence[_EventArgument]]] = {}
        try:
            components = json.loads(document)["components"]
            enumerations: dict[str, _EventArgument] = {}
            for one in components.values():
                enumerations |= _enumerations(one)
            for number, one in components.items():
                for group in one["event_groups"].values():
                    for sub_id, event in group["events"].items():
                        kinds = [
                            _argument(str(each["type"]), enumerations) for each in event.get("arguments", ())
                        ]
                        identity = int(number) << 24 | int(sub_id) & 0xFFFFFF
                        self._messages[identity] = str(event["message"]), kinds
        except (KeyError, TypeError, AttributeError, UnicodeDecodeError, RecursionError) as error:
            raise ValueError(f"no file of events: {error}") from None

    def text(self, event: ReportedEvent) -> str:
        """Return the text of an event; empty if the vehicle states none."""
        message, arguments = self._messages.get(event.id, ("", ()))
        values: list[Any] = []
        at = 0
        for argument in arguments:
            if at + argument.number.size > len(event.arguments):
                break
            (value,) = argument.number.unpack_from(event.arguments, at)
            at += argument.number.size
            values.append(argument.entries.get(str(value), value))

        def filled(place: re.Match[str]) -> str:
            index, digits, unit = place.groups()
            if not 0 < int(index) <= len(values):
                return "?"
            value = values[int(index) - 1]
            shown = (
                f"{value:.{min(int(digits or 3), 9)}{'f' if digits else 'g'}}"
                if isinstance(value, float)
                else value
            )
            unit = unit.removesuffix("_v")
            return f"{shown} {unit}" if unit else f"{shown}"

        text = _TAG.sub("", _PLACE.sub(filled, message.split("\n", 1)[0]))
        return re.sub(r"\\([<>{}\\])", r"\1", text).strip()


def _enumerations(component: Mapping[str, Any]) -> dict[str, _EventArgument]:
    found = {}
    for name, one in component.get("enums", {}).items():
        entries = {value: str(entry.get("description", "")) for value, entry in one["entries"].items()}
        number = _NUMBERS.get(str(one["type"]), _NUMBERS["uint8_t"])
        found[str(name)] = _EventArgument(number, {} if one.get("is_bitfield") else entries)
    return found


def _argument(kind: str, enumerations: Mapping[str, _EventArgument]) -> _EventArgument:
    number = _NUMBERS.get(kind)
    if number is not None:
        return _EventArgument(number, {})
    return enumerations[kind.rsplit("::", 1)[-1]]


def path_of_events(general: bytes) -> str:
    """Return the path on board of the file of events; empty if it is elsewhere.

    Args:
        general: the uncompressed file that COMPONENT_METADATA names.
    """
    try:
        kinds = json.loads(general)["metadataTypes"]
        for kind in kinds:
            if kind["type"] == EVENTS_METADATA:
                return path_on_board(str(kind["uri"]))
    except (ValueError, KeyError, TypeError, RecursionError):
        pass
    return ""


def path_on_board(uri: str) -> str:
    """Return the path of a ``mftp:`` URI; empty for another."""
    return "/" + uri.removeprefix(_FILE_SCHEME).lstrip("/") if uri.startswith(_FILE_SCHEME) else ""


def uncompressed(path: str, data: bytes) -> bytes:
    """Return what is in a file of metadata, which may be compressed by xz or gzip.

    Raises:
        ValueError: it is damaged, or larger than any.
    """
    try:
        if path.endswith(".xz"):
            found = lzma.LZMADecompressor(memlimit=128 << 20).decompress(data, LARGEST_DOCUMENT)
        elif path.endswith((".gz", ".gzip")):
            found = zlib.decompressobj(wbits=31).decompress(data, LARGEST_DOCUMENT)
        else:
            found = data
    except (lzma.LZMAError, gzip.BadGzipFile, zlib.error, EOFError) as error:
        raise ValueError(f"{path}: {error}") from None
    if len(found) >= LARGEST_DOCUMENT:
        raise ValueError(f"{path}: larger than {LARGEST_DOCUMENT} bytes")
    return found


# -- arming checks


class FailingChecks:
    """The arming checks that fail now, collected from reports."""

    def __init__(self) -> None:
        self.reported = False
        self.texts: EventTexts | None = None
        """Texts of the vehicle, once they are known."""
        self._failing: tuple[ReportedEvent, ...] = ()
        self._report: list[ReportedEvent] | None = None
        self._can_arm = self._reported_can_arm = 0

    def handle_event(self, event: ReportedEvent) -> bool:
        """Process an event; return whether it belongs to a report."""
        if event.id == REPORT_BEGINS:
            self._report = []
            whole = event.arguments.ljust(_CAN_ARM.size, b"\0")
            (self._reported_can_arm,) = _CAN_ARM.unpack_from(whole)
            return True
        if self._report is None:
            return False
        if event.id == REPORT_ENDS:
            self.reported = True
            self._failing, self._can_arm = tuple(self._report), self._reported_can_arm
            self._report = None
        elif event.id in KNOWN_EVENTS:
            return False
        else:
            self._report.append(event)
        return True

    def knows(self, event: ReportedEvent) -> bool:
        """Return whether an event has a text, or is only of use to programs."""
        known = event.id in CHECKS or event.id in KNOWN_EVENTS or event.id in (REPORT_BEGINS, REPORT_ENDS)
        return known or event.severity > WARNING or (self.texts is not None and bool(self.texts.text(event)))

    def text(self, event: ReportedEvent) -> str:
        """Return the text of an event: the vehicle's own, else the built-in one, else its number."""
        stated = self.texts.text(event) if self.texts is not None else ""
        return stated or event_text(event.id)

    def reasons(self, mode: str) -> list[str]:
        """Return why the vehicle cannot arm in *mode*; nothing if it reports that it can.

        A check for all modes that is milder than an error is reported in the same way whether it forbids
        arming or not: COM_ARM_MIS_REQ's is an information. It is the reason if there is no other.
        """
        return [self.text(event) for event in self._forbidding(mode)]

    def lasting(self, mode: str) -> list[str]:
        """Return the reasons that waiting does not mend."""
        return [self.text(event) for event in self._forbidding(mode) if event.id in LASTING_CHECKS]

    def _forbidding(self, mode: str) -> list[ReportedEvent]:
        if mode in MODES and self._can_arm >> MODES[mode].state & 1:
            return []
        found = [event for event in self._failing if _forbids(event, mode)]
        if found:
            return found
        return [one for one in self._failing if one.modes == ALL_MODES and one.id != NO_MANUAL_CONTROL]


def event_text(number: int) -> str:
    """Return the built-in text of an event; its number if the event is not known."""
    return CHECKS.get(number) or KNOWN_EVENTS.get(number) or f"event {number:#010x}"


def _forbids(event: ReportedEvent, mode: str) -> bool:
    """Return whether an event forbids arming in *mode*; missing manual control forbids manual modes."""
    if event.id == NO_MANUAL_CONTROL:
        return mode in MANUAL_MODES
    if event.modes == ALL_MODES:
        return event.severity <= ERROR  # a check for all modes that is no error is only a warning
    return bool(event.modes >> MODES[mode].state & 1) if mode in MODES else True

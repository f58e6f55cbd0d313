"""What ArduPilot's messages and parameters mean, by version.

The rules were read in the sources of Copter-4.5.0 to Copter-4.6.3 and of 4.8.0-dev (64a9c7877b, 21 March
2026), which has all of 4.7.
"""

from __future__ import annotations

from collections.abc import Mapping

from volery.vehicles.firmware_versions import Coverage, Meaning, VersionRule
from volery.vehicles.services import ParameterRules, RenamedParameter

COVERAGE = Coverage("ArduPilot", (4, 5), (4, 8))

DRAWN_BACK: VersionRule[bool] = VersionRule(
    "whether the measured heading beside a yaw rate of SET_ATTITUDE_TARGET draws the copter back",
    Meaning((4, 5), False, "AC_AttitudeControl, input_quaternion: the stated rate is fed forward"),
    Meaning(
        (4, 7),
        True,
        "AC_AttitudeControl, input_quaternion: no feed-forward; flown with 4.8.0-dev, streamed at 50 Hz: it "
        "turned at 15 of 107 degrees/s",
    ),
)

_VOLATILE = frozenset(
    {"MIS_TOTAL", "FENCE_TOTAL", "RALLY_TOTAL", "FORMAT_VERSION"}
    | {f"BARO{number}_{what}" for number in (1, 2, 3) for what in ("GND_PRESS", "DEVID")}
    | {"ARSPD_DEVID", "ARSPD2_DEVID", "MNT1_DEVID", "MNT2_DEVID"}
    | {f"STAT_{what}" for what in ("BOOTCNT", "DISTFLWN", "FLTCNT", "FLTTIME", "RESET", "RUNTIME")}
)
"""Parameters that it writes itself: AP_PARAM_FLAG_INTERNAL_USE_ONLY (4.8 refuses to set them), the numbers of
items that it stores, AP_Stats, and the layout of its store (another number erases all parameters)."""


# -- renamed and rescaled parameters: the conversions of ArduCopter/ (Parameters, mode_rtl, mode_land,
# mode_poshold), Rover/Parameters and the libraries AC_WPNav, AC_AttitudeControl, AC_Avoidance, AP_Arming,
# AP_RangeFinder, AP_GPS, AP_NavEKF3 and GCS_MAVLink

_CENTI, _MILLI, _TENTH = 0.01, 0.001, 0.1
_M_S, _M_S2, _M, _DEGREES = "cm/s -> m/s", "cm/s² -> m/s²", "cm -> m", "0.01 degrees -> degrees"

_RESCALED: tuple[tuple[str, str, float, str], ...] = (
    ("WPNAV_SPEED", "WP_SPD", _CENTI, _M_S),
    ("WPNAV_SPEED_UP", "WP_SPD_UP", _CENTI, _M_S),
    ("WPNAV_SPEED_DN", "WP_SPD_DN", _CENTI, _M_S),
    ("WPNAV_RADIUS", "WP_RADIUS_M", _CENTI, _M),
    ("WPNAV_ACCEL", "WP_ACC", _CENTI, _M_S2),
    ("WPNAV_ACCEL_Z", "WP_ACC_Z", _CENTI, _M_S2),
    ("WPNAV_ACCEL_C", "WP_ACC_CNR", _CENTI, _M_S2),
    ("RTL_ALT", "RTL_ALT_M", _CENTI, _M),
    ("RTL_ALT_FINAL", "RTL_ALT_FINAL_M", _CENTI, _M),
    ("RTL_CLIMB_MIN", "RTL_CLIMB_MIN_M", _CENTI, _M),
    ("RTL_SPEED", "RTL_SPEED_MS", _CENTI, _M_S),
    ("LAND_SPEED", "LAND_SPD_MS", _CENTI, _M_S),
    ("LAND_SPEED_HIGH", "LAND_SPD_HIGH_MS", _CENTI, _M_S),
    ("LAND_ALT_LOW", "LAND_ALT_LOW_M", _CENTI, _M),
    ("PILOT_SPEED_UP", "PILOT_SPD_UP", _CENTI, _M_S),
    ("PILOT_SPEED_DN", "PILOT_SPD_DN", _CENTI, _M_S),
    ("PILOT_ACCEL_Z", "PILOT_ACC_Z", _CENTI, _M_S2),
    ("PILOT_TKOFF_ALT", "PILOT_TKO_ALT_M", _CENTI, _M),
    ("PHLD_BRAKE_ANGLE", "PHLD_BRK_ANGLE", _CENTI, _DEGREES),
    ("LOIT_SPEED", "LOIT_SPEED_MS", _CENTI, _M_S),
    ("LOIT_ACC_MAX", "LOIT_ACC_MAX_M", _CENTI, _M_S2),
    ("LOIT_BRK_ACCEL", "LOIT_BRK_ACC_M", _CENTI, _M_S2),
    ("LOIT_BRK_JERK", "LOIT_BRK_JRK_M", _CENTI, "cm/s³ -> m/s³"),
    ("CIRCLE_RADIUS", "CIRCLE_RADIUS_M", _CENTI, _M),
    ("ANGLE_MAX", "ATC_ANGLE_MAX", _CENTI, _DEGREES),
    ("AVOID_ANGLE_MAX", "AVOID_ANG_MAX", _CENTI, _DEGREES),
    ("ATC_SLEW_YAW", "ATC_RATE_WPY_MAX", _CENTI, "0.01 degrees/s -> degrees/s"),
    ("ATC_ACCEL_Y_MAX", "ATC_ACC_Y_MAX", _CENTI, "0.01 degrees/s² -> degrees/s²"),
    ("ATC_ACCEL_R_MAX", "ATC_ACC_R_MAX", _CENTI, "0.01 degrees/s² -> degrees/s²"),
    ("ATC_ACCEL_P_MAX", "ATC_ACC_P_MAX", _CENTI, "0.01 degrees/s² -> degrees/s²"),
    *((f"PSC_ACCZ_{one}", f"PSC_D_ACC_{one}", _TENTH, "cm/s² -> m/s², 0.1") for one in "PID"),
    ("PSC_VELZ_IMAX", "PSC_D_VEL_IMAX", _CENTI, _M_S2),
    ("PSC_VELXY_IMAX", "PSC_NE_VEL_IMAX", _CENTI, _M_S2),
    ("PSC_ACCZ_IMAX", "PSC_D_ACC_IMAX", _MILLI, "0.1 % -> share"),
    *(
        (f"RNGFND{number}_{before}", f"RNGFND{number}_{after}", _CENTI, _M)
        for number in (*"123456789", "A")
        for before, after in (("MIN_CM", "MIN"), ("MAX_CM", "MAX"), ("GNDCLEAR", "GNDCLR"))
    ),
)
"""Of 4.7: older name, newer name, factor, and the units in words."""

_MOVED: tuple[tuple[str, str], ...] = (
    ("SYSID_THISMAV", "MAV_SYSID"),
    ("SYSID_MYGCS", "MAV_GCS_SYSID"),
    ("TELEM_DELAY", "MAV_TELEM_DELAY"),
    ("SYSID_ENFORCE", "MAV_OPTIONS"),
    ("WPNAV_JERK", "WP_JERK"),
    ("WPNAV_TER_MARGIN", "WP_TER_MARGIN"),
    ("WPNAV_RFND_USE", "WP_RFND_USE"),
    ("PHLD_BRAKE_RATE", "PHLD_BRK_RATE"),
    ("PSC_POSXY_P", "PSC_NE_POS_P"),
    ("PSC_POSZ_P", "PSC_D_POS_P"),
    ("PSC_JERK_XY", "PSC_JERK_NE"),
    ("PSC_JERK_Z", "PSC_JERK_D"),
    *((f"PSC_VELZ_{one}", f"PSC_D_VEL_{one}") for one in ("P", "I", "D", "FLTE", "FLTD", "FF")),
    *((f"PSC_VELXY_{one}", f"PSC_NE_VEL_{one}") for one in ("P", "I", "D", "FLTE", "FLTD", "FF")),
    *(
        (f"PSC_ACCZ_{one}", f"PSC_D_ACC_{one}")
        for one in ("FF", "FLTT", "FLTE", "FLTD", "SMAX", "PDMX", "D_FF", "NEF", "NTF")
    ),
    ("EK3_MAX_FLOW", "EK3_FLOW_MAX"),
    *(
        (f"SR{number}_{stream}", f"MAV{number + 1}_{stream}")
        for number in range(7)
        for stream in (
            *("RAW_SENS", "EXT_STAT", "RC_CHAN", "RAW_CTRL", "POSITION", "EXTRA1", "EXTRA2", "EXTRA3"),
            *("PARAMS", "ADSB"),
        )
    ),
)
"""Of 4.7, unscaled."""

_MOVED_IN_4_6: tuple[tuple[str, str], ...] = (
    *(
        (f"GPS_{before}{older}", f"GPS{newer}_{after}")
        for older, newer in (("", 1), ("2", 2))
        for before, after in (
            *(("TYPE", "TYPE"), ("GNSS_MODE", "GNSS_MODE"), ("RATE_MS", "RATE_MS")),
            *(("DELAY_MS", "DELAY_MS"), ("COM_PORT", "COM_PORT")),
        )
    ),
    *((f"GPS_POS{number}_{axis}", f"GPS{number}_POS_{axis}") for number in (1, 2) for axis in "XYZ"),
    *((f"GPS_CAN_NODEID{number}", f"GPS{number}_CAN_NODEID") for number in (1, 2)),
    *(
        (f"GPS_MB{number}_{one}", f"GPS{number}_MB_{one}")
        for number in (1, 2)
        for one in ("TYPE", "OFS_X", "OFS_Y", "OFS_Z")
    ),
)

_ALL_CHECKS, _KNOWN_CHECKS = 1, ((1 << 21) - 1) & ~1
"""Bits of ARMING_CHECK: all checks, and each of those that there were."""


def skipped_checks(checked: float) -> float:
    """Return the ARMING_SKIPCHK of an ARMING_CHECK, as AP_Arming.cpp converts it: the meaning is inverted."""
    mask = int(checked)
    if mask == 0:
        return -1.0
    return 0.0 if mask & _ALL_CHECKS else float(~mask & _KNOWN_CHECKS)


def performed_checks(skipped: float) -> float:
    """Return the ARMING_CHECK of an ARMING_SKIPCHK."""
    mask = int(skipped)
    if mask == 0:
        return float(_ALL_CHECKS)
    return float(~mask & _KNOWN_CHECKS)


_ALL = (
    *(RenamedParameter(before, after, "4.7", factor, units) for before, after, factor, units in _RESCALED),
    *(RenamedParameter(before, after, "4.7") for before, after in _MOVED),
    *(RenamedParameter(before, after, "4.6") for before, after in _MOVED_IN_4_6),
    RenamedParameter(
        "ARMING_CHECK",
        "ARMING_SKIPCHK",
        "4.7",
        change="its bits are those of the checks that are left out",
        upgrade=skipped_checks,
        downgrade=performed_checks,
    ),
)
RENAMED: Mapping[str, RenamedParameter] = {name: one for one in _ALL for name in (one.before, one.after)}
"""Parameters of Copter and Rover with another name in another version, by both names."""
PARAMETER_RULES = ParameterRules(RENAMED, _VOLATILE, {"PLND_ENABLED": 1.0, "PLND_TYPE": 1.0})

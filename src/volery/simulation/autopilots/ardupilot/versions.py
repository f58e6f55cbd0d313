"""What differs between the versions of ArduPilot that are simulated: one table.

The rest of the package knows the names and units of parameters of 4.5 only; ``Parameters`` shows and reads
those of the version. Sources: recordings of 4.5.6 and of 4.8.0-dev (64a9c7877b, 21 March 2026), and for names
that were not recorded the conversions of parameters in the sources of the latter (ArduCopter/Parameters.cpp,
AC_WPNav, AC_Loiter, AC_Circle, AC_PosControl, AC_AttitudeControl, AP_GPS, SIM_GPS). What only one of them has
beside that is not simulated.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field

from volery.simulation.autopilots.autopilot_parameters import INT8, INT32, REAL32, Renamed


@dataclass(frozen=True, kw_only=True)
class ArduPilotVersion:
    """One version of the firmware, for copter and rover."""

    number: int
    """``flight_sw_version`` of AUTOPILOT_VERSION."""
    title: str
    commit: str
    renamed: Mapping[str, Renamed] = field(default_factory=dict)
    """Names of parameters of 4.5 to those of this version."""
    reports_missing_parameters: bool
    """Whether PARAM_ERROR answers a request for a parameter that does not exist; else nothing does."""
    rates_all_or_none: bool
    """Whether SET_ATTITUDE_TARGET must state all body rates or none (from 4.6 on); else the copter stops."""
    sends_attitude_target: bool
    """Whether a copter sends ATTITUDE_TARGET when it is requested."""
    receiver_found: tuple[str, ...]
    """Texts when the receiver of satellites is found."""

    @property
    def text(self) -> str:
        """Version and commit, as in texts."""
        return f"{self.title} ({self.commit})"


def _in_metres() -> Iterator[tuple[str, str]]:
    """Yield parameters in cm or 1/100 degree, and their names in metres or degrees."""
    for old, new in (
        ("SPEED", "SPD"),
        ("SPEED_UP", "SPD_UP"),
        ("SPEED_DN", "SPD_DN"),
        ("RADIUS", "RADIUS_M"),
        ("ACCEL", "ACC"),
        ("ACCEL_Z", "ACC_Z"),
        ("ACCEL_C", "ACC_CNR"),
    ):
        yield f"WPNAV_{old}", f"WP_{new}"
    for old, new in (("SPEED", "SPEED_MS"), ("ACC_MAX", "ACC_MAX_M")):
        yield f"LOIT_{old}", f"LOIT_{new}"
    yield from (("LOIT_BRK_ACCEL", "LOIT_BRK_ACC_M"), ("LOIT_BRK_JERK", "LOIT_BRK_JRK_M"))
    yield from ((f"RTL_{name}", f"RTL_{name}_M") for name in ("ALT", "ALT_FINAL", "CLIMB_MIN"))
    yield from (("RTL_SPEED", "RTL_SPEED_MS"), ("CIRCLE_RADIUS", "CIRCLE_RADIUS_M"))
    yield from (("LAND_SPEED", "LAND_SPD_MS"), ("LAND_SPEED_HIGH", "LAND_SPD_HIGH_MS"))
    yield from (("LAND_ALT_LOW", "LAND_ALT_LOW_M"), ("PILOT_SPEED_UP", "PILOT_SPD_UP"))
    yield from (("PILOT_SPEED_DN", "PILOT_SPD_DN"), ("PILOT_ACCEL_Z", "PILOT_ACC_Z"))
    yield from (("PILOT_TKOFF_ALT", "PILOT_TKO_ALT_M"), ("ANGLE_MAX", "ATC_ANGLE_MAX"))
    yield from (("AVOID_ANGLE_MAX", "AVOID_ANG_MAX"), ("PHLD_BRAKE_ANGLE", "PHLD_BRK_ANGLE"))
    yield "ATC_SLEW_YAW", "ATC_RATE_WPY_MAX"
    yield from ((f"ATC_ACCEL_{axis}_MAX", f"ATC_ACC_{axis}_MAX") for axis in "RPY")
    yield from (("PSC_VELZ_IMAX", "PSC_D_VEL_IMAX"), ("PSC_VELXY_IMAX", "PSC_NE_VEL_IMAX"))
    for end in ("MIN", "MAX"):
        yield f"RNGFND1_{end}_CM", f"RNGFND1_{end}"
    yield "RNGFND1_GNDCLEAR", "RNGFND1_GNDCLR"


def _of_position_control() -> Iterator[tuple[str, str]]:
    """Yield parameters of the position controller whose unit is the same."""
    yield from (("PSC_POSZ_P", "PSC_D_POS_P"), ("PSC_POSXY_P", "PSC_NE_POS_P"))
    yield from (("PSC_JERK_Z", "PSC_JERK_D"), ("PSC_JERK_XY", "PSC_JERK_NE"))
    for part in ("P", "I", "D", "FF", "FLTE", "FLTD"):
        yield f"PSC_VELZ_{part}", f"PSC_D_VEL_{part}"
        yield f"PSC_VELXY_{part}", f"PSC_NE_VEL_{part}"
    for part in ("FF", "FLTT", "FLTE", "FLTD", "SMAX", "PDMX", "D_FF", "NTF", "NEF"):
        yield f"PSC_ACCZ_{part}", f"PSC_D_ACC_{part}"


def _of_receivers() -> Iterator[tuple[str, str]]:
    """Yield parameters of the receivers of satellites and of their simulation."""
    for number, old in (("1", ""), ("2", "2")):
        for part in ("TYPE", "GNSS_MODE", "RATE_MS", "DELAY_MS", "COM_PORT"):
            yield f"GPS_{part}{old}", f"GPS{number}_{part}"
        yield from ((f"GPS_POS{number}_{axis}", f"GPS{number}_POS_{axis}") for axis in "XYZ")
        yield f"GPS_CAN_NODEID{number}", f"GPS{number}_CAN_NODEID"
        yield f"GPS_MB{number}_TYPE", f"GPS{number}_MB_TYPE"
    for part, now in (("BYTELOSS", "BYTELOS"), ("DRIFTALT", "DRFTALT"), ("LOCKTIME", "LCKTIME")):
        yield f"SIM_GPS_{part}", f"SIM_GPS1_{now}"
    for part in ("LAG_MS", "TYPE", "NUMSATS", "HZ", "NOISE", "ALT_OFS", "HDG", "ACC", "JAM"):
        yield f"SIM_GPS_{part}", f"SIM_GPS1_{part}"
    for axis in "XYZ":
        yield f"SIM_GPS_GLITCH_{axis}", f"SIM_GPS1_GLTCH_{axis}"
        yield from ((f"SIM_GPS_{part}_{axis}", f"SIM_GPS1_{part}_{axis}") for part in ("POS", "VERR"))


STREAMS = ("RAW_SENS", "EXT_STAT", "RC_CHAN", "RAW_CTRL", "POSITION", "EXTRA1", "EXTRA2", "EXTRA3", "PARAMS")
"""Suffixes of the stream rates; ADSB's follows."""


def _same_unit() -> Iterator[tuple[str, str]]:
    yield from (("SYSID_THISMAV", "MAV_SYSID"), ("SYSID_MYGCS", "MAV_GCS_SYSID"))
    yield from (("SYSID_ENFORCE", "MAV_OPTIONS"), ("TELEM_DELAY", "MAV_TELEM_DELAY"))
    yield from ((f"WPNAV_{name}", f"WP_{name}") for name in ("RFND_USE", "JERK", "TER_MARGIN"))
    yield "PHLD_BRAKE_RATE", "PHLD_BRK_RATE"
    for link in range(7):
        yield from ((f"SR{link}_{name}", f"MAV{link + 1}_{name}") for name in (*STREAMS, "ADSB"))
    yield from _of_position_control()
    yield from _of_receivers()


def _skipped(checks: float) -> float:
    """Return ARMING_SKIPCHK of an ARMING_CHECK, of which only 0, no check, differs from all the others."""
    return 0.0 if checks else -1.0


def _made(skipped: float) -> float:
    """Return ARMING_CHECK of an ARMING_SKIPCHK: checks are made unless all bits are set."""
    return 0.0 if skipped == -1.0 else 1.0


def _inverted(value: float) -> float:
    return float(not value)


def _hundredth(value: float) -> float:
    return value / 100.0


def _hundredfold(value: float) -> float:
    return value * 100.0


def _tenth(value: float) -> float:
    return value / 10.0


def _tenfold(value: float) -> float:
    return value * 10.0


RENAMED_IN_4_7: Mapping[str, Renamed] = {
    **{old: Renamed(new, None) for old, new in _same_unit()},
    **{old: Renamed(new, REAL32, _hundredth, _hundredfold) for old, new in _in_metres()},
    **{f"PSC_ACCZ_{gain}": Renamed(f"PSC_D_ACC_{gain}", REAL32, _tenth, _tenfold) for gain in "PID"},
    "PSC_ACCZ_IMAX": Renamed("PSC_D_ACC_IMAX", REAL32, lambda one: one / 1e3, lambda one: one * 1e3),
    "ARMING_CHECK": Renamed("ARMING_SKIPCHK", INT32, _skipped, _made),
    "SIM_GPS_DISABLE": Renamed("SIM_GPS1_ENABLE", INT8, _inverted, _inverted),
    "SIM_GPS2_DISABLE": Renamed("SIM_GPS2_ENABLE", INT8, _inverted, _inverted),
}
"""Of 4.7 and 4.8; those of the receivers are of 4.6."""

V4_5 = ArduPilotVersion(
    number=67_438_335,
    title="V4.5.6",
    commit="7ce11b41",
    reports_missing_parameters=False,
    rates_all_or_none=False,
    sends_attitude_target=False,
    receiver_found=("GPS 1: detected as u-blox at 230400 baud",),
)

V4_8 = ArduPilotVersion(
    number=67_633_152,
    title="V4.8.0-dev",
    commit="64a9c787",
    renamed=RENAMED_IN_4_7,
    reports_missing_parameters=True,
    rates_all_or_none=True,
    sends_attitude_target=True,
    receiver_found=("GPS 1: probing for u-blox at 230400 baud", "GPS 1: detected u-blox"),
)

VERSIONS: Mapping[str, ArduPilotVersion] = {"4.5": V4_5, "4.8": V4_8}
"""The newest last."""

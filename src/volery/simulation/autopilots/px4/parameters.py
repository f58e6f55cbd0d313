"""PX4's parameters: which ones change the behaviour, and the tuning that follows from their values.

All other parameters are only stored, listed and read back.
"""

from __future__ import annotations

from collections.abc import Mapping
from math import radians
from types import MappingProxyType

from volery.simulation.autopilots.autopilot_parameters import Parameters, Tuning
from volery.simulation.autopilots.manual_control import ChannelRange, StickMap

_SHARED = {
    "BAT_CRIT_THR": "critical level of the battery",
    "BAT_EMERGEN_THR": "emergency level of the battery",
    "BAT_LOW_THR": "low level of the battery",
    "COM_ARM_MIS_REQ": "any value but 0: arming needs a mission on board",
    "COM_ARM_WO_GPS": "any value but 0: modes that need no position may be armed without one",
    "COM_DL_LOSS_T": "silence after which the ground station is lost",
    "COM_FAIL_ACT_T": "time for which a failsafe holds before it acts",
    "COM_LOW_BAT_ACT": "0 warns, 2 lands, 3 returns at the critical level; any but 0 lands in an emergency",
    "COM_OBL_RC_ACT": "action when the stream of OFFBOARD set-points ends",
    "COM_OF_LOSS_T": "silence after which the stream has ended",
    "COM_RCL_EXCEPT": "bits 0, 1, 2: mission, hold and offboard continue without manual control",
    "COM_RC_IN_MODE": "1, 2, 3: MANUAL_CONTROL counts",
    "COM_RC_LOSS_T": "silence after which manual control is lost",
    "COM_RC_OVERRIDE": "bit 0: moved sticks end an automatic mode; bit 1: OFFBOARD, too",
    "COM_RC_STICK_OV": "stick movement that takes over",
    "GF_ACTION": "outside the geofence 1 warns, 2 holds, 3 returns, 4 terminates, 5 lands; 0: no geofence",
    "GF_MAX_HOR_DIST": "largest distance from home; 0: none",
    "GF_MAX_VER_DIST": "largest height above home; 0: none",
    "NAV_ACC_RAD": "radius within which a waypoint is reached",
    "NAV_DLL_ACT": "action when the ground station is lost",
    "NAV_RCL_ACT": "action when manual control is lost",
}

COPTER_SUPPORTED: Mapping[str, str] = MappingProxyType(
    {
        **_SHARED,
        "COM_DISARM_LAND": "time after a landing until disarming; 0: never",
        "COM_DISARM_PRFLT": "time after arming without a take-off until disarming; 0: never",
        "MIS_TAKEOFF_ALT": "minimum height of a take-off",
        "MPC_ACC_DOWN_MAX": "largest acceleration down",
        "MPC_ACC_HOR": "acceleration in the plane",
        "MPC_ACC_UP_MAX": "largest acceleration up",
        "MPC_HOLD_DZ": "dead zone of the sticks",
        "MPC_LAND_ALT1": "height below which the landing becomes slower",
        "MPC_LAND_ALT2": "height at which it lands at MPC_LAND_SPEED",
        "MPC_LAND_ALT3": "height below which it lands at MPC_LAND_CRWL",
        "MPC_LAND_CRWL": "landing speed close to the ground",
        "MPC_LAND_SPEED": "landing speed",
        "MPC_MAN_Y_MAX": "the pilot's turn rate",
        "MPC_THR_HOVER": "thrust of a set-point that hovers",
        "MPC_TILTMAX_AIR": "largest lean",
        "MPC_TKO_RAMP_T": "time in which a take-off reaches its full speed",
        "MPC_TKO_SPEED": "climb of a take-off",
        "MPC_VEL_MANUAL": "the pilot's largest speed",
        "MPC_XY_CRUISE": "speed of the automatic modes",
        "MPC_XY_VEL_MAX": "largest speed in the plane",
        "MPC_Z_VEL_MAX_DN": "largest descent",
        "MPC_Z_VEL_MAX_UP": "largest climb",
        "MPC_Z_V_AUTO_DN": "landing speed while high",
        "NAV_MC_ALT_RAD": "height error within which a waypoint is reached",
        "RTL_CONE_ANG": "lower return close to home; 0: always RTL_RETURN_ALT",
        "RTL_DESCEND_ALT": "height over home at which the landing begins",
        "RTL_MIN_DIST": "distance within which the cone counts",
        "RTL_RETURN_ALT": "height of the return",
    }
)
"""Parameters of a multirotor that have an effect, and what each changes."""

ROVER_SUPPORTED: Mapping[str, str] = MappingProxyType({**_SHARED, "GND_SPEED_TRIM": "speed"})
"""Parameters of a rover that have an effect, and what each changes."""


SLOWEST, FASTEST = 0.1, 100.0
"""Limits of speeds and accelerations [m/s, m/s^2]: no parameter value stops a manoeuvre."""

STICKS = StickMap(1, 2, 3, 4, (ChannelRange(1000, 1500, 2000, 0),) * 4)


def _moving(value: float) -> float:
    return min(FASTEST, max(SLOWEST, value))


def copter_tuning(parameters: Parameters) -> Tuning:
    """Return the tuning of a multirotor."""
    p = parameters
    tilt = radians(min(80.0, max(5.0, p["MPC_TILTMAX_AIR"])))
    return Tuning(
        sticks=STICKS,
        speed=_moving(p["MPC_XY_VEL_MAX"]),
        speed_up=_moving(p["MPC_Z_VEL_MAX_UP"]),
        speed_down=_moving(p["MPC_Z_VEL_MAX_DN"]),
        accel=_moving(p["MPC_ACC_HOR"]),
        accel_z=_moving(min(p["MPC_ACC_UP_MAX"], p["MPC_ACC_DOWN_MAX"])),
        tilt=tilt,
        waypoint_radius=_moving(p["NAV_ACC_RAD"]),
        land_speed=_moving(p["MPC_LAND_SPEED"]),
        land_speed_high=_moving(p["MPC_Z_V_AUTO_DN"]),
        pilot_up=_moving(p["MPC_Z_VEL_MAX_UP"]),
        pilot_down=_moving(p["MPC_Z_VEL_MAX_DN"]),
        pilot_accel_z=_moving(min(p["MPC_ACC_UP_MAX"], p["MPC_ACC_DOWN_MAX"])),
        pilot_yaw_rate=radians(min(720.0, max(1.0, p["MPC_MAN_Y_MAX"]))),
        throttle_dead=p["MPC_HOLD_DZ"] / 2.0,
        hover_throttle=p["MPC_THR_HOVER"],
    )


def rover_tuning(parameters: Parameters) -> Tuning:
    """Return the tuning of a rover."""
    p = parameters
    speed = _moving(p["GND_SPEED_TRIM"])
    return Tuning(
        sticks=STICKS,
        speed=speed,
        accel=2.0,
        waypoint_radius=_moving(p["NAV_ACC_RAD"]),
        return_speed=speed,
    )

"""From PX4's parameters to the figures that manoeuvres fly by."""

from __future__ import annotations

from math import radians

from volery.simulation.autopilots.autopilot_parameters import Parameters, Tuning
from volery.simulation.autopilots.manual_control import ChannelRange, StickMap

SLOWEST, FASTEST = 0.1, 100.0
"""Bounds of a speed or an acceleration [m/s, m/s^2]: a parameter beyond them stops or flings nothing."""

STICKS = StickMap(1, 2, 3, 4, (ChannelRange(1000, 1500, 2000, 0),) * 4)


def _moving(value: float) -> float:
    return min(FASTEST, max(SLOWEST, value))


def copter(parameters: Parameters) -> Tuning:
    """A multirotor's."""
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


def rover(parameters: Parameters) -> Tuning:
    """A rover's."""
    p = parameters
    speed = _moving(p["GND_SPEED_TRIM"])
    return Tuning(
        sticks=STICKS,
        speed=speed,
        accel=2.0,
        waypoint_radius=_moving(p["NAV_ACC_RAD"]),
        return_speed=speed,
    )

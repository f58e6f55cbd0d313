"""From ArduPilot's parameters to the figures that manoeuvres fly by.

Every parameter read here is honoured.
"""

from __future__ import annotations

from math import radians

from volery.autopilots.simulated.parameters import Parameters
from volery.autopilots.simulated.sticks import Travel
from volery.autopilots.simulated.tuning import StickMap, Tuning
from volery.base.time import MS, from_seconds


def travel(parameters: Parameters, channel: int) -> Travel:
    """How channel *channel* moves."""
    return Travel(
        parameters[f"RC{channel}_MIN"],
        parameters[f"RC{channel}_TRIM"],
        parameters[f"RC{channel}_MAX"],
        parameters[f"RC{channel}_DZ"],
        parameters[f"RC{channel}_REVERSED"] > 0.0,
    )


def stick_map(parameters: Parameters) -> StickMap:
    """Which channel is which stick."""
    roll, pitch, throttle, yaw = (
        round(parameters[f"RCMAP_{name}"]) for name in ("ROLL", "PITCH", "THROTTLE", "YAW")
    )
    return StickMap(
        roll,
        pitch,
        throttle,
        yaw,
        (
            travel(parameters, roll),
            travel(parameters, pitch),
            travel(parameters, throttle),
            travel(parameters, yaw),
        ),
    )


def copter(parameters: Parameters) -> Tuning:
    """A copter's. Its parameters are centimetres and hundredths of a degree."""
    p = parameters
    speed_down = p["WPNAV_SPEED_DN"] / 100.0
    pilot_up = p["PILOT_SPEED_UP"] / 100.0
    speed = p["WPNAV_SPEED"] / 100.0
    angle = radians(p["ANGLE_MAX"] / 100.0)
    return Tuning(
        sticks=stick_map(p),
        speed=speed,
        speed_up=p["WPNAV_SPEED_UP"] / 100.0,
        speed_down=speed_down,
        accel=p["WPNAV_ACCEL"] / 100.0,
        accel_z=p["WPNAV_ACCEL_Z"] / 100.0,
        tilt=angle,
        waypoint_radius=p["WPNAV_RADIUS"] / 100.0,
        face_path=p["WP_YAW_BEHAVIOR"] in (1.0, 2.0),
        land_speed=p["LAND_SPEED"] / 100.0,
        land_speed_high=p["LAND_SPEED_HIGH"] / 100.0 or speed_down,
        land_slow_below=p["LAND_ALT_LOW"] / 100.0,
        return_height=p["RTL_ALT"] / 100.0,
        return_climb_min=p["RTL_CLIMB_MIN"] / 100.0,
        return_cone=p["RTL_CONE_SLOPE"],
        return_speed=p["RTL_SPEED"] / 100.0 or speed,
        return_wait=round(p["RTL_LOIT_TIME"]) * MS,
        return_final=p["RTL_ALT_FINAL"] / 100.0,
        pilot_up=pilot_up,
        pilot_down=p["PILOT_SPEED_DN"] / 100.0 or pilot_up,
        pilot_accel_z=p["PILOT_ACCEL_Z"] / 100.0,
        pilot_yaw_rate=radians(p["PILOT_Y_RATE"]),
        throttle_dead=p["THR_DZ"] / 1000.0,
        hover_throttle=p["MOT_THST_HOVER"],
        loiter_speed=p["LOIT_SPEED"] / 100.0,
        loiter_accel=p["LOIT_ACC_MAX"] / 100.0,
        loiter_tilt=radians(p["LOIT_ANG_MAX"]) or angle * 2.0 / 3.0,
        loiter_brake=p["LOIT_BRK_ACCEL"] / 100.0,
        loiter_brake_delay=from_seconds(p["LOIT_BRK_DELAY"]),
        circle_radius=p["CIRCLE_RADIUS"] / 100.0,
        circle_rate=radians(p["CIRCLE_RATE"]),
        target_timeout=from_seconds(p["GUID_TIMEOUT"]),
    )


def rover(parameters: Parameters) -> Tuning:
    """A rover's. Its parameters are metres and degrees."""
    p = parameters
    speed = p["WP_SPEED"] or p["CRUISE_SPEED"]
    return Tuning(
        sticks=stick_map(p),
        speed=speed,
        accel=p["ATC_ACCEL_MAX"] or 1.0,
        waypoint_radius=p["WP_RADIUS"],
        return_speed=p["RTL_SPEED"] or speed,
    )

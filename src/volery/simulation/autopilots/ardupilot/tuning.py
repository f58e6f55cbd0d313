"""From ArduPilot's parameters to the figures that manoeuvres fly by.

Every parameter read here is honoured.
"""

from __future__ import annotations

from math import radians

from volery.base.time import MS, from_seconds
from volery.simulation.autopilots.autopilot_parameters import Parameters, Tuning
from volery.simulation.autopilots.manual_control import ChannelRange, StickMap

CHANNELS = 16
FASTEST = 1000.0
SLOWEST = 0.1
"""Speed [m/s] where a parameter asks for less than none; the firmware's own least values are of that size."""


def travel(parameters: Parameters, channel: int) -> ChannelRange:
    """How channel *channel* moves."""
    return ChannelRange(
        parameters[f"RC{channel}_MIN"],
        parameters[f"RC{channel}_TRIM"],
        parameters[f"RC{channel}_MAX"],
        parameters[f"RC{channel}_DZ"],
        parameters[f"RC{channel}_REVERSED"] > 0.0,
    )


def _channel(parameters: Parameters, stick: str, usual: int) -> int:
    """The channel of a stick; the usual one where RCMAP names none that exists."""
    channel = round(parameters[f"RCMAP_{stick}"])
    return channel if 1 <= channel <= CHANNELS else usual


def stick_map(parameters: Parameters) -> StickMap:
    """Which channel is which stick."""
    roll, pitch, throttle, yaw = (
        _channel(parameters, name, usual)
        for usual, name in enumerate(("ROLL", "PITCH", "THROTTLE", "YAW"), start=1)
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


def _moving(value: float, instead: float = SLOWEST) -> float:
    """A speed or an acceleration that moves; *instead* where it is none."""
    return min(value, FASTEST) if value > 0.0 else instead


def copter(parameters: Parameters) -> Tuning:
    """A copter's. Its parameters are centimetres and hundredths of a degree."""
    p = parameters
    speed_down = _moving(p["WPNAV_SPEED_DN"] / 100.0)
    pilot_up = _moving(p["PILOT_SPEED_UP"] / 100.0)
    speed = _moving(p["WPNAV_SPEED"] / 100.0)
    angle = radians(min(80.0, max(10.0, p["ANGLE_MAX"] / 100.0)))
    return Tuning(
        sticks=stick_map(p),
        speed=speed,
        speed_up=_moving(p["WPNAV_SPEED_UP"] / 100.0),
        speed_down=speed_down,
        accel=_moving(p["WPNAV_ACCEL"] / 100.0, 1.0),
        accel_z=_moving(p["WPNAV_ACCEL_Z"] / 100.0, 1.0),
        tilt=angle,
        waypoint_radius=_moving(p["WPNAV_RADIUS"] / 100.0),
        face_path=p["WP_YAW_BEHAVIOR"] in (1.0, 2.0),
        land_speed=_moving(p["LAND_SPEED"] / 100.0),
        land_speed_high=_moving(p["LAND_SPEED_HIGH"] / 100.0, speed_down),
        land_slow_below=p["LAND_ALT_LOW"] / 100.0,
        return_height=p["RTL_ALT"] / 100.0,
        return_climb_min=p["RTL_CLIMB_MIN"] / 100.0,
        return_cone=p["RTL_CONE_SLOPE"],
        return_speed=_moving(p["RTL_SPEED"] / 100.0, speed),
        return_wait=round(p["RTL_LOIT_TIME"]) * MS,
        return_final=p["RTL_ALT_FINAL"] / 100.0,
        pilot_up=pilot_up,
        pilot_down=_moving(p["PILOT_SPEED_DN"] / 100.0, pilot_up),
        pilot_accel_z=_moving(p["PILOT_ACCEL_Z"] / 100.0, 1.0),
        pilot_yaw_rate=radians(p["PILOT_Y_RATE"]),
        throttle_dead=p["THR_DZ"] / 1000.0,
        hover_throttle=p["MOT_THST_HOVER"],
        loiter_speed=_moving(p["LOIT_SPEED"] / 100.0),
        loiter_accel=_moving(p["LOIT_ACC_MAX"] / 100.0, 1.0),
        loiter_tilt=min(angle, _moving(radians(p["LOIT_ANG_MAX"]), angle * 2.0 / 3.0)),
        loiter_brake=_moving(p["LOIT_BRK_ACCEL"] / 100.0, 1.0),
        loiter_brake_delay=from_seconds(p["LOIT_BRK_DELAY"]),
        circle_radius=p["CIRCLE_RADIUS"] / 100.0,
        circle_rate=radians(p["CIRCLE_RATE"]),
        target_timeout=from_seconds(p["GUID_TIMEOUT"]),
    )


def rover(parameters: Parameters) -> Tuning:
    """A rover's. Its parameters are metres and degrees."""
    p = parameters
    speed = _moving(p["WP_SPEED"], _moving(p["CRUISE_SPEED"]))
    return Tuning(
        sticks=stick_map(p),
        speed=speed,
        accel=_moving(p["ATC_ACCEL_MAX"], 1.0),
        waypoint_radius=_moving(p["WP_RADIUS"]),
        return_speed=_moving(p["RTL_SPEED"], speed),
    )

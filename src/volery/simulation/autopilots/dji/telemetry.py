"""What the node publishes: topics, types, rates, and how a message is made of what the aircraft knows."""

from __future__ import annotations

from collections.abc import Callable
from math import cos, radians
from typing import Any, NamedTuple

from volery.base.frames import attitude_ned_to_enu, frd_to_flu, ned_to_enu
from volery.base.time import MS, Ns, S
from volery.ros.graph import DEFAULT, LATCHED, QoS
from volery.ros.messages import message_class
from volery.ros.messages.dji_constants import M100
from volery.simulation.autopilots.dji.controller import Controller

FAST, USUAL, SLOW = 10 * MS, 20 * MS, 200 * MS
"""Periods of the node's three packages of data: 100, 50 and 5 Hz."""

EARTH_M = 6_378_137.0
"""Radius of the flat-earth conversion of the local position."""

FIX, NO_FIX, GPS = 0, -1, 1
SWITCH_SCALE = 8000.0 / 500.0
"""From pulse widths to the numbers that the mode switch shows as: -8000 P, 0 A, 8000 F. Assumed."""

Builder = Callable[[Controller, Ns], Any]
"""The message now, stamped with a ROS time; ``None`` while there is none."""


class Topic(NamedTuple):
    """One topic."""

    name: str
    type: str
    period: Ns
    build: Builder
    qos: QoS = DEFAULT


def _header(stamp: Ns, frame: str) -> Any:
    time = message_class("builtin_interfaces/msg/Time")(stamp // S, stamp % S)
    return message_class("std_msgs/msg/Header")(time, frame)


def _vector(values: tuple[float, float, float]) -> Any:
    return message_class("geometry_msgs/msg/Vector3")(*values)


def _quaternion(controller: Controller) -> Any:
    w, x, y, z = attitude_ned_to_enu(controller.vehicle.estimate.quaternion)
    return message_class("geometry_msgs/msg/Quaternion")(x, y, z, w)


def _attitude(controller: Controller, stamp: Ns) -> Any:
    kind = message_class("geometry_msgs/msg/QuaternionStamped")
    return kind(_header(stamp, "body_FLU"), _quaternion(controller))


def _imu(controller: Controller, stamp: Ns) -> Any:
    estimate = controller.vehicle.estimate
    made: Any = message_class("sensor_msgs/msg/Imu")(_header(stamp, "body_FLU"))
    made.orientation = _quaternion(controller)
    made.angular_velocity = _vector(frd_to_flu(estimate.rates))
    made.linear_acceleration = _vector(frd_to_flu(estimate.accel))
    return made


def _rates(controller: Controller, stamp: Ns) -> Any:
    rates = frd_to_flu(controller.vehicle.estimate.rates)
    return message_class("geometry_msgs/msg/Vector3Stamped")(_header(stamp, "body_FLU"), _vector(rates))


def _acceleration(controller: Controller, stamp: Ns) -> Any:
    acceleration = ned_to_enu(controller.vehicle.estimate.acceleration)
    kind = message_class("geometry_msgs/msg/Vector3Stamped")
    return kind(_header(stamp, "ground_ENU"), _vector(acceleration))


def _velocity(controller: Controller, stamp: Ns) -> Any:
    velocity = ned_to_enu(controller.vehicle.estimate.velocity)
    kind = message_class("geometry_msgs/msg/Vector3Stamped")
    return kind(_header(stamp, "ground_ENU"), _vector(velocity))


def _byte(value: int) -> Any:
    return message_class("std_msgs/msg/UInt8")(value)


def _display_mode(controller: Controller, _stamp: Ns) -> Any:
    """An M100 has none."""
    return None if controller.aircraft == M100 else _byte(controller.mode)


def _fix(stamp: Ns, place: tuple[float, float, float], good: bool) -> Any:
    made: Any = message_class("sensor_msgs/msg/NavSatFix")(_header(stamp, "/gps"))
    made.status.status, made.status.service = (FIX if good else NO_FIX), GPS
    made.latitude, made.longitude, made.altitude = place
    return made


def _gps_position(controller: Controller, stamp: Ns) -> Any:
    """Altitude above the sea."""
    vehicle = controller.vehicle
    if not vehicle.estimate.position_ok:
        return _fix(stamp, (0.0, 0.0, 0.0), good=False)
    return _fix(stamp, vehicle.estimate.geodetic, good=True)


def _local_position(controller: Controller, stamp: Ns) -> Any:
    """East, north, up of the reference."""
    reference = controller.reference
    if reference is None:
        return None
    latitude, longitude, amsl = controller.vehicle.estimate.geodetic
    made: Any = message_class("geometry_msgs/msg/PointStamped")(_header(stamp, "/local"))
    made.point.x = radians(longitude - reference[1]) * EARTH_M * cos(radians(reference[0]))
    made.point.y = radians(latitude - reference[0]) * EARTH_M
    made.point.z = amsl - reference[2]
    return made


def _local_frame_ref(controller: Controller, stamp: Ns) -> Any:
    reference = controller.reference
    return None if reference is None else _fix(stamp, reference, good=True)


def _height(controller: Controller, _stamp: Ns) -> Any:
    return message_class("std_msgs/msg/Float32")(controller.vehicle.height)


def _rc(controller: Controller, stamp: Ns) -> Any:
    """Roll, pitch, yaw, throttle in -1..1, mode switch, gear."""
    pulses = controller.vehicle.sticks.pulses()
    roll, pitch, throttle, yaw, switch = ((pulse - 1500) / 500.0 for pulse in pulses[:5])
    axes = [roll, pitch, yaw, throttle, switch * 500.0 * SWITCH_SCALE, 0.0]
    return message_class("sensor_msgs/msg/Joy")(_header(stamp, ""), axes, [])


def _battery(controller: Controller, stamp: Ns) -> Any:
    """Millivolts, milliamperes and percent, as the flight controller gives them."""
    estimate = controller.vehicle.estimate
    made: Any = message_class("sensor_msgs/msg/BatteryState")(_header(stamp, ""))
    made.voltage = estimate.battery_volts * 1000.0
    made.current = -estimate.battery_amps * 1000.0
    made.capacity = controller.vehicle.flight.capacity_as / 3.6
    made.percentage = float(round(estimate.battery_left * 100.0))
    made.present = True
    return made


def _anomaly(controller: Controller, package: str) -> Any:
    return message_class(f"{package}/msg/FlightAnomaly")(controller.anomalies)


TOPICS: tuple[Topic, ...] = (
    Topic("attitude", "geometry_msgs/msg/QuaternionStamped", FAST, _attitude),
    Topic("imu", "sensor_msgs/msg/Imu", FAST, _imu),
    Topic("angular_velocity_fused", "geometry_msgs/msg/Vector3Stamped", FAST, _rates),
    Topic("acceleration_ground_fused", "geometry_msgs/msg/Vector3Stamped", FAST, _acceleration),
    Topic("flight_status", "std_msgs/msg/UInt8", USUAL, lambda one, _: _byte(one.status)),
    Topic("display_mode", "std_msgs/msg/UInt8", USUAL, _display_mode),
    Topic("gps_health", "std_msgs/msg/UInt8", USUAL, lambda one, _: _byte(one.gps_health)),
    Topic("gps_position", "sensor_msgs/msg/NavSatFix", USUAL, _gps_position),
    Topic("local_position", "geometry_msgs/msg/PointStamped", USUAL, _local_position),
    Topic("height_above_takeoff", "std_msgs/msg/Float32", USUAL, _height),
    Topic("velocity", "geometry_msgs/msg/Vector3Stamped", USUAL, _velocity),
    Topic("rc", "sensor_msgs/msg/Joy", USUAL, _rc),
    Topic("rc_connection_status", "std_msgs/msg/UInt8", USUAL, lambda _one, _stamp: _byte(1)),
    Topic("battery_state", "sensor_msgs/msg/BatteryState", SLOW, _battery),
)
"""All that is repeated, but for ``flight_anomaly``, whose type depends on the names."""

REFERENCE = Topic("local_frame_ref", "sensor_msgs/msg/NavSatFix", 0, _local_frame_ref, LATCHED)


def topics(package: str) -> tuple[Topic, ...]:
    """All that is repeated, with the types of *package*."""
    kind = f"{package}/msg/FlightAnomaly"
    return (*TOPICS, Topic("flight_anomaly", kind, USUAL, lambda one, _: _anomaly(one, package)))

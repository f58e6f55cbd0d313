"""What the sensors felt, as ROS messages: FRD to FLU, MAVLink's units to SI.

RAW_IMU and SCALED_IMU carry thousandths of g, of rad/s and of gauss (so ArduPilot; MAVLink leaves the
units of RAW_IMU open); HIGHRES_IMU, which PX4 sends, carries m/s^2, rad/s and gauss.
"""

from __future__ import annotations

from collections.abc import Mapping
from math import isnan
from typing import Any, NamedTuple

from volery.base import frames
from volery.base.time import Ns
from volery.bridge.offering import BODY, Fields, Surroundings, Topic, Translate, stamped
from volery.bridge.wire import Wire
from volery.ros.messages import message_class, new

G = 9.80665
TESLA = 1e-4
"""Of a gauss."""
PASCALS = 100.0
"""Of a hectopascal."""
IMU = "sensor_msgs/msg/Imu"
UNKNOWN = -1.0
"""First in a covariance: there is no such measurement (sensor_msgs/Imu)."""

_vector = message_class("geometry_msgs/msg/Vector3")
_quaternion = message_class("geometry_msgs/msg/Quaternion")

TOPICS = (
    Topic("imu/data", IMU),
    Topic("imu/data_raw", IMU, on_demand=True),
    Topic("imu/mag", "sensor_msgs/msg/MagneticField", on_demand=True),
    Topic("imu/static_pressure", "sensor_msgs/msg/FluidPressure", on_demand=True),
    Topic("imu/diff_pressure", "sensor_msgs/msg/FluidPressure", on_demand=True),
    Topic("imu/temperature_imu", "sensor_msgs/msg/Temperature", on_demand=True),
)


class Felt(NamedTuple):
    """One measurement in FRD: m/s^2, rad/s, tesla."""

    acceleration: frames.Vector
    rates: frames.Vector
    field: frames.Vector


def _triple(said: Fields, kind: str, scale: float) -> frames.Vector:
    return said[f"x{kind}"] * scale, said[f"y{kind}"] * scale, said[f"z{kind}"] * scale


def felt(name: str, said: Fields) -> Felt:
    """What a RAW_IMU, SCALED_IMU or HIGHRES_IMU says."""
    if name == "HIGHRES_IMU":
        return Felt(_triple(said, "acc", 1.0), _triple(said, "gyro", 1.0), _triple(said, "mag", TESLA))
    return Felt(
        _triple(said, "acc", G / 1000.0), _triple(said, "gyro", 1e-3), _triple(said, "mag", TESLA / 1000.0)
    )


SOURCES = ("HIGHRES_IMU", "RAW_IMU", "SCALED_IMU")
"""Where measurements are taken from: the first of them that the autopilot sends."""


def source(wire: Wire) -> str:
    """Which one it is; empty while none has come."""
    return next((name for name in SOURCES if name in wire.latest), "")


class Inertial:
    """Translates frames."""

    def __init__(self, around: Surroundings) -> None:
        self._wire = around.wire
        self._publish, self._wanted = around.publish, around.wanted

    def translators(self) -> Mapping[str, Translate]:
        """By the name of the frame."""
        return {
            "ATTITUDE": self._attitude,
            **{name: self._measured(name) for name in SOURCES},
            "SCALED_PRESSURE": self._pressure,
        }

    def _attitude(self, said: Fields, at: Ns) -> None:
        """Its acceleration is that of the last measurement; without one it is marked unknown, as are rates
        that are no numbers.
        """
        message = new(IMU, header=stamped(at, BODY))
        message.orientation = orientation(said)
        message.angular_velocity = body_rates(said)
        if isnan(said["rollspeed"]):
            message.angular_velocity_covariance[0] = UNKNOWN
        name = source(self._wire)
        last = self._wire.last(name)
        if last is None:
            message.linear_acceleration_covariance[0] = UNKNOWN
        else:
            message.linear_acceleration = _vector(*frames.frd_to_flu(felt(name, last).acceleration))
        self._publish("imu/data", message)

    def _measured(self, name: str) -> Translate:
        def translate(said: Fields, at: Ns) -> None:
            if source(self._wire) != name:
                return
            if self._wanted("imu/data_raw"):
                self._publish("imu/data_raw", _raw(felt(name, said), at))
            if self._wanted("imu/mag"):
                field = _vector(*frames.frd_to_flu(felt(name, said).field))
                kind = "sensor_msgs/msg/MagneticField"
                self._publish("imu/mag", new(kind, header=stamped(at, BODY), magnetic_field=field))

        return translate

    def _pressure(self, said: Fields, at: Ns) -> None:
        """Hectopascals and hundredths of a degree."""
        for topic, name in (("imu/static_pressure", "press_abs"), ("imu/diff_pressure", "press_diff")):
            if self._wanted(topic):
                header, pascals = stamped(at, BODY), said[name] * PASCALS
                self._publish(
                    topic, new("sensor_msgs/msg/FluidPressure", header=header, fluid_pressure=pascals)
                )
        if self._wanted("imu/temperature_imu"):
            degrees = said["temperature"] / 100.0
            kind = "sensor_msgs/msg/Temperature"
            self._publish("imu/temperature_imu", new(kind, header=stamped(at, BODY), temperature=degrees))


def _raw(measured: Felt, at: Ns) -> Any:
    message = new(IMU, header=stamped(at, BODY))
    message.orientation_covariance[0] = UNKNOWN
    message.angular_velocity = _vector(*frames.frd_to_flu(measured.rates))
    message.linear_acceleration = _vector(*frames.frd_to_flu(measured.acceleration))
    return message


def orientation(attitude: Fields) -> Any:
    """An ATTITUDE as the quaternion of a FLU body in ENU."""
    ned = frames.euler_to_quaternion(attitude["roll"], attitude["pitch"], attitude["yaw"])
    w, x, y, z = frames.attitude_ned_to_enu(ned)
    return _quaternion(x, y, z, w)


def body_rates(attitude: Fields) -> Any:
    """The rates of an ATTITUDE in FLU."""
    rates = (attitude["rollspeed"], attitude["pitchspeed"], attitude["yawspeed"])
    return _vector(*frames.frd_to_flu(rates))

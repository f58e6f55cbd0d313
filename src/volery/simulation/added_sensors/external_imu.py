"""A second inertial sensor, with errors of its own."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from volery.simulation.world.scene import Scene
from volery.simulation.world.sensors import (
    Accelerometer,
    ErrorModel,
    Gyroscope,
    SampledSensor,
    Sampler,
    Sensor,
    SensorInput,
)

GYRO, ACCELEROMETER = Gyroscope(), Accelerometer()
"""Errors of the grade `consumer`."""


class _Gyroscope(Sensor):
    def ideal(self, state: SensorInput) -> tuple[float, ...]:
        return state.rates


class _Accelerometer(Sensor):
    def ideal(self, state: SensorInput) -> tuple[float, ...]:
        return state.specific_force


@dataclass(frozen=True)
class ExternalImu(SampledSensor):
    """Body rates and specific force at the body's centre. It publishes ``sensor_msgs/Imu``, no orientation.

    Args:
        gyro: Errors of the gyroscope [rad/s].
        accelerometer: Errors of the accelerometer [m/s^2].
    """

    gyro: ErrorModel = GYRO
    accelerometer: ErrorModel = ACCELEROMETER

    type = "sensor_msgs/msg/Imu"

    def sampler(self, noise: np.uint64, scene: Scene) -> Sampler:
        """See ``SampledSensor``."""
        rates = _Gyroscope(self.name, self.rate, self.gyro).sampler(noise, scene)
        forces = _Accelerometer(self.name, self.rate, self.accelerometer).sampler(noise ^ np.uint64(1), scene)
        return lambda state, k: (*rates(state, k), *forces(state, k))

    def fill(self, message: Any, values: Any) -> None:
        """Write rates and forces into a message."""
        turning, force = message.angular_velocity, message.linear_acceleration
        turning.x, turning.y, turning.z, force.x, force.y, force.z = values
        message.orientation_covariance[0] = -1.0  # there is none
        for at in (0, 4, 8):
            message.angular_velocity_covariance[at] = self.gyro.variance
            message.linear_acceleration_covariance[at] = self.accelerometer.variance

"""Airspeed sensor: a pitot tube along the forward axis of a simulated vehicle.

It derives from ``Sensor``: the law without error stands here, white noise, bias and sampling are the world's.
Figures are of the kind that data sheets give for MS4525DO class differential pressure sensors; estimated.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from volery.base.frames import world_to_body
from volery.simulation.world.sensors import ErrorModel, Sensor, SensorInput

ERROR = ErrorModel(white_sigma=0.3, bias_sigma=0.2, correlation_time=300.0)
"""Default error [m/s]."""


@dataclass(frozen=True)
class AirspeedSensor(Sensor):
    """Forward component of the velocity relative to the air, at least 0.

    Args:
        name: Name by which the sensor is mounted and read.
        error: Error of the airspeed [m/s].
        rate: Samples per second [Hz].
        max_speed: Largest airspeed that is measured [m/s].
    """

    name: str = "airspeed"
    error: ErrorModel = ERROR
    rate: float = 10.0
    max_speed: float = 60.0

    type = "geometry_msgs/msg/TwistStamped"

    def ideal(self, state: SensorInput) -> tuple[float]:
        """Return the airspeed along the forward axis [m/s]."""
        east, north, up = (v - air for v, air in zip(state.velocity, state.air_velocity, strict=True))
        forward, _, _ = world_to_body(state.attitude, (east, north, up))
        return (forward,)

    def output(self, values: tuple[float, ...]) -> tuple[float, ...]:
        """Return the reading within the range of the sensor [m/s]."""
        return (min(max(values[0], 0.0), self.max_speed),)

    def fill(self, message: Any, values: tuple[float, ...]) -> None:
        """Write the airspeed into the twist: forward is x."""
        message.twist.linear.x = values[0]


SENSOR = AirspeedSensor()

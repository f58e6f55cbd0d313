"""Lidars: one ring of beams in a plane, or several rings one above the other."""

from __future__ import annotations

from dataclasses import dataclass
from math import pi
from typing import Any

import numpy as np

from volery.base.elementary import sine_cosine
from volery.base.errors import UsageError
from volery.simulation.added_sensors.beams import BeamSensor
from volery.simulation.world.state_layout import Array


@dataclass(frozen=True)
class Lidar(BeamSensor):
    """A planar laser scanner. It publishes ``sensor_msgs/LaserScan``.

    Args:
        columns: Number of beams, at least 2.
        field: Angle from the first beam to the last [rad], its middle ahead; over a whole turn the last one
            is as far from the first as from the one before.
    """

    columns: int
    field: float

    type = "sensor_msgs/msg/LaserScan"

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.columns < 2 or not 0.0 < self.field <= 2.0 * pi:
            what = f"{self.columns} beams over {self.field} rad; give at least two, and up to 2 pi"
            raise UsageError(f"{self.name}: {what}")

    @property
    def first(self) -> float:
        """Angle of the first beam, anticlockwise from ahead [rad]."""
        return -0.5 * self.field

    @property
    def between(self) -> float:
        """Angle from one beam to the next [rad]."""
        return self.field / (self.columns if self.field >= 2.0 * pi else self.columns - 1)

    def beams(self) -> Array:
        """See ``BeamSensor``: from right to left."""
        angles = [sine_cosine(self.first + at * self.between) for at in range(self.columns)]
        return np.array([(cosine, sine, 0.0) for sine, cosine in angles])

    def fill(self, message: Any, values: Any) -> None:
        """Write the ranges into a scan."""
        message.angle_min, message.angle_increment = self.first, self.between
        message.angle_max = self.first + (self.columns - 1) * self.between
        message.scan_time = 1.0 / self.rate
        message.range_min, message.range_max = self.ranging.least, self.ranging.most
        message.ranges = values.astype(np.float32)

"""Sensors that read one distance: the nearest return within a cone, as of sonars and laser range finders."""

from __future__ import annotations

from dataclasses import dataclass
from math import pi
from typing import Any

import numpy as np

from volery.base.elementary import sine_cosine
from volery.simulation.added_sensors.beams import BeamSensor
from volery.simulation.world.state_layout import Array

ULTRASOUND, INFRARED = 0, 1
"""Radiation types of ``sensor_msgs/Range``."""
_RINGS = (6, 12)  # beams about the axis, at half and at all of the cone's angle


@dataclass(frozen=True)
class ConeRanger(BeamSensor):
    """A sonar or a range finder. It publishes ``sensor_msgs/Range``.

    Args:
        field: Angle of the cone from side to side [rad]; it is sampled by an axis and two rings of beams.
        radiation: ``ULTRASOUND`` or ``INFRARED``.
    """

    field: float
    radiation: int

    type = "sensor_msgs/msg/Range"

    @property
    def beams_each(self) -> int:
        """See ``BeamSensor``: all of them for one reading."""
        return 1 + sum(_RINGS)

    def beams(self) -> Array:
        """See ``BeamSensor``."""
        found = [(1.0, 0.0, 0.0)]
        for ring, count in enumerate(_RINGS, 1):
            off, along = sine_cosine(0.5 * self.field * ring / len(_RINGS))
            for number in range(count):
                up, left = sine_cosine(2.0 * pi * number / count)
                found.append((along, off * left, off * up))
        return np.array(found)

    def fill(self, message: Any, values: Any) -> None:
        """Write the distance into a message."""
        message.radiation_type, message.field_of_view = self.radiation, self.field
        message.min_range, message.max_range = self.ranging.least, self.ranging.most
        message.range = float(values[0])

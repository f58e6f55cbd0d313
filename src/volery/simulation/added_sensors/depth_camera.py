"""A depth camera: the distance along its axis, for each pixel of a picture."""

from __future__ import annotations

from dataclasses import dataclass
from math import inf
from typing import Any

import numpy as np

from volery.base.elementary import sine_cosine
from volery.base.errors import UsageError
from volery.simulation.added_sensors.beams import BeamSensor
from volery.simulation.world.sensors import SensorMessage
from volery.simulation.world.state_layout import Array

OPTICAL = (0.5, -0.5, 0.5, -0.5)
"""Quaternion from the axes of a camera (right, down, along its axis) to forward, left, up."""


@dataclass(frozen=True)
class DepthCamera(BeamSensor):
    """A depth camera without distortion. It publishes an image of 32FC1 and ``sensor_msgs/CameraInfo``.

    Its frame has the axes of a camera, and ``mounting`` turns from them.

    Args:
        width: Pixels in a row.
        height: Rows.
        field: Angle from the middle of the first column to that of the last [rad], below pi.
    """

    width: int
    height: int
    field: float

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.width < 2 or self.height < 1 or not 0.0 < self.field < 3.1:
            what = f"{self.width} x {self.height} pixels over {self.field} rad"
            raise UsageError(f"{self.name}: {what}; give two columns or more, over less than 3.1 rad")

    @property
    def frame(self) -> str:
        """See ``SampledSensor``."""
        return f"{self.name}_optical_frame"

    @property
    def focal_length(self) -> float:
        """Focal length in pixels."""
        sine, cosine = sine_cosine(0.5 * self.field)
        return float(0.5 * (self.width - 1) * cosine / sine)

    def beams(self) -> Array:
        """See ``BeamSensor``: row by row, in the axes of a camera."""
        rows, columns = np.mgrid[: self.height, : self.width].reshape(2, -1).astype(np.float64)
        right = (columns - 0.5 * (self.width - 1)) / self.focal_length
        down = (rows - 0.5 * (self.height - 1)) / self.focal_length
        ways = np.stack((right, down, np.ones_like(right)), axis=1)
        return np.ascontiguousarray(ways / np.sqrt((ways * ways).sum(axis=1))[:, None])

    def publications(self) -> tuple[SensorMessage, ...]:
        """See ``SampledSensor``."""
        below = f"{self.topic}/" if self.topic else ""
        return (
            SensorMessage(f"{below}depth/image_rect", "sensor_msgs/msg/Image", self.fill),
            SensorMessage(f"{below}depth/camera_info", "sensor_msgs/msg/CameraInfo", self.fill_info),
        )

    def fill(self, message: Any, values: Any) -> None:
        """Write the depths into an image; infinity without a return (REP 118)."""
        depths = np.where(np.abs(values) < inf, values * self.directions[:, 2], values).astype("<f4")
        message.height, message.width, message.encoding = self.height, self.width, "32FC1"
        message.step, message.data = 4 * self.width, depths.view(np.uint8)

    def fill_info(self, message: Any, values: Any) -> None:
        """Write the calibration."""
        f, x, y = self.focal_length, 0.5 * (self.width - 1), 0.5 * (self.height - 1)
        message.height, message.width, message.distortion_model = self.height, self.width, "plumb_bob"
        message.d = [0.0] * 5
        message.k = [f, 0.0, x, 0.0, f, y, 0.0, 0.0, 1.0]
        message.r = [1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0]
        message.p = [f, 0.0, x, 0.0, 0.0, f, y, 0.0, 0.0, 0.0, 1.0, 0.0]

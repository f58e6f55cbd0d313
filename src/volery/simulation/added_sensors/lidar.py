"""Lidars: one ring of beams in a plane, or several rings one above the other."""

from __future__ import annotations

from dataclasses import dataclass
from math import pi
from typing import Any

import numpy as np

from volery.base.elementary import sine_cosine
from volery.base.errors import UsageError
from volery.ros.messages import new
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


_POINT = np.dtype({"names": ["x", "y", "z", "ring"], "formats": ["<f4", "<f4", "<f4", "<u2"], "itemsize": 16})
_UINT16, _FLOAT32 = 4, 7  # of sensor_msgs/PointField


@dataclass(frozen=True)
class RingLidar(BeamSensor):
    """A laser scanner with rings one above the other. It publishes ``sensor_msgs/PointCloud2``.

    The cloud has a row for each ring, the lowest first; a beam without a return is a point of NaN.

    Args:
        rings: Number of rings, at least 1.
        columns: Number of beams of a ring, at least 2.
        lowest: Elevation of the lowest ring [rad].
        highest: Elevation of the highest ring [rad].
    """

    rings: int
    columns: int
    lowest: float
    highest: float

    type = "sensor_msgs/msg/PointCloud2"

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.lowest > self.highest or self.rings < 1 or self.columns < 2:
            what = f"{self.rings} rings of {self.columns} beams from {self.lowest} to {self.highest} rad"
            raise UsageError(f"{self.name}: {what}; give some beams, and the lower angle first")

    def beams(self) -> Array:
        """See ``BeamSensor``: ring by ring, each from behind over the right side."""
        around = [sine_cosine(-pi + 2.0 * pi * at / self.columns) for at in range(self.columns)]
        between = (self.highest - self.lowest) / max(self.rings - 1, 1)
        rises = [sine_cosine(self.lowest + ring * between) for ring in range(self.rings)]
        return np.array([(flat * c, flat * s, up) for up, flat in rises for s, c in around])

    def fill(self, message: Any, values: Any) -> None:
        """Write the ends of the beams into a cloud."""
        points = np.zeros(len(values), _POINT)
        ends = self.directions * np.where(np.isfinite(values), values, np.nan)[:, None]
        points["x"], points["y"], points["z"] = ends.T
        points["ring"] = np.repeat(np.arange(self.rings), self.columns)
        message.height, message.width = self.rings, self.columns
        columns = (("x", 0, _FLOAT32), ("y", 4, _FLOAT32), ("z", 8, _FLOAT32), ("ring", 12, _UINT16))
        message.fields = [
            new("sensor_msgs/msg/PointField", name=name, offset=offset, datatype=kind, count=1)
            for name, offset, kind in columns
        ]
        message.point_step, message.row_step = _POINT.itemsize, _POINT.itemsize * self.columns
        message.data = points.view(np.uint8)
        message.is_dense = bool(np.isfinite(values).all())

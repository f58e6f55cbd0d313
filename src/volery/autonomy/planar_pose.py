"""Poses in a plane: position and yaw, their composition and their difference."""

from __future__ import annotations

from math import sqrt
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from volery.base.elementary import sine_cosine
from volery.base.frames import wrap
from volery.base.metered_work import done

Array = NDArray[np.float64]


class Pose2(NamedTuple):
    """A pose in a plane: x and y [m], yaw [rad], counter-clockwise from the x axis."""

    x: float = 0.0
    y: float = 0.0
    yaw: float = 0.0

    @property
    def distance(self) -> float:
        """Distance from the origin of its frame [m]."""
        return sqrt(self.x * self.x + self.y * self.y)

    def after(self, motion: Pose2) -> Pose2:
        """Return the pose after a motion that is given in the frame of this pose."""
        done("motion")
        sine, cosine = sine_cosine(self.yaw)
        return Pose2(
            self.x + cosine * motion.x - sine * motion.y,
            self.y + sine * motion.x + cosine * motion.y,
            wrap(self.yaw + motion.yaw),
        )

    def to(self, other: Pose2) -> Pose2:
        """Return the motion from this pose to another one, in the frame of this pose."""
        done("motion")
        sine, cosine = sine_cosine(self.yaw)
        east, north = other.x - self.x, other.y - self.y
        return Pose2(cosine * east + sine * north, cosine * north - sine * east, wrap(other.yaw - self.yaw))

    def of(self, points: Array) -> Array:
        """Return points (n, 2) of the frame of this pose in the frame in which this pose is given."""
        done("turned", points=len(points))
        sine, cosine = sine_cosine(self.yaw)
        turned: Array = points @ np.array(((cosine, sine), (-sine, cosine)))
        turned += (self.x, self.y)
        return turned

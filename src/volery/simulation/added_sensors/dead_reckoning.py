"""Odometry without satellites, as of wheels or of a camera: every move with its error, summed up."""

from __future__ import annotations

from dataclasses import dataclass
from math import radians
from typing import NamedTuple

import numpy as np

from volery.base.elementary import sine_cosine
from volery.base.frames import Quaternion, Vector, body_to_world, multiply, world_to_body
from volery.base.time import Ns, to_seconds
from volery.simulation.world.scene import Scene
from volery.simulation.world.sensors import SampledSensor, SensorInput


class Reckoned(NamedTuple):
    """Where a body is by its own reckoning.

    Args:
        position: East, north, up about the world's origin, as far as it is not in error [m].
        attitude: Quaternion (w, x, y, z) from forward, left, up to the axes of the position.
        velocity: Forward, left, up [m/s].
        rates: About forward, left, up [rad/s].
    """

    position: Vector
    attitude: Quaternion
    velocity: Vector
    rates: Vector


@dataclass(frozen=True)
class DeadReckoning(SampledSensor):
    """Position and heading by summing up moves. It begins at the true ones, and knows what is upright.

    Args:
        drift_deg_s: How fast its heading turns away from the true one, anticlockwise [degrees/s].
        scale: How much too long it takes every way to be.
    """

    drift_deg_s: float
    scale: float

    def sampler(self, noise: np.uint64, scene: Scene) -> _Reckoner:
        """See ``SampledSensor``. Its error is not random."""
        return _Reckoner(self)


class _Reckoner:
    """Sums up the moves of one body."""

    def __init__(self, sensor: DeadReckoning) -> None:
        self._drift, self._scale = radians(sensor.drift_deg_s), 1.0 + sensor.scale
        self._start: Ns | None = None
        self._true: Vector = (0.0, 0.0, 0.0)
        self._position: Vector = (0.0, 0.0, 0.0)

    def __call__(self, state: SensorInput, k: int) -> Reckoned:
        """Return the sums with the move since the last sample."""
        if self._start is None:
            self._start, self._true, self._position = state.time, state.position, state.position
        sine, cosine = sine_cosine(0.5 * self._drift * to_seconds(state.time - self._start))
        turned: Quaternion = (cosine, 0.0, 0.0, sine)
        move = body_to_world(turned, _scaled(self._scale, _less(state.position, self._true)))
        self._true = state.position
        east, north, up = self._position
        self._position = east + move[0], north + move[1], up + move[2]
        velocity = _scaled(self._scale, world_to_body(state.attitude, state.velocity))
        return Reckoned(self._position, multiply(turned, state.attitude), velocity, state.rates)


def _less(one: Vector, other: Vector) -> Vector:
    return one[0] - other[0], one[1] - other[1], one[2] - other[2]


def _scaled(factor: float, vector: Vector) -> Vector:
    return factor * vector[0], factor * vector[1], factor * vector[2]

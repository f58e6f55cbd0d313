"""Sensors that measure distances along beams: rays through the scene, down to the ground, with their errors.

All beams of a sample are of one instant, and turn with the body. A reading is minus infinity where something
is nearer than can be measured, and infinity where nothing is within range or the return was lost (REP 117).
"""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from math import inf, isfinite
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from volery.base.errors import UsageError
from volery.base.frames import body_to_world, multiply
from volery.base.numeric_code import NumericCode, numeric
from volery.simulation.added_sensors.ray_fan import (
    LENGTH,
    RAY_FAN_ARGUMENTS,
    Around,
    RayFan,
    cast_fan,
    new_fan,
    outlines_of,
)
from volery.simulation.world.arithmetic import gaussian, random_word
from volery.simulation.world.body_step import world_sources
from volery.simulation.world.scene import Scene, SceneArrays
from volery.simulation.world.sensors import Mounting, SampledSensor, SensorInput
from volery.simulation.world.state_layout import Array

_WORDS = 18446744073709551616.0  # 64 bits
# Limits and errors of a sensor, for the compiled code.
_LEAST, _MOST, _SIGMA, _LOST, _LIMITS = range(5)


@numeric
def _reading(true: float, limits: Array, key: np.uint64, reading: int, k: int) -> float:
    """Return what is read for a true distance [m], with noise, lost returns and limits."""
    if limits[_LOST] > 0.0 and np.float64(random_word(key, 2 * reading + 1, k)) < limits[_LOST] * _WORDS:
        return inf
    measured = true
    if limits[_SIGMA] > 0.0:
        measured += limits[_SIGMA] * gaussian(key, 2 * reading, k)
    if measured > limits[_MOST]:
        return inf
    return measured if measured >= limits[_LEAST] else -inf


def _compose(digest: str) -> Callable[..., int]:
    def cast_beams(  # noqa: PLR0913, PLR0917  # arrays of the scene, of the fan and of the sensor
        solids: Array, edges: Array, cells: NDArray[np.int64], lattice: Array, outlines: Array,
        heights: Array, grid: Array,
        rays: Array, order: NDArray[np.int64], starts: NDArray[np.int64],
        beams: Array, limits: Array, pose: Array, keys: NDArray[np.uint64], step: NDArray[np.int64],
        readings: Array,
    ) -> int:  # fmt: skip
        scene, fan = SceneArrays(solids, edges, cells, lattice), RayFan(rays, order, starts)
        cast_fan(fan, Around(scene, outlines, heights, grid), beams, pose, limits[_MOST])
        each = beams.shape[0] // readings.shape[0]
        for reading in range(readings.shape[0]):
            nearest = inf
            for beam in range(reading * each, (reading + 1) * each):
                nearest = min(nearest, rays[beam, LENGTH])
            readings[reading] = _reading(nearest, limits, keys[0], reading, step[0])
        return 1 if digest else 0

    return cast_beams


_SCENE = ("float64[:,::1]", "float64[:,::1]", "int64[::1]", "float64[::1]", "float64[:,::1]")
_GROUND = ("float64[:,::1]", "float64[::1]")
_SENSOR = ("float64[:,::1]", "float64[::1]", "float64[::1]", "uint64[::1]", "int64[::1]", "float64[::1]")
cast_beams = NumericCode(
    "cast_beams",
    _compose,
    [*world_sources(), Path(__file__), Path(__file__).with_name("ray_fan.py")],
    (*_SCENE, *_GROUND, *RAY_FAN_ARGUMENTS, *_SENSOR),
)
"""Take all readings of a sensor, each the nearest return of as many beams as there are for one reading."""


@dataclass(frozen=True)
class Ranging:
    """Limits and errors of measured distances.

    Args:
        least: Shortest distance that is measured [m].
        most: Longest distance that is measured [m].
        sigma: Standard deviation of a reading [m].
        lost: Share of the readings that return nothing, 0..1.
    """

    least: float
    most: float
    sigma: float = 0.0
    lost: float = 0.0

    def __post_init__(self) -> None:
        if not (0.0 <= self.least < self.most and isfinite(self.most)):
            raise UsageError(f"distances from {self.least} to {self.most} m; give the shorter one first")
        if self.sigma < 0.0 or not 0.0 <= self.lost <= 1.0:
            raise UsageError(f"{self}: give a standard deviation of at least 0 and a share from 0 to 1")


class BeamSampler:
    """Takes the samples of one beam sensor on one body."""

    def __init__(self, sensor: BeamSensor, noise: np.uint64, scene: Scene) -> None:
        beams = sensor.directions
        self._mounting = sensor.mounting or Mounting()
        self._pose, self._step = np.zeros(12), np.zeros(1, dtype=np.int64)
        self.readings = np.zeros(len(beams) // sensor.beams_each)
        """The readings of the last sample [m]."""
        ranging = sensor.ranging
        limits = np.zeros(_LIMITS)
        limits[:] = ranging.least, ranging.most, ranging.sigma, ranging.lost
        heights, grid = scene.terrain.arrays()
        keys = np.array([noise], dtype=np.uint64)
        ends = beams, limits, self._pose, keys, self._step, self.readings
        where = *scene.arrays, outlines_of(scene), heights, grid
        self.cast = cast_beams.bind(*where, *new_fan(len(beams)), *ends)
        """Takes the last sample once more."""

    def __call__(self, state: SensorInput, k: int) -> Array:
        """Return a new array of readings [m]."""
        off = body_to_world(state.attitude, self._mounting.at)
        turn = multiply(state.attitude, self._mounting.turn)
        self._pose[:3] = [start + by for start, by in zip(state.position, off, strict=True)]
        axes = [body_to_world(turn, axis) for axis in ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0))]
        self._pose[3:] = np.array(axes).T.reshape(-1)
        self._step[0] = k
        self.cast()
        return self.readings.copy()


@dataclass(frozen=True)
class BeamSensor(SampledSensor):
    """A sensor that reads distances along beams.

    Args:
        ranging: Limits and errors of its readings.
    """

    ranging: Ranging

    @property
    def beams_each(self) -> int:
        """Number of successive beams whose nearest return is one reading."""
        return 1

    @abstractmethod
    def beams(self) -> Array:
        """Return unit vectors forward, left, up of the sensor (beams, 3)."""

    @cached_property
    def directions(self) -> Array:
        """The result of ``beams``, made once."""
        return self.beams()

    def sampler(self, noise: np.uint64, scene: Scene) -> BeamSampler:
        """See ``SampledSensor``."""
        return BeamSampler(self, noise, scene)

"""Sensors of a body: their declared parameters, the compiled sampling of the built-in ones, and added ones.

* Error law of every sensor: white noise plus a first-order Gauss-Markov bias, b' = -b/T + s sqrt(2/T) n (IEEE
  Std 952: exponentially correlated). Noise is a function of (seed, sensor, grid step), never of who reads it.
* Built-in sensors are compiled into the step. A package adds its own by an entry point of the group
  ``volery.sensors``: either a ``SensorSuite``, which replaces the parameters of the built-in ones, or a
  ``Sensor``, which is evaluated outside of the compiled step and costs nothing where none is mounted.
* ``consumer``: figures of the kind that data sheets give for MPU-6000, IST8310, MS5611 and u-blox NEO-M8N
  class parts; ``rtk``: the same with a u-blox ZED-F9P class receiver and a base station. Estimated, not
  measured.
* Not modelled: latency, temperature, vibration, multipath near walls, magnetic disturbance by currents.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable
from dataclasses import dataclass, field
from math import sqrt
from typing import Any, ClassVar, NamedTuple

import numpy as np

from volery.base.elementary import exp, sine_cosine
from volery.base.errors import UsageError, choices, did_you_mean
from volery.base.frames import Quaternion, Vector
from volery.base.installed import Registry
from volery.base.numeric_code import numeric
from volery.base.seeds import key
from volery.base.time import Ns, S
from volery.simulation.world.arithmetic import gaussian
from volery.simulation.world.scene import Scene
from volery.simulation.world.state_layout import (
    BIAS_DECAY,
    BIAS_GAIN,
    BIAS_SIGMA,
    M_ACCEL,
    M_ACCEL_BIAS,
    M_BARO,
    M_BARO_BIAS,
    M_BARO_COUNT,
    M_GPS,
    M_GPS_BIAS,
    M_GPS_COUNT,
    M_GPS_FIX,
    M_GPS_VELOCITY,
    M_GPS_VELOCITY_BIAS,
    M_GYRO,
    M_GYRO_BIAS,
    M_MAG,
    M_MAG_BIAS,
    M_MAG_COUNT,
    M_RANGE,
    P_ACCEL_ERROR,
    P_BARO_ERROR,
    P_GPS_FIX,
    P_GPS_HORIZONTAL_ERROR,
    P_GPS_PERIOD,
    P_GPS_VELOCITY_ERROR,
    P_GPS_VERTICAL_ERROR,
    P_GYRO_ERROR,
    P_MAG_ERROR,
    P_MAGNETIC_FIELD,
    P_MAX_RANGE,
    P_PERFECT,
    P_RANGE_ERROR,
    S_GROUND,
    S_POSITION,
    S_RATES,
    S_SPECIFIC_FORCE,
    S_VELOCITY,
    STEP_S,
    U_ACCEL_NOISE,
    U_ACCEL_OFFSET,
    U_BARO_BLOCKED,
    U_GPS_BLOCKED,
    U_GPS_DRIFT,
    U_GPS_DRIFT_START,
    U_GPS_OFFSET,
    U_GYRO_NOISE,
    U_GYRO_OFFSET,
    U_MAG_BLOCKED,
    U_MAG_TURN,
    W_ROTATION,
    WHITE_SIGMA,
    Array,
)

RTK_FIX = 6  # MAVLink's GPS_FIX_TYPE_RTK_FIXED
BIAS_EVERY = 50  # grid steps: biases change at 10 Hz
SLOW_SENSORS_EVERY = 25  # grid steps: barometer, magnetometer and range finder sample at 20 Hz

# Streams of noise: the first of each sensor's. They are part of every trace: never renumber one.
_GYRO_STREAM, _ACCEL_STREAM, _MAG_STREAM, _BARO_STREAM = 1, 4, 7, 10
_GPS_STREAM, _GPS_VELOCITY_STREAM, _RANGE_STREAM, _BIAS_STREAM = 11, 14, 17, 20


# --- declared parameters ---


@dataclass(frozen=True)
class ErrorModel:
    """Error of one measured quantity, per axis.

    Args:
        white_sigma: Standard deviation of the white noise of a sample [unit of the quantity].
        bias_sigma: Standard deviation of the bias [unit of the quantity].
        correlation_time: Time constant of the bias [s], above 0.
    """

    white_sigma: float = 0.0
    bias_sigma: float = 0.0
    correlation_time: float = 1.0

    def __post_init__(self) -> None:
        if self.white_sigma < 0.0 or self.bias_sigma < 0.0 or self.correlation_time <= 0.0:
            raise UsageError(f"{self}: give standard deviations of at least 0 and a correlation time above 0")

    @property
    def variance(self) -> float:
        """Variance of white noise and bias together."""
        return self.white_sigma * self.white_sigma + self.bias_sigma * self.bias_sigma

    def decay(self, period: float) -> float:
        """Return the factor on the bias over *period* [s]."""
        return float(exp(-period / self.correlation_time))


@dataclass(frozen=True)
class Gyroscope(ErrorModel):
    """Three-axis gyroscope [rad/s], sampled at 500 Hz."""

    white_sigma: float = 0.003
    bias_sigma: float = 0.0005
    correlation_time: float = 300.0


@dataclass(frozen=True)
class Accelerometer(ErrorModel):
    """Three-axis accelerometer [m/s^2], sampled at 500 Hz."""

    white_sigma: float = 0.06
    bias_sigma: float = 0.015
    correlation_time: float = 300.0


@dataclass(frozen=True)
class Magnetometer(ErrorModel):
    """Three-axis magnetometer [gauss], sampled at 20 Hz."""

    white_sigma: float = 0.003
    bias_sigma: float = 0.002
    correlation_time: float = 600.0


@dataclass(frozen=True)
class Barometer(ErrorModel):
    """Barometer [m of pressure altitude], sampled at 20 Hz."""

    white_sigma: float = 0.12
    bias_sigma: float = 0.15
    correlation_time: float = 400.0


@dataclass(frozen=True)
class DownwardRange(ErrorModel):
    """Downward range finder [m], sampled at 20 Hz.

    Only the white part of its error is simulated.

    Args:
        max_range: Largest distance that is measured [m].
    """

    white_sigma: float = 0.02
    bias_sigma: float = 0.01
    correlation_time: float = 100.0
    max_range: float = 30.0


@dataclass(frozen=True)
class GpsReceiver:
    """Satellite receiver.

    Args:
        horizontal: Error of each horizontal axis [m].
        vertical: Error of the height [m].
        velocity: Error of each axis of the velocity [m/s].
        rate: Fixes per second [Hz].
        fix_type: MAVLink GPS_FIX_TYPE that it reaches; from ``RTK_FIX`` on the autopilot takes its height.
    """

    horizontal: ErrorModel = ErrorModel(0.15, 0.7, 300.0)
    vertical: ErrorModel = ErrorModel(0.3, 1.2, 300.0)
    velocity: ErrorModel = ErrorModel(0.054)
    rate: float = 5.0
    fix_type: int = 3

    def __post_init__(self) -> None:
        if not 0.0 < self.rate * STEP_S <= 1.0:
            raise UsageError(
                f"a GPS rate of {self.rate} Hz: give one above 0 and at most {1.0 / STEP_S:g} Hz"
            )


@dataclass(frozen=True)
class SensorSuite:
    """Built-in sensors of a vehicle.

    Args:
        name: Name by which a vehicle's ``sensors`` selects it.
        gyro: Parameters of the gyroscope; likewise the next ones.
        perfect: The autopilot's estimate is the true state; errors should then be zero.
    """

    name: str
    gyro: ErrorModel = Gyroscope()
    accelerometer: ErrorModel = Accelerometer()
    magnetometer: ErrorModel = Magnetometer()
    barometer: ErrorModel = Barometer()
    gps: GpsReceiver = GpsReceiver()
    range_finder: DownwardRange = DownwardRange()
    perfect: bool = False


SENSOR_SUITES: dict[str, SensorSuite] = {
    "consumer": SensorSuite("consumer"),
    "rtk": SensorSuite(
        "rtk",
        gps=GpsReceiver(
            horizontal=ErrorModel(0.008, 0.01, 300.0),
            vertical=ErrorModel(0.015, 0.015, 300.0),
            velocity=ErrorModel(0.0206),
            rate=10.0,
            fix_type=RTK_FIX,
        ),
    ),
    "sih": SensorSuite(
        "sih",
        barometer=ErrorModel(0.1),  # SensorBaroSim.cpp: 1 Pa
        gps=GpsReceiver(  # SensorGpsSim.cpp
            horizontal=ErrorModel(0.2),
            vertical=ErrorModel(0.5),
            velocity=ErrorModel(0.07),
            rate=8.0,
        ),
    ),
    "perfect": SensorSuite(
        "perfect",
        gyro=ErrorModel(),
        accelerometer=ErrorModel(),
        magnetometer=ErrorModel(),
        barometer=ErrorModel(),
        gps=GpsReceiver(ErrorModel(), ErrorModel(), ErrorModel(), rate=10.0, fix_type=RTK_FIX),
        range_finder=DownwardRange(0.0, 0.0, 1.0),
        perfect=True,
    ),
}


class Sigma(NamedTuple):
    """Declared standard deviations [m]: horizontal of the distance in the plane, vertical of the height."""

    horizontal: float
    vertical: float


def declared_sigma(name: str) -> Sigma:
    """Return how far a position from the suite's receiver is from the true one, one standard deviation.

    Horizontal: root of the sum of both axes' variances (the "drms" of receivers' data sheets). Vertical: the
    receiver's height, and without a real-time kinematic fix also the barometer's error.
    """
    suite = sensor_suite(name)
    air = 0.0 if suite.gps.fix_type >= RTK_FIX else suite.barometer.variance
    return Sigma(
        horizontal=sqrt(2.0 * suite.gps.horizontal.variance), vertical=sqrt(suite.gps.vertical.variance + air)
    )


# --- sensors added by a package ---


class SensorInput(NamedTuple):
    """True state of a body at a sampling step, for an added sensor.

    Args:
        time: Time of the step [ns].
        position: East, north, up about the world's origin [m].
        velocity: East, north, up [m/s].
        attitude: Quaternion (w, x, y, z) from body (forward, left, up) to east, north, up.
        rates: Body rates about forward, left, up [rad/s].
        specific_force: Forward, left, up [m/s^2].
        air_velocity: Velocity of the air, east, north, up [m/s]: mean wind and gust.
        ground: Height of the ground straight below, up [m].
        scene: What stands in the world; ``scene.cast`` returns the distances at which rays end.
    """

    time: Ns
    position: Vector
    velocity: Vector
    attitude: Quaternion
    rates: Vector
    specific_force: Vector
    air_velocity: Vector
    ground: float
    scene: Scene


class Mounting(NamedTuple):
    """Where a sensor is on a body.

    Args:
        at: Its place from the body's centre: forward, left, up [m].
        turn: Quaternion (w, x, y, z) from its axes to the body's.
    """

    at: Vector = (0.0, 0.0, 0.0)
    turn: Quaternion = (1.0, 0.0, 0.0, 0.0)


class SensorMessage(NamedTuple):
    """What is published of each sample.

    Args:
        topic: Name of the topic, below that of the vehicle.
        type: ROS type of the messages, such as ``sensor_msgs/msg/Range``.
        fill: ``fill(message, values)`` writes a sample into a new message, whose header is there already.
        on_demand: Whether it is published only while a node subscribes to it or its content is recorded.
    """

    topic: str
    type: str
    fill: Callable[[Any, Any], None]
    on_demand: bool = False


Sampler = Callable[[SensorInput, int], Any]
"""``sampler(state, k)`` returns what a sensor measures at grid step *k*; it is called in their order."""


@dataclass(frozen=True)
class SampledSensor(ABC):
    """Something on a body that is sampled at a rate. ``Sensor`` is the one for laws written in Python.

    Args:
        name: Name by which the sensor is mounted and read.
        rate: Samples per second [Hz]; samples lie on the world's grid of 2 ms.
        mounting: Where it is on the body; ``None``: not stated, and no transform is published.
        topic: Topic of its messages, below that of the vehicle; its name if it is empty.
    """

    name: str
    rate: float
    mounting: Mounting | None = field(default=None, kw_only=True)
    topic: str = field(default="", kw_only=True)

    type: ClassVar[str] = ""
    """ROS type of its messages, such as ``sensor_msgs/msg/Range``; empty: no node publishes it."""

    def __post_init__(self) -> None:
        if not 0.0 < self.rate * STEP_S <= 1.0:
            raise UsageError(
                f"sensor {self.name}: a rate of {self.rate} Hz; give one up to {1.0 / STEP_S:g} Hz"
            )

    @property
    def every(self) -> int:
        """Number of grid steps from one sample to the next."""
        return round(1.0 / (self.rate * STEP_S))

    @property
    def period(self) -> Ns:
        """Time from one sample to the next [ns]."""
        return self.every * round(STEP_S * S)

    @property
    def latency(self) -> Ns:
        """Time from a sample to its message [ns], less than its period."""
        return 0

    @property
    def frame(self) -> str:
        """Frame of its messages."""
        return self.name

    @abstractmethod
    def sampler(self, noise: np.uint64, scene: Scene) -> Sampler:
        """Return what takes the samples on one body, with their errors.

        Args:
            noise: Key of this sensor's noise on this body: a draw is a function of it and the grid step.
            scene: What stands in the world.
        """

    def fill(self, message: Any, values: Any) -> None:
        """Write a reading into a new message of ``type``. Its header is there already."""
        raise NotImplementedError(f"sensor {self.name}: a sensor with a type of messages fills them")

    def publications(self) -> tuple[SensorMessage, ...]:
        """Return what is published of each sample."""
        return (SensorMessage(self.topic or self.name, self.type, self.fill),) if self.type else ()


@dataclass(frozen=True)
class Sensor(SampledSensor):
    """A sensor that a package adds: derive from it, and name an instance in the group ``volery.sensors``.

    With a ``type`` of messages, each sample is published on the topic ``/VEHICLE/NAME`` by a node on the
    vehicle's computer, where components read it.

    Args:
        error: Error of each measured component, in the component's unit.
    """

    error: ErrorModel

    @abstractmethod
    def ideal(self, state: SensorInput) -> tuple[float, ...]:
        """Return the measured components without error: a pure function of *state*."""

    def output(self, values: tuple[float, ...]) -> tuple[float, ...]:
        """Return the reading for *values* with errors: override it to saturate or to quantise."""
        return values

    def sampler(self, noise: np.uint64, scene: Scene) -> Sampler:
        """Return what adds white noise and a bias to each component."""
        return _NoisySampler(self, noise)


class _NoisySampler:
    """Takes the samples of one sensor on one body: ideal components with white noise and bias."""

    def __init__(self, sensor: Sensor, noise: np.uint64) -> None:
        self._sensor = sensor
        self._key = noise
        self._decay = sensor.error.decay(sensor.every * STEP_S)
        self._bias: list[float] = []

    def __call__(self, state: SensorInput, k: int) -> tuple[float, ...]:
        error = self._sensor.error
        ideal = self._sensor.ideal(state)
        gain = error.bias_sigma * (sqrt(1.0 - self._decay * self._decay) if self._bias else 1.0)
        before = self._bias or [0.0] * len(ideal)
        with np.errstate(over="ignore"):  # hashes wrap around
            draws = [float(gaussian(self._key, stream, k)) for stream in range(2 * len(ideal))]
        self._bias = [self._decay * bias + gain * draw for bias, draw in zip(before, draws[::2], strict=True)]
        noisy = tuple(
            value + bias + error.white_sigma * draw
            for value, bias, draw in zip(ideal, self._bias, draws[1::2], strict=True)
        )
        return self._sensor.output(noisy)


class Measurement(NamedTuple):
    """One sample of an added sensor: time of its grid step [ns], and its components."""

    time: Ns
    values: Any


class MountedSensor:
    """One added sensor on one body: takes its samples in order and keeps the last."""

    def __init__(self, sensor: SampledSensor, seed: int, body: int, scene: Scene) -> None:
        self.sensor = sensor
        noise = np.uint64(key(seed, f"world/body/{body}/sensor/{sensor.name}"))
        self._sample = sensor.sampler(noise, scene)
        self.next_step = 0
        """Grid step of the next sample."""
        self.last = Measurement(0, ())

    def sample(self, state: SensorInput) -> None:
        """Take the sample of ``next_step``, at which *state* is the body's."""
        self.last = Measurement(state.time, self._sample(state, self.next_step))
        self.next_step += self.sensor.every


sensors: Registry[SensorSuite | SampledSensor] = Registry("volery.sensors", "sensor")
"""Sensor suites and sensors of other packages."""


def sensor_suite(name: str) -> SensorSuite:
    """Return the suite called *name*, built in or of an entry point.

    Raises:
        UsageError: There is none of that name; the text lists the valid ones.
    """
    if name in SENSOR_SUITES:
        return SENSOR_SUITES[name]
    if name not in sensors.names():
        hint = did_you_mean(name, SENSOR_SUITES)
        raise UsageError(f"no sensor set named {name!r}{hint}; there is {choices(SENSOR_SUITES)}")
    found = sensors.load(name)
    if not isinstance(found, SensorSuite):
        raise UsageError(f"{name!r} is one sensor, not a suite: list it under the vehicle's added sensors")
    return found


def added_sensor(name: str) -> SampledSensor:
    """Return the sensor that a package registered as *name*.

    Raises:
        UsageError: There is none of that name, or it is a suite.
    """
    names = sensors.names()
    if name not in names:
        others = f"there is {choices(names)}" if names else "no installed package provides one"
        raise UsageError(f"no sensor named {name!r}{did_you_mean(name, names)}; {others}")
    found = sensors.load(name)
    if not isinstance(found, SampledSensor):
        raise UsageError(f"{name!r} is a suite of sensors: give it as the vehicle's sensors")
    return found


# --- compiled sampling ---


def fill_sensor_parameters(row: Array, suite: SensorSuite) -> None:
    """Write the parameters of *suite* into a state row."""
    for at, error in (
        (P_GYRO_ERROR, suite.gyro),
        (P_ACCEL_ERROR, suite.accelerometer),
        (P_MAG_ERROR, suite.magnetometer),
        (P_BARO_ERROR, suite.barometer),
        (P_GPS_HORIZONTAL_ERROR, suite.gps.horizontal),
        (P_GPS_VERTICAL_ERROR, suite.gps.vertical),
        (P_GPS_VELOCITY_ERROR, suite.gps.velocity),
        (P_RANGE_ERROR, suite.range_finder),
    ):
        decay = error.decay(BIAS_EVERY * STEP_S)
        row[at + WHITE_SIGMA] = error.white_sigma
        row[at + BIAS_SIGMA] = error.bias_sigma
        row[at + BIAS_DECAY] = decay
        row[at + BIAS_GAIN] = error.bias_sigma * sqrt(1.0 - decay * decay)
    row[P_GPS_PERIOD] = round(1.0 / (suite.gps.rate * STEP_S))
    row[P_GPS_FIX] = suite.gps.fix_type
    row[P_MAX_RANGE] = suite.range_finder.max_range
    row[P_PERFECT] = float(suite.perfect)


@numeric
def _advance_biases(row: Array, key: np.uint64, k: int) -> None:
    """Advance every bias by one period."""
    stream = _BIAS_STREAM
    for error, first, axes in (
        (P_GYRO_ERROR, M_GYRO_BIAS, 3),
        (P_ACCEL_ERROR, M_ACCEL_BIAS, 3),
        (P_MAG_ERROR, M_MAG_BIAS, 3),
        (P_BARO_ERROR, M_BARO_BIAS, 1),
        (P_GPS_HORIZONTAL_ERROR, M_GPS_BIAS, 2),
        (P_GPS_VERTICAL_ERROR, M_GPS_BIAS + 2, 1),
        (P_GPS_VELOCITY_ERROR, M_GPS_VELOCITY_BIAS, 3),
    ):
        for axis in range(axes):
            gain = row[error + BIAS_GAIN] if k > 0 else row[error + BIAS_SIGMA]
            decayed = row[error + BIAS_DECAY] * row[first + axis]
            row[first + axis] = decayed + gain * gaussian(key, stream, k)
            stream += 1


@numeric
def _sample_inertial(row: Array, key: np.uint64, k: int) -> None:
    gyro = row[P_GYRO_ERROR + WHITE_SIGMA] + row[U_GYRO_NOISE]
    accel = row[P_ACCEL_ERROR + WHITE_SIGMA] + row[U_ACCEL_NOISE]
    for axis in range(3):
        sign = 1.0 if axis == 0 else -1.0
        row[M_GYRO + axis] = sign * row[S_RATES + axis] + row[M_GYRO_BIAS + axis] + row[U_GYRO_OFFSET]
        force = sign * row[S_SPECIFIC_FORCE + axis]
        row[M_ACCEL + axis] = force + row[M_ACCEL_BIAS + axis] + row[U_ACCEL_OFFSET]
        if gyro > 0.0 or accel > 0.0:
            row[M_GYRO + axis] += gyro * gaussian(key, _GYRO_STREAM + axis, k)
            row[M_ACCEL + axis] += accel * gaussian(key, _ACCEL_STREAM + axis, k)


@numeric
def _sample_barometer(row: Array, key: np.uint64, k: int) -> None:
    if row[U_BARO_BLOCKED] != 0.0:
        return
    noise = row[P_BARO_ERROR + WHITE_SIGMA] * gaussian(key, _BARO_STREAM, k)
    row[M_BARO] = row[S_POSITION + 2] + row[M_BARO_BIAS] + noise
    row[M_BARO_COUNT] += 1.0


@numeric
def _sample_magnetometer(row: Array, key: np.uint64, k: int) -> None:
    if row[U_MAG_BLOCKED] != 0.0:
        return
    white = row[P_MAG_ERROR + WHITE_SIGMA]
    north, east, down = row[P_MAGNETIC_FIELD], row[P_MAGNETIC_FIELD + 1], row[P_MAGNETIC_FIELD + 2]
    for axis in range(3):
        sign = 1.0 if axis == 0 else -1.0
        field = (
            row[W_ROTATION + axis] * east
            + row[W_ROTATION + 3 + axis] * north
            - row[W_ROTATION + 6 + axis] * down
        )
        error = row[M_MAG_BIAS + axis] + white * gaussian(key, _MAG_STREAM + axis, k)
        row[M_MAG + axis] = sign * field + error
    if row[U_MAG_TURN] != 0.0:
        sine, cosine = sine_cosine(row[U_MAG_TURN])
        forward, right = row[M_MAG], row[M_MAG + 1]
        row[M_MAG] = cosine * forward + sine * right
        row[M_MAG + 1] = cosine * right - sine * forward
    row[M_MAG_COUNT] += 1.0


@numeric
def _sample_range_finder(row: Array, key: np.uint64, k: int) -> None:
    slant = (row[S_POSITION + 2] - row[S_GROUND]) / max(row[W_ROTATION + 8], 0.1)
    slant += row[P_RANGE_ERROR + WHITE_SIGMA] * gaussian(key, _RANGE_STREAM, k)
    in_range = slant <= row[P_MAX_RANGE] and row[W_ROTATION + 8] > 0.5
    row[M_RANGE] = max(slant, 0.0) if in_range else -1.0


@numeric
def _sample_gps(row: Array, key: np.uint64, k: int) -> None:
    if row[U_GPS_BLOCKED] != 0.0:
        row[M_GPS_FIX] = 0.0
        return
    horizontal = row[P_GPS_HORIZONTAL_ERROR + WHITE_SIGMA]
    vertical = row[P_GPS_VERTICAL_ERROR + WHITE_SIGMA]
    speed = row[P_GPS_VELOCITY_ERROR + WHITE_SIGMA]
    for axis in range(3):
        source = 1 - axis if axis < 2 else 2
        sign = 1.0 if axis < 2 else -1.0
        white = horizontal if axis < 2 else vertical
        error = row[M_GPS_BIAS + axis] + white * gaussian(key, _GPS_STREAM + axis, k)
        row[M_GPS + axis] = sign * row[S_POSITION + source] + error
        noise = row[M_GPS_VELOCITY_BIAS + axis] + speed * gaussian(key, _GPS_VELOCITY_STREAM + axis, k)
        row[M_GPS_VELOCITY + axis] = sign * row[S_VELOCITY + source] + noise
    for axis in range(2):
        row[M_GPS + axis] += row[U_GPS_OFFSET + axis]
        drift = row[U_GPS_DRIFT + axis]
        if drift != 0.0:
            row[M_GPS + axis] += drift * (k - row[U_GPS_DRIFT_START]) * STEP_S
            row[M_GPS_VELOCITY + axis] += drift
    row[M_GPS_FIX] = row[P_GPS_FIX]
    row[M_GPS_COUNT] += 1.0


@numeric
def sample_sensors(row: Array, key: np.uint64, k: int) -> None:
    """Take the samples that are due at step *k*; ``W_ROTATION`` holds the attitude of that step."""
    if k % BIAS_EVERY == 0:
        _advance_biases(row, key, k)
    _sample_inertial(row, key, k)
    if k % SLOW_SENSORS_EVERY == 0:
        _sample_barometer(row, key, k)
        _sample_magnetometer(row, key, k)
        _sample_range_finder(row, key, k)
    if k % int(row[P_GPS_PERIOD]) == 0:
        _sample_gps(row, key, k)

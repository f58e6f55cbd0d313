"""Sensors: what a body's instruments report of its true state.

* Law of each error: white noise plus a slow part that is first-order Gauss-Markov, e' = -e/T + s sqrt(2/T) n
  (IEEE Std 952 calls it exponentially correlated). Sampled at fixed steps of the grid; noise is a function of
  (seed, sensor, step), never of who looks.
* ``CONSUMER``: figures of the kind data sheets give for MPU-6000, IST8310, MS5611 and u-blox NEO-M8N class
  parts; ``RTK``: the same with a u-blox ZED-F9P class receiver and a base station. Estimated, not measured.
* Left out: latency, temperature, vibration, multipath near walls, magnetic disturbance by currents.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import sqrt
from typing import NamedTuple

import numpy as np
from numba import njit

from volery.base.errors import UsageError, choices, did_you_mean
from volery.simulation.world.arithmetic import gaussian
from volery.simulation.world.state_layout import (
    ACCEL,
    BARO,
    GPS_HEIGHT,
    GPS_LEVEL,
    GPS_SPEED,
    GYRO,
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
    M_GYRO,
    M_GYRO_BIAS,
    M_MAG,
    M_MAG_BIAS,
    M_MAG_COUNT,
    M_RANGE,
    MAG,
    P_FIELD,
    P_GPS_FIX,
    P_GPS_PERIOD,
    P_RANGE_TOP,
    P_SENSOR,
    RANGE,
    S_FORCE,
    S_GROUND,
    S_POSITION,
    S_RATES,
    S_VELOCITY,
    SENSOR_DECAY,
    SENSOR_KICK,
    SENSOR_SLOW,
    SENSOR_WHITE,
    U_BARO_BLOCKED,
    U_GPS_BLOCKED,
    U_MAG_BLOCKED,
    W_ROTATION,
    Array,
)

RTK_FIX = 6  # MAVLink's GPS_FIX_TYPE_RTK_FIXED
SLOW_EVERY = 50  # steps: slow errors and the field instruments move at 10 Hz
AIR_EVERY = 25  # barometer, magnetometer and range-finder: 20 Hz
_GYRO, _ACCEL, _MAG, _BARO, _GPS, _SPEED, _RANGE, _SLOW = 1, 4, 7, 10, 11, 14, 17, 20


class Noise(NamedTuple):
    """One sensor's error: white and slow standard deviation (SI) and the slow part's correlation time [s]."""

    white: float
    slow: float
    time: float

    @property
    def variance(self) -> float:
        """Of both parts together."""
        return self.white * self.white + self.slow * self.slow


@dataclass(frozen=True)
class SensorSet:
    """A vehicle's instruments, noises in the order of ``columns``; rate in Hz, range-finder's reach in m."""

    name: str
    noises: tuple[Noise, ...]
    gps_rate: float
    gps_fix: int
    range_top: float = 30.0
    perfect: bool = False


_GYRO_NOISE = Noise(white=0.003, slow=0.0005, time=300.0)
_ACCEL_NOISE = Noise(white=0.06, slow=0.015, time=300.0)
_MAG_NOISE = Noise(white=0.003, slow=0.002, time=600.0)
_BARO_NOISE = Noise(white=0.12, slow=0.15, time=400.0)
_RANGE_NOISE = Noise(white=0.02, slow=0.01, time=100.0)
_QUIET = Noise(0.0, 0.0, 1.0)

SENSOR_SETS: dict[str, SensorSet] = {
    "consumer": SensorSet(
        "consumer",
        (
            _GYRO_NOISE,
            _ACCEL_NOISE,
            _MAG_NOISE,
            _BARO_NOISE,
            Noise(white=0.15, slow=0.7, time=300.0),
            Noise(white=0.3, slow=1.2, time=300.0),
            Noise(white=0.05, slow=0.02, time=30.0),
            _RANGE_NOISE,
        ),
        gps_rate=5.0,
        gps_fix=3,
    ),
    "rtk": SensorSet(
        "rtk",
        (
            _GYRO_NOISE,
            _ACCEL_NOISE,
            _MAG_NOISE,
            _BARO_NOISE,
            Noise(white=0.008, slow=0.01, time=300.0),
            Noise(white=0.015, slow=0.015, time=300.0),
            Noise(white=0.02, slow=0.005, time=30.0),
            _RANGE_NOISE,
        ),
        gps_rate=10.0,
        gps_fix=RTK_FIX,
    ),
    "perfect": SensorSet("perfect", (_QUIET,) * 8, gps_rate=10.0, gps_fix=RTK_FIX, perfect=True),
}


class Sigma(NamedTuple):
    """Declared standard deviations [m]: horizontal of the distance in the plane, vertical of the height."""

    horizontal: float
    vertical: float


def sensor_set(name: str) -> SensorSet:
    """The set of that *name*; a ``UsageError`` lists the valid names."""
    if name not in SENSOR_SETS:
        hint = did_you_mean(name, SENSOR_SETS)
        raise UsageError(f"no sensor set named {name!r}{hint}; there is {choices(SENSOR_SETS)}")
    return SENSOR_SETS[name]


def declared_sigma(name: str) -> Sigma:
    """How far a position from the set's receiver is from the truth, one standard deviation.

    Horizontal: root of the sum of both axes' variances (the "drms" of receivers' data sheets). Vertical: the
    receiver's height, and where that is not a real-time kinematic fix the barometer's error beside it.
    """
    chosen = sensor_set(name)
    level = chosen.noises[GPS_LEVEL].variance
    height = chosen.noises[GPS_HEIGHT].variance
    air = 0.0 if chosen.gps_fix >= RTK_FIX else chosen.noises[BARO].variance
    return Sigma(horizontal=sqrt(2.0 * level), vertical=sqrt(height + air))


@njit(cache=False)
def _drift(row: Array, key: np.uint64, k: int) -> None:
    """Move every slow error by one period."""
    stream = _SLOW
    for sensor, first, axes in (
        (GYRO, M_GYRO_BIAS, 3),
        (ACCEL, M_ACCEL_BIAS, 3),
        (MAG, M_MAG_BIAS, 3),
        (BARO, M_BARO_BIAS, 1),
        (GPS_LEVEL, M_GPS_BIAS, 2),
        (GPS_HEIGHT, M_GPS_BIAS + 2, 1),
    ):
        at = P_SENSOR + 4 * sensor
        for axis in range(axes):
            kick = row[at + SENSOR_KICK] if k > 0 else row[at + SENSOR_SLOW]
            decayed = row[at + SENSOR_DECAY] * row[first + axis]
            row[first + axis] = decayed + kick * gaussian(key, stream, k)
            stream += 1


@njit(cache=False)
def _inertial(row: Array, key: np.uint64, k: int) -> None:
    gyro = row[P_SENSOR + 4 * GYRO + SENSOR_WHITE]
    accel = row[P_SENSOR + 4 * ACCEL + SENSOR_WHITE]
    for axis in range(3):
        sign = 1.0 if axis == 0 else -1.0
        row[M_GYRO + axis] = sign * row[S_RATES + axis] + row[M_GYRO_BIAS + axis]
        row[M_ACCEL + axis] = sign * row[S_FORCE + axis] + row[M_ACCEL_BIAS + axis]
        if gyro > 0.0:
            row[M_GYRO + axis] += gyro * gaussian(key, _GYRO + axis, k)
            row[M_ACCEL + axis] += accel * gaussian(key, _ACCEL + axis, k)


@njit(cache=False)
def _barometer(row: Array, key: np.uint64, k: int) -> None:
    if row[U_BARO_BLOCKED] != 0.0:
        return
    noise = row[P_SENSOR + 4 * BARO + SENSOR_WHITE] * gaussian(key, _BARO, k)
    row[M_BARO] = row[S_POSITION + 2] + row[M_BARO_BIAS] + noise
    row[M_BARO_COUNT] += 1.0


@njit(cache=False)
def _compass(row: Array, key: np.uint64, k: int) -> None:
    if row[U_MAG_BLOCKED] != 0.0:
        return
    white = row[P_SENSOR + 4 * MAG + SENSOR_WHITE]
    north, east, down = row[P_FIELD], row[P_FIELD + 1], row[P_FIELD + 2]
    for axis in range(3):
        sign = 1.0 if axis == 0 else -1.0
        field = (
            row[W_ROTATION + axis] * east
            + row[W_ROTATION + 3 + axis] * north
            - row[W_ROTATION + 6 + axis] * down
        )
        error = row[M_MAG_BIAS + axis] + white * gaussian(key, _MAG + axis, k)
        row[M_MAG + axis] = sign * field + error
    row[M_MAG_COUNT] += 1.0


@njit(cache=False)
def _range_finder(row: Array, key: np.uint64, k: int) -> None:
    slant = (row[S_POSITION + 2] - row[S_GROUND]) / max(row[W_ROTATION + 8], 0.1)
    slant += row[P_SENSOR + 4 * RANGE + SENSOR_WHITE] * gaussian(key, _RANGE, k)
    seen = slant <= row[P_RANGE_TOP] and row[W_ROTATION + 8] > 0.5
    row[M_RANGE] = max(slant, 0.0) if seen else -1.0


@njit(cache=False)
def _satellites(row: Array, key: np.uint64, k: int) -> None:
    if row[U_GPS_BLOCKED] != 0.0:
        row[M_GPS_FIX] = 0.0
        return
    level = row[P_SENSOR + 4 * GPS_LEVEL + SENSOR_WHITE]
    height = row[P_SENSOR + 4 * GPS_HEIGHT + SENSOR_WHITE]
    speed = row[P_SENSOR + 4 * GPS_SPEED + SENSOR_WHITE]
    for axis in range(3):
        source = 1 - axis if axis < 2 else 2
        sign = 1.0 if axis < 2 else -1.0
        white = level if axis < 2 else height
        error = row[M_GPS_BIAS + axis] + white * gaussian(key, _GPS + axis, k)
        row[M_GPS + axis] = sign * row[S_POSITION + source] + error
        noise = speed * gaussian(key, _SPEED + axis, k)
        row[M_GPS_VELOCITY + axis] = sign * row[S_VELOCITY + source] + noise
    row[M_GPS_FIX] = row[P_GPS_FIX]
    row[M_GPS_COUNT] += 1.0


@njit(cache=False)
def sample_sensors(row: Array, key: np.uint64, k: int) -> None:
    """Take the samples that fall due at step *k*; ``W_ROTATION`` is the body's at that step."""
    if k % SLOW_EVERY == 0:
        _drift(row, key, k)
    _inertial(row, key, k)
    if k % AIR_EVERY == 0:
        _barometer(row, key, k)
        _compass(row, key, k)
        _range_finder(row, key, k)
    if k % int(row[P_GPS_PERIOD]) == 0:
        _satellites(row, key, k)

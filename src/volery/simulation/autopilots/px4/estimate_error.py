"""Error of EKF2's estimate: a wrong delay of the receiver, and the noise of SIH's sensors.

EKF2 takes a fix to be EKF2_GPS_DELAY old and corrects its oldest state with it. The receiver of SIH has no
such delay: the estimated position is ahead of the aircraft. SIH's gyroscope and accelerometer are far
noisier than EKF2_GYR_NOISE and EKF2_ACC_NOISE say, so the filter corrects too little, and its velocity, tilt,
heading and biases wander. The attitude loops hold the estimated tilt and heading, so what is wrong with them
pushes the aircraft the other way.

The error moves like EKF2's own states, and is corrected by fixes, by the heading of the magnetometer and by
the barometer with gains from their covariance, which is advanced as well: a wrong bias of the accelerometer
looks like a tilt until the nose turns; a wrong heading counts as much as the aircraft accelerates, and so
does a wrong tilt along the vertical, because the accelerometer measures the drag, too. The field is steep, so
a wrong tilt is a wrong heading, too. The output predictor passes the errors on with a lag.
"""

from __future__ import annotations

from math import sqrt
from typing import Final

import numpy as np

from volery.base.elementary import sine_cosine
from volery.base.numeric_code import numeric
from volery.simulation.autopilots.px4.loop_state import (
    A_ACCEL,
    A_FLOWN,
    A_THRUST,
    E_BARO,
    E_COVARIANCE,
    E_FIELD,
    E_FIX,
    E_POSITION,
    E_PUSH,
    E_RATE,
    E_STATES,
    E_VELOCITY,
    GRAVITY,
    I_HEADING,
    I_NOISY,
    STATES,
    SUBSTEP,
)
from volery.simulation.world.arithmetic import FIRMWARE_STREAM, gaussian
from volery.simulation.world.state_layout import Array

AHEAD: Final = 0.08
"""Time by which EKF2's state is older than a fix of SIH's receiver, which has no delay [s]. For the 110 ms of
EKF2_GPS_DELAY in steps of EKF2_PREDICT_US (10 ms) EKF2 keeps 11 steps, which are ``EKF_STEP`` long in SIH."""

FIX_PERIOD, FIELD_PERIOD = 0.125, 1.0 / 15.0
"""Time between two fixes of PX4's simulated receiver; between two readings of the magnetometer,
SENS_MAG_RATE [s]."""

PLACE, SPEED, TILT, TURN, BIAS, YAW, SPIN = 0, 2, 4, 6, 8, 10, 11
HEIGHT, CLIMB, WEIGHT = 12, 13, 14
"""Numbers of the states: position and velocity [m, m/s], the acceleration that a wrong tilt appears as
[m/s^2], north and east; its rate by a wrong bias of the gyroscope [m/s^3], a wrong bias of the accelerometer
[m/s^2], forward and right; heading [rad] and its rate by a wrong bias [rad/s]; position and velocity down
[m, m/s], a wrong bias of the accelerometer there [m/s^2]."""

EKF_STEP: Final = 0.008
"""Step of EKF2 [s]: two samples of SIH."""

ACCEL_GROWTH: Final = 0.35 * 0.35 * EKF_STEP
TILT_GROWTH: Final = (GRAVITY * 0.015) * (GRAVITY * 0.015) * EKF_STEP
TURN_GROWTH: Final = (GRAVITY * 0.001) * (GRAVITY * 0.001) * EKF_STEP
BIAS_GROWTH: Final = 0.003 * 0.003 * EKF_STEP
YAW_GROWTH: Final = 0.015 * 0.015 * EKF_STEP
SPIN_GROWTH: Final = 0.001 * 0.001 * EKF_STEP
"""Growth of the variances in a second: EKF2_ACC_NOISE, EKF2_GYR_NOISE, EKF2_GYR_B_NOISE, EKF2_ACC_B_NOISE in
steps of ``EKF_STEP``."""

LEAST_BIAS: Final = 5e-8 / (EKF_STEP * EKF_STEP)
"""Variance of a bias of the accelerometer below which EKF2 lets none fall [m^2/s^4]."""

FIX_SPEED_VARIANCE, FIX_PLACE_VARIANCE, YAW_VARIANCE = 0.25, 0.81, 0.09
FIX_CLIMB_VARIANCE, FIX_HEIGHT_VARIANCE, BARO_VARIANCE = 0.5625, 3.1684, 12.25
"""What the receiver states of itself; EKF2_HEAD_NOISE, EKF2_BARO_NOISE."""

BARO_BIAS_SHARE: Final = 0.0095
"""Share of the barometer's innovation that EKF2 takes for its bias (0.13 m/s over the root of 1 Hz)."""

FIRST = (0.25, 0.25, 0.25, 0.25, 0.96, 0.96, 0.96, 0.96, 0.04, 0.04, 0.09, 0.01, 1.0, 0.25, 0.04)
"""Variances with which the filter starts: of the tilt EKF2_ANGERR_INIT (0.1 rad), of biases EKF2_GBIAS_INIT
(0.1 rad/s) and EKF2_ABIAS_INIT (0.2 m/s^2). What a bias of the accelerometer is and what a tilt, it learns
when the nose turns."""

SLANT_EAST, SLANT_NORTH = 0.289, -0.036
"""Error of the heading by that of the tilt, as an acceleration to the east and to the north [rad s^2/m]: the
field where it was recorded is 0.179, 0.023, 0.514 gauss north, east, down."""

PREDICTOR_LAG: Final = 0.25
"""EKF2_TAU_VEL, EKF2_TAU_POS [s]."""

IMU_PERIOD: Final = 0.004
"""Time between two samples of SIH's gyroscope and accelerometer, IMU_INTEG_RATE [s]."""

ROLL_NOISE, PITCH_NOISE, YAW_NOISE = 0.14, 0.07, 0.03
ACCEL_NOISE = (0.5, 1.7, 1.4)
"""Deviation of a sample of SIH's gyroscope [rad/s], of its accelerometer forward, right, down [m/s^2]; from
``Sih::reconstruct_sensors_signals`` of PX4 1.14."""

FIX_VELOCITY_NOISE = (0.06, 0.077, 0.158)
FIX_POSITION_NOISE = (0.2, 0.2, 0.5)
"""Deviation of a fix of PX4's simulated receiver, north, east, down [m/s, m]; from ``SensorGpsSim::Run``."""

FIELD_NOISE, BARO_NOISE = 0.061, 0.09
"""Deviation of the heading of a reading of PX4's simulated magnetometer [rad]: 0.02 gauss, 3.3 samples; of
its barometer [m]: 1 Pa."""

WALK: Final = sqrt(IMU_PERIOD * SUBSTEP)
"""Deviation of the integral of white samples over a step, over that of a sample [s]."""


@numeric
def start_errors(row: Array) -> None:
    """Start with variances to which the filter settles, and without errors."""
    for number in range(STATES):
        row[E_COVARIANCE + number * STATES + number] = FIRST[number]


@numeric
def _noise(row: Array, key: np.uint64, stream: int, step: int) -> float:
    """Return a draw of zero mean and unit variance, or 0 without SIH's noise."""
    return gaussian(key, FIRMWARE_STREAM + stream, step) if row[I_NOISY] > 0.0 else 0.0


@numeric
def step_errors(row: Array, key: np.uint64, step: int) -> None:
    """Advance the errors of all states by one step."""
    along = WALK * ACCEL_NOISE[0] * _noise(row, key, 0, step)
    across = WALK * ACCEL_NOISE[1] * _noise(row, key, 1, step)
    down = WALK * ACCEL_NOISE[2] * _noise(row, key, 2, step)
    pitch = GRAVITY * PITCH_NOISE * WALK * _noise(row, key, 3, step)
    roll = GRAVITY * ROLL_NOISE * WALK * _noise(row, key, 4, step)
    yaw = YAW_NOISE * WALK * _noise(row, key, 12, step)
    s, c = sine_cosine(row[I_HEADING])
    kick_north, kick_east = c * along - s * across, s * along + c * across
    north, east, upright = _accel_errors(row, s, c)
    _advance_states(row, s, c, (north, east, upright))
    row[E_STATES + SPEED] += kick_north
    row[E_STATES + SPEED + 1] += kick_east
    row[E_STATES + TILT] += c * pitch - s * roll
    row[E_STATES + TILT + 1] += s * pitch + c * roll
    row[E_STATES + YAW] += yaw
    row[E_STATES + CLIMB] += down
    _advance_covariance(row, s, c)
    row[E_FIX] += SUBSTEP
    if row[E_FIX] >= FIX_PERIOD:
        row[E_FIX] -= FIX_PERIOD
        _use_fix(row, key, step)
    row[E_FIELD] += SUBSTEP
    if row[E_FIELD] >= FIELD_PERIOD:
        row[E_FIELD] -= FIELD_PERIOD
        _use_field_and_baro(row, key, step)
    row[E_PUSH] = row[E_STATES + TILT] - row[E_STATES + YAW] * row[A_THRUST + 1]
    row[E_PUSH + 1] = row[E_STATES + TILT + 1] + row[E_STATES + YAW] * row[A_THRUST]
    lift = row[A_THRUST] * row[E_STATES + TILT] + row[A_THRUST + 1] * row[E_STATES + TILT + 1]
    row[E_PUSH + 2] = lift / GRAVITY
    _predict(row, 0, north, kick_north, row[E_STATES + PLACE], row[E_STATES + SPEED])
    _predict(row, 1, east, kick_east, row[E_STATES + PLACE + 1], row[E_STATES + SPEED + 1])
    _predict(row, 2, upright, down, row[E_STATES + HEIGHT], row[E_STATES + CLIMB])


@numeric
def _accel_errors(row: Array, s: float, c: float) -> tuple[float, float, float]:
    """Return the error of the acceleration that EKF2 sees, north, east, down [m/s^2].

    A wrong attitude turns the measured specific force, which is the acceleration less gravity; a wrong bias
    is fixed to the body, which leans as the thrust does.
    """
    ahead, aside, yaw = row[E_STATES + BIAS], row[E_STATES + BIAS + 1], row[E_STATES + YAW]
    lean_north, lean_east = row[A_THRUST] / GRAVITY, row[A_THRUST + 1] / GRAVITY
    weight = row[E_STATES + WEIGHT]
    bias_north, bias_east = c * ahead - s * aside, s * ahead + c * aside
    tilt_north, tilt_east = row[E_STATES + TILT], row[E_STATES + TILT + 1]
    down = weight + lean_north * bias_north + lean_east * bias_east
    down += (row[A_ACCEL] * tilt_north + row[A_ACCEL + 1] * tilt_east) / GRAVITY
    north = tilt_north + bias_north - weight * lean_north - yaw * row[A_ACCEL + 1]
    east = tilt_east + bias_east - weight * lean_east + yaw * row[A_ACCEL]
    return north, east, down


@numeric
def _advance_states(row: Array, s: float, c: float, accel: tuple[float, float, float]) -> None:
    """Advance the errors under errors of the acceleration, north, east, down."""
    ahead, aside = row[E_STATES + TURN], row[E_STATES + TURN + 1]
    row[E_STATES + PLACE] += SUBSTEP * row[E_STATES + SPEED]
    row[E_STATES + PLACE + 1] += SUBSTEP * row[E_STATES + SPEED + 1]
    row[E_STATES + SPEED] += SUBSTEP * accel[0]
    row[E_STATES + SPEED + 1] += SUBSTEP * accel[1]
    row[E_STATES + TILT] += SUBSTEP * (c * ahead - s * aside)
    row[E_STATES + TILT + 1] += SUBSTEP * (s * ahead + c * aside)
    row[E_STATES + YAW] += SUBSTEP * row[E_STATES + SPIN]
    row[E_STATES + HEIGHT] += SUBSTEP * row[E_STATES + CLIMB]
    row[E_STATES + CLIMB] += SUBSTEP * accel[2]


@numeric
def _advance_covariance(row: Array, s: float, c: float) -> None:
    """Advance the covariance of the states, first by rows, then by columns."""
    lean_north, lean_east = row[A_THRUST] / GRAVITY, row[A_THRUST + 1] / GRAVITY
    push_north, push_east = row[A_ACCEL], row[A_ACCEL + 1]
    for along, across in ((STATES, 1), (1, STATES)):
        for other in range(STATES):
            at = E_COVARIANCE + other * across
            ahead, aside = row[at + BIAS * along], row[at + (BIAS + 1) * along]
            turn, turn_aside = row[at + TURN * along], row[at + (TURN + 1) * along]
            yaw, weight = row[at + YAW * along], row[at + WEIGHT * along]
            bias_north, bias_east = c * ahead - s * aside, s * ahead + c * aside
            north, east = row[at + TILT * along], row[at + (TILT + 1) * along]
            down = weight + lean_north * bias_north + lean_east * bias_east
            down += (push_north * north + push_east * east) / GRAVITY
            north += bias_north - weight * lean_north - yaw * push_east
            east += bias_east - weight * lean_east + yaw * push_north
            row[at + PLACE * along] += SUBSTEP * row[at + SPEED * along]
            row[at + (PLACE + 1) * along] += SUBSTEP * row[at + (SPEED + 1) * along]
            row[at + HEIGHT * along] += SUBSTEP * row[at + CLIMB * along]
            row[at + CLIMB * along] += SUBSTEP * down
            row[at + SPEED * along] += SUBSTEP * north
            row[at + (SPEED + 1) * along] += SUBSTEP * east
            row[at + TILT * along] += SUBSTEP * (c * turn - s * turn_aside)
            row[at + (TILT + 1) * along] += SUBSTEP * (s * turn + c * turn_aside)
            row[at + YAW * along] += SUBSTEP * row[at + SPIN * along]
    for axis in range(2):
        _grow(row, SPEED + axis, ACCEL_GROWTH)
        _grow(row, TILT + axis, TILT_GROWTH)
        _grow(row, TURN + axis, TURN_GROWTH)
        _grow(row, BIAS + axis, BIAS_GROWTH)
    _grow(row, YAW, YAW_GROWTH)
    _grow(row, SPIN, SPIN_GROWTH)
    _grow(row, CLIMB, ACCEL_GROWTH)
    _grow(row, WEIGHT, BIAS_GROWTH)
    largest = max(row[_at(BIAS)], row[_at(BIAS + 1)], row[_at(WEIGHT)])
    least = max(LEAST_BIAS, 0.01 * largest)
    for number in (BIAS, BIAS + 1, WEIGHT):
        row[_at(number)] = max(row[_at(number)], least)


@numeric
def _at(number: int) -> int:
    """Return the column of the variance of a state."""
    return E_COVARIANCE + number * (STATES + 1)


@numeric
def _grow(row: Array, number: int, rate: float) -> None:
    row[_at(number)] += SUBSTEP * rate


@numeric
def _correct(row: Array, measured: int, innovation: float, variance: float) -> None:
    """Correct the states by the innovation of one of them, and their covariance."""
    first = E_COVARIANCE + measured * STATES
    total = row[first + measured] + variance
    for number in range(STATES):
        row[E_STATES + number] += row[first + number] / total * innovation
    for number in range(STATES):
        if number != measured:
            gain = row[first + number] / total
            for other in range(STATES):
                row[E_COVARIANCE + number * STATES + other] -= gain * row[first + other]
    gain = row[first + measured] / total
    for other in range(STATES):
        row[first + other] -= gain * row[first + other]


@numeric
def _use_fix(row: Array, key: np.uint64, step: int) -> None:
    """Correct by a fix."""
    for axis in range(2):
        speed = AHEAD * row[A_ACCEL + axis]
        speed += FIX_VELOCITY_NOISE[axis] * _noise(row, key, 5 + axis, step)
        _correct(row, SPEED + axis, speed - row[E_STATES + SPEED + axis], FIX_SPEED_VARIANCE)
    for axis in range(2):
        place = AHEAD * row[A_FLOWN + axis]
        place += FIX_POSITION_NOISE[axis] * _noise(row, key, 8 + axis, step)
        _correct(row, PLACE + axis, place - row[E_STATES + PLACE + axis], FIX_PLACE_VARIANCE)
    climb = AHEAD * row[A_ACCEL + 2] + FIX_VELOCITY_NOISE[2] * _noise(row, key, 7, step)
    _correct(row, CLIMB, climb - row[E_STATES + CLIMB], FIX_CLIMB_VARIANCE)
    height = AHEAD * row[A_FLOWN + 2] + FIX_POSITION_NOISE[2] * _noise(row, key, 10, step)
    _correct(row, HEIGHT, height - row[E_STATES + HEIGHT], FIX_HEIGHT_VARIANCE)


@numeric
def _use_field_and_baro(row: Array, key: np.uint64, step: int) -> None:
    """Correct by the heading of the magnetometer and by the barometer."""
    heading = SLANT_NORTH * row[E_STATES + TILT] + SLANT_EAST * row[E_STATES + TILT + 1]
    heading += FIELD_NOISE * _noise(row, key, 13, step)
    _correct(row, YAW, heading - row[E_STATES + YAW], YAW_VARIANCE)
    height = BARO_NOISE * _noise(row, key, 14, step) - row[E_STATES + HEIGHT]
    innovation = height - row[E_BARO]
    row[E_BARO] += BARO_BIAS_SHARE * innovation
    _correct(row, HEIGHT, innovation, BARO_VARIANCE)


@numeric
def _predict(row: Array, axis: int, accel: float, kick: float, place: float, speed: float) -> None:
    """Pass the error of one axis on to what EKF2 states."""
    row[E_VELOCITY + axis] += SUBSTEP * (accel + (speed - row[E_VELOCITY + axis]) / PREDICTOR_LAG) + kick
    rate = row[E_VELOCITY + axis] + (place - row[E_POSITION + axis]) / PREDICTOR_LAG
    row[E_RATE + axis] = rate
    row[E_POSITION + axis] += SUBSTEP * rate

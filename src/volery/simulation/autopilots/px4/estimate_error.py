"""Error of EKF2's estimate: a wrong delay of the receiver, and the noise of SIH's sensors.

EKF2 takes a fix to be EKF2_GPS_DELAY old and corrects its oldest state with it. The receiver of SIH has no
such delay: the estimated position is ahead of the aircraft. SIH's gyroscope and accelerometer are far
noisier than EKF2_GYR_NOISE and EKF2_ACC_NOISE say, so the filter corrects too little, and its velocity, tilt,
heading and biases wander. The attitude loops hold the estimated tilt and heading, so what is wrong with them
pushes the aircraft the other way.

The error moves like EKF2's own states, and is corrected by fixes, by the magnetometer (``field_fusion``) and
by the barometer with gains from their covariance, which is advanced as well: a wrong bias of the
accelerometer looks like a tilt until the nose turns; a wrong heading counts as much as the aircraft
accelerates, and so does a wrong tilt along the vertical, because the accelerometer measures the drag, too.
Noise about the forward axis turns the heading of an aircraft that leans. The output predictor passes the
errors on with a lag.
"""

from __future__ import annotations

from math import sqrt
from typing import Final

import numpy as np

from volery.base.numeric_code import numeric
from volery.simulation.autopilots.px4.error_states import (
    BIAS,
    CLIMB,
    EKF_STEP,
    FIELD,
    HEIGHT,
    PLACE,
    SPEED,
    SPIN,
    TILT,
    TURN,
    WEIGHT,
    YAW,
    correct,
    grow,
    make_symmetric,
    used_states,
    variance_at,
)
from volery.simulation.autopilots.px4.field_fusion import FIELD_PERIOD, use_field, watch_motion
from volery.simulation.autopilots.px4.heading_loop import write_axes
from volery.simulation.autopilots.px4.loop_state import (
    A_ACCEL,
    A_AXES,
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
    I_NOISY,
    STATES,
    SUBSTEP,
)
from volery.simulation.world.arithmetic import FIRMWARE_STREAM, gaussian
from volery.simulation.world.state_layout import Array

AHEAD: Final = 0.08
"""Time by which EKF2's state is older than a fix of SIH's receiver, which has no delay [s]. For the 110 ms of
EKF2_GPS_DELAY in steps of EKF2_PREDICT_US (10 ms) EKF2 keeps 11 steps, which are ``EKF_STEP`` long in SIH."""

FIX_PERIOD: Final = 0.125
"""Time between two fixes of PX4's simulated receiver [s]."""

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

FIX_SPEED_VARIANCE, FIX_PLACE_VARIANCE = 0.25, 0.81
FIX_CLIMB_VARIANCE, FIX_HEIGHT_VARIANCE, BARO_VARIANCE = 0.5625, 3.1684, 12.25
"""What the receiver states of itself; EKF2_BARO_NOISE."""

BARO_BIAS_SHARE: Final = 0.0095
"""Share of the barometer's innovation that EKF2 takes for its bias (0.13 m/s over the root of 1 Hz)."""

FIRST_DEVIATIONS = (
    *(0.9, 0.9, 0.5, 0.5, GRAVITY * 0.0356, GRAVITY * 0.0356, GRAVITY * 0.0114, GRAVITY * 0.0114),
    *(0.25, 0.25, 0.0942, 0.00622, 0.603, 0.75, 0.202),
)
"""Deviations of the states when EKF2 has aligned its heading and begins with fixes, as it logs them; mean of
51 starts. What a bias of the accelerometer is and what a tilt, it learns when the nose turns."""

EVEN_EVERY: Final = 30_000
"""Substeps after which the covariance is made symmetric: ten minutes, in which its halves come to differ by
less than 1e-6."""

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

BARO_NOISE: Final = 0.09
"""Deviation of a reading of PX4's simulated barometer [m]: 1 Pa."""

WALK: Final = sqrt(IMU_PERIOD * SUBSTEP)
"""Deviation of the integral of white samples over a step, over that of a sample [s]."""


@numeric
def start_errors(row: Array) -> None:
    """Start with the variances of a filter that has aligned its heading, and without errors."""
    for number in range(FIELD):
        row[variance_at(number)] = FIRST_DEVIATIONS[number] * FIRST_DEVIATIONS[number]


@numeric
def _noise(row: Array, key: np.uint64, stream: int, step: int) -> float:
    """Return a draw of zero mean and unit variance, or 0 without SIH's noise."""
    return gaussian(key, FIRMWARE_STREAM + stream, step) if row[I_NOISY] > 0.0 else 0.0


@numeric
def step_errors(row: Array, key: np.uint64, step: int) -> None:
    """Advance the errors of all states by one step."""
    write_axes(row)
    kick = _to_earth(
        row,
        WALK * ACCEL_NOISE[0] * _noise(row, key, 0, step),
        WALK * ACCEL_NOISE[1] * _noise(row, key, 1, step),
        WALK * ACCEL_NOISE[2] * _noise(row, key, 2, step),
    )
    tilted = _turned(
        row,
        GRAVITY * PITCH_NOISE * WALK * _noise(row, key, 3, step),
        GRAVITY * ROLL_NOISE * WALK * _noise(row, key, 4, step),
        YAW_NOISE * WALK * _noise(row, key, 12, step),
    )
    if step % EVEN_EVERY == 0:
        make_symmetric(row)
    accel = _accel_errors(row)
    _advance_states(row, accel)
    for axis in range(2):
        row[E_STATES + SPEED + axis] += kick[axis]
        row[E_STATES + TILT + axis] += tilted[axis]
    row[E_STATES + YAW] += tilted[2]
    row[E_STATES + CLIMB] += kick[2]
    _advance_covariance(row)
    watch_motion(
        row,
        row[A_ACCEL] + accel[0] + kick[0] / SUBSTEP,
        row[A_ACCEL + 1] + accel[1] + kick[1] / SUBSTEP,
    )
    row[E_FIX] += SUBSTEP
    if row[E_FIX] >= FIX_PERIOD:
        row[E_FIX] -= FIX_PERIOD
        _use_fix(row, key, step)
    row[E_FIELD] += SUBSTEP
    if row[E_FIELD] >= FIELD_PERIOD:
        row[E_FIELD] -= FIELD_PERIOD
        draws = _noise(row, key, 13, step), _noise(row, key, 15, step), _noise(row, key, 16, step)
        use_field(row, draws)
        _use_baro(row, key, step)
    row[E_PUSH] = row[E_STATES + TILT] - row[E_STATES + YAW] * row[A_THRUST + 1]
    row[E_PUSH + 1] = row[E_STATES + TILT + 1] + row[E_STATES + YAW] * row[A_THRUST]
    lift = row[A_THRUST] * row[E_STATES + TILT] + row[A_THRUST + 1] * row[E_STATES + TILT + 1]
    row[E_PUSH + 2] = lift / GRAVITY
    _predict(row, 0, accel[0], kick[0], row[E_STATES + PLACE], row[E_STATES + SPEED])
    _predict(row, 1, accel[1], kick[1], row[E_STATES + PLACE + 1], row[E_STATES + SPEED + 1])
    _predict(row, 2, accel[2], kick[2], row[E_STATES + HEIGHT], row[E_STATES + CLIMB])


@numeric
def _to_earth(row: Array, ahead: float, aside: float, below: float) -> tuple[float, float, float]:
    """Return a vector of the body's axes, north, east, down."""
    return (
        row[A_AXES] * ahead + row[A_AXES + 1] * aside + row[A_AXES + 2] * below,
        row[A_AXES + 3] * ahead + row[A_AXES + 4] * aside + row[A_AXES + 5] * below,
        row[A_AXES + 6] * ahead + row[A_AXES + 7] * aside + row[A_AXES + 8] * below,
    )


@numeric
def _turned(row: Array, ahead: float, aside: float, yaw: float) -> tuple[float, float, float]:
    """Return a turn about the body's axes as turn of the tilt, north and east, and of the heading.

    The heading turns with the forward axis, too, while the aircraft leans.

    Args:
        row: The state.
        ahead: The acceleration forward that the turn of the tilt appears as [m/s^2].
        aside: Likewise to the right.
        yaw: Turn about the axis down [rad].
    """
    return (
        row[A_AXES + 4] * ahead - row[A_AXES + 3] * aside - GRAVITY * row[A_AXES + 5] * yaw,
        row[A_AXES] * aside - row[A_AXES + 1] * ahead + GRAVITY * row[A_AXES + 2] * yaw,
        (row[A_AXES + 6] * aside - row[A_AXES + 7] * ahead) / GRAVITY + row[A_AXES + 8] * yaw,
    )


@numeric
def _accel_errors(row: Array) -> tuple[float, float, float]:
    """Return the error of the acceleration that EKF2 sees, north, east, down [m/s^2].

    A wrong attitude turns the measured specific force, which is the acceleration less gravity; a wrong bias
    is fixed to the body, which leans as the thrust does.
    """
    bias = _to_earth(row, row[E_STATES + BIAS], row[E_STATES + BIAS + 1], row[E_STATES + WEIGHT])
    yaw, north, east = row[E_STATES + YAW], row[E_STATES + TILT], row[E_STATES + TILT + 1]
    down = (row[A_ACCEL] * north + row[A_ACCEL + 1] * east) / GRAVITY
    return (
        north + bias[0] - yaw * row[A_ACCEL + 1],
        east + bias[1] + yaw * row[A_ACCEL],
        down + bias[2],
    )


@numeric
def _advance_states(row: Array, accel: tuple[float, float, float]) -> None:
    """Advance the errors under errors of the acceleration, north, east, down."""
    turn = _turned(row, row[E_STATES + TURN], row[E_STATES + TURN + 1], row[E_STATES + SPIN])
    for axis in range(2):
        row[E_STATES + PLACE + axis] += SUBSTEP * row[E_STATES + SPEED + axis]
        row[E_STATES + SPEED + axis] += SUBSTEP * accel[axis]
        row[E_STATES + TILT + axis] += SUBSTEP * turn[axis]
    row[E_STATES + YAW] += SUBSTEP * turn[2]
    row[E_STATES + HEIGHT] += SUBSTEP * row[E_STATES + CLIMB]
    row[E_STATES + CLIMB] += SUBSTEP * accel[2]


@numeric
def _advance_covariance(row: Array) -> None:
    """Advance the covariance of the states, first by rows, then by columns."""
    push_north, push_east = row[A_ACCEL], row[A_ACCEL + 1]
    states = used_states(row)
    for along, across in ((STATES, 1), (1, STATES)):
        for other in range(states):
            at = E_COVARIANCE + other * across
            yaw, north, east = (
                row[at + YAW * along],
                row[at + TILT * along],
                row[at + (TILT + 1) * along],
            )
            bias = _to_earth(
                row, row[at + BIAS * along], row[at + (BIAS + 1) * along], row[at + WEIGHT * along]
            )
            turn = _turned(row, row[at + TURN * along], row[at + (TURN + 1) * along], row[at + SPIN * along])
            row[at + PLACE * along] += SUBSTEP * row[at + SPEED * along]
            row[at + (PLACE + 1) * along] += SUBSTEP * row[at + (SPEED + 1) * along]
            row[at + HEIGHT * along] += SUBSTEP * row[at + CLIMB * along]
            down = (push_north * north + push_east * east) / GRAVITY
            row[at + CLIMB * along] += SUBSTEP * (down + bias[2])
            row[at + SPEED * along] += SUBSTEP * (north + bias[0] - yaw * push_east)
            row[at + (SPEED + 1) * along] += SUBSTEP * (east + bias[1] + yaw * push_north)
            row[at + TILT * along] += SUBSTEP * turn[0]
            row[at + (TILT + 1) * along] += SUBSTEP * turn[1]
            row[at + YAW * along] += SUBSTEP * turn[2]
    for axis in range(2):
        grow(row, SPEED + axis, ACCEL_GROWTH)
        grow(row, TILT + axis, TILT_GROWTH)
        grow(row, TURN + axis, TURN_GROWTH)
        grow(row, BIAS + axis, BIAS_GROWTH)
    grow(row, YAW, YAW_GROWTH)
    grow(row, SPIN, SPIN_GROWTH)
    grow(row, CLIMB, ACCEL_GROWTH)
    grow(row, WEIGHT, BIAS_GROWTH)
    largest = max(row[variance_at(BIAS)], row[variance_at(BIAS + 1)], row[variance_at(WEIGHT)])
    least = max(LEAST_BIAS, 0.01 * largest)
    for number in (BIAS, BIAS + 1, WEIGHT):
        row[variance_at(number)] = max(row[variance_at(number)], least)


@numeric
def _use_fix(row: Array, key: np.uint64, step: int) -> None:
    """Correct by a fix."""
    for axis in range(2):
        speed = AHEAD * row[A_ACCEL + axis]
        speed += FIX_VELOCITY_NOISE[axis] * _noise(row, key, 5 + axis, step)
        correct(row, SPEED + axis, speed - row[E_STATES + SPEED + axis], FIX_SPEED_VARIANCE)
    for axis in range(2):
        place = AHEAD * row[A_FLOWN + axis]
        place += FIX_POSITION_NOISE[axis] * _noise(row, key, 8 + axis, step)
        correct(row, PLACE + axis, place - row[E_STATES + PLACE + axis], FIX_PLACE_VARIANCE)
    climb = AHEAD * row[A_ACCEL + 2] + FIX_VELOCITY_NOISE[2] * _noise(row, key, 7, step)
    correct(row, CLIMB, climb - row[E_STATES + CLIMB], FIX_CLIMB_VARIANCE)
    height = AHEAD * row[A_FLOWN + 2] + FIX_POSITION_NOISE[2] * _noise(row, key, 10, step)
    correct(row, HEIGHT, height - row[E_STATES + HEIGHT], FIX_HEIGHT_VARIANCE)


@numeric
def _use_baro(row: Array, key: np.uint64, step: int) -> None:
    """Correct by the barometer."""
    height = BARO_NOISE * _noise(row, key, 14, step) - row[E_STATES + HEIGHT]
    innovation = height - row[E_BARO]
    row[E_BARO] += BARO_BIAS_SHARE * innovation
    correct(row, HEIGHT, innovation, BARO_VARIANCE)


@numeric
def _predict(row: Array, axis: int, accel: float, kick: float, place: float, speed: float) -> None:
    """Pass the error of one axis on to what EKF2 states."""
    row[E_VELOCITY + axis] += SUBSTEP * (accel + (speed - row[E_VELOCITY + axis]) / PREDICTOR_LAG) + kick
    rate = row[E_VELOCITY + axis] + (place - row[E_POSITION + axis]) / PREDICTOR_LAG
    row[E_RATE + axis] = rate
    row[E_POSITION + axis] += SUBSTEP * rate

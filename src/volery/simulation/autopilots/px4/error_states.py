"""States of EKF2 whose errors matter, and their covariance in the row of the loops."""

from __future__ import annotations

from typing import Final

from volery.base.numeric_code import numeric
from volery.simulation.autopilots.px4.loop_state import (
    E_COVARIANCE,
    E_FUSES_FIELD,
    E_PRODUCT,
    E_STATES,
    STATES,
    SUBSTEP,
)
from volery.simulation.world.state_layout import Array

PLACE, SPEED, TILT, TURN, BIAS, YAW, SPIN = 0, 2, 4, 6, 8, 10, 11
HEIGHT, CLIMB, WEIGHT = 12, 13, 14
"""Numbers of the states: position and velocity [m, m/s], the acceleration that a wrong tilt appears as
[m/s^2], north and east; its rate by a wrong bias of the gyroscope [m/s^3], a wrong bias of the accelerometer
[m/s^2], forward and right; heading [rad] and its rate by a wrong bias [rad/s]; position and velocity down
[m, m/s], a wrong bias of the accelerometer there [m/s^2]."""

FIELD, IRON = 15, 18
"""Earth's field, north, east, down; bias of the magnetometer, forward, right, down [gauss]. Without fusion of
the three axes EKF2 holds both, and their covariance is 0."""

EKF_STEP: Final = 0.008
"""Step of EKF2 [s]: two samples of SIH."""


@numeric
def used_states(row: Array) -> int:
    """Return the number of states that are corrected."""
    return STATES if row[E_FUSES_FIELD] > 0.0 else FIELD


@numeric
def variance_at(number: int) -> int:
    """Return the column of the variance of a state."""
    return E_COVARIANCE + number * (STATES + 1)


@numeric
def grow(row: Array, number: int, rate: float) -> None:
    """Let a variance grow by a substep."""
    row[variance_at(number)] += SUBSTEP * rate


@numeric
def correct(row: Array, measured: int, innovation: float, variance: float) -> None:
    """Correct the states by the innovation of one of them, and their covariance."""
    first = E_COVARIANCE + measured * STATES
    for number in range(used_states(row)):
        row[E_PRODUCT + number] = row[first + number]
    correct_from(row, 0, innovation, row[first + measured] + variance)


@numeric
def correct_from(row: Array, first: int, innovation: float, variance: float) -> None:
    """Correct the states from number *first* on, and their covariance.

    Args:
        row: The state; ``E_PRODUCT`` is the covariance times the transposed row of the measurement.
        first: Number of the first state that is corrected.
        innovation: The measurement less what was expected.
        variance: Variance of the innovation.
    """
    states = used_states(row)
    for number in range(first, states):
        gain = row[E_PRODUCT + number] / variance
        row[E_STATES + number] += gain * innovation
        at = E_COVARIANCE + number * STATES
        for other in range(first, states):
            row[at + other] -= gain * row[E_PRODUCT + other]


@numeric
def make_symmetric(row: Array) -> None:
    """Set both halves of the covariance to their mean.

    Rounding lets them differ, and ``correct`` subtracts the same from both. The difference grows with about
    the sixth power of the time, and the gains diverge after an hour and a half.
    """
    for number in range(1, STATES):
        for other in range(number):
            at, mirrored = E_COVARIANCE + number * STATES + other, E_COVARIANCE + other * STATES + number
            row[at] = row[mirrored] = 0.5 * (row[at] + row[mirrored])

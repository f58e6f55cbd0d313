"""How EKF2 corrects by the magnetometer: as a heading, or in three axes with states of the field and a bias.

As in PX4 1.14 (``mag_control.cpp``, ``mag_fusion.cpp``) with EKF2_MAG_TYPE 0: in flight the heading is set
anew 1.5 m above the ground. From then on three axes are fused while the aircraft turns or accelerates and for
2 s after it; else the heading alone, with the declination and the bias that were learnt last. Until the
variances of the bias are small, the three axes correct only field and bias. What the filter takes for a bias
while its heading or tilt is wrong stays a wrong heading, which turns with the nose.
"""

from __future__ import annotations

from math import sqrt
from typing import Final

from volery.base.numeric_code import numeric
from volery.simulation.autopilots.px4.error_states import (
    EKF_STEP,
    FIELD,
    IRON,
    TILT,
    YAW,
    correct,
    correct_from,
    grow,
    variance_at,
)
from volery.simulation.autopilots.px4.loop_state import (
    A_AXES,
    A_GROUNDED,
    A_POSITION,
    A_THRUST,
    A_TURN,
    E_ACCEL,
    E_ACCELERATES,
    E_ALIGNED,
    E_COVARIANCE,
    E_FILTERED,
    E_FUSES_FIELD,
    E_GROUND,
    E_KEPT,
    E_KNOWS_DECLINATION,
    E_PRODUCT,
    E_SEEN,
    E_STATES,
    E_STEADY_FOR,
    E_TURN,
    E_TURNED,
    E_TURNS,
    GRAVITY,
    I_TASK,
    REST,
    STATES,
    SUBSTEP,
)
from volery.simulation.world.state_layout import Array

FIELD_PERIOD: Final = 1.0 / 15.0
"""Time between two readings of the magnetometer, SENS_MAG_RATE [s]."""

NORTH, EAST, DOWN = 0.179, 0.023, 0.514
"""Earth's field where it was recorded [gauss]."""

LEVEL_SQUARED: Final = NORTH * NORTH + EAST * EAST

LEVEL_NOISE: Final = 0.02 / sqrt(3.3)
DOWN_NOISE: Final = 0.03 / sqrt(3.3)
"""Deviation of a reading of PX4's simulated magnetometer, in the plane and down [gauss]: the mean of 3.3
samples of ``SensorMagSim``."""

YAW_VARIANCE: Final = 0.09
FIELD_VARIANCE: Final = 0.0025
"""EKF2_HEAD_NOISE, EKF2_MAG_NOISE, squared [rad^2, gauss^2]."""

FIELD_GROWTH: Final = 1e-3 * 1e-3 * EKF_STEP
IRON_GROWTH: Final = 1e-4 * 1e-4 * EKF_STEP
"""Growth of the variances in a second: EKF2_MAG_E_NOISE, EKF2_MAG_B_NOISE."""

FIRST_DECLINATION, DECLINATION = 0.0004, 0.25
"""Variances of the declination that is fused with the three axes [rad^2]: at first, and with each reading."""

KNOWN_BIAS: Final = 0.0004
"""Variance of the bias below which the three axes correct all states [gauss^2]."""

RESET_VARIANCE: Final = 0.01
"""What a reset adds to the variance of the heading [rad^2]."""

ALIGNED_ABOVE: Final = 1.5
"""Height above ground of the reset of the heading [m]."""

ACCELERATES, TURNS = 0.5, 0.2
"""EKF2_MAG_ACCLIM, EKF2_MAG_YAWLIM [m/s^2, rad/s]: from twice this acceleration, or this rate, on the three
axes are fused, down to this acceleration and half the rate."""

STEADY_AFTER: Final = 2.0
"""Time without either after which the heading alone is fused [s]."""

ACCEL_LAG: Final = 1.0
TURN_SHARE: Final = 0.12
"""Time constant of the filtered acceleration [s]; share of a new rate in the filtered one in a substep: 0.05
in a step of EKF2."""

FILTER_SHARE: Final = 0.1
"""Share of a reading in the filtered field that the heading is set from."""


@numeric
def watch_motion(row: Array, accel_north: float, accel_east: float) -> None:
    """Filter what EKF2 sees of acceleration [m/s^2] and turn rate, and note where the ground is.

    On the ground the declination is that of the map.
    """
    row[E_ACCEL] += SUBSTEP / ACCEL_LAG * (accel_north - row[E_ACCEL])
    row[E_ACCEL + 1] += SUBSTEP / ACCEL_LAG * (accel_east - row[E_ACCEL + 1])
    turn = 0.0 if row[I_TASK] == REST else row[A_TURN]
    row[E_TURN] += TURN_SHARE * (turn - row[E_TURN])
    row[E_TURNED] += SUBSTEP * turn
    if row[I_TASK] == REST or row[A_GROUNDED] > 0.0:
        row[E_GROUND], row[E_ALIGNED] = row[A_POSITION + 2], 0.0
        for axis in range(3):
            row[E_STATES + FIELD + axis] = 0.0
    if row[E_FUSES_FIELD] > 0.0:
        for axis in range(3):
            grow(row, FIELD + axis, FIELD_GROWTH)
            grow(row, IRON + axis, IRON_GROWTH)


@numeric
def use_field(row: Array, noise: tuple[float, float, float]) -> None:
    """Correct by a reading of the magnetometer.

    Args:
        row: The state.
        noise: Draws of the noise, north, east, down, of unit variance.
    """
    north, east, down = LEVEL_NOISE * noise[0], LEVEL_NOISE * noise[1], DOWN_NOISE * noise[2]
    _filter(row, north, east, down)
    _choose(row)
    if row[E_ALIGNED] == 0.0 and row[E_GROUND] - row[A_POSITION + 2] > ALIGNED_ABOVE:
        _align(row)
    if row[E_FUSES_FIELD] == 0.0:
        north, east = _expected(row, 0) - north, _expected(row, 1) - east
        correct(row, YAW, (NORTH * east - EAST * north) / LEVEL_SQUARED, YAW_VARIANCE)
        return
    bias = max(row[variance_at(IRON)], row[variance_at(IRON + 1)], row[variance_at(IRON + 2)])
    first = 0 if bias < KNOWN_BIAS else FIELD
    if row[E_KNOWS_DECLINATION] == 0.0:
        row[E_KNOWS_DECLINATION] = 1.0
        _use_declination(row, FIRST_DECLINATION)
    _use_seen(row, north - _expected(row, 0), FIELD_VARIANCE, first)
    _use_seen(row, east - _expected(row, 1), FIELD_VARIANCE, first)
    _use_seen(row, down - _expected(row, 2), FIELD_VARIANCE, first)
    _use_declination(row, DECLINATION)


@numeric
def _expected(row: Array, axis: int) -> float:
    """Return how much too large the expected field is along an axis, north, east, down [gauss].

    Leave what each state adds to it in ``E_SEEN``: a wrong attitude turns Earth's field, and the bias is
    fixed to the body.
    """
    for number in range(STATES):
        row[E_SEEN + number] = 0.0
    row[E_SEEN + FIELD + axis] = 1.0
    for number in range(3):
        row[E_SEEN + IRON + number] = row[A_AXES + 3 * axis + number]
    if axis == 0:
        row[E_SEEN + TILT], row[E_SEEN + YAW] = DOWN / GRAVITY, EAST
    elif axis == 1:
        row[E_SEEN + TILT + 1], row[E_SEEN + YAW] = DOWN / GRAVITY, -NORTH
    else:
        row[E_SEEN + TILT], row[E_SEEN + TILT + 1] = -NORTH / GRAVITY, -EAST / GRAVITY
    expected = 0.0
    for number in range(STATES):
        expected += row[E_SEEN + number] * row[E_STATES + number]
    return expected


@numeric
def _use_seen(row: Array, innovation: float, variance: float, first: int) -> None:
    """Correct the states from *first* on by a measurement of what ``E_SEEN`` holds."""
    total = variance
    for number in range(STATES):
        product, at = 0.0, E_COVARIANCE + number * STATES
        for other in range(STATES):
            product += row[at + other] * row[E_SEEN + other]
        row[E_PRODUCT + number] = product
        total += row[E_SEEN + number] * product
    correct_from(row, first, innovation, total)


@numeric
def _use_declination(row: Array, variance: float) -> None:
    """Measure the declination of the field by itself: the filter keeps it, and is surer of it."""
    for number in range(STATES):
        row[E_SEEN + number] = 0.0
    row[E_SEEN + FIELD] = -EAST / LEVEL_SQUARED
    row[E_SEEN + FIELD + 1] = NORTH / LEVEL_SQUARED
    _use_seen(row, 0.0, variance, 0)


@numeric
def _filter(row: Array, north: float, east: float, down: float) -> None:
    """Filter a reading: the noise, and how the field is turned to an aircraft that leans [gauss]."""
    lean_north, lean_east = row[A_THRUST] / GRAVITY, row[A_THRUST + 1] / GRAVITY
    row[E_FILTERED] += FILTER_SHARE * (north + lean_north * DOWN - row[E_FILTERED])
    row[E_FILTERED + 1] += FILTER_SHARE * (east + lean_east * DOWN - row[E_FILTERED + 1])
    turned = -lean_north * NORTH - lean_east * EAST
    row[E_FILTERED + 2] += FILTER_SHARE * (down + turned - row[E_FILTERED + 2])


@numeric
def _choose(row: Array) -> None:
    """Choose whether the three axes are fused."""
    accel = sqrt(row[E_ACCEL] * row[E_ACCEL] + row[E_ACCEL + 1] * row[E_ACCEL + 1])
    row[E_ACCELERATES] = 1.0 if accel > (2.0 - row[E_ACCELERATES]) * ACCELERATES else 0.0
    turned = abs(row[E_TURNED]) > 0.5 * TURNS * FIELD_PERIOD
    row[E_TURNS] = 1.0 if (turned if row[E_TURNS] > 0.0 else abs(row[E_TURN]) > TURNS) else 0.0
    row[E_TURNED] = 0.0
    row[E_STEADY_FOR] += FIELD_PERIOD
    if row[E_ACCELERATES] > 0.0 or row[E_TURNS] > 0.0:
        row[E_STEADY_FOR] = 0.0
    fuses = 1.0 if row[E_ALIGNED] > 0.0 and row[E_STEADY_FOR] < STEADY_AFTER else 0.0
    if fuses != row[E_FUSES_FIELD]:
        _exchange(row, fuses > 0.0)
        row[E_FUSES_FIELD] = fuses


@numeric
def _exchange(row: Array, begins: bool) -> None:
    """Take up the kept variances of field and bias, without covariances with others, or keep them."""
    north_east = E_COVARIANCE + FIELD * STATES + FIELD + 1
    if begins:
        for number in range(FIELD, STATES):
            for other in range(STATES):
                row[E_COVARIANCE + number * STATES + other] = 0.0
                row[E_COVARIANCE + other * STATES + number] = 0.0
            row[variance_at(number)] = row[E_KEPT + number - FIELD]
        row[north_east] = row[north_east + STATES - 1] = row[E_KEPT + STATES - FIELD]
        return
    for number in range(FIELD, STATES):
        row[E_KEPT + number - FIELD] = row[variance_at(number)]
    row[E_KEPT + STATES - FIELD] = row[north_east]


@numeric
def _align(row: Array) -> None:
    """Set heading and field from the filtered reading, as the estimated tilt turns it."""
    row[E_ALIGNED], row[E_KNOWS_DECLINATION] = 1.0, 0.0
    lean_north = (row[A_THRUST] + row[E_STATES + TILT]) / GRAVITY
    lean_east = (row[A_THRUST + 1] + row[E_STATES + TILT + 1]) / GRAVITY
    north = row[E_FILTERED] - lean_north * DOWN
    east = row[E_FILTERED + 1] - lean_east * DOWN
    yaw = (EAST * north - NORTH * east) / LEVEL_SQUARED
    row[E_STATES + YAW] = yaw
    row[E_STATES + FIELD], row[E_STATES + FIELD + 1] = north - yaw * EAST, east + yaw * NORTH
    row[E_STATES + FIELD + 2] = row[E_FILTERED + 2] + lean_north * NORTH + lean_east * EAST
    for number in range(STATES):
        if number not in (TILT, TILT + 1, YAW):
            for turned in (TILT, TILT + 1, YAW):
                row[E_COVARIANCE + number * STATES + turned] = 0.0
                row[E_COVARIANCE + turned * STATES + number] = 0.0
    row[variance_at(YAW)] += RESET_VARIANCE
    for number in range(STATES - FIELD):
        row[E_KEPT + number] = FIELD_VARIANCE
    row[E_KEPT + STATES - FIELD] = 0.0

"""Error of EKF2's estimate: a receiver without the delay that EKF2_GPS_DELAY states, and SIH's noise."""

from math import pi
from random import Random
from statistics import pstdev

import numpy as np
import pytest

from volery.simulation.autopilots.px4.estimate_error import (
    AHEAD,
    FROM_CLIMB,
    FROM_HEIGHT,
    FROM_POSITION,
    FROM_VELOCITY,
    GRAVITY,
    LEVEL,
    STEP,
    STEPS_PER_FIX,
    VERTICAL,
    EstimateError,
    sih_noise,
)


def driven(error: EstimateError, velocity: float, accel: float, seconds: float) -> float:
    for _ in range(round(seconds / STEP)):
        velocity += accel * STEP
        error.step(velocity, accel)
    return velocity


def test_at_constant_speed_the_position_is_ahead_and_the_velocity_right() -> None:
    error = EstimateError()
    driven(error, 5.0, 0.0, 60.0)
    assert error.position == pytest.approx(AHEAD * 5.0, abs=0.01)
    assert error.velocity == pytest.approx(0.0, abs=0.005)


def test_while_it_brakes_the_estimate_is_slower_than_the_aircraft() -> None:
    error = EstimateError()
    driven(error, 5.0, 0.0, 60.0)
    driven(error, 5.0, -1.0, 4.0)
    assert -0.2 < error.velocity < -0.03


def test_at_rest_the_error_ends() -> None:
    error = EstimateError()
    driven(error, 5.0, -1.0, 5.0)
    driven(error, 0.0, 0.0, 60.0)
    assert (error.position, error.velocity) == pytest.approx((0.0, 0.0), abs=1e-3)


def test_the_position_grows_at_its_rate() -> None:
    error = EstimateError()
    driven(error, 3.0, 0.0, 1.0)
    before = error.position
    error.step(3.0, 0.0)
    assert error.position - before == pytest.approx(error.rate * STEP)


def test_gains_are_those_to_which_the_covariance_settles() -> None:
    """EKF2_ACC_NOISE 0.35, EKF2_GYR_NOISE 0.015 in steps of 10 ms; fixes of 0.5 m/s and 0.9 m."""
    step = 0.01
    move = np.eye(3) + np.array([[0.0, step, 0.5 * step**2], [0.0, 0.0, step], [0.0, 0.0, 0.0]])
    noise = np.diag([0.0, (0.35 * step) ** 2, (GRAVITY * 0.015 * step) ** 2])
    covariance = np.diag([0.81, 0.25, 1.0])
    gains = {}
    for _ in range(800):
        for _ in range(round(STEPS_PER_FIX * STEP / step)):
            covariance = move @ covariance @ move.T + noise
        for state, deviation in ((1, 0.5), (0, 0.9)):
            gains[state] = covariance[:, state] / (covariance[state, state] + deviation**2)
            covariance = covariance - np.outer(gains[state], covariance[state])
    assert gains[1] == pytest.approx(FROM_VELOCITY, rel=0.01)
    assert gains[0] == pytest.approx(FROM_POSITION, rel=0.01)


def test_vertical_gains_are_those_to_which_the_covariance_settles() -> None:
    """Steps of 8 ms, a bias of 0.028 m/s^2 at least; fixes of 0.75 m/s and 1.78 m, a barometer of 3.5 m.

    Logged of PX4 1.14 in SIH: variances of 0.0134 (m/s)^2 and 0.109 m^2.
    """
    step = 0.008
    move = np.array([[1.0, step, 0.0], [0.0, 1.0, step], [0.0, 0.0, 1.0]])
    noise = np.diag([0.0, (0.35 * step) ** 2, (0.003 * step) ** 2])
    covariance = np.diag([1.0, 0.25, 0.04])
    gains = {}
    for number in range(1, 25_000):
        covariance = move @ covariance @ move.T + noise
        fixes = [(1, 0.75), (0, 1.78)] if number % 15 == 0 else []
        barometer = [(0, 3.52)] if number % 8 == 0 else []
        for state, deviation in fixes + barometer:
            gain = covariance[:, state] / (covariance[state, state] + deviation**2)
            covariance = covariance - np.outer(gain, covariance[state])
            if (state, deviation) in fixes:
                gains[state] = gain
        covariance[2, 2] = max(covariance[2, 2], 5e-8 / step**2)
    assert covariance[1, 1] == pytest.approx(0.0134, rel=0.05)
    assert covariance[0, 0] == pytest.approx(0.109, rel=0.05)
    assert gains[1] == pytest.approx(FROM_CLIMB, rel=0.02)
    assert gains[0] == pytest.approx(FROM_HEIGHT, rel=0.02)


def wandered(heading: float, axis: int, seconds: float = 2000.0) -> tuple[float, float, float]:
    """Return the deviations of position, velocity and tilt of an aircraft that hovers."""
    draws, error = Random(1), EstimateError(VERTICAL if axis == 2 else LEVEL)
    states = []
    for _ in range(round(seconds / STEP)):
        error.step(0.0, 0.0, sih_noise(lambda _: draws.gauss(0.0, 1.0), heading)[axis])
        states.append((error.position, error.velocity, error.tilt))
    position, velocity, tilt = (pstdev(values) for values in zip(*states, strict=True))
    return position, velocity, tilt


@pytest.mark.parametrize(
    ("heading", "axis", "position", "velocity", "tilt"),
    [
        (0.0, 0, 0.19, 0.17, 0.08),
        (0.0, 1, 0.39, 0.36, 0.17),
        (pi / 2.0, 0, 0.39, 0.36, 0.17),
        (0.0, 2, 0.24, 0.13, 0.0),
    ],
)
def test_the_estimate_wanders_as_its_gains_let_the_noise_pass(
    heading: float, axis: int, position: float, velocity: float, tilt: float
) -> None:
    """Solution of the Lyapunov equation. Logged in a hover of 97 s of PX4 1.14 in SIH, forward and sideways:
    0.15 and 0.34 m, 0.18 and 0.41 m/s, 0.09 and 0.21 m/s^2; down 0.20 m, 0.15 m/s."""
    assert wandered(heading, axis) == pytest.approx((position, velocity, tilt), rel=0.15)

"""Error of EKF2's estimate under a receiver without the delay that EKF2_GPS_DELAY states."""

import numpy as np
import pytest

from volery.simulation.autopilots.px4.delay_error import (
    AHEAD,
    FROM_POSITION,
    FROM_VELOCITY,
    STEP,
    STEPS_PER_FIX,
    DelayError,
)

GRAVITY = 9.80665


def driven(error: DelayError, velocity: float, accel: float, seconds: float) -> float:
    for _ in range(round(seconds / STEP)):
        velocity += accel * STEP
        error.step(velocity, accel)
    return velocity


def test_at_constant_speed_the_position_is_ahead_and_the_velocity_right() -> None:
    error = DelayError()
    driven(error, 5.0, 0.0, 60.0)
    assert error.position == pytest.approx(AHEAD * 5.0, abs=0.01)
    assert error.velocity == pytest.approx(0.0, abs=0.005)


def test_while_it_brakes_the_estimate_is_slower_than_the_aircraft() -> None:
    error = DelayError()
    driven(error, 5.0, 0.0, 60.0)
    driven(error, 5.0, -1.0, 4.0)
    assert -0.2 < error.velocity < -0.03


def test_at_rest_the_error_ends() -> None:
    error = DelayError()
    driven(error, 5.0, -1.0, 5.0)
    driven(error, 0.0, 0.0, 60.0)
    assert (error.position, error.velocity) == pytest.approx((0.0, 0.0), abs=1e-3)


def test_the_position_grows_at_its_rate() -> None:
    error = DelayError()
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

"""Sensor samples against the errors that their suite declares."""

import numpy as np
import pytest

from volery.simulation.world.body_specs import Multirotor
from volery.simulation.world.sensors import sensor_suite
from volery.simulation.world.state_layout import (
    M_ACCEL,
    M_BARO,
    M_GPS,
    M_GYRO,
    M_MAG,
)
from volery.simulation.world.world import World

BODIES = 40


@pytest.fixture
def sampled(clock, frame):
    """Samples of forty vehicles at rest, three minutes long, one a second: (time, body, column)."""

    def take(sensors):
        clock.now = 0
        world = World(clock, [Multirotor(sensors=sensors)] * BODIES, frame=frame)
        samples = []
        for _ in range(180):
            clock.wait(1)
            for body in range(BODIES):
                world.advance_to_now(body)
            samples.append(world.arrays.rows.copy())
        return np.array(samples)

    return take


@pytest.mark.parametrize("sensors", ["consumer", "rtk"])
def test_errors_have_the_declared_deviations(sampled, sensors):
    rows = sampled(sensors)
    suite = sensor_suite(sensors)
    for error, column in (
        (suite.gyro, M_GYRO),
        (suite.accelerometer, M_ACCEL),
        (suite.barometer, M_BARO),
        (suite.gps.horizontal, M_GPS),
        (suite.magnetometer, M_MAG),
    ):
        series = rows[..., column]
        steps = np.diff(series, axis=0)  # the bias hardly moves in a second
        assert steps.std() / 2**0.5 == pytest.approx(error.white_sigma, rel=0.15)
        spread = series.mean(axis=0).std()  # over vehicles: the bias, hardly averaged by three minutes
        assert spread == pytest.approx(error.bias_sigma, rel=0.4)


def test_the_noise_of_sensors_and_vehicles_is_uncorrelated(sampled):
    rows = sampled("consumer")
    series = np.concatenate(
        [np.diff(rows[:, :2, column], axis=0).T for column in (M_GYRO, M_GYRO + 1, M_ACCEL, M_BARO, M_GPS)]
    )
    correlation = np.corrcoef(series) - np.eye(len(series))
    assert np.abs(correlation).max() < 0.35


def test_perfect_sensors_have_no_error(sampled):
    rows = sampled("perfect")
    assert (rows[..., M_GYRO : M_GYRO + 3] == 0.0).all()
    assert (rows[..., M_GPS] == 0.0).all()

"""What instruments show, against the errors that their set declares."""

import numpy as np
import pytest

from volery.simulation.world.body_specs import Multirotor
from volery.simulation.world.sensors import sensor_set
from volery.simulation.world.state_layout import (
    ACCEL,
    BARO,
    GPS_LEVEL,
    GYRO,
    M_ACCEL,
    M_BARO,
    M_GPS,
    M_GYRO,
    M_MAG,
    MAG,
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
                world.look(body)
            samples.append(world.arrays.rows.copy())
        return np.array(samples)

    return take


@pytest.mark.parametrize("sensors", ["consumer", "rtk"])
def test_errors_have_the_declared_deviations(sampled, sensors):
    rows = sampled(sensors)
    noises = sensor_set(sensors).noises
    for sensor, column in (
        (GYRO, M_GYRO),
        (ACCEL, M_ACCEL),
        (BARO, M_BARO),
        (GPS_LEVEL, M_GPS),
        (MAG, M_MAG),
    ):
        noise = noises[sensor]
        series = rows[..., column]
        steps = np.diff(series, axis=0)  # the slow part hardly moves in a second
        assert steps.std() / 2**0.5 == pytest.approx(noise.white, rel=0.15)
        spread = series.mean(axis=0).std()  # over vehicles: the slow part, hardly averaged by three minutes
        assert spread == pytest.approx(noise.slow, rel=0.4)


def test_every_instrument_of_every_vehicle_has_noise_of_its_own(sampled):
    rows = sampled("consumer")
    series = np.concatenate(
        [np.diff(rows[:, :2, column], axis=0).T for column in (M_GYRO, M_GYRO + 1, M_ACCEL, M_BARO, M_GPS)]
    )
    correlation = np.corrcoef(series) - np.eye(len(series))
    assert np.abs(correlation).max() < 0.35


def test_perfect_instruments_have_no_error(sampled):
    rows = sampled("perfect")
    assert (rows[..., M_GYRO : M_GYRO + 3] == 0.0).all()
    assert (rows[..., M_GPS] == 0.0).all()

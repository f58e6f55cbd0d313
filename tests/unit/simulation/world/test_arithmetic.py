import math
import random

import numpy as np
import pytest

from volery.simulation.world.arithmetic import gaussian, wrap_angle
from volery.simulation.world.environment_models import altitude_at, pressure_at

DRAW = random.Random(20)


@pytest.fixture(autouse=True)
def _hashes_wrap_around():
    with np.errstate(over="ignore"):
        yield


def test_angles_wrap_into_one_turn():
    for _ in range(500):
        angle = DRAW.uniform(-100, 100)
        assert math.cos(wrap_angle(angle)) == pytest.approx(math.cos(angle), abs=1e-12)
        assert -math.pi <= wrap_angle(angle) <= math.pi


def test_noise_is_gaussian_enough_and_uncorrelated():
    key = np.uint64(123456789)
    draws = np.array([[gaussian(key, stream, k) for k in range(20_000)] for stream in (1, 2)])
    assert abs(draws.mean()) < 0.02
    assert draws.std() == pytest.approx(1.0, abs=0.01)
    assert abs(np.corrcoef(draws[0], draws[1])[0, 1]) < 0.02
    assert abs(np.corrcoef(draws[0][1:], draws[0][:-1])[0, 1]) < 0.02
    assert (np.abs(draws) > 2.0).mean() == pytest.approx(0.0455, abs=0.006)


def test_noise_depends_on_key_stream_and_counter_and_on_nothing_else():
    one = gaussian(np.uint64(7), 3, 100)
    assert gaussian(np.uint64(7), 3, 100) == one
    others = {gaussian(np.uint64(8), 3, 100), gaussian(np.uint64(7), 4, 100), gaussian(np.uint64(7), 3, 101)}
    assert one not in others


def test_standard_atmosphere_at_tabled_heights():
    # ISO 2533, table 2
    for height, pascal in ((0.0, 101325.0), (1000.0, 89874.6), (5000.0, 54019.9)):
        assert pressure_at(height) == pytest.approx(pascal, rel=1e-5)
        assert altitude_at(pressure_at(height)) == pytest.approx(height, abs=1e-6)

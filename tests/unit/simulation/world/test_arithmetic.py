import math
import random

import numpy as np
import pytest

from volery.simulation.world.arithmetic import (
    arc_tangent2,
    exponential,
    gaussian,
    logarithm,
    sine_cosine,
    wrap_angle,
)
from volery.simulation.world.environment_models import altitude_at, pressure_at

DRAW = random.Random(20)


@pytest.fixture(autouse=True)
def _hashes_wrap_around():
    with np.errstate(over="ignore"):
        yield


def test_sine_and_cosine_agree_with_the_library_within_two_units_in_the_last_place():
    for angle in [0.0, math.pi / 4, -math.pi / 4, math.pi, *(DRAW.uniform(-1e3, 1e3) for _ in range(2000))]:
        sine, cosine = sine_cosine(angle)
        assert sine == pytest.approx(math.sin(angle), abs=3e-13 if abs(angle) > 100 else 4e-16)
        assert cosine == pytest.approx(math.cos(angle), abs=3e-13 if abs(angle) > 100 else 4e-16)


def test_arc_tangent_covers_every_quadrant_and_the_axes():
    for _ in range(2000):
        y, x = DRAW.uniform(-5, 5), DRAW.uniform(-5, 5)
        assert arc_tangent2(y, x) == pytest.approx(math.atan2(y, x), abs=1e-15)
    for y, x in ((0.0, 1.0), (1.0, 0.0), (0.0, -1.0), (-1.0, 0.0), (0.0, 0.0)):
        assert arc_tangent2(y, x) == pytest.approx(math.atan2(y, x), abs=1e-15)


def test_exponential_and_logarithm_are_inverse_and_agree_with_the_library():
    for _ in range(2000):
        x = DRAW.uniform(-50, 50)
        assert exponential(x) == pytest.approx(math.exp(x), rel=5e-16)
        assert logarithm(exponential(x)) == pytest.approx(x, abs=1e-13)


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

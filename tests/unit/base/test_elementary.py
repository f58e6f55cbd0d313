"""Elementary functions agree with the C library's, and have the same ends."""

import math
import random

import pytest

from volery.base.elementary import acos, asin, atan, atan2, cbrt, cos, exp, log, sin, sine_cosine, tan

DRAW = random.Random(20)


def test_sine_and_cosine_agree_with_the_library_within_two_units_in_the_last_place():
    for angle in [0.0, math.pi / 4, -math.pi / 4, math.pi, *(DRAW.uniform(-1e3, 1e3) for _ in range(2000))]:
        sine, cosine = sine_cosine(angle)
        assert sine == pytest.approx(math.sin(angle), abs=3e-13 if abs(angle) > 100 else 4e-16)
        assert cosine == pytest.approx(math.cos(angle), abs=3e-13 if abs(angle) > 100 else 4e-16)


def test_arc_tangent_covers_every_quadrant_and_the_axes():
    for _ in range(2000):
        y, x = DRAW.uniform(-5, 5), DRAW.uniform(-5, 5)
        assert atan2(y, x) == pytest.approx(math.atan2(y, x), abs=1e-15)
    for y, x in ((0.0, 1.0), (1.0, 0.0), (0.0, -1.0), (-1.0, 0.0), (0.0, 0.0)):
        assert atan2(y, x) == pytest.approx(math.atan2(y, x), abs=1e-15)


def test_exponential_and_logarithm_are_inverse_and_agree_with_the_library():
    for _ in range(2000):
        x = DRAW.uniform(-50, 50)
        assert exp(x) == pytest.approx(math.exp(x), rel=5e-16)
        assert log(exp(x)) == pytest.approx(x, abs=1e-13)


def test_the_functions_of_one_argument_agree_with_the_library():
    for _ in range(2000):
        angle, share = DRAW.uniform(-1.5, 1.5), DRAW.uniform(-1.0, 1.0)
        assert sin(angle) == pytest.approx(math.sin(angle), abs=4e-16)
        assert cos(angle) == pytest.approx(math.cos(angle), abs=4e-16)
        assert tan(angle) == pytest.approx(math.tan(angle), rel=2e-15)
        assert atan(angle) == pytest.approx(math.atan(angle), abs=4e-16)
        assert asin(share) == pytest.approx(math.asin(share), abs=1e-15)
        assert acos(share) == pytest.approx(math.acos(share), abs=1e-15)


def test_a_cube_root():
    assert cbrt(0.0) == 0.0
    for _ in range(500):
        x = DRAW.uniform(0.0, 50.0)
        assert cbrt(x) * cbrt(x) * cbrt(x) == pytest.approx(x, rel=4e-15)


def test_ends_of_the_domain():
    assert (asin(1.0), asin(-1.0), acos(1.0), acos(-1.0)) == (math.pi / 2, -math.pi / 2, 0.0, math.pi)
    for outside in (1.0000001, -2.0):
        with pytest.raises(ValueError, match="math domain"):
            acos(outside)


@pytest.mark.parametrize("angle", [math.nan, math.inf, -math.inf, 1e6, -1e300])
def test_an_angle_without_a_meaning_has_no_sine(angle):
    assert all(map(math.isnan, (*sine_cosine(angle), sin(angle), cos(angle), tan(angle))))

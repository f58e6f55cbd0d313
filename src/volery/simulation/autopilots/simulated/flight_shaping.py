"""Kinematic shaping: targets that a vehicle can follow, with limited speed, acceleration and jerk."""

from __future__ import annotations

from math import sqrt

from numba import njit

from volery.simulation.world.arithmetic import clip


@njit(cache=False)
def approach(error: float, gain: float, brake: float) -> float:
    """The rate at which to close *error* so that *brake* suffices to stop at zero.

    Proportional (*gain*) near the goal; further out the square-root law v = sqrt(2 a (e - a / 2 gain^2)) that
    joins it with equal value and slope.
    """
    if brake <= 0.0:
        return error * gain
    linear = brake / (gain * gain)
    if error > linear:
        return sqrt(2.0 * brake * (error - 0.5 * linear))
    if error < -linear:
        return -sqrt(2.0 * brake * (-error - 0.5 * linear))
    return error * gain


@njit(cache=False)
def ramp(value: float, goal: float, most: float) -> float:
    """*value* moved towards *goal* by at most *most*."""
    return value + clip(goal - value, -most, most)


@njit(cache=False)
def shorten(x: float, y: float, most: float) -> tuple[float, float]:
    """The vector (x, y), scaled down where it is longer than *most*."""
    length = sqrt(x * x + y * y)
    if length <= most:
        return x, y
    scale = most / length
    return x * scale, y * scale

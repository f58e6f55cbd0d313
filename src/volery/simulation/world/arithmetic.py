"""Angles, limits and noise for compiled code, the same to the last bit on every processor.

Noise is a function of (key, stream, counter): a generator with a state would make each draw depend on who
drew before. The counter is hashed by SplitMix64's finaliser (Steele, Lea and Flood, OOPSLA 2014), applied
twice.
"""

from __future__ import annotations

from math import pi

import numpy as np

from volery.base.numeric_code import numeric


@numeric
def wrap_angle(angle: float) -> float:
    """Return the same angle in [-pi, pi), for angles within a few thousand turns [rad]."""
    turns = angle * (0.5 / pi)
    whole = int(turns + 0.5) if turns >= 0.0 else -int(0.5 - turns)
    return angle - whole * (2.0 * pi)


@numeric
def clip(value: float, low: float, high: float) -> float:
    """Return *value* limited to [low, high]."""
    return min(max(value, low), high)


# --- noise ---

FIRMWARE_STREAM = 1000
"""Number of the first stream of a firmware's own noise; those of the body's sensors are lower."""

_STEP = np.uint64(0x9E3779B97F4A7C15)
_STREAM = np.uint64(0xD1342543DE82EF95)
_MIX_1 = np.uint64(0xBF58476D1CE4E5B9)
_MIX_2 = np.uint64(0x94D049BB133111EB)
_S30, _S27, _S31 = np.uint64(30), np.uint64(27), np.uint64(31)
_LOW = np.uint64(0xFFFF)
_S16, _S32, _S48 = np.uint64(16), np.uint64(32), np.uint64(48)
_MEAN = 8 * 65535 / 2
_DEVIATION = 53510.91981653096  # sqrt(8 (65536**2 - 1) / 12)


@numeric
def _mix(word: np.uint64) -> np.uint64:
    word = (word ^ (word >> _S30)) * _MIX_1
    word = (word ^ (word >> _S27)) * _MIX_2
    return word ^ (word >> _S31)


@numeric
def random_word(key: np.uint64, stream: int, k: int) -> np.uint64:
    """Return 64 uniform bits for uint64 *key*, integer *stream* and integer counter *k*."""
    return _mix(_mix(key + np.uint64(stream) * _STREAM) + np.uint64(k) * _STEP)


@numeric
def gaussian(key: np.uint64, stream: int, k: int) -> float:
    """Return draw *k* of a stream, of zero mean and unit variance: the sum of eight 16-bit uniforms.

    The distribution (Irwin and Hall) is bounded at 4.9 sigma, its excess kurtosis is -0.15. It needs no
    logarithm and no root.

    Args:
        key: Key of the body or the sensor (uint64).
        stream: Number of the stream.
        k: Counter, usually the grid step.
    """
    a = random_word(key, stream, k)
    b = _mix(a + _STEP)
    total = (a & _LOW) + ((a >> _S16) & _LOW) + ((a >> _S32) & _LOW) + (a >> _S48)
    total += (b & _LOW) + ((b >> _S16) & _LOW) + ((b >> _S32) & _LOW) + (b >> _S48)
    return (np.float64(np.int64(total)) - _MEAN) / _DEVIATION

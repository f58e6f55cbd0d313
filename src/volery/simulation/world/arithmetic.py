"""Elementary functions and noise for compiled code, the same to the last bit on every processor.

The C library chooses its sine by the processor, and the last bit may differ. The functions here use
additions, products, quotients and square roots alone, which IEEE 754 rounds correctly, and no compiler flag
permits fusing or reordering them. They are accurate to about two units in the last place.

Noise is a function of (key, stream, counter): a generator with a state would make each draw depend on who
drew before. The counter is hashed by SplitMix64's finaliser (Steele, Lea and Flood, OOPSLA 2014), applied
twice.
"""

from __future__ import annotations

from math import frexp, ldexp, sqrt

import numpy as np

from volery.base.numeric_code import numeric

PI = 3.141592653589793
HALF_PI = 1.5707963267948966
_HALF_PI_HIGH = 1.5707963267341256  # pi/2 in two parts whose sum holds 86 bits (Cody and Waite's reduction)
_HALF_PI_LOW = 6.077100506506192e-11
_LN2_HIGH = 0.6931471803691238
_LN2_LOW = 1.9082149292705877e-10


@numeric
def _sine_near_zero(x: float) -> float:
    """Evaluate Taylor's series to x**17 on [-pi/4, pi/4]; the remainder is below 2e-19."""
    s = x * x
    p = -1.0 / 1307674368000.0 + s * (1.0 / 355687428096000.0)
    p = 1.0 / 6227020800.0 + s * p
    p = -1.0 / 39916800.0 + s * p
    p = 1.0 / 362880.0 + s * p
    p = -1.0 / 5040.0 + s * p
    p = 1.0 / 120.0 + s * p
    p = -1.0 / 6.0 + s * p
    return x + x * s * p


@numeric
def _cosine_near_zero(x: float) -> float:
    """Evaluate Taylor's series to x**16 on [-pi/4, pi/4]; the remainder is below 3e-18."""
    s = x * x
    p = -1.0 / 87178291200.0 + s * (1.0 / 20922789888000.0)
    p = 1.0 / 479001600.0 + s * p
    p = -1.0 / 3628800.0 + s * p
    p = 1.0 / 40320.0 + s * p
    p = -1.0 / 720.0 + s * p
    p = 1.0 / 24.0 + s * p
    return 1.0 - 0.5 * s + s * s * p


@numeric
def sine_cosine(x: float) -> tuple[float, float]:
    """Return (sin x, cos x) for |x| below a million radians."""
    turns = x * (1.0 / HALF_PI)
    quarter = int(turns + 0.5) if turns >= 0.0 else -int(0.5 - turns)
    reduced = (x - quarter * _HALF_PI_HIGH) - quarter * _HALF_PI_LOW
    s = _sine_near_zero(reduced)
    c = _cosine_near_zero(reduced)
    phase = quarter & 3
    if phase == 0:
        return s, c
    if phase == 1:
        return c, -s
    if phase == 2:
        return -s, -c
    return -c, s


@numeric
def _arc_tangent(x: float) -> float:
    """Return the arc tangent for 0 <= x <= 1.

    The angle is halved twice, then the series to t**19 is evaluated (remainder below 2e-17).
    """
    half = x / (1.0 + sqrt(1.0 + x * x))
    t = half / (1.0 + sqrt(1.0 + half * half))
    s = t * t
    p = 1.0 / 17.0 - s * (1.0 / 19.0 - s * (1.0 / 21.0))
    p = 1.0 / 13.0 - s * (1.0 / 15.0 - s * p)
    p = 1.0 / 9.0 - s * (1.0 / 11.0 - s * p)
    p = 1.0 / 5.0 - s * (1.0 / 7.0 - s * p)
    return 4.0 * (t - t * s * (1.0 / 3.0 - s * p))


@numeric
def arc_tangent2(y: float, x: float) -> float:
    """Return the angle of the point (x, y) in (-pi, pi] [rad]; zero at the origin."""
    across = abs(x)
    up = abs(y)
    if across == 0.0 and up == 0.0:
        return 0.0
    angle = _arc_tangent(up / across) if up <= across else HALF_PI - _arc_tangent(across / up)
    if x < 0.0:
        angle = PI - angle
    return -angle if y < 0.0 else angle


@numeric
def exponential(x: float) -> float:
    """Return e**x for |x| < 700, by reduction to |r| <= ln2/2 and Taylor's series to r**13."""
    scaled = x * 1.4426950408889634
    k = int(scaled + 0.5) if scaled >= 0.0 else -int(0.5 - scaled)
    r = (x - k * _LN2_HIGH) - k * _LN2_LOW
    p = 1.0
    for n in range(13, 0, -1):
        p = 1.0 + r * p / n
    return ldexp(p, k)


@numeric
def logarithm(x: float) -> float:
    """Return the natural logarithm of x > 0.

    x = m 2**k with m in [sqrt(1/2), sqrt(2)), and ln m = 2 artanh((m-1)/(m+1)).
    """
    m, k = frexp(x)
    if m < 0.7071067811865476:
        m = m * 2.0
        k = k - 1
    z = (m - 1.0) / (m + 1.0)
    s = z * z
    p = 0.0
    for n in range(23, 0, -2):
        p = 1.0 / n + s * p
    return 2.0 * z * p + k * _LN2_LOW + k * _LN2_HIGH


@numeric
def wrap_angle(angle: float) -> float:
    """Return the same angle in [-pi, pi), for angles within a few thousand turns [rad]."""
    turns = angle * (0.5 / PI)
    whole = int(turns + 0.5) if turns >= 0.0 else -int(0.5 - turns)
    return angle - whole * (2.0 * PI)


@numeric
def clip(value: float, low: float, high: float) -> float:
    """Return *value* limited to [low, high]."""
    return min(max(value, low), high)


# --- noise ---

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

"""Elementary functions: sine, cosine and others, the same to the last bit on every processor.

The C library chooses its sine by the processor: with and without fused multiplication one result in 1500
differs in its last bit, and a flight amplifies that bit. Code whose results are part of a trace takes these
functions instead of those of ``math`` (``make check`` proves it). They use additions, products, quotients and
square roots alone, which IEEE 754 rounds correctly, and no compiler flag permits fusing or reordering them.
They are accurate to about two units in the last place. Powers of whole exponents are written as products,
since ``**`` calls the C library, too; ``math.hypot`` is Python's own.

The functions are plain Python for their callers, and part of machine code where that calls them
(``base.numeric_code``).
"""

from __future__ import annotations

from math import frexp, ldexp, nan, pi, sqrt

from volery.base.numeric_code import numeric

LARGEST_ANGLE = 1e6
HALF_PI = 1.5707963267948966
_HALF_PI_HIGH = 1.5707963267341256  # pi/2 in two parts whose sum holds 86 bits (Cody and Waite's reduction)
_HALF_PI_LOW = 6.077100506506192e-11
_LN2_HIGH = 0.6931471803691238
_LN2_LOW = 1.9082149292705877e-10


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


def sine_cosine(x: float) -> tuple[float, float]:
    """Return (sin x, cos x) for |x| below a million radians, else not a number."""
    if not abs(x) < LARGEST_ANGLE:
        return nan, nan
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


def atan2(y: float, x: float) -> float:
    """Return the angle of the point (x, y) in (-pi, pi] [rad]; zero at the origin."""
    across = abs(x)
    up = abs(y)
    if across == 0.0 and up == 0.0:
        return 0.0
    angle = _arc_tangent(up / across) if up <= across else HALF_PI - _arc_tangent(across / up)
    if x < 0.0:
        angle = pi - angle
    return -angle if y < 0.0 else angle


def exp(x: float) -> float:
    """Return e**x for |x| < 700, by reduction to |r| <= ln2/2 and Taylor's series to r**13."""
    scaled = x * 1.4426950408889634
    k = int(scaled + 0.5) if scaled >= 0.0 else -int(0.5 - scaled)
    r = (x - k * _LN2_HIGH) - k * _LN2_LOW
    p = 1.0
    for n in range(13, 0, -1):
        p = 1.0 + r * p / n
    return ldexp(p, k)


def log(x: float) -> float:
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


def sin(x: float) -> float:
    """Return the sine of an angle below a million radians."""
    return sine_cosine(x)[0]


def cos(x: float) -> float:
    """Return the cosine of an angle below a million radians."""
    return sine_cosine(x)[1]


def tan(x: float) -> float:
    """Return the tangent of an angle below a million radians."""
    sine, cosine = sine_cosine(x)
    return sine / cosine


def atan(x: float) -> float:
    """Return the angle in [-pi/2, pi/2] whose tangent is *x* [rad]."""
    return atan2(x, 1.0)


def asin(x: float) -> float:
    """Return the angle in [-pi/2, pi/2] whose sine is *x*, from -1 to 1 [rad]."""
    return atan2(x, sqrt((1.0 - x) * (1.0 + x)))


def acos(x: float) -> float:
    """Return the angle in [0, pi] whose cosine is *x*, from -1 to 1 [rad]."""
    return atan2(sqrt((1.0 - x) * (1.0 + x)), x)


def cbrt(x: float) -> float:
    """Return the cube root of x >= 0."""
    return exp(log(x) / 3.0) if x > 0.0 else 0.0


for _function in (_sine_near_zero, _cosine_near_zero, _arc_tangent, sine_cosine, atan2, exp, log):
    numeric(_function)

"""Numbers between the wire and the vehicle: a float of the wire need not be a number at all, and a field of
16 bits does not hold everything.
"""

from __future__ import annotations

from collections.abc import Iterable
from math import isfinite

LARGEST = 1e9
FARTHEST = 1e6
"""Metres beyond which a point means nothing."""


def number(value: float) -> float:
    """*value*, or 0 if it is none; kept between plus and minus ``LARGEST``."""
    return min(LARGEST, max(-LARGEST, value)) if isfinite(value) else 0.0


def sound(values: Iterable[float], most: float = LARGEST) -> bool:
    """Whether all of them are numbers no larger than *most*."""
    return all(abs(value) <= most for value in values)  # false for NaN


def short(value: float) -> int:
    """The nearest signed 16-bit number: a field shows its end where the value lies beyond."""
    return min(32_767, max(-32_768, round(value)))


def word(value: float) -> int:
    """The nearest unsigned 16-bit number."""
    return min(65_535, max(0, round(value)))

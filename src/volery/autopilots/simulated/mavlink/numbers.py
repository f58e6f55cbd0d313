"""Numbers as stations send them, made fit for use: a float of the wire need not be a number at all."""

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

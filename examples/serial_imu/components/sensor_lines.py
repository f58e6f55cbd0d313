"""Lines of VectorNav's ``$VNIMU``: magnetic field [G], specific force [m/s^2] and rates [rad/s] along
forward, right, down, then temperature, pressure and a checksum."""

from __future__ import annotations

from functools import reduce
from math import isfinite


def numbers_of(line):
    """Return the eleven numbers of a line, or None if it is damaged."""
    body, star, checksum = line.strip().partition(b"*")
    if not star or not body.startswith(b"$VNIMU,"):
        return None
    try:
        numbers = [float(part) for part in body[7:].split(b",")]
        sound = int(checksum, 16) == reduce(lambda one, other: one ^ other, body[1:])
    except ValueError:
        return None
    return numbers if sound and len(numbers) == 11 and all(map(isfinite, numbers)) else None

"""Values of parameters in PARAM_VALUE and PARAM_SET, where the firmware puts whole numbers into the bytes
of the float (MAVLink's "bytewise" encoding: PX4). ArduPilot writes the number itself, as a real one.
"""

from __future__ import annotations

import struct

REAL32 = 9
"""MAV_PARAM_TYPE."""

_REAL, _WHOLE, _UNSIGNED = struct.Struct("<f"), struct.Struct("<i"), struct.Struct("<I")


def as_bytes(kind: int, value: float) -> float:
    """The real number whose bytes are those of an integer; a real number is itself."""
    if kind == REAL32:
        return value
    number: float = _REAL.unpack(_UNSIGNED.pack(int(value) & 0xFFFF_FFFF))[0]
    return number


def from_bytes(kind: int, value: float) -> float:
    """What ``as_bytes`` was given."""
    if kind == REAL32:
        return value
    return float(_WHOLE.unpack(_REAL.pack(value))[0])

"""Field values of MAVLink messages that all firmwares build alike, and numbers that arrive in fields.

A float on the wire may be no number, and a field of 16 bits does not hold every value.
"""

from __future__ import annotations

from collections.abc import Iterable
from math import degrees, isfinite
from typing import Any

from volery.base.time import MS, US
from volery.simulation.autopilots.vehicle_state import Vehicle

Fields = dict[str, Any]

EPOCH_US = 1_767_225_600_000_000
"""Satellite time at the start of a run: 2026-01-01 00:00 UTC [us]."""

LARGEST = 1e9
FARTHEST = 1e6
"""Largest distance of a point that is accepted [m]."""


def finite(value: float) -> float:
    """Return *value* limited to plus and minus ``LARGEST``, or 0 if it is no number."""
    return min(LARGEST, max(-LARGEST, value)) if isfinite(value) else 0.0


def all_within(values: Iterable[float], most: float = LARGEST) -> bool:
    """Return whether all values are numbers of a magnitude up to *most*."""
    return all(abs(value) <= most for value in values)  # false for NaN


def to_int16(value: float) -> int:
    """Return the nearest signed 16-bit integer."""
    return min(32_767, max(-32_768, round(value)))


def to_uint16(value: float) -> int:
    """Return the nearest unsigned 16-bit integer."""
    return min(65_535, max(0, round(value)))


def boot_ms(vehicle: Vehicle) -> int:
    """Return the field ``time_boot_ms``."""
    return vehicle.uptime() // MS


def boot_us(vehicle: Vehicle) -> int:
    """Return the field ``time_usec``, counted from boot."""
    return vehicle.uptime() // US


def heading_cdeg(yaw: float) -> int:
    """Return a yaw angle [rad] as 0..35999 hundredths of a degree."""
    return round(degrees(yaw) * 100.0) % 36_000


def attitude(vehicle: Vehicle) -> Fields:
    """Return the fields of ATTITUDE."""
    estimate = vehicle.estimate
    roll, pitch, yaw = estimate.attitude
    p, q, r = estimate.rates
    return {
        "time_boot_ms": boot_ms(vehicle),
        "roll": roll,
        "pitch": pitch,
        "yaw": yaw,
        "rollspeed": p,
        "pitchspeed": q,
        "yawspeed": r,
    }


def attitude_quaternion(vehicle: Vehicle) -> Fields:
    """Return the fields of ATTITUDE_QUATERNION."""
    estimate = vehicle.estimate
    w, x, y, z = estimate.quaternion
    p, q, r = estimate.rates
    return {
        "time_boot_ms": boot_ms(vehicle),
        "q1": w,
        "q2": x,
        "q3": y,
        "q4": z,
        "rollspeed": p,
        "pitchspeed": q,
        "yawspeed": r,
    }

"""Numbers between the wire and the vehicle: a float of the wire need not be a number at all, and a field of
16 bits does not hold everything.

Telemetry that every firmware on MAVLink sends alike. Units and signs are the messages' own.
"""

from __future__ import annotations

from collections.abc import Iterable
from math import degrees, isfinite
from typing import Any

from volery.base.time import MS, US
from volery.simulation.autopilots.vehicle_state import Vehicle

LARGEST = 1e9
FARTHEST = 1e6
"""Metres beyond which a point means nothing."""


def finite(value: float) -> float:
    """*value*, or 0 if it is none; kept between plus and minus ``LARGEST``."""
    return min(LARGEST, max(-LARGEST, value)) if isfinite(value) else 0.0


def all_within(values: Iterable[float], most: float = LARGEST) -> bool:
    """Whether all of them are numbers no larger than *most*."""
    return all(abs(value) <= most for value in values)  # false for NaN


def to_int16(value: float) -> int:
    """The nearest signed 16-bit number: a field shows its end where the value lies beyond."""
    return min(32_767, max(-32_768, round(value)))


def to_uint16(value: float) -> int:
    """The nearest unsigned 16-bit number."""
    return min(65_535, max(0, round(value)))


Fields = dict[str, Any]

EPOCH_US = 1_767_225_600_000_000
"""Satellite time at the start of a run: 2026-01-01 00:00 UTC [us]."""


def boot_ms(vehicle: Vehicle) -> int:
    """``time_boot_ms``."""
    return vehicle.uptime() // MS


def boot_us(vehicle: Vehicle) -> int:
    """``time_usec`` counted from boot."""
    return vehicle.uptime() // US


def heading_cdeg(yaw: float) -> int:
    """0..35999."""
    return round(degrees(yaw) * 100.0) % 36_000


def attitude(vehicle: Vehicle) -> Fields:
    """ATTITUDE."""
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
    """ATTITUDE_QUATERNION."""
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

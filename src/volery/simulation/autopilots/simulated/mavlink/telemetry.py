"""Telemetry that every firmware on MAVLink sends alike. Units and signs are the messages' own."""

from __future__ import annotations

from math import degrees
from typing import Any

from volery.base.time import MS, US
from volery.simulation.autopilots.simulated.vehicle import Vehicle

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

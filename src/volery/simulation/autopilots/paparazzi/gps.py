"""What the firmware makes of its satellite receiver."""

from __future__ import annotations

from volery.base.time import S
from volery.simulation.autopilots.paparazzi.memory import of
from volery.simulation.autopilots.vehicle_state import Vehicle

FIX_3D = 3
ACQUIRED_AFTER = 12 * S
"""Uptime at which a receiver that was just switched on has its first fix."""


def fix_type(vehicle: Vehicle) -> int:
    """As in GPS_INT: 0 none, 3 three-dimensional, 4 differential, 5 RTK. MAVLink counts the two RTK kinds."""
    if vehicle.uptime() < ACQUIRED_AFTER:
        return 0
    return min(5, vehicle.estimate.gps.fix_type)


def fix_is_valid(vehicle: Vehicle) -> bool:
    """There is a fix in three dimensions."""
    return fix_type(vehicle) >= FIX_3D


def watch(vehicle: Vehicle) -> None:
    """Remember when there last was a fix. The estimator uses satellites from the first one on."""
    if fix_is_valid(vehicle):
        of(vehicle).fix_seen = vehicle.kernel.now()
        if not vehicle.estimate.position_ok and not vehicle.armed:
            vehicle.flight.set_origin()


def is_lost(vehicle: Vehicle) -> bool:
    """No fix for GPS_TIMEOUT."""
    return vehicle.kernel.now() - of(vehicle).fix_seen > vehicle.seconds_parameter("GPS_TIMEOUT")

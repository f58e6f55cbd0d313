"""ArduPilot's gauge of the battery: the charge used so far, which BATTERY_RESET sets.

The gauge counts apart from the battery itself: a reset changes what is reported and what failsafes and arming
checks decide by, not the cells.
"""

from __future__ import annotations

from volery.simulation.autopilots.mavlink.messages import ACCEPTED, DENIED, Command
from volery.simulation.autopilots.vehicle_state import Vehicle

FIRST_BATTERY = 1
"""Bit of the only battery in the mask of BATTERY_RESET."""
LARGEST_MASK = 0xFFFF


def used_mah(vehicle: Vehicle) -> float:
    """Return the charge [mAh] used by the gauge."""
    return vehicle.estimate.battery_used_mah + vehicle.reports.gauge_offset_mah


def left_mah(vehicle: Vehicle) -> float:
    """Return the charge [mAh] left of BATT_CAPACITY; negative once more than that has been used."""
    return vehicle.parameters["BATT_CAPACITY"] - used_mah(vehicle)


def on_battery_reset(vehicle: Vehicle, command: Command) -> int:
    """Handle BATTERY_RESET: param1 is a mask of batteries, param2 the charge left [%], limited to 0..100."""
    if not 0.0 <= command.param1 <= LARGEST_MASK:
        return DENIED
    if round(command.param1) & FIRST_BATTERY:
        left = min(100.0, max(0.0, command.param2)) / 100.0
        used = vehicle.parameters["BATT_CAPACITY"] * (1.0 - left)
        vehicle.reports.gauge_offset_mah = used - vehicle.estimate.battery_used_mah
    return ACCEPTED

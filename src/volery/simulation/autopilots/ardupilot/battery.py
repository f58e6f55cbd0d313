"""ArduPilot's gauge of the battery: what it reports, and the charge used so far, which BATTERY_RESET sets.

The gauge counts apart from the battery itself: a reset changes what is reported and what failsafes and arming
checks decide by, not the cells.
"""

from __future__ import annotations

from volery.base.time import S
from volery.simulation.autopilots.mavlink.messages import (
    ACCEPTED,
    DENIED,
    Command,
    Fields,
    to_int16,
    to_uint16,
)
from volery.simulation.autopilots.vehicle_state import AutopilotVehicle

FIRST_BATTERY = 1
"""Bit of the only battery in the mask of BATTERY_RESET."""
LARGEST_MASK = 0xFFFF
NOT_THERE = 65_535
"""Voltage of a cell that is not there."""

MEASURED_AFTER = int(2.4 * S)
"""Uptime [ns] from which battery and compass are read and the copter's terrain follower runs."""


def used_mah(vehicle: AutopilotVehicle) -> float:
    """Return the charge [mAh] used by the gauge."""
    return vehicle.estimate.battery_used_mah + vehicle.reports.gauge_offset_mah


def left_mah(vehicle: AutopilotVehicle) -> float:
    """Return the charge [mAh] left of BATT_CAPACITY; negative once more than that has been used."""
    return vehicle.parameters["BATT_CAPACITY"] - used_mah(vehicle)


def on_battery_reset(vehicle: AutopilotVehicle, command: Command) -> int:
    """Handle BATTERY_RESET: param1 is a mask of batteries, param2 the charge left [%], limited to 0..100."""
    if not 0.0 <= command.param1 <= LARGEST_MASK:
        return DENIED
    if round(command.param1) & FIRST_BATTERY:
        left = min(100.0, max(0.0, command.param2)) / 100.0
        used = vehicle.parameters["BATT_CAPACITY"] * (1.0 - left)
        vehicle.reports.gauge_offset_mah = used - vehicle.estimate.battery_used_mah
    return ACCEPTED


def gauge(vehicle: AutopilotVehicle) -> tuple[int, int, int]:
    """Return voltage [mV], current [cA] and remaining charge [%]; -1 where unknown."""
    if vehicle.uptime() < MEASURED_AFTER:
        return 0, -1, -1
    estimate = vehicle.estimate
    capacity = vehicle.parameters["BATT_CAPACITY"]
    left = 1.0 - used_mah(vehicle) / capacity if capacity > 0.0 else 0.0
    return (
        to_uint16(estimate.battery_volts * 1000.0),
        to_int16(estimate.battery_amps * 100.0),
        int(max(0.0, left) * 100.0),
    )


def battery_status(vehicle: AutopilotVehicle) -> Fields:
    """Return BATTERY_STATUS."""
    volts, amps, left = gauge(vehicle)
    estimate = vehicle.estimate
    return {
        "id": 0,
        "temperature": 32_767,
        "voltages": (volts or NOT_THERE, *([NOT_THERE] * 9)),
        "current_battery": max(0, amps),
        "current_consumed": int(used_mah(vehicle)),
        "energy_consumed": int(estimate.battery_energy_j / 100.0),
        "battery_remaining": left,
        "charge_state": _charge_state(vehicle),
    }


CHARGE_OK, CHARGE_LOW, CHARGE_CRITICAL = 1, 2, 3
"""MAV_BATTERY_CHARGE_STATE."""


def _charge_state(vehicle: AutopilotVehicle) -> int:
    """Return the level that the failsafes of the battery have found."""
    active = vehicle.failsafes.active
    if "battery critical" in active:
        return CHARGE_CRITICAL
    return CHARGE_LOW if "battery low" in active else CHARGE_OK

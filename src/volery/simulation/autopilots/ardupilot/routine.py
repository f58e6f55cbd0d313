"""What copter and rover do alike by themselves: once there is a position, and each second."""

from __future__ import annotations

from collections.abc import Callable

from volery.base.time import S
from volery.simulation.autopilots.ardupilot import boot
from volery.simulation.autopilots.ardupilot.arming import look_before_arming
from volery.simulation.autopilots.vehicle_state import Vehicle

STORE_COUNTERS_EVERY = 30 * S

Problems = Callable[[Vehicle], list[str]]
"""What speaks against arming, in the firmware's words."""


def on_position(vehicle: Vehicle, before_arming: Problems) -> None:
    """There is a home, and nothing speaks against arming."""
    boot.home_set(vehicle)
    vehicle.prearm_ok = not before_arming(vehicle)


def each_second(vehicle: Vehicle, before_arming: Problems) -> None:
    """Readiness, and the counters of hours."""
    if vehicle.uptime() < vehicle.firmware.ready_after:
        return
    look_before_arming(vehicle, before_arming)
    if vehicle.uptime() - vehicle.counted_at >= STORE_COUNTERS_EVERY:
        vehicle.counted_at = vehicle.uptime()
        if vehicle.flight_time:
            vehicle.set_parameter("STAT_FLTTIME", vehicle.flight_time // S)
        vehicle.set_parameter("STAT_RUNTIME", vehicle.uptime() // S)

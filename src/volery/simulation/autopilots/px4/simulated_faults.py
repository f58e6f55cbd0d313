"""Faults that PX4's own simulator injects: SIM_GPS_USED, SIM_BAT_DRAIN, SIM_BAT_MIN_PCT, INJECT_FAILURE.

As ``SensorGpsSim`` and ``BatterySimulator`` of 1.14.0 and 1.17.0. Other parameters of that simulator are
refused. With both SIM_BAT parameters at their defaults the battery of the model counts.
"""

from __future__ import annotations

from volery.base.elementary import exp
from volery.base.time import Ns, to_seconds
from volery.simulation.autopilots.state_groups import NEVER
from volery.simulation.autopilots.vehicle_state import AutopilotVehicle

LEAST_SATELLITES = 4
"""With fewer the receiver has no fix."""

USUAL_DRAIN_S, USUAL_LEAST_PERCENT = 60.0, 50.0
"""Defaults of SIM_BAT_DRAIN and SIM_BAT_MIN_PCT."""

EMPTIES_IN_S = 1.0
"""Time constant with which the filtered voltage follows an empty battery: recorded 1.2 s to the low, 2.0 s to
the critical level.
"""

ALMOST_EMPTY = 0.02
"""Charge at which an emptied battery is left: the motors go on turning, as in the original."""


class FaultInjector:
    """Injects faults into one vehicle; ``step`` is called at each tick."""

    def __init__(self, vehicle: AutopilotVehicle) -> None:
        self._vehicle = vehicle
        self.emptied = False
        """Whether the battery is empty by INJECT_FAILURE."""
        self._blocked = False
        self._charge: float | None = None
        """Charge before the battery was drained, 0..1; ``None``: it was not."""
        self._stepped_at: Ns = NEVER

    def step(self) -> None:
        """Block the receiver and drain the battery, as the parameters and the commands say."""
        vehicle, now = self._vehicle, self._vehicle.kernel.now()
        passed = 0.0 if self._stepped_at == NEVER else to_seconds(now - self._stepped_at)
        self._stepped_at = now
        p = vehicle.parameters
        blocked = p["SIM_GPS_USED"] < LEAST_SATELLITES
        if blocked != self._blocked:
            self._blocked = blocked
            vehicle.flight.block_gps(blocked)
        drain, least = p["SIM_BAT_DRAIN"], p["SIM_BAT_MIN_PCT"]
        drains = vehicle.armed and (drain, least) != (USUAL_DRAIN_S, USUAL_LEAST_PERCENT)
        left = vehicle.estimate.battery_left
        if not (self.emptied or drains):
            if self._charge is not None:
                vehicle.flight.set_charge(self._charge)
                self._charge = None
            return
        if self._charge is None:
            self._charge = left
        if self.emptied:
            wanted = max(ALMOST_EMPTY, left * exp(-passed / EMPTIES_IN_S))
        else:
            armed_for = to_seconds(now - vehicle.arming.armed_at)
            share = 1.0 - armed_for / max(1.0, drain)
            wanted = min(self._charge, max(ALMOST_EMPTY, least / 100.0, share))
        vehicle.flight.set_charge(wanted)

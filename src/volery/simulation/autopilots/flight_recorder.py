"""What a simulated autopilot records while it is armed, for the logs that a ground station downloads.

Five samples a second are kept as numbers; a firmware encodes them in its own format when a log is requested,
so that a flight whose log is never read costs next to nothing. Logs persist over a reboot, as on a card.
"""

from __future__ import annotations

from volery.base.time import US
from volery.simulation.autopilots.onboard_log import SAMPLE, FlightLog
from volery.simulation.autopilots.vehicle_state import AutopilotVehicle

EACH = 2
"""One tick of the autopilot in so many is recorded."""
MOST_SAMPLES, MOST_LOGS = 18_000, 8
"""Samples of a log, an hour: a longer flight goes on in another one. Logs that are kept; the oldest go."""


class FlightRecorder:
    """Records the flights of one vehicle.

    Args:
        vehicle: The vehicle.
    """

    def __init__(self, vehicle: AutopilotVehicle) -> None:
        self._vehicle = vehicle
        self._open: FlightLog | None = None
        self._ticks = 0

    def on_tick(self) -> None:
        """Record a sample if one is due; called at each tick of the autopilot."""
        vehicle = self._vehicle
        if self._open is not None and (not vehicle.armed or len(self._open.extras) >= MOST_SAMPLES):
            vehicle.logs.append(self._open)
            del vehicle.logs[:-MOST_LOGS]
            self._open = None
        if not vehicle.armed:
            return
        if self._open is None:
            self._open = self._begin()
        if self._ticks % EACH == 0:
            self._open.values += self._sample()
            self._open.extras.append(self._vehicle.rules.log_extras(self._vehicle))
        self._ticks += 1

    def _begin(self) -> FlightLog:
        vehicle = self._vehicle
        self._ticks = 0
        return FlightLog(
            vehicle.kernel.now(),
            vehicle.flies,
            vehicle.estimate.origin,
            vehicle.home.ned[2] if vehicle.home else 0.0,
            tuple(vehicle.parameters),
        )

    def _sample(self) -> bytes:
        """Return the values of a ``LogSample``."""
        vehicle = self._vehicle
        estimate = vehicle.estimate
        north, east, down = estimate.position
        v_north, v_east, v_down = estimate.velocity
        roll, pitch, yaw = estimate.attitude
        roll_rate, pitch_rate, yaw_rate = estimate.rates
        latitude, longitude, amsl = estimate.geodetic
        return SAMPLE.pack(
            vehicle.uptime() / US,
            vehicle.mode.number,
            north,
            east,
            down,
            v_north,
            v_east,
            v_down,
            roll,
            pitch,
            yaw,
            roll_rate,
            pitch_rate,
            yaw_rate,
            estimate.battery_volts,
            estimate.battery_amps,
            estimate.battery_used_mah,
            estimate.battery_left,
            estimate.fix_type,
            estimate.satellites,
            min(estimate.horizontal_dilution, 99.99),
            latitude,
            longitude,
            amsl,
        )

"""Home's altitude after a take-off, corrected by the satellite receiver: PX4 1.17 and newer.

For two minutes after each take-off the altitude by the barometer is compared with the receiver's and with the
receiver's vertical velocity, integrated. Where barometer and integral agree better with each other than
either does with the receiver's altitude, home is moved by the difference, if that is more than 1 m. The noise
of the receiver moves it again and again: recorded by up to 1.5 m, up to twice a second. Source: PX4 1.17.0,
``HomePosition::update``.
"""

from __future__ import annotations

from volery.base.time import Ns, S, to_seconds
from volery.simulation.autopilots.state_groups import NEVER
from volery.simulation.autopilots.vehicle_state import AutopilotVehicle

WINDOW: Ns = 120 * S
"""Time after a take-off for which home is corrected."""

BARO_FILTER_S = 5.0
"""Time constant of the barometer's altitude [s]."""

LEAST_M = 1.0
"""Differences up to that are left [m]."""

GOOD_FIX = 2
"""Least GPS_FIX_TYPE that counts."""

MOST_EPH, MOST_EPV, MOST_SPEED_ERROR = 5.0, 10.0, 1.0
"""What a fix must be better than [m, m, m/s]."""


class HomeCorrection:
    """Corrects the home position of one vehicle; ``step`` is called at each tick."""

    def __init__(self, vehicle: AutopilotVehicle) -> None:
        self._vehicle = vehicle
        self._baro = 0.0
        self._baro_at: Ns = NEVER
        self._fix = -1
        self._fix_at: Ns = NEVER
        self._integral: float | None = None
        """Altitude by the receiver's vertical velocity [m AMSL]."""
        self._baro_offset = 0.0
        self._applied = 0.0
        """By how much home's altitude was below the receiver's when it was last corrected [m]."""

    def step(self, taken_off_at: Ns) -> None:
        """Take in barometer and receiver, and correct home if it is due.

        Args:
            taken_off_at: Time of the last take-off, or ``NEVER``.
        """
        vehicle, now = self._vehicle, self._vehicle.kernel.now()
        estimate = vehicle.estimate
        if self._baro_at == NEVER:
            self._baro = estimate.baro_altitude
        else:
            passed = to_seconds(now - self._baro_at)
            self._baro += (estimate.baro_altitude - self._baro) * passed / (passed + BARO_FILTER_S)
        self._baro_at = now
        fix = estimate.gps
        if fix.count == self._fix:
            return
        passed = 0.0 if self._fix_at == NEVER else to_seconds(now - self._fix_at)
        self._fix, self._fix_at = fix.count, now
        good = fix.fix_type >= GOOD_FIX and fix.eph < MOST_EPH and fix.epv < MOST_EPV
        due = taken_off_at != NEVER and now < taken_off_at + WINDOW
        if not (good and fix.speed_acc < MOST_SPEED_ERROR and due):
            self._integral = None
            return
        if self._integral is None:
            self._integral, self._baro_offset = fix.amsl, fix.amsl - self._baro
        self._integral -= fix.velocity[2] * passed
        self._correct(fix.amsl, self._baro + self._baro_offset, self._integral)

    def _correct(self, receiver: float, baro: float, integral: float) -> None:
        """Move home if barometer and integral agree on another altitude than the receiver's [m AMSL]."""
        with_offset = receiver + self._applied
        apart = abs(baro - integral)
        if apart >= abs(baro - with_offset) or apart >= abs(integral - with_offset):
            return
        difference = baro - with_offset
        home = self._vehicle.home
        if home is None or abs(difference) <= LEAST_M:
            return
        self._vehicle.set_home(home.latitude, home.longitude, home.amsl - difference)
        self._applied = baro - receiver

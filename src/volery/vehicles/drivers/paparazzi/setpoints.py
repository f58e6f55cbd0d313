"""What has to be repeated to a Paparazzi: sticks, since it misses its transmitter; velocities, since one may
be lost on the way, and the last would stand for ever.
"""

from __future__ import annotations

from math import radians

from volery.base.time import MS, Ns
from volery.kernel.api import Kernel
from volery.vehicles.driver import Sticks
from volery.vehicles.drivers import setpoints
from volery.vehicles.drivers.paparazzi.modes import GUIDED
from volery.vehicles.drivers.paparazzi.uplink import BY_VELOCITY, Setpoint, Uplink
from volery.vehicles.telemetry import Velocity

STICKS_PERIOD: Ns = 100 * MS
VELOCITY_PERIOD: Ns = 250 * MS

STILL = Setpoint(0.0, 0.0, 0.0, 0.0, BY_VELOCITY)


class Setpoints(setpoints.Setpoints):
    """In GUIDED, and in the modes that were asked for."""

    def __init__(self, kernel: Kernel, uplink: Uplink) -> None:
        super().__init__(
            kernel, uplink.telemetry, GUIDED, velocity_period=VELOCITY_PERIOD, sticks_period=STICKS_PERIOD
        )
        self._uplink = uplink

    def stand_still(self) -> None:
        """A velocity of zero, once."""
        self._uplink.setpoint(STILL)

    def move(self, velocity: Velocity, yaw_rate: float) -> None:
        """A velocity and a turn rate, once."""
        north, east, up = velocity
        self._uplink.setpoint(Setpoint(north, east, -up, radians(yaw_rate), BY_VELOCITY))

    def asked_for(self, mode: str) -> bool:
        """One of ours."""
        return mode in self._uplink.hearing.ours

    def send(self, sticks: Sticks) -> None:
        """As a transmitter's."""
        self._uplink.sticks(sticks)

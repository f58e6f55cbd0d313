"""What has to be repeated: sticks, since an aircraft misses its transmitter; velocities, since one may be
lost on the way, and the last would stand for ever.
"""

from __future__ import annotations

from math import radians

from volery.base.time import MS, Ns
from volery.drivers.following import Following
from volery.drivers.paparazzi.modes import GUIDED
from volery.drivers.paparazzi.uplink import BY_VELOCITY, Setpoint, Uplink
from volery.kernel.api import Handle, Kernel
from volery.vehicles.driver import Sticks
from volery.vehicles.telemetry import Velocity

STICKS_PERIOD: Ns = 100 * MS
VELOCITY_PERIOD: Ns = 250 * MS

STILL = Setpoint(0.0, 0.0, 0.0, 0.0, BY_VELOCITY)


class Setpoints:
    """Repeats one velocity for as long as it is to last, and sticks for as long as the mode is ours."""

    def __init__(self, kernel: Kernel, uplink: Uplink) -> None:
        self.held: Sticks | None = None
        self._kernel = kernel
        self._uplink = uplink
        self._refresh: Handle | None = None
        self._following = Following(kernel, uplink.telemetry, GUIDED, VELOCITY_PERIOD)

    # -- velocity

    def stand_still(self) -> None:
        """A velocity of zero, once."""
        self._uplink.setpoint(STILL)

    def follow(self, velocity: Velocity, yaw_rate: float, lasting: Ns) -> None:
        """From now on for so long; then stop."""
        north, east, up = velocity
        wanted = Setpoint(north, east, -up, radians(yaw_rate), BY_VELOCITY)
        self._following.begin(lambda: self._uplink.setpoint(wanted), self.stand_still, lasting)

    def unfollow(self) -> None:
        """No velocity is repeated any more."""
        self._following.end()

    # -- sticks

    def hold(self, sticks: Sticks) -> None:
        """Keep sending these."""
        self.held = sticks
        if self._refresh is None:
            self._refresh = self._kernel.every(STICKS_PERIOD, self._send_sticks)

    def hold_any(self) -> None:
        """Sticks that were never set are in the middle in the air, and idle on the ground."""
        if self.held is None:
            self.hold(Sticks() if self._uplink.telemetry.flying else Sticks(throttle=0.0))

    def release(self) -> None:
        """No transmitter any more."""
        if self._refresh is not None:
            self._refresh.cancel()
            self._refresh = None
        self.held = None

    def _send_sticks(self) -> None:
        seen = self._uplink.telemetry
        if seen.flying and seen.mode not in self._uplink.hearing.ours | {GUIDED}:
            self.release()  # somebody else flies it now, by their own sticks
        elif self.held is not None:
            self._uplink.sticks(self.held)

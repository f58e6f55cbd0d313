"""What has to be said again and again: sticks, since an autopilot misses its transmitter; velocities, since
one may be lost on the way, and some autopilots forget the last while others never do.
"""

from __future__ import annotations

from abc import ABC, abstractmethod

from volery.base.time import Ns
from volery.kernel.api import Handle, Kernel
from volery.vehicles.driver import Repeat, Step, Sticks
from volery.vehicles.drivers.arrival import standing
from volery.vehicles.drivers.following import Following
from volery.vehicles.drivers.steps import STOPPED_WITHIN
from volery.vehicles.telemetry import Telemetry, Velocity


class Setpoints(ABC):
    """Repeats one velocity for as long as it is to last, in *mode*, and sticks for as long as the mode is
    ours.
    """

    def __init__(
        self, kernel: Kernel, telemetry: Telemetry, mode: str, *, velocity_period: Ns, sticks_period: Ns
    ) -> None:
        self.held: Sticks | None = None
        self._kernel = kernel
        self._seen = telemetry
        self._mode = mode
        self._velocity_period, self._sticks_period = velocity_period, sticks_period
        self._following = Following(kernel, telemetry, mode, velocity_period)
        self._refresh: Handle | None = None

    # -- said by each autopilot's own

    @abstractmethod
    def stand_still(self) -> None:
        """A velocity of zero, once."""

    @abstractmethod
    def move(self, velocity: Velocity, yaw_rate: float) -> None:
        """A velocity [m/s] and a turn rate [degrees/s], once."""

    @abstractmethod
    def send(self, sticks: Sticks) -> None:
        """Sticks, once."""

    @abstractmethod
    def asked_for(self, mode: str) -> bool:
        """Whether *mode* is one that was commanded."""

    # -- velocity

    def follow(self, velocity: Velocity, yaw_rate: float, lasting: Ns) -> None:
        """From now on for so long; then stop."""
        self._following.begin(lambda: self.move(velocity, yaw_rate), self.stand_still, lasting)

    def unfollow(self) -> None:
        """No velocity is repeated any more."""
        self._following.end()

    def braking(self) -> Step:
        """No velocity, until it stands."""
        return Step(
            ask="stop",
            send=self.stand_still,
            done=standing,
            within=STOPPED_WITHIN,
            keep=Repeat(self._velocity_period, self.stand_still),
            mode=self._mode,
            armed=True,
        )

    # -- sticks

    def take(self, sticks: Sticks | None) -> None:
        """Keep sending these; ``None`` lets go of them."""
        if sticks is None:
            self.release()
        else:
            self.hold(sticks)

    def hold(self, sticks: Sticks) -> None:
        """Keep sending these."""
        self.held = sticks
        if self._refresh is None:
            self._refresh = self._kernel.every(self._sticks_period, self._send_sticks)

    def hold_any(self) -> None:
        """Sticks that were never set are in the middle in the air, and idle on the ground."""
        if self.held is None:
            self.hold(Sticks() if self._seen.flying else Sticks(throttle=0.0))

    def release(self) -> None:
        """Let go of the sticks."""
        if self._refresh is not None:
            self._refresh.cancel()
            self._refresh = None
        self.held = None

    def _send_sticks(self) -> None:
        seen = self._seen
        if seen.flying and seen.mode != self._mode and not self.asked_for(seen.mode):
            self.release()  # somebody else flies it now, by their own sticks
        elif self.held is not None:
            self.send(self.held)

    def end(self) -> None:
        """No set-point and no stick is repeated any more."""
        self.unfollow()
        self.release()

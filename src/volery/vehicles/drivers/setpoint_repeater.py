"""A velocity that is repeated for as long as it is to last: one message may be lost, and some autopilots
forget it, others never do.

What has to be said again and again: sticks, since an autopilot misses its transmitter; velocities, since
one may be lost on the way, and some autopilots forget the last while others never do.
"""

from __future__ import annotations

from abc import ABC, abstractmethod

from volery.base.time import Ns
from volery.kernel.api import Action, Handle, Kernel
from volery.vehicles.driver import ManualControl, Repeat, Step
from volery.vehicles.drivers.steps import STOPPED_WITHIN, at_rest
from volery.vehicles.telemetry import Telemetry, Velocity


class VelocityRepeater:
    """Each *period*, as long as the vehicle is in *mode*: in another one it is somebody else's."""

    def __init__(self, kernel: Kernel, telemetry: Telemetry, mode: str, period: Ns) -> None:
        self._kernel = kernel
        self._seen = telemetry
        self._mode = mode
        self._period = period
        self._handle: Handle | None = None

    def begin(self, say: Action, stop: Action, lasting: Ns) -> None:
        """*say* it from now on for so long; then *stop*, once."""
        self.end()
        until = self._kernel.now() + lasting

        def repeat() -> None:
            if self._seen.mode != self._mode:
                self.end()
            elif self._kernel.now() < until:
                say()
            else:
                self.end()
                stop()

        self._handle = self._kernel.every(self._period, repeat)

    def end(self) -> None:
        """It is not repeated any more."""
        if self._handle is not None:
            self._handle.cancel()
            self._handle = None


class SetpointRepeater(ABC):
    """Repeats one velocity for as long as it is to last, in *mode*, and sticks for as long as the mode is
    ours.
    """

    def __init__(
        self, kernel: Kernel, telemetry: Telemetry, mode: str, *, velocity_period: Ns, sticks_period: Ns
    ) -> None:
        self.held: ManualControl | None = None
        self._kernel = kernel
        self._seen = telemetry
        self._mode = mode
        self._velocity_period, self._sticks_period = velocity_period, sticks_period
        self._following = VelocityRepeater(kernel, telemetry, mode, velocity_period)
        self._refresh: Handle | None = None

    # -- said by each autopilot's own

    @abstractmethod
    def stand_still(self) -> None:
        """A velocity of zero, once."""

    @abstractmethod
    def move(self, velocity: Velocity, yaw_rate: float) -> None:
        """A velocity [m/s] and a turn rate [degrees/s], once."""

    @abstractmethod
    def send(self, sticks: ManualControl) -> None:
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
            done=at_rest,
            within=STOPPED_WITHIN,
            keep=Repeat(self._velocity_period, self.stand_still),
            mode=self._mode,
            armed=True,
        )

    # -- sticks

    def take(self, sticks: ManualControl | None) -> None:
        """Keep sending these; ``None`` lets go of them."""
        if sticks is None:
            self.release()
        else:
            self.hold(sticks)

    def hold(self, sticks: ManualControl) -> None:
        """Keep sending these."""
        self.held = sticks
        if self._refresh is None:
            self._refresh = self._kernel.every(self._sticks_period, self._send_sticks)

    def hold_any(self) -> None:
        """Sticks that were never set are in the middle in the air, and idle on the ground."""
        if self.held is None:
            self.hold(ManualControl() if self._seen.flying else ManualControl(throttle=0.0))

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

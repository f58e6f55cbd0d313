"""What an autopilot forgets unless it is repeated: sticks, and velocities."""

from __future__ import annotations

from volery.base.time import MS, Ns
from volery.drivers.ardupilot.commands import RELEASED, Commands
from volery.drivers.ardupilot.modes import GUIDED
from volery.drivers.arrival import DRONE_KIND
from volery.drivers.following import Following
from volery.kernel.api import Handle, Kernel
from volery.vehicles.driver import Sticks
from volery.vehicles.telemetry import Velocity

STICKS_PERIOD: Ns = 200 * MS
VELOCITY_PERIOD: Ns = 200 * MS

STILL = Velocity(0.0, 0.0, 0.0)


class Setpoints:
    """Repeats one velocity for as long as it is to last, and sticks for as long as the mode is ours.

    Where the carrier has a cycle nothing is repeated here: the node's own loop does that.
    """

    def __init__(self, kernel: Kernel, commands: Commands) -> None:
        self.held: Sticks | None = None
        self.asked_mode = ""
        self._kernel = kernel
        self._commands = commands
        self._telemetry = commands.telemetry
        self._refresh: Handle | None = None
        self._following = Following(kernel, commands.telemetry, GUIDED, VELOCITY_PERIOD)

    # -- velocity

    def stand_still(self) -> None:
        """A velocity of zero, once."""
        self._commands.follow(STILL, 0.0)

    def follow(self, velocity: Velocity, yaw_rate: float, lasting: Ns) -> None:
        """From now on for so long; then stop."""
        if self._commands.cycle is not None:
            self._commands.follow(velocity, yaw_rate)
        else:
            self._following.begin(
                lambda: self._commands.follow(velocity, yaw_rate), self.stand_still, lasting
            )

    def unfollow(self) -> None:
        """No velocity is repeated any more."""
        self._following.end()

    # -- sticks

    def hold(self, sticks: Sticks) -> None:
        """Keep sending these."""
        self.held = sticks
        self._send_sticks()
        if self._refresh is None and self._commands.cycle is None and self.held is not None:
            self._refresh = self._kernel.every(STICKS_PERIOD, self._send_sticks)

    def hold_any(self) -> None:
        """Sticks that were never set are in the middle in the air, and idle on the ground."""
        if self.held is None:
            self.hold(Sticks() if self._telemetry.flying else Sticks(throttle=0.0))

    def release(self) -> None:
        """Give the sticks back to the transmitter."""
        if self._refresh is not None:
            self._refresh.cancel()
            self._refresh = None
        if self.held is not None:
            rover = self._telemetry.kind != DRONE_KIND
            self._commands.override([RELEASED, None, RELEASED, None] if rover else [RELEASED] * 4)
        self.held = None

    def _send_sticks(self) -> None:
        seen = self._telemetry
        if seen.flying and seen.mode not in {self.asked_mode, GUIDED}:
            self.release()  # somebody else flies it now, by their own sticks
        elif self.held is not None:
            self._commands.override(channels(self.held, seen.kind))


def channels(sticks: Sticks, kind: str) -> list[int | None]:
    """Pulse widths in microseconds of channels 1 to 4: roll, pitch, throttle, yaw; forward is a low pitch."""
    if kind == DRONE_KIND:
        return [
            round(1500 + 500 * sticks.roll),
            round(1500 - 500 * sticks.pitch),
            round(1000 + 1000 * sticks.throttle),
            round(1500 + 500 * sticks.yaw),
        ]
    return [round(1500 + 500 * sticks.roll), None, round(1500 + 500 * sticks.throttle), None]

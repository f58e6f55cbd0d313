"""What an ArduPilot forgets unless it is repeated: sticks, and velocities."""

from __future__ import annotations

from volery.base.time import MS, Ns
from volery.kernel.api import Kernel
from volery.vehicles.driver import ManualControl
from volery.vehicles.drivers import setpoint_repeater
from volery.vehicles.drivers.ardupilot.backend import RELEASED, ArduPilotBackend
from volery.vehicles.drivers.ardupilot.modes import GUIDED
from volery.vehicles.drivers.steps import DRONE_KIND
from volery.vehicles.telemetry import Velocity

STICKS_PERIOD: Ns = 200 * MS
VELOCITY_PERIOD: Ns = 200 * MS

STILL = Velocity(0.0, 0.0, 0.0)


class ArduPilotSetpoints(setpoint_repeater.SetpointRepeater):
    """In GUIDED, and in the mode that was asked for last.

    Where the carrier has a cycle nothing is repeated here: the node's own loop does that.
    """

    def __init__(self, kernel: Kernel, commands: ArduPilotBackend) -> None:
        super().__init__(
            kernel,
            commands.telemetry,
            GUIDED,
            velocity_period=VELOCITY_PERIOD,
            sticks_period=STICKS_PERIOD,
        )
        self.asked_mode = ""
        self._commands = commands

    # -- velocity

    def stand_still(self) -> None:
        """A velocity of zero, once."""
        self.move(STILL, 0.0)

    def move(self, velocity: Velocity, yaw_rate: float) -> None:
        """A velocity and a turn rate, once."""
        self._commands.follow(velocity, yaw_rate)

    def follow(self, velocity: Velocity, yaw_rate: float, lasting: Ns) -> None:
        """From now on for so long; then stop."""
        if self._commands.cycle is not None:
            self.move(velocity, yaw_rate)
        else:
            super().follow(velocity, yaw_rate, lasting)

    # -- sticks

    def hold(self, sticks: ManualControl) -> None:
        """Keep sending these, the first at once."""
        self.held = sticks
        self._send_sticks()
        if self._commands.cycle is None and self.held is not None:
            super().hold(sticks)

    def release(self) -> None:
        """Give the sticks back to the transmitter."""
        if self.held is not None:
            rover = self._seen.kind != DRONE_KIND
            self._commands.override([RELEASED, None, RELEASED, None] if rover else [RELEASED] * 4)
        super().release()

    def asked_for(self, mode: str) -> bool:
        """The last one."""
        return mode == self.asked_mode

    def send(self, sticks: ManualControl) -> None:
        """As pulses of its channels."""
        self._commands.override(channels(sticks, self._seen.kind))


def channels(sticks: ManualControl, kind: str) -> list[int | None]:
    """Pulse widths in microseconds of channels 1 to 4: roll, pitch, throttle, yaw; forward is a low pitch."""
    if kind == DRONE_KIND:
        return [
            round(1500 + 500 * sticks.roll),
            round(1500 - 500 * sticks.pitch),
            round(1000 + 1000 * sticks.throttle),
            round(1500 + 500 * sticks.yaw),
        ]
    return [round(1500 + 500 * sticks.roll), None, round(1500 + 500 * sticks.throttle), None]

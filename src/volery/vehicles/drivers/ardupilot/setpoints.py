"""Velocities and manual control that must be repeated to an ArduPilot."""

from __future__ import annotations

from volery.base.time import MS, Ns
from volery.kernel.api import Kernel
from volery.vehicles.driver import ManualControl
from volery.vehicles.drivers.ardupilot.backend import RELEASED, ArduPilotBackend
from volery.vehicles.drivers.ardupilot.modes import GUIDED
from volery.vehicles.drivers.setpoint_repeater import SetpointRepeater
from volery.vehicles.drivers.steps import DRONE_KIND
from volery.vehicles.telemetry import Velocity

CONTROL_PERIOD: Ns = 200 * MS
VELOCITY_PERIOD: Ns = 200 * MS

STILL = Velocity(0.0, 0.0, 0.0)


class ArduPilotSetpoints(SetpointRepeater):
    """Repeats velocities in GUIDED, and manual control in GUIDED and in the mode commanded last.

    With a backend that has a cycle nothing is repeated here: the node's own loop does that.
    """

    def __init__(self, kernel: Kernel, backend: ArduPilotBackend) -> None:
        super().__init__(
            kernel,
            backend.telemetry,
            GUIDED,
            velocity_period=VELOCITY_PERIOD,
            control_period=CONTROL_PERIOD,
        )
        self.commanded_mode = ""
        self._backend = backend

    # -- velocity

    def send_velocity(self, velocity: Velocity, yaw_rate: float) -> None:
        """Send a velocity and a turn rate once."""
        self._backend.send_velocity(velocity, yaw_rate)

    def send_stop(self) -> None:
        """Send a velocity of zero once."""
        self._backend.send_velocity(STILL, 0.0)

    def follow(self, velocity: Velocity, yaw_rate: float, lasting: Ns) -> None:
        """Repeat a velocity for *lasting*, then stop."""
        if self._backend.cycle is not None:
            self._backend.send_velocity(velocity, yaw_rate)
        else:
            super().follow(velocity, yaw_rate, lasting)

    # -- manual control

    def hold(self, control: ManualControl) -> None:
        """Send *control* at once and repeat it."""
        self.held = control
        self._repeat_control()
        if self._backend.cycle is None and self.held is not None:
            super().hold(control)

    def release(self) -> None:
        """Give the channels back to the transmitter and stop repeating."""
        if self.held is not None:
            rover = self._telemetry.kind != DRONE_KIND
            self._backend.override_channels([RELEASED, None, RELEASED, None] if rover else [RELEASED] * 4)
        super().release()

    def is_commanded(self, mode: str) -> bool:
        """Return whether *mode* is the one commanded last."""
        return mode == self.commanded_mode

    def send_control(self, control: ManualControl) -> None:
        """Send manual control as pulse widths of RC channels."""
        self._backend.override_channels(rc_channels(control, self._telemetry.kind))


def rc_channels(control: ManualControl, kind: str) -> list[int | None]:
    """Return pulse widths in µs of channels 1 to 4: roll, pitch, throttle, yaw; forward is a low pitch."""
    if kind == DRONE_KIND:
        return [
            round(1500 + 500 * control.roll),
            round(1500 - 500 * control.pitch),
            round(1000 + 1000 * control.throttle),
            round(1500 + 500 * control.yaw),
        ]
    return [round(1500 + 500 * control.roll), None, round(1500 + 500 * control.throttle), None]

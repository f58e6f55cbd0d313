"""Repetition of velocities and manual control.

An autopilot treats missing manual control as the loss of its transmitter; a single velocity may be lost on
the way, and some autopilots forget the last one while others follow it without end.
"""

from __future__ import annotations

from abc import ABC, abstractmethod

from volery.base.time import Ns
from volery.kernel.api import Handle, Kernel
from volery.vehicles.driver import ManualControl, Repeat, Step
from volery.vehicles.drivers.steps import STOPPED_WITHIN, at_rest
from volery.vehicles.telemetry import Telemetry, Velocity


class SetpointRepeater(ABC):
    """Repeats one velocity while the vehicle is in *mode*, and manual control while the mode is ours.

    Args:
        kernel: clock.
        telemetry: telemetry of the vehicle.
        mode: mode in which the vehicle follows velocities; in another one another station has control.
        velocity_period: period of velocities, ns.
        control_period: period of manual control, ns.
    """

    def __init__(
        self, kernel: Kernel, telemetry: Telemetry, mode: str, *, velocity_period: Ns, control_period: Ns
    ) -> None:
        self.held: ManualControl | None = None
        self.following = False
        """Whether a velocity is repeated."""
        self._kernel = kernel
        self._telemetry = telemetry
        self._mode = mode
        self._velocity_period, self._control_period = velocity_period, control_period
        self._velocity_handle: Handle | None = None
        self._control_handle: Handle | None = None

    # -- what differs between autopilots

    @abstractmethod
    def send_velocity(self, velocity: Velocity, yaw_rate: float) -> None:
        """Send a velocity (m/s) and a turn rate (degrees/s, clockwise) once."""

    @abstractmethod
    def send_stop(self) -> None:
        """Send a velocity of zero once."""

    @abstractmethod
    def send_control(self, control: ManualControl) -> None:
        """Send manual control once."""

    def has_stopped(self) -> bool:
        """Return whether the end of a velocity need not be sent again: at once, where nothing is lost."""
        return True

    @abstractmethod
    def is_commanded(self, mode: str) -> bool:
        """Return whether this program commanded *mode*."""

    # -- velocity

    def follow(self, velocity: Velocity, yaw_rate: float, lasting: Ns) -> None:
        """Repeat a velocity for *lasting*, then a velocity of zero until the vehicle ``has_stopped``."""
        self.end_velocity()
        until = self._kernel.now() + lasting

        def repeat() -> None:
            if self._telemetry.mode != self._mode:
                self.end_velocity()
            elif self._kernel.now() < until:
                self.send_velocity(velocity, yaw_rate)
            else:
                self.send_stop()
                if self.has_stopped():
                    self.end_velocity()

        self.following = True
        self._velocity_handle = self._kernel.every(self._velocity_period, repeat)

    def end_velocity(self) -> None:
        """Stop repeating a velocity."""
        if self._velocity_handle is not None:
            self._velocity_handle.cancel()
            self._velocity_handle = None
            self.following = False

    def braking_step(self) -> Step:
        """Return a step that sends a velocity of zero until the vehicle is at rest."""
        return Step(
            ask="stop",
            send=self.send_stop,
            done=at_rest,
            within=STOPPED_WITHIN,
            keep=Repeat(self._velocity_period, self.send_stop),
            mode=self._mode,
            armed=True,
        )

    # -- manual control

    def set_control(self, control: ManualControl | None) -> None:
        """Repeat *control*; ``None`` ends the repetition."""
        if control is None:
            self.release()
        else:
            self.hold(control)

    def hold(self, control: ManualControl) -> None:
        """Repeat *control*."""
        self.held = control
        if self._control_handle is None:
            self._control_handle = self._kernel.every(self._control_period, self._repeat_control)

    def hold_any(self) -> None:
        """Repeat neutral control if none was ever set: centred in the air, idle throttle on the ground."""
        if self.held is None:
            self.hold(ManualControl() if self._telemetry.flying else ManualControl(throttle=0.0))

    def release(self) -> None:
        """Stop repeating manual control."""
        if self._control_handle is not None:
            self._control_handle.cancel()
            self._control_handle = None
        self.held = None

    def _repeat_control(self) -> None:
        telemetry = self._telemetry
        if telemetry.flying and telemetry.mode != self._mode and not self.is_commanded(telemetry.mode):
            self.release()  # another station or a pilot flies it now
        elif self.held is not None:
            self.send_control(self.held)

    def end(self) -> None:
        """Stop all repetition."""
        self.end_velocity()
        self.release()

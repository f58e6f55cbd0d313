"""Decoder of ArduPilot: mode names, and the state of its estimator."""

from __future__ import annotations

from volery.kernel.api import Kernel
from volery.vehicles.drivers.ardupilot.modes import RESTING, STOPPED, mode_name
from volery.vehicles.drivers.mavlink.decoder import Fields, TelemetryDecoder
from volery.vehicles.drivers.steps import DRONE_KIND
from volery.vehicles.telemetry import Telemetry


class ArduPilotDecoder(TelemetryDecoder):
    """Decodes ArduPilot's mode names and its estimator's EKF_STATUS_REPORT."""

    autopilot = "ArduPilot"
    resting = RESTING

    def __init__(self, kernel: Kernel, telemetry: Telemetry, *, record: bool = True) -> None:
        super().__init__(kernel, telemetry, record=record)
        self._handlers["EKF_STATUS_REPORT"] = self._estimator

    def _global_position(self, fields: Fields) -> None:
        """Decode the position if the estimator has one.

        Without one it sends where it was last, and as altitude 0 or a height above home that is not one: in a
        recording of ArduRover both jump by 584 m when the estimator takes over.
        """
        if self._estimates_position:
            super()._global_position(fields)
            return
        if self._telemetry.kind == DRONE_KIND:
            self._telemetry.above_home = fields["relative_alt"] / 1000.0
        self._heading(fields["hdg"])

    def _heartbeat(self, fields: Fields) -> None:
        """Decode a heartbeat. A failsafe that stopped it keeps it hovering until another command comes."""
        super()._heartbeat(fields)
        seen = self._telemetry
        seen.failsafe_lasts = seen.mode == STOPPED and (seen.failsafe or seen.failsafe_lasts)

    def _mode_name(self, number: int) -> str:
        return mode_name(self._telemetry.kind, number)

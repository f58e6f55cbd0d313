"""What an ArduPilot's messages say beyond those of every MAVLink autopilot."""

from __future__ import annotations

from volery.kernel.api import Kernel
from volery.vehicles.drivers.ardupilot.modes import mode_name
from volery.vehicles.drivers.mavlink import hearing
from volery.vehicles.telemetry import Telemetry


class Hearing(hearing.Hearing):
    """ArduPilot's mode names; its estimator speaks in EKF_STATUS_REPORT."""

    autopilot = "ArduPilot"
    resting = "HOLD"

    def __init__(self, kernel: Kernel, telemetry: Telemetry, *, record: bool = True) -> None:
        super().__init__(kernel, telemetry, record=record)
        self._handlers["EKF_STATUS_REPORT"] = self._estimator

    def _mode_name(self, number: int) -> str:
        return mode_name(self._seen.kind, number)

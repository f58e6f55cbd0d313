"""What a PX4's messages say beyond those of every MAVLink autopilot."""

from __future__ import annotations

from volery.kernel.api import Kernel
from volery.vehicles.drivers.mavlink import hearing
from volery.vehicles.drivers.mavlink.hearing import Fields
from volery.vehicles.drivers.px4.events import (
    NOT_FOR_PEOPLE,
    SAID,
    WITHOUT_TEXT,
    ArmingChecks,
    event_of,
    words_of,
)
from volery.vehicles.drivers.px4.modes import HOLD, mode_name
from volery.vehicles.telemetry import Telemetry

WARNING = 4


class Hearing(hearing.Hearing):
    """PX4's mode names, its estimator's ESTIMATOR_STATUS, and its events.

    PX4 says nearly all events as a text, too, as long as it hears a ground station; that text ends with a
    tabulator. So an event is said here only if it has no text, or is a warning that is not known here.
    """

    autopilot = "PX4"
    resting = HOLD

    def __init__(self, kernel: Kernel, telemetry: Telemetry, *, record: bool = True) -> None:
        super().__init__(kernel, telemetry, record=record)
        self._checks = ArmingChecks()
        self._estimator_heard = False
        self._handlers["ESTIMATOR_STATUS"] = self._estimator_status
        self._handlers["EVENT"] = self._event

    def _mode_name(self, number: int) -> str:
        return mode_name(number)

    def _judge_ready(self) -> None:
        """It flies to altitudes above home by its own home: without one it is not ready."""
        seen = self._seen
        placed = seen.position is not None and seen.home is not None
        seen.ready = seen.armable and placed and (self._estimates_position or not self._estimator_heard)

    def _estimator_status(self, fields: Fields) -> None:
        self._estimator_heard = True
        self._estimator(fields)

    def say(self, severity: int, text: str) -> None:
        """The autopilot says this."""
        super().say(severity, text.rstrip("\t"))

    def _event(self, fields: Fields) -> None:
        event = event_of(fields)
        if self._checks.hear(event) or event.severity >= NOT_FOR_PEOPLE:
            return
        unknown = event.id not in SAID and event.severity <= WARNING
        if event.id in WITHOUT_TEXT or unknown:
            self.say(event.severity, words_of(event.id))

    def say_failing_checks(self) -> None:
        """It refused to arm: PX4 says why in its last report, which may have come long before."""
        if not self._checks.reported:
            self.say(WARNING, "Arming check: not all are done yet")
        for reason in self._checks.reasons(self._seen.mode):
            self.say(WARNING, f"Arming check: {reason}")

"""Decoder of PX4: mode names, estimator status, events, and a home whose altitude is corrected."""

from __future__ import annotations

from collections.abc import Callable

from volery.base.position import AMSL, Position
from volery.base.time import Ns, S
from volery.kernel.api import Kernel
from volery.trace.events import WARNING
from volery.vehicles.drivers.mavlink.decoder import Fields, TelemetryDecoder
from volery.vehicles.drivers.px4.events import (
    KNOWN_EVENTS,
    REPORT_ENDS,
    WITHOUT_TEXT,
    EventTexts,
    FailingChecks,
    event_of,
)
from volery.vehicles.drivers.px4.modes import HOLD, mode_name
from volery.vehicles.drivers.px4.versions import HOME_ALTITUDE_CORRECTED, NO_HORIZONTAL_POSITION
from volery.vehicles.telemetry import SAME_HOME_UP_M, Telemetry

NOT_FOR_PEOPLE = 8
SEQUENCES = 65_536
KEPT_EVENTS = 20
"""Number of past events that are requested; those that PX4 keeps no longer are reported as errors."""
HOME_SMOOTHED_OVER: Ns = 10 * S
"""Time constant of home's altitude, which PX4 1.17 corrects up to four times a second by +-1.5 m of noise."""
ESTIMATOR_REPORTS_WITHIN: Ns = 3 * S
"""Time after which a PX4 that was asked for its estimator's status will not send it."""
EXPLAINS_WITHIN: Ns = S
"""Time after a refusal within which a report of the arming checks is its reason."""


class PX4Decoder(TelemetryDecoder):
    """Decodes PX4's mode names, ESTIMATOR_STATUS, and events.

    PX4 sends nearly all events also as a text, which ends with a tabulator, while it receives a ground
    station. So an event becomes a text here only if it has none, or is an unknown warning.
    """

    autopilot = "PX4"
    resting = HOLD

    def __init__(
        self,
        kernel: Kernel,
        telemetry: Telemetry,
        *,
        record: bool = True,
        request: Callable[[int, int], None] = lambda first, last: None,
        on_unknown: Callable[[], None] = lambda: None,
    ) -> None:
        super().__init__(kernel, telemetry, record=record)
        self._checks = FailingChecks()
        self._request = request  # requests events by their first and last sequence number
        self._on_unknown = on_unknown  # an event has arrived that has no text
        self._sequence: int | None = None  # of the newest event that was received or requested
        self._past: set[int] = set()  # requested events from before this program has connected
        self._explains_until: Ns = -1
        self._handlers["CURRENT_EVENT_SEQUENCE"] = lambda fields: self._request_missed(fields["sequence"])
        self._estimator_reports = False
        self._first_ns: Ns = -1  # first time that readiness was judged
        self._home_altitude: float | None = None  # smoothed, m AMSL, while PX4 corrects it
        self._home_altitude_ns: Ns = 0
        self._handlers["ESTIMATOR_STATUS"] = self._estimator_status
        self._handlers["EVENT"] = self._event

    def _mode_name(self, number: int) -> str:
        return mode_name(number)

    def _no_position(self) -> int:
        return NO_HORIZONTAL_POSITION.by(self._telemetry.version)

    def _global_position(self, fields: Fields) -> None:
        """Decode the position, with its height above a smoothed home while PX4 corrects that."""
        super()._global_position(fields)
        seen, now = self._telemetry, self._kernel.now()
        if not seen.flying or not HOME_ALTITUDE_CORRECTED.by(seen.version):
            self._home_altitude = None
            return
        reported = (fields["alt"] - fields["relative_alt"]) / 1000.0
        before = self._home_altitude
        if before is None or abs(reported - before) > SAME_HOME_UP_M:
            self._home_altitude = reported
        else:
            passed = now - self._home_altitude_ns
            self._home_altitude = before + (reported - before) * passed / (passed + HOME_SMOOTHED_OVER)
        self._home_altitude_ns = now
        seen.above_home = fields["alt"] / 1000.0 - self._home_altitude
        self._smooth_home()

    def _home_position(self, fields: Fields) -> None:
        super()._home_position(fields)
        self._smooth_home()

    def _smooth_home(self) -> None:
        """Let home have the altitude that the height is above, unless home was moved."""
        home, altitude = self._telemetry.home, self._home_altitude
        if home is None or altitude is None or abs(home.altitude.metres - altitude) > SAME_HOME_UP_M:
            return
        self._telemetry.home = Position(home.latitude, home.longitude, AMSL(altitude))

    def _update_ready(self) -> None:
        """Update ``ready``; where no estimator report comes, a reported position counts."""
        now = self._kernel.now()
        self._first_ns = now if self._first_ns < 0 else self._first_ns
        if not self._estimator_reports:
            self._estimates_position = now - self._first_ns >= ESTIMATOR_REPORTS_WITHIN
        super()._update_ready()

    def _estimator_status(self, fields: Fields) -> None:
        self._estimator_reports = True
        self._estimator(fields)

    def add_text(self, severity: int, text: str) -> None:
        """Add a text of the autopilot, without the final tabulator."""
        super().add_text(severity, text.rstrip("\t"))

    def set_event_texts(self, texts: EventTexts) -> None:
        """Show the vehicle's own texts of events from now on."""
        self._checks.texts = texts

    def _event(self, fields: Fields) -> None:
        event, sequence = event_of(fields), fields["sequence"]
        if not self._checks.knows(event):
            self._on_unknown()
        past = sequence in self._past
        self._past.discard(sequence)
        if not past:
            self._request_missed((sequence - 1) % SEQUENCES)
            self._sequence = sequence
        if self._checks.handle_event(event):
            if event.id == REPORT_ENDS and self._kernel.now() <= self._explains_until:
                self.add_failing_checks()
            return
        if past or event.severity >= NOT_FOR_PEOPLE:
            return
        unknown = event.id not in KNOWN_EVENTS and event.severity <= WARNING
        if event.id in WITHOUT_TEXT or unknown:
            self.add_text(event.severity, self._checks.text(event))

    def _request_missed(self, sequence: int) -> None:
        """Request the events up to *sequence* that were missed; at first those that PX4 still keeps.

        PX4 reports its arming checks when one of them changes, so one that runs already has reported them.
        """
        if self._sequence is None:
            first = (sequence - KEPT_EVENTS + 1) % SEQUENCES
            self._past = {(first + step) % SEQUENCES for step in range(KEPT_EVENTS)}
        else:
            first = (self._sequence + 1) % SEQUENCES
        if (sequence - first) % SEQUENCES < KEPT_EVENTS:
            self._request(first, sequence)
            self._sequence = sequence

    def add_failing_checks(self) -> bool:
        """Add the reasons of a refusal to arm as texts; return False if they are not known yet.

        They are added then as soon as the report arrives.
        """
        reasons = self._checks.reasons(self._telemetry.mode)
        self._explains_until = -1 if reasons else self._kernel.now() + EXPLAINS_WITHIN
        for reason in reasons:
            self.add_text(WARNING, f"Arming check: {reason}")
        return bool(reasons)

    def failing_checks(self) -> list[str]:
        """Return the arming checks that forbid to arm in the present mode."""
        return self._checks.reasons(self._telemetry.mode)

    def lasting_reasons(self) -> list[str]:
        """Return the arming checks that fail in the present mode and that waiting does not mend."""
        return self._checks.lasting(self._telemetry.mode)

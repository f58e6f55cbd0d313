"""Decoder of PX4: mode names, estimator status, and events.

PX4 reports arming checks and state changes as numbered events. The number consists of the component (1, the
autopilot) in the high byte and the 24 low bits of the FNV-1a hash of the event's name. The meanings stand
only in the firmware's sources; here are the recorded events of PX4 1.14 and the arming checks that users
meet. Others are shown as their number.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any, NamedTuple

from volery.base.position import AMSL, Position
from volery.base.time import Ns, S
from volery.kernel.api import Kernel
from volery.vehicles.drivers.mavlink.decoder import Fields, TelemetryDecoder
from volery.vehicles.drivers.px4.modes import HOLD, MANUAL_MODES, MODES, mode_name
from volery.vehicles.drivers.px4.versions import HOME_ALTITUDE_CORRECTED, NO_HORIZONTAL_POSITION
from volery.vehicles.telemetry import SAME_HOME_UP_M, Telemetry

ALL_MODES = 0xFFFFFFFF
ERROR, WARNING = 3, 4
"""Log levels of syslog. An arming check for all modes that is not an error is only a warning."""
NOT_FOR_PEOPLE = 8
SEQUENCES = 65_536
KEPT_EVENTS = 20
"""Number of past events that are requested; those that PX4 keeps no longer are reported as errors."""
HOME_SMOOTHED_OVER: Ns = 10 * S
"""Time constant of home's altitude, which PX4 1.17 corrects up to four times a second by +-1.5 m of noise."""
EXPLAINS_WITHIN: Ns = S
"""Time after a refusal within which a report of the arming checks is its reason."""

_BASIS, _PRIME = 0x811C9DC5, 0x01000193
_AUTOPILOT = 1 << 24


def event_id(name: str) -> int:
    """Return the number of the autopilot's event *name*."""
    value = _BASIS
    for octet in name.encode():
        value = (value ^ octet) * _PRIME & 0xFFFFFFFF
    return value & 0xFFFFFF | _AUTOPILOT


class Event(NamedTuple):
    """An event. Of an arming check, ``modes`` has a bit for the ``state`` of each mode that it forbids."""

    id: int
    severity: int
    modes: int


REPORT_BEGINS = event_id("commander_arming_check_summary")
REPORT_ENDS = event_id("commander_health_summary")
"""Between these two events PX4 sends all failing arming checks, each time one of them changes."""

NO_MANUAL_CONTROL = event_id("check_modes_manual_control")

_CHECK_NAMES: Mapping[str, str] = {
    "check_modes_cannot_takeoff": "mode not suitable for arming",
    "check_modes_angular_velocity": "angular velocity not valid",
    "check_modes_attitude": "no valid attitude estimate",
    "check_modes_local_pos": "no valid local position estimate",
    "check_modes_global_pos": "no valid global position estimate",
    "check_modes_local_alt": "no valid altitude estimate",
    "check_modes_mission": "no valid mission available",
    "check_modes_home_position": "home position not set",
    "check_modes_manual_control": "no manual control input",
    "check_modes_offboard_signal": "no offboard signal",
    "check_modes_not_supported": "mode not supported by this vehicle",
    "check_rc_dl_no_dllink": "no connection to the ground station",
    "check_estimator_missing_data": "waiting for the estimator",
    "check_missing_gps": "no GPS",
    "check_estimator_gps_fix_too_low": "GPS fix too low",
    "check_estimator_gps_num_sats_too_low": "too few GPS satellites",
    "check_battery_low": "low battery",
    "check_battery_critical": "critically low battery",
    "check_system_usb_connected": "USB connected",
    "check_gyro_missing": "no gyroscope",
    "check_accel_missing": "no accelerometer",
    "check_mag_missing": "no compass",
    "check_baro_missing": "no barometer",
}
CHECKS: Mapping[int, str] = {event_id(name): words for name, words in _CHECK_NAMES.items()}
"""Arming checks."""

_PASSING = (
    "estimator",
    "gps",
    "_pos",
    "home",
    "attitude",
    "angular",
    "local_alt",
    "heading",
    "offboard",
    "_mag",
)

LASTING_CHECKS = frozenset(
    event_id(name) for name in _CHECK_NAMES if not any(word in name for word in _PASSING)
)
"""Arming checks that stay until they are mended: batteries, missions, sticks, missing hardware."""

KNOWN_EVENTS: Mapping[int, str] = {
    event_id(name): words
    for name, words in {
        "commander_armed_by": "armed",
        "commander_disarmed_by": "disarmed",
        "commander_takeoff_detected": "take-off detected",
        "commander_landing_detected": "landing detected",
        "commander_landing_current_pos": "landing at current position",
        "commander_rtl": "returning to launch",
        "commander_modeswitch_not_avail": "this mode is not available now",
        "commander_rc_lost": "manual control lost",
        "commander_rc_regained": "manual control regained",
        "commander_rc_override": "pilot took over using sticks",
        "failsafe_rc_override": "pilot took over using sticks",
        "commander_arm_denied_throttle_center": "arming denied: throttle above center",
        "commander_disarming_denied_not_landed": "disarming denied: not landed",
        "commander_failsafe_enter": "failsafe activated",
        "commander_failsafe_enter_generic": "failsafe activated",
        "commander_failsafe_enter_hold": "failsafe activated, holding first",
        "mission_takeoff_to": "taking off",
        "navigator_takeoff_min_alt": "using the minimum take-off altitude",
        "navigator_takeoff_already_higher": "already higher than the take-off altitude",
        "navigator_rtl_home_activated": "RTL: activated",
        "rtl_land_at_home": "RTL: landing at home",
        "rtl_climb_to": "RTL: climbing",
        "rtl_return_at": "RTL: returning",
        "rtl_descend_to": "RTL: descending",
        "rtl_land_at_destination": "RTL: landing",
        "mavlink_rcv_sp_target_unsup_coord": "set-point in a frame that PX4 does not take",
        "mavlink_rcv_sp_target_invalid": "set-point that sets nothing",
    }.items()
}
"""Other events. Most of those that were recorded are also sent as texts."""

WITHOUT_TEXT = frozenset(
    event_id(name)
    for name in (
        "commander_rc_lost",
        "commander_rc_regained",
        "failsafe_rc_override",
        "navigator_takeoff_already_higher",
    )
)


def event_text(number: int) -> str:
    """Return the text of an event; its number if the event is not known."""
    return CHECKS.get(number) or KNOWN_EVENTS.get(number) or f"event {number:#010x}"


def event_of(fields: Mapping[str, Any]) -> Event:
    """Return the event of an EVENT message; the low four bits of ``log_levels`` are its external severity."""
    arguments: Sequence[int] = fields["arguments"]
    modes = int.from_bytes(bytes(arguments[:4]), "little")
    return Event(fields["id"], fields["log_levels"] & 0x0F, modes)


class ArmingChecks:
    """The arming checks that fail now, collected from reports."""

    def __init__(self) -> None:
        self.reported = False
        self._failing: tuple[Event, ...] = ()
        self._report: list[Event] | None = None

    def handle_event(self, event: Event) -> bool:
        """Process an event; return whether it belongs to a report."""
        if event.id == REPORT_BEGINS:
            self._report = []
            return True
        if self._report is None:
            return False
        if event.id == REPORT_ENDS:
            self.reported = True
            self._failing = tuple(self._report)
            self._report = None
        elif event.id in KNOWN_EVENTS:
            return False
        else:
            self._report.append(event)
        return True

    def reasons(self, mode: str) -> list[str]:
        """Return why the vehicle cannot arm in *mode*.

        A check for all modes that is milder than an error is reported in the same way whether it forbids
        arming or not: COM_ARM_MIS_REQ's is an information. It is the reason if there is no other.
        """
        found = [event for event in self._failing if _forbids(event, mode)]
        found = found or [event for event in self._failing if event.modes == ALL_MODES]
        return [event_text(event.id) for event in found]

    def lasting(self, mode: str) -> list[str]:
        """Return the reasons that waiting does not mend."""
        staying = [event_text(event.id) for event in self._failing if event.id in LASTING_CHECKS]
        return [reason for reason in self.reasons(mode) if reason in staying]


def _forbids(event: Event, mode: str) -> bool:
    """Return whether an event forbids arming in *mode*; missing manual control forbids manual modes."""
    if event.id == NO_MANUAL_CONTROL:
        return mode in MANUAL_MODES
    if event.modes == ALL_MODES:
        return event.severity <= ERROR
    return bool(event.modes >> MODES[mode].state & 1) if mode in MODES else True


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
    ) -> None:
        super().__init__(kernel, telemetry, record=record)
        self._checks = ArmingChecks()
        self._request = request  # requests events by their first and last sequence number
        self._sequence: int | None = None  # of the newest event that was received or requested
        self._past: set[int] = set()  # requested events from before this program has connected
        self._explains_until: Ns = -1
        self._handlers["CURRENT_EVENT_SEQUENCE"] = lambda fields: self._request_missed(fields["sequence"])
        self._estimator_reports = False
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
        """Update ``ready``; without an estimator report, a reported position counts."""
        if not self._estimator_reports:
            self._estimates_position = True
        super()._update_ready()

    def _estimator_status(self, fields: Fields) -> None:
        self._estimator_reports = True
        self._estimator(fields)

    def add_text(self, severity: int, text: str) -> None:
        """Add a text of the autopilot, without the final tabulator."""
        super().add_text(severity, text.rstrip("\t"))

    def _event(self, fields: Fields) -> None:
        event, sequence = event_of(fields), fields["sequence"]
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
            self.add_text(event.severity, event_text(event.id))

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

    def lasting_reasons(self) -> list[str]:
        """Return the arming checks that fail in the present mode and that waiting does not mend."""
        return self._checks.lasting(self._telemetry.mode)

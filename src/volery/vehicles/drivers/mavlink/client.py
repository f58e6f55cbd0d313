"""Client of one MAVLink autopilot on a link: heartbeats, streams, acknowledgements, missions and parameters.

A firmware's backend adds its commands and its ``TelemetryDecoder``.
"""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Callable, Mapping, Sequence
from math import isfinite
from typing import Any, ClassVar, NamedTuple

from volery.base.errors import CapabilityError, LinkError, LinkGarbled, LinkSilent
from volery.base.time import MS, Ns, S
from volery.kernel.api import Action, Kernel
from volery.links.frame import Frame
from volery.links.link import Link, ReceiveStatistics, SelectiveLink
from volery.links.mavlink_messages import constant, entry_name, from_bytewise, message_type
from volery.trace.events import INFO, WARNING, LinkState, Text
from volery.vehicles.address import rate_option, records_texts, system_option
from volery.vehicles.driver import AttitudeTarget, link_error
from volery.vehicles.drivers.mavlink import obstacle_decoder
from volery.vehicles.drivers.mavlink.backend import (
    FORCE,
    GROUND_SPEED,
    MEASURED_HEADING,
    UNCHANGED,
    Ack,
    AttitudeStream,
)
from volery.vehicles.drivers.mavlink.decoder import TelemetryDecoder
from volery.vehicles.drivers.mavlink.services import MavlinkServices, item_fields
from volery.vehicles.firmware_versions import Coverage, MinorVersion, VersionRule, stated_version
from volery.vehicles.services import NO_RULES, ParameterRules, PlanItem
from volery.vehicles.telemetry import Answer, Telemetry
from volery.vehicles.tried_versions import tried

GCS_SYSTEM, GCS_COMPONENT = 255, 190
"""Ids of a ground station: ArduPilot takes manual control only from system 255 (its SYSID_MYGCS)."""

HEARTBEAT_PERIOD: Ns = S
SILENT_AFTER: Ns = 3 * S
VERSION = "AUTOPILOT_VERSION"

OBSTACLE_PERIOD: Ns = 200 * MS
"""A vehicle at 5 m/s moves by a metre between two measurements."""
STREAM_REQUEST_PERIOD: Ns = 3 * S
MISSED = 3
"""Number of periods without a message after which the stream counts as missing."""
PARAMETER_REQUEST_PERIOD: Ns = 2 * S
TRIES = 5
"""Tries after which a request is given up: firmware does not answer for a parameter that it lacks."""
UPLOAD_STALLED: Ns = 5 * S
MISSION_TYPE = 0

_IN_PROGRESS = constant("MAV_RESULT_IN_PROGRESS")
_ACCEPTED = constant("MAV_RESULT_ACCEPTED")
_NO_AUTOPILOT = constant("MAV_AUTOPILOT_INVALID")

_AUTOPILOTS: Mapping[int, str] = {
    constant("MAV_AUTOPILOT_ARDUPILOTMEGA"): "an ArduPilot",
    constant("MAV_AUTOPILOT_PX4"): "a PX4",
    constant("MAV_AUTOPILOT_PPZ"): "a Paparazzi",
}

ACK_KEYS: Mapping[int, str] = {
    constant("MAV_CMD_DO_SET_MODE"): Ack.MODE,
    constant("MAV_CMD_COMPONENT_ARM_DISARM"): Ack.ARM,
    constant("MAV_CMD_NAV_TAKEOFF"): Ack.TAKEOFF,
    constant("MAV_CMD_DO_CHANGE_SPEED"): Ack.SPEED,
    constant("MAV_CMD_CONDITION_YAW"): Ack.HEADING,
    constant("MAV_CMD_DO_REPOSITION"): Ack.TARGET,
    constant("MAV_CMD_MISSION_START"): Ack.START,
}


class FirmwareTraits(NamedTuple):
    """What the client needs to know of a firmware.

    Args:
        number: its MAV_AUTOPILOT.
        name: name in messages.
        called: name with its article.
        oldest: oldest supported version, major and minor.
        coverage: versions that the rules of the driver were read from.
        estimator: message with the state of its estimator.
        home_first: item 0 of its missions is home.
        turning: type mask of SET_ATTITUDE_TARGET beside a yaw rate.
        drawn_back: see ``AttitudeStream``.
        parameter_rules: its parameters with other names in other versions, and those that it writes itself.
        bytewise: whole parameter values lie in the bytes of the float (see ``from_bytewise``), as in PX4.
    """

    number: int
    name: str
    called: str
    oldest: MinorVersion
    coverage: Coverage
    estimator: str
    turning: int
    drawn_back: VersionRule[bool] = MEASURED_HEADING
    parameter_rules: ParameterRules = NO_RULES
    bytewise: bool = False
    home_first: bool = False


class StreamRequests:
    """Requests messages, and requests those again that do not arrive. Check it once a second.

    ArduPilot streams only heartbeats and texts without a request. It acknowledges requests in the first
    moments after its start, and forgets them.

    Args:
        periods: requested period of each message, ns.
        request: sends the request for a message.
    """

    def __init__(self, periods: Mapping[str, Ns], request: Callable[[str, Ns], None]) -> None:
        self._periods = dict(periods)
        self._request = request
        self._received: dict[str, Ns] = {}
        self._requested: dict[str, Ns] = {}

    def add(self, message: str, period: Ns) -> None:
        """Request another message from now on."""
        self._periods[message] = period

    def __contains__(self, message: str) -> bool:
        return message in self._periods

    def note_received(self, message: str, now: Ns) -> None:
        """Note that a message has arrived."""
        if message in self._periods:
            self._received[message] = now

    def check(self, now: Ns) -> None:
        """Request the messages that do not arrive."""
        for message, period in self._periods.items():
            received = self._received.get(message)
            arrives = received is not None and now - received <= MISSED * period + S
            requested = self._requested.get(message)
            if not arrives and (requested is None or now - requested >= STREAM_REQUEST_PERIOD):
                self._requested[message] = now
                self._request(message, period)


class ParameterRequests:
    """Requests parameters and the version once, and again while no answer arrives. Check it once a second."""

    def __init__(self, request: Callable[[str], None]) -> None:
        self._request = request
        self._tries: dict[str, int] = {}
        self._requested: dict[str, Ns] = {}
        self._begun = False

    @property
    def settled(self) -> bool:
        """Whether all requests were answered, or given up."""
        return self._begun and not self._tries

    def begin(self, names: Sequence[str]) -> None:
        """Request these from the next check on."""
        self._begun = True
        self._tries = dict.fromkeys(names, TRIES)

    def note_answered(self, name: str) -> None:
        """Note that the answer has arrived."""
        self._tries.pop(name, None)

    def check(self, now: Ns) -> None:
        """Request what has not been answered."""
        for name, left in list(self._tries.items()):
            requested = self._requested.get(name)
            if requested is not None and now - requested < PARAMETER_REQUEST_PERIOD:
                continue
            if not left:
                del self._tries[name]
                continue
            self._tries[name] = left - 1
            self._requested[name] = now
            self._request(name)


class MissionUpload:
    """One upload by the mission protocol.

    The client sends the number of items; the autopilot requests each item and acknowledges the last one.

    Args:
        items: items of the mission.
        send_to: sends a message, given its name and its fields without the target.
    """

    def __init__(self, items: Sequence[PlanItem], send_to: Callable[..., None]) -> None:
        self._items = items
        self._send_to = send_to
        self._requested_at: Ns | None = None

    def begin(self) -> None:
        """Send the number of items."""
        self._send_to("MISSION_COUNT", count=len(self._items), mission_type=MISSION_TYPE)

    def alive(self, now: Ns) -> bool:
        """Return whether the autopilot goes on requesting items."""
        return self._requested_at is not None and now - self._requested_at < UPLOAD_STALLED

    def send_item(self, number: int, now: Ns) -> None:
        """Send the requested item; the autopilot may request any item any number of times."""
        self._requested_at = now
        if not 0 <= number < len(self._items):
            return
        self._send_to("MISSION_ITEM_INT", **item_fields(self._items[number], number, MISSION_TYPE))


def stream_periods(firmware: FirmwareTraits, options: Mapping[str, str]) -> dict[str, Ns]:
    """Return the requested messages with their periods.

    Args:
        firmware: firmware of the autopilot.
        options: ``rate`` of the position, ``attitude`` and ``rc`` channels in Hz (0 for none).
    """
    attitude = rate_option("attitude", options, 4.0)
    periods = {
        "GLOBAL_POSITION_INT": round(S / rate_option("rate", options, 10.0, least=0.1)),
        "EXTENDED_SYS_STATE": 500 * MS,
        "SYS_STATUS": S,
        firmware.estimator: S,
        "GPS_RAW_INT": S,
        "HOME_POSITION": 2 * S,
        "VFR_HUD": S,
    }
    if attitude:
        periods["ATTITUDE"] = round(S / attitude)
    channels = rate_option("rc", options, 0.0)
    if channels:
        periods["RC_CHANNELS"] = round(S / channels)
    return periods


class MavlinkClient:
    """Client of the first autopilot of its firmware that sends a heartbeat on the link.

    Args:
        kernel: clock and record.
        link: link to the autopilot.
        name: name of the vehicle.
        options: see ``MAVLINK_OPTIONS``.
    """

    cycle: ClassVar[Action | None] = None
    firmware: ClassVar[FirmwareTraits]

    def __init__(self, kernel: Kernel, link: Link, name: str, options: Mapping[str, str]) -> None:
        self.telemetry = Telemetry(kernel, name)
        self._kernel = kernel
        self._link = link
        self._system = system_option(options)
        self._component = 1
        self._decoder = self._make_decoder(records_texts(options))
        self._attitudes = AttitudeStream(kernel, self.firmware.turning, self.firmware.drawn_back)
        self._streams = StreamRequests(stream_periods(self.firmware, options), self._request_stream)
        self._requests = ParameterRequests(self._request_parameter)
        self._parameters: dict[str, float] = {}
        self._upload: MissionUpload | None = None
        self._other_autopilot = ""  # another autopilot that sends heartbeats on this link
        self._unsupported = ""  # why this one is not supported
        self._silent = False
        self.services = MavlinkServices(
            kernel,
            self.telemetry,
            self._send,
            self._send_to,
            bytewise=self.firmware.bytewise,
            home_first=self.firmware.home_first,
            parameter_rules=self.firmware.parameter_rules,
            sender=(GCS_SYSTEM, GCS_COMPONENT),
        )
        self.services.cause = self._unsigned
        link.receive(self._receive)
        if isinstance(link, SelectiveLink):
            link.select(self._uses)
        self._heartbeat = kernel.every(HEARTBEAT_PERIOD, self._tick)

    @abstractmethod
    def _make_decoder(self, record: bool) -> TelemetryDecoder:
        """Return the firmware's decoder."""

    @abstractmethod
    def _requested_parameters(self) -> Sequence[str]:
        """Return the names of the parameters to read, now that the kind of vehicle is known."""

    # -- receiving

    def poll(self) -> None:
        """Do nothing: messages are processed as they arrive."""

    @property
    def parameters(self) -> Mapping[str, float] | None:
        """Parameters that were read; ``None`` until all answers have arrived."""
        return self._parameters if self._requests.settled else None

    def _uses(self, name: str) -> bool:
        """Return whether a periodic message changes anything here; a service in progress may use each."""
        return self._decoder.handles(name) or name in self._streams or self.services.uses(name)

    def _receive(self, frame: Frame) -> None:
        if not self._is_from_autopilot(frame):
            return
        now = self._kernel.now()
        if self._silent:
            self._silent = False
            self._kernel.record(
                LinkState(now, self.telemetry.name, "back", "the autopilot is received again")
            )
        first = self.telemetry.last_message_ns < 0
        used = self._decoder.handle_message(frame.name, frame.fields)
        self._streams.note_received(frame.name, now)
        if first:
            self._requests.begin((VERSION, *self._requested_parameters()))
            self._streams.check(now)
            self._requests.check(now)
        self.services.receive(frame)
        if used or self._handle_answer(frame):
            self.telemetry.changed.notify()

    def _is_from_autopilot(self, frame: Frame) -> bool:
        """Return whether our autopilot sent it; the first heartbeat of the firmware defines its system id."""
        if self.telemetry.last_message_ns >= 0:
            return frame.system == self._system and frame.component == self._component
        if frame.name != "HEARTBEAT" or frame.fields["autopilot"] == _NO_AUTOPILOT:
            return False
        autopilot: int = frame.fields["autopilot"]
        if autopilot != self.firmware.number:
            name = entry_name("MAV_AUTOPILOT", autopilot)
            self._other_autopilot = _AUTOPILOTS.get(autopilot) or f"a {name} autopilot"
            return False
        if self._system is not None and frame.system != self._system:
            return False
        self._system, self._component = frame.system, frame.component
        self._other_autopilot = ""
        self.telemetry.system = frame.system
        return True

    def _handle_answer(self, frame: Frame) -> bool:
        fields = frame.fields
        if frame.name == "COMMAND_ACK":
            return self._handle_command_ack(fields)
        if frame.name == VERSION:
            return self._handle_version(fields["flight_sw_version"])
        if frame.name in {"PARAM_VALUE", "PARAM_ERROR"}:
            return self._handle_parameter(frame.name == "PARAM_ERROR", fields)
        if self._upload is None or not _for_us(fields):
            return False
        # PX4 requests its first item by the older MISSION_REQUEST, ArduPilot all of them
        if frame.name in {"MISSION_REQUEST", "MISSION_REQUEST_INT"}:
            self._upload.send_item(fields["seq"], self._kernel.now())
        elif frame.name == "MISSION_ACK":
            result = entry_name("MAV_MISSION_RESULT", fields["type"]).removeprefix("MAV_MISSION_")
            self._note_answer(Ack.MISSION, fields["type"] == 0, result)
            self._upload = None
        else:
            return False
        return True

    def _handle_command_ack(self, fields: Mapping[str, Any]) -> bool:
        command, result = fields["command"], fields["result"]
        if command not in ACK_KEYS or result == _IN_PROGRESS or not _for_us(fields):
            return False
        self._note_answer(ACK_KEYS[command], result == _ACCEPTED, entry_name("MAV_RESULT", result))
        return True

    def _handle_parameter(self, missing: bool, fields: Mapping[str, Any]) -> bool:
        """Store a requested parameter; another station may list all parameters at the same time."""
        name: str = fields["param_id"]
        if missing:
            self._requests.note_answered(name)
            return False
        value = parameter_value(fields, self.firmware.bytewise)
        if name not in self._requested_parameters() or not isfinite(value):
            return False
        self._parameters[name] = value
        for settled in (name, *self._absent_beside(name)):
            self._requests.note_answered(settled)
        return True

    def _absent_beside(self, name: str) -> Sequence[str]:
        """Return the parameters that a firmware which has *name* does not have."""
        renamed = self.firmware.parameter_rules.renamed.get(name)
        return () if renamed is None else (renamed.other(name),)

    def _handle_version(self, number: int) -> bool:
        """Note the version that the vehicle states, and say if it is too old or not covered by the rules."""
        self._requests.note_answered(VERSION)
        version = stated_version(number)
        if version is None or version == self.telemetry.version:
            return False
        self.telemetry.version = version
        oldest = self.firmware.oldest
        if version.series < oldest:
            self._unsupported = (
                f"{self.firmware.name} {version} flies here; this driver needs "
                f"{oldest[0]}.{oldest[1]} or newer: update the firmware"
            )
            return True
        uncovered = self.firmware.coverage.uncovered(version)
        said = uncovered or tried(self.firmware.name, version)
        severity = WARNING if uncovered else INFO
        self._kernel.record(Text(self._kernel.now(), self.telemetry.name, severity, said))
        return True

    def _note_answer(self, key: str, accepted: bool, result: str) -> None:
        self.telemetry.answers[key] = Answer(self._kernel.now(), accepted, result)
        if not accepted:
            self._on_refusal(key)

    def _on_refusal(self, key: str) -> None:
        """Handle a refusal; nothing to do where the reasons arrive as texts."""

    def _tick(self) -> None:
        """Send a heartbeat, request messages that do not arrive, and detect silence."""
        self._send(
            "HEARTBEAT",
            type=constant("MAV_TYPE_GCS"),
            autopilot=_NO_AUTOPILOT,
            system_status=constant("MAV_STATE_ACTIVE"),
            mavlink_version=3,
        )
        last, now = self.telemetry.last_message_ns, self._kernel.now()
        if last < 0:
            return
        self._streams.check(now)
        self._requests.check(now)
        if now - last > SILENT_AFTER and not self._silent:
            self._silent = True
            detail = self._link.problem() or "the autopilot is not received"
            self._kernel.record(LinkState(now, self.telemetry.name, "silent", detail))

    def _unsigned(self) -> str:
        """Return that the vehicle signs its messages and ignores ours, if so."""
        statistics = getattr(self._link, "statistics", None)
        if not isinstance(statistics, ReceiveStatistics) or not statistics.signed:
            return ""
        return "it signs its messages, and ignores those that are not signed: state the key, ?signing=FILE"

    def problem(self) -> LinkError | CapabilityError | None:
        """Return what is wrong with the link, or why the vehicle is not supported, as an error to raise."""
        wrong = self._link.problem()
        if wrong:
            return link_error(self._link, wrong)
        if self._unsupported:
            return CapabilityError(self._unsupported)
        if self.telemetry.last_message_ns >= 0:
            return None
        if self._other_autopilot:
            return LinkGarbled(f"{self._other_autopilot} answers here, not {self.firmware.called}")
        return LinkSilent(f"no message of {self.firmware.called} was received")

    def close(self) -> None:
        """Stop the heartbeats and close the link."""
        self._heartbeat.cancel()
        self._link.close()

    # -- sending

    def _send(self, name: str, **fields: Any) -> None:
        self._link.send(Frame(name, fields, GCS_SYSTEM, GCS_COMPONENT))

    def _send_to(self, name: str, **fields: Any) -> None:
        """Send a message to the autopilot."""
        to = {"target_system": self._system or 0, "target_component": self._component}
        self._link.send(Frame(name, to | fields, GCS_SYSTEM, GCS_COMPONENT))

    def _command(self, command: str, *parameters: float) -> None:
        named = {f"param{number}": float(value) for number, value in enumerate(parameters, 1)}
        self._send_to("COMMAND_LONG", command=constant(command), **named)

    def _request_stream(self, message: str, period: Ns) -> None:
        number = float(message_type(message).id)
        self._command("MAV_CMD_SET_MESSAGE_INTERVAL", number, period / 1000.0)

    def _request_parameter(self, name: str) -> None:
        if name == VERSION:
            self._command("MAV_CMD_REQUEST_MESSAGE", float(message_type(VERSION).id))
        else:
            self._send_to("PARAM_REQUEST_READ", param_id=name, param_index=-1)

    def arm(self, arm: bool, *, force: bool = False) -> None:
        """Send COMPONENT_ARM_DISARM."""
        self._command("MAV_CMD_COMPONENT_ARM_DISARM", float(arm), FORCE if force else 0.0)

    def set_speed(self, speed: float) -> None:
        """Send DO_CHANGE_SPEED."""
        self._command("MAV_CMD_DO_CHANGE_SPEED", GROUND_SPEED, speed, UNCHANGED)

    def send_attitude(self, target: AttitudeTarget) -> None:
        """Send SET_ATTITUDE_TARGET."""
        self._send_to("SET_ATTITUDE_TARGET", **self._attitudes.fields(target, self.telemetry))

    def request_arming_checks(self) -> None:
        """Send RUN_PREARM_CHECKS; the reasons arrive as texts."""
        self._command("MAV_CMD_RUN_PREARM_CHECKS")

    def failing_checks(self) -> Sequence[str]:
        """Return nothing: they arrive as texts, which errors quote."""
        return ()

    def upload(self, items: Sequence[PlanItem]) -> None:
        """Upload a mission; a repeated call starts again only if the autopilot requests no more items."""
        if self._upload is None or not self._upload.alive(self._kernel.now()):
            self._upload = MissionUpload(items, self._send_to)
            self._upload.begin()

    def request_attitude(self) -> None:
        """Do nothing: ATTITUDE is requested from the beginning, at the rate of the address."""

    def request_obstacles(self) -> None:
        """Request the messages of range sensors."""
        self._decoder.decode_obstacles()
        for message in obstacle_decoder.MESSAGES:
            self._streams.add(message, OBSTACLE_PERIOD)
        self._streams.check(self._kernel.now())

    def request_target(self) -> None:
        """Request POSITION_TARGET_GLOBAL_INT, which reports the target."""
        self._streams.add("POSITION_TARGET_GLOBAL_INT", 500 * MS)

    def request_mission_progress(self) -> None:
        """Request MISSION_CURRENT, which reports the end of missions that do not land."""
        self._streams.add("MISSION_CURRENT", S)
        self._streams.check(self._kernel.now())


def parameter_value(fields: Mapping[str, Any], bytewise: bool) -> float:
    """Return the value in a PARAM_VALUE; *bytewise*: integers lie in the bytes of the float, as in PX4."""
    value: float = fields["param_value"]
    return from_bytewise(fields["param_type"], value) if bytewise else value


def _for_us(fields: Mapping[str, Any]) -> bool:
    """Return whether a message is addressed to us; older firmware states no address."""
    return fields.get("target_system", 0) in {0, GCS_SYSTEM}

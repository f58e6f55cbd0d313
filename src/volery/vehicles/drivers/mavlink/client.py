"""Asking for the messages that are used, and again for those that do not come.

ArduPilot streams nothing unasked but heartbeats and texts; what is asked for within the first moments of its
life it acknowledges and forgets.

What is asked for once after the first heartbeat, and again while no answer comes.

MAVLink's mission upload: we tell the count, the autopilot asks for each item and acknowledges the last.

The other end of a MAVLink link: which system it is, heartbeats, streams, answers, missions, parameters.

A firmware's driver adds what it says (its commands) and what it makes of what it hears (its ``TelemetryDecoder``).
"""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Callable, Mapping, Sequence
from math import isfinite
from typing import Any, NamedTuple

from volery.base.errors import CapabilityError, LinkError, LinkGarbled, LinkSilent
from volery.base.time import MS, Ns, S
from volery.kernel.api import Action, Kernel
from volery.links.link import Frame, Link, ReceiveStatistics
from volery.links.mavlink_conventions import from_bytewise
from volery.links.mavlink_messages import constant, entry_name, message_type
from volery.trace.events import LinkState
from volery.vehicles.address import rate_option, records_texts, system_option
from volery.vehicles.drivers.mavlink import backend as key
from volery.vehicles.drivers.mavlink.backend import FORCE, GROUND_SPEED, UNCHANGED, Item
from volery.vehicles.drivers.mavlink.decoder import TelemetryDecoder
from volery.vehicles.telemetry import Answer, Telemetry

STREAM_REQUEST_PERIOD: Ns = 3 * S
MISSED = 3
"""Periods without a message after which it counts as not coming."""


class MessageStreams:
    """``ask(message, period)`` is called for what does not come. Look at it once a second."""

    def __init__(self, periods: Mapping[str, Ns], ask: Callable[[str, Ns], None]) -> None:
        self._periods = dict(periods)
        self._ask = ask
        self._heard: dict[str, Ns] = {}
        self._asked: dict[str, Ns] = {}

    def want(self, message: str, period: Ns) -> None:
        """This, too, from now on."""
        self._periods[message] = period

    def heard(self, message: str, now: Ns) -> None:
        """It has come."""
        if message in self._periods:
            self._heard[message] = now

    def look(self, now: Ns) -> None:
        """Ask for what is missing."""
        for message, period in self._periods.items():
            heard = self._heard.get(message)
            comes = heard is not None and now - heard <= MISSED * period + S
            asked = self._asked.get(message)
            if not comes and (asked is None or now - asked >= STREAM_REQUEST_PERIOD):
                self._asked[message] = now
                self._ask(message, period)


PARAMETER_REQUEST_PERIOD: Ns = 2 * S
TRIES = 5
"""What was not answered so often does not exist there: firmware does not answer for a parameter it lacks."""


class ParameterRequests:
    """``ask(name)`` is called for each of *names* until ``answered``. Look at it once a second."""

    def __init__(self, ask: Callable[[str], None]) -> None:
        self._ask = ask
        self._tries: dict[str, int] = {}
        self._asked: dict[str, Ns] = {}
        self._begun = False

    @property
    def settled(self) -> bool:
        """All were answered, or will not be."""
        return self._begun and not self._tries

    def begin(self, names: Sequence[str]) -> None:
        """Ask for these, from the next look on."""
        self._begun = True
        self._tries = dict.fromkeys(names, TRIES)

    def answered(self, name: str) -> None:
        """No need to ask again."""
        self._tries.pop(name, None)

    def look(self, now: Ns) -> None:
        """Ask for what is missing."""
        for name, left in list(self._tries.items()):
            asked = self._asked.get(name)
            if asked is not None and now - asked < PARAMETER_REQUEST_PERIOD:
                continue
            if not left:
                del self._tries[name]
                continue
            self._tries[name] = left - 1
            self._asked[name] = now
            self._ask(name)


def value_of(fields: Mapping[str, Any], bytewise: bool) -> float:
    """The value in a PARAM_VALUE. *bytewise*: whole numbers lie in the four bytes of the float, as in PX4."""
    value: float = fields["param_value"]
    return from_bytewise(fields["param_type"], value) if bytewise else value


STALLED: Ns = 5 * S
MISSION_TYPE = 0


class MissionUpload:
    """One upload under way. *send_to* takes a message's name and its fields but for the target."""

    def __init__(self, items: Sequence[Item], send_to: Callable[..., None]) -> None:
        self._items = items
        self._send_to = send_to
        self._asked: Ns | None = None

    def begin(self) -> None:
        """Tell how many there are."""
        self._send_to("MISSION_COUNT", count=len(self._items), mission_type=MISSION_TYPE)

    def alive(self, now: Ns) -> bool:
        """The autopilot goes on asking."""
        return self._asked is not None and now - self._asked < STALLED

    def requested(self, number: int, now: Ns) -> None:
        """Send an item; whichever it asks for, as often as it asks."""
        self._asked = now
        if not 0 <= number < len(self._items):
            return
        item = self._items[number]
        first, second, third, fourth = item.parameters
        self._send_to(
            "MISSION_ITEM_INT",
            seq=number,
            frame=item.frame,
            command=item.command,
            current=0,
            autocontinue=1,
            param1=first,
            param2=second,
            param3=third,
            param4=fourth,
            x=round(item.latitude * 1e7),
            y=round(item.longitude * 1e7),
            z=item.z,
            mission_type=MISSION_TYPE,
        )


GCS_SYSTEM, GCS_COMPONENT = 255, 190
"""A ground station's ids: ArduPilot takes sticks only from system 255 (its SYSID_MYGCS)."""

HEARTBEAT_PERIOD: Ns = S
SILENT_AFTER: Ns = 3 * S
VERSION = "AUTOPILOT_VERSION"

_IN_PROGRESS = constant("MAV_RESULT_IN_PROGRESS")
_ACCEPTED = constant("MAV_RESULT_ACCEPTED")
_NO_AUTOPILOT = constant("MAV_AUTOPILOT_INVALID")

_AUTOPILOTS: Mapping[int, str] = {
    constant("MAV_AUTOPILOT_ARDUPILOTMEGA"): "an ArduPilot",
    constant("MAV_AUTOPILOT_PX4"): "a PX4",
    constant("MAV_AUTOPILOT_PPZ"): "a Paparazzi",
}

KEYS: Mapping[int, str] = {
    constant("MAV_CMD_DO_SET_MODE"): key.MODE,
    constant("MAV_CMD_COMPONENT_ARM_DISARM"): key.ARM,
    constant("MAV_CMD_NAV_TAKEOFF"): key.TAKEOFF,
    constant("MAV_CMD_DO_CHANGE_SPEED"): key.SPEED,
    constant("MAV_CMD_CONDITION_YAW"): key.HEADING,
    constant("MAV_CMD_DO_REPOSITION"): key.TARGET,
    constant("MAV_CMD_MISSION_START"): key.START,
}


class Firmware(NamedTuple):
    """What is asked of a firmware at once. ``number`` is its MAV_AUTOPILOT, ``called`` has the article.

    ``oldest`` is the oldest version, major and minor, that its driver can fly. ``estimator`` is the message
    in which its estimator says what it knows. ``bytewise``: see ``value_of``.
    """

    number: int
    name: str
    called: str
    oldest: tuple[int, int]
    estimator: str
    bytewise: bool = False


def stream_periods(firmware: Firmware, options: Mapping[str, str]) -> dict[str, Ns]:
    """What is asked for, and how often: ``rate_option`` in Hz for the position; ``attitude``, 0 for none."""
    attitude = rate_option("attitude", options, 0.0)
    periods = {
        "GLOBAL_POSITION_INT": round(S / rate_option("rate", options, 10.0, least=0.1)),
        "EXTENDED_SYS_STATE": 500 * MS,
        "SYS_STATUS": S,
        firmware.estimator: S,
        "GPS_RAW_INT": S,
        "HOME_POSITION": 2 * S,
    }
    if attitude:
        periods["ATTITUDE"] = round(S / attitude)
    return periods


class MavlinkClient:
    """Talks to the first autopilot of this *firmware* that speaks; see ``options`` for the options."""

    cycle: Action | None = None
    firmware: Firmware

    def __init__(self, kernel: Kernel, link: Link, name: str, options: Mapping[str, str]) -> None:
        self.telemetry = Telemetry(kernel, name)
        self._kernel = kernel
        self._link = link
        self._system = system_option(options)
        self._component = 1
        self._hearing = self._listener(records_texts(options))
        self._streams = MessageStreams(stream_periods(self.firmware, options), self._request)
        self._inquiries = ParameterRequests(self._inquire)
        self._read: dict[str, float] = {}
        self._upload: MissionUpload | None = None
        self._stranger = ""  # another autopilot that answers here
        self._unfit = ""  # why this one cannot be flown
        self._silent = False
        link.receive(self._receive)
        self._beat = kernel.every(HEARTBEAT_PERIOD, self._tick)

    @abstractmethod
    def _listener(self, record: bool) -> TelemetryDecoder:
        """What the firmware's messages are turned into telemetry by."""

    @abstractmethod
    def _wanted(self) -> Sequence[str]:
        """The aircraft's parameters that are to be read, now that its kind is known."""

    # -- hearing

    def poll(self) -> None:
        """What arrives is taken in by itself."""

    @property
    def parameters(self) -> Mapping[str, float] | None:
        """What was read of the aircraft's parameters; ``None`` until all answers are in."""
        return self._read if self._inquiries.settled else None

    def _receive(self, frame: Frame) -> None:
        if not self._is_ours(frame):
            return
        now = self._kernel.now()
        if self._silent:
            self._silent = False
            self._kernel.record(LinkState(now, self.telemetry.name, "back", "the autopilot is heard again"))
        first = self.telemetry.last_message_ns < 0
        known = self._hearing.hear(frame.name, frame.fields)
        self._streams.heard(frame.name, now)
        if first:
            self._inquiries.begin((VERSION, *self._wanted()))
            self._streams.look(now)
            self._inquiries.look(now)
        if known or self._hear_answer(frame):
            self.telemetry.changed.notify()

    def _is_ours(self, frame: Frame) -> bool:
        """Of our autopilot; the first heartbeat of this firmware tells which system that is."""
        if self.telemetry.last_message_ns >= 0:
            return frame.system == self._system and frame.component == self._component
        if frame.name != "HEARTBEAT" or frame.fields["autopilot"] == _NO_AUTOPILOT:
            return False
        if frame.fields["autopilot"] != self.firmware.number:
            self._stranger = _called(frame.fields["autopilot"])
            return False
        if self._system is not None and frame.system != self._system:
            return False
        self._system, self._component = frame.system, frame.component
        self._stranger = ""
        self.telemetry.system = frame.system
        return True

    def _hear_answer(self, frame: Frame) -> bool:
        fields = frame.fields
        if frame.name == "COMMAND_ACK":
            return self._hear_command_ack(fields)
        if frame.name == VERSION:
            return self._hear_version(fields["flight_sw_version"])
        if frame.name == "PARAM_VALUE":
            return self._hear_parameter(fields)
        if self._upload is None or not _for_us(fields):
            return False
        return self._hear_upload(self._upload, frame.name, fields)

    def _hear_upload(self, upload: MissionUpload, name: str, fields: Mapping[str, Any]) -> bool:
        """PX4 asks for its first item by the older MISSION_REQUEST, ArduPilot for all of them."""
        if name in {"MISSION_REQUEST", "MISSION_REQUEST_INT"}:
            upload.requested(fields["seq"], self._kernel.now())
        elif name == "MISSION_ACK":
            result = entry_name("MAV_MISSION_RESULT", fields["type"]).removeprefix("MAV_MISSION_")
            self._answer(key.MISSION, fields["type"] == 0, result)
            self._upload = None
        else:
            return False
        return True

    def _hear_command_ack(self, fields: Mapping[str, Any]) -> bool:
        command, result = fields["command"], fields["result"]
        if command not in KEYS or result == _IN_PROGRESS or not _for_us(fields):
            return False
        self._answer(KEYS[command], result == _ACCEPTED, entry_name("MAV_RESULT", result))
        return True

    def _hear_parameter(self, fields: Mapping[str, Any]) -> bool:
        """Somebody else may be listing all of them."""
        name: str = fields["param_id"]
        value = value_of(fields, self.firmware.bytewise)
        if name not in self._wanted() or not isfinite(value):
            return False
        self._read[name] = value
        self._inquiries.answered(name)
        return True

    def _hear_version(self, number: int) -> bool:
        """The number has a byte each for major, minor, patch and kind of release; 0: it does not say."""
        self._inquiries.answered(VERSION)
        major, minor, patch = number >> 24, number >> 16 & 0xFF, number >> 8 & 0xFF
        oldest = self.firmware.oldest
        if number and (major, minor) < oldest:
            self._unfit = (
                f"{self.firmware.name} {major}.{minor}.{patch} flies here; this driver needs "
                f"{oldest[0]}.{oldest[1]} or newer: update the firmware"
            )
        return bool(self._unfit)

    def _answer(self, which: str, accepted: bool, result: str) -> None:
        self.telemetry.answers[which] = Answer(self._kernel.now(), accepted, result)
        if not accepted:
            self._refused(which)

    def _refused(self, which: str) -> None:
        """Of what was asked under this key; nothing more to hear of it where reasons come as texts."""

    def _tick(self) -> None:
        """Each second: say that we are there, ask for what does not come, notice silence."""
        self._send(
            "HEARTBEAT",
            type=constant("MAV_TYPE_GCS"),
            autopilot=_NO_AUTOPILOT,
            system_status=constant("MAV_STATE_ACTIVE"),
            mavlink_version=3,
        )
        heard, now = self.telemetry.last_message_ns, self._kernel.now()
        if heard < 0:
            return
        self._streams.look(now)
        self._inquiries.look(now)
        if now - heard > SILENT_AFTER and not self._silent:
            self._silent = True
            detail = self._link.problem() or "the autopilot is not heard"
            self._kernel.record(LinkState(now, self.telemetry.name, "silent", detail))

    def problem(self) -> LinkError | CapabilityError | None:
        """Nothing while it is heard; else what is there instead."""
        wrong = self._link.problem()
        if wrong:
            heard = getattr(self._link, "statistics", None)
            garbled = isinstance(heard, ReceiveStatistics) and heard.octets > 0 and not heard.frames
            return LinkGarbled(wrong) if garbled else LinkSilent(wrong)
        if self._unfit:
            return CapabilityError(self._unfit)
        if self.telemetry.last_message_ns >= 0:
            return None
        if self._stranger:
            return LinkGarbled(f"{self._stranger} speaks here, not {self.firmware.called}")
        return LinkSilent(f"no {self.firmware.name} was heard")

    def close(self) -> None:
        """No more heartbeats; the link is closed."""
        self._beat.cancel()
        self._link.close()

    # -- speaking

    def _send(self, name: str, **fields: Any) -> None:
        self._link.send(Frame(name, fields, GCS_SYSTEM, GCS_COMPONENT))

    def _send_to(self, name: str, **fields: Any) -> None:
        self._send(name, target_system=self._system or 0, target_component=self._component, **fields)

    def _command(self, command: str, *parameters: float) -> None:
        named = {f"param{number}": float(value) for number, value in enumerate(parameters, 1)}
        self._send_to("COMMAND_LONG", command=constant(command), **named)

    def _request(self, message: str, period: Ns) -> None:
        number = float(message_type(message).id)
        self._command("MAV_CMD_SET_MESSAGE_INTERVAL", number, period / 1000.0)

    def _inquire(self, name: str) -> None:
        if name == VERSION:
            self._command("MAV_CMD_REQUEST_MESSAGE", float(message_type(VERSION).id))
        else:
            self._send_to("PARAM_REQUEST_READ", param_id=name, param_index=-1)

    def arm(self, arm: bool, *, force: bool = False) -> None:
        """By COMPONENT_ARM_DISARM."""
        self._command("MAV_CMD_COMPONENT_ARM_DISARM", float(arm), FORCE if force else 0.0)

    def speed(self, metres_per_second: float) -> None:
        """By DO_CHANGE_SPEED."""
        self._command("MAV_CMD_DO_CHANGE_SPEED", GROUND_SPEED, metres_per_second, UNCHANGED)

    def check(self) -> None:
        """By RUN_PREARM_CHECKS: the reasons come as texts."""
        self._command("MAV_CMD_RUN_PREARM_CHECKS")

    def upload(self, items: Sequence[Item]) -> None:
        """By the mission protocol; asked again, it begins anew only if the autopilot has fallen silent."""
        if self._upload is None or not self._upload.alive(self._kernel.now()):
            self._upload = MissionUpload(items, self._send_to)
            self._upload.begin()

    def watch_target(self) -> None:
        """POSITION_TARGET_GLOBAL_INT tells where it goes."""
        self._streams.want("POSITION_TARGET_GLOBAL_INT", 500 * MS)

    def watch_mission(self) -> None:
        """MISSION_CURRENT tells the end of missions that do not land."""
        self._streams.want("MISSION_CURRENT", S)
        self._streams.look(self._kernel.now())


def _called(autopilot: int) -> str:
    known = _AUTOPILOTS.get(autopilot)
    return known or f"a {entry_name('MAV_AUTOPILOT', autopilot)} autopilot"


def _for_us(fields: Mapping[str, Any]) -> bool:
    """Older firmware addresses acknowledgements to nobody."""
    return fields.get("target_system", 0) in {0, GCS_SYSTEM}

"""ArduPilot over a MAVLink link."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from math import radians
from typing import Any

from volery.base.errors import LinkError, LinkGarbled, LinkSilent, UsageError, choices, did_you_mean
from volery.base.position import AboveHome, Position
from volery.base.time import MS, Ns, S
from volery.drivers.ardupilot import commands as key
from volery.drivers.ardupilot.commands import Item
from volery.drivers.ardupilot.hearing import Hearing
from volery.drivers.ardupilot.items import INT_FRAMES, frame_of
from volery.drivers.ardupilot.modes import DRONE_KIND, NUMBERS
from volery.drivers.ardupilot.streams import Streams
from volery.drivers.ardupilot.upload import Upload
from volery.drivers.ardupilot.vocabulary import (
    FORCE,
    GROUND_SPEED,
    LEFT_ALONE,
    POSITION_ONLY,
    SHORTEST_WAY,
    UNCHANGED,
    VELOCITY_AND_YAW_RATE,
)
from volery.kernel.api import Action, Kernel
from volery.links.codec import Heard
from volery.links.link import Frame, Link
from volery.links.mavlink import constant, entry_name, message_type
from volery.trace.events import LinkState
from volery.vehicles.telemetry import Answer, Telemetry, Velocity

GCS_SYSTEM, GCS_COMPONENT = 255, 190
"""A ground station's ids: ArduPilot takes sticks only from system 255 (its SYSID_MYGCS)."""

HEARTBEAT_PERIOD: Ns = S
SILENT_AFTER: Ns = 3 * S

_IN_PROGRESS = constant("MAV_RESULT_IN_PROGRESS")
_ACCEPTED = constant("MAV_RESULT_ACCEPTED")
_ARDUPILOT = constant("MAV_AUTOPILOT_ARDUPILOTMEGA")
_NO_AUTOPILOT = constant("MAV_AUTOPILOT_INVALID")

KEYS: Mapping[int, str] = {
    constant("MAV_CMD_DO_SET_MODE"): key.MODE,
    constant("MAV_CMD_COMPONENT_ARM_DISARM"): key.ARM,
    constant("MAV_CMD_NAV_TAKEOFF"): key.TAKEOFF,
    constant("MAV_CMD_DO_CHANGE_SPEED"): key.SPEED,
    constant("MAV_CMD_CONDITION_YAW"): key.HEADING,
    constant("MAV_CMD_MISSION_START"): key.START,
}

OPTIONS = ("attitude", "baud", "rate", "system", "texts")


def stream_periods(rate: float, attitude: float) -> dict[str, Ns]:
    """What is asked for, and how often. *rate* in Hz for the position; *attitude* likewise, 0 for none."""
    periods = {
        "GLOBAL_POSITION_INT": round(S / rate),
        "EXTENDED_SYS_STATE": 500 * MS,
        "SYS_STATUS": S,
        "EKF_STATUS_REPORT": S,
        "GPS_RAW_INT": S,
        "HOME_POSITION": 2 * S,
    }
    if attitude:
        periods["ATTITUDE"] = round(S / attitude)
    return periods


class MavlinkCommands:
    """See ``Commands``. ``system`` is the autopilot's id; ``None`` takes the first ArduPilot that speaks.

    Options: ``rate`` of the position and ``attitude`` in Hz, ``system``; and ``texts=unrecorded`` where the
    autopilot records its texts itself, as a simulated one does.
    """

    cycle: Action | None = None

    def __init__(self, kernel: Kernel, link: Link, name: str, options: Mapping[str, str]) -> None:
        self.telemetry = Telemetry(kernel, name)
        self._kernel = kernel
        self._link = link
        self._system = _whole("system", options, None)
        self._component = 1
        self._hearing = Hearing(kernel, self.telemetry, record=_recorded(options))
        self._streams = Streams(
            stream_periods(_number("rate", options, 10.0, least=0.1), _number("attitude", options, 0.0)),
            self._request,
        )
        self._upload: Upload | None = None
        self._stranger = ""  # another autopilot that answers here
        self._silent = False
        link.receive(self._receive)
        self._beat = kernel.every(HEARTBEAT_PERIOD, self._tick)

    # -- hearing

    def look(self) -> None:
        """What arrives is taken in by itself."""

    def _receive(self, frame: Frame) -> None:
        if not self._is_ours(frame):
            return
        now = self._kernel.now()
        if self._silent:
            self._silent = False
            self._kernel.record(LinkState(now, self.telemetry.name, "back", "the autopilot is heard again"))
        first = self.telemetry.heard < 0
        known = self._hearing.hear(frame.name, frame.fields)
        self._streams.heard(frame.name, now)
        if first:
            self._streams.look(now)
        if known or self._hear_answer(frame):
            self.telemetry.changed.notify()

    def _is_ours(self, frame: Frame) -> bool:
        """Of our autopilot; the first heartbeat of an ArduPilot tells which system that is."""
        if self.telemetry.heard >= 0:
            return frame.system == self._system and frame.component == self._component
        if frame.name != "HEARTBEAT" or frame.fields["autopilot"] == _NO_AUTOPILOT:
            return False
        if frame.fields["autopilot"] != _ARDUPILOT:
            self._stranger = entry_name("MAV_AUTOPILOT", frame.fields["autopilot"])
            return False
        if self._system is not None and frame.system != self._system:
            return False
        self._system, self._component = frame.system, frame.component
        self._stranger = ""
        return True

    def _hear_answer(self, frame: Frame) -> bool:
        fields = frame.fields
        if frame.name == "COMMAND_ACK":
            return self._hear_command_ack(fields)
        if self._upload is None:
            return False
        if frame.name in {"MISSION_REQUEST", "MISSION_REQUEST_INT"} and _for_us(fields):
            self._upload.requested(fields["seq"], self._kernel.now())
            return True
        if frame.name == "MISSION_ACK" and _for_us(fields):
            result = entry_name("MAV_MISSION_RESULT", fields["type"]).removeprefix("MAV_MISSION_")
            self._answer(key.MISSION, fields["type"] == 0, result)
            self._upload = None
            return True
        return False

    def _hear_command_ack(self, fields: Mapping[str, Any]) -> bool:
        command, result = fields["command"], fields["result"]
        if command not in KEYS or result == _IN_PROGRESS or not _for_us(fields):
            return False
        self._answer(KEYS[command], result == _ACCEPTED, entry_name("MAV_RESULT", result))
        return True

    def _answer(self, which: str, accepted: bool, result: str) -> None:
        self.telemetry.answers[which] = Answer(self._kernel.now(), accepted, result)

    def _tick(self) -> None:
        """Each second: say that we are there, ask for what does not come, notice silence."""
        self._send(
            "HEARTBEAT",
            type=constant("MAV_TYPE_GCS"),
            autopilot=_NO_AUTOPILOT,
            system_status=constant("MAV_STATE_ACTIVE"),
            mavlink_version=3,
        )
        heard, now = self.telemetry.heard, self._kernel.now()
        if heard < 0:
            return
        self._streams.look(now)
        if now - heard > SILENT_AFTER and not self._silent:
            self._silent = True
            detail = self._link.problem() or "the autopilot is not heard"
            self._kernel.record(LinkState(now, self.telemetry.name, "silent", detail))

    def problem(self) -> LinkError | None:
        """Nothing while it is heard; else what is there instead."""
        wrong = self._link.problem()
        if wrong:
            heard = getattr(self._link, "heard", None)
            garbled = isinstance(heard, Heard) and heard.octets > 0 and not heard.frames
            return LinkGarbled(wrong) if garbled else LinkSilent(wrong)
        if self.telemetry.heard >= 0:
            return None
        if self._stranger:
            return LinkGarbled(f"a {self._stranger} autopilot speaks here, not an ArduPilot")
        return LinkSilent("no ArduPilot was heard")

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

    def set_mode(self, mode: str) -> None:
        """By DO_SET_MODE."""
        number = NUMBERS.get(self.telemetry.kind, {}).get(mode)
        if number is None:
            raise UsageError(f"{self.telemetry.name} has no mode {mode!r}")
        self._command("MAV_CMD_DO_SET_MODE", constant("MAV_MODE_FLAG_CUSTOM_MODE_ENABLED"), number)

    def arm(self, arm: bool, *, force: bool = False) -> None:
        """By COMPONENT_ARM_DISARM."""
        self._command("MAV_CMD_COMPONENT_ARM_DISARM", float(arm), FORCE if force else 0.0)

    def takeoff(self, height: float) -> None:
        """By NAV_TAKEOFF, whose altitude ArduPilot takes above home."""
        self._command("MAV_CMD_NAV_TAKEOFF", 0, 0, 0, 0, 0, 0, height)

    def target(self, goal: Position) -> None:
        """By SET_POSITION_TARGET_GLOBAL_INT; a rover's has no altitude."""
        if self.telemetry.kind != DRONE_KIND:
            goal = Position(goal.latitude, goal.longitude, AboveHome(0.0))
        self._send_to(
            "SET_POSITION_TARGET_GLOBAL_INT",
            coordinate_frame=INT_FRAMES[frame_of(goal)],
            type_mask=POSITION_ONLY,
            lat_int=round(goal.latitude * 1e7),
            lon_int=round(goal.longitude * 1e7),
            alt=goal.altitude.metres,
        )

    def follow(self, velocity: Velocity, yaw_rate: float) -> None:
        """By SET_POSITION_TARGET_LOCAL_NED."""
        self._send_to(
            "SET_POSITION_TARGET_LOCAL_NED",
            coordinate_frame=constant("MAV_FRAME_LOCAL_NED"),
            type_mask=VELOCITY_AND_YAW_RATE,
            vx=velocity.north,
            vy=velocity.east,
            vz=-velocity.up,
            yaw_rate=radians(yaw_rate),
        )

    def turn(self, degrees: float) -> None:
        """By CONDITION_YAW."""
        self._command("MAV_CMD_CONDITION_YAW", degrees, 0.0, SHORTEST_WAY, 0.0)

    def speed(self, metres_per_second: float) -> None:
        """By DO_CHANGE_SPEED."""
        self._command("MAV_CMD_DO_CHANGE_SPEED", GROUND_SPEED, metres_per_second, UNCHANGED)

    def override(self, channels: Sequence[int | None]) -> None:
        """By RC_CHANNELS_OVERRIDE; the other channels are left alone."""
        named = {f"chan{number}_raw": LEFT_ALONE for number in range(1, 9)}
        for number, width in enumerate(channels, 1):
            if width is not None:
                named[f"chan{number}_raw"] = width
        self._send_to("RC_CHANNELS_OVERRIDE", **named)

    def check(self) -> None:
        """By RUN_PREARM_CHECKS: the reasons come as texts."""
        self._command("MAV_CMD_RUN_PREARM_CHECKS")

    def upload(self, items: Sequence[Item]) -> None:
        """By the mission protocol; asked again, it begins anew only if the autopilot has fallen silent."""
        if self._upload is None or not self._upload.alive(self._kernel.now()):
            self._upload = Upload(items, self._send_to)
            self._upload.begin()

    def start_mission(self) -> None:
        """By MISSION_START."""
        self._command("MAV_CMD_MISSION_START", 0.0, 0.0)

    def watch_mission(self) -> None:
        """MISSION_CURRENT tells the end of missions that do not land."""
        self._streams.want("MISSION_CURRENT", S)
        self._streams.look(self._kernel.now())


def _for_us(fields: Mapping[str, Any]) -> bool:
    """Older firmware addresses acknowledgements to nobody."""
    return fields.get("target_system", 0) in {0, GCS_SYSTEM}


def _number(name: str, options: Mapping[str, str], default: float, *, least: float = 0.0) -> float:
    given = options.get(name)
    if given is None:
        return default
    try:
        number = float(given)
    except ValueError:
        number = -1.0
    if not least <= number <= 100.0:
        raise UsageError(f"{name}={given!r} is no rate in Hz from {least:g} to 100")
    return number


def _recorded(options: Mapping[str, str]) -> bool:
    given = options.get("texts", "recorded")
    if given not in {"recorded", "unrecorded"}:
        raise UsageError(f"texts={given!r}; there is recorded or unrecorded")
    return given == "recorded"


def _whole(name: str, options: Mapping[str, str], default: int | None) -> int | None:
    given = options.get(name)
    if given is None:
        return default
    if not given.isdigit() or not 1 <= int(given) <= 255:
        raise UsageError(f"{name}={given!r} is no system id from 1 to 255")
    return int(given)


def check_options(options: Mapping[str, str], *allowed: str) -> None:
    """Refuse options that nobody would look at."""
    for name in options:
        if name not in allowed:
            hint = did_you_mean(name, allowed)
            raise UsageError(f"the ardupilot driver has no option {name!r}{hint}; it has {choices(allowed)}")

"""Base of scripted MAVLink autopilots: they obey at once, and can be
set to misbehave.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from math import radians
from typing import Any, ClassVar

from volery.base.time import MS, S
from volery.kernel.virtual import VirtualKernel
from volery.links.frame import Frame
from volery.links.link import Link
from volery.links.mavlink_messages import message_type

ACCEPTED = 0
INTERVAL, ASK, GET_HOME, RUN_CHECKS = 511, 512, 410, 401
STREAMED = (
    "ATTITUDE",
    "GLOBAL_POSITION_INT",
    "SYS_STATUS",
    "EXTENDED_SYS_STATE",
    "HOME_POSITION",
    "GPS_RAW_INT",
    "MISSION_CURRENT",
    "VFR_HUD",
)


@dataclass
class Craft:
    """What the autopilot believes."""

    mode: str = ""
    armed: bool = False
    status: int = 3
    landed_state: int = 1
    north: float = 0.0
    east: float = 0.0
    up: float = 0.0
    velocity: tuple[float, float, float] = (0.0, 0.0, 0.0)
    heading: float = 0.0
    placed: bool = True


@dataclass
class Scripted:
    """Streams at 10 Hz once it is asked; answers commands. ``refuse``: by command, the texts that follow."""

    kernel: VirtualKernel
    link: Link
    kind: int = 2
    craft: Craft = field(default_factory=Craft)
    refuse: dict[int, list[str]] = field(default_factory=dict)
    ignore: set[int] = field(default_factory=set)
    received: list[Frame] = field(default_factory=list)
    streams: set[str] = field(default_factory=set)
    deaf: bool = False
    mute: bool = False
    parameters: dict[str, float] = field(default_factory=dict)
    system: int = 1
    firmware: int = 0
    version: int = 0
    home_up: float = 0.0  # by which the altitude of home was corrected, m
    clock_rate: float = 0.0  # how fast its time since boot runs; 0: it is not sent

    home: ClassVar[tuple[int, int, int]]  # degE7, degE7, mm AMSL
    metres: ClassVar[tuple[float, float]]  # north and east in 1e-7 degrees there
    streamed: ClassVar[tuple[str, ...]] = STREAMED
    refusal: ClassVar[int]  # MAV_RESULT
    item_requests: ClassVar[tuple[str, str]] = ("MISSION_REQUEST", "MISSION_REQUEST")  # the first, the others

    def __post_init__(self) -> None:
        self.mission: dict[int, dict[str, Any]] = {}
        self.link.receive(self._receive)
        self.kernel.every(S, self._heartbeat)
        self.kernel.every(100 * MS, self._stream)

    # -- speaking

    def say(self, name: str, **fields: Any) -> None:
        if self.clock_rate and "time_boot_ms" in message_type(name).field_names:
            fields["time_boot_ms"] = round(self.clock_rate * self.kernel.now()) // MS
        if not self.mute:
            self.link.send(Frame(name, fields, self.system, 1))

    def text(self, words: str, severity: int = 6) -> None:
        self.say("STATUSTEXT", severity=severity, text=words)

    def mode_words(self) -> tuple[int, int]:
        """Base mode of one that is not armed, and custom mode."""
        raise NotImplementedError

    def _heartbeat(self) -> None:
        base, custom = self.mode_words()
        self.say(
            "HEARTBEAT",
            type=self.kind,
            autopilot=self.firmware,
            base_mode=base + 128 * self.craft.armed,
            custom_mode=custom,
            system_status=self.craft.status,
            mavlink_version=3,
        )

    def _stream(self) -> None:
        for name in sorted(self.streams):
            getattr(self, "_" + name.lower())()

    def _global_position_int(self) -> None:
        craft = self.craft
        north, east, up = craft.velocity
        if craft.placed:
            self.say(
                "GLOBAL_POSITION_INT",
                lat=self.home[0] + round(craft.north / self.metres[0]),
                lon=self.home[1] + round(craft.east / self.metres[1]),
                alt=self.home[2] + round(craft.up * 1000),
                relative_alt=round((craft.up - self.home_up) * 1000),
                vx=round(north * 100),
                vy=round(east * 100),
                vz=round(-up * 100),
                hdg=round(craft.heading * 100),
            )

    def _extended_sys_state(self) -> None:
        self.say("EXTENDED_SYS_STATE", landed_state=self.craft.landed_state)

    def _home_position(self) -> None:
        if self.craft.placed:
            latitude, longitude, altitude = self.home
            altitude += round(self.home_up * 1000)
            self.say("HOME_POSITION", latitude=latitude, longitude=longitude, altitude=altitude)

    def _attitude(self) -> None:
        self.say("ATTITUDE", roll=0.0, pitch=0.0, yaw=radians(self.craft.heading))

    def _gps_raw_int(self) -> None:
        self.say("GPS_RAW_INT", fix_type=3, satellites_visible=10)

    def _vfr_hud(self) -> None:
        self.say("VFR_HUD", throttle=45 if self.craft.armed else 0)

    # -- listening

    def _receive(self, frame: Frame) -> None:
        if self.deaf:
            return
        self.received.append(frame)
        fields = frame.fields
        if frame.name in {"COMMAND_LONG", "COMMAND_INT"}:
            self._command(fields["command"], fields)
        elif frame.name == "PARAM_REQUEST_READ" and fields["param_id"] in self.parameters:
            name = fields["param_id"]
            self.say("PARAM_VALUE", param_id=name, param_value=self.parameters[name], param_type=9)
        elif frame.name in {"MISSION_COUNT", "MISSION_ITEM_INT"}:
            self._take_mission(frame.name, fields)
        else:
            self.take(frame.name, fields)

    def take(self, name: str, fields: dict[str, Any]) -> None:
        """A message that is no command, no parameter and no mission."""

    def _take_mission(self, name: str, fields: dict[str, Any]) -> None:
        if name == "MISSION_COUNT":
            self.mission = {-1: fields}
        else:
            self.mission[fields["seq"]] = fields
        had = len(self.mission) - 1
        to = {"target_system": 255, "target_component": 190}
        if had < self.mission[-1]["count"]:
            self.say(self.item_requests[had > 0], seq=had, **to)
        else:
            self.say("MISSION_ACK", type=ACCEPTED, **to)

    def _command(self, command: int, fields: dict[str, Any]) -> None:
        if command in self.ignore:
            return
        if command not in self.refuse:
            self.obey(command, fields)
            return
        self.acknowledge(command, self.refusal)
        for words in self.refuse[command]:
            self.text(words, 2)

    def acknowledge(self, command: int, result: int) -> None:
        self.say("COMMAND_ACK", command=command, result=result, target_system=255, target_component=190)

    def obey(self, command: int, fields: dict[str, Any]) -> None:
        """Do it, and answer."""
        raise NotImplementedError

    def begin_to_stream(self, number: int) -> None:
        """The message of that number, if it is one that is streamed."""
        self.streams.update(name for name in self.streamed if message_type(name).id == number)

    def tell_version(self) -> None:
        self.say("AUTOPILOT_VERSION", flight_sw_version=self.version)

    def down(self, *modes: str) -> None:
        """On the ground and disarmed, if it is in one of these modes."""
        if self.craft.mode in modes:
            self.craft.up, self.craft.landed_state, self.craft.status, self.craft.armed = 0.0, 1, 3, False

    # -- asked by tests

    def sent(self, name: str) -> list[dict[str, Any]]:
        """The fields of all frames of this name that it received."""
        return [frame.fields for frame in self.received if frame.name == name]

    def commands(self) -> list[int]:
        """The commands that it received, requests for messages and for arming checks left out."""
        received = [frame.fields["command"] for frame in self.received if frame.name.startswith("COMMAND_")]
        return [command for command in received if command not in {INTERVAL, ASK, GET_HOME, RUN_CHECKS}]

"""A scripted autopilot for one link: it does at once what it is told, and can be told to misbehave.

And a bench that holds it, a virtual kernel, and the vehicle that commands it.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

import pytest

from volery.base.time import HOUR, MS, S
from volery.drivers.ardupilot import open_driver
from volery.drivers.ardupilot.modes import COPTER, NUMBERS, ROVER
from volery.kernel.task import Place
from volery.kernel.virtual import VirtualKernel
from volery.links.in_process import in_process
from volery.links.link import Frame, Link
from volery.links.mavlink import message_type
from volery.links.parser import MAVLINK
from volery.vehicles import Drone, Vehicle

HOME = (-353632610, 1491652300, 584_000)  # degE7, degE7, mm AMSL
ACCEPTED, FAILED = 0, 4
SET_MODE, ARM, TAKEOFF, SPEED, YAW, START, INTERVAL, ASK = 176, 400, 22, 178, 115, 300, 511, 512
COMMON_HEALTH = 0x10000000  # the arming checks pass


@dataclass
class Craft:
    """What the autopilot believes."""

    mode: str = "STABILIZE"
    armed: bool = False
    status: int = 3
    landed_state: int = 1
    north: float = 0.0
    east: float = 0.0
    up: float = 0.0
    velocity: tuple[float, float, float] = (0.0, 0.0, 0.0)
    heading: float = 0.0
    health: int = COMMON_HEALTH
    ekf: int = 831
    placed: bool = True


@dataclass
class FakeAutopilot:
    """Streams at 10 Hz once it is asked; answers commands. ``refuse``: by command, the texts that follow."""

    kernel: VirtualKernel
    link: Link
    kind: int = 2
    craft: Craft = field(default_factory=Craft)
    refuse: dict[int, list[str]] = field(default_factory=dict)
    ignore: set[int] = field(default_factory=set)
    on_command: Callable[[int, dict[str, Any]], None] = lambda command, fields: None
    heard: list[Frame] = field(default_factory=list)
    streams: set[str] = field(default_factory=set)
    deaf: bool = False
    mute: bool = False
    climb_s: float = 2.0
    version: int = 0x040506FF
    parameters: dict[str, float] = field(default_factory=dict)

    def __post_init__(self) -> None:
        self.modes = ROVER if self.kind == 10 else COPTER
        self.numbers = NUMBERS["rover" if self.kind == 10 else "drone"]
        self.mission: dict[int, dict[str, Any]] = {}
        self.link.receive(self._receive)
        self.kernel.every(S, self._heartbeat)
        self.kernel.every(100 * MS, self._stream)

    # -- speaking

    def say(self, name: str, **fields: Any) -> None:
        if not self.mute:
            self.link.send(Frame(name, fields, 1, 1))

    def text(self, words: str, severity: int = 6) -> None:
        self.say("STATUSTEXT", severity=severity, text=words)

    def _heartbeat(self) -> None:
        craft = self.craft
        number = self.numbers[craft.mode]
        base = 81 + 128 * craft.armed
        self.say(
            "HEARTBEAT",
            type=self.kind,
            autopilot=3,
            base_mode=base,
            custom_mode=number,
            system_status=craft.status,
            mavlink_version=3,
        )

    def _stream(self) -> None:
        for name in sorted(self.streams):
            getattr(self, "_" + name.lower())()

    def _global_position_int(self) -> None:
        craft = self.craft
        if not craft.placed:
            self.say("GLOBAL_POSITION_INT", hdg=0)
            return
        north, east, up = craft.velocity
        self.say(
            "GLOBAL_POSITION_INT",
            lat=HOME[0] + round(craft.north / 1.1095e-2),
            lon=HOME[1] + round(craft.east / 0.9080e-2),
            alt=HOME[2] + round(craft.up * 1000),
            relative_alt=round(craft.up * 1000),
            vx=round(north * 100),
            vy=round(east * 100),
            vz=round(-up * 100),
            hdg=round(craft.heading * 100),
        )

    def _sys_status(self) -> None:
        self.say(
            "SYS_STATUS",
            onboard_control_sensors_health=self.craft.health,
            voltage_battery=12600,
            current_battery=150,
            battery_remaining=87,
        )

    def _ekf_status_report(self) -> None:
        self.say("EKF_STATUS_REPORT", flags=self.craft.ekf)

    def _extended_sys_state(self) -> None:
        self.say("EXTENDED_SYS_STATE", landed_state=self.craft.landed_state)

    def _home_position(self) -> None:
        if self.craft.placed:
            self.say("HOME_POSITION", latitude=HOME[0], longitude=HOME[1], altitude=HOME[2])

    def _gps_raw_int(self) -> None:
        self.say("GPS_RAW_INT", fix_type=3, satellites_visible=10)

    def _mission_current(self) -> None:
        self.say("MISSION_CURRENT", seq=1, mission_state=3)

    # -- listening

    def _receive(self, frame: Frame) -> None:
        if self.deaf:
            return
        self.heard.append(frame)
        if frame.name == "COMMAND_LONG":
            self._command(frame.fields["command"], frame.fields)
        elif frame.name == "SET_POSITION_TARGET_GLOBAL_INT" and self.craft.mode == "GUIDED":
            self.craft.north = (frame.fields["lat_int"] - HOME[0]) * 1.1095e-2
            self.craft.east = (frame.fields["lon_int"] - HOME[1]) * 0.9080e-2
            amsl = frame.fields["coordinate_frame"] == 5
            self.craft.up = frame.fields["alt"] - (HOME[2] / 1000.0 if amsl else 0.0)
        elif frame.name == "PARAM_REQUEST_READ" and frame.fields["param_id"] in self.parameters:
            name = frame.fields["param_id"]
            self.say("PARAM_VALUE", param_id=name, param_value=self.parameters[name], param_type=9)
        elif frame.name in {"MISSION_COUNT", "MISSION_ITEM_INT"}:
            self._take_mission(frame)

    def _take_mission(self, frame: Frame) -> None:
        if frame.name == "MISSION_COUNT":
            self.mission = {-1: frame.fields}
        else:
            self.mission[frame.fields["seq"]] = frame.fields
        had = len(self.mission) - 1
        to = {"target_system": 255, "target_component": 190}
        if had < self.mission[-1]["count"]:
            self.say("MISSION_REQUEST", seq=had, **to)
        else:
            self.say("MISSION_ACK", type=ACCEPTED, **to)

    def _command(self, command: int, fields: dict[str, Any]) -> None:
        if command in self.ignore:
            return
        refused = command in self.refuse
        result = FAILED if refused else ACCEPTED
        self.say("COMMAND_ACK", command=command, result=result, target_system=255, target_component=190)
        if refused:
            for words in self.refuse[command]:
                self.text(words, 2)
            return
        self._obey(command, fields)
        self.on_command(command, fields)

    def _obey(self, command: int, fields: dict[str, Any]) -> None:
        craft = self.craft
        if command == INTERVAL:
            number = int(fields["param1"])
            names = ("GLOBAL_POSITION_INT", "SYS_STATUS", "EKF_STATUS_REPORT", "EXTENDED_SYS_STATE")
            known = (*names, "HOME_POSITION", "GPS_RAW_INT", "MISSION_CURRENT")
            self.streams.update(name for name in known if message_type(name).id == number)
        elif command == ASK:
            self.say("AUTOPILOT_VERSION", flight_sw_version=self.version)
        elif command == SET_MODE:
            self.enter(self.modes[int(fields["param2"])])
        elif command == ARM:
            craft.armed = fields["param1"] == 1.0
        elif command == TAKEOFF:
            self.kernel.call_at(
                self.kernel.now() + round(self.climb_s * S), lambda: self._lift(fields["param7"])
            )
        elif command == YAW:
            craft.heading = fields["param1"]

    def _lift(self, height: float) -> None:
        if self.craft.armed and self.craft.mode == "GUIDED":
            self.craft.up, self.craft.landed_state, self.craft.status = height, 2, 4

    def enter(self, mode: str) -> None:
        """Change the mode, at once and seen at once, as ArduPilot does."""
        self.craft.mode = mode
        if mode in {"LAND", "RTL"} and self.kind != 10:
            self.kernel.call_at(self.kernel.now() + 5 * S, self._down)
        self._heartbeat()

    def _down(self) -> None:
        if self.craft.mode in {"LAND", "RTL"}:
            self.craft.up, self.craft.landed_state, self.craft.status, self.craft.armed = 0.0, 1, 3, False

    def sent(self, name: str) -> list[dict[str, Any]]:
        """The fields of all frames of this name that it heard."""
        return [frame.fields for frame in self.heard if frame.name == name]

    def commands(self) -> list[int]:
        """The commands that it heard, requests for messages left out."""
        return [f["command"] for f in self.sent("COMMAND_LONG") if f["command"] not in {INTERVAL, ASK}]


class Bench:
    """``fly(mission)`` runs it as a task and returns what it returns, or raises what it raises."""

    peer: Any = FakeAutopilot
    opener: Any = staticmethod(open_driver)
    codec: Any = MAVLINK
    standing = "HOLD"  # the mode in which a rover begins

    def __init__(
        self, kind: type[Vehicle] = Drone, *, options: dict[str, str] | None = None, **stated: Any
    ) -> None:
        self.events: list[Any] = []
        self.kernel = VirtualKernel(record=self.events.append)
        self.link, theirs = in_process(self.kernel, name="radio", codec=self.codec)
        self.autopilot = self.peer(self.kernel, theirs, 2 if kind is Drone else 10)
        self.craft = self.autopilot.craft
        if kind is not Drone:
            self.craft.mode = self.standing
        driver = self.opener(self.kernel, self.link, "craft_1", options or {})
        self.vehicle: Any = kind(self.kernel, "craft_1", driver, **stated)

    def fly(self, mission: Callable[[Any], Any]) -> Any:
        outcome: list[Any] = []

        def body() -> None:
            try:
                outcome.append(mission(self.vehicle))
            except Exception as error:
                outcome.append(error)
            self.kernel.cancel(scope, "done")

        scope = self.kernel.root.child("mission")
        self.kernel.spawn(body, "mission", Place("mission"), scope)
        until = self.kernel.now() + 2 * HOUR
        while not outcome and self.kernel.now() < until:
            self.kernel.run(self.kernel.now() + S)
        (found,) = outcome
        if isinstance(found, Exception):
            raise found
        return found

    def after(self, seconds: float, action: Callable[[], None]) -> None:
        self.kernel.call_at(self.kernel.now() + round(seconds * S), action)

    def told(self, kind: type) -> list[Any]:
        return [event for event in self.events if isinstance(event, kind)]


@pytest.fixture
def bench() -> Callable[..., Bench]:
    return Bench

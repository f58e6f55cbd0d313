"""A scripted PX4: heartbeats once a second, OFFBOARD only with a stream, sticks that are missed, take-offs
that end short. It does what the recordings of PX4 1.14 show, at once where they take time.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from math import isnan
from typing import Any

import pytest

from volery.base.time import MS, S
from volery.drivers.px4 import open_driver
from volery.drivers.px4.events import event_id
from volery.drivers.px4.modes import BY_STICKS, HOLD, LAND, MODES, OFFBOARD, RTL, TAKEOFF
from volery.kernel.virtual import VirtualKernel
from volery.links.link import Frame, Link
from volery.links.mavlink import message_type

HOME = (454671168, -737578362, 32_575)  # degE7, degE7, mm AMSL
ACCEPTED, REJECTED, UNSUPPORTED = 0, 1, 3
SET_MODE, ARM, CLIMB, SPEED, GO, INTERVAL, ASK, GET_HOME = 176, 400, 22, 178, 192, 511, 512, 410
HEALTHY, UNHEALTHY = 840990783, 572555327
LOST_AFTER = S  # COM_OF_LOSS_T
NORTH_M, EAST_M = 1.1113e-2, 0.7812e-2  # metres in 1e-7 degrees here
NAMES = {mode.number: name for name, mode in MODES.items()}


@dataclass
class Craft:
    """What the autopilot believes."""

    mode: str = HOLD
    armed: bool = False
    status: int = 3
    landed_state: int = 1
    north: float = 0.0
    east: float = 0.0
    up: float = 0.0
    velocity: tuple[float, float, float] = (0.0, 0.0, 0.0)
    heading: float = 0.0
    healthy: bool = True
    flags: int = 831
    placed: bool = True


@dataclass
class FakePx4:
    """``on_loss`` is the mode that it enters when it misses OFFBOARD's stream. ``short`` is by how much
    take-offs end short.
    """

    kernel: VirtualKernel
    link: Link
    kind: int = 2
    craft: Craft = field(default_factory=Craft)
    refuse: dict[int, list[str]] = field(default_factory=dict)
    ignore: set[int] = field(default_factory=set)
    heard: list[Frame] = field(default_factory=list)
    times: list[int] = field(default_factory=list)
    streams: set[str] = field(default_factory=set)
    deaf: bool = False
    mute: bool = False
    on_loss: str = "POSCTL"
    short: float = 1.03
    climb_s: float = 10.0
    system: int = 3
    firmware: int = 12
    version: int = 17694975
    parameters: dict[str, float] = field(default_factory=dict)
    intended: str = HOLD

    def __post_init__(self) -> None:
        self.mission: dict[int, dict[str, Any]] = {}
        self.setpoint: dict[str, Any] | None = None
        self.streamed_at = self.sticks_at = -10 * S
        self.link.receive(self._receive)
        self.kernel.every(S, self._heartbeat)
        self.kernel.every(50 * MS, self._live)
        self.kernel.every(100 * MS, self._stream)

    # -- speaking

    def say(self, name: str, **fields: Any) -> None:
        if not self.mute:
            self.link.send(Frame(name, fields, self.system, 1))

    def text(self, words: str, severity: int = 6) -> None:
        self.say("STATUSTEXT", severity=severity, text=words + "\t")

    def event(self, name: str, level: int, arguments: bytes = b"") -> None:
        padded = tuple(arguments.ljust(40, b"\0"))
        self.say("EVENT", id=event_id(name), log_levels=level | level << 4, arguments=padded)

    def report(self, *checks: tuple[str, int, int]) -> None:
        """Arming checks that fail: name, level, modes."""
        self.event("commander_arming_check_summary", 8)
        for name, level, modes in checks:
            self.event(name, level, modes.to_bytes(4, "little"))
        self.event("commander_health_summary", 8)

    def _heartbeat(self) -> None:
        craft = self.craft
        self.say(
            "HEARTBEAT",
            type=self.kind,
            autopilot=self.firmware,
            base_mode=29 + 128 * craft.armed,
            custom_mode=MODES[craft.mode].number,
            system_status=craft.status,
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
                lat=HOME[0] + round(craft.north / NORTH_M),
                lon=HOME[1] + round(craft.east / EAST_M),
                alt=HOME[2] + round(craft.up * 1000),
                relative_alt=round(craft.up * 1000),
                vx=round(north * 100),
                vy=round(east * 100),
                vz=round(-up * 100),
                hdg=round(craft.heading * 100),
            )

    def _sys_status(self) -> None:
        can_arm = self.craft.healthy and (
            self.craft.mode not in BY_STICKS | {OFFBOARD} or self._sticks_come()
        )
        health = HEALTHY if can_arm else UNHEALTHY
        self.say(
            "SYS_STATUS",
            onboard_control_sensors_health=health,
            voltage_battery=16200,
            current_battery=-1,
            battery_remaining=100,
        )

    def _estimator_status(self) -> None:
        self.say("ESTIMATOR_STATUS", flags=self.craft.flags)

    def _extended_sys_state(self) -> None:
        self.say("EXTENDED_SYS_STATE", landed_state=self.craft.landed_state)

    def _home_position(self) -> None:
        if self.craft.placed:
            self.say("HOME_POSITION", latitude=HOME[0], longitude=HOME[1], altitude=HOME[2])

    def _gps_raw_int(self) -> None:
        self.say("GPS_RAW_INT", fix_type=3, satellites_visible=10)

    def _local_position_ned(self) -> None:
        north, east, up = self.craft.velocity
        self.say("LOCAL_POSITION_NED", x=self.craft.north, y=self.craft.east, vx=north, vy=east, vz=-up)

    def _mission_current(self) -> None:
        self.say("MISSION_CURRENT", seq=0, mission_state=0)

    # -- living

    def _sticks_come(self) -> bool:
        return self.kernel.now() - self.sticks_at < S // 2

    def _streamed(self) -> bool:
        return self.kernel.now() - self.streamed_at < LOST_AFTER

    def _live(self) -> None:
        craft = self.craft
        if self.intended != OFFBOARD or not craft.armed:
            return
        if not self._streamed() and craft.mode == OFFBOARD:
            craft.mode, craft.status, craft.velocity = self.on_loss, 5, (0.0, 0.0, -0.7)
            self.text("Failsafe activated", 2)
        elif self._streamed():
            craft.mode, craft.status = OFFBOARD, 4  # by itself, as PX4 does
            self._follow()

    def _follow(self) -> None:
        asked = self.setpoint or {}
        self.craft.velocity = (asked["vx"], asked["vy"], -asked["vz"])
        self.craft.north += asked["vx"] * 0.05
        self.craft.east += asked["vy"] * 0.05
        if not asked["type_mask"] & 0x400:
            self.craft.heading = asked["yaw"] * 57.29578 % 360.0

    # -- listening

    def _receive(self, frame: Frame) -> None:
        if self.deaf:
            return
        self.heard.append(frame)
        self.times.append(self.kernel.now())
        fields = frame.fields
        if frame.name in {"COMMAND_LONG", "COMMAND_INT"}:
            self._command(fields["command"], fields)
        elif frame.name == "SET_POSITION_TARGET_LOCAL_NED" and fields["coordinate_frame"] == 1:
            self.setpoint, self.streamed_at = fields, self.kernel.now()
        elif frame.name == "MANUAL_CONTROL":
            self._take_sticks(fields)
        elif frame.name == "SET_MODE":
            number = fields["custom_mode"]
            self._command(SET_MODE, {"param2": number >> 16 & 0xFF, "param3": number >> 24})
        elif frame.name == "PARAM_REQUEST_READ" and fields["param_id"] in self.parameters:
            self._tell_parameter(fields["param_id"])
        elif frame.name in {"MISSION_COUNT", "MISSION_ITEM_INT"}:
            self._take_mission(frame)

    def _tell_parameter(self, name: str) -> None:
        value = self.parameters[name]
        self.say("PARAM_VALUE", param_id=name, param_value=value, param_type=9)

    def _take_sticks(self, fields: dict[str, Any]) -> None:
        self.sticks_at = self.kernel.now()
        moved = any(abs(fields[axis]) > 300 for axis in "xyr") or abs(fields["z"] - 500) > 150
        if moved and self.craft.landed_state == 2 and self.craft.mode.startswith("AUTO."):
            self.enter("POSCTL")
            self.event("failsafe_rc_override", 6)

    def _take_mission(self, frame: Frame) -> None:
        if frame.name == "MISSION_COUNT":
            self.mission = {-1: frame.fields}
        else:
            self.mission[frame.fields["seq"]] = frame.fields
        had = len(self.mission) - 1
        to = {"target_system": 255, "target_component": 190}
        if had < self.mission[-1]["count"]:
            self.say("MISSION_REQUEST" if had == 0 else "MISSION_REQUEST_INT", seq=had, **to)
        else:
            self.say("MISSION_ACK", type=ACCEPTED, **to)

    def _command(self, command: int, fields: dict[str, Any]) -> None:
        if command in self.ignore:
            return
        if command in self.refuse:
            self._acknowledge(command, REJECTED)
            for words in self.refuse[command]:
                self.text(words, 2)
            return
        result = self._obey(command, fields)
        self._acknowledge(command, result)

    def _acknowledge(self, command: int, result: int) -> None:
        self.say("COMMAND_ACK", command=command, result=result, target_system=255, target_component=190)

    def _obey(self, command: int, fields: dict[str, Any]) -> int:
        obeying: dict[int, Callable[[dict[str, Any]], int]] = {
            INTERVAL: self._interval,
            ASK: self._version,
            SET_MODE: self._set_mode,
            ARM: self._arm,
            CLIMB: self._climb,
            GO: self._go,
            SPEED: lambda _: ACCEPTED,
            GET_HOME: self._tell_home,
        }
        obey = obeying.get(command)
        return UNSUPPORTED if obey is None else obey(fields)

    def _interval(self, fields: dict[str, Any]) -> int:
        known = ("GLOBAL_POSITION_INT", "SYS_STATUS", "ESTIMATOR_STATUS", "EXTENDED_SYS_STATE")
        known = (*known, "HOME_POSITION", "GPS_RAW_INT", "MISSION_CURRENT", "LOCAL_POSITION_NED")
        self.streams.update(name for name in known if message_type(name).id == int(fields["param1"]))
        return ACCEPTED

    def _tell_home(self, _: dict[str, Any]) -> int:
        self._home_position()
        return ACCEPTED

    def _version(self, _: dict[str, Any]) -> int:
        self.say("AUTOPILOT_VERSION", flight_sw_version=self.version)
        return ACCEPTED

    def _set_mode(self, fields: dict[str, Any]) -> int:
        mode = NAMES.get(int(fields["param3"]) << 24 | int(fields["param2"]) << 16)
        flying = self.craft.landed_state == 2
        if mode == OFFBOARD and flying and not self._streamed():
            self.text("Switching to OFFBOARD is currently not available", 2)
            return REJECTED
        if mode in BY_STICKS and flying and not self._sticks_come():
            return REJECTED
        if mode is not None:
            self.enter(mode)
        return ACCEPTED

    def _arm(self, fields: dict[str, Any]) -> int:
        craft = self.craft
        if fields["param1"] == 0.0:
            if craft.landed_state != 1 and fields["param2"] != 21196:
                self.text("Disarming denied! Not landed", 2)
                return REJECTED
            craft.armed, craft.status = False, 3
            return ACCEPTED
        if not craft.healthy or (craft.mode in BY_STICKS and not self._sticks_come()):
            return REJECTED
        craft.armed, craft.status = True, 4
        return ACCEPTED

    def _climb(self, fields: dict[str, Any]) -> int:
        assert isnan(fields["param5"])
        self.enter(TAKEOFF)
        height = fields["param7"] - HOME[2] / 1000.0
        self.kernel.call_at(self.kernel.now() + S, self._lift)
        self.kernel.call_at(self.kernel.now() + round(self.climb_s * S), lambda: self._top(height))
        return ACCEPTED

    def _lift(self) -> None:
        if self.craft.armed:
            self.craft.landed_state = 3

    def _top(self, height: float) -> None:
        if self.craft.armed and self.craft.mode == TAKEOFF:
            self.craft.up, self.craft.landed_state = max(height - self.short, 2.5), 2
            self.enter(HOLD)

    def _go(self, fields: dict[str, Any]) -> int:
        if fields["param2"] != 1.0:
            return UNSUPPORTED
        self.enter(HOLD)
        goal = fields["x"], fields["y"], fields["z"]
        self.kernel.call_at(self.kernel.now() + 2 * S, lambda: self._there(*goal))
        return ACCEPTED

    def _there(self, latitude: int, longitude: int, amsl: float) -> None:
        if self.craft.mode == HOLD:
            self.craft.north = (latitude - HOME[0]) * NORTH_M
            self.craft.east = (longitude - HOME[1]) * EAST_M
            if self.kind == 2:
                self.craft.up = amsl - HOME[2] / 1000.0

    def enter(self, mode: str) -> None:
        """Somebody changes the mode: at once, and seen with the next heartbeat."""
        self.intended = self.craft.mode = mode
        self.craft.velocity = (0.0, 0.0, 0.0)
        if mode in {LAND, RTL} and self.kind == 2:
            self.kernel.call_at(self.kernel.now() + 15 * S, self._down)

    def _down(self) -> None:
        if self.craft.mode in {LAND, RTL}:
            self.craft.up, self.craft.landed_state, self.craft.status, self.craft.armed = 0.0, 1, 3, False

    def sent(self, name: str) -> list[dict[str, Any]]:
        """The fields of all frames of this name that it heard."""
        return [frame.fields for frame in self.heard if frame.name == name]

    def since(self, name: str, when: int) -> list[dict[str, Any]]:
        """Those that it heard after *when*."""
        both = zip(self.times, self.heard, strict=True)
        return [frame.fields for at, frame in both if frame.name == name and at > when]

    def commands(self) -> list[int]:
        """The commands that it heard, requests for messages left out."""
        heard = [frame.fields["command"] for frame in self.heard if frame.name.startswith("COMMAND_")]
        return [command for command in heard if command not in {INTERVAL, ASK, GET_HOME}]


@pytest.fixture
def bench(bench: Any) -> Any:
    class Px4Bench(bench):  # type: ignore[misc]  # the fixture of the folder above
        peer = FakePx4
        opener = staticmethod(open_driver)
        standing = HOLD

    return Px4Bench

"""A scripted PX4: heartbeats once a second, OFFBOARD only with a stream, sticks that are missed, take-offs
that end short. It does what the recordings of PX4 1.14 show, at once where they take time.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from math import degrees, isfinite, isnan
from typing import Any

import pytest

from rigs import scripted
from rigs.bench import Bench
from rigs.scripted import ACCEPTED, ASK, GET_HOME, INTERVAL, STREAMED, Scripted
from volery.base.time import MS, S, from_seconds
from volery.links.frame import Frame
from volery.vehicles.drivers.px4 import open_driver
from volery.vehicles.drivers.px4.events import event_id
from volery.vehicles.drivers.px4.modes import HOLD, LAND, MANUAL_MODES, MODES, OFFBOARD, RTL, TAKEOFF

HOME = (454671168, -737578362, 32_575)  # degE7, degE7, mm AMSL
REJECTED, UNSUPPORTED = 1, 3
SET_MODE, ARM, CLIMB, SPEED, GO = 176, 400, 22, 178, 192
HEALTHY, UNHEALTHY = 840990783, 572555327
LOST_AFTER = S  # COM_OF_LOSS_T
NAMES = {mode.number: name for name, mode in MODES.items()}


@dataclass
class Craft(scripted.Craft):
    """What PX4 believes besides."""

    mode: str = HOLD
    healthy: bool = True
    flags: int = 831


@dataclass
class FakePx4(Scripted):
    """``on_loss`` is the mode that it enters when it misses OFFBOARD's stream. ``short`` is by how much
    take-offs end short.
    """

    craft: Craft = field(default_factory=Craft)
    times: list[int] = field(default_factory=list)
    on_loss: str = "POSCTL"
    short: float = 1.03
    climb_s: float = 10.0
    system: int = 3
    firmware: int = 12
    version: int = 17694975
    mission_state: int = 0
    intended: str = HOLD
    sticks_at_arming: list[bool] = field(default_factory=list)

    home = HOME
    metres = (1.1113e-2, 0.7812e-2)
    streamed = (*STREAMED, "ESTIMATOR_STATUS", "LOCAL_POSITION_NED")
    refusal = REJECTED
    item_requests = ("MISSION_REQUEST", "MISSION_REQUEST_INT")

    def __post_init__(self) -> None:
        self.setpoint: dict[str, Any] | None = None
        self.streamed_at = self.sticks_at = -10 * S
        self.kernel.every(50 * MS, self._live)
        super().__post_init__()

    # -- speaking

    def text(self, words: str, severity: int = 6) -> None:
        super().text(words + "\t", severity)

    def event(self, name: str, level: int, arguments: bytes = b"") -> None:
        padded = tuple(arguments.ljust(40, b"\0"))
        self.say("EVENT", id=event_id(name), log_levels=level | level << 4, arguments=padded)

    def report(self, *checks: tuple[str, int, int]) -> None:
        """Arming checks that fail: name, level, modes."""
        self.event("commander_arming_check_summary", 8)
        for name, level, modes in checks:
            self.event(name, level, modes.to_bytes(4, "little"))
        self.event("commander_health_summary", 8)

    def mode_words(self) -> tuple[int, int]:
        return 29, MODES[self.craft.mode].number

    def _sys_status(self) -> None:
        can_arm = self.craft.healthy and (
            self.craft.mode not in MANUAL_MODES | {OFFBOARD} or self._sticks_come()
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

    def _local_position_ned(self) -> None:
        north, east, up = self.craft.velocity
        self.say("LOCAL_POSITION_NED", x=self.craft.north, y=self.craft.east, vx=north, vy=east, vz=-up)

    def _mission_current(self) -> None:
        self.say("MISSION_CURRENT", seq=0, mission_state=self.mission_state)

    # -- living

    def _sticks_come(self) -> bool:
        return self.kernel.now() - self.sticks_at < from_seconds(self.parameters.get("COM_RC_LOSS_T", 0.5))

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

    # -- listening

    def _receive(self, frame: Frame) -> None:
        if not self.deaf:
            self.times.append(self.kernel.now())
        super()._receive(frame)

    def take(self, name: str, fields: dict[str, Any]) -> None:
        if name == "SET_POSITION_TARGET_LOCAL_NED" and fields["coordinate_frame"] == 1:
            self.setpoint, self.streamed_at = fields, self.kernel.now()
        elif name == "SET_ATTITUDE_TARGET":
            self.setpoint, self.streamed_at = {"vx": 0.0, "vy": 0.0, "vz": 0.0}, self.kernel.now()
        elif name == "MANUAL_CONTROL":
            self._take_sticks(fields)
        elif name == "SET_MODE":
            number = fields["custom_mode"]
            self._command(SET_MODE, {"param2": number >> 16 & 0xFF, "param3": number >> 24})

    def _take_sticks(self, fields: dict[str, Any]) -> None:
        self.sticks_at = self.kernel.now()
        moved = any(abs(fields[axis]) > 300 for axis in "xyr") or abs(fields["z"] - 500) > 150
        if moved and self.craft.landed_state == 2 and self.craft.mode.startswith("AUTO."):
            self.enter("POSCTL")
            self.event("failsafe_rc_override", 6)

    def obey(self, command: int, fields: dict[str, Any]) -> None:
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
        self.acknowledge(command, UNSUPPORTED if obey is None else obey(fields))

    def _interval(self, fields: dict[str, Any]) -> int:
        self.begin_to_stream(int(fields["param1"]))
        return ACCEPTED

    def _tell_home(self, _: dict[str, Any]) -> int:
        self._home_position()
        return ACCEPTED

    def _version(self, _: dict[str, Any]) -> int:
        self.tell_version()
        return ACCEPTED

    def _set_mode(self, fields: dict[str, Any]) -> int:
        mode = NAMES.get(int(fields["param3"]) << 24 | int(fields["param2"]) << 16)
        flying = self.craft.landed_state == 2
        if mode == OFFBOARD and flying and not self._streamed():
            self.text("Switching to OFFBOARD is currently not available", 2)
            return REJECTED
        if mode in MANUAL_MODES and flying and not self._sticks_come():
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
        if not craft.healthy or (craft.mode in MANUAL_MODES and not self._sticks_come()):
            return REJECTED
        self.sticks_at_arming.append(self._sticks_come())
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
        if isfinite(fields["param4"]):
            self.craft.heading = degrees(fields["param4"]) % 360.0
        self.kernel.call_at(self.kernel.now() + 2 * S, lambda: self._there(*goal))
        return ACCEPTED

    def _there(self, latitude: int, longitude: int, amsl: float) -> None:
        if self.craft.mode == HOLD:
            self.craft.north = (latitude - HOME[0]) * self.metres[0]
            self.craft.east = (longitude - HOME[1]) * self.metres[1]
            if self.kind == 2:
                self.craft.up = amsl - HOME[2] / 1000.0

    def enter(self, mode: str) -> None:
        """Another changes the mode: at once, and seen with the next heartbeat."""
        self.intended = self.craft.mode = mode
        self.craft.velocity = (0.0, 0.0, 0.0)
        if mode in {LAND, RTL} and self.kind == 2:
            self.kernel.call_at(self.kernel.now() + 15 * S, lambda: self.down(LAND, RTL))

    def since(self, name: str, when: int) -> list[dict[str, Any]]:
        """Those that it received after *when*."""
        both = zip(self.times, self.received, strict=True)
        return [frame.fields for at, frame in both if frame.name == name and at > when]


class Px4Bench(Bench):
    peer = FakePx4
    opener = staticmethod(open_driver)
    standing = HOLD


@pytest.fixture
def bench() -> Callable[..., Bench]:
    return Px4Bench

"""A scripted ArduPilot, and a bench that holds it and the driver that commands it."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

import pytest

from rigs import scripted
from rigs.bench import Bench
from rigs.scripted import ACCEPTED, ASK, INTERVAL, STREAMED, Scripted
from volery.base.time import S
from volery.vehicles.drivers.ardupilot import open_driver
from volery.vehicles.drivers.ardupilot.modes import COPTER, NUMBERS, ROVER

SET_MODE, ARM, TAKEOFF, YAW = 176, 400, 22, 115
COMMON_HEALTH = 0x10000000  # the arming checks pass


@dataclass
class Craft(scripted.Craft):
    """What ArduPilot believes besides."""

    mode: str = "STABILIZE"
    health: int = COMMON_HEALTH
    ekf: int = 831


@dataclass
class FakeAutopilot(Scripted):
    """Commands are acknowledged before they are obeyed, and then shown to ``on_command``."""

    craft: Craft = field(default_factory=Craft)
    on_command: Callable[[int, dict[str, Any]], None] = lambda command, fields: None
    climb_s: float = 2.0
    follows: bool = False  # velocities at once
    firmware: int = 3
    version: int = 0x040506FF

    home = (-353632610, 1491652300, 584_000)
    metres = (1.1095e-2, 0.9080e-2)
    streamed = (*STREAMED, "EKF_STATUS_REPORT")
    refusal = 4  # FAILED

    def __post_init__(self) -> None:
        self.modes = ROVER if self.kind == 10 else COPTER
        self.numbers = NUMBERS["rover" if self.kind == 10 else "drone"]
        super().__post_init__()

    # -- speaking

    def mode_words(self) -> tuple[int, int]:
        return 81, self.numbers[self.craft.mode]

    def _global_position_int(self) -> None:
        if self.craft.placed:
            super()._global_position_int()
        else:
            self.say("GLOBAL_POSITION_INT", hdg=0)

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

    def _mission_current(self) -> None:
        self.say("MISSION_CURRENT", seq=1, mission_state=3)

    # -- listening

    def take(self, name: str, fields: dict[str, Any]) -> None:
        if name == "SET_POSITION_TARGET_LOCAL_NED" and self.follows:
            self.craft.velocity = (fields["vx"], fields["vy"], -fields["vz"])
        if name == "SET_POSITION_TARGET_GLOBAL_INT" and self.craft.mode == "GUIDED":
            latitude, longitude, altitude = self.home
            self.craft.north = (fields["lat_int"] - latitude) * self.metres[0]
            self.craft.east = (fields["lon_int"] - longitude) * self.metres[1]
            amsl = fields["coordinate_frame"] == 5
            self.craft.up = fields["alt"] - (altitude / 1000.0 if amsl else 0.0)

    def obey(self, command: int, fields: dict[str, Any]) -> None:
        self.acknowledge(command, ACCEPTED)
        self._do(command, fields)
        self.on_command(command, fields)

    def _do(self, command: int, fields: dict[str, Any]) -> None:
        if command == INTERVAL:
            self.begin_to_stream(int(fields["param1"]))
        elif command == ASK:
            self.tell_version()
        elif command == SET_MODE:
            self.enter(self.modes[int(fields["param2"])])
        elif command == ARM:
            self.craft.armed = fields["param1"] == 1.0
        elif command == TAKEOFF:
            self.kernel.call_at(
                self.kernel.now() + round(self.climb_s * S), lambda: self._lift(fields["param7"])
            )
        elif command == YAW:
            self.craft.heading = fields["param1"]

    def _lift(self, height: float) -> None:
        if self.craft.armed and self.craft.mode == "GUIDED":
            self.craft.up, self.craft.landed_state, self.craft.status = height, 2, 4

    def enter(self, mode: str) -> None:
        """Change the mode, at once and seen at once, as ArduPilot does."""
        self.craft.mode = mode
        if mode in {"LAND", "RTL"} and self.kind != 10:
            self.kernel.call_at(self.kernel.now() + 5 * S, lambda: self.down("LAND", "RTL"))
        self._heartbeat()


class ArduPilotBench(Bench):
    peer = FakeAutopilot
    opener = staticmethod(open_driver)


@pytest.fixture
def bench() -> Callable[..., Bench]:
    return ArduPilotBench

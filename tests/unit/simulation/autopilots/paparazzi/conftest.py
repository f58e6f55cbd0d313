"""A simulated Paparazzi rotorcraft and a ground segment that is no more than a link and the codec."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from random import Random
from typing import Any

import pytest

from volery.base.frames import LocalFrame
from volery.base.time import MS, S
from volery.kernel.virtual import VirtualKernel
from volery.links.frame import Frame
from volery.links.in_process_link import in_process_pair
from volery.links.paparazzi_aircraft import stock_aircraft
from volery.links.wire_faults import WireFaults, faulty_pair
from volery.simulation.autopilots.flight_stack.flight import Flight, make_world
from volery.simulation.autopilots.paparazzi import FIRMWARE
from volery.simulation.world.body_specs import BatteryPack, Multirotor
from volery.simulation.world.environment_models import Wind

FRAME = LocalFrame(48.0, 11.0, 500.0)
AIRCRAFT = 7


class Craft:
    """One rotorcraft with accurate sensors, booted unless ``warm=False``, and the messages that it sent."""

    def __init__(
        self,
        *,
        warm: bool = True,
        parameters: Mapping[str, float] | None = None,
        through_bytes: bool = False,
        battery: BatteryPack | None = None,
        wind: Wind | None = None,
    ) -> None:
        self.kernel = VirtualKernel()
        body = Multirotor(sensors="rtk", battery=battery or Multirotor().battery)
        _, flights = make_world(self.kernel.now, [body], seed=5, frame=FRAME, wind=wind)
        self.flight: Flight = flights[0]
        self.autopilot = FIRMWARE.create(
            self.kernel, self.flight, system=AIRCRAFT, parameters=parameters, warm=warm
        )
        codec = FIRMWARE.codec
        assert codec is not None
        theirs: Any
        if through_bytes:
            ours, theirs = faulty_pair(self.kernel, "ground", WireFaults(), Random(1), delay=MS, codec=codec)
            self.link: Any = ours
        else:
            self.link, theirs = in_process_pair(self.kernel, MS, "ground", codec)
        self.received: list[Frame] = []
        self.link.receive(self.received.append)
        self.autopilot.connect(theirs)
        if warm:
            self.run(3.0)

    def run(self, seconds: float) -> None:
        """Let time pass."""
        end = self.kernel.now() + round(seconds * S)
        self.kernel.call_at(end, lambda: None)
        self.kernel.run(end)

    def until(self, condition: Callable[[], bool], within: float) -> None:
        """Let time pass until it holds."""
        for _ in range(round(within * 10)):
            if condition():
                return
            self.run(0.1)
        raise AssertionError(f"not within {within} s; mode {self.mode}, {self.position}")

    # -- the ground

    def send(self, name: str, **fields: Any) -> None:
        """As the ground, to this aircraft unless the fields say otherwise."""
        self.link.send(Frame(name, {"ac_id": AIRCRAFT, **fields} if name != "PING" else fields, 0, 0))

    def set(self, name: str, value: float) -> None:
        """Write a setting, by name, and let it act."""
        self.send("SETTING", index=stock_aircraft().setting(name).number, value=value)
        self.run(0.1)

    def block(self, name: str) -> None:
        """Jump to a block, by name, and let it begin."""
        self.send("BLOCK", block_id=stock_aircraft().block(name).number)
        self.run(0.2)

    def guide(self, flags: int, x: float, y: float, z: float, yaw: float = 0.0) -> None:
        """A guided set-point."""
        self.send("GUIDED_SETPOINT_NED", flags=flags, x=x, y=y, z=z, yaw=yaw)

    def sticks(self, *, mode: int = 2, **deflections: int) -> None:
        """One frame of RC_UP; the switch is 0, 1 or 2."""
        axes = (deflections.get(name, 0) for name in ("roll", "pitch", "yaw", "throttle"))
        self.send("RC_UP", channels=(*axes, 127 * (mode - 1), 127))

    def last(self, name: str) -> dict[str, Any]:
        """The fields of the last message of that name."""
        return next(frame.fields for frame in reversed(self.received) if frame.name == name)

    def count(self, name: str) -> int:
        """Number of received messages of that name."""
        return sum(frame.name == name for frame in self.received)

    # -- looking

    @property
    def mode(self) -> str:
        """Its name."""
        return self.autopilot.vehicle.mode.name

    @property
    def armed(self) -> bool:
        """Motors on."""
        return self.autopilot.vehicle.armed

    @property
    def position(self) -> tuple[float, float, float]:
        """Estimated north, east, down about the local origin [m]."""
        return self.autopilot.vehicle.estimate.position

    @property
    def up(self) -> float:
        """Estimated metres above the local origin."""
        return -self.position[2]

    @property
    def block_name(self) -> str:
        """Of the flight plan."""
        navigation = self.autopilot.vehicle.firmware_state.navigation
        name: str = navigation.plan.blocks[navigation.block].name
        return name

    # -- flying

    def in_the_air(self) -> None:
        """Up by its flight plan, to Standby at 5 m."""
        self.block("Start Engine")
        self.block("Takeoff")
        self.until(lambda: self.block_name == "Standby" and self.up > 4.8, 20.0)
        self.run(18.0)  # it swings about its waypoint

    def guided(self, down: float = -10.0) -> None:
        """In GUIDED, in the air above the origin."""
        self.set("mode", 19.0)
        self.set("kill_throttle", 0.0)
        self.guide(0, 0.0, 0.0, down)
        self.until(lambda: abs(self.position[2] - down) < 0.5, 40.0)
        self.run(16.0)  # a height fades in slowly


@pytest.fixture
def craft() -> Craft:
    """On the ground, ready to fly."""
    return Craft()


@pytest.fixture
def make() -> Callable[..., Craft]:
    """Others than the usual."""
    return Craft

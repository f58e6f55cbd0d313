"""A simulated DJI aircraft on a graph, and a program that asks of it what it likes."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import pytest

from rigs.missions import carried_out
from volery.base.frames import LocalFrame
from volery.base.time import MS, S
from volery.kernel.task import ExecutionContext
from volery.kernel.virtual import VirtualKernel
from volery.ros.graph import EmbeddedGraph, ServiceError
from volery.ros.messages import new, request
from volery.simulation.autopilots.dji import FIRMWARE
from volery.simulation.autopilots.flight_stack.flight import make_world
from volery.simulation.world.body_specs import Multirotor
from volery.trace.events import Text

FRAME = LocalFrame(46.0, -103.0, 900.0)
TYPES = {
    "attitude": "geometry_msgs/QuaternionStamped",
    "battery_state": "sensor_msgs/BatteryState",
    "display_mode": "std_msgs/UInt8",
    "flight_status": "std_msgs/UInt8",
    "gps_health": "std_msgs/UInt8",
    "gps_position": "sensor_msgs/NavSatFix",
    "height_above_takeoff": "std_msgs/Float32",
    "imu": "sensor_msgs/Imu",
    "local_frame_ref": "sensor_msgs/NavSatFix",
    "local_position": "geometry_msgs/PointStamped",
    "rc": "sensor_msgs/Joy",
    "rc_connection_status": "std_msgs/UInt8",
    "velocity": "geometry_msgs/Vector3Stamped",
}


class Apron:
    """One aircraft under /d/<package>, and a program whose flow of control is the test's."""

    def __init__(
        self,
        package: str = "dji_sdk",
        *,
        warm: bool = True,
        parameters: dict[str, float] | None = None,
    ) -> None:
        self.package = package
        self.events: list[Any] = []
        self.kernel = VirtualKernel(record=self.events.append)
        body = Multirotor(sensors="rtk")
        _, (self.flight,) = make_world(self.kernel.now, [body], seed=7, frame=FRAME)
        self.autopilot = FIRMWARE.create(self.kernel, self.flight, warm=warm, name="d", parameters=parameters)
        self.graph = EmbeddedGraph(self.kernel, unrecorded=True)
        self.autopilot.join(self.graph, f"/d/{package}", ExecutionContext("d"))
        self.node = self.graph.node("program", context=ExecutionContext("program"))
        self.seen: dict[str, Any] = {}
        self.counts: dict[str, int] = {}
        self._publishers: dict[str, Any] = {}

    def hear(self, *topics: str) -> None:
        """Subscribe."""
        group = self.node.group(lambda work: work.run())
        for topic in topics:

            def take(message: Any, topic: str = topic) -> None:
                self.seen[topic] = message
                self.counts[topic] = self.counts.get(topic, 0) + 1

            self.node.subscribe(f"/d/{self.package}/{topic}", TYPES[topic], take, group=group)

    def call(self, name: str, kind: str, **fields: Any) -> Any:
        """The response of a service: in /d for a name that begins with a slash."""
        full = f"/d{name}" if name.startswith("/") else f"/d/{self.package}/{name}"
        asked = request(f"{self.package}/srv/{kind}", **fields)
        return self.node.client(full, f"{self.package}/srv/{kind}").call(asked, within=120 * S)

    def asked(self, name: str, kind: str, value: int) -> bool:
        """Whether a request with that number in all of its fields is accepted."""
        wanted = request(kind)
        for field in wanted.__match_args__:
            if isinstance(getattr(wanted, field), bool | int | float):
                setattr(wanted, field, type(getattr(wanted, field))(value))
        try:
            response = self.node.client(name, kind).call(wanted, within=120 * S)
        except ServiceError:
            return False
        return bool(getattr(response, "result", False))

    def task(self, number: int) -> bool:
        return bool(self.call("drone_task_control", "DroneTaskControl", task=number).result)

    def authority(self, wanted: bool = True) -> bool:
        response = self.call("sdk_control_authority", "SDKControlAuthority", control_enable=int(wanted))
        return bool(response.result)

    def motors(self, on: bool) -> bool:
        return bool(self.call("drone_arm_control", "DroneArmControl", arm=int(on)).result)

    def activate(self) -> None:
        assert self.call("activation", "Activation").result

    def send(self, topic: str, *axes: float) -> None:
        """A set-point, once."""
        if topic not in self._publishers:
            name = f"/d/{self.package}/flight_control_setpoint_{topic}"
            self._publishers[topic] = self.node.advertise(name, "sensor_msgs/Joy")
        self._publishers[topic].publish(new("sensor_msgs/Joy", axes=list(axes)))

    def keep_sending(self, seconds: float, topic: str, *axes: float) -> None:
        """At 50 Hz."""
        for _ in range(round(seconds * 50)):
            self.send(topic, *axes)
            self.wait(0.02)

    def wait(self, seconds: float) -> None:
        self.node.sleep(round(seconds * S))

    def until(self, holds: Callable[[], bool], within: float = 60.0) -> None:
        """Wait until it holds."""
        for _ in range(round(within * 10)):
            if holds():
                return
            self.wait(0.1)
        pytest.fail(f"not within {within} s")

    def fly(self) -> None:
        """Activated, with the authority, hovering after a take-off."""
        self.wait(0.5)
        self.activate()
        assert self.authority()
        assert self.task(4)
        self.until(lambda: self.mode == 6 and self.status == 2)

    @property
    def mode(self) -> int:
        return int(self.autopilot.vehicle.firmware_state.mode)

    @property
    def status(self) -> int:
        return int(self.autopilot.vehicle.firmware_state.status)

    @property
    def place(self) -> tuple[float, float, float]:
        """True metres east, north and up of where it stood."""
        return self.flight.truth().position

    def texts(self) -> list[str]:
        return [event.text for event in self.events if isinstance(event, Text)]

    def run(self, body: Callable[[], None]) -> None:
        """As the program; what it raises comes out here."""
        try:
            carried_out(self.kernel, body, step=500 * MS)
        finally:
            self.kernel.close()


@pytest.fixture
def apron() -> Callable[..., Apron]:
    return Apron

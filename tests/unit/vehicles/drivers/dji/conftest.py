"""A scripted DJI node: it reports what the test sets, notes requests, and obeys at once."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import pytest

from rigs.missions import carried_out
from volery.base.time import MS, S
from volery.kernel.task import ExecutionContext
from volery.kernel.virtual import VirtualKernel
from volery.ros.graph import EmbeddedGraph
from volery.ros.messages import message_class, new
from volery.ros.messages.dji_constants import SETPOINT, SETPOINT_TOPICS
from volery.vehicles import Drone
from volery.vehicles.drivers.dji import open_driver

HOME = (46.0, -103.0, 900.0)
METRES = 111_195.0


class FakeNode:
    """``dji_sdk`` 3.8 as a script. ``refuse``: names of services that say no; ``deaf``: that never answer."""

    def __init__(self, graph: EmbeddedGraph, namespace: str, hardware: str = "A3") -> None:
        self.kernel = graph.kernel
        self.node = node = graph.node("dji_sdk", context=ExecutionContext("aircraft"))
        self.hardware = hardware
        self.status, self.mode, self.health, self.switch = (1 if hardware == "M100" else 0), 6, 5, 1.0
        self.north = self.east = self.up = 0.0
        self.speed = 0.0
        self.range, self.offset = 0.0, 0.0
        self.codes: dict[str, int] = {}
        self.mute = False
        self.lost = False
        self.refuse: set[str] = set()
        self.asked: list[tuple[str, Any]] = []
        self.setpoints: list[tuple[int, int, tuple[float, ...]]] = []
        self.on_task: Callable[[int], None] = self.obey
        self._topics = {
            name: node.advertise(f"{namespace}/{name}", kind)
            for name, kind in {
                "flight_status": "std_msgs/UInt8",
                "display_mode": "std_msgs/UInt8",
                "gps_health": "std_msgs/UInt8",
                "gps_position": "sensor_msgs/NavSatFix",
                "height_above_takeoff": "std_msgs/Float32",
                "velocity": "geometry_msgs/Vector3Stamped",
                "attitude": "geometry_msgs/QuaternionStamped",
                "rc": "sensor_msgs/Joy",
                "rc_connection_status": "std_msgs/UInt8",
                "flight_anomaly": "dji_sdk/FlightAnomaly",
                "battery_state": "sensor_msgs/BatteryState",
            }.items()
        }
        inbox = node.group(lambda work: work.run())
        for name, flag in {**SETPOINT_TOPICS, f"{SETPOINT}generic": -1}.items():
            node.subscribe(f"{namespace}/{name}", "sensor_msgs/Joy", self._setpoint(flag), group=inbox)
        group = node.group(
            lambda work: self.kernel.spawn(work.run, "fake", ExecutionContext("aircraft")) and None
        )
        for name, kind in {
            "activation": "Activation",
            "sdk_control_authority": "SDKControlAuthority",
            "drone_arm_control": "DroneArmControl",
            "drone_task_control": "DroneTaskControl",
            "set_local_pos_ref": "SetLocalPosRef",
            "query_drone_version": "QueryDroneVersion",
            "mission_waypoint_upload": "MissionWpUpload",
            "mission_waypoint_action": "MissionWpAction",
        }.items():
            node.serve(f"{namespace}/{name}", f"dji_sdk/srv/{kind}", self._serve(name, kind), group)
        self.kernel.every(20 * MS, self._speak)

    # -- speaking

    def say(self, topic: str, **fields: Any) -> None:
        publisher = self._topics[topic]
        publisher.publish(new(publisher.type, **fields))

    def _speak(self) -> None:
        if self.mute:
            return
        self.say("flight_status", data=self.status)
        if self.hardware != "M100":
            self.say("display_mode", data=self.mode)
        self.say("gps_health", data=self.health)
        self.say("height_above_takeoff", data=self.range)
        self.say("velocity", vector={"x": self.speed})
        self.say("attitude", quaternion={"w": 1.0})
        self.say("rc", axes=[0.0, 0.0, 0.0, 0.0, self.switch, 0.0])
        self.say("battery_state", voltage=22_800.0, current=-5_000.0, percentage=80.0)
        if not self.lost:
            self.say(
                "gps_position",
                latitude=HOME[0] + self.north / METRES,
                longitude=HOME[1] + self.east / METRES,
                altitude=HOME[2] + self.offset + self.up,
            )

    # -- obeying

    def _setpoint(self, flag: int) -> Callable[[Any], None]:
        def take(message: Any) -> None:
            axes = tuple(float(axis) for axis in message.axes)
            self.setpoints.append((self.kernel.now(), int(axes[4]) if flag < 0 else flag, axes[:4]))
            if self.status == 2:
                self.mode = 17

        return take

    def _serve(self, name: str, kind: str) -> Callable[[Any], Any]:
        def answer(request: Any) -> Any:
            self.asked.append((name, request))
            if name == "query_drone_version":
                return message_class("dji_sdk/srv/QueryDroneVersion_Response")(1, self.hardware)
            good = name not in self.refuse
            if good and name == "drone_task_control":
                self.on_task(request.task)
            if good and name == "drone_arm_control":
                self.status = request.arm
            response = message_class(f"dji_sdk/srv/{kind}_Response")(result=good)
            if not good and name in self.codes:
                response.ack_data = self.codes[name]
            return response

        return answer

    def obey(self, task: int) -> None:
        """Take off in no time; land and go home in two seconds."""
        if task == 4:
            self.status, self.mode, self.up = 2, 6, 1.2
        else:
            self.mode = 12 if task == 6 else 15
            self.kernel.call_at(self.kernel.now() + 2 * S, self.down)

    def down(self) -> None:
        self.status, self.mode, self.up = 0, 6, 0.0

    def names(self) -> list[str]:
        return [name for name, _ in self.asked]

    def be_at(self, north: float, east: float, up: float) -> None:
        self.north, self.east, self.up = north, east, up


class Bench:
    """A fake node, the driver, the drone, and the test's flow of control."""

    def __init__(self, hardware: str = "A3", **options: str) -> None:
        self.events: list[Any] = []
        self.kernel = VirtualKernel(record=self.events.append)
        self.graph = EmbeddedGraph(self.kernel, unrecorded=True)
        self.node = FakeNode(self.graph, "/dji_sdk", hardware)
        commander = self.graph.node("commander", context=ExecutionContext("commander"))
        self.driver = open_driver(self.kernel, commander, "d", {"namespace": "/dji_sdk", **options})
        self.drone = Drone(self.kernel, "d", self.driver)

    def run(self, body: Callable[[], None]) -> None:
        """As a task; what it raises comes out here."""
        try:
            carried_out(self.kernel, body, step=500 * MS)
        finally:
            self.drone.close()
            assert self.kernel.close() == []

    def wait(self, seconds: float) -> None:
        self.kernel.sleep_until(self.kernel.now() + round(seconds * S))

    def later(self, seconds: float, action: Callable[[], None]) -> None:
        self.kernel.call_at(self.kernel.now() + round(seconds * S), action)


@pytest.fixture
def bench() -> Callable[..., Bench]:
    return Bench

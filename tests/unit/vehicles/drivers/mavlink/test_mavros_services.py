"""Parameters, plans, payload and corrections over MAVROS's names, on the simulated ArduPilot and PX4."""

from __future__ import annotations

from collections.abc import Callable
from itertools import count
from math import nan
from pathlib import Path
from typing import Any

import pytest

from rigs.airstrip import Airstrip, at
from rigs.missions import carried_out
from volery.base.errors import CapabilityError, Refused
from volery.base.frames import LocalFrame
from volery.base.position import AMSL, Position
from volery.base.time import MS, S
from volery.bridge import serve_vehicle
from volery.bridge.vehicle_node import VehicleNodeOptions
from volery.kernel.task import ExecutionContext
from volery.kernel.virtual import VirtualKernel
from volery.kernel.waiting import sleep
from volery.links.frame import Frame
from volery.links.in_process_link import in_process_pair
from volery.ros.graph import EmbeddedGraph
from volery.vehicles import Drone, Vehicle
from volery.vehicles.drivers.mavros import MAVROS
from volery.vehicles.external_pose import ExternalPose
from volery.vehicles.rtcm import crc24q
from volery.vehicles.services import PlanItem
from volery.vehicles.vehicle_plan import Circle, Plan

KNOWN = {"ardupilot": ("WP_SPD", "FENCE_ENABLE"), "px4": ("MPC_XY_CRUISE", "GF_ACTION")}


class MavrosStrip(Airstrip):
    """A simulated vehicle, MAVROS's names before it, and a node that commands it."""

    def __init__(self, firmware: str, vehicle: dict[str, float] | None = None, **options: Any) -> None:
        self.firmware = firmware
        self.options = options
        super().__init__(parameters=vehicle)

    def open(self) -> Vehicle | None:
        return None

    def fly(self, mission: Callable[[Any], Any]) -> Any:
        graph = EmbeddedGraph(self.kernel)
        options = VehicleNodeOptions(**self.options)
        serve_vehicle(graph, self.link, "craft_1", ExecutionContext("vehicle node"), options)

        def body() -> Any:
            assert MAVROS.on_graph is not None
            node = graph.node("control")
            driver = MAVROS.on_graph(self.kernel, node, "craft_1", {"autopilot": self.firmware})
            self.vehicle = self.commanded_by(driver)
            return mission(self.vehicle)

        return carried_out(self.kernel, body)


BOTH = pytest.mark.parametrize("firmware", ["ardupilot", "px4"])


def waypoint(east: float, north: float) -> PlanItem:
    place = at(east, north)
    return PlanItem(16, 3, (0.0, 0.0, 0.0, nan), place.latitude, place.longitude, 10.0)


@BOTH
@pytest.mark.parametrize("ros2", [False, True], ids=["mavros1", "mavros2"])
def test_parameters(firmware: str, ros2: bool, tmp_path: Path) -> None:
    real, whole = KNOWN[firmware]
    file = tmp_path / "all.params"

    def mission(drone: Drone) -> None:
        before = drone.parameters.get(real)
        assert drone.parameters.save(file) > 800
        drone.parameters.set(real, before + 2.5)
        assert drone.parameters.get(real) == before + 2.5
        off = drone.parameters.get(whole)
        drone.parameters.set(whole, 0)
        drone.parameters.set(whole, 1)
        assert drone.parameters.get(whole) == 1
        drone.parameters.set(whole, off)
        with pytest.raises(Refused, match="takes whole numbers only"):
            drone.parameters.set(whole, 0.5)
        with pytest.raises(Refused, match="has no parameter NO_SUCH_NAME"):
            drone.parameters.get("NO_SUCH_NAME")
        assert [one.name for one in drone.parameters.load(file)] == [real]

    MavrosStrip(firmware, parameter_services=ros2).fly(mission)


@BOTH
def test_plans(firmware: str) -> None:
    centre = at(0, 0)
    fence = Circle((centre.latitude, centre.longitude), 200.0)
    plan = Plan(mission=(waypoint(10, 10), waypoint(20, 10)), fence=(fence,), rally=(at(5, 5, 15),))

    def mission(drone: Drone) -> tuple[Plan, Plan]:
        drone.wait_ready()
        drone.plan.upload(plan)
        there = drone.plan.download()
        drone.plan.clear()
        return there, drone.plan.download()

    there, empty = MavrosStrip(firmware).fly(mission)
    assert [item.command for item in there.mission] == [16, 16]
    assert there.mission[1].latitude == pytest.approx(plan.mission[1].latitude, abs=1e-6)
    assert there.fence[0].radius == 200.0
    assert there.rally[0].latitude == pytest.approx(plan.rally[0].latitude, abs=1e-6)
    assert empty.mission == empty.fence == empty.rally == ()


@BOTH
def test_attitude_payload_corrections_and_restart(firmware: str) -> None:
    field = MavrosStrip(firmware)
    sent: list[Frame] = []
    original = field.link.send

    def spy(frame: Frame) -> None:
        sent.append(frame)
        original(frame)

    field.link.send = spy  # type: ignore[method-assign]  # the wire itself
    body = bytes([0xD3, 0, 200]) + bytes(200)
    message = body + crc24q(body).to_bytes(3, "big")

    def mission(drone: Drone) -> tuple[float, float]:
        drone.wait_ready()
        with pytest.raises((CapabilityError, Refused), match="gimbal"):
            drone.payload.point_gimbal(-90.0)
        drone.payload.look_at(drone.home)
        drone.send_corrections(message)
        drone.takeoff(5)
        drone.set_velocity(north=4.0, lasting=3.0)
        leans = []
        for _ in range(20):  # the caller repeats the set-point
            sleep(drone.kernel, S // 10)
            drone.set_velocity(north=4.0, lasting=3.0)
            leans.append(drone.attitude)
        lean = min(leans, key=lambda one: one.pitch)
        drone.land()
        if firmware == "ardupilot":
            drone.reboot()
        return lean.roll, lean.pitch

    roll, pitch = field.fly(mission)
    assert abs(roll) < 5.0
    assert -46.0 < pitch < -1.0  # it leans forward to accelerate
    parts = [frame.fields for frame in sent if frame.name == "GPS_RTCM_DATA"]
    assert b"".join(bytes(one["data"][: one["len"]]) for one in parts) == message


LOG = bytes(range(256)) * 100


def test_a_log_is_downloaded_whole(tmp_path: Path) -> None:
    """From an autopilot that keeps one; one message in seven is lost."""
    kernel = VirtualKernel()
    ours, end = in_process_pair(kernel, 5 * MS)
    sent = count(1)

    def send(name: str, **fields: Any) -> None:
        if next(sent) % 7 or name == "HEARTBEAT":
            end.send(Frame(name, fields, 1, 1))

    def receive(frame: Frame) -> None:
        if frame.name == "LOG_REQUEST_LIST":
            send("LOG_ENTRY", id=3, num_logs=1, last_log_num=3, time_utc=1_700_000_000, size=len(LOG))
        elif frame.name == "LOG_REQUEST_DATA":
            start = frame.fields["ofs"]
            for offset in range(start, start + frame.fields["count"], 90):
                piece = LOG[offset : min(offset + 90, start + frame.fields["count"])]
                data = list(piece.ljust(90, b"\0"))
                send("LOG_DATA", id=3, ofs=offset, count=len(piece), data=data)

    end.receive(receive)
    kernel.every(S, lambda: send("HEARTBEAT", type=2, autopilot=3, base_mode=81, system_status=3))
    graph = EmbeddedGraph(kernel)
    serve_vehicle(graph, ours, "craft_1", ExecutionContext("vehicle node"))

    def download() -> Path:
        assert MAVROS.on_graph is not None
        drone = Drone(kernel, "craft_1", MAVROS.on_graph(kernel, graph.node("control"), "craft_1", {}))
        [log] = drone.logs.list()
        assert log == (3, len(LOG), 1_700_000_000)
        return drone.logs.download(log, tmp_path / "three.bin")

    assert carried_out(kernel, download).read_bytes() == LOG


@BOTH
def test_poses_and_origin(firmware: str) -> None:
    """A vehicle without satellites gets ready by what a node publishes."""
    given = {"EKF2_EV_CTRL": 1.0, "EKF2_GPS_CTRL": 0.0}
    if firmware == "ardupilot":
        given = {"VISO_TYPE": 1.0, "EK3_SRC1_POSXY": 6.0, "EK3_SRC1_VELXY": 0.0, "EK3_SRC1_VELZ": 0.0}
        given["GPS1_TYPE"] = 0.0
    strip = MavrosStrip(firmware, vehicle=given)
    strip.flight.block_gps(True)
    level = [[0.01 if row == column else 0.0 for column in range(6)] for row in range(6)]

    def mission(drone: Drone) -> tuple[float, float]:
        drone.set_origin(Position(48.5, 9.25, AMSL(400.0)))

        def send() -> None:
            pose = ExternalPose(strip.kernel.now(), 3.0, -4.0, 0.0, 0.0, level)
            drone.send_external_pose(pose)

        strip.kernel.every(50 * MS, send)
        drone.wait_ready(within=60.0)
        place = drone.position
        return LocalFrame(48.5, 9.25, 400.0).to_ned(place.latitude, place.longitude, 400.0)[:2]

    assert strip.fly(mission) == pytest.approx((3.0, -4.0), abs=0.1)

"""Parameters, plans, logs, payload and telemetry over time, on the simulated ArduPilot and PX4."""

from __future__ import annotations

import json
from math import nan
from pathlib import Path
from typing import Any

import pytest

from rigs.airstrip import Airstrip, at
from volery.base.errors import CapabilityError, OutOfBounds, Refused, UsageError
from volery.base.frames import world_to_body
from volery.base.position import AMSL, AboveHome, Position
from volery.base.time import S
from volery.kernel.waiting import sleep
from volery.simulation.autopilots.ardupilot.servo_outputs import outputs_of
from volery.vehicles import Drone, Fence, Zone
from volery.vehicles.drivers.ardupilot import open_driver as open_ardupilot
from volery.vehicles.drivers.px4 import open_driver as open_px4
from volery.vehicles.rtcm import crc24q
from volery.vehicles.services import PlanItem
from volery.vehicles.vehicle_plan import Circle, Plan, Polygon


class ArduPilotStrip(Airstrip):
    firmware = "ardupilot"
    opener = staticmethod(open_ardupilot)


class Px4Strip(Airstrip):
    firmware = "px4"
    opener = staticmethod(open_px4)


BOTH = pytest.mark.parametrize(
    ("strip", "known"),
    [(ArduPilotStrip, "RTL_SPEED_MS"), (Px4Strip, "MPC_XY_CRUISE")],
    ids=["ardupilot", "px4"],
)


def corner(east: float, north: float) -> tuple[float, float]:
    place = at(east, north)
    return place.latitude, place.longitude


def waypoint(east: float, north: float, height: float = 10.0) -> PlanItem:
    place = at(east, north, height)
    return PlanItem(16, 3, (0.0, 0.0, 0.0, nan), place.latitude, place.longitude, height)


@BOTH
def test_a_parameter_is_read_and_written(strip: type[Airstrip], known: str) -> None:
    def mission(drone: Drone) -> tuple[float, float]:
        before = drone.parameters.get(known)
        drone.parameters.set(known, before + 1.0)
        return before, drone.parameters.get(known)

    before, after = strip().fly(mission)
    assert after == before + 1.0


@BOTH
def test_all_parameters_are_saved_compared_and_loaded(
    strip: type[Airstrip], known: str, tmp_path: Path
) -> None:
    def mission(drone: Drone) -> Any:
        kept = {suffix: tmp_path / f"all{suffix}" for suffix in (".params", ".param")}
        counts = [drone.parameters.save(file) for file in kept.values()]
        old = drone.parameters.get(known)
        drone.parameters.set(known, old + 2.0)
        found = [drone.parameters.compare(file) for file in kept.values()]
        changed = drone.parameters.load(kept[".param"])
        return counts, old, found, changed, drone.parameters.compare(kept[".params"])

    counts, old, found, changed, left = strip().fly(mission)
    assert counts[0] == counts[1] > 800
    assert found[0] == found[1] == changed == [(known, old + 2.0, old)]
    assert left == []


@BOTH
def test_parameters_that_do_not_fit(strip: type[Airstrip], known: str, tmp_path: Path) -> None:
    wrong = tmp_path / "wrong.param"
    wrong.write_text("RTL_SPEED 1\nnonsense\n", encoding="utf-8")

    def mission(drone: Drone) -> None:
        with pytest.raises(Refused, match="has no parameter NO_SUCH_NAME"):
            drone.parameters.get("NO_SUCH_NAME")
        with pytest.raises(UsageError, match="a parameter is a finite number"):
            drone.parameters.set(known, "5")  # type: ignore[arg-type]  # what a console can pass
        with pytest.raises(UsageError, match="is no name of a parameter"):
            drone.parameters.get("with space")
        with pytest.raises(UsageError, match=r"wrong.param:2: '' is no value of 'nonsense'"):
            drone.parameters.load(wrong)
        with pytest.raises(UsageError, match="there is no such file"):
            drone.parameters.load(tmp_path / "missing.param")
        with pytest.raises(UsageError, match=r"end the name in .params"):
            drone.parameters.save(tmp_path / "all.txt")

    strip().fly(mission)


@BOTH
def test_a_plan_goes_up_and_comes_back(strip: type[Airstrip], known: str, tmp_path: Path) -> None:
    plan = Plan(
        mission=(waypoint(10, 10), PlanItem(177, 2, (1.0, 2.0, 0.0, 0.0), 0.0, 0.0, 0.0), waypoint(20, 10)),
        fence=(
            Polygon((corner(-90, -90), corner(90, -90), corner(90, 90), corner(-90, 90))),
            Circle(corner(60, 60), 10.0, stay_in=False),
        ),
        rally=(at(5, 5, 15),),
    )
    file = tmp_path / "survey.plan"
    plan.write(file)

    def mission(drone: Drone) -> tuple[Plan, Plan]:
        drone.wait_ready()
        drone.plan.upload(file)
        there = drone.plan.download()
        drone.plan.clear()
        return there, drone.plan.download()

    there, empty = strip().fly(mission)
    assert [item.command for item in there.mission] == [16, 177, 16]
    assert there.mission[1].parameters[:2] == (1.0, 2.0)
    assert there.mission[2].latitude == pytest.approx(plan.mission[2].latitude, abs=1e-6)
    assert [type(area) for area in there.fence] == [Polygon, Circle]
    assert there.fence[1].stay_in is False
    assert there.rally[0].altitude == AboveHome(15.0)
    assert empty.mission == empty.fence == empty.rally == ()


@BOTH
def test_an_uploaded_plan_is_flown(strip: type[Airstrip], known: str) -> None:
    field = strip()

    def mission(drone: Drone) -> float:
        drone.wait_ready()
        takeoff = PlanItem(22, 3, (0.0, 0.0, 0.0, nan), *corner(0, 0), 10.0)
        back = PlanItem(20, 2, (0.0, 0.0, 0.0, 0.0), 0.0, 0.0, 0.0)
        drone.plan.upload(Plan((takeoff, waypoint(0, 30), back)), only=["mission"])
        history = drone.record_telemetry("altitude", period=1.0)
        drone.start_mission()
        return max(history.columns()["altitude"])

    assert field.fly(mission) > 8.0
    assert not field.vehicle.telemetry.armed


def test_a_plan_out_of_bounds_is_not_uploaded() -> None:
    def mission(drone: Drone) -> None:
        drone.wait_ready()
        with pytest.raises(OutOfBounds):
            drone.plan.upload(Plan((waypoint(0, 10, 4000.0),)))
        with pytest.raises(UsageError, match="no part 'fences' of a plan"):
            drone.plan.clear("fences")
        assert drone.plan.download().mission == ()

    ArduPilotStrip().fly(mission)


def test_a_fence_of_volery_is_uploaded() -> None:
    square = tuple(corner(*each) for each in ((-50, -50), (50, -50), (50, 50), (-50, 50)))
    tree = Zone("tree", tuple(corner(*each) for each in ((20, 20), (25, 20), (25, 25))))

    def mission(drone: Drone) -> Plan:
        drone.plan.upload_fence(Fence(square, no_fly=(tree,)))
        with pytest.raises(UsageError, match="FENCE_ALT_MAX"):
            drone.plan.upload_fence(Fence(square, ceiling=AboveHome(50)))
        return drone.plan.download(only=["fence"])

    fence = Px4Strip().fly(mission).fence
    assert [area.stay_in for area in fence] == [True, False]


@BOTH
def test_logs_payload_and_reboot(strip: type[Airstrip], known: str) -> None:
    def mission(drone: Drone) -> tuple[Any, bool]:
        drone.wait_ready()
        logs = drone.logs.list()
        if strip is Px4Strip:
            drone.payload.open_gripper()  # 1.17 accepts it, whether there is one or not
        else:
            with pytest.raises((CapabilityError, Refused), match="gripper"):
                drone.payload.open_gripper()
        with pytest.raises((CapabilityError, Refused), match="gimbal"):
            drone.payload.point_gimbal(-90.0)
        with pytest.raises(UsageError, match="is not a number from 500 to 2500"):
            drone.payload.set_servo(9, 1.5)  # type: ignore[arg-type]  # a duty cycle in ms is what others take
        with pytest.raises(UsageError, match="give a Position with an altitude AMSL"):
            drone.payload.look_at(at(5, 5))
        drone.payload.look_at(Position(*corner(5, 5), AMSL(900.0)))
        if strip is ArduPilotStrip:
            drone.reboot()
        else:  # as the firmware's own simulator
            with pytest.raises(Refused, match="DENIED to MAV_CMD_PREFLIGHT_REBOOT_SHUTDOWN"):
                drone.reboot()
        drone.wait_ready()
        ready = drone.ready
        drone.takeoff(5)
        with pytest.raises(Refused, match="land and disarm first"):
            drone.reboot()
        with pytest.raises(Refused, match="land and disarm first"):
            drone.logs.list()
        return logs, ready

    logs, ready = strip().fly(mission)
    assert isinstance(logs, list)
    assert ready


def test_a_servo_of_an_ardupilot() -> None:
    field = ArduPilotStrip()
    field.fly(lambda drone: drone.payload.set_servo(9, 1500))
    assert outputs_of(field.autopilot.vehicle).servos[9] == 1500


def rtcm(size: int) -> bytes:
    body = bytes([0xD3, size >> 8, size & 0xFF]) + bytes(size)
    return body + crc24q(body).to_bytes(3, "big")


@pytest.mark.parametrize(("size", "lengths"), [(20, [26]), (300, [180, 126]), (354, [180, 180, 0])])
def test_corrections_are_cut_into_parts(size: int, lengths: list[int]) -> None:
    field = Px4Strip()
    sent: list[dict[str, Any]] = []
    original = field.link.send

    def spy(frame: Any) -> None:
        if frame.name == "GPS_RTCM_DATA":
            sent.append(frame.fields)
        original(frame)

    field.link.send = spy  # type: ignore[method-assign]  # the wire itself
    field.fly(lambda drone: drone.send_corrections(rtcm(size)))
    assert [one["len"] for one in sent] == lengths
    assert b"".join(bytes(one["data"][: one["len"]]) for one in sent) == rtcm(size)
    assert [one["flags"] & 1 for one in sent] == [int(len(lengths) > 1)] * len(lengths)
    assert [one["flags"] >> 1 & 3 for one in sent] == list(range(len(lengths)))


def test_corrections_that_are_none() -> None:
    def mission(drone: Drone) -> None:
        with pytest.raises(UsageError, match="byte 0 of the corrections is 0x24, where RTCM 3 has 0xD3"):
            drone.send_corrections(b"$GPGGA")
        with pytest.raises(UsageError, match="end within the message at byte 26"):
            drone.send_corrections(rtcm(20) + rtcm(20)[:-1])
        with pytest.raises(UsageError, match="checksum of the message at byte 0 is wrong"):
            drone.send_corrections(rtcm(20)[:-1] + b"\0")

    Px4Strip().fly(mission)


def test_an_ardupilot_lands_on_the_target_that_is_sent() -> None:
    field = ArduPilotStrip(parameters={"PLND_ENABLED": 1, "PLND_TYPE": 1})
    goal = (4.0, -3.0)  # north, east of home

    def mission(drone: Drone) -> Any:
        def look() -> None:
            estimate = field.autopilot.vehicle.estimate
            here = estimate.position
            off = (goal[0] - here[0], goal[1] - here[1], -here[2])
            if here[2] < -0.3:
                drone.send_landing_target(*world_to_body(estimate.quaternion, off))

        drone.takeoff(6)
        look()  # the first call waits for parameters
        drone.kernel.every(S // 10, look)
        sleep(drone.kernel, 3 * S)
        drone.land()
        return field.autopilot.vehicle.estimate.position

    north, east, _ = field.fly(mission)
    assert (north, east) == pytest.approx(goal, abs=0.3)


def test_a_landing_target_that_would_be_ignored() -> None:
    def ardupilot(drone: Drone) -> None:
        with pytest.raises(UsageError, match="the target is not below"):
            drone.send_landing_target(1.0, 0.0, -2.0)
        with pytest.raises(UsageError, match=r"send_landing_target\(0.4, -0.2, 5.0\)"):
            drone.send_landing_target(nan, 0.0, 2.0)
        with pytest.raises(Refused, match="PLND_ENABLED is not 1, so it would ignore it; set it and reboot"):
            drone.send_landing_target(1.0, 0.0, 2.0)

    def px4(drone: Drone) -> None:
        with pytest.raises(CapabilityError, match="fly velocities towards it"):
            drone.send_landing_target(1.0, 0.0, 2.0)

    ArduPilotStrip().fly(ardupilot)
    Px4Strip().fly(px4)


def test_telemetry_over_time() -> None:
    heights: list[float] = []

    def mission(drone: Drone) -> Any:
        history = drone.record_telemetry("position", "velocity", "mode", period=0.5)
        handle = drone.subscribe("altitude", heights.append)  # type: ignore[arg-type]
        drone.takeoff(6)
        handle.cancel()
        seen = len(heights)
        sleep(drone.kernel, 5 * S)
        assert len(heights) == seen
        history.stop()
        with pytest.raises(UsageError, match=r"no quantity 'atitude' .did you mean 'attitude'"):
            drone.subscribe("atitude", print)  # type: ignore[arg-type]
        return history

    history = ArduPilotStrip().fly(mission)
    columns = history.columns()
    assert max(heights) == pytest.approx(6.0, abs=0.5)
    assert {"time_s", "position_latitude", "velocity_up", "mode"} <= set(columns)
    assert columns["time_s"][1] - columns["time_s"][0] == pytest.approx(0.5)
    assert columns["mode"][-1] == "GUIDED"
    frame = history.to_pandas()
    assert frame.index.name == "time_s"
    assert frame["velocity_up"].max() > 0.5


def test_the_checksum_of_a_published_message() -> None:
    """The message 1005 that RTCM 10403 gives as its example."""
    message = bytes.fromhex("D300133ED7D30202980EDEEF34B4BD62AC0941986F33360B98")
    assert crc24q(message[:-3]) == 0x360B98


def test_files_that_are_no_plan(tmp_path: Path) -> None:
    file = tmp_path / "some.plan"

    def said(content: str) -> str:
        file.write_text(content, encoding="utf-8")
        with pytest.raises(UsageError) as caught:
            Plan.read(file)
        return str(caught.value)

    assert "this is not JSON" in said("{")
    assert 'its "fileType" is not "Plan"' in said("[]")
    assert "no plan of QGroundControl" in said(json.dumps({"fileType": "Plan", "mission": []}))
    survey = {"type": "ComplexItem", "complexItemType": "StructureScan"}
    assert "item 1 is a 'StructureScan'" in said(
        json.dumps({"fileType": "Plan", "mission": {"items": [survey]}})
    )
    assert "latitude 91.0 is off the globe" in said(
        json.dumps({"fileType": "Plan", "rallyPoints": {"points": [[91, 0, 0]]}})
    )
    with pytest.raises(UsageError, match="there is no such file"):
        Plan.read(tmp_path / "missing.plan")

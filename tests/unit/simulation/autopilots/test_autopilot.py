"""The public interface of a simulated autopilot: creation, state, links, end."""

from __future__ import annotations

from math import isnan
from typing import Any

import pytest

from volery.base.errors import UsageError
from volery.base.frames import LocalFrame
from volery.base.time import MS, S
from volery.kernel.virtual import VirtualKernel
from volery.links.frame import Frame
from volery.links.in_process_link import in_process_pair
from volery.simulation.autopilots.ardupilot import FIRMWARE
from volery.simulation.autopilots.autopilot import Autopilot, FirmwareFamily
from volery.simulation.autopilots.fleet_autopilot import firmwares
from volery.simulation.autopilots.flight_stack.flight import make_world
from volery.simulation.world.body_specs import Multirotor, WheeledRover

FRAME = LocalFrame(48.0, 11.0, 500.0)


class Yard:
    """A kernel and a world with the bodies given."""

    def __init__(self, *bodies: Any) -> None:
        self.kernel = VirtualKernel()
        _, self.flights = make_world(self.kernel.now, list(bodies), seed=5, frame=FRAME)

    def autopilot(self, index: int = 0, **options: Any) -> Autopilot:
        return FIRMWARE.create(self.kernel, self.flights[index], **options)

    def listen(self, autopilot: Autopilot) -> tuple[Any, list[Frame]]:
        ours, theirs = in_process_pair(self.kernel, MS, "station")
        heard: list[Frame] = []
        ours.receive(heard.append)
        autopilot.connect(theirs)
        return ours, heard

    def run(self, seconds: float) -> None:
        end = self.kernel.now() + round(seconds * S)
        self.kernel.call_at(end, lambda: None)  # time stands still where nothing happens
        self.kernel.run(end)


@pytest.fixture
def yard() -> Yard:
    return Yard(Multirotor(sensors="rtk", at=(3.0, 4.0, 0.0)))


def test_a_firmware_is_found_by_its_name() -> None:
    assert firmwares.load("ardupilot") is FIRMWARE


def test_a_version_selects_the_firmwares_and_an_unknown_one_is_refused() -> None:
    older = {"multirotor": FIRMWARE.kinds["rover"]}
    family = FirmwareFamily("x", FIRMWARE.kinds, versions={"1.0": older, "2.0": FIRMWARE.kinds})
    assert family.of_version("").kinds is FIRMWARE.kinds
    assert family.of_version("1.0").kinds is older
    with pytest.raises(UsageError, match=r"x has no version '3'; there is 1\.0 or 2\.0"):
        family.of_version("3")
    with pytest.raises(UsageError, match="there is one only"):
        FirmwareFamily("y", {}).of_version("3")


def test_the_kind_of_body_selects_the_firmware() -> None:
    yard = Yard(Multirotor(), WheeledRover(at=(5.0, 0.0, 0.0)))
    assert yard.autopilot(0).firmware.kind == "multirotor"
    assert yard.autopilot(1, system=2).firmware.kind == "rover"


def test_a_firmware_for_another_kind_of_vehicle_is_refused(yard: Yard) -> None:
    with pytest.raises(UsageError, match=r"rover.*multirotor"):
        Autopilot(yard.kernel, yard.flights[0], FIRMWARE.kinds["rover"])


def test_a_warm_vehicle_has_a_position_within_the_warm_up_time(yard: Yard) -> None:
    autopilot = yard.autopilot(warm=True, name="drone_1")
    yard.run(0.5)
    state = autopilot.state()
    assert (state.x, state.y) == pytest.approx((3.0, 4.0), abs=0.01)
    assert (state.estimated_x, state.estimated_y) == pytest.approx((3.0, 4.0), abs=0.3)
    assert (state.vehicle, state.armed, state.mode) == ("drone_1", False, "STABILIZE")


def test_a_cold_vehicle_boots_when_it_is_connected(yard: Yard) -> None:
    autopilot = yard.autopilot()
    yard.run(5.0)
    assert isnan(autopilot.state().estimated_x)
    _, heard = yard.listen(autopilot)
    yard.run(3.0)
    assert heard
    assert heard[0].system == 1


def test_connecting_can_leave_the_vehicle_off(yard: Yard) -> None:
    autopilot = yard.autopilot()
    ours, theirs = in_process_pair(yard.kernel, MS, "station")
    heard: list[Frame] = []
    ours.receive(heard.append)
    autopilot.connect(theirs, switch_on=False)
    yard.run(3.0)
    assert not heard
    autopilot.switch_on()
    yard.run(3.0)
    assert heard


def test_the_banner_is_text_and_no_message(yard: Yard) -> None:
    assert b"Init ArduCopter V4.8.0-dev" in yard.autopilot().banner


def test_each_vehicle_answers_to_its_own_system_id() -> None:
    yard = Yard(Multirotor(), Multirotor(at=(5.0, 0.0, 0.0)))
    stations = [yard.listen(yard.autopilot(index, system=index + 1, warm=True)) for index in range(2)]
    yard.run(0.5)
    for station, _ in stations:
        station.send(Frame("PARAM_REQUEST_READ", _reading(2), 255, 190))
    yard.run(0.2)
    answered = [[one.system for one in heard if one.name == "PARAM_VALUE"] for _, heard in stations]
    assert answered == [[], [2]]


def _reading(system: int) -> dict[str, Any]:
    return {
        "target_system": system,
        "target_component": 1,
        "param_id": "MAV_SYSID",
        "param_index": -1,
    }


def test_a_disconnected_link_receives_nothing_more(yard: Yard) -> None:
    autopilot = yard.autopilot(warm=True)
    ours, theirs = in_process_pair(yard.kernel, MS, "station")
    heard: list[Frame] = []
    ours.receive(heard.append)
    autopilot.connect(theirs)
    yard.run(2.5)
    assert heard
    autopilot.disconnect(theirs)
    yard.run(0.1)
    heard.clear()
    ours.send(Frame("PARAM_REQUEST_READ", _reading(1), 255, 190))
    yard.run(3.0)
    assert not heard


def test_a_closed_autopilot_sends_nothing(yard: Yard) -> None:
    autopilot = yard.autopilot(warm=True)
    _, heard = yard.listen(autopilot)
    yard.run(2.5)
    autopilot.close()
    yard.run(0.1)
    heard.clear()
    yard.run(5.0)
    assert not heard


def test_the_same_seed_gives_the_same_messages_at_the_same_times() -> None:
    def story() -> list[tuple[str, str]]:
        yard = Yard(Multirotor(sensors="consumer"))
        station, heard = yard.listen(yard.autopilot(warm=True))
        asked = {"target_system": 1, "target_component": 1, "req_message_rate": 10, "start_stop": 1}
        station.send(Frame("REQUEST_DATA_STREAM", {**asked, "req_stream_id": 0}, 255, 190))
        yard.run(5.0)
        return [(frame.name, repr(frame.fields)) for frame in heard]

    assert story() == story()

"""Real ArduCopter and ArduRover programs in volery's world; each test needs the one that it names."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

from rigs.flown_firmware import FlownFirmware
from rigs.requirements import firmware_program
from volery.base.time import S
from volery.simulation.real_firmware.firmware_process import FirmwareError
from volery.simulation.world.body_specs import Multirotor, WheeledRover, frame_rotors


@pytest.fixture
def copter() -> Path:
    return firmware_program("VOLERY_ARDUCOPTER")


@pytest.fixture
def rover() -> Path:
    return firmware_program("VOLERY_ARDUROVER")


def fly(flown: FlownFirmware, north: float = 20.0) -> None:
    drone: Any = flown.open()
    with flown.as_script():
        drone.wait_ready()
        drone.takeoff(10.0)
        drone.goto(flown.place(0.0, north, 10.0))
        east, reached, up = flown.flight.truth().position
        assert abs(east) < 1.0
        assert abs(reached - north) < 2.0
        assert abs(up - 10.0) < 1.0
        drone.land()
    assert flown.flight.truth().on_ground
    assert not flown.autopilot.state().armed


def test_a_flight_is_the_same_bit_for_bit_whenever_it_is_repeatable(copter: Path, tmp_path: Path) -> None:
    commands = []
    for number in range(2):
        with FlownFirmware("ardupilot", copter, tmp_path / str(number)) as flown:
            fly(flown)
        commands.append(flown.commands)
    assert len(commands[0]) > 20_000
    assert commands[0] == commands[1]


@pytest.mark.parametrize("frame", ["hexa-x", "octo-plus"])
def test_other_frames_fly(copter: Path, tmp_path: Path, frame: str) -> None:
    spec = Multirotor(frame=frame, rotors=frame_rotors(frame, 0.3), mass=4.0)
    with FlownFirmware("ardupilot", copter, tmp_path, spec=spec) as flown:
        fly(flown)


@pytest.mark.parametrize("skid", [False, True])
def test_a_rover_drives(rover: Path, tmp_path: Path, skid: bool) -> None:
    with FlownFirmware("ardupilot", rover, tmp_path, spec=WheeledRover(skid=skid)) as flown:
        vehicle: Any = flown.open()
        with flown.as_script():
            vehicle.wait_ready()
            vehicle.drive(flown.place(15.0, 20.0, 0.0))
        east, north, _ = flown.flight.truth().position
        assert abs(east - 15.0) < 1.5
        assert abs(north - 20.0) < 1.5


@pytest.mark.parametrize("skid", [False, True])
def test_a_rover_is_fitted_to_its_body_and_turns_back_in_a_small_circle(
    rover: Path, tmp_path: Path, skid: bool
) -> None:
    with FlownFirmware("ardupilot", rover, tmp_path, spec=WheeledRover(skid=skid)) as flown:
        vehicle: Any = flown.open()
        way = []
        flown.kernel.every(S // 5, lambda: way.append(flown.flight.truth().position))
        with flown.as_script():
            vehicle.wait_ready()
            vehicle.drive(flown.place(0.0, -20.0, 0.0))
        assert max(north for _, north, _ in way) < 6.0
        assert max(abs(east) for east, _, _ in way) < 5.0


def test_the_firmware_of_another_vehicle_is_refused(rover: Path, tmp_path: Path) -> None:
    with (
        FlownFirmware("ardupilot", rover, tmp_path) as flown,
        pytest.raises(FirmwareError, match=r"drone_1: ardurover is no firmware of a multirotor"),
    ):
        flown.open()


def test_a_firmware_that_cannot_be_armed_says_why(
    copter: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("volery.simulation.real_firmware.lock_step.WARM_UP_LIMIT", 70 * S)
    with (
        FlownFirmware("ardupilot", copter, tmp_path, parameters={"FRAME_CLASS": 0.0}) as flown,
        pytest.raises(FirmwareError, match=r"does not get ready to arm: .*(FRAME_CLASS|frame)"),
    ):
        flown.open()


def test_flights_are_logged_on_board_unless_they_are_to_be_repeatable(copter: Path, tmp_path: Path) -> None:
    with FlownFirmware("ardupilot", copter, tmp_path, repeatable=False) as flown:
        fly(flown, north=5.0)
    assert list((tmp_path / "drone_1" / "logs").glob("*.BIN"))

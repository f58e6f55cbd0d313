"""A real PX4 flies a body of this world; ``VOLERY_PX4`` names the program (bin/px4 of px4_sitl_default)."""

from __future__ import annotations

from math import acos, degrees
from pathlib import Path
from typing import Any

import pytest

from rigs.flown_firmware import FlownFirmware
from rigs.requirements import firmware_program
from volery.base.errors import Overridden
from volery.base.time import MS, S
from volery.links.in_process_link import in_process_pair
from volery.simulation.real_firmware.firmware_process import FirmwareError
from volery.simulation.world.body_specs import BatteryPack, Multirotor, frame_rotors

pytestmark = pytest.mark.integration
PLAIN = Multirotor(sensors="perfect")
HEXACOPTER = Multirotor(
    frame="hexa-x",
    rotors=frame_rotors("hexa-x", 0.35),
    mass=4.5,
    sensors="perfect",
    battery=BatteryPack(8.0, 4),
)


@pytest.fixture
def program() -> Path:
    return firmware_program("VOLERY_PX4")


class Tilt:
    """The largest tilt of a body at any look [degrees]."""

    def __init__(self, flown: FlownFirmware) -> None:
        self.largest = 0.0
        self._flown = flown
        flown.kernel.every(20 * MS, self._look)

    def _look(self) -> None:
        _, x, y, _ = self._flown.flight.truth().attitude
        self.largest = max(self.largest, degrees(acos(1.0 - 2.0 * (x * x + y * y))))


@pytest.mark.parametrize("spec", [PLAIN, HEXACOPTER], ids=["usual quadrotor", "hexacopter"])
def test_it_flies_there_and_lands(program: Path, tmp_path: Path, spec: Multirotor) -> None:
    with FlownFirmware("px4", program, tmp_path, spec=spec) as flown:
        drone: Any = flown.open()
        tilt = Tilt(flown)
        with flown.as_script():
            drone.takeoff(10)
            hovering = flown.flight.truth()
            assert hovering.position[2] == pytest.approx(10.0, abs=0.5)
            assert max(abs(rate) for rate in hovering.rates) < 0.05
            assert tilt.largest < 5.0
            drone.goto(flown.place(0.0, 50.0, 10.0))
            flown.kernel.sleep_until(flown.kernel.now() + 3 * S)
            east, north, up = flown.flight.truth().position
            assert east == pytest.approx(0.0, abs=0.7)
            assert north == pytest.approx(50.0, abs=0.7)
            assert up == pytest.approx(10.0, abs=0.7)
            assert drone.battery.remaining == pytest.approx(flown.flight.truth().battery_left, abs=0.02)
            drone.land()
        assert not drone.armed
        assert flown.flight.truth().on_ground
        assert tilt.largest < 35.0


def test_faults_of_the_world_reach_it(program: Path, tmp_path: Path) -> None:
    with FlownFirmware("px4", program, tmp_path) as flown:
        drone: Any = flown.open()
        fixes: list[int] = []
        ours, theirs = in_process_pair(flown.kernel)
        ours.receive(
            lambda frame: fixes.append(frame.fields["fix_type"]) if frame.name == "GPS_RAW_INT" else None
        )
        flown.autopilot.connect(theirs)
        with flown.as_script():
            drone.takeoff(5)
            assert fixes[-1] == 3
            flown.flight.block_gps()
            flown.kernel.sleep_until(flown.kernel.now() + 2 * S)
            assert fixes[-1] == 0
            flown.flight.block_gps(False)
            flown.flight.set_charge(0.2)
            flown.kernel.sleep_until(flown.kernel.now() + 3 * S)
            assert drone.battery.remaining == pytest.approx(0.2, abs=0.02)
            drone.land()


def test_it_says_why_it_does_not_get_ready(
    program: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("volery.simulation.real_firmware.lock_step.WARM_UP_LIMIT", 15 * S)
    parameters = {"COM_ARM_BAT_MIN": 0.5}
    spec = Multirotor(battery=BatteryPack(left=0.2))
    with (
        FlownFirmware("px4", program, tmp_path, spec=spec, parameters=parameters) as flown,
        pytest.raises(FirmwareError, match=r"drone_1: px4 does not get ready to arm: .*[Bb]attery"),
    ):
        flown.open()


def test_the_sticks_of_a_transmitter_take_over(program: Path, tmp_path: Path) -> None:
    with FlownFirmware("px4", program, tmp_path, parameters={"COM_RC_IN_MODE": 0}) as flown:
        drone: Any = flown.open()
        flown.autopilot.transmitter[:] = [1500] * 16
        with flown.as_script():
            drone.takeoff(5)
            flown.autopilot.transmitter[1] = 1200  # forward, as ArduPilot and its transmitters have it
            flown.kernel.sleep_until(flown.kernel.now() + 4 * S)
            assert flown.autopilot.state().mode == "POSCTL"
            assert flown.flight.truth().position[1] > 5.0
            with pytest.raises(Overridden, match="Pilot took over using sticks"):
                drone.land()


def test_repeatable_flights_are_the_same(program: Path, tmp_path: Path) -> None:
    flights = []
    for folder in (tmp_path / "first", tmp_path / "second"):
        with FlownFirmware("px4", program, folder) as flown:
            drone: Any = flown.open()
            with flown.as_script():
                drone.takeoff(3)
                drone.land()
            flights.append(flown.commands)
    assert flights[0] == flights[1]

"""Faults of the world on a real ArduCopter: what its own sensors show, and what it does."""

from __future__ import annotations

from math import hypot
from pathlib import Path

import pytest

from rigs.flown_firmware import FlownFirmware
from rigs.requirements import firmware_program
from volery.base.time import S
from volery.links.frame import Frame
from volery.simulation.real_firmware.ground_link import Reported

pytestmark = pytest.mark.integration


@pytest.fixture
def copter() -> Path:
    return firmware_program("VOLERY_ARDUCOPTER")


def test_a_copter_follows_a_receiver_that_drifts_and_lands_without_one(
    copter: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    texts: list[str] = []
    compass: list[int] = []
    take = Reported.take

    def note(reported: Reported, message: Frame) -> None:
        take(reported, message)
        if message.name == "STATUSTEXT":
            texts.append(message.fields["text"])
        elif message.name == "RAW_IMU":
            compass.append(message.fields["xmag"])

    monkeypatch.setattr(Reported, "take", note)
    with FlownFirmware("ardupilot", copter, tmp_path) as flown:
        for kind in ("gps-lost", "barometer-stuck", "compass-stuck"):
            flown.autopilot.require(kind, "trouble")  # not known yet; refused when it is
        drone = flown.open()
        flight, kernel = flown.flight, flown.kernel
        with flown.as_script():
            drone.wait_ready()
            drone.takeoff(10.0)
            drone.hold()
            start = flight.truth().position

            flight.drift_gps(0.0, 1.0)
            kernel.sleep_until(kernel.now() + 12 * S)
            east, north, _ = flight.truth().position
            assert -13.0 < east - start[0] < -8.0
            assert abs(north - start[1]) < 2.0
            flight.drift_gps(0.0, 0.0)
            kernel.sleep_until(kernel.now() + 20 * S)
            east, north, _ = flight.truth().position
            assert hypot(east - start[0], north - start[1]) < 4.0

            flown.autopilot._ground.request("RAW_IMU", S // 10)
            drone.set_heading(0.0)
            kernel.sleep_until(kernel.now() + S)
            north = compass[-1]
            flight.block_compass()
            kernel.sleep_until(kernel.now() + S // 2)
            drone.set_heading(90.0)
            assert abs(compass[-1] - north) < 5  # mgauss: it has not seen the turn
            assert flown.autopilot.state().mode == "GUIDED"
            flight.block_compass(False)
            kernel.sleep_until(kernel.now() + S)
            assert abs(compass[-1] - north) > 100

            flight.block_gps()
            kernel.sleep_until(kernel.now() + 12 * S)
            assert "EKF Failsafe: changed to LAND Mode" in texts
            assert flown.autopilot.state().mode == "LAND"
            flight.block_gps(False)
            kernel.sleep_until(kernel.now() + 40 * S)
            assert flight.truth().on_ground
            assert not flown.autopilot.state().armed


def test_the_charge_of_a_drained_battery_is_what_the_copter_reports(copter: Path, tmp_path: Path) -> None:
    with FlownFirmware("ardupilot", copter, tmp_path) as flown:
        drone = flown.open()
        with flown.as_script():
            drone.wait_ready()
            flown.flight.set_charge(0.3)
            flown.kernel.sleep_until(flown.kernel.now() + 3 * S)
            assert abs(drone.battery.remaining - 0.3) < 0.02
            flown.autopilot.swap_battery()
            flown.kernel.sleep_until(flown.kernel.now() + 3 * S)
            assert drone.battery.remaining >= 0.99

"""Motor test: which motor turns, how fast and for how long, and what refuses or ends it."""

from __future__ import annotations

from typing import Any

import pytest

pytestmark = pytest.mark.optional

MOTOR_TEST, ARM = 209, 400
PERCENT, PULSE, PILOT = 0, 1, 2


def turning(rig: Any) -> list[int]:
    """Return the motors that turn in truth, from 1."""
    rotors = rig.vehicle.flight.truth().rotors
    return [number for number, speed in enumerate(rotors, start=1) if speed > 20.0]


@pytest.mark.parametrize(("frame", "motors"), [(0, (1, 4)), (1, (4, 2))])
def test_motors_turn_one_after_the_other_in_the_order_of_the_frame(
    frame: int, motors: tuple[int, int], station: Any
) -> None:
    rig = station(parameters={"FRAME_TYPE": frame})
    assert rig.command(MOTOR_TEST, 2, PULSE, 1300, 2.0, 2) == 0
    rig.run(1.0)
    assert rig.vehicle.armed
    assert turning(rig) == [motors[0]]
    assert rig.vehicle.estimate.motor_pwm[motors[0] - 1] == 1300
    rig.run(1.7)
    assert rig.vehicle.estimate.motor_pwm == (1000, 1000, 1000, 1000)
    rig.run(1.0)
    assert turning(rig) == [motors[1]]
    rig.run(2.0)
    assert not rig.vehicle.armed
    assert rig.texts()[-1] == "finished motor test"
    rig.run(1.0)
    assert turning(rig) == []
    assert rig.height == pytest.approx(0.0, abs=0.3)


def test_percent_and_the_pilots_throttle(station: Any) -> None:
    rig = station()
    assert rig.command(MOTOR_TEST, 1, PERCENT, 20.1, 2.0) == 0
    rig.run(0.5)
    assert rig.vehicle.estimate.motor_pwm[2] == 1201
    rig.vehicle.rc.transmitter[2] = 1150
    assert rig.command(MOTOR_TEST, 1, PILOT, 0, 2.0) == 0  # takes the place of the test that runs
    rig.run(0.5)
    assert rig.vehicle.estimate.motor_pwm[2] == 1150


@pytest.mark.parametrize(("kind", "value"), [(PULSE, 300), (PERCENT, 120), (7, 10)])
def test_a_copter_ends_a_test_that_cannot_be(kind: int, value: float, station: Any) -> None:
    rig = station()
    assert rig.command(MOTOR_TEST, 1, kind, value, 2.0) == 0
    rig.run(0.5)
    assert not rig.vehicle.armed
    assert turning(rig) == []


def test_failsafes_wait_for_the_end_and_a_disarming_ends_it(station: Any) -> None:
    rig = station(parameters={"FS_GCS_ENABLE": 1, "DISARM_DELAY": 2})
    rig.send("HEARTBEAT", type=6, autopilot=8)
    assert rig.command(MOTOR_TEST, 1, PULSE, 1200, 20.0) == 0
    rig.run(12.0)
    assert turning(rig) == [3]
    assert rig.vehicle.mode.name == "STABILIZE"
    assert rig.command(ARM, 0, 21196) == 0
    rig.run(0.5)
    assert "finished motor test" in rig.texts()


def test_a_rover_drives_by_its_throttle_and_steers(station: Any) -> None:
    rig = station("rover")
    assert rig.command(MOTOR_TEST, 1, PULSE, 1612, 3.0) == 0
    rig.run(2.5)
    assert rig.vehicle.estimate.motor_pwm[2] == 1612
    assert rig.vehicle.estimate.velocity[0] > 0.5
    rig.run(1.0)
    assert not rig.vehicle.armed
    assert rig.vehicle.estimate.motor_pwm[2] == 1500
    assert rig.command(MOTOR_TEST, 2, PERCENT, -50, 1.0) == 0
    rig.run(0.5)
    assert rig.vehicle.estimate.motor_pwm[0] == 1250


@pytest.mark.parametrize(
    ("parameters", "text"),
    [
        ((5, PULSE, 1600), "Motor Test: invalid motor (5)"),
        ((1, 3, 1600), "Motor Test: invalid throttle type: 3"),
        ((1, PULSE, 2300), "Motor Test: pwm (2300) too high"),
        ((1, PERCENT, 101), "Motor Test: percentage (101) too high"),
    ],
)
def test_what_a_rover_refuses(parameters: tuple[float, ...], text: str, station: Any) -> None:
    rig = station("rover")
    assert rig.command(MOTOR_TEST, *parameters, 1.0) == 4
    assert rig.texts()[-1] == text
    assert not rig.vehicle.armed


def test_an_output_that_a_rover_does_not_have_ends_its_test(station: Any) -> None:
    rig = station("rover")
    assert rig.command(MOTOR_TEST, 3, PULSE, 1600, 5.0) == 0
    rig.run(0.3)
    assert not rig.vehicle.armed

"""Crop sprayer: its pump and spinner by switch, command, mission item and speed."""

from __future__ import annotations

from typing import Any

import pytest

from volery.simulation.autopilots.ardupilot.servo_outputs import outputs_of
from volery.simulation.autopilots.ardupilot.sprayer import sprayer_of

pytestmark = pytest.mark.optional

AUX_FUNCTION, SET_MODE, ARM, TAKEOFF, DO_SPRAYER = 218, 176, 400, 22, 216
SPRAYER = {
    "SPRAY_ENABLE": 1,
    "SERVO9_FUNCTION": 22,
    "SERVO9_MIN": 1050,
    "SERVO9_MAX": 1950,
    "SERVO10_FUNCTION": 23,
    "SERVO10_MIN": 975,
}
STOPPED = (1050, 975)


def outputs(rig: Any) -> tuple[int | None, int | None]:
    servos = outputs_of(rig.vehicle).servos
    return servos.get(9), servos.get(10)


def test_nothing_moves_before_it_first_runs(station: Any) -> None:
    rig = station(parameters=SPRAYER)
    assert rig.command(DO_SPRAYER, 0) == 0
    rig.run(0.5)
    assert outputs(rig) == (None, None)


@pytest.mark.parametrize("kind", ["copter", "rover"])
def test_a_command_runs_it_and_it_waits_for_speed(kind: str, station: Any) -> None:
    rig = station(kind, parameters=SPRAYER)
    assert rig.command(DO_SPRAYER, 1) == 0
    rig.run(0.5)
    assert outputs(rig) == STOPPED
    assert rig.command(DO_SPRAYER, 2) == 4


def test_without_a_sprayer_nothing_runs(station: Any) -> None:
    rig = station(parameters=SPRAYER | {"SPRAY_ENABLE": 0})
    assert rig.command(DO_SPRAYER, 1) == 0
    rig.run(0.5)
    assert outputs(rig) == STOPPED
    assert not sprayer_of(rig.vehicle).running


def test_a_switch_tests_the_pump_of_a_disarmed_vehicle(station: Any) -> None:
    rig = station(parameters=SPRAYER)
    assert rig.command(AUX_FUNCTION, 15, 2) == 0
    rig.run(0.5)
    assert outputs(rig) == (1050 + 90, 1300)  # as at 1 m/s: SPRAY_PUMP_RATE is 10 %
    assert rig.command(AUX_FUNCTION, 15, 1) == 0
    rig.run(0.5)
    assert outputs(rig) == STOPPED


def test_the_pump_follows_the_speed(station: Any) -> None:
    rig = station("rover", parameters=SPRAYER | {"SPRAY_PUMP_MIN": 15})
    assert rig.command(SET_MODE, 1, 0) == 0
    assert rig.command(ARM, 1) == 0
    assert rig.command(DO_SPRAYER, 1) == 0
    rig.vehicle.rc.transmitter[2] = 1650
    rig.run(8.0)
    speed = rig.vehicle.estimate.velocity[0]
    assert speed > 3.0
    pump, spinner = outputs(rig)
    assert pump == pytest.approx(1050 + 9.0 * 10.0 * speed, abs=4.0)
    assert spinner == 1300
    rig.vehicle.rc.transmitter[2] = 1500
    rig.run_until(lambda: 0.5 < rig.vehicle.estimate.velocity[0] < 0.9, 20.0)
    assert outputs(rig)[0] == 1050 + 135  # the least share, for a second more
    rig.run(2.5)
    assert outputs(rig) == STOPPED

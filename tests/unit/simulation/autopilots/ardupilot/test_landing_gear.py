"""Landing gear: its output by command, switch, start, height, take-off and landing."""

from __future__ import annotations

from typing import Any

import pytest

from volery.simulation.autopilots.ardupilot.servo_outputs import outputs_of

pytestmark = pytest.mark.optional

CONFIGURE, AUX_FUNCTION, REQUEST_MESSAGE = 2520, 218, 512
SERVO_OUTPUT_RAW = 36
GEAR = {
    "LGR_ENABLE": 1,
    "LGR_OPTIONS": 0,
    "SERVO10_FUNCTION": 29,
    "SERVO10_MIN": 1001,
    "SERVO10_MAX": 1999,
}
UP, DOWN = 1001, 1999


def output(rig: Any) -> int | None:
    pulse: int | None = outputs_of(rig.vehicle).servos.get(10)
    return pulse


def test_a_command_moves_it(station: Any) -> None:
    rig = station(parameters=GEAR)
    rig.run(0.5)
    assert output(rig) is None
    assert rig.command(CONFIGURE, 0, 0) == 0
    assert output(rig) == DOWN
    assert rig.command(CONFIGURE, 0, 1) == 0
    assert output(rig) == UP
    assert rig.command(REQUEST_MESSAGE, SERVO_OUTPUT_RAW) == 0
    assert rig.latest["SERVO_OUTPUT_RAW"]["servo10_raw"] == UP
    assert rig.command(CONFIGURE, 0, 0) == 0
    assert rig.command(CONFIGURE, 0, 0) == 0  # deployed already: not reported again
    reports = [text for text in rig.texts() if text.startswith("LandingGear")]
    assert reports == ["LandingGear: DEPLOY", "LandingGear: RETRACT", "LandingGear: DEPLOY"]


def test_a_switch_moves_it(station: Any) -> None:
    rig = station(parameters=GEAR)
    assert rig.command(AUX_FUNCTION, 29, 2) == 0
    assert output(rig) == UP
    assert rig.command(AUX_FUNCTION, 29, 1) == 0
    assert output(rig) == UP
    assert rig.command(AUX_FUNCTION, 29, 0) == 0
    assert output(rig) == DOWN


def test_a_reversed_output_goes_to_its_other_end(station: Any) -> None:
    rig = station(parameters=GEAR | {"SERVO10_REVERSED": 1})
    assert rig.command(CONFIGURE, 0, 0) == 0
    assert output(rig) == UP


@pytest.mark.parametrize(("startup", "expected"), [(0, None), (1, UP), (2, DOWN)])
def test_where_it_starts(startup: int, expected: int | None, station: Any) -> None:
    rig = station(parameters=GEAR | {"LGR_STARTUP": startup})
    rig.run(0.5)
    assert output(rig) == expected


def test_without_a_gear_nothing_moves(station: Any) -> None:
    rig = station(parameters=GEAR | {"LGR_ENABLE": 0})
    assert rig.command(CONFIGURE, 0, 0) == 0
    assert output(rig) is None
    assert station("rover").command(CONFIGURE, 0, 0) == 3


def fly(rig: Any) -> None:
    """Take off in GUIDED to 12 m."""
    assert rig.command(176, 1, 4) == 0
    assert rig.command(400, 1) == 0
    assert rig.command(22, 0, 0, 0, 0, 0, 0, 12.0) == 0
    rig.run_until(lambda: rig.height > 11.8, 60.0)
    rig.run(2.0)


def test_it_retracts_after_a_take_off_and_deploys_for_the_landing(station: Any) -> None:
    rig = station(parameters=GEAR | {"LGR_OPTIONS": 3, "LGR_STARTUP": 2})
    fly(rig)
    assert output(rig) == UP
    assert rig.command(176, 1, 9) == 0  # LAND
    rig.run(0.5)
    assert output(rig) == DOWN


def test_it_moves_at_heights(station: Any) -> None:
    rig = station(parameters=GEAR | {"LGR_STARTUP": 2, "LGR_RETRACT_ALT": 8, "LGR_DEPLOY_ALT": 5})
    fly(rig)
    assert output(rig) == UP
    assert rig.command(176, 1, 9) == 0
    rig.run_until(lambda: rig.height < 6.5, 60.0)
    assert output(rig) == UP
    rig.run_until(lambda: rig.height < 4.5, 60.0)
    assert output(rig) == DOWN

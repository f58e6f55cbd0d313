"""THROW: a copter that is thrown or dropped starts its motors, stops and goes on in the next mode."""

from __future__ import annotations

from typing import Any

import pytest

pytestmark = pytest.mark.optional

ARM, MODE, THROW, RTL, BRAKE, AUTO = 400, 176, 18, 6, 17, 3
STAGES = [
    "waiting for throw",
    "throw detected - spooling motors",
    "throttle is unlimited - uprighting",
    "uprighted - controlling height",
    "height achieved - controlling position",
]


@pytest.fixture
def armed(station: Any) -> Any:
    """Makes a copter that waits for a throw."""

    def made(**parameters: float) -> Any:
        rig = station(parameters={"ARMING_CHECK": 0, **parameters})
        rig.run(0.5)
        assert rig.command(MODE, 1.0, THROW) == 0
        assert rig.command(ARM, 1.0) == 0
        rig.run(0.5)
        return rig

    return made


def push(rig: Any, seconds: float, *, up: float, forward: float = 0.0) -> None:
    """Push the copter, m/s^2."""
    rig.vehicle.set_parameter("SIM_SHOVE_Z", -up)
    rig.vehicle.set_parameter("SIM_SHOVE_X", forward)
    rig.vehicle.set_parameter("SIM_SHOVE_TIME", 1000.0 * seconds)


def said(rig: Any) -> list[str]:
    return [text for text in rig.texts() if text in STAGES]


def mode(rig: Any) -> int:
    return int(rig.latest["HEARTBEAT"]["custom_mode"])


def test_a_throw_goes_through_its_stages_and_the_copter_hovers(armed: Any) -> None:
    rig = armed()
    push(rig, 0.5, up=30.0, forward=-20.0)
    rig.run(12.0)
    assert said(rig) == STAGES
    assert rig.height > 5.0
    assert all(abs(speed) < 0.3 for speed in rig.vehicle.estimate.velocity)
    assert mode(rig) == THROW
    assert rig.vehicle.parameters["SIM_SHOVE_TIME"] == 0.0


@pytest.mark.parametrize(("wanted", "entered"), [(RTL, RTL), (BRAKE, BRAKE), (7, THROW)])
def test_then_it_enters_the_next_mode(armed: Any, wanted: int, entered: int) -> None:
    rig = armed(THROW_NEXTMODE=wanted)
    push(rig, 0.5, up=30.0)
    rig.run(12.0)
    assert mode(rig) == entered


def test_a_lift_is_no_drop_until_the_copter_falls(armed: Any) -> None:
    rig = armed(THROW_TYPE=1)
    push(rig, 15.0, up=11.0)
    rig.run(14.0)
    assert rig.height > 30.0
    assert said(rig) == STAGES[:1]
    rig.run(10.0)
    assert said(rig) == STAGES
    assert rig.height > 20.0


@pytest.mark.parametrize(
    ("parameters", "up"),
    [({"THROW_TYPE": 1}, 30.0), ({"THROW_ALT_MIN": 50}, 30.0), ({}, 12.0)],
    ids=["not dropped", "too low", "too slow"],
)
def test_what_is_no_throw_leaves_the_motors_off(armed: Any, parameters: dict[str, float], up: float) -> None:
    rig = armed(**parameters)
    push(rig, 0.4, up=up)
    rig.run(0.9)
    assert said(rig) == STAGES[:1]
    assert rig.vehicle.estimate.motors == (0.0, 0.0, 0.0, 0.0)


def test_motors_may_idle_before_the_throw(armed: Any) -> None:
    rig = armed(THROW_MOT_START=1)
    rig.run(1.0)
    assert all(motor > 0.0 for motor in rig.vehicle.estimate.motors)
    push(rig, 0.5, up=30.0)
    rig.run(8.0)
    assert said(rig) == STAGES


def test_a_copter_that_waits_for_a_throw_does_not_disarm(armed: Any) -> None:
    rig = armed(DISARM_DELAY=3)
    rig.run(8.0)
    assert rig.vehicle.armed


def test_an_armed_copter_does_not_enter_it(station: Any) -> None:
    rig = station(parameters={"ARMING_CHECK": 0})
    rig.run(0.5)
    assert rig.command(ARM, 1.0) == 0
    assert rig.command(MODE, 1.0, THROW) == 4
    assert "Mode change to THROW failed: init failed" in rig.texts()

"""STICK_MIXING: a rover that drives by itself also follows the steering stick."""

from __future__ import annotations

from math import degrees
from typing import Any

import pytest

from volery.simulation.autopilots.ardupilot.pilot_input import switches_of

ARM, GUIDED, HOLD, YAW_SPEED = 400, 15, 4, 213


def driving(station: Any, mixing: int) -> Any:
    """Return a rover that drives north in GUIDED."""
    rig = station("rover", parameters={"STICK_MIXING": mixing})
    rig.beat()
    rig.run(0.5)
    rig.vehicle.enter_mode(rig.vehicle.rules.modes[GUIDED])
    assert rig.command(ARM, 1) == 0
    assert rig.command(YAW_SPEED, 0.0, 2.0) == 0
    rig.run(1.0)
    return rig


def heading(rig: Any) -> float:
    return degrees(rig.vehicle.estimate.attitude[2])


@pytest.mark.parametrize("mixing", [0, 1])
def test_the_stick_turns_the_rover_only_where_it_is_mixed_in(station: Any, mixing: int) -> None:
    rig = driving(station, mixing)
    rig.vehicle.rc.transmitter[0] = 1900
    rig.run(1.5)
    assert (heading(rig) > 20.0) is bool(mixing)
    assert abs(heading(rig)) < 10.0 or mixing


def test_the_controls_steer_alone_again_when_the_stick_is_let_go(station: Any) -> None:
    rig = driving(station, 1)
    rig.vehicle.rc.transmitter[0] = 1100
    rig.run(1.0)
    assert heading(rig) < -15.0
    rig.vehicle.rc.transmitter[0] = 1500
    rig.run(0.2)
    assert rig.command(YAW_SPEED, 0.0, 2.0) == 0
    rig.run(2.5)
    assert abs(heading(rig)) < 10.0


def test_a_rover_that_holds_does_not_steer(station: Any) -> None:
    rig = driving(station, 1)
    rig.vehicle.rc.transmitter[0] = 1900
    rig.vehicle.enter_mode(rig.vehicle.rules.modes[HOLD])
    rig.run(0.3)
    assert switches_of(rig.vehicle).mixed_steering == (0.0, 0.0)

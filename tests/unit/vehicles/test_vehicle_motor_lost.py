"""A motor lost in flight is reported within two seconds, whichever autopilot flies."""

from __future__ import annotations

from typing import Any

import pytest

from volery.base.errors import ControlLost, NotArrived, VehicleError
from volery.model.faults import MotorDead
from volery.testing.fault_trials import strike
from volery.testing.stage import SimulatedStage
from volery.vehicles import Drone
from volery.vehicles.address import parse

AUTOPILOTS = ("ardupilot", "px4", "paparazzi", "dji")
LOST = MotorDead(vehicle="", at_ns=0)


def flown(autopilot: str, then: Any, height: float = 30.0) -> tuple[list[str], SimulatedStage]:
    """Take off, and let a motor fail two seconds into *then*; return what it raised, and when."""
    stage = SimulatedStage(parse(f"sim:{autopilot}"), Drone, 3)
    said: list[str] = []

    def flight() -> None:
        stage.drone.takeoff(height)
        struck = stage.kernel.now() + 2_000_000_000
        stage.later(2.0, lambda: strike(LOST, stage))
        try:
            then(stage)
        except VehicleError as error:
            said.append(f"{type(error).__name__}: {error}")
            said.append(f"{(stage.kernel.now() - struck) / 1e9:.1f}")
        stage.sleep(8.0)
        try:
            stage.drone.come_to_rest()
        except NotArrived as error:  # an ArduPilot on its back goes on with its motors, which is said
            said.append(str(error))

    stage.perform(flight)
    return said, stage


@pytest.mark.parametrize("autopilot", AUTOPILOTS)
def test_on_the_way(autopilot: str) -> None:
    said, stage = flown(autopilot, lambda stage: stage.drone.goto(stage.at(60.0, 0.0, 30.0)))
    assert said[0].startswith(ControlLost.__name__), said
    assert float(said[1]) <= 2.0, said
    assert not stage.drone.armed or said[-1].endswith("mode LAND, armed"), said
    stage.close()


def test_while_velocities_are_commanded() -> None:
    def fly_on(stage: SimulatedStage) -> None:
        for _ in range(20):
            stage.drone.set_velocity(north=2.0, lasting=2.0)
            stage.sleep(0.2)

    said, stage = flown("ardupilot", fly_on)
    assert said[0].startswith(ControlLost.__name__), said
    assert float(said[1]) <= 2.0, said
    stage.close()


def test_a_landing_is_not_given_up() -> None:
    said, stage = flown("px4", lambda stage: stage.drone.land())
    assert not any(one.startswith(ControlLost.__name__) for one in said)
    assert not stage.drone.armed
    stage.close()

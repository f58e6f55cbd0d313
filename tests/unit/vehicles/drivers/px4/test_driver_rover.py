"""Rover operations: PX4's sequences against a scripted PX4 rover."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import pytest

from volery.base.errors import CapabilityError, Overridden
from volery.base.time import S
from volery.kernel.waiting import sleep
from volery.vehicles import Capability, Drone, Rover
from volery.vehicles.drivers.px4.modes import HOLD

Make = Callable[..., Any]
NEAR = (45.4675168, -73.7578362)
SET_MODE, ARM, SPEED, GO = 176, 400, 178, 192


def test_driving_arms_and_goes_there(bench: Make) -> None:
    at = bench(Rover)
    at.fly(lambda rover: rover.drive(NEAR, speed=2.0))
    assert at.autopilot.commands() == [ARM, SPEED, GO]
    (target,) = at.autopilot.sent("COMMAND_INT")
    assert (target["z"], target["x"]) == (pytest.approx(32.575, abs=1e-3), 454675168)


def test_it_cannot_take_off(bench: Make) -> None:
    at = bench(Rover)
    at.fly(lambda rover: rover.wait_connected())
    assert Capability.TAKEOFF not in at.vehicle.capabilities
    wrong = bench(Drone)
    wrong.autopilot.kind = 10
    with pytest.raises(CapabilityError, match="is a rover, not a drone"):
        wrong.fly(lambda drone: drone.takeoff(10))


def test_it_stands_in_hold_and_disarms_at_the_end_of_a_program(bench: Make) -> None:
    at = bench(Rover)

    def mission(rover: Any) -> str:
        rover.drive(NEAR)
        return str(rover.come_to_rest())

    assert at.fly(mission) == "stopped and was disarmed"
    assert (at.craft.mode, at.craft.armed) == (HOLD, False)


def test_returning_home(bench: Make) -> None:
    at = bench(Rover)

    def mission(rover: Any) -> None:
        rover.drive(NEAR)
        at.after(5, lambda: setattr(at.craft, "north", 0.5))
        rover.return_home()

    at.fly(mission)
    assert at.craft.mode == "AUTO.RTL"


def test_driving_by_hand(bench: Make) -> None:
    at = bench(Rover)

    def mission(rover: Any) -> None:
        rover.wait_ready()
        rover.arm()
        rover.manual_control(0.5, -0.4)
        rover.manual()
        sleep(at.kernel, S)

    at.fly(mission)
    assert at.craft.mode == "MANUAL"
    last = at.autopilot.sent("MANUAL_CONTROL")[-1]
    assert (last["y"], last["z"], last["x"], last["r"]) == (500, 300, 0, 0)


def test_another_mode_ends_a_drive(bench: Make) -> None:
    at = bench(Rover)

    def mission(rover: Any) -> None:
        rover.wait_ready()
        at.after(3.5, lambda: at.autopilot.enter("POSCTL"))
        at.autopilot._there = lambda *goal: None
        rover.drive(NEAR)

    with pytest.raises(Overridden, match=r"AUTO\.LOITER to POSCTL"):
        at.fly(mission)

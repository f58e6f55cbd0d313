"""The driver of the examples: it has no more than every driver has, and a drone flies with it."""

from __future__ import annotations

import runpy
from collections.abc import Iterator
from pathlib import Path

import pytest

from volery import AMSL, AboveHome, Drone, Position
from volery.base.errors import CapabilityError
from volery.kernel.virtual import VirtualKernel
from volery.vehicles.driver import ManualControl

HOME = Position(46.0825, -103.8995, AMSL(900.0))
THERE = Position(46.0830, -103.8995, AboveHome(20.0))
LeastDriver = runpy.run_path(str(Path(__file__).parents[3] / "examples" / "driver" / "least_driver.py"))[
    "LeastDriver"
]


@pytest.fixture
def drone() -> Iterator[Drone]:
    kernel = VirtualKernel()
    with kernel.adopt("script"):
        yield Drone(kernel, "craft", LeastDriver(kernel, "craft", HOME))
    kernel.close()


def test_a_drone_flies_with_the_driver_of_the_examples(drone: Drone) -> None:
    drone.takeoff(10)
    drone.goto(THERE)
    assert drone.position == Position(THERE.latitude, THERE.longitude, AMSL(920.0))
    drone.hold()
    assert drone.flying
    drone.return_home()
    assert (drone.armed, drone.position) == (False, HOME)
    drone.arm()
    assert drone.armed
    drone.disarm()
    drone.takeoff(5)
    drone.land()
    assert (drone.armed, drone.altitude.metres) == (False, 0.0)


def test_what_a_driver_does_not_have_is_refused(drone: Drone) -> None:
    drone.takeoff(10)
    with pytest.raises(CapabilityError, match="craft cannot follow a velocity; it can go to a position"):
        drone.set_velocity(north=1.0)
    with pytest.raises(CapabilityError, match="parameters: not with this driver"):
        _ = drone.parameters
    with pytest.raises(CapabilityError, match="cannot make it land when the link is lost"):
        drone.set_link_loss_action("land")
    assert drone.on_link_loss == "its driver does not know"


def test_what_has_no_steps_says_so() -> None:
    driver = LeastDriver(VirtualKernel(), "craft", HOME)
    for call in (
        lambda: driver.velocity(None, 0.0, 1),
        lambda: driver.acceleration(None, 0.0, 1),
        lambda: driver.attitude(None, 1),
        lambda: driver.heading(90.0),
        driver.stabilize,
        driver.altitude_hold,
        driver.manual,
        driver.hand_over,
        lambda: driver.manual_control(ManualControl()),
        lambda: driver.upload(()),
        lambda: driver.start_mission(1),
    ):
        with pytest.raises(CapabilityError, match=r"craft cannot .*: its driver has no steps for it"):
            call()
    driver.manual_control(None)

"""Checks of rovers."""

from __future__ import annotations

from math import hypot

from volery.base.errors import UsageError
from volery.testing.checks import check, demand, raising
from volery.testing.stage import TestStage
from volery.vehicles import Capability

NEAR_M = 3.0


@check(kind="rover", needs=(Capability.GOTO,), flies=True)
def drive(stage: TestStage) -> None:
    """Check that a rover is armed, drives and stops at the goal by the autopilot's estimate, at rest."""
    stage.drone.wait_ready()
    goal = stage.at(25, 10, 0.0)
    stage.drone.drive(goal)
    north, east, _ = stage.offset(goal, stage.drone.position)
    demand(hypot(north, east) < NEAR_M, f"it stopped {hypot(north, east):.1f} m away")
    stage.sleep(3)
    demand(not stage.drone.driving, "it still moves")


@check(kind="rover", needs=(Capability.GOTO, Capability.RETURN_HOME), flies=True)
def drive_home(stage: TestStage) -> None:
    """Check that return_home() stops near home."""
    stage.drone.wait_ready()
    stage.drone.drive(stage.at(25, 0, 0.0))
    stage.drone.return_home()
    north, east, _ = stage.offset(stage.drone.home, stage.drone.position)
    demand(hypot(north, east) < NEAR_M + 1.0, f"it stopped {hypot(north, east):.1f} m from home")


@check(kind="rover", needs=(Capability.MANUAL_CONTROL,), flies=True)
def drive_by_hand(stage: TestStage) -> None:
    """Check that in manual(), armed, the throttle drives, and a control out of range is refused."""
    stage.drone.wait_ready()
    stage.drone.manual_control(0.0, 0.0)
    stage.drone.manual()
    stage.drone.arm()
    start = stage.drone.position
    for _ in range(40):
        stage.drone.manual_control(0.0, 0.5)
        stage.sleep(0.1)
    north, east, _ = stage.offset(start, stage.drone.position)
    demand(hypot(north, east) > 1.0, f"in 4 s it went {hypot(north, east):.1f} m")
    with raising(UsageError, naming="throttle"):
        stage.drone.manual_control(0.0, 2.0)


@check(kind="rover", needs=(Capability.GOTO,), flies=True)
def rest(stage: TestStage) -> str:
    """Check that come_to_rest() stops and disarms the rover."""
    stage.drone.wait_ready()
    stage.drone.drive(stage.at(10, 0, 0.0))
    words = str(stage.drone.come_to_rest())
    demand(not stage.drone.armed, f"it {words}, but is armed")
    return words

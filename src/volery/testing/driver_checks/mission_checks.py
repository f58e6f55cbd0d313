"""Checks of missions that the autopilot flies."""

from __future__ import annotations

from volery.base.errors import OutOfBounds, UsageError
from volery.base.time import S
from volery.testing.checks import check, demand, raising
from volery.testing.driver_checks.flight_checks import demand_there
from volery.testing.stage import TestStage
from volery.vehicles import Capability, ChangeSpeed, Land, MissionItem, ReturnHome, TakeOff, Waypoint

MISSION = (Capability.MISSION,)


@check(needs=MISSION, flies=True)
def mission(stage: TestStage) -> None:
    """Check that a mission is uploaded, started, flown and landed; start_mission() returns disarmed."""
    stage.drone.wait_ready()
    goal = stage.at(25, 10, 12)
    reached: list[bool] = []
    items: list[MissionItem] = [
        TakeOff(10),
        Waypoint(goal),
        ChangeSpeed(3.0),
        Waypoint(stage.at(5, 5)),
        Land(),
    ]
    stage.drone.upload_mission(items)
    demand(not stage.drone.armed, "an upload has armed it")
    seen = stage.drone.telemetry

    def look() -> None:
        if seen.position is not None:
            north, east, _ = stage.offset(goal, seen.position)
            reached.append(north * north + east * east < 16.0)

    handle = stage.kernel.every(200_000_000, look)
    stage.drone.start_mission(within=300)
    handle.cancel()
    demand(any(reached), "it never came within 4 m of its first point")
    demand(not stage.drone.armed, "it is armed")


@check(needs=MISSION, flies=True)
def mission_that_returns(stage: TestStage) -> None:
    """Check that a mission that ends with a return home ends there, disarmed."""
    stage.drone.wait_ready()
    stage.drone.upload_mission([TakeOff(10), Waypoint(stage.at(25, 0)), ReturnHome()])
    homes = [stage.drone.home]

    def look() -> None:
        if stage.drone.flying:  # arming has moved the home to where it stood
            homes.append(stage.drone.home)

    handle = stage.kernel.every(S, look)
    stage.drone.start_mission(within=300)
    handle.cancel()
    demand(not stage.drone.armed, "it is armed")
    north, east, _ = stage.offset(homes[-1], stage.drone.position)
    demand(north * north + east * east < 16.0, f"it ended {north:.1f}, {east:.1f} m from home")


@check(needs=(*MISSION, Capability.GOTO), flies=True)
def mission_that_ends_in_the_air(stage: TestStage) -> None:
    """Check that goto() and land() work after a mission whose last item is a waypoint."""
    stage.drone.wait_ready()
    last = stage.at(15, 5)
    stage.drone.upload_mission([TakeOff(10), Waypoint(last)])
    stage.drone.start_mission(within=300)
    demand(stage.drone.flying, "it does not fly")
    goal = stage.at(0, 5)
    stage.drone.goto(goal)
    demand_there(stage, goal)
    stage.drone.land()


@check(needs=MISSION)
def missions_that_make_no_sense(stage: TestStage) -> None:
    """Check that an empty mission and one outside the limits are refused before anything is sent."""
    stage.drone.wait_ready()
    with raising(UsageError, naming=stage.name):
        stage.drone.upload_mission([])
    far = stage.drone.limits.highest + 50.0
    with raising(OutOfBounds, naming=stage.name):
        stage.drone.upload_mission([TakeOff(10), Waypoint(stage.at(10, 0, far))])

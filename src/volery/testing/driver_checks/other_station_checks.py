"""Checks with another ground station, which commands the vehicle, or another vehicle on the link."""

from __future__ import annotations

from math import hypot

from volery.base.errors import (
    Failsafe,
    LinkGarbled,
    LinkSilent,
    NotArrived,
    Overridden,
    Refused,
    VehicleError,
)
from volery.base.time import S
from volery.testing.checks import NotPossibleError, check, demand, raising
from volery.testing.stage import TestStage
from volery.vehicles import Capability

GO = (Capability.TAKEOFF, Capability.GOTO)


@check(needs=(*GO, Capability.LAND), flies=True)
def mode_change_by_another(stage: TestStage) -> str:
    """Check that goto() ends with Overridden when another station lands it, which is not resisted."""
    other = stage.other()
    stage.drone.takeoff(10)
    stage.later(3.0, other.land)
    with raising(Overridden, Failsafe, naming=stage.name) as caught:
        stage.drone.goto(stage.at(60, 0), speed=_slow(stage))
    theirs = stage.drone.mode
    if stage.drone.flying:
        with raising(VehicleError, naming=stage.name):
            stage.drone.goto(stage.at(10, 0))
        demand(stage.drone.mode == theirs, f"its mode was fought: {theirs} became {stage.drone.mode}")
    stage.until(lambda: not stage.drone.armed, 120.0, f"it did not land in {theirs}")
    return caught.text.removeprefix(f"{stage.name}: ")


def _slow(stage: TestStage) -> float | None:
    return 2.0 if Capability.SPEED in stage.drone.capabilities else None


@check(needs=GO, flies=True)
def sent_elsewhere_by_another(stage: TestStage) -> str:
    """Check that goto() ends with an error when another station sends the vehicle elsewhere in the same mode.

    The error is Overridden if the autopilot reports its target, else NotArrived in time; the target is not
    restored.
    """
    other = stage.other()
    stage.drone.takeoff(10)
    there = stage.at(0, 40)
    stage.later(3.0, other.sender_to(there))
    with raising(Overridden, NotArrived, naming=stage.name) as caught:
        stage.drone.goto(stage.at(60, 0), speed=_slow(stage))

    def is_there() -> bool:
        north, east, _ = stage.offset(there, stage.drone.position)
        return hypot(north, east) < 3.0

    stage.until(is_there, 60.0, "it did not go where the other station sent it")
    return caught.text.removeprefix(f"{stage.name}: ")


@check(needs=(*GO, Capability.LAND), flies=True)
def mode_change_while_idle(stage: TestStage) -> None:
    """Check that goto() after a landing by another station reports that and does not resist."""
    other = stage.other()
    stage.drone.takeoff(15)
    stage.later(0.0, other.land)
    stage.sleep(4)
    with raising(Overridden, naming=stage.name):
        stage.drone.goto(stage.at(10, 0))
    stage.until(lambda: not stage.drone.armed, 120.0, "it did not land")


@check(needs=(Capability.TAKEOFF, Capability.LAND), flies=True)
def mode_change_during_takeoff(stage: TestStage) -> str:
    """Check that takeoff() ends with a VehicleError when another station lands the vehicle."""
    other = stage.other()
    stage.drone.wait_ready()

    def land_in_the_air() -> None:
        stage.until(lambda: other.seen.flying and other.seen.above_home > 3.0, 60.0, "it never rose")
        other.land()

    stage.later(0.0, land_in_the_air)
    with raising(VehicleError, naming=stage.name) as caught:
        stage.drone.takeoff(20)
    stage.until(lambda: not stage.drone.armed, 120.0, "it did not land")
    return caught.text.removeprefix(f"{stage.name}: ")


@check(needs=GO, flies=True, lets_fall=True)
def disarmed_midway(stage: TestStage) -> str:
    """Check that goto() ends with Overridden when another station stops the motors, and is not resumed."""
    other = stage.other()
    stage.drone.takeoff(5)
    refused: list[str] = []

    def stop_the_motors() -> None:
        try:
            other.disarm()
        except Refused as error:
            refused.append(error.what)
            stage.drone.hold()

    stage.later(2.0, stop_the_motors)
    try:
        with raising(Overridden, Failsafe, naming=stage.name) as caught:
            stage.drone.goto(stage.at(60, 0, 5), speed=_slow(stage))
    finally:
        if refused:
            raise NotPossibleError(f"no program stops its motors in the air: {refused[0]}")
    stage.sleep(5)
    demand(not stage.drone.armed, "it was armed again")
    return caught.text.removeprefix(f"{stage.name}: ")


@check(needs=(Capability.TAKEOFF,), flies=True)
def disarmed_before_lift_off(stage: TestStage) -> str:
    """Check that a take-off disarmed by another station is repeated, or ends with an error that says so."""
    other = stage.other()
    stage.drone.wait_ready()

    def disarm_once_armed() -> None:
        stage.until(lambda: other.seen.armed, 60.0, "it was never armed")
        other.disarm()

    stage.later(0.0, disarm_once_armed)
    try:
        stage.drone.takeoff(10)
    except VehicleError as error:
        demand(stage.name in str(error), f"the error does not name it: {error}")
        return type(error).__name__
    demand(stage.drone.flying, "takeoff() returned on the ground")
    return "started over"


@check(needs=(Capability.TAKEOFF,), flies=True, neighbour=True)
def another_vehicle_on_the_air(stage: TestStage) -> None:
    """Check that only the addressed vehicle arms and flies when a second one is on the same link."""
    neighbour = stage.neighbour
    neighbour.wait_connected()
    stage.drone.takeoff(10)
    demand(not neighbour.armed, "the neighbour was armed, too")
    north, east, _ = stage.offset(stage.drone.home, stage.drone.position)
    demand(north * north + east * east < 100.0, "its position is the neighbour's")
    stage.drone.land()


@check(kind="")
def wrong_system_id(stage: TestStage) -> str:
    """Check that a driver for a system id without a vehicle reports that no message arrives."""
    stranger = stage.of_system(77)
    try:
        with raising(LinkSilent, LinkGarbled, naming=stage.name) as caught:
            stranger.wait_connected(5.0)
    finally:
        stranger.close()
    return caught.text.removeprefix(f"{stage.name}: ")


@check(needs=GO, flies=True)
def home_moved_by_another(stage: TestStage) -> str:
    """Check that a home set by another station 20 m away is reported, and return_home() goes there."""
    other = stage.other()
    stage.drone.takeoff(10)
    there = stage.at(20, 0, 0.0, amsl=True)
    other.set_home(there)

    def moved() -> bool:
        north, east, _ = stage.offset(there, stage.drone.home)
        return north * north + east * east < 4.0

    stage.until(moved, 10.0, "the program still sees the old home")
    if Capability.RETURN_HOME not in stage.drone.capabilities:
        raise NotPossibleError("it cannot return home")
    stage.drone.return_home()
    north, east, _ = stage.offset(there, stage.drone.position)
    demand(north * north + east * east < 16.0, f"it came down {north:.1f}, {east:.1f} m from there")
    return f"seen, and returned to, after {stage.kernel.now() // S} s"

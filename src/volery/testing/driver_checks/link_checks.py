"""Checks of the link: interrupted briefly, for long or in one direction; and of programs that die."""

from __future__ import annotations

from math import hypot

from volery.base.errors import LinkLost, VehicleError, VoleryError
from volery.base.time import to_seconds
from volery.testing.checks import check, demand, raising
from volery.testing.stage import TestStage
from volery.vehicles import Capability
from volery.vehicles.executor import LINK_TIMEOUT

GO = (Capability.TAKEOFF, Capability.GOTO)
NOTICED_S = to_seconds(LINK_TIMEOUT) + 1.5


@check(needs=GO, flies=True)
def link_cut_for_a_moment(stage: TestStage) -> str:
    """Check that an interruption of the link for 0.5 s in flight has no effect."""
    stage.drone.takeoff(10)
    stage.later(2.0, stage.link_control.drop)
    stage.later(2.5, stage.link_control.restore)
    stage.drone.goto(stage.at(30, 0))
    return f"in {stage.drone.mode}"


@check(needs=GO, flies=True)
def link_cut_for_two_seconds(stage: TestStage) -> str:
    """Check that goto() survives an interruption of the link for 2 s.

    It arrives, or reports that the autopilot has taken over; it neither reports a lost link nor hangs.
    """
    stage.drone.takeoff(10)
    stage.later(2.0, stage.link_control.drop)
    stage.later(4.0, stage.link_control.restore)
    try:
        stage.drone.goto(stage.at(30, 0))
    except VehicleError as error:
        demand(stage.name in str(error), f"the error does not name it: {error}")
        return type(error).__name__
    return "arrives"


@check(needs=GO, flies=True)
def link_lost(stage: TestStage) -> str:
    """Check that an interruption of the link for 10 s ends goto() with LinkLost, 5 s after the last message.

    When the link is back, the vehicle can be landed, or is left to the commander that controls it.
    """
    stage.drone.takeoff(10)
    cut = stage.kernel.now() + round(2e9)
    stage.later(2.0, stage.link_control.drop)
    stage.later(12.0, stage.link_control.restore)
    with raising(LinkLost, naming=stage.name):
        stage.drone.goto(stage.at(60, 0), speed=2.0 if Capability.SPEED in stage.drone.capabilities else None)
    after = to_seconds(stage.kernel.now() - cut)
    demand(after < NOTICED_S, f"it was noticed after {after:.1f} s")
    seen = stage.drone.telemetry
    stage.until(lambda: stage.kernel.now() - seen.last_message_ns < 1e9, 20.0, "no message arrived again")
    stage.sleep(2)
    words = str(stage.drone.come_to_rest())
    if stage.drone.armed:
        stage.until_down(180.0)
    return words


@check(needs=GO, flies=True)
def lost_commands(stage: TestStage) -> str:
    """Check that goto() ends with an error within its time while only the vehicle's frames arrive."""
    stage.drone.takeoff(10)
    stage.link_control.sends = False
    began = stage.kernel.now()
    try:
        with raising(VoleryError, naming=stage.name) as caught:
            stage.drone.goto(stage.at(30, 0))
        demand(to_seconds(stage.kernel.now() - began) < 120.0, "it took longer than two minutes")
    finally:
        stage.link_control.restore()
    return type(caught.error).__name__


@check(needs=(Capability.TAKEOFF,), flies=True)
def commander_silence(stage: TestStage) -> str:
    """Check that a vehicle whose program dies in flight neither falls nor flies away within 20 s.

    A program that starts then lands the vehicle, or leaves it to the commander that controls it.
    """
    stage.drone.takeoff(10)
    here = stage.drone.position
    words = stage.driver.on_link_loss()
    witness = stage.another_program()
    witness.wait_connected()
    stage.end_program()
    stage.sleep(20)
    north, east, _ = stage.offset(here, witness.position)
    demand(hypot(north, east) < 30.0, f"it went {hypot(north, east):.0f} m")
    sank = here.altitude.metres - witness.position.altitude.metres
    demand(sank < 30.0, f"it sank {sank:.0f} m")
    mode = witness.mode
    witness.come_to_rest()
    witness.close()
    return f"after 20 s it is in {mode}; said beforehand: {words or 'nothing'}"

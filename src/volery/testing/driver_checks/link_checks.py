"""The wire: cut for a moment, cut for long, dead in one direction; and programs that die."""

from __future__ import annotations

from math import hypot

from volery.base.errors import LinkLost, VehicleError, VoleryError
from volery.base.time import to_seconds
from volery.testing.checks import check, demand, raising
from volery.testing.stage import Stage
from volery.vehicles import Capability
from volery.vehicles.executor import LINK_TIMEOUT

GO = (Capability.TAKEOFF, Capability.GOTO)
NOTICED_S = to_seconds(LINK_TIMEOUT) + 1.5


@check(needs=GO, flies=True)
def link_cut_for_a_moment(stage: Stage) -> str:
    """A link that is cut for half a second in flight is as if nothing had happened."""
    stage.drone.takeoff(10)
    stage.later(2.0, stage.tap.cut)
    stage.later(2.5, stage.tap.mend)
    stage.drone.goto(stage.at(30, 0))
    return f"in {stage.drone.mode}"


@check(needs=GO, flies=True)
def link_cut_for_two_seconds(stage: Stage) -> str:
    """A link that is cut for 2 s in flight: goto() arrives, or says that the autopilot has taken over; it is
    never lost and never a hang.
    """
    stage.drone.takeoff(10)
    stage.later(2.0, stage.tap.cut)
    stage.later(4.0, stage.tap.mend)
    try:
        stage.drone.goto(stage.at(30, 0))
    except VehicleError as error:
        demand(stage.name in str(error), f"the error does not name it: {error}")
        return type(error).__name__
    return "arrives"


@check(needs=GO, flies=True)
def link_lost(stage: Stage) -> str:
    """A link that is cut for 10 s ends goto() with LinkLost, 5 s after the last word; when it is back, the
    vehicle is heard again and can be brought down, or is left to whoever has it.
    """
    stage.drone.takeoff(10)
    cut = stage.kernel.now() + round(2e9)
    stage.later(2.0, stage.tap.cut)
    stage.later(12.0, stage.tap.mend)
    with raising(LinkLost, naming=stage.name):
        stage.drone.goto(stage.at(60, 0), speed=2.0 if Capability.SPEED in stage.drone.capabilities else None)
    after = to_seconds(stage.kernel.now() - cut)
    demand(after < NOTICED_S, f"it was noticed after {after:.1f} s")
    seen = stage.drone.telemetry
    stage.until(lambda: stage.kernel.now() - seen.last_message_ns < 1e9, 20.0, "it was not heard again")
    stage.sleep(2)
    words = str(stage.drone.come_to_rest())
    if stage.drone.armed:
        stage.until_down(180.0)
    return words


@check(needs=GO, flies=True)
def commands_that_nobody_hears(stage: Stage) -> str:
    """What we say is lost while what it says arrives: goto() ends with an error within its time, and never
    claims to have arrived.
    """
    stage.drone.takeoff(10)
    stage.tap.speaks = False
    began = stage.kernel.now()
    try:
        with raising(VoleryError, naming=stage.name) as caught:
            stage.drone.goto(stage.at(30, 0))
        demand(to_seconds(stage.kernel.now() - began) < 120.0, "it took longer than two minutes")
    finally:
        stage.tap.mend()
    return type(caught.error).__name__


@check(needs=(Capability.TAKEOFF,), flies=True)
def commander_silence(stage: Stage) -> str:
    """The program dies in flight: within 20 s the vehicle neither falls nor flees, and one that starts then
    hears it and brings it down, or leaves it to whoever has it.
    """
    stage.drone.takeoff(10)
    here = stage.drone.position
    words = stage.driver.on_link_loss()
    witness = stage.another_program()
    witness.wait_connected()
    stage.drone.close()
    stage.sleep(20)
    north, east, _ = stage.offset(here, witness.position)
    demand(hypot(north, east) < 30.0, f"it went {hypot(north, east):.0f} m")
    sank = here.altitude.metres - witness.position.altitude.metres
    demand(sank < 30.0, f"it sank {sank:.0f} m")
    mode = witness.mode
    witness.come_to_rest()
    witness.close()
    return f"after 20 s it is in {mode}; said beforehand: {words or 'nothing'}"

"""Checks on the ground: what is known before the vehicle moves, and what is refused."""

from __future__ import annotations

from collections.abc import Callable
from math import inf, isfinite, nan

from volery.base.errors import CapabilityError, NotArrived, Refused, UsageError, VehicleError
from volery.base.position import AboveGround, Ellipsoidal, Position
from volery.base.time import to_seconds
from volery.testing.checks import CheckFailedError, NotPossibleError, check, demand, raising
from volery.testing.stage import TestStage
from volery.vehicles import Capability

SAYS_WITHIN_S = 15.0
READY_FOR_S, READY_AGAIN_WITHIN_S = 5.0, 15.0


@check(kind="")
def identification(stage: TestStage) -> str:
    """Check that a connected vehicle reports its kind, autopilot and mode."""
    seen = stage.drone.telemetry
    stage.until(
        lambda: seen.mode and seen.autopilot, 5.0, f"mode {seen.mode!r}, autopilot {seen.autopilot!r}"
    )
    demand(seen.kind == stage.drone.kind, f"it says that it is {seen.kind!r}")
    return f"{seen.autopilot} in {seen.mode}"


@check(kind="")
def capabilities(stage: TestStage) -> str:
    """Check that capabilities are known before arming, and requests of missing ones change nothing."""
    can = stage.drone.capabilities
    demand(can, "it states no capabilities")
    demand(not stage.drone.armed, "it is armed already")
    missing = [one for one in Capability if one not in can]
    before = stage.drone.mode
    for capability, ask in _asking(stage).items():
        if capability in missing:
            with raising(CapabilityError, naming=stage.name):
                ask()
    demand(not stage.drone.armed and stage.drone.mode == before, "something changed")
    return "all" if not missing else "all but to " + ", ".join(one.value for one in missing)


def _asking(stage: TestStage) -> dict[Capability, Callable[[], None]]:
    drone = stage.drone
    if drone.kind != "drone":
        return {}
    return {
        Capability.TAKEOFF: lambda: drone.takeoff(10),
        Capability.VELOCITY: lambda: drone.set_velocity(north=1.0),
        Capability.HEADING: lambda: drone.set_heading(90),
        Capability.STABILIZE: drone.stabilize,
        Capability.ALTITUDE_HOLD: drone.altitude_hold,
        Capability.MANUAL_CONTROL: lambda: drone.manual_control(0, 0, 0.5, 0),
        Capability.MISSION: lambda: drone.upload_mission([]),
    }


@check(kind="")
def readiness(stage: TestStage) -> str:
    """Check that wait_ready() returns when the vehicle can arm and navigate, and that this lasts.

    A second call states what would refuse a take-off.
    """
    stage.drone.wait_ready()
    seen = stage.drone.telemetry
    demand(seen.ready or seen.armed, "it returned although the vehicle is not ready")
    stage.sleep(READY_FOR_S)
    stage.drone.wait_ready(within=READY_AGAIN_WITHIN_S)
    here, home = stage.drone.position, stage.drone.home
    north, east, _ = stage.offset(home, here)
    demand(north * north + east * east < 1e8, f"home is {home}, but it stands at {here}")
    return f"after {to_seconds(stage.kernel.now()):.0f} s"


@check(kind="", cold=True)
def readiness_after_switching_on(stage: TestStage) -> str:
    """Check that wait_ready() of a vehicle just switched on does not return before it has a position."""
    began = stage.kernel.now()
    stage.drone.wait_ready()
    demand(stage.drone.telemetry.position is not None, "it returned without a position")
    return f"{to_seconds(stage.kernel.now() - began):.0f} s"


@check(kind="", cold=True)
def readiness_in_time(stage: TestStage) -> None:
    """Check that wait_ready(within=2) of a vehicle just switched on raises NotArrived after 2 s."""
    began = stage.kernel.now()
    with raising(NotArrived, naming=stage.name):
        stage.drone.wait_ready(within=2)
    demand(1.9 < to_seconds(stage.kernel.now() - began) < 4.0, "not after 2 s")


@check(kind="", flies=True, cold=True)
def arming_refused(stage: TestStage) -> str:
    """Check that arming too early is refused with the autopilot's text.

    A driver that provides by itself what is missing returns armed instead.
    """
    if stage.drone.telemetry.armable:
        raise NotPossibleError("it can be armed from its first message on")
    try:
        with raising(Refused, NotArrived, naming=stage.name) as caught:
            stage.drone.arm()
    except CheckFailedError:
        demand(stage.drone.armed, "it was not refused, and it is not armed")
        return "armed: the driver has done what lacked"
    demand(not stage.drone.armed, "it is armed nevertheless")
    return caught.text.removeprefix(f"{stage.name}: ")


@check(kind="", flies=True)
def arming(stage: TestStage) -> None:
    """Check that arm() returns armed, disarm() disarmed, and that repeating them is no error."""
    stage.drone.wait_ready()
    stage.drone.hold()  # a rover that is armed in a pilot's mode is the pilot's
    for _ in range(2):
        stage.drone.arm()
        demand(stage.drone.armed, "arm() returned, but it is not armed")
    for _ in range(2):
        stage.drone.disarm()
        demand(not stage.drone.armed, "disarm() returned, but it is armed")


@check(needs=(Capability.GOTO,))
def goto_on_the_ground(stage: TestStage) -> None:
    """Check that goto() before a take-off is refused and nothing moves."""
    stage.drone.wait_ready()
    with raising(Refused, naming=stage.name):
        stage.drone.goto(stage.at(20, 0))
    demand(not stage.drone.armed, "it was armed")


@check()
def land_on_the_ground(stage: TestStage) -> None:
    """Check that land() of a disarmed vehicle on the ground returns at once."""
    stage.drone.wait_ready()
    began = stage.kernel.now()
    stage.drone.land()
    demand(to_seconds(stage.kernel.now() - began) < 2.0, "it took its time")
    demand(not stage.drone.armed, "it is armed")


@check()
def numbers_that_are_none(stage: TestStage) -> None:
    """Check that arguments which are not finite or out of range are refused before anything is sent."""
    stage.drone.wait_ready()
    drone, refused = stage.drone, (UsageError, CapabilityError, VehicleError)
    for height in (nan, inf, -5.0, 0.0):
        with raising(*refused, naming=stage.name):
            drone.takeoff(height)
    for sticks in ((nan, 0, 0.5, 0), (0, 1.5, 0.5, 0), (0, 0, -0.1, 0), (0, 0, 0.5, inf)):
        with raising(*refused, naming=stage.name):
            drone.manual_control(*sticks)
    for velocity in ((nan, 0, 0), (0, inf, 0)):
        with raising(*refused, naming=stage.name):
            drone.set_velocity(*velocity)
    with raising(*refused, naming=stage.name):
        drone.set_heading(nan)
    demand(not drone.armed, "it was armed")


@check(needs=(Capability.TAKEOFF,))
def too_high(stage: TestStage) -> None:
    """Check that a take-off above the given limits is refused before the vehicle is armed."""
    stage.drone.wait_ready()
    with raising(VehicleError, naming=stage.name):
        stage.drone.takeoff(stage.drone.limits.highest + 1.0)
    demand(not stage.drone.armed, "it was armed")


@check(flies=True, needs=(Capability.TAKEOFF, Capability.GOTO))
def altitudes_that_it_cannot_fly(stage: TestStage) -> str:
    """Check that an ellipsoidal altitude is a CapabilityError; one above ground is, too, or is flown to."""
    stage.drone.takeoff(10)
    home = stage.drone.home
    with raising(CapabilityError, naming=stage.name):
        stage.drone.goto(Position(home.latitude, home.longitude, Ellipsoidal(home.altitude.metres + 10)))
    above_ground = Position(home.latitude, home.longitude, AboveGround(12.0))
    if Capability.TERRAIN in stage.drone.capabilities:
        stage.drone.goto(above_ground)
        return "flies above ground"
    with raising(CapabilityError, naming=stage.name):
        stage.drone.goto(above_ground)
    return "no altitudes above ground"


@check(kind="")
def what_if_silent(stage: TestStage) -> str:
    """Check that a connected driver states in one line the vehicle's reaction to the loss of its link."""
    stage.until(stage.driver.on_link_loss, SAYS_WITHIN_S, "it never says")
    words = stage.driver.on_link_loss()
    demand("\n" not in words, f"more than one line: {words!r}")
    return words


@check(kind="")
def battery(stage: TestStage) -> str:
    """Check that battery figures are plausible: a share from 0 to 1, volts above 0, or not measured."""
    stage.sleep(3.0)
    found = stage.drone.battery
    share, volts = found.remaining, found.volts
    demand(not isfinite(share) or 0.0 <= share <= 1.0, f"{share} remain")
    demand(not isfinite(volts) or 0.0 < volts < 100.0, f"{volts} V")
    return f"{share:.0%}, {volts:.1f} V"

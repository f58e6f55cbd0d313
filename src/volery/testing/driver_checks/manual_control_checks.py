"""Checks of manual control, with and without satellites."""

from __future__ import annotations

from collections.abc import Callable

from volery.base.errors import Refused, UsageError, VehicleError
from volery.testing.checks import check, demand, raising
from volery.testing.stage import TestStage
from volery.vehicles import Capability

STICKS = (Capability.MANUAL_CONTROL, Capability.ALTITUDE_HOLD)
CLIMBING = (*STICKS, Capability.CLIMB_BY_THROTTLE)
STABILIZED = (Capability.MANUAL_CONTROL, Capability.STABILIZE)
UP = (Capability.TAKEOFF,)
BETWEEN_S = 0.1
STRAYED_M = 4.0
"""Distance from the height at which manual flight began, at which it ends: 30 m above home are clear."""


def fly_by_hand(
    stage: TestStage,
    seconds: float,
    throttle: float,
    *,
    pitch: float = 0.0,
    roll: float = 0.0,
    until: Callable[[], bool] = lambda: False,
) -> None:
    """Send manual control samples at 10 Hz for `seconds` s, or until `until` holds."""
    for _ in range(round(seconds / BETWEEN_S)):
        stage.drone.manual_control(pitch, roll, throttle, 0.0)
        stage.sleep(BETWEEN_S)
        if until():
            return


@check(needs=STICKS)
def sticks_out_of_range(stage: TestStage) -> None:
    """Check that controls beyond -1..1 and a throttle beyond 0..1 are refused by name."""
    for sticks, which in (((2, 0, 0.5, 0), "pitch"), ((0, -2, 0.5, 0), "roll"), ((0, 0, 1.1, 0), "throttle")):
        with raising(UsageError, naming=which):
            stage.drone.manual_control(*sticks)


@check(needs=(*STICKS, *UP), flies=True)
def stale_controls(stage: TestStage) -> None:
    """Check that altitude_hold() in flight is refused while no control sample is newer than 1 s."""
    stage.drone.takeoff(10)
    with raising(Refused, UsageError, VehicleError, naming=stage.name):
        stage.drone.altitude_hold()
    stage.sleep(3)
    demand(stage.drone.altitude.metres > 7.0, "it has left its height")


@check(needs=(*STICKS, *UP), flies=True)
def altitude_hold(stage: TestStage) -> str:
    """Check that in altitude hold a throttle of 0.5 keeps the height."""
    stage.drone.takeoff(10)
    stage.drone.manual_control(0, 0, 0.5, 0)
    stage.drone.altitude_hold()
    fly_by_hand(stage, 2, 0.5)
    before = stage.drone.altitude.metres
    fly_by_hand(stage, 8, 0.5)
    kept = stage.drone.altitude.metres
    demand(abs(kept - before) < 1.5, f"in 8 s at 0.5 its height went from {before:.1f} to {kept:.1f} m")
    return f"{stage.drone.mode}: {kept - before:+.1f} m in 8 s"


@check(needs=(*CLIMBING, *UP), flies=True)
def climb_by_throttle(stage: TestStage) -> str:
    """Check that in altitude hold a throttle of 0.8 climbs and 0.2 descends."""
    stage.drone.takeoff(10)
    stage.drone.manual_control(0, 0, 0.5, 0)
    stage.drone.altitude_hold()
    fly_by_hand(stage, 2, 0.5)
    kept = stage.drone.altitude.metres
    fly_by_hand(stage, 4, 0.8)
    risen = stage.drone.altitude.metres
    demand(risen > kept + 1.0, f"at 0.8 it went from {kept:.1f} to {risen:.1f} m")
    fly_by_hand(stage, 6, 0.2)  # the climb comes to an end first
    sunk = stage.drone.altitude.metres
    demand(sunk < risen - 0.5, f"at 0.2 it went from {risen:.1f} to {sunk:.1f} m")
    return f"{risen - kept:+.1f} m, {sunk - risen:+.1f} m"


@check(needs=(*STICKS, *UP), flies=True)
def pitching_forward(stage: TestStage) -> None:
    """Check that pitch +0.3 flies forward and roll +0.3 to the right."""
    stage.drone.takeoff(10)
    if Capability.HEADING in stage.drone.capabilities:
        stage.drone.set_heading(0)
    start = stage.drone.position
    stage.drone.manual_control(0, 0, 0.5, 0)
    stage.drone.altitude_hold()
    fly_by_hand(stage, 4, 0.5, pitch=0.3)
    north, _, _ = stage.offset(start, stage.drone.position)
    fly_by_hand(stage, 3, 0.5)
    start = stage.drone.position
    fly_by_hand(stage, 4, 0.5, roll=0.3)
    _, east, _ = stage.offset(start, stage.drone.position)
    demand(north > 2.0, f"pitched forward, facing north, it went {north:+.1f} m north")
    demand(east > 2.0, f"rolled to the right, facing north, it went {east:+.1f} m east")


@check(needs=(*STABILIZED, *UP), flies=True)
def stabilize(stage: TestStage) -> str:
    """Check that stabilize mode is entered and flown manually, and that goto() regains control."""
    stage.drone.takeoff(20)
    stage.drone.manual_control(0, 0, 0.5, 0)
    stage.drone.stabilize()
    mode = stage.drone.mode
    # where the throttle is the thrust, half of it lifts a strong vehicle at 1 g
    fly_by_hand(stage, 3, 0.5, until=lambda: abs(stage.drone.telemetry.above_home - 20.0) > STRAYED_M)
    demand(stage.drone.flying, "it fell")
    stage.drone.goto(stage.at(0, 0, 15))
    demand(stage.drone.flying, "it fell")
    return f"{mode}, {stage.drone.mode}"


@check(needs=(*STICKS, *UP, Capability.GOTO), flies=True)
def with_and_without_a_position(stage: TestStage) -> None:
    """Check that control changes in flight from positions to manual and back."""
    stage.drone.takeoff(10)
    for north in (15, 0):
        stage.drone.manual_control(0, 0, 0.5, 0)
        stage.drone.altitude_hold()
        fly_by_hand(stage, 3, 0.5)
        stage.drone.goto(stage.at(north, 0))


@check(needs=(*CLIMBING, Capability.LAND), flies=True)
def altitude_hold_without_satellites(stage: TestStage) -> str:
    """Check that without satellites altitude_hold() arms; the vehicle climbs manually and land() lands it."""
    return _without_satellites(stage, stage.drone.altitude_hold)


@check(needs=(*STABILIZED, Capability.LAND), flies=True)
def stabilize_without_satellites(stage: TestStage) -> str:
    """Check that without satellites stabilize() arms; the vehicle climbs manually and land() lands it."""
    return _without_satellites(stage, stage.drone.stabilize)


def _without_satellites(stage: TestStage, mode: Callable[[], None]) -> str:
    stage.drone.wait_ready()
    stage.flight.block_gps()
    stage.sleep(30)
    ground = stage.flight.truth().position[2]
    stage.drone.manual_control(0, 0, 0.0, 0)
    mode()
    demand(stage.drone.armed, "it returned disarmed")
    used = str(stage.drone.mode)
    fly_by_hand(stage, 20, 0.75, until=lambda: stage.flight.truth().position[2] > ground + 5.0)
    height = stage.flight.truth().position[2] - ground
    demand(height > 4.0, f"in 20 s at a throttle of 0.75 it rose {height:.1f} m")
    fly_by_hand(stage, 1, 0.5)
    stage.drone.land()
    demand(not stage.drone.armed and stage.flight.truth().position[2] < ground + 0.5, "it is not down")
    return used


@check(needs=(*STICKS, *UP, Capability.GOTO), flies=True)
def satellites_lost_in_flight(stage: TestStage) -> str:
    """Check that without satellites in flight goto() ends with a VehicleError or arrives late.

    Manual control and land() still work.
    """
    stage.drone.takeoff(10)
    stage.flight.block_gps()
    stage.sleep(15)
    said = "goto() arrived by dead reckoning"
    try:
        stage.drone.goto(stage.at(15, 0))
    except VehicleError as error:
        demand(stage.name in str(error), f"the error does not name it: {error}")
        said = type(error).__name__
    stage.until_down(120.0)
    return said

"""Checks of operations in flight with a position estimate, and of arrival."""

from __future__ import annotations

from math import hypot

from volery.base.errors import Refused, UsageError, VehicleError
from volery.base.position import Position
from volery.base.time import to_seconds
from volery.testing.checks import check, demand, raising
from volery.testing.stage import TestStage
from volery.vehicles import Capability

UP = (Capability.TAKEOFF,)
GO = (Capability.TAKEOFF, Capability.GOTO)

TAKEOFF_SHORT_M = 1.5
"""Distance below its height at which a take-off may end, m; PX4's ends about 1 m short."""
NEAR_M, NEAR_UP_M = 1.0, 1.0
"""Tolerances at the return of goto(), m, by the autopilot's estimate; sensors drift 0.5 m in height."""
STANDING_M_S = 0.7
HOME_NEAR_M = 3.0


def demand_there(stage: TestStage, goal: Position, across: float = NEAR_M, up: float = NEAR_UP_M) -> None:
    """Demand that the vehicle is at `goal` by its own estimate."""
    north, east, _ = stage.offset(goal, stage.drone.position)
    high = stage.drone.altitude.metres - _above_home(stage, goal)
    off = hypot(north, east)
    demand(off <= across and abs(high) <= up, f"{off:.1f} m beside and {high:+.1f} m above {goal}")


def _above_home(stage: TestStage, goal: Position) -> float:
    metres: float = goal.altitude.metres
    if type(goal.altitude).__name__ == "AMSL":
        metres -= stage.drone.home.altitude.metres
    return metres


def demand_standing(stage: TestStage) -> None:
    """Demand that the vehicle does not move by its own estimate."""
    velocity = stage.drone.velocity
    speed = hypot(*velocity)
    demand(speed <= STANDING_M_S, f"it still moves at {speed:.1f} m/s")


@check(needs=UP, flies=True)
def takeoff(stage: TestStage) -> None:
    """Check that a take-off to 10 m of a disarmed vehicle ends 10 m above home, at most 1.5 m short."""
    stage.drone.takeoff(10)
    height = stage.drone.altitude.metres
    demand(stage.drone.flying and stage.drone.armed, "it does not fly")
    demand(10.0 - TAKEOFF_SHORT_M <= height <= 10.0 + NEAR_UP_M, f"it returned at {height:.1f} m")


@check(needs=UP, flies=True)
def takeoff_in_the_air(stage: TestStage) -> None:
    """Check that a take-off of a flying vehicle is refused and the vehicle flies on."""
    stage.drone.takeoff(10)
    with raising(Refused, naming=stage.name):
        stage.drone.takeoff(15)
    demand(stage.drone.flying, "it does not fly any more")


@check(needs=GO, flies=True)
def goto(stage: TestStage) -> None:
    """Check that a goto returns at the goal by the autopilot's estimate, at rest, and stays there."""
    stage.drone.takeoff(10)
    goal = stage.at(30, 20, 12)
    stage.drone.goto(goal)
    demand_there(stage, goal)
    demand_standing(stage)
    stage.sleep(10)
    demand_there(stage, goal, 2.0, 1.5)


@check(needs=GO, flies=True)
def altitude_frames(stage: TestStage) -> None:
    """Check that the same height above home and AMSL is the same height."""
    stage.drone.takeoff(10)
    stage.drone.goto(stage.at(15, 0, 14))
    first = stage.drone.position.altitude.metres
    stage.drone.goto(stage.at(15, 5, 14, amsl=True))
    second = stage.drone.position.altitude.metres
    demand(abs(first - second) < NEAR_UP_M, f"{first:.1f} m AMSL above home, {second:.1f} m AMSL as such")
    seen = stage.drone.telemetry
    apart = seen.position.altitude.metres - seen.home.altitude.metres - seen.above_home
    demand(abs(apart) < NEAR_UP_M, f"AMSL less home's is {apart:+.1f} m off the height above home")


@check(needs=(*GO, Capability.SPEED), flies=True)
def speed(stage: TestStage) -> str:
    """Check that goto(goal, speed=3) flies at 3 m/s over ground, at most a quarter faster."""
    stage.drone.takeoff(10)
    seen, fastest = stage.drone.telemetry, [0.0]

    def look() -> None:
        fastest[0] = max(fastest[0], hypot(seen.velocity.north, seen.velocity.east))

    handle = stage.kernel.every(100_000_000, look)
    stage.drone.goto(stage.at(40, 0), speed=3.0)
    handle.cancel()
    demand(2.0 <= fastest[0] <= 3.75, f"its greatest speed was {fastest[0]:.1f} m/s")
    return f"greatest {fastest[0]:.1f} m/s"


@check(needs=GO, flies=True)
def goto_again(stage: TestStage) -> None:
    """Check that a goto() to the current position is no error and returns at once."""
    stage.drone.takeoff(10)
    goal = stage.at(20, 0)
    stage.drone.goto(goal)
    began = stage.kernel.now()
    stage.drone.goto(goal)
    demand(to_seconds(stage.kernel.now() - began) < 10.0, "it took longer than 10 s")
    demand_there(stage, goal, 1.5, 1.5)


@check(needs=(*UP, Capability.HOLD, Capability.VELOCITY), flies=True)
def hold(stage: TestStage) -> str:
    """Check that a hold at 4 m/s returns at rest, and stays there."""
    stage.drone.takeoff(10)
    stage.drone.set_velocity(north=4.0, lasting=20.0)
    stage.sleep(4)
    stage.drone.hold()
    demand_standing(stage)
    here = stage.drone.position
    stage.sleep(8)
    north, east, up = stage.offset(here, stage.drone.position)
    demand(hypot(north, east) < 3.0 and abs(up) < 1.5, f"in 8 s it went {north:.1f}, {east:.1f}, {up:.1f} m")
    return f"drifts {hypot(north, east):.1f} m in 8 s"


@check(needs=(*UP, Capability.VELOCITY), flies=True)
def velocity(stage: TestStage) -> str:
    """Check that set_velocity() returns in motion, flies for the given time, then stops."""
    stage.drone.takeoff(10)
    start = stage.drone.position
    stage.drone.set_velocity(north=3.0, lasting=6.0)
    stage.sleep(5)
    seen = stage.drone.velocity
    demand(seen.north > 2.0 and abs(seen.east) < 1.0, f"after 5 s it flies {seen.north:.1f} m/s north")
    stage.sleep(6)
    demand_standing(stage)
    north, east, _ = stage.offset(start, stage.drone.position)
    demand(10.0 < north < 28.0 and abs(east) < 3.0, f"it went {north:.1f} m north, {east:.1f} m east")
    return f"{north:.1f} m in 6 s at 3 m/s"


@check(needs=(*UP, Capability.VELOCITY), flies=True)
def climbing(stage: TestStage) -> None:
    """Check that set_velocity(up=1) climbs: up is positive."""
    stage.drone.takeoff(10)
    before = stage.drone.altitude.metres
    stage.drone.set_velocity(up=1.0, lasting=5.0)
    stage.sleep(7)
    gained = stage.drone.altitude.metres - before
    demand(2.0 < gained < 8.0, f"in 5 s at 1 m/s it rose {gained:.1f} m")


@check(needs=(*UP, Capability.HEADING), flies=True)
def heading(stage: TestStage) -> None:
    """Check that set_heading() turns clockwise from north, by the smaller angle, and stays in place."""
    stage.drone.takeoff(10)
    here = stage.drone.position
    for degrees in (90.0, 200.0, 350.0):
        stage.drone.set_heading(degrees)
        off = (stage.drone.attitude.heading - degrees + 180.0) % 360.0 - 180.0
        demand(abs(off) < 6.0, f"asked for {degrees:g} degrees it is {off:+.1f} off")
    north, east, _ = stage.offset(here, stage.drone.position)
    demand(hypot(north, east) < 3.0, f"it has left its place: {north:.1f}, {east:.1f} m")


@check(needs=(*GO, Capability.RETURN_HOME), flies=True)
def return_home(stage: TestStage) -> str:
    """Check that the vehicle returns home, lands near it and is disarmed."""
    stage.drone.takeoff(10)
    stage.drone.goto(stage.at(25, -10))
    home = stage.drone.home
    stage.drone.return_home()
    return _demand_down(stage, home)


@check(needs=(*GO, Capability.LAND), flies=True)
def land(stage: TestStage) -> str:
    """Check that the vehicle lands at its current position and is disarmed."""
    stage.drone.takeoff(10)
    stage.drone.goto(stage.at(10, 10))
    here = stage.drone.position
    stage.drone.land()
    return _demand_down(stage, here)


def _demand_down(stage: TestStage, place: Position) -> str:
    stage.until(lambda: stage.drone.landed, 3.0, "it is in the air")
    demand(not stage.drone.armed, "it is armed")
    north, east, _ = stage.offset(place, stage.drone.position)
    off = hypot(north, east)
    demand(off < HOME_NEAR_M, f"it came down {off:.1f} m away")
    return f"{off:.1f} m away"


@check(needs=(*GO, Capability.LAND, Capability.RETURN_HOME), flies=True)
def home_change(stage: TestStage) -> str:
    """Check that after a landing elsewhere and a new take-off, heights and return_home() use one home."""
    stage.drone.takeoff(10)
    first = stage.drone.home
    stage.drone.goto(stage.at(30, 0))
    stage.drone.land()
    stage.drone.takeoff(10)
    home = stage.drone.home
    stage.drone.goto(stage.at(0, 20))
    seen = stage.drone.telemetry
    apart = seen.position.altitude.metres - home.altitude.metres - seen.above_home
    demand(abs(apart) < NEAR_UP_M, f"AMSL less home's is {apart:+.1f} m off the height above home")
    stage.drone.return_home()
    _demand_down(stage, stage.drone.home)
    north, east, _ = stage.offset(first, home)
    return f"home moved by {hypot(north, east):.0f} m"


@check(needs=UP, flies=True)
def disarming_in_the_air(stage: TestStage) -> str:
    """Check that disarm() without force of a flying vehicle is refused and the vehicle flies on."""
    stage.drone.takeoff(10)
    with raising(Refused, naming=stage.name) as caught:
        stage.drone.disarm()
    demand(stage.drone.armed and stage.drone.flying, "it does not fly any more")
    return caught.text.removeprefix(f"{stage.name}: ")


@check(needs=UP, flies=True)
def two_flows_of_control(stage: TestStage) -> None:
    """Check that of two tasks that command one vehicle the second gets an error, the first continues."""
    stage.drone.wait_ready()  # first: until it is ready the other one could not even begin
    stage.later(1.0, lambda: stage.drone.takeoff(10))
    stage.until(lambda: stage.drone.armed, 60.0, "the first task never got it armed")
    with raising(UsageError, naming=stage.name):
        stage.drone.wait_ready()
        stage.drone.takeoff(12)
    stage.until(lambda: stage.drone.altitude.metres > 5.0, 60.0, "the first task was disturbed")


@check(needs=(*GO, Capability.LAND), flies=True)
def safety_comes_first(stage: TestStage) -> str:
    """Check that land() of another task aborts goto() with an error, and succeeds itself."""
    stage.drone.takeoff(10)
    stage.later(3.0, stage.drone.land)
    with raising(VehicleError, UsageError, naming=stage.name) as caught:
        stage.drone.goto(stage.at(60, 0))
    stage.until(lambda: not stage.drone.armed, 120.0, "it did not land")
    return caught.text.removeprefix(f"{stage.name}: ")


@check(needs=UP, flies=True)
def the_end_of_a_program(stage: TestStage) -> str:
    """Check that come_to_rest() of a flying vehicle lands it and reports so."""
    stage.drone.takeoff(10)
    words = str(stage.drone.come_to_rest())
    demand(not stage.drone.armed, f"it {words}, but is armed")
    stage.until(lambda: stage.drone.landed, 3.0, f"it {words}, but is in the air")
    return words

"""The phases of a flight in which a fault can strike, each as a small program that flies it.

A program calls ``strike`` when the moment has come, then goes on as if it knew nothing. Where the fault is to
strike during a call, it is called a moment later.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping

from volery.testing.driver_checks.sticks import fly_by_hand
from volery.testing.stage import Stage

Strike = Callable[[], None]
Program = Callable[[Stage, Strike], None]

AT_ONCE_S = 0.01
DURING_S = 3.0
"""After the call began."""


def ground(stage: Stage, strike: Strike) -> None:
    """Armed on the ground; then it disarms."""
    stage.drone.wait_ready()
    stage.drone.hold()
    stage.drone.arm()
    strike()
    stage.sleep(1.0)
    stage.drone.disarm()


def arming(stage: Stage, strike: Strike) -> None:
    """As the take-off begins: while its commands are on their way."""
    stage.drone.wait_ready()
    stage.later(AT_ONCE_S, strike)
    stage.drone.takeoff(15)


def takeoff(stage: Stage, strike: Strike) -> None:
    """During the climb."""
    stage.drone.wait_ready()
    stage.later(2 * DURING_S, strike)
    stage.drone.takeoff(15)


def goto(stage: Stage, strike: Strike) -> None:
    """On the way."""
    stage.drone.takeoff(10)
    stage.later(DURING_S, strike)
    stage.drone.goto(stage.at(40, 10, 12))


def hold(stage: Stage, strike: Strike) -> None:
    """Standing in the air while the program is busy otherwise; then it goes on."""
    stage.drone.takeoff(10)
    stage.drone.hold()
    strike()
    stage.sleep(12.0)
    stage.drone.goto(stage.at(15, 0, 10))


def return_home(stage: Stage, strike: Strike) -> None:
    """As the return begins."""
    stage.drone.takeoff(10)
    stage.drone.goto(stage.at(20, 20, 10))
    stage.later(AT_ONCE_S, strike)
    stage.drone.return_home()


def land(stage: Stage, strike: Strike) -> None:
    """On the way down."""
    stage.drone.takeoff(10)
    stage.later(DURING_S, strike)
    stage.drone.land()


def sticks(stage: Stage, strike: Strike) -> None:
    """Flown by hand; then it goes on by position."""
    stage.drone.takeoff(10)
    stage.drone.manual_control(0.0, 0.0, 0.5, 0.0)
    stage.drone.altitude_hold()
    fly_by_hand(stage, 2.0, 0.5)
    strike()
    fly_by_hand(stage, 12.0, 0.5)
    stage.drone.goto(stage.at(10, 0, 10))


PHASES: Mapping[str, Program] = {
    "ground": ground,
    "arming": arming,
    "take-off": takeoff,
    "goto": goto,
    "hold": hold,
    "return": return_home,
    "land": land,
    "sticks": sticks,
}

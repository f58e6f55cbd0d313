"""The flight plan of the simulated rotorcraft: Paparazzi's stock plan (``rotorcraft_basic``).

Names, order and waypoints are those of ``links.paparazzi_aircraft.stock_aircraft``, which a ground station
also uses. Waypoints count from the local origin, which is set in block Geo init.
"""

from __future__ import annotations

from functools import partial

from volery.base.frames import Vector
from volery.links.paparazzi_aircraft import stock_aircraft
from volery.simulation.autopilots.paparazzi.flight_plan import (
    Block,
    Circle,
    Condition,
    Deroute,
    FlightPlan,
    Go,
    Heading,
    Idle,
    Navigation,
    Once,
    Oval,
    Stay,
    While,
)
from volery.simulation.autopilots.paparazzi.modes import NAV, in_flight, set_motors
from volery.simulation.autopilots.paparazzi.rotorcraft_state import fix_is_valid

HEIGHT_M = 5.0
"""Height of waypoints above the local origin."""
HEIGHTS_M = {"CAM": 2.0}
"""Heights of the waypoints that differ."""
SETTLED_S = 10.0
"""Duration of block Geo init."""
AWAY_FROM_GROUND_M = 2.0
TURNS = range(1, 17)
"""Quarter turns of block test yaw."""


def motors(nav: Navigation, on: bool) -> None:
    """NavResurrect and NavKillThrottle, which act in NAV only."""
    if nav.vehicle.mode.number == NAV:
        set_motors(nav.vehicle, on)


def set_ground_reference(nav: Navigation) -> None:
    """NavSetGroundReferenceHere: set local origin and home position here, unless in flight."""
    if not in_flight(nav.vehicle):
        nav.vehicle.flight.set_origin()
        nav.vehicle.set_home_here()


def on_ground(nav: Navigation) -> bool:
    """Return whether a landing from the air has reached the ground (NavDetectGround)."""
    return nav.vehicle.estimate.landed and nav.vehicle.firmware_state.landing_from_air


def touch_down_here(nav: Navigation) -> None:
    """Move TD to the vehicle; from the ground no touch-down is detected later."""
    nav.vehicle.firmware_state.landing_from_air = in_flight(nav.vehicle)
    nav.set_here("TD")


def stage_lasted(seconds: float) -> Condition:
    """Return a condition that holds once the stage has lasted for that many seconds."""
    return lambda nav: nav.stage_time > seconds


_KILL = Once(partial(motors, on=False))
_RESURRECT = Once(partial(motors, on=True))

WAYPOINTS: dict[str, Vector] = {
    one.name: (one.east, one.north, HEIGHTS_M.get(one.name, HEIGHT_M)) for one in stock_aircraft().waypoints
}

PLAN = FlightPlan(
    WAYPOINTS,
    (
        Block("Wait GPS", (_KILL, While(lambda nav: not fix_is_valid(nav.vehicle)))),
        Block("Geo init", (While(lambda nav: nav.block_time < SETTLED_S), Once(set_ground_reference))),
        Block("Holding point", (_KILL, Idle())),
        Block("Start Engine", (_RESURRECT, Idle())),
        Block(
            "Takeoff",
            (Once(lambda nav: nav.set_here("CLIMB")), Stay("CLIMB", climb="NAV_CLIMB_VSPEED")),
            ((lambda nav: nav.position[2] > AWAY_FROM_GROUND_M, "Standby"),),
        ),
        Block("Standby", (Stay("STDBY"),)),
        Block("stay_p1", (Stay("p1"),)),
        Block("go_p2", (Go("p2"), Deroute("stay_p1"))),
        Block(
            "line_p1_p2",
            (
                Go("p2", start="p1"),
                Stay("p2", until=stage_lasted(10.0)),
                Go("p1", start="p2"),
                Deroute("stay_p1"),
            ),
        ),
        Block(
            "route",
            (Go("p3", start="p1"), Go("p4", start="p3"), Go("p1", start="p4"), Deroute("stay_p1")),
        ),
        Block("Oval", (Oval("p1", "p2"),)),
        Block(
            "test yaw",
            (
                Go("p1"),
                *(Heading(90.0 * turn, "p1", stage_lasted(3.0)) for turn in TURNS),
                Deroute("Standby"),
            ),
        ),
        Block("circle CAM", (Circle("CAM"),)),
        Block("land here", (Once(touch_down_here),)),
        Block("land", (Go("TD"),)),
        Block(
            "flare",
            (Stay("TD", climb="NAV_DESCEND_VSPEED"),),
            ((on_ground, "Holding point"), (lambda nav: not in_flight(nav.vehicle), "landed")),
        ),
        Block("landed", (Idle(),)),
        Block("HOME", (Stay("HOME"),)),
    ),
)

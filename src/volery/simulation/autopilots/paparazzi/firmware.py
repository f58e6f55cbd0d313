"""Paparazzi's rotorcraft firmware: flight plan, modes and boot, composed as a firmware, and the assumptions.

Protocol and rules follow public definitions and sources of the static autopilot, and recordings of version
6.2 in its own simulator NPS (stock example ``ardrone2``). The figures of an airframe file stand in
``parameters.FIGURES``. The flight plan is the stock plan (``rotorcraft_basic``): names, order and waypoints
are those of ``links.paparazzi_aircraft.stock_aircraft``, which a ground station also uses. Waypoints count
from the local origin, which is set in block Geo init.
"""

from __future__ import annotations

from collections.abc import Mapping
from functools import partial

from volery.base.frames import Vector
from volery.base.time import MS, Ns, S
from volery.links.paparazzi_aircraft import stock_aircraft
from volery.simulation.autopilots.autopilot import BootEvent, BootSequence, Firmware, PeriodicWork
from volery.simulation.autopilots.paparazzi import parameters
from volery.simulation.autopilots.paparazzi.endpoint import PaparazziEndpoint
from volery.simulation.autopilots.paparazzi.flight_modes import (
    ClimbByStick,
    Direct,
    FailsafeDescent,
    FlyHome,
    FlyPlan,
    GuidedMode,
    HoldHeight,
    HoverHold,
    Killed,
)
from volery.simulation.autopilots.paparazzi.flight_plan import (
    CircleWaypoint,
    Condition,
    Deroute,
    FlightPlan,
    Go,
    Heading,
    MotorsIdle,
    Navigation,
    Once,
    Oval,
    PlanBlock,
    Stay,
    While,
)
from volery.simulation.autopilots.paparazzi.modes import FAILSAFES, HOME, NAV, in_flight, set_mode, set_motors
from volery.simulation.autopilots.paparazzi.rotorcraft_state import (
    ACQUIRED_AFTER,
    RotorcraftState,
    fix_is_valid,
    state_of,
    update_fix,
)
from volery.simulation.autopilots.vehicle_state import (
    ArmingTimes,
    AutopilotVehicle,
    Mode,
    ParameterTable,
    RcDefaults,
    StartupTimes,
    VehicleRules,
)

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


def await_touch_down(nav: Navigation) -> None:
    """NavStartDetectGround: detect the next touch-down."""
    nav.vehicle.firmware_state.touch_downs = nav.vehicle.flight.truth().contacts


def touched_down(nav: Navigation) -> bool:
    """Return whether it has touched the ground since (NavDetectGround): the accelerometer feels the jolt."""
    before = nav.vehicle.firmware_state.touch_downs
    return before is not None and nav.vehicle.flight.truth().contacts != before


def stage_lasted(seconds: float) -> Condition:
    """Return a condition that holds once the stage has lasted for that many seconds."""
    return lambda nav: nav.stage_time > seconds


_KILL = Once(partial(motors, on=False))
_RESURRECT = Once(partial(motors, on=True))

WAYPOINTS: dict[str, Vector] = {
    waypoint.name: (waypoint.east, waypoint.north, HEIGHTS_M.get(waypoint.name, HEIGHT_M))
    for waypoint in stock_aircraft().waypoints
}

PLAN = FlightPlan(
    WAYPOINTS,
    (
        PlanBlock("Wait GPS", (_KILL, While(lambda nav: not fix_is_valid(nav.vehicle)))),
        PlanBlock("Geo init", (While(lambda nav: nav.block_time < SETTLED_S), Once(set_ground_reference))),
        PlanBlock("Holding point", (_KILL, MotorsIdle())),
        PlanBlock("Start Engine", (_RESURRECT, MotorsIdle())),
        PlanBlock(
            "Takeoff",
            (Once(lambda nav: nav.set_here("CLIMB")), Stay("CLIMB", climb="NAV_CLIMB_VSPEED")),
            ((lambda nav: nav.position[2] > AWAY_FROM_GROUND_M, "Standby"),),
        ),
        PlanBlock("Standby", (Stay("STDBY"),)),
        PlanBlock("stay_p1", (Stay("p1"),)),
        PlanBlock("go_p2", (Go("p2"), Deroute("stay_p1"))),
        PlanBlock(
            "line_p1_p2",
            (
                Go("p2", start="p1"),
                Stay("p2", until=stage_lasted(10.0)),
                Go("p1", start="p2"),
                Deroute("stay_p1"),
            ),
        ),
        PlanBlock(
            "route",
            (Go("p3", start="p1"), Go("p4", start="p3"), Go("p1", start="p4"), Deroute("stay_p1")),
        ),
        PlanBlock("Oval", (Oval("p1", "p2"),)),
        PlanBlock(
            "test yaw",
            (
                Go("p1"),
                *(Heading(90.0 * turn, "p1", stage_lasted(3.0)) for turn in TURNS),
                Deroute("Standby"),
            ),
        ),
        PlanBlock("circle CAM", (CircleWaypoint("CAM"),)),
        PlanBlock("land here", (Once(lambda nav: nav.set_here("TD")),)),
        PlanBlock("land", (Go("TD"),)),
        PlanBlock(
            "flare",
            (Once(await_touch_down), Stay("TD", climb="NAV_DESCEND_VSPEED")),
            ((touched_down, "Holding point"), (lambda nav: not in_flight(nav.vehicle), "landed")),
        ),
        PlanBlock("landed", (MotorsIdle(),)),
        PlanBlock("HOME", (Stay("HOME"),)),
    ),
)


TICK: Ns = S // 16
"""Navigation and all other periodic work run at 16 Hz."""

READY: Ns = 100 * MS
HOLDING_POINT = PLAN.block_number("Holding point")

MODES = {
    mode.number: mode
    for mode in (
        Mode(0, "KILL", 0, Killed),
        Mode(1, "FAILSAFE", 0, FailsafeDescent),
        Mode(2, "HOME", 0, FlyHome, needs_position=True),
        Mode(4, "ATTITUDE_DIRECT", 0, Direct, pilot=True, manual_throttle=True),
        Mode(6, "ATTITUDE_RC_CLIMB", 0, ClimbByStick, pilot=True),
        Mode(9, "ATTITUDE_Z_HOLD", 0, HoldHeight, pilot=True),
        Mode(12, "HOVER_Z_HOLD", 0, HoverHold, pilot=True, needs_position=True),
        Mode(13, "NAV", 0, FlyPlan, needs_position=True),
        Mode(19, "GUIDED", 0, GuidedMode, needs_position=True),
    )
}
"""The modes of this build of the firmware. Heartbeat bits are MAVLink's and stay 0."""


def rotorcraft_state(vehicle: AutopilotVehicle) -> RotorcraftState:
    """Return a flight plan at its start without radio control."""
    return RotorcraftState(Navigation(vehicle, PLAN))


def finish_boot(vehicle: AutopilotVehicle) -> None:
    """Put the vehicle on the ground in its start-up mode."""
    vehicle.ground.landed = True
    set_mode(vehicle, round(vehicle.parameters["MODE_STARTUP"]))


def start_warm(vehicle: AutopilotVehicle) -> None:
    """Start at block Holding point."""
    finish_boot(vehicle)
    state_of(vehicle).navigation.jump(HOLDING_POINT)


def on_step(vehicle: AutopilotVehicle) -> None:
    """Run GPS, flight plan and flight time; without motors on the ground the vehicle counts as landed."""
    update_fix(vehicle)
    navigation = state_of(vehicle).navigation
    if vehicle.mode.number == HOME:
        navigation.fly_home()
    elif vehicle.uptime() >= READY:
        navigation.step()
    if in_flight(vehicle):
        vehicle.ground.flight_time += TICK
        return
    state_of(vehicle).touch_downs = None
    if not vehicle.armed and vehicle.estimate.landed:
        vehicle.ground.landed = True


ROTORCRAFT = Firmware(
    name="paparazzi",
    kind="multirotor",
    rules=VehicleRules(
        modes=MODES,
        boot_mode=MODES[0],
        startup=StartupTimes(READY, ACQUIRED_AFTER, 0, 0),
        arming=ArmingTimes(spool_up=500 * MS, abandoned_after=1500 * MS),
        parameters=ParameterTable(
            parameters.default_parameters,
            parameters.tuning,
            parameters.own_parameters,
            {name: figure.what for name, figure in parameters.FIGURES.items()},
        ),
        rc=RcDefaults((1500, 1500, 1000, 1500)),
        firmware_state=rotorcraft_state,
    ),
    boot=BootSequence((BootEvent(READY, finish_boot),), start_warm, AutopilotVehicle.set_home_here),
    periodic=PeriodicWork(tick=TICK, on_step=on_step, failsafe_ticks=1),
    failsafes=FAILSAFES,
    endpoint=PaparazziEndpoint,
)

ASSUMED: Mapping[str, str] = {
    "aircraft": "the stock rotorcraft: blocks, waypoints and the first six of some 85 settings, in "
    "`links/stock_rotorcraft`",
    "settings": "`video_periodic_status` and `gps_periodic_status` keep their values: nothing follows from "
    "them",
    "switching on": "a fix at once, attitude aligned after 0.3 s",
    "Geo init": "sets origin and home position at the vehicle; in the air it has no effect",
    "transmitter": "none; manual control by RC_UP (roll, pitch, yaw, throttle, mode) or "
    "JOYSTICK_RAW (switch at AUTO2)",
    "sticks": "right, nose up and clockwise are positive; a frame acts at once, the last one holds "
    "while the radio is LOST",
    "modes": "KILL, FAILSAFE, HOME, ATTITUDE_DIRECT, ATTITUDE_RC_CLIMB, ATTITUDE_Z_HOLD, HOVER_Z_HOLD, "
    "NAV and GUIDED are built in; others are refused without a report",
    "FAILSAFE": "left by the setting `mode`, or by a transmitter in MANUAL",
    "in flight": "motors on, and the landed detector of the simulated flight stack does not detect the "
    "ground",
    "NAV": "flies at the airframe's speeds with the heading at entry; on lines and circles it follows a "
    "point 12 m ahead",
    "blocks in other modes": "execute, except for starting and stopping motors; NAV continues from "
    "their present state",
    "GUIDED": "keeps an aircraft on the ground whose set-point is 0.2 m below it, or sinks",
    "GUIDED_SETPOINT_NED": "offsets count from the estimate at arrival; body velocities are rotated "
    "once; a yaw that is not finite changes nothing",
    "GUIDED_FULL_NED, REMOTE_GPS_LOCAL": "not supported",
    "MISSION_...": "not supported: the stock plan flies no uploaded mission",
    "guided in NAV": "does not occur: the stock plan has no guided instruction",
    "MOVE_WP": "is ignored before there is an origin",
    "telemetry modes": "1 to 9 are lists without ROTORCRAFT_FP and ROTORCRAFT_NAV_STATUS, as was "
    "recorded of 3",
    "satellites lost in GUIDED": "no effect: the vehicle flies on with the estimate, which drifts; "
    "`ardrone2` freezes its position, `bebop` goes on by inertia without error",
    "sea level": "is 49.85 m below the ellipsoid's height, as at the place of the recordings",
    "battery": "measured without error",
}
"""Subject and assumption, as in docs/paparazzi.md."""

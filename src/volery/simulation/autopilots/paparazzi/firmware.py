"""Paparazzi's rotorcraft firmware: modes and boot, composed as a firmware, and the list of assumptions.

Protocol and rules follow public definitions and sources of the static autopilot, and recordings of version
6.2 in its own simulator NPS (stock example ``ardrone2``). The figures of an airframe file stand in
``parameters.FIGURES``.
"""

from __future__ import annotations

from collections.abc import Mapping

from volery.base.time import MS, Ns, S
from volery.simulation.autopilots.firmware import BootEvent, BootSequence, Firmware, PeriodicWork
from volery.simulation.autopilots.manoeuvres.manual_flight import AltitudeHold
from volery.simulation.autopilots.paparazzi import parameters
from volery.simulation.autopilots.paparazzi.basic_plan import PLAN
from volery.simulation.autopilots.paparazzi.endpoint import PaparazziEndpoint
from volery.simulation.autopilots.paparazzi.failsafes import FAILSAFES
from volery.simulation.autopilots.paparazzi.flight_modes import (
    Direct,
    FailsafeDescent,
    FlyHome,
    FlyPlan,
    Guided,
    HoldHeight,
    HoldPlace,
    Killed,
)
from volery.simulation.autopilots.paparazzi.flight_plan import Navigation
from volery.simulation.autopilots.paparazzi.modes import HOME, in_flight, set_mode
from volery.simulation.autopilots.paparazzi.rotorcraft_state import (
    ACQUIRED_AFTER,
    RotorcraftState,
    state_of,
    update_fix,
)
from volery.simulation.autopilots.vehicle_state import (
    ArmingTimes,
    Mode,
    ParameterTable,
    RcDefaults,
    StartupTimes,
    Vehicle,
    VehicleRules,
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
        Mode(6, "ATTITUDE_RC_CLIMB", 0, AltitudeHold, pilot=True),
        Mode(9, "ATTITUDE_Z_HOLD", 0, HoldHeight, pilot=True),
        Mode(12, "HOVER_Z_HOLD", 0, HoldPlace, pilot=True, needs_position=True),
        Mode(13, "NAV", 0, FlyPlan, needs_position=True),
        Mode(19, "GUIDED", 0, Guided, needs_position=True),
    )
}
"""The modes of this build of the firmware. Heartbeat bits are MAVLink's and stay 0."""


def rotorcraft_state(vehicle: Vehicle) -> RotorcraftState:
    """Return a flight plan at its start without radio control."""
    return RotorcraftState(Navigation(vehicle, PLAN))


def finish_boot(vehicle: Vehicle) -> None:
    """Put the vehicle on the ground in its start-up mode."""
    vehicle.ground.landed = True
    set_mode(vehicle, round(vehicle.parameters["MODE_STARTUP"]))


def start_warm(vehicle: Vehicle) -> None:
    """Start at block Holding point."""
    finish_boot(vehicle)
    state_of(vehicle).navigation.jump(HOLDING_POINT)


def on_step(vehicle: Vehicle) -> None:
    """Run GPS, flight plan and flight time; without motors on the ground the vehicle counts as landed."""
    update_fix(vehicle)
    navigation = state_of(vehicle).navigation
    if vehicle.mode.number == HOME:
        navigation.fly_home()
    elif vehicle.uptime() >= READY:
        navigation.step()
    if in_flight(vehicle):
        vehicle.ground.flight_time += TICK
    elif not vehicle.armed and vehicle.estimate.landed:
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
    boot=BootSequence((BootEvent(READY, finish_boot),), start_warm, Vehicle.set_home_here),
    periodic=PeriodicWork(tick=TICK, on_step=on_step, failsafe_ticks=1),
    failsafes=FAILSAFES,
    endpoint=PaparazziEndpoint,
)

ASSUMED: Mapping[str, str] = {
    "aircraft": "the stock rotorcraft: blocks, waypoints and the first six of some 85 settings, in "
    "`links/stock_rotorcraft`",
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

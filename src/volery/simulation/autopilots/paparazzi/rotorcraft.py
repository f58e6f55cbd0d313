"""Paparazzi's rotorcraft firmware: its modes and habits, put together as a dialect.

From public definitions of the protocol and the static autopilot; not compared with a flight. What had to be
assumed stands in docs/paparazzi.md.
"""

from __future__ import annotations

from volery.base.time import MS, Ns, S
from volery.simulation.autopilots.firmware import BootEvent, Firmware
from volery.simulation.autopilots.manoeuvres.manual_flight import AltitudeHold
from volery.simulation.autopilots.paparazzi import airframe, gps
from volery.simulation.autopilots.paparazzi.basic_plan import PLAN
from volery.simulation.autopilots.paparazzi.face import PaparazziFace
from volery.simulation.autopilots.paparazzi.failsafes import WATCHES
from volery.simulation.autopilots.paparazzi.guided import Guided
from volery.simulation.autopilots.paparazzi.manoeuvres import (
    Direct,
    FlyHome,
    FlyPlan,
    HoldHeight,
    HoldPlace,
    Killed,
    Sink,
)
from volery.simulation.autopilots.paparazzi.memory import Memory, of
from volery.simulation.autopilots.paparazzi.modes import HOME, in_flight, set_mode
from volery.simulation.autopilots.paparazzi.navigation import Navigation
from volery.simulation.autopilots.vehicle_state import Mode, Vehicle

TICK: Ns = S // 16
"""Navigation runs sixteen times a second; so does everything else here."""

READY: Ns = 2 * S
HOLDING_POINT = PLAN.block_number("Holding point")

MODES = {
    mode.number: mode
    for mode in (
        Mode(0, "KILL", 0, Killed),
        Mode(1, "FAILSAFE", 0, Sink),
        Mode(2, "HOME", 0, FlyHome, needs_position=True),
        Mode(4, "ATTITUDE_DIRECT", 0, Direct, pilot=True, manual_throttle=True),
        Mode(6, "ATTITUDE_RC_CLIMB", 0, AltitudeHold, pilot=True),
        Mode(9, "ATTITUDE_Z_HOLD", 0, HoldHeight, pilot=True),
        Mode(12, "HOVER_Z_HOLD", 0, HoldPlace, pilot=True, needs_position=True),
        Mode(13, "NAV", 0, FlyPlan, needs_position=True),
        Mode(19, "GUIDED", 0, Guided, needs_position=True),
    )
}
"""Those that this firmware was built with. Bits of heartbeats are MAVLink's: none here."""


def memory(vehicle: Vehicle) -> Memory:
    """A flight plan at its beginning, no sticks."""
    return Memory(Navigation(vehicle, PLAN))


def ready(vehicle: Vehicle) -> None:
    """The firmware is up, on the ground, in its start-up mode."""
    vehicle.landed = True
    set_mode(vehicle, round(vehicle.parameters["MODE_STARTUP"]))


def warm(vehicle: Vehicle) -> None:
    """Its flight plan has come to the holding point."""
    ready(vehicle)
    of(vehicle).navigation.jump(HOLDING_POINT)


def on_step(vehicle: Vehicle) -> None:
    """Satellites, flight plan, flight time; without motors on the ground it stands."""
    gps.watch(vehicle)
    navigation = of(vehicle).navigation
    if vehicle.mode.number == HOME:
        navigation.fly_home()
    elif vehicle.uptime() >= READY:
        navigation.step()
    if in_flight(vehicle):
        vehicle.flight_time += TICK
    elif not vehicle.armed and vehicle.estimate.landed:
        vehicle.landed = True


def _nothing(_vehicle: Vehicle) -> None:
    """Nothing is done then."""


ROTORCRAFT = Firmware(
    name="paparazzi",
    kind="multirotor",
    face=PaparazziFace,
    memory=memory,
    boot_mode=MODES[0],
    boot_events=(BootEvent(READY, ready),),
    ready_after=READY,
    origin_after=gps.ACQUIRED_AFTER,
    position_after=0,
    local_position_after=0,
    on_warm=warm,
    on_warm_position=Vehicle.home_is_here,
    tick=TICK,
    watch_every=1,
    each_second=_nothing,
    modes=MODES,
    tuning=airframe.tuning,
    transmitter=(1500, 1500, 1000, 1500),
    stands=True,
    spool_time=500 * MS,
    resigns_after=1500 * MS,
    watches=WATCHES,
    on_step=on_step,
    on_disarmed=_nothing,
    parameters=airframe.parameters,
    own_parameters=airframe.own_parameters,
    supported_parameters={name: figure.what for name, figure in airframe.FIGURES.items()},
)

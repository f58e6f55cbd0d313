"""PX4 1.14.0 on a multirotor: modes, take-off and return, composed as a firmware."""

from __future__ import annotations

import struct
from functools import cache, partial

from volery.base.time import MS, S
from volery.simulation.autopilots.autopilot_parameters import Parameter, load
from volery.simulation.autopilots.manoeuvres.manual_flight import AltitudeHold, Stabilize
from volery.simulation.autopilots.manoeuvres.onboard_mission_flight import FlyMission
from volery.simulation.autopilots.mavlink.endpoint import MavlinkEndpoint
from volery.simulation.autopilots.px4 import commands, event_interface, mission, modes
from volery.simulation.autopilots.px4.failsafes import on_step
from volery.simulation.autopilots.px4.firmware import own_parameters, px4_firmware, px4_mavlink
from volery.simulation.autopilots.px4.flight_modes import (
    Descent,
    Hold,
    Orbit,
    PositionControl,
    Return,
    TakeOff,
)
from volery.simulation.autopilots.px4.modes import INFO, commander_of
from volery.simulation.autopilots.px4.offboard import Offboard
from volery.simulation.autopilots.px4.parameters import COPTER_SUPPORTED, copter_tuning
from volery.simulation.autopilots.vehicle_state import ArmingTimes, Manoeuvre, ParameterTable, Vehicle


def report_return_stage(vehicle: Vehicle, stage: str, amsl: float, above: float) -> None:
    """Report a stage of AUTO.RTL as status text and event.

    Args:
        vehicle: The vehicle.
        stage: ``climb``, ``return``, ``descend`` or ``land``.
        amsl: Altitude of the stage [m AMSL].
        above: The same above the destination [m].
    """
    log = commander_of(vehicle).log
    figures = struct.pack("<iB", int(amsl), max(0, min(255, int(above))))
    heights = f"{int(amsl)} m ({int(above)} m above destination)\t"
    if stage == "climb":
        vehicle.send_text(INFO, "RTL HOME activated\t")
        log.send(event_interface.RETURN_ACTIVATED)
        if not vehicle.armed:
            return
        vehicle.send_text(INFO, "RTL: landing at home position.\t")
        vehicle.send_text(INFO, f"RTL: climb to {heights}")
        log.send(event_interface.RETURN_HOME)
        log.send(event_interface.RETURN_CLIMB, figures)
    elif stage == "return":
        vehicle.send_text(INFO, f"RTL: return at {heights}")
        log.send(event_interface.RETURN_FLY, figures)
    elif stage == "descend":
        vehicle.send_text(INFO, f"RTL: descend to {heights}")
        log.send(event_interface.RETURN_DESCEND, figures)
    else:
        vehicle.send_text(INFO, "RTL: land at destination\t")
        log.send(event_interface.RETURN_LAND)


QUADROTOR = 2
"""MAV_TYPE."""


def _take_off(vehicle: Vehicle) -> Manoeuvre:
    """Create the take-off to the commanded altitude, at least MIS_TAKEOFF_ALT above the vehicle."""
    commander = commander_of(vehicle)
    here = vehicle.estimate.geodetic[2]
    least = vehicle.parameters["MIS_TAKEOFF_ALT"]
    amsl = commander.takeoff_amsl
    if amsl is None or amsl < here + least:
        amsl = here + least
        commander.minimum_height = least
        if vehicle.armed:
            commander.report_minimum_height()
    return TakeOff(vehicle, vehicle.estimate.origin[2] - amsl)


def _orbit(vehicle: Vehicle) -> Manoeuvre:
    centre, radius, speed = commander_of(vehicle).orbit or (vehicle.estimate.position, 5.0, 1.0)
    return Orbit(vehicle, centre, radius, speed)


MODES = modes.mode_table(
    {
        modes.MANUAL: Stabilize,
        modes.ALTCTL: AltitudeHold,
        modes.POSCTL: PositionControl,
        modes.ORBIT: _orbit,
        modes.ACRO: Stabilize,
        modes.OFFBOARD: Offboard,
        modes.STABILIZE: Stabilize,
        modes.TAKEOFF: _take_off,
        modes.LOITER: Hold,
        modes.MISSION: lambda vehicle: FlyMission(
            vehicle, mission.leg, mission.MISSION_RULES, lambda _vehicle: True
        ),
        modes.RTL: lambda vehicle: Return(vehicle, report_return_stage),
        modes.LAND: Descent,
        modes.FOLLOW: Hold,
    },
    flies=True,
)


def _on_step(vehicle: Vehicle) -> None:
    on_step(vehicle)
    manoeuvre = vehicle.manoeuvre
    if vehicle.armed and not vehicle.landed and isinstance(manoeuvre, TakeOff) and manoeuvre.arrived():
        _stay_here(vehicle)


def _stay_here(vehicle: Vehicle) -> None:
    """End the take-off: hold the position at which the end was detected."""
    here = vehicle.estimate.position
    commander_of(vehicle).continue_with(modes.LOITER)
    if isinstance(vehicle.manoeuvre, Hold):
        vehicle.manoeuvre.point = here


@cache
def parameters() -> tuple[Parameter, ...]:
    """Return the recorded parameters."""
    return load("volery.simulation.autopilots.px4", "data/copter.parameters")


COPTER = px4_firmware(
    kind="multirotor",
    modes=MODES,
    arming=ArmingTimes(spool_up=1 * S, takeoff_slew=200 * MS, abandoned_after=1500 * MS),
    parameters=ParameterTable(parameters, copter_tuning, own_parameters, COPTER_SUPPORTED),
    on_step=_on_step,
    endpoint=partial(MavlinkEndpoint, px4_mavlink(QUADROTOR, commands.COPTER_COMMANDS)),
)

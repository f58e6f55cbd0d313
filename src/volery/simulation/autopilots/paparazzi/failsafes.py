"""Automatic reactions of the rotorcraft to losses, in the order of Paparazzi's static autopilot.

Each failsafe names the modes in which it acts. It therefore ends as soon as it has acted, and begins again if
the mode is entered while the cause persists.
"""

from __future__ import annotations

from volery.base.time import MS, Ns, from_seconds
from volery.simulation.autopilots.firmware import Failsafe
from volery.simulation.autopilots.paparazzi import rotorcraft_state
from volery.simulation.autopilots.paparazzi.modes import (
    FAILSAFE,
    HOME,
    KILL,
    NAV,
    UNSUPERVISED,
    battery_critical,
    in_flight,
    set_mode,
)
from volery.simulation.autopilots.paparazzi.rotorcraft_state import RADIO_REALLY_LOST, state_of
from volery.simulation.autopilots.vehicle_state import Vehicle

KILL_AFTER: Ns = 800 * MS
"""Time after which FAILSAFE on the ground becomes KILL: observed 0.8 s, recorded 1.3 s in the telemetry."""


def _navigates(vehicle: Vehicle) -> bool:
    return vehicle.mode.number == NAV and in_flight(vehicle)


def too_far(vehicle: Vehicle) -> bool:
    """Return whether the vehicle in NAV is further from HOME than MAX_DIST_FROM_HOME."""
    if not _navigates(vehicle):
        return False
    return state_of(vehicle).navigation.from_home() > vehicle.parameters["MAX_DIST_FROM_HOME"]


def too_high(vehicle: Vehicle) -> bool:
    """Return whether the vehicle in NAV is above GEOFENCE_MAX_ALTITUDE, if that is set."""
    limit = vehicle.parameters["GEOFENCE_MAX_ALTITUDE"]
    return limit > 0.0 and _navigates(vehicle) and state_of(vehicle).navigation.position[2] > limit


def datalink_lost(vehicle: Vehicle) -> bool:
    """Return whether the ground is silent in NAV for GEOFENCE_DATALINK_LOST_TIME, if that is set."""
    seconds = vehicle.parameters["GEOFENCE_DATALINK_LOST_TIME"]
    if seconds <= 0.0 or not _navigates(vehicle):
        return False
    return vehicle.kernel.now() - state_of(vehicle).last_uplink_ns > from_seconds(seconds)


def go_home(vehicle: Vehicle) -> None:
    """Enter HOME; FAILSAFE beyond FAILSAFE_MODE_DISTANCE."""
    far = state_of(vehicle).navigation.from_home() > vehicle.parameters["FAILSAFE_MODE_DISTANCE"]
    set_mode(vehicle, FAILSAFE if far else HOME)


def radio_lost(vehicle: Vehicle) -> bool:
    """Return whether radio control is lost in a mode that needs it."""
    if vehicle.mode.number in UNSUPERVISED:
        return False
    return state_of(vehicle).radio.status(vehicle) == RADIO_REALLY_LOST


def satellites_lost(vehicle: Vehicle) -> bool:
    """Return whether the GPS fix is lost in NAV or HOME with running motors."""
    return vehicle.armed and vehicle.mode.number in (NAV, HOME) and rotorcraft_state.gps_lost(vehicle)


def battery_failed(vehicle: Vehicle) -> bool:
    """Return whether the battery is critical, if the airframe makes that a failsafe."""
    return vehicle.mode.number not in (KILL, FAILSAFE) and battery_critical(vehicle)


def enter_failsafe(vehicle: Vehicle) -> None:
    """Enter FAILSAFE, and tell it at once: the only change of mode that is not left to the next status."""
    set_mode(vehicle, FAILSAFE)
    vehicle.output.send_message("ROTORCRAFT_STATUS")


def landed_in_failsafe(vehicle: Vehicle) -> bool:
    """Return whether the vehicle is in FAILSAFE and not in flight, for as long as recorded."""
    lasted = vehicle.kernel.now() - state_of(vehicle).mode_since_ns
    return vehicle.mode.number == FAILSAFE and not in_flight(vehicle) and lasted >= KILL_AFTER


def stop_motors(vehicle: Vehicle) -> None:
    """Enter KILL."""
    set_mode(vehicle, KILL)


FAILSAFES = (
    Failsafe("too far from home", too_far, go_home),
    Failsafe("too high", too_high, go_home),
    Failsafe("datalink", datalink_lost, go_home),
    Failsafe("radio", radio_lost, enter_failsafe),
    Failsafe("battery", battery_failed, enter_failsafe),
    Failsafe("satellites", satellites_lost, enter_failsafe),
    Failsafe("on the ground", landed_in_failsafe, stop_motors),
)

"""What the rotorcraft does by itself when something is lost: facts of the static autopilot, in its order.

Each watch names a mode in which it acts, so it ends as soon as it has acted, and begins again if somebody
goes back while the reason is still there.
"""

from __future__ import annotations

from volery.base.time import from_seconds
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


def _navigates(vehicle: Vehicle) -> bool:
    return vehicle.mode.number == NAV and in_flight(vehicle)


def too_far(vehicle: Vehicle) -> bool:
    """In NAV, further from HOME than the plan allows."""
    if not _navigates(vehicle):
        return False
    return state_of(vehicle).navigation.from_home() > vehicle.parameters["MAX_DIST_FROM_HOME"]


def too_high(vehicle: Vehicle) -> bool:
    """In NAV, above GEOFENCE_MAX_ALTITUDE, if there is one."""
    limit = vehicle.parameters["GEOFENCE_MAX_ALTITUDE"]
    return limit > 0.0 and _navigates(vehicle) and state_of(vehicle).navigation.position[2] > limit


def datalink_lost(vehicle: Vehicle) -> bool:
    """In NAV, the ground silent for GEOFENCE_DATALINK_LOST_TIME, if there is one."""
    seconds = vehicle.parameters["GEOFENCE_DATALINK_LOST_TIME"]
    if seconds <= 0.0 or not _navigates(vehicle):
        return False
    return vehicle.kernel.now() - state_of(vehicle).uplink_at > from_seconds(seconds)


def go_home(vehicle: Vehicle) -> None:
    """HOME; too far even for that, FAILSAFE."""
    far = state_of(vehicle).navigation.from_home() > vehicle.parameters["FAILSAFE_MODE_DISTANCE"]
    set_mode(vehicle, FAILSAFE if far else HOME)


def radio_lost(vehicle: Vehicle) -> bool:
    """In a mode that sticks fly, no sticks any more."""
    if vehicle.mode.number in UNSUPERVISED:
        return False
    return state_of(vehicle).radio.status(vehicle) == RADIO_REALLY_LOST


def satellites_lost(vehicle: Vehicle) -> bool:
    """In NAV or HOME, motors on, no fix any more."""
    return vehicle.armed and vehicle.mode.number in (NAV, HOME) and rotorcraft_state.gps_lost(vehicle)


def battery_gone(vehicle: Vehicle) -> bool:
    """The battery is critical, where the airframe makes that a failsafe."""
    return vehicle.mode.number not in (KILL, FAILSAFE) and battery_critical(vehicle)


def come_down(vehicle: Vehicle) -> None:
    """FAILSAFE."""
    set_mode(vehicle, FAILSAFE)


def came_down(vehicle: Vehicle) -> bool:
    """In FAILSAFE, and not in flight."""
    return vehicle.mode.number == FAILSAFE and not in_flight(vehicle)


def stop_motors(vehicle: Vehicle) -> None:
    """KILL."""
    set_mode(vehicle, KILL)


WATCHES = (
    Failsafe("too far from home", too_far, go_home),
    Failsafe("too high", too_high, go_home),
    Failsafe("datalink", datalink_lost, go_home),
    Failsafe("radio", radio_lost, come_down),
    Failsafe("battery", battery_gone, come_down),
    Failsafe("satellites", satellites_lost, come_down),
    Failsafe("on the ground", came_down, stop_motors),
)

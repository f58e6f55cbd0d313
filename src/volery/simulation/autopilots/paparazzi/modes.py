"""Modes of the rotorcraft by number: the sources that may set them, the motors, and the failsafes.

Rules of the static rotorcraft autopilot: KILL, FAILSAFE and HOME may always be set by datalink; NAV, GUIDED,
MODULE and FLIP only without radio control; three settings define the positions of a transmitter's mode
switch. A refusal is not reported: the mode in the telemetry stays the same.

A failsafe names the modes in which it acts. It therefore ends as soon as it has acted, and begins again if
the mode is entered while the cause persists.
"""

from __future__ import annotations

from volery.base.time import MS, Ns, S, from_seconds
from volery.simulation.autopilots.autopilot import WatchedCondition
from volery.simulation.autopilots.paparazzi import rotorcraft_state
from volery.simulation.autopilots.paparazzi.rotorcraft_state import RADIO_OK, RADIO_REALLY_LOST, state_of
from volery.simulation.autopilots.vehicle_state import AutopilotVehicle

KILL, FAILSAFE, HOME = 0, 1, 2
ATTITUDE_DIRECT, ATTITUDE_RC_CLIMB, ATTITUDE_Z_HOLD, HOVER_Z_HOLD = 4, 6, 9, 12
NAV, MODULE, FLIP, GUIDED = 13, 17, 18, 19

ALWAYS = (KILL, FAILSAFE, HOME)
WITHOUT_RADIO = (NAV, MODULE, FLIP, GUIDED)
UNSUPERVISED = (KILL, HOME, FAILSAFE, *WITHOUT_RADIO)
"""Modes in which lost radio control has no effect."""

BATTERY_PATIENCE: Ns = 5 * S
"""Time for which the battery is critical before it counts, as recorded."""

NO_RC, ARMED = 0, 3
"""Values of ROTORCRAFT_STATUS.arming_status that occur here."""


ALIGNED_AFTER: Ns = 300 * MS
"""Uptime at which the attitude is aligned."""


def aligned(vehicle: AutopilotVehicle) -> bool:
    """Return whether the attitude is aligned."""
    return vehicle.uptime() >= ALIGNED_AFTER and vehicle.estimate.attitude_ok


def in_flight(vehicle: AutopilotVehicle) -> bool:
    """Return whether the motors run and the vehicle is off the ground, as the firmware counts it."""
    return vehicle.armed and not vehicle.landed


def set_mode(vehicle: AutopilotVehicle, number: int) -> bool:
    """Enter a mode, and return False if this build of the firmware lacks it.

    Before the attitude is aligned, only the start-up mode is entered. KILL stops the motors, also in flight.
    """
    if not aligned(vehicle):
        number = round(vehicle.parameters["MODE_STARTUP"])
    mode = vehicle.rules.modes.get(number)
    if mode is None:
        return False
    if mode is not vehicle.mode:
        if number == KILL:
            vehicle.disarm()
        state_of(vehicle).mode_since_ns = vehicle.kernel.now()
        vehicle.enter_mode(mode)
    return True


def set_mode_by_datalink(vehicle: AutopilotVehicle, number: int) -> None:
    """Apply the setting ``mode``, if the datalink may set that mode."""
    if number in ALWAYS or (number in WITHOUT_RADIO and state_of(vehicle).radio.status(vehicle) != RADIO_OK):
        set_mode(vehicle, number)


def set_motors(vehicle: AutopilotVehicle, on: bool) -> None:
    """Start or stop the motors.

    They do not start in KILL, before the attitude is aligned, or with a critical battery that is a failsafe.
    """
    if not on:
        if vehicle.armed:
            vehicle.disarm()
        return
    refused = vehicle.mode.number == KILL or not aligned(vehicle) or battery_critical(vehicle)
    if not refused and not vehicle.armed:
        vehicle.arm()


def battery_critical(vehicle: AutopilotVehicle) -> bool:
    """Return whether the battery has been below CRITIC_BAT_LEVEL for 5 s, if the airframe minds that."""
    if vehicle.parameters["FAILSAFE_ON_BAT_CRITICAL"] <= 0.0:
        return False
    state, now = state_of(vehicle), vehicle.kernel.now()
    if vehicle.estimate.battery_volts >= vehicle.parameters["CRITIC_BAT_LEVEL"]:
        state.battery_good_ns = now
    return now - state.battery_good_ns >= BATTERY_PATIENCE


def arming_status(vehicle: AutopilotVehicle) -> int:
    """Return ROTORCRAFT_STATUS.arming_status: as recorded it says only whether there is radio control."""
    return ARMED if state_of(vehicle).radio.status(vehicle) == RADIO_OK else NO_RC


KILL_AFTER: Ns = 800 * MS
"""Time after which FAILSAFE on the ground becomes KILL: observed 0.8 s, recorded 1.3 s in the telemetry."""


def _navigates(vehicle: AutopilotVehicle) -> bool:
    return vehicle.mode.number == NAV and in_flight(vehicle)


def too_far(vehicle: AutopilotVehicle) -> bool:
    """Return whether the vehicle in NAV is further from HOME than MAX_DIST_FROM_HOME."""
    if not _navigates(vehicle):
        return False
    return state_of(vehicle).navigation.from_home() > vehicle.parameters["MAX_DIST_FROM_HOME"]


def too_high(vehicle: AutopilotVehicle) -> bool:
    """Return whether the vehicle in NAV is above GEOFENCE_MAX_ALTITUDE, if that is set."""
    limit = vehicle.parameters["GEOFENCE_MAX_ALTITUDE"]
    return limit > 0.0 and _navigates(vehicle) and state_of(vehicle).navigation.position[2] > limit


def datalink_lost(vehicle: AutopilotVehicle) -> bool:
    """Return whether the ground is silent in NAV for GEOFENCE_DATALINK_LOST_TIME, if that is set."""
    seconds = vehicle.parameters["GEOFENCE_DATALINK_LOST_TIME"]
    if seconds <= 0.0 or not _navigates(vehicle):
        return False
    return vehicle.kernel.now() - state_of(vehicle).last_uplink_ns > from_seconds(seconds)


def go_home(vehicle: AutopilotVehicle) -> None:
    """Enter HOME; FAILSAFE beyond FAILSAFE_MODE_DISTANCE."""
    far = state_of(vehicle).navigation.from_home() > vehicle.parameters["FAILSAFE_MODE_DISTANCE"]
    set_mode(vehicle, FAILSAFE if far else HOME)


def radio_lost(vehicle: AutopilotVehicle) -> bool:
    """Return whether radio control is lost in a mode that needs it."""
    if vehicle.mode.number in UNSUPERVISED:
        return False
    return state_of(vehicle).radio.status(vehicle) == RADIO_REALLY_LOST


def satellites_lost(vehicle: AutopilotVehicle) -> bool:
    """Return whether the GPS fix is lost in NAV or HOME with running motors."""
    return vehicle.armed and vehicle.mode.number in (NAV, HOME) and rotorcraft_state.gps_lost(vehicle)


def battery_failed(vehicle: AutopilotVehicle) -> bool:
    """Return whether the battery is critical, if the airframe makes that a failsafe."""
    return vehicle.mode.number not in (KILL, FAILSAFE) and battery_critical(vehicle)


def enter_failsafe(vehicle: AutopilotVehicle) -> None:
    """Enter FAILSAFE, and tell it at once: the only change of mode that is not left to the next status."""
    set_mode(vehicle, FAILSAFE)
    vehicle.output.send_message("ROTORCRAFT_STATUS")


def landed_in_failsafe(vehicle: AutopilotVehicle) -> bool:
    """Return whether the vehicle is in FAILSAFE and not in flight, for as long as recorded."""
    lasted = vehicle.kernel.now() - state_of(vehicle).mode_since_ns
    return vehicle.mode.number == FAILSAFE and not in_flight(vehicle) and lasted >= KILL_AFTER


def stop_motors(vehicle: AutopilotVehicle) -> None:
    """Enter KILL."""
    set_mode(vehicle, KILL)


FAILSAFES = (
    WatchedCondition("too far from home", too_far, go_home),
    WatchedCondition("too high", too_high, go_home),
    WatchedCondition("datalink", datalink_lost, go_home),
    WatchedCondition("radio", radio_lost, enter_failsafe),
    WatchedCondition("battery", battery_failed, enter_failsafe),
    WatchedCondition("satellites", satellites_lost, enter_failsafe),
    WatchedCondition("on the ground", landed_in_failsafe, stop_motors),
)

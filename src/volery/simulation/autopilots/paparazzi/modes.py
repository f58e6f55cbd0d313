"""Modes by number, the sources that may set them, and starting and stopping the motors.

Rules of the static rotorcraft autopilot: KILL, FAILSAFE and HOME may always be set by datalink; NAV, GUIDED,
MODULE and FLIP only without radio control; three settings define the positions of a transmitter's mode
switch. A refusal is not reported: the mode in the telemetry stays the same.
"""

from __future__ import annotations

from volery.base.time import Ns, S
from volery.simulation.autopilots.paparazzi.rotorcraft_state import RADIO_OK, state_of
from volery.simulation.autopilots.vehicle_state import Vehicle

KILL, FAILSAFE, HOME = 0, 1, 2
ATTITUDE_DIRECT, ATTITUDE_RC_CLIMB, ATTITUDE_Z_HOLD, HOVER_Z_HOLD = 4, 6, 9, 12
NAV, MODULE, FLIP, GUIDED = 13, 17, 18, 19

ALWAYS = (KILL, FAILSAFE, HOME)
WITHOUT_RADIO = (NAV, MODULE, FLIP, GUIDED)
UNSUPERVISED = (KILL, HOME, FAILSAFE, *WITHOUT_RADIO)
"""Modes in which lost radio control has no effect."""

NO_RC, WAITING, ARMED, KILLED, UNARMED_IN_AUTO, NOT_ALIGNED, LOW_BATTERY = 0, 1, 3, 5, 9, 15, 17
"""Values of ROTORCRAFT_STATUS.arming_status that occur here."""


ALIGNED_AFTER: Ns = 4 * S
"""Uptime at which the attitude is aligned."""


def aligned(vehicle: Vehicle) -> bool:
    """Return whether the attitude is aligned."""
    return vehicle.uptime() >= ALIGNED_AFTER and vehicle.estimate.attitude_ok


def in_flight(vehicle: Vehicle) -> bool:
    """Return whether the motors run and the vehicle is off the ground, as the firmware counts it."""
    return vehicle.armed and not vehicle.landed


def set_mode(vehicle: Vehicle, number: int) -> bool:
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
        vehicle.enter_mode(mode)
    return True


def set_mode_by_datalink(vehicle: Vehicle, number: int) -> None:
    """Apply the setting ``mode``, if the datalink may set that mode."""
    if number in ALWAYS or (number in WITHOUT_RADIO and state_of(vehicle).radio.status(vehicle) != RADIO_OK):
        set_mode(vehicle, number)


def set_motors(vehicle: Vehicle, on: bool) -> None:
    """Start or stop the motors.

    They do not start in KILL, before the attitude is aligned, or with a critical battery that is a failsafe.
    The arming status shows the reason.
    """
    state = state_of(vehicle)
    if not on:
        state.refused = None
        if vehicle.armed:
            vehicle.disarm()
        return
    state.refused = _refusal(vehicle)
    if state.refused is None and not vehicle.armed:
        vehicle.arm()


def _refusal(vehicle: Vehicle) -> int | None:
    if vehicle.mode.number == KILL:
        return KILLED
    if not aligned(vehicle):
        return NOT_ALIGNED
    return LOW_BATTERY if battery_critical(vehicle) else None


def battery_critical(vehicle: Vehicle) -> bool:
    """Return whether the battery is below CRITIC_BAT_LEVEL, if the airframe makes that a failsafe."""
    wanted = vehicle.parameters["FAILSAFE_ON_BAT_CRITICAL"] > 0.0
    return wanted and vehicle.estimate.battery_volts < vehicle.parameters["CRITIC_BAT_LEVEL"]


def arming_status(vehicle: Vehicle) -> int:
    """Return ROTORCRAFT_STATUS.arming_status."""
    state = state_of(vehicle)
    if vehicle.armed:
        return ARMED
    if state.refused is not None:
        return state.refused
    if state.radio.status(vehicle) != RADIO_OK:
        return NO_RC
    return UNARMED_IN_AUTO if not vehicle.mode.pilot else WAITING

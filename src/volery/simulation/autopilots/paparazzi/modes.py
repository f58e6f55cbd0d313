"""Modes by number, who may set them, and motors on and off.

Facts of the static rotorcraft autopilot: KILL, FAILSAFE and HOME may always be set by datalink; NAV, GUIDED
and the two others without sticks only while there is no radio control; what a transmitter's switch means is
three settings. A refusal is silence: the mode in the telemetry stays what it was.
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
"""Modes in which nothing happens when the radio control is lost."""

NO_RC, WAITING, ARMED, KILLED, UNARMED_IN_AUTO, NOT_ALIGNED, LOW_BATTERY = 0, 1, 3, 5, 9, 15, 17
"""ROTORCRAFT_STATUS.arming_status, those that occur here."""


ALIGNED_AFTER: Ns = 4 * S
"""Uptime until which the attitude is being aligned."""


def aligned(vehicle: Vehicle) -> bool:
    """The attitude is known."""
    return vehicle.uptime() >= ALIGNED_AFTER and vehicle.estimate.attitude_ok


def in_flight(vehicle: Vehicle) -> bool:
    """As the firmware counts it: motors on, and off the ground."""
    return vehicle.armed and not vehicle.landed


def set_mode(vehicle: Vehicle, number: int) -> bool:
    """Fly that mode, whoever wants it; False if this firmware was built without it.

    Before the attitude is aligned only the start-up mode is flown. KILL stops the motors, wherever it is.
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
    """The setting ``mode``."""
    if number in ALWAYS or (number in WITHOUT_RADIO and state_of(vehicle).radio.status(vehicle) != RADIO_OK):
        set_mode(vehicle, number)


def set_motors(vehicle: Vehicle, on: bool) -> None:
    """Motors on or off. They stay off in KILL, before the attitude is aligned, and with a critical battery
    where that is a failsafe; why is the arming status.
    """
    kept = state_of(vehicle)
    if not on:
        kept.refused = None
        if vehicle.armed:
            vehicle.disarm()
        return
    kept.refused = _refusal(vehicle)
    if kept.refused is None and not vehicle.armed:
        vehicle.arm()


def _refusal(vehicle: Vehicle) -> int | None:
    if vehicle.mode.number == KILL:
        return KILLED
    if not aligned(vehicle):
        return NOT_ALIGNED
    return LOW_BATTERY if battery_critical(vehicle) else None


def battery_critical(vehicle: Vehicle) -> bool:
    """Below CRITIC_BAT_LEVEL, where the airframe makes that a failsafe."""
    wanted = vehicle.parameters["FAILSAFE_ON_BAT_CRITICAL"] > 0.0
    return wanted and vehicle.estimate.battery_volts < vehicle.parameters["CRITIC_BAT_LEVEL"]


def arming_status(vehicle: Vehicle) -> int:
    """ROTORCRAFT_STATUS.arming_status."""
    kept = state_of(vehicle)
    if vehicle.armed:
        return ARMED
    if kept.refused is not None:
        return kept.refused
    if kept.radio.status(vehicle) != RADIO_OK:
        return NO_RC
    return UNARMED_IN_AUTO if not vehicle.mode.pilot else WAITING

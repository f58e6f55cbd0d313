"""Outputs beside the motors of ArduPilot: servos, relays and the gripper.

Commands, mission items and switches of the transmitter act through the same functions. Nothing is attached to
an output: its state shows in telemetry and in SIM_PIN_MASK.
"""

from __future__ import annotations

from volery.base.time import S
from volery.simulation.autopilots.ardupilot.modes import INFO
from volery.simulation.autopilots.mavlink.messages import ACCEPTED, FAILED, Command, Fields, boot_ms
from volery.simulation.autopilots.onboard_mission import MissionItem
from volery.simulation.autopilots.vehicle_state import Vehicle

SET_RELAY, SET_SERVO, GRIPPER = 181, 183, 211
"""Commands that are mission items, too."""

RELAYS = 6
RELAY_FUNCTION = 1
"""RELAYn_FUNCTION of a relay that commands switch."""

LONGEST_PULSE = 65_535

LET_GO, GRAB = 0, 1
"""Values of param2 of DO_GRIPPER."""
GRIPS_WITHIN = 2 * S
"""Time of a servo gripper from the command to the report of its end."""


def set_servo(vehicle: Vehicle, channel: int, pulse: int) -> bool:
    """Give a channel that drives nothing else a pulse width [us], and return whether there is one."""
    function = f"SERVO{channel}_FUNCTION"
    if function not in vehicle.parameters or not 0 <= pulse <= LONGEST_PULSE:
        return False
    if vehicle.parameters[function]:
        vehicle.send_text(INFO, f"ServoRelayEvent: Channel {channel} is already in use")
        return False
    vehicle.outputs.servos[channel] = pulse
    return True


def has_relay(vehicle: Vehicle, number: int) -> bool:
    """Return whether a pin is assigned to relay *number*, counted from 0."""
    function = f"RELAY{number + 1}_FUNCTION"
    return function in vehicle.parameters and vehicle.parameters[function] == RELAY_FUNCTION


def set_relay(vehicle: Vehicle, number: int, state: int) -> bool:
    """Switch a relay and the bit of its pin in SIM_PIN_MASK, and return whether there is one.

    Args:
        vehicle: The vehicle.
        number: Number of the relay, from 0.
        state: 1 on, 0 off, any other value the opposite of its present state.
    """
    if not has_relay(vehicle, number):
        return False
    relays = vehicle.outputs.relays
    on = bool(state) if state in (0, 1) else number not in relays
    (relays.add if on else relays.discard)(number)
    pin = f"RELAY{number + 1}_PIN"
    if pin in vehicle.parameters and vehicle.parameters[pin] >= 0.0:
        bit = 1 << round(vehicle.parameters[pin])
        mask = round(vehicle.parameters["SIM_PIN_MASK"])
        vehicle.parameters.set("SIM_PIN_MASK", float(mask | bit if on else mask & ~bit))
    return True


def relay_status(vehicle: Vehicle) -> Fields:
    """Return RELAY_STATUS."""
    return {
        "time_boot_ms": boot_ms(vehicle),
        "on": sum(1 << number for number in vehicle.outputs.relays),
        "present": sum(1 << number for number in range(RELAYS) if has_relay(vehicle, number)),
    }


def move_gripper(vehicle: Vehicle, action: int) -> bool:
    """Grab or release, and return whether there is a gripper and such an action; it needs GRIP_ENABLE."""
    said = {LET_GO: "Gripper load releas", GRAB: "Gripper load grabb"}.get(action)
    if said is None or not vehicle.parameters["GRIP_ENABLE"]:
        return False
    vehicle.send_text(INFO, f"{said}ing")
    vehicle.kernel.call_at(vehicle.kernel.now() + GRIPS_WITHIN, lambda: vehicle.send_text(INFO, f"{said}ed"))
    return True


def on_set_servo(vehicle: Vehicle, command: Command) -> int:
    """Handle DO_SET_SERVO and DO_REPEAT_SERVO."""
    return ACCEPTED if set_servo(vehicle, round(command.param1), round(command.param2)) else FAILED


def on_set_relay(vehicle: Vehicle, command: Command) -> int:
    """Handle DO_SET_RELAY."""
    return ACCEPTED if set_relay(vehicle, round(command.param1), round(command.param2)) else FAILED


def on_repeat_relay(vehicle: Vehicle, command: Command) -> int:
    """Handle DO_REPEAT_RELAY: an even number of changes leaves the relay as it was."""
    number, times = round(command.param1), round(command.param2)
    if not has_relay(vehicle, number):
        return FAILED
    return ACCEPTED if times % 2 == 0 or set_relay(vehicle, number, state=2) else FAILED


def on_gripper(vehicle: Vehicle, command: Command) -> int:
    """Handle DO_GRIPPER."""
    return ACCEPTED if move_gripper(vehicle, round(command.param2)) else FAILED


def act_on_payload(vehicle: Vehicle, item: MissionItem) -> None:
    """Execute a mission item that switches an output. A gripper item is reported without a gripper, too."""
    if item.command == SET_SERVO:
        set_servo(vehicle, round(item.param1), round(item.param2))
    elif item.command == SET_RELAY:
        set_relay(vehicle, round(item.param1), round(item.param2))
    elif item.command == GRIPPER:
        move_gripper(vehicle, round(item.param2))
        vehicle.send_text(INFO, "Gripper Grabbed" if round(item.param2) == GRAB else "Gripper Released")

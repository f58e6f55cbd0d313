"""Outputs beside the motors of ArduPilot: servos, relays and the gripper.

Commands, mission items and switches of the transmitter act through the same functions. Nothing is attached to
an output: its state shows in telemetry and in SIM_PIN_MASK.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import partial

from volery.base.time import MS, S, from_seconds
from volery.simulation.autopilots.ardupilot.feature import Feature, MissionCommand, as_command
from volery.simulation.autopilots.ardupilot.servo_outputs import outputs_of
from volery.simulation.autopilots.mavlink.messages import ACCEPTED, FAILED, Command, Fields, boot_ms
from volery.simulation.autopilots.onboard_mission import MissionItem
from volery.simulation.autopilots.vehicle_state import AutopilotVehicle
from volery.trace.events import INFO

SET_RELAY, REPEAT_RELAY, SET_SERVO, REPEAT_SERVO, GRIPPER = 181, 182, 183, 184, 211
"""Commands that are mission items, too."""

RELAYS = 6
PINS = 16
RELAY_FUNCTION = 1
"""RELAYn_FUNCTION of a relay that commands switch."""

LONGEST_PULSE = 65_535

CHANGES_EVERY = 20 * MS
"""Shortest time between two changes of a repetition."""
LONGEST_PERIOD, MOST_PERIODS = 86_400.0, 16_383.0
"""Period [s] and number of periods to which a repetition is limited."""

LET_GO, GRAB = 0, 1
"""Values of param2 of DO_GRIPPER."""
GRIPS_WITHIN = 2 * S
"""Time of a servo gripper from the command to the report of its end."""
GRIPPER_SWITCH, RELAY_SWITCHES = 19, (28, 34, 35, 36, 66, 67)
"""Values of RCn_OPTION."""


def _is_free(vehicle: AutopilotVehicle, channel: int, pulse: int) -> bool:
    """Return whether there is such a pulse width [us], and a channel that drives nothing else."""
    function = f"SERVO{channel}_FUNCTION"
    if function not in vehicle.parameters or not 0 <= pulse <= LONGEST_PULSE:
        return False
    if vehicle.parameters[function]:
        vehicle.send_text(INFO, f"ServoRelayEvent: Channel {channel} is already in use")
        return False
    return True


def set_servo(vehicle: AutopilotVehicle, channel: int, pulse: int) -> bool:
    """Give a channel that drives nothing else a pulse width [us], and return whether there is one."""
    if not _is_free(vehicle, channel, pulse):
        return False
    _stop_repeating(vehicle, ("servo", channel))
    outputs_of(vehicle).servos[channel] = pulse
    return True


def has_relay(vehicle: AutopilotVehicle, number: int) -> bool:
    """Return whether a pin is assigned to relay *number*, counted from 0."""
    function = f"RELAY{number + 1}_FUNCTION"
    return function in vehicle.parameters and vehicle.parameters[function] == RELAY_FUNCTION


def set_relay(vehicle: AutopilotVehicle, number: int, state: int) -> bool:
    """Switch a relay and the bit of its pin in SIM_PIN_MASK, and return whether there is one.

    Args:
        vehicle: The vehicle.
        number: Number of the relay, from 0.
        state: 1 on, 0 off, any other value the opposite of its present state.
    """
    if not has_relay(vehicle, number):
        return False
    _stop_repeating(vehicle, ("relay", number))
    _write_relay(
        vehicle, number, bool(state) if state in (0, 1) else number not in outputs_of(vehicle).relays
    )
    return True


def relays_at_boot(vehicle: AutopilotVehicle) -> None:
    """Switch each relay as RELAYn_DEFAULT states: 0 off, 1 on; its pin stays as it is for any other value."""
    for number in range(RELAYS):
        default = f"RELAY{number + 1}_DEFAULT"
        if has_relay(vehicle, number) and vehicle.parameters[default] in (0.0, 1.0):
            _write_relay(vehicle, number, vehicle.parameters[default] == 1.0)


def _write_relay(vehicle: AutopilotVehicle, number: int, on: bool) -> None:
    relays = outputs_of(vehicle).relays
    (relays.add if on else relays.discard)(number)
    pin = f"RELAY{number + 1}_PIN"
    if pin in vehicle.parameters and 0.0 <= vehicle.parameters[pin] < PINS:
        bit = 1 << round(vehicle.parameters[pin])
        mask = round(vehicle.parameters["SIM_PIN_MASK"])
        changed = mask | bit if on else mask & ~bit
        if changed != mask:
            vehicle.set_parameter("SIM_PIN_MASK", float(changed))


def relay_status(vehicle: AutopilotVehicle) -> Fields:
    """Return RELAY_STATUS."""
    return {
        "time_boot_ms": boot_ms(vehicle),
        "on": sum(1 << number for number in outputs_of(vehicle).relays),
        "present": sum(1 << number for number in range(RELAYS) if has_relay(vehicle, number)),
    }


def move_gripper(vehicle: AutopilotVehicle, action: int) -> bool:
    """Grab or release, and return whether there is a gripper and such an action; it needs GRIP_ENABLE."""
    said = {LET_GO: "Gripper load releas", GRAB: "Gripper load grabb"}.get(action)
    if said is None or not vehicle.parameters["GRIP_ENABLE"]:
        return False
    vehicle.send_text(INFO, f"{said}ing")
    outputs = outputs_of(vehicle)
    outputs.gripper = None

    def finish() -> None:
        outputs.gripper = vehicle.flight.gripper = action
        vehicle.send_text(INFO, f"{said}ed")

    vehicle.kernel.call_at(vehicle.kernel.now() + GRIPS_WITHIN, finish)
    return True


def on_set_servo(vehicle: AutopilotVehicle, command: Command) -> int:
    """Handle DO_SET_SERVO."""
    return ACCEPTED if set_servo(vehicle, round(command.param1), round(command.param2)) else FAILED


def on_set_relay(vehicle: AutopilotVehicle, command: Command) -> int:
    """Handle DO_SET_RELAY."""
    return ACCEPTED if set_relay(vehicle, round(command.param1), round(command.param2)) else FAILED


def _repeat(
    vehicle: AutopilotVehicle,
    output: tuple[str, int],
    times: float,
    period: float,
    change: Callable[[int], None],
) -> None:
    """Change an output twice in each period, at once for the first time; it replaces an earlier repetition.

    Args:
        vehicle: The vehicle.
        output: Kind and number of the output.
        times: Number of periods; without end if negative.
        period: Duration of a period [s].
        change: Called with the number of changes left, which is even for the first half of a period.
    """
    outputs, every = (
        outputs_of(vehicle),
        max(CHANGES_EVERY, from_seconds(min(max(0.0, period), LONGEST_PERIOD)) // 2),
    )
    outputs.repeated = output
    outputs.repetitions += 1
    this = outputs.repetitions

    def go_on(left: int) -> None:
        if (
            not left
            or outputs_of(vehicle) is not outputs
            or (outputs.repetitions, outputs.repeated) != (this, output)
        ):
            return
        change(left)
        vehicle.kernel.call_at(vehicle.kernel.now() + every, lambda: go_on(left - 1))

    go_on(2 * round(min(max(times, -1.0), MOST_PERIODS)))


def _stop_repeating(vehicle: AutopilotVehicle, output: tuple[str, int]) -> None:
    if outputs_of(vehicle).repeated == output:
        outputs_of(vehicle).repeated = None


def on_repeat_relay(vehicle: AutopilotVehicle, command: Command) -> int:
    """Handle DO_REPEAT_RELAY: param2 on and off cycles of param3 seconds each."""
    number = round(command.param1)
    if not has_relay(vehicle, number):
        return FAILED
    _repeat(
        vehicle,
        ("relay", number),
        command.param2,
        command.param3,
        lambda _left: _write_relay(vehicle, number, number not in outputs_of(vehicle).relays),
    )
    return ACCEPTED


def on_repeat_servo(vehicle: AutopilotVehicle, command: Command) -> int:
    """Handle DO_REPEAT_SERVO: param3 cycles of param4 seconds between pulse width param2 and the trim."""
    channel, pulse = round(command.param1), round(command.param2)
    if not _is_free(vehicle, channel, pulse):
        return FAILED
    trim = round(vehicle.parameters[f"SERVO{channel}_TRIM"])

    def change(left: int) -> None:
        outputs_of(vehicle).servos[channel] = trim if left % 2 else pulse

    _repeat(vehicle, ("servo", channel), command.param3, command.param4, change)
    return ACCEPTED


def on_gripper(vehicle: AutopilotVehicle, command: Command) -> int:
    """Handle DO_GRIPPER."""
    return ACCEPTED if move_gripper(vehicle, round(command.param2)) else FAILED


def act_on_payload(vehicle: AutopilotVehicle, item: MissionItem) -> None:
    """Execute a mission item that switches an output. A gripper item is reported without a gripper, too."""
    if item.command == SET_SERVO:
        set_servo(vehicle, round(item.param1), round(item.param2))
    elif item.command == SET_RELAY:
        set_relay(vehicle, round(item.param1), round(item.param2))
    elif item.command == GRIPPER:
        move_gripper(vehicle, round(item.param2))
        vehicle.send_text(INFO, "Gripper Grabbed" if round(item.param2) == GRAB else "Gripper Released")


def _switch_gripper(vehicle: AutopilotVehicle, position: int) -> None:
    if position:
        move_gripper(vehicle, GRAB if position > 0 else LET_GO)


def _switch_relay(vehicle: AutopilotVehicle, position: int, number: int) -> None:
    set_relay(vehicle, number, int(position > 0))


COPTER = ROVER = Feature(
    parameters={
        "GRIP_ENABLE": ("", "any value but 0: there is a gripper"),
        "SIM_PIN_MASK": ("", "bits of the pins that are high: relays set them, buttons are read from them"),
        **{
            f"RELAY{number}_{part}": ("", f"{words} of that relay")
            for number in range(1, RELAYS + 1)
            for part, words in (
                ("FUNCTION", "1: commands switch it; function"),
                ("PIN", "pin"),
                ("DEFAULT", "state at the boot"),
            )
        },
    },
    commands={
        SET_SERVO: on_set_servo,
        REPEAT_SERVO: on_repeat_servo,
        SET_RELAY: on_set_relay,
        REPEAT_RELAY: on_repeat_relay,
        GRIPPER: on_gripper,
    },
    items={
        SET_RELAY: MissionCommand("SetRelay", act_on_payload, silent=True),
        SET_SERVO: MissionCommand("SetServo", act_on_payload, silent=True),
        GRIPPER: MissionCommand("Gripper", act_on_payload, silent=True),
        REPEAT_RELAY: MissionCommand("RepeatRelay", as_command(on_repeat_relay), silent=True),
        REPEAT_SERVO: MissionCommand("RepeatServo", as_command(on_repeat_servo), silent=True),
    },
    switches={
        GRIPPER_SWITCH: _switch_gripper,
        **{option: partial(_switch_relay, number=number) for number, option in enumerate(RELAY_SWITCHES)},
    },
    at_boot=relays_at_boot,
    telemetry={"RELAY_STATUS": relay_status},
)

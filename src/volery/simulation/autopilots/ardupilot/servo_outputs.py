"""Outputs of ArduPilot by their function: SERVOn_FUNCTION to channels, positions to pulse widths.

What drives a device names its function; every channel with that function moves. Channels that pass the
transmitter through are set here, too. A channel that nothing has driven since the boot gives no pulses.
"""

from __future__ import annotations

from dataclasses import dataclass, field

from volery.simulation.autopilots.ardupilot.failsafes import radio_lost
from volery.simulation.autopilots.ardupilot.feature import Feature, Kept
from volery.simulation.autopilots.ardupilot.parameters import channel_range
from volery.simulation.autopilots.vehicle_state import AutopilotVehicle

OUTPUTS = range(1, 17)

PASSES_OWN_CHANNEL = 1
PASSES_CHANNEL = range(51, 67)
PASSES_SCALED = range(140, 156)
"""SERVOn_FUNCTION of outputs that follow the transmitter: pulse widths as they are, or scaled."""


@dataclass
class OutputState:
    """Outputs beside the motors, as commands have set them."""

    servos: dict[int, int] = field(default_factory=dict)
    """Pulse widths [us] by channel, from 1."""
    relays: set[int] = field(default_factory=set)
    """Relays that are on, from 0."""
    repeated: tuple[str, int] | None = None
    """Kind and number of the output that changes by itself."""
    repetitions: int = 0
    """Number of the last order to change an output repeatedly."""
    gripper: int | None = None
    """What the gripper has done: 0 released, 1 grabbed; ``None``: it is neutral or moves."""
    functions: dict[int, int] = field(default_factory=dict)
    """Function by channel, of the channels that have one, and the changes of parameters that it holds for."""
    functions_at: int = -1


outputs_of = Kept(OutputState)


def channels(vehicle: AutopilotVehicle, function: int) -> list[int]:
    """Return the channels with a function, from 1."""
    return [channel for channel, its in _functions(vehicle).items() if its == function]


def _functions(vehicle: AutopilotVehicle) -> dict[int, int]:
    """Return SERVOn_FUNCTION by channel, without the channels that have none."""
    outputs, parameters = outputs_of(vehicle), vehicle.parameters
    if outputs.functions_at != parameters.changes:
        outputs.functions_at = parameters.changes
        found = {n: round(parameters[f"SERVO{n}_FUNCTION"]) for n in OUTPUTS}
        outputs.functions = {n: function for n, function in found.items() if function}
    return outputs.functions


def write(vehicle: AutopilotVehicle, function: int, pulse: int) -> None:
    """Give the channels with a function a pulse width [us]; 0 ends their pulses."""
    for channel in channels(vehicle, function):
        outputs_of(vehicle).servos[channel] = pulse


def move(vehicle: AutopilotVehicle, function: int, share: float) -> None:
    """Move the channels with a function to a share (0..1) of their range."""
    for channel in channels(vehicle, function):
        low, _, high, is_reversed = _travel(vehicle, channel)
        along = min(1.0, max(0.0, share))
        outputs_of(vehicle).servos[channel] = low + int(
            (1.0 - along if is_reversed else along) * (high - low)
        )


def deflect(vehicle: AutopilotVehicle, function: int, deflection: float) -> None:
    """Deflect the channels with a function from their middle: -1 and 1 are the ends."""
    for channel in channels(vehicle, function):
        outputs_of(vehicle).servos[channel] = _deflected(vehicle, channel, deflection)


def _travel(vehicle: AutopilotVehicle, channel: int) -> tuple[int, int, int, bool]:
    """Return lower end, middle and upper end of a channel [us], and whether it is reversed."""
    parameters = vehicle.parameters
    low, middle, high = (round(parameters[f"SERVO{channel}_{part}"]) for part in ("MIN", "TRIM", "MAX"))
    return low, middle, high, bool(parameters[f"SERVO{channel}_REVERSED"])


def _deflected(vehicle: AutopilotVehicle, channel: int, deflection: float) -> int:
    low, middle, high, is_reversed = _travel(vehicle, channel)
    by = min(1.0, max(-1.0, -deflection if is_reversed else deflection))
    return middle + int(by * (high - middle if by > 0.0 else middle - low))


def pass_transmitter_through(vehicle: AutopilotVehicle) -> None:
    """Set the channels that follow the transmitter, at each tick."""
    for channel, function in _functions(vehicle).items():
        if function == PASSES_OWN_CHANNEL:
            outputs_of(vehicle).servos[channel] = vehicle.rc[channel]
        elif function in PASSES_CHANNEL:
            outputs_of(vehicle).servos[channel] = vehicle.rc[function - PASSES_CHANNEL.start + 1]
        elif function in PASSES_SCALED:
            _pass_scaled(vehicle, channel, function - PASSES_SCALED.start + 1)


def _pass_scaled(vehicle: AutopilotVehicle, channel: int, source: int) -> None:
    """Follow a channel of the transmitter, scaled; without input keep the last pulse width.

    In a failsafe of the radio, an output whose source has its bit in SERVO_RC_FS_MSK goes to its middle.
    """
    if not radio_lost(vehicle):
        deflection = channel_range(vehicle.parameters, source).deflection(vehicle.rc[source])
    elif "radio" in vehicle.failsafes.active and (
        round(vehicle.parameters["SERVO_RC_FS_MSK"]) >> (source - 1) & 1
    ):
        deflection = 0.0
    else:
        return
    outputs_of(vehicle).servos[channel] = _deflected(vehicle, channel, deflection)


COPTER = ROVER = Feature(
    parameters={
        **{
            f"SERVO{channel}_{part}": (unit, f"{words} of output {channel}")
            for channel in OUTPUTS
            for part, unit, words in (
                ("FUNCTION", "", "function"),
                ("MIN", "µs", "lower end"),
                ("TRIM", "µs", "middle"),
                ("MAX", "µs", "upper end"),
                ("REVERSED", "", "direction"),
            )
        },
        "SERVO_RC_FS_MSK": (
            "",
            "channels whose scaled outputs go to their middle when the transmitter is lost",
        ),
    },
    on_tick=pass_transmitter_through,
)

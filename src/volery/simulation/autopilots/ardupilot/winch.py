"""ArduPilot's winch with a servo: let go, turned at a rate, or by a length of line.

The line follows the ordered rate exactly, as ArduPilot assumes: nothing hangs on it.
"""

from __future__ import annotations

from dataclasses import dataclass

from volery.base.time import to_seconds
from volery.simulation.autopilots.ardupilot.feature import TICK, ArmingCheck, Feature, Kept, MissionCommand
from volery.simulation.autopilots.ardupilot.parameters import channel_range
from volery.simulation.autopilots.ardupilot.servo_outputs import channels, deflect, write
from volery.simulation.autopilots.mavlink.messages import ACCEPTED, FAILED, Command
from volery.simulation.autopilots.onboard_mission import MissionItem
from volery.simulation.autopilots.vehicle_state import AutopilotVehicle
from volery.trace.events import INFO

DO_WINCH = 42_600
WINCH = 88
"""SERVOn_FUNCTION."""
WINCH_SWITCH, CONTROL = 44, 45
"""RCn_OPTION of the switch, and of the channel that sets the rate."""
SERVO = 1
"""WINCH_TYPE."""
RELAXED, BY_LENGTH, BY_RATE = 0, 1, 2
"""WINCH_ACTIONS."""
FREE_AT_START, VERBOSE = 1, 2
"""Bits of WINCH_OPTIONS."""
FIRST_SWITCH = 5
LEAST_DEAD_ZONE = 30
"""Dead zone of the channel that sets the rate [us], where RCn_DZ states none."""


@dataclass
class WinchState:
    """Winch."""

    action: int = 0
    """WINCH_ACTIONS."""
    started: bool = False
    """Whether the first action has been taken."""
    rate: float = 0.0
    """Rate that is wanted [m/s], positive out, and the same with limited acceleration."""
    limited_rate: float = 0.0
    length: float = 0.0
    """Line that is out [m], and the length that is wanted."""
    target: float = 0.0
    by_pilot: bool = False
    pilot_pulse: int | None = None
    """Pulse width [us] of the pilot's channel when it last counted."""


winch_of = Kept(WinchState)


def _is_there(vehicle: AutopilotVehicle) -> bool:
    return vehicle.parameters["WINCH_TYPE"] == SERVO


def no_servo(vehicle: AutopilotVehicle) -> bool:
    """Return whether a winch has no output: a copter is not armed with it."""
    return _is_there(vehicle) and not channels(vehicle, WINCH)


def _order(vehicle: AutopilotVehicle, action: int, length: float, rate: float) -> bool:
    """Carry out an order, and return whether there is a winch and such an action.

    Args:
        vehicle: The vehicle.
        action: One of WINCH_ACTIONS.
        length: Line to pay out [m]; negative: to haul in.
        rate: Rate [m/s], positive out.
    """
    if not _is_there(vehicle):
        return False
    winch, parameters = winch_of(vehicle), vehicle.parameters
    if action == BY_RATE:
        fastest = parameters["WINCH_RATE_MAX"]
        winch.rate = min(fastest, max(-fastest, rate))
    elif action == BY_LENGTH:
        winch.target = winch.length + length
        if round(parameters["WINCH_OPTIONS"]) & VERBOSE:
            way = "raising" if length < 0.0 else "lowering"
            vehicle.send_text(INFO, f"Winch: {way} {abs(length):4.1f}m to {winch.target:4.1f}m")
    elif action != RELAXED:
        return False
    winch.action, winch.by_pilot = action, False
    return True


def on_winch(vehicle: AutopilotVehicle, command: Command) -> int:
    """Handle DO_WINCH: param2 is the action, param3 a length [m], param4 a rate [m/s]."""
    done = _order(vehicle, round(command.param2), command.param3, command.param4)
    return ACCEPTED if done else FAILED


def act_on_winch(vehicle: AutopilotVehicle, item: MissionItem) -> None:
    """Execute the mission item DO_WINCH."""
    _order(vehicle, round(item.param2), item.param3, item.param4)


def switch_winch(vehicle: AutopilotVehicle, position: int) -> None:
    """Hold the line with the switch up, let it go in the middle and down."""
    _order(vehicle, BY_RATE if position > 0 else RELAXED, 0.0, 0.0)


def update_winch(vehicle: AutopilotVehicle) -> None:
    """Turn the winch, and pay out the line, at each tick."""
    if not _is_there(vehicle) or not channels(vehicle, WINCH):
        return
    winch, parameters = winch_of(vehicle), vehicle.parameters
    if not winch.started:
        winch.started = True
        _order(vehicle, RELAXED if round(parameters["WINCH_OPTIONS"]) & FREE_AT_START else BY_RATE, 0.0, 0.0)
    fastest, seconds = parameters["WINCH_RATE_MAX"], to_seconds(TICK)
    _read_pilot(vehicle, winch, fastest)
    if winch.action == RELAXED:
        winch.limited_rate = 0.0
        write(vehicle, WINCH, 0)
        return
    if winch.action == BY_LENGTH:
        wanted = (winch.target - winch.length) * parameters["WINCH_POS_P"]
        winch.rate = min(fastest, max(-fastest, wanted))
    most = max(2.0 * fastest, 0.1) * seconds
    winch.limited_rate += min(most, max(-most, winch.rate - winch.limited_rate))
    deflect(vehicle, WINCH, winch.limited_rate / fastest if fastest > 0.0 else 0.0)
    winch.length += winch.rate * seconds


def _read_pilot(vehicle: AutopilotVehicle, winch: WinchState, fastest: float) -> None:
    """Take the rate from the channel with the option for it, once that has moved."""
    parameters, rc = vehicle.parameters, vehicle.rc
    used = (n for n in range(FIRST_SWITCH, len(rc.transmitter) + 1) if parameters[f"RC{n}_OPTION"] == CONTROL)
    channel = next(used, None)
    if channel is None or not rc[channel]:
        return
    travel = channel_range(parameters, channel)
    travel = travel._replace(dead=travel.dead or LEAST_DEAD_ZONE)
    if winch.pilot_pulse is None:
        winch.pilot_pulse = rc[channel]
    if abs(rc[channel] - winch.pilot_pulse) > travel.dead:
        winch.by_pilot, winch.action = True, BY_RATE
    if winch.by_pilot:
        winch.pilot_pulse = rc[channel]
        winch.rate = travel.deflection(rc[channel]) * fastest


def _leave_to_channel(_vehicle: AutopilotVehicle, _position: int) -> None:
    """Do nothing: the pulse width of the channel counts, not its position as a switch."""


COPTER = Feature(
    parameters={
        "WINCH_OPTIONS": ("", "bit 0: the winch is let go at the start; bit 1: lengths are reported"),
        "WINCH_POS_P": ("1/s", "rate for each metre of line that is missing"),
        "WINCH_RATE_MAX": ("m/s", "largest rate of the winch"),
        "WINCH_TYPE": ("", "1: there is a winch with a servo"),
    },
    commands={DO_WINCH: on_winch},
    items={DO_WINCH: MissionCommand("Winch", act_on_winch)},
    switches={WINCH_SWITCH: switch_winch, CONTROL: _leave_to_channel},
    checks=(ArmingCheck("winch unhealthy", no_servo),),
    on_tick=update_winch,
)
ROVER = Feature(
    items={DO_WINCH: MissionCommand("Winch")},  # stored and passed over
    switches=COPTER.switches,
)

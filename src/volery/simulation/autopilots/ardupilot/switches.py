"""Switches of the transmitter: flight mode, channel options, and arming by the yaw stick.

Thresholds and times are those of ArduPilot: six positions of the mode switch, 0.2 s until a new one counts,
two seconds of full rudder, three for a rover.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from math import dist

from volery.base.time import MS, Ns
from volery.simulation.autopilots.ardupilot.fence import on_fence_enable
from volery.simulation.autopilots.ardupilot.modes import arm, change_mode, disarm
from volery.simulation.autopilots.mavlink.command import Command
from volery.simulation.autopilots.vehicle_state import Vehicle

POSITIONS = (1230, 1360, 1490, 1620, 1749)
"""Upper ends of the first five positions of the mode switch [us]."""
LOWEST, HIGHEST = 900, 2200
"""Pulse widths outside are no position."""
SETTLED: Ns = 200 * MS
UP, DOWN = 1800, 1200
FULL_RUDDER = 0.89
TRACK_SPACING, TRACK_POINTS = 2.0, 300
"""SRTL_ACCURACY [m] and SRTL_POINTS."""

FENCE_OPTION, ARM_OPTION = 11, 153
NEVER_AGAIN: Ns = 1 << 62


def position_of(pulse: int) -> int:
    """Return the position of the mode switch, from 1; 0 for a pulse width that is none."""
    if not LOWEST < pulse < HIGHEST:
        return 0
    return 1 + sum(pulse > end for end in POSITIONS)


def read_mode_switch(vehicle: Vehicle, channel: str, modes: str) -> None:
    """Enter the mode of the switch once it has moved.

    Args:
        vehicle: The vehicle.
        channel: Parameter with the number of the channel.
        modes: Parameter with the number of a mode, without the position.
    """
    number = round(vehicle.parameters[channel])
    if not 1 <= number <= len(vehicle.rc.transmitter):
        return
    now, switches, position = vehicle.kernel.now(), vehicle.switches, position_of(vehicle.rc[number])
    if position != switches.read:
        switches.read, switches.read_since = position, now
    if not position or now - switches.read_since < SETTLED or position == switches.mode:
        return
    first, switches.mode = switches.mode == 0, position
    if not first:
        change_mode(vehicle, round(vehicle.parameters[f"{modes}{position}"]))


def read_rudder(
    vehicle: Vehicle, problems: Callable[[Vehicle], list[str]], words: tuple[str, str], hold: Ns
) -> None:
    """Arm with the yaw stick right and disarm with it left, the throttle closed.

    Args:
        vehicle: The vehicle.
        problems: Returns the texts that forbid arming.
        words: Status texts of arming and disarming.
        hold: Time for which the stick must be held [ns].
    """
    permitted = round(vehicle.parameters["ARMING_RUDDER"])
    sticks, switches, now = vehicle.tuning.sticks, vehicle.switches, vehicle.kernel.now()
    stick = 3 if vehicle.flies else 0
    yaw = sticks.travels[stick].deflection(vehicle.rc[sticks.yaw if vehicle.flies else sticks.roll])
    if vehicle.flies:
        closed = sticks.read(vehicle.rc).throttle <= 0.0
    else:
        closed = sticks.travels[2].deflection(vehicle.rc[sticks.throttle]) == 0.0
    side = (yaw > FULL_RUDDER) - (yaw < -FULL_RUDDER) if closed and permitted else 0
    if side != switches.rudder:
        switches.rudder, switches.rudder_since = side, now
    if not side or now - switches.rudder_since < hold:
        return
    switches.rudder_since = NEVER_AGAIN
    if side > 0 and not vehicle.armed:
        arm(vehicle, problems, words[0], force=False)
    elif side < 0 and permitted == 2 and vehicle.armed and (vehicle.landed or not vehicle.flies):
        disarm(vehicle, words[1], force=False)


def read_options(
    vehicle: Vehicle,
    modes: Mapping[int, int],
    problems: Callable[[Vehicle], list[str]],
    words: tuple[str, str],
) -> None:
    """Act on channels whose RCn_OPTION is a mode, the fence or arming, when their switch moves.

    Args:
        vehicle: The vehicle.
        modes: RCn_OPTION to the number of a mode.
        problems: Returns the texts that forbid arming.
        words: Status texts of arming and disarming.
    """
    for channel in range(5, len(vehicle.rc.transmitter) + 1):
        option, pulse = round(vehicle.parameters[f"RC{channel}_OPTION"]), vehicle.rc[channel]
        if not (UP <= pulse < HIGHEST or LOWEST < pulse <= DOWN):
            continue
        up = pulse >= UP
        before = vehicle.switches.options.get(channel)
        vehicle.switches.options[channel] = up
        if before is None or before == up:
            continue
        if option == FENCE_OPTION:
            on_fence_enable(vehicle, Command(207, float(up), 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0, is_int=False))
        elif option == ARM_OPTION and up:
            arm(vehicle, problems, words[0], force=False)
        elif option == ARM_OPTION:
            disarm(vehicle, words[1], force=False)
        elif option in modes and up:
            change_mode(vehicle, modes[option])
        elif option in modes and vehicle.mode.number == modes[option]:
            vehicle.switches.mode = -1  # the mode switch counts again


def keep_track(vehicle: Vehicle) -> None:
    """Add the position of an armed vehicle to its track; a point near an earlier one cuts the loop."""
    if not vehicle.armed or not vehicle.has_position or vehicle.mode.name == "SMART_RTL":
        return
    here, track = vehicle.estimate.position, vehicle.ground.track
    if track and dist(here, track[-1]) < TRACK_SPACING:
        return
    near = next((place for place, point in enumerate(track) if dist(here, point) < TRACK_SPACING), None)
    if near is not None:
        del track[near + 1 :]
    elif len(track) < TRACK_POINTS:
        track.append(here)

"""ArduPilot's auxiliary functions: what RCn_OPTION assigns to a switch of the transmitter.

The same functions act by a switch that moves, by the command DO_AUX_FUNCTION and by its mission item. A
position is 1 up, 0 in the middle, -1 down. Five functions count as soon as the transmitter is first read:
emergency stop and motor interlock, both of which keep the motors from turning, avoidance by proximity,
precision loiter and the range finder.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from functools import partial
from typing import NamedTuple

from volery.simulation.autopilots.ardupilot.camera import picture_by_switch
from volery.simulation.autopilots.ardupilot.estimator_sources import SOURCES_OPTION, switch_sources
from volery.simulation.autopilots.ardupilot.fence import enable_fence
from volery.simulation.autopilots.ardupilot.landing_gear import switch_gear
from volery.simulation.autopilots.ardupilot.mission import mission_grew, path_jerk
from volery.simulation.autopilots.ardupilot.modes import (
    INFO,
    NOTICE,
    Check,
    arm,
    change_mode,
    disarm,
)
from volery.simulation.autopilots.ardupilot.mount import PILOT_PITCH, PILOT_ROLL, PILOT_YAW
from volery.simulation.autopilots.ardupilot.mount_control import lock_by_switch, retract_by_switch
from volery.simulation.autopilots.ardupilot.payload import GRAB, LET_GO, move_gripper, set_relay
from volery.simulation.autopilots.ardupilot.pilot_input import HIGHEST, LOWEST, sticks_moved
from volery.simulation.autopilots.ardupilot.precision_landing import PRECISION_LOITER, switch_loiter
from volery.simulation.autopilots.ardupilot.range_finder import RANGE_FINDER, switch_range_finder
from volery.simulation.autopilots.ardupilot.sprayer import switch_sprayer
from volery.simulation.autopilots.ardupilot.winch import CONTROL, switch_winch
from volery.simulation.autopilots.manoeuvres.zigzag import ZigZag
from volery.simulation.autopilots.mavlink.messages import ACCEPTED, DENIED, FAILED, Command
from volery.simulation.autopilots.onboard_mission import GLOBAL, LAND, TAKEOFF, WAYPOINT, MissionItem
from volery.simulation.autopilots.state_groups import NEVER
from volery.simulation.autopilots.vehicle_state import Vehicle

UP, DOWN = 1800, 1200
"""Pulse widths [us] beyond which a switch is up or down."""
FIRST_SWITCH = 5

NOTHING, ARMING, DISARMING, EMERGENCY_STOP, INTERLOCK, PROXIMITY = 0, 153, 81, 31, 32, 40
"""Values of RCn_OPTION."""
READ_AT_ONCE = (EMERGENCY_STOP, INTERLOCK, PROXIMITY, PRECISION_LOITER, RANGE_FINDER)
"""Those that count as soon as the transmitter is first read."""
RELAY_OPTIONS = (28, 34, 35, 36, 66, 67)
LOWEST_TAKEOFF = 1.0
"""Least height of a take-off item that the pilot saves [m]."""


class AuxiliaryFunctions(NamedTuple):
    """What the functions of one kind of vehicle need.

    Args:
        modes: RCn_OPTION to the number of the mode that its switch enters.
        problems: Returns the texts that forbid arming.
        words: Status texts of arming and disarming.
    """

    modes: Mapping[int, int]
    problems: Callable[[Vehicle], list[str]]
    words: tuple[str, str]

    def run(self, vehicle: Vehicle, function: int, position: int) -> bool:
        """Do what a switch does at a position, and return whether the vehicle has that function."""
        if function in FUNCTIONS:
            FUNCTIONS[function](vehicle, position)
        elif function == ARMING and position > 0:
            arm(vehicle, self.problems, self.words[0], force=False)
        elif (function == ARMING and position < 0) or (function == DISARMING and position > 0):
            disarm(vehicle, self.words[1], force=True)
        elif function in self.modes and position > 0:
            change_mode(vehicle, self.modes[function])
        elif function in self.modes and vehicle.mode.number == self.modes[function]:
            vehicle.switches.mode = -1  # the mode switch counts again
        elif function not in self.modes and function not in (NOTHING, ARMING, DISARMING):
            return False
        update_stop(vehicle)
        return True

    def read_switches(self, vehicle: Vehicle) -> None:
        """Run the function of each channel whose switch has moved since it was last read."""
        for channel in range(FIRST_SWITCH, len(vehicle.rc.transmitter) + 1):
            function, pulse = round(vehicle.parameters[f"RC{channel}_OPTION"]), vehicle.rc[channel]
            if not LOWEST < pulse < HIGHEST:
                continue
            position = (pulse > UP) - (pulse < DOWN)
            before = vehicle.switches.options.get(channel)
            vehicle.switches.options[channel] = position
            if before == position or (before is None and function not in READ_AT_ONCE):
                continue
            self.run(vehicle, function, position)
        update_stop(vehicle)

    def on_command(self, vehicle: Vehicle, command: Command) -> int:
        """Handle DO_AUX_FUNCTION: param1 is the function, param2 the position, 0 down to 2 up."""
        function, position = round(command.param1), round(command.param2)
        if position not in (0, 1, 2):
            return DENIED
        if not self.run(vehicle, function, position - 1):
            vehicle.send_text(INFO, f"Invalid channel option ({function})")
            return FAILED
        return ACCEPTED

    def act(self, vehicle: Vehicle, item: MissionItem) -> None:
        """Execute the mission item DO_AUX_FUNCTION."""
        self.run(vehicle, round(item.param1), round(item.param2) - 1)


def _uses(vehicle: Vehicle, function: int) -> bool:
    channels = range(FIRST_SWITCH, len(vehicle.rc.transmitter) + 1)
    return any(round(vehicle.parameters[f"RC{channel}_OPTION"]) == function for channel in channels)


def update_stop(vehicle: Vehicle) -> None:
    """Compute whether emergency stop or interlock keep the motors from turning."""
    switches = vehicle.switches
    open_ = vehicle.flies and not switches.interlock_closed and _uses(vehicle, INTERLOCK)
    stopped = switches.emergency_stop or open_
    if not stopped:
        switches.motors_stopped_at = NEVER
    elif switches.motors_stopped_at == NEVER:
        switches.motors_stopped_at = vehicle.kernel.now()


def _conflict(vehicle: Vehicle) -> bool:
    return vehicle.flies and _uses(vehicle, INTERLOCK) and _uses(vehicle, EMERGENCY_STOP)


def _interlock_closed(vehicle: Vehicle) -> bool:
    return vehicle.flies and vehicle.switches.interlock_closed and _uses(vehicle, INTERLOCK)


STOP_CHECKS = (
    Check("Motors Emergency Stopped", lambda vehicle: vehicle.switches.emergency_stop),
    Check("Interlock/E-Stop Conflict", _conflict),
    Check("Motor Interlock Enabled", _interlock_closed),
)
"""Arming checks of the two functions; a vehicle is armed with an open interlock, which is closed then."""


def _emergency_stop(vehicle: Vehicle, position: int) -> None:
    if position:
        vehicle.switches.emergency_stop = position > 0


def _interlock(vehicle: Vehicle, position: int) -> None:
    vehicle.switches.interlock_closed = position >= 0


def _fence(vehicle: Vehicle, position: int) -> None:
    enable_fence(vehicle, on=position > 0)


def _proximity(vehicle: Vehicle, position: int) -> None:
    if position:
        vehicle.avoidance.by_proximity = position > 0


def _gripper(vehicle: Vehicle, position: int) -> None:
    if position:
        move_gripper(vehicle, GRAB if position > 0 else LET_GO)


def _relay(vehicle: Vehicle, position: int, number: int) -> None:
    set_relay(vehicle, number, int(position > 0))


def _overrides(vehicle: Vehicle, position: int) -> None:
    """Admit or deny the sticks of a ground station; denied ones go back to the transmitter at once."""
    if position:
        vehicle.switches.overrides_denied = position < 0
    if position < 0:
        vehicle.rc.release()
        sticks_moved(vehicle)


def _clear_mission(vehicle: Vehicle, position: int) -> None:
    """Delete the mission, except while it is flown."""
    if position > 0 and not (vehicle.armed and vehicle.mode.name == "AUTO"):
        vehicle.mission.clear()
        mission_grew(vehicle, 0)


def _restart_mission(vehicle: Vehicle, position: int) -> None:
    if position > 0:
        vehicle.mission.restart()
        vehicle.manoeuvre.item_chosen()


def _save_waypoint(vehicle: Vehicle, position: int) -> None:
    """Append the present position to the mission; a disarmed rover clears the mission and sets home instead.

    The first item takes the place of home, item 0. A copter whose throttle is closed saves a landing.
    """
    if position <= 0 or vehicle.mode.name == "AUTO" or not vehicle.has_position:
        return
    open_throttle = vehicle.tuning.sticks.read(vehicle.rc).throttle > 0.0
    items = vehicle.mission.items
    if vehicle.flies:
        if not vehicle.armed or not (items or open_throttle):
            return
        if not items:
            items.append(MissionItem(TAKEOFF, z=max(vehicle.height, LOWEST_TAKEOFF)))
        items.append(_item_here(vehicle, WAYPOINT if open_throttle else LAND))
    elif vehicle.armed:
        items.extend(_item_here(vehicle, WAYPOINT) for _ in range(1 if items else 2))
    else:
        vehicle.mission.clear()
        vehicle.send_text(NOTICE, "SaveWP: Mission cleared!")
        vehicle.set_home_here()
    mission_grew(vehicle, len(vehicle.mission))


def _leave_to_channel(_vehicle: Vehicle, _position: int) -> None:
    """Do nothing: the pulse width of the channel counts, not its position as a switch."""


def _zigzag(vehicle: Vehicle, position: int) -> None:
    """Store point A (down) or B (up) of ZIGZAG or fly to its line; in the middle the pilot flies."""
    manoeuvre = vehicle.manoeuvre
    if not isinstance(manoeuvre, ZigZag):
        return
    if position:
        manoeuvre.choose("B" if position > 0 else "A", path_jerk(vehicle))
    else:
        manoeuvre.let_pilot_fly()


def _item_here(vehicle: Vehicle, command: int) -> MissionItem:
    latitude, longitude, amsl = vehicle.estimate.geodetic
    return MissionItem(command, GLOBAL, x=round(latitude * 1e7), y=round(longitude * 1e7), z=amsl)


FUNCTIONS: Mapping[int, Callable[[Vehicle, int], None]] = {
    7: _save_waypoint,
    9: picture_by_switch,
    RANGE_FINDER: switch_range_finder,
    11: _fence,
    15: switch_sprayer,
    19: _gripper,
    24: _restart_mission,
    27: retract_by_switch,
    29: switch_gear,
    EMERGENCY_STOP: _emergency_stop,
    SOURCES_OPTION: switch_sources,
    INTERLOCK: _interlock,
    PROXIMITY: _proximity,
    PRECISION_LOITER: switch_loiter,
    44: switch_winch,
    CONTROL: _leave_to_channel,
    46: _overrides,
    58: _clear_mission,
    61: _zigzag,
    163: lock_by_switch,
    **dict.fromkeys((PILOT_ROLL, PILOT_PITCH, PILOT_YAW), _leave_to_channel),
    **{option: partial(_relay, number=number) for number, option in enumerate(RELAY_OPTIONS)},
}
"""RCn_OPTION to what its switch does at a position, but modes, arming and disarming."""

"""ArduPilot's auxiliary functions: what RCn_OPTION assigns to a switch of the transmitter.

The same functions act by a switch that moves, by the command DO_AUX_FUNCTION and by its mission item. A
position is 1 up, 0 in the middle, -1 down. Some functions count as soon as the transmitter is first read:
here emergency stop and motor interlock, both of which keep the motors from turning.
"""

from __future__ import annotations

from volery.simulation.autopilots.ardupilot.feature import ArmingCheck, Feature, MissionCommand, build_of
from volery.simulation.autopilots.ardupilot.mission import mission_grew, path_jerk
from volery.simulation.autopilots.ardupilot.modes import arm, change_mode, disarm
from volery.simulation.autopilots.ardupilot.pilot_input import HIGHEST, LOWEST, sticks_moved, switches_of
from volery.simulation.autopilots.manoeuvres.zigzag import ZigZag
from volery.simulation.autopilots.mavlink.messages import ACCEPTED, DENIED, FAILED, Command
from volery.simulation.autopilots.onboard_mission import (
    DO_AUX_FUNCTION,
    GLOBAL,
    LAND,
    TAKEOFF,
    WAYPOINT,
    MissionItem,
)
from volery.simulation.autopilots.state_groups import NEVER
from volery.simulation.autopilots.vehicle_state import AutopilotVehicle
from volery.trace.events import INFO, NOTICE

UP, DOWN = 1800, 1200
"""Pulse widths [us] beyond which a switch is up or down."""
FIRST_SWITCH = 5

NOTHING, ARMING, DISARMING, EMERGENCY_STOP, INTERLOCK = 0, 153, 81, 31, 32
SAVE_WAYPOINT, RESTART_MISSION, ADMIT_OVERRIDES, CLEAR_MISSION, ZIGZAG_LINE = 7, 24, 46, 58, 61
"""Values of RCn_OPTION."""
LOWEST_TAKEOFF = 1.0
"""Least height of a take-off item that the pilot saves [m]."""


def run_function(vehicle: AutopilotVehicle, function: int, position: int) -> bool:
    """Do what a switch does at a position, and return whether the vehicle has that function."""
    build = build_of(vehicle)
    modes = build.mode_switches
    if function in build.switches:
        build.switches[function](vehicle, position)
    elif function == ARMING and position > 0:
        arm(vehicle)
    elif (function == ARMING and position < 0) or (function == DISARMING and position > 0):
        disarm(vehicle, force=True)
    elif function in modes and position > 0:
        change_mode(vehicle, modes[function])
    elif function in modes and vehicle.mode.number == modes[function]:
        switches_of(vehicle).mode = -1  # the mode switch counts again
    elif function not in modes and function not in (NOTHING, ARMING, DISARMING):
        return False
    update_stop(vehicle)
    return True


def read_switches(vehicle: AutopilotVehicle) -> None:
    """Run the function of each channel whose switch has moved since it was last read."""
    options, at_once = switches_of(vehicle).options, build_of(vehicle).at_once
    for channel in range(FIRST_SWITCH, len(vehicle.rc.transmitter) + 1):
        function, pulse = round(vehicle.parameters[f"RC{channel}_OPTION"]), vehicle.rc[channel]
        if not LOWEST < pulse < HIGHEST:
            continue
        position = (pulse > UP) - (pulse < DOWN)
        before = options.get(channel)
        options[channel] = position
        if before == position or (before is None and function not in at_once):
            continue
        run_function(vehicle, function, position)
    update_stop(vehicle)


def on_function(vehicle: AutopilotVehicle, command: Command) -> int:
    """Handle DO_AUX_FUNCTION: param1 is the function, param2 the position, 0 down to 2 up."""
    function, position = round(command.param1), round(command.param2)
    if position not in (0, 1, 2):
        return DENIED
    if not run_function(vehicle, function, position - 1):
        vehicle.send_text(INFO, f"Invalid channel option ({function})")
        return FAILED
    return ACCEPTED


def act(vehicle: AutopilotVehicle, item: MissionItem) -> None:
    """Execute the mission item DO_AUX_FUNCTION."""
    run_function(vehicle, round(item.param1), round(item.param2) - 1)


def _uses(vehicle: AutopilotVehicle, function: int) -> bool:
    channels = range(FIRST_SWITCH, len(vehicle.rc.transmitter) + 1)
    return any(round(vehicle.parameters[f"RC{channel}_OPTION"]) == function for channel in channels)


def update_stop(vehicle: AutopilotVehicle) -> None:
    """Compute whether emergency stop or interlock keep the motors from turning."""
    switches, arming = switches_of(vehicle), vehicle.arming
    open_ = vehicle.flies and not switches.interlock_closed and _uses(vehicle, INTERLOCK)
    stopped = switches.emergency_stop or open_
    if not stopped:
        arming.motors_stopped_at = NEVER
    elif arming.motors_stopped_at == NEVER:
        arming.motors_stopped_at = vehicle.kernel.now()


def _conflict(vehicle: AutopilotVehicle) -> bool:
    return vehicle.flies and _uses(vehicle, INTERLOCK) and _uses(vehicle, EMERGENCY_STOP)


def _interlock_closed(vehicle: AutopilotVehicle) -> bool:
    return vehicle.flies and switches_of(vehicle).interlock_closed and _uses(vehicle, INTERLOCK)


STOP_CHECKS = (
    ArmingCheck("Motors Emergency Stopped", lambda vehicle: switches_of(vehicle).emergency_stop),
    ArmingCheck("Interlock/E-Stop Conflict", _conflict),
    ArmingCheck("Motor Interlock Enabled", _interlock_closed),
)
"""Arming checks of the two functions; a vehicle is armed with an open interlock, which is closed then."""


def _emergency_stop(vehicle: AutopilotVehicle, position: int) -> None:
    if position:
        switches_of(vehicle).emergency_stop = position > 0


def _interlock(vehicle: AutopilotVehicle, position: int) -> None:
    switches_of(vehicle).interlock_closed = position >= 0


def _overrides(vehicle: AutopilotVehicle, position: int) -> None:
    """Admit or deny the sticks of a ground station; denied ones go back to the transmitter at once."""
    if position:
        switches_of(vehicle).overrides_denied = position < 0
    if position < 0:
        vehicle.rc.release()
        sticks_moved(vehicle)


def _clear_mission(vehicle: AutopilotVehicle, position: int) -> None:
    """Delete the mission, except while it is flown."""
    if position > 0 and not (vehicle.armed and vehicle.mode.name == "AUTO"):
        vehicle.mission.clear()
        mission_grew(vehicle, 0)


def _restart_mission(vehicle: AutopilotVehicle, position: int) -> None:
    if position > 0:
        vehicle.mission.restart()
        vehicle.manoeuvre.item_chosen()


def _save_waypoint(vehicle: AutopilotVehicle, position: int) -> None:
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


def _zigzag(vehicle: AutopilotVehicle, position: int) -> None:
    """Store point A (down) or B (up) of ZIGZAG or fly to its line; in the middle the pilot flies."""
    manoeuvre = vehicle.manoeuvre
    if not isinstance(manoeuvre, ZigZag):
        return
    if position:
        manoeuvre.choose("B" if position > 0 else "A", path_jerk(vehicle))
    else:
        manoeuvre.let_pilot_fly()


def _item_here(vehicle: AutopilotVehicle, command: int) -> MissionItem:
    latitude, longitude, amsl = vehicle.estimate.geodetic
    return MissionItem(command, GLOBAL, x=round(latitude * 1e7), y=round(longitude * 1e7), z=amsl)


COPTER = ROVER = Feature(
    parameters={
        f"RC{channel}_OPTION": ("", "switch: modes, arming, stop, interlock, fence, payload, mission")
        for channel in range(FIRST_SWITCH, 17)
    },
    commands={DO_AUX_FUNCTION: on_function},
    items={DO_AUX_FUNCTION: MissionCommand("AuxFunction", act, silent=True)},
    switches={
        SAVE_WAYPOINT: _save_waypoint,
        RESTART_MISSION: _restart_mission,
        EMERGENCY_STOP: _emergency_stop,
        INTERLOCK: _interlock,
        ADMIT_OVERRIDES: _overrides,
        CLEAR_MISSION: _clear_mission,
        ZIGZAG_LINE: _zigzag,
    },
    at_once=(EMERGENCY_STOP, INTERLOCK),
    checks=STOP_CHECKS,
)

"""ArduPilot's commands: the action of each, and the MAV_RESULT that acknowledges it."""

from __future__ import annotations

from collections.abc import Mapping
from math import isfinite, isnan, pi, radians

from volery.base.frames import wrap
from volery.simulation.autopilots.ardupilot.battery import on_battery_reset
from volery.simulation.autopilots.ardupilot.fence import fence_admits
from volery.simulation.autopilots.ardupilot.modes import (
    FORCE,
    SKIP_CHECKS,
    arm,
    change_mode,
    disarm,
    failing_prearm_checks,
    reports_of,
    set_mode,
)
from volery.simulation.autopilots.manoeuvres.guided_flight import Guided, Turn
from volery.simulation.autopilots.manoeuvres.manual_flight import Loiter
from volery.simulation.autopilots.manoeuvres.onboard_mission_flight import FlyMission
from volery.simulation.autopilots.manoeuvres.rover_driving import GuidedRover
from volery.simulation.autopilots.manoeuvres.to_point import bearing
from volery.simulation.autopilots.mavlink.messages import (
    ACCEPTED,
    DENIED,
    FAILED,
    TEMPORARILY_REJECTED,
    UNSUPPORTED,
    Command,
    Handler,
    all_within,
)
from volery.simulation.autopilots.onboard_mission import (
    GLOBAL,
    GLOBAL_INT,
    GLOBAL_RELATIVE,
    GLOBAL_RELATIVE_INT,
    GLOBAL_TERRAIN,
    GLOBAL_TERRAIN_INT,
    JUMP_TAG,
    MissionItem,
)
from volery.simulation.autopilots.vehicle_state import AutopilotVehicle
from volery.trace.events import CRITICAL, INFO, NOTICE, WARNING

LOITER_UNLIMITED, RETURN, LAND, TAKEOFF = 17, 20, 21, 22
CONDITION_YAW, DO_SET_MODE, CHANGE_SPEED, SET_HOME = 115, 176, 178, 179
FLIGHT_TERMINATION, REPOSITION, PAUSE_CONTINUE, SET_YAW_SPEED, SET_MISSION_CURRENT = 185, 192, 193, 213, 224
SET_REVERSE, RUN_PREARM_CHECKS = 194, 401
START_MAG_CAL, ACCEPT_MAG_CAL, CANCEL_MAG_CAL = 42424, 42425, 42426
BATTERY_RESET, VTOL_LAND, JUMP_TO_TAG = 42651, 85, 601
CALIBRATION, STORAGE, REBOOT, MISSION_START, ARM_DISARM, GET_HOME = 241, 245, 246, 300, 400, 410

HIGHEST = 83_000.0
"""Largest altitude that a location can hold [m] (LOCATION_ALT_MAX_M)."""

FARTHEST_POINT = 2.1e7
"""Largest distance of a target that is flown towards [m]: any point of the globe."""

SPEED_OVER_GROUND = (0, 1)
CLIMB_SPEED, DESCENT_SPEED = 2, 3
"""Values of param1 of DO_CHANGE_SPEED."""


def on_arm(vehicle: AutopilotVehicle, command: Command) -> int:
    """Handle COMPONENT_ARM_DISARM."""
    magic = round(command.param2)
    if command.param1 == 1.0:
        return arm(vehicle, force=magic in (FORCE, SKIP_CHECKS))
    if command.param1 == 0.0:
        return disarm(vehicle, force=magic == FORCE)
    return UNSUPPORTED


def on_set_mode(vehicle: AutopilotVehicle, command: Command) -> int:
    """Handle DO_SET_MODE."""
    return set_mode(vehicle, round(command.param1), round(command.param2))


def number_of(vehicle: AutopilotVehicle, name: str) -> int:
    """Return the number of a mode that every vehicle of that kind has."""
    return next(number for number, mode in vehicle.rules.modes.items() if mode.name == name)


def to_mode(name: str) -> Handler:
    """Return the handler of a command that only enters the mode of that name."""

    def handle(vehicle: AutopilotVehicle, _command: Command) -> int:
        return ACCEPTED if change_mode(vehicle, number_of(vehicle, name)) else FAILED

    return handle


def on_takeoff(vehicle: AutopilotVehicle, command: Command) -> int:
    """Handle NAV_TAKEOFF: requires an armed vehicle on the ground in a mode that supports a take-off."""
    if command.frame != GLOBAL_RELATIVE:
        return DENIED
    if (
        not vehicle.armed
        or not vehicle.landed
        or not vehicle.mode.user_takeoff
        or not vehicle.height < command.z < HIGHEST
    ):
        return FAILED
    manoeuvre = vehicle.manoeuvre
    if isinstance(manoeuvre, Guided | Loiter):
        manoeuvre.take_off(command.z)
        return ACCEPTED
    return FAILED


def on_mission_start(vehicle: AutopilotVehicle, _command: Command) -> int:
    """Handle MISSION_START: enter AUTO and allow the take-off."""
    if not vehicle.armed or not change_mode(vehicle, number_of(vehicle, "AUTO")):
        return FAILED
    manoeuvre = vehicle.manoeuvre
    if isinstance(manoeuvre, FlyMission):
        manoeuvre.start()
    return ACCEPTED


def on_change_speed(vehicle: AutopilotVehicle, command: Command) -> int:
    """Handle DO_CHANGE_SPEED; a rover has a speed of its own only on the way to a point."""
    guided = vehicle.manoeuvre.flown
    drives_itself = bool(vehicle.mode.controls) and not vehicle.mode.pilot
    if not vehicle.flies and not drives_itself:
        return FAILED
    if isinstance(guided, GuidedRover) and guided.target is None:
        return FAILED
    return ACCEPTED if change_speed(vehicle, round(command.param1), command.param2) else FAILED


def change_speed(vehicle: AutopilotVehicle, kind: int, speed: float) -> bool:
    """Set a speed that holds until the mode changes, and return whether it is valid.

    Args:
        vehicle: The vehicle.
        kind: param1 of DO_CHANGE_SPEED: 0 and 1 over ground, 2 climb, 3 descent.
        speed: Speed [m/s], positive.
    """
    if not isfinite(speed) or speed <= 0.0:
        return False
    if kind in SPEED_OVER_GROUND:
        vehicle.commanded.speed = speed
    elif kind == CLIMB_SPEED:
        vehicle.commanded.speed_up = speed
    elif kind == DESCENT_SPEED:
        vehicle.commanded.speed_down = speed
    else:
        return False
    return True


def on_condition_yaw(vehicle: AutopilotVehicle, command: Command) -> int:
    """Handle CONDITION_YAW: an absolute heading or a relative angle."""
    if not 0.0 <= command.param1 <= 360.0 or command.param4 not in (0.0, 1.0):
        return FAILED
    turn_to(vehicle, command.param1, command.param2, command.param3, relative=command.param4 == 1.0)
    return ACCEPTED


SLEW_YAW = 60.0
"""ATC_SLEW_YAW: fastest turn to a heading [deg/s], and the rate where a command names none."""


def turn_to(vehicle: AutopilotVehicle, degrees: float, rate: float, direction: float, relative: bool) -> None:
    """Turn to a heading in modes that the autopilot flies.

    Args:
        vehicle: The vehicle.
        degrees: Heading from north, or angle to turn by [deg], clockwise.
        rate: Turn rate [deg/s]; not positive: the fastest.
        direction: Negative turns anticlockwise, positive clockwise; 0 turns the shorter way to a heading, and
            clockwise by an angle.
        relative: Whether ``degrees`` counts from the present heading.
    """
    commanded = vehicle.commanded
    commanded.look_at = None
    now = vehicle.estimate.attitude[2] if commanded.yaw is None else commanded.yaw
    if relative:
        left = -radians(degrees) if direction < 0.0 else radians(degrees)
    else:
        left = wrap(radians(degrees) - now)
        if direction < 0.0 < left:
            left -= 2.0 * pi
        elif direction > 0.0 > left:
            left += 2.0 * pi
    commanded.yaw, commanded.yaw_left = now, left
    commanded.yaw_rate = radians(min(SLEW_YAW, rate) if rate > 0.0 else SLEW_YAW)


def continue_turn(vehicle: AutopilotVehicle, seconds: float) -> None:
    """Move the commanded heading along its turn by some seconds, or keep it on the region of interest."""
    commanded = vehicle.commanded
    if commanded.look_at is not None:
        commanded.yaw, commanded.yaw_left = bearing(vehicle.estimate.position, commanded.look_at), 0.0
    if commanded.yaw is None or not commanded.yaw_left:
        return
    most = commanded.yaw_rate * seconds
    passed = min(most, max(-most, commanded.yaw_left))
    commanded.yaw = wrap(commanded.yaw + passed)
    commanded.yaw_left -= passed


def on_set_home(vehicle: AutopilotVehicle, command: Command) -> int:
    """Handle DO_SET_HOME. The altitude is AMSL in COMMAND_LONG and follows the frame in COMMAND_INT."""
    if command.param1 == 1.0 or (command.x == 0.0 and command.y == 0.0):
        if not vehicle.has_position:
            return FAILED
        vehicle.set_home_here(by_user=True)
    else:
        if not is_place(command):
            return DENIED
        relative = command.is_int and command.frame not in (GLOBAL, 5)
        base = vehicle.home.amsl if relative and vehicle.home else 0.0
        vehicle.set_home(command.x, command.y, base + command.z, by_user=True)
    return ACCEPTED


def is_place(command: Command) -> bool:
    """Return whether a command has a place and a height that a location can hold."""
    return abs(command.x) <= 90.0 and abs(command.y) <= 180.0 and abs(command.z) < HIGHEST


PLACE_FRAMES = (GLOBAL, GLOBAL_INT, GLOBAL_RELATIVE, GLOBAL_RELATIVE_INT, GLOBAL_TERRAIN, GLOBAL_TERRAIN_INT)


def _means_here(command: Command) -> bool:
    """Return whether a place or a height of 0 would mean the present one (Location::sanitize)."""
    level = command.frame not in (GLOBAL, GLOBAL_INT) and command.z == 0.0
    return (command.x == 0.0 and command.y == 0.0) or level


def on_reposition(vehicle: AutopilotVehicle, command: Command) -> int:
    """Handle DO_REPOSITION (COMMAND_INT only): flag 1 allows a change to GUIDED; copters ignore the speed."""
    guided = number_of(vehicle, "GUIDED")
    if not command.is_int:
        return UNSUPPORTED
    if vehicle.mode.number != guided and not round(command.param2) & 1:
        return DENIED
    if not is_place(command) or command.frame not in PLACE_FRAMES or _means_here(command):
        return DENIED
    if not fence_admits(vehicle, vehicle.point(command.frame, command.x, command.y, command.z)):
        return FAILED
    if vehicle.mode.number != guided and not change_mode(vehicle, guided):
        return FAILED
    if command.param1 > 0.0 and not vehicle.flies:
        vehicle.commanded.speed = command.param1
    yaw = None if isnan(command.param4) or not vehicle.flies else command.param4
    return ACCEPTED if go_to(vehicle, command.frame, (command.x, command.y, command.z), yaw) else FAILED


def go_to(
    vehicle: AutopilotVehicle, frame: int, place: tuple[float, float, float], yaw: float | None = None
) -> bool:
    """Send a vehicle in GUIDED to a point, and return whether that was possible.

    Args:
        vehicle: The vehicle.
        frame: MAV_FRAME of the altitude.
        place: Latitude and longitude [deg], altitude [m].
        yaw: Heading [rad], or None to leave it to the firmware.
    """
    point = vehicle.point(frame, *place)
    if not all_within(point, FARTHEST_POINT) or not fence_admits(vehicle, point):
        return False
    manoeuvre = vehicle.manoeuvre.flown
    if isinstance(manoeuvre, Guided):
        manoeuvre.go_to(point, Turn(yaw))
    elif isinstance(manoeuvre, GuidedRover):
        manoeuvre.go_to(point)
    else:
        return False
    return True


def go_to_item(vehicle: AutopilotVehicle, item: MissionItem) -> bool:
    """Fly to a mission item with ``current`` 2, the deprecated form of a guided target."""
    return item.has_place and go_to(vehicle, item.frame, (item.x / 1e7, item.y / 1e7, item.z))


def on_set_yaw_speed(vehicle: AutopilotVehicle, command: Command) -> int:
    """Handle NAV_SET_YAW_SPEED of a rover: heading [deg] and speed [m/s].

    With a positive param3 the angle adds to the heading that was last asked for.
    """
    manoeuvre = vehicle.manoeuvre.flown
    if not isinstance(manoeuvre, GuidedRover):
        return FAILED
    heading = radians(command.param1)
    if command.param3 > 0.0:
        asked = manoeuvre.asked_heading
        heading += vehicle.estimate.attitude[2] if asked is None else asked
    manoeuvre.follow_speed(command.param2, Turn(yaw=wrap(heading)))
    return ACCEPTED


def on_reverse(vehicle: AutopilotVehicle, command: Command) -> int:
    """Handle DO_SET_REVERSE of a rover: 1 drives to points backwards, until the mode changes."""
    vehicle.commanded.backwards = command.param1 == 1.0
    return ACCEPTED


def on_termination(vehicle: AutopilotVehicle, command: Command) -> int:
    """Handle DO_FLIGHTTERMINATION: stop the motors, also in flight."""
    return disarm(vehicle, force=True) if command.param1 > 0.5 else FAILED


def on_set_current(vehicle: AutopilotVehicle, command: Command) -> int:
    """Handle DO_SET_MISSION_CURRENT."""
    return ACCEPTED if vehicle.choose_item(round(command.param1)) else DENIED


LARGEST_TAG = 65_535


def on_jump_to_tag(vehicle: AutopilotVehicle, command: Command) -> int:
    """Handle DO_JUMP_TAG: make the first mission item JUMP_TAG with that number the current one."""
    if not 0.0 <= command.param1 <= LARGEST_TAG:
        return DENIED
    tag = int(command.param1)
    items = enumerate(vehicle.mission.items)
    places = (place for place, item in items if item.command == JUMP_TAG and int(item.param1) == tag)
    place = next(places, None)
    return ACCEPTED if place is not None and vehicle.choose_item(place) else FAILED


KEPT_CALIBRATION = 76.0
"""Value that makes the calibration in force count as valid."""
ERASE = 2.0


def on_calibration(vehicle: AutopilotVehicle, command: Command) -> int:
    """Handle PREFLIGHT_CALIBRATION: of gyroscopes and barometer, for which nothing has to be moved."""
    if vehicle.armed:
        vehicle.send_text(NOTICE, "Disarm to allow calibration")
        return FAILED
    if command.param1 == 1.0:
        return ACCEPTED
    if command.param3 == 1.0:
        vehicle.send_text(INFO, "Updating barometer calibration")
        vehicle.send_text(INFO, "Barometer calibration complete")
        return ACCEPTED
    return ACCEPTED if KEPT_CALIBRATION in (command.fifth, command.param2) else UNSUPPORTED


def on_storage(vehicle: AutopilotVehicle, command: Command) -> int:
    """Handle PREFLIGHT_STORAGE: 2 erases the parameters, which have their defaults from the next boot on."""
    if command.param1 != ERASE:
        return DENIED
    reports_of(vehicle).parameters_erased = True
    vehicle.send_text(WARNING, "All parameters reset, reboot board")
    return ACCEPTED


def on_compass_calibration(_vehicle: AutopilotVehicle, _command: Command) -> int:
    """Refuse the commands that begin and accept a calibration of the compass: it would have no effect."""
    return FAILED


def on_reboot(vehicle: AutopilotVehicle, command: Command) -> int:
    """Handle PREFLIGHT_REBOOT_SHUTDOWN: 1 and 3 restart after the answer; an armed vehicle needs force."""
    if round(command.param1) not in (1, 3):
        return UNSUPPORTED
    if vehicle.armed and command.y != 20_190_226.0:
        return FAILED
    if reports_of(vehicle).parameters_erased:
        vehicle.parameters.reset()
    vehicle.parameters.set("STAT_BOOTCNT", vehicle.parameters["STAT_BOOTCNT"] + 1.0)
    vehicle.output.after_reply(vehicle.restart)
    return ACCEPTED


def on_get_home(vehicle: AutopilotVehicle, _command: Command) -> int:
    """Handle GET_HOME_POSITION."""
    if vehicle.home is None:
        return FAILED
    vehicle.output.send_message("HOME_POSITION")
    return ACCEPTED


def on_pause(vehicle: AutopilotVehicle, command: Command) -> int:
    """Handle DO_PAUSE_CONTINUE: 0 pauses, 1 continues."""
    if command.param1 not in (0.0, 1.0):
        return DENIED
    done = vehicle.manoeuvre.resume() if command.param1 else vehicle.manoeuvre.pause()
    if not done:
        vehicle.send_text(INFO, f"Failed to {'resume' if command.param1 else 'pause'}")
    return ACCEPTED if done else FAILED


def on_prearm_checks(vehicle: AutopilotVehicle, _command: Command) -> int:
    """Handle RUN_PREARM_CHECKS: make the checks of arming and report those that fail."""
    if vehicle.armed:
        return TEMPORARILY_REJECTED
    for text in failing_prearm_checks(vehicle):
        vehicle.send_text(CRITICAL, f"PreArm: {text}")
    return ACCEPTED


SHARED_COMMANDS: Mapping[int, Handler] = {
    ARM_DISARM: on_arm,
    DO_SET_MODE: on_set_mode,
    MISSION_START: on_mission_start,
    CHANGE_SPEED: on_change_speed,
    SET_HOME: on_set_home,
    GET_HOME: on_get_home,
    REPOSITION: on_reposition,
    SET_MISSION_CURRENT: on_set_current,
    FLIGHT_TERMINATION: on_termination,
    CALIBRATION: on_calibration,
    STORAGE: on_storage,
    REBOOT: on_reboot,
    RUN_PREARM_CHECKS: on_prearm_checks,
    START_MAG_CAL: on_compass_calibration,
    ACCEPT_MAG_CAL: on_compass_calibration,
    CANCEL_MAG_CAL: lambda _vehicle, _command: ACCEPTED,
    BATTERY_RESET: on_battery_reset,
    JUMP_TO_TAG: on_jump_to_tag,
}
"""Commands of the core that copter and rover share."""

COPTER_COMMANDS: Mapping[int, Handler] = {
    **SHARED_COMMANDS,
    TAKEOFF: on_takeoff,
    LAND: to_mode("LAND"),
    VTOL_LAND: to_mode("LAND"),
    RETURN: to_mode("RTL"),
    LOITER_UNLIMITED: to_mode("LOITER"),
    CONDITION_YAW: on_condition_yaw,
    PAUSE_CONTINUE: on_pause,
}
ROVER_COMMANDS: Mapping[int, Handler] = {
    **SHARED_COMMANDS,
    RETURN: to_mode("RTL"),
    SET_YAW_SPEED: on_set_yaw_speed,
    SET_REVERSE: on_reverse,
}

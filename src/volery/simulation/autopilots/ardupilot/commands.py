"""ArduPilot's commands: what each does and with which MAV_RESULT it is acknowledged."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from functools import partial
from math import isfinite, isnan, nan, radians

from volery.base.frames import wrap
from volery.simulation.autopilots.ardupilot.modes import (
    FORCE,
    SKIP_CHECKS,
    arm,
    change_mode,
    disarm,
    set_mode,
)
from volery.simulation.autopilots.manoeuvres.guided_flight import Guided, Turn
from volery.simulation.autopilots.manoeuvres.manual_flight import Loiter
from volery.simulation.autopilots.manoeuvres.onboard_mission_flight import FlyMission
from volery.simulation.autopilots.manoeuvres.rover_driving import GuidedRover
from volery.simulation.autopilots.mavlink.command import (
    ACCEPTED,
    DENIED,
    FAILED,
    UNSUPPORTED,
    Command,
    Handler,
)
from volery.simulation.autopilots.mavlink.message_fields import FARTHEST, all_within
from volery.simulation.autopilots.onboard_mission import GLOBAL, GLOBAL_RELATIVE, MissionItem
from volery.simulation.autopilots.vehicle_state import Vehicle

LOITER_UNLIMITED, RETURN, LAND, TAKEOFF = 17, 20, 21, 22
CONDITION_YAW, DO_SET_MODE, CHANGE_SPEED, SET_HOME = 115, 176, 178, 179
FLIGHT_TERMINATION, REPOSITION, PAUSE_CONTINUE, SET_YAW_SPEED, SET_MISSION_CURRENT = 185, 192, 193, 213, 224
CALIBRATION, STORAGE, REBOOT, MISSION_START, ARM_DISARM, GET_HOME = 241, 245, 246, 300, 400, 410

HIGHEST = 83_000.0
"""Metres up or down that a location can hold (LOCATION_ALT_MAX_M)."""

Problems = Callable[[Vehicle], list[str]]

SPEED_OVER_GROUND = (0, 1)
CLIMB_SPEED, DESCENT_SPEED = 2, 3
"""param1 of DO_CHANGE_SPEED."""


def on_arm(vehicle: Vehicle, command: Command, problems: Problems, words: tuple[str, str]) -> int:
    """COMPONENT_ARM_DISARM."""
    magic = round(command.param2)
    if command.param1 == 1.0:
        return arm(vehicle, problems, words[0], magic in (FORCE, SKIP_CHECKS))
    if command.param1 == 0.0:
        return disarm(vehicle, words[1], magic == FORCE)
    return UNSUPPORTED


def on_set_mode(vehicle: Vehicle, command: Command) -> int:
    """DO_SET_MODE."""
    return set_mode(vehicle, round(command.param1), round(command.param2))


def to_mode(number: int) -> Handler:
    """A command that is a mode."""

    def handle(vehicle: Vehicle, _command: Command) -> int:
        return ACCEPTED if change_mode(vehicle, number) else FAILED

    return handle


def on_takeoff(vehicle: Vehicle, command: Command) -> int:
    """NAV_TAKEOFF: armed, standing, in a mode that takes off; refused without a word otherwise."""
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


def on_mission_start(vehicle: Vehicle, _command: Command) -> int:
    """MISSION_START: AUTO, and off the ground if it is armed."""
    auto = next(number for number, mode in vehicle.rules.modes.items() if mode.name == "AUTO")
    if not vehicle.armed or not change_mode(vehicle, auto):
        return FAILED
    manoeuvre = vehicle.manoeuvre
    if isinstance(manoeuvre, FlyMission):
        manoeuvre.start()
    return ACCEPTED


def on_change_speed(vehicle: Vehicle, command: Command) -> int:
    """DO_CHANGE_SPEED."""
    return ACCEPTED if change_speed(vehicle, round(command.param1), command.param2) else FAILED


def change_speed(vehicle: Vehicle, kind: int, speed: float) -> bool:
    """Fly at another speed until the mode changes."""
    if not isfinite(speed) or speed <= 0.0:
        return False
    if kind in SPEED_OVER_GROUND:
        vehicle.speed = speed
    elif kind == CLIMB_SPEED:
        vehicle.speed_up = speed
    elif kind == DESCENT_SPEED:
        vehicle.speed_down = speed
    else:
        return False
    return True


def on_condition_yaw(vehicle: Vehicle, command: Command) -> int:
    """CONDITION_YAW: to a heading, or by an angle."""
    if not 0.0 <= command.param1 <= 360.0 or command.param4 not in (0.0, 1.0):
        return FAILED
    turn_to(vehicle, command.param1, command.param3, relative=command.param4 == 1.0)
    return ACCEPTED


def turn_to(vehicle: Vehicle, degrees: float, direction: float, relative: bool) -> None:
    """Point the nose there, in modes that the autopilot flies. The shorter way round."""
    angle = radians(degrees)
    if relative:
        now = vehicle.estimate.attitude[2]
        angle = now + (-angle if direction < 0.0 else angle)
    vehicle.yaw_target = wrap(angle)


def on_set_home(vehicle: Vehicle, command: Command) -> int:
    """DO_SET_HOME: here, or at a place whose altitude is AMSL (long form) or in the frame of the int form."""
    if command.param1 == 1.0:
        if not vehicle.has_position:
            return FAILED
        vehicle.home_is_here()
    else:
        if not _is_place(command) or (command.x == 0.0 and command.y == 0.0):
            return DENIED
        relative = command.is_int and command.frame not in (GLOBAL, 5)
        base = vehicle.home.amsl if relative and vehicle.home else 0.0
        vehicle.set_home(command.x, command.y, base + command.z)
    vehicle.home_by_user = True
    return ACCEPTED


def _is_place(command: Command) -> bool:
    return abs(command.x) <= 90.0 and abs(command.y) <= 180.0 and abs(command.z) < HIGHEST


def on_reposition(vehicle: Vehicle, command: Command, guided: int) -> int:
    """DO_REPOSITION: only as COMMAND_INT; into GUIDED if the first flag says so."""
    if not command.is_int:
        return UNSUPPORTED
    if not _is_place(command):
        return DENIED
    if vehicle.mode.number != guided:
        if not round(command.param2) & 1:
            return DENIED
        if not change_mode(vehicle, guided):
            return FAILED
    if command.param1 > 0.0:
        vehicle.speed = command.param1
    yaw = None if isnan(command.param4) or not vehicle.flies else command.param4
    return ACCEPTED if go_to(vehicle, command.frame, (command.x, command.y, command.z), yaw) else FAILED


def go_to(vehicle: Vehicle, frame: int, place: tuple[float, float, float], yaw: float | None = None) -> bool:
    """In GUIDED: go to latitude, longitude [degrees] and altitude [m] in a MAVLink frame."""
    point = vehicle.point(frame, *place)
    if not all_within(point, FARTHEST):
        return False
    manoeuvre = vehicle.manoeuvre
    if isinstance(manoeuvre, Guided):
        manoeuvre.go_to(point, Turn(yaw))
    elif isinstance(manoeuvre, GuidedRover):
        manoeuvre.go_to(point)
    else:
        return False
    return True


def go_to_item(vehicle: Vehicle, item: MissionItem) -> bool:
    """A mission item with ``current`` 2: the old way to command GUIDED."""
    return item.has_place and go_to(vehicle, item.frame, (item.x / 1e7, item.y / 1e7, item.z))


def on_set_yaw_speed(vehicle: Vehicle, command: Command) -> int:
    """NAV_SET_YAW_SPEED of a rover: degrees (relative if param3), m/s."""
    manoeuvre = vehicle.manoeuvre
    if not isinstance(manoeuvre, GuidedRover):
        return FAILED
    heading = radians(command.param1)
    if command.param3 > 0.0:
        heading += vehicle.estimate.attitude[2]
    manoeuvre.follow_speed(command.param2, Turn(yaw=wrap(heading)))
    return ACCEPTED


def on_termination(vehicle: Vehicle, command: Command, words: str) -> int:
    """DO_FLIGHTTERMINATION: motors off, wherever it is."""
    return disarm(vehicle, words, force=True) if command.param1 > 0.5 else FAILED


def on_set_current(vehicle: Vehicle, command: Command) -> int:
    """DO_SET_MISSION_CURRENT."""
    return ACCEPTED if vehicle.choose_item(round(command.param1)) else DENIED


def on_calibration(vehicle: Vehicle, _command: Command) -> int:
    """PREFLIGHT_CALIBRATION: nothing to calibrate, but not while armed."""
    return FAILED if vehicle.armed else ACCEPTED


def on_reboot(vehicle: Vehicle, command: Command) -> int:
    """PREFLIGHT_REBOOT_SHUTDOWN: 1 and 3 restart, in place, once the answer is out; not while armed without
    force.
    """
    if round(command.param1) not in (1, 3):
        return UNSUPPORTED
    if vehicle.armed and round(command.y) != 20_190_226:
        return FAILED
    vehicle.outlet.after_answer(vehicle.restart)
    return ACCEPTED


def on_get_home(vehicle: Vehicle, _command: Command) -> int:
    """GET_HOME_POSITION."""
    if vehicle.home is None:
        return FAILED
    vehicle.outlet.announce("HOME_POSITION")
    return ACCEPTED


def shared_commands(problems: Problems, words: tuple[str, str], guided: int) -> dict[int, Handler]:
    """Commands that copter and rover have alike. *words* are said on arming and on disarming."""
    return {
        ARM_DISARM: lambda vehicle, command: on_arm(vehicle, command, problems, words),
        DO_SET_MODE: on_set_mode,
        MISSION_START: on_mission_start,
        CHANGE_SPEED: on_change_speed,
        SET_HOME: on_set_home,
        GET_HOME: on_get_home,
        REPOSITION: partial(on_reposition, guided=guided),
        SET_MISSION_CURRENT: on_set_current,
        FLIGHT_TERMINATION: partial(on_termination, words=words[1]),
        CALIBRATION: on_calibration,
        STORAGE: on_calibration,
        REBOOT: on_reboot,
    }


def copter_commands(
    problems: Problems, words: tuple[str, str], modes: Mapping[str, int]
) -> dict[int, Handler]:
    """All of a copter's. *modes* gives the numbers of the modes that commands enter."""
    return {
        **shared_commands(problems, words, modes["GUIDED"]),
        TAKEOFF: on_takeoff,
        LAND: to_mode(modes["LAND"]),
        RETURN: to_mode(modes["RTL"]),
        LOITER_UNLIMITED: to_mode(modes["LOITER"]),
        CONDITION_YAW: on_condition_yaw,
    }


def rover_commands(
    problems: Problems, words: tuple[str, str], modes: Mapping[str, int]
) -> dict[int, Handler]:
    """All of a rover's."""
    return {
        **shared_commands(problems, words, modes["GUIDED"]),
        RETURN: to_mode(modes["RTL"]),
        SET_YAW_SPEED: on_set_yaw_speed,
    }


NO_YAW = nan
"""param4 that leaves the heading alone."""

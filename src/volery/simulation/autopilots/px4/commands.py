"""PX4's commands with the MAV_RESULT that acknowledges each, and the messages that need no acknowledgement.

The latter are heartbeats, manual control and set-points.
"""

from __future__ import annotations

from collections.abc import Mapping
from functools import partial
from math import isfinite, isnan
from typing import Any, Protocol, runtime_checkable

from volery.base.frames import Vector
from volery.base.time import US, Ns, S
from volery.simulation.autopilots.mavlink.channel import GROUND_STATION
from volery.simulation.autopilots.mavlink.firmware import MessageHandler
from volery.simulation.autopilots.mavlink.messages import (
    ACCEPTED,
    DENIED,
    FARTHEST,
    TEMPORARILY_REJECTED,
    UNSUPPORTED,
    Command,
    Handler,
    all_within,
)
from volery.simulation.autopilots.onboard_mission import GLOBAL_INT
from volery.simulation.autopilots.px4 import event_interface, failsafes, modes, offboard
from volery.simulation.autopilots.px4.flight_modes import Hold
from volery.simulation.autopilots.px4.modes import FORCE, OFFBOARD_LOST, CommanderState, commander_of
from volery.simulation.autopilots.px4.offboard import deflection, set_rc_channels
from volery.simulation.autopilots.vehicle_state import AutopilotVehicle
from volery.trace.events import CRITICAL, INFO

RETURN, LAND, TAKEOFF, ORBIT = 20, 21, 22, 34
DO_SET_MODE, CHANGE_SPEED, SET_HOME, FLIGHT_TERMINATION, REPOSITION = 176, 178, 179, 185, 192
STORAGE, REBOOT, MISSION_START, ARM_DISARM, REQUEST_PROTOCOL = 245, 246, 300, 400, 519
ROI_LOCATION, ROI_NONE, ROI, GET_HOME, RUN_CHECKS, GRIPPER = 195, 197, 201, 410, 401, 211
WINCH, INJECT_FAILURE = 42_600, 420
GRIPPER_ACTIONS = (0, 1)
CALIBRATION = 241
SAVE = 1
"""PREFLIGHT_STORAGE that saves the parameters."""

BATTERY_UNIT, MOTOR_UNIT = 100, 101
"""FAILURE_UNIT."""
WORKS, IS_OFF, IS_WRONG = 0, 1, 4
"""FAILURE_TYPE."""

COMMANDER_AFTER: Ns = 3_500 * US
"""Time after which the commander acknowledges what the receiver has acknowledged: recorded, 0 to 8 ms."""

CUSTOM_MODE_ENABLED = 1

MISSION_PLANNER = 190
"""MAV_COMP_ID_MISSIONPLANNER: the component to which the refusal of a mode is explained."""

CHANGE_MODE = 1
"""MAV_DO_REPOSITION_FLAGS."""

SPEED_OVER_GROUND = (0, 1)
USUAL_SPEED = -1.0


def to_integer(value: float) -> int:
    """Return the nearest integer, or -1 for a value that is not finite."""
    return round(value) if isfinite(value) else -1


def on_set_mode(vehicle: AutopilotVehicle, command: Command) -> int:
    """Handle DO_SET_MODE (main and sub-mode).

    A disarmed vehicle accepts everything; invalid modes have no effect.
    """
    if not to_integer(command.param1) & CUSTOM_MODE_ENABLED:
        return ACCEPTED if not vehicle.armed else UNSUPPORTED
    main, sub = to_integer(command.param2), to_integer(command.param3)
    if not 0 <= main <= 255 or not 0 <= sub <= 255:
        return ACCEPTED if not vehicle.armed else UNSUPPORTED
    commander = commander_of(vehicle)
    result = commander.request_mode(
        modes.custom_mode(main, sub), says_why=command.sender[1] == MISSION_PLANNER
    )
    if not commander.version.mode_acknowledged_twice:
        return result
    system, component = command.sender
    fields = {
        "command": DO_SET_MODE,
        "result": result,
        "target_system": system,
        "target_component": component,
    }
    now = vehicle.kernel.now()
    vehicle.kernel.call_at(now + COMMANDER_AFTER, lambda: vehicle.output.send_event("COMMAND_ACK", fields))
    return ACCEPTED


def set_mode(vehicle: AutopilotVehicle, _base_mode: int, number: int) -> int:
    """Handle SET_MODE."""
    main, sub = modes.main_and_sub(number)
    return commander_of(vehicle).request_mode(modes.custom_mode(main, sub))


def on_arm(vehicle: AutopilotVehicle, command: Command) -> int:
    """Handle COMPONENT_ARM_DISARM."""
    if command.param1 == 1.0:
        return commander_of(vehicle).arm()
    if command.param1 == 0.0:
        return commander_of(vehicle).disarm(force=to_integer(command.param2) == FORCE)
    return UNSUPPORTED


def on_takeoff(vehicle: AutopilotVehicle, command: Command) -> int:
    """Handle NAV_TAKEOFF (altitude AMSL). A disarmed vehicle accepts it and takes off when armed."""
    commander = commander_of(vehicle)
    if vehicle.armed and not commander.can_fly(modes.TAKEOFF):
        return TEMPORARILY_REJECTED
    commander.takeoff_amsl = command.z if isfinite(command.z) and command.z != 0.0 else None
    commander.restart_mode(modes.TAKEOFF)
    return ACCEPTED


def on_land(vehicle: AutopilotVehicle, _command: Command) -> int:
    """Handle NAV_LAND: land at the present position."""
    commander = commander_of(vehicle)
    if commander.request_mode(modes.LAND) != ACCEPTED:
        return TEMPORARILY_REJECTED
    vehicle.send_text(INFO, "Landing at current position\t")
    commander.log.send(event_interface.LANDING_HERE)
    return ACCEPTED


def on_return(vehicle: AutopilotVehicle, _command: Command) -> int:
    """Handle NAV_RETURN_TO_LAUNCH."""
    commander = commander_of(vehicle)
    if vehicle.armed and not commander.can_fly(modes.RTL):
        vehicle.send_text(CRITICAL, "Return to launch denied\t")
        return TEMPORARILY_REJECTED
    vehicle.send_text(INFO, "Returning to launch\t")
    commander.log.send(event_interface.RETURNING)
    return commander.request_mode(modes.RTL)


def commanded_point(vehicle: AutopilotVehicle, command: Command) -> Vector | None:
    """Return the point of a command, with the vehicle's own values where it gives none; None if invalid.

    Only NaN stands for none: 0 and 0 are a place, as for the original (navigator_main.cpp).
    """
    latitude, longitude, amsl = vehicle.estimate.geodetic
    if isfinite(command.x) and isfinite(command.y):
        latitude, longitude = command.x, command.y
    if isfinite(command.z):
        amsl = command.z
    if abs(latitude) > 90.0 or abs(longitude) > 180.0:
        return None
    point = vehicle.point(GLOBAL_INT, latitude, longitude, amsl)
    return point if all_within(point, FARTHEST) else None


def on_reposition(vehicle: AutopilotVehicle, command: Command) -> int:
    """Handle DO_REPOSITION.

    Without its flag the command is refused, and in AUTO.LOITER flown nevertheless, as recorded. Beyond the
    geofence it is accepted, and the vehicle holds its position.
    """
    commander = commander_of(vehicle)
    point = commanded_point(vehicle, command)
    if point is None or not vehicle.has_position:
        return DENIED
    heading = None if isnan(command.param4) else command.param4
    flagged = to_integer(command.param2) == CHANGE_MODE
    if not flagged:
        holding = vehicle.manoeuvre
        loiters = vehicle.mode.number == modes.LOITER and vehicle.armed
        if loiters and isinstance(holding, Hold) and failsafes.fence_admits(vehicle, point):
            _move_hold(holding, point, heading, command.param1)
        return UNSUPPORTED
    speed = vehicle.commanded.speed
    commander.restart_mode(modes.LOITER)
    holding = vehicle.manoeuvre
    if isinstance(holding, Hold) and failsafes.fence_admits(vehicle, point):
        vehicle.commanded.speed = speed
        _move_hold(holding, point, heading, command.param1)
    return ACCEPTED


def _move_hold(holding: Hold, point: Vector, heading: float | None, speed: float) -> None:
    holding.point = holding.target = point
    holding.yaw = heading
    if isfinite(speed) and speed > 0.0:
        holding.speed = speed


def on_change_speed(vehicle: AutopilotVehicle, command: Command) -> int:
    """Handle DO_CHANGE_SPEED: speed over ground; -1 returns to the usual one."""
    valid = command.param2 > 0.0 or command.param2 == USUAL_SPEED
    if to_integer(command.param1) not in SPEED_OVER_GROUND or not valid:
        return DENIED
    vehicle.commanded.speed = command.param2 if command.param2 > 0.0 else None
    return ACCEPTED


HIGHEST_HOME = 1e6
"""Largest altitude of home that is accepted [m]: heights above it fit into 32 bits as mm."""


def on_set_home(vehicle: AutopilotVehicle, command: Command) -> int:
    """Handle DO_SET_HOME."""
    if command.param1 == 1.0:
        if not vehicle.has_position:
            return TEMPORARILY_REJECTED
        vehicle.set_home_here(by_user=True)
        return ACCEPTED
    given = (command.x, command.y, command.z)
    if not all_within(given, HIGHEST_HOME) or abs(command.x) > 90.0 or abs(command.y) > 180.0:
        return DENIED
    vehicle.set_home(*given, by_user=True)
    return ACCEPTED


def on_orbit(vehicle: AutopilotVehicle, command: Command) -> int:
    """Handle DO_ORBIT: radius and speed, about the given point or the present position."""
    commander = commander_of(vehicle)
    centre = commanded_point(vehicle, command)
    if centre is None or not vehicle.has_position:
        return TEMPORARILY_REJECTED
    radius = command.param1 if isfinite(command.param1) and abs(command.param1) >= 1.0 else 5.0
    speed = command.param2 if isfinite(command.param2) and command.param2 else 1.0
    commander.orbit = (centre, radius, speed)
    commander.restart_mode(modes.ORBIT)
    return ACCEPTED


def on_mission_start(vehicle: AutopilotVehicle, _command: Command) -> int:
    """Handle MISSION_START: enter AUTO.MISSION and arm."""
    commander = commander_of(vehicle)
    if not commander.has_mission:
        vehicle.send_text(CRITICAL, "Mission start denied! No valid mission\t")
        return DENIED
    if commander.request_mode(modes.MISSION) != ACCEPTED:
        return DENIED
    return ACCEPTED if commander.arm(for_mission=True) == ACCEPTED else DENIED


def on_terminate(vehicle: AutopilotVehicle, command: Command) -> int:
    """Handle DO_FLIGHTTERMINATION: stop the motors."""
    commander = commander_of(vehicle)
    asked = isfinite(command.param1) and command.param1 > 0.5
    if commander.version.terminates_as_mode:
        if not asked or not vehicle.armed:
            return DENIED
        if vehicle.mode.number == modes.TERMINATION:
            return TEMPORARILY_REJECTED
        vehicle.send_text(CRITICAL, "Failsafe activated\t")
        commander.log.send(event_interface.FAILSAFE, bytes((0, 0, 10, 0, 10)))
        commander.terminate()
    elif asked:
        commander.stop_motors()
    else:
        commander.release_motors()
    return ACCEPTED


def on_get_home(vehicle: AutopilotVehicle, _command: Command) -> int:
    """Handle GET_HOME_POSITION."""
    vehicle.output.after_reply(lambda: vehicle.output.send_message("HOME_POSITION"))
    return ACCEPTED


def on_run_checks(vehicle: AutopilotVehicle, _command: Command) -> int:
    """Handle RUN_PREARM_CHECKS: report the arming checks anew; refused while armed."""
    if vehicle.armed:
        return TEMPORARILY_REJECTED
    commander = commander_of(vehicle)
    commander.reported = None
    vehicle.output.after_reply(commander.report)
    return ACCEPTED


CALIBRATED_AFTER: Ns = 4 * S
"""Duration of the calibration of the gyroscope, the barometer and the level (assumed)."""
GIVEN_UP_AFTER: Ns = 90 * S
"""Time after which a calibration that needs movements ends without them (assumed)."""


def _calibrated(command: Command) -> tuple[str, bool] | None:
    """Return the name of the sensor to calibrate and whether the vehicle may stand still, or None."""
    if command.param1 == 1.0:
        return "gyro", True
    if command.param2 == 1.0:
        return "mag", False
    if command.param3 == 1.0:
        return "baro", True
    if command.x == 2.0:
        return "level", True
    return ("accel", False) if command.x in (1.0, 4.0) else None


def on_calibration(vehicle: AutopilotVehicle, command: Command) -> int:
    """Handle PREFLIGHT_CALIBRATION: a new one, or all zero, ends the one in hand.

    A vehicle that stands cannot turn to the sides that accelerometer and compass need: those fail.
    """
    commander = commander_of(vehicle)
    if vehicle.armed:
        return TEMPORARILY_REJECTED
    for step in commander.calibration:
        step.cancel()
    if commander.calibration:
        commander.calibration = []
        vehicle.send_text(INFO, "[cal] calibration cancelled\t")
    asked = _calibrated(command)
    if asked is None:
        return DENIED if any((command.param1, command.param2, command.param3, command.x)) else ACCEPTED
    sensor, stands = asked
    last = f"done: {sensor}" if stands else "failed: timeout: no motion"
    texts = [f"calibration started: 2 {sensor}"]
    texts += [f"progress <{percent}>" for percent in range(0, 101, 20)] if stands else []
    texts.append(f"calibration {last}")
    whole = CALIBRATED_AFTER if stands else GIVEN_UP_AFTER
    kernel = vehicle.kernel

    def say(number: int) -> None:
        vehicle.send_text(INFO, f"[cal] {texts[number]}\t")
        if number == len(texts) - 1:
            commander.calibration = []

    commander.calibration = [
        kernel.call_at(kernel.now() + whole * number // (len(texts) - 1), partial(say, number))
        for number in range(len(texts))
    ]
    return ACCEPTED


def on_storage(_vehicle: AutopilotVehicle, command: Command) -> int:
    """Handle PREFLIGHT_STORAGE: parameters are always saved; they are not loaded or reset."""
    return ACCEPTED if to_integer(command.param1) == SAVE else DENIED


def accept(_vehicle: AutopilotVehicle, _command: Command) -> int:
    """Accept REQUEST_PROTOCOL_VERSION as recorded; the message is not in our definitions."""
    return ACCEPTED


def on_failure(vehicle: AutopilotVehicle, command: Command) -> int | None:
    """Handle INJECT_FAILURE: an empty battery; of motors only the reports, of which there are none.

    Nothing answers for other units, as in the original with its built-in quadrotor.
    """
    if not vehicle.parameters["SYS_FAILURE_EN"]:
        return DENIED
    unit, kind, instance = (to_integer(one) for one in (command.param1, command.param2, command.param3))
    if unit == MOTOR_UNIT:
        return ACCEPTED if kind in (WORKS, IS_OFF, IS_WRONG) else UNSUPPORTED
    if unit != BATTERY_UNIT or kind not in (WORKS, IS_OFF):
        return None
    if instance != 0:
        return UNSUPPORTED
    commander_of(vehicle).faults.emptied = kind == IS_OFF
    return ACCEPTED


def on_region(vehicle: AutopilotVehicle, command: Command) -> int:
    """Handle DO_SET_ROI and its two forms: without a gimbal the nose turns to the place."""
    given = command.number != ROI_NONE and (command.x or command.y)
    if command.number == ROI_LOCATION and not given:
        return DENIED
    vehicle.commanded.look_at = commanded_point(vehicle, command) if given else None
    return ACCEPTED


def on_gripper(vehicle: AutopilotVehicle, command: Command) -> int | None:
    """Handle DO_GRIPPER, which needs PD_GRIPPER_EN where there is one; without it nothing answers."""
    enabling = "PD_GRIPPER_EN"
    if enabling in vehicle.parameters and not vehicle.parameters[enabling]:
        return None
    action = to_integer(command.param2)
    if action not in GRIPPER_ACTIONS:
        return DENIED
    vehicle.flight.gripper = action
    return ACCEPTED


def ignore(_vehicle: AutopilotVehicle, _command: Command) -> None:
    """Leave a command without an answer: it is meant for a module that does not run."""


SHARED_COMMANDS: Mapping[int, Handler] = {
    RETURN: on_return,
    DO_SET_MODE: on_set_mode,
    CHANGE_SPEED: on_change_speed,
    SET_HOME: on_set_home,
    FLIGHT_TERMINATION: on_terminate,
    REPOSITION: on_reposition,
    REBOOT: lambda _vehicle, _command: DENIED,  # as the firmware's simulator does
    MISSION_START: on_mission_start,
    ARM_DISARM: on_arm,
    REQUEST_PROTOCOL: accept,
    STORAGE: on_storage,
    GRIPPER: on_gripper,
    WINCH: ignore,
    INJECT_FAILURE: on_failure,
    GET_HOME: on_get_home,
    RUN_CHECKS: on_run_checks,
    CALIBRATION: on_calibration,
}

COPTER_COMMANDS: Mapping[int, Handler] = {
    **SHARED_COMMANDS,
    LAND: on_land,
    TAKEOFF: on_takeoff,
    ORBIT: on_orbit,
    ROI: on_region,
    ROI_LOCATION: on_region,
    ROI_NONE: on_region,
}
"""Commands of a multirotor. Unsupported are among others NAV_LOITER_UNLIM, CONDITION_YAW, 193 and 92."""


@runtime_checkable
class OffboardManoeuvre(Protocol):
    """A manoeuvre of the mode OFFBOARD."""

    def receive(self, target: offboard.StreamTarget | None) -> None:
        """Follow a new set-point."""


OVERRIDE_AUTOMATIC, OVERRIDE_OFFBOARD = 1, 2
"""Bits of COM_RC_OVERRIDE."""


def on_heartbeat(vehicle: AutopilotVehicle, fields: dict[str, Any], _sender: int) -> None:
    """Handle HEARTBEAT of a ground station."""
    if fields["type"] == GROUND_STATION:
        commander_of(vehicle).station_seen = vehicle.kernel.now()


def on_event_request(vehicle: AutopilotVehicle, fields: dict[str, Any], _sender: int) -> None:
    """Handle REQUEST_EVENT: send the events again that are still kept."""
    commander_of(vehicle).log.send_again(fields["first_sequence"], fields["last_sequence"])


def on_manual_control(vehicle: AutopilotVehicle, fields: dict[str, Any], _sender: int) -> None:
    """Handle MANUAL_CONTROL."""
    given = deflection(fields)
    sources = commander_of(vehicle).version.joystick_sources
    enabled = round(vehicle.parameters["COM_RC_IN_MODE"]) in sources
    if given is None or not enabled or fields["target"] not in (0, vehicle.system):
        return
    commander = commander_of(vehicle)
    lost_for = commander.joystick.receive(given, vehicle.kernel.now())
    if lost_for:
        commander.log.send(event_interface.STICKS_BACK, event_interface.float_argument(lost_for))
    set_rc_channels(vehicle, given)
    if vehicle.armed:
        _override(commander)
        if vehicle.mode.pilot:
            vehicle.run_manoeuvre()


def _override(commander: CommanderState) -> None:
    """Let moved sticks take over an automatic mode in flight, as COM_RC_OVERRIDE allows."""
    vehicle = commander.vehicle
    options = round(vehicle.parameters["COM_RC_OVERRIDE"])
    number = vehicle.mode.number
    overrides_automatic = number in modes.AUTOMATIC and options & OVERRIDE_AUTOMATIC
    overrides_offboard = number == modes.OFFBOARD and options & OVERRIDE_OFFBOARD
    resting = vehicle.flies and vehicle.landed
    if resting or not (overrides_automatic or overrides_offboard):
        return
    if commander.joystick.moved(vehicle.parameters["COM_RC_STICK_OV"] / 100.0):
        commander.pilot_takes_over()


def _take(vehicle: AutopilotVehicle, target: offboard.StreamTarget | None) -> None:
    if target is None:
        return
    commander = commander_of(vehicle)
    commander.stream.receive(target, vehicle.kernel.now())
    if commander.failsafe == OFFBOARD_LOST and vehicle.armed:
        commander.resume_requested()
    if isinstance(vehicle.manoeuvre, OffboardManoeuvre):
        vehicle.manoeuvre.receive(target)
        if vehicle.armed and not (vehicle.flies and vehicle.landed):
            vehicle.run_manoeuvre()


def on_local_target(vehicle: AutopilotVehicle, fields: dict[str, Any], _sender: int) -> None:
    """Handle SET_POSITION_TARGET_LOCAL_NED."""
    _take(vehicle, offboard.local_target(vehicle, fields, commander_of(vehicle).log))


def on_global_target(vehicle: AutopilotVehicle, fields: dict[str, Any], _sender: int) -> None:
    """Handle SET_POSITION_TARGET_GLOBAL_INT, which counts only while there is a position."""
    if vehicle.has_position:
        _take(vehicle, offboard.global_target(vehicle, fields, commander_of(vehicle).log))


def on_attitude_target(vehicle: AutopilotVehicle, fields: dict[str, Any], _sender: int) -> None:
    """Handle SET_ATTITUDE_TARGET."""
    _take(vehicle, offboard.attitude_target(fields))


def on_pose(vehicle: AutopilotVehicle, fields: dict[str, Any], _sender: int, *, name: str) -> None:
    """Handle VISION_POSITION_ESTIMATE and ODOMETRY."""
    commander_of(vehicle).vision.receive(name, fields)


def on_origin(vehicle: AutopilotVehicle, fields: dict[str, Any], _sender: int) -> None:
    """Handle SET_GPS_GLOBAL_ORIGIN."""
    commander_of(vehicle).vision.set_origin(fields)


def on_time(vehicle: AutopilotVehicle, fields: dict[str, Any], _sender: int) -> None:
    """Handle the answer to a TIMESYNC."""
    commander_of(vehicle).vision.note_time(fields)


MESSAGE_HANDLERS: Mapping[str, MessageHandler] = {
    "HEARTBEAT": on_heartbeat,
    "MANUAL_CONTROL": on_manual_control,
    **{name: partial(on_pose, name=name) for name in ("ODOMETRY", "VISION_POSITION_ESTIMATE")},
    "REQUEST_EVENT": on_event_request,
    "SET_GPS_GLOBAL_ORIGIN": on_origin,
    "TIMESYNC": on_time,
    "SET_ATTITUDE_TARGET": on_attitude_target,
    "SET_POSITION_TARGET_GLOBAL_INT": on_global_target,
    "SET_POSITION_TARGET_LOCAL_NED": on_local_target,
}
"""Messages that need no answer, for every kind of vehicle."""

"""ArduPilot's missions: which items are accepted, how they are read back, and what is reported in flight."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import replace
from math import dist, isinf, isnan

from volery.base.time import from_seconds, to_seconds
from volery.simulation.autopilots.ardupilot.camera import (
    CAMERA_COMMANDS,
    DIGICAM_CONFIGURE,
    DIGICAM_CONTROL,
    SET_FOCUS,
    SET_SOURCE,
    SET_ZOOM,
    START_CAPTURE,
    START_VIDEO,
    STOP_CAPTURE,
    STOP_VIDEO,
    TRIGGER_DISTANCE,
    act_on_camera,
)
from volery.simulation.autopilots.ardupilot.commands import (
    FENCE_ENABLE,
    HIGHEST,
    REPEAT_RELAY,
    REPEAT_SERVO,
    ROI,
    ROI_LOCATION,
    ROI_NONE,
    SET_REVERSE,
    change_speed,
    on_region,
    turn_to,
)
from volery.simulation.autopilots.ardupilot.fence import on_fence_enable
from volery.simulation.autopilots.ardupilot.guided_items import copter_guided_leg, set_limits
from volery.simulation.autopilots.ardupilot.modes import (
    COPTER_DISARMED,
    INFO,
    MISSION_MODES,
    NOTICE,
    change_mode,
    disarm,
)
from volery.simulation.autopilots.ardupilot.mount_control import (
    GIMBAL_PITCHYAW,
    MOUNT_CONTROL,
    on_gimbal_pitchyaw,
    on_mount_control,
)
from volery.simulation.autopilots.ardupilot.payload import (
    GRIPPER,
    SET_RELAY,
    SET_SERVO,
    act_on_payload,
    on_repeat_relay,
    on_repeat_servo,
)
from volery.simulation.autopilots.ardupilot.payload_place import payload_leg
from volery.simulation.autopilots.ardupilot.sprayer import DO_SPRAYER, act_on_sprayer
from volery.simulation.autopilots.ardupilot.winch import DO_WINCH, act_on_winch
from volery.simulation.autopilots.manoeuvres.manual_flight import HoldPlace
from volery.simulation.autopilots.manoeuvres.onboard_mission_flight import Leg, MissionRules, copter_leg
from volery.simulation.autopilots.manoeuvres.rover_driving import Stand
from volery.simulation.autopilots.manoeuvres.to_point import ToPoint, quarter_time
from volery.simulation.autopilots.mavlink.messages import EPOCH_US, Command, Handler, finite
from volery.simulation.autopilots.onboard_mission import (
    CHANGE_SPEED,
    CONDITION_DELAY,
    CONDITION_DISTANCE,
    CONDITION_YAW,
    DELAY,
    DO_AUX_FUNCTION,
    GLOBAL,
    GLOBAL_INT,
    GLOBAL_RELATIVE,
    GLOBAL_RELATIVE_INT,
    GLOBAL_TERRAIN,
    GLOBAL_TERRAIN_INT,
    GUIDED_ENABLE,
    GUIDED_LIMITS,
    JUMP,
    JUMP_TAG,
    LAND,
    LAND_START,
    LOITER_TIME,
    LOITER_TO_ALTITUDE,
    LOITER_TURNS,
    LOITER_UNLIMITED,
    MISSION_FRAME,
    PAYLOAD_PLACE,
    RETURN,
    SET_HOME,
    SET_YAW_SPEED,
    SPLINE_WAYPOINT,
    TAKEOFF,
    WAYPOINT,
    MissionItem,
)
from volery.simulation.autopilots.vehicle_state import Manoeuvre, Vehicle

UNSUPPORTED_FRAME, UNSUPPORTED, INVALID_PARAM1, INVALID_X, INVALID_Y, INVALID_Z = 2, 3, 6, 10, 11, 12
"""MAV_MISSION_RESULT."""

NAMES = {
    WAYPOINT: "WP",
    SPLINE_WAYPOINT: "SplineWP",
    LOITER_UNLIMITED: "LoitUnlim",
    LOITER_TURNS: "LoitTurns",
    LOITER_TIME: "LoitTime",
    LOITER_TO_ALTITUDE: "LoitAltitude",
    RETURN: "RTL",
    LAND: "Land",
    TAKEOFF: "Takeoff",
    DELAY: "Delay",
    SET_YAW_SPEED: "SetYawSpd",
    CONDITION_DELAY: "CondDelay",
    CONDITION_DISTANCE: "CondDist",
    CONDITION_YAW: "CondYaw",
    CHANGE_SPEED: "ChangeSpeed",
    SET_HOME: "SetHome",
    JUMP: "Jump",
    SET_RELAY: "SetRelay",
    SET_SERVO: "SetServo",
    GRIPPER: "Gripper",
    DO_SPRAYER: "Sprayer",
    DO_WINCH: "Winch",
    SET_REVERSE: "SetReverse",
    DIGICAM_CONTROL: "DigiCamCtrl",
    TRIGGER_DISTANCE: "SetCamTrigDst",
    DO_AUX_FUNCTION: "AuxFunction",
    GUIDED_ENABLE: "GuidedEnable",
    GUIDED_LIMITS: "GuidedLimits",
    PAYLOAD_PLACE: "PayloadPlace",
    REPEAT_RELAY: "RepeatRelay",
    REPEAT_SERVO: "RepeatServo",
    LAND_START: "LandStart",
    **dict.fromkeys((ROI_LOCATION, ROI_NONE, ROI), "SetROI"),
    MOUNT_CONTROL: "MountControl",
    GIMBAL_PITCHYAW: "GimbalPitchYaw",
    DIGICAM_CONFIGURE: "DigiCamCfg",
    START_CAPTURE: "ImageStartCapture",
    STOP_CAPTURE: "ImageStopCapture",
    SET_ZOOM: "SetCameraZoom",
    SET_FOCUS: "SetCameraFocus",
    SET_SOURCE: "SetCameraSource",
    START_VIDEO: "VideoStartCapture",
    STOP_VIDEO: "VideoStopCapture",
    FENCE_ENABLE: "FenceEnable",
    JUMP_TAG: "Tag",
}
"""Names of the items in the firmware's status texts."""


PLACED = frozenset(
    {
        WAYPOINT,
        SPLINE_WAYPOINT,
        LOITER_UNLIMITED,
        LOITER_TURNS,
        LOITER_TIME,
        LOITER_TO_ALTITUDE,
        LAND,
        PAYLOAD_PLACE,
        TAKEOFF,
        SET_HOME,
    }
)
"""Items whose place is checked and whose frame is stored."""

KEEPS_FRAME = PLACED | {GUIDED_ENABLE, LAND_START, 191, ROI_LOCATION, ROI}
"""Items whose frame is stored; the others read back frame 0. The last four: landing sequence, go-around and
regions of interest.
"""

STORED_FRAMES = {
    GLOBAL: GLOBAL,
    GLOBAL_INT: GLOBAL,
    GLOBAL_RELATIVE: GLOBAL_RELATIVE,
    GLOBAL_RELATIVE_INT: GLOBAL_RELATIVE,
    GLOBAL_TERRAIN: GLOBAL_TERRAIN,
    GLOBAL_TERRAIN_INT: GLOBAL_TERRAIN,
}
"""The frame that is read back for the frame that was sent."""


def stored_item(item: MissionItem) -> MissionItem | int:
    """Return an item as stored (frames without their INT variants, NaN as 0), or the MAV_MISSION_RESULT."""
    if item.command not in NAMES:
        return UNSUPPORTED
    if item.frame not in STORED_FRAMES and item.frame != MISSION_FRAME:
        return UNSUPPORTED_FRAME
    wrong = _wrong_parameter(item) or (_wrong_place(item) if item.command in PLACED else 0)
    if wrong:
        return wrong
    frame = STORED_FRAMES.get(item.frame, GLOBAL) if item.command in KEEPS_FRAME else GLOBAL
    return item._replace(
        frame=frame,
        param1=finite(item.param1),
        param2=finite(item.param2),
        param3=finite(item.param3),
        param4=finite(item.param4),
        z=finite(item.z),
    )


def _wrong_parameter(item: MissionItem) -> int:
    """Return the result that names the first parameter that is not finite, or 0.

    The heading (param4) of WAYPOINT, LAND and TAKEOFF may be NaN.
    """
    for place, value in enumerate((item.param1, item.param2, item.param3, item.param4)):
        may_be_none = place == 3 and item.command in (WAYPOINT, LAND, TAKEOFF)
        if isinf(value) or (isnan(value) and not may_be_none):
            return INVALID_PARAM1 + place
    return 0


def _wrong_place(item: MissionItem) -> int:
    if abs(item.x) > 900_000_000:
        return INVALID_X
    if abs(item.y) > 1_800_000_000:
        return INVALID_Y
    return 0 if abs(item.z) < HIGHEST else INVALID_Z  # a NaN is not less


def home_item(vehicle: Vehicle) -> MissionItem | None:
    """Return item 0, the home position."""
    home = vehicle.home
    if home is None:
        return None
    return MissionItem(
        WAYPOINT, GLOBAL, x=round(home.latitude * 1e7), y=round(home.longitude * 1e7), z=home.amsl
    )


def mission_grew(vehicle: Vehicle, count: int) -> None:
    """Store the number of items in MIS_TOTAL."""
    vehicle.set_parameter("MIS_TOTAL", count)


def item_begins(vehicle: Vehicle, index: int, item: MissionItem) -> None:
    """Report the item that begins."""
    vehicle.send_text(INFO, f"Mission: {index} {NAMES.get(item.command, 'Unknown')}")


SILENT = frozenset(
    {GRIPPER, SET_SERVO, SET_RELAY, REPEAT_RELAY, REPEAT_SERVO, DIGICAM_CONTROL, TRIGGER_DISTANCE}
    | {DO_SPRAYER, DO_AUX_FUNCTION, JUMP_TAG, GIMBAL_PITCHYAW, DIGICAM_CONFIGURE, START_CAPTURE, STOP_CAPTURE}
    | {SET_ZOOM, SET_FOCUS, SET_SOURCE, START_VIDEO, STOP_VIDEO}
)
"""Actions that AP_Mission itself executes: their end is not reported."""


def _is_reported(vehicle: Vehicle, item: MissionItem) -> bool:
    """Return whether the end of an action is reported by its number."""
    return item.command not in SILENT or (item.command == TRIGGER_DISTANCE and not vehicle.flies)


def item_done(vehicle: Vehicle, index: int, item: MissionItem) -> None:
    """Send MISSION_ITEM_REACHED, and a status text for items that reach a place or wait.

    The first action after the item is done in the same step of the original, which keeps one number to be
    sent: the action's replaces the item's.
    """
    plan, following = vehicle.mission, index + 1
    action = plan[following] if following < len(plan) else None
    at_once = action is not None and not (action.navigates or action.is_condition or action.command == JUMP)
    replaced = action is not None and at_once and _is_reported(vehicle, action)
    vehicle.reports.item_reached = following if replaced else None
    vehicle.output.send_event("MISSION_ITEM_REACHED", {"seq": following if replaced else index})
    if item.command in (WAYPOINT, SPLINE_WAYPOINT, LOITER_TIME, LOITER_TURNS, LOITER_TO_ALTITUDE, DELAY):
        words = "command" if vehicle.flies else "waypoint"
        vehicle.send_text(INFO, f"Reached {words} #{index}")


def action_done(vehicle: Vehicle, index: int, item: MissionItem) -> None:
    """Report an action by its number, unless that has been sent instead of the item before it."""
    if vehicle.reports.item_reached == index:
        vehicle.reports.item_reached = None
    elif _is_reported(vehicle, item):
        vehicle.output.send_event("MISSION_ITEM_REACHED", {"seq": index})


def jumped(vehicle: Vehicle, index: int, times: int, of: int) -> None:
    """Report a jump."""
    vehicle.send_text(INFO, f"Mission: {index} Jump {times}/{of if of >= 0 else 'unlimited'}")


def _change_speed(vehicle: Vehicle, item: MissionItem) -> None:
    if change_speed(vehicle, round(item.param1), item.param2) and not vehicle.flies:
        vehicle.send_text(INFO, f"speed: {item.param2:.1f} m/s")


def _turn(vehicle: Vehicle, item: MissionItem) -> None:
    turn_to(vehicle, item.param1, item.param2, item.param3, relative=item.param4 == 1.0)


def _set_home(vehicle: Vehicle, item: MissionItem) -> None:
    if item.param1 == 1.0 or not item.has_place:
        vehicle.set_home_here()
    else:
        vehicle.set_home(item.x / 1e7, item.y / 1e7, item.z)


def _reverse(vehicle: Vehicle, item: MissionItem) -> None:
    vehicle.commanded.backwards = item.param1 == 1.0


def _wind_winch(vehicle: Vehicle, item: MissionItem) -> None:
    if vehicle.flies:
        act_on_winch(vehicle, item)


def _as_command(handler: Handler) -> Callable[[Vehicle, MissionItem], None]:
    """Return an action that executes an item as the command of its number."""

    def act(vehicle: Vehicle, item: MissionItem) -> None:
        params = item.param1, item.param2, item.param3, item.param4
        handler(vehicle, Command(item.command, *params, item.x / 1e7, item.y / 1e7, item.z, item.frame, True))

    return act


ACTIONS: Mapping[int, Callable[[Vehicle, MissionItem], None]] = {
    CHANGE_SPEED: _change_speed,
    CONDITION_YAW: _turn,
    SET_HOME: _set_home,
    GUIDED_LIMITS: set_limits,
    DO_SPRAYER: act_on_sprayer,
    DIGICAM_CONTROL: act_on_camera,
    TRIGGER_DISTANCE: act_on_camera,
    SET_REVERSE: _reverse,
    DO_WINCH: _wind_winch,
    **dict.fromkeys((GRIPPER, SET_RELAY, SET_SERVO), act_on_payload),
    **dict.fromkeys((ROI_LOCATION, ROI_NONE, ROI), _as_command(on_region)),
    REPEAT_RELAY: _as_command(on_repeat_relay),
    REPEAT_SERVO: _as_command(on_repeat_servo),
    FENCE_ENABLE: _as_command(on_fence_enable),
    MOUNT_CONTROL: _as_command(on_mount_control),
    GIMBAL_PITCHYAW: _as_command(on_gimbal_pitchyaw),
    **{one: _as_command(CAMERA_COMMANDS[one]) for one in (DIGICAM_CONFIGURE, START_CAPTURE, STOP_CAPTURE)},
}
"""What executes the item of a command."""


def act(vehicle: Vehicle, item: MissionItem) -> None:
    """Execute an item that does not navigate; a tag and the start of a landing only mark a place."""
    action = ACTIONS.get(item.command)
    if action is not None:
        action(vehicle, item)


DAY_S = 86_400
LEAST_JERK = 0.1
"""Lower limit of WPNAV_JERK [m/s^3]."""
UNSTATED = -1.0
"""Hour, minute or second of NAV_DELAY that is not stated."""


def leg_of_copter(vehicle: Vehicle, item: MissionItem, goes_on: bool) -> Leg:
    """Return the leg of an item. A delay without a duration lasts until a time of day."""
    if item.command == GUIDED_ENABLE:
        return copter_guided_leg(vehicle, item)
    if item.command == PAYLOAD_PLACE:
        return payload_leg(vehicle, item)
    if item.command == DELAY:
        if item.param1 <= 0.0:
            item = item._replace(param1=_seconds_until(vehicle, item))
        vehicle.send_text(INFO, f"Delaying {int(item.param1)} sec")
    leg = copter_leg(vehicle, item, goes_on)
    going = leg.manoeuvre
    if item.command in (WAYPOINT, SPLINE_WAYPOINT) and isinstance(going, ToPoint) and going.point is not None:
        length = dist(vehicle.estimate.position, going.point)
        return leg if length > vehicle.tuning.waypoint_radius else _not_before(leg, vehicle, length)
    return leg


def path_jerk(vehicle: Vehicle) -> float:
    """Return the jerk of ways between waypoints [m/s^3]."""
    return max(LEAST_JERK, vehicle.parameters["WPNAV_JERK"])


def _not_before(leg: Leg, vehicle: Vehicle, length: float) -> Leg:
    """Return a leg that takes at least the time for its *length* [m] from rest to rest within WPNAV_JERK.

    A waypoint within the waypoint radius takes a moment, too, as ArduCopter's path of limited jerk does.
    """
    earliest = vehicle.kernel.now() + from_seconds(4.0 * quarter_time(length, path_jerk(vehicle)))
    done = leg.done
    return replace(leg, done=lambda: vehicle.kernel.now() >= earliest and done())


def _seconds_until(vehicle: Vehicle, item: MissionItem) -> float:
    """Return the time [s] until hour, minute and second of UTC, the first of them that is not -1 onwards.

    The time of day comes next: on the next day, in the next hour or in the next minute, if it has passed.
    """
    now = (EPOCH_US / 1e6 + to_seconds(vehicle.kernel.now())) % DAY_S
    for place, period in ((item.param2, DAY_S), (item.param3, 3600), (item.param4, 60)):
        if place != UNSTATED:
            of_day = 3600.0 * item.param2 + 60.0 * item.param3 + item.param4
            return (of_day - now) % period
    return 0.0


def leaves_ground(vehicle: Vehicle) -> bool:
    """Return whether AUTO takes off without MISSION_START: raised throttle or bit 1 of AUTO_OPTIONS."""
    raised = vehicle.tuning.sticks.read(vehicle.rc).throttle > 0.0
    return raised or bool(round(vehicle.parameters["AUTO_OPTIONS"]) & 2)


def runs(vehicle: Vehicle) -> bool:
    """Return whether the mission is being flown."""
    plan = vehicle.mission
    return vehicle.armed and vehicle.mode.name in MISSION_MODES and plan.current > 0 and not plan.complete


def copter_ended(vehicle: Vehicle) -> Manoeuvre | None:
    """Disarm on the ground; hold the position in the air."""
    if vehicle.landed and vehicle.armed:
        disarm(vehicle, COPTER_DISARMED, force=True)
    return ToPoint(vehicle) if vehicle.armed else None


DONE_LOITER = 1
DONE_MODES = {2: 1, 3: 0}
"""MIS_DONE_BEHAVE to the number of the mode that is entered: ACRO, MANUAL."""


def _leave(vehicle: Vehicle, mode: int) -> None:
    change_mode(vehicle, mode)


def rover_ended(vehicle: Vehicle) -> Manoeuvre | None:
    """Report the end, and stop, loiter or change the mode as MIS_DONE_BEHAVE demands."""
    vehicle.send_text(NOTICE, "Mission Complete")
    after = round(vehicle.parameters["MIS_DONE_BEHAVE"])
    if after in DONE_MODES:
        vehicle.kernel.call_at(vehicle.kernel.now(), lambda: _leave(vehicle, DONE_MODES[after]))
    return HoldPlace(vehicle) if after == DONE_LOITER else Stand(vehicle)


Actions = Mapping[int, Callable[[Vehicle, MissionItem], None]]
"""Command to what executes its item."""


def _rules(ended: Callable[[Vehicle], Manoeuvre | None], actions: Actions) -> MissionRules:
    def execute(vehicle: Vehicle, item: MissionItem) -> None:
        actions.get(item.command, act)(vehicle, item)

    return MissionRules(
        restarts=True,
        item_begins=item_begins,
        item_done=item_done,
        act=execute,
        action_begins=item_begins,
        action_done=action_done,
        jumped=jumped,
        ended=ended,
    )


def copter_rules(actions: Actions) -> MissionRules:
    """Return the rules of a copter's missions, with actions beside the shared ones."""
    return _rules(copter_ended, actions)


def rover_rules(actions: Actions) -> MissionRules:
    """Return the rules of a rover's missions, with actions beside the shared ones."""
    return _rules(rover_ended, actions)

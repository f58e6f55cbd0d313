"""Commands and messages that point ArduPilot's camera mount, and those that describe its gimbal manager."""

from __future__ import annotations

from math import isnan, radians
from typing import Any

from volery.base.time import S
from volery.simulation.autopilots.ardupilot.commands import is_place
from volery.simulation.autopilots.ardupilot.feature import Feature, MissionCommand, as_command
from volery.simulation.autopilots.ardupilot.mount import (
    AT_HOME,
    AT_POINT,
    AT_SYSTEM,
    BY_MESSAGE,
    BY_PILOT,
    IS_NEUTRAL,
    LOCKS_PITCH,
    LOCKS_ROLL,
    LOCKS_YAW,
    NEUTRAL,
    PILOT_PITCH,
    PILOT_ROLL,
    PILOT_YAW,
    RETRACT,
    RETRACTED,
    attitude_status,
    limits,
    mount_of,
    mount_state,
    pans,
    point_at,
    point_by_angles,
    point_by_rates,
    set_default_mode,
    set_mount_mode,
    update_mount,
)
from volery.simulation.autopilots.mavlink.messages import (
    ACCEPTED,
    FAILED,
    Command,
    Fields,
    boot_ms,
    finite,
)
from volery.simulation.autopilots.onboard_mission import GLOBAL, GLOBAL_RELATIVE
from volery.simulation.autopilots.vehicle_state import AutopilotVehicle
from volery.trace.events import WARNING

ROI_LOCATION, ROI_NONE, ROI = 195, 197, 201
ROI_SYSTEM, MOUNT_CONFIGURE, MOUNT_CONTROL, GIMBAL_PITCHYAW, GIMBAL_CONFIGURE = 198, 204, 205, 1000, 1001
"""MAV_CMD."""

LARGEST_PITCH, LARGEST_ROLL, LARGEST_YAW = 90.0, 180.0, 360.0
"""Angles [degrees] beyond which MOUNT_CONTROL is refused: they were stated in 1/100 degree."""
WARNS_EVERY = 30 * S
RETRACT_SWITCH, LOCK_SWITCH = 27, 163
"""RCn_OPTION."""
LEAVE, TAKE, GIVE_BACK = -1, -2, -3
"""Values of param1 of GIMBAL_CONFIGURE; others are system ids."""

# GIMBAL_MANAGER_CAP_FLAGS: axis, follow and lock of roll, pitch and yaw
ROLLS, PITCHES, YAWS = 0b11100, 0b1110_0000, 0b111_0000_0000
CAPABLE = 0b11 | 1 << 13 | 1 << 16 | 1 << 17
"""Retracts, has a neutral position, inputs of the pilot, points at local and global places."""


def on_mount_configure(vehicle: AutopilotVehicle, command: Command) -> int:
    """Handle DO_MOUNT_CONFIGURE: param1 is the mode; one that does not exist is accepted without effect."""
    if mount_of(vehicle) is None:
        return FAILED
    set_mount_mode(vehicle, round(command.param1))
    return ACCEPTED


def _warn(vehicle: AutopilotVehicle, text: str) -> int:
    """Send a warning, at most one in 30 s, and return FAILED."""
    mount, now = mount_state(vehicle), vehicle.kernel.now()
    if now - mount.warned_at >= WARNS_EVERY:
        mount.warned_at = now
        vehicle.send_text(WARNING, f"Mount: {text}")
    return FAILED


def on_mount_control(vehicle: AutopilotVehicle, command: Command) -> int:
    """Handle DO_MOUNT_CONTROL: param7 is the mode.

    Pitch, roll and yaw [degrees] are param1 to param3. A place is param5 and param6 [1/1e7 degree], also in
    COMMAND_LONG, and param4 metres above home.
    """
    if mount_of(vehicle) is None:
        return FAILED
    mode, pitch, roll, yaw = int(finite(command.z)), command.param1, command.param2, command.param3
    if mode in (RETRACT, NEUTRAL, BY_PILOT, AT_HOME):
        set_mount_mode(vehicle, mode)
    elif mode == BY_MESSAGE:
        if abs(pitch) > LARGEST_PITCH or abs(roll) > LARGEST_ROLL or abs(yaw) > LARGEST_YAW:
            return _warn(vehicle, "invalid angle targets")
        point_by_angles(vehicle, roll, pitch, yaw, from_north=False)
    elif mode == AT_POINT:
        if pitch and roll and command.fifth == command.sixth == 0.0:
            return _warn(vehicle, "GPS_POINT target invalid")
        _point_at_place(vehicle, command.fifth, command.sixth, int(command.param4))
    else:
        return FAILED
    return ACCEPTED


def _point_at_place(vehicle: AutopilotVehicle, latitude: float, longitude: float, height: float) -> None:
    """Point at a place [1/1e7 degree] at a height above home [m]. The nose does not follow it."""
    mount = mount_state(vehicle)
    mount.place = vehicle.point(GLOBAL_RELATIVE, latitude / 1e7, longitude / 1e7, height)
    mount.mode = AT_POINT


def on_gimbal_pitchyaw(vehicle: AutopilotVehicle, command: Command) -> int:
    """Handle DO_GIMBAL_MANAGER_PITCHYAW: angles [degrees] param1, param2, or rates param3, param4."""
    if mount_of(vehicle) is None or command.z not in (0.0, 1.0):
        return FAILED
    pointed = _point(
        vehicle, round(command.fifth), (command.param1, command.param2), (command.param3, command.param4)
    )
    return ACCEPTED if pointed else FAILED


def _point(
    vehicle: AutopilotVehicle, flags: int, angles: tuple[float, float], rates: tuple[float, float]
) -> bool:
    """Follow flags of the gimbal manager, else pitch and yaw [degrees], else their rates.

    Angles that are NaN or larger than 90 and 360 degrees are not given.
    """
    from_north = bool(flags & LOCKS_YAW)
    if flags & (RETRACTED | IS_NEUTRAL):
        set_mount_mode(vehicle, RETRACT if flags & RETRACTED else NEUTRAL)
    elif abs(angles[0]) <= 90.0 and abs(angles[1]) <= 360.0:
        point_by_angles(vehicle, 0.0, *angles, from_north=from_north)
    elif not any(isnan(rate) for rate in rates):
        point_by_rates(vehicle, 0.0, *rates, from_north=from_north)
    else:
        return False
    return True


def on_gimbal_configure(vehicle: AutopilotVehicle, command: Command) -> int:
    """Handle DO_GIMBAL_MANAGER_CONFIGURE: who is in control, by system and component id."""
    mount, who = mount_of(vehicle), command.param1
    if mount is None or command.z not in (0.0, 1.0):
        return FAILED
    if not all(GIVE_BACK <= value <= 255.0 for value in (who, command.param2)):
        return FAILED
    before = mount.controller
    if who == TAKE:
        mount.controller = command.sender
    elif who == GIVE_BACK and before == command.sender:
        mount.controller = (0, 0)
    elif who >= 0.0:
        mount.controller = (int(who), int(command.param2))
    if mount.controller != before:
        vehicle.output.send_message("GIMBAL_MANAGER_STATUS")
    return ACCEPTED


def on_roi_system(vehicle: AutopilotVehicle, command: Command) -> int:
    """Handle DO_SET_ROI_SYSID: the mount follows the positions that a system sends."""
    mount = mount_of(vehicle)
    if mount is None:
        return FAILED
    mount.follows, mount.mode = int(command.param1), AT_SYSTEM
    return ACCEPTED


def on_region(vehicle: AutopilotVehicle, command: Command) -> int:
    """Handle DO_SET_ROI and its two forms: without a mount that pans, the nose turns to the place.

    Without a place the nose turns along the path again, also after CONDITION_YAW.
    """
    if command.number == ROI_NONE or (command.x == 0.0 and command.y == 0.0):
        point_at(vehicle, None)
        vehicle.commanded.forget_heading()
        return ACCEPTED
    if not is_place(command):
        return FAILED
    point_at(vehicle, vehicle.point(command.frame, command.x, command.y, command.z))
    return ACCEPTED


def on_other_position(vehicle: AutopilotVehicle, fields: dict[str, Any], sender: int) -> None:
    """Handle GLOBAL_POSITION_INT of another system: the place that the mount follows."""
    mount = mount_of(vehicle)
    if mount is not None and sender == mount.follows:
        mount.followed = vehicle.point(
            GLOBAL, fields["lat"] / 1e7, fields["lon"] / 1e7, fields["alt"] / 1000.0
        )


def on_mount_control_message(vehicle: AutopilotVehicle, fields: dict[str, Any], _sender: int) -> None:
    """Handle the deprecated MOUNT_CONTROL: angles [1/100 degree] or a place, as the mode demands."""
    mount = mount_of(vehicle)
    a, b, c = fields["input_a"], fields["input_b"], fields["input_c"]
    if mount is None or fields["target_system"] not in (0, vehicle.system):
        return
    if mount.mode == BY_MESSAGE:
        point_by_angles(vehicle, b / 100.0, a / 100.0, c / 100.0, from_north=False)
    elif mount.mode == AT_POINT:
        _point_at_place(vehicle, a, b, c / 100.0)


def on_mount_configure_message(vehicle: AutopilotVehicle, fields: dict[str, Any], _sender: int) -> None:
    """Handle the deprecated MOUNT_CONFIGURE."""
    if mount_of(vehicle) is not None and fields["target_system"] in (0, vehicle.system):
        set_mount_mode(vehicle, fields["mount_mode"])


def retract_by_switch(vehicle: AutopilotVehicle, position: int) -> None:
    """Retract the mount with the switch up, return to its default mode with it down."""
    if position > 0:
        set_mount_mode(vehicle, RETRACT)
    elif position < 0:
        set_default_mode(vehicle)


def lock_by_switch(vehicle: AutopilotVehicle, position: int) -> None:
    """Let the pilot's yaw count from north with the switch up."""
    mount_state(vehicle).yaw_locked = position > 0


def manager_information(vehicle: AutopilotVehicle) -> Fields | None:
    """Return GIMBAL_MANAGER_INFORMATION."""
    if mount_of(vehicle) is None:
        return None
    flags = CAPABLE
    fields: Fields = {}
    for axis, bits in (("ROLL", ROLLS), ("PITCH", PITCHES), ("YAW", YAWS)):
        low, high = limits(vehicle, axis)
        flags |= bits if (pans(vehicle) if axis == "YAW" else low < high) else 0
        fields |= {f"{axis.lower()}_min": radians(low), f"{axis.lower()}_max": radians(high)}
    return {"time_boot_ms": boot_ms(vehicle), "cap_flags": flags, "gimbal_device_id": 1, **fields}


def manager_status(vehicle: AutopilotVehicle) -> Fields | None:
    """Return GIMBAL_MANAGER_STATUS: who is in control."""
    mount = mount_of(vehicle)
    if mount is None:
        return None
    system, component = mount.controller
    return {
        "time_boot_ms": boot_ms(vehicle),
        "flags": LOCKS_ROLL | LOCKS_PITCH | (LOCKS_YAW if mount.yaw_locked else 0),
        "gimbal_device_id": 1,
        "primary_control_sysid": system,
        "primary_control_compid": component,
        "secondary_control_sysid": 0,
        "secondary_control_compid": 0,
    }


def _leave_to_channel(_vehicle: AutopilotVehicle, _position: int) -> None:
    """Do nothing: the pulse width of the channel counts, not its position as a switch."""


COPTER = ROVER = Feature(
    parameters={
        "MNT1_TYPE": ("", "1: there is a camera mount with servos, from the next boot on"),
        "MNT1_DEFLT_MODE": ("", "first mode of the mount"),
        "MNT1_RC_RATE": ("°/s", "positive: the pilot turns the mount at up to this rate; else to angles"),
        "MNT1_SYSID_DFLT": ("", "system that the mount follows before one is commanded"),
        "MNT1_LEAD_RLL": ("s", "time by which the mount leads the vehicle's roll"),
        "MNT1_LEAD_PTCH": ("s", "time by which the mount leads the vehicle's pitch"),
        **{
            f"MNT1_{axis}_{end}": ("°", f"{words} of the mount's {axis.lower()}")
            for axis in ("ROLL", "PITCH", "YAW")
            for end, words in (("MIN", "lower end"), ("MAX", "upper end"))
        },
        **{
            f"MNT1_{place}_{axis}": ("°", f"angle of the {words} mount")
            for place, words in (("RETRACT", "retracted"), ("NEUTRAL", "neutral"))
            for axis in "XYZ"
        },
    },
    commands={
        ROI: on_region,
        ROI_LOCATION: on_region,
        ROI_NONE: on_region,
        ROI_SYSTEM: on_roi_system,
        MOUNT_CONFIGURE: on_mount_configure,
        MOUNT_CONTROL: on_mount_control,
        GIMBAL_PITCHYAW: on_gimbal_pitchyaw,
        GIMBAL_CONFIGURE: on_gimbal_configure,
    },
    nan_commands=(GIMBAL_PITCHYAW,),
    messages={
        "GLOBAL_POSITION_INT": on_other_position,
        "MOUNT_CONFIGURE": on_mount_configure_message,
        "MOUNT_CONTROL": on_mount_control_message,
    },
    items={
        ROI_LOCATION: MissionCommand("SetROI", as_command(on_region), keeps_frame=True),
        ROI_NONE: MissionCommand("SetROI", as_command(on_region)),
        ROI: MissionCommand("SetROI", as_command(on_region), keeps_frame=True),
        MOUNT_CONTROL: MissionCommand("MountControl", as_command(on_mount_control)),
        GIMBAL_PITCHYAW: MissionCommand("GimbalPitchYaw", as_command(on_gimbal_pitchyaw), silent=True),
    },
    switches={
        RETRACT_SWITCH: retract_by_switch,
        LOCK_SWITCH: lock_by_switch,
        **dict.fromkeys((PILOT_ROLL, PILOT_PITCH, PILOT_YAW), _leave_to_channel),
    },
    on_tick=update_mount,
    telemetry={
        "GIMBAL_DEVICE_ATTITUDE_STATUS": attitude_status,
        "GIMBAL_MANAGER_INFORMATION": manager_information,
        "GIMBAL_MANAGER_STATUS": manager_status,
    },
)

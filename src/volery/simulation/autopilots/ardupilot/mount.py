"""ArduPilot's camera mount with servos: where it points, and the outputs that point it there.

Roll and pitch of the target are about the horizon, its yaw is from the nose or from north. A servo mount has
no feedback: ArduPilot reports the target as its attitude. Only the outputs compensate the lean of the
vehicle. MNT1_TYPE counts from the next boot on.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from math import degrees, hypot, nan, pi, radians

from volery.base.elementary import atan2, cos, sin, tan
from volery.base.frames import Vector, euler_to_quaternion, wrap
from volery.base.time import Ns, to_seconds
from volery.simulation.autopilots.ardupilot.failsafes import radio_lost
from volery.simulation.autopilots.ardupilot.feature import TICK, Kept
from volery.simulation.autopilots.ardupilot.parameters import channel_range
from volery.simulation.autopilots.ardupilot.servo_outputs import channels, move
from volery.simulation.autopilots.manoeuvres.to_point import bearing
from volery.simulation.autopilots.mavlink.messages import Fields, boot_ms
from volery.simulation.autopilots.state_groups import NEVER
from volery.simulation.autopilots.vehicle_state import AutopilotVehicle

SERVO = 1
"""MNT1_TYPE."""
RETRACT, NEUTRAL, BY_MESSAGE, BY_PILOT, AT_POINT, AT_SYSTEM, AT_HOME = range(7)
"""MAV_MOUNT_MODE."""
PAN, TILT, ROLL, OPEN = 6, 7, 8, 9
"""SERVOn_FUNCTION."""
PILOT_ROLL, PILOT_PITCH, PILOT_YAW = 212, 213, 214
"""RCn_OPTION of the channels of the pilot."""
FIRST_SWITCH = 5
LEAST_MOVE = 10
"""Change of a channel of the pilot [us] that takes the mount over."""
RETRACTED, IS_NEUTRAL, LOCKS_ROLL, LOCKS_PITCH, LOCKS_YAW = 1, 2, 4, 8, 16
"""GIMBAL_DEVICE_FLAGS and GIMBAL_MANAGER_FLAGS."""


@dataclass
class MountState:
    """Camera mount. Angles are roll, pitch and yaw [rad]; places are north, east, down [m]."""

    present: bool | None = None
    """Whether the vehicle has booted with a mount; ``None``: not known yet."""
    mode: int = 0
    """MAV_MOUNT_MODE."""
    angles: Vector = (0.0, 0.0, 0.0)
    """Target: roll and pitch about the horizon, yaw from the nose or from north."""
    from_north: bool = False
    rates: Vector | None = None
    """Rates at which the target turns; ``None``: it has angles only."""
    rates_from_north: bool = False
    place: Vector | None = None
    """Region of interest."""
    follows: int = 0
    """System whose positions it follows, and where that was last."""
    followed: Vector | None = None
    yaw_locked: bool = False
    """Whether the pilot's yaw counts from north."""
    pilot_pulses: list[int] = field(default_factory=lambda: [0, 0, 0])
    """Pulse widths [us] of the pilot's channels when they last counted."""
    controller: tuple[int, int] = (0, 0)
    """System and component that are in control, for others to read."""
    warned_at: Ns = NEVER


mount_state = Kept(MountState)


def mount_of(vehicle: AutopilotVehicle) -> MountState | None:
    """Return the mount, or ``None`` if the vehicle has booted without one."""
    mount = mount_state(vehicle)
    return mount if mount.present else None


def limits(vehicle: AutopilotVehicle, axis: str) -> tuple[float, float]:
    """Return the ends [degrees] of an axis: ROLL, PITCH or YAW."""
    return vehicle.parameters[f"MNT1_{axis}_MIN"], vehicle.parameters[f"MNT1_{axis}_MAX"]


def _within(value: float, ends: tuple[float, float]) -> float:
    return max(ends[0], min(ends[1], value))


def pans(vehicle: AutopilotVehicle) -> bool:
    """Return whether the mount turns about the vertical: if not, a copter turns its nose."""
    low, high = limits(vehicle, "YAW")
    return mount_state(vehicle).present is True and bool(channels(vehicle, PAN)) and low < high


def set_mount_mode(vehicle: AutopilotVehicle, mode: int) -> bool:
    """Set the MAV_MOUNT_MODE and return whether there is such a mode."""
    valid = RETRACT <= mode <= AT_HOME
    if valid:
        mount_state(vehicle).mode = mode
    return valid


def set_default_mode(vehicle: AutopilotVehicle) -> None:
    """Set the mode that MNT1_DEFLT_MODE names."""
    set_mount_mode(vehicle, round(vehicle.parameters["MNT1_DEFLT_MODE"]))


def point_by_angles(
    vehicle: AutopilotVehicle, roll: float, pitch: float, yaw: float, *, from_north: bool
) -> None:
    """Point to angles [degrees], within the ends of the axes; the yaw from north has none."""
    mount = mount_state(vehicle)
    if not from_north:
        yaw = _within(yaw - 360.0 if yaw > 180.0 else yaw, limits(vehicle, "YAW"))
    roll, pitch = _within(roll, limits(vehicle, "ROLL")), _within(pitch, limits(vehicle, "PITCH"))
    mount.angles, mount.from_north = (radians(roll), radians(pitch), radians(yaw)), from_north
    mount.rates, mount.mode = None, BY_MESSAGE


def point_by_rates(
    vehicle: AutopilotVehicle, roll: float, pitch: float, yaw: float, *, from_north: bool
) -> None:
    """Turn at rates [degrees/s]."""
    mount = mount_state(vehicle)
    mount.rates, mount.rates_from_north = (radians(roll), radians(pitch), radians(yaw)), from_north
    mount.mode = BY_MESSAGE


def point_at(vehicle: AutopilotVehicle, place: Vector | None) -> None:
    """Point the mount at a place north, east, down [m], or no longer at one.

    The nose of a copter follows the place if the mount does not pan, or if there is none.
    """
    mount = mount_state(vehicle)
    vehicle.commanded.look_at = None if pans(vehicle) else place
    mount.place = place
    if place is not None:
        mount.mode = AT_POINT
    elif mount.mode == AT_POINT:
        set_default_mode(vehicle)


def update_mount(vehicle: AutopilotVehicle) -> None:
    """Move the target and the outputs, at each tick."""
    mount = mount_state(vehicle)
    if mount.present is None:
        mount.present = vehicle.parameters["MNT1_TYPE"] == SERVO
        mount.follows = round(vehicle.parameters["MNT1_SYSID_DFLT"])
        set_default_mode(vehicle)
    if not mount.present:
        return
    _notice_pilot(vehicle, mount)
    if mount.mode in (RETRACT, NEUTRAL):
        name = "RETRACT" if mount.mode == RETRACT else "NEUTRAL"
        roll, pitch, yaw = (radians(vehicle.parameters[f"MNT1_{name}_{axis}"]) for axis in "XYZ")
        mount.angles, mount.from_north, mount.rates = (roll, pitch, yaw), False, None
        outputs = mount.angles
    else:
        _aim(vehicle, mount, to_seconds(TICK))
        outputs = _compensated(vehicle, mount)
    move(vehicle, OPEN, float(mount.mode != RETRACT))
    for function, axis, angle in zip((ROLL, TILT, PAN), ("ROLL", "PITCH", "YAW"), outputs, strict=True):
        low, high = limits(vehicle, axis)
        if low < high:
            move(vehicle, function, (degrees(angle) - low) / (high - low))


def _aim(vehicle: AutopilotVehicle, mount: MountState, seconds: float) -> None:
    """Set the target of the modes that have one of their own, and turn it at the rates that are in force."""
    if mount.mode == BY_PILOT:
        _follow_pilot(vehicle, mount)
    else:
        home = vehicle.home.ned if vehicle.home else None
        places = {AT_POINT: mount.place, AT_HOME: home, AT_SYSTEM: mount.followed if mount.follows else None}
        place = places.get(mount.mode)
        if place is not None:
            here = vehicle.estimate.position
            level = hypot(place[0] - here[0], place[1] - here[1])
            mount.angles = (0.0, atan2(here[2] - place[2], level), bearing(here, place))
            mount.from_north, mount.rates = True, None
    if mount.rates is not None:
        _turn(vehicle, mount, mount.rates, seconds)


def _turn(vehicle: AutopilotVehicle, mount: MountState, rates: Vector, seconds: float) -> None:
    """Turn the target for some seconds, within the ends of the axes."""
    roll, pitch, yaw = mount.angles
    nose = vehicle.estimate.attitude[2]
    if mount.from_north != mount.rates_from_north:
        yaw = wrap(yaw + nose if mount.rates_from_north else yaw - nose)
        mount.from_north = mount.rates_from_north
    turned = [angle + rate * seconds for angle, rate in zip((roll, pitch, yaw), rates, strict=True)]
    limited = [
        radians(_within(degrees(angle), limits(vehicle, axis)))
        for angle, axis in zip(turned, ("ROLL", "PITCH", "YAW"), strict=True)
    ]
    mount.angles = (limited[0], limited[1], wrap(turned[2]) if mount.from_north else limited[2])


def _yaw_from_nose(vehicle: AutopilotVehicle, mount: MountState) -> float:
    """Return the yaw of the target from the nose [rad], within its ends."""
    yaw = mount.angles[2]
    from_nose = wrap(yaw - vehicle.estimate.attitude[2]) if mount.from_north else yaw
    return radians(_within(degrees(from_nose), limits(vehicle, "YAW")))


def _compensated(vehicle: AutopilotVehicle, mount: MountState) -> Vector:
    """Return the angles [rad] of the axes at which the camera points at its target as the vehicle leans.

    MNT1_LEAD_RLL and MNT1_LEAD_PTCH lead the lean by a time.
    """
    roll, pitch, _ = mount.angles
    yaw = _yaw_from_nose(vehicle, mount)
    lean_roll, lean_pitch, _ = vehicle.estimate.attitude
    turned = -yaw if pans(vehicle) else 0.0
    along = lean_roll * cos(turned) - lean_pitch * sin(turned)
    aside = lean_roll * sin(turned) + lean_pitch * cos(turned)
    p, q, r = vehicle.estimate.rates
    sine, cosine = sin(lean_roll), cos(lean_roll)
    steep = abs(lean_pitch) >= pi / 3.0
    roll_rate = 0.0 if steep else p + tan(lean_pitch) * (q * sine + r * cosine)
    pitch_rate = cos(lean_pitch) * q - sine * r
    parameters = vehicle.parameters
    return (
        roll - along - roll_rate * parameters["MNT1_LEAD_RLL"],
        pitch - aside - pitch_rate * parameters["MNT1_LEAD_PTCH"],
        yaw,
    )


def _pilot_channels(vehicle: AutopilotVehicle) -> tuple[int | None, ...]:
    """Return the channels of the pilot for roll, pitch and yaw."""
    numbers = range(FIRST_SWITCH, len(vehicle.rc.transmitter) + 1)
    options = {round(vehicle.parameters[f"RC{number}_OPTION"]): number for number in reversed(numbers)}
    return tuple(options.get(option) for option in (PILOT_ROLL, PILOT_PITCH, PILOT_YAW))


def _notice_pilot(vehicle: AutopilotVehicle, mount: MountState) -> None:
    """Give the mount to the pilot once one of the channels moves."""
    if radio_lost(vehicle):
        return
    used = _pilot_channels(vehicle)
    pulses = [vehicle.rc[channel] if channel else 0 for channel in used]
    if mount.mode not in (BY_PILOT, RETRACT):
        for channel, pulse, before in zip(used, pulses, mount.pilot_pulses, strict=True):
            dead = vehicle.parameters[f"RC{channel}_DZ"] if channel else 0.0
            if abs(pulse - before) > max(dead, LEAST_MOVE):
                mount.mode = BY_PILOT
    if mount.mode in (BY_PILOT, RETRACT):
        mount.pilot_pulses = pulses


def _follow_pilot(vehicle: AutopilotVehicle, mount: MountState) -> None:
    """Take angles, or rates where MNT1_RC_RATE is positive, from the channels of the pilot."""
    sticks = [
        channel_range(vehicle.parameters, channel).deflection(vehicle.rc[channel])
        if channel and vehicle.rc[channel]
        else 0.0
        for channel in _pilot_channels(vehicle)
    ]
    fastest = vehicle.parameters["MNT1_RC_RATE"]
    if fastest > 0.0:
        mount.rates = (
            radians(sticks[0] * fastest),
            radians(sticks[1] * fastest),
            radians(sticks[2] * fastest),
        )
        mount.rates_from_north = mount.yaw_locked
        return
    ends = [limits(vehicle, axis) for axis in ("ROLL", "PITCH", "YAW")]
    roll, pitch, yaw = (
        radians((stick + 1.0) / 2.0 * (high - low) + low)
        for stick, (low, high) in zip(sticks, ends, strict=True)
    )
    mount.angles = (roll, pitch, sticks[2] * pi if mount.yaw_locked else yaw)
    mount.from_north, mount.rates = mount.yaw_locked, None


def attitude_status(vehicle: AutopilotVehicle) -> Fields | None:
    """Return GIMBAL_DEVICE_ATTITUDE_STATUS: roll and pitch about the horizon, yaw from the nose."""
    mount = mount_of(vehicle)
    if mount is None:
        return None
    roll, pitch, _ = mount.angles
    flags = {RETRACT: RETRACTED, NEUTRAL: IS_NEUTRAL}.get(mount.mode, 0) | LOCKS_ROLL | LOCKS_PITCH
    return {
        "time_boot_ms": boot_ms(vehicle),
        "flags": flags,
        "q": euler_to_quaternion(roll, pitch, _yaw_from_nose(vehicle, mount)),
        "angular_velocity_x": nan,
        "angular_velocity_y": nan,
        "angular_velocity_z": nan,
        "failure_flags": 0,
        "delta_yaw": nan,
        "delta_yaw_velocity": nan,
        "gimbal_device_id": 1,
    }

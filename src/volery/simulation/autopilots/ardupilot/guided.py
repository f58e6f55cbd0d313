"""Targets of GUIDED: SET_POSITION_TARGET_LOCAL_NED, SET_POSITION_TARGET_GLOBAL_INT and SET_ATTITUDE_TARGET.

A group of three (position, velocity, acceleration) counts only as a whole. Outside GUIDED and the mission
item NAV_GUIDED_ENABLE the messages are ignored.
"""

from __future__ import annotations

from math import hypot, isfinite, radians
from typing import Any, NamedTuple

from volery.base.elementary import atan2
from volery.base.frames import Vector, turn_clockwise
from volery.simulation.autopilots.ardupilot.commands import FARTHEST_POINT, SLEW_YAW
from volery.simulation.autopilots.ardupilot.fence import fence_admits
from volery.simulation.autopilots.manoeuvres.guided_flight import Guided, Turn
from volery.simulation.autopilots.manoeuvres.rover_driving import GuidedRover
from volery.simulation.autopilots.mavlink.messages import all_within
from volery.simulation.autopilots.onboard_mission import (
    BODY_NED,
    BODY_OFFSET_NED,
    GLOBAL,
    GLOBAL_INT,
    GLOBAL_RELATIVE,
    GLOBAL_RELATIVE_INT,
    GLOBAL_TERRAIN,
    GLOBAL_TERRAIN_INT,
    LOCAL_NED,
    LOCAL_OFFSET_NED,
)
from volery.simulation.autopilots.vehicle_state import AutopilotVehicle

POSITION, VELOCITY, ACCELERATION, YAW, YAW_RATE = 0b111, 0b111 << 3, 0b111 << 6, 1 << 10, 1 << 11
"""Bits of ``type_mask``: a set bit ignores its group."""
LEVEL_POSITION, LEVEL_VELOCITY = 0b11, 0b11 << 3
"""The groups of ``type_mask`` that a rover reads."""
FORCE = 1 << 9

GLOBAL_FRAMES = (
    GLOBAL,
    GLOBAL_INT,
    GLOBAL_RELATIVE,
    GLOBAL_RELATIVE_INT,
    GLOBAL_TERRAIN,
    GLOBAL_TERRAIN_INT,
)
LOCAL_FRAMES = (LOCAL_NED, LOCAL_OFFSET_NED, BODY_NED, BODY_OFFSET_NED)
BODY_FRAMES = (BODY_NED, BODY_OFFSET_NED)

ATTITUDE_IGNORED, THROTTLE_IGNORED, YAW_RATE_IGNORED, RATES_IGNORED = 1 << 7, 1 << 6, 1 << 2, 0b111
"""Bits of SET_ATTITUDE_TARGET's ``type_mask``."""


class GuidedTarget(NamedTuple):
    """Target of one message, north-east-down about the estimator's origin; None: not given."""

    position: Vector | None
    velocity: Vector | None
    acceleration: Vector | None
    turn: Turn
    force: bool


def _given(mask: int, group: int) -> bool:
    return not mask & group


def _turned(vehicle: AutopilotVehicle, vector: Vector) -> Vector:
    """Rotate forward-right-down to north-east-down by the heading alone."""
    heading = vehicle.estimate.attitude[2]
    return *turn_clockwise(vector[:2], heading), vector[2]


def _turn(vehicle: AutopilotVehicle, fields: dict[str, Any], body: bool) -> Turn:
    mask = fields["type_mask"]
    yaw = fields["yaw"] if _given(mask, YAW) and isfinite(fields["yaw"]) else None
    if yaw is not None and body:
        yaw += vehicle.estimate.attitude[2]
    rate = None
    if _given(mask, YAW_RATE) and isfinite(fields["yaw_rate"]):
        fastest = radians(SLEW_YAW) if vehicle.flies else vehicle.tuning.pilot_yaw_rate
        rate = min(fastest, max(-fastest, fields["yaw_rate"]))
    return Turn(None if rate is not None else yaw, rate)


def _of_local(vehicle: AutopilotVehicle, fields: dict[str, Any]) -> GuidedTarget | None:
    mask, frame = fields["type_mask"], fields["coordinate_frame"]
    if frame not in LOCAL_FRAMES:
        return None
    body = frame in BODY_FRAMES
    place: Vector = (fields["x"], fields["y"], fields["z"])
    velocity: Vector = (fields["vx"], fields["vy"], fields["vz"])
    push: Vector = (fields["afx"], fields["afy"], fields["afz"])
    if body:
        place, velocity, push = _turned(vehicle, place), _turned(vehicle, velocity), _turned(vehicle, push)
    if frame != LOCAL_NED:
        here = vehicle.estimate.position
        place = (here[0] + place[0], here[1] + place[1], here[2] + place[2])
    return _target(mask, (place, velocity, push), _turn(vehicle, fields, body))


def _target(mask: int, groups: tuple[Vector, Vector, Vector], turn: Turn) -> GuidedTarget | None:
    place, velocity, push = groups
    for group, values in ((POSITION, place), (VELOCITY, velocity), (ACCELERATION, push)):
        if _given(mask, group) and not all_within(values, FARTHEST_POINT):
            return None
    return GuidedTarget(
        place if _given(mask, POSITION) else None,
        velocity if _given(mask, VELOCITY) else None,
        push if _given(mask, ACCELERATION) else None,
        turn,
        bool(mask & FORCE),
    )


def _of_global(vehicle: AutopilotVehicle, fields: dict[str, Any]) -> GuidedTarget | None:
    mask, frame = fields["type_mask"], fields["coordinate_frame"]
    if frame not in GLOBAL_FRAMES:
        return None
    place = vehicle.point(frame, fields["lat_int"] / 1e7, fields["lon_int"] / 1e7, fields["alt"])
    velocity: Vector = (fields["vx"], fields["vy"], fields["vz"])
    push: Vector = (fields["afx"], fields["afy"], fields["afz"])
    return _target(mask, (place, velocity, push), _turn(vehicle, fields, body=False))


def _obey(vehicle: AutopilotVehicle, target: GuidedTarget | None) -> None:
    guided = vehicle.manoeuvre.flown
    if target is None or not isinstance(guided, Guided) or (target.force and target.acceleration is not None):
        return
    if target.position is not None:
        if fence_admits(vehicle, target.position):
            guided.go_to(target.position, target.turn)
    elif target.velocity is not None:
        guided.follow_velocity(target.velocity, target.turn)
    elif target.acceleration is not None:
        guided.follow_acceleration(target.acceleration, target.turn)


def copter_local(vehicle: AutopilotVehicle, fields: dict[str, Any], _sender: int) -> None:
    """Handle SET_POSITION_TARGET_LOCAL_NED of a copter."""
    _obey(vehicle, _of_local(vehicle, fields))


def copter_global(vehicle: AutopilotVehicle, fields: dict[str, Any], _sender: int) -> None:
    """Handle SET_POSITION_TARGET_GLOBAL_INT of a copter."""
    _obey(vehicle, _of_global(vehicle, fields))


def _states_attitude(fields: dict[str, Any]) -> bool:
    """Return whether SET_ATTITUDE_TARGET states a throttle, and all its values are numbers."""
    values = (*fields["q"], fields["body_yaw_rate"], fields["thrust"])
    return not fields["type_mask"] & THROTTLE_IGNORED and all_within(values)


def copter_attitude(vehicle: AutopilotVehicle, fields: dict[str, Any], _sender: int) -> None:
    """Handle SET_ATTITUDE_TARGET: attitude, yaw rate, and thrust as a climb rate."""
    _follow_attitude(vehicle, fields, fed_forward=True)


def _follow_attitude(vehicle: AutopilotVehicle, fields: dict[str, Any], fed_forward: bool) -> None:
    guided, mask = vehicle.manoeuvre.flown, fields["type_mask"]
    if not isinstance(guided, Guided) or not _states_attitude(fields):
        return
    w, x, y, z = fields["q"]
    size = hypot(w, x, y, z)
    attitude = None if mask & ATTITUDE_IGNORED or size < 0.5 else (w / size, x / size, y / size, z / size)
    rate = None if mask & YAW_RATE_IGNORED else fields["body_yaw_rate"]
    guided.follow_attitude(attitude, rate, min(1.0, max(0.0, fields["thrust"])), fed_forward)


def strict_copter_attitude(vehicle: AutopilotVehicle, fields: dict[str, Any], _sender: int) -> None:
    """Handle it as 4.8: without a throttle, or with some body rates but not all, it stops (from 4.6 on).

    A yaw rate is not fed forward, it moves the stated heading on only (from 4.7 on).
    """
    guided, mask = vehicle.manoeuvre.flown, fields["type_mask"]
    if mask & THROTTLE_IGNORED or mask & RATES_IGNORED not in (0, RATES_IGNORED):
        if isinstance(guided, Guided):
            guided.follow_velocity((0.0, 0.0, 0.0))
    else:
        _follow_attitude(vehicle, fields, fed_forward=False)


def rover_attitude(vehicle: AutopilotVehicle, fields: dict[str, Any], _sender: int) -> None:
    """Handle SET_ATTITUDE_TARGET of a rover: a share of its speed, with a heading or a turn rate."""
    guided, mask = vehicle.manoeuvre.flown, fields["type_mask"]
    if not isinstance(guided, GuidedRover) or not _states_attitude(fields):
        return
    speed = min(1.0, max(-1.0, fields["thrust"])) * vehicle.tuning.speed
    if mask & YAW_RATE_IGNORED:
        w, x, y, z = fields["q"]
        heading = atan2(2.0 * (w * z + x * y), 1.0 - 2.0 * (y * y + z * z))
        guided.follow_speed(speed, Turn(yaw=heading))
    else:
        guided.follow_speed(speed, Turn(rate=fields["body_yaw_rate"]))


def rover_local(vehicle: AutopilotVehicle, fields: dict[str, Any], _sender: int) -> None:
    """Handle SET_POSITION_TARGET_LOCAL_NED of a rover, which reads the horizontal axes only."""
    _drive(vehicle, _of_local(vehicle, _level(fields)), fields["vx"])


def rover_global(vehicle: AutopilotVehicle, fields: dict[str, Any], _sender: int) -> None:
    """Handle SET_POSITION_TARGET_GLOBAL_INT of a rover."""
    _drive(vehicle, _of_global(vehicle, _level(fields)), fields["vx"])


def _level(fields: dict[str, Any]) -> dict[str, Any]:
    """Return the fields with the vertical bits of the mask set like the horizontal ones."""
    mask = fields["type_mask"]
    for group, level in ((POSITION, LEVEL_POSITION), (VELOCITY, LEVEL_VELOCITY)):
        mask = mask & ~group if not mask & level else mask | group
    return {**fields, "type_mask": mask}


def _drive(vehicle: AutopilotVehicle, target: GuidedTarget | None, ahead: float) -> None:
    """Drive to a point, along a velocity, or at a velocity's length with a heading or a turn rate of its own.

    Args:
        vehicle: The vehicle.
        target: The target; ``None``: ignored.
        ahead: First component of the velocity as sent: its sign is the direction of driving beside a turn.
    """
    guided = vehicle.manoeuvre.flown
    if target is None or not isinstance(guided, GuidedRover):
        return
    turns = target.turn.yaw is not None or target.turn.rate is not None
    if target.position is not None:
        if fence_admits(vehicle, target.position):
            guided.go_to(target.position)
    elif target.velocity is not None:
        north, east, _ = target.velocity
        speed = min(hypot(north, east), vehicle.tuning.speed)
        if turns:
            guided.follow_speed(-speed if ahead < 0.0 else speed, target.turn)
        else:
            guided.follow_speed(speed, Turn(atan2(east, north)))
    elif turns and target.acceleration is None:
        guided.follow_speed(0.0, target.turn)

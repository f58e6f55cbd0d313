"""OFFBOARD: what counts as a set-point, how long its stream lives, and what each axis is to hold.

A set-point that is understood counts as a sign of life in any mode; it is flown only while the mode is
OFFBOARD. Each axis may be given a position, a velocity, an acceleration, or several of them; what is masked
or no number is left alone.
"""

from __future__ import annotations

from math import cos, hypot, isfinite, nan, sin
from typing import Any, NamedTuple

from volery.base.frames import Quaternion, Vector
from volery.base.time import Ns
from volery.simulation.autopilots.manual_control import NEVER
from volery.simulation.autopilots.mavlink.message_fields import FARTHEST, all_within
from volery.simulation.autopilots.onboard_mission import (
    BODY_NED,
    GLOBAL_INT,
    GLOBAL_RELATIVE_INT,
    GLOBAL_TERRAIN_INT,
    LOCAL_NED,
)
from volery.simulation.autopilots.px4.events import FRAME_UNSUPPORTED, SETPOINT_INVALID, Log
from volery.simulation.autopilots.vehicle_state import Vehicle

CRITICAL = 2
"""MAV_SEVERITY."""

NO_YAW, NO_YAW_RATE = 1 << 10, 1 << 11
"""Bits of ``type_mask``."""

ATTITUDE_IGNORED, THRUST_IGNORED, YAW_RATE_IGNORED = 1 << 7, 1 << 6, 1 << 2
"""Bits of SET_ATTITUDE_TARGET's ``type_mask``."""

GLOBAL_FRAMES = (GLOBAL_INT, GLOBAL_RELATIVE_INT, GLOBAL_TERRAIN_INT)

ABSENT: Vector = (nan, nan, nan)


class Target(NamedTuple):
    """What a set-point asks for: north, east, down about the estimator's origin; NaN: not asked."""

    position: Vector = ABSENT
    velocity: Vector = ABSENT
    acceleration: Vector = ABSENT
    yaw: float | None = None
    yaw_rate: float | None = None

    def lifts(self, down: float) -> bool:
        """Whether it would leave the ground from there."""
        return self.position[2] < down or self.velocity[2] < 0.0 or self.acceleration[2] < 0.0


class AttitudeTarget(NamedTuple):
    """An attitude, or a turn rate in place of its heading, and a collective of 0..1."""

    attitude: Quaternion
    yaw_rate: float | None
    thrust: float


class Stream:
    """The set-points of one vehicle."""

    def __init__(self) -> None:
        self.heard_at: Ns = NEVER
        self.target: Target | AttitudeTarget | None = None

    def take(self, target: Target | AttitudeTarget, now: Ns) -> None:
        """A set-point came."""
        self.heard_at, self.target = now, target

    def alive(self, now: Ns, within: Ns) -> bool:
        """Whether the last one is not older than that."""
        return self.heard_at != NEVER and now - self.heard_at <= within


def _masked(values: Vector, mask: int, shift: int) -> Vector:
    a, b, c = (
        value if isfinite(value) and not mask >> shift >> place & 1 else nan
        for place, value in enumerate(values)
    )
    return a, b, c


def _asked(values: Vector) -> bool:
    return any(isfinite(value) for value in values)


def _turned(vehicle: Vehicle, vector: Vector) -> Vector:
    """Forward, right, down to north, east, down, by the heading alone; what is missing counts as 0."""
    if not _asked((*vector[:2], nan)):
        return nan, nan, vector[2]
    x, y = (value if isfinite(value) else 0.0 for value in vector[:2])
    heading = vehicle.estimate.attitude[2]
    c, s = cos(heading), sin(heading)
    return x * c - y * s, x * s + y * c, vector[2]


def _target(fields: dict[str, Any], position: Vector) -> Target | None:
    """``None`` where nothing at all is asked, or of something that is nowhere."""
    mask = fields["type_mask"]
    velocity = _masked((fields["vx"], fields["vy"], fields["vz"]), mask, 3)
    push = _masked((fields["afx"], fields["afy"], fields["afz"]), mask, 6)
    given = [value for value in (*position, *velocity, *push) if isfinite(value)]
    if not given or not all_within(given, FARTHEST):
        return None
    yaw = fields["yaw"] if not mask & NO_YAW and isfinite(fields["yaw"]) else None
    rate = fields["yaw_rate"] if not mask & NO_YAW_RATE and isfinite(fields["yaw_rate"]) else None
    return Target(position, velocity, push, yaw if rate is None else None, rate)


def local_target(vehicle: Vehicle, fields: dict[str, Any], log: Log) -> Target | None:
    """Of SET_POSITION_TARGET_LOCAL_NED; where it is refused, it says so."""
    mask, frame = fields["type_mask"], fields["coordinate_frame"]
    message = "SET_POSITION_TARGET_LOCAL_NED"
    if frame not in (LOCAL_NED, BODY_NED):
        vehicle.say(CRITICAL, f"{message} coordinate frame {frame} unsupported\t")
        log.tell(FRAME_UNSUPPORTED)
        return None
    place = _masked((fields["x"], fields["y"], fields["z"]), mask, 0)
    target = _target(fields, ABSENT if frame == BODY_NED else place)
    if target is None:
        vehicle.say(CRITICAL, f"{message} invalid\t")
        log.tell(SETPOINT_INVALID)
        return None
    if frame == BODY_NED:
        target = target._replace(
            velocity=_turned(vehicle, target.velocity), acceleration=_turned(vehicle, target.acceleration)
        )
    return target


def global_target(vehicle: Vehicle, fields: dict[str, Any], log: Log) -> Target | None:
    """Of SET_POSITION_TARGET_GLOBAL_INT; heights above terrain are taken as above home."""
    mask, frame = fields["type_mask"], fields["coordinate_frame"]
    message = "SET_POSITION_TARGET_GLOBAL_INT"
    if frame not in GLOBAL_FRAMES:
        vehicle.say(CRITICAL, f"{message} invalid coordinate frame {frame}\t")
        log.tell(FRAME_UNSUPPORTED)
        return None
    altitude = fields["alt"] if isfinite(fields["alt"]) else 0.0
    place = vehicle.point(frame, fields["lat_int"] / 1e7, fields["lon_int"] / 1e7, altitude)
    target = _target(fields, _masked(place, mask, 0))
    if target is None:
        vehicle.say(CRITICAL, f"{message} invalid\t")
        log.tell(SETPOINT_INVALID)
    return target


def attitude_target(fields: dict[str, Any]) -> AttitudeTarget | None:
    """Of SET_ATTITUDE_TARGET; ``None`` for what is not understood."""
    mask = fields["type_mask"]
    if mask & (ATTITUDE_IGNORED | THRUST_IGNORED) or not all_within((*fields["q"], fields["thrust"])):
        return None
    w, x, y, z = fields["q"]
    size = hypot(w, x, y, z)
    if size < 0.5:
        return None
    given = not mask & YAW_RATE_IGNORED and isfinite(fields["body_yaw_rate"])
    rate = fields["body_yaw_rate"] if given else None
    thrust = min(1.0, max(0.0, fields["thrust"]))
    return AttitudeTarget((w / size, x / size, y / size, z / size), rate, thrust)

"""Streams that fly a PX4: set-points in OFFBOARD with the manoeuvre that follows them, and sticks.

A valid set-point keeps the stream alive in any mode; it is flown only in OFFBOARD. Each axis may have a
position, a velocity, an acceleration, or several of them; masked and NaN values are ignored. Sticks arrive as
MANUAL_CONTROL; modes and failsafes read whether they are available, lost or moved.

The firmware plans no path in OFFBOARD: a point is approached at a speed proportional to the distance, up to
MPC_XY_VEL_MAX.
"""

from __future__ import annotations

from collections.abc import Mapping
from math import hypot, isfinite, nan
from typing import Any, NamedTuple

from volery.base.frames import Quaternion, Vector, quaternion_to_euler, turn_clockwise
from volery.base.time import MS, Ns, to_seconds
from volery.simulation.autopilots.flight_stack.flight import Control, Setpoint
from volery.simulation.autopilots.mavlink.messages import FARTHEST, all_within
from volery.simulation.autopilots.onboard_mission import (
    BODY_NED,
    GLOBAL_INT,
    GLOBAL_RELATIVE_INT,
    GLOBAL_TERRAIN_INT,
    LOCAL_NED,
)
from volery.simulation.autopilots.px4.event_interface import FRAME_UNSUPPORTED, SETPOINT_INVALID, EventBuffer
from volery.simulation.autopilots.px4.position_control import PositionLoops, Wanted
from volery.simulation.autopilots.state_groups import NEVER
from volery.simulation.autopilots.vehicle_state import AutopilotVehicle, FlightManoeuvre
from volery.trace.events import CRITICAL

INVALID = 32_767
CENTRE = 500
"""``z`` of a centred throttle stick."""

TAKEN_IN_AFTER: Ns = 250 * MS
"""Time from the first sample until manual control counts for modes and arming.

Observed: a mode of sticks is refused at the first sample (4 of 4) and accepted 0.3 s later; a report of the
arming checks 0.24 s after the first sample still misses manual control.
"""

ROLL, PITCH, THROTTLE, YAW = 1, 2, 3, 4
NEUTRAL = (1500,) * 4 + (0,) * 12
"""RC channels without manual control [us]."""


class StickDeflection(NamedTuple):
    """Sticks -1..1: forward, right, up, clockwise."""

    pitch: float = 0.0
    roll: float = 0.0
    throttle: float = 0.0
    yaw: float = 0.0


def deflection(fields: Mapping[str, Any]) -> StickDeflection | None:
    """Return the sticks of a MANUAL_CONTROL, or None if an axis is not given."""
    x, y, z, r = (fields[axis] for axis in "xyzr")
    if INVALID in (x, y, z, r):
        return None
    within = [min(1.0, max(-1.0, axis / 1000.0)) for axis in (x, y, 2 * (z - CENTRE), r)]
    return StickDeflection(*within)


class ManualControlState:
    """State of one vehicle's manual control."""

    def __init__(self) -> None:
        self.now = StickDeflection()
        self.last_received_ns: Ns = NEVER
        self.valid = False
        self._valid_since_ns: Ns = NEVER
        self.lost_when_armed = True
        """Whether manual control was missing at arming and since, which is no failsafe."""
        self._reference = StickDeflection()
        self._moved = False

    @property
    def ever_received(self) -> bool:
        """Whether manual control was ever received."""
        return self.last_received_ns != NEVER

    def taken_in(self, now: Ns) -> bool:
        """Return whether manual control has been received long enough to fly and to arm by it."""
        return self.valid and now - self._valid_since_ns >= TAKEN_IN_AFTER

    def set_reference(self) -> None:
        """Measure stick movement from the present deflection on."""
        self._reference = self.now
        self._moved = False

    def receive(self, given: StickDeflection, now: Ns) -> float:
        """Store a sample, and return for how long manual control was lost [s]; 0 if it was not."""
        lost_for = to_seconds(now - self.last_received_ns) if self.ever_received and not self.valid else 0.0
        if not self.valid:
            self._reference = given
            self._valid_since_ns = now
        self.now, self.last_received_ns, self.valid = given, now, True
        self.lost_when_armed = False
        return lost_for

    def moved(self, share: float) -> bool:
        """Return whether a stick moved by more than this share of its range since the reference."""
        pairs = zip(self.now, self._reference, strict=True)
        return self.valid and any(abs(value - rested) > share for value, rested in pairs)


def set_rc_channels(vehicle: AutopilotVehicle, given: StickDeflection) -> None:
    """Write the sticks to the RC channels, which the generic manoeuvres read."""
    now = vehicle.kernel.now()
    axes = {ROLL: given.roll, PITCH: -given.pitch, THROTTLE: given.throttle, YAW: given.yaw}
    for channel, value in axes.items():
        vehicle.rc.override(channel, round(1500.0 + 500.0 * value), now)


NO_YAW, NO_YAW_RATE = 1 << 10, 1 << 11
"""Bits of ``type_mask``."""

ATTITUDE_IGNORED, THRUST_IGNORED, YAW_RATE_IGNORED, RATES_IGNORED = 1 << 7, 1 << 6, 1 << 2, 0b111
"""Bits of SET_ATTITUDE_TARGET's ``type_mask``."""

GLOBAL_FRAMES = (GLOBAL_INT, GLOBAL_RELATIVE_INT, GLOBAL_TERRAIN_INT)

ABSENT: Vector = (nan, nan, nan)


class OffboardTarget(NamedTuple):
    """Set-point, north-east-down about the estimator's origin [m, m/s, m/s^2]; NaN: not given."""

    position: Vector = ABSENT
    velocity: Vector = ABSENT
    acceleration: Vector = ABSENT
    yaw: float | None = None
    yaw_rate: float | None = None

    def lifts(self, down: float) -> bool:
        """Return whether the set-point leaves the ground at that height (down) [m]."""
        return self.position[2] < down or self.velocity[2] < 0.0 or self.acceleration[2] < 0.0


class OffboardAttitude(NamedTuple):
    """Attitude, or a yaw rate in place of its heading, and a collective thrust 0..1."""

    attitude: Quaternion
    yaw_rate: float | None
    thrust: float


class RateTarget(NamedTuple):
    """Body rates forward, right, down [rad/s] and a collective thrust 0..1."""

    rates: Vector
    thrust: float


StreamTarget = OffboardTarget | OffboardAttitude | RateTarget
"""What a set-point of the stream commands."""


class OffboardSetpoints:
    """The last set-point of one vehicle."""

    def __init__(self) -> None:
        self.last_received_ns: Ns = NEVER
        self.target: StreamTarget | None = None

    def receive(self, target: StreamTarget, now: Ns) -> None:
        """Store a set-point and its time."""
        self.last_received_ns, self.target = now, target

    def alive(self, now: Ns, within: Ns) -> bool:
        """Return whether the last set-point is not older than ``within``."""
        return self.last_received_ns != NEVER and now - self.last_received_ns <= within


def _masked(values: Vector, mask: int, shift: int) -> Vector:
    a, b, c = (
        value if isfinite(value) and not mask >> shift >> place & 1 else nan
        for place, value in enumerate(values)
    )
    return a, b, c


def _asked(values: Vector) -> bool:
    return any(isfinite(value) for value in values)


def _turned(vehicle: AutopilotVehicle, vector: Vector) -> Vector:
    """Rotate forward-right-down to north-east-down by the heading alone; missing values count as 0."""
    if not _asked((*vector[:2], nan)):
        return nan, nan, vector[2]
    x, y = (value if isfinite(value) else 0.0 for value in vector[:2])
    heading = vehicle.estimate.attitude[2]
    return *turn_clockwise((x, y), heading), vector[2]


def _target(fields: dict[str, Any], position: Vector) -> OffboardTarget | None:
    """Return the set-point, or None if nothing is given or a value is out of range."""
    mask = fields["type_mask"]
    velocity = _masked((fields["vx"], fields["vy"], fields["vz"]), mask, 3)
    push = _masked((fields["afx"], fields["afy"], fields["afz"]), mask, 6)
    given = [value for value in (*position, *velocity, *push) if isfinite(value)]
    if not given or not all_within(given, FARTHEST):
        return None
    yaw = fields["yaw"] if not mask & NO_YAW and isfinite(fields["yaw"]) else None
    rate = fields["yaw_rate"] if not mask & NO_YAW_RATE and isfinite(fields["yaw_rate"]) else None
    return OffboardTarget(position, velocity, push, yaw if rate is None else None, rate)


def local_target(
    vehicle: AutopilotVehicle, fields: dict[str, Any], log: EventBuffer
) -> OffboardTarget | None:
    """Parse SET_POSITION_TARGET_LOCAL_NED, and report a refusal."""
    mask, frame = fields["type_mask"], fields["coordinate_frame"]
    message = "SET_POSITION_TARGET_LOCAL_NED"
    if frame not in (LOCAL_NED, BODY_NED):
        vehicle.send_text(CRITICAL, f"{message} coordinate frame {frame} unsupported\t")
        log.send(FRAME_UNSUPPORTED)
        return None
    place = _masked((fields["x"], fields["y"], fields["z"]), mask, 0)
    target = _target(fields, ABSENT if frame == BODY_NED else place)
    if target is None:
        vehicle.send_text(CRITICAL, f"{message} invalid\t")
        log.send(SETPOINT_INVALID)
        return None
    if frame == BODY_NED:
        target = target._replace(
            velocity=_turned(vehicle, target.velocity), acceleration=_turned(vehicle, target.acceleration)
        )
    return target


def global_target(
    vehicle: AutopilotVehicle, fields: dict[str, Any], log: EventBuffer
) -> OffboardTarget | None:
    """Parse SET_POSITION_TARGET_GLOBAL_INT, and report a refusal. Terrain heights count above home."""
    mask, frame = fields["type_mask"], fields["coordinate_frame"]
    message = "SET_POSITION_TARGET_GLOBAL_INT"
    if frame not in GLOBAL_FRAMES:
        vehicle.send_text(CRITICAL, f"{message} invalid coordinate frame {frame}\t")
        log.send(FRAME_UNSUPPORTED)
        return None
    altitude = fields["alt"] if isfinite(fields["alt"]) else 0.0
    place = vehicle.point(frame, fields["lat_int"] / 1e7, fields["lon_int"] / 1e7, altitude)
    target = _target(fields, _masked(place, mask, 0))
    if target is None:
        vehicle.send_text(CRITICAL, f"{message} invalid\t")
        log.send(SETPOINT_INVALID)
    return target


def attitude_target(fields: dict[str, Any]) -> OffboardAttitude | RateTarget | None:
    """Parse SET_ATTITUDE_TARGET: its attitude, else its body rates; None if it is invalid."""
    mask = fields["type_mask"]
    if mask & THRUST_IGNORED or not all_within((fields["thrust"],)):
        return None
    if mask & ATTITUDE_IGNORED:
        rates = fields["body_roll_rate"], fields["body_pitch_rate"], fields["body_yaw_rate"]
        if mask & RATES_IGNORED or not all_within(rates):
            return None
        return RateTarget(rates, min(1.0, max(0.0, fields["thrust"])))
    if not all_within(fields["q"]):
        return None
    w, x, y, z = fields["q"]
    size = hypot(w, x, y, z)
    if size < 0.5:
        return None
    given = not mask & YAW_RATE_IGNORED and isfinite(fields["body_yaw_rate"])
    rate = fields["body_yaw_rate"] if given else None
    thrust = min(1.0, max(0.0, fields["thrust"]))
    return OffboardAttitude((w / size, x / size, y / size, z / size), rate, thrust)


class FollowOffboard(FlightManoeuvre):
    """Follow an ``OffboardTarget`` axis by axis; without one, hold."""

    def __init__(self, vehicle: AutopilotVehicle) -> None:
        super().__init__(vehicle)
        self._setpoint: OffboardTarget | None = None

    def enter(self) -> None:
        """Forget the set-point."""
        self._setpoint = None

    def follow(self, target: OffboardTarget) -> None:
        """Follow a set-point."""
        self._setpoint = target
        north, east, down = target.position
        here = self.vehicle.estimate.position
        known = isfinite(north) and isfinite(east)
        self.target = (north, east, down if isfinite(down) else here[2]) if known else None

    def takeoff_requested(self) -> bool:
        """Return whether the set-point is above the vehicle."""
        return self._setpoint is not None and self._setpoint.lifts(self.vehicle.estimate.position[2])

    def step(self) -> None:
        """Control what the set-point states."""
        vehicle = self.vehicle
        if self._setpoint is None:
            self._setpoint = OffboardTarget(position=vehicle.estimate.position)
        target, rate = self._setpoint, self._setpoint.yaw_rate
        control: PositionLoops = vehicle.firmware_state.control
        control.fly(
            Wanted(target.position, target.velocity, target.acceleration),
            target.yaw if rate is None else None,
            rate,
        )


class Offboard(FlightManoeuvre):
    """Mode OFFBOARD: position and velocity set-points by ``FollowOffboard``, attitudes and rates directly."""

    def __init__(self, vehicle: AutopilotVehicle) -> None:
        super().__init__(vehicle)
        self.slow_start = True
        self._follower = FollowOffboard(vehicle)
        self._attitude: OffboardAttitude | RateTarget | None = None

    def enter(self) -> None:
        """Hold until a set-point arrives."""
        self._follower.enter()
        self.receive(self.vehicle.firmware_state.stream.target)

    def receive(self, target: StreamTarget | None) -> None:
        """Follow a new set-point."""
        self._attitude = target if isinstance(target, OffboardAttitude | RateTarget) else None
        if isinstance(target, OffboardTarget):
            self._follower.follow(target)
        self.target = None if self._attitude else self._follower.target

    def takeoff_requested(self) -> bool:
        """Return whether the set-point climbs or has a high thrust."""
        if self._attitude is not None:
            return self._attitude.thrust > 0.3
        return self._follower.takeoff_requested()

    def step(self) -> None:
        """Apply the set-point."""
        if self._attitude is None:
            self._follower.step()
            return
        self._follower.enter()
        share = self._attitude.thrust / self.vehicle.parameters["MPC_THR_HOVER"]
        throttle = min(1.0, share * self.vehicle.estimate.hover_throttle)
        if isinstance(self._attitude, RateTarget):
            roll, pitch, yaw = self._attitude.rates
            self.vehicle.drive(
                Setpoint(Control.RATE, roll_rate=roll, pitch_rate=pitch, yaw_rate=yaw, throttle=throttle)
            )
            return
        roll, pitch, yaw = quaternion_to_euler(self._attitude.attitude)
        rate = self._attitude.yaw_rate
        self.vehicle.drive(
            Setpoint(
                Control.ATTITUDE,
                roll=roll,
                pitch=pitch,
                yaw=yaw if rate is None else None,
                yaw_rate=rate,
                throttle=throttle,
            )
        )

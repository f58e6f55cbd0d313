"""Set-points at 50 Hz: the remaining offset to a point, a velocity, or manual control.

An aircraft without set-points brakes and hovers. So no set-point is sent that would be wrong, such as an
offset from an old position.
"""

from __future__ import annotations

from collections.abc import Sequence
from math import hypot, isfinite, isnan, pi, radians
from typing import NamedTuple

from volery.base.frames import LocalFrame, heading_to_yaw
from volery.base.time import Ns, S
from volery.kernel.api import Kernel
from volery.ros.messages.dji_constants import (
    ANGLE_YAW_RATE_CLIMB,
    ANGLE_YAW_RATE_THRUST,
    POSITION_YAW,
    VELOCITY_YAW_RATE,
    DisplayMode,
)
from volery.vehicles.driver import AttitudeTarget, ManualControl
from volery.vehicles.drivers.dji.decoder import WAITS, DjiDecoder
from volery.vehicles.telemetry import Telemetry, Velocity

STOP_FOR: Ns = 2 * S
"""Time for which zero velocity is sent at the end of a velocity."""
OBEYED_WITHIN: Ns = 3 * S
"""Set-points without effect for this time are not obeyed: another program has the authority."""

BRAKES_M_S2 = 1.0
UP_M_S, DOWN_M_S = 3.0, 2.0
"""Flight at a stated speed: deceleration, and greatest vertical speeds."""
CARROT_S = 1.0
"""Near the goal the offset is limited to the distance covered in this time at the stated speed."""

STICK_TILT, STICK_YAW_RATE = radians(25.0), pi / 2.0
STICK_CLIMB = 2.0
"""Tilt (rad), yaw rate (rad/s) and climb rate (m/s) at full deflection."""
THROTTLE_DEAD = 0.05
"""Half width of the throttle's range in which the height is kept."""

STILL = Velocity(0.0, 0.0, 0.0)
SDK = DisplayMode.NAVI_SDK_CTRL.name
WAITING = frozenset(mode.name for mode in WAITS)
"""Names of the modes in which it hovers and accepts commands."""

Setpoint = tuple[int, Sequence[float]]
"""The flag, and four numbers in the conventions of ROS (REP 103)."""


class SdkPoint(NamedTuple):
    """A point: the origin of a frame, metres above home, yaw in rad anticlockwise from east, speed in m/s."""

    frame: LocalFrame
    height: float
    yaw: float
    speed: float | None = None


class Moving(NamedTuple):
    """A velocity until a time; ``turn`` in rad/s anticlockwise."""

    velocity: Velocity
    turn: float
    until: Ns


class Tilted(NamedTuple):
    """An attitude until a time."""

    attitude: AttitudeTarget
    until: Ns


class SdkManual(NamedTuple):
    """Manual control; with ``keeps_height`` the throttle commands a climb rate, else the thrust."""

    keeps_height: bool


Target = SdkPoint | Moving | Tilted | SdkManual


class SetpointStream:
    """Computes set-points for the present target. ``fresh``: the target is new and must be sent at once."""

    def __init__(self, kernel: Kernel, telemetry: Telemetry, decoder: DjiDecoder) -> None:
        self.held: ManualControl | None = None
        self.fresh = False
        self._kernel = kernel
        self._telemetry = telemetry
        self._decoder = decoder
        self._target: Target | None = None
        self._was_armed = False
        self._not_obeyed_since: Ns | None = None  # since when set-points have been sent without effect

    @property
    def wanted(self) -> bool:
        """Whether there is a target."""
        return self._target is not None

    @property
    def is_manual(self) -> bool:
        """Whether the target is manual control."""
        return isinstance(self._target, SdkManual)

    def follow(self, target: Target) -> None:
        """Send set-points for *target* from now on."""
        self._target, self.fresh = target, True
        self._was_armed = self._telemetry.armed
        self._not_obeyed_since = None

    def stop(self) -> None:
        """Stop sending set-points."""
        self._target, self.fresh = None, False
        self.held = None

    def update(self) -> None:
        """Stop after new telemetry if disarmed, without authority, or not obeyed."""
        if self._target is None:
            return
        self._was_armed = self._was_armed or self._telemetry.armed
        if (self._was_armed and not self._telemetry.armed) or not self._decoder.authority:
            self.stop()
        elif self._not_obeyed():
            self._decoder.not_obeyed()
            self._decoder.update()
            self.stop()

    def _not_obeyed(self) -> bool:
        now = self._kernel.now()
        if not self._telemetry.flying or self._telemetry.mode not in WAITING or self._telemetry.failsafe:
            self._not_obeyed_since = None
        return self._not_obeyed_since is not None and now - self._not_obeyed_since > OBEYED_WITHIN

    def setpoint(self) -> Setpoint | None:
        """Return the set-point to send now, or ``None``."""
        self.fresh = False
        made = self._compute()
        if made is None:
            self._not_obeyed_since = None
        elif self._not_obeyed_since is None and self._telemetry.mode != SDK:
            self._not_obeyed_since = self._kernel.now()
        return made

    def _compute(self) -> Setpoint | None:
        target = self._target
        if isinstance(target, SdkPoint):
            return self._towards(target)
        if isinstance(target, Moving):
            return self._along(target)
        if isinstance(target, Tilted):
            return self._tilted(target)
        return None if target is None else self._manual(target)

    def _towards(self, target: SdkPoint) -> Setpoint | None:
        here = self._telemetry.position
        if here is None or not self._decoder.located or not isfinite(self._telemetry.above_home):
            return None
        beyond_east, beyond_north, _ = target.frame.to_enu(here.latitude, here.longitude, 0.0)
        east, north = -beyond_east, -beyond_north
        if target.speed is None:
            return POSITION_YAW, (east, north, target.height, target.yaw)
        away, carrot = hypot(east, north), target.speed * CARROT_S
        if away > target.speed * target.speed / (2.0 * BRAKES_M_S2) + carrot:
            return self._at_speed(target, (east, north), target.speed)
        share = min(1.0, carrot / away) if away > 0.0 else 1.0
        return POSITION_YAW, (east * share, north * share, target.height, target.yaw)

    def _at_speed(self, target: SdkPoint, offset: tuple[float, float], speed: float) -> Setpoint:
        """Fly straight; the climb is spread over the path."""
        away = hypot(*offset)
        climb = target.height - self._telemetry.above_home
        up = min(UP_M_S, max(-DOWN_M_S, climb / max(1.0, away / speed)))
        return VELOCITY_YAW_RATE, (offset[0] / away * speed, offset[1] / away * speed, up, 0.0)

    def _along(self, target: Moving) -> Setpoint | None:
        now = self._kernel.now()
        if now >= target.until + STOP_FOR:
            self._target = None
            return None
        velocity, turn = (target.velocity, target.turn) if now < target.until else (STILL, 0.0)
        return VELOCITY_YAW_RATE, (velocity.east, velocity.north, velocity.up, turn)

    def _tilted(self, target: Tilted) -> Setpoint | None:
        """Return tilt, climb rate and turn rate; a heading is turned to, slower near it."""
        now = self._kernel.now()
        if now >= target.until:
            return self._along(Moving(STILL, 0.0, target.until))
        attitude = target.attitude
        lean = (radians(attitude.roll), -radians(attitude.pitch))
        rate = attitude.yaw_rate
        if not isnan(attitude.heading):
            rate = (attitude.heading - self._telemetry.attitude.heading + 180.0) % 360.0 - 180.0
        turn = -min(STICK_YAW_RATE, max(-STICK_YAW_RATE, radians(rate)))
        return ANGLE_YAW_RATE_CLIMB, (*lean, _climb(attitude.thrust), turn)

    def _manual(self, target: SdkManual) -> Setpoint | None:
        control = self.held
        if control is None:
            return None
        lean = (control.roll * STICK_TILT, control.pitch * STICK_TILT)
        turn = -control.yaw * STICK_YAW_RATE
        if not target.keeps_height:
            return ANGLE_YAW_RATE_THRUST, (*lean, 100.0 * control.throttle, turn)
        return ANGLE_YAW_RATE_CLIMB, (*lean, _climb(control.throttle), turn)


def _climb(throttle: float) -> float:
    """Return the climb rate, m/s."""
    off = throttle - 0.5
    if abs(off) <= THROTTLE_DEAD:
        return 0.0
    reach = 0.5 - THROTTLE_DEAD
    return STICK_CLIMB * (off - THROTTLE_DEAD if off > 0.0 else off + THROTTLE_DEAD) / reach


def yaw_of(telemetry: Telemetry) -> float:
    """Return the present heading as a yaw of ROS; east if it is unknown."""
    heading = telemetry.attitude.heading
    return heading_to_yaw(radians(heading)) if isfinite(heading) else 0.0

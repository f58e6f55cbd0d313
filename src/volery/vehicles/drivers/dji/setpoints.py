"""What is sent 50 times a second: the remaining offset to a point, a velocity, or control.

An aircraft whose set-points are not fed brakes and hovers. So nothing is sent that would be wrong: no offset
from a place that is not known any more.
"""

from __future__ import annotations

from collections.abc import Sequence
from math import hypot, isfinite, pi, radians
from typing import NamedTuple

from volery.base.frames import LocalFrame, heading_to_yaw
from volery.base.time import MS, Ns, S
from volery.kernel.api import Kernel
from volery.ros.messages.dji_constants import (
    ANGLE_YAW_RATE_CLIMB,
    ANGLE_YAW_RATE_THRUST,
    POSITION_YAW,
    VELOCITY_YAW_RATE,
    DisplayMode,
)
from volery.vehicles.driver import ManualControl
from volery.vehicles.drivers.dji.decoder import WAITS, DjiDecoder
from volery.vehicles.telemetry import Telemetry, Velocity

STALE: Ns = 300 * MS
"""A place that is older is not reckoned from."""
STOP_FOR: Ns = 2 * S
"""So long zero velocity is sent at the end of a velocity."""
OBEYED_WITHIN: Ns = 3 * S
"""Set-points that show no effect for so long are not obeyed: somebody else has the authority."""

BRAKES_M_S2 = 1.0
UP_M_S, DOWN_M_S = 3.0, 2.0
"""How it goes at a stated speed: deceleration, and vertical speeds at most."""
CARROT_S = 1.0
"""Near its goal the offset is cut to what the stated speed covers in this time."""

STICK_TILT, STICK_YAW_RATE = radians(25.0), pi / 2.0
STICK_CLIMB = 2.0
"""At full deflection: radians, radians per second, metres per second."""
THROTTLE_DEAD = 0.05
"""About its middle the throttle keeps the height."""

STILL = Velocity(0.0, 0.0, 0.0)

Setpoint = tuple[int, Sequence[float]]
"""The flag, and four numbers in the conventions of ROS."""


class Point(NamedTuple):
    """Go there: degrees, metres above the point of take-off, yaw in radians anticlockwise from east."""

    latitude: float
    longitude: float
    height: float
    yaw: float
    speed: float | None = None


class Moving(NamedTuple):
    """Go at this velocity until then; the turn in radians per second anticlockwise."""

    velocity: Velocity
    turn: float
    until: Ns


class Manual(NamedTuple):
    """The control command: with ``keeps_height`` the throttle a climb rate, else the thrust."""

    keeps_height: bool


Target = Point | Moving | Manual


class SetpointStream:
    """Holds the present target. ``fresh``: it is another one, to be sent at once."""

    def __init__(self, kernel: Kernel, telemetry: Telemetry, decoder: DjiDecoder) -> None:
        self.held: ManualControl | None = None
        self.fresh = False
        self._kernel = kernel
        self._telemetry = telemetry
        self._decoder = decoder
        self._target: Target | None = None
        self._was_armed = False
        self._unheeded: Ns | None = None  # since when set-points have been sent without effect

    @property
    def wanted(self) -> bool:
        """There is something to send."""
        return self._target is not None

    @property
    def is_manual(self) -> bool:
        """The control command it."""
        return isinstance(self._target, Manual)

    def follow(self, target: Target) -> None:
        """From now on."""
        self._target, self.fresh = target, True
        self._was_armed = self._telemetry.armed
        self._unheeded = None

    def stop(self) -> None:
        """Nothing is sent any more."""
        self._target, self.fresh = None, False
        self.held = None

    def update(self) -> None:
        """After each round of telemetry: whether it makes sense to go on."""
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
        waits = {mode.name for mode in WAITS}
        now = self._kernel.now()
        if not self._telemetry.flying or self._telemetry.mode not in waits or self._telemetry.failsafe:
            self._unheeded = None
        return self._unheeded is not None and now - self._unheeded > OBEYED_WITHIN

    def setpoint(self) -> Setpoint | None:
        """What is to be sent now; ``None`` for nothing."""
        self.fresh = False
        made = self._made()
        if made is None:
            self._unheeded = None
        elif self._unheeded is None and self._telemetry.mode != DisplayMode.NAVI_SDK_CTRL.name:
            self._unheeded = self._kernel.now()
        return made

    def _made(self) -> Setpoint | None:
        target = self._target
        if isinstance(target, Point):
            return self._towards(target)
        if isinstance(target, Moving):
            return self._along(target)
        return None if target is None else self._manual(target)

    def _towards(self, target: Point) -> Setpoint | None:
        here = self._telemetry.position
        if here is None or self._kernel.now() - self._decoder.located_at > STALE:
            return None
        east, north, _ = LocalFrame(here.latitude, here.longitude, 0.0).to_enu(
            target.latitude, target.longitude, 0.0
        )
        if target.speed is None:
            return POSITION_YAW, (east, north, target.height, target.yaw)
        away, carrot = hypot(east, north), target.speed * CARROT_S
        if away > target.speed**2 / (2.0 * BRAKES_M_S2) + carrot:
            return self._at_speed(target, (east, north), target.speed)
        share = min(1.0, carrot / away) if away > 0.0 else 1.0
        return POSITION_YAW, (east * share, north * share, target.height, target.yaw)

    def _at_speed(self, target: Point, offset: tuple[float, float], speed: float) -> Setpoint:
        """Straight there: the climb is spread over the way."""
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

    def _manual(self, target: Manual) -> Setpoint | None:
        control = self.held
        if control is None:
            return None
        lean = (control.roll * STICK_TILT, control.pitch * STICK_TILT)
        turn = -control.yaw * STICK_YAW_RATE
        if not target.keeps_height:
            return ANGLE_YAW_RATE_THRUST, (*lean, 100.0 * control.throttle, turn)
        return ANGLE_YAW_RATE_CLIMB, (*lean, _climb(control.throttle), turn)


def _climb(throttle: float) -> float:
    """Metres per second up."""
    off = throttle - 0.5
    if abs(off) <= THROTTLE_DEAD:
        return 0.0
    reach = 0.5 - THROTTLE_DEAD
    return STICK_CLIMB * (off - THROTTLE_DEAD if off > 0.0 else off + THROTTLE_DEAD) / reach


def yaw_of(telemetry: Telemetry) -> float:
    """The present heading as a yaw of ROS; east where it is unknown."""
    heading = telemetry.attitude.heading
    return heading_to_yaw(radians(heading)) if isfinite(heading) else 0.0

"""What is sent 50 times a second: the remaining offset to a point, a velocity, or sticks.

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
    """The sticks command: with ``keeps_height`` the throttle a climb rate, else the thrust."""

    keeps_height: bool


Aim = Point | Moving | Manual


class SetpointStream:
    """Holds the present aim. ``fresh``: it is another one, to be sent at once."""

    def __init__(self, kernel: Kernel, telemetry: Telemetry, hearing: DjiDecoder) -> None:
        self.held: ManualControl | None = None
        self.fresh = False
        self._kernel = kernel
        self._seen = telemetry
        self._hearing = hearing
        self._aim: Aim | None = None
        self._was_armed = False
        self._unheeded: Ns | None = None  # since when set-points have been sent without effect

    @property
    def wanted(self) -> bool:
        """There is something to send."""
        return self._aim is not None

    @property
    def by_hand(self) -> bool:
        """The sticks command it."""
        return isinstance(self._aim, Manual)

    def aim(self, aim: Aim) -> None:
        """From now on."""
        self._aim, self.fresh = aim, True
        self._was_armed = self._seen.armed
        self._unheeded = None

    def stop(self) -> None:
        """Nothing is sent any more."""
        self._aim, self.fresh = None, False
        self.held = None

    def judge(self) -> None:
        """After each round of telemetry: whether it makes sense to go on."""
        if self._aim is None:
            return
        self._was_armed = self._was_armed or self._seen.armed
        if (self._was_armed and not self._seen.armed) or not self._hearing.authority:
            self.stop()
        elif self._not_obeyed():
            self._hearing.not_obeyed()
            self._hearing.judge()
            self.stop()

    def _not_obeyed(self) -> bool:
        waits = {mode.name for mode in WAITS}
        now = self._kernel.now()
        if not self._seen.flying or self._seen.mode not in waits or self._seen.failsafe:
            self._unheeded = None
        return self._unheeded is not None and now - self._unheeded > OBEYED_WITHIN

    def setpoint(self) -> Setpoint | None:
        """What is to be sent now; ``None`` for nothing."""
        self.fresh = False
        made = self._made()
        if made is None:
            self._unheeded = None
        elif self._unheeded is None and self._seen.mode != DisplayMode.NAVI_SDK_CTRL.name:
            self._unheeded = self._kernel.now()
        return made

    def _made(self) -> Setpoint | None:
        aim = self._aim
        if isinstance(aim, Point):
            return self._towards(aim)
        if isinstance(aim, Moving):
            return self._along(aim)
        return None if aim is None else self._sticks(aim)

    def _towards(self, aim: Point) -> Setpoint | None:
        here = self._seen.position
        if here is None or self._kernel.now() - self._hearing.located_at > STALE:
            return None
        east, north, _ = LocalFrame(here.latitude, here.longitude, 0.0).to_enu(
            aim.latitude, aim.longitude, 0.0
        )
        if aim.speed is None:
            return POSITION_YAW, (east, north, aim.height, aim.yaw)
        away, carrot = hypot(east, north), aim.speed * CARROT_S
        if away > aim.speed**2 / (2.0 * BRAKES_M_S2) + carrot:
            return self._at_speed(aim, (east, north), aim.speed)
        share = min(1.0, carrot / away) if away > 0.0 else 1.0
        return POSITION_YAW, (east * share, north * share, aim.height, aim.yaw)

    def _at_speed(self, aim: Point, offset: tuple[float, float], speed: float) -> Setpoint:
        """Straight there: the climb is spread over the way."""
        away = hypot(*offset)
        climb = aim.height - self._seen.above_home
        up = min(UP_M_S, max(-DOWN_M_S, climb / max(1.0, away / speed)))
        return VELOCITY_YAW_RATE, (offset[0] / away * speed, offset[1] / away * speed, up, 0.0)

    def _along(self, aim: Moving) -> Setpoint | None:
        now = self._kernel.now()
        if now >= aim.until + STOP_FOR:
            self._aim = None
            return None
        velocity, turn = (aim.velocity, aim.turn) if now < aim.until else (STILL, 0.0)
        return VELOCITY_YAW_RATE, (velocity.east, velocity.north, velocity.up, turn)

    def _sticks(self, aim: Manual) -> Setpoint | None:
        sticks = self.held
        if sticks is None:
            return None
        lean = (sticks.roll * STICK_TILT, sticks.pitch * STICK_TILT)
        turn = -sticks.yaw * STICK_YAW_RATE
        if not aim.keeps_height:
            return ANGLE_YAW_RATE_THRUST, (*lean, 100.0 * sticks.throttle, turn)
        return ANGLE_YAW_RATE_CLIMB, (*lean, _climb(sticks.throttle), turn)


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

"""Set-points and sticks: MAVLink's messages as what a drone is told."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from math import cos, degrees, radians, sin
from typing import Any, ClassVar, Protocol

from volery.base.errors import UsageError
from volery.base.position import AMSL, AboveGround, AboveHome, Altitude, Position
from volery.bridge.interpreter.telling import about
from volery.vehicles.driver import Sticks
from volery.vehicles.drone import Drone
from volery.vehicles.telemetry import Telemetry, Velocity

Fields = dict[str, Any]

NO_POSITION, NO_VELOCITY, NO_YAW, NO_YAW_RATE = 0x007, 0x038, 0x400, 0x800
"""Bits of POSITION_TARGET_TYPEMASK: what to ignore."""
ABOUT_HERE = frozenset({7, 8, 9, 12})
"""MAV_FRAMEs whose positions count from where it is."""
BY_HEADING = frozenset({8, 9, 12})
"""Those that lie forward, right and down of it."""
ALTITUDES: Mapping[int, type[Altitude]] = {
    0: AMSL,
    3: AboveHome,
    5: AMSL,
    6: AboveHome,
    10: AboveGround,
    11: AboveGround,
}
"""What altitudes count from, by MAV_FRAME."""


class Aim(Protocol):
    """A set-point. ``stays``: it holds until the next one, so that the same one once more says nothing."""

    stays: ClassVar[bool]

    def fly(self, drone: Drone) -> None:
        """Raises what the drone's operations raise."""


@dataclass(frozen=True)
class Place:
    """Somewhere to go, and a heading in degrees to turn to when it is there; ``None``: as it comes."""

    goal: Position
    heading: float | None
    speed: float | None = None
    stays: ClassVar[bool] = True

    def fly(self, drone: Drone) -> None:
        """Blocks until it is there."""
        drone.goto(self.goal, self.speed)
        if self.heading is not None:
            drone.set_heading(self.heading)


@dataclass(frozen=True)
class Motion:
    """A velocity, and degrees per second clockwise. It stands for as long as the drone's usual."""

    velocity: Velocity
    yaw_rate: float
    stays: ClassVar[bool] = False

    def fly(self, drone: Drone) -> None:
        """Returns as soon as it is under way."""
        drone.set_velocity(*self.velocity, yaw_rate=self.yaw_rate)


def local_aim(fields: Fields, seen: Telemetry) -> Aim:
    """SET_POSITION_TARGET_LOCAL_NED. Positions are about home, or about where it is.

    Raises ``UsageError`` for what is neither a position nor a velocity, or while it is not known where it is.
    """
    if _states(fields, NO_POSITION):
        return Place(_local_goal(fields, seen), _heading(fields, seen))
    return _motion(fields, seen)


def global_aim(fields: Fields, seen: Telemetry) -> Aim:
    """SET_POSITION_TARGET_GLOBAL_INT; see ``local_aim``."""
    if _states(fields, NO_POSITION):
        goal = on_globe(fields["coordinate_frame"], fields["lat_int"], fields["lon_int"], fields["alt"])
        return Place(goal, _heading(fields, seen))
    return _motion(fields, seen)


def on_globe(frame: int, latitude: int, longitude: int, altitude: float) -> Position:
    """A place in 1e-7 degrees, its altitude in that MAV_FRAME. Raises ``UsageError`` if that has none."""
    if frame not in ALTITUDES:
        raise UsageError(f"MAV_FRAME {frame}: altitudes are above the sea, above home or above ground")
    return Position(latitude / 1e7, longitude / 1e7, ALTITUDES[frame](altitude))


def _states(fields: Fields, bits: int) -> bool:
    return not fields["type_mask"] & bits


def _local_goal(fields: Fields, seen: Telemetry) -> Position:
    home, here = seen.home, seen.position
    if home is None or here is None:
        raise UsageError("a place about home: it is not known yet where that is")
    north, east = _north_east(fields, "x", "y", seen)
    up = -fields["z"]
    origin = home
    if fields["coordinate_frame"] in ABOUT_HERE:
        origin, up = here, up + seen.above_home
    latitude, longitude, _ = about(origin).from_enu((east, north, 0.0))
    return Position(latitude, longitude, AboveHome(up))


def _motion(fields: Fields, seen: Telemetry) -> Motion:
    if not _states(fields, NO_VELOCITY):
        raise UsageError("a set-point that is neither a whole position nor a whole velocity")
    north, east = _north_east(fields, "vx", "vy", seen)
    rate = degrees(fields["yaw_rate"]) if _states(fields, NO_YAW_RATE) else 0.0
    return Motion(Velocity(north, east, -fields["vz"]), rate)


def _north_east(fields: Fields, x: str, y: str, seen: Telemetry) -> tuple[float, float]:
    first, second = fields[x], fields[y]
    if fields["coordinate_frame"] not in BY_HEADING:
        return first, second
    way = radians(seen.attitude.heading)
    return first * cos(way) - second * sin(way), first * sin(way) + second * cos(way)


def _heading(fields: Fields, seen: Telemetry) -> float | None:
    if not _states(fields, NO_YAW):
        return None
    from_own = fields["coordinate_frame"] in BY_HEADING
    return (degrees(fields["yaw"]) + (seen.attitude.heading if from_own else 0.0)) % 360.0


# -- sticks

MIDDLE_US, HALF_US = 1500.0, 500.0
RELEASED, LEFT_ALONE = 0, 65_535
CHANNELS = 4
UNUSED = 32_767
"""An axis of MANUAL_CONTROL that is not there."""


class Channels:
    """The first four channels of RC_CHANNELS_OVERRIDE: roll, pitch (low is forward), throttle, yaw."""

    def __init__(self) -> None:
        self._held: dict[int, int] = {}

    def take(self, fields: Fields) -> Sticks | None:
        """The sticks from now on; ``None`` if no channel is held. One that is not held is in the middle."""
        for number in range(1, CHANNELS + 1):
            pulse = fields[f"chan{number}_raw"]
            if pulse == RELEASED:
                self._held.pop(number, None)
            elif pulse != LEFT_ALONE:
                self._held[number] = pulse
        if not self._held:
            return None
        roll, pitch, throttle, yaw = (self._held.get(one, MIDDLE_US) for one in range(1, CHANNELS + 1))
        return _sticks(-_aside(pitch), _aside(roll), (_aside(throttle) + 1.0) / 2.0, _aside(yaw))


def _aside(pulse: float) -> float:
    """From -1 to 1."""
    return (pulse - MIDDLE_US) / HALF_US


def axes(fields: Fields) -> Sticks:
    """MANUAL_CONTROL: thousandths; x forward, y right, z throttle, r clockwise."""
    given = {name: fields[name] for name in "xyzr"}
    x, y, z, r = (given[name] / 1000.0 if given[name] != UNUSED else _REST[name] for name in "xyzr")
    return _sticks(x, y, z, r)


_REST = {"x": 0.0, "y": 0.0, "z": 0.5, "r": 0.0}


def _sticks(pitch: float, roll: float, throttle: float, yaw: float) -> Sticks:
    """Beyond the end of its way a stick is at its end."""
    return Sticks(_within(pitch, -1.0), _within(roll, -1.0), _within(throttle, 0.0), _within(yaw, -1.0))


def _within(value: float, low: float) -> float:
    return min(1.0, max(low, value))

"""Set-points and sticks: MAVLink's messages as what a drone is told.

Commands: MAVLink's numbers as operations of a drone.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import partial
from math import cos, degrees, isfinite, radians, sin
from typing import Any, ClassVar, NamedTuple

from volery.base.errors import CapabilityError, Refused, UsageError, choices
from volery.base.position import AMSL, AboveGround, AboveHome, Altitude, Position
from volery.bridge.mavlink_adapter.command_handler import Operation, Target
from volery.bridge.mavlink_adapter.telemetry_encoder import CUSTOM_MODE_ENABLED, local_frame
from volery.bridge.mode_names import DJI_ID, PAPARAZZI_ID, AutopilotType, mode_name
from volery.links.mavlink_messages import constant, entry_name
from volery.vehicles.driver import ManualControl
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


@dataclass(frozen=True)
class PositionTarget:
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
class VelocityTarget:
    """A velocity, and degrees per second clockwise. It stands for as long as the drone's usual."""

    velocity: Velocity
    yaw_rate: float
    stays: ClassVar[bool] = False

    def fly(self, drone: Drone) -> None:
        """Returns as soon as it is under way."""
        drone.set_velocity(*self.velocity, yaw_rate=self.yaw_rate)


def local_target(fields: Fields, seen: Telemetry) -> Target:
    """SET_POSITION_TARGET_LOCAL_NED. Positions are about home, or about where it is.

    Raises ``UsageError`` for what is neither a position nor a velocity, or while it is not known where it is.
    """
    if _states(fields, NO_POSITION):
        return PositionTarget(_local_goal(fields, seen), _heading(fields, seen))
    return _motion(fields, seen)


def global_target(fields: Fields, seen: Telemetry) -> Target:
    """SET_POSITION_TARGET_GLOBAL_INT; see ``local_target``."""
    if _states(fields, NO_POSITION):
        goal = global_position(
            fields["coordinate_frame"], fields["lat_int"], fields["lon_int"], fields["alt"]
        )
        return PositionTarget(goal, _heading(fields, seen))
    return _motion(fields, seen)


def global_position(frame: int, latitude: int, longitude: int, altitude: float) -> Position:
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
    latitude, longitude, _ = local_frame(origin).from_enu((east, north, 0.0))
    return Position(latitude, longitude, AboveHome(up))


def _motion(fields: Fields, seen: Telemetry) -> VelocityTarget:
    if not _states(fields, NO_VELOCITY):
        raise UsageError("a set-point that is neither a whole position nor a whole velocity")
    north, east = _north_east(fields, "vx", "vy", seen)
    rate = degrees(fields["yaw_rate"]) if _states(fields, NO_YAW_RATE) else 0.0
    return VelocityTarget(Velocity(north, east, -fields["vz"]), rate)


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


class RcChannels:
    """The first four channels of RC_CHANNELS_OVERRIDE: roll, pitch (low is forward), throttle, yaw."""

    def __init__(self) -> None:
        self._held: dict[int, int] = {}

    def take(self, fields: Fields) -> ManualControl | None:
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


def manual_control_axes(fields: Fields) -> ManualControl:
    """MANUAL_CONTROL: thousandths; x forward, y right, z throttle, r clockwise."""
    given = {name: fields[name] for name in "xyzr"}
    x, y, z, r = (given[name] / 1000.0 if given[name] != UNUSED else _REST[name] for name in "xyzr")
    return _sticks(x, y, z, r)


_REST = {"x": 0.0, "y": 0.0, "z": 0.5, "r": 0.0}


def _sticks(pitch: float, roll: float, throttle: float, yaw: float) -> ManualControl:
    """Beyond the end of its way a stick is at its end."""
    return ManualControl(
        _within(pitch, -1.0), _within(roll, -1.0), _within(throttle, 0.0), _within(yaw, -1.0)
    )


def _within(value: float, low: float) -> float:
    return min(1.0, max(low, value))


RELATIVE_ALT = constant("MAV_FRAME_GLOBAL_RELATIVE_ALT")
FORCE = 21_196
"""Second parameter of a disarming: in the air, too."""
READY_WITHIN_S = 2.0
"""So long a take-off waits for an aircraft that is not ready, instead of the drone's own two minutes: whoever
asked is waiting for the answer.
"""

DroneMethod = Callable[[Drone], None]

MODES: Mapping[int, Mapping[str, DroneMethod]] = {
    PAPARAZZI_ID: {
        "GUIDED": Drone.hold,
        "ATTITUDE_DIRECT": Drone.stabilize,
        "ATTITUDE_RC_CLIMB": Drone.altitude_hold,
    },
    DJI_ID: {
        "P_GPS": Drone.hold,
        "ATTITUDE": Drone.altitude_hold,
        "MANUAL_CTRL": Drone.stabilize,
        "AUTO_LANDING": Drone.land,
        "NAVI_GO_HOME": Drone.return_home,
        "NAVI_MISSION": Drone.start_mission,
    },
}
"""What leads to a mode that may be asked for, by MAV_AUTOPILOT. A DJI that a program flies by sticks shows
NAVI_SDK_CTRL.
"""
BY_HAND = (Drone.stabilize, Drone.altitude_hold)


class MavlinkCommand(NamedTuple):
    """COMMAND_LONG or COMMAND_INT. ``x`` and ``y`` are 1e-7 degrees, ``z`` metres in ``frame``."""

    number: int
    parameters: tuple[float, float, float, float]
    x: int
    y: int
    z: float
    frame: int


def from_long(fields: Fields) -> MavlinkCommand:
    """COMMAND_LONG: its altitudes are above home."""
    x, y = (round(one * 1e7) if isfinite(one) else 0 for one in (fields["param5"], fields["param6"]))
    return MavlinkCommand(fields["command"], _first_four(fields), x, y, fields["param7"], RELATIVE_ALT)


def from_int(fields: Fields) -> MavlinkCommand:
    """COMMAND_INT."""
    return MavlinkCommand(
        fields["command"], _first_four(fields), fields["x"], fields["y"], fields["z"], fields["frame"]
    )


def _first_four(fields: Fields) -> tuple[float, float, float, float]:
    return fields["param1"], fields["param2"], fields["param3"], fields["param4"]


def to_integer(value: float) -> int:
    """The nearest integer. Raises ``UsageError`` for what is no number."""
    if not isfinite(value):
        raise UsageError(f"{value} where a number belongs")
    return round(value)


class CommandDecoder:
    """Makes orders for *drone*."""

    def __init__(self, drone: Drone) -> None:
        self._drone = drone
        self._known: Mapping[int, Callable[[MavlinkCommand], Operation]] = {
            constant("MAV_CMD_COMPONENT_ARM_DISARM"): self._arm,
            constant("MAV_CMD_NAV_TAKEOFF"): self._take_off,
            constant("MAV_CMD_NAV_LAND"): lambda command: Operation("land", self._drone.land),
            constant("MAV_CMD_NAV_RETURN_TO_LAUNCH"): lambda command: Operation(
                "return home", self._drone.return_home
            ),
            constant("MAV_CMD_MISSION_START"): lambda command: Operation(
                "start the mission", self._drone.start_mission
            ),
            constant("MAV_CMD_DO_REPOSITION"): self._reposition,
            constant("MAV_CMD_CONDITION_YAW"): self._turn,
        }

    def of(self, command: MavlinkCommand) -> Operation:
        """Raises ``CapabilityError`` for a command that is not interpreted, ``UsageError`` for one that makes
        no sense.
        """
        make = self._known.get(command.number)
        if make is None:
            name = entry_name("MAV_CMD", command.number)
            known = choices(entry_name("MAV_CMD", number) for number in self._known)
            raise CapabilityError(f"{self._drone.name}: no command {name} here; there is {known}")
        return make(command)

    def _arm(self, command: MavlinkCommand) -> Operation:
        drone, (value, force, *_) = self._drone, command.parameters
        if value == 1.0:
            return Operation("arm", drone.arm, answered_when_done=True, waits=True)
        if value != 0.0:
            raise UsageError(f"{drone.name}: arm or disarm: {value:g}; 1 arms, 0 disarms")
        if force == FORCE:
            return Operation("stop the motors", partial(drone.kill, sure=True), answered_when_done=True)
        return Operation("disarm", drone.disarm, answered_when_done=True)

    def _take_off(self, command: MavlinkCommand) -> Operation:
        height = self._above_home(command)

        def body() -> None:
            self._drone.wait_ready(READY_WITHIN_S)
            self._drone.takeoff(height)

        return Operation(f"take off to {height:g} m", body)

    def _above_home(self, command: MavlinkCommand) -> float:
        if ALTITUDES.get(command.frame) is AMSL:
            return command.z - self._drone.home.altitude.metres
        return command.z

    def _reposition(self, command: MavlinkCommand) -> Operation:
        speed, _, _, heading = command.parameters
        goal = global_position(command.frame, command.x, command.y, command.z)
        place = PositionTarget(goal, heading if isfinite(heading) else None, speed if speed > 0.0 else None)
        return Operation(f"go to {goal}", lambda: place.fly(self._drone))

    def _turn(self, command: MavlinkCommand) -> Operation:
        degrees, _, way, relative = command.parameters
        if relative:
            degrees = self._drone.attitude.heading + (degrees if way >= 0.0 else -degrees)
        return Operation(f"turn to {degrees % 360.0:g} degrees", lambda: self._drone.set_heading(degrees))

    def mode(self, firmware: AutopilotType, base: int, number: int) -> Operation:
        """What leads to a mode. Raises ``CapabilityError`` if nothing does."""
        known = MODES.get(firmware.autopilot, {})
        name = mode_name(firmware, number)
        operation = known.get(name) if base & CUSTOM_MODE_ENABLED else None
        if operation is None:
            asked = name if base & CUSTOM_MODE_ENABLED else f"of base mode {base}"
            raise CapabilityError(
                f"{self._drone.name}: no mode {asked} to be asked for; there is {choices(known)}"
            )
        asked = f"change to {name}"
        if operation is Drone.hold:
            return Operation(asked, partial(self._hold, asked, name))
        return Operation(asked, partial(operation, self._drone), by_hand=operation in BY_HAND)

    def _hold(self, asked: str, mode: str) -> None:
        if not self._drone.flying and self._drone.mode != mode:
            raise Refused(self._drone.name, asked, "it is on the ground; taking off leads there by itself")
        self._drone.hold()

"""Decoding of MAVLink commands, set-points and manual control as operations of a drone."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import partial
from math import degrees, isfinite, radians
from typing import Any, ClassVar, NamedTuple

from volery.base.errors import CapabilityError, Refused, UsageError, choices
from volery.base.frames import turn_clockwise
from volery.base.position import AMSL, AboveGround, AboveHome, Altitude, Position
from volery.bridge.autopilot_link import DJI_ID, PAPARAZZI_ID, AutopilotType, mode_name
from volery.bridge.mavlink_adapter.command_handler import BridgeSetpoint, DroneOperation
from volery.bridge.mavlink_adapter.telemetry_encoder import CUSTOM_MODE_ENABLED, local_frame
from volery.links.mavlink_messages import constant, entry_name
from volery.vehicles.driver import ManualControl
from volery.vehicles.drone import Drone
from volery.vehicles.telemetry import Telemetry, Velocity

Fields = dict[str, Any]

ALTITUDES: Mapping[int, type[Altitude]] = {
    0: AMSL,
    3: AboveHome,
    5: AMSL,
    6: AboveHome,
    10: AboveGround,
    11: AboveGround,
}
"""Reference of altitudes by MAV_FRAME."""


def global_position(frame: int, latitude: int, longitude: int, altitude: float) -> Position:
    """Return a position.

    Args:
        frame: MAV_FRAME of the altitude.
        latitude: 1e-7 degrees.
        longitude: 1e-7 degrees.
        altitude: Metres.

    Raises:
        UsageError: The frame is not global.
    """
    if frame not in ALTITUDES:
        raise UsageError(f"MAV_FRAME {frame}: altitudes are above the sea, above home or above ground")
    return Position(latitude / 1e7, longitude / 1e7, ALTITUDES[frame](altitude))


# -- set-points

NO_POSITION, NO_VELOCITY, NO_YAW, NO_YAW_RATE = 0x007, 0x038, 0x400, 0x800
"""Bits of POSITION_TARGET_TYPEMASK for fields to ignore."""
RELATIVE_FRAMES = frozenset({7, 8, 9, 12})
"""MAV_FRAMEs whose positions are relative to the current position."""
BODY_FRAMES = frozenset({8, 9, 12})
"""MAV_FRAMEs whose axes are forward, right and down."""


@dataclass(frozen=True)
class PositionTarget:
    """A position to go to, and a heading in degrees to turn to there; None keeps the heading."""

    goal: Position
    heading: float | None
    speed: float | None = None
    persistent: ClassVar[bool] = True

    def fly(self, drone: Drone) -> None:
        """Go to the position and turn; blocks until the drone has arrived."""
        drone.goto(self.goal, self.speed)
        if self.heading is not None:
            drone.set_heading(self.heading)


@dataclass(frozen=True)
class VelocityTarget:
    """A velocity, and a yaw rate in degrees per second clockwise, valid for the usual time of the drone."""

    velocity: Velocity
    yaw_rate: float
    persistent: ClassVar[bool] = False

    def fly(self, drone: Drone) -> None:
        """Set the velocity and return."""
        drone.set_velocity(*self.velocity, yaw_rate=self.yaw_rate)


def local_target(fields: Fields, seen: Telemetry) -> BridgeSetpoint:
    """Return the target in a SET_POSITION_TARGET_LOCAL_NED, relative to home or to the current position.

    Raises:
        UsageError: It contains neither a position nor a velocity, or the own position is unknown.
    """
    if _contains(fields, NO_POSITION):
        return PositionTarget(_local_goal(fields, seen), _heading(fields, seen))
    return _velocity_target(fields, seen)


def global_target(fields: Fields, seen: Telemetry) -> BridgeSetpoint:
    """Return the target in a SET_POSITION_TARGET_GLOBAL_INT; see ``local_target``."""
    if _contains(fields, NO_POSITION):
        goal = global_position(
            fields["coordinate_frame"], fields["lat_int"], fields["lon_int"], fields["alt"]
        )
        return PositionTarget(goal, _heading(fields, seen))
    return _velocity_target(fields, seen)


def _contains(fields: Fields, ignore_bits: int) -> bool:
    return not fields["type_mask"] & ignore_bits


def _local_goal(fields: Fields, seen: Telemetry) -> Position:
    home, here = seen.home, seen.position
    if home is None or here is None:
        raise UsageError("a place about home: it is not known yet where that is")
    north, east = _north_east(fields, "x", "y", seen)
    up = -fields["z"]
    origin = home
    if fields["coordinate_frame"] in RELATIVE_FRAMES:
        origin, up = here, up + seen.above_home
    latitude, longitude, _ = local_frame(origin).from_enu((east, north, 0.0))
    return Position(latitude, longitude, AboveHome(up))


def _velocity_target(fields: Fields, seen: Telemetry) -> VelocityTarget:
    if not _contains(fields, NO_VELOCITY):
        raise UsageError("a set-point that is neither a whole position nor a whole velocity")
    north, east = _north_east(fields, "vx", "vy", seen)
    rate = degrees(fields["yaw_rate"]) if _contains(fields, NO_YAW_RATE) else 0.0
    return VelocityTarget(Velocity(north, east, -fields["vz"]), rate)


def _north_east(fields: Fields, x: str, y: str, seen: Telemetry) -> tuple[float, float]:
    first, second = fields[x], fields[y]
    if fields["coordinate_frame"] not in BODY_FRAMES:
        return first, second
    heading = radians(seen.attitude.heading)
    return turn_clockwise((first, second), heading)


def _heading(fields: Fields, seen: Telemetry) -> float | None:
    if not _contains(fields, NO_YAW):
        return None
    relative = fields["coordinate_frame"] in BODY_FRAMES
    return (degrees(fields["yaw"]) + (seen.attitude.heading if relative else 0.0)) % 360.0


# -- manual control

MIDDLE_US, HALF_US = 1500.0, 500.0
RELEASED, UNCHANGED = 0, 65_535
CHANNELS = 4
UNUSED = 32_767
"""Value of an axis of MANUAL_CONTROL that does not exist."""
_NEUTRAL = {"x": 0.0, "y": 0.0, "z": 0.5, "r": 0.0}


class ChannelsOverride:
    """The first four channels of RC_CHANNELS_OVERRIDE: roll, pitch (low is forward), throttle, yaw."""

    def __init__(self) -> None:
        self._held: dict[int, int] = {}

    def update(self, fields: Fields) -> ManualControl | None:
        """Apply an override and return the manual control, or None if no channel is held.

        A channel that is not held is in its middle position.
        """
        for number in range(1, CHANNELS + 1):
            pulse = fields[f"chan{number}_raw"]
            if pulse == RELEASED:
                self._held.pop(number, None)
            elif pulse != UNCHANGED:
                self._held[number] = pulse
        if not self._held:
            return None
        roll, pitch, throttle, yaw = (
            (self._held.get(one, MIDDLE_US) - MIDDLE_US) / HALF_US for one in range(1, CHANNELS + 1)
        )
        return _limited(-pitch, roll, (throttle + 1.0) / 2.0, yaw)


def manual_control_axes(fields: Fields) -> ManualControl:
    """Return the control in a MANUAL_CONTROL: thousandths; x forward, y right, z throttle, r clockwise."""
    given = {name: fields[name] for name in "xyzr"}
    x, y, z, r = (given[name] / 1000.0 if given[name] != UNUSED else _NEUTRAL[name] for name in "xyzr")
    return _limited(x, y, z, r)


def _limited(pitch: float, roll: float, throttle: float, yaw: float) -> ManualControl:
    """Return the manual control with each axis limited to its range."""

    def limit(value: float, low: float) -> float:
        return min(1.0, max(low, value))

    return ManualControl(limit(pitch, -1.0), limit(roll, -1.0), limit(throttle, 0.0), limit(yaw, -1.0))


# -- commands

RELATIVE_ALT = constant("MAV_FRAME_GLOBAL_RELATIVE_ALT")
FORCE = 21_196
"""Second parameter of a disarm command that is executed in the air as well."""
READY_TIMEOUT_S = 2.0
"""How long a take-off waits for the vehicle to be ready. The drone's default of two minutes is longer than
the sender of a command waits for the acknowledgement.
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
"""Operations that lead to the modes that can be requested, by MAV_AUTOPILOT. A DJI that a program flies by
manual control reports NAVI_SDK_CTRL.
"""
BY_HAND = (Drone.stabilize, Drone.altitude_hold)


class MavlinkCommand(NamedTuple):
    """A COMMAND_LONG or COMMAND_INT. ``x`` and ``y`` are in 1e-7 degrees, ``z`` is in metres in ``frame``."""

    number: int
    parameters: tuple[float, float, float, float]
    x: int
    y: int
    z: float
    frame: int


def from_long(fields: Fields) -> MavlinkCommand:
    """Return the command in a COMMAND_LONG, whose altitudes are above home."""
    x, y = (round(one * 1e7) if isfinite(one) else 0 for one in (fields["param5"], fields["param6"]))
    return MavlinkCommand(fields["command"], _first_four(fields), x, y, fields["param7"], RELATIVE_ALT)


def from_int(fields: Fields) -> MavlinkCommand:
    """Return the command in a COMMAND_INT."""
    return MavlinkCommand(
        fields["command"], _first_four(fields), fields["x"], fields["y"], fields["z"], fields["frame"]
    )


def _first_four(fields: Fields) -> tuple[float, float, float, float]:
    return fields["param1"], fields["param2"], fields["param3"], fields["param4"]


def to_integer(value: float) -> int:
    """Return the nearest integer; raise ``UsageError`` if *value* is not finite."""
    if not isfinite(value):
        raise UsageError(f"{value} where a number belongs")
    return round(value)


class CommandDecoder:
    """Converts commands to operations of *drone*."""

    def __init__(self, drone: Drone) -> None:
        self._drone = drone
        self._decoders: Mapping[int, Callable[[MavlinkCommand], DroneOperation]] = {
            constant("MAV_CMD_COMPONENT_ARM_DISARM"): self._arm,
            constant("MAV_CMD_NAV_TAKEOFF"): self._take_off,
            constant("MAV_CMD_NAV_LAND"): lambda command: DroneOperation("land", self._drone.land),
            constant("MAV_CMD_NAV_RETURN_TO_LAUNCH"): lambda command: DroneOperation(
                "return home", self._drone.return_home
            ),
            constant("MAV_CMD_MISSION_START"): lambda command: DroneOperation(
                "start the mission", self._drone.start_mission
            ),
            constant("MAV_CMD_DO_REPOSITION"): self._reposition,
            constant("MAV_CMD_CONDITION_YAW"): self._turn,
        }

    def decode(self, command: MavlinkCommand) -> DroneOperation:
        """Return the operation that executes *command*.

        Raises:
            CapabilityError: The command is not supported.
            UsageError: A parameter is invalid.
        """
        decoder = self._decoders.get(command.number)
        if decoder is None:
            name = entry_name("MAV_CMD", command.number)
            known = choices(entry_name("MAV_CMD", number) for number in self._decoders)
            raise CapabilityError(f"{self._drone.name}: no command {name} here; there is {known}")
        return decoder(command)

    def _arm(self, command: MavlinkCommand) -> DroneOperation:
        drone, (value, force, *_) = self._drone, command.parameters
        if value == 1.0:
            return DroneOperation("arm", drone.arm, answered_when_done=True, waits=True)
        if value != 0.0:
            raise UsageError(f"{drone.name}: arm or disarm: {value:g}; 1 arms, 0 disarms")
        if force == FORCE:
            return DroneOperation("stop the motors", partial(drone.kill, sure=True), answered_when_done=True)
        return DroneOperation("disarm", drone.disarm, answered_when_done=True)

    def _take_off(self, command: MavlinkCommand) -> DroneOperation:
        height = command.z
        if ALTITUDES.get(command.frame) is AMSL:
            height -= self._drone.home.altitude.metres

        def body() -> None:
            self._drone.wait_ready(READY_TIMEOUT_S)
            self._drone.takeoff(height)

        return DroneOperation(f"take off to {height:g} m", body)

    def _reposition(self, command: MavlinkCommand) -> DroneOperation:
        speed, _, _, heading = command.parameters
        goal = global_position(command.frame, command.x, command.y, command.z)
        target = PositionTarget(goal, heading if isfinite(heading) else None, speed if speed > 0.0 else None)
        return DroneOperation(f"go to {goal}", lambda: target.fly(self._drone))

    def _turn(self, command: MavlinkCommand) -> DroneOperation:
        heading, _, direction, relative = command.parameters
        if relative:
            heading = self._drone.attitude.heading + (heading if direction >= 0.0 else -heading)
        return DroneOperation(
            f"turn to {heading % 360.0:g} degrees", lambda: self._drone.set_heading(heading)
        )

    def change_mode(self, autopilot: AutopilotType, base: int, number: int) -> DroneOperation:
        """Return the operation that leads to a mode.

        Args:
            autopilot: Determines the names of the modes.
            base: MAV_MODE_FLAG.
            number: Custom mode.

        Raises:
            CapabilityError: No operation leads to the mode.
        """
        known = MODES.get(autopilot.autopilot, {})
        name = mode_name(autopilot, number)
        method = known.get(name) if base & CUSTOM_MODE_ENABLED else None
        if method is None:
            mode = name if base & CUSTOM_MODE_ENABLED else f"of base mode {base}"
            raise CapabilityError(
                f"{self._drone.name}: mode {mode} cannot be requested; there is {choices(known)}"
            )
        description = f"change to {name}"
        if method is Drone.hold:
            return DroneOperation(description, partial(self._hold, description, name))
        return DroneOperation(description, partial(method, self._drone), by_hand=method in BY_HAND)

    def _hold(self, description: str, mode: str) -> None:
        if not self._drone.flying and self._drone.mode != mode:
            raise Refused(
                self._drone.name, description, "it is on the ground; taking off leads there by itself"
            )
        self._drone.hold()

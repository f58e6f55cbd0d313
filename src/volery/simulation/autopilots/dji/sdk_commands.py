"""What an onboard program commands through the SDK: set-points with their manoeuvre, and waypoint missions.

A set-point is four numbers and a flag that defines their meaning. It follows the conventions of the ROS node:
east-north-up or forward-left-up, anticlockwise, radians. Heights count from the place of take-off.
"""

from __future__ import annotations

from math import hypot, isfinite, pi
from typing import TYPE_CHECKING, Any

from volery.base.frames import Vector, turn_clockwise
from volery.ros.messages.dji_constants import HORIZONTAL, MISSION_SPEEDS, SETPOINT_HEIGHTS, VERTICAL, Flag
from volery.simulation.autopilots.dji.parameters import SDK_CLIMB, SDK_SPEED, SDK_TILT
from volery.simulation.autopilots.flight_stack.flight import Control, Setpoint
from volery.simulation.autopilots.manoeuvres.manual_flight import Stabilize
from volery.simulation.autopilots.onboard_mission import GLOBAL_RELATIVE, WAYPOINT, MissionItem
from volery.simulation.autopilots.vehicle_state import FlightManoeuvre

if TYPE_CHECKING:
    from volery.simulation.autopilots.vehicle_state import AutopilotVehicle

LIFT_OFF_M, LIFT_OFF_M_S, LIFT_OFF_PERCENT = 0.5, 0.1, 20.0
"""Set-points above these values take a standing aircraft with running motors off the ground: assumed."""


SLOWEST = 0.1
"""Speed towards a position that is almost reached [m/s]."""


class SdkCommand:
    """Valid set-point. Offsets count from ``anchor``, the position at its arrival (north-east-down) [m]."""

    def __init__(self, flag: int, x: float, y: float, z: float, yaw: float, anchor: Vector) -> None:
        self.flag = flag
        self.x = x
        self.y = y
        self.z = z
        self.yaw = yaw
        self.anchor = anchor

    @property
    def horizontal(self) -> int:
        """Meaning of ``x`` and ``y``."""
        return self.flag & HORIZONTAL

    @property
    def vertical(self) -> int:
        """Meaning of ``z``."""
        return self.flag & VERTICAL

    @property
    def needs_position(self) -> bool:
        """Whether ``x`` and ``y`` are relative to the ground."""
        return self.horizontal in (Flag.HORIZONTAL_VELOCITY, Flag.HORIZONTAL_POSITION)

    @property
    def lifts(self) -> bool:
        """Whether the set-point takes the aircraft off the ground."""
        if self.vertical == Flag.VERTICAL_POSITION:
            return self.z > LIFT_OFF_M
        return self.z > (LIFT_OFF_PERCENT if self.vertical == Flag.VERTICAL_THRUST else LIFT_OFF_M_S)


def sdk_command(numbers: tuple[float, ...], flag: int, anchor: Vector) -> SdkCommand | None:
    """Return the set-point of four numbers and a flag, or None if it is invalid or not supported.

    Not supported are angular rates, and thrust with anything but angles.
    """
    if len(numbers) < 4 or not all(isfinite(number) for number in numbers[:4]):
        return None
    x, y, z, yaw = numbers[:4]
    command = SdkCommand(flag, x, y, z, yaw, anchor)
    angles = command.horizontal == 0
    if command.horizontal == Flag.HORIZONTAL_RATE or command.vertical == VERTICAL:
        return None
    if command.vertical == Flag.VERTICAL_THRUST and not angles:
        return None
    return command


class SdkControl(FlightManoeuvre):
    """NAVI_SDK_CTRL: follow the last set-point.

    Without satellites, set-points over ground have no horizontal effect: it flies level, and drifts.
    """

    def __init__(self, vehicle: AutopilotVehicle) -> None:
        super().__init__(vehicle)
        self.command: SdkCommand | None = None

    def takeoff_requested(self) -> bool:
        """Return whether the set-point takes the aircraft off the ground."""
        return self.command is not None and self.command.lifts

    def step(self) -> None:
        """Command the set-point."""
        command, vehicle = self.command, self.vehicle
        if command is not None and command.needs_position:
            command = self._within_borders(command)
        if command is None:
            vehicle.drive(Setpoint(Control.CLIMB, accel_z=vehicle.tuning.accel_z))
        elif command.needs_position and not vehicle.firmware_state.gps_health:
            vehicle.drive(self._level_setpoint(command))
        elif command.horizontal == Flag.HORIZONTAL_POSITION:
            vehicle.drive(self._position_setpoint(command))
        elif command.horizontal == Flag.HORIZONTAL_VELOCITY:
            vehicle.drive(self._velocity_setpoint(command))
        else:
            vehicle.drive(self._attitude_setpoint(command))

    @property
    def _ceiling(self) -> float:
        ceiling: float = self.vehicle.firmware_state.ceiling
        return ceiling

    def _within_borders(self, command: SdkCommand) -> SdkCommand:
        """Return the set-point, or one that stays here if it leads across a border."""
        controller = self.vehicle.firmware_state
        if controller.bars(*self._north_east(command)):
            here = self.vehicle.estimate.position
            return SdkCommand(command.flag, 0.0, 0.0, command.z, command.yaw, here)
        return command

    def _north_east(self, command: SdkCommand) -> tuple[float, float]:
        """Return ``x`` and ``y`` as north and east."""
        if not command.flag & Flag.BODY:
            return command.y, command.x
        heading = self.vehicle.estimate.attitude[2]
        return turn_clockwise((command.x, -command.y), heading)

    def _down(self, command: SdkCommand) -> float:
        home = self.vehicle.home
        low, high = SETPOINT_HEIGHTS
        high = min(high, self._ceiling)
        return (home.ned[2] if home else 0.0) - min(high, max(low, command.z))

    def _climb(self, command: SdkCommand) -> float:
        tuning = self.vehicle.tuning
        if command.vertical == Flag.VERTICAL_POSITION:
            wanted = command.z - self.vehicle.height
            return min(tuning.speed_up, max(-tuning.speed_down, wanted))
        left = max(0.0, self._ceiling - self.vehicle.height)
        return min(SDK_CLIMB, left, max(-SDK_CLIMB, command.z))

    def _turn(self, command: SdkCommand) -> tuple[float | None, float | None]:
        """Return heading [rad] or yaw rate [rad/s], clockwise; the other is None."""
        if command.flag & Flag.YAW_RATE:
            return None, -command.yaw
        return pi / 2.0 - command.yaw, None

    def _level_setpoint(self, command: SdkCommand) -> Setpoint:
        """Return the vertical part of a set-point over ground."""
        tuning, (yaw, rate) = self.vehicle.tuning, self._turn(command)
        return Setpoint(
            Control.CLIMB,
            climb=self._climb(command),
            yaw=yaw,
            yaw_rate=rate,
            speed_up=SDK_CLIMB,
            speed_down=SDK_CLIMB,
            accel_z=tuning.accel_z,
        )

    def _position_setpoint(self, command: SdkCommand) -> Setpoint:
        north, east = self._north_east(command)
        parameters = self.vehicle.parameters
        speed = min(parameters["MAX_SPEED"], parameters["POSITION_GAIN"] * hypot(north, east))
        tuning, (yaw, rate) = self.vehicle.tuning, self._turn(command)
        by_height = command.vertical == Flag.VERTICAL_POSITION
        return Setpoint(
            Control.POSITION if by_height else Control.POSITION_CLIMB,
            position=(command.anchor[0] + north, command.anchor[1] + east, self._down(command)),
            climb=0.0 if by_height else self._climb(command),
            yaw=yaw,
            yaw_rate=rate,
            speed=max(SLOWEST, speed),
            speed_up=tuning.speed_up if by_height else SDK_CLIMB,
            speed_down=tuning.speed_down if by_height else SDK_CLIMB,
            accel=tuning.accel,
            accel_z=tuning.accel_z,
            tilt=tuning.tilt,
        )

    def _velocity_setpoint(self, command: SdkCommand) -> Setpoint:
        north, east = self._north_east(command)
        tuning, (yaw, rate) = self.vehicle.tuning, self._turn(command)
        by_height = command.vertical == Flag.VERTICAL_POSITION
        return Setpoint(
            Control.VELOCITY_HEIGHT if by_height else Control.VELOCITY,
            position=(0.0, 0.0, self._down(command)),
            velocity=(north, east, 0.0 if by_height else -self._climb(command)),
            yaw=yaw,
            yaw_rate=rate,
            speed=SDK_SPEED,
            speed_up=SDK_CLIMB,
            speed_down=SDK_CLIMB,
            accel=tuning.accel,
            accel_z=tuning.accel_z,
            tilt=tuning.tilt,
        )

    def _attitude_setpoint(self, command: SdkCommand) -> Setpoint:
        tuning, (yaw, rate) = self.vehicle.tuning, self._turn(command)
        by_thrust = command.vertical == Flag.VERTICAL_THRUST
        share = min(1.0, max(0.0, command.z / 100.0))
        return Setpoint(
            Control.ATTITUDE if by_thrust else Control.CLIMB,
            roll=min(SDK_TILT, max(-SDK_TILT, command.x)),
            pitch=min(SDK_TILT, max(-SDK_TILT, -command.y)),
            yaw=yaw,
            yaw_rate=rate,
            throttle=Stabilize(self.vehicle).thrust(share) if by_thrust else 0.0,
            climb=0.0 if by_thrust else self._climb(command),
            speed_up=SDK_CLIMB,
            speed_down=SDK_CLIMB,
            accel_z=tuning.accel_z,
        )


MIN_WAYPOINTS, MAX_WAYPOINTS = 2, 99
"""Number of waypoints of a mission."""
STAY_ACTION = 0
"""Action of a waypoint: stay for a number of milliseconds."""
LONGEST_PATH_M = 30_000.0
"""Longest path of a mission."""
NO_ACTION, GO_HOME_AT_END, LAND_AT_END, TO_FIRST, NO_EXIT = range(5)
"""Actions at the end of a mission."""
YAW_LOCKED, YAW_BY_WAYPOINT = 1, 3
STOP_S = 0.1
"""Stop at each waypoint, unless turns are coordinated [s]."""


def mission_refusal(task: Any, most: int) -> str:
    """Return why a mission is refused, or an empty text; ``most`` is its greatest number of waypoints."""
    points = task.mission_waypoint
    low, high = MISSION_SPEEDS
    if not MIN_WAYPOINTS <= len(points) <= most:
        return f"{len(points)} waypoints; {MIN_WAYPOINTS} to {most}"
    if not (low <= task.velocity_range <= high and low <= task.idle_velocity <= task.velocity_range):
        return f"speeds {task.idle_velocity:g} and {task.velocity_range:g} m/s; {low:g} to {high:g}"
    for number, point in enumerate(points, start=1):
        place = (point.latitude, point.longitude, point.altitude)
        if not all(isfinite(value) for value in place) or abs(place[0]) > 90.0 or abs(place[1]) > 180.0:
            return f"waypoint {number} is nowhere"
    return ""


def mission_items(task: Any) -> list[MissionItem]:
    """Return the items of an accepted mission."""
    once = [_item(point, coordinated=task.trace_mode == 1) for point in task.mission_waypoint]
    items = once * max(1, min(2, task.mission_exec_times))
    return [*items, items[0]] if task.action_on_finish == TO_FIRST else items


def _item(point: Any, coordinated: bool) -> MissionItem:
    stay = _stay(point)
    return MissionItem(
        WAYPOINT,
        GLOBAL_RELATIVE,
        param1=stay or (0.0 if coordinated else STOP_S),
        x=round(point.latitude * 1e7),
        y=round(point.longitude * 1e7),
        z=point.altitude,
    )


def _stay(point: Any) -> float:
    """Return how long the actions of a waypoint stay [s]."""
    action = point.waypoint_action
    count = action.action_repeat & 0x0F if point.has_action else 0
    listed = zip(action.command_list[:count], action.command_parameter[:count], strict=True)
    return sum(int(milliseconds) for command, milliseconds in listed if command == STAY_ACTION) / 1000.0

"""PX4 1.14.0 on a rover, composed as a firmware.

There is no recording of a rover: what it shares with the multirotor is recorded, its driving is assumed.
"""

from __future__ import annotations

from functools import cache, partial
from math import atan2, hypot, isfinite

from volery.base.frames import Vector
from volery.simulation.autopilots.autopilot_parameters import REAL32, Parameter
from volery.simulation.autopilots.flight_stack.flight import Control, Setpoint
from volery.simulation.autopilots.manoeuvres.guided_flight import Turn
from volery.simulation.autopilots.manoeuvres.onboard_mission_flight import FlyMission
from volery.simulation.autopilots.manoeuvres.rover_driving import (
    DriveTo,
    FollowSpeed,
    Manual,
    ReturnRover,
    Stand,
    rover_leg,
)
from volery.simulation.autopilots.mavlink.command import ACCEPTED, DENIED, UNSUPPORTED, Command, Handler
from volery.simulation.autopilots.mavlink.endpoint import MavlinkEndpoint
from volery.simulation.autopilots.px4 import commands, copter, mission, modes
from volery.simulation.autopilots.px4.failsafes import on_step
from volery.simulation.autopilots.px4.firmware import own_parameters, px4_firmware, px4_mavlink
from volery.simulation.autopilots.px4.modes import commander_of
from volery.simulation.autopilots.px4.offboard import AttitudeTarget, OffboardTarget
from volery.simulation.autopilots.px4.parameters import ROVER_SUPPORTED, rover_tuning
from volery.simulation.autopilots.vehicle_state import Manoeuvre, ParameterTable, Vehicle

GROUND_ROVER = 10
"""MAV_TYPE."""

ASSUMED = (Parameter("GND_SPEED_MAX", REAL32, 10.0), Parameter("GND_SPEED_TRIM", REAL32, 3.0))
"""Documented defaults of parameters that the recorded multirotor does not list."""


class HoldRover(Manoeuvre):
    """AUTO.LOITER: stand, or drive to a point."""

    def __init__(self, vehicle: Vehicle) -> None:
        super().__init__(vehicle)
        self._active: Manoeuvre = Stand(vehicle)

    def send_to(self, point: Vector) -> None:
        """Drive to a point and stand there."""
        self._active = DriveTo(self.vehicle, point)
        self.target = point

    def step(self) -> None:
        """Drive until the point is reached."""
        if isinstance(self._active, DriveTo) and self._active.arrived():
            self._active = Stand(self.vehicle)
        self._active.step()


class OffboardRover(Manoeuvre):
    """OFFBOARD: a point, or a speed over ground in a direction."""

    def __init__(self, vehicle: Vehicle) -> None:
        super().__init__(vehicle)
        self._active: Manoeuvre = Stand(vehicle)

    def enter(self) -> None:
        """Stand until a set-point arrives."""
        self.receive(commander_of(self.vehicle).stream.target)

    def receive(self, target: OffboardTarget | AttitudeTarget | None) -> None:
        """Follow a new set-point; attitudes are ignored."""
        if not isinstance(target, OffboardTarget):
            return
        north, east, _ = target.position
        if isfinite(north) and isfinite(east):
            self._drive_to((north, east, 0.0))
            return
        north, east, _ = (value if isfinite(value) else 0.0 for value in target.velocity)
        speed = hypot(north, east)
        turn = Turn(target.yaw, target.yaw_rate)
        self.target = None
        if speed < 0.05 and turn.rate is None:
            self._active = Stand(self.vehicle)
        else:
            if turn == Turn():
                turn = Turn(_course(north, east, self.vehicle.estimate.attitude[2]))
            self._active = FollowSpeed(self.vehicle, speed, turn)

    def _drive_to(self, point: Vector) -> None:
        if not isinstance(self._active, DriveTo) or self._active.point != point:
            self._active = DriveTo(self.vehicle, point)
        self.target = point

    def step(self) -> None:
        """Drive, and stand on a reached point."""
        active = self._active
        if isinstance(active, DriveTo) and active.arrived():
            Stand(self.vehicle).step()
        else:
            active.step()


def _course(north: float, east: float, otherwise: float) -> float:
    return atan2(east, north) if north or east else otherwise


class StickDrive(Manual):
    """MANUAL and POSCTL: sticks are steering and throttle; without them the rover brakes and stands."""

    def step(self) -> None:
        """Pass the sticks to the wheels, or brake."""
        if commander_of(self.vehicle).joystick.valid:
            super().step()
        else:
            accel = self.vehicle.tuning.accel
            self.vehicle.drive(Setpoint(Control.DRIVE, speed=self.vehicle.tuning.speed, accel=accel))


def on_reposition(vehicle: Vehicle, command: Command) -> int:
    """Handle DO_REPOSITION with its flag."""
    point = commands.commanded_point(vehicle, command)
    if point is None or not vehicle.has_position:
        return DENIED
    if commands.to_integer(command.param2) != commands.CHANGE_MODE:
        return UNSUPPORTED
    commander_of(vehicle).restart_mode(modes.LOITER)
    if isinstance(vehicle.manoeuvre, HoldRover):
        vehicle.manoeuvre.send_to(point)
    return ACCEPTED


COMMANDS: dict[int, Handler] = {**commands.SHARED_COMMANDS, commands.REPOSITION: on_reposition}

MODES = modes.mode_table(
    {
        modes.MANUAL: StickDrive,
        modes.ALTCTL: StickDrive,
        modes.POSCTL: StickDrive,
        modes.ACRO: StickDrive,
        modes.OFFBOARD: OffboardRover,
        modes.STABILIZE: StickDrive,
        modes.TAKEOFF: HoldRover,
        modes.LOITER: HoldRover,
        modes.MISSION: lambda vehicle: FlyMission(
            vehicle, rover_leg, mission.MISSION_RULES, lambda _vehicle: True
        ),
        modes.RTL: ReturnRover,
        modes.LAND: Stand,
    },
    flies=False,
)


@cache
def parameters() -> tuple[Parameter, ...]:
    """Return the multirotor's recorded parameters with a rover's MAV_TYPE and a rover's additions."""
    shared = (
        parameter._replace(value=float(GROUND_ROVER)) if parameter.name == "MAV_TYPE" else parameter
        for parameter in copter.parameters()
    )
    return (*shared, *ASSUMED)


ROVER = px4_firmware(
    kind="rover",
    modes=MODES,
    parameters=ParameterTable(parameters, rover_tuning, own_parameters, ROVER_SUPPORTED),
    on_step=on_step,
    endpoint=partial(MavlinkEndpoint, px4_mavlink(GROUND_ROVER, COMMANDS)),
)

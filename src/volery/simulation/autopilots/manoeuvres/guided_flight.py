"""A multirotor flown by an on-board computer: take-off, points, velocities and attitudes as commanded."""

from __future__ import annotations

from dataclasses import replace
from typing import NamedTuple

from volery.base.frames import Quaternion, Vector, quaternion_to_euler
from volery.base.time import Ns, to_seconds
from volery.simulation.autopilots.flight_stack.flight import Control, Setpoint
from volery.simulation.autopilots.manoeuvres.to_point import (
    Brake,
    ClimbStraight,
    ToPoint,
    direction_of_flight,
)
from volery.simulation.autopilots.vehicle_state import AutopilotVehicle, FlightManoeuvre
from volery.simulation.world.arithmetic import wrap_angle


class Turn(NamedTuple):
    """Commanded heading [rad], yaw rate [rad/s] or both; neither: the firmware's own choice."""

    yaw: float | None = None
    rate: float | None = None


OWN_HEADING = Turn()
"""Turn the nose to the direction of flight where the tuning says so, else keep the heading."""


class FollowVelocity(FlightManoeuvre):
    """Follow a velocity that may grow; stop when no command arrives for the time-out.

    Args:
        vehicle: The vehicle.
        velocity: North, east, down [m/s].
        turn: Heading or yaw rate.
        acceleration: Growth of the velocity, north, east, down [m/s^2].
    """

    def __init__(
        self, vehicle: AutopilotVehicle, velocity: Vector, turn: Turn, acceleration: Vector = (0.0, 0.0, 0.0)
    ) -> None:
        super().__init__(vehicle)
        self.velocity = velocity
        self.acceleration = acceleration
        self._turn = turn
        self._given: Ns = vehicle.kernel.now()

    def _heading(self, stale: bool) -> Turn:
        """Return the turn now: commanded by a heading command, by the target, or along the flight."""
        vehicle = self.vehicle
        if vehicle.commanded.yaw is not None:
            return Turn(vehicle.commanded.yaw)
        if stale:
            return Turn(self._turn.yaw)
        if self._turn == OWN_HEADING and vehicle.tuning.face_path:
            return Turn(direction_of_flight(vehicle))
        return self._turn

    def step(self) -> None:
        """Give the velocity, or zero once the command is outdated."""
        vehicle, tuning = self.vehicle, self.vehicle.tuning
        age = vehicle.kernel.now() - self._given
        stale = age > tuning.target_timeout
        turn = self._heading(stale)
        vehicle.drive(
            Setpoint(
                Control.VELOCITY,
                velocity=(0.0, 0.0, 0.0) if stale else self._after(to_seconds(age)),
                yaw=turn.yaw if turn.rate is None else None,
                yaw_rate=turn.rate,
                speed=vehicle.commanded.speed or tuning.speed,
                speed_up=vehicle.commanded.speed_up or tuning.speed_up,
                speed_down=vehicle.commanded.speed_down or tuning.speed_down,
                accel=tuning.accel,
                accel_z=tuning.accel_z,
                tilt=tuning.tilt,
            )
        )

    def reached(self) -> Vector:
        """Return the commanded velocity now, north, east, down [m/s]."""
        return self._after(to_seconds(self.vehicle.kernel.now() - self._given))

    def _after(self, seconds: float) -> Vector:
        """Return the velocity some seconds after the command."""
        north, east, down = self.velocity
        more_north, more_east, more_down = self.acceleration
        return north + more_north * seconds, east + more_east * seconds, down + more_down * seconds


class TurnAtPoint(ToPoint):
    """Go to a point and turn at a rate meanwhile; the turn ends when no command arrives for the time-out.

    Args:
        vehicle: The vehicle.
        point: North, east, down about the estimator's origin [m].
        rate: Yaw rate [rad/s].
    """

    def __init__(self, vehicle: AutopilotVehicle, point: Vector, rate: float) -> None:
        super().__init__(vehicle, point)
        self._rate = rate
        self._given: Ns = vehicle.kernel.now()

    def towards(self, point: Vector) -> Setpoint:
        """Return the set-point for a point, with the turn while it is in force."""
        vehicle = self.vehicle
        stale = vehicle.kernel.now() - self._given > vehicle.tuning.target_timeout
        setpoint = super().towards(point)
        if stale or vehicle.commanded.yaw is not None:
            return setpoint
        return replace(setpoint, yaw=None, yaw_rate=self._rate)


class FollowAttitude(FlightManoeuvre):
    """Follow an attitude and a climb rate.

    When no command arrives for the time-out, it levels out and holds the height.

    Args:
        vehicle: The vehicle.
        attitude: Quaternion from forward, right, down to north, east, down; ``None``: level.
        yaw_rate: Yaw rate [rad/s] by which the heading of *attitude* goes on.
        thrust: 0..1; one half holds the height.
        fed_forward: Whether the yaw rate is fed forward beside a heading.
    """

    def __init__(
        self,
        vehicle: AutopilotVehicle,
        attitude: Quaternion | None,
        yaw_rate: float | None,
        thrust: float,
        fed_forward: bool = True,
    ) -> None:
        super().__init__(vehicle)
        self._roll, self._pitch, yaw = quaternion_to_euler(attitude) if attitude else (0.0, 0.0, None)
        self._turn = Turn(yaw, yaw_rate)
        self._thrust = thrust
        self._fed_forward = fed_forward
        self._given: Ns = vehicle.kernel.now()

    def takeoff_requested(self) -> bool:
        """Return whether the thrust climbs."""
        return self._thrust > 0.5

    def step(self) -> None:
        """Give the attitude and a climb rate: thrust 0 and 1 descend and climb at the largest speeds."""
        vehicle, tuning = self.vehicle, self.vehicle.tuning
        if vehicle.kernel.now() - self._given > tuning.target_timeout:
            vehicle.drive(Setpoint(Control.CLIMB, accel_z=tuning.accel_z))
            return
        share = 2.0 * self._thrust - 1.0
        yaw, rate = self._turn
        if yaw is not None and rate is not None:
            yaw = wrap_angle(yaw + rate * to_seconds(vehicle.kernel.now() - self._given))
            rate = rate if self._fed_forward else None
        vehicle.drive(
            Setpoint(
                Control.CLIMB,
                roll=self._roll,
                pitch=self._pitch,
                yaw=yaw,
                yaw_rate=rate,
                climb=share * (tuning.speed_up if share > 0.0 else tuning.speed_down),
                speed_up=tuning.speed_up,
                speed_down=tuning.speed_down,
                accel_z=tuning.accel_z,
                tilt=tuning.tilt,
            )
        )


class Guided(FlightManoeuvre):
    """Execute the last command. On the ground only a take-off starts the motors."""

    def __init__(self, vehicle: AutopilotVehicle) -> None:
        super().__init__(vehicle)
        self._doing: FlightManoeuvre = ToPoint(vehicle)
        self._kind: type[FlightManoeuvre] | None = None
        """Kind of command; another kind ends the speeds that DO_CHANGE_SPEED has set."""
        self._waiting: Brake | None = None
        """What is flown during a pause."""

    def pause(self) -> bool:
        """Stop; commands that arrive meanwhile are kept until ``resume``."""
        self._waiting = Brake(self.vehicle, self.vehicle.tuning.accel)
        return True

    def resume(self) -> bool:
        """Continue the last command."""
        self._waiting = None
        return True

    def enter(self) -> None:
        """Stop and hold the position until a command arrives."""
        self._begin(ToPoint(self.vehicle))
        self._kind = None

    def _begin(self, doing: FlightManoeuvre) -> None:
        kind = ToPoint if isinstance(doing, TurnAtPoint) else type(doing)
        if kind is not self._kind:
            self._kind = kind
            self.vehicle.commanded.forget_speeds()
        self._doing = doing
        doing.enter()
        self.target = doing.target
        self.taking_off, self.slow_start = doing.taking_off, doing.slow_start
        if self._waiting is None and self.vehicle.armed and not self.vehicle.landed:
            doing.step()

    @property
    def followed(self) -> tuple[Vector, Vector] | None:
        """The commanded velocity [m/s] and acceleration [m/s^2], north, east, down; ``None``: a point."""
        doing = self._doing
        return (doing.velocity, doing.acceleration) if isinstance(doing, FollowVelocity) else None

    def takeoff_requested(self) -> bool:
        """Return whether the command is a take-off."""
        return self._doing.taking_off

    def step(self) -> None:
        """Continue the command, or wait."""
        doing = self._doing
        if self._waiting is not None:
            self._waiting.step()
            return
        if doing.taking_off and isinstance(doing, ClimbStraight) and doing.arrived():
            self.taking_off = doing.taking_off = False
        doing.step()

    def take_off(self, height: float) -> None:
        """Climb straight up to a height above home [m]."""
        self._begin(ClimbStraight(self.vehicle, height))

    def go_to(self, point: Vector, turn: Turn = OWN_HEADING) -> None:
        """Go to a point north, east, down about the estimator's origin [m]; the command does not expire."""
        self.vehicle.commanded.forget_heading()
        if turn.rate is not None:
            self._begin(TurnAtPoint(self.vehicle, point, turn.rate))
            return
        facing = turn == OWN_HEADING and self.vehicle.tuning.face_path
        self._begin(ToPoint(self.vehicle, point, turn.yaw, facing=facing))

    def follow_velocity(self, velocity: Vector, turn: Turn = OWN_HEADING) -> None:
        """Follow a velocity north, east, down [m/s]."""
        self.vehicle.commanded.forget_heading()
        self._begin(FollowVelocity(self.vehicle, velocity, turn))

    def follow_acceleration(self, acceleration: Vector, turn: Turn = OWN_HEADING) -> None:
        """Follow an acceleration north, east, down [m/s^2], from the present or the commanded velocity."""
        self.vehicle.commanded.forget_heading()
        before = self._doing
        start = before.reached() if isinstance(before, FollowVelocity) else self.vehicle.estimate.velocity
        self._begin(FollowVelocity(self.vehicle, start, turn, acceleration))

    def follow_attitude(
        self, attitude: Quaternion | None, yaw_rate: float | None, thrust: float, fed_forward: bool = True
    ) -> None:
        """Follow an attitude.

        Args:
            attitude: Quaternion from forward, right, down to north, east, down; ``None``: level.
            yaw_rate: Yaw rate [rad/s] by which the heading of *attitude* goes on.
            thrust: 0..1; one half holds the height.
            fed_forward: Whether the yaw rate is fed forward beside a heading.
        """
        self._begin(FollowAttitude(self.vehicle, attitude, yaw_rate, thrust, fed_forward))


class GuidedAttitude(Guided):
    """Execute attitudes only: a guided flight without a position."""

    def enter(self) -> None:
        """Hold the height, level."""
        self.follow_attitude(None, 0.0, 0.5)

    def takeoff_requested(self) -> bool:
        """Return whether the commanded thrust climbs: without a position there is no other take-off."""
        return self._doing.takeoff_requested()

    def take_off(self, height: float) -> None:
        """Ignore the command: it requires a position."""

    def go_to(self, point: Vector, turn: Turn = OWN_HEADING) -> None:
        """Ignore the command: it requires a position."""

    def follow_velocity(self, velocity: Vector, turn: Turn = OWN_HEADING) -> None:
        """Ignore the command: it requires a position."""

    def follow_acceleration(self, acceleration: Vector, turn: Turn = OWN_HEADING) -> None:
        """Ignore the command: it requires a position."""

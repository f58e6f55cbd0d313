"""A multirotor flown by an on-board computer: take-off, points, velocities and attitudes as commanded."""

from __future__ import annotations

from typing import NamedTuple

from volery.base.frames import Quaternion, Vector, quaternion_to_euler
from volery.base.time import Ns, to_seconds
from volery.simulation.autopilots.flight_stack.flight import Control, Setpoint
from volery.simulation.autopilots.manoeuvres.to_point import TakeOff, ToPoint
from volery.simulation.autopilots.vehicle_state import Manoeuvre, Vehicle


class Turn(NamedTuple):
    """Commanded heading [rad] or yaw rate [rad/s]; neither: keep the heading."""

    yaw: float | None = None
    rate: float | None = None


KEEP_HEADING = Turn()
"""Keep the heading."""


class FollowVelocity(Manoeuvre):
    """Follow a velocity that may grow; stop when no command arrives for the time-out.

    Args:
        vehicle: The vehicle.
        velocity: North, east, down [m/s].
        turn: Heading or yaw rate.
        acceleration: Growth of the velocity, north, east, down [m/s^2].
    """

    def __init__(
        self, vehicle: Vehicle, velocity: Vector, turn: Turn, acceleration: Vector = (0.0, 0.0, 0.0)
    ) -> None:
        super().__init__(vehicle)
        self._velocity = velocity
        self._acceleration = acceleration
        self._turn = turn
        self._given: Ns = vehicle.kernel.now()

    def step(self) -> None:
        """Give the velocity, or zero once the command is outdated."""
        vehicle, tuning = self.vehicle, self.vehicle.tuning
        age = vehicle.kernel.now() - self._given
        stale = age > tuning.target_timeout
        turn = Turn() if stale else self._turn
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

    def _after(self, seconds: float) -> Vector:
        """Return the velocity some seconds after the command."""
        north, east, down = self._velocity
        more_north, more_east, more_down = self._acceleration
        return north + more_north * seconds, east + more_east * seconds, down + more_down * seconds


class FollowAttitude(Manoeuvre):
    """Follow an attitude and a climb rate.

    When no command arrives for the time-out, it levels out and holds the height.

    Args:
        vehicle: The vehicle.
        attitude: Quaternion from forward, right, down to north, east, down; ``None``: level.
        yaw_rate: Yaw rate [rad/s] instead of the heading of *attitude*.
        thrust: 0..1; one half holds the height.
    """

    def __init__(
        self, vehicle: Vehicle, attitude: Quaternion | None, yaw_rate: float | None, thrust: float
    ) -> None:
        super().__init__(vehicle)
        self._roll, self._pitch, yaw = quaternion_to_euler(attitude) if attitude else (0.0, 0.0, None)
        self._turn = Turn(yaw if yaw_rate is None else None, yaw_rate)
        self._thrust = thrust
        self._given: Ns = vehicle.kernel.now()

    def step(self) -> None:
        """Give the attitude and a climb rate: thrust 0 and 1 descend and climb at the largest speeds."""
        vehicle, tuning = self.vehicle, self.vehicle.tuning
        if vehicle.kernel.now() - self._given > tuning.target_timeout:
            vehicle.drive(Setpoint(Control.CLIMB, accel_z=tuning.accel_z))
            return
        share = 2.0 * self._thrust - 1.0
        vehicle.drive(
            Setpoint(
                Control.CLIMB,
                roll=self._roll,
                pitch=self._pitch,
                yaw=self._turn.yaw,
                yaw_rate=self._turn.rate,
                climb=share * (tuning.speed_up if share > 0.0 else tuning.speed_down),
                speed_up=tuning.speed_up,
                speed_down=tuning.speed_down,
                accel_z=tuning.accel_z,
                tilt=tuning.tilt,
            )
        )


class Guided(Manoeuvre):
    """Execute the last command. On the ground only a take-off starts the motors."""

    def __init__(self, vehicle: Vehicle) -> None:
        super().__init__(vehicle)
        self._doing: Manoeuvre = ToPoint(vehicle)

    def enter(self) -> None:
        """Stop and hold the position until a command arrives."""
        self._begin(ToPoint(self.vehicle))

    def _begin(self, doing: Manoeuvre) -> None:
        self._doing = doing
        doing.enter()
        self.target = doing.target
        self.taking_off, self.slow_start = doing.taking_off, doing.slow_start
        if self.vehicle.armed and not self.vehicle.landed:
            doing.step()

    def takeoff_requested(self) -> bool:
        """Return whether the command is a take-off."""
        return self._doing.taking_off

    def step(self) -> None:
        """Continue the command."""
        doing = self._doing
        if doing.taking_off and isinstance(doing, TakeOff) and doing.arrived():
            self.taking_off = doing.taking_off = False
        doing.step()

    def take_off(self, height: float) -> None:
        """Climb straight up to a height above home [m]."""
        self._begin(TakeOff(self.vehicle, height))

    def go_to(self, point: Vector, turn: Turn = KEEP_HEADING) -> None:
        """Go to a point north, east, down about the estimator's origin [m]; the command does not expire."""
        self._begin(ToPoint(self.vehicle, point, turn.yaw))

    def follow_velocity(self, velocity: Vector, turn: Turn = KEEP_HEADING) -> None:
        """Follow a velocity north, east, down [m/s]."""
        self._begin(FollowVelocity(self.vehicle, velocity, turn))

    def follow_acceleration(self, acceleration: Vector, turn: Turn = KEEP_HEADING) -> None:
        """Follow an acceleration north, east, down [m/s^2], from the present velocity."""
        self._begin(FollowVelocity(self.vehicle, self.vehicle.estimate.velocity, turn, acceleration))

    def follow_attitude(self, attitude: Quaternion | None, yaw_rate: float | None, thrust: float) -> None:
        """Follow an attitude.

        Args:
            attitude: Quaternion from forward, right, down to north, east, down; ``None``: level.
            yaw_rate: Yaw rate [rad/s] instead of the heading of *attitude*.
            thrust: 0..1; one half holds the height.
        """
        self._begin(FollowAttitude(self.vehicle, attitude, yaw_rate, thrust))

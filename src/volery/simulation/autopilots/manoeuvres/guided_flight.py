"""A multirotor flown by another computer: take-off, points, velocities and attitudes as commanded."""

from __future__ import annotations

from typing import NamedTuple

from volery.base.frames import Quaternion, Vector, quaternion_to_euler
from volery.base.time import Ns, to_seconds
from volery.simulation.autopilots.flight_stack.flight import Control, Setpoint
from volery.simulation.autopilots.manoeuvres.to_point import TakeOff, ToPoint
from volery.simulation.autopilots.vehicle_state import Manoeuvre, Vehicle


class Turn(NamedTuple):
    """Where the nose is to point [rad], or how fast to turn [rad/s]; neither: leave it."""

    yaw: float | None = None
    rate: float | None = None


AS_IT_IS = Turn()
"""Leave the nose where it points."""


class FollowVelocity(Manoeuvre):
    """Keep a velocity, or one that grows; without news for the time-out stand still."""

    def __init__(
        self, vehicle: Vehicle, velocity: Vector, turn: Turn, acceleration: Vector = (0.0, 0.0, 0.0)
    ) -> None:
        super().__init__(vehicle)
        self._velocity = velocity
        self._acceleration = acceleration
        self._turn = turn
        self._given: Ns = vehicle.kernel.now()

    def step(self) -> None:
        """Drive on, or stop."""
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
        north, east, down = self._velocity
        more_north, more_east, more_down = self._acceleration
        return north + more_north * seconds, east + more_east * seconds, down + more_down * seconds


class FollowAttitude(Manoeuvre):
    """Keep an attitude and a climb rate; without news for the time-out level out and hold the height."""

    def __init__(
        self, vehicle: Vehicle, attitude: Quaternion | None, yaw_rate: float | None, thrust: float
    ) -> None:
        super().__init__(vehicle)
        self._roll, self._pitch, yaw = quaternion_to_euler(attitude) if attitude else (0.0, 0.0, None)
        self._turn = Turn(yaw if yaw_rate is None else None, yaw_rate)
        self._thrust = thrust
        self._given: Ns = vehicle.kernel.now()

    def step(self) -> None:
        """Thrust of one half holds the height; 0 and 1 sink and climb at the largest speeds."""
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
    """Whatever was commanded last. On the ground only a take-off lifts it."""

    def __init__(self, vehicle: Vehicle) -> None:
        super().__init__(vehicle)
        self._doing: Manoeuvre = ToPoint(vehicle)

    def enter(self) -> None:
        """Stop and stay until told."""
        self._begin(ToPoint(self.vehicle))

    def _begin(self, doing: Manoeuvre) -> None:
        self._doing = doing
        doing.enter()
        self.target = doing.target
        self.taking_off, self.slow_start = doing.taking_off, doing.slow_start
        if self.vehicle.armed and not self.vehicle.landed:
            doing.step()

    def takeoff_requested(self) -> bool:
        """Only for a take-off."""
        return self._doing.taking_off

    def step(self) -> None:
        """Go on with it."""
        doing = self._doing
        if doing.taking_off and isinstance(doing, TakeOff) and doing.arrived():
            self.taking_off = doing.taking_off = False
        doing.step()

    def take_off(self, height: float) -> None:
        """Straight up to *height* metres above home."""
        self._begin(TakeOff(self.vehicle, height))

    def go_to(self, point: Vector, turn: Turn = AS_IT_IS) -> None:
        """To a point north, east, down about the estimator's origin. It never expires."""
        self._begin(ToPoint(self.vehicle, point, turn.yaw))

    def follow_velocity(self, velocity: Vector, turn: Turn = AS_IT_IS) -> None:
        """North, east, down m/s."""
        self._begin(FollowVelocity(self.vehicle, velocity, turn))

    def follow_acceleration(self, acceleration: Vector, turn: Turn = AS_IT_IS) -> None:
        """North, east, down m/s^2."""
        self._begin(FollowVelocity(self.vehicle, self.vehicle.estimate.velocity, turn, acceleration))

    def follow_attitude(self, attitude: Quaternion | None, yaw_rate: float | None, thrust: float) -> None:
        """Forward, right, down to north, east, down; a turn rate instead of its heading; thrust 0..1."""
        self._begin(FollowAttitude(self.vehicle, attitude, yaw_rate, thrust))

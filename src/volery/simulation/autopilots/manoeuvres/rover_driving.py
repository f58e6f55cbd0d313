"""Ways of driving: by sticks, to points, at a speed and a turn rate, along a mission, home."""

from __future__ import annotations

from math import cos, hypot, sin

from volery.base.frames import Vector
from volery.base.time import Ns, from_seconds
from volery.simulation.autopilots.flight_stack.flight import Control, Setpoint
from volery.simulation.autopilots.manoeuvres.guided_flight import Turn
from volery.simulation.autopilots.manoeuvres.onboard_mission_flight import FOREVER, Leg, item_point
from volery.simulation.autopilots.onboard_mission import (
    LOITER_TIME,
    LOITER_UNLIMITED,
    RETURN,
    SET_YAW_SPEED,
    WAYPOINT,
    MissionItem,
)
from volery.simulation.autopilots.vehicle_state import Manoeuvre, Vehicle, VehicleAction

AT_POINT = 1.0
"""Metres within which a rover that is to stop has arrived."""

STANDING = Setpoint(Control.STEER)


class Manual(Manoeuvre):
    """Sticks are steering and throttle."""

    def step(self) -> None:
        """Pass them on."""
        sticks, channels = self.vehicle.tuning.sticks, self.vehicle.rc
        steering = sticks.travels[0].deflection(channels[sticks.roll])
        throttle = sticks.travels[2].deflection(channels[sticks.throttle])
        self.vehicle.drive(Setpoint(Control.STEER, steering=steering, throttle=throttle))


class Stand(Manoeuvre):
    """Wheels straight, no throttle."""

    def step(self) -> None:
        """Nothing to decide."""
        self.vehicle.drive(STANDING)


class DriveTo(Manoeuvre):
    """To a point, and stop there."""

    def __init__(self, vehicle: Vehicle, point: Vector) -> None:
        super().__init__(vehicle)
        self.point = self.target = point

    def step(self) -> None:
        """Drive there."""
        tuning = self.vehicle.tuning
        self.vehicle.drive(
            Setpoint(
                Control.POSITION,
                position=self.point,
                speed=self.vehicle.commanded.speed or tuning.speed,
                accel=tuning.accel,
            )
        )

    def arrived(self, passing: bool = False) -> bool:
        """Within the radius if it drives on; else close by or standing within the radius."""
        away = self.distance()
        if away >= self.vehicle.tuning.waypoint_radius:
            return False
        north, east, _ = self.vehicle.estimate.velocity
        return passing or away < AT_POINT or hypot(north, east) < 0.1


class FollowSpeed(Manoeuvre):
    """A speed ahead with a heading or a turn rate; without news for the time-out it stops."""

    def __init__(self, vehicle: Vehicle, speed: float, turn: Turn) -> None:
        super().__init__(vehicle)
        self._speed, self._turn = speed, turn
        self._given: Ns = vehicle.kernel.now()
        self.stale = False

    def step(self) -> None:
        """Drive on, or stop."""
        vehicle, tuning = self.vehicle, self.vehicle.tuning
        self.stale = vehicle.kernel.now() - self._given > tuning.target_timeout
        speed = 0.0 if self.stale else self._speed
        vehicle.drive(
            Setpoint(
                Control.DRIVE,
                velocity=(speed, 0.0, 0.0),
                yaw=self._turn.yaw if self._turn.rate is None and not self.stale else None,
                yaw_rate=None if self.stale else self._turn.rate,
                speed=max(abs(speed), tuning.speed),
                accel=tuning.accel,
            )
        )


class GuidedRover(Manoeuvre):
    """Whatever was commanded last."""

    def __init__(self, vehicle: Vehicle, on_arrival: VehicleAction, on_timeout: VehicleAction) -> None:
        super().__init__(vehicle)
        self._on_arrival, self._on_timeout = on_arrival, on_timeout
        self._doing: Manoeuvre = Stand(vehicle)
        self._told = True

    def enter(self) -> None:
        """Stop until told."""
        self._begin(Stand(self.vehicle))

    def _begin(self, doing: Manoeuvre) -> None:
        self._doing, self._told = doing, False
        self.target = doing.target
        if self.vehicle.armed:
            doing.step()

    def step(self) -> None:
        """Go on; tell once that it arrived, or that it stops because nothing was heard."""
        doing = self._doing
        doing.step()
        if self._told:
            return
        if isinstance(doing, DriveTo) and doing.arrived():
            self._told = True
            self._on_arrival(self.vehicle)
        elif isinstance(doing, FollowSpeed) and doing.stale:
            self._told = True
            self._on_timeout(self.vehicle)

    def go_to(self, point: Vector) -> None:
        """To a point north, east, down about the estimator's origin."""
        self._begin(DriveTo(self.vehicle, point))

    def follow_speed(self, speed: float, turn: Turn) -> None:
        """Metres per second ahead; backwards if negative."""
        self._begin(FollowSpeed(self.vehicle, speed, turn))

    def follow_velocity(self, velocity: Vector, turn: Turn) -> None:
        """North, east m/s: the speed is what lies ahead of the nose when a turn is given, else the whole."""
        north, east, _ = velocity
        heading = self.vehicle.estimate.attitude[2]
        ahead = north * cos(heading) + east * sin(heading)
        self.follow_speed(ahead, turn)


class ReturnRover(Manoeuvre):
    """Home, and stop."""

    def __init__(self, vehicle: Vehicle) -> None:
        super().__init__(vehicle)
        home = vehicle.home
        self._driving = DriveTo(vehicle, home.ned if home else vehicle.estimate.position)

    def enter(self) -> None:
        """At the speed of the return."""
        self.target = self._driving.point
        self.vehicle.commanded.speed = self.vehicle.tuning.return_speed

    def step(self) -> None:
        """Drive."""
        self._driving.step()

    def arrived(self) -> bool:
        """Whether it is home."""
        return self._driving.arrived()


def rover_leg(vehicle: Vehicle, item: MissionItem, goes_on: bool) -> Leg:
    """The leg of a rover for an item that navigates."""
    if item.command == RETURN:
        returning = ReturnRover(vehicle)
        return Leg(returning, returning.arrived)
    if item.command == SET_YAW_SPEED:
        turning = FollowSpeed(vehicle, item.param2, Turn(yaw=item.param1 * 0.017453292519943295))
        return Leg(turning, lambda: True, FOREVER)
    driving = DriveTo(vehicle, item_point(vehicle, item))
    stay = from_seconds(max(0.0, item.param1)) if item.command in (WAYPOINT, LOITER_TIME) else 0
    if item.command == LOITER_UNLIMITED:
        stay = FOREVER
    return Leg(driving, lambda: driving.arrived(passing=goes_on), stay)

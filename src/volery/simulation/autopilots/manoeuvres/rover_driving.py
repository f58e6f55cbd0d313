"""Manoeuvres of a rover: by RC channels, to points, at a speed and a turn rate, along a mission, home."""

from __future__ import annotations

from math import hypot, pi, sqrt

from volery.base.elementary import cos
from volery.base.frames import Vector, wrap
from volery.base.time import Ns, S, from_seconds
from volery.simulation.autopilots.flight_stack.flight import Control, Setpoint
from volery.simulation.autopilots.manoeuvres.guided_flight import Turn
from volery.simulation.autopilots.manoeuvres.onboard_mission_flight import FOREVER, Leg, item_point
from volery.simulation.autopilots.manoeuvres.to_point import bearing
from volery.simulation.autopilots.onboard_mission import (
    LOITER_TIME,
    LOITER_UNLIMITED,
    RETURN,
    SET_YAW_SPEED,
    WAYPOINT,
    MissionItem,
)
from volery.simulation.autopilots.vehicle_state import (
    AutopilotVehicle,
    FlightManoeuvre,
    VehicleAction,
    do_nothing,
)

AT_POINT = 1.0
"""Distance within which a rover that stops has arrived [m]."""

SETTLED: Ns = 4 * S
"""Time at home after which a return counts as done [ns]; 3 s are not enough in a recorded return."""

TURNING_SHARE, BRAKE_SHARE, CLOSE = 0.2, 0.6, 0.3
"""Least share of the speed while it turns, share of the acceleration for braking, distance of the end [m]:
as the control loops drive forwards to a point.
"""

STANDING = Setpoint(Control.STEER)


class DriveBySticks(FlightManoeuvre):
    """Sticks command steering and throttle."""

    def step(self) -> None:
        """Pass the sticks on."""
        sticks, channels = self.vehicle.tuning.sticks, self.vehicle.rc
        steering = sticks.travels[0].deflection(channels[sticks.roll])
        throttle = sticks.travels[2].deflection(channels[sticks.throttle])
        self.vehicle.drive(Setpoint(Control.STEER, steering=steering, throttle=throttle))


class Stand(FlightManoeuvre):
    """Keep the wheels straight and the throttle at zero."""

    def step(self) -> None:
        """Give the set-point."""
        self.vehicle.drive(STANDING)


class DriveTo(FlightManoeuvre):
    """Drive to a point and stop there, backwards where that is commanded.

    Args:
        vehicle: The vehicle.
        point: North, east, down about the estimator's origin [m].
    """

    def __init__(self, vehicle: AutopilotVehicle, point: Vector) -> None:
        super().__init__(vehicle)
        self.point = self.target = point

    def step(self) -> None:
        """Give the set-point."""
        vehicle, accel = self.vehicle, self.vehicle.tuning.accel
        speed = vehicle.commanded.speed or vehicle.tuning.speed
        if vehicle.commanded.backwards:
            self._back_up(speed, accel)
        else:
            vehicle.drive(Setpoint(Control.POSITION, position=self.point, speed=speed, accel=accel))

    def _back_up(self, speed: float, accel: float) -> None:
        """Drive backwards with the rear to the point, slower while it turns and before the point."""
        vehicle, away = self.vehicle, self.distance()
        heading = wrap(bearing(vehicle.estimate.position, self.point) + pi)
        straight = max(TURNING_SHARE, cos(heading - vehicle.estimate.attitude[2]))
        backwards = min(speed, sqrt(2.0 * BRAKE_SHARE * accel * away)) * straight if away > CLOSE else 0.0
        vehicle.drive(
            Setpoint(Control.DRIVE, velocity=(-backwards, 0.0, 0.0), yaw=heading, speed=speed, accel=accel)
        )

    def arrived(self, passing: bool = False) -> bool:
        """Return whether the rover has arrived.

        Args:
            passing: Whether it suffices to be within the waypoint radius; else it must be close, or stand
                within it.
        """
        away = self.distance()
        if away >= self.vehicle.tuning.waypoint_radius:
            return False
        north, east, _ = self.vehicle.estimate.velocity
        return passing or away < AT_POINT or hypot(north, east) < 0.1


class FollowSpeed(FlightManoeuvre):
    """Drive at a speed with a heading or a turn rate; stop when no command arrives for the time-out.

    Args:
        vehicle: The vehicle.
        speed: Forward speed [m/s].
        turn: Heading or turn rate.
    """

    def __init__(self, vehicle: AutopilotVehicle, speed: float, turn: Turn) -> None:
        super().__init__(vehicle)
        self._speed, self.turn = speed, turn
        self._given: Ns = vehicle.kernel.now()
        self.stale = False

    def step(self) -> None:
        """Give the speed, or zero once the command is outdated."""
        vehicle, tuning = self.vehicle, self.vehicle.tuning
        self.stale = vehicle.kernel.now() - self._given > tuning.target_timeout
        speed = 0.0 if self.stale else self._speed
        vehicle.drive(
            Setpoint(
                Control.DRIVE,
                velocity=(speed, 0.0, 0.0),
                yaw=self.turn.yaw if self.turn.rate is None and not self.stale else None,
                yaw_rate=None if self.stale else self.turn.rate,
                speed=max(abs(speed), tuning.speed),
                accel=tuning.accel,
            )
        )


class GuidedRover(FlightManoeuvre):
    """Execute the last command.

    Args:
        vehicle: The vehicle.
        on_arrival: Called once the commanded point is reached.
        on_timeout: Called once the rover stops because commands are outdated.
    """

    def __init__(
        self, vehicle: AutopilotVehicle, on_arrival: VehicleAction, on_timeout: VehicleAction
    ) -> None:
        super().__init__(vehicle)
        self._on_arrival, self._on_timeout = on_arrival, on_timeout
        self._doing: FlightManoeuvre = Stand(vehicle)
        self._reported = True

    def enter(self) -> None:
        """Stop until a command arrives."""
        self._begin(Stand(self.vehicle))

    def _begin(self, doing: FlightManoeuvre) -> None:
        self._doing, self._reported = doing, False
        self.target = doing.target
        if self.vehicle.armed:
            doing.step()

    def step(self) -> None:
        """Continue the command; report once that it is done or outdated."""
        doing = self._doing
        doing.step()
        if self._reported:
            return
        if isinstance(doing, DriveTo) and doing.arrived():
            self._reported = True
            self._on_arrival(self.vehicle)
        elif isinstance(doing, FollowSpeed) and doing.stale:
            self._reported = True
            self._on_timeout(self.vehicle)

    def go_to(self, point: Vector) -> None:
        """Drive to a point north, east, down about the estimator's origin [m]."""
        self._begin(DriveTo(self.vehicle, point))

    def follow_speed(self, speed: float, turn: Turn) -> None:
        """Drive forward at a speed [m/s]; backwards if negative."""
        self._begin(FollowSpeed(self.vehicle, speed, turn))

    @property
    def asked_heading(self) -> float | None:
        """The heading that is followed, clockwise from north [rad]; ``None``: none was commanded."""
        doing = self._doing
        return doing.turn.yaw if isinstance(doing, FollowSpeed) else None


class ReturnRover(FlightManoeuvre):
    """Drive home, or where the firmware returns instead, and stop.

    Args:
        vehicle: The vehicle.
        on_arrival: Called once home is reached.
    """

    def __init__(self, vehicle: AutopilotVehicle, on_arrival: VehicleAction = do_nothing) -> None:
        super().__init__(vehicle)
        self._on_arrival, self._reported = on_arrival, False
        self._arrived_at: Ns | None = None
        home = vehicle.home.ned if vehicle.home else vehicle.estimate.position
        self._driving = DriveTo(vehicle, vehicle.rules.return_point(vehicle) or home)

    def enter(self) -> None:
        """Set the speed of the return."""
        self.target = self._driving.point
        self.vehicle.commanded.speed = self.vehicle.tuning.return_speed

    def step(self) -> None:
        """Give the set-point; report once that home is reached."""
        self._driving.step()
        now = self.vehicle.kernel.now()
        if self._arrived_at is None:
            self._arrived_at = now if self.arrived() else None
        elif not self._reported and now - self._arrived_at >= SETTLED:
            self._reported = True
            self._on_arrival(self.vehicle)

    def arrived(self) -> bool:
        """Return whether the rover is home."""
        return self._driving.arrived()


def rover_leg(vehicle: AutopilotVehicle, item: MissionItem, goes_on: bool) -> Leg:
    """Return the leg of a rover for an item that navigates."""
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

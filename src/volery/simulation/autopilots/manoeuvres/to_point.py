"""Manoeuvres of a multirotor towards a point: go, hold, take off, land, return, brake."""

from __future__ import annotations

from math import dist, hypot, sqrt

from volery.base.elementary import atan2, cbrt
from volery.base.frames import Vector
from volery.base.time import Ns
from volery.simulation.autopilots.flight_stack.flight import Control, Setpoint
from volery.simulation.autopilots.vehicle_state import AutopilotVehicle, FlightManoeuvre

CLOSE = 0.1
"""Distance within which a height or a shaped target counts as reached [m]."""

SLOW = 0.05
"""Speed below which a vehicle counts as standing still [m/s]."""

BRAKE_ACCEL = 7.5
"""BRAKE_MODE_DECEL_RATE of ArduCopter [m/s^2]."""

FACING_SHARE = 0.05
"""Share of the speed limit above which the nose follows the direction of flight."""


def root_speed(distance: float, accel: float, gain: float = 1.0) -> float:
    """Return the speed [m/s] from which a vehicle can stop.

    Proportional near the end, the square root of the distance beyond: the shape of ArduPilot's position
    controllers (its documentation calls it the square-root controller).

    Args:
        distance: Distance to stop in [m].
        accel: Deceleration [m/s^2].
        gain: Gain near the end [1/s].
    """
    bend = accel / (gain * gain)
    if distance <= bend:
        return max(0.0, distance) * gain
    return sqrt(2.0 * accel * (distance - bend / 2.0))


def stopping_distance(speed: float, accel: float, gain: float = 1.0) -> float:
    """Return the distance [m] in which a vehicle stops: the inverse of ``root_speed``."""
    bend = accel / gain
    return speed / gain if speed <= bend else speed * speed / (2.0 * accel) + bend / (2.0 * gain)


def stopping_point(position: Vector, velocity: Vector, accel: float, accel_z: float) -> Vector:
    """Return the point at which a vehicle comes to rest.

    Args:
        position: Present position, north, east, down [m].
        velocity: Present velocity, north, east, down [m/s].
        accel: Horizontal deceleration [m/s^2].
        accel_z: Vertical deceleration [m/s^2].
    """
    north, east, down = velocity
    speed = hypot(north, east)
    share = stopping_distance(speed, accel) / speed if speed > SLOW else 0.0
    fall = stopping_distance(abs(down), accel_z) if abs(down) > SLOW else 0.0
    return (
        position[0] + north * share,
        position[1] + east * share,
        position[2] + (fall if down > 0.0 else -fall),
    )


def quarter_time(length: float, jerk: float) -> float:
    """Return a quarter of the time [s] for a way from rest to rest: four equal parts of constant jerk.

    ArduCopter flies the ways of its modes with waypoints so, where they are short (SCurve).

    Args:
        length: Length of the way [m].
        jerk: Jerk [m/s^3].
    """
    return cbrt(length / (2.0 * jerk))


def direction_of_flight(vehicle: AutopilotVehicle) -> float | None:
    """Return the direction in which the target moves, clockwise from north [rad]; ``None``: it is slow."""
    north, east, _ = vehicle.estimate.target_velocity
    fast = hypot(north, east) > FACING_SHARE * vehicle.tuning.speed
    return atan2(east, north) if fast else None


def bearing(start: Vector, end: Vector) -> float:
    """Return the bearing from *start* to *end*, clockwise from north [rad]."""
    return atan2(end[1] - start[1], end[0] - start[0])


class ToPoint(FlightManoeuvre):
    """Go to a point with limited speed and hold it.

    Args:
        vehicle: The vehicle.
        point: North, east, down about the estimator's origin [m]; ``None``: where the vehicle can stop.
        yaw: Heading [rad]; ``None``: keep it.
        facing: Whether the nose follows the direction of flight.
    """

    def __init__(
        self,
        vehicle: AutopilotVehicle,
        point: Vector | None = None,
        yaw: float | None = None,
        *,
        facing: bool = False,
    ) -> None:
        super().__init__(vehicle)
        self.point = point
        self.yaw = yaw
        self.facing = facing
        self.speed: float | None = None

    def enter(self) -> None:
        """Take the stopping point where no point was given."""
        if self.point is None:
            estimate = self.vehicle.estimate
            tuning = self.vehicle.tuning
            self.point = stopping_point(estimate.position, estimate.velocity, tuning.accel, tuning.accel_z)
        else:
            self.target = self.point

    def step(self) -> None:
        """Give the set-point."""
        if self.point is not None:
            self.vehicle.drive(self.towards(self.point))

    def towards(self, point: Vector) -> Setpoint:
        """Return the set-point for a point, with the limits in force."""
        vehicle, tuning = self.vehicle, self.vehicle.tuning
        if self.facing:
            ahead = direction_of_flight(vehicle)
            self.yaw = self.yaw if ahead is None else ahead
        return Setpoint(
            Control.POSITION,
            position=point,
            yaw=self.yaw if vehicle.commanded.yaw is None else vehicle.commanded.yaw,
            speed=self.speed or vehicle.commanded.speed or tuning.speed,
            speed_up=vehicle.commanded.speed_up or tuning.speed_up,
            speed_down=vehicle.commanded.speed_down or tuning.speed_down,
            accel=tuning.accel,
            accel_z=tuning.accel_z,
            tilt=tuning.tilt,
            straight=tuning.straight,
        )

    def arrived(self, passing: bool = False) -> bool:
        """Return whether the vehicle has arrived.

        Args:
            passing: Whether it suffices to be within the waypoint radius; else the shaped target must have
                arrived too.
        """
        if self.point is None:
            return True
        estimate, radius = self.vehicle.estimate, self.vehicle.tuning.waypoint_radius
        near = dist(estimate.position, self.point) < radius
        return near and (passing or dist(estimate.target, self.point) < CLOSE)


class ClimbStraight(ToPoint):
    """Climb straight up.

    Args:
        vehicle: The vehicle.
        height: Height above home [m].
    """

    def __init__(self, vehicle: AutopilotVehicle, height: float) -> None:
        super().__init__(vehicle)
        self.taking_off = self.slow_start = True
        self.height = height

    def enter(self) -> None:
        """Take the point above the present position."""
        north, east, _ = self.vehicle.estimate.position
        home = self.vehicle.home
        self.point = (north, east, (home.ned[2] if home else 0.0) - self.height)

    def takeoff_requested(self) -> bool:
        """Return True."""
        return True

    def arrived(self, passing: bool = False) -> bool:
        """Return whether the vehicle is within a decimetre of the height, or above it."""
        return self.vehicle.height > self.height - CLOSE


class DescendAndLand(FlightManoeuvre):
    """Descend straight down: fast while high, slowly near the ground. Without a position it descends level.

    Args:
        vehicle: The vehicle.
        point: Point to land below; ``None``: where the vehicle can stop.
    """

    def __init__(self, vehicle: AutopilotVehicle, point: Vector | None = None) -> None:
        super().__init__(vehicle)
        self.landing = True
        self.point = point
        self.waits_until: Ns = 0
        """Time before which it does not sink."""

    def enter(self) -> None:
        """Take the stopping point where no point was given."""
        if self.point is None:
            estimate = self.vehicle.estimate
            tuning = self.vehicle.tuning
            self.point = stopping_point(estimate.position, estimate.velocity, tuning.accel, tuning.accel_z)

    def sink(self) -> float:
        """Return the descent rate at the present height [m/s]."""
        tuning = self.vehicle.tuning
        if self.vehicle.kernel.now() < self.waits_until:
            return 0.0
        height = self.vehicle.rules.height_above_ground(self.vehicle)
        above = height - tuning.land_slow_below
        return max(tuning.land_speed, min(tuning.land_speed_high, root_speed(above, tuning.accel_z)))

    def step(self) -> None:
        """Descend over the point."""
        vehicle, tuning, sink = self.vehicle, self.vehicle.tuning, self.sink()
        if not vehicle.has_position or self.point is None:
            most = max(sink, tuning.land_speed)
            vehicle.drive(Setpoint(Control.CLIMB, climb=-sink, speed_down=most, accel_z=tuning.accel_z))
            return
        vehicle.drive(
            Setpoint(
                Control.POSITION_CLIMB,
                position=self.point,
                climb=-sink,
                yaw=vehicle.commanded.yaw,
                speed=tuning.speed,
                speed_down=max(tuning.land_speed_high, sink),
                accel=tuning.accel,
                accel_z=tuning.accel_z,
                tilt=tuning.tilt,
            )
        )


class ReturnAndLand(FlightManoeuvre):
    """Climb, fly home, wait, land: each stage is a manoeuvre of its own."""

    def __init__(self, vehicle: AutopilotVehicle) -> None:
        super().__init__(vehicle)
        self._stage: FlightManoeuvre = ToPoint(vehicle)
        self._name = ""
        self._home: Vector = (0.0, 0.0, 0.0)
        self._waiting_since: Ns = 0

    def enter(self) -> None:
        """Climb straight up first, to the height of the return."""
        vehicle, tuning = self.vehicle, self.vehicle.tuning
        ground = vehicle.home.ned if vehicle.home else (0.0, 0.0, 0.0)
        estimate = vehicle.estimate
        here = stopping_point(estimate.position, estimate.velocity, tuning.accel, tuning.accel_z)
        chosen = vehicle.rules.return_point(vehicle)
        north, east, down = chosen or (ground[0], ground[1], ground[2] - tuning.return_height)
        away = hypot(north - here[0], east - here[1])
        least = self._return_height(vehicle.height, away, ground[2] - down)
        height = max(vehicle.height + tuning.return_climb_min, least)
        self._home = (north, east, ground[2] - height)
        self._begin("climb", ToPoint(vehicle, (here[0], here[1], ground[2] - height)))

    def _return_height(self, height: float, away: float, target_height: float) -> float:
        """Height of the return: lower within a cone about its end."""
        tuning = self.vehicle.tuning
        if tuning.return_cone > 0.0:
            target_height = min(target_height, max(away * tuning.return_cone, 2.0))
        return max(height, target_height)

    def _begin(self, name: str, stage: FlightManoeuvre) -> None:
        self._name, self._stage = name, stage
        if isinstance(stage, ToPoint) and name != "climb":
            stage.speed = self.vehicle.tuning.return_speed
        stage.enter()
        self.target = stage.target if name in ("fly", "climb") else None
        self.landing = stage.landing

    def step(self) -> None:
        """Change to the next stage when one is done."""
        stage, now = self._stage, self.vehicle.kernel.now()
        if self._name == "climb" and isinstance(stage, ToPoint) and stage.arrived(passing=True):
            self._begin("fly", ToPoint(self.vehicle, self._home, facing=self.vehicle.tuning.face_return))
        elif self._name == "fly" and isinstance(stage, ToPoint) and stage.arrived():
            self._waiting_since = now
            self._begin("wait", ToPoint(self.vehicle, self._home))
        elif self._name == "wait" and now - self._waiting_since >= self.vehicle.tuning.return_wait:
            self._finish()
        self._stage.step()

    def _finish(self) -> None:
        final = self.vehicle.tuning.return_final
        north, east, down = self._home
        if final > 0.0:
            ground = self.vehicle.home.ned[2] if self.vehicle.home else 0.0
            self._begin("final", ToPoint(self.vehicle, (north, east, ground - final)))
        else:
            self._begin("land", DescendAndLand(self.vehicle, (north, east, down)))


class Brake(FlightManoeuvre):
    """Stop, and hold the position that is reached.

    Args:
        vehicle: The vehicle.
        accel: Deceleration [m/s^2]; by default that of BRAKE.
    """

    def __init__(self, vehicle: AutopilotVehicle, accel: float = BRAKE_ACCEL) -> None:
        super().__init__(vehicle)
        self._accel = accel

    def step(self) -> None:
        """Control to zero velocity: once it is reached, the shaped target stays where it is."""
        tuning = self.vehicle.tuning
        self.vehicle.drive(
            Setpoint(
                Control.VELOCITY,
                accel=self._accel,
                accel_z=tuning.pilot_accel_z,
                tilt=tuning.tilt,
            )
        )

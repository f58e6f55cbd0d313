"""Manoeuvres by RC channels: attitude, climb rate, speed over the ground, and ArduPilot's other pilot modes.

The other modes keep the structure of ArduPilot's modes, not their gains: ACRO with its trainer's defaults
(limited lean, levels by itself), DRIFT with the roll stick as a turn, CIRCLE about a point ahead, SMART_RTL
back along the points that were passed.
"""

from __future__ import annotations

from math import hypot, radians

from volery.base.elementary import atan2, cos, sin, tan
from volery.base.frames import Vector, turn_clockwise
from volery.base.time import Ns, to_seconds
from volery.simulation.autopilots.flight_stack.flight import Control, Setpoint
from volery.simulation.autopilots.manoeuvres.onboard_mission_flight import FlyCircle
from volery.simulation.autopilots.manoeuvres.rover_driving import STANDING, DriveTo
from volery.simulation.autopilots.manoeuvres.to_point import (
    CLOSE,
    DescendAndLand,
    ToPoint,
    root_speed,
    stopping_point,
)
from volery.simulation.autopilots.manual_control import StickPositions
from volery.simulation.autopilots.state_groups import NEVER
from volery.simulation.autopilots.vehicle_state import IDLE, AutopilotVehicle, FlightManoeuvre

GRAVITY = 9.80665


class ManualFlight(FlightManoeuvre):
    """Common part of the manoeuvres by RC channels."""

    @property
    def pilot(self) -> StickPositions:
        """The stick positions now."""
        return self.vehicle.tuning.sticks.read(self.vehicle.rc)

    def climb(self, throttle: float) -> float:
        """Return the climb rate [m/s] for a throttle position 0..1; 0 within the dead zone."""
        tuning = self.vehicle.tuning
        middle = tuning.sticks.throttle_middle
        top, bottom = middle + tuning.throttle_dead, middle - tuning.throttle_dead
        if throttle > top:
            return tuning.pilot_up * (throttle - top) / (1.0 - top)
        if throttle < bottom:
            return -tuning.pilot_down * (bottom - throttle) / bottom
        return 0.0


class Stabilize(ManualFlight):
    """Sticks command tilt angles, yaw rate and thrust.

    With the throttle closed the motors idle, also in flight.
    """

    def takeoff_requested(self) -> bool:
        """Return whether the throttle is open."""
        return self.pilot.throttle > 0.0

    def step(self) -> None:
        """Pass the sticks on."""
        pilot, tuning = self.pilot, self.vehicle.tuning
        if pilot.throttle <= 0.0:
            self.vehicle.drive(IDLE)
            return
        self.vehicle.drive(
            Setpoint(
                Control.ATTITUDE,
                roll=pilot.roll * tuning.tilt,
                pitch=pilot.pitch * tuning.tilt,
                yaw_rate=pilot.yaw * tuning.pilot_yaw_rate,
                throttle=self.thrust(pilot.throttle),
            )
        )

    def thrust(self, throttle: float) -> float:
        """Return the thrust 0..1 for a throttle position 0..1.

        The middle of the stick is hover thrust: the stick is scaled to a middle of one half, then bent by a
        cubic (ArduCopter's documented throttle curve, with the learnt hover throttle as its middle).
        """
        hover = self.vehicle.estimate.stored_hover
        middle = self.vehicle.tuning.sticks.throttle_middle
        centred = (
            0.5 * throttle / middle if throttle < middle else 0.5 + 0.5 * (throttle - middle) / (1.0 - middle)
        )
        bend = min(1.0, max(-0.5, -(hover - 0.5) / 0.375))
        return min(1.0, max(0.0, centred * (1.0 - bend) + bend * centred * centred * centred))


class ClimbByThrottle(ManualFlight):
    """Common part of the modes whose throttle commands a climb rate, with the take-off to a height."""

    def __init__(self, vehicle: AutopilotVehicle) -> None:
        super().__init__(vehicle)
        self._height: float | None = None
        """Height of the take-off [m]."""

    def take_off(self, height: float) -> None:
        """Climb to a height above home [m], unless the throttle commands a descent."""
        self._height = height
        self.taking_off = True

    def takeoff_requested(self) -> bool:
        """Return whether the pilot commands a climb, or a take-off was commanded.

        The climb goes on to the height of the pilot's take-off, if there is one.
        """
        climbs = self.climb(self.pilot.throttle) > 0.0
        if climbs and not self.taking_off and self.vehicle.tuning.pilot_takeoff > 0.0:
            self.take_off(self.vehicle.height + self.vehicle.tuning.pilot_takeoff)
        return self.taking_off or climbs

    def commanded_climb(self) -> float:
        """Return the climb rate now [m/s], by the throttle or by the take-off."""
        climb = self.climb(self.pilot.throttle)
        if self._height is None:
            return climb
        left = self._height - self.vehicle.height
        if climb < 0.0 or left < CLOSE:  # the pilot commands a descent, or the height is reached
            self._height = None
            self.taking_off = False
            return climb
        return max(climb, min(self.vehicle.tuning.speed_up, root_speed(left, self.vehicle.tuning.accel_z)))


class AltitudeHold(ClimbByThrottle):
    """Sticks command tilt angles, yaw rate and climb rate.

    In the throttle's dead zone the height is held.
    """

    def step(self) -> None:
        """Pass the sticks on."""
        pilot, tuning = self.pilot, self.vehicle.tuning
        self.vehicle.drive(
            Setpoint(
                Control.CLIMB,
                roll=pilot.roll * tuning.tilt,
                pitch=pilot.pitch * tuning.tilt,
                yaw_rate=pilot.yaw * tuning.pilot_yaw_rate,
                climb=self.commanded_climb(),
                speed_up=tuning.pilot_up,
                speed_down=tuning.pilot_down,
                accel_z=tuning.pilot_accel_z,
            )
        )


LOITER_BRAKE_JERK = 5.0
"""LOIT_BRK_JERK of ArduCopter [m/s^3]."""


class Loiter(ClimbByThrottle):
    """Sticks command accelerations over the ground.

    With the sticks centred the vehicle brakes and holds its position.
    """

    def __init__(self, vehicle: AutopilotVehicle) -> None:
        super().__init__(vehicle)
        self._velocity: tuple[float, float] = (0.0, 0.0)
        self._last: Ns = 0
        self._centred_at: Ns = NEVER
        self._braking = 0.0
        """Deceleration of the brake now [m/s^2]."""

    def enter(self) -> None:
        """Begin with the present velocity."""
        north, east, _ = self.vehicle.estimate.velocity
        self._velocity = (north, east)
        self._last = self.vehicle.kernel.now()
        self._centred_at = NEVER  # the delay before braking counts from a stick that was let go in the mode
        self._braking = 0.0

    def step(self) -> None:
        """Update the velocity from the sticks, and give the set-point."""
        pilot, climb = self.pilot, self.commanded_climb()
        now = self.vehicle.kernel.now()
        passed, self._last = to_seconds(now - self._last), now
        if pilot.roll or pilot.pitch:
            self._centred_at = now
            self._braking = 0.0
            self._push(pilot, passed)
        else:
            self._let_go(now, passed)
        self._drive(pilot, climb)

    def is_left_alone(self) -> bool:
        """Return whether no stick commands a motion over the ground."""
        pilot = self.pilot
        return not (pilot.roll or pilot.pitch)

    def _drag(self) -> float:
        """Return deceleration over speed [1/s]: it balances the largest tilt at the largest speed."""
        return GRAVITY * tan(self.vehicle.tuning.loiter_tilt) / self.vehicle.tuning.loiter_speed

    def _push(self, pilot: StickPositions, passed: float) -> None:
        """Accelerate as the commanded tilt would, less a drag that balances it at the largest speed."""
        tuning = self.vehicle.tuning
        forward = -GRAVITY * tan(pilot.pitch * tuning.loiter_tilt)
        right = GRAVITY * tan(pilot.roll * tuning.loiter_tilt)
        heading = self.vehicle.estimate.attitude[2]
        northward, eastward = turn_clockwise((forward, right), heading)
        drag = self._drag()
        kept = 1.0 / (1.0 + drag * passed)  # the drag at the end of the step: it cannot overshoot
        north, east = self._velocity
        north += northward * passed
        east += eastward * passed
        self._velocity = (north * kept, east * kept)

    def _let_go(self, now: Ns, passed: float) -> None:
        """Coast against the drag at first, then brake to a stop."""
        tuning = self.vehicle.tuning
        north, east = self._velocity
        speed = hypot(north, east)
        if now - self._centred_at > tuning.loiter_brake_delay:
            self._braking = min(tuning.loiter_brake, self._braking + LOITER_BRAKE_JERK * passed)
        slow = self._drag() * speed + self._braking
        left = max(0.0, speed - slow * passed)
        self._velocity = (north * left / speed, east * left / speed) if speed > 0.0 else (0.0, 0.0)

    def _drive(self, pilot: StickPositions, climb: float) -> None:
        tuning = self.vehicle.tuning
        rate = pilot.yaw * tuning.pilot_yaw_rate
        north, east = self._velocity
        self.vehicle.drive(
            Setpoint(
                Control.VELOCITY,
                velocity=(north, east, -climb),
                yaw_rate=rate,
                speed=tuning.loiter_speed,
                speed_up=max(tuning.pilot_up, climb),
                speed_down=tuning.pilot_down,
                accel=tuning.loiter_accel,
                accel_z=tuning.pilot_accel_z,
                tilt=tuning.tilt,
            )
        )
        self._velocity = self.vehicle.setpoint.velocity[:2]  # avoidance may have changed it


ACRO_RATE = radians(360.0)
"""ACRO_RP_RATE at full stick [rad/s]."""
ACRO_LEVELS = 1.0
"""ACRO_BAL_ROLL and ACRO_BAL_PITCH: rate of levelling over the lean [1/s]."""
DRIFT_DAMPING = radians(5.0)
"""Lean against the speed without a stick [rad per m/s]."""
ABOVE_START = 2.0
"""Height above the start of the track from which the vehicle lands [m]."""
ROVER_TURN_RATE = radians(120.0)
"""Turn rate at full stick [rad/s]."""


class Acro(Stabilize):
    """Sticks command roll and pitch rates; the trainer limits the lean and levels out."""

    def __init__(self, vehicle: AutopilotVehicle) -> None:
        super().__init__(vehicle)
        self._roll = self._pitch = 0.0
        self._last: Ns = vehicle.kernel.now()

    def enter(self) -> None:
        """Begin with the present lean."""
        self._roll, self._pitch, _ = self.vehicle.estimate.attitude
        self._last = self.vehicle.kernel.now()

    def step(self) -> None:
        """Turn the commanded rates into a lean."""
        vehicle, pilot, most = self.vehicle, self.pilot, self.vehicle.tuning.tilt
        now = vehicle.kernel.now()
        passed, self._last = to_seconds(now - self._last), now
        self._roll += (pilot.roll * ACRO_RATE - self._roll * ACRO_LEVELS) * passed
        self._pitch += (pilot.pitch * ACRO_RATE - self._pitch * ACRO_LEVELS) * passed
        self._roll, self._pitch = max(-most, min(most, self._roll)), max(-most, min(most, self._pitch))
        if pilot.throttle <= 0.0:
            vehicle.drive(IDLE)
            return
        rate, thrust = pilot.yaw * vehicle.tuning.pilot_yaw_rate, self.thrust(pilot.throttle)
        vehicle.drive(
            Setpoint(Control.ATTITUDE, roll=self._roll, pitch=self._pitch, yaw_rate=rate, throttle=thrust)
        )


class Drift(Stabilize):
    """The pitch stick leans, the roll stick turns; without a stick the lean brakes."""

    def step(self) -> None:
        """Pass the sticks on, with the brake."""
        vehicle, pilot, tuning = self.vehicle, self.pilot, self.vehicle.tuning
        if pilot.throttle <= 0.0:
            vehicle.drive(IDLE)
            return
        north, east, _ = vehicle.estimate.velocity
        heading = vehicle.estimate.attitude[2]
        ahead, right = turn_clockwise((north, east), -heading)
        pitch = pilot.pitch * tuning.tilt if pilot.pitch else DRIFT_DAMPING * ahead
        most = tuning.tilt
        vehicle.drive(
            Setpoint(
                Control.ATTITUDE,
                roll=max(-most, min(most, -DRIFT_DAMPING * right)),
                pitch=max(-most, min(most, pitch)),
                yaw_rate=(pilot.roll + pilot.yaw) * tuning.pilot_yaw_rate / 2.0,
                throttle=self.thrust(pilot.throttle),
            )
        )


class CircleMode(ManualFlight):
    """Fly circles about a point one radius ahead; the throttle commands the climb."""

    def __init__(self, vehicle: AutopilotVehicle) -> None:
        super().__init__(vehicle)
        self._circle: FlyCircle | None = None
        self._centre: Vector = (0.0, 0.0, 0.0)
        self._last: Ns = vehicle.kernel.now()

    def takeoff_requested(self) -> bool:
        """Return whether the pilot commands a climb."""
        return self.climb(self.pilot.throttle) > 0.0

    def enter(self) -> None:
        """Take the centre ahead of the point where the vehicle can stop."""
        vehicle, tuning = self.vehicle, self.vehicle.tuning
        estimate = vehicle.estimate
        north, east, down = stopping_point(estimate.position, estimate.velocity, tuning.accel, tuning.accel_z)
        heading = estimate.attitude[2]
        radius = tuning.circle_radius
        self._centre = (north + radius * cos(heading), east + radius * sin(heading), down)
        self._last = vehicle.kernel.now()
        self._circle = FlyCircle(vehicle, self._centre, radius, tuning.circle_rate)
        self._circle.enter()

    def step(self) -> None:
        """Raise or lower the circle as the throttle commands, and fly it."""
        now = self.vehicle.kernel.now()
        passed, self._last = to_seconds(now - self._last), now
        if self._circle is None:
            return
        self._circle.raise_by(self.climb(self.pilot.throttle) * passed)
        self._circle.step()


class ReturnAlongTrack(FlightManoeuvre):
    """Fly or drive back along the points that were passed since arming, then land or stop."""

    def __init__(self, vehicle: AutopilotVehicle) -> None:
        super().__init__(vehicle)
        self._left: list[Vector] = []
        self._leg: ToPoint | DriveTo | None = None
        self._landing: DescendAndLand | None = None
        self._home_at: Ns | None = None

    def enter(self) -> None:
        """Take the track as it is now."""
        self._left = list(self.vehicle.ground.track)
        self._leg = None
        self._next()

    def _next(self) -> None:
        if not self._left:
            return
        point, vehicle = self._left.pop(), self.vehicle
        if vehicle.flies:
            if not self._left:
                point = (point[0], point[1], point[2] - ABOVE_START)
            flying = ToPoint(vehicle, point)
            flying.speed = vehicle.tuning.return_speed
            flying.enter()
            self._leg = flying
        else:
            self._leg = DriveTo(vehicle, point)
        self.target = point

    def step(self) -> None:
        """Continue the leg, begin the next, and land at the first point of the track."""
        now = self.vehicle.kernel.now()
        if self._landing is not None:
            self._landing.step()
            return
        if self._leg is None:
            if not self.vehicle.flies:
                self.vehicle.drive(STANDING)
            return
        if self._left and self._leg.arrived(passing=True):
            self._next()
        elif not self._left and self.vehicle.flies and self._leg.arrived():
            self._home_at = now if self._home_at is None else self._home_at
            if now - self._home_at >= self.vehicle.tuning.return_wait:
                self._landing, self.landing, self.target = (
                    DescendAndLand(self.vehicle, self._leg.point),
                    True,
                    None,
                )
        self._leg.step()


class Steering(FlightManoeuvre):
    """Sticks command a rover's speed and turn rate."""

    def step(self) -> None:
        """Pass the sticks on."""
        sticks, channels, tuning = self.vehicle.tuning.sticks, self.vehicle.rc, self.vehicle.tuning
        turn = sticks.travels[0].deflection(channels[sticks.roll])
        speed = sticks.travels[2].deflection(channels[sticks.throttle]) * tuning.pilot_speed
        self.vehicle.drive(
            Setpoint(
                Control.DRIVE,
                velocity=(speed, 0.0, 0.0),
                yaw_rate=turn * ROVER_TURN_RATE,
                speed=max(abs(speed), tuning.speed),
                accel=tuning.accel,
            )
        )


class Simple(FlightManoeuvre):
    """Sticks command a rover's course about the heading at which the mode was entered."""

    def __init__(self, vehicle: AutopilotVehicle) -> None:
        super().__init__(vehicle)
        self._ahead = 0.0

    def enter(self) -> None:
        """Take the present heading as straight ahead."""
        self._ahead = self.vehicle.estimate.attitude[2]

    def step(self) -> None:
        """Drive in the direction of the sticks."""
        sticks, channels, tuning = self.vehicle.tuning.sticks, self.vehicle.rc, self.vehicle.tuning
        right = sticks.travels[0].deflection(channels[sticks.roll])
        ahead = sticks.travels[2].deflection(channels[sticks.throttle])
        speed = min(1.0, hypot(right, ahead)) * tuning.pilot_speed
        self.vehicle.drive(
            Setpoint(
                Control.DRIVE,
                velocity=(speed, 0.0, 0.0),
                yaw=self._ahead + atan2(right, ahead) if speed else None,
                speed=max(speed, tuning.speed),
                accel=tuning.accel,
            )
        )


class RoverHold(FlightManoeuvre):
    """Keep a rover near the point where it stopped."""

    def __init__(self, vehicle: AutopilotVehicle) -> None:
        super().__init__(vehicle)
        self._driving = DriveTo(vehicle, vehicle.estimate.position)

    def enter(self) -> None:
        """Take the stopping point."""
        vehicle, tuning = self.vehicle, self.vehicle.tuning
        estimate = vehicle.estimate
        point = stopping_point(estimate.position, estimate.velocity, tuning.accel, tuning.accel_z)
        self._driving = DriveTo(vehicle, point)
        self.target = point

    def step(self) -> None:
        """Stand within the waypoint radius; drive back from beyond it."""
        if self._driving.distance() < self.vehicle.tuning.waypoint_radius:
            self.vehicle.drive(Setpoint(Control.DRIVE, speed=1.0, accel=self.vehicle.tuning.accel))
        else:
            self._driving.step()

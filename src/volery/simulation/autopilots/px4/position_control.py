"""PX4's multicopter position control: trajectory of the automatic modes, position loop, velocity loop.

As in PX4 1.14, a trajectory moves straight towards the point with MPC_JERK_AUTO and MPC_ACC_HOR; its speed
is what braking over the remaining distance allows, and it runs slower, down to standing still, the
farther the vehicle is behind it (MPC_XY_ERR_MAX). Position error times MPC_XY_P, the trajectory's velocity
and acceleration feed a PID on velocity. The loops fly the airframe that was recorded, SIH's quadrotor, whose
drag is large: the integral winds up against it on a long leg, and the leg ends too far by what it has to
unwind. The loops see what EKF2 would state of that airframe, and the flight stack follows that position.
"""

from __future__ import annotations

from math import dist, hypot, inf, isfinite, sqrt
from typing import Final, NamedTuple

from volery.base.elementary import tan
from volery.base.frames import Vector
from volery.base.time import Ns, from_seconds, to_seconds
from volery.simulation.autopilots.flight_stack.flight import Control, Setpoint
from volery.simulation.autopilots.flight_stack.guidance import approach, shorten
from volery.simulation.autopilots.px4.estimate_error import (
    GRAVITY,
    QUIET,
    STEP,
    VERTICAL,
    EstimateError,
    Noise,
    sih_noise,
)
from volery.simulation.autopilots.vehicle_state import Vehicle

SUBSTEP: Final = STEP
"""Step of the integration [s]."""

DRAG: Final = 1.0
"""Drag of the recorded airframe divided by its mass: SIH_KDV / SIH_MASS [1/s]."""

LEAN_LAG: Final = 0.15
THRUST_LAG: Final = 0.06
"""Lag from commanded to flown acceleration in the plane (attitude loops) and along the thrust [s]."""

HOVER_TIME: Final = 11.0
"""Time constant of the estimated hover thrust (MPC_USE_HTE) [s]."""

ACCEL_GAIN: Final = 20.0
"""Gain on a velocity error below which the trajectory's acceleration fades linearly [1/s]."""

CLAMP_EACH: Final = 0.5
"""Speed below which a limit no longer keeps the direction of the trajectory [m/s], as in PX4's sources."""

BEYOND: Final = 1e6
"""Factor on a distance whose product is beyond any limit of speed [1/s]."""

FOLLOW_GAIN, FOLLOW_LEAD = 0.95, 0.25
"""How the flight stack follows the airframe of the loops: gain [1/s] and lead [s]."""

FOLLOW_ACCEL, FOLLOW_JERK, FASTEST = 12.0, 100.0, 25.0
"""Limits of the flight stack [m/s^2, m/s^3, m/s]; the loops limit the motion."""

RESTART_AFTER = from_seconds(0.5)
"""Time without a step after which the loops start anew."""

ELSEWHERE = 12.0
"""Distance of vehicle and loops from which the loops start anew [m]."""


def braking_speed(jerk: float, accel: float, distance: float) -> float:
    """Return the speed from which a distance suffices to brake, with time for the jerk [m/s]."""
    ramp = 4.0 * accel * accel / jerk
    return 0.5 * (sqrt(ramp * ramp + 8.0 * accel * distance) - ramp)


class Cruise(NamedTuple):
    """Limits of a trajectory: speeds in the plane, up and down [m/s], acceleration of a climb [m/s^2]."""

    speed: float
    up: float
    down: float
    lift: float = inf


class Gains:
    """Limits and gains of the loops, read from a vehicle's parameters once for all substeps of a call."""

    def __init__(self, vehicle: Vehicle) -> None:
        p = vehicle.parameters
        self.jerk, self.push, self.behind = p["MPC_JERK_AUTO"], p["MPC_ACC_HOR"], p["MPC_XY_ERR_MAX"]
        self.lift, self.sink = p["MPC_ACC_UP_MAX"], p["MPC_ACC_DOWN_MAX"]
        self.place = p["MPC_XY_P"], p["MPC_XY_P"], p["MPC_Z_P"]
        self.speed = p["MPC_XY_VEL_P_ACC"], p["MPC_XY_VEL_P_ACC"], p["MPC_Z_VEL_P_ACC"]
        self.integral = p["MPC_XY_VEL_I_ACC"], p["MPC_XY_VEL_I_ACC"], p["MPC_Z_VEL_I_ACC"]
        self.slope = p["MPC_XY_VEL_D_ACC"], p["MPC_XY_VEL_D_ACC"], p["MPC_Z_VEL_D_ACC"]
        self.lean = tan(vehicle.tuning.tilt) * GRAVITY
        """Largest acceleration in the plane [m/s^2]."""


class Trajectory:
    """Position, velocity and acceleration that move towards a point, north, east, down."""

    def __init__(self, position: Vector, velocity: Vector) -> None:
        self.position, self.velocity = list(position), list(velocity)
        self.accel = [0.0, 0.0, 0.0]

    def step(self, gains: Gains, point: Vector, cruise: Cruise, flown: list[float], passed: float) -> None:
        """Move towards a point.

        Args:
            gains: Limits of acceleration and jerk.
            point: North, east, down [m]; down may be infinite: it sinks at ``cruise.down``.
            cruise: Limits of speed.
            flown: Position of the aircraft by its estimate [m].
            passed: Time [s].
        """
        jerk, push, place, speed = gains.jerk, gains.push, self.position, self.velocity
        ahead = point[0] - place[0], point[1] - place[1], point[2] - place[2]
        climbs = ahead[2] < 0.0
        lift = min(cruise.lift, gains.lift) if climbs else gains.sink
        level = hypot(ahead[0], ahead[1])
        plane = min(cruise.speed, braking_speed(jerk, push, level))
        if isfinite(ahead[2]):
            along = min(cruise.up if climbs else cruise.down, braking_speed(jerk, lift, abs(ahead[2])))
            wished = _straight(ahead, plane, along)
        else:
            north, east = shorten(BEYOND * ahead[0], BEYOND * ahead[1], plane)
            wished = north, east, cruise.down
        passed *= self._stretch(flown, gains.behind)
        dn, de, dd = wished[0] - speed[0], wished[1] - speed[1], wished[2] - speed[2]
        gap = hypot(dn, de)
        wanted = min(push, approach(gap, ACCEL_GAIN, jerk)) / gap if gap > 1e-9 else 0.0
        change_n, change_e = shorten(dn * wanted - self.accel[0], de * wanted - self.accel[1], jerk * passed)
        down = max(-lift, min(lift, approach(dd, ACCEL_GAIN, jerk)))
        change_d = max(-jerk * passed, min(jerk * passed, down - self.accel[2]))
        self._move(0, change_n, passed)
        self._move(1, change_e, passed)
        self._move(2, change_d, passed)

    def _move(self, axis: int, change: float, passed: float) -> None:
        """Advance one axis by a change of its acceleration."""
        accel, before = self.accel[axis] + change, self.velocity[axis]
        speed = before + accel * passed
        self.accel[axis], self.velocity[axis] = accel, speed
        self.position[axis] += 0.5 * (before + speed) * passed

    def _stretch(self, flown: list[float], most: float) -> float:
        """Return the pace of the trajectory, 0 to 1: slower the farther the vehicle is behind it."""
        north, east = self.position[0] - flown[0], self.position[1] - flown[1]
        if most <= 0.0 or north * self.velocity[0] + east * self.velocity[1] < 0.0:
            return 1.0
        return 1.0 - min(1.0, hypot(north, east) / most)


def _straight(ahead: Vector, plane: float, along: float) -> Vector:
    """Return the velocity along a straight line that exceeds neither the plane's nor the height's limit.

    Below ``CLAMP_EACH`` a limit shortens its own components alone: a slow end of the height does not slow the
    plane. As PX4's ``clampToXYNorm`` and ``clampToZNorm`` do.
    """
    level, height = hypot(ahead[0], ahead[1]), abs(ahead[2])
    distance = hypot(level, height)
    if distance < 1e-9:
        return 0.0, 0.0, 0.0
    share = hypot(plane, along) / distance
    sideways, upright = share, share
    if level * sideways > plane:
        if plane >= CLAMP_EACH or level * sideways >= CLAMP_EACH:
            upright *= plane / (level * sideways)
        sideways = plane / level
    if height * upright > along:
        if along >= CLAMP_EACH or height * upright >= CLAMP_EACH:
            sideways *= along / (height * upright)
        upright = along / height
    return ahead[0] * sideways, ahead[1] * sideways, ahead[2] * upright


Noises = tuple[Noise, Noise, Noise]
Errors = tuple[EstimateError, EstimateError, EstimateError]
SILENCE: Final[Noises] = (QUIET, QUIET, QUIET)


def no_errors() -> Errors:
    """Return the errors of an estimate that is right now, north, east, down."""
    return EstimateError(), EstimateError(), EstimateError(VERTICAL)


class Wanted(NamedTuple):
    """What the loops control, north, east, down [m, m/s, m/s^2]; NaN: not given."""

    position: Vector
    velocity: Vector
    accel: Vector


class AirframeLoops:
    """Position and velocity loops that fly the recorded airframe.

    Position and velocity are those that EKF2 states; they differ by ``EstimateError`` from the flown ones.
    """

    def __init__(self, position: Vector, velocity: Vector, errors: Errors | None = None) -> None:
        self.position, self.velocity = list(position), list(velocity)
        self.moving = list(velocity)
        """Rate at which the stated position moves [m/s]."""
        self.accel = [0.0, 0.0, 0.0]
        self.errors = errors or no_errors()
        """Errors of the stated motion, north, east, down."""
        self._flown = [stated - error.velocity for stated, error in zip(velocity, self.errors, strict=True)]
        self._thrust = [DRAG * v for v in self._flown]
        self._integral = list(self._thrust)
        self._hover = 1.0
        """Estimated thrust that hovers, over the true one."""

    def stand(self, position: Vector) -> None:
        """Keep the airframe on the ground; its climb may grow."""
        self.position = list(position)
        for axis in range(2):
            self.velocity[axis] = self.accel[axis] = self._thrust[axis] = self._integral[axis] = 0.0
            self._flown[axis] = self.moving[axis] = 0.0
        self._hover = 1.0

    def step(self, gains: Gains, wanted: Wanted, limits: Cruise, noise: Noises = SILENCE) -> None:
        """Fly one substep; *noise* is that of the sensors, north, east, down."""
        speeds, push, free = [0.0, 0.0, 0.0], [0.0, 0.0, 0.0], [False, False, False]
        for axis in range(3):
            place, speed, accel = wanted.position[axis], wanted.velocity[axis], wanted.accel[axis]
            free[axis] = isfinite(accel) and not isfinite(place) and not isfinite(speed)
            push[axis] = accel if isfinite(accel) else 0.0
            speeds[axis] = speed if isfinite(speed) else 0.0
            if isfinite(place):
                speeds[axis] += gains.place[axis] * (place - self.position[axis])
        north, east = shorten(speeds[0], speeds[1], limits.speed)
        down = max(-limits.up, min(limits.down, speeds[2]))
        self._fly(gains, (north, east, down), push, free, noise)

    def _fly(
        self,
        gains: Gains,
        speeds: Vector,
        push: list[float],
        free: list[bool],
        noise: Noises,
    ) -> None:
        """Fly velocities with accelerations fed forward; a free axis has no velocity loop."""
        miss, integral = [0.0, 0.0, 0.0], self._integral
        for axis in range(3):
            if not free[axis]:
                miss[axis] = off = speeds[axis] - self.velocity[axis]
                push[axis] += gains.speed[axis] * off + integral[axis] - gains.slope[axis] * self.accel[axis]
        push[2] = max(-GRAVITY, min(GRAVITY, push[2]))
        north, east = shorten(push[0], push[1], gains.lean)
        supposed = 1.0 - push[2] / GRAVITY
        if supposed * hypot(north, east) < hypot(push[0], push[1]):
            unwind = 2.0 / max(0.1, gains.speed[0])
            miss[0] -= unwind * (push[0] - supposed * north)
            miss[1] -= unwind * (push[1] - supposed * east)
        given = supposed * self._hover
        north, east, down = north * given, east * given, GRAVITY * (1.0 - given)
        for axis in range(3):
            if not free[axis]:
                integral[axis] += gains.integral[axis] * miss[axis] * SUBSTEP
        integral[2] = max(-GRAVITY, min(GRAVITY, integral[2]))
        self._move(0, north, LEAN_LAG, noise[0])
        self._move(1, east, LEAN_LAG, noise[1])
        self._move(2, down, THRUST_LAG, noise[2])
        self._estimate_hover(given, push[2])

    def _move(self, axis: int, wanted: float, lag: float, noise: Noise) -> None:
        """Advance one axis by a substep under a commanded acceleration, which it follows with a lag [s]."""
        error, before = self.errors[axis], self._flown[axis]
        thrust = self._thrust[axis] + SUBSTEP / lag * (wanted - error.tilt - self._thrust[axis])
        accel = thrust - DRAG * before
        speed = before + accel * SUBSTEP
        self._thrust[axis], self.accel[axis], self._flown[axis] = thrust, accel + error.tilt, speed
        moving, stated = 0.5 * (before + speed), speed
        if axis < 2:
            error.step(speed, accel, noise)
        elif noise is not QUIET:
            error.step(0.0, 0.0, noise)
        moving, stated = moving + error.rate, stated + error.velocity
        self.position[axis] += moving * SUBSTEP
        self.moving[axis], self.velocity[axis] = moving, stated

    def _estimate_hover(self, given: float, push: float) -> None:
        """Estimate the thrust that hovers from thrust and acceleration; the integral keeps the thrust.

        A climb or descent at constant speed against the drag changes the estimate, so that the commanded
        acceleration returns to 0.
        """
        hovers = given * GRAVITY / max(0.1 * GRAVITY, GRAVITY - self.accel[2])
        before = self._hover
        self._hover += SUBSTEP / HOVER_TIME * (max(0.2, min(1.8, hovers)) - before)
        self._integral[2] += (push - GRAVITY) * before / self._hover + GRAVITY - push


class PositionLoops:
    """Trajectory and loops of one vehicle; they outlast changes between the modes that use them."""

    def __init__(self, vehicle: Vehicle) -> None:
        self._vehicle = vehicle
        self._noisy = vehicle.flight.spec.sensors == "sih"
        """Whether the loops fly after the noise of gyroscope and accelerometer. That of the other sets is at
        most a fortieth of SIH's, and left out."""
        self._loops: AirframeLoops | None = None
        self._trajectory: Trajectory | None = None
        self._last: Ns = 0

    def fly_to(self, point: Vector, cruise: Cruise, yaw: float | None = None) -> None:
        """Move the trajectory towards a point and follow it.

        Args:
            point: North, east, down [m]; down may be infinite: it sinks at ``cruise.down``.
            cruise: Limits of speed.
            yaw: Heading [rad]; ``None``: keep it.
        """
        loops, steps = self._advanced()
        trajectory = self._trajectory
        if trajectory is None or self._vehicle.landed:
            climb = 0.0 if trajectory is None else trajectory.velocity[2]
            velocity = (0.0, 0.0, climb) if self._vehicle.landed else _vector(loops.velocity)
            trajectory = self._trajectory = Trajectory(_vector(loops.position), velocity)
        limits, gains = self._limits(), Gains(self._vehicle)
        for number in range(-steps, 0):
            trajectory.step(gains, point, cruise, loops.position, SUBSTEP)
            loops.step(
                gains,
                Wanted(_vector(trajectory.position), _vector(trajectory.velocity), _vector(trajectory.accel)),
                limits,
                self._noise(number),
            )
        self._follow(loops, yaw, None)

    def fly(self, wanted: Wanted, up: float, yaw: float | None, yaw_rate: float | None) -> None:
        """Control position and velocity directly, without a trajectory.

        Args:
            wanted: What is controlled.
            up: Limit of the climb [m/s].
            yaw: Heading [rad], or
            yaw_rate: turn rate [rad/s]; neither: keep the heading.
        """
        loops, steps = self._advanced()
        self._trajectory = None
        limits, gains = self._limits()._replace(up=up), Gains(self._vehicle)
        for number in range(-steps, 0):
            loops.step(gains, wanted, limits, self._noise(number))
        self._follow(loops, yaw, yaw_rate)

    def _noise(self, number: int) -> Noises:
        """Return the noise of a substep, counted from the last one; sensors other than SIH's give none."""
        if not self._noisy:
            return SILENCE
        flight, step = self._vehicle.flight, self._last // from_seconds(SUBSTEP) + number
        return sih_noise(lambda stream: flight.draw(stream, step), self._vehicle.estimate.attitude[2])

    def _limits(self) -> Cruise:
        tuning = self._vehicle.tuning
        return Cruise(tuning.speed, tuning.speed_up, tuning.speed_down)

    def _advanced(self) -> tuple[AirframeLoops, int]:
        """Return the loops and the substeps to now; the loops start anew where the vehicle is elsewhere."""
        vehicle, loops, now = self._vehicle, self._loops, self._vehicle.kernel.now()
        here = vehicle.estimate.position
        if loops is None or now - self._last > RESTART_AFTER or dist(loops.position, here) > ELSEWHERE:
            errors = loops.errors if loops is not None and self._noisy else None
            loops = self._loops = AirframeLoops(here, vehicle.estimate.velocity, errors)
            self._trajectory, self._last = None, now
        elif vehicle.landed:
            loops.stand(here)
            if not self._noisy:
                loops.errors = no_errors()
        steps = round(to_seconds(now - self._last) / SUBSTEP)
        self._last += from_seconds(steps * SUBSTEP)
        return loops, steps

    def _follow(self, loops: AirframeLoops, yaw: float | None, yaw_rate: float | None) -> None:
        """Let the flight stack follow the airframe of the loops."""
        vehicle, here = self._vehicle, self._vehicle.estimate.position
        moving, accel = list(loops.moving), list(loops.accel)
        if self._noisy:
            for axis, error in enumerate(loops.errors):
                moving[axis] -= error.rate
                accel[axis] -= error.tilt
            vehicle.flight.estimate_error = (
                *(error.position for error in loops.errors),
                *(error.velocity for error in loops.errors),
            )
        north, east, down = (
            v + FOLLOW_LEAD * a + FOLLOW_GAIN * (place - at)
            for place, v, a, at in zip(loops.position, moving, accel, here, strict=True)
        )
        vehicle.drive(
            Setpoint(
                Control.VELOCITY,
                velocity=(north, east, down),
                yaw=yaw,
                yaw_rate=yaw_rate,
                speed=FASTEST,
                speed_up=FASTEST,
                speed_down=FASTEST,
                accel=FOLLOW_ACCEL,
                accel_z=FOLLOW_ACCEL,
                tilt=vehicle.tuning.tilt,
                jerk=FOLLOW_JERK,
            )
        )


def _vector(values: list[float]) -> Vector:
    return values[0], values[1], values[2]

"""OFFBOARD: what PX4's multirotor makes of a stream of set-points.

It has no planned path: a point is chased at a speed proportional to what is left, up to MPC_XY_VEL_MAX. The
recorded airframe has much drag, against which the velocity loop's integral builds up: so a speed is reached
slowly, and a long leg ends two metres too far. A reference velocity that obeys the same gains and the same
drag shows the same.
"""

from __future__ import annotations

from math import hypot, isfinite

from volery.base.frames import Vector, quaternion_to_euler
from volery.base.time import Ns, to_seconds
from volery.simulation.autopilots.flight_stack.flight import Control, Setpoint
from volery.simulation.autopilots.px4.offboard import AttitudeTarget, Target
from volery.simulation.autopilots.px4.ramps import climb_share
from volery.simulation.autopilots.vehicle_state import Manoeuvre, Vehicle

JERK = 60.0
"""Of set-points that are flown as they come [m/s^3]."""

PUSH = 7.0
"""Acceleration in the plane at which OFFBOARD starts, in the recordings [m/s^2]."""

VELOCITY_GAIN, VELOCITY_INTEGRAL = 1.8, 0.4
"""MPC_XY_VEL_P_ACC [1/s], MPC_XY_VEL_I_ACC [1/s^2]."""

DRAG = 1.0
"""Of the recorded airframe, by its mass (SIH_KDV / SIH_MASS) [1/s]."""

LAG = 0.6
"""By which the inner loops here follow a velocity later than the recorded airframe did [s]."""

SUBSTEP = 0.02
"""In which the reference velocity is reckoned [s]."""


class Pursue(Manoeuvre):
    """Chase a ``Target`` axis by axis; without one, stay."""

    def __init__(self, vehicle: Vehicle) -> None:
        super().__init__(vehicle)
        self._aim: Target | None = None
        self._velocity: Vector = (0.0, 0.0, 0.0)
        self._integral = (0.0, 0.0)
        self._last: Ns = 0

    def enter(self) -> None:
        """With the speed that it has; stop where it can."""
        self._velocity = self.vehicle.estimate.velocity
        self._integral = (DRAG * self._velocity[0], DRAG * self._velocity[1])
        self._last = self.vehicle.kernel.now()
        self._aim = None

    def aim(self, target: Target) -> None:
        """Chase that from now on."""
        self._aim = target
        north, east, down = target.position
        here = self.vehicle.estimate.position
        known = isfinite(north) and isfinite(east)
        self.target = (north, east, down if isfinite(down) else here[2]) if known else None

    def wants_to_fly(self) -> bool:
        """If what it chases is above."""
        return self._aim is not None and self._aim.lifts(self.vehicle.estimate.position[2])

    def step(self) -> None:
        """Go on chasing."""
        vehicle = self.vehicle
        now = vehicle.kernel.now()
        passed, self._last = to_seconds(now - self._last), now
        if self._aim is None:
            self._aim = Target(position=vehicle.estimate.position)
        self._velocity = self._chased(self._aim, passed)
        tuning = vehicle.tuning
        rate = self._aim.yaw_rate
        vehicle.drive(
            Setpoint(
                Control.VELOCITY,
                velocity=self._velocity,
                yaw=self._aim.yaw if rate is None else None,
                yaw_rate=rate,
                speed=tuning.speed,
                speed_up=climb_share(vehicle) * tuning.speed_up,
                speed_down=tuning.speed_down,
                accel=2.0 * PUSH,
                accel_z=tuning.accel_z,
                tilt=tuning.tilt,
                jerk=JERK,
            )
        )

    def _chased(self, aim: Target, passed: float) -> Vector:
        """The velocity to fly now: what the recorded airframe would have come to."""
        north, east = self._wanted(aim, 0), self._wanted(aim, 1)
        speed, most = hypot(north, east), self.vehicle.tuning.speed
        if speed > most:
            north, east = north * most / speed, east * most / speed
        for _ in range(max(1, round(passed / SUBSTEP))):
            self._follow(north, east)
        return self._velocity[0], self._velocity[1], self._wanted(aim, 2)

    def _follow(self, north: float, east: float) -> None:
        """One substep of velocity loop and drag."""
        vn, ve, _ = self._velocity
        gn, ge = self._integral
        dn, de = north - vn, east - ve
        an = VELOCITY_GAIN * dn + gn - DRAG * vn
        ae = VELOCITY_GAIN * de + ge - DRAG * ve
        push = hypot(an, ae)
        share = PUSH / push if push > PUSH else 1.0
        self._velocity = (vn + an * share * SUBSTEP, ve + ae * share * SUBSTEP, 0.0)
        self._integral = (gn + VELOCITY_INTEGRAL * dn * SUBSTEP, ge + VELOCITY_INTEGRAL * de * SUBSTEP)

    def _wanted(self, aim: Target, axis: int) -> float:
        place, speed, push = aim.position[axis], aim.velocity[axis], aim.acceleration[axis]
        wanted = speed if isfinite(speed) else 0.0
        if isfinite(place):
            gain = 0.95 if axis < 2 else 1.0  # MPC_XY_P, MPC_Z_P
            ahead = LAG * self._velocity[axis] if axis < 2 else 0.0
            wanted += gain * (place - self.vehicle.estimate.position[axis] - ahead)
        elif isfinite(push) and not isfinite(speed):
            wanted = self._velocity[axis] + push * 0.45
        return wanted


class Offboard(Manoeuvre):
    """Whatever the stream of set-points says. Attitudes are flown as they are."""

    slow_start = True

    def __init__(self, vehicle: Vehicle) -> None:
        super().__init__(vehicle)
        self._pursuit = Pursue(vehicle)
        self._attitude: AttitudeTarget | None = None

    def enter(self) -> None:
        """Stay until told."""
        self._pursuit.enter()
        self.take(self.vehicle.memory.stream.target)

    def take(self, target: Target | AttitudeTarget | None) -> None:
        """A set-point came."""
        self._attitude = target if isinstance(target, AttitudeTarget) else None
        if isinstance(target, Target):
            self._pursuit.aim(target)
        self.target = None if self._attitude else self._pursuit.target

    def wants_to_fly(self) -> bool:
        """If it is asked to climb, or given much thrust."""
        if self._attitude is not None:
            return self._attitude.thrust > 0.3
        return self._pursuit.wants_to_fly()

    def step(self) -> None:
        """Fly it."""
        if self._attitude is None:
            self._pursuit.step()
            return
        self._pursuit.enter()
        roll, pitch, yaw = quaternion_to_euler(self._attitude.attitude)
        rate = self._attitude.yaw_rate
        share = self._attitude.thrust / self.vehicle.parameters["MPC_THR_HOVER"]
        self.vehicle.drive(
            Setpoint(
                Control.ATTITUDE,
                roll=roll,
                pitch=pitch,
                yaw=yaw if rate is None else None,
                yaw_rate=rate,
                throttle=min(1.0, share * self.vehicle.estimate.hover_throttle),
            )
        )

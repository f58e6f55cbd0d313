"""Manoeuvres of a multirotor by RC channels: attitude, climb rate, or speed over the ground."""

from __future__ import annotations

from math import cos, hypot, sin, tan

from volery.base.frames import Vector
from volery.base.time import Ns, to_seconds
from volery.simulation.autopilots.flight_stack.flight import Control, Setpoint
from volery.simulation.autopilots.manoeuvres.to_point import CLOSE, root_speed
from volery.simulation.autopilots.manual_control import StickPositions
from volery.simulation.autopilots.vehicle_state import IDLE, Manoeuvre, Vehicle

GRAVITY = 9.80665


class ManualFlight(Manoeuvre):
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
        hover = self.vehicle.estimate.hover_throttle
        middle = self.vehicle.tuning.sticks.throttle_middle
        centred = (
            0.5 * throttle / middle if throttle < middle else 0.5 + 0.5 * (throttle - middle) / (1.0 - middle)
        )
        bend = min(1.0, max(-0.5, -(hover - 0.5) / 0.375))
        return min(1.0, max(0.0, centred * (1.0 - bend) + bend * centred**3))


class AltitudeHold(ManualFlight):
    """Sticks command tilt angles, yaw rate and climb rate.

    In the throttle's dead zone the height is held.
    """

    def takeoff_requested(self) -> bool:
        """Return whether the pilot commands a climb."""
        return self.climb(self.pilot.throttle) > 0.0

    def step(self) -> None:
        """Pass the sticks on."""
        pilot, tuning = self.pilot, self.vehicle.tuning
        self.vehicle.drive(
            Setpoint(
                Control.CLIMB,
                roll=pilot.roll * tuning.tilt,
                pitch=pilot.pitch * tuning.tilt,
                yaw_rate=pilot.yaw * tuning.pilot_yaw_rate,
                climb=self.climb(pilot.throttle),
                speed_up=tuning.pilot_up,
                speed_down=tuning.pilot_down,
                accel_z=tuning.pilot_accel_z,
            )
        )


class Loiter(ManualFlight):
    """Sticks command accelerations over the ground.

    With the sticks centred the vehicle brakes and holds its position.
    """

    def __init__(self, vehicle: Vehicle) -> None:
        super().__init__(vehicle)
        self._velocity: tuple[float, float] = (0.0, 0.0)
        self._last: Ns = 0
        self._centred_at: Ns = 0
        self._held: Vector | None = None
        self._height: float | None = None  # of a commanded take-off [m]

    def take_off(self, height: float) -> None:
        """Climb to a height above home [m], unless the throttle commands a descent."""
        self._height = height
        self.taking_off = True

    def enter(self) -> None:
        """Begin with the present velocity."""
        north, east, _ = self.vehicle.estimate.velocity
        self._velocity = (north, east)
        self._last = self._centred_at = self.vehicle.kernel.now()
        self._held = None

    def takeoff_requested(self) -> bool:
        """Return whether the pilot commands a climb, or a take-off was commanded."""
        return self.taking_off or self.climb(self.pilot.throttle) > 0.0

    def step(self) -> None:
        """Update the velocity from the sticks, and give the set-point."""
        pilot, climb = self.pilot, self._climb()
        now = self.vehicle.kernel.now()
        passed, self._last = to_seconds(now - self._last), now
        if pilot.roll or pilot.pitch:
            self._centred_at = now
            self._held = None
            self._push(pilot, passed)
        else:
            self._let_go(now, passed)
        self._drive(pilot, climb)

    def _climb(self) -> float:
        climb = self.climb(self.pilot.throttle)
        if self._height is None:
            return climb
        left = self._height - self.vehicle.height
        if climb < 0.0 or left < CLOSE:  # the pilot commands a descent, or the height is reached
            self._height = None
            self.taking_off = False
            return climb
        return max(climb, min(self.vehicle.tuning.speed_up, root_speed(left, self.vehicle.tuning.accel_z)))

    def _push(self, pilot: StickPositions, passed: float) -> None:
        """Accelerate as the commanded tilt would, less a drag that balances it at the largest speed."""
        tuning = self.vehicle.tuning
        forward = -GRAVITY * tan(pilot.pitch * tuning.loiter_tilt)
        right = GRAVITY * tan(pilot.roll * tuning.loiter_tilt)
        heading = self.vehicle.estimate.attitude[2]
        c, s = cos(heading), sin(heading)
        drag = tuning.loiter_accel / tuning.loiter_speed
        kept = 1.0 / (1.0 + drag * passed)  # the drag at the end of the step: it cannot overshoot
        north, east = self._velocity
        north += (forward * c - right * s) * passed
        east += (forward * s + right * c) * passed
        self._velocity = (north * kept, east * kept)

    def _let_go(self, now: Ns, passed: float) -> None:
        """Coast at first, then brake to a stop."""
        tuning = self.vehicle.tuning
        north, east = self._velocity
        speed = hypot(north, east)
        braking = now - self._centred_at > tuning.loiter_brake_delay
        slow = tuning.loiter_brake if braking else tuning.loiter_accel / tuning.loiter_speed * speed
        left = max(0.0, speed - slow * passed)
        self._velocity = (north * left / speed, east * left / speed) if speed > 0.0 else (0.0, 0.0)
        if left == 0.0 and self._held is None:
            self._held = self.vehicle.estimate.target

    def _drive(self, pilot: StickPositions, climb: float) -> None:
        tuning = self.vehicle.tuning
        rate = pilot.yaw * tuning.pilot_yaw_rate
        north, east = self._velocity
        held = self._held
        self.vehicle.drive(
            Setpoint(
                Control.VELOCITY if held is None else Control.POSITION_CLIMB,
                position=held or (0.0, 0.0, 0.0),
                velocity=(north, east, -climb),
                climb=climb,
                yaw_rate=rate,
                speed=tuning.loiter_speed,
                speed_up=max(tuning.pilot_up, climb),
                speed_down=tuning.pilot_down,
                accel=tuning.loiter_accel,
                accel_z=tuning.pilot_accel_z,
                tilt=tuning.tilt,
            )
        )

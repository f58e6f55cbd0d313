"""Manoeuvres of the rotorcraft's modes.

Set-points of GUIDED are a position or a velocity for each axis, and never expire.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from math import isfinite

from volery.base.frames import Vector, enu_to_ned, turn_clockwise, wrap
from volery.base.time import MS, Ns, from_seconds, to_seconds
from volery.simulation.autopilots.flight_stack.flight import Control, Setpoint
from volery.simulation.autopilots.flight_stack.guidance import approach
from volery.simulation.autopilots.manoeuvres.manual_flight import AltitudeHold, ManualFlight, Stabilize
from volery.simulation.autopilots.paparazzi.flight_plan import PlanDemand, Vertical
from volery.simulation.autopilots.paparazzi.guidance_loops import (
    CLIMB_GAIN,
    HEIGHT_GAIN,
    SUBSTEP,
    GuidanceLoops,
    SpeedLimits,
    as_obeyed,
)
from volery.simulation.autopilots.paparazzi.rotorcraft_state import state_of
from volery.simulation.autopilots.vehicle_state import IDLE, AutopilotVehicle, FlightManoeuvre

LIFT_OFF_M = 0.3
"""Height [m] above which the plan's target takes a standing vehicle off the ground."""

BELOW_M, SINKING_M_S = 0.2, 0.1
"""Distance below the vehicle [m] and sink rate [m/s] from which GUIDED keeps it on the ground."""

FOLLOW_GAIN, FOLLOW_LEAD = 0.4, 0.25
"""How the flight stack follows the guidance loops: gain [1/s] and lead [s]."""

FOLLOW_ACCEL, FOLLOW_JERK, FASTEST = 10.0, 80.0, 15.0
"""Limits of the flight stack [m/s^2, m/s^3, m/s]; the guidance loops limit the motion."""

RESTS_FOR = round(60.0 / SUBSTEP)
"""Substeps after which a reference that moves alone has arrived."""

TURN_GAIN, TURN_BRAKE = 3.5, 2.4
"""Approach to a heading [1/s, rad/s^2]: 90 degrees within 3 were recorded after 1.15 s, 180 after 2.15 s."""


class Guidance(FlightManoeuvre):
    """A manoeuvre that the firmware's guidance loops fly, with their overshoot."""

    RESTART_AFTER: Ns = 500 * MS
    """Time without a step after which the loops start anew."""

    def __init__(self, vehicle: AutopilotVehicle) -> None:
        super().__init__(vehicle)
        self._loops: GuidanceLoops | None = None
        self._last_step_ns: Ns = 0

    def fly_loops(
        self,
        plane: tuple[float, float],
        down: float,
        *,
        plane_is_velocity: bool,
        down_is_velocity: bool,
        yaw: float | None,
        yaw_rate: float | None = None,
    ) -> None:
        """Move the loops to now and follow them.

        Args:
            plane: North and east of the goal [m], or their velocities [m/s].
            down: Down of the goal [m], or the velocity [m/s].
            plane_is_velocity: Whether ``plane`` is a velocity; likewise ``down_is_velocity``.
            down_is_velocity: Whether ``down`` is a velocity.
            yaw: Heading [rad], or None for a rate.
            yaw_rate: Turn rate [rad/s].
        """
        vehicle, tuning, estimate = self.vehicle, self.vehicle.tuning, self.vehicle.estimate
        loops = self._moved_loops()
        frozen = state_of(vehicle).frozen
        if frozen is None:
            loops.plane.frozen = None
        elif loops.plane.frozen is None:
            loops.plane.frozen = loops.plane.place, loops.plane.velocity
        for _ in range(self._substeps()):
            loops.step(
                plane,
                -down,
                self._limits(),
                plane_is_velocity=plane_is_velocity,
                up_is_velocity=down_is_velocity,
                in_flight=vehicle.ground.lifted,
            )
        vehicle.drive(
            Setpoint(
                Control.VELOCITY,
                velocity=loops.correction(estimate.position, FOLLOW_GAIN, FOLLOW_LEAD),
                yaw_rate=yaw_rate if yaw is None else self._turn_to(yaw),
                speed=FASTEST,
                speed_up=FASTEST,
                speed_down=FASTEST,
                accel=FOLLOW_ACCEL,
                accel_z=FOLLOW_ACCEL,
                tilt=tuning.tilt,
                jerk=FOLLOW_JERK,
            )
        )

    def _limits(self) -> SpeedLimits:
        tuning = self.vehicle.tuning
        return SpeedLimits(tuning.speed, tuning.speed_up, tuning.speed_down)

    def _turn_to(self, yaw: float) -> float:
        """Return the turn rate towards a heading [rad/s]."""
        return approach(wrap(yaw - self.vehicle.estimate.attitude[2]), TURN_GAIN, TURN_BRAKE)

    def _moved_loops(self) -> GuidanceLoops:
        estimate = self.vehicle.estimate
        lost = state_of(self.vehicle).frozen is not None
        if self._loops is None or self._is_late():
            self._loops = GuidanceLoops(estimate.position, estimate.velocity)
            self._last_step_ns = self.vehicle.kernel.now()
        elif not lost and self._loops.away_from(estimate.position):
            self._loops.move_to(estimate.position, estimate.velocity)
        return self._loops

    def _is_late(self) -> bool:
        return self.vehicle.kernel.now() - self._last_step_ns > self.RESTART_AFTER

    def _substeps(self) -> int:
        now = self.vehicle.kernel.now()
        steps = round(to_seconds(now - self._last_step_ns) / SUBSTEP)
        self._last_step_ns += from_seconds(steps * SUBSTEP)
        return steps


class Killed(FlightManoeuvre):
    """KILL: motors off."""

    def step(self) -> None:
        """Idle: motors cannot run in this mode."""
        self.vehicle.drive(IDLE)


class FailsafeDescent(FlightManoeuvre):
    """FAILSAFE: level, drifting with the wind, at FAILSAFE_DESCENT_SPEED; v6.2 keeps its height."""

    def step(self) -> None:
        """Command the descent."""
        speed = self.vehicle.parameters["FAILSAFE_DESCENT_SPEED"]
        self.landing = speed > 0.0
        tuning = self.vehicle.tuning
        self.vehicle.drive(
            Setpoint(Control.CLIMB, climb=-speed, speed_down=max(0.1, speed), accel_z=tuning.accel_z)
        )


class FlyPlan(Guidance):
    """NAV: fly what the flight plan demands."""

    def enter(self) -> None:
        """Keep the present heading."""
        state_of(self.vehicle).navigation.heading = self.vehicle.estimate.attitude[2]

    @property
    def demand(self) -> PlanDemand:
        """Present demand of the flight plan."""
        return state_of(self.vehicle).navigation.demand

    def takeoff_requested(self) -> bool:
        """Return whether the plan climbs or flies above the vehicle."""
        demand = self.demand
        if demand.vertical is Vertical.CLIMB:
            return demand.climb > 0.0
        here = state_of(self.vehicle).navigation.position
        return demand.vertical is Vertical.ALTITUDE and demand.target[2] > here[2] + LIFT_OFF_M

    def step(self) -> None:
        """Command the demand."""
        demand = self.demand
        self.landing = demand.vertical is Vertical.CLIMB and demand.climb < 0.0
        self.target = None if demand.vertical is Vertical.THROTTLE else enu_to_ned(demand.goal)
        if demand.vertical is Vertical.THROTTLE:
            self.vehicle.drive(IDLE)
            return
        climbs = demand.vertical is Vertical.CLIMB
        north, east, down = enu_to_ned(demand.target)
        self.fly_loops(
            (north, east),
            -demand.climb if climbs else down,
            plane_is_velocity=False,
            down_is_velocity=climbs,
            yaw=state_of(self.vehicle).navigation.heading,
        )


class FlyHome(FlyPlan):
    """HOME: fly to the waypoint HOME at its height and stay there."""

    def enter(self) -> None:
        """Fly straight to HOME."""
        super().enter()
        state_of(self.vehicle).navigation.fly_home()


class Direct(Stabilize):
    """ATTITUDE_DIRECT: sticks command lean angles, yaw rate and thrust."""

    def thrust(self, throttle: float) -> float:
        """Return the thrust of the stick without a mapping."""
        return throttle


class ClimbByStick(AltitudeHold):
    """ATTITUDE_RC_CLIMB: sticks command lean angles and yaw rate.

    Version 6.2 does not move the vertical reference in this mode: it stays at the height and climb rate at
    which the mode began, whatever the throttle says, unless RC_CLIMB_BY_THROTTLE is set.
    """

    def __init__(self, vehicle: AutopilotVehicle) -> None:
        super().__init__(vehicle)
        self._kept_height = self._kept_rate = 0.0

    def enter(self) -> None:
        """Take the present height and climb rate as reference."""
        estimate = self.vehicle.estimate
        self._kept_height = -estimate.position[2]
        self._kept_rate = 0.0 if self.vehicle.landed else -estimate.velocity[2]

    def climb(self, throttle: float) -> float:
        """Return the climb rate [m/s]."""
        if self.vehicle.parameters["RC_CLIMB_BY_THROTTLE"]:
            return super().climb(throttle)
        below = self._kept_height + self.vehicle.estimate.position[2]
        return self._kept_rate + HEIGHT_GAIN / CLIMB_GAIN * below


class HoldHeight(AltitudeHold):
    """ATTITUDE_Z_HOLD: sticks command lean angles and yaw rate; the height is held."""

    def climb(self, throttle: float) -> float:
        """Return 0: the throttle stick commands no climb."""
        return 0.0


class HoverHold(ManualFlight):
    """HOVER_Z_HOLD: hold the position; the sticks command the yaw rate only."""

    def __init__(self, vehicle: AutopilotVehicle) -> None:
        super().__init__(vehicle)
        self._place: Vector = (0.0, 0.0, 0.0)

    def enter(self) -> None:
        """Hold the present position."""
        self._place = self.vehicle.estimate.position

    def step(self) -> None:
        """Command position and yaw rate."""
        tuning = self.vehicle.tuning
        self.vehicle.drive(
            Setpoint(
                Control.POSITION,
                position=self._place,
                yaw_rate=self.pilot.yaw * tuning.pilot_yaw_rate,
                speed=tuning.speed,
                accel=tuning.accel,
                accel_z=tuning.accel_z,
                tilt=tuning.tilt,
            )
        )


OFFSET_PLANE, BODY, OFFSET_HEIGHT, OFFSET_YAW = 1 << 0, 1 << 1, 1 << 2, 1 << 3
VELOCITY_PLANE, VELOCITY_HEIGHT, YAW_RATE = 1 << 5, 1 << 6, 1 << 7
"""Flags of GUIDED_SETPOINT_NED."""


@dataclass(frozen=True)
class GuidedSetpoint:
    """Set-point of GUIDED: north, east, down [m or m/s] and yaw clockwise [rad or rad/s]."""

    north: float
    east: float
    down: float
    yaw: float
    plane_is_velocity: bool = False
    height_is_velocity: bool = False
    yaw_is_rate: bool = False


class GuidedMode(Guidance):
    """GUIDED: hold the last set-point; at first position and heading where the mode was chosen.

    The original's guidance runs with motors off, too: starting them changes neither set-point nor reference.
    """

    def __init__(self, vehicle: AutopilotVehicle) -> None:
        super().__init__(vehicle)
        estimate = vehicle.estimate
        self._hold(GuidedSetpoint(*estimate.position, estimate.attitude[2]))

    def _rest(self) -> None:
        """Move the vertical reference through a time without steps."""
        before = self._loops
        if before is None or not self._is_late():
            return
        steps = min(self._substeps(), RESTS_FOR)
        wanted, by_climb = self._setpoint.down, self._setpoint.height_is_velocity
        self._loops = None
        self._moved_loops().height.rest(before.height, -wanted, self._limits(), steps, by_climb=by_climb)

    def _hold(self, setpoint: GuidedSetpoint) -> None:
        self._rest()
        self._setpoint = setpoint
        plane = setpoint.plane_is_velocity
        self.target = None if plane else (setpoint.north, setpoint.east, self._target_down())

    def _target_down(self) -> float:
        return self._position[2] if self._setpoint.height_is_velocity else self._setpoint.down

    @property
    def _position(self) -> Vector:
        return self.vehicle.estimate.position

    def takeoff_requested(self) -> bool:
        """Return whether the set-point is not below the vehicle: with motors on it lifts off by itself."""
        setpoint = self._setpoint
        if setpoint.height_is_velocity:
            return setpoint.down < SINKING_M_S
        return setpoint.down < self._position[2] + BELOW_M

    def follow(self, flags: int, values: Vector, yaw: float) -> None:
        """Apply GUIDED_SETPOINT_NED.

        Offsets count from the present position, in body axes where flagged. Without a local frame they are
        ignored, axis by axis.

        Args:
            flags: Flags of the message.
            values: North, east, down as the flags define them [m or m/s].
            yaw: Heading, offset or rate, clockwise [rad or rad/s].
        """
        north, east, down = (as_obeyed(value) for value in values)
        setpoint = self._height(self._plane(flags, north, east), flags, down)
        self._hold(self._turned(setpoint, flags, yaw) if isfinite(yaw) else setpoint)
        if self.vehicle.armed:
            self.vehicle.run_manoeuvre()

    def _plane(self, flags: int, x: float, y: float) -> GuidedSetpoint:
        now = self._setpoint
        if flags & BODY:
            heading = self.vehicle.estimate.attitude[2]
            x, y = turn_clockwise((x, y), heading)
        if flags & VELOCITY_PLANE:
            return replace(now, north=x, east=y, plane_is_velocity=True)
        if flags & (OFFSET_PLANE | BODY):
            if not self.vehicle.estimate.position_ok:
                return now
            here = self._position
            x, y = here[0] + x, here[1] + y
        return replace(now, north=x, east=y, plane_is_velocity=False)

    def _height(self, now: GuidedSetpoint, flags: int, z: float) -> GuidedSetpoint:
        if flags & VELOCITY_HEIGHT:
            return replace(now, down=z, height_is_velocity=True)
        if flags & OFFSET_HEIGHT:
            if not self.vehicle.estimate.position_ok:
                return now
            z += self._position[2]
        return replace(now, down=z, height_is_velocity=False)

    def _turned(self, now: GuidedSetpoint, flags: int, yaw: float) -> GuidedSetpoint:
        if flags & YAW_RATE:
            return replace(now, yaw=yaw, yaw_is_rate=True)
        if flags & OFFSET_YAW:
            yaw += self.vehicle.estimate.attitude[2]
        return replace(now, yaw=wrap(yaw), yaw_is_rate=False)

    def step(self) -> None:
        """Command the set-point."""
        self._rest()
        wanted = self._setpoint
        self.fly_loops(
            (wanted.north, wanted.east),
            wanted.down,
            plane_is_velocity=wanted.plane_is_velocity,
            down_is_velocity=wanted.height_is_velocity,
            yaw=None if wanted.yaw_is_rate else wanted.yaw,
            yaw_rate=wanted.yaw if wanted.yaw_is_rate else None,
        )

    def carrot(self) -> tuple[Vector, float]:
        """Return the target point, north-east-down [m], and the heading [rad], for telemetry."""
        wanted, here = self._setpoint, self.vehicle.estimate
        plane = here.position[:2] if wanted.plane_is_velocity else (wanted.north, wanted.east)
        return (*plane, self._target_down()), here.attitude[2] if wanted.yaw_is_rate else wanted.yaw

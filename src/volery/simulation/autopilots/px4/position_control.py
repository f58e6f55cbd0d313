"""PX4's multicopter position control, and how the flight stack follows it.

As in PX4 1.14, a trajectory moves straight towards a point (``trajectory``), and loops on the position and
velocity that EKF2 states follow it (``airframe_loops``, ``estimate_error``). They fly the airframe that was
recorded, SIH's quadrotor, and the flight stack follows that airframe.
"""

from __future__ import annotations

from array import array
from collections.abc import Sequence
from math import dist, hypot, inf, nan, radians, remainder, sqrt, tau
from typing import Any, Final, NamedTuple, cast

import numpy as np

from volery.base.elementary import tan
from volery.base.frames import Vector
from volery.base.time import Ns, from_seconds
from volery.kernel.api import Action
from volery.simulation.autopilots.flight_stack.flight import Control, Setpoint
from volery.simulation.autopilots.px4.airframe_loops import DRAG, FIRST_VARIANCE, HOVER
from volery.simulation.autopilots.px4.estimate_error import start_errors
from volery.simulation.autopilots.px4.heading_loop import DAMPING, FASTEST_TURN, INERTIA
from volery.simulation.autopilots.px4.loop_state import (
    A_ACCEL,
    A_FLOWN,
    A_GROUNDED,
    A_HEADING,
    A_HOVER,
    A_INTEGRAL,
    A_MOVING,
    A_POSITION,
    A_RAMP,
    A_THRUST,
    A_TURN,
    A_VELOCITY,
    A_YAWING,
    DIRECT,
    E_POSITION,
    E_RATE,
    E_STATES,
    E_VELOCITY,
    G_JERK,
    GRAVITY,
    I_NOISY,
    I_POSITION,
    I_SPEED,
    I_TASK,
    I_YAW,
    LOOP_COLUMNS,
    REST,
    SINK,
    SUBSTEP,
    T_ACCEL,
    T_POSITION,
    T_VELOCITY,
    T_YAW,
    TO_POINT,
)
from volery.simulation.autopilots.px4.loop_step import fly_px4_loops
from volery.simulation.autopilots.vehicle_state import IDLE, AutopilotVehicle
from volery.simulation.world.body_specs import Multirotor

FOLLOW_LEAD = 0.25
"""Time by which the flight stack is behind a set velocity [s], of which the shaping of the velocity is
``FOLLOW_ACCEL`` / ``FOLLOW_JERK`` and its attitude loop the rest; measured on the five-line mission."""

FOLLOW_GAIN = 0.5 / FOLLOW_LEAD
"""Gain on the distance of flight stack and airframe [1/s]: the magnitude optimum of an integrator behind that
lag. The flight stack stays within 3 cm in the mean and 17 cm at most in the plane."""

TURN_LEAD, TURN_GAIN, TARGET_GAIN = 0.25, 4.0, 4.0
"""Time by which the flight stack's turn is behind a set rate [s], half a manoeuvre's step included; gain on
the distance of both headings; gain of its attitude loop on its heading target, which the rate would count
twice [1/s]. The swing past turns of 28 to 160 degrees is within 10 per cent of the airframe's; the heading
within 0.4 degrees in the mean on the five-line mission, and within 7 degrees at the begin of a turn."""

FOLLOW_ACCEL, FOLLOW_JERK, FASTEST = 12.0, 100.0, 25.0
"""Limits of the flight stack [m/s^2, m/s^3, m/s]; the loops limit the motion."""

RESTART_AFTER = from_seconds(0.5)
"""Time without a step after which the loops start anew."""

ELSEWHERE = 3.0
"""Distance of vehicle and loops from which the loops start anew [m]: far more than in flight, less than what
a vehicle without the thrust to climb loses in a few seconds."""

STEP: Final[Ns] = from_seconds(SUBSTEP)

ALIGNED_AFTER, SETTLED_AFTER = from_seconds(6.5), from_seconds(66.5)
"""Times after the boot at which EKF2 has aligned its heading, as logged of 51 starts, and from which on its
variances hardly change any more."""

SETTLING = 10**9
"""Number of the first of the substeps before the first flight, in which the errors of the estimate grow. The
noise of a step follows from its number, so no other step has these."""

STRETCH = 1.2
"""Share of the automatic modes' descent that the loops may fly to correct a height."""

LANDED_THRUST = 0.158
"""Thrust below which a vehicle may be landed: a tenth of the way from MPC_THR_MIN to MPC_THR_HOVER."""

TOUCHES_FROM = 0.3
"""Distance of the airframe of the loops below the vehicle from which the vehicle stands on the ground [m]:
more than it is behind in flight. PX4 commands neither lean nor thrust after a ground contact."""

MOVES_FROM = 0.25
"""Vertical speed from which a vehicle is not on the ground for the landed detector, LNDMC_Z_VEL_MAX [m/s]."""

FIRST_SINK = 0.7
"""Downward velocity with which the trajectory of a take-off begins [m/s], as ``FlightTaskAuto`` sets it."""


class Cruise(NamedTuple):
    """Limits of a trajectory: speeds in the plane, up and down [m/s], acceleration of a climb [m/s^2]."""

    speed: float
    up: float
    down: float
    lift: float
    at_vehicle: bool = False
    """Whether the trajectory keeps the vehicle's height, as in a take-off: only its climb is followed."""


class Wanted(NamedTuple):
    """What the loops control, north, east, down [m, m/s, m/s^2]; NaN: not given."""

    position: Vector
    velocity: Vector
    accel: Vector


def gains_of(vehicle: AutopilotVehicle, automatic: bool) -> tuple[float, ...]:
    """Return limits and gains of the loops, in the order of the columns from ``G_JERK`` on.

    Args:
        vehicle: The vehicle.
        automatic: Whether a trajectory is followed, as in the automatic modes.
    """
    p = vehicle.parameters
    return (
        p["MPC_JERK_AUTO"],
        p["MPC_ACC_HOR"],
        p["MPC_XY_ERR_MAX"],
        p["MPC_ACC_DOWN_MAX"],
        *_by_axis(p["MPC_XY_P"], p["MPC_Z_P"]),
        *_by_axis(p["MPC_XY_VEL_P_ACC"], p["MPC_Z_VEL_P_ACC"]),
        *_by_axis(p["MPC_XY_VEL_I_ACC"], p["MPC_Z_VEL_I_ACC"]),
        *_by_axis(p["MPC_XY_VEL_D_ACC"], p["MPC_Z_VEL_D_ACC"]),
        tan(vehicle.tuning.tilt) * GRAVITY,
        vehicle.tuning.speed,
        vehicle.tuning.speed_up,
        max(vehicle.tuning.speed_down, STRETCH * p["MPC_Z_V_AUTO_DN"] if automatic else 0.0),
        p["MPC_TKO_RAMP_T"],
        p["MPC_THR_HOVER"],
        radians(max(0.0, p["MPC_YAWRAUTO_MAX"])),
        *airframe_of(vehicle),
    )


def airframe_of(vehicle: AutopilotVehicle) -> Vector:
    """Return linear drag over mass [1/s], quadratic drag over mass [1/m] and hover thrust of the airframe."""
    spec = vehicle.flight.spec
    if not isinstance(spec, Multirotor) or not spec.frame:
        return DRAG, 0.0, HOVER
    mass = vehicle.flight.mass
    hover = spec.hover_throttle * sqrt(mass / (spec.mass + spec.payload))
    return spec.drag_linear / mass, spec.drag_quadratic / mass, min(1.0, hover)


def settling(uptime: Ns) -> tuple[int, int]:
    """Return the bounds of the substeps for which EKF2 has run before a first flight.

    Args:
        uptime: Time since the boot [ns].
    """
    run = min(uptime, SETTLED_AFTER) - ALIGNED_AFTER
    return SETTLING, SETTLING + max(0, run) // STEP


def _by_axis(plane: float, height: float) -> Vector:
    return plane, plane, height


def _write(row: memoryview[float], column: int, values: Sequence[float]) -> None:
    row[column : column + len(values)] = memoryview(array("d", values))


class PositionLoops:
    """Trajectory and loops of one vehicle; they outlast changes between the modes that use them."""

    def __init__(self, vehicle: AutopilotVehicle) -> None:
        self._vehicle = vehicle
        self._noisy = vehicle.flight.spec.sensors == "sih"
        """Whether the loops fly after the noise of gyroscope and accelerometer. That of the other sets is at
        most a fortieth of SIH's, and left out."""
        self._state = np.zeros(LOOP_COLUMNS)
        self._row = cast("memoryview[float]", memoryview(cast("Any", self._state)))
        self._span = np.zeros(2, dtype=np.int64)
        self._advance: Action = fly_px4_loops.bind(self._state, vehicle.flight.keys, self._span)
        """Machine code that advances the state over the span. It is compiled here, before time passes: who
        commands a served vehicle would take the pause of a later compilation for a lost link."""
        self._started = False
        """Whether the loops have flown once."""
        self._tuned: tuple[int, bool, float] | None = None
        """Number of parameter changes, whether a trajectory was followed, and the mass, when the gains were
        written."""
        self._trajectory = False
        """Whether the trajectory is where the vehicle is."""
        self._last: Ns = -RESTART_AFTER - 1

    @property
    def lifts_off(self) -> bool:
        """Whether the thrust on the ground is more than PX4's landed detector takes for a landed vehicle."""
        return self._row[A_GROUNDED] > 0.0 and self._row[A_THRUST + 2] < GRAVITY * (
            1.0 - LANDED_THRUST / airframe_of(self._vehicle)[2]
        )

    def fly_to(self, point: Vector, cruise: Cruise, yaw: float | None = None) -> None:
        """Move the trajectory towards a point and follow it.

        Args:
            point: North, east, down [m]; down may be infinite: it sinks at ``cruise.down``.
            cruise: Limits of speed.
            yaw: Heading [rad]; ``None``: keep it.
        """
        row = self._row
        steps = self._begin()
        if not self._trajectory:
            self._trajectory = True
            row[T_POSITION : T_POSITION + 3] = row[A_POSITION : A_POSITION + 3]
            row[T_VELOCITY : T_VELOCITY + 3] = row[A_VELOCITY : A_VELOCITY + 3]
            _write(row, T_ACCEL, (0.0, 0.0, 0.0))
            _write(row, T_YAW, (row[A_HEADING], 0.0))
            if row[A_GROUNDED]:
                _write(row, T_VELOCITY, (0.0, 0.0, FIRST_SINK))
        row[I_TASK] = SINK if point[2] == inf else TO_POINT
        _write(row, I_POSITION, point)
        _write(row, I_SPEED, cruise)
        self._fly(steps, yaw, None)

    def fly(self, wanted: Wanted, yaw: float | None, yaw_rate: float | None) -> None:
        """Control position and velocity directly, without a trajectory.

        Args:
            wanted: What is controlled.
            yaw: Heading [rad], or
            yaw_rate: turn rate [rad/s]; neither: do not turn.
        """
        steps = self._begin()
        self._trajectory = False
        self._row[I_TASK] = DIRECT
        _write(self._row, I_POSITION, (*wanted.position, *wanted.velocity, *wanted.accel))
        self._fly(steps, yaw, yaw_rate)

    def rest(self) -> None:
        """Advance the error of the estimate while the vehicle stands and the motors run."""
        row = self._row
        if not self._started or not self._noisy:
            return
        if row[I_TASK] != REST:
            row[I_TASK] = REST
            for column in (A_FLOWN, A_ACCEL, A_THRUST):
                _write(row, column, (0.0, 0.0, 0.0))
        self._run((self._vehicle.kernel.now() - self._last + STEP // 2) // STEP)
        self._vehicle.flight.estimate_error = list(row[E_POSITION : E_POSITION + 6])

    @property
    def seems_to_move(self) -> bool:
        """Whether a vehicle that rests climbs or sinks by its stated velocity and by its stated height."""
        row = self._row
        if row[I_TASK] != REST or self._vehicle.kernel.now() - self._last > RESTART_AFTER:
            return False
        return min(abs(row[E_VELOCITY + 2]), abs(row[E_RATE + 2])) >= MOVES_FROM

    def _begin(self) -> int:
        """Return the substeps to now; the loops start anew where the vehicle is elsewhere, or stood."""
        vehicle, row, now = self._vehicle, self._row, self._vehicle.kernel.now()
        here = vehicle.estimate.position
        late = now - self._last > RESTART_AFTER or row[I_TASK] == REST
        if late or dist(row[A_POSITION : A_POSITION + 3], here) > ELSEWHERE:
            self._restart(here, vehicle.estimate.velocity)
            self._last = now
        return (now - self._last + STEP // 2) // STEP

    def _restart(self, here: Vector, velocity: Vector) -> None:
        """Put the airframe where the vehicle is, on the ground without thrust."""
        row, grounded = self._row, self._vehicle.estimate.landed
        self._trajectory, self._tuned = False, None
        self._state[: E_STATES if self._started else LOOP_COLUMNS] = 0.0
        row[A_HEADING] = self._vehicle.estimate.attitude[2]
        if not self._started:
            self._started = True
            start_errors(self._state)
            if self._noisy:
                self._settle()
        _write(row, A_POSITION, here)
        _write(row, A_VELOCITY, velocity)
        if grounded:
            _write(row, A_THRUST, (0.0, 0.0, GRAVITY))
        else:
            flown = [v - error for v, error in zip(velocity, row[E_VELOCITY : E_VELOCITY + 3], strict=True)]
            linear, square, _ = airframe_of(self._vehicle)
            drag = linear + square * hypot(*flown)
            thrust = [drag * v for v in flown]
            _write(row, A_MOVING, velocity)
            _write(row, A_FLOWN, flown)
            _write(row, A_THRUST, thrust)
            _write(row, A_INTEGRAL, thrust)
        row[A_GROUNDED], row[A_RAMP] = float(grounded), float(not grounded)
        hover = airframe_of(self._vehicle)[2]
        _write(row, A_HOVER, (hover, hover, FIRST_VARIANCE))

    def _settle(self) -> None:
        """Let the errors of the estimate become those of a filter that has run since the boot."""
        row = self._row
        row[I_TASK], row[I_NOISY] = REST, 1.0
        self._span[:] = settling(self._vehicle.uptime())
        self._advance()

    def _fly(self, steps: int, yaw: float | None, yaw_rate: float | None) -> None:
        """Advance to now, and let the flight stack follow the airframe of the loops."""
        vehicle, row = self._vehicle, self._row
        estimate = vehicle.estimate
        here, velocity = estimate.position, estimate.velocity
        _write(row, I_YAW, (nan if yaw is None else yaw, nan if yaw_rate is None else yaw_rate))
        row[I_NOISY] = float(self._noisy)
        tuned = vehicle.parameters.changes, row[I_TASK] != DIRECT, vehicle.flight.mass
        if tuned != self._tuned:
            self._tuned = tuned
            _write(row, G_JERK, gains_of(vehicle, tuned[1]))
        self._run(steps)
        if self._noisy:
            here, velocity = self._without_error(here, 0), self._without_error(velocity, 3)
        touches = row[A_POSITION + 2] - row[E_POSITION + 2] - here[2] > TOUCHES_FROM
        if self._noisy:
            self._state_error(here, velocity, touches)
        if row[A_GROUNDED] or (touches and estimate.landed):
            vehicle.drive(IDLE)
            return
        vehicle.drive(
            Setpoint(
                Control.VELOCITY,
                velocity=(
                    0.0 if touches else self._follow(0, here[0]),
                    0.0 if touches else self._follow(1, here[1]),
                    self._follow(2, here[2]),
                ),
                yaw_rate=self._follow_heading(),
                speed=FASTEST,
                speed_up=FASTEST,
                speed_down=FASTEST,
                accel=FOLLOW_ACCEL,
                accel_z=FOLLOW_ACCEL,
                tilt=vehicle.tuning.tilt,
                jerk=FOLLOW_JERK,
            )
        )

    def _run(self, steps: int) -> None:
        """Advance the state by that many substeps."""
        first = self._last // STEP
        self._span[0], self._span[1] = first, first + steps
        self._advance()
        self._last += steps * STEP

    def _without_error(self, stated: Vector, first: int) -> Vector:
        """Return a vector of the estimate as the inner loops have it."""
        north, east, down = self._vehicle.flight.estimate_error[first : first + 3] or (0.0, 0.0, 0.0)
        return stated[0] - north, stated[1] - east, stated[2] - down

    def _state_error(self, here: Vector, velocity: Vector, touches: bool) -> None:
        """Let the estimate be what EKF2 states: in the plane of the airframe of the loops, while it flies."""
        row = self._row
        error = list(row[E_POSITION : E_POSITION + 6])
        if not touches:
            for axis in (0, 1):
                error[axis] = row[A_POSITION + axis] - here[axis]
                error[3 + axis] = row[A_VELOCITY + axis] - velocity[axis]
        self._vehicle.flight.estimate_error = error

    def _follow(self, axis: int, here: float) -> float:
        """Return the velocity with which the flight stack follows the airframe along an axis [m/s]."""
        row = self._row
        moving, place = row[A_MOVING + axis], row[A_POSITION + axis]
        if self._noisy:
            moving, place = moving - row[E_RATE + axis], place - row[E_POSITION + axis]
        return moving + FOLLOW_LEAD * row[A_ACCEL + axis] + FOLLOW_GAIN * (place - here)

    def _follow_heading(self) -> float:
        """Return the rate of turn with which the flight stack follows the airframe's heading [rad/s]."""
        row, estimate = self._row, self._vehicle.estimate
        heading = estimate.attitude[2]
        behind = remainder(row[A_HEADING] - heading, tau)
        ahead = remainder(estimate.target_attitude[2] - heading, tau)
        accel = (row[A_YAWING + 1] - DAMPING * row[A_YAWING]) / INERTIA
        rate = row[A_TURN] + TURN_LEAD * accel + TURN_GAIN * behind - TARGET_GAIN * ahead
        return max(-FASTEST_TURN, min(FASTEST_TURN, rate))

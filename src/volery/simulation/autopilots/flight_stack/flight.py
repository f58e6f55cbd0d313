"""The one compiled step: all bodies with their estimators and inner loops, composed by import.

A grid step is: guidance (every fifth step) and attitude loops on what is believed at step k, then the body's
law from k to k + 1 and the samples due there, then the estimate of k + 1.

One vehicle's handle on the world: look at what its estimator believes, drive its inner loops. No stepping.

Positions are metres north, east, down about the estimator's origin, along the axes of the world's frame;
angles radians; ``Flight.to_ned`` and ``Flight.from_ned`` are the way to and from degrees and metres AMSL.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from math import isfinite
from pathlib import Path

import numpy as np
from numba import njit
from numpy.typing import NDArray

from volery.base.errors import UsageError
from volery.base.frames import LocalFrame, Vector
from volery.base.time import Ns
from volery.simulation.autopilots.flight_stack.attitude_control import detect_landing, run_attitude_loops
from volery.simulation.autopilots.flight_stack.estimator import initialise_estimate, update_estimate
from volery.simulation.autopilots.flight_stack.flight_layout import (
    C_AIDED,
    C_CONTROL,
    FLIGHT,
    K_HOVER_THROTTLE,
    K_LANDED,
    K_MOTORS,
    K_POSITION,
    VISIBLE,
    Control,
)
from volery.simulation.autopilots.flight_stack.guidance import GUIDE_EVERY, guide_multirotor
from volery.simulation.autopilots.flight_stack.rover_guidance import guide_rover
from volery.simulation.autopilots.flight_stack.state_estimate import Airframe, Estimate, GpsFix
from volery.simulation.world.body_specs import BodySpec, Multirotor
from volery.simulation.world.body_step import digest_of, start_body, step_body, world_sources
from volery.simulation.world.environment_models import Terrain, Wind
from volery.simulation.world.sensors import Sigma, declared_sigma, sensor_suite
from volery.simulation.world.state_layout import (
    M_GYRO,
    MULTIROTOR,
    P_CELLS,
    P_KIND,
    S_AMPS,
    S_CHARGE,
    S_STARTED,
    SAMPLES_END,
    U_BARO_BLOCKED,
    U_GPS_BLOCKED,
    U_GPS_DRIFT,
    U_MAG_BLOCKED,
    U_MOTOR_HEALTH,
    W_THROTTLE,
    Advance,
    Array,
    Bodies,
)
from volery.simulation.world.world import STEP, Truth, World

_FIRST_HOVER = 0.35  # MOT_THST_HOVER's default


@njit(cache=False)
def _boot(row: Array) -> None:
    """What an autopilot believes before its first step."""
    row[K_HOVER_THROTTLE] = _FIRST_HOVER
    row[K_LANDED] = 1.0
    initialise_estimate(row)


@njit(cache=False)
def _control(row: Array, k: int) -> None:
    """From the belief at step *k* to motor commands."""
    due = k % GUIDE_EVERY == 0
    if row[P_KIND] != MULTIROTOR:
        if due:
            guide_rover(row)
        row[W_THROTTLE] = -row[K_MOTORS]
        row[W_THROTTLE + 1] = row[K_MOTORS + 1]
        return
    control = int(row[C_CONTROL])
    if due:
        guide_multirotor(row)
        detect_landing(row, control)
    run_attitude_loops(row, control)
    for i in range(4):
        row[W_THROTTLE + i] = row[K_MOTORS + i]


def _compose(sources: str) -> Advance:
    @njit(cache=True)
    def advance_flights(bodies: Bodies, goals: NDArray[np.int64]) -> None:
        if not sources:  # never so: its being named here makes the digest part of the cache's key
            return
        for body in range(goals.shape[0]):
            row = bodies.rows[body]
            if row[S_STARTED] == 0.0:
                start_body(bodies, body, row)
                _boot(row)
            while bodies.reached[body] < goals[body]:
                _control(row, bodies.reached[body])
                step_body(bodies, body, row)
                update_estimate(row, bodies.reached[body])

    compiled: Advance = advance_flights
    return compiled


advance_flights = _compose(digest_of([*world_sources(), *Path(__file__).parent.glob("*.py")]))
"""Advance each body to its goal step under the set-points in its inputs."""


__all__ = ["Control", "Estimate", "Flight", "GpsFix", "Setpoint", "make_world"]


@dataclass(frozen=True, slots=True)
class Setpoint:
    """What the inner loops are to hold until the next set-point. What a control does not use is ignored.

    ``position`` north, east, down about the estimator's origin [m]; ``velocity`` north, east, down [m/s];
    ``yaw`` clockwise from north [rad] or ``yaw_rate`` [rad/s], neither: hold the present heading (rover
    DRIVE: neither drives straight on); ``climb`` m/s up; ``throttle`` 0..1 (rover -1..1), ``steering`` -1..1,
    right positive. Limits: ``speed`` in the plane (rover DRIVE: the speed itself comes from ``velocity[0]``,
    forward), ``speed_up``, ``speed_down`` [m/s], ``accel`` in the plane, ``accel_z`` [m/s^2], ``tilt`` [rad],
    ``jerk`` [m/s^3] (its default is ArduPilot's PSC_JERK_XY and PSC_JERK_Z).
    """

    control: Control
    position: Vector = (0.0, 0.0, 0.0)
    velocity: Vector = (0.0, 0.0, 0.0)
    roll: float = 0.0
    pitch: float = 0.0
    yaw: float | None = None
    yaw_rate: float | None = None
    throttle: float = 0.0
    steering: float = 0.0
    climb: float = 0.0
    speed: float = 10.0
    speed_up: float = 2.5
    speed_down: float = 1.5
    accel: float = 2.5
    accel_z: float = 1.0
    tilt: float = 0.5235987755982988
    jerk: float = 5.0

    def row(self) -> tuple[float, ...]:
        """The values in the order of the command columns, from ``C_CONTROL`` on."""
        if self.yaw is not None and self.yaw_rate is not None:
            raise UsageError("a set-point with both a yaw and a yaw rate; give one of them or neither")
        turning = 1.0 if self.yaw is not None else 2.0 if self.yaw_rate is not None else 0.0
        return (
            float(self.control),
            *self.position,
            *self.velocity,
            self.roll,
            self.pitch,
            self.yaw or 0.0,
            self.yaw_rate or 0.0,
            turning,
            self.throttle,
            self.steering,
            self.climb,
            self.speed,
            self.speed_up,
            self.speed_down,
            self.accel,
            self.accel_z,
            self.tilt,
            self.jerk,
        )


class Flight:
    """One vehicle: look and drive. Whatever it is told takes effect at the next grid step."""

    def __init__(self, world: World, body: int) -> None:
        self._world = world
        self._body = body
        self.spec: BodySpec = world.specs[body]
        self.frame: LocalFrame = world.frame
        self.flying = isinstance(self.spec, Multirotor)
        """True for a multirotor, False for a rover."""
        self.capacity_as = self.spec.battery.capacity_ah * 3600.0
        """Of the full battery [A s]."""
        self._airframe = Airframe(self.frame, self.flying, self.capacity_as, sensor_suite(self.spec.sensors))
        self._seen: Estimate | None = None

    def look(self) -> Estimate:
        """What the autopilot knows now; the same object until the next grid step."""
        step = self._world.advance_to_now(self._body)
        time = step * STEP
        seen = self._seen
        if seen is not None and seen.time == time:
            return seen
        row = self._world.arrays.rows[self._body]
        rows = (
            row[K_POSITION:VISIBLE].tolist(),
            row[M_GYRO:SAMPLES_END].tolist(),
            row[S_CHARGE : S_AMPS + 1].tolist(),
        )
        self._seen = Estimate(self._airframe, time, rows)
        return self._seen

    def drive(self, setpoint: Setpoint) -> None:
        """Hold *setpoint* from the next grid step on. None expires here: time-outs are the modes'.

        Raises ``UsageError`` for a value that is not a finite number.
        """
        row = setpoint.row()
        if not isfinite(sum(row)):
            raise UsageError(f"a set-point must be of finite numbers: {setpoint}")
        self._world.set_input(self._body, C_CONTROL, *row)

    def truth(self) -> Truth:
        """The true state, for judges and recorders; an autopilot must not ask."""
        return self._world.truth(self._body)

    def set_origin(self) -> None:
        """Use satellites from now on; the origin is where the receiver says the vehicle is then."""
        self._world.set_input(self._body, C_AIDED, 1.0)

    def forget_origin(self) -> None:
        """Stop using satellites, as after a restart of the autopilot."""
        self._world.set_input(self._body, C_AIDED, 0.0)

    def payload_power(self, watts: float) -> None:
        """Drain of the on-board computers from the next grid step on [W]."""
        self._world.payload_power(self._body, watts)

    def block_gps(self, blocked: bool = True) -> None:
        """Fault: the receiver sees no satellites (or sees them again)."""
        self._world.set_input(self._body, U_GPS_BLOCKED, float(blocked))

    def drift_gps(self, north: float, east: float) -> None:
        """Fault: let the position that the receiver reports drift from now on.

        Args:
            north: Speed of the drift to the north [m/s]; 0 for both ends the drift and its offset.
            east: Speed of the drift to the east [m/s].
        """
        self._world.set_input(self._body, U_GPS_DRIFT, north, east, float(self._world.advance_to_now(self._body)))

    def short_cells(self, cells: int) -> None:
        """Fault: `cells` of the battery give no voltage (0: all do again). One cell always stays alive."""
        self._world.set_input(self._body, P_CELLS, float(max(1, self.spec.battery.cells - cells)))

    def block_barometer(self, blocked: bool = True) -> None:
        """Fault: the barometer is stuck."""
        self._world.set_input(self._body, U_BARO_BLOCKED, float(blocked))

    def block_compass(self, blocked: bool = True) -> None:
        """Fault: the magnetometer is stuck."""
        self._world.set_input(self._body, U_MAG_BLOCKED, float(blocked))

    def drain_battery(self, left: float) -> None:
        """Fault: from the next grid step on only the fraction *left* of the charge is in it."""
        if not 0.0 <= left <= 1.0:
            raise UsageError(f"a battery with {left} left: 0 to 1")
        self._world.set_input(self._body, S_CHARGE, self.capacity_as * (1.0 - left))

    def weaken_motor(self, motor: int, health: float) -> None:
        """Fault: *motor* (0 to 3) gives only the fraction *health* of its thrust."""
        if not 0 <= motor <= 3 or not 0.0 <= health <= 1.0:
            raise UsageError(f"motor {motor} at {health}: motors are 0 to 3, health 0 to 1")
        self._world.set_input(self._body, U_MOTOR_HEALTH + motor, health)

    def to_ned(self, latitude: float, longitude: float, amsl: float) -> Vector:
        """Degrees and metres AMSL to north, east, down about the estimator's present origin."""
        north, east, down = self.frame.to_ned(latitude, longitude, amsl)
        origin = self.look().origin_ned
        return north - origin[0], east - origin[1], down - origin[2]

    def from_ned(self, ned: Vector) -> Vector:
        """North, east, down about the estimator's present origin to degrees and metres AMSL."""
        origin = self.look().origin_ned
        return self.frame.from_ned((ned[0] + origin[0], ned[1] + origin[1], ned[2] + origin[2]))

    @property
    def sigma(self) -> Sigma:
        """The declared standard deviations of the vehicle's sensors [m]."""
        return declared_sigma(self.spec.sensors)


def make_world(
    now: Callable[[], Ns],
    specs: Sequence[BodySpec],
    *,
    seed: int,
    frame: LocalFrame,
    wind: Wind | None = None,
    terrain: Terrain | None = None,
) -> tuple[World, list[Flight]]:
    """A world in which each body has an estimator and inner loops, and a handle on each, in the order of
    *specs*.
    """
    world = World(
        now,
        specs,
        advance=advance_flights,
        seed=seed,
        frame=frame,
        wind=wind,
        terrain=terrain,
        columns=FLIGHT,
    )
    return world, [Flight(world, body) for body in range(len(specs))]

"""Handle on one vehicle of the world: its estimate and its set-points.

Positions are metres north, east, down about the estimator's origin, along the axes of the world's frame;
angles are radians. ``Flight.to_ned`` and ``Flight.from_ned`` convert from and to degrees and metres AMSL.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import KW_ONLY, dataclass
from math import isfinite, nan
from typing import Any, cast

import numpy as np
from numpy.typing import NDArray

from volery.base.errors import UsageError
from volery.base.frames import LocalFrame, Vector
from volery.base.time import Ns
from volery.simulation.autopilots.flight_stack.control_loops import thrust_share
from volery.simulation.autopilots.flight_stack.flight_state import (
    BY_POSES,
    C_AIDED,
    C_COASTS,
    C_CONTROL,
    C_FULL_VOLTS,
    C_GPS_GATE,
    C_HOVER_KEPT,
    C_POSE_COUNT,
    C_STICK,
    C_YAW_P,
    EXTERNAL,
    FLIGHT,
    HOLD_HEADING,
    K_BARO_OFFSET,
    K_HOVER_THROTTLE,
    K_ORIGIN,
    K_POSITION,
    K_RATE_TUNING,
    K_STORED_HOVER,
    YAW_ANGLE,
    YAW_ANGLE_AND_RATE,
    YAW_RATE,
    Control,
    Estimate,
    EstimateConstants,
    GpsFix,
)
from volery.simulation.autopilots.flight_stack.flight_step import advance_flights
from volery.simulation.world.arithmetic import FIRMWARE_STREAM, gaussian
from volery.simulation.world.body_specs import BodySpec, Multirotor
from volery.simulation.world.dynamics import cell_voltage
from volery.simulation.world.environment_models import Wind
from volery.simulation.world.scene import Scene
from volery.simulation.world.sensors import Measurement, SampledSensor, Sigma, declared_sigma, sensor_suite
from volery.simulation.world.state_layout import (
    P_CELLS,
    P_MASS,
    P_RESISTANCE,
    S_CHARGE,
    S_GUST,
    S_VELOCITY,
    U_ACCEL_NOISE,
    U_ACCEL_OFFSET,
    U_BARO_BLOCKED,
    U_GPS_BLOCKED,
    U_GPS_DRIFT,
    U_GPS_OFFSET,
    U_GYRO_NOISE,
    U_GYRO_OFFSET,
    U_MAG_BLOCKED,
    U_MAG_TURN,
    U_MOTOR_HEALTH,
    U_PUSH,
    U_RC_BLOCKED,
    U_THROTTLE,
    U_WIND,
    W_ROTATION,
)
from volery.simulation.world.world import STEP, Attendant, BodyImpact, MotionSource, Truth, World

__all__ = ["Control", "Estimate", "Flight", "GpsFix", "Setpoint", "make_world"]

_NOWHERE: Vector = (nan, nan, nan)
_FAR = 1e6  # [m] beyond which a point is placed on an unrolled map
TURNINGS = {
    (False, False): HOLD_HEADING,
    (True, False): YAW_ANGLE,
    (False, True): YAW_RATE,
    (True, True): YAW_ANGLE_AND_RATE,
}
"""How the heading is commanded, by whether there are a yaw and a yaw rate."""


@dataclass(slots=True)
class Setpoint:
    """Set-point of the inner loops, in force until the next one.

    Fields that the control does not use are ignored. It is never changed: ``dataclasses.replace`` returns
    another one.

    Args:
        control: The quantities to control.
        position: North, east, down about the estimator's origin [m].
        velocity: North, east, down [m/s]; rover DRIVE: the first is the forward speed.
        roll: Roll angle [rad]; likewise ``pitch``.
        yaw: Yaw angle, clockwise from north [rad]; None for none.
        yaw_rate: Yaw rate [rad/s]; None for none. With neither it holds the heading (rover: straight on).
        throttle: Collective 0..1; rover -1..1.
        steering: Rover: -1..1, right positive.
        climb: Climb rate [m/s].
        speed: Limit of horizontal speed [m/s].
        speed_up: Limit of climb rate [m/s].
        speed_down: Limit of descent rate [m/s].
        accel: Limit of horizontal acceleration [m/s^2].
        accel_z: Limit of vertical acceleration [m/s^2].
        tilt: Limit of tilt [rad].
        jerk: Limit of the target's jerk [m/s^3]; the default is ArduPilot's PSC_JERK_XY and PSC_JERK_Z.
        straight: POSITION: whether a point is approached along a straight line; else height and horizontal
            position have their own limits.
        roll_rate: RATE: body rate [rad/s]; likewise ``pitch_rate``, and ``yaw_rate``.
        motor: MOTOR: number of the motor that turns alone, from 0; ``throttle`` is its command.
    """

    control: Control
    _: KW_ONLY
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
    straight: bool = False
    motor: int = 0
    roll_rate: float = 0.0
    pitch_rate: float = 0.0

    def row(self) -> tuple[float, ...]:
        """Return the values in the order of the command columns, from ``C_CONTROL`` on."""
        turning = TURNINGS[self.yaw is not None, self.yaw_rate is not None]
        north, east, down = self.position
        v_north, v_east, v_down = self.velocity
        return (
            float(self.control),
            north,
            east,
            down,
            v_north,
            v_east,
            v_down,
            self.roll,
            self.pitch,
            self.yaw or 0.0,
            self.yaw_rate or 0.0,
            float(turning),
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
            float(self.straight),
            float(self.motor),
            self.roll_rate,
            self.pitch_rate,
        )


LEAST_RESISTANCE = 1e-6
"""Resistance of a battery whose voltage does not depend on its load [ohm]."""


class Flight:
    """One vehicle: read its estimate and give set-points. Every change has effect from the next grid step."""

    def __init__(self, world: World, body: int) -> None:
        self._world = world
        self._now = world.now
        self._body = body
        self.spec: BodySpec = world.specs[body]
        self.frame: LocalFrame = world.frame
        self.flying = isinstance(self.spec, Multirotor)
        """True for a multirotor, False for a rover."""
        self.capacity_as = self.spec.battery.capacity_ah * 3600.0
        """Capacity of the battery [A s]."""
        self.rotors = len(self.spec.rotors) if isinstance(self.spec, Multirotor) else 0
        """Number of rotors; 0 for a rover."""
        self._airframe = EstimateConstants(
            self.frame, self.flying, self.rotors, self.capacity_as, sensor_suite(self.spec.sensors)
        )
        self._row = cast("memoryview[float]", memoryview(cast("Any", world.arrays.rows[body])))
        self._latest: Estimate | None = None
        self._driven: tuple[float, ...] = ()
        self._converted: tuple[Vector, Vector] = (_NOWHERE, _NOWHERE)
        self.gripper: int | None = None
        """What the gripper has done last: 0 released, 1 grabbed; ``None``: nothing yet."""
        self._poses = 0
        self.estimate_error: Sequence[float] = ()
        """Error that the firmware's own estimator adds to the estimate, or empty: of the position [m], then
        of the velocity [m/s], each north, east, down. The inner loops fly without it."""

    def estimate(self) -> Estimate:
        """Return the estimate now; the same object until the next grid step."""
        latest, now = self._latest, self._now()
        if latest is not None and latest.time <= now < latest.time + STEP:
            return latest
        time = self._world.advance_to_now(self._body) * STEP
        row = self._row.tobytes()
        if self.estimate_error:
            values = np.frombuffer(row).copy()
            values[K_POSITION : K_POSITION + len(self.estimate_error)] += self.estimate_error
            row = values.tobytes()
        latest = self._latest = Estimate(self._airframe, time, row)
        return latest

    def drive(self, setpoint: Setpoint) -> None:
        """Control to *setpoint* from the next grid step on, unless it is in force already.

        Set-points never expire; time-outs belong to the modes.

        Raises:
            UsageError: A value is not a finite number.
        """
        row = setpoint.row()
        if not isfinite(sum(row)):
            raise UsageError(f"a set-point must be of finite numbers: {setpoint}")
        if row != self._driven:
            self._driven = row
            self._world.set_input(self._body, C_CONTROL, *row)

    def drive_motors(self, commands: Sequence[float]) -> None:
        """Turn the motors by *commands* from the next grid step on; the flight stack rests for ever.

        For an autopilot with an estimator and loops of its own. It reads the samples of its sensors from
        ``estimate``, in which all that a flight stack estimates stands still.

        Args:
            commands: Of each motor, 0..1, in the order of the body's rotors; of a rover steering, right
                positive, and throttle, both -1..1.

        Raises:
            UsageError: There are more or fewer motors, or a command is outside its range.

        Example: ``flight.drive_motors([flight.spec.hover_throttle] * flight.rotors)``
        """
        count, least = (self.rotors, 0.0) if self.flying else (2, -1.0)
        if len(commands) != count or not all(least <= command <= 1.0 for command in commands):
            raise UsageError(f"motor commands {[*commands]}: give {count}, each from {least:g} to 1")
        if not self._driven or self._driven[0] != EXTERNAL:
            self._driven = (float(EXTERNAL),)
            self._world.set_input(self._body, C_CONTROL, *self._driven)
        inputs = commands if self.flying else (-commands[0], commands[1])
        self._world.set_input(self._body, U_THROTTLE, *inputs)

    def move_by(self, source: MotionSource | None) -> None:
        """See ``World.move_by``."""
        self._world.move_by(self._body, source)

    def attend(self, attendant: Attendant | None) -> None:
        """Let *attendant* give the motor commands and read ``row`` at grid steps of its own: a firmware.

        ``drive_motors`` comes before it, and says what the motors do until its first call.
        """
        self._world.attend(self._body, attendant)

    def command_motors(self, commands: Sequence[float]) -> None:
        """Set the motor commands of the step that the body is about to take; for its attendant.

        Args:
            commands: Of each motor, 0..1; of a rover steering, left positive, and throttle, both -1..1.
        """
        self._world.command_motors(self._body, commands)

    def advance(self) -> None:
        """Let the body and its attendant reach the present."""
        self._world.advance_to_now(self._body)

    @property
    def row(self) -> Sequence[float]:
        """The state row of the grid step that the body has reached, by the columns of ``state_layout``."""
        return self._row

    @property
    def mass(self) -> float:
        """Mass with what the vehicle carries now [kg]."""
        return self._row[P_MASS]

    def carry(self, load: float) -> None:
        """Carry a mass beside the vehicle's own [kg], at its centre, in place of what it carried before."""
        own = self.spec.mass + (self.spec.payload if isinstance(self.spec, Multirotor) else 0.0)
        self._world.set_input(self._body, P_MASS, own + load)

    def last_collision(self) -> BodyImpact | None:
        """Return how the body last hit something that stands in the world; ``None``: it has not."""
        return self._world.last_collision(self._body)

    def added_sensors(self) -> tuple[SampledSensor, ...]:
        """Return the sensors that are added to the body; read them by ``measurement``."""
        return self._world.added_sensors(self._body)

    def truth(self) -> Truth:
        """Return the true state, for recorders and requirements; an autopilot must not use it."""
        return self._world.truth(self._body)

    def air_from_ahead(self) -> float:
        """Return the true speed of the air along the forward axis [m/s], for a pitot tube."""
        self._world.advance_to_now(self._body)
        row, speed = self._world.arrays.rows[self._body], 0.0
        for axis in range(3):
            air = float(row[U_WIND + axis]) + float(row[S_GUST + axis])
            speed += float(row[W_ROTATION + 3 * axis]) * (float(row[S_VELOCITY + axis]) - air)
        return speed

    def measurement(self, sensor: str) -> Measurement:
        """Return the last sample of a sensor that a package added to this vehicle.

        Raises:
            UsageError: The vehicle has no such sensor.
        """
        return self._world.measurement(self._body, sensor)

    @property
    def keys(self) -> NDArray[np.uint64]:
        """Key of the vehicle's noise, for machine code that draws from it."""
        return self._world.arrays.keys[self._body : self._body + 1]

    def draw(self, stream: int, number: int) -> float:
        """Return a draw of the firmware's own noise, of zero mean and unit variance.

        Args:
            stream: Number of the stream; those of the body's sensors are others.
            number: Counter of the draw.
        """
        with np.errstate(over="ignore"):  # hashes wrap around
            return float(gaussian(self._world.arrays.keys[self._body], FIRMWARE_STREAM + stream, number))

    def set_origin(self) -> None:
        """Use satellites from now on; the origin becomes the receiver's position."""
        self._world.set_input(self._body, C_AIDED, 1.0)

    def forget_origin(self) -> None:
        """Stop using satellites, as after a restart of the autopilot."""
        self._airframe.place(None)
        self._world.set_input(self._body, C_AIDED, 0.0)

    def use_gps(self, used: bool) -> None:
        """Stop using satellites, or use them again with the origin as it was; the receiver works on.

        They are the measure of degrees then: an origin that a user has placed does not count any more.
        """
        if used:
            self._airframe.place(None)
        self._world.set_input(self._body, C_AIDED, 2.0 if used else 0.0)

    def use_poses(self) -> None:
        """Use external poses in place of satellites, with the origin as it is."""
        self._world.set_input(self._body, C_AIDED, float(BY_POSES))

    def use_pose(
        self, use: int, off: Vector, turn: float, sigmas: tuple[float, float], *, by_heading: bool
    ) -> None:
        """Use an external pose while these are in use.

        Args:
            use: ``REFUSE``, ``FUSE`` or ``RESET`` of ``flight_state``: note it, fuse it, or begin with it.
            off: The pose less the estimate at its time, north, east, down [m].
            turn: Likewise its yaw, clockwise [rad].
            sigmas: Its standard deviations, horizontal and vertical [m]; vertical 0: the barometer counts.
            by_heading: Whether its yaw counts in place of the compass.
        """
        self._poses += 1
        pose = (float(self._poses), float(use), *off, turn, *sigmas, float(by_heading))
        self._world.set_input(self._body, C_POSE_COUNT, *pose)

    def place_origin(self, latitude: float, longitude: float, amsl: float) -> None:
        """Set the estimator's origin, about which the position stays what it is: before it is aided."""
        estimate = self.estimate()
        _, _, before = estimate.origin_ned
        self._airframe.place(LocalFrame(latitude, longitude, amsl))
        self._world.set_input(self._body, K_ORIGIN, 0.0, 0.0, 0.0)
        self._world.set_input(self._body, K_POSITION, *estimate.position)
        self._world.set_input(self._body, K_BARO_OFFSET, self._row[K_BARO_OFFSET] - before)
        self._latest, self._converted = None, (_NOWHERE, _NOWHERE)

    def set_gps_gate(self, gate: float, sigma: float, radius: float) -> None:
        """Let the estimator refuse fixes that are far from its position, as EKF3 of ArduPilot does.

        Args:
            gate: Distance from which a fix is refused, in standard deviations; 0: all are fused.
            sigma: Least standard deviation of a fix in that comparison [m].
            radius: Uncertainty of the position once it is reset to a fix, twice over [m].
        """
        self._world.set_input(self._body, C_GPS_GATE, gate, sigma, radius)

    def set_yaw_loop(self, gain: float, integral: float, corner: float) -> None:
        """Filter the error of the yaw rate, as ArduCopter does.

        Args:
            gain: Share of full thrust per rad/s; 0: another loop, without a filter.
            integral: Integral gain.
            corner: Corner frequency of the filter [rad/s].
        """
        self._world.set_input(self._body, C_YAW_P, gain, integral, corner)

    def set_brakes(self, *, on: bool) -> None:
        """Let a rover brake by its motor, or only coast."""
        self._world.set_input(self._body, C_COASTS, float(not on))

    def set_hover_throttle(self, throttle: float) -> None:
        """Set the stored collective in hover, 0..1; the loops of climb and height learn their own."""
        self._world.set_input(self._body, K_STORED_HOVER, throttle)

    def set_thrust_voltage(self, full: float, least: float) -> None:
        """Keep thrust independent of the battery's voltage.

        Args:
            full: Voltage for which thrust is computed [V]; 0: the voltage is ignored.
            least: Least voltage that counts [V].
        """
        self._world.set_input(self._body, C_FULL_VOLTS, full, least)

    def set_hover_learning(self, *, on: bool) -> None:
        """Adapt the stored collective in flight, or keep it."""
        self._world.set_input(self._body, C_HOVER_KEPT, float(not on))

    def mix_steering(self, steering: float, share: float) -> None:
        """Add a pilot's steering to that of a rover's controls.

        Args:
            steering: Steering of the pilot, -1..1, right positive.
            share: Share by which the controls' own steering is reduced, 0..1; 0: nothing is mixed.
        """
        self._world.set_input(self._body, C_STICK, steering, share)

    def payload_power(self, watts: float) -> None:
        """Set the power of the on-board computers [W]."""
        self._world.payload_power(self._body, watts)

    def block_gps(self, blocked: bool = True) -> None:
        """Inject or clear a fault: the receiver sees no satellites."""
        self._world.set_input(self._body, U_GPS_BLOCKED, float(blocked))

    def drift_gps(self, north: float, east: float) -> None:
        """Inject or clear a fault: the position that the receiver reports drifts from now on.

        Args:
            north: Speed of the drift to the north [m/s]; 0 for both ends the drift and its offset.
            east: Speed of the drift to the east [m/s].
        """
        self._world.set_input(
            self._body, U_GPS_DRIFT, north, east, float(self._world.advance_to_now(self._body))
        )

    def offset_gps(self, north: float, east: float) -> None:
        """Inject or clear a fault: the position that the receiver reports is off by so much [m]."""
        self._world.set_input(self._body, U_GPS_OFFSET, north, east)

    def set_wind(self, north: float, east: float) -> None:
        """Set the mean velocity of the air about this vehicle, towards the north and the east [m/s]."""
        self._world.set_input(self._body, U_WIND, east, north, 0.0)

    def push(self, forward: float, left: float, up: float) -> None:
        """Inject or clear a fault: a force from outside accelerates a multirotor along its axes [m/s^2]."""
        self._world.set_input(self._body, U_PUSH, forward, left, up)

    def short_cells(self, cells: int) -> None:
        """Inject or clear a fault: *cells* of the battery give no voltage; at least one always does."""
        self._world.set_input(self._body, P_CELLS, float(max(1, self.spec.battery.cells - cells)))

    def set_voltage(self, volts: float | None) -> None:
        """Inject or clear a fault: the battery has *volts*, whatever it gives; ``None``: its own again."""
        battery = self.spec.battery
        cells, resistance = float(battery.cells), battery.resistance_ohm
        if volts is not None:
            cells = max(0.0, volts) / cell_voltage(self.estimate().battery_left)
            resistance = LEAST_RESISTANCE
        self._world.set_input(self._body, P_CELLS, cells)
        self._world.set_input(self._body, P_RESISTANCE, resistance)

    def block_barometer(self, blocked: bool = True) -> None:
        """Inject or clear a fault: the barometer gives no new samples."""
        self._world.set_input(self._body, U_BARO_BLOCKED, float(blocked))

    def block_compass(self, blocked: bool = True) -> None:
        """Inject or clear a fault: the magnetometer gives no new samples."""
        self._world.set_input(self._body, U_MAG_BLOCKED, float(blocked))

    def turn_compass(self, angle: float) -> None:
        """Inject or clear a fault: the magnetometer is turned by *angle* [rad], clockwise from above."""
        self._world.set_input(self._body, U_MAG_TURN, angle)

    def bias_inertial(self, gyro: float, accel: float) -> None:
        """Inject or clear a fault: each axis of gyroscope [rad/s] and accelerometer [m/s^2] is off."""
        self._world.set_input(self._body, U_GYRO_OFFSET, gyro)
        self._world.set_input(self._body, U_ACCEL_OFFSET, accel)

    def shake_inertial(self, gyro: float, accel: float) -> None:
        """Inject or clear a fault: white noise of the gyroscope [rad/s] and accelerometer [m/s^2] grows."""
        self._world.set_input(self._body, U_GYRO_NOISE, gyro)
        self._world.set_input(self._body, U_ACCEL_NOISE, accel)

    def block_transmitter(self, blocked: bool = True) -> None:
        """Inject or clear a fault: the receiver hears no transmitter."""
        self._world.set_input(self._body, U_RC_BLOCKED, float(blocked))

    @property
    def transmitter_blocked(self) -> bool:
        """Whether the receiver hears no transmitter."""
        return self._row[U_RC_BLOCKED] != 0.0

    def set_charge(self, left: float) -> None:
        """Set the fraction *left* of the battery's charge: a fault, charging, or another battery."""
        if not 0.0 <= left <= 1.0:
            raise UsageError(f"a battery with {left} left: 0 to 1")
        self._world.set_input(self._body, S_CHARGE, self.capacity_as * (1.0 - left))

    def weaken_motor(self, motor: int, health: float) -> None:
        """Inject a fault: a motor gives only a fraction of its thrust.

        Args:
            motor: Index of the motor, from 0.
            health: Fraction of the thrust, 0..1.

        Raises:
            UsageError: There is no such motor, or the fraction is outside its range.
        """
        if not 0 <= motor < self.rotors or not 0.0 <= health <= 1.0:
            raise UsageError(f"motor {motor} at {health}: motors are 0 to {self.rotors - 1}, health 0 to 1")
        self._world.set_input(self._body, U_MOTOR_HEALTH + motor, health)

    def to_ned(self, latitude: float, longitude: float, amsl: float) -> Vector:
        """Convert degrees and metres AMSL to north, east, down about the estimator's present origin [m]."""
        local = self._airframe.local
        north, east, down = local.to_ned(latitude, longitude, amsl)
        if max(abs(north), abs(east), abs(down)) > _FAR:
            north, east, down = local.to_ned_flat(latitude, longitude, amsl)
        origin = self.estimate().origin_ned
        return north - origin[0], east - origin[1], down - origin[2]

    def from_ned(self, ned: Vector) -> Vector:
        """Convert north, east, down about the estimator's present origin [m] to degrees and metres AMSL."""
        origin = self.estimate().origin_ned
        point = ned[0] + origin[0], ned[1] + origin[1], ned[2] + origin[2]
        if point != self._converted[0]:  # a target is reported again and again
            self._converted = point, self._airframe.local.from_ned(point)
        return self._converted[1]

    @property
    def sigma(self) -> Sigma:
        """Declared standard deviations of the vehicle's position sensors [m]."""
        return declared_sigma(self.spec.sensors)


def hover_collective(spec: Multirotor) -> float:
    """Return the collective 0..1 with which a multirotor hovers on a full battery."""
    return thrust_share(spec.hover_throttle)


def rate_tuning(spec: Multirotor) -> Vector:
    """Return the factors on the outputs of the rate loops, about forward, right and down.

    They make the loops of a body with another authority as fast as those of the usual one, and slower with
    slower rotors: as after an automatic tuning.
    """
    if not spec.frame:
        return 1.0, 1.0, 1.0
    usual = Multirotor()
    lag = usual.rotor_lag / spec.rotor_lag
    roll, pitch, yaw = (lag * its / own for its, own in zip(usual.authority, spec.authority, strict=True))
    return roll, pitch, yaw


def make_world(
    now: Callable[[], Ns],
    specs: Sequence[BodySpec],
    *,
    seed: int,
    frame: LocalFrame,
    wind: Wind | None = None,
    scene: Scene | None = None,
) -> tuple[World, list[Flight]]:
    """Return a world whose bodies have an estimator and inner loops, and a handle on each.

    Args:
        now: Returns the time [ns].
        specs: The bodies; the handles are in the same order.
        seed: Seed of all noise.
        frame: Local frame whose origin is the world's.
        wind: Wind; ``None``: still air.
        scene: The ground and what stands in the world; ``None``: level ground.
    """
    world = World(
        now,
        specs,
        advance=advance_flights,
        seed=seed,
        frame=frame,
        wind=wind,
        scene=scene,
        columns=FLIGHT,
    )
    for row, spec in zip(world.arrays.rows, specs, strict=True):
        if isinstance(spec, Multirotor):
            row[K_RATE_TUNING : K_RATE_TUNING + 3] = rate_tuning(spec)
            if spec.frame:
                row[K_HOVER_THROTTLE] = row[K_STORED_HOVER] = hover_collective(spec)
    return world, [Flight(world, body) for body in range(len(specs))]

"""One vehicle's handle on the world: look at what its estimator believes, drive its inner loops. No stepping.

Positions are metres north, east, down about the estimator's origin, along the axes of the world's frame;
angles radians; ``Flight.to_ned`` and ``Flight.from_ned`` are the way to and from degrees and metres AMSL.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property
from math import hypot, inf, isfinite

from volery.autopilots.simulated.flight_columns import (
    C_AIDED,
    C_CONTROL,
    FLIGHT,
    K_ACCEL,
    K_AIDED,
    K_ALIGNED,
    K_ATTITUDE,
    K_EULER,
    K_GPS_AGE,
    K_GPS_LEVEL,
    K_HEADING_ERROR,
    K_HOVER,
    K_LANDED,
    K_MOTORS,
    K_ORIGIN,
    K_POSITION,
    K_RATES,
    K_SPREAD,
    K_TARGET,
    K_TARGET_EULER,
    K_TARGET_VELOCITY,
    K_THROTTLE,
    K_VELOCITY,
    VISIBLE,
    Control,
)
from volery.autopilots.simulated.flight_step import advance_flights
from volery.base.errors import UsageError
from volery.base.frames import LocalFrame, Quaternion, Vector
from volery.base.time import Ns
from volery.world.atmosphere import pressure_at
from volery.world.columns import (
    M_ACCEL,
    M_BARO,
    M_GPS,
    M_GPS_COUNT,
    M_GPS_FIX,
    M_GPS_VELOCITY,
    M_GYRO,
    M_GYRO_BIAS,
    M_MAG,
    M_RANGE,
    S_AMPS,
    S_CHARGE,
    U_BARO_BLOCKED,
    U_GPS_BLOCKED,
    U_MAG_BLOCKED,
    U_MOTOR_HEALTH,
)
from volery.world.sensors import Sigma, declared_sigma, sensor_set
from volery.world.specs import BodySpec, Multirotor
from volery.world.terrain import Terrain
from volery.world.wind import Wind
from volery.world.world import STEP, Truth, World

__all__ = ["Control", "Estimate", "Flight", "GpsFix", "Setpoint", "make_world"]


@dataclass(frozen=True, slots=True)
class Setpoint:
    """What the inner loops are to hold until the next set-point. What a control does not use is ignored.

    ``position`` north, east, down about the estimator's origin [m]; ``velocity`` north, east, down [m/s];
    ``yaw`` clockwise from north [rad] or ``yaw_rate`` [rad/s], neither: hold the present heading (rover
    DRIVE: neither drives straight on); ``climb`` m/s up; ``throttle`` 0..1 (rover -1..1), ``steering`` -1..1,
    right positive. Limits: ``speed`` in the plane (rover DRIVE: the speed itself comes from ``velocity[0]``,
    forward), ``speed_up``, ``speed_down`` [m/s], ``accel`` in the plane, ``accel_z`` [m/s^2], ``tilt`` [rad].
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
        )


@dataclass(frozen=True, slots=True)
class GpsFix:
    """The receiver's last fix. Degrees, metres AMSL; velocity north, east, down m/s; ``fix_type`` as in
    MAVLink.

    ``h_acc`` and ``v_acc`` are the receiver's declared standard deviations [m], ``eph`` and ``epv`` dilutions
    of precision. Without a fix ``fix_type`` and ``satellites`` are 0 and the rest is stale.
    """

    fix_type: int
    latitude: float
    longitude: float
    amsl: float
    velocity: Vector
    h_acc: float
    v_acc: float
    speed_acc: float
    eph: float
    epv: float
    satellites: int
    count: int


class Estimate:
    """What one autopilot knows at one grid step: an immutable snapshot, converted only where asked."""

    __slots__ = ("__dict__", "_flight", "_memory", "_sensed", "_state", "time")

    def __init__(self, flight: Flight, time: Ns, rows: tuple[list[float], list[float], list[float]]) -> None:
        self._flight = flight
        self.time = time
        """Of the grid step whose state this is [ns]."""
        self._memory, self._sensed, self._state = rows

    def _one(self, column: int) -> float:
        return self._memory[column - K_POSITION]

    def _vector(self, column: int) -> Vector:
        at = column - K_POSITION
        row = self._memory
        return row[at], row[at + 1], row[at + 2]

    def _four(self, column: int) -> tuple[float, float, float, float]:
        at = column - K_POSITION
        row = self._memory
        return row[at], row[at + 1], row[at + 2], row[at + 3]

    def _sample(self, column: int) -> Vector:
        at = column - M_GYRO
        row = self._sensed
        return row[at], row[at + 1], row[at + 2]

    def _about_origin(self, column: int) -> Vector:
        north, east, down = self._vector(column)
        origin = self._vector(K_ORIGIN)
        return north - origin[0], east - origin[1], down - origin[2]

    @property
    def position(self) -> Vector:
        """North, east, down about the estimator's origin [m]."""
        return self._about_origin(K_POSITION)

    @cached_property
    def geodetic(self) -> Vector:
        """Estimated latitude, longitude [degrees] and metres AMSL."""
        return self._flight.frame.from_ned(self._vector(K_POSITION))

    @cached_property
    def origin(self) -> Vector:
        """Latitude, longitude and metres AMSL of the estimator's origin."""
        return self._flight.frame.from_ned(self._vector(K_ORIGIN))

    @property
    def velocity(self) -> Vector:
        """North, east, down [m/s]."""
        return self._vector(K_VELOCITY)

    @property
    def acceleration(self) -> Vector:
        """North, east, down, without gravity [m/s^2]."""
        return self._vector(K_ACCEL)

    @property
    def attitude(self) -> Vector:
        """Roll, pitch, yaw [rad]; yaw clockwise from north, in (-pi, pi]."""
        return self._vector(K_EULER)

    @property
    def quaternion(self) -> Quaternion:
        """Forward, right, down to north, east, down; (w, x, y, z)."""
        return self._four(K_ATTITUDE)

    @property
    def rates(self) -> Vector:
        """About forward, right, down, without the estimated gyro bias [rad/s]."""
        return self._vector(K_RATES)

    @property
    def attitude_ok(self) -> bool:
        """Tilt and heading are aligned."""
        return self._one(K_ALIGNED) > 0.5

    @property
    def position_ok(self) -> bool:
        """Position and velocity in the plane are aided by satellites, or were within the last ten seconds."""
        return self._one(K_AIDED) > 0.5 and self._one(K_GPS_AGE) < 10.0

    @property
    def gps_age(self) -> float:
        """Seconds since the estimator last used a fix."""
        return self._one(K_GPS_AGE)

    @property
    def spread(self) -> tuple[float, float, float, float]:
        """The estimator's own standard deviations: plane, height [m]; speed in the plane, up [m/s]."""
        return self._four(K_SPREAD)

    @property
    def heading_error(self) -> float:
        """Last difference of compass and estimate [rad]."""
        return self._one(K_HEADING_ERROR)

    @property
    def gps_innovation(self) -> float:
        """Last difference of fix and estimate in the plane, in standard deviations of it."""
        return self._one(K_GPS_LEVEL)

    @property
    def gyro(self) -> Vector:
        """Raw: forward, right, down [rad/s]."""
        return self._sample(M_GYRO)

    @property
    def accel(self) -> Vector:
        """Raw specific force: forward, right, down [m/s^2]; at rest (0, 0, -9.8)."""
        return self._sample(M_ACCEL)

    @property
    def mag(self) -> Vector:
        """Raw field: forward, right, down [gauss]."""
        return self._sample(M_MAG)

    @property
    def baro_altitude(self) -> float:
        """The barometer's height about the world's origin [m up]."""
        return self._sensed[M_BARO - M_GYRO]

    @property
    def pressure(self) -> float:
        """Absolute [hPa], by the standard atmosphere at the barometer's height AMSL."""
        return float(pressure_at(self._flight.frame.amsl + self._sensed[M_BARO - M_GYRO])) / 100.0

    @property
    def rangefinder(self) -> float | None:
        """Metres to the ground along the body's down axis; None out of range."""
        distance = self._sensed[M_RANGE - M_GYRO]
        return distance if distance >= 0.0 else None

    @cached_property
    def gps(self) -> GpsFix:
        """The last fix."""
        return self._flight.fix(self._sample(M_GPS), self._sample(M_GPS_VELOCITY), self._sensed)

    @property
    def battery_volts(self) -> float:
        """At the terminals [V]."""
        return self._state[2]

    @property
    def battery_amps(self) -> float:
        """Drawn [A]."""
        return self._state[3]

    @property
    def battery_used_mah(self) -> float:
        """Charge drawn since the pack was full [mAh]."""
        return self._state[0] / 3.6

    @property
    def battery_left(self) -> float:
        """Fraction of the capacity left, 0..1."""
        return max(0.0, 1.0 - self._state[0] / self._flight.capacity_as)

    @property
    def battery_energy_j(self) -> float:
        """Energy drawn at the terminals since the start [J]."""
        return self._state[1]

    @property
    def motors(self) -> tuple[float, float, float, float]:
        """Motor commands 0..1; rover: steering (right positive) and throttle -1..1, 0, 0."""
        return self._four(K_MOTORS)

    @property
    def motor_pwm(self) -> tuple[int, int, int, int]:
        """Motor outputs as pulse widths [us]: 1000 stopped to 2000 full. Rover: steering and throttle about
        1500.
        """
        if self._flight.flying:
            first, second, third, fourth = (round(1000.0 + 1000.0 * motor) for motor in self.motors)
            return first, second, third, fourth
        steering, throttle, _, _ = self.motors
        return round(1500.0 + 500.0 * steering), 0, round(1500.0 + 500.0 * throttle), 0

    @property
    def throttle(self) -> float:
        """Collective, 0..1 (rover: -1..1)."""
        return self._one(K_THROTTLE)

    @property
    def hover_throttle(self) -> float:
        """Collective that is learnt to carry the weight."""
        return self._one(K_HOVER)

    @property
    def landed(self) -> bool:
        """The landed detector is sure that it stands on the ground."""
        return self._one(K_LANDED) > 0.5

    @property
    def target(self) -> Vector:
        """Where the shaped target is: north, east, down about the estimator's origin [m]."""
        return self._about_origin(K_TARGET)

    @property
    def target_velocity(self) -> Vector:
        """Velocity of the shaped target: north, east, down [m/s]."""
        return self._vector(K_TARGET_VELOCITY)

    @property
    def target_attitude(self) -> Vector:
        """Roll, pitch, yaw that the attitude loop is asked for [rad]."""
        return self._vector(K_TARGET_EULER)


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
        self._seen: Estimate | None = None

    def look(self) -> Estimate:
        """What the autopilot knows now; the same object until the next grid step."""
        step = self._world.look(self._body)
        time = step * STEP
        seen = self._seen
        if seen is not None and seen.time == time:
            return seen
        row = self._world.arrays.rows[self._body]
        rows = (
            row[K_POSITION:VISIBLE].tolist(),
            row[M_GYRO:M_GYRO_BIAS].tolist(),
            row[S_CHARGE : S_AMPS + 1].tolist(),
        )
        self._seen = Estimate(self, time, rows)
        return self._seen

    def drive(self, setpoint: Setpoint) -> None:
        """Hold *setpoint* from the next grid step on. None expires here: time-outs are the modes'.

        Raises ``UsageError`` for a value that is not a finite number.
        """
        row = setpoint.row()
        if not isfinite(sum(row)):
            raise UsageError(f"a set-point must be of finite numbers: {setpoint}")
        self._world.drive(self._body, C_CONTROL, *row)

    def truth(self) -> Truth:
        """The true state, for judges and recorders; an autopilot must not ask."""
        return self._world.truth(self._body)

    def set_origin(self) -> None:
        """Use satellites from now on; the origin is where the receiver says the vehicle is then."""
        self._world.drive(self._body, C_AIDED, 1.0)

    def forget_origin(self) -> None:
        """Stop using satellites, as after a restart of the autopilot."""
        self._world.drive(self._body, C_AIDED, 0.0)

    def payload_power(self, watts: float) -> None:
        """Drain of the on-board computers from the next grid step on [W]."""
        self._world.payload_power(self._body, watts)

    def block_gps(self, blocked: bool = True) -> None:
        """Fault: the receiver sees no satellites (or sees them again)."""
        self._world.drive(self._body, U_GPS_BLOCKED, float(blocked))

    def block_barometer(self, blocked: bool = True) -> None:
        """Fault: the barometer is stuck."""
        self._world.drive(self._body, U_BARO_BLOCKED, float(blocked))

    def block_compass(self, blocked: bool = True) -> None:
        """Fault: the magnetometer is stuck."""
        self._world.drive(self._body, U_MAG_BLOCKED, float(blocked))

    def weaken_motor(self, motor: int, health: float) -> None:
        """Fault: *motor* (0 to 3) gives only the fraction *health* of its thrust."""
        if not 0 <= motor <= 3 or not 0.0 <= health <= 1.0:
            raise UsageError(f"motor {motor} at {health}: motors are 0 to 3, health 0 to 1")
        self._world.drive(self._body, U_MOTOR_HEALTH + motor, health)

    def to_ned(self, latitude: float, longitude: float, amsl: float) -> Vector:
        """Degrees and metres AMSL to north, east, down about the estimator's present origin."""
        north, east, down = self.frame.to_ned(latitude, longitude, amsl)
        origin = self.look()._vector(K_ORIGIN)
        return north - origin[0], east - origin[1], down - origin[2]

    def from_ned(self, ned: Vector) -> Vector:
        """North, east, down about the estimator's present origin to degrees and metres AMSL."""
        origin = self.look()._vector(K_ORIGIN)
        return self.frame.from_ned((ned[0] + origin[0], ned[1] + origin[1], ned[2] + origin[2]))

    @property
    def sigma(self) -> Sigma:
        """The declared standard deviations of the vehicle's sensors [m]."""
        return declared_sigma(self.spec.sensors)

    def fix(self, ned: Vector, velocity: Vector, sensed: Sequence[float]) -> GpsFix:
        """A receiver's sample (about the world's origin) as a fix."""
        sensors = sensor_set(self.spec.sensors)
        latitude, longitude, amsl = self.frame.from_ned(ned)
        kind = int(sensed[M_GPS_FIX - M_GYRO])
        level, height, speed = sensors.noises[4:7]
        return GpsFix(
            fix_type=kind,
            latitude=latitude,
            longitude=longitude,
            amsl=amsl,
            velocity=velocity,
            h_acc=hypot(level.white, level.slow) if kind else inf,
            v_acc=hypot(height.white, height.slow) if kind else inf,
            speed_acc=hypot(speed.white, speed.slow) if kind else inf,
            eph=1.21 if kind else inf,
            epv=2.0 if kind else inf,
            satellites=10 if kind else 0,
            count=int(sensed[M_GPS_COUNT - M_GYRO]),
        )


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

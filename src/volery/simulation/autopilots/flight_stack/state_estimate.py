"""Estimate of one autopilot at one grid step: a read-only view of its part of the state row."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from math import inf, sqrt

from volery.base.frames import LocalFrame, Quaternion, Vector
from volery.base.time import Ns
from volery.simulation.autopilots.flight_stack.flight_layout import (
    K_ACCEL,
    K_AIDED,
    K_ALIGNED,
    K_ATTITUDE,
    K_EULER,
    K_GPS_AGE,
    K_GPS_INNOVATION,
    K_HEADING_ERROR,
    K_HOVER_THROTTLE,
    K_LANDED,
    K_MOTORS,
    K_ORIGIN,
    K_POSITION,
    K_RATES,
    K_SIGMA,
    K_TARGET,
    K_TARGET_EULER,
    K_TARGET_VELOCITY,
    K_THROTTLE,
    K_VELOCITY,
)
from volery.simulation.world.environment_models import pressure_at
from volery.simulation.world.sensors import SensorSuite
from volery.simulation.world.state_layout import (
    M_ACCEL,
    M_BARO,
    M_GPS,
    M_GPS_COUNT,
    M_GPS_FIX,
    M_GPS_VELOCITY,
    M_GYRO,
    M_MAG,
    M_RANGE,
    S_AMPS,
    S_CHARGE,
    S_ENERGY,
    S_VOLTS,
)


@dataclass(frozen=True, slots=True)
class GpsFix:
    """The receiver's last fix; without one, ``fix_type`` and ``satellites`` are 0 and the rest is outdated.

    Args:
        fix_type: MAVLink GPS_FIX_TYPE.
        latitude: Latitude [degrees].
        longitude: Longitude [degrees].
        amsl: Height above mean sea level [m].
        velocity: North, east, down [m/s].
        h_acc: Declared standard deviation of each horizontal axis [m]; likewise ``v_acc`` of the height.
        speed_acc: Declared standard deviation of the velocity [m/s].
        eph: Horizontal dilution of precision; likewise ``epv`` vertical.
        satellites: Number of satellites in use.
        count: Number of fixes so far.
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


@dataclass(frozen=True, slots=True)
class Airframe:
    """Constants of a vehicle that are needed to read its estimate."""

    frame: LocalFrame
    flying: bool
    capacity_as: float
    sensors: SensorSuite


def _fix_of(about: Airframe, sensed: Sequence[float]) -> GpsFix:
    """Return the receiver's sample as a fix; *sensed* are the measurements from ``M_GYRO`` on."""
    north, east, down, *velocity = sensed[M_GPS - M_GYRO : M_GPS_VELOCITY - M_GYRO + 3]
    latitude, longitude, amsl = about.frame.from_ned((north, east, down))
    kind = int(sensed[M_GPS_FIX - M_GYRO])
    receiver = about.sensors.gps
    return GpsFix(
        fix_type=kind,
        latitude=latitude,
        longitude=longitude,
        amsl=amsl,
        velocity=(velocity[0], velocity[1], velocity[2]),
        h_acc=sqrt(receiver.horizontal.variance) if kind else inf,
        v_acc=sqrt(receiver.vertical.variance) if kind else inf,
        speed_acc=sqrt(receiver.velocity.variance) if kind else inf,
        eph=1.21 if kind else inf,
        epv=2.0 if kind else inf,
        satellites=10 if kind else 0,
        count=int(sensed[M_GPS_COUNT - M_GYRO]),
    )


class Estimate:
    """Estimate and measurements of one autopilot at one grid step; immutable, converted on access.

    Args:
        about: Constants of the vehicle.
        time: Time of the grid step [ns].
        rows: Columns from K_POSITION to VISIBLE, from M_GYRO to SAMPLES_END, and from S_CHARGE to S_AMPS.
    """

    __slots__ = ("__dict__", "_about", "_memory", "_sensed", "_state", "time")

    def __init__(self, about: Airframe, time: Ns, rows: tuple[list[float], list[float], list[float]]) -> None:
        self._about = about
        self.time = time
        self._memory, self._sensed, self._state = rows

    def _value(self, column: int) -> float:
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
        """Position north, east, down about the estimator's origin [m]."""
        return self._about_origin(K_POSITION)

    @cached_property
    def geodetic(self) -> Vector:
        """Estimated latitude and longitude [degrees] and height AMSL [m]."""
        return self._about.frame.from_ned(self._vector(K_POSITION))

    @cached_property
    def origin(self) -> Vector:
        """Latitude and longitude [degrees] and height AMSL [m] of the estimator's origin."""
        return self._about.frame.from_ned(self._vector(K_ORIGIN))

    @property
    def origin_ned(self) -> Vector:
        """The estimator's origin, north, east, down about the world's [m]."""
        return self._vector(K_ORIGIN)

    @property
    def velocity(self) -> Vector:
        """Velocity north, east, down [m/s]."""
        return self._vector(K_VELOCITY)

    @property
    def acceleration(self) -> Vector:
        """Acceleration without gravity, north, east, down [m/s^2]."""
        return self._vector(K_ACCEL)

    @property
    def attitude(self) -> Vector:
        """Roll, pitch, yaw [rad]; yaw clockwise from north, in (-pi, pi]."""
        return self._vector(K_EULER)

    @property
    def quaternion(self) -> Quaternion:
        """Quaternion (w, x, y, z) from forward, right, down to north, east, down."""
        return self._four(K_ATTITUDE)

    @property
    def rates(self) -> Vector:
        """Body rates about forward, right, down, less the estimated gyro bias [rad/s]."""
        return self._vector(K_RATES)

    @property
    def attitude_ok(self) -> bool:
        """Whether tilt and heading are initialised."""
        return self._value(K_ALIGNED) > 0.5

    @property
    def position_ok(self) -> bool:
        """Whether horizontal position and velocity are aided by satellites, or were within ten seconds."""
        return self._value(K_AIDED) > 0.5 and self._value(K_GPS_AGE) < 10.0

    @property
    def gps_age(self) -> float:
        """Time since the estimator last fused a fix [s]."""
        return self._value(K_GPS_AGE)

    @property
    def sigmas(self) -> tuple[float, float, float, float]:
        """Standard deviations: horizontal, vertical position [m]; the same of velocity [m/s]."""
        return self._four(K_SIGMA)

    @property
    def heading_error(self) -> float:
        """Last magnetometer heading less the estimate [rad]."""
        return self._value(K_HEADING_ERROR)

    @property
    def gps_innovation(self) -> float:
        """Last horizontal innovation of a fix, in its standard deviations."""
        return self._value(K_GPS_INNOVATION)

    @property
    def gyro(self) -> Vector:
        """Gyroscope sample, forward, right, down [rad/s]."""
        return self._sample(M_GYRO)

    @property
    def accel(self) -> Vector:
        """Accelerometer sample, forward, right, down [m/s^2]; at rest (0, 0, -9.8)."""
        return self._sample(M_ACCEL)

    @property
    def mag(self) -> Vector:
        """Magnetometer sample, forward, right, down [gauss]."""
        return self._sample(M_MAG)

    @property
    def baro_altitude(self) -> float:
        """Barometer sample as height about the world's origin [m up]."""
        return self._sensed[M_BARO - M_GYRO]

    @property
    def pressure(self) -> float:
        """Absolute pressure [hPa], by the standard atmosphere at the barometer's height AMSL."""
        return float(pressure_at(self._about.frame.amsl + self._sensed[M_BARO - M_GYRO])) / 100.0

    @property
    def rangefinder(self) -> float | None:
        """Distance to the ground along the body's down axis [m]; None out of range."""
        distance = self._sensed[M_RANGE - M_GYRO]
        return distance if distance >= 0.0 else None

    @cached_property
    def gps(self) -> GpsFix:
        """The receiver's last fix."""
        return _fix_of(self._about, self._sensed)

    @property
    def battery_volts(self) -> float:
        """Battery voltage at the terminals [V]."""
        return self._state[S_VOLTS - S_CHARGE]

    @property
    def battery_amps(self) -> float:
        """Battery current [A]."""
        return self._state[S_AMPS - S_CHARGE]

    @property
    def battery_used_mah(self) -> float:
        """Charge drawn since the battery was full [mAh]."""
        return self._state[0] / 3.6

    @property
    def battery_left(self) -> float:
        """Fraction of the battery charge left, 0..1."""
        return max(0.0, 1.0 - self._state[0] / self._about.capacity_as)

    @property
    def battery_energy_j(self) -> float:
        """Energy drawn from the battery since the start [J]."""
        return self._state[S_ENERGY - S_CHARGE]

    @property
    def motors(self) -> tuple[float, float, float, float]:
        """Motor commands 0..1; rover: steering (right positive) and throttle -1..1, 0, 0."""
        return self._four(K_MOTORS)

    @property
    def motor_pwm(self) -> tuple[int, int, int, int]:
        """Motor outputs as pulse widths [us], 1000 to 2000; rover: steering and throttle about 1500."""
        if self._about.flying:
            first, second, third, fourth = (round(1000.0 + 1000.0 * motor) for motor in self.motors)
            return first, second, third, fourth
        steering, throttle, _, _ = self.motors
        return round(1500.0 + 500.0 * steering), 0, round(1500.0 + 500.0 * throttle), 0

    @property
    def throttle(self) -> float:
        """Collective 0..1; rover: throttle -1..1."""
        return self._value(K_THROTTLE)

    @property
    def hover_throttle(self) -> float:
        """Learnt collective in hover, 0..1."""
        return self._value(K_HOVER_THROTTLE)

    @property
    def landed(self) -> bool:
        """Whether the landed detector reports landed."""
        return self._value(K_LANDED) > 0.5

    @property
    def target(self) -> Vector:
        """Shaped target position, north, east, down about the estimator's origin [m]."""
        return self._about_origin(K_TARGET)

    @property
    def target_velocity(self) -> Vector:
        """Velocity of the shaped target, north, east, down [m/s]."""
        return self._vector(K_TARGET_VELOCITY)

    @property
    def target_attitude(self) -> Vector:
        """Roll, pitch, yaw target of the attitude loop [rad]."""
        return self._vector(K_TARGET_EULER)

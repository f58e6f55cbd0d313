"""What one autopilot knows at one grid step, and how its rows of numbers are read."""

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


@dataclass(frozen=True, slots=True)
class Airframe:
    """What stays the same about a vehicle and is needed to read its estimate."""

    frame: LocalFrame
    flying: bool
    capacity_as: float
    sensors: SensorSuite


def _fix_of(about: Airframe, sensed: Sequence[float]) -> GpsFix:
    """The receiver's sample among *sensed*, a row of measurements from ``M_GYRO`` on, as a fix."""
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
    """What one autopilot knows at one grid step: an immutable snapshot, converted only where asked."""

    __slots__ = ("__dict__", "_about", "_memory", "_sensed", "_state", "time")

    def __init__(self, about: Airframe, time: Ns, rows: tuple[list[float], list[float], list[float]]) -> None:
        self._about = about
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
        return self._about.frame.from_ned(self._vector(K_POSITION))

    @cached_property
    def origin(self) -> Vector:
        """Latitude, longitude and metres AMSL of the estimator's origin."""
        return self._about.frame.from_ned(self._vector(K_ORIGIN))

    @property
    def origin_ned(self) -> Vector:
        """The estimator's origin: north, east, down about the world's [m]."""
        return self._vector(K_ORIGIN)

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
        return self._four(K_SIGMA)

    @property
    def heading_error(self) -> float:
        """Last difference of compass and estimate [rad]."""
        return self._one(K_HEADING_ERROR)

    @property
    def gps_innovation(self) -> float:
        """Last difference of fix and estimate in the plane, in standard deviations of it."""
        return self._one(K_GPS_INNOVATION)

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
        return float(pressure_at(self._about.frame.amsl + self._sensed[M_BARO - M_GYRO])) / 100.0

    @property
    def rangefinder(self) -> float | None:
        """Metres to the ground along the body's down axis; None out of range."""
        distance = self._sensed[M_RANGE - M_GYRO]
        return distance if distance >= 0.0 else None

    @cached_property
    def gps(self) -> GpsFix:
        """The last fix."""
        return _fix_of(self._about, self._sensed)

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
        return max(0.0, 1.0 - self._state[0] / self._about.capacity_as)

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
        if self._about.flying:
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
        return self._one(K_HOVER_THROTTLE)

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
